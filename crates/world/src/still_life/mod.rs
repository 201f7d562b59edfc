//! The still life: the built-in world, made with the builder as any other can be.

mod floor_plan;
mod marks;
mod noise;
mod paint;
mod palette;
mod pigment;
mod room;

use glam::{DAffine3, DMat3, DVec3};

use crate::{CameraKind, World, WorldBuilder, WorldCamera};

impl World {
    /// Returns the built-in still life, x right, y up, z ahead; m.
    ///
    /// A table by a window stands in a room, with things from 0.65 m to 4 m before the eye: fruit, a 24-patch chart
    /// and a printed card at 1 m; a vase, books, a bottle behind; a chair at 2.5 m; a sideboard, books, a lamp, a
    /// picture and small bulbs at the far wall. Reflectances are those of the chart or smooth formulas, known from 300 to
    /// 1100 nm. Daylight of 6200 K comes through the window, light of a 2850 K black body from the lamps. Its camera is the
    /// eye that the arrangement is made for: 34° across a 3 × 2 picture.
    ///
    /// # Panics
    /// Never: its parts are sound, and a test says so.
    pub fn still_life() -> Self {
        let mut builder = WorldBuilder::new();
        room::furnish(&mut builder);
        builder.add_camera(eye());
        builder.build().expect("the still life is sound")
    }
}

/// The eye, a hand's breadth above the table, looking slightly down.
fn eye() -> WorldCamera {
    const HEIGHT_M: f64 = 0.225;
    const DOWN_DEG: f64 = 5.6;
    const ACROSS_DEG: f64 = 34.0;
    const SIZE: (usize, usize) = (1080, 720);
    let (sin, cos) = DOWN_DEG.to_radians().sin_cos();
    let axes = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::new(0.0, -sin, cos));
    // The angle of a camera is that across the shorter side.
    let half_tan = (0.5 * ACROSS_DEG).to_radians().tan() * SIZE.1 as f64 / SIZE.0 as f64;
    WorldCamera {
        name: "eye".to_owned(),
        world_from_camera: DAffine3 { matrix3: axes, translation: DVec3::new(0.0, HEIGHT_M, 0.0) },
        kind: CameraKind::Perspective {
            fov_deg: 2.0 * half_tan.atan().to_degrees(),
            lens_radius_m: 0.0,
            focus_distance_m: 1.0,
            screen_window: None,
        },
        resolution: SIZE,
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::Ray;

    /// Shadings, patterns and lights at what many rays meet.
    #[test]
    fn room_is_closed_and_no_brighter_than_its_light() {
        let world = World::still_life();
        assert!(world.n_lights() > 15 && world.cameras().len() == 1);
        let nm = [400.0, 500.0, 600.0, 700.0];
        let mut n_lit = 0;
        for i in 0..4000_u32 {
            let number = |salt: u32| {
                (i.wrapping_mul(0x9e37_79b1 ^ salt).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / (1 << 24) as f32
            };
            let aim = Vec3::new(2.0 * number(1) - 1.0, 2.0 * number(2) - 1.0, 1.5 * number(3) - 0.2).normalize();
            let hit = world.intersect(&Ray { origin: Vec3::new(0.0, 0.225, 0.0), direction: aim }, f32::INFINITY);
            let mut hit = hit.expect("the room is closed");
            for footprint_m in [0.0, 2e-3] {
                hit.footprint_m = footprint_m;
                let bsdf = world.bsdf(&hit, -aim, &nm);
                assert!(bsdf.albedo().iter().all(|v| (0.0..=1.0).contains(v)), "{hit:?}");
                assert!((bsdf.normal().length() - 1.0).abs() < 1e-5);
            }
            let light = world.sample_light(hit.point, number(4), [number(5), number(6)], &nm);
            n_lit += usize::from(light.is_some_and(|light| light.radiance[1] > 0.0));
        }
        assert!(n_lit > 3000, "{n_lit}");
    }
}
