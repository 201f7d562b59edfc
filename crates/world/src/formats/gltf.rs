//! Worlds of glTF files: `.gltf` with its buffers beside it or within, and `.glb`.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use base64::prelude::{BASE64_STANDARD, Engine};
use dioptric_spectrum::Cancel;
use glam::{DAffine3, DMat4, DVec3, Vec2, Vec3};
use gltf::{Gltf, Node, accessor, buffer::Source, camera::Projection, khr_lights_punctual::Kind, mesh::Mode};

use super::read_bytes;
use crate::{
    CameraKind, Emission, Encoding, Light, Material, MaterialId, Shape, SpectralCurve, Texture, TextureId,
    TriangleMesh, UvMapping, WorldBuilder, WorldCamera, WorldError, Wrap, image_texture::ImageTexture,
};

/// The most bytes that a file and its buffers may have.
const MAX_BYTES: u64 = 1 << 31;
/// How deep nodes may be nested.
const MAX_DEPTH: usize = 64;
/// Luminous efficacy at 555 nm, lm/W: glTF gives lights in candela and lux.
const LUMENS_PER_WATT: f32 = 683.002;

/// Reads the default scene.
pub(super) fn read(path: &Path, place: DAffine3, cancel: &Cancel) -> Result<WorldBuilder, WorldError> {
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let bytes = read_bytes(path, MAX_BYTES)?;
    let gltf = parse(&bytes).map_err(unreadable)?;
    let mut reader = Reader {
        builder: WorldBuilder::new(),
        file: path.to_owned(),
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        buffers: Vec::new(),
        materials: HashMap::new(),
        images: HashMap::new(),
        n_bytes: bytes.len() as u64,
        cancel,
    };
    for buffer in gltf.buffers() {
        let data = match buffer.source() {
            Source::Bin => gltf.blob.clone().unwrap_or_default(),
            Source::Uri(uri) => reader.resource(uri)?,
        };
        if data.len() < buffer.length() {
            let (found, expected) = (data.len(), buffer.length());
            return Err(unreadable(format!("buffer {} has {found} bytes, expected {expected}", buffer.index())));
        }
        reader.buffers.push(data);
    }
    for accessor in gltf.accessors() {
        reader.check(&accessor)?;
    }
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let nodes = scene.ok_or_else(|| unreadable("it has no scene".to_owned()))?;
    for node in nodes.nodes() {
        reader.node(&node, place, 0)?;
    }
    for extension in gltf.extensions_used() {
        if extension != "KHR_lights_punctual" {
            reader.builder.note(format!("extension '{extension}': not supported, left out"));
        }
    }
    if gltf.animations().next().is_some() {
        reader.builder.note("animations: not followed, everything stands as it is written");
    }
    Ok(reader.builder)
}

/// Parses and validates a file. The crate's validation looks up the accessor of POSITION before it has checked that
/// there is one, and does not see images without a source, which it takes for granted later: both are checked here.
fn parse(bytes: &[u8]) -> Result<Gltf, String> {
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(|e| e.to_string())?;
    let root = document.into_json();
    let mut used = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|p| p.attributes.values());
    if let Some(index) = used.find(|index| index.value() >= root.accessors.len()) {
        let n = root.accessors.len();
        return Err(format!("a mesh names accessor {}, of which there are {n}", index.value()));
    }
    let has_source = |image: &gltf::json::Image| match image.buffer_view {
        Some(_) => image.mime_type.is_some(),
        None => image.uri.is_some(),
    };
    if let Some(index) = root.images.iter().position(|image| !has_source(image)) {
        return Err(format!("image {index} has neither a uri nor a bufferView with its mimeType"));
    }
    let document = gltf::Document::from_json(root).map_err(|e| e.to_string())?;
    Ok(Gltf { document, blob })
}

struct Reader<'c> {
    builder: WorldBuilder,
    file: PathBuf,
    folder: PathBuf,
    buffers: Vec<Vec<u8>>,
    materials: HashMap<Option<usize>, (MaterialId, Option<Emission>)>,
    images: HashMap<usize, Option<Arc<ImageTexture>>>,
    n_bytes: u64,
    cancel: &'c Cancel,
}

impl Reader<'_> {
    fn fault(&self, reason: impl Into<String>) -> WorldError {
        WorldError::Unreadable { file: self.file.clone(), reason: reason.into() }
    }

    /// Returns what a URI names: data within it, or a file beside the world's.
    fn resource(&mut self, uri: &str) -> Result<Vec<u8>, WorldError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, base64) = data.split_once(";base64,").ok_or_else(|| self.fault("data that isn't in base64"))?;
            return BASE64_STANDARD.decode(base64).map_err(|e| self.fault(format!("a data URI: {e}")));
        }
        let bytes = read_bytes(&self.folder.join(uri.replace("%20", " ")), MAX_BYTES.saturating_sub(self.n_bytes))?;
        self.n_bytes += bytes.len() as u64;
        Ok(bytes)
    }

    /// Checks that an accessor lies within its buffer, which the crate takes for granted.
    fn check(&self, accessor: &accessor::Accessor<'_>) -> Result<(), WorldError> {
        let index = accessor.index();
        if accessor.sparse().is_some() {
            return Err(self.fault(format!("accessor {index} is sparse, which isn't supported")));
        }
        let Some(view) = accessor.view() else { return Ok(()) };
        let size = accessor.size() as u64;
        let stride = view.stride().map_or(size, |stride| stride as u64);
        let n_bytes = match accessor.count() as u64 {
            0 => 0,
            count => (count - 1).saturating_mul(stride).saturating_add(size),
        };
        let end = (accessor.offset() as u64).saturating_add(n_bytes);
        let view_end = (view.offset() as u64).saturating_add(view.length() as u64);
        let in_buffer = self.buffers.get(view.buffer().index()).map_or(0, |buffer| buffer.len() as u64);
        if stride < size || end > view.length() as u64 || view_end > in_buffer {
            return Err(self.fault(format!("accessor {index} reaches beyond its buffer")));
        }
        Ok(())
    }

    fn node(&mut self, node: &Node<'_>, parent: DAffine3, depth: usize) -> Result<(), WorldError> {
        self.cancel.check()?;
        if depth > MAX_DEPTH {
            return Err(self.fault(format!("nodes nested deeper than {MAX_DEPTH}")));
        }
        let columns = node.transform().matrix().map(|column| column.map(f64::from));
        let place = parent * DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns));
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                self.primitive(&primitive, place)?;
            }
        }
        if let Some(light) = node.light() {
            self.light(&light, place);
        }
        if let Some(camera) = node.camera() {
            self.camera(&camera, place);
        }
        for child in node.children() {
            self.node(&child, place, depth + 1)?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &gltf::Primitive<'_>, place: DAffine3) -> Result<(), WorldError> {
        if primitive.mode() != Mode::Triangles {
            self.builder.note(format!("a mesh of {:?}: only triangles are supported, left out", primitive.mode()));
            return Ok(());
        }
        self.check_types(primitive)?;
        let buffers = &self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
        let Some(positions) = reader.read_positions() else { return Ok(()) };
        let positions: Vec<Vec3> = positions.map(Vec3::from_array).collect();
        let normals = reader.read_normals().map_or(Vec::new(), |n| n.map(Vec3::from_array).collect());
        // v runs down the picture in glTF.
        let uvs = reader
            .read_tex_coords(0)
            .map_or(Vec::new(), |uvs| uvs.into_f32().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect());
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..positions.len() as u32).collect(),
        };
        let triangles = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let mesh = TriangleMesh { positions, normals, uvs, triangles };
        mesh.check().map_err(|e| self.fault(e.to_string()))?;
        let (material, glow) = self.material(&primitive.material())?;
        self.builder.add_shape(Shape::Mesh(mesh), place, material, glow);
        Ok(())
    }

    /// Checks that attributes have the types that the crate's readers take for granted.
    fn check_types(&self, primitive: &gltf::Primitive<'_>) -> Result<(), WorldError> {
        use accessor::{DataType, Dimensions};
        let is_integer = |of: DataType| matches!(of, DataType::U8 | DataType::U16 | DataType::U32);
        let attributes = primitive.attributes().map(|(semantic, accessor)| {
            let (of, dimensions) = (accessor.data_type(), accessor.dimensions());
            let is_sound = match semantic {
                gltf::Semantic::Positions | gltf::Semantic::Normals => {
                    of == DataType::F32 && dimensions == Dimensions::Vec3
                }
                gltf::Semantic::TexCoords(_) => {
                    matches!(of, DataType::F32 | DataType::U8 | DataType::U16) && dimensions == Dimensions::Vec2
                }
                _ => true,
            };
            (accessor.index(), is_sound)
        });
        let indices = primitive.indices().map(|accessor| {
            let is_sound = is_integer(accessor.data_type()) && accessor.dimensions() == Dimensions::Scalar;
            (accessor.index(), is_sound)
        });
        match attributes.chain(indices).find(|(_, is_sound)| !is_sound) {
            None => Ok(()),
            Some((index, _)) => Err(self.fault(format!("accessor {index} is of a type that its use doesn't allow"))),
        }
    }

    /// Metals mirror their color; others are a base below a clear coat of index 1.5, as glTF's own model has it.
    fn material(&mut self, material: &gltf::Material<'_>) -> Result<(MaterialId, Option<Emission>), WorldError> {
        if let Some(known) = self.materials.get(&material.index()) {
            return Ok(known.clone());
        }
        let pbr = material.pbr_metallic_roughness();
        let name = material.name().unwrap_or("material").to_owned();
        let [r, g, b, alpha] = pbr.base_color_factor();
        if alpha < 1.0 || material.alpha_mode() != gltf::material::AlphaMode::Opaque {
            self.builder.note(format!("material '{name}': opaque, though the file has it transparent"));
        }
        let mut base = self.curve(SpectralCurve::from_rgb_reflectance([r, g, b]));
        if let Some(info) = pbr.base_color_texture() {
            let picture = self.picture(&info.texture())?;
            base = self.builder.add_texture(Texture::Product([base, picture]));
        }
        if pbr.metallic_roughness_texture().is_some() || material.normal_texture().is_some() {
            self.builder.note(format!("material '{name}': its roughness and normal pictures are left out"));
        }
        let alpha = self.curve(SpectralCurve::constant(pbr.roughness_factor().powi(2)));
        let roughness = Some([alpha, alpha]);
        let coated = Material::Coated { base, index: SpectralCurve::constant(1.5), roughness };
        let mirror = Material::Mirror { reflectance: base, roughness };
        let metallic = pbr.metallic_factor().clamp(0.0, 1.0);
        let id = if metallic <= 0.0 {
            self.builder.add_material(&name, coated)
        } else if metallic >= 1.0 {
            self.builder.add_material(&name, mirror)
        } else {
            let of = [self.builder.add_material(&name, coated), self.builder.add_material(&name, mirror)];
            let amount = self.curve(SpectralCurve::constant(metallic));
            self.builder.add_material(&name, Material::Blend { of, amount })
        };
        let emissive = material.emissive_factor();
        let glow = emissive.iter().any(|e| *e > 0.0).then(|| {
            self.builder.note(format!("material '{name}': a glow of 1 is taken as that of 1 W m⁻² sr⁻¹ nm⁻¹"));
            Emission { radiance: SpectralCurve::from_rgb_light(emissive), is_two_sided: material.double_sided() }
        });
        self.materials.insert(material.index(), (id, glow.clone()));
        Ok((id, glow))
    }

    fn curve(&mut self, curve: SpectralCurve) -> TextureId {
        self.builder.add_texture(Texture::Curve(curve))
    }

    /// Returns the picture of a texture, white with a note where it can't be read.
    fn picture(&mut self, texture: &gltf::Texture<'_>) -> Result<TextureId, WorldError> {
        let source = texture.source();
        let image = match self.images.get(&source.index()) {
            Some(image) => image.clone(),
            None => {
                let image = match source.source() {
                    gltf::image::Source::Uri { uri, .. } if !uri.starts_with("data:") => {
                        let path = self.folder.join(uri.replace("%20", " "));
                        ImageTexture::read(&path, Encoding::Srgb, Wrap::Repeat).map_err(|e| e.to_string())
                    }
                    _ => Err("pictures within the file aren't supported".to_owned()),
                };
                let image = image.map(Arc::new).map_err(|reason| {
                    self.builder.note(format!("picture {}: {reason}; white in its place", source.index()));
                });
                self.images.insert(source.index(), image.clone().ok());
                image.ok()
            }
        };
        Ok(match image {
            Some(image) => self.builder.add_texture(Texture::Image { image, mapping: UvMapping::IDENTITY, scale: 1.0 }),
            None => self.curve(SpectralCurve::constant(1.0)),
        })
    }

    /// Lights of glTF shine along −z, in candela or lux; their colors are those of daylight D65 tinted.
    fn light(&mut self, light: &gltf::khr_lights_punctual::Light<'_>, place: DAffine3) {
        // A unit of `from_rgb_light` is 683 lm/W over the area below the photopic curve, 106.857 nm.
        let curve =
            SpectralCurve::from_rgb_light(light.color()).scaled(light.intensity() / (LUMENS_PER_WATT * 106.857));
        let direction = place.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let position = place.translation;
        self.builder.add_light(match light.kind() {
            Kind::Directional => Light::Distant { direction, irradiance: curve },
            Kind::Point => Light::Point { position, intensity: curve },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => Light::Spot {
                position,
                direction,
                intensity: curve,
                inner_rad: f64::from(inner_cone_angle),
                outer_rad: f64::from(outer_cone_angle),
            },
        });
    }

    /// Cameras of glTF look along −z with y up; ours along +z, x to the right.
    fn camera(&mut self, camera: &gltf::Camera<'_>, place: DAffine3) {
        let rows = 480.0_f64;
        let (kind, aspect) = match camera.projection() {
            Projection::Perspective(perspective) => {
                let aspect = f64::from(perspective.aspect_ratio().unwrap_or(1.5));
                let vertical = f64::from(perspective.yfov());
                // Across the shorter side.
                let fov = if aspect >= 1.0 { vertical } else { 2.0 * ((0.5 * vertical).tan() * aspect).atan() };
                let kind = CameraKind::Perspective {
                    fov_deg: fov.to_degrees(),
                    lens_radius_m: 0.0,
                    focus_distance_m: 1e6,
                    screen_window: None,
                };
                (kind, aspect)
            }
            Projection::Orthographic(view) => {
                let (x, y) = (f64::from(view.xmag()), f64::from(view.ymag()));
                (CameraKind::Orthographic { screen_window: [-x, x, -y, y] }, x / y)
            }
        };
        // The node's scale is no part of a camera.
        let m = place.matrix3;
        let [x, y, z] = [m.x_axis, m.y_axis, -m.z_axis].map(|axis| axis.normalize_or(DVec3::X));
        let columns = (rows * aspect).clamp(1.0, 65536.0) as usize;
        self.builder.add_camera(WorldCamera {
            name: camera.name().unwrap_or("camera").to_owned(),
            world_from_camera: DAffine3::from_cols(x, y, z, place.translation),
            kind,
            resolution: (columns, rows as usize),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ray, World};

    fn file(indices: &str, count: usize) -> String {
        // Three vertices of 12 bytes, then three indices of 2.
        let floats: Vec<u8> =
            [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|f| f.to_le_bytes()).collect();
        let bytes: Vec<u8> = floats.into_iter().chain([0, 0, 1, 0, 2, 0]).collect();
        let base64 = BASE64_STANDARD.encode(bytes);
        format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_lights_punctual"],
            "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":683}}]}}}},
            "scene":0,"scenes":[{{"nodes":[0,1]}}],
            "nodes":[{{"mesh":0,"translation":[0,0,-3]}},
                     {{"camera":0,"translation":[0,0,2],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}],
            "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1,"aspectRatio":2}}}}],
            "materials":[{{"name":"red","pbrMetallicRoughness":{{"baseColorFactor":[1,0,0,1],"metallicFactor":0}},
                           "emissiveFactor":[0,0,1]}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
                         {{"bufferView":1,"componentType":5123,"count":{indices},"type":"SCALAR"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}}],
            "buffers":[{{"byteLength":42,"uri":"data:application/octet-stream;base64,{base64}"}}]}}"#
        )
    }

    fn read_text(text: &str) -> Result<World, WorldError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world.gltf");
        std::fs::write(&path, text).unwrap();
        crate::read_world(&path, &crate::ReadOptions::default(), &Cancel::new())
    }

    #[test]
    fn triangle_camera_and_light_are_read() {
        let world = read_text(&file("3", 3)).unwrap();
        let camera = &world.cameras()[0];
        assert_eq!(camera.resolution, (960, 480));
        let forwards = camera.world_from_camera.transform_vector3(DVec3::Z).as_vec3();
        let origin = camera.world_from_camera.translation.as_vec3() + Vec3::new(0.2, 0.2, 0.0);
        let hit = world.intersect(&Ray { origin, direction: forwards }, f32::INFINITY).unwrap();
        // One rounding of an f32.
        assert!((hit.distance_m - 5.0).abs() <= 5.0 * f32::EPSILON, "{}", hit.distance_m);
        let albedo = world.bsdf(&hit, -forwards, &[450.0, 650.0]).albedo();
        assert!(albedo[1] > 0.6 && albedo[0] < 0.2, "{albedo:?}");
        assert!(world.emission(&hit, -forwards, &[450.0])[0] > 0.1);
        assert_eq!(world.n_lights(), 2);
    }

    #[test]
    fn ranges_beyond_a_buffer_are_refused() {
        assert!(read_text(&file("3", 4)).unwrap_err().to_string().contains("accessor 0"));
        assert!(read_text(&file("4000000000", 3)).unwrap_err().to_string().contains("accessor 1"));
        let no_accessor = file("3", 3).replace("\"POSITION\":0", "\"POSITION\":9");
        assert!(read_text(&no_accessor).unwrap_err().to_string().contains("accessor 9, of which there are 2"));
        assert!(read_text("{}").is_err());
        for image in ["{}", r#"{"bufferView":0}"#] {
            let images = format!(r#""images":[{{"uri":"data:,"}},{image}],"buffers""#);
            let error = read_text(&file("3", 3).replace("\"buffers\"", &images)).unwrap_err().to_string();
            assert!(error.contains("image 1") && error.contains("uri"), "{error}");
        }
        let floats = file("1", 3).replace("\"componentType\":5123", "\"componentType\":5126");
        assert!(read_text(&floats).unwrap_err().to_string().contains("accessor 1"));
    }
}
