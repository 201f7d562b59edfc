//! Changes of a world before it is looked at, as a camera file says them.

use std::path::PathBuf;

use dioptric_spectrum::{Illuminant, Spectrum};
use serde::{Deserialize, Serialize};

use super::world_sky::WorldSky;

/// A point or a direction: x, y and z.
type Triple = (f64, f64, f64);

/// A change of a world. Objects are named as `dioptric world info` lists them; `*` in a name stands for any letters and `?` for one, and
/// the parts of an object go with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldChange {
    /// Adds a shape.
    Add {
        /// What to call it.
        name: String,
        /// What it is.
        shape: WorldShape,
        /// Where its middle is, m.
        #[serde(default)]
        at_m: Triple,
        /// What it is made of.
        #[serde(default)]
        material: WorldMaterial,
    },
    /// Adds the world of another file, its up made that of this world, without its cameras.
    AddFile {
        /// What to call it; its objects are its parts.
        name: String,
        /// The file, of any kind that is read.
        file: PathBuf,
        /// How long its unit of length is, m.
        #[serde(default = "one")]
        unit_m: f64,
        /// Where its origin is, m.
        #[serde(default)]
        at_m: Triple,
    },
    /// Moves objects.
    Move {
        /// Which.
        object: String,
        /// By how much, m.
        by_m: Triple,
    },
    /// Moves objects to a place.
    MoveTo {
        /// Which.
        object: String,
        /// Where the middle of the box around them is to be, m.
        to_m: Triple,
    },
    /// Turns objects.
    Turn {
        /// Which.
        object: String,
        /// The axis.
        axis: Triple,
        /// The angle, by the right hand, degrees.
        angle_deg: f64,
        /// A point of the axis, m; the middle of the box around the objects if left out.
        #[serde(default)]
        about_m: Option<Triple>,
    },
    /// Scales objects.
    Scale {
        /// Which.
        object: String,
        /// How many times, along each axis of the world.
        by: Triple,
        /// The point that stays, m; the middle of the box around the objects if left out.
        #[serde(default)]
        about_m: Option<Triple>,
    },
    /// Adds the same objects again, in the same place.
    Copy {
        /// Which.
        object: String,
        /// What to call them.
        to: String,
    },
    /// Takes objects out.
    Remove {
        /// Which.
        object: String,
    },
    /// Makes objects of another material.
    Material {
        /// Which.
        object: String,
        /// What they are made of.
        material: WorldMaterial,
    },
    /// Makes objects glow.
    Glow {
        /// Which.
        object: String,
        /// How bright: `CandelaPerM2` or `PerNm`.
        level: LightAmount,
        /// The spectrum of the light.
        #[serde(default = "daylight")]
        spectrum: Illuminant,
    },
    /// Adds a light.
    Light {
        /// What to call it.
        name: String,
        /// What it is.
        light: WorldLight,
    },
    /// Makes the lights of objects so many times as bright.
    Brighten {
        /// Which.
        object: String,
        /// How many times.
        factor: f64,
    },
    /// Puts a camera before those of the file.
    Camera {
        /// What to call it.
        name: String,
        /// Where it stands, m.
        eye_m: Triple,
        /// What is in the middle of its picture, m; the middle of the world if left out.
        #[serde(default)]
        look_at_m: Option<Triple>,
        /// What is up in its picture; what is up in the world if left out.
        #[serde(default)]
        up: Option<Triple>,
        /// The angle across the width of its picture, degrees.
        #[serde(default = "usual_fov_deg")]
        fov_deg: f64,
        /// Columns and rows of its picture.
        #[serde(default = "usual_size")]
        size: (usize, usize),
    },
}

/// A shape that is added to a world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldShape {
    /// A sphere.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// A box along the axes of the world.
    Box {
        /// Its size along x, y and z, m.
        size_m: Triple,
    },
    /// A plane that lies flat, its front up.
    Plane {
        /// Its size to the right and away from the front of the world, m.
        size_m: (f64, f64),
    },
    /// A disc that lies flat, its front up.
    Disc {
        /// Radius, m.
        radius_m: f64,
    },
    /// Triangles.
    Mesh {
        /// Where the vertices are, m.
        positions_m: Vec<(f32, f32, f32)>,
        /// Three vertices a triangle, by number, counterclockwise as seen from outside.
        triangles: Vec<(u32, u32, u32)>,
        /// A normal a vertex, or none.
        #[serde(default)]
        normals: Vec<(f32, f32, f32)>,
        /// Texture coordinates a vertex, or none.
        #[serde(default)]
        uvs: Vec<(f32, f32)>,
    },
}

/// What a surface is made of. A roughness is 0 for a smooth surface to 1; its square is GGX's α.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldMaterial {
    /// The ideal diffuse reflector.
    Matte {
        /// What it reflects.
        color: WorldColor,
    },
    /// A diffuse base below a clear coat of index 1.5.
    Plastic {
        /// What the base reflects.
        color: WorldColor,
        /// How rough the coat is.
        #[serde(default)]
        roughness: f64,
    },
    /// The material of glTF: a glossy diffuse base, or a metal.
    Glossy {
        /// The color of the base, or the reflectance of the metal.
        color: WorldColor,
        /// How rough it is.
        #[serde(default = "half")]
        roughness: f64,
        /// The share of metal, 0–1.
        #[serde(default)]
        metallic: f64,
    },
    /// Bare metal.
    Metal {
        /// Silver, gold, copper or aluminium.
        metal: String,
        /// How rough it is.
        #[serde(default)]
        roughness: f64,
    },
    /// A mirror of the same reflectance at all angles.
    Mirror {
        /// What it reflects.
        color: WorldColor,
        /// How rough it is.
        #[serde(default)]
        roughness: f64,
    },
    /// Clear glass that fills the shape.
    Glass {
        /// A glass of the catalogue, as `N-BK7`, or an index of refraction, as `1.5`.
        glass: String,
        /// How rough its surface is.
        #[serde(default)]
        roughness: f64,
    },
    /// A material of the world, by its name.
    Named(String),
}

impl Default for WorldMaterial {
    fn default() -> Self {
        Self::Matte { color: WorldColor::default() }
    }
}

/// The color of a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldColor {
    /// The same reflectance at all wavelengths, 0–1.
    Even(f64),
    /// The smooth reflectance of a linear sRGB color, 0–1.
    Rgb(Triple),
    /// A reflectance by wavelength.
    Spectrum(Spectrum),
    /// A picture over the surface, by its texture coordinates.
    Picture(PathBuf),
}

impl Default for WorldColor {
    fn default() -> Self {
        Self::Even(0.5)
    }
}

/// A light that is added to a world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldLight {
    /// A point that shines alike in all directions.
    Point {
        /// Where it is, m.
        at_m: Triple,
        /// How bright: `Watts`, `Lumens`, `Candela` or `PerNm`.
        level: LightAmount,
        /// Its spectrum.
        #[serde(default = "daylight")]
        spectrum: Illuminant,
    },
    /// A point that shines in a cone.
    Spot {
        /// Where it is, m.
        at_m: Triple,
        /// A point on its axis, m.
        look_at_m: Triple,
        /// The angle of the whole cone, degrees.
        cone_deg: f64,
        /// The share of that angle over which it falls to 0, 0–1.
        #[serde(default)]
        soft: f64,
        /// How bright on the axis: `Candela` or `PerNm`; or in all: `Watts` or `Lumens`.
        level: LightAmount,
        /// Its spectrum.
        #[serde(default = "daylight")]
        spectrum: Illuminant,
    },
    /// A rectangle that glows to one side.
    Area {
        /// Where its middle is, m.
        at_m: Triple,
        /// A point before its middle, m.
        look_at_m: Triple,
        /// Its width and height, m.
        size_m: (f64, f64),
        /// How bright: `Watts`, `Lumens`, `CandelaPerM2` or `PerNm`.
        level: LightAmount,
        /// Its spectrum.
        #[serde(default = "daylight")]
        spectrum: Illuminant,
    },
    /// Parallel light.
    Distant {
        /// Where it comes from: a direction.
        from: Triple,
        /// How bright: `Lux` or `PerNm`, on a surface that faces it.
        level: LightAmount,
        /// Its spectrum.
        #[serde(default = "daylight")]
        spectrum: Illuminant,
    },
    /// Light from all sides.
    Sky {
        /// Which.
        sky: WorldSky,
        /// How far it is turned, from the front of the world to the right as seen from above, degrees.
        #[serde(default)]
        turn_deg: f64,
        /// Its mean luminance, cd/m²; its own if left out.
        #[serde(default)]
        mean_cd_m2: Option<f64>,
    },
}

/// How bright a light is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum LightAmount {
    /// Radiant flux from 360 to 830 nm, W.
    Watts(f64),
    /// Luminous flux, lm.
    Lumens(f64),
    /// Luminous intensity, cd.
    Candela(f64),
    /// Illuminance on a surface that faces it, lx.
    Lux(f64),
    /// Luminance, cd/m².
    CandelaPerM2(f64),
    /// The value at 560 nm: W sr⁻¹ nm⁻¹ of points, W m⁻² sr⁻¹ nm⁻¹ of what glows, W m⁻² nm⁻¹ of parallel light.
    PerNm(f64),
}

impl WorldChange {
    /// Returns the files that it names.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        // A copy, so that one list of the places does.
        self.clone().each_file(&mut |file| files.push(file.clone()));
        files
    }

    pub(crate) fn each_file(&mut self, see: &mut dyn FnMut(&mut PathBuf)) {
        use WorldMaterial as M;
        match self {
            Self::AddFile { file, .. } => see(file),
            Self::Light { light: WorldLight::Sky { sky: WorldSky::Picture(file), .. }, .. } => see(file),
            Self::Add { material, .. } | Self::Material { material, .. } => match material {
                M::Matte { color } | M::Plastic { color, .. } | M::Glossy { color, .. } | M::Mirror { color, .. } => {
                    if let WorldColor::Picture(file) = color {
                        see(file);
                    }
                }
                M::Metal { .. } | M::Glass { .. } | M::Named(_) => {}
            },
            _ => {}
        }
    }
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

fn daylight() -> Illuminant {
    Illuminant::D65
}

fn usual_fov_deg() -> f64 {
    40.0
}

fn usual_size() -> (usize, usize) {
    (720, 480)
}
