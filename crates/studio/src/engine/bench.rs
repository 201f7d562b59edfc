//! The benches: the analysis of the lens, the photon transfer of the sensor, the sharpness of an edge.

use std::sync::Arc;

use dioptric_analysis::{
    AnalysisFields, AnalysisFilm, AnalysisRequest, LensAnalysis, LensModulation,
    measure::{BenchRequest, NoiseData, measure_bench},
};
use dioptric_pipeline::{PipelineError, ResolvedLens, SensorSpec};
use dioptric_sensor::EdgeResponse;
use ndarray::s;

use super::Product;

/// The F, d and C lines, nm.
const LINES_NM: [f64; 3] = [486.1, 587.6, 656.3];
/// Rings of rays of a spot.
const RINGS: usize = 6;
/// Rows and columns of the simulated bench: enough for a line of a few hundredths.
const SIDE: usize = 128;
/// Levels of light on it.
const LEVELS: usize = 20;

/// A lens to be analyzed where it stands before the film.
#[derive(Clone, Debug)]
pub struct LensQuestion {
    lens: Arc<ResolvedLens>,
    film_distance_mm: f64,
    distance_mm: f64,
    corner_tan: f64,
}

/// The analysis of a lens.
#[derive(Clone, Debug)]
pub struct LensAnswer {
    /// Spots, fans, field curvature and the like.
    pub analysis: LensAnalysis,
    /// The modulation that it leaves; none where it cannot be computed.
    pub modulation: Option<LensModulation>,
}

impl LensQuestion {
    /// Returns the lens of a picture, at its focus, over its field.
    pub fn of(product: &Product) -> Self {
        let (lens, place) = (product.capture.lens.clone(), &product.capture.place);
        let half_mm = product.film_corner_mm();
        let by_scale = || half_mm / lens.reference.film_scale_mm(place.film_distance_mm).abs();
        let corner_tan = product.field_at_radius(half_mm).unwrap_or_else(by_scale);
        let distance_mm = place.focus_distance_mm.unwrap_or(f64::INFINITY);
        Self { film_distance_mm: place.film_distance_mm, distance_mm, corner_tan, lens }
    }

    /// Analyzes the lens.
    ///
    /// # Errors
    /// When a glass is not known at one of the lines F, d and C, or no light gets through.
    pub fn answer(&self) -> Result<LensAnswer, PipelineError> {
        let corner_deg = self.corner_tan.atan().to_degrees();
        let request = AnalysisRequest {
            fields: AnalysisFields::above_axis_deg(&[0.0, 0.7, 1.0].map(|share| share * corner_deg)),
            wavelengths_nm: LINES_NM.to_vec(),
            main_wavelength_nm: Some(LINES_NM[1]),
            wavelength_weights: Vec::new(),
            field_weights: Vec::new(),
            distance_mm: self.distance_mm,
            film: AnalysisFilm::FilmMm(self.film_distance_mm),
            n_rings: RINGS,
        };
        let analysis = request.compute(&self.lens.lens)?;
        let modulation = analysis.modulation(&self.lens.lens).ok();
        Ok(LensAnswer { analysis, modulation })
    }
}

/// Returns what a simulated bench measures of a sensor, on few frames, so that it is there at once.
///
/// # Errors
/// When the sensor cannot be read.
pub fn sensor_answer(sensor: &SensorSpec) -> Result<NoiseData, PipelineError> {
    let request = BenchRequest {
        sensor: sensor.open()?,
        filter: None,
        side: Some(SIDE),
        n_levels: Some(LEVELS),
        n_stacked: Some(4),
        wavelength_nm: None,
        time_s: None,
        analog_gain: None,
        binning: None,
        temperature_c: None,
        seed: 1,
    };
    measure_bench(&request, None)
}

impl Product {
    /// Returns the response of the slanted edge in a rectangle of the picture, stated as shares from corner to corner: that of its
    /// green light, the tone curve of sRGB undone.
    ///
    /// # Errors
    /// A sentence on what the rectangle lacks.
    pub fn edge(&self, [from, to]: [[f64; 2]; 2]) -> Result<EdgeResponse, String> {
        let [columns, rows] = self.size();
        let index = |share: f64, n: usize| (share.clamp(0.0, 1.0) * n as f64).round() as usize;
        let range = |a: f64, b: f64, n: usize| index(a.min(b), n)..index(a.max(b), n);
        let (across, down) = (range(from[0], to[0], columns), range(from[1], to[1], rows));
        let linear = |code: u8| {
            let v = f32::from(code) / 255.0;
            if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let light = ndarray::Array2::from_shape_fn((down.len(), across.len()), |(row, column)| {
            linear(self.rgb8[3 * ((down.start + row) * columns + across.start + column) + 1])
        });
        EdgeResponse::measure(&light.slice(s![.., ..])).map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use dioptric_pipeline::{KeptCamera, Silent};
    use dioptric_spectrum::Cancel;

    use super::*;
    use crate::{engine::Rung, session::presets};

    #[test]
    fn benches_measure_the_edge_preset() {
        let camera = presets().iter().find(|preset| preset.name == "Slanted edge").unwrap().camera().unwrap();
        let kept = KeptCamera::new(camera.clone()).with_quality(dioptric_pipeline::Quality::Preview);
        let product = Product::make(&kept, &camera, Rung::Preview, &Silent, &Cancel::new()).unwrap();
        // Across the edge, in the middle.
        let edge = product.edge([[0.35, 0.3], [0.65, 0.7]]).unwrap();
        assert!((edge.slant_deg - 5.0).abs() < 0.3, "{}", edge.slant_deg);
        let mtf50 = edge.mtf50().unwrap();
        assert!(mtf50 > 0.05 && mtf50 < 0.6, "{mtf50}");
        let nothing = product.edge([[0.0, 0.0], [0.1, 0.1]]).unwrap_err();
        assert!(!nothing.is_empty());

        let answer = LensQuestion::of(&product).answer().unwrap();
        // Three fields at three wavelengths.
        assert_eq!((answer.analysis.spots.len(), answer.analysis.fans.len()), (9, 9));
        let modulation = answer.modulation.unwrap();
        let first = modulation.over_frequency.series[0].points[0];
        assert!((first.1 - 1.0).abs() < 0.02, "{first:?}");

        let noise = sensor_answer(&product.camera().sensor).unwrap();
        let sheet = noise.data_sheet.unwrap();
        // From 20 pairs of frames of 128 × 128 pixels the gain has a standard error of a percent or two.
        assert!((noise.gain_dn_per_e / sheet.gain_dn_per_e - 1.0).abs() < 0.06);
    }
}
