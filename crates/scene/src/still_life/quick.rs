//! The picture of the still life in a quarter of the time or less, for previews.
//!
//! Pixels share what is seen through their corners, and more points are looked at only where the corners of one are not alike. Light
//! is gathered by a quarter of the rays, smoothed, and taken from between the corners that it was gathered at.

use std::{collections::VecDeque, ops::Range};

use dioptric_spectrum::{Cancelled, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    filter::{BOUNCE, Guide, Lights, PASSES, Passes, Smoothing, light_between},
    noise::pixel_offset,
    pigment::N_TONES,
    render::{Aim, Eye, Layer, Painter, Painting, Part, Which, add_part, lines, pixel_offsets, rows_at_once},
    shade::{Colors, LightRays, Shader},
    world::{Seen, World},
};
use crate::{SceneError, View};

/// How the light is gathered and smoothed.
struct Sampling {
    /// Light is gathered at every so manyth corner, each way.
    pitch: usize,
    rays: LightRays,
    passes: Passes,
}

impl Sampling {
    /// Returns that of a view: all rays at a fourth of the corners, or in a wide view, in which things are small and shadows narrow, a fourth of the rays at
    /// all of them.
    fn of(view: View, columns: usize) -> Self {
        const WIDE_DEG: f64 = 45.0;
        if view.horizontal_fov_deg(columns) > WIDE_DEG {
            Self { pitch: 1, rays: LightRays::FEW, passes: PASSES }
        } else {
            Self { pitch: 2, rays: LightRays::ALL, passes: [(1, 0), (1, 0), (2, BOUNCE)] }
        }
    }
}

/// Points within a pixel that are looked at where its corners are not alike, and what each counts; the corners count the rest.
const N_WITHIN: usize = 4;
const SHARE_WITHIN: f32 = 0.1875;

/// What is seen through a corner of pixels.
struct Look {
    seen: Seen,
    fresnel: f32,
    /// The mean reflectance over each tone.
    tones: [f32; N_TONES],
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
    let painter = QuickPainter { painter: &painter, columns, sampling: Sampling::of(eye.view, columns) };
    let mut planes = vec![Array2::<f32>::zeros((rows, columns)); grid.len()];
    let mut z_m = Array2::zeros((rows, columns));
    let mut finishing = Finishing {
        painter: &painter,
        smoothing: Smoothing::of_rows(rows / painter.sampling.pitch + 1, painter.sampling.passes),
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
        let pitch = self.painter.sampling.pitch;
        // Light is taken from up to two rows of it below.
        let n_smoothed = self.smoothing.n_smoothed();
        let first = self.n_finished;
        let (guides, lights) = self.smoothing.smoothed();
        let is_whole = n_smoothed == guides.len() && first + self.corners.len() == self.lines.len() + 1;
        let end = if is_whole { self.lines.len() } else { pitch * n_smoothed.saturating_sub(2) }.max(first);
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
        self.smoothing.forget_before((end / pitch).saturating_sub(1));
        Ok(())
    }
}

struct QuickPainter<'a> {
    painter: &'a Painter<'a>,
    /// Of pixels.
    columns: usize,
    sampling: Sampling,
}

impl QuickPainter<'_> {
    fn corners(&self, rows: Range<usize>) -> Result<Vec<Corners>, Cancelled> {
        rows.into_par_iter().map(|row| self.corners_of_row(row)).collect()
    }

    /// Looks through the upper corners of a row of pixels.
    fn corners_of_row(&self, row: usize) -> Result<Corners, Cancelled> {
        let Painter { shader, n_bands, painting, .. } = self.painter;
        let Sampling { pitch, rays, .. } = self.sampling;
        let n = self.columns + 1;
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
            if row.is_multiple_of(pitch) && column.is_multiple_of(pitch) {
                corners.guides.push(Guide::of(&seen));
                corners.lights.push(shader.gather(&seen, rays, &pixel_offsets(row, column)));
            }
            corners.looks.push(Look { tones: shader.palette.mean_in_tones(seen.surface.mix.parts()), seen, fresnel });
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
        let pitch = self.sampling.pitch;
        let size = (guides.len(), self.columns / pitch + 1);
        for (column, spectrum) in spectra.chunks_exact_mut(*n_bands).enumerate() {
            painting.cancel.check()?;
            let places = [(0, column), (0, column + 1), (1, column), (1, column + 1)];
            let looks = places.map(|(side, column)| &corners[side].looks[column]);
            let is_plain = looks[1..].iter().all(|look| alike(look, looks[0]));
            let share = if is_plain { 0.25 } else { 0.25 * (1.0 - N_WITHIN as f32 * SHARE_WITHIN) };
            parts.clear();
            for ((side, column), look) in places.into_iter().zip(looks) {
                let own = &corners[side].own[column * n_bands..][..*n_bands];
                spectrum.iter_mut().zip(own).for_each(|(s, own)| *s += share * own);
                add_part(&mut parts, &look.seen, look.fresnel, share);
            }
            for point in 0..if is_plain { 0 } else { N_WITHIN } {
                let (down, right) = Aim::point(point);
                let seen = self.painter.look(row as f64 + down, column as f64 + right);
                let fresnel = shader.fresnel(&seen) as f32;
                self.painter.add_own(&seen, fresnel, SHARE_WITHIN, pixel_offset(row, column, 6), spectrum);
                add_part(&mut parts, &seen, fresnel, SHARE_WITHIN);
            }
            depths[column] = self.depth_m((row, column), looks) as f32;
            let place = [row, column].map(|at| (at as f64 + 0.5) / pitch as f64);
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
    let is_like = |(a, b): (&f32, &f32)| (a - b).abs() < LARGEST_STEP;
    a.seen.object == b.seen.object
        && a.seen.normal.dot(b.seen.normal) > LEAST_COSINE
        && a.tones.iter().zip(&b.tones).all(is_like)
        && a.seen.surface.glow.map(|(light, _)| light) == b.seen.surface.glow.map(|(light, _)| light)
}
