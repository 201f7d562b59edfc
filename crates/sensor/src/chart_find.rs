//! A 24-patch chart found in a picture.
//!
//! Even patches are parted by their borders; those of like size that lie on a common lattice are the chart, and of the
//! ways to turn it the one whose colors fit best is taken.

use dioptric_spectrum::{Illuminant, color_checker_reflectances};
use ndarray::{Array2, Array3};

use crate::{
    ChartReport, SensorError,
    least_squares::Normal,
    regions::{Region, regions},
};

/// The picture is binned so that its longer side has at most this many pixels.
const SEARCH_SIDE: usize = 480;
/// Steps from pixel to pixel, in natural logarithms, above which there is a border.
const BORDERS: [f32; 5] = [0.02, 0.04, 0.08, 0.16, 0.3];
/// The fewest of the 24 patches that must be seen.
const FEWEST: usize = 16;
/// Patches smaller than this many binned pixels are not looked at.
const SMALLEST: usize = 16;

/// The corners of a chart as [`ChartReport::measure`] wants them: row and column beside dark skin, bluish green, black
/// and white.
pub type ChartCorners = [(f64, f64); 4];

/// Finds the 24-patch chart in linear light of sRGB's primaries.
///
/// It may be turned and seen at a slant, but not mirrored; patches may touch or have a frame between them.
///
/// # Errors
/// When there is no such chart, patches are under about five pixels, or some are not those of the chart
/// ([`ChartReport::misfits`]).
pub fn find_chart(light_rgb: &Array3<f32>, light: &Illuminant) -> Result<ChartCorners, SensorError> {
    let factor = light_rgb.dim().0.max(light_rgb.dim().1).div_ceil(SEARCH_SIDE).max(1);
    let logs = binned_logs(light_rgb, factor);
    let lattice = BORDERS.iter().filter_map(|&border| best_lattice(&patches(&logs, border))).max_by(|a, b| {
        (a.n_seen, -a.residual).partial_cmp(&(b.n_seen, -b.residual)).unwrap_or(std::cmp::Ordering::Equal)
    });
    let none = || SensorError::Unsuitable {
        what: "the chart",
        reason: "of 24 patches is not found in the picture; give its corners".to_owned(),
    };
    let lattice = lattice.ok_or_else(none)?;
    // Back to pixels of the picture: the middle of binned pixel i is at factor (i + ½) − ½.
    let place = |(row, column): (f64, f64)| {
        let full = |v: f64| factor as f64 * (v + 0.5) - 0.5;
        (full(row), full(column))
    };
    let corners = lattice.corners().map(place);
    let turned = [corners, [corners[2], corners[3], corners[0], corners[1]]];
    let error_of = |corners: &ChartCorners| {
        ChartReport::measure(light_rgb, *corners, light).map_or(f64::INFINITY, |report| report.mean_delta_e())
    };
    let best = turned.into_iter().min_by(|a, b| error_of(a).total_cmp(&error_of(b)));
    let corners = best.filter(|corners| error_of(corners).is_finite()).ok_or_else(none)?;
    let misfits = ChartReport::measure(light_rgb, corners, light)?.misfits();
    if misfits.is_empty() {
        return Ok(corners);
    }
    let chart = color_checker_reflectances();
    let names: Vec<&str> = misfits.iter().map(|&patch| chart[patch].0.as_str()).collect();
    let reason = format!(
        "is not seen whole: of its 24 patches {} ({}) are more than twice as bright or as dark as the others make them, hidden, shaded or \
         clipped; give its corners to measure it all the same",
        names.len(),
        names.join(", ")
    );
    Err(SensorError::Unsuitable { what: "the chart", reason })
}

/// Returns the logarithms of the three channels, binned.
fn binned_logs(light_rgb: &Array3<f32>, factor: usize) -> [Array2<f32>; 3] {
    let size = (light_rgb.dim().0 / factor, light_rgb.dim().1 / factor);
    let brightest = light_rgb.iter().fold(0.0_f32, |most, &v| if v.is_finite() { most.max(v) } else { most });
    // The darkest patch reflects about 3 %; well below that noise has its way.
    let floor = 0.005 * brightest.max(f32::MIN_POSITIVE);
    [0, 1, 2].map(|channel| {
        Array2::from_shape_fn(size, |(r, c)| {
            let block =
                light_rgb.slice(ndarray::s![r * factor..(r + 1) * factor, c * factor..(c + 1) * factor, channel]);
            (block.sum() / (factor * factor) as f32).max(0.0) / floor
        })
        .mapv(f32::ln_1p)
    })
}

/// A node of a lattice and the middle of the patch that lies on it.
type Seen = ((i32, i32), (f64, f64));

/// An even patch: where it is and how many pixels it has.
#[derive(Clone, Copy, Debug)]
struct Patch {
    center: (f64, f64),
    area: f64,
}

/// Returns the compact even regions.
fn patches(logs: &[Array2<f32>; 3], border: f32) -> Vec<Patch> {
    let (rows, columns) = logs[0].dim();
    let even = Array2::from_shape_fn((rows, columns), |(r, c)| {
        let is_even_to = |at: (usize, usize)| {
            let at = (at.0.min(rows - 1), at.1.min(columns - 1));
            logs.iter().all(|plane| (plane[(r, c)] - plane[at]).abs() < border)
        };
        is_even_to((r + 1, c)) && is_even_to((r, c + 1))
    });
    let compact = |region: &Region| {
        let (height, width) = region.extent();
        let (area, rectangle) = (region.pixels.len() as f64, (height * width) as f64);
        // A square turned by 45° fills half of its rectangle.
        region.pixels.len() >= SMALLEST && area > 0.45 * rectangle && height < 2 * width && width < 2 * height
    };
    regions(&even, false)
        .iter()
        .filter(|region| compact(region))
        .map(|region| Patch { center: region.center(), area: region.pixels.len() as f64 })
        .collect()
}

/// Places in the picture of the lattice's nodes: row and column are a + b i + c j + d i j.
#[derive(Clone, Debug)]
struct Lattice {
    /// The four factors of the row and of the column.
    factors: [[f64; 4]; 2],
    /// The chart's first node along i (6 nodes) and j (4 nodes).
    first: (i32, i32),
    n_seen: usize,
    /// The rms distance of the patches from the nodes.
    residual: f64,
}

impl Lattice {
    fn place(&self, i: f64, j: f64) -> (f64, f64) {
        let [row, column] = self.factors.map(|[a, b, c, d]| a + b * i + c * j + d * i * j);
        (row, column)
    }

    fn corners(&self) -> ChartCorners {
        let (i, j) = (f64::from(self.first.0) - 0.5, f64::from(self.first.1) - 0.5);
        [(i, j), (i + 6.0, j), (i + 6.0, j + 4.0), (i, j + 4.0)].map(|(i, j)| self.place(i, j))
    }
}

/// Returns the lattice that most patches of like size lie on.
fn best_lattice(patches: &[Patch]) -> Option<Lattice> {
    let mut best: Option<Lattice> = None;
    for start in patches {
        let like: Vec<Patch> =
            patches.iter().filter(|p| p.area > 0.4 * start.area && p.area < 2.5 * start.area).copied().collect();
        if like.len() < FEWEST {
            continue;
        }
        let steps = nearest_steps(&like, start);
        for &u in &steps {
            for &v in &steps {
                if let Some(lattice) = grown(&like, start, u, v)
                    && best.as_ref().is_none_or(|b| {
                        lattice.n_seen > b.n_seen || lattice.n_seen == b.n_seen && lattice.residual < b.residual
                    })
                {
                    best = Some(lattice);
                }
            }
        }
        if best.as_ref().is_some_and(|b| b.n_seen == 24) {
            break;
        }
    }
    best
}

/// Returns the steps from a patch to its eight nearest neighbors.
fn nearest_steps(like: &[Patch], start: &Patch) -> Vec<(f64, f64)> {
    let mut steps: Vec<(f64, f64)> = like
        .iter()
        .map(|p| (p.center.0 - start.center.0, p.center.1 - start.center.1))
        .filter(|step| step.0.hypot(step.1) > 1.0)
        .collect();
    steps.sort_by(|a, b| a.0.hypot(a.1).total_cmp(&b.0.hypot(b.1)));
    steps.truncate(8);
    steps
}

/// Grows a lattice from one patch and two steps: the longer side of the chart along `u`, its shorter along `v`.
fn grown(like: &[Patch], start: &Patch, u: (f64, f64), v: (f64, f64)) -> Option<Lattice> {
    let (length_u, length_v) = (u.0.hypot(u.1), v.0.hypot(v.1));
    // From u (columns →) to v (rows ↓) the turn is clockwise in the picture, else the chart would be mirrored.
    let turn = u.1 * v.0 - u.0 * v.1;
    if turn < 0.7 * length_u * length_v || length_u > 1.6 * length_v || length_v > 1.6 * length_u {
        return None;
    }
    let mut factors = [[start.center.0, u.0, v.0, 0.0], [start.center.1, u.1, v.1, 0.0]];
    let mut seen = Vec::new();
    for reach in [2, 4, 6, 6] {
        seen = assigned(like, &factors, reach);
        if seen.len() < 4 {
            return None;
        }
        factors = fitted(&seen);
    }
    let (first, n_seen) = best_window(&seen)?;
    let lattice = Lattice { factors, first, n_seen, residual: 0.0 };
    let inside = |&&((i, j), _): &&Seen| (first.0..first.0 + 6).contains(&i) && (first.1..first.1 + 4).contains(&j);
    let square: f64 = seen
        .iter()
        .filter(inside)
        .map(|&((i, j), at)| {
            let place = lattice.place(f64::from(i), f64::from(j));
            (place.0 - at.0).powi(2) + (place.1 - at.1).powi(2)
        })
        .sum();
    let residual = (square / n_seen as f64).sqrt();
    (residual < 0.12 * length_u.min(length_v)).then_some(Lattice { residual, ..lattice })
}

/// Returns the patches that lie on nodes of a lattice, within a number of steps.
fn assigned(like: &[Patch], factors: &[[f64; 4]; 2], reach: i32) -> Vec<Seen> {
    let [[ra, rb, rc, rd], [ca, cb, cc, cd]] = *factors;
    like.iter()
        .filter_map(|patch| {
            // Newton's steps from the affine part; the bend is small.
            let (mut i, mut j) = (0.0, 0.0);
            for _ in 0..4 {
                let row = ra + rb * i + rc * j + rd * i * j - patch.center.0;
                let column = ca + cb * i + cc * j + cd * i * j - patch.center.1;
                let (ri, rj, ci, cj) = (rb + rd * j, rc + rd * i, cb + cd * j, cc + cd * i);
                let determinant = ri * cj - rj * ci;
                i -= (row * cj - column * rj) / determinant;
                j -= (column * ri - row * ci) / determinant;
            }
            let node = (i.round(), j.round());
            let is_near = (i - node.0).hypot(j - node.1) < 0.25 && node.0.abs().max(node.1.abs()) <= f64::from(reach);
            is_near.then_some(((node.0 as i32, node.1 as i32), patch.center))
        })
        .collect()
}

/// Returns the factors that put the nodes nearest to the patches.
fn fitted(seen: &[Seen]) -> [[f64; 4]; 2] {
    let span = |of: fn(&(i32, i32)) -> i32| {
        let values = seen.iter().map(|(node, _)| of(node));
        values.clone().max().unwrap_or(0) - values.min().unwrap_or(0)
    };
    // The product needs nodes on both axes, well spread.
    let n_terms = if seen.len() >= 8 && span(|n| n.0) >= 2 && span(|n| n.1) >= 2 { 4 } else { 3 };
    let (mut of_row, mut of_column) = (Normal::new(n_terms), Normal::new(n_terms));
    for ((i, j), at) in seen {
        let (i, j) = (f64::from(*i), f64::from(*j));
        let terms = &[1.0, i, j, i * j][..n_terms];
        of_row.add(terms, at.0);
        of_column.add(terms, at.1);
    }
    [of_row, of_column].map(|normal| {
        let mut factors = [0.0; 4];
        factors[..n_terms].copy_from_slice(&normal.solve(0.0));
        factors
    })
}

/// Returns the first node of the 6 × 4 nodes that hold the most patches, and how many.
fn best_window(seen: &[Seen]) -> Option<((i32, i32), usize)> {
    let nodes: std::collections::BTreeSet<(i32, i32)> = seen.iter().map(|(node, _)| *node).collect();
    let firsts = (-6..=1).flat_map(|i| (-6..=3).map(move |j| (i, j)));
    let count = |first: (i32, i32)| {
        let inside =
            |node: &&(i32, i32)| (first.0..first.0 + 6).contains(&node.0) && (first.1..first.1 + 4).contains(&node.1);
        nodes.iter().filter(inside).count()
    };
    firsts.map(|first| (first, count(first))).max_by_key(|(_, n)| *n).filter(|(_, n)| *n >= FEWEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::{Observer, Xyz};

    /// Linear sRGB of the patches under D65.
    fn colors() -> Vec<[f32; 3]> {
        let grid = crate::white_light::fine_grid();
        let light = Illuminant::D65.spectrum().sample_held(&grid);
        let white = Observer::Cie1931.xyz(&grid, &light).0[1];
        let color = |reflectance: &dioptric_spectrum::Spectrum| {
            let lit: Vec<f64> = reflectance.sample_held(&grid).iter().zip(&light).map(|(r, s)| r * s).collect();
            Xyz(Observer::Cie1931.xyz(&grid, &lit).0.map(|v| v / white)).to_linear_srgb().map(|v| v as f32)
        };
        color_checker_reflectances().iter().map(|(_, reflectance)| color(reflectance)).collect()
    }

    /// A chart on dark gray: patches of 30 pixels in steps of `step`, turned by an angle and seen at a slant.
    fn picture(turn_deg: f64, step: f64, slant: f64) -> Array3<f32> {
        let colors = colors();
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let mut picture = Array3::from_elem((420, 420, 3), 0.05);
        for r in 0..420 {
            for c in 0..420 {
                let (y, x) = (r as f64 - 210.0, c as f64 - 210.0);
                let (u, v) = (x * cos + y * sin, y * cos - x * sin);
                let u = u * (1.0 + slant * v / 210.0);
                let (i, j) = (u / step + 3.0, v / step + 2.0);
                let within = |place: f64| (place.fract() - 0.5).abs() * step < 15.0;
                if (0.0..6.0).contains(&i) && (0.0..4.0).contains(&j) && within(i) && within(j) {
                    let color = colors[6 * j as usize + i as usize];
                    (0..3).for_each(|k| picture[(r, c, k)] = color[k]);
                }
            }
        }
        picture
    }

    #[test]
    fn a_chart_is_found_however_it_is_turned() {
        for (turn_deg, step, slant) in [
            (0.0, 40.0, 0.0),
            (0.0, 30.0, 0.0),
            (180.0, 40.0, 0.0),
            (90.0, 38.0, 0.0),
            (-25.0, 40.0, 0.0),
            (8.0, 40.0, 0.1),
        ] {
            let picture = picture(turn_deg, step, slant);
            let corners = find_chart(&picture, &Illuminant::D65)
                .unwrap_or_else(|e| panic!("turned by {turn_deg}°, step {step}, slant {slant}: {e}"));
            let report = ChartReport::measure(&picture, corners, &Illuminant::D65).unwrap();
            // Single precision and the 2 nm grid of the reference leave less than this.
            assert!(report.max_delta_e() < 0.1, "turned by {turn_deg}°: {:.2}", report.max_delta_e());
        }
    }

    #[test]
    fn half_hidden_charts_are_refused() {
        let mut picture = picture(0.0, 40.0, 0.0);
        // Before four patches in the middle of an upright chart of 240 × 160 pixels about (210, 210).
        picture.slice_mut(ndarray::s![170..250, 130..210, ..]).fill(0.9);
        let reason = find_chart(&picture, &Illuminant::D65).unwrap_err().to_string();
        assert!(reason.contains("4 (purplish blue, moderate red, green, red)"), "{reason}");
    }

    #[test]
    fn a_picture_without_a_chart_says_so() {
        let none = |picture: Array3<f32>| find_chart(&picture, &Illuminant::D65).unwrap_err().to_string();
        assert!(none(Array3::zeros((50, 50, 3))).contains("not found"));
        assert!(
            none(Array3::from_shape_fn((90, 90, 3), |(r, c, i)| ((r * 7 + c * 13 + i) % 11) as f32))
                .contains("corners")
        );
    }
}
