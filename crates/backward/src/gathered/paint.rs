//! The picture of a gathered view: rows of corners looked through, lit and smoothed, and pixels between them.

use std::{
    collections::VecDeque,
    f32::consts::FRAC_1_PI,
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering},
};

use dioptric_spectrum::{Cancel, Cancelled};
use dioptric_world::{Ray, World, glam::DVec3};
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    ViewDetail,
    light::{Gatherer, LightRays},
    look::{Look, depth_m},
    smooth::{Guide, Lanes, Passes, Smoothing, alike},
};
use crate::{Pinhole, Sampler, integrator::Integrator, peeling::Surfaces};

/// The numbers of the lattices.
const DIRECT: usize = 0;
const GLOSS: usize = 1;
const BOUNCED: usize = 2;

/// Light on the lattices.
type Lights<const N: usize> = [Smoothing<N>; 3];

/// The rays of a sample whose neighbors are alike: most of the noise that is left is that of light which has bounced.
const RAYS: LightRays = LightRays { n_lights: 1, n_bounces: 2, n_gloss: 1 };

/// What a detail means.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// Light straight from its sources, light that gloss and mirrors send on and light that has bounced are gathered at every so manyth
    /// corner each way, and smoothed by passes of these steps.
    lattices: [(usize, Passes); 3],
    /// Points looked at within a pixel by what its corners show: the same, much the same, one surface that varies, or an outline; their
    /// number, and what each counts.
    within: [(usize, f32); 4],
}

impl ViewDetail {
    fn effort(self) -> Effort {
        match self {
            Self::Fine => Effort {
                lattices: [
                    (1, Passes { steps: &[1, 2, 4, 8], keeps_edges_from: 4 }),
                    (1, Passes { steps: &[1, 2, 4, 8], keeps_edges_from: 8 }),
                    (2, Passes { steps: &[1, 2, 4, 8, 16], keeps_edges_from: 8 }),
                ],
                within: [(0, 0.0), (2, 0.3), (12, 0.0734), (12, 0.0734)],
            },
            Self::Quick => Effort {
                lattices: [
                    (2, Passes { steps: &[1, 2, 4], keeps_edges_from: 4 }),
                    (2, Passes::by_surface(&[1, 2, 4])),
                    (2, Passes::by_surface(&[1, 2, 4, 8])),
                ],
                within: [(0, 0.0), (0, 0.0), (2, 0.34), (4, 0.1875)],
            },
        }
    }
}

/// Points of a pixel, below and right of its center: of all the first two, four or more are spread evenly.
const POINTS: [(f64, f64); 12] = [
    (-0.22, -0.22),
    (0.22, 0.22),
    (-0.34, 0.28),
    (0.34, -0.28),
    (-0.06, -0.42),
    (0.06, 0.42),
    (-0.45, 0.02),
    (0.45, -0.02),
    (-0.12, 0.10),
    (0.12, -0.10),
    (-0.38, -0.36),
    (0.38, 0.36),
];

/// What is seen through the upper corners of a row of pixels.
struct Corners<const N: usize> {
    looks: Vec<Look<N>>,
    /// Where light is gathered in this row, and that light.
    lights: [(Vec<Guide>, Vec<Lanes<N>>); 3],
}

/// A part of a pixel that shows one surface.
struct Part<'a, const N: usize> {
    look: &'a Look<N>,
    reflectance: [f32; N],
    share: f32,
}

/// Paints at so many wavelengths at once.
pub(super) struct Painter<'a, const N: usize> {
    gatherer: Gatherer<'a, N>,
    view: &'a Pinhole,
    place: (DVec3, DVec3),
    /// The distance between pixels as a tangent.
    pitch: f64,
    size: (usize, usize),
    n_bands: usize,
    effort: Effort,
    /// The mean radiance of the view, roughly.
    bright: f32,
    n_done: AtomicUsize,
    progress: &'a (dyn Fn(f64) + Sync),
    cancel: &'a Cancel,
}

/// Steps of reflectance between corners of a pixel: finer textures than its own would show as waves where they were left out.
const SAME: f32 = 0.004;
const MUCH_THE_SAME: f32 = 0.12;
/// Looks within a pixel stand closer than its corners: patterns are blurred by this part of what is blurred there.
const WITHIN: f64 = 0.5;
/// Places each way that the mean radiance is measured at.
const METER: u32 = 16;
/// How much brighter than the mean what one path finds may be.
const MOST_PATH: f32 = 25.0;

/// Bands by planes, and depths.
type Painting = (Vec<Array2<f32>>, Array2<f32>);

impl<'a, const N: usize> Painter<'a, N> {
    /// Returns the planes of some bands, N at most, and the depths.
    pub(super) fn paint(
        world: &'a World,
        view: &'a Pinhole,
        bands_nm: &[f64],
        (detail, seed): (ViewDetail, u64),
        (progress, cancel): (&'a (dyn Fn(f64) + Sync), &'a Cancel),
    ) -> Result<Painting, Cancelled> {
        let wavelengths_nm: [f32; N] = std::array::from_fn(|lane| bands_nm[lane.min(bands_nm.len() - 1)] as f32);
        let gatherer = Gatherer { world, wavelengths_nm: &wavelengths_nm, seed, most: f32::INFINITY };
        let place = view.placement.world_from_camera;
        let mut painter = Painter {
            gatherer,
            view,
            place: (place.translation, place.transform_vector3(DVec3::Z).normalize()),
            pitch: 2.0 * view.half_tangents.x / view.pixels.columns as f64,
            size: view.pixels.size(),
            n_bands: bands_nm.len(),
            effort: detail.effort(),
            bright: 0.0,
            n_done: AtomicUsize::new(0),
            progress,
            cancel,
        };
        painter.bright = painter.mean_radiance();
        painter.gatherer.most = if painter.bright > 0.0 { MOST_PATH * painter.bright } else { f32::INFINITY };
        painter.picture()
    }

    /// Returns the mean of the view's radiance over few places, by paths.
    fn mean_radiance(&self) -> f32 {
        let value = |place: u32| {
            let share = [place % METER, place / METER].map(|i| (f64::from(i) + 0.5) / f64::from(METER));
            let ray = self.behind(self.view.ray_at(share))?;
            let integrator = Integrator { clamp: None, ..self.gatherer.integrator() };
            let random = Sampler::new(self.gatherer.seed, place, 1, 0);
            let radiance = integrator.radiance(ray, self.gatherer.wavelengths_nm, &random);
            let mean = radiance.iter().sum::<f32>() / N as f32;
            mean.is_finite().then_some(mean)
        };
        let mut values: Vec<f32> = (0..METER * METER).filter_map(value).collect();
        // What shines by itself is left out: the brightest tenth.
        values.sort_by(f32::total_cmp);
        values.truncate(values.len() - values.len() / 10);
        values.iter().sum::<f32>() / values.len().max(1) as f32
    }

    /// Returns the ray behind the surfaces that are looked through; none where there are not so many.
    fn behind(&self, ray: Ray) -> Option<Ray> {
        match self.view.layer {
            0 => Some(ray),
            n => Surfaces::along(self.gatherer.world, ray).ray_behind(n),
        }
    }

    /// Looks at a place of the picture, counted in pixels from the middle of the first; patterns are blurred by a part of a pixel.
    fn look(&self, (row, column): (f64, f64), blur: f64) -> Look<N> {
        let [x, y, ..] = self.view.pixels.crop;
        let share = [
            (x as f64 + column + 0.5) / self.view.pixels.columns as f64,
            (y as f64 + row + 0.5) / self.view.pixels.rows as f64,
        ];
        let seen = self.behind(self.view.ray_at(share)).map(|ray| self.gatherer.look(ray, (blur * self.pitch) as f32));
        Look { seen_at: (row, column), ..seen.unwrap_or_else(Look::nothing) }
    }

    fn picture(&self) -> Result<Painting, Cancelled> {
        let (rows, columns) = self.size;
        let mut planes = vec![Array2::<f32>::zeros((rows, columns)); self.n_bands];
        let mut z_m = Array2::zeros((rows, columns));
        let mut finishing = Finishing {
            painter: self,
            lights: self.effort.lattices.map(|(pitch, passes)| Smoothing::of_rows(rows / pitch + 1, passes)),
            corners: VecDeque::new(),
            n_finished: 0,
            lines: lines(&mut planes, columns),
            depths: z_m.as_slice_mut().expect("a new plane is in standard order").chunks_exact_mut(columns).collect(),
        };
        // Enough for no thread to wait for long.
        let n_at_once = 16.max(8 * rayon::current_num_threads());
        let after = |row: usize| row..(row + n_at_once).min(rows + 1);
        let mut next = after(0);
        let mut drawn = self.corners(next.clone())?;
        while !drawn.is_empty() {
            next = after(next.end);
            // The next rows are drawn while the last ones are finished.
            let (more, finished) = rayon::join(|| self.corners(next.clone()), || finishing.push(drawn));
            finished?;
            drawn = more?;
        }
        drop(finishing);
        Ok((planes, z_m))
    }

    fn corners(&self, rows: Range<usize>) -> Result<Vec<Corners<N>>, Cancelled> {
        rows.into_par_iter().map(|row| self.corners_of_row(row)).collect()
    }

    /// Looks through the upper corners of a row of pixels, and gathers light there.
    fn corners_of_row(&self, row: usize) -> Result<Corners<N>, Cancelled> {
        let n = self.size.1 + 1;
        let lattices = self.effort.lattices;
        let mut corners =
            Corners { looks: Vec::with_capacity(n), lights: std::array::from_fn(|_| (Vec::new(), Vec::new())) };
        for ((guides, lights), (pitch, _)) in corners.lights.iter_mut().zip(lattices) {
            if row.is_multiple_of(pitch) {
                guides.reserve_exact(n.div_ceil(pitch));
                lights.reserve_exact(n.div_ceil(pitch));
            }
        }
        let mut surfaces = Vec::with_capacity(n);
        for column in 0..n {
            self.cancel.check()?;
            let mut look = self.look((row as f64 - 0.5, column as f64 - 0.5), 1.0);
            surfaces.push(look.surface.take());
            corners.looks.push(look);
        }
        let looks = &corners.looks;
        for (column, surface) in surfaces.iter().enumerate() {
            self.cancel.check()?;
            let look = &looks[column];
            let mut direct = None;
            for (lattice, (pitch, passes)) in lattices.into_iter().enumerate() {
                if !(row.is_multiple_of(pitch) && column.is_multiple_of(pitch)) {
                    continue;
                }
                let at = (row / pitch, column / pitch);
                let is_lit = if lattice == GLOSS { look.has_gloss } else { look.is_lit };
                let light = surface.as_ref().filter(|_| is_lit).map(|surface| {
                    let beside = |n: usize| looks.get(n * pitch).map(|look| &look.guide);
                    let rays = RAYS.where_alike(alike(&look.guide, at.1, passes.steps, beside));
                    match lattice {
                        BOUNCED => self.gatherer.bounced(surface, at, rays),
                        _ => {
                            let direct = direct.get_or_insert_with(|| self.gatherer.direct(surface, at, rays));
                            if lattice == DIRECT {
                                direct.irradiance
                            } else {
                                self.gatherer.sent_on(surface, &direct.gloss, at, rays)
                            }
                        }
                    }
                });
                let (guides, lights) = &mut corners.lights[lattice];
                guides.push(if is_lit { look.guide } else { Guide::NOTHING });
                lights.push(Lanes(light.unwrap_or([0.0; N])));
            }
        }
        // The last corners end a row of pixels and begin none.
        if row > 0 {
            self.row_is_done();
        }
        Ok(corners)
    }

    fn row_is_done(&self) {
        let n_done = 1 + self.n_done.fetch_add(1, Ordering::Relaxed);
        (self.progress)(n_done as f64 / (2 * self.size.0) as f64);
    }

    /// Returns the spectra of a row of pixels, columns × bands, and sets the depth at their centers.
    fn pixels(
        &self,
        row: usize,
        corners: [&Corners<N>; 2],
        lights: &Lights<N>,
        depths: &mut [f32],
    ) -> Result<Vec<[f32; N]>, Cancelled> {
        let mut spectra = Vec::with_capacity(self.size.1);
        for (column, depth) in depths.iter_mut().enumerate() {
            self.cancel.check()?;
            let places = [(0, column), (0, column + 1), (1, column), (1, column + 1)];
            let looks = places.map(|(side, column)| &corners[side].looks[column]);
            let [first, rest @ ..] = looks;
            let are_within = |step: f32| rest.iter().all(|look| look.is_like(first, step, self.bright));
            let differs = match rest.iter().all(|look| look.guide.key == first.guide.key) {
                true if are_within(SAME) => 0,
                true if are_within(MUCH_THE_SAME) => 1,
                true => 2,
                false => 3,
            };
            let (n_within, share) = self.effort.within[differs];
            let within: Vec<Look<N>> = POINTS[..n_within]
                .iter()
                .map(|(down, right)| self.look((row as f64 + down, column as f64 + right), WITHIN))
                .collect();
            let of_corner = 0.25 * (1.0 - n_within as f32 * share);
            let all = looks.into_iter().map(|look| (look, of_corner)).chain(within.iter().map(|look| (look, share)));
            spectra.push(self.pixel((row, column), all, lights));
            *depth = self.depth_at((row, column), looks) as f32;
        }
        self.row_is_done();
        Ok(spectra)
    }

    /// Returns the spectrum of a pixel from what is seen through it, with what each look counts.
    fn pixel<'b>(
        &self,
        (row, column): (usize, usize),
        looks: impl Iterator<Item = (&'b Look<N>, f32)>,
        lights: &Lights<N>,
    ) -> [f32; N] {
        let mut spectrum = [0.0; N];
        let mut parts: Vec<Part<'b, N>> = Vec::with_capacity(4);
        for (look, share) in looks {
            if let Some(own) = &look.own {
                (0..N).for_each(|lane| spectrum[lane] += share * own[lane]);
            }
            if !look.is_lit {
                continue;
            }
            let index = parts.iter().position(|part| part.look.guide.key == look.guide.key).unwrap_or_else(|| {
                parts.push(Part { look, reflectance: [0.0; N], share: 0.0 });
                parts.len() - 1
            });
            let part = &mut parts[index];
            (0..N).for_each(|lane| part.reflectance[lane] += share * look.reflectance[lane]);
            part.share += if look.has_gloss { share } else { 0.0 };
        }
        for Part { look, reflectance, share } in parts {
            let between = |lattice: usize| {
                let pitch = self.effort.lattices[lattice].0 as f64;
                let place = ((row as f64 + 0.5) / pitch, (column as f64 + 0.5) / pitch);
                lights[lattice].between(&look.guide, place).map(|light| light.0)
            };
            let mut found =
                [between(DIRECT), if share > 0.0 { between(GLOSS) } else { Some([0.0; N]) }, between(BOUNCED)];
            if found.iter().any(Option::is_none) {
                // Too small to have been met by enough samples: its light is gathered for this pixel alone.
                let again = self.look(look.seen_at, WITHIN);
                if let Some(surface) = again.surface.as_deref() {
                    let (at, rays) = ((row, column), RAYS.where_alike(0.0));
                    let direct = self.gatherer.direct(surface, at, rays);
                    found[DIRECT].get_or_insert(direct.irradiance);
                    found[GLOSS].get_or_insert_with(|| self.gatherer.sent_on(surface, &direct.gloss, at, rays));
                    found[BOUNCED].get_or_insert_with(|| self.gatherer.bounced(surface, at, rays));
                }
            }
            let [direct, gloss, bounced] = found.map(|light| light.unwrap_or([0.0; N]));
            for lane in 0..N {
                let irradiance = direct[lane] + bounced[lane];
                spectrum[lane] += FRAC_1_PI * reflectance[lane] * irradiance + share * gloss[lane];
            }
        }
        spectrum
    }

    /// Returns the depth at the center of a pixel with these corners, m.
    fn depth_at(&self, (row, column): (usize, usize), corners: [&Look<N>; 4]) -> f64 {
        let planar = || {
            let first = corners[0].first?;
            let mut inverse = 0.0;
            for look in corners {
                let other = look.first?;
                let scale = first.point.abs().max_element().max(1e-3);
                let off = (other.point - first.point).dot(first.normal).abs();
                if other.key != first.key || other.normal.dot(first.normal) < 1.0 - 1e-6 || off > 1e-6 * scale {
                    return None;
                }
                inverse += 1.0 / depth_m(other.point, self.place);
            }
            // Of a plane 1 / depth is even over the picture.
            Some(4.0 / inverse)
        };
        // What is hidden can have another before it between its corners.
        planar().filter(|_| self.view.layer == 0).unwrap_or_else(|| {
            let pixel = row * self.size.1 + column;
            let hit = self
                .behind(self.view.ray(pixel, [0.5; 2]))
                .and_then(|ray| self.gatherer.world.intersect(&ray, f32::INFINITY));
            hit.map_or(f64::INFINITY, |hit| depth_m(hit.point, self.place))
        })
    }
}

/// Returns the rows of bands, those of all bands together.
fn lines(planes: &mut [Array2<f32>], columns: usize) -> Vec<Vec<&mut [f32]>> {
    let rows = planes.first().map_or(0, Array2::nrows);
    let mut lines: Vec<Vec<&mut [f32]>> = (0..rows).map(|_| Vec::with_capacity(planes.len())).collect();
    for plane in planes {
        let samples = plane.as_slice_mut().expect("a new plane is in standard order");
        samples.chunks_exact_mut(columns).zip(&mut lines).for_each(|(line, bands)| bands.push(line));
    }
    lines
}

/// What becomes of corners that were looked through.
struct Finishing<'a, const N: usize> {
    painter: &'a Painter<'a, N>,
    lights: Lights<N>,
    /// Those of the rows of pixels from `n_finished` on.
    corners: VecDeque<Corners<N>>,
    n_finished: usize,
    /// The rows of the picture, all bands of each.
    lines: Vec<Vec<&'a mut [f32]>>,
    depths: Vec<&'a mut [f32]>,
}

impl<const N: usize> Finishing<'_, N> {
    /// Takes the next rows of corners, and paints all pixels whose light is smoothed.
    fn push(&mut self, mut corners: Vec<Corners<N>>) -> Result<(), Cancelled> {
        let cancel = self.painter.cancel;
        for (lattice, smoothing) in self.lights.iter_mut().enumerate() {
            let rows = corners.iter_mut().map(|row| std::mem::take(&mut row.lights[lattice]));
            smoothing.push(rows.filter(|(guides, _)| !guides.is_empty()), cancel)?;
        }
        self.corners.extend(corners);
        // Light is taken from up to two rows of it below.
        let first = self.n_finished;
        let has_all = first + self.corners.len() == self.lines.len() + 1;
        let pitches = self.painter.effort.lattices.map(|(pitch, _)| pitch);
        let end = if has_all && self.lights.iter().all(Smoothing::is_whole) {
            self.lines.len()
        } else {
            let reached = |(light, pitch): (&Smoothing<N>, usize)| pitch * light.n_smoothed().saturating_sub(2);
            self.lights.iter().zip(pitches).map(reached).fold(usize::MAX, usize::min).max(first)
        };
        let corners = self.corners.make_contiguous();
        let lights = &self.lights;
        let ready = self.lines[first..end].par_iter_mut().zip(&mut self.depths[first..end]).enumerate();
        ready.try_for_each(|(n, (bands, depths))| {
            let spectra = self.painter.pixels(first + n, [&corners[n], &corners[n + 1]], lights, depths)?;
            for (band, samples) in bands.iter_mut().enumerate() {
                samples.iter_mut().zip(&spectra).for_each(|(sample, spectrum)| *sample = spectrum[band]);
            }
            Ok(())
        })?;
        self.corners.drain(..end - first);
        self.n_finished = end;
        for (smoothing, pitch) in self.lights.iter_mut().zip(pitches) {
            smoothing.forget_before((end / pitch).saturating_sub(1));
        }
        Ok(())
    }
}
