//! Depth layers: even steps of blur radius, with tent weights between them.

use dioptric_psf::LensImage;
use glam::DVec2;

/// A change of blur radius between neighbors that counts as an edge of depth, pixels.
pub(crate) const DEPTH_EDGE_PX: f32 = 3.0;
/// Blur radius up to which something is in focus, pixels: what a point becomes is aberrations and pixels then.
pub(crate) const IN_FOCUS_PX: f32 = 1.0;

/// The depths at which the scene is blurred, nearest first.
///
/// The blur of a point is proportional to the difference of its dioptres from those of the focus, so layers evenly
/// spaced in dioptres are evenly spaced in blur radius. They lie twice as close where anything is nearly in focus,
/// for there a step changes a blur the most. A sample between two layers belongs to both in proportion.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    // Invariant: at least one layer, in strictly descending order of dioptres.
    dioptres: Vec<f64>,
    radius_px: Vec<f64>,
    px_per_dioptre: f64,
}

/// The blur of a lens on a film, sampled over the field and the bands.
pub(crate) struct Blurs<'a> {
    pub(crate) lens: &'a dyn LensImage,
    pub(crate) pitch_mm: f64,
    /// A few points from end to end of the film, mm.
    pub(crate) places_mm: &'a [DVec2],
    pub(crate) wavelengths_nm: &'a [f64],
}

impl Blurs<'_> {
    /// The points at a band, with its wavelength.
    fn samples(&self, band: usize) -> impl Iterator<Item = (DVec2, f64)> {
        let wavelength_nm = self.wavelengths_nm[band];
        self.places_mm.iter().map(move |&place_mm| (place_mm, wavelength_nm))
    }

    fn blur_px(&self, (place_mm, wavelength_nm): (DVec2, f64), dioptres: f64) -> f64 {
        self.lens.blur_radius_mm(place_mm, dioptres, wavelength_nm) / self.pitch_mm
    }

    fn spread_px(&self, (place_mm, wavelength_nm): (DVec2, f64), dioptres: f64) -> f64 {
        self.lens.spread_mm(place_mm, dioptres, wavelength_nm) / self.pitch_mm
    }
}

/// A change of blur over the whole scene that is not worth two layers, pixels.
const NEGLIGIBLE_PX: f64 = 0.02;
/// Blur radius up to which layers lie twice as close, pixels.
const NEAR_FOCUS_PX: f64 = 4.0;

impl Layers {
    /// Lays layers over a range of dioptres (farthest, nearest), at most `step_px` of blur radius apart.
    pub(crate) fn over(range: (f64, f64), step_px: f64, lens: &Blurs<'_>) -> Self {
        let last = lens.wavelengths_nm.len() - 1;
        let samples: Vec<(DVec2, f64)> = [0, last / 2, last].into_iter().flat_map(|band| lens.samples(band)).collect();
        let blur_px = |sample: &(DVec2, f64), dioptres: f64| lens.blur_px(*sample, dioptres);
        let change_px = samples.iter().map(|s| (blur_px(s, range.1) - blur_px(s, range.0)).abs()).fold(0.0, f64::max);
        let mut dioptres = vec![0.5 * (range.0 + range.1)];
        let mut px_per_dioptre = 0.0;
        if change_px > NEGLIGIBLE_PX {
            px_per_dioptre = change_px / (range.1 - range.0);
            // Blur is linear in dioptres, so the line through the ends crosses 0 at the focus.
            let focus = |s: &(DVec2, f64)| {
                let (far, near) = (blur_px(s, range.0), blur_px(s, range.1));
                range.0 + (range.1 - range.0) * far / (far - near)
            };
            let (low, high) = samples
                .iter()
                .map(focus)
                .filter(|d| d.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), d| (low.min(d), high.max(d)));
            let margin = NEAR_FOCUS_PX / px_per_dioptre;
            let in_focus = if low.is_finite() { (low - margin, high + margin) } else { range };
            let (low, high) = ((low - margin).clamp(range.0, range.1), (high + margin).clamp(range.0, range.1));
            dioptres = vec![range.1];
            for (end, step_px) in [(high, step_px), (low, 0.5 * step_px), (range.0, step_px)] {
                let start = dioptres[dioptres.len() - 1];
                dioptres.extend(steps(start, end, in_focus, (px_per_dioptre, step_px)));
            }
            let last = dioptres.len() - 1;
            dioptres[last] = range.0;
        }
        let radius_px =
            dioptres.iter().map(|&d| samples.iter().map(|s| lens.spread_px(*s, d)).fold(0.0, f64::max)).collect();
        Self { dioptres, radius_px, px_per_dioptre }
    }

    /// Returns the bands at which PSFs are computed: first, last, and enough between them that the blur radius changes
    /// by at most `step_px` from one to the next, all over the film and the depths. The bands next to a wavelength between which and the next one
    /// the lens interpolates are among them.
    pub(crate) fn chromatic_knots(&self, step_px: f64, lens: &Blurs<'_>) -> Vec<usize> {
        let ends = [self.dioptres[0], self.dioptres[self.len() - 1]];
        let blurs = |band: usize| -> Vec<f64> {
            lens.samples(band).flat_map(|sample| ends.map(|d| lens.blur_px(sample, d))).collect()
        };
        let all: Vec<Vec<f64>> = (0..lens.wavelengths_nm.len()).map(blurs).collect();
        let is_far = |(a, b): (&f64, &f64)| (a - b).abs() > step_px;
        let nearest = |nm: &f64| {
            let off = |band: &usize| (lens.wavelengths_nm[*band] - nm).abs();
            (0..all.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        let known: Vec<usize> = lens.lens.known_wavelengths_nm().iter().filter_map(nearest).collect();
        let mut knots = vec![0];
        for band in 1..all.len() {
            if known.contains(&(band - 1)) && knots[knots.len() - 1] != band - 1 {
                knots.push(band - 1);
            }
            let last = knots[knots.len() - 1];
            // A blur may come back to what it was, so every band on the way counts.
            if band - last > 1 && (last + 1..=band).any(|between| all[last].iter().zip(&all[between]).any(is_far)) {
                knots.push(band - 1);
            }
        }
        if all.len() > 1 {
            knots.push(all.len() - 1);
        }
        knots
    }

    pub(crate) fn len(&self) -> usize {
        self.dioptres.len()
    }

    /// The dioptres of each layer, nearest first.
    pub(crate) fn dioptres(&self) -> &[f64] {
        &self.dioptres
    }

    /// Returns how far behind the nearest layer a depth lies, in pixels of blur radius.
    pub(crate) fn distance_px(&self, depth_m: f32) -> f32 {
        ((self.dioptres[0] - 1.0 / f64::from(depth_m)) * self.px_per_dioptre) as f32
    }

    /// Returns the layer coordinate of a depth: 0 at the nearest, 1 at the next.
    pub(crate) fn coordinate_of(&self, depth_m: f32) -> f32 {
        self.coordinate_at(1.0 / f64::from(depth_m))
    }

    /// Returns the layer coordinate of a distance behind the nearest layer, in pixels of blur radius.
    pub(crate) fn coordinate_of_distance(&self, distance_px: f32) -> f32 {
        self.coordinate_at(self.dioptres[0] - f64::from(distance_px) / self.px_per_dioptre)
    }

    fn coordinate_at(&self, dioptres: f64) -> f32 {
        let last = self.len() - 1;
        let above = self.dioptres.partition_point(|&d| d > dioptres);
        if above == 0 || last == 0 {
            return 0.0;
        }
        if above > last {
            return last as f32;
        }
        let (near, far) = (self.dioptres[above - 1], self.dioptres[above]);
        ((above - 1) as f64 + (near - dioptres) / (near - far)) as f32
    }

    /// Returns the layer that a coordinate lies in, or behind, and its dioptres.
    pub(crate) fn layer_and_dioptres_at(&self, coordinate: f32) -> (usize, f64) {
        let below = (coordinate as usize).min(self.len() - 1);
        let above = (below + 1).min(self.len() - 1);
        let fraction = f64::from(coordinate) - below as f64;
        (below, self.dioptres[below] + fraction * (self.dioptres[above] - self.dioptres[below]))
    }

    /// Returns the largest blur radius of the samples at a layer coordinate, pixels.
    pub(crate) fn radius_px_at(&self, coordinate: f32) -> f64 {
        let below = (coordinate as usize).min(self.len() - 1);
        let above = (below + 1).min(self.len() - 1);
        f64::max(self.radius_px[below], self.radius_px[above])
    }
}

/// A step of blur radius between layers, as a share of it, that does no more harm than the step of a small blur.
const STEP_OF_RADIUS: f64 = 0.06;

/// Returns the dioptres of layers from `start` (left out) to `end`: evenly in blur radius, in steps of at most `step_px`, while
/// the blur is small, in steps in proportion to its radius where it is wide. `focus` is the range where anything is nearly in focus.
fn steps(start: f64, end: f64, focus: (f64, f64), (px_per_dioptre, step_px): (f64, f64)) -> Vec<f64> {
    let wide_px = step_px / STEP_OF_RADIUS;
    // The number of steps from focus to a blur, with its sign: linear, then logarithmic with the same slope.
    let steps_to = |dioptres: f64| {
        let beyond = (dioptres - focus.1).max(0.0) - (focus.0 - dioptres).max(0.0);
        let blur_px = beyond.abs() * px_per_dioptre;
        let n = if blur_px <= wide_px { blur_px } else { wide_px * (1.0 + (blur_px / wide_px).ln()) } / step_px;
        n.copysign(beyond)
    };
    let blur_after = |n: f64| {
        let px = n * step_px;
        if px <= wide_px { px } else { wide_px * (px / wide_px - 1.0).exp() }
    };
    let (first, last) = (steps_to(start), steps_to(end));
    if first == last {
        // Within the range in focus.
        let n_steps = ((start - end) * px_per_dioptre / step_px - 1e-6).ceil().max(0.0) as usize;
        return (1..=n_steps).map(|i| start + (end - start) * i as f64 / n_steps as f64).collect();
    }
    let n_steps = ((first - last) - 1e-6).ceil().max(1.0) as usize;
    let at = |i: usize| {
        let n = first + (last - first) * i as f64 / n_steps as f64;
        let beyond = blur_after(n.abs()) / px_per_dioptre;
        if n > 0.0 { focus.1 + beyond } else { focus.0 - beyond }
    };
    (1..n_steps).map(at).chain([end]).collect()
}

/// Returns the share of a sample at a layer coordinate that belongs to a layer; 0 where there is no sample (NaN).
#[inline]
pub(crate) fn tent(coordinate: f32, layer: f32) -> f32 {
    (1.0 - (coordinate - layer).abs()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DiscLens;

    const PLACES_MM: [DVec2; 3] = [DVec2::ZERO, DVec2::new(0.05, 0.0), DVec2::new(0.1, 0.0)];

    fn layers(range: (f64, f64), step_px: f64) -> Layers {
        let kernels = DiscLens { focus_dioptres: 10.0, ..DiscLens::default() };
        let lens = Blurs { lens: &kernels, pitch_mm: 1e-3, places_mm: &PLACES_MM, wavelengths_nm: &[550.0] };
        Layers::over(range, step_px, &lens)
    }

    #[test]
    fn bands_share_psfs_only_while_the_blur_stays() {
        let lens = DiscLens { focus_dioptres: 10.0, axial_per_nm: 0.002, ..DiscLens::default() };
        let wavelengths_nm: Vec<f64> = (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
        let lens = Blurs { lens: &lens, pitch_mm: 1e-3, places_mm: &PLACES_MM, wavelengths_nm: &wavelengths_nm };
        let layers = Layers::over((5.0, 12.0), 2.0, &lens);
        // 0.02 pixels a band: 12 bands make 0.24 pixels.
        assert_eq!(layers.chromatic_knots(0.25, &lens), [0, 12, 24, 30]);
        assert_eq!(layers.chromatic_knots(0.0, &lens), (0..31).collect::<Vec<_>>());
    }

    #[test]
    fn layers_reach_both_ends_in_steps_no_larger_than_asked() {
        let layers = layers((2.0, 25.0), 2.0);
        let dioptres = layers.dioptres();
        let last = layers.len() - 1;
        assert_eq!((dioptres[0], dioptres[last]), (25.0, 2.0));
        for pair in dioptres.windows(2) {
            let step_px = if pair[0] > 14.0 + 1e-9 || pair[1] < 6.0 - 1e-9 { 2.0 } else { 1.0 };
            assert!(pair[0] > pair[1] && pair[0] - pair[1] <= step_px + 1e-9, "{pair:?}");
        }
        assert_eq!(layers.coordinate_of(1.0 / 25.0), 0.0);
        assert_eq!(layers.coordinate_of(f32::INFINITY), last as f32);
        let place = layers.coordinate_of(1.0 / 9.3);
        let between = dioptres[place as usize]
            + f64::from(place.fract()) * (dioptres[place as usize + 1] - dioptres[place as usize]);
        assert!((between - 9.3).abs() < 1e-5, "{between}");
        assert!((layers.distance_px(1.0 / 9.3) - 15.7).abs() < 1e-4);
        assert!((layers.coordinate_of_distance(15.7) - place).abs() < 1e-4);
    }

    /// Beyond 33 pixels of blur layers lie 6 % apart: thousands of pixels need some tens of layers.
    #[test]
    fn wide_blurs_have_steps_in_proportion() {
        let layers = layers((2.0, 3010.0), 2.0);
        let dioptres = layers.dioptres();
        assert_eq!((dioptres[0], dioptres[layers.len() - 1]), (3010.0, 2.0));
        assert!(layers.len() < 120, "{}", layers.len());
        for pair in dioptres.windows(2) {
            let (step, blur) = (pair[0] - pair[1], (pair[0] - 10.0).max(10.0 - pair[1]));
            assert!(pair[0] > pair[1] && step <= 2.0_f64.max(0.062 * blur) + 1e-9, "{pair:?}");
        }
    }

    #[test]
    fn a_flat_scene_has_one_layer() {
        let layers = layers((5.0, 5.0), 2.0);
        assert_eq!((layers.len(), layers.dioptres()[0], layers.coordinate_of(0.2)), (1, 5.0, 0.0));
    }

    #[test]
    fn weights_of_a_sample_sum_to_one() {
        let layers = layers((2.0, 25.0), 2.0);
        for depth_m in [0.04, 0.05, 0.0833, 0.2, 0.5] {
            let place = layers.coordinate_of(depth_m);
            let sum: f32 = (0..layers.len()).map(|l| tent(place, l as f32)).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
        assert_eq!(tent(f32::NAN, 3.0), 0.0);
    }
}
