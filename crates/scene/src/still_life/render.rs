//! The picture of the still life: rays from the eye, light gathered, smoothed and colored.

use std::{
    collections::VecDeque,
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering},
};

use dioptric_spectrum::{Cancel, Cancelled, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::{DMat3, DVec2, DVec3};
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    filter::{Guide, Lights, PASSES, Smoothing},
    noise::{pixel_offset, spread},
    pigment::PigmentIndex,
    shade::{Colors, LightRays, N_OFFSETS, Shader},
    shape::Ray,
    world::{Hit, Seen, World},
};
use crate::{SceneError, View};

/// Points of a pixel: 4 × 4, no two in one row or column of a fine lattice. The first four are themselves spread.
const POINTS: [(u8, u8); 16] = [
    (0, 1),
    (1, 3),
    (2, 0),
    (3, 2),
    (0, 0),
    (0, 2),
    (0, 3),
    (1, 0),
    (1, 1),
    (1, 2),
    (2, 1),
    (2, 2),
    (2, 3),
    (3, 0),
    (3, 1),
    (3, 3),
];
/// An eye in the room.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eye {
    pub(super) origin: DVec3,
    /// Its right, its up and where it looks.
    pub(super) axes: DMat3,
    pub(super) view: View,
}

impl Eye {
    pub(super) fn ray(&self, row: f64, column: f64) -> Ray {
        let (x, y) = self.view.tan_at(row, column);
        Ray { origin: self.origin, direction: (self.axes * DVec3::new(x, y, 1.0)).normalize() }
    }

    pub(super) fn depth_m(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.axes.z_axis)
    }
}

/// A part of a pixel that shows one object, while the pixel is looked through.
pub(super) struct Part {
    pub(super) seen: Seen,
    /// Share of the pixel.
    pub(super) share: f32,
    /// The part of the share whose coat is rough.
    pub(super) sheen: f32,
    /// Pigments, each with its share of the pixel.
    pub(super) pigments: Vec<(PigmentIndex, f32)>,
}

/// What is kept of a part until the light is smoothed.
struct Fragment {
    object: u32,
    sheen: f32,
    n_pigments: usize,
    /// For all but the largest part of a pixel, whose light may have to be gathered later.
    seen: Option<Box<Seen>>,
}

/// A row before its light is smoothed.
struct Row {
    /// The surface of the largest part of each pixel, and the light on it.
    guides: Vec<Guide>,
    lights: Vec<Lights>,
    /// How many fragments each pixel has, the largest first; all fragments; all their pigments.
    n_fragments: Vec<usize>,
    fragments: Vec<Fragment>,
    pigments: Vec<(PigmentIndex, f32)>,
    /// What is mirrored or glows, columns × bands.
    own: Vec<f32>,
    z_m: Vec<f32>,
}

impl Row {
    fn empty(columns: usize, n_bands: usize) -> Self {
        Self {
            guides: Vec::with_capacity(columns),
            lights: Vec::with_capacity(columns),
            n_fragments: Vec::with_capacity(columns),
            fragments: Vec::with_capacity(columns),
            pigments: Vec::with_capacity(2 * columns),
            own: vec![0.0; columns * n_bands],
            z_m: Vec::with_capacity(columns),
        }
    }

    /// Adds the parts of the next pixel, the largest first.
    fn push(&mut self, parts: Vec<Part>) {
        self.n_fragments.push(parts.len());
        for (place, part) in parts.into_iter().enumerate() {
            self.fragments.push(Fragment {
                object: part.seen.object as u32,
                sheen: part.sheen,
                n_pigments: part.pigments.len(),
                seen: (place > 0).then(|| Box::new(part.seen)),
            });
            self.pigments.extend(part.pigments);
        }
    }
}

/// A layer of the picture.
pub(super) struct Layer {
    pub(super) radiance: SpectralImage,
    pub(super) depth: DepthMap,
}

/// Which surfaces a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    /// The first on each ray.
    First,
    /// The first behind the thing at the center of the pixel.
    Behind,
}

/// How far the painting is, and whether it is still wanted.
pub(super) struct Painting<'a> {
    n_rows: usize,
    n_done: AtomicUsize,
    progress: &'a (dyn Fn(f64) + Sync),
    pub(super) cancel: &'a Cancel,
}

impl<'a> Painting<'a> {
    pub(super) fn new(n_rows: usize, progress: &'a (dyn Fn(f64) + Sync), cancel: &'a Cancel) -> Self {
        Self { n_rows, n_done: AtomicUsize::new(0), progress, cancel }
    }

    pub(super) fn row_is_done(&self) {
        let n_done = 1 + self.n_done.fetch_add(1, Ordering::Relaxed);
        (self.progress)(n_done as f64 / self.n_rows as f64);
    }
}

/// The surface of the largest part of each pixel, and the light on it, smoothed; row by row.
#[derive(Clone, Debug)]
pub(super) struct LitPixels {
    pub(super) guides: Vec<Guide>,
    pub(super) lights: Vec<Lights>,
}

/// Returns the light on what the pixels of a picture show, without the picture.
pub(super) fn lit_pixels(
    (world, colors): (&World, &Colors),
    eye: &Eye,
    (rows, columns): (usize, usize),
    which: Which,
    painting: &Painting<'_>,
) -> Result<LitPixels, Cancelled> {
    let shader = Shader::new(world, eye.origin, colors);
    // Light is kept in tones, on whatever bands: there is no picture, hence there are none.
    let painter = Painter { shader, colors, eye, n_bands: 0, which, painting };
    let mut smoothing = Smoothing::of_rows(rows, PASSES);
    let n_at_once = rows_at_once();
    for first in (0..rows).step_by(n_at_once) {
        let drawn = painter.rows(first..(first + n_at_once).min(rows), columns)?;
        smoothing.push(drawn.into_iter().map(|row| (row.guides, row.lights)), painting.cancel)?;
        // All rows are kept as they end, none as they were gathered.
        smoothing.forget_before(0);
    }
    let (guides, lights) = smoothing.smoothed();
    Ok(LitPixels { guides: guides.concat(), lights: lights.concat() })
}

/// Returns how many rows are drawn in one go, enough for no thread to wait for long: of more than these and as many again nothing but the picture is kept.
pub(super) fn rows_at_once() -> usize {
    48.max(8 * rayon::current_num_threads())
}

/// Returns the picture of a world.
pub(super) fn picture(
    world: &World,
    eye: &Eye,
    (rows, columns): (usize, usize),
    grid: &WavelengthGrid,
    which: Which,
    painting: &Painting<'_>,
) -> Result<Layer, SceneError> {
    let colors = Colors::on(grid);
    let shader = Shader::new(world, eye.origin, &colors);
    let painter = Painter { shader, colors: &colors, eye, n_bands: grid.len(), which, painting };
    let mut planes = vec![Array2::<f32>::zeros((rows, columns)); grid.len()];
    let mut z_m = Array2::zeros((rows, columns));
    let mut finishing = Finishing {
        painter: &painter,
        smoothing: Smoothing::of_rows(rows, PASSES),
        drawn: VecDeque::new(),
        n_finished: 0,
        lines: lines(&mut planes),
        z_m: &mut z_m,
    };
    let n_at_once = rows_at_once();
    let after = |row: usize| row..(row + n_at_once).min(rows);
    let mut next = after(0);
    let mut drawn = painter.rows(next.clone(), columns)?;
    while !drawn.is_empty() {
        next = after(next.end);
        // The next rows are drawn while the last ones are finished.
        let (more, finished) = rayon::join(|| painter.rows(next.clone(), columns), || finishing.push(drawn));
        finished?;
        drawn = more?;
    }
    Ok(Layer { radiance: SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?, depth: DepthMap::new(z_m)? })
}

/// Returns the rows of bands, those of all bands together.
pub(super) fn lines(planes: &mut [Array2<f32>]) -> Vec<Vec<&mut [f32]>> {
    let (rows, columns) = planes.first().map_or((0, 0), Array2::dim);
    let mut lines: Vec<Vec<&mut [f32]>> = (0..rows).map(|_| Vec::with_capacity(planes.len())).collect();
    for plane in planes {
        let samples = plane.as_slice_mut().expect("a new plane is in standard order");
        samples.chunks_exact_mut(columns).zip(&mut lines).for_each(|(line, bands)| bands.push(line));
    }
    lines
}

/// What becomes of rows that are drawn.
struct Finishing<'a> {
    painter: &'a Painter<'a>,
    smoothing: Smoothing,
    /// Rows whose light waits for those below, from `n_finished` on.
    drawn: VecDeque<Row>,
    n_finished: usize,
    /// The rows of the picture, all bands of each.
    lines: Vec<Vec<&'a mut [f32]>>,
    z_m: &'a mut Array2<f32>,
}

impl Finishing<'_> {
    /// Takes the next rows, and paints all whose light is smoothed.
    fn push(&mut self, mut drawn: Vec<Row>) -> Result<(), Cancelled> {
        let take = |row: &mut Row| (std::mem::take(&mut row.guides), std::mem::take(&mut row.lights));
        self.smoothing.push(drawn.iter_mut().map(take), self.painter.painting.cancel)?;
        self.drawn.extend(drawn);
        // Of the light beside an outline the row below is needed.
        let n_smoothed = self.smoothing.n_smoothed();
        let end = if n_smoothed == self.lines.len() { n_smoothed } else { n_smoothed.saturating_sub(1) };
        let first = self.n_finished;
        let ready: Vec<Row> = self.drawn.drain(..end.saturating_sub(first)).collect();
        for (drawn, mut line) in ready.iter().zip(self.z_m.rows_mut().into_iter().skip(first)) {
            line.iter_mut().zip(&drawn.z_m).for_each(|(to, from)| *to = *from);
        }
        let (guides, lights) = self.smoothing.smoothed();
        let lines = &mut self.lines[first..first + ready.len()];
        ready.into_par_iter().zip(lines).enumerate().try_for_each(|(n, (drawn, bands))| {
            let spectra = self.painter.finished(first + n, drawn, guides, lights)?;
            for (band, samples) in bands.iter_mut().enumerate() {
                let values = spectra[band..].iter().step_by(self.painter.n_bands);
                samples.iter_mut().zip(values).for_each(|(sample, value)| *sample = *value);
            }
            Ok(())
        })?;
        self.n_finished = first.max(end);
        self.smoothing.forget_before(self.n_finished.saturating_sub(1));
        Ok(())
    }
}

pub(super) struct Painter<'a> {
    pub(super) shader: Shader<'a>,
    pub(super) colors: &'a Colors,
    pub(super) eye: &'a Eye,
    pub(super) n_bands: usize,
    pub(super) which: Which,
    pub(super) painting: &'a Painting<'a>,
}

impl Painter<'_> {
    fn rows(&self, rows: Range<usize>, columns: usize) -> Result<Vec<Row>, Cancelled> {
        rows.into_par_iter().map(|row| self.row(row, columns)).collect()
    }

    fn row(&self, row: usize, columns: usize) -> Result<Row, Cancelled> {
        let mut drawn = Row::empty(columns, self.n_bands);
        for column in 0..columns {
            self.painting.cancel.check()?;
            let aim = Aim::new(self, row, column);
            drawn.z_m.push(aim.z_m as f32);
            let parts = self.parts(&aim, &mut drawn.own[column * self.n_bands..][..self.n_bands]);
            let largest = &parts[0].seen;
            drawn.guides.push(Guide::of(largest));
            drawn.lights.push(self.shader.gather(largest, LightRays::ALL, &pixel_offsets(row, column)));
            drawn.push(parts);
        }
        self.painting.row_is_done();
        Ok(drawn)
    }

    /// Returns what is seen first at a place of the picture.
    pub(super) fn look(&self, row: f64, column: f64) -> Seen {
        let ray = self.eye.ray(row, column);
        let hit = self.shader.world.first_hit(ray, 0.0, None);
        self.seen(&hit.expect("the room is closed: every ray from inside meets it"), ray)
    }

    fn seen(&self, hit: &Hit, ray: Ray) -> Seen {
        let world = self.shader.world;
        world.seen(hit, ray.direction, footprint_m(world, hit, ray.direction, self.eye.view))
    }

    /// Looks through the points of a pixel.
    fn parts(&self, aim: &Aim, own: &mut [f32]) -> Vec<Part> {
        let first: Vec<Seen> = (0..4).map(|point| aim.look(self, point)).collect();
        let is_plain = first.iter().all(|seen| alike(seen, &first[0]));
        let rest = if is_plain { 0 } else { POINTS.len() - first.len() };
        let share = 1.0 / (first.len() + rest) as f32;
        let mut parts: Vec<Part> = Vec::new();
        let looks = first.into_iter().chain((4..4 + rest).map(|point| aim.look(self, point)));
        for (point, seen) in looks.enumerate() {
            let fresnel = self.shader.fresnel(&seen) as f32;
            self.add_own(&seen, fresnel, share, spread(2 * point, aim.offset), own);
            add_part(&mut parts, &seen, fresnel, share);
        }
        parts.sort_by(|a, b| b.share.total_cmp(&a.share));
        parts
    }

    /// Adds a share of what a surface glows and of what its clear coat mirrors.
    pub(super) fn add_own(&self, seen: &Seen, fresnel: f32, share: f32, offset: DVec2, own: &mut [f32]) {
        self.shader.add_glow(seen, share, None, (self.colors, &mut *own));
        if is_clear(seen) {
            self.shader.add_mirrored(seen, share * fresnel, offset, (self.colors, own));
        }
    }

    /// Returns the spectra of a row, columns × bands, under the smoothed light.
    fn finished(
        &self,
        row: usize,
        mut drawn: Row,
        guides: &[Vec<Guide>],
        lights: &[Vec<Lights>],
    ) -> Result<Vec<f32>, Cancelled> {
        let (mut fragments, mut pigments) = (drawn.fragments.iter(), drawn.pigments.as_slice());
        for (column, spectrum) in drawn.own.chunks_exact_mut(self.n_bands).enumerate() {
            self.painting.cancel.check()?;
            for fragment in fragments.by_ref().take(drawn.n_fragments[column]) {
                let lights = match &fragment.seen {
                    None => lights[row][column],
                    Some(seen) => light_beside(row, column, fragment.object, guides, lights)
                        .unwrap_or_else(|| self.shader.gather(seen, LightRays::ALL, &pixel_offsets(row, column))),
                };
                let (own, rest) = pigments.split_at(fragment.n_pigments);
                pigments = rest;
                self.shader.add_lit(&lights, own, fragment.sheen, (self.colors, &mut *spectrum));
            }
        }
        self.painting.row_is_done();
        Ok(drawn.own)
    }
}

fn is_clear(seen: &Seen) -> bool {
    seen.surface.coat.f0 > 0.0 && seen.surface.coat.roughness == 0.0
}

/// Adds a share of a pixel that shows a surface to the part of its object.
pub(super) fn add_part(parts: &mut Vec<Part>, seen: &Seen, fresnel: f32, share: f32) {
    let shown = match parts.iter().position(|p| p.seen.object == seen.object) {
        Some(index) => &mut parts[index],
        None => {
            parts.push(Part { seen: *seen, share: 0.0, sheen: 0.0, pigments: Vec::new() });
            parts.last_mut().expect("one has just been added")
        }
    };
    shown.share += share;
    shown.sheen += if is_clear(seen) { 0.0 } else { share };
    let diffuse = if seen.surface.coat.metal.is_some() { 0.0 } else { share * (1.0 - fresnel) };
    for &(pigment, part) in seen.surface.mix.parts() {
        match shown.pigments.iter_mut().find(|(known, _)| *known == pigment) {
            Some((_, sum)) => *sum += diffuse * part,
            None => shown.pigments.push((pigment, diffuse * part)),
        }
    }
}

/// Returns the mean light of the pixels about one that show mostly this object.
fn light_beside(
    row: usize,
    column: usize,
    object: u32,
    guides: &[Vec<Guide>],
    lights: &[Vec<Lights>],
) -> Option<Lights> {
    let (mut sum, mut n) = (Lights::default(), 0.0);
    for r in row.saturating_sub(1)..(row + 2).min(guides.len()) {
        for c in column.saturating_sub(1)..(column + 2).min(guides[r].len()) {
            if guides[r][c].object == object {
                sum.iter_mut().zip(&lights[r][c]).for_each(|(s, l)| *s += l);
                n += 1.0;
            }
        }
    }
    (n > 0.0).then(|| sum.map(|s| s / n))
}

/// Returns the offsets by which the light of a pixel is gathered.
pub(super) fn pixel_offsets(row: usize, column: usize) -> [DVec2; N_OFFSETS] {
    std::array::from_fn(|which| pixel_offset(row, column, which))
}

/// Tells whether two points of a pixel look so alike that more need not be looked at.
pub(super) fn alike(a: &Seen, b: &Seen) -> bool {
    let (main_a, main_b) = (a.surface.mix.parts()[0], b.surface.mix.parts()[0]);
    a.object == b.object
        && a.normal.dot(b.normal) > 0.985
        && main_a.0 == main_b.0
        && (main_a.1 - main_b.1).abs() < 0.12
        && a.surface.mix.parts().len() == b.surface.mix.parts().len()
        && (a.surface.coat.f0 == 0.0 || a.surface.coat.roughness > 0.0 || a.normal.dot(b.normal) > 0.9995)
        && a.surface.glow.map(|(light, _)| light) == b.surface.glow.map(|(light, _)| light)
}

/// A pixel to look through.
pub(super) struct Aim {
    row: f64,
    column: f64,
    /// The thing at its center and where it begins, when what is behind it is wanted.
    without: Option<(usize, f64)>,
    /// The depth at its center.
    pub(super) z_m: f64,
    offset: DVec2,
}

impl Aim {
    pub(super) fn new(painter: &Painter<'_>, row: usize, column: usize) -> Self {
        let mut aim = Self {
            row: row as f64,
            column: column as f64,
            without: None,
            z_m: 0.0,
            offset: pixel_offset(row, column, 6),
        };
        let ray = painter.eye.ray(aim.row, aim.column);
        let mut hit = aim.hit(painter, ray);
        if painter.which == Which::Behind {
            let thing = painter.shader.world.thing_of(hit.object);
            // Behind the walls there is nothing.
            if painter.shader.world.first_hit(ray, hit.t, Some(thing)).is_some() {
                aim.without = Some((thing, hit.t));
                hit = aim.hit(painter, ray);
            }
        }
        aim.z_m = painter.eye.depth_m(hit.point);
        aim
    }

    fn hit(&self, painter: &Painter<'_>, ray: Ray) -> Hit {
        let behind = self.without.and_then(|(thing, t)| painter.shader.world.first_hit(ray, t, Some(thing)));
        let first = || painter.shader.world.first_hit(ray, 0.0, None);
        behind.or_else(first).expect("the room is closed: every ray from inside meets it")
    }

    /// Returns what is seen through one of its points.
    pub(super) fn look(&self, painter: &Painter<'_>, point: usize) -> Seen {
        let (down, right) = Self::point(point);
        let ray = painter.eye.ray(self.row + down, self.column + right);
        painter.seen(&self.hit(painter, ray), ray)
    }

    /// Returns how far a point lies below and right of the center of the pixel.
    pub(super) fn point(point: usize) -> (f64, f64) {
        let (i, j) = POINTS[point];
        let at = |cell: u8, within: u8| (f64::from(cell) + (f64::from(within) + 0.5) / 4.0) / 4.0 - 0.5;
        (at(j, i), at(i, j))
    }
}

/// Returns the size of details that a pixel of a view blurs away at a hit.
pub(super) fn footprint_m(world: &World, hit: &Hit, direction: DVec3, view: View) -> f64 {
    let cosine = world.cosine(hit, direction).max(0.12);
    // The side of a square of the mean of the pixel's width and its length along the slope.
    let width = hit.t / view.focal_px;
    let footprint = 0.5 * (width + width / cosine);
    0.7 * footprint
}
