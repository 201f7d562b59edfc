//! The surfaces of a lens in words and numbers.

use std::collections::BTreeSet;

use dioptric_optics::{Blaze, DiffractiveSurface, Glass, Lens, Outline, PhaseProfile, Shape, Surface};
use serde::Serialize;

/// A surface of a lens as a row of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceRow {
    /// 0-based place in the lens.
    pub surface: usize,
    /// Whether it is the stop.
    pub is_stop: bool,
    /// Radius, mm; infinite for a plane. Of a surface that is not one of revolution that along y.
    pub radius_mm: f64,
    /// Distance to the next vertex, mm.
    pub thickness_mm: f64,
    /// What lies behind, or that it is a mirror.
    pub medium_after: String,
    /// Clear diameter, mm.
    pub diameter_mm: f64,
    /// What there is to say of its shape beside the radius, and of its openings, a line each.
    pub remarks: Vec<String>,
}

/// Returns the surfaces of a lens as the rows of a table.
pub fn surface_rows(lens: &Lens) -> Vec<SurfaceRow> {
    let row = |(surface, interface): (usize, &dioptric_optics::Interface)| SurfaceRow {
        surface,
        is_stop: surface == lens.stop(),
        radius_mm: radius_mm(interface.surface.curvature_per_mm),
        thickness_mm: interface.thickness_after_mm,
        medium_after: match (lens.is_mirror(surface), &interface.medium_after) {
            (true, Glass::Air) => "mirror".to_owned(),
            (true, medium) => format!("mirror in {}", medium.describe()),
            (false, medium) => medium.describe(),
        },
        diameter_mm: 2.0 * interface.surface.semi_aperture_mm,
        remarks: {
            let of_shape = shape_summary(&interface.surface).into_iter();
            of_shape.chain(phase_summary(lens, surface)).chain(openings_summary(lens, surface)).collect()
        },
    };
    lens.interfaces().iter().enumerate().map(row).collect()
}

/// Returns what there is to say of the phase that a surface adds.
fn phase_summary(lens: &Lens, surface: usize) -> Option<String> {
    let DiffractiveSurface { order, profile, blaze, .. } =
        lens.diffractive().iter().find(|phase| phase.surface == surface)?;
    let words = match profile {
        PhaseProfile::Grating { lines_per_mm: [x, y] } => {
            format!("grating of {} lines/mm along x and {} along y in the order {order}", short(*x), short(*y))
        }
        PhaseProfile::Rings { radius_mm, coefficients_rad } => {
            let terms = (1..).zip(coefficients_rad).map(|(i, a)| format!("{} ρ^{}", short(*a), 2 * i));
            let sum = terms.collect::<Vec<_>>().join(" + ");
            format!("phase of {sum} rad with ρ = r/{} mm in the order {order}", short(*radius_mm))
        }
        PhaseProfile::Wavefront(error) => {
            let mut stated_nm: Vec<f64> = error.bands.iter().map(|band| band.wavelength_nm).collect();
            stated_nm.sort_by(f64::total_cmp);
            stated_nm.dedup();
            let nm: Vec<String> = stated_nm.iter().map(|nm| short(*nm).to_string()).collect();
            let eye =
                error.chromatic_eye_nm.map_or(String::new(), |nm| format!(", chromatic as the eye about {nm} nm"));
            let fields: BTreeSet<[u64; 2]> = error.bands.iter().map(|band| band.field_deg.map(f64::to_bits)).collect();
            let of_fields = if fields.len() > 1 { format!(" and {} fields", fields.len()) } else { String::new() };
            let (terms, radius_mm, nm) = (error.terms, short(error.radius_mm), nm.join(", "));
            format!("wavefront error of {terms:?} terms over {radius_mm} mm, stated at {nm} nm{of_fields}{eye}")
        }
    };
    Some(match blaze {
        None => words,
        Some(Blaze { design_nm, levels, .. }) => {
            let levels = levels.map_or(String::new(), |levels| format!(" in {levels} levels"));
            format!("{words}, blazed for {design_nm} nm{levels}")
        }
    })
}

/// Returns what there is to say of a lens beside its surfaces: a curved film, tilts and decenters, a line each.
pub fn placement_lines(lens: &Lens) -> Vec<String> {
    let mut lines = Vec::new();
    let film = lens.image_surface();
    if film.curvature_per_mm != 0.0 {
        let conic = if film.conic == 0.0 { String::new() } else { format!(", conic {}", film.conic) };
        lines.push(format!("the film has a radius of {:.4} mm{conic}", radius_mm(film.curvature_per_mm)));
    }
    let n_surfaces = lens.interfaces().len();
    let name = |surface: usize| if surface == n_surfaces { "the film".to_owned() } else { surface.to_string() };
    for step in lens.moves() {
        let (first, last) = step.surfaces;
        let of = if first == last { name(first) } else { format!("{} to {}", name(first), name(last)) };
        let [dx, dy, dz] = step.decenter_mm.map(short);
        let [x, y, z] = step.tilt_deg.map(short);
        let pivot = match short(step.pivot_mm) {
            0.0 => String::new(),
            pivot_mm => format!(", about a point {pivot_mm} mm behind the vertex"),
        };
        let order = if step.tilt_first { " (turned first, about z, y and x)" } else { "" };
        lines.push(format!(
            "moved: {of} by {dx}, {dy}, {dz} mm, turned by {x}, {y}, {z} degrees about x, y and z{pivot}{order}"
        ));
    }
    lines
}

fn radius_mm(curvature_per_mm: f64) -> f64 {
    if curvature_per_mm == 0.0 { f64::INFINITY } else { 1.0 / curvature_per_mm }
}

/// Returns what a shape is beside its radius; nothing for a sphere or a plane.
fn shape_summary(surface: &Surface) -> Option<String> {
    let along_x = |curvature_per_mm: f64| format!("radius {} mm along x", number(radius_mm(curvature_per_mm)));
    Some(match &surface.shape {
        Shape::Sphere => return None,
        Shape::Conic { conic } => format!("conic {}", short(*conic)),
        Shape::EvenAsphere { conic, coefficients } => {
            format!("conic {}{}", short(*conic), terms("r", coefficients, |i| 2 * i + 4))
        }
        Shape::OddAsphere { conic, coefficients } => {
            format!("conic {}{}", short(*conic), terms("r", coefficients, |i| i + 1))
        }
        Shape::ThinLens { power_per_mm } => format!("ideal thin lens of f = {} mm", number(1.0 / power_per_mm)),
        Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
            let (conic_x, conic) = (short(*conic_x), short(*conic));
            format!("biconic: {}, conic {conic_x} along x and {conic} along y", along_x(*curvature_x_per_mm))
        }
        Shape::Toroid { curvature_x_per_mm, conic, coefficients } => {
            let terms = terms("y", coefficients, |i| 2 * i + 2);
            format!("toroid: {}, conic {} along y{terms}", along_x(*curvature_x_per_mm), short(*conic))
        }
        other => format!("{other:?}"),
    })
}

/// Returns a number to seven digits, as single-precision files know it, and no −0.
fn short(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value) + 0.0
}

/// Returns a length with four decimals, or its infinity.
fn number(value: f64) -> String {
    if value.is_finite() { format!("{value:.4}") } else { "inf".to_owned() }
}

/// Returns the terms of a polynomial that are not 0: `, 1.2e-6 r⁴`.
fn terms(variable: &str, coefficients: &[f64], power: impl Fn(usize) -> usize) -> String {
    let raised = |power: usize| {
        let digits = ["⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"];
        power.to_string().bytes().map(|digit| digits[usize::from(digit - b'0')]).collect::<String>()
    };
    let terms = coefficients.iter().enumerate().filter(|(_, a)| **a != 0.0);
    terms.map(|(i, a)| format!(", {:e} {variable}{}", short(*a), raised(power(i)))).collect()
}

fn openings_summary(lens: &Lens, surface: usize) -> Vec<String> {
    let of_surface = lens.apertures().iter().filter(|aperture| aperture.surface == surface);
    let summary = |aperture: &dioptric_optics::Aperture| {
        let what = if aperture.is_obscuration { "obscuration" } else { "opening" };
        let outline = outline_summary(&aperture.outline);
        let place = match aperture.center_mm {
            [0.0, 0.0] => String::new(),
            [x_mm, y_mm] => format!(" about {x_mm}, {y_mm} mm"),
        };
        format!("{what}: {outline}{place}")
    };
    of_surface.map(summary).collect()
}

fn outline_summary(outline: &Outline) -> String {
    match outline {
        Outline::Circle { radius_mm } => format!("circle of {} mm across", 2.0 * radius_mm),
        Outline::Ellipse { half_x_mm, half_y_mm } => {
            format!("ellipse of {} by {} mm", 2.0 * half_x_mm, 2.0 * half_y_mm)
        }
        Outline::Rectangle { half_x_mm, half_y_mm } => {
            format!("rectangle of {} by {} mm", 2.0 * half_x_mm, 2.0 * half_y_mm)
        }
        Outline::Polygon { corners_mm } => format!("polygon of {} corners", corners_mm.len()),
        Outline::Turned { by_deg, outline } => format!("{}, turned by {by_deg}°", outline_summary(outline)),
        Outline::Iris(opening) => format!("iris of {:.4} mm inscribed", 2.0 * opening.inscribed_radius_mm()),
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{LensFile, ReadOptions};

    use super::*;

    #[test]
    fn shapes_openings_and_places_are_reported() {
        let text = r#"(name: "all", source: "test", image_radius_mm: -40.0, surfaces: [
            (radius_mm: 50.0, shape: EvenAsphere(conic: -0.5, coefficients: [1e-6, 0.0, -2e-10]), stop: true,
                semi_aperture_mm: 5.0, medium: Constant(index: 1.5), thickness_mm: 2.0),
            (radius_mm: -60.0, shape: Biconic(conic: 1.0, curvature_x_per_mm: 0.025, conic_x: -2.0),
                semi_aperture_mm: 5.0, thickness_mm: 1.0),
            (shape: Toroid(curvature_x_per_mm: 0.0, conic: 0.0, coefficients: [1e-3]), semi_aperture_mm: 5.0,
                medium: Constant(index: 1.5), thickness_mm: 1.0),
            (radius_mm: 80.0, semi_aperture_mm: 5.0, thickness_mm: 0.0),
        ],
        moves: [(surfaces: (1, 2), tilt_deg: (1.50000001, -0.0, 0.0)), (surfaces: (4, 4), decenter_mm: (0.0, 0.1, 0.0))],
        apertures: [(surface: 3, outline: Rectangle(half_x_mm: 4.0, half_y_mm: 2.0), center_mm: (0.0, 0.5)),
            (surface: 3, outline: Circle(radius_mm: 0.5), is_obscuration: true)])"#;
        let path = std::path::Path::new("all.ron");
        let lens = LensFile::from_bytes(path, text.as_bytes(), &ReadOptions::default()).unwrap().lens;
        let remarks: Vec<String> = surface_rows(&lens).into_iter().flat_map(|row| row.remarks).collect();
        assert_eq!(
            remarks,
            [
                "conic -0.5, 1e-6 r⁴, -2e-10 r⁸",
                "biconic: radius 40.0000 mm along x, conic -2 along x and 1 along y",
                "toroid: radius inf mm along x, conic 0 along y, 1e-3 y²",
                "opening: rectangle of 8 by 4 mm about 0, 0.5 mm",
                "obscuration: circle of 1 mm across",
            ]
        );
        assert_eq!(
            placement_lines(&lens),
            [
                "the film has a radius of -40.0000 mm",
                "moved: 1 to 2 by 0, 0, 0 mm, turned by 1.5, 0, 0 degrees about x, y and z",
                "moved: the film by 0, 0.1, 0 mm, turned by 0, 0, 0 degrees about x, y and z",
            ]
        );
        let plain = Lens::built_in("dgauss-50mm").unwrap();
        let rows = surface_rows(&plain);
        assert_eq!(rows.len(), plain.interfaces().len());
        assert_eq!(rows.iter().filter(|row| row.is_stop).count(), 1);
        assert!(surface_rows(&plain).iter().all(|row| row.remarks.is_empty()) && placement_lines(&plain).is_empty());
    }
}
