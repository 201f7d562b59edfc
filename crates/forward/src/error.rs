//! What can keep a scene from being imaged.

use dioptric_spectrum::{Cancelled, SpectrumError};

/// A scene that cannot be imaged through a lens.
#[derive(Debug, thiserror::Error)]
pub enum ForwardError {
    /// The scene has no depth map.
    #[error("the scene '{scene}' has no depth: give it a depth map or a flat depth")]
    MissingDepth {
        /// Name of the scene.
        scene: String,
    },
    /// The scene has no field of view.
    #[error("the scene '{scene}' has no field of view: give its focal length or its horizontal field of view")]
    MissingView {
        /// Name of the scene.
        scene: String,
    },
    /// The scene is not in radiance.
    #[error("the scene is in {unit}, expected spectral radiance: light it first")]
    NotRadiance {
        /// Unit of the scene's samples.
        unit: &'static str,
    },
    /// Two planes that must be of one size.
    #[error("{what} is {found_rows} x {found_columns} samples, expected {rows} x {columns} as the depth map")]
    Size {
        /// What was compared with the depth map.
        what: &'static str,
        /// Its rows.
        found_rows: usize,
        /// Its columns.
        found_columns: usize,
        /// Rows of the depth map.
        rows: usize,
        /// Columns of the depth map.
        columns: usize,
    },
    /// A band at another wavelength than that for which a plan was made.
    #[error("band {band} of the radiance is at {found_nm} nm, but the imaging was planned for {planned_nm} nm")]
    OtherBand {
        /// 0-based band.
        band: usize,
        /// Its center, nm.
        found_nm: f64,
        /// That of the plan, nm.
        planned_nm: f64,
    },
    /// A band that a plan does not have.
    #[error("there is no band {band}: the imaging was planned for {n_bands} bands, counted from 0")]
    NoSuchBand {
        /// The band asked for.
        band: usize,
        /// The number of bands of the plan.
        n_bands: usize,
    },
    /// A plan was made with the depth of a hidden layer whose radiance is not given.
    #[error("the imaging was planned with a hidden layer, but its radiance is missing")]
    MissingOccludedRadiance,
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A film of no area.
    #[error("a film of {rows} x {columns} pixels of {pitch_um} um has no area")]
    EmptyFilm {
        /// Rows of pixels.
        rows: usize,
        /// Columns of pixels.
        columns: usize,
        /// Pixel pitch, µm.
        pitch_um: f64,
    },
    /// A setting outside its range.
    #[error("{what} is {value}, expected {expected}")]
    Setting {
        /// Name of the setting.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// A depth that lies inside the lens.
    #[error(
        "the scene is {depth_m:.5} m away{}, which lies inside {lens}: its first surface is {least_m:.4} m from its entrance pupil, where depth begins",
        summary(*.place)
    )]
    DepthInsideLens {
        /// The depth, m.
        depth_m: f64,
        /// The sample that has it, row and column, where that is known.
        place: Option<(usize, usize)>,
        /// Name of the lens.
        lens: String,
        /// Depth of the first surface, m.
        least_m: f64,
    },
    /// No light reaches the middle of the film.
    #[error("no light of the scene reaches the middle of the film through {lens} at {wavelength_nm} nm")]
    DarkFilm {
        /// Name of the lens.
        lens: String,
        /// Wavelength, nm.
        wavelength_nm: f64,
    },
    /// The lens could not be traced.
    #[error(transparent)]
    Lens(#[from] dioptric_optics::OpticsError),
    /// Its pupil could not be divided.
    #[error(transparent)]
    Psf(#[from] dioptric_psf::PsfError),
    /// A point of the scene cannot be.
    #[error(transparent)]
    Scene(#[from] dioptric_scene::SceneError),
    /// A band could not be had.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// The receiver of the bands gave up.
    #[error("band {band} could not be handed on: {reason}")]
    Sink {
        /// 0-based band.
        band: usize,
        /// Why.
        reason: SinkError,
    },
}

fn summary(place: Option<(usize, usize)>) -> String {
    place.map_or_else(String::new, |(row, column)| format!(" at row {row}, column {column}"))
}

/// Why a receiver of bands gave up.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;
