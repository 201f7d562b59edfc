//! A lens as design programs write it: with an entrance pupil and fields instead of clear diameters.
//!
//! Such files often leave the diameters to the program. [`System::build`] makes a lens of them: the stop is as wide as
//! the stated pupil or f-number makes it (to first order), and every surface without a stated rim is as wide as the
//! exact rays of the stated fields and wavelengths need.

use glam::{DVec2, DVec3};

use crate::{
    Aperture, CoordinateBreak, DiffractiveSurface, Glass, ImageSurface, Interface, Lens, MonoLens, ObjectPoint,
    OpticsError, PhaseProfile, Placement, RayBatch, Shape, Surface, Vignetting, analysis::PupilCoordinates,
    glass::D_LINE_NM, rays_towards,
};

use super::{
    lens_file::{Field, LensFile, weights_of},
    number::decimal_sum,
    text_error::TextError,
};

/// A surface of a design program's file, in mm.
#[derive(Clone, Debug)]
pub(super) struct SystemSurface {
    /// Where the file begins to speak of it.
    pub(super) line: usize,
    /// What the file calls it.
    pub(super) comment: String,
    pub(super) curvature_per_mm: f64,
    pub(super) shape: Shape,
    pub(super) medium_after: Glass,
    pub(super) thickness_after_mm: f64,
    /// The rim, where the file states one.
    pub(super) semi_aperture_mm: Option<f64>,
    /// Whether it reflects; the medium behind it is then that before it.
    pub(super) is_mirror: bool,
    /// The order and the phase of a grating or diffractive surface.
    pub(super) phase: Option<(i32, PhaseProfile)>,
    /// Whether the rim is one that stops light, not merely where the program's rays went.
    pub(super) is_rim_fixed: bool,
    /// What bounds light beside the rim, of whichever surface.
    pub(super) apertures: Vec<Aperture>,
}

impl SystemSurface {
    /// Returns the surface with an opening, and with a rim that is as wide as the opening and the surface need.
    pub(super) fn with_aperture(mut self, aperture: Aperture) -> Self {
        if !aperture.is_obscuration {
            let extent_mm = aperture.extent_mm();
            let is_rotational = self.shape.is_rotational();
            self.semi_aperture_mm = Some(if is_rotational { extent_mm.min(widest_mm(&self)) } else { extent_mm });
            self.is_rim_fixed = true;
        }
        self.apertures.push(aperture);
        self
    }
}

impl SystemSurface {
    /// Returns the surface with a rim that is no wider than the surface itself, and adds a note where it was.
    pub(super) fn with_rim_that_fits(mut self, notes: &mut Vec<String>) -> Self {
        let widest_mm = widest_mm(&self) * (1.0 - 1e-9);
        if let Some(semi_aperture_mm) = self.semi_aperture_mm.filter(|mm| *mm > widest_mm) {
            notes.push(format!(
                "line {}: a diameter of {} mm does not fit on a surface of radius {} mm: it is cut to {:.4} mm",
                self.line,
                2.0 * semi_aperture_mm,
                1.0 / self.curvature_per_mm,
                2.0 * widest_mm
            ));
            self.semi_aperture_mm = Some(widest_mm);
        }
        self
    }
}

/// A tilt and decenter, with the z along the axis at which it happens: from the file's first surface.
///
/// Its surfaces are those that the file has; the last may be beyond them, which means the film.
#[derive(Clone, Debug)]
pub(super) struct SystemMove {
    pub(super) z_mm: f64,
    pub(super) step: CoordinateBreak,
}

/// How wide the beam is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Beam {
    /// As wide as the rim of the stop lets it be.
    Stop,
    /// Diameter of the entrance pupil, mm.
    EntrancePupil(f64),
    /// Focal length over entrance pupil.
    FNumber(f64),
    /// One over twice the slope of the marginal ray in the image space, of the stated object, to first order.
    WorkingFNumber(f64),
    /// Half the angle of the cone at the object point, radians.
    ObjectCone(f64),
    /// Numerical aperture at the object point: the index there times the sine of the half angle.
    ObjectAperture(f64),
}

impl Beam {
    /// Returns what is stated, for messages.
    fn summary(self) -> String {
        match self {
            Self::Stop => "the stop".to_owned(),
            Self::EntrancePupil(diameter_mm) => format!("the stated entrance pupil of {diameter_mm} mm"),
            Self::FNumber(f_number) => format!("the stated f-number {f_number}"),
            Self::WorkingFNumber(f_number) => format!("the stated working f-number {f_number}"),
            Self::ObjectCone(angle_rad) => format!("the stated cone of {} degrees", angle_rad.to_degrees()),
            Self::ObjectAperture(aperture) => format!("the stated aperture {aperture} at the object"),
        }
    }
}

/// The part of the pupil that a field uses: `center + (1 − compression) · pupil`, in pupil radii.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FieldVignetting {
    pub(super) center: DVec2,
    pub(super) compression: DVec2,
}

/// Everything between the object and the image.
#[derive(Clone, Debug)]
pub(super) struct System {
    pub(super) name: String,
    pub(super) source: String,
    /// Distance from the object to the first surface, mm; infinite for a far object.
    pub(super) object_distance_mm: f64,
    pub(super) object_medium: Glass,
    /// z along the axis of the first surface, in the count of the moves.
    pub(super) first_vertex_z_mm: f64,
    pub(super) surfaces: Vec<SystemSurface>,
    pub(super) moves: Vec<SystemMove>,
    pub(super) image_surface: ImageSurface,
    pub(super) stop: Option<usize>,
    pub(super) beam: Option<Beam>,
    pub(super) wavelengths_nm: Vec<f64>,
    /// One each of the wavelengths; what is not stated counts as 1.
    pub(super) wavelength_weights: Vec<f64>,
    /// Index into the wavelengths.
    pub(super) reference: usize,
    pub(super) fields: Vec<(Field, FieldVignetting)>,
    /// One each of the fields; what is not stated counts as 1.
    pub(super) field_weights: Vec<f64>,
    pub(super) comments: Vec<String>,
    pub(super) notes: Vec<String>,
    /// Whether the planes at which nothing happens are left out already.
    pub(super) is_reduced: bool,
}

/// How far from the axis a ray is that stands for those of first-order theory, mm.
const NEAR_AXIS_MM: f64 = 1e-6;
/// By how much of it a stated beam may be wider than the stop's rim and still fill it: rims in files are rounded.
const ROUNDED: f64 = 1e-3;
/// Directions in which rays are sent through the edge of the pupil.
const N_AZIMUTHS: usize = 32;
/// A rim that was found by rays is this much wider than they need, so that rounding does not cut them.
const SLACK: f64 = 1.0 + 1e-9;

impl System {
    /// Returns the lens and what the file says about its use.
    pub(super) fn build(mut self) -> Result<LensFile, TextError> {
        if !(1..=1000).contains(&self.surfaces.len()) {
            return Err(OpticsError::SurfaceCount { n_surfaces: self.surfaces.len() }.into());
        }
        let stop_of = |system: &Self| system.stop.filter(|&stop| stop < system.surfaces.len());
        if stop_of(&self).is_none() {
            return Err(OpticsError::Stops { n_stops: 0 }.into());
        }
        self.check_use()?;
        if !self.is_reduced {
            let is_kept: Vec<bool> = self.dummies().into_iter().map(|is_dummy| !is_dummy).collect();
            self.keep(&is_kept);
        }
        let Some(stop) = stop_of(&self) else { return Err(OpticsError::Stops { n_stops: 0 }.into()) };
        if self.is_film_backward() {
            self.image_surface.curvature_per_mm *= -1.0;
        }
        let film_distance_mm = self.film_distance_mm();
        let reference_nm = self.wavelengths_nm.get(self.reference).copied();
        let lens = self.provisional(stop)?;
        let mono = lens.at(reference_nm.unwrap_or(D_LINE_NM))?;
        let stop_semi_aperture_mm = self.stop_semi_aperture_mm(&mono)?;
        let mut interfaces = lens.interfaces().to_vec();
        interfaces[stop].surface.semi_aperture_mm = stop_semi_aperture_mm;
        let are_rims_found =
            self.surfaces.iter().enumerate().any(|(i, surface)| i != stop && surface.semi_aperture_mm.is_none());
        self.notes.extend(self.note_on_vignetting(are_rims_found));
        if are_rims_found {
            let found = self.clear_semi_apertures_mm(&lens, stop_semi_aperture_mm)?;
            for (i, (interface, found)) in interfaces.iter_mut().zip(found).enumerate() {
                if i != stop && self.surfaces[i].semi_aperture_mm.is_none() {
                    interface.surface.semi_aperture_mm = found;
                }
            }
        }
        let lens = self.lens(interfaces, stop)?;
        self.notes.extend(note_on_shadows(&lens));
        Ok(LensFile {
            lens,
            film_distance_mm,
            object_distance_mm: Some(self.object_distance_mm).filter(|distance| distance.is_finite()),
            wavelength_weights: weights_of(&self.wavelength_weights, self.wavelengths_nm.len()),
            wavelengths_nm: self.wavelengths_nm,
            reference_wavelength_nm: reference_nm,
            field_weights: weights_of(&self.field_weights, self.fields.len()),
            fields: self.fields.iter().map(|(field, _)| *field).collect(),
            surface_comments: comments_of(&self.surfaces),
            comments: self.comments,
            microlens: None,
            configurations: Vec::new(),
            configuration: 1,
            notes: self.notes,
        })
    }

    /// Checks the numbers that say how the lens is used.
    fn check_use(&self) -> Result<(), TextError> {
        let stated = [
            (
                "wavelength",
                self.wavelengths_nm.iter().find(|nm| !(nm.is_finite() && **nm > 0.0)),
                " nm, expected more than 0",
            ),
            (
                "weight of a wavelength",
                self.wavelength_weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)),
                ", expected 0 or more",
            ),
            (
                "weight of a field",
                self.field_weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)),
                ", expected 0 or more",
            ),
        ];
        let is_wrong = |field: &Field| {
            let (Field::Angle { x_deg: x, y_deg: y }
            | Field::ObjectHeight { x_mm: x, y_mm: y }
            | Field::ImageHeight { x_mm: x, y_mm: y }
            | Field::RealImageHeight { x_mm: x, y_mm: y }) = field;
            !(x.is_finite() && y.is_finite())
        };
        if self.fields.iter().any(|(field, _)| is_wrong(field)) {
            return Err(plain("a field is infinite, expected finite angles or heights"));
        }
        let n_wavelengths = self.wavelengths_nm.len();
        if n_wavelengths > 0 && self.reference >= n_wavelengths {
            let found = self.reference.saturating_add(1);
            return Err(plain(&format!("the reference wavelength is number {found}, expected 1 to {n_wavelengths}")));
        }
        match stated.into_iter().find_map(|(what, found, expected)| Some((what, found?, expected))) {
            Some((what, found, expected)) => Err(plain(&format!("a {what} is {found}{expected}"))),
            None => Ok(()),
        }
    }

    /// Whether light runs towards −z before the film: behind an odd number of mirrors.
    fn is_film_backward(&self) -> bool {
        self.surfaces.iter().filter(|surface| surface.is_mirror).count() % 2 == 1
    }

    /// Returns how far behind the last surface the film lies, along the light, mm.
    fn film_distance_mm(&self) -> Option<f64> {
        let along_z_mm = self.surfaces.last()?.thickness_after_mm;
        let film_distance_mm = if self.is_film_backward() { -along_z_mm } else { along_z_mm };
        film_distance_mm.is_finite().then_some(film_distance_mm)
    }

    /// Returns the lens of these surfaces, tilted and decentered as the file says.
    fn lens(&self, interfaces: Vec<Interface>, stop: usize) -> Result<Lens, OpticsError> {
        let n_surfaces = interfaces.len();
        let (name, source) = (self.name.clone(), self.source.clone());
        let lens = Lens::new_with_apertures(name, source, interfaces, stop, self.apertures())?;
        let vertices_z_mm = lens.vertices_z_mm();
        let in_lens = |SystemMove { z_mm, step }: &SystemMove| {
            let (first, last) = step.surfaces;
            let pivot_mm = z_mm - self.first_vertex_z_mm - vertices_z_mm[first.min(n_surfaces - 1)];
            // What is left where two sums of the same distances meet.
            let pivot_mm = if pivot_mm.abs() < 1e-12 { 0.0 } else { pivot_mm };
            CoordinateBreak { surfaces: (first, last.min(n_surfaces)), pivot_mm, ..*step }
        };
        let moves = self.moves.iter().map(in_lens).collect();
        let lens = lens.with_object_medium(self.object_medium.clone())?;
        let mirrors = self.surfaces.iter().enumerate().filter_map(|(i, surface)| surface.is_mirror.then_some(i));
        let diffractive = self.surfaces.iter().enumerate().filter_map(|(surface, stated)| {
            let (order, profile) = stated.phase.clone()?;
            Some(DiffractiveSurface { surface, order, profile, blaze: None })
        });
        let lens = lens.with_diffractive(diffractive.collect())?;
        lens.with_mirrors(mirrors)?.with_moves(moves)?.with_image_surface(self.image_surface)
    }

    /// Returns the apertures of all surfaces, each with the surface's number.
    fn apertures(&self) -> Vec<Aperture> {
        let of_surface = |(surface, stated): (usize, &SystemSurface)| {
            stated.apertures.iter().map(move |&aperture| Aperture { surface, ..aperture }).collect::<Vec<_>>()
        };
        self.surfaces.iter().enumerate().flat_map(of_surface).collect()
    }

    /// Which surfaces are planes at which nothing happens to any ray.
    pub(super) fn dummies(&self) -> Vec<bool> {
        let is_dummy = |(i, surface): (usize, &SystemSurface)| {
            let is_plane = surface.shape == Shape::Sphere && surface.curvature_per_mm == 0.0;
            self.stop != Some(i)
                && is_plane
                && !surface.is_mirror
                && surface.phase.is_none()
                && !surface.is_rim_fixed
                && surface.apertures.is_empty()
                && surface.medium_after == *self.medium_before(i)
        };
        self.surfaces.iter().enumerate().map(is_dummy).collect()
    }

    /// Drops all surfaces but these, of which at least one is left.
    pub(super) fn keep(&mut self, is_kept: &[bool]) {
        let (mut dropped, first_z_mm) = (Vec::new(), self.first_vertex_z_mm);
        for i in (0..self.surfaces.len()).rev().filter(|&i| !is_kept[i]) {
            if self.surfaces.len() == 1 {
                break;
            }
            let thickness_mm = self.surfaces[i].thickness_after_mm;
            match i {
                0 => {
                    self.object_distance_mm = decimal_sum(self.object_distance_mm, thickness_mm);
                    self.first_vertex_z_mm = decimal_sum(self.first_vertex_z_mm, thickness_mm);
                }
                _ => {
                    let before = &mut self.surfaces[i - 1];
                    before.thickness_after_mm = decimal_sum(before.thickness_after_mm, thickness_mm);
                }
            }
            dropped.push(self.surfaces.remove(i).line);
            self.moves.retain(|step| step.step.surfaces != (i, i));
            for SystemMove { step, .. } in &mut self.moves {
                let (first, last) = step.surfaces;
                step.surfaces = (first - usize::from(first > i), last - usize::from(last >= i && last != usize::MAX));
            }
            self.stop = self.stop.map(|stop| stop - usize::from(i < stop));
        }
        self.is_reduced = true;
        dropped.reverse();
        self.notes.extend(note_on_dummies(&dropped, self.first_vertex_z_mm - first_z_mm));
    }

    /// Returns the lens with rims as wide as its surfaces allow where the file states none.
    fn provisional(&self, stop: usize) -> Result<Lens, TextError> {
        let mut interfaces = Vec::with_capacity(self.surfaces.len());
        let apertures = self.apertures();
        for (i, surface) in self.surfaces.iter().enumerate() {
            let is_last = i + 1 == self.surfaces.len();
            let at_line = |error: OpticsError| TextError { line: Some(surface.line), reason: error.to_string() };
            let interface = Interface {
                surface: Surface {
                    curvature_per_mm: surface.curvature_per_mm,
                    shape: surface.shape.clone(),
                    semi_aperture_mm: surface.semi_aperture_mm.unwrap_or(widest_mm(surface)),
                },
                medium_after: surface.medium_after.clone(),
                thickness_after_mm: if is_last { 0.0 } else { surface.thickness_after_mm },
            };
            interface.surface.check(i, &apertures).and_then(|()| interface.medium_after.check()).map_err(at_line)?;
            if !interface.thickness_after_mm.is_finite() {
                let found = interface.thickness_after_mm;
                let expected = "a finite number: only the object may be infinitely far";
                return Err(at_line(OpticsError::Surface { surface: i, key: "thickness", found, expected }));
            }
            interfaces.push(interface);
        }
        Ok(self.lens(interfaces, stop)?)
    }

    /// Returns half the diameter of the stop that lets the stated beam through.
    fn stop_semi_aperture_mm(&mut self, mono: &MonoLens) -> Result<f64, TextError> {
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

    /// Returns a sentence on the vignetting factors of the fields, if the file states any: rims end rays, factors do not.
    fn note_on_vignetting(&self, are_rims_found: bool) -> Option<String> {
        let n_fields = self.fields.iter().filter(|(_, vignetting)| *vignetting != FieldVignetting::default()).count();
        let of_fields = if n_fields == 1 { "1 field" } else { &format!("{n_fields} fields") };
        let use_of_them = match are_rims_found {
            true => {
                "rims that the file does not state are those that the so narrowed pupils need, and end rays of every field alike"
            }
            false => "the rims that the file states end rays, and the factors do not",
        };
        (n_fields > 0).then(|| format!("vignetting factors of {of_fields}: {use_of_them}"))
    }

    /// The medium before a surface.
    fn medium_before(&self, surface: usize) -> &Glass {
        surface.checked_sub(1).map_or(&self.object_medium, |before| &self.surfaces[before].medium_after)
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
    fn clear_semi_apertures_mm(&mut self, lens: &Lens, stop_semi_aperture_mm: f64) -> Result<Vec<f64>, TextError> {
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

/// Returns a sentence on planes that were left out, which the file has at these lines, and by how much the lens begins later
/// for it.
fn note_on_dummies(lines: &[usize], later_mm: f64) -> Option<String> {
    let list: Vec<String> = lines.iter().map(usize::to_string).collect();
    let which = match lines {
        [] => return None,
        [_] => format!("the plane of line {}, at which nothing happens to light, is left out", list[0]),
        _ => format!("the planes of lines {}, at which nothing happens to light, are left out", list.join(", ")),
    };
    Some(match later_mm == 0.0 {
        true => which,
        false => format!("{which}: the lens begins {later_mm} mm behind it"),
    })
}

/// Returns what the file calls each surface; nothing where it names none.
fn comments_of(surfaces: &[SystemSurface]) -> Vec<String> {
    match surfaces.iter().all(|surface| surface.comment.is_empty()) {
        true => Vec::new(),
        false => surfaces.iter().map(|surface| surface.comment.clone()).collect(),
    }
}

/// Returns a sentence on mirrors that stand in the light to others where the file states no obscuration.
fn note_on_shadows(lens: &Lens) -> Option<String> {
    let shadow = lens.mirror_shadows().into_iter().next()?;
    let is_any_stated = lens.apertures().iter().any(|aperture| aperture.is_obscuration);
    (!is_any_stated).then(|| {
        format!(
            "the mirror {} stands in the light to surface {}, and no obscuration is stated: its shadow is left out",
            shadow.mirror, shadow.before
        )
    })
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

/// Returns the widest rim that fits on a surface, mm.
fn widest_mm(surface: &SystemSurface) -> f64 {
    let widest = |curvature_per_mm: f64, conic: f64| {
        let flattened = (1.0 + conic) * curvature_per_mm * curvature_per_mm;
        if flattened > 0.0 { (1.0 / flattened.sqrt()).min(1e6) } else { 1e6 }
    };
    let along_y = |conic: f64| widest(surface.curvature_per_mm, conic);
    match surface.shape {
        Shape::Conic { conic } | Shape::EvenAsphere { conic, .. } | Shape::OddAsphere { conic, .. } => along_y(conic),
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            along_y(conic).min(widest(curvature_x_per_mm, conic_x))
        }
        // A ring's curve may rise towards the axis of rotation: half as wide is safe for all but odd ones.
        Shape::Toroid { conic, curvature_x_per_mm, .. } => 0.5 * along_y(conic).min(widest(curvature_x_per_mm, 0.0)),
        _ => along_y(0.0),
    }
}

fn plain(reason: &str) -> TextError {
    TextError { line: None, reason: reason.to_owned() }
}
