//! Reading spectral OpenEXR in the layout of Fichet, Pacanowski and Wilkie (2021) and its relatives, with depth.

use std::{collections::HashMap, path::Path};

use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use exr::meta::attribute::EnvironmentMap;
use ndarray::Array2;

use super::{
    band_name::{self, BandKind},
    exr_attributes::{Attributes, WHITE, is_harmless},
    exr_colors::{ColorsOf, EXPECTED, colors_of, is_called_picture, srgb_from, srgb_from_xyz},
    exr_depth,
    exr_layers::{HIDDEN_LAYER, Head, RawLayer, leave_other_views, read_headers, read_layers, split_layers},
    light_unit::LightUnit,
    primaries::into_srgb,
    raw_depth::RawDepth,
    reading::{DepthKind, Frame, Panorama},
    stated::{Noted, Stated, name_of, note_of},
    unusable::unreadable,
    wavelength_unit::PLAUSIBLE_NM,
};
use crate::{HiddenLayer, SceneError, SceneLight, View};

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
    /// The light on a scene, where the file states it.
    pub light: Option<SceneLight>,
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
pub fn read_spectral_exr(path: &Path) -> Result<Noted<SpectralFile>, SceneError> {
    let asked = AskedChannels { texts: &TEXTS, ..AskedChannels::default() };
    let RawFile { image, depth, view, hidden, panorama, frame, light, mut notes } = read_raw_exr(path, asked)?;
    if (frame.aspect - 1.0).abs() > 1e-6 {
        notes.push(format!(
            "{}: its samples are {} times as wide as high, which is not used",
            name_of(path),
            frame.aspect
        ));
    }
    if panorama.is_some() {
        return Err(unreadable(path, "it is an environment map, expected a picture in perspective"));
    }
    let values = |reason| SceneError::Values { file: path.to_owned(), reason };
    let bands_of = |image: RawImage| match image {
        RawImage::Spectral { image, .. } => image.check_samples().map(|()| image).map_err(values),
        RawImage::Rgb { .. } => Err(SceneError::NoBands { file: path.to_owned(), expected: EXPECTED }),
    };
    let image = bands_of(image)?;
    let hidden = match hidden {
        Some(RawHidden { image, depth }) => {
            Some(HiddenLayer { radiance: bands_of(image)?, depth: DepthMap::new(depth.values).map_err(values)? })
        }
        None => None,
    };
    let is_axial = depth.as_ref().is_none_or(|depth| depth.kind == DepthKind::Axial);
    let map = depth.map(|depth| DepthMap::new(depth.values)).transpose().map_err(values)?;
    let (depth, distance_m) = if is_axial { (map, None) } else { (None, map.map(|map| map.z_m().clone())) };
    Ok(Noted::new(SpectralFile { image, depth, distance_m, view, hidden, light }, notes))
}

/// Attributes of text that runs write into their files of irradiance, which [`read_exr_text`](crate::read_exr_text) reads.
const TEXTS: [&str; 2] = ["illuminant", "lens"];

/// What an EXR file holds, its samples and depths as they stand.
pub(super) struct RawFile {
    pub(super) image: RawImage,
    pub(super) depth: Option<RawDepth>,
    pub(super) view: Option<View>,
    pub(super) frame: Frame,
    /// Whether it says that it is a picture of all directions.
    pub(super) panorama: Option<Panorama>,
    pub(super) light: Option<SceneLight>,
    /// The layer behind.
    pub(super) hidden: Option<RawHidden>,
    /// What of the file is not used.
    pub(super) notes: Vec<String>,
}

/// The picture of an EXR file.
pub(super) enum RawImage {
    /// Light whose unit is not stated is W m⁻² sr⁻¹ nm⁻¹; the words of one that is, by itself or of the first layer.
    Spectral { image: SpectralImage, unit: Option<String> },
    /// Linear red, green and blue of sRGB's primaries, of a file without bands.
    Rgb {
        planes: [Array2<f32>; 3],
        /// The luminance of white, cd/m².
        white_cd_m2: Option<f64>,
    },
}

/// Light, reflectances or colors, and depth of the layer behind.
pub(super) struct RawHidden {
    pub(super) image: RawImage,
    pub(super) depth: RawDepth,
}

/// What is asked for by name of an EXR file.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AskedChannels<'a> {
    /// The channel of the depth.
    pub(super) depth: Option<&'a str>,
    /// The layer of bands, or of red, green and blue.
    pub(super) layer: Option<&'a str>,
    /// Attributes that whoever asks reads besides.
    pub(super) texts: &'a [&'a str],
}

/// Reads an EXR file of bands or, where it has none, of red, green and blue.
///
/// Bands may be in a part each. The depth is the channel told, or `Z`, or that of the view layer whose colors are taken (`….Depth.Z`), or
/// `distance`. Of several views (stereo) that told, or the first, is taken.
pub(super) fn read_raw_exr(path: &Path, asked: AskedChannels<'_>) -> Result<RawFile, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    let (views, layer) = leave_other_views(&mut layers, asked.layer);
    let asked = AskedChannels { layer: layer.as_deref(), ..asked };
    let mut notes: Vec<String> = note_of(path, "view", &views).into_iter().collect();
    let mut layers = split_layers(layers);
    let hidden = layers
        .iter()
        .position(RawLayer::is_behind)
        .filter(|index| layers[*index].has_bands() || asked.layer != Some(HIDDEN_LAYER));
    let hidden = hidden.filter(|_| layers.len() > 1).map(|index| layers.remove(index));
    let panorama = panorama_of(path, &layers, &mut notes);
    let band_layers: Vec<String> = layers
        .iter()
        .filter(|layer| layer.has_bands() && !layer.name.is_empty())
        .map(|layer| format!("'{}'", layer.name))
        .collect();
    let first = joined(path, layers, asked, &mut notes)?;
    let is_layer_told = asked.layer == Some(first.name.as_str());
    let ((rows, columns), position, attributes) = (first.size, first.position, first.attributes);
    let frame = head.frame_of(position);
    let view = attributes.view(columns, rows).map_err(|error| unreadable(path, error))?;
    notes.extend(attributes.note_of_center(path));
    let mut channels = Stated::new("channel", first.planes);
    let bands = channels.take_all(|name| band_name::parse(name).is_some());
    let (image, prefix) = if bands.is_empty() {
        rgb_of(path, (&head, &attributes), &mut channels, asked.layer, &mut notes)?
    } else if let Some(told) = asked.layer.filter(|_| !is_layer_told) {
        let expected = match band_layers.is_empty() {
            true => "in no layer with a name: expected it without --variable".to_owned(),
            false => format!("in {}: expected one of them (--variable), not '{told}'", band_layers.join(", ")),
        };
        return Err(unreadable(path, format!("it has spectral bands, {expected}")));
    } else {
        let image = image_of(path, &attributes, bands)?;
        notes.extend(attributes.note_of_unit(path).filter(|_| image.quantity() != Quantity::Reflectance));
        // Bands say themselves how bright they are.
        let white = attributes.white_cd_m2.map(|_| WHITE.to_owned());
        notes.extend(note_of(path, "attribute", white.as_slice()));
        let image = match attributes.pitch_um {
            Some(pitch_um) => image.with_pitch_um(pitch_um),
            None => image,
        };
        // A preview of the bands.
        channels.take_all(|name| ["R", "G", "B"].contains(&name));
        (RawImage::Spectral { image, unit: attributes.told_unit() }, String::new())
    };
    let depth = depth_of(path, &mut channels, &prefix, asked.depth, &mut notes)?;
    // Opacity of 1 everywhere is none.
    let opacity = if prefix.is_empty() { "A".to_owned() } else { format!("{prefix}.A") };
    if channels.get(&opacity).is_some_and(|plane| plane.iter().all(|v| *v == 1.0)) {
        channels.take(&opacity);
    }
    let is_behind =
        channels.names().any(|name| name.strip_prefix(HIDDEN_LAYER).is_some_and(|rest| rest.starts_with('.')));
    notes.extend(channels.note(path, |_| false));
    if is_behind && hidden.is_none() {
        let expected = "a layer 'hidden' has bands (S0.… or T.…), or R, G and B, and a channel Z to be what lies behind, or is a file of its \
                        own (--hidden)";
        notes.push(format!("{}: {expected}", name_of(path)));
    }
    let hidden = match hidden {
        Some(layer) if layer.position != position => {
            return Err(unreadable(
                path,
                "its layer 'hidden' lies elsewhere in the picture than its first, expected it there",
            ));
        }
        Some(mut layer) => {
            layer.attributes.inherit(&attributes);
            let kind = "attribute of the layer 'hidden'";
            notes.extend(note_of(path, kind, &attributes.other_of(&layer.attributes)));
            Some(hidden_of(path, &head, layer, &mut notes)?)
        }
        None => None,
    };
    let light = attributes.light.map_err(|reason| unreadable(path, format!("its sceneLight cannot be: {reason}")))?;
    Ok(RawFile { image, depth, view, frame, panorama, light, hidden, notes })
}

/// Returns of what kind the picture is, where the file says that it is one of all directions.
fn panorama_of(path: &Path, layers: &[RawLayer], notes: &mut Vec<String>) -> Option<Panorama> {
    match layers.iter().find_map(|layer| layer.attributes.environment)? {
        EnvironmentMap::LatitudeLongitude => {
            notes.push(format!(
                "{}: its pixels are taken as areas of equal angles; envmap of its header puts the outermost on the edges, half a pixel \
                 away",
                name_of(path)
            ));
            Some(Panorama::Equirectangular { yaw_deg: 0.0, pitch_deg: 0.0 })
        }
        EnvironmentMap::Cube => Some(Panorama::Cube { yaw_deg: 0.0, pitch_deg: 0.0 }),
    }
}

/// Returns the layer of bands that is asked for, or else that with bands, or else that of the colors of a picture, with the channels of others of the same samples; of several the largest,
/// of as large ones the first. The names of others are told, as are those of parts whose bands are there already, and what headers state that
/// nobody knows.
///
/// # Errors
/// When as large layers have the same bands, none of which is the picture by its name.
fn joined(
    path: &Path,
    mut layers: Vec<RawLayer>,
    asked: AskedChannels<'_>,
    notes: &mut Vec<String>,
) -> Result<RawLayer, SceneError> {
    let has_bands = layers.iter().any(RawLayer::has_bands);
    let rank = |layer: &RawLayer| {
        let is_picture = layer.name.is_empty() || is_called_picture(&layer.name);
        let has_colors = !has_bands && layer.has_colors();
        let is_told = layer.has_bands() && asked.layer == Some(layer.name.as_str());
        let is_picture = is_picture && (has_colors || layer.has_bands());
        (is_told, layer.has_bands(), has_colors, is_picture, layer.size.0 * layer.size.1)
    };
    // Of equals the last is the greatest: the first in the order turned round.
    let index = (0..layers.len()).rev().max_by_key(|index| rank(&layers[*index]));
    let mut first = layers.remove(index.unwrap_or(0));
    let (mut unused, mut stated) = (vec![], first.attributes.others.clone());
    let wavelengths =
        |layer: &RawLayer| layer.planes.iter().filter_map(|(name, _)| band_name::parse(name)).collect::<Vec<_>>();
    let repeats =
        |layer: &RawLayer, own: &RawLayer| wavelengths(layer).iter().any(|band| wavelengths(own).contains(band));
    let is_told = first.has_bands() && asked.layer == Some(&first.name);
    let is_picture = first.name.is_empty() || is_called_picture(&first.name) || is_told;
    let alike = layers.iter().filter(|layer| layer.size == first.size && repeats(layer, &first));
    let alike: Vec<String> = std::iter::once(&first).chain(alike).map(|layer| format!("'{}'", layer.name)).collect();
    if has_bands && !is_picture && alike.len() > 1 {
        let reason =
            format!("it has several layers of bands, {}: expected --variable with the name of one", alike.join(", "));
        return Err(unreadable(path, reason));
    }
    if !has_bands {
        first.name_channels();
    }
    let mut joined = vec![];
    for mut layer in layers {
        let is_other = is_told && layer.has_bands();
        if is_other || repeats(&layer, &first) || (layer.size, layer.position) != (first.size, first.position) {
            unused.push(layer.name);
        } else {
            if layer.has_bands() && layer.attributes.unit != first.attributes.unit {
                let reason = format!("its part '{}' states another emissiveUnits than the first", layer.name);
                return Err(SceneError::Units { file: path.to_owned(), reason });
            }
            let kind = "attribute of its further parts";
            notes.extend(note_of(path, kind, &first.attributes.other_of(&layer.attributes)));
            stated.merge(layer.attributes.others.clone());
            joined.extend((wavelengths(&layer).len() > 1).then(|| format!("'{}'", layer.name)));
            layer.name_channels();
            first.planes.append(&mut layer.planes);
        }
    }
    notes.extend((!joined.is_empty()).then(|| {
        format!(
            "{}: the bands of its layers '{}' and {} are taken for one cube (--variable takes those of one)",
            name_of(path),
            first.name,
            joined.join(", ")
        )
    }));
    notes.extend(stated.note(path, |name| is_harmless(name) || asked.texts.contains(&name)));
    notes.extend(note_of(path, "part", &unused));
    Ok(first)
}

/// Takes the depth that belongs to the colors of a layer, or that of the name told.
fn depth_of(
    path: &Path,
    channels: &mut Stated<Array2<f32>>,
    prefix: &str,
    told: Option<&str>,
    notes: &mut Vec<String>,
) -> Result<Option<RawDepth>, SceneError> {
    let found = match told {
        None => exr_depth::depth_name(channels.names(), prefix),
        Some(told) if channels.get(told).is_some() => Some((told.to_owned(), exr_depth::kind_of(told))),
        Some(told) => {
            let names = channels.names().collect::<Vec<_>>().join(", ");
            let expected = if names.is_empty() { "no other is left beside its colors" } else { "expected one of " };
            let reason = format!("it has no channel '{told}' for its depth (--depth-variable): {expected}{names}");
            return Err(unreadable(path, reason));
        }
    };
    let Some((name, kind)) = found else { return Ok(None) };
    notes.extend(exr_depth::note_of_kind(path, &name));
    Ok(channels.take(&name).map(|values| RawDepth::in_file(path, format!("channel '{name}'"), values, kind)))
}

/// Takes linear red, green and blue, in the primaries of sRGB, of the layer told or of a picture, and what stands before their letters.
fn rgb_of(
    path: &Path,
    (head, attributes): (&Head, &Attributes),
    channels: &mut Stated<Array2<f32>>,
    told: Option<&str>,
    notes: &mut Vec<String>,
) -> Result<(RawImage, String), SceneError> {
    let (prefix, what, mut planes) = colors_of(path, channels, told)?;
    if what == ColorsOf::Xyz {
        into_srgb(&mut planes, &srgb_from_xyz());
        let what =
            "channels X, Y and Z are taken for CIE XYZ under D65, whose white has a Y of 1: they become linear sRGB";
        notes.push(format!("{}: its {what}", name_of(path)));
        let unused = head.chromaticities.as_ref().map(|_| "chromaticities".to_owned());
        notes.extend(note_of(path, "attribute", unused.as_slice()));
    } else if let Some(own) = &head.chromaticities {
        let no_colors = || unreadable(path, "its chromaticities are no three primaries and a white");
        into_srgb(&mut planes, &srgb_from(own).ok_or_else(no_colors)?);
        let note = format!("{}: its primaries become those of sRGB, its white D65", name_of(path));
        notes.extend(Some(note).filter(|note| !notes.contains(note)));
    }
    Ok((RawImage::Rgb { planes, white_cd_m2: attributes.white_cd_m2 }, prefix))
}

/// Returns light, or colors, and depth of the layer behind; what else it has is named.
fn hidden_of(path: &Path, head: &Head, layer: RawLayer, notes: &mut Vec<String>) -> Result<RawHidden, SceneError> {
    let mut channels = Stated::new("channel of the layer 'hidden'", layer.planes);
    let z_m = channels.take("Z").ok_or_else(|| unreadable(path, "the layer 'hidden' has no channel 'Z'"))?;
    let bands = channels.take_all(|name| band_name::parse(name).is_some());
    let image = if bands.is_empty() {
        rgb_of(path, (head, &layer.attributes), &mut channels, None, notes)?.0
    } else {
        let image = image_of(path, &layer.attributes, bands)?;
        let unit = layer.attributes.note_of_unit(path).filter(|_| image.quantity() != Quantity::Reflectance);
        notes.extend(unit.filter(|note| !notes.contains(note)));
        channels.take_all(|name| ["R", "G", "B"].contains(&name));
        RawImage::Spectral { image, unit: layer.attributes.told_unit() }
    };
    // Opacity of 1 everywhere is none.
    if channels.get("A").is_some_and(|plane| plane.iter().all(|v| *v == 1.0)) {
        channels.take("A");
    }
    notes.extend(channels.note(path, |_| false));
    let attributes = layer.attributes.others.note(path, is_harmless);
    notes.extend(attributes.map(|note| format!("{note} (of the layer 'hidden')")));
    let depth = RawDepth::in_file(path, "channel 'Z' of the layer 'hidden'".to_owned(), z_m, DepthKind::Axial);
    Ok(RawHidden { image, depth })
}

/// Planes of samples, each with the name of its channel.
pub type NamedPlanes = Vec<(String, Array2<f32>)>;

/// Reads every channel of an EXR file's first layer as single floats, by name.
///
/// # Errors
/// When the file is truncated, too large or no EXR.
pub fn read_planes_exr(path: &Path) -> Result<Noted<NamedPlanes>, SceneError> {
    Ok(read_planes_and_primaries_exr(path)?.map(|(planes, _)| planes))
}

/// The channels of an EXR file by name, and the matrix from its primaries to linear sRGB.
pub(super) type PlanesAndPrimaries = (NamedPlanes, Option<[[f64; 3]; 3]>);

/// Reads the same, with the matrix from the primaries that the file states to linear sRGB; none where they are those of sRGB.
pub(super) fn read_planes_and_primaries_exr(path: &Path) -> Result<Noted<PlanesAndPrimaries>, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    let has_colors = |planes: &[(String, Array2<f32>)]| planes.iter().any(|(name, _)| name == "R");
    let layer = layers.remove(0);
    let own = head.chromaticities.filter(|_| has_colors(&layer.planes));
    let no_colors = || unreadable(path, "its chromaticities are no three primaries and a white");
    let matrix = own.map(|own| srgb_from(&own).ok_or_else(no_colors)).transpose()?;
    Ok(Noted::new((layer.planes, matrix), notes_on_planes_exr(path)?))
}

/// Returns what of the headers of an EXR file [`read_planes_exr`] does not use, a sentence each.
pub(super) fn notes_on_planes_exr(path: &Path) -> Result<Vec<String>, SceneError> {
    let mut parts = read_headers(path)?.into_iter();
    let first = parts
        .next()
        .and_then(|(_, attributes)| attributes.others.note(path, |name| is_harmless(name) || TEXTS.contains(&name)));
    let others: Vec<String> = parts.map(|(name, _)| name).collect();
    Ok(first.into_iter().chain(note_of(path, "part", &others)).collect())
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
        return units(format!(
            "it has channels of light ('{light}') and of reflectance ('{reflectance}'), expected those of one quantity"
        ));
    }
    if let Some((nm, name, _)) = bands.iter().find(|(nm, ..)| !PLAUSIBLE_NM.contains(nm)) {
        return units(format!("its channel '{name}' lies at {nm} nm, which is no wavelength of light"));
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
