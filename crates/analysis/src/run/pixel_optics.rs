//! What the optics of pixels let through, in the middle of a frame and in its corners.

use dioptric_pipeline::{Frames, PipelineError};
use dioptric_sensor::{AngularResponse, ExitPupil, PixelLight, Sensor, SensorError};
use serde::Serialize;

/// What the optics of the pixels of a frame let through.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PixelOpticsData {
    /// The pitch of the pixels that it is worked out for, µm: on a film of other pixels than the data sheet's the stack is as much larger.
    pub pixel_pitch_um: f64,
    /// The side of their photodiodes, µm.
    pub photodiode_um: f64,
    /// The f-number of the cone of light on the axis; none for collimated light.
    pub f_number: Option<f64>,
    /// The share of collimated light along the axis on a pixel's opening that reaches its photodiode: what factors are counted from.
    pub axial_share: f64,
    /// In the middle of the frame.
    pub middle: PixelPlace,
    /// In the corner that gets least.
    pub corner: PixelPlace,
}

/// What the optics of a pixel let through.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PixelPlace {
    /// The angle of the chief ray, degrees from the axis.
    pub chief_ray_deg: f64,
    /// The shift of the microlens, µm to the right and down.
    pub microlens_shift_um: [f64; 2],
    /// The share of the light on the pixel's opening that reaches its photodiode.
    pub share: f64,
    /// The factor on the electrons of collimated light along the axis.
    pub factor: f64,
}

impl PixelOpticsData {
    /// Returns what the pixels of a frame let through, or `None` of a sensor that states no stack.
    ///
    /// # Errors
    /// When the sensor or the exit pupil makes no sense.
    pub fn of(frames: &Frames<'_>) -> Result<Option<Self>, PipelineError> {
        let Frames { sensor, exit_pupil, .. } = frames;
        let response = sensor.angular_response(*exit_pupil)?;
        let (Some(stack), Some(middle)) = (&sensor.pixel_stack, response.light_at_mm([0.0; 2])) else {
            return Ok(None);
        };
        let f_number = exit_pupil.map(|pupil| pupil.f_number).filter(|n| n.is_finite());
        let (middle, corner) = (place(middle), place(darkest_corner(sensor, &response).unwrap_or(middle)));
        Ok(Some(Self {
            pixel_pitch_um: sensor.pixel_pitch_um,
            photodiode_um: stack.photodiode_um,
            f_number,
            axial_share: middle.share / middle.factor,
            middle,
            corner,
        }))
    }
}

/// Returns the light on the pixel of the corner that gets least.
fn darkest_corner(sensor: &Sensor, response: &AngularResponse<'_>) -> Option<PixelLight> {
    let half_mm = |n_pixels: usize| 0.5e-3 * sensor.pixel_pitch_um * (n_pixels as f64 - 1.0);
    let (right_mm, down_mm) = (half_mm(sensor.columns), half_mm(sensor.rows));
    let corners = [[right_mm, down_mm], [-right_mm, down_mm], [-right_mm, -down_mm], [right_mm, -down_mm]];
    let lights = corners.into_iter().filter_map(|place_mm| response.light_at_mm(place_mm));
    lights.min_by(|a, b| a.factor.total_cmp(&b.factor))
}

fn place(light: PixelLight) -> PixelPlace {
    let PixelLight { chief_ray_deg, microlens_shift_um, share, factor } = light;
    PixelPlace { chief_ray_deg, microlens_shift_um, share, factor }
}

/// Heights from the middle of a sensor to its corner, where none are asked for.
const HEIGHTS: usize = 6;

/// What the optics of a pixel let through at an image height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PixelOpticsRow {
    /// The f-number of the cone of light; none for collimated light.
    pub f_number: Option<f64>,
    /// The image height, mm from the middle of the sensor towards its lower right corner.
    pub height_mm: f64,
    /// The angle of the chief ray, degrees from the axis.
    pub chief_ray_deg: f64,
    /// The shift of the microlens, µm towards the middle.
    pub microlens_shift_um: f64,
    /// The share of the light on the pixel's opening that reaches its photodiode.
    pub share: f64,
    /// The factor on the electrons of collimated light along the axis.
    pub factor: f64,
}

/// Returns what the pixels of a sensor let through of the light of an exit pupil so far before it, mm (infinity for a telecentric lens), by
/// f-number and image height; heights left out go from the middle to the corner.
///
/// # Errors
/// When the sensor states no `pixel_stack`, or a number makes no sense.
pub fn pixel_optics_rows(
    sensor: &Sensor,
    exit_pupil_mm: f64,
    f_numbers: &[f64],
    heights_mm: Option<&[f64]>,
) -> Result<Vec<PixelOpticsRow>, PipelineError> {
    let (width_mm, height_mm) = sensor.size_mm();
    let diagonal_mm = width_mm.hypot(height_mm);
    let to_corner = || (0..HEIGHTS).map(|i| 0.5 * diagonal_mm * i as f64 / (HEIGHTS - 1) as f64).collect();
    let heights_mm = heights_mm.map_or_else(to_corner, <[f64]>::to_vec);
    let toward = [width_mm / diagonal_mm, height_mm / diagonal_mm];
    let mut rows = Vec::new();
    for &f_number in f_numbers {
        let pupil = ExitPupil { f_number, ..ExitPupil::centered(exit_pupil_mm) };
        let response = sensor.angular_response(Some(pupil))?;
        for &height_mm in &heights_mm {
            let light =
                response.light_at_mm(toward.map(|part| part * height_mm)).ok_or_else(|| SensorError::Unsuitable {
                    what: "the optics of pixels",
                    reason: format!("need a pixel_stack, which {} does not state", sensor.name),
                })?;
            let [right_um, down_um] = light.microlens_shift_um;
            rows.push(PixelOpticsRow {
                f_number: Some(f_number).filter(|n| n.is_finite()),
                height_mm,
                chief_ray_deg: light.chief_ray_deg,
                microlens_shift_um: 0.0 - right_um * toward[0] - down_um * toward[1],
                share: light.share,
                factor: light.factor,
            });
        }
    }
    Ok(rows)
}
