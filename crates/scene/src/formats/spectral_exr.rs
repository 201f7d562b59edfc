//! Reading spectral OpenEXR in the layout of Fichet, Pacanowski and Wilkie (2021) and its relatives, with depth.

use std::{collections::HashMap, fs::File, io::BufReader, path::Path};

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use exr::{
    meta::MetaData,
    prelude::{AnyChannel, AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers, SampleType, read},
};
use ndarray::Array2;

use super::{
    band_name::{self, BandKind},
    exr_attributes::{self, Attributes},
    light_unit::LightUnit,
    unusable::{check_memory, unreadable},
};
use crate::{HiddenLayer, SceneError, View};

/// The name of the layer that holds what lies behind the first surface.
pub(crate) const HIDDEN_LAYER: &str = "hidden";

/// What a spectral EXR file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralFile {
    /// Radiance, irradiance or reflectance; with the sample pitch where the file states it.
    pub image: SpectralImage,
    /// Axial depth, from channel `Z`.
    pub depth: Option<DepthMap>,
    /// Distance from the projection center, m, from channel `distance`.
    pub distance_m: Option<Array2<f32>>,
    /// Pinhole geometry, where the file states it.
    pub view: Option<View>,
    /// What lies behind the first surface, from a second layer of that name.
    pub hidden: Option<HiddenLayer>,
}

impl SpectralFile {
    /// Returns the axial depth: from `Z`, or else from `distance` as seen with this view.
    ///
    /// # Errors
    /// When a converted distance is not above 0.
    pub fn depth_with(&self, view: Option<View>) -> Result<Option<DepthMap>, SceneError> {
        if let (None, Some(distance_m), Some(view)) = (&self.depth, &self.distance_m, view) {
            return Ok(Some(DepthMap::new(axial(distance_m, view))?));
        }
        Ok(self.depth.clone())
    }
}

/// Returns the axial depths of distances from the projection center.
pub(super) fn axial(distance_m: &Array2<f32>, view: View) -> Array2<f32> {
    Array2::from_shape_fn(distance_m.dim(), |(row, column)| {
        let along = view.distance_per_depth(row as f64, column as f64);
        (f64::from(distance_m[(row, column)]) / along) as f32
    })
}

/// Reads a spectral EXR file.
///
/// Channels are `S0.…` (radiance, or irradiance by its `emissiveUnits`) or `T.…` (reflectance), in any number
/// of decimals, with exponents and any unit of length or frequency, as half or single floats; so pbrt writes them too. `550nm`
/// and a bin `360.00-375.67nm` (Mitsuba 0.6) are light likewise. Values are a nanometre, in W or photons. Other channels, such
/// as RGB, are left alone, but for `Z` and `distance`.
///
/// # Errors
/// One sentence with the file's name when it is truncated, too large, without spectral bands, of mixed units, or holds
/// a sample that is not finite or is negative.
pub fn read_spectral_exr(path: &Path) -> Result<SpectralFile, SceneError> {
    let RawFile { image, z_m, distance_m, view, hidden } = read_raw_exr(path)?;
    let values = |reason| SceneError::Values { file: path.to_owned(), reason };
    let map = |plane: Option<Array2<f32>>| plane.map(DepthMap::new).transpose().map_err(values);
    let image = match image {
        RawImage::Spectral(image) => image,
        RawImage::Rgb(_) => return Err(no_bands(path)),
    };
    let hidden = match hidden {
        Some((radiance, z_m)) => Some(HiddenLayer { radiance, depth: DepthMap::new(z_m).map_err(values)? }),
        None => None,
    };
    Ok(SpectralFile { image, depth: map(z_m)?, distance_m: map(distance_m)?.map(|m| m.z_m().clone()), view, hidden })
}

fn no_bands(path: &Path) -> SceneError {
    SceneError::NoBands {
        file: path.to_owned(),
        expected: "channels named like S0.550,000000nm (light) or T.550,000000nm (reflectance)",
    }
}

/// What an EXR file holds, its depths as they stand.
pub(super) struct RawFile {
    pub(super) image: RawImage,
    /// Axial depth; 0 or NaN may stand for none.
    pub(super) z_m: Option<Array2<f32>>,
    /// Distance from the projection center, likewise.
    pub(super) distance_m: Option<Array2<f32>>,
    pub(super) view: Option<View>,
    /// Radiance and axial depth of the layer behind.
    pub(super) hidden: Option<(SpectralImage, Array2<f32>)>,
}

/// The picture of an EXR file.
pub(super) enum RawImage {
    Spectral(SpectralImage),
    /// Linear red, green and blue of a file without bands.
    Rgb([Array2<f32>; 3]),
}

/// Reads an EXR file of bands or, where it has none, of red, green and blue.
pub(super) fn read_raw_exr(path: &Path) -> Result<RawFile, SceneError> {
    let mut layers = read_layers(path)?;
    let Some(index) = layers.iter().position(|layer| layer.has_bands()) else {
        return rgb_of(layers, path);
    };
    let first = layers.swap_remove(index);
    let hidden = layers.into_iter().find(|layer| layer.name == HIDDEN_LAYER && layer.has_bands());
    let attributes = first.attributes.clone();
    let (image, z_m, distance_m) = first.into_image(path)?;
    let hidden = match hidden {
        Some(layer) => match layer.into_image(path)? {
            (radiance, Some(z_m), _) => Some((radiance, z_m)),
            _ => return Err(unreadable(path, "the layer 'hidden' has no channel 'Z'")),
        },
        None => None,
    };
    let image = match attributes.pitch_um {
        Some(pitch_um) => image.with_pitch_um(pitch_um),
        None => image,
    };
    let view = attributes.view(image.columns(), image.rows()).map_err(|error| unreadable(path, error))?;
    Ok(RawFile { image: RawImage::Spectral(image), z_m, distance_m, view, hidden })
}

/// Returns the picture of a file without bands: `R`, `G` and `B`, or Blender's `….Combined.R`; its depth is `Z` or `….Depth.Z`.
fn rgb_of(layers: Vec<RawLayer>, path: &Path) -> Result<RawFile, SceneError> {
    let attributes = layers[0].attributes.clone();
    let mut planes: Vec<(String, Array2<f32>)> = layers.into_iter().flat_map(RawLayer::into_named).collect();
    let mut take = |is_it: &dyn Fn(&str) -> bool| {
        let index = planes.iter().position(|(name, _)| is_it(name))?;
        Some(planes.swap_remove(index).1)
    };
    let mut color = |letter: &str| take(&|name| name == letter || name.ends_with(&format!("Combined.{letter}")));
    let (Some(red), Some(green), Some(blue)) = (color("R"), color("G"), color("B")) else {
        return Err(no_bands(path));
    };
    let is_depth =
        |name: &str| ["Z", "depth.Z"].contains(&name) || name.ends_with("Depth.Z") || name.ends_with("Depth.V");
    let z_m = take(&is_depth);
    let distance_m = take(&|name| name == "distance");
    let (rows, columns) = red.dim();
    for (name, plane) in
        [("G", Some(&green)), ("B", Some(&blue)), ("Z", z_m.as_ref()), ("distance", distance_m.as_ref())]
    {
        if plane.is_some_and(|plane| plane.dim() != (rows, columns)) {
            return Err(unreadable(path, format!("its channels 'R' and '{name}' differ in size")));
        }
    }
    let view = attributes.view(columns, rows).map_err(|error| unreadable(path, error))?;
    Ok(RawFile { image: RawImage::Rgb([red, green, blue]), z_m, distance_m, view, hidden: None })
}

/// Reads every channel of an EXR file's first layer as single floats, by name.
///
/// # Errors
/// When the file is truncated, too large or no EXR.
pub fn read_planes_exr(path: &Path) -> Result<Vec<(String, Array2<f32>)>, SceneError> {
    Ok(read_layers(path)?.swap_remove(0).planes)
}

/// A layer, its channels as single floats.
struct RawLayer {
    name: String,
    attributes: Attributes,
    planes: Vec<(String, Array2<f32>)>,
}

impl RawLayer {
    /// Returns the channels, each with the name of the layer before its own where it has one.
    fn into_named(self) -> Vec<(String, Array2<f32>)> {
        let layer = self.name;
        let full = |name: String| match (layer.as_str(), name.contains('.')) {
            ("", _) | (_, true) => name,
            (layer, false) => format!("{layer}.{name}"),
        };
        self.planes.into_iter().map(|(name, plane)| (full(name), plane)).collect()
    }

    fn has_bands(&self) -> bool {
        self.planes.iter().any(|(name, _)| band_name::parse(name).is_some())
    }

    /// Sorts the channels into an image, `Z` and `distance`, which are as they stand.
    fn into_image(self, path: &Path) -> Result<Parts, SceneError> {
        let mut kinds = HashMap::new();
        let mut bands = Vec::new();
        let (mut depth, mut distance_m) = (None, None);
        for (name, plane) in self.planes {
            if let Some((kind, wavelength_nm)) = band_name::parse(&name) {
                kinds.entry(kind == BandKind::Emissive).or_insert_with(|| name.clone());
                bands.push((wavelength_nm, name, plane));
            } else if name == "Z" {
                depth = Some(plane);
            } else if name == "distance" {
                distance_m = Some(plane);
            }
        }
        let units = |reason: String| Err(SceneError::Units { file: path.to_owned(), reason });
        if let (Some(light), Some(reflectance)) = (kinds.get(&true), kinds.get(&false)) {
            return units(format!("both light ('{light}') and reflectance ('{reflectance}') channels"));
        }
        bands.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(pair) = bands.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return units(format!("channels '{}' and '{}' are the same wavelength", pair[0].1, pair[1].1));
        }
        let unit = match &self.attributes.unit {
            _ if !kinds.contains_key(&true) => None,
            Ok(unit) => Some(unit.unwrap_or(LightUnit::RADIANCE)),
            Err(unknown) => {
                return units(format!(
                    "emissiveUnits is '{unknown}': expected W.m^-2.sr^-1 or W.m^-2, a nanometre understood, or photons \
                     likewise"
                ));
            }
        };
        let quantity = unit.map_or(Quantity::Reflectance, |unit| unit.quantity);
        let values = |reason| SceneError::Values { file: path.to_owned(), reason };
        let grid = WavelengthGrid::new(bands.iter().map(|band| band.0).collect()).map_err(values)?;
        let in_watts = |(wavelength_nm, _, mut plane): (f64, String, Array2<f32>)| {
            unit.iter().for_each(|unit| unit.convert(&mut plane, wavelength_nm));
            plane
        };
        let planes = bands.into_iter().map(in_watts).collect();
        let image = SpectralImage::new(quantity, grid, planes).map_err(values)?;
        image.check_samples().map_err(values)?;
        Ok((image, depth, distance_m))
    }
}

type Parts = (SpectralImage, Option<Array2<f32>>, Option<Array2<f32>>);

/// Reads all layers; at least one.
fn read_layers(path: &Path) -> Result<Vec<RawLayer>, SceneError> {
    let open = || File::open(path).map_err(|error| unreadable(path, error));
    guard(path, open()?)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(BufReader::new(open()?))
        .map_err(|error| unreadable(path, explain(&error)))?;
    let layers: Result<Vec<_>, _> = image.layer_data.into_iter().map(|layer| raw_layer(path, layer)).collect();
    let layers = layers?;
    if layers.is_empty() {
        return Err(unreadable(path, "it has no layer"));
    }
    Ok(layers)
}

fn raw_layer(path: &Path, layer: Layer<AnyChannels<FlatSamples>>) -> Result<RawLayer, SceneError> {
    let (columns, rows) = (layer.size.0, layer.size.1);
    let planes: Result<Vec<_>, _> =
        layer.channel_data.list.into_iter().map(|channel| plane_of(path, channel, rows, columns)).collect();
    Ok(RawLayer {
        name: layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default(),
        attributes: exr_attributes::from_layer(&layer.attributes),
        planes: planes?,
    })
}

fn plane_of(
    path: &Path,
    channel: AnyChannel<FlatSamples>,
    rows: usize,
    columns: usize,
) -> Result<(String, Array2<f32>), SceneError> {
    let samples: Vec<f32> = match channel.sample_data {
        FlatSamples::F16(samples) => samples.into_iter().map(|v| v.to_f32()).collect(),
        FlatSamples::F32(samples) => samples,
        FlatSamples::U32(samples) => samples.into_iter().map(|v| v as f32).collect(),
    };
    let name = channel.name.to_string();
    match Array2::from_shape_vec((rows, columns), samples) {
        Ok(plane) => Ok((name, plane)),
        Err(_) => Err(unreadable(path, format!("channel '{name}' has not {rows} × {columns} samples"))),
    }
}

/// Refuses a file whose samples take more memory than they may: as they stand in the file, and as single floats where they are none.
fn guard(path: &Path, file: File) -> Result<(), SceneError> {
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    let meta =
        MetaData::read_from_buffered(BufReader::new(file), false).map_err(|error| unreadable(path, explain(&error)))?;
    let bytes = meta.headers.iter().fold(0_u64, |sum, header| {
        let samples = (header.layer_size.0 as u64).saturating_mul(header.layer_size.1 as u64);
        let sample_bytes = header.channels.list.iter().map(|channel| match channel.sample_type {
            SampleType::F32 => 4,
            other => other.bytes_per_sample() as u64 + 4,
        });
        // Even a file without channels has a table of its rows.
        sum.saturating_add(samples.saturating_mul(sample_bytes.sum::<u64>().max(1)))
    });
    check_memory(path, bytes, length)
}

/// Returns what is wrong with an EXR file in a few words.
fn explain(error: &exr::error::Error) -> String {
    let text = error.to_string();
    // The crate turns the end of a file into these words.
    if text.contains("reference to missing bytes") {
        return "the file ends too early (truncated)".to_owned();
    }
    format!("no OpenEXR file that can be read ({text})")
}
