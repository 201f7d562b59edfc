//! The share of a cone of light on a pixel that reaches its photodiode.

use super::{
    MicrolensOutline, PixelStack,
    overlap::{Map, mean_overlap_um},
    surface::Surface,
};

/// A cone of light that falls on a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    /// The slope of its chief ray.
    pub(crate) chief: [f64; 2],
    /// The tangent of half its angle on the axis; 0 for collimated light.
    pub(crate) tangent: f64,
}

impl Cone {
    /// Collimated light along the axis.
    pub(crate) const NORMAL: Self = Self { chief: [0.0; 2], tangent: 0.0 };
}

/// Strips of a pupil and cells of each.
const CELLS: usize = 16;
/// The fewest and the most patches that a lens is made of, along each side, and how many for a numerical aperture of 1: a patch changes the
/// direction of light by less than a tenth.
const PATCHES: (usize, usize) = (2, 10);
const PATCHES_OF_WHOLE_APERTURE: f64 = 12.0;
/// Strips that a round lens is made of.
const ROUND_STRIPS: usize = 8;

/// A rectangle of the opening through which light is counted.
#[derive(Clone, Copy, Debug)]
struct Patch {
    /// Its middle, from that of the lens.
    middle_um: [f64; 2],
    half_size_um: [f64; 2],
    surface: Surface,
    /// 1, or −1 where it is taken out of another.
    sign: f64,
}

/// A stack below its opening, ready to count light.
#[derive(Clone, Debug)]
pub(crate) struct PixelOptics<'a> {
    stack: &'a PixelStack,
    area_um2: f64,
    patches: Vec<Patch>,
}

/// Directions of a rectangle of slopes, as direction cosines in air.
struct Directions {
    middle: [f64; 2],
    /// The ends along each axis at the middle of the other.
    ends: [[f64; 2]; 2],
    /// The square of the sine of the middle.
    sine_square: f64,
}

impl Directions {
    fn new(middle: [f64; 2], corners: [[f64; 2]; 2]) -> Self {
        let cosines = |slope: [f64; 2]| slope.map(|s| s / (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt());
        let along = |axis: usize| {
            corners.map(|corner| {
                let mut slope = middle;
                slope[axis] = corner[axis];
                cosines(slope)[axis]
            })
        };
        let middle = cosines(middle);
        Self { middle, ends: [along(0), along(1)], sine_square: middle[0] * middle[0] + middle[1] * middle[1] }
    }
}

impl<'a> PixelOptics<'a> {
    /// Returns the optics of a stack below an opening of this side.
    pub(crate) fn new(stack: &'a PixelStack, opening_um: f64) -> Self {
        let half_um = 0.5 * opening_um;
        let opening = |surface| Patch { middle_um: [0.0; 2], half_size_um: [half_um; 2], surface, sign: 1.0 };
        let patches = match &stack.microlens {
            None => vec![opening(Surface::Flat { sag_um: 0.0 })],
            Some(lens) => {
                let surface = stack.lens_surface(lens.power);
                let in_flat = |half_um, lens| in_flat(opening(surface.flat_at(half_um)), lens);
                match lens.outline {
                    MicrolensOutline::Gapless => square(half_um, surface),
                    MicrolensOutline::SquareUm(um) => in_flat(0.5 * um, square(0.5 * um, surface)),
                    MicrolensOutline::RoundUm(um) => in_flat(0.5 * um, disc(0.5 * um, surface)),
                }
            }
        };
        Self { stack, area_um2: opening_um * opening_um, patches }
    }

    /// Returns the share of the light on the opening that reaches the photodiode, with the microlens shifted (eq. 7).
    pub(crate) fn share(&self, cone: &Cone, shift_um: [f64; 2]) -> f64 {
        if cone.tangent == 0.0 {
            return self.share_of(&Directions::new(cone.chief, [cone.chief; 2]), shift_um);
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        let angle = |edge: f64| std::f64::consts::PI * (edge / CELLS as f64 - 0.5);
        let slopes = |x: f64, y: f64| [cone.chief[0] + cone.tangent * x, cone.chief[1] + cone.tangent * y];
        for strip in 0..CELLS {
            let y = [0.0, 1.0].map(|end| angle(strip as f64 + end).sin());
            let half_chord = angle(strip as f64 + 0.5).cos();
            let x_at = |edge: f64| half_chord * (2.0 * edge / CELLS as f64 - 1.0);
            for cell in 0..CELLS {
                let x = [0.0, 1.0].map(|end| x_at(cell as f64 + end));
                let middle = slopes(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
                let directions = Directions::new(middle, [slopes(x[0], y[0]), slopes(x[1], y[1])]);
                // Of a flat pupil of even radiance, cos⁴ (eq. 6).
                let weight = (x[1] - x[0]) * (y[1] - y[0]) * (1.0 - directions.sine_square).powi(2);
                sum += weight * self.share_of(&directions, shift_um);
                weights += weight;
            }
        }
        sum / weights
    }

    /// Returns the mean share of the light from a rectangle of slopes.
    fn share_of(&self, light: &Directions, shift_um: [f64; 2]) -> f64 {
        let area_um2: f64 = self.patches.iter().map(|patch| self.area_lit_um2(patch, light, shift_um)).sum();
        // Straight lines between patches overlap by a thousandth at steep angles.
        self.stack.transmittance(light.sine_square) * (area_um2 / self.area_um2).min(1.0)
    }

    /// Returns the area of the part of a patch whose light reaches the photodiode, with the patch's sign (eq. 4, 5).
    fn area_lit_um2(&self, patch: &Patch, light: &Directions, shift_um: [f64; 2]) -> f64 {
        let lit = || {
            let bent = patch.surface.bend(patch.middle_um, light.middle)?;
            let fall = self.stack.fall(bent.cosines, bent.sag_um)?;
            let half_um = 0.5 * self.stack.photodiode_um;
            let [right_um, down_um] = [0, 1].map(|i| {
                let middle_um = patch.middle_um[i] + shift_um[i] + fall.displacement_um[i];
                let per_cosine_um = fall.per_cosine_um[i] * bent.by_cosine[i];
                let map = Map {
                    scale: 1.0 + fall.per_cosine_um[i] * bent.by_place_per_um[i]
                        - fall.per_thickness[i] * bent.sag_slope[i],
                    landing_um: light.ends[i].map(|end| middle_um + per_cosine_um * (end - light.middle[i])),
                };
                mean_overlap_um([-patch.half_size_um[i], patch.half_size_um[i]], map, half_um)
            });
            Some(patch.sign * bent.caught * right_um * down_um)
        };
        lit().unwrap_or(0.0)
    }
}

/// Returns how many patches a lens needs along each side for its rays to be straight lines of the place within each.
fn n_patches(half_um: f64, surface: Surface) -> usize {
    let numerical_aperture = match surface {
        Surface::Flat { .. } => 0.0,
        Surface::Thin { power_per_um } => power_per_um * half_um,
        Surface::Sphere { radius_um, index } => (index - 1.0) * half_um / radius_um,
    };
    ((PATCHES_OF_WHOLE_APERTURE * numerical_aperture).ceil() as usize).clamp(PATCHES.0, PATCHES.1)
}

/// Returns a square as patches of the same size.
fn square(half_um: f64, surface: Surface) -> Vec<Patch> {
    let n = n_patches(half_um, surface);
    let half_size_um = half_um / n as f64;
    let middle = |number: usize| half_size_um * (2.0 * number as f64 + 1.0) - half_um;
    let patch = |number: usize| Patch {
        middle_um: [middle(number % n), middle(number / n)],
        half_size_um: [half_size_um; 2],
        surface,
        sign: 1.0,
    };
    (0..n * n).map(patch).collect()
}

/// Returns a disc as patches in strips of the disc's own area.
fn disc(radius_um: f64, surface: Surface) -> Vec<Patch> {
    let n = n_patches(radius_um, surface);
    let angle = |edge: usize| std::f64::consts::PI * (edge as f64 / ROUND_STRIPS as f64 - 0.5);
    // The area below the arc from the middle to the height sin t, of radius 1.
    let area = |t: f64| 0.5 * (t + t.sin() * t.cos());
    let patch = |number: usize| {
        let (low, high) = (angle(number / n), angle(number / n + 1));
        let half_chord_um = radius_um * (area(high) - area(low)) / (high.sin() - low.sin());
        let half_width_um = half_chord_um / n as f64;
        let right_um = half_width_um * (2.0 * (number % n) as f64 + 1.0) - half_chord_um;
        Patch {
            middle_um: [right_um, 0.5 * radius_um * (low.sin() + high.sin())],
            half_size_um: [half_width_um, 0.5 * radius_um * (high.sin() - low.sin())],
            surface,
            sign: 1.0,
        }
    };
    (0..ROUND_STRIPS * n).map(patch).collect()
}

/// Returns the patches of a lens in an opening that is flat beside it.
fn in_flat(opening: Patch, lens: Vec<Patch>) -> Vec<Patch> {
    let without: Vec<Patch> =
        lens.iter().map(|patch| Patch { surface: opening.surface, sign: -1.0, ..*patch }).collect();
    [vec![opening], without, lens].concat()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::pixel_stack::{
        Interfaces, MicrolensPower, MicrolensShift, StackLayer,
        samples::{PITCH_UM, bare, focused, layer, with_lens},
    };

    fn cone(chief_deg: [f64; 2], f_number: f64) -> Cone {
        let tangent = (4.0 * f_number * f_number - 1.0).sqrt().recip();
        Cone { chief: chief_deg.map(|deg| deg.to_radians().tan()), tangent }
    }

    fn share(stack: &PixelStack, cone: &Cone) -> f64 {
        stack.check("test", PITCH_UM, PITCH_UM).unwrap();
        PixelOptics::new(stack, PITCH_UM).share(cone, stack.shift_um([0.0; 2], cone.chief))
    }

    #[test]
    fn without_height_the_fill_factor_is_the_share() {
        let stack = bare(PITCH_UM * 0.45_f64.sqrt(), &[]);
        for light in [Cone::NORMAL, cone([20.0, -7.0], 1.4), cone([0.0, 40.0], f64::INFINITY)] {
            assert_relative_eq!(share(&stack, &light), 0.45, max_relative = 1e-12);
        }
        assert_relative_eq!(
            share(&with_lens(2.0, &[], MicrolensPower::FocalLengthUm(9.0)), &cone([9.0, 9.0], 2.0)),
            0.25,
            max_relative = 1e-12
        );
    }

    /// Catrysse, Liu & El Gamal (2000): the lit part of the floor of a square tunnel as wide as its opening is 1 − h tan θ' / w.
    #[test]
    fn a_tunnel_shades_its_floor() {
        let (height_um, index) = (6.0, 1.46);
        let stack = bare(PITCH_UM, &[layer(height_um, index)]);
        for deg in [0.0_f64, 5.0, 17.0, 35.0, 60.0] {
            let refracted = (deg.to_radians().sin() / index).asin();
            let expected = (1.0 - height_um * refracted.tan() / PITCH_UM).max(0.0);
            assert_relative_eq!(share(&stack, &cone([deg, 0.0], f64::INFINITY)), expected, max_relative = 1e-12);
            assert_relative_eq!(share(&stack, &cone([0.0, -deg], f64::INFINITY)), expected, max_relative = 1e-12);
        }
        // Along a diagonal both walls shade.
        let slope = 20.0_f64.to_radians().tan() * 0.5_f64.sqrt();
        let light = Cone { chief: [slope; 2], tangent: 0.0 };
        let refracted = (20.0_f64.to_radians().sin() / index).asin().tan() * 0.5_f64.sqrt();
        assert_relative_eq!(
            share(&stack, &light),
            (1.0 - height_um * refracted / PITCH_UM).powi(2),
            max_relative = 1e-12
        );
    }

    #[test]
    fn a_spot_within_the_photodiode_is_taken_whole() {
        let stack = focused(2.0, &[layer(2.0, 1.6), layer(12.0, 1.46)]);
        assert_relative_eq!(share(&stack, &cone([0.0; 2], 8.0)), 1.0, max_relative = 1e-12);
        // The same pixel without a lens takes what falls right on it.
        assert_relative_eq!(share(&PixelStack { microlens: None, ..stack }, &Cone::NORMAL), 0.25, max_relative = 1e-12);
    }

    /// In focus the microlens images the exit pupil. Where that covers the photodiode, light comes to it from all of the opening under every
    /// angle, so that its étendue is that of two squares that face each other, ∫∫ cos⁴ / h² over both, whatever the lens.
    #[test]
    fn a_photodiode_within_the_pupil_image_takes_the_etendue_of_two_squares() {
        let (height_um, side_um) = (9.0, 1.4);
        let found = share(&focused(side_um, &[layer(height_um, 1.0)]), &cone([0.0; 2], 2.0));
        const N: usize = 16;
        let at = |side_um: f64, i: usize| side_um * ((i as f64 + 0.5) / N as f64 - 0.5);
        let apart = |i: usize| ((at(PITCH_UM, i % N) - at(side_um, i / N)) / height_um).powi(2);
        let pairs = (0..N.pow(4)).map(|i| (1.0 + apart(i % (N * N)) + apart(i / (N * N))).powi(-2));
        let etendue = side_um.powi(2) * pairs.sum::<f64>() / N.pow(4) as f64 / height_um.powi(2);
        let sine = 0.25_f64;
        // Patches and cells.
        assert_relative_eq!(found, etendue / (std::f64::consts::PI * sine * sine), max_relative = 0.01);
    }

    /// The lens moves rays in phase space but keeps their area (Liouville): over all directions every power takes D / τ of a line.
    #[test]
    fn no_lens_changes_the_etendue() {
        // Deep, so that sines are tangents to .1 %.
        let (height_um, photodiode_um) = (60.0, 1.5);
        let layers = [layer(height_um, 1.0)];
        let powers = [40.0, 60.0, 110.0, 1e6].map(MicrolensPower::FocalLengthUm);
        for power in powers {
            let stack = with_lens(photodiode_um, &layers, power);
            const STEPS: usize = 40_000;
            let slope = |i: usize| 0.4 * (i as f64 + 0.5) / STEPS as f64 - 0.2;
            let of = |chief| PixelOptics::new(&stack, PITCH_UM).share(&Cone { chief, tangent: 0.0 }, [0.0; 2]);
            let sum: f64 = (0..STEPS).map(|i| of([slope(i), 0.0])).sum::<f64>() * 0.4 / STEPS as f64;
            let along_y = of([0.0; 2]).sqrt();
            assert_relative_eq!(sum, along_y * photodiode_um / height_um, max_relative = 3e-3);
        }
    }

    #[test]
    fn no_share_is_above_one_or_the_photodiodes_etendue() {
        let layers = [layer(2.3, 1.6), layer(2.5, 1.46)];
        for power in [MicrolensPower::FocusOnPhotodiode, MicrolensPower::RadiusUm(2.9)] {
            for photodiode_um in [0.5, 1.0, 2.0, 4.0] {
                let stack = with_lens(photodiode_um, &layers, power);
                for f_number in [0.7, 1.0, 1.4, 2.8, 8.0] {
                    let found = share(&stack, &cone([0.0; 2], f_number));
                    // G = area × sin²: no more than the photodiode's in the last layer.
                    let bound = (1.46 * photodiode_um * 2.0 * f_number / PITCH_UM).powi(2);
                    assert!(
                        found > 0.0 && found <= bound.min(1.0 + 1e-12),
                        "{f_number} {photodiode_um}: {found} {bound}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_optimal_shift_gives_the_corner_what_the_center_has() {
        let mut stack = focused(1.6, &[layer(1.0, 1.6), layer(8.0, 1.46)]);
        let plain = stack.clone();
        stack.microlens.as_mut().unwrap().shift = MicrolensShift::Optimal;
        let collimated = |deg: f64| cone([deg, 0.5 * deg], f64::INFINITY);
        // The oblique spot has the coma and the astigmatism of a lens of f/1.5.
        assert_relative_eq!(share(&stack, &collimated(25.0)), share(&stack, &Cone::NORMAL), max_relative = 0.02);
        assert!(share(&plain, &collimated(25.0)) < 0.05);
        // Of a cone: the oblique pupil is foreshortened, so that its image is smaller, by at most cos⁴ 27.6°.
        let [center, corner] = [0.0, 25.0].map(|deg| share(&stack, &cone([deg, 0.5 * deg], 1.8)));
        assert!(corner > center && corner < center / 0.62, "{center} {corner}");
    }

    #[test]
    fn a_lens_of_another_pupil_falls_off_with_height() {
        let mut stack = focused(2.4, &[layer(9.0, 1.5)]);
        stack.microlens.as_mut().unwrap().shift = MicrolensShift::ExitPupilMm(20.0);
        let optics = PixelOptics::new(&stack, PITCH_UM);
        let tangent = cone([0.0; 2], 2.8).tangent;
        // The exit pupil of the lens is a quarter as far.
        let of = |height_mm: f64| {
            let chief = [height_mm / 5.0, 0.0];
            optics.share(&Cone { chief, tangent }, stack.shift_um([height_mm, 0.0], chief))
        };
        let shares: Vec<f64> = (0..12).map(|i| of(0.25 * f64::from(i))).collect();
        assert!(shares.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12), "{shares:?}");
        assert!(shares[0] > 0.97 && shares[11] < 0.1, "{shares:?}");
    }

    #[test]
    fn faster_lenses_lose_more() {
        let stack = focused(1.4, &[layer(9.0, 1.5)]);
        let shares = [8.0, 4.0, 2.8, 2.0, 1.4, 1.0].map(|n| share(&stack, &cone([0.0; 2], n)));
        assert!(shares.windows(2).all(|pair| pair[1] <= pair[0]), "{shares:?}");
        assert!(shares[0] > 0.999 && shares[5] < 0.1, "{shares:?}");
    }

    #[test]
    fn mirrored_and_transposed_light_is_taken_alike() {
        let mut stack = with_lens(1.5, &[layer(9.0, 1.5)], MicrolensPower::FocalLengthUm(7.0));
        for outline in [MicrolensOutline::Gapless, MicrolensOutline::SquareUm(3.2), MicrolensOutline::RoundUm(4.0)] {
            stack.microlens.as_mut().unwrap().outline = outline;
            let of = |chief| share(&stack, &cone(chief, 2.0));
            let first = of([12.0, 3.0]);
            assert_relative_eq!(of([-12.0, 3.0]), first, max_relative = 1e-9);
            assert_relative_eq!(of([12.0, -3.0]), first, max_relative = 1e-9);
            // Strips of pupil and lens lie along x.
            assert_relative_eq!(of([3.0, 12.0]), first, max_relative = 0.01);
        }
    }

    #[test]
    fn a_round_lens_leaves_corners_flat() {
        let mut stack = focused(2.0, &[layer(9.0, 1.5)]);
        stack.microlens.as_mut().unwrap().outline = MicrolensOutline::RoundUm(PITCH_UM);
        // The photodiode lies within the disc, so that nothing of the flat corners reaches it.
        assert_relative_eq!(share(&stack, &cone([0.0; 2], 8.0)), std::f64::consts::FRAC_PI_4, max_relative = 1e-9);
        stack.photodiode_um = PITCH_UM;
        assert_relative_eq!(share(&stack, &Cone::NORMAL), 1.0, max_relative = 1e-9);
        // A lens of next to no power is a flat opening.
        let weak = with_lens(2.0, &[layer(4.0, 1.5)], MicrolensPower::FocalLengthUm(1e9));
        let flat = share(&bare(2.0, &[layer(4.0, 1.5)]), &cone([9.0, 4.0], 2.0));
        for outline in [MicrolensOutline::Gapless, MicrolensOutline::SquareUm(3.0), MicrolensOutline::RoundUm(4.0)] {
            let mut weak = weak.clone();
            weak.microlens.as_mut().unwrap().outline = outline;
            assert_relative_eq!(share(&weak, &cone([9.0, 4.0], 2.0)), flat, max_relative = 1e-6);
        }
    }

    #[test]
    fn boundaries_reflect_as_fresnel_says() {
        let mut stack = bare(PITCH_UM, &[layer(0.0, 1.5)]);
        stack.interfaces = Interfaces::Fresnel { photodiode_index: 4.0 };
        let normal = |a: f64, b: f64| 4.0 * a * b / (a + b).powi(2);
        assert_relative_eq!(share(&stack, &Cone::NORMAL), normal(1.0, 1.5) * normal(1.5, 4.0), max_relative = 1e-12);
        // At Brewster's angle no p light is reflected, and of s light ((n² − 1) / (n² + 1))².
        stack.layers.clear();
        stack.interfaces = Interfaces::Fresnel { photodiode_index: 1.5 };
        let brewster = Cone { chief: [1.5, 0.0], tangent: 0.0 };
        assert_relative_eq!(share(&stack, &brewster), 1.0 - 0.5 * (1.25_f64 / 3.25).powi(2), max_relative = 1e-12);
    }

    /// Counts rays from a flat pupil of even radiance through a thin lens and plane layers, one by one.
    fn counted(stack: &PixelStack, light: &Cone, shift_um: [f64; 2], n_rays: usize) -> f64 {
        let power_per_um = match stack.microlens.as_ref().map(|lens| stack.lens_surface(lens.power)) {
            Some(Surface::Thin { power_per_um }) => power_per_um,
            _ => 0.0,
        };
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut even = |half: f64| half * (2.0 * random.random::<f64>() - 1.0);
        let (mut taken, mut all) = (0.0, 0.0);
        while all < n_rays as f64 {
            let pupil = [even(1.0), even(1.0)];
            if pupil[0].hypot(pupil[1]) > 1.0 {
                continue;
            }
            let slope = [0, 1].map(|i| light.chief[i] + light.tangent * pupil[i]);
            let cosine = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt().recip();
            // A flat source and a flat receiver take cos⁴ of evenly spread points: rays are kept by that chance.
            if 0.5 * (even(1.0) + 1.0) > cosine.powi(4) {
                continue;
            }
            all += 1.0;
            let start_um = [even(0.5 * PITCH_UM), even(0.5 * PITCH_UM)];
            // The lens changes direction cosines in proportion to the place, then planes keep n times them.
            let cosines = [0, 1].map(|i| slope[i] * cosine - power_per_um * start_um[i]);
            let mut place_um = [0, 1].map(|i| start_um[i] + shift_um[i]);
            for &StackLayer { thickness_um, index } in &stack.layers {
                let inside = cosines.map(|c| c / index);
                let down = (1.0 - inside[0] * inside[0] - inside[1] * inside[1]).sqrt();
                (0..2).for_each(|i| place_um[i] += thickness_um * inside[i] / down);
            }
            if place_um.iter().all(|um| um.abs() <= 0.5 * stack.photodiode_um) {
                taken += 1.0;
            }
        }
        taken / all
    }

    #[test]
    fn shares_are_those_of_counted_rays() {
        let layers = [layer(0.9, 1.6), layer(2.0, 1.46), layer(1.0, 1.9)];
        let check = |stack: &PixelStack, light: Cone, shift_um: [f64; 2], off: f64| {
            const RAYS: usize = 200_000;
            let found = PixelOptics::new(stack, PITCH_UM).share(&light, shift_um);
            let expected = counted(stack, &light, shift_um, RAYS);
            // Four standard errors, and what the model leaves out.
            let error = 4.0 * (expected * (1.0 - expected) / RAYS as f64).sqrt() + off;
            assert!((found - expected).abs() < error, "{found} {expected} ± {error}");
        };
        let bare = bare(2.4, &layers);
        check(&bare, cone([0.0; 2], 1.4), [0.0; 2], 1e-3);
        check(&bare, cone([22.0, -8.0], 1.4), [-0.7, 0.2], 1e-3);
        // A lens of f/1 by patches.
        let mut lens = with_lens(1.6, &layers, MicrolensPower::FocalLengthUm(4.0));
        check(&lens, cone([0.0; 2], 2.8), [0.0; 2], 2e-3);
        check(&lens, cone([10.0, 4.0], 2.8), [-0.3, -0.1], 2e-3);
        check(&lens, cone([25.0, 14.0], 1.4), [-0.9, -0.5], 3e-3);
        lens.microlens.as_mut().unwrap().power = MicrolensPower::FocusOnPhotodiode;
        check(&lens, cone([5.0, 2.0], 1.4), [0.0; 2], 3e-3);
    }

    #[test]
    fn a_larger_pixel_of_the_same_shape_takes_the_same() {
        let stack = with_lens(1.5, &[layer(5.0, 1.5)], MicrolensPower::RadiusUm(2.9));
        let light = cone([8.0, 2.0], 2.0);
        let of = |stack: &PixelStack, opening_um| PixelOptics::new(stack, opening_um).share(&light, [0.0; 2]);
        assert_relative_eq!(of(&stack.scaled(5.0), 5.0 * PITCH_UM), of(&stack, PITCH_UM), max_relative = 1e-12);
    }
}
