//! What the imaging of a scene is planned for, and who takes it.

use dioptric_spectrum::WavelengthGrid;
use ndarray::Array2;

use crate::{Film, Settings, SinkError};

/// What a plan is made for, beside the scene's geometry and the lens.
#[derive(Clone, Debug, PartialEq)]
pub struct ImagingSpec {
    /// The film.
    pub film: Film,
    /// The bands.
    pub grid: WavelengthGrid,
    /// How finely the picture is made.
    pub settings: Settings,
}

/// Takes the bands of a picture, one after the other, shortest wavelength first.
pub type Sink<'a> = dyn FnMut(usize, Array2<f32>) -> Result<(), SinkError> + 'a;
