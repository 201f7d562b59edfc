//! What of its kernel a point that shines keeps past the edges of nearer surfaces.

use crate::{
    ray::Rays,
    sight::{Before, Lanes, Met, RAYS, Sight, widest_px},
};

/// A point, as the surfaces before it hide it.
pub(crate) struct HiddenPoint {
    /// The layer that it lies in or behind, and its depth.
    pub(crate) layer: usize,
    pub(crate) dioptres: f64,
    /// The first surface where it lies, if it lies behind that.
    pub(crate) before: Option<Before>,
    /// Pixels below and to the right of the film's middle, and how wide it is, pixels.
    pub(crate) place_px: (f32, f32),
    pub(crate) width_px: f32,
    /// What aberrations and diffraction make of it in focus, pixels.
    pub(crate) unclear_px: f32,
}

/// The parts of a pupil that see a point, on squares over it.
pub(crate) struct OpenPupil {
    /// Squares along a diameter.
    side: usize,
    parts: Vec<f32>,
    /// Where light through the rim meets the film, pixels beside the point; negative on the other side.
    radius_px: f32,
}

/// Squares along the radius of a pupil: half a pixel wide on the film and on the surfaces before the point, but no fewer and no more than so many.
const SQUARES: (f32, f32) = (8.0, 32.0);

impl OpenPupil {
    /// Draws rays from a point through all of a pupil, past the layers that they may meet.
    ///
    /// The ray through w, in radii of the pupil, meets the film at x = s − ρ w and passes layer i at q = s + (`ρ_i` − ρ) w, with ρ the blur radius of the point and s its
    /// place (docs/forward.md 5).
    pub(crate) fn of(sight: &Sight, met: &[Met], point: &HiddenPoint) -> Self {
        let pixel = sight.pixel_at(point.place_px);
        let radius_px = sight.radius_px_of(point.dioptres, pixel);
        let parallax_px = met.iter().filter(|met| met.layer < point.layer).map(|met| (met.radius_px - radius_px).abs());
        let reach_px = parallax_px.fold(radius_px.abs(), f32::max);
        let side = 2 * (2.0 * reach_px).clamp(SQUARES.0, SQUARES.1).ceil() as usize;
        let farthest_px = widest_px(met);
        let surfaces = sight.surfaces();
        let before_px = point.before.as_ref().map_or(0.0, |before| sight.radius_px_of(before.dioptres, pixel));
        let place = |number: usize, within: f32| (number as f32 + 0.5 + within) * (2.0 / side as f32) - 1.0;
        let (mut seen, mut all) = (Vec::with_capacity(side * side), Vec::with_capacity(side * side));
        for first in (0..side * side).step_by(RAYS) {
            let (mut positions, mut ways, mut weights) = ([[0.0; RAYS]; 2], [[0.0; RAYS]; 2], [0.0; RAYS]);
            for (ray, square) in (first..side * side).take(RAYS).enumerate() {
                // All over its square and over a wide point: rays in rows and columns would meet an edge along them all at once (Roberts's sequences in four dimensions).
                let within = [0.856_674_9, 0.733_891_8, 0.628_706_7, 0.538_597_2];
                let within = within.map(|step: f64| (square as f64 * step).fract() as f32 - 0.5);
                let (down, across) = (place(square / side, within[0]), place(square % side, within[1]));
                // Beyond the rim, what it sees goes on: where nothing else lies near, that is all there is.
                let beyond = down.hypot(across).max(1.0);
                weights[ray] = if beyond > 1.0 { 1e-3 } else { 1.0 };
                let through = (down / beyond, across / beyond);
                let from = (
                    point.place_px.0 + within[2] * point.width_px - radius_px * through.0,
                    point.place_px.1 + within[3] * point.width_px - radius_px * through.1,
                );
                let position = sight.position_at(from);
                let per_px = sight.per_px(from, position, through, farthest_px);
                (0..2).for_each(|axis| (positions[axis][ray], ways[axis][ray]) = (position[axis], per_px[axis]));
            }
            let are_hidden = Self::are_hidden(Rays::new(surfaces, positions, ways), (point, met), before_px);
            let n = RAYS.min(side * side - first);
            all.extend_from_slice(&weights[..n]);
            seen.extend(
                weights.iter().zip(are_hidden).take(n).map(|(weight, hidden)| if hidden { 0.0 } else { *weight }),
            );
        }
        // Aberrations and diffraction bring light of other parts of the pupil: in focus that of all.
        let mixed = (0.5 * side as f32 * point.unclear_px / radius_px.abs().max(1e-6)).min(100.0 * side as f32);
        let (seen, all) = (smoothed(&seen, side, mixed), smoothed(&all, side, mixed));
        Self { side, parts: seen.iter().zip(&all).map(|(seen, all)| seen / all).collect(), radius_px }
    }

    /// Which rays through the pupil end before they come to a point past the layers that they may meet; `before_px` is the blur radius of the surface before that.
    fn are_hidden(rays: Rays<'_>, (point, met): (&HiddenPoint, &[Met]), before_px: f32) -> [bool; RAYS] {
        // The surface that it lies behind may also be where a ray passes its depth.
        let is_own = |surface: f32| point.before.is_some_and(|before| (surface - before.coordinate).abs() <= 0.5);
        let own: [Lanes; 2] = rays.surfaces_at(before_px);
        let arrive = rays.arrive(point.layer, met);
        std::array::from_fn(|ray| is_own(own[0][ray]) || is_own(own[1][ray]) || !arrive[ray])
    }

    /// Returns the part of the light so many pixels below and to the right of the point that is seen.
    pub(crate) fn part_at(&self, below_px: f64, beside_px: f64) -> f64 {
        let (down, across) = (-below_px as f32 / self.radius_px, -beside_px as f32 / self.radius_px);
        let beyond = down.hypot(across).max(1.0);
        let split = |place: f32| {
            let squares = (0.5 * (place / beyond + 1.0) * self.side as f32 - 0.5).clamp(0.0, (self.side - 1) as f32);
            let below = (squares as usize).min(self.side - 2);
            (below, squares - below as f32)
        };
        if !(down.is_finite() && across.is_finite()) {
            return f64::from(self.parts[(self.side / 2) * (self.side + 1)]);
        }
        let ((row, down), (column, across)) = (split(down), split(across));
        let along = |row: usize| {
            let parts = &self.parts[row * self.side + column..][..2];
            parts[0] + across * (parts[1] - parts[0])
        };
        f64::from(along(row) + down * (along(row + 1) - along(row)))
    }
}

/// Returns means over neighbors, weighted by tents of half a width of so many squares each way.
fn smoothed(values: &[f32], side: usize, squares: f32) -> Vec<f32> {
    let reach = squares.ceil() as usize;
    let taps: Vec<f32> = (0..=reach).map(|k| 1.0 - k as f32 / squares.max(1.0)).take_while(|tap| *tap > 0.0).collect();
    let across = |values: &[f32]| -> Vec<f32> {
        let sum = |index: usize| {
            let (row, column) = (index / side, index % side);
            let line = &values[row * side..][..side];
            let first = column.saturating_sub(taps.len() - 1);
            let near = line.iter().enumerate().skip(first).take(column + taps.len() - first);
            near.map(|(at, value)| taps[at.abs_diff(column)] * value).sum()
        };
        // Turned about, so that twice is rows and columns.
        (0..side * side).map(|index| sum(index % side * side + index / side)).collect()
    };
    across(&across(values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_wide_tents_are_alike_everywhere() {
        let mut values = vec![0.0; 64];
        values[11] = 1.0;
        let ones = vec![1.0; 64];
        let near = smoothed(&values, 8, 0.5);
        assert_eq!(near, values);
        let wide: Vec<f32> =
            smoothed(&values, 8, 1e4).iter().zip(&smoothed(&ones, 8, 1e4)).map(|(part, all)| part / all).collect();
        assert!(wide.iter().all(|part| (part - 1.0 / 64.0).abs() < 1e-3 / 64.0), "{wide:?}");
    }
}
