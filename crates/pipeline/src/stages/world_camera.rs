//! The camera of a world's file in the words of a camera file.

use std::path::Path;

use dioptric_backward::{Camera, LensOrigin, distance_ahead_m};
use dioptric_optics::Lens;
use dioptric_world::{CameraKind, World, WorldCamera};

use super::world_view::{placement, reference_band};
use crate::{
    Camera as CameraFile, Diffraction, FilmSpec, FocusSpec, LensReadOptions, LensSpec, PipelineError, SceneSource,
    StopSpec, reference_nm_of,
};

/// The most columns of a view that is no more than the summary of a picture.
const SUMMARY_COLUMNS: usize = 480;
/// How much wider than the film a view is, for what blur brings in from beyond.
const MARGIN: f64 = 1.15;
/// The paper's stand-in for dispersion: a straight line through each index at 550 nm, per nm.
const PAPER_SLOPE_PER_NM: f64 = -0.04 / 300.0;

impl CameraFile {
    /// Takes lens, stop, focus, film and place from the camera of a world's file; returns whether that has a lens.
    ///
    /// The scene must be that world. A camera by formula changes the film alone, which then has the scene's size.
    ///
    /// # Errors
    /// When the lens cannot be read or cannot be what is said of it.
    pub fn take_from_world(&mut self, of_file: &WorldCamera) -> Result<bool, PipelineError> {
        let SceneSource::World(spec) = &mut self.scene.source else { return Ok(false) };
        let CameraKind::Lens { file, focal_length_mm, aperture_diameter_mm, has_dispersion, .. } = &of_file.kind else {
            self.film = FilmSpec::Scene;
            return Ok(false);
        };
        let path = spec.file.parent().unwrap_or(Path::new("")).join(file);
        let slope_per_nm = has_dispersion.then_some(PAPER_SLOPE_PER_NM);
        self.lens_reading = LensReadOptions { slope_per_nm, ..LensReadOptions::default() };
        self.iris = None;
        (self.lens, self.stop) = match focal_length_mm {
            Some(focal_length_mm) if file.is_empty() => {
                let thin = LensSpec::Thin { focal_length_mm: *focal_length_mm, diameter_mm: *aperture_diameter_mm };
                (thin, StopSpec::AsGiven)
            }
            _ => (LensSpec::File(path.clone()), StopSpec::DiameterMm(*aperture_diameter_mm)),
        };
        let Camera::Lens(camera) = Camera::from_world(of_file, &reference_band()?, &|_| Lens::read(&path))? else {
            unreachable!("a camera with a lens")
        };
        let settings = camera.settings();
        let file = self.lens.open(&self.lens_reading)?;
        let reference_nm = reference_nm_of(&file);
        let lens = self.stop.apply_at(file.lens, reference_nm)?.at(reference_nm)?;
        let (columns, rows) = of_file.resolution;
        let film_distance_mm = settings.film_distance_mm;
        // The view is no more than the picture's summary.
        let fewer = columns.div_ceil(SUMMARY_COLUMNS).max(1);
        spec.size = Some(((columns / fewer).max(1), (rows / fewer).max(1)));
        self.focus = FocusSpec::FilmMm(film_distance_mm);
        self.film = FilmSpec::Pixels { columns, rows, pitch_um: 1e3 * settings.film_size_mm.x / columns as f64 };
        self.diffraction = if settings.diffraction.is_some() { Diffraction::default() } else { Diffraction::None };
        spec.advance_mm = match settings.origin {
            LensOrigin::Film => lens.last_vertex_z_mm() + film_distance_mm - lens.projection_center_z_mm(),
            LensOrigin::EntrancePupil => 0.0,
            LensOrigin::FirstVertex => -lens.projection_center_z_mm(),
        };
        let half_tan = MARGIN * 0.5 * settings.film_size_mm.x / lens.film_scale_mm(film_distance_mm).abs();
        self.scene.field_of_view_deg = Some(2.0 * half_tan.atan().to_degrees());
        Ok(true)
    }

    /// Returns the focus on what stands before the middle of the picture; on infinity where nothing does.
    ///
    /// # Errors
    /// When the lens cannot be read, or the camera stands outside the room of the still life.
    pub fn focus_ahead(&self, world: &World) -> Result<FocusSpec, PipelineError> {
        let SceneSource::World(spec) = &self.scene.source else { return Ok(self.focus) };
        let lens = self.stopped_lens()?;
        let ahead_m = distance_ahead_m(world, &placement(world, spec, self.scene.field_of_view_deg)?);
        let ahead_m = ahead_m.unwrap_or(f64::INFINITY);
        // The center of the entrance pupil stands at the camera's place, the first vertex before or behind it.
        Ok(FocusSpec::DistanceMm(1e3 * ahead_m - lens.projection_center_z_mm()))
    }
}
