//! The picture of the still life in a quarter of the time or less, for previews.
//!
//! Pixels share what is seen through their corners, and more points are looked at only where the corners of one are not alike. Light
//! is gathered at a quarter of the corners, smoothed, and taken from between them.

use std::{collections::VecDeque, ops::Range};

use dioptric_spectrum::{Cancelled, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    filter::{BOUNCE, Guide, Lights, Passes, Smoothing, light_between},
    material::Light,
    noise::pixel_offset,
    pigment::N_TONES,
    render::{Aim, Eye, Layer, Painter, Painting, Part, Which, add_part, lines, pixel_offsets, rows_at_once},
    shade::{Colors, LightRays, Shader, Spectra},
    world::{Seen, World},
};
use crate::SceneError;

/// Light is gathered at every so manyth corner, each way, and smoothed by these passes: bounced light over what it takes for a few rays to be many.
const PITCH: usize = 2;
const PASSES: Passes = [(1, 0), (2, BOUNCE), (4, BOUNCE)];

/// Points within a pixel that are looked at, below and right of its center, and what each counts; the corners count the rest.
struct Within {
    points: &'static [(f64, f64)],
    share: f32,
}

impl Within {
    /// Where all corners are alike.
    const NOTHING: Self = Self { points: &[], share: 0.0 };
    /// Where corners show one object, which has a pattern or is curved.
    const ONE_OBJECT: Self = Self { points: &[(-0.22, -0.22), (0.22, 0.22)], share: 0.34 };
    /// Where an outline passes.
    const OUTLINE: Self = Self { points: &[(-0.22, -0.41), (0.34, -0.03), (-0.34, 0.03), (0.22, 0.41)], share: 0.1875 };

    fn of(corners: [&Look; 4]) -> Self {
        let [first, rest @ ..] = corners;
        if rest.iter().all(|look| alike(look, first)) {
            Self::NOTHING
        } else if rest.iter().all(|look| look.seen.object == first.seen.object) {
            Self::ONE_OBJECT
        } else {
            Self::OUTLINE
        }
    }

    /// What each corner counts.
    fn share_of_corner(&self) -> f32 {
        0.25 * (1.0 - self.points.len() as f32 * self.share)
    }
}

/// What is seen through a corner of pixels.
struct Look {
    seen: Seen,
    fresnel: f32,
    /// The mean reflectance over each tone.
    tones: [f32; N_TONES],
    /// The light by which white would send what it mirrors or glows, lx.
    own_lux: f32,
}

/// What is seen through the upper corners of a row of pixels.
struct Corners {
    looks: Vec<Look>,
    /// What is mirrored or glows, corners × bands.
    own: Vec<f32>,
    /// The surfaces on which light is gathered here, and that light.
    guides: Vec<Guide>,
    lights: Vec<Lights>,
}

/// Returns the picture of a world as it is seen first, painted quickly.
pub(super) fn quick_picture(
    world: &World,
    eye: &Eye,
    (rows, columns): (usize, usize),
    grid: &WavelengthGrid,
    painting: &Painting<'_>,
) -> Result<Layer, SceneError> {
    let colors = Colors::on(grid);
    let shader = Shader::new(world, eye.origin, &colors);
    let painter = Painter { shader, colors: &colors, eye, n_bands: grid.len(), which: Which::First, painting };
    let painter = QuickPainter { painter: &painter, columns };
    let mut planes = vec![Array2::<f32>::zeros((rows, columns)); grid.len()];
    let mut z_m = Array2::zeros((rows, columns));
    let mut finishing = Finishing {
        painter: &painter,
        smoothing: Smoothing::of_rows(rows / PITCH + 1, PASSES),
        corners: VecDeque::new(),
        n_finished: 0,
        lines: lines(&mut planes),
        depths: z_m.as_slice_mut().expect("a new plane is in standard order").chunks_exact_mut(columns).collect(),
    };
    let n_at_once = rows_at_once();
    let after = |row: usize| row..(row + n_at_once).min(rows + 1);
    let mut next = after(0);
    let mut drawn = painter.corners(next.clone())?;
    while !drawn.is_empty() {
        next = after(next.end);
        let (more, finished) = rayon::join(|| painter.corners(next.clone()), || finishing.push(drawn));
        finished?;
        drawn = more?;
    }
    Ok(Layer { radiance: SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?, depth: DepthMap::new(z_m)? })
}

/// What becomes of corners that were looked through.
struct Finishing<'a> {
    painter: &'a QuickPainter<'a>,
    smoothing: Smoothing,
    /// Those of the rows of pixels from `n_finished` on.
    corners: VecDeque<Corners>,
    n_finished: usize,
    /// The rows of the picture, all bands of each.
    lines: Vec<Vec<&'a mut [f32]>>,
    depths: Vec<&'a mut [f32]>,
}

impl Finishing<'_> {
    /// Takes the next rows of corners, and paints all pixels whose light is smoothed.
    fn push(&mut self, mut corners: Vec<Corners>) -> Result<(), Cancelled> {
        let take = |row: &mut Corners| (std::mem::take(&mut row.guides), std::mem::take(&mut row.lights));
        let lit = corners.iter_mut().filter(|row| !row.guides.is_empty());
        self.smoothing.push(lit.map(take), self.painter.painter.painting.cancel)?;
        self.corners.extend(corners);
        // Light is taken from up to two rows of it below.
        let n_smoothed = self.smoothing.n_smoothed();
        let first = self.n_finished;
        let (guides, lights) = self.smoothing.smoothed();
        let is_whole = n_smoothed == guides.len() && first + self.corners.len() == self.lines.len() + 1;
        let end = if is_whole { self.lines.len() } else { PITCH * n_smoothed.saturating_sub(2) }.max(first);
        let corners = self.corners.make_contiguous();
        let ready = self.lines[first..end].par_iter_mut().zip(&mut self.depths[first..end]).enumerate();
        ready.try_for_each(|(n, (bands, depths))| {
            let spectra = self.painter.pixels(first + n, [&corners[n], &corners[n + 1]], (guides, lights), depths)?;
            for (band, samples) in bands.iter_mut().enumerate() {
                let values = spectra[band..].iter().step_by(self.painter.painter.n_bands);
                samples.iter_mut().zip(values).for_each(|(sample, value)| *sample = *value);
            }
            Ok(())
        })?;
        self.corners.drain(..end - first);
        self.n_finished = end;
        self.smoothing.forget_before((end / PITCH).saturating_sub(1));
        Ok(())
    }
}

struct QuickPainter<'a> {
    painter: &'a Painter<'a>,
    /// Of pixels.
    columns: usize,
}

impl QuickPainter<'_> {
    fn corners(&self, rows: Range<usize>) -> Result<Vec<Corners>, Cancelled> {
        rows.into_par_iter().map(|row| self.corners_of_row(row)).collect()
    }

    /// Looks through the upper corners of a row of pixels.
    fn corners_of_row(&self, row: usize) -> Result<Corners, Cancelled> {
        let Painter { shader, n_bands, painting, .. } = self.painter;
        let n = self.columns + 1;
        let whites: Vec<f32> = (0..*n_bands).map(|band| self.painter.colors.white(Light::Day, band)).collect();
        let mut corners = Corners {
            looks: Vec::with_capacity(n),
            own: vec![0.0; n * n_bands],
            guides: Vec::new(),
            lights: Vec::new(),
        };
        for (column, own) in corners.own.chunks_exact_mut(*n_bands).enumerate() {
            painting.cancel.check()?;
            let seen = self.painter.look(row as f64 - 0.5, column as f64 - 0.5);
            let fresnel = shader.fresnel(&seen) as f32;
            self.painter.add_own(&seen, fresnel, 1.0, pixel_offset(row, column, 6), own);
            if row.is_multiple_of(PITCH) && column.is_multiple_of(PITCH) {
                corners.guides.push(Guide::of(&seen));
                let offsets = pixel_offsets(row / PITCH, column / PITCH);
                corners.lights.push(shader.gather(&seen, LightRays::FEW, &offsets));
            }
            corners.looks.push(Look {
                tones: shader.palette.mean_in_tones(seen.surface.mix.parts()),
                own_lux: own.iter().zip(&whites).map(|(own, white)| own / white).sum::<f32>() / *n_bands as f32,
                seen,
                fresnel,
            });
        }
        // The last corners end a row of pixels and begin none.
        if row > 0 {
            painting.row_is_done();
        }
        Ok(corners)
    }

    /// Returns the spectra of a row of pixels, columns × bands, and sets the depth at their centers.
    fn pixels(
        &self,
        row: usize,
        corners: [&Corners; 2],
        (guides, lights): (&[Vec<Guide>], &[Vec<Lights>]),
        depths: &mut [f32],
    ) -> Result<Vec<f32>, Cancelled> {
        let Painter { shader, colors, n_bands, painting, .. } = self.painter;
        let mut spectra = vec![0.0; self.columns * n_bands];
        let mut parts: Vec<Part> = Vec::new();
        let size = (guides.len(), self.columns / PITCH + 1);
        for (column, spectrum) in spectra.chunks_exact_mut(*n_bands).enumerate() {
            painting.cancel.check()?;
            let places = [(0, column), (0, column + 1), (1, column), (1, column + 1)];
            let looks = places.map(|(side, column)| &corners[side].looks[column]);
            let within = Within::of(looks);
            let share = within.share_of_corner();
            parts.clear();
            for ((side, column), look) in places.into_iter().zip(looks) {
                let own = &corners[side].own[column * n_bands..][..*n_bands];
                spectrum.iter_mut().zip(own).for_each(|(s, own)| *s += share * own);
                add_part(&mut parts, &look.seen, look.fresnel, share);
            }
            for (down, right) in within.points {
                let seen = self.painter.look(row as f64 + down, column as f64 + right);
                let fresnel = shader.fresnel(&seen) as f32;
                self.painter.add_own(&seen, fresnel, within.share, pixel_offset(row, column, 6), spectrum);
                add_part(&mut parts, &seen, fresnel, within.share);
            }
            depths[column] = self.depth_m((row, column), looks) as f32;
            let place = [row, column].map(|at| (at as f64 + 0.5) / PITCH as f64);
            for part in &parts {
                let pixel = |r: usize, c: usize| (&guides[r][c], &lights[r][c]);
                let lights = light_between(&Guide::of(&part.seen), place.into(), size, f64::INFINITY, pixel)
                    .unwrap_or_else(|| shader.gather(&part.seen, LightRays::ALL, &pixel_offsets(row, column)));
                shader.add_lit(&lights, &part.pigments, part.sheen, (*colors, &mut *spectrum));
            }
        }
        painting.row_is_done();
        Ok(spectra)
    }

    /// Returns the depth at the center of a pixel with these corners.
    fn depth_m(&self, (row, column): (usize, usize), corners: [&Look; 4]) -> f64 {
        let first = &corners[0].seen;
        let is_beside = |look: &Look| {
            look.seen.object == first.object
                && look.seen.flat_normal.dot(first.flat_normal) > 1.0 - 1e-9
                && (look.seen.point - first.point).dot(first.flat_normal).abs() < 1e-7
        };
        let eye = self.painter.eye;
        if corners[1..].iter().all(|look| is_beside(look)) {
            // Of a plane 1 / depth is even over the picture.
            4.0 / corners.iter().map(|look| 1.0 / eye.depth_m(look.seen.point)).sum::<f64>()
        } else {
            Aim::new(self.painter, row, column).z_m
        }
    }
}

/// Tells whether two corners look so alike that nothing need be looked at between them.
fn alike(a: &Look, b: &Look) -> bool {
    const LEAST_COSINE: f64 = 0.97;
    const LARGEST_STEP: f32 = 0.12;
    /// A tenth of the light on the table.
    const LARGEST_STEP_LUX: f32 = 60.0;
    let is_like = |(a, b): (&f32, &f32)| (a - b).abs() < LARGEST_STEP;
    a.seen.object == b.seen.object
        && a.seen.normal.dot(b.seen.normal) > LEAST_COSINE
        && a.tones.iter().zip(&b.tones).all(is_like)
        && (a.own_lux - b.own_lux).abs() < LARGEST_STEP_LUX
        && a.seen.surface.glow.map(|(light, _)| light) == b.seen.surface.glow.map(|(light, _)| light)
}
