//! Light that is reflected twice on its way through centered surfaces: all pairs of surfaces at once.
//!
//! Blocks go forward through the lens once. From each surface they go back, and from each that they meet on the way forward again; so what
//! pairs have in common is traced once. Behind a reflection the frame is mirrored at the vertex plane of the surface, so that light always
//! runs towards +z and the kernels do the work; behind the second it is the frame of the lens again.

use super::{
    Step, Vignetting,
    block::{Block, LANES},
    kernel,
    light::{self, Lane, LightPass},
    plan::{Pass, Plan},
    real::Real,
};
use crate::rays::RaySlices;

/// Blocks that go through the tree together.
const TREE_BLOCKS: usize = 4;

/// What a surface does to light that comes one way: lets it on, or sends it back.
#[derive(Clone, Debug)]
struct Side<T> {
    on: Pass<T>,
    on_light: LightPass<T>,
    back: Pass<T>,
    back_light: Option<LightPass<T>>,
}

/// The surfaces of a lens for light that turns back twice.
#[derive(Clone, Debug)]
pub(crate) struct GhostTree<T> {
    forward: Vec<Side<T>>,
    backward: Vec<Side<T>>,
    index_before: T,
    index_after: T,
    first_z: T,
    film_mm: T,
}

/// Light that one surface transmits and reflects, met from one side.
#[derive(Clone, Debug)]
pub(crate) struct SideLight<T> {
    /// What goes on.
    pub(crate) on: LightPass<T>,
    /// What comes back, if any does.
    pub(crate) back: Option<LightPass<T>>,
}

/// Blocks of rays on a surface, and their light.
#[derive(Clone)]
struct Lit<T: Real> {
    rays: [Block<T>; TREE_BLOCKS],
    light: [Lane<T, LANES>; TREE_BLOCKS],
}

impl<T: Real> GhostTree<T> {
    /// Prepares these steps, as light meets them forward and, mirrored, backward (both in the order from the first surface), for a film so
    /// far behind the last vertex.
    pub(crate) fn new(
        [forward, backward]: [&[Step]; 2],
        [forward_light, backward_light]: [Vec<SideLight<T>>; 2],
        film_mm: f64,
    ) -> Self {
        let side = |steps: &[Step], i: usize, light: SideLight<T>| {
            let pass = |is_mirror: bool| {
                let step = Step { is_mirror: is_mirror || steps[i].is_mirror, ..steps[i].clone() };
                Plan::new(&[step], 0, Vignetting::On).passes.swap_remove(0)
            };
            Side { on: pass(false), on_light: light.on, back: pass(true), back_light: light.back }
        };
        let sides = |steps: &[Step], lights: Vec<SideLight<T>>| -> Vec<Side<T>> {
            let of = |(i, light)| side(steps, i, light);
            let mut sides: Vec<Side<T>> = lights.into_iter().enumerate().map(of).collect();
            // From the vertex that light comes from: the same way on and back.
            for i in 1..sides.len() {
                let shift = T::of((steps[i].vertex_z - steps[i - 1].vertex_z).abs());
                sides[i].on.shift = shift;
                sides[i].back.shift = shift;
            }
            sides
        };
        let last = &forward[forward.len() - 1];
        Self {
            index_before: T::of(forward[0].index_before),
            index_after: T::of(last.index_after),
            first_z: T::of(forward[0].vertex_z),
            film_mm: T::of(film_mm),
            forward: sides(forward, forward_light),
            backward: sides(backward, backward_light),
        }
    }

    /// Sends rays through the lens. `note` sees what reaches the film: the pair of surfaces that light comes back from, the first of them
    /// the one that it meets first, or none of light that goes straight on; the number of the first ray; x and y on the film, mm, and the
    /// directions there; and the shares of the light, 0 of rays that end.
    pub(crate) fn trace(
        &self,
        rays: &RaySlices<'_, T>,
        note: &mut impl FnMut(Option<[usize; 2]>, usize, [&[T]; 5], &[f64]),
    ) {
        let n = self.forward.len();
        // Where the light is before each surface and behind the last, and room for what is on its way back and forward again.
        let mut there = vec![Lit::EMPTY; n + 1];
        let [mut back, mut back_on, mut again, mut again_on] = [const { Lit::EMPTY }; 4];
        for start in (0..rays.fate.len()).step_by(LANES * TREE_BLOCKS) {
            there[0] = Lit::load(rays, start, self.first_z);
            kernel::approach(self.index_before, &mut there[0].rays);
            for (i, side) in self.forward.iter().enumerate() {
                let (before, behind) = there.split_at_mut(i + 1);
                side.pass_on(&before[i], &mut behind[0], side.on.shift);
            }
            self.note_on_film(None, start, &mut there[n].clone(), note);
            for (j, first) in self.forward.iter().enumerate().skip(1) {
                // Back from a surface …
                if !first.send_back(&there[j], &mut back, first.back.shift) {
                    continue;
                }
                for i in (0..j).rev() {
                    if !back.is_any_alive() {
                        break;
                    }
                    // The way from the surface behind is that to it.
                    let (shift, side) = (self.forward[i + 1].on.shift, &self.backward[i]);
                    // … and forward again from each before it.
                    if side.send_back(&back, &mut again, shift) {
                        for side in &self.forward[i + 1..] {
                            if !again.is_any_alive() {
                                break;
                            }
                            side.pass_on(&again, &mut again_on, side.on.shift);
                            std::mem::swap(&mut again, &mut again_on);
                        }
                        self.note_on_film(Some([j, i]), start, &mut again, note);
                    }
                    if i > 0 {
                        side.pass_on(&back, &mut back_on, shift);
                        std::mem::swap(&mut back, &mut back_on);
                    }
                }
            }
        }
    }

    fn note_on_film(
        &self,
        pair: Option<[usize; 2]>,
        start: usize,
        lit: &mut Lit<T>,
        note: &mut impl FnMut(Option<[usize; 2]>, usize, [&[T]; 5], &[f64]),
    ) {
        if !lit.is_any_alive() {
            return;
        }
        kernel::to_plane(self.film_mm, self.index_after, &mut lit.rays);
        for (k, (block, lane)) in lit.rays.iter().zip(&lit.light).enumerate() {
            let mut shares = [0.0; LANES];
            for (i, share) in shares.iter_mut().enumerate().filter(|(i, _)| block.alive[*i] != T::NO) {
                *share = lane.share(i);
            }
            note(pair, start + k * LANES, [&block.x, &block.y, &block.l, &block.m, &block.n], &shares);
        }
    }
}

impl<T: Real> Side<T> {
    /// Lets light on, from a surface that lies before this one by `shift`.
    fn pass_on(&self, from: &Lit<T>, to: &mut Lit<T>, shift: T) {
        self.on.pass_blocks(shift, &from.rays, &mut to.rays);
        to.light = from.light;
        to.shade(&self.on_light, shift, from);
    }

    /// Sends light back; returns whether any comes back.
    fn send_back(&self, from: &Lit<T>, to: &mut Lit<T>, shift: T) -> bool {
        let Some(light) = &self.back_light else { return false };
        self.back.pass_blocks(shift, &from.rays, &mut to.rays);
        // The kernel leaves directions behind a mirror reversed.
        for block in &mut to.rays {
            for list in [&mut block.l, &mut block.m, &mut block.n] {
                list.iter_mut().for_each(|v| *v = -*v);
            }
        }
        to.light = from.light;
        to.shade(light, shift, from);
        to.fold();
        true
    }
}

impl<T: Real> Lit<T> {
    const EMPTY: Self = Self { rays: [Block::EMPTY; TREE_BLOCKS], light: [Lane::UNPOLARIZED; TREE_BLOCKS] };

    fn load(rays: &RaySlices<'_, T>, start: usize, first_z: T) -> Self {
        let block = |k: usize| match start + k * LANES < rays.fate.len() {
            true => Block::load(rays, start + k * LANES, first_z),
            false => Block::EMPTY,
        };
        Self { rays: std::array::from_fn(block), light: [Lane::UNPOLARIZED; TREE_BLOCKS] }
    }

    fn is_any_alive(&self) -> bool {
        self.rays.iter().any(Block::is_any_alive)
    }

    fn shade(&mut self, pass: &LightPass<T>, shift: T, from: &Self) {
        if !pass.is_nothing() {
            light::pass_lanes(pass, shift, (&from.rays, &self.rays), &mut self.light);
        }
    }

    /// Mirrors the frame at the vertex plane.
    fn fold(&mut self) {
        for block in &mut self.rays {
            block.z.iter_mut().chain(&mut block.n).for_each(|v| *v = -*v);
        }
        self.light.iter_mut().for_each(Lane::mirror);
    }
}
