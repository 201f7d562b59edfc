//! Compares pupils behind off-axis windows with rays counted one by one, in forty directions, to 110°.
//!
//! `cargo run --release --workspace --example window_scan -- [RAYS_ACROSS] [FIELDS] [LENS …]`: a round window half-way to the rim of the
//! first surface, of the stop or of the last surface, of 30 % of the rim's radius in every other direction and of 5 % in the others; each lens
//! as it is, and with its rear half tilted and decentered. Prints a row for each lens; fields that differ by more than 0.2 % and three
//! standard errors of the count, of four times as many rays across, go to standard error.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "this is a command")]

use std::path::Path;

use dioptric_optics::{
    Aperture, CoordinateBreak, Lens, LensFile, MissingGlass, MonoLens, ObjectPoint, OpticsError, Outline,
    PupilBoundary, PupilRegion, ReadOptions,
    glam::{DVec2, DVec3},
};
use rayon::prelude::*;

#[path = "../tests/counted/mod.rs"]
mod counted;

use counted::{cross_section_mm2, is_any_lit};

const LAST_FIELD_DEG: f64 = 110.0;
const N_DIRECTIONS: usize = 40;
const N_AZIMUTHS: usize = 192;
const MOST_DIFFERENCE: f64 = 2e-3;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, otherwise: usize| words.get(place).and_then(|w| w.parse().ok()).unwrap_or(otherwise);
    let (n_across, n_fields) = (number(0, 300), number(1, 8));
    for name in &words[2..] {
        for is_askew in [false, true] {
            match open(name, is_askew) {
                Ok((lens, wavelength_nm)) => scan(name, &lens, wavelength_nm, (n_across, n_fields)),
                Err(error) => println!("| {name} | refused: {error} |"),
            }
        }
    }
}

/// Returns a lens and its file's own wavelength, or 550 nm; its rear half askew or not.
fn open(name: &str, is_askew: bool) -> Result<(Lens, f64), OpticsError> {
    let (lens, wavelength_nm) = if Path::new(name).exists() {
        let options = ReadOptions { missing_glass: MissingGlass::FromNdVd, ..ReadOptions::default() };
        let file = LensFile::read(Path::new(name), &options)?;
        (file.lens, file.reference_wavelength_nm.unwrap_or(550.0))
    } else {
        (Lens::built_in(name)?, 550.0)
    };
    if !is_askew {
        return Ok((lens, wavelength_nm));
    }
    let (n, radius_mm) = (lens.interfaces().len(), lens.interfaces()[0].surface.semi_aperture_mm);
    let turn = CoordinateBreak {
        surfaces: (n / 2, n - 1),
        pivot_mm: 0.0,
        decenter_mm: [0.01 * radius_mm, 0.02 * radius_mm, 0.0],
        tilt_deg: [1.5, -1.0, 0.0],
        tilt_first: false,
    };
    let moves = lens.moves().iter().cloned().chain([turn]).collect();
    Ok((lens.with_moves(moves)?, wavelength_nm))
}

/// Returns the lens with a window of a share of the rim's radius, half-way to the rim.
fn with_window(lens: &Lens, surface: usize, share: f64, direction: DVec2) -> Result<Lens, OpticsError> {
    let radius_mm = lens.interfaces()[surface].surface.semi_aperture_mm;
    let window = Aperture {
        surface,
        outline: Outline::Circle { radius_mm: share * radius_mm },
        center_mm: (0.5 * radius_mm * direction).to_array(),
        is_obscuration: false,
    };
    let windows = lens.apertures().iter().cloned().chain([window]).collect();
    Lens::new_with_apertures(lens.name(), lens.source(), lens.interfaces().to_vec(), lens.stop(), windows)?
        .with_object_medium(lens.object_medium().clone())?
        .with_moves(lens.moves().to_vec())?
        .with_mirrors(lens.mirrors().to_vec())
}

/// One window and one field: what they are, what is found and what is counted, mm², and the count's standard error over the light.
struct Case {
    what: String,
    found_mm2: f64,
    counted_mm2: f64,
    error: f64,
    has_outline: bool,
}

impl Case {
    fn of(lens: &MonoLens, point: &ObjectPoint, n_across: usize, what: &str) -> Self {
        let cosine = |region: &PupilRegion| point.direction_to(DVec3::ZERO).dot(region.plane().normal());
        let area_mm2 = |lens: &MonoLens| {
            PupilRegion::find(lens, point, N_AZIMUTHS).map_or(0.0, |region| region.area_mm2() * cosine(&region))
        };
        let found_mm2 = lens.over_clear_pupil(&area_mm2);
        let is_counted = found_mm2 > 0.0 || is_any_lit(lens, point);
        let count = |n: usize| if is_counted { cross_section_mm2(lens, point, n) } else { (0.0, 0.0) };
        let of = |(counted_mm2, error_mm2): (f64, f64)| Self {
            what: what.to_owned(),
            found_mm2,
            counted_mm2,
            error: error_mm2 / found_mm2.max(counted_mm2).max(f64::MIN_POSITIVE),
            has_outline: PupilBoundary::find(lens, point, N_AZIMUTHS).is_some(),
        };
        let first = of(count(n_across));
        if first.is_wrong() { of(count(4 * n_across)) } else { first }
    }

    fn is_lit(&self) -> bool {
        self.found_mm2.max(self.counted_mm2) > 0.0
    }

    fn difference(&self) -> f64 {
        (self.found_mm2 - self.counted_mm2) / self.found_mm2.max(self.counted_mm2).max(f64::MIN_POSITIVE)
    }

    fn is_wrong(&self) -> bool {
        (self.found_mm2 > 0.0) != self.has_outline || self.difference().abs() > MOST_DIFFERENCE + 3.0 * self.error
    }
}

fn scan(name: &str, lens: &Lens, wavelength_nm: f64, (n_across, n_fields): (usize, usize)) {
    let name = Path::new(name).file_name().map_or(name, |n| n.to_str().unwrap_or(name));
    let askew = if lens.moves().is_empty() { "" } else { " askew" };
    let last = lens.interfaces().len() - 1;
    let surfaces = if [0, last].contains(&lens.stop()) { [0, last / 2, last] } else { [0, lens.stop(), last] };
    let mut tasks = Vec::new();
    for (number, surface) in surfaces.into_iter().enumerate() {
        for direction in 0..N_DIRECTIONS {
            for field in 0..n_fields {
                // Fields and directions that no symmetry has, others for each direction.
                let part = (0.618_034 * (direction + 17 * number) as f64).fract();
                let field_deg = LAST_FIELD_DEG * (field as f64 + part) / n_fields as f64;
                tasks.push((surface, direction, field_deg, if direction % 2 == number % 2 { 0.3 } else { 0.05 }));
            }
        }
    }
    let case = |&(surface, direction, field_deg, share): &(usize, usize, f64, f64)| {
        let towards = DVec2::from_angle(std::f64::consts::TAU * (direction as f64 + 0.13) / N_DIRECTIONS as f64);
        let lens = with_window(lens, surface, share, towards).and_then(|lens| lens.at(wavelength_nm)).ok()?;
        // Light from the window's side for one half of the fields, and from the other for the rest, for the image is turned.
        let turn = if (direction / 2) % 2 == 0 { 0.2 } else { std::f64::consts::PI + 0.2 };
        let point = ObjectPoint::far(field_deg.to_radians(), DVec2::from_angle(turn).rotate(towards));
        let what = format!("s{surface} r{share} dir {direction} {field_deg:.4} deg");
        Some(Case::of(&lens, &point, n_across, &what))
    };
    let cases: Vec<Case> = tasks.par_iter().filter_map(case).filter(Case::is_lit).collect();
    for case in cases.iter().filter(|case| case.is_wrong()) {
        let Case { what, found_mm2, counted_mm2, error, has_outline } = case;
        let difference = case.difference();
        eprintln!(
            "{name}{askew} {what}: found {found_mm2:.6e} counted {counted_mm2:.6e} mm2, \
             {difference:+.2e} (count {error:.0e}); outline {has_outline}"
        );
    }
    let sure = |case: &&Case| case.error < 1e-3;
    let worst = cases.iter().filter(sure).max_by(|a, b| a.difference().abs().total_cmp(&b.difference().abs()));
    let worst = worst
        .map_or("–".to_owned(), |case| format!("{:+.1e} ± {:.0e} at {}", case.difference(), case.error, case.what));
    let n_wrong = cases.iter().filter(|case| case.is_wrong()).count();
    println!("| {name}{askew} | {} of {} lit | {n_wrong} | {worst} |", cases.len(), tasks.len());
}
