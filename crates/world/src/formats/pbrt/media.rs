//! Media of pbrt files: those that absorb alone and fill shapes of glass.

use super::{Fault, Reader, params::Params, spectra::SpectrumUse};
use crate::{MaterialId, SpectralCurve};

impl Reader<'_> {
    /// Returns what a medium takes from light, 1/m, if it absorbs and neither scatters nor glows.
    pub(super) fn absorption(&mut self, params: &Params<'_>) -> Result<Option<SpectralCurve>, Fault> {
        let is_dark = |name: &str| {
            params.find(name).is_some_and(|param| !param.numbers.is_empty() && param.numbers.iter().all(|v| *v == 0.0))
        };
        let is_even = params.choice("type", &["homogeneous"]).is_some();
        let is_glowing = params.find("Le").is_some() && !is_dark("Le");
        let (Some(absorbed), true) = (params.find("sigma_a"), is_even && is_dark("sigma_s") && !is_glowing) else {
            return Ok(None);
        };
        // Where light that isn't scattered goes to is nothing.
        params.find("g");
        params.find("Lescale");
        let scale = params.within("scale", [0.0, f64::MAX]).unwrap_or(1.0) / self.metres_per_unit;
        let per_unit = match (absorbed.kind, absorbed.numbers.as_slice()) {
            ("rgb" | "color", &[r, g, b]) => Some(absorption_of_rgb([r, g, b].map(|v| v as f32))),
            _ => self.curve(absorbed, SpectrumUse::Index)?,
        };
        Ok(per_unit.map(|per_unit| per_unit.scaled(scale as f32)))
    }

    /// Takes what fills the shapes that follow, and what is around them.
    pub(super) fn medium_interface(&mut self, names: &[&str]) {
        self.attributes.inside = names.first().copied().unwrap_or("").to_owned();
        for name in names.iter().filter(|name| !name.is_empty() && !self.media.contains_key(**name)) {
            self.builder.note_of("MediumInterface: no such medium", name);
        }
        let outside = names.get(1).copied().unwrap_or("");
        if !outside.is_empty() && outside != self.attributes.inside {
            self.builder
                .note_of("MediumInterface: media around shapes and cameras aren't followed; space is clear", outside);
        }
    }

    /// Returns a material, of shapes that are filled with the current medium.
    pub(super) fn filled(&mut self, material: MaterialId) -> MaterialId {
        let Some(Some(per_m)) = self.media.get(&self.attributes.inside) else { return material };
        let key = (material, self.attributes.inside.clone());
        if let Some(known) = self.filled.get(&key) {
            return *known;
        }
        let filled = self.builder.add_filled(material, per_m.clone()).unwrap_or_else(|| {
            self.builder.note_of("MediumInterface: media in shapes that aren't of glass; they are clear", &key.1);
            material
        });
        self.filled.insert(key, filled);
        filled
    }
}

/// Returns an absorption of three numbers: what is left of a color over the distance at which the most is left of none.
fn absorption_of_rgb(rgb: [f32; 3]) -> SpectralCurve {
    let most = rgb.into_iter().fold(0.0, f32::max);
    if most <= 0.0 {
        return SpectralCurve::constant(0.0);
    }
    let left = SpectralCurve::from_rgb_reflectance(rgb.map(|v| (-v.max(0.0) / most).exp()));
    left.mapped(|share| -share.clamp(1e-6, 1.0).ln() * most)
}
