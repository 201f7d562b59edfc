//! A lens: surfaces in a row, one of them the stop.

mod changes;
mod coatings;
mod iris;
mod media;
mod scale;

use glam::DVec2;

use crate::{
    Aperture, Coating, CoordinateBreak, DiffractiveSurface, Glass, GlassRange, Interface, Iris, OpticsError,
    PhaseProfile, Placement, Shape, Surface, WavefrontError, placement,
};

pub use self::changes::SurfaceChange;

/// A lens that has been checked and can be traced.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    // Invariants: 1 to 1000 interfaces whose numbers are finite and whose rims fit; `stop` is an index of them;
    // the stop's semi-aperture is at most `full_stop_semi_aperture_mm`; the moves have been checked; `mirrors` are indices of
    // interfaces in ascending order, and have the same medium on both sides.
    name: String,
    source: String,
    object_medium: Glass,
    interfaces: Vec<Interface>,
    stop: usize,
    full_stop_semi_aperture_mm: f64,
    iris: Option<Iris>,
    moves: Vec<CoordinateBreak>,
    apertures: Vec<Aperture>,
    mirrors: Vec<usize>,
    diffractive: Vec<DiffractiveSurface>,
    /// By surfaces, as far as they are stated.
    coatings: Vec<(usize, Coating)>,
    /// What covers the other surfaces between air and a denser medium; `None` where no light is lost at all.
    other_coating: Option<Coating>,
    image_surface: ImageSurface,
    glass_range: GlassRange,
}

/// The shape of the film: a conic with its vertex on the axis. As it stands by default, it is a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageSurface {
    /// One over the radius at the vertex, 1/mm; positive where the center lies downstream along the light, so that a
    /// retina's is negative.
    pub curvature_per_mm: f64,
    /// The conic constant.
    pub conic: f64,
}

impl ImageSurface {
    /// Returns how far the film at a place of its own plane lies behind its vertex, mm; NaN beyond its equator.
    pub fn sag_at_mm(&self, place_mm: DVec2) -> f64 {
        let (c, square) = (self.curvature_per_mm, place_mm.length_squared());
        c * square / (1.0 + (1.0 - (1.0 + self.conic) * c * c * square).sqrt())
    }

    /// Returns how steeply the film rises at a place of its own plane, in x and y.
    pub fn slope_at(&self, place_mm: DVec2) -> DVec2 {
        let c = self.curvature_per_mm;
        place_mm * (c / (1.0 - (1.0 + self.conic) * c * c * place_mm.length_squared()).sqrt())
    }
}

impl Lens {
    /// Returns the lens made of these interfaces, in air, with the stop at the surface of this index.
    ///
    /// # Errors
    /// When there are no surfaces, a number makes no sense or a rim does not fit on its surface.
    pub fn new(
        name: impl Into<String>,
        source: impl Into<String>,
        interfaces: Vec<Interface>,
        stop: usize,
    ) -> Result<Self, OpticsError> {
        Self::new_with_apertures(name, source, interfaces, stop, Vec::new())
    }

    /// Returns the lens made of these interfaces, in air, whose surfaces have apertures beside their round rims.
    ///
    /// A surface with an opening must reach as far as the opening does within the rim, not as far as the whole rim. A round
    /// opening about the axis becomes the rim where it is the narrower of the two, and is no aperture any more.
    ///
    /// # Errors
    /// When there are no surfaces, a number makes no sense, a rim or opening does not fit on its surface, or an aperture is
    /// of a surface that is not there.
    pub fn new_with_apertures(
        name: impl Into<String>,
        source: impl Into<String>,
        mut interfaces: Vec<Interface>,
        stop: usize,
        mut apertures: Vec<Aperture>,
    ) -> Result<Self, OpticsError> {
        if !(1..=MOST_SURFACES).contains(&interfaces.len()) {
            return Err(OpticsError::SurfaceCount { n_surfaces: interfaces.len() });
        }
        if stop >= interfaces.len() {
            return Err(OpticsError::Stops { n_stops: 0 });
        }
        if apertures.len() > MOST_APERTURES {
            return Err(OpticsError::ApertureCount { n_apertures: apertures.len(), most: MOST_APERTURES });
        }
        apertures.iter().try_for_each(|aperture| aperture.check(interfaces.len()))?;
        apertures.retain(|aperture| {
            let Some(rim_mm) = aperture.rim_mm() else { return true };
            let semi_aperture_mm = &mut interfaces[aperture.surface].surface.semi_aperture_mm;
            *semi_aperture_mm = semi_aperture_mm.min(rim_mm);
            false
        });
        for (surface, interface) in interfaces.iter().enumerate() {
            interface.surface.check(surface, &apertures)?;
            interface.medium_after.check()?;
            let found = interface.thickness_after_mm;
            if !found.is_finite() {
                let key = "thickness_mm";
                return Err(OpticsError::Surface { surface, key, found, expected: "a finite number" });
            }
        }
        let full_stop_semi_aperture_mm = interfaces[stop].surface.semi_aperture_mm;
        Ok(Self {
            name: name.into(),
            source: source.into(),
            object_medium: Glass::Air,
            interfaces,
            stop,
            full_stop_semi_aperture_mm,
            iris: None,
            moves: Vec::new(),
            apertures,
            mirrors: Vec::new(),
            diffractive: Vec::new(),
            coatings: Vec::new(),
            other_coating: None,
            image_surface: ImageSurface::default(),
            glass_range: GlassRange::default(),
        })
    }

    /// Returns the lens with its object in this medium, which reaches to the first surface: water or oil before an
    /// immersion objective, glass around an object that is buried in it.
    ///
    /// # Errors
    /// When the medium makes no sense.
    pub fn with_object_medium(mut self, medium: Glass) -> Result<Self, OpticsError> {
        medium.check()?;
        self.object_medium = medium;
        let mirrors = std::mem::take(&mut self.mirrors);
        self.with_mirrors(mirrors)
    }

    /// Returns the lens with its surfaces tilted and decentered by these moves, and by no others.
    ///
    /// The lens frame stays where it was: at the place of the first vertex before the moves.
    ///
    /// # Errors
    /// When a move is of surfaces that are not there, or has a number that makes no sense.
    pub fn with_moves(mut self, moves: Vec<CoordinateBreak>) -> Result<Self, OpticsError> {
        moves.iter().enumerate().try_for_each(|(i, step)| step.check(i, self.interfaces.len()))?;
        if moves.len() > MOST_MOVES {
            return Err(OpticsError::MoveCount { n_moves: moves.len(), most: MOST_MOVES });
        }
        self.moves = moves;
        Ok(self)
    }

    /// Returns the lens with these surfaces, counted from 0, as mirrors, and no others.
    ///
    /// Axes do not turn at a mirror: behind an odd number of them light runs towards −z, so that distances between vertices
    /// are negative there, and radii keep their sign. docs/mirrors.md in the repository has the conventions. The medium behind a mirror is
    /// that before it.
    ///
    /// # Errors
    /// When a surface is not there, is an ideal lens, or has another medium behind it than before.
    pub fn with_mirrors(mut self, mirrors: impl IntoIterator<Item = usize>) -> Result<Self, OpticsError> {
        let mut mirrors: Vec<usize> = mirrors.into_iter().collect();
        mirrors.sort_unstable();
        mirrors.dedup();
        for &surface in &mirrors {
            let cannot = |reason: String| Err(OpticsError::Mirror { surface, reason });
            let Some(interface) = self.interfaces.get(surface) else {
                return cannot(format!("the lens has the surfaces 0 to {}", self.interfaces.len() - 1));
            };
            if matches!(interface.surface.shape, Shape::ThinLens { .. }) {
                return cannot("it is an ideal thin lens".to_owned());
            }
            let before = surface.checked_sub(1).map_or(&self.object_medium, |i| &self.interfaces[i].medium_after);
            if interface.medium_after != *before {
                let (before, after) = (before.describe(), interface.medium_after.describe());
                return cannot(format!("the medium behind it is {after}, expected that before it, {before}"));
            }
        }
        self.mirrors = mirrors;
        Ok(self)
    }

    /// Returns the lens with these gratings and diffractive surfaces, and no others.
    ///
    /// # Errors
    /// When a surface is not there, is named twice or is an ideal lens, or a number makes no sense.
    pub fn with_diffractive(mut self, diffractive: Vec<DiffractiveSurface>) -> Result<Self, OpticsError> {
        for (i, phase) in diffractive.iter().enumerate() {
            phase.check(self.interfaces.len())?;
            let cannot = |what: &str| {
                let reason = format!("surface {} cannot be diffractive: {what}", phase.surface);
                Err(OpticsError::Diffractive { lens: self.name.clone(), reason })
            };
            if matches!(self.interfaces[phase.surface].surface.shape, Shape::ThinLens { .. }) {
                return cannot("it is an ideal thin lens");
            }
            if diffractive[..i].iter().any(|other| other.surface == phase.surface) {
                return cannot("it is named twice");
            }
        }
        self.diffractive = diffractive;
        Ok(self)
    }

    /// Checks that the wavefront errors of all surfaces are known at a wavelength.
    pub(crate) fn check_wavefronts_at(&self, wavelength_nm: f64) -> Result<(), OpticsError> {
        self.wavefront_errors().try_for_each(|error| error.check_at(wavelength_nm))
    }

    /// The wavefront errors of its surfaces.
    fn wavefront_errors(&self) -> impl Iterator<Item = &WavefrontError> {
        self.diffractive.iter().filter_map(|phase| match &phase.profile {
            PhaseProfile::Wavefront(error) => Some(error),
            PhaseProfile::Grating { .. } | PhaseProfile::Rings { .. } => None,
        })
    }

    /// Returns the lens with a film of this shape.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn with_image_surface(mut self, image_surface: ImageSurface) -> Result<Self, OpticsError> {
        let surface = self.interfaces.len();
        for (key, found) in [("image curvature", image_surface.curvature_per_mm), ("image conic", image_surface.conic)]
        {
            if !found.is_finite() {
                return Err(OpticsError::Surface { surface, key, found, expected: "a finite number" });
            }
        }
        self.image_surface = image_surface;
        Ok(self)
    }

    /// Returns a pinhole of this diameter: a stop and nothing else.
    ///
    /// # Errors
    /// When the diameter is not positive.
    pub fn pinhole(diameter_mm: f64) -> Result<Self, OpticsError> {
        let semi_aperture_mm = 0.5 * positive("the diameter of a pinhole in mm", diameter_mm)?;
        let surface = Surface::plane(semi_aperture_mm);
        let source = "a hole in a thin plane";
        Self::new("pinhole", source, vec![Interface { surface, medium_after: Glass::Air, thickness_after_mm: 0.0 }], 0)
    }

    /// Returns an ideal thin lens, which is its own stop: it images every plane perfectly and without distortion.
    ///
    /// # Errors
    /// When the diameter is not positive or the focal length is 0 or not finite.
    pub fn thin(focal_length_mm: f64, diameter_mm: f64) -> Result<Self, OpticsError> {
        let semi_aperture_mm = 0.5 * positive("the diameter of a thin lens in mm", diameter_mm)?;
        let shape = Shape::ThinLens { power_per_mm: 1.0 / focal_length_mm };
        let surface = Surface { curvature_per_mm: 0.0, shape, semi_aperture_mm };
        let interface = Interface { surface, medium_after: Glass::Air, thickness_after_mm: 0.0 };
        Self::new("thin lens", "the thin-lens equation", vec![interface], 0)
    }

    /// Returns the lens with an ideal lens of this focal length right behind its last surface: what turns the angles that an
    /// afocal lens sends light under into places on a film.
    ///
    /// # Errors
    /// When the focal length is 0 or not finite.
    pub fn with_ideal_lens_behind(&self, focal_length_mm: f64) -> Result<Self, OpticsError> {
        let n = self.interfaces.len();
        let last = &self.interfaces[n - 1];
        let shape = Shape::ThinLens { power_per_mm: 1.0 / focal_length_mm };
        let rims = self.interfaces.iter().map(|interface| interface.surface.semi_aperture_mm);
        // Wide enough for light that leaves aslant.
        let semi_aperture_mm = 100.0 * rims.fold(0.0, f64::max);
        let surface = Surface { curvature_per_mm: 0.0, shape, semi_aperture_mm };
        let ideal = Interface { surface, medium_after: last.medium_after.clone(), thickness_after_mm: 0.0 };
        let mut interfaces = self.interfaces.clone();
        interfaces[n - 1].thickness_after_mm = 0.0;
        interfaces.push(ideal);
        let to_film = |step: &CoordinateBreak| {
            let (first, last) = step.surfaces;
            CoordinateBreak { surfaces: (first, if last == n { n + 1 } else { last }), ..*step }
        };
        let lens = Self::new_with_apertures(&self.name, &self.source, interfaces, self.stop, self.apertures.clone())?
            .with_stop_of(self);
        Self { coatings: self.coatings.clone(), other_coating: self.other_coating.clone(), ..lens }
            .with_object_medium(self.object_medium.clone())?
            .with_mirrors(self.mirrors.clone())?
            .with_diffractive(self.diffractive.clone())?
            .with_moves(self.moves.iter().map(to_film).collect())?
            .with_glass_range(self.glass_range)
            .with_image_surface(self.image_surface)
    }

    /// The lens's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the prescription comes from.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The medium that the object is in, up to the first surface.
    pub fn object_medium(&self) -> &Glass {
        &self.object_medium
    }

    /// The surfaces in the order that light meets them, each with the medium and distance that follow it.
    pub fn interfaces(&self) -> &[Interface] {
        &self.interfaces
    }

    /// The index of the surface that is the stop.
    pub fn stop(&self) -> usize {
        self.stop
    }

    /// The tilts and decenters of surfaces, groups and the film; none for a centered lens.
    pub fn moves(&self) -> &[CoordinateBreak] {
        &self.moves
    }

    /// The openings and obscurations of surfaces beside their round rims; none for most lenses.
    pub fn apertures(&self) -> &[Aperture] {
        &self.apertures
    }

    /// The apertures of one surface.
    pub(crate) fn apertures_of(&self, surface: usize) -> impl Iterator<Item = &Aperture> {
        self.apertures.iter().filter(move |aperture| aperture.surface == surface)
    }

    /// The gratings and diffractive surfaces; none for most lenses.
    pub fn diffractive(&self) -> &[DiffractiveSurface] {
        &self.diffractive
    }

    /// The surfaces that reflect, counted from 0, in ascending order; none for most lenses.
    pub fn mirrors(&self) -> &[usize] {
        &self.mirrors
    }

    /// Whether a surface reflects.
    pub fn is_mirror(&self, surface: usize) -> bool {
        self.mirrors.binary_search(&surface).is_ok()
    }

    /// Whether light runs towards −z before a surface, along the axis that moves may bend: behind an odd number of mirrors.
    /// The surface after the last is the film.
    pub fn is_backward_before(&self, surface: usize) -> bool {
        self.mirrors.iter().filter(|&&mirror| mirror < surface).count() % 2 == 1
    }

    /// z of the film's vertex from the first, mm, along the axis that moves may bend, for a film this far behind the last
    /// vertex along the light.
    pub fn film_z_mm(&self, film_distance_mm: f64) -> f64 {
        let is_backward = self.is_backward_before(self.interfaces.len());
        self.last_vertex_z_mm() + if is_backward { -film_distance_mm } else { film_distance_mm }
    }

    /// The shape of the film.
    pub fn image_surface(&self) -> ImageSurface {
        self.image_surface
    }

    /// Where each surface stands, all moves done.
    pub fn placements(&self) -> Vec<Placement> {
        let vertices_z_mm = self.vertices_z_mm();
        let centered = vertices_z_mm.iter().map(|&z_mm| Placement::centered(z_mm));
        match placement::motions(&self.moves, &vertices_z_mm) {
            Some(motions) => motions.iter().zip(centered).map(|(motion, placement)| motion.after(&placement)).collect(),
            None => centered.collect(),
        }
    }

    /// What the moves do to the film.
    pub(crate) fn film_motion(&self) -> Placement {
        let motions = placement::motions(&self.moves, &self.vertices_z_mm());
        motions.and_then(|motions| motions.last().copied()).unwrap_or(Placement::centered(0.0))
    }

    /// Whether every surface is one of revolution about the lens's axis: whether nothing is tilted, decentered or
    /// curved differently along x and y, and all apertures are circles about it.
    pub fn is_rotational(&self) -> bool {
        self.apertures.iter().all(Aperture::is_rotational)
            && self.iris_opening().is_none()
            && self.is_centered_and_rotational()
    }

    /// Whether the lens has aberrations of third order: whether it is [centered and
    /// rotational](Self::is_centered_and_rotational) and has no wavefront errors by field.
    pub fn has_third_order(&self) -> bool {
        self.is_centered_and_rotational() && !self.wavefront_errors().any(WavefrontError::varies)
    }

    /// Whether every surface is one of revolution about the lens's axis, whatever apertures bound the light.
    pub fn is_centered_and_rotational(&self) -> bool {
        let is_round = |interface: &Interface| interface.surface.is_rotational();
        self.interfaces.iter().all(is_round)
            && self.diffractive.iter().all(|phase| phase.profile.is_rotational())
            && placement::motions(&self.moves, &self.vertices_z_mm()).is_none()
    }

    /// Whether the lens and its film are their own mirror images when x changes its sign, and when y does: what a field to the right
    /// sends to the film is then the mirror image of what the one to the left sends.
    ///
    /// A lens tilted about x alone is one of the first kind, a rotationally symmetric one of both.
    pub fn mirror_symmetries(&self) -> [bool; 2] {
        let mut places = self.placements();
        places.push(self.film_motion());
        let iris = self.iris_opening().map(|opening| Aperture::of_iris(self.stop, opening));
        [0, 1].map(|axis| {
            self.apertures.iter().chain(&iris).all(|aperture| aperture.is_mirrored_along(axis))
                && self.diffractive.iter().all(|phase| phase.profile.is_mirrored_along(axis))
                && places.iter().all(|place| place.is_mirrored_along(axis))
        })
    }

    /// Returns the lens on the axis, and how far this one is moved sideways from there, mm along x and y: of a lens that would be
    /// rotationally symmetric but for being decentered as a whole, before a flat film that stays. `None` of any other, the lens
    /// on the axis among them.
    pub fn recentered(&self) -> Option<(Self, DVec2)> {
        let (moved, film) = (self.placements(), self.film_motion());
        let aside = moved.first()?.vertex_mm.truncate();
        let is_film_flat = self.image_surface == ImageSurface::default();
        if aside == DVec2::ZERO || !film.is_rest() || !is_film_flat {
            return None;
        }
        let centered = Self { moves: vec![], ..self.clone() };
        let back = Placement { vertex_mm: -aside.extend(0.0), ..Placement::centered(0.0) };
        let stands = |(moved, home): (&Placement, &Placement)| back.after(moved).after(&home.inverse()).is_rest();
        let is_whole = moved.iter().zip(&centered.placements()).all(stands);
        (is_whole && centered.is_rotational()).then_some((centered, aside))
    }

    /// Checks that the lens is rotationally symmetric; `task` names what needs that, for the error.
    ///
    /// # Errors
    /// When it is not.
    pub fn check_rotational(&self, task: &'static str) -> Result<(), OpticsError> {
        if self.is_rotational() {
            return Ok(());
        }
        Err(OpticsError::NotRotational { lens: self.name.clone(), task })
    }

    /// z of the last vertex, mm: the sum of all distances between vertices, along the axis that moves may bend.
    pub fn last_vertex_z_mm(&self) -> f64 {
        self.vertices_z_mm().last().copied().unwrap_or(0.0)
    }

    /// z of each vertex from the first, mm, along the axis that moves may bend; [`placements`](Self::placements) has where it is.
    pub fn vertices_z_mm(&self) -> Vec<f64> {
        let mut z = 0.0;
        let vertex = |interface: &Interface| {
            let here = z;
            z += interface.thickness_after_mm;
            here
        };
        self.interfaces.iter().map(vertex).collect()
    }

    /// Half the clear diameter of the first surface, mm.
    pub fn front_semi_aperture_mm(&self) -> f64 {
        self.interfaces[0].surface.semi_aperture_mm
    }

    /// Half the diameter of the stop, mm; of one that blades close, of the circle with as much area.
    pub fn stop_semi_aperture_mm(&self) -> f64 {
        self.interfaces[self.stop].surface.semi_aperture_mm
    }

    /// Half the diameter of the prescription's stop, mm, however far it is stopped down.
    pub fn full_stop_semi_aperture_mm(&self) -> f64 {
        self.full_stop_semi_aperture_mm
    }

    /// Returns the lens with a stop of this semi-aperture, which is at most the full one.
    pub(crate) fn with_stop_semi_aperture_mm(&self, semi_aperture_mm: f64) -> Self {
        let mut lens = self.clone();
        lens.interfaces[self.stop].surface.semi_aperture_mm = semi_aperture_mm.min(self.full_stop_semi_aperture_mm);
        lens
    }

    /// Returns the lens with another rim of a surface that is not the stop.
    pub(crate) fn with_semi_aperture_mm(&self, surface: usize, semi_aperture_mm: f64) -> Result<Self, OpticsError> {
        let mut lens = self.clone();
        lens.interfaces[surface].surface.semi_aperture_mm = semi_aperture_mm;
        lens.interfaces[surface].surface.check(surface, &lens.apertures)?;
        Ok(lens)
    }

    /// Returns the lens with the same dispersion given to every medium of constant index but air: a straight line of this
    /// slope through the index at `reference_nm`.
    ///
    /// Files of the `.dat` kind state one index a medium. The paper's figures give all of them a slope of −0.04 in 300 nm
    /// about 550 nm.
    ///
    /// # Errors
    /// When a number makes no sense.
    pub fn with_linear_dispersion(&self, slope_per_nm: f64, reference_nm: f64) -> Result<Self, OpticsError> {
        let mut lens = self.clone();
        let media = lens.interfaces.iter_mut().map(|interface| &mut interface.medium_after);
        for medium in media.chain([&mut lens.object_medium]) {
            if let Glass::Constant { index } = *medium {
                *medium = Glass::Linear { index, reference_nm, slope_per_nm };
                medium.check()?;
            }
        }
        Ok(lens)
    }
}

/// The largest number of surfaces.
const MOST_SURFACES: usize = 1000;
/// The largest number of apertures: an opening and an obscuration of each surface.
const MOST_APERTURES: usize = 2 * MOST_SURFACES;
/// The largest number of moves: two breaks before each surface.
const MOST_MOVES: usize = 2 * MOST_SURFACES;

/// Returns the number if it is positive and finite.
pub(crate) fn positive(what: &'static str, found: f64) -> Result<f64, OpticsError> {
    if found > 0.0 && found.is_finite() { Ok(found) } else { Err(OpticsError::NotPositive { what, found }) }
}
