//! First-order optics: cardinal points, pupils and conjugates.

use serde::Serialize;

use crate::trace::{Kind, Step};

/// The first-order data of a lens at one wavelength.
///
/// z of things in front is from the first vertex, of things behind from the last, both positive downstream.
/// A lens without power (a pinhole) has infinite focal lengths; a telecentric one an infinitely far pupil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FirstOrder {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Power: one over the effective focal length, 1/mm.
    pub power_per_mm: f64,
    /// Effective focal length, one over the power, mm.
    pub efl_mm: f64,
    /// z of the rear focal point from the last vertex, mm.
    pub bfl_mm: f64,
    /// z of the front focal point from the first vertex, mm.
    pub ffl_mm: f64,
    /// z of the front principal plane from the first vertex, mm.
    pub front_principal_mm: f64,
    /// z of the rear principal plane from the last vertex, mm.
    pub rear_principal_mm: f64,
    /// z of the entrance pupil from the first vertex, mm.
    pub entrance_pupil_z_mm: f64,
    /// Diameter of the entrance pupil, mm.
    pub entrance_pupil_diameter_mm: f64,
    /// z of the exit pupil from the last vertex, mm.
    pub exit_pupil_z_mm: f64,
    /// Diameter of the exit pupil, mm.
    pub exit_pupil_diameter_mm: f64,
    /// f-number for a far object: effective focal length over entrance-pupil diameter.
    pub f_number: f64,
    /// Index of the image space.
    pub image_index: f64,
}

impl FirstOrder {
    /// Exit-pupil diameter over entrance-pupil diameter.
    pub fn pupil_magnification(&self) -> f64 {
        self.exit_pupil_diameter_mm / self.entrance_pupil_diameter_mm
    }

    /// Returns the working f-number `N (1 + |m| / m_p)` at a magnification, `m_p` being that of the pupils.
    ///
    /// With it an unvignetted axial image of a Lambertian plane has `E = π L / (4 N_w²)` to 0.1 % at f/8, at any
    /// magnification; the textbook's `N (1 + |m|)` has not, unless the pupils are equal.
    pub fn working_f_number(&self, magnification: f64) -> f64 {
        self.f_number * (1.0 + magnification.abs() / self.pupil_magnification())
    }
}

/// The image of an axial object point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Conjugate {
    /// z of the image from the last vertex, mm; infinite for an object in the front focal plane.
    pub image_z_mm: f64,
    /// Lateral magnification, negative for an image upside down; 0 for a far object.
    pub magnification: f64,
}

/// A system's action on (height, index × slope), from one plane to another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix {
    pub(crate) a: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
    pub(crate) d: f64,
}

impl Matrix {
    const IDENTITY: Self = Self { a: 1.0, b: 0.0, c: 0.0, d: 1.0 };

    fn after_refraction(self, power: f64) -> Self {
        Self { c: self.c - power * self.a, d: self.d - power * self.b, ..self }
    }

    fn after_transfer(self, reduced_mm: f64) -> Self {
        Self { a: self.a + reduced_mm * self.c, b: self.b + reduced_mm * self.d, ..self }
    }

    /// Returns the action from the first vertex of these steps to the last, that of the last's own power included.
    pub(crate) fn of(steps: &[Step]) -> Self {
        let mut matrix = Self::IDENTITY;
        for (i, step) in steps.iter().enumerate() {
            if i > 0 {
                matrix = matrix.after_transfer((step.vertex_z - steps[i - 1].vertex_z) / step.index_before);
            }
            matrix = matrix.after_refraction(step.power());
        }
        matrix
    }

    /// Returns the action from the first vertex to just before the surface at `stop`.
    fn up_to(steps: &[Step], stop: usize) -> Self {
        if stop == 0 {
            return Self::IDENTITY;
        }
        let gap = steps[stop].vertex_z - steps[stop - 1].vertex_z;
        Self::of(&steps[..stop]).after_transfer(gap / steps[stop].index_before)
    }

    /// Returns the image of a point at `object_z` from the first vertex.
    pub(crate) fn image_of(self, object_z: f64, index_before: f64, index_after: f64) -> Conjugate {
        // A ray of reduced slope 1 from the object point, or of height 1 from a far one.
        let (y, w) = if object_z.is_infinite() { (1.0, 0.0) } else { (-object_z / index_before, 1.0) };
        let (y2, w2) = (self.a * y + self.b * w, self.c * y + self.d * w);
        Conjugate { image_z_mm: -index_after * y2 / w2, magnification: w / w2 }
    }

    /// Returns z from the first vertex of the point that is imaged at `image_z` from the last; infinite where that
    /// is the focal plane to rounding.
    pub(crate) fn object_of(self, image_z: f64, index_before: f64, index_after: f64) -> f64 {
        let y2 = -image_z / index_after;
        let (y, w) = (self.d * y2 - self.b, self.a - self.c * y2);
        if w.abs() <= 1e-14 * (self.a.abs() + (self.c * y2).abs()) {
            return f64::NEG_INFINITY;
        }
        -index_before * y / w
    }
}

impl Step {
    /// The paraxial power of the surface, 1/mm.
    pub(crate) fn power(&self) -> f64 {
        match self.kind {
            Kind::Window => 0.0,
            Kind::ThinLens { power, .. } => power,
            _ => (self.index_after - self.index_before) * self.curvature,
        }
    }
}

pub(crate) fn first_order(steps: &[Step], stop: usize, wavelength_nm: f64) -> FirstOrder {
    let whole = Matrix::of(steps);
    let front = Matrix::up_to(steps, stop);
    let rear = Matrix::of(&steps[stop..]);
    let (n0, n1) = (steps[0].index_before, steps[steps.len() - 1].index_after);
    let power = -whole.c;
    let stop_diameter_mm = 2.0 * steps[stop].semi_aperture;
    let entrance_pupil_diameter_mm = stop_diameter_mm / front.a.abs();
    FirstOrder {
        wavelength_nm,
        power_per_mm: power,
        efl_mm: 1.0 / power,
        bfl_mm: n1 * whole.a / power,
        ffl_mm: -n0 * whole.d / power,
        front_principal_mm: n0 * (1.0 - whole.d) / power,
        rear_principal_mm: n1 * (whole.a - 1.0) / power,
        entrance_pupil_z_mm: n0 * front.b / front.a,
        entrance_pupil_diameter_mm,
        exit_pupil_z_mm: -n1 * rear.b / rear.d,
        exit_pupil_diameter_mm: stop_diameter_mm / rear.d.abs(),
        f_number: (1.0 / power).abs() / entrance_pupil_diameter_mm,
        image_index: n1,
    }
}
