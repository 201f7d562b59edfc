//! How much light a boundary between two media mirrors, for unpolarized light.

use dioptric_spectrum::lanes;

/// Returns the reflectance of a boundary at the cosine of the angle of incidence, 0–1.
///
/// `eta` is the index behind the boundary over that before it. 1 where light is totally reflected.
pub(crate) fn dielectric(cos: f32, eta: f32) -> f32 {
    let cos = cos.clamp(0.0, 1.0);
    let sin2_behind = (1.0 - cos * cos) / (eta * eta);
    if sin2_behind >= 1.0 {
        return 1.0;
    }
    let cos_behind = (1.0 - sin2_behind).sqrt();
    let parallel = (eta * cos - cos_behind) / (eta * cos + cos_behind);
    let across = (cos - eta * cos_behind) / (cos + eta * cos_behind);
    0.5 * (parallel * parallel + across * across)
}

/// Returns [`dielectric`] of boundaries of several indices, mostly all the same.
pub(crate) fn dielectrics<const N: usize>(cos: f32, eta: &[f32; N]) -> [f32; N] {
    if eta.iter().all(|n| n == &eta[0]) {
        [dielectric(cos, eta[0]); N]
    } else {
        lanes(|lane| dielectric(cos, eta[lane]))
    }
}

/// Returns the reflectance of a metal of index `n` + i `k`, in a medium of index 1 (Born & Wolf, 14.2).
pub(crate) fn conductor(cos: f32, n: f32, k: f32) -> f32 {
    let cos = cos.clamp(0.0, 1.0);
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let t0 = n * n - k * k - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
    let (t1, t2) = (a2_plus_b2 + cos2, 2.0 * cos * a);
    let across = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (cos2 * a2_plus_b2 + sin2 * sin2, t2 * sin2);
    let parallel = across * (t3 - t4) / (t3 + t4);
    0.5 * (parallel + across)
}

/// Returns (1 − cos)⁵, by which Schlick's formula goes from the reflectance at right angles to that at grazing ones.
pub(crate) fn schlick_tail(cos: f32) -> f32 {
    (1.0 - cos.clamp(0.0, 1.0)).powi(5)
}

/// Returns the value so far between two.
pub(crate) fn between(at_right_angles: f32, at_edge: f32, tail: f32) -> f32 {
    at_right_angles + (at_edge - at_right_angles) * tail
}

/// Returns the share of even light from all directions outside that a boundary mirrors: ∫ 2 μ F(μ) dμ.
pub(crate) fn diffuse_reflectance(eta: f32) -> f32 {
    const N: usize = 200;
    let each = (0..N).map(|i| {
        let cos = (i as f32 + 0.5) / N as f32;
        2.0 * cos * dielectric(cos, eta)
    });
    each.sum::<f32>() / N as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectric_has_its_closed_forms() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-7);
        assert_eq!((dielectric(0.0, 1.5), dielectric(0.3, 1.0 / 1.5)), (1.0, 1.0));
        // At Brewster's angle only one polarization is mirrored: half of ((n² − 1)/(n² + 1))².
        let brewster = 1.5_f32.atan().cos();
        assert!((dielectric(brewster, 1.5) - 0.5 * (1.25_f32 / 3.25).powi(2)).abs() < 1e-6);
        // The same angle pair mirrors alike from either side.
        let (cos, eta) = (0.6_f32, 1.5_f32);
        let behind = (1.0 - (1.0 - cos * cos) / (eta * eta)).sqrt();
        assert!((dielectric(cos, eta) - dielectric(behind, 1.0 / eta)).abs() < 1e-6);
    }

    #[test]
    fn conductor_has_its_closed_forms() {
        let straight = |n: f32, k: f32| ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
        assert!((conductor(1.0, 0.2, 3.0) - straight(0.2, 3.0)).abs() < 1e-6);
        for cos in [0.9, 0.5, 0.1] {
            assert!((conductor(cos, 1.5, 0.0) - dielectric(cos, 1.5)).abs() < 1e-5);
        }
    }

    /// Walsh's closed form for n = 1.5 is 0.0918 outside (d'Eon & Irving 2011).
    #[test]
    fn diffuse_reflectance_is_walshs() {
        assert!((diffuse_reflectance(1.5) - 0.0918).abs() < 2e-4);
        // Inside and outside are tied by the invariance of radiance over n².
        let inside = diffuse_reflectance(1.0 / 1.5);
        assert!((1.0 - inside - (1.0 - diffuse_reflectance(1.5)) / 2.25).abs() < 2e-3);
    }
}
