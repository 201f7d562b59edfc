//! Media of pbrt files: what fills shapes and the space around them.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::{
    Fault, Reader,
    params::{Param, Params},
    spectra::SpectrumUse,
    substances::substance,
};
use dioptric_spectrum::Spectrum;

use crate::{Beyond, Density, Field, FilledBox, Filling, Glow, Interface, Medium, MediumId, ShapeId, SpectralCurve};

/// Kinds of media that are known.
const KINDS: [&str; 5] = ["homogeneous", "heterogeneous", "uniformgrid", "rgbgrid", "cloud"];
/// What media that are told nothing of absorb and scatter, 1/mm: milk.
const DEFAULT: [[f64; 3]; 2] = [[0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]];

impl Reader<'_> {
    /// Takes a medium of a name; tells whether its parameters count.
    pub(super) fn named_medium(&mut self, name: &str, params: &Params<'_>) -> Result<bool, Fault> {
        let Some(kind) = params.choice("type", &KINDS).map(|kind| KINDS[kind]) else {
            let said = format!("{name} ({})", params.text("type").unwrap_or("of no type"));
            self.builder.note_of("media of a kind that isn't supported, left out: space is clear", &said);
            self.media.insert(name.to_owned(), None);
            return Ok(false);
        };
        let place = self.place_m()?;
        let grids = match self.grids(kind, params, place) {
            Ok(grids) => grids,
            Err(reason) => {
                self.builder
                    .note_of("media whose grid is none, left out: space is clear", &format!("{name} ({reason})"));
                self.media.insert(name.to_owned(), None);
                return Ok(false);
            }
        };
        let Grids { density, of_glow, temperature } = grids;
        let [absorption, scattering] = self.coefficients(kind, params)?;
        let (field, factor) = of_glow;
        let glow = match (temperature, field) {
            (Some(temperature), field) => {
                let number = |name: &str, default: f64| params.number(name).unwrap_or(default) as f32;
                let offset = number("temperatureoffset", 0.0) + number("temperaturecutoff", 0.0);
                let factor = (factor, field);
                Some(Glow::Hot { temperature, offset, scale: number("temperaturescale", 1.0), factor })
            }
            (None, field) if kind == "rgbgrid" => field.map(|field| Glow::Colors(field, factor)),
            (None, field) => match params.find("Le") {
                Some(param) => {
                    let curve = self.light_curve(Some(param), f64::from(factor))?;
                    (curve.mean_visible() > 0.0).then_some(Glow::Spectrum(curve, field))
                }
                None => None,
            },
        };
        let asymmetry = params.within("g", [-1.0, 1.0]).unwrap_or(0.0) as f32;
        let medium = self.builder.add_medium(Medium { absorption, scattering, asymmetry, glow, density });
        self.media.insert(name.to_owned(), Some(medium));
        Ok(true)
    }

    /// Returns what a medium absorbs and scatters, 1/m.
    fn coefficients(&mut self, kind: &str, params: &Params<'_>) -> Result<[SpectralCurve; 2], Fault> {
        let scale = params.within("scale", [0.0, f64::MAX]).unwrap_or(1.0) / self.metres_per_unit;
        let preset = params.text("preset").filter(|name| !name.is_empty());
        let of_preset = preset.and_then(substance);
        if let (Some(name), None) = (preset, of_preset) {
            self.builder.note_of("presets of media that aren't known, left out", name);
        }
        let is_milk = matches!(kind, "homogeneous" | "heterogeneous");
        let default = of_preset.or(is_milk.then_some(DEFAULT));
        let mut curves = Vec::with_capacity(2);
        for (index, name) in ["sigma_a", "sigma_s"].into_iter().enumerate() {
            let given = match params.find(name).filter(|_| kind != "rgbgrid") {
                Some(param) => self.coefficient(param, index == 1)?,
                None => None,
            };
            let curve = given.unwrap_or_else(|| match default {
                Some(rgb) => coefficient_of_rgb(rgb[index], index == 1),
                None => SpectralCurve::constant(1.0),
            });
            curves.push(curve.scaled(scale as f32));
        }
        <[SpectralCurve; 2]>::try_from(curves).map_err(|_| "a medium has two coefficients".to_owned().into())
    }

    /// Returns the curve of a coefficient.
    fn coefficient(&mut self, param: &Param<'_>, is_scattered: bool) -> Result<Option<SpectralCurve>, Fault> {
        if param.numbers.iter().any(|v| *v < 0.0) {
            self.builder.note_of("coefficients of media below 0: 0 in their place", param.name);
        }
        Ok(match (param.kind, param.numbers.as_slice()) {
            ("rgb" | "color", &[r, g, b]) => Some(coefficient_of_rgb([r, g, b], is_scattered)),
            _ => self.curve(param, SpectrumUse::Index)?.map(|curve| curve.mapped(|v| v.max(0.0))),
        })
    }

    /// Returns how dense a medium is where, or why its grid is none.
    fn grids(&self, kind: &str, params: &Params<'_>, place: DAffine3) -> Result<Grids, String> {
        let number = |name: &str, default: f64| params.number(name).unwrap_or(default);
        let of_glow = params.within("Lescale", [0.0, f64::MAX]).unwrap_or(1.0) as f32;
        if kind == "homogeneous" {
            return Ok(Grids { density: Density::Even, of_glow: (None, of_glow), temperature: None });
        }
        let corner = |name: &str, default: f64| params.exactly(name).map_or(DVec3::splat(default), DVec3::from_array);
        let (from, to) = (corner("p0", 0.0), corner("p1", 1.0));
        let size = [number("nx", 1.0), number("ny", 1.0), number("nz", 1.0)].map(|n| n.max(0.0) as usize);
        let field = |name: &str, n_channels: usize| {
            let numbers = params.numbers(name).filter(|numbers| numbers.len() > 1 || size == [1; 3]);
            let values = |numbers: &[f64]| numbers.iter().map(|v| *v as f32).collect();
            numbers.map(|numbers| Field::new(size, n_channels, values(numbers))).transpose().map_err(|e| e.to_string())
        };
        let filling = match kind {
            "rgbgrid" => Filling::Colors { absorption: field("sigma_a", 3)?, scattering: field("sigma_s", 3)? },
            "cloud" => Filling::Cloud {
                corner: from.as_vec3(),
                size: (to - from).as_vec3(),
                density: number("density", 1.0) as f32,
                wispiness: number("wispiness", 1.0) as f32,
                frequency: number("frequency", 5.0) as f32,
            },
            // The fourth version's first release had colors here.
            _ if params.find("density").is_some_and(|p| matches!(p.kind, "rgb" | "color")) => {
                let of_both = field("density", 3)?;
                Filling::Colors { absorption: of_both.clone(), scattering: of_both }
            }
            _ => Filling::Numbers(field("density", 1)?.ok_or("it has no 'density'")?),
        };
        let world_from_unit = place * DAffine3::from_translation(from) * DAffine3::from_scale(to - from);
        if !world_from_unit.inverse().is_finite() {
            return Err("its box is flat".to_owned());
        }
        let density = Density::Box(Arc::new(FilledBox::new(world_from_unit, filling)));
        let is_colored = kind == "rgbgrid";
        let glows = if is_colored { field("Le", 3)? } else { field("Lescale", 1)? };
        // One number is either.
        let of_glow = if glows.is_some() && !is_colored { 1.0 } else { of_glow };
        Ok(Grids { density, of_glow: (glows, of_glow), temperature: field("temperature", 1)? })
    }

    /// Takes what fills the shapes that follow, and what is around them.
    pub(super) fn medium_interface(&mut self, names: &[&str]) {
        for name in names.iter().filter(|name| !name.is_empty() && !self.media.contains_key(**name)) {
            self.builder.note_of("MediumInterface: no such medium", name);
        }
        let inside = names.first().copied().unwrap_or("");
        self.attributes.inside = inside.to_owned();
        self.attributes.outside = names.get(1).copied().unwrap_or(inside).to_owned();
    }

    fn medium_of(&self, name: &str) -> Option<MediumId> {
        self.media.get(name).copied().flatten()
    }

    /// Says which media are on both sides of a shape.
    pub(super) fn set_interface(&mut self, shape: ShapeId, [inside, outside]: [&str; 2]) {
        let interface = Interface { inside: self.medium_of(inside), outside: self.medium_of(outside) };
        if interface != (Interface { inside: None, outside: None }) {
            self.builder.set_interface(shape, interface);
        }
    }

    /// Says in which medium the camera is: what was around when it was named, in the third version at the end.
    pub(super) fn set_medium_of_eye(&mut self) {
        let Some((place, outside)) = self.eye.take() else { return };
        let outside = if self.version == super::Version::Four { outside } else { self.attributes.outside.clone() };
        if let Some(medium) = self.medium_of(&outside) {
            self.builder.set_medium_at(self.metres_per_unit * place, medium);
        }
    }
}

impl Reader<'_> {
    /// Returns what is below the surface of a material of pbrt's subsurface scattering: the medium of its coefficients, of a substance,
    /// or of a diffuse reflectance and a mean free path.
    pub(super) fn below_surface(&mut self, params: &Params<'_>, index: &SpectralCurve) -> Result<MediumId, Fault> {
        let scale = params.within("scale", [0.0, f64::MAX]).unwrap_or(1.0) as f32;
        let asymmetry = params.within("g", [-1.0, 1.0]).unwrap_or(0.0) as f32;
        let substance_name = params.text("name").filter(|name| !name.is_empty());
        let known = substance_name.and_then(substance);
        if let (Some(of), None) = (substance_name, known) {
            self.builder.note_of("substances that aren't known, milk in their place", of);
        }
        let of = |reader: &mut Self, names: &[&str], is_scattered: bool| match params.find_any(names) {
            Some(param) if param.kind == "texture" => {
                reader.builder.note_of("textures of what is below a surface, whose defaults stand", param.name);
                Ok(None)
            }
            Some(param) => reader.coefficient(param, is_scattered),
            None => Ok::<_, Fault>(None),
        };
        let reflectance = of(self, &["Kd", "reflectance"], true)?;
        let free_path = of(self, &["mfp", "meanfreepath"], true)?;
        let absorption = of(self, &["sigma_a"], false)?;
        let scattering = of(self, &["sigma_s", "sigma_prime_s"], true)?;
        let is_told = known.is_some() || absorption.is_some() || scattering.is_some();
        let per_unit = 1.0 / self.metres_per_unit as f32;
        let [absorption, scattering] = match (reflectance, is_told) {
            (Some(reflectance), false) => {
                let index = index.at(&[550.0])[0];
                let path = free_path.unwrap_or_else(|| SpectralCurve::constant(1.0)).scaled(scale);
                let [mut scattering, mut absorption] = [Vec::new(), Vec::new()];
                for nm in (300..=1100).step_by(5) {
                    let (albedo, per_path) = (
                        albedo_below(reflectance.at(&[nm as f32])[0], index, asymmetry),
                        1.0 / path.at(&[nm as f32])[0].max(1e-9),
                    );
                    scattering.push(f64::from(albedo * per_path));
                    absorption.push(f64::from((1.0 - albedo) * per_path));
                }
                let nms = || (300..=1100).step_by(5).map(f64::from).collect::<Vec<f64>>();
                let curve = |values| Spectrum::new(nms(), values).map(|s| SpectralCurve::new(&s, Beyond::Held));
                let wrong = |e: dioptric_spectrum::SpectrumError| Fault::Here(e.to_string());
                [curve(absorption).map_err(wrong)?, curve(scattering).map_err(wrong)?].map(|c| c.scaled(per_unit))
            }
            _ => {
                let default = known.unwrap_or(DEFAULT);
                let or_default = |given: Option<SpectralCurve>, i: usize| {
                    given.filter(|_| known.is_none()).unwrap_or_else(|| coefficient_of_rgb(default[i], i == 1))
                };
                [or_default(absorption, 0), or_default(scattering, 1)].map(|c| c.scaled(scale * per_unit))
            }
        };
        Ok(self.builder.add_medium(Medium::even(absorption, scattering, asymmetry)))
    }
}

/// Returns the single-scattering albedo of a deep medium below a smooth boundary which sends back this share of light that has entered
/// it, all angles together: from inside the boundary mirrors its share (Saunderson 1942), below it is van de Hulst's fit to the albedo of
/// a deep medium (1980), by the similarity of what scatters forwards.
fn albedo_below(reflectance: f32, index: f32, asymmetry: f32) -> f32 {
    let mirrored = crate::fresnel::diffuse_reflectance(1.0 / index);
    let bare = reflectance.clamp(0.0, 1.0) / (1.0 - mirrored + mirrored * reflectance.clamp(0.0, 1.0));
    // Of bare = (1 − s)(1 − 0.139 s)/(1 + 1.17 s).
    let linear = 1.139 + 1.17 * bare;
    let s = (linear - (linear * linear - 4.0 * 0.139 * (1.0 - bare)).sqrt()) / (2.0 * 0.139);
    let reduced = 1.0 - s * s;
    reduced / (1.0 - asymmetry + asymmetry * reduced).max(f32::MIN_POSITIVE)
}

/// What is told of a medium place by place.
struct Grids {
    density: Density,
    /// What its glow is multiplied by.
    of_glow: (Option<Field>, f32),
    temperature: Option<Field>,
}

/// Returns the coefficient of three numbers: of what is scattered, a smooth spectrum; of what is absorbed, what is left of a color over
/// the distance at which the most is left of none.
pub(super) fn coefficient_of_rgb(rgb: [f64; 3], is_scattered: bool) -> SpectralCurve {
    let rgb = rgb.map(|v| v as f32);
    let most = rgb.into_iter().fold(0.0, f32::max);
    if most <= 0.0 {
        return SpectralCurve::constant(0.0);
    }
    if is_scattered {
        return SpectralCurve::from_rgb_reflectance(rgb.map(|v| v.max(0.0) / most)).scaled(most);
    }
    let left = SpectralCurve::from_rgb_reflectance(rgb.map(|v| (-v.max(0.0) / most).exp()));
    left.mapped(|share| -share.clamp(1e-6, 1.0).ln() * most)
}
