//! Files that went wrong once, and their kinds.

use std::path::{Path, PathBuf};

use approx::{assert_abs_diff_eq, assert_relative_eq};
use dioptric_pictures::save;
use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid};
use image::{ImageBuffer, Luma, Rgb};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{FileQuantity, FileReading, NoData, ReadOptions, read_scene};
use crate::Scene;

/// What the finding's command line says of each file.
fn usual() -> ReadOptions {
    ReadOptions { horizontal_fov_deg: Some(20.0), depth_m: Some(2.0), ..ReadOptions::default() }
}

fn input(name: &str) -> Option<PathBuf> {
    dioptric_golden::shared(&format!("inputs/scenes/{name}"))
}

fn read(path: &Path, options: &ReadOptions) -> Scene {
    read_scene(path, options).unwrap()
}

#[dioptric_golden::needs_shared]
#[test]
fn gains_of_a_header_are_obeyed() {
    let Some(path) = input("gains.hdr") else { return };
    // The finding's own sum over the file.
    assert_relative_eq!(read(&path, &usual()).mean_luminance_cd_m2(), 361.0, max_relative = 2e-3);
    // The file of numbers leads to its header.
    assert_eq!(read(&path.with_extension("img"), &usual()).radiance, read(&path, &usual()).radiance);
}

#[dioptric_golden::needs_shared]
#[test]
fn pages_of_a_tiff_are_bands() {
    let Some(path) = input("pages.tif") else { return };
    let message = read_scene(&path, &usual()).unwrap_err().to_string();
    assert!(message.contains("31 bands") && message.contains("--scene-wavelengths-nm"), "{message}");
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
    let scene = read(&path, &ReadOptions { grid: Some(grid.clone()), ..usual() });
    assert_eq!((scene.radiance.grid(), scene.rows(), scene.columns()), (&grid, 24, 32));
    assert!(scene.notes[0].contains("reflectance, 65535"), "{:?}", scene.notes);
}

#[dioptric_golden::needs_shared]
#[test]
fn depth_is_that_of_its_own_pass() {
    let Some(path) = input("denoising_depth.exr") else { return };
    let scene = read(&path, &usual());
    let (near, far) = scene.require_depth().unwrap().range_m();
    assert!((near - 2.0).abs() < 0.05 && (far - 2.7).abs() < 0.05, "{near} {far}");
    let notes = scene.notes.join("\n");
    assert!(notes.contains("'ViewLayer.Denoising Depth.Z'") && notes.contains("--depth-m"), "{notes}");
}

#[dioptric_golden::needs_shared]
#[test]
fn depth_scale_and_distortion_of_a_camera_file_count() {
    let Some(path) = input("depth_scale.png") else { return };
    let scene = read(&path, &ReadOptions::default());
    let (near, far) = scene.require_depth().unwrap().range_m();
    let codes = image::open(path.with_file_name("depth_scale.depth.png")).unwrap().into_luma16();
    let code = |pick: fn(u16, u16) -> u16, start: u16| codes.pixels().map(|p| p.0[0]).fold(start, pick);
    // A straight picture leaves out the corners, where the depths of the file's ramp end.
    let (nearest, farthest) = (f64::from(code(u16::min, u16::MAX)) / 5000.0, f64::from(code(u16::max, 0)) / 5000.0);
    assert!(near >= nearest && near < 1.03 * nearest && far <= farthest && far > 0.97 * farthest, "{near} {far}");
    assert!(scene.notes.iter().any(|note| note.contains("its lens bends")), "{:?}", scene.notes);
}

#[dioptric_golden::needs_shared]
#[test]
fn part_of_a_frame_lies_where_it_was() {
    let Some(path) = input("crop.exr") else { return };
    let scene = read(&path, &ReadOptions::default());
    let view = scene.require_view().unwrap();
    // The camera file: 96 × 72, 120 px, its axis at 47.5, 35.5; the part of 32 × 24 starts at column 64.
    assert_eq!((scene.rows(), scene.columns()), (72, 96));
    assert_eq!((view.focal_px, view.center_x_px, view.center_y_px), (120.0, 47.5, 35.5));
    let own = super::read_planes_exr(&path).unwrap().of_own_file();
    for plane in scene.radiance.planes() {
        let is_lit = |row: usize, column: usize| plane[(row, column)] > 0.0;
        for ((row, column), value) in own.iter().find(|(name, _)| name == "G").unwrap().1.indexed_iter() {
            assert!(*value <= 0.0 || is_lit(row, column + 64), "row {row}, column {column}");
        }
        assert!(!(0..64).any(|column| (0..72).any(|row| is_lit(row, column))) && !(24..72).any(|row| is_lit(row, 80)));
    }
    // A field of view is that of the whole frame.
    let view = read(&path, &usual()).require_view().unwrap();
    assert_abs_diff_eq!(view.focal_px, 48.0 / 10.0_f64.to_radians().tan(), epsilon = 1e-9);
    assert_abs_diff_eq!(view.center_x_px, 47.5, epsilon = 1e-9);
}

#[dioptric_golden::needs_shared]
#[test]
fn primaries_of_a_header_count() {
    let Some(path) = input("acescg.exr") else { return };
    let scene = read(&path, &usual());
    assert!(scene.notes.iter().any(|note| note.contains("primaries")), "{:?}", scene.notes);
    // What is gray for the file's primaries is gray.
    let planes = super::read_planes_exr(&path).unwrap().of_own_file();
    let at = |name: &str, place: (usize, usize)| planes.iter().find(|(own, _)| own == name).unwrap().1[place];
    let (rows, columns) = (scene.rows(), scene.columns());
    let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let is_gray = |place: &(usize, usize)| {
        let [r, g, b] = ["R", "G", "B"].map(|name| at(name, *place));
        g > 0.05 && (r / g - 1.0).abs() < 1e-3 && (b / g - 1.0).abs() < 1e-3
    };
    for (row, column) in places.filter(is_gray) {
        let xyz = Observer::Cie1931.xyz(scene.radiance.grid(), &scene.radiance.spectrum_at(row, column));
        let rgb = xyz.to_linear_srgb();
        assert!(rgb.iter().all(|v| (v / rgb[1] - 1.0).abs() < 3e-3), "{rgb:?}");
    }
}

/// A picture of gray steps and a color.
fn picture(folder: &Path) -> PathBuf {
    let path = folder.join("steps.png");
    let codes = [[255_u8; 3], [188; 3], [90; 3], [200, 90, 60]];
    save(&ImageBuffer::from_fn(4, 1, |x, _| Rgb(codes[x as usize])).into(), &path).unwrap();
    path
}

#[test]
fn relit_picture_keeps_its_white_on_any_bands() {
    let folder = tempfile::tempdir().unwrap();
    let path = picture(folder.path());
    let steps = [1.0, 5.0, 10.0, 20.0].map(|step| WavelengthGrid::uniform(400.0, 700.0, step).unwrap());
    let uneven = WavelengthGrid::new(vec![405.0, 450.0, 500.0, 540.0, 590.0, 640.0, 690.0]).unwrap();
    let infrared = WavelengthGrid::uniform(400.0, 900.0, 25.0).unwrap();
    for grid in steps.into_iter().chain([uneven, infrared]) {
        for light in ["D65", "D50", "A", "5500K"] {
            let light = Illuminant::parse(light).unwrap();
            let options = ReadOptions {
                light: Some(light.clone()),
                illuminance_lux: Some(500.0),
                grid: Some(grid.clone()),
                ..usual()
            };
            let scene = read(&path, &options);
            let white = light.white_radiance(&grid, 500.0);
            for (column, share) in [(0, 1.0), (1, 0.502_886), (2, 0.102_242)] {
                for ((found, white), nm) in
                    scene.radiance.spectrum_at(0, column).iter().zip(&white).zip(grid.centers_nm())
                {
                    // Beyond what a display shows there is no light.
                    if *nm <= 740.0 {
                        assert_abs_diff_eq!(*found, share * white, epsilon = 2e-5 * white);
                    } else if *nm > 780.0 {
                        assert_eq!(*found, 0.0);
                    }
                }
            }
            assert_eq!(scene.light.unwrap().illuminant, light);
        }
    }
}

#[test]
fn what_does_not_apply_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = picture(folder.path());
    let reading = |reading: FileReading| ReadOptions { reading, ..usual() };
    let none = FileReading::default;
    for (options, word) in [
        (ReadOptions { white_level: Some(100.0), ..usual() }, "--white-level"),
        (reading(FileReading { scale: Some(2.0), ..none() }), "--scale"),
        (reading(FileReading { unit: Some("W/m^2/sr/nm".to_owned()), ..none() }), "--unit"),
        (reading(FileReading { quantity: Some(FileQuantity::Photons), ..none() }), "--quantity"),
        (reading(FileReading { wavelengths_nm: Some(vec![500.0]), ..none() }), "--scene-wavelengths-nm"),
        (reading(FileReading { variable: Some("x".to_owned()), ..none() }), "--variable"),
        (reading(FileReading { depth_unit: Some("mm".to_owned()), ..none() }), "--depth FILE"),
    ] {
        let message = read_scene(&path, &options).unwrap_err().to_string();
        assert!(message.contains("steps.png") && message.contains(word), "{message}");
    }
}

#[test]
fn unknown_keys_of_camera_files_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = picture(folder.path());
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..200 {
        let word: String = (0..rng.random_range(3..12)).map(|_| rng.random_range('a'..='z')).collect();
        let text = format!(
            r#"{{"width": 4, "height": 1, "fx_px": 5, "fy_px": 5, "cx_px": 1.5, "cy_px": 0, "{word}": {}}}"#,
            rng.random_range(0..9)
        );
        std::fs::write(folder.path().join("steps.camera.json"), text).unwrap();
        let options = ReadOptions { depth_m: Some(1.0), ..ReadOptions::default() };
        match read_scene(&path, &options) {
            Ok(scene) => assert!(scene.notes.iter().any(|note| note.contains(&word)), "{word}: {:?}", scene.notes),
            Err(error) => assert!(error.to_string().contains("steps.camera.json"), "{error}"),
        }
    }
}

#[test]
fn arrays_of_numpy_are_cubes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.npy");
    let values: Vec<u8> = (0..24).flat_map(|v| (v as f32 / 100.0).to_le_bytes()).collect();
    std::fs::write(&path, super::npy::tests::npy("<f4", false, "(2, 3, 4)", &values)).unwrap();
    let reading = FileReading {
        wavelengths_nm: Some(vec![450.0, 500.0, 550.0, 600.0]),
        quantity: Some(FileQuantity::Reflectance),
        ..FileReading::default()
    };
    let scene = read(&path, &ReadOptions { reading: reading.clone(), ..usual() });
    assert_eq!((scene.rows(), scene.columns(), scene.radiance.grid().len()), (2, 3, 4));
    let white = Illuminant::D65.white_radiance(scene.radiance.grid(), 1000.0);
    // Row 1, column 2, band 3 is the last of 24 numbers.
    assert_relative_eq!(scene.radiance.spectrum_at(1, 2)[3], 0.23 * white[3], max_relative = 1e-6);
    // Of light no number is a perfect white.
    let light = FileReading { quantity: Some(FileQuantity::Radiance), ..reading.clone() };
    let asked = ReadOptions { reading: light, white_level: Some(2.0), ..usual() };
    assert!(read_scene(&path, &asked).unwrap_err().to_string().contains("--white-level"));
    let unsaid = FileReading { quantity: None, ..reading };
    let message = read_scene(&path, &ReadOptions { reading: unsaid, ..usual() }).unwrap_err().to_string();
    assert!(message.contains("--quantity"), "{message}");
}

#[test]
fn samples_without_data_do_not_close_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.npy");
    let values: Vec<u8> = [0.5, f32::NAN, -1e-6, 0.25].iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(&path, super::npy::tests::npy("<f4", false, "(1, 4, 1)", &values)).unwrap();
    let with = |no_data: NoData| {
        let reading = FileReading {
            wavelengths_nm: Some(vec![550.0]),
            quantity: Some(FileQuantity::Radiance),
            no_data: Some(no_data),
            ..FileReading::default()
        };
        read_scene(&path, &ReadOptions { reading, ..usual() })
    };
    let row = |scene: &Scene| scene.radiance.planes()[0].row(0).to_vec();
    let black = with(NoData::Black).unwrap();
    assert_eq!(row(&black), [0.5, 0.0, 0.0, 0.25]);
    assert!(black.notes[1].contains("1 without data are black, 1 below 0 are 0"), "{:?}", black.notes);
    assert_eq!(row(&with(NoData::Fill).unwrap()), [0.5, 0.5, 0.0, 0.25]);
    assert!(with(NoData::Refuse).unwrap_err().to_string().contains("no number (NaN, or what the file says to ignore)"));
}

#[test]
fn pages_named_after_wavelengths_are_bands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.tif");
    let mut file = std::fs::File::create(&path).unwrap();
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
    for (i, nm) in [600, 450, 500].iter().enumerate() {
        let mut page = encoder.new_image::<tiff::encoder::colortype::Gray16>(3, 2).unwrap();
        page.encoder().write_tag(tiff::tags::Tag::Unknown(285), format!("band {nm} nm").as_str()).unwrap();
        page.write_data(&[10_000 * (i as u16 + 1); 6]).unwrap();
    }
    drop(file);
    let scene = read(&path, &usual());
    assert_eq!(scene.radiance.grid().centers_nm(), [450.0, 500.0, 600.0]);
    let white = Illuminant::D65.white_radiance(scene.radiance.grid(), 1000.0);
    for (found, (white, code)) in
        scene.radiance.spectrum_at(1, 2).iter().zip(white.iter().zip([20_000.0, 30_000.0, 10_000.0]))
    {
        assert_relative_eq!(*found, code / 65535.0 * white, max_relative = 1e-6);
    }
}

#[test]
fn fourth_samples_and_numbers_for_no_data_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rgbn.tif");
    let mut file = std::fs::File::create(&path).unwrap();
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
    let mut page = encoder.new_image::<tiff::encoder::colortype::RGBA8>(3, 2).unwrap();
    page.encoder().write_tag(tiff::tags::Tag::ExtraSamples, &[0_u16][..]).unwrap();
    page.encoder().write_tag(tiff::tags::Tag::GdalNodata, "255").unwrap();
    page.write_data(&[51, 102, 153, 204].repeat(6)).unwrap();
    drop(file);
    let notes = read(&path, &usual()).notes;
    let count = |word: &str| notes.iter().filter(|note| note.contains(word)).count();
    assert_eq!([count("'sample 4 (ExtraSamples 0)'"), count("opacity"), count("(GDAL) '255'")], [1, 0, 1], "{notes:?}");
}

#[test]
fn stretched_samples_keep_their_directions() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    save(
        &ImageBuffer::from_fn(40, 20, |x, y| Luma([if (x, y) == (30, 15) { 255_u8 } else { 0 }])).into(),
        &at("a.png"),
    )
    .unwrap();
    let camera = r#"{"width": 40, "height": 20, "fx_px": 50, "fy_px": 25, "cx_px": 19.5, "cy_px": 9.5}"#;
    std::fs::write(at("a.camera.json"), camera).unwrap();
    let scene = read(&at("a.png"), &ReadOptions { depth_m: Some(1.0), ..ReadOptions::default() });
    assert_eq!((scene.rows(), scene.columns()), (40, 40));
    let plane = &scene.radiance.planes()[15];
    let total: f32 = plane.sum();
    let row: f32 = plane.indexed_iter().map(|((row, _), v)| row as f32 * v).sum::<f32>() / total;
    let (x, y) = scene.require_view().unwrap().tan_at(row.into(), 30.0);
    assert_abs_diff_eq!(x, (30.0 - 19.5) / 50.0, epsilon = 1e-9);
    assert_abs_diff_eq!(y, -(15.0 - 9.5) / 25.0, epsilon = 1e-4);
}
