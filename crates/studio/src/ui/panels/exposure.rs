//! Exposure and number of frames.

use dioptric_pipeline::{Camera, FramesSpec, with_auto_exposure, with_exposure_s};
use dioptric_sensor::{AutoExposure, Binning, BinningKind, Exposure, ExposureControl, GainMode, Metering};
use egui::Ui;

use super::{
    super::fields::{NumberField, choice, count, numbers, variant},
    Desk,
};
use crate::engine::Field;

pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let metered_s = desk.product.map_or(0.01, |product| product.statistics.exposure_time_s);
    let mut is_auto = matches!(camera.exposure, ExposureControl::Auto(_));
    if choice(ui, "exposure", "How the exposure is chosen", &mut is_auto, &[(true, "metered"), (false, "by hand")]) {
        camera.exposure = match is_auto {
            true => with_auto_exposure(camera.exposure),
            false => with_exposure_s(camera.exposure, three_digits(metered_s)),
        };
    }
    // Typing a time sets it by hand.
    let mut time_s = match camera.exposure {
        ExposureControl::Manual(exposure) => exposure.time_s,
        ExposureControl::Auto(_) => three_digits(metered_s),
    };
    let words = "How long the shutter is open; 0 is a bias frame";
    if NumberField::by_factors("time", "s", 0.0..=1e4, 1e-5..=30.0, words).show(ui, &mut time_s) {
        camera.exposure = with_exposure_s(camera.exposure, time_s);
    }
    if let ExposureControl::Auto(auto) = &mut camera.exposure {
        metering(ui, auto);
    }
    let exposure = match &mut camera.exposure {
        ExposureControl::Manual(exposure) => exposure,
        ExposureControl::Auto(auto) => &mut auto.limit,
    };
    readout(ui, exposure);
    frames(ui, &mut camera.frames);
    desk.tell(ui, Field::Exposure, camera);
}

fn metering(ui: &mut Ui, auto: &mut AutoExposure) {
    let kinds = [
        (Metering::Percentile(99.0), "a percentile"),
        (Metering::EachFilter(99.0), "a percentile of each filter"),
        (Metering::Mean, "the mean"),
        (Metering::CenterWeighted, "the mean, the center counting more"),
        (Metering::Peak, "the brightest pixel"),
    ];
    variant(ui, "metering", "What of the frame is metered", &mut auto.metering, &kinds);
    if let Metering::Percentile(percent) | Metering::EachFilter(percent) = &mut auto.metering {
        let words = "The share of pixels that do not exceed the metered signal";
        NumberField::even("percentile", "%", 0.0..=100.0, 50.0..=100.0, words).show(ui, percent);
    }
    let words = "Where the metered signal is put, as a share of saturation";
    NumberField::even("target", "", 1e-6..=10.0, 0.05..=1.0, words).show(ui, &mut auto.target_fraction);
    let words = "The longest time that is metered; inf for any";
    NumberField::by_factors("longest", "s", 1e-9..=f64::INFINITY, 1e-4..=30.0, words).show(ui, &mut auto.limit.time_s);
}

fn readout(ui: &mut Ui, exposure: &mut Exposure) {
    let words = "Factor on the voltage after the pixel: the ISO speed over that of gain 1";
    NumberField::by_factors("gain", "×", 1e-3..=1e4, 1.0..=64.0, words).show(ui, &mut exposure.analog_gain);
    let modes = [(GainMode::Low, "low"), (GainMode::High, "high")];
    choice(ui, "readout", "Which readout of a pixel of two gains is used", &mut exposure.gain_mode, &modes);
    let binned = |kind| exposure.binning.map_or(Some(Binning { kind, pixels: 2 }), |now| Some(Binning { kind, ..now }));
    let kinds = [
        (None, "none"),
        (binned(BinningKind::Charge), "charges summed"),
        (binned(BinningKind::Voltage), "voltages averaged"),
        (binned(BinningKind::Digital), "numbers summed"),
    ];
    choice(
        ui,
        "binning",
        "Whether pixels of one filter are read as one, and where they meet",
        &mut exposure.binning,
        &kinds,
    );
    if let Some(binning) = &mut exposure.binning {
        count(ui, "pixels as one", "How many pixels each way are read as one", 2..=16, &mut binning.pixels);
    }
    let words = "Temperature of the chip, which its dark current depends on";
    let field = NumberField::even("temperature", "°C", -273.0..=200.0, -40.0..=80.0, words);
    field.show(ui, &mut exposure.temperature_c);
}

fn frames(ui: &mut Ui, frames: &mut FramesSpec) {
    let kinds = [
        (FramesSpec::Single, "one"),
        (FramesSpec::Burst(8), "burst"),
        (FramesSpec::MovingBurst { frames: 8, motion_px: 4.0 }, "burst by hand"),
        (FramesSpec::BracketStops(vec![-4.0, -2.0, 0.0]), "bracket"),
        (FramesSpec::BothGains, "both gains"),
        (FramesSpec::Interleaved { ratio: 8.0, period_rows: 2, gain_ratio: 1.0 }, "interleaved rows"),
    ];
    variant(ui, "frames", "How many frames the picture is made of", frames, &kinds);
    match frames {
        FramesSpec::Single | FramesSpec::BothGains => {}
        FramesSpec::Burst(n) => drop(count(ui, "frames of burst", "Frames that are merged", 1..=64, n)),
        FramesSpec::MovingBurst { frames, motion_px } => {
            count(ui, "frames of burst", "Frames that are aligned and merged", 1..=64, frames);
            let words = "How far the image has moved at the last frame";
            NumberField::even("motion", "px", 0.0..=48.0, 0.0..=16.0, words).show(ui, motion_px);
        }
        FramesSpec::BracketStops(stops) => {
            let words = "Exposures as stops from the chosen one: −2 is a quarter of the time";
            numbers(ui, "stops", words, stops);
        }
        FramesSpec::Interleaved { ratio, period_rows, gain_ratio } => {
            let words = "The time of the long rows over that of the short ones";
            NumberField::by_factors("ratio of times", "×", 1.0..=1e6, 1.0..=64.0, words).show(ui, ratio);
            let words = "The analog gain of the long rows over that of the short ones";
            NumberField::by_factors("ratio of gains", "×", 1.0..=1e6, 1.0..=64.0, words).show(ui, gain_ratio);
            count(ui, "rows of one time", "Neighboring rows that share a time", 1..=64, period_rows);
        }
    }
}

fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}
