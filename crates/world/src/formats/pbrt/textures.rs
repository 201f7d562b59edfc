//! Textures of pbrt files.

use std::{path::PathBuf, sync::Arc};

use glam::{Affine3A, DAffine3, DMat3, DMat4, DVec3, Vec2, Vec3};

use super::{Fault, Reader, Version, params::Params, spectra::SpectrumUse, text, tokens::Tokens};
use crate::{
    Coordinates, Encoding, ImageTexture, NoiseKind, Procedural, SpectralCurve, Texture, TextureId, UvMapping, Wrap,
};

impl Reader<'_> {
    pub(super) fn texture(&mut self, tokens: &mut Tokens<'_>) -> Result<(), Fault> {
        let name = text("Texture", tokens)?;
        let of = text("Texture", tokens)?;
        let kind = text("Texture", tokens)?;
        let params = Params::read(tokens)?;
        let is_number = of == "float";
        if !matches!(of, "float" | "spectrum" | "color") {
            self.builder.note_of("textures of a type that isn't known, as spectra", of);
        }
        let texture = match kind {
            "imagemap" => self.image_texture(name, &params)?,
            "constant" => Texture::Curve(self.constant_texture(&params, "value", 1.0)?),
            "scale" => {
                let [a, b] =
                    [["tex1", "tex"], ["tex2", "scale"]].map(|names| self.part(&params, &names, is_number, 1.0));
                Texture::Product([a?, b?])
            }
            "mix" => {
                let a = self.part(&params, &["tex1"], is_number, 0.0)?;
                let b = self.part(&params, &["tex2"], is_number, 1.0)?;
                Texture::Blend { of: [a, b], amount: self.share(&params, "amount")? }
            }
            "checkerboard" => {
                let a = self.part(&params, &["tex1"], is_number, 1.0)?;
                let b = self.part(&params, &["tex2"], is_number, 0.0)?;
                match params.within("dimension", [2.0, 3.0]) {
                    Some(3.0) => procedural(Procedural::Blocks { of: [a, b], frame: self.texture_from_world()? }),
                    _ => Texture::Checkerboard { fields: [a, b], mapping: self.mapping(name, &params)? },
                }
            }
            "dots" => {
                let inside = self.part(&params, &["inside"], is_number, 1.0)?;
                let outside = self.part(&params, &["outside"], is_number, 0.0)?;
                procedural(Procedural::Dots { of: [inside, outside], mapping: self.mapping(name, &params)? })
            }
            "bilerp" => {
                let mut of = Vec::with_capacity(4);
                for (corner, default) in [("v00", 0.0), ("v01", 1.0), ("v10", 0.0), ("v11", 1.0)] {
                    of.push(self.part(&params, &[corner], is_number, default)?);
                }
                let of = <[TextureId; 4]>::try_from(of).map_err(|_| "a bilerp has four corners".to_owned())?;
                procedural(Procedural::Corners { of, mapping: self.mapping(name, &params)? })
            }
            "uv" => procedural(Procedural::Coordinates { mapping: self.mapping(name, &params)? }),
            "fbm" | "wrinkled" | "windy" | "marble" => {
                let octaves = params.within("octaves", [0.0, 32.0]).unwrap_or(8.0) as u32;
                let roughness = params.number("roughness").unwrap_or(0.5) as f32;
                let frame = self.texture_from_world()?;
                let kind = match kind {
                    "fbm" => NoiseKind::Fbm,
                    "wrinkled" => NoiseKind::Wrinkled,
                    "windy" => NoiseKind::Windy,
                    _ => {
                        let scale = params.number("scale").unwrap_or(1.0) as f32;
                        let variation = params.number("variation").unwrap_or(0.2) as f32;
                        let frame = Affine3A::from_scale(Vec3::splat(scale)) * frame;
                        let marble = Procedural::Marble { octaves, roughness, variation, frame };
                        return self.add_named_texture(name, is_number, procedural(marble), &params);
                    }
                };
                procedural(Procedural::Noise { kind, octaves, roughness, frame })
            }
            _ => {
                let sentence = format!("textures of kind '{kind}': not supported, an even 0.5 in their place");
                self.builder.note_of(&sentence, name);
                Texture::Curve(SpectralCurve::constant(0.5))
            }
        };
        self.add_named_texture(name, is_number, texture, &params)
    }

    fn add_named_texture(
        &mut self,
        name: &str,
        is_number: bool,
        texture: Texture,
        params: &Params<'_>,
    ) -> Result<(), Fault> {
        let unused = params.unused();
        if !unused.is_empty() {
            self.builder.note(format!("Texture: not supported and left out: {}", unused.join(", ")));
        }
        let id = self.builder.add_texture(texture);
        let textures = if is_number { &mut self.number_textures } else { &mut self.spectrum_textures };
        textures.insert(name.to_owned(), id);
        Ok(())
    }

    /// Returns the texture that a parameter names or gives, or an even one.
    pub(super) fn part(
        &mut self,
        params: &Params<'_>,
        names: &[&str],
        is_number: bool,
        default: f32,
    ) -> Result<TextureId, Fault> {
        let found = self.part_if_any(params, names, is_number)?;
        Ok(found.unwrap_or_else(|| self.builder.add_texture(Texture::Curve(SpectralCurve::constant(default)))))
    }

    /// Returns a share, 0–1, as [`part`](Self::part) does.
    pub(super) fn share(&mut self, params: &Params<'_>, name: &str) -> Result<TextureId, Fault> {
        let is_even = params.find(name).is_some_and(|param| param.kind != "texture");
        let even = if is_even { params.within(name, [0.0, 1.0]) } else { None };
        match is_even {
            true => Ok(self.builder.add_texture(Texture::Curve(SpectralCurve::constant(even.unwrap_or(0.5) as f32)))),
            false => self.part(params, &[name], true, 0.5),
        }
    }

    pub(super) fn part_if_any(
        &mut self,
        params: &Params<'_>,
        names: &[&str],
        is_number: bool,
    ) -> Result<Option<TextureId>, Fault> {
        let Some(param) = params.find_any(names) else { return Ok(None) };
        if param.kind != "texture" {
            let curve = self.curve(param, SpectrumUse::Reflectance)?;
            return Ok(curve.map(|curve| self.builder.add_texture(Texture::Curve(curve))));
        }
        let name = param.texts.first().copied().unwrap_or("");
        let (first, second) = match is_number {
            true => (&self.number_textures, &self.spectrum_textures),
            false => (&self.spectrum_textures, &self.number_textures),
        };
        let found = first.get(name).or_else(|| second.get(name)).copied();
        if found.is_none() {
            self.builder.note_of("textures that are named and not there, the defaults of their parameters stand", name);
        }
        Ok(found)
    }

    fn constant_texture(&mut self, params: &Params<'_>, name: &str, default: f32) -> Result<SpectralCurve, Fault> {
        let curve = match params.find(name) {
            Some(param) => self.curve(param, SpectrumUse::Reflectance)?,
            None => None,
        };
        Ok(curve.unwrap_or(SpectralCurve::constant(default)))
    }

    fn image_texture(&mut self, name: &str, params: &Params<'_>) -> Result<Texture, Fault> {
        let file = params.text("filename").unwrap_or("");
        let path = self.find_file(file).unwrap_or_else(|| PathBuf::from(file));
        let wrap = match params.choice("wrap", &["repeat", "clamp", "black"]) {
            Some(1) => Wrap::Clamp,
            Some(2) => Wrap::Black,
            _ => Wrap::Repeat,
        };
        let gamma = match (params.find("gamma"), params.text("encoding")) {
            (Some(param), _) if param.texts.first() == Some(&"true") => Encoding::Srgb,
            (Some(param), _) if param.texts.first() == Some(&"false") => Encoding::Linear,
            (Some(param), _) => param.numbers.first().map_or(Encoding::Srgb, |g| Encoding::Gamma(*g as f32)),
            (None, Some("linear")) => Encoding::Linear,
            (None, Some("sRGB" | "srgb")) => Encoding::Srgb,
            (None, Some(encoding)) => {
                let power = encoding.strip_prefix("gamma").and_then(|g| g.trim().parse().ok());
                if power.is_none() {
                    self.builder.note_of("pictures of an encoding that isn't known, as sRGB", encoding);
                }
                power.map_or(Encoding::Srgb, Encoding::Gamma)
            }
            (None, None) => Encoding::Srgb,
        };
        let mapping = self.mapping(name, params)?;
        let scale = params.number("scale").unwrap_or(1.0) as f32;
        params.find("trilinear");
        params.find("maxanisotropy");
        params.choice("filter", &["point", "bilinear", "trilinear", "EWA"]);
        let is_inverted = params.flag("invert").unwrap_or(false);
        match ImageTexture::read(&path, gamma, wrap) {
            Ok(image) => {
                let picture = Texture::Image { image: Arc::new(image), mapping, scale };
                if !is_inverted {
                    return Ok(picture);
                }
                let amount = self.builder.add_texture(picture);
                let [one, zero] =
                    [1.0, 0.0].map(|v| self.builder.add_texture(Texture::Curve(SpectralCurve::constant(v))));
                self.builder.note_of("pictures that are inverted: without color", name);
                Ok(Texture::Blend { of: [one, zero], amount })
            }
            Err(error) => {
                match (file.is_empty(), path.is_file()) {
                    (true, _) => {
                        self.builder.note_of("textures that name no file, an even 0.5 in their place", name);
                    }
                    (_, false) => {
                        self.builder.note_of("pictures that aren't there, an even 0.5 in their place", file);
                    }
                    (_, true) => {
                        let said = error.of_picture(file);
                        self.builder.note_of("pictures that can't be read, an even 0.5 in their place", &said);
                    }
                }
                Ok(Texture::Curve(SpectralCurve::constant(0.5)))
            }
        }
    }

    /// Returns the way from the world, m, to the frame in which a texture is written.
    fn texture_from_world(&self) -> Result<Affine3A, Fault> {
        Ok(Affine3A::from_mat4(DMat4::from(self.place_m()?.inverse()).as_mat4()))
    }

    /// Returns the mapping of a texture, v upwards; the second version's v runs down the picture.
    fn mapping(&mut self, name: &str, params: &Params<'_>) -> Result<UvMapping, Fault> {
        let from = match params.text("mapping") {
            None | Some("uv") => None,
            Some("spherical") => Some(Coordinates::Sphere(self.texture_from_world()?)),
            Some("cylindrical") => Some(Coordinates::Cylinder(self.texture_from_world()?)),
            Some("planar") => {
                let row = |name: &str, default: [f64; 3]| DVec3::from_array(params.exactly(name).unwrap_or(default));
                let (u, v) = (row("v1", [1.0, 0.0, 0.0]), row("v2", [0.0, 1.0, 0.0]));
                // Rows u and v of a frame; pbrt takes the points in the world, its fourth version in the texture's frame.
                let rows = DMat3::from_cols(u, v, DVec3::Z).transpose();
                let offset =
                    DVec3::new(params.number("udelta").unwrap_or(0.0), params.number("vdelta").unwrap_or(0.0), 0.0);
                let of_file = match self.version {
                    Version::Four => self.place_m()?.inverse(),
                    _ => DAffine3::from_scale(DVec3::splat(self.metres_per_unit)).inverse(),
                };
                let frame = DAffine3 { matrix3: rows, translation: offset } * of_file;
                Some(Coordinates::Plane(Affine3A::from_mat4(DMat4::from(frame).as_mat4())))
            }
            Some(other) => {
                self.builder
                    .note_of(&format!("textures of mapping '{other}': not supported, they follow u and v"), name);
                None
            }
        };
        if let Some(from) = from {
            return Ok(UvMapping { from, ..UvMapping::IDENTITY });
        }
        let of = |names: &[&str], default| params.number_of(names).unwrap_or(default) as f32;
        let scale = Vec2::new(of(&["uscale", "su"], 1.0), of(&["vscale", "sv"], 1.0));
        let offset = Vec2::new(of(&["udelta", "du"], 0.0), of(&["vdelta", "dv"], 0.0));
        if self.version == Version::Two {
            return Ok(UvMapping::scaled(Vec2::new(scale.x, -scale.y), Vec2::new(offset.x, 1.0 - offset.y)));
        }
        Ok(UvMapping::scaled(scale, offset))
    }
}

fn procedural(procedural: Procedural) -> Texture {
    Texture::Procedural(Box::new(procedural))
}
