//! Plots over areas: path differences over the stop, and distortion over the field.

use dioptric_analysis::{GRID_LINES, OpdMap};

use super::{
    AnalysisPlots,
    page::{HEAD_PX, MARGIN_PX, half_range},
};
use crate::{panel::Mark, panel::MarkKind, panel::Panel, panel::Sheet};

/// Size of a map and of its color bar, px.
const MAP_PX: [f64; 2] = [250.0, 248.0];
const BAR_PX: f64 = 82.0;
/// Size of the grid of fields, px.
const GRID_PX: f64 = 620.0;
/// Cells of a drawn map over those of the computed one, each way.
const FINER: usize = 3;
/// Steps of color to each side of white.
const LEVELS: i32 = 20;
/// Colors from early to late light: equal steps between these.
const EARLY_TO_LATE: [[f64; 3]; 7] = [
    [5.0, 48.0, 97.0],
    [33.0, 102.0, 172.0],
    [146.0, 197.0, 222.0],
    [247.0, 247.0, 247.0],
    [244.0, 165.0, 130.0],
    [178.0, 24.0, 43.0],
    [103.0, 0.0, 31.0],
];

impl AnalysisPlots<'_> {
    /// Returns maps of the optical path difference over the stop as SVG, a row a field with its color bar, and a column a
    /// wavelength.
    pub fn opd_svg(&self) -> String {
        let n_wavelengths = self.0.wavelengths_nm.len().max(1);
        let mut sheet = Sheet::default();
        self.head(&mut sheet, "optical path differences over the stop");
        for (row, maps) in self.0.opd_maps.chunks(n_wavelengths).enumerate() {
            let half = half_range(maps.iter().flat_map(|map| &map.waves).flatten().copied());
            let y = HEAD_PX + MAP_PX[1] * row as f64;
            for (column, map) in maps.iter().enumerate() {
                let x = MARGIN_PX + MAP_PX[0] * column as f64;
                sheet.panel(&map_panel(map, half), [x, y, MAP_PX[0], MAP_PX[1]]);
            }
            let x = MARGIN_PX + MAP_PX[0] * maps.len() as f64;
            sheet.panel(&color_bar(half), [x, y, BAR_PX, MAP_PX[1]]);
        }
        let rows = self.0.opd_maps.len().div_ceil(n_wavelengths) as f64;
        let width = (2.0 * MARGIN_PX + MAP_PX[0] * n_wavelengths as f64 + BAR_PX).max(900.0);
        sheet.to_svg(width, HEAD_PX + MAP_PX[1] * rows + MARGIN_PX)
    }

    /// Returns the grid of chief rays on the film over the grid that a lens without distortion would have, as SVG.
    pub fn grid_svg(&self) -> String {
        let mut sheet = Sheet::default();
        self.head(&mut sheet, "distortion");
        let found: Vec<Option<[f64; 2]>> = self.0.grid.iter().map(|row| row.image_mm).collect();
        let straight: Vec<Option<[f64; 2]>> = self.0.grid.iter().map(|row| Some(row.straight_mm)).collect();
        let reach = |axis: usize| {
            let places = found.iter().chain(&straight).flatten();
            let ends = places.fold((f64::INFINITY, f64::NEG_INFINITY), |e, p| (e.0.min(p[axis]), e.1.max(p[axis])));
            let room = 0.05 * (ends.1 - ends.0).max(1e-6);
            (ends.0 - room, ends.1 + room)
        };
        let corner = self.0.grid.last().map_or([0.0; 2], |row| row.field_xy_deg);
        let (mut x_range, mut y_range) = (reach(0), reach(1));
        if !(x_range.0.is_finite() && y_range.0.is_finite()) {
            (x_range, y_range) = ((-1.0, 1.0), (-1.0, 1.0));
        }
        // The scale is that of y, so it must hold what x needs.
        let lacking = 0.5 * ((x_range.1 - x_range.0) - (y_range.1 - y_range.0)).max(0.0);
        let panel = Panel {
            title: format!("fields to {:.1}° along x and {:.1}° along y", corner[0], corner[1]),
            x_label: "x, mm: — chief rays, - - without distortion".to_owned(),
            y_label: "y, mm".to_owned(),
            x_range,
            y_range: (y_range.0 - lacking, y_range.1 + lacking),
            is_to_scale: true,
            marks: lines("#999999", MarkKind::Dashed, &straight)
                .into_iter()
                .chain(lines("#2166ac", MarkKind::Line, &found))
                .collect(),
        };
        sheet.panel(&self.in_units(panel), [MARGIN_PX, HEAD_PX, GRID_PX, GRID_PX]);
        sheet.to_svg((2.0 * MARGIN_PX + GRID_PX).max(900.0), HEAD_PX + GRID_PX + MARGIN_PX)
    }
}

/// Returns the rows and the columns of a grid as lines.
fn lines(color: &str, kind: MarkKind, places: &[Option<[f64; 2]>]) -> Vec<Mark> {
    let point = |i: usize| places.get(i).copied().flatten().map_or((f64::NAN, f64::NAN), |[x, y]| (x, y));
    let line = |start: usize, step: usize| Mark {
        color: color.to_owned(),
        kind,
        points: (0..GRID_LINES).map(|i| point(start + i * step)).collect(),
    };
    (0..GRID_LINES).flat_map(|i| [line(i * GRID_LINES, 1), line(i, GRID_LINES)]).collect()
}

fn map_panel(map: &OpdMap, half: f64) -> Panel {
    let waves = || map.waves.iter().flatten().copied();
    let circle = (0..=96).map(|i| std::f64::consts::TAU * f64::from(i) / 96.0);
    let edge = Mark {
        color: "#777777".to_owned(),
        kind: MarkKind::Line,
        points: circle.map(|t| (t.cos(), t.sin())).collect(),
    };
    let ends = waves().fold((f64::INFINITY, f64::NEG_INFINITY), |e, w| (e.0.min(w), e.1.max(w)));
    let reach = match ends.1 >= ends.0 {
        true => format!(", {:.2} λ P–V", ends.1 - ends.0),
        false => ", dark".to_owned(),
    };
    Panel {
        title: format!("{}, {:.0} nm{reach}", map.place.label(), map.wavelength_nm),
        x_label: "x in the stop".to_owned(),
        y_label: "y in the stop".to_owned(),
        x_range: (-1.05, 1.05),
        y_range: (-1.05, 1.05),
        is_to_scale: true,
        marks: levels(map, half).chain([edge]).collect(),
    }
}

/// Returns a mark for each level of a map, drawn three times as finely as it was computed: by straight lines between the
/// cells that are known.
fn levels(map: &OpdMap, half: f64) -> impl Iterator<Item = Mark> {
    let n = FINER * map.n_across;
    let edge_at = |i: usize| 2.0 * i as f64 / n as f64 - 1.0;
    let mut boxes = vec![Vec::new(); (2 * LEVELS + 1) as usize];
    for row in 0..n {
        let level_at = |column: usize| between(map, row, column).map(|waves| level(waves / half));
        let mut column = 0;
        while column < n {
            let here = level_at(column);
            let end = (column + 1..n).find(|&next| level_at(next) != here).unwrap_or(n);
            if let Some(here) = here {
                boxes[here].extend([(edge_at(column), edge_at(row)), (edge_at(end), edge_at(row + 1))]);
            }
            column = end;
        }
    }
    let levels = boxes.into_iter().enumerate().filter(|(_, points)| !points.is_empty());
    levels.map(|(level, points)| Mark { color: color(level), kind: MarkKind::Boxes, points })
}

/// Returns the waves at a cell of the finer grid; `None` where the cell of the map that it lies in has none.
fn between(map: &OpdMap, row: usize, column: usize) -> Option<f64> {
    let n = map.n_across;
    map.waves[row / FINER * n + column / FINER]?;
    // The cells on both sides, and how far from the first, of both axes.
    let sides = |i: usize| {
        let place = (i as f64 + 0.5) / FINER as f64 - 0.5;
        let below = place.floor().max(0.0);
        (below as usize, (below as usize + 1).min(n - 1), (place - below).clamp(0.0, 1.0))
    };
    let ((r0, r1, fr), (c0, c1, fc)) = (sides(row), sides(column));
    let corners =
        [(r0, c0, (1.0 - fr) * (1.0 - fc)), (r0, c1, (1.0 - fr) * fc), (r1, c0, fr * (1.0 - fc)), (r1, c1, fr * fc)];
    let known = corners.into_iter().filter_map(|(r, c, share)| Some((map.waves[r * n + c]?, share)));
    let (sum, shares) = known.fold((0.0, 0.0), |(sum, shares), (waves, share)| (sum + share * waves, shares + share));
    (shares > 0.0).then(|| sum / shares)
}

fn color_bar(half: f64) -> Panel {
    let step = 2.0 * half / f64::from(2 * LEVELS + 1);
    let cells = (-LEVELS..=LEVELS).map(|i| vec![(0.5, f64::from(i) * step)]).collect();
    Panel {
        y_label: "waves late".to_owned(),
        // No round number lies within: the bar has no ticks below it.
        x_range: (0.55, 0.95),
        y_range: (-half, half),
        marks: filled(cells, [1.0, step]).collect(),
        ..Panel::default()
    }
}

/// Returns a mark for each level that has cells.
fn filled(cells: Vec<Vec<(f64, f64)>>, sides: [f64; 2]) -> impl Iterator<Item = Mark> {
    let levels = cells.into_iter().enumerate().filter(|(_, points)| !points.is_empty());
    levels.map(move |(level, points)| Mark { color: color(level), kind: MarkKind::Cells(sides), points })
}

/// Returns the level of a value from −1 to 1.
fn level(value: f64) -> usize {
    let levels = f64::from(2 * LEVELS + 1);
    (0.5 * (value + 1.0) * levels).floor().clamp(0.0, levels - 1.0) as usize
}

fn color(level: usize) -> String {
    let place = level as f64 / f64::from(2 * LEVELS) * (EARLY_TO_LATE.len() - 1) as f64;
    let below = (place.floor() as usize).min(EARLY_TO_LATE.len() - 2);
    let share = place - below as f64;
    let channel = |i: usize| {
        let (from, to) = (EARLY_TO_LATE[below][i], EARLY_TO_LATE[below + 1][i]);
        (from + share * (to - from)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", channel(0), channel(1), channel(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_run_from_blue_over_white_to_red() {
        assert_eq!([-1.0, 0.0, 1.0].map(|value| color(level(value))), ["#053061", "#f7f7f7", "#67001f"]);
        assert_eq!((level(-0.99), level(0.02), level(f64::INFINITY)), (0, 20, 40));
    }
}
