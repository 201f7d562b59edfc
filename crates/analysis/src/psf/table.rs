//! Point-spread functions over field, distance and wavelength, with what is measured of them.

use std::path::Path;

use dioptric_diffraction::{
    PupilSamples, TransferFunction, TransferQuality, WaveQuality, WaveWindow, WindowCenter, wave_psf,
};
use dioptric_optics::{Lens, MonoLens, ObjectPoint, glam::DVec2};
use dioptric_psf::{ImageSettings, LensImageModel, ModelUse, Picture, PointImage};
use dioptric_scene::{ExrSamples, write_npz_arrays, write_planes_exr};
use dioptric_spectrum::Cancel;
use ndarray::Array2;
use rayon::prelude::*;

use super::request::{Item, LARGEST};
use super::row::{PointName, WHOLE, place_and_size};
use super::spot::{PaperRays, Spot};
use super::windowed::Windowed;
use crate::{FilmPlace, PsfRequest, PsfRow, PsfSampling};
use dioptric_pipeline::PipelineError;
use dioptric_psf::Diffraction;

/// Pixels along a picture that holds all of a large blur.
const COARSE_PIXELS: f64 = 800.0;

/// Point-spread functions with their pictures.
#[derive(Clone, Debug)]
pub struct PsfSet {
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// What is there, in a few words.
    pub film: String,
    /// Side of a pixel, µm.
    pub pixel_um: f64,
    /// What is measured: fields outermost, then distances, then wavelengths.
    pub rows: Vec<PsfRow>,
    /// The energy on each pixel about the centroid, in the order of `rows`; the sum is at most 1.
    pub pictures: Vec<Array2<f32>>,
    /// The weight of each wavelength in the light of all of them, in the order of the request.
    pub spectral_weights: Vec<f64>,
}

impl PsfRequest {
    /// Computes the point-spread functions of a lens on all threads.
    ///
    /// # Errors
    /// When a number makes no sense, a glass is not known at a wavelength, or the lens cannot be focused.
    pub fn compute(&self, lens: &Lens) -> Result<PsfSet, PipelineError> {
        self.compute_until(lens, &Cancel::new())
    }

    /// Computes them until that is cancelled.
    ///
    /// # Errors
    /// As [`compute`](Self::compute), and when it is cancelled.
    pub fn compute_until(&self, lens: &Lens, cancel: &Cancel) -> Result<PsfSet, PipelineError> {
        self.check()?;
        let (lens, view) = self.lens_with_image(lens)?;
        let lens = &*lens;
        let FilmPlace { distance_mm: film_distance_mm, origin: mut film } = self.film_place(lens)?;
        if let Some(view) = view {
            film = format!("{film}; {}", view.note());
        }
        let items = self.items(lens)?;
        let settings = self.image_settings(lens, film_distance_mm)?;
        let stored = self.stored_model(lens, &settings)?;
        let computed: Result<Vec<(PsfRow, Array2<f32>)>, PipelineError> = items
            .par_iter()
            .map(|item| {
                cancel
                    .check()
                    .map_err(PipelineError::from)
                    .and_then(|()| self.compute_one(item, (lens, stored.as_ref()), &settings))
            })
            .collect();
        let (mut rows, pictures): (Vec<PsfRow>, _) = computed?.into_iter().unzip();
        if !rows.iter().any(|row| row.energy > 0.0) {
            let found = format!("{:?}", self.fields_deg);
            let expected = format!("at least one field of which light gets through {} to the film", lens.name());
            return Err(self.wrong("fields_deg", &found, &expected));
        }
        let spectral_weights = match self.spectral_weights.is_empty() {
            true => vec![1.0; self.wavelengths_nm.len()],
            false => self.spectral_weights.clone(),
        };
        for row in &mut rows {
            (row.film_distance_mm, row.film) = (film_distance_mm, film.clone());
        }
        Ok(PsfSet { film_distance_mm, film, pixel_um: self.pixel_um, rows, pictures, spectral_weights })
    }

    fn compute_one(
        &self,
        item: &Item,
        (lens, stored): (&Lens, Option<&LensImageModel>),
        settings: &ImageSettings,
    ) -> Result<(PsfRow, Array2<f32>), PipelineError> {
        let film_distance_mm = settings.film_distance_mm;
        let reference = self.reference(lens)?;
        let mono = lens.at(item.wavelength_nm)?;
        let point = item.point(&reference);
        let (spot, picture, model, whole) = match &self.sampling {
            PsfSampling::Pupil | PsfSampling::Stored(_) => {
                let axial = ObjectPoint::from_field(&reference, DVec2::ZERO, item.dioptres);
                let spot = Spot::through_pupil(&mono, &point, &axial, film_distance_mm);
                let image = match stored {
                    _ if spot.at_mm.is_empty() => None,
                    Some(model) => item.stored_image(model),
                    None => item.image(lens, settings)?,
                };
                let drawn = image.as_ref().map(|image| self.draw(image));
                let (picture, model) = drawn.map_or_else(|| (Array2::zeros((1, 1)), None), |(p, m)| (p, Some(m)));
                let picture = self.size.map_or_else(|| picture.clone(), |size| resized(&picture, size));
                let is_cut = f64::from(picture.sum()) < WHOLE && self.diffraction != Diffraction::Wave;
                (spot, picture, model, image.filter(|_| is_cut).map(|image| on_coarse_pixels(&image, self.pixel_um)))
            }
            &PsfSampling::Paper { n_across, jitter } => {
                let paper = PaperRays { n_across, jitter, bending: self.diffraction.hurb(), seed: self.seed };
                let spot = Spot::over_front(&mono, &point, film_distance_mm, &paper);
                let picture = self.counted(&spot);
                (spot, picture, None, None)
            }
        };
        // Waves that the model leaves to rays, or blends with them, are summed for themselves.
        let (picture, model) = match model {
            Some(model) if self.diffraction == Diffraction::Wave && model.wave_fraction < 1.0 => {
                self.summed(&mono, &point, film_distance_mm, picture, model)
            }
            model => (picture, model),
        };
        let mut row = self.measure(item, &spot, &picture);
        if let Some(whole) = whole.filter(|_| row.is_cut()) {
            row = row.with_widths_of(&whole);
        }
        if let Some(ModelUse { wave_fraction, fallback }) = model {
            (row.wave_fraction, row.fallback) = (Some(wave_fraction), fallback);
        }
        if self.diffraction == Diffraction::Wave && !row.is_dark() {
            if let Ok((transfer, limit)) =
                TransferFunction::trace(&mono, &point, film_distance_mm, TransferQuality::Fine)
            {
                row = row.with_transfer(&transfer, &limit);
            }
            row.strehl = PupilSamples::peak_of(&mono, &point, film_distance_mm).ok().map(|peak| peak.strehl);
        }
        Ok((row, picture))
    }

    /// Returns the picture as the diffraction integral has it, on the pixels of one of rays; where it needs more nodes than a wave sum
    /// has, that picture, and why.
    fn summed(
        &self,
        mono: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
        picture: Array2<f32>,
        model: ModelUse,
    ) -> (Array2<f32>, Option<ModelUse>) {
        let (rows, columns) = picture.dim();
        let window = WaveWindow { pitch_um: self.pixel_um, rows, columns, center: WindowCenter::Centroid };
        match wave_psf(mono, point, film_distance_mm, &window, WaveQuality::default()) {
            Ok(psf) => {
                let model = ModelUse { wave_fraction: 1.0, fallback: None };
                (psf.samples.mapv(|energy| energy as f32), Some(model))
            }
            Err(error) => {
                let fallback = model.fallback.clone().or_else(|| Some(error.to_string()));
                (picture, Some(ModelUse { fallback, ..model }))
            }
        }
    }

    /// Draws a picture: of the size asked for, or its own.
    fn draw(&self, image: &PointImage) -> (Array2<f32>, ModelUse) {
        match self.size {
            // A picture is centered on the middle of a pixel, which an odd number has.
            Some(size) if size % 2 == 1 => {
                let (picture, model) = image.picture(self.pixel_um, size);
                (picture.mapv(|e| e as f32), model)
            }
            _ => {
                let (kernel, model) = image.kernel(self.pixel_um);
                (kernel.samples, model)
            }
        }
    }

    fn measure(&self, item: &Item, spot: &Spot, picture: &Array2<f32>) -> PsfRow {
        let measured = Picture::new(picture.view(), self.pixel_um);
        let (place_mm, mut second) = place_and_size(spot.moments());
        let is_of_rays = self.sampling == PsfSampling::Pupil && self.diffraction == Diffraction::None;
        if !is_of_rays && place_mm.is_finite() {
            second = measured.second_moments_um2();
        }
        let name = PointName {
            field_deg: item.field_deg,
            field_y_deg: item.field_y_deg,
            distance_mm: item.distance_mm,
            wavelength_nm: item.wavelength_nm,
        };
        let mut row = PsfRow::measure(name, place_mm, second, &measured);
        if matches!(self.sampling, PsfSampling::Stored(_)) {
            let aside_um = measured.centroid_um();
            (row.centroid_x_mm, row.centroid_y_mm) = (place_mm.x + 1e-3 * aside_um.x, place_mm.y + 1e-3 * aside_um.y);
        }
        let picture_share = picture.iter().map(|e| f64::from(*e)).sum();
        let whole = Windowed::new(picture.view(), self.pixel_um);
        PsfRow { energy: spot.energy, picture_share, ..row }
            .with_mtf(&self.mtf_per_mm, |direction, f| whole.modulation(direction, f))
    }

    /// Counts the rays of a spot on pixels about its centroid.
    fn counted(&self, spot: &Spot) -> Array2<f32> {
        let Some(moments) = spot.moments() else {
            return Array2::zeros((self.size.unwrap_or(1), self.size.unwrap_or(1)));
        };
        let pixel_mm = 1e-3 * self.pixel_um;
        let offsets = || spot.at_mm.iter().map(|&p| (p - moments.centroid_mm) / pixel_mm);
        let size = self.size.unwrap_or_else(|| {
            let reach = offsets().map(|p| p.x.abs().max(p.y.abs())).fold(0.0, f64::max);
            (2 * reach.round() as usize + 1).min(LARGEST)
        });
        let mut picture = Array2::zeros((size, size));
        let middle = 0.5 * size as f64;
        let share = 1.0 / spot.at_mm.len() as f32;
        for p in offsets() {
            let (row, column) = ((middle - p.y).floor(), (middle + p.x).floor());
            if row >= 0.0 && column >= 0.0 && row < size as f64 && column < size as f64 {
                picture[(row as usize, column as usize)] += share;
            }
        }
        picture
    }
}

impl PsfSet {
    /// Writes the pictures as EXR, a channel a picture.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_exr(&self, path: &Path) -> Result<(), PipelineError> {
        let side = self.side();
        let named: Vec<(String, Array2<f32>)> = self
            .rows
            .iter()
            .zip(&self.pictures)
            .enumerate()
            .map(|(i, (row, picture))| {
                let PsfRow { field_deg, distance_mm, wavelength_nm, .. } = row;
                let name =
                    format!("{i:04}.field {field_deg} deg, {distance_mm} mm, {wavelength_nm} nm").replace('.', "_");
                (name, resized(picture, side))
            })
            .collect();
        let planes: Vec<(&str, &Array2<f32>)> = named.iter().map(|(name, plane)| (name.as_str(), plane)).collect();
        Ok(write_planes_exr(path, &planes, ExrSamples::Single)?)
    }

    /// Writes the pictures as an archive of `NumPy` that takes the place of the point spread functions of a lens
    /// ([`PsfFile`](dioptric_pipeline::PsfFile)): each of sum 1.
    ///
    /// # Errors
    /// When a field is dark, or the file cannot be written.
    pub fn write_npz(&self, path: &Path) -> Result<(), PipelineError> {
        if let Some(dark) = self.rows.iter().find(|row| row.is_dark()) {
            let reason = format!(
                "no light of the field of {}/{} degrees reaches the film, expected lit fields for an archive of point spread functions",
                dark.field_deg, dark.field_y_deg
            );
            return Err(PipelineError::Write { path: path.to_owned(), reason });
        }
        let side = self.side();
        let whole = self.pictures.iter().flat_map(|picture| {
            let sum: f32 = picture.sum();
            resized(picture, side).mapv(|v| v / sum).into_iter()
        });
        let samples: Vec<f32> = whole.collect();
        let n_colors = self.spectral_weights.len();
        let first =
            |row: &&PsfRow| (row.field_deg, row.field_y_deg) == (self.rows[0].field_deg, self.rows[0].field_y_deg);
        let n_distances = self.rows.iter().take_while(first).count() / n_colors;
        let n_fields = self.rows.len() / (n_distances * n_colors);
        let of_fields: Vec<&PsfRow> = self.rows.iter().step_by(n_distances * n_colors).collect();
        let is_to_the_right = of_fields.iter().all(|row| row.field_y_deg == 0.0 && row.field_deg >= 0.0);
        let fields_deg: Vec<f32> = match is_to_the_right {
            true => of_fields.iter().map(|row| row.field_deg as f32).collect(),
            false => of_fields.iter().flat_map(|row| [row.field_deg as f32, row.field_y_deg as f32]).collect(),
        };
        let distances_mm: Vec<f32> =
            self.rows.iter().step_by(n_colors).take(n_distances).map(|row| row.distance_mm as f32).collect();
        let wavelengths_nm: Vec<f32> = self.rows.iter().take(n_colors).map(|row| row.wavelength_nm as f32).collect();
        let sides_of_fields = if is_to_the_right { vec![n_fields] } else { vec![n_fields, 2] };
        Ok(write_npz_arrays(
            path,
            &[
                ("psf", &[n_fields, n_distances, n_colors, side, side], &samples),
                ("fields_deg", &sides_of_fields, &fields_deg),
                ("distances_mm", &[n_distances], &distances_mm),
                ("wavelengths_nm", &[n_colors], &wavelengths_nm),
                ("pitch_um", &[], &[self.pixel_um as f32]),
            ],
        )?)
    }

    /// Pixels along the side of the largest picture.
    fn side(&self) -> usize {
        self.pictures.iter().map(|picture| picture.nrows().max(picture.ncols())).max().unwrap_or(1)
    }
}

/// Returns the picture of a point on pixels so coarse that all of its light is on few of them.
fn on_coarse_pixels(image: &PointImage, pixel_um: f64) -> Picture {
    let coarse_um = pixel_um.max(2e3 * image.extent_mm() / COARSE_PIXELS);
    Picture::new(image.kernel(coarse_um).0.samples.view(), coarse_um)
}

/// Returns the middle of a picture, or the picture with a dark rim, `size` pixels on a side.
fn resized(picture: &Array2<f32>, size: usize) -> Array2<f32> {
    let (rows, columns) = picture.dim();
    Array2::from_shape_fn((size, size), |(row, column)| {
        let (r, c) = ((row + rows / 2).checked_sub(size / 2), (column + columns / 2).checked_sub(size / 2));
        match (r, c) {
            (Some(r), Some(c)) => picture.get((r, c)).copied().unwrap_or(0.0),
            _ => 0.0,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AnalysisFilm, FilmUse};
    use approx::assert_relative_eq;
    use dioptric_optics::{Glass, Interface, PupilPlane, Surface, Vignetting};
    use dioptric_psf::{ArrayFields, PsfArray, PsfArrayParts};
    use std::sync::Arc;

    fn to_the_right(fields_deg: &[f64]) -> Vec<[f64; 2]> {
        fields_deg.iter().map(|&deg| [deg, 0.0]).collect()
    }

    fn request() -> PsfRequest {
        PsfRequest {
            fields_deg: vec![[0.0, 0.0], [5.0, 0.0]],
            distances_mm: vec![8000.0],
            wavelengths_nm: vec![450.0, 650.0],
            film: AnalysisFilm::FilmMm(51.8145),
            focus_nm: Vec::new(),
            main_nm: None,
            diffraction: Diffraction::None,
            pixel_um: 2.0,
            size: None,
            sampling: PsfSampling::Pupil,
            mtf_per_mm: vec![0.0, 10.0],
            seed: 1,
            spectral_weights: vec![],
        }
    }

    fn paper_lens() -> Lens {
        Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(4.0).unwrap()
    }

    #[test]
    fn both_samplings_agree_and_are_the_papers() {
        let good = request().compute(&paper_lens()).unwrap();
        let sampling = PsfSampling::Paper { n_across: 201, jitter: true };
        let counted = PsfRequest { sampling, ..request() }.compute(&paper_lens()).unwrap();
        assert_eq!(good.rows.len(), 4);
        for (good, counted) in good.rows.iter().zip(&counted.rows) {
            // Counting on pixels adds a pixel's own variance, 2 × side² / 12. The paper's rays are even on the front
            // disc, ours in solid angle: alike to 1 % at this aperture.
            let counted_um = (counted.rms_radius_um.powi(2) - 2.0 * 2.0 / 6.0).sqrt();
            assert_relative_eq!(good.rms_radius_um, counted_um, max_relative = 0.01);
            assert_relative_eq!(good.centroid_x_mm, counted.centroid_x_mm, epsilon = 1e-3);
            assert!(good.energy > counted.energy);
        }
        // The stored value at 450 nm and 8 m is 42.05 µm, from an object 3 mm farther.
        assert_relative_eq!(good.rows[0].rms_radius_um, 42.05, epsilon = 0.15);
    }

    /// At 2 m and 700 nm the exact grid beats with the pixels: the line spread, some 37 pixels wide, comes out a fifth as wide, between the two columns that get most.
    #[test]
    fn jitter_keeps_the_grid_from_beating_with_pixels() {
        let lsf_um = |sampling| {
            let (distances_mm, wavelengths_nm) = (vec![2000.0], vec![700.0]);
            let (pixel_um, size) = (4.0, Some(75));
            let request = PsfRequest { sampling, distances_mm, wavelengths_nm, pixel_um, size, ..request() };
            request.compute(&paper_lens()).unwrap().rows[0].lsf_fwhm_um
        };
        let paper = |jitter| lsf_um(PsfSampling::Paper { n_across: 401, jitter });
        let true_um = lsf_um(PsfSampling::Pupil);
        // 126,000 rays leave 2 % of noise in each of the 37 pixels, of which a step down takes .3 of a pixel at either side.
        assert_relative_eq!(paper(true), true_um, max_relative = 0.05);
        assert!(paper(false) < 0.5 * true_um, "{}", paper(false));
    }

    #[test]
    fn tangential_is_radial_on_every_side() {
        let of = |x_deg: f64, y_deg: f64| {
            let request = PsfRequest {
                fields_deg: vec![[x_deg, y_deg]],
                wavelengths_nm: vec![550.0],
                mtf_per_mm: vec![0.5],
                ..request()
            };
            let row = request.compute(&paper_lens()).unwrap().rows.remove(0);
            ((row.mtf[0].tangential, row.mtf[0].sagittal), (row.sigma_x_um, row.sigma_y_um))
        };
        let ((beside, sigma_um), (above, _)) = (of(8.0, 0.0), of(0.0, 8.0));
        // The mesh of rays begins at another azimuth.
        assert_relative_eq!(beside.0, above.0, epsilon = 2e-3);
        assert_relative_eq!(beside.1, above.1, epsilon = 2e-3);
        // Modulation falls by 2π²f²σ² at first: of the tangential with the spread along the radius, which is along x here. The
        // next term is a quarter of the square of that, some hundredths of it.
        let falls = (1.0 - beside.0) / (1.0 - beside.1);
        assert_relative_eq!(falls, (sigma_um.0 / sigma_um.1).powi(2), max_relative = 0.1);
    }

    #[test]
    fn a_row_has_the_keys_of_the_contract() {
        let set = request().compute(&paper_lens()).unwrap();
        let json = serde_json::to_value(&set.rows[0]).unwrap();
        for key in "field_deg distance_mm wavelength_nm centroid_x_mm centroid_y_mm rms_radius_um sigma_x_um \
                    sigma_y_um lsf_fwhm_um ee50_radius_um energy"
            .split_whitespace()
        {
            assert!(json[key].is_f64(), "{key}");
        }
        assert_relative_eq!(json["mtf"][0]["radial"].as_f64().unwrap(), 1.0, epsilon = 1e-6);
    }

    #[test]
    fn a_sharp_point_is_of_waves_and_a_blurred_one_is_not() {
        let wave = PsfRequest {
            fields_deg: vec![[0.0; 2]],
            distances_mm: vec![2000.0, 300.0],
            wavelengths_nm: vec![550.0],
            film: AnalysisFilm::FocusMm(2000.0),
            diffraction: Diffraction::Wave,
            ..request()
        };
        let set = wave.compute(&Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap()).unwrap();
        // Waves are summed wherever nodes suffice.
        assert_eq!(set.rows[0].wave_fraction, Some(1.0));
        assert!(set.rows[1].wave_fraction == Some(1.0) || set.rows[1].fallback.is_some());
        let strehl = set.rows[0].strehl.unwrap();
        assert!(strehl > 0.7 && strehl <= 1.0 && set.rows[1].strehl.unwrap() < 0.05, "{strehl}");
        let paper = PsfRequest { sampling: PsfSampling::Paper { n_across: 21, jitter: true }, ..wave };
        assert!(paper.compute(&paper_lens()).is_err());
    }

    #[test]
    fn fields_above_the_axis_are_turned_ones() {
        let beside = PsfRequest { fields_deg: vec![[5.0, 0.0]], ..request() }.compute(&paper_lens()).unwrap();
        let above = PsfRequest { fields_deg: vec![[0.0, 5.0]], ..request() }.compute(&paper_lens()).unwrap();
        for (a, b) in beside.rows.iter().zip(&above.rows) {
            assert_relative_eq!(a.centroid_x_mm, b.centroid_y_mm, epsilon = 1e-6);
            assert_relative_eq!(a.sigma_x_um, b.sigma_y_um, max_relative = 1e-3);
            assert_relative_eq!(a.lsf_fwhm_um, b.lsf_fwhm_y_um, max_relative = 1e-2);
        }
        assert!(PsfRequest { fields_deg: vec![[0.0, 90.0]], ..request() }.compute(&paper_lens()).is_err());
    }

    /// A fisheye sees past 90°: places go on, and the light is that of rays counted on a plane that faces it.
    #[test]
    fn fields_go_on_beyond_90_degrees() {
        let lens = Lens::built_in("fisheye-12.5mm").unwrap();
        let mono = lens.at(550.0).unwrap();
        let (fields_deg, n) = ([80.0, 89.0, 90.0, 91.0, 95.0], 401);
        let request = PsfRequest {
            fields_deg: fields_deg.map(|deg| [0.0, deg]).to_vec(),
            distances_mm: vec![f64::INFINITY],
            wavelengths_nm: vec![550.0],
            film: AnalysisFilm::FocusMm(f64::INFINITY),
            ..request()
        };
        let set = request.compute(&lens).unwrap();
        let counted_mm2 = |deg: f64| {
            let point = ObjectPoint::far(deg.to_radians(), DVec2::Y);
            let plane = PupilPlane::facing(&point);
            let half_mm = 1.1 * mono.semi_aperture_mm(0);
            let at = |i: usize| half_mm * ((2 * i + 1) as f64 / n as f64 - 1.0);
            let places: Vec<DVec2> = (0..n * n).map(|i| DVec2::new(at(i % n), at(i / n))).collect();
            let mut rays = plane.rays(&mono, &point, &places);
            mono.trace(&mut rays, Vignetting::On);
            mono.to_film(&mut rays, set.film_distance_mm);
            rays.n_in_flight() as f64 * (2.0 * half_mm / n as f64).powi(2)
        };
        let axial_mm2 = counted_mm2(0.0);
        let mut before_mm = 0.0;
        for (row, deg) in set.rows.iter().zip(fields_deg) {
            // Of some thousand rays in the pupil a few at its edge are in doubt.
            assert_relative_eq!(row.energy, counted_mm2(deg) / axial_mm2, max_relative = 0.02);
            // Pupils that are taken by lines are not quite even: a thousandth of a spot of 0.13 mm.
            assert!(row.centroid_y_mm > before_mm && row.centroid_x_mm.abs() < 1e-4, "{deg}: {}", row.centroid_y_mm);
            assert!(row.picture_share > 0.9, "{deg}: {}", row.picture_share);
            before_mm = row.centroid_y_mm;
        }
        let near = PsfRequest { distances_mm: vec![1000.0], ..request };
        assert!(near.compute(&lens).unwrap_err().to_string().contains("far object"));
    }

    #[test]
    fn a_dark_point_has_no_size() {
        // A microscope sees nothing at 10°.
        let film = AnalysisFilm::FocusMm(2000.0);
        let fields_deg = to_the_right(&[0.0, 10.0]);
        let request = PsfRequest { fields_deg, distances_mm: vec![2000.0], film, ..request() };
        let set = request.compute(&Lens::built_in("microscope-20x").unwrap()).unwrap();
        assert!(!set.rows[0].is_dark() && set.rows[2].is_dark() && !set.rows[2].is_cut());
        assert!(set.rows[2].ee50_radius_um.is_nan() && set.rows[2].lsf_fwhm_um.is_nan());
        assert_eq!(set.polychromatic(&[]).len(), 1);
    }

    #[test]
    fn own_functions_have_their_light_where_it_is() {
        // Of the second color the light lies 4 samples to the right of the chief ray and 2 above it.
        let mut samples = ndarray::Array5::zeros((1, 1, 2, 9, 9));
        samples[(0, 0, 0, 4, 4)] = 1.0;
        samples[(0, 0, 1, 2, 8)] = 1.0;
        let array = PsfArray::new(PsfArrayParts {
            fields: ArrayFields::Everywhere,
            distances_mm: vec![],
            wavelengths_nm: vec![500.0, 600.0],
            pitch_um: vec![2.0],
            samples,
        });
        let sampling = PsfSampling::Stored(Arc::new(array.unwrap()));
        let (fields_deg, wavelengths_nm) = (vec![[0.0; 2]], vec![500.0, 600.0]);
        let set = PsfRequest { fields_deg, wavelengths_nm, pixel_um: 2.0, sampling, ..request() }
            .compute(&Lens::thin(50.0, 12.5).unwrap())
            .unwrap();
        for (row, at_um) in set.rows.iter().zip([DVec2::ZERO, DVec2::new(8.0, 4.0)]) {
            assert!((1e3 * row.centroid_mm() - at_um).length() < 1e-3, "{row:?}");
        }
        // The light of both: two dots that far apart.
        let whole = &set.polychromatic(&[])[0];
        assert!((1e3 * whole.row.centroid_mm() - DVec2::new(4.0, 2.0)).length() < 1e-3, "{:?}", whole.row);
        let picture = Picture::new(whole.picture.view(), 2.0);
        assert!(picture.centroid_um().length() < 1e-3, "{}", picture.centroid_um());
        let [measured, stated] = [picture.rms_radius_um(), DVec2::new(4.0, 2.0).length()];
        assert!((measured / stated - 1.0).abs() < 0.05 && (whole.row.rms_radius_um / stated - 1.0).abs() < 0.05);
    }

    #[test]
    fn light_of_one_color_is_measured_as_that_color() {
        // Of waves, which know of no pixels: coarse ones change nothing.
        let mtf_per_mm = vec![20.0, 50.0];
        let waves = PsfRequest { diffraction: Diffraction::Wave, pixel_um: 5.0, mtf_per_mm, ..request() };
        let set = PsfRequest { wavelengths_nm: vec![550.0], ..waves }.compute(&paper_lens()).unwrap();
        for (row, whole) in set.rows.iter().zip(set.polychromatic(&[20.0, 50.0])) {
            assert_eq!(row.measured_on, whole.row.measured_on);
            for (of_row, of_whole) in row.mtf.iter().zip(&whole.row.mtf) {
                assert!((of_row.tangential - of_whole.tangential).abs() < 2e-4, "{of_row:?} {of_whole:?}");
                assert!((of_row.sagittal - of_whole.sagittal).abs() < 2e-4, "{of_row:?} {of_whole:?}");
            }
            let widths = |row: &PsfRow| [row.lsf_fwhm_um, row.ee50_radius_um, row.ee80_radius_um];
            for (of_row, of_whole) in widths(row).into_iter().zip(widths(&whole.row)) {
                assert!((of_row / of_whole - 1.0).abs() < 1e-4, "{of_row} {of_whole}");
            }
        }
    }

    #[test]
    fn light_is_focused_at_the_main_wavelength_or_where_the_lens_is_known() {
        let glass = Glass::Sellmeier { b: vec![14.76, 0.24], c_um2: vec![0.19, 1530.0], range_nm: Some((2e3, 14e3)) };
        let side = |radius_mm: f64, medium_after: Glass, thickness_after_mm: f64| Interface {
            surface: Surface::sphere(radius_mm, 6.0),
            medium_after,
            thickness_after_mm,
        };
        let lens = Lens::new("infrared", "test", vec![side(50.0, glass, 3.0), side(70.0, Glass::Air, 0.0)], 0).unwrap();
        let infrared = PsfRequest {
            fields_deg: vec![[0.0; 2]],
            distances_mm: vec![f64::INFINITY],
            wavelengths_nm: vec![10e3],
            film: AnalysisFilm::FocusMm(f64::INFINITY),
            diffraction: Diffraction::Wave,
            pixel_um: 10.0,
            ..request()
        };
        let set = infrared.compute(&lens).unwrap();
        assert_eq!(set.film_distance_mm, lens.at(10e3).unwrap().film_distance_mm_for(f64::INFINITY).unwrap());
        assert!(set.rows[0].strehl.unwrap() > 0.8, "{:?}", set.rows[0]);
        assert!(infrared.through_focus(&lens, &set).is_ok());
        // In a lens that is known at 550 nm all light, seen or not, meets the film of 550 nm.
        let reference_nm = |nm: f64| {
            let request = PsfRequest { wavelengths_nm: vec![nm], ..request() };
            request.reference(&paper_lens()).unwrap().wavelength_nm()
        };
        assert_eq!([355.0, 450.0, 1064.0].map(reference_nm), [550.0; 3]);
        // A file's main wavelength stands for 550 nm: its film is where every command has it, and says of which light it is.
        let (main_nm, focus) = (Some(656.0), AnalysisFilm::FocusMm(f64::INFINITY));
        for nm in [450.0, 656.0] {
            let found = focus
                .place(&paper_lens(), FilmUse { main_nm, wavelengths_nm: &[nm], weights: &[], distance_mm: 2000.0 })
                .unwrap();
            let expected_mm = paper_lens().at(656.0).unwrap().film_distance_mm_for(f64::INFINITY).unwrap();
            assert_eq!((found.distance_mm, found.origin.contains("at 656 nm")), (expected_mm, true));
            let request = PsfRequest { main_nm, wavelengths_nm: vec![nm], film: focus, ..request() };
            assert_eq!(request.compute(&paper_lens()).unwrap().film_distance_mm, expected_mm);
        }
    }

    #[test]
    fn a_size_asked_for_is_kept() {
        for (sampling, size) in [(PsfSampling::Pupil, 33), (PsfSampling::Paper { n_across: 51, jitter: true }, 75)] {
            let set = PsfRequest { sampling, size: Some(size), ..request() }.compute(&paper_lens()).unwrap();
            assert!(set.pictures.iter().all(|picture| picture.dim() == (size, size)));
        }
    }

    #[test]
    fn nonsense_is_refused() {
        for wrong in [
            PsfRequest { fields_deg: vec![[90.0, 0.0]], ..request() },
            PsfRequest { distances_mm: vec![-1.0], ..request() },
            PsfRequest { wavelengths_nm: vec![f64::INFINITY], ..request() },
            PsfRequest { pixel_um: 0.0, ..request() },
            PsfRequest { size: Some(0), ..request() },
        ] {
            assert!(wrong.compute(&paper_lens()).is_err(), "{wrong:?}");
        }
    }
}
