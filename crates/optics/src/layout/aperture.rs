//! How far drawn surfaces reach, and what stands before them.

use std::fmt::Write as _;

use glam::{DVec2, DVec3};

use super::frame::Frame;
use crate::{Aperture, Lens, Placement, Surface};

/// Returns how far a surface reaches down and up in the y–z plane, mm: its rim, or within it its openings.
pub(super) fn extent_mm(lens: &Lens, surface: usize) -> [f64; 2] {
    let rim = round_mm(&lens.interfaces()[surface].surface);
    let openings = lens.apertures_of(surface).filter(|aperture| !aperture.is_obscuration);
    openings.fold(rim, |[low, high], aperture| {
        let [lower, upper] = aperture.bounds_mm().map(|corner| corner.y);
        let (inner_low, inner_high) = (low.max(lower), high.min(upper));
        if inner_low < inner_high { [inner_low, inner_high] } else { [low, high] }
    })
}

/// Returns how far a round rim reaches down and up, mm.
pub(super) fn round_mm(surface: &Surface) -> [f64; 2] {
    [-surface.semi_aperture_mm, surface.semi_aperture_mm]
}

/// Returns the points of a surface from its lower end to its upper one.
pub(super) fn outline(surface: &Surface, placement: &Placement, [low_mm, high_mm]: [f64; 2]) -> Vec<DVec2> {
    const N: i32 = 32;
    let at = |i: i32| {
        // Denser towards the ends, which may lie on the equator to rounding.
        let share = (std::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(N)).sin();
        let y = 0.5 * (low_mm + high_mm) + 0.5 * (high_mm - low_mm) * share;
        let sag_mm = surface.sag_mm(y.abs() * (1.0 - 1e-12));
        let point = placement.lens_from_surface(DVec3::new(0.0, y, if sag_mm.is_finite() { sag_mm } else { 0.0 }));
        DVec2::new(point.z, point.y)
    };
    if surface.curvature_per_mm == 0.0 && surface.sag_mm(high_mm.abs()) == 0.0 {
        return vec![at(-N), at(N)];
    }
    (-N..=N).map(at).collect()
}

/// Returns the radius of the hole in a mirror, mm: of the widest round obscuration about its middle.
pub(super) fn hole_mm(lens: &Lens, mirror: usize) -> Option<f64> {
    let holes = lens.apertures_of(mirror).filter(|aperture| is_hole(lens, aperture));
    holes.map(|hole| hole.outline.bounds_mm()[1].y).reduce(f64::max)
}

/// Whether an obscuration is a hole in a mirror, through which light is lost to the image.
fn is_hole(lens: &Lens, aperture: &Aperture) -> bool {
    aperture.is_obscuration && aperture.is_rotational() && lens.is_mirror(aperture.surface)
}

/// The radius of the fully open stop in a view along the axis, px.
const FRONT_VIEW_PX: f64 = 26.0;

/// Draws the stop as it is seen along the axis, where blades close it: the rim that it has fully open, and the opening; as the
/// photographer sees it from behind the lens.
pub(super) fn iris(lens: &Lens, frame: &Frame, svg: &mut String) {
    let Some(opening) = lens.iris_opening() else { return };
    let middle_px = frame.corner_px() + DVec2::new(-FRONT_VIEW_PX, FRONT_VIEW_PX);
    let px_per_mm = FRONT_VIEW_PX / lens.full_stop_semi_aperture_mm();
    let mut path = String::new();
    for (i, place) in opening.outline_mm(8).into_iter().enumerate() {
        let at = middle_px + DVec2::new(place.x, -place.y) * px_per_mm;
        let _ = write!(path, "{}{:.2} {:.2}", if i == 0 { "M" } else { " L" }, at.x, at.y);
    }
    let (x, y) = (middle_px.x, middle_px.y);
    let _ = writeln!(
        svg,
        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{FRONT_VIEW_PX}\" fill=\"#4d5a66\" stroke=\"#111\"/>\n\
         <path d=\"{path} Z\" fill=\"#ffffff\" stroke=\"#111\" stroke-width=\"0.8\"/>"
    );
}

/// Draws what stands before surfaces.
pub(super) fn obscurations(lens: &Lens, frame: &Frame, svg: &mut String) {
    let placements = lens.placements();
    for aperture in lens.apertures().iter().filter(|aperture| aperture.is_obscuration && !is_hole(lens, aperture)) {
        let [lower, upper] = aperture.bounds_mm().map(|corner| corner.y);
        let surface = &lens.interfaces()[aperture.surface].surface;
        let [low, high] = round_mm(surface);
        let ends = [low.max(lower), high.min(upper)];
        if ends[0] < ends[1] {
            let path = frame.path(outline(surface, &placements[aperture.surface], ends));
            let _ = writeln!(svg, "<path d=\"{path}\" fill=\"none\" stroke=\"#111\" stroke-width=\"3.5\"/>");
        }
    }
}
