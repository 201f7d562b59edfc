//! Curved shapes of pbrt files that are met as many small triangles: parts of quadrics, and smoothed meshes.

use std::{collections::HashMap, f64::consts::TAU};

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::params::Params;
use crate::TriangleMesh;

/// Triangles around a whole turn and along a profile: silhouettes are off by 3.4e-4 of the radius.
const AROUND: usize = 120;
const ALONG: usize = 32;
/// The most triangles of a smoothed mesh.
const MOST_TRIANGLES: usize = 1 << 22;

/// Returns a quadric, or a part of one, that no closed form is here for; `None` where the whole is asked for or the kind is
/// another.
pub(super) fn quadric(kind: &str, params: &Params<'_>) -> Result<Option<TriangleMesh>, String> {
    let number = |name: &str, default: f64| params.number(name).unwrap_or(default);
    let turn = params.within("phimax", [1e-3, 360.0]).unwrap_or(360.0).to_radians();
    let radius = number("radius", 1.0);
    let is_part = turn < TAU;
    let profile: Box<dyn Fn(f64) -> DVec2> = match kind {
        "sphere" => {
            let (low, high) = (number("zmin", -radius), number("zmax", radius));
            let (low, high) = (low.min(high), low.max(high));
            if !is_part && low <= -radius && high >= radius {
                return Ok(None);
            }
            let angle = |z: f64| (z / radius).clamp(-1.0, 1.0).acos();
            let (from, to) = (angle(low), angle(high));
            Box::new(move |v| {
                let (sin, cos) = (from + v * (to - from)).sin_cos();
                radius * DVec2::new(sin, cos)
            })
        }
        "cylinder" if is_part => {
            let (low, high) = (number("zmin", -1.0), number("zmax", 1.0));
            Box::new(move |v| DVec2::new(radius, low + v * (high - low)))
        }
        "disk" if is_part => {
            let (height, inner) = (number("height", 0.0), number("innerradius", 0.0));
            Box::new(move |v| DVec2::new(radius + v * (inner - radius), height))
        }
        "cone" => {
            let height = number("height", 1.0);
            Box::new(move |v| DVec2::new((1.0 - v) * radius, v * height))
        }
        "paraboloid" => {
            let (low, high) = (number("zmin", 0.0), number("zmax", 1.0));
            let (low, high) = (low.min(high), low.max(high));
            if high <= 0.0 {
                return Err("a paraboloid: expected a zmax above 0".to_owned());
            }
            Box::new(move |v| {
                let z = low + v * (high - low);
                DVec2::new(radius * (z / high).max(0.0).sqrt(), z)
            })
        }
        "hyperboloid" => {
            let point = |name: &str, default: [f64; 3]| DVec3::from_array(params.exactly(name).unwrap_or(default));
            let (a, b) = (point("p1", [0.0; 3]), point("p2", [1.0; 3]));
            return Ok(Some(turned(turn, &move |v| a + v * (b - a))));
        }
        _ => return Ok(None),
    };
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(format!("the radius of a {kind} is {radius}: expected a finite length over 0"));
    }
    Ok(Some(turned(turn, &move |v| {
        let DVec2 { x: r, y: z } = profile(v);
        DVec3::new(r, 0.0, z)
    })))
}

/// Returns the surface that a curve sweeps as it turns about the z axis; u runs with the turn, v along the curve.
fn turned(turn: f64, curve: &dyn Fn(f64) -> DVec3) -> TriangleMesh {
    let n_around = ((AROUND as f64 * turn / TAU).ceil() as usize).max(1);
    let at = |u: f64, v: f64| {
        let (sin, cos) = (u * turn).sin_cos();
        let p = curve(v);
        DVec3::new(p.x * cos - p.y * sin, p.x * sin + p.y * cos, p.z)
    };
    let mut mesh = TriangleMesh::default();
    for row in 0..=ALONG {
        for column in 0..=n_around {
            let (u, v) = (column as f64 / n_around as f64, row as f64 / ALONG as f64);
            // Off the axis, where the turn moves nothing, and within the ends.
            let inner = v.clamp(1e-4, 1.0 - 1e-4);
            let along_u = at(u + 1e-5, inner) - at(u - 1e-5, inner);
            let along_v = at(u, (inner + 1e-5).min(1.0)) - at(u, (inner - 1e-5).max(0.0));
            mesh.positions.push(at(u, v).as_vec3());
            mesh.normals.push(along_u.cross(along_v).normalize_or(DVec3::Z).as_vec3());
            mesh.uvs.push(Vec2::new(u as f32, v as f32));
        }
    }
    let vertex = |row: usize, column: usize| (row * (n_around + 1) + column) as u32;
    for row in 0..ALONG {
        for column in 0..n_around {
            let [a, b] = [vertex(row, column), vertex(row, column + 1)];
            let [c, d] = [vertex(row + 1, column), vertex(row + 1, column + 1)];
            for triangle in [[a, b, d], [a, d, c]] {
                let [p, q, r] = triangle.map(|v| mesh.positions[v as usize]);
                if (q - p).cross(r - p) != Vec3::ZERO {
                    mesh.triangles.push(triangle);
                }
            }
        }
    }
    mesh
}

/// Returns a mesh smoothed so many times after Loop (1987), and put on the surface that it tends to, with its normals.
pub(super) fn smoothed(mesh: &TriangleMesh, levels: u32) -> TriangleMesh {
    let (mut positions, mut triangles): (Vec<DVec3>, Vec<[u32; 3]>) =
        (mesh.positions.iter().map(|p| p.as_dvec3()).collect(), mesh.triangles.clone());
    for _ in 0..levels {
        if triangles.len() > MOST_TRIANGLES / 4 {
            break;
        }
        (positions, triangles) = divided(&positions, &triangles);
    }
    let rings = Rings::of(positions.len(), &triangles);
    let on_limit: Vec<DVec3> = (0..positions.len())
        .map(|v| match rings.border(v) {
            Some([a, b]) => 0.6 * positions[v] + 0.2 * (positions[a] + positions[b]),
            None => {
                let ring = &rings.around[v];
                let n = ring.len() as f64;
                if ring.is_empty() {
                    return positions[v];
                }
                let share = 1.0 / (n + 3.0 / (8.0 * share_of_neighbor(ring.len())));
                (1.0 - n * share) * positions[v] + share * ring.iter().map(|&w| positions[w]).sum::<DVec3>()
            }
        })
        .collect();
    let mut normals = vec![DVec3::ZERO; on_limit.len()];
    for triangle in &triangles {
        let [a, b, c] = triangle.map(|v| on_limit[v as usize]);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&v| normals[v as usize] += normal);
    }
    TriangleMesh {
        positions: on_limit.iter().map(|p| p.as_vec3()).collect(),
        normals: normals.iter().map(|n| n.normalize_or_zero().as_vec3()).collect(),
        triangles,
        ..TriangleMesh::default()
    }
}

/// What each of so many neighbors counts.
fn share_of_neighbor(n: usize) -> f64 {
    if n == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * n as f64) }
}

/// The neighbors of each vertex, and of each edge the vertices across it.
struct Rings {
    around: Vec<Vec<usize>>,
    across: HashMap<[u32; 2], Vec<u32>>,
}

impl Rings {
    fn of(n_vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut around = vec![Vec::new(); n_vertices];
        let mut across: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
        for &[a, b, c] in triangles {
            for [from, to, other] in [[a, b, c], [b, c, a], [c, a, b]] {
                let known = across.entry(edge(from, to)).or_default();
                if known.is_empty() {
                    around[from as usize].push(to as usize);
                    around[to as usize].push(from as usize);
                }
                known.push(other);
            }
        }
        Self { around, across }
    }

    /// The two neighbors of a vertex along the border that it lies on, if any.
    fn border(&self, vertex: usize) -> Option<[usize; 2]> {
        let is_border = |&&other: &&usize| {
            self.across.get(&edge(vertex as u32, other as u32)).is_some_and(|across| across.len() == 1)
        };
        let mut found = self.around[vertex].iter().filter(is_border);
        Some([*found.next()?, *found.next()?])
    }
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn divided(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let rings = Rings::of(positions.len(), triangles);
    let mut moved: Vec<DVec3> = (0..positions.len())
        .map(|v| match rings.border(v) {
            Some([a, b]) => 0.75 * positions[v] + 0.125 * (positions[a] + positions[b]),
            None => {
                let ring = &rings.around[v];
                let share = if ring.is_empty() { 0.0 } else { share_of_neighbor(ring.len()) };
                (1.0 - ring.len() as f64 * share) * positions[v]
                    + share * ring.iter().map(|&w| positions[w]).sum::<DVec3>()
            }
        })
        .collect();
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry(edge(a, b)).or_insert_with(|| {
            let at = |v: u32| positions[v as usize];
            let ends = at(a) + at(b);
            moved.push(match rings.across.get(&edge(a, b)).map(Vec::as_slice) {
                Some(&[c, d]) => 0.375 * ends + 0.125 * (at(c) + at(d)),
                _ => 0.5 * ends,
            });
            moved.len() as u32 - 1
        })
    };
    let mut finer = Vec::with_capacity(4 * triangles.len());
    for &[a, b, c] in triangles {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (moved, finer)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::formats::pbrt::tokens::Tokens;

    fn of(kind: &str, words: &str) -> Option<TriangleMesh> {
        let mut tokens = Tokens::new(words);
        quadric(kind, &Params::read(&mut tokens).unwrap()).unwrap()
    }

    fn area(mesh: &TriangleMesh) -> f64 {
        (0..mesh.triangles.len()).map(|t| crate::mesh::triangle_area(mesh.corners(t))).sum()
    }

    /// Areas of their closed forms, to the 2e-3 that flat triangles leave, and normals that point outwards.
    #[test]
    fn quadrics_have_their_areas() {
        assert!(of("sphere", "\"float radius\" 2").is_none() && of("disk", "").is_none() && of("torus", "").is_none());
        let slant = (1.0_f64 + 4.0).sqrt();
        // A bowl z = x² + y² up to 1 has π/6 (5√5 − 1).
        let bowl = PI / 6.0 * (5.0 * 5.0_f64.sqrt() - 1.0);
        for (kind, words, expected) in [
            ("sphere", "\"float radius\" 2 \"float zmin\" -1 \"float zmax\" 1", 2.0 * PI * 2.0 * 2.0),
            ("sphere", "\"float phimax\" 90", PI),
            ("cylinder", "\"float phimax\" 180", 2.0 * PI),
            ("disk", "\"float phimax\" 180 \"float innerradius\" 0.5", 0.5 * PI * 0.75),
            ("cone", "\"float height\" 2", PI * slant),
            ("paraboloid", "", bowl),
            ("hyperboloid", "\"point p1\" [1 0 0] \"point p2\" [1 0 2]", 4.0 * PI),
        ] {
            let mesh = of(kind, words).unwrap();
            mesh.check().unwrap();
            assert!((area(&mesh) / expected - 1.0).abs() < 2e-3, "{kind} {words}: {} {expected}", area(&mesh));
            let along: f32 =
                mesh.positions.iter().zip(&mesh.normals).map(|(p, n)| p.truncate().dot(n.truncate())).sum();
            assert!(kind == "disk" || along.abs() > 1.0, "{kind}: {along}");
        }
    }

    /// A cube tends to a ball of half its size or so, closed, without edges; a flat square keeps its middle flat.
    #[test]
    fn smoothed_meshes_tend_to_their_limit() {
        let mut cube = TriangleMesh { positions: Vec::new(), ..TriangleMesh::default() };
        cube.positions =
            (0..8).map(|k| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32) * 2.0 - 1.0).collect();
        cube.triangles = vec![
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
            [0, 1, 5],
            [0, 5, 4],
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
        ];
        let ball = smoothed(&cube, 4);
        assert_eq!(ball.triangles.len(), 12 * 256);
        let radii: Vec<f32> = ball.positions.iter().map(|p| p.length()).collect();
        let (low, high) = radii.iter().fold((9.0_f32, 0.0_f32), |(a, b), &r| (a.min(r), b.max(r)));
        assert!(low > 0.5 && high < 1.2 && high / low < 1.7, "{low} {high}");
        // Its faces are as they were before one more division, but for the second order of their size.
        assert!((area(&smoothed(&cube, 5)) / area(&ball) - 1.0).abs() < 5e-3);
        assert!(ball.positions.iter().zip(&ball.normals).all(|(p, n)| p.normalize().dot(*n) > 0.7));
    }
}
