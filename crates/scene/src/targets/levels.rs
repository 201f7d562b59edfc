//! Patterns of grays: waves, lines, ramps, letters, noise.

use std::f64::consts::TAU;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Pattern, Target, Wave, pattern::sample_points};
use crate::SceneError;

/// Letters that a target may have: more would be written beyond any of its edges.
const MOST_LETTERS: usize = 1000;

/// Returns what each sample reflects, as a share of white: the mean over its square.
///
/// Waves are integrated exactly over it, but for those of a Gabor patch, a sweep and a zone plate, which are looked up at the points of
/// the target's supersampling.
pub(super) fn reflectance(target: &Target) -> Array2<f64> {
    let (rows, columns) = (target.rows, target.columns);
    match &target.pattern {
        Pattern::Harmonics { waves } => Array2::from_shape_fn((rows, columns), |(row, column)| {
            let (y, x) = from_center(target, row as f64, column as f64);
            0.5 + 0.5 * waves.iter().map(|wave| averaged(wave, columns, y, x)).sum::<f64>()
        }),
        Pattern::Noise { cell_px, contrast, seed } => {
            let mut random = ChaCha8Rng::seed_from_u64(*seed);
            let size = (rows.div_ceil(*cell_px), columns.div_ceil(*cell_px));
            let cells = Array2::from_shape_simple_fn(size, || 0.5 + contrast * (random.random::<f64>() - 0.5));
            Array2::from_shape_fn((rows, columns), |(row, column)| cells[(row / cell_px, column / cell_px)])
        }
        Pattern::Letters { text, height_px } => letters(text, *height_px, rows, columns),
        _ => Array2::from_shape_fn((rows, columns), |(row, column)| {
            let n = target.supersampling;
            let points = sample_points(n, row, column);
            let sum: f64 = points
                .map(|(row, column)| {
                    let (y, x) = from_center(target, row, column);
                    level(target, y, x)
                })
                .sum();
            sum / (n * n) as f64
        }),
    }
}

/// Returns how far a place lies below and to the right of the center, in samples.
fn from_center(target: &Target, row: f64, column: f64) -> (f64, f64) {
    (row - 0.5 * (target.rows as f64 - 1.0), column - 0.5 * (target.columns as f64 - 1.0))
}

/// Returns how far a place lies across stripes of this direction.
fn across(angle_deg: f64, y: f64, x: f64) -> f64 {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    x * cos + y * sin
}

/// Returns the mean of a wave over the square of a sample, times its contrast.
fn averaged(wave: &Wave, columns: usize, y: f64, x: f64) -> f64 {
    let turns = TAU * wave.cycles / columns as f64;
    let (sin, cos) = wave.angle_deg.to_radians().sin_cos();
    let sinc = |half: f64| if half == 0.0 { 1.0 } else { half.sin() / half };
    let blur = sinc(0.5 * turns * cos) * sinc(0.5 * turns * sin);
    wave.contrast * blur * (turns * across(wave.angle_deg, y, x) + wave.phase_deg.to_radians()).cos()
}

/// Returns the share of white at a point.
fn level(target: &Target, y: f64, x: f64) -> f64 {
    let width = target.columns as f64;
    let on_line = |at: f64, spacing: f64, line: f64| {
        let from_line = (at + 0.5 * spacing).rem_euclid(spacing) - 0.5 * spacing;
        from_line.abs() <= 0.5 * line
    };
    // From the left edge, 0 to 1.
    let along = (x / width + 0.5).clamp(0.0, 1.0);
    match target.pattern {
        Pattern::Gabor { wave, sigma } => {
            let window = (-0.5 * (x * x + y * y) / (sigma * width).powi(2)).exp();
            let phase = TAU * wave.cycles / width * across(wave.angle_deg, y, x) + wave.phase_deg.to_radians();
            0.5 + 0.5 * wave.contrast * window * phase.cos()
        }
        Pattern::Lines { spacing_px, width_px, angle_deg } => {
            f64::from(on_line(across(angle_deg, y, x), spacing_px, width_px))
        }
        Pattern::Grid { spacing_px, width_px } => {
            f64::from(on_line(x, spacing_px, width_px) || on_line(y, spacing_px, width_px))
        }
        Pattern::Sweep { first_cycles, last_cycles, contrast } => {
            // The integral of first · (last / first)^t.
            let growth = (last_cycles / first_cycles).ln();
            let cycles = if growth.abs() < 1e-9 { along } else { (growth * along).exp_m1() / growth };
            0.5 + 0.5 * contrast * (TAU * first_cycles * cycles).cos()
        }
        Pattern::ZonePlate { edge_cycles, contrast } => {
            // The frequency is the derivative of the phase: edge_cycles / width at half a width.
            let cycles = edge_cycles * (x * x + y * y) / (width * width);
            0.5 + 0.5 * contrast * (TAU * cycles).cos()
        }
        Pattern::Ramp { steps, ratio } => {
            let at = match steps {
                0 => along,
                1 => 1.0,
                n => (along * n as f64).floor().min(n as f64 - 1.0) / (n as f64 - 1.0),
            };
            match ratio {
                None => at,
                Some(ratio) => ratio.powf(at - 1.0),
            }
        }
        _ => 1.0,
    }
}

/// Returns how much of each sample words about the center cover.
fn letters(text: &str, height_px: f64, rows: usize, columns: usize) -> Array2<f64> {
    let mut cover = Array2::zeros((rows, columns));
    let font = FontRef::try_from_slice(dejavu::sans::regular()).expect("the built-in font is sound");
    // The height of an H says what scale makes capitals as high as wanted.
    let unit = PxScale::from(1000.0);
    let outline = font.outline_glyph(font.glyph_id('H').with_scale(unit));
    let capital = outline.map_or(729.0, |outline| outline.px_bounds().height());
    let scaled = font.as_scaled(PxScale::from(1000.0 * height_px as f32 / capital));
    let mut placed = vec![];
    let (mut x, mut last) = (0.0, None);
    for letter in text.chars() {
        let id = font.glyph_id(letter);
        x += last.replace(id).map_or(0.0, |last| scaled.kern(last, id));
        placed.push((id, x));
        x += scaled.h_advance(id);
    }
    let (left, base) = (0.5 * (columns as f32 - x), 0.5 * (rows as f32 + height_px as f32));
    for (id, at) in placed {
        let glyph = id.with_scale_and_position(scaled.scale(), point(left + at, base));
        let Some(outline) = font.outline_glyph(glyph) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|column, row, share| {
            let (row, column) = (i64::from(row) + corner.y as i64, i64::from(column) + corner.x as i64);
            if (0..rows as i64).contains(&row) && (0..columns as i64).contains(&column) {
                let sample: &mut f64 = &mut cover[(row as usize, column as usize)];
                *sample = (*sample + f64::from(share)).min(1.0);
            }
        });
    }
    cover
}

/// Checks that the numbers of a pattern of grays can be.
pub(super) fn check(pattern: &Pattern) -> Result<(), SceneError> {
    let wrong =
        |what, value: String, expected: &str| Err(SceneError::Setting { what, value, expected: expected.to_owned() });
    let is_share = |contrast: f64| (0.0..=1.0).contains(&contrast);
    let is_wave = |wave: &Wave| {
        let finite = [wave.cycles, wave.phase_deg, wave.angle_deg].iter().all(|v| v.is_finite());
        finite && wave.cycles >= 0.0 && is_share(wave.contrast)
    };
    const WAVES: &str = "cycles of 0 or more, finite angles, contrasts of 0 to 1 that add up to 1 at most";
    match pattern {
        Pattern::Harmonics { waves } => {
            let sum: f64 = waves.iter().map(|wave| wave.contrast).sum();
            if waves.is_empty() || !waves.iter().all(is_wave) || sum > 1.0 + 1e-9 {
                return wrong("the waves of the target", format!("{waves:?}"), WAVES);
            }
        }
        Pattern::Gabor { wave, sigma } => {
            if !is_wave(wave) {
                return wrong("the wave of the target", format!("{wave:?}"), WAVES);
            }
            if !(*sigma > 0.0 && sigma.is_finite()) {
                return wrong("the window of the target", sigma.to_string(), "a share of its width above 0");
            }
        }
        Pattern::Lines { spacing_px, width_px, .. } | Pattern::Grid { spacing_px, width_px } => {
            let angle = if let Pattern::Lines { angle_deg, .. } = pattern { *angle_deg } else { 0.0 };
            if !(*width_px > 0.0 && width_px < spacing_px && spacing_px.is_finite() && angle.is_finite()) {
                let value = format!("{width_px} wide, {spacing_px} apart, at {angle}°");
                return wrong(
                    "the lines of the target",
                    value,
                    "a width above 0 and below the spacing, a finite angle",
                );
            }
        }
        Pattern::Sweep { first_cycles, last_cycles, contrast } => {
            let are_cycles = [first_cycles, last_cycles].iter().all(|v| **v > 0.0 && v.is_finite());
            if !(are_cycles && is_share(*contrast)) {
                let value = format!("{first_cycles} to {last_cycles} cycles of contrast {contrast}");
                return wrong("the sweep of the target", value, "cycles above 0, a contrast of 0 to 1");
            }
        }
        Pattern::ZonePlate { edge_cycles, contrast }
            if !(*edge_cycles > 0.0 && edge_cycles.is_finite() && is_share(*contrast)) =>
        {
            let value = format!("{edge_cycles} cycles of contrast {contrast}");
            return wrong("the zone plate of the target", value, "cycles above 0, a contrast of 0 to 1");
        }
        Pattern::Ramp { ratio: Some(ratio), .. } if !(*ratio > 1.0 && ratio.is_finite()) => {
            return wrong("the ratio of the target's ramp", ratio.to_string(), "a finite number above 1");
        }
        Pattern::Letters { text, height_px } => {
            let n = text.chars().count();
            if n == 0 || n > MOST_LETTERS || text.chars().any(char::is_control) {
                let value = format!("{n} letters");
                return wrong("the words of the target", value, "a line of 1 to 1000 letters");
            }
            if !(*height_px > 0.0 && *height_px <= 1e5) {
                return wrong("the height of the target's letters", height_px.to_string(), "0 to 100000 samples");
            }
        }
        Pattern::Noise { cell_px, contrast, .. } if *cell_px == 0 || !is_share(*contrast) => {
            let value = format!("squares of {cell_px} samples, contrast {contrast}");
            return wrong("the noise of the target", value, "a count above 0, a contrast of 0 to 1");
        }
        _ => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TargetLight;
    use approx::assert_abs_diff_eq;

    fn of(pattern: Pattern) -> Array2<f64> {
        let target =
            Target { rows: 60, columns: 80, supersampling: 4, ..Target { pattern, ..Target::paper_checkerboard() } };
        check(&target.pattern).unwrap();
        let target = Target { light: TargetLight::EqualEnergy, ..target };
        reflectance(&target)
    }

    fn wave(cycles: f64, contrast: f64) -> Wave {
        Wave { cycles, contrast, phase_deg: 0.0, angle_deg: 0.0 }
    }

    /// The share of a row's wave of so many cycles: twice the size of its Fourier coefficient.
    fn amplitude(row: ndarray::ArrayView1<'_, f64>, cycles: f64) -> f64 {
        let n = row.len() as f64;
        let sum =
            |of: fn(f64) -> f64| row.iter().enumerate().map(|(i, v)| v * of(TAU * cycles * i as f64 / n)).sum::<f64>();
        2.0 / n * sum(f64::cos).hypot(sum(f64::sin))
    }

    #[test]
    fn sums_of_waves_have_their_contrasts() {
        let tilted = Wave { angle_deg: 90.0, ..wave(8.0, 0.25) };
        let plane = of(Pattern::Harmonics { waves: vec![wave(4.0, 0.5), wave(10.0, 0.25), tilted] });
        // The mean over a sample lowers a wave by sinc(cycles / samples); the level one, six cycles down, is the same all along a row.
        let lowered = |cycles: f64| (TAU / 2.0 * cycles / 80.0).sin() / (TAU / 2.0 * cycles / 80.0);
        assert_abs_diff_eq!(amplitude(plane.row(7), 4.0), 0.25 * lowered(4.0), epsilon = 1e-12);
        assert_abs_diff_eq!(amplitude(plane.row(7), 10.0), 0.125 * lowered(10.0), epsilon = 1e-12);
        assert_abs_diff_eq!(plane.mean().unwrap(), 0.5, epsilon = 2e-3);
        let too_much = Pattern::Harmonics { waves: vec![wave(4.0, 0.7), wave(5.0, 0.4)] };
        assert!(check(&too_much).is_err());
    }

    #[test]
    fn patch_fades_from_its_center() {
        let plane = of(Pattern::Gabor { wave: wave(8.0, 1.0), sigma: 0.1 });
        assert!(plane[(30, 40)] > 0.9 && plane[(30, 34)] < 0.3);
        assert!(plane.row(0).iter().all(|v| (v - 0.5).abs() < 0.02));
    }

    #[test]
    fn lines_and_grids_cover_their_share() {
        let lines = of(Pattern::Lines { spacing_px: 10.0, width_px: 2.5, angle_deg: 0.0 });
        assert_abs_diff_eq!(lines.mean().unwrap(), 0.25, epsilon = 1e-12);
        let level = of(Pattern::Lines { spacing_px: 10.0, width_px: 2.5, angle_deg: 90.0 });
        assert_eq!(level.column(3), level.column(60));
        let grid = of(Pattern::Grid { spacing_px: 20.0, width_px: 5.0 });
        assert_abs_diff_eq!(grid.mean().unwrap(), 1.0 - 0.75 * 0.75, epsilon = 1e-12);
    }

    #[test]
    fn sweeps_and_zone_plates_have_their_frequencies() {
        // Crossings of gray downwards, from the left edge: phases of a quarter, 1 1/4, ...; the phase at the right edge tells the mean.
        let sweep = of(Pattern::Sweep { first_cycles: 2.0, last_cycles: 8.0, contrast: 1.0 });
        let row = sweep.row(0);
        let n = (1..80).filter(|&i| row[i - 1] > 0.5 && row[i] <= 0.5).count();
        // ∫ 2·4^t dt = 6 / ln 4 = 4.33 cycles.
        assert_eq!(n, 5);
        let plate = of(Pattern::ZonePlate { edge_cycles: 16.0, contrast: 1.0 });
        // The phase at half a width is edge_cycles / 4 cycles.
        let row = plate.row(30);
        let n = (41..80).filter(|&i| row[i - 1] > 0.5 && row[i] <= 0.5).count();
        assert_eq!(n, 4);
    }

    #[test]
    fn ramps_rise_in_steps_and_ratios() {
        let even = of(Pattern::Ramp { steps: 0, ratio: None });
        assert_abs_diff_eq!(even[(3, 20)] - even[(3, 10)], 10.0 / 80.0, epsilon = 1e-12);
        let steps = of(Pattern::Ramp { steps: 5, ratio: Some(16.0) });
        assert_abs_diff_eq!(steps[(0, 2)], 1.0 / 16.0, epsilon = 1e-12);
        assert_abs_diff_eq!(steps[(0, 20)], 1.0 / 8.0, epsilon = 1e-12);
        assert_abs_diff_eq!(steps[(0, 79)], 1.0, epsilon = 1e-12);
    }

    #[test]
    fn letters_are_as_high_as_asked() {
        let plane = of(Pattern::Letters { text: "HI".to_owned(), height_px: 30.0 });
        let covered: Vec<usize> = (0..60).filter(|&row| plane.row(row).iter().any(|v| *v > 0.5)).collect();
        assert!((29..=31).contains(&covered.len()), "{covered:?}");
        assert!((covered[0] as i64 - 15).abs() <= 1);
        assert!(check(&Pattern::Letters { text: String::new(), height_px: 3.0 }).is_err());
    }

    #[test]
    fn noise_is_its_seed_alone() {
        let noise = |seed| of(Pattern::Noise { cell_px: 2, contrast: 0.5, seed });
        assert!(noise(1) == noise(1) && noise(1) != noise(2));
        let plane = noise(3);
        assert!(plane.iter().all(|v| (0.25..=0.75).contains(v)) && plane[(0, 0)] == plane[(1, 1)]);
        // 1200 cells of variance (0.5 / √12)²: four standard errors of the mean are 0.017.
        assert_abs_diff_eq!(plane.mean().unwrap(), 0.5, epsilon = 0.017);
    }
}
