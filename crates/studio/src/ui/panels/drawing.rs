//! What is drawn of a lens: elements, surfaces, stop, rays and film, in its meridional plane.

use dioptric_optics::{
    Glass, Lens, MonoLens, ObjectPoint, Placement, PupilBoundary, RayBatch, Surface, Vignetting,
    glam::{DVec2, DVec3},
};
use egui::{Color32, Mesh, Pos2, Rect, epaint::Vertex, pos2};

use crate::engine::Product;

/// Rays of a field.
const RAYS: usize = 7;
/// Steps along the outline of a surface.
pub(super) const STEPS: usize = 24;
/// Fields as shares of the film's corner.
const FIELDS: [f64; 3] = [0.0, 0.6, 1.0];

/// What is drawn, in mm along and across the axis.
#[derive(Clone, Default)]
pub(super) struct Drawing {
    /// Elements of glass: pairs of points, front and back, from bottom to top.
    pub(super) elements: Vec<(f64, Vec<[DVec2; 2]>)>,
    /// Lines of surfaces, each with its number.
    pub(super) surfaces: Vec<(usize, Vec<DVec2>)>,
    /// The two halves of the stop, from its rim outwards.
    pub(super) stop: [[DVec2; 2]; 2],
    /// Rays, each with the number of its field.
    pub(super) rays: Vec<(usize, Vec<DVec2>)>,
    pub(super) film_z_mm: f64,
    pub(super) half_film_mm: f64,
}

/// From millimetres to points of the screen.
pub(super) struct Frame {
    pub(super) rect: Rect,
    left_mm: f64,
    pub(super) px_per_mm: f32,
}

impl Frame {
    pub(super) fn around(drawing: &Drawing, rect: Rect) -> Self {
        let all = || {
            let surfaces = drawing.surfaces.iter().flat_map(|(_, points)| points);
            surfaces.chain(drawing.rays.iter().flat_map(|(_, points)| points)).copied()
        };
        let (left, right) =
            all().fold((0.0, drawing.film_z_mm), |(left, right), at: DVec2| (at.x.min(left), at.x.max(right)));
        let half = all().map(|at| at.y.abs()).fold(drawing.half_film_mm, f64::max);
        let by_width = f64::from(rect.width() - 12.0) / (right - left).max(1e-6);
        let by_height = f64::from(rect.height() - 10.0) / (2.0 * half).max(1e-6);
        let px_per_mm = by_width.min(by_height);
        let spare = 0.5 * (f64::from(rect.width()) / px_per_mm - (right - left));
        Self { rect, left_mm: left - spare, px_per_mm: px_per_mm as f32 }
    }

    pub(super) fn at(&self, place_mm: DVec2) -> Pos2 {
        pos2(self.rect.left() + self.px_per_mm * (place_mm.x - self.left_mm) as f32, self.y(place_mm.y))
    }

    pub(super) fn y(&self, y_mm: f64) -> f32 {
        self.rect.center().y - self.px_per_mm * y_mm as f32
    }
}

pub(super) fn glass(points: &[[DVec2; 2]], index: f64, dark: bool, frame: &Frame) -> Mesh {
    // Denser glass is drawn deeper.
    let depth = ((index - 1.45) / 0.5).clamp(0.0, 1.0) as f32;
    let color = match dark {
        true => Color32::from_rgba_unmultiplied(120, 170, 230, 40 + (60.0 * depth) as u8),
        false => Color32::from_rgba_unmultiplied(60, 120, 200, 30 + (50.0 * depth) as u8),
    };
    let mut mesh = Mesh::default();
    for (i, pair) in points.iter().enumerate() {
        for at in pair {
            mesh.vertices.push(Vertex { pos: frame.at(*at), uv: egui::epaint::WHITE_UV, color });
        }
        if i > 0 {
            let first = 2 * (i as u32 - 1);
            mesh.add_triangle(first, first + 1, first + 2);
            mesh.add_triangle(first + 1, first + 2, first + 3);
        }
    }
    mesh
}

impl Drawing {
    pub(super) fn of(product: &Product) -> Self {
        let (lens, mono, place) = (&product.capture.lens.lens, &product.capture.lens.reference, &product.capture.place);
        let placements = lens.placements();
        let interfaces = lens.interfaces();
        let half_mm = |i: usize| 0.999 * interfaces[i].surface.semi_aperture_mm;
        let mut drawing = Self {
            film_z_mm: lens.film_z_mm(place.film_distance_mm),
            half_film_mm: 0.5e-3 * place.pixel_pitch_um() * product.film_size()[1] as f64,
            ..Self::default()
        };
        for (i, interface) in interfaces.iter().enumerate() {
            if i != lens.stop() || interface.surface.curvature_per_mm != 0.0 {
                drawing.surfaces.push((i, outline(&interface.surface, &placements[i], half_mm(i))));
            }
            if interface.medium_after == Glass::Air || i + 1 == interfaces.len() {
                continue;
            }
            let half = half_mm(i).min(half_mm(i + 1));
            let front = outline(&interface.surface, &placements[i], half);
            let back = outline(&interfaces[i + 1].surface, &placements[i + 1], half);
            let index = interface.medium_after.nd_vd().map_or(1.5, |(nd, _)| nd);
            drawing.elements.push((index, front.into_iter().zip(back).map(|(front, back)| [front, back]).collect()));
        }
        let stop_mm = lens.stop_semi_aperture_mm();
        let widest_mm = (0..interfaces.len()).map(half_mm).fold(stop_mm, f64::max);
        drawing.stop = [-1.0, 1.0].map(|sign| {
            [stop_mm, (stop_mm + 0.2 * widest_mm).max(1.05 * widest_mm)].map(|y_mm| {
                let at = placements[lens.stop()].lens_from_surface(DVec3::new(0.0, sign * y_mm, 0.0));
                DVec2::new(at.z, at.y)
            })
        });
        drawing.rays = rays(lens, mono, product);
        drawing
    }
}

fn outline(surface: &Surface, placement: &Placement, half_mm: f64) -> Vec<DVec2> {
    (0..=STEPS)
        .map(|i| {
            let y_mm = half_mm * (2.0 * i as f64 / STEPS as f64 - 1.0);
            let at = placement.lens_from_surface(DVec3::new(0.0, y_mm, surface.sag_at_mm(0.0, y_mm)));
            DVec2::new(at.z, at.y)
        })
        .filter(|at| at.is_finite())
        .collect()
}

/// Returns the rays of a few fields from before the lens to the film.
fn rays(lens: &Lens, mono: &MonoLens, product: &Product) -> Vec<(usize, Vec<DVec2>)> {
    let place = &product.capture.place;
    let corner_mm = product.film_corner_mm();
    let corner_tan = product
        .field_at_radius(corner_mm)
        .unwrap_or_else(|| corner_mm / mono.film_scale_mm(place.film_distance_mm).abs());
    let distance_mm = place.focus_distance_mm.unwrap_or(f64::INFINITY);
    let dioptres = 1e3 / (distance_mm + mono.projection_center_z_mm());
    let lead_mm = 0.35 * lens.last_vertex_z_mm().abs().max(lens.front_semi_aperture_mm());
    let mut lines = Vec::new();
    for (field, share) in FIELDS.iter().enumerate() {
        let point = ObjectPoint::from_field(mono, DVec2::new(0.0, -share * corner_tan), dioptres);
        let Some(pupil) = PupilBoundary::find(mono, &point, 32) else { continue };
        let (low, high) =
            (pupil.rho_max_mm(-std::f64::consts::FRAC_PI_2), pupil.rho_max_mm(std::f64::consts::FRAC_PI_2));
        let height = |i: usize| pupil.center_mm().y - low + (low + high) * (0.01 + 0.98 * i as f64 / (RAYS - 1) as f64);
        let targets: Vec<DVec2> = (0..RAYS).map(|i| DVec2::new(pupil.center_mm().x, height(i))).collect();
        let mut batch = pupil.plane().rays(mono, &point, &targets);
        let mut paths: Vec<Vec<DVec2>> = (0..RAYS)
            .map(|i| {
                let (from, direction) = (batch.point_mm(i), batch.direction(i));
                let start = from + direction * ((-lead_mm - from.z) / direction.z);
                vec![DVec2::new(start.z, start.y)]
            })
            .collect();
        let note = |paths: &mut [Vec<DVec2>], batch: &RayBatch| {
            for (i, path) in paths.iter_mut().enumerate().filter(|(i, _)| batch.fate[*i].is_in_flight()) {
                let at = batch.point_mm(i);
                path.push(DVec2::new(at.z, at.y));
            }
        };
        for surface in 0..mono.n_surfaces() {
            mono.trace_surfaces(surface..surface + 1, &mut batch, Vignetting::On);
            note(&mut paths, &batch);
        }
        mono.to_film(&mut batch, place.film_distance_mm);
        note(&mut paths, &batch);
        lines.extend(paths.into_iter().map(|path| (field, path)));
    }
    lines
}
