//! A lens at one wavelength: the thing that is traced.

mod axial;

use std::{borrow::Cow, ops::Range, sync::OnceLock};

use glam::{DVec2, DVec3};
use rayon::iter::{IndexedParallelIterator, ParallelIterator};

use crate::{
    Aperture, Conjugate, FirstOrder, ImageSurface, Lens, OpticsError, Placement, RayBatch, RayBatchF32, Shape, Surface,
    Vignetting,
    paraxial::{self, MarginalRay, Matrix},
    placement,
    trace::{self, Goal, Kind, Phase, Plan, Step},
};

pub use self::axial::AxialBeam;

/// Rays that one task of [`MonoLens::trace_parallel`] traces.
const CHUNK: usize = 4096;

/// How far an entrance pupil may be for counting from its center, over the first rim's radius: then counts are good to
/// 1e-12 of the rim.
const FARTHEST_PUPIL: f64 = 1e4;

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
    front: Surface,
    rear: Surface,
    image_surface: ImageSurface,
    /// z of each vertex from the first, mm, along the axis that moves may bend.
    vertices_z_mm: Vec<f64>,
    /// Where surfaces stand, if not all are centered or some reflect.
    placed: Option<Placed>,
    /// That of the stop, whether it limits the light or not.
    first_order: FirstOrder,
    /// The beam of a far point on the axis, once it is asked for.
    far_beam: OnceLock<Option<AxialBeam>>,
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
        for (i, interface) in lens.interfaces().iter().enumerate() {
            let index_after =
                lens.index_in(&interface.medium_after, wavelength_nm).map_err(|error| error.behind_surface(i))?;
            let (is_backward, is_mirror) = (lens.is_backward_before(i), lens.is_mirror(i));
            let as_met = is_backward.then(|| interface.surface.flipped());
            let surface = as_met.as_ref().unwrap_or(&interface.surface);
            let is_window = surface.curvature_per_mm == 0.0 && index_before == index_after && !is_mirror;
            let kind = kind_of(surface, is_window);
            let (curvature, semi_aperture) = (surface.curvature_per_mm, surface.semi_aperture_mm);
            let apertures = lens.apertures_of(i).copied().collect();
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
        let rear = &lens.interfaces()[n_surfaces - 1].surface;
        let rear = if lens.is_backward_before(n_surfaces) { rear.flipped() } else { rear.clone() };
        Ok(Self {
            name: lens.name().to_owned(),
            wavelength_nm,
            steps,
            diffraction_efficiency: lens.diffraction_efficiency_at(wavelength_nm)?,
            stop: lens.stop(),
            front: lens.interfaces()[0].surface.clone(),
            rear,
            image_surface: lens.image_surface(),
            placed: Placed::of(lens, &vertices_z_mm),
            vertices_z_mm,
            first_order,
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

    /// Focal lengths, principal planes and pupils.
    ///
    /// Of a lens that is not rotationally symmetric they are those of its axis with all surfaces put back on it (a bent
    /// axis made straight), in the y–z plane; [`first_order_x`](Self::first_order_x) gives those of the x–z plane. A
    /// tilted or decentered lens forms its image by them only as far as its tilts are small.
    ///
    /// Where a rim ends the light of a far point on the axis before the stop does ([`limiting_beam`](Self::limiting_beam)),
    /// the diameters of the pupils and the f-number are those of the real beam that gets through; the pupils stay where the
    /// images of the stop are.
    pub fn first_order(&self) -> FirstOrder {
        let Some(beam) = self.limiting_beam() else { return self.first_order };
        self.first_order.with_entrance_pupil_diameter_mm(2.0 * beam.height_mm)
    }

    /// The same for a beam that fills the stop, whether it gets through or not.
    pub fn first_order_of_stop(&self) -> FirstOrder {
        self.first_order
    }

    /// The real beam of a far point on the axis, if a rim limits it and not the stop; `None` as a rule.
    ///
    /// Some lens files state a stop that is wider than what their rims let through.
    pub fn limiting_beam(&self) -> Option<AxialBeam> {
        if !(self.first_order.entrance_pupil_diameter_mm.is_finite() && self.first_order.power_per_mm != 0.0) {
            return None;
        }
        let beam = self.far_beam.get_or_init(|| self.axial_beam(f64::INFINITY));
        beam.filter(|beam| !beam.is_limited_by_stop)
    }

    /// Returns a sentence on what limits the light of the point on the axis at this distance before the first vertex, mm (infinite
    /// for a far one), if it is not the stop.
    pub fn note_on_limit(&self, object_distance_mm: f64) -> Option<String> {
        let is_far = object_distance_mm.is_infinite();
        let beam = match is_far {
            true => self.limiting_beam()?,
            false => self.axial_beam(object_distance_mm).filter(|beam| !beam.is_limited_by_stop)?,
        };
        let (surface, rim_mm) = (beam.limiting_surface, 2.0 * self.semi_aperture_mm(beam.limiting_surface));
        let (filled_mm, stop_mm) = (2.0 * beam.stop_radius_mm, 2.0 * self.stop_semi_aperture_mm());
        let (point, f_numbers) = match is_far {
            true => {
                let (real, of_stop) = (self.first_order().f_number, self.first_order.f_number);
                ("far away".to_owned(), format!(": f/{real:.3}, where the stop alone has f/{of_stop:.3}"))
            }
            false => (format!("{object_distance_mm} mm before the lens"), String::new()),
        };
        Some(format!(
            "light from the axis {point} is limited by the rim of surface {surface}, {rim_mm:.4} mm across, not by the stop, of \
             which it fills {filled_mm:.4} of {stop_mm:.4} mm{f_numbers}"
        ))
    }

    /// The f-number for a far object by the real rays that get through: effective focal length over the diameter of the
    /// beam before the lens; `None` where no light does, or the lens has no power.
    ///
    /// It differs from the paraxial f-number by the aberration of the entrance pupil.
    pub fn real_f_number(&self) -> Option<f64> {
        let beam = (*self.far_beam.get_or_init(|| self.axial_beam(f64::INFINITY)))?;
        let f_number = (self.first_order.efl_mm / (2.0 * beam.height_mm)).abs();
        f_number.is_finite().then_some(f_number)
    }

    /// Focal lengths, principal planes and pupils in the x–z plane; those of [`first_order`](Self::first_order) unless
    /// a surface is curved differently along x and y.
    pub fn first_order_x(&self) -> FirstOrder {
        // Of a lens of revolution nothing differs.
        if self.steps.iter().all(|step| !matches!(step.kind, Kind::Toric(_))) {
            return self.first_order();
        }
        paraxial::first_order(&self.steps_along_x(), self.stop, self.wavelength_nm)
    }

    /// Returns the steps as the x–z plane cuts them.
    fn steps_along_x(&self) -> Vec<Step> {
        let along_x = |step: &Step| match &step.kind {
            Kind::Toric(toric) => Step { kind: Kind::Sphere, curvature: toric.vertex_curvatures()[0], ..step.clone() },
            _ => step.clone(),
        };
        self.steps.iter().map(along_x).collect()
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

    /// Half the diameter of the stop, mm.
    pub fn stop_semi_aperture_mm(&self) -> f64 {
        self.steps[self.stop].semi_aperture
    }

    /// Half the clear diameter of a surface, mm.
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

    /// Where a film stands that lies `film_distance_mm` behind the last vertex, its z along the light: behind an odd number of mirrors
    /// the frame is left-handed, so that x and y stay those of the lens.
    pub fn film_placement(&self, film_distance_mm: f64) -> Placement {
        let last_z_mm = self.last_vertex_z_mm();
        match &self.placed {
            None => Placement::centered(last_z_mm + film_distance_mm),
            Some(placed) if placed.is_film_backward => {
                placed.film.after(&Placement::centered(last_z_mm - film_distance_mm)).flipped()
            }
            Some(placed) => placed.film.after(&Placement::centered(last_z_mm + film_distance_mm)),
        }
    }

    /// Returns where a point of the lens frame lies on a film `film_distance_mm` behind the last vertex, mm, along the film's own
    /// x and y: those of the lens, unless the film is tilted or decentered.
    pub(crate) fn on_film_mm(&self, point_mm: DVec3, film_distance_mm: f64) -> DVec2 {
        match &self.placed {
            None => point_mm.truncate(),
            Some(_) => self.film_placement(film_distance_mm).surface_from_lens(point_mm).truncate(),
        }
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

    /// Traces rays through all surfaces and straight on to the film, `film_distance_mm` behind the last vertex.
    ///
    /// What [`trace`](Self::trace) and [`to_film`](Self::to_film) do, in one go.
    pub fn trace_to_film(&self, rays: &mut RayBatch, rims: Vignetting, film_distance_mm: f64) {
        if !self.has_plain_film() {
            self.trace(rays, rims);
            return self.to_film(rays, film_distance_mm);
        }
        let plan = Plan::new(&self.steps_for(rays.object_z_mm), 0, rims);
        trace::trace_batch(&plan, Goal::Film { film_distance_mm }, rays.slices());
    }

    /// As [`trace_to_film`](Self::trace_to_film), on the threads of the current rayon pool, to the same bits.
    pub fn trace_to_film_parallel(&self, rays: &mut RayBatch, rims: Vignetting, film_distance_mm: f64) {
        if !self.has_plain_film() {
            self.trace_parallel(rays, rims);
            return self.to_film(rays, film_distance_mm);
        }
        let plan = Plan::new(&self.steps_for(rays.object_z_mm), 0, rims);
        let goal = Goal::Film { film_distance_mm };
        rays.par_slices(CHUNK).with_max_len(1).for_each(|chunk| trace::trace_batch(&plan, goal, chunk));
    }

    /// Traces rays in single precision through all surfaces and straight on to the film, `film_distance_mm` behind the last
    /// vertex.
    ///
    /// They land within 0.05 µm of where [`trace_to_film`](Self::trace_to_film) lands them. Through tilted and
    /// decentered surfaces and to curved films they go in double precision, no faster than there.
    pub fn trace_to_film_f32(&self, rays: &mut RayBatchF32, rims: Vignetting, film_distance_mm: f64) {
        if !self.has_plain_film() {
            let mut wide = rays.widened();
            self.trace_to_film(&mut wide, rims, film_distance_mm);
            return rays.set_rounded(&wide, |point, _| point);
        }
        // Where the object plane lies matters to path lengths only.
        let plan = Plan::new(&self.steps, 0, rims);
        trace::trace_batch(&plan, Goal::Film { film_distance_mm }, rays.slices());
    }

    /// Returns the steps, in which ideal lenses know where the object plane appears to them.
    pub(crate) fn steps_for(&self, object_z_mm: f64) -> Cow<'_, [Step]> {
        if !self.steps.iter().any(|step| matches!(step.kind, Kind::ThinLens { .. })) {
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
        }
        Cow::Owned(steps)
    }

    /// Moves rays straight on to the film as it is curved, its vertex `film_distance_mm` behind the last vertex.
    ///
    /// A ray that does not meet a curved film ends as one that missed the surface after the last. Points stay in the lens
    /// frame; [`film_points`](Self::film_points) gives the places on the film itself.
    pub fn to_film(&self, rays: &mut RayBatch, film_distance_mm: f64) {
        let ImageSurface { curvature_per_mm, conic } = self.image_surface;
        if curvature_per_mm == 0.0 {
            return self.to_film_plane(rays, film_distance_mm);
        }
        let medium = (self.image_index(), self.n_surfaces() as u16);
        let placement = self.film_placement(film_distance_mm);
        trace::move_to_placed_conic(&placement, [curvature_per_mm, conic], medium, &mut rays.slices());
    }

    /// Moves rays straight on to the plane through the film's vertex, `film_distance_mm` behind the last vertex, however the film is
    /// curved.
    pub fn to_film_plane(&self, rays: &mut RayBatch, film_distance_mm: f64) {
        match &self.placed {
            None => trace::move_to_plane(rays.slices(), self.last_vertex_z_mm() + film_distance_mm, self.image_index()),
            Some(_) => {
                trace::move_to_placed_plane(
                    &self.film_placement(film_distance_mm),
                    self.image_index(),
                    &mut rays.slices(),
                );
            }
        }
    }

    /// Whether every surface is centered and the film flat: then lens and film are traced in one go.
    pub(crate) fn has_plain_film(&self) -> bool {
        self.placed.is_none() && self.image_surface.curvature_per_mm == 0.0
    }

    /// The shape of the film.
    pub fn image_surface(&self) -> ImageSurface {
        self.image_surface
    }

    /// Returns the image of the axial point at `object_distance_mm` before the first vertex (infinite for far ones).
    pub fn conjugate(&self, object_distance_mm: f64) -> Conjugate {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        Matrix::of(&self.steps).image_of(-object_distance_mm, before, after)
    }

    /// Returns the working f-number for an object at this distance before the first vertex (infinite for a far one):
    /// one over twice the sine of the image-side cone times the index there, by first order.
    ///
    /// It is `N (1 + |m| / m_p)` with `m_p` the magnification of the pupils, and holds where those are infinite too.
    /// With it an unvignetted axial image of a Lambertian plane has `E = π L / (4 N_w²)` to 0.1 % at f/8, at any
    /// magnification; the textbook's `N (1 + |m|)` has not, unless the pupils are equal. Where a rim limits the light and not
    /// the stop, the cone is that of the real marginal ray.
    pub fn working_f_number(&self, object_distance_mm: f64) -> f64 {
        0.5 / self.marginal_ray(object_distance_mm).reduced_slope_after.abs()
    }

    /// Returns the paraxial ray from the axial point at this distance before the first vertex to the edge of the stop; where
    /// a rim limits the light and not the stop, the one that starts as the real marginal ray does.
    pub(crate) fn marginal_ray(&self, object_distance_mm: f64) -> MarginalRay {
        let to_stop = self.marginal_ray_of_stop(object_distance_mm);
        let beam = match object_distance_mm.is_infinite() {
            true => self.limiting_beam(),
            false => self.axial_beam(object_distance_mm).filter(|beam| !beam.is_limited_by_stop),
        };
        match beam {
            Some(beam) if object_distance_mm.is_infinite() => to_stop.scaled(beam.height_mm / to_stop.height_mm),
            Some(beam) => to_stop.scaled((beam.slope_before * self.object_index() / to_stop.reduced_slope).abs()),
            None => to_stop,
        }
    }

    /// The same to the edge of the stop, whether the light gets through or not.
    pub(crate) fn marginal_ray_of_stop(&self, object_distance_mm: f64) -> MarginalRay {
        MarginalRay::of(&self.steps, self.stop, object_distance_mm)
    }

    /// z from the first vertex of the point that fields and depths are counted from, mm: the center of the paraxial
    /// entrance pupil, or the first vertex where that is infinitely far or so far (10⁴ times the first rim) that a
    /// count from it would lose digits.
    pub fn projection_center_z_mm(&self) -> f64 {
        let z_mm = self.first_order.entrance_pupil_z_mm;
        if z_mm.abs() <= FARTHEST_PUPIL * self.front.semi_aperture_mm { z_mm } else { 0.0 }
    }

    /// Returns the image in the x–z plane, which differs from that of [`conjugate`](Self::conjugate) where a surface is
    /// curved differently along x and y.
    pub fn conjugate_x(&self, object_distance_mm: f64) -> Conjugate {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        Matrix::of(&self.steps_along_x()).image_of(-object_distance_mm, before, after)
    }

    /// Returns how far behind the last vertex the film is in focus for an object at this distance before the first.
    ///
    /// # Errors
    /// When there is no real image behind the lens.
    pub fn film_distance_mm_for(&self, object_distance_mm: f64) -> Result<f64, OpticsError> {
        let film_distance_mm = self.conjugate(object_distance_mm).image_z_mm;
        if film_distance_mm > 0.0 && film_distance_mm.is_finite() && object_distance_mm > 0.0 {
            return Ok(film_distance_mm);
        }
        Err(OpticsError::NoFocus { lens: self.name.clone(), side: "behind it", distance_mm: object_distance_mm })
    }

    /// Returns how far before the first vertex an object is in focus on a film at this distance behind the last;
    /// infinite where the film lies in the rear focal plane.
    ///
    /// # Errors
    /// When there is no real object in front of the lens.
    pub fn object_distance_mm_for(&self, film_distance_mm: f64) -> Result<f64, OpticsError> {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        let distance_mm = -Matrix::of(&self.steps).object_of(film_distance_mm, before, after);
        if distance_mm > 0.0 {
            return Ok(distance_mm);
        }
        Err(OpticsError::NoFocus { lens: self.name.clone(), side: "before it", distance_mm: film_distance_mm })
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
    let path_per_cycle_mm = f64::from(stated.order) * 1e-6 * wavelength_nm;
    Some(Phase { profile: stated.profile.clone(), path_per_cycle_mm })
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
