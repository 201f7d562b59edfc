//! Where the light of a scene lands, and how much of it.

use dioptric_psf::{FilmMap, LensImage};
use dioptric_spectrum::{Cancel, WavelengthGrid};
use glam::DVec2;

use crate::{Film, ForwardError};

/// Where the pixels of a raster lie: columns to the right of the axis and rows below it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilmFrame {
    /// Pixels of the film along a side of a pixel of the raster.
    factor: usize,
    pitch_mm: f64,
    center_row: f64,
    center_column: f64,
}

impl FilmFrame {
    /// `factor` is the number of pixels of the film along a side of a pixel of the raster.
    pub(crate) fn new(raster: &Film, factor: usize) -> Self {
        Self {
            factor,
            pitch_mm: 1e-3 * raster.pitch_um,
            center_row: 0.5 * (raster.rows as f64 - 1.0),
            center_column: 0.5 * (raster.columns as f64 - 1.0),
        }
    }

    /// Returns the place (x right, y up, mm from the axis) of a row and column, which may lie outside the film.
    pub(crate) fn place_mm(&self, row: f64, column: f64) -> DVec2 {
        DVec2::new(self.x_mm(column), self.y_mm(row))
    }

    /// Returns how far to the right of the axis a column lies, mm.
    pub(crate) fn x_mm(&self, column: f64) -> f64 {
        (column - self.center_column) * self.pitch_mm
    }

    /// Returns how far above the axis a row lies, mm.
    pub(crate) fn y_mm(&self, row: f64) -> f64 {
        (self.center_row - row) * self.pitch_mm
    }

    pub(crate) fn center(&self) -> (f64, f64) {
        (self.center_row, self.center_column)
    }

    /// Pixels of the film along a side of a pixel of the raster.
    pub(crate) fn factor(&self) -> usize {
        self.factor
    }

    pub(crate) fn pitch_mm(&self) -> f64 {
        self.pitch_mm
    }
}

/// Checks that the bands, the depths and the film lie within what is known of the lens.
pub(crate) fn check_extent(
    lens: &dyn LensImage,
    grid: &WavelengthGrid,
    dioptres: (f64, f64),
    film: &Film,
    cancel: &Cancel,
) -> Result<(), ForwardError> {
    let (first_nm, last_nm) = lens.wavelengths_nm();
    // A thousandth of a nanometre forgives grids that were written with few digits.
    if let Some(&wavelength_nm) =
        grid.centers_nm().iter().find(|&&center| center < first_nm - 1e-3 || center > last_nm + 1e-3)
    {
        return Err(ForwardError::WavelengthOutside { wavelength_nm, first_nm, last_nm });
    }
    let (far, near) = lens.dioptres();
    let slack = 1e-4 * near.max(dioptres.1);
    if dioptres.0 < far - slack || dioptres.1 > near + slack {
        let [far_m, near_m, bank_far_m, bank_near_m] = [dioptres.0, dioptres.1, far, near].map(|d| 1.0 / d);
        return Err(ForwardError::DepthOutside { near_m, far_m, bank_near_m, bank_far_m });
    }
    let half_size_mm = film.half_size_mm();
    if lens.is_dark_beyond_extent_on(-half_size_mm, half_size_mm) {
        return Ok(());
    }
    let half_mm = film.half_diagonal_mm();
    for &wavelength_nm in grid.centers_nm() {
        for dioptres in [dioptres.0, dioptres.1] {
            cancel.check()?;
            let map = lens.film_map(dioptres, wavelength_nm, 1.1 * half_mm);
            let Some(extent_mm) = ends_before(&map, film) else { continue };
            return Err(match map {
                FilmMap::Radial(_) => {
                    ForwardError::FilmBeyondField { corner_mm: film.reach_mm(), extent_mm, wavelength_nm }
                }
                FilmMap::Plane(_) | FilmMap::Shifted(_) => {
                    ForwardError::FilmBeyondImage { corner_mm: half_mm, extent_mm, wavelength_nm }
                }
            });
        }
    }
    Ok(())
}

/// Returns how far from the axis, or from the middle of the film where the lens has none, something is seen towards the film's corners,
/// mm; `None` where all of it is.
fn ends_before(map: &FilmMap, film: &Film) -> Option<f64> {
    match map {
        FilmMap::Radial(map) => {
            let corner_mm = film.half_diagonal_mm() + map.axis_mm().length();
            (map.extent_mm() < corner_mm).then_some(map.extent_mm())
        }
        FilmMap::Plane(_) | FilmMap::Shifted(_) => {
            let half_mm = film.half_size_mm();
            // Out along lines to the corners and the middles of the sides.
            let ways =
                [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
            let reach = |way: DVec2| {
                const STEPS: u32 = 64;
                let seen =
                    (0..=STEPS).map(|i| way * f64::from(i) / f64::from(STEPS)).take_while(|at| map.at(*at).is_some());
                seen.last().filter(|at| *at != way).map(|at| at.length())
            };
            let ends = ways.into_iter().filter_map(|(x, y)| reach(DVec2::new(x, y) * half_mm));
            ends.min_by(f64::total_cmp)
        }
    }
}
