//! The objects and pupils of the reference lenses.

use dioptric_optics::{
    Lens, MonoLens, ObjectPoint, PupilBoundary, Vignetting,
    glam::{DMat2, DVec2, DVec3},
    rays_towards,
};
use serde_json::Value;

use crate::reader::{json, lens, number, numbers};

/// A lens of the reference, and what its file says of objects and pupils.
pub(crate) struct Reference {
    pub(crate) file: Value,
    pub(crate) lens: Lens,
    /// z of the paraxial entrance pupil at the main wavelength, mm.
    pub(crate) pupil_z_mm: f64,
    /// Radius of that pupil, mm.
    pub(crate) pupil_radius_mm: f64,
}

impl Reference {
    pub(crate) fn open(name: &str) -> Option<Self> {
        let file = json(name)?;
        let pupil_z_mm = number(&file["lens"]["entrance_pupil_z_primary"]);
        let pupil_radius_mm = 0.5 * number(&file["lens"]["epd_mm"]);
        // The stop's rim is as published; the pupil meant may be narrower.
        let stop_mm = 2.0 * number(&file["lens"]["stop_radius_real_axis"]);
        let lens = lens(&file);
        let lens = lens.with_stop_diameter_mm(stop_mm).unwrap_or(lens);
        Some(Self { lens, file, pupil_z_mm, pupil_radius_mm })
    }

    pub(crate) fn at(&self, row: &Value) -> MonoLens {
        self.lens.at(number(&row["wavelength_nm"])).unwrap()
    }

    /// Returns the object point of a row's field.
    pub(crate) fn point(&self, row: &Value) -> ObjectPoint {
        let described = &self.file["lens"];
        let most = number(&described["fields"]["max"]);
        let field = DVec2::from_slice(&numbers(&row["field"]));
        match described["object"]["type"].as_str().unwrap() {
            "infinite" => {
                let slope = |share: f64| (share * most).to_radians().tan();
                ObjectPoint::Infinite(DVec3::new(slope(field.x), slope(field.y), 1.0).normalize())
            }
            _ => ObjectPoint::Finite((field * most).extend(-number(&described["object"]["distance"]))),
        }
    }

    /// Returns where to aim in the entrance-pupil plane for pupil coordinates: fractions of its radius, or of that of
    /// the real stop, which rays of the main wavelength are then made to meet.
    pub(crate) fn target_mm(&self, point: &ObjectPoint, pupil: DVec2) -> DVec2 {
        self.targets_mm(point, [pupil])[0]
    }

    /// The same for many places.
    pub(crate) fn targets_mm(&self, point: &ObjectPoint, pupil: impl IntoIterator<Item = DVec2>) -> Vec<DVec2> {
        if self.file["lens"]["pupil_mode"] == "paraxial_ep" {
            return pupil.into_iter().map(|place| place * self.pupil_radius_mm).collect();
        }
        let mono = self.lens.at(number(&self.file["lens"]["primary_nm"])).unwrap();
        let radius_mm = number(&self.file["lens"]["stop_radius_real_axis"]);
        let wanted: Vec<DVec2> = pupil.into_iter().map(|place| place * radius_mm).collect();
        let misses = |targets: &[DVec2]| -> Vec<DVec2> {
            let mut rays = rays_towards(point, targets, self.pupil_z_mm, 0.0);
            mono.trace_surfaces(0..mono.stop() + 1, &mut rays, Vignetting::Off);
            assert_eq!(rays.n_in_flight(), rays.len(), "an aim is lost");
            (0..rays.len()).map(|i| rays.point_mm(i).truncate() - wanted[i]).collect()
        };
        // The pupil of a wide lens moves with the field; the center of the true one is a good start.
        let start = PupilBoundary::find(&mono, point, 64).unwrap().center_mm();
        let mut targets = vec![start; wanted.len()];
        for _ in 0..40 {
            let here = misses(&targets);
            if here.iter().all(|miss| miss.length() < 1e-13) {
                break;
            }
            let moved = |by: DVec2| misses(&targets.iter().map(|target| target + by * 1e-6).collect::<Vec<_>>());
            let [px, mx, py, my] = [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(moved);
            for i in 0..targets.len() {
                let slopes = DMat2::from_cols((px[i] - mx[i]) / 2e-6, (py[i] - my[i]) / 2e-6);
                let step = slopes.inverse() * here[i];
                if step.length() > 0.0 {
                    targets[i] -= step * (0.3 / step.length()).min(1.0);
                }
            }
        }
        targets
    }
}
