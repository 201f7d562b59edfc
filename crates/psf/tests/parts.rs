//! A lens's image through the parts of its pupil, held to that through the whole.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{f64::consts::PI, sync::Arc};

use dioptric_optics::{
    CoordinateBreak, Lens,
    glam::{DMat2, DVec2},
};
use dioptric_psf::{
    BankSettings, Diffraction, FilmMap, Interpolation, Kernel, LensImage, LensImageModel, PsfQuery, PupilDivision,
    PupilSides, Sides,
};

const PITCH_UM: f64 = 4.0;

fn settings(film_distance_mm: f64, diffraction: Diffraction) -> BankSettings {
    BankSettings::covering(film_distance_mm, 0.3, (0.2, 1.2), (450.0, 650.0), diffraction)
}

/// A double Gauss focused at 2 m, as it is and with all surfaces from `first` on moved or tilted.
fn double_gauss(moved: Option<(usize, [f64; 3], f64)>) -> (Lens, f64) {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(2.8, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let Some((first, decenter_mm, tilt_deg)) = moved else { return (lens, film_distance_mm) };
    let step = CoordinateBreak {
        surfaces: (first, lens.interfaces().len() - 1),
        pivot_mm: 0.0,
        decenter_mm,
        tilt_deg: [tilt_deg, 0.0, 0.0],
        tilt_first: false,
    };
    (lens.with_moves(vec![step]).unwrap(), film_distance_mm)
}

/// On the axis, moved sideways as a whole, and with its last surfaces tilted: along a radius, about another axis, over a grid.
fn models(diffraction: Diffraction) -> Vec<(&'static str, LensImageModel)> {
    let (centered, film_distance_mm) = double_gauss(None);
    let along_radius = settings(film_distance_mm, diffraction);
    let corners = (DVec2::splat(-0.25), DVec2::splat(0.25));
    let over_grid = BankSettings::covering_grid(film_distance_mm, corners, (0.2, 1.2), (450.0, 650.0), diffraction);
    let (moved, _) = double_gauss(Some((0, [2.0, -3.0, 0.0], 0.0)));
    let (tilted, _) = double_gauss(Some((centered.interfaces().len() - 2, [0.0; 3], 0.5)));
    let build = |lens: &Lens, settings| LensImageModel::build(lens, settings).unwrap();
    vec![
        ("on the axis", build(&centered, &along_radius)),
        ("moved", build(&moved, &along_radius)),
        ("tilted", build(&tilted, &over_grid)),
    ]
}

/// Where a field lands by a film map, mm, how that moves with the field, and the irradiance per radiance there.
fn landed(map: &FilmMap, field_tan: DVec2) -> (DVec2, f64, f64) {
    let place = |field_tan: DVec2| {
        let mut at_mm = 50.0 * field_tan;
        for _ in 0..60 {
            at_mm += 45.0 * (field_tan - map.at(at_mm).unwrap().0);
        }
        at_mm
    };
    let by = 1e-3;
    let slope = |way: DVec2| (place(field_tan + by * way) - place(field_tan - by * way)) / (2.0 * by);
    let det = DMat2::from_cols(slope(DVec2::X), slope(DVec2::Y)).determinant().abs();
    let at_mm = place(field_tan);
    (at_mm, det, map.at(at_mm).unwrap().1)
}

/// Mean and second moments of a kernel, mm and mm², x right and y up, pixels taken as points.
fn moments(kernel: &Kernel) -> (DVec2, [f64; 3]) {
    let middle = (kernel.samples.nrows() / 2) as f64;
    let (mut mean, mut square) = (DVec2::ZERO, [0.0; 3]);
    for ((row, column), &energy) in kernel.samples.indexed_iter() {
        let at = 1e-3 * PITCH_UM * DVec2::new(column as f64 - middle, middle - row as f64);
        let energy = f64::from(energy) / kernel.sum();
        mean += energy * at;
        let products = [at.x * at.x, at.x * at.y, at.y * at.y];
        square.iter_mut().zip(products).for_each(|(sum, product)| *sum += energy * product);
    }
    (mean, square)
}

/// Shares, centroids and second moments of the parts are those of the whole, of every kind of model.
#[test]
fn parts_add_up_to_the_whole() {
    for (name, model) in models(Diffraction::None) {
        let parts = model.through_parts(16).unwrap();
        assert_eq!(parts.len(), 16);
        for (x, y, dioptres, nm) in [(0.0, 0.0, 1.1, 550.0), (0.15, -0.1, 1.1, 480.0), (-0.08, 0.17, 0.25, 630.0)] {
            let field_tan = DVec2::new(x, y);
            let query = PsfQuery::new(field_tan, dioptres, nm, PITCH_UM);
            let (whole_mm, whole_det, whole_gain) = landed(&model.film_map(dioptres, nm, 20.0), field_tan);
            let (_, whole_square) = moments(&model.kernel(query));
            let (mut share, mut centroid_mm, mut square) = (0.0, DVec2::ZERO, [0.0; 3]);
            let mut widest_mm2 = 0.0_f64;
            for part in &parts {
                let (at_mm, det, gain) = landed(&part.film_map(dioptres, nm, 20.0), field_tan);
                let of_light = gain * det / (whole_gain * whole_det);
                let aside_mm = at_mm - whole_mm;
                let (mean_mm, inner) = moments(&part.kernel(query));
                assert!(mean_mm.length() < 0.1e-3 * PITCH_UM, "{name}: {mean_mm}");
                share += of_light;
                centroid_mm += of_light * aside_mm;
                let outer = [aside_mm.x * aside_mm.x, aside_mm.x * aside_mm.y, aside_mm.y * aside_mm.y];
                (0..3).for_each(|i| square[i] += of_light * (inner[i] + outer[i]));
                widest_mm2 = widest_mm2.max(inner[0] + inner[2]);
            }
            let whole_mm2 = whole_square[0] + whole_square[2];
            println!(
                "{name} {field_tan} {dioptres}: share {share:.5}, centroid {:.2e} mm, blur {:.1} px, widest part {:.2} of it",
                centroid_mm.length(),
                1e3 * whole_mm2.sqrt() / PITCH_UM,
                (widest_mm2 / whole_mm2).sqrt(),
            );
            // Shares are those of samples between which cubics run; places lie between the nodes of a table a millimetre apart.
            assert!((share - 1.0).abs() < 3e-3, "{name} {field_tan}: {share}");
            assert!(centroid_mm.length() < 0.02 * whole_mm2.sqrt(), "{name} {field_tan}: {centroid_mm}");
            for (sum, whole) in square.iter().zip(whole_square) {
                assert!((sum - whole).abs() < 0.02 * whole_mm2, "{name} {field_tan}: {square:?} {whole_square:?}");
            }
            // A part of sixteen is a quarter as wide, and a third more since it overlaps its neighbors.
            assert!(widest_mm2 < 0.45_f64.powi(2) * whole_mm2, "{name}: {widest_mm2} {whole_mm2}");
        }
    }
}

/// A part to the right sees near things from the right: what lies before the plane of focus lands farther to the left in its picture.
#[test]
fn parts_see_from_their_places() {
    let (lens, film_distance_mm) = double_gauss(None);
    let model = LensImageModel::build(&lens, &settings(film_distance_mm, Diffraction::default())).unwrap();
    let parts = model.through_parts(7).unwrap();
    let aside = |part: &Arc<dyn LensImage + Send>, dioptres: f64| {
        landed(&part.film_map(dioptres, 550.0, 20.0), DVec2::ZERO).0
            - landed(&model.film_map(dioptres, 550.0, 20.0), DVec2::ZERO).0
    };
    let (near_blur_mm, far_blur_mm) =
        (model.blur_radius_mm(DVec2::ZERO, 1.2, 550.0), model.blur_radius_mm(DVec2::ZERO, 0.2, 550.0));
    assert!(near_blur_mm > 0.2 && far_blur_mm < -0.1, "{near_blur_mm} {far_blur_mm}");
    for (i, part) in parts.iter().enumerate() {
        let middle = middle_of_part(i);
        let (near_mm, far_mm) = (aside(part, 1.2), aside(part, 0.2));
        // Light of the outer pupil is a little farther out than its radius of blur says: spherical aberration.
        assert!((near_mm + near_blur_mm * middle).length() < 0.1 * near_blur_mm, "{middle}: {near_mm}");
        assert!((far_mm + far_blur_mm * middle).length() < 0.1 * far_blur_mm.abs(), "{middle}: {far_mm}");
        // What is left in focus is that spherical aberration: some 10 µm at f/2.8.
        assert!(aside(part, 0.5).length() < 0.06 * near_blur_mm);
        // But for what diffraction takes beyond the window.
        let sum = part.kernel(PsfQuery::new(DVec2::ZERO, 1.2, 550.0, PITCH_UM)).sum();
        assert!((0.985..1.001).contains(&sum), "{middle}: {sum}");
    }
}

/// The middle of one of seven parts in the unit disc, x right and y up as seen from the scene.
fn middle_of_part(part: usize) -> DVec2 {
    let division = PupilDivision::new(7);
    let places = (0..10_000).map(|i| DVec2::new(f64::from(i % 100), f64::from(i / 100)) / 49.5 - 1.0);
    let inside = places.filter(|at| at.length() < 1.0);
    let (sum, share) = inside.fold((DVec2::ZERO, 0.0), |(sum, total), at| {
        let share = division.share(part, at);
        (sum + share * at, total + share)
    });
    sum / share
}

#[test]
fn waves_and_blended_pictures_are_not_divided() {
    let (lens, film_distance_mm) = double_gauss(None);
    let few = BankSettings { n_rings: 4, n_azimuths: 16, ..settings(film_distance_mm, Diffraction::Wave) };
    let message = |settings: &BankSettings| {
        LensImageModel::build(&lens, settings).unwrap().through_parts(4).err().map(|error| error.to_string())
    };
    assert!(message(&few).unwrap().contains("take HURB or no diffraction"));
    let blended = BankSettings { interpolation: Interpolation::Images, diffraction: Diffraction::None, ..few.clone() };
    assert!(message(&blended).unwrap().contains("take interpolated rays"));
    assert_eq!(message(&BankSettings { diffraction: Diffraction::None, ..few }), None);
}

/// Of a thin lens of radius A with the image of a point at v and the film at d, the light of a place x of the pupil lands at x (1 − d/v). The
/// halves land 2 · 4A/(3π) · |1 − d/v| apart, with crosstalk c the part 1 − 2 c of that: the left view sees near things to the right, far
/// things to the left, and what is in focus nowhere else.
#[test]
fn halves_of_a_thin_lens_are_as_far_apart_as_their_centroids() {
    let (focal_mm, radius_mm) = (50.0, 12.5);
    let lens = Lens::thin(focal_mm, 2.0 * radius_mm).unwrap();
    let image_mm = |dioptres: f64| 1.0 / (1.0 / focal_mm - 1e-3 * dioptres);
    let film_distance_mm = image_mm(0.5);
    let model = LensImageModel::build(&lens, &settings(film_distance_mm, Diffraction::None)).unwrap();
    let check = |sides: PupilSides, of_ideal: f64| {
        let division = PupilDivision::from(sides);
        let [left, right] = model.through(division.clone()).unwrap().try_into().ok().unwrap();
        assert!((division.centroid(1).x / (4.0 / (3.0 * PI)) - of_ideal).abs() < 1e-3);
        for dioptres in [0.2, 0.4, 0.5, 0.7, 1.2] {
            let defocus = 1.0 - film_distance_mm / image_mm(dioptres);
            let expected_mm = of_ideal * radius_mm * 8.0 / (3.0 * PI) * defocus;
            for field_tan in [DVec2::ZERO, DVec2::new(0.12, -0.1), DVec2::new(-0.07, 0.2)] {
                let at = |part: &Arc<dyn LensImage + Send>| landed(&part.film_map(dioptres, 550.0, 20.0), field_tan).0;
                let apart_mm = at(&left) - at(&right);
                // .4 %: cells on the boundary belong to both sides, and cubics run between 32 directions of the field. In focus, a
                // tenth of a micrometer.
                let tolerance_mm = (4e-3 * expected_mm.abs()).max(1e-4);
                let error_mm = apart_mm - DVec2::new(expected_mm, 0.0);
                assert!(error_mm.length() < tolerance_mm, "{dioptres} {field_tan}: {apart_mm} {expected_mm}");
            }
        }
    };
    let ideal = PupilSides { sides: Sides::LeftRight, crosstalk: 0.0, transition: 0.0 };
    check(ideal, 1.0);
    check(PupilSides { crosstalk: 0.1, ..ideal }, 0.8);
    let soft = PupilSides { transition: 0.3, ..ideal };
    check(soft, PupilDivision::from(soft).centroid(1).x * 3.0 * PI / 4.0);
}
