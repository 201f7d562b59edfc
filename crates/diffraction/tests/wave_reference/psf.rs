//! Point spread functions, against a coherent sum over a grid of 64 × 64.
//!
//! The reference gives every part of the unvignetted pupil one amplitude, and cuts the rim in squares; its own README
//! trusts it to 1 % at best, and only while the phase turns little from square to square.

use std::f64::consts::TAU;

use dioptric_diffraction::{
    Propagation, PupilGrid, WaveNodes, WaveQuality, WaveWindow, WindowCenter, quadrature::gauss_legendre_on, wave_psf,
};
use dioptric_optics::{MonoLens, ObjectPoint, RayBatch, Rims, glam::DVec2, rays_towards};
use serde_json::Value;

use crate::{
    lens::Reference,
    reader::{NAMES, json, number, numbers},
};

/// Phase over the pupil's radius up to which the reference's 32 squares along it can be trusted: 3 radians a square.
const TRUSTED_BANDWIDTH: f64 = 100.0;

/// One picture of the reference: irradiance over that of a perfect lens.
struct Expected {
    values: Vec<f64>,
    /// The least and the greatest peak that three tools have found.
    peaks: (f64, f64),
    pitch_mm: f64,
    n: usize,
}

impl Expected {
    fn of(row: &Value) -> Self {
        let picture = &row["oracle_novig"];
        let values: Vec<f64> = picture["psf"].as_array().unwrap().iter().flat_map(numbers).collect();
        let own = values.iter().copied().fold(0.0, f64::max);
        let others = [&row["optiland_fft"]["strehl"], &row["optiland_huygens"]["strehl"]];
        let is_on_axis = numbers(&row["field"]) == [0.0, 0.0];
        let others = others.into_iter().filter_map(Value::as_f64).filter(|_| is_on_axis);
        let peaks = others.fold((own, own), |(least, most), peak| (least.min(peak), most.max(peak)));
        Self { peaks, n: (values.len() as f64).sqrt() as usize, values, pitch_mm: number(&picture["pitch_mm"]) }
    }

    fn window(&self, center_mm: DVec2) -> WaveWindow {
        WaveWindow { pitch_um: self.pitch_mm * 1e3, rows: self.n, columns: self.n, center: WindowCenter::At(center_mm) }
    }

    /// Compares irradiances over those of a perfect lens, rows ascending with y: within 5 % in L1, and 2 %
    /// of what the tools say of the peak: they differ by up to 4 % among themselves.
    #[track_caller]
    fn check<'a>(&self, found: impl IntoIterator<Item = &'a f64>, what: &str) {
        let (mut difference, mut peak) = (0.0, 0.0f64);
        for (found, expected) in found.into_iter().zip(&self.values) {
            difference += (found - expected).abs();
            peak = peak.max(*found);
        }
        let error = difference / self.values.iter().sum::<f64>();
        let (least, most) = self.peaks;
        println!("{what}: L1 {error:.4}, peak {peak:.4} where the tools have {least:.4} to {most:.4}");
        assert!(error <= 0.05, "{what}: L1 {error}");
        assert!((0.98 * least..1.02 * most).contains(&peak), "{what}: peak {peak}, expected {least} to {most}");
    }
}

fn on_film(reference: &Reference, mono: &MonoLens, point: &ObjectPoint, targets: &[DVec2], film_mm: f64) -> RayBatch {
    let mut rays = rays_towards(point, targets, reference.pupil_z_mm, 0.0);
    mono.trace(&mut rays, Rims::Ignore);
    mono.to_film(&mut rays, film_mm);
    rays
}

/// Returns nodes as the reference has them: one amplitude for all of the paraxial entrance pupil.
fn even_nodes(reference: &Reference, row: &Value, film_mm: f64, center_mm: DVec2, grid: PupilGrid) -> WaveNodes {
    let (mono, point) = (reference.at(row), reference.point(row));
    let radii = gauss_legendre_on(grid.n_radii, 0.0, 1.0);
    let azimuth = |i: usize| DVec2::from_angle(TAU * i as f64 / grid.n_azimuths as f64);
    let (targets, share): (Vec<DVec2>, Vec<f64>) = (0..grid.n_azimuths)
        .flat_map(|i| radii.iter().map(move |(t, w)| (azimuth(i) * *t, 2.0 * t * w / grid.n_azimuths as f64)))
        .map(|(target, share)| (target * reference.pupil_radius_mm, share))
        .unzip();
    let rays = on_film(reference, &mono, &point, &targets, film_mm);
    assert_eq!(rays.n_in_flight(), rays.len());
    let q = |i: usize| rays.point_mm(i).truncate() - center_mm;
    let phi = |i: usize| rays.opl_mm[i] - q(i).dot(rays.direction(i).truncate());
    WaveNodes {
        wavelength_nm: mono.wavelength_nm(),
        image_index: mono.image_index(),
        grid,
        propagation: Propagation::Debye,
        reference_mm: center_mm,
        collected: 1.0,
        q_x_mm: (0..rays.len()).map(|i| q(i).x).collect(),
        q_y_mm: (0..rays.len()).map(|i| q(i).y).collect(),
        phi_mm: (0..rays.len()).map(phi).collect(),
        d_x: rays.l.clone(),
        d_y: rays.m.clone(),
        amplitude_per_mm: share.clone(),
        energy: share,
    }
}

/// The rows of all lenses whose reference can be trusted for its resolution, with the film.
fn trusted_rows() -> Vec<(Reference, f64, Vec<Value>)> {
    let open = |name: &&str| {
        let (reference, file) = (Reference::open(name)?, json(&format!("{name}.psf"))?);
        let film_mm = number(&file["image_z"]) - reference.lens.last_vertex_z_mm();
        let is_trusted = number(&file["on_axis_rms_wavefront_waves"]) < 0.5;
        is_trusted.then(|| (reference, film_mm, file["rows"].as_array().unwrap().clone()))
    };
    NAMES.iter().filter_map(open).collect()
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs the shared reference data")]
fn sums_over_the_same_pupil_agree_on_and_off_axis() {
    let mut n_compared = 0;
    for (reference, film_mm, rows) in trusted_rows() {
        if reference.file["lens"]["pupil_mode"] != "paraxial_ep" {
            continue;
        }
        for row in &rows {
            let (mono, point, expected) = (reference.at(row), reference.point(row), Expected::of(row));
            let chief = on_film(&reference, &mono, &point, &[DVec2::ZERO], film_mm).point_mm(0).truncate();
            let reach_mm = expected.pitch_mm * expected.n as f64 / 2f64.sqrt();
            let coarse = even_nodes(&reference, row, film_mm, chief, PupilGrid::STANDARD);
            let range = coarse.phase_range(reach_mm);
            if range.total() > TRUSTED_BANDWIDTH {
                continue;
            }
            let nodes = even_nodes(&reference, row, film_mm, chief, PupilGrid::needed(range).scaled(1.1));
            let psf = nodes.psf(&expected.window(chief), Some(1)).unwrap();
            let found = psf.in_film_frame() / (expected.pitch_mm.powi(2) * nodes.perfect_peak_per_mm2());
            let what =
                format!("{} {} {} B {:.0}", reference.lens.name(), row["field"], row["wavelength_nm"], range.total());
            expected.check(&found, &what);
            n_compared += 1;
        }
    }
    assert!(n_compared >= 12, "only {n_compared} rows were compared");
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs the shared reference data")]
fn psfs_of_the_vignetted_pupil_agree_on_axis() {
    let mut n_compared = 0;
    for (reference, film_mm, rows) in trusted_rows() {
        for row in rows.iter().filter(|row| numbers(&row["field"]) == [0.0, 0.0]) {
            let (mono, point, expected) = (reference.at(row), reference.point(row), Expected::of(row));
            let window = expected.window(DVec2::ZERO);
            let nodes = WaveNodes::trace(&mono, &point, film_mm, PupilGrid::STANDARD, Some(DVec2::ZERO)).unwrap();
            let reach_mm = expected.pitch_mm * expected.n as f64 / 2f64.sqrt();
            if nodes.phase_range(reach_mm).total() > TRUSTED_BANDWIDTH {
                continue;
            }
            let points = WaveQuality { points_per_pixel: Some(1), ..WaveQuality::default() };
            let psf = wave_psf(&mono, &point, film_mm, &window, points).unwrap();
            let found = psf.in_film_frame() / (expected.pitch_mm.powi(2) * nodes.perfect_peak_per_mm2());
            expected.check(&found, &format!("{} {}", reference.lens.name(), row["wavelength_nm"]));
            n_compared += 1;
        }
    }
    assert!(n_compared >= 12, "only {n_compared} rows were compared");
}
