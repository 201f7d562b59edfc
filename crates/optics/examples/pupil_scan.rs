//! Compares pupils, f-numbers and axial spots with rays counted one by one, over all fields of lenses.
//!
//! `cargo run --release --workspace --example pupil_scan -- [STEP_DEG] [RAYS_ACROSS] [LENS …]`: of each lens (built-in names or
//! files; without any, all that are built in) and each far field the cross-section of the light that gets through, by the
//! region of the pupil and by a square grid of rays. Prints the rows of the tables of docs/pupils.md; fields that differ by more
//! than 0.2 % and three standard errors of the count go to standard error.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "this is a command")]

use std::path::Path;

use dioptric_optics::{
    Lens, LensFile, MissingGlass, MonoLens, ObjectPoint, PupilBoundary, PupilRegion, ReadOptions,
    analysis::{Autofocus, PupilLight, PupilRule},
    glam::{DVec2, DVec3},
};
use rayon::prelude::*;

#[path = "../tests/counted/mod.rs"]
mod counted;

use counted::{axial_spot_rms_mm, beam_radius_mm, cross_section_mm2, is_any_lit};

const LAST_FIELD_DEG: f64 = 120.0;
/// Azimuths of boundaries.
const N_AZIMUTHS: usize = 192;
/// Fields are not compared where less than this share of the light on the brightest gets through.
const DARK: f64 = 1e-6;
/// By how much the light of a field may differ from the count, and steps of it from steps of the count, over the light.
const MOST_DIFFERENCE: f64 = 2e-3;
const MOST_STEP: f64 = 1e-2;
/// The rays of an axial spot, as `lens analyze` has them.
const N_RINGS: usize = 12;
/// Rays counted from the axis to the rim of the front.
const N_COUNTED_ON_AXIS: usize = 2_000_000;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, otherwise: f64| words.get(place).and_then(|w| w.parse().ok()).unwrap_or(otherwise);
    let (step_deg, n_across) = (number(0, 0.5), number(1, 1000.0) as usize);
    let mut names: Vec<String> = words.into_iter().skip(2).collect();
    if names.is_empty() {
        names = Lens::built_in_names().map(str::to_owned).collect();
    }
    for name in names {
        match open(&name) {
            Ok(lens) => {
                let name = Path::new(&name).file_name().map_or(name.as_str(), |n| n.to_str().unwrap_or(&name));
                scan(name, &lens, step_deg, n_across);
                compare_axis(name, &lens);
            }
            Err(error) => println!("| {name} | refused: {error} |"),
        }
    }
}

/// Returns a lens at its file's own wavelength, or at 550 nm.
fn open(name: &str) -> Result<MonoLens, dioptric_optics::OpticsError> {
    if !Path::new(name).exists() {
        return Lens::built_in(name)?.at(550.0);
    }
    let options = ReadOptions { missing_glass: MissingGlass::FromNdVd, ..ReadOptions::default() };
    let file = LensFile::read(Path::new(name), &options)?;
    file.lens.at(file.reference_wavelength_nm.unwrap_or(550.0))
}

/// What is found and what is counted of one field, mm².
#[derive(Clone, Copy)]
struct Field {
    degrees: f64,
    found_mm2: f64,
    counted_mm2: f64,
    /// The standard error of the count.
    error_mm2: f64,
    has_lines: bool,
    has_outline: bool,
}

impl Field {
    fn of(lens: &MonoLens, degrees: f64, n_across: usize) -> Self {
        // Aslant, so that no ray of a grid lies on an axis of symmetry.
        let direction = DVec2::new(0.28, 0.96) * degrees.signum();
        let point = ObjectPoint::far(degrees.abs().to_radians(), direction);
        let cosine = |region: &PupilRegion| point.direction_to(DVec3::ZERO).dot(region.plane().normal());
        let region = |lens: &MonoLens| PupilRegion::find(lens, &point, N_AZIMUTHS);
        let area_mm2 = |lens: &MonoLens| region(lens).map_or(0.0, |region| region.area_mm2() * cosine(&region));
        let found_mm2 = lens.over_clear_pupil(&area_mm2);
        // Where nothing is found, a coarse grid looks for light first.
        let is_counted = found_mm2 > 0.0 || is_any_lit(lens, &point);
        let (counted_mm2, error_mm2) = if is_counted { cross_section_mm2(lens, &point, n_across) } else { (0.0, 0.0) };
        Self {
            degrees,
            found_mm2,
            counted_mm2,
            error_mm2,
            has_lines: region(lens).is_some_and(|region| region.outline().is_none()),
            has_outline: PupilBoundary::find(lens, &point, N_AZIMUTHS).is_some(),
        }
    }

    fn brighter_mm2(&self) -> f64 {
        self.found_mm2.max(self.counted_mm2).max(f64::MIN_POSITIVE)
    }

    fn difference(&self) -> f64 {
        (self.found_mm2 - self.counted_mm2) / self.brighter_mm2()
    }

    /// The standard error of the count, over the light.
    fn error(&self) -> f64 {
        self.error_mm2 / self.brighter_mm2()
    }

    /// Whether more is wrong than may be: light that is missed or made up, or an energy that differs by more than the count's errors
    /// explain.
    fn is_wrong(&self) -> bool {
        (self.found_mm2 > 0.0) != self.has_outline || self.difference().abs() > MOST_DIFFERENCE + 3.0 * self.error()
    }

    /// Returns by how much a step of what is found differs from that of the rays, over the light on the brighter side, and what the
    /// errors of the counts explain of it.
    fn step_from(&self, before: &Self) -> (f64, f64) {
        let brighter = self.brighter_mm2().max(before.brighter_mm2());
        let steps = (self.found_mm2 - before.found_mm2) - (self.counted_mm2 - before.counted_mm2);
        (steps.abs() / brighter, 3.0 * self.error_mm2.hypot(before.error_mm2) / brighter)
    }
}

/// Prints the row of a lens: how many fields are lit, its last light, how many fields differ by more than is allowed, the largest
/// difference with the count's error there, how many steps rays do not have and the largest, the fields that lines serve.
fn scan(name: &str, lens: &MonoLens, step_deg: f64, n_across: usize) {
    let n = (LAST_FIELD_DEG / step_deg) as i32;
    let first = if lens.is_rotational() { 0 } else { -n };
    let fields: Vec<Field> =
        (first..=n).into_par_iter().map(|i| Field::of(lens, f64::from(i) * step_deg, n_across)).collect();
    let brightest = fields.iter().map(|field| field.counted_mm2).fold(0.0, f64::max);
    let is_lit = |field: &&Field| field.counted_mm2.max(field.found_mm2) > DARK * brightest;
    let lit: Vec<&Field> = fields.iter().filter(is_lit).collect();
    let last_deg = fields.iter().filter(|f| f.counted_mm2 > 0.0).map(|f| f.degrees.abs()).fold(0.0, f64::max);
    for field in lit.iter().filter(|field| field.is_wrong()) {
        let Field { degrees, found_mm2, counted_mm2, has_lines, has_outline, .. } = field;
        eprintln!(
            "{name} {degrees}: found {found_mm2:.6e} counted {counted_mm2:.6e} mm2, {:+.2e} (count {:.0e}); lines \
             {has_lines}, outline {has_outline}",
            field.difference(),
            field.error()
        );
    }
    let worst = lit.iter().max_by(|a, b| a.difference().abs().total_cmp(&b.difference().abs()));
    let worst = worst.map_or((0.0, 0.0, 0.0), |field| (field.difference().abs(), field.error(), field.degrees));
    let pairs = fields.windows(2).filter(|pair| is_lit(&&pair[0]) || is_lit(&&pair[1]));
    let steps: Vec<(f64, f64)> = pairs.map(|pair| pair[1].step_from(&pair[0])).collect();
    let largest = steps.iter().map(|(step, _)| *step).fold(0.0, f64::max);
    println!(
        "| {name} | {} | {last_deg} | {} | {:.1e} ± {:.0e} at {} | {} | {largest:.1e} | {} |",
        lit.len(),
        lit.iter().filter(|field| field.is_wrong()).count(),
        worst.0,
        worst.1,
        worst.2,
        steps.iter().filter(|(step, explained)| *step > MOST_STEP + explained).count(),
        lit.iter().filter(|field| field.has_lines).count()
    );
}

/// Prints the row of a lens: f-numbers, the beam on the axis and its spot, against counted rays.
fn compare_axis(name: &str, lens: &MonoLens) {
    let first = lens.first_order();
    let limit = lens.limiting_beam().map_or("stop".to_owned(), |beam| format!("rim {}", beam.limiting_surface));
    let (Some(real), true) = (lens.real_f_number(), lens.is_rotational()) else {
        return println!("|| {name} | no axial beam | f/{:.4} | – | – | – | – |", first.f_number);
    };
    let counted = first.efl_mm.abs() / (2.0 * beam_radius_mm(lens, N_COUNTED_ON_AXIS));
    let axis = ObjectPoint::Infinite(DVec3::Z);
    let paraxial_mm = lens.film_distance_mm_for(f64::INFINITY);
    let points = [axis];
    let focus = Autofocus::alike(std::slice::from_ref(lens), &points, PupilRule::of_rings(N_RINGS));
    let spot = paraxial_mm.ok().and_then(|from_mm| focus.best_film_mm(from_mm));
    let spot = spot.map_or("– | –".to_owned(), |(best_mm, least_mm)| {
        // Out of focus, where the rim, of which rays are hard to count, has no more than its share of the squares.
        let film_mm = best_mm + 8.0 * least_mm * first.f_number;
        let light = PupilLight::to_film(lens, &axis, film_mm, PupilRule::of_rings(N_RINGS));
        let found_mm = light.map_or(f64::NAN, |light| {
            let (_, [xx, yy, _]) = light.moments(lens, film_mm);
            (xx + yy).sqrt()
        });
        let counted_mm = axial_spot_rms_mm(lens, film_mm, N_COUNTED_ON_AXIS).unwrap_or(f64::NAN);
        format!("{:.4} | {:.1e}", 1e3 * found_mm, (found_mm / counted_mm - 1.0).abs())
    });
    println!(
        "|| {name} | {limit} | {:.5} | {real:.5} | {:.1e} | {spot} |",
        first.f_number,
        (real / counted - 1.0).abs()
    );
}
