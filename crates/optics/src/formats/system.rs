//! A lens as design programs write it: with an entrance pupil and fields instead of clear diameters.
//!
//! Such files often leave the diameters to the program. [`System::build`] makes a lens of them: the stop is as wide as
//! the stated pupil or f-number makes it (to first order), and every surface without a stated rim is as wide as the
//! exact rays of the stated fields and wavelengths need.

mod rims;

use glam::DVec2;

use crate::{
    Aperture, CoordinateBreak, DiffractiveSurface, Glass, ImageSurface, Interface, Lens, OpticsError, PhaseProfile,
    Shape, Surface, glass::D_LINE_NM,
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

/// Returns a sentence on a film that is more than a sphere or a conic, of which the rest is left out; `shape` is that of its file.
pub(super) fn note_on_film(shape: Result<Shape, TextError>) -> Option<String> {
    let is_held = match shape {
        Ok(Shape::Sphere | Shape::Conic { .. }) => true,
        Ok(Shape::EvenAsphere { coefficients, .. } | Shape::OddAsphere { coefficients, .. }) => {
            coefficients.iter().all(|a| *a == 0.0)
        }
        _ => false,
    };
    (!is_held).then(|| {
        "the film is no sphere or conic: of its shape, curvature and conic constant are taken alone".to_owned()
    })
}

/// Returns a sentence on an object at this distance that is curved, which is taken for a plane.
pub(super) fn note_on_object(distance_mm: f64, curvature_per_mm: f64) -> Option<String> {
    (distance_mm.is_finite() && curvature_per_mm != 0.0)
        .then(|| format!("the object is taken for a plane: its radius of {} mm is left out", 1.0 / curvature_per_mm))
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
            stated.apertures.iter().map(move |aperture| Aperture { surface, ..aperture.clone() }).collect::<Vec<_>>()
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
