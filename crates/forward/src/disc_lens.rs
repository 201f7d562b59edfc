//! A lens by formula, whose blur is a uniform disc.

use std::sync::Arc;

use dioptric_psf::{FilmMap, FilmQuery, Kernel, LensImage, PsfError, PupilDivision, PupilEdges};
use glam::DVec2;
use ndarray::Array2;

/// A lens by formula: uniform discs of blur, one irradiance per radiance everywhere, distortion where asked for.
///
/// It stands in for a traced lens where the truth must be known: in tests, benchmarks and examples.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscLens {
    /// Depth in focus, dioptres.
    pub focus_dioptres: f64,
    /// Radius of the disc a dioptre from focus, on the axis, µm.
    pub radius_um_per_dioptre: f64,
    /// Growth of the discs from the axis to a field of tangent 1, as a share.
    pub growth: f64,
    /// Focal length, mm.
    pub focal_mm: f64,
    /// Third-order distortion: the field seen at r mm is r/f · (1 + d r²).
    pub distortion_per_mm2: f64,
    /// Growth of the focal length a nanometre beyond 550 nm, as a share.
    pub lateral_per_nm: f64,
    /// Shift of the depth in focus a nanometre beyond 550 nm, dioptres.
    pub axial_per_nm: f64,
    /// Irradiance per radiance, sr.
    pub irradiance_per_radiance: f64,
}

impl Default for DiscLens {
    fn default() -> Self {
        Self {
            focus_dioptres: 0.0,
            radius_um_per_dioptre: 1.0,
            growth: 0.0,
            focal_mm: 1.0,
            distortion_per_mm2: 0.0,
            lateral_per_nm: 0.0,
            axial_per_nm: 0.0,
            irradiance_per_radiance: 1.0,
        }
    }
}

impl LensImage for DiscLens {
    fn is_symmetric(&self) -> bool {
        true
    }

    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap> {
        self.map(wavelength_nm, reach_mm, 1.0)
    }

    fn kernel(&self, query: FilmQuery) -> Kernel {
        let FilmQuery { place_mm, dioptres, wavelength_nm, pitch_um } = query;
        let radius_mm = self.blur_radius_mm(place_mm, dioptres, wavelength_nm).abs();
        Kernel::centered(disc(1e3 * radius_mm / pitch_um), pitch_um)
    }

    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        let division = Arc::new(PupilDivision::new(n_parts));
        let part = |part: usize| {
            let share = disc_share(|at| division.share(part, at));
            Arc::new(PartOfDisc { lens: self.clone(), division: division.clone(), part, share })
        };
        Ok((0..division.n_parts()).map(|i| part(i) as Arc<dyn LensImage + Send>).collect())
    }

    fn pupil_edges(&self) -> Option<PupilEdges> {
        None
    }

    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        let focus_dioptres = self.focus_dioptres + self.axial_per_nm * (wavelength_nm - 550.0);
        let field_tan = self.field_tan(wavelength_nm, place_mm.length());
        1e-3 * self.radius_um_per_dioptre * (dioptres - focus_dioptres) * (1.0 + self.growth * field_tan)
    }
}

impl DiscLens {
    /// The field seen at a distance from the axis, mm.
    fn field_tan(&self, wavelength_nm: f64, radius_mm: f64) -> f64 {
        let scale_mm = self.focal_mm * (1.0 + self.lateral_per_nm * (wavelength_nm - 550.0));
        radius_mm / scale_mm * (1.0 + self.distortion_per_mm2 * radius_mm * radius_mm)
    }

    fn map(&self, wavelength_nm: f64, reach_mm: f64, share: f64) -> Arc<FilmMap> {
        let irradiance_sr = share * self.irradiance_per_radiance;
        Arc::new(FilmMap::radial(
            reach_mm,
            |radius_mm| Some(self.field_tan(wavelength_nm, radius_mm)),
            |_| irradiance_sr,
        ))
    }
}

/// A part of the pupil of a [`DiscLens`].
struct PartOfDisc {
    lens: DiscLens,
    division: Arc<PupilDivision>,
    part: usize,
    /// Of the light.
    share: f64,
}

impl LensImage for PartOfDisc {
    fn is_symmetric(&self) -> bool {
        false
    }

    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap> {
        self.lens.map(wavelength_nm, reach_mm, self.share)
    }

    fn kernel(&self, query: FilmQuery) -> Kernel {
        let FilmQuery { place_mm, dioptres, wavelength_nm, pitch_um } = query;
        // In the picture, which is the film turned by 180°, light of near points lies on the other side of the pupil.
        let radius_px = -1e3 * self.lens.blur_radius_mm(place_mm, dioptres, wavelength_nm) / pitch_um;
        Kernel::centered(part_of_disc(radius_px, |at| self.division.share(self.part, at)), pitch_um)
    }

    fn pupil_edges(&self) -> Option<PupilEdges> {
        None
    }

    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.lens.blur_radius_mm(place_mm, dioptres, wavelength_nm)
    }
}

/// Returns the share of a part in the unit disc.
fn disc_share(share_at: impl Fn(DVec2) -> f64) -> f64 {
    let (mut share, mut total) = (0.0, 0.0);
    for (at, weight) in disc_points(400) {
        (share, total) = (share + weight * share_at(at), total + weight);
    }
    share / total
}

/// Returns a uniform disc whose points are shared bilinearly among the pixels around them.
fn disc(radius_px: f64) -> Array2<f32> {
    part_of_disc(radius_px, |_| 1.0)
}

/// Returns the part of a uniform disc that goes through a part of the pupil; points of the unit disc, y up, land at `radius_px` times their place.
fn part_of_disc(radius_px: f64, share_at: impl Fn(DVec2) -> f64) -> Array2<f32> {
    // Points across a pixel, and rings across the smallest discs.
    const FINE: f64 = 8.0;
    let half = radius_px.abs().ceil() as usize;
    let n_rings = (FINE * radius_px.abs()).round().max(1.0) as usize;
    let mut kernel = Array2::<f64>::zeros((2 * half + 1, 2 * half + 1));
    let mut share = |row: f64, column: f64, weight: f64| {
        let (top, left) = (row.floor(), column.floor());
        let (down, across) = (row - top, column - left);
        for (r, c, part) in [
            (0, 0, (1.0 - down) * (1.0 - across)),
            (0, 1, (1.0 - down) * across),
            (1, 0, down * (1.0 - across)),
            (1, 1, down * across),
        ] {
            if part > 0.0 {
                kernel[(top as usize + r, left as usize + c)] += weight * part;
            }
        }
    };
    for (at, weight) in disc_points(n_rings) {
        let weight = weight * share_at(at);
        if weight > 0.0 {
            let place = at * radius_px;
            share(half as f64 - place.y, half as f64 + place.x, weight);
        }
    }
    let sum = kernel.sum();
    kernel.mapv(|v| (v / sum) as f32)
}

/// Returns points of the unit disc and their weights: on rings, in proportion to their area, symmetric in all eight octants.
fn disc_points(n_rings: usize) -> impl Iterator<Item = (DVec2, f64)> {
    (0..n_rings).flat_map(move |ring| {
        let (radius, n_octant) = ((ring as f64 + 0.5) / n_rings as f64, ring + 1);
        (0..8 * n_octant).map(move |k| {
            let angle = (k as f64 + 0.5) / (8 * n_octant) as f64 * std::f64::consts::TAU;
            let weight = (2 * ring + 1) as f64 / (8 * n_octant) as f64;
            (radius * DVec2::new(angle.cos(), angle.sin()), weight)
        })
    })
}
