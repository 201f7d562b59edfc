//! Lenses and glasses on the command line.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use dioptric_analysis::{AnalysisFilm, LensDefaults};
use dioptric_pipeline::{
    CoatingSpec, FocusSpec, GlassRange, LensReadOptions, MissingGlass, SeqNumbers, StopSpec, parse_numbers,
};

use crate::{common::Common, iris_args::IrisArgs, movement_args::MovementArgs, terminal::remark};

/// Something to do with lenses.
#[derive(Debug, Subcommand)]
pub(crate) enum LensCommand {
    /// Lists the built-in lenses
    List,
    /// Prints first-order data and, of a lens with an axis of symmetry, third-order sums
    Info(LensInfoArgs),
    /// Analyzes the lens by real rays: spots, fans, wavefronts, field curvature, distortion, color, illumination, focus
    Analyze(LensAnalyzeArgs),
    /// Compares two lenses by real rays: numbers and curves side by side
    Compare(LensCompareArgs),
    /// Draws the lens with rays, as SVG or, in a build with the feature png, PNG
    Draw(LensDrawArgs),
    /// Lists the light that pairs of surfaces reflect to the film: where, how wide and how bright
    Ghosts(LensGhostsArgs),
    /// Writes a lens in another format, chosen by the extension
    Convert {
        /// Lens to read: a file, the name of a built-in one, thin:50mm:f2, pinhole:0.1mm, eye:navarro:4D or eye:FILE:3mm
        input: String,
        /// File to write; a .zmx file of a lens with glasses of its own gets a catalogue (.agf) beside it
        output: PathBuf,
        /// Refuses to leave out anything: what of the file read is not understood, or what the format written has no place for
        #[arg(long)]
        strict: bool,
        #[command(flatten)]
        reading: LensReadingArgs,
    },
}

/// A lens, how far it is open and how it stands: what every command about one lens takes.
#[derive(Debug, Args)]
pub(crate) struct LensArgs {
    /// Lens: a file, the name of a built-in one, thin:50mm:f2, pinhole:0.1mm, eye:navarro:4D or eye:FILE:3mm
    pub(crate) lens: String,
    #[command(flatten)]
    pub(crate) state: LensStateArgs,
}

/// What the file of a lens leaves open, how far the lens is open, and how it is turned and moved.
#[derive(Debug, Args)]
#[command(next_help_heading = "Lens")]
pub(crate) struct LensStateArgs {
    #[command(flatten)]
    pub(crate) reading: LensReadingArgs,
    /// Stops the lens down to this f-number
    #[arg(long, value_name = "N", conflicts_with = "stop_mm")]
    pub(crate) f_number: Option<f64>,
    /// Diameter of the stop, mm [default: the lens's own]
    #[arg(long, value_name = "D")]
    pub(crate) stop_mm: Option<f64>,
    #[command(flatten)]
    pub(crate) iris: IrisArgs,
    #[command(flatten)]
    pub(crate) movements: MovementArgs,
}

/// Where the film is: at a focus or at a place.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Focus")]
#[group(multiple = false)]
pub(crate) struct FilmArgs {
    /// Focuses on this distance from the first vertex, mm, or inf [default of a render with --lens: what stands ahead]
    #[arg(long, value_name = "D")]
    pub(crate) focus_mm: Option<f64>,
    /// Places the film this far behind the last vertex, mm
    #[arg(long, value_name = "D")]
    pub(crate) film_mm: Option<f64>,
}

/// Which wavelengths.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Wavelengths")]
pub(crate) struct BandArgs {
    /// Wavelengths, nm: a list or first:last:step [default: those of the scene or of the lens's file, else usual ones at which
    /// the glasses are known]
    #[arg(long, alias = "wavelength-nm", value_name = "LIST")]
    wavelengths_nm: Option<String>,
}

impl LensArgs {
    /// Returns the lens as its file has it, and what the file says of its use, which is printed where this program does
    /// otherwise.
    pub(crate) fn open(&self, common: &Common) -> anyhow::Result<LensDefaults> {
        let used = LensDefaults::open(&self.lens, &self.state.reading.reading(), self.state.stop_mm)?;
        used.notes.iter().for_each(|note| remark(common.quiet, note));
        Ok(used)
    }
}

impl LensStateArgs {
    /// The stop that was asked for.
    pub(crate) fn stop(&self) -> Option<StopSpec> {
        self.f_number.map(StopSpec::FNumber).or(self.stop_mm.map(StopSpec::DiameterMm))
    }

    /// Returns the lens with its stop and its movements, and prints the notes on them; an f-number is that at the wavelength of the
    /// focus, whatever wavelengths are looked at.
    pub(crate) fn apply(
        &self,
        used: LensDefaults,
        wavelengths_nm: &[f64],
        common: &Common,
    ) -> anyhow::Result<LensDefaults> {
        let wavelength_nm = used.focus_wavelength_nm(wavelengths_nm)?;
        let n_told = used.notes.len();
        let mut iris = used.lens.iris().copied();
        self.iris.change(&mut iris)?;
        let placed = used.placed(self.stop().unwrap_or_default(), iris, self.movements.movements(), wavelength_nm)?;
        placed.notes[n_told..].iter().for_each(|note| remark(common.quiet, note));
        Ok(placed)
    }
}

/// Where the film of a lens that is looked at is: at its file's own image plane unless one of these says otherwise.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Focus")]
#[group(multiple = false)]
pub(crate) struct LensFilmArgs {
    /// Focuses on this distance from the first vertex, mm, or inf
    #[arg(long, value_name = "D")]
    focus_mm: Option<f64>,
    /// Places the film this far behind the last vertex, mm
    #[arg(long, value_name = "D")]
    film_mm: Option<f64>,
    /// Places the film where the spot on the axis is smallest, all wavelengths together [default where the lens's file states no
    /// image plane]
    #[arg(long)]
    best_focus: bool,
    /// Looks at light that leaves in parallel, or nearly so, by its angles: through an ideal lens of 1000 mm right behind the last
    /// surface, in focus for parallel light [default of lenses that form no image, there with the best focus]
    #[arg(long)]
    afocal: bool,
}

impl LensFilmArgs {
    /// Returns where the film is of a lens that is used so.
    pub(crate) fn of(self, used: &LensDefaults) -> AnalysisFilm {
        match (self.film_mm, self.focus_mm) {
            (Some(film_mm), _) => AnalysisFilm::FilmMm(film_mm),
            (None, Some(distance_mm)) => AnalysisFilm::FocusMm(distance_mm),
            (None, None) if self.best_focus => AnalysisFilm::BestFocus,
            (None, None) if self.afocal => AnalysisFilm::Afocal,
            (None, None) => used.film(),
        }
    }
}

impl FilmArgs {
    /// The place that was asked for.
    pub(crate) fn focus(self) -> Option<FocusSpec> {
        self.focus_mm.map(FocusSpec::DistanceMm).or(self.film_mm.map(FocusSpec::FilmMm))
    }
}

impl BandArgs {
    /// The wavelengths that were asked for, nm.
    pub(crate) fn nm(&self) -> anyhow::Result<Option<Vec<f64>>> {
        Ok(self.wavelengths_nm.as_deref().map(|list| parse_numbers("--wavelengths-nm", list)).transpose()?)
    }
}

/// What a lens file leaves open.
#[derive(Debug, Args)]
#[command(next_help_heading = "Lens file")]
pub(crate) struct LensReadingArgs {
    /// Glass catalogue to look in before the built-in one, .agf or .yml; may be given several times
    #[arg(long, value_name = "F")]
    pub(crate) glasses: Vec<PathBuf>,
    /// Makers whose glass a name means that several have, as SCHOTT,OHARA; before those that the file names
    #[arg(long, value_name = "MAKERS", value_delimiter = ',')]
    pub(crate) catalog: Vec<String>,
    /// What to do with a glass that no catalogue has [default: refuse]
    #[arg(long, value_enum)]
    pub(crate) missing_glass: Option<MissingGlassArg>,
    /// What becomes of a wavelength outside the range in which a glass is known [default: refuse]
    #[arg(long, value_enum)]
    pub(crate) glass_range: Option<GlassRangeArg>,
    /// Change of index a nm, about 550 nm, of media with one stated index, as .dat files have (the paper: -0.000133)
    #[arg(long, value_name = "S")]
    pub(crate) slope_per_nm: Option<f64>,
    /// What the numbers of S are in a .seq file that says neither RDM nor CUM [default: what is plausible]
    #[arg(long, value_name = "KIND")]
    pub(crate) seq_numbers: Option<SeqNumbersArg>,
    /// Which configuration of a file that has several, as the positions of a zoom lens, from 1 [default: the file's own]
    #[arg(long, value_name = "N")]
    pub(crate) configuration: Option<usize>,
    /// Makes the lens so many times as large in all its lengths, as 25.4 for a file in inches that says millimetres [default: 1]
    #[arg(long, value_name = "K")]
    pub(crate) lens_scale: Option<f64>,
    /// What covers all surfaces between air and glass: bare, mgf2, vcoat, bbar, a file (.csv, .ron, COATING.DAT:NAME), or ideal for no loss of light
    /// at all [default: the file's own, else mgf2]
    #[arg(long, value_name = "COATING")]
    pub(crate) coating: Option<String>,
}

/// What the numbers of surfaces are in a CODE V file that does not say.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum SeqNumbersArg {
    /// Radii of curvature
    Radii,
    /// Curvatures
    Curvatures,
}

/// What to do with a glass that no catalogue has.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MissingGlassArg {
    /// Refuse the lens, and say which glass is missing
    Refuse,
    /// Take the index and the Abbe number that the file states for it
    NdVd,
    /// Take the built-in glass nearest to them
    Nearest,
}

/// What becomes of a wavelength outside the range in which a glass is known.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GlassRangeArg {
    /// Refuse it
    Refuse,
    /// Continue the glass, and state the possible error of its index
    Extend,
}

impl From<GlassRangeArg> for GlassRange {
    fn from(argument: GlassRangeArg) -> Self {
        match argument {
            GlassRangeArg::Refuse => Self::Refuse,
            GlassRangeArg::Extend => Self::Extend,
        }
    }
}

impl LensReadingArgs {
    pub(crate) fn reading(&self) -> LensReadOptions {
        let mut reading = LensReadOptions::default();
        self.change(&mut reading);
        reading
    }

    /// Changes what was asked for.
    pub(crate) fn change(&self, reading: &mut LensReadOptions) {
        if !(self.glasses.is_empty() && self.catalog.is_empty()) {
            reading.glasses = self.glasses.iter().cloned().chain(self.catalog.iter().map(PathBuf::from)).collect();
        }
        if let Some(missing_glass) = self.missing_glass {
            reading.missing_glass = match missing_glass {
                MissingGlassArg::Refuse => MissingGlass::Refuse,
                MissingGlassArg::NdVd => MissingGlass::FromNdVd,
                MissingGlassArg::Nearest => MissingGlass::Nearest,
            };
        }
        reading.glass_range = self.glass_range.map_or(reading.glass_range, GlassRange::from);
        if let Some(numbers) = self.seq_numbers {
            reading.seq_numbers = Some(match numbers {
                SeqNumbersArg::Radii => SeqNumbers::Radii,
                SeqNumbersArg::Curvatures => SeqNumbers::Curvatures,
            });
        }
        reading.configuration = self.configuration.or(reading.configuration);
        reading.slope_per_nm = self.slope_per_nm.or(reading.slope_per_nm);
        reading.lens_scale = self.lens_scale.or(reading.lens_scale);
        if let Some(coating) = &self.coating {
            reading.coating = Some(CoatingSpec::named(coating));
        }
    }
}

/// What to print about a lens.
#[derive(Debug, Args)]
pub(crate) struct LensInfoArgs {
    #[command(flatten)]
    pub(crate) lens: LensArgs,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
    /// Also images an object at this distance from the first vertex, mm
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    /// Half field for the third-order sums, degrees
    #[arg(long, value_name = "A", default_value_t = 10.0)]
    pub(crate) field_deg: f64,
    /// Diameter of the blur that is taken to be sharp, µm: adds the hyperfocal distance, and between which distances an object is
    /// sharp with --distance-mm in focus
    #[arg(long, value_name = "C")]
    pub(crate) blur_um: Option<f64>,
}

/// What to analyze of a lens.
#[derive(Debug, Args)]
pub(crate) struct LensAnalyzeArgs {
    #[command(flatten)]
    pub(crate) lens: LensArgs,
    #[command(flatten)]
    pub(crate) asked: AnalysisArgs,
    /// Folder for analysis.json, analysis.html and the plots (analysis, spots, also through focus, opd, distortion,
    /// footprints) as SVG; as PNG too in a build with the feature png
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// Which two lenses to compare, and how they are looked at.
#[derive(Debug, Args)]
pub(crate) struct LensCompareArgs {
    /// Lens: a file, the name of a built-in one, thin:50mm:f2, pinhole:0.1mm, eye:navarro:4D or eye:FILE:3mm
    pub(crate) lens: String,
    /// The lens to compare it with, in the fields, wavelengths and at the object of the first
    pub(crate) other: String,
    #[command(flatten)]
    pub(crate) state: LensStateArgs,
    #[command(flatten)]
    pub(crate) asked: AnalysisArgs,
    /// Folder for comparison.json, comparison.html and the curves of both as SVG and CSV
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// What an analysis by real rays is of.
#[derive(Debug, Args)]
pub(crate) struct AnalysisArgs {
    /// Field angles, degrees: above the axis as 0,10,20, along x and y as 5/10, or from the axis and about it as 100@30 [default: those
    /// of the lens's file, else 0, 0.5, 0.7 and 1 of where the light falls to a quarter]
    #[arg(long, value_name = "LIST")]
    pub(crate) fields_deg: Option<String>,
    /// Fields as object points, mm from the axis, for an object at a finite distance: y, or x/y
    #[arg(long, value_name = "LIST", conflicts_with = "fields_deg")]
    pub(crate) fields_mm: Option<String>,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
    /// Distance of the object from the first vertex, mm, or inf [default: that of the lens's file, else inf]
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    #[command(flatten)]
    pub(crate) film: LensFilmArgs,
    /// Rings of rays in a spot: N of them have 1 + 3N(N + 1) rays
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub(crate) rings: usize,
}

/// How to draw a lens.
#[derive(Debug, Args)]
pub(crate) struct LensDrawArgs {
    #[command(flatten)]
    pub(crate) lens: LensArgs,
    /// File to write: .svg, or .png in a build with the feature png
    #[arg(long, short, visible_alias = "out", value_name = "F")]
    pub(crate) output: PathBuf,
    /// Field angles of the ray fans, degrees [default: those of the lens's file, else 0,10]
    #[arg(long, value_name = "LIST")]
    pub(crate) fields_deg: Option<String>,
    /// Distance of the object, mm, or inf [default: that of the lens's file, else inf]
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    #[command(flatten)]
    pub(crate) film: LensFilmArgs,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
}

/// Whose ghosts to list, and of which sources.
#[derive(Debug, Args)]
pub(crate) struct LensGhostsArgs {
    #[command(flatten)]
    pub(crate) lens: LensArgs,
    /// Field angles of the source above the axis, degrees [default: those of the lens's file, else 0,5,10]
    #[arg(long, alias = "field-deg", value_name = "LIST")]
    pub(crate) fields_deg: Option<String>,
    /// Distance of the source from the first vertex, mm, or inf [default: that of the lens's file, else inf]
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    #[command(flatten)]
    pub(crate) film: LensFilmArgs,
    #[command(flatten)]
    pub(crate) bands: BandArgs,
    /// Width and height of the film, mm, on which the veil is counted
    #[arg(long, value_name = "WxH", default_value = "36x24")]
    pub(crate) film_size_mm: String,
    /// Rays over the rim of the first surface
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    pub(crate) n_rays: usize,
    /// How often surfaces reflect light at most: 2, 4 and so on, up to 12; ways below 1e-10 of the light are left out from the third on
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) bounces: usize,
    /// The share of the light on the film that it sends back to the lens, as a mirror does
    #[arg(long, value_name = "R", default_value_t = 0.0)]
    pub(crate) film_reflectance: f64,
    /// Also writes a picture of all ghosts of the source on that film, without its image (.png): of two reflections and one field; at 420 to 680 nm unless
    /// wavelengths are given
    #[arg(long, short, value_name = "F.png")]
    pub(crate) out: Option<PathBuf>,
}

/// Something to do with glasses.
#[derive(Debug, Subcommand)]
pub(crate) enum GlassCommand {
    /// Lists the glasses of the catalogue
    List {
        /// Only glasses whose name contains this, in any case
        #[arg(long, value_name = "TEXT")]
        filter: Option<String>,
    },
    /// Prints a glass's refractive index, and what 10 mm of it let through
    Show {
        /// Name of the glass, e.g. N-BK7
        name: String,
        /// Makers whose glass a name means that several have, as SCHOTT,OHARA
        #[arg(long, value_name = "MAKERS", value_delimiter = ',')]
        catalog: Vec<String>,
        #[command(flatten)]
        bands: BandArgs,
        /// What becomes of a wavelength outside the range in which the glass is known [default: refuse]
        #[arg(long, value_enum)]
        glass_range: Option<GlassRangeArg>,
    },
}
