//! Light counted ray by ray, for what is found in other ways to be held to.

use dioptric_optics::{
    MonoLens, ObjectPoint, RayBatch, Vignetting,
    glam::{DQuat, DVec2, DVec3},
};

/// Grids, each over what the one before found lit, of which the last is counted.
const N_GRIDS: usize = 4;

/// Returns the cross-section of the light of a far point that gets through, mm², by rays on square grids of so many across,
/// of which each but the first covers what the one before found lit.
pub(crate) fn cross_section_mm2(lens: &MonoLens, point: &ObjectPoint, n_across: usize) -> f64 {
    let direction = point.direction_to(DVec3::ZERO);
    let turn = DQuat::from_rotation_arc(DVec3::Z, direction);
    let extent_mm = 3.0 * lens.semi_aperture_mm(0);
    let (mut low, mut high) = (DVec2::splat(-extent_mm), DVec2::splat(extent_mm));
    let mut area_mm2 = 0.0;
    for _ in 0..N_GRIDS {
        let cell = (high - low) / n_across as f64;
        let (mut next, mut n_lit) = ((DVec2::INFINITY, DVec2::NEG_INFINITY), 0_usize);
        for row in 0..n_across {
            let at = |column: usize| low + cell * (DVec2::new(column as f64, row as f64) + 0.5);
            let points: Vec<DVec3> = (0..n_across).map(|column| turn * at(column).extend(0.0)).collect();
            let mut rays = RayBatch::from_points(&points, &vec![direction; n_across]);
            lens.trace(&mut rays, Vignetting::On);
            for column in (0..n_across).filter(|&column| rays.fate[column].is_in_flight()) {
                next = (next.0.min(at(column)), next.1.max(at(column)));
                n_lit += 1;
            }
        }
        area_mm2 = n_lit as f64 * cell.x * cell.y;
        if n_lit == 0 {
            break;
        }
        // The ends of a crescent are narrower than a cell.
        let margin = 1.5 * cell + 0.2 * (next.1 - next.0);
        (low, high) = (next.0 - margin, next.1 + margin);
    }
    area_mm2
}

/// Returns the height of the outermost ray of the beam about the axis that gets through, of so many rays from the axis to the
/// rim of the first surface, mm.
#[allow(dead_code, reason = "the example counts areas alone")]
pub(crate) fn beam_radius_mm(lens: &MonoLens, n_rays: usize) -> f64 {
    let height = |i: usize| lens.semi_aperture_mm(0) * (i as f64 + 0.5) / n_rays as f64;
    let points: Vec<DVec3> = (0..n_rays).map(|i| DVec3::new(0.0, height(i), -1.0)).collect();
    let mut rays = RayBatch::from_points(&points, &vec![DVec3::Z; n_rays]);
    lens.trace(&mut rays, Vignetting::On);
    let dark = rays.fate.iter().position(|fate| !fate.is_in_flight()).unwrap_or(n_rays);
    lens.semi_aperture_mm(0) * dark as f64 / n_rays as f64
}
