//! The picture of the still life in a quarter of the time or less, for previews.
//!
//! A pixel is looked at through its center, and through more points only where the pixels beside it show something else. Light
//! is gathered by a quarter of the rays, smoothed, and taken from between the pixels that it was gathered at.

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
    /// Light is gathered at every so manyth pixel, each way.
    pitch: usize,
    rays: LightRays,
    passes: Passes,
}

impl Sampling {
    /// Returns that of a view: a fourth of the rays, at a fourth of the pixels, or of a wide view, in which things are small and shadows narrow, at all of
    /// them.
    fn of(view: View, columns: usize) -> Self {
        const WIDE_DEG: f64 = 45.0;
        if view.horizontal_fov_deg(columns) > WIDE_DEG {
            Self { pitch: 1, rays: LightRays::FEW, passes: PASSES }
        } else {
            Self { pitch: 2, rays: LightRays::ALL, passes: [(1, 0), (1, 0), (2, BOUNCE)] }
        }
    }
}

/// Points of a pixel that are looked at beside its center where the pixels beside it are not alike.
const N_MORE: usize = 4;

/// What is seen through the center of a pixel.
struct Look {
    seen: Seen,
    fresnel: f32,
    /// The mean reflectance over each tone.
    tones: [f32; N_TONES],
}

/// What is seen through the centers of a row of pixels.
struct Looks {
    looks: Vec<Look>,
    /// What is mirrored or glows, columns × bands.
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
        smoothing: Smoothing::of_rows(rows.div_ceil(painter.sampling.pitch), painter.sampling.passes),
        looks: VecDeque::new(),
        n_forgotten: 0,
        n_finished: 0,
        lines: lines(&mut planes),
        depths: z_m.as_slice_mut().expect("a new plane is in standard order").chunks_exact_mut(columns).collect(),
    };
    let n_at_once = rows_at_once();
    let after = |row: usize| row..(row + n_at_once).min(rows);
    let mut next = after(0);
    let mut drawn = painter.looks(next.clone())?;
    while !drawn.is_empty() {
        next = after(next.end);
        let (more, finished) = rayon::join(|| painter.looks(next.clone()), || finishing.push(drawn));
        finished?;
        drawn = more?;
    }
    Ok(Layer { radiance: SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?, depth: DepthMap::new(z_m)? })
}

/// What becomes of rows that were looked at.
struct Finishing<'a> {
    painter: &'a QuickPainter<'a>,
    smoothing: Smoothing,
    /// From the row `n_forgotten` on.
    looks: VecDeque<Looks>,
    n_forgotten: usize,
    n_finished: usize,
    /// The rows of the picture, all bands of each.
    lines: Vec<Vec<&'a mut [f32]>>,
    depths: Vec<&'a mut [f32]>,
}

impl Finishing<'_> {
    /// Takes the next rows, and paints all whose light is smoothed.
    fn push(&mut self, mut looks: Vec<Looks>) -> Result<(), Cancelled> {
        let take = |row: &mut Looks| (std::mem::take(&mut row.guides), std::mem::take(&mut row.lights));
        let lit = looks.iter_mut().filter(|row| !row.guides.is_empty());
        self.smoothing.push(lit.map(take), self.painter.painter.painting.cancel)?;
        self.looks.extend(looks);
        let pitch = self.painter.sampling.pitch;
        // Light is taken from up to two rows of it below, and the next row of pixels is compared.
        let n_smoothed = self.smoothing.n_smoothed();
        let first = self.n_finished;
        let (guides, lights) = self.smoothing.smoothed();
        let is_whole = self.n_forgotten + self.looks.len() == self.lines.len() && n_smoothed == guides.len();
        let end = if is_whole { self.lines.len() } else { pitch * n_smoothed.saturating_sub(2) }.max(first);
        let looks = &*self.looks.make_contiguous();
        let n_forgotten = self.n_forgotten;
        let ready = self.lines[first..end].par_iter_mut().zip(&mut self.depths[first..end]).enumerate();
        ready.try_for_each(|(n, (bands, depths))| {
            let index = first + n - n_forgotten;
            let about = [index.checked_sub(1), Some(index), Some(index + 1)].map(|i| i.and_then(|i| looks.get(i)));
            let spectra = self.painter.pixels(first + n, about, (guides, lights), depths)?;
            for (band, samples) in bands.iter_mut().enumerate() {
                let values = spectra[band..].iter().step_by(self.painter.painter.n_bands);
                samples.iter_mut().zip(values).for_each(|(sample, value)| *sample = *value);
            }
            Ok(())
        })?;
        self.n_finished = end;
        // The last of them is compared once more.
        let n_more = end.saturating_sub(1) - self.n_forgotten;
        self.looks.drain(..n_more);
        self.n_forgotten += n_more;
        self.smoothing.forget_before((end / pitch).saturating_sub(1));
        Ok(())
    }
}

struct QuickPainter<'a> {
    painter: &'a Painter<'a>,
    columns: usize,
    sampling: Sampling,
}

impl QuickPainter<'_> {
    fn looks(&self, rows: Range<usize>) -> Result<Vec<Looks>, Cancelled> {
        rows.into_par_iter().map(|row| self.row(row)).collect()
    }

    /// Looks through the centers of a row of pixels.
    fn row(&self, row: usize) -> Result<Looks, Cancelled> {
        let Painter { shader, n_bands, painting, .. } = self.painter;
        let Sampling { pitch, rays, .. } = self.sampling;
        let mut drawn = Looks {
            looks: Vec::with_capacity(self.columns),
            own: vec![0.0; self.columns * n_bands],
            guides: Vec::new(),
            lights: Vec::new(),
        };
        for (column, own) in drawn.own.chunks_exact_mut(*n_bands).enumerate() {
            painting.cancel.check()?;
            let seen = self.painter.look(row as f64, column as f64);
            let fresnel = shader.fresnel(&seen) as f32;
            self.painter.add_own(&seen, fresnel, 1.0, pixel_offset(row, column, 6), own);
            if row.is_multiple_of(pitch) && column.is_multiple_of(pitch) {
                drawn.guides.push(Guide::of(&seen));
                drawn.lights.push(shader.gather(&seen, rays, &pixel_offsets(row, column)));
            }
            drawn.looks.push(Look { tones: shader.palette.mean_in_tones(seen.surface.mix.parts()), seen, fresnel });
        }
        painting.row_is_done();
        Ok(drawn)
    }

    /// Returns the spectra of a row of pixels, columns × bands, and sets the depth at their centers.
    fn pixels(
        &self,
        row: usize,
        [above, here, below]: [Option<&Looks>; 3],
        (guides, lights): (&[Vec<Guide>], &[Vec<Lights>]),
        depths: &mut [f32],
    ) -> Result<Vec<f32>, Cancelled> {
        let Painter { shader, colors, eye, n_bands, painting, .. } = self.painter;
        let here = here.expect("the row was looked at");
        let mut spectra = vec![0.0; self.columns * n_bands];
        let mut parts: Vec<Part> = Vec::new();
        let pitch = self.sampling.pitch;
        let size = (guides.len(), self.columns.div_ceil(pitch));
        for (column, spectrum) in spectra.chunks_exact_mut(*n_bands).enumerate() {
            painting.cancel.check()?;
            let look = &here.looks[column];
            let beside = [
                above.and_then(|looks| looks.looks.get(column)),
                below.and_then(|looks| looks.looks.get(column)),
                column.checked_sub(1).and_then(|column| here.looks.get(column)),
                here.looks.get(column + 1),
            ];
            let is_plain = beside.into_iter().flatten().all(|other| alike(look, other));
            let share = if is_plain { 1.0 } else { 1.0 / (1 + N_MORE) as f32 };
            parts.clear();
            add_part(&mut parts, &look.seen, look.fresnel, share);
            let own = &here.own[column * n_bands..][..*n_bands];
            spectrum.iter_mut().zip(own).for_each(|(s, own)| *s += share * own);
            if !is_plain {
                for point in 0..N_MORE {
                    let (down, right) = Aim::point(point);
                    let seen = self.painter.look(row as f64 + down, column as f64 + right);
                    let fresnel = shader.fresnel(&seen) as f32;
                    self.painter.add_own(&seen, fresnel, share, pixel_offset(row, column, 6), spectrum);
                    add_part(&mut parts, &seen, fresnel, share);
                }
            }
            depths[column] = eye.depth_m(look.seen.point) as f32;
            let place = (row as f64 / pitch as f64, column as f64 / pitch as f64);
            for part in &parts {
                let pixel = |r: usize, c: usize| (&guides[r][c], &lights[r][c]);
                let lights = light_between(&Guide::of(&part.seen), place, size, f64::INFINITY, pixel)
                    .unwrap_or_else(|| shader.gather(&part.seen, LightRays::ALL, &pixel_offsets(row, column)));
                shader.add_lit(&lights, &part.pigments, part.sheen, (*colors, &mut *spectrum));
            }
        }
        painting.row_is_done();
        Ok(spectra)
    }
}

/// Tells whether two pixels look so alike that nothing need be looked at between them.
fn alike(a: &Look, b: &Look) -> bool {
    const LEAST_COSINE: f64 = 0.97;
    const LARGEST_STEP: f32 = 0.12;
    let is_like = |(a, b): (&f32, &f32)| (a - b).abs() < LARGEST_STEP;
    a.seen.object == b.seen.object
        && a.seen.normal.dot(b.seen.normal) > LEAST_COSINE
        && a.tones.iter().zip(&b.tones).all(is_like)
        && a.seen.surface.glow.map(|(light, _)| light) == b.seen.surface.glow.map(|(light, _)| light)
}
