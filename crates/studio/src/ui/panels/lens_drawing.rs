//! The lens in its meridional plane, with rays; its film and its surfaces can be dragged.

use std::sync::Arc;

use dioptric_optics::{SurfaceChange, glam::DVec2};
use dioptric_pipeline::{Camera, FocusSpec};
use egui::{Painter, Pos2, Response, Sense, Shape, Stroke, Ui, pos2, vec2};

use super::{
    super::fields::LINES,
    drawing::{Drawing, Frame, STEPS, glass},
    surfaces,
};
use crate::engine::Product;

/// Height of the drawing, points.
const HEIGHT: f32 = 130.0;
/// How near the film or a surface the pointer must be to drag it, points.
const REACH: f32 = 6.0;
/// The share of a surface's half diameter within which it is held at its vertex.
const VERTEX: f64 = 0.4;
/// How far a surface moves of what the pointer does.
const SURFACE_GEAR: f64 = 0.1;

/// What the pointer has hold of, and what it was when it was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Handle {
    /// The film, which lay so far behind the last vertex, mm.
    Film { mm: f64 },
    /// A surface so far off its vertex, mm, which had this curvature.
    Curvature { surface: usize, off_mm: f64, per_mm: f64 },
    /// A surface at its vertex, which lay so far behind the one before it, mm.
    Spacing { surface: usize, mm: f64 },
}

/// Draws the lens of the latest results; its film, the vertices of its surfaces and what lies outside of these can be dragged.
pub(super) fn show(ui: &mut Ui, camera: &mut Camera, product: &Product, key: u64) {
    let size = vec2(ui.available_width(), HEIGHT);
    let (response, painter) = ui.allocate_painter(size, Sense::click_and_drag());
    let drawing = kept(ui, response.id.with("drawing"), key, product);
    let frame = Frame::around(&drawing, response.rect);
    let held = drag(ui, &response, camera, product, &drawing);
    let near = response.hover_pos().and_then(|at| handle_at(ui, at, camera, product, &drawing, &frame));
    let handle = held.or(near);
    if handle.is_some() {
        ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
    }
    paint(ui, &painter, &drawing, &frame, handle);
    if let Some(words) = held.and_then(|held| held_words(ui, held, camera)) {
        let at = response.rect.left_bottom() + vec2(4.0, -3.0);
        painter.text(at, egui::Align2::LEFT_BOTTOM, words, egui::FontId::proportional(11.0), ui.visuals().text_color());
    }
    let response = response.accessible_name("drawing of the lens");
    if held.is_none() {
        response.on_hover_ui(|ui| {
            ui.label(words(product));
        });
    }
}

fn kept(ui: &Ui, id: egui::Id, key: u64, product: &Product) -> Arc<Drawing> {
    if let Some((of, drawing)) = ui.data(|data| data.get_temp::<(u64, Arc<Drawing>)>(id))
        && of == key
    {
        return drawing;
    }
    let drawing = Arc::new(Drawing::of(product));
    ui.data_mut(|data| data.insert_temp(id, (key, drawing.clone())));
    drawing
}

fn paint(ui: &Ui, painter: &Painter, drawing: &Drawing, frame: &Frame, handle: Option<Handle>) {
    let rect = frame.rect;
    let (dark, line) = (ui.visuals().dark_mode, ui.visuals().text_color());
    painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
    let axis = [pos2(rect.left(), frame.y(0.0)), pos2(rect.right(), frame.y(0.0))];
    painter.line_segment(axis, Stroke::new(0.5, ui.visuals().weak_text_color()));
    for (index, points) in &drawing.elements {
        painter.add(Shape::mesh(glass(points, *index, dark, frame)));
    }
    for (field, points) in &drawing.rays {
        let points: Vec<Pos2> = points.iter().map(|at| frame.at(*at)).collect();
        painter.add(Shape::line(points, Stroke::new(0.8, LINES[field % LINES.len()].gamma_multiply(0.8))));
    }
    for (surface, points) in &drawing.surfaces {
        let points: Vec<Pos2> = points.iter().map(|at| frame.at(*at)).collect();
        let is_held = handle.is_some_and(|handle| handle.surface() == Some(*surface));
        painter.add(Shape::line(points, Stroke::new(if is_held { 2.5 } else { 1.0 }, line)));
    }
    for half in drawing.stop {
        painter.line_segment(half.map(|at| frame.at(at)), Stroke::new(2.5, line));
    }
    let film = [-1.0, 1.0].map(|sign| frame.at(DVec2::new(drawing.film_z_mm, sign * drawing.half_film_mm)));
    let is_held = matches!(handle, Some(Handle::Film { .. }));
    painter.line_segment(film, Stroke::new(if is_held { 3.5 } else { 2.0 }, line));
}

impl Handle {
    fn surface(self) -> Option<usize> {
        match self {
            Self::Film { .. } => None,
            Self::Curvature { surface, .. } | Self::Spacing { surface, .. } => Some(surface),
        }
    }
}

/// Returns what can be dragged at a place of the screen.
fn handle_at(
    ui: &Ui,
    at: Pos2,
    camera: &Camera,
    product: &Product,
    drawing: &Drawing,
    frame: &Frame,
) -> Option<Handle> {
    // What is drawn is still another lens.
    let is_same = product.camera().lens.base() == camera.lens.base();
    let prescription = surfaces::prescription(ui, camera).filter(|_| is_same);
    let off_px = |points: &[DVec2]| {
        let pairs = points.windows(2).enumerate();
        let off = pairs.map(|(i, pair)| (i, distance_px(at, [frame.at(pair[0]), frame.at(pair[1])])));
        off.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let nearest = drawing.surfaces.iter().filter_map(|(surface, points)| Some((*surface, off_px(points)?)));
    let nearest = nearest.min_by(|a, b| a.1.1.total_cmp(&b.1.1)).filter(|(_, (_, px))| *px < REACH);
    if let (Some(prescription), Some((surface, (step, _)))) = (prescription, nearest) {
        let half_mm = product.capture.lens.lens.interfaces()[surface].surface.semi_aperture_mm;
        let off_mm = half_mm * (2.0 * (step as f64 + 0.5) / STEPS as f64 - 1.0);
        let at_vertex = surface.checked_sub(1).filter(|_| off_mm.abs() < VERTEX * half_mm);
        return match at_vertex {
            Some(before) => prescription.spacing_mm(before).map(|mm| Handle::Spacing { surface, mm }),
            None => {
                let off_mm = off_mm.abs().max(VERTEX * half_mm);
                let per_mm = prescription.curvature_per_mm(surface);
                per_mm.map(|per_mm| Handle::Curvature { surface, off_mm, per_mm })
            }
        };
    }
    let is_near_film = (at.x - frame.at(DVec2::new(drawing.film_z_mm, 0.0)).x).abs() < REACH;
    is_near_film.then(|| Handle::Film { mm: film_mm(camera, product) })
}

/// Returns the distance of a place from a line between two others.
fn distance_px(at: Pos2, [from, to]: [Pos2; 2]) -> f32 {
    let along = to - from;
    let share = ((at - from).dot(along) / along.length_sq().max(1e-9)).clamp(0.0, 1.0);
    (at - (from + share * along)).length()
}

fn film_mm(camera: &Camera, product: &Product) -> f64 {
    match camera.focus {
        FocusSpec::FilmMm(mm) => mm,
        _ => product.capture.place.film_distance_mm,
    }
}

/// What is held, where it was taken, and the scale there; the drawing may change under the hand.
#[derive(Clone, Copy, Debug)]
struct Hold {
    handle: Handle,
    from: Pos2,
    px_per_mm: f32,
}

/// Takes hold of what is under the pointer, moves it, and returns what is held.
fn drag(ui: &Ui, response: &Response, camera: &mut Camera, product: &Product, drawing: &Drawing) -> Option<Handle> {
    let id = response.id.with("hold");
    if response.drag_started() {
        let frame = Frame::around(drawing, response.rect);
        let hold = ui.input(|input| input.pointer.press_origin()).and_then(|from| {
            let handle = handle_at(ui, from, camera, product, drawing, &frame)?;
            Some(Hold { handle, from, px_per_mm: frame.px_per_mm })
        });
        ui.data_mut(|data| data.insert_temp(id, hold));
    }
    let hold = ui.data(|data| data.get_temp::<Option<Hold>>(id)).flatten().filter(|_| response.dragged())?;
    let moved_mm = f64::from((response.interact_pointer_pos()?.x - hold.from.x) / hold.px_per_mm);
    match hold.handle {
        // A film moves a twentieth of what the pointer does: its places are micrometres apart.
        Handle::Film { mm } if moved_mm != 0.0 => {
            camera.focus = FocusSpec::FilmMm((1e4 * (mm + 0.05 * moved_mm)).round() / 1e4);
        }
        Handle::Curvature { surface, off_mm, per_mm } => {
            // The place that is held moves along, in the parabola that is nearest the sphere.
            let curvature_per_mm = per_mm + SURFACE_GEAR * 2.0 * moved_mm / (off_mm * off_mm);
            let rounded = (1e6 * curvature_per_mm).round() / 1e6;
            let change = SurfaceChange { surface, curvature_per_mm: Some(rounded), thickness_mm: None };
            take(ui, camera, change, moved_mm);
        }
        Handle::Spacing { surface, mm } => {
            let spacing_mm = (1e4 * (mm + SURFACE_GEAR * moved_mm)).round() / 1e4;
            let change = SurfaceChange { surface: surface - 1, curvature_per_mm: None, thickness_mm: Some(spacing_mm) };
            take(ui, camera, change, moved_mm);
        }
        Handle::Film { .. } => {}
    }
    Some(hold.handle)
}

/// Changes the lens where it then still is one.
fn take(ui: &Ui, camera: &mut Camera, change: SurfaceChange, moved_mm: f64) {
    let changed = || surfaces::prescription(ui, camera)?.changed(change);
    if moved_mm != 0.0
        && let Some(lens) = changed()
    {
        camera.lens = lens;
    }
}

/// Returns what is held and its number now.
fn held_words(ui: &Ui, held: Handle, camera: &Camera) -> Option<String> {
    let prescription = surfaces::prescription(ui, camera)?;
    match held {
        Handle::Film { .. } => None,
        Handle::Curvature { surface, .. } => {
            let per_mm = prescription.curvature_per_mm(surface)?;
            let radius = if per_mm == 0.0 { "plane".to_owned() } else { format!("radius {:.3} mm", 1.0 / per_mm) };
            Some(format!("surface {surface}: {radius}"))
        }
        Handle::Spacing { surface, .. } => {
            Some(format!("surfaces {} to {surface}: {:.3} mm", surface - 1, prescription.spacing_mm(surface - 1)?))
        }
    }
}

fn words(product: &Product) -> String {
    let (lens, place) = (&product.capture.lens, &product.capture.place);
    let first = lens.reference.first_order();
    format!(
        "{}: f = {:.2} mm, f/{:.2}{}, film {:.3} mm behind the last vertex{}\nrays of the axis, of 0.6 and of all of the corner's field\n\
         drag the film to focus, a surface near its rim to bend it, near the axis to move it and what lies behind; the lens moves a tenth of what the \
         pointer does, the film a twentieth",
        lens.lens.name(),
        first.efl_mm,
        first.f_number,
        lens.reference.t_number(f64::INFINITY).map_or_else(String::new, |t| format!(" (T/{t:.2})")),
        place.film_distance_mm,
        place.focus_distance_mm.map_or_else(String::new, |mm| format!(", focused on {mm:.0} mm"))
    )
}
