//! The lights of the still life: a window and two lamps.

use glam::{DVec2, DVec3};

use super::{
    floor_plan::{BULBS, Bulb, ROOM_CENTER, WINDOW_CD_M2, WINDOW_HIGH, WINDOW_LOW},
    noise::{fract, on_disc, spread},
    world::{Seen, World},
};

/// Share of the window that is glass.
const GLASS: f64 = 0.80;

/// The shadows of a lamp that gives less than this, head on, are left out: they are too weak to be seen.
const FAINT_LUX: f64 = 14.0;

/// Illuminance, lx, by day and by lamp.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lux {
    pub(super) day: f64,
    pub(super) warm: f64,
}

/// Returns what falls on a surface straight from the lights.
pub(super) fn direct(world: &World, seen: &Seen, n_window: usize, n_bulb: usize, offsets: [DVec2; 2]) -> Lux {
    let mut lux = Lux { day: window(world, seen, n_window, offsets[0]), warm: 0.0 };
    for (index, bulb) in BULBS.iter().enumerate() {
        // The far lamp is smooth on all that is near; the near one makes the sharpest shadows.
        let n = if index == 0 { n_bulb } else { 1 };
        let offset = fract(offsets[1] + DVec2::splat(0.37 * index as f64));
        lux.warm += from_bulb(world, seen, bulb, n, offset);
    }
    lux
}

fn window(world: &World, seen: &Seen, n: usize, offset: DVec2) -> f64 {
    let (low, size) = (ROOM_CENTER + WINDOW_LOW, WINDOW_HIGH - WINDOW_LOW);
    let mut sum = 0.0;
    for i in 0..n {
        let u = spread(i, offset);
        let to = low + DVec3::new(2e-3, u.y * size.y, u.x * size.z) - seen.point;
        let length = to.length();
        let direction = to / length;
        let (cosine, window_cosine) = (seen.normal.dot(direction), -direction.x);
        if cosine <= 0.0 || window_cosine <= 0.0 || seen.flat_normal.dot(direction) <= 0.0 {
            continue;
        }
        let luminance = WINDOW_CD_M2 * (0.85 + 0.5 * u.y);
        if !world.is_shadowed(seen.ray(direction), length) {
            sum += luminance * cosine * window_cosine / (length * length);
        }
    }
    GLASS * size.y * size.z * sum / n as f64
}

fn from_bulb(world: &World, seen: &Seen, bulb: &Bulb, n: usize, offset: DVec2) -> f64 {
    let to_center = bulb.center - seen.point;
    let distance = to_center.length();
    let axis = to_center / distance;
    // Beyond the horizon of the surface there is nothing to sample.
    if seen.normal.dot(axis) < -bulb.radius / distance || distance <= bulb.radius {
        return 0.0;
    }
    let solid_angle = std::f64::consts::PI * (bulb.radius / distance).powi(2);
    if bulb.luminance * solid_angle < FAINT_LUX {
        return bulb.luminance * solid_angle * seen.normal.dot(axis).max(0.0);
    }
    let (x, y) = axis.any_orthonormal_pair();
    let mut sum = 0.0;
    for i in 0..n {
        let on_disc = bulb.radius * on_disc(spread(i, offset));
        let to = to_center + on_disc.x * x + on_disc.y * y;
        let length = to.length();
        let direction = to / length;
        let cosine = seen.normal.dot(direction);
        let is_above = cosine > 0.0 && seen.flat_normal.dot(direction) > 0.0;
        if is_above && !world.is_shadowed(seen.ray(direction), length) {
            sum += cosine;
        }
    }
    bulb.luminance * solid_angle * sum / n as f64
}
