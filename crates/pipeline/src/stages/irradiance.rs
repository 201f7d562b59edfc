//! The spectral irradiance on the film: imaged band by band, kept in memory or in a file.

use std::{
    borrow::Cow,
    fs::{self, File},
    ops::Range,
    path::Path,
    sync::{Mutex, PoisonError},
};

use dioptric_forward::{ImagingPlan, ImagingTimes, Source};
use dioptric_scene::{ExrSamples, IsetIrradiance, Noted, Scene, SpectralHead, read_iset_irradiance, read_spectral_exr};
use dioptric_spectrum::{Bands, Observer, Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::{Array2, Array3, ArrayView3, Axis, s};

use super::{
    Watch,
    band_store::{BandFolder, BandStore, read_plane, read_rows, write_plane},
    film::FilmPlace,
    ghosts::Ghosts,
    narrow_surfaces::NarrowSurfaces,
    spec::FileStamp,
    unseen_points::UnseenPoints,
    white_of::WhiteOf,
};
use crate::{
    PipelineError, Stage,
    display::{LinearRgb, SpectrumToRgb, dark_fraction},
};

/// The name of the file of spectral irradiance.
pub const IRRADIANCE_FILE: &str = "irradiance.exr";

/// Bytes of rows of all bands that are written at a time.
pub(super) const STRIP_BYTES: usize = 32 << 20;

/// Returns the name of the file of the spectral irradiance by which a photodiode is lit.
pub(crate) fn photodiode_irradiance_file(name: &str) -> String {
    format!("irradiance-{name}.exr")
}

/// The spectral irradiance on the film, W m⁻² nm⁻¹, bands × rows × columns.
///
/// Its bands are in memory, or in a temporary file where they would take more than was allowed.
#[derive(Debug)]
pub struct Irradiance {
    grid: WavelengthGrid,
    size: (usize, usize),
    pitch_um: f64,
    planes: Planes,
    /// What samples of a file of bands are multiplied by.
    file_factor: f32,
    /// What falls on each of the photodiodes that it is the sum of; none for whole pixels.
    photodiodes: Vec<Self>,
    /// The file that it was read from as it was then, and how that holds its samples.
    stored: Option<(FileStamp, ExrSamples)>,
    /// Means and largest samples.
    pub summary: IrradianceSummary,
}

/// Where the bands are.
#[derive(Debug)]
enum Planes {
    /// Bands × rows × columns, one block of memory.
    Memory(Array3<f32>),
    /// All bands one after the other, little-endian.
    File(Mutex<File>),
    /// The sums of those of the photodiodes, made when they are asked for.
    Sums,
}

/// Spectral irradiance in brief.
#[derive(Clone, Debug)]
pub struct IrradianceSummary {
    /// Mean over the film of each band, W m⁻² nm⁻¹.
    pub mean: Vec<f64>,
    /// Largest sample of each band, W m⁻² nm⁻¹.
    pub max: Vec<f64>,
    /// Mean illuminance, lux.
    pub mean_lux: f64,
    /// All bands as an observer sees them, linear sRGB in lux, or their sum in gray where none is visible; without pixels where it is that of a
    /// photodiode.
    pub seen: LinearRgb,
    /// The sum of all bands; without pixels where it is that of a photodiode.
    total: Array2<f32>,
    /// How many times as strong the light of the scene is as its source has it, for the mean illuminance that was asked for; 1 where none was.
    pub factor: f64,
    /// Surfaces narrower than the pupil, where the scene has any and was imaged in layers of depth.
    pub narrow_surfaces: Option<NarrowSurfaces>,
    /// Of points beside the scene those that no pixel sees.
    pub unseen_points: Option<UnseenPoints>,
    /// The share of the light that two surfaces of the lens reflected, where it was followed through the blur of a scene and all bands were
    /// imaged by one run.
    pub ghost_share: Option<f64>,
}

impl IrradianceSummary {
    /// Returns the share of the film's samples that get next to nothing of the mean light, visible or not.
    pub fn dark_fraction(&self) -> f64 {
        dark_fraction(&self.total)
    }

    fn brighten(&mut self, factor: f64) {
        let of_samples = factor as f32;
        self.mean.iter_mut().chain(&mut self.max).for_each(|number| *number *= factor);
        self.mean_lux *= factor;
        self.seen.planes.iter_mut().for_each(|plane| *plane *= of_samples);
        self.total *= of_samples;
        self.factor *= factor;
    }
}

impl Irradiance {
    /// Returns the bytes that the samples take.
    pub fn size_bytes(&self) -> u64 {
        size_bytes(self.size, self.grid.len())
    }

    /// Returns the bytes of memory that bands take, those of photodiodes included.
    pub(super) fn memory_bytes(&self) -> u64 {
        let own = if self.is_spilled() { 0 } else { self.size_bytes() };
        own + self.photodiodes.iter().map(Self::memory_bytes).sum::<u64>()
    }

    /// Whether the bands are in a file and not in memory.
    pub fn is_spilled(&self) -> bool {
        !matches!(self.planes, Planes::Memory(_))
    }

    /// The numbers of up to four bands that stand for all, from the first to the last.
    pub fn shown_bands(&self) -> Vec<usize> {
        let (first_nm, last_nm) = self.grid.range_nm();
        let nearest = |i: i32| self.grid.nearest(first_nm + (last_nm - first_nm) * f64::from(i) / 3.0);
        let mut shown: Vec<usize> = (0..4).map(nearest).collect();
        shown.dedup();
        shown
    }

    /// The irradiance by which each photodiode of a pixel is lit, which is the sum of them; none for whole pixels.
    pub fn photodiodes(&self) -> &[Self] {
        &self.photodiodes
    }

    /// Returns the sum of the irradiances by which the photodiodes of pixels are lit; kept whole where all together take no more than so many
    /// bytes of memory.
    ///
    /// # Errors
    /// When a band cannot be read.
    pub(super) fn of_photodiodes(photodiodes: Vec<Self>, memory_bytes: u64) -> Result<Self, PipelineError> {
        let first = &photodiodes[0];
        let (grid, size, pitch_um) = (first.grid.clone(), first.size, first.pitch_um);
        let total_bytes = size_bytes(size, grid.len()) * (photodiodes.len() as u64 + 1);
        let is_kept = total_bytes <= memory_bytes && !photodiodes.iter().any(Self::is_spilled);
        let mut cube = Array3::zeros((if is_kept { grid.len() } else { 0 }, size.0, size.1));
        let mut summing = Summing::new(&grid, size);
        for band in 0..grid.len() {
            let plane = sum_of(&photodiodes, band)?;
            summing.add(band, &plane);
            if is_kept {
                cube.index_axis_mut(Axis(0), band).assign(&plane);
            }
        }
        let planes = if is_kept { Planes::Memory(cube) } else { Planes::Sums };
        Ok(Self { grid, size, pitch_um, planes, file_factor: 1.0, photodiodes, stored: None, summary: summing.summary })
    }

    /// The distance between samples on the film, µm.
    pub fn pitch_um(&self) -> f64 {
        self.pitch_um
    }

    /// All bands as they lie in memory, bands × rows × columns in standard layout; `None` where they are in a file.
    pub fn cube(&self) -> Option<ArrayView3<'_, f32>> {
        match &self.planes {
            Planes::Memory(cube) => Some(cube.view()),
            Planes::File(_) | Planes::Sums => None,
        }
    }

    /// Returns it with the file that it was read from.
    #[must_use]
    pub(super) fn stored_in(mut self, path: &Path, samples: ExrSamples) -> Self {
        self.stored = Some((FileStamp::of(path), samples));
        self
    }

    /// Writes it as spectral EXR, a few rows of all bands at a time; a copy of the file that it was read from, as long as that is what it was.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_exr(&self, path: &Path, samples: ExrSamples) -> Result<(), PipelineError> {
        self.write_exr_under(&WhiteOf::default(), path, samples)
    }

    /// Writes it with what whoever develops it makes white.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_exr_under(&self, white: &WhiteOf, path: &Path, samples: ExrSamples) -> Result<(), PipelineError> {
        if let Some((file, of_file)) = &self.stored
            && *of_file == samples
            && FileStamp::of(file.path()) == *file
            && fs::copy(file.path(), path).is_ok()
        {
            return Ok(());
        }
        let texts = white.texts();
        let texts: Vec<(&str, &str)> = texts.iter().map(|(name, text)| (*name, text.as_str())).collect();
        let head = SpectralHead {
            quantity: Quantity::Irradiance,
            grid: &self.grid,
            size: self.size,
            pitch_um: Some(self.pitch_um),
            depth: None,
            view: None,
            light: None,
            texts: &texts,
            largest: self.summary.max.iter().fold(0.0, |a, &b| a.max(b as f32)),
            samples,
            at_once_bytes: STRIP_BYTES,
        };
        Ok(head.write_exr(path, &mut |band, rows| self.rows_of(band, rows))?)
    }

    /// Returns the samples of rows of a band.
    fn rows_of(&self, band: usize, rows: Range<usize>) -> Result<Vec<f32>, String> {
        match &self.planes {
            Planes::Memory(cube) => {
                let samples = cube.slice(s![band, rows, ..]);
                Ok(samples.to_slice().expect("rows of a cube in standard layout lie one after the other").to_vec())
            }
            Planes::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                let samples = read_rows(&mut file, band, rows, self.size).map_err(|error| error.to_string())?;
                Ok(samples.into_iter().map(|sample| self.file_factor * sample).collect())
            }
            Planes::Sums => {
                let mut sums = vec![0.0; rows.len() * self.size.1];
                for part in &self.photodiodes {
                    let samples = part.rows_of(band, rows.clone())?;
                    sums.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += sample);
                }
                Ok(sums)
            }
        }
    }

    /// Reads it from a spectral EXR, as [`read_exr`](Self::read_exr) does, or from an optical image of `ISETCam` (`.mat`); with what is
    /// white on it, as far as the file states that, and what it says of how it was read, a sentence each.
    ///
    /// # Errors
    /// When the file cannot be read, or holds no irradiance.
    pub fn read(path: &Path, pitch_um: Option<f64>) -> Result<(Self, WhiteOf, Vec<String>), PipelineError> {
        if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mat")) {
            let mut notes = vec![];
            let irradiance = Self::read_exr(path, pitch_um)?.told_in(&mut notes);
            return Ok((irradiance, WhiteOf::read(path)?, notes));
        }
        let IsetIrradiance { image, light, notes } = read_iset_irradiance(path)?;
        let pitch_um = image.pitch_um().or(pitch_um);
        let reason = "it states no distance between its samples".to_owned();
        let pitch_um = pitch_um.ok_or(PipelineError::Read { path: path.to_owned(), reason })?;
        let white = WhiteOf { light: light.map(|light| light.illuminant), lens: None };
        Ok((Self::of_image(image, pitch_um), white, notes))
    }

    /// Reads it from a spectral EXR; one without a distance between samples has that of the film given.
    ///
    /// # Errors
    /// When the file cannot be read, or holds no irradiance.
    pub fn read_exr(path: &Path, pitch_um: Option<f64>) -> Result<Noted<Self>, PipelineError> {
        let file = read_spectral_exr(path)?;
        file.try_map(|file| Self::of_file(path, file.image, pitch_um))
    }

    /// Takes the irradiance of a file.
    fn of_file(path: &Path, image: SpectralImage, pitch_um: Option<f64>) -> Result<Self, PipelineError> {
        let in_file = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
        if image.quantity() != Quantity::Irradiance {
            let (found, expected) = (image.quantity().unit(), Quantity::Irradiance.unit());
            return Err(in_file(format!("its unit is {found}, expected an irradiance, {expected}")));
        }
        image.check_samples().map_err(|e| in_file(e.to_string()))?;
        let pitch_um = image.pitch_um().or(pitch_um);
        let pitch_um = pitch_um.ok_or_else(|| in_file("it states no distance between its samples".to_owned()))?;
        Ok(Self::of_image(image, pitch_um))
    }

    /// Returns the irradiance of a scene that is so many times as bright that this is its mean illuminance, lux; as it is where none is asked for.
    ///
    /// # Errors
    /// When nobody sees the light on the film, which no factor makes brighter.
    pub(super) fn with_mean_lux(mut self, wanted_lux: Option<f64>) -> Result<Self, PipelineError> {
        let Some(wanted_lux) = wanted_lux else { return Ok(self) };
        let factor = wanted_lux / self.summary.mean_lux;
        if !(factor.is_finite() && factor > 0.0 && (factor as f32).is_normal()) {
            let reason = format!(
                "is to be {wanted_lux} lx, but the film has {} lx of visible light: expected a scene that lights it in visible bands",
                self.summary.mean_lux
            );
            return Err(PipelineError::Unsuitable { what: "mean_lux", reason });
        }
        self.brighten(factor);
        Ok(self)
    }

    fn brighten(&mut self, factor: f64) {
        let of_samples = factor as f32;
        match &mut self.planes {
            Planes::Memory(cube) => cube.par_mapv_inplace(|sample| of_samples * sample),
            Planes::File(_) => self.file_factor *= of_samples,
            Planes::Sums => {}
        }
        self.photodiodes.iter_mut().for_each(|part| part.brighten(factor));
        self.summary.brighten(factor);
    }

    /// Returns it with the share of the light that surfaces reflected.
    #[must_use]
    pub(super) fn with_ghost_share(mut self, share: Option<f64>) -> Self {
        self.summary.ghost_share = share;
        self
    }

    /// Returns it with the points that no pixel sees.
    #[must_use]
    pub(super) fn with_unseen_points(mut self, points: Option<UnseenPoints>) -> Self {
        self.summary.unseen_points = points;
        self
    }

    /// Returns it with the surfaces that are narrower than the pupil.
    #[must_use]
    pub(super) fn with_narrow_surfaces(mut self, narrow: Option<NarrowSurfaces>) -> Self {
        self.summary.narrow_surfaces = narrow;
        self
    }

    /// Returns it without all bands as an observer sees them, which for photodiodes nobody looks at.
    #[must_use]
    pub(super) fn without_seen(mut self) -> Self {
        self.summary.seen = LinearRgb::black(0, 0);
        self.summary.total = Array2::zeros((0, 0));
        self
    }

    /// Returns it with bands in memory; `image` is an irradiance.
    pub(super) fn of_image(image: SpectralImage, pitch_um: f64) -> Self {
        let (grid, size) = (image.grid().clone(), (image.rows(), image.columns()));
        let mut summing = Summing::new(&grid, size);
        let mut cube = Array3::zeros((grid.len(), size.0, size.1));
        for (band, plane) in image.into_planes().into_iter().enumerate() {
            summing.add(band, &plane);
            cube.index_axis_mut(Axis(0), band).assign(&plane);
        }
        Self {
            grid,
            size,
            pitch_um,
            planes: Planes::Memory(cube),
            file_factor: 1.0,
            photodiodes: Vec::new(),
            stored: None,
            summary: summing.summary,
        }
    }
}

impl Bands for Irradiance {
    fn quantity(&self) -> Quantity {
        Quantity::Irradiance
    }

    fn grid(&self) -> &WavelengthGrid {
        &self.grid
    }

    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError> {
        match &self.planes {
            Planes::Memory(cube) => {
                let n_bands = cube.len_of(Axis(0));
                if band >= n_bands {
                    return Err(SpectrumError::Band { band, reason: format!("there are {n_bands} bands") });
                }
                // A copy of a band is a hundredth of the work of whoever asks for it.
                Ok(Cow::Owned(cube.index_axis(Axis(0), band).to_owned()))
            }
            Planes::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                let plane = read_plane(&mut file, band, self.size);
                plane
                    .map(|plane| Cow::Owned(plane * self.file_factor))
                    .map_err(|error| SpectrumError::Band { band, reason: error.to_string() })
            }
            Planes::Sums => sum_of(&self.photodiodes, band).map(Cow::Owned),
        }
    }
}

/// Returns the sum of a band of several irradiances.
fn sum_of(parts: &[Irradiance], band: usize) -> Result<Array2<f32>, SpectrumError> {
    let mut sum = parts[0].band(band)?.into_owned();
    for part in &parts[1..] {
        sum += &*part.band(band)?;
    }
    Ok(sum)
}

fn size_bytes((rows, columns): (usize, usize), n_bands: usize) -> u64 {
    4 * rows as u64 * columns as u64 * n_bands as u64
}

/// Where bands go as they are imaged.
#[derive(Clone, Copy)]
pub(super) struct Keeping<'a> {
    /// What they may take together in memory; more goes to a file.
    pub(super) memory_bytes: u64,
    /// Where they are kept besides, for a run that goes on after this one was killed.
    pub(super) folder: Option<&'a BandFolder>,
}

/// Images the scene, but for bands that an earlier run left, and adds what surfaces of the lens reflect, where that is wanted.
pub(super) fn image(
    (plan, ghosts): (&ImagingPlan, Option<&Ghosts>),
    scene: &Scene,
    place: &FilmPlace,
    keeping: Keeping<'_>,
    watch: &Watch<'_>,
) -> Result<Irradiance, PipelineError> {
    let (grid, size) = (scene.radiance.grid().clone(), (place.rows, place.columns));
    let is_spilled = size_bytes(size, grid.len()) > keeping.memory_bytes;
    let cannot = |e: std::io::Error| PipelineError::Spill { reason: e.to_string() };
    let mut store = keeping.folder.map(|folder| folder.open(size, grid.len())).transpose()?;
    let is_file_missing = is_spilled && store.is_none();
    let mut file = if is_file_missing { Some(tempfile::tempfile().map_err(cannot)?) } else { None };
    let shape = (if is_spilled { 0 } else { grid.len() }, size.0, size.1);
    let mut cube = Array3::zeros(shape);
    let mut summing = Summing::new(&grid, size);
    let first = store.as_ref().map_or(0, BandStore::n_done);
    for band in 0..first {
        let Some(plane) = store.as_mut().map(|store| store.read(band)).transpose()? else { break };
        summing.add(band, &plane);
        if !is_spilled {
            cube.index_axis_mut(Axis(0), band).assign(&plane);
        }
    }
    let source = Source::of_scene(scene)?;
    let (progress, earlier) = (|fraction| watch.progress.at(Stage::Irradiance, fraction), plan.times());
    let [mut reflected, mut all] = [0.0; 2];
    let streamed = plan.stream_from(first, &source.light(), &progress, watch.cancel, &mut |band, mut plane| {
        if let Some(ghosts) = ghosts {
            reflected += ghosts.add((band, grid.centers_nm()[band]), &mut plane, watch.cancel)?;
            all += plane.iter().map(|value| f64::from(*value)).sum::<f64>() / plane.len() as f64;
        }
        summing.add(band, &plane);
        if let Some(store) = &mut store {
            store.append(&plane)?;
        }
        if let Some(file) = &mut file {
            write_plane(file, &plane)?;
        }
        if !is_spilled {
            cube.index_axis_mut(Axis(0), band).assign(&plane);
        }
        Ok(())
    });
    watch.cancel.check()?;
    streamed?;
    // Bands of an earlier run do not tell their part.
    summing.summary.ghost_share = (first == 0 && all > 0.0).then(|| reflected / all);
    let times = plan.times().since(&earlier);
    if times != ImagingTimes::default() {
        watch.progress.imaged(&times);
    }
    let file = file.or(store.filter(|_| is_spilled).map(BandStore::into_file));
    let planes = file.map_or(Planes::Memory(cube), |file| Planes::File(Mutex::new(file)));
    Ok(Irradiance {
        grid,
        size,
        pitch_um: place.pitch_um,
        planes,
        file_factor: 1.0,
        photodiodes: Vec::new(),
        stored: None,
        summary: summing.summary,
    })
}

/// Sums up bands as they come.
struct Summing {
    to_rgb: SpectrumToRgb,
    luminous: Vec<f64>,
    summary: IrradianceSummary,
}

impl Summing {
    fn new(grid: &WavelengthGrid, (rows, columns): (usize, usize)) -> Self {
        let [_, luminous, _] = Observer::Cie1931.weights(grid);
        let summary = IrradianceSummary {
            mean: Vec::with_capacity(grid.len()),
            max: Vec::with_capacity(grid.len()),
            mean_lux: 0.0,
            seen: LinearRgb::black(rows, columns),
            total: Array2::zeros((rows, columns)),
            factor: 1.0,
            narrow_surfaces: None,
            unseen_points: None,
            ghost_share: None,
        };
        Self { to_rgb: SpectrumToRgb::shown(grid), luminous, summary }
    }

    fn add(&mut self, band: usize, plane: &Array2<f32>) {
        let (mean, max) = mean_and_max(plane);
        self.summary.mean.push(mean);
        self.summary.max.push(max.into());
        self.summary.mean_lux += self.luminous[band] * mean;
        self.summary.seen.add(plane, self.to_rgb.of_band(band));
        self.summary.total += plane;
    }
}

/// Returns the mean of samples and the largest of them, 0 at least.
fn mean_and_max(plane: &Array2<f32>) -> (f64, f32) {
    /// Sums that do not wait for each other.
    const LANES: usize = 16;
    let (mut sums, mut max) = ([0.0_f64; LANES], [0.0_f32; LANES]);
    let mut add = |lane: usize, sample: f32| {
        sums[lane] += f64::from(sample);
        max[lane] = max[lane].max(sample);
    };
    for row in plane.as_standard_layout().rows() {
        let (whole, rest) = row.to_slice().expect("it is in standard order").as_chunks::<LANES>();
        for samples in whole {
            (0..LANES).for_each(|lane| add(lane, samples[lane]));
        }
        rest.iter().enumerate().for_each(|(lane, &sample)| add(lane, sample));
    }
    (sums.iter().sum::<f64>() / plane.len() as f64, max.into_iter().fold(0.0, f32::max))
}

#[cfg(test)]
mod tests {
    use dioptric_forward::{DiscLens, ImagingSpec, Settings};
    use dioptric_scene::View;
    use dioptric_spectrum::{Cancel, DepthMap};

    use super::*;
    use crate::Silent;

    fn image_with(memory_bytes: u64, folder: Option<&BandFolder>) -> Irradiance {
        let grid = WavelengthGrid::uniform(450.0, 650.0, 100.0).unwrap();
        let planes = (0..3)
            .map(|band| Array2::from_shape_fn((24, 30), |(row, column)| ((row * 7 + column * 3 + band) % 11) as f32));
        let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), planes.collect()).unwrap();
        let view = View { focal_px: 5000.0, center_x_px: 14.5, center_y_px: 11.5 };
        let depth = Some(DepthMap::flat(24, 30, 2.0).unwrap());
        let scene = Scene { depth, view: Some(view), ..Scene::new("test", radiance) };
        let place = FilmPlace {
            rows: 16,
            columns: 20,
            pitch_um: 10.0,
            binning: 1,
            film_distance_mm: 50.0,
            focus_distance_mm: None,
            exit_pupil_distance_mm: None,
            exit_pupil_axis_mm: [0.0; 2],
            part: None,
        };
        let lens = DiscLens { focus_dioptres: 1.0, radius_um_per_dioptre: 20.0, focal_mm: 50.0, ..DiscLens::default() };
        let spec = ImagingSpec { film: place.film(), grid, settings: Settings::default() };
        let cancel = Cancel::new();
        let geometry = Source::of_scene(&scene).unwrap().geometry();
        let plan = ImagingPlan::new(std::sync::Arc::new(lens), &geometry, spec, &|_| {}, &cancel).unwrap();
        let keeping = Keeping { memory_bytes, folder };
        image((&plan, None), &scene, &place, keeping, &Watch { progress: &Silent, cancel: &cancel }).unwrap()
    }

    #[test]
    fn bands_of_a_killed_run_are_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        let bands = BandFolder { path: folder.path().to_owned(), key: "camera".to_owned(), photodiode: None };
        let whole = image_with(u64::MAX, None);
        for memory_bytes in [u64::MAX, 100] {
            for n_left in [0, 1, 2, 3] {
                let mut store = bands.open((16, 20), 3).unwrap();
                (store.n_done()..n_left).for_each(|band| store.append(&whole.band(band).unwrap()).unwrap());
                drop(store);
                let resumed = image_with(memory_bytes, Some(&bands));
                assert_eq!(resumed.is_spilled(), memory_bytes == 100);
                for band in 0..3 {
                    assert_eq!(resumed.band(band).unwrap(), whole.band(band).unwrap(), "{n_left} left, band {band}");
                }
                assert_eq!(resumed.summary.mean_lux, whole.summary.mean_lux);
                std::fs::remove_file(folder.path().join("bands.ron")).unwrap();
            }
        }
    }

    #[test]
    fn spilled_bands_are_those_in_memory() {
        let (kept, spilled) = (image_with(u64::MAX, None), image_with(100, None));
        assert!(!kept.is_spilled() && spilled.is_spilled());
        for band in [2, 0, 1] {
            assert_eq!(kept.band(band).unwrap(), spilled.band(band).unwrap());
        }
        assert_eq!(kept.summary.mean, spilled.summary.mean);
        let cube = kept.cube().unwrap();
        assert!(cube.is_standard_layout() && spilled.cube().is_none());
        assert_eq!(cube.index_axis(Axis(0), 1), kept.band(1).unwrap().view());
        assert!(kept.band(3).is_err() && spilled.band(3).is_err());
    }

    #[test]
    fn file_gives_back_the_same_bits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("irradiance.exr");
        let made = image_with(u64::MAX, None);
        made.write_exr(&path, ExrSamples::Single).unwrap();
        let read = Irradiance::read_exr(&path, None).unwrap().of_own_file();
        assert_eq!((read.pitch_um(), read.grid()), (made.pitch_um(), made.grid()));
        for band in 0..3 {
            assert_eq!(read.band(band).unwrap(), made.band(band).unwrap());
        }
    }
}
