//! One world put into another.

use glam::{Affine3A, DAffine3, DMat3, DVec3};

use crate::{
    Coordinates, GroupId, Material, MaterialId, MediumId, Procedural, Relief, ShapeId, Texture, TextureId, UvMapping,
    WorldBuilder, WorldError,
    world::{NewInstance, NewLight, NewShape, front_of},
};

impl WorldBuilder {
    /// Puts another world into this one, as the parts of one object: its up and its front made this world's, then placed. Its cameras
    /// are left out. Returns the object's name, which has a number where it was taken.
    ///
    /// # Errors
    /// When the place flattens it.
    pub fn add_world(&mut self, other: Self, name: &str, place: DAffine3) -> Result<String, WorldError> {
        let place = place * self.turn_from(&other);
        if !(place.is_finite() && place.matrix3.determinant().abs() > 0.0) {
            return Err(WorldError::Setting {
                what: "the place of a part",
                value: format!("{place:?}"),
                expected: "a finite transform that doesn't flatten what it moves",
            });
        }
        let object = self.objects.add(name, None);
        let numbers = Numbers {
            textures: self.textures.len() as u32,
            materials: self.surfaces.len() as u32,
            groups: self.n_groups - 1,
            objects: self.objects.take_in(&other.objects, Some(object)),
            shapes: self.shapes.len() as u32,
            media: self.media.len() as u32,
            own_from_world: place.inverse(),
        };
        if other.eye.is_some() {
            self.note(format!("{name}: the medium around its camera is left out with that"));
        }
        let Self { shapes, n_groups, instances, surfaces, textures, lights, sources, things, media, .. } = other;
        self.media.extend(media.iter().map(|medium| medium.moved(&place)));
        self.textures.extend(textures.into_iter().map(|mut texture| {
            numbers.texture(&mut texture);
            texture
        }));
        self.surfaces.extend(surfaces.into_iter().map(|mut surface| {
            numbers.material(&mut surface.material);
            surface.relief.iter_mut().for_each(|relief| numbers.grow(relief_texture(relief)));
            let more =
                surface.behind.iter_mut().flatten().chain(surface.film.iter_mut().map(|film| &mut film.thickness_nm));
            let more = more.chain(&mut surface.coverage).chain(&mut surface.glow).chain(&mut surface.directions);
            more.for_each(|texture| numbers.grow(texture));
            surface.filling = surface.filling.map(|medium| numbers.medium(medium));
            surface
        }));
        let group_of = |group: GroupId| if group == GroupId::ROOT { group } else { GroupId(group.0 + numbers.groups) };
        self.shapes.extend(shapes.into_iter().map(|shape| NewShape {
            place: if shape.group == GroupId::ROOT { place * shape.place } else { shape.place },
            group: group_of(shape.group),
            material: MaterialId(shape.material.0 + numbers.materials),
            object: shape.object + numbers.objects,
            interface: shape.interface.map(|interface| interface.renumbered(|medium| numbers.medium(medium))),
            ..shape
        }));
        self.n_groups += n_groups - 1;
        self.instances.extend(instances.into_iter().map(|instance| NewInstance {
            group: group_of(instance.group),
            place: place * instance.place,
            object: instance.object + numbers.objects,
        }));
        self.lights.extend(lights.into_iter().map(|NewLight { mut light, object }| {
            light.transform(&place);
            NewLight { light, object: object + numbers.objects }
        }));
        let renumbered =
            |thing: Vec<ShapeId>| thing.into_iter().map(|shape| ShapeId(shape.0 + numbers.shapes)).collect();
        self.things.extend(things.into_iter().map(renumbered));
        sources.iter().for_each(|file| self.add_source(file));
        for note in other.notes.sentences() {
            self.note(format!("{name}: {note}"));
        }
        Ok(self.objects.name(object).to_owned())
    }

    /// Returns the transform from the frame of another world, by its up, its front and its hand.
    fn turn_from(&self, other: &Self) -> DAffine3 {
        let (up, is_left_handed) = self.convention();
        other.to_frame(up, is_left_handed)
    }

    /// Returns the same world in a frame with this axis up and this hand.
    pub(crate) fn in_frame(mut self, up: DVec3, is_left_handed: bool) -> Self {
        let by = self.to_frame(up, is_left_handed);
        if by == DAffine3::IDENTITY {
            return self;
        }
        self.transform_picked(&vec![true; self.objects.len()], &by);
        let own_from_world = by.inverse();
        let numbers = Numbers { textures: 0, materials: 0, groups: 0, objects: 0, shapes: 0, media: 0, own_from_world };
        self.textures.iter_mut().for_each(|texture| numbers.texture(texture));
        self.cameras.iter_mut().for_each(|camera| camera.world_from_camera = by * camera.world_from_camera);
        if let Some((place, medium)) = self.eye {
            self.media.push(self.media[medium.0 as usize].moved(&by));
            self.eye = Some((by.transform_point3(place), MediumId(self.media.len() as u32 - 1)));
        }
        self.set_up(up, is_left_handed);
        self
    }

    /// Returns the transform into a frame with this axis up and this hand.
    pub(crate) fn to_frame(&self, up: DVec3, is_left_handed: bool) -> DAffine3 {
        let axes = |(up, is_left_handed): (DVec3, bool)| {
            let front = front_of(up, is_left_handed);
            let right = if is_left_handed { front.cross(up) } else { up.cross(front) };
            DMat3::from_cols(right, up, front)
        };
        let turn = axes((up, is_left_handed)) * axes(self.convention()).transpose();
        DAffine3::from_mat3(if turn.is_finite() { turn } else { DMat3::IDENTITY })
    }
}

/// By how much the numbers of what is put in grow.
struct Numbers {
    textures: u32,
    materials: u32,
    groups: u32,
    objects: u32,
    shapes: u32,
    media: u32,
    /// Of textures that are asked in the frame of the world.
    own_from_world: DAffine3,
}

fn relief_texture(relief: &mut Relief) -> &mut TextureId {
    match relief {
        Relief::Heights(id) | Relief::Normals(id) | Relief::ScaledNormals(id, _) | Relief::Pattern(id) => id,
    }
}

impl Numbers {
    fn medium(&self, medium: MediumId) -> MediumId {
        MediumId(medium.0 + self.media)
    }

    fn grow(&self, texture: &mut TextureId) {
        texture.0 += self.textures;
    }

    fn all<const N: usize>(&self, textures: [&mut TextureId; N]) {
        textures.into_iter().for_each(|texture| self.grow(texture));
    }

    fn material(&self, material: &mut Material) {
        use Material as M;
        let rough = |roughness: &mut crate::Roughness| roughness.iter_mut().flatten().for_each(|t| self.grow(t));
        let of_material = |id: &mut MaterialId| id.0 += self.materials;
        match material {
            M::Open | M::Pane { .. } => {}
            M::Matte { reflectance } => self.grow(reflectance),
            M::Translucent { reflectance, transmittance } => self.all([reflectance, transmittance]),
            M::RoughMatte { reflectance, sigma_deg } => self.all([reflectance, sigma_deg]),
            M::Mirror { reflectance, roughness } | M::Glossy { reflectance, roughness, .. } => {
                self.grow(reflectance);
                rough(roughness);
            }
            M::Metal { roughness, .. } | M::Dielectric { roughness, .. } => rough(roughness),
            M::Coated { base, roughness, .. } => {
                self.grow(base);
                rough(roughness);
            }
            M::Glass { reflectance, transmittance, roughness, .. } => {
                self.all([reflectance, transmittance]);
                rough(roughness);
            }
            M::Substrate { base, coat, roughness } => {
                self.all([base, coat]);
                rough(roughness);
            }
            M::MetallicRoughness { color, metallic, roughness, mirrored, edge, transmission, brushed } => {
                self.all([color, metallic, roughness, mirrored, edge]);
                transmission.iter_mut().chain(brushed).for_each(|texture| self.grow(texture));
            }
            M::Clearcoat { base, amount, roughness } => {
                of_material(base);
                self.all([amount, roughness]);
            }
            M::Sheen { base, color, roughness } => {
                of_material(base);
                self.all([color, roughness]);
            }
            M::Hair { color, .. } => self.grow(color),
            M::Sum { of } => of.iter_mut().for_each(of_material),
            M::Blend { of, amount } => {
                of.iter_mut().for_each(of_material);
                self.grow(amount);
            }
        }
    }

    fn frame(&self, frame: &mut Affine3A) {
        let own_from_world = self.own_from_world;
        *frame *=
            Affine3A::from_mat3_translation(own_from_world.matrix3.as_mat3(), own_from_world.translation.as_vec3());
    }

    fn mapping(&self, mapping: &mut UvMapping) {
        match &mut mapping.from {
            Coordinates::First | Coordinates::Second => {}
            Coordinates::Sphere(frame) | Coordinates::Cylinder(frame) | Coordinates::Plane(frame) => self.frame(frame),
        }
    }

    fn texture(&self, texture: &mut Texture) {
        use Procedural as P;
        use Texture as T;
        match texture {
            T::Curve(_) | T::VertexColors | T::VertexAlpha => {}
            T::Image { mapping, .. } | T::Channel { mapping, .. } => self.mapping(mapping),
            T::Checkerboard { fields, mapping } => {
                fields.iter_mut().for_each(|texture| self.grow(texture));
                self.mapping(mapping);
            }
            T::Step { of, .. } | T::Alpha { roughness: of, .. } => self.grow(of),
            T::Product(of) => of.iter_mut().for_each(|texture| self.grow(texture)),
            T::Blend { of, amount } => {
                of.iter_mut().for_each(|texture| self.grow(texture));
                self.grow(amount);
            }
            T::Pattern { of, .. } => of.iter_mut().for_each(|texture| self.grow(texture)),
            T::Procedural(procedural) => match &mut **procedural {
                P::Noise { frame, .. } | P::Marble { frame, .. } => self.frame(frame),
                P::Coordinates { mapping } => self.mapping(mapping),
                P::Dots { of, mapping } => {
                    of.iter_mut().for_each(|texture| self.grow(texture));
                    self.mapping(mapping);
                }
                P::Corners { of, mapping } => {
                    of.iter_mut().for_each(|texture| self.grow(texture));
                    self.mapping(mapping);
                }
                P::Blocks { of, frame } => {
                    of.iter_mut().for_each(|texture| self.grow(texture));
                    self.frame(frame);
                }
            },
        }
    }
}
