//! The picture in the middle: zoomed, moved, pointed at.

use egui::{Color32, Painter, Pos2, Rect, Response, Sense, Stroke, TextureHandle, Ui, pos2, vec2};

/// How the picture lies in its place.
#[derive(Clone, Debug)]
pub(in crate::ui) struct Placement {
    /// Points of the screen a pixel of the full film; `None` fits the picture into its place.
    pub(in crate::ui) zoom: Option<f32>,
    /// The share of the picture that lies in the middle.
    pub(in crate::ui) middle: [f64; 2],
    /// Points of the screen a pixel as it was drawn last, and where all of the picture just fits.
    drawn: (f32, f32),
}

impl Default for Placement {
    fn default() -> Self {
        Self { zoom: None, middle: [0.5; 2], drawn: (1.0, 1.0) }
    }
}

impl Placement {
    /// Zooms, a place of the picture coming to lie in the middle.
    pub(in crate::ui) fn zoom_by(&mut self, factor: f32, place: [f64; 2]) {
        let (scale, fit) = self.drawn;
        let next = (scale * factor).min(MOST_ZOOM);
        (self.zoom, self.middle) = if next <= fit { (None, [0.5; 2]) } else { (Some(next), place) };
    }
}

/// The most points of the screen a pixel.
const MOST_ZOOM: f32 = 40.0;

/// What was done with the picture.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ui) struct Pointed {
    /// Where the pointer is, as shares of width and height.
    pub(in crate::ui) hover: Option<[f64; 2]>,
    /// Where it was clicked.
    pub(in crate::ui) click: Option<[f64; 2]>,
    /// The rectangle that was dragged with Shift, from corner to corner.
    pub(in crate::ui) dragged: Option<[[f64; 2]; 2]>,
}

/// Shows an image of a film of so many pixels.
pub(in crate::ui) fn show(
    ui: &mut Ui,
    placement: &mut Placement,
    texture: &TextureHandle,
    film: [usize; 2],
    marks: &Marks,
) -> Pointed {
    let (response, painter) = ui.allocate_painter(ui.available_size(), Sense::click_and_drag());
    let response = response.accessible_name("picture");
    let place = response.rect;
    let film_size = vec2(film[0] as f32, film[1] as f32);
    let fit = (place.width() / film_size.x).min(place.height() / film_size.y).max(1e-6);
    let shown_scale = placement.zoom.unwrap_or(fit);
    move_about(ui, &response, placement, shown_scale, film_size, fit);
    let scale = placement.zoom.unwrap_or(fit);
    placement.drawn = (scale, fit);
    let shown = rect_of(place, placement, scale, film_size);
    painter.rect_filled(place, 0.0, ui.visuals().extreme_bg_color);
    painter.with_clip_rect(place).image(
        texture.id(),
        shown,
        Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)),
        Color32::WHITE,
    );
    let share =
        |at: Pos2| [f64::from((at.x - shown.left()) / shown.width()), f64::from((at.y - shown.top()) / shown.height())];
    let inside = |at: &Pos2| shown.contains(*at) && place.contains(*at);
    let mut pointed = Pointed {
        hover: response.hover_pos().filter(inside).map(share),
        click: response.clicked().then(|| response.interact_pointer_pos()).flatten().filter(inside).map(share),
        dragged: None,
    };
    let start_id = response.id.with("start");
    let has_shift = ui.input(|input| input.modifiers.shift);
    if response.drag_started() && has_shift {
        let start = ui.input(|input| input.pointer.press_origin());
        ui.data_mut(|data| data.insert_temp(start_id, start));
    }
    if let (Some(Some(from)), Some(to)) =
        (ui.data(|data| data.get_temp::<Option<Pos2>>(start_id)), response.interact_pointer_pos())
    {
        pointed.dragged = Some([share(from), share(to)]);
        if response.drag_stopped() {
            ui.data_mut(|data| data.remove_temp::<Option<Pos2>>(start_id));
        }
    }
    marks.paint(&painter.with_clip_rect(place), shown, ui.visuals().hyperlink_color);
    pointed
}

/// Marks over the picture.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ui) struct Marks {
    /// Where the point spread is taken.
    pub(in crate::ui) cursor: Option<[f64; 2]>,
    /// The rectangle of the edge.
    pub(in crate::ui) region: Option<[[f64; 2]; 2]>,
}

impl Marks {
    fn paint(&self, painter: &Painter, shown: Rect, color: Color32) {
        let at = |share: [f64; 2]| shown.lerp_inside(vec2(share[0] as f32, share[1] as f32));
        // Twice, so that it is seen on dark and on light.
        for (width, color) in [(3.0, Color32::from_black_alpha(160)), (1.0, Color32::WHITE)] {
            let stroke = Stroke::new(width, color);
            if let Some(cursor) = self.cursor.map(at) {
                for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                    painter.line_segment([cursor + 4.0 * vec2(dx, dy), cursor + 10.0 * vec2(dx, dy)], stroke);
                }
            }
        }
        if let Some([from, to]) = self.region {
            let region = Rect::from_two_pos(at(from), at(to));
            painter.rect_stroke(region, 0.0, Stroke::new(1.5, color), egui::StrokeKind::Middle);
        }
    }
}

fn rect_of(place: Rect, placement: &Placement, scale: f32, film_size: egui::Vec2) -> Rect {
    let size = scale * film_size;
    let middle = vec2(placement.middle[0] as f32, placement.middle[1] as f32);
    Rect::from_min_size(place.center() - middle * size, size)
}

/// Zooms with the wheel about the pointer, moves by dragging; a double click fits the picture again.
fn move_about(ui: &Ui, response: &Response, placement: &mut Placement, scale: f32, film_size: egui::Vec2, fit: f32) {
    if response.double_clicked() {
        *placement = Placement::default();
        return;
    }
    let has_shift = ui.input(|input| input.modifiers.shift);
    if response.dragged() && !has_shift && placement.zoom.is_some() {
        let moved = response.drag_delta() / (scale * film_size);
        placement.middle[0] = (placement.middle[0] - f64::from(moved.x)).clamp(0.0, 1.0);
        placement.middle[1] = (placement.middle[1] - f64::from(moved.y)).clamp(0.0, 1.0);
    }
    let Some(pointer) = response.hover_pos() else { return };
    let (wheel, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
    let factor = pinch * (0.004 * wheel).exp();
    if (factor - 1.0).abs() < 1e-4 {
        return;
    }
    let next = (scale * factor).clamp(0.5 * fit, MOST_ZOOM);
    if next <= fit {
        *placement = Placement::default();
        return;
    }
    // What lies under the pointer stays there.
    let from_center = (pointer - response.rect.center()) / film_size;
    let change = from_center * (1.0 / scale - 1.0 / next);
    placement.middle[0] = (placement.middle[0] + f64::from(change.x)).clamp(0.0, 1.0);
    placement.middle[1] = (placement.middle[1] + f64::from(change.y)).clamp(0.0, 1.0);
    placement.zoom = Some(next);
}
