//! A lens at one wavelength: the thing that is traced.

use std::{borrow::Cow, ops::Range};

use rayon::iter::ParallelIterator;

use crate::{
    Conjugate, FirstOrder, Lens, OpticsError, RayBatch, Rims, Shape, Surface,
    paraxial::{self, Matrix},
    trace::{self, Kind, Step},
};

/// Rays that one task of [`MonoLens::trace_parallel`] traces.
const CHUNK: usize = 4096;

/// A lens at one wavelength, its indices resolved; tracing it cannot fail as a whole.
#[derive(Clone, Debug)]
pub struct MonoLens {
    // Invariant: at least one step, and `stop` is an index of them.
    name: String,
    wavelength_nm: f64,
    steps: Vec<Step>,
    stop: usize,
    front: Surface,
    first_order: FirstOrder,
}

impl MonoLens {
    pub(crate) fn new(lens: &Lens, wavelength_nm: f64) -> Result<Self, OpticsError> {
        let mut steps = Vec::with_capacity(lens.interfaces().len());
        let mut index_before = 1.0;
        for (interface, vertex_z) in lens.interfaces().iter().zip(lens.vertices_z_mm()) {
            let index_after = interface.medium_after.index_at(wavelength_nm)?;
            let surface = &interface.surface;
            let kind = match &surface.shape {
                Shape::Sphere if surface.curvature_per_mm == 0.0 && index_before == index_after => Kind::Window,
                Shape::Sphere => Kind::Sphere,
                Shape::Conic { conic } => Kind::Conic { conic: *conic },
                Shape::EvenAsphere { conic, coefficients } => {
                    Kind::EvenAsphere { conic: *conic, a2: 0.0, coefficients: coefficients.clone() }
                }
                Shape::OddAsphere { conic, coefficients } => asphere(*conic, coefficients),
                Shape::ThinLens { power_per_mm } => {
                    Kind::ThinLens { power: *power_per_mm, object_z: f64::NEG_INFINITY }
                }
            };
            let (curvature, semi_aperture) = (surface.curvature_per_mm, surface.semi_aperture_mm);
            steps.push(Step { kind, curvature, index_before, index_after, vertex_z, semi_aperture });
            index_before = index_after;
        }
        let first_order = paraxial::first_order(&steps, lens.stop(), wavelength_nm);
        let front = lens.interfaces()[0].surface.clone();
        Ok(Self { name: lens.name().to_owned(), wavelength_nm, steps, stop: lens.stop(), front, first_order })
    }

    /// The wavelength, nm.
    pub fn wavelength_nm(&self) -> f64 {
        self.wavelength_nm
    }

    /// Focal lengths, principal planes and pupils.
    pub fn first_order(&self) -> FirstOrder {
        self.first_order
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

    /// z of a surface's vertex from the first, mm.
    pub fn vertex_z_mm(&self, surface: usize) -> f64 {
        self.steps[surface].vertex_z
    }

    /// z of the last vertex from the first, mm.
    pub fn last_vertex_z_mm(&self) -> f64 {
        self.steps[self.steps.len() - 1].vertex_z
    }

    pub(crate) fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Returns the z of the first surface at a distance from the axis, mm; NaN beyond its equator.
    pub(crate) fn front_sag_mm(&self, r_mm: f64) -> f64 {
        self.front.sag_mm(r_mm)
    }

    /// Traces rays through all surfaces, on this thread.
    ///
    /// Each ray in flight ends on the last surface, bent into the image space, or where it was lost.
    pub fn trace(&self, rays: &mut RayBatch, rims: Rims) {
        self.trace_surfaces(0..self.n_surfaces(), rays, rims);
    }

    /// Traces rays through some of the surfaces, on this thread.
    ///
    /// The rays must lie in the medium before the first of them. Behind the stop, for one, directions may be changed
    /// before the trace goes on with the next surface.
    pub fn trace_surfaces(&self, surfaces: Range<usize>, rays: &mut RayBatch, rims: Rims) {
        let first = surfaces.start;
        let steps = self.steps_for(rays.object_z_mm);
        trace::trace_batch(&steps[surfaces], first, rims, rays.slices());
    }

    /// Traces rays through all surfaces on the threads of the current rayon pool.
    ///
    /// The result is that of [`trace`](Self::trace), to the bit.
    pub fn trace_parallel(&self, rays: &mut RayBatch, rims: Rims) {
        let steps = self.steps_for(rays.object_z_mm);
        rays.par_slices(CHUNK).for_each(|chunk| trace::trace_batch(&steps, 0, rims, chunk));
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

    /// Moves rays straight on to the film plane, `film_mm` behind the last vertex.
    pub fn to_film(&self, rays: &mut RayBatch, film_mm: f64) {
        trace::move_to_plane(rays.slices(), self.last_vertex_z_mm() + film_mm, self.image_index());
    }

    /// Returns the image of the axial point at `object_distance_mm` before the first vertex (infinite for far ones).
    pub fn conjugate(&self, object_distance_mm: f64) -> Conjugate {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        Matrix::of(&self.steps).image_of(-object_distance_mm, before, after)
    }

    /// Returns how far behind the last vertex the film is in focus for an object at this distance before the first.
    ///
    /// # Errors
    /// When there is no real image behind the lens.
    pub fn film_mm_for(&self, object_distance_mm: f64) -> Result<f64, OpticsError> {
        let film_mm = self.conjugate(object_distance_mm).image_z_mm;
        if film_mm > 0.0 && film_mm.is_finite() && object_distance_mm > 0.0 {
            return Ok(film_mm);
        }
        Err(OpticsError::NoFocus { lens: self.name.clone(), side: "behind it", distance_mm: object_distance_mm })
    }

    /// Returns how far before the first vertex an object is in focus on a film at this distance behind the last;
    /// infinite where the film lies in the rear focal plane.
    ///
    /// # Errors
    /// When there is no real object in front of the lens.
    pub fn object_distance_mm_for(&self, film_mm: f64) -> Result<f64, OpticsError> {
        let (before, after) = (self.steps[0].index_before, self.image_index());
        let distance_mm = -Matrix::of(&self.steps).object_of(film_mm, before, after);
        if distance_mm > 0.0 {
            return Ok(distance_mm);
        }
        Err(OpticsError::NoFocus { lens: self.name.clone(), side: "before it", distance_mm: film_mm })
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
