//! What a DNG file says of the lens: distortion and lateral color as `WarpRectilinear`, the fall of light as `FixVignetteRadial`
//! (DNG 1.4, chapter 7, opcodes 1 and 3), each a polynomial of the distance from a center.

use crate::{FrameTable, LensCorrections, LensTables, SensorError, least_squares::Normal};

/// The most by which a polynomial may miss a place, pixels.
const MOST_OFF_PX: f64 = 0.5;
/// The most by which it may miss a factor, a share of it.
const MOST_GAIN_OFF: f64 = 0.02;
/// Version 1.3 of the format, in which these came.
const VERSION: u32 = 0x0103_0000;
/// A reader that does not know them may go on.
const OPTIONAL: u32 = 1;

/// Returns the bytes of `OpcodeList3`, which is for demosaiced planes: those of the filters in this order.
pub(super) fn opcode_list_3(
    tables: &LensTables,
    corrections: LensCorrections,
    order: &[usize],
) -> Result<Vec<u8>, SensorError> {
    let mut opcodes = Vec::new();
    if corrections.vignetting {
        opcodes.push(fix_vignette_radial(tables, order)?);
    }
    if corrections.moves() {
        opcodes.push(warp_rectilinear(tables, corrections, order)?);
    }
    let count = (opcodes.len() as u32).to_be_bytes();
    Ok(count.into_iter().chain(opcodes.into_iter().flatten()).collect())
}

/// Returns the bytes of one opcode, big-endian in every file.
fn opcode(number: u32, parameters: &[u8]) -> Vec<u8> {
    let head = [number, VERSION, OPTIONAL, parameters.len() as u32];
    head.into_iter().flat_map(u32::to_be_bytes).chain(parameters.iter().copied()).collect()
}

/// The nodes of a frame about a center, distances in parts of that to the farthest corner.
struct Polar {
    /// Shares of the frame's width and height.
    center: [f64; 2],
    /// Pixels to the right and down of the center.
    places_px: Vec<[f64; 2]>,
    farthest_px: f64,
}

impl Polar {
    fn new((rows, columns): (usize, usize), nodes: (usize, usize), center: [f64; 2]) -> Self {
        let (width, height) = (columns as f64, rows as f64);
        let share = |i: usize, n: usize| i as f64 / (n - 1) as f64;
        let places = (0..nodes.0).flat_map(|row| (0..nodes.1).map(move |column| (row, column)));
        let from_center = |(row, column): (usize, usize)| {
            [(share(column, nodes.1) - center[0]) * width, (share(row, nodes.0) - center[1]) * height]
        };
        let farthest = |share: f64| share.max(1.0 - share);
        Self {
            center,
            places_px: places.map(from_center).collect(),
            farthest_px: (farthest(center[0]) * width).hypot(farthest(center[1]) * height),
        }
    }

    /// Returns the square of a node's distance.
    fn r2(&self, node: usize) -> f64 {
        let [x, y] = self.places_px[node];
        (x * x + y * y) / self.farthest_px.powi(2)
    }

    /// Returns the factors of 1, r², r⁴ and r⁶ by which places of the picture become places of the frame, and the farthest that they
    /// miss one, pixels.
    fn warp(&self, displacement: &[FrameTable; 2]) -> ([f64; 4], f64) {
        let moved: Vec<[f64; 2]> =
            displacement[0].values().zip(displacement[1].values()).map(|(right, down)| [right, down]).collect();
        let powers = |node: usize| [0, 1, 2, 3].map(|k| self.r2(node).powi(k));
        let mut normal = Normal::new(4);
        for (node, (place, moved)) in self.places_px.iter().zip(&moved).enumerate() {
            for i in 0..2 {
                // In parts of the farthest corner, so that all factors are of one size.
                let slopes = powers(node).map(|p| p * place[i] / self.farthest_px);
                normal.add(&slopes, (place[i] + moved[i]) / self.farthest_px);
            }
        }
        let solved = normal.solve(0.0);
        let factors = [0, 1, 2, 3].map(|k| solved[k]);
        let off = self.places_px.iter().zip(&moved).enumerate().map(|(node, (place, moved))| {
            let scale: f64 = powers(node).iter().zip(factors).map(|(p, k)| p * k).sum();
            let miss = [0, 1].map(|i| scale * place[i] - place[i] - moved[i]);
            miss[0].hypot(miss[1])
        });
        (factors, off.fold(0.0, f64::max))
    }

    /// Returns the factors of r² to r¹⁰ of gains over that of the center, and the largest share by which they miss one.
    fn vignetting(&self, gains: &[f64], at_center: f64) -> ([f64; 5], f64) {
        let powers = |node: usize| [1, 2, 3, 4, 5].map(|k| self.r2(node).powi(k));
        let mut normal = Normal::new(5);
        for (node, gain) in gains.iter().enumerate() {
            normal.add(&powers(node).map(|p| p / gain), (gain / at_center - 1.0) / gain);
        }
        let solved = normal.solve(0.0);
        let factors = [0, 1, 2, 3, 4].map(|k| solved[k]);
        let off = gains.iter().enumerate().map(|(node, gain)| {
            let found: f64 = 1.0 + powers(node).iter().zip(factors).map(|(p, k)| p * k).sum::<f64>();
            (found * at_center / gain - 1.0).abs()
        });
        (factors, off.fold(0.0, f64::max))
    }
}

/// Returns the center at which a fit misses least: the middle of the frame, unless another is better.
fn best_center(miss: impl Fn([f64; 2]) -> f64) -> [f64; 2] {
    let mut center = [0.5, 0.5];
    let mut least = miss(center);
    let mut step = 0.1;
    while step > 1e-4 {
        let around = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]];
        let tried = around.map(|[x, y]| [center[0] + x, center[1] + y]).map(|at| (miss(at), at));
        match tried.into_iter().filter(|(off, _)| *off < least * (1.0 - 1e-6)).min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some(better) => (least, center) = better,
            None => step *= 0.5,
        }
    }
    center
}

fn not_radial(what: &str, by: String) -> SensorError {
    let reason =
        format!("describes {what} as a function of the distance from a center, which misses that of this lens by {by}");
    SensorError::Unsuitable { what: "a DNG file", reason }
}

fn warp_rectilinear(
    tables: &LensTables,
    corrections: LensCorrections,
    order: &[usize],
) -> Result<Vec<u8>, SensorError> {
    let sources: Vec<[FrameTable; 2]> = order.iter().map(|&channel| tables.source_px(channel, corrections)).collect();
    let nodes = sources[0][0].nodes();
    let center = best_center(|center| Polar::new(tables.size, nodes, center).warp(&sources[0]).1);
    let polar = Polar::new(tables.size, nodes, center);
    let fits: Vec<([f64; 4], f64)> = sources.iter().map(|source| polar.warp(source)).collect();
    let off_px = fits.iter().map(|(_, off)| *off).fold(0.0, f64::max);
    if off_px > MOST_OFF_PX {
        return Err(not_radial("distortion", format!("{off_px:.1} pixels, expected at most {MOST_OFF_PX}")));
    }
    let mut parameters = (fits.len() as u32).to_be_bytes().to_vec();
    let tangential = [0.0; 2];
    let numbers = fits.iter().flat_map(|(factors, _)| factors.iter().chain(&tangential)).chain(&polar.center);
    parameters.extend(numbers.flat_map(|v| v.to_be_bytes()));
    Ok(opcode(1, &parameters))
}

/// Returns the fall of light, of all planes together: the opcode has no planes.
fn fix_vignette_radial(tables: &LensTables, order: &[usize]) -> Result<Vec<u8>, SensorError> {
    let lists: Vec<Vec<f64>> = order.iter().map(|&channel| tables.vignetting[channel].values().collect()).collect();
    let mean = |node: usize| lists.iter().map(|list| list[node]).sum::<f64>() / lists.len() as f64;
    let gains: Vec<f64> = (0..lists[0].len()).map(mean).collect();
    let at = |[right, down]: [f64; 2]| {
        order.iter().map(|&channel| tables.vignetting[channel].at(down, right)).sum::<f64>() / order.len() as f64
    };
    let nodes = tables.vignetting[0].nodes();
    let fit = |center: [f64; 2]| Polar::new(tables.size, nodes, center).vignetting(&gains, at(center));
    let center = best_center(|center| fit(center).1);
    let (factors, off) = fit(center);
    if off > MOST_GAIN_OFF {
        return Err(not_radial(
            "vignetting",
            format!("{:.1} %, expected at most {} %", 100.0 * off, 100.0 * MOST_GAIN_OFF),
        ));
    }
    let parameters: Vec<u8> = factors.iter().chain(&center).flat_map(|v| v.to_be_bytes()).collect();
    Ok(opcode(3, &parameters))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const SIZE: (usize, usize) = (400, 600);

    /// Tables of a lens whose axis meets the frame at these shares of it.
    fn tables(axis: [f64; 2]) -> LensTables {
        let farthest = Polar::new(SIZE, (3, 3), axis).farthest_px;
        let from_axis = move |down: f64, right: f64| [(right - axis[0]) * 600.0, (down - axis[1]) * 400.0];
        let r2 = move |down: f64, right: f64| {
            let [x, y] = from_axis(down, right);
            (x * x + y * y) / (farthest * farthest)
        };
        let moved = |scale: &dyn Fn(f64) -> f64| {
            [0, 1].map(|i| {
                let value = |down: f64, right: f64| from_axis(down, right)[i] * scale(r2(down, right));
                FrameTable::tabulate(41, 41, value).unwrap()
            })
        };
        LensTables {
            size: SIZE,
            distortion_px: moved(&|r2| -0.1 * r2 + 0.02 * r2 * r2),
            lateral_color_px: [0.001, 0.0, -0.002].map(|k| moved(&|_| k)).into(),
            vignetting: vec![
                FrameTable::tabulate(41, 41, |d, r| 1.0 + 0.5 * r2(d, r) + 0.3 * r2(d, r).powi(2)).unwrap();
                3
            ],
        }
    }

    fn numbers(bytes: &[u8]) -> Vec<f64> {
        bytes.chunks_exact(8).map(|b| f64::from_be_bytes(b.try_into().unwrap())).collect()
    }

    #[test]
    fn polynomials_of_a_known_lens_come_back() {
        for axis in [[0.5, 0.5], [0.55, 0.4]] {
            let list = opcode_list_3(&tables(axis), LensCorrections::ALL, &[0, 1, 2]).unwrap();
            let word = |at: usize| u32::from_be_bytes(list[at..at + 4].try_into().unwrap());
            assert_eq!([0, 4, 8, 12, 16].map(word), [2, 3, VERSION, OPTIONAL, 56]);
            let fall = numbers(&list[20..76]);
            for (found, wanted) in fall.iter().zip([0.5, 0.3, 0.0, 0.0, 0.0, axis[0], axis[1]]) {
                assert_abs_diff_eq!(*found, wanted, epsilon = 0.01);
            }
            assert_eq!([76, 80, 84, 88, 92].map(word), [1, VERSION, OPTIONAL, 4 + 8 * 20, 3]);
            let warp = numbers(&list[96..]);
            assert_eq!(warp.len(), 20);
            // The second plane has no lateral color, the first a thousandth of the place in the frame.
            for (found, wanted) in warp[6..10].iter().zip([1.0, -0.1, 0.02, 0.0]) {
                assert_abs_diff_eq!(*found, wanted, epsilon = 1e-3);
            }
            assert_abs_diff_eq!(warp[0], 1.001, epsilon = 1e-4);
            assert_abs_diff_eq!(warp[18], axis[0], epsilon = 1e-3);
            assert_abs_diff_eq!(warp[19], axis[1], epsilon = 1e-3);
        }
    }

    #[test]
    fn what_is_not_radial_is_refused() {
        let mut keystone = tables([0.5, 0.5]);
        keystone.distortion_px[0] =
            FrameTable::tabulate(41, 41, |down, right| 40.0 * (right - 0.5) * (down - 0.5)).unwrap();
        let message = opcode_list_3(&keystone, LensCorrections::ALL, &[0, 1, 2]).unwrap_err().to_string();
        assert!(message.contains("distance from a center"), "{message}");
    }
}
