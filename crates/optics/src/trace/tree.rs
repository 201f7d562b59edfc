//! Light that is reflected on its way through centered surfaces: all ways of two reflections at once, of four, and of more.
//!
//! Blocks go forward through the lens. From each surface they go back, and from each that they meet on the way forward again; so what
//! ways have in common is traced once. Behind a reflection the frame is mirrored at the vertex plane of the surface, so that light always
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

/// Light below this share of that of the source is followed no further once it has been reflected twice.
const LEAST_SHARE: f64 = 1e-10;

/// What a surface does to light that comes one way: lets it on, or sends it back.
#[derive(Clone, Debug)]
struct Side<T> {
    on: Pass<T>,
    on_light: LightPass<T>,
    back: Pass<T>,
    back_light: Option<LightPass<T>>,
    /// Whether it is the film, where light ends: what it sends back it has got.
    is_film: bool,
}

/// The surfaces of a lens for light that turns back.
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
    /// far behind the last vertex; the step that is the film itself, if one is, sends back what falls within its openings.
    pub(crate) fn new(
        [forward, backward]: [&[Step]; 2],
        [forward_light, backward_light]: [Vec<SideLight<T>>; 2],
        film_mm: f64,
        film_step: Option<usize>,
    ) -> Self {
        let side = |steps: &[Step], i: usize, light: SideLight<T>| {
            let pass = |is_mirror: bool| {
                let mut step = Step { is_mirror: is_mirror || steps[i].is_mirror, ..steps[i].clone() };
                if film_step == Some(i) && !is_mirror {
                    step.apertures.clear();
                }
                Plan::new(&[step], 0, Vignetting::On).passes.swap_remove(0)
            };
            let is_film = film_step == Some(i);
            Side { on: pass(false), on_light: light.on, back: pass(true), back_light: light.back, is_film }
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

    /// Sends rays through the lens, which surfaces reflect so often at most, an even number; `sink` sees what becomes of their light.
    pub(crate) fn trace<S: LightSink<T>>(&self, rays: &RaySlices<'_, T>, most_bounces: usize, sink: &mut S) {
        for start in (0..rays.fate.len()).step_by(LANES * TREE_BLOCKS) {
            let mut lit = Lit::load(rays, start, self.first_z);
            kernel::approach(self.index_before, &mut lit.rays);
            let mut walk = Walk { tree: self, way: Vec::with_capacity(most_bounces), most_bounces, start, sink };
            walk.forward(lit, 0);
        }
    }
}

/// What becomes of light in a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loss {
    /// A rim, an iris or an obscuration ends it, or it misses a surface.
    Clipped,
    /// Glass absorbs it.
    Glass,
    /// A coating absorbs it, or a surface reflects it whose reflections are not followed.
    Coating,
    /// It comes out of the first surface.
    Reflected,
    /// It is reflected more often than is followed.
    Beyond,
    /// The film, on which it is counted, sends it back.
    OffFilm,
}

/// What looks on where light goes.
pub(crate) trait LightSink<T> {
    /// Whether [`lost`](Self::lost) is to be told.
    const IS_ACCOUNT: bool = false;

    /// Notes light on the film: the surfaces that have reflected it, in turn; the number of the first ray; x and y on the film, mm, and the
    /// directions there; and the shares of the light, 0 of rays that end.
    fn on_film(&mut self, way: &[u16], start: usize, rays: [&[T]; 5], shares: &[f64]);

    /// Notes light that goes elsewhere.
    fn lost(&mut self, _loss: Loss, _start: usize, _shares: &[f64]) {}
}

impl<T, F: FnMut(&[u16], usize, [&[T]; 5], &[f64])> LightSink<T> for F {
    fn on_film(&mut self, way: &[u16], start: usize, rays: [&[T]; 5], shares: &[f64]) {
        self(way, start, rays, shares);
    }
}

/// Blocks on their way through the tree.
struct Walk<'a, T, S> {
    tree: &'a GhostTree<T>,
    /// The surfaces that have reflected them.
    way: Vec<u16>,
    most_bounces: usize,
    start: usize,
    sink: &'a mut S,
}

impl<T: Real, S: LightSink<T>> Walk<'_, T, S> {
    /// Follows light that comes to a surface from before it, and on to the film.
    fn forward(&mut self, mut lit: Lit<T>, from: usize) {
        let (mut on, mut back) = (Lit::EMPTY, Lit::EMPTY);
        let tree = self.tree;
        for (j, side) in tree.forward.iter().enumerate().skip(from) {
            if !lit.is_any_alive() {
                return;
            }
            // What the first surface sends back meets no other.
            let is_followed = self.way.len() < self.most_bounces && j > 0;
            let comes_back = (is_followed || S::IS_ACCOUNT) && side.send_back(&lit, &mut back, side.back.shift);
            side.pass_on(&lit, &mut on, side.on.shift);
            if side.is_film && comes_back {
                self.lose(Loss::OffFilm, &back);
            } else {
                self.account(&lit, &on, comes_back.then_some(&back));
            }
            if comes_back && j == 0 {
                self.lose(Loss::Reflected, &back);
            } else if comes_back && !(is_followed && self.is_worth(&back)) {
                self.lose(Loss::Beyond, &back);
            } else if comes_back {
                self.way.push(j as u16);
                self.backward(back.clone(), j);
                self.way.pop();
            }
            std::mem::swap(&mut lit, &mut on);
        }
        self.note_on_film(&mut lit);
    }

    /// Follows light that a surface has sent back, out of the lens.
    fn backward(&mut self, mut lit: Lit<T>, from: usize) {
        let (mut on, mut back) = (Lit::EMPTY, Lit::EMPTY);
        let tree = self.tree;
        for i in (0..from).rev() {
            if !lit.is_any_alive() {
                return;
            }
            // The way from the surface behind is that to it.
            let (shift, side) = (tree.forward[i + 1].on.shift, &tree.backward[i]);
            let comes_back = side.send_back(&lit, &mut back, shift);
            let goes_on = i > 0 || S::IS_ACCOUNT;
            if goes_on {
                side.pass_on(&lit, &mut on, shift);
                self.account(&lit, &on, comes_back.then_some(&back));
            }
            if comes_back && !self.is_worth(&back) {
                self.lose(Loss::Beyond, &back);
            } else if comes_back {
                self.way.push(i as u16);
                self.forward(back.clone(), i + 1);
                self.way.pop();
            }
            std::mem::swap(&mut lit, &mut on);
        }
        self.lose(Loss::Reflected, &lit);
    }

    /// Whether there is light to follow.
    fn is_worth(&self, lit: &Lit<T>) -> bool {
        let least = if self.way.len() < 2 { 0.0 } else { LEAST_SHARE };
        lit.is_any_alive() && (least == 0.0 || lit.brightest() > least)
    }

    fn note_on_film(&mut self, lit: &mut Lit<T>) {
        if !lit.is_any_alive() {
            return;
        }
        kernel::to_plane(self.tree.film_mm, self.tree.index_after, &mut lit.rays);
        for (k, block) in lit.rays.iter().enumerate() {
            let rays = [&block.x[..], &block.y, &block.l, &block.m, &block.n];
            self.sink.on_film(&self.way, self.start + k * LANES, rays, &lit.shares(k));
        }
    }

    fn lose(&mut self, loss: Loss, lit: &Lit<T>) {
        if S::IS_ACCOUNT {
            for k in 0..TREE_BLOCKS {
                self.sink.lost(loss, self.start + k * LANES, &lit.shares(k));
            }
        }
    }

    /// Accounts for what a surface, and the medium before it, have taken.
    fn account(&mut self, before: &Lit<T>, on: &Lit<T>, back: Option<&Lit<T>>) {
        if !S::IS_ACCOUNT {
            return;
        }
        for k in 0..TREE_BLOCKS {
            let (came, went) = (before.shares(k), on.shares(k));
            let returned = back.map_or([0.0; LANES], |back| back.shares(k));
            let mut lost = [[0.0; LANES]; 3];
            for i in 0..LANES {
                let arrived = match (on.is_alive(k, i), back.is_some_and(|back| back.is_alive(k, i))) {
                    (true, _) => came[i] * on.light[k].clear_since(&before.light[k], i),
                    (false, true) => came[i] * back.map_or(1.0, |back| back.light[k].clear_since(&before.light[k], i)),
                    (false, false) => {
                        lost[0][i] = came[i];
                        continue;
                    }
                };
                lost[1][i] = came[i] - arrived;
                lost[2][i] = arrived - went[i] - returned[i];
            }
            for (loss, shares) in [Loss::Clipped, Loss::Glass, Loss::Coating].into_iter().zip(&lost) {
                self.sink.lost(loss, self.start + k * LANES, shares);
            }
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

    fn is_alive(&self, block: usize, i: usize) -> bool {
        self.rays[block].alive[i] != T::NO
    }

    /// Returns the shares of the light of a block, 0 of rays that have ended.
    fn shares(&self, block: usize) -> [f64; LANES] {
        std::array::from_fn(|i| if self.is_alive(block, i) { self.light[block].share(i) } else { 0.0 })
    }

    /// Returns the greatest of all shares.
    fn brightest(&self) -> f64 {
        (0..TREE_BLOCKS).flat_map(|k| self.shares(k)).fold(0.0, f64::max)
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
