//! Shapes of pbrt files.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::{Attributes, Coverage, Fault, Reader, curves, params::Params, surfaces};
use crate::{GroupId, Material, MaterialId, Shape, SpectralCurve, Texture, TriangleMesh};

impl Reader<'_> {
    pub(super) fn shape(&mut self, kind: &str, params: &Params<'_>) -> Result<(), Fault> {
        if kind == "curve" {
            return self.curve_shape(params);
        }
        self.end_curves();
        let mut place = self.place_m()?;
        let number = |name: &str, default: f64| params.number(name).unwrap_or(default);
        let part = surfaces::quadric(kind, params)?;
        let is_part = part.is_some();
        let shape = match (kind, part) {
            (_, Some(part)) => Shape::Mesh(part),
            ("trianglemesh", None) => Shape::Mesh(triangles(params)?),
            ("loopsubdiv", None) => {
                let levels =
                    ["levels", "nlevels"].iter().find_map(|name| params.within(name, [0.0, 10.0])).unwrap_or(3.0);
                let control = triangles(params)?;
                control.check().map_err(|e| e.to_string())?;
                Shape::Mesh(surfaces::smoothed(&control, levels as u32))
            }
            ("bilinearmesh", None) => {
                let mesh = patches(params)?;
                if !are_parallelograms(&mesh) {
                    self.builder.note("Shape \"bilinearmesh\": two triangles a patch");
                }
                Shape::Mesh(mesh)
            }
            ("plymesh", None) => {
                let file = params.text("filename").ok_or("a plymesh without filename".to_owned())?;
                match self.find_file(file) {
                    Some(path) => {
                        let crate::formats::ply::Contents { mesh, left, .. } = crate::formats::ply::read(&path)?;
                        left.iter().for_each(|word| self.builder.note_of("of meshes isn't read", word));
                        Shape::Mesh(mesh)
                    }
                    None => {
                        self.builder.note_of("Shape \"plymesh\": no such file, left out", file);
                        return Ok(());
                    }
                }
            }
            ("sphere", None) => Shape::Sphere { radius_m: number("radius", 1.0) },
            ("disk", None) => {
                place *= DAffine3::from_translation(DVec3::Z * number("height", 0.0));
                Shape::Disc { radius_m: number("radius", 1.0), inner_radius_m: number("innerradius", 0.0) }
            }
            ("cylinder", None) => Shape::Cylinder {
                radius_m: number("radius", 1.0),
                z_min_m: number("zmin", -1.0),
                z_max_m: number("zmax", 1.0),
            },
            (_, None) => {
                self.builder.note_of("shapes that aren't supported, left out", kind);
                return Ok(());
            }
        };
        shape.check().map_err(|e| e.to_string())?;
        let glow = self.attributes.glow.clone();
        let emission = glow.map(|glow| {
            let triangles_a_face = match (&shape, kind) {
                (Shape::Mesh(mesh), _) if is_part => mesh.triangles.len().max(1),
                (_, "bilinearmesh") => 2,
                _ => 1,
            };
            let faces = FaceAreas::of(&shape, &place, triangles_a_face);
            if glow.has_power() && !faces.are_alike {
                let n = faces.n;
                self.builder
                    .note(format!("Shape \"{kind}\": {n} faces of unequal areas glow alike, with their power in all"));
            }
            glow.of_faces(&faces.per_square_unit(self.metres_per_unit))
        });
        let material = self.material_of_shape(params, emission.is_some())?;
        let group = self.object.unwrap_or(GroupId::ROOT);
        let stem =
            |file: &'_ str| std::path::Path::new(file).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let of_file = params.text("filename").filter(|_| kind == "plymesh").and_then(stem);
        let Attributes { name, material_name, .. } = &self.attributes;
        if let Some(name) = name.as_deref().or(of_file.as_deref()).or(material_name.as_deref()) {
            self.builder.name_next(name);
        }
        let id = self.builder.add_shape_to(group, shape, place, material, emission);
        if self.attributes.is_reversed {
            self.builder.reverse(id);
        }
        let [inside, outside] = [self.attributes.inside.clone(), self.attributes.outside.clone()];
        self.set_interface(id, [&inside, &outside]);
        Ok(())
    }
}

impl Reader<'_> {
    fn curve_shape(&mut self, params: &Params<'_>) -> Result<(), Fault> {
        self.checked_place()?;
        if self.attributes.glow.is_some() {
            self.builder.note("Shape \"curve\": the glow of curves is left out");
        }
        self.builder.note("Shape \"curve\": tubes of triangles, round where pbrt's turn to who looks");
        let material = self.material_of_shape(params, false)?;
        if self.curves.as_ref().is_some_and(|(_, known, _)| *known != material) {
            self.end_curves();
        }
        let attributes = &self.attributes;
        let (_, _, mesh) = self.curves.get_or_insert_with(|| (attributes.clone(), material, TriangleMesh::default()));
        if let Err(reason) = curves::add(mesh, params, self.builder.is_hair(material)) {
            self.builder.note_of("curves that are none, left out", &reason);
        }
        Ok(())
    }

    /// Returns the current material, of which so much is there as the shape's alpha says.
    fn material_of_shape(&mut self, params: &Params<'_>, glows: bool) -> Result<MaterialId, Fault> {
        let material = self.attributes.material;
        if params.find("shadowalpha").is_some() {
            self.builder.note("'shadowalpha' of shapes: shadows are those of 'alpha'");
        }
        let Some(param) = params.find("alpha") else { return Ok(material) };
        let coverage = match (param.kind, params.within("alpha", [0.0, 1.0])) {
            ("texture", _) => match self.part_if_any(params, &["alpha"], true)? {
                Some(texture) => Coverage::Texture(texture),
                None => return Ok(material),
            },
            (_, None | Some(1.0)) => return Ok(material),
            // A lamp that isn't seen.
            (_, Some(0.0)) if glows => {
                return Ok(self.builder.add_material("open", Material::Open));
            }
            (_, Some(number)) => Coverage::Number((number as f32).to_bits()),
        };
        if let Some(known) = self.covered.get(&(material, coverage)) {
            return Ok(*known);
        }
        let texture = match coverage {
            Coverage::Texture(texture) => texture,
            Coverage::Number(bits) => {
                self.builder.add_texture(Texture::Curve(SpectralCurve::constant(f32::from_bits(bits))))
            }
        };
        let partly = self.builder.add_covered(material, texture);
        self.covered.insert((material, coverage), partly);
        Ok(partly)
    }
}

/// The areas of the faces of a shape, each of which is a light by itself.
pub(super) struct FaceAreas {
    pub(super) n: usize,
    /// Of all together, m² or square units of the file.
    pub(super) sum: f64,
    are_alike: bool,
}

impl FaceAreas {
    /// Returns those of a shape at its place, m²; a mesh has so many triangles a face.
    fn of(shape: &Shape, place: &DAffine3, triangles_a_face: usize) -> Self {
        let m = place.matrix3;
        // Of shapes that a place stretches alike in all directions.
        let stretch = m.determinant().abs().powf(2.0 / 3.0);
        let one = |area: f64| Self { n: 1, sum: area, are_alike: true };
        match shape {
            Shape::Sphere { radius_m } => one(4.0 * PI * radius_m * radius_m * stretch),
            Shape::Lathe(lathe) => one(lathe.area() * stretch),
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => one(2.0 * PI * radius_m * (z_max_m - z_min_m) * stretch),
            Shape::Disc { radius_m, inner_radius_m } => {
                let ratio = m.x_axis.cross(m.y_axis).length();
                one(PI * (radius_m * radius_m - inner_radius_m * inner_radius_m) * ratio)
            }
            Shape::Mesh(mesh) => {
                let area = |triangle: &[u32; 3]| {
                    let [a, b, c] = triangle.map(|i| place.transform_point3(mesh.positions[i as usize].as_dvec3()));
                    0.5 * (b - a).cross(c - a).length()
                };
                let faces = mesh.triangles.chunks(triangles_a_face);
                let areas: Vec<f64> = faces.map(|face| face.iter().map(area).sum()).collect();
                let (least, most) =
                    areas.iter().fold((f64::INFINITY, 0.0), |(a, b), &v| (f64::min(a, v), f64::max(b, v)));
                Self { n: areas.len(), sum: areas.iter().sum(), are_alike: most - least <= 1e-3 * most }
            }
        }
    }

    /// Returns them in square units of a file.
    fn per_square_unit(self, metres_per_unit: f64) -> Self {
        Self { sum: self.sum / (metres_per_unit * metres_per_unit), ..self }
    }
}

/// The vertices of a mesh and the indices of its faces of `N` corners.
fn mesh<const N: usize>(params: &Params<'_>) -> Result<(TriangleMesh, Vec<[u32; N]>), Fault> {
    let threes = |name: &str| -> Result<Vec<Vec3>, Fault> {
        let numbers = params.numbers(name).unwrap_or(&[]);
        if !numbers.len().is_multiple_of(3) {
            return Err(format!("{} numbers in '{name}': expected three a vertex", numbers.len()).into());
        }
        Ok(numbers.chunks_exact(3).map(|n| DVec3::from_slice(n).as_vec3()).collect())
    };
    let positions = threes("P")?;
    let normals = threes("N")?;
    let uvs = params.numbers("uv").or_else(|| params.numbers("st")).unwrap_or(&[]);
    if !uvs.len().is_multiple_of(2) {
        return Err(format!("{} numbers in 'uv': expected two a vertex", uvs.len()).into());
    }
    let uvs: Vec<Vec2> = uvs.chunks_exact(2).map(|n| Vec2::new(n[0] as f32, n[1] as f32)).collect();
    let whole: Vec<f64> = (0..N).map(|i| i as f64).collect();
    let indices = match params.numbers("indices") {
        Some(indices) => indices,
        None if positions.len() == N => &whole,
        None => return Err("a mesh without indices".to_owned().into()),
    };
    if !indices.len().is_multiple_of(N) {
        return Err(format!("{} indices: expected {N} a face", indices.len()).into());
    }
    let index = |n: f64| {
        let is_sound = n >= 0.0 && n.fract() == 0.0 && n < positions.len() as f64;
        if is_sound { Ok(n as u32) } else { Err(format!("the index {n} in a mesh of {} vertices", positions.len())) }
    };
    let mut faces = Vec::with_capacity(indices.len() / N);
    for face in indices.chunks_exact(N) {
        let mut corners = [0; N];
        for (corner, n) in corners.iter_mut().zip(face) {
            *corner = index(*n)?;
        }
        faces.push(corners);
    }
    Ok((TriangleMesh { positions, normals, uvs, ..TriangleMesh::default() }, faces))
}

fn triangles(params: &Params<'_>) -> Result<TriangleMesh, Fault> {
    let (mesh, triangles) = mesh::<3>(params)?;
    Ok(TriangleMesh { triangles, ..mesh })
}

/// Whether two triangles each are the patches that a mesh was made from.
fn are_parallelograms(mesh: &TriangleMesh) -> bool {
    mesh.triangles.chunks_exact(2).all(|pair| {
        let [a, b, d] = pair[0].map(|v| mesh.positions[v as usize]);
        let c = mesh.positions[pair[1][2] as usize];
        (a + d - b - c).length() <= 1e-5 * (b - c).length()
    })
}

/// Patches have their corners row by row: (0, 0), (1, 0), (0, 1), (1, 1).
fn patches(params: &Params<'_>) -> Result<TriangleMesh, Fault> {
    let (mesh, patches) = mesh::<4>(params)?;
    let triangles = patches.iter().flat_map(|&[a, b, c, d]| [[a, b, d], [a, d, c]]).collect();
    Ok(TriangleMesh { triangles, ..mesh })
}
