//! The range of every number that users give, by the key of the camera file or the name of the option.
//!
//! One table, so that a number is refused before any work, with what was expected, wherever it comes from. Ranges are wide: beyond them stands
//! nothing that the physics here describe, or what no machine can hold.

use std::fmt;

/// The range of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The least value.
    pub least: f64,
    /// The greatest value.
    pub most: f64,
    /// Its unit, empty for plain numbers.
    pub unit: &'static str,
    /// Whether infinity is a value too: an object or a focus infinitely far away.
    pub may_be_infinite: bool,
}

impl Range {
    /// Whether a value is in the range.
    pub fn holds(&self, value: f64) -> bool {
        (self.least..=self.most).contains(&value) || (self.may_be_infinite && value == f64::INFINITY)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |value: f64| match value {
            v if v != 0.0 && !(1e-3..1e6).contains(&v.abs()) => format!("{v:e}"),
            v => v.to_string(),
        };
        write!(formatter, "{} to {}", number(self.least), number(self.most))?;
        if !self.unit.is_empty() {
            write!(formatter, " {}", self.unit)?;
        }
        if self.may_be_infinite { formatter.write_str(", or inf") } else { Ok(()) }
    }
}

const fn of(least: f64, most: f64, unit: &'static str) -> Range {
    Range { least, most, unit, may_be_infinite: false }
}

const fn or_infinite(least: f64, most: f64, unit: &'static str) -> Range {
    Range { least, most, unit, may_be_infinite: true }
}

/// Each range with the keys and options that it is of.
const RANGES: &[(Range, &[&str])] = &[
    // The scene.
    (of(1e-3, 179.0, "degrees"), &["field_of_view_deg", "fov_deg"]),
    (of(1e-6, 1e12, "m"), &["depth_m", "distance_m", "near_m", "refocus_m"]),
    (or_infinite(1e-6, 1e12, "m"), &["far_m"]),
    (of(1e-6, 1e9, "mm"), &["width_mm"]),
    (or_infinite(1e-6, 1e12, "mm"), &["distance_mm", "DistanceMm", "focus_mm", "distances_mm"]),
    (of(1e-3, 1e7, "µm"), &["blur_um"]),
    (of(1e-12, 1e12, ""), &["white_level"]),
    (of(1e-30, 1e30, ""), &["scale"]),
    (of(1.0, 65_536.0, "samples"), &["bin"]),
    (of(0.0, 270.0, "degrees"), &["rotate_deg"]),
    (of(1e-6, 1e6, "m"), &["baseline_m"]),
    (of(-1e6, 1e6, "samples"), &["offset_px"]),
    (of(1e-9, 1e9, "lux"), &["illuminance_lux", "mean_lux"]),
    (of(1e-9, 1e9, "cd/m²"), &["mean_luminance_cd_m2", "white_cd_m2"]),
    (of(1e-9, 1e9, "m"), &["unit_m"]),
    (of(-1e9, 1e9, "m"), &["eye_m", "look_at_m", "at_m"]),
    (of(-1e9, 1e9, ""), &["up"]),
    (of(1e-12, 1e12, "W m⁻² sr⁻¹ nm⁻¹"), &["Even"]),
    (of(0.0, 90.0, "degrees"), &["elevation_deg"]),
    (of(-360.0, 360.0, "degrees"), &["azimuth_deg"]),
    (of(1.7, 10.0, ""), &["turbidity"]),
    (of(1e-9, 1e12, "lm"), &["lumens"]),
    (
        of(10.0, 1e6, "nm"),
        &["first_nm", "last_nm", "ListNm", "wavelength_nm", "wavelengths_nm", "scene_wavelengths_nm"],
    ),
    (of(1e-3, 1e6, "nm"), &["step_nm"]),
    // The lens.
    (of(0.05, 1e5, ""), &["f_number", "FNumber"]),
    (of(1e-6, 1e6, "mm"), &["stop_mm", "DiameterMm", "diameter_mm", "focal_length_mm", "pupil_mm"]),
    (of(-1e6, 1e6, "mm"), &["film_mm", "FilmMm", "advance_mm", "aside_mm"]),
    (of(3.0, 64.0, "blades"), &["blades"]),
    (of(-360.0, 360.0, "degrees"), &["blade_rotation_deg", "rotation_deg"]),
    (of(0.0, 1.0, "(0 straight, 1 as the rim)"), &["blade_curvature", "curvature"]),
    (of(-89.0, 89.0, "degrees"), &["tilt_deg", "swing_deg"]),
    (of(-1e4, 1e4, "mm"), &["rise_mm", "shift_mm"]),
    (of(-1.0, 1.0, "per nm"), &["slope_per_nm"]),
    (of(1e-6, 1e6, ""), &["lens_scale"]),
    (of(-180.0, 180.0, "degrees"), &["field_y_deg", "field_deg", "fields_deg"]),
    (of(-1e12, 1e12, "mm"), &["fields_mm"]),
    (of(1.0, 1e6, ""), &["configuration"]),
    (of(0.0, 1e5, "cycles/mm"), &["mtf_per_mm"]),
    (of(0.0, 1e12, ""), &["spectral_weights"]),
    (of(0.0, 1e3, ""), &["gamma"]),
    (of(0.0, 1.0, ""), &["Film", "film_reflectance"]),
    (of(1e-6, 1.0, ""), &["error", "bank_error"]),
    (of(2.0, 400.0, "rings"), &["rings"]),
    (of(1.0, 1e8, "rays"), &["n_rays"]),
    // The film and the sensor.
    (of(1e-3, 1e5, "µm"), &["pixel_um", "pitch_um"]),
    (of(1e-3, 1e5, "mm"), &["film_width_mm", "spacing_mm"]),
    (or_infinite(-1e9, 1e9, "mm"), &["exit_pupil_mm"]),
    (of(0.0, 1e6, "s"), &["exposure_s", "time_s"]),
    (of(1e-3, 1e5, ""), &["analog_gain"]),
    (of(-273.15, 500.0, "°C"), &["temperature_c"]),
    (of(1.0, 64.0, "frames"), &["burst"]),
    (of(0.0, 1000.0, "pixels"), &["burst_motion_px"]),
    (of(-32.0, 32.0, "stops"), &["bracket_stops"]),
    (of(1.0, 1e6, ""), &["interleaved_ratio", "interleaved_gain_ratio"]),
    (of(1.0, 65_536.0, "rows"), &["interleaved_rows"]),
    (of(0.0, 1e9, "µs"), &["row_time_us"]),
    (of(1e-6, 1e6, "per second"), &["frames_per_s", "fps"]),
    (of(1.0, 100_000.0, "frames"), &["frames", "video_frames"]),
    (of(-1e5, 1e5, "degrees per second"), &["pan_deg_per_s", "tilt_deg_per_s", "roll_deg_per_s"]),
    (of(0.0, 90.0, "degrees"), &["shake_deg"]),
    (of(1e-6, 1e5, "Hz"), &["shake_hz"]),
    // The picture.
    (of(0.0, 100.0, ""), &["denoise"]),
    (of(0.0, 2.0, "pixels"), &["sharpen_px"]),
    (of(0.0, 1e6, ""), &["defect_threshold"]),
    // The rendering.
    (of(1e-6, 1e3, ""), &["noise", "Noise"]),
    (of(0.0, 1e7, "s"), &["seconds"]),
    (of(1.0, 16_777_216.0, "samples"), &["samples"]),
    (of(0.0, 1e6, "scatterings"), &["bounces"]),
    // Measurements.
    (of(1e-3, 1e5, ""), &["pixels_per_degree"]),
    (of(0.0, 1e6, ""), &["background"]),
    (of(3.0, 65_535.0, "pixels"), &["window"]),
    (of(2.0, 4001.0, "rays"), &["rays"]),
    (of(1.0, 8192.0, "pixels"), &["size"]),
    (of(1.0, 1e9, ""), &["items_per_tar", "layers"]),
    (of(2.0, 10_000.0, "levels"), &["levels"]),
    (of(2.0, 10_000.0, "frames"), &["stack"]),
    (of(8.0, 360.0, "cycles"), &["cycles"]),
    (of(0.001, 1.0, "of full modulation"), &["modulation"]),
    (of(0.0, 1000.0, "samples"), &["radius_px"]),
];

/// Returns the range of a key of the camera file or of an option, underscores in place of its hyphens.
pub fn range_of(key: &str) -> Option<&'static Range> {
    RANGES.iter().find(|(_, keys)| keys.contains(&key)).map(|(range, _)| range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_has_one_range() {
        let mut keys: Vec<&str> = RANGES.iter().flat_map(|(_, keys)| keys.iter().copied()).collect();
        let n = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), n);
        assert!(RANGES.iter().all(|(range, _)| range.least < range.most));
    }

    #[test]
    fn ranges_are_said_as_people_read_them() {
        assert_eq!(range_of("fov_deg").unwrap().to_string(), "0.001 to 179 degrees");
        assert_eq!(range_of("focus_mm").unwrap().to_string(), "1e-6 to 1e12 mm, or inf");
        let focus = range_of("focus_mm").unwrap();
        assert!(focus.holds(f64::INFINITY) && !focus.holds(f64::NAN) && !focus.holds(0.0));
        assert!(!range_of("fov_deg").unwrap().holds(f64::INFINITY));
    }
}
