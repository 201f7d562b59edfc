//! Triangle meshes.

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};

use crate::WorldError;

/// Triangles that share vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Where the vertices are, m.
    pub positions: Vec<Vec3>,
    /// A shading normal a vertex, or none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates a vertex, or none.
    pub uvs: Vec<Vec2>,
    /// Second texture coordinates a vertex, or none.
    pub second_uvs: Vec<Vec2>,
    /// Linear sRGB and alpha a vertex, or none.
    pub colors: Vec<[f32; 4]>,
    /// Three vertices a triangle, counterclockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Returns a parallelogram: `corner`, the sides `along_u` and `along_v` from it, and the normal `along_u × along_v`.
    ///
    /// Its texture coordinates run from 0 to 1 along each side.
    pub fn quad(corner: Vec3, along_u: Vec3, along_v: Vec3) -> Self {
        Self {
            positions: vec![corner, corner + along_u, corner + along_u + along_v, corner + along_v],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Self::default()
        }
    }

    /// Returns a box between two corners, each face with texture coordinates of its own from 0 to 1.
    pub fn block(low: Vec3, high: Vec3) -> Self {
        let size = high - low;
        let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z);
        let faces = [(low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z)];
        let mut block = Self::default();
        for (corner, along_u, along_v) in faces {
            let quad = Self::quad(corner, along_u, along_v);
            let first = block.positions.len() as u32;
            block.positions.extend(quad.positions);
            block.uvs.extend(quad.uvs);
            block.triangles.extend(quad.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        block
    }

    /// Checks that every index names a vertex, lists have the right lengths and positions are finite.
    ///
    /// # Errors
    /// When they are not, naming the first thing that is wrong.
    pub fn check(&self) -> Result<(), WorldError> {
        let n_vertices = self.positions.len();
        if u32::try_from(n_vertices).is_err() || u32::try_from(self.triangles.len()).is_err() {
            return Err(WorldError::mesh(format!("{n_vertices} vertices: expected fewer than 2³²")));
        }
        for (what, n) in [
            ("normals", self.normals.len()),
            ("texture coordinates", self.uvs.len()),
            ("second texture coordinates", self.second_uvs.len()),
            ("colors", self.colors.len()),
        ] {
            if n != 0 && n != n_vertices {
                return Err(WorldError::mesh(format!("{n} {what} for {n_vertices} vertices: expected one a vertex")));
            }
        }
        if let Some(index) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(WorldError::mesh(format!("vertex {index} is {}: expected finite", self.positions[index])));
        }
        let is_wrong = |t: &&[u32; 3]| t.iter().any(|&v| v as usize >= n_vertices);
        if let Some(triangle) = self.triangles.iter().find(is_wrong) {
            return Err(WorldError::mesh(format!("triangle {triangle:?}: the mesh has {n_vertices} vertices")));
        }
        Ok(())
    }

    /// Returns the corners of a triangle, m.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[triangle];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// Returns the outward normal of a triangle with these corners, of length 1: the side its vertex normals point to, where
    /// it has them.
    pub(crate) fn outward_normal(&self, triangle: usize, corners: [Vec3; 3]) -> Vec3 {
        let [a, b, c] = corners;
        let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or(DVec3::Z).as_vec3();
        let is_inward = !self.normals.is_empty()
            && self.triangles[triangle].iter().map(|&v| self.normals[v as usize]).sum::<Vec3>().dot(normal) < 0.0;
        if is_inward { -normal } else { normal }
    }

    /// Moves the mesh, computing in f64; a mirroring transform also turns the triangles, so that outside stays outside.
    pub fn transform(&mut self, placement: &DAffine3) {
        if *placement == DAffine3::IDENTITY {
            return;
        }
        for p in &mut self.positions {
            *p = placement.transform_point3(p.as_dvec3()).as_vec3();
        }
        let normals_by = normal_matrix(placement);
        for n in &mut self.normals {
            *n = (normals_by * n.as_dvec3()).normalize_or_zero().as_vec3();
        }
        if placement.matrix3.determinant() < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }
}

/// Returns twice the area of a polygon along its normal (Newell's).
pub(crate) fn area_vector(corners: &[Vec3]) -> DVec3 {
    let from_first = |k: usize| (corners[k] - corners[0]).as_dvec3();
    (2..corners.len()).map(|k| from_first(k - 1).cross(from_first(k))).sum()
}

/// The most corners of a polygon that isn't convex and is cut by its ears.
const MOST_CORNERS: usize = 4096;

/// Returns the triangles of a polygon, in its corners' numbers: a fan, or, where it isn't convex, ear by ear.
pub(crate) fn polygon(corners: &[Vec3]) -> Vec<[usize; 3]> {
    let n = corners.len();
    if !(4..=MOST_CORNERS).contains(&n) {
        return (2..n).map(|k| [0, k - 1, k]).collect();
    }
    // Seen along Newell's normal, in f64, counterclockwise.
    let next = |k: usize| (k + 1) % n;
    let normal = area_vector(corners);
    let (across, up) = normal.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_pair();
    let flat: Vec<DVec2> = corners.iter().map(|p| DVec2::new(p.as_dvec3().dot(across), p.as_dvec3().dot(up))).collect();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]);
    let least = -1e-9 * normal.length();
    if (0..n).all(|k| turn(k, next(k), next(next(k))) >= least) {
        return (2..n).map(|k| [0, k - 1, k]).collect();
    }
    let mut left: Vec<usize> = (0..n).collect();
    let mut triangles = Vec::with_capacity(n - 2);
    while left.len() > 3 {
        let m = left.len();
        let triple = |k: usize| [left[(k + m - 1) % m], left[k], left[(k + 1) % m]];
        let is_inside = |p: usize, [a, b, c]: [usize; 3]| {
            ![a, b, c].iter().any(|q| flat[*q] == flat[p])
                && [(a, b), (b, c), (c, a)]
                    .iter()
                    .all(|&(from, to)| (flat[to] - flat[from]).perp_dot(flat[p] - flat[from]) >= 0.0)
        };
        let is_ear = |k: usize| {
            let [a, b, c] = triple(k);
            turn(a, b, c) > 0.0 && !left.iter().any(|&p| p != a && p != b && p != c && is_inside(p, [a, b, c]))
        };
        // Where none is left, what remains has no area, or crosses itself.
        let ear = (1..m).chain([0]).find(|k| is_ear(*k)).unwrap_or(1);
        triangles.push(triple(ear));
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

/// Returns the matrix that moves normals: the inverse transpose, up to a positive factor.
pub(crate) fn normal_matrix(placement: &DAffine3) -> DMat3 {
    let m = placement.matrix3;
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -1.0 * cofactors } else { cofactors }
}

/// Returns the area of a triangle, m².
pub(crate) fn triangle_area([a, b, c]: [Vec3; 3]) -> f64 {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_faces_point_outwards() {
        let block = TriangleMesh::block(-Vec3::ONE, Vec3::ONE);
        block.check().unwrap();
        for triangle in 0..block.triangles.len() {
            let [a, b, c] = block.corners(triangle);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
        let area: f64 = (0..12).map(|t| triangle_area(block.corners(t))).sum();
        assert_eq!(area, 24.0);
    }

    #[test]
    fn mirrored_block_points_outwards() {
        let mut block = TriangleMesh::block(-Vec3::ONE, Vec3::ONE);
        block.transform(&DAffine3::from_scale(DVec3::new(-2.0, 1.0, 1.0)));
        for triangle in 0..block.triangles.len() {
            let [a, b, c] = block.corners(triangle);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }

    #[test]
    fn wrong_meshes_are_refused() {
        let good = TriangleMesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        good.check().unwrap();
        let with = |change: fn(&mut TriangleMesh)| {
            let mut mesh = good.clone();
            change(&mut mesh);
            mesh.check().unwrap_err().to_string()
        };
        assert!(with(|m| m.triangles[1][2] = 4).contains("[0, 2, 4]"));
        assert!(with(|m| m.positions[2].y = f32::NAN).contains("vertex 2"));
        assert!(with(|m| m.uvs.truncate(1)).contains("1 texture coordinates"));
    }

    /// Polygons that aren't convex: an L of area 3, an arrowhead of area 1, seen from either side and turned in space.
    #[test]
    fn polygons_are_cut_into_what_they_cover() {
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let arrow = [[0.0, 0.0], [2.0, -1.0], [1.0, 0.0], [2.0, 1.0]];
        let turned = |[x, y]: &[f32; 2]| Vec3::new(0.6 * x + 5.0, *y, 0.8 * x);
        for (corners, area) in [(&l[..], 3.0), (&arrow[..], 1.0)] {
            for first in 0..corners.len() {
                let mut places: Vec<Vec3> = corners.iter().map(turned).collect();
                places.rotate_left(first);
                for _ in 0..2 {
                    places.reverse();
                    let outwards: Vec3 =
                        (0..places.len()).map(|k| places[k].cross(places[(k + 1) % places.len()])).sum();
                    let triangles = polygon(&places);
                    assert_eq!(triangles.len(), places.len() - 2);
                    let areas: Vec<f32> = triangles
                        .iter()
                        .map(|t| {
                            let [a, b, c] = t.map(|k| places[k]);
                            0.5 * (b - a).cross(c - a).dot(outwards.normalize())
                        })
                        .collect();
                    // None is turned over, and together they are the whole.
                    assert!(areas.iter().all(|a| *a >= -1e-6), "{areas:?}");
                    assert!((areas.iter().sum::<f32>() - area).abs() < 1e-5, "{areas:?}");
                }
            }
        }
        assert_eq!(polygon(&[Vec3::ZERO; 2]), [[0; 3]; 0]);
        assert_eq!(polygon(&[Vec3::ZERO; 5]).len(), 3);
    }
}
