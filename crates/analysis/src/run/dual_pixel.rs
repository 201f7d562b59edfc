//! What photodiodes that are read one by one tell of the focus.

use dioptric_pipeline::Capture;
use serde::Serialize;

/// Disparities with a larger standard error are not counted, pixels.
pub const MOST_ERROR_PX: f64 = 0.25;

/// Phase detection in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct DualPixelData {
    /// The photodiodes, named by the side of the lens that they see.
    pub photodiodes: Vec<&'static str>,
    /// The f-number of the cone of light on the film.
    pub working_f_number: f64,
    /// How far the centroids of the two halves lie apart on the axis, radii of the pupil; 8/(3π) = .849 without crosstalk.
    pub centroid_separation: f64,
    /// The distance between film and image, µm, for which the halves are a pixel apart, near the focus; none where both see the same.
    pub defocus_um_per_px: Option<f64>,
    /// What block matching found; none of frames that are smaller than a block.
    pub disparity: Option<DisparityData>,
}

/// Disparities of a frame: above 0 for what is nearer than the focus.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DisparityData {
    /// Blocks that were matched.
    pub blocks: usize,
    /// Blocks whose disparity has a standard error of at most `most_error_px`.
    pub known_blocks: usize,
    /// That error, pixels.
    pub most_error_px: f64,
    /// The least, the median and the greatest disparity of these, pixels; 0 where there are none.
    pub least_px: f64,
    /// The median.
    pub median_px: f64,
    /// The greatest.
    pub greatest_px: f64,
}

impl DualPixelData {
    /// Returns the numbers of a capture, or `None` of one of whole pixels.
    pub fn of(capture: &Capture) -> Option<Self> {
        let spec = capture.camera.dual_pixel?;
        let working_f_number = capture.place.working_f_number(&capture.lens);
        let map = capture.frames.exposed.photodiodes.as_ref().and_then(|reads| reads.disparity.as_ref());
        let disparity = map.map(|map| {
            let known = map.known_px(MOST_ERROR_PX);
            let at = |place: usize| known.get(place).copied().unwrap_or(0.0);
            DisparityData {
                blocks: map.disparity_px.len(),
                known_blocks: known.len(),
                most_error_px: MOST_ERROR_PX,
                least_px: at(0),
                median_px: at(known.len() / 2),
                greatest_px: at(known.len().saturating_sub(1)),
            }
        });
        Some(Self {
            photodiodes: spec.photodiodes.names().to_vec(),
            working_f_number,
            centroid_separation: spec.centroid_separation(working_f_number),
            defocus_um_per_px: spec.defocus_um_per_px(working_f_number, capture.place.pitch_um),
            disparity,
        })
    }
}
