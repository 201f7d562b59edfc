//! Three-dimensional spectral worlds: geometry, materials, lights and their files.
//!
//! A [`World`] answers what a renderer asks: where a ray meets a surface ([`World::intersect`]), how that surface
//! scatters light ([`World::bsdf`]) and glows ([`World::emission`]), which light falls on a point
//! ([`World::sample_light`]) and what comes from beyond all surfaces ([`World::sky`]). Lengths are metres, wavelengths
//! nanometres, radiance W m⁻² sr⁻¹ nm⁻¹. Rays and hits are in f32, placed exactly on their surfaces and left by more
//! than their rounding error; transforms and shapes in closed form are computed in f64.
//!
//! This crate knows nothing of cameras' optics, of integrators or of films: [`WorldCamera`] is what a file says.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod area_light;
mod bsdf;
mod camera;
mod choices;
mod curve;
mod edit;
mod error;
mod film;
mod formats;
mod fresnel;
mod group;
mod hair;
mod ids;
mod image_texture;
mod lathe;
mod light;
mod light_tree;
mod lights;
mod material;
mod medium;
mod merge;
mod mesh;
mod metals;
mod microfacet;
mod notes;
mod objects;
mod pattern;
mod patterned;
mod placed;
mod procedural;
mod ray;
mod sampling;
mod shape;
mod sky;
mod still_life;
mod texture;
mod tree;
mod triangle;
mod uv;
mod velvet;
mod world;

pub use bsdf::{Bsdf, BsdfSample};
pub use camera::{CameraKind, WorldCamera};
pub use choices::{Animation, Choices};
pub use curve::{Beyond, SpectralCurve};
pub use edit::{LightLevel, ObjectInfo};
pub use error::WorldError;
pub use film::Film;
pub use formats::{ReadOptions, open_world, read_obj, read_ply, read_stl, read_world, write_world};
pub use glam;
pub use ids::{GroupId, InstanceId, LightId, MaterialId, MediumId, ShapeId, TextureId};
pub use image_texture::{Encoding, ImageTexture, Wrap};
pub use lathe::Lathe;
pub use light::{Emission, FallOff, Flux, Layout, Light, LightSample};
pub use material::{Material, Relief, Roughness};
pub use medium::{Coefficients, Density, Field, FilledBox, Filling, Glow, Interface, Medium, Piece, Pieces, Walk};
pub use mesh::TriangleMesh;
pub use metals::MetalKind;
pub use pattern::{Pattern, PatternPoint, PatternRef};
pub use procedural::{NoiseKind, Procedural};
pub use ray::{Hit, Ray, Receiver};
pub use shape::Shape;
pub use sky::{SkyImage, SkyMapping};
pub use texture::{RoughnessLaw, Texture};
pub use uv::{Coordinates, UvMapping};
pub use world::{Met, World, WorldBuilder};
