//! Objects in water, oil and glass: closed forms of immersion, and an independent tool.

use std::path::Path;

use dioptric_optics::{
    Glass, Interface, Lens, LensFile, MonoLens, ObjectPoint, OpticsError, RayBatch, ReadOptions, SeidelSettings,
    Surface, Vignetting,
    analysis::{AstigmaticFoci, NumericalApertures, PupilCoordinates, PupilSampling, projected_solid_angle},
    glam::{DVec2, DVec3},
};

const GREEN_NM: f64 = 550.0;

fn constant(index: f64) -> Glass {
    if index == 1.0 { Glass::Air } else { Glass::Constant { index } }
}

/// A lens of rows of radius (infinite for a plane), semi-aperture, index behind and thickness, with its object in a
/// medium of this index.
fn lens(object_index: f64, rows: &[[f64; 4]], stop: usize) -> Lens {
    let interface = |&[radius_mm, semi_aperture_mm, index, thickness_after_mm]: &[f64; 4]| Interface {
        surface: Surface { curvature_per_mm: 1.0 / radius_mm, ..Surface::plane(semi_aperture_mm) },
        medium_after: constant(index),
        thickness_after_mm,
    };
    let lens =
        Lens::new("immersed", "a test", rows.iter().map(interface).collect(), stop).expect("the rows make a lens");
    lens.with_object_medium(constant(object_index)).expect("an index above 0")
}

/// One surface, the end of a ball of glass towards air.
fn ball(index: f64, radius_mm: f64) -> MonoLens {
    lens(index, &[[-radius_mm, 0.999 * radius_mm, 1.0, 0.0]], 0).at(GREEN_NM).expect("a constant index")
}

/// Rays from a point at angles up to this one, traced through all surfaces; path lengths from the point.
fn fan(lens: &MonoLens, z_mm: f64, steepest_deg: f64) -> RayBatch {
    let directions: Vec<DVec3> = (-20..=20)
        .map(|i| f64::from(i) / 20.0 * steepest_deg.to_radians())
        .map(|angle| DVec3::new(0.6 * angle.sin(), 0.8 * angle.sin(), angle.cos()))
        .collect();
    let mut rays = RayBatch::from_points(&vec![DVec3::Z * z_mm; directions.len()], &directions);
    lens.trace(&mut rays, Vignetting::On);
    assert_eq!(rays.n_in_flight(), rays.len());
    rays
}

/// Where the line of a ray crosses the axis, from the first vertex, mm.
fn crossing_mm(rays: &RayBatch, i: usize) -> f64 {
    let (point, direction) = (rays.point_mm(i), rays.direction(i));
    let (place, slope) = (point.truncate(), direction.truncate() / direction.z);
    point.z - place.dot(slope) / slope.length_squared()
}

#[test]
fn a_ball_images_its_aplanatic_point_without_aberration() {
    for (index, radius_mm) in [(1.5, 2.0), (1.85, 0.7)] {
        let ball = ball(index, radius_mm);
        let object_z_mm = -radius_mm * (1.0 + 1.0 / index);
        let image_z_mm = -radius_mm * (1.0 + index);
        let conjugate = ball.conjugate(-object_z_mm);
        assert!((conjugate.image_z_mm - image_z_mm).abs() < 1e-13 * radius_mm);
        assert!((conjugate.magnification / (index * index) - 1.0).abs() < 1e-14);
        let rays = fan(&ball, object_z_mm, 50.0);
        for i in (0..rays.len()).filter(|&i| i != 20) {
            let angle = (i as f64 - 20.0) / 20.0 * 50f64.to_radians();
            // The angle's own rounding moves the crossing of the flattest rays by 1e-16 over it.
            assert!((crossing_mm(&rays, i) - image_z_mm).abs() < 2e-13, "{angle}");
            // Abbe's sine condition: n sin u = m n′ sin u′, m = n².
            let sine = rays.direction(i).truncate().length();
            assert!((sine * index - angle.abs().sin()).abs() < 2e-15, "{angle}");
            // Equal paths, those behind counted back to the virtual image.
            let back_mm = rays.point_mm(i).distance(DVec3::Z * image_z_mm);
            let axis_mm = index * -object_z_mm + image_z_mm;
            assert!((rays.opl_mm[i] - back_mm - axis_mm).abs() < 2e-14, "{angle}");
        }
    }
}

#[test]
fn a_hemisphere_magnifies_its_center_by_its_index() {
    let ball = ball(1.6, 3.0);
    let rays = fan(&ball, -3.0, 80.0);
    for i in 0..rays.len() {
        let angle = (i as f64 - 20.0) / 20.0 * 80f64.to_radians();
        assert!((rays.direction(i).truncate().length() - angle.abs().sin()).abs() < 1e-15);
        assert!((rays.opl_mm[i] - 1.6 * 3.0).abs() < 1e-14);
    }
    let conjugate = ball.conjugate(3.0);
    assert!((conjugate.image_z_mm + 3.0).abs() < 1e-14 && (conjugate.magnification - 1.6).abs() < 1e-14);
}

#[test]
fn aplanatic_points_have_no_seidel_sums_but_petzvals_and_distortion() {
    let (index, radius_mm) = (1.5, 2.0);
    let lens = lens(index, &[[-radius_mm, 1.0, 1.0, 0.0]], 0);
    let sums = |object_distance_mm| {
        let settings = SeidelSettings {
            wavelength_nm: GREEN_NM,
            colors_nm: [500.0, 600.0],
            object_distance_mm,
            chief_slope: 0.05,
        };
        lens.seidel(&settings).unwrap()
    };
    for distance_mm in [radius_mm * (1.0 + 1.0 / index), radius_mm] {
        let found = sums(distance_mm);
        assert!(found.total.s1.abs() < 1e-15, "{distance_mm}: {:?}", found.total);
        // H = n u ȳ − n ū y at the surface, where ȳ = 0.
        let marginal = found.lagrange_mm / (index * 0.05);
        assert!((marginal.abs() - 1.0).abs() < 1e-14);
        // Petzval: −H² c (1/n′ − 1/n).
        let petzval = found.lagrange_mm.powi(2) / radius_mm * (1.0 - 1.0 / index);
        assert!((found.total.s4 / petzval - 1.0).abs() < 1e-13);
    }
    let aplanatic = sums(radius_mm * (1.0 + 1.0 / index)).total;
    assert!(aplanatic.s2.abs() < 1e-15 && aplanatic.s3.abs() < 1e-15);
    // Anywhere else the ball aberrates.
    assert!(sums(1.2 * radius_mm).total.s1.abs() > 1e-4);
}

#[test]
fn a_plane_shows_the_apparent_depth() {
    let water = lens(4.0 / 3.0, &[[f64::INFINITY, 5.0, 1.0, 0.0]], 0).at(GREEN_NM).unwrap();
    let conjugate = water.conjugate(12.0);
    assert!((conjugate.image_z_mm + 9.0).abs() < 1e-14 && (conjugate.magnification - 1.0).abs() < 1e-15);
    // From the side the apparent depth is Coddington's: sagittal d cos θ′ / (n cos θ), along the axis.
    let theta = 0.4_f64;
    let theta_after = (4.0 / 3.0 * theta.sin()).asin();
    let point = ObjectPoint::Finite(DVec3::new(0.0, 12.0 * theta.tan(), -12.0));
    let foci = AstigmaticFoci::find(&water, &point).unwrap();
    let way_mm = 12.0 / theta.cos();
    let sagittal_mm = way_mm * 0.75 * theta_after.cos();
    let tangential_mm = sagittal_mm * (theta_after.cos() / theta.cos()).powi(2);
    assert!((foci.sagittal_mm + sagittal_mm).abs() < 1e-9, "{foci:?} {sagittal_mm}");
    assert!((foci.tangential_mm + tangential_mm).abs() < 1e-9, "{foci:?} {tangential_mm}");
}

/// An objective for objects in water below a cover glass: plane front, doublet behind the stop.
fn objective(scale: f64) -> Lens {
    let rows = [
        [f64::INFINITY, 2.0, 1.52, 1.2],
        [-1.25, 1.2, 1.0, 0.1],
        [-12.0, 2.0, 1.62, 1.6],
        [-3.4, 2.5, 1.0, 0.2],
        [f64::INFINITY, 1.5, 1.0, 0.5],
        [14.0, 5.0, 1.5, 2.5],
        [-6.0, 5.0, 1.7, 1.0],
        [-13.0, 5.0, 1.0, 0.0],
    ];
    let rows = rows.map(|[r, a, n, t]| [r, a, scale * n, t]);
    lens(scale * 1.33, &rows, 4)
}

#[test]
fn an_objective_in_water_has_optilands_numbers() {
    // Optiland 0.6.3: `Optic` of these surfaces, the object 0.25 mm before the first in `IdealMaterial(1.33)`.
    let lens = objective(1.0).at(GREEN_NM).unwrap();
    // Of the stop alone: light from afar, which an immersion objective is not for, a rim ends before it.
    let first = lens.first_order_of_stop();
    for (found, expected) in [
        (first.image_focal_mm(), 2.185_405_177_974_356_4),
        (first.object_focal_mm(), -2.906_588_886_705_893),
        (first.efl_mm, 2.185_405_177_974_356_4),
        (first.ffl_mm, -0.869_781_407_132_204_2),
        (first.bfl_mm - 30.0, -31.835_240_048_371_393),
        (first.entrance_pupil_z_mm, 4.376_207_741_505_829),
        (first.entrance_pupil_diameter_mm, 5.983_334_1),
        (first.exit_pupil_z_mm - 30.0, -33.046_084_032_846_44),
        (first.exit_pupil_diameter_mm, 3.315_121_686_014_269),
        (first.f_number, 0.365_248_73),
        (lens.conjugate(0.25).magnification, 4.689_700_034_976_831),
    ] {
        // Some are printed with eight decimals.
        assert!((found / expected - 1.0).abs() < 1e-8, "{found}, expected {expected}");
    }
    for (y_mm, [l, m], expected) in [
        (0.0, [0.0, 0.5], [0.0, 5.865_886_181_157_656, 0.134_243_161_251_554_33, 41.400_113_573_952_29]),
        (
            0.05,
            [0.1, 0.4],
            [1.194_910_935_947_779_4, 4.054_960_260_844_691, 0.088_967_796_508_056_03, 41.184_269_164_007_75],
        ),
        (
            0.05,
            [-0.3, -0.35],
            [-3.490_705_007_174_587_3, -4.796_606_659_225_024_5, -0.115_556_428_352_960_79, 41.434_328_720_606_83],
        ),
    ] {
        let direction = DVec3::new(l, m, (1.0f64 - l * l - m * m).sqrt());
        let mut rays = RayBatch::from_points(&[DVec3::new(0.0, y_mm, -0.25)], &[direction]);
        lens.trace(&mut rays, Vignetting::Off);
        lens.to_film(&mut rays, 30.0);
        let found = [rays.x_mm[0], rays.y_mm[0], rays.m[0], rays.opl_mm[0]];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
        }
    }
}

#[test]
fn only_ratios_of_indices_bend_rays() {
    let (lens, dense) = (objective(1.0).at(GREEN_NM).unwrap(), objective(1.25).at(GREEN_NM).unwrap());
    assert_eq!((lens.object_index(), dense.object_index()), (1.33, 1.25 * 1.33));
    let (first, second) = (lens.first_order(), dense.first_order());
    assert!((second.power_per_mm / first.power_per_mm - 1.25).abs() < 1e-13);
    assert!((second.object_focal_mm() / first.object_focal_mm() - 1.0).abs() < 1e-13);
    assert!((second.entrance_pupil_z_mm - first.entrance_pupil_z_mm).abs() < 1e-13);
    let point = ObjectPoint::Finite(DVec3::new(0.02, 0.03, -1.0));
    let sampling = PupilSampling {
        coordinates: PupilCoordinates::stop(&lens),
        places: vec![DVec2::ZERO, DVec2::new(0.3, -0.5), DVec2::new(-0.7, 0.1)],
        rims: Vignetting::Off,
    };
    let (here, there) = (sampling.rays_on_film(&lens, &point, 5.0), sampling.rays_on_film(&dense, &point, 5.0));
    for i in 0..here.len() {
        assert!((here.point_mm(i) - there.point_mm(i)).length() < 1e-13);
        assert!((1.25 * here.opl_mm[i] - there.opl_mm[i]).abs() < 1e-13);
    }
    let apertures = [&lens, &dense].map(|lens| NumericalApertures::find(lens, 1.0).unwrap());
    assert!((apertures[1].object / apertures[0].object - 1.25).abs() < 1e-12);
    // Radiance over n² is what a lens keeps: without a change of ratios the image is as bright.
    let cones = [&lens, &dense].map(|lens| projected_solid_angle(lens, &point_on_axis(1.0), 64));
    assert!((cones[1] / cones[0] - 1.0).abs() < 1e-12, "{cones:?}");
}

fn point_on_axis(distance_mm: f64) -> ObjectPoint {
    ObjectPoint::Finite(DVec3::Z * -distance_mm)
}

#[test]
fn film_and_object_distances_belong_together() {
    let lens = objective(1.0).at(GREEN_NM).unwrap();
    for distance_mm in [0.9, 1.0, 2.0] {
        let film_distance_mm = lens.film_distance_mm_for(distance_mm).unwrap();
        assert!((lens.object_distance_mm_for(film_distance_mm).unwrap() - distance_mm).abs() < 1e-12);
        // Newton's equation, distances from both focal points: x x′ = f f′.
        let first = lens.first_order();
        let product = (-distance_mm - first.ffl_mm) * (film_distance_mm - first.bfl_mm);
        assert!((product / (first.object_focal_mm() * first.image_focal_mm()) - 1.0).abs() < 1e-11);
    }
    assert!(lens.film_distance_mm_for(0.8).is_err(), "within the front focal length");
}

#[test]
fn a_path_in_water_counts_with_its_index_and_absorbs_light() {
    // Rays to the edge and the middle of a plane: by Pythagoras.
    let water = lens(1.5, &[[f64::INFINITY, 5.0, 1.0, 0.0]], 0).at(GREEN_NM).unwrap();
    let rays = water.rays_towards(&point_on_axis(4.0), &[DVec2::ZERO, DVec2::new(0.0, 3.0)], 0.0, 0.0);
    assert!((rays.opl_mm[1] - rays.opl_mm[0] - 1.5).abs() < 1e-15);

    let glass = Glass::Named("SCHOTT:N-SF11".to_owned());
    let buried = lens(1.0, &[[f64::INFINITY, 5.0, 1.0, 0.0]], 0).with_object_medium(glass.clone()).unwrap();
    let absorption = buried.absorption_at(420.0).unwrap();
    assert!(!absorption.is_unknown_before() && absorption.unknown_behind().is_empty());
    let direction = DVec3::new(0.0, 0.3, (1.0f64 - 0.09).sqrt());
    let mut rays = RayBatch::from_points(&[DVec3::Z * -8.0; 2], &[DVec3::Z, direction]);
    let shares = absorption.trace(&buried.at(420.0).unwrap(), &mut rays, Vignetting::On);
    for (share, path_mm) in shares.iter().zip([8.0, 8.0 / direction.z]) {
        assert!((share - glass.internal_transmittance(420.0, path_mm).unwrap()).abs() < 1e-15);
    }
    assert!(lens(1.5, &[[f64::INFINITY, 5.0, 1.0, 0.0]], 0).absorption_at(420.0).unwrap().is_unknown_before());
}

fn read(name: &str, text: &str) -> Result<LensFile, OpticsError> {
    LensFile::from_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default())
}

#[test]
fn files_keep_the_objects_medium_or_refuse_it() {
    let mut file = LensFile::from(objective(1.0));
    file.object_distance_mm = Some(1.0);
    file.film_distance_mm = Some(9.0);
    for (name, text) in [("o.ron", file.lens.to_ron()), ("o.zmx", file.to_zmx().unwrap())] {
        let again = read(name, &text).unwrap().lens;
        assert_eq!(again.object_medium().index_at(GREEN_NM).unwrap(), 1.33, "{name}");
        let (first, second) = (file.lens.at(GREEN_NM).unwrap(), again.at(GREEN_NM).unwrap());
        assert!((first.first_order().ffl_mm - second.first_order().ffl_mm).abs() < 1e-14, "{name}");
    }
    for refusal in [file.to_dat().unwrap_err(), file.to_omni_json().unwrap_err()] {
        assert!(refusal.to_string().contains("the object is in"), "{refusal}");
    }
    file.lens =
        file.lens.with_object_medium(Glass::Linear { index: 1.5, reference_nm: 550.0, slope_per_nm: 0.0 }).unwrap();
    assert!(file.to_zmx().unwrap_err().to_string().contains("the object is in"));
    assert!(Lens::pinhole(1.0).unwrap().with_object_medium(Glass::Constant { index: f64::NAN }).is_err());
}

#[test]
fn design_programs_say_what_the_object_is_in() {
    // A plano-convex lens in oil; the beam fills an aperture of 0.9, which is the index times the sine.
    let zmx = "MODE SEQ\nUNIT MM\nOBNA 0.9 0\nFTYP 1 0 1 1\nXFLN 0\nYFLN 0\nWAVM 1 0.5876 1\nPWAV 1\n\
        SURF 0\n TYPE STANDARD\n CURV 0\n DISZ 0.5\n GLAS ___BLANK 1 0 1.515 42\n\
        SURF 1\n TYPE STANDARD\n STOP\n CURV 0\n DISZ 1\n GLAS N-BK7 0 0 1.5168 64.17\n\
        SURF 2\n TYPE STANDARD\n CURV -0.8\n DISZ 10\nSURF 3\n TYPE STANDARD\n CURV 0\n DISZ 0\n";
    let seq = "RDM;LEN\nDIM M\nWL 587.6\nREF 1\nNAO 0.9\nYOB 0.0\nSO 0.0 0.5 1.515:42\nS 0.0 1.0 NBK7_SCHOTT\nSTO\n\
        S -1.25 10.0\nSI 0.0 0.0\nGO\n";
    let deeplens = r#"{"info": "oil", "surfaces": [
        {"type": "Stop", "r": 0.3, "c": 0.0, "d": 0.0, "mat1": "1.515/42", "mat2": "1.515/42"},
        {"type": "Spheric", "r": 0.5, "roc": -5, "d": 1.0, "mat1": "1.515/42", "mat2": "air"}]}"#;
    let buried = read("oil.json", deeplens).unwrap().lens;
    assert!((buried.object_medium().index_at(587.561_8).unwrap() - 1.515).abs() < 1e-6);
    for (name, text) in [("oil.zmx", zmx), ("oil.seq", seq)] {
        let file = read(name, text).unwrap();
        assert!(
            (file.lens.object_medium().index_at(587.6).unwrap() - 1.515).abs() < 1e-5,
            "{name}: 587.6 is not quite the d line"
        );
        let mono = file.lens.at(587.6).unwrap();
        // The stop lies on the plane in front, so the cone is a triangle in oil.
        let found = NumericalApertures::find(&mono, 0.5).unwrap();
        assert!((found.object - 0.9).abs() < 1e-8, "{name}: {found:?}");
    }
}
