//! Banks of every kind of optics.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_optics::{
    Blaze, DiffractiveSurface, FilmPoint, Glass, Interface, Lens, ObjectPoint, PhaseProfile, PupilBoundary, Surface,
    Vignetting, glam::DVec2, rays_towards,
};
use dioptric_psf::{BankSettings, Diffraction, FieldSampling, Kernel, LensImageModel, Picture, PsfQuery};

#[test]
fn every_built_in_lens_has_a_bank() {
    for name in Lens::built_in_names() {
        let lens = Lens::built_in(name).unwrap();
        let mono = lens.at(550.0).unwrap();
        // Some are made for a near object: focus where they do.
        let far = mono.film_distance_mm_for(f64::INFINITY).ok();
        let (film_distance_mm, dioptres) = match far {
            Some(film_distance_mm) => (film_distance_mm, (0.0, 1.0)),
            None => {
                let film_distance_mm = mono.film_distance_mm_for(1000.0).unwrap();
                let distance_mm = 1000.0 + mono.first_order().entrance_pupil_z_mm;
                (film_distance_mm, (1e3 / distance_mm, 1e3 / distance_mm))
            }
        };
        let settings = BankSettings {
            n_rings: 6,
            n_azimuths: 24,
            ..BankSettings::covering(film_distance_mm, 0.1, dioptres, (486.0, 656.0), Diffraction::Hurb { gamma: 1.0 })
        };
        let bank = LensImageModel::build(&lens, &settings).unwrap_or_else(|error| panic!("{name}: {error}"));
        let last = bank.settings().fields.axes().0[bank.n_fields() - 1];
        let geometry = bank.radial_geometry(dioptres.0, 550.0).unwrap();
        let radius_mm = geometry.image_radius_mm(0.5 * last);
        let sum = bank.kernel(PsfQuery::new(DVec2::new(0.3 * last, 0.4 * last), dioptres.0, 550.0, 4.0)).sum();
        assert!(sum > 0.9 && sum < 1.001, "{name}: {sum}");
        if last > 0.0 {
            assert!(radius_mm > 0.0, "{name}: {radius_mm}");
            assert!((geometry.field_tan(radius_mm).unwrap() - 0.5 * last).abs() < 1e-9, "{name}");
        }
        assert!(geometry.irradiance_per_radiance(0.5 * last) > 0.0, "{name}");
    }
}

#[test]
fn a_pinhole_casts_its_shadow() {
    let (diameter_mm, film_distance_mm) = (0.5, 50.0);
    let lens = Lens::pinhole(diameter_mm).unwrap();
    let settings = BankSettings::covering(film_distance_mm, 0.3, (0.0, 2.0), (550.0, 550.0), Diffraction::None);
    let bank = LensImageModel::build(&lens, &settings).unwrap();
    for (field_tan, dioptres) in [(0.0, 0.0), (0.2, 1.0), (0.3, 2.0)] {
        let geometry = bank.radial_geometry(dioptres, 550.0).unwrap();
        // A near point lights the near side of the hole more: the centroid moves by parts of R²/Z.
        assert!((geometry.image_radius_mm(field_tan) - film_distance_mm * field_tan).abs() < 1e-4);
        // E/L = A cos⁴ / f², with the whole pupil in one direction.
        let area_mm2 = PI / 4.0 * diameter_mm * diameter_mm;
        let expected = area_mm2 / (film_distance_mm * film_distance_mm) / (1.0 + field_tan * field_tan).powi(2);
        assert!((geometry.irradiance_per_radiance(field_tan) / expected - 1.0).abs() < 1e-3);
        // A disc of the pinhole's size, seen from the point.
        let radius_um = 0.5e3 * diameter_mm * (1.0 + film_distance_mm * dioptres * 1e-3);
        let kernel = bank.kernel(PsfQuery::new(DVec2::new(field_tan, 0.0), dioptres, 550.0, 5.0));
        let rms_um = Picture::from(&kernel).rms_radius_um();
        assert!((rms_um / (radius_um / 2f64.sqrt()) - 1.0).abs() < 0.005, "{rms_um} {radius_um}");
        assert!(bank.blur_radius_mm(DVec2::X * field_tan, dioptres, 550.0) > 0.0);
    }
}

#[test]
fn an_ideal_lens_follows_the_thin_lens_equation() {
    let (focal_mm, diameter_mm) = (50.0, 10.0);
    let lens = Lens::thin(focal_mm, diameter_mm).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(1000.0).unwrap();
    assert!((film_distance_mm - 1000.0 * 50.0 / 950.0).abs() < 1e-9);
    let settings = BankSettings::covering(film_distance_mm, 0.2, (0.0, 3.0), (550.0, 550.0), Diffraction::None);
    let bank = LensImageModel::build(&lens, &settings).unwrap();
    for dioptres in [0.0, 0.4, 0.9, 1.3, 2.7] {
        // Circle of confusion: radius × film × (difference of vergences); 95 % of an even disc is within 0.975 of it.
        let expected_mm = 0.5 * diameter_mm * film_distance_mm * (dioptres - 1.0) * 1e-3 * 0.95f64.sqrt();
        let blur_mm = bank.blur_radius_mm(DVec2::X * 0.1, dioptres, 550.0);
        // The rms radius of the mesh's cells is 0.5 % short of the disc's.
        assert!((blur_mm / expected_mm - 1.0).abs() < 0.01, "{dioptres}: {blur_mm} {expected_mm}");
        // cos⁴ is exact for a thin lens and a far film but for the size of the pupil.
        let geometry = bank.radial_geometry(dioptres, 550.0).unwrap();
        let on_axis = PI * (0.5 * diameter_mm / film_distance_mm).powi(2);
        let expected = on_axis * (1.0 + 0.15f64 * 0.15).powi(-2);
        assert!((geometry.irradiance_per_radiance(0.15) / expected - 1.0).abs() < 3e-3);
        // A near point lights the near side of the lens more, which shows out of focus.
        assert!((geometry.image_radius_mm(0.15) - 0.15 * film_distance_mm).abs() < 2e-3);
    }
}

/// Returns a kernel of counted rays: a million spread evenly over the pupil.
fn counted(lens: &Lens, like: &Kernel, field_tan: f64, dioptres: f64, film_distance_mm: f64) -> Vec<f64> {
    let mono = lens.at(550.0).unwrap();
    let point = ObjectPoint::from_field(&mono, DVec2::new(field_tan, 0.0), dioptres);
    let boundary = PupilBoundary::find(&mono, &point, 64).unwrap();
    let extent_mm = boundary.rho_at_azimuths_mm().iter().copied().fold(0.0, f64::max);
    let n = 1_000_000;
    let spiral = |i: usize| {
        let radius_mm = extent_mm * ((i as f64 + 0.5) / n as f64).sqrt();
        boundary.center_mm() + DVec2::from_angle(2.399_963_229_728_653 * i as f64) * radius_mm
    };
    let targets: Vec<DVec2> = (0..n).map(spiral).collect();
    let mut rays = rays_towards(&point, &targets, boundary.z_mm(), 0.0);
    mono.trace(&mut rays, Vignetting::On);
    mono.to_film(&mut rays, film_distance_mm);
    let landed: Vec<DVec2> = mono.landed(&rays, film_distance_mm).map(FilmPoint::in_picture_mm).collect();
    let centroid = landed.iter().sum::<DVec2>() / landed.len() as f64;
    let side = like.samples.nrows();
    let mut counts = vec![0.0; side * side];
    for at in &landed {
        let at = (*at - centroid) * (1e3 / like.pitch_um);
        let (column, row) = ((at.x + 0.5 * side as f64) as usize, (0.5 * side as f64 - at.y) as usize);
        if column < side && row < side {
            counts[row * side + column] += 1.0 / landed.len() as f64;
        }
    }
    counts
}

#[test]
fn a_mesh_of_576_rays_is_as_good_as_a_million_counted_ones() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    for (field_tan, dioptres, pitch_um) in [(0.1, 0.05, 5.0), (0.1, 0.3, 3.0), (0.05, 1.0, 5.0)] {
        let settings = BankSettings {
            fields: FieldSampling::Radial(vec![0.0, field_tan]),
            ..BankSettings::covering(film_distance_mm, 0.1, (dioptres, dioptres), (550.0, 550.0), Diffraction::None)
        };
        let bank = LensImageModel::build(&lens, &settings).unwrap();
        let kernel = bank.kernel(PsfQuery::new(DVec2::new(field_tan, 0.0), dioptres, 550.0, pitch_um));
        assert!(kernel.samples.nrows() >= 20);
        let counts = counted(&lens, &kernel, field_tan, dioptres, film_distance_mm);
        let l1: f64 = kernel.samples.iter().zip(&counts).map(|(a, b)| (f64::from(*a) - b).abs()).sum();
        // The counts themselves are uneven: along a spiral by somewhat less than 1/√n.
        let n_lit = counts.iter().filter(|c| **c > 0.0).count();
        let noise = (n_lit as f64 * 2.0 / PI / 1e6).sqrt();
        assert!(l1 < 0.015f64.hypot(noise), "{field_tan}, {dioptres} D: {l1}");
        // Without noise: against sixteen times as many nodes.
        let fine = BankSettings { n_rings: 48, n_azimuths: 192, ..settings };
        let fine = LensImageModel::build(&lens, &fine).unwrap().kernel(PsfQuery::new(
            DVec2::new(field_tan, 0.0),
            dioptres,
            550.0,
            pitch_um,
        ));
        let margin = (fine.samples.nrows() as i64 - kernel.samples.nrows() as i64) / 2;
        let at = |row: usize, column: usize| {
            let (row, column) = (row as i64 - margin, column as i64 - margin);
            let (row, column) = (usize::try_from(row).ok()?, usize::try_from(column).ok()?);
            kernel.samples.get((row, column)).copied()
        };
        let l1: f32 = fine.samples.indexed_iter().map(|((r, c), e)| (e - at(r, c).unwrap_or(0.0)).abs()).sum();

        assert!(l1 < 0.01, "{field_tan}, {dioptres} D: {l1} from a finer mesh");
    }
}

/// Of a wavelength at which a kinoform sends a part of the light into its order, the film has that part, and the spread is as it was.
#[test]
fn a_blaze_takes_light_and_no_sharpness() {
    let glass = Glass::Constant { index: 1.5 };
    let interface = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    let interfaces =
        vec![interface(Surface::sphere(50.0, 5.0), glass, 2.0), interface(Surface::plane(5.0), Glass::Air, 0.0)];
    let lens = Lens::new("hybrid", "test", interfaces, 0).unwrap();
    let phase = |blaze| {
        let profile = PhaseProfile::Rings { radius_mm: 5.0, coefficients_rad: vec![-60.0] };
        let phase = DiffractiveSurface { surface: 1, order: 1, profile, blaze };
        lens.clone().with_diffractive(vec![phase]).unwrap()
    };
    let film_distance_mm = phase(None).at(550.0).unwrap().first_order().bfl_mm;
    let blaze = Blaze { design_nm: 550.0, order: None, levels: Some(8) };
    for diffraction in [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }] {
        let settings = BankSettings::covering(film_distance_mm, 0.1, (0.0, 0.0), (450.0, 550.0), diffraction);
        let [plain, blazed] = [None, Some(blaze)].map(|blaze| LensImageModel::build(&phase(blaze), &settings).unwrap());
        for nm in [450.0, 550.0] {
            let share = blaze.share_of(1, 550.0 / nm);
            let light = |bank: &LensImageModel| bank.radial_geometry(0.0, nm).unwrap().irradiance_per_radiance(0.05);
            assert!((light(&blazed) / light(&plain) / share - 1.0).abs() < 1e-9, "{nm}");
            let kernel = |bank: &LensImageModel| bank.kernel(PsfQuery::new(DVec2::new(0.05, 0.0), 0.0, nm, 4.0));
            let (a, b) = (kernel(&blazed), kernel(&plain));
            assert!(a.difference_from(&b) < 1e-5 && (a.sum() - b.sum()).abs() < 1e-5, "{nm}");
        }
    }
}
