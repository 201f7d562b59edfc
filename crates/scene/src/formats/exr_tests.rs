//! Spectral EXR there and back, and files that must be refused.

use std::{fs, ops::Range, path::PathBuf};

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Text,
    WritableImage, f16,
};
use ndarray::{Array2, s};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::{HiddenLayer, ReadOptions, Scene, SceneError, SceneLight, View, read_scene};

const ROWS: usize = 5;
const COLUMNS: usize = 7;

fn noise(rng: &mut ChaCha8Rng) -> Array2<f32> {
    Array2::from_shape_simple_fn((ROWS, COLUMNS), || rng.random::<f32>() + 1e-3)
}

fn image(quantity: Quantity, centers_nm: Vec<f64>) -> SpectralImage {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let grid = WavelengthGrid::new(centers_nm).unwrap();
    let planes = (0..grid.len()).map(|_| noise(&mut rng)).collect();
    SpectralImage::new(quantity, grid, planes).unwrap()
}

fn scene() -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut scene = Scene::new("noise", image(Quantity::Radiance, vec![380.0, 550.0, 1000.0 / 1.5, 1000.0]));
    scene.depth = Some(DepthMap::new(noise(&mut rng)).unwrap());
    scene.view = Some(View { focal_px: 10.0 / 3.0, center_x_px: 3.25, center_y_px: 2.0 });
    scene
}

struct TestFile {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

fn file() -> TestFile {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.exr");
    TestFile { _folder: folder, path }
}

/// Writes channels as they are, right or wrong.
fn write_raw(path: &PathBuf, channels: Vec<(&str, FlatSamples)>, attributes: &[(&str, &str)]) {
    let list: SmallVec<[_; 4]> = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let mut layer = LayerAttributes::default();
    for (name, value) in attributes {
        layer.other.insert(Text::from(*name), AttributeValue::Text(Text::from(*value)));
    }
    let layer = Layer::new((2, 2), layer, Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
    Image::from_layer(layer).write().to_file(path).unwrap();
}

fn flat(value: f32) -> FlatSamples {
    FlatSamples::F32(vec![value; 4])
}

#[track_caller]
fn refused(channels: Vec<(&str, FlatSamples)>, attributes: &[(&str, &str)], words: &[&str]) {
    let file = file();
    write_raw(&file.path, channels, attributes);
    let message = read_spectral_exr(&file.path).unwrap_err().to_string();
    for word in words.iter().chain(&["test.exr"]) {
        assert!(message.contains(word), "'{word}' in: {message}");
    }
    assert!(!message.contains('\n'));
}

#[test]
fn a_scene_comes_back_to_the_bit() {
    for samples in [ExrSamples::Single, ExrSamples::Uncompressed] {
        let (file, mut scene) = (file(), scene());
        write_scene_exr(&file.path, &scene, samples).unwrap();
        let back = read_spectral_exr(&file.path).unwrap().of_own_file();
        assert_eq!(back.image, scene.radiance);
        assert_eq!((back.depth, back.view, back.hidden), (scene.depth.clone(), scene.view, None));

        let hidden = HiddenLayer { radiance: scene.radiance.clone(), depth: scene.depth.clone().unwrap() };
        scene.hidden = Some(hidden);
        write_scene_exr(&file.path, &scene, samples).unwrap();
        let back = read_spectral_exr(&file.path).unwrap().of_own_file();
        assert_eq!((back.image, back.hidden), (scene.radiance, scene.hidden));
    }
}

#[test]
fn the_light_on_a_scene_comes_back() {
    let (file, mut scene) = (file(), scene());
    scene.light = Some(SceneLight::new(dioptric_spectrum::Illuminant::A, 321.5));
    write_scene_exr(&file.path, &scene, ExrSamples::Single).unwrap();
    assert_eq!(read_scene(&file.path, &ReadOptions::default()).unwrap().light, scene.light);
    write_raw(&file.path, vec![("S0.500nm", flat(1.0))], &[("sceneLight", "{\"illuminant\": 3}")]);
    let message = read_scene(&file.path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(message.contains("sceneLight"), "{message}");
}

/// Names that no reader knows, put into a file at random, are named each time.
#[test]
fn unknown_channels_and_attributes_are_noted() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for _ in 0..40 {
        let word = |rng: &mut ChaCha8Rng| -> String {
            (0..rng.random_range(3..9)).map(|_| rng.random_range('a'..='z')).collect()
        };
        let (channel, attribute) = (word(&mut rng), word(&mut rng));
        let file = file();
        let mut channels = vec![("S0.500nm", flat(1.0)), ("Z", flat(1.0)), (channel.as_str(), flat(0.5))];
        channels.sort_by(|a, b| a.0.cmp(b.0));
        write_raw(&file.path, channels, &[(&attribute, "3")]);
        let notes = read_scene(&file.path, &ReadOptions::default()).unwrap().notes.join("\n");
        assert!(notes.contains(&format!("'{channel}'")) && notes.contains(&format!("'{attribute}'")), "{notes}");
    }
}

#[test]
fn attributes_of_ours_that_cannot_be_are_named() {
    let file = file();
    let bands = || vec![("S0.500nm", flat(1.0)), ("Z", flat(1.0))];
    for (name, value) in [("viewFocalPx", "thirty"), ("samplePitchUm", "none")] {
        write_raw(&file.path, bands(), &[(name, value)]);
        let notes = read_scene(&file.path, &ReadOptions::default()).unwrap().notes.join("\n");
        assert!(notes.contains(&format!("'{name}, which is no likely value'")), "{notes}");
    }
    let colors = || vec![("R", flat(1.0)), ("G", flat(1.0)), ("B", flat(1.0))];
    for (name, value) in [("Note", "depth in mm"), ("Exif:FocalLengthIn35mmFilm", "28")] {
        write_raw(&file.path, colors(), &[(name, value)]);
        let notes = read_scene(&file.path, &ReadOptions::default()).unwrap().notes.join("\n");
        assert!(notes.contains(name), "{notes}");
    }
    write_raw(&file.path, bands(), &[("samplePitchUm", "3")]);
    let notes = read_scene(&file.path, &ReadOptions::default()).unwrap().notes.join("\n");
    assert!(notes.contains("its attribute 'samplePitchUm' is not used"), "{notes}");
}

#[test]
fn parts_of_channels_of_one_name_are_asked_for_by_theirs() {
    let file = file();
    let part = |name: &str, light: f32| {
        let channels = ["Combined.R", "Combined.G", "Combined.B", "Depth.Z"];
        let list: SmallVec<[_; 4]> = channels.iter().map(|name| AnyChannel::new(*name, flat(light))).collect();
        let attributes = LayerAttributes { layer_name: Some(Text::from(name)), ..LayerAttributes::default() };
        Layer::new((2, 2), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(list))
    };
    let layers = SmallVec::<[_; 2]>::from_vec(vec![part("ViewLayer", 1.0), part("ViewLayer2", 3.0)]);
    let attributes = exr::prelude::ImageAttributes::with_size((2, 2));
    Image::from_layers(attributes, layers).write().to_file(&file.path).unwrap();
    let read = |variable: Option<&str>| {
        let reading = FileReading { variable: variable.map(str::to_owned), ..FileReading::default() };
        read_scene(&file.path, &ReadOptions { reading, ..ReadOptions::default() })
    };
    assert!(read(None).unwrap_err().to_string().contains("'ViewLayer.Combined', 'ViewLayer2.Combined'"));
    for (name, depth_m) in [("ViewLayer.Combined", 1.0), ("ViewLayer2.Combined", 3.0)] {
        assert_eq!(read(Some(name)).unwrap().require_depth().unwrap().range_m(), (depth_m, depth_m));
    }
}

#[test]
fn parts_of_bands_are_one_picture() {
    let file = file();
    let part = |name: &str, channels: Vec<(&str, FlatSamples)>| {
        let list: SmallVec<[_; 4]> =
            channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
        let attributes = LayerAttributes { layer_name: Some(Text::from(name)), ..LayerAttributes::default() };
        Layer::new((2, 2), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(list))
    };
    let write = |layers: Vec<_>| {
        let attributes = exr::prelude::ImageAttributes::with_size((2, 2));
        Image::from_layers(attributes, SmallVec::<[_; 2]>::from_vec(layers)).write().to_file(&file.path).unwrap();
        read_scene(&file.path, &ReadOptions::default()).unwrap()
    };
    // A band a part, by the name of its channel or of the part; the depth in a part of its own.
    let scene = write(vec![
        part("image", vec![("S0.500nm", flat(1.0))]),
        part("S0.600nm", vec![("Y", flat(2.0))]),
        part("depth", vec![("Z", flat(3.0))]),
        part("left", vec![("S0.500nm", flat(9.0))]),
    ]);
    assert_eq!(
        (scene.radiance.grid().centers_nm(), scene.radiance.spectrum_at(0, 0)),
        (&[500.0, 600.0][..], vec![1.0, 2.0])
    );
    assert_eq!(scene.require_depth().unwrap().range_m(), (3.0, 3.0));
    assert!(scene.notes.iter().any(|note| note.contains("its part 'left' is not used")), "{:?}", scene.notes);
    let colors = || vec![("R", flat(1.0)), ("G", flat(1.0)), ("B", flat(1.0)), ("A", flat(1.0))];
    let scene = write(vec![part("rgba", colors()), part("depth", vec![("Z", flat(3.0))]), part("albedo", colors())]);
    assert_eq!(scene.require_depth().unwrap().range_m(), (3.0, 3.0));
    assert!(scene.notes[1].contains("'albedo.A', 'albedo.B'"), "{:?}", scene.notes);
}

#[test]
fn the_same_scene_makes_the_same_bytes() {
    let mut scene = scene();
    scene.hidden =
        Some(HiddenLayer { radiance: scene.radiance.clone(), depth: scene.depth.clone().expect("the scene has one") });
    let bytes = || {
        let file = file();
        write_scene_exr(&file.path, &scene, ExrSamples::Single).unwrap();
        std::fs::read(&file.path).unwrap()
    };
    let first = bytes();
    // The library would put the attributes in another order nearly every time.
    assert!((0..8).all(|_| bytes() == first));
}

#[test]
fn irradiance_keeps_its_pitch_and_reflectance_its_kind() {
    let file = file();
    let irradiance = image(Quantity::Irradiance, vec![500.0]).with_pitch_um(1.4);
    write_spectral_exr(&file.path, &irradiance, &ExrParts::default()).unwrap();
    assert_eq!(read_spectral_exr(&file.path).unwrap().of_own_file().image, irradiance);
    let reflectance = image(Quantity::Reflectance, vec![400.0, 700.0]);
    write_spectral_exr(&file.path, &reflectance, &ExrParts::default()).unwrap();
    assert_eq!(read_spectral_exr(&file.path).unwrap().of_own_file().image, reflectance);
}

/// Returns what is known of an image before its samples.
fn head(image: &SpectralImage, samples: ExrSamples) -> SpectralHead<'_> {
    let largest = image.planes().iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
    let size = (image.rows(), image.columns());
    SpectralHead {
        quantity: image.quantity(),
        grid: image.grid(),
        size,
        pitch_um: image.pitch_um(),
        depth: None,
        view: None,
        light: None,
        texts: &[],
        largest,
        samples,
        at_once_bytes: 1 << 20,
    }
}

fn rows_of(image: &SpectralImage) -> impl FnMut(usize, Range<usize>) -> Result<Vec<f32>, String> {
    |band, rows| Ok(image.planes()[band].slice(s![rows, ..]).iter().copied().collect())
}

/// An irradiance of more rows than a block has.
fn tall() -> SpectralImage {
    let grid = WavelengthGrid::new(vec![400.0, 500.0, 1000.0]).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut plane = || Array2::from_shape_simple_fn((75, 11), || 1e-3 * rng.random::<f32>());
    let planes = (0..grid.len()).map(|_| plane()).collect();
    SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap().with_pitch_um(1.4)
}

#[test]
fn rows_make_the_file_that_layers_make() {
    let (file, tall) = (file(), tall());
    let depth =
        DepthMap::new(Array2::from_shape_fn((75, 11), |(row, column)| 1.0 + (row * 11 + column) as f32)).unwrap();
    let view = Some(View { focal_px: 40.0, center_x_px: 5.5, center_y_px: 30.0 });
    let hidden = HiddenLayer { radiance: tall.clone(), depth: depth.clone() };
    for samples in ExrSamples::NAMES.map(|(_, samples)| samples) {
        let whole = |at_once_bytes| SpectralHead { depth: Some(&depth), view, at_once_bytes, ..head(&tall, samples) };
        whole(1 << 20).write_exr(&file.path, &mut rows_of(&tall)).unwrap();
        let (in_rows, bytes) = (read_spectral_exr(&file.path).unwrap().of_own_file(), fs::read(&file.path).unwrap());
        assert_eq!((in_rows.depth.as_ref(), in_rows.view), (Some(&depth), view));
        assert_eq!(in_rows.image == tall, samples != ExrSamples::Half);
        whole(1).write_exr(&file.path, &mut rows_of(&tall)).unwrap();
        assert_eq!(fs::read(&file.path).unwrap(), bytes);
        let parts = ExrParts { samples, depth: Some(&depth), view, ..ExrParts::default() };
        write_spectral_exr(&file.path, &tall, &parts).unwrap();
        assert_eq!(fs::read(&file.path).unwrap(), bytes);
        write_spectral_exr(&file.path, &tall, &ExrParts { hidden: Some(&hidden), ..parts }).unwrap();
        let layered = read_spectral_exr(&file.path).unwrap().of_own_file();
        assert_eq!((layered.image, layered.depth, layered.view), (in_rows.image, in_rows.depth, in_rows.view));
    }
}

#[test]
fn half_floats_are_as_near_as_is_stated() {
    let file = file();
    // Light from a candle's to the sun's.
    for scale in [1e-7, 1e-3, 1.0, 3e6] {
        let mut bright = tall();
        bright.planes_mut().for_each(|mut plane| plane *= scale);
        head(&bright, ExrSamples::Half).write_exr(&file.path, &mut rows_of(&bright)).unwrap();
        let back = read_spectral_exr(&file.path).unwrap().of_own_file().image;
        assert_eq!((back.pitch_um(), back.quantity()), (Some(1.4), Quantity::Irradiance));
        let largest = 1e-3 * scale;
        for (found, sample) in back.planes().iter().flatten().zip(bright.planes().iter().flatten()) {
            let bound = (0.0005 * sample).max(5e-10 * largest);
            assert!((found - sample).abs() <= bound, "{sample} became {found}");
        }
    }
}

#[test]
fn rows_that_cannot_be_had_leave_nothing() {
    let (file, tall) = (file(), tall());
    let mut fails = |band: usize, rows: Range<usize>| match (band, rows.start) {
        (1, 32) => Err("the disk is gone".to_owned()),
        _ => Ok(vec![0.0; rows.len() * 11]),
    };
    let message = head(&tall, ExrSamples::Single).write_exr(&file.path, &mut fails).unwrap_err().to_string();
    assert!(message.contains("the disk is gone") && message.contains("test.exr"), "{message}");
    let mut short = |_: usize, _: Range<usize>| Ok(vec![0.0; 3]);
    assert!(head(&tall, ExrSamples::Single).write_exr(&file.path, &mut short).is_err());
    let empty = SpectralHead { size: (0, 3), ..head(&tall, ExrSamples::Half) };
    assert!(empty.write_exr(&file.path, &mut short).is_err());
    assert_eq!(fs::read_dir(file.path.parent().unwrap()).unwrap().count(), 0);
}

#[test]
fn planes_of_volts_come_back() {
    let (file, scene) = (file(), scene());
    let volts = &scene.radiance.planes()[0];
    write_planes_exr(&file.path, &[("V", volts), ("Z", scene.depth.as_ref().unwrap().z_m())], ExrSamples::Uncompressed)
        .unwrap();
    let planes = read_planes_exr(&file.path).unwrap().of_own_file();
    assert_eq!(planes.iter().find(|(name, _)| name == "V").map(|(_, plane)| plane), Some(volts));
    assert!(write_planes_exr(&file.path, &[], ExrSamples::Single).is_err());
    assert!(read_spectral_exr(&file.path).unwrap_err().to_string().contains("no spectral band"));
}

#[test]
fn half_floats_other_units_and_rgb_are_read() {
    let file = file();
    let half = FlatSamples::F16(vec![f16::from_f32(0.5); 4]);
    let channels = vec![("R", flat(9.0)), ("S0.0,55um", flat(2.0)), ("S0.1000nm", flat(3.0)), ("S0.400.0nm", half)];
    write_raw(&file.path, channels, &[("emissiveUnits", "W.m^-2.sr^-1")]);
    let back = read_spectral_exr(&file.path).unwrap().of_own_file();
    assert_eq!(back.image.grid().centers_nm()[1].round(), 550.0);
    assert_eq!(back.image.spectrum_at(1, 1), [0.5, 2.0, 3.0]);
    assert_eq!(back.image.quantity(), Quantity::Radiance);
}

#[test]
fn bands_of_other_renderers_are_read() {
    let file = file();
    // pbrt's spectral film; Mitsuba 0.6, whose bins are of 75 nm; a wavelength alone.
    for names in [["S0.450,000000nm", "S0.525,000000nm"], ["412.50-487.50nm", "487.50-562.50nm"], ["450nm", "525.0nm"]]
    {
        write_raw(&file.path, vec![("R", flat(9.0)), (names[0], flat(2.0)), (names[1], flat(3.0))], &[]);
        let back = read_spectral_exr(&file.path).unwrap().of_own_file();
        assert_eq!(
            (back.image.grid().centers_nm(), back.image.spectrum_at(1, 1)),
            (&[450.0, 525.0][..], vec![2.0, 3.0])
        );
        assert_eq!(back.image.quantity(), Quantity::Radiance);
    }
}

#[test]
fn radiance_in_photons_becomes_watts() {
    let file = file();
    let unit = [("emissiveUnits", "photon.s^-1.m^-2.sr^-1")];
    write_raw(&file.path, vec![("S0.500nm", flat(1e15)), ("S0.600nm", flat(1e15))], &unit);
    let back = read_spectral_exr(&file.path).unwrap().of_own_file().image;
    // h c / λ with h c = 1.98644586e-25 J m.
    for (watts, nm) in back.spectrum_at(0, 1).iter().zip([500.0, 600.0]) {
        approx::assert_relative_eq!(*watts, 1.986_445_86e-1 / nm, max_relative = 1e-6);
    }
}

fn at_depth(channels: Vec<(&str, FlatSamples)>, fill_depth: Option<FillDepth>) -> Result<Scene, SceneError> {
    let file = file();
    write_raw(&file.path, channels, &[("viewHorizontalFovDeg", "30")]);
    read_scene(&file.path, &ReadOptions { fill_depth, ..ReadOptions::default() })
}

#[test]
fn colors_with_depth_are_a_scene() {
    let color = |letter: &str| flat(if letter == "R" { 2.0 } else { 0.5 });
    for (prefix, depth) in [("", "Z"), ("ViewLayer.Combined.", "ViewLayer.Depth.Z")] {
        let names = ["R", "G", "B"].map(|letter| format!("{prefix}{letter}"));
        let mut channels: Vec<_> = names.iter().map(|name| (name.as_str(), color(&name[name.len() - 1..]))).collect();
        channels.push((depth, flat(3.0)));
        let scene = at_depth(channels, None).unwrap();
        assert_eq!(scene.require_depth().unwrap().range_m(), (3.0, 3.0));
        let grid = scene.radiance.grid();
        let xyz = dioptric_spectrum::Observer::Cie1931.xyz(grid, &scene.radiance.spectrum_at(0, 0));
        // White under 1000 lx.
        let rgb = dioptric_spectrum::Xyz(xyz.0.map(|v| v / (1000.0 / std::f64::consts::PI))).to_linear_srgb();
        // Brighter than white stays so; the sRGB matrices are each other's inverse to 1e-6.
        rgb.iter().zip([2.0, 0.5, 0.5]).for_each(|(v, e)| approx::assert_abs_diff_eq!(*v, e, epsilon = 2e-5));
        assert!(scene.light.is_some());
    }
    assert!(at_depth(vec![("R", flat(1.0)), ("Z", flat(1.0))], None).unwrap_err().to_string().contains("no spectral"));
}

#[test]
fn unmeasured_depth_is_filled_when_asked() {
    let channels = || vec![("S0.500nm", flat(1.0)), ("Z", FlatSamples::F32(vec![0.0, 2.0, f32::NAN, 4.0]))];
    let message = at_depth(channels(), None).unwrap_err().to_string();
    assert!(message.contains("row 0, column 0") && message.contains("2 of 4 samples"), "{message}");
    for (fill, first_m) in [(FillDepth::Beside, 2.0), (FillDepth::Far, 4.0), (FillDepth::Metres(7.5), 7.5)] {
        let scene = at_depth(channels(), Some(fill)).unwrap();
        assert_eq!(scene.require_depth().unwrap().z_m()[(0, 0)], first_m);
        assert!(scene.notes[1].starts_with("2 of 4 samples (50.00 %) have no depth"), "{:?}", scene.notes);
    }
    assert!(at_depth(channels(), Some(FillDepth::Metres(-1.0))).is_err());
    let negative = vec![("S0.500nm", flat(1.0)), ("Z", FlatSamples::F32(vec![-2.0, 2.0, 2.0, 4.0]))];
    assert_eq!(at_depth(negative, Some(FillDepth::Far)).unwrap().require_depth().unwrap().z_m()[(0, 0)], 4.0);
    let turned = vec![("S0.500nm", flat(1.0)), ("Z", FlatSamples::F32(vec![-2.0, -2.0, 2.0, -4.0]))];
    for fill in [None, Some(FillDepth::Far)] {
        assert!(at_depth(turned.clone(), fill).unwrap_err().to_string().contains("other sign"));
    }
}

#[test]
fn a_hidden_layer_in_front_is_refused_by_its_place() {
    let (file, mut scene) = (file(), scene());
    let mut z_m = scene.depth.as_ref().unwrap().z_m().clone();
    z_m[(3, 2)] *= 0.5;
    scene.hidden = Some(HiddenLayer { radiance: scene.radiance.clone(), depth: DepthMap::new(z_m).unwrap() });
    write_scene_exr(&file.path, &scene, ExrSamples::Uncompressed).unwrap();
    let message = read_scene(&file.path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(message.contains("test.exr") && message.contains("row 3, column 2"), "{message}");
}

#[test]
fn distance_becomes_depth_with_a_view() {
    let file = file();
    write_raw(&file.path, vec![("S0.500nm", flat(1.0)), ("distance", flat(2.0))], &[]);
    let back = read_spectral_exr(&file.path).unwrap().of_own_file();
    assert_eq!(back.depth_with(None), Ok(None));
    let view = View { focal_px: 1.0, center_x_px: 0.0, center_y_px: 0.0 };
    let depth = back.depth_with(Some(view)).unwrap().unwrap();
    assert_eq!((depth.z_m()[(0, 0)], depth.z_m()[(0, 1)]), (2.0, (2.0 / 2.0_f64.sqrt()) as f32));
}

#[test]
fn wrong_contents_are_refused_in_one_sentence() {
    let s0 = "S0.500nm";
    refused(vec![("R", flat(1.0)), ("G", flat(1.0))], &[], &["no spectral band"]);
    refused(vec![(s0, flat(f32::NAN))], &[], &["500 nm", "row 0, column 0", "NaN"]);
    refused(vec![(s0, FlatSamples::F32(vec![1.0, 1.0, 1.0, -2.0]))], &[], &["row 1, column 1", "-2"]);
    refused(vec![(s0, flat(1.0)), ("Z", flat(0.0))], &[], &["depth", "row 0"]);
    refused(vec![(s0, flat(1.0)), ("distance", flat(-1.0))], &[], &["depth"]);
    refused(vec![(s0, flat(1.0)), ("T.600nm", flat(1.0))], &[], &["one quantity", s0, "T.600nm"]);
    refused(vec![(s0, flat(1.0)), ("S0.500,0nm", flat(1.0))], &[], &["same wavelength", s0]);
    refused(vec![(s0, flat(1.0))], &[("emissiveUnits", "lm")], &["emissiveUnits", "'lm'"]);
    refused(vec![(s0, flat(1.0))], &[("viewFocalPx", "-3")], &["focal"]);
    refused(vec![(s0, flat(1.0))], &[("viewHorizontalFovDeg", "200")], &["200°"]);
}

#[test]
fn a_truncated_or_absent_or_foreign_file_is_refused() {
    let (file, scene) = (file(), scene());
    write_scene_exr(&file.path, &scene, ExrSamples::Single).unwrap();
    let whole = fs::read(&file.path).unwrap();
    fs::write(&file.path, &whole[..whole.len() - 20]).unwrap();
    let message = read_spectral_exr(&file.path).unwrap_err().to_string();
    assert!(message.contains("test.exr") && message.contains("truncated"), "{message}");
    fs::write(&file.path, b"not a picture").unwrap();
    assert!(matches!(read_spectral_exr(&file.path), Err(SceneError::Unreadable { .. })));
    fs::remove_file(&file.path).unwrap();
    assert!(matches!(read_spectral_exr(&file.path), Err(SceneError::Unreadable { .. })));
    // Folders are made, but not below a file.
    fs::write(&file.path, b"").unwrap();
    let nowhere = file.path.join("no/folder.exr");
    assert!(matches!(write_scene_exr(&nowhere, &scene, ExrSamples::Uncompressed), Err(SceneError::Unwritable { .. })));
}

#[test]
fn a_header_that_asks_for_terabytes_is_refused_before_it_is_believed() {
    let (file, scene) = (file(), scene());
    write_scene_exr(&file.path, &scene, ExrSamples::Uncompressed).unwrap();
    let mut bytes = fs::read(&file.path).unwrap();
    let key = b"dataWindow\0box2i\0";
    let at = bytes.windows(key.len()).position(|window| window == key).unwrap() + key.len() + 4;
    bytes[at + 8..at + 12].copy_from_slice(&1_000_000_i32.to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&1_000_000_i32.to_le_bytes());
    fs::write(&file.path, &bytes).unwrap();
    let message = read_spectral_exr(&file.path).unwrap_err().to_string();
    assert!(message.contains("of memory and may take"), "{message}");
}

#[test]
fn no_mutation_of_a_file_makes_the_reader_panic() {
    let (file, scene) = (file(), scene());
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut n_refused = 0;
    for samples in [ExrSamples::Single, ExrSamples::Uncompressed] {
        write_scene_exr(&file.path, &scene, samples).unwrap();
        let whole = fs::read(&file.path).unwrap();
        for _ in 0..1500 {
            let mut bytes = whole.clone();
            if rng.random::<f32>() < 0.2 {
                bytes.truncate(rng.random_range(0..whole.len()));
            } else {
                for _ in 0..rng.random_range(1..4) {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] ^= rng.random_range(1..=255_u8);
                }
            }
            fs::write(&file.path, &bytes).unwrap();
            n_refused += usize::from(read_spectral_exr(&file.path).is_err());
        }
    }
    // A flipped byte of a plain sample is no error; most others are.
    assert!(n_refused > 800, "{n_refused} of 3000 refused");
}

#[dioptric_golden::needs_shared]
#[test]
fn the_real_files_are_read() {
    let Some(folder) = dioptric_golden::shared("data/scenes") else { return };
    for (name, quantity, size, bands, has_depth) in [
        ("piano3d.radiance_depth", Quantity::Radiance, (200, 200), 31, true),
        ("motorcycle_370.radiance_depth", Quantity::Radiance, (250, 370), 16, true),
        ("cave_chart_crop.radiance", Quantity::Radiance, (256, 300), 31, false),
        ("cave_chart_and_stuffed_toy.reflectance", Quantity::Reflectance, (512, 512), 31, false),
        ("spectral_exr_reference_Macbeth", Quantity::Reflectance, (400, 600), 36, false),
        ("spectral_exr_reference_D65", Quantity::Radiance, (1, 1), 90, false),
    ] {
        let back = read_spectral_exr(&folder.join(format!("{name}.exr"))).unwrap().of_own_file();
        assert_eq!(back.image.quantity(), quantity, "{name}");
        assert_eq!((back.image.rows(), back.image.columns()), size, "{name}");
        assert_eq!(back.image.grid().len(), bands, "{name}");
        assert_eq!(back.depth.is_some(), has_depth, "{name}");
    }
}

/// Parts of one channel each, of this name and value.
fn write_parts(path: &PathBuf, parts: &[(&str, &str, f32)]) {
    let layers: exr::image::Layers<_> = parts
        .iter()
        .map(|(part, channel, value)| {
            let list: SmallVec<[_; 4]> = SmallVec::from_iter([AnyChannel::new(*channel, flat(*value))]);
            Layer::new((2, 2), LayerAttributes::named(*part), Encoding::FAST_LOSSLESS, AnyChannels::sort(list))
        })
        .collect();
    let window = exr::meta::attribute::IntegerBounds::from_dimensions((2, 2));
    Image::from_layers(exr::meta::header::ImageAttributes::new(window), layers).write().to_file(path).unwrap();
}

#[test]
fn a_part_that_is_called_like_a_band_is_that_band() {
    for channel in ["R", "Y", "value"] {
        let file = file();
        write_parts(&file.path, &[("450nm", channel, 1.0), ("500nm", channel, 2.0), ("T.nothing", channel, 9.0)]);
        let mut notes = vec![];
        let image = read_spectral_exr(&file.path).unwrap().told_in(&mut notes).image;
        assert_eq!(image.grid().centers_nm(), [450.0, 500.0]);
        assert_eq!([0, 1].map(|band| image.planes()[band][(1, 1)]), [1.0, 2.0]);
        assert!(matches!(&notes[..], [note] if note.contains("T.nothing")), "{notes:?}");
    }
    // A band that is stated is not renamed.
    let file = file();
    write_parts(&file.path, &[("450nm", "S0.460nm", 1.0), ("500nm", "Y", 2.0)]);
    assert_eq!(read_spectral_exr(&file.path).unwrap().of_own_file().image.grid().centers_nm(), [460.0, 500.0]);
}

#[test]
fn layers_of_bands_are_asked_for_by_name() {
    let layers = vec![
        ("a.S0.450nm", flat(1.0)),
        ("a.S0.550nm", flat(1.0)),
        ("b.S0.450nm", flat(2.0)),
        ("b.S0.550nm", flat(2.0)),
        ("b.Z", flat(3.0)),
    ];
    let file = file();
    write_raw(&file.path, layers, &[]);
    let read = |variable: Option<&str>| {
        let reading = FileReading { variable: variable.map(str::to_owned), ..FileReading::default() };
        read_scene(&file.path, &ReadOptions { reading, ..ReadOptions::default() })
    };
    let message = read(None).unwrap_err().to_string();
    assert!(message.contains("several layers of bands, 'a', 'b': expected --variable"), "{message}");
    let first = read(Some("a")).unwrap();
    assert_eq!(first.radiance.planes()[0][(0, 0)], 1.0);
    assert!(first.notes.iter().any(|note| note.contains("part 'b'")), "{:?}", first.notes);
    let second = read(Some("b")).unwrap();
    assert_eq!((second.radiance.planes()[1][(1, 1)], second.depth.unwrap().range_m()), (2.0, (3.0, 3.0)));
    let message = read(Some("c")).unwrap_err().to_string();
    assert!(message.contains("'a', 'b'") && message.contains("--variable") && !message.ends_with("but"), "{message}");
}

/// Bands of light or of reflectances and a depth.
type Bands<'a> = (&'a str, &'a [(&'a str, &'a str)], f32, f32);

/// Reads a file of two parts, each of bands of this kind (`S0`, `T`) with attributes, samples and a depth.
fn read_with_hidden(front: Bands<'_>, behind: Bands<'_>, reading: FileReading) -> Scene {
    let part = |name: &str, (kind, attributes, value, z_m): Bands<'_>| {
        let mut list: SmallVec<[_; 4]> = SmallVec::new();
        for nm in [450, 550, 650] {
            list.push(AnyChannel::new(format!("{kind}.{nm}nm").as_str(), flat(value)));
        }
        list.push(AnyChannel::new("Z", flat(z_m)));
        let mut layer = LayerAttributes::named(name);
        for (name, value) in attributes {
            layer.other.insert(Text::from(*name), AttributeValue::Text(Text::from(*value)));
        }
        Layer::new((2, 2), layer, Encoding::FAST_LOSSLESS, AnyChannels::sort(list))
    };
    let file = file();
    let layers: exr::image::Layers<_> = [part("visible", front), part("hidden", behind)].into_iter().collect();
    let window = exr::meta::attribute::IntegerBounds::from_dimensions((2, 2));
    Image::from_layers(exr::meta::header::ImageAttributes::new(window), layers).write().to_file(&file.path).unwrap();
    let options = ReadOptions { horizontal_fov_deg: Some(20.0), reading, ..ReadOptions::default() };
    read_scene(&file.path, &options).unwrap()
}

#[track_caller]
fn check_layers(scene: &Scene, expected: [f32; 4], words: &[&str]) {
    let hidden = scene.hidden.as_ref().unwrap();
    let depths = [scene.depth.as_ref().unwrap(), &hidden.depth].map(|depth| depth.range_m().0 as f32);
    let found = [scene.radiance.planes()[1][(1, 1)], hidden.radiance.planes()[1][(1, 1)], depths[0], depths[1]];
    assert_eq!(found, expected);
    for word in words {
        assert_eq!(scene.notes.iter().filter(|note| note.contains(word)).count(), 1, "{word}: {:?}", scene.notes);
    }
}

#[test]
fn what_is_said_of_a_file_is_said_of_its_hidden_part() {
    let per_nm = [("emissiveUnits", "W.m^-2.sr^-1.nm^-1")];
    let per_um = [("emissiveUnits", "W.m^-2.sr^-1.um^-1")];
    let plain = FileReading::default;
    let told = "behind the first surface";
    let both = FileReading { scale: Some(2.0), depth_unit: Some("mm".to_owned()), ..plain() };
    let scene = read_with_hidden(("S0", &per_nm, 1.0, 1000.0), ("S0", &per_nm, 4.0, 5000.0), both);
    check_layers(&scene, [2.0, 8.0, 1.0, 5.0], &["(--scale) counts for it too", told]);
    // A part that states no unit has that of the first, and one that does its own.
    let scene = read_with_hidden(("S0", &per_um, 1000.0, 1.0), ("S0", &[], 4000.0, 5.0), plain());
    check_layers(&scene, [1.0, 4.0, 1.0, 5.0], &["behind the first surface, radiance"]);
    let scene = read_with_hidden(("S0", &per_um, 1000.0, 1.0), ("S0", &per_nm, 4.0, 5.0), plain());
    check_layers(&scene, [1.0, 4.0, 1.0, 5.0], &[told]);
    // What is told of a first surface without a unit does not count for what states its own.
    let unit = FileReading { unit: Some("W/m^2/sr/um".to_owned()), ..plain() };
    let scene = read_with_hidden(("S0", &[], 1000.0, 1.0), ("S0", &per_nm, 4.0, 5.0), unit.clone());
    check_layers(&scene, [1.0, 4.0, 1.0, 5.0], &["(--unit) does not count for it"]);
    let scene = read_with_hidden(("S0", &[], 1000.0, 1.0), ("S0", &[], 4000.0, 5.0), unit);
    check_layers(&scene, [1.0, 4.0, 1.0, 5.0], &["(--unit) counts for it too"]);
    // Reflectances behind light are under a light that is named.
    let scene = read_with_hidden(("S0", &per_nm, 1.0, 1.0), ("T", &[], 0.5, 5.0), plain());
    let words = "behind the first surface, reflectance, under a light of x, y 0.313, 0.329 and 1000 lx";
    assert_eq!(scene.notes.iter().filter(|note| note.contains(words)).count(), 1, "{:?}", scene.notes);
}

#[test]
fn channels_of_a_layer_hidden_are_what_lies_behind() {
    let bands = [("S0.450nm", flat(1.0)), ("S0.550nm", flat(1.0)), ("Z", flat(1.0))];
    let behind = [("hidden.S0.450nm", flat(4.0)), ("hidden.S0.550nm", flat(4.0)), ("hidden.Z", flat(5.0))];
    let read = |channels: Vec<(&str, FlatSamples)>| {
        let file = file();
        write_raw(&file.path, channels, &[("emissiveUnits", "W.m^-2.sr^-1.nm^-1")]);
        read_scene(&file.path, &ReadOptions { horizontal_fov_deg: Some(20.0), ..ReadOptions::default() }).unwrap()
    };
    let scene = read(bands.iter().chain(&behind).cloned().collect());
    check_layers(&scene, [1.0, 4.0, 1.0, 5.0], &["behind the first surface"]);
    let colors = [("hidden.R", flat(1.0)), ("hidden.Z", flat(5.0))];
    let scene = read(bands.iter().chain(&colors).cloned().collect());
    assert!(scene.hidden.is_none() && scene.notes.iter().any(|note| note.contains("--hidden")), "{:?}", scene.notes);
    // Colors behind colors, and behind bands.
    let gray = |start: &str, value: f32| ["R", "G", "B"].map(|letter| (format!("{start}{letter}"), flat(value)));
    let colors = [gray("", 0.2).to_vec(), gray("hidden.", 0.8).to_vec()].concat();
    let named = |colors: &[(String, FlatSamples)]| {
        let depths = [("Z", flat(1.0)), ("hidden.Z", flat(5.0))];
        let colors: Vec<_> = colors.iter().map(|(name, plane)| (name.as_str(), plane.clone())).collect();
        read(colors.into_iter().chain(depths).collect::<Vec<_>>())
    };
    let scene = named(&colors);
    let white = named(&[gray("", 1.0).to_vec(), gray("hidden.", 0.0).to_vec()].concat()).radiance.planes()[1][(1, 1)];
    check_layers(&scene, [0.2 * white, 0.8 * white, 1.0, 5.0], &["behind the first surface, linear colors"]);
    assert_eq!(scene.notes.len(), 2, "{:?}", scene.notes);
    let scene = read(
        bands
            .iter()
            .cloned()
            .chain(colors[3..].iter().map(|(name, plane)| (name.as_str(), plane.clone())))
            .chain([("hidden.Z", flat(5.0))])
            .collect(),
    );
    assert_eq!(scene.hidden.unwrap().depth.range_m(), (5.0, 5.0));
}

#[test]
fn a_unit_without_a_wavelength_is_named() {
    let notes = |attributes: &[(&str, &str)]| {
        let file = file();
        write_raw(&file.path, vec![("S0.450nm", flat(1.0)), ("S0.550nm", flat(1.0))], attributes);
        let mut notes = vec![];
        let _ = read_spectral_exr(&file.path).unwrap().told_in(&mut notes);
        notes
    };
    let bare = ("emissiveUnits", "W.m^-2.sr^-1");
    assert!(matches!(&notes(&[bare])[..], [note] if note.contains("'W.m^-2.sr^-1'") && note.contains("nanometre")));
    // The layout understands a nanometre, of which the line of what was understood has a word.
    let in_layout = [bare, ("spectralLayoutVersion", "1.0")];
    assert!(notes(&in_layout).is_empty());
    let file = file();
    write_raw(&file.path, vec![("S0.450nm", flat(1.0)), ("S0.550nm", flat(1.0))], &in_layout);
    let scene = read_scene(&file.path, &ReadOptions::default()).unwrap();
    assert!(scene.notes[0].contains("radiance in W.m^-2.sr^-1, a nanometre"), "{:?}", scene.notes);
    assert!(notes(&[("emissiveUnits", "W.m^-2.sr^-1.nm^-1")]).is_empty());
    assert!(notes(&[("emissiveUnits", "W.m^-3.sr^-1")]).is_empty());
}
