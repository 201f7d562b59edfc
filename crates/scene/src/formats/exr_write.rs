//! Writing OpenEXR: spectral images with depth, and plain planes.

use std::{io::BufWriter, path::Path};

use dioptric_files::Staged;
use dioptric_spectrum::{DepthMap, SpectralImage, sort_exr_attributes};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder, SmallVec, Text,
    WritableImage,
};
use ndarray::{Array2, s};

use super::{
    band_name, exr_attributes,
    exr_layers::HIDDEN_LAYER,
    exr_samples::{ExrSamples, Stored, check_size},
    exr_stream::SpectralHead,
    unusable::{open_new, unwritable},
};
use crate::{HiddenLayer, Scene, SceneError, SceneLight, View};

/// Bytes of samples that are packed at a time.
const AT_ONCE_BYTES: usize = 32 << 20;

/// The name of what is seen, beside a layer that is hidden.
const FIRST_LAYER: &str = "visible";

/// What is written besides the bands.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExrParts<'a> {
    /// Axial depth, written as channel `Z`.
    pub depth: Option<&'a DepthMap>,
    /// Pinhole geometry, written as attributes.
    pub view: Option<View>,
    /// The light on the scene, written as an attribute.
    pub light: Option<&'a SceneLight>,
    /// Distance between samples on the film, µm; the image's own where it has one.
    pub pitch_um: Option<f64>,
    /// A second layer.
    pub hidden: Option<&'a HiddenLayer>,
    /// How samples are stored; depths are single floats.
    pub samples: ExrSamples,
}

/// Writes a spectral image in the layout that [`read_spectral_exr`](crate::read_spectral_exr) reads.
///
/// # Errors
/// When the depth is not of the image's size, or the file cannot be written; it is then not there.
pub fn write_spectral_exr(path: &Path, image: &SpectralImage, parts: &ExrParts<'_>) -> Result<(), SceneError> {
    let Some(hidden) = parts.hidden else { return write_single_layer(path, image, parts) };
    // Only a file of several layers names them.
    let visible = layer_of(path, image, parts.depth, parts, Some(FIRST_LAYER))?;
    let hidden = layer_of(path, &hidden.radiance, Some(&hidden.depth), parts, Some(HIDDEN_LAYER))?;
    write_layers(path, vec![visible, hidden])
}

/// Writes an image a few rows at a time, without a copy of it.
fn write_single_layer(path: &Path, image: &SpectralImage, parts: &ExrParts<'_>) -> Result<(), SceneError> {
    let head = SpectralHead {
        quantity: image.quantity(),
        grid: image.grid(),
        size: (image.rows(), image.columns()),
        pitch_um: image.pitch_um().or(parts.pitch_um),
        depth: parts.depth,
        view: parts.view,
        light: parts.light,
        texts: &[],
        largest: largest(image.planes()),
        samples: parts.samples,
        at_once_bytes: AT_ONCE_BYTES,
    };
    let planes = image.planes();
    head.write_exr(path, &mut |band, rows| Ok(planes[band].slice(s![rows, ..]).iter().copied().collect()))
}

/// Writes a scene with all that it has.
///
/// # Errors
/// As [`write_spectral_exr`].
pub fn write_scene_exr(path: &Path, scene: &Scene, samples: ExrSamples) -> Result<(), SceneError> {
    let parts = ExrParts {
        depth: scene.depth.as_ref(),
        view: scene.view,
        light: scene.light.as_ref(),
        pitch_um: None,
        hidden: scene.hidden.as_ref(),
        samples,
    };
    write_spectral_exr(path, &scene.radiance, &parts)
}

/// Writes plain planes, such as the volts of a sensor, under these channel names.
///
/// # Errors
/// When there is no plane, they differ in size, or the file cannot be written.
pub fn write_planes_exr(path: &Path, planes: &[(&str, &Array2<f32>)], samples: ExrSamples) -> Result<(), SceneError> {
    let Some((_, first)) = planes.first() else { return Err(unwritable(path, "there is no plane to write")) };
    let mut list = SmallVec::new();
    for &(name, plane) in planes {
        list.push(channel(path, name, plane, first.dim(), &samples.plain(largest([plane])))?);
    }
    let attributes = LayerAttributes::default();
    write_layers(path, vec![layer(first.dim(), attributes, samples, list)])
}

/// Returns the largest magnitude of samples; that of what is no number is infinite.
fn largest<'a>(planes: impl IntoIterator<Item = &'a Array2<f32>>) -> f32 {
    let samples = planes.into_iter().flatten();
    samples.fold(0.0, |largest, sample| if sample.is_nan() { f32::INFINITY } else { largest.max(sample.abs()) })
}

type ChannelList = SmallVec<[AnyChannel<FlatSamples>; 4]>;

fn layer_of(
    path: &Path,
    image: &SpectralImage,
    depth: Option<&DepthMap>,
    parts: &ExrParts<'_>,
    name: Option<&str>,
) -> Result<Layer<AnyChannels<FlatSamples>>, SceneError> {
    let size = (image.rows(), image.columns());
    let stored = parts.samples.layout(image.quantity(), largest(image.planes()));
    let mut list = SmallVec::new();
    for (plane, &wavelength_nm) in image.planes().iter().zip(image.grid().centers_nm()) {
        list.push(channel(path, &band_name::of(image.quantity(), wavelength_nm), plane, size, &stored)?);
    }
    if let Some(depth) = depth {
        list.push(channel(path, "Z", depth.z_m(), size, &Stored::single())?);
    }
    let mut attributes = LayerAttributes { layer_name: name.map(Text::from), ..LayerAttributes::default() };
    let pitch_um = image.pitch_um().or(parts.pitch_um);
    exr_attributes::add_to(&mut attributes, stored.unit.text.as_deref(), pitch_um, parts.view, parts.light);
    Ok(layer(size, attributes, parts.samples, list))
}

fn layer(
    (rows, columns): (usize, usize),
    attributes: LayerAttributes,
    samples: ExrSamples,
    list: ChannelList,
) -> Layer<AnyChannels<FlatSamples>> {
    let encoding = Encoding {
        compression: samples.compression(),
        blocks: exr::image::Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    Layer::new((columns, rows), attributes, encoding, AnyChannels::sort(list))
}

fn channel(
    path: &Path,
    name: &str,
    plane: &Array2<f32>,
    size: (usize, usize),
    stored: &Stored,
) -> Result<AnyChannel<FlatSamples>, SceneError> {
    check_size(path, name, plane, size)?;
    Ok(AnyChannel::new(name, stored.samples(plane.iter())))
}

fn write_layers(path: &Path, mut layers: Vec<Layer<AnyChannels<FlatSamples>>>) -> Result<(), SceneError> {
    let staged = Staged::file(path)?;
    let mut file = open_new(&staged, path)?;
    let writer = BufWriter::with_capacity(1 << 20, &mut file);
    let written = if layers.len() == 1 {
        Image::from_layer(layers.swap_remove(0)).write().to_buffered(writer)
    } else {
        let attributes = exr::prelude::ImageAttributes::with_size(layers[0].size);
        Image::from_layers(attributes, SmallVec::<[_; 2]>::from_vec(layers)).write().to_buffered(writer)
    };
    written.map_err(|error| unwritable(path, error))?;
    sort_exr_attributes(&mut file).map_err(|error| unwritable(path, error))?;
    drop(file);
    Ok(staged.commit()?)
}
