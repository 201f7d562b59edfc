//! A surface over two axes, seen from above and aside: a mesh of colored cells in a box with three axes, as SVG.

use std::fmt::Write;

use crate::{axis::ticks, lettering::FONT, panel::escaped};

/// Directions of sight: turn about the upright axis and tilt of the base, degrees.
const TURN_DEG: f64 = 30.0;
const TILT_DEG: f64 = 28.0;
/// Pixels of the box's base and height for each pixel of the drawing's width.
const BASE: f64 = 0.46;
const TALL: f64 = 0.38;
/// Viridis of matplotlib (CC0): dark violet to yellow, of even steps in lightness, readable with color vision deficiency.
const COLORS: [[u8; 3]; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x24, 0x75],
    [0x41, 0x44, 0x87],
    [0x35, 0x5f, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x44, 0xbf, 0x70],
    [0x7a, 0xd1, 0x51],
    [0xbd, 0xdf, 0x26],
    [0xfd, 0xe7, 0x25],
];

/// Heights over a grid of x and y.
pub(crate) struct Mesh<'a> {
    pub(crate) title: &'a str,
    /// Names of x, y and height.
    pub(crate) labels: [&'a str; 3],
    /// Ascending.
    pub(crate) x: &'a [f64],
    /// Ascending.
    pub(crate) y: &'a [f64],
    /// A row for each y, a height for each x.
    pub(crate) heights: Vec<Vec<f64>>,
    /// Height of the top of the box.
    pub(crate) highest: f64,
}

impl Mesh<'_> {
    /// Returns the drawing at x, y of this width and height, px, as a nested SVG element.
    pub(crate) fn to_svg(&self, [left, top, width, height]: [f64; 4]) -> String {
        let view = View::of(self, width, height);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" x=\"{left:.0}\" y=\"{top:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" font-family=\"{FONT}\" font-size=\"11\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"28\" font-size=\"16\" font-weight=\"600\" text-anchor=\"middle\">{}</text>",
            0.5 * width,
            escaped(self.title)
        );
        view.draw_walls(&mut svg);
        self.draw_cells(&view, &mut svg);
        view.draw_axes(self.labels, &mut svg);
        svg.push_str("</svg>\n");
        svg
    }

    /// Fills the cells from the farthest to the nearest, so that those in front hide those behind.
    fn draw_cells(&self, view: &View, svg: &mut String) {
        let _ = writeln!(
            svg,
            "<g stroke=\"#000000\" stroke-opacity=\"0.4\" stroke-width=\"0.4\" stroke-linejoin=\"round\">"
        );
        // The corner nearest to the eye is that of the largest x and the least y.
        for row in (1..self.y.len()).rev() {
            for column in 1..self.x.len() {
                let corners = [(column - 1, row - 1), (column, row - 1), (column, row), (column - 1, row)];
                let heights = corners.map(|(c, r)| self.heights[r][c]);
                let places = corners.map(|(c, r)| view.place([self.x[c], self.y[r], self.heights[r][c]]));
                let color = color(heights.iter().sum::<f64>() / 4.0 / self.highest);
                let points = places.map(|(x, y)| format!("{x:.1} {y:.1}")).join("L");
                let _ = writeln!(svg, "<path d=\"M{points}Z\" fill=\"{color}\"/>");
            }
        }
        svg.push_str("</g>\n");
    }
}

/// Where places of the box are seen.
struct View {
    /// First and last value of x, y and height.
    ranges: [(f64, f64); 3],
    /// Middle of the base, px.
    middle: (f64, f64),
    base_px: f64,
    tall_px: f64,
}

impl View {
    fn of(mesh: &Mesh<'_>, width: f64, height: f64) -> Self {
        let ends = |values: &[f64]| (values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(1.0));
        Self {
            ranges: [ends(mesh.x), ends(mesh.y), (0.0, mesh.highest)],
            middle: (0.53 * width, 0.68 * height),
            base_px: BASE * width,
            tall_px: TALL * width,
        }
    }

    /// Returns where a place is seen, px: parallel rays, x to the right and toward the eye, y to the right and away.
    fn place(&self, values: [f64; 3]) -> (f64, f64) {
        let share = |i: usize| (values[i] - self.ranges[i].0) / (self.ranges[i].1 - self.ranges[i].0);
        let [x, y, z] = [share(0) - 0.5, share(1) - 0.5, share(2)];
        let ((sin, cos), (tilt_sin, tilt_cos)) = (TURN_DEG.to_radians().sin_cos(), TILT_DEG.to_radians().sin_cos());
        let (right, away) = (x * cos + y * sin, -x * sin + y * cos);
        let up = away * tilt_sin * self.base_px + z * tilt_cos * self.tall_px;
        (self.middle.0 + right * self.base_px, self.middle.1 - up)
    }

    /// Returns round numbers along an axis and how to write them.
    fn ticks(&self, i: usize) -> Vec<(f64, String)> {
        // Numbers above each other need less room than those side by side.
        ticks(self.ranges[i], if i == 2 { 1.3 * self.tall_px } else { self.base_px })
    }

    /// Returns a line through places as the data of a path.
    fn line(&self, places: &[[f64; 3]]) -> String {
        let points: Vec<String> =
            places.iter().map(|place| self.place(*place)).map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
        format!("M{}", points.join("L"))
    }

    /// Draws base, back walls and the lines of round numbers on them, all of which the surface hides.
    fn draw_walls(&self, svg: &mut String) {
        let [x, y, z] = self.ranges;
        let at = |i: usize| self.ticks(i).into_iter().map(|(value, _)| value);
        let mut grid = String::new();
        for value in at(0) {
            grid += &self.line(&[[value, y.0, z.0], [value, y.1, z.0], [value, y.1, z.1]]);
        }
        for value in at(1) {
            grid += &self.line(&[[x.1, value, z.0], [x.0, value, z.0], [x.0, value, z.1]]);
        }
        for value in at(2) {
            grid += &self.line(&[[x.0, y.0, value], [x.0, y.1, value], [x.1, y.1, value]]);
        }
        let edges = [
            self.line(&[[x.0, y.0, z.0], [x.1, y.0, z.0], [x.1, y.1, z.0]]),
            self.line(&[[x.0, y.0, z.0], [x.0, y.0, z.1], [x.0, y.1, z.1], [x.1, y.1, z.1], [x.1, y.1, z.0]]),
            self.line(&[[x.0, y.1, z.1], [x.0, y.1, z.0], [x.0, y.0, z.0]]),
            self.line(&[[x.0, y.1, z.0], [x.1, y.1, z.0]]),
        ];
        let _ = writeln!(svg, "<path d=\"{grid}\" fill=\"none\" stroke=\"#dfe3ea\" stroke-width=\"0.8\"/>");
        let _ = writeln!(svg, "<path d=\"{}\" fill=\"none\" stroke=\"#6b7280\" stroke-width=\"0.9\"/>", edges.concat());
    }

    /// Writes round numbers and names along the edges in front.
    fn draw_axes(&self, labels: [&str; 3], svg: &mut String) {
        let [x, y, z] = self.ranges;
        let mut text = |(px, py): (f64, f64), anchor: &str, more: &str, words: &str| {
            let words = escaped(words);
            let _ = writeln!(
                svg,
                "<text x=\"{px:.1}\" y=\"{py:.1}\" text-anchor=\"{anchor}\" fill=\"#1d2330\"{more}>{words}</text>"
            );
        };
        let beside = |(px, py): (f64, f64), right: f64, down: f64| (px + right, py + down);
        // Along the edge of an axis, its name runs parallel to it.
        let turned = |from: [f64; 3], to: [f64; 3], at: (f64, f64)| {
            let (a, b) = (self.place(from), self.place(to));
            let degrees = (b.1 - a.1).atan2(b.0 - a.0).to_degrees();
            format!(" font-size=\"12\" transform=\"rotate({degrees:.1} {:.1} {:.1})\"", at.0, at.1)
        };
        let middle = |range: (f64, f64)| 0.5 * (range.0 + range.1);
        for (value, word) in self.ticks(0) {
            text(beside(self.place([value, y.0, z.0]), -4.0, 15.0), "end", "", &word);
        }
        let at = beside(self.place([middle(x), y.0, z.0]), -20.0, 42.0);
        text(at, "middle", &turned([x.0, y.0, z.0], [x.1, y.0, z.0], at), labels[0]);
        for (value, word) in self.ticks(1) {
            text(beside(self.place([x.1, value, z.0]), 6.0, 12.0), "start", "", &word);
        }
        let at = beside(self.place([x.1, middle(y), z.0]), 38.0, 34.0);
        text(at, "middle", &turned([x.1, y.0, z.0], [x.1, y.1, z.0], at), labels[1]);
        for (value, word) in self.ticks(2) {
            text(beside(self.place([x.0, y.0, value]), -7.0, 4.0), "end", "", &word);
        }
        let at = beside(self.place([x.0, y.0, middle(z)]), -40.0, 0.0);
        text(at, "middle", &turned([x.0, y.0, z.0], [x.0, y.0, z.1], at), labels[2]);
    }
}

/// Returns the color of a height over the highest.
fn color(share: f64) -> String {
    let last = COLORS.len() - 1;
    let at = share.clamp(0.0, 1.0) * last as f64;
    let i = (at as usize).min(last - 1);
    let mix = |k: usize| {
        let [below, above] = [COLORS[i][k], COLORS[i + 1][k]].map(f64::from);
        (below + (at - i as f64) * (above - below)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh() -> Mesh<'static> {
        Mesh {
            title: "a < b",
            labels: ["x", "y", "z"],
            x: &[-1.0, 0.0, 1.0],
            y: &[400.0, 700.0],
            heights: vec![vec![0.0, 1.0, 0.0], vec![0.0, 0.5, 0.0]],
            highest: 1.0,
        }
    }

    #[test]
    fn a_mesh_has_a_cell_between_neighbors() {
        let svg = mesh().to_svg([0.0, 0.0, 560.0, 470.0]);
        assert_eq!(svg.matches("Z\" fill=").count(), 2);
        assert!(svg.contains("a &lt; b") && svg.contains(">400<") && !svg.contains("NaN"));
    }

    #[test]
    fn a_hill_is_the_golden_one() {
        let x: Vec<f64> = (-6..=6).map(|i| 5.0 * f64::from(i)).collect();
        let y: Vec<f64> = (0..7).map(|i| 400.0 + 50.0 * f64::from(i)).collect();
        let row = |nm: &f64| x.iter().map(|at| 400.0 / nm * (-(at * 400.0 / nm / 10.0).powi(2)).exp()).collect();
        let labels = ["place, µm", "wavelength, nm", "relative irradiance"];
        let hill = Mesh { title: "hill", labels, x: &x, y: &y, heights: y.iter().map(row).collect(), highest: 1.0 };
        // Places are rounded to a tenth of a pixel.
        dioptric_golden::check_svg("report/mesh.svg", &hill.to_svg([0.0, 0.0, 560.0, 470.0]), 0.11);
    }

    #[test]
    fn near_and_high_places_lie_as_seen() {
        let view = View::of(&mesh(), 560.0, 470.0);
        let [far, near, high] = [[-1.0, 700.0, 0.0], [1.0, 400.0, 0.0], [1.0, 400.0, 1.0]].map(|p| view.place(p));
        // Down the page is toward the eye, up is higher.
        assert!(near.1 > far.1 && high.1 < near.1 && high.0 == near.0);
        for x in [-1.0, 1.0] {
            for y in [400.0, 700.0] {
                for z in [0.0, 1.0] {
                    let (px, py) = view.place([x, y, z]);
                    assert!((60.0..500.0).contains(&px) && (36.0..430.0).contains(&py), "{px} {py}");
                }
            }
        }
    }

    #[test]
    fn colors_run_from_violet_to_yellow() {
        assert_eq!([0.0, 0.5, 1.0, 2.0].map(color), ["#440154", "#21918c", "#fde725", "#fde725"]);
    }
}
