//! The light of what a reader found: reflectances under a light, colors as a display shows them or as things reflect them.

use std::path::Path;

use dioptric_spectrum::{Display, Illuminant, Quantity, SmoothReflectance, SpectralImage, Spectrum, WavelengthGrid};
use ndarray::Array2;

use super::{
    contents::{Contents, Image},
    no_data::mend,
    picture::{BEYOND, lifted, lifted_codes, linear_srgb, note_beyond},
    read_options::ReadOptions,
    reading::FileQuantity,
    smooth_lift::{Colors, SmoothLift},
    stated::name_of,
    understood::bands,
    unusable::{in_file, unreadable},
};
use crate::{SceneError, SceneLight, resampled};

/// The illuminance on reflectances, and on a white of ordinary pictures, lx.
const USUAL_LUX: f64 = 1000.0;

/// Returns the bands of a picture without a spectrum.
fn picture_bands(options: &ReadOptions) -> Result<WavelengthGrid, SceneError> {
    Ok(match &options.grid {
        Some(grid) => grid.clone(),
        None => WavelengthGrid::uniform(400.0, 700.0, 10.0)?,
    })
}

/// Returns the radiance on the bands wanted, and the light that is on it, where that is known.
///
/// A picture on a display is light of its own: its white is that of the display on these very bands, or, where another light is asked
/// for, of that light.
pub(super) fn lit(
    path: &Path,
    contents: Contents,
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<(SpectralImage, Option<SceneLight>), SceneError> {
    notes.extend(replaced(path, &contents, options));
    let lux = |own: Option<f64>| options.illuminance_lux.or(own).unwrap_or(USUAL_LUX);
    let image = match contents.image {
        Image::Spectral(image) => image,
        colors if options.reading.quantity == Some(FileQuantity::Reflectance) => {
            return reflecting(path, colors, options, notes);
        }
        colors => {
            let grid = picture_bands(options)?;
            let own_lux = match &colors {
                Image::Linear { white_cd_m2: Some(white), .. } => Some(std::f64::consts::PI * white),
                _ => None,
            };
            let (basis, light) = white_basis(&grid, options.light.as_ref(), lux(own_lux))?;
            notes.extend(options.light.as_ref().and_then(|light| light.note_beyond_table(&grid)));
            let n_dark = (0..grid.len()).filter(|&band| basis.iter().all(|color| color[band].max(0.0) == 0.0)).count();
            if n_dark == grid.len() {
                let reason = format!(
                    "a display sends no light at {}, and its colors do not tell what would be there: expected bands in 380–780 nm, or a cube",
                    bands(&grid)
                );
                return Err(unreadable(path, reason));
            }
            if n_dark > 0 {
                let name = name_of(path);
                notes.push(format!(
                    "{name}: in {n_dark} of {} bands a display sends no light, nor does the picture",
                    grid.len()
                ));
            }
            let image = match colors {
                Image::Codes(picture, colors) => {
                    let (image, beyond_share) = lifted_codes(path, picture, colors.as_ref(), &basis, &grid)?;
                    notes.extend(note_beyond(path, beyond_share));
                    image
                }
                Image::Linear { mut planes, .. } => {
                    prepare_colors(path, &mut planes, options, notes)?;
                    let n = planes[0].len();
                    let is_beyond = |i: &usize| {
                        planes.iter().any(|plane| plane.as_slice().is_some_and(|own| f64::from(own[*i]) < -BEYOND))
                    };
                    notes.extend(note_beyond(path, (0..n).filter(is_beyond).count() as f64 / n.max(1) as f64));
                    lifted(&planes, &basis, &grid)?
                }
                Image::Spectral(image) => image,
            };
            return Ok((image, Some(light)));
        }
    };
    let image = match &options.grid {
        Some(grid) if grid != image.grid() => resampled(&image, grid).map_err(|error| in_file(path, &error))?,
        _ => image,
    };
    if image.quantity() != Quantity::Reflectance {
        return Ok((image, contents.light));
    }
    let (own, own_lux) = contents.light.map(|own| (own.illuminant, own.illuminance_lux)).unzip();
    let light = SceneLight::new(options.light.clone().or(own).unwrap_or(Illuminant::D65), lux(own_lux.flatten()));
    notes.extend(light.illuminant.note_beyond_table(image.grid()));
    let white = light.illuminant.white_radiance(image.grid(), light.illuminance_lux.unwrap_or(USUAL_LUX));
    let grid = image.grid().clone();
    let mut planes = image.into_planes();
    for (plane, white) in planes.iter_mut().zip(white) {
        plane.mapv_inplace(|v| (f64::from(v) * white) as f32);
    }
    Ok((SpectralImage::new(Quantity::Radiance, grid, planes)?, Some(light)))
}

/// Returns what is said of what a file states of its light and the options put another in the place of.
fn replaced(path: &Path, contents: &Contents, options: &ReadOptions) -> Option<String> {
    let is_lit = contents.is_reflectance(options);
    let white = match contents.image {
        Image::Linear { white_cd_m2, .. } => white_cd_m2,
        Image::Spectral(_) | Image::Codes(..) => None,
    };
    let own = contents.light.as_ref().filter(|_| is_lit);
    let lux = options.illuminance_lux.is_some().then_some("--illuminance-lux");
    let by_light = options.light.is_some().then_some("--illuminant");
    let stated = [
        ("white luminance", white.and(lux.or(is_lit.then_some("--quantity reflectance")))),
        ("illuminance", own.and_then(|own| own.illuminance_lux).and(lux)),
        ("light", own.and(by_light)),
    ];
    let replaced = stated.into_iter().filter_map(|(what, by)| Some(format!("its {what} by {}", by?)));
    let replaced: Vec<String> = replaced.collect();
    (!replaced.is_empty()).then(|| format!("{}: what it states is replaced, {}", name_of(path), replaced.join(", ")))
}

/// Returns the radiance of a picture whose colors are those of things that reflect light, and the light that is on them.
fn reflecting(
    path: &Path,
    colors: Image,
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<(SpectralImage, Option<SceneLight>), SceneError> {
    let grid = picture_bands(options)?;
    let light = SceneLight::new(
        options.light.clone().unwrap_or(Illuminant::D65),
        checked_lux(options.illuminance_lux.unwrap_or(USUAL_LUX))?,
    );
    light.illuminant.check()?;
    notes.extend(light.illuminant.note_beyond_table(&grid));
    let (first, last) = grid.range_nm();
    if first < SmoothReflectance::FITTED_NM[0] || last > SmoothReflectance::FITTED_NM[1] {
        let name = name_of(path);
        notes.push(format!(
            "{name}: what its colors reflect beyond {} to {} nm is not known",
            SmoothReflectance::FITTED_NM[0],
            SmoothReflectance::FITTED_NM[1]
        ));
    }
    let lift = SmoothLift::new(&grid, &light.illuminant)?;
    let white = light.illuminant.white_radiance(&grid, light.illuminance_lux.unwrap_or(USUAL_LUX));
    let mut planes = match colors {
        Image::Spectral(image) => return Ok((image, Some(light))),
        Image::Codes(picture, None) => {
            return Ok((lift.radiance(path, &Colors::of_codes(picture), &white, &grid)?, Some(light)));
        }
        Image::Codes(picture, colors) => linear_srgb(picture, colors.as_ref()),
        Image::Linear { planes, .. } => planes,
    };
    prepare_colors(path, &mut planes, options, notes)?;
    let is_beyond = |row: usize, column: usize| planes.iter().any(|plane| !(0.0..=1.0).contains(&plane[(row, column)]));
    let (rows, columns) = planes[0].dim();
    let n_beyond = (0..rows * columns).filter(|i| is_beyond(i / columns, i % columns)).count();
    if n_beyond > 0 {
        let what = "have colors below 0, which become 0, or above 1, which reflect more than white";
        notes.push(format!("{}: {n_beyond} of {} samples {what}", name_of(path), rows * columns));
    }
    let image = lift.radiance(path, &Colors::Linear(&planes), &white, &grid)?;
    Ok((image, Some(light)))
}

/// Mends linear colors and multiplies them, as the options say.
fn prepare_colors(
    path: &Path,
    planes: &mut [Array2<f32>; 3],
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<(), SceneError> {
    let choice = options.reading.no_data.unwrap_or_default();
    let scale = options.reading.scale.unwrap_or(1.0) as f32;
    let bands = WavelengthGrid::new(vec![450.0, 550.0, 650.0])?;
    notes.extend(mend_colors(path, &bands, planes, choice)?.note(path, choice));
    if scale != 1.0 {
        planes.iter_mut().for_each(|plane| plane.mapv_inplace(|v| v * scale));
    }
    Ok(())
}

/// Mends colors, of which negative ones are beyond the gamut and stay where there is light; where its luminance is below 0 there is none.
fn mend_colors(
    path: &Path,
    bands: &WavelengthGrid,
    planes: &mut [Array2<f32>; 3],
    choice: super::reading::NoData,
) -> Result<super::no_data::Mended, SceneError> {
    // Y of linear sRGB (IEC 61966-2-1).
    const LUMINANCES: [f32; 3] = [0.2126, 0.7152, 0.0722];
    let mut is_light = Array2::from_elem(planes[0].dim(), 0.0_f32);
    for (plane, weight) in planes.iter().zip(LUMINANCES) {
        is_light.scaled_add(weight, plane);
    }
    let is_light = is_light.mapv(|luminance| luminance >= 0.0);
    let has_numbers = |at: &(usize, usize)| planes.iter().all(|plane| plane[*at].is_finite());
    let mut wrong = is_light.indexed_iter().filter(|(at, is_light)| !(**is_light && has_numbers(at)));
    if let (super::reading::NoData::Refuse, Some(((row, column), _))) = (choice, wrong.next()) {
        let [r, g, b] = [0, 1, 2].map(|color| planes[color][(row, column)]);
        let reason = format!(
            "its color at row {row}, column {column} is {r}, {g}, {b}, expected numbers, and light that is not below 0 (--no-data refuse)"
        );
        return Err(unreadable(path, reason));
    }
    let colors = planes.clone();
    for plane in planes.iter_mut() {
        ndarray::Zip::from(plane).and(&is_light).for_each(|v, is_light| *v = if *is_light { v.max(0.0) } else { *v });
    }
    let mended = mend(path, bands, planes, choice)?;
    for (plane, own) in planes.iter_mut().zip(&colors) {
        let beyond = ndarray::Zip::from(plane).and(own).and(&is_light);
        beyond.for_each(|v, own, is_light| *v = if *is_light && *own < 0.0 { *own } else { *v });
    }
    Ok(mended)
}

/// Returns the words for the light that was put on reflectances.
pub(super) fn under(light: &SceneLight) -> String {
    let [x, y] = light.illuminant.chromaticity();
    let lux = light.illuminance_lux.map_or_else(String::new, |lux| format!(" and {lux:.0} lx"));
    format!(", under a light of x, y {x:.3}, {y:.3}{lux}")
}

fn checked_lux(lux: f64) -> Result<f64, SceneError> {
    if lux.is_finite() && lux > 0.0 {
        return Ok(lux);
    }
    Err(SceneError::Setting {
        what: "the illuminance on the picture's white",
        value: format!("{lux} lx"),
        expected: "a finite number above 0".to_owned(),
    })
}

/// Returns the spectra of red, green and blue on a grid, and the light of which their sum is the white.
fn white_basis(
    grid: &WavelengthGrid,
    wanted: Option<&Illuminant>,
    lux: f64,
) -> Result<([Vec<f64>; 3], SceneLight), SceneError> {
    checked_lux(lux)?;
    let display = Display::apple_studio();
    let mut basis = display.srgb_basis(grid, lux / std::f64::consts::PI);
    let white: Vec<f64> =
        (0..grid.len()).map(|band| (basis[0][band] + basis[1][band] + basis[2][band]).max(0.0)).collect();
    let Some(wanted) = wanted else {
        // On the picture's own bands: a white from other samples of the display's spectrum would tint it.
        let is_known = grid.len() > 1 && white.iter().any(|v| *v > 0.0);
        let spectrum = if is_known {
            Spectrum::new(grid.centers_nm().to_vec(), white)?
        } else {
            let fine = WavelengthGrid::uniform(380.0, 780.0, 1.0)?;
            let [r, g, b] = display.srgb_basis(&fine, 1.0);
            Spectrum::new(fine.centers_nm().to_vec(), (0..fine.len()).map(|i| (r[i] + g[i] + b[i]).max(0.0)).collect())?
        };
        return Ok((basis, SceneLight::new(Illuminant::Spectrum(spectrum), lux)));
    };
    wanted.check()?;
    let target = wanted.white_radiance(grid, lux);
    for color in &mut basis {
        for ((v, white), target) in color.iter_mut().zip(&white).zip(&target) {
            *v = if *white > 0.0 { *v * target / white } else { 0.0 };
        }
    }
    Ok((basis, SceneLight::new(wanted.clone(), lux)))
}
