//! Pictures of points, found in a picture.

use ndarray::Array2;

use crate::{SensorError, metering::percentile, regions::regions};

/// Spots darker than this share of the brightest are not looked at.
const FAINTEST: f64 = 0.1;
/// How far a spot stands out of the noise, standard deviations.
const ABOVE_NOISE: f64 = 6.0;
/// The normal standard deviation of a median absolute deviation of 1.
const NORMAL_PER_MAD: f64 = 1.4826;

/// A square about the picture of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointWindow {
    /// The first row.
    pub row: usize,
    /// The first column.
    pub column: usize,
    /// The number of rows and columns; odd, with the point in the middle pixel.
    pub side: usize,
    /// The light between the points: the median of the picture.
    pub background: f64,
}

/// Finds the pictures of points in a plane of linear light, brightest first.
///
/// A point is a region above a tenth of the brightest and above six standard deviations of the noise, all counted from
/// the median. Its window reaches half way to the next point, or to the border, or is `side` pixels wide where asked.
///
/// # Errors
/// When nothing stands out, or a window asked for does not fit about any point.
pub fn find_points(plane: &Array2<f32>, side: Option<usize>) -> Result<Vec<PointWindow>, SensorError> {
    let none = |reason: String| SensorError::Unsuitable { what: "a spot", reason };
    if plane.is_empty() || plane.iter().any(|v| !v.is_finite()) {
        return Err(none("cannot be found in a picture that is empty or not finite".to_owned()));
    }
    let values: Vec<f32> = plane.iter().copied().collect();
    let background = percentile(values.clone(), 50.0);
    let deviations = values.iter().map(|v| (f64::from(*v) - background).abs() as f32).collect();
    let noise = NORMAL_PER_MAD * percentile(deviations, 50.0);
    let brightest = values.iter().fold(0.0, |most: f64, &v| most.max(f64::from(v) - background));
    let threshold = (FAINTEST * brightest).max(ABOVE_NOISE * noise);
    if brightest <= threshold {
        return Err(none("stands out nowhere in the picture".to_owned()));
    }
    let above = |v: f32| f64::from(v) - background;
    let mut points: Vec<(f64, (usize, usize))> = regions(&plane.mapv(|v| above(v) > threshold), true)
        .iter()
        .map(|region| {
            let (mut sum, mut at) = (0.0, (0.0, 0.0));
            for &(r, c) in &region.pixels {
                let light = above(plane[(r, c)]);
                sum += light;
                at = (at.0 + light * r as f64, at.1 + light * c as f64);
            }
            (sum, ((at.0 / sum).round() as usize, (at.1 / sum).round() as usize))
        })
        .collect();
    points.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (rows, columns) = plane.dim();
    let room = |index: usize, (r, c): (usize, usize)| {
        let to_border = r.min(c).min(rows - 1 - r).min(columns - 1 - c);
        let to_others = points.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, (_, at))| {
            // Squares half as wide as the larger of the two distances do not overlap.
            (at.0.abs_diff(r).max(at.1.abs_diff(c)).saturating_sub(1)) / 2
        });
        (to_border, to_others.min().unwrap_or(usize::MAX))
    };
    let window = |(index, &(_, at)): (usize, &(f64, (usize, usize)))| {
        let (to_border, to_others) = room(index, at);
        let half = match side {
            Some(side) if side / 2 <= to_border => side / 2,
            Some(_) => return None,
            None => to_border.min(to_others),
        };
        // Less than three pixels across is no picture of a point.
        (half >= 1).then(|| PointWindow { row: at.0 - half, column: at.1 - half, side: 2 * half + 1, background })
    };
    let windows: Vec<PointWindow> = points.iter().enumerate().filter_map(window).collect();
    if windows.is_empty() {
        return Err(none(match side {
            Some(side) => format!("has no room for a window of {side} pixels before the border"),
            None => "lies nowhere but at the border or against another".to_owned(),
        }));
    }
    Ok(windows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(points: &[(f64, f64, f64)]) -> Array2<f32> {
        Array2::from_shape_fn((60, 80), |(r, c)| {
            let light = points.iter().map(|&(row, column, peak)| {
                peak * (-((r as f64 - row).powi(2) + (c as f64 - column).powi(2)) / 4.0).exp()
            });
            (0.05 + light.sum::<f64>()) as f32
        })
    }

    #[test]
    fn points_are_found_brightest_first_with_windows_that_do_not_overlap() {
        let plane = picture(&[(20.0, 20.0, 0.5), (20.0, 41.0, 1.0), (45.0, 60.0, 0.02)]);
        let found = find_points(&plane, None).unwrap();
        // The third is fainter than a tenth of the brightest.
        assert_eq!(found.len(), 2);
        let middles: Vec<_> = found.iter().map(|w| (w.row + w.side / 2, w.column + w.side / 2)).collect();
        assert_eq!(middles, [(20, 41), (20, 20)]);
        assert!(found[1].column + found[1].side <= found[0].column);
        assert!((found[0].background - 0.05).abs() < 1e-6);
        assert_eq!(find_points(&plane, Some(9)).unwrap()[0].side, 9);
    }

    #[test]
    fn what_is_no_picture_of_points_is_refused() {
        let error = |plane: &Array2<f32>, side| find_points(plane, side).unwrap_err().to_string();
        assert!(error(&Array2::zeros((20, 20)), None).contains("nowhere"));
        assert!(error(&Array2::zeros((0, 0)), None).contains("empty"));
        assert!(error(&picture(&[(5.0, 5.0, 1.0)]), Some(31)).contains("31 pixels"));
    }
}
