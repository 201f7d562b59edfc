//! Point spread functions, against a coherent sum over a grid of 64 × 64.
//!
//! The reference gives every part of the unvignetted pupil (of the entrance pupil, or of the real stop) one amplitude, and
//! cuts the rim in squares; its own README trusts it to 1 % at best, and only where the wavefront on the axis is below half a
//! wave, which leaves out three lenses and the asphere off its axis.
//!
//! Its 32 squares along the radius follow phases of 32 π = 100 radians; where there are more, neighboring squares are out of
//! step and the row is not the point spread function. Of 38 rows 20 have fewer, and agree. Eight have up to 160 and
//! still agree within 5 %; ten have more, up to 1,800, and are off by .08 to .99 of their light.
//! All 18 are held to two things: the same squares with our rays give the row, so it is the squares that are wrong; and
//! squares as fine as the phases need give our sum.

use std::f64::consts::TAU;

use dioptric_diffraction::{
    Propagation, PupilGrid, PupilSamples, ReferenceSphere, WaveQuality, WaveWindow, WindowCenter, wave_psf,
};
use dioptric_optics::{
    MonoLens, ObjectPoint, RayBatch, Vignetting, glam::DVec2, quadrature::gauss_legendre_on, rays_towards,
};
use serde_json::Value;

use crate::{
    lens::Reference,
    reader::{NAMES, json, number, numbers},
};

/// Phase over the pupil's radius up to which the reference's 32 squares along it can be trusted: half a wave a square.
const TRUSTED_BANDWIDTH: f64 = 100.0;
/// That up to which it is still found to be right, since the outermost squares are few.
const USEFUL_BANDWIDTH: f64 = 160.0;
/// Squares along the pupil's diameter in the reference.
const SQUARES: usize = 64;

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

    fn extent_mm(&self) -> f64 {
        self.pitch_mm * self.n as f64 / 2f64.sqrt()
    }

    /// Every eighth value along each side, and where it is, from the middle.
    fn some(&self) -> (Vec<f64>, Vec<DVec2>) {
        let from_middle = |i: usize| (i as f64 - 0.5 * (self.n as f64 - 1.0)) * self.pitch_mm;
        let places = (0..self.n * self.n).map(|k| (k / self.n, k % self.n)).filter(|(r, c)| r % 8 == 0 && c % 8 == 0);
        let place =
            |(row, column)| (self.values[row * self.n + column], DVec2::new(from_middle(column), from_middle(row)));
        places.map(place).unzip()
    }

    /// Compares irradiances over those of a perfect lens, rows ascending with y: within 5 % in L1, and 2 %
    /// of what the tools say of the peak: they differ by up to 4 % among themselves.
    #[track_caller]
    fn check<'a>(&self, found: impl IntoIterator<Item = &'a f64>, what: &str) {
        let found: Vec<f64> = found.into_iter().copied().collect();
        let peak = found.iter().copied().fold(0.0, f64::max);
        let error = l1(&found, &self.values);
        let (least, most) = self.peaks;
        println!("{what}: L1 {error:.4}, peak {peak:.4} where the tools have {least:.4} to {most:.4}");
        assert!(error <= 0.05, "{what}: L1 {error}");
        assert!((0.98 * least..1.02 * most).contains(&peak), "{what}: peak {peak}, expected {least} to {most}");
    }
}

fn l1(found: &[f64], expected: &[f64]) -> f64 {
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).sum::<f64>() / expected.iter().sum::<f64>()
}

/// One row of a lens: its point, its film, and the reference's sphere about the image of the chief ray.
struct Case<'a> {
    reference: &'a Reference,
    lens: MonoLens,
    point: ObjectPoint,
    film_distance_mm: f64,
    sphere: ReferenceSphere,
}

impl<'a> Case<'a> {
    fn new(reference: &'a Reference, row: &Value, film_distance_mm: f64) -> Self {
        let (lens, point) = (reference.at(row), reference.point(row));
        let chief = on_film(reference, (&lens, &point), &[reference.target_mm(&point, DVec2::ZERO)], film_distance_mm);
        let sphere = ReferenceSphere::through_exit_pupil(&lens, chief.point_mm(0));
        Self { reference, lens, point, film_distance_mm, sphere }
    }

    fn chief_mm(&self) -> DVec2 {
        self.sphere.center_mm.truncate()
    }

    /// Returns nodes as the reference has them: one amplitude for all of the pupil, given shares of it at some places.
    fn even_nodes(&self, places: &[(DVec2, f64)], grid: PupilGrid) -> PupilSamples {
        let targets: Vec<DVec2> = self.reference.targets_mm(&self.point, places.iter().map(|(place, _)| *place));
        let rays = on_film(self.reference, (&self.lens, &self.point), &targets, self.film_distance_mm);
        assert_eq!(rays.n_in_flight(), rays.len());
        let q = |i: usize| rays.point_mm(i).truncate() - self.chief_mm();
        let share: Vec<f64> = places.iter().map(|(_, share)| *share).collect();
        PupilSamples {
            wavelength_nm: self.lens.wavelength_nm(),
            image_index: self.lens.image_index(),
            grid,
            propagation: Propagation::Fresnel,
            reference_mm: self.chief_mm(),
            collected: 1.0,
            q_x_mm: (0..rays.len()).map(|i| q(i).x).collect(),
            q_y_mm: (0..rays.len()).map(|i| q(i).y).collect(),
            phi_mm: self.sphere.paths_mm(&self.lens, &rays),
            d_x: rays.l.clone(),
            d_y: rays.m.clone(),
            amplitude_per_mm: share.clone(),
            energy: share,
        }
    }

    fn polar(&self, grid: PupilGrid) -> PupilSamples {
        let radii = gauss_legendre_on(grid.n_radii, 0.0, 1.0);
        let azimuth = |i: usize| DVec2::from_angle(TAU * i as f64 / grid.n_azimuths as f64);
        let place = |i: usize| radii.iter().map(move |(t, w)| (azimuth(i) * *t, 2.0 * t * w / grid.n_azimuths as f64));
        self.even_nodes(&(0..grid.n_azimuths).flat_map(place).collect::<Vec<_>>(), grid)
    }

    /// The irradiance over that of a perfect lens by squares of which the middle is in the pupil, `n` along its diameter.
    fn by_squares(&self, n: usize, places_mm: &[DVec2]) -> Vec<f64> {
        let middle = |i: usize| 2.0 * (i as f64 + 0.5) / n as f64 - 1.0;
        let squares = (0..n * n).map(|k| DVec2::new(middle(k % n), middle(k / n)));
        let inside: Vec<(DVec2, f64)> =
            squares.filter(|place| place.length() <= 1.0).map(|place| (place, 1.0)).collect();
        let nodes = self.even_nodes(&inside, PupilGrid { n_radii: 1, n_azimuths: inside.len() });
        let perfect = nodes.perfect_peak_per_mm2();
        places_mm.iter().map(|place| nodes.irradiance_per_mm2(self.chief_mm() + *place) / perfect).collect()
    }
}

fn on_film(
    reference: &Reference,
    (lens, point): (&MonoLens, &ObjectPoint),
    targets: &[DVec2],
    film_distance_mm: f64,
) -> RayBatch {
    let mut rays = rays_towards(point, targets, reference.pupil_z_mm, 0.0);
    lens.trace(&mut rays, Vignetting::Off);
    lens.to_film(&mut rays, film_distance_mm);
    rays
}

/// The rows of all lenses whose reference can be trusted for its resolution, with the film.
fn trusted_rows() -> Vec<(Reference, f64, Vec<Value>)> {
    let open = |name: &&str| {
        let (reference, file) = (Reference::open(name)?, json(&format!("{name}.psf"))?);
        let film_distance_mm = number(&file["image_z"]) - reference.lens.last_vertex_z_mm();
        let is_trusted = number(&file["on_axis_rms_wavefront_waves"]) < 0.5;
        let is_on_axis = |row: &&Value| numbers(&row["field"]) == [0.0, 0.0];
        let rows = file["rows"].as_array().unwrap().iter().filter(|row| *name != "asphere_al1815c" || is_on_axis(row));
        is_trusted.then(|| (reference, film_distance_mm, rows.cloned().collect()))
    };
    NAMES.iter().filter_map(open).collect()
}

#[dioptric_golden::needs_shared]
#[test]
fn sums_over_the_same_pupil_agree_on_and_off_axis() {
    let (mut n_compared, mut n_too_coarse) = (0, 0);
    for (reference, film_distance_mm, rows) in trusted_rows() {
        for row in &rows {
            let (case, expected) = (Case::new(&reference, row, film_distance_mm), Expected::of(row));
            let range = case.polar(PupilGrid::STANDARD).phase_range(expected.extent_mm());
            let what =
                format!("{} {} {} B {:.0}", reference.lens.name(), row["field"], row["wavelength_nm"], range.total());
            let nodes = case.polar(PupilGrid::needed(range.scaled(1.1)).scaled(1.1));
            let perfect = nodes.perfect_peak_per_mm2();
            if range.total() <= USEFUL_BANDWIDTH {
                let psf = nodes.psf(&expected.window(case.chief_mm()), Some(1)).unwrap();
                expected.check(&(psf.in_film_frame() / (expected.pitch_mm.powi(2) * perfect)), &what);
                n_compared += 1;
            }
            if range.total() <= TRUSTED_BANDWIDTH {
                continue;
            }
            let (values, places) = expected.some();
            let irradiance = |place: &DVec2| nodes.irradiance_per_mm2(case.chief_mm() + *place) / perfect;
            let found: Vec<f64> = places.iter().map(irradiance).collect();
            let finer = (range.total() / TRUSTED_BANDWIDTH).ceil() as usize + 1;
            let (coarse, fine) = (case.by_squares(SQUARES, &places), case.by_squares(finer * SQUARES, &places));
            let [own_squares, ours, fine_squares] = [l1(&coarse, &values), l1(&found, &values), l1(&fine, &found)];
            println!(
                "{what}: the row from its squares {own_squares:.5}, from ours {ours:.4}; fine squares {fine_squares:.4}"
            );
            // The more phases, the more do last digits of the film's place matter to aliased squares.
            assert!(own_squares < 1e-5 * range.total(), "{what}: {own_squares}");
            // The hard edge of squares errs by some parts in a thousand, and more where light is faint.
            assert!(fine_squares < 0.02, "{what}: {fine_squares}");
            assert_eq!(ours < 0.05, range.total() <= USEFUL_BANDWIDTH, "{what}: {ours}");
            n_too_coarse += 1;
        }
    }
    assert_eq!((n_compared, n_too_coarse), (28, 18));
}

#[dioptric_golden::needs_shared]
#[test]
fn psfs_of_the_vignetted_pupil_agree_on_axis() {
    let mut n_compared = 0;
    for (reference, film_distance_mm, rows) in trusted_rows() {
        for row in rows.iter().filter(|row| numbers(&row["field"]) == [0.0, 0.0]) {
            let (mono, point, expected) = (reference.at(row), reference.point(row), Expected::of(row));
            let window = expected.window(DVec2::ZERO);
            let nodes =
                PupilSamples::trace(&mono, &point, film_distance_mm, PupilGrid::STANDARD, Some(DVec2::ZERO)).unwrap();
            let extent_mm = expected.extent_mm();
            if nodes.phase_range(extent_mm).total() > TRUSTED_BANDWIDTH {
                continue;
            }
            let points = WaveQuality { points_per_pixel: Some(1), ..WaveQuality::default() };
            let psf = wave_psf(&mono, &point, film_distance_mm, &window, points).unwrap();
            let found = psf.in_film_frame() / (expected.pitch_mm.powi(2) * nodes.perfect_peak_per_mm2());
            expected.check(&found, &format!("{} {}", reference.lens.name(), row["wavelength_nm"]));
            n_compared += 1;
        }
    }
    assert!(n_compared >= 12, "only {n_compared} rows were compared");
}
