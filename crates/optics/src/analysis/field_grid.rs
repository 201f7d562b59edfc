//! Distortion as a grid: where real chief rays land, whatever the symmetry of the lens.

use glam::{DMat2, DVec2};

use crate::{MonoLens, ObjectPoint};

/// Tangent of the field angles from which the scale of small fields is taken: its square is what that errs by, and
/// rounding over it.
const SMALL_TAN: f64 = 1e-4;

/// The straight map of fields to the film that a lens has about the middle of its field.
///
/// It has the different scales of an anamorphic lens along x and y, and what a tilt shears; distortion is what departs
/// from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraightMap {
    /// Where the middle of the field lies on the film, mm, lens frame (the film's own where it is tilted or decentered).
    pub center_mm: DVec2,
    /// Movement on the film, mm, for a unit change of the tangents of the field along x and y.
    pub scale_mm: DMat2,
}

impl StraightMap {
    /// Takes the map from real chief rays of small fields, for points `dioptres` = 1/Z away, on a film `film_distance_mm` behind
    /// the last vertex; `None` if there are no such rays.
    pub fn of(lens: &MonoLens, dioptres: f64, film_distance_mm: f64) -> Option<Self> {
        let chief_mm = |field_tan: DVec2| {
            lens.chief_film_point_mm(&ObjectPoint::from_field(lens, field_tan, dioptres), film_distance_mm)
        };
        let slope_mm = |direction: DVec2| {
            let [ahead_mm, behind_mm] = [SMALL_TAN, -SMALL_TAN].map(|tan| chief_mm(direction * tan));
            Some((ahead_mm? - behind_mm?) / (2.0 * SMALL_TAN))
        };
        let scale_mm = DMat2::from_cols(slope_mm(DVec2::X)?, slope_mm(DVec2::Y)?);
        Some(Self { center_mm: chief_mm(DVec2::ZERO)?, scale_mm })
    }

    /// Returns where a field would land without distortion, mm.
    pub fn at_mm(&self, field_tan: DVec2) -> DVec2 {
        self.center_mm + self.scale_mm * field_tan
    }

    /// Returns the relative distortion of a field whose chief ray lands here: 0.01 for an image 1 % too far from that of
    /// the middle; 0 in the middle.
    pub fn relative(&self, field_tan: DVec2, chief_mm: DVec2) -> f64 {
        let straight_mm = (self.scale_mm * field_tan).length();
        if straight_mm == 0.0 { 0.0 } else { (chief_mm - self.center_mm).length() / straight_mm - 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        CoordinateBreak, Glass, Interface, Lens, Shape, Surface,
        analysis::{AstigmaticFoci, AxisFoci, Distortion, Projection},
    };

    #[test]
    fn a_round_lens_has_its_paraxial_scale_and_distortion() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let film_distance_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let map = StraightMap::of(&lens, 0.0, film_distance_mm).unwrap();
        let expected = DMat2::from_diagonal(DVec2::splat(-lens.first_order().efl_mm));
        // Distortion over small fields: 1e-8 of the field squared, times some.
        assert!((map.scale_mm - expected).abs().to_cols_array().iter().all(|v| *v < 1e-5), "{map:?}");
        assert!(map.center_mm.length() < 1e-12);
        let tan = DVec2::new(0.12, 0.16);
        let point = ObjectPoint::from_field(&lens, tan, 0.0);
        let found = map.relative(tan, lens.chief_film_point_mm(&point, film_distance_mm).unwrap());
        let round = Distortion::of(&lens, (0.2, 0.0), film_distance_mm, Projection::Tangent).unwrap().relative();
        assert!((found - round).abs() < 1e-7, "{found} {round}");
    }

    /// A biconic singlet with the stop before it, stronger along x than along y.
    fn anamorphic() -> Lens {
        let shape = Shape::Biconic { conic: 0.0, curvature_x_per_mm: 0.03, conic_x: 0.0 };
        let row = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
        let front = Surface { curvature_per_mm: 0.01, shape, semi_aperture_mm: 8.0 };
        let glass = Glass::Constant { index: 1.5 };
        let rows = vec![
            row(Surface::plane(1.0), Glass::Air, 2.0),
            row(front, glass, 3.0),
            row(Surface::plane(8.0), Glass::Air, 0.0),
        ];
        Lens::new("anamorphic", "test", rows, 0).unwrap()
    }

    #[test]
    fn an_anamorphic_lens_has_two_scales_and_two_foci() {
        let lens = anamorphic().at(550.0).unwrap();
        let [first_y, first_x] = [lens.first_order(), lens.first_order_x()];
        let foci = AxisFoci::find(&lens, &ObjectPoint::from_field(&lens, DVec2::ZERO, 0.0)).unwrap();
        assert!((foci.x_mm / first_x.bfl_mm - 1.0).abs() < 1e-9 && (foci.y_mm / first_y.bfl_mm - 1.0).abs() < 1e-9);
        assert!((lens.conjugate_x(f64::INFINITY).image_z_mm / first_x.bfl_mm - 1.0).abs() < 1e-14);
        // In the rear focal plane of one direction the scale along it is its focal length.
        for (film_distance_mm, axis, efl_mm) in
            [(first_x.bfl_mm, 0, first_x.efl_mm), (first_y.bfl_mm, 1, first_y.efl_mm)]
        {
            let map = StraightMap::of(&lens, 0.0, film_distance_mm).unwrap();
            assert!((map.scale_mm.col(axis)[axis] / -efl_mm - 1.0).abs() < 1e-6, "{map:?} {efl_mm}");
            assert!(map.scale_mm.col(0).y.abs() < 1e-9 && map.scale_mm.col(1).x.abs() < 1e-9);
        }
        // In the planes of symmetry close rays stay in them: Coddington's foci are those of the axes.
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.0, 0.2), 0.0);
        let (axes, planes) = (AxisFoci::find(&lens, &point).unwrap(), AstigmaticFoci::find(&lens, &point).unwrap());
        assert!((axes.y_mm - planes.tangential_mm).abs() < 1e-9 && (axes.x_mm - planes.sagittal_mm).abs() < 1e-9);
    }

    #[test]
    fn a_film_tilted_with_the_whole_lens_sees_nothing_of_it() {
        let straight = Lens::built_in("tessar-50mm").unwrap();
        let n = straight.interfaces().len();
        let turn = CoordinateBreak {
            surfaces: (0, n),
            pivot_mm: 0.0,
            decenter_mm: [0.0; 3],
            tilt_deg: [4.0, -3.0, 0.0],
            tilt_first: false,
        };
        let turned = straight.clone().with_moves(vec![turn]).unwrap();
        let (straight, turned) = (straight.at(550.0).unwrap(), turned.at(550.0).unwrap());
        let placement = turned.film_placement(0.0);
        for tan in [DVec2::ZERO, DVec2::new(0.1, -0.05)] {
            let direction = glam::DVec3::new(-tan.x, -tan.y, 1.0).normalize();
            let here = ObjectPoint::Infinite(direction);
            let there = ObjectPoint::Infinite(placement.rotation * direction);
            let chief = |lens: &MonoLens, point| lens.chief_film_point_mm(point, 46.0).unwrap();
            let apart_mm = chief(&straight, &here) - chief(&turned, &there);
            assert!(apart_mm.length() < 1e-9, "{apart_mm}");
            let foci = [AxisFoci::find(&straight, &here).unwrap(), AxisFoci::find(&turned, &there).unwrap()];
            // The pupil's x and y are those of a plane that did not turn: only the axial point has its own foci.
            if tan == DVec2::ZERO {
                assert!((foci[0].x_mm - foci[1].x_mm).abs() < 1e-7 && (foci[0].y_mm - foci[1].y_mm).abs() < 1e-7);
            }
        }
    }
}
