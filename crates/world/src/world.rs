//! Worlds: what there is, checked once and then only looked at.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use dioptric_spectrum::{SmoothReflectance, lanes};
use glam::{DAffine3, DVec3, Vec2, Vec3};

use crate::{
    Bsdf, Choices, Emission, Film, GroupId, Hit, InstanceId, Interface, Light, LightSample, Material, MaterialId,
    Medium, MediumId, Ray, Receiver, Relief, Shape, ShapeId, SpectralCurve, Texture, TextureId, TriangleMesh,
    WorldCamera, WorldError,
    group::{Crossing, Group, GroupParts, Instance, Parts, Primitive},
    lights::Lights,
    material::{Surface, Surfaces},
    mesh::normal_matrix,
    notes::Notes,
    objects::{ObjectTable, Objects},
    pattern::MOST_SHARES,
    patterned::{Frames, Patterned},
    placed::{PlacedKind, PlacedShape},
    shape::{Quadric, placed_bounds},
    texture::{MAX_DEPTH, Textures},
    uv::TexturePoint,
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
    choices: Choices,
    notes: Vec<String>,
    /// Whether rays pass some of its surfaces.
    has_gaps: bool,
    sources: Vec<PathBuf>,
    up: DVec3,
    is_left_handed: bool,
    patterned: Patterned,
    objects: ObjectTable,
    /// What all light is multiplied by.
    gain: f32,
    media: Vec<Medium>,
    /// Of each whether a surface stands between it and all lights.
    is_closed: Vec<bool>,
    /// What is where no surface tells.
    surroundings: Option<MediumId>,
}

/// What a ray meets in a world with media: a surface, or a boundary between media without one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// Where.
    pub hit: Hit,
    /// Whether there is a surface; rays go on straight through a boundary without one.
    pub is_surface: bool,
}

pub(crate) fn front_of(up: DVec3, is_left_handed: bool) -> DVec3 {
    match (up.z.abs() > 0.5, is_left_handed) {
        (true, _) => DVec3::NEG_Y,
        (false, false) => DVec3::Z,
        (false, true) => DVec3::NEG_Z,
    }
}

/// The most surfaces that a ray passes one after another.
const MOST_PASSED: u32 = 1 << 16;

/// Returns a number in [0, 1) that differs from ray to ray.
fn number_of(ray: &Ray) -> f32 {
    let mut mixed = 0x9e37_79b9_7f4a_7c15_u64;
    for value in ray.origin.to_array().into_iter().chain(ray.direction.to_array()) {
        mixed = (mixed ^ u64::from(value.to_bits())).wrapping_mul(0xff51_afd7_ed55_8ccd);
        mixed ^= mixed >> 29;
    }
    (mixed.wrapping_mul(0xc4ce_b9fe_1a85_ec53) >> 40) as f32 / (1 << 24) as f32
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
    ///
    /// Of a surface that is partly there, such as a leaf with an outline in its picture, a ray meets as many points as its
    /// share says; which ones depends on the ray alone.
    pub fn intersect(&self, ray: &Ray, t_max_m: f32) -> Option<Hit> {
        let hit = self.first_crossing(ray, t_max_m)?;
        if self.is_there(&hit, ray) { Some(hit) } else { self.intersect_behind(hit, ray, t_max_m) }
    }

    fn first_crossing(&self, ray: &Ray, t_max_m: f32) -> Option<Hit> {
        let root = &self.geometry.groups[0];
        let crossing = root.nearest(&self.geometry, ray.origin, ray.direction, t_max_m)?;
        Some(self.geometry.hit(ray, &crossing))
    }

    /// Goes on behind a surface that the ray passes.
    #[cold]
    fn intersect_behind(&self, passed: Hit, ray: &Ray, t_max_m: f32) -> Option<Hit> {
        let (mut hit, mut gone_m) = (passed, 0.0);
        for _ in 0..MOST_PASSED {
            gone_m += hit.distance_m;
            let next = hit.ray_towards(ray.direction);
            hit = self.first_crossing(&next, t_max_m - gone_m)?;
            if self.is_there(&hit, &next) {
                hit.distance_m += gone_m;
                return Some(hit);
            }
        }
        None
    }

    /// Whether a ray meets the point of the surface that it crosses.
    fn is_there(&self, hit: &Hit, ray: &Ray) -> bool {
        let surface = &self.surfaces[hit.material.0 as usize];
        if !surface.has_gaps {
            return true;
        }
        if surface.material == Material::Open && surface.coverage.is_none() {
            return self.geometry.shapes[hit.shape.0 as usize].emission.is_some();
        }
        if matches!(surface.material, Material::Hair { .. }) && hit.geometric_normal.dot(ray.direction) > 0.0 {
            // What goes through a hair has left it where it came in.
            return false;
        }
        let share = self.asked().coverage(hit.material, &self.point_of(hit));
        share >= 1.0 || share > 0.0 && number_of(ray) < share
    }

    fn point_of(&self, hit: &Hit) -> TexturePoint<'_> {
        TexturePoint::of(hit, self.patterned.place(hit.shape, hit.instance, &self.geometry))
    }

    fn asked(&self) -> Surfaces<'_> {
        Surfaces { surfaces: &self.surfaces, textures: Textures(&self.textures) }
    }

    /// Tells whether a ray meets anything before it has gone `length_m`, which it isn't held to to the last digit.
    ///
    /// The last 1e-4 of the length is left out, so that a ray to a light doesn't meet the light itself.
    pub fn is_occluded(&self, ray: &Ray, length_m: f32) -> bool {
        let root = &self.geometry.groups[0];
        let length_m = length_m * (1.0 - 1e-4);
        let is_crossed = root.is_crossed(&self.geometry, ray.origin, ray.direction, length_m);
        is_crossed && (!self.has_gaps || self.intersect(ray, length_m).is_some())
    }

    /// Returns how the surface at a hit scatters light that leaves it towards `outgoing`, at these wavelengths, nm.
    ///
    /// `outgoing` has length 1 and points away from the surface, against the ray that met it.
    pub fn bsdf<const N: usize>(&self, hit: &Hit, outgoing: Vec3, wavelengths_nm: &[f32; N]) -> Bsdf<N> {
        self.asked().bsdf(hit, &self.point_of(hit), outgoing, wavelengths_nm)
    }

    /// Whether the surface at a hit may have [mirrors](Bsdf::mirrors): quicker than its scattering function.
    pub fn may_mirror(&self, hit: &Hit) -> bool {
        self.asked().may_mirror(hit.material)
    }

    /// Whether there is anything else in space than surfaces.
    pub fn has_media(&self) -> bool {
        !self.media.is_empty()
    }

    /// Returns a medium.
    pub fn medium(&self, id: MediumId) -> &Medium {
        &self.media[id.0 as usize]
    }

    /// Whether surfaces stand between a medium and all lights that are no shapes, all around: no light that is looked for from
    /// within is found.
    pub fn is_closed(&self, id: MediumId) -> bool {
        self.is_closed[id.0 as usize]
    }

    /// Returns what a ray first meets nearer than `t_max_m`: a surface as of [`intersect`](Self::intersect), or a boundary
    /// between media.
    pub fn meet(&self, ray: &Ray, t_max_m: f32) -> Option<Met> {
        let (mut from, mut gone_m) = (*ray, 0.0);
        for _ in 0..MOST_PASSED {
            let mut hit = self.first_crossing(&from, t_max_m - gone_m)?;
            let is_surface = self.is_there(&hit, &from);
            let next = hit.ray_towards(ray.direction);
            hit.distance_m += gone_m;
            if is_surface || self.is_boundary(&hit) {
                return Some(Met { hit, is_surface });
            }
            (from, gone_m) = (next, hit.distance_m);
        }
        None
    }

    fn find_closed_media(&mut self) {
        let lamps = self.lights.positions();
        let of_lamps = lamps.filter_map(|origin| self.medium_along(&Ray { origin, direction: Vec3::Z }));
        let open_sides = self.geometry.shapes.iter().filter(|shape| self.surfaces[shape.material.0 as usize].has_gaps);
        let of_sides = open_sides.filter_map(|shape| shape.interface).flat_map(|i| [i.inside, i.outside]).flatten();
        let open: Vec<MediumId> = of_lamps.chain(of_sides).chain(self.surroundings).collect();
        open.into_iter().for_each(|id| self.is_closed[id.0 as usize] = false);
    }

    fn interface(&self, hit: &Hit) -> Option<&Interface> {
        self.geometry.shapes[hit.shape.0 as usize].interface.as_ref()
    }

    /// Whether a hit without a surface parts two media; holes of surfaces do not.
    fn is_boundary(&self, hit: &Hit) -> bool {
        let surface = &self.surfaces[hit.material.0 as usize];
        surface.material == Material::Open && surface.coverage.is_none() && self.interface(hit).is_some()
    }

    /// Returns the medium that light which leaves a hit in a direction goes through, where it came through `before`.
    pub fn medium_towards(&self, hit: &Hit, direction: Vec3, before: Option<MediumId>) -> Option<MediumId> {
        self.interface(hit).map_or(before, |interface| interface.towards(direction, hit.geometric_normal))
    }

    /// Returns the medium that a ray begins in: by the first surface between media that it meets, whatever lies before that, or
    /// what is around everything.
    pub fn medium_along(&self, ray: &Ray) -> Option<MediumId> {
        if self.media.is_empty() {
            return None;
        }
        let mut from = *ray;
        for _ in 0..MOST_PASSED {
            let Some(hit) = self.first_crossing(&from, f32::INFINITY) else { break };
            if let Some(interface) = self.interface(&hit) {
                return interface.towards(-ray.direction, hit.geometric_normal);
            }
            from = hit.ray_towards(ray.direction);
        }
        self.surroundings
    }

    /// Returns the radiance, W m⁻² sr⁻¹ nm⁻¹, that the surface at a hit gives of itself towards `outgoing`.
    pub fn emission<const N: usize>(&self, hit: &Hit, outgoing: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        match &self.geometry.shapes[hit.shape.0 as usize].emission {
            Some(emission) if emission.is_two_sided || hit.geometric_normal.dot(outgoing) > 0.0 => {
                let radiance = emission.radiance.at(wavelengths_nm).map(|v| self.gain * v);
                match self.surfaces[hit.material.0 as usize].glow {
                    None => radiance,
                    Some(glow) => {
                        let share = Textures(&self.textures).spectral(glow, &self.point_of(hit), wavelengths_nm);
                        lanes(|lane| radiance[lane] * share[lane])
                    }
                }
            }
            _ => [0.0; N],
        }
    }

    /// Whether two shapes are one thing: the same shape, or some that were [joined](WorldBuilder::join).
    pub fn are_one_thing(&self, a: ShapeId, b: ShapeId) -> bool {
        a == b || self.patterned.are_joined(a, b)
    }

    /// Returns the radiance, W m⁻² sr⁻¹ nm⁻¹, that comes from a direction in which nothing is met.
    pub fn sky<const N: usize>(&self, direction: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        self.lights.sky(direction, wavelengths_nm).map(|v| self.gain * v)
    }

    /// Returns the same as light that was scattered at a point finds it: of each sky its share, by the density with which
    /// [`sample_light`](Self::sample_light) draws that direction of it.
    pub fn shared_sky<const N: usize>(
        &self,
        at: impl Into<Receiver>,
        direction: Vec3,
        wavelengths_nm: &[f32; N],
        share: impl Fn(f32) -> f32,
    ) -> [f32; N] {
        self.lights.shared_sky(&at.into(), direction, wavelengths_nm, share).map(|v| self.gain * v)
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
        let (mut light, place) = self.lights.sample(&self.geometry.shapes, &at, u_light, u, wavelengths_nm)?;
        light.radiance = light.radiance.map(|v| self.gain * v);
        if let Some((shape, triangle)) = place
            && let Some(glow) = self.surfaces[self.geometry.shapes[shape as usize].material.0 as usize].glow
        {
            let point = at.point + light.distance_m * light.direction;
            let hit = Hit { shape: ShapeId(shape), ..self.geometry.shapes[shape as usize].hit_at(point, triangle) };
            let share = Textures(&self.textures).spectral(glow, &self.point_of(&hit), wavelengths_nm);
            light.radiance = lanes(|lane| light.radiance[lane] * share[lane]);
        }
        Some(light)
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

    /// The names of the objects, in the order of the numbers that [`object_of`](Self::object_of) gives.
    pub fn object_names(&self) -> &[String] {
        self.objects.names()
    }

    /// Returns the number of the object that a hit lies on.
    pub fn object_of(&self, hit: &Hit) -> usize {
        self.objects.of(hit.shape, hit.instance)
    }

    /// The cameras that came with the world.
    pub fn cameras(&self) -> &[WorldCamera] {
        &self.cameras
    }

    /// What its file can show in place of what it shows.
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// What of a file wasn't understood, and what stands in its place; a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Returns in a sentence that bands reach beyond the wavelengths between which colors tell what reflects them, where the world has reflectances
    /// that are lifted from colors.
    pub fn note_on_bands(&self, first_nm: f64, last_nm: f64) -> Option<String> {
        let [low_nm, high_nm] = SmoothReflectance::FITTED_NM;
        let is_beyond = first_nm < low_nm || last_nm > high_nm;
        (is_beyond && self.textures.iter().any(Texture::has_colors)).then(|| {
            format!(
                "what its colors reflect beyond {low_nm} to {high_nm} nm is not known: their spectra go on as they were fitted"
            )
        })
    }

    /// Makes all of its light so many times as strong, and says why in a note.
    pub fn brighten(&mut self, factor: f32, note: String) {
        self.gain *= factor;
        self.notes.push(note);
    }

    /// How many times as strong its light is as that which was put into it.
    pub fn gain(&self) -> f32 {
        self.gain
    }

    /// Every file that the world was read from, pictures included, in the order in which they were read.
    pub fn sources(&self) -> &[PathBuf] {
        &self.sources
    }

    /// Which way is up: the axis nearest to what its first camera has as up, or its file's convention.
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// What faces the viewer: +z of a right-handed world, −z of a left-handed one, and −y where z is up.
    pub fn front(&self) -> DVec3 {
        front_of(self.up, self.is_left_handed)
    }

    /// Whether its frame is left-handed: as seen with x to the right and y up, z goes away from the viewer.
    pub fn is_left_handed(&self) -> bool {
        self.is_left_handed
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

impl PlacedShape {
    /// Returns the hit of a point of the shape, which stands in the root group; of a mesh, of this triangle.
    fn hit_at(&self, point: Vec3, triangle: Option<u32>) -> Hit {
        match (&self.kind, triangle) {
            (PlacedKind::Quadric(quadric), _) => quadric.hit(point.as_dvec3()),
            (PlacedKind::Mesh(mesh), triangle) => {
                let index = triangle.unwrap_or(0);
                let corners = mesh.corners(index as usize);
                let [b1, b2] = weights_in(corners, point);
                mesh.hit(index, corners, b1, b2)
            }
        }
    }
}

/// Returns the weights of the second and third corner of a triangle at a point of it.
fn weights_in([a, b, c]: [Vec3; 3], point: Vec3) -> [f32; 2] {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d00, d01, d11) = (ab.length_squared(), ab.dot(ac), ac.length_squared());
    let (d20, d21) = (ap.dot(ab), ap.dot(ac));
    let determinant = d00 * d11 - d01 * d01;
    if determinant > 0.0 {
        [(d11 * d20 - d01 * d21) / determinant, (d00 * d21 - d01 * d20) / determinant].map(|w| w.clamp(0.0, 1.0))
    } else {
        [0.0; 2]
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
            second_uv: match self.second_uvs.is_empty() {
                true => Vec2::ZERO,
                false => {
                    let [a, b, c] = vertices().map(|v| self.second_uvs[v]);
                    b0 * a + b1 * b + b2 * c
                }
            },
            color: match self.colors.is_empty() {
                true => [1.0; 4],
                false => {
                    let [a, b, c] = vertices().map(|v| self.colors[v]);
                    std::array::from_fn(|k| b0 * a[k] + b1 * b[k] + b2 * c[k])
                }
            },
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
            second_uv: Vec2::ZERO,
            color: [1.0; 4],
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
#[derive(Clone, Debug)]
pub struct WorldBuilder {
    pub(crate) shapes: Vec<NewShape>,
    pub(crate) n_groups: u32,
    pub(crate) instances: Vec<NewInstance>,
    pub(crate) surfaces: Vec<Surface>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Vec<NewLight>,
    pub(crate) cameras: Vec<WorldCamera>,
    choices: Choices,
    pub(crate) notes: Notes,
    pub(crate) sources: Vec<PathBuf>,
    up: DVec3,
    is_left_handed: bool,
    /// Whether which way is up is said, and no camera tells it.
    is_up_known: bool,
    pub(crate) things: Vec<Vec<ShapeId>>,
    pub(crate) objects: Objects,
    pub(crate) media: Vec<Medium>,
    /// A place, and the medium that a file says is there.
    pub(crate) eye: Option<(DVec3, MediumId)>,
}

/// A shape to be placed.
#[derive(Clone, Debug)]
pub(crate) struct NewShape {
    pub(crate) shape: Arc<Shape>,
    pub(crate) place: DAffine3,
    pub(crate) group: GroupId,
    pub(crate) material: MaterialId,
    pub(crate) emission: Option<Emission>,
    pub(crate) is_reversed: bool,
    /// The object that it is part of, by number; of no account within a group.
    pub(crate) object: u32,
    /// The media on both sides of it, where they are told.
    pub(crate) interface: Option<Interface>,
}

/// A group to be placed.
#[derive(Clone, Debug)]
pub(crate) struct NewInstance {
    pub(crate) group: GroupId,
    pub(crate) place: DAffine3,
    pub(crate) object: u32,
}

/// A light that is no shape.
#[derive(Clone, Debug)]
pub(crate) struct NewLight {
    pub(crate) light: Light,
    pub(crate) object: u32,
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
            choices: Choices::default(),
            notes: Notes::default(),
            sources: Vec::new(),
            up: DVec3::Y,
            is_left_handed: false,
            is_up_known: false,
            things: Vec::new(),
            objects: Objects::default(),
            media: Vec::new(),
            eye: None,
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

    /// Says how much of the surfaces of a material is there, 0–1: rays pass the rest.
    pub fn set_coverage(&mut self, material: MaterialId, coverage: TextureId) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.coverage = Some(coverage);
        }
    }

    /// Adds a material that is another of which only this much is there, 0–1, times what of the other is.
    pub(crate) fn add_covered(&mut self, of: MaterialId, coverage: TextureId) -> MaterialId {
        let Some(surface) = self.surfaces.get(of.0 as usize).cloned() else { return of };
        let coverage = match surface.coverage {
            Some(own) => self.add_texture(Texture::Product([own, coverage])),
            None => coverage,
        };
        self.surfaces.push(Surface { coverage: Some(coverage), ..surface });
        MaterialId(self.surfaces.len() as u32 - 1)
    }

    /// Says what the radiance of shapes of a material that glow is multiplied by.
    pub fn set_glow(&mut self, material: MaterialId, glow: TextureId) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.glow = Some(glow);
        }
    }

    /// Says how far what is brushed is turned from u, counterclockwise, rad.
    pub fn set_turn(&mut self, material: MaterialId, turn_rad: f32) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.turn_rad = turn_rad;
        }
    }

    /// Says by a picture of directions how far it is turned besides: red and green 0–1 stand for −1 to 1 along u and v.
    pub fn set_directions(&mut self, material: MaterialId, directions: TextureId) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.directions = Some(directions);
        }
    }

    /// Says what share of the base of glTF's material lets diffuse light through, and its color.
    pub fn set_behind(&mut self, material: MaterialId, share: TextureId, color: TextureId) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.behind = Some([share, color]);
        }
    }

    /// Lays a film over the base of glTF's material.
    pub fn set_film(&mut self, material: MaterialId, film: Film) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.film = Some(film);
        }
    }

    /// Adds a medium.
    pub fn add_medium(&mut self, medium: Medium) -> MediumId {
        self.media.push(medium);
        MediumId(self.media.len() as u32 - 1)
    }

    /// Whether a material is hair, which is met from outside alone.
    pub(crate) fn is_hair(&self, material: MaterialId) -> bool {
        let surface = self.surfaces.get(material.0 as usize);
        surface.is_some_and(|surface| matches!(surface.material, Material::Hair { .. }))
    }

    /// Says what fills shapes of a material, whatever their own [`Interface`] says of their inside. Shapes must be closed, and their
    /// material let light in.
    pub fn set_filling(&mut self, material: MaterialId, medium: MediumId) {
        if let Some(surface) = self.surfaces.get_mut(material.0 as usize) {
            surface.filling = Some(medium);
        }
    }

    /// Says the same of a medium that takes so much from light, 1/m, and scatters none.
    pub fn set_absorption(&mut self, material: MaterialId, per_m: SpectralCurve) {
        let medium = self.add_medium(Medium::even(per_m, SpectralCurve::constant(0.0), 0.0));
        self.set_filling(material, medium);
    }

    /// Says which media are on both sides of a shape.
    pub fn set_interface(&mut self, shape: ShapeId, interface: Interface) {
        if let Some(shape) = self.shapes.get_mut(shape.0 as usize) {
            shape.interface = Some(interface);
        }
    }

    /// Says which medium is around a place, such as a camera's: where no shape holds it, it is that around everything.
    pub fn set_medium_at(&mut self, place: DVec3, medium: MediumId) {
        self.eye = Some((place, medium));
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
        let object = if group == GroupId::ROOT { self.objects.of_next(shape.word()) } else { 0 };
        let shape = Arc::new(shape);
        self.shapes.push(NewShape {
            shape,
            place,
            group,
            material,
            emission,
            is_reversed: false,
            object,
            interface: None,
        });
        ShapeId(self.shapes.len() as u32 - 1)
    }

    /// Turns a shape inside out: its normals, and the side that glows.
    pub fn reverse(&mut self, shape: ShapeId) {
        if let Some(shape) = self.shapes.get_mut(shape.0 as usize) {
            shape.is_reversed = !shape.is_reversed;
        }
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
        let object = self.objects.of_next("instance");
        self.instances.push(NewInstance { group, place, object });
        InstanceId(self.instances.len() as u32 - 1)
    }

    /// Adds a light that is no shape.
    pub fn add_light(&mut self, light: Light) {
        let object = self.objects.of_next(light.word());
        self.lights.push(NewLight { light, object });
    }

    /// Calls the next shape, instance or light so, unless an object is [open](Self::begin_object); a name that is taken gets a number.
    pub fn name_next(&mut self, name: &str) {
        self.objects.name_next(name);
    }

    /// Begins an object, within the one that is open: what is added until it [ends](Self::end_object) is part of it. Returns its name, which
    /// has a number where it was taken.
    pub fn begin_object(&mut self, name: &str) -> String {
        let object = self.objects.begin(name);
        self.objects.name(object).to_owned()
    }

    /// Ends the object that was begun last.
    pub fn end_object(&mut self) {
        self.objects.end();
    }

    /// Adds a camera.
    pub fn add_camera(&mut self, camera: WorldCamera) {
        self.cameras.push(camera);
    }

    /// Says what its file can show in place of what it shows.
    pub fn set_choices(&mut self, choices: Choices) {
        self.choices = choices;
    }

    /// What its file can show in place of what it shows.
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// Adds a sentence about what wasn't understood; said again, it is counted.
    pub fn note(&mut self, note: impl Into<String>) {
        self.notes.add(note.into());
    }

    /// Adds a thing to those that a sentence is said of, as in "pictures that aren't there: a.png, b.png and 3 more".
    pub fn note_of(&mut self, sentence: &str, thing: &str) {
        self.notes.add_of(sentence, thing);
    }

    /// Says which way is up in the world, and whether its frame is left-handed: as seen with x to the right and y up, z
    /// goes away from the viewer.
    pub fn set_up(&mut self, up: DVec3, is_left_handed: bool) {
        (self.up, self.is_left_handed) = (up, is_left_handed);
    }

    /// Holds on to what is up and whether the frame is left-handed, whichever cameras are added or leave.
    pub(crate) fn hold_up(&mut self) {
        (self.up, self.is_left_handed) = self.convention();
        self.is_up_known = true;
    }

    /// Adds a file that the world is made of, or that it names and that isn't there.
    pub fn add_source(&mut self, file: &Path) {
        if !self.sources.iter().any(|known| known == file) {
            self.sources.push(file.to_owned());
        }
    }

    /// Returns which way is up and whether the frame is left-handed: as its first camera stands in it, or by its file's convention.
    pub(crate) fn convention(&self) -> (DVec3, bool) {
        let camera = self.cameras.first().filter(|_| !self.is_up_known);
        let Some(camera) = camera else { return (self.up, self.is_left_handed) };
        let m = camera.world_from_camera.matrix3;
        let y = m.y_axis.normalize_or(self.up);
        // The axis that is nearest.
        let largest = y.abs().max_element();
        let nearest = DVec3::from_array(y.to_array().map(|v| if v.abs() == largest { v.signum() } else { 0.0 }));
        // A camera that looks far down or up doesn't tell.
        let up = if largest > 0.8 { nearest.normalize_or(self.up) } else { self.up };
        (up, m.determinant() > 0.0)
    }

    /// Returns which way is up in the world, and what faces the viewer, as [`World::up`] and [`World::front`].
    pub fn up_and_front(&self) -> (DVec3, DVec3) {
        let (up, is_left_handed) = self.convention();
        (up, front_of(up, is_left_handed))
    }

    /// Returns the greatest extent along an axis of the shapes that belong to no group, m; 0 where there are none.
    pub fn extent_m(&self) -> f64 {
        let (low, high) = bounds_of(self.shapes.iter().filter(|shape| shape.group == GroupId::ROOT));
        if low.cmple(high).all() { (high - low).max_element() } else { 0.0 }
    }

    /// Whether nothing in it could be seen: no shape, or meshes without triangles alone.
    pub fn is_empty(&self) -> bool {
        self.shapes.iter().all(|shape| matches!(&*shape.shape, Shape::Mesh(mesh) if mesh.triangles.is_empty()))
    }

    /// Whether anything gives light.
    pub fn has_light(&self) -> bool {
        !self.lights.is_empty()
            || self.shapes.iter().any(|shape| shape.emission.is_some())
            || self.media.iter().any(|medium| medium.glow.is_some())
    }

    /// Checks the parts, and builds the world.
    ///
    /// # Errors
    /// When a part names another that isn't there, a shape has no extent, or a transform can't be undone.
    pub fn build(mut self) -> Result<World, WorldError> {
        self.check()?;
        let (up, is_left_handed) = self.convention();
        let has_patterns = self.textures.iter().any(|texture| matches!(texture, Texture::Pattern { .. }));
        let patterned = Patterned::of(has_patterns, self.shapes.iter().map(|s| s.place), &self.things);
        let Self { shapes, n_groups, instances, surfaces, textures, lights, cameras, choices, objects, .. } = self;
        let of_shapes = shapes.iter().map(|shape| if shape.group == GroupId::ROOT { Some(shape.object) } else { None });
        let objects = ObjectTable::new(objects, of_shapes, instances.iter().map(|instance| instance.object));
        let (notes, sources) = (self.notes.sentences(), self.sources);
        let mut placed: Vec<PlacedShape> = shapes.into_iter().map(NewShape::placed).collect();
        for shape in &mut placed {
            let Interface { inside, outside } = shape.interface.unwrap_or(Interface { inside: None, outside: None });
            let inside = surfaces[shape.material.0 as usize].filling.or(inside);
            shape.interface = (inside != outside).then_some(Interface { inside, outside });
        }
        let instances: Vec<Instance> = instances
            .into_iter()
            .map(|NewInstance { group, place, .. }| Instance { group: group.0, place, inverse: place.inverse() })
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
        let lights = Lights::new(lights.into_iter().map(|new| new.light).collect(), &mut placed);
        let geometry = Geometry { shapes: placed, instances, groups };
        let has_gaps = geometry.shapes.iter().any(|shape| surfaces[shape.material.0 as usize].has_gaps);
        let mut world = World {
            geometry,
            surfaces,
            textures,
            lights,
            cameras,
            choices,
            notes,
            has_gaps,
            sources,
            up,
            is_left_handed,
            patterned,
            objects,
            gain: 1.0,
            is_closed: vec![true; self.media.len()],
            media: self.media,
            surroundings: None,
        };
        if let Some((place, medium)) = self.eye {
            // What a closed shape holds ends there.
            let ray = |direction: Vec3| Ray { origin: place.as_vec3(), direction };
            let is_held = |direction: Vec3| world.medium_along(&ray(direction)) == Some(medium);
            let is_bounded = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().all(|axis| is_held(axis) && is_held(-axis));
            world.surroundings = (!is_bounded).then_some(medium);
        }
        world.find_closed_media();
        Ok(world)
    }

    fn check(&mut self) -> Result<(), WorldError> {
        Surfaces::check_parts(&mut self.surfaces)?;
        let named = |what, target, index: u32, n: usize| match (index as usize) < n {
            true => Ok(()),
            false => Err(WorldError::Dangling { what, target, index: index as usize, n }),
        };
        let places = self.shapes.iter().map(|s| &s.place).chain(self.instances.iter().map(|instance| &instance.place));
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
        for NewInstance { group, .. } in &self.instances {
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
            let more = surface.relief.map(Relief::texture).into_iter().chain(surface.coverage).chain(surface.glow);
            let more = more
                .chain(surface.directions)
                .chain(surface.behind.into_iter().flatten())
                .chain(surface.film.map(|film| film.thickness_nm));
            for texture in surface.material.textures().into_iter().chain(more) {
                named("a material", "texture", texture.0, self.textures.len())?;
            }
        }
        for shape in self.things.iter().flatten() {
            named("a thing", "shape", shape.0, self.shapes.len())?;
        }
        self.media.iter().try_for_each(Medium::check)?;
        let sides = self.shapes.iter().filter_map(|shape| shape.interface).flat_map(Interface::sides);
        let fillings = self.surfaces.iter().filter_map(|surface| surface.filling);
        for medium in sides.chain(fillings).chain(self.eye.map(|(_, medium)| medium)) {
            named("a shape", "medium", medium.0, self.media.len())?;
        }
        // Textures are made of earlier ones, so that none is made of itself, and aren't nested too deep for a stack.
        let mut depths = vec![0; self.textures.len()];
        for (index, texture) in self.textures.iter().enumerate() {
            for part in texture.parts() {
                named("a texture", "earlier texture", part.0, index)?;
                depths[index] = depths[index].max(depths[part.0 as usize] + 1);
            }
            if texture.parts().len() > MOST_SHARES {
                let (what, n) = ("textures of a pattern", texture.parts().len() as u64);
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

/// Returns the corners of an upright box around shapes where they stand in their group; reversed for none.
pub(crate) fn bounds_of<'a>(shapes: impl Iterator<Item = &'a NewShape>) -> (DVec3, DVec3) {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for shape in shapes {
        let (a, b) = match &*shape.shape {
            Shape::Mesh(mesh) => mesh
                .positions
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p.as_dvec3()), b.max(p.as_dvec3()))),
            other => Quadric::new(other.clone(), DAffine3::IDENTITY).bounds(),
        };
        if a.cmple(b).all() {
            let (a, b) = placed_bounds(&shape.place, a, b);
            (low, high) = (low.min(a), high.max(b));
        }
    }
    (low, high)
}

impl NewShape {
    fn placed(self) -> PlacedShape {
        let kind = match Arc::unwrap_or_clone(self.shape) {
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
            interface: self.interface,
        }
    }
}
