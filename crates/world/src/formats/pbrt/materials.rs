//! Materials of pbrt files.

use std::sync::Arc;

use super::{Fault, Reader, Version, params::Params, spectra::SpectrumUse};
use crate::{
    Encoding, ImageTexture, Material, MaterialId, MetalKind, Relief, Roughness, SpectralCurve, Texture, TextureId,
    UvMapping, Wrap,
};

impl Reader<'_> {
    /// Adds the material of a directive.
    pub(super) fn material(&mut self, name: &str, kind: &str, params: &Params<'_>) -> Result<MaterialId, Fault> {
        let color = |reader: &mut Self, names: &[&str], default: f32| reader.part(params, names, false, default);
        let material = match kind {
            "matte" | "diffuse" => {
                if params.number("sigma").is_some_and(|sigma| sigma != 0.0) {
                    self.builder.note(format!("Material \"{name}\": sigma is left out, it reflects as Lambert's law"));
                }
                Material::Matte { reflectance: color(self, &["Kd", "reflectance"], 0.5)? }
            }
            "plastic" | "substrate" | "coateddiffuse" => {
                params.find("Ks");
                Material::Coated {
                    base: color(self, &["Kd", "reflectance"], if kind == "plastic" { 0.25 } else { 0.5 })?,
                    index: self.index(params, 1.5)?,
                    roughness: self.roughness(params, if kind == "coateddiffuse" { 0.0 } else { 0.1 })?,
                }
            }
            "uber" => self.uber(name, params)?,
            "glass" | "dielectric" => {
                params.find_any(&["Kr", "Kt"]);
                params.find("Kt");
                Material::Dielectric { index: self.index(params, 1.5)?, roughness: self.roughness(params, 0.0)? }
            }
            "thindielectric" => {
                self.builder.note(format!("Material \"{name}\": thin glass mirrors 8 % at all angles"));
                let white = self.even(1.0);
                let mirror = Material::Mirror { reflectance: white, roughness: None };
                let mirror = self.builder.add_material(name, mirror);
                let open = self.builder.add_material(name, Material::Open);
                params.find("eta");
                Material::Blend { of: [open, mirror], amount: self.even(0.08) }
            }
            "mirror" => Material::Mirror { reflectance: color(self, &["Kr"], 0.9)?, roughness: None },
            "metal" | "conductor" => self.metal(kind, params)?,
            "translucent" => {
                let base = color(self, &["Kd"], 0.25)?;
                let [back, through] = ["reflect", "transmit"].map(|name| self.part(params, &[name], false, 0.5));
                params.find("Ks");
                let reflectance = self.builder.add_texture(Texture::Product([base, back?]));
                let transmittance = self.builder.add_texture(Texture::Product([base, through?]));
                Material::Translucent { reflectance, transmittance }
            }
            "diffusetransmission" => Material::Translucent {
                reflectance: color(self, &["reflectance"], 0.25)?,
                transmittance: color(self, &["transmittance"], 0.25)?,
            },
            "mix" => self.mix(params)?,
            "" | "none" | "interface" => Material::Open,
            _ => {
                self.builder.note(format!("Material \"{name}\" of kind '{kind}': not supported, matte in its place"));
                Material::Matte { reflectance: color(self, &["Kd", "reflectance", "color", "basecolor"], 0.5)? }
            }
        };
        let relief = self.relief(params)?;
        Ok(self.builder.add_material_with(name, material, relief))
    }

    fn even(&mut self, value: f32) -> TextureId {
        self.builder.add_texture(Texture::Curve(SpectralCurve::constant(value)))
    }

    /// `uber` without mirroring is matte; else its base lies below a clear coat, which keeps energy where pbrt doesn't.
    fn uber(&mut self, name: &str, params: &Params<'_>) -> Result<Material, Fault> {
        let base = self.part(params, &["Kd"], false, 0.25)?;
        let is_off = |param: &str| {
            params
                .find(param)
                .is_some_and(|p| p.kind != "texture" && !p.numbers.is_empty() && p.numbers.iter().all(|n| *n == 0.0))
        };
        let is_matte = is_off("Ks") && (is_off("Kr") || params.find("Kr").is_none());
        let index = self.index(params, 1.5)?;
        let roughness = self.roughness(params, 0.1)?;
        if is_matte {
            return Ok(Material::Matte { reflectance: base });
        }
        self.builder.note(format!("Material \"{name}\": uber is a base below a clear coat of its index and roughness"));
        Ok(Material::Coated { base, index, roughness })
    }

    fn metal(&mut self, kind: &str, params: &Params<'_>) -> Result<Material, Fault> {
        let roughness = self.roughness(params, if kind == "metal" { 0.01 } else { 0.0 })?;
        if let Some(reflectance) = self.part_if_any(params, &["reflectance"], false)? {
            return Ok(Material::Mirror { reflectance, roughness });
        }
        let copper = MetalKind::Copper.index();
        let mut parts = Vec::with_capacity(2);
        for (name, copper) in ["eta", "k"].into_iter().zip(copper) {
            let curve = match params.find(name) {
                Some(param) => self.curve(param, SpectrumUse::Index)?,
                None => None,
            };
            parts.push(curve.unwrap_or(copper));
        }
        let [n, k] = <[SpectralCurve; 2]>::try_from(parts).map_err(|_| "a metal has eta and k".to_owned())?;
        Ok(Material::Metal { n, k, roughness })
    }

    fn mix(&mut self, params: &Params<'_>) -> Result<Material, Fault> {
        let names: Vec<&str> = match params.find("materials") {
            Some(param) => param.texts.clone(),
            None => ["namedmaterial1", "namedmaterial2"].iter().filter_map(|name| params.text(name)).collect(),
        };
        let of = |name: &&str| self.materials.get(*name).copied();
        let &[Some(a), Some(b)] = names.iter().map(of).collect::<Vec<_>>().as_slice() else {
            return Err(format!("a mix of the materials {names:?}: expected two that were named before").into());
        };
        let amount = self.part(params, &["amount"], true, 0.5)?;
        // Before the fourth version the amount is the share of the first.
        Ok(Material::Blend { of: if self.version < Version::Four { [b, a] } else { [a, b] }, amount })
    }

    fn index(&mut self, params: &Params<'_>, default: f32) -> Result<SpectralCurve, Fault> {
        let Some(param) = params.find_any(&["eta", "index"]) else { return Ok(SpectralCurve::constant(default)) };
        let curve = self.curve(param, SpectrumUse::Index)?.unwrap_or(SpectralCurve::constant(default));
        let is_sound = [400.0_f32, 550.0, 700.0].iter().all(|w| (0.1..=10.0).contains(&curve.at(&[*w])[0]));
        if is_sound { Ok(curve) } else { Err("an index of refraction: expected 0.1 to 10".to_owned().into()) }
    }

    /// Returns α along u and v; files give it directly where `remaproughness` is false.
    fn roughness(&mut self, params: &Params<'_>, default: f64) -> Result<Roughness, Fault> {
        let is_remapped = params.flag("remaproughness").unwrap_or(true);
        let mut alphas = Vec::with_capacity(2);
        for names in [["uroughness", "roughness"], ["vroughness", "roughness"]] {
            let param = params.find_any(&names);
            let is_texture = param.is_some_and(|param| param.kind == "texture");
            if is_texture {
                if is_remapped {
                    self.builder.note("a roughness by texture is α itself, not remapped");
                }
                alphas.push(self.part(params, &names, true, 0.0)?);
                continue;
            }
            let given = param.and_then(|param| param.numbers.first().copied()).unwrap_or(default).max(0.0);
            let alpha = match self.version {
                _ if !is_remapped || given == 0.0 => given,
                Version::Four => given.sqrt(),
                Version::Two | Version::Three => {
                    // pbrt 3, `TrowbridgeReitzDistribution::RoughnessToAlpha`.
                    let x = given.max(1e-3).ln();
                    1.62142 + x * (0.819_955 + x * (0.1734 + x * (0.017_120_1 + x * 0.000_640_711)))
                }
            };
            alphas.push(self.even(alpha.clamp(0.0, 1.0) as f32));
        }
        Ok(<[TextureId; 2]>::try_from(alphas).ok())
    }

    fn relief(&mut self, params: &Params<'_>) -> Result<Option<Relief>, Fault> {
        if let Some(heights) = self.part_if_any(params, &["bumpmap", "displacement"], true)? {
            let unit = self.even(self.metres_per_unit as f32);
            return Ok(Some(Relief::Heights(self.builder.add_texture(Texture::Product([heights, unit])))));
        }
        let Some(file) = params.text("normalmap") else { return Ok(None) };
        let read = self.find_file(file).map(|path| ImageTexture::read(&path, Encoding::Linear, Wrap::Repeat));
        let Some(Ok(image)) = read else {
            self.builder.note(format!("normal map '{file}': can't be read, left out"));
            return Ok(None);
        };
        let texture = Texture::Image { image: Arc::new(image), mapping: UvMapping::IDENTITY, scale: 1.0 };
        Ok(Some(Relief::Normals(self.builder.add_texture(texture))))
    }
}
