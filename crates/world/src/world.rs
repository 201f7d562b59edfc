//! Worlds: what there is, checked once and then only looked at.

use glam::{DAffine3, DVec3, Vec2, Vec3};

use crate::{
    Bsdf, Emission, GroupId, Hit, InstanceId, Light, LightSample, Material, MaterialId, PatternPoint, Ray, Receiver,
    Relief, Shape, ShapeId, Texture, TextureId, TriangleMesh, WorldCamera, WorldError,
    group::{Crossing, Group, GroupParts, Instance, Parts, Primitive},
    lights::Lights,
    material::{Surface, Surfaces},
    mesh::normal_matrix,
    pattern::MOST_SHARES,
    patterned::{Frames, Patterned},
    placed::{PlacedKind, PlacedShape},
    shape::Quadric,
    texture::{MAX_DEPTH, Textures},
};

/// Geometry, materials, lights and cameras, checked and ready to be asked.
///
/// Lengths are metres. The frame is the file's: as they are shown, pbrt's files are left-handed (x right, y up, z away) and
/// glTF's right-handed (z towards the viewer); nothing here depends on which. Worlds don't change; they are made by a
/// [`WorldBuilder`] or by [`read_world`](crate::read_world).
#[derive(Debug)]
pub struct World {
    geometry: Geometry,
    surfaces: Vec<Surface>,
    textures: Vec<Texture>,
    lights: Lights,
    cameras: Vec<WorldCamera>,
    notes: Vec<String>,
    patterned: Patterned,
}

/// All that a ray can meet.
#[derive(Debug, Default)]
struct Geometry {
    shapes: Vec<PlacedShape>,
    instances: Vec<Instance>,
    /// The root first.
    groups: Vec<Group>,
}

impl Parts for Geometry {
    fn quadric(&self, shape: u32) -> &Quadric {
        match &self.shapes[shape as usize].kind {
            PlacedKind::Quadric(quadric) => quadric,
            PlacedKind::Mesh(_) => unreachable!("the tree marks only quadrics as such"),
        }
    }

    fn instance(&self, instance: u32) -> &Instance {
        &self.instances[instance as usize]
    }

    fn group(&self, group: u32) -> &Group {
        &self.groups[group as usize]
    }
}

impl Frames for Geometry {
    fn instance_place(&self, instance: InstanceId) -> (&DAffine3, &DAffine3) {
        let Instance { place, inverse, .. } = &self.instances[instance.0 as usize];
        (place, inverse)
    }
}

impl World {
    /// Returns where a ray first meets a surface nearer than `t_max_m`.
    pub fn intersect(&self, ray: &Ray, t_max_m: f32) -> Option<Hit> {
        let root = &self.geometry.groups[0];
        let crossing = root.nearest(&self.geometry, ray.origin, ray.direction, t_max_m)?;
        Some(self.geometry.hit(ray, &crossing))
    }

    /// Tells whether a ray meets anything before it has gone `length_m`, which it isn't held to to the last digit.
    ///
    /// The last 1e-4 of the length is left out, so that a ray to a light doesn't meet the light itself.
    pub fn is_occluded(&self, ray: &Ray, length_m: f32) -> bool {
        let root = &self.geometry.groups[0];
        root.is_crossed(&self.geometry, ray.origin, ray.direction, length_m * (1.0 - 1e-4))
    }

    /// Returns how the surface at a hit scatters light that leaves it towards `outgoing`, at these wavelengths, nm.
    ///
    /// `outgoing` has length 1 and points away from the surface, against the ray that met it.
    pub fn bsdf<const N: usize>(&self, hit: &Hit, outgoing: Vec3, wavelengths_nm: &[f32; N]) -> Bsdf<N> {
        let (place, at) = self.patterned.place_of(hit, &self.geometry);
        let textures = Textures(&self.textures, &at);
        Surfaces { surfaces: &self.surfaces, textures, place }.bsdf(hit, outgoing, wavelengths_nm)
    }

    /// Returns the radiance, W m⁻² sr⁻¹ nm⁻¹, that the surface at a hit gives of itself towards `outgoing`.
    pub fn emission<const N: usize>(&self, hit: &Hit, outgoing: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match &self.geometry.shapes[hit.shape.0 as usize].emission {
            Some(emission) if emission.is_two_sided || hit.geometric_normal.dot(outgoing) > 0.0 => {
                let share = self.glow_at(hit.shape, hit.point, hit.instance);
                emission.radiance.at(wavelengths_nm).map(|l| share * l)
            }
            _ => [0.0; N],
        }
    }

    /// Returns what the glow of a shape is multiplied by at a point of it.
    fn glow_at(&self, shape: ShapeId, point: Vec3, instance: Option<InstanceId>) -> f32 {
        let Some(texture) = self.patterned.glow_of(shape) else { return 1.0 };
        let place = self.patterned.place(shape, instance, &self.geometry);
        let at = PatternPoint { point_m: place.own_point(point), ..PatternPoint::default() };
        Textures(&self.textures, &at).number(texture, Vec2::ZERO).max(0.0)
    }

    /// Whether two shapes are one thing: the same shape, or some that were [joined](WorldBuilder::join).
    pub fn are_one_thing(&self, a: ShapeId, b: ShapeId) -> bool {
        a == b || self.patterned.are_joined(a, b)
    }

    /// Returns the radiance, W m⁻² sr⁻¹ nm⁻¹, that comes from a direction in which nothing is met.
    pub fn sky<const N: usize>(&self, direction: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        self.lights.sky(direction, wavelengths_nm)
    }

    /// Draws light that falls on a point; `None` where the drawn light doesn't shine there.
    ///
    /// `u_light` and `u` are in [0, 1). Estimators divide by [`LightSample::pdf`], which holds the choice of the light.
    pub fn sample_light<const N: usize>(
        &self,
        at: impl Into<Receiver>,
        u_light: f32,
        u: [f32; 2],
        wavelengths_nm: &[f32; N],
    ) -> Option<LightSample<N>> {
        let at = at.into();
        let drawn = self.lights.sample(&self.geometry.shapes, &at, u_light, u, wavelengths_nm)?;
        if !self.patterned.has_glow() {
            return Some(drawn);
        }
        let Some(shape) = self.lights.shape_of(drawn.light) else { return Some(drawn) };
        let share = self.glow_at(shape, at.point + drawn.distance_m * drawn.direction, None);
        Some(LightSample { radiance: drawn.radiance.map(|l| share * l), ..drawn })
    }

    /// Returns the density, 1/sr, with which [`sample_light`](Self::sample_light) draws the glowing point of a hit.
    ///
    /// 0 where the surface doesn't glow, or glows within an instance, which isn't sampled.
    pub fn light_pdf(&self, at: impl Into<Receiver>, hit: &Hit) -> f32 {
        self.lights.pdf(&self.geometry.shapes, &at.into(), hit)
    }

    /// Returns the density, 1/sr, with which [`sample_light`](Self::sample_light) draws a direction of the sky for this point.
    pub fn sky_pdf(&self, at: impl Into<Receiver>, direction: Vec3) -> f32 {
        self.lights.sky_pdf(&at.into(), direction)
    }

    /// How many lights there are, glowing shapes included.
    pub fn n_lights(&self) -> usize {
        self.lights.len()
    }

    /// How many triangles and other primitives there are, each counted once however often it is placed.
    pub fn n_primitives(&self) -> u64 {
        let of = |shape: &PlacedShape| match &shape.kind {
            PlacedKind::Mesh(mesh) => mesh.triangles.len() as u64,
            PlacedKind::Quadric(_) => 1,
        };
        self.geometry.shapes.iter().map(of).sum()
    }

    /// The names of the materials, in the order of their numbers.
    pub fn material_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.surfaces.iter().map(|surface| surface.name.as_str())
    }

    /// The cameras that came with the world.
    pub fn cameras(&self) -> &[WorldCamera] {
        &self.cameras
    }

    /// What of a file wasn't understood, and what stands in its place; a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The corners of an upright box around everything, m; `None` for a world without shapes.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let (low, high) = self.geometry.groups[0].bounds();
        low.cmple(high).all().then_some((low, high))
    }
}

impl Geometry {
    /// Returns all about a crossing of a ray in the root group.
    fn hit(&self, ray: &Ray, crossing: &Crossing) -> Hit {
        let shape = &self.shapes[crossing.shape as usize];
        let instance = crossing.instance.map(|index| &self.instances[index as usize]);
        let mut hit = match (&shape.kind, crossing.primitive) {
            (PlacedKind::Mesh(mesh), Primitive::Triangle { index, corners, b1, b2 }) => {
                mesh.hit(index, corners, b1, b2)
            }
            (PlacedKind::Quadric(quadric), _) => {
                let world_point = ray.origin.as_dvec3() + f64::from(crossing.t) * ray.direction.as_dvec3();
                quadric.hit(instance.map_or(world_point, |i| i.inverse.transform_point3(world_point)))
            }
            (PlacedKind::Mesh(_), Primitive::Quadric) => unreachable!("the tree marks triangles of meshes as such"),
        };
        if shape.is_reversed {
            (hit.geometric_normal, hit.shading_normal) = (-hit.geometric_normal, -hit.shading_normal);
        }
        if let Some(instance) = instance {
            hit.place(&instance.place);
        }
        Hit {
            distance_m: crossing.t,
            shape: ShapeId(crossing.shape),
            material: shape.material,
            instance: crossing.instance.map(InstanceId),
            ..hit
        }
    }
}

impl TriangleMesh {
    /// Returns a hit of a triangle in the mesh's own frame, with what the mesh doesn't know left at 0.
    ///
    /// The corners are given, since the tree holds them too: a mesh without normals and texture coordinates is not looked
    /// into, which on a large one means waiting for memory.
    fn hit(&self, triangle: u32, corners: [Vec3; 3], b1: f32, b2: f32) -> Hit {
        let vertices = || self.triangles[triangle as usize].map(|v| v as usize);
        let b0 = 1.0 - b1 - b2;
        let weigh = |[a, b, c]: [Vec3; 3]| b0 * a + b1 * b + b2 * c;
        let [a, b, c] = corners;
        // Rounding of the weighted sum: γ₇ of the sum of magnitudes (pbrt, 4th edition, 6.8.5), by its largest component.
        let magnitude = weigh(corners.map(Vec3::abs)).max_element();
        let geometric_normal = self.outward_normal(triangle as usize, corners);
        let shading_normal = match self.normals.is_empty() {
            true => geometric_normal,
            false => weigh(vertices().map(|v| self.normals[v])).normalize_or(geometric_normal),
        };
        let uvs = if self.uvs.is_empty() { [Vec2::ZERO, Vec2::X, Vec2::ONE] } else { vertices().map(|v| self.uvs[v]) };
        let (dp_du, dp_dv) = derivatives([b - a, c - a], [uvs[1] - uvs[0], uvs[2] - uvs[0]], geometric_normal);
        Hit {
            distance_m: 0.0,
            point: weigh(corners),
            point_error_m: 8.0 * f32::EPSILON * magnitude,
            geometric_normal,
            shading_normal,
            dp_du,
            dp_dv,
            uv: b0 * uvs[0] + b1 * uvs[1] + b2 * uvs[2],
            shape: ShapeId(0),
            primitive: triangle,
            material: MaterialId(0),
            instance: None,
            footprint_m: 0.0,
        }
    }
}

/// Returns ∂p/∂u and ∂p/∂v from two sides of a triangle and their texture coordinates.
fn derivatives([p1, p2]: [Vec3; 2], [uv1, uv2]: [Vec2; 2], normal: Vec3) -> (Vec3, Vec3) {
    let determinant = uv1.perp_dot(uv2);
    if determinant.abs() > 1e-12 {
        ((uv2.y * p1 - uv1.y * p2) / determinant, (uv1.x * p2 - uv2.x * p1) / determinant)
    } else {
        normal.any_orthonormal_pair()
    }
}

impl Quadric {
    fn hit(&self, near: DVec3) -> Hit {
        let at = self.surface_at(near);
        let point = at.point.as_vec3();
        Hit {
            distance_m: 0.0,
            point,
            point_error_m: 4.0 * f32::EPSILON * point.abs().max_element(),
            geometric_normal: at.normal.as_vec3(),
            shading_normal: at.normal.as_vec3(),
            dp_du: at.dp_du.as_vec3(),
            dp_dv: at.dp_dv.as_vec3(),
            uv: at.uv.as_vec2(),
            shape: ShapeId(0),
            primitive: 0,
            material: MaterialId(0),
            instance: None,
            footprint_m: 0.0,
        }
    }
}

impl Hit {
    /// Moves the hit from the frame of a group into that of the world.
    fn place(&mut self, place: &DAffine3) {
        let m = place.matrix3;
        let scale = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length()) as f32;
        // The next ray's start is rounded once more on its way back into the group.
        let own_error = self.point_error_m + 2.0 * f32::EPSILON * self.point.abs().max_element();
        self.point = place.transform_point3(self.point.as_dvec3()).as_vec3();
        self.point_error_m = 2.0 * scale * own_error + 4.0 * f32::EPSILON * self.point.abs().max_element();
        let normals_by = normal_matrix(place);
        let move_normal = |n: Vec3| (normals_by * n.as_dvec3()).normalize_or(DVec3::Z).as_vec3();
        self.geometric_normal = move_normal(self.geometric_normal);
        self.shading_normal = move_normal(self.shading_normal);
        self.dp_du = place.transform_vector3(self.dp_du.as_dvec3()).as_vec3();
        self.dp_dv = place.transform_vector3(self.dp_dv.as_dvec3()).as_vec3();
    }
}

/// Collects the parts of a world, and checks them when it is built.
///
/// ```
/// use dioptric_world::{Emission, Material, Ray, Shape, SpectralCurve, Texture, WorldBuilder, glam::{DAffine3, DVec3, Vec3}};
/// let mut builder = WorldBuilder::new();
/// let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
/// let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
/// let ball = builder.add_shape(
///     Shape::Sphere { radius_m: 0.5 }, DAffine3::from_translation(DVec3::new(0.0, 0.0, 2.0)), matte, None,
/// );
/// let world = builder.build()?;
/// let hit = world.intersect(&Ray { origin: Vec3::ZERO, direction: Vec3::Z }, f32::INFINITY).unwrap();
/// assert_eq!((hit.shape, hit.distance_m), (ball, 1.5));
/// # Ok::<(), dioptric_world::WorldError>(())
/// ```
#[derive(Debug)]
pub struct WorldBuilder {
    shapes: Vec<NewShape>,
    n_groups: u32,
    instances: Vec<(GroupId, DAffine3)>,
    surfaces: Vec<Surface>,
    textures: Vec<Texture>,
    lights: Vec<Light>,
    cameras: Vec<WorldCamera>,
    notes: Vec<String>,
    glows: Vec<(ShapeId, TextureId)>,
    things: Vec<Vec<ShapeId>>,
}

/// A shape to be placed.
#[derive(Debug)]
struct NewShape {
    shape: Shape,
    place: DAffine3,
    group: GroupId,
    material: MaterialId,
    emission: Option<Emission>,
    is_reversed: bool,
}

impl Default for WorldBuilder {
    fn default() -> Self {
        Self::new()
    }
}

impl WorldBuilder {
    /// A world without anything in it.
    pub fn new() -> Self {
        Self {
            shapes: Vec::new(),
            n_groups: 1,
            instances: Vec::new(),
            surfaces: Vec::new(),
            textures: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            notes: Vec::new(),
            glows: Vec::new(),
            things: Vec::new(),
        }
    }

    /// Adds a texture.
    pub fn add_texture(&mut self, texture: Texture) -> TextureId {
        self.textures.push(texture);
        TextureId(self.textures.len() as u32 - 1)
    }

    /// Adds a material; names are for people and needn't differ.
    pub fn add_material(&mut self, name: &str, material: Material) -> MaterialId {
        self.add_material_with(name, material, None)
    }

    /// Adds a material with relief.
    pub fn add_material_with(&mut self, name: &str, material: Material, relief: Option<Relief>) -> MaterialId {
        self.surfaces.push(Surface::new(name.to_owned(), material, relief));
        MaterialId(self.surfaces.len() as u32 - 1)
    }

    /// Stands a shape in the world.
    pub fn add_shape(
        &mut self,
        shape: Shape,
        place: DAffine3,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> ShapeId {
        self.add_shape_to(GroupId::ROOT, shape, place, material, emission)
    }

    /// Adds a shape to a group.
    pub fn add_shape_to(
        &mut self,
        group: GroupId,
        shape: Shape,
        place: DAffine3,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> ShapeId {
        self.shapes.push(NewShape { shape, place, group, material, emission, is_reversed: false });
        ShapeId(self.shapes.len() as u32 - 1)
    }

    /// Turns a shape inside out: its normals, and the side that glows.
    pub fn reverse(&mut self, shape: ShapeId) {
        if let Some(shape) = self.shapes.get_mut(shape.0 as usize) {
            shape.is_reversed = !shape.is_reversed;
        }
    }

    /// Multiplies the glow of a shape by a texture, asked as a number by position: not by texture coordinates or normals.
    pub fn vary_emission(&mut self, shape: ShapeId, by: TextureId) {
        self.glows.push((shape, by));
    }

    /// Says that shapes are one thing, such as a vase and its inside: what one of them hides lies behind them all.
    pub fn join(&mut self, shapes: impl IntoIterator<Item = ShapeId>) {
        self.things.push(shapes.into_iter().collect());
    }

    /// Begins a group of shapes that stands nowhere until it is placed by [`add_instance`](Self::add_instance).
    pub fn add_group(&mut self) -> GroupId {
        self.n_groups += 1;
        GroupId(self.n_groups - 1)
    }

    /// Places a group in the world. Lights within it glow, but aren't looked for by [`World::sample_light`].
    pub fn add_instance(&mut self, group: GroupId, place: DAffine3) -> InstanceId {
        self.instances.push((group, place));
        InstanceId(self.instances.len() as u32 - 1)
    }

    /// Adds a light that is no shape.
    pub fn add_light(&mut self, light: Light) {
        self.lights.push(light);
    }

    /// Adds a camera.
    pub fn add_camera(&mut self, camera: WorldCamera) {
        self.cameras.push(camera);
    }

    /// Adds a sentence about what wasn't understood, once.
    pub fn note(&mut self, note: impl Into<String>) {
        let note = note.into();
        const LIMIT: usize = 500;
        if self.notes.len() < LIMIT && !self.notes.contains(&note) {
            self.notes.push(note);
            if self.notes.len() == LIMIT {
                self.notes.push("and more that isn't listed".to_owned());
            }
        }
    }

    /// Checks the parts, and builds the world.
    ///
    /// # Errors
    /// When a part names another that isn't there, a shape has no extent, or a transform can't be undone.
    pub fn build(self) -> Result<World, WorldError> {
        self.check()?;
        let patterned = Patterned::of(&self.textures, self.shapes.iter().map(|s| s.place), &self.glows, &self.things);
        let Self { shapes, n_groups, instances, surfaces, textures, lights, cameras, notes, .. } = self;
        let mut placed: Vec<PlacedShape> = shapes.into_iter().map(NewShape::placed).collect();
        let instances: Vec<Instance> = instances
            .into_iter()
            .map(|(group, place)| Instance { group: group.0, place, inverse: place.inverse() })
            .collect();
        let mut parts: Vec<GroupParts> = (0..n_groups).map(|_| GroupParts::default()).collect();
        for (index, shape) in placed.iter().enumerate() {
            shape.add_to(&mut parts[shape.group as usize], index as u32);
        }
        parts.iter().try_for_each(GroupParts::check_extent)?;
        // Groups first: the root needs their bounds.
        let mut groups: Vec<Group> = parts.drain(1..).map(Group::build).collect();
        let mut root = parts.remove(0);
        for (index, instance) in instances.iter().enumerate() {
            let of = &groups[instance.group as usize - 1];
            if of.bounds().0.cmple(of.bounds().1).all() {
                root.add_instance(instance, of, index as u32);
            }
        }
        root.check_extent()?;
        groups.insert(0, Group::build(root));
        let lights = Lights::new(lights, &mut placed);
        let geometry = Geometry { shapes: placed, instances, groups };
        Ok(World { geometry, surfaces, textures, lights, cameras, notes, patterned })
    }

    fn check(&self) -> Result<(), WorldError> {
        let named = |what, target, index: u32, n: usize| match (index as usize) < n {
            true => Ok(()),
            false => Err(WorldError::Dangling { what, target, index: index as usize, n }),
        };
        let places = self.shapes.iter().map(|s| &s.place).chain(self.instances.iter().map(|(_, place)| place));
        for place in places {
            if !(place.is_finite() && place.matrix3.determinant().abs() > 0.0) {
                return Err(WorldError::Setting {
                    what: "a transform",
                    value: format!("{place:?}"),
                    expected: "a finite one that doesn't flatten what it moves",
                });
            }
        }
        for shape in &self.shapes {
            shape.shape.check()?;
            named("a shape", "material", shape.material.0, self.surfaces.len())?;
            named("a shape", "group", shape.group.0, self.n_groups as usize)?;
        }
        for (group, _) in &self.instances {
            named("an instance", "group", group.0, self.n_groups as usize)?;
            if *group == GroupId::ROOT {
                return Err(WorldError::Setting {
                    what: "the group of an instance",
                    value: "the world itself".to_owned(),
                    expected: "a group of its own",
                });
            }
        }
        for surface in &self.surfaces {
            let relief = surface.relief.map(|relief| match relief {
                Relief::Heights(texture) | Relief::Normals(texture) | Relief::Pattern(texture) => texture,
            });
            for texture in surface.material.textures().into_iter().chain(relief) {
                named("a material", "texture", texture.0, self.textures.len())?;
            }
        }
        for (shape, texture) in &self.glows {
            named("a glow", "shape", shape.0, self.shapes.len())?;
            named("a glow", "texture", texture.0, self.textures.len())?;
        }
        for shape in self.things.iter().flatten() {
            named("a thing", "shape", shape.0, self.shapes.len())?;
        }
        Surfaces::check_blends(&self.surfaces)?;
        // Textures are made of earlier ones, so that none is made of itself, and aren't nested too deep for a stack.
        let mut depths = vec![0; self.textures.len()];
        for (index, texture) in self.textures.iter().enumerate() {
            for part in texture.parts() {
                named("a texture", "earlier texture", part.0, index)?;
                depths[index] = depths[index].max(depths[part.0 as usize] + 1);
            }
            if texture.parts().count() > MOST_SHARES {
                let (what, n) = ("textures of a pattern", texture.parts().count() as u64);
                return Err(WorldError::TooMany { what, n, limit: MOST_SHARES as u64 });
            }
            if depths[index] > MAX_DEPTH {
                let what = "textures within textures";
                return Err(WorldError::TooMany { what, n: depths[index] as u64, limit: MAX_DEPTH as u64 });
            }
        }
        Ok(())
    }
}

impl NewShape {
    fn placed(self) -> PlacedShape {
        let kind = match self.shape {
            Shape::Mesh(mut mesh) => {
                mesh.transform(&self.place);
                PlacedKind::Mesh(mesh)
            }
            shape => PlacedKind::Quadric(Box::new(Quadric::new(shape, self.place))),
        };
        PlacedShape {
            kind,
            group: self.group.0,
            material: self.material,
            emission: self.emission,
            is_reversed: self.is_reversed,
            light: None,
        }
    }
}
