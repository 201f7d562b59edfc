//! What this program writes into `extras`: materials, lights and shapes as they are.

use std::sync::Arc;

use glam::{DAffine3, DMat4};
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;

use super::{
    Reader, Source,
    json::{index, list, numbers},
    local,
};
use crate::{
    Emission, Encoding, Film, ImageTexture, Light, Material, MaterialId, Medium, Relief, Shape, SpectralCurve, Texture,
    TextureId, WorldCamera, WorldError, Wrap,
};

/// What files of this program name as what made them: of others, which may have been changed, `extras` are left alone.
pub(crate) const GENERATOR: &str = "dioptric";

/// A material as it is.
#[derive(Deserialize)]
struct Surface {
    name: String,
    material: Material,
    relief: Option<Relief>,
    coverage: Option<TextureId>,
    glow: Option<TextureId>,
    filling: Option<(SpectralCurve, SpectralCurve, f32)>,
    turn_rad: f32,
    directions: Option<TextureId>,
    behind: Option<[TextureId; 2]>,
    film: Option<Film>,
}

/// A primitive as it is.
pub(super) struct OwnPrimitive {
    pub(super) material: MaterialId,
    pub(super) emission: Option<Emission>,
    /// A shape in closed form where it stands, and whether it is reversed.
    pub(super) shape: Option<(Shape, DAffine3, bool)>,
}

/// Returns what this program says of a thing.
fn of(value: &Value) -> Option<&Value> {
    value.get("extras")?.get("dioptric")
}

impl Reader<'_> {
    /// Reads the materials of a file that this program wrote.
    pub(super) fn read_own(&mut self) -> Result<(), WorldError> {
        let generator = self.root.get("asset").and_then(|asset| asset.get("generator")).and_then(Value::as_str);
        let Some(own) = of(self.root).filter(|_| generator == Some(GENERATOR)) else { return Ok(()) };
        for picture in list(own, "pictures") {
            let encoding: Encoding = self.parsed(picture, "encoding")?;
            let view = index(picture, "bufferView").ok_or_else(|| self.fault("a picture without a bufferView"))?;
            let source = Source { root: self.root, buffers: &self.buffers, unpacked: &self.unpacked, most_zeros: 0 };
            let (bytes, _) = source.view(view).map_err(|reason| self.fault(reason))?;
            let image = ImageTexture::of_bytes(bytes, encoding, Wrap::Repeat).map_err(|reason| self.fault(reason))?;
            self.own_pictures.push(Arc::new(image));
        }
        let textures: Vec<Texture> = self.parsed(own, "textures")?;
        for mut texture in textures {
            if let Texture::Image { image, .. } | Texture::Channel { image, .. } = &mut texture {
                *image = self.own_picture(image)?;
            }
            self.builder.add_texture(texture);
        }
        let surfaces: Vec<Surface> = self.parsed(own, "materials")?;
        for surface in surfaces {
            let Surface { name, material, relief, coverage, glow, filling, turn_rad, directions, behind, film } =
                surface;
            let id = self.builder.add_material_with(&name, material, relief);
            if let Some(coverage) = coverage {
                self.builder.set_coverage(id, coverage);
            }
            if let Some(glow) = glow {
                self.builder.set_glow(id, glow);
            }
            if let Some((absorption, scattering, asymmetry)) = filling {
                let medium = self.builder.add_medium(Medium::even(absorption, scattering, asymmetry));
                self.builder.set_filling(id, medium);
            }
            if let Some(directions) = directions {
                self.builder.set_directions(id, directions);
            }
            if let Some([share, color]) = behind {
                self.builder.set_behind(id, share, color);
            }
            if let Some(film) = film {
                self.builder.set_film(id, film);
            }
            self.builder.set_turn(id, turn_rad);
        }
        self.is_own = true;
        Ok(())
    }

    fn parsed<T: DeserializeOwned>(&self, of: &Value, word: &str) -> Result<T, WorldError> {
        let value = of.get(word).cloned().unwrap_or_default();
        serde_json::from_value(value).map_err(|e| self.fault(format!("extras, {word}: {e}")))
    }

    /// Returns the picture that one read from JSON stands for.
    fn own_picture(&self, reference: &ImageTexture) -> Result<Arc<ImageTexture>, WorldError> {
        let (number, (wraps, is_stepped)) = (reference.size().0, reference.sampling());
        let found = self.own_pictures.get(number);
        let found = found.ok_or_else(|| self.fault(format!("extras: picture {number} isn't there")))?;
        Ok(Arc::new(found.sampled(wraps, is_stepped)))
    }

    /// Whether a node is no object, but a part of the one that it is in.
    pub(super) fn is_part(&self, node: &Value) -> bool {
        self.is_own && of(node).is_some_and(|own| own.get("part").is_some())
    }

    pub(super) fn own_primitive(&self, primitive: &Value) -> Result<Option<OwnPrimitive>, WorldError> {
        let Some(own) = of(primitive).filter(|_| self.is_own) else { return Ok(None) };
        let material = index(own, "material").and_then(|n| u32::try_from(n).ok()).map(MaterialId);
        let material = material.ok_or_else(|| self.fault("extras: a primitive without a material"))?;
        let emission = match own.get("emission") {
            Some(_) => Some(self.parsed(own, "emission")?),
            None => None,
        };
        let shape = own.get("shape").and_then(|shape| {
            let shape = match (numbers::<1>(shape, "sphere"), numbers(shape, "disc"), numbers(shape, "cylinder")) {
                (Some([radius_m]), ..) => Shape::Sphere { radius_m },
                (_, Some([radius_m, inner_radius_m]), _) => Shape::Disc { radius_m, inner_radius_m },
                (.., Some([radius_m, z_min_m, z_max_m])) => Shape::Cylinder { radius_m, z_min_m, z_max_m },
                _ => return None,
            };
            let place = DAffine3::from_mat4(DMat4::from_cols_array(&numbers::<16>(own, "matrix")?));
            Some((shape, place, own.get("reversed").and_then(Value::as_bool).unwrap_or(false)))
        });
        Ok(Some(OwnPrimitive { material, emission, shape }))
    }

    /// Returns the light of a node that stands at a place.
    pub(super) fn own_light(&self, node: &Value, place: &DAffine3) -> Result<Option<Light>, WorldError> {
        let Some(own) = of(node).filter(|own| self.is_own && own.get("light").is_some()) else { return Ok(None) };
        let mut light: Light = self.parsed(own, "light")?;
        match &mut light {
            Light::Pictured { picture: image, .. } => *image = self.own_picture(image)?,
            Light::SkyImage(sky) => sky.image = self.own_picture(&sky.image)?,
            _ => {}
        }
        light.transform(place);
        Ok(Some(light))
    }

    /// Returns a camera as it is, where this program says it.
    pub(super) fn own_camera(
        &self,
        camera: &Value,
        node: &Value,
        place: &DAffine3,
    ) -> Result<Option<WorldCamera>, WorldError> {
        let (Some(own), Some(of_node)) = (of(camera).filter(|_| self.is_own), of(node)) else { return Ok(None) };
        let Some(matrix) = numbers::<16>(of_node, "matrix") else { return Ok(None) };
        let own_place = DAffine3::from_mat4(DMat4::from_cols_array(&matrix));
        let name = camera.get("name").and_then(Value::as_str).unwrap_or_default().to_owned();
        let world_from_camera = *place * local(node).inverse() * own_place;
        let (kind, resolution) = (self.parsed(own, "kind")?, self.parsed(own, "resolution")?);
        Ok(Some(WorldCamera { name, world_from_camera, kind, resolution }))
    }
}
