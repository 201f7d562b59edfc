//! The light of all wavelengths of a point together.

use std::ops::Range;

use dioptric_diffraction::{Covariance, TransferSpokes};
use dioptric_optics::glam::DVec2;
use dioptric_psf::Picture;
use dioptric_spectrum::WavelengthGrid;
use ndarray::Array2;

use super::request::LARGEST;
use super::row::PointName;
use super::windowed::Windowed;
use crate::{PsfRow, PsfSet};
use dioptric_pipeline::{display::LinearRgb, display::SpectrumToRgb};

/// The light of all wavelengths of one point, each laid where it lands.
#[derive(Clone, Debug)]
pub struct PolychromaticPsf {
    /// What is measured of it; the centroid is that of the whole.
    pub row: PsfRow,
    /// The energy on each pixel about that centroid; the sum is at most 1.
    pub picture: Array2<f32>,
}

/// A part of a whole: one wavelength's picture.
struct Part {
    /// Its number in the set.
    index: usize,
    /// Its share of the energy.
    share: f64,
    /// How far its centroid lies from that of the whole, pixels: columns to the right, rows down.
    offset_px: DVec2,
}

/// A part as waves see it.
struct PartWaves {
    share: f64,
    offset_px: DVec2,
    picture: Windowed,
}

impl PsfSet {
    /// Returns the rows of each point: all its wavelengths.
    pub fn points(&self) -> impl Iterator<Item = Range<usize>> {
        let n = self.spectral_weights.len();
        (0..self.rows.len() / n).map(move |i| i * n..(i + 1) * n)
    }

    /// Returns the light of all wavelengths of each point that is lit, in the order of the rows.
    ///
    /// Wavelengths count by the set's weights and by how much of each gets through. Pictures are moved by parts of a
    /// pixel by sharing between neighbors; moments and modulations are exact.
    pub fn polychromatic(&self, mtf_per_mm: &[f64]) -> Vec<PolychromaticPsf> {
        self.points().filter_map(|point| self.whole(point, mtf_per_mm)).collect()
    }

    /// Returns the light of all wavelengths of one point, if there are several and it is lit.
    pub fn polychromatic_of(&self, point: Range<usize>) -> Option<PolychromaticPsf> {
        (point.len() > 1).then(|| self.whole(point, &[])).flatten()
    }

    fn whole(&self, point: Range<usize>, mtf_per_mm: &[f64]) -> Option<PolychromaticPsf> {
        let (centroid_mm, parts) = self.parts(point.clone())?;
        let mut second = Covariance::default();
        let first = &self.rows[point.start];
        let mut name = PointName {
            field_deg: first.field_deg,
            field_y_deg: first.field_y_deg,
            distance_mm: first.distance_mm,
            wavelength_nm: 0.0,
        };
        let (mut energy, mut picture_share, mut wave_fraction) = (0.0, 0.0, Some(0.0));
        for part in &parts {
            let (row, w) = (&self.rows[part.index], part.share);
            let (own, apart_um) = (row.second_moments_um2(), 1e3 * (row.centroid_mm() - centroid_mm));
            let whole = own.plus(Covariance::along(apart_um));
            second = second.plus(Covariance { xx: w * whole.xx, xy: w * whole.xy, yy: w * whole.yy });
            name.wavelength_nm += w * row.wavelength_nm;
            energy += w * row.energy;
            picture_share += w * row.picture_share;
            wave_fraction = wave_fraction.zip(row.wave_fraction).map(|(sum, share)| sum + w * share);
        }
        let picture = self.summed(&parts, self.side_of(&parts));
        let mut row = PsfRow::measure(name, centroid_mm, second, &Picture::new(picture.view(), self.pixel_um));
        if let Some(spokes) = self.spokes_of(&parts) {
            row = row.with_spokes(&spokes);
        }
        if !mtf_per_mm.is_empty() {
            row = row.with_mtf(mtf_per_mm, self.modulation_of(&parts));
        }
        Some(PolychromaticPsf {
            row: PsfRow {
                is_polychromatic: true,
                film_distance_mm: first.film_distance_mm,
                film: first.film.clone(),
                energy,
                picture_share,
                wave_fraction,
                ..row
            },
            picture,
        })
    }

    /// Returns the modulation of the polychromatic light of a point for a wave along its meridian or across it, as a direction from +x; no
    /// number where it is dark.
    pub(crate) fn polychromatic_modulation(&self, point: Range<usize>) -> impl Fn(f64, f64) -> f64 {
        self.modulation_of(&self.parts(point).map_or_else(Vec::new, |(_, parts)| parts))
    }

    /// Returns the transfer function of all parts together, where each of them has one that knows of no pixels.
    fn spokes_of(&self, parts: &[Part]) -> Option<TransferSpokes> {
        let of = |part: &Part| Some((&self.rows[part.index].curves.as_ref()?.spokes, part.share));
        TransferSpokes::sum(&parts.iter().map(of).collect::<Option<Vec<_>>>()?)
    }

    /// Returns the modulation of all parts together: without pixels, or else that of their pictures.
    fn modulation_of(&self, parts: &[Part]) -> impl Fn(f64, f64) -> f64 + use<> {
        let pixel_um = self.pixel_um;
        let spokes = self.spokes_of(parts);
        let meridian_rad = parts.first().map(|part| self.rows[part.index].meridian_rad());
        let of = |part: &Part| PartWaves {
            share: part.share,
            offset_px: part.offset_px,
            picture: Windowed::new(self.pictures[part.index].view(), pixel_um),
        };
        let pictures: Vec<PartWaves> = if spokes.is_some() { Vec::new() } else { parts.iter().map(of).collect() };
        move |direction, cycles_per_mm| match &spokes {
            Some(spokes) => spokes.modulations(cycles_per_mm)[usize::from(Some(direction) != meridian_rad)],
            None => modulation_of_pictures(&pictures, pixel_um, direction, cycles_per_mm),
        }
    }

    /// Returns the picture of the polychromatic light as an observer sees it where light of the set's weights is white.
    pub fn color_of(&self, point: Range<usize>) -> Option<LinearRgb> {
        let mut bands: Vec<(usize, f64)> = point.clone().map(|i| self.rows[i].wavelength_nm).enumerate().collect();
        bands.sort_by(|a, b| a.1.total_cmp(&b.1));
        let grid = WavelengthGrid::new(bands.iter().map(|(_, nm)| *nm).collect()).ok()?;
        let white: Vec<f64> = bands.iter().map(|(i, _)| self.spectral_weights[*i]).collect();
        let to_rgb = SpectrumToRgb::with_white(&grid, &white);
        let (_, parts) = self.parts(point.clone())?;
        let side = self.side_of(&parts);
        let mut light = LinearRgb::black(side, side);
        for part in &parts {
            let band = bands.iter().position(|(i, _)| point.start + i == part.index)?;
            light.add(&self.summed(std::slice::from_ref(part), side), to_rgb.of_band(band));
        }
        Some(light.within_gamut())
    }

    /// Returns the centroid of the whole, mm, and its lit parts; `None` where all is dark.
    fn parts(&self, point: Range<usize>) -> Option<(DVec2, Vec<Part>)> {
        let lit: Vec<(usize, f64)> = point
            .clone()
            .zip(&self.spectral_weights)
            .map(|(i, weight)| (i, weight * self.rows[i].energy))
            .filter(|(i, share)| *share > 0.0 && self.rows[*i].centroid_mm().is_finite())
            .collect();
        let total: f64 = lit.iter().map(|(_, share)| share).sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let centroid_mm: DVec2 = lit.iter().map(|(i, share)| self.rows[*i].centroid_mm() * (share / total)).sum();
        let to_px = DVec2::new(1e3, -1e3) / self.pixel_um;
        let part = |&(index, share): &(usize, f64)| Part {
            index,
            share: share / total,
            offset_px: (self.rows[index].middle_mm - centroid_mm) * to_px,
        };
        Some((centroid_mm, lit.iter().map(part).collect()))
    }

    /// Returns the side of a window that holds all parts, an odd number of pixels.
    fn side_of(&self, parts: &[Part]) -> usize {
        let half = |part: &Part| 0.5 * self.pictures[part.index].nrows() as f64 + part.offset_px.abs().max_element();
        let half = parts.iter().map(half).fold(0.0, f64::max).ceil() as usize;
        (2 * half + 1).min(LARGEST)
    }

    /// Returns the sum of parts by their shares, in a window about the centroid of the whole.
    fn summed(&self, parts: &[Part], side: usize) -> Array2<f32> {
        let mut sum = Array2::<f32>::zeros((side, side));
        for part in parts {
            add_moved(&mut sum, &self.pictures[part.index], part.offset_px, part.share as f32);
        }
        sum
    }
}

fn modulation_of_pictures(parts: &[PartWaves], pixel_um: f64, direction: f64, cycles_per_mm: f64) -> f64 {
    let (mut real, mut imaginary, mut total) = (0.0, 0.0, 0.0);
    for PartWaves { share, offset_px, picture } in parts {
        let place_mm = 1e-3 * pixel_um * (*offset_px * DVec2::new(1.0, -1.0)).dot(DVec2::from_angle(direction));
        let (re, im) = picture.transfer(direction, cycles_per_mm);
        let (s, c) = (std::f64::consts::TAU * cycles_per_mm * place_mm).sin_cos();
        real += share * (re * c - im * s);
        imaginary += share * (re * s + im * c);
        total += share;
    }
    if total > 0.0 { real.hypot(imaginary) / total } else { f64::NAN }
}

/// Adds a picture, moved from the middle by this much, to another; what is between pixels is shared between them.
fn add_moved(sum: &mut Array2<f32>, picture: &Array2<f32>, offset_px: DVec2, weight: f32) {
    let (rows, columns) = sum.dim();
    let start = |n: usize, own: usize, offset: f64| (n / 2) as f64 - (own / 2) as f64 + offset;
    let x0 = start(columns, picture.ncols(), offset_px.x);
    let y0 = start(rows, picture.nrows(), offset_px.y);
    let (fx, fy) = ((x0 - x0.floor()) as f32, (y0 - y0.floor()) as f32);
    let shares = [(0, 0, (1.0 - fy) * (1.0 - fx)), (0, 1, (1.0 - fy) * fx), (1, 0, fy * (1.0 - fx)), (1, 1, fy * fx)];
    for ((row, column), value) in picture.indexed_iter() {
        for (down, right, share) in shares {
            let (r, c) = (y0.floor() as isize + (row + down) as isize, x0.floor() as isize + (column + right) as isize);
            if let (Ok(r), Ok(c)) = (usize::try_from(r), usize::try_from(c))
                && let Some(pixel) = sum.get_mut((r, c))
            {
                *pixel += weight * share * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    #[test]
    fn a_moved_picture_keeps_its_energy_and_moves_its_centroid() {
        let picture = ndarray::arr2(&[[0.0f32, 0.1, 0.0], [0.2, 0.4, 0.1], [0.0, 0.2, 0.0]]);
        let mut sum = Array2::zeros((9, 9));
        add_moved(&mut sum, &picture, DVec2::new(1.25, -0.6), 2.0);
        assert_abs_diff_eq!(sum.sum(), 2.0, epsilon = 1e-6);
        let centroid = |p: &Array2<f32>| Picture::new(p.view(), 1.0).centroid_um();
        // Rows run down, y runs up.
        let moved = centroid(&sum) - centroid(&picture);
        assert_abs_diff_eq!(moved.x, 1.25, epsilon = 1e-6);
        assert_abs_diff_eq!(moved.y, 0.6, epsilon = 1e-6);
    }
}
