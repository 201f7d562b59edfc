//! A picture viewed as on a given display.

use std::path::Path;

use dioptric_scene::{DisplayModel, ExrSamples, Scene, read_iset_display, write_scene_exr};
use dioptric_spectrum::{Observer, WavelengthGrid, Xyz};
use serde::Serialize;

use crate::PipelineError;

/// The bands of a display's light where nothing else is asked for, nm: first, last and step.
const USUAL_BANDS_NM: (f64, f64, f64) = (400.0, 700.0, 10.0);

/// Returns the display of a name, of a RON file, which may state another name, or of a MATLAB file of `ISETCam`; and what of that is not used,
/// a sentence each.
///
/// # Errors
/// When there is none of that name, or the file cannot be read or its numbers make no sense.
pub fn open_display(text: &str) -> Result<(DisplayModel, Vec<String>), PipelineError> {
    let path = Path::new(text);
    if path.extension().is_none() && !path.exists() {
        return Ok((DisplayModel::built_in(text)?, vec![]));
    }
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mat")) {
        return Ok(read_iset_display(path)?);
    }
    let read = dioptric_files::text::read(path)
        .map_err(|e| PipelineError::Read { path: path.to_owned(), reason: e.to_string() })?;
    let display: DisplayModel =
        dioptric_files::ron::from_text(&read).map_err(|error| PipelineError::syntax(path, error))?;
    display.check()?;
    Ok((display, vec![]))
}

/// How a picture is viewed.
#[derive(Clone, Debug, PartialEq)]
pub struct ShowRequest {
    /// The display.
    pub display: DisplayModel,
    /// How far away it is, m.
    pub distance_m: f64,
    /// The bands of its light, nm; none for 400 to 700 by 10.
    pub wavelengths_nm: Option<Vec<f64>>,
}

/// What a picture on a display is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShownPicture {
    /// The display.
    pub display: String,
    /// Where its numbers come from.
    pub source: String,
    /// The luminance of its white, cd/m².
    pub white_cd_m2: f64,
    /// CIE 1931 x, y of red, green, blue and white, by the display's own spectra.
    pub chromaticities: [[f64; 2]; 4],
    /// The largest tristimulus value by which a primary in the bands is off, a share of the luminance of white.
    pub band_error: f64,
    /// Pixels a degree.
    pub pixels_per_degree: f64,
    /// Columns and rows of samples.
    pub samples: (usize, usize),
    /// The horizontal angle that the picture is seen under, degrees.
    pub field_of_view_deg: f64,
    /// Mean luminance, cd/m².
    pub mean_luminance_cd_m2: f64,
    /// The bands, nm.
    pub wavelengths_nm: Vec<f64>,
}

impl ShowRequest {
    fn grid(&self) -> Result<WavelengthGrid, PipelineError> {
        let (first, last, step) = USUAL_BANDS_NM;
        Ok(match &self.wavelengths_nm {
            Some(centers_nm) => WavelengthGrid::new(centers_nm.clone())?,
            None => WavelengthGrid::uniform(first, last, step)?,
        })
    }

    /// Returns the scene that a PNG, JPEG or TIFF file is on the display, and its numbers.
    ///
    /// # Errors
    /// When the file is no such picture, the distance is not above 0, or the bands do not tell the primaries apart.
    pub fn show(&self, picture: &Path) -> Result<(Scene, ShownPicture), PipelineError> {
        let grid = self.grid()?;
        let scene = self.display.show_file(picture, &grid, self.distance_m)?;
        let white = self.display.white_xyz();
        let [r, g, b] = self.display.primaries_xyz();
        let on = self.display.primaries_on(&grid)?;
        let off = |(values, wanted): (&Vec<f64>, &Xyz)| {
            let found = Observer::Cie1931.xyz(&grid, values);
            (0..3).map(|i| (found.0[i] - wanted.0[i]).abs()).fold(0.0, f64::max)
        };
        let view = scene.require_view()?;
        let shown = ShownPicture {
            display: self.display.name.clone(),
            source: self.display.source.clone(),
            white_cd_m2: white.0[1],
            chromaticities: [r, g, b, white].map(|xyz| xyz.chromaticity()),
            band_error: on.iter().zip(&[r, g, b]).map(off).fold(0.0, f64::max) / white.0[1],
            pixels_per_degree: self.display.pixels_per_degree(self.distance_m),
            samples: (scene.columns(), scene.rows()),
            field_of_view_deg: view.horizontal_fov_deg(scene.columns()),
            mean_luminance_cd_m2: scene.mean_luminance_cd_m2(),
            wavelengths_nm: grid.centers_nm().to_vec(),
        };
        Ok((scene, shown))
    }

    /// Writes the scene of a picture as spectral EXR with depth and view, and returns its numbers.
    ///
    /// # Errors
    /// As [`show`](Self::show), and when the file cannot be written; then there is none.
    pub fn write(&self, picture: &Path, output: &Path) -> Result<ShownPicture, PipelineError> {
        let (scene, shown) = self.show(picture)?;
        write_scene_exr(output, &scene, ExrSamples::Single)?;
        Ok(shown)
    }
}
