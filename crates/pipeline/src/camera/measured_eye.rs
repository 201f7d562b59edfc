//! Eyes that are known by the coefficients of their wavefronts: a measured one, the mean of many, or one drawn from their statistics.

use std::{collections::BTreeMap, path::Path};

use dioptric_files::text;
use dioptric_optics::{
    DiffractiveSurface, Glass, Interface, Lens, LensFile, PhaseProfile, Shape, Surface, WavefrontBand, WavefrontError,
    ZernikeTerms, zernike,
};
use dioptric_scene::read_mat_matrices;
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::LensSpec;
use crate::PipelineError;

/// An eye of many, drawn from the mean and the covariance of their coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DrawnEye {
    /// Which one: eyes of other numbers are independent of it.
    pub number: u64,
    /// Begins another row of eyes.
    #[serde(default)]
    pub seed: u64,
}

/// How eyes of a file are named.
pub(super) const PATTERNS: &str = "eye:FILE:PUPILmm (eye:IASstats30.mat:3mm, the mean), eye:FILE:PUPILmm:NUMBER and eye:FILE:PUPILmm:NUMBER@SEED \
                                   (drawn from the statistics)";
/// Endings of the files that have coefficients.
const ENDINGS: [&str; 3] = ["mat", "json", "csv"];
/// The wavelength that coefficients are of where a file states none, nm.
const WAVELENGTH_NM: f64 = 550.0;
/// Distance from the pupil to the retina, mm: 0.3 mm of it are a degree.
const RETINA_MM: f64 = 17.187;
/// How far below 0 a variance may be by rounding, as a share of the largest.
const ROUNDING: f64 = 1e-9;
/// The most coefficients of a wavefront error.
const MOST_TERMS: usize = 231;

/// A record of a table of coefficients.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    j: usize,
    um: f64,
    wavelength_nm: Option<f64>,
    x_deg: Option<f64>,
    y_deg: Option<f64>,
}

/// A file of coefficients from piston on, and what is known of how they vary.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Statistics {
    coefficients_um: Vec<f64>,
    #[serde(default)]
    covariance_um2: Vec<Vec<f64>>,
    wavelength_nm: Option<f64>,
}

/// Returns the eye of such a name; `None` for names of other kinds.
pub(super) fn named(name: &str) -> Option<LensSpec> {
    let (rest, last) = name.strip_prefix("eye:")?.rsplit_once(':')?;
    let pupil_of = |text: &str| text.trim().strip_suffix("mm")?.trim_end().parse::<f64>().ok();
    let (file, pupil_mm, drawn) = match pupil_of(last) {
        Some(pupil_mm) => (rest, pupil_mm, None),
        None => {
            let (number, seed) = last.split_once('@').unwrap_or((last, "0"));
            let drawn = DrawnEye { number: number.trim().parse().ok()?, seed: seed.trim().parse().ok()? };
            let (file, pupil) = rest.rsplit_once(':')?;
            (file, pupil_of(pupil)?, Some(drawn))
        }
    };
    is_meant(name).then(|| LensSpec::MeasuredEye { file: file.into(), pupil_mm, drawn })
}

/// Whether a name begins as those of eyes of a file do.
pub(super) fn is_meant(name: &str) -> bool {
    let is_file = |part: &str| {
        let ending = part.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
        ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
    };
    name.strip_prefix("eye:").is_some_and(|rest| rest.split(':').any(is_file))
}

/// Returns an eye of a file: an ideal lens right behind its pupil, in air, with the retina for a film.
///
/// # Errors
/// Names the file, and what it should have.
pub(super) fn open(path: &Path, pupil_mm: f64, drawn: Option<DrawnEye>) -> Result<LensFile, PipelineError> {
    let wrong = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let statistics = match ending.as_str() {
        "mat" => of_mat(path)?,
        "json" => {
            let text = text::read(path).map_err(|error| wrong(error.to_string()))?;
            serde_json::from_str(&text).map_err(|error| {
                wrong(format!("{error}; expected coefficients_um from piston on and, of many eyes, covariance_um2"))
            })?
        }
        "csv" if drawn.is_none() => {
            let text = text::read(path).map_err(|error| wrong(error.to_string()))?;
            return eye(path, pupil_mm, None, bands_of_table(&text).map_err(wrong)?);
        }
        "csv" => {
            return Err(wrong("it has the coefficients of one eye, expected none drawn, or statistics".to_owned()));
        }
        _ => return Err(wrong("expected coefficients of eyes in a file .mat, .json or .csv".to_owned())),
    };
    let coefficients_um = match drawn {
        None => statistics.coefficients_um,
        Some(drawn) => drawn_from(&statistics, drawn).map_err(wrong)?,
    };
    let wavelength_nm = statistics.wavelength_nm.unwrap_or(WAVELENGTH_NM);
    eye(path, pupil_mm, drawn, vec![WavefrontBand { wavelength_nm, coefficients_um, ..WavefrontBand::default() }])
}

/// Reads the variables of `ISETCam`'s files of Thibos's statistics: `sample_mean`, µm, and the covariance `S`, µm².
fn of_mat(path: &Path) -> Result<Statistics, PipelineError> {
    let wrong = |reason: &str| PipelineError::Read { path: path.to_owned(), reason: reason.to_owned() };
    let matrices = read_mat_matrices(path, &["sample_mean", "S"])?;
    let of = |name: &str| matrices.iter().find(|(own, _)| own == name).map(|(_, matrix)| matrix);
    let Some(mean) = of("sample_mean").filter(|mean| mean.ncols() == 1 || mean.nrows() == 1) else {
        return Err(wrong("it has no list 'sample_mean', expected statistics of eyes as ISETCam's IASstats30.mat"));
    };
    let covariance_um2 = of("S").map_or_else(Vec::new, |s| s.rows().into_iter().map(|row| row.to_vec()).collect());
    Ok(Statistics { coefficients_um: mean.iter().copied().collect(), covariance_um2, wavelength_nm: None })
}

/// Returns the bands of a table with the columns `j`, `um` and, where there are several, `wavelength_nm`, `x_deg` and `y_deg`.
fn bands_of_table(text: &str) -> Result<Vec<WavefrontBand>, String> {
    let text = text::with_commas(text);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let mut bands: BTreeMap<[u64; 3], WavefrontBand> = BTreeMap::new();
    for row in reader.deserialize() {
        let row: Row = row.map_err(|error| {
            format!("{error}; expected the columns j and um and, where there are several, wavelength_nm, x_deg, y_deg")
        })?;
        let wavelength_nm = row.wavelength_nm.unwrap_or(WAVELENGTH_NM);
        let field_deg = [row.x_deg.unwrap_or(0.0), row.y_deg.unwrap_or(0.0)];
        // Wavelengths above 0 ascend as their bits do; fields only have to be told apart.
        let key = [wavelength_nm, field_deg[0] + 0.0, field_deg[1] + 0.0].map(f64::to_bits);
        let band = bands.entry(key).or_insert(WavefrontBand { wavelength_nm, field_deg, coefficients_um: vec![] });
        if !row.um.is_finite() {
            return Err(format!("um of j {} is {}, expected finite numbers", row.j, row.um));
        }
        if row.j >= MOST_TERMS {
            return Err(format!("j is {}, expected 0 to {}", row.j, MOST_TERMS - 1));
        }
        if band.coefficients_um.len() <= row.j {
            band.coefficients_um.resize(row.j + 1, f64::NAN);
        }
        if !band.coefficients_um[row.j].is_nan() {
            return Err(format!("j {} is there twice at {wavelength_nm} nm and one field", row.j));
        }
        band.coefficients_um[row.j] = row.um;
    }
    let mut bands: Vec<WavefrontBand> = bands.into_values().collect();
    // What is left out is 0.
    let all = bands.iter_mut().flat_map(|band| &mut band.coefficients_um);
    all.filter(|um| um.is_nan()).for_each(|um| *um = 0.0);
    if bands.is_empty() { Err("it has no coefficients".to_owned()) } else { Ok(bands) }
}

/// Returns the coefficients of an eye that is drawn from statistics.
fn drawn_from(statistics: &Statistics, drawn: DrawnEye) -> Result<Vec<f64>, String> {
    let Statistics { coefficients_um, covariance_um2, .. } = statistics;
    let n = coefficients_um.len();
    if covariance_um2.len() != n || covariance_um2.iter().any(|row| row.len() != n) {
        let sides = format!("{} × {}", covariance_um2.len(), covariance_um2.first().map_or(0, Vec::len));
        return Err(format!("its covariance is {sides}, expected {n} × {n} as its mean has {n} coefficients"));
    }
    let root = root_of(covariance_um2)?;
    let mut random = ChaCha8Rng::seed_from_u64(drawn.seed);
    random.set_stream(drawn.number);
    // Pairs of normal numbers (Box and Muller 1958, Annals of Mathematical Statistics 29, 610).
    let normal: Vec<f64> = (0..n.div_ceil(2))
        .flat_map(|_| {
            let (u, v): (f64, f64) = (random.random(), random.random());
            let (sine, cosine) = (std::f64::consts::TAU * v).sin_cos();
            [cosine, sine].map(|part| (-2.0 * (1.0 - u).ln()).sqrt() * part)
        })
        .collect();
    let row = |i: usize| (0..=i).map(|k| root[(i, k)] * normal[k]).sum::<f64>();
    Ok(coefficients_um.iter().enumerate().map(|(i, mean)| mean + row(i)).collect())
}

/// Returns the lower triangular L with L Lᵀ a covariance (Cholesky), whose columns are 0 where it is singular.
fn root_of(covariance: &[Vec<f64>]) -> Result<Array2<f64>, String> {
    let n = covariance.len();
    let largest = (0..n).map(|i| covariance[i][i]).fold(0.0, f64::max);
    let rounding = ROUNDING * largest;
    let none = || "its covariance is none: expected a symmetric matrix without negative variances".to_owned();
    if covariance.iter().flatten().any(|number| !number.is_finite()) {
        return Err(none());
    }
    let mut root = Array2::zeros((n, n));
    for j in 0..n {
        let left =
            |root: &Array2<f64>, i: usize| covariance[i][j] - (0..j).map(|k| root[(i, k)] * root[(j, k)]).sum::<f64>();
        let variance = left(&root, j);
        if variance < -rounding || (0..j).any(|i| (covariance[i][j] - covariance[j][i]).abs() > rounding) {
            return Err(none());
        }
        let deviation = if variance > rounding { variance.sqrt() } else { 0.0 };
        for i in j..n {
            let covered = left(&root, i);
            if deviation == 0.0 && covered.abs() > (rounding * largest).sqrt() {
                return Err(none());
            }
            root[(i, j)] = if deviation > 0.0 { covered / deviation } else { 0.0 };
        }
    }
    Ok(root)
}

/// Returns the eye with these coefficients, as who looks into it has them: mirrored, it looks out of itself.
fn eye(
    path: &Path,
    pupil_mm: f64,
    drawn: Option<DrawnEye>,
    mut bands: Vec<WavefrontBand>,
) -> Result<LensFile, PipelineError> {
    for band in &mut bands {
        for (i, um) in band.coefficients_um.iter_mut().enumerate() {
            let (_, m) = zernike::osa_degrees(i);
            // cos mθ turns into (−1)^m of itself where x changes its sign, sin mθ into the opposite.
            if (m % 2 == 0) != (m >= 0) {
                *um = 0.0 - *um;
            }
        }
        band.field_deg[0] = 0.0 - band.field_deg[0];
    }
    let which = match drawn {
        None => String::new(),
        Some(DrawnEye { number, seed: 0 }) => format!(", number {number}"),
        Some(DrawnEye { number, seed }) => format!(", number {number} of seed {seed}"),
    };
    let name =
        format!("eye of {}{which}, pupil of {pupil_mm} mm", path.file_name().unwrap_or_default().to_string_lossy());
    let surface = |shape: Shape, semi_aperture_mm: f64| Interface {
        surface: Surface { curvature_per_mm: 0.0, shape, semi_aperture_mm },
        medium_after: Glass::Air,
        thickness_after_mm: 0.0,
    };
    let radius_mm = 0.5 * pupil_mm;
    let ideal = surface(Shape::ThinLens { power_per_mm: 1.0 / RETINA_MM }, RETINA_MM.max(pupil_mm));
    // Behind the lens, which turns no slope of the error then.
    let lens = Lens::new(name, path.display().to_string(), vec![ideal, surface(Shape::Sphere, radius_mm)], 1)?;
    let chromatic_eye_nm =
        Some(bands[0].wavelength_nm).filter(|_| bands.iter().all(|b| b.wavelength_nm == bands[0].wavelength_nm));
    let error =
        WavefrontError { radius_mm, terms: ZernikeTerms::Osa, bands, turned_about_axis: false, chromatic_eye_nm };
    let profile = PhaseProfile::Wavefront(error);
    let lens = lens.with_diffractive(vec![DiffractiveSurface { surface: 1, order: 1, profile, blaze: None }])?;
    Ok(LensFile { film_distance_mm: Some(RETINA_MM), ..LensFile::from(lens) })
}
