//! The glasses of a lens on the map of index and Abbe number.

use std::fmt::Write;

use dioptric_optics::{Glass, GlassCatalogue, Lens};

use crate::{axis::ticks, lettering::FONT, panel::escaped};

/// Size of the map, and the room left of, above, right of and below its frame, px.
const SIZE_PX: [f64; 2] = [640.0, 460.0];
const ROOM_PX: [f64; 4] = [58.0, 36.0, 20.0, 48.0];
/// What is shown where no glass of the lens lies outside: Abbe numbers, from the left, and indices.
const ABBE: [f64; 2] = [90.0, 18.0];
const INDEX: [f64; 2] = [1.42, 2.05];

/// A glass on the map.
struct Place {
    vd: f64,
    nd: f64,
    words: String,
}

/// Returns the map as SVG: the glasses of the built-in catalogue as points, those of the lens by name; `None` of a lens whose
/// media have no Abbe number, as of one of mirrors.
pub(super) fn glass_map_svg(lens: &Lens) -> Option<String> {
    let places = places(lens);
    if places.is_empty() {
        return None;
    }
    let [left, top, right, bottom] = ROOM_PX;
    let [w, h] = [SIZE_PX[0] - left - right, SIZE_PX[1] - top - bottom];
    let widened = |[first, last]: [f64; 2], of: fn(&Place) -> f64, room: f64| {
        let (low, high) = (first.min(last), first.max(last));
        let values = || places.iter().map(of);
        let (low, high) = (values().fold(low, |a, v| a.min(v - room)), values().fold(high, |a, v| a.max(v + room)));
        if first < last { [low, high] } else { [high, low] }
    };
    let (abbe, index) = (widened(ABBE, |place| place.vd, 2.0), widened(INDEX, |place| place.nd, 0.02));
    let x = |vd: f64| left + w * (vd - abbe[0]) / (abbe[1] - abbe[0]);
    let y = |nd: f64| top + h * (index[1] - nd) / (index[1] - index[0]);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0}\" height=\"{1:.0}\" viewBox=\"0 0 {0:.0} {1:.0}\" \
         font-family=\"{FONT}\" font-size=\"11\">\n<title>Glasses</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        SIZE_PX[0], SIZE_PX[1]
    );
    let mut text = |(x, y): (f64, f64), anchor: &str, more: &str, words: &str| {
        let words = escaped(words);
        let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {more}>{words}</text>");
    };
    text((left + 0.5 * w, 20.0), "middle", "font-size=\"15\" font-weight=\"600\"", "Glasses");
    text(
        (left + 0.5 * w, top + h + 36.0),
        "middle",
        "font-size=\"12\"",
        "Abbe number V_d (dispersion grows to the right)",
    );
    let turned = format!("font-size=\"12\" transform=\"rotate(-90 16 {0:.1})\"", top + 0.5 * h);
    text((16.0, top + 0.5 * h), "middle", &turned, "index n_d");
    let mut grid = String::new();
    for (value, word) in ticks((abbe[1], abbe[0]), w) {
        text((x(value), top + h + 16.0), "middle", "", &word);
        let _ = write!(grid, "M{:.1} {top:.1}v{h:.1}", x(value));
    }
    for (value, word) in ticks((index[0], index[1]), h) {
        text((left - 6.0, y(value) + 4.0), "end", "", &word);
        let _ = write!(grid, "M{left:.1} {:.1}h{w:.1}", y(value));
    }
    let mut catalogue = String::new();
    for (nd, vd) in GlassCatalogue::built_in().glasses().iter().filter_map(|glass| glass.glass.nd_vd()) {
        if (abbe[1]..abbe[0]).contains(&vd) && (index[0]..index[1]).contains(&nd) {
            let _ = write!(catalogue, "M{:.1} {:.1}h.01", x(vd), y(nd));
        }
    }
    let _ = writeln!(
        svg,
        "<path d=\"{grid}\" stroke=\"#e2e5ea\" stroke-width=\"0.8\"/>\n\
         <path d=\"{catalogue}\" stroke=\"#b6bcc6\" stroke-width=\"2.4\" stroke-linecap=\"round\"/>\n\
         <rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"none\" stroke=\"#6b7280\"/>"
    );
    for place in &places {
        let (x, y) = (x(place.vd), y(place.nd));
        // Words at the right end lie to the left of their glass.
        let (anchor, at) = if x > left + 0.75 * w { ("end", x - 8.0) } else { ("start", x + 8.0) };
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\" fill=\"#d55e00\"/>\n\
             <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"#1d2330\" stroke=\"#ffffff\" stroke-width=\"3\" \
             paint-order=\"stroke\">{}</text>",
            y + 4.0,
            escaped(&place.words)
        );
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

/// Returns the glasses of a lens that have an Abbe number, each once, with the surfaces that they lie behind.
fn places(lens: &Lens) -> Vec<Place> {
    let mut found: Vec<(&Glass, Vec<usize>)> = Vec::new();
    for (surface, interface) in lens.interfaces().iter().enumerate() {
        match found.iter_mut().find(|(glass, _)| *glass == &interface.medium_after) {
            Some((_, surfaces)) => surfaces.push(surface),
            None => found.push((&interface.medium_after, vec![surface])),
        }
    }
    let place = |(glass, surfaces): (&Glass, Vec<usize>)| {
        let (nd, vd) = glass.nd_vd().filter(|(_, vd)| vd.is_finite() && *vd > 0.0)?;
        let name = match glass {
            Glass::Named(name) => name.split_once(':').map_or(name.as_str(), |(_, name)| name).to_owned(),
            _ => format!("{nd:.4}/{vd:.1}"),
        };
        let surfaces: Vec<String> = surfaces.iter().map(usize::to_string).collect();
        Some(Place { vd, nd, words: format!("{name} ({})", surfaces.join(", ")) })
    };
    found.into_iter().filter_map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glasses_of_a_lens_are_named_once() {
        let svg = glass_map_svg(&Lens::built_in("achromat-100mm").unwrap()).unwrap();
        assert!(!svg.contains("NaN") && svg.matches("<circle").count() == 2, "{svg}");
        assert!(glass_map_svg(&Lens::thin(50.0, 10.0).unwrap()).is_none());
    }
}
