use dioptric_optics::{CoordinateBreak, Glass, ImageSurface, Interface, Shape, Surface};
use dioptric_psf::{Diffraction, ImageSettings, LensImage, LensImageModel};

use super::*;
use crate::{AnalysisFields, AnalysisFilm};

fn request(fields_deg: Vec<f64>) -> AnalysisRequest {
    AnalysisRequest {
        fields: AnalysisFields::above_axis_deg(&fields_deg),
        wavelengths_nm: vec![450.0, 550.0, 650.0],
        main_wavelength_nm: None,
        wavelength_weights: Vec::new(),
        field_weights: Vec::new(),
        distance_mm: f64::INFINITY,
        film: AnalysisFilm::BestFocus,
        n_rings: 6,
    }
}

#[test]
fn every_part_is_there_and_agrees_with_the_others() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let analysis = request(vec![0.0, 10.0]).compute(&lens).unwrap();
    assert_eq!((analysis.spots.len(), analysis.fans.len(), analysis.fields.len()), (6, 6, 2));
    assert_eq!((analysis.reference_nm, analysis.film_distance_mm), (550.0, analysis.focus.axis_film_mm.unwrap()));
    let on_axis = &analysis.spots[1];
    // Vignetting end no ray of the axis, and its spot is round.
    assert_eq!(on_axis.ray_share, 1.0);
    assert!((on_axis.sigma_x_um.unwrap() / on_axis.sigma_y_um.unwrap() - 1.0).abs() < 1e-9);
    let oblique = &analysis.spots[4];
    assert!(oblique.height_mm.unwrap() > 8.5 && oblique.height_mm.unwrap() < 9.2);
    assert_eq!(oblique.wavefront.as_ref().unwrap().zernike_waves.len(), ZERNIKE_TERMS);
    let (last, curve_end) = (&analysis.fields[1], &analysis.curves[CURVE_STEPS]);
    assert_eq!(last, curve_end);
    assert_eq!(last.lateral_color_um[1], Some(0.0));
    assert!((analysis.fields[0].relative_illumination.unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn a_fan_ends_in_its_spot() {
    let lens = Lens::built_in("tessar-50mm").unwrap();
    let analysis = request(vec![12.0]).compute(&lens).unwrap();
    for (spot, fan) in analysis.spots.iter().zip(&analysis.fans) {
        let largest = fan.tangential_um.iter().chain(&fan.sagittal_um).flatten().fold(0.0_f64, |m, e| m.max(e.abs()));
        // The spot has more rays, but none beyond the same rims and stop by much.
        assert!(largest > 0.4 * spot.radius_um.unwrap() && largest < 1.2 * spot.radius_um.unwrap(), "{largest}");
        // The slope of the path difference is the transverse error: it vanishes at the chief ray's place.
        let middle = FAN_PLACES / 2;
        assert_eq!((fan.tangential_um[middle], fan.tangential_waves[middle]), (Some(0.0), Some(0.0)));
    }
}

#[test]
fn illumination_is_that_of_the_ray_map() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let analysis = request(vec![0.0, 5.0, 10.0]).compute(&lens).unwrap();
    let settings = ImageSettings::new(analysis.film_distance_mm, Diffraction::None);
    let map = LensImageModel::new(&lens, &[550.0], &settings).unwrap().film_map(550.0, 12.0);
    let on_axis = map.irradiance_sr(DVec2::ZERO);
    for row in &analysis.fields {
        let place_mm = map.place_mm(DVec2::X * row.place.field_deg.to_radians().tan()).unwrap();
        let expected = map.irradiance_sr(place_mm) / on_axis;
        // The cones of an object point and of the film's point that it lies on differ by its aberrations.
        assert!((row.relative_illumination.unwrap() / expected - 1.0).abs() < 3e-3, "{row:?} {expected}");
    }
}

#[test]
fn fields_are_chosen_where_none_are_given() {
    let lens = Lens::built_in("fisheye-12.5mm").unwrap();
    let analysis = AnalysisRequest { fields: AnalysisFields::ByLight, ..request(vec![]) }.compute(&lens).unwrap();
    assert_eq!(analysis.fields.len(), 4);
    assert!(
        // Beyond 90° no tangent compares.
        analysis.fields[3].place.field_deg > 80.0
            && analysis.fields[3].distortion_tangent_percent.is_none_or(|percent| percent < -80.0)
    );
    assert!(analysis.fans[11].tangential_um[FAN_PLACES / 2].is_some(), "the chief ray is found");
    // The calibrated scale leaves no distortion on the mean: heights about the axis lie above it, the last lit one below.
    let percent = |row: &FieldRow| Some((row.place.field_deg, row.distortion_calibrated_percent?));
    let calibrated: Vec<(f64, f64)> = analysis.curves.iter().filter_map(percent).collect();
    let sum: f64 = calibrated.iter().map(|(field_deg, percent)| field_deg.powi(2) * percent).sum();
    let (first, last) = (calibrated[0].1, calibrated[calibrated.len() - 1].1);
    assert!(sum.abs() < 1e-6 && first > 0.0 && last < 0.0, "{sum} {first} {last}");
    let scale = analysis.calibrated_scale.unwrap();
    assert!((first - 100.0 * (1.0 / scale - 1.0)).abs() < 1e-9);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let good = request(vec![0.0]);
    for (wrong, word) in [
        (request(vec![120.5]), "fields_deg is 120.5"),
        (AnalysisRequest { distance_mm: 500.0, ..request(vec![90.0]) }, "fields_deg is 90"),
        (request(vec![]), "at least 1"),
        (
            AnalysisRequest { fields: AnalysisFields::HeightsMm(vec![[0.0, 1.0]]), ..good.clone() },
            "a finite one for fields in mm",
        ),
        (AnalysisRequest { wavelengths_nm: vec![], ..good.clone() }, "at least 1"),
        (AnalysisRequest { distance_mm: -1.0, ..good.clone() }, "distance_mm is -1"),
        (AnalysisRequest { n_rings: 0, ..good.clone() }, "rings is 0"),
        (AnalysisRequest { distance_mm: 10.0, ..good.clone() }, "forms no image"),
    ] {
        let message = wrong.compute(&lens).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
    // A pinhole has no focus, but works with a film.
    let pinhole = Lens::pinhole(0.5).unwrap();
    assert!(good.compute(&pinhole).is_err());
    let analysis = AnalysisRequest { film: AnalysisFilm::FilmMm(40.0), ..request(vec![0.0, 20.0]) };
    let analysis = analysis.compute(&pinhole).unwrap();
    assert!(analysis.fields[1].distortion_tangent_percent.unwrap().abs() < 1e-9);
}

/// Returns the field rows of a lens analyzed far away on a film at this place.
fn on_film(lens: &Lens, film_distance_mm: f64, fields: AnalysisFields) -> LensAnalysis {
    AnalysisRequest { fields, film: AnalysisFilm::FilmMm(film_distance_mm), ..request(vec![]) }.compute(lens).unwrap()
}

#[test]
fn steep_fields_are_cut_and_reported() {
    let fisheye = Lens::built_in("fisheye-12.5mm").unwrap();
    let fields = AnalysisFields::AnglesDeg(vec![[0.0, 80.0], [0.0, 89.5], [0.0, -89.0], [89.0, 60.0]]);
    let film = AnalysisFilm::FilmMm(20.0);
    let near = AnalysisRequest { fields: fields.clone(), film, distance_mm: 500.0, ..request(vec![]) };
    let analysis = near.compute(&fisheye).unwrap();
    let angles = analysis.fields.iter().map(|row| row.place.field_deg).collect::<Vec<_>>();
    assert_eq!(angles[..3], [80.0, 88.0, 88.0]);
    assert!((angles[3] - 88.0).abs() < 1e-9 && analysis.fields[2].place.field_xy_deg == [0.0, -88.0]);
    let cut: Vec<&String> = analysis.notes.iter().filter(|note| note.contains("is cut to")).collect();
    assert_eq!(cut.len(), 3);
    assert!(cut[0].contains("89.5° is cut to 88°"), "{cut:?}");
    // Far points are looked at wherever they are.
    let far = on_film(&fisheye, 20.0, AnalysisFields::AnglesDeg(vec![[0.0, 89.5], [-95.0, 0.0]]));
    let angles = far.fields.iter().map(|row| row.place.field_deg).collect::<Vec<_>>();
    assert!(angles == [89.5, 95.0] && far.notes.iter().all(|note| !note.contains("is cut to")), "{angles:?}");
    // A hole in front of an ideal lens sees everything: cos⁴ falls to a quarter at 45°.
    let thin = Lens::thin(50.0, 0.5).unwrap();
    assert!(
        AnalysisRequest { fields: AnalysisFields::ByLight, ..request(vec![]) }.compute(&thin).unwrap().notes.is_empty()
    );
}

#[test]
fn a_fisheye_has_wavefronts_to_85_degrees() {
    let fisheye = Lens::built_in("fisheye-12.5mm").unwrap().with_f_number(11.0, 550.0).unwrap();
    let analysis = request(vec![0.0, 60.0, 75.0, 85.0]).compute(&fisheye).unwrap();
    for spot in &analysis.spots {
        let wavefront = spot.wavefront.as_ref().expect("every field has a wavefront");
        let strehl = wavefront.strehl.unwrap();
        assert!(strehl > 0.0 && strehl <= 1.0 && wavefront.rms_waves < 2.0, "{spot:?}");
    }
}

#[test]
fn maps_hold_the_aberration_of_the_wavefront() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(5.6, 550.0).unwrap();
    let analysis = request(vec![0.0]).compute(&lens).unwrap();
    for (map, spot) in analysis.opd_maps.iter().zip(&analysis.spots) {
        let middle = map.waves[map.waves.len() / 2].unwrap();
        assert!(middle.abs() < 1e-9, "the chief ray has no path difference");
        let waves: Vec<f64> = map.waves.iter().flatten().copied().collect();
        let mean = waves.iter().sum::<f64>() / waves.len() as f64;
        let rms = (waves.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / waves.len() as f64).sqrt();
        // On the axis there is no tilt to take out; cells leave out a thirtieth of the disc at its edge, unevenly.
        let expected = spot.wavefront.as_ref().unwrap().rms_waves;
        assert!((rms / expected - 1.0).abs() < 0.05, "{rms} {expected}");
    }
}

#[test]
fn a_film_curved_like_the_image_is_sharp_all_over() {
    // A ball with its stop in the middle: every field is as the axis, its image on a sphere about the center.
    let half = |radius_mm: f64, index: f64, thickness_after_mm: f64| Interface {
        surface: Surface::sphere(radius_mm, 9.0),
        medium_after: if index == 1.0 { Glass::Air } else { Glass::Constant { index } },
        thickness_after_mm,
    };
    let index = 1.5;
    let stop =
        Interface { surface: Surface::plane(1.0), medium_after: Glass::Constant { index }, thickness_after_mm: 10.0 };
    let ball = vec![half(10.0, index, 10.0), stop, half(-10.0, 1.0, 0.0)];
    let ball = Lens::new("ball", "test", ball, 1).unwrap();
    // The focal length of a ball is n R / (2 (n − 1)), from its center.
    let film_radius_mm = 0.5 * index * 10.0 / (index - 1.0);
    let curved = ImageSurface { curvature_per_mm: -1.0 / film_radius_mm, conic: 0.0 };
    let (flat, round) = (ball.clone(), ball.with_image_surface(curved).unwrap());
    let [flat, round] = [flat, round].map(|lens| request(vec![0.0, 20.0, 40.0]).compute(&lens).unwrap());
    assert_eq!((flat.film_radius_mm, round.film_radius_mm.map(f64::round)), (None, Some(-15.0)));
    assert!((flat.film_distance_mm - round.film_distance_mm).abs() < 1e-3, "a spot on the axis hardly sees the bend");
    for (row, field_deg) in round.fields.iter().zip([0.0f64, 20.0, 40.0]) {
        // Chief rays go straight on through the center.
        let radius_mm = 10.0 + round.film_distance_mm;
        let near = film_radius_mm * field_deg.to_radians().sin();
        assert!((row.height_mm.unwrap() - near).abs() < (radius_mm - film_radius_mm).abs() + 1e-9, "{row:?}");
        // No ray near a diameter knows which one it is: no astigmatism, and the axis's distance to the film in every
        // direction.
        let (s, t) = (row.sagittal_focus_mm.unwrap(), row.tangential_focus_mm.unwrap());
        let on_axis = round.fields[0].sagittal_focus_mm.unwrap();
        assert!((s - t).abs() < 1e-6 && (s - on_axis * field_deg.to_radians().cos()).abs() < 0.02, "{s} {t}");
    }
    let rms_um = |analysis: &LensAnalysis, i: usize| analysis.spots[3 * i + 1].rms_um.unwrap();
    assert!(rms_um(&round, 2) < 1.1 * rms_um(&round, 0), "{} {}", rms_um(&round, 2), rms_um(&round, 0));
    assert!(rms_um(&flat, 2) > 10.0 * rms_um(&round, 2));
    let wavefront = |i: usize| round.spots[3 * i + 1].wavefront.as_ref().unwrap().rms_waves;
    assert!((wavefront(1) / wavefront(0) - 1.0).abs() < 0.2, "{} {}", wavefront(0), wavefront(1));
}

#[test]
fn an_anamorphic_lens_is_analyzed_along_both_axes() {
    let shape = Shape::Biconic { conic: 0.0, curvature_x_per_mm: 0.03, conic_x: 0.0 };
    let row = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    let front = Surface { curvature_per_mm: 0.01, shape, semi_aperture_mm: 12.0 };
    let rows = vec![
        row(Surface::plane(1.0), Glass::Air, 2.0),
        row(front, Glass::Constant { index: 1.5 }, 3.0),
        row(Surface::plane(12.0), Glass::Air, 0.0),
    ];
    let lens = Lens::new("anamorphic", "test", rows, 0).unwrap();
    let fields = AnalysisFields::AnglesDeg(vec![[0.0, 0.0], [0.0, 4.0], [4.0, 0.0], [3.0, 4.0]]);
    let x = lens.at(550.0).unwrap().first_order_x();
    let analysis = on_film(&lens, x.bfl_mm, fields);
    assert!((analysis.x_plane.unwrap().efl_mm - 200.0 / 3.0).abs() < 1e-9 && (analysis.efl_mm - 200.0).abs() < 1e-9);
    assert!((analysis.focus.paraxial_x_film_mm.unwrap() - x.bfl_mm).abs() < 1e-12);
    let [axis, up, right, corner] = [0, 1, 2, 3].map(|i| &analysis.fields[i]);
    assert!(axis.x_focus_mm.unwrap().abs() < 1e-6 && (axis.y_focus_mm.unwrap() - 400.0 / 3.0).abs() < 3.0);
    // In focus along x a far point's place is f tan θ; out of focus along y it is the chief ray's.
    let tan = 4f64.to_radians().tan();
    assert!((right.image_mm.unwrap()[0] / (200.0 / 3.0 * tan) - 1.0).abs() < 0.01, "{right:?}");
    assert!(up.image_mm.unwrap()[0].abs() < 1e-9 && up.distortion_tangent_percent.unwrap().abs() < 1.0);
    assert!(corner.place.field_deg > 4.9 && corner.distortion_tangent_percent.unwrap().abs() < 1.0, "{corner:?}");
    // A line along y is a spot that is in focus along x alone.
    let spot = &analysis.spots[1];
    assert!(spot.sigma_x_um.unwrap() < 0.02 * spot.sigma_y_um.unwrap(), "{spot:?}");
}

#[test]
fn a_tilted_lens_is_analyzed_and_keeps_what_symmetry_is_left() {
    let straight = Lens::built_in("tessar-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let tilt = |tilt_deg| {
        let step =
            CoordinateBreak { surfaces: (2, 3), pivot_mm: 0.0, decenter_mm: [0.0; 3], tilt_deg, tilt_first: false };
        straight.clone().with_moves(vec![step]).unwrap()
    };
    let fields = || AnalysisFields::AnglesDeg(vec![[0.0, 0.0], [0.0, 8.0], [0.0, -8.0], [8.0, 0.0], [-8.0, 0.0]]);
    let film_distance_mm = straight.at(550.0).unwrap().film_distance_mm_for(f64::INFINITY).unwrap();
    // Tilted about x, left and right stay alike, and up and down do not.
    let analysis = on_film(&tilt([0.4, 0.0, 0.0]), film_distance_mm, fields());
    let rms = |i: usize| analysis.spots[3 * i + 1].rms_um.unwrap();
    assert!((rms(3) / rms(4) - 1.0).abs() < 1e-6, "{} {}", rms(3), rms(4));
    assert!((rms(1) / rms(2) - 1.0).abs() > 1e-3, "{} {}", rms(1), rms(2));
    assert!(analysis.spots.iter().all(|spot| spot.wavefront.is_some()) && analysis.grid.len() == 121);
    // A tilt of nothing is the straight lens.
    let (none, plain) =
        (on_film(&tilt([0.0; 3]), film_distance_mm, fields()), on_film(&straight, film_distance_mm, fields()));
    assert_eq!(none.spots, plain.spots);
    assert!(plain.x_plane.is_none() && analysis.x_plane.is_some());
}

#[test]
fn an_objective_in_water_is_analyzed_by_heights() {
    // Water, a thin lens as the objective and one as the tube lens: ideal, so that all is known.
    let stop = |power_per_mm: f64, thickness_after_mm| Interface {
        surface: Surface {
            curvature_per_mm: 0.0,
            shape: Shape::ThinLens { power_per_mm },
            semi_aperture_mm: if thickness_after_mm > 0.0 { 4.0 } else { 20.0 },
        },
        medium_after: Glass::Air,
        thickness_after_mm,
    };
    let water = Glass::Constant { index: 1.33 };
    let lens = Lens::new("water dipping", "test", vec![stop(0.2, 50.0), stop(0.005, 0.0)], 0).unwrap();
    let lens = lens.with_object_medium(water).unwrap();
    let request = AnalysisRequest {
        fields: AnalysisFields::HeightsMm(vec![[0.0, 0.0], [0.0, 0.05], [0.03, 0.04]]),
        distance_mm: 5.0 * 1.33,
        ..request(vec![])
    };
    let analysis = request.compute(&lens).unwrap();
    // The front focal length is n f; the magnification is that of the two focal lengths; n sin u = M n′ sin u′ only for an
    // aplanat, which an ideal lens of straight lines is not.
    assert!((analysis.film_distance_mm - 200.0).abs() < 1e-6 && analysis.object_index == 1.33);
    let expected = 1.33 * 4.0 / 4.0f64.hypot(6.65);
    assert!((analysis.object_na.unwrap() - expected).abs() < 1e-8, "{:?}", analysis.object_na);
    for (row, place_mm) in analysis.fields.iter().zip([[0.0, 0.0], [0.0, 0.05], [0.03, 0.04]]) {
        assert_eq!(row.place.object_mm, Some(place_mm));
        let image_mm = row.image_mm.unwrap();
        assert!((image_mm[0] - 40.0 * place_mm[0]).abs() < 1e-9 && (image_mm[1] - 40.0 * place_mm[1]).abs() < 1e-9);
    }
    assert!((analysis.fields[2].height_mm.unwrap() - 2.0).abs() < 1e-9);
    // By light, at this distance: shares of one field.
    let by_light = AnalysisRequest { fields: AnalysisFields::ByLight, ..request }.compute(&lens).unwrap();
    assert!(by_light.fields[3].place.field_deg > 5.0 && by_light.spots.iter().all(|spot| spot.rms_um.is_some()));
}

#[test]
fn chosen_fields_end_where_spots_do() {
    let of = |fields| AnalysisRequest { fields, wavelengths_nm: vec![550.0], ..request(vec![0.0]) };
    let asphere = Lens::built_in("asphere-15mm").unwrap();
    let analysis = of(AnalysisFields::ByLight).compute(&asphere).unwrap();
    // A condenser is lit to beyond 75°, where nothing is an image any more.
    assert!(analysis.fields[3].place.field_deg < 40.0, "{:?}", analysis.fields[3].place);
    assert!(analysis.notes.iter().any(|note| note.contains("no longer comes together")), "{:?}", analysis.notes);
    let fisheye = of(AnalysisFields::ByLight).compute(&Lens::built_in("fisheye-12.5mm").unwrap()).unwrap();
    assert!(fisheye.fields[3].place.field_deg > 60.0, "{:?}", fisheye.fields[3].place);
}

#[test]
fn afocal_lens_is_analyzed_by_angles() {
    // Kepler's telescope of two ideal lenses: five times the angle, a sharp point in the focus of the third.
    let front = Lens::thin(100.0, 10.0).unwrap().interfaces()[0].clone();
    let back = Lens::thin(20.0, 40.0).unwrap().interfaces()[0].clone();
    let front = Interface { thickness_after_mm: 120.0, ..front };
    let telescope = Lens::new("telescope", "test", vec![front, back], 0).unwrap();
    let request = AnalysisRequest { wavelengths_nm: vec![550.0], ..request(vec![0.0, 1.0]) };
    let analysis = request.compute(&telescope).unwrap();
    assert!(analysis.notes.iter().any(|note| note.contains("1 µm is 1 µrad")), "{:?}", analysis.notes);
    let height_mm = analysis.spots[1].height_mm.unwrap();
    assert!((height_mm.abs() - 5000.0 * 1_f64.to_radians().tan()).abs() < 1e-6, "{height_mm}");
    assert!(analysis.spots.iter().all(|spot| spot.rms_um.unwrap() < 1e-3));
}

/// Light and fields of weight 0 have no part in a focus.
#[test]
fn foci_are_those_of_what_is_weighed() {
    let lens = Lens::built_in("singlet-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let all = request(vec![0.0, 10.0]);
    let red = AnalysisRequest { wavelengths_nm: vec![650.0], ..all.clone() }.compute(&lens).unwrap().focus;
    let weighed = AnalysisRequest { wavelength_weights: vec![0.0, 0.0, 2.0], ..all.clone() }.compute(&lens).unwrap();
    let close = |a: Option<f64>, b: Option<f64>| (a.unwrap() - b.unwrap()).abs() < 1e-6;
    assert!(close(weighed.focus.axis_film_mm, red.axis_film_mm), "{:?} {red:?}", weighed.focus);
    assert!(close(Some(weighed.film_distance_mm), red.axis_film_mm));
    let alike = all.compute(&lens).unwrap().focus;
    assert!((alike.axis_film_mm.unwrap() - red.axis_film_mm.unwrap()).abs() > 0.1);
    let axis_alone = AnalysisRequest { field_weights: vec![1.0, 0.0], ..all }.compute(&lens).unwrap().focus;
    assert!(close(axis_alone.fields_film_mm, axis_alone.axis_film_mm), "{axis_alone:?}");
    assert!(!close(alike.fields_film_mm, alike.axis_film_mm));
}
