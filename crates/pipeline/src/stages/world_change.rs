//! Changes of a world carried out on its builder.

use std::{f64::consts::PI, path::Path, sync::Arc};

use dioptric_optics::GlassCatalogue;
use dioptric_spectrum::{Cancel, Illuminant};
use dioptric_world::{
    Beyond, CameraKind, Emission, Encoding, FallOff, Flux, ImageTexture, Light, Material, MaterialId, MetalKind,
    ReadOptions, Roughness, Shape, SpectralCurve, Texture, TextureId, TriangleMesh, UvMapping, WorldBuilder,
    WorldCamera, WorldError, Wrap,
    glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3},
    open_world,
};

use super::{world_sky::add_sky, world_view::looking};
use crate::{LightAmount, PipelineError, WorldChange, WorldColor, WorldLight, WorldMaterial, WorldShape};

/// The index of the coat of plastics.
const PLASTIC_INDEX: f32 = 1.5;
/// The reflectance straight on of the layer of the material of glTF.
const LAYER: f32 = 0.04;

/// Carries out a change of a world.
///
/// # Errors
/// When it names what isn't there, a file cannot be read, or a number cannot be.
pub fn change_world(builder: &mut WorldBuilder, change: &WorldChange, cancel: &Cancel) -> Result<(), PipelineError> {
    cancel.check()?;
    match change {
        WorldChange::Add { name, shape, at_m, material } => {
            tell_of_taken(builder, name);
            let material = material_of(builder, name, material)?;
            let (shape, turn) = shape_of(shape, builder)?;
            shape.check()?;
            let place = DAffine3 { matrix3: turn, translation: point(*at_m)? };
            builder.name_next(name);
            builder.add_shape(shape, place, material, None);
        }
        WorldChange::AddFile { name, file, unit_m, at_m } => {
            tell_of_taken(builder, name);
            let part = open_world(file, &ReadOptions { metres_per_unit: *unit_m, ..ReadOptions::default() }, cancel)?;
            builder.add_world(part, name, DAffine3::from_translation(point(*at_m)?))?;
        }
        WorldChange::Move { object, by_m } => builder.move_object(object, point(*by_m)?)?,
        WorldChange::MoveTo { object, to_m } => builder.move_object_to(object, point(*to_m)?)?,
        WorldChange::Turn { object, axis, angle_deg, about_m } => {
            let about_m = about_m.map(point).transpose()?;
            builder.turn_object(object, point(*axis)?, angle_deg.to_radians(), about_m)?;
        }
        WorldChange::Scale { object, by, about_m } => {
            builder.scale_object(object, point(*by)?, about_m.map(point).transpose()?)?;
        }
        WorldChange::Copy { object, to } => {
            builder.copy_object(object, to)?;
        }
        WorldChange::Remove { object } => builder.remove_object(object)?,
        WorldChange::Material { object, material } => {
            // What isn't there is told before files are read.
            builder.bounds_of_object(object)?;
            let material = material_of(builder, object, material)?;
            builder.set_material_of(object, material)?;
        }
        WorldChange::Glow { object, level, spectrum } => {
            let radiance = spectrum_of(spectrum, *level, &[(LightAmount::CandelaPerM2(1.0), 1.0)], "a glow")?;
            builder.set_emission_of(object, &Emission { radiance, is_two_sided: false })?;
        }
        WorldChange::Light { name, light } => {
            tell_of_taken(builder, name);
            add_light(builder, name, light)?;
        }
        WorldChange::Brighten { object, factor } => builder.brighten_object(object, *factor)?,
        WorldChange::Camera { name, eye_m, look_at_m, up, fov_deg, size } => {
            let (eye_m, up) = (point(*eye_m)?, up.map(point).transpose()?);
            let middle = || builder.bounds().map_or(DVec3::ZERO, |[low, high]| 0.5 * (low + high));
            let look_at_m = look_at_m.map_or_else(|| Ok(middle()), point)?;
            let (world_up, is_left_handed) = (builder.up_and_front().0, builder.is_left_handed());
            let up = up.unwrap_or(world_up);
            let place = looking(eye_m, look_at_m - eye_m, up, is_left_handed).ok_or_else(|| {
                let (what, value) = ("the view of a camera", format!("from {eye_m} to {look_at_m} with {up} up"));
                WorldError::Setting { what, value, expected: "two places, and an up across the view" }
            })?;
            let tan = (0.5 * fov_deg.to_radians()).tan();
            if !(tan > 0.0 && tan.is_finite() && (1e-3..=179.0).contains(fov_deg) && size.0 > 0 && size.1 > 0) {
                let value = format!("{fov_deg}° wide, {} × {} pixels", size.0, size.1);
                let expected = "0.001° to 179° and a pixel at least";
                return Err(WorldError::Setting { what: "the picture of a camera", value, expected }.into());
            }
            let shorter = tan * (size.1 as f64 / size.0 as f64).min(1.0);
            builder.put_camera_first(WorldCamera {
                name: name.clone(),
                world_from_camera: place,
                kind: CameraKind::Perspective {
                    fov_deg: 2.0 * shorter.atan().to_degrees(),
                    lens_radius_m: 0.0,
                    focus_distance_m: 1.0,
                    screen_window: None,
                },
                resolution: *size,
            });
        }
    }
    Ok(())
}

/// Says that what is added under a name is called otherwise, which later changes by that name would not mean.
fn tell_of_taken(builder: &mut WorldBuilder, name: &str) {
    if builder.objects().iter().any(|object| object.name == name) {
        builder.note(format!(
            "'{name}' is the name of an object already: what is added has a number behind it, as '{name}.2'"
        ));
    }
}

fn point((x, y, z): (f64, f64, f64)) -> Result<DVec3, WorldError> {
    let point = DVec3::new(x, y, z);
    let value = format!("{x}, {y}, {z}");
    let is_sound = point.is_finite() && point.abs().max_element() <= 1e9;
    if is_sound {
        Ok(point)
    } else {
        Err(WorldError::Setting { what: "a place", value, expected: "three numbers within 1e9" })
    }
}

/// Returns a shape, and how it is turned: what lies flat has its z axis up.
fn shape_of(shape: &WorldShape, builder: &WorldBuilder) -> Result<(Shape, DMat3), WorldError> {
    let flat = || {
        let (up, front) = builder.up_and_front();
        let right = if builder.is_left_handed() { front.cross(up) } else { up.cross(front) };
        DMat3::from_cols(right, -front, up)
    };
    let size = |sides: &[f64]| match sides.iter().find(|side| !(**side > 0.0 && side.is_finite())) {
        None => Ok(()),
        Some(side) => {
            let (what, value) = ("the side of a shape", side.to_string());
            Err(WorldError::Setting { what, value, expected: "a finite length over 0 m" })
        }
    };
    Ok(match shape {
        WorldShape::Sphere { radius_m } => (Shape::Sphere { radius_m: *radius_m }, flat()),
        WorldShape::Disc { radius_m } => (Shape::Disc { radius_m: *radius_m, inner_radius_m: 0.0 }, flat()),
        WorldShape::Box { size_m } => {
            size(&[size_m.0, size_m.1, size_m.2])?;
            let half = (0.5 * point(*size_m)?).as_vec3();
            (Shape::Mesh(TriangleMesh::block(-half, half)), DMat3::IDENTITY)
        }
        WorldShape::Plane { size_m: (width, height) } => {
            size(&[*width, *height])?;
            let (x, y) = (Vec3::X * *width as f32, Vec3::Y * *height as f32);
            (Shape::Mesh(TriangleMesh::quad(-0.5 * (x + y), x, y)), flat())
        }
        WorldShape::Mesh { positions_m, triangles, normals, uvs } => {
            let triples = |list: &[(f32, f32, f32)]| list.iter().map(|&(x, y, z)| Vec3::new(x, y, z)).collect();
            let mesh = TriangleMesh {
                positions: triples(positions_m),
                normals: triples(normals),
                uvs: uvs.iter().map(|&(u, v)| Vec2::new(u, v)).collect(),
                triangles: triangles.iter().map(|&(a, b, c)| [a, b, c]).collect(),
                ..TriangleMesh::default()
            };
            (Shape::Mesh(mesh), DMat3::IDENTITY)
        }
    })
}

fn material_of(builder: &mut WorldBuilder, name: &str, material: &WorldMaterial) -> Result<MaterialId, PipelineError> {
    use WorldMaterial as M;
    let rough = |builder: &mut WorldBuilder, roughness: f64| -> Result<Roughness, WorldError> {
        let roughness = share("a roughness", roughness)?;
        let alpha = (roughness > 0.0).then(|| even(builder, roughness * roughness));
        Ok(alpha.map(|alpha| [alpha; 2]))
    };
    let made = match material {
        M::Named(name) => return Ok(builder.material_named(name)?),
        M::Matte { color } => Material::Matte { reflectance: color_of(builder, color)? },
        M::Plastic { color, roughness } => Material::Coated {
            base: color_of(builder, color)?,
            index: SpectralCurve::constant(PLASTIC_INDEX),
            roughness: rough(builder, *roughness)?,
        },
        M::Glossy { color, roughness, metallic } => Material::MetallicRoughness {
            color: color_of(builder, color)?,
            metallic: share("metallic", *metallic).map(|metallic| even(builder, metallic))?,
            roughness: share("a roughness", *roughness).map(|roughness| even(builder, roughness))?,
            mirrored: even(builder, LAYER),
            edge: even(builder, 1.0),
            transmission: None,
            brushed: None,
        },
        M::Metal { metal, roughness } => {
            let kind = MetalKind::named(metal).ok_or_else(|| WorldError::Setting {
                what: "a metal",
                value: format!("'{metal}'"),
                expected: "silver, gold, copper or aluminium",
            })?;
            let [n, k] = kind.index();
            Material::Metal { n, k, roughness: rough(builder, *roughness)? }
        }
        M::Mirror { color, roughness } => {
            Material::Mirror { reflectance: color_of(builder, color)?, roughness: rough(builder, *roughness)? }
        }
        M::Glass { glass, roughness } => {
            let index = match glass.parse::<f64>() {
                Ok(index) if (0.1..=10.0).contains(&index) => SpectralCurve::constant(index as f32),
                Ok(index) => {
                    let (what, value) = ("an index of refraction", index.to_string());
                    return Err(WorldError::Setting { what, value, expected: "0.1 to 10" }.into());
                }
                Err(_) => SpectralCurve::from_glass(&GlassCatalogue::built_in().find(glass)?.glass)?,
            };
            Material::Dielectric { index, roughness: rough(builder, *roughness)? }
        }
    };
    Ok(builder.add_material(name, made))
}

fn even(builder: &mut WorldBuilder, value: f32) -> TextureId {
    builder.add_texture(Texture::Curve(SpectralCurve::constant(value)))
}

fn share(what: &'static str, value: f64) -> Result<f32, WorldError> {
    let is_share = (0.0..=1.0).contains(&value);
    if is_share {
        Ok(value as f32)
    } else {
        Err(WorldError::Setting { what, value: value.to_string(), expected: "0 to 1" })
    }
}

fn color_of(builder: &mut WorldBuilder, color: &WorldColor) -> Result<TextureId, PipelineError> {
    let texture = match color {
        WorldColor::Even(value) => Texture::Curve(SpectralCurve::constant(share("a reflectance", *value)?)),
        WorldColor::Rgb((r, g, b)) => {
            let rgb = [share("red", *r)?, share("green", *g)?, share("blue", *b)?];
            Texture::Curve(SpectralCurve::from_rgb_reflectance(rgb))
        }
        WorldColor::Spectrum(spectrum) => {
            spectrum.values().iter().try_for_each(|value| share("a reflectance", *value).map(|_| ()))?;
            Texture::Curve(SpectralCurve::new(spectrum, Beyond::Held))
        }
        WorldColor::Picture(file) => picture(builder, file)?,
    };
    Ok(builder.add_texture(texture))
}

fn picture(builder: &mut WorldBuilder, file: &Path) -> Result<Texture, WorldError> {
    let image = Arc::new(ImageTexture::read(file, Encoding::Srgb, Wrap::Repeat)?);
    builder.add_source(file);
    Ok(Texture::Image { image, mapping: UvMapping::IDENTITY, scale: 1.0 })
}

/// Returns a light's spectrum by how bright it is: of the amounts that suit it, each with the étendue over which it is that of the spectrum.
fn spectrum_of(
    spectrum: &Illuminant,
    level: LightAmount,
    suited: &[(LightAmount, f64)],
    what: &'static str,
) -> Result<SpectralCurve, PipelineError> {
    use LightAmount as A;
    spectrum.check()?;
    let shape = spectrum.spectrum();
    if let A::PerNm(value) = level {
        let at = shape.at_held(560.0);
        if !(value >= 0.0 && value.is_finite() && at > 0.0) {
            let (what, value) = ("the level of a light", format!("{value} per nm at 560 nm"));
            return Err(WorldError::Setting {
                what,
                value,
                expected: "a finite number, of a spectrum with light there",
            }
            .into());
        }
        return Ok(SpectralCurve::new(&shape, Beyond::Zero).scaled((value / at) as f32));
    }
    let is_alike = |amount: &A| std::mem::discriminant(amount) == std::mem::discriminant(&level);
    let Some((_, etendue)) = suited.iter().find(|(amount, _)| is_alike(amount)) else {
        let of = |amount: &A| match amount {
            A::Watts(_) => "Watts",
            A::Lumens(_) => "Lumens",
            A::Candela(_) => "Candela",
            A::Lux(_) => "Lux",
            A::CandelaPerM2(_) => "CandelaPerM2",
            A::PerNm(_) => "PerNm",
        };
        let known: Vec<&str> = suited.iter().map(|(amount, _)| of(amount)).chain(["PerNm"]).collect();
        let reason = format!("{what} isn't measured in {}, expected {}", of(&level), known.join(", "));
        return Err(PipelineError::Unsuitable { what: "level", reason });
    };
    let flux = match level {
        A::Watts(watts) => Flux::Watts(watts),
        A::Lumens(n) | A::Candela(n) | A::Lux(n) | A::CandelaPerM2(n) | A::PerNm(n) => Flux::Lumens(n),
    };
    Ok(flux.spectrum(&shape, *etendue)?)
}

fn add_light(builder: &mut WorldBuilder, name: &str, light: &WorldLight) -> Result<(), PipelineError> {
    use LightAmount as A;
    let direction = |from: DVec3, to: DVec3| {
        (to - from).try_normalize().ok_or_else(|| WorldError::Setting {
            what: "where a light shines to",
            value: format!("{to}, from {from}"),
            expected: "another place than that of the light",
        })
    };
    let made = match light {
        WorldLight::Point { at_m, level, spectrum } => {
            let suited = [(A::Watts(0.0), 4.0 * PI), (A::Lumens(0.0), 4.0 * PI), (A::Candela(0.0), 1.0)];
            Light::Point {
                position: point(*at_m)?,
                intensity: spectrum_of(spectrum, *level, &suited, "a point light")?,
            }
        }
        WorldLight::Spot { at_m, look_at_m, cone_deg, soft, level, spectrum } => {
            let soft = f64::from(share("the soft part of a spot", *soft)?);
            if !(*cone_deg > 0.0 && *cone_deg <= 360.0) {
                let (what, value) = ("the cone of a spot", format!("{cone_deg}°"));
                return Err(WorldError::Setting { what, value, expected: "more than 0° to 360°" }.into());
            }
            let outer_rad = 0.5 * cone_deg.to_radians();
            let inner_rad = outer_rad * (1.0 - soft);
            // Of 3 t² − 2 t³ half is left between the two, over the cosine.
            let etendue = 2.0 * PI * (1.0 - 0.5 * (inner_rad.cos() + outer_rad.cos()));
            let suited = [(A::Watts(0.0), etendue), (A::Lumens(0.0), etendue), (A::Candela(0.0), 1.0)];
            let position = point(*at_m)?;
            Light::Spot {
                position,
                direction: direction(position, point(*look_at_m)?)?,
                intensity: spectrum_of(spectrum, *level, &suited, "a spot")?,
                inner_rad,
                outer_rad,
                fall_off: FallOff::Smooth,
            }
        }
        WorldLight::Area { at_m, look_at_m, size_m, level, spectrum } => {
            let center = point(*at_m)?;
            let towards = direction(center, point(*look_at_m)?)?;
            let size = DVec2::new(size_m.0, size_m.1);
            if !(size.is_finite() && size.min_element() > 0.0) {
                let (what, value) = ("the size of a light", format!("{} × {} m", size.x, size.y));
                return Err(WorldError::Setting { what, value, expected: "finite lengths over 0 m" }.into());
            }
            let flux = PI * size.x * size.y;
            let suited = [(A::Watts(0.0), flux), (A::Lumens(0.0), flux), (A::CandelaPerM2(0.0), 1.0)];
            let radiance = spectrum_of(spectrum, *level, &suited, "a light with an area")?;
            let up = builder.up_and_front().0;
            let across = up.cross(towards).try_normalize().unwrap_or_else(|| towards.any_orthonormal_vector());
            let matrix3 = DMat3::from_cols(across, towards.cross(across), towards);
            let (x, y) = (Vec3::X * size.x as f32, Vec3::Y * size.y as f32);
            let quad = Shape::Mesh(TriangleMesh::quad(-0.5 * (x + y), x, y));
            let black = even(builder, 0.0);
            let material = builder.add_material(name, Material::Matte { reflectance: black });
            builder.name_next(name);
            let emission = Emission { radiance, is_two_sided: false };
            builder.add_shape(quad, DAffine3 { matrix3, translation: center }, material, Some(emission));
            return Ok(());
        }
        WorldLight::Distant { from, level, spectrum } => Light::Distant {
            direction: direction(point(*from)?, DVec3::ZERO)?,
            irradiance: spectrum_of(spectrum, *level, &[(A::Lux(0.0), 1.0)], "parallel light")?,
        },
        WorldLight::Sky { sky, turn_deg, mean_cd_m2 } => {
            let (up, front) = builder.up_and_front();
            // To the right as seen from above, whichever hand the frame has.
            let right = up.cross(front);
            let (sin, cos) = turn_deg.to_radians().sin_cos();
            let front = front * cos + right * sin;
            let name = builder.begin_object(name);
            let added = add_sky(builder, sky, up, front);
            builder.end_object();
            added?;
            if let Some(wanted_cd_m2) = mean_cd_m2 {
                let own = builder.objects().into_iter().find(|object| object.name == name);
                let own = own.and_then(|object| object.light).map_or(0.0, |level| level.value);
                builder.brighten_object(&name, wanted_cd_m2 / own)?;
            }
            return Ok(());
        }
    };
    builder.name_next(name);
    builder.add_light(made);
    Ok(())
}
