//! Textures of pbrt files.

use std::{path::PathBuf, sync::Arc};

use glam::Vec2;

use super::{Fault, Reader, Version, params::Params, spectra::SpectrumUse, text, tokens::Tokens};
use crate::{Encoding, ImageTexture, SpectralCurve, Texture, TextureId, UvMapping, Wrap};

impl Reader<'_> {
    pub(super) fn texture(&mut self, tokens: &mut Tokens<'_>) -> Result<(), Fault> {
        let name = text("Texture", tokens)?;
        let of = text("Texture", tokens)?;
        let kind = text("Texture", tokens)?;
        let params = Params::read(tokens)?;
        let is_number = of == "float";
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
                Texture::Blend { of: [a, b], amount: self.part(&params, &["amount"], true, 0.5)? }
            }
            "checkerboard" => {
                let a = self.part(&params, &["tex1"], is_number, 1.0)?;
                let b = self.part(&params, &["tex2"], is_number, 0.0)?;
                Texture::Checkerboard { fields: [a, b], mapping: self.mapping(name, &params) }
            }
            _ => {
                self.builder
                    .note(format!("Texture \"{name}\" of kind '{kind}': not supported, an even 0.5 in its place"));
                Texture::Curve(SpectralCurve::constant(0.5))
            }
        };
        let unused = params.unused();
        if !unused.is_empty() {
            self.builder.note(format!("Texture \"{name}\": not supported and left out: {}", unused.join(", ")));
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
            return Err(format!("the parameter '{}': no texture has the name '{name}'", param.name).into());
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
        let wrap = match params.text("wrap") {
            Some("clamp") => Wrap::Clamp,
            Some("black") => Wrap::Black,
            _ => Wrap::Repeat,
        };
        let gamma = match (params.find("gamma"), params.text("encoding")) {
            (Some(param), _) if param.texts.first() == Some(&"true") => Encoding::Srgb,
            (Some(param), _) if param.texts.first() == Some(&"false") => Encoding::Linear,
            (Some(param), _) => param.numbers.first().map_or(Encoding::Srgb, |g| Encoding::Gamma(*g as f32)),
            (None, Some("linear")) => Encoding::Linear,
            (None, Some(encoding)) => {
                let power = encoding.strip_prefix("gamma").and_then(|g| g.trim().parse().ok());
                power.map_or(Encoding::Srgb, Encoding::Gamma)
            }
            (None, None) => Encoding::Srgb,
        };
        let mapping = self.mapping(name, params);
        let scale = params.number("scale").unwrap_or(1.0) as f32;
        params.find("trilinear");
        params.find("maxanisotropy");
        params.find("filter");
        match ImageTexture::read(&path, gamma, wrap) {
            Ok(image) => Ok(Texture::Image { image: Arc::new(image), mapping, scale }),
            Err(error) => {
                let what = if file.is_empty() { "no file is named".to_owned() } else { error.to_string() };
                self.builder.note(format!("Texture \"{name}\": {what}; an even 0.5 in its place"));
                Ok(Texture::Curve(SpectralCurve::constant(0.5)))
            }
        }
    }

    /// Returns the mapping of a texture, v upwards; the second version's v runs down the picture.
    fn mapping(&mut self, name: &str, params: &Params<'_>) -> UvMapping {
        match params.text("mapping") {
            None | Some("uv") => {}
            Some(other) => {
                self.builder.note(format!("Texture \"{name}\": mapping '{other}' isn't supported, it follows u and v"));
            }
        }
        let of = |names: &[&str], default| params.number_of(names).unwrap_or(default) as f32;
        let scale = Vec2::new(of(&["uscale", "su"], 1.0), of(&["vscale", "sv"], 1.0));
        let offset = Vec2::new(of(&["udelta", "du"], 0.0), of(&["vdelta", "dv"], 0.0));
        if self.version == Version::Two {
            return UvMapping::scaled(Vec2::new(scale.x, -scale.y), Vec2::new(offset.x, 1.0 - offset.y));
        }
        UvMapping::scaled(scale, offset)
    }
}
