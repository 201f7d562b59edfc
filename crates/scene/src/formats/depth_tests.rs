//! Depths in every place: beside pictures, in archives, in layers and windows of EXR files, with words that say what they are.

use std::path::{Path, PathBuf};

use exr::{
    image::Layers,
    math::Vec2,
    meta::attribute::IntegerBounds,
    prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, WritableImage},
};
use ndarray::Array2;

use super::{ReadOptions, kinds_tests::zip_of, npy::tests::npy, read_scene};
use crate::{FileReading, Scene, SceneError};

const ROWS: usize = 4;
const COLUMNS: usize = 6;

/// Depths that tell their place.
fn depths() -> Array2<f32> {
    Array2::from_shape_fn((ROWS, COLUMNS), |(row, column)| 1.0 + row as f32 + 0.1 * column as f32)
}

fn picture(folder: &Path) -> PathBuf {
    let path = folder.join("room.png");
    let pixels = image::RgbImage::from_pixel(COLUMNS as u32, ROWS as u32, image::Rgb([99; 3]));
    dioptric_pictures::save(&pixels.into(), &path).unwrap();
    path
}

fn options(depth: Option<PathBuf>, variable: Option<&str>) -> ReadOptions {
    let reading = FileReading { depth, depth_variable: variable.map(str::to_owned), ..FileReading::default() };
    ReadOptions { horizontal_fov_deg: Some(20.0), reading, ..ReadOptions::default() }
}

/// A layer of an EXR file: its name, its view, the first column and row of its window, and its channels.
type Part<'a> = (&'a str, Option<&'a str>, (i32, i32), Vec<(&'a str, Array2<f32>)>);

/// Writes layers of a picture whose display window begins at 0.
fn write_exr(path: &Path, (columns, rows): (usize, usize), parts: Vec<Part<'_>>) {
    let layers = parts.into_iter().map(|(name, view, position, planes)| {
        let (own_rows, own_columns) = planes[0].1.dim();
        let channels = planes
            .into_iter()
            .map(|(name, plane)| AnyChannel::new(name, FlatSamples::F32(plane.iter().copied().collect())));
        let mut attributes = LayerAttributes::named(name);
        attributes.layer_position = Vec2(position.0, position.1);
        attributes.view_name = view.map(Text::from);
        Layer::new((own_columns, own_rows), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(channels.collect()))
    });
    let layers: Layers<AnyChannels<FlatSamples>> = layers.collect();
    let attributes = exr::meta::header::ImageAttributes::new(IntegerBounds::from_dimensions((columns, rows)));
    let image = Image::from_layers(attributes, layers);
    image.write().to_file(path).unwrap();
}

fn read(path: &Path, options: &ReadOptions) -> Result<(Array2<f32>, Scene), SceneError> {
    let scene = read_scene(path, options)?;
    Ok((scene.require_depth()?.z_m().clone(), scene))
}

#[test]
fn depths_lie_where_their_window_is() {
    let folder = tempfile::tempdir().unwrap();
    let (picture, file) = (picture(folder.path()), folder.path().join("z.exr"));
    let z = depths();
    let told = options(Some(file.clone()), None);
    // More than the picture, all around.
    let wide = Array2::from_shape_fn((ROWS + 2, COLUMNS + 4), |(row, column)| {
        let place = row.checked_sub(1).zip(column.checked_sub(2));
        place.and_then(|place| z.get(place)).copied().unwrap_or(99.0)
    });
    write_exr(&file, (COLUMNS, ROWS), vec![("", None, (-2, -1), vec![("Z", wide)])]);
    assert_eq!(read(&picture, &told).unwrap().0, z);
    // A part of it: what lies beside was not measured.
    let part = z.slice(ndarray::s![1.., 2..]).to_owned();
    write_exr(&file, (COLUMNS, ROWS), vec![("", None, (2, 1), vec![("Z", part)])]);
    assert!(matches!(read(&picture, &told), Err(SceneError::Unmeasured { row: 0, column: 0, .. })));
    let filled = ReadOptions { fill_depth: Some(crate::FillDepth::Metres(7.0)), ..told.clone() };
    let (found, _) = read(&picture, &filled).unwrap();
    assert!(found.indexed_iter().all(|((r, c), v)| *v == if r >= 1 && c >= 2 { z[(r, c)] } else { 7.0 }), "{found}");
    // Twice as fine, with a border of its own.
    let fine = Array2::from_shape_fn((2 * ROWS + 2, 2 * COLUMNS + 2), |(row, column)| {
        let place = row.checked_sub(1).zip(column.checked_sub(1));
        place.and_then(|(row, column)| z.get((row / 2, column / 2))).copied().unwrap_or(99.0)
    });
    write_exr(&file, (2 * COLUMNS, 2 * ROWS), vec![("", None, (-1, -1), vec![("Z", fine)])]);
    assert_eq!(read(&picture, &told).unwrap().0, z);
}

#[test]
fn layers_are_taken_by_name_and_ways_along_rays_by_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.exr");
    let colors = || ["B", "G", "R"].map(|name| (name, Array2::from_elem((ROWS, COLUMNS), 0.5))).to_vec();
    let (z, other) = (depths(), depths() + 3.0);
    let planes = [colors(), vec![("Z", other.clone()), ("my.layer.V", z.clone())]].concat();
    write_exr(&file, (COLUMNS, ROWS), vec![("", None, (0, 0), planes)]);
    assert_eq!(read(&file, &options(None, None)).unwrap().0, other);
    let (found, scene) = read(&file, &options(None, Some("my.layer.V"))).unwrap();
    assert!(found == z && scene.notes.iter().any(|note| note.contains("'Z'")), "{:?}", scene.notes);
    let beside = picture(folder.path());
    assert_eq!(read(&beside, &options(Some(file.clone()), Some("my.layer.V"))).unwrap().0, z);
    let message = read(&file, &options(None, Some("none"))).unwrap_err().to_string();
    assert!(message.contains("'none'") && message.contains("my.layer.V"), "{message}");
    // Mitsuba's depth counts along the ray: on the axis as axial depth, elsewhere farther.
    let planes = [colors(), vec![("dd.y.T", Array2::from_elem((ROWS, COLUMNS), 2.0))]].concat();
    write_exr(&file, (COLUMNS, ROWS), vec![("", None, (0, 0), planes)]);
    let (found, scene) = read(&file, &options(None, None)).unwrap();
    let view = scene.view.unwrap();
    for ((row, column), found) in found.indexed_iter() {
        let along = view.distance_per_depth(row as f64, column as f64);
        assert!((f64::from(*found) * along - 2.0).abs() < 1e-6, "{row} {column} {found}");
    }
    assert!(scene.notes.iter().any(|note| note.contains("near_clip")), "{:?}", scene.notes);
}

#[test]
fn of_several_eyes_the_first_sees() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("stereo.exr");
    let colors = |v: f32| ["B", "G", "R"].map(|name| (name, Array2::from_elem((ROWS, COLUMNS), v))).to_vec();
    write_exr(
        &file,
        (COLUMNS, ROWS),
        vec![
            ("rgb.left", Some("left"), (0, 0), colors(0.5)),
            ("Z.left", Some("left"), (0, 0), vec![("Z", depths())]),
            ("rgb.right", Some("right"), (0, 0), colors(0.1)),
            ("Z.right", Some("right"), (0, 0), vec![("Z", depths() + 1.0)]),
        ],
    );
    let (found, scene) = read(&file, &options(None, None)).unwrap();
    assert_eq!(found, depths());
    assert!(scene.notes.iter().any(|note| note == "stereo.exr: its view 'right' is not used"), "{:?}", scene.notes);
    // The other by its name, or by that of its layer.
    for (told, added, unused) in
        [("right", 1.0, "'left'"), ("rgb.right", 1.0, "'left'"), ("left", 0.0, "'right'"), ("rgb.left", 0.0, "'right'")]
    {
        let mut options = options(None, None);
        options.reading.variable = Some(told.to_owned());
        let (found, scene) = read(&file, &options).unwrap();
        assert_eq!(found, depths() + added, "{told}");
        assert!(
            scene.notes.iter().any(|note| note.contains(&format!("its view {unused} is not"))),
            "{:?}",
            scene.notes
        );
    }
    // Parts that are called as their views are, with colors alone.
    let parts = [("left", 0.5), ("right", 0.1)].map(|(name, v)| (name, Some(name), (0, 0), colors(v)));
    write_exr(&file, (COLUMNS, ROWS), parts.to_vec());
    let luminance = |told: Option<&str>| {
        let mut options = ReadOptions { depth_m: Some(1.0), ..options(None, None) };
        options.reading.variable = told.map(str::to_owned);
        read_scene(&file, &options).unwrap().radiance.spectrum_at(0, 0)[15]
    };
    assert_eq!(luminance(Some("left")), luminance(None));
    assert!((luminance(Some("right")) / luminance(None) - 0.2).abs() < 1e-6);
}

#[test]
fn archives_and_packed_arrays_hold_depths() {
    let folder = tempfile::tempdir().unwrap();
    let picture = picture(folder.path());
    let z = depths();
    let bytes: Vec<u8> = z.iter().flat_map(|v| v.to_le_bytes()).collect();
    let array = || npy("<f4", false, "(4, 6)", &bytes);
    let double: Vec<u8> = z.iter().flat_map(|v| (2.0 * v).to_le_bytes()).collect();
    let file = folder.path().join("z.npz");
    std::fs::write(&file, zip_of(&[("depth", array()), ("b", npy("<f4", false, "(4, 6)", &double))], false)).unwrap();
    assert_eq!(read(&picture, &options(Some(file.clone()), None)).unwrap().0, z);
    assert_eq!(read(&picture, &options(Some(file.clone()), Some("b"))).unwrap().0, 2.0 * &z);
    assert!(read(&picture, &options(Some(file), Some("c"))).unwrap_err().to_string().contains("depth, b"));
    // Whole numbers that are packed, in millimetres, one of which stands for none.
    let file = folder.path().join("z.h5");
    let packed: Vec<i16> =
        z.iter().enumerate().map(|(i, v)| if i == 5 { -1 } else { (v * 100.0).round() as i16 }).collect();
    let mut builder = hdf5_pure::FileBuilder::new();
    let mut dataset = builder.create_dataset("array").with_data(&packed).with_shape(&[4, 6]);
    dataset = dataset.set_attr("scale_factor", hdf5_pure::AttrValue::F64(10.0));
    dataset = dataset.set_attr("_FillValue", hdf5_pure::AttrValue::I16(-1));
    dataset.set_attr("units", hdf5_pure::AttrValue::String("mm".to_owned()));
    std::fs::write(&file, builder.finish().unwrap()).unwrap();
    let told = ReadOptions { fill_depth: Some(crate::FillDepth::Metres(9.0)), ..options(Some(file.clone()), None) };
    let (found, _) = read(&picture, &told).unwrap();
    assert!(
        found.iter().zip(&z).enumerate().all(|(i, (a, b))| (a - if i == 5 { 9.0 } else { *b }).abs() < 1e-5),
        "{found}"
    );
    let against = FileReading { depth_unit: Some("m".to_owned()), ..told.reading.clone() };
    let message = read(&picture, &ReadOptions { reading: against, ..told }).unwrap_err().to_string();
    assert!(message.contains("states the unit"), "{message}");
}

/// What is said of depths that are not there, or that something else says otherwise, is refused or named.
#[test]
fn words_without_a_depth_are_refused_and_contradictions_named() {
    let folder = tempfile::tempdir().unwrap();
    let picture = picture(folder.path());
    let fill = Some(crate::FillDepth::Far);
    for depth_m in [None, Some(2.0)] {
        let message = read_scene(&picture, &ReadOptions { fill_depth: fill, depth_m, ..options(None, None) });
        assert!(message.unwrap_err().to_string().contains("--fill-depth"));
    }
    let codes = image::ImageBuffer::from_pixel(COLUMNS as u32, ROWS as u32, image::Luma([5000_u16]));
    dioptric_pictures::save(&codes.into(), &folder.path().join("room.depth.png")).unwrap();
    let camera = format!(
        "{{\"width\": {COLUMNS}, \"height\": {ROWS}, \"fx_px\": 9, \"fy_px\": 9, \"cx_px\": 2.5, \"cy_px\": 1.5, \"depth_unit_m\": 0.001}}"
    );
    std::fs::write(folder.path().join("room.camera.json"), camera).unwrap();
    let depth = |unit: Option<&str>| {
        let reading = FileReading { depth_unit: unit.map(str::to_owned), ..FileReading::default() };
        let scene = read_scene(&picture, &ReadOptions { reading, ..ReadOptions::default() }).unwrap();
        let is_named = scene.notes.iter().any(|note| note.contains("depth_unit_m"));
        (scene.require_depth().unwrap().range_m().0, is_named)
    };
    assert_eq!(depth(None), (5.0, false));
    assert_eq!(depth(Some("mm")), (5.0, false));
    assert_eq!(depth(Some("5000/m")), (1.0, true));
}
