//! Drawings of a lens in its meridional plane, as SVG.

mod aperture;
mod frame;

use std::fmt::Write;

use glam::{DVec2, DVec3};

use self::{
    aperture::{extent_mm, outline, round_mm},
    frame::Frame,
};
use crate::{
    Glass, ImageSurface, Lens, MonoLens, ObjectPoint, OpticsError, Placement, PupilBoundary, RayBatch, Shape, Surface,
    Vignetting,
};

/// What a drawing shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// Distance of the object before the first vertex, mm; infinite for a far one.
    pub object_distance_mm: f64,
    /// What is at the film, in a word or two.
    pub film_label: String,
    /// Field angles from which rays come, degrees, positive above the axis; of a far object up to 180.
    pub fields_deg: Vec<f64>,
    /// Wavelengths of the rays, nm. With one field, rays are colored by wavelength; else by field, and dashed by
    /// wavelength.
    pub wavelengths_nm: Vec<f64>,
    /// Rays a field and wavelength.
    pub n_rays: usize,
    /// Width of the picture, px.
    pub width_px: f64,
}

/// Colors of fields, in their order: blue, green, vermilion, orange, pink, dark gray; apart for all eyes (Okabe & Ito).
const FIELD_COLORS: [&str; 6] = ["#0072b2", "#009e73", "#d55e00", "#e69f00", "#cc79a7", "#333333"];
/// Dashes of wavelengths, in their order, where colors stand for fields; the first is a whole line.
const DASHES: [&str; 4] = ["none", "7 3", "2 2", "9 2 2 2"];

impl Lens {
    /// Draws the lens with its stop, its film and rays, and returns the picture as SVG text.
    ///
    /// Each fan of rays fills the true, vignetted pupil of its field at the first wavelength; a point of positive field lies above
    /// the axis, so that its light falls. Of a tilted or decentered lens the section in the y–z plane is drawn.
    ///
    /// # Errors
    /// When there is no wavelength or a glass is not known at one of them.
    pub fn draw(&self, layout: &Layout) -> Result<String, OpticsError> {
        let Some(&reference_nm) = layout.wavelengths_nm.first() else {
            return Err(OpticsError::NotPositive { what: "the number of wavelengths to draw", found: 0.0 });
        };
        let lenses: Vec<MonoLens> = layout.wavelengths_nm.iter().map(|&w| self.at(w)).collect::<Result<_, _>>()?;
        let fans = fans(self, &lenses, layout);
        let frame = Frame::around(self, layout, &fans);
        let mut svg = frame.open(self.name());
        frame.axis(&mut svg);
        elements(self, layout, &frame, &mut svg);
        mirrors(self, &frame, &mut svg);
        for fan in &fans {
            frame.rays(fan, &mut svg);
        }
        stop(self, &frame, &mut svg);
        aperture::obscurations(self, &frame, &mut svg);
        film(self, layout, &fans, &frame, &mut svg);
        let first = self.at(reference_nm)?.first_order();
        let words = match first.power_per_mm == 0.0 {
            true => self.name().to_owned(),
            false => format!("{} · f = {:.2} mm · f/{:.2}", self.name(), first.efl_mm, first.f_number),
        };
        frame.foot(&words, &mut svg);
        frame.keys(&words, layout, &fans, &mut svg);
        svg.push_str("</svg>\n");
        Ok(svg)
    }
}

/// How the rays of a wavelength are distinguished from those of others.
struct WavelengthKey {
    wavelength_nm: f64,
    /// Its own color, where colors do not stand for fields.
    color: Option<String>,
    dashes: &'static str,
}

impl Layout {
    /// The angles of fields that are drawn: beyond them lenses see nothing.
    pub const WIDEST_FIELDS_DEG: std::ops::RangeInclusive<f64> = -120.0..=120.0;

    fn wavelength_keys(&self) -> impl Iterator<Item = WavelengthKey> {
        let has_fields = self.fields_deg.len() > 1;
        self.wavelengths_nm.iter().enumerate().map(move |(i, &wavelength_nm)| WavelengthKey {
            wavelength_nm,
            color: (!has_fields).then(|| wavelength_color(wavelength_nm)),
            dashes: if has_fields { DASHES[i % DASHES.len()] } else { DASHES[0] },
        })
    }
}

/// The rays of one field and wavelength, as lines of (z, y) in mm.
struct Fan {
    /// Its place in the list of fields.
    field: usize,
    color: String,
    dashes: &'static str,
    lines: Vec<Line>,
}

struct Line {
    points: Vec<DVec2>,
    reaches_film: bool,
}

/// Returns the least and the greatest z of all vertices and of the film, mm, along the axis that moves may bend.
fn extent_z_mm(lens: &Lens, layout: &Layout) -> [f64; 2] {
    let ends = lens.vertices_z_mm().into_iter().chain([lens.film_z_mm(layout.film_distance_mm)]);
    ends.fold([0.0; 2], |[low, high], z_mm| [z_mm.min(low), z_mm.max(high)])
}

/// Returns how far before the lens rays are drawn, mm.
fn lead_mm(lens: &Lens, layout: &Layout) -> f64 {
    let [front_mm, back_mm] = extent_z_mm(lens, layout);
    let lead_mm = 0.25 * (back_mm - front_mm) + 0.3 * lens.front_semi_aperture_mm() - front_mm;
    layout.object_distance_mm.min(lead_mm)
}

fn fans(lens: &Lens, lenses: &[MonoLens], layout: &Layout) -> Vec<Fan> {
    let lead_mm = lead_mm(lens, layout);
    let dioptres = 1e3 / (layout.object_distance_mm + lenses[0].projection_center_z_mm());
    let mut fans = Vec::new();
    for (i, &field_deg) in layout.fields_deg.iter().enumerate() {
        let point = match layout.object_distance_mm.is_finite() {
            true => ObjectPoint::from_field(&lenses[0], DVec2::new(0.0, field_deg.to_radians().tan()), dioptres),
            false => ObjectPoint::far(field_deg.to_radians(), DVec2::Y),
        };
        let Some(pupil) = PupilBoundary::find(&lenses[0], &point, 64) else { continue };
        let (low, high) =
            (pupil.rho_max_mm(-std::f64::consts::FRAC_PI_2), pupil.rho_max_mm(std::f64::consts::FRAC_PI_2));
        let n_rays = layout.n_rays.max(1);
        // The outermost rays keep clear of the rims by a hair, for the other wavelengths' sake.
        let share = |ray: usize| if n_rays == 1 { 0.5 } else { 0.005 + 0.99 * ray as f64 / (n_rays - 1) as f64 };
        let height = |ray: usize| pupil.center_mm().y - low + (low + high) * share(ray);
        let targets: Vec<DVec2> = (0..n_rays).map(|ray| DVec2::new(pupil.center_mm().x, height(ray))).collect();
        for (lens, key) in lenses.iter().zip(layout.wavelength_keys()) {
            let rays = pupil.plane().rays(lens, &point, &targets);
            let color = key.color.unwrap_or_else(|| FIELD_COLORS[i % FIELD_COLORS.len()].to_owned());
            fans.push(Fan {
                field: i,
                color,
                dashes: key.dashes,
                lines: follow(lens, rays, lead_mm, layout.film_distance_mm),
            });
        }
    }
    fans
}

fn follow(lens: &MonoLens, mut rays: RayBatch, lead_mm: f64, film_distance_mm: f64) -> Vec<Line> {
    // Steep rays start no further off than a little beyond the widest rim, and all of a fan on one front.
    let rims = (0..lens.n_surfaces()).map(|surface| lens.semi_aperture_mm(surface));
    let extent_mm = 1.5 * rims.fold(0.0, f64::max);
    let heading = (0..rays.len()).map(|i| rays.direction(i)).sum::<DVec3>().normalize_or(DVec3::Z);
    let nearest_start = |i: usize| {
        let (point, direction) = (rays.point_mm(i), rays.direction(i));
        let by_height = (extent_mm - point.y.abs()).max(0.0) / direction.y.abs();
        // Light from behind starts beside the rims.
        let by_lead = if direction.z > 0.0 { lead_mm / direction.z } else { f64::INFINITY };
        heading.dot(point - direction * by_height.min(by_lead))
    };
    let front_mm = (0..rays.len()).map(nearest_start).fold(f64::NEG_INFINITY, f64::max);
    let start = |i: usize| {
        let (point, direction) = (rays.point_mm(i), rays.direction(i));
        let start = point - direction * ((heading.dot(point) - front_mm) / heading.dot(direction));
        Line { points: vec![DVec2::new(start.z, start.y)], reaches_film: false }
    };
    let mut lines: Vec<Line> = (0..rays.len()).map(start).collect();
    let note = |lines: &mut Vec<Line>, rays: &RayBatch, was_in_flight: &[bool]| {
        for (i, line) in lines.iter_mut().enumerate().filter(|(i, _)| was_in_flight[*i]) {
            line.points.push(DVec2::new(rays.z_mm[i], rays.y_mm[i]));
        }
    };
    let in_flight = |rays: &RayBatch| rays.fate.iter().map(|fate| fate.is_in_flight()).collect::<Vec<_>>();
    for surface in 0..lens.n_surfaces() {
        let before = in_flight(&rays);
        lens.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::On);
        note(&mut lines, &rays, &before);
    }
    lens.to_film(&mut rays, film_distance_mm);
    let arrived = in_flight(&rays);
    note(&mut lines, &rays, &arrived);
    for (line, arrived) in lines.iter_mut().zip(arrived) {
        line.reaches_film = arrived;
    }
    lines
}

/// Draws the medium that the object is in, where that is not air, as far as rays are drawn before the lens.
fn object_space(lens: &Lens, layout: &Layout, frame: &Frame, svg: &mut String) {
    let medium = lens.object_medium();
    if *medium == Glass::Air {
        return;
    }
    let front = outline(&lens.interfaces()[0].surface, &lens.placements()[0], extent_mm(lens, 0));
    let back_z_mm = front.iter().map(|point| point.x).fold(f64::INFINITY, f64::min) - lead_mm(lens, layout);
    let ends = [front[front.len() - 1], front[0]].map(|end| DVec2::new(back_z_mm, end.y));
    let (fill, _) = glass_colors(medium);
    let path = frame.path(front.into_iter().chain(ends));
    let _ = writeln!(svg, "<path d=\"{path} Z\" fill=\"{fill}\" fill-opacity=\"0.6\"/>");
}

/// Draws what lies between two surfaces and is not air.
fn elements(lens: &Lens, layout: &Layout, frame: &Frame, svg: &mut String) {
    object_space(lens, layout, frame, svg);
    let (interfaces, placements) = (lens.interfaces(), lens.placements());
    let mut i = 0;
    while i < interfaces.len() {
        let medium = &interfaces[i].medium_after;
        if *medium == Glass::Air {
            i += 1;
            continue;
        }
        // A stop inside the glass does not end the element.
        let is_within = |j: usize| {
            let surface = &interfaces[j].surface;
            surface.curvature_per_mm == 0.0 && interfaces[j].medium_after == *medium
        };
        let last = (i + 1..interfaces.len()).find(|&j| !is_within(j));
        let front = outline(&interfaces[i].surface, &placements[i], extent_mm(lens, i));
        let back = match last {
            Some(j) => outline(&interfaces[j].surface, &placements[j], extent_mm(lens, j)),
            None => {
                let film_z_mm = lens.film_z_mm(layout.film_distance_mm);
                outline(&Surface::plane(1.0), &Placement::centered(film_z_mm), extent_mm(lens, i))
            }
        };
        let rim_mm = front[0].y.abs().max(back[0].y.abs());
        let (fill, stroke) = glass_colors(medium);
        let at_rim = |p: DVec2, sign: f64| DVec2::new(p.x, sign * rim_mm);
        let (f, b) = (front[0].x, back[0].x);
        let mut points = front.clone();
        if lens.is_rotational() {
            points.insert(0, at_rim(DVec2::new(f, 0.0), -1.0));
            points.extend([at_rim(DVec2::new(f, 0.0), 1.0), at_rim(DVec2::new(b, 0.0), 1.0)]);
        }
        points.extend(back.iter().rev());
        if lens.is_rotational() {
            points.push(at_rim(DVec2::new(b, 0.0), -1.0));
        }
        let _ = writeln!(
            svg,
            "<path d=\"{} Z\" fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"1.1\" stroke-linejoin=\"round\"/>",
            frame.path(points)
        );
        i = last.unwrap_or(interfaces.len());
    }
}

/// Draws the mirrors: a thick line each, left open where an obscuration about the middle stands for a hole.
fn mirrors(lens: &Lens, frame: &Frame, svg: &mut String) {
    let placements = lens.placements();
    for &mirror in lens.mirrors() {
        let surface = &lens.interfaces()[mirror].surface;
        let [low, high] = extent_mm(lens, mirror);
        let pieces = match aperture::hole_mm(lens, mirror) {
            Some(hole_mm) if low < -hole_mm && hole_mm < high => vec![[low, -hole_mm], [hole_mm, high]],
            _ => vec![[low, high]],
        };
        for piece in pieces {
            let path = frame.path(outline(surface, &placements[mirror], piece));
            let _ = writeln!(svg, "<path d=\"{path}\" fill=\"none\" stroke=\"#4d5a66\" stroke-width=\"2.6\"/>");
        }
    }
}

/// Tints a glass by its dispersion, crown blue and flint violet, and by its index.
fn glass_colors(glass: &Glass) -> (String, String) {
    let (nd, vd) = glass.nd_vd().unwrap_or((1.5, 60.0));
    let hue = 205.0 + 55.0 * ((60.0 - vd.clamp(25.0, 60.0)) / 35.0);
    let lightness = 93.0 - 22.0 * (nd - 1.45).clamp(0.0, 0.5);
    (hex_of_hsl(hue, 0.6, 0.01 * lightness), hex_of_hsl(hue, 0.35, 0.38))
}

fn stop(lens: &Lens, frame: &Frame, svg: &mut String) {
    let surface = &lens.interfaces()[lens.stop()].surface;
    let sag_mm = surface.sag_mm(surface.semi_aperture_mm * (1.0 - 1e-12));
    let sag_mm = if sag_mm.is_finite() { sag_mm } else { 0.0 };
    let placement = lens.placements()[lens.stop()];
    let length_mm = (0.22 * lens.stop_semi_aperture_mm()).max(10.0 / frame.px_per_mm);
    for sign in [-1.0, 1.0] {
        let inner = sign * surface.semi_aperture_mm;
        let line = frame.path([inner, inner + sign * length_mm].map(|y| {
            let point = placement.lens_from_surface(DVec3::new(0.0, y, sag_mm));
            DVec2::new(point.z, point.y)
        }));
        let _ = writeln!(svg, "<path d=\"{line}\" stroke=\"#111\" stroke-width=\"3\"/>");
    }
    let below_mm = surface.semi_aperture_mm + length_mm;
    let foot = placement.lens_from_surface(DVec3::new(0.0, -below_mm, sag_mm));
    frame.label((frame.x(foot.z), frame.y(foot.y) + 13.0), "middle", "stop", svg);
}

fn film(lens: &Lens, layout: &Layout, fans: &[Fan], frame: &Frame, svg: &mut String) {
    let z_mm = lens.film_z_mm(layout.film_distance_mm);
    let arrived = fans.iter().flat_map(|fan| &fan.lines).filter(|line| line.reaches_film);
    let height = arrived.filter_map(|line| line.points.last()).map(|p| p.y.abs()).fold(0.0, f64::max);
    let half_mm = (1.06 * height).max(8.0 / frame.px_per_mm).min(frame.y_max_mm.max(-frame.y_min_mm));
    let ImageSurface { curvature_per_mm, conic } = lens.image_surface();
    let half_mm = half_mm.min(1.0 / curvature_per_mm.abs());
    let is_backward = lens.is_backward_before(lens.interfaces().len());
    let curvature_per_mm = if is_backward { -curvature_per_mm } else { curvature_per_mm };
    let surface = Surface { curvature_per_mm, shape: Shape::Conic { conic }, semi_aperture_mm: half_mm };
    let points = outline(&surface, &lens.film_motion().after(&Placement::centered(z_mm)), round_mm(&surface));
    let top = points.last().copied().unwrap_or(DVec2::new(z_mm, half_mm));
    let line = frame.path(points);
    let _ = writeln!(svg, "<path d=\"{line}\" fill=\"none\" stroke=\"#111\" stroke-width=\"2\"/>");
    frame.label((frame.x(top.x) + 3.0, frame.y(top.y) - 6.0), "end", &layout.film_label, svg);
}

/// Returns a color that stands for a wavelength, as six hexadecimal digits behind a `#`: the hue of its light, dark enough for lines on white.
pub fn wavelength_color(wavelength_nm: f64) -> String {
    const HUES: [(f64, f64); 7] =
        [(400.0, 270.0), (450.0, 235.0), (490.0, 185.0), (530.0, 130.0), (580.0, 48.0), (620.0, 15.0), (700.0, 0.0)];
    let above = HUES.partition_point(|(nm, _)| *nm < wavelength_nm).clamp(1, HUES.len() - 1);
    let ((w0, h0), (w1, h1)) = (HUES[above - 1], HUES[above]);
    let fraction = ((wavelength_nm - w0) / (w1 - w0)).clamp(0.0, 1.0);
    hex_of_hsl(h0 + (h1 - h0) * fraction, 0.85, 0.42)
}

/// Returns a color of hue (degrees), saturation and lightness as six hexadecimal digits (CSS Color 3, 4.2.4): SVG 1.1 knows no `hsl()`, and what reads
/// no more than that draws it black.
fn hex_of_hsl(hue_deg: f64, saturation: f64, lightness: f64) -> String {
    let spread = saturation * lightness.min(1.0 - lightness);
    let channel = |n: f64| {
        let k = (n + hue_deg / 30.0).rem_euclid(12.0);
        let value = lightness - spread * (k - 3.0).min(9.0 - k).clamp(-1.0, 1.0);
        (255.0 * value).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", channel(0.0), channel(8.0), channel(4.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_are_those_of_css() {
        for (hue, color) in
            [(0.0, "#ff0000"), (120.0, "#00ff00"), (240.0, "#0000ff"), (60.0, "#ffff00"), (300.0, "#ff00ff")]
        {
            assert_eq!(hex_of_hsl(hue, 1.0, 0.5), color);
        }
        assert_eq!(hex_of_hsl(77.0, 0.0, 0.2), "#333333");
        // hsl(30, 60%, 70%): 224, 178.5, 133.
        assert_eq!(hex_of_hsl(30.0, 0.6, 0.7), "#e0b385");
    }

    fn draw(lens: &Lens, degrees: &[f64]) -> String {
        let mono = lens.at(550.0).unwrap();
        let layout = Layout {
            film_distance_mm: mono.film_distance_mm_for(f64::INFINITY).unwrap_or(20.0),
            object_distance_mm: f64::INFINITY,
            film_label: "film".to_owned(),
            fields_deg: degrees.to_vec(),
            wavelengths_nm: vec![550.0],
            n_rays: 5,
            width_px: 900.0,
        };
        lens.draw(&layout).unwrap()
    }

    #[test]
    fn every_built_in_lens_draws_with_its_elements_stop_and_film() {
        for name in Lens::built_in_names() {
            let lens = Lens::built_in(name).unwrap();
            let svg = draw(&lens, &[0.0, 1.0]);
            assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"), "{name}");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
            assert!(svg.contains(name) && svg.contains(" mm</text>"));
            assert_eq!(svg.matches("stroke-width=\"3\"").count(), 2, "{name}: the stop's two blades");
        }
    }

    #[test]
    fn stop_inside_the_glass_leaves_one_element() {
        let svg = draw(&Lens::built_in("paper-2el").unwrap(), &[0.0]);
        assert_eq!(svg.matches(" Z\"").count(), 1);
        let svg = draw(&Lens::built_in("dgauss-50mm").unwrap(), &[0.0]);
        assert_eq!(svg.matches(" Z\"").count(), 6);
    }

    #[test]
    fn tilted_elements_and_curved_films_are_drawn_where_rays_end() {
        let lens = Lens::built_in("singlet-50mm").unwrap();
        let tilt = crate::CoordinateBreak {
            surfaces: (0, 1),
            pivot_mm: 0.0,
            decenter_mm: [0.0; 3],
            tilt_deg: [20.0, 0.0, 0.0],
            tilt_first: false,
        };
        let image_surface = ImageSurface { curvature_per_mm: -0.02, conic: 0.0 };
        let askew = lens.clone().with_moves(vec![tilt]).unwrap().with_image_surface(image_surface).unwrap();
        let (straight, askew) = (draw(&lens, &[0.0, 10.0]), draw(&askew, &[0.0, 10.0]));
        assert!(!askew.contains("NaN") && !askew.contains("inf"), "{askew}");
        assert!(straight.len() + 500 < askew.len(), "the film has more than two points");
    }

    #[test]
    fn pinholes_and_thin_lenses_draw_too() {
        for lens in [Lens::pinhole(0.5).unwrap(), Lens::thin(50.0, 20.0).unwrap()] {
            let svg = draw(&lens, &[0.0, 20.0]);
            assert!(!svg.contains("NaN"), "{svg}");
        }
    }

    #[test]
    fn dark_fields_and_several_wavelengths_are_reported() {
        let lens = Lens::built_in("microscope-20x").unwrap();
        let svg = draw(&lens, &[0.0, 30.0]);
        assert!(svg.contains(">0.0°<") && svg.contains(">30.0° dark<"));
        let layout = Layout {
            film_distance_mm: 36.0,
            object_distance_mm: f64::INFINITY,
            film_label: "film".to_owned(),
            fields_deg: vec![0.0, 5.0],
            wavelengths_nm: vec![450.0, 650.0],
            n_rays: 3,
            width_px: 900.0,
        };
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let svg = lens.draw(&layout).unwrap();
        // A dash for the rays of each field, and one in the key.
        assert!(svg.matches("stroke-dasharray=\"7 3\"").count() == 3 && svg.contains("650 nm"), "{svg}");
        let svg = lens.draw(&Layout { fields_deg: vec![5.0], ..layout }).unwrap();
        assert!(!svg.contains("stroke-dasharray=\"7 3\"") && svg.contains("450 nm"));
    }
}
