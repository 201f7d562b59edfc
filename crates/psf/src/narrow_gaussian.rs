//! Gaussians that are narrow on pixels.
//!
//! The derivation is in `docs/hurb.md`, which comments name by its equations. Along the pixel axis in which it is wider, one is sampled at every pixel, or a few times a pixel where it is
//! short or steep; there its values are products, as down the columns of a broad Gaussian. Across, what each of eight
//! pixels holds of it is read from a table of integrals: no sample is finer than a pixel, and what is spread evenly
//! over some width, as the light of a cell is, needs no more than what is not.

use glam::DVec2;

use crate::{
    blurred_edge::{BlurredEdgeTable, LANES, PLACE_BITS, ROW_BITS, profile_number, variance_below},
    power::{MOST_PRODUCTS, Powers, exp2},
    splat::{FAR, Splat},
};

/// The finest subdivision of a pixel along a Gaussian. What is shorter than its samples allow is lengthened to
/// 0.12 pixels, which on pixels makes next to no difference.
const FINEST: f64 = 5.0;
/// A Gaussian has this many samples a standard deviation of its length, or more.
pub(crate) const SAMPLES_PER_SIGMA: f64 = 0.6;
/// From one sample to the next a Gaussian moves across by its width over this, or less.
const SAMPLES_PER_WIDTH: f64 = 0.4;
/// How many standard deviations of its length are drawn; what lies beyond, 3·10⁻⁴, is spread over the rest.
const REACH: f64 = 3.6;
/// The height of the normal distribution over what is held within the reach, 0.999 68.
const NORM: f64 = 0.399_069_271_099_632_4;

/// Rows of pixels in single precision, each longer at both ends so that eight pixels may run over the edge.
pub(crate) struct PaddedRows {
    pub(crate) n_lines: usize,
    pub(crate) n_pixels: usize,
    pub(crate) stride: usize,
    pub(crate) sums: Vec<f32>,
}

impl PaddedRows {
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

/// A stroke; lengths in pixels, "along" counting lines and "across" the pixels of each. All its numbers are of one type, so
/// that eight strokes are set up together: see [`NarrowGaussians`].
struct NarrowGaussian {
    /// 1 for a stroke along x, 0 for one along y.
    along_x: f32,
    /// Line and pixel of the corner from which places count, and the place of the middle.
    corner: (f32, f32),
    at: (f32, f32),
    /// Samples to a line.
    divisions: f32,
    /// The energy of a sample in the middle.
    peak: f32,
    /// The power of 2 that falls with the square of the distance along.
    fall: f32,
    /// Movement across for a step along.
    slope: f32,
    /// The variance of the profile across, and the even width there in sixteenths of a pixel.
    softness: f32,
    sixteenths: f32,
    /// The first sample and its line, the one after the last, and the energies from the first on.
    first: f32,
    line: f32,
    end: f32,
    powers: Powers,
}

/// One of each of the numbers of a stroke.
type OfEach<T> = [T; 17];

/// Eight strokes, each of their numbers side by side. The compiler makes vectors of their setup: nothing in it branches.
pub(crate) struct NarrowGaussians(OfEach<[f32; LANES]>);

impl NarrowGaussians {
    /// Returns the strokes of splats on a picture of so many rows and columns.
    #[inline(always)]
    pub(crate) fn new(splats: &[Splat; LANES], size: (usize, usize)) -> Self {
        let size = (size.0 as f32, size.1 as f32);
        let mut numbers: OfEach<[f32; LANES]> = OfEach::default();
        for i in 0..LANES {
            for (of_all, number) in numbers.iter_mut().zip(NarrowGaussian::new(&splats[i], size).into_numbers()) {
                of_all[i] = number;
            }
        }
        Self(numbers)
    }

    /// Adds the first strokes to the pixels of the rows, or of the columns where they are along x.
    #[inline(always)]
    pub(crate) fn add(&self, n: usize, profiles: &[BlurredEdgeTable], rows: &mut PaddedRows, columns: &mut PaddedRows) {
        for i in 0..n {
            let mut numbers: OfEach<f32> = OfEach::default();
            for (number, of_all) in numbers.iter_mut().zip(&self.0) {
                *number = of_all[i];
            }
            let stroke = NarrowGaussian::from_numbers(numbers);
            let film = if stroke.along_x > 0.5 { &mut *columns } else { &mut *rows };
            stroke.add(profiles, film);
        }
    }
}

impl NarrowGaussian {
    #[inline(always)]
    fn new(splat: &Splat, (n_rows, n_columns): (f32, f32)) -> Self {
        // Choose the axis along: that in which the Gaussian is wider; swap x and y for it.
        let whole = splat.whole();
        let is_along_x = whole.xx >= whole.yy;
        let turned = |x: f64, y: f64| if is_along_x { (x, y) } else { (y, x) };
        let at = splat.at.clamp(DVec2::splat(-FAR), DVec2::splat(FAR));
        let at = turned(at.x, at.y);
        let side = turned(splat.side.x, splat.side.y);
        let (soft_along, soft_across) = turned(splat.covariance.xx, splat.covariance.yy);
        let n_lines = if is_along_x { n_columns } else { n_rows };

        // Choose the samples to a line from the length and from how far the profile moves across (eq. 16).
        let least = SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA / (FINEST * FINEST);
        let total_along = whole.xx.max(whole.yy).max(least);
        let soft = |slope: f64| (soft_across - 2.0 * slope * splat.covariance.xy + slope * slope * soft_along).max(0.0);
        let slope = whole.xy / (total_along + 1.0 / 12.0);
        let needed = (SAMPLES_PER_SIGMA * SAMPLES_PER_SIGMA)
            .max(SAMPLES_PER_WIDTH * SAMPLES_PER_WIDTH * slope * slope * total_along / soft(slope).max(least));
        let divisions = (needed / total_along).sqrt().ceil().clamp(1.0, FINEST);
        // Add the variance of a sample's box: samples are then box integrals to fourth order (eqs. 10 to 12).
        let step_variance = 1.0 / (12.0 * divisions * divisions);
        let per_along = 1.0 / (total_along + step_variance);
        let slope = whole.xy * per_along;
        let sigma = (total_along + step_variance).sqrt();
        // The profile across: the even width that the side leaves (eq. 14)…
        let width = (side.1 - slope * side.0).abs();
        let rows = f64::from(1 << ROW_BITS);
        // It reaches to both sides of the eight pixels less those before the middle.
        let widest = rows * f64::from(LANES as i32 - pixels_before());
        // … and the conditional variance (eq. 13). The table has widths of whole sixteenths and some variances: what is
        // beyond those widens the even width, so that the whole variance is kept (eq. 15).
        let least = (rows * width).floor().clamp(1.0, widest) / rows;
        let rest = soft(slope) + slope * slope * step_variance + (width * width - least * least) / 12.0;
        let softness = variance_below(rest as f32);
        let square = least * least + 12.0 * (rest - f64::from(softness)).max(0.0);
        let sixteenths = (rows * square.sqrt() + 0.5).floor().clamp(1.0, widest);
        let drawn = sixteenths / rows;
        // The energy of the sample in the middle (eq. 11), over the width that it is spread on.
        let corner = (at.0.floor(), at.1.floor());
        let mut stroke = Self {
            along_x: if is_along_x { 1.0 } else { 0.0 },
            corner: (corner.0 as f32, corner.1 as f32),
            at: ((at.0 - corner.0) as f32, (at.1 - corner.1) as f32),
            divisions: divisions as f32,
            peak: (splat.energy * NORM * sigma * per_along / (divisions * drawn)) as f32,
            fall: (-0.5 * std::f64::consts::LOG2_E * per_along) as f32,
            slope: slope as f32,
            softness,
            sixteenths: sixteenths as f32,
            first: 0.0,
            line: 0.0,
            end: 0.0,
            powers: Powers::default(),
        };
        // The samples within reach that lie on the picture.
        let (middle, reach) = (stroke.corner.0 + stroke.at.0, (REACH * sigma) as f32);
        stroke.first = ((middle - reach) * stroke.divisions - 0.5).ceil().max(0.0);
        stroke.end = ((middle + reach) * stroke.divisions - 0.5).ceil().min(n_lines * stroke.divisions);
        stroke.line = ((stroke.first + 0.5) / stroke.divisions).floor();
        stroke.powers = stroke.powers_from(stroke.first);
        stroke
    }

    /// Returns how far a sample lies along from the middle.
    #[inline(always)]
    fn along(&self, sample: f32) -> f32 {
        (sample - self.corner.0 * self.divisions + 0.5) / self.divisions - self.at.0
    }

    /// Returns the energies of samples from one on.
    #[inline(always)]
    fn powers_from(&self, sample: f32) -> Powers {
        let (along, step) = (self.along(sample), 1.0 / self.divisions);
        Powers {
            value: self.peak * exp2(self.fall * (along * along)),
            ratio: exp2(self.fall * (step * (step + 2.0 * along))),
            change: exp2(2.0 * self.fall * (step * step)),
        }
    }

    /// Adds it to the pixels of lines, by products from one sample to the next.
    #[inline(always)]
    fn add(mut self, profiles: &[BlurredEdgeTable], film: &mut PaddedRows) {
        let profile = &profiles[profile_number(self.softness)];
        let half = (self.sixteenths as i32) << (PLACE_BITS - ROW_BITS - 1);
        let across = fixed(self.slope / self.divisions);
        let half_a_pixel = 1 << (PLACE_BITS - 1);
        let margin = self.corner.1 as i32 + LANES as i32;
        let (divisions, n) = (self.divisions as u32, (self.end - self.first) as usize);
        // Where the line begins, and how many samples are left of it.
        let mut left = ((self.line + 1.0) * self.divisions - self.first) as u32;
        let mut line = self.line as usize * film.stride;
        for done in (0..n).step_by(MOST_PRODUCTS) {
            let from = self.first + done as f32;
            if done > 0 {
                self.powers = self.powers_from(from);
            }
            // It is the pixel that a place is in, half a pixel before it.
            let mut place = fixed(self.at.1 + self.slope * self.along(from)) - half_a_pixel;
            for _ in done..n.min(done + MOST_PRODUCTS) {
                let (middle, value) = (place, self.powers.next());
                place += across;
                let base = (middle >> PLACE_BITS) - pixels_before();
                let sums = &mut film.sums[line..][..film.stride];
                if let Some(pixels) = sums.get_mut((base + margin) as usize..).and_then(<[f32]>::first_chunk_mut) {
                    let sides = (middle + half_a_pixel - half, middle + half_a_pixel + half);
                    profile.add_between(sides, base, value, pixels);
                }
                left -= 1;
                (line, left) = if left == 0 { (line + film.stride, divisions) } else { (line, left) };
            }
        }
    }

    #[inline(always)]
    fn into_numbers(self) -> OfEach<f32> {
        let Self { along_x, corner, at, divisions, peak, fall, slope, softness, sixteenths, first, line, end, powers } =
            self;
        let Powers { value, ratio, change } = powers;
        [
            along_x, corner.0, corner.1, at.0, at.1, divisions, peak, fall, slope, softness, sixteenths, first, line,
            end, value, ratio, change,
        ]
    }

    #[inline(always)]
    fn from_numbers(numbers: OfEach<f32>) -> Self {
        let [
            along_x,
            line_of_corner,
            pixel,
            along,
            across,
            divisions,
            peak,
            fall,
            slope,
            softness,
            sixteenths,
            first,
            line,
            end,
            value,
            ratio,
            change,
        ] = numbers;
        let (corner, at, powers) = ((line_of_corner, pixel), (along, across), Powers { value, ratio, change });
        Self { along_x, corner, at, divisions, peak, fall, slope, softness, sixteenths, first, line, end, powers }
    }
}

/// Pixels that are drawn before the one in the middle.
const fn pixels_before() -> i32 {
    LANES as i32 / 2 - 1
}

/// Returns a place in parts of a pixel.
#[inline(always)]
fn fixed(px: f32) -> i32 {
    (px * (1 << PLACE_BITS) as f32) as i32
}
