//! Banks over a field of two dimensions: the same as turned ones where the lens is symmetric, and right where it is not.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{Aperture, Glass, Interface, Lens, Outline, Shape, Surface, glam::DVec2};
use dioptric_psf::{BankSettings, Diffraction, FieldSampling, Interpolation, LensImageModel, Picture, PsfQuery};

fn settings(film_distance_mm: f64, tans_x: Vec<f64>, tans_y: Vec<f64>, diffraction: Diffraction) -> BankSettings {
    BankSettings {
        film_distance_mm,
        reference_wavelength_nm: 550.0,
        fields: FieldSampling::Points { tans_x, tans_y },
        dioptres: vec![0.2, 0.6, 1.0],
        wavelengths_nm: vec![450.0, 550.0, 650.0],
        n_rings: 12,
        n_azimuths: 48,
        diffraction,
        interpolation: Interpolation::Rays,
    }
}

fn points(tans_x: Vec<f64>) -> FieldSampling {
    FieldSampling::Points { tans_x, tans_y: vec![0.0] }
}

#[test]
fn of_a_symmetric_lens_it_is_the_turned_bank() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let tans: Vec<f64> = (-3..=3).map(|i| 0.05 * f64::from(i)).collect();
    for (diffraction, most) in [(Diffraction::None, 0.05), (Diffraction::Hurb { gamma: 1.0 }, 0.05)] {
        let plane = settings(film_distance_mm, tans.clone(), tans.clone(), diffraction);
        let turned = BankSettings {
            film_distance_mm,
            reference_wavelength_nm: 550.0,
            fields: FieldSampling::Radial((0..8).map(|i| 0.031 * f64::from(i)).collect()),
            dioptres: plane.dioptres.clone(),
            wavelengths_nm: plane.wavelengths_nm.clone(),
            n_rings: 12,
            n_azimuths: 48,
            diffraction,
            interpolation: Interpolation::Rays,
        };
        let turned = LensImageModel::build(&lens, &turned).unwrap();
        let plane = LensImageModel::build(&lens, &plane).unwrap();
        for (x, y, dioptres, nm) in [(0.05, 0.1, 0.2, 450.0), (-0.12, 0.06, 0.9, 600.0), (0.0, -0.13, 0.7, 550.0)] {
            let query = PsfQuery { field_tan: DVec2::new(x, y), dioptres, wavelength_nm: nm, pitch_um: 5.0 };
            let (a, model) = plane.kernel_and_model(query).unwrap();
            let (b, _) = turned.kernel_and_model(query).unwrap();
            let l1 = a.difference_from(&b);
            println!("{diffraction:?} {x} {y}: {l1}");
            // Each interpolates to a per cent, and the mesh of one is turned in the pupil of the other: outlines of 48
            // corners cut a per cent or two of a blur's pixels differently.
            assert!(l1 < most && model.wave_fraction == 0.0, "{x} {y} {dioptres} {nm}: {l1}");
            let radius_mm = turned.radial_geometry(dioptres, nm).unwrap().image_radius_mm(query.field_tan.length());
            let centroid_mm = plane.centroid_mm(query.field_tan, dioptres, nm);
            // Distortion is of third order in the field: quadratics miss it by some µm of many mm.
            assert!((centroid_mm - query.field_tan.normalize() * radius_mm).length() < 0.01, "{centroid_mm}");
        }
    }
}

/// Returns a biconvex lens of 50 mm across and 40 mm up, f/10, its stop in front.
fn astigmatic() -> Lens {
    let index = 1.5;
    let surface = |radius_mm: f64, radius_x_mm: f64| Surface {
        shape: Shape::Biconic { conic: 0.0, curvature_x_per_mm: 1.0 / radius_x_mm, conic_x: 0.0 },
        ..Surface::sphere(radius_mm, 2.2)
    };
    let interface = |surface, index, thickness_after_mm| Interface {
        surface,
        medium_after: Glass::Constant { index },
        thickness_after_mm,
    };
    let interfaces = vec![interface(surface(40.0, 50.0), index, 1.0), interface(surface(-40.0, -50.0), 1.0, 0.0)];
    Lens::new("astigmatic", "a test", interfaces, 0).unwrap()
}

#[test]
fn a_lens_of_two_powers_has_its_lines_across_and_up() {
    let lens = astigmatic();
    let mono = lens.at(550.0).unwrap();
    let [up_mm, across_mm] = [mono.first_order(), mono.first_order_x()].map(|first| first.bfl_mm);
    assert!(across_mm - up_mm > 5.0, "{across_mm} {up_mm}");
    let moments = |film_distance_mm: f64, at: DVec2| {
        let mut settings =
            settings(film_distance_mm, vec![-0.02, 0.0, 0.02], vec![-0.02, 0.0, 0.02], Diffraction::None);
        settings.dioptres = vec![0.0];
        let bank = LensImageModel::build(&lens, &settings).unwrap();
        let query = PsfQuery { field_tan: at, dioptres: 0.0, wavelength_nm: 550.0, pitch_um: 4.0 };
        Picture::from(&bank.kernel_and_model(query).unwrap().0).second_moments_um2()
    };
    let (at_up, at_across) = (moments(up_mm, DVec2::ZERO), moments(across_mm, DVec2::ZERO));
    // A far point's rays of the plane upwards come together first: there the light is a line across.
    assert!(at_up.xx > 100.0 * at_up.yy && at_across.yy > 100.0 * at_across.xx, "{at_up:?} {at_across:?}");
    // Fields that mirror each other have pictures that do.
    let [a, b] = [DVec2::new(0.015, 0.013), DVec2::new(0.015, -0.013)].map(|at| moments(0.5 * (up_mm + across_mm), at));
    assert!(
        (a.xx - b.xx).abs() < 1e-3 * a.xx && (a.yy - b.yy).abs() < 1e-3 * a.yy && (a.xy + b.xy).abs() < 1e-3 * a.xx
    );
    assert!(
        LensImageModel::build(
            &lens,
            &BankSettings::covering(up_mm, 0.1, (0.0, 0.0), (550.0, 550.0), Diffraction::None)
        )
        .is_err()
    );
}

#[test]
fn waves_of_a_lens_of_two_powers_are_summed_and_dark_fields_are_none() {
    let lens = astigmatic();
    let mono = lens.at(550.0).unwrap();
    let film_distance_mm = 0.5 * (mono.first_order().bfl_mm + mono.first_order_x().bfl_mm);
    let wide = BankSettings {
        dioptres: vec![0.0],
        ..settings(film_distance_mm, vec![0.0, 0.01], vec![0.0], Diffraction::Hurb { gamma: 1.0 })
    };
    let query = PsfQuery { field_tan: DVec2::ZERO, dioptres: 0.0, wavelength_nm: 550.0, pitch_um: 4.0 };
    assert!(LensImageModel::build(&lens, &wide).unwrap().kernel_and_model(query).is_some());
    // A microscope sees nothing at 10°.
    let microscope = Lens::built_in("microscope-20x").unwrap();
    let beside = BankSettings { film_distance_mm: 0.2194, fields: points(vec![0.0, 0.18]), ..wide.clone() };
    let bank = LensImageModel::build(&microscope, &beside).unwrap();
    let at = |tan_x: f64| bank.picture(PsfQuery { field_tan: DVec2::new(tan_x, 0.0), ..query }, 9);
    assert!(at(0.0).is_some() && at(0.18).is_none() && at(0.1).is_none());
    assert!(bank.centroid_mm(DVec2::new(0.18, 0.0), 0.0, 550.0).is_nan());
    let narrow = lens.with_stop_diameter_mm(1.0).unwrap();
    let waves = BankSettings { diffraction: Diffraction::Wave, fields: points(vec![0.0]), ..wide.clone() };
    let (picture, model) = LensImageModel::build(&narrow, &waves).unwrap().picture(query, 201).unwrap();
    assert!(model.wave_fraction > 0.9 && model.fallback.is_none(), "{model:?}");
    // Most of an Airy pattern of some 50 µm and a blur of 100 µm is on 0.8 mm.
    assert!(picture.sum() > 0.97 && picture.sum() < 1.001, "{}", picture.sum());
    assert!(LensImageModel::build(&lens, &BankSettings { fields: points(vec![0.1, 0.0]), ..wide }).is_err());
}

#[test]
fn an_obscured_lens_blurs_to_rings() {
    let thin = Lens::thin(50.0, 10.0).unwrap();
    let hole =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm: 2.5 }, center_mm: [0.0; 2], is_obscuration: true };
    let annulus = |interfaces| Lens::new_with_apertures("annulus", "test", interfaces, 0, vec![hole]).unwrap();
    let surface = Surface { shape: Shape::Conic { conic: -1.0 }, ..Surface::sphere(-100.0, 5.0) };
    let paraboloid = vec![Interface { surface, medium_after: Glass::Air, thickness_after_mm: 0.0 }];
    // A mirror with a hole, whose light runs back, does the same.
    for lens in [annulus(thin.interfaces().to_vec()), annulus(paraboloid).with_mirrors([0]).unwrap()] {
        blurs_to_a_ring(&lens);
    }
}

#[track_caller]
fn blurs_to_a_ring(lens: &Lens) {
    // 2 mm before the focus the rays fill the ring from 0.1 to 0.2 mm.
    let ring = BankSettings {
        dioptres: vec![0.0],
        wavelengths_nm: vec![550.0],
        n_rings: 24,
        ..settings(48.0, vec![0.0], vec![0.0], Diffraction::None)
    };
    let bank = LensImageModel::build(lens, &ring).unwrap();
    let query = PsfQuery { field_tan: DVec2::ZERO, dioptres: 0.0, wavelength_nm: 550.0, pitch_um: 10.0 };
    let (picture, _) = bank.picture(query, 61).unwrap();
    let within = |extent_mm: f64| -> f64 {
        let pixels = picture.indexed_iter();
        let inside = pixels.filter(|((row, column), _)| {
            DVec2::new(*column as f64 - 30.0, *row as f64 - 30.0).length() * 0.01 <= extent_mm
        });
        inside.map(|(_, e)| *e).sum()
    };
    assert!((picture.sum() - 1.0).abs() < 1e-6);
    assert!(within(0.085) < 1e-9, "{}", within(0.085));
    // Pixels cut the circle, and cells of 4 µm the hole.
    let expected = (0.15f64.powi(2) - 0.01) / 0.03;
    assert!((within(0.15) - expected).abs() < 0.02, "{} {expected}", within(0.15));
}

#[test]
fn a_lens_with_a_round_hole_is_drawn_alike_by_both_banks() {
    let thin = Lens::thin(50.0, 5.0).unwrap();
    let hole =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm: 1.0 }, center_mm: [0.0; 2], is_obscuration: true };
    let lens = Lens::new_with_apertures("annulus", "test", thin.interfaces().to_vec(), 0, vec![hole]).unwrap();
    let film_distance_mm = 50.05;
    for diffraction in [Diffraction::None, Diffraction::Wave] {
        let plane = BankSettings {
            dioptres: vec![0.0],
            wavelengths_nm: vec![550.0],
            ..settings(film_distance_mm, vec![0.06], vec![0.08], diffraction)
        };
        let turned = BankSettings {
            film_distance_mm,
            reference_wavelength_nm: plane.reference_wavelength_nm,
            fields: FieldSampling::Radial(vec![0.0, 0.1]),
            dioptres: vec![0.0],
            wavelengths_nm: vec![550.0],
            n_rings: plane.n_rings,
            n_azimuths: plane.n_azimuths,
            diffraction,
            interpolation: Interpolation::Rays,
        };
        let query = PsfQuery { field_tan: DVec2::new(0.06, 0.08), dioptres: 0.0, wavelength_nm: 550.0, pitch_um: 1.0 };
        let (of_plane, model) = LensImageModel::build(&lens, &plane).unwrap().picture(query, 41).unwrap();
        let (of_turned, again) = LensImageModel::build(&lens, &turned).unwrap().picture(query, 41).unwrap();
        assert_eq!(
            (model.wave_fraction, again.wave_fraction),
            if diffraction == Diffraction::Wave { (1.0, 1.0) } else { (0.0, 0.0) }
        );
        let off: f64 = (&of_plane - &of_turned).iter().map(|e| e.abs()).sum();
        // Meshes of rays are turned with the field by one bank alone; waves are summed from the same nodes by both.
        let limit = if diffraction == Diffraction::Wave { 1e-9 } else { 0.03 };
        assert!(off < limit, "{diffraction:?}: {off}");
        // The hole takes light from the middle of the blur, not from around it.
        let middle = of_turned[(20, 20)] / of_turned.sum();
        assert!(diffraction == Diffraction::Wave || middle < 1e-9, "{middle}");
    }
}
