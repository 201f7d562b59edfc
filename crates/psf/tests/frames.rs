//! Decentered stops, tilted and decentered films and curved films, each in its own frame.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::sync::Arc;

use dioptric_diffraction::{CircularStop, Hurb, trace_stop_rays};
use dioptric_optics::{CoordinateBreak, Glass, ImageSurface, Interface, Lens, ObjectPoint, Surface, rays_towards};
use dioptric_psf::{
    ArrayFields, Diffraction, FilmQuery, ImageSettings, LensImage, LensImageModel, PointImage, PsfArray, PsfArrayParts,
};
use glam::{DMat2, DVec2};
use ndarray::Array5;

const NM: f64 = 550.0;

fn double_gauss() -> Lens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, NM).unwrap()
}

/// The lens with surfaces `first..=last` moved; the film counts as the one after the last.
fn placed(lens: &Lens, surfaces: (usize, usize), decenter_mm: [f64; 3], tilt_deg: [f64; 3]) -> Lens {
    let step = CoordinateBreak { surfaces, pivot_mm: 0.0, decenter_mm, tilt_deg, tilt_first: false };
    lens.clone().with_moves(vec![step]).unwrap()
}

/// The image of a far point.
fn image(lens: &Lens, film_distance_mm: f64, field_tan: DVec2, diffraction: Diffraction) -> PointImage {
    let settings = ImageSettings::new(film_distance_mm, diffraction);
    PointImage::trace(lens, &settings, field_tan, 0.0, NM).unwrap().unwrap()
}

/// A lens moved aside as a whole deviates each ray of a far point as the lens in its old place does: the covariance on the
/// film is the same, the place shifted.
#[test]
fn decentered_stop_keeps_hurb_rays() {
    let lens = double_gauss();
    let shift = DVec2::new(0.9, -1.7);
    let all = (0, lens.interfaces().len() - 1);
    let mono = lens.at(NM).unwrap();
    let moved = placed(&lens, all, [shift.x, shift.y, 0.0], [0.0; 3]).at(NM).unwrap();
    let (film_distance_mm, z_mm) = (mono.first_order().bfl_mm + 0.2, mono.projection_center_z_mm());
    let edge = CircularStop::new(mono.stop_semi_aperture_mm(), NM, 1.0);
    // More than half the stop's radius: before, part of the pupil counted as outside the edge.
    assert!(shift.length() > 0.5 * edge.radius_mm, "{}", edge.radius_mm);
    for field_tan in [DVec2::ZERO, DVec2::new(0.1, 0.05)] {
        let point = ObjectPoint::from_field(&mono, field_tan, 0.0);
        let radius_mm = 0.45 * mono.first_order().entrance_pupil_diameter_mm;
        let targets: Vec<DVec2> =
            (0..40).map(|i| DVec2::from_angle(2.4 * f64::from(i)) * (radius_mm * f64::from(i) / 40.0)).collect();
        let aside: Vec<DVec2> = targets.iter().map(|target| target + shift).collect();
        let expected = trace_stop_rays(&mono, rays_towards(&point, &targets, z_mm, 0.0), film_distance_mm);
        let found = trace_stop_rays(&moved, rays_towards(&point, &aside, z_mm, 0.0), film_distance_mm);
        for (found, expected) in found.into_iter().zip(expected) {
            let (found, expected) = (found.unwrap(), expected.unwrap());
            assert!((found.stop.mm - expected.stop.mm).length() < 1e-9, "{found:?} {expected:?}");
            assert!((found.film.mm - expected.film.mm - shift).length() < 1e-9, "{found:?} {expected:?}");
            let [a, b] = [found, expected].map(|ray| ray.film_covariance_mm2(edge, Hurb::PAPER));
            // Difference quotients leave 1e-9 of a derivative.
            for (a, b) in [(a.xx, b.xx), (a.xy, b.xy), (a.yy, b.yy)] {
                assert!(
                    (a - b).abs() < 1e-7 * (expected.film_covariance_mm2(edge, Hurb::PAPER).xx + b.abs()),
                    "{a} {b}"
                );
            }
        }
    }
}

/// The HURB picture of a lens moved aside is that of the lens in place, shifted.
#[test]
fn decentered_stop_keeps_psf() {
    let lens = double_gauss();
    let all = (0, lens.interfaces().len() - 1);
    let film_distance_mm = lens.at(NM).unwrap().first_order().bfl_mm;
    let moved = placed(&lens, all, [0.9, -1.7, 0.0], [0.0; 3]);
    let field = DVec2::new(0.08, 0.03);
    let [a, b] = [&lens, &moved].map(|lens| image(lens, film_distance_mm, field, Diffraction::Hurb { gamma: 1.0 }));
    let shift = b.centroid_mm() - a.centroid_mm();
    // The picture frame is the film turned by 180°; the outlines of the two pupils are sampled at other places.
    assert!((shift - DVec2::new(-0.9, 1.7)).length() < 1e-6, "{shift}");
    let [(a, _), (b, _)] = [a, b].map(|image| image.picture(2.0, 81));
    let l1: f64 = (&a - &b).iter().map(|d| d.abs()).sum();
    assert!(l1 < 2e-3, "{l1}");
}

/// Functions of an array go with the axis of a lens that is moved aside, at every depth.
#[test]
fn stored_functions_move_with_the_axis() {
    let all = (0, double_gauss().interfaces().len() - 1);
    let moved = placed(&double_gauss(), all, [0.9, -1.7, 0.0], [0.0; 3]);
    // The light of a field of 4 degrees lies beside the middle sample, that of the axis in it.
    let mut samples = Array5::zeros((2, 1, 1, 3, 3));
    samples[(0, 0, 0, 1, 1)] = 1.0;
    samples[(1, 0, 0, 1, 2)] = 1.0;
    let fields = ArrayFields::Heights(vec![0.0, 4.0]);
    let parts = PsfArrayParts { fields, distances_mm: vec![], wavelengths_nm: vec![], pitch_um: vec![5.0], samples };
    let settings = ImageSettings::new(moved.at(NM).unwrap().first_order().bfl_mm + 8.0, Diffraction::None);
    let traced = LensImageModel::new(&moved, &[NM], &settings).unwrap();
    let stored = traced.clone().with_psfs(Arc::new(PsfArray::new(parts).unwrap())).unwrap();
    let focus_dioptres = stored.focus_dioptres();
    assert!(focus_dioptres > 2.0, "{focus_dioptres}");
    for dioptres in [focus_dioptres, 0.5 * focus_dioptres, 0.0] {
        // What lies straight before the moved axis is seen there.
        let ahead = DVec2::new(0.9, -1.7) * (1e-3 * dioptres);
        let image = stored.point(ahead, dioptres, NM).unwrap();
        assert!((image.centroid_mm() - DVec2::new(-0.9, 1.7)).length() < 1e-6, "{}", image.centroid_mm());
        let kernel = image.kernel(5.0).0;
        assert_eq!((kernel.samples.iter().copied().fold(0.0, f32::max), kernel.samples.len()), (1.0, 1), "{dioptres}");
        // Elsewhere a point lies where its light does, but for the lens's aberrations.
        let aside = DVec2::new(0.06, 0.02);
        let [place_mm, light_mm] = [&stored, &traced].map(|of| of.point(aside, dioptres, NM).unwrap().centroid_mm());
        assert!((place_mm - light_mm).length() < 0.01, "{place_mm} {light_mm}");
    }
    let query =
        FilmQuery { place_mm: DVec2::new(-0.9, 1.7), dioptres: focus_dioptres, wavelength_nm: NM, pitch_um: 5.0 };
    assert_eq!(stored.kernel(query).samples.len(), 1);
}

/// What lands on a film that is moved aside, or turned about its normal, has other coordinates there.
#[test]
fn moved_film_counts_its_own_coordinates() {
    let lens = double_gauss();
    let film = lens.interfaces().len();
    let film_distance_mm = lens.at(NM).unwrap().first_order().bfl_mm + 0.3;
    let field = DVec2::new(0.08, 0.03);
    for diffraction in [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }] {
        let at = |lens: &Lens| image(lens, film_distance_mm, field, diffraction).centroid_mm();
        let straight = at(&lens);
        // The picture frame turns x and y of the film about.
        let aside = at(&placed(&lens, (film, film), [0.5, -0.2, 0.0], [0.0; 3]));
        assert!((aside - straight - DVec2::new(0.5, -0.2)).length() < 1e-9, "{aside} {straight}");
        let turned = at(&placed(&lens, (film, film), [0.0; 3], [0.0, 0.0, 30.0]));
        let back = DMat2::from_angle(30f64.to_radians()) * turned;
        assert!((back - straight).length() < 1e-9, "{back} {straight}");
        // A film tilted about x by θ: chief rays from the exit pupil cross it at y' with y = y' cos θ.
        let tilted = at(&placed(&lens, (film, film), [0.0; 3], [40.0, 0.0, 0.0]));
        assert!((tilted.y / straight.y).abs() > 1.2, "{tilted} {straight}");
    }
}

/// A wave picture on a film that is turned about its normal is turned the other way.
#[test]
fn moved_film_turns_waves() {
    let lens = double_gauss();
    let film = lens.interfaces().len();
    let film_distance_mm = lens.at(NM).unwrap().first_order().bfl_mm;
    let field = DVec2::new(0.1, 0.0);
    let picture = |lens: &Lens| {
        let (picture, model) = image(lens, film_distance_mm, field, Diffraction::Wave).picture(2.0, 61);
        assert!(model.wave_fraction > 0.9, "{model:?}");
        picture
    };
    let straight = picture(&lens);
    let quarter = picture(&placed(&lens, (film, film), [0.0; 3], [0.0, 0.0, 90.0]));
    // The film turned by a quarter to the left sees the picture turned by a quarter to the right.
    let l1: f64 =
        quarter.indexed_iter().map(|((row, column), e)| (e - straight[(60 - column, row)]).abs()).sum::<f64>();
    assert!(l1 < 1e-6, "{l1}");
    assert!((&quarter - &straight).iter().map(|d| d.abs()).sum::<f64>() > 0.05, "the picture has no direction");
}

/// A ball of glass with its stop in the middle, which sees alike in all directions but for the stop's foreshortening.
fn ball() -> Lens {
    let interface = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    let glass = || Glass::Constant { index: 1.5 };
    let interfaces = vec![
        interface(Surface::sphere(10.0, 7.0), glass(), 10.0),
        interface(Surface::plane(0.5), glass(), 10.0),
        interface(Surface::sphere(-10.0, 7.0), Glass::Constant { index: 1.0 }, 0.0),
    ];
    Lens::new("ball", "a test", interfaces, 1).unwrap()
}

/// On a film concentric with a ball lens every field is in focus, and lands at the radius times the sine of its angle.
#[test]
fn curved_film_keeps_every_field_in_focus() {
    let lens = ball();
    let film_distance_mm = lens.at(NM).unwrap().first_order().bfl_mm;
    let radius_mm = film_distance_mm + 10.0;
    let curved = ImageSurface { curvature_per_mm: -1.0 / radius_mm, conic: 0.0 };
    let curved = lens.clone().with_image_surface(curved).unwrap();
    let tan = 25f64.to_radians().tan();
    for diffraction in [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }] {
        let reach = |lens: &Lens, tan: f64| image(lens, film_distance_mm, DVec2::X * tan, diffraction).extent_mm();
        let (flat, curved) = (&lens, &curved);
        // The stop's foreshortening makes the spot a little smaller.
        assert!(reach(curved, tan) < 1.01 * reach(curved, 0.0), "{} {}", reach(curved, tan), reach(curved, 0.0));
        assert!(reach(flat, tan) > 5.0 * reach(curved, tan), "{} {}", reach(flat, tan), reach(curved, tan));
        let settings = ImageSettings::new(film_distance_mm, diffraction);
        let model = LensImageModel::new(curved, &[NM], &settings).unwrap();
        let height_mm = model.film_map(NM, 12.0).place_mm(DVec2::X * tan).unwrap().x;
        assert!((height_mm / (radius_mm * 25f64.to_radians().sin()) - 1.0).abs() < 1e-4, "{height_mm}");
    }
}
