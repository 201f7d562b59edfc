//! Lenses and glasses on the command line.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use dioptric_pipeline::{LensReadOptions, MissingGlass, SeqNumbers};

/// Something to do with lenses.
#[derive(Debug, Subcommand)]
pub(crate) enum LensCommand {
    /// Lists the built-in lenses
    List,
    /// Prints first-order data and, of a lens with an axis of symmetry, third-order sums
    Info(LensInfoArgs),
    /// Analyzes the lens by real rays: spots, fans, wavefronts, field curvature, distortion, color, illumination, focus
    Analyze(LensAnalyzeArgs),
    /// Draws the lens with rays, as SVG or, in a build with the feature png, PNG
    Draw(LensDrawArgs),
    /// Writes a lens in another format, chosen by the extension
    Convert {
        /// Lens to read, a file or the name of a built-in one
        input: String,
        /// File to write; a .zmx file of a lens with glasses of its own gets a catalogue (.agf) beside it
        output: PathBuf,
        #[command(flatten)]
        reading: LensReadingArgs,
    },
}

/// What a lens file leaves open.
#[derive(Debug, Args)]
pub(crate) struct LensReadingArgs {
    /// Glass catalogue to look in before the built-in one, .agf or .yml; may be given several times
    #[arg(long, value_name = "F")]
    pub(crate) glasses: Vec<PathBuf>,
    /// What to do with a glass that no catalogue has [default: refuse]
    #[arg(long, value_enum)]
    pub(crate) missing_glass: Option<MissingGlassArg>,
    /// Change of index a nm, about 550 nm, of media with one stated index, as .dat files have (the paper: -0.000133)
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub(crate) slope_per_nm: Option<f64>,
    /// What the numbers of S are in a .seq file that says neither RDM nor CUM [default: what is plausible]
    #[arg(long, value_name = "KIND")]
    pub(crate) seq_numbers: Option<SeqNumbersArg>,
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

impl LensReadingArgs {
    pub(crate) fn reading(&self) -> LensReadOptions {
        let mut reading = LensReadOptions::default();
        self.change(&mut reading);
        reading
    }

    /// Changes what was asked for.
    pub(crate) fn change(&self, reading: &mut LensReadOptions) {
        if !self.glasses.is_empty() {
            reading.glasses.clone_from(&self.glasses);
        }
        if let Some(missing_glass) = self.missing_glass {
            reading.missing_glass = match missing_glass {
                MissingGlassArg::Refuse => MissingGlass::Refuse,
                MissingGlassArg::NdVd => MissingGlass::FromNdVd,
                MissingGlassArg::Nearest => MissingGlass::Nearest,
            };
        }
        if let Some(numbers) = self.seq_numbers {
            reading.seq_numbers = Some(match numbers {
                SeqNumbersArg::Radii => SeqNumbers::Radii,
                SeqNumbersArg::Curvatures => SeqNumbers::Curvatures,
            });
        }
        reading.slope_per_nm = self.slope_per_nm.or(reading.slope_per_nm);
    }
}

/// What to print about a lens.
#[derive(Debug, Args)]
pub(crate) struct LensInfoArgs {
    /// Lens, a file or the name of a built-in one
    pub(crate) lens: String,
    /// Wavelengths, nm: a list or first:last:step [default: 550; of a lens not known there, its file's, else one that its
    /// glasses know]
    #[arg(long, value_name = "LIST")]
    pub(crate) wavelengths_nm: Option<String>,
    /// Also images an object at this distance from the first vertex, mm
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    /// Diameter of the stop, mm [default: the lens's own]
    #[arg(long, value_name = "D")]
    pub(crate) stop_mm: Option<f64>,
    /// Half field for the third-order sums, degrees
    #[arg(long, value_name = "A", default_value_t = 10.0)]
    pub(crate) field_deg: f64,
    #[command(flatten)]
    pub(crate) reading: LensReadingArgs,
}

/// What to analyze of a lens.
#[derive(Debug, Args)]
pub(crate) struct LensAnalyzeArgs {
    /// Lens, a file or the name of a built-in one
    pub(crate) lens: String,
    /// Field angles, degrees: above the axis as 0,10,20, or along x and y as 5/10 [default: those of the lens's file, else 0,
    /// 0.5, 0.7 and 1 of where the light falls to a quarter]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) fields_deg: Option<String>,
    /// Fields as object points, mm from the axis, for an object at a finite distance: y, or x/y
    #[arg(long, value_name = "LIST", conflicts_with = "fields_deg", allow_hyphen_values = true)]
    pub(crate) fields_mm: Option<String>,
    /// Wavelengths, nm: a list or first:last:step; that nearest to 550 is the reference [default: those of the lens's file,
    /// with its reference, else 450,550,650, or three that its glasses know]
    #[arg(long, value_name = "LIST")]
    pub(crate) wavelengths_nm: Option<String>,
    /// Distance of the object from the first vertex, mm, or inf [default: that of the lens's file, else inf]
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    /// Stops the lens down to this f-number
    #[arg(long, value_name = "N", conflicts_with = "stop_mm")]
    pub(crate) f_number: Option<f64>,
    /// Diameter of the stop, mm [default: the lens's own]
    #[arg(long, value_name = "D")]
    pub(crate) stop_mm: Option<f64>,
    /// Places the film this far behind the last vertex, mm [default: where the spot on the axis is smallest]
    #[arg(long, value_name = "D", conflicts_with = "focus_mm", allow_negative_numbers = true)]
    pub(crate) film_mm: Option<f64>,
    /// Places the film at the paraxial image of this distance from the first vertex, mm, or inf
    #[arg(long, value_name = "D")]
    pub(crate) focus_mm: Option<f64>,
    #[command(flatten)]
    pub(crate) reading: LensReadingArgs,
    /// Rings of rays in a spot: N of them have 1 + 3N(N + 1) rays
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub(crate) rings: usize,
    /// Folder for analysis.json, analysis.html and the plots (analysis, spots, opd, distortion) as SVG; as PNG too in a
    /// build with the feature png
    #[arg(long, short, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// How to draw a lens.
#[derive(Debug, Args)]
pub(crate) struct LensDrawArgs {
    /// Lens, a file or the name of a built-in one
    pub(crate) lens: String,
    #[command(flatten)]
    pub(crate) reading: LensReadingArgs,
    /// File to write: .svg, or .png in a build with the feature png
    #[arg(long, short, visible_alias = "out", value_name = "F")]
    pub(crate) output: PathBuf,
    /// Field angles of the ray fans, degrees [default: those of the lens's file, else 0,10]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) fields_deg: Option<String>,
    /// Distance of the object, mm, or inf [default: that of the lens's file, else inf]
    #[arg(long, value_name = "D")]
    pub(crate) distance_mm: Option<f64>,
    /// Diameter of the stop, mm [default: the lens's own]
    #[arg(long, value_name = "D")]
    pub(crate) stop_mm: Option<f64>,
    /// Film distance behind the last vertex, mm [default: in focus]
    #[arg(long, value_name = "D")]
    pub(crate) film_mm: Option<f64>,
    /// Wavelengths of the rays, nm: a list or first:last:step; focus and f-number are those of the first [default: the
    /// reference of the lens's file, else 550, or one that its glasses know]
    #[arg(long, alias = "wavelength-nm", value_name = "LIST")]
    pub(crate) wavelengths_nm: Option<String>,
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
        /// Wavelengths, nm: a list or first:last:step
        #[arg(long, value_name = "LIST", default_value = "400:700:50")]
        wavelengths_nm: String,
    },
}
