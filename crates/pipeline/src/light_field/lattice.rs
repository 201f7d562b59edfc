//! The lattice of an array, found in a white picture.
//!
//! Behind an element at c lies the image of the pupil about s = c + (c − p) g/Z, so that a white picture repeats by the lattice of the
//! array, wider by 1 + g/Z. Of a picture that repeats by a lattice from s₀ on, the component at a vector k of the reciprocal lattice is
//! F(k) exp(i k·(x − s₀)), with F real and above 0 for discs that are not wider than the pitch. Its phase, taken over windows all over the film at
//! the k that is expected, is a plane: its slope is what k is wrong by, and its value in the middle of the film gives s₀.

use std::f64::consts::{PI, TAU};

use dioptric_backward::{MicroArray, MicroLayout};
use dioptric_optics::glam::{DMat2, DVec2};
use ndarray::Array2;

use super::decode::{ArrayFilm, Decoding};
use crate::PipelineError;

/// Elements along each side of a window.
const WINDOW: f64 = 8.0;
/// Each time with what was found before.
const ROUNDS: usize = 4;
/// The share of a window that is darker than what is bright.
const BRIGHT: f64 = 0.8;
/// The least agreement of windows, 0 to 1, of a lattice that is there.
const AGREEMENT: f64 = 0.5;

/// Returns the array with the pitch, turn and offset that a white picture shows; they may differ from what is expected by a tenth of the pitch
/// and 5 degrees.
///
/// # Errors
/// When the film is not that of the picture, holds less than three windows each way, or the picture shows no such lattice.
pub(crate) fn fitted(decoding: &Decoding<'_>, white: &Array2<f32>) -> Result<MicroArray, PipelineError> {
    let (film, array) = (decoding.film, decoding.array);
    let wrong = |reason: String| PipelineError::Unsuitable { what: "the white picture", reason };
    if white.dim() != (film.rows, film.columns) {
        let (rows, columns) = white.dim();
        let (own_columns, own_rows) = (film.columns, film.rows);
        return Err(wrong(format!("has {columns} × {rows} pixels, expected the film's {own_columns} × {own_rows}")));
    }
    let share = decoding.pupil_share()?;
    let window_px = (WINDOW * array.pitch_mm * (1.0 + share) / film.pitch_mm).round() as usize;
    if 2 * window_px > film.rows.min(film.columns) || window_px < 2 * WINDOW as usize {
        return Err(wrong(format!(
            "has {} × {} pixels, expected 16 elements of the array each way and two pixels an element at least",
            film.columns, film.rows
        )));
    }
    let axis_mm = DVec2::from(film.exit_pupil_axis_mm);
    let mut found = array;
    for _ in 0..ROUNDS {
        let vectors = reciprocal(&found, 1.0 + share);
        let fits: Vec<Fit> = vectors.iter().map(|k| Fit::of(white, film, *k, window_px)).collect();
        if let Some(fit) = fits.iter().find(|fit| fit.agreement.is_nan() || fit.agreement < AGREEMENT) {
            return Err(wrong(format!(
                "shows no array of a pitch of {} µm, turned by {}°: its parts agree by {:.2}, expected {AGREEMENT} at least",
                1e3 * array.pitch_mm,
                array.turned_deg,
                fit.agreement
            )));
        }
        // One turn and one scale for all: a complex factor on k.
        let factor = |(fit, k): (&Fit, &DVec2)| DVec2::new(k.dot(fit.k), k.perp_dot(fit.k)) / k.length_squared();
        let mean = fits.iter().zip(&vectors).map(factor).sum::<DVec2>() / fits.len() as f64;
        found.pitch_mm /= mean.length();
        found.turned_deg += mean.to_angle().to_degrees();
        // The phase in the middle is −k·s₀.
        let matrix = DMat2::from_cols(fits[0].k, fits[1].k).transpose();
        let origin_mm = matrix.inverse() * -DVec2::new(fits[0].phase, fits[1].phase);
        found.offset_mm = ((origin_mm + axis_mm * share) / (1.0 + share)).into();
    }
    // Of all elements the one that is nearest to where it was expected.
    let basis = basis_mm(&found);
    let apart_mm = DVec2::from(array.offset_mm) - DVec2::from(found.offset_mm);
    let cells = (basis.inverse() * apart_mm).round();
    found.offset_mm = (DVec2::from(found.offset_mm) + basis * cells).into();
    Ok(found)
}

/// The steps from an element to two neighbors, as columns, mm.
fn basis_mm(array: &MicroArray) -> DMat2 {
    let across = match array.layout {
        MicroLayout::Square => DVec2::Y,
        MicroLayout::Hexagonal => DVec2::new(0.5, array.layout.row_step()),
    };
    DMat2::from_angle(array.turned_deg.to_radians()) * DMat2::from_cols(DVec2::X, across) * array.pitch_mm
}

/// Returns the shortest vectors of the reciprocal lattice, 1/mm, of the array as wide as this on the film: two of a square, three of a hexagonal one.
fn reciprocal(array: &MicroArray, width: f64) -> Vec<DVec2> {
    let dual = TAU * (basis_mm(array) * width).inverse().transpose();
    let (a, b) = (dual.x_axis, dual.y_axis);
    match array.layout {
        MicroLayout::Square => vec![a, b],
        MicroLayout::Hexagonal => vec![a, b, a + b],
    }
}

/// What a picture has near a wave.
struct Fit {
    /// The wave that it has, 1/mm.
    k: DVec2,
    /// Its phase in the middle of the film.
    phase: f64,
    /// The length of the mean over windows as a share of the mean length.
    agreement: f64,
}

impl Fit {
    fn of(white: &Array2<f32>, film: &ArrayFilm, k: DVec2, window_px: usize) -> Self {
        let step_px = window_px / 2;
        let starts = |n: usize| (0..).map(move |i| i * step_px).take_while(move |start| start + window_px <= n);
        let (rows, columns): (Vec<usize>, Vec<usize>) = (starts(film.rows).collect(), starts(film.columns).collect());
        let hann: Vec<f64> = (0..window_px).map(|i| (PI * (i as f64 + 0.5) / window_px as f64).sin().powi(2)).collect();
        let total: f64 = hann.iter().sum::<f64>().powi(2);
        // The component of each window, its phase counted from the middle of the film.
        let window = |top: usize, left: usize| {
            let places = || (0..window_px).flat_map(|r| (0..window_px).map(move |c| (r, c)));
            // Above half of what is bright all counts the same, so that discs that are shaded to a side are not seen beside their middle.
            let mut bright: Vec<f32> = places().map(|(r, c)| white[(top + r, left + c)]).collect();
            let at = (BRIGHT * bright.len() as f64) as usize;
            let half = 0.5 * *bright.select_nth_unstable_by(at, f32::total_cmp).1;
            let value = |(r, c): (usize, usize)| f64::from(white[(top + r, left + c)].min(half));
            let mean = places().map(|(r, c)| hann[r] * hann[c] * value((r, c))).sum::<f64>() / total;
            places()
                .map(|(r, c)| {
                    let phase = k.dot(film.place_mm(top + r, left + c));
                    hann[r] * hann[c] * (value((r, c)) - mean) * DVec2::from_angle(-phase)
                })
                .sum::<DVec2>()
        };
        let parts = Array2::from_shape_fn((rows.len(), columns.len()), |(i, j)| window(rows[i], columns[j]));
        // What k is wrong by turns the phase from each window to the next.
        let turned = |down: usize, right: usize| {
            let sum: DVec2 = parts
                .indexed_iter()
                .filter_map(|((i, j), part)| Some(conjugate(*part).rotate(*parts.get((i + down, j + right))?)))
                .sum();
            sum.to_angle()
        };
        let step_mm = film.pitch_mm * step_px as f64;
        let slope = DVec2::new(turned(0, 1), -turned(1, 0)) / step_mm;
        let middle = 0.5 * (window_px as f64 - 1.0);
        let place_mm =
            |i: usize, j: usize| film.place_mm(rows[i], columns[j]) + film.pitch_mm * DVec2::new(middle, -middle);
        let straightened =
            |((i, j), part): ((usize, usize), &DVec2)| DVec2::from_angle(-slope.dot(place_mm(i, j))).rotate(*part);
        let sum: DVec2 = parts.indexed_iter().map(straightened).sum();
        let length: f64 = parts.iter().map(|part| part.length()).sum();
        Self { k: k + slope, phase: sum.to_angle(), agreement: sum.length() / length }
    }
}

fn conjugate(v: DVec2) -> DVec2 {
    DVec2::new(v.x, -v.y)
}
