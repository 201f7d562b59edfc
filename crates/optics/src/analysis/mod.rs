//! Real-ray analysis: spots, fans, field curvature, distortion, color, illumination and focus.
//!
//! Everything here is computed from exact rays of one [`ObjectPoint`](crate::ObjectPoint) at one wavelength, and holds
//! for any aperture and field. A ray that cannot be found or does not arrive is `None`, never an error.

mod aim;
mod aperture;
mod close_rays;
mod field_grid;
mod field_map;
mod focus;
mod illumination;
mod pupil_light;
mod pupil_places;
mod ray_fan;
mod spot;

pub use aim::StopAim;
pub use aperture::NumericalApertures;
pub use close_rays::{AstigmaticFoci, AxisFoci};
pub use field_grid::StraightMap;
pub use field_map::{Distortion, Projection};
pub use focus::{Autofocus, FocusRays};
pub use illumination::{
    STEEPEST_FIELD_DEG, WIDEST_FIELD_DEG, field_limit_along_deg, field_limit_deg, field_limits_deg,
    projected_solid_angle, projected_solid_angle_onto,
};
pub use pupil_light::{PupilLight, PupilRule};
pub use pupil_places::{PupilCoordinates, PupilSampling, hexapolar, pupil_line};
pub use ray_fan::RayFan;
pub use spot::SpotDiagram;
