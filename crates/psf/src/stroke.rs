//! Gaussians that are narrow on pixels: strokes.
//!
//! Along the pixel axis in which it is wider, a stroke is sampled at every pixel, or a few times a pixel where it is
//! short or steep; there its values are products, as down the columns of a broad Gaussian. Across, what each of eight
//! pixels holds of it is read from a table of integrals: no sample is finer than a pixel, and what is spread evenly
//! over some width, as the light of a cell is, needs no more than what is not.

use dioptric_diffraction::Covariance;
use glam::DVec2;

use crate::{
    power::{Powers, exp2},
    profile::{LANES, PLACE_BITS, Profile, ROW_BITS, profile_number},
    splat::Splat,
};

/// The finest subdivision of a pixel along a stroke. What is shorter than its samples allow is lengthened to
/// 0.12 pixels, which on pixels makes next to no difference.
const FINEST: i32 = 5;
/// A stroke has this many samples a standard deviation of its length, or more.
const SAMPLES_PER_SIGMA: f64 = 0.6;
/// From one sample to the next a stroke moves across by its width over this, or less.
const SAMPLES_PER_WIDTH: f64 = 0.4;
/// How many standard deviations of its length are drawn; what lies beyond, 3·10⁻⁴, is spread over the rest.
const REACH: f64 = 3.6;
/// What is held within the reach.
const INSIDE: f64 = 0.999_681_782_819_684_9;
/// Places further than this from the picture, in pixels, are not seen.
const FAR: f64 = 1e4;
/// Samples between two computations of the exponential: products carry its error, which grows to 5·10⁻⁵.
const MOST_SAMPLES: i32 = 32;
/// The largest even width, in sixteenths of a pixel.
const WIDEST: f64 = 80.0;

/// Lines of pixels in single precision, each longer at both ends so that eight pixels may run over the edge.
pub(crate) struct Lines {
    pub(crate) n_lines: usize,
    pub(crate) n_pixels: usize,
    pub(crate) stride: usize,
    pub(crate) sums: Vec<f32>,
}

impl Lines {
    pub(crate) fn new(n_lines: usize, n_pixels: usize) -> Self {
        let stride = n_pixels + 2 * LANES;
        Self { n_lines, n_pixels, stride, sums: vec![0.0; n_lines * stride] }
    }

    /// Returns the pixels of a line.
    pub(crate) fn line(&self, line: usize) -> &[f32] {
        &self.sums[line * self.stride + LANES..][..self.n_pixels]
    }

    /// Returns one pixel of each line.
    pub(crate) fn across(&self, pixel: usize) -> impl Iterator<Item = &f32> {
        self.sums[LANES + pixel..].iter().step_by(self.stride)
    }
}

/// A stroke; lengths in pixels, "along" counting lines and "across" the pixels of each. Places across have
/// [`PLACE_BITS`] behind the point.
pub(crate) struct Stroke {
    pub(crate) is_along_x: bool,
    /// Line and pixel of the corner from which places count.
    corner: (i32, i32),
    at: (f32, f32),
    divisions: i32,
    /// The energy of a sample in the middle.
    peak: f32,
    /// The power of 2 that falls with the square of the distance along.
    fall: f32,
    /// Movement across for a step along.
    slope: f32,
    /// From the middle to one side of the even width.
    half: i32,
    reach: f32,
    profile: usize,
}

impl Stroke {
    #[inline(always)]
    pub(crate) fn new(splat: &Splat) -> Self {
        let whole = splat.whole();
        let at = splat.at.clamp(DVec2::splat(-FAR), DVec2::splat(FAR));
        let is_along_x = whole.xx >= whole.yy;
        let turned = |v: DVec2| if is_along_x { v } else { DVec2::new(v.y, v.x) };
        let (at, side) = (turned(at), turned(splat.side));
        let Covariance { xx, xy, yy } = splat.covariance;
        let (soft_along, soft_across) = if is_along_x { (xx, yy) } else { (yy, xx) };
        let total_along = if is_along_x { whole.xx } else { whole.yy };

        const LEAST: f64 = SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA / (FINEST * FINEST) as f64;
        let total_along = total_along.max(LEAST);
        let soft = |slope: f64| (soft_across - 2.0 * slope * xy + slope * slope * soft_along).max(0.0);
        let (mut divisions, mut step_variance, mut per_along) = (1, 1.0 / 12.0, 1.0 / (total_along + 1.0 / 12.0));
        let square = |n: i32| f64::from(n * n);
        let slope = whole.xy * per_along;
        let needed = (SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA)
            .max(SAMPLES_PER_WIDTH * SAMPLES_PER_WIDTH * slope * slope * total_along / soft(slope).max(LEAST));
        while divisions < FINEST && square(divisions) * total_along < needed {
            divisions += 1;
        }
        if divisions > 1 {
            // A box of one sample has the variance 1/12: sampling with that added is the box integral to fourth order.
            step_variance /= square(divisions);
            per_along = 1.0 / (total_along + step_variance);
        }
        let slope = whole.xy * per_along;
        let sigma = (total_along + step_variance).sqrt();
        let width = (side.y - slope * side.x).abs();
        const SIXTEENTHS: f64 = (1 << ROW_BITS) as f64;
        let sixteenths = (SIXTEENTHS * width).round().clamp(1.0, WIDEST);
        let drawn = sixteenths / SIXTEENTHS;
        let variance = soft(slope) + slope * slope * step_variance + (width * width - drawn * drawn) / 12.0;
        let corner = at.floor();
        let within = at - corner;
        let per_sigma = sigma * per_along;
        const NORM: f64 = 0.398_942_280_401_432_7 / INSIDE;
        Self {
            is_along_x,
            corner: (corner.x as i32, corner.y as i32),
            at: (within.x as f32, within.y as f32),
            divisions,
            peak: (splat.energy * NORM * per_sigma / (f64::from(divisions) * drawn)) as f32,
            fall: (-0.5 * std::f64::consts::LOG2_E * per_along) as f32,
            slope: slope as f32,
            half: (sixteenths as i32) << (PLACE_BITS - ROW_BITS - 1),
            reach: (REACH * sigma) as f32,
            profile: profile_number(variance as f32),
        }
    }

    /// Adds it to the pixels of lines.
    #[inline(always)]
    pub(crate) fn add(&self, profiles: &[Profile], film: &mut Lines) {
        let (profile, divisions) = (&profiles[self.profile], self.divisions);
        let per_line = divisions as f32;
        let corner = self.corner.0 * divisions;
        let first = (corner + ceil((self.at.0 - self.reach) * per_line - 0.5)).max(0);
        let end = (corner + ceil((self.at.0 + self.reach) * per_line - 0.5)).min(film.n_lines as i32 * divisions);
        let mut from = first;
        while from < end {
            // Whole lines, but for the first.
            let to = (from - from % divisions + MOST_SAMPLES / divisions * divisions).min(end);
            self.add_samples(profile, film, from, to);
            from = to;
        }
    }

    /// Adds samples by products from one to the next.
    #[inline(always)]
    fn add_samples(&self, profile: &Profile, film: &mut Lines, from: i32, to: i32) {
        let (divisions, half) = (self.divisions, self.half);
        let step = 1.0 / divisions as f32;
        let along = ((from - self.corner.0 * divisions) as f32 + 0.5) * step - self.at.0;
        let mut powers = Powers {
            value: self.peak * exp2(self.fall * (along * along)),
            ratio: exp2(self.fall * (step * (step + 2.0 * along))),
            change: exp2(2.0 * self.fall * (step * step)),
        };
        let mut place = ((self.at.1 + self.slope * along) * ONE) as i32 - HALF_A_PIXEL;
        let across = (self.slope * step * ONE) as i32;
        let margin = self.corner.1 + LANES as i32;
        let (mut sample, mut line) = (from, from / divisions);
        while sample < to {
            let sums = &mut film.sums[line as usize * film.stride..][..film.stride];
            line += 1;
            let end = (line * divisions).min(to);
            while sample < end {
                let (middle, value) = (place, powers.next());
                place += across;
                sample += 1;
                let base = (middle >> PLACE_BITS) - BEFORE;
                if let Some(pixels) = sums.get_mut((base + margin) as usize..).and_then(<[f32]>::first_chunk_mut) {
                    let sides = (middle + HALF_A_PIXEL - half, middle + HALF_A_PIXEL + half);
                    profile.add_between(sides, base, value, pixels);
                }
            }
        }
    }
}

/// Pixels that are drawn before the one in the middle. It is the pixel that a place is in, half a pixel before it.
const BEFORE: i32 = 3;
const HALF_A_PIXEL: i32 = 1 << (PLACE_BITS - 1);
const ONE: f32 = (1 << PLACE_BITS) as f32;

#[inline(always)]
fn ceil(x: f32) -> i32 {
    x.ceil() as i32
}
