//! Pupils and beams against rays counted one by one.

mod counted;

use std::path::PathBuf;

use counted::{axial_spot_rms_mm, beam_radius_mm, cross_section_mm2};
use dioptric_optics::{
    Aperture, CoordinateBreak, Glass, Interface, Lens, LensFile, MissingGlass, MonoLens, ObjectPoint, Outline,
    PupilBoundary, PupilRegion, ReadOptions, Shape, Surface,
    analysis::{Autofocus, PupilLight, PupilRule, field_limit_deg, projected_solid_angle},
    glam::{DVec2, DVec3},
};
use rayon::prelude::*;

/// Azimuths of boundaries.
const N_AZIMUTHS: usize = 192;

fn shared(name: &str) -> MonoLens {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../../shared/data/lenses", name].iter().collect();
    Lens::read(&path).expect("a lens file").at(550.0).expect("glasses that are known")
}

fn built_in(name: &str) -> MonoLens {
    Lens::built_in(name).expect("a built-in lens").at(550.0).expect("glasses that are known")
}

fn far(field_deg: f64) -> ObjectPoint {
    ObjectPoint::far(field_deg.to_radians(), DVec2::new(0.28, 0.96))
}

/// The cross-section of the light of a far point that gets through, by the pupil's region, mm².
fn found_mm2(lens: &MonoLens, point: &ObjectPoint) -> f64 {
    let cosine = |region: &PupilRegion| point.direction_to(DVec3::ZERO).dot(region.plane().normal());
    let region = PupilRegion::find(lens, point, N_AZIMUTHS);
    region.map_or(0.0, |region| region.area_mm2() * cosine(&region))
}

/// Checks fields against so many rays across; grids of n across count a disc to n to the power −1.5.
#[track_caller]
fn check(name: &str, lens: &MonoLens, fields_deg: &[f64], n_across: usize, within: f64) {
    for &field_deg in fields_deg {
        let point = far(field_deg);
        let (found, counted) = (found_mm2(lens, &point), cross_section_mm2(lens, &point, n_across).0);
        assert!(counted > 0.0 && (found / counted - 1.0).abs() < within, "{name} {field_deg}: {found} {counted}");
    }
}

#[test]
fn pupils_of_fisheyes_move_and_turn() {
    let fisheye = built_in("fisheye-12.5mm");
    check("fisheye", &fisheye, &[0.0, 45.0, 80.0, 89.0, 90.0, 91.0], 600, 2e-3);
    // A crescent so thin that coarser grids lose its ends.
    check("fisheye", &fisheye, &[104.0], 1500, 2e-3);
    check("wide", &built_in("wide-100deg"), &[0.0, 30.0, 50.0], 600, 2e-3);
}

#[dioptric_golden::needs_shared]
#[test]
fn widest_lens_has_light_at_every_field() {
    let lens = shared("more/wideangle200deg-automatic-zemax.json");
    check("200°", &lens, &[40.0, 78.0, 80.0, 82.0], 800, 4e-3);
    // Its light ends for good, at one angle.
    let last_deg = field_limit_deg(&lens, 1e-3).unwrap();
    let mut before = projected_solid_angle(&lens, &far(76.0), 48);
    for field_deg in (153..=(2.0 * last_deg) as u32).map(|i| 0.5 * f64::from(i)) {
        let here = projected_solid_angle(&lens, &far(field_deg), 48);
        assert!(here > 0.0 && here < before, "{field_deg}: {here} after {before}");
        before = here;
    }
}

#[test]
fn crescent_pupils_are_found_whole() {
    // Vignetting far apart in the light's direction: what passes a singlet or asphere from the side is no disc.
    check("asphere", &built_in("asphere-15mm"), &[60.0, 68.0, 72.0], 1000, 2e-3);
    let lens = built_in("asphere-15mm");
    let region = PupilRegion::find(&lens, &far(72.0), N_AZIMUTHS).unwrap();
    assert!(region.outline().is_none());
    // What one place of it sees is less.
    let seen = PupilBoundary::find(&lens, &far(72.0), N_AZIMUTHS).unwrap();
    assert!(seen.plane() == region.plane() && seen.area_mm2() < 0.99 * region.area_mm2());
}

#[test]
fn pupil_is_the_same_on_both_planes_it_is_looked_at_in() {
    // 0.3 is the cosine at which the plane of the region turns to the light, 0.01 that of the pupil's.
    let lens = built_in("fisheye-12.5mm");
    let about = |cosine: f64| [cosine + 1e-6, cosine - 1e-6].map(|cosine| far(cosine.acos().to_degrees()));
    let is_across = |point| PupilBoundary::find(&lens, &point, N_AZIMUTHS).unwrap().plane().is_across_axis();
    let [before, after] = about(0.01);
    assert!(is_across(before) && !is_across(after));
    let [before, after] = about(0.3);
    let is_across = |point| PupilRegion::find(&lens, &point, N_AZIMUTHS).unwrap().plane().is_across_axis();
    assert!(is_across(before) && !is_across(after));
    assert!((found_mm2(&lens, &before) / found_mm2(&lens, &after) - 1.0).abs() < 1e-4);
    let cones = [before, after].map(|point| projected_solid_angle(&lens, &point, 128));
    assert!((cones[0] / cones[1] - 1.0).abs() < 1e-4, "{cones:?}");
}

/// The f-number by a million rays along a radius, good to 1e-6 of the front rim.
fn counted_f_number(lens: &MonoLens) -> f64 {
    lens.first_order().efl_mm.abs() / (2.0 * beam_radius_mm(lens, 1_000_000))
}

#[dioptric_golden::needs_shared]
#[test]
fn rims_narrower_than_the_stop_define_the_f_number() {
    for (name, expected) in [
        ("more/dgauss.90deg.4.38mm.json", 2.02),
        ("more/wide.77deg.4.38mm.json", 6.96),
        ("more/gullstrand.dat", 2.18),
        ("fisheye.87deg.12.5mm.json", 2.74),
    ] {
        let lens = shared(name);
        let first = lens.first_order();
        assert!((first.f_number - expected).abs() < 0.006, "{name}: {}", first.f_number);
        assert!((first.f_number / counted_f_number(&lens) - 1.0).abs() < 1e-4, "{name}");
        assert!((first.entrance_pupil_diameter_mm * first.f_number / first.efl_mm.abs() - 1.0).abs() < 1e-12);
        let beam = lens.limiting_beam().expect("a rim limits the light");
        assert!(beam.limiting_surface != lens.stop() && beam.stop_radius_mm < lens.stop_semi_aperture_mm());
        let note = lens.note_on_limit(f64::INFINITY).unwrap();
        assert!(note.starts_with("light from the axis far away is limited by the rim of surface"), "{note}");
        assert!(note.contains(&format!(": f/{:.3}, where the stop alone has f/", first.f_number)), "{note}");
    }
}

#[test]
fn real_f_number_is_that_of_counted_rays() {
    for name in Lens::built_in_names() {
        let lens = built_in(name);
        let Some(real) = lens.real_f_number() else { continue };
        assert!((real / counted_f_number(&lens) - 1.0).abs() < 1e-4, "{name}: {real} {}", counted_f_number(&lens));
    }
}

#[test]
fn narrower_stop_limits_again() {
    let lens = Lens::built_in("fisheye-12.5mm").unwrap();
    let open = lens.at(550.0).unwrap();
    assert!(open.limiting_beam().is_some());
    let stopped = lens.with_f_number(8.0, 550.0).unwrap().at(550.0).unwrap();
    assert!(stopped.limiting_beam().is_none() && (stopped.first_order().f_number - 8.0).abs() < 1e-12);
    let message = lens.with_f_number(2.4, 550.0).unwrap_err().to_string();
    assert!(message.contains("opens to f/2.743 at most, where the") && message.contains("rim of surface"), "{message}");
    let rims = open.limiting_beam().unwrap().stop_radius_mm;
    assert!((open.stop_radius_filled_mm(f64::INFINITY) - rims).abs() < 1e-12 * rims);
    assert_eq!(stopped.stop_radius_filled_mm(f64::INFINITY), stopped.stop_semi_aperture_mm());
}

#[test]
fn marked_f_number_is_the_widest_opening() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let full = lens.at(550.0).unwrap().first_order().f_number;
    assert!(full > 2.02, "{full}");
    assert_eq!(lens.with_f_number(2.0, 550.0).unwrap(), lens);
    let note = lens.note_on_f_number(2.0, 550.0).unwrap();
    assert_eq!(note, "f/2 is taken for the widest opening of dgauss-50mm, which is f/2.028");
    let message = lens.with_f_number(1.8, 550.0).unwrap_err().to_string();
    assert_eq!(message, "dgauss-50mm opens to f/2.028 at most, asked for f/1.8");
    for as_it_is in [2.0277, 2.1, 8.0] {
        assert_eq!(lens.note_on_f_number(as_it_is, 550.0), None);
        let found = lens.with_f_number(as_it_is, 550.0).unwrap().at(550.0).unwrap().first_order().f_number;
        assert!((found / as_it_is - 1.0).abs() < 1e-3, "{as_it_is} {found}");
    }
    // A rim that limits it is opened as wide as it goes, too.
    let fisheye = Lens::built_in("fisheye-12.5mm").unwrap();
    assert_eq!(fisheye.with_f_number(2.7, 550.0).unwrap(), fisheye);
}

#[test]
fn note_on_a_near_point_is_of_its_own_light() {
    // A stop of 4 mm behind a rim of 6 mm: far light fills it, a near point's cone is cut by no rim either; with a rim of 3 mm it is.
    for (rim_mm, is_limited) in [(6.0, false), (3.0, true)] {
        let plate = |semi_aperture_mm, thickness_after_mm| Interface {
            surface: Surface::plane(semi_aperture_mm),
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        let thin = Lens::thin(50.0, 8.0).unwrap().interfaces()[0].clone();
        let lens = Lens::new("plates", "test", vec![plate(rim_mm, 5.0), thin], 1).unwrap().at(550.0).unwrap();
        let note = lens.note_on_limit(120.0);
        assert_eq!(note.is_some(), is_limited, "{note:?}");
        assert!(note.is_none_or(|note| note.starts_with("light from the axis 120 mm before the lens is limited by")));
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn f_numbers_and_axial_spots_of_all_shared_files_are_those_of_counted_rays() {
    let Some(folder) = dioptric_golden::shared("data/lenses") else { return };
    let entries = [folder.join("more"), folder].into_iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    let options = ReadOptions { missing_glass: MissingGlass::FromNdVd, ..ReadOptions::default() };
    let check = |path: &PathBuf| {
        let file = LensFile::read(path, &options).ok()?;
        let lens = file.lens.at(file.reference_wavelength_nm.unwrap_or(550.0)).ok()?;
        let real = lens.real_f_number().filter(|_| lens.is_rotational())?;
        let name = path.display();
        assert!((real / counted_f_number(&lens) - 1.0).abs() < 1e-4, "{name}: {real} {}", counted_f_number(&lens));
        if let Some(limited) = lens.limiting_beam() {
            assert!((lens.first_order().entrance_pupil_diameter_mm / (2.0 * limited.height_mm) - 1.0).abs() < 1e-12);
        }
        let from_mm = lens.film_distance_mm_for(f64::INFINITY).ok()?;
        let (axis, rule) = (ObjectPoint::Infinite(DVec3::Z), PupilRule::of_rings(12));
        let points = [axis];
        let focus = Autofocus::alike(std::slice::from_ref(&lens), &points, rule);
        let (best_mm, least_mm) = focus.best_film_mm(from_mm).expect("light on the axis");
        // In focus and out of it; a perfect mirror's spot is rounding alone.
        for film_mm in [best_mm, best_mm + 8.0 * least_mm * real] {
            let (_, [xx, yy, _]) = PupilLight::to_film(&lens, &axis, film_mm, rule).unwrap().moments(&lens, film_mm);
            let (found, counted) = ((xx + yy).sqrt(), axial_spot_rms_mm(&lens, film_mm, 200_000).unwrap());
            assert!((found - counted).abs() < 1e-4 * counted + 1e-9, "{name}: {found} {counted}");
        }
        Some(())
    };
    let n_checked = paths.par_iter().filter_map(check).count();
    assert!(n_checked >= 28, "{n_checked}");
}

#[test]
fn working_f_number_of_far_objects_is_the_f_number() {
    for lens in [built_in("fisheye-12.5mm"), built_in("dgauss-50mm")] {
        let near = lens.working_f_number(1e7);
        assert!((lens.working_f_number(f64::INFINITY) / lens.first_order().f_number - 1.0).abs() < 1e-9);
        assert!((near / lens.first_order().f_number - 1.0).abs() < 1e-4, "{near}");
    }
}

/// Where the last light grazes the front of a lens, what a ray meets is known to rounding over its cosine: places there count as passed by, where
/// a search through them found light and darkness by turns, and never ended.
#[test]
fn the_last_light_of_a_tilted_lens_is_found() {
    let front = Interface {
        surface: Surface::sphere(50.0, 6.0),
        medium_after: Glass::Constant { index: 1.5 },
        thickness_after_mm: 3.0,
    };
    let back = Interface { surface: Surface::sphere(-50.0, 4.0), medium_after: Glass::Air, thickness_after_mm: 0.0 };
    let lens = Lens::new("askew", "test", vec![front, back], 1).unwrap().with_f_number(8.0, 550.0).unwrap();
    let pivot_mm = lens.at(550.0).unwrap().projection_center_z_mm();
    let turn = CoordinateBreak {
        surfaces: (0, 1),
        pivot_mm,
        decenter_mm: [0.0, 0.5, 0.0],
        tilt_deg: [-5.0, 1.0, 0.0],
        tilt_first: false,
    };
    let mono = lens.with_moves(vec![turn]).unwrap().at(550.0).unwrap();
    let seen_mm2 = |field_deg: f64| {
        let point = ObjectPoint::far(field_deg.to_radians(), DVec2::Y);
        PupilRegion::find(&mono, &point, 48).map_or(0.0, |region| region.area_mm2())
    };
    let last_deg = field_limit_deg(&mono, 0.01).unwrap();
    assert!((80.0..92.0).contains(&last_deg), "{last_deg}");
    let steps: Vec<f64> = (0..200).map(|i| seen_mm2(last_deg - 0.1 + 0.001 * f64::from(i))).collect();
    assert!(steps.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6), "{steps:?}");
    assert!(steps[0] > 0.0 && steps[199] < 1e-2 * steps[0], "{} {}", steps[0], steps[199]);
    // A sliver of 3 µm², along the outline of the front.
    let point = ObjectPoint::far(86.582_519_531_25_f64.to_radians(), DVec2::Y);
    let (found, counted) = (found_mm2(&mono, &point), cross_section_mm2(&mono, &point, 600).0);
    assert!(counted > 3e-6 && (found / counted - 1.0).abs() < 2e-3, "{found} {counted}");
}

/// At 66° the first look over this lens ends where the front's rim meets the edge of all that passes the other surfaces: a single place, and
/// dark. The light is elsewhere.
#[dioptric_golden::needs_shared]
#[test]
fn light_beside_a_place_that_grazes_is_found() {
    let lens = shared("bench/Tamron_16mm_F2.88_IF.lens");
    check("Tamron", &lens, &[65.5, 65.9, 66.0, 66.1, 66.2], 600, 4e-3);
}

/// Of a window over the front a sliver at its rim is lit; all else that it lets through is totally reflected at the last surface, and leads
/// there by how far it is from passing.
#[test]
fn light_at_the_rim_of_a_window_is_found() {
    let lens = Lens::built_in("paper-2el").unwrap();
    let radius_mm = lens.interfaces()[0].surface.semi_aperture_mm;
    let direction = DVec2::from_angle(std::f64::consts::TAU * 21.13 / 40.0);
    let window = Aperture {
        surface: 0,
        outline: Outline::Circle { radius_mm: 0.05 * radius_mm },
        center_mm: (direction * 0.5 * radius_mm).to_array(),
        is_obscuration: false,
    };
    let turn = CoordinateBreak {
        surfaces: (1, 2),
        pivot_mm: 0.0,
        decenter_mm: [0.01 * radius_mm, 0.02 * radius_mm, 0.0],
        tilt_deg: [1.5, -1.0, 0.0],
        tilt_first: false,
    };
    let lens = Lens::new_with_apertures("window", "test", lens.interfaces().to_vec(), lens.stop(), vec![window]);
    let lens = lens.unwrap().with_moves(vec![turn]).unwrap().at(550.0).unwrap();
    let point = ObjectPoint::far(54.5542_f64.to_radians(), DVec2::from_angle(0.2).rotate(direction));
    let (found, (counted, error)) = (found_mm2(&lens, &point), cross_section_mm2(&lens, &point, 300));
    assert!(counted > 3e-3 && (found - counted).abs() < 2e-3 * counted + 3.0 * error, "{found} {counted} {error}");
}

/// A stop of 5 mm and, 100 mm behind it, a window of 8 mm that is 30 mm off the axis in one of forty directions: light through both is that
/// through two discs that overlap, by their closed form.
#[test]
fn windows_in_all_directions_have_the_light_of_overlapping_discs() {
    let overlap_mm2 = |distance_mm: f64| -> f64 {
        let (r, large) = (5.0_f64, 8.0_f64);
        if distance_mm >= r + large {
            return 0.0;
        }
        if distance_mm <= large - r {
            return std::f64::consts::PI * r * r;
        }
        let square = distance_mm * distance_mm;
        let half = |own: f64, other: f64| ((square + own * own - other * other) / (2.0 * distance_mm * own)).acos();
        let segment = |own: f64, half: f64| own * own * (half - 0.5 * (2.0 * half).sin());
        segment(r, half(r, large)) + segment(large, half(large, r))
    };
    (0..40).into_par_iter().for_each(|i| {
        let direction = DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / 40.0);
        let plane = |semi_aperture_mm, thickness_after_mm| Interface {
            surface: Surface::plane(semi_aperture_mm),
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        let lens = Surface { shape: Shape::ThinLens { power_per_mm: 0.01 }, ..Surface::plane(60.0) };
        let sides = vec![plane(5.0, 100.0), plane(60.0, 5.0), Interface { surface: lens, ..plane(60.0, 0.0) }];
        // Light of a point on one side of the axis falls on the other.
        let window = Aperture {
            surface: 1,
            outline: Outline::Circle { radius_mm: 8.0 },
            center_mm: (direction * -30.0).to_array(),
            is_obscuration: false,
        };
        let lens = Lens::new_with_apertures("window", "test", sides, 0, vec![window]).unwrap().at(550.0).unwrap();
        for half_degrees in 19..46 {
            let field_deg = 0.5 * f64::from(half_degrees);
            let point = ObjectPoint::far(field_deg.to_radians(), direction);
            let expected_mm2 = overlap_mm2((100.0 * field_deg.to_radians().tan() - 30.0).abs());
            let found_mm2 = PupilRegion::find(&lens, &point, 96).map_or(0.0, |region| region.area_mm2());
            assert!(
                (found_mm2 - expected_mm2).abs() < 2e-3 * expected_mm2 + 1e-9,
                "{i} {field_deg}: {found_mm2} {expected_mm2}"
            );
        }
    });
}
