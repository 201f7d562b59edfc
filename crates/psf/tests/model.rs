//! The model of a lens's image as a whole: progress, cancelling, sampling for previews.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::sync::Mutex;

use dioptric_optics::{CoordinateBreak, Lens, glam::DVec2};
use dioptric_psf::{
    BankSettings, Diffraction, ErrorPlaces, FieldSampling, Kernel, LensImage, LensImageModel, PsfError, PsfQuery,
    SampleCounts, lens_on_axis,
};
use dioptric_spectrum::Cancel;

const HURB: Diffraction = Diffraction::Hurb { gamma: 1.0 };

fn double_gauss() -> (Lens, f64) {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    (lens, film_distance_mm)
}

fn along_radius(film_distance_mm: f64) -> BankSettings {
    BankSettings::covering(film_distance_mm, 0.2, (0.1, 1.2), (420.0, 680.0), HURB)
}

fn over_grid(film_distance_mm: f64) -> BankSettings {
    let corners = (DVec2::new(-0.2, -0.15), DVec2::new(0.2, 0.15));
    BankSettings::covering_grid(film_distance_mm, corners, (0.1, 1.2), (420.0, 680.0), HURB)
        .with_counts(SampleCounts::PREVIEW)
}

/// Reports ascend to 1 on one thread, step by step.
#[test]
fn progress_ascends_to_one() {
    let (lens, film_distance_mm) = double_gauss();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for settings in [along_radius(film_distance_mm).with_counts(SampleCounts::PREVIEW), over_grid(film_distance_mm)] {
        let heard = Mutex::new(vec![]);
        let progress = |part: f64| heard.lock().unwrap().push(part);
        one.install(|| LensImageModel::build_with(&lens, &settings, &progress, &Cancel::new())).unwrap();
        let heard = heard.into_inner().unwrap();
        assert!(heard.len() > 30, "{}", heard.len());
        assert!(heard.windows(2).all(|pair| pair[0] <= pair[1]), "{heard:?}");
        assert_eq!(heard.last(), Some(&1.0));
    }
}

/// After the request each thread ends the one sample that it is at, some milliseconds, and begins no other.
#[test]
fn cancelled_build_begins_no_more_samples() {
    let (lens, film_distance_mm) = double_gauss();
    for n_threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        for settings in [along_radius(film_distance_mm), over_grid(film_distance_mm)] {
            let cancel = Cancel::new();
            let after = Mutex::new(0);
            let progress = |_: f64| {
                *after.lock().unwrap() += usize::from(cancel.is_cancelled());
                cancel.cancel();
            };
            let error = pool.install(|| LensImageModel::build_with(&lens, &settings, &progress, &cancel)).unwrap_err();
            assert!(matches!(error, PsfError::Cancelled(_)), "{error}");
            assert!(*after.lock().unwrap() < n_threads, "{} samples were begun", after.lock().unwrap());
        }
    }
}

/// Measuring the error, and sampling until it is met, end with a request too.
#[test]
fn cancelled_measurement_has_no_result() {
    let (lens, film_distance_mm) = double_gauss();
    let settings = along_radius(film_distance_mm).with_counts(SampleCounts::PREVIEW);
    let model = LensImageModel::build(&lens, &settings).unwrap();
    let cancel = Cancel::new();
    cancel.cancel();
    let error = model.measured_error(&ErrorPlaces::STANDARD, &cancel).unwrap_err();
    assert!(matches!(error, PsfError::Cancelled(_)), "{error}");
    let wanted = dioptric_psf::AdaptiveSettings::STANDARD;
    let error = LensImageModel::build_adaptive(&lens, &settings, &wanted, &|_| {}, &cancel).unwrap_err();
    assert!(matches!(error, PsfError::Cancelled(_)), "{error}");
}

/// The figure that the documentation of [`SampleCounts::PREVIEW`] states.
#[test]
fn preview_blurs_keep_to_a_tenth() {
    let (lens, film_distance_mm) = double_gauss();
    let preview = along_radius(film_distance_mm).with_counts(SampleCounts::PREVIEW);
    let places = ErrorPlaces { n_places: 24, ..ErrorPlaces::STANDARD };
    for settings in [preview, over_grid(film_distance_mm)] {
        let model = LensImageModel::build(&lens, &settings).unwrap();
        let error = model.measured_error(&places, &Cancel::new()).unwrap();
        println!("{} samples: {error:?}", settings.n_samples());
        assert!(error.median < 0.1, "{error:?}");
    }
}

/// Single points of a placed lens have pictures, but no scene can be imaged through them.
#[test]
fn single_points_see_no_film() {
    let (lens, film_distance_mm) = double_gauss();
    let tilt = CoordinateBreak {
        surfaces: (2, 3),
        pivot_mm: 0.0,
        decenter_mm: [0.0; 3],
        tilt_deg: [0.3, 0.0, 0.0],
        tilt_first: false,
    };
    let lens = lens.with_moves(vec![tilt]).unwrap();
    let fields = FieldSampling::Points { tans_x: vec![0.0, 0.1], tans_y: vec![0.0] };
    let settings = BankSettings { fields, dioptres: vec![0.5], ..along_radius(film_distance_mm) };
    let points = LensImageModel::build(&lens, &settings).unwrap();
    assert!(points.centroid_mm(DVec2::X * 0.1, 0.5, 550.0).is_finite());
    assert!(points.film_map(0.5, 550.0, 10.0).at(DVec2::X).is_none());
    let one = FieldSampling::Grid { tans_x: vec![0.0, 0.1], tans_y: vec![0.0] };
    let message = LensImageModel::build(&lens, &BankSettings { fields: one, ..settings }).unwrap_err().to_string();
    assert!(message.starts_with("tans_y is 1, expected 2 fields or more"), "{message}");
}

/// Scene and film stay where a lens is moved sideways: a far point follows the lens on the film, a near one goes farther.
#[test]
fn lens_moved_sideways_is_sampled_about_its_axis() {
    let (lens, film_distance_mm) = double_gauss();
    let aside = DVec2::new(2.0, -3.0);
    let step = CoordinateBreak {
        surfaces: (0, lens.interfaces().len() - 1),
        pivot_mm: 0.0,
        decenter_mm: [aside.x, aside.y, 0.0],
        tilt_deg: [0.0; 3],
        tilt_first: false,
    };
    let moved = lens.clone().with_moves(vec![step]).unwrap();
    assert_eq!(lens_on_axis(&moved, 550.0).map(|(_, aside)| aside), Some(aside));
    let model = LensImageModel::build(&moved, &along_radius(film_distance_mm)).unwrap();
    assert!(!model.is_symmetric() && model.radial_geometry(0.5, 550.0).is_none());
    assert_eq!(model.lens(), &moved);
    for (x, y, dioptres, wavelength_nm) in [(0.0, 0.0, 0.5, 550.0), (0.09, 0.05, 1.2, 460.0), (-0.12, 0.08, 0.1, 640.0)]
    {
        let field_tan = DVec2::new(x, y);
        let there = BankSettings {
            fields: FieldSampling::Points { tans_x: vec![x], tans_y: vec![y] },
            dioptres: vec![dioptres],
            wavelengths_nm: vec![wavelength_nm],
            ..along_radius(film_distance_mm)
        };
        let traced = LensImageModel::build(&moved, &there).unwrap();
        let (found_mm, traced_mm) = (
            model.centroid_mm(field_tan, dioptres, wavelength_nm),
            traced.centroid_mm(field_tan, dioptres, wavelength_nm),
        );
        // What the interpolation of the centered lens leaves: a quarter of a micrometre of twenty pixels.
        assert!((found_mm - traced_mm).length() < 2.5e-4, "{field_tan}: {found_mm} {traced_mm}");
        let map = model.film_map(dioptres, wavelength_nm, 10.0);
        let (seen_tan, gain) = map.at(found_mm).unwrap();
        assert!((seen_tan - field_tan).length() < 1e-6, "{seen_tan} {field_tan}");
        let expected = model.irradiance_per_radiance(field_tan, dioptres, wavelength_nm);
        assert!((gain / expected - 1.0).abs() < 1e-4, "{gain} {expected}");
        let query = PsfQuery::new(field_tan, dioptres, wavelength_nm, 5.0);
        let (kernel, expected) = (model.kernel(query), traced.kernel(query));
        // As for a lens on its axis: each interpolates to a per cent or two of a blur's pixels.
        assert!(kernel.difference_from(&expected) < 0.05, "{field_tan}: {}", kernel.difference_from(&expected));
        let blurs = [&model, &traced].map(|model| model.blur_radius_mm(field_tan, dioptres, wavelength_nm));
        assert!((blurs[0] - blurs[1]).abs() < 0.02 * blurs[1].abs() + 1e-3, "{field_tan}: {blurs:?}");
    }
}

/// Of a comet the kernel that imaging takes is about its middle ray: its centroid lies where it says, and where the map puts it beside the middle
/// ray, so that light is where the model says. Without diffraction, with HURB and with waves.
#[test]
fn kernels_and_maps_are_about_one_place() {
    let lens = Lens::built_in("paper-2el").unwrap().with_f_number(8.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let (dioptres, wavelength_nm, pitch_um) = (0.5, 550.0, 8.0);
    for diffraction in [Diffraction::None, HURB, Diffraction::Wave] {
        let settings = BankSettings::covering(
            film_distance_mm,
            0.2,
            (dioptres, dioptres),
            (wavelength_nm, wavelength_nm),
            diffraction,
        );
        let model = LensImageModel::build(&lens, &settings).unwrap();
        let imaging: &dyn LensImage = &model;
        let (map, centroids) =
            (imaging.film_map(dioptres, wavelength_nm, 9.0), model.film_map(dioptres, wavelength_nm, 9.0));
        for place_mm in [DVec2::new(0.02, 0.0), DVec2::new(3.0, 4.0), DVec2::new(-7.5, 2.0)] {
            let (field_tan, gain) = map.at(place_mm).unwrap();
            let query = PsfQuery::new(field_tan, dioptres, wavelength_nm, pitch_um);
            let kernel = imaging.kernel(query);
            let aside = |kernel: &Kernel| {
                (kernel.middle_px.as_dvec2() + kernel.centroid_px) * DVec2::new(1e-3, -1e-3) * pitch_um
            };
            let aside_mm = aside(&kernel);
            let centroid_mm = model.centroid_mm(field_tan, dioptres, wavelength_nm);
            // Tables of the map: a hundredth of a pixel.
            assert!((place_mm + aside_mm - centroid_mm).length() < 1e-4, "{place_mm}: {aside_mm} {centroid_mm}");
            // Outwards of the axis, as far as coma grows: by some per cent of the height at most.
            assert!(
                aside_mm.length() < 0.02 * place_mm.length() && (place_mm.length() < 1.0 || aside_mm.length() > 1e-3)
            );
            // The same picture as about the centroid, but for where pixels begin: its own centroid and its width.
            let [moments, about] = [&kernel, &model.kernel(query)].map(|kernel| moments(&kernel.samples));
            let off = (moments.0 - kernel.centroid_px).length();
            // A core within a pixel counts as its middle.
            assert!(off < 0.1, "{diffraction:?} {place_mm}: {off}");
            assert!((moments.1 / about.1 - 1.0).abs() < 0.03, "{diffraction:?} {place_mm}: {} {}", moments.1, about.1);
            // A plane is as bright by both maps, once centroids that move against middle rays thin it out.
            let thinned = |mm: DVec2| {
                let tan = map.at(mm).unwrap().0;
                aside(&imaging.kernel(PsfQuery::new(tan, dioptres, wavelength_nm, pitch_um)))
            };
            let by = 0.01;
            let slope = |way: DVec2| (thinned(place_mm + way * by) - thinned(place_mm - way * by)) / (2.0 * by);
            let det = (DVec2::X + slope(DVec2::X)).perp_dot(DVec2::Y + slope(DVec2::Y));
            let expected = centroids.at(centroid_mm).unwrap().1;
            assert!((gain / det / expected - 1.0).abs() < 2e-4, "{place_mm}: {}", gain / det / expected - 1.0);
        }
    }
}

/// The centroid, pixels right of and below the middle, and the rms distance from it.
fn moments(samples: &ndarray::Array2<f32>) -> (DVec2, f64) {
    let middle = DVec2::new(samples.ncols() as f64 - 1.0, samples.nrows() as f64 - 1.0) / 2.0;
    let sum = |of: &dyn Fn(DVec2) -> DVec2| -> DVec2 {
        let at = |(row, column): (usize, usize)| DVec2::new(column as f64, row as f64) - middle;
        samples.indexed_iter().map(|(place, &sample)| of(at(place)) * f64::from(sample)).sum()
    };
    let total = sum(&|_| DVec2::X).x;
    let centroid = sum(&|at| at) / total;
    (centroid, (sum(&|at| DVec2::X * at.distance_squared(centroid)).x / total).sqrt())
}
