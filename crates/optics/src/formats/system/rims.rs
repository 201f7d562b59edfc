//! How wide the stop and the rims are that a design program's file leaves to the program: as wide as the stated beam and fields need.

use glam::{DVec2, DVec3};

use super::{Beam, FieldVignetting, System, plain};
use crate::{
    Aperture, Lens, MonoLens, ObjectPoint, Placement, RayBatch, Shape, Vignetting,
    analysis::PupilCoordinates,
    formats::{lens_file::Field, text_error::TextError},
    glass::D_LINE_NM,
    rays_towards,
};

/// How far from the axis a ray is that stands for those of first-order theory, mm.
const NEAR_AXIS_MM: f64 = 1e-6;
/// By how much of it a stated beam may be wider than the stop's rim and still fill it: rims in files are rounded.
const ROUNDED: f64 = 1e-3;
/// Directions in which rays are sent through the edge of the pupil.
const N_AZIMUTHS: usize = 32;
/// A rim that was found by rays is this much wider than they need, so that rounding does not cut them.
const SLACK: f64 = 1.0 + 1e-9;

impl System {
    /// Returns half the diameter of the stop that lets the stated beam through.
    pub(super) fn stop_semi_aperture_mm(&mut self, mono: &MonoLens) -> Result<f64, TextError> {
        let first = mono.first_order_of_stop();
        let now_mm = mono.stop_semi_aperture_mm();
        let is_rim_stated = self.surfaces[mono.stop()].semi_aperture_mm.is_some();
        let beam = match self.beam {
            Some(Beam::EntrancePupil(0.0)) | None => Beam::Stop,
            Some(beam) => beam,
        };
        // The beam over the one that the stop as it is now lets through.
        let to_stop = mono.marginal_ray_of_stop(self.object_distance_mm);
        let slope_now = to_stop.reduced_slope / first.object_index;
        let ratio = match beam {
            Beam::Stop if is_rim_stated => return Ok(now_mm),
            Beam::Stop => return self.widest_stop_mm(mono),
            Beam::EntrancePupil(diameter_mm) => diameter_mm / first.entrance_pupil_diameter_mm,
            Beam::FNumber(f_number) => first.f_number / f_number.abs(),
            Beam::WorkingFNumber(f_number) => 0.5 / (to_stop.reduced_slope_after * f_number).abs(),
            Beam::ObjectCone(angle_rad) => angle_rad.tan() / slope_now,
            Beam::ObjectAperture(aperture) => (aperture / first.object_index).asin().tan() / slope_now,
        };
        let semi_aperture_mm = now_mm * ratio;
        if semi_aperture_mm > 0.0 && semi_aperture_mm.is_finite() {
            return Ok(self.within_rim_of_stop_mm(mono.stop(), semi_aperture_mm, beam));
        }
        let (beam, pupil_mm) = (beam.summary(), ratio * first.entrance_pupil_diameter_mm);
        Err(plain(&format!(
            "{beam} makes an entrance pupil of {pupil_mm} mm and a stop of {} mm; expected positive ones",
            2.0 * semi_aperture_mm
        )))
    }

    /// Returns half the diameter of the stop that a stated beam asks for or, where what bounds the light on the stop's own surface
    /// is narrower, of that, which is noted.
    ///
    /// Openings bound it, and fixed rims of surfaces that bend light: so do Zemax's. A rim that the beam exceeds by rounding does not.
    fn within_rim_of_stop_mm(&mut self, stop: usize, beam_mm: f64, beam: Beam) -> f64 {
        let stated = &self.surfaces[stop];
        let openings = stated.apertures.iter().filter(|aperture| !aperture.is_obscuration).map(Aperture::extent_mm);
        let bends_light = stated.curvature_per_mm != 0.0
            || stated.shape != Shape::Sphere
            || stated.medium_after != *self.medium_before(stop);
        let rim = stated.semi_aperture_mm.filter(|_| stated.is_rim_fixed && bends_light);
        let rim_mm = openings.chain(rim).fold(f64::INFINITY, f64::min);
        if rim_mm >= beam_mm * (1.0 - ROUNDED) {
            return beam_mm;
        }
        self.notes.push(format!(
            "the rim or opening of the stop, {:.4} mm across, limits the light: {} would fill {:.4} mm",
            2.0 * rim_mm,
            beam.summary(),
            2.0 * beam_mm
        ));
        rim_mm
    }

    /// Returns half the diameter of a stop of which the file says nothing: the widest axial beam, to first order, that
    /// the rims of the other surfaces let through.
    fn widest_stop_mm(&mut self, mono: &MonoLens) -> Result<f64, TextError> {
        let target = [DVec2::new(0.0, NEAR_AXIS_MM)];
        let point = match self.object_distance_mm.is_finite() {
            true => ObjectPoint::Finite(DVec3::new(0.0, 0.0, -self.object_distance_mm)),
            false => ObjectPoint::from_field(mono, DVec2::ZERO, 0.0),
        };
        let mut rays = rays_towards(&point, &target, mono.projection_center_z_mm(), 0.0);
        let placements: Vec<Placement> =
            (0..mono.n_surfaces()).map(|i| Placement::centered(mono.vertex_z_mm(i))).collect();
        let placements = mono.placements().unwrap_or(&placements);
        let mut heights_mm = Vec::with_capacity(mono.n_surfaces());
        for (surface, placement) in placements.iter().enumerate() {
            mono.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
            heights_mm.push(placement.surface_from_lens(rays.point_mm(0)).truncate().length());
        }
        let at_stop_mm = heights_mm[mono.stop()];
        let rims = self.surfaces.iter().map(|surface| surface.semi_aperture_mm);
        let limits = rims.zip(&heights_mm).filter_map(|(rim_mm, height_mm)| Some(rim_mm? * at_stop_mm / height_mm));
        let widest_mm = limits.filter(|limit_mm| *limit_mm > 0.0).fold(f64::INFINITY, f64::min);
        if !(rays.fate[0].is_in_flight() && widest_mm.is_finite()) {
            return Err(plain("neither an entrance pupil, an f-number nor the stop's diameter is stated"));
        }
        self.notes.push(format!(
            "no width of the beam or of the stop is stated: the stop is as wide as the other rims let an axial beam be, \
             {:.4} mm",
            2.0 * widest_mm
        ));
        Ok(widest_mm)
    }

    /// Returns how far from the axis the rays of the stated fields and wavelengths meet each surface, mm.
    pub(super) fn clear_semi_apertures_mm(
        &mut self,
        lens: &Lens,
        stop_semi_aperture_mm: f64,
    ) -> Result<Vec<f64>, TextError> {
        let mut interfaces = lens.interfaces().to_vec();
        interfaces[lens.stop()].surface.semi_aperture_mm = stop_semi_aperture_mm;
        let lens = self.lens(interfaces, lens.stop())?;
        let placements = lens.placements();
        let on_axis = [(Field::Angle { x_deg: 0.0, y_deg: 0.0 }, FieldVignetting::default())];
        let fields = if self.fields.is_empty() { &on_axis[..] } else { &self.fields[..] };
        let reference_nm = self.wavelengths_nm.get(self.reference).copied().unwrap_or(D_LINE_NM);
        let reference_nm = [reference_nm];
        let wavelengths_nm = if self.wavelengths_nm.is_empty() { &reference_nm[..] } else { &self.wavelengths_nm };
        let mut widest_mm = vec![0.0_f64; lens.interfaces().len()];
        for &wavelength_nm in wavelengths_nm {
            let mono = match lens.at(wavelength_nm) {
                Ok(mono) => mono,
                Err(error) if wavelength_nm != reference_nm[0] => {
                    self.notes.push(format!("the rims are found without {wavelength_nm} nm: {error}"));
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            for (field, vignetting) in fields {
                let point = self.object_point(&mono, *field)?;
                widen(&mut widest_mm, (&mono, &placements), &point, *vignetting);
            }
        }
        let unreached = widest_mm.iter().position(|&semi_aperture_mm| semi_aperture_mm == 0.0);
        match unreached {
            None => Ok(widest_mm.iter().map(|semi_aperture_mm| semi_aperture_mm * SLACK).collect()),
            Some(surface) => Err(TextError {
                line: Some(self.surfaces[surface].line),
                reason: "the surface here has no diameter, and no ray through the edge of the stated pupil reaches it"
                    .to_owned(),
            }),
        }
    }

    /// Returns the object point of a field: of an angle one below the axis where the light is to rise.
    fn object_point(&self, mono: &MonoLens, field: Field) -> Result<ObjectPoint, TextError> {
        let first = mono.first_order();
        let distance_mm = self.object_distance_mm;
        let tan = match field {
            Field::Angle { x_deg, y_deg } => -DVec2::new(x_deg.to_radians().tan(), y_deg.to_radians().tan()),
            Field::ObjectHeight { x_mm, y_mm } if distance_mm.is_finite() => {
                return Ok(ObjectPoint::Finite(DVec3::new(x_mm, y_mm, -distance_mm)));
            }
            Field::ObjectHeight { .. } => return Err(plain("a field is an object height, but the object is far away")),
            Field::RealImageHeight { x_mm, y_mm } => {
                let film_distance_mm = self.film_distance_mm();
                let dioptres = 1e3 / (distance_mm + mono.projection_center_z_mm());
                let tan =
                    film_distance_mm.and_then(|film| mono.field_tan_of_image(DVec2::new(x_mm, y_mm), film, dioptres));
                let missed = || format!("no chief ray meets the image at the stated height of {x_mm}, {y_mm} mm");
                tan.ok_or_else(|| plain(&missed()))?
            }
            Field::ImageHeight { x_mm, y_mm } if distance_mm.is_finite() => {
                let height_mm = DVec2::new(x_mm, y_mm) / mono.conjugate(distance_mm).magnification;
                return Ok(ObjectPoint::Finite(height_mm.extend(-distance_mm)));
            }
            Field::ImageHeight { x_mm, y_mm } => -DVec2::new(x_mm, y_mm) / (first.efl_mm * first.object_index),
        };
        let dioptres = 1e3 / (distance_mm + mono.projection_center_z_mm());
        Ok(ObjectPoint::from_field(mono, tan, dioptres))
    }
}

/// Widens the rims so that a ring of rays through the edge of the pupil, and the ray through its center, pass.
///
/// They are aimed at the paraxial entrance pupil; where that leads them past the stop, as in a wide-angle lens, or where
/// it is infinitely far, at the real stop.
fn widen(
    widest_mm: &mut [f64],
    (mono, placements): (&MonoLens, &[Placement]),
    point: &ObjectPoint,
    vignetting: FieldVignetting,
) {
    let on_ring = |i: usize| {
        let (sine, cosine) = (i as f64 * std::f64::consts::TAU / N_AZIMUTHS as f64).sin_cos();
        vignetting.center + (DVec2::ONE - vignetting.compression) * DVec2::new(cosine, sine)
    };
    let mut places: Vec<DVec2> = (0..N_AZIMUTHS).map(on_ring).collect();
    places.push(vignetting.center);
    // An opening may reach farther to one side than the beam that is named after it.
    let is_by_opening = mono.limiting_beam().is_some_and(|beam| beam.is_limited_by_opening);
    let coordinates = match mono.first_order_of_stop() {
        first if is_by_opening => PupilCoordinates::Entrance {
            z_mm: first.entrance_pupil_z_mm,
            radius_mm: 0.5 * first.entrance_pupil_diameter_mm,
        },
        _ => PupilCoordinates::entrance(mono),
    };
    let mut rays = coordinates.rays(mono, point, &places);
    if coordinates != PupilCoordinates::stop(mono) && !fills_stop(mono, rays.clone(), &places) {
        let aimed = PupilCoordinates::stop(mono).rays(mono, point, &places);
        if aimed.n_in_flight() == places.len() {
            rays = aimed;
        }
    }
    for (surface, widest_mm) in widest_mm.iter_mut().enumerate() {
        mono.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
        for ray in (0..rays.len()).filter(|&ray| rays.fate[ray].is_in_flight()) {
            let from_axis_mm = placements[surface].surface_from_lens(rays.point_mm(ray)).truncate().length();
            if from_axis_mm.is_finite() {
                *widest_mm = widest_mm.max(from_axis_mm);
            }
        }
    }
}

/// Whether rays aimed at these places of the paraxial pupil pass the stop near them: within half its radius.
fn fills_stop(mono: &MonoLens, mut rays: RayBatch, places: &[DVec2]) -> bool {
    mono.trace_surfaces(0..mono.stop() + 1, &mut rays, Vignetting::Off);
    let stop_mm = mono.stop_semi_aperture_mm();
    let miss = |i: usize| (mono.in_stop_mm(rays.point_mm(i)).length() / stop_mm - places[i].length()).abs();
    rays.n_in_flight() == rays.len() && (0..rays.len()).all(|i| miss(i) < 0.5)
}
