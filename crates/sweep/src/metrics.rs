//! The numbers of a report that items are compared by.

use serde::{Deserialize, Serialize};

/// Names and numbers, in the order of a report.
pub type Metrics = Vec<(String, f64)>;

/// The part of `report.json` that is read.
#[derive(Deserialize, Serialize)]
struct Report {
    lens: Lens,
    film_mm: f64,
    scene: Scene,
    irradiance: Irradiance,
    sensor: Sensor,
    losses: Vec<Loss>,
    color_matrix_mean_delta_e: Option<f64>,
}

#[derive(Deserialize, Serialize)]
struct Lens {
    efl_mm: Option<f64>,
    f_number: Option<f64>,
    working_f_number: Option<f64>,
    image_distance_mm: Option<f64>,
    magnification: Option<f64>,
}

#[derive(Deserialize, Serialize)]
struct Scene {
    near_m: Option<f64>,
    far_m: Option<f64>,
    mean_luminance_cd_m2: Option<f64>,
}

#[derive(Deserialize, Serialize)]
struct Irradiance {
    mean_lux: Option<f64>,
}

#[derive(Deserialize, Serialize)]
struct Sensor {
    exposure_time_s: Option<f64>,
    analog_gain: Option<f64>,
    saturated_fraction: Option<f64>,
    read_noise_e: Option<f64>,
    channels: Vec<Channel>,
}

#[derive(Deserialize, Serialize)]
struct Channel {
    filter: String,
    mean_e: Option<f64>,
    max_e: Option<f64>,
    snr_db: Option<f64>,
    mean_raw: Option<f64>,
}

#[derive(Deserialize, Serialize)]
struct Loss {
    reaches_film: Option<f64>,
    vignetting: Option<f64>,
}

/// Returns the part of a `report.json` that metrics are read from, as JSON that [`metrics`] reads as well.
pub(crate) fn part_of_report(json: &[u8]) -> Result<Vec<u8>, serde_json::Error> {
    let mut report: Report = serde_json::from_slice(json)?;
    report.losses.drain(..report.losses.len().saturating_sub(1));
    serde_json::to_vec(&report)
}

/// Returns the metrics of a `report.json`; numbers that are not finite are left out.
pub(crate) fn metrics(json: &[u8]) -> Result<Metrics, serde_json::Error> {
    let report: Report = serde_json::from_slice(json)?;
    let (lens, scene, sensor) = (&report.lens, &report.scene, &report.sensor);
    let corner = report.losses.last();
    let mut all = vec![
        ("exposure_time_s".to_owned(), sensor.exposure_time_s),
        ("analog_gain".to_owned(), sensor.analog_gain),
        ("saturated_fraction".to_owned(), sensor.saturated_fraction),
        ("read_noise_e".to_owned(), sensor.read_noise_e),
    ];
    for channel in &sensor.channels {
        let of = |what: &str| format!("{what}.{}", channel.filter);
        all.extend([
            (of("mean_e"), channel.mean_e),
            (of("max_e"), channel.max_e),
            (of("snr_db"), channel.snr_db),
            (of("mean_raw"), channel.mean_raw),
        ]);
    }
    all.extend([
        ("mean_lux".to_owned(), report.irradiance.mean_lux),
        ("efl_mm".to_owned(), lens.efl_mm),
        ("f_number".to_owned(), lens.f_number),
        ("working_f_number".to_owned(), lens.working_f_number),
        ("image_distance_mm".to_owned(), lens.image_distance_mm),
        ("magnification".to_owned(), lens.magnification),
        ("film_mm".to_owned(), Some(report.film_mm)),
        ("corner_reaches_film".to_owned(), corner.and_then(|loss| loss.reaches_film)),
        ("corner_vignetting".to_owned(), corner.and_then(|loss| loss.vignetting)),
        ("near_m".to_owned(), scene.near_m),
        ("far_m".to_owned(), scene.far_m),
        ("mean_luminance_cd_m2".to_owned(), scene.mean_luminance_cd_m2),
        ("color_matrix_mean_delta_e".to_owned(), report.color_matrix_mean_delta_e),
    ]);
    Ok(all.into_iter().filter_map(|(name, number)| Some((name, number?))).collect())
}
