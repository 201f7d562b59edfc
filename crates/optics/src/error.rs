//! What can be wrong with a glass, a lens or a lens file.

use std::path::PathBuf;

/// A glass, lens or lens file that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OpticsError {
    /// A wavelength at which a glass is not known.
    #[error("{glass} is known from {first_nm} to {last_nm} nm, not at {wavelength_nm} nm{remedy}")]
    WavelengthOutsideGlass {
        /// The glass, in words.
        glass: String,
        /// The wavelength asked for, nm.
        wavelength_nm: f64,
        /// Shortest wavelength known, nm.
        first_nm: f64,
        /// Longest wavelength known, nm.
        last_nm: f64,
        /// What to do about it; nothing of a glass that cannot be continued.
        remedy: &'static str,
    },
    /// A wavelength to which a glass cannot be continued.
    #[error("{glass} cannot be continued to {wavelength_nm} nm: {reason}")]
    NotExtended {
        /// The glass, in words.
        glass: String,
        /// The wavelength asked for, nm.
        wavelength_nm: f64,
        /// Why not.
        reason: String,
    },
    /// A lens whose stop stands for no f-number.
    #[error(
        "{lens} has no f-number that its stop could be set to: {reason}; state the diameter of the stop (--stop-mm)"
    )]
    NoFNumber {
        /// The lens.
        lens: String,
        /// Why not.
        reason: &'static str,
    },
    /// A wavelength that is not a positive number.
    #[error("a wavelength must be a positive number, found {wavelength_nm} nm")]
    Wavelength {
        /// What was given, nm.
        wavelength_nm: f64,
    },
    /// A glass whose numbers give no index.
    #[error("{glass} has no refractive index at {wavelength_nm} nm: its formula gives {found}")]
    Index {
        /// The glass, in words.
        glass: String,
        /// The wavelength, nm.
        wavelength_nm: f64,
        /// What the formula gave.
        found: f64,
    },
    /// A number of a glass that makes no sense.
    #[error("glass: {key} is {found}, expected {expected}")]
    Glass {
        /// Which number.
        key: &'static str,
        /// What stood there.
        found: f64,
        /// What should stand there.
        expected: &'static str,
    },
    /// A number of a surface that makes no sense.
    #[error("surface {surface}: {key} is {found}, expected {expected}")]
    Surface {
        /// 0-based surface.
        surface: usize,
        /// Which number.
        key: &'static str,
        /// What stood there.
        found: f64,
        /// What should stand there.
        expected: &'static str,
    },
    /// A surface that cannot be diffractive, or a task that does not know of such.
    #[error("{lens}: {reason}")]
    Diffractive {
        /// The lens.
        lens: String,
        /// What is wrong.
        reason: String,
    },
    /// A surface that cannot be a mirror.
    #[error("surface {surface} cannot be a mirror: {reason}")]
    Mirror {
        /// 0-based surface.
        surface: usize,
        /// Why not.
        reason: String,
    },
    /// A rim that lies beyond the sphere or conic it should be cut from.
    #[error("surface {surface}: a rim of {semi_aperture_mm} mm does not fit on a surface of radius {radius_mm} mm")]
    RimBeyondSurface {
        /// 0-based surface.
        surface: usize,
        /// Half the clear diameter, mm.
        semi_aperture_mm: f64,
        /// Radius of curvature, mm.
        radius_mm: f64,
    },
    /// Not exactly one stop.
    #[error("a lens has exactly one stop, but {n_stops} surfaces are marked as the stop")]
    Stops {
        /// How many were found.
        n_stops: usize,
    },
    /// No surfaces, or more than can be counted.
    #[error("a lens has 1 to 1000 surfaces, found {n_surfaces}")]
    SurfaceCount {
        /// How many were found.
        n_surfaces: usize,
    },
    /// A change of a surface that is not there.
    #[error("a change is of surface {surface}, expected 0 to {}", n_surfaces - 1)]
    ChangeOfSurface {
        /// The surface it names, counted from 0.
        surface: usize,
        /// How many surfaces the lens has.
        n_surfaces: usize,
    },
    /// A move of surfaces that are not there.
    #[error(
        "move {number} is of surfaces {first} to {last}, expected a first and a last of 0 to {n_surfaces} (the film)"
    )]
    MoveOfSurfaces {
        /// 0-based place in the list of moves.
        number: usize,
        /// The first surface it names.
        first: usize,
        /// The last surface it names.
        last: usize,
        /// How many surfaces the lens has.
        n_surfaces: usize,
    },
    /// A configuration that a lens file does not have.
    #[error("configuration {number} is asked for, expected {}", configurations_of(*n_configurations))]
    Configuration {
        /// The one asked for.
        number: usize,
        /// How many there are.
        n_configurations: usize,
    },
    /// More apertures than any lens needs.
    #[error("a lens has at most {most} apertures, found {n_apertures}")]
    ApertureCount {
        /// How many were found.
        n_apertures: usize,
        /// How many there may be.
        most: usize,
    },
    /// More moves than any lens needs.
    #[error("a lens has at most {most} moves, found {n_moves}")]
    MoveCount {
        /// How many were found.
        n_moves: usize,
        /// How many there may be.
        most: usize,
    },
    /// A number of a move that makes no sense.
    #[error("move {number} has the number {found}, expected finite numbers below 1e9")]
    MoveNumber {
        /// 0-based place in the list of moves.
        number: usize,
        /// What stood there.
        found: f64,
    },
    /// A lens without an axis of symmetry where one is needed.
    #[error("{task} needs a lens that is centered and rotationally symmetric, which {lens} is not")]
    NotRotational {
        /// The lens.
        lens: String,
        /// What was to be done, in words.
        task: &'static str,
    },
    /// A stop wider than the lens allows.
    #[error("the stop of {lens} opens to at most {largest_mm} mm{}, asked for {asked_mm} mm", f_number_words(*smallest_f_number))]
    StopTooWide {
        /// The lens.
        lens: String,
        /// The diameter asked for, mm.
        asked_mm: f64,
        /// The largest diameter, mm.
        largest_mm: f64,
        /// The f-number of that diameter at the d line; NaN where the lens has none.
        smallest_f_number: f64,
    },
    /// An f-number below that of the lens with its stop fully open.
    #[error("{lens} opens to f/{smallest:.3} at most{}, asked for f/{asked}", rim_words(*rim))]
    FNumberTooSmall {
        /// The lens.
        lens: String,
        /// The f-number asked for.
        asked: f64,
        /// The f-number of what gets through.
        smallest: f64,
        /// The 0-based surface whose rim limits the light then, where it is not the stop.
        rim: Option<usize>,
    },
    /// A quantity that must be positive.
    #[error("{what} must be a positive number, found {found}")]
    NotPositive {
        /// Which quantity, with its unit.
        what: &'static str,
        /// What was given.
        found: f64,
    },
    /// An object or a film that has no image.
    #[error("{lens} forms no image {side} of an object or film at {distance_mm} mm")]
    NoFocus {
        /// The lens.
        lens: String,
        /// On which side the image was sought.
        side: &'static str,
        /// The distance given, mm.
        distance_mm: f64,
    },
    /// A film that rays cannot leave towards the lens.
    #[error("the film of {lens} lies {film_distance_mm} mm behind the last vertex, expected a distance above 0")]
    FilmInLens {
        /// The lens.
        lens: String,
        /// The distance given, mm.
        film_distance_mm: f64,
    },
    /// A name that names nothing.
    #[error("no {kind} is named '{name}'; {known}")]
    Unknown {
        /// What was looked for.
        kind: &'static str,
        /// The name given.
        name: String,
        /// The names that would do.
        known: String,
    },
    /// A name that means several things.
    #[error("{kind} '{name}' could be {}; name one of them", summary(candidates))]
    Ambiguous {
        /// What was looked for.
        kind: &'static str,
        /// The name given.
        name: String,
        /// What it could mean, each by a name that means it alone.
        candidates: Vec<String>,
    },
    /// A lens that cannot be made larger or smaller.
    #[error("the lens cannot be scaled: {reason}")]
    Scale {
        /// Why not.
        reason: String,
    },
    /// A lens that a file format cannot hold.
    #[error("{format} cannot hold this lens: {reason}")]
    CannotWrite {
        /// The format, in words.
        format: &'static str,
        /// What it has no place for.
        reason: String,
    },
    /// A file that cannot be read or written.
    #[error("{path}: {reason}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file whose text is not what it should be.
    #[error("{path}{}: {reason}", line.map(|l| format!(":{l}")).unwrap_or_default())]
    File {
        /// The file.
        path: PathBuf,
        /// 1-based line where known.
        line: Option<usize>,
        /// What is wrong there and what was expected.
        reason: String,
    },
}

impl OpticsError {
    /// Returns the error of a glass with the surface that it lies behind, where its description alone does not tell it from
    /// others.
    pub(crate) fn behind_surface(mut self, surface: usize) -> Self {
        if let Self::WavelengthOutsideGlass { glass, .. } | Self::NotExtended { glass, .. } | Self::Index { glass, .. } =
            &mut self
            && glass.starts_with("a ")
        {
            *glass = format!("{glass} behind surface {surface}");
        }
        self
    }
}

/// Joins names as `a, b or c`.
fn summary(names: &[String]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => names.concat(),
    }
}

/// Returns an f-number in brackets, or nothing for what is none.
fn rim_words(rim: Option<usize>) -> String {
    rim.map_or(String::new(), |surface| format!(", where the rim of surface {surface} limits its light"))
}

fn f_number_words(f_number: f64) -> String {
    if f_number.is_finite() { format!(" (f/{f_number:.3})") } else { String::new() }
}

/// Returns which configurations there are, in words.
fn configurations_of(n_configurations: usize) -> String {
    match n_configurations {
        1 => "1: the lens has one alone".to_owned(),
        n => format!("1 to {n}"),
    }
}
