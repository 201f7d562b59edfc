//! Footprints: where the light of each field meets the surfaces of a lens.

use dioptric_optics::{Aperture, Lens, Placement, PupilBoundary, Vignetting, glam::DVec2};

use super::{
    request::Field,
    rows::{FieldPlace, LensAnalysis},
};
use dioptric_pipeline::PipelineError;

/// Places of an outline.
const AZIMUTHS: usize = 96;
/// How far within the edge of the pupil the rays of an outline are, over its radius, so that rounding does not end them.
const WITHIN: f64 = 1.0 - 1e-9;

/// Where light meets a surface, in the surface's own frame, mm: x to the right for the photographer and y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// The surface, counted from 0.
    pub surface: usize,
    /// The rim, and openings and obscurations beside it.
    pub rims_mm: Vec<Vec<(f64, f64)>>,
    /// The edge of the light of each lit field at the reference wavelength, closed.
    pub edges_mm: Vec<(FieldPlace, Vec<(f64, f64)>)>,
}

impl LensAnalysis {
    /// Returns the footprints on all surfaces of the lens that was analyzed, of its fields at the reference wavelength.
    ///
    /// # Errors
    /// When a glass is not known there.
    pub fn footprints(&self, lens: &Lens) -> Result<Vec<Footprint>, PipelineError> {
        let mono = lens.at(self.reference_nm)?;
        let dioptres = 1e3 / (self.distance_mm + mono.projection_center_z_mm());
        let placements: Vec<Placement> = (0..lens.interfaces().len()).map(|i| mono.surface_placement(i)).collect();
        let mut footprints: Vec<Footprint> = lens
            .interfaces()
            .iter()
            .enumerate()
            .map(|(surface, interface)| {
                let rim = circle(interface.surface.semi_aperture_mm, DVec2::ZERO);
                let apertures = lens.apertures().iter().filter(|aperture| aperture.surface == surface);
                Footprint {
                    surface,
                    rims_mm: std::iter::once(rim).chain(apertures.map(edge_of)).collect(),
                    edges_mm: Vec::new(),
                }
            })
            .collect();
        for row in &self.fields {
            let point = Field::of_place(&row.place).point(&mono, dioptres);
            let Some(boundary) = PupilBoundary::find(&mono, &point, AZIMUTHS) else { continue };
            let center_mm = boundary.center_mm();
            let edge_mm: Vec<DVec2> =
                boundary.edge_mm().into_iter().map(|place| center_mm + (place - center_mm) * WITHIN).collect();
            let mut rays = boundary.plane().rays(&mono, &point, &edge_mm);
            for (footprint, placement) in footprints.iter_mut().zip(&placements) {
                let surface = footprint.surface;
                mono.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
                let place = |ray: usize| placement.surface_from_lens(rays.point_mm(ray)).truncate();
                let met = (0..rays.len()).filter(|&ray| rays.fate[ray].is_in_flight()).map(place);
                let mut points: Vec<(f64, f64)> = met.map(|p| (p.x, p.y)).collect();
                points.extend(points.first().copied());
                footprint.edges_mm.push((row.place, points));
            }
        }
        Ok(footprints)
    }
}

impl Footprint {
    /// The largest distance of light from the middle over the rim's radius.
    pub fn share_of_rim(&self) -> f64 {
        let farthest = |points: &[(f64, f64)]| points.iter().map(|p| p.0.hypot(p.1)).fold(0.0, f64::max);
        let rim_mm = self.rims_mm.first().map_or(f64::NAN, |rim| farthest(rim));
        self.edges_mm.iter().map(|(_, edge)| farthest(edge)).fold(0.0, f64::max) / rim_mm
    }
}

fn circle(radius_mm: f64, center_mm: DVec2) -> Vec<(f64, f64)> {
    ellipse(DVec2::splat(radius_mm), center_mm)
}

fn ellipse(half_mm: DVec2, center_mm: DVec2) -> Vec<(f64, f64)> {
    let at = |i: usize| center_mm + half_mm * DVec2::from_angle(std::f64::consts::TAU * i as f64 / AZIMUTHS as f64);
    (0..=AZIMUTHS).map(|i| at(i % AZIMUTHS)).map(|p| (p.x, p.y)).collect()
}

fn edge_of(aperture: &Aperture) -> Vec<(f64, f64)> {
    let mut edge: Vec<(f64, f64)> = aperture.edge_mm().map(|place| place.into()).collect();
    edge.extend(edge.first().copied());
    edge
}

#[cfg(test)]
mod tests {
    use crate::{AnalysisFields, AnalysisFilm, AnalysisRequest};

    /// A beam of 10 mm through a thin lens of 50 mm that is its stop, and on a window 20 mm behind: to 1 − 20/50 of it, shifted by
    /// 20 tan θ.
    #[test]
    fn footprints_are_those_of_similar_triangles() {
        let text = r#"(name: "window", source: "test", surfaces: [
            (stop: true, shape: ThinLens(power_per_mm: 0.02), semi_aperture_mm: 5.0, thickness_mm: 20.0),
            (semi_aperture_mm: 8.0, thickness_mm: 0.0)])"#;
        let file = dioptric_optics::LensFile::from_bytes(
            std::path::Path::new("window.ron"),
            text.as_bytes(),
            &dioptric_optics::ReadOptions::default(),
        );
        let lens = file.unwrap().lens;
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 5.0]),
            wavelengths_nm: vec![550.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film: AnalysisFilm::BestFocus,
            n_rings: 4,
        };
        let footprints = request.compute(&lens).unwrap().footprints(&lens).unwrap();
        assert_eq!(footprints.len(), 2);
        let shift_mm = 20.0 * 5f64.to_radians().tan();
        for (footprint, radius_mm, shifts_mm) in
            [(&footprints[0], 5.0, [0.0, 0.0]), (&footprints[1], 3.0, [0.0, shift_mm])]
        {
            for ((_, edge), shift_mm) in footprint.edges_mm.iter().zip(shifts_mm) {
                for (x, y) in edge {
                    // The point above the axis is imaged below it.
                    assert!((x.hypot(y + shift_mm) - radius_mm).abs() < 1e-6, "{x} {y} {shift_mm}");
                }
            }
        }
        assert!((footprints[1].share_of_rim() - (3.0 + shift_mm) / 8.0).abs() < 1e-6);
    }
}
