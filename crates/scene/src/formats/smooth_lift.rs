//! Pictures as reflectances under a light: smooth spectra whose colors are those of the picture under D65.
//!
//! Each color is lifted by [`SmoothReflectance`], and what that misses is added as a mixture of the lifts of red, green and blue, so that
//! under D65 the color comes back exactly. On few or uneven bands sums differ from integrals: on the bands of a picture the same mixture
//! is added until they have, relative to white, the tristimulus values that the reflectance has under the light itself. Bands that would be
//! below 0 are 0, and the others have what these lack; a color that is that of no spectrum of the bands becomes the nearest that is.

use std::path::Path;

use dioptric_pictures::DynamicImage;
use dioptric_spectrum::{
    Illuminant, Observer, Quantity, SmoothReflectance, SpectralImage, WavelengthGrid, Xyz, srgb_decode,
};
use glam::{DMat3, DVec3};
use ndarray::Array2;
use rayon::prelude::*;

use super::unusable::check_made;
use crate::SceneError;

/// What tristimulus values may lack for a shift of 1, so that a color that no reflectances of the bands have has a nearest.
const LEAST_SHARE: f64 = 1e-5;

/// The most steps of Newton's method.
const MOST_STEPS: usize = 30;

/// The share of white that a band has at least that is moved as far as others.
const LEAST_SEEN: f64 = 1e-3;

/// The least part of the light that bands have where they are to have its colors.
const LEAST_LIGHT: f64 = 0.02;

/// Bands tell colors where the tristimulus values of white are within this share of those of the light.
const LIKE_THE_LIGHT: f64 = 0.3;

/// The least determinant of what the lifts of red, green and blue are on bands that tell them apart.
const TELLING: f64 = 1e-3;

/// How colors become reflectances on the bands of a grid.
pub(super) struct SmoothLift {
    fine_nm: Vec<f32>,
    /// What a reflectance of 1 at each fine wavelength gives under D65, as linear sRGB, white being (1, 1, 1).
    d65: Vec<DVec3>,
    /// And under the light, as tristimulus values, white being (1, 1, 1).
    light: Vec<DVec3>,
    bands_nm: Vec<f32>,
    /// What a reflectance of 1 in each band adds to them.
    bands: Vec<DVec3>,
    /// The chromaticity of each band's light.
    directions: Vec<DVec3>,
    /// The lifts of red, green and blue on the bands, and their tristimulus values under the light.
    primaries: [Vec<f64>; 3],
    primaries_light: DMat3,
    /// From linear sRGB under D65, and from tristimulus values of the bands, to their mixture; none where bands tell no colors.
    mixture_of_rgb: DMat3,
    mixture_of_bands: Option<DMat3>,
}

impl SmoothLift {
    /// Prepares the lift of a picture under a light.
    pub(super) fn new(grid: &WavelengthGrid, light: &Illuminant) -> Result<Self, SceneError> {
        let fine = WavelengthGrid::uniform(380.0, 780.0, 5.0)?;
        let seen = |grid: &WavelengthGrid, light: &Illuminant| -> Vec<DVec3> {
            let [x, y, z] = Observer::Cie1931.weights(grid);
            let white = light.white_radiance(grid, 1.0);
            white.iter().enumerate().map(|(i, v)| *v * DVec3::new(x[i], y[i], z[i])).collect()
        };
        let relative = |values: &[DVec3], white: DVec3| -> Vec<DVec3> { values.iter().map(|v| *v / white).collect() };
        let sum = |values: &[DVec3]| values.iter().copied().sum::<DVec3>();
        let d65: Vec<DVec3> = seen(&fine, &Illuminant::D65)
            .iter()
            .map(|v| DVec3::from_array(Xyz(v.to_array()).to_linear_srgb()))
            .collect();
        let d65 = relative(&d65, sum(&d65));
        let under_light = seen(&fine, light);
        let white = sum(&under_light);
        let of_bands = seen(grid, light);
        let band_white = sum(&of_bands);
        let share = band_white / white;
        let has_colors = grid.len() >= 3 && share.min_element() > LEAST_LIGHT;
        let tells_colors = has_colors && (share - DVec3::ONE).abs().max_element() < LIKE_THE_LIGHT;
        let bands = if has_colors { relative(&of_bands, band_white) } else { vec![DVec3::ZERO; grid.len()] };
        let directions = bands.iter().map(|weights| *weights / weights.element_sum().max(LEAST_SEEN)).collect();
        let nm = |grid: &WavelengthGrid| grid.centers_nm().iter().map(|nm| *nm as f32).collect::<Vec<f32>>();
        let (fine_nm, bands_nm) = (nm(&fine), nm(grid));
        let light = relative(&under_light, white);
        let lifts = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(SmoothReflectance::of_rgb);
        let on = |nm: &[f32]| lifts.map(|lift| nm.iter().map(|nm| f64::from(lift.at(&[*nm])[0])).collect::<Vec<f64>>());
        let seen_by = |spectra: &[Vec<f64>; 3], weights: &[DVec3]| {
            let of = |spectrum: &Vec<f64>| spectrum.iter().zip(weights).map(|(v, w)| *v * *w).sum::<DVec3>();
            DMat3::from_cols(of(&spectra[0]), of(&spectra[1]), of(&spectra[2]))
        };
        let (fine_primaries, primaries) = (on(&fine_nm), on(&bands_nm));
        let on_bands = seen_by(&primaries, &bands);
        let mixture_of_bands = (tells_colors && on_bands.determinant().abs() > TELLING).then(|| on_bands.inverse());
        Ok(Self {
            mixture_of_rgb: seen_by(&fine_primaries, &d65).inverse(),
            primaries_light: seen_by(&fine_primaries, &light),
            fine_nm,
            d65,
            light,
            bands_nm,
            bands,
            directions,
            primaries,
            mixture_of_bands,
        })
    }

    /// Puts the reflectances of a linear color on the bands into `spectrum`.
    ///
    /// Parts below 0 are 0; a color above 1 is that of a brighter thing of the same hue.
    fn lift(&self, rgb: [f32; 3], spectrum: &mut [f64]) {
        let rgb = rgb.map(|v| v.max(0.0));
        let most = rgb.iter().copied().fold(1.0, f32::max);
        let smooth = SmoothReflectance::of_rgb(rgb.map(|v| v / most));
        let (mut seen, mut wanted) = (DVec3::ZERO, DVec3::ZERO);
        for ((nm, d65), light) in self.fine_nm.iter().zip(&self.d65).zip(&self.light) {
            let value = f64::from(smooth.at(&[*nm])[0]);
            seen += value * *d65;
            wanted += value * *light;
        }
        let missed = DVec3::from_array(rgb.map(|v| f64::from(v / most))) - seen;
        let mut mixture = self.mixture_of_rgb * missed;
        wanted += self.primaries_light * mixture;
        if let Some(mixture_of_bands) = &self.mixture_of_bands {
            let mut on_bands = DVec3::ZERO;
            for (nm, weights) in self.bands_nm.iter().zip(&self.bands) {
                on_bands += f64::from(smooth.at(&[*nm])[0]) * *weights;
            }
            mixture = *mixture_of_bands * (wanted - on_bands);
        }
        let own = |band: usize| f64::from(smooth.at(&[self.bands_nm[band]])[0]);
        let more = |band: usize| DVec3::from_array(self.primaries.each_ref().map(|primary| primary[band]));
        spectrum.iter_mut().enumerate().for_each(|(band, value)| *value = own(band) + mixture.dot(more(band)));
        if self.bands.iter().any(|weights| *weights != DVec3::ZERO) {
            self.add_lacking(wanted, spectrum);
        }
        spectrum.iter_mut().for_each(|value| *value = f64::from(most) * value.max(0.0));
    }

    /// Moves the values of bands to those from 0 to 1, or as far as they are above, that have the tristimulus values that are wanted, or come nearest
    /// to them: of all these the one that differs least, each band along the chromaticity of its light (Newton's method on the dual problem).
    fn add_lacking(&self, wanted: DVec3, spectrum: &mut [f64]) {
        let own = spectrum.to_vec();
        let mut shift = DVec3::ZERO;
        for _ in 0..MOST_STEPS {
            let (mut lacking, mut slopes) =
                (wanted - LEAST_SHARE * shift, DMat3::from_diagonal(DVec3::splat(LEAST_SHARE)));
            for (band, value) in spectrum.iter_mut().enumerate() {
                let (weights, seen) = (self.bands[band], self.directions[band]);
                let most = own[band].max(1.0);
                *value = (own[band] + seen.dot(shift)).clamp(0.0, most);
                lacking -= *value * weights;
                if *value > 0.0 && (*value < most || shift == DVec3::ZERO) {
                    slopes += DMat3::from_cols(seen.x * weights, seen.y * weights, seen.z * weights);
                }
            }
            if lacking.abs().max_element() < 1e-9 {
                break;
            }
            shift += slopes.inverse() * lacking;
        }
    }

    /// Returns the radiance of colors under the light whose white has this radiance, a value a band.
    pub(super) fn radiance(
        &self,
        path: &Path,
        colors: &Colors<'_>,
        white: &[f64],
        grid: &WavelengthGrid,
    ) -> Result<SpectralImage, SceneError> {
        let (rows, columns) = colors.size();
        check_made(path, (4 * grid.len() as u64 + 16).saturating_mul(rows as u64).saturating_mul(columns as u64))?;
        let mut planes: Vec<Array2<f32>> = (0..grid.len()).map(|_| Array2::zeros((rows, columns))).collect();
        let mut lines: Vec<Vec<&mut [f32]>> = (0..rows).map(|_| Vec::with_capacity(grid.len())).collect();
        for plane in &mut planes {
            let samples = plane.as_slice_mut().expect("a new plane is in standard order");
            lines.iter_mut().zip(samples.chunks_mut(columns.max(1))).for_each(|(line, samples)| line.push(samples));
        }
        lines.into_par_iter().enumerate().for_each(|(row, mut bands)| {
            let mut spectrum = vec![0.0; white.len()];
            let mut last = None;
            for column in 0..columns {
                let rgb = colors.at(row, column);
                // Flat parts of pictures are lifted once.
                if last.replace(rgb) != Some(rgb) {
                    self.lift(rgb, &mut spectrum);
                }
                for ((band, value), white) in bands.iter_mut().zip(&spectrum).zip(white) {
                    band[column] = (value * white) as f32;
                }
            }
        });
        Ok(SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?)
    }
}

/// Linear colors of a picture.
pub(super) enum Colors<'a> {
    Linear(&'a [Array2<f32>; 3]),
    /// Codes of sRGB, 16 bits, three a pixel, and the light of each code.
    Codes {
        picture: image::ImageBuffer<image::Rgb<u16>, Vec<u16>>,
        light: Vec<f32>,
    },
}

impl Colors<'_> {
    /// The colors of a picture of codes.
    pub(super) fn of_codes(picture: DynamicImage) -> Self {
        let light = (0..=u16::MAX).map(|code| srgb_decode(f64::from(code) / 65535.0) as f32).collect();
        Self::Codes { picture: picture.into_rgb16(), light }
    }

    fn size(&self) -> (usize, usize) {
        match self {
            Self::Linear(planes) => planes[0].dim(),
            Self::Codes { picture, .. } => (picture.height() as usize, picture.width() as usize),
        }
    }

    fn at(&self, row: usize, column: usize) -> [f32; 3] {
        match self {
            Self::Linear(planes) => [0, 1, 2].map(|k| planes[k][(row, column)]),
            Self::Codes { picture, light } => {
                picture.get_pixel(column as u32, row as u32).0.map(|code| light[usize::from(code)])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_spectrum::{Lab, color_checker_reflectances, delta_e_2000};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn grids() -> Vec<WavelengthGrid> {
        let uniform = |step: f64| WavelengthGrid::uniform(400.0, 700.0, step).unwrap();
        let uneven = |centers_nm: [f64; 7]| WavelengthGrid::new(centers_nm.to_vec()).unwrap();
        vec![
            uniform(1.0),
            uniform(5.0),
            uniform(10.0),
            uniform(20.0),
            uneven([405.0, 440.0, 470.0, 525.0, 560.0, 610.0, 670.0]),
            uneven([405.0, 450.0, 500.0, 540.0, 590.0, 640.0, 690.0]),
            uneven([410.0, 440.0, 490.0, 530.0, 580.0, 620.0, 680.0]),
        ]
    }

    fn lights() -> [Illuminant; 4] {
        [Illuminant::D65, Illuminant::D50, Illuminant::A, Illuminant::parse("5500K").unwrap()]
    }

    /// The 24 patches in linear sRGB, those beyond its gamut moved into it.
    fn patches() -> Vec<[f32; 3]> {
        let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
        let white = Illuminant::D65.white_radiance(&grid, std::f64::consts::PI);
        let seen = |reflectance: &[f64]| {
            let light: Vec<f64> = reflectance.iter().zip(&white).map(|(r, w)| r * w).collect();
            Observer::Cie1931.xyz(&grid, &light).to_linear_srgb()
        };
        let chart = color_checker_reflectances();
        chart.iter().map(|(_, r)| seen(&r.sample_held(&grid)).map(|v| v.clamp(0.0, 1.0) as f32)).collect()
    }

    fn lab(xyz: [f64; 3], white: [f64; 3]) -> Lab {
        Xyz([0, 1, 2].map(|k| xyz[k])).to_lab(Xyz(white))
    }

    fn seen(lift: &SmoothLift, grid: &WavelengthGrid, light: &Illuminant, rgb: [f32; 3]) -> Lab {
        let white = light.white_radiance(grid, std::f64::consts::PI);
        let mut spectrum = vec![0.0; grid.len()];
        lift.lift(rgb, &mut spectrum);
        let lit: Vec<f64> = spectrum.iter().zip(&white).map(|(r, w)| r * w).collect();
        lab(Observer::Cie1931.xyz(grid, &lit).0, Observer::Cie1931.xyz(grid, &white).0)
    }

    /// On bands of which some would be below 0 the others have what these lack: patches were off by 4 to 11.
    #[test]
    fn patches_keep_their_colors_where_bands_have_nothing() {
        let (light, fine) = (Illuminant::D65, WavelengthGrid::uniform(380.0, 780.0, 1.0).unwrap());
        let exact = SmoothLift::new(&fine, &light).unwrap();
        for nm in [
            [422.0, 459.0, 473.0, 477.0, 503.0, 563.0, 699.0],
            [407.0, 428.0, 435.0, 478.0, 508.0, 580.0, 682.0],
            [408.0, 509.0, 534.0, 582.0, 589.0, 628.0, 642.0],
        ] {
            let grid = WavelengthGrid::new(nm.to_vec()).unwrap();
            let lift = SmoothLift::new(&grid, &light).unwrap();
            for rgb in patches() {
                let off = delta_e_2000(seen(&lift, &grid, &light, rgb), seen(&exact, &fine, &light, rgb));
                assert!(off < 0.3, "{rgb:?} on {nm:?}: {off}");
            }
        }
    }

    /// Under each light and on each grid white is the light's own, and patches are what their reflectance under D65 to the code, and the
    /// same reflectance at every 1 nm, are.
    #[test]
    fn patches_keep_their_colors_on_any_bands() {
        let fine = WavelengthGrid::uniform(380.0, 780.0, 1.0).unwrap();
        for light in lights() {
            for grid in grids() {
                let lift = SmoothLift::new(&grid, &light).unwrap();
                let exact = SmoothLift::new(&fine, &light).unwrap();
                let seen = |lift: &SmoothLift, grid: &WavelengthGrid, rgb: [f32; 3]| seen(lift, grid, &light, rgb);
                let (white, true_white) = (seen(&lift, &grid, [1.0; 3]), lab([1.0; 3], [1.0; 3]));
                assert!(delta_e_2000(white, true_white) < 1e-6);
                for rgb in patches() {
                    let found = seen(&lift, &grid, rgb);
                    let off = delta_e_2000(found, seen(&exact, &fine, rgb));
                    // The bar is 1; sums of the bands are made equal, as far as none is below 0.
                    assert!(off < 0.3, "{rgb:?} under {light:?} on {} bands: {off}", grid.len());
                    if light == Illuminant::D65 {
                        let shown = lab(Xyz::from_linear_srgb(rgb.map(f64::from)).0, Xyz::from_linear_srgb([1.0; 3]).0);
                        let off = delta_e_2000(found, shown);
                        assert!(off < 0.5, "{rgb:?} on {} bands: {off} from the picture", grid.len());
                    }
                }
            }
        }
    }

    /// Of bands at random most keep the colors of all patches, and none is far above white: others have no such reflectances.
    #[test]
    fn patches_keep_their_colors_where_reflectances_have_them() {
        let (light, fine) = (Illuminant::D65, WavelengthGrid::uniform(380.0, 780.0, 1.0).unwrap());
        let exact = SmoothLift::new(&fine, &light).unwrap();
        let wanted: Vec<Lab> = patches().into_iter().map(|rgb| seen(&exact, &fine, &light, rgb)).collect();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let (mut n_sets, mut n_kept) = (0, 0);
        while n_sets < 200 {
            let mut nm: Vec<f64> = (0..7).map(|_| random.random_range(400.0_f64..700.0).round()).collect();
            nm.sort_by(f64::total_cmp);
            if nm.windows(2).any(|pair| pair[1] - pair[0] < 3.0) {
                continue;
            }
            n_sets += 1;
            let grid = WavelengthGrid::new(nm.clone()).unwrap();
            let lift = SmoothLift::new(&grid, &light).unwrap();
            let mut worst = 0.0_f64;
            for (rgb, wanted) in patches().into_iter().zip(&wanted) {
                worst = worst.max(delta_e_2000(seen(&lift, &grid, &light, rgb), *wanted));
                let mut spectrum = vec![0.0; 7];
                lift.lift(rgb, &mut spectrum);
                assert!(spectrum.iter().all(|value| *value < 2.0), "{rgb:?} on {nm:?}: {spectrum:?}");
            }
            n_kept += usize::from(worst <= 1.0);
        }
        // Before what bands lack was given by their own colors 126 of 200 did.
        assert!(n_kept >= 160, "{n_kept}");
    }

    /// Two bands cannot tell colors: they have the reflectances there.
    #[test]
    fn few_bands_have_the_reflectance_at_them() {
        let (few, many) = ([500.0, 600.0], WavelengthGrid::uniform(400.0, 700.0, 1.0).unwrap());
        let lift = SmoothLift::new(&WavelengthGrid::new(few.to_vec()).unwrap(), &Illuminant::D65).unwrap();
        let fine = SmoothLift::new(&many, &Illuminant::D65).unwrap();
        let (mut on_few, mut on_many) = (vec![0.0; 2], vec![0.0; many.len()]);
        lift.lift([0.5, 0.2, 0.1], &mut on_few);
        fine.lift([0.5, 0.2, 0.1], &mut on_many);
        for (nm, value) in few.iter().zip(on_few) {
            // What the fine grid's own sums need is a thousandth.
            assert!((value - on_many[*nm as usize - 400]).abs() < 3e-3, "{value} at {nm} nm");
        }
    }
}
