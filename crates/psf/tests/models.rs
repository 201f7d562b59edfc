//! What each model of diffraction is good for: real pictures of points by each, held to the diffraction integral.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{Diffraction, ImageSettings, Picture, PointImage};
use ndarray::Array2;

const PITCH_UM: f64 = 4.0;
const SIZE: usize = 65;

/// A point that the double Gauss sees.
struct Case {
    name: &'static str,
    f_number: f64,
    field_deg: f64,
    dioptres: f64,
}

const CASES: [Case; 5] = [
    Case { name: "f/16, sharp", f_number: 16.0, field_deg: 0.0, dioptres: 0.495 },
    Case { name: "f/8, sharp", f_number: 8.0, field_deg: 0.0, dioptres: 0.495 },
    Case { name: "f/8, blurred", f_number: 8.0, field_deg: 5.0, dioptres: 0.33 },
    Case { name: "f/4, 10°", f_number: 4.0, field_deg: 10.0, dioptres: 0.495 },
    Case { name: "f/4, blurred", f_number: 4.0, field_deg: 0.0, dioptres: 0.43 },
];

const MODELS: [(&str, Diffraction); 4] = [
    ("geometric", Diffraction::None),
    ("HURB γ=1", Diffraction::Hurb { gamma: 1.0 }),
    ("HURB γ=√2", Diffraction::Hurb { gamma: std::f64::consts::SQRT_2 }),
    ("HURB calibrated", Diffraction::HurbCalibrated),
];

fn picture(case: &Case, diffraction: Diffraction) -> Array2<f64> {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(case.f_number, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let field_tan = DVec2::X * case.field_deg.to_radians().tan();
    let settings = ImageSettings { n_rings: 24, n_azimuths: 96, ..ImageSettings::new(film_distance_mm, diffraction) };
    let image = PointImage::trace(&lens, &settings, field_tan, case.dioptres, 550.0).unwrap().unwrap();
    let (picture, model) = image.picture(PITCH_UM, SIZE);
    assert_eq!(model.wave_fraction, if diffraction == Diffraction::Wave { 1.0 } else { 0.0 }, "{}", case.name);
    assert_eq!(model.fallback, None);
    picture
}

/// Returns the L1 difference, and the largest difference of the edge spreads along both axes.
fn errors(found: &Array2<f64>, truth: &Array2<f64>) -> (f64, f64) {
    let l1 = (found - truth).mapv(f64::abs).sum();
    let mut edge: f64 = 0.0;
    for direction in [0.0, std::f64::consts::FRAC_PI_2] {
        // Each picture is normalised by what it holds of the light: the window holds 97 % and more.
        let spread = |p: &Array2<f64>| Picture::new(p.view(), PITCH_UM).edge_spread(direction).values;
        edge = spread(found).iter().zip(spread(truth)).map(|(a, b)| (a - b).abs()).fold(edge, f64::max);
    }
    (l1, edge)
}

#[test]
fn bent_rays_have_the_edge_of_waves_and_geometry_has_not() {
    for case in &CASES {
        let truth = picture(case, Diffraction::Wave);
        let found = MODELS.map(|(_, diffraction)| errors(&picture(case, diffraction), &truth));
        for ((name, _), (l1, edge)) in MODELS.iter().zip(&found) {
            println!("{:<14} {name:<16} L1 {l1:.3}, edge {edge:.4}", case.name);
        }
        // Whatever the case, bending is better than none.
        assert!(found[1].0 < found[0].0 && found[1].1 < found[0].1, "{}", case.name);
        // A prototype had .0195 at most with γ = 1, at f/8 on pixels of 4 µm.
        assert!(case.f_number != 8.0 || found[1].1 < 0.0195, "{}: {found:?}", case.name);
    }
}

#[test]
fn bent_blurs_have_no_dot_in_their_middle() {
    let lens = Lens::thin(50.0, 12.5).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    for (pitch_um, dioptres) in [(1.0, 0.9), (2.0, 0.9), (2.0, 0.7), (1.0, 0.6), (4.0, 1.5)] {
        let diffraction = Diffraction::Hurb { gamma: 1.0 };
        let settings = ImageSettings::new(film_distance_mm, diffraction);
        let image = PointImage::trace(&lens, &settings, DVec2::ZERO, dioptres, 550.0).unwrap().unwrap();
        let picture = image.picture(pitch_um, 301).0;
        let radius_px = 1e3 * image.blur_radius_mm().abs() / pitch_um;
        // Rings about the middle, a few pixels wide; a blur without aberrations is even.
        let ring = |from: f64, to: f64| {
            let at = |(r, c): (usize, usize)| (r as f64 - 150.0).hypot(c as f64 - 150.0);
            let within: Vec<f64> =
                picture.indexed_iter().filter(|&(place, _)| (from..to).contains(&at(place))).map(|(_, e)| *e).collect();
            within.iter().sum::<f64>() / within.len() as f64
        };
        let even = ring(0.2 * radius_px, 0.6 * radius_px);
        let worst = (0..8)
            .map(|i| ring(2.0 * f64::from(i), 2.0 * f64::from(i) + 2.0) / even - 1.0)
            .fold(0.0, |w: f64, e| if e.abs() > w.abs() { e } else { w });
        println!("{pitch_um} um, radius {radius_px:.1} px: {worst:.3}");
        assert!(worst.abs() < 0.1, "{pitch_um} {dioptres}: {worst}");
    }
}
