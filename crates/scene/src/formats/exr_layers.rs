//! The layers of EXR files: their channels as single floats, and what their headers state.

use std::{fs::File, io::BufReader, path::Path};

use exr::{
    meta::{MetaData, attribute::Chromaticities},
    prelude::{AnyChannel, AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers, SampleType, read},
};
use ndarray::Array2;

use super::{
    band_name,
    exr_attributes::{self, Attributes, words_of},
    exr_colors::are_srgb,
    reading::Frame,
    stated::{Noted, Stated},
    unusable::{check_memory, fault, unreadable},
};
use crate::SceneError;

/// The name of the layer that holds what lies behind the first surface.
pub(crate) const HIDDEN_LAYER: &str = "hidden";

/// The most columns, and rows, of a picture.
const MOST_SAMPLES: usize = 1 << 20;

/// What a file states of all its layers.
pub(super) struct Head {
    /// The display window's first column and row.
    display: (i64, i64),
    /// Its size, and how wide its samples are.
    frame: Frame,
    /// Those of its primaries and white, where they are not sRGB's.
    pub(super) chromaticities: Option<Chromaticities>,
}

impl Head {
    /// The display window, and where in it samples at this position begin.
    pub(super) fn frame_of(&self, position: (i64, i64)) -> Frame {
        Frame { x0: position.0 - self.display.0, y0: position.1 - self.display.1, ..self.frame }
    }
}

/// A layer, its channels as single floats.
pub(super) struct RawLayer {
    pub(super) name: String,
    /// Which of several eyes sees it.
    view: Option<String>,
    pub(super) attributes: Attributes,
    pub(super) planes: Vec<(String, Array2<f32>)>,
    /// Rows and columns.
    pub(super) size: (usize, usize),
    /// The first column and row of the data window.
    pub(super) position: (i64, i64),
}

impl RawLayer {
    /// Gives the one channel beside opacity and depth of a layer that is called like a band the name of that band, where it has none of its own.
    fn name_band(&mut self) {
        if band_name::parse(&self.name).is_none() {
            return;
        }
        let mut own = self.planes.iter_mut().filter(|(name, _)| !["A", "Z"].contains(&name.as_str()));
        if let (Some((name, _)), None) = (own.next(), own.next())
            && band_name::parse(name).is_none()
        {
            name.clone_from(&self.name);
        }
    }

    /// Puts the name of the layer before those of its channels that have none.
    pub(super) fn name_channels(&mut self) {
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

    /// Whether it has red, or gray.
    pub(super) fn has_colors(&self) -> bool {
        self.planes.iter().any(|(name, _)| ["R", "Y"].contains(&name.rsplit('.').next().unwrap_or_default()))
    }

    pub(super) fn has_bands(&self) -> bool {
        self.planes.iter().any(|(name, _)| band_name::parse(name).is_some())
    }

    /// Whether it is what lies behind the first surface: bands, or colors and a depth, under that name.
    pub(super) fn is_behind(&self) -> bool {
        let has_depth = self.planes.iter().any(|(name, _)| name == "Z");
        self.name == HIDDEN_LAYER && (self.has_bands() || self.has_colors() && has_depth)
    }

    /// Splits off what stands behind the name of a layer of bands and a point, as `a.S0.550nm` and `a.Z` of `a`, and colors that lie
    /// behind the first surface.
    fn split(mut self) -> Vec<Self> {
        let mut names: Vec<String> = vec![];
        let has = |letter: &str| self.planes.iter().any(|(name, _)| *name == format!("{HIDDEN_LAYER}.{letter}"));
        if has("Z") && (["R", "G", "B"].iter().all(|letter| has(letter)) || has("Y")) {
            names.push(HIDDEN_LAYER.to_owned());
        }
        for prefix in self.planes.iter().filter_map(|(name, _)| band_name::layer_of(name)) {
            if names.iter().all(|own| own != prefix) {
                names.push(prefix.to_owned());
            }
        }
        let mut parts = vec![];
        for layer in names {
            let rest = |name: &str| name.strip_prefix(&layer)?.strip_prefix('.').map(str::to_owned);
            let (inner, outer): (Vec<_>, Vec<_>) =
                std::mem::take(&mut self.planes).into_iter().partition(|(name, _)| rest(name).is_some());
            self.planes = outer;
            let planes = inner.into_iter().map(|(name, plane)| (rest(&name).unwrap_or(name), plane)).collect();
            // What is stated beside is named once, of the part.
            let attributes = self.attributes.known();
            let (view, size, position) = (self.view.clone(), self.size, self.position);
            parts.push(Self { name: layer, view, attributes, planes, size, position });
        }
        if self.planes.is_empty()
            && let Some(first) = parts.first_mut()
        {
            first.attributes = self.attributes;
            return parts;
        }
        std::iter::once(self).chain(parts).collect()
    }
}

/// Splits parts that have layers of bands into these.
pub(super) fn split_layers(layers: Vec<RawLayer>) -> Vec<RawLayer> {
    layers.into_iter().flat_map(RawLayer::split).collect()
}

/// Leaves the layers of the view that is told by its name or by that of one of its layers, or else of the first, and those of none. Returns the names of the
/// other views, and the layer that is still asked for.
pub(super) fn leave_other_views(layers: &mut Vec<RawLayer>, told: Option<&str>) -> (Vec<String>, Option<String>) {
    let is_told =
        |layer: &&RawLayer| told.is_some_and(|told| layer.view.as_deref() == Some(told) || layer.name == told);
    // What is told may be in no view.
    let of_told = layers.iter().find(is_told).and_then(|layer| layer.view.clone());
    let first = of_told.clone().or_else(|| layers.iter().find_map(|layer| layer.view.clone()));
    let is_other = |layer: &RawLayer| layer.view.is_some() && layer.view != first;
    let mut others: Vec<String> =
        layers.iter().filter(|layer| is_other(layer)).filter_map(|layer| layer.view.clone()).collect();
    others.dedup();
    layers.retain(|layer| !is_other(layer));
    let asked = layers.iter().position(|layer| Some(layer.name.as_str()) == told);
    // Parts of a view are named after it, as `left` or `depth.left`, which its channels need not be.
    for layer in layers.iter_mut() {
        let Some(view) = &layer.view else { continue };
        let rest = layer.name.strip_suffix(view.as_str()).map(|rest| rest.trim_end_matches(['.', '_']).to_owned());
        layer.name = rest.unwrap_or_else(|| layer.name.clone());
    }
    // The only layer of a view needs no name.
    let asked = match (of_told, asked) {
        (Some(_), Some(index)) if layers.len() > 1 => Some(layers[index].name.clone()).filter(|name| !name.is_empty()),
        (Some(_), _) => None,
        (None, _) => told.map(str::to_owned),
    };
    (others, asked)
}

/// Reads all layers; at least one.
pub(super) fn read_layers(path: &Path) -> Result<(Head, Vec<RawLayer>), SceneError> {
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
    let mut layers = layers?;
    tell_apart(&mut layers);
    let Some(first) = layers.first_mut() else { return Err(unreadable(path, "it has no layer")) };
    // What the crate takes for an attribute of all layers by its type.
    let of_all = image.attributes.other.keys().map(|name| (words_of(name), ())).collect();
    first.attributes.others.merge(Stated::new("attribute", of_all));
    let window = image.attributes.display_window;
    let aspect = f64::from(image.attributes.pixel_aspect);
    if !(aspect.is_finite() && aspect > 0.0) {
        return Err(unreadable(path, format!("its pixelAspectRatio is {aspect}, expected a number above 0")));
    }
    if window.size.0 > MOST_SAMPLES || window.size.1 > MOST_SAMPLES {
        let reason = format!(
            "its display window is {} × {} samples: expected sides up to {MOST_SAMPLES}",
            window.size.0, window.size.1
        );
        return Err(unreadable(path, reason));
    }
    let head = Head {
        display: (window.position.0.into(), window.position.1.into()),
        frame: Frame { columns: window.size.0, rows: window.size.1, x0: 0, y0: 0, aspect },
        chromaticities: image.attributes.chromaticities.filter(|own| !are_srgb(own)),
    };
    Ok((head, layers))
}

/// Puts the name of its part before each channel that has the name of one of another part seen by the same eye.
fn tell_apart(layers: &mut [RawLayer]) {
    let all: Vec<(usize, Option<String>, String)> = layers
        .iter()
        .enumerate()
        .flat_map(|(i, layer)| layer.planes.iter().map(move |(name, _)| (i, layer.view.clone(), name.clone())))
        .filter(|(i, _, name)| {
            let is_band = band_name::parse(name).is_some() || band_name::layer_of(name).is_some();
            name.contains('.') && !is_band && layers[*i].name != HIDDEN_LAYER
        })
        .collect();
    for (i, layer) in
        layers.iter_mut().enumerate().filter(|(_, layer)| !layer.name.is_empty() && layer.name != HIDDEN_LAYER)
    {
        for (name, _) in &mut layer.planes {
            if all.iter().any(|(own, view, other)| *own != i && *view == layer.view && other == name) {
                *name = format!("{}.{name}", layer.name);
            }
        }
    }
}

fn raw_layer(path: &Path, layer: Layer<AnyChannels<FlatSamples>>) -> Result<RawLayer, SceneError> {
    let (columns, rows) = (layer.size.0, layer.size.1);
    let planes: Result<Vec<_>, _> =
        layer.channel_data.list.into_iter().map(|channel| plane_of(path, channel, rows, columns)).collect();
    let position = layer.attributes.layer_position;
    let mut layer = RawLayer {
        size: (rows, columns),
        position: (position.0.into(), position.1.into()),
        name: layer.attributes.layer_name.as_ref().map(words_of).unwrap_or_default(),
        view: layer.attributes.view_name.as_ref().map(words_of),
        attributes: exr_attributes::from_layer(&layer.attributes),
        planes: planes?,
    };
    layer.name_band();
    Ok(layer)
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
    let name = words_of(&channel.name);
    match Array2::from_shape_vec((rows, columns), samples) {
        Ok(plane) => Ok((name, plane)),
        Err(_) => Err(unreadable(path, format!("channel '{name}' has not {rows} × {columns} samples"))),
    }
}

/// Returns the name of each layer and what its header states.
pub(super) fn read_headers(path: &Path) -> Result<Vec<(String, Attributes)>, SceneError> {
    let meta = MetaData::read_from_file(path, false).map_err(|error| unreadable(path, explain(&error)))?;
    let of = |header: &exr::meta::header::Header| {
        let own = &header.own_attributes;
        (own.layer_name.as_ref().map(words_of).unwrap_or_default(), exr_attributes::from_layer(own))
    };
    Ok(meta.headers.iter().map(of).collect())
}

/// Returns what is wrong with a file whose channels do not stand in their order.
fn unsorted(error: &exr::error::Error) -> Option<String> {
    let is_unsorted = error.to_string().contains("channel names are not sorted");
    is_unsorted.then(|| {
        "its channels do not stand in the order of their names, as OpenEXR has them, so that whose samples are whose is not known: \
         expected it written anew"
            .to_owned()
    })
}

/// Refuses a file whose samples take more memory than they may: as they stand in the file, and as single floats where they are none.
fn guard(path: &Path, file: File) -> Result<(), SceneError> {
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    let meta = MetaData::read_from_buffered(BufReader::new(file), false)
        .map_err(|error| unreadable(path, unsorted(&error).unwrap_or_else(|| explain(&error))))?;
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
    let is_variant = matches!(error, exr::error::Error::NotSupported(_));
    fault("OpenEXR", error, is_variant.then_some("one with scan lines or tiles that are not deep"))
}

/// A channel of a file, with the part of the display window that it has.
pub(super) struct PlacedPlane {
    pub(super) name: String,
    pub(super) plane: Array2<f32>,
    pub(super) frame: Frame,
}

/// Reads all channels of all layers as single floats, by name; what their headers state beside is named.
pub(super) fn read_placed_planes(path: &Path) -> Result<Noted<Vec<PlacedPlane>>, SceneError> {
    let (head, mut layers) = read_layers(path)?;
    if layers.len() > 1 {
        layers.iter_mut().for_each(RawLayer::name_channels);
    }
    let mut stated = Stated::new("attribute", vec![]);
    let mut planes = vec![];
    for layer in layers {
        stated.merge(layer.attributes.others);
        let frame = head.frame_of(layer.position);
        planes.extend(layer.planes.into_iter().map(|(name, plane)| PlacedPlane { name, plane, frame }));
    }
    Ok(Noted::new(planes, stated.note(path, exr_attributes::is_harmless)))
}
