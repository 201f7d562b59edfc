//! Writing OpenEXR: spectral images with depth, whole or a band at a time, and plain planes.

use std::{
    io::{BufWriter, Cursor, Seek, SeekFrom, Write},
    path::Path,
};

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid, sort_exr_attributes};
use exr::{
    meta::{BlockDescription, MetaData, header::Header, magic_number},
    prelude::{
        AnyChannel, AnyChannels, ChannelDescription, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes,
        LineOrder, SampleType, SmallVec, Text, Vec2, WritableImage,
    },
};
use ndarray::Array2;

use super::{
    band_name::{self, BandKind},
    beside::{PartialFile, unwritable},
    exr_attributes,
    spectral_exr::HIDDEN_LAYER,
};
use crate::{HiddenLayer, Scene, SceneError, View};

/// The name of what is seen, beside a layer that is hidden.
const FIRST_LAYER: &str = "visible";

/// What is written besides the bands.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExrParts<'a> {
    /// Axial depth, written as channel `Z`.
    pub depth: Option<&'a DepthMap>,
    /// Pinhole geometry, written as attributes.
    pub view: Option<View>,
    /// Distance between samples on the film, µm; the image's own where it has one.
    pub pitch_um: Option<f64>,
    /// A second layer; not for [`BandWriter`].
    pub hidden: Option<&'a HiddenLayer>,
    /// Whether to compress without loss: about 20 times slower, 15 % smaller where there is noise, 10 times where not.
    pub compress: bool,
}

/// Writes a spectral image in the layout that [`read_spectral_exr`](crate::read_spectral_exr) reads, as single floats.
///
/// # Errors
/// When the depth is not of the image's size, or the file cannot be written; it is then not there.
pub fn write_spectral_exr(path: &Path, image: &SpectralImage, parts: &ExrParts<'_>) -> Result<(), SceneError> {
    // Only a file of several layers names them.
    let name = parts.hidden.map(|_| FIRST_LAYER);
    let mut layers = vec![layer_of(path, image, parts.depth, parts, name)?];
    if let Some(hidden) = parts.hidden {
        layers.push(layer_of(path, &hidden.radiance, Some(&hidden.depth), parts, Some(HIDDEN_LAYER))?);
    }
    write_layers(path, layers)
}

/// Writes a scene with all that it has.
///
/// # Errors
/// As [`write_spectral_exr`].
pub fn write_scene_exr(path: &Path, scene: &Scene, compress: bool) -> Result<(), SceneError> {
    let parts = ExrParts {
        depth: scene.depth.as_ref(),
        view: scene.view,
        pitch_um: None,
        hidden: scene.hidden.as_ref(),
        compress,
    };
    write_spectral_exr(path, &scene.radiance, &parts)
}

/// Writes plain planes, such as the volts of a sensor, under these channel names.
///
/// # Errors
/// When there is no plane, they differ in size, or the file cannot be written.
pub fn write_planes_exr(path: &Path, planes: &[(&str, &Array2<f32>)], compress: bool) -> Result<(), SceneError> {
    let Some((_, first)) = planes.first() else { return Err(unwritable(path, "there is no plane to write")) };
    let mut list = SmallVec::new();
    for &(name, plane) in planes {
        list.push(channel(path, name, plane, first.dim())?);
    }
    let attributes = LayerAttributes::default();
    write_layers(path, vec![layer(first.dim(), attributes, compress, list)])
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
    let mut list = SmallVec::new();
    for (plane, &wavelength_nm) in image.planes().iter().zip(image.grid().centers_nm()) {
        list.push(channel(path, &band_name::format(kind_of(image.quantity()), wavelength_nm), plane, size)?);
    }
    if let Some(depth) = depth {
        list.push(channel(path, "Z", depth.z_m(), size)?);
    }
    let mut attributes = LayerAttributes { layer_name: name.map(Text::from), ..LayerAttributes::default() };
    exr_attributes::add_to(&mut attributes, Some(image.quantity()), image.pitch_um().or(parts.pitch_um), parts.view);
    Ok(layer(size, attributes, parts.compress, list))
}

fn layer(
    (rows, columns): (usize, usize),
    attributes: LayerAttributes,
    compress: bool,
    list: ChannelList,
) -> Layer<AnyChannels<FlatSamples>> {
    let encoding = Encoding {
        compression: if compress { Compression::ZIP16 } else { Compression::Uncompressed },
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
) -> Result<AnyChannel<FlatSamples>, SceneError> {
    check_size(path, name, plane, size)?;
    Ok(AnyChannel::new(name, FlatSamples::F32(plane.iter().copied().collect())))
}

fn check_size(path: &Path, name: &str, plane: &Array2<f32>, (rows, columns): (usize, usize)) -> Result<(), SceneError> {
    if plane.dim() == (rows, columns) {
        return Ok(());
    }
    let (found_rows, found_columns) = plane.dim();
    let reason = format!("channel '{name}' has {found_rows} × {found_columns} samples, expected {rows} × {columns}");
    Err(unwritable(path, reason))
}

fn kind_of(quantity: Quantity) -> BandKind {
    match quantity {
        Quantity::Radiance | Quantity::Irradiance => BandKind::Emissive,
        Quantity::Reflectance => BandKind::Reflective,
    }
}

fn write_layers(path: &Path, mut layers: Vec<Layer<AnyChannels<FlatSamples>>>) -> Result<(), SceneError> {
    let mut partial = PartialFile::create(path)?;
    let writer = BufWriter::with_capacity(1 << 20, partial.file());
    let written = if layers.len() == 1 {
        Image::from_layer(layers.swap_remove(0)).write().to_buffered(writer)
    } else {
        let attributes = exr::prelude::ImageAttributes::with_size(layers[0].size);
        Image::from_layers(attributes, SmallVec::<[_; 2]>::from_vec(layers)).write().to_buffered(writer)
    };
    written.map_err(|error| unwritable(path, error))?;
    sort_exr_attributes(partial.file()).map_err(|error| unwritable(path, error))?;
    partial.finish()
}

/// Writes a spectral EXR a band at a time, in any order, so that the cube need not be in memory.
///
/// The file appears when [`finish`](Self::finish) is called and every band has been written.
#[derive(Debug)]
pub struct BandWriter {
    partial: PartialFile,
    rows: usize,
    columns: usize,
    /// Name of each band and its place among the channels, which are in the order of their names.
    bands: Vec<(String, usize)>,
    n_channels: usize,
    /// Where the first block starts in the file.
    blocks_at: u64,
    is_written: Vec<bool>,
}

impl BandWriter {
    /// Starts a file for a quantity on these bands, of rows × columns.
    ///
    /// # Errors
    /// When the depth is not of that size, the parts hold a hidden layer or ask for compression (neither can be
    /// streamed), or the file cannot be written.
    pub fn create(
        path: &Path,
        quantity: Quantity,
        grid: &WavelengthGrid,
        (rows, columns): (usize, usize),
        parts: &ExrParts<'_>,
    ) -> Result<Self, SceneError> {
        if parts.hidden.is_some() || parts.compress {
            return Err(unwritable(path, "bands are streamed into one layer that is not compressed"));
        }
        if rows == 0 || columns == 0 {
            return Err(unwritable(path, format!("a picture of {rows} × {columns} samples")));
        }
        let mut names: Vec<String> =
            grid.centers_nm().iter().map(|&nm| band_name::format(kind_of(quantity), nm)).collect();
        let unsorted = names.clone();
        names.extend(parts.depth.map(|_| "Z".to_owned()));
        names.sort();
        let place = |name: &String| names.binary_search(name).expect("every name is in the list");
        let bands = unsorted.into_iter().map(|name| (place(&name), name)).map(|(at, name)| (name, at)).collect();
        let mut attributes = LayerAttributes::default();
        exr_attributes::add_to(&mut attributes, Some(quantity), parts.pitch_um, parts.view);
        let head = head(&names, (rows, columns), attributes).map_err(|error| unwritable(path, error))?;
        let mut writer = Self {
            partial: PartialFile::create(path)?,
            rows,
            columns,
            bands,
            n_channels: names.len(),
            blocks_at: head.len() as u64 + 8 * rows as u64,
            is_written: vec![false; grid.len()],
        };
        writer.write_frame(&head).map_err(|error| unwritable(path, error))?;
        if let Some(depth) = parts.depth {
            writer.write_channel(place(&"Z".to_owned()), "Z", depth.z_m())?;
        }
        Ok(writer)
    }

    /// Writes the samples of a band.
    ///
    /// # Errors
    /// When there is no such band, the plane is not of the file's size, or the disk is full.
    pub fn write_band(&mut self, band: usize, plane: &Array2<f32>) -> Result<(), SceneError> {
        let Some((name, channel)) = self.bands.get(band).cloned() else {
            return Err(unwritable(self.partial.path(), format!("there is no band {band}")));
        };
        self.write_channel(channel, &name, plane)?;
        self.is_written[band] = true;
        Ok(())
    }

    /// Moves the file to its place.
    ///
    /// # Errors
    /// When a band has not been written, or the file cannot be moved.
    pub fn finish(mut self) -> Result<(), SceneError> {
        if let Some(band) = self.is_written.iter().position(|written| !written) {
            return Err(unwritable(self.partial.path(), format!("band '{}' was never given", self.bands[band].0)));
        }
        let sorted = sort_exr_attributes(self.partial.file());
        sorted.map_err(|error| unwritable(self.partial.path(), error))?;
        self.partial.finish()
    }

    fn block_bytes(&self) -> u64 {
        8 + 4 * self.columns as u64 * self.n_channels as u64
    }

    /// Writes the header, the table of blocks, and the head of each block.
    fn write_frame(&mut self, head: &[u8]) -> std::io::Result<()> {
        let (rows, block_bytes, blocks_at) = (self.rows as u64, self.block_bytes(), self.blocks_at);
        let file = self.partial.file();
        file.set_len(blocks_at + rows * block_bytes)?;
        let mut start = head.to_vec();
        start.extend((0..rows).flat_map(|row| (blocks_at + row * block_bytes).to_le_bytes()));
        file.write_all(&start)?;
        for row in 0..rows {
            file.seek(SeekFrom::Start(blocks_at + row * block_bytes))?;
            let mut block = (row as i32).to_le_bytes().to_vec();
            block.extend(((block_bytes - 8) as i32).to_le_bytes());
            file.write_all(&block)?;
        }
        Ok(())
    }

    fn write_channel(&mut self, channel: usize, name: &str, plane: &Array2<f32>) -> Result<(), SceneError> {
        let path = self.partial.path().to_owned();
        check_size(&path, name, plane, (self.rows, self.columns))?;
        let row_bytes = 4 * self.columns as u64;
        let first = self.blocks_at + 8 + row_bytes * channel as u64;
        let block_bytes = self.block_bytes();
        let file = self.partial.file();
        for (row, samples) in plane.outer_iter().enumerate() {
            let bytes: Vec<u8> = samples.iter().flat_map(|v| v.to_le_bytes()).collect();
            file.seek(SeekFrom::Start(first + row as u64 * block_bytes))
                .and_then(|_| file.write_all(&bytes))
                .map_err(|error| unwritable(&path, error))?;
        }
        Ok(())
    }
}

/// Returns the bytes before the table of blocks.
fn head(names: &[String], (rows, columns): (usize, usize), attributes: LayerAttributes) -> exr::error::Result<Vec<u8>> {
    let channels = names.iter().map(|name| ChannelDescription::named(name.as_str(), SampleType::F32)).collect();
    let header = Header::new(Text::from("bands"), Vec2(columns, rows), channels)
        .with_attributes(attributes)
        .with_encoding(Compression::Uncompressed, BlockDescription::ScanLines, LineOrder::Increasing);
    let headers = [header];
    let requirements = MetaData::validate(&headers, true)?;
    let mut bytes = Cursor::new(Vec::new());
    magic_number::write(&mut bytes)?;
    requirements.write(&mut bytes)?;
    Header::write_all(&headers, &mut bytes, requirements.has_multiple_layers)?;
    Ok(bytes.into_inner())
}
