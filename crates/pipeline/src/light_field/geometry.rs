//! How far apart views show a point, by its depth.

use dioptric_optics::MonoLens;

/// The disparity of neighboring views by depth, and depth by disparity.
///
/// Disparity is how far a point moves to the left from a view to its neighbor on the right, and down to the one above, in
/// pixels of a view: the nearer the more. Depth counts along the axis from the center of the entrance pupil, m.
#[derive(Clone, Debug)]
pub struct ViewGeometry {
    kind: Kind,
    projection_center_z_mm: f64,
}

/// Parallel pinhole cameras that show points of each depth z as far apart as views do: `scale_mm · baseline_mm / pitch_mm · (1/z − 1/z_f)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelCameras {
    /// The image of a unit tangent, mm.
    pub scale_mm: f64,
    /// Between samples, mm.
    pub pitch_mm: f64,
    /// Between neighbors, mm.
    pub baseline_mm: f64,
    /// The depth that all show at the same place, m; may be infinite.
    pub focus_m: f64,
}

#[derive(Clone, Debug)]
enum Kind {
    /// Views through parts of one exit pupil.
    Pupil {
        lens: Box<MonoLens>,
        /// From the last vertex to the plane that is still in all views, mm.
        still_distance_mm: f64,
        /// From the exit pupil to that plane, mm.
        pupil_distance_mm: f64,
        /// Disparity on that plane, pixels.
        still_px: f64,
        /// Disparity, pixels, of a unit slope dx/dU of the image on that plane with the place in the exit pupil.
        px_per_slope: f64,
        /// Between samples, mm.
        pitch_mm: f64,
    },
    Cameras(ParallelCameras),
}

impl ViewGeometry {
    /// Views through places of the exit pupil that lie so far apart, their pixels `pitch_mm` on the plane
    /// `still_distance_mm` behind the last vertex, where they move by `still_px`.
    pub(crate) fn pupil(
        lens: &MonoLens,
        still_distance_mm: f64,
        (step_mm, pitch_mm): (f64, f64),
        still_px: f64,
    ) -> Self {
        let pupil_distance_mm = still_distance_mm - lens.first_order().exit_pupil_z_mm;
        let px_per_slope = step_mm / pitch_mm;
        let lens_of = Box::new(lens.clone());
        let kind =
            Kind::Pupil { lens: lens_of, still_distance_mm, pupil_distance_mm, still_px, px_per_slope, pitch_mm };
        Self { kind, projection_center_z_mm: lens.projection_center_z_mm() }
    }

    /// Views of parallel cameras so far apart, their film `film_distance_mm` behind the last vertex.
    pub(crate) fn cameras(lens: &MonoLens, film_distance_mm: f64, spacing_mm: f64, pitch_mm: f64) -> Self {
        let scale_mm = lens.film_scale_mm(film_distance_mm).abs();
        let cameras = ParallelCameras { scale_mm, pitch_mm, baseline_mm: spacing_mm, focus_m: f64::INFINITY };
        Self { kind: Kind::Cameras(cameras), projection_center_z_mm: lens.projection_center_z_mm() }
    }

    /// Returns the parallel cameras that show the same, to first order.
    pub fn cameras_alike(&self) -> ParallelCameras {
        match &self.kind {
            Kind::Cameras(cameras) => *cameras,
            Kind::Pupil { lens, still_distance_mm, pitch_mm, .. } => {
                let scale_mm = lens.film_scale_mm(*still_distance_mm).abs();
                // Disparity is linear in 1/z: its slope from two depths far beyond the focal length.
                let (near_m, far_m) = (0.1 * scale_mm, scale_mm);
                let px_m = (self.disparity_px(near_m) - self.disparity_px(far_m)) / (1.0 / near_m - 1.0 / far_m);
                let baseline_mm = 1e3 * px_m * pitch_mm / scale_mm;
                ParallelCameras { scale_mm, pitch_mm: *pitch_mm, baseline_mm, focus_m: self.depth_m(0.0) }
            }
        }
    }

    /// Returns how far apart neighboring views show a point of this depth, pixels; NaN before which the lens forms no image.
    pub fn disparity_px(&self, depth_m: f64) -> f64 {
        match &self.kind {
            Kind::Cameras(cameras) => cameras.px_m() / depth_m,
            Kind::Pupil { lens, still_distance_mm, pupil_distance_mm, still_px, px_per_slope, .. } => {
                let image_mm = lens.film_distance_mm_for(1e3 * depth_m - self.projection_center_z_mm);
                let beyond_mm = image_mm.map_or(f64::NAN, |image_mm| image_mm - still_distance_mm);
                still_px + px_per_slope * beyond_mm / (pupil_distance_mm + beyond_mm)
            }
        }
    }

    /// Returns the depth of points that neighboring views show so far apart, m; infinite for a disparity as small as that of
    /// what is infinitely far, or smaller.
    pub fn depth_m(&self, disparity_px: f64) -> f64 {
        match &self.kind {
            Kind::Cameras(cameras) if disparity_px > 0.0 => cameras.px_m() / disparity_px,
            Kind::Cameras(_) => f64::INFINITY,
            Kind::Pupil { lens, still_distance_mm, pupil_distance_mm, still_px, px_per_slope, .. } => {
                let slope = (disparity_px - still_px) / px_per_slope;
                let beyond_mm = slope * pupil_distance_mm / (1.0 - slope);
                let object_mm = lens.object_distance_mm_for(still_distance_mm + beyond_mm);
                object_mm.map_or(f64::INFINITY, |mm| 1e-3 * (mm + self.projection_center_z_mm))
            }
        }
    }
}

impl ParallelCameras {
    /// Disparity times the difference of 1/z from that in focus, px m.
    fn px_m(&self) -> f64 {
        1e-3 * self.scale_mm * self.baseline_mm / self.pitch_mm
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;

    use super::*;

    #[test]
    fn depth_and_disparity_are_inverse() {
        for lens in [Lens::thin(50.0, 25.0).unwrap(), Lens::built_in("dgauss-50mm").unwrap()] {
            let mono = lens.at(550.0).unwrap();
            let film_distance_mm = mono.film_distance_mm_for(600.0).unwrap();
            for geometry in [
                ViewGeometry::pupil(&mono, film_distance_mm, (3.0, 0.1), 0.02),
                ViewGeometry::cameras(&mono, film_distance_mm, 3.0, 0.1),
            ] {
                for depth_m in [0.3, 0.6, 0.9, 20.0] {
                    let disparity_px = geometry.disparity_px(depth_m);
                    assert!((geometry.depth_m(disparity_px) / depth_m - 1.0).abs() < 1e-9, "{depth_m}");
                }
                assert!(geometry.disparity_px(0.5) > geometry.disparity_px(0.6));
                let alike = geometry.cameras_alike();
                for depth_m in [0.3, 0.9, 20.0] {
                    let expected_px = alike.px_m() * (1.0 / depth_m - 1.0 / alike.focus_m);
                    assert!((geometry.disparity_px(depth_m) - expected_px).abs() < 1e-9 * alike.px_m(), "{depth_m}");
                }
            }
        }
    }

    #[test]
    fn thin_lens_has_the_disparity_of_similar_triangles() {
        // An image δ behind the plane: rays through places U of the lens cross the plane U δ/v farther out.
        let lens = Lens::thin(50.0, 25.0).unwrap().at(550.0).unwrap();
        let still_mm = lens.film_distance_mm_for(600.0).unwrap();
        let geometry = ViewGeometry::pupil(&lens, still_mm, (2.0, 0.1), 0.0);
        let image_mm = 1.0 / (1.0 / 50.0 - 1.0 / 450.0);
        let expected = 2.0 * (image_mm - still_mm) / image_mm / 0.1;
        assert!((geometry.disparity_px(0.45) - expected).abs() < 1e-9);
        assert!(geometry.disparity_px(0.6).abs() < 1e-9 && geometry.disparity_px(0.9) < 0.0);
        assert_eq!(geometry.depth_m(-1e3), f64::INFINITY);
    }
}
