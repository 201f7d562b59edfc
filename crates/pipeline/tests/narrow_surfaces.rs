//! Surfaces narrower than the pupil are found where a scene is imaged in layers of depth.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_pipeline::{
    BlurSpec, Camera, Capture, FilmSpec, FocusSpec, Given, KeptCamera, LensSpec, Quality, Silent, StopSpec,
    WavelengthSpec,
};
use dioptric_scene::{HiddenLayer, Scene, View};
use dioptric_spectrum::{Cancel, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

const BANDS_NM: [f64; 3] = [500.0, 550.0, 600.0];
const SIZE: (usize, usize) = (360, 540);

/// A checkered wall 4 m away behind slats 1 m away, so many samples wide, each sample half a pixel.
fn slats(width_px: usize, hidden: bool) -> Scene {
    let image = |plane: Array2<f32>| {
        let grid = WavelengthGrid::new(BANDS_NM.to_vec()).unwrap();
        SpectralImage::new(Quantity::Radiance, grid, vec![plane; 3]).unwrap()
    };
    let is_slat = |column: usize| column % 70 < width_px;
    let wall = Array2::from_shape_fn(SIZE, |(r, c)| if (r / 18 + c / 18) % 2 == 0 { 1.5 } else { 0.1_f32 });
    let front = Array2::from_shape_fn(SIZE, |(r, c)| if is_slat(c) { 0.4 } else { wall[(r, c)] });
    let z_m = Array2::from_shape_fn(SIZE, |(_, c)| if is_slat(c) { 1.0 } else { 4.0_f32 });
    let behind = HiddenLayer { radiance: image(wall), depth: DepthMap::flat(SIZE.0, SIZE.1, 4.0).unwrap() };
    let view = View { focal_px: 4000.0, center_x_px: 269.5, center_y_px: 179.5 };
    Scene {
        depth: Some(DepthMap::new(z_m).unwrap()),
        view: Some(view),
        hidden: hidden.then_some(behind),
        points: vec![],
        ..Scene::new("slats", image(front))
    }
}

fn capture(scene: Scene, blur: BlurSpec, quality: Quality) -> Capture {
    let mut camera = Camera::demo().unwrap();
    camera.lens = LensSpec::BuiltIn("dgauss-50mm".to_owned());
    camera.stop = StopSpec::FNumber(2.8);
    camera.focus = FocusSpec::DistanceMm(2000.0);
    camera.film = FilmSpec::Pixels { columns: 150, rows: 100, pitch_um: 25.0 };
    camera.blur = blur;
    camera.wavelengths = WavelengthSpec::ListNm(BANDS_NM.to_vec());
    let kept = KeptCamera::new(camera).with_quality(quality).with_given_scene(Given::new(scene));
    kept.capture(&Silent, &Cancel::new()).unwrap()
}

#[test]
fn surfaces_narrower_than_the_pupil_are_stated() {
    let narrow = |scene, blur| capture(scene, blur, Quality::Preview).irradiance.summary.narrow_surfaces;
    let known = narrow(slats(14, true), BlurSpec::Layered).unwrap();
    // 14 samples of 70.
    assert!((known.fraction - 0.2).abs() < 0.03 && known.is_known_behind, "{known:?}");
    assert!(known.note().unwrap().contains("--blur views:16"), "{known:?}");
    let guessed = narrow(slats(14, false), BlurSpec::Layered).unwrap();
    assert_eq!((guessed.fraction, guessed.is_known_behind), (known.fraction, false));
    assert!(guessed.note().unwrap().contains("is guessed: a second layer"), "{guessed:?}");
    // The pupil of 18 mm is 13.4 mm wide at the slats, which are 13.5 mm.
    assert_eq!(narrow(slats(54, true), BlurSpec::Layered), None);
    assert_eq!(narrow(slats(14, true), BlurSpec::Pointwise), None);
}

/// Two rows of slats before the wall, the nearer ones over the edges of the others: the second layer shows these, and not what lies behind both.
#[test]
fn what_lies_behind_two_surfaces_is_said_to_be_unknown() {
    let mut scene = slats(14, true);
    let depth = scene.depth.take().unwrap().z_m().clone();
    let is_second = |column: usize| (7..28).contains(&(column % 70));
    let with_second =
        |z_m: &Array2<f32>| Array2::from_shape_fn(SIZE, |at| if is_second(at.1) { z_m[at].min(1.6) } else { z_m[at] });
    scene.depth = Some(DepthMap::new(with_second(&depth)).unwrap());
    let hidden = scene.hidden.as_mut().unwrap();
    hidden.depth = DepthMap::new(with_second(hidden.depth.z_m())).unwrap();
    let unknown = |scene| {
        let capture = capture(scene, BlurSpec::Layered, Quality::Preview);
        capture.irradiance.summary.narrow_surfaces.unwrap()
    };
    let found = unknown(scene);
    assert!((0.05..0.5).contains(&found.unknown_fraction), "{found:?}");
    assert!(found.note_on_unknown().unwrap().contains("two surfaces"), "{found:?}");
    let found = unknown(slats(14, true));
    assert!(found.unknown_fraction < 1e-3 && found.note_on_unknown().is_none(), "{found:?}");
}
