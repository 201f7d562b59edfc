//! Worlds as glTF 2.0.
//!
//! What glTF has words for is written in them for all programs; materials, lights, spectra and shapes as they are stand in `extras`, from which the
//! reader here takes them where this program wrote the file.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    path::Path,
    sync::Arc,
};

use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec2, Vec3};
use image::{DynamicImage, ImageFormat};
use serde_json::{Map, Value, json};

use super::Written;
use crate::{
    CameraKind, Coordinates, Emission, GroupId, ImageTexture, Light, Material, MaterialId, MediumId, Relief, Shape,
    SpectralCurve, Texture, TextureId, TriangleMesh, UvMapping, WorldBuilder, WorldCamera, WorldError, Wrap,
    formats::gltf::{GENERATOR, LUMENS_PER_WATT},
    world::NewShape,
};

/// Steps around a shape in closed form that is written as triangles.
const AROUND: usize = 64;

/// Returns the files of a world: one `.glb`, or a `.gltf` with its numbers in a `.bin` beside it.
pub(super) fn written(builder: &WorldBuilder, path: &Path, is_binary: bool) -> Result<Written, WorldError> {
    let builder = builder.clone().in_frame(DVec3::Y, false);
    let mut writer = Writer::new(&builder);
    let nodes = writer.nodes();
    let root = writer.root(nodes).map_err(|reason| WorldError::Unwritable { file: path.to_owned(), reason })?;
    let Writer { mut binary, losses, others, .. } = writer;
    let mut losses: Vec<String> = losses.into_iter().collect();
    if !others.is_empty() {
        let named: Vec<String> = others.into_iter().collect();
        losses.push(format!("what this program alone reads from it, others the nearest: {}", named.join(", ")));
    }
    let mut root = root;
    let files = if is_binary {
        root["buffers"] = json!([{ "byteLength": binary.len() }]);
        let mut text = serde_json::to_vec(&root).expect("JSON of numbers and texts");
        text.resize(text.len().next_multiple_of(4), b' ');
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut file = b"glTF".to_vec();
        let length = 12 + 8 + text.len() + 8 + binary.len();
        for word in [2, length as u32, text.len() as u32] {
            file.extend(word.to_le_bytes());
        }
        file.extend(b"JSON");
        file.extend(text);
        file.extend((binary.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(binary);
        vec![(path.to_owned(), file)]
    } else {
        let beside = path.with_extension("bin");
        let name = beside.file_name().unwrap_or_default().to_string_lossy().replace('%', "%25").replace(' ', "%20");
        root["buffers"] = json!([{ "byteLength": binary.len(), "uri": name }]);
        let text = serde_json::to_vec_pretty(&root).expect("JSON of numbers and texts");
        vec![(beside, binary), (path.to_owned(), text)]
    };
    Ok(Written { files, losses })
}

struct Writer<'a> {
    builder: &'a WorldBuilder,
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
    textures: Vec<Value>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    nodes: Vec<Value>,
    /// Pictures as they are, for this program.
    pictures: Vec<Value>,
    known_pictures: HashMap<usize, usize>,
    known_images: HashMap<usize, usize>,
    known_materials: HashMap<(MaterialId, String), usize>,
    known_attributes: HashMap<usize, (Map<String, Value>, usize)>,
    known_meshes: HashMap<GroupId, usize>,
    extensions: BTreeSet<&'static str>,
    losses: BTreeSet<String>,
    /// What only this program reads.
    others: BTreeSet<String>,
    /// Whether what is said in `extras` is all.
    has_extras: bool,
}

impl<'a> Writer<'a> {
    fn new(builder: &'a WorldBuilder) -> Self {
        let patterns = builder.textures.iter().any(|texture| matches!(texture, Texture::Pattern { .. }));
        let mut losses = BTreeSet::new();
        if patterns {
            losses.insert("patterns by a formula of a program: materials are the nearest of glTF's".to_owned());
        }
        Self {
            builder,
            binary: Vec::new(),
            views: Vec::new(),
            accessors: Vec::new(),
            meshes: Vec::new(),
            materials: Vec::new(),
            images: Vec::new(),
            samplers: Vec::new(),
            textures: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            nodes: Vec::new(),
            pictures: Vec::new(),
            known_pictures: HashMap::new(),
            known_images: HashMap::new(),
            known_materials: HashMap::new(),
            known_attributes: HashMap::new(),
            known_meshes: HashMap::new(),
            extensions: BTreeSet::new(),
            losses,
            others: BTreeSet::new(),
            has_extras: !patterns,
        }
    }

    /// Returns what an even medium takes and scatters, 1/m, and its asymmetry.
    fn filling(&mut self, medium: MediumId) -> Option<(SpectralCurve, SpectralCurve, f32)> {
        let medium = &self.builder.media[medium.0 as usize];
        match medium.is_even() && medium.glow.is_none() {
            true => Some((medium.absorption.clone(), medium.scattering.clone(), medium.asymmetry)),
            false => {
                self.losses.insert("media that glow or differ from place to place: left out".to_owned());
                None
            }
        }
    }

    fn root(&mut self, scene: Vec<usize>) -> Result<Value, String> {
        let mut root = json!({
            "asset": { "version": "2.0", "generator": GENERATOR },
            "scene": 0,
            "scenes": [{ "nodes": scene }],
        });
        if self.builder.eye.is_some() {
            self.losses.insert("the medium around the camera: left out".to_owned());
        }
        if self.builder.shapes.iter().any(|shape| shape.interface.is_some()) {
            self.losses
                .insert("media that shapes part, but for what fills them by their material: left out".to_owned());
        }
        if self.has_extras {
            let textures =
                self.builder.textures.iter().map(|texture| self.own_texture(texture)).collect::<Result<Vec<_>, _>>()?;
            let mut surfaces = Vec::new();
            for surface in &self.builder.surfaces {
                surfaces.push(json!({
                    "name": surface.name,
                    "material": own(&surface.material)?,
                    "relief": own(&surface.relief)?,
                    "coverage": own(&surface.coverage)?,
                    "glow": own(&surface.glow)?,
                    "filling": own(&surface.filling.and_then(|medium| self.filling(medium)))?,
                    "turn_rad": surface.turn_rad,
                    "directions": own(&surface.directions)?,
                    "behind": own(&surface.behind)?,
                    "film": own(&surface.film)?,
                }));
            }
            let pictures = std::mem::take(&mut self.pictures);
            root["extras"] =
                json!({ "dioptric": { "textures": textures, "materials": surfaces, "pictures": pictures } });
        }
        let mut put = |key: &str, list: &mut Vec<Value>| {
            if !list.is_empty() {
                root[key] = Value::Array(std::mem::take(list));
            }
        };
        put("nodes", &mut self.nodes);
        put("meshes", &mut self.meshes);
        put("materials", &mut self.materials);
        put("textures", &mut self.textures);
        put("images", &mut self.images);
        put("samplers", &mut self.samplers);
        put("cameras", &mut self.cameras);
        put("accessors", &mut self.accessors);
        put("bufferViews", &mut self.views);
        if !self.lights.is_empty() {
            self.extensions.insert("KHR_lights_punctual");
            root["extensions"] = json!({ "KHR_lights_punctual": { "lights": std::mem::take(&mut self.lights) } });
        }
        if !self.extensions.is_empty() {
            root["extensionsUsed"] = json!(self.extensions);
        }
        Ok(root)
    }

    /// Adds a node for each object and what is in it; returns those that are no parts of others.
    fn nodes(&mut self) -> Vec<usize> {
        let builder = self.builder;
        let mut of_objects: BTreeMap<u32, (usize, Vec<usize>)> = BTreeMap::new();
        let mut scene = Vec::new();
        for object in builder.objects.there() {
            self.nodes.push(json!({ "name": builder.objects.name(object) }));
            of_objects.insert(object, (self.nodes.len() - 1, Vec::new()));
        }
        for object in builder.objects.there() {
            let node = of_objects[&object].0;
            match builder.objects.parent(object).and_then(|parent| of_objects.get_mut(&parent)) {
                Some((_, parts)) => parts.push(node),
                None => scene.push(node),
            }
        }
        let mut part = |writer: &mut Self, object: u32, mut node: Value| {
            node["extras"]["dioptric"]["part"] = json!(true);
            writer.nodes.push(node);
            let number = writer.nodes.len() - 1;
            if let Some((_, parts)) = of_objects.get_mut(&object) {
                parts.push(number);
            }
        };
        for shape in builder.shapes.iter().filter(|shape| shape.group == GroupId::ROOT) {
            let Some(primitive) = self.primitive(shape, &DAffine3::IDENTITY) else { continue };
            self.meshes.push(json!({ "primitives": [primitive] }));
            let node = json!({ "mesh": self.meshes.len() - 1, "matrix": matrix(&shape.place) });
            part(self, shape.object, node);
        }
        for instance in &builder.instances {
            let Some(mesh) = self.group(instance.group) else { continue };
            part(self, instance.object, json!({ "mesh": mesh, "matrix": matrix(&instance.place) }));
        }
        for new in &builder.lights {
            if let Some(node) = self.light(&new.light) {
                part(self, new.object, node);
            }
        }
        for camera in &builder.cameras {
            if let Some(node) = self.camera(camera) {
                self.nodes.push(node);
                scene.push(self.nodes.len() - 1);
            }
        }
        for (node, parts) in of_objects.into_values() {
            if !parts.is_empty() {
                self.nodes[node]["children"] = json!(parts);
            }
        }
        scene
    }

    /// Returns the mesh of a group.
    fn group(&mut self, group: GroupId) -> Option<usize> {
        if let Some(mesh) = self.known_meshes.get(&group) {
            return Some(*mesh);
        }
        let shapes: Vec<&NewShape> = self.builder.shapes.iter().filter(|shape| shape.group == group).collect();
        let primitives: Vec<Value> = shapes.iter().filter_map(|shape| self.primitive(shape, &shape.place)).collect();
        if primitives.is_empty() {
            return None;
        }
        self.meshes.push(json!({ "primitives": primitives }));
        self.known_meshes.insert(group, self.meshes.len() - 1);
        Some(self.meshes.len() - 1)
    }

    /// Returns a shape as a primitive whose vertices are placed.
    fn primitive(&mut self, shape: &NewShape, place: &DAffine3) -> Option<Value> {
        let is_exact = matches!(&*shape.shape, Shape::Mesh(_));
        let mut mesh = match &*shape.shape {
            Shape::Mesh(mesh) => mesh.clone(),
            Shape::Sphere { radius_m } => sphere(*radius_m as f32),
            Shape::Disc { radius_m, inner_radius_m } => mantle([*inner_radius_m as f32, *radius_m as f32], [0.0; 2]),
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => {
                mantle([*radius_m as f32; 2], [*z_min_m as f32, *z_max_m as f32])
            }
            Shape::Lathe(_) => {
                self.losses.insert("surfaces of revolution by a profile: left out".to_owned());
                return None;
            }
        };
        if !is_exact && !self.has_extras {
            self.losses.insert("spheres, discs and cylinders: as triangles".to_owned());
        }
        let key = if *place == DAffine3::IDENTITY { Arc::as_ptr(&shape.shape) as usize } else { 0 };
        mesh.transform(place);
        if shape.is_reversed {
            mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let key = if shape.is_reversed { 0 } else { key };
        let (attributes, indices) = match self.known_attributes.get(&key).filter(|_| key != 0) {
            Some(known) => known.clone(),
            None => {
                let made = self.attributes(&mesh);
                self.known_attributes.insert(key, made.clone());
                made
            }
        };
        let material = self.material(shape.material, shape.emission.as_ref());
        let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": material });
        if self.has_extras {
            let own_shape = match &*shape.shape {
                Shape::Sphere { radius_m } => json!({ "sphere": [radius_m] }),
                Shape::Disc { radius_m, inner_radius_m } => json!({ "disc": [radius_m, inner_radius_m] }),
                Shape::Cylinder { radius_m, z_min_m, z_max_m } => json!({ "cylinder": [radius_m, z_min_m, z_max_m] }),
                Shape::Mesh(_) | Shape::Lathe(_) => Value::Null,
            };
            let mut extras = json!({ "material": shape.material.0 });
            if let Some(emission) = &shape.emission {
                extras["emission"] = own(emission).unwrap_or_default();
            }
            if !own_shape.is_null() {
                extras["shape"] = own_shape;
                extras["matrix"] = json!(matrix(place));
                extras["reversed"] = json!(shape.is_reversed);
            }
            primitive["extras"] = json!({ "dioptric": extras });
        }
        Some(primitive)
    }

    fn attributes(&mut self, mesh: &TriangleMesh) -> (Map<String, Value>, usize) {
        let three = |list: &[Vec3]| list.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        // v runs down the picture in glTF.
        let two = |list: &[Vec2]| list.iter().flat_map(|uv| [uv.x, 1.0 - uv.y]).collect::<Vec<f32>>();
        let mut attributes = Map::new();
        let mut put = |writer: &mut Self, name: &str, values: Vec<f32>, kind: &str, width: usize| {
            if !values.is_empty() {
                attributes.insert(name.to_owned(), json!(writer.floats(&values, kind, width)));
            }
        };
        put(self, "POSITION", three(&mesh.positions), "VEC3", 3);
        put(self, "NORMAL", three(&mesh.normals), "VEC3", 3);
        put(self, "TEXCOORD_0", two(&mesh.uvs), "VEC2", 2);
        put(self, "TEXCOORD_1", two(&mesh.second_uvs), "VEC2", 2);
        put(self, "COLOR_0", mesh.colors.as_flattened().to_vec(), "VEC4", 4);
        let bytes: Vec<u8> = mesh.triangles.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let n = 3 * mesh.triangles.len();
        self.accessors.push(json!({ "bufferView": view, "componentType": 5125, "count": n, "type": "SCALAR" }));
        (attributes, self.accessors.len() - 1)
    }

    fn floats(&mut self, values: &[f32], kind: &str, width: usize) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let ends = |pick: fn(f32, f32) -> f32, from: f32| -> Vec<f32> {
            (0..width).map(|k| values.iter().skip(k).step_by(width).copied().fold(from, pick)).collect()
        };
        self.accessors.push(json!({
            "bufferView": view, "componentType": 5126, "count": values.len() / width, "type": kind,
            "min": ends(f32::min, f32::INFINITY), "max": ends(f32::max, f32::NEG_INFINITY),
        }));
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() }));
        self.binary.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// Lights shine along −z.
    fn light(&mut self, light: &Light) -> Option<Value> {
        let towards = |direction: DVec3| {
            let rotation = DQuat::from_rotation_arc(DVec3::NEG_Z, direction.normalize_or(DVec3::NEG_Z));
            DMat3::from_quat(rotation)
        };
        let (place, curve, kind) = match light {
            Light::Point { position, intensity } => (DAffine3::from_translation(*position), Some(intensity), "point"),
            Light::Pictured { position, intensity, .. } => {
                self.others.insert("lamps by a picture".to_owned());
                (DAffine3::from_translation(*position), Some(intensity), "point")
            }
            Light::Spot { position, direction, intensity, .. } => {
                (DAffine3 { matrix3: towards(*direction), translation: *position }, Some(intensity), "spot")
            }
            Light::Distant { direction, irradiance } => {
                (DAffine3::from_mat3(towards(*direction)), Some(irradiance), "directional")
            }
            Light::Sky { .. } | Light::SkyImage(_) => {
                if !self.has_extras {
                    self.losses.insert("skies: left out".to_owned());
                    return None;
                }
                self.others.insert("skies".to_owned());
                (DAffine3::IDENTITY, None, "")
            }
        };
        let mut node = json!({ "matrix": matrix(&place) });
        if let Some(curve) = curve {
            let (rgb, luminous) = color_of_light(curve);
            let mut made = json!({ "type": kind, "color": rgb, "intensity": luminous });
            if let Light::Spot { inner_rad, outer_rad, .. } = light {
                let outer = outer_rad.min(std::f64::consts::FRAC_PI_2);
                made["spot"] =
                    json!({ "innerConeAngle": inner_rad.min(outer - 1e-9).max(0.0), "outerConeAngle": outer });
            }
            self.lights.push(made);
            node["extensions"] = json!({ "KHR_lights_punctual": { "light": self.lights.len() - 1 } });
        }
        if self.has_extras {
            self.others.insert("spectra of lights".to_owned());
            let mut inside = light.clone();
            inside.transform(&place.inverse());
            match self.own_light(&inside) {
                Ok(own) => node["extras"] = json!({ "dioptric": { "light": own } }),
                Err(_) => {
                    self.losses.insert("lights by pictures that can't be written".to_owned());
                }
            }
        }
        Some(node)
    }

    fn camera(&mut self, camera: &WorldCamera) -> Option<Value> {
        let (columns, rows) = camera.resolution;
        let aspect = columns as f64 / rows as f64;
        let mut made = match &camera.kind {
            CameraKind::Perspective { fov_deg, .. } => {
                let half_tan = (0.5 * fov_deg.to_radians()).tan() / aspect.min(1.0);
                json!({ "type": "perspective", "perspective": { "yfov": 2.0 * half_tan.atan(), "aspectRatio": aspect, "znear": 0.01 } })
            }
            CameraKind::Orthographic { screen_window: [left, right, bottom, top] } => json!({
                "type": "orthographic",
                "orthographic": { "xmag": 0.5 * (right - left), "ymag": 0.5 * (top - bottom), "znear": 0.0, "zfar": 1e6 }
            }),
            CameraKind::Panorama { .. } | CameraKind::Lens { .. } | CameraKind::Other { .. } => {
                self.others.insert("cameras that are panoramas or have a lens".to_owned());
                json!({ "type": "perspective", "perspective": { "yfov": 0.7, "aspectRatio": aspect, "znear": 0.01 } })
            }
        };
        made["name"] = json!(camera.name);
        if let Ok(kind) = own(&camera.kind) {
            made["extras"] = json!({ "dioptric": { "kind": kind, "resolution": [columns, rows] } });
        }
        self.cameras.push(made);
        let place = camera.world_from_camera * DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let extras = json!({ "dioptric": { "part": true, "matrix": matrix(&camera.world_from_camera) } });
        Some(json!({ "camera": self.cameras.len() - 1, "matrix": matrix(&place), "extras": extras }))
    }

    fn own_texture(&mut self, texture: &Texture) -> Result<Value, String> {
        if let Texture::Image { image, .. } | Texture::Channel { image, .. } = texture {
            self.own_picture(image)?;
        }
        self.with_pictures(own(texture)?)
    }

    fn own_light(&mut self, light: &Light) -> Result<Value, String> {
        match light {
            Light::Pictured { picture: image, .. } => self.own_picture(image)?,
            Light::SkyImage(sky) => self.own_picture(&sky.image)?,
            _ => 0,
        };
        self.with_pictures(own(light)?)
    }

    /// Puts the numbers of pictures in place of their addresses.
    fn with_pictures(&self, mut value: Value) -> Result<Value, String> {
        fn replace(value: &mut Value, known: &HashMap<usize, usize>) {
            match value {
                Value::Object(object) => {
                    if let Some(address) = object.get("picture").and_then(Value::as_u64) {
                        let number = known.get(&(address as usize)).copied().unwrap_or(0);
                        object.insert("picture".to_owned(), json!(number));
                    }
                    object.values_mut().for_each(|inner| replace(inner, known));
                }
                Value::Array(list) => list.iter_mut().for_each(|inner| replace(inner, known)),
                _ => {}
            }
        }
        replace(&mut value, &self.known_pictures);
        Ok(value)
    }

    /// Adds a picture as it is; returns its number.
    fn own_picture(&mut self, image: &Arc<ImageTexture>) -> Result<usize, String> {
        let key = image.texels_key();
        if let Some(known) = self.known_pictures.get(&key) {
            return Ok(*known);
        }
        let (picture, encoding) = image.as_picture();
        let is_float = matches!(picture, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
        let format = if is_float { ImageFormat::OpenExr } else { ImageFormat::Png };
        let bytes = dioptric_pictures::encode(&picture, format).map_err(|e| e.to_string())?;
        let view = self.view(&bytes);
        self.pictures.push(json!({ "bufferView": view, "encoding": own(&encoding)? }));
        self.known_pictures.insert(key, self.pictures.len() - 1);
        Ok(self.pictures.len() - 1)
    }

    /// Returns the number of a picture as a texture of glTF's, in 8 bits.
    fn texture(&mut self, image: &Arc<ImageTexture>) -> Option<usize> {
        let key = image.texels_key();
        let source = match self.known_images.get(&key) {
            Some(known) => *known,
            None => {
                let (picture, _) = image.as_picture();
                let picture = match picture {
                    // Of all that glTF has, colors of more than 1 are the brightest.
                    DynamicImage::ImageRgb32F(float) => {
                        DynamicImage::ImageRgb8(image::RgbImage::from_fn(float.width(), float.height(), |x, y| {
                            image::Rgb(float.get_pixel(x, y).0.map(srgb_code))
                        }))
                    }
                    DynamicImage::ImageRgba32F(float) => {
                        DynamicImage::ImageRgba8(image::RgbaImage::from_fn(float.width(), float.height(), |x, y| {
                            let [r, g, b, a] = float.get_pixel(x, y).0;
                            image::Rgba([srgb_code(r), srgb_code(g), srgb_code(b), (a.clamp(0.0, 1.0) * 255.0) as u8])
                        }))
                    }
                    bytes => bytes,
                };
                let bytes = dioptric_pictures::encode(&picture, ImageFormat::Png).ok()?;
                let view = self.view(&bytes);
                self.images.push(json!({ "bufferView": view, "mimeType": "image/png" }));
                self.known_images.insert(key, self.images.len() - 1);
                self.images.len() - 1
            }
        };
        let (wraps, is_stepped) = image.sampling();
        let [s, t] = wraps.map(|wrap| match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp | Wrap::Black => 33071,
        });
        let filter = if is_stepped { 9728 } else { 9729 };
        let sampler = json!({ "wrapS": s, "wrapT": t, "magFilter": filter });
        let number = self.samplers.iter().position(|known| *known == sampler).unwrap_or_else(|| {
            self.samplers.push(sampler);
            self.samplers.len() - 1
        });
        self.textures.push(json!({ "source": source, "sampler": number }));
        Some(self.textures.len() - 1)
    }

    /// Returns the words of a texture of a material: its color, and its picture where it has one.
    fn color(&mut self, id: TextureId) -> ([f32; 3], Option<Value>) {
        match self.builder.textures[id.0 as usize].clone() {
            Texture::Curve(curve) => {
                if curve.is_spectrum() {
                    self.others.insert("spectra of surfaces".to_owned());
                }
                (color_of(&curve), None)
            }
            Texture::Image { image, mapping, scale } => {
                let texture = self.texture(&image);
                ([scale.clamp(0.0, 1.0); 3], texture.map(|texture| self.info(texture, &mapping)))
            }
            Texture::Product([a, b]) | Texture::Blend { of: [a, b], .. } => {
                let ((first, picture), (second, more)) = (self.color(a), self.color(b));
                (std::array::from_fn(|k| first[k] * second[k]), picture.or(more))
            }
            Texture::Checkerboard { fields: [a, b], .. } => {
                let (first, second) = (self.color(a).0, self.color(b).0);
                (std::array::from_fn(|k| 0.5 * (first[k] + second[k])), None)
            }
            Texture::Channel { .. } | Texture::Procedural(_) | Texture::Pattern { .. } => ([0.5; 3], None),
            Texture::VertexColors | Texture::VertexAlpha | Texture::Step { .. } | Texture::Alpha { .. } => {
                ([1.0; 3], None)
            }
        }
    }

    fn info(&mut self, texture: usize, mapping: &UvMapping) -> Value {
        let mut info = json!({ "index": texture });
        if mapping.from == Coordinates::Second {
            info["texCoord"] = json!(1);
        }
        let m = mapping.matrix;
        // As the reader has it: a and d across the diagonal, b and c beside, counterclockwise as seen with v down.
        let (a, c, b, d) = (m.x_axis.x, -m.x_axis.y, -m.y_axis.x, m.y_axis.y);
        let (across, down) = (a.hypot(c), b.hypot(d));
        let rotation = (-c).atan2(a);
        let offset = [mapping.offset.x - b, 1.0 - mapping.offset.y - d];
        if *mapping != (UvMapping { from: mapping.from, ..UvMapping::IDENTITY }) {
            self.extensions.insert("KHR_texture_transform");
            let words = json!({ "offset": offset, "scale": [across, down], "rotation": rotation });
            info["extensions"] = json!({ "KHR_texture_transform": words });
        }
        info
    }

    fn number(&self, id: TextureId) -> Option<f32> {
        match &self.builder.textures[id.0 as usize] {
            Texture::Curve(curve) => Some(curve.mean_visible()),
            Texture::Alpha { roughness, by } => self.number(*roughness).map(|roughness| by.alpha(roughness)),
            Texture::Product([a, b]) => Some(self.number(*a)? * self.number(*b)?),
            _ => None,
        }
    }

    /// Returns the nearest material of glTF's.
    fn material(&mut self, id: MaterialId, emission: Option<&Emission>) -> usize {
        let glow = emission.map_or(String::new(), |emission| format!("{emission:?}"));
        if let Some(known) = self.known_materials.get(&(id, glow.clone())) {
            return *known;
        }
        let surface = &self.builder.surfaces[id.0 as usize];
        let mut words = json!({ "name": surface.name });
        if surface.film.is_some() || surface.behind.is_some() {
            self.others.insert("films and light through leaves".to_owned());
        }
        self.surface(&surface.material, &mut words);
        if let Some(coverage) = surface.coverage {
            words["alphaMode"] = json!("BLEND");
            let opaque = match self.number(coverage) {
                Some(number) => number,
                None => {
                    let is_picture =
                        matches!(self.builder.textures[coverage.0 as usize], Texture::Channel { channel: 3, .. });
                    if !is_picture {
                        self.others.insert("outlines that aren't those of the picture of the color".to_owned());
                    }
                    if let Texture::Step { at_least, .. } = self.builder.textures[coverage.0 as usize] {
                        words["alphaMode"] = json!("MASK");
                        words["alphaCutoff"] = json!(at_least);
                    }
                    1.0
                }
            };
            words["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(opaque);
        }
        if let Some(Relief::Normals(normals) | Relief::ScaledNormals(normals, _)) = surface.relief {
            let scale = if let Some(Relief::ScaledNormals(_, scale)) = surface.relief { scale } else { 1.0 };
            if let (_, Some(mut info)) = self.color(normals) {
                info["scale"] = json!(scale);
                words["normalTexture"] = info;
            }
        } else if surface.relief.is_some() {
            self.others.insert("relief by heights".to_owned());
        }
        if let Some(Emission { radiance, is_two_sided }) = emission {
            // 1 is as bright as white under an even sky of 1 here.
            let (rgb, luminous) = color_of_light(radiance);
            let strength = luminous / (LUMENS_PER_WATT * 106.857);
            self.extensions.insert("KHR_materials_emissive_strength");
            words["emissiveFactor"] = json!(rgb);
            words["doubleSided"] = json!(is_two_sided);
            words["extensions"]["KHR_materials_emissive_strength"] = json!({ "emissiveStrength": strength });
            if let Some(glow) = surface.glow
                && let (_, Some(info)) = self.color(glow)
            {
                words["emissiveTexture"] = info;
            }
        }
        self.materials.push(words);
        self.known_materials.insert((id, glow), self.materials.len() - 1);
        self.materials.len() - 1
    }

    fn surface(&mut self, material: &Material, words: &mut Value) {
        use Material as M;
        let root = |writer: &Self, roughness: &crate::Roughness| {
            roughness.map_or(0.0, |[u, v]| {
                let alpha = |id| writer.number(id).unwrap_or(0.25);
                (0.5 * (alpha(u) + alpha(v))).sqrt()
            })
        };
        let mut put = |color: ([f32; 3], Option<Value>), metallic: f32, roughness: f32| {
            let ([r, g, b], picture) = color;
            let mut pbr =
                json!({ "baseColorFactor": [r, g, b, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness });
            if let Some(info) = picture {
                pbr["baseColorTexture"] = info;
            }
            words["pbrMetallicRoughness"] = pbr;
        };
        let other = |writer: &mut Self, kind: &str| {
            writer.others.insert(format!("materials of kind '{kind}'"));
        };
        match material {
            M::Matte { reflectance } | M::RoughMatte { reflectance, .. } => {
                if matches!(material, M::RoughMatte { .. }) {
                    other(self, "rough matte");
                }
                let color = self.color(*reflectance);
                put(color, 0.0, 1.0);
                self.extensions.insert("KHR_materials_specular");
                words["extensions"]["KHR_materials_specular"] = json!({ "specularFactor": 0.0 });
            }
            M::Hair { color, .. } => {
                other(self, "hair");
                let color = self.color(*color);
                put(color, 0.0, 1.0);
            }
            M::Translucent { reflectance, .. } => {
                other(self, "translucent");
                let color = self.color(*reflectance);
                put(color, 0.0, 1.0);
            }
            M::Mirror { reflectance, roughness } => {
                other(self, "mirror");
                let (color, roughness) = (self.color(*reflectance), root(self, roughness));
                put(color, 1.0, roughness);
            }
            M::Metal { n, k, roughness } => {
                other(self, "metal");
                let wavelengths: Vec<f64> = (0..=60).map(|i| 400.0 + 5.0 * f64::from(i)).collect();
                let values = wavelengths.iter().map(|nm| {
                    let [n, k] = [n, k].map(|curve| f64::from(curve.at(&[*nm as f32])[0]));
                    ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
                });
                let values = values.collect();
                let spectrum = dioptric_spectrum::Spectrum::new(wavelengths, values);
                let color = spectrum.map_or([0.8; 3], |s| color_of(&SpectralCurve::new(&s, crate::Beyond::Held)));
                let roughness = root(self, roughness);
                put((color, None), 1.0, roughness);
            }
            M::Dielectric { index, roughness } | M::Glass { index, roughness, .. } => {
                other(self, "glass");
                let roughness = root(self, roughness);
                put(([1.0; 3], None), 0.0, roughness);
                self.clear(words, index, 1.0);
            }
            M::Pane { index } => {
                other(self, "pane");
                put(([1.0; 3], None), 0.0, 0.0);
                self.clear(words, index, 0.0);
            }
            M::Coated { base, roughness, .. } => {
                other(self, "plastic");
                let (color, roughness) = (self.color(*base), root(self, roughness));
                put(color, 0.0, roughness);
            }
            M::Substrate { base: color, roughness, .. } | M::Glossy { reflectance: color, roughness, .. } => {
                other(self, "substrate");
                let (color, roughness) = (self.color(*color), root(self, roughness));
                put(color, 0.0, roughness);
            }
            M::MetallicRoughness { color, metallic, roughness, transmission, .. } => {
                let color = self.color(*color);
                let (metal, rough) = (self.number(*metallic), self.number(*roughness));
                put(color, metal.unwrap_or(1.0), rough.unwrap_or(1.0));
                if let (None, Texture::Channel { image, mapping, .. }) =
                    (rough, self.builder.textures[roughness.0 as usize].clone())
                    && let Some(texture) = self.texture(&image)
                {
                    words["pbrMetallicRoughness"]["metallicRoughnessTexture"] = self.info(texture, &mapping);
                }
                if let Some(share) = transmission.map(|share| self.number(share).unwrap_or(1.0)) {
                    self.extensions.insert("KHR_materials_transmission");
                    words["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": share });
                }
            }
            M::Clearcoat { base, amount, roughness } => {
                let base = self.builder.surfaces[base.0 as usize].material.clone();
                self.surface(&base, words);
                self.extensions.insert("KHR_materials_clearcoat");
                let (amount, roughness) = (self.number(*amount).unwrap_or(1.0), self.number(*roughness).unwrap_or(0.0));
                let coat = json!({ "clearcoatFactor": amount, "clearcoatRoughnessFactor": roughness });
                words["extensions"]["KHR_materials_clearcoat"] = coat;
            }
            M::Sheen { base, color, roughness } => {
                let base = self.builder.surfaces[base.0 as usize].material.clone();
                self.surface(&base, words);
                self.extensions.insert("KHR_materials_sheen");
                let (color, roughness) = (self.color(*color).0, self.number(*roughness).unwrap_or(0.5));
                let sheen = json!({ "sheenColorFactor": color, "sheenRoughnessFactor": roughness });
                words["extensions"]["KHR_materials_sheen"] = sheen;
            }
            M::Sum { of } | M::Blend { of, .. } => {
                other(self, "mixed");
                let first = self.builder.surfaces[of[0].0 as usize].material.clone();
                self.surface(&first, words);
            }
            M::Open => {
                other(self, "open");
                put(([1.0; 3], None), 0.0, 1.0);
                words["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(0.0);
                words["alphaMode"] = json!("BLEND");
            }
        }
    }

    fn clear(&mut self, words: &mut Value, index: &SpectralCurve, thickness: f32) {
        self.extensions.extend(["KHR_materials_transmission", "KHR_materials_ior"]);
        words["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": 1.0 });
        words["extensions"]["KHR_materials_ior"] = json!({ "ior": index.at(&[587.6])[0] });
        if thickness > 0.0 {
            self.extensions.insert("KHR_materials_volume");
            words["extensions"]["KHR_materials_volume"] = json!({ "thicknessFactor": thickness });
        }
    }
}

/// A value as this program reads it.
fn own(value: &impl serde::Serialize) -> Result<Value, String> {
    serde_json::to_value(value).map_err(|e| e.to_string())
}

fn matrix(place: &DAffine3) -> [f64; 16] {
    DMat4::from(*place).to_cols_array()
}

fn srgb_code(light: f32) -> u8 {
    (dioptric_spectrum::srgb_encode(f64::from(light.clamp(0.0, 1.0))) * 255.0).round() as u8
}

/// Returns the linear sRGB color of a reflectance under D65.
fn color_of(curve: &SpectralCurve) -> [f32; 3] {
    if let Some(value) = curve.constant_value() {
        return [value.clamp(0.0, 1.0); 3];
    }
    let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).expect("a valid range");
    let light = Illuminant::D65.spectrum().sample_held(&grid);
    let lit = |of: &dyn Fn(f32) -> f64| -> Vec<f64> {
        grid.centers_nm().iter().zip(&light).map(|(nm, light)| light * of(*nm as f32)).collect()
    };
    let xyz = Observer::Cie1931.xyz(&grid, &lit(&|nm| f64::from(curve.at(&[nm])[0])));
    let white = Observer::Cie1931.xyz(&grid, &lit(&|_| 1.0)).0[1];
    let rgb = dioptric_spectrum::Xyz(xyz.0.map(|v| v / white)).to_linear_srgb();
    rgb.map(|v| v.clamp(0.0, 1.0) as f32)
}

/// Returns the linear sRGB color of a light over that of D65, its largest part 1, and the luminous intensity, illuminance or luminance that a reader
/// that takes white as D65 gives it back.
fn color_of_light(curve: &SpectralCurve) -> ([f32; 3], f64) {
    let grid = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
    let values: Vec<f64> = grid.centers_nm().iter().map(|&nm| f64::from(curve.at(&[nm as f32])[0])).collect();
    let xyz = Observer::Cie1931.xyz(&grid, &values);
    let luminous = xyz.luminance_cd_m2();
    if luminous.is_nan() || luminous <= 0.0 {
        return ([1.0; 3], 0.0);
    }
    let rgb = dioptric_spectrum::Xyz(xyz.0.map(|v| v / xyz.0[1])).to_linear_srgb().map(|v| v.max(0.0));
    let largest = rgb.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let rgb = rgb.map(|v| v / largest);
    let of_rgb = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    (rgb.map(|v| v as f32), luminous / of_rgb)
}

/// Returns a sphere as triangles, with the coordinates of the shape.
fn sphere(radius_m: f32) -> TriangleMesh {
    grid(AROUND, AROUND / 2, |u, v| {
        let (sin, cos) = (std::f32::consts::PI * (v - 0.5)).sin_cos();
        let around = Vec2::from_angle(std::f32::consts::TAU * u);
        let normal = (cos * around).extend(sin);
        (radius_m * normal, normal)
    })
}

/// Returns a band about the z axis as triangles: of these radii and heights at its lower and upper end, or at its hole and its rim.
fn mantle(radii_m: [f32; 2], heights_m: [f32; 2]) -> TriangleMesh {
    let is_flat = heights_m[0] == heights_m[1];
    grid(AROUND, 1, |u, v| {
        let around = Vec2::from_angle(std::f32::consts::TAU * u);
        // On a disc v runs from the rim inwards.
        let along = if is_flat { 1.0 - v } else { v };
        let radius_m = radii_m[0] + along * (radii_m[1] - radii_m[0]);
        let height_m = heights_m[0] + v * (heights_m[1] - heights_m[0]);
        let normal = if is_flat { Vec3::Z } else { around.extend(0.0) };
        ((radius_m * around).extend(height_m), normal)
    })
}

fn grid(columns: usize, rows: usize, at: impl Fn(f32, f32) -> (Vec3, Vec3)) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
            let (position, normal) = at(u, v);
            mesh.positions.push(position);
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::new(u, v));
        }
    }
    let number = |column: usize, row: usize| (row * (columns + 1) + column) as u32;
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [number(column, row), number(column + 1, row)];
            let [c, d] = [number(column + 1, row + 1), number(column, row + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}
