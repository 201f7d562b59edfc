//! Lights of pbrt files.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{Fault, Reader, params::Params};
use crate::{Emission, Encoding, ImageTexture, Light, SkyImage, SkyMapping, Wrap};

use super::Version;

impl Reader<'_> {
    pub(super) fn glow(&mut self, params: &Params<'_>) -> Result<Emission, Fault> {
        let scale = params.number("scale").unwrap_or(1.0);
        let radiance = self.light_curve(params.find("L"), scale)?;
        Ok(Emission { radiance, is_two_sided: params.flag("twosided").unwrap_or(false) })
    }

    pub(super) fn light(&mut self, kind: &str, params: &Params<'_>) -> Result<(), Fault> {
        if self.object.is_some() {
            self.builder.note(format!("LightSource \"{kind}\" within an object: left out"));
            return Ok(());
        }
        let place = self.place_m()?;
        let unit = self.metres_per_unit;
        let scale = params.number("scale").unwrap_or(1.0);
        let point = |name: &str, default: [f64; 3]| DVec3::from_array(params.three(name).unwrap_or(default));
        // A file in other units means the irradiance that its own lengths give.
        let of_point = scale * unit * unit;
        let light = match kind {
            "point" | "goniometric" | "projection" => {
                if kind != "point" {
                    self.builder.note(format!("LightSource \"{kind}\": a point that shines alike in all directions"));
                }
                let position = place.transform_point3(point("from", [0.0; 3]));
                let mut intensity = self.light_curve(params.find("I"), of_point)?;
                if let Some(power) = params.number("power") {
                    let own = f64::from(intensity.mean_visible());
                    let wanted = power * unit * unit / (4.0 * std::f64::consts::PI);
                    intensity = intensity.scaled(if own > 0.0 { (wanted / own) as f32 } else { 0.0 });
                }
                Light::Point { position, intensity }
            }
            "spot" => {
                let position = place.transform_point3(point("from", [0.0; 3]));
                let aim = place.transform_point3(point("to", [0.0, 0.0, 1.0]));
                let direction = (aim - position).try_normalize().ok_or("a spot light without direction".to_owned())?;
                let outer_deg = params.number("coneangle").unwrap_or(30.0);
                let inner_deg = outer_deg - params.number_of(&["conedeltaangle", "conedelta"]).unwrap_or(5.0);
                Light::Spot {
                    position,
                    direction,
                    intensity: self.light_curve(params.find("I"), of_point)?,
                    inner_rad: inner_deg.to_radians().clamp(0.0, std::f64::consts::PI),
                    outer_rad: outer_deg.to_radians().clamp(0.0, std::f64::consts::PI),
                }
            }
            "distant" => {
                let way = point("to", [0.0, 0.0, 1.0]) - point("from", [0.0; 3]);
                let way = place.transform_vector3(way);
                let direction = way.try_normalize().ok_or("a distant light without direction".to_owned())?;
                Light::Distant { direction, irradiance: self.light_curve(params.find("L"), scale)? }
            }
            "infinite" => match params.text("mapname").or_else(|| params.text("filename")) {
                Some(name) => return self.sky_image(name, scale),
                None => Light::Sky { radiance: self.light_curve(params.find("L"), scale)? },
            },
            _ => {
                self.builder.note(format!("LightSource \"{kind}\": not supported, left out"));
                return Ok(());
            }
        };
        self.builder.add_light(light);
        Ok(())
    }

    fn sky_image(&mut self, name: &str, scale: f64) -> Result<(), Fault> {
        let image = self.find_file(name).map(|path| ImageTexture::read(&path, Encoding::Srgb, Wrap::Repeat));
        let image = match image {
            Some(Ok(image)) => image,
            Some(Err(error)) => {
                self.builder.note(format!("a sky of radiance 1 W m⁻² sr⁻¹ nm⁻¹ in place of a picture: {error}"));
                let radiance = self.light_curve(None, scale)?;
                self.builder.add_light(Light::Sky { radiance });
                return Ok(());
            }
            None => {
                self.builder.note(format!("LightSource \"infinite\": no file '{name}', an even sky in its place"));
                let radiance = self.light_curve(None, scale)?;
                self.builder.add_light(Light::Sky { radiance });
                return Ok(());
            }
        };
        let mapping = if self.version == Version::Four { SkyMapping::EqualArea } else { SkyMapping::LatLong };
        let m = self.checked_place()?.matrix3;
        let axes = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize);
        let is_turned = (0..3).all(|i| axes[i].dot(axes[(i + 1) % 3]).abs() < 1e-6);
        if !is_turned {
            self.builder.note("LightSource \"infinite\": a transform that isn't a rotation is left out");
        }
        let world_from_sky = if is_turned { DMat3::from_cols(axes[0], axes[1], axes[2]) } else { DMat3::IDENTITY };
        let image = Arc::new(image);
        self.builder.add_light(Light::SkyImage(SkyImage { image, mapping, world_from_sky, scale: scale as f32 }));
        Ok(())
    }
}
