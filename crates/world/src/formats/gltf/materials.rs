//! Materials of glTF files.

use std::sync::Arc;

use glam::{Mat2, Vec2};
use serde_json::Value;

use super::{
    Reader,
    json::{extension, index, list, number, number_or, numbers},
};
use crate::{
    Beyond, Coordinates, Emission, Encoding, Film, ImageTexture, Material, MaterialId, Relief, SpectralCurve, Texture,
    TextureId, UvMapping, WorldError, Wrap,
};
use dioptric_spectrum::Spectrum;

/// A picture laid over a surface.
struct Picture {
    image: Arc<ImageTexture>,
    mapping: UvMapping,
}

/// What a picture's samples are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Holds {
    Colors,
    Numbers,
}

impl Reader<'_> {
    /// Returns a material, by the formulas of the standard's appendix B, and how it glows; with the colors of a mesh.
    pub(super) fn material(
        &mut self,
        number: Option<usize>,
        has_colors: bool,
    ) -> Result<(MaterialId, Option<Emission>), WorldError> {
        let key = (number, has_colors);
        if let Some(known) = self.materials.get(&key) {
            return Ok(known.clone());
        }
        let materials = list(self.root, "materials");
        let default = Value::Object(serde_json::Map::new());
        let material = match number {
            Some(number) => {
                let found = materials.get(number);
                found.ok_or_else(|| self.fault(format!("material {number}, of which there are {}", materials.len())))?
            }
            None => &default,
        };
        let made = self.new_material(material, has_colors)?;
        self.materials.insert(key, made.clone());
        Ok(made)
    }

    fn new_material(
        &mut self,
        material: &Value,
        has_colors: bool,
    ) -> Result<(MaterialId, Option<Emission>), WorldError> {
        let name = material.get("name").and_then(Value::as_str).unwrap_or("material").to_owned();
        let glossy = extension(material, "KHR_materials_pbrSpecularGlossiness");
        let pbr = material.get("pbrMetallicRoughness");
        let (of_color, color_words) = match glossy {
            Some(glossy) => (Some(glossy), ["diffuseFactor", "diffuseTexture"]),
            None => (pbr, ["baseColorFactor", "baseColorTexture"]),
        };
        // The color, and how opaque it is.
        let factor = of_color.and_then(|of| numbers::<4>(of, color_words[0])).unwrap_or([1.0; 4]).map(|v| v as f32);
        let [r, g, b, opaque] = factor;
        let mut color = self.curve(SpectralCurve::from_rgb_reflectance([r, g, b]));
        let picture = self.picture(of_color, color_words[1], Holds::Colors)?;
        if let Some(Picture { image, mapping }) = &picture {
            let texture = Texture::Image { image: image.clone(), mapping: *mapping, scale: 1.0 };
            color = self.times(color, texture, [r, g, b] == [1.0; 3]);
        }
        if has_colors {
            color = self.times(color, Texture::VertexColors, false);
        }
        let id = if extension(material, "KHR_materials_unlit").is_some() {
            let black = self.even(0.0);
            self.builder.add_material(&name, Material::Matte { reflectance: black })
        } else {
            self.surface(material, &name, (color, glossy.or(pbr), glossy.is_some()))?
        };
        self.cover(material, id, (opaque, picture.as_ref(), has_colors));
        let glow = self.glow(material, id, color)?;
        Ok((id, glow))
    }

    /// Adds what mirrors, scatters and lets light through.
    fn surface(
        &mut self,
        material: &Value,
        name: &str,
        (color, pbr, is_glossy): (TextureId, Option<&Value>, bool),
    ) -> Result<MaterialId, WorldError> {
        let index_of_refraction = number_or(extension(material, "KHR_materials_ior"), "ior", 1.5);
        // An index of 0 stands for one without end.
        let is_mirror = index_of_refraction == 0.0;
        let index_of_refraction = index_of_refraction.max(1.0);
        let straight = (((index_of_refraction - 1.0) / (index_of_refraction + 1.0)).powi(2)) as f32;
        let straight = if is_mirror { 1.0 } else { straight };
        let (mut mirrored, mut edge) = (self.even(straight), self.even(1.0));
        let (metallic, roughness);
        if is_glossy {
            metallic = self.even(0.0);
            let gloss = number_or(pbr, "glossinessFactor", 1.0) as f32;
            let [r, g, b] = pbr.and_then(|of| numbers::<3>(of, "specularFactor")).unwrap_or([1.0; 3]).map(|v| v as f32);
            mirrored = self.curve(SpectralCurve::from_rgb_reflectance([r, g, b]));
            roughness = match self.picture(pbr, "specularGlossinessTexture", Holds::Colors)? {
                Some(Picture { image, mapping }) => {
                    let texture = Texture::Image { image: image.clone(), mapping, scale: 1.0 };
                    mirrored = self.times(mirrored, texture, false);
                    let rough = Texture::Channel { image, channel: 3, mapping, scale: -gloss, offset: 1.0 };
                    self.builder.add_texture(rough)
                }
                None => self.even(1.0 - gloss),
            };
        } else {
            let factors = [("roughnessFactor", 1), ("metallicFactor", 2)]
                .map(|(word, channel)| (number_or(pbr, word, 1.0) as f32, channel));
            let picture = self.picture(pbr, "metallicRoughnessTexture", Holds::Numbers)?;
            let of = factors.map(|(factor, channel)| match &picture {
                Some(picture) => self.builder.add_texture(picture.channel(channel, factor)),
                None => self.even(factor),
            });
            [roughness, metallic] = of;
        }
        if let Some(specular) = extension(material, "KHR_materials_specular") {
            let factor = number_or(Some(specular), "specularFactor", 1.0) as f32;
            edge = match self.picture(Some(specular), "specularTexture", Holds::Numbers)? {
                Some(picture) => self.builder.add_texture(picture.channel(3, factor)),
                None => self.even(factor),
            };
            let tint = numbers::<3>(specular, "specularColorFactor").unwrap_or([1.0; 3]).map(|v| v as f32);
            // Up to 1 after the product with the reflectance; a curve of a color holds 1 at most.
            let largest = tint.into_iter().fold(1.0, f32::max);
            let curve = SpectralCurve::from_rgb_reflectance(tint.map(|v| v / largest)).scaled(largest * straight);
            let mut tinted = self.curve(curve);
            if let Some(Picture { image, mapping }) =
                self.picture(Some(specular), "specularColorTexture", Holds::Colors)?
            {
                tinted = self.times(tinted, Texture::Image { image, mapping, scale: 1.0 }, false);
            }
            mirrored = self.builder.add_texture(Texture::Product([tinted, edge]));
        }
        let through = self.transmission(material)?;
        let volume = extension(material, "KHR_materials_volume")
            .filter(|volume| number_or(Some(volume), "thicknessFactor", 0.0) > 0.0);
        let relief = self.relief(material)?;
        let thin = through.filter(|_| volume.is_none());
        let brushed = extension(material, "KHR_materials_anisotropy");
        let turn_rad = number_or(brushed, "anisotropyRotation", 0.0) as f32;
        let (brushed, directions) = self.brushed(brushed)?;
        let base =
            Material::MetallicRoughness { color, metallic, roughness, mirrored, edge, transmission: thin, brushed };
        let is_coated = extension(material, "KHR_materials_clearcoat")
            .filter(|coat| number_or(Some(coat), "clearcoatFactor", 0.0) > 0.0);
        let is_filled = through.is_some() && volume.is_some() && !is_mirror;
        let sheen = extension(material, "KHR_materials_sheen").filter(|sheen| {
            numbers::<3>(sheen, "sheenColorFactor").is_some_and(|color| color.iter().any(|v| *v > 0.0))
        });
        let relief_of = |is_last: bool| if is_last { relief } else { None };
        let behind = self.behind(material)?;
        let film = self.film(material)?;
        let is_bare = !is_filled && is_coated.is_none() && sheen.is_none();
        let mut based = |film: Option<Film>, relief: Option<Relief>| {
            let id = self.builder.add_material_with(name, base.clone(), relief);
            if let Some([share, color]) = behind {
                self.builder.set_behind(id, share, color);
            }
            if let Some(film) = film {
                self.builder.set_film(id, film);
            }
            id
        };
        let mut id = match film {
            None => based(None, relief_of(is_bare)),
            Some((film, None)) => based(Some(film), relief_of(is_bare)),
            Some((film, Some(amount))) => {
                let of = [based(None, None), based(Some(film), None)];
                self.builder.add_material_with(name, Material::Blend { of, amount }, relief_of(is_bare))
            }
        };
        if film.is_some() && is_filled {
            self.builder.note_of("films over what fills its shape, left out where it lets light through", name);
        }
        if let Some(through) = through.filter(|_| is_filled) {
            let alpha = self.builder.add_texture(Texture::Product([roughness, roughness]));
            let glass = Material::Glass {
                reflectance: self.even(1.0),
                transmittance: color,
                index: dispersed(index_of_refraction, extension(material, "KHR_materials_dispersion")),
                roughness: Some([alpha, alpha]),
            };
            let glass = self.builder.add_material(name, glass);
            // Metal lets nothing through.
            let (one, zero) = (self.even(1.0), self.even(0.0));
            let rest = self.builder.add_texture(Texture::Blend { of: [one, zero], amount: metallic });
            let amount = self.builder.add_texture(Texture::Product([through, rest]));
            let blend = Material::Blend { of: [id, glass], amount };
            id = self.builder.add_material_with(name, blend, relief_of(is_coated.is_none() && sheen.is_none()));
        }
        if let Some(sheen) = sheen {
            let color = numbers::<3>(sheen, "sheenColorFactor").unwrap_or([0.0; 3]).map(|v| v as f32);
            let mut of_fibers = self.curve(SpectralCurve::from_rgb_reflectance(color));
            if let Some(Picture { image, mapping }) = self.picture(Some(sheen), "sheenColorTexture", Holds::Colors)? {
                of_fibers = self.times(of_fibers, Texture::Image { image, mapping, scale: 1.0 }, color == [1.0; 3]);
            }
            let rough = number_or(Some(sheen), "sheenRoughnessFactor", 0.0) as f32;
            let roughness = match self.picture(Some(sheen), "sheenRoughnessTexture", Holds::Numbers)? {
                Some(picture) => self.builder.add_texture(picture.channel(3, rough)),
                None => self.even(rough),
            };
            let velvet = Material::Sheen { base: id, color: of_fibers, roughness };
            id = self.builder.add_material_with(name, velvet, relief_of(is_coated.is_none()));
        }
        if let Some(coat) = is_coated {
            let amount = number_or(Some(coat), "clearcoatFactor", 0.0) as f32;
            let amount = match self.picture(Some(coat), "clearcoatTexture", Holds::Numbers)? {
                Some(picture) => self.builder.add_texture(picture.channel(0, amount)),
                None => self.even(amount),
            };
            let rough = number_or(Some(coat), "clearcoatRoughnessFactor", 0.0) as f32;
            let roughness = match self.picture(Some(coat), "clearcoatRoughnessTexture", Holds::Numbers)? {
                Some(picture) => self.builder.add_texture(picture.channel(1, rough)),
                None => self.even(rough),
            };
            // By the standard a coat without a picture of its own is smooth.
            if coat.get("clearcoatNormalTexture").is_some() || relief.is_some() {
                self.builder.note_of("normals of clear coats, in place of which they follow the base's", name);
            }
            id = self.builder.add_material_with(name, Material::Clearcoat { base: id, amount, roughness }, relief);
        }
        if brushed.is_some() {
            self.builder.set_turn(id, turn_rad);
        }
        if let Some(directions) = directions {
            self.builder.set_directions(id, directions);
        }
        if let Some(per_m) = volume.filter(|_| is_filled || behind.is_some()).and_then(absorption) {
            self.builder.set_absorption(id, per_m);
        }
        Ok(id)
    }

    /// Returns how strongly a surface is brushed, and a picture of which way.
    fn brushed(&mut self, of: Option<&Value>) -> Result<(Option<TextureId>, Option<TextureId>), WorldError> {
        let strength = number_or(of, "anisotropyStrength", 0.0) as f32;
        if strength <= 0.0 {
            return Ok((None, None));
        }
        Ok(match self.picture(of, "anisotropyTexture", Holds::Numbers)? {
            Some(picture) => {
                let strength = self.builder.add_texture(picture.channel(2, strength));
                let Picture { image, mapping } = picture;
                let directions = self.builder.add_texture(Texture::Image { image, mapping, scale: 1.0 });
                (Some(strength), Some(directions))
            }
            None => (Some(self.even(strength)), None),
        })
    }

    fn transmission(&mut self, material: &Value) -> Result<Option<TextureId>, WorldError> {
        let Some(of) = extension(material, "KHR_materials_transmission") else { return Ok(None) };
        let factor = number_or(Some(of), "transmissionFactor", 0.0) as f32;
        if factor <= 0.0 {
            return Ok(None);
        }
        Ok(Some(match self.picture(Some(of), "transmissionTexture", Holds::Numbers)? {
            Some(picture) => self.builder.add_texture(picture.channel(0, factor)),
            None => self.even(factor),
        }))
    }

    /// Returns the share of the base that lets diffuse light through, and the color of that.
    fn behind(&mut self, material: &Value) -> Result<Option<[TextureId; 2]>, WorldError> {
        let of = extension(material, "KHR_materials_diffuse_transmission");
        let factor = number_or(of, "diffuseTransmissionFactor", 0.0) as f32;
        if factor <= 0.0 {
            return Ok(None);
        }
        let share = match self.picture(of, "diffuseTransmissionTexture", Holds::Numbers)? {
            Some(picture) => self.builder.add_texture(picture.channel(3, factor)),
            None => self.even(factor),
        };
        let tint = of.and_then(|of| numbers::<3>(of, "diffuseTransmissionColorFactor")).unwrap_or([1.0; 3]);
        let mut color = self.curve(SpectralCurve::from_rgb_reflectance(tint.map(|v| v as f32)));
        if let Some(Picture { image, mapping }) = self.picture(of, "diffuseTransmissionColorTexture", Holds::Colors)? {
            color = self.times(color, Texture::Image { image, mapping, scale: 1.0 }, tint == [1.0; 3]);
        }
        Ok(Some([share, color]))
    }

    /// Returns the film over the base, and its share where that isn't all.
    fn film(&mut self, material: &Value) -> Result<Option<(Film, Option<TextureId>)>, WorldError> {
        let of = extension(material, "KHR_materials_iridescence");
        let factor = number_or(of, "iridescenceFactor", 0.0) as f32;
        if factor <= 0.0 {
            return Ok(None);
        }
        let amount = match self.picture(of, "iridescenceTexture", Holds::Numbers)? {
            Some(picture) => Some(self.builder.add_texture(picture.channel(0, factor))),
            None if factor < 1.0 => Some(self.even(factor)),
            None => None,
        };
        let [least, most] = [("iridescenceThicknessMinimum", 100.0), ("iridescenceThicknessMaximum", 400.0)]
            .map(|(word, usual)| number_or(of, word, usual) as f32);
        let thickness_nm = match self.picture(of, "iridescenceThicknessTexture", Holds::Numbers)? {
            Some(Picture { image, mapping }) => {
                let green = Texture::Channel { image, channel: 1, mapping, scale: most - least, offset: least };
                self.builder.add_texture(green)
            }
            None => self.even(most),
        };
        Ok(Some((Film { index: number_or(of, "iridescenceIor", 1.3) as f32, thickness_nm }, amount)))
    }

    fn relief(&mut self, material: &Value) -> Result<Option<Relief>, WorldError> {
        let scale = number_or(material.get("normalTexture"), "scale", 1.0) as f32;
        Ok(self.picture(Some(material), "normalTexture", Holds::Numbers)?.map(|Picture { image, mapping }| {
            let texture = self.builder.add_texture(Texture::Image { image, mapping, scale: 1.0 });
            Relief::ScaledNormals(texture, scale)
        }))
    }

    /// Says how much of a material is there.
    fn cover(
        &mut self,
        material: &Value,
        id: MaterialId,
        (opaque, picture, has_colors): (f32, Option<&Picture>, bool),
    ) {
        let mode = material.get("alphaMode").and_then(Value::as_str).unwrap_or("OPAQUE");
        if mode == "OPAQUE" {
            return;
        }
        let mut coverage = match picture.filter(|picture| picture.image.has_alpha()) {
            Some(picture) => Some(self.builder.add_texture(picture.channel(3, opaque))),
            None if opaque < 1.0 => Some(self.even(opaque)),
            None => None,
        };
        if has_colors {
            let alpha = self.builder.add_texture(Texture::VertexAlpha);
            coverage = Some(match coverage {
                Some(coverage) => self.builder.add_texture(Texture::Product([coverage, alpha])),
                None => alpha,
            });
        }
        let Some(coverage) = coverage else { return };
        let coverage = match mode {
            "MASK" => {
                let at_least = number_or(Some(material), "alphaCutoff", 0.5) as f32;
                self.builder.add_texture(Texture::Step { of: coverage, at_least })
            }
            _ => coverage,
        };
        self.builder.set_coverage(id, coverage);
    }

    /// Returns the glow of a material, and lays its picture over it.
    fn glow(&mut self, material: &Value, id: MaterialId, color: TextureId) -> Result<Option<Emission>, WorldError> {
        let is_two_sided = material.get("doubleSided").and_then(Value::as_bool).unwrap_or(false);
        let unit =
            "glTF says no unit of glow: 1 is taken as 1 W m⁻² sr⁻¹ nm⁻¹, as bright as white under an even sky of 1";
        if extension(material, "KHR_materials_unlit").is_some() {
            self.builder.note(unit);
            self.builder.set_glow(id, color);
            return Ok(Some(Emission { radiance: SpectralCurve::from_rgb_light([1.0; 3]), is_two_sided: true }));
        }
        let factor = numbers::<3>(material, "emissiveFactor").unwrap_or([0.0; 3]);
        let strength = number_or(extension(material, "KHR_materials_emissive_strength"), "emissiveStrength", 1.0);
        let rgb = factor.map(|v| (v * strength) as f32);
        if rgb.iter().all(|v| *v <= 0.0) {
            return Ok(None);
        }
        self.builder.note(unit);
        if let Some(Picture { image, mapping }) = self.picture(Some(material), "emissiveTexture", Holds::Colors)? {
            let glow = self.builder.add_texture(Texture::Image { image, mapping, scale: 1.0 });
            self.builder.set_glow(id, glow);
        }
        Ok(Some(Emission { radiance: SpectralCurve::from_rgb_light(rgb), is_two_sided }))
    }

    fn curve(&mut self, curve: SpectralCurve) -> TextureId {
        self.builder.add_texture(Texture::Curve(curve))
    }

    fn even(&mut self, value: f32) -> TextureId {
        self.curve(SpectralCurve::constant(value))
    }

    /// Returns a texture times another, which stands alone where the first is white.
    fn times(&mut self, texture: TextureId, by: Texture, is_white: bool) -> TextureId {
        let by = self.builder.add_texture(by);
        if is_white { by } else { self.builder.add_texture(Texture::Product([texture, by])) }
    }

    /// Returns the picture of a word of an object; none, with a note, where it can't be read.
    fn picture(&mut self, of: Option<&Value>, word: &str, holds: Holds) -> Result<Option<Picture>, WorldError> {
        let Some(info) = of.and_then(|of| of.get(word)) else { return Ok(None) };
        let textures = list(self.root, "textures");
        let number = index(info, "index");
        let number = number.ok_or_else(|| self.fault(format!("'{word}' names no texture: expected an index")))?;
        let texture = textures.get(number);
        let texture =
            texture.ok_or_else(|| self.fault(format!("texture {number}, of which there are {}", textures.len())))?;
        let of = |name: &str| extension(texture, name).and_then(|of| index(of, "source"));
        let source = of("EXT_texture_webp").or_else(|| index(texture, "source")).or_else(|| of("KHR_texture_basisu"));
        let Some(source) = source else {
            self.builder.note_of("textures without a picture that can be read, left out", &number.to_string());
            return Ok(None);
        };
        let key = (source, holds == Holds::Colors);
        let image = match self.images.get(&key) {
            Some(image) => image.clone(),
            None => {
                let image = self.read_image(source, holds)?;
                self.images.insert(key, image.clone());
                image
            }
        };
        let Some(image) = image else { return Ok(None) };
        let sampler = index(texture, "sampler").and_then(|number| {
            let sampler = list(self.root, "samplers").get(number);
            if sampler.is_none() {
                self.builder.note_of("samplers that are named and not there, pictures repeat", &number.to_string());
            }
            sampler
        });
        let wrap = |word: &str| match sampler.and_then(|sampler| sampler.get(word)).and_then(Value::as_u64) {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let is_stepped = sampler.and_then(|of| of.get("magFilter")).and_then(Value::as_u64) == Some(9728);
        let image = Arc::new(image.sampled([wrap("wrapS"), wrap("wrapT")], is_stepped));
        Ok(Some(Picture { image, mapping: self.mapping(info) }))
    }

    fn read_image(&mut self, number: usize, holds: Holds) -> Result<Option<Arc<ImageTexture>>, WorldError> {
        let images = list(self.root, "images");
        let image = images.get(number);
        let image = image.ok_or_else(|| self.fault(format!("image {number}, of which there are {}", images.len())))?;
        let encoding = if holds == Holds::Colors { Encoding::Srgb } else { Encoding::Linear };
        let uri = image.get("uri").and_then(Value::as_str);
        let read = match (uri, index(image, "bufferView")) {
            (Some(uri), _) if uri.to_ascii_lowercase().ends_with(".ktx2") => match self.resource(uri) {
                Ok(bytes) => ImageTexture::of_bytes(&bytes, encoding, Wrap::Repeat),
                Err(error) => Err(error.to_string()),
            },
            (Some(uri), _) if !uri.starts_with("data:") => {
                let path = self.beside(uri);
                self.builder.add_source(&path);
                ImageTexture::read(&path, encoding, Wrap::Repeat).map_err(|e| e.to_string())
            }
            (Some(uri), _) => ImageTexture::of_bytes(&self.resource(uri)?, encoding, Wrap::Repeat),
            (None, Some(view)) => {
                let (bytes, _) = self.source().view(view).map_err(|reason| self.fault(reason))?;
                ImageTexture::of_bytes(bytes, encoding, Wrap::Repeat)
            }
            (None, None) => return Err(self.fault(format!("image {number} has neither a uri nor a bufferView"))),
        };
        Ok(match read {
            Ok(image) => Some(Arc::new(image)),
            Err(reason) => {
                let name =
                    image.get("name").and_then(Value::as_str).map_or_else(|| format!("image {number}"), str::to_owned);
                self.builder.note_of("pictures that can't be read, left out", &format!("{name} ({reason})"));
                None
            }
        })
    }

    /// Returns where the points of a picture lie, v upwards, as the words of a texture's place say it, v downwards.
    fn mapping(&mut self, info: &Value) -> UvMapping {
        let moved = extension(info, "KHR_texture_transform");
        let set = moved.and_then(|of| index(of, "texCoord")).or_else(|| index(info, "texCoord")).unwrap_or(0);
        if set > 1 {
            self.builder.note(format!("texture coordinates {set}: not read, the first ones in their place"));
        }
        let from = if set == 1 { Coordinates::Second } else { Coordinates::First };
        let Some(moved) = moved else { return UvMapping { from, ..UvMapping::IDENTITY } };
        let two = |word: &str, default: f64| numbers::<2>(moved, word).unwrap_or([default; 2]).map(|v| v as f32);
        let ([x, y], [across, down]) = (two("offset", 0.0), two("scale", 1.0));
        let (sin, cos) = (number(moved, "rotation").unwrap_or(0.0) as f32).sin_cos();
        // u' = a u + b v + x and v' = c u + d v + y, counterclockwise as seen with v down.
        let (a, b, c, d) = (across * cos, down * sin, -across * sin, down * cos);
        let matrix = Mat2::from_cols(Vec2::new(a, -c), Vec2::new(-b, d));
        UvMapping { matrix, offset: Vec2::new(b + x, 1.0 - d - y), from }
    }
}

impl Picture {
    /// Returns one channel of it times a factor.
    fn channel(&self, channel: usize, scale: f32) -> Texture {
        Texture::Channel { image: self.image.clone(), channel, mapping: self.mapping, scale, offset: 0.0 }
    }
}

/// Returns an index of refraction, which the extension for dispersion gives an Abbe number of 20 by its own.
fn dispersed(index: f64, extension: Option<&Value>) -> SpectralCurve {
    let dispersion = number_or(extension, "dispersion", 0.0);
    let even = SpectralCurve::constant(index as f32);
    if dispersion <= 0.0 {
        return even;
    }
    // Cauchy's n = A + B/λ² through n_d, with (n_d − 1)/(n_F − n_C) = 20/dispersion.
    let per_square = |nm: f64| 1.0 / (nm * nm);
    let b = (index - 1.0) * dispersion / 20.0 / (per_square(486.13) - per_square(656.27));
    let wavelengths_nm: Vec<f64> = (30..=110).map(|i| 10.0 * f64::from(i)).collect();
    let indices = wavelengths_nm.iter().map(|nm| index + b * (per_square(*nm) - per_square(587.56))).collect();
    Spectrum::new(wavelengths_nm, indices).map_or(even, |spectrum| SpectralCurve::new(&spectrum, Beyond::Held))
}

/// Returns what a volume takes from light, 1/m: its color is left after its distance.
fn absorption(volume: &Value) -> Option<SpectralCurve> {
    let distance_m = number(volume, "attenuationDistance").filter(|d| *d > 0.0 && d.is_finite())? as f32;
    let color = numbers::<3>(volume, "attenuationColor").unwrap_or([1.0; 3]).map(|v| v as f32);
    let left = SpectralCurve::from_rgb_reflectance(color);
    Some(left.mapped(|share| -share.clamp(1e-6, 1.0).ln() / distance_m))
}
