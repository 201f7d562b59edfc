//! Worlds changed before they are built: objects found by name, moved, copied, taken away.

use std::collections::HashMap;

use dioptric_spectrum::{Observer, WavelengthGrid};
use glam::{DAffine3, DMat3, DVec3};

use crate::{
    Emission, GroupId, Interface, Light, MaterialId, MediumId, Shape, ShapeId, SpectralCurve, WorldBuilder,
    WorldCamera, WorldError,
    shape::placed_bounds,
    world::{NewLight, NewShape, bounds_of},
};

/// What stands in a world under one name.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectInfo {
    /// Its name, which no other has.
    pub name: String,
    /// The object that it is part of.
    pub parent: Option<String>,
    /// What it is: the words of its shapes and lights, each once.
    pub kinds: Vec<&'static str>,
    /// Triangles and other shapes of its own.
    pub n_primitives: u64,
    /// The names of its materials, each once.
    pub materials: Vec<String>,
    /// The corners of an upright box around it and its parts, m; none of what has no extent.
    pub bounds_m: Option<[DVec3; 2]>,
    /// What light it gives, where it gives any: the largest of its lights.
    pub light: Option<LightLevel>,
}

/// How bright a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightLevel {
    /// The number.
    pub value: f64,
    /// Its unit: cd of points, lx of light from far away, cd/m² of what glows and of skies.
    pub unit: &'static str,
}

impl LightLevel {
    fn of_curve(curve: &SpectralCurve, unit: &'static str) -> Self {
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
        let values: Vec<f64> = fine.centers_nm().iter().map(|&nm| f64::from(curve.at(&[nm as f32])[0])).collect();
        Self { value: Observer::Cie1931.xyz(&fine, &values).luminance_cd_m2(), unit }
    }

    fn of(light: &Light) -> Self {
        match light {
            Light::Point { intensity, .. } | Light::Spot { intensity, .. } | Light::Pictured { intensity, .. } => {
                Self::of_curve(intensity, "cd")
            }
            Light::Distant { irradiance, .. } => Self::of_curve(irradiance, "lx"),
            Light::Sky { radiance } => Self::of_curve(radiance, "cd/m²"),
            Light::SkyImage(sky) => {
                let white = SpectralCurve::from_rgb_light([1.0; 3]);
                let mean = sky.mapping.mean_of(&sky.image) as f32;
                Self::of_curve(&white.scaled(mean * sky.scale), "cd/m²")
            }
        }
    }
}

impl Shape {
    /// What it is called where nothing else says a name.
    pub(crate) fn word(&self) -> &'static str {
        match self {
            Self::Mesh(_) => "mesh",
            Self::Sphere { .. } => "sphere",
            Self::Disc { .. } => "disc",
            Self::Cylinder { .. } => "cylinder",
            Self::Lathe(_) => "lathe",
        }
    }

    fn n_primitives(&self) -> u64 {
        if let Self::Mesh(mesh) = self { mesh.triangles.len() as u64 } else { 1 }
    }
}

impl Light {
    /// What it is called where nothing else says a name.
    pub(crate) fn word(&self) -> &'static str {
        match self {
            Self::Point { .. } => "point light",
            Self::Spot { .. } => "spot",
            Self::Pictured { .. } => "lamp",
            Self::Distant { .. } => "distant light",
            Self::Sky { .. } | Self::SkyImage(_) => "sky",
        }
    }

    /// Moves and turns it; how bright it is stays.
    pub(crate) fn transform(&mut self, by: &DAffine3) {
        let turn = turn_of(by);
        match self {
            Self::Point { position, .. } => *position = by.transform_point3(*position),
            Self::Spot { position, direction, .. } => {
                *position = by.transform_point3(*position);
                *direction = (turn * *direction).normalize_or(*direction);
            }
            Self::Pictured { position, world_from_light, .. } => {
                *position = by.transform_point3(*position);
                *world_from_light = turn * *world_from_light;
            }
            Self::Distant { direction, .. } => *direction = (turn * *direction).normalize_or(*direction),
            Self::Sky { .. } => {}
            Self::SkyImage(sky) => sky.world_from_sky = turn * sky.world_from_sky,
        }
    }

    /// Makes it so many times as bright.
    pub(crate) fn brighten(&mut self, factor: f32) {
        match self {
            Self::Point { intensity: curve, .. }
            | Self::Spot { intensity: curve, .. }
            | Self::Pictured { intensity: curve, .. }
            | Self::Distant { irradiance: curve, .. }
            | Self::Sky { radiance: curve } => *curve = curve.clone().scaled(factor),
            Self::SkyImage(sky) => sky.scale *= factor,
        }
    }

    fn position(&self) -> Option<DVec3> {
        match self {
            Self::Point { position, .. } | Self::Spot { position, .. } | Self::Pictured { position, .. } => {
                Some(*position)
            }
            Self::Distant { .. } | Self::Sky { .. } | Self::SkyImage(_) => None,
        }
    }
}

/// Returns the turn, mirrored where it mirrors, of a place: its axes, made orthonormal one after another.
fn turn_of(place: &DAffine3) -> DMat3 {
    let m = place.matrix3;
    let x = m.x_axis.normalize_or(DVec3::X);
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize_or(x.any_orthonormal_vector());
    let z = x.cross(y);
    DMat3::from_cols(x, y, if m.determinant() < 0.0 { -z } else { z })
}

/// Objects of one world are named by their names in all that changes them; `*` in a name stands for any letters and `?` for one, and what
/// an object is made of goes with it. Places are metres, in the frame of the world.
///
/// ```
/// use dioptric_world::{Material, Shape, SpectralCurve, Texture, WorldBuilder, glam::{DAffine3, DVec3}};
/// let mut builder = WorldBuilder::new();
/// let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
/// let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
/// builder.name_next("ball");
/// builder.add_shape(Shape::Sphere { radius_m: 0.1 }, DAffine3::IDENTITY, matte, None);
/// builder.copy_object("ball", "other")?;
/// builder.move_object("other", DVec3::X)?;
/// assert_eq!(builder.bounds_of_object("other")?.unwrap()[1], DVec3::new(1.1, 0.1, 0.1));
/// let wrong = builder.remove_object("bal").unwrap_err().to_string();
/// assert_eq!(wrong, "no object is called 'bal': near it are 'ball'");
/// # Ok::<(), dioptric_world::WorldError>(())
/// ```
impl WorldBuilder {
    /// Returns what stands in the world, in the order in which it was added.
    pub fn objects(&self) -> Vec<ObjectInfo> {
        let mut infos: Vec<ObjectInfo> = (0..self.objects.len() as u32)
            .map(|object| ObjectInfo {
                name: self.objects.name(object).to_owned(),
                parent: self.objects.parent(object).map(|parent| self.objects.name(parent).to_owned()),
                kinds: Vec::new(),
                n_primitives: 0,
                materials: Vec::new(),
                bounds_m: None,
                light: None,
            })
            .collect();
        let mut boxes = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY); infos.len()];
        let grow = |(a, b): &mut (DVec3, DVec3), (low, high): (DVec3, DVec3)| (*a, *b) = (a.min(low), b.max(high));
        let groups = self.shapes_of_groups();
        let group_boxes: Vec<_> =
            groups.iter().map(|shapes| bounds_of(shapes.iter().map(|&shape| &self.shapes[shape]))).collect();
        let mut tell = |object: u32, shape: &NewShape| {
            let info = &mut infos[object as usize];
            info.n_primitives += shape.shape.n_primitives();
            add_once(&mut info.kinds, shape.shape.word());
            if let Some(surface) = self.surfaces.get(shape.material.0 as usize) {
                add_once(&mut info.materials, surface.name.clone());
            }
            if let Some(emission) = &shape.emission {
                info.shine(LightLevel::of_curve(&emission.radiance, "cd/m²"));
            }
        };
        for shape in self.shapes.iter().filter(|shape| shape.group == GroupId::ROOT) {
            tell(shape.object, shape);
            grow(&mut boxes[shape.object as usize], bounds_of(std::iter::once(shape)));
        }
        for instance in &self.instances {
            let group = instance.group.0 as usize;
            groups[group].iter().for_each(|&shape| tell(instance.object, &self.shapes[shape]));
            let (low, high) = group_boxes[group];
            if low.cmple(high).all() {
                grow(&mut boxes[instance.object as usize], placed_bounds(&instance.place, low, high));
            }
        }
        for NewLight { light, object } in &self.lights {
            let info = &mut infos[*object as usize];
            add_once(&mut info.kinds, light.word());
            info.shine(LightLevel::of(light));
            if let Some(at) = light.position() {
                grow(&mut boxes[*object as usize], (at, at));
            }
        }
        // Parts come after what they are parts of.
        for object in (0..infos.len()).rev() {
            let own = boxes[object];
            if let Some(parent) = self.objects.parent(object as u32) {
                grow(&mut boxes[parent as usize], own);
            }
            infos[object].bounds_m = own.0.cmple(own.1).all().then_some([own.0, own.1]);
        }
        self.objects.there().map(|object| infos[object as usize].clone()).collect()
    }

    /// Returns the names of the objects that a name means, parts of them included.
    ///
    /// # Errors
    /// When no object is called so.
    pub fn find_objects(&self, name: &str) -> Result<Vec<String>, WorldError> {
        let picked = self.picked(name)?;
        let names = self.objects.there().filter(|&object| picked[object as usize]);
        Ok(names.map(|object| self.objects.name(object).to_owned()).collect())
    }

    /// Returns the corners of an upright box around objects and their parts, m; none where they have no place.
    ///
    /// # Errors
    /// When no object is called so.
    pub fn bounds_of_object(&self, name: &str) -> Result<Option<[DVec3; 2]>, WorldError> {
        let picked = self.picked(name)?;
        Ok(self.bounds_of_picked(&picked))
    }

    /// Puts objects elsewhere by a transform of the world: moved, turned, scaled, mirrored.
    ///
    /// # Errors
    /// When no object is called so, or the transform flattens them.
    pub fn transform_object(&mut self, name: &str, by: &DAffine3) -> Result<(), WorldError> {
        let picked = self.picked(name)?;
        if !(by.is_finite() && by.matrix3.determinant().abs() > 0.0) {
            return Err(WorldError::Setting {
                what: "what an object is transformed by",
                value: format!("{by:?}"),
                expected: "a finite transform that doesn't flatten what it moves",
            });
        }
        self.transform_picked(&picked, by);
        Ok(())
    }

    /// Moves objects by so much, m.
    ///
    /// # Errors
    /// As [`transform_object`](Self::transform_object).
    pub fn move_object(&mut self, name: &str, by_m: DVec3) -> Result<(), WorldError> {
        self.transform_object(name, &DAffine3::from_translation(by_m))
    }

    /// Moves objects so that the middle of the box around them all is there, m.
    ///
    /// # Errors
    /// As [`transform_object`](Self::transform_object).
    pub fn move_object_to(&mut self, name: &str, to_m: DVec3) -> Result<(), WorldError> {
        let middle = self.middle_of(name)?;
        self.move_object(name, to_m - middle)
    }

    /// Turns objects about an axis by the right hand, rad: through a point, or the middle of the box around them all.
    ///
    /// # Errors
    /// When no object is called so, or the axis has no direction.
    pub fn turn_object(
        &mut self,
        name: &str,
        axis: DVec3,
        angle_rad: f64,
        about_m: Option<DVec3>,
    ) -> Result<(), WorldError> {
        let axis = axis.try_normalize().filter(|_| angle_rad.is_finite());
        let Some(axis) = axis else {
            let value = format!("{angle_rad} rad about no direction");
            let expected = "a finite angle about an axis of some length";
            return Err(WorldError::Setting { what: "the turn of an object", value, expected });
        };
        self.transform_about(name, DMat3::from_axis_angle(axis, angle_rad), about_m)
    }

    /// Scales objects along the axes of the world: from a point, or the middle of the box around them all. What glows keeps its radiance.
    ///
    /// # Errors
    /// When no object is called so, or a factor is 0.
    pub fn scale_object(&mut self, name: &str, by: DVec3, about_m: Option<DVec3>) -> Result<(), WorldError> {
        self.transform_about(name, DMat3::from_diagonal(by), about_m)
    }

    /// Takes objects, with their parts, out of the world.
    ///
    /// # Errors
    /// When no object is called so.
    pub fn remove_object(&mut self, name: &str) -> Result<(), WorldError> {
        let picked = self.picked(name)?;
        let is_picked = |object: u32| picked[object as usize];
        let stays = |shape: &NewShape| shape.group != GroupId::ROOT || !is_picked(shape.object);
        // Shapes are numbered, and things know them by their numbers.
        let mut n = 0;
        let numbers: Vec<Option<ShapeId>> = self
            .shapes
            .iter()
            .map(|shape| {
                stays(shape).then(|| {
                    n += 1;
                    ShapeId(n - 1)
                })
            })
            .collect();
        self.shapes.retain(stays);
        for thing in &mut self.things {
            *thing = thing.iter().filter_map(|shape| numbers.get(shape.0 as usize).copied().flatten()).collect();
        }
        self.instances.retain(|instance| !is_picked(instance.object));
        self.lights.retain(|light| !is_picked(light.object));
        self.objects.remove(&picked);
        Ok(())
    }

    /// Adds the same objects again, in the same place, under a name; where a name is taken it gets a number. Returns what the copies are called.
    ///
    /// # Errors
    /// When no object is called so.
    pub fn copy_object(&mut self, name: &str, to: &str) -> Result<Vec<String>, WorldError> {
        let picked = self.picked(name)?;
        let mut copies: HashMap<u32, u32> = HashMap::new();
        let mut names = Vec::new();
        for object in (0..picked.len() as u32).filter(|&object| picked[object as usize]) {
            let parent = self.objects.parent(object);
            let copy = match parent.and_then(|parent| copies.get(&parent).copied()) {
                Some(parent) => {
                    let name = self.objects.name(object).to_owned();
                    self.objects.add(&name, Some(parent))
                }
                None => {
                    let copy = self.objects.add(to, parent);
                    names.push(self.objects.name(copy).to_owned());
                    copy
                }
            };
            copies.insert(object, copy);
        }
        let mut shapes: HashMap<ShapeId, ShapeId> = HashMap::new();
        for index in 0..self.shapes.len() {
            let shape = &self.shapes[index];
            let Some(&object) = copies.get(&shape.object).filter(|_| shape.group == GroupId::ROOT) else { continue };
            shapes.insert(ShapeId(index as u32), ShapeId(self.shapes.len() as u32));
            self.shapes.push(NewShape { object, ..shape.clone() });
        }
        for index in 0..self.things.len() {
            let copied: Vec<ShapeId> =
                self.things[index].iter().filter_map(|shape| shapes.get(shape).copied()).collect();
            if copied.len() > 1 {
                self.things.push(copied);
            }
        }
        for index in 0..self.instances.len() {
            if let Some(&object) = copies.get(&self.instances[index].object) {
                self.instances.push(crate::world::NewInstance { object, ..self.instances[index].clone() });
            }
        }
        for index in 0..self.lights.len() {
            if let Some(&object) = copies.get(&self.lights[index].object) {
                self.lights.push(NewLight { object, ..self.lights[index].clone() });
            }
        }
        Ok(names)
    }

    /// Makes objects of another material.
    ///
    /// # Errors
    /// When no object is called so.
    pub fn set_material_of(&mut self, name: &str, material: MaterialId) -> Result<(), WorldError> {
        let picked = self.picked(name)?;
        self.change_shapes(&picked, |shape| shape.material = material);
        Ok(())
    }

    /// Makes objects glow, in place of any glow of theirs.
    ///
    /// # Errors
    /// When no object is called so, or none of them has a surface.
    pub fn set_emission_of(&mut self, name: &str, emission: &Emission) -> Result<(), WorldError> {
        let picked = self.picked(name)?;
        let mut n = 0;
        self.change_shapes(&picked, |shape| {
            n += 1;
            shape.emission = Some(emission.clone());
        });
        if n > 0 {
            return Ok(());
        }
        let value = format!("'{name}'");
        Err(WorldError::Setting { what: "the object to glow", value, expected: "one that has a surface" })
    }

    /// Returns the corners of an upright box around everything, m; none of a world without shapes.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        self.bounds_of_picked(&vec![true; self.objects.len()])
    }

    /// Whether its frame is left-handed, as [`World::is_left_handed`](crate::World::is_left_handed).
    pub fn is_left_handed(&self) -> bool {
        self.convention().1
    }

    /// The names of the materials.
    pub fn material_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.surfaces.iter().map(|surface| surface.name.as_str())
    }

    /// The names of the cameras.
    pub fn camera_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.cameras.iter().map(|camera| camera.name.as_str())
    }

    /// Returns what of files wasn't understood, a sentence each, as [`World::notes`](crate::World::notes).
    pub fn notes(&self) -> Vec<String> {
        self.notes.clone().sentences()
    }

    /// Puts a camera before the others; what is up in the world stays.
    pub fn put_camera_first(&mut self, camera: WorldCamera) {
        self.hold_up();
        self.cameras.insert(0, camera);
    }

    /// Makes the lights of objects, and what of them glows, so many times as bright.
    ///
    /// # Errors
    /// When no object is called so, none of them gives light, or the factor is negative or not finite.
    pub fn brighten_object(&mut self, name: &str, factor: f64) -> Result<(), WorldError> {
        let picked = self.picked(name)?;
        if !(factor >= 0.0 && factor.is_finite()) {
            let (what, value) = ("how many times as bright an object is", factor.to_string());
            return Err(WorldError::Setting { what, value, expected: "a finite number, 0 or more" });
        }
        let factor = factor as f32;
        let mut is_lit = false;
        self.change_shapes(&picked, |shape| {
            if let Some(emission) = &mut shape.emission {
                is_lit = true;
                emission.radiance = emission.radiance.clone().scaled(factor);
            }
        });
        for light in self.lights.iter_mut().filter(|light| picked[light.object as usize]) {
            is_lit = true;
            light.light.brighten(factor);
        }
        if is_lit {
            return Ok(());
        }
        let value = format!("'{name}'");
        Err(WorldError::Setting { what: "the object to brighten", value, expected: "one that gives light" })
    }

    /// Returns the material of a name: the first of those called so.
    ///
    /// # Errors
    /// When there is none.
    pub fn material_named(&self, name: &str) -> Result<MaterialId, WorldError> {
        let found = self.surfaces.iter().position(|surface| surface.name == name);
        found.map(|index| MaterialId(index as u32)).ok_or_else(|| {
            let mut known = crate::objects::Objects::default();
            self.surfaces.iter().for_each(|surface| {
                known.add(&surface.name, None);
            });
            WorldError::NoMaterial { name: name.to_owned(), near: known.near(name) }
        })
    }

    fn picked(&self, name: &str) -> Result<Vec<bool>, WorldError> {
        let picked = self.objects.matching(name);
        match picked.contains(&true) {
            true => Ok(picked),
            false => Err(WorldError::NoObject { name: name.to_owned(), near: self.objects.near(name) }),
        }
    }

    fn middle_of(&self, name: &str) -> Result<DVec3, WorldError> {
        let picked = self.picked(name)?;
        Ok(self.bounds_of_picked(&picked).map_or(DVec3::ZERO, |[low, high]| 0.5 * (low + high)))
    }

    fn transform_about(&mut self, name: &str, matrix3: DMat3, about_m: Option<DVec3>) -> Result<(), WorldError> {
        let about_m = about_m.map_or_else(|| self.middle_of(name), Ok)?;
        let by = DAffine3 { matrix3, translation: about_m - matrix3 * about_m };
        self.transform_object(name, &by)
    }

    pub(crate) fn transform_picked(&mut self, picked: &[bool], by: &DAffine3) {
        // What fills a shape from place to place goes with it.
        let mut moved: HashMap<MediumId, MediumId> = HashMap::new();
        let is_picked = |shape: &NewShape| shape.group == GroupId::ROOT && picked[shape.object as usize];
        for shape in self.shapes.iter_mut().filter(|shape| is_picked(shape)) {
            let Some(inside) = shape.interface.and_then(|interface| interface.inside) else { continue };
            if self.media.get(inside.0 as usize).is_some_and(|medium| !medium.is_even()) {
                let number = *moved.entry(inside).or_insert_with(|| {
                    self.media.push(self.media[inside.0 as usize].moved(by));
                    MediumId(self.media.len() as u32 - 1)
                });
                shape.interface = shape.interface.map(|interface| Interface { inside: Some(number), ..interface });
            }
        }
        for shape in self.shapes.iter_mut().filter(|shape| shape.group == GroupId::ROOT) {
            if picked[shape.object as usize] {
                shape.place = *by * shape.place;
            }
        }
        for instance in self.instances.iter_mut().filter(|instance| picked[instance.object as usize]) {
            instance.place = *by * instance.place;
        }
        for light in self.lights.iter_mut().filter(|light| picked[light.object as usize]) {
            light.light.transform(by);
        }
    }

    fn bounds_of_picked(&self, picked: &[bool]) -> Option<[DVec3; 2]> {
        let is_picked = |object: u32| picked[object as usize];
        let own = self.shapes.iter().filter(|shape| shape.group == GroupId::ROOT && is_picked(shape.object));
        let (mut low, mut high) = bounds_of(own);
        let mut of_groups: HashMap<GroupId, (DVec3, DVec3)> = HashMap::new();
        for instance in self.instances.iter().filter(|instance| is_picked(instance.object)) {
            let of_group = || bounds_of(self.shapes.iter().filter(|shape| shape.group == instance.group));
            let (a, b) = *of_groups.entry(instance.group).or_insert_with(of_group);
            if a.cmple(b).all() {
                let (a, b) = placed_bounds(&instance.place, a, b);
                (low, high) = (low.min(a), high.max(b));
            }
        }
        for at in self.lights.iter().filter(|light| is_picked(light.object)).filter_map(|new| new.light.position()) {
            (low, high) = (low.min(at), high.max(at));
        }
        low.cmple(high).all().then_some([low, high])
    }

    /// The shapes of each group by their places in the list; none of the root.
    fn shapes_of_groups(&self) -> Vec<Vec<usize>> {
        let mut groups = vec![Vec::new(); self.n_groups as usize];
        for (index, shape) in self.shapes.iter().enumerate().filter(|(_, shape)| shape.group != GroupId::ROOT) {
            groups[shape.group.0 as usize].push(index);
        }
        groups
    }

    /// Changes shapes of objects; groups that others have too are copied first.
    fn change_shapes(&mut self, picked: &[bool], mut change: impl FnMut(&mut NewShape)) {
        let is_picked = |object: u32| picked[object as usize];
        for shape in self.shapes.iter_mut().filter(|shape| shape.group == GroupId::ROOT) {
            if is_picked(shape.object) {
                change(shape);
            }
        }
        let mut own: HashMap<GroupId, GroupId> = HashMap::new();
        for index in 0..self.instances.len() {
            let group = self.instances[index].group;
            if !is_picked(self.instances[index].object) {
                continue;
            }
            let new = match own.get(&group) {
                Some(new) => *new,
                None => {
                    let is_shared = self.instances.iter().any(|other| other.group == group && !is_picked(other.object));
                    let new = if is_shared { self.add_group() } else { group };
                    for shape in 0..self.shapes.len() {
                        if self.shapes[shape].group != group {
                            continue;
                        }
                        if is_shared {
                            let mut copy = NewShape { group: new, ..self.shapes[shape].clone() };
                            change(&mut copy);
                            self.shapes.push(copy);
                        } else {
                            change(&mut self.shapes[shape]);
                        }
                    }
                    own.insert(group, new);
                    new
                }
            };
            self.instances[index].group = new;
        }
    }
}

impl ObjectInfo {
    fn shine(&mut self, level: LightLevel) {
        if self.light.is_none_or(|known| known.value < level.value) {
            self.light = Some(level);
        }
    }
}

fn add_once<T: PartialEq>(list: &mut Vec<T>, item: T) {
    if !list.contains(&item) {
        list.push(item);
    }
}
