//! Reading spectral OpenEXR in the layout of Fichet, Pacanowski and Wilkie (2021) and its relatives, with depth.

use std::{collections::HashMap, fs::File, io::BufReader, path::Path};

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid, Xyz, adapt_bradford};
use exr::{
    meta::{
        MetaData,
        attribute::{Chromaticities, EnvironmentMap},
    },
    prelude::{AnyChannel, AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers, SampleType, read},
};
use glam::{DMat3, DVec3};
use ndarray::Array2;

use super::{
    band_name::{self, BandKind},
    exr_attributes::{self, Attributes},
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
    let RawFile { image, depth, view, hidden, panorama, .. } = read_raw_exr(path)?;
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
/// Bands may be in a part each. The depth is `Z`, or that of the view layer whose colors are taken (`….Depth.Z`), or `distance`.
pub(super) fn read_raw_exr(path: &Path) -> Result<RawFile, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    let hidden = layers.iter().position(|layer| layer.name == HIDDEN_LAYER && layer.has_bands());
    let hidden = hidden.filter(|_| layers.len() > 1).map(|index| layers.remove(index));
    let panorama = match layers.iter().find_map(|layer| layer.attributes.environment) {
        None => None,
        Some(EnvironmentMap::LatitudeLongitude) => Some(Panorama::Equirectangular { yaw_deg: 0.0, pitch_deg: 0.0 }),
        Some(EnvironmentMap::Cube) => Some(Panorama::Cube { yaw_deg: 0.0, pitch_deg: 0.0 }),
    };
    let mut notes = vec![];
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
    notes.extend(attributes.others.clone().note(path, exr_attributes::is_harmless));
    // Parts of the same samples belong to one picture; of others, and of bands that are there already, the names are told.
    let mut unused = vec![];
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
            layer.name_channels();
            first.planes.append(&mut layer.planes);
        }
    }
    notes.extend(note_of(path, "part", &unused));
    let (rows, columns) = size;
    let frame = Frame { x0: position.0 - head.display.0, y0: position.1 - head.display.1, ..head.frame };
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
    let depth = depth_name(channels.names(), &prefix).and_then(|(name, kind)| {
        let values = channels.take(&name)?;
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

/// Takes red, green and blue: `R`, `G` and `B`, or those of a layer, Blender's `….Combined` before others; or gray, `Y`. Returns
/// them with what stands before their letters.
fn colors_of(channels: &mut Stated<Array2<f32>>) -> Option<(String, [Array2<f32>; 3])> {
    let names: Vec<String> = channels.names().map(str::to_owned).collect();
    let full =
        |prefix: &str, letter: &str| if prefix.is_empty() { letter.to_owned() } else { format!("{prefix}.{letter}") };
    let prefixes: Vec<&str> = names
        .iter()
        .filter_map(|name| match name.as_str() {
            "R" => Some(""),
            name => name.strip_suffix(".R"),
        })
        .filter(|prefix| ["G", "B"].iter().all(|letter| names.contains(&full(prefix, letter))))
        .collect();
    let last = |prefix: &str| prefix.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    let is_beauty =
        |prefix: &&&str| ["combined", "rgb", "rgba", "color", "beauty", "image"].contains(&last(prefix).as_str());
    let prefix = prefixes.iter().find(|prefix| prefix.is_empty()).or_else(|| prefixes.iter().find(is_beauty));
    let prefix = prefix.or_else(|| prefixes.first().filter(|_| prefixes.len() == 1)).map(|prefix| (*prefix).to_owned());
    if let Some(prefix) = prefix {
        let mut take = |letter| channels.take(&full(&prefix, letter));
        let planes = [take("R")?, take("G")?, take("B")?];
        return Some((prefix, planes));
    }
    let has_chroma = ["RY", "BY"].iter().any(|name| channels.get(name).is_some());
    let gray = if has_chroma { None } else { channels.take("Y") }?;
    Some((String::new(), [gray.clone(), gray.clone(), gray]))
}

/// Returns the channel of depth that belongs to the colors of a layer, and what it counts.
fn depth_name<'a>(names: impl Iterator<Item = &'a str>, prefix: &str) -> Option<(String, DepthKind)> {
    let names: Vec<&str> = names.collect();
    let mut wanted = vec![];
    if let Some(layer) = prefix.strip_suffix("Combined") {
        wanted.extend(["Z", "V"].map(|letter| format!("{layer}Depth.{letter}")));
    } else if !prefix.is_empty() {
        wanted.push(format!("{prefix}.Z"));
    }
    wanted.extend(["Z", "depth.Z", "Depth.Z", "depth.V", "Depth.V", "depth.Y", "Depth.Y"].map(str::to_owned));
    if let Some(name) = wanted.into_iter().find(|name| names.contains(&name.as_str())) {
        return Some((name, DepthKind::Axial));
    }
    if prefix.is_empty() {
        let is_depth = |name: &&&str| name.ends_with(".Depth.Z") || name.ends_with(".Depth.V");
        let found: Vec<&&str> = names.iter().filter(is_depth).collect();
        if let [one] = found[..] {
            return Some(((*one).to_owned(), DepthKind::Axial));
        }
    }
    names.contains(&"distance").then(|| ("distance".to_owned(), DepthKind::Radial))
}

/// Returns the channel of depth of a file of depth alone, with its name and the names of the others.
pub(super) fn depth_channel(planes: Vec<(String, Array2<f32>)>) -> Option<(String, Array2<f32>, Vec<String>)> {
    let mut channels = Stated::new("channel", planes);
    let only = || {
        let names: Vec<&str> = channels.names().collect();
        match names[..] {
            [one] => Some(one.to_owned()),
            // A gray picture that was saved as a colored one.
            _ if ["R", "G", "B"].iter().all(|name| names.contains(name)) => Some("R".to_owned()),
            _ => None,
        }
    };
    let name = depth_name(channels.names(), "").map(|(name, _)| name).or_else(only)?;
    let plane = channels.take(&name)?;
    if name == "R" {
        let is_same = |own: Option<&Array2<f32>>| own == Some(&plane);
        if !(is_same(channels.get("G")) && is_same(channels.get("B"))) {
            return None;
        }
        channels.take_all(|name| name == "G" || name == "B");
    }
    let others = channels.names().filter(|name| *name != "A").map(str::to_owned).collect();
    Some((name, plane, others))
}

/// Returns the matrix from colors of these primaries to linear sRGB, their white adapted to D65 (Bradford).
pub(super) fn srgb_from(own: &Chromaticities) -> Option<[[f64; 3]; 3]> {
    let xyz = |p: exr::prelude::Vec2<f32>| {
        let (x, y) = (f64::from(p.0), f64::from(p.1));
        let is_color = x.is_finite() && y.is_finite() && y.abs() > 1e-6;
        is_color.then(|| [x / y, 1.0, (1.0 - x - y) / y])
    };
    let [r, g, b, w] = [xyz(own.red)?, xyz(own.green)?, xyz(own.blue)?, xyz(own.white)?];
    let primaries = DMat3::from_cols(DVec3::from(r), DVec3::from(g), DVec3::from(b));
    if primaries.determinant().abs() < 1e-9 || w.iter().any(|v| *v <= 0.0) {
        return None;
    }
    let shares = primaries.inverse() * DVec3::from(w);
    let d65 = Xyz::from_linear_srgb([1.0; 3]);
    let columns = [r, g, b]
        .into_iter()
        .zip(shares.to_array())
        .map(|(primary, share)| adapt_bradford(Xyz(primary.map(|v| v * share)), Xyz(w), d65).to_linear_srgb());
    let columns: Vec<[f64; 3]> = columns.collect();
    Some([0, 1, 2].map(|i| [columns[0][i], columns[1][i], columns[2][i]]))
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

/// What a file states of all its layers.
struct Head {
    /// The display window's first column and row.
    display: (i64, i64),
    /// Its size, and how wide its samples are.
    frame: Frame,
    /// Those of its primaries and white, where they are not sRGB's.
    chromaticities: Option<Chromaticities>,
}

/// A layer, its channels as single floats.
struct RawLayer {
    name: String,
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

/// Whether primaries and white are those of sRGB, to the digits that writers have.
fn are_srgb(own: &Chromaticities) -> bool {
    let pairs =
        [(own.red, [0.64, 0.33]), (own.green, [0.30, 0.60]), (own.blue, [0.15, 0.06]), (own.white, [0.3127, 0.329])];
    pairs.iter().all(|(own, srgb)| (own.0 - srgb[0]).abs() < 1e-3 && (own.1 - srgb[1]).abs() < 1e-3)
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

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use exr::prelude::Vec2;

    use super::*;

    #[test]
    fn acescg_becomes_srgb_by_the_published_matrix() {
        let ap1 = Chromaticities {
            red: Vec2(0.713, 0.293),
            green: Vec2(0.165, 0.830),
            blue: Vec2(0.128, 0.044),
            white: Vec2(0.32168, 0.33767),
        };
        // AP1 to linear Rec. 709 with Bradford's adaptation, as the ACES documents and colour-science give it.
        let published = [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]];
        for (row, expected) in srgb_from(&ap1).unwrap().iter().zip(published) {
            for (value, expected) in row.iter().zip(expected) {
                // Four digits of the chromaticities.
                assert_abs_diff_eq!(*value, expected, epsilon = 3e-4);
            }
        }
        let srgb = Chromaticities {
            red: Vec2(0.64, 0.33),
            green: Vec2(0.30, 0.60),
            blue: Vec2(0.15, 0.06),
            white: Vec2(0.3127, 0.3290),
        };
        assert!(are_srgb(&srgb) && !are_srgb(&ap1));
        assert!(srgb_from(&Chromaticities { red: srgb.green, ..srgb }).is_none());
    }

    #[test]
    fn depth_is_that_of_the_colors() {
        let check = |names: &[&str], prefix: &str, expected: Option<&str>| {
            let found = depth_name(names.iter().copied(), prefix).map(|(name, _)| name);
            assert_eq!(found.as_deref(), expected, "{names:?}");
        };
        check(&["A.Depth.Z", "B.Depth.Z"], "B.Combined", Some("B.Depth.Z"));
        check(&["A.Depth.Z", "B.Denoising Depth.Z"], "B.Combined", None);
        check(&["V.Denoising Depth.Z", "V.Depth.V"], "V.Combined", Some("V.Depth.V"));
        check(&["A.Depth.Z", "B.Depth.Z"], "", None);
        check(&["A.Depth.Z", "A.Noisy.R"], "", Some("A.Depth.Z"));
        check(&["distance", "Z"], "", Some("Z"));
    }

    #[test]
    fn colors_are_the_picture_not_another_pass() {
        let take = |names: &[&str]| {
            let planes = names.iter().map(|name| ((*name).to_owned(), Array2::zeros((1, 1)))).collect();
            let mut channels = Stated::new("channel", planes);
            colors_of(&mut channels)
                .map(|(prefix, _)| (prefix, channels.names().map(str::to_owned).collect::<Vec<_>>()))
        };
        let pass = |pass: &str| ["R", "G", "B"].map(|letter| format!("{pass}.{letter}"));
        let both = [pass("V.Noisy Image"), pass("V.Combined")].concat();
        let names: Vec<&str> = both.iter().map(String::as_str).collect();
        let (prefix, left) = take(&names).unwrap();
        assert_eq!((prefix.as_str(), left.len()), ("V.Combined", 3));
        assert_eq!(take(&["Y"]).unwrap().0, "");
        assert!(take(&["Y", "RY", "BY"]).is_none() && take(&["R", "G"]).is_none());
        // Of two passes neither of which is called a picture none is chosen.
        let two = [pass("x"), pass("y")].concat();
        assert!(take(&two.iter().map(String::as_str).collect::<Vec<_>>()).is_none());
    }
}
