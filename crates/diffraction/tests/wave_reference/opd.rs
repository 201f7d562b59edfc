//! Wavefronts, against a tracer of fifty digits.

use dioptric_diffraction::ReferenceSphere;
use dioptric_optics::{Vignetting, glam::DVec2, rays_towards};

use crate::{
    lens::Reference,
    reader::{NAMES, number, numbers},
};

#[dioptric_golden::needs_shared]
#[test]
fn wavefronts_agree_with_fifty_digits() {
    for name in NAMES {
        let Some(reference) = Reference::open(name) else { return };
        let opd = &reference.file["opd"];
        let pupil: Vec<DVec2> =
            opd["pupil_points"].as_array().unwrap().iter().map(|p| DVec2::from_slice(&numbers(p))).collect();
        let image_z_mm = number(&reference.file["lens"]["image_z"]);
        let mut worst = 0.0f64;
        for row in opd["rows"].as_array().unwrap() {
            let (mono, point) = (reference.at(row), reference.point(row));
            let targets: Vec<DVec2> = pupil.iter().map(|p| reference.target_mm(&point, *p)).collect();
            let mut rays = rays_towards(&point, &targets, reference.pupil_z_mm, 0.0);
            mono.trace(&mut rays, Vignetting::Off);
            let film_distance_mm = image_z_mm - mono.last_vertex_z_mm();
            mono.to_film(&mut rays, film_distance_mm);
            // The first pupil point is the chief ray's.
            let own = ReferenceSphere::through_exit_pupil(&mono, rays.point_mm(0));
            let radius_mm = number(&row["reference_radius_mm"]).copysign(own.radius_mm);
            let paths_mm = ReferenceSphere { radius_mm, ..own }.paths_mm(&mono, &rays);
            let scale = 1.0 / (mono.wavelength_nm() * 1e-6);
            for (path_mm, expected) in paths_mm.iter().zip(numbers(&row["opd_waves"])) {
                let difference = ((path_mm - paths_mm[0]) * scale - expected).abs();
                assert!(!difference.is_nan(), "{name}: a ray is lost");
                worst = worst.max(difference);
            }
        }
        // Found are 1e-9, and 2e-8 where the object is near: rounding of paths of 1 m.
        assert!(worst < 1e-7, "{name}: {worst} waves");
    }
}
