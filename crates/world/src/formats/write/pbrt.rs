//! Worlds as files of pbrt's 4th version.

use std::{
    collections::{BTreeSet, HashMap, HashSet},
    fmt::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DAffine3, DMat3, DMat4, DVec3, Vec2};
use image::ImageFormat;

use super::Written;
use crate::{
    Beyond, CameraKind, Coordinates, Emission, Encoding, FallOff, GroupId, ImageTexture, Interface, Layout, Light,
    Material, MaterialId, MediumId, NoiseKind, Procedural, Relief, Roughness, RoughnessLaw, Shape, SkyImage,
    SkyMapping, SpectralCurve, Texture, TextureId, TriangleMesh, UvMapping, WorldBuilder, WorldCamera, WorldError,
    Wrap, world::NewShape,
};

/// Meshes of more triangles are files of their own.
const MOST_INLINE: usize = 200;

/// Returns the files of a world.
pub(super) fn written(builder: &WorldBuilder, path: &Path) -> Result<Written, WorldError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    // Without a camera a file of pbrt is taken as left-handed with y up.
    let in_frame = builder.cameras.is_empty().then(|| builder.clone().in_frame(DVec3::Y, true));
    let mut writer = Writer {
        builder: in_frame.as_ref().unwrap_or(builder),
        text: String::from("# Written by dioptric. Lengths are metres, spectra absolute: W, m, sr, nm.\n"),
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        beside: format!("{stem}_files"),
        files: Vec::new(),
        losses: BTreeSet::new(),
        media: HashSet::new(),
        pictures: HashMap::new(),
        meshes: HashMap::new(),
        textures: HashMap::new(),
        materials: HashMap::new(),
        error: None,
    };
    writer.world();
    if let Some(error) = writer.error {
        return Err(error);
    }
    let mut files = writer.files;
    files.push((path.to_owned(), writer.text.into_bytes()));
    Ok(Written { files, losses: writer.losses.into_iter().collect() })
}

struct Writer<'a> {
    builder: &'a WorldBuilder,
    text: String,
    folder: PathBuf,
    /// The folder of pictures and meshes, beside the file.
    beside: String,
    files: Vec<(PathBuf, Vec<u8>)>,
    losses: BTreeSet<String>,
    /// Media that have been written.
    media: HashSet<MediumId>,
    /// Pictures by where they are in memory, with their names.
    pictures: HashMap<usize, (String, Encoding)>,
    meshes: HashMap<usize, String>,
    /// Textures that have been written, as numbers or as spectra.
    textures: HashMap<(TextureId, bool), String>,
    materials: HashMap<MaterialId, String>,
    error: Option<WorldError>,
}

/// What a parameter says.
enum Value {
    Curve(SpectralCurve),
    Texture(String),
}

impl Writer<'_> {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn lose(&mut self, what: impl Into<String>) {
        self.losses.insert(what.into());
    }

    fn world(&mut self) {
        let builder = self.builder;
        let around = builder.eye.map(|(_, medium)| self.medium(medium)).unwrap_or_default();
        if !around.is_empty() {
            self.line(&format!("MediumInterface \"\" \"{around}\""));
        }
        match builder.cameras.first() {
            Some(camera) => self.camera(camera),
            None => self.line("Film \"rgb\" \"integer xresolution\" 720 \"integer yresolution\" 480"),
        }
        if builder.cameras.len() > 1 {
            let more = builder.cameras.len() - 1;
            self.lose(format!("{more} of {} cameras: pbrt has the first", builder.cameras.len()));
        }
        self.line("WorldBegin");
        if !around.is_empty() {
            self.line("MediumInterface \"\" \"\"");
        }
        if builder.objects.there().any(|object| builder.objects.parent(object).is_some()) {
            self.lose("which objects are parts of others");
        }
        let uses = |group: GroupId| builder.instances.iter().any(|instance| instance.group == group);
        for group in (1..builder.n_groups).map(GroupId).filter(|group| uses(*group)) {
            self.line(&format!("ObjectBegin \"group {}\"", group.0));
            for shape in builder.shapes.iter().filter(|shape| shape.group == group) {
                self.shape(shape, None);
            }
            self.line("ObjectEnd");
        }
        for shape in builder.shapes.iter().filter(|shape| shape.group == GroupId::ROOT) {
            self.shape(shape, Some(builder.objects.name(shape.object)));
        }
        for instance in &builder.instances {
            self.line("AttributeBegin");
            self.line(&format!("#ObjectName {}", on_a_line(builder.objects.name(instance.object))));
            self.place("ConcatTransform", &instance.place);
            self.line(&format!("ObjectInstance \"group {}\"", instance.group.0));
            self.line("AttributeEnd");
        }
        for new in &builder.lights {
            self.line("AttributeBegin");
            self.line(&format!("#ObjectName {}", on_a_line(builder.objects.name(new.object))));
            self.light(&new.light);
            self.line("AttributeEnd");
        }
    }

    fn place(&mut self, directive: &str, place: &DAffine3) {
        let m = DMat4::from(*place).to_cols_array();
        let numbers: Vec<String> = m.iter().map(f64::to_string).collect();
        self.line(&format!("{directive} [ {} ]", numbers.join(" ")));
    }

    fn camera(&mut self, camera: &WorldCamera) {
        let (columns, rows) = camera.resolution;
        self.line(&format!("Film \"rgb\" \"integer xresolution\" {columns} \"integer yresolution\" {rows}"));
        self.place("Transform", &camera.world_from_camera.inverse());
        let window = |[a, b, c, d]: [f64; 4]| format!(" \"float screenwindow\" [ {a} {b} {c} {d} ]");
        let words = match &camera.kind {
            CameraKind::Perspective { fov_deg, lens_radius_m, focus_distance_m, screen_window } => {
                let lens = match *lens_radius_m > 0.0 {
                    true => format!(" \"float lensradius\" {lens_radius_m} \"float focaldistance\" {focus_distance_m}"),
                    false => String::new(),
                };
                let window = screen_window.map(window).unwrap_or_default();
                format!("\"perspective\" \"float fov\" {fov_deg}{lens}{window}")
            }
            CameraKind::Orthographic { screen_window } => format!("\"orthographic\"{}", window(*screen_window)),
            CameraKind::Panorama { mapping } => {
                let mapping = if *mapping == SkyMapping::LatLong { "equirectangular" } else { "equalarea" };
                format!("\"spherical\" \"string mapping\" \"{mapping}\"")
            }
            CameraKind::Lens { .. } | CameraKind::Other { .. } => {
                self.lose(format!("the camera '{}', whose lens is a file's: a view of 40° in its place", camera.name));
                "\"perspective\" \"float fov\" 40".to_owned()
            }
        };
        self.line(&format!("Camera {words}"));
    }

    fn shape(&mut self, shape: &NewShape, name: Option<&str>) {
        let material = self.material(shape.material);
        self.line("AttributeBegin");
        if let Some(name) = name {
            self.line(&format!("#ObjectName {}", on_a_line(name)));
        }
        let surface = &self.builder.surfaces[shape.material.0 as usize];
        self.line(&format!("NamedMaterial \"{material}\""));
        let told = shape.interface.unwrap_or(Interface { inside: None, outside: None });
        let inside = surface.filling.or(told.inside);
        let [inside, outside] =
            [inside, told.outside].map(|medium| medium.map(|id| self.medium(id)).unwrap_or_default());
        if inside != outside {
            self.line(&format!("MediumInterface \"{inside}\" \"{outside}\""));
        }
        let coverage = surface.coverage.map(|coverage| match self.value(coverage, true) {
            Value::Curve(curve) => format!(" \"float alpha\" {}", curve.mean_visible()),
            Value::Texture(name) => format!(" \"texture alpha\" \"{name}\""),
        });
        if let Some(Emission { radiance, is_two_sided }) = &shape.emission {
            if surface.glow.is_some() {
                self.lose("pictures that surfaces glow by: they glow alike all over");
            }
            let light = light_words("L", radiance);
            self.line(&format!("AreaLightSource \"diffuse\" \"bool twosided\" {is_two_sided} {light}"));
        }
        if shape.is_reversed {
            self.line("ReverseOrientation");
        }
        if shape.place != DAffine3::IDENTITY {
            self.place("ConcatTransform", &shape.place);
        }
        let words = match &*shape.shape {
            Shape::Sphere { radius_m } => Some(format!("\"sphere\" \"float radius\" {radius_m}")),
            Shape::Disc { radius_m, inner_radius_m } => {
                Some(format!("\"disk\" \"float radius\" {radius_m} \"float innerradius\" {inner_radius_m}"))
            }
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => Some(format!(
                "\"cylinder\" \"float radius\" {radius_m} \"float zmin\" {z_min_m} \"float zmax\" {z_max_m}"
            )),
            Shape::Lathe(_) => {
                self.lose("surfaces of revolution by a profile: left out");
                None
            }
            Shape::Mesh(mesh) => Some(self.mesh(mesh, Arc::as_ptr(&shape.shape) as usize)),
        };
        if let Some(words) = words {
            self.line(&format!("Shape {words}{}", coverage.unwrap_or_default()));
        }
        self.line("AttributeEnd");
    }

    fn mesh(&mut self, mesh: &TriangleMesh, key: usize) -> String {
        if !mesh.second_uvs.is_empty() {
            self.lose("second texture coordinates");
        }
        if mesh.triangles.len() > MOST_INLINE {
            if let Some(name) = self.meshes.get(&key) {
                return format!("\"plymesh\" \"string filename\" \"{name}\"");
            }
            let name = format!("{}/mesh_{}.ply", self.beside, self.meshes.len() + 1);
            self.files.push((self.folder.join(&name), ply(mesh)));
            self.meshes.insert(key, name.clone());
            return format!("\"plymesh\" \"string filename\" \"{name}\"");
        }
        let list = |values: &mut dyn Iterator<Item = f32>| values.map(|v| v.to_string()).collect::<Vec<_>>().join(" ");
        let indices = mesh.triangles.as_flattened().iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
        let mut words = format!("\"trianglemesh\" \"integer indices\" [ {indices} ]");
        let points = list(&mut mesh.positions.iter().flat_map(|p| p.to_array()));
        let _ = write!(words, "\n  \"point3 P\" [ {points} ]");
        if !mesh.normals.is_empty() {
            let _ = write!(words, "\n  \"normal N\" [ {} ]", list(&mut mesh.normals.iter().flat_map(|n| n.to_array())));
        }
        if !mesh.uvs.is_empty() {
            let _ = write!(words, "\n  \"point2 uv\" [ {} ]", list(&mut mesh.uvs.iter().flat_map(|uv| uv.to_array())));
        }
        words
    }

    fn light(&mut self, light: &Light) {
        match light {
            Light::Point { position: p, intensity } => {
                let words = light_words("I", intensity);
                self.line(&format!("LightSource \"point\" \"point3 from\" [ {} {} {} ] {words}", p.x, p.y, p.z));
            }
            Light::Spot { position: p, direction, intensity, inner_rad, outer_rad, fall_off } => {
                if *fall_off != FallOff::Smooth && inner_rad < outer_rad {
                    self.lose("how spots of other formats fall off towards their rims: by pbrt's formula");
                }
                let to = *p + *direction;
                let (cone, delta) = (outer_rad.to_degrees(), (outer_rad - inner_rad).to_degrees());
                let words = light_words("I", intensity);
                self.line(&format!(
                    "LightSource \"spot\" \"point3 from\" [ {} {} {} ] \"point3 to\" [ {} {} {} ] \"float coneangle\" {cone} \"float conedeltaangle\" {delta} {words}",
                    p.x, p.y, p.z, to.x, to.y, to.z
                ));
            }
            Light::Distant { direction: d, irradiance } => {
                let words = light_words("L", irradiance);
                self.line(&format!(
                    "LightSource \"distant\" \"point3 from\" [ 0 0 0 ] \"point3 to\" [ {} {} {} ] {words}",
                    d.x, d.y, d.z
                ));
            }
            Light::Sky { radiance } => {
                let words = light_words("L", radiance);
                self.line(&format!("LightSource \"infinite\" {words}"));
            }
            Light::SkyImage(sky) => {
                let (image, mapping) = match sky.mapping {
                    SkyMapping::EqualArea => (sky.image.clone(), "as it is"),
                    SkyMapping::LatLong => (Arc::new(equal_area(sky)), "made anew"),
                };
                if mapping == "made anew" {
                    self.lose(
                        "pictures of the sky by height and azimuth: sampled anew as pbrt's squares of equal areas",
                    );
                }
                let (file, encoding) = self.picture(&image);
                if encoding == Encoding::Linear && file.ends_with("png") {
                    self.lose("pictures of the sky in codes that stand in proportion for light: as sRGB");
                }
                self.place("ConcatTransform", &DAffine3::from_mat3(sky.world_from_sky));
                self.line(&format!(
                    "LightSource \"infinite\" \"string filename\" \"{file}\" \"float scale\" {}",
                    sky.scale
                ));
            }
            Light::Pictured { position, intensity, picture, layout, world_from_light } => {
                let (x, y, z) = (world_from_light.x_axis, world_from_light.y_axis, world_from_light.z_axis);
                let (kind, matrix3, angle) = match layout {
                    Layout::Around(_) => ("goniometric", DMat3::from_cols(x, z, y), String::new()),
                    Layout::Ahead { tan_x, tan_y } => {
                        let fov = 2.0 * tan_x.min(*tan_y).atan().to_degrees();
                        ("projection", *world_from_light, format!(" \"float fov\" {fov}"))
                    }
                };
                let (file, _) = self.picture(picture);
                let words = light_words("I", intensity);
                self.place("ConcatTransform", &DAffine3 { matrix3, translation: *position });
                self.line(&format!("LightSource \"{kind}\" \"string filename\" \"{file}\"{angle} {words}"));
            }
        }
    }

    /// Returns the name of the file of a picture, which is added where it isn't there yet, and what its numbers stand for.
    fn picture(&mut self, image: &Arc<ImageTexture>) -> (String, Encoding) {
        let key = image.texels_key();
        if let Some(known) = self.pictures.get(&key) {
            return known.clone();
        }
        let (picture, encoding) = image.as_picture();
        let is_float = matches!(picture, image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_));
        let (kind, format) = if is_float { ("exr", ImageFormat::OpenExr) } else { ("png", ImageFormat::Png) };
        let name = format!("{}/picture_{}.{kind}", self.beside, self.pictures.len() + 1);
        let file = self.folder.join(&name);
        match dioptric_pictures::encode(&picture, format) {
            Ok(bytes) => self.files.push((file, bytes)),
            Err(error) => self.error = Some(WorldError::Unwritable { file, reason: error.to_string() }),
        }
        self.pictures.insert(key, (name.clone(), encoding));
        (name, encoding)
    }

    /// Returns the name of a material, written where it isn't yet.
    fn material(&mut self, id: MaterialId) -> String {
        if let Some(name) = self.materials.get(&id) {
            return name.clone();
        }
        let surface = &self.builder.surfaces[id.0 as usize];
        let plain = quoted(&surface.name);
        let is_taken = self.materials.values().any(|name| *name == plain);
        let name = if is_taken || plain.is_empty() { format!("{plain}.{}", id.0) } else { plain };
        self.materials.insert(id, name.clone());
        if surface.film.is_some() || surface.behind.is_some() {
            self.lose("films over materials of glTF, and light through their base");
        }
        if surface.turn_rad != 0.0 {
            self.lose("how far brushed surfaces are turned");
        }
        let relief = match surface.relief {
            None => String::new(),
            Some(Relief::Heights(heights)) => match self.value(heights, true) {
                Value::Texture(texture) => format!(" \"texture displacement\" \"{texture}\""),
                Value::Curve(_) => String::new(),
            },
            Some(Relief::Normals(normals) | Relief::ScaledNormals(normals, _)) => {
                if let Some(Relief::ScaledNormals(_, scale)) = surface.relief
                    && scale != 1.0
                {
                    self.lose("pictures of normals that are scaled: as they are");
                }
                match &self.builder.textures[normals.0 as usize] {
                    Texture::Image { image, .. } => {
                        let (file, _) = self.picture(&image.clone());
                        format!(" \"string normalmap\" \"{file}\"")
                    }
                    _ => String::new(),
                }
            }
            Some(Relief::Pattern(_)) => {
                self.lose("relief by a formula");
                String::new()
            }
        };
        let words = self.words_of(&surface.material.clone(), &surface.name);
        self.line(&format!("MakeNamedMaterial \"{name}\" \"string type\" {words}{relief}"));
        name
    }

    /// Returns the name of an even medium, written where it isn't yet; empty for one that can't be written.
    fn medium(&mut self, id: MediumId) -> String {
        let medium = self.builder.media[id.0 as usize].clone();
        if !medium.is_even() || medium.glow.is_some() {
            self.lose("media that glow or differ from place to place: left out");
            return String::new();
        }
        let name = format!("medium {}", id.0 + 1);
        if self.media.insert(id) {
            let [absorbed, scattered] = [&medium.absorption, &medium.scattering].map(points);
            self.line(&format!(
                "MakeNamedMedium \"{name}\" \"string type\" \"homogeneous\" \"spectrum sigma_a\" [ {absorbed} ] \"spectrum sigma_s\" [ {scattered} ] \"float g\" {}",
                medium.asymmetry
            ));
        }
        name
    }

    fn words_of(&mut self, material: &Material, name: &str) -> String {
        use Material as M;
        let near = |writer: &mut Self, kind: &str, as_what: &str| {
            writer.lose(format!("materials of kind '{kind}', {as_what}: {}", quoted(name)));
        };
        match material {
            M::Matte { reflectance } => format!("\"diffuse\"{}", self.param("reflectance", *reflectance)),
            M::RoughMatte { reflectance, .. } => {
                near(self, "rough matte", "as smooth ones");
                format!("\"diffuse\"{}", self.param("reflectance", *reflectance))
            }
            M::Translucent { reflectance, transmittance } => format!(
                "\"diffusetransmission\"{}{}",
                self.param("reflectance", *reflectance),
                self.param("transmittance", *transmittance)
            ),
            M::Mirror { reflectance, roughness } => {
                format!("\"conductor\"{}{}", self.param("reflectance", *reflectance), self.rough(roughness, ""))
            }
            M::Metal { n, k, roughness } => format!(
                "\"conductor\" \"spectrum eta\" [ {} ] \"spectrum k\" [ {} ]{}",
                points(n),
                points(k),
                self.rough(roughness, "")
            ),
            M::Dielectric { index, roughness } => {
                format!("\"dielectric\"{}{}", index_of(index), self.rough(roughness, ""))
            }
            M::Glass { index, roughness, .. } => {
                near(self, "glass of a color", "as clear glass");
                format!("\"dielectric\"{}{}", index_of(index), self.rough(roughness, ""))
            }
            M::Pane { index } => format!("\"thindielectric\"{}", index_of(index)),
            M::Coated { base, index, roughness } => format!(
                "\"coateddiffuse\"{}{}{}",
                self.param("reflectance", *base),
                index_of(index),
                self.rough(roughness, "")
            ),
            M::Substrate { base, roughness, .. } => {
                near(self, "substrate", "as coateddiffuse");
                format!("\"coateddiffuse\"{}{}", self.param("reflectance", *base), self.rough(roughness, ""))
            }
            M::Glossy { reflectance, roughness, .. } => {
                near(self, "glossy", "as a mirror");
                format!("\"conductor\"{}{}", self.param("reflectance", *reflectance), self.rough(roughness, ""))
            }
            M::MetallicRoughness { color, metallic, roughness, transmission, .. } => {
                near(self, "metallic roughness of glTF", "as plastic, metal or glass");
                let even = |writer: &Self, id: TextureId| match &writer.builder.textures[id.0 as usize] {
                    Texture::Curve(curve) => Some(curve.mean_visible()),
                    _ => None,
                };
                let alpha = even(self, *roughness).map_or(0.25, |rough| rough * rough);
                let rough = format!(" \"bool remaproughness\" false \"float roughness\" {alpha}");
                if transmission.is_some_and(|share| even(self, share).unwrap_or(1.0) > 0.5) {
                    return format!("\"dielectric\"{rough}");
                }
                match even(self, *metallic).unwrap_or(0.0) > 0.5 {
                    true => format!("\"conductor\"{}{rough}", self.param("reflectance", *color)),
                    false => format!("\"coateddiffuse\"{}{rough}", self.param("reflectance", *color)),
                }
            }
            M::Clearcoat { base, .. } | M::Sheen { base, .. } => {
                near(self, "below a coat or sheen", "without it");
                self.words_of(&self.builder.surfaces[base.0 as usize].material.clone(), name)
            }
            M::Sum { of } => {
                near(self, "sum of two", "as the first");
                self.words_of(&self.builder.surfaces[of[0].0 as usize].material.clone(), name)
            }
            M::Blend { of, amount } => {
                let [a, b] = of.map(|part| self.material(part));
                let amount = match self.value(*amount, true) {
                    Value::Curve(curve) => format!("\"float amount\" {}", curve.mean_visible()),
                    Value::Texture(texture) => format!("\"texture amount\" \"{texture}\""),
                };
                format!("\"mix\" \"string materials\" [ \"{a}\" \"{b}\" ] {amount}")
            }
            M::Hair { color, roughness: [along, around], tilt_deg, index } => format!(
                "\"hair\"{} \"float beta_m\" {along} \"float beta_n\" {around} \"float alpha\" {tilt_deg} \"float eta\" {index}",
                self.param("reflectance", *color)
            ),
            M::Open => "\"interface\"".to_owned(),
        }
    }

    fn param(&mut self, name: &str, texture: TextureId) -> String {
        match self.value(texture, false) {
            Value::Curve(curve) => format!(" \"spectrum {name}\" [ {} ]", points(&curve)),
            Value::Texture(texture) => format!(" \"texture {name}\" \"{texture}\""),
        }
    }

    /// Roughness is α, or pbrt's own of which α is the root.
    fn rough(&mut self, roughness: &Roughness, prefix: &str) -> String {
        let Some(alphas) = roughness else { return format!(" \"float {prefix}roughness\" 0") };
        let mut words = String::new();
        let roots = alphas.map(|alpha| match &self.builder.textures[alpha.0 as usize] {
            Texture::Alpha { roughness, by: RoughnessLaw::Root } => Some(*roughness),
            _ => None,
        });
        let (of, is_remapped) = match roots {
            [Some(u), Some(v)] => ([u, v], true),
            _ => (*alphas, false),
        };
        let _ = write!(words, " \"bool remaproughness\" {is_remapped}");
        for (name, texture) in [("uroughness", of[0]), ("vroughness", of[1])] {
            let _ = match self.value(texture, true) {
                Value::Curve(curve) => write!(words, " \"float {prefix}{name}\" {}", curve.mean_visible()),
                Value::Texture(texture) => write!(words, " \"texture {prefix}{name}\" \"{texture}\""),
            };
        }
        words
    }

    /// Returns a texture as a curve, or by the name that it is written under.
    fn value(&mut self, id: TextureId, is_number: bool) -> Value {
        let texture = self.builder.textures[id.0 as usize].clone();
        if let Texture::Curve(curve) = &texture {
            return Value::Curve(curve.clone());
        }
        if let Some(name) = self.textures.get(&(id, is_number)) {
            return Value::Texture(name.clone());
        }
        if let Texture::Alpha { roughness, by } = &texture
            && let Texture::Curve(curve) = &self.builder.textures[roughness.0 as usize]
        {
            return Value::Curve(SpectralCurve::constant(by.alpha(curve.mean_visible())));
        }
        let name = format!("{} {}", if is_number { "number" } else { "spectrum" }, id.0);
        match self.texture_words(&texture, is_number) {
            Err(stand_in) => return Value::Curve(stand_in),
            Ok((words, frame)) => {
                let kind = if is_number { "float" } else { "spectrum" };
                self.line("AttributeBegin");
                if let Some(frame) = frame {
                    self.place("ConcatTransform", &frame);
                }
                self.line(&format!("Texture \"{name}\" \"{kind}\" {words}"));
                self.line("AttributeEnd");
            }
        }
        self.textures.insert((id, is_number), name.clone());
        Value::Texture(name)
    }

    /// Returns the words of a texture and the frame in which they hold, or what stands for it.
    fn texture_words(
        &mut self,
        texture: &Texture,
        is_number: bool,
    ) -> Result<(String, Option<DAffine3>), SpectralCurve> {
        use Texture as T;
        let stand_in = |writer: &mut Self, what: &str, value: f32| {
            writer.lose(format!("{what}: an even {value} in their place"));
            Err(SpectralCurve::constant(value))
        };
        let part = |writer: &mut Self, name: &str, id: TextureId| match writer.value(id, is_number) {
            Value::Curve(curve) if is_number => format!(" \"float {name}\" {}", curve.mean_visible()),
            Value::Curve(curve) => format!(" \"spectrum {name}\" [ {} ]", points(&curve)),
            Value::Texture(texture) => format!(" \"texture {name}\" \"{texture}\""),
        };
        Ok(match texture {
            T::Curve(curve) => return Err(curve.clone()),
            T::VertexColors => return stand_in(self, "colors of vertices", 0.5),
            T::VertexAlpha => return stand_in(self, "opacities of vertices", 1.0),
            T::Pattern { .. } => return stand_in(self, "patterns by a formula of a program", 0.5),
            T::Alpha { .. } => return stand_in(self, "pictures of a roughness of other versions", 0.3),
            T::Step { of, at_least } => {
                self.lose(format!("outlines where a picture has {at_least} or more: opaque in its share"));
                let words = match self.value(*of, is_number) {
                    Value::Curve(curve) => return Err(curve),
                    Value::Texture(name) => format!("\"scale\" \"texture tex\" \"{name}\" \"float scale\" 1"),
                };
                (words, None)
            }
            T::Image { image, mapping, scale } => self.picture_words(image, mapping, *scale),
            T::Channel { image, channel, mapping, scale, offset } => {
                if *offset != 0.0 || *scale < 0.0 {
                    return stand_in(self, "pictures of which numbers are subtracted", 0.5);
                }
                let gray = Arc::new(image.channel(*channel));
                self.picture_words(&gray, mapping, *scale)
            }
            T::Checkerboard { fields: [a, b], mapping } => {
                let (words, frame) = self.mapping_words(mapping);
                let (a, b) = (part(self, "tex1", *a), part(self, "tex2", *b));
                (format!("\"checkerboard\"{a}{b}{words}"), frame)
            }
            T::Product([a, b]) => {
                let (a, b) = (part(self, "tex", *a), part(self, "scale", *b));
                (format!("\"scale\"{a}{b}"), None)
            }
            T::Blend { of: [a, b], amount } => {
                let (a, b) = (part(self, "tex1", *a), part(self, "tex2", *b));
                let amount = match self.value(*amount, true) {
                    Value::Curve(curve) => format!(" \"float amount\" {}", curve.mean_visible()),
                    Value::Texture(texture) => format!(" \"texture amount\" \"{texture}\""),
                };
                (format!("\"mix\"{a}{b}{amount}"), None)
            }
            T::Procedural(procedural) => {
                let inverse = |frame: &glam::Affine3A| {
                    let m = frame.matrix3;
                    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.as_dvec3());
                    let matrix3 = DMat3::from_cols(columns[0], columns[1], columns[2]);
                    DAffine3 { matrix3, translation: frame.translation.as_dvec3() }.inverse()
                };
                match &**procedural {
                    Procedural::Noise { kind, octaves, roughness, frame } => {
                        let kind = match kind {
                            NoiseKind::Fbm => "fbm",
                            NoiseKind::Wrinkled => "wrinkled",
                            NoiseKind::Windy => "windy",
                        };
                        let words = format!("\"{kind}\" \"integer octaves\" {octaves} \"float roughness\" {roughness}");
                        (words, Some(inverse(frame)))
                    }
                    Procedural::Marble { octaves, roughness, variation, frame } => {
                        let words = format!(
                            "\"marble\" \"integer octaves\" {octaves} \"float roughness\" {roughness} \"float variation\" {variation}"
                        );
                        (words, Some(inverse(frame)))
                    }
                    Procedural::Dots { of: [a, b], mapping } => {
                        let (words, frame) = self.mapping_words(mapping);
                        let (a, b) = (part(self, "inside", *a), part(self, "outside", *b));
                        (format!("\"dots\"{a}{b}{words}"), frame)
                    }
                    Procedural::Corners { of, mapping } => {
                        let (words, frame) = self.mapping_words(mapping);
                        let names = ["v00", "v01", "v10", "v11"];
                        let parts: String = names.iter().zip(of).map(|(name, id)| part(self, name, *id)).collect();
                        (format!("\"bilerp\"{parts}{words}"), frame)
                    }
                    Procedural::Coordinates { .. } => return stand_in(self, "texture coordinates as colors", 0.5),
                    Procedural::Blocks { of: [a, b], frame } => {
                        let (a, b) = (part(self, "tex1", *a), part(self, "tex2", *b));
                        (format!("\"checkerboard\" \"integer dimension\" 3{a}{b}"), Some(inverse(frame)))
                    }
                }
            }
        })
    }

    fn picture_words(
        &mut self,
        image: &Arc<ImageTexture>,
        mapping: &UvMapping,
        scale: f32,
    ) -> (String, Option<DAffine3>) {
        let ([u, v], is_stepped) = image.sampling();
        if u != v || u == Wrap::Mirror || is_stepped {
            self.lose(
                "pictures that are mirrored beyond their edges, that differ along u and v, or that have hard samples",
            );
        }
        let wrap = match u {
            Wrap::Repeat | Wrap::Mirror => "repeat",
            Wrap::Clamp => "clamp",
            Wrap::Black => "black",
        };
        let (file, encoding) = self.picture(image);
        let encoding = match encoding {
            Encoding::Srgb => "sRGB",
            Encoding::Linear | Encoding::Gamma(_) => "linear",
        };
        let (words, frame) = self.mapping_words(mapping);
        let scale = if scale == 1.0 { String::new() } else { format!(" \"float scale\" {scale}") };
        let words = format!(
            "\"imagemap\" \"string filename\" \"{file}\" \"string wrap\" \"{wrap}\" \"string encoding\" \"{encoding}\"{scale}{words}"
        );
        (words, frame)
    }

    fn mapping_words(&mut self, mapping: &UvMapping) -> (String, Option<DAffine3>) {
        let inverse = |frame: &glam::Affine3A| {
            let m = frame.matrix3;
            let columns = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.as_dvec3());
            let matrix3 = DMat3::from_cols(columns[0], columns[1], columns[2]);
            DAffine3 { matrix3, translation: frame.translation.as_dvec3() }.inverse()
        };
        let (scale, offset) = (Vec2::new(mapping.matrix.x_axis.x, mapping.matrix.y_axis.y), mapping.offset);
        let is_turned = mapping.matrix.x_axis.y != 0.0 || mapping.matrix.y_axis.x != 0.0;
        match &mapping.from {
            Coordinates::First | Coordinates::Second => {
                if is_turned || mapping.from == Coordinates::Second {
                    self.lose("pictures laid by second texture coordinates, or turned ones: by the first, as they are");
                }
                if scale == Vec2::ONE && offset == Vec2::ZERO {
                    return (String::new(), None);
                }
                let words = format!(
                    " \"float uscale\" {} \"float vscale\" {} \"float udelta\" {} \"float vdelta\" {}",
                    scale.x, scale.y, offset.x, offset.y
                );
                (words, None)
            }
            Coordinates::Sphere(frame) => (" \"string mapping\" \"spherical\"".to_owned(), Some(inverse(frame))),
            Coordinates::Cylinder(frame) => (" \"string mapping\" \"cylindrical\"".to_owned(), Some(inverse(frame))),
            Coordinates::Plane(frame) => {
                // The reader takes points in the frame of the texture, and its rows along x and y.
                (" \"string mapping\" \"planar\"".to_owned(), Some(inverse(frame)))
            }
        }
    }
}

/// A name within quotes.
fn quoted(name: &str) -> String {
    name.replace(['"', '\n', '\r'], "'")
}

/// A name in a comment, which ends at a colon.
fn on_a_line(name: &str) -> String {
    name.replace(['\n', '\r'], " ").replace(':', ".")
}

fn points(curve: &SpectralCurve) -> String {
    if let Some(value) = curve.constant_value() {
        return format!("300 {value} 1100 {value}");
    }
    curve.points().iter().map(|(nm, value)| format!("{nm} {value}")).collect::<Vec<_>>().join(" ")
}

fn index_of(curve: &SpectralCurve) -> String {
    match curve.constant_value() {
        Some(value) => format!(" \"float eta\" {value}"),
        None => format!(" \"spectrum eta\" [ {} ]", points(curve)),
    }
}

/// The fourth version brings each spectrum to a photopic mean of 1, and multiplies it by its scale.
fn light_words(name: &str, curve: &SpectralCurve) -> String {
    let words = points(curve);
    let spectrum: Vec<f64> = curve.points().iter().map(|(nm, _)| f64::from(*nm)).collect();
    let values: Vec<f64> = curve.points().iter().map(|(_, value)| f64::from(*value)).collect();
    let beyond = if curve.constant_value().is_some() { Beyond::Held } else { Beyond::Zero };
    let as_read =
        dioptric_spectrum::Spectrum::new(spectrum, values).map(|spectrum| SpectralCurve::new(&spectrum, beyond));
    let as_read = as_read.unwrap_or_else(|_| curve.clone());
    let scale = crate::formats::pbrt::photopic_mean(&as_read).unwrap_or(0.0);
    format!("\"spectrum {name}\" [ {words} ] \"float scale\" {scale}")
}

/// Returns a picture of the sky as a square of equal areas.
fn equal_area(sky: &SkyImage) -> ImageTexture {
    let (columns, rows) = sky.image.size();
    let side = columns.max(2 * rows).clamp(64, 4096);
    let color = |index: usize| {
        let at = [(index % side) as f64 + 0.5, (index / side) as f64 + 0.5].map(|at| at / side as f64);
        sky.image.rgb_at(sky.mapping.uv_of(SkyMapping::EqualArea.direction_at(at)))
    };
    ImageTexture::from_linear(side, (0..side * side).map(color).collect(), Wrap::Repeat).expect("a square of colors")
}

/// Returns a mesh as a binary PLY file.
fn ply(mesh: &TriangleMesh) -> Vec<u8> {
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len());
    let names: [(&str, bool); 4] = [
        ("x y z", true),
        ("nx ny nz", !mesh.normals.is_empty()),
        ("u v", !mesh.uvs.is_empty()),
        ("red green blue alpha", !mesh.colors.is_empty()),
    ];
    for name in names.iter().filter(|(_, is_there)| *is_there).flat_map(|(names, _)| names.split(' ')) {
        let _ = writeln!(header, "property float {name}");
    }
    let n = mesh.triangles.len();
    let _ = write!(header, "element face {n}\nproperty list uchar int vertex_indices\nend_header\n");
    let mut bytes = header.into_bytes();
    for vertex in 0..mesh.positions.len() {
        let normal = mesh.normals.get(vertex).map(|n| n.to_array());
        let uv = mesh.uvs.get(vertex).map(|uv| uv.to_array());
        let color = mesh.colors.get(vertex);
        let values = mesh.positions[vertex].to_array().into_iter();
        let values = values.chain(normal.into_iter().flatten()).chain(uv.into_iter().flatten());
        values.chain(color.into_iter().flatten().copied()).for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        triangle.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}
