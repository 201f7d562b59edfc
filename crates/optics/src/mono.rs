//! A lens at one wavelength: the thing that is traced.

mod axial;
mod film;
mod first_order;

use std::{borrow::Cow, ops::Range, sync::OnceLock};

use glam::{DVec2, DVec3};
use rayon::iter::{IndexedParallelIterator, ParallelIterator};

use crate::{
    Aperture, FirstOrder, ImageSurface, Lens, OpticsError, Placement, RayBatch, Shape, Surface, Vignetting,
    paraxial::{self, Matrix},
    placement,
    trace::{self, Goal, Kind, LightPass, Lights, Phase, Plan, Step},
    transmission::{RayLight, SurfaceLoss, Transmission, pass_one_by_one},
};

pub use self::axial::AxialBeam;

/// Rays that one task of [`MonoLens::trace_parallel`] traces.
const CHUNK: usize = 4096;

/// A lens at one wavelength, its indices resolved; tracing it cannot fail as a whole.
#[derive(Clone, Debug)]
pub struct MonoLens {
    // Invariant: at least one step, and `stop` is an index of them.
    name: String,
    wavelength_nm: f64,
    steps: Vec<Step>,
    /// The share of light that the orders of its diffractive surfaces have.
    diffraction_efficiency: f64,
    stop: usize,
    /// Of the circle that has the area of the blades' opening, where blades close the stop.
    stop_semi_aperture_mm: f64,
    front: Surface,
    rear: Surface,
    image_surface: ImageSurface,
    /// z of each vertex from the first, mm, along the axis that moves may bend.
    vertices_z_mm: Vec<f64>,
    /// Where surfaces stand, if not all are centered or some reflect.
    placed: Option<Placed>,
    /// That of the stop, whether it limits the light or not.
    first_order: FirstOrder,
    /// What light loses at surfaces and in glass, if any is lost.
    pub(crate) losses: Option<Losses>,
    /// The beam of a far point on the axis, once it is asked for.
    far_beam: OnceLock<Option<AxialBeam>>,
}

/// What light loses at each surface and behind it, and the passes made of that once they are asked for.
#[derive(Clone, Debug)]
pub(crate) struct Losses {
    surfaces: Vec<SurfaceLoss>,
    per_mm: Vec<f64>,
    stop: usize,
    transmission: OnceLock<Transmission>,
}

impl Losses {
    /// Absorption behind each surface, 1/mm.
    pub(crate) fn per_mm(&self) -> &[f64] {
        &self.per_mm
    }

    pub(crate) fn surfaces(&self) -> &[SurfaceLoss] {
        &self.surfaces
    }

    pub(crate) fn transmission(&self) -> &Transmission {
        self.transmission.get_or_init(|| Transmission::of(&self.surfaces, &self.per_mm, self.stop))
    }
}

impl Lens {
    /// Returns the lens at one wavelength.
    ///
    /// # Errors
    /// When a glass is not known at that wavelength.
    pub fn at(&self, wavelength_nm: f64) -> Result<MonoLens, OpticsError> {
        MonoLens::new(self, wavelength_nm)
    }
}

/// Where the surfaces of a lens stand that is not centered, or that has mirrors or diffractive surfaces.
#[derive(Clone, Debug)]
struct Placed {
    /// That of each surface, its z along the light that comes: behind an odd number of mirrors the frame is left-handed.
    placements: Vec<Placement>,
    /// What has become of the straight axis at the film.
    film: Placement,
    /// Whether all stand on the axis.
    is_centered: bool,
    /// Whether light runs towards −z at the film.
    is_film_backward: bool,
}

impl Placed {
    /// Returns where the surfaces of a lens stand; `None` where all are centered and none reflects.
    fn of(lens: &Lens, vertices_z_mm: &[f64]) -> Option<Self> {
        let motions = placement::motions(lens.moves(), vertices_z_mm);
        if motions.is_none() && lens.mirrors().is_empty() && lens.diffractive().is_empty() {
            return None;
        }
        let along_light = |(i, placement): (usize, Placement)| {
            if lens.is_backward_before(i) { placement.flipped() } else { placement }
        };
        Some(Self {
            placements: lens.placements().into_iter().enumerate().map(along_light).collect(),
            film: lens.film_motion(),
            is_centered: motions.is_none(),
            is_film_backward: lens.is_backward_before(vertices_z_mm.len()),
        })
    }
}

impl MonoLens {
    pub(crate) fn new(lens: &Lens, wavelength_nm: f64) -> Result<Self, OpticsError> {
        let (mut steps, mut index_before) = (Vec::new(), lens.index_in(lens.object_medium(), wavelength_nm)?);
        let (vertices_z_mm, n_surfaces) = (lens.vertices_z_mm(), lens.interfaces().len());
        let (mut vertex_z, mut before_z_mm) = (0.0, 0.0);
        let mut losses = Vec::new();
        lens.check_wavefronts_at(wavelength_nm)?;
        for (i, interface) in lens.interfaces().iter().enumerate() {
            let index_after =
                lens.index_in(&interface.medium_after, wavelength_nm).map_err(|error| error.behind_surface(i))?;
            if !lens.is_lossless() {
                losses.push(SurfaceLoss::of(lens, i, wavelength_nm, [index_before, index_after])?);
            }
            let (is_backward, is_mirror) = (lens.is_backward_before(i), lens.is_mirror(i));
            let as_met = is_backward.then(|| interface.surface.flipped());
            let surface = as_met.as_ref().unwrap_or(&interface.surface);
            let is_window = surface.curvature_per_mm == 0.0 && index_before == index_after && !is_mirror;
            let kind = kind_of(surface, is_window);
            let (curvature, semi_aperture) = (surface.curvature_per_mm, surface.semi_aperture_mm);
            let apertures = lens.apertures_of(i).cloned().collect();
            let way_mm = vertices_z_mm[i] - before_z_mm;
            vertex_z += if is_backward { -way_mm } else { way_mm };
            before_z_mm = vertices_z_mm[i];
            // Without mirrors, the same bits as the sums of the lens.
            let vertex_z = if lens.mirrors().is_empty() { vertices_z_mm[i] } else { vertex_z };
            steps.push(Step {
                kind,
                curvature,
                index_before,
                index_after,
                vertex_z,
                semi_aperture,
                apertures,
                is_mirror,
                phase: phase_of(lens, i, wavelength_nm),
            });
            index_before = index_after;
        }
        let first_order = paraxial::first_order(&steps, lens.stop(), wavelength_nm);
        let losses = match lens.is_lossless() {
            true => None,
            false => {
                let per_mm = lens.absorption_at(wavelength_nm)?.per_mm().to_vec();
                let is_clear = losses.iter().all(|loss| *loss == SurfaceLoss::None) && per_mm.iter().all(|a| *a == 0.0);
                (!is_clear).then(|| Losses {
                    surfaces: losses,
                    per_mm,
                    stop: lens.stop(),
                    transmission: OnceLock::new(),
                })
            }
        };
        // Blades reach in from the rim, beyond the circle that has as much area.
        let stop = &mut steps[lens.stop()];
        let stop_semi_aperture_mm = stop.semi_aperture;
        if let Some(opening) = lens.iris_opening() {
            stop.semi_aperture = lens.full_stop_semi_aperture_mm();
            stop.apertures.push(Aperture::of_iris(lens.stop(), opening));
        }
        let rear = &lens.interfaces()[n_surfaces - 1].surface;
        let rear = if lens.is_backward_before(n_surfaces) { rear.flipped() } else { rear.clone() };
        Ok(Self {
            name: lens.name().to_owned(),
            wavelength_nm,
            steps,
            diffraction_efficiency: lens.diffraction_efficiency_at(wavelength_nm)?,
            stop: lens.stop(),
            stop_semi_aperture_mm,
            front: lens.interfaces()[0].surface.clone(),
            rear,
            image_surface: lens.image_surface(),
            placed: Placed::of(lens, &vertices_z_mm),
            vertices_z_mm,
            first_order,
            losses,
            far_beam: OnceLock::new(),
        })
    }

    /// Whether the lens is rotationally symmetric, as [`Lens::is_rotational`].
    pub fn is_rotational(&self) -> bool {
        let is_round = |step: &Step| step.apertures.iter().all(Aperture::is_rotational) && step.is_rotational();
        self.is_centered() && self.steps.iter().all(is_round)
    }

    /// Whether all surfaces and the film stand on the axis.
    pub(crate) fn is_centered(&self) -> bool {
        self.placed.as_ref().is_none_or(|placed| placed.is_centered)
    }

    /// Whether light runs towards −z of the lens frame (or of what moves make of it) before the film: behind an odd number of
    /// mirrors.
    pub fn is_film_backward(&self) -> bool {
        self.placed.as_ref().is_some_and(|placed| placed.is_film_backward)
    }

    /// Whether there are openings beside the round rims, whose edges may have corners.
    pub fn has_openings(&self) -> bool {
        self.steps.iter().flat_map(|step| &step.apertures).any(|aperture| !aperture.is_obscuration)
    }

    /// The number of obscurations, of all surfaces.
    pub fn n_obscurations(&self) -> usize {
        self.steps.iter().flat_map(|step| &step.apertures).filter(|aperture| aperture.is_obscuration).count()
    }

    /// Returns the lens with some of its obscurations (counted through all surfaces) inverted: they pass what they
    /// stopped, and nothing else. Its other obscurations are taken away.
    ///
    /// What lenses with holes let through is thus a sum of pupils without: the whole, less those of each obscuration
    /// inverted, plus those of each two of them, and so on.
    #[must_use]
    pub fn with_obscurations_inverted(&self, inverted: &[usize]) -> Self {
        // The parts have the f-number of the whole.
        self.limiting_beam();
        let (mut lens, mut n) = (self.clone(), 0);
        for step in &mut lens.steps {
            step.apertures.retain_mut(|aperture| {
                if !aperture.is_obscuration {
                    return true;
                }
                aperture.is_obscuration = false;
                n += 1;
                inverted.contains(&(n - 1))
            });
        }
        lens
    }

    /// The wavelength, nm.
    pub fn wavelength_nm(&self) -> f64 {
        self.wavelength_nm
    }

    /// The index of the surface that is the stop.
    pub fn stop(&self) -> usize {
        self.stop
    }

    /// The number of surfaces, the stop included.
    pub fn n_surfaces(&self) -> usize {
        self.steps.len()
    }

    /// The refractive index around the stop: what shortens the wave that diffracts there.
    ///
    /// Where the stop is itself a refracting surface it is that of the medium behind.
    pub fn stop_medium_index(&self) -> f64 {
        self.steps[self.stop].index_after
    }

    /// The refractive index of the object space.
    pub fn object_index(&self) -> f64 {
        self.first_order.object_index
    }

    /// The refractive index of the image space.
    pub fn image_index(&self) -> f64 {
        self.first_order.image_index
    }

    /// Half the diameter of the stop, mm; of one that blades close, of the circle with as much area.
    pub fn stop_semi_aperture_mm(&self) -> f64 {
        self.stop_semi_aperture_mm
    }

    /// The lens with the circle of as much area in place of the opening of blades; `None` where it has no such opening.
    #[must_use]
    pub fn with_round_iris(&self) -> Option<Self> {
        if !self.steps[self.stop].apertures.iter().any(Aperture::is_iris) {
            return None;
        }
        let mut lens = self.clone();
        let stop = &mut lens.steps[self.stop];
        stop.apertures.retain(|aperture| !aperture.is_iris());
        stop.semi_aperture = self.stop_semi_aperture_mm;
        lens.far_beam = OnceLock::new();
        Some(lens)
    }

    /// Half the clear diameter of a surface, mm; of a stop that blades close, the rim that it has fully open.
    pub fn semi_aperture_mm(&self, surface: usize) -> f64 {
        self.steps[surface].semi_aperture
    }

    /// z of a surface's vertex from the first, mm, along the axis that moves may bend.
    pub fn vertex_z_mm(&self, surface: usize) -> f64 {
        self.vertices_z_mm[surface]
    }

    /// z of the last vertex from the first, mm, along the axis that moves may bend.
    pub fn last_vertex_z_mm(&self) -> f64 {
        self.vertices_z_mm[self.vertices_z_mm.len() - 1]
    }

    /// How far from the middle of the stop the beam of a point on the axis passes it at most, mm: the stop's own radius unless
    /// a rim limits the light of the point at this distance before the first vertex.
    pub fn stop_radius_filled_mm(&self, object_distance_mm: f64) -> f64 {
        let beam = self.axial_beam(object_distance_mm).filter(|beam| !beam.is_limited_by_stop);
        beam.map_or(self.stop_semi_aperture_mm(), |beam| beam.stop_radius_mm)
    }

    pub(crate) fn steps(&self) -> &[Step] {
        &self.steps
    }

    pub(crate) fn placements(&self) -> Option<&[Placement]> {
        self.placed.as_ref().map(|placed| placed.placements.as_slice())
    }

    /// The name of the lens.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns where a point of the lens frame lies in the stop's own frame, mm from the middle of the stop.
    pub(crate) fn in_stop_mm(&self, point_mm: DVec3) -> DVec2 {
        self.placements().map_or(point_mm, |placements| placements[self.stop].surface_from_lens(point_mm)).truncate()
    }

    /// The first surface.
    pub(crate) fn front(&self) -> &Surface {
        &self.front
    }

    /// Returns the point of the first surface over this place of its vertex plane, mm; beyond its equator, the place.
    pub(crate) fn on_front_mm(&self, place_mm: DVec2) -> DVec3 {
        let sag_mm = self.front.sag_at_mm(place_mm.x, place_mm.y);
        let point = place_mm.extend(if sag_mm.is_finite() { sag_mm } else { 0.0 });
        self.placements().map_or(point, |placements| placements[0].lens_from_surface(point))
    }

    /// Returns the z of the last surface over this place of its vertex plane, mm, along the light that leaves it; NaN beyond
    /// its equator.
    pub(crate) fn last_sag_mm(&self, place_mm: DVec2) -> f64 {
        self.rear.sag_at_mm(place_mm.x, place_mm.y)
    }

    /// Traces rays through all surfaces, on this thread.
    ///
    /// Each ray in flight ends on the last surface, bent into the image space, or where it was lost.
    pub fn trace(&self, rays: &mut RayBatch, rims: Vignetting) {
        self.trace_surfaces(0..self.n_surfaces(), rays, rims);
    }

    /// Traces rays through some of the surfaces, on this thread.
    ///
    /// The rays must lie in the medium before the first of them. Behind the stop, for one, directions may be changed
    /// before the trace goes on with the next surface.
    pub fn trace_surfaces(&self, surfaces: Range<usize>, rays: &mut RayBatch, rims: Vignetting) {
        let first = surfaces.start;
        let steps = self.steps_for(rays.object_z_mm);
        match self.placements() {
            Some(placements) => {
                trace::trace_placed(&steps[surfaces.clone()], &placements[surfaces], first, rims, &mut rays.slices());
            }
            None if surfaces.is_empty() => {}
            None => {
                trace::trace_batch(&Plan::new(&steps[surfaces], first, rims), Goal::LastSurface, rays.slices());
            }
        }
    }

    /// Traces rays through all surfaces, as [`trace`](Self::trace) does, and their light.
    pub fn trace_light(&self, rays: &mut RayBatch, light: &mut RayLight, rims: Vignetting) {
        assert_eq!(rays.len(), light.0.n_rays(), "light along each ray");
        let Some(losses) = &self.losses else { return self.trace(rays, rims) };
        let passes = &losses.transmission().forward;
        let steps = self.steps_for(rays.object_z_mm);
        if let Some(placements) = self.placements() {
            if steps.iter().any(|step| step.is_mirror) {
                let trace = |surface: usize, rays: &mut RayBatch| self.trace_surfaces(surface..surface + 1, rays, rims);
                return trace_light_by_surfaces(passes, rays, &mut light.0, trace);
            }
            let plan = |own: &[Step], place: usize| Plan::new(own, place, rims);
            let both = (&mut rays.slices(), &mut light.0);
            return trace::trace_placed_light_by((&steps, placements), plan, passes, both);
        }
        trace::trace_light(&Plan::new(&steps, 0, rims), passes, rays.slices(), &mut light.0);
    }

    /// Traces rays through all surfaces on the threads of the current rayon pool.
    ///
    /// The result is that of [`trace`](Self::trace), to the bit.
    pub fn trace_parallel(&self, rays: &mut RayBatch, rims: Vignetting) {
        let steps = self.steps_for(rays.object_z_mm);
        if let Some(placements) = self.placements() {
            let trace = |mut chunk| trace::trace_placed(&steps, placements, 0, rims, &mut chunk);
            return rays.par_slices(CHUNK).with_max_len(1).for_each(trace);
        }
        let plan = Plan::new(&steps, 0, rims);
        rays.par_slices(CHUNK).with_max_len(1).for_each(|chunk| trace::trace_batch(&plan, Goal::LastSurface, chunk));
    }

    /// Returns the steps, in which ideal lenses and wavefront errors by field know where the object plane appears to them.
    pub(crate) fn steps_for(&self, object_z_mm: f64) -> Cow<'_, [Step]> {
        let asks =
            |step: &Step| matches!(step.kind, Kind::ThinLens { .. }) || step.phase.as_ref().is_some_and(Phase::varies);
        if !self.steps.iter().any(asks) {
            return Cow::Borrowed(&self.steps);
        }
        let mut steps = self.steps.clone();
        for (i, step) in steps.iter_mut().enumerate() {
            let seen_z = match i {
                0 => object_z_mm,
                _ => {
                    let (first, last) = (&self.steps[0], &self.steps[i - 1]);
                    let before = Matrix::of(&self.steps[..i]);
                    let image = before.image_of(object_z_mm, first.index_before, last.index_after);
                    image.image_z_mm - (step.vertex_z - last.vertex_z)
                }
            };
            if let Kind::ThinLens { object_z, .. } = &mut step.kind {
                *object_z = seen_z;
            }
            step.phase = step.phase.take().map(|phase| phase.of_object_at(seen_z));
        }
        Cow::Owned(steps)
    }
}

/// Traces rays and their light surface by surface; `trace` takes the rays through the surface of a number.
pub(crate) fn trace_light_by_surfaces(
    passes: &[LightPass<f64>],
    rays: &mut RayBatch,
    lights: &mut Lights<f64>,
    mut trace: impl FnMut(usize, &mut RayBatch),
) {
    for (surface, pass) in passes.iter().enumerate() {
        let before: Vec<(DVec3, DVec3)> = (0..rays.len()).map(|i| (rays.point_mm(i), rays.direction(i))).collect();
        trace(surface, rays);
        let after = |i: usize| rays.fate[i].is_in_flight().then(|| (rays.point_mm(i), rays.direction(i)));
        pass_one_by_one(lights, pass, &before, after);
    }
}

impl Lens {
    /// Returns the share of light of a wavelength that the orders of all diffractive surfaces have together, by scalar theory; 1 where no
    /// [`Blaze`](crate::Blaze) is stated.
    ///
    /// # Errors
    /// When a medium is not known at that wavelength or at a design wavelength.
    pub fn diffraction_efficiency_at(&self, wavelength_nm: f64) -> Result<f64, OpticsError> {
        let share = |phase: &crate::DiffractiveSurface| {
            let Some(blaze) = phase.blaze else { return Ok(1.0) };
            let before =
                phase.surface.checked_sub(1).map_or(self.object_medium(), |i| &self.interfaces()[i].medium_after);
            let after = &self.interfaces()[phase.surface].medium_after;
            let step = |nm: f64| match self.is_mirror(phase.surface) {
                true => Ok::<f64, OpticsError>(2.0 * self.index_in(before, nm)?),
                false => Ok(self.index_in(after, nm)? - self.index_in(before, nm)?),
            };
            let (now, design) = (step(wavelength_nm)?, step(blaze.design_nm)?);
            let dispersion = if after == before && !self.is_mirror(phase.surface) { 1.0 } else { now / design };
            let design_order = f64::from(blaze.order.unwrap_or(phase.order));
            let waves = design_order * blaze.design_nm / wavelength_nm * dispersion;
            Ok(blaze.share_of(phase.order, waves))
        };
        self.diffractive().iter().map(share).product()
    }
}

impl MonoLens {
    /// The share of light that the orders of all diffractive surfaces have together; 1 where no relief is stated. Rays are traced as if it were 1.
    pub fn diffraction_efficiency(&self) -> f64 {
        self.diffraction_efficiency
    }
}

/// Returns the phase that a surface adds at a wavelength.
fn phase_of(lens: &Lens, surface: usize, wavelength_nm: f64) -> Option<Phase> {
    let stated = lens.diffractive().iter().find(|phase| phase.surface == surface)?;
    Some(stated.profile.at(stated.order, wavelength_nm))
}

/// Returns the kernel's form of a surface's shape.
fn kind_of(surface: &Surface, is_window: bool) -> Kind {
    if let Some(toric) = surface.toric() {
        return Kind::Toric(toric);
    }
    match &surface.shape {
        Shape::Sphere if is_window => Kind::Window,
        Shape::Conic { conic } => Kind::Conic { conic: *conic },
        Shape::EvenAsphere { conic, coefficients } => {
            Kind::EvenAsphere { conic: *conic, a2: 0.0, coefficients: coefficients.clone() }
        }
        Shape::OddAsphere { conic, coefficients } => asphere(*conic, coefficients),
        Shape::ThinLens { power_per_mm } => Kind::ThinLens { power: *power_per_mm, object_z: f64::NEG_INFINITY },
        Shape::Sphere | Shape::Biconic { .. } | Shape::Toroid { .. } => Kind::Sphere,
    }
}

/// Returns the kernel's form of an asphere: that of even powers where there are no others.
fn asphere(conic: f64, from_r1: &[f64]) -> Kind {
    if from_r1.iter().step_by(2).any(|&a| a != 0.0) {
        return Kind::OddAsphere { conic, coefficients: from_r1.to_vec() };
    }
    let mut even = from_r1.iter().skip(1).step_by(2).copied();
    Kind::EvenAsphere { conic, a2: even.next().unwrap_or(0.0), coefficients: even.collect() }
}
