//! Reading spectral OpenEXR in the layout of Fichet, Pacanowski and Wilkie (2021) and its relatives, with depth.

use std::{collections::HashMap, fs::File, io::BufReader, path::Path};

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use exr::{
    meta::{
        MetaData,
        attribute::{Chromaticities, EnvironmentMap},
    },
    prelude::{AnyChannel, AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers, SampleType, read},
};
use ndarray::Array2;

use super::{
    band_name::{self, BandKind},
    exr_attributes::{self, Attributes},
    exr_colors::{are_srgb, colors_of, srgb_from},
    exr_depth,
    light_unit::LightUnit,
    primaries::into_srgb,
    raw_depth::RawDepth,
    reading::{DepthKind, Frame, Panorama},
    stated::{Stated, name_of, note_of},
    unusable::{check_memory, unreadable},
};
use crate::{HiddenLayer, SceneError, SceneLight, View};

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
    let RawFile { image, depth, view, hidden, panorama, .. } = read_raw_exr(path, None)?;
    if panorama.is_some() {
        return Err(unreadable(path, "it is an environment map, expected a picture in perspective"));
    }
    let values = |reason| SceneError::Values { file: path.to_owned(), reason };
    let image = match image {
        RawImage::Spectral { image, .. } => image,
        RawImage::Rgb { .. } => return Err(no_bands(path)),
    };
    image.check_samples().map_err(values)?;
    let hidden = match hidden {
        Some((radiance, z_m)) => Some(HiddenLayer { radiance, depth: DepthMap::new(z_m).map_err(values)? }),
        None => None,
    };
    let is_axial = depth.as_ref().is_none_or(|depth| depth.kind == DepthKind::Axial);
    let map = depth.map(|depth| DepthMap::new(depth.values)).transpose().map_err(values)?;
    let (depth, distance_m) = if is_axial { (map, None) } else { (None, map.map(|map| map.z_m().clone())) };
    Ok(SpectralFile { image, depth, distance_m, view, hidden })
}

fn no_bands(path: &Path) -> SceneError {
    SceneError::NoBands {
        file: path.to_owned(),
        expected: "channels R, G and B or Y, or named like S0.550,000000nm (light) or T.550,000000nm (reflectance)",
    }
}

/// What an EXR file holds, its samples and depths as they stand.
pub(super) struct RawFile {
    pub(super) image: RawImage,
    pub(super) depth: Option<RawDepth>,
    pub(super) view: Option<View>,
    pub(super) frame: Frame,
    /// Whether it says that it is a picture of all directions.
    pub(super) panorama: Option<Panorama>,
    pub(super) light: Option<SceneLight>,
    /// Radiance and axial depth of the layer behind.
    pub(super) hidden: Option<(SpectralImage, Array2<f32>)>,
    /// What of the file is not used.
    pub(super) notes: Vec<String>,
}

/// The picture of an EXR file.
pub(super) enum RawImage {
    /// Light whose unit is not stated is W m⁻² sr⁻¹ nm⁻¹.
    Spectral { image: SpectralImage, is_unit_stated: bool },
    /// Linear red, green and blue of sRGB's primaries, of a file without bands.
    Rgb {
        planes: [Array2<f32>; 3],
        /// The luminance of white, cd/m².
        white_cd_m2: Option<f64>,
    },
}

/// Reads an EXR file of bands or, where it has none, of red, green and blue.
///
/// Bands may be in a part each. The depth is the channel told, or `Z`, or that of the view layer whose colors are taken (`….Depth.Z`), or
/// `distance`. Of several views (stereo) the first is taken.
pub(super) fn read_raw_exr(path: &Path, told_depth: Option<&str>) -> Result<RawFile, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    let other_views = leave_other_views(&mut layers);
    let hidden = layers.iter().position(|layer| layer.name == HIDDEN_LAYER && layer.has_bands());
    let hidden = hidden.filter(|_| layers.len() > 1).map(|index| layers.remove(index));
    let panorama = match layers.iter().find_map(|layer| layer.attributes.environment) {
        None => None,
        Some(EnvironmentMap::LatitudeLongitude) => Some(Panorama::Equirectangular { yaw_deg: 0.0, pitch_deg: 0.0 }),
        Some(EnvironmentMap::Cube) => Some(Panorama::Cube { yaw_deg: 0.0, pitch_deg: 0.0 }),
    };
    let mut notes: Vec<String> = note_of(path, "view", &other_views).into_iter().collect();
    if let Some(Panorama::Equirectangular { .. }) = panorama {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        notes.push(format!(
            "{name}: its pixels are taken as areas of equal angles; envmap of its header puts the outermost on the edges, half a pixel away"
        ));
    }
    let index = layers.iter().position(RawLayer::has_bands);
    let mut first = layers.remove(index.unwrap_or(0));
    let (size, position) = (first.size, first.position);
    let attributes = first.attributes.clone();
    // Parts of the same samples belong to one picture; of others, and of bands that are there already, the names are told.
    let (mut unused, mut stated) = (vec![], attributes.others.clone());
    if index.is_none() {
        first.name_channels();
    }
    for mut layer in layers {
        let wavelengths =
            |layer: &RawLayer| layer.planes.iter().filter_map(|(name, _)| band_name::parse(name)).collect::<Vec<_>>();
        let own = wavelengths(&first);
        let repeats = wavelengths(&layer).iter().any(|band| own.contains(band));
        if repeats || (layer.size, layer.position) != (size, position) {
            unused.push(layer.name);
        } else {
            if layer.has_bands() && layer.attributes.unit != attributes.unit {
                let reason = format!("its part '{}' states another emissiveUnits than the first", layer.name);
                return Err(SceneError::Units { file: path.to_owned(), reason });
            }
            stated.merge(layer.attributes.others.clone());
            layer.name_channels();
            first.planes.append(&mut layer.planes);
        }
    }
    notes.extend(stated.note(path, exr_attributes::is_harmless));
    notes.extend(note_of(path, "part", &unused));
    let (rows, columns) = size;
    let frame = head.frame_of(position);
    let view = attributes.view(columns, rows).map_err(|error| unreadable(path, error))?;
    let light =
        attributes.light.clone().map_err(|reason| unreadable(path, format!("its sceneLight cannot be: {reason}")))?;
    let mut channels = Stated::new("channel", std::mem::take(&mut first.planes));
    let bands = channels.take_all(|name| band_name::parse(name).is_some());
    let (image, prefix) = if bands.is_empty() {
        let (prefix, mut planes) = colors_of(&mut channels).ok_or_else(|| no_bands(path))?;
        if let Some(own) = &head.chromaticities {
            let no_colors = || unreadable(path, "its chromaticities are no three primaries and a white");
            into_srgb(&mut planes, &srgb_from(own).ok_or_else(no_colors)?);
            notes.push(format!("{}: its primaries become those of sRGB, its white D65", name_of(path)));
        }
        (RawImage::Rgb { planes, white_cd_m2: attributes.white_cd_m2.filter(|white| *white > 0.0) }, prefix)
    } else {
        let is_unit_stated = !matches!(attributes.unit, Ok(None));
        let image = image_of(path, &attributes, bands)?;
        let image = match attributes.pitch_um {
            Some(pitch_um) => image.with_pitch_um(pitch_um),
            None => image,
        };
        // A preview of the bands.
        channels.take_all(|name| ["R", "G", "B"].contains(&name));
        (RawImage::Spectral { image, is_unit_stated }, String::new())
    };
    let depth_name = match told_depth {
        None => exr_depth::depth_name(channels.names(), &prefix),
        Some(told) if channels.get(told).is_some() => Some((told.to_owned(), exr_depth::kind_of(told))),
        Some(told) => {
            let names = channels.names().collect::<Vec<_>>().join(", ");
            return Err(unreadable(path, format!("it has no channel '{told}' for its depth, expected one of {names}")));
        }
    };
    let depth = depth_name.and_then(|(name, kind)| {
        let values = channels.take(&name)?;
        notes.extend(exr_depth::note_of_kind(path, &name));
        Some(RawDepth::in_file(path, format!("channel '{name}'"), values, kind))
    });
    // Opacity of 1 everywhere is none.
    let opacity = if prefix.is_empty() { "A".to_owned() } else { format!("{prefix}.A") };
    if channels.get(&opacity).is_some_and(|plane| plane.iter().all(|v| *v == 1.0)) {
        channels.take(&opacity);
    }
    notes.extend(channels.note(path, |_| false));
    let hidden = match hidden {
        Some(layer) => match layer.into_image(path)? {
            (radiance, Some(z_m), _) => {
                let values = |reason| SceneError::Values { file: path.to_owned(), reason };
                radiance.check_samples().map_err(values)?;
                Some((radiance, z_m))
            }
            _ => return Err(unreadable(path, "the layer 'hidden' has no channel 'Z'")),
        },
        None => None,
    };
    Ok(RawFile { image, depth, view, frame, panorama, light, hidden, notes })
}

/// Leaves the layers of the first view, and those of none, and returns the names of the other views.
fn leave_other_views(layers: &mut Vec<RawLayer>) -> Vec<String> {
    let first = layers.iter().find_map(|layer| layer.view.clone());
    let is_other = |layer: &RawLayer| layer.view.is_some() && layer.view != first;
    let mut others: Vec<String> =
        layers.iter().filter(|layer| is_other(layer)).filter_map(|layer| layer.view.clone()).collect();
    others.dedup();
    layers.retain(|layer| !is_other(layer));
    // Parts of a view are named after it, as `left` or `depth.left`, which its channels need not be.
    for layer in layers.iter_mut() {
        let Some(view) = &layer.view else { continue };
        let rest = layer.name.strip_suffix(view.as_str()).map(|rest| rest.trim_end_matches(['.', '_']).to_owned());
        layer.name = rest.unwrap_or_else(|| layer.name.clone());
    }
    others
}

/// Reads every channel of an EXR file's first layer as single floats, by name.
///
/// # Errors
/// When the file is truncated, too large or no EXR.
pub fn read_planes_exr(path: &Path) -> Result<Vec<(String, Array2<f32>)>, SceneError> {
    Ok(read_planes_and_primaries_exr(path)?.0)
}

/// The channels of an EXR file by name, and the matrix from its primaries to linear sRGB.
pub(super) type PlanesAndPrimaries = (Vec<(String, Array2<f32>)>, Option<[[f64; 3]; 3]>);

/// Reads the same, with the matrix from the primaries that the file states to linear sRGB; none where they are those of sRGB.
pub(super) fn read_planes_and_primaries_exr(path: &Path) -> Result<PlanesAndPrimaries, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    let has_colors = |planes: &[(String, Array2<f32>)]| planes.iter().any(|(name, _)| name == "R");
    let layer = layers.swap_remove(0);
    let own = head.chromaticities.filter(|_| has_colors(&layer.planes));
    let no_colors = || unreadable(path, "its chromaticities are no three primaries and a white");
    let matrix = own.map(|own| srgb_from(&own).ok_or_else(no_colors)).transpose()?;
    Ok((layer.planes, matrix))
}

/// Reads all channels of all layers as single floats, by name, each with the part of the display window that it has.
pub(super) fn read_placed_planes(path: &Path) -> Result<Vec<(String, Array2<f32>, Frame)>, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    if layers.len() > 1 {
        layers.iter_mut().for_each(RawLayer::name_channels);
    }
    let placed = |layer: RawLayer| {
        let frame = head.frame_of(layer.position);
        layer.planes.into_iter().map(move |(name, plane)| (name, plane, frame))
    };
    Ok(layers.into_iter().flat_map(placed).collect())
}

/// What a file states of all its layers.
struct Head {
    /// The display window's first column and row.
    display: (i64, i64),
    /// Its size, and how wide its samples are.
    frame: Frame,
    /// Those of its primaries and white, where they are not sRGB's.
    chromaticities: Option<Chromaticities>,
}

impl Head {
    /// The display window, and where in it samples at this position begin.
    fn frame_of(&self, position: (i64, i64)) -> Frame {
        Frame { x0: position.0 - self.display.0, y0: position.1 - self.display.1, ..self.frame }
    }
}

/// A layer, its channels as single floats.
struct RawLayer {
    name: String,
    /// Which of several eyes sees it.
    view: Option<String>,
    attributes: Attributes,
    planes: Vec<(String, Array2<f32>)>,
    /// Rows and columns.
    size: (usize, usize),
    /// The first column and row of the data window.
    position: (i64, i64),
}

impl RawLayer {
    /// Puts the name of the layer before those of its channels that have none; a layer that is called like a band is that band.
    fn name_channels(&mut self) {
        if band_name::parse(&self.name).is_some() && self.planes.len() == 1 {
            self.planes[0].0.clone_from(&self.name);
            return;
        }
        // A part that is called as its channel is.
        if let [(name, _)] = &self.planes[..]
            && name.eq_ignore_ascii_case(&self.name)
        {
            return;
        }
        let layer = self.name.as_str();
        for (name, _) in &mut self.planes {
            if !layer.is_empty() && !name.contains('.') && band_name::parse(name).is_none() {
                *name = format!("{layer}.{name}");
            }
        }
    }

    fn has_bands(&self) -> bool {
        let is_band = band_name::parse(&self.name).is_some() && self.planes.len() == 1;
        is_band || self.planes.iter().any(|(name, _)| band_name::parse(name).is_some())
    }

    /// Sorts the channels into an image, `Z` and `distance`, which are as they stand.
    fn into_image(self, path: &Path) -> Result<Parts, SceneError> {
        let mut channels = Stated::new("channel", self.planes);
        let bands = channels.take_all(|name| band_name::parse(name).is_some());
        Ok((image_of(path, &self.attributes, bands)?, channels.take("Z"), channels.take("distance")))
    }
}

/// Returns the image of channels that are bands, its samples as they stand, in watts where they are light.
fn image_of(
    path: &Path,
    attributes: &Attributes,
    channels: Vec<(String, Array2<f32>)>,
) -> Result<SpectralImage, SceneError> {
    let mut kinds = HashMap::new();
    let mut bands = Vec::new();
    for (name, plane) in channels {
        if let Some((kind, wavelength_nm)) = band_name::parse(&name) {
            kinds.entry(kind == BandKind::Emissive).or_insert_with(|| name.clone());
            bands.push((wavelength_nm, name, plane));
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
    let unit = match &attributes.unit {
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
    SpectralImage::new(quantity, grid, planes).map_err(values)
}

type Parts = (SpectralImage, Option<Array2<f32>>, Option<Array2<f32>>);

/// Reads all layers; at least one.
fn read_layers(path: &Path) -> Result<(Head, Vec<RawLayer>), SceneError> {
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
    let window = image.attributes.display_window;
    let aspect = f64::from(image.attributes.pixel_aspect);
    if !(aspect.is_finite() && aspect > 0.0) {
        return Err(unreadable(path, format!("its pixelAspectRatio is {aspect}, expected a number above 0")));
    }
    let head = Head {
        display: (window.position.0.into(), window.position.1.into()),
        frame: Frame { columns: window.size.0, rows: window.size.1, x0: 0, y0: 0, aspect },
        chromaticities: image.attributes.chromaticities.filter(|own| !are_srgb(own)),
    };
    Ok((head, layers))
}

fn raw_layer(path: &Path, layer: Layer<AnyChannels<FlatSamples>>) -> Result<RawLayer, SceneError> {
    let (columns, rows) = (layer.size.0, layer.size.1);
    let planes: Result<Vec<_>, _> =
        layer.channel_data.list.into_iter().map(|channel| plane_of(path, channel, rows, columns)).collect();
    let position = layer.attributes.layer_position;
    Ok(RawLayer {
        size: (rows, columns),
        position: (position.0.into(), position.1.into()),
        name: layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default(),
        view: layer.attributes.view_name.as_ref().map(ToString::to_string),
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
