//! Lights of pbrt files.

use std::{f64::consts::PI, sync::Arc};

use glam::{DMat3, DVec3};

use super::{
    Fault, Reader,
    params::Params,
    shapes::FaceAreas,
    spectra::{SpectrumUse, photopic_mean},
};
use crate::{Emission, Encoding, FallOff, ImageTexture, Layout, Light, SkyImage, SkyMapping, Wrap};

use super::Version;

/// What the shapes that follow emit.
#[derive(Clone, Debug)]
pub(super) struct Glow {
    emission: Emission,
    /// The flux that each shape emits by a radiance of 1, in the file's unit of radiance times area; none where its radiance is given.
    power: Option<f64>,
}

impl Glow {
    /// Returns the emission of each of some faces, square units of the file: with a power, each face has that of its own.
    pub(super) fn of_faces(&self, faces: &FaceAreas) -> Emission {
        let sides = if self.emission.is_two_sided { 2.0 } else { 1.0 };
        let factor = match self.power {
            Some(power) if faces.sum > 0.0 => faces.n as f64 * power / (sides * PI * faces.sum),
            Some(_) => 0.0,
            None => 1.0,
        };
        Emission { radiance: self.emission.radiance.clone().scaled(factor as f32), ..self.emission.clone() }
    }

    pub(super) fn has_power(&self) -> bool {
        self.power.is_some()
    }
}

impl Reader<'_> {
    /// Returns a number above 0 that the fourth version has of lights, and earlier ones don't.
    fn of_fourth(&self, params: &Params<'_>, name: &str) -> Option<f64> {
        (self.version == Version::Four).then(|| params.within(name, [0.0, f64::MAX]).filter(|value| *value > 0.0))?
    }

    /// Returns the flux of a light, in the file's unit of radiance times area, where the file states one.
    fn power(&self, params: &Params<'_>) -> Option<f64> {
        self.of_fourth(params, "power")
    }

    /// Returns the illuminance by a light far away, in the file's unit of radiance, where the file states one.
    fn illuminance(&self, params: &Params<'_>) -> Option<f64> {
        self.of_fourth(params, "illuminance")
    }

    /// Returns what the light is multiplied by; a color, which earlier versions allow, by its mean.
    fn scale(&mut self, params: &Params<'_>) -> f64 {
        let Some(numbers) = params.numbers("scale") else { return 1.0 };
        if numbers.iter().any(|n| *n < 0.0) {
            self.builder.note("a light's 'scale' below 0: it is dark");
            return 0.0;
        }
        if numbers.iter().any(|n| *n != numbers[0]) {
            self.builder.note("a light's 'scale' that is a color: its mean stands for it");
        }
        numbers.iter().sum::<f64>() / numbers.len() as f64
    }

    pub(super) fn glow(&mut self, kind: &str, params: &Params<'_>) -> Result<Glow, Fault> {
        if !matches!(kind, "diffuse" | "area") {
            self.builder.note_of("area lights of a kind that isn't known, as diffuse ones", kind);
        }
        let scale = self.scale(params);
        let radiance = self.light_curve(params.find("L"), scale)?;
        let emission = Emission { radiance, is_two_sided: params.flag("twosided").unwrap_or(false) };
        Ok(Glow { emission, power: self.power(params) })
    }

    pub(super) fn light(&mut self, kind: &str, params: &Params<'_>) -> Result<(), Fault> {
        if self.object.is_some() {
            self.builder.note_of("light sources within an object: left out", kind);
            return Ok(());
        }
        if let Some(name) = &self.attributes.name {
            self.builder.name_next(name);
        }
        let place = self.place_m()?;
        let unit = self.metres_per_unit;
        let scale = self.scale(params);
        let point = |name: &str, default: [f64; 3]| DVec3::from_array(params.exactly(name).unwrap_or(default));
        // A file in other units means the irradiance that its own lengths give.
        let of_point = scale * unit * unit;
        let light = match kind {
            "goniometric" | "projection" if params.find_any(&["filename", "mapname"]).is_some() => {
                match self.pictured(kind, params, scale)? {
                    Some(light) => light,
                    None => return Ok(()),
                }
            }
            "point" | "goniometric" | "projection" => {
                if kind != "point" {
                    self.builder.note_of("light sources that shine alike in all directions, as a point does", kind);
                }
                let position = place.transform_point3(point("from", [0.0; 3]));
                let of_power = self.power(params).map_or(1.0, |power| power / (4.0 * PI));
                Light::Point { position, intensity: self.light_curve(params.find("I"), of_point * of_power)? }
            }
            "spot" => {
                let position = place.transform_point3(point("from", [0.0; 3]));
                let aim = place.transform_point3(point("to", [0.0, 0.0, 1.0]));
                let direction = (aim - position).try_normalize().ok_or("a spot light without direction".to_owned())?;
                let outer_deg = params.within("coneangle", [0.0, 180.0]).unwrap_or(30.0);
                let delta_deg =
                    ["conedeltaangle", "conedelta"].iter().find_map(|name| params.within(name, [0.0, 180.0]));
                let inner_deg = outer_deg - delta_deg.unwrap_or(5.0);
                let (inner_rad, outer_rad) =
                    (inner_deg.to_radians().clamp(0.0, PI), outer_deg.to_radians().clamp(0.0, PI));
                // The edge of the cone counts half, as in pbrt.
                let solid_angle = 2.0 * PI * (1.0 - 0.5 * (inner_rad.cos() + outer_rad.cos()));
                let of_power = self.power(params).map_or(1.0, |power| power / solid_angle);
                let intensity = self.light_curve(params.find("I"), of_point * of_power)?;
                let fall_off = if self.version == Version::Four { FallOff::Smooth } else { FallOff::Quartic };
                Light::Spot { position, direction, intensity, inner_rad, outer_rad, fall_off }
            }
            "distant" => {
                let way = point("to", [0.0, 0.0, 1.0]) - point("from", [0.0; 3]);
                let way = place.transform_vector3(way);
                let direction = way.try_normalize().ok_or("a distant light without direction".to_owned())?;
                let scale = scale * self.illuminance(params).unwrap_or(1.0);
                Light::Distant { direction, irradiance: self.light_curve(params.find("L"), scale)? }
            }
            "infinite" => match params.text("mapname").or_else(|| params.text("filename")) {
                Some(name) => return self.sky_image(name, params, (scale, self.illuminance(params))),
                None => {
                    let scale = scale * self.illuminance(params).map_or(1.0, |illuminance| illuminance / PI);
                    Light::Sky { radiance: self.light_curve(params.find("L"), scale)? }
                }
            },
            _ => {
                self.builder.note_of("light sources that aren't supported, left out", kind);
                return Ok(());
            }
        };
        self.builder.add_light(light);
        Ok(())
    }

    /// Adds a picture of the sky times the color `L`, which puts `illuminance` on a surface that faces its +z, where that is given.
    fn sky_image(
        &mut self,
        name: &str,
        params: &Params<'_>,
        (scale, illuminance): (f64, Option<f64>),
    ) -> Result<(), Fault> {
        // Of an even sky in its place.
        let of_even = scale * illuminance.map_or(1.0, |illuminance| illuminance / PI);
        let image = self.find_file(name).map(|path| ImageTexture::read(&path, Encoding::Srgb, Wrap::Repeat));
        let image = match image {
            Some(Ok(image)) => image,
            Some(Err(error)) => {
                self.builder.note(format!("a sky of radiance 1 W m⁻² sr⁻¹ nm⁻¹ in place of a picture: {error}"));
                let radiance = self.light_curve(None, of_even)?;
                self.builder.add_light(Light::Sky { radiance });
                return Ok(());
            }
            None => {
                self.builder.note(format!("LightSource \"infinite\": no file '{name}', an even sky in its place"));
                let radiance = self.light_curve(None, of_even)?;
                self.builder.add_light(Light::Sky { radiance });
                return Ok(());
            }
        };
        let (columns, rows) = image.size();
        let mapping = match self.version {
            Version::Four if columns != rows => {
                self.builder.note_of(
                    "pictures of the sky that aren't square, read as rows of equal height above the horizon",
                    name,
                );
                SkyMapping::LatLong
            }
            Version::Four => SkyMapping::EqualArea,
            Version::Two | Version::Three => SkyMapping::LatLong,
        };
        let image = match self.sky_tint(params)? {
            Some(tint) => image.tinted(tint),
            None => image,
        };
        let m = self.checked_place()?.matrix3;
        let axes = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize);
        let is_turned = (0..3).all(|i| axes[i].dot(axes[(i + 1) % 3]).abs() < 1e-6);
        if !is_turned {
            self.builder.note("LightSource \"infinite\": a transform that isn't a rotation is left out");
        }
        let world_from_sky = if is_turned { DMat3::from_cols(axes[0], axes[1], axes[2]) } else { DMat3::IDENTITY };
        let mut sky = SkyImage { image: Arc::new(image), mapping, world_from_sky, scale: scale as f32 };
        if let Some(illuminance) = illuminance {
            let own = sky.image_illuminance();
            sky.scale *= if own > 0.0 { (illuminance / own) as f32 } else { 0.0 };
        }
        self.builder.add_light(Light::SkyImage(sky));
        Ok(())
    }

    /// Returns a lamp that shines by a picture; none, with a note, where it can't be read.
    fn pictured(&mut self, kind: &str, params: &Params<'_>, scale: f64) -> Result<Option<Light>, Fault> {
        let name = params.text("filename").or_else(|| params.text("mapname")).unwrap_or("");
        let read = self.find_file(name).map(|path| ImageTexture::read(&path, Encoding::Srgb, Wrap::Clamp));
        let picture = match read {
            Some(Ok(picture)) => picture,
            Some(Err(error)) => {
                let said = error.of_picture(name);
                self.builder.note_of("light sources whose picture can't be read, left out", &said);
                return Ok(None);
            }
            None => {
                self.builder.note_of("light sources whose picture isn't there, left out", name);
                return Ok(None);
            }
        };
        let (columns, rows) = picture.size();
        let is_fourth = self.version == Version::Four;
        let layout = if kind == "projection" {
            let tan = (0.5 * params.within("fov", [1e-3, 179.99]).unwrap_or(90.0)).to_radians().tan();
            // The angle is that of the shorter side.
            let aspect = columns as f64 / rows as f64;
            Layout::Ahead { tan_x: tan * aspect.max(1.0), tan_y: tan * (1.0 / aspect).max(1.0) }
        } else {
            if is_fourth && columns != rows {
                self.builder.note_of("pictures of lamps that aren't square, read as rows of equal polar angle", name);
            }
            Layout::Around(if is_fourth && columns == rows { SkyMapping::EqualArea } else { SkyMapping::LatLong })
        };
        let place = self.place_m()?;
        let axes = [place.matrix3.x_axis, place.matrix3.y_axis, place.matrix3.z_axis].map(DVec3::normalize);
        if (0..3).any(|i| axes[i].dot(axes[(i + 1) % 3]).abs() > 1e-6) {
            self.builder.note(format!("LightSource \"{kind}\": a transform that isn't a rotation"));
        }
        let [x, y, z] = axes;
        let world_from_light = match kind {
            // The fourth version shows the picture upright, those before upside down; a lamp's distribution has its pole along y.
            "projection" => DMat3::from_cols(x, if is_fourth { y } else { -y }, z),
            _ => DMat3::from_cols(x, z, y),
        };
        let flux = layout.flux(&picture);
        let of_power = match self.power(params) {
            Some(power) if flux > 0.0 => power / flux,
            _ => 1.0,
        };
        let unit = self.metres_per_unit;
        let intensity = self.light_curve(params.find("I"), scale * of_power * unit * unit)?;
        let position = place.translation;
        Ok(Some(Light::Pictured { position, intensity, picture: Arc::new(picture), layout, world_from_light }))
    }

    /// Returns the color that `L` multiplies a picture of the sky by; a spectrum counts by its photopic mean.
    fn sky_tint(&mut self, params: &Params<'_>) -> Result<Option<[f32; 3]>, Fault> {
        let Some(param) = params.find("L") else { return Ok(None) };
        if matches!(param.kind, "rgb" | "color") && param.numbers.len() == 3 {
            return Ok(Some(std::array::from_fn(|k| param.numbers[k] as f32)));
        }
        let Some(curve) = self.curve(param, SpectrumUse::Light)? else { return Ok(None) };
        self.builder.note("'L' of a picture of the sky that is a spectrum: its photopic mean multiplies the picture");
        Ok(Some([photopic_mean(&curve)? as f32; 3]))
    }
}
