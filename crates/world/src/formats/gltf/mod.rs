//! Worlds of glTF 2.0 files: `.gltf` with its buffers beside it or within, and `.glb`.
//!
//! The JSON is read here and not by a crate that validates it: real files break rules that no picture hangs on, and what a file says that isn't
//! read must be told.

mod accessors;
mod animations;
mod draco;
mod json;
mod materials;
mod meshes;
mod meshopt;
mod own;

use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
    sync::Arc,
};

use base64::{
    alphabet::STANDARD,
    engine::{DecodePaddingMode, Engine, GeneralPurpose, GeneralPurposeConfig},
};
use dioptric_spectrum::Cancel;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::Value;

pub(crate) use self::own::GENERATOR;
use self::{
    accessors::{Rows, Source},
    json::{Left, extension, index, is_read, list, number, number_or, numbers},
};
use super::{ReadOptions, read_bytes};
use crate::{
    CameraKind, Emission, FallOff, GroupId, ImageTexture, Light, MaterialId, SpectralCurve, WorldBuilder, WorldCamera,
    WorldError,
};

/// The most bytes that a file and its buffers may have.
const MAX_BYTES: u64 = 1 << 31;
/// How deep nodes may be nested.
const MAX_DEPTH: usize = 256;
/// Luminous efficacy at 555 nm, lm/W: glTF gives lights in candela and lux.
pub(crate) const LUMENS_PER_WATT: f64 = 683.002;
/// Base64 as files have it, with its padding or without.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Reads the default scene.
pub(super) fn read(
    path: &Path,
    place: DAffine3,
    options: &ReadOptions,
    cancel: &Cancel,
) -> Result<WorldBuilder, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let bytes = read_bytes(path, MAX_BYTES)?;
    let (text, binary) = parts(&bytes).map_err(unreadable)?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let mut root: Value = serde_json::from_slice(text).map_err(|e| match e.line() {
        0 => unreadable(e.to_string()),
        line => WorldError::Line { file: path.to_owned(), line, reason: e.to_string() },
    })?;
    let version = root.get("asset").and_then(|asset| asset.get("version")).and_then(Value::as_str);
    if !version.is_some_and(|version| version.starts_with("2.")) {
        let found = version.map_or("no version".to_owned(), |version| format!("version {version}"));
        return Err(unreadable(format!(
            "its asset has {found}, expected 2.0 of glTF, which gltf-pipeline makes of 1.0"
        )));
    }
    let mut left = Left::out_of(&mut root);
    let moved;
    let mut reader = Reader {
        builder: WorldBuilder::new(),
        root: &root,
        file: path.to_owned(),
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        buffers: Vec::new(),
        unpacked: HashMap::new(),
        materials: HashMap::new(),
        images: HashMap::new(),
        groups: HashMap::new(),
        uses: HashMap::new(),
        globals: HashMap::new(),
        seen: HashSet::new(),
        variant: None,
        n_bytes: bytes.len() as u64,
        own_pictures: Vec::new(),
        is_own: false,
        cancel,
    };
    reader.builder.set_up(DVec3::Y, false);
    reader.builder.add_source(path);
    for (number, buffer) in list(&root, "buffers").iter().enumerate() {
        let data = match buffer.get("uri").and_then(Value::as_str) {
            Some(uri) => reader.resource(uri)?,
            None => binary.filter(|_| number == 0).unwrap_or_default().to_vec(),
        };
        reader.buffers.push(data);
    }
    for (number, view) in list(&root, "bufferViews").iter().enumerate() {
        let packed = extension(view, "KHR_meshopt_compression").or(extension(view, "EXT_meshopt_compression"));
        let Some(packed) = packed else { continue };
        let unpacked = meshopt::unpacked(packed, &reader.buffers);
        let unpacked = unpacked.map_err(|reason| reader.fault(format!("packed buffer view {number} {reason}")))?;
        reader.n_bytes += unpacked.0.len() as u64;
        reader.unpacked.insert(number, unpacked);
    }
    reader.builder.set_choices(reader.choices());
    let pose = reader.pose(options)?;
    if !pose.is_empty() {
        let (mut posed, lost) = animations::posed(&root, &pose);
        lost.iter().for_each(|way| reader.builder.note_of("animations of what isn't there, left out", way));
        left.append(Left::out_of(&mut posed));
        moved = posed;
        reader.root = &moved;
    }
    let variants = &reader.builder.choices().variants;
    reader.variant = options.variant.as_ref().and_then(|name| variants.iter().position(|known| known == name));
    reader.note_left(left);
    reader.read_own()?;
    reader.scene(place)?;
    Ok(reader.builder)
}

/// Returns the JSON and the binary part of a file.
fn parts(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else { return Ok((bytes, None)) };
    let word = |at: usize| rest.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if word(0) != Some(2) {
        return Err(format!("version {} of GLB, expected 2, which gltf-pipeline makes of 1", word(0).unwrap_or(0)));
    }
    let (mut json, mut binary, mut at) = (None, None, 8);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let end = (at + 8).saturating_add(length as usize);
        let chunk = rest.get(at + 8..end).ok_or_else(|| format!("a part of {length} bytes reaches beyond the file"))?;
        match &kind.to_le_bytes() {
            b"JSON" => json = json.or(Some(chunk)),
            b"BIN\0" => binary = binary.or(Some(chunk)),
            _ => {}
        }
        // Lengths are padded by the standard; files that aren't have the next part at once.
        at = end;
    }
    Ok((json.ok_or("it has no part of JSON")?, binary))
}

/// A material as it is used.
type MaterialUse = (Option<usize>, bool);

struct Reader<'c> {
    builder: WorldBuilder,
    root: &'c Value,
    file: PathBuf,
    folder: PathBuf,
    buffers: Vec<Vec<u8>>,
    /// Buffer views that were packed, with the strides of their rows.
    unpacked: HashMap<usize, (Vec<u8>, Option<usize>)>,
    /// By number, and whether the mesh has colors.
    materials: HashMap<MaterialUse, (MaterialId, Option<Emission>)>,
    /// By number, and whether it holds colors.
    images: HashMap<(usize, bool), Option<Arc<ImageTexture>>>,
    /// Meshes that stand in many places.
    groups: HashMap<usize, GroupId>,
    /// How many nodes have each mesh.
    uses: HashMap<usize, usize>,
    /// Where nodes stand.
    globals: HashMap<usize, DAffine3>,
    seen: HashSet<usize>,
    /// Which variant of the materials is shown.
    variant: Option<usize>,
    n_bytes: u64,
    /// Pictures of what this program wrote, and whether it wrote the file.
    own_pictures: Vec<Arc<ImageTexture>>,
    is_own: bool,
    cancel: &'c Cancel,
}

/// Meshes of more nodes than these are placed and not copied.
const MOST_COPIES: usize = 8;

impl Reader<'_> {
    fn fault(&self, reason: impl Into<String>) -> WorldError {
        WorldError::Unreadable { file: self.file.clone(), reason: reason.into() }
    }

    /// Returns what a URI names: data within it, or a file beside the world's.
    fn resource(&mut self, uri: &str) -> Result<Vec<u8>, WorldError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, base64) = data.split_once(";base64,").ok_or_else(|| self.fault("data that isn't in base64"))?;
            return BASE64.decode(base64).map_err(|e| self.fault(format!("a data URI: {e}")));
        }
        let path = self.beside(uri);
        self.builder.add_source(&path);
        let bytes = read_bytes(&path, MAX_BYTES.saturating_sub(self.n_bytes))?;
        self.n_bytes += bytes.len() as u64;
        Ok(bytes)
    }

    /// Returns the path of a file that is named in the world's.
    fn beside(&self, uri: &str) -> PathBuf {
        let path = self.folder.join(uri);
        if path.is_file() { path } else { self.folder.join(unescaped(uri).replace('\\', "/")) }
    }

    fn source(&self) -> Source<'_> {
        let most_zeros = 1 << 16 | usize::try_from(self.n_bytes).unwrap_or(usize::MAX).min(1 << 28);
        Source { root: self.root, buffers: &self.buffers, unpacked: &self.unpacked, most_zeros }
    }

    fn rows(&self, accessor: usize) -> Result<Rows, WorldError> {
        self.source().rows(accessor).map_err(|reason| self.fault(reason))
    }

    fn note_left(&mut self, left: Left) {
        let used = list(self.root, "extensionsUsed").iter().filter_map(Value::as_str);
        let used = used.filter(|name| !is_read(name)).map(str::to_owned);
        let extensions = left.extensions.into_iter().chain(used).collect();
        for (sentence, words) in [
            ("words that aren't known, left out", left.words),
            ("words whose values aren't what glTF has there, left out", left.wrong),
            ("numbers beyond what glTF allows, the nearest in their place", left.near),
            ("extensions that aren't supported, left out", extensions),
        ] {
            words.iter().for_each(|word| self.builder.note_of(sentence, word));
        }
        if self.variant.is_none() {
            for variant in self.builder.choices().variants.clone() {
                self.builder.note_of("variants of the materials, of which the file's own is shown", &variant);
            }
        }
    }

    fn scene(&mut self, place: DAffine3) -> Result<(), WorldError> {
        let (scenes, nodes) = (list(self.root, "scenes"), list(self.root, "nodes"));
        let default = index(self.root, "scene");
        if let Some(number) = default.filter(|number| *number >= scenes.len()) {
            self.builder.note(format!("scene {number}, of which there are {}: the first one is read", scenes.len()));
        }
        let scene = default.and_then(|scene| scenes.get(scene)).or(scenes.first());
        let children: HashSet<usize> = nodes.iter().flat_map(|node| numbers_of(node, "children")).collect();
        let first: Vec<usize> = match scene {
            Some(scene) => numbers_of(scene, "nodes"),
            None if nodes.is_empty() => return Err(self.fault("it has no scene")),
            None => (0..nodes.len()).filter(|node| !children.contains(node)).collect(),
        };
        if scenes.len() > 1 {
            self.builder.note(format!("of {} scenes the default one is read", scenes.len()));
        }
        for node in nodes {
            if let Some(mesh) = index(node, "mesh").filter(|_| index(node, "skin").is_none()) {
                *self.uses.entry(mesh).or_default() += self.instances(node)?.map_or(1, |instances| instances.len());
            }
        }
        // Where every node stands first: skins hang on others.
        for &node in &first {
            self.stand(node, place, 0)?;
        }
        for node in (0..nodes.len()).filter(|node| !children.contains(node)) {
            if !self.globals.contains_key(&node) {
                self.stand(node, place, 0)?;
            }
        }
        for node in first {
            self.node(node, 0)?;
        }
        Ok(())
    }

    fn stand(&mut self, number: usize, parent: DAffine3, depth: usize) -> Result<(), WorldError> {
        if depth > MAX_DEPTH {
            return Err(self.fault(format!("nodes nested deeper than {MAX_DEPTH}")));
        }
        let nodes = list(self.root, "nodes");
        let node = nodes
            .get(number)
            .ok_or_else(|| self.fault(format!("node {number}, of which there are {}", nodes.len())))?;
        let place = parent * local(node);
        if self.globals.insert(number, place).is_some() {
            return Err(self.fault(format!("node {number} has two parents")));
        }
        numbers_of(node, "children").into_iter().try_for_each(|child| self.stand(child, place, depth + 1))
    }

    fn node(&mut self, number: usize, depth: usize) -> Result<(), WorldError> {
        self.cancel.check()?;
        let Some(node) = list(self.root, "nodes").get(number).filter(|_| depth <= MAX_DEPTH) else { return Ok(()) };
        if !self.seen.insert(number) {
            return Ok(());
        }
        let place = self.globals.get(&number).copied().unwrap_or(DAffine3::IDENTITY);
        if !place.is_finite() {
            return Err(self.fault(format!("node {number} stands nowhere: its numbers aren't finite")));
        }
        if extension(node, "KHR_node_visibility").and_then(|of| of.get("visible")) == Some(&Value::Bool(false)) {
            return Ok(());
        }
        let name =
            |of: &Value| of.get("name").and_then(Value::as_str).filter(|name| !name.is_empty()).map(str::to_owned);
        let mesh = index(node, "mesh").and_then(|mesh| list(self.root, "meshes").get(mesh));
        let is_part = self.is_part(node);
        if !is_part {
            self.builder.begin_object(&name(node).or_else(|| name(mesh?)).unwrap_or_else(|| format!("node {number}")));
        }
        if let Some(mesh) = index(node, "mesh") {
            for instance in self.instances(node)?.unwrap_or_else(|| vec![DAffine3::IDENTITY]) {
                self.mesh(node, mesh, place * instance)?;
            }
        }
        if let Some(light) = self.own_light(node, &place)? {
            self.builder.add_light(light);
        } else if let Some(light) = extension(node, "KHR_lights_punctual").and_then(|of| index(of, "light")) {
            self.light(light, place)?;
        }
        if let Some(camera) = index(node, "camera") {
            self.camera(camera, node, place)?;
        }
        numbers_of(node, "children").into_iter().try_for_each(|child| self.node(child, depth + 1))?;
        if !is_part {
            self.builder.end_object();
        }
        Ok(())
    }

    /// Returns the places of a node's mesh in it, where it has many.
    fn instances(&self, node: &Value) -> Result<Option<Vec<DAffine3>>, WorldError> {
        let Some(attributes) = extension(node, "EXT_mesh_gpu_instancing").and_then(|of| of.get("attributes")) else {
            return Ok(None);
        };
        let rows = |name: &str| index(attributes, name).map(|accessor| self.rows(accessor)).transpose();
        let [translations, rotations, scales] = ["TRANSLATION", "ROTATION", "SCALE"].map(rows);
        let (translations, rotations, scales) = (translations?, rotations?, scales?);
        let n = [&translations, &rotations, &scales].into_iter().flatten().map(Rows::len).min().unwrap_or(0);
        let number = |rows: &Option<Rows>, row: usize, column: usize, default: f64| {
            rows.as_ref().and_then(|rows| rows.values.get(row * rows.width + column)).copied().unwrap_or(default)
        };
        let three = |rows: &Option<Rows>, row: usize, default: f64| {
            DVec3::new(number(rows, row, 0, default), number(rows, row, 1, default), number(rows, row, 2, default))
        };
        let instance = |row: usize| {
            let [x, y, z] = [0, 1, 2].map(|k| number(&rotations, row, k, 0.0));
            let rotation = DQuat::from_xyzw(x, y, z, number(&rotations, row, 3, 1.0));
            let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
            DAffine3::from_scale_rotation_translation(
                three(&scales, row, 1.0),
                rotation,
                three(&translations, row, 0.0),
            )
        };
        Ok(Some((0..n).map(instance).collect()))
    }

    /// Lights of glTF shine along −z, in candela or lux; their colors are those of daylight D65 tinted.
    fn light(&mut self, number: usize, place: DAffine3) -> Result<(), WorldError> {
        let lights = extension(self.root, "KHR_lights_punctual").map_or(&[][..], |of| list(of, "lights"));
        let light = lights
            .get(number)
            .ok_or_else(|| self.fault(format!("light {number}, of which there are {}", lights.len())))?;
        let color = numbers::<3>(light, "color").unwrap_or([1.0; 3]).map(|v| v as f32);
        let intensity = number_or(Some(light), "intensity", 1.0);
        // A unit of `from_rgb_light` is 683 lm/W over the area below the photopic curve, 106.857 nm.
        let curve = SpectralCurve::from_rgb_light(color).scaled((intensity / (LUMENS_PER_WATT * 106.857)) as f32);
        let direction = place.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let position = place.translation;
        if light.get("range").is_some() {
            self.builder.note("ranges of lights: left out, all fall off by the square of the distance and never end");
        }
        let light = match light.get("type").and_then(Value::as_str) {
            Some("directional") => Light::Distant { direction, irradiance: curve },
            Some("point") => Light::Point { position, intensity: curve },
            Some("spot") => {
                let cone = light.get("spot");
                Light::Spot {
                    position,
                    direction,
                    intensity: curve,
                    inner_rad: number_or(cone, "innerConeAngle", 0.0),
                    outer_rad: number_or(cone, "outerConeAngle", std::f64::consts::FRAC_PI_4),
                    fall_off: FallOff::Square,
                }
            }
            kind => {
                self.builder.note_of("lights of a type that isn't known, left out", kind.unwrap_or("none"));
                return Ok(());
            }
        };
        self.builder.add_light(light);
        Ok(())
    }

    /// Cameras of glTF look along −z with y up.
    fn camera(&mut self, index: usize, node: &Value, place: DAffine3) -> Result<(), WorldError> {
        let cameras = list(self.root, "cameras");
        let camera = cameras
            .get(index)
            .ok_or_else(|| self.fault(format!("camera {index}, of which there are {}", cameras.len())))?;
        let name = |of: &Value| of.get("name").and_then(Value::as_str).map(str::to_owned);
        if let Some(camera) = self.own_camera(camera, node, &place)? {
            self.builder.add_camera(camera);
            return Ok(());
        }
        let kind = camera.get("type").and_then(Value::as_str).unwrap_or("");
        // Without the scale of its parents, but for a parallel view.
        let (scale, rotation, translation) = place.to_scale_rotation_translation();
        let (kind_of, aspect) = match (kind, camera.get("perspective"), camera.get("orthographic")) {
            ("perspective", Some(of), _) => {
                let aspect = number(of, "aspectRatio").filter(|aspect| *aspect > 0.0).unwrap_or(1.5);
                let vertical = number(of, "yfov").filter(|fov| *fov > 0.0 && *fov < std::f64::consts::PI);
                let half_tan = (0.5 * vertical.unwrap_or(0.8)).tan() * aspect.min(1.0);
                let fov_deg = 2.0 * half_tan.atan().to_degrees();
                (
                    CameraKind::Perspective { fov_deg, lens_radius_m: 0.0, focus_distance_m: 1.0, screen_window: None },
                    aspect,
                )
            }
            ("orthographic", _, Some(of)) => {
                let x = number_or(Some(of), "xmag", 1.0).abs() * scale.x.abs();
                let y = number_or(Some(of), "ymag", 1.0).abs() * scale.y.abs();
                (CameraKind::Orthographic { screen_window: [-x, x, -y, y] }, x / y)
            }
            _ => {
                self.builder.note_of(
                    "cameras of a type that isn't known, left out",
                    if kind.is_empty() { "none" } else { kind },
                );
                return Ok(());
            }
        };
        let aspect = if aspect.is_finite() { aspect.clamp(0.01, 100.0) } else { 1.5 };
        let columns = if aspect >= 1.0 { 480.0 * aspect } else { 480.0 };
        let resolution = (columns.round() as usize, (columns / aspect).round() as usize);
        let turned = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
        self.builder.add_camera(WorldCamera {
            name: name(camera).or_else(|| name(node)).unwrap_or_else(|| format!("camera {index}")),
            world_from_camera: DAffine3::from_rotation_translation(rotation, translation) * turned,
            kind: kind_of,
            resolution,
        });
        Ok(())
    }
}

/// Returns the numbers of a list of indices.
fn numbers_of(value: &Value, key: &str) -> Vec<usize> {
    list(value, key).iter().filter_map(|n| n.as_u64().and_then(|n| usize::try_from(n).ok())).collect()
}

/// Returns where a node stands in its parent.
fn local(node: &Value) -> DAffine3 {
    if let Some(m) = numbers::<16>(node, "matrix") {
        return DAffine3::from_mat4(DMat4::from_cols_array(&m));
    }
    let translation = numbers::<3>(node, "translation").map_or(DVec3::ZERO, DVec3::from_array);
    let rotation = numbers::<4>(node, "rotation").map_or(DQuat::IDENTITY, DQuat::from_array);
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let scale = numbers::<3>(node, "scale").map_or(DVec3::ONE, DVec3::from_array);
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

/// Returns a URI with its escapes (`%20`) as what they stand for.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let code = (byte == b'%').then(|| after.get(..2)).flatten();
        let code = code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        match code {
            Some(code) => {
                bytes.push(code);
                rest = &after[2..];
            }
            None => {
                bytes.push(byte);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests;
