//! `dioptric sense`: a sensor exposed to an irradiance image.

use std::fmt::Write;

use dioptric_analysis::{PixelPlace, SensorStatistics};
use dioptric_pipeline::{
    Camera, FrameFile, Outputs, SenseRequest, SensorSpec, Staged, parse_illuminant, with_exposure_s,
};
use dioptric_report::write_sensed;

use crate::{
    args::{Common, SenseArgs},
    lens::tell,
    run::{frames_of, sensor_options},
    terminal::{print, print_json},
};

pub(crate) fn run(arguments: &SenseArgs, common: &Common) -> anyhow::Result<()> {
    let demo = Camera::demo()?;
    let (mut noise, mut exposure, mut processing) = (demo.noise, demo.exposure, demo.processing);
    if let Some(time_s) = arguments.exposure_s {
        exposure = with_exposure_s(exposure, time_s);
    }
    sensor_options(&arguments.frames).apply(&mut noise, &mut exposure, &mut processing)?;
    let request = SenseRequest {
        sensor: SensorSpec::named(&arguments.sensor),
        filters: arguments.frames.filters.clone(),
        pixel_um: arguments.pixel_um,
        exposure,
        frames: frames_of(&arguments.frames)?.unwrap_or(demo.frames),
        processing,
        noise,
        illuminant: arguments.illuminant.as_deref().map(parse_illuminant).transpose()?,
        exit_pupil_mm: arguments.exit_pupil_mm,
        f_number: arguments.f_number,
        seed: common.seed.unwrap_or(demo.seed),
        chip_seed: arguments.frames.chip_seed.unwrap_or(demo.chip_seed),
        outputs: Outputs {
            also: arguments.frames.also.as_deref().map_or(Ok(Vec::new()), FrameFile::parse_list)?,
            exr_samples: arguments.frames.exr_samples.unwrap_or_default(),
            ..Outputs::default()
        },
    };
    let staged = Staged::folder(&arguments.out)?;
    let sensed = request.sense(&arguments.irradiance)?;
    let statistics = write_sensed(&sensed, &request.outputs, staged.path())?;
    staged.commit()?;
    tell(&sensed.notes, common);
    tell(&statistics.notes, common);
    match (common.json, common.quiet) {
        (true, _) => print_json(&statistics),
        (false, true) => Ok(()),
        (false, false) => print(&table(&statistics)?),
    }
}

fn table(statistics: &SensorStatistics) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "{}: {:.4} ms, saturation at {:.0} electrons, {:.3} % saturated\n",
        statistics.sensor,
        1e3 * statistics.exposure_time_s,
        statistics.saturation_e,
        100.0 * statistics.saturated_fraction
    );
    for channel in &statistics.channels {
        writeln!(
            text,
            "{:<8} mean {:>10.1} e  largest {:>10.1} e  SNR {:>6.1} dB  raw mean {:>9.2}",
            channel.filter, channel.mean_e, channel.max_e, channel.snr_db, channel.mean_raw
        )?;
    }
    if let Some(optics) = &statistics.pixel_optics {
        let place = |place: &PixelPlace| format!("{:.4} ({:.2}°)", place.share, place.chief_ray_deg);
        let (middle, corner) = (place(&optics.middle), place(&optics.corner));
        writeln!(text, "pixel optics: share of the light {middle} in the middle, {corner} in the darkest corner")?;
    }
    Ok(text)
}
