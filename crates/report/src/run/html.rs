//! The page of a report as HTML: sections of numbers, drawings and embedded pictures.

use std::fmt::Write;

use dioptric_analysis::{PixelPlace, Run, RunCharts, RunPlaces, RunReport, RunTimes};
use dioptric_sensor::WhiteBalance;

use crate::{
    PsfMosaic,
    page::{self, section},
    panel::escaped,
};

/// Everything that the page shows.
pub(super) struct Page<'a> {
    pub(super) run: &'a Run<'a>,
    pub(super) report: &'a RunReport,
    pub(super) times: &'a RunTimes,
    pub(super) places: &'a RunPlaces,
    pub(super) charts: &'a RunCharts,
    pub(super) picture_png: &'a [u8],
}

/// A picture in the page with the words below it.
pub(super) struct Figure {
    pub(super) src: String,
    pub(super) caption: String,
}

/// The pictures and drawings of a page: pictures as data URIs, drawings as SVG.
pub(super) struct Pictures {
    pub(super) picture: String,
    pub(super) lens_svg: String,
    pub(super) mosaic: (PsfMosaic, String),
    pub(super) seen: String,
    pub(super) bands: Vec<Figure>,
    pub(super) depth: String,
    pub(super) disparity: Option<Figure>,
}

/// Returns the page.
pub(super) fn write_page(page: &Page<'_>, pictures: &Pictures) -> String {
    let report = page.report;
    // A picture of few pixels is shown larger, so that they can be seen.
    let small = if report.film.columns < 240 { " class=\"small\"" } else { "" };
    let body = [
        format!(
            "<section class=\"picture\"><a href=\"picture.png\" title=\"every pixel\"><img src=\"{}\" alt=\"The picture\" \
             width=\"{}\" height=\"{}\"{small}></a></section>\n",
            pictures.picture, report.film.columns, report.film.rows
        ),
        section("At a glance", &glance(report)),
        section("Lens", &lens(report, &pictures.lens_svg)),
        section("Point spread over field and depth", &spreads(page, &pictures.mosaic)),
        section("Geometry and light over the field", &field(page)),
        section("Spectral irradiance on the film", &irradiance(page, pictures)),
        section(&format!("Sensor: {}", escaped(&report.sensor.sensor)), &sensor(report, pictures)),
        if page.times.stages_s.is_empty() { String::new() } else { section("Time", &timings(page.times)) },
        format!(
            "<section>\n<details><summary>All settings, as a camera file</summary><pre>{}</pre></details>\n</section>\n",
            escaped(&page.run.capture.camera.to_ron())
        ),
    ];
    let head = [&report.lens.lens, &report.sensor.sensor, &report.scene.name].map(String::as_str).join(" · ");
    page::page(&report.camera.name, &format!("{head} · dioptric {}", report.dioptric), &body.concat())
}

fn note(words: &str) -> String {
    format!("<p class=\"note\">{words}</p>\n")
}

/// Returns a table with its first column to the left and the others to the right.
fn table(heads: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let row = |tag: &str, cells: &[String]| {
        let cell = |(i, words): (usize, &String)| {
            let class = if i == 0 { "" } else { " class=\"n\"" };
            format!("<{tag}{class}>{words}</{tag}>")
        };
        format!("<tr>{}</tr>\n", cells.iter().enumerate().map(cell).collect::<String>())
    };
    let heads: Vec<String> = heads.iter().map(|&head| head.to_owned()).collect();
    let head = if heads.is_empty() { String::new() } else { row("th", &heads) };
    format!("<table>\n{head}{}</table>\n", rows.map(|cells| row("td", &cells)).collect::<String>())
}

fn figure(src: &str, caption: &str) -> String {
    let words = escaped(caption);
    format!("<figure><img src=\"{src}\" alt=\"{words}\"><figcaption>{words}</figcaption></figure>\n")
}

fn glance(report: &RunReport) -> String {
    let (lens, film) = (&report.lens.first_order, &report.film);
    let image = report.lens.image.as_ref();
    let focused = image.map_or("f-number".to_owned(), |image| format!("f/{:.2} as focused", image.working_f_number));
    let distance = image.map_or("–".to_owned(), |image| format!("{:.3} m", image.distance_mm / 1000.0));
    let side_mm = |pixels: usize| pixels as f64 * film.pitch_um / 1000.0;
    let lux = report.scene.light.as_ref().and_then(|light| light.illuminance_lux);
    let light = match (&report.scene.light_temperature, lux) {
        (Some(temperature), Some(lux)) => format!("{:.0} K, {lux:.0} lx", temperature.kelvin),
        (Some(temperature), None) => format!("{:.0} K", temperature.kelvin),
        (None, _) => "unknown".to_owned(),
    };
    let tiles = [
        (format!("{:.2} mm", lens.efl_mm), format!("focal length at {:.0} nm", lens.wavelength_nm)),
        (format!("f/{:.2}", lens.f_number), focused),
        (
            report.lens.t_number.map_or_else(|| "–".to_owned(), |t| format!("T/{t:.2}")),
            report.lens.transmission.map_or_else(
                || "T-number".to_owned(),
                |share| format!("T-number: {:.1} % of the light gets through", 100.0 * share),
            ),
        ),
        (
            report.irradiance.reflections.in_words().unwrap_or_else(|| "–".to_owned()),
            "light that surfaces of the lens reflect to the film".to_owned(),
        ),
        (distance, "in focus, from the first vertex".to_owned()),
        (format!("{} × {}", film.columns, film.rows), format!("pixels of {:.2} µm", film.pitch_um)),
        (
            format!("{:.2} × {:.2} mm", side_mm(film.columns), side_mm(film.rows)),
            format!("film, {:.3} mm behind the lens", report.film_distance_mm),
        ),
        (format!("{:.3} ms", report.sensor.exposure_time_s * 1000.0), "exposure".to_owned()),
        (format!("{:.2} lx", report.irradiance.mean_lux), "mean illuminance on the film".to_owned()),
        (format!("{:.1} cd/m²", report.scene.mean_luminance_cd_m2), "mean luminance of the scene".to_owned()),
        (format!("{:.2} – {:.2} m", report.scene.near_m, report.scene.far_m), "depth of the scene".to_owned()),
        (light, "light on the scene".to_owned()),
    ];
    let tile =
        |(value, words): &(String, String)| format!("<div class=\"tile\"><b>{value}</b><span>{words}</span></div>\n");
    format!("<div class=\"tiles\">\n{}</div>\n", tiles.iter().map(tile).collect::<String>())
}

fn lens(report: &RunReport, svg: &str) -> String {
    let words = format!(
        "Rays on the axis, at 70 % of the field and to the corner of the film, at {:.0} nm.",
        report.lens.first_order.wavelength_nm
    );
    let notes: String = report.lens_notes.iter().map(|words| note(&escaped(words))).collect();
    format!("{svg}\n{}{notes}", note(&words))
}

fn spreads(page: &Page<'_>, (mosaic, src): &(PsfMosaic, String)) -> String {
    let mut html = "<div class=\"mosaic\">\n<div class=\"depths\">".to_owned();
    for (depth_m, tile_um) in mosaic.depths_m.iter().zip(&mosaic.tiles_um) {
        let _ = write!(html, "<div><b>{depth_m:.2} m</b><br>{tile_um:.0} µm</div>");
    }
    let _ = write!(
        html,
        "</div>\n<img src=\"{src}\" alt=\"Point-spread functions over field and depth\">\n<div class=\"fields\">"
    );
    for field_deg in &mosaic.fields_deg {
        let _ = write!(html, "<div>{field_deg:.1}°</div>");
    }
    html.push_str("</div>\n</div>\n");
    html += &note(&format!(
        "A white point of equal energy, as an observer sees its image. Depths are at the left, with the width of the \
         tiles of that row on the film (a pixel is {:.1} µm), fields below. Each tile is exposed for its own brightest \
         spot, and is centered on the light of {:.0} nm, so that lateral color shows. The center of the picture lies \
         to the left.",
        page.report.film.pitch_um, page.report.lens.first_order.wavelength_nm
    ));
    html + &page::charts([&page.charts.lsf, &page.charts.mtf])
}

fn field(page: &Page<'_>) -> String {
    let heads =
        ["field", "reaches the film", "ended by the stop", "ended by other rims", "missed or reflected", "vignetting"];
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let rows = page.report.losses.iter().map(|row| {
        let mut cells = vec![format!("{:.2}°", row.field_deg)];
        cells.extend([row.reaches_film, row.ended_by_stop, row.ended_by_rims, row.missed_or_reflected].map(percent));
        cells.push(format!("{:.4}", row.vignetting));
        cells
    });
    let words = "Shares of the light that enters the disc of the front rim from a point at the distance in focus. \
                 Vignetting is what is left of the light that the stop alone would pass.";
    page::charts([&page.charts.illumination, &page.charts.distortion]) + &table(&heads, rows) + &note(words)
}

fn irradiance(page: &Page<'_>, pictures: &Pictures) -> String {
    let mut html = "<div class=\"row\">\n".to_owned();
    html += &figure(&pictures.seen, "all bands, as an observer sees them");
    for band in &pictures.bands {
        html += &figure(&band.src, &band.caption);
    }
    if !pictures.depth.is_empty() {
        html += &figure(&pictures.depth, "depth of the scene, near is bright");
    }
    html + "</div>\n" + &page::charts([&page.charts.spectrum, &page.charts.histogram])
}

fn sensor(report: &RunReport, pictures: &Pictures) -> String {
    let heads = ["channel", "mean, e⁻", "largest, e⁻", "SNR at the mean", "mean of the raw frame", "white balance"];
    let sensor = &report.sensor;
    let rows = sensor.channels.iter().zip(&report.white_balance).map(|(channel, balance)| {
        vec![
            escaped(&channel.filter),
            format!("{:.1}", channel.mean_e),
            format!("{:.1}", channel.max_e),
            format!("{:.1} dB", channel.snr_db),
            format!("{:.2}", channel.mean_raw),
            format!("× {balance:.4}"),
        ]
    });
    let is_gray = report.scene.light.is_none() && report.camera.processing.white == WhiteBalance::Scene;
    let gray =
        if is_gray { " The light on the scene is unknown, so the mean of the picture is made gray." } else { "" };
    let words = format!(
        "A pixel saturates at {:.0} electrons; {:.3} % of the samples do. Read noise is {:.2} electrons, analog gain \
         {:.2}.{gray}",
        sensor.saturation_e,
        100.0 * sensor.saturated_fraction,
        sensor.read_noise_e,
        sensor.analog_gain
    );
    table(&heads, rows) + &note(&words) + &pixel_optics(report) + &phase_detection(report, pictures)
}

fn pixel_optics(report: &RunReport) -> String {
    let Some(data) = &report.sensor.pixel_optics else { return String::new() };
    let place = |place: &PixelPlace| format!("{:.1} % (chief ray at {:.1}°)", 100.0 * place.share, place.chief_ray_deg);
    note(&format!(
        "Of the light on a pixel of {} µm its optics lead {} to the photodiode of {:.2} µm in the middle and {} in the darkest corner; of collimated \
         light along the axis {:.1} %.",
        data.pixel_pitch_um,
        place(&data.middle),
        data.photodiode_um,
        place(&data.corner),
        100.0 * data.axial_share
    ))
}

fn phase_detection(report: &RunReport, pictures: &Pictures) -> String {
    let Some(data) = &report.dual_pixel else { return String::new() };
    let defocus = data.defocus_um_per_px.map_or_else(
        || "Both halves see the same.".to_owned(),
        |um| format!("A pixel of disparity is {um:.1} µm between film and image."),
    );
    let found = data.disparity.as_ref().map_or_else(String::new, |found| {
        format!(
            " {} of {} blocks tell theirs to {} px: {:.2} to {:.2} px, {:.2} px the median.",
            found.known_blocks, found.blocks, found.most_error_px, found.least_px, found.greatest_px, found.median_px
        )
    });
    let words = format!(
        "Photodiodes read one by one: {}; the picture is made of their sum. The centroids of the halves lie {:.3} radii of \
         the pupil apart. {defocus}{found}",
        data.photodiodes.join(", "),
        data.centroid_separation
    );
    note(&words) + &pictures.disparity.as_ref().map_or_else(String::new, |map| figure(&map.src, &map.caption))
}

fn timings(times: &RunTimes) -> String {
    let rows = |times_s: &[(String, f64)]| {
        table(&[], times_s.iter().map(|(what, seconds)| vec![escaped(what), format!("{seconds:.2} s")]))
    };
    let stages = rows(&times.stages_s);
    if times.imaging_s.is_empty() {
        return stages;
    }
    let parts = rows(&times.imaging_s);
    format!("<div class=\"pair\">\n<div>{stages}</div><div>{parts}</div></div>\n")
        + &note("Right: the parts of scene to irradiance, summed over threads.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_align_numbers_to_the_right() {
        let rows = [vec!["G".to_owned(), "12.0".to_owned()]].into_iter();
        let expected = "<table>\n<tr><th>channel</th><th class=\"n\">mean</th></tr>\n\
                        <tr><td>G</td><td class=\"n\">12.0</td></tr>\n</table>\n";
        assert_eq!(table(&["channel", "mean"], rows), expected);
        assert_eq!(table(&[], std::iter::empty()), "<table>\n</table>\n");
    }

    #[test]
    fn captions_are_escaped() {
        assert!(figure("data:,", "a < b & c").contains("<figcaption>a &lt; b &amp; c</figcaption>"));
    }
}
