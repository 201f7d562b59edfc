//! Files of every kind by their names, with depth and camera data beside them.

use super::*;
use crate::{FillDepth, SceneLight, write_spectral_exr};
use approx::assert_relative_eq;
use dioptric_spectrum::{Illuminant, Quantity, WavelengthGrid};
use ndarray::Array2;

#[test]
fn a_file_of_reflectances_is_lit_and_given_depth_and_view() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("white.exr");
    let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
    let planes = vec![Array2::from_elem((4, 8), 1.0); grid.len()];
    let white = SpectralImage::new(Quantity::Reflectance, grid, planes).unwrap();
    write_spectral_exr(&path, &white, &crate::ExrParts::default()).unwrap();
    let bare = read_scene(&path, &ReadOptions::default()).unwrap();
    assert!(bare.require_depth().unwrap_err().to_string().starts_with("white.exr: "));
    // White under 1000 lx is 1000/π cd/m²; 5 nm bands are within 0.1 % of 1 nm ones.
    assert_relative_eq!(bare.mean_luminance_cd_m2(), 318.31, max_relative = 1e-3);
    let options = ReadOptions { depth_m: Some(2.0), horizontal_fov_deg: Some(30.0), ..ReadOptions::default() };
    let scene = read_scene(&path, &options).unwrap();
    assert_eq!(scene.require_depth().unwrap().range_m(), (2.0, 2.0));
    assert_eq!(scene.light, Some(SceneLight::new(Illuminant::D65, 1000.0)));
    assert_relative_eq!(scene.require_view().unwrap().horizontal_fov_deg(8), 30.0, max_relative = 1e-12);
    let beyond = ReadOptions { grid: Some(WavelengthGrid::uniform(300.0, 700.0, 10.0).unwrap()), ..options };
    assert!(read_scene(&path, &beyond).is_err());
}

#[test]
fn resampled_bands_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("uneven.exr");
    let own = WavelengthGrid::new(vec![400.0, 420.0, 450.0, 500.0, 560.0, 640.0, 700.0]).unwrap();
    let planes = own.centers_nm().iter().map(|&nm| Array2::from_elem((2, 3), nm as f32)).collect();
    let image = SpectralImage::new(Quantity::Radiance, own, planes).unwrap();
    write_spectral_exr(&path, &image, &crate::ExrParts::default()).unwrap();
    let with = |grid| ReadOptions { grid, ..ReadOptions::default() };
    assert_eq!(read_scene(&path, &with(None)).unwrap().notes.len(), 1);
    let even = WavelengthGrid::uniform(420.0, 680.0, 20.0).unwrap();
    let scene = read_scene(&path, &with(Some(even.clone()))).unwrap();
    let note = &scene.notes[1];
    assert!(
        note.starts_with("uneven.exr: 7 bands of 400–700 nm, 20 to 80 nm apart become 14 bands of 420–680 nm, 20 nm"),
        "{note}"
    );
    // A straight spectrum stays straight, whatever the bands.
    for (value, &nm) in scene.radiance.spectrum_at(1, 1).iter().zip(even.centers_nm()) {
        assert_relative_eq!(*value, nm, max_relative = 1e-6);
    }
}

#[test]
fn unmeasured_depth_of_a_picture_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.png");
    dioptric_pictures::save(&image::RgbImage::new(4, 2).into(), &path).unwrap();
    let depth =
        image::ImageBuffer::from_fn(4, 2, |x, y| image::Luma([if y == 0 && x > 0 { 0 } else { 500_u16 + x as u16 }]));
    dioptric_pictures::save(&depth.into(), &folder.path().join("room.depth.png")).unwrap();
    let read = |fill_depth| read_scene(&path, &ReadOptions { fill_depth, ..ReadOptions::default() }).unwrap();
    let usual = read(None);
    assert_eq!(usual.notes.len(), 3, "{:?}", usual.notes);
    // Black is asked about.
    assert!(usual.notes[2].contains("luminance"));
    assert!(
        usual.notes[1].starts_with("3 of 8 samples (37.50 %) have no depth; they get the farther"),
        "{:?}",
        usual.notes
    );
    assert_eq!(usual.require_depth().unwrap().z_m()[(0, 3)], 0.5);
    assert_eq!(read(Some(FillDepth::Metres(2.0))).require_depth().unwrap().z_m()[(0, 3)], 2.0);
}

#[test]
fn a_name_that_tells_nothing_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xyz");
    let message = |path: &Path| read_scene(path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(message(&path).contains("scene.xyz: cannot be read: there is no such file"));
    std::fs::write(&path, "").unwrap();
    assert!(message(&path).contains("it is empty"));
    std::fs::write(&path, "a").unwrap();
    assert!(message(&path).contains("expected a .exr"));
    assert!(message(&folder.path().join("absent.exr")).contains("absent.exr"));
}

#[dioptric_golden::needs_shared]
#[test]
fn the_real_scenes_have_depth_and_camera_data() {
    let Some(folder) = dioptric_golden::shared("data/scenes") else { return };
    let piano = read_scene(&folder.join("piano3d.radiance_depth.exr"), &ReadOptions::default()).unwrap();
    assert_relative_eq!(piano.require_view().unwrap().horizontal_fov_deg(200), 40.0, max_relative = 1e-9);
    // Radiance does not tell what light was on it.
    assert_eq!(piano.light, None);
    let (near, far) = piano.require_depth().unwrap().range_m();
    assert!(near > 0.3 && far < 0.9);
    // The provenance of the file says 99.999 cd/m².
    assert_relative_eq!(piano.mean_luminance_cd_m2(), 99.999, max_relative = 2e-3);
    let motorcycle = read_scene(&folder.join("motorcycle_370.radiance_depth.exr"), &ReadOptions::default()).unwrap();
    assert_relative_eq!(motorcycle.require_view().unwrap().focal_px, 994.978 / 2.0, max_relative = 1e-12);
    // Its provenance says 100 cd/m², from a spectrum every 5 nm: of the narrow lines of the display that made it,
    // the 20 nm samples of the file hold 1.37 times as much for white.
    assert_relative_eq!(motorcycle.mean_luminance_cd_m2(), 135.0, max_relative = 0.05);
}
