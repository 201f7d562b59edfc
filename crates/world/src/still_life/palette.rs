//! What things of the still life are made of, and how they come into its world.

use std::sync::OnceLock;

use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid};
use glam::{DAffine3, DMat3, DVec3};

use super::{
    paint::{Glow, Paint, Painted, Where},
    pigment::{Pigment, PigmentIndex, below_coat, reflectance},
};
use crate::{
    Beyond, Emission, Material as Surface, MaterialId, PatternRef, Relief, Shape, ShapeId, SpectralCurve, Texture,
    TextureId, WorldBuilder,
};

/// A shape of a material at a place.
pub(super) struct Object {
    pub(super) shape: Shape,
    pub(super) frame: Frame,
    pub(super) material: Material,
}

/// What a thing is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Material {
    Matte(Paint),
    /// Under a clear coat of this index; smooth where alpha is 0.
    Coated {
        paint: Paint,
        index: f64,
        alpha: f64,
    },
    /// A polished metal of the color of a pigment.
    Metal(PigmentIndex),
    /// Dark glass with a label.
    Bottle,
    /// A lamp of this luminance, cd/m².
    Lamp(f64),
    /// A shade of pleated cloth of this luminance at its brightest, cd/m².
    Shade(f64),
}

impl Material {
    pub(super) fn plain(pigment: PigmentIndex) -> Self {
        Self::Matte(Paint::Plain(pigment))
    }

    pub(super) fn glossy(pigment: PigmentIndex) -> Self {
        Self::Coated { paint: Paint::Plain(pigment), index: 1.54, alpha: 0.0 }
    }

    pub(super) const WALNUT: Self = Self::Coated { paint: Paint::Walnut, index: 1.5, alpha: 0.045 };

    pub(super) fn name(self) -> String {
        let of = |paint: Paint| format!("{paint:?}").to_lowercase();
        match self {
            Self::Matte(paint) | Self::Coated { paint, .. } => of(paint),
            Self::Metal(_) => "metal".to_owned(),
            Self::Bottle => "bottle".to_owned(),
            Self::Lamp(_) => "lamp".to_owned(),
            Self::Shade(_) => "shade".to_owned(),
        }
    }
}

/// Where a shape stands: a point of the shape, y up, is at `origin + rotation · point`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) origin: DVec3,
    pub(super) rotation: DMat3,
}

impl Frame {
    pub(super) fn at(x: f64, y: f64, z: f64) -> Self {
        Self { origin: DVec3::new(x, y, z), rotation: DMat3::IDENTITY }
    }

    /// Turns about the vertical by an angle, then leaves the rest as it was.
    pub(super) fn turned_deg(self, degrees: f64) -> Self {
        Self { rotation: self.rotation * DMat3::from_rotation_y(degrees.to_radians()), ..self }
    }

    /// Leans back by an angle, about the shape's own x axis.
    pub(super) fn leaning_deg(self, degrees: f64) -> Self {
        Self { rotation: self.rotation * DMat3::from_rotation_x(degrees.to_radians()), ..self }
    }

    /// Tips over to the side by an angle, about the shape's own z axis.
    pub(super) fn tipped_deg(self, degrees: f64) -> Self {
        Self { rotation: self.rotation * DMat3::from_rotation_z(degrees.to_radians()), ..self }
    }

    /// Returns the frame whose y axis runs from one point to another.
    pub(super) fn along(from: DVec3, to: DVec3) -> Self {
        let y = (to - from).normalize();
        let x = y.any_orthonormal_vector();
        Self { origin: from, rotation: DMat3::from_cols(x, y, x.cross(y)) }
    }

    /// Returns the place of a shape whose axis is z.
    pub(super) fn place(&self) -> DAffine3 {
        let y_up = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
        DAffine3 { matrix3: self.rotation * y_up, translation: self.origin }
    }
}

/// Textures and materials that have been added.
#[derive(Default)]
pub(super) struct Palette {
    materials: Vec<(Material, MaterialId)>,
    /// By pigment and by the index of the coat above it.
    curves: Vec<((PigmentIndex, Option<f64>), TextureId)>,
}

impl Palette {
    pub(super) fn stand(&mut self, builder: &mut WorldBuilder, object: Object) -> ShapeId {
        let Object { shape, frame, material } = object;
        let id = self.material(builder, material);
        let shape_of = |builder: &mut WorldBuilder, emission| builder.add_shape(shape, frame.place(), id, emission);
        match material {
            Material::Lamp(luminance) => shape_of(builder, Some(glow(Light::Warm, luminance, false))),
            Material::Shade(luminance) => shape_of(builder, Some(glow(Light::Warm, luminance, true))),
            _ => shape_of(builder, None),
        }
    }

    pub(super) fn material(&mut self, builder: &mut WorldBuilder, material: Material) -> MaterialId {
        if let Some((_, id)) = self.materials.iter().find(|(known, _)| *known == material) {
            return *id;
        }
        let painted = |palette: &mut Self, builder: &mut WorldBuilder, paint: Paint, index: Option<f64>| {
            let pigments = paint.pigments();
            let of = pigments.iter().map(|&pigment| palette.curve(builder, pigment, index)).collect();
            builder.add_texture(Texture::Pattern { of, by: PatternRef::new(Painted { paint, pigments }) })
        };
        let coat = |base, index: f64, alpha: f64, builder: &mut WorldBuilder| {
            let roughness = (alpha > 0.0).then(|| {
                let alpha = builder.add_texture(Texture::Curve(SpectralCurve::constant(alpha as f32)));
                [alpha, alpha]
            });
            Surface::Coated { base, index: SpectralCurve::constant(index as f32), roughness }
        };
        let name = material.name();
        let id = match material {
            Material::Matte(paint) => {
                let reflectance = painted(self, builder, paint, None);
                let relief = paint.has_relief().then_some(Relief::Pattern(reflectance));
                builder.add_material_with(&name, Surface::Matte { reflectance }, relief)
            }
            Material::Coated { paint, index, alpha } => {
                let base = painted(self, builder, paint, Some(index));
                let relief = paint.has_relief().then_some(Relief::Pattern(base));
                let surface = coat(base, index, alpha, builder);
                builder.add_material_with(&name, surface, relief)
            }
            Material::Metal(pigment) => {
                let reflectance = self.curve(builder, pigment, None);
                builder.add_material(&name, Surface::Mirror { reflectance, roughness: None })
            }
            Material::Bottle => {
                const INDEX: f64 = 1.54;
                let base = self.curve(builder, Pigment::BottleGreen.index(), Some(INDEX));
                let surface = coat(base, INDEX, 0.0, builder);
                let glass = builder.add_material("bottle glass", surface);
                let label = self.material(builder, Material::Matte(Paint::Label));
                let amount = pattern(builder, Where::Label);
                builder.add_material(&name, Surface::Blend { of: [glass, label], amount })
            }
            Material::Lamp(_) | Material::Shade(_) => {
                let pigment = if matches!(material, Material::Lamp(_)) { Pigment::Ink } else { Pigment::Linen };
                let reflectance = self.curve(builder, pigment.index(), None);
                let id = builder.add_material(&name, Surface::Matte { reflectance });
                if matches!(material, Material::Shade(_)) {
                    let by = pattern(builder, Glow::Shade);
                    builder.set_glow(id, by);
                }
                id
            }
        };
        self.materials.push((material, id));
        id
    }

    pub(super) fn curve(&mut self, builder: &mut WorldBuilder, pigment: PigmentIndex, index: Option<f64>) -> TextureId {
        if let Some((_, id)) = self.curves.iter().find(|(known, _)| *known == (pigment, index)) {
            return *id;
        }
        let curve = index.map_or_else(|| reflectance(pigment), |index| below_coat(pigment, index));
        let id = builder.add_texture(Texture::Curve(curve));
        self.curves.push(((pigment, index), id));
        id
    }
}

/// Adds a texture that is 1 times a pattern of one part.
pub(super) fn pattern(builder: &mut WorldBuilder, pattern: impl crate::Pattern + 'static) -> TextureId {
    let one = builder.add_texture(Texture::Curve(SpectralCurve::constant(1.0)));
    builder.add_texture(Texture::Pattern { of: vec![one], by: PatternRef::new(pattern) })
}

/// Which light a glowing thing gives.
#[derive(Clone, Copy)]
pub(super) enum Light {
    /// Through the window.
    Day,
    /// Of lamps.
    Warm,
}

/// Returns the glow of a luminance, cd/m².
pub(super) fn glow(light: Light, luminance: f64, is_two_sided: bool) -> Emission {
    // Of 1 cd/m².
    static UNITS: OnceLock<[SpectralCurve; 2]> = OnceLock::new();
    let unit = |illuminant: Illuminant| {
        let grid = WavelengthGrid::uniform(360.0, 830.0, 5.0).expect("a valid range");
        let shape = illuminant.spectrum();
        let own = Observer::Cie1931.xyz(&grid, &shape.sample_or_zero(&grid)).luminance_cd_m2();
        SpectralCurve::new(&shape, Beyond::Zero).scaled((1.0 / own) as f32)
    };
    let units = UNITS.get_or_init(|| [unit(Illuminant::Daylight(6200.0)), unit(Illuminant::Blackbody(2850.0))]);
    let [day, warm] = units;
    let unit = match light {
        Light::Day => day,
        Light::Warm => warm,
    };
    Emission { radiance: unit.clone().scaled(luminance as f32), is_two_sided }
}
