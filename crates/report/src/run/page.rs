//! The page of the report: what it shows, and its embedded pictures.

use base64::{Engine, engine::general_purpose::STANDARD};
use image::RgbImage;

use super::html::{Figure, Page, Pictures, write_page};
use dioptric_analysis::MOST_ERROR_PX;

use crate::{LensDrawing, MosaicPlan, PsfMosaic, png::png_bytes};
use dioptric_pipeline::{
    PipelineError, REFERENCE_WAVELENGTH_NM,
    display::{LinearRgb, code, level_at, wavelength_color},
};
use dioptric_spectrum::{Bands, WavelengthGrid};

/// Widest small picture, pixels.
const THUMBNAIL: usize = 480;

/// Pixels of the largest picture that is in the page whole; noise does not compress, and a page is to stay below 3 MB.
const WHOLE_PIXELS: usize = 700_000;

/// The most bands in which point spread functions are drawn.
const MOST_BANDS: usize = 16;

/// Returns the page as HTML.
pub(super) fn render(page: &Page<'_>) -> Result<String, PipelineError> {
    let drawing = LensDrawing {
        fields_deg: [0.0, 0.7, 1.0]
            .iter()
            .map(|share| (share * page.places.corner_tan()).atan().to_degrees())
            .collect(),
        distance_mm: page.run.capture.place.focus_distance_mm.unwrap_or(f64::INFINITY),
        wavelengths_nm: vec![REFERENCE_WAVELENGTH_NM],
        film_distance_mm: page.run.capture.place.film_distance_mm,
        film_label: "film".to_owned(),
    };
    let pictures = Pictures {
        picture: picture(page)?,
        lens_svg: drawing.to_svg(&page.run.capture.lens.lens).unwrap_or_default(),
        mosaic: mosaic(page)?,
        seen: seen(&page.run.capture.irradiance.summary.seen),
        bands: bands(page)?,
        depth: depth(page),
        disparity: disparity(page),
    };
    Ok(write_page(page, &pictures))
}

/// The picture, made smaller where it is large.
fn picture(page: &Page<'_>) -> Result<String, PipelineError> {
    let picture = &page.run.capture.developed.picture;
    let (columns, rows) = (picture.columns(), picture.rows());
    let factor = factor_of(columns, rows);
    if factor == 1 {
        return Ok(data_uri(page.picture_png));
    }
    let whole = RgbImage::from_raw(columns as u32, rows as u32, picture.to_rgb8()).unwrap_or_default();
    Ok(data_uri(&png_bytes(&shrunk(&whole, factor as u32))?))
}

/// Returns how many pixels of a picture are one in the page, each way.
fn factor_of(columns: usize, rows: usize) -> usize {
    (1..).find(|factor| (columns / factor) * (rows / factor) <= WHOLE_PIXELS).unwrap_or(1)
}

fn data_uri(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

fn embedded(picture: &RgbImage) -> String {
    png_bytes(picture).map(|png| data_uri(&png)).unwrap_or_default()
}

fn mosaic(page: &Page<'_>) -> Result<(PsfMosaic, String), PipelineError> {
    // Some of the bands are as white as all.
    let all_nm = page.run.capture.grid().centers_nm();
    let some_nm = all_nm.iter().copied().step_by(all_nm.len().div_ceil(MOST_BANDS)).collect();
    let plan = MosaicPlan {
        field_tans: [0.0, 0.35, 0.7, 0.95].iter().map(|share| page.places.field(*share)).collect(),
        dioptres: page.places.dioptres.clone(),
        grid: WavelengthGrid::new(some_nm)?,
        tile_px: 95,
        tile_um: None,
    };
    let mosaic = PsfMosaic::draw(page.run.model, &plan);
    let src = data_uri(&png_bytes(&mosaic.to_picture(1))?);
    Ok((mosaic, src))
}

/// The irradiance as an observer sees it, exposed for its brightest per cent.
fn seen(light: &LinearRgb) -> String {
    embedded(&thumbnail(light.to_srgb(light.level_at(0.99).max(f64::MIN_POSITIVE))))
}

/// A few bands, each in its color and exposed alike.
fn bands(page: &Page<'_>) -> Result<Vec<Figure>, PipelineError> {
    let irradiance = &page.run.capture.irradiance;
    let shown = irradiance.shown_bands();
    // Each is read twice, so that only one is in memory at a time.
    let mut top = f64::MIN_POSITIVE;
    for &band in &shown {
        top = top.max(level_at(&[&*irradiance.band(band)?], 0.995));
    }
    let figure = |&band: &usize| {
        let (plane, nm) = (irradiance.band(band)?, irradiance.grid().centers_nm()[band]);
        let tint = tint(nm);
        let picture = RgbImage::from_fn(plane.ncols() as u32, plane.nrows() as u32, |x, y| {
            let value = f64::from(plane[(y as usize, x as usize)]) / top;
            image::Rgb(tint.map(|t| code(value * t)))
        });
        let caption = format!("{nm:.0} nm, full scale {:.3} mW m⁻² nm⁻¹", 1e3 * top);
        Ok(Figure { src: embedded(&thumbnail(picture)), caption })
    };
    shown.iter().map(figure).collect()
}

/// The color of a band, its largest part 1.
fn tint(wavelength_nm: f64) -> [f64; 3] {
    let text = wavelength_color(wavelength_nm);
    let parts = [1, 3, 5].map(|i| u8::from_str_radix(&text[i..i + 2], 16).map_or(0.0, f64::from));
    let most = parts.iter().copied().fold(1.0, f64::max);
    // A pale rest keeps detail visible in deep blue and red.
    parts.map(|v| 0.15 + 0.85 * v / most)
}

/// Depth in dioptres, near bright.
fn depth(page: &Page<'_>) -> String {
    let Some(depth) = page.run.depth else { return String::new() };
    let (near_m, far_m) = depth.range_m();
    let (far, near) = (1.0 / far_m, 1.0 / near_m);
    let z_m = depth.z_m();
    let picture = RgbImage::from_fn(z_m.ncols() as u32, z_m.nrows() as u32, |x, y| {
        let dioptres = 1.0 / f64::from(z_m[(y as usize, x as usize)]);
        let share = if near > far { (dioptres - far) / (near - far) } else { 1.0 };
        let level = (30.0 + 210.0 * share).round() as u8;
        image::Rgb([level, level, level])
    });
    embedded(&thumbnail(picture))
}

/// Disparities of photodiodes, red for what is nearer than the focus, blue for what is beyond it, dark where nothing is known.
fn disparity(page: &Page<'_>) -> Option<Figure> {
    /// Pixels of the picture for each block.
    const BLOCK: u32 = 8;
    let map = page.run.capture.frames.exposed.photodiodes.as_ref()?.disparity.as_ref()?;
    let known = map.known_px(MOST_ERROR_PX);
    // A few blocks are matched with others that look alike.
    let ends = [known.len() / 50, known.len() - known.len() / 50];
    let of_most = known[ends[0]..ends[1]].iter().map(|px| px.abs());
    let most = of_most.fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let picture =
        RgbImage::from_fn(BLOCK * map.disparity_px.ncols() as u32, BLOCK * map.disparity_px.nrows() as u32, |x, y| {
            let at = ((y / BLOCK) as usize, (x / BLOCK) as usize);
            if f64::from(map.standard_error_px[at]).is_nan() || f64::from(map.standard_error_px[at]) > MOST_ERROR_PX {
                return image::Rgb([40, 40, 40]);
            }
            let share = (f64::from(map.disparity_px[at]) / most).clamp(-1.0, 1.0);
            let pale = (240.0 * (1.0 - share.abs())).round() as u8;
            image::Rgb(if share > 0.0 { [240, pale, pale] } else { [pale, pale, 240] })
        });
    let caption = format!(
        "disparity of the photodiodes: red nearer than the focus, blue beyond, full color {most:.1} px; dark unknown"
    );
    Some(Figure { src: embedded(&picture), caption })
}

/// Returns the picture made smaller by a whole number where it is wide.
fn thumbnail(picture: RgbImage) -> RgbImage {
    let factor = (picture.width() as usize).div_ceil(THUMBNAIL).max(1) as u32;
    if factor == 1 { picture } else { shrunk(&picture, factor) }
}

/// Returns the picture with the mean of each block of so many pixels each way in place of them; what is left over at the right and below is left out.
fn shrunk(picture: &RgbImage, factor: u32) -> RgbImage {
    let (columns, rows) = (picture.width() / factor, picture.height() / factor);
    let (factor, n_blocks) = (factor as usize, columns as usize);
    let n = (factor * factor) as u32;
    let mut codes = Vec::with_capacity(3 * n_blocks * rows as usize);
    for lines in picture.as_raw().chunks_exact(3 * factor * picture.width() as usize) {
        let mut sums = vec![0; 3 * n_blocks];
        for line in lines.chunks_exact(3 * picture.width() as usize) {
            for (sums, block) in sums.chunks_exact_mut(3).zip(line.chunks_exact(3 * factor)) {
                for pixel in block.chunks_exact(3) {
                    sums.iter_mut().zip(pixel).for_each(|(sum, code)| *sum += u32::from(*code));
                }
            }
        }
        codes.extend(sums.iter().map(|sum| ((sum + n / 2) / n) as u8));
    }
    RgbImage::from_raw(columns, rows, codes).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_holds_small_pictures_whole_and_large_ones_smaller() {
        assert_eq!((factor_of(960, 640), factor_of(1, 700_000), factor_of(1, 700_001)), (1, 1, 2));
        assert_eq!((factor_of(4000, 3000), factor_of(1216, 832)), (5, 2));
        let picture = RgbImage::from_fn(40, 30, |x, _| image::Rgb([if x < 20 { 0 } else { 200 }; 3]));
        let small = shrunk(&picture, 5);
        assert_eq!((small.dimensions(), small[(0, 3)].0, small[(7, 3)].0), ((8, 6), [0; 3], [200; 3]));
    }
}
