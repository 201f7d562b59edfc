//! Curves of pbrt files: hair, grass and wires, as tubes and ribbons of triangles.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec2};

use super::params::Params;
use crate::TriangleMesh;

/// Sides of a tube.
const SIDES: usize = 6;
/// A piece of a curve is straight over this angle, and has at most so many steps a point.
const STEP_RAD: f64 = 0.2;
const MOST_STEPS: usize = 4;
/// The most points that a curve may have.
const MOST_POINTS: usize = 1 << 20;

/// Adds a curve to a mesh: a tube whose perimeter is that of the round one, so that its area, and the width at which it is seen on
/// average, are those of the curve; of the type `ribbon` a band across its normals.
pub(super) fn add(mesh: &mut TriangleMesh, params: &Params<'_>, is_hair: bool) -> Result<(), String> {
    let is_spline = params.choice("basis", &["bezier", "bspline"]) == Some(1);
    let degree = params.within("degree", [2.0, 3.0]).map_or(3, |degree| degree as usize);
    // Hair is round, whichever way it is turned.
    let is_ribbon = params.choice("type", &["flat", "cylinder", "ribbon"]) == Some(2) && !is_hair;
    // How finely the ray tracer of pbrt cuts it.
    params.find("splitdepth");
    let width = params.within("width", [0.0, f64::MAX]).unwrap_or(1.0);
    let widths = ["width0", "width1"].map(|name| params.within(name, [0.0, f64::MAX]).unwrap_or(width));
    let of_three =
        |name: &str| params.numbers(name).unwrap_or(&[]).chunks_exact(3).map(DVec3::from_slice).collect::<Vec<_>>();
    let (points, normals) = (of_three("P"), of_three("N"));
    let n_points = points.len();
    let n_pieces = if is_spline { n_points.saturating_sub(degree) } else { n_points.saturating_sub(1) / degree };
    let is_whole = if is_spline { n_pieces > 0 } else { n_pieces > 0 && n_pieces * degree + 1 == n_points };
    let n_numbers = params.numbers("P").map_or(0, <[f64]>::len);
    if !is_whole || n_points > MOST_POINTS || n_numbers != 3 * n_points {
        return Err(format!("a curve of {n_points} points ({n_numbers} numbers) and degree {degree}"));
    }
    if is_ribbon && normals.len() != n_pieces + 1 {
        return Err(format!(
            "a ribbon of {n_pieces} pieces and {} normals: expected one at each end of a piece",
            normals.len()
        ));
    }
    let pieces = (0..n_pieces).map(|piece| match is_spline {
        true => bezier_of_spline(&points[piece..=piece + degree]),
        false => points[piece * degree..=(piece + 1) * degree].to_vec(),
    });
    let most_steps = if is_spline { MOST_STEPS } else { degree * MOST_STEPS };
    // Places, ways along, how far along the whole, 0 to 1, and normals of ribbons.
    let mut stations: Vec<(DVec3, DVec3, f64, DVec3)> = Vec::new();
    for (number, piece) in pieces.enumerate() {
        let turn: f64 =
            piece.windows(3).map(|p| (p[1] - p[0]).angle_between(p[2] - p[1])).filter(|a| a.is_finite()).sum();
        let n_steps = ((turn / STEP_RAD).ceil() as usize).clamp(1, most_steps);
        for step in usize::from(number > 0)..=n_steps {
            let t = step as f64 / n_steps as f64;
            let (at, way) = along(&piece, t);
            let across = if is_ribbon { normals[number].lerp(normals[number + 1], t) } else { DVec3::ZERO };
            stations.push((at, way, (number as f64 + t) / n_pieces as f64, across));
        }
    }
    // A frame that turns no more than the curve does.
    let mut side = stations[0].1.any_orthonormal_vector();
    let n_across = if is_ribbon { 2 } else { SIDES + 1 };
    let first = mesh.positions.len() as u32;
    for &(at, way, u, normal) in &stations {
        side = (side - way * side.dot(way)).try_normalize().unwrap_or_else(|| way.any_orthonormal_vector());
        let up = way.cross(side);
        let half = 0.5 * (widths[0] + u * (widths[1] - widths[0]));
        for k in 0..n_across {
            let v = k as f64 / (n_across - 1) as f64;
            let (offset, outwards) = match is_ribbon {
                true => {
                    let across = normal.cross(way).normalize_or_zero();
                    (across * half * (2.0 * v - 1.0), way.cross(across))
                }
                false => {
                    let (sin, cos) = (TAU * v).sin_cos();
                    let outwards = side * cos + up * sin;
                    (outwards * half * PI / (SIDES as f64 * (PI / SIDES as f64).sin()), outwards)
                }
            };
            mesh.positions.push((at + offset).as_vec3());
            mesh.normals.push(outwards.as_vec3());
            mesh.uvs.push(Vec2::new(u as f32, v as f32));
        }
    }
    if mesh.positions[first as usize..].iter().any(|p| !p.is_finite()) {
        mesh.positions.truncate(first as usize);
        mesh.normals.truncate(first as usize);
        mesh.uvs.truncate(first as usize);
        return Err("a curve beyond all numbers".to_owned());
    }
    let vertex = |station: usize, k: usize| first + (station * n_across + k) as u32;
    for station in 1..stations.len() {
        for k in 1..n_across {
            let [a, b] = [vertex(station - 1, k - 1), vertex(station - 1, k)];
            let [c, d] = [vertex(station, k - 1), vertex(station, k)];
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    Ok(())
}

/// Returns Bézier's points of a piece of a uniform B-spline.
fn bezier_of_spline(p: &[DVec3]) -> Vec<DVec3> {
    match *p {
        [a, b, c] => vec![a.midpoint(b), b, b.midpoint(c)],
        [a, b, c, d] => {
            let third = |from: DVec3, to: DVec3| from.lerp(to, 1.0 / 3.0);
            let (near, far) = (third(b, c), third(c, b));
            vec![third(b, a).midpoint(near), near, far, third(c, d).midpoint(far)]
        }
        _ => p.to_vec(),
    }
}

/// Returns the place on a Bézier curve and the way along it.
fn along(points: &[DVec3], t: f64) -> (DVec3, DVec3) {
    let mut left = points.to_vec();
    while left.len() > 2 {
        left = left.windows(2).map(|pair| pair[0].lerp(pair[1], t)).collect();
    }
    let whole = points[points.len() - 1] - points[0];
    (left[0].lerp(left[1], t), (left[1] - left[0]).try_normalize().unwrap_or(whole.normalize_or(DVec3::Z)))
}

#[cfg(test)]
mod tests {
    use super::super::tokens::Tokens;
    use super::*;

    fn mesh(text: &str) -> Result<TriangleMesh, String> {
        let mut mesh = TriangleMesh::default();
        add(&mut mesh, &Params::read(&mut Tokens::new(text))?, false)?;
        mesh.check().unwrap();
        Ok(mesh)
    }

    fn area(mesh: &TriangleMesh) -> f64 {
        (0..mesh.triangles.len())
            .map(|t| mesh.corners(t).map(|p| p.as_dvec3()))
            .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
            .sum()
    }

    /// A straight tube has the area of a cylinder, a cone half of it, a ribbon that of its rectangle.
    #[test]
    fn straight_curves_have_the_area_of_their_shape() {
        let line = "\"point3 P\" [0 0 0  0 1 0  0 2 0  0 3 0]";
        let tube = mesh(&format!("{line} \"float width\" .2")).unwrap();
        assert!((area(&tube) - PI * 0.2 * 3.0).abs() < 1e-5, "{}", area(&tube));
        let cone = mesh(&format!("{line} \"float width0\" .002 \"float width1\" 0")).unwrap();
        assert!((area(&cone) - PI * 0.001 * 3.0).abs() < 1e-5, "{}", area(&cone));
        let ribbon =
            mesh(&format!("{line} \"float width\" .2 \"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 1]")).unwrap();
        assert!((area(&ribbon) - 0.6).abs() < 1e-6 && ribbon.normals.iter().all(|n| n.z > 0.999), "{}", area(&ribbon));
        // Normals point outwards, and triangles the same way.
        for t in 0..tube.triangles.len() {
            let [a, b, c] = tube.corners(t);
            assert!((b - a).cross(c - a).dot(tube.normals[tube.triangles[t][0] as usize]) > 0.0);
        }
    }

    /// Points of a B-spline on a line, or on a parabola, give that; its pieces meet.
    #[test]
    fn splines_are_bezier_curves() {
        for degree in [2, 3] {
            let points: String = (0..6).map(|i| format!("{i} {} 0 ", i * i)).collect();
            let text = format!(
                "\"point3 P\" [{points}] \"string basis\" \"bspline\" \"integer degree\" {degree} \"float width\" 1e-6"
            );
            let mesh = mesh(&text).unwrap();
            // A uniform spline through the squares of whole numbers is a parabola, moved by 1/4 or 1/3.
            let moved = if degree == 2 { 0.25 } else { 1.0 / 3.0 };
            for p in &mesh.positions {
                assert!((p.y - p.x * p.x - moved).abs() < 2e-5 * p.y.max(1.0), "{degree}: {p}");
            }
            let (low, high) = mesh.positions.iter().fold((9.0_f32, 0.0_f32), |(a, b), p| (a.min(p.x), b.max(p.x)));
            let ends = if degree == 2 { (0.5, 4.5) } else { (1.0, 4.0) };
            assert!((low - ends.0).abs() < 1e-4 && (high - ends.1).abs() < 1e-4, "{degree}: {low} {high}");
        }
        for numbers in ["0 0 0 1 0 0", "0 0 0 1 0 0 2 0 0 3 0 0 4"] {
            assert!(mesh(&format!("\"point3 P\" [{numbers}]")).unwrap_err().contains("points"));
        }
    }
}
