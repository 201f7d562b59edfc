//! A lens's image through the parts of its pupil, held to that through the whole.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{f64::consts::PI, sync::Arc};

use dioptric_optics::{CoordinateBreak, Lens, glam::DVec2};
use dioptric_psf::{
    Diffraction, FilmQuery, ImageSettings, Kernel, LensImage, LensImageModel, PupilDivision, PupilSides, Sides,
};

const PITCH_UM: f64 = 4.0;

fn build(lens: &Lens, film_distance_mm: f64, diffraction: Diffraction) -> LensImageModel {
    LensImageModel::new(lens, &[550.0], &ImageSettings::new(film_distance_mm, diffraction)).unwrap()
}

/// A double Gauss focused at 2 m.
fn double_gauss() -> (Lens, f64) {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(2.8, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    (lens, film_distance_mm)
}

/// The same with all surfaces from `first` on moved or tilted.
fn moved(lens: &Lens, first: usize, decenter_mm: [f64; 3], tilt_deg: f64) -> Lens {
    let step = CoordinateBreak {
        surfaces: (first, lens.interfaces().len() - 1),
        pivot_mm: 0.0,
        decenter_mm,
        tilt_deg: [tilt_deg, 0.0, 0.0],
        tilt_first: false,
    };
    lens.clone().with_moves(vec![step]).unwrap()
}

fn query(place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> FilmQuery {
    FilmQuery { place_mm, dioptres, wavelength_nm, pitch_um: PITCH_UM }
}

/// Mean and second moments of a kernel about its point, mm and mm², x right and y up, pixels taken as points.
fn moments(kernel: &Kernel) -> (DVec2, [f64; 3]) {
    let (rows, columns) = kernel.samples.dim();
    let first = kernel.middle_px.as_dvec2() - DVec2::new((columns / 2) as f64, (rows / 2) as f64);
    let (mut mean, mut square) = (DVec2::ZERO, [0.0; 3]);
    for ((row, column), &energy) in kernel.samples.indexed_iter() {
        let at = 1e-3 * PITCH_UM * (first + DVec2::new(column as f64, row as f64)) * DVec2::new(1.0, -1.0);
        let energy = f64::from(energy);
        mean += energy * at;
        let products = [at.x * at.x, at.x * at.y, at.y * at.y];
        square.iter_mut().zip(products).for_each(|(sum, product)| *sum += energy * product);
    }
    (mean, square)
}

/// Irradiances, centroids and second moments of the parts are those of the whole: on the axis, moved sideways, and with tilted surfaces.
#[test]
fn parts_add_up_to_the_whole() {
    let (lens, film_distance_mm) = double_gauss();
    let last = lens.interfaces().len() - 2;
    let lenses = [
        ("on the axis", lens.clone()),
        ("moved", moved(&lens, 0, [2.0, -3.0, 0.0], 0.0)),
        ("tilted", moved(&lens, last, [0.0; 3], 0.5)),
    ];
    for (name, lens) in lenses {
        let model = build(&lens, film_distance_mm, Diffraction::None);
        let parts = model.through_parts(16).unwrap();
        assert_eq!(parts.len(), 16);
        let map = model.film_map(550.0, 12.0);
        let part_maps: Vec<_> = parts.iter().map(|part| part.film_map(550.0, 12.0)).collect();
        for (x, y, dioptres) in [(0.0, 0.0, 1.1), (7.5, -5.0, 1.1), (-4.0, 8.5, 0.25)] {
            let place_mm = DVec2::new(x, y);
            let (whole_mean, whole_square) = moments(&model.kernel(query(place_mm, dioptres, 550.0)));
            let (mut share, mut mean, mut square) = (0.0, DVec2::ZERO, [0.0; 3]);
            let mut widest_mm2 = 0.0_f64;
            for (part, part_map) in parts.iter().zip(&part_maps) {
                // All look the same way.
                assert_eq!(part_map.field_tan(place_mm), map.field_tan(place_mm));
                let of_light = part_map.irradiance_sr(place_mm) / map.irradiance_sr(place_mm);
                let kernel = part.kernel(query(place_mm, dioptres, 550.0));
                assert!((kernel.sum() - 1.0).abs() < 1e-5);
                let (own_mean, own_square) = moments(&kernel);
                share += of_light;
                mean += of_light * own_mean;
                (0..3).for_each(|i| square[i] += of_light * own_square[i]);
                widest_mm2 = widest_mm2.max(own_square[0] + own_square[2] - own_mean.length_squared());
            }
            let whole_mm2 = whole_square[0] + whole_square[2];
            println!("{name} {place_mm} {dioptres}: share {share:.6}, off {:.2e} mm", (mean - whole_mean).length());
            // Weights of cubics sum to 1.
            assert!((share - 1.0).abs() < 1e-9, "{name} {place_mm}: {share}");
            // Shares run between 32 directions and 65 radii.
            assert!((mean - whole_mean).length() < 0.01 * whole_mm2.sqrt(), "{name} {place_mm}: {mean}");
            for (sum, whole) in square.iter().zip(whole_square) {
                assert!((sum - whole).abs() < 0.01 * whole_mm2, "{name} {place_mm}: {square:?} {whole_square:?}");
            }
            // A part of sixteen is a quarter as wide, and a third more since it overlaps its neighbors.
            assert!(widest_mm2 < 0.45_f64.powi(2) * whole_mm2, "{name}: {widest_mm2} {whole_mm2}");
        }
    }
}

/// A part to the right sees near things from the right: what lies before the plane of focus it sees farther to the left.
#[test]
fn parts_see_from_their_places() {
    let (lens, film_distance_mm) = double_gauss();
    let model = build(&lens, film_distance_mm, Diffraction::default());
    let parts = model.through_parts(7).unwrap();
    let blur_mm = |dioptres: f64| model.blur_radius_mm(DVec2::ZERO, dioptres, 550.0);
    let (near_blur_mm, far_blur_mm) = (blur_mm(1.2), blur_mm(0.2));
    assert!(near_blur_mm > 0.2 && far_blur_mm < -0.1, "{near_blur_mm} {far_blur_mm}");
    for (i, part) in parts.iter().enumerate() {
        let middle = PupilDivision::new(7).centroid(i);
        let aside = |dioptres: f64| moments(&part.kernel(query(DVec2::ZERO, dioptres, 550.0))).0;
        // Light of the outer pupil is a little farther out than its radius of blur says: spherical aberration.
        let (near_mm, far_mm) = (aside(1.2), aside(0.2));
        assert!((near_mm + near_blur_mm * middle).length() < 0.1 * near_blur_mm, "{middle}: {near_mm}");
        assert!((far_mm + far_blur_mm * middle).length() < 0.1 * far_blur_mm.abs(), "{middle}: {far_mm}");
        // What is left in focus is that spherical aberration: some 10 µm at f/2.8.
        assert!(aside(0.5).length() < 0.06 * near_blur_mm);
    }
}

#[test]
fn waves_are_not_divided() {
    let (lens, film_distance_mm) = double_gauss();
    let refused = build(&lens, film_distance_mm, Diffraction::Wave).through_parts(4).err().unwrap().to_string();
    assert!(refused.contains("take HURB or no diffraction"), "{refused}");
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
    let model = build(&lens, film_distance_mm, Diffraction::None);
    let check = |sides: PupilSides, of_ideal: f64| {
        let division = PupilDivision::from(sides);
        let [left, right] = model.through(division.clone()).unwrap().try_into().ok().unwrap();
        assert!((division.centroid(1).x / (4.0 / (3.0 * PI)) - of_ideal).abs() < 1e-3);
        for dioptres in [0.2, 0.4, 0.5, 0.7, 1.2] {
            let defocus = 1.0 - film_distance_mm / image_mm(dioptres);
            let expected_mm = of_ideal * radius_mm * 8.0 / (3.0 * PI) * defocus;
            for place_mm in [DVec2::ZERO, DVec2::new(6.0, -5.0), DVec2::new(-3.5, 10.0)] {
                let at = |part: &Arc<dyn LensImage + Send>| moments(&part.kernel(query(place_mm, dioptres, 550.0))).0;
                let apart_mm = at(&left) - at(&right);
                // Cells on the boundary belong to both sides, and the pupil is divided by direction cosines at the film, in which what bounds the
                // halves of a disc of f/2 seen from aside bends by 3 % of their width. In focus, a tenth of a micrometer.
                let tolerance_mm = (4e-2 * expected_mm.abs()).max(1e-4);
                let error_mm = apart_mm - DVec2::new(expected_mm, 0.0);
                assert!(error_mm.length() < tolerance_mm, "{dioptres} {place_mm}: {apart_mm} {expected_mm}");
            }
        }
    };
    let ideal = PupilSides { sides: Sides::LeftRight, crosstalk: 0.0, transition: 0.0 };
    check(ideal, 1.0);
    check(PupilSides { crosstalk: 0.1, ..ideal }, 0.8);
    let soft = PupilSides { transition: 0.3, ..ideal };
    check(soft, PupilDivision::from(soft).centroid(1).x * 3.0 * PI / 4.0);
}
