//! Optical transfer functions against closed forms and against point spread functions.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::{FRAC_PI_2, TAU};

use dioptric_diffraction::{
    PupilSamples, TransferFunction, TransferMethod, TransferQuality, TransferSpokes, WaveQuality, WaveWindow,
    WindowCenter, airy, wave_psf,
};
use dioptric_optics::{
    Aperture, Lens, MonoLens, ObjectPoint, Outline,
    glam::{DVec2, DVec3},
};

const FAR: ObjectPoint = ObjectPoint::Infinite(DVec3::Z);

fn thin(f_number: f64) -> MonoLens {
    Lens::thin(50.0, 50.0 / f_number).unwrap().at(550.0).unwrap()
}

/// The unit of Airy's pattern, λ/2NA, mm.
fn airy_unit_mm(f_number: f64) -> f64 {
    550e-6 / (2.0 * (0.5 / f_number).atan().sin())
}

/// The modulation of an ideal lens at a share of the cut-off. Light that fills its plane evenly fills directions d with the
/// brightness (1 − d²)⁻², for a place is f d / √(1 − d²) from the axis.
fn of_ideal_lens(f_number: f64, s: f64) -> f64 {
    const STEPS: i32 = 800;
    let edge = (0.5 / f_number).atan().sin();
    let amplitude = |d: DVec2| {
        let square = d.length_squared();
        if square < 1.0 { 1.0 / (1.0 - edge * edge * square) } else { 0.0 }
    };
    let at = |i: i32| 2.0 * (f64::from(i) + 0.5) / f64::from(STEPS) - 1.0;
    let (mut shifted, mut whole) = (0.0, 0.0);
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
        let d = DVec2::new(at(i), at(j));
        shifted += amplitude(d - DVec2::X * s) * amplitude(d + DVec2::X * s);
        whole += amplitude(d).powi(2);
    }
    shifted / whole
}

#[test]
fn perfect_lens_has_the_modulation_of_its_pupil() {
    for f_number in [16.0, 4.0] {
        let (transfer, limit) = TransferFunction::trace(&thin(f_number), &FAR, 50.0, TransferQuality::Fine).unwrap();
        let unit_mm = airy_unit_mm(f_number);
        // 10 to 400 cycles per mm at f/4.
        for s in [0.022, 0.05, 0.1, 0.22, 0.44, 0.66, 0.88, 0.99, 1.05] {
            let expected = of_ideal_lens(f_number, s);
            for direction in [0.0, 0.4, 1.3] {
                for found in [&transfer, &limit].map(|transfer| transfer.modulation(direction, s / unit_mm)) {
                    assert!((found - expected).abs() < 1e-4, "f/{f_number} {s}: {found} {expected}");
                }
            }
            // At f/16 directions are evenly bright to a part in five hundred, and the modulation is Airy's.
            assert!(f_number < 16.0 || (airy::mtf(s) - expected).abs() < 2e-4, "{s}: {} {expected}", airy::mtf(s));
        }
        let encircled = transfer.spokes([0.0, FRAC_PI_2]).encircled();
        for radius in [0.3, 0.6, 1.0, 1.22, 2.0, 5.0] {
            let (found, expected) = (encircled.share(radius * unit_mm), airy::encircled_energy(radius));
            // At f/4 the edge of the pupil is 3 % brighter than its middle, which Airy's is not.
            assert!(
                (found - expected).abs() < if f_number < 16.0 { 3e-3 } else { 1e-3 },
                "f/{f_number} {radius}: {found} {expected}"
            );
        }
        let [spread, _] = transfer.spokes([0.0, FRAC_PI_2]).line_spreads();
        assert!((spread.full_width_at_half_maximum_mm() / unit_mm - 1.0017).abs() < 2e-3);
        assert!((spread.per_mm(0.0) * unit_mm - airy::lsf(0.0)).abs() < 1e-3);
    }
    // The circle that holds 80 % of the light of an f/4 lens at 550 nm: Airy's has 1.989 µm, that of the brighter edge 2.000 µm.
    let (transfer, _) = TransferFunction::trace(&thin(4.0), &FAR, 50.0, TransferQuality::Fine).unwrap();
    let radius_um = 1e3 * transfer.spokes([0.0, FRAC_PI_2]).encircled().radius_mm(0.8);
    assert!((radius_um - 2.0).abs() < 0.003, "{radius_um}");
}

#[test]
fn defocus_has_hopkins_modulation() {
    // The integral over the lens-shaped overlap (Hopkins 1955), written out.
    let (f_number, waves) = (16.0, 1.2);
    let unit_mm = airy_unit_mm(f_number);
    let shift_mm = 2.0 * waves * 550e-6 / (0.5f64 / f_number).atan().sin().powi(2);
    let (transfer, _) = TransferFunction::trace(&thin(f_number), &FAR, 50.0 + shift_mm, TransferQuality::Fine).unwrap();
    // The film sees the pupil from 50 mm + shift: waves part by r²/2 (1/50 − 1/(50 + shift)), and the cut-off is as much lower.
    let farther = 1.0 + shift_mm / 50.0;
    let (waves, unit_mm) = (waves / farther, unit_mm * farther);
    for s in [0.05f64, 0.1, 0.2, 0.35, 0.5, 0.8] {
        let steps = 20_000_i32;
        let reach = (1.0 - s * s).sqrt();
        let sum: f64 = (0..steps)
            .map(|i| {
                let y = reach * ((f64::from(i) + 0.5) / f64::from(steps));
                let half = (1.0 - y * y).sqrt() - s;
                if half <= 0.0 {
                    0.0
                } else {
                    (8.0 * std::f64::consts::PI * waves * s * half).sin() / (8.0 * std::f64::consts::PI * waves * s)
                }
            })
            .sum();
        let expected = 4.0 * sum * reach / f64::from(steps) / std::f64::consts::PI;
        let found = transfer.at(DVec2::new(s / unit_mm, 0.0)).x;
        // The defocused film sees the pupil under another angle, by the shift over the focal length.
        assert!((found - expected).abs() < 2e-3, "{s}: {found} {expected}");
    }
}

#[test]
fn a_hole_raises_high_frequencies_as_its_annulus_does() {
    let hole = |radius_mm| Aperture {
        surface: 0,
        outline: Outline::Circle { radius_mm },
        center_mm: [0.0; 2],
        is_obscuration: true,
    };
    let whole = Lens::thin(50.0, 3.125).unwrap();
    let lens = Lens::new_with_apertures("ring", "test", whole.interfaces().to_vec(), 0, vec![hole(0.78125)]).unwrap();
    let (transfer, _) = TransferFunction::trace(&lens.at(550.0).unwrap(), &FAR, 50.0, TransferQuality::Fine).unwrap();
    // Areas of overlap of two discs of radii a and b, a distance d apart.
    let lens_area = |a: f64, b: f64, d: f64| {
        if d >= a + b {
            return 0.0;
        }
        if d <= (a - b).abs() {
            return std::f64::consts::PI * a.min(b).powi(2);
        }
        let angle = |a: f64, b: f64| ((d * d + a * a - b * b) / (2.0 * d * a)).acos();
        let (alpha, beta) = (angle(a, b), angle(b, a));
        a * a * (alpha - 0.5 * (2.0 * alpha).sin()) + b * b * (beta - 0.5 * (2.0 * beta).sin())
    };
    let e = 0.5;
    for s in [0.1f64, 0.3, 0.5, 0.7, 0.9] {
        let d = 2.0 * s;
        let overlap = lens_area(1.0, 1.0, d) - 2.0 * lens_area(1.0, e, d) + lens_area(e, e, d);
        let expected = overlap / (std::f64::consts::PI * (1.0 - e * e));
        let found = transfer.modulation(0.7, s / airy_unit_mm(16.0));
        assert!((found - expected).abs() < 2e-4, "{s}: {found} {expected}");
    }
}

#[test]
fn aberrated_fields_have_the_transform_of_their_wave_sum() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap().at(550.0).unwrap();
    let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
    let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.12), 0.0);
    let (transfer, _) = TransferFunction::trace(&lens, &point, film_distance_mm, TransferQuality::Fine).unwrap();
    assert_eq!(transfer.method(), TransferMethod::Waves);
    let window = WaveWindow { pitch_um: 0.8, rows: 512, columns: 512, center: WindowCenter::Centroid };
    let psf = wave_psf(&lens, &point, film_distance_mm, &window, WaveQuality::default()).unwrap();
    let film = psf.in_film_frame();
    for f in [DVec2::new(20.0, 0.0), DVec2::new(0.0, 40.0), DVec2::new(40.0, -30.0)] {
        let at = |i: usize| 0.8e-3 * (i as f64 - 255.5);
        let mut sum = DVec2::ZERO;
        for ((row, column), energy) in film.indexed_iter() {
            let place = DVec2::new(at(column), at(row)) + psf.center_mm - transfer.centroid_mm();
            sum += *energy * DVec2::from_angle(-std::f64::consts::TAU * f.dot(place));
        }
        let side = |f: f64| {
            if f == 0.0 { 1.0 } else { (std::f64::consts::PI * f * 0.8e-3).sin() / (std::f64::consts::PI * f * 0.8e-3) }
        };
        let of_pixel = side(f.x) * side(f.y);
        let (found, expected) = (transfer.at(f), sum / of_pixel);
        // The window loses half a per cent of the light.
        assert!(found.distance(expected) < 2.0 * (1.0 - psf.captured) + 1e-3, "{f}: {found} {expected}");
    }
}

#[test]
fn a_great_blur_is_that_of_its_rays() {
    let lens = thin(2.0);
    let (transfer, limit) = TransferFunction::trace(&lens, &FAR, 52.0, TransferQuality::Quick).unwrap();
    assert_eq!((transfer.method(), limit.method()), (TransferMethod::Rays, TransferMethod::Waves));
    // An even disc of 1 mm across.
    for per_mm in [0.25, 0.5, 1.0] {
        let x = std::f64::consts::PI * per_mm;
        let expected = (2.0 * airy::bessel_j(1, x) / x).abs();
        assert!(
            (transfer.modulation(0.0, per_mm) - expected).abs() < 0.02,
            "{per_mm}: {} {expected}",
            transfer.modulation(0.0, per_mm)
        );
    }
}

#[test]
fn strehl_ratio_of_defocus_is_its_closed_form_to_a_thousandth() {
    let f_number = 16.0;
    let lens = thin(f_number);
    for waves in [0.1f64, 0.25, 0.5, 0.75] {
        let shift_mm = 2.0 * waves * 550e-6 / (0.5 / f_number).atan().sin().powi(2);
        let found = PupilSamples::peak_of(&lens, &FAR, 50.0 + shift_mm).unwrap().strehl;
        // The film sees the pupil from 50 mm + shift, so that waves part by r²/2 (1/50 − 1/(50 + shift)).
        let x = std::f64::consts::PI * waves / (1.0 + shift_mm / 50.0);
        let expected = (x.sin() / x).powi(2);
        assert!((found / expected - 1.0).abs() < 2e-3, "{waves}: {found} {expected}");
    }
    // From a wave on, the peak is no longer in the middle: a ring is higher. It is never below the middle's.
    for waves in [1.3f64, 2.5, 4.5, 8.5] {
        let shift_mm = 2.0 * waves * 550e-6 / (0.5 / f_number).atan().sin().powi(2);
        let found = PupilSamples::peak_of(&lens, &FAR, 50.0 + shift_mm).unwrap().strehl;
        let x = std::f64::consts::PI * waves / (1.0 + shift_mm / 50.0);
        assert!(found > 0.99 * (x.sin() / x).powi(2) && found < 1.2 / (x * x), "{waves}: {found}");
    }
}

/// An opening with straight edges leaves 1 − f/fc along each of them: cells that the edges cut count by the squares of their shares where
/// they meet themselves, which takes a third of a cell of the 487 across.
#[test]
fn slits_have_the_modulation_of_their_width() {
    for half_widths_mm in [[4.5, 4.5], [0.25, 4.5], [4.5, 0.1]] {
        let [half_x_mm, half_y_mm] = half_widths_mm;
        let outline = Outline::Rectangle { half_x_mm, half_y_mm };
        let aperture = Aperture { surface: 0, outline, center_mm: [0.0; 2], is_obscuration: false };
        let whole = Lens::thin(200.0, 40.0).unwrap();
        let lens = Lens::new_with_apertures("slit", "test", whole.interfaces().to_vec(), 0, vec![aperture]).unwrap();
        let lens = lens.at(550.0).unwrap();
        let (transfer, limit) = TransferFunction::trace(&lens, &FAR, 200.0, TransferQuality::Fine).unwrap();
        for (direction, half_mm) in [(0.0, half_x_mm), (FRAC_PI_2, half_y_mm)] {
            let cutoff_per_mm = 2.0 * half_mm / (550e-6 * 200.0);
            for share in [0.02, 0.1, 0.3, 0.5, 0.8, 0.97] {
                for found in [&transfer, &limit].map(|t| t.modulation(direction, share * cutoff_per_mm)) {
                    assert!((found - (1.0 - share)).abs() < 1.2e-3, "{half_widths_mm:?} {direction} {share}: {found}");
                }
            }
        }
    }
}

/// The light of two colors whose centroids lie apart: along any spoke the sum of what both are, turned by how far they are from the middle
/// of both.
#[test]
fn transfer_functions_of_colors_add_up() {
    let lens = Lens::built_in("singlet-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let film_mm = lens.at(550.0).unwrap().film_distance_mm_for(f64::INFINITY).unwrap();
    let point = ObjectPoint::far(4f64.to_radians(), DVec2::Y);
    let directions = [0.7, 0.7 + FRAC_PI_2];
    let traced = [480.0, 600.0]
        .map(|nm| TransferFunction::trace(&lens.at(nm).unwrap(), &point, film_mm, TransferQuality::Quick).unwrap().0);
    let spokes = traced.each_ref().map(|transfer| transfer.spokes(directions));
    let shares = [0.75, 0.25];
    let both = TransferSpokes::sum(&[(&spokes[0], 3.0), (&spokes[1], 1.0)]).unwrap();
    let centroids = traced.each_ref().map(TransferFunction::centroid_mm);
    let middle = centroids[0] * shares[0] + centroids[1] * shares[1];
    assert!(centroids[0].distance(centroids[1]) > 1e-3, "{centroids:?}");
    for per_mm in [3.0, 11.0, 47.0, 120.0] {
        for (direction, found) in directions.into_iter().zip(both.modulations(per_mm)) {
            let f = DVec2::from_angle(direction) * per_mm;
            let of =
                |i: usize| DVec2::from_angle(-TAU * f.dot(centroids[i] - middle)).rotate(traced[i].at(f)) * shares[i];
            let expected = (of(0) + of(1)).length();
            assert!((found - expected).abs() < 2e-3, "{per_mm}: {found} {expected}");
        }
    }
    let alone = TransferSpokes::sum(&[(&spokes[0], 3.0)]).unwrap();
    for radius_mm in [2e-3, 0.01, 0.05] {
        assert!((alone.encircled().share(radius_mm) - spokes[0].encircled().share(radius_mm)).abs() < 1e-6);
    }
}
