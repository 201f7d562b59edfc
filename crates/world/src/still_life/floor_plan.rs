//! The sizes and places that the room, its materials and its lights share, m.

use glam::DVec3;

/// The middle of the room; y = 0 is the top of the table, z = 0 the eye.
pub(super) const ROOM_CENTER: DVec3 = DVec3::new(0.0, 0.55, 1.25);
/// Half its sides.
pub(super) const ROOM_HALF: DVec3 = DVec3::new(2.2, 1.3, 2.75);
/// The corners of the window in the left wall, from the middle of the room.
pub(super) const WINDOW_LOW: DVec3 = DVec3::new(-2.2, -0.50, -0.55);
pub(super) const WINDOW_HIGH: DVec3 = DVec3::new(-2.2, 0.95, 1.45);

/// Half the sides of the cloth on the table.
pub(super) const CLOTH_HALF: DVec3 = DVec3::new(0.25, 0.0012, 0.46);

/// Luminance of the sky in the window 0.3 of the way up, cd/m²: brighter above.
pub(super) const WINDOW_CD_M2: f64 = 2450.0;

/// A lamp.
pub(super) struct Bulb {
    pub(super) center: DVec3,
    pub(super) radius: f64,
    pub(super) luminance: f64,
}

/// The bare bulb above the table, out of the picture, and the shaded lamp at the back.
pub(super) const BULBS: [Bulb; 2] = [
    Bulb { center: DVec3::new(0.85, 0.95, 0.60), radius: 0.045, luminance: 33_000.0 },
    Bulb { center: DVec3::new(0.93, 0.30, 3.62), radius: 0.10, luminance: 3_900.0 },
];
