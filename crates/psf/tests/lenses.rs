//! Lenses whose image is known in closed form.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_optics::{Blaze, CoordinateBreak, DiffractiveSurface, Lens, PhaseProfile, glam::DVec2};
use dioptric_psf::{Diffraction, FilmQuery, ImageSettings, LensImage, LensImageModel, Picture, PointImage};

const NM: f64 = 550.0;

fn model(lens: &Lens, film_distance_mm: f64, diffraction: Diffraction) -> LensImageModel {
    LensImageModel::new(lens, &[NM], &ImageSettings::new(film_distance_mm, diffraction)).unwrap()
}

fn query(place_mm: DVec2, dioptres: f64, pitch_um: f64) -> FilmQuery {
    FilmQuery { place_mm, dioptres, wavelength_nm: NM, pitch_um }
}

#[test]
fn a_pinhole_casts_its_shadow() {
    let (diameter_mm, film_distance_mm) = (0.5, 50.0);
    let model = model(&Lens::pinhole(diameter_mm).unwrap(), film_distance_mm, Diffraction::None);
    let map = model.film_map(NM, 16.0);
    for (field_tan, dioptres) in [(0.0, 0.0), (0.2, 1.0), (0.3, 2.0)] {
        let place_mm = DVec2::X * (film_distance_mm * field_tan);
        // The chief ray is the mean one: off that of the middle by parts of (R/f)².
        assert!((map.field_tan(place_mm).unwrap().x - field_tan).abs() < 1e-5, "{field_tan}");
        // E/L = A cos⁴ / f², with the whole hole in one direction.
        let area_mm2 = PI / 4.0 * diameter_mm * diameter_mm;
        let expected = area_mm2 / (film_distance_mm * film_distance_mm) / (1.0 + field_tan * field_tan).powi(2);
        assert!((map.irradiance_sr(place_mm) / expected - 1.0).abs() < 1e-4);
        // A disc of the pinhole's size, seen from the point.
        let radius_um = 0.5e3 * diameter_mm * (1.0 + film_distance_mm * dioptres * 1e-3);
        let rms_um = Picture::from(&model.kernel(query(place_mm, dioptres, 5.0))).rms_radius_um();
        assert!((rms_um / (radius_um / 2f64.sqrt()) - 1.0).abs() < 0.005, "{rms_um} {radius_um}");
        assert!(model.blur_radius_mm(place_mm, dioptres, NM) > 0.0);
    }
}

#[test]
fn an_ideal_lens_follows_the_thin_lens_equation() {
    let (focal_mm, diameter_mm) = (50.0, 10.0);
    let lens = Lens::thin(focal_mm, diameter_mm).unwrap();
    let film_distance_mm = lens.at(NM).unwrap().film_distance_mm_for(1000.0).unwrap();
    let model = model(&lens, film_distance_mm, Diffraction::None);
    let map = model.film_map(NM, 11.0);
    for dioptres in [0.0, 0.4, 0.9, 1.3, 2.7] {
        // Circle of confusion: radius × film × (difference of vergences); 95 % of an even disc is within 0.975 of it.
        let expected_mm = 0.5 * diameter_mm * film_distance_mm * (dioptres - 1.0) * 1e-3 * 0.95f64.sqrt();
        let place_mm = DVec2::new(3.0, 4.0);
        let blur_mm = model.blur_radius_mm(place_mm, dioptres, NM);
        // The rms radius of the mesh's cells is 0.5 % short of the disc's.
        assert!((blur_mm / expected_mm - 1.0).abs() < 0.01, "{dioptres}: {blur_mm} {expected_mm}");
        assert!((model.spread_mm(place_mm, dioptres, NM) / expected_mm.abs() - 1.0).abs() < 0.01);
        // What a point of the film sees is a disc about its chief ray, whatever the depth.
        let kernel = model.kernel(query(place_mm, dioptres, 2.0));
        assert!(kernel.middle_px.abs().max_element() <= 1, "{}", kernel.middle_px);
    }
    for radius_mm in [0.0, 5.0, 10.0] {
        let tan = radius_mm / film_distance_mm;
        let place_mm = DVec2::new(0.0, -radius_mm);
        assert!((map.field_tan(place_mm).unwrap() - DVec2::new(0.0, -tan)).length() < 1e-9);
        // The solid angle of a disc seen from aside, projected (Foote 1915).
        let (r, d) = (0.5 * diameter_mm, film_distance_mm);
        let square = (r * r + d * d + radius_mm * radius_mm).powi(2) - 4.0 * (r * radius_mm).powi(2);
        let expected = 0.5 * PI * (1.0 - (d * d + radius_mm * radius_mm - r * r) / square.sqrt());
        let found = map.irradiance_sr(place_mm);
        // Simpson's rule over 96 azimuths, and the table.
        assert!((found / expected - 1.0).abs() < 1e-6, "{radius_mm}: {found} {expected}");
    }
}

/// What the film's points see and where the scene's points land are one image: the kernel of the film point that sees a scene point and the
/// point spread function of that one, each about its own place.
#[test]
fn film_points_see_what_scene_points_cast() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, NM).unwrap();
    let film_distance_mm = lens.at(NM).unwrap().film_distance_mm_for(2000.0).unwrap();
    for (diffraction, most) in
        [(Diffraction::None, 0.03), (Diffraction::Hurb { gamma: 1.0 }, 0.04), (Diffraction::Wave, 0.03)]
    {
        let model = model(&lens, film_distance_mm, diffraction);
        let map = model.film_map(NM, 20.0);
        for (x, y, dioptres) in [(0.0, 0.0, 0.49), (6.0, 8.0, 0.47), (-3.0, 4.0, 0.9)] {
            let place_mm = DVec2::new(x, y);
            let seen = model.kernel(query(place_mm, dioptres, 4.0));
            let field_tan = map.field_tan(place_mm).unwrap();
            let settings = ImageSettings::new(film_distance_mm, diffraction);
            let cast = PointImage::trace(&lens, &settings, field_tan, dioptres, NM).unwrap().unwrap();
            let [a, b] = [Picture::from(&seen), Picture::from(&cast.kernel(4.0).0)].map(|p| p.rms_radius_um());
            println!("{diffraction:?} {place_mm} {dioptres} D: rms {a:.3} and {b:.3} um");
            assert!((a / b - 1.0).abs() < most, "{diffraction:?} {place_mm}: {a} {b}");
            // The centroid of the light lies where the kernel has it, to a tenth of a pixel and what aberrations change over the blur.
            let middle = seen.samples.nrows() as f64 / 2.0;
            let at =
                |(row, column): (usize, usize)| DVec2::new(column as f64 + 0.5 - middle, middle - row as f64 - 0.5);
            let centroid: DVec2 = seen.samples.indexed_iter().map(|(at_px, e)| at(at_px) * f64::from(*e)).sum();
            let centroid = (centroid + seen.middle_px.as_dvec2() * DVec2::new(1.0, -1.0)) * 4e-3;
            let off_px = (place_mm + centroid - cast.centroid_mm()).length() / 4e-3;
            assert!(off_px < 0.15 + 0.03 * a / 4.0, "{diffraction:?} {place_mm}: {off_px} px");
        }
    }
}

/// A singlet with rings so weak that they bend nothing, of a high order: its share changes from 1 to 0 and back within 60 nm.
#[test]
fn share_of_an_order_is_exact_at_all_wavelengths() {
    let singlet = |blaze| {
        let profile = PhaseProfile::Rings { radius_mm: 12.7, coefficients_rad: vec![-1e-7] };
        let lens = Lens::built_in("singlet-50mm").unwrap();
        lens.with_diffractive(vec![DiffractiveSurface { surface: 0, order: 8, profile, blaze }]).unwrap()
    };
    let with = singlet(Some(Blaze { design_nm: NM, order: None, levels: None }));
    let [blazed, all] = [&with, &singlet(None)].map(|lens| model(lens, 50.0, Diffraction::None));
    for wavelength_nm in [421.3, 489.0, 550.0, 571.0, 618.5, 680.0] {
        let light = |model: &LensImageModel| {
            let map = model.film_map(wavelength_nm, 4.0);
            [DVec2::ZERO, DVec2::new(1.0, -2.0)].map(|at_mm| map.irradiance_sr(at_mm))
        };
        let share = with.diffraction_efficiency_at(wavelength_nm).unwrap();
        for (found, whole) in light(&blazed).into_iter().zip(light(&all)) {
            // Of the largest share: some wavelengths are nearly dark.
            assert!((found / whole - share).abs() < 1e-9, "{wavelength_nm} nm: {} for {share}", found / whole);
        }
        // It takes light and no sharpness.
        let ask = FilmQuery { wavelength_nm, ..query(DVec2::new(1.0, -2.0), 0.0, 10.0) };
        assert!(blazed.kernel(ask).difference_from(&all.kernel(ask)) < 1e-5, "{wavelength_nm} nm");
    }
}

/// Scene and film stay where a lens is moved sideways; where it stands, it sees what it saw.
#[test]
fn lens_moved_sideways_sees_from_where_it_stands() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, NM).unwrap();
    let film_distance_mm = lens.at(NM).unwrap().film_distance_mm_for(2000.0).unwrap();
    let aside_mm = DVec2::new(2.0, -3.0);
    let step = CoordinateBreak {
        surfaces: (0, lens.interfaces().len() - 1),
        pivot_mm: 0.0,
        decenter_mm: [aside_mm.x, aside_mm.y, 0.0],
        tilt_deg: [0.0; 3],
        tilt_first: false,
    };
    let moved = lens.clone().with_moves(vec![step]).unwrap();
    let [straight, aside] = [&lens, &moved].map(|lens| model(lens, film_distance_mm, Diffraction::None));
    assert!(straight.is_symmetric() && !aside.is_symmetric());
    let [before, after] = [&straight, &aside].map(|model| model.film_map(NM, 15.0));
    for place_mm in [DVec2::new(0.5, 0.2), DVec2::new(6.0, 8.0)] {
        // The picture is the film turned by 180°: it moves the other way.
        let there_mm = place_mm - aside_mm;
        assert!((after.irradiance_sr(there_mm) / before.irradiance_sr(place_mm) - 1.0).abs() < 1e-4);
        // In focus a point stays where it was seen, but for where the lens stands.
        let focus = straight.focus_dioptres();
        let moved_tan = after.field_tan(there_mm).unwrap() - aside_mm * (1e-3 * focus);
        assert!((moved_tan - before.field_tan(place_mm).unwrap()).length() < 1e-6);
        for dioptres in [0.1, 1.2] {
            let kernels =
                [straight.kernel(query(place_mm, dioptres, 5.0)), aside.kernel(query(there_mm, dioptres, 5.0))];
            // Out of focus it sees past what it saw: by the way that it moved times the vergence.
            let parallax_px = before.jacobian_mm(place_mm) * aside_mm * (1e-3 * (dioptres - focus)) * 200.0;
            let apart = (kernels[1].middle_px - kernels[0].middle_px).as_dvec2() * DVec2::new(1.0, -1.0);
            assert!((apart + parallax_px).length() < 4.0, "{dioptres}: {apart} {parallax_px}");
            let [a, b] = kernels.map(|kernel| Picture::from(&kernel).rms_radius_um());
            assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let lens = Lens::thin(50.0, 10.0).unwrap();
    let message = |settings: ImageSettings, nm: f64| {
        LensImageModel::new(&lens, &[nm], &settings).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let good = ImageSettings::new(50.0, Diffraction::None);
    assert_eq!(message(good, NM), "");
    assert!(message(ImageSettings { film_distance_mm: -1.0, ..good }, NM).contains("film_distance_mm is -1"));
    assert!(message(ImageSettings { n_rings: 1, ..good }, NM).contains("n_rings is 1"));
    assert!(message(ImageSettings { n_azimuths: 3, ..good }, NM).contains("n_azimuths is 3"));
    assert!(
        message(ImageSettings { diffraction: Diffraction::Hurb { gamma: 0.0 }, ..good }, NM).contains("gamma is 0")
    );
}
