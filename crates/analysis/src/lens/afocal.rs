//! Lenses that send light off in parallel: angles take the place of heights.

use std::borrow::Cow;

use dioptric_optics::{Lens, MonoLens, Shape, Surface};
use dioptric_pipeline::PipelineError;
use serde::Serialize;

use super::film::{AnalysisFilm, FilmUse, IDEAL_MM};
use crate::{LineChart, Series};

/// How far away an image counts as infinitely far, over the front rim's radius.
const PARALLEL: f64 = 1e5;

/// How light that leaves a lens in parallel, or nearly so, is looked at: through an ideal lens right behind the last surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AfocalView {
    /// Focal length of the ideal lens, mm.
    pub ideal_focal_length_mm: f64,
    /// The tangent of the angle under which light of a far point leaves over that under which it comes in, negative for an image
    /// upside down; none where the lens has power.
    pub angular_magnification: Option<f64>,
    /// Diameter of the exit pupil of the lens alone, mm.
    pub exit_pupil_diameter_mm: f64,
    /// z of that pupil from the last vertex, mm: the eye relief.
    pub exit_pupil_z_mm: f64,
}

impl AfocalView {
    /// Returns how the light of an object is looked at, where a film is sought and there is none near, or where it was asked for;
    /// `None` of lenses that form an image.
    ///
    /// # Errors
    /// When a glass is not known at the reference wavelength.
    pub fn of(lens: &Lens, film: AnalysisFilm, of: &FilmUse<'_>) -> Result<Option<Self>, PipelineError> {
        let mono = of.reference(lens)?;
        let image_z_mm = mono.conjugate(of.distance_mm).image_z_mm;
        let is_parallel = image_z_mm.is_nan() || image_z_mm.abs() > PARALLEL * mono.semi_aperture_mm(0);
        let is_seen_so = match film {
            AnalysisFilm::Afocal => true,
            AnalysisFilm::BestFocus => is_parallel && has_power_somewhere(lens),
            AnalysisFilm::OfFile(_) | AnalysisFilm::FocusMm(_) | AnalysisFilm::FilmMm(_) => false,
        };
        let first = mono.first_order();
        Ok(is_seen_so.then(|| Self {
            ideal_focal_length_mm: IDEAL_MM,
            angular_magnification: angular_magnification(lens, &mono),
            exit_pupil_diameter_mm: first.exit_pupil_diameter_mm,
            exit_pupil_z_mm: first.exit_pupil_z_mm,
        }))
    }

    /// Returns the lens that is looked at: the lens itself or, where its light leaves in parallel, the lens with the ideal one behind it.
    ///
    /// # Errors
    /// Those of [`of`](Self::of).
    pub(crate) fn applied<'a>(
        lens: &'a Lens,
        film: AnalysisFilm,
        of: &FilmUse<'_>,
    ) -> Result<(Cow<'a, Lens>, Option<Self>), PipelineError> {
        match Self::of(lens, film, of)? {
            Some(view) => Ok((Cow::Owned(lens.with_ideal_lens_behind(IDEAL_MM)?), Some(view))),
            None => Ok((Cow::Borrowed(lens), None)),
        }
    }

    /// Returns a sentence on how the light is looked at.
    pub fn note(&self) -> String {
        let magnification = match self.angular_magnification {
            Some(magnification) => format!("; angular magnification {magnification:.4}"),
            None => String::new(),
        };
        format!(
            "the light is looked at through an ideal lens of {IDEAL_MM} mm right behind the last surface: on its film 1 µm is 1 µrad, \
             cycles/mm are cycles/mrad, and 1 mm of focus is 1/1000 dioptre{magnification}"
        )
    }

    /// Returns the label of an axis in the units of light that leaves in parallel: on the ideal lens's film 1 µm is 1 µrad and 1 mm
    /// 1 mrad, along the axis 1 mm is 1/1000 dioptre.
    pub fn in_angles(label: &str) -> String {
        let across = ["x, mm", "y, mm", "cycles"].iter().any(|start| label.starts_with(start));
        let label = label.replace("µm", "µrad").replace("/mm", "/mrad").replace("per mm", "per mrad");
        label.replace("mm", if across { "mrad" } else { "mD" })
    }

    /// Returns a chart with its words in these units.
    pub(crate) fn chart_in_angles(chart: LineChart) -> LineChart {
        let series = chart.series.into_iter();
        let series = series.map(|line| Series { label: line.label.as_deref().map(Self::in_angles), ..line });
        LineChart {
            title: Self::in_angles(&chart.title),
            x_label: Self::in_angles(&chart.x_label),
            y_label: Self::in_angles(&chart.y_label),
            series: series.collect(),
            ..chart
        }
    }

    /// Returns the angle from the axis, degrees, of light that lands at this height on the ideal lens's film, mm.
    pub fn angle_deg(&self, height_mm: f64) -> f64 {
        (height_mm / self.ideal_focal_length_mm).atan().to_degrees()
    }

    /// Returns how far behind the last vertex rays are drawn, mm, of a lens of this length: to the exit pupil, if that is near.
    pub fn drawn_to_mm(&self, length_mm: f64) -> f64 {
        let is_near = (0.05 * length_mm..=2.0 * length_mm).contains(&self.exit_pupil_z_mm);
        if is_near { self.exit_pupil_z_mm } else { 0.4 * length_mm }
    }
}

/// Returns the angular magnification of a lens without power, unless it has none anywhere, as a pinhole.
pub(crate) fn angular_magnification(lens: &Lens, mono: &MonoLens) -> Option<f64> {
    let first = mono.first_order();
    if first.power_per_mm != 0.0 || !has_power_somewhere(lens) {
        return None;
    }
    // Lagrange: n u y = n' u' y', at any distance.
    let lateral = mono.conjugate(1e3).magnification;
    let angular = first.object_index / (first.image_index * lateral);
    angular.is_finite().then_some(angular)
}

/// Whether any surface bends light: what has no power anywhere, like a pinhole, is no telescope.
fn has_power_somewhere(lens: &Lens) -> bool {
    let is_plane = |surface: &Surface| surface.curvature_per_mm == 0.0 && surface.shape == Shape::Sphere;
    lens.interfaces().iter().any(|interface| !is_plane(&interface.surface))
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use dioptric_optics::{Glass, Interface};

    use super::*;
    use crate::{AnalysisFields, AnalysisRequest, LensData, LensInfoRequest, PsfRequest, PsfSampling};

    /// Two ideal lenses of these focal lengths, their foci together, with the stop on the first.
    fn telescope(first_mm: f64, second_mm: f64) -> Lens {
        let ideal = |focal_mm: f64, semi_aperture_mm: f64, thickness_after_mm: f64| Interface {
            surface: Surface {
                curvature_per_mm: 0.0,
                shape: Shape::ThinLens { power_per_mm: 1.0 / focal_mm },
                semi_aperture_mm,
            },
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        let lenses = vec![ideal(first_mm, 10.0, first_mm + second_mm), ideal(second_mm, 100.0, 0.0)];
        Lens::new("telescope", "test", lenses, 0).unwrap()
    }

    fn analysis(film: AnalysisFilm) -> AnalysisRequest {
        AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 1.0, 3.0]),
            wavelengths_nm: vec![550.0],
            main_wavelength_nm: None,
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: f64::INFINITY,
            film,
            n_rings: 4,
        }
    }

    #[test]
    fn keplers_and_galileis_telescopes_magnify_angles_by_their_focal_lengths() {
        for (first_mm, second_mm) in [(200.0, 40.0), (200.0, -40.0), (50.0, 125.0)] {
            let lens = telescope(first_mm, second_mm);
            let magnification = -first_mm / second_mm;
            let analysis = analysis(AnalysisFilm::BestFocus).compute(&lens).unwrap();
            let view = analysis.afocal.expect("an afocal lens");
            assert_relative_eq!(view.angular_magnification.unwrap(), magnification, max_relative = 1e-12);
            // The exit pupil is the first lens as the second one images it.
            let exit_mm = second_mm * (first_mm + second_mm) / first_mm;
            assert_relative_eq!(view.exit_pupil_z_mm, exit_mm, max_relative = 1e-12);
            assert_relative_eq!(view.exit_pupil_diameter_mm, 20.0 / magnification.abs(), max_relative = 1e-12);
            for row in &analysis.fields {
                let tangent = row.place.field_deg.to_radians().tan();
                let angle_deg = view.angle_deg(row.height_mm.unwrap());
                assert_relative_eq!(angle_deg, (magnification * tangent).atan().to_degrees(), epsilon = 1e-9);
            }
            let question = LensInfoRequest {
                wavelength_nm: 550.0,
                distance_mm: None,
                field_deg: 1.0,
                colors_nm: None,
                blur_um: None,
            };
            let data = LensData::new(&lens, &question).unwrap();
            assert_relative_eq!(data.angular_magnification.unwrap(), magnification, max_relative = 1e-12);
            assert_relative_eq!(data.first_order.entrance_pupil_diameter_mm, 20.0, max_relative = 1e-9);
        }
    }

    /// A telescope drawn out by δ behind its focus leaves vergence V of an eyepiece f: V = δ / f² to first order.
    #[test]
    fn a_telescope_out_of_focus_is_off_by_its_dioptres() {
        let (second_mm, out_mm) = (40.0, 0.1);
        let mut interfaces = telescope(200.0, second_mm).interfaces().to_vec();
        interfaces[0].thickness_after_mm += out_mm;
        let lens = Lens::new("telescope", "test", interfaces, 0).unwrap();
        let analysis = analysis(AnalysisFilm::Afocal).compute(&lens).unwrap();
        assert_relative_eq!(analysis.film_distance_mm, IDEAL_MM);
        // The light converges: it is in focus before the film, nearer to that by V / (1 + V) of a metre.
        let vergence_mdpt = 1e6 * out_mm / (second_mm * second_mm);
        let focus_mm = analysis.fields[0].tangential_focus_mm.unwrap();
        assert_relative_eq!(focus_mm, -vergence_mdpt, max_relative = 0.08);
    }

    #[test]
    fn the_spread_of_a_telescope_is_an_angle() {
        // A beam of 4 mm leaves: half the light of Airy's figure lies within 0.535 λ/D, 80 % within 0.90 λ/D.
        let request = PsfRequest {
            fields_deg: vec![[0.0, 0.5]],
            distances_mm: vec![f64::INFINITY],
            wavelengths_nm: vec![550.0],
            film: AnalysisFilm::BestFocus,
            focus_nm: Vec::new(),
            main_nm: None,
            diffraction: dioptric_psf::Diffraction::Wave,
            pixel_um: 20.0,
            size: None,
            sampling: PsfSampling::Pupil,
            mtf_per_mm: vec![],
            seed: 1,
            spectral_weights: vec![],
        };
        let set = request.compute(&telescope(200.0, 40.0)).unwrap();
        let airy_um = 550e-6 / 4.0 * 1e6;
        assert_relative_eq!(set.rows[0].ee50_radius_um, 0.535 * airy_um, max_relative = 0.01);
        assert_relative_eq!(set.rows[0].centroid_y_mm, -5.0 * 0.5f64.to_radians().tan() * 1e3, max_relative = 1e-3);
        assert!(set.film.contains("ideal lens"), "{}", set.film);
    }
}
