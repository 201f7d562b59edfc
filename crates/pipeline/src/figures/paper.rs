//! The computations behind the paper's Figures 1 to 3, done its way.
//!
//! Object places are given as the authors did: in a frame whose origin is the last vertex.

use dioptric_diffraction::Hurb;
use dioptric_optics::{Beam, Interface, Lens, MonoLens, ObjectPoint, RayBatch, Surface};
use dioptric_psf::{CountingFilm, FrontGrid, Picture, Profile, PsfError, mean_place_mm, trace_as_authors};
use glam::{DVec2, DVec3};
use ndarray::Array2;

/// The film of Figures 1 and 3, mm behind the last vertex.
pub const FIGURE_3_FILM_MM: f64 = 51.8145;
/// The film of the stored field × depth × wavelength array, mm behind the last vertex.
pub const ARRAY_FILM_MM: f64 = 135.5;
/// The film of Figure 2: the image of 2 m by an ideal lens of 50 mm.
pub const FIGURE_2_FILM_MM: f64 = 51.282_051_282_051_28;

/// Returns the paper's two-element lens with rims of these diameters.
///
/// # Errors
/// When a rim does not fit on its surface.
pub fn two_element_lens(stop_diameter_mm: f64, outer_diameter_mm: f64) -> Result<Lens, PsfError> {
    let lens = Lens::built_in("paper-2el")?;
    let interfaces: Vec<Interface> = lens
        .interfaces()
        .iter()
        .enumerate()
        .map(|(i, interface)| {
            let diameter_mm = if i == lens.stop() { stop_diameter_mm } else { outer_diameter_mm };
            let surface = Surface { semi_aperture_mm: 0.5 * diameter_mm, ..interface.surface.clone() };
            Interface { surface, ..interface.clone() }
        })
        .collect();
    Ok(Lens::new(lens.name(), lens.source(), interfaces, lens.stop())?)
}

/// Returns the counted picture of a point for each lens (one a wavelength).
///
/// `source_mm` counts from the last vertex.
pub fn counted_psfs(
    lenses: &[MonoLens],
    source_mm: DVec3,
    film_distance_mm: f64,
    grid: FrontGrid,
    film: CountingFilm,
) -> Vec<Array2<f64>> {
    let count = |lens: &MonoLens| {
        let point = ObjectPoint::Finite(source_mm + DVec3::Z * lens.last_vertex_z_mm());
        film.count_beam(lens, &Beam { point, targets_mm: &grid.targets_mm(lens), z_mm: 0.0 }, film_distance_mm)
    };
    lenses.iter().map(count).collect()
}

/// Returns where the middle of a fine film belongs: the mean place, over all wavelengths, of a first pass with 26² rays,
/// or `None` if none of them arrives.
pub fn film_center_mm(lenses: &[MonoLens], source_mm: DVec3, film_distance_mm: f64) -> Option<DVec2> {
    let coarse = FrontGrid { n_across: 26, jitter_seed: None };
    let mean_mm = |lens: &MonoLens| {
        let rays = land(lens, source_mm, film_distance_mm, coarse);
        mean_place_mm(lens.landed(&rays, film_distance_mm))
    };
    let means: Vec<DVec2> = lenses.iter().filter_map(mean_mm).collect();
    (!means.is_empty()).then(|| means.iter().sum::<DVec2>() / means.len() as f64)
}

fn land(lens: &MonoLens, source_mm: DVec3, film_distance_mm: f64, grid: FrontGrid) -> RayBatch {
    let mut rays = grid.rays(lens, source_mm + DVec3::Z * lens.last_vertex_z_mm());
    trace_as_authors(lens, &mut rays, film_distance_mm, None);
    rays
}

/// Returns the rms radius, µm, of the picture of an axial point at each wavelength: Figure 3's numbers.
///
/// The lens has a stop of 4 mm and elements of 6 mm; the film is 75 × 75 pixels of 4 µm. `object_mm` counts from the
/// last vertex: 8000 or 2000 in the paper.
///
/// # Errors
/// When the lens has no index at a wavelength.
pub fn figure_3_rms_um(object_mm: f64, wavelengths_nm: &[f64]) -> Result<Vec<f64>, PsfError> {
    let psfs = figure_3_psfs(object_mm, wavelengths_nm)?;
    Ok(psfs.iter().map(|counts| Picture::new(counts.view(), 4.0).rms_radius_um()).collect())
}

/// Returns the pictures of an axial point from which Figure 3 is made, one a wavelength: 75 × 75 pixels of 4 µm.
///
/// # Errors
/// When the lens has no index at a wavelength.
pub fn figure_3_psfs(object_mm: f64, wavelengths_nm: &[f64]) -> Result<Vec<Array2<f64>>, PsfError> {
    let lens = two_element_lens(4.0, 6.0)?;
    let lenses: Vec<MonoLens> = wavelengths_nm.iter().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
    let grid = FrontGrid { n_across: 201, jitter_seed: Some(1) };
    let film = CountingFilm { n_pixels: 75, side_mm: 0.3, center_mm: DVec2::ZERO };
    Ok(counted_psfs(&lenses, DVec3::new(0.0, 0.0, -object_mm), FIGURE_3_FILM_MM, grid, film))
}

/// The set-up of Figure 2: an ideal lens of 50 mm, its point at 2 m, and the film that counted the rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure2 {
    /// Diameter of the lens, mm: 2.2727 in the figure, f/22.
    pub diameter_mm: f64,
    /// Pixels of the film of 0.2/√2 mm.
    pub n_pixels: usize,
}

impl Figure2 {
    /// The figure as it was printed.
    pub const PRINTED: Self = Self { diameter_mm: 2.2727, n_pixels: 150 };

    /// Returns λN of the image, µm.
    pub fn unit_um(self, wavelength_nm: f64) -> f64 {
        wavelength_nm * 1e-3 * FIGURE_2_FILM_MM / self.diameter_mm
    }

    fn side_um(self) -> f64 {
        0.2e3 / 2f64.sqrt()
    }

    /// Returns a line spread given in units of λN as the authors show theirs: collected on the pixels of the film and
    /// smoothed by 1 2 3 2 1.
    pub fn binned(self, lsf: impl Fn(f64) -> f64, wavelength_nm: f64) -> Profile {
        let (n, pitch_um) = (self.n_pixels, self.side_um() / self.n_pixels as f64);
        let unit_um = self.unit_um(wavelength_nm);
        let at_um: Vec<f64> = (0..n).map(|i| (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch_um).collect();
        const SUB: i32 = 8;
        let sub = |i| ((f64::from(i) + 0.5) / f64::from(SUB) - 0.5) * pitch_um;
        let collected =
            |at: &f64| (0..SUB).map(|i| lsf((at + sub(i)) / unit_um) / unit_um).sum::<f64>() / f64::from(SUB);
        let values: Vec<f64> = at_um.iter().map(collected).collect();
        Profile { at_um, values: smoothed(&values) }
    }

    /// Returns the line spread by counting rays that HURB deviates at random, as the authors did; not smoothed.
    ///
    /// # Errors
    /// When the diameter is not above 0.
    pub fn counted(self, model: Hurb, n_across: usize, wavelength_nm: f64, seed: u64) -> Result<Profile, PsfError> {
        let lens = Lens::thin(50.0, self.diameter_mm)?.at(wavelength_nm)?;
        let grid = FrontGrid { n_across, jitter_seed: Some(seed) };
        let mut rays = grid.rays(&lens, DVec3::new(0.0, 0.0, -2000.0));
        let bending = dioptric_psf::AuthorsBending { model, seed: seed.wrapping_add(1) };
        trace_as_authors(&lens, &mut rays, FIGURE_2_FILM_MM, Some(bending));
        let film = CountingFilm { n_pixels: self.n_pixels, side_mm: 1e-3 * self.side_um(), center_mm: DVec2::ZERO };
        let counts = film.count(lens.landed(&rays, FIGURE_2_FILM_MM));
        Ok(Picture::new(counts.view(), film.pitch_um()).line_spread(0.0))
    }
}

/// Returns the samples smoothed by 1 2 3 2 1; the ends are repeated.
fn smoothed(values: &[f64]) -> Vec<f64> {
    let last = values.len() as i64 - 1;
    let at = |i: i64| values[i.clamp(0, last) as usize];
    (0..=last).map(|i| (at(i - 2) + 2.0 * at(i - 1) + 3.0 * at(i) + 2.0 * at(i + 1) + at(i + 2)) / 9.0).collect()
}

#[cfg(test)]
mod tests {
    use dioptric_diffraction::airy;

    use super::*;

    /// Returns the rows of a table of the shared reference data, by column name.
    fn table(name: &str) -> Option<Vec<std::collections::HashMap<String, String>>> {
        let text = std::fs::read_to_string(dioptric_golden::shared(name)?).unwrap();
        let mut lines = text.lines();
        let names: Vec<String> = lines.next().unwrap().split(',').map(str::to_owned).collect();
        Some(lines.map(|line| names.iter().cloned().zip(line.split(',').map(str::to_owned)).collect()).collect())
    }

    fn number(row: &std::collections::HashMap<String, String>, key: &str) -> f64 {
        row[key].parse().unwrap()
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn figure_3_has_the_authors_rms_radii() {
        let Some(rows) = table("reference/paper/fig3_2El_D4_onaxis_rms.csv") else { return };
        assert_eq!(rows.len(), 62);
        for object_mm in [8000.0, 2000.0] {
            let rows: Vec<_> = rows.iter().filter(|row| number(row, "object_distance_mm") == object_mm).collect();
            let nm: Vec<f64> = rows.iter().map(|row| number(row, "wave_nm")).collect();
            for (row, rms) in rows.iter().zip(figure_3_rms_um(object_mm, &nm).unwrap()) {
                let expected = number(row, "rms_radius_um");
                // Near focus the spot is a pixel or two, and the radius is their quantisation.
                let tolerance = if expected > 5.0 { 0.15 } else { 1.5 };
                assert!((rms - expected).abs() < tolerance, "{} nm: {rms}, not {expected}", row["wave_nm"]);
            }
        }
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn the_stored_array_has_the_authors_moments() {
        let Some(rows) = table("reference/paper/psfstructure_2El_10mmAp_moments.csv") else { return };
        assert_eq!(rows.len(), 80);
        let lens = two_element_lens(10.0, 10.0).unwrap();
        let film = CountingFilm { n_pixels: 75, side_mm: 10.0, center_mm: DVec2::ZERO };
        // 401² rays instead of 801²: the moments differ by less than a µm.
        let grid = FrontGrid { n_across: 401, jitter_seed: Some(1) };
        for point in rows.chunks(4) {
            let lenses: Vec<MonoLens> = point.iter().map(|row| lens.at(number(row, "wave_nm")).unwrap()).collect();
            let source_mm = DVec3::new(number(&point[0], "source_x_mm"), 0.0, number(&point[0], "source_z_mm"));
            // Where the authors' film lay follows from the centroid that they stored, best by that of the widest blur.
            let widest =
                (0..4).max_by(|&a, &b| number(&point[a], "sigma_x_mm").total_cmp(&number(&point[b], "sigma_x_mm")));
            let widest = widest.unwrap();
            let rays = land(&lenses[widest], source_mm, ARRAY_FILM_MM, grid);
            let mean = mean_place_mm(lenses[widest].landed(&rays, ARRAY_FILM_MM)).unwrap();
            let center_mm = mean - DVec2::X * number(&point[widest], "window_centroid_dx_mm");
            let film = CountingFilm { center_mm, ..film };
            for (row, counts) in point.iter().zip(counted_psfs(&lenses, source_mm, ARRAY_FILM_MM, grid, film)) {
                let moments = Picture::new(counts.view(), film.pitch_um()).second_moments_um2();
                for (value, key) in [(moments.xx, "sigma_x_mm"), (moments.yy, "sigma_y_mm")] {
                    let (sigma_mm, expected) = (1e-3 * value.sqrt(), number(row, key));
                    assert!((sigma_mm - expected).abs() < 0.005, "{key} {sigma_mm}: {row:?}");
                }
            }
        }
    }

    /// Returns the line spread of the paper's model by straight lines between samples 0.01 λN apart: quick, and good
    /// to 1e-5 of the peak.
    fn tabulated_lsf() -> impl Fn(f64) -> f64 {
        let values: Vec<f64> = (0..=1000).map(|i| Hurb::PAPER.lsf(0.01 * f64::from(i))).collect();
        move |u: f64| {
            let at = (100.0 * u.abs()).min(999.99);
            let below = at as usize;
            values[below] + (values[below + 1] - values[below]) * at.fract()
        }
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn figure_2_has_the_authors_widths() {
        let Some(rows) = table("reference/paper/fig2_hurb_lsf.csv") else { return };
        assert_eq!(rows.len(), 93);
        let lsf = tabulated_lsf();
        for row in rows {
            let is_printed = row["dataset"].contains("n401");
            let figure = Figure2 { diameter_mm: number(&row, "D_mm"), n_pixels: if is_printed { 150 } else { 200 } };
            let nm = number(&row, "wave_nm");
            let width = figure.binned(&lsf, nm).full_width_at_half_maximum_um();
            let expected = number(&row, "stored_LSF_fwhm_um");
            // The printed data has 126 000 rays; the others 31 000, whose widths scatter by 1.2 %. The table gives
            // hundredths of a µm, so a width is known to half of that.
            let share = if is_printed { 0.015 } else { 0.03 };
            let tolerance_um = share * expected + 0.005;
            assert!((width - expected).abs() < tolerance_um, "{} {nm}: {width}, not {expected}", row["dataset"]);
        }
    }

    #[test]
    fn counted_rays_have_the_width_of_the_closed_form_and_it_grows_with_the_wavelength() {
        let width = |nm| {
            let mut profile = Figure2::PRINTED.counted(Hurb::PAPER, 801, nm, 5).unwrap();
            profile.values = smoothed(&profile.values);
            profile.full_width_at_half_maximum_um()
        };
        let lsf = tabulated_lsf();
        for nm in [400.0, 700.0] {
            let expected = Figure2::PRINTED.binned(&lsf, nm).full_width_at_half_maximum_um();
            // 500 000 rays, smoothed: the crossings of half the maximum are known to 1 %, and an even number of
            // pixels puts the middle between two of them.
            assert!((width(nm) / expected - 1.0).abs() < 0.02, "{nm}: {} {expected}", width(nm));
        }
    }

    #[test]
    fn theory_is_wider_than_the_papers_model() {
        let [theory, paper] =
            [Figure2::PRINTED.binned(airy::lsf, 550.0), Figure2::PRINTED.binned(|u| Hurb::PAPER.lsf(u), 550.0)]
                .map(|profile| profile.full_width_at_half_maximum_um());
        assert!((paper / theory - 0.66).abs() < 0.02, "{paper} {theory}");
    }
}
