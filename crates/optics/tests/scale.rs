//! Lenses made larger and smaller.

use std::path::Path;

use dioptric_optics::{
    Lens, LensFile, ObjectPoint, RayBatch, ReadOptions, Vignetting,
    glam::{DVec2, DVec3},
};

/// Every kind of shape, move, aperture and phase.
fn of_all_kinds(eye: &str) -> Result<Lens, dioptric_optics::OpticsError> {
    let text = r#"(name: "all", source: "test", image_radius_mm: -40.0, surfaces: [
        (radius_mm: 50.0, shape: EvenAsphere(conic: -0.5, coefficients: [1e-6, 2e-9]), stop: true, semi_aperture_mm: 5.0,
            medium: Constant(index: 1.5), thickness_mm: 4.0),
        (radius_mm: -60.0, shape: Biconic(conic: 1.0, curvature_x_per_mm: -0.02, conic_x: -2.0), semi_aperture_mm: 8.0,
            thickness_mm: 3.0),
        (radius_mm: 90.0, shape: OddAsphere(conic: 0.0, coefficients: [0.0, 1e-4, 1e-5]), semi_aperture_mm: 8.0,
            medium: Constant(index: 1.6), thickness_mm: 3.0),
        (radius_mm: 80.0, shape: Toroid(curvature_x_per_mm: 0.01, conic: 0.0, coefficients: [1e-4, 1e-6]),
            semi_aperture_mm: 8.0, thickness_mm: 2.0),
        (radius_mm: 70.0, shape: Conic(conic: -1.0), semi_aperture_mm: 8.0, thickness_mm: 1.0),
        (shape: ThinLens(power_per_mm: 0.004), semi_aperture_mm: 8.0, thickness_mm: 1.0),
        (semi_aperture_mm: 8.0, thickness_mm: 0.0),
    ],
    moves: [(surfaces: (1, 2), pivot_mm: 1.0, decenter_mm: (0.1, 0.2, 0.3), tilt_deg: (1.5, -2.0, 3.0))],
    apertures: [(surface: 4, outline: Rectangle(half_x_mm: 7.0, half_y_mm: 2.0), center_mm: (0.0, 0.5))],
    diffractive: [
        (surface: 4, order: 1, profile: Rings(radius_mm: 5.0, coefficients_rad: [-20.0, 3.0])),
        (surface: 6, order: 1, profile: Grating(lines_per_mm: (10.0, 20.0))),
        (surface: 0, order: 1, profile: Wavefront((radius_mm: 5.0, terms: Noll,
            bands: [(wavelength_nm: 550.0, coefficients_um: [0.0, 0.0, 0.0, 1.0, 2.0, 0.5, 0.3])], EYE))),
    ])"#;
    let text = text.replace("EYE", eye);
    Ok(LensFile::from_bytes(Path::new("all.ron"), text.as_bytes(), &ReadOptions::default())?.lens)
}

fn trace(lens: &Lens, factor: f64) -> RayBatch {
    let places = [(0.0, 0.0), (1.0, 2.0), (-3.0, 1.5), (2.0, -4.0), (0.5, 4.4)];
    let starts: Vec<DVec3> = places.iter().map(|&(x, y)| DVec3::new(x, y, -10.0) * factor).collect();
    let direction = ObjectPoint::far(0.05, DVec2::new(0.6, 0.8)).direction_to(DVec3::ZERO);
    let mut rays = RayBatch::from_points(&starts, &vec![direction; starts.len()]);
    lens.at(550.0).expect("media that are known").trace_to_film(&mut rays, Vignetting::On, 60.0 * factor);
    rays
}

#[test]
fn rays_are_those_of_the_lens_as_many_times_as_large() {
    let lens = of_all_kinds("").unwrap();
    for factor in [25.4, 0.1] {
        let (own, scaled) = (trace(&lens, 1.0), trace(&lens.scaled(factor).unwrap(), factor));
        assert!(own.n_in_flight() >= 3, "{own:?}");
        assert_eq!(own.fate, scaled.fate);
        for i in (0..own.len()).filter(|&i| own.fate[i].is_in_flight()) {
            let (point, same) = (own.point_mm(i), scaled.point_mm(i) / factor);
            // Rounding of a trace through seven surfaces.
            assert!((point - same).length() < 1e-10, "{factor} {i}: {point} {same}");
            assert!((own.opl_mm[i] - scaled.opl_mm[i] / factor).abs() < 1e-9, "{factor} {i}");
        }
        let back = lens.scaled(factor).unwrap().scaled(1.0 / factor).unwrap();
        assert!((trace(&back, 1.0).point_mm(1) - own.point_mm(1)).length() < 1e-10);
    }
    assert_eq!(lens.scaled(1.0).unwrap(), lens);
}

#[test]
fn what_has_one_size_and_senseless_factors_are_refused() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    for factor in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e7] {
        assert!(lens.scaled(factor).unwrap_err().to_string().contains("0.000001 to 1000000"), "{factor}");
    }
    let eye = of_all_kinds("chromatic_eye_nm: Some(550.0)").unwrap();
    assert!(eye.scaled(2.0).unwrap_err().to_string().contains("surface 0 has the chromatic aberration of an eye"));
    // Ideal lenses and their films, in proportion.
    let file = LensFile { film_distance_mm: Some(50.0), ..LensFile::from(Lens::thin(50.0, 10.0).unwrap()) };
    let twice = file.scaled(2.0).unwrap();
    assert_eq!((twice.film_distance_mm, twice.lens.at(550.0).unwrap().first_order().efl_mm), (Some(100.0), 100.0));
}
