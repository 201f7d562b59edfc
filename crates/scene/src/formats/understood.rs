//! One line of what was understood of a file, and questions about scenes that cannot be.

use dioptric_spectrum::{DepthMap, Observer, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;
use rayon::prelude::*;

use super::contents::Image;
use crate::{Scene, View};

/// Luminances of scenes, cd/m²: starlight on a dark wall to the disc of the sun.
const LUMINANCES_CD_M2: [f64; 2] = [1e-4, 1e9];
/// Depths of scenes, m.
const DEPTHS_M: [f64; 2] = [1e-3, 1e5];

/// Where the parts of a scene come from.
#[derive(Default)]
pub(super) struct Sources {
    /// What the numbers of the file are.
    pub(super) what: String,
    /// The bands of the file.
    pub(super) bands: Option<WavelengthGrid>,
    pub(super) depth: Option<String>,
    pub(super) view: Option<String>,
}

/// Puts what was understood of a scene's file, in a line, before its notes, and behind them questions about what cannot well be.
pub(super) fn tell(scene: &mut Scene, sources: &Sources) {
    let luminances = luminances(&scene.radiance);
    let line = line(scene, sources, luminances);
    scene.notes.insert(0, line);
    let doubts = doubts(scene, luminances);
    scene.notes.extend(doubts);
}

/// Returns what was understood of a scene's file, in a line.
fn line(scene: &Scene, sources: &Sources, luminances: Option<[f64; 2]>) -> String {
    let own = sources.bands.as_ref().unwrap_or(scene.radiance.grid());
    let mut parts = vec![format!("{}, {}", sources.what, bands(own))];
    parts.push(format!("{} × {} samples", scene.columns(), scene.rows()));
    if let Some([mean, most]) = luminances {
        parts.push(format!("{} cd/m², up to {}", digits(mean), digits(most)));
    }
    parts.push(match (&scene.depth, &sources.depth) {
        (Some(depth), from) => {
            let from = from.as_ref().map_or_else(String::new, |from| format!(" {from}"));
            format!("depth {}{from}", range(depth))
        }
        (None, _) => "no depth".to_owned(),
    });
    parts.push(match (scene.view, &sources.view) {
        (Some(view), from) => {
            let off = axis(view, scene.rows(), scene.columns());
            let from = from.as_ref().map_or_else(String::new, |from| format!(" by {from}"));
            format!("{:.1}° wide{from}{off}", view.horizontal_fov_deg(scene.columns()))
        }
        (None, _) => "no field of view".to_owned(),
    });
    format!("{}: {}", scene.name, parts.join("; "))
}

/// Returns questions about what a scene's numbers cannot well be.
fn doubts(scene: &Scene, luminances: Option<[f64; 2]>) -> Vec<String> {
    let mut doubts = vec![];
    if let Some([mean, _]) = luminances
        && !(LUMINANCES_CD_M2[0]..=LUMINANCES_CD_M2[1]).contains(&mean)
    {
        doubts.push(format!(
            "{}: is its mean luminance really {} cd/m²? What its numbers are can be said: --quantity, --unit, --scale",
            scene.name,
            digits(mean)
        ));
    }
    if let Some(depth) = &scene.depth {
        let finite = depth.z_m().iter().copied().filter(|z| z.is_finite());
        let (near, far) = finite.fold((f32::INFINITY, 0.0_f32), |(near, far), z| (near.min(z), far.max(z)));
        if f64::from(near) < DEPTHS_M[0] || f64::from(far) > DEPTHS_M[1] {
            doubts.push(format!(
                "{}: do its depths really lie {}? What they are can be said: --depth-unit, --depth-kind",
                scene.name,
                range(depth)
            ));
        }
    }
    doubts
}

/// Reflectances above which even a mirror or a fluorescent dye hardly is, and the share of samples of which no more are.
const LIKELY_REFLECTANCE: f32 = 2.0;
const LIKELY_SHARE: f64 = 0.01;

/// Returns a question about reflectances that are more than white, such as those in percent.
pub(super) fn doubt_of_reflectances(name: &str, image: &Image) -> Option<String> {
    let Image::Spectral(image) = image else { return None };
    if image.quantity() != Quantity::Reflectance {
        return None;
    }
    let n = image.planes().iter().map(Array2::len).sum::<usize>().max(1);
    let n_above: usize =
        image.planes().par_iter().map(|plane| plane.iter().filter(|v| **v > LIKELY_REFLECTANCE).count()).sum();
    let sum: f64 = image.planes().par_iter().map(|plane| plane.iter().map(|v| f64::from(*v)).sum::<f64>()).sum();
    (n_above as f64 > LIKELY_SHARE * n as f64).then(|| {
        format!(
            "{name}: does it really reflect {} times as much as a perfect white, on average? Percent are --white-level 100 or --scale 0.01",
            digits(sum / n as f64)
        )
    })
}

/// Returns bands in words.
pub(super) fn bands(grid: &WavelengthGrid) -> String {
    let (first, last) = grid.range_nm();
    let widths = grid.centers_nm().windows(2).map(|pair| pair[1] - pair[0]);
    let (least, most) = widths.fold((f64::INFINITY, 0.0), |(least, most), w| (f64::min(least, w), f64::max(most, w)));
    let (first, last) = (short(first), short(last));
    match grid.len() {
        1 => format!("1 band at {first} nm"),
        n if short(most) == short(least) => format!("{n} bands of {first}–{last} nm, {} nm apart", short(least)),
        n => format!("{n} bands of {first}–{last} nm, {} to {} nm apart", short(least), short(most)),
    }
}

/// Neighboring bands may be so far apart, and the outer edges of bands so far inside the light that is seen, nm: beyond, patches of the usual chart
/// are off by 10 and more in color (CIEDE2000), since a band stands for a flat spectrum.
const WIDEST_NM: f64 = 100.0;
const EDGES_NM: [f64; 2] = [450.0, 630.0];
/// What is seen best, nm.
const SEEN_NM: [f64; 2] = [420.0, 680.0];

/// Returns in a sentence which visible light several bands leave out between or beside them.
pub(crate) fn note_of_gaps(name: &str, grid: &WavelengthGrid) -> Option<String> {
    let [low, high] = SEEN_NM;
    let nm = grid.centers_nm();
    if nm.iter().filter(|nm| (low..=high).contains(*nm)).count() < 3 {
        return None;
    }
    let (first, last, n) = (nm[0], nm[nm.len() - 1], nm.len());
    let below = (nm[0] - 0.5 * (nm[1] - nm[0]) > EDGES_NM[0]).then(|| format!("below {} nm", short(first)));
    let above = (last + 0.5 * (last - nm[n - 2]) < EDGES_NM[1]).then(|| format!("above {} nm", short(last)));
    let is_wide = |pair: &&[f64]| pair[1].min(high) - pair[0].max(low) > WIDEST_NM;
    let between =
        nm.windows(2).filter(is_wide).map(|pair| format!("between {} and {} nm", short(pair[0]), short(pair[1])));
    let gaps: Vec<String> = below.into_iter().chain(between).chain(above).collect();
    let gaps = (!gaps.is_empty()).then(|| gaps.join(" and "))?;
    Some(format!(
        "{name}: no band lies {gaps}: spectra are taken for flat there, so that colors and luminance are rough"
    ))
}

/// Returns in a sentence how the bands of a file become those wanted, where they are others.
pub(super) fn resampling_note(name: &str, own: &WavelengthGrid, wanted: Option<&WavelengthGrid>) -> Option<String> {
    let wanted = wanted.filter(|wanted| *wanted != own)?;
    Some(format!(
        "{name}: {} become {}: spectra run in straight lines between the centers of bands, and a band wider than those of the file takes \
         the mean over its width",
        bands(own),
        bands(wanted)
    ))
}

/// Returns the mean luminance and the largest behind a semicolon; nothing where the bands are not seen.
pub(super) fn brightness(image: &SpectralImage) -> String {
    luminances(image)
        .map_or_else(String::new, |[mean, most]| format!("; {} cd/m², up to {}", digits(mean), digits(most)))
}

/// Returns a length with the digits that tell.
fn short(nm: f64) -> f64 {
    (100.0 * nm).round() / 100.0
}

/// Returns the mean luminance and the largest, cd/m²; `None` where the bands are not seen.
fn luminances(image: &SpectralImage) -> Option<[f64; 2]> {
    let [_, weights, _] = Observer::Cie1931.weights(image.grid());
    // A thousandth of what the bands of a whole spectrum weigh.
    if weights.iter().sum::<f64>() < 1e-3 * 683.0 * 106.9 {
        return None;
    }
    let seen: Vec<(&Array2<f32>, f32)> =
        image.planes().iter().zip(weights).filter(|(_, w)| *w > 0.0).map(|(plane, w)| (plane, w as f32)).collect();
    let of_row = |row: usize| {
        let mut sums = vec![0.0_f32; image.columns()];
        for (plane, weight) in &seen {
            sums.iter_mut().zip(plane.row(row)).for_each(|(sum, v)| *sum += weight * v);
        }
        let sum: f64 = sums.iter().map(|v| f64::from(*v)).sum();
        (sum, sums.into_iter().fold(0.0, f32::max))
    };
    let rows: Vec<(f64, f32)> = (0..image.rows()).into_par_iter().map(of_row).collect();
    let n = (image.rows() * image.columns()) as f64;
    let most = rows.iter().map(|(_, most)| *most).fold(0.0, f32::max);
    Some([rows.iter().map(|(sum, _)| sum).sum::<f64>() / n, most.into()])
}

/// Returns the nearest and the farthest depth in words.
pub(super) fn range(depth: &DepthMap) -> String {
    let (near, far) = depth.range_m();
    let (near, far) = (digits(near), if far.is_finite() { digits(far) } else { "∞".to_owned() });
    if near == far { format!("{near} m") } else { format!("{near}–{far} m") }
}

/// Returns where the axis is, if it is not in the middle.
fn axis(view: View, rows: usize, columns: usize) -> String {
    let across = view.center_x_px - 0.5 * (columns as f64 - 1.0);
    let down = view.center_y_px - 0.5 * (rows as f64 - 1.0);
    if across.hypot(down) < 0.05 * columns as f64 {
        return String::new();
    }
    // The sum has no 0 below 0.
    let [across, down] = [across, down].map(|samples| (10.0 * samples).round() / 10.0 + 0.0);
    format!(", its axis {across} samples right of and {down} below the middle")
}

/// Returns a number with three digits.
fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor();
    if !(-3.0..6.0).contains(&exponent) {
        return format!("{value:.1e}");
    }
    format!("{value:.*}", (2.0 - exponent).max(0.0) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectances_in_percent_are_asked_about() {
        let of = |quantity, value: f32| {
            let grid = WavelengthGrid::new(vec![450.0, 550.0]).unwrap();
            Image::Spectral(SpectralImage::new(quantity, grid, vec![Array2::from_elem((4, 5), value); 2]).unwrap())
        };
        let doubt = doubt_of_reflectances("a.csv", &of(Quantity::Reflectance, 48.0)).unwrap();
        assert!(doubt.contains("48.0 times") && doubt.contains("--scale 0.01"), "{doubt}");
        assert_eq!(doubt_of_reflectances("a.csv", &of(Quantity::Reflectance, 1.2)), None);
        assert_eq!(doubt_of_reflectances("a.csv", &of(Quantity::Radiance, 48.0)), None);
    }

    #[test]
    fn gaps_between_few_bands_are_said() {
        for (nm, said) in [
            (&[450.0, 500.0, 560.0, 620.0][..], None),
            (&[405.0, 440.0, 470.0, 525.0, 560.0, 610.0, 670.0], None),
            (&[450.0, 550.0, 650.0, 850.0], None),
            (&[900.0, 1000.0, 1200.0], None),
            (&[550.0], None),
            (&[450.0, 500.0, 610.0, 650.0], Some("no band lies between 500 and 610 nm:")),
            (&[500.0, 510.0, 520.0, 700.0, 1300.0], Some("no band lies below 500 nm and between 520 and 700 nm:")),
            (&[450.0, 500.0, 560.0], Some("no band lies above 560 nm:")),
        ] {
            let note = note_of_gaps("a", &WavelengthGrid::new(nm.to_vec()).unwrap());
            assert_eq!(note.is_some(), said.is_some(), "{nm:?}: {note:?}");
            assert!(said.is_none_or(|said| note.as_ref().is_some_and(|note| note.contains(said))), "{nm:?}: {note:?}");
        }
    }

    fn scene(radiance: f32) -> Scene {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let planes = vec![Array2::from_elem((6, 8), radiance); grid.len()];
        let scene = Scene::new("a.hdr", SpectralImage::new(Quantity::Radiance, grid, planes).unwrap());
        scene.or_flat_depth_m(2.0).unwrap().or_horizontal_fov_deg(20.0).unwrap()
    }

    #[test]
    fn line_says_what_the_scene_is() {
        // 683 lm/W × 106.86 nm × .01 W m⁻² sr⁻¹ nm⁻¹.
        let sources = Sources { what: "radiance".to_owned(), depth: Some("of a.pfm".to_owned()), ..Sources::default() };
        assert_eq!(
            line(&scene(0.01), &sources, luminances(&scene(0.01).radiance)),
            "a.hdr: radiance, 31 bands of 400–700 nm, 10 nm apart; 8 × 6 samples; 730 cd/m², up to 730; depth 2.00 m of a.pfm; \
             20.0° wide"
        );
    }

    fn asked(scene: &Scene) -> Vec<String> {
        doubts(scene, luminances(&scene.radiance))
    }

    #[test]
    fn what_cannot_well_be_is_asked_about() {
        assert!(asked(&scene(0.01)).is_empty());
        for wrong in [0.0, 1e-12, 1e6] {
            assert!(asked(&scene(wrong))[0].contains("--unit"), "{wrong}");
        }
        let far = Scene { depth: Some(DepthMap::flat(6, 8, 3e6).unwrap()), ..scene(0.01) };
        assert!(asked(&far)[0].contains("--depth-unit"));
        let sky = Scene { depth: Some(DepthMap::flat(6, 8, f64::INFINITY).unwrap()), ..scene(0.01) };
        assert!(asked(&sky).is_empty());
        // What nobody sees has no luminance.
        let grid = WavelengthGrid::uniform(1000.0, 1700.0, 100.0).unwrap();
        let planes = vec![Array2::from_elem((2, 2), 1.0); grid.len()];
        let infrared = Scene::new("b", SpectralImage::new(Quantity::Radiance, grid, planes).unwrap());
        assert!(asked(&infrared).is_empty());
    }
}
