//! A train of surfaces as the kernel takes it: constants worked out once, in the kernel's own kind of float.

use super::{
    Kind, Step, Vignetting,
    aperture::clip,
    asphere::{AllPowers, Asphere, EvenPowers, ManyPowers},
    block::Block,
    crossing::{ConicForm, Ideal, Interface},
    kernel::{Conic, Sphere, ThinLens, TwoCurvatures, Window, pass_blocks},
    real::Real,
};
use crate::Aperture;

/// What to trace: surfaces, and where they lie.
#[derive(Clone, Debug)]
pub(crate) struct Plan<T> {
    pub(super) passes: Vec<Pass<T>>,
    /// The number of the first surface.
    first: usize,
    /// Whether the numbers of the surfaces go down, as those of a lens met from behind do.
    is_reversed: bool,
    /// Whether rays may come from far away.
    pub(super) approaches: bool,
    /// The index before the first surface, and behind the last.
    pub(super) index_before: T,
    pub(super) index_after: T,
}

/// One surface of a plan.
#[derive(Clone, Debug)]
pub(super) struct Pass<T> {
    pub(super) form: Form<T>,
    /// How far its vertex lies behind the one before.
    pub(super) shift: T,
    pub(super) vertex_z: T,
    pub(super) semi_aperture: T,
    pub(super) interface: Interface<T>,
    pub(super) apertures: Vec<Aperture>,
    /// Whether rims end rays.
    pub(super) rims: Vignetting,
}

impl<T: Real> Pass<T> {
    /// Whether there is more to end rays than the round rim.
    pub(super) fn is_clipped_further(&self) -> bool {
        self.rims == Vignetting::On && !self.apertures.is_empty()
    }

    /// Takes blocks through the surface, its rim and its apertures, and returns whether a ray ended there.
    pub(super) fn pass_blocks(&self, shift: T, from: &[Block<T>], to: &mut [Block<T>]) -> bool {
        let is_any_ended = self.form.pass_blocks(shift, from, to);
        (self.is_clipped_further() && clip(&self.apertures, to)) || is_any_ended
    }

    /// Whether a ray that meets the surface here is inside its rim and its apertures.
    pub(super) fn is_within(&self, x: T, y: T) -> bool {
        let is_clear = |aperture: &Aperture| aperture.is_clear_at(x.to_f64(), y.to_f64());
        self.interface.is_within(x, y) && (!self.is_clipped_further() || self.apertures.iter().all(is_clear))
    }
}

/// The forms of surfaces; aspheres are sorted by how many powers they have, and boxed so that a plan stays short.
#[derive(Clone, Debug)]
pub(super) enum Form<T> {
    Window(Window<T>),
    Sphere(Sphere<T>),
    Conic(Conic<T>),
    Even4(Asphere<T, EvenPowers<T, 4>>),
    Even8(Box<Asphere<T, EvenPowers<T, 8>>>),
    Even12(Box<Asphere<T, EvenPowers<T, 12>>>),
    All10(Box<Asphere<T, AllPowers<T, 10>>>),
    All20(Box<Asphere<T, AllPowers<T, 20>>>),
    Many(Asphere<T, ManyPowers<T>>),
    ThinLens(ThinLens<T>),
    TwoCurvatures(TwoCurvatures<T>),
}

/// Does the same with a form's optic, whichever it is: by a plain reference, which the compiler can prove unaliased.
macro_rules! with_optic {
    ($form:expr, $optic:ident => $result:expr) => {
        match $form {
            Form::Window($optic) => $result,
            Form::Sphere($optic) => $result,
            Form::Conic($optic) => $result,
            Form::Even4($optic) => $result,
            Form::Even8(boxed) => {
                let $optic = &**boxed;
                $result
            }
            Form::Even12(boxed) => {
                let $optic = &**boxed;
                $result
            }
            Form::All10(boxed) => {
                let $optic = &**boxed;
                $result
            }
            Form::All20(boxed) => {
                let $optic = &**boxed;
                $result
            }
            Form::Many($optic) => $result,
            Form::ThinLens($optic) => $result,
            Form::TwoCurvatures($optic) => $result,
        }
    };
}

impl<T: Real> Form<T> {
    /// Takes blocks through the surface, and returns whether a ray ended there.
    pub(super) fn pass_blocks(&self, shift: T, from: &[Block<T>], to: &mut [Block<T>]) -> bool {
        with_optic!(self, optic => pass_blocks(optic, shift, from, to))
    }

    /// Takes a single block through the surface, of any size.
    #[cfg(test)]
    pub(super) fn pass<const N: usize>(&self, shift: T, from: &Block<T, N>, to: &mut Block<T, N>) {
        use super::kernel::Optic;

        with_optic!(self, optic => optic.pass(shift, from, to));
    }

    fn of(step: &Step, interface: Interface<T>) -> Self {
        let curvature = T::of(step.curvature);
        match &step.kind {
            Kind::Window => Self::Window(Window(interface)),
            Kind::Sphere => Self::Sphere(Sphere { curvature, interface }),
            Kind::Conic { conic } => Self::Conic(Conic { form: ConicForm::new(curvature, T::of(*conic)), interface }),
            Kind::EvenAsphere { conic, a2, coefficients } => {
                let from_r2: Vec<f64> = std::iter::once(a2).chain(coefficients).copied().collect();
                let base = (ConicForm::new(curvature, T::of(*conic)), interface);
                match from_r2.len() {
                    0..=4 => Self::Even4(asphere(base, EvenPowers(padded(&from_r2)))),
                    5..=8 => Self::Even8(Box::new(asphere(base, EvenPowers(padded(&from_r2))))),
                    9..=12 => Self::Even12(Box::new(asphere(base, EvenPowers(padded(&from_r2))))),
                    _ => {
                        let from_r1 = from_r2.iter().flat_map(|&a| [T::ZERO, T::of(a)]).collect();
                        Self::Many(asphere(base, ManyPowers(from_r1)))
                    }
                }
            }
            Kind::OddAsphere { conic, coefficients } => {
                let base = (ConicForm::new(curvature, T::of(*conic)), interface);
                match coefficients.len() {
                    0..=10 => Self::All10(Box::new(asphere(base, AllPowers(padded(coefficients))))),
                    11..=20 => Self::All20(Box::new(asphere(base, AllPowers(padded(coefficients))))),
                    _ => Self::Many(asphere(base, ManyPowers(coefficients.iter().map(|&a| T::of(a)).collect()))),
                }
            }
            Kind::ThinLens { power, object_z } => {
                let (index_before, index_after) = (T::of(step.index_before), T::of(step.index_after));
                let image_z = step.index_after / (step.index_before / object_z + power);
                let ideal = Ideal {
                    index_before,
                    index_after,
                    power: T::of(*power),
                    object_z: T::of(*object_z),
                    image_z: T::of(image_z),
                };
                Self::ThinLens(ThinLens { ideal, interface })
            }
            Kind::Toric(toric) => Self::TwoCurvatures(TwoCurvatures { toric: toric.clone(), interface }),
        }
    }
}

fn asphere<T, P>((base, interface): (ConicForm<T>, Interface<T>), powers: P) -> Asphere<T, P> {
    Asphere { base, powers, interface }
}

/// Returns the coefficients with zeros behind them.
fn padded<T: Real, const M: usize>(coefficients: &[f64]) -> [T; M] {
    std::array::from_fn(|i| coefficients.get(i).map_or(T::ZERO, |&a| T::of(a)))
}

impl<T: Real> Plan<T> {
    /// Plans a trace through these steps, of which there is at least one; `first` is the number of the first of them.
    pub(crate) fn new(steps: &[Step], first: usize, rims: Vignetting) -> Self {
        let (begin, end) = (&steps[0], &steps[steps.len() - 1]);
        let mut previous_z = begin.vertex_z;
        let pass = |step: &Step| {
            let shift = T::of(step.vertex_z - previous_z);
            previous_z = step.vertex_z;
            // Refraction into an index of the opposite sign is reflection with the direction reversed, which
            // `trace_placed_by` undoes.
            let ratio = if step.is_mirror { -1.0 } else { step.index_before / step.index_after };
            let limit_mm2 = match rims {
                Vignetting::On => T::of(step.semi_aperture * step.semi_aperture),
                Vignetting::Off => T::MAX,
            };
            let interface = Interface {
                ratio: T::of(ratio),
                ratio2: T::of(ratio * ratio),
                index_before: T::of(step.index_before),
                limit_mm2,
            };
            Pass {
                form: Form::of(step, interface),
                shift,
                vertex_z: T::of(step.vertex_z),
                semi_aperture: T::of(step.semi_aperture),
                interface,
                apertures: step.apertures.clone(),
                rims,
            }
        };
        Self {
            first,
            is_reversed: false,
            approaches: first == 0,
            index_before: T::of(begin.index_before),
            index_after: T::of(end.index_after),
            passes: steps.iter().map(pass).collect(),
        }
    }

    /// Plans a trace from behind through these steps, which are mirrored; `first` is the number of the first of them in
    /// the lens as it was, and the others count down from it.
    pub(crate) fn reversed(steps: &[Step], first: usize, rims: Vignetting, approaches: bool) -> Self {
        Self { is_reversed: true, approaches, ..Self::new(steps, first, rims) }
    }

    /// The number of a surface of the plan.
    pub(super) fn surface(&self, place: usize) -> u16 {
        (if self.is_reversed { self.first - place } else { self.first + place }) as u16
    }

    /// z of the vertex that rays start before, and of the last.
    pub(super) fn ends_z(&self) -> (T, T) {
        let z = |pass: Option<&Pass<T>>| pass.map_or(T::ZERO, |pass| pass.vertex_z);
        (z(self.passes.first()), z(self.passes.last()))
    }
}
