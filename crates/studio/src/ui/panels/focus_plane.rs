//! The space before the lens, even steps in dioptres: where the scene lies, and the plane of focus, which can be dragged.

use std::sync::Arc;

use dioptric_pipeline::{Camera, FocusSpec};
use egui::{Align2, FontId, Painter, Rect, Sense, Stroke, Ui, pos2, vec2};

use super::super::fields::LINES;
use crate::engine::{Product, three};

/// Height of the drawing, points.
const HEIGHT: f32 = 46.0;
/// Steps of depth in which the scene is drawn.
const BINS: usize = 64;
/// What is drawn reaches so many times as near as the scene does.
const REACH: f64 = 1.6;
/// Space at the sides, points.
const MARGIN: f32 = 10.0;

/// Where the scene lies.
#[derive(Clone, Debug)]
struct Depths {
    /// The nearest that is drawn, dioptres.
    nearest: f64,
    /// The share of the scene's samples in each step from far away on, 1 for most.
    shares: [f32; BINS],
}

impl Depths {
    fn of(product: &Product) -> Self {
        let (near_m, _) = product.depth.range_m();
        let nearest = REACH / near_m.max(1e-6);
        let mut shares = [0.0_f32; BINS];
        for z_m in product.depth.z_m() {
            let bin = (BINS as f64 / (f64::from(*z_m) * nearest)) as usize;
            shares[bin.min(BINS - 1)] += 1.0;
        }
        let most = shares.iter().copied().fold(1.0, f32::max);
        shares.iter_mut().for_each(|share| *share /= most);
        Self { nearest, shares }
    }
}

/// Draws the scene's depths and the plane of focus; dragging it focuses.
pub(super) fn show(ui: &mut Ui, camera: &mut Camera, product: &Product, stamp: u64) {
    // Of the first vertex; the scene's depths count from the entrance pupil.
    let pupil_mm = product.capture.lens.reference.projection_center_z_mm();
    let distance_mm = match camera.focus {
        FocusSpec::DistanceMm(mm) => Some(mm),
        _ => product.capture.place.focus_distance_mm,
    };
    let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), HEIGHT), Sense::drag());
    let depths = kept(ui, response.id.with("depths"), stamp, product);
    let scale = Scale { rect: response.rect, nearest: depths.nearest };
    drag(ui, &response, camera, (distance_mm, pupil_mm), depths.nearest / scale.width());
    paint(ui, &painter, &depths, &scale);
    let color = if response.hovered() || response.dragged() { LINES[1] } else { ui.visuals().text_color() };
    if let Some(here) = distance_mm.map(|mm| scale.x(1e3 / (mm + pupil_mm))) {
        let ends = [pos2(here, response.rect.top() + 2.0), pos2(here, scale.floor())];
        painter.line_segment(ends, Stroke::new(2.5, color));
    }
    let words = distance_mm.map_or_else(
        || "The film is where nothing is in focus".to_owned(),
        |mm| format!("The plane of focus lies {} m before the lens", three(1e-3 * mm)),
    );
    let words = format!("{words}; drag it to focus\nblue: how much of the scene lies where; even steps in dioptres");
    response.accessible_name("plane of focus").on_hover_text(words);
}

/// From dioptres to points of the screen.
struct Scale {
    rect: Rect,
    nearest: f64,
}

impl Scale {
    fn width(&self) -> f64 {
        f64::from(self.rect.width() - 2.0 * MARGIN)
    }

    fn x(&self, dioptres: f64) -> f32 {
        self.rect.left() + MARGIN + (self.width() * (dioptres / self.nearest).clamp(0.0, 1.0)) as f32
    }

    /// Where the scene's depths stand, above the distances.
    fn floor(&self) -> f32 {
        self.rect.bottom() - 14.0
    }
}

/// Draws how much of the scene lies where, and distances.
fn paint(ui: &Ui, painter: &Painter, depths: &Depths, scale: &Scale) {
    let (rect, floor) = (scale.rect, scale.floor());
    painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
    for (bin, share) in depths.shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
        let [from, to] = [bin, bin + 1].map(|bin| scale.x(depths.nearest * bin as f64 / BINS as f64));
        // The root lets what is rare be seen.
        let top = floor - (floor - rect.top() - 4.0) * share.sqrt();
        painter.rect_filled(Rect::from_x_y_ranges(from..=to, top..=floor), 0.0, LINES[5].gamma_multiply(0.45));
    }
    let weak = ui.visuals().weak_text_color();
    let write = |at: f32, align: Align2, text: String| {
        painter.text(pos2(at, rect.bottom() - 1.0), align, text, FontId::proportional(9.0), weak);
    };
    write(rect.left() + 3.0, Align2::LEFT_BOTTOM, "∞".to_owned());
    for share in [0.25, 0.5, 0.75, 1.0] {
        let dioptres = share * depths.nearest;
        let align = if share < 1.0 { Align2::CENTER_BOTTOM } else { Align2::RIGHT_BOTTOM };
        write(scale.x(dioptres), align, format!("{} m", three(1.0 / dioptres)));
    }
}

fn kept(ui: &Ui, id: egui::Id, stamp: u64, product: &Product) -> Arc<Depths> {
    if let Some((of, depths)) = ui.data(|data| data.get_temp::<(u64, Arc<Depths>)>(id))
        && of == stamp
    {
        return depths;
    }
    let depths = Arc::new(Depths::of(product));
    ui.data_mut(|data| data.insert_temp(id, (stamp, depths.clone())));
    depths
}

/// Focuses by what the plane is dragged from where it was.
fn drag(ui: &Ui, response: &egui::Response, camera: &mut Camera, (now_mm, pupil_mm): (Option<f64>, f64), per_px: f64) {
    if response.hovered() {
        ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
    }
    let moved = f64::from(response.drag_delta().x);
    if !response.dragged() || moved == 0.0 {
        return;
    }
    // Where the pointer leads, kept exactly: the distance is a rounded one.
    let id = response.id.with("dioptres");
    let start = now_mm.map_or(0.0, |mm| 1e3 / (mm + pupil_mm));
    let before = if response.drag_started() { None } else { ui.data(|data| data.get_temp::<f64>(id)) };
    let dioptres = (before.unwrap_or(start) + moved * per_px).max(0.0);
    ui.data_mut(|data| data.insert_temp(id, dioptres));
    let distance_mm = 1e3 / dioptres - pupil_mm;
    let is_far = dioptres < 0.5 * per_px;
    camera.focus = FocusSpec::DistanceMm(match is_far {
        true => f64::INFINITY,
        false => format!("{:.3e}", distance_mm.max(1.0)).parse().unwrap_or(distance_mm),
    });
}
