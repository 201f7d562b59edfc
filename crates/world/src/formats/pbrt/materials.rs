//! Materials of pbrt files.

use std::sync::Arc;

use super::{Fault, Reader, Version, params::Params, spectra::SpectrumUse};
use crate::{
    Encoding, ImageTexture, Material, MaterialId, MetalKind, Relief, Roughness, RoughnessLaw, SpectralCurve, Texture,
    TextureId, UvMapping, Wrap, hair::color_factor,
};

impl Reader<'_> {
    /// Adds the material of a directive.
    pub(super) fn material(&mut self, name: &str, kind: &str, params: &Params<'_>) -> Result<MaterialId, Fault> {
        let color = |reader: &mut Self, names: &[&str], default: f32| reader.part(params, names, false, default);
        let is_fourth = self.version == Version::Four;
        let mut filling = None;
        let material = match kind {
            "matte" | "diffuse" => {
                let reflectance = color(self, &["Kd", "reflectance"], 0.5)?;
                match params.find("sigma") {
                    Some(sigma) if sigma.kind == "texture" || sigma.numbers.iter().any(|n| *n != 0.0) => {
                        Material::RoughMatte { reflectance, sigma_deg: self.part(params, &["sigma"], true, 0.0)? }
                    }
                    _ => Material::Matte { reflectance },
                }
            }
            "coateddiffuse" => Material::Coated {
                base: color(self, &["reflectance"], 0.5)?,
                index: self.index(params, 1.5)?,
                roughness: self.roughness(params, 0.0, true)?,
            },
            "plastic" => self.plastic(name, params)?,
            "substrate" => Material::Substrate {
                base: color(self, &["Kd"], 0.5)?,
                coat: color(self, &["Ks"], 0.5)?,
                roughness: self.roughness(params, 0.1, false)?,
            },
            "uber" => return self.uber(name, params),
            "glass" | "dielectric" => {
                let (index, roughness) = (self.index(params, 1.5)?, self.roughness(params, 0.0, true)?);
                self.glass(params, index, roughness)?
            }
            "thindielectric" => Material::Pane { index: self.index(params, 1.5)? },
            "mirror" => Material::Mirror { reflectance: color(self, &["Kr"], 0.9)?, roughness: None },
            "metal" | "conductor" => self.metal(kind, params)?,
            "coatedconductor" => self.coated_metal(name, params)?,
            "disney" => self.disney(name, params)?,
            "translucent" => self.translucent(name, params)?,
            "diffusetransmission" => {
                let scale = self.even(params.within("scale", [0.0, f64::MAX]).unwrap_or(1.0) as f32);
                let [reflectance, transmittance] =
                    ["reflectance", "transmittance"].map(|name| color(self, &[name], 0.25));
                let [reflectance, transmittance] = [reflectance?, transmittance?]
                    .map(|part| self.builder.add_texture(Texture::Product([part, scale])));
                Material::Translucent { reflectance, transmittance }
            }
            "subsurface" | "kdsubsurface" => {
                let (index, roughness) = (self.index(params, 1.33)?, self.roughness(params, 0.0, true)?);
                filling = Some(self.below_surface(params, &index)?);
                self.glass(params, index, roughness)?
            }
            "mix" => self.mix(params)?,
            "hair" => {
                let number =
                    |name: &str, most: f64, default: f64| params.within(name, [0.0, most]).unwrap_or(default) as f32;
                Material::Hair {
                    color: self.hair_color(params)?,
                    roughness: [number("beta_m", 1.0, 0.3), number("beta_n", 1.0, 0.3)],
                    tilt_deg: params.within("alpha", [-90.0, 90.0]).unwrap_or(2.0) as f32,
                    index: params.within("eta", [1.0, 10.0]).unwrap_or(1.55) as f32,
                }
            }
            "" | "none" | "interface" => Material::Open,
            _ => {
                let reflectance = color(self, &["Kd", "reflectance", "color", "basecolor"], 0.5)?;
                let sentence = format!("materials of kind '{kind}': not supported, matte in their place");
                self.builder.note_of(&sentence, name);
                Material::Matte { reflectance }
            }
        };
        if is_fourth && matches!(kind, "matte" | "plastic" | "uber" | "substrate" | "glass" | "translucent" | "mirror")
        {
            let sentence =
                format!("materials of kind '{kind}', which pbrt's fourth version doesn't have: as its third");
            self.builder.note_of(&sentence, name);
        }
        let relief = self.relief(params)?;
        let id = self.builder.add_material_with(name, material, relief);
        if let Some(filling) = filling {
            self.builder.set_filling(id, filling);
        }
        Ok(id)
    }

    /// A boundary, whose light is colored where that is told.
    fn glass(&mut self, params: &Params<'_>, index: SpectralCurve, roughness: Roughness) -> Result<Material, Fault> {
        Ok(match (self.part_if_any(params, &["Kr"], false)?, self.part_if_any(params, &["Kt"], false)?) {
            (None, None) => Material::Dielectric { index, roughness },
            (kr, kt) => {
                let [reflectance, transmittance] = [kr, kt].map(|k| k.unwrap_or_else(|| self.even(1.0)));
                Material::Glass { reflectance, transmittance, index, roughness }
            }
        })
    }

    fn even(&mut self, value: f32) -> TextureId {
        self.builder.add_texture(Texture::Curve(SpectralCurve::constant(value)))
    }

    /// Lambert's base and, added to it, what a boundary mirrors by GGX. pbrt's third version takes the boundary from its
    /// inside: from 41.8° on all is mirrored.
    fn plastic(&mut self, name: &str, params: &Params<'_>) -> Result<Material, Fault> {
        let reflectance = self.part(params, &["Kd"], false, 0.25)?;
        let gloss = Material::Glossy {
            reflectance: self.part(params, &["Ks"], false, 0.25)?,
            index: SpectralCurve::constant(1.0 / 1.5),
            roughness: self.roughness(params, 0.1, false)?,
        };
        Ok(self.sum(name, vec![Material::Matte { reflectance }, gloss]))
    }

    /// Lambert's base, a rough boundary that mirrors, a smooth one that mirrors and refracts, in the share `opacity`.
    fn uber(&mut self, name: &str, params: &Params<'_>) -> Result<MaterialId, Fault> {
        let index = self.index(params, 1.5)?;
        let reflectance = self.part(params, &["Kd"], false, 0.25)?;
        let mut terms = vec![Material::Matte { reflectance }];
        let is_black = |params: &Params<'_>, name: &str| {
            params.find(name).is_some_and(|p| p.kind != "texture" && p.numbers.iter().all(|n| *n == 0.0))
        };
        let roughness = self.roughness(params, 0.1, false)?;
        if !is_black(params, "Ks") {
            let reflectance = self.part(params, &["Ks"], false, 0.25)?;
            terms.push(Material::Glossy { reflectance, index: index.clone(), roughness });
        }
        if ["Kr", "Kt"].into_iter().any(|name| params.find(name).is_some() && !is_black(params, name)) {
            let reflectance = self.part(params, &["Kr"], false, 0.0)?;
            let transmittance = self.part(params, &["Kt"], false, 0.0)?;
            terms.push(Material::Glass { reflectance, transmittance, index, roughness: None });
        }
        let relief = self.relief(params)?;
        let material = self.sum(name, terms);
        let id = self.builder.add_material_with(name, material, relief);
        match self.part_if_any(params, &["opacity"], true)? {
            Some(opacity) => Ok(self.builder.add_covered(id, opacity)),
            None => Ok(id),
        }
    }

    /// Lambert's base and a rough boundary, of both the shares that come back and go through.
    fn translucent(&mut self, name: &str, params: &Params<'_>) -> Result<Material, Fault> {
        let [base, gloss] = ["Kd", "Ks"].map(|name| self.part(params, &[name], false, 0.25));
        let [back, through] = ["reflect", "transmit"].map(|name| self.part(params, &[name], false, 0.5));
        let (base, gloss, back, through) = (base?, gloss?, back?, through?);
        let [diffuse_back, diffuse_through, gloss_back, gloss_through] =
            [[base, back], [base, through], [gloss, back], [gloss, through]]
                .map(|of| self.builder.add_texture(Texture::Product(of)));
        let diffuse = Material::Translucent { reflectance: diffuse_back, transmittance: diffuse_through };
        let boundary = Material::Glass {
            reflectance: gloss_back,
            transmittance: gloss_through,
            index: SpectralCurve::constant(1.5),
            roughness: self.roughness(params, 0.1, false)?,
        };
        Ok(self.sum(name, vec![diffuse, boundary]))
    }

    /// Returns the material of all terms together.
    fn sum(&mut self, name: &str, terms: Vec<Material>) -> Material {
        let mut terms = terms.into_iter();
        let first = terms.next().unwrap_or(Material::Open);
        terms.fold(first, |sum, term| {
            let of = [sum, term].map(|part| self.builder.add_material(name, part));
            Material::Sum { of }
        })
    }

    fn coated_metal(&mut self, name: &str, params: &Params<'_>) -> Result<Material, Fault> {
        let of = |reader: &mut Self, name: &str| match params.find(name) {
            Some(param) => reader.curve(param, SpectrumUse::Index),
            None => Ok(None),
        };
        let (n, k) = (of(self, "conductor.eta")?, of(self, "conductor.k")?);
        let copper = MetalKind::Copper.index();
        let roughness = |reader: &mut Self, names: [&str; 2]| match params.find_any(&names) {
            Some(param) if param.kind == "texture" => reader.part(params, &names, true, 0.0),
            _ => {
                let given = names.iter().find_map(|name| params.within(name, [0.0, f64::MAX]));
                Ok(reader.even(given.unwrap_or(0.0) as f32))
            }
        };
        let metal = roughness(self, ["conductor.roughness", "conductor.uroughness"])?;
        let metal_alpha = self.builder.add_texture(Texture::Alpha { roughness: metal, by: RoughnessLaw::Root });
        let coat = roughness(self, ["interface.roughness", "interface.uroughness"])?;
        let metal = match self.part_if_any(params, &["reflectance"], false)? {
            Some(reflectance) => Material::Mirror { reflectance, roughness: Some([metal_alpha; 2]) },
            None => {
                let [copper_n, copper_k] = copper;
                let (n, k) = (n.unwrap_or(copper_n), k.unwrap_or(copper_k));
                Material::Metal { n, k, roughness: Some([metal_alpha; 2]) }
            }
        };
        self.builder.note_of("materials of kind 'coatedconductor': metal below a clear coat of index 1.5", name);
        let base = self.builder.add_material(name, metal);
        // The coat squares the square root of α; pbrt's roughness is α², whose square root it takes.
        let root = self.builder.add_texture(Texture::Alpha { roughness: coat, by: RoughnessLaw::Root });
        let roughness = self.builder.add_texture(Texture::Alpha { roughness: root, by: RoughnessLaw::Root });
        Ok(Material::Clearcoat { base, amount: self.even(1.0), roughness })
    }

    fn disney(&mut self, name: &str, params: &Params<'_>) -> Result<Material, Fault> {
        self.builder.note_of("materials of kind 'disney': by their color, metallic, roughness and eta alone", name);
        let index = params.number("eta").unwrap_or(1.5);
        let mirrored = ((index - 1.0) / (index + 1.0)).powi(2);
        Ok(Material::MetallicRoughness {
            color: self.part(params, &["color"], false, 0.5)?,
            metallic: self.part(params, &["metallic"], true, 0.0)?,
            roughness: self.part(params, &["roughness"], true, 0.5)?,
            mirrored: self.even(mirrored as f32),
            edge: self.even(1.0),
            transmission: None,
            brushed: None,
        })
    }

    fn metal(&mut self, kind: &str, params: &Params<'_>) -> Result<Material, Fault> {
        let roughness = self.roughness(params, if kind == "metal" { 0.01 } else { 0.0 }, kind == "conductor")?;
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
            self.builder.note_of(
                "materials of kind 'mix' of others that weren't named before, an even 0.5 in their place",
                &names.join(" and "),
            );
            return Ok(Material::Matte { reflectance: self.even(0.5) });
        };
        let amount = self.share(params, "amount")?;
        // Before the fourth version the amount is the share of the first.
        Ok(Material::Blend { of: if self.version < Version::Four { [b, a] } else { [a, b] }, amount })
    }

    /// Returns the color of light that many hairs have scattered, by Chiang & al. (2016), whose inverse is how pbrt makes a hair's absorption of it.
    fn hair_color(&mut self, params: &Params<'_>) -> Result<TextureId, Fault> {
        let rough = params.within("beta_n", [0.0, 1.0]).unwrap_or(0.3);
        let factor = color_factor(rough as f32);
        let left = |per_radius: f32| (-per_radius.max(0.0).sqrt() * factor).exp();
        if let Some(param) = params.find("sigma_a") {
            let curve = match (param.kind, param.numbers.as_slice()) {
                ("rgb" | "color", &[r, g, b]) => {
                    SpectralCurve::from_rgb_reflectance([r, g, b].map(|per_radius| left(per_radius as f32)))
                }
                _ => self.curve(param, SpectrumUse::Index)?.unwrap_or(SpectralCurve::constant(0.0)).mapped(left),
            };
            return Ok(self.builder.add_texture(Texture::Curve(curve)));
        }
        if let Some(color) = self.part_if_any(params, &["reflectance", "color"], false)? {
            return Ok(color);
        }
        let [dark, red] = ["eumelanin", "pheomelanin"].map(|name| params.within(name, [0.0, f64::MAX]));
        let dark = dark.unwrap_or(if red.is_none() { 1.3 } else { 0.0 }) as f32;
        let red = red.unwrap_or(0.0) as f32;
        let absorbed =
            [[0.419, 0.187], [0.697, 0.4], [1.37, 1.05]].map(|[of_dark, of_red]| dark * of_dark + red * of_red);
        Ok(self.builder.add_texture(Texture::Curve(SpectralCurve::from_rgb_reflectance(absorbed.map(left)))))
    }

    fn index(&mut self, params: &Params<'_>, default: f32) -> Result<SpectralCurve, Fault> {
        let Some(param) = params.find_any(&["eta", "index"]) else { return Ok(SpectralCurve::constant(default)) };
        let curve = self.curve(param, SpectrumUse::Index)?.unwrap_or(SpectralCurve::constant(default));
        let is_sound = [400.0_f32, 550.0, 700.0].iter().all(|w| (0.1..=10.0).contains(&curve.at(&[*w])[0]));
        if is_sound { Ok(curve) } else { Err("an index of refraction: expected 0.1 to 10".to_owned().into()) }
    }

    /// Returns α along u and v; files give it directly where `remaproughness` is false. A roughness of 0 is a smooth
    /// boundary where `has_smooth`, else the least that the remapping knows.
    fn roughness(&mut self, params: &Params<'_>, default: f32, has_smooth: bool) -> Result<Roughness, Fault> {
        let is_remapped = params.flag("remaproughness").unwrap_or(true);
        let by = match self.version {
            Version::Four => RoughnessLaw::Root,
            Version::Three => RoughnessLaw::LogPolynomial,
            Version::Two => RoughnessLaw::Blinn,
        };
        let mut alphas = Vec::with_capacity(2);
        for names in [["uroughness", "roughness"], ["vroughness", "roughness"]] {
            let param = params.find_any(&names);
            let is_texture = param.is_some_and(|param| param.kind == "texture");
            if is_texture {
                let roughness = self.part(params, &names, true, default)?;
                alphas.push(match is_remapped {
                    true => self.builder.add_texture(Texture::Alpha { roughness, by }),
                    false => roughness,
                });
                continue;
            }
            let given = names.iter().find_map(|name| params.within(name, [0.0, f64::MAX]));
            let given = given.map_or(default, |n| n as f32);
            let is_as_given = !is_remapped || given == 0.0 && (has_smooth || self.version == Version::Four);
            alphas.push(self.even(if is_as_given { given.min(1.0) } else { by.alpha(given) }));
        }
        if self.version == Version::Two && params.find_any(&["roughness", "uroughness"]).is_some() {
            self.builder.note("roughness of pbrt's second version: GGX of the width of Blinn's lobe");
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
            self.builder.note_of("normal maps that can't be read, left out", file);
            return Ok(None);
        };
        let texture = Texture::Image { image: Arc::new(image), mapping: UvMapping::IDENTITY, scale: 1.0 };
        Ok(Some(Relief::Normals(self.builder.add_texture(texture))))
    }
}
