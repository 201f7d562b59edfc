//! Wavefront errors over a pupil, as sums of Zernike's polynomials: what measured optics, such as eyes, are known by.

use std::f64::consts::SQRT_2;

use glam::{DVec2, DVec3, Vec2Swizzles};
use serde::{Deserialize, Serialize};

use crate::{OpticsError, zernike};

/// A wavefront error over a disc, by its coefficients at one wavelength or several, and one field or several.
///
/// It is the path by which the wavefront is ahead of that of the optics without it, µm, at each place of the disc: a positive defocus
/// converges (a myopic eye), the sign of ANSI Z80.28 and of `OpticStudio`. Between wavelengths and fields coefficients are interpolated
/// in step with the wavelength and the angles, beyond the first and the last they are those. Places are in the frame of the surface: x to
/// the right for the photographer, so to the left for who looks into an eye, and y up.
///
/// The field of light is where the line lies from the middle of the surface to the point that the light comes from. Where a trace does
/// not say how far that is (from the film into a scene), each ray comes from far away.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WavefrontError {
    /// Radius of the disc, mm; the polynomials go on beyond it.
    pub radius_mm: f64,
    /// The order and the norm of the polynomials.
    pub terms: ZernikeTerms,
    /// The coefficients: of each field by ascending wavelength. Fields are all pairs of some angles along x and some along y.
    pub bands: Vec<WavefrontBand>,
    /// Whether the optics are alike all around the axis. Fields are then on the axis and along x or along y, and coefficients of other
    /// azimuths are those turned about the axis.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub turned_about_axis: bool,
    /// The wavelength, nm, at which an eye has these coefficients whose longitudinal chromatic aberration is added to them; left out, there
    /// is none.
    ///
    /// It is that of the chromatic eye, 1.68524 − 633.46 / (λ − 214.102) dioptres, λ in nm (Thibos, Ye, Zhang and Bradley 1992, Applied
    /// Optics 31, 3594), known here from 380 to 780 nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chromatic_eye_nm: Option<f64>,
}

/// The coefficients at a wavelength and a field.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WavefrontBand {
    /// Vacuum wavelength, nm.
    pub wavelength_nm: f64,
    /// The field: angles of the object to the right of the axis and upwards, degrees, of tangents x and y over z.
    #[serde(default, skip_serializing_if = "is_on_axis")]
    pub field_deg: [f64; 2],
    /// Coefficients from the first polynomial (piston) on, µm.
    pub coefficients_um: Vec<f64>,
}

fn is_on_axis(field_deg: &[f64; 2]) -> bool {
    *field_deg == [0.0; 2]
}

/// An order and a norm of Zernike's polynomials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ZernikeTerms {
    /// Those of OSA and ANSI Z80.28, from number 0, each of mean square 1.
    Osa,
    /// Noll's, from number 1, each of mean square 1: `OpticStudio`'s standard ones.
    Noll,
    /// The Fringe set, from number 1, at most 37, each at most 1 at the edge.
    Fringe,
}

/// The most coefficients: those up to degree 20.
const MOST_TERMS: usize = 231;
/// Wavelengths at which the chromatic eye is known, nm: in the near infrared, where aberrometers measure, its formula holds as well
/// (Fernández and others 2005).
const EYE_NM: [f64; 2] = [380.0, 900.0];

impl ZernikeTerms {
    /// Returns the degree, the order (below 0 with the sine) and the norm of the `i`-th polynomial, from 0.
    fn nth(self, i: usize) -> (u32, i32, f64) {
        let (n, m) = match self {
            Self::Osa => zernike::osa_degrees(i),
            Self::Noll => zernike::noll_degrees(i + 1),
            Self::Fringe => zernike::fringe_degrees(i + 1),
        };
        let of_mean_square_1 = f64::from(n + 1).sqrt() * if m == 0 { 1.0 } else { SQRT_2 };
        (n, m, if self == Self::Fringe { 1.0 } else { of_mean_square_1 })
    }

    fn n_most(self) -> usize {
        if self == Self::Fringe { zernike::FRINGE_TERMS } else { MOST_TERMS }
    }
}

impl WavefrontError {
    /// Checks that it is known at a wavelength.
    pub(crate) fn check_at(&self, wavelength_nm: f64) -> Result<(), OpticsError> {
        let [first_nm, last_nm] = EYE_NM;
        match self.chromatic_eye_nm.is_none() || (first_nm..=last_nm).contains(&wavelength_nm) {
            true => Ok(()),
            false => Err(OpticsError::WavelengthOutsideGlass {
                glass: "the chromatic aberration of the eye".to_owned(),
                wavelength_nm,
                first_nm,
                last_nm,
                remedy: "",
            }),
        }
    }

    /// Returns the error at a wavelength.
    pub(crate) fn at(&self, wavelength_nm: f64) -> WavefrontMaps {
        let axes_deg = self.axes_deg();
        let fields = axes_deg[1].iter().flat_map(|y| axes_deg[0].iter().map(|x| [*x, *y]));
        let maps = fields.map(|field_deg| self.map_at(field_deg, wavelength_nm)).collect();
        let turned_along = self.turned_about_axis.then(|| self.along());
        WavefrontMaps { axes_deg, maps, turned_along, object_z_mm: f64::NEG_INFINITY, is_met_from_behind: false }
    }

    /// Whether it differs between fields.
    pub(crate) fn varies(&self) -> bool {
        self.axes_deg().iter().any(|axis_deg| axis_deg.len() > 1)
    }

    /// Returns a sentence on the fields that it is known at, where it differs between them, and one on these wavelengths where they lie
    /// beyond several of its own.
    pub(crate) fn notes_on_ranges(&self, wavelengths_nm: &[f64]) -> Vec<String> {
        let mut notes = Vec::new();
        let [first_nm, last_nm] = self.range_of(|band| band.wavelength_nm);
        let is_other = |nm: &f64| (nm - first_nm).abs() > 1e-6 * first_nm;
        if first_nm == last_nm && self.chromatic_eye_nm.is_none() && wavelengths_nm.iter().any(is_other) {
            notes.push(format!("the wavefront error is known at {first_nm} nm, and held at all wavelengths"));
        }
        if last_nm > first_nm && wavelengths_nm.iter().any(|nm| !(first_nm..=last_nm).contains(nm)) {
            notes.push(format!("the wavefront error is known from {first_nm} to {last_nm} nm, and held beyond"));
        }
        if self.varies() {
            let [x, y] = [0, 1].map(|axis| {
                let [first, last] = self.range_of(|band| band.field_deg[axis]);
                if first == last { format!("{first}°") } else { format!("{first} to {last}°") }
            });
            let fields = match (self.turned_about_axis, self.along()) {
                (true, 0) => format!("{x} from the axis"),
                (true, _) => format!("{y} from the axis"),
                (false, _) => format!("{x} to the right and {y} upwards"),
            };
            notes.push(format!("the wavefront error is known at fields of {fields}, and held beyond"));
        }
        notes
    }

    fn range_of(&self, number: impl Fn(&WavefrontBand) -> f64) -> [f64; 2] {
        let numbers = self.bands.iter().map(number);
        numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], number| [low.min(number), high.max(number)])
    }

    /// The angles along x and along y of the fields, ascending.
    fn axes_deg(&self) -> [Vec<f64>; 2] {
        [0, 1].map(|axis| {
            let mut axis_deg: Vec<f64> = self.bands.iter().map(|band| band.field_deg[axis]).collect();
            axis_deg.sort_by(f64::total_cmp);
            axis_deg.dedup();
            axis_deg
        })
    }

    /// The axis that fields lie along which are turned about the axis: x (0) or y (1).
    fn along(&self) -> usize {
        usize::from(self.bands.iter().any(|band| band.field_deg[1] != 0.0))
    }

    fn map_at(&self, field_deg: [f64; 2], wavelength_nm: f64) -> WavefrontMap {
        let mut map = WavefrontMap { per_mm: 1.0 / self.radius_mm, orders: Vec::new() };
        for (i, coefficient_um) in self.coefficients_um(field_deg, wavelength_nm).into_iter().enumerate() {
            let (n, m, norm) = self.terms.nth(i);
            map.add(n, m, 1e-3 * norm * coefficient_um);
        }
        if let Some(eye_nm) = self.chromatic_eye_nm {
            // Too little power makes the edge lag: D ρ² r² / 2, of which the piston is left out.
            let dioptres = chromatic_eye_dioptres(wavelength_nm) - chromatic_eye_dioptres(eye_nm);
            map.add(2, 0, -0.25e-3 * dioptres * self.radius_mm * self.radius_mm);
        }
        map
    }

    fn coefficients_um(&self, field_deg: [f64; 2], wavelength_nm: f64) -> Vec<f64> {
        let bands: Vec<&WavefrontBand> = self.bands.iter().filter(|band| band.field_deg == field_deg).collect();
        let after = bands.partition_point(|band| band.wavelength_nm < wavelength_nm);
        let of = |i: usize| bands[i.min(bands.len() - 1)];
        let (below, above) = (of(after.saturating_sub(1)), of(after));
        let way_nm = above.wavelength_nm - below.wavelength_nm;
        let share = if way_nm > 0.0 { (wavelength_nm - below.wavelength_nm) / way_nm } else { 0.0 };
        let n_terms = below.coefficients_um.len().max(above.coefficients_um.len());
        let at = |band: &WavefrontBand, i: usize| band.coefficients_um.get(i).copied().unwrap_or(0.0);
        (0..n_terms).map(|i| at(below, i) * (1.0 - share) + at(above, i) * share).collect()
    }

    /// Whether it depends on the distance from the axis alone, and with the field turns about the axis.
    pub(crate) fn is_rotational(&self) -> bool {
        // Turned fields have been checked to be mirror images of themselves.
        self.turned_about_axis || self.axes_deg().iter().all(|axis| axis.len() == 1) && self.all_orders(|_, m| m == 0)
    }

    /// Whether it stays when x (axis 0) or y (axis 1) changes its sign.
    pub(crate) fn is_mirrored_along(&self, axis: usize) -> bool {
        self.turned_about_axis || self.axes_deg()[axis].len() == 1 && self.has_terms_mirrored_along(axis)
    }

    fn has_terms_mirrored_along(&self, axis: usize) -> bool {
        // cos mθ turns into (−1)^m of itself with x, and stays with y; the sine changes otherwise.
        self.all_orders(|_, m| if axis == 0 { (m % 2 == 0) == (m >= 0) } else { m >= 0 })
    }

    /// Whether this is so of all polynomials that it has any of.
    fn all_orders(&self, is_so: impl Fn(u32, i32) -> bool) -> bool {
        self.bands.iter().all(|band| self.has_orders(band, &is_so))
    }

    fn has_orders(&self, band: &WavefrontBand, is_so: impl Fn(u32, i32) -> bool) -> bool {
        band.coefficients_um.iter().enumerate().all(|(i, coefficient_um)| {
            let (n, m, _) = self.terms.nth(i);
            *coefficient_um == 0.0 || is_so(n, m)
        })
    }

    pub(crate) fn check(&self, surface: usize) -> Result<(), OpticsError> {
        let wrong = |key, found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        if !(self.radius_mm > 0.0 && self.radius_mm.is_finite()) {
            return wrong("radius_mm of a wavefront error", self.radius_mm, "a finite number above 0");
        }
        if self.bands.is_empty() {
            return wrong("bands of a wavefront error", 0.0, "at least 1");
        }
        let mut last_nm: Vec<([f64; 2], f64)> = Vec::new();
        for band in &self.bands {
            if let Some(found) = band.field_deg.iter().find(|deg| deg.is_nan() || deg.abs() >= 90.0) {
                return wrong("field_deg of a wavefront error", *found, "angles between -90 and 90 degrees");
            }
            let before = last_nm.iter().position(|(field_deg, _)| *field_deg == band.field_deg);
            let before_nm = before.map_or(0.0, |i| last_nm[i].1);
            if !(band.wavelength_nm > before_nm && band.wavelength_nm.is_finite()) {
                let expected = "finite numbers above 0, each above the one before of the same field";
                return wrong("wavelength_nm of a wavefront error", band.wavelength_nm, expected);
            }
            match before {
                Some(i) => last_nm[i].1 = band.wavelength_nm,
                None => last_nm.push((band.field_deg, band.wavelength_nm)),
            }
            if let Some(found) = band.coefficients_um.iter().find(|number| !number.is_finite()) {
                return wrong("coefficients_um of a wavefront error", *found, "finite numbers");
            }
            if band.coefficients_um.len() > self.terms.n_most() {
                let expected = "at most 231 coefficients, of the Fringe set 37";
                return wrong("coefficients_um of a wavefront error", band.coefficients_um.len() as f64, expected);
            }
        }
        let n_fields = self.axes_deg().map(|axis| axis.len()).into_iter().product::<usize>();
        if last_nm.len() != n_fields {
            let expected = "bands at every pair of the angles along x with those along y";
            return wrong("number of fields of a wavefront error", last_nm.len() as f64, expected);
        }
        if self.turned_about_axis {
            self.check_turned(surface)?;
        }
        match self.chromatic_eye_nm {
            Some(nm) if !(EYE_NM[0]..=EYE_NM[1]).contains(&nm) => wrong("chromatic_eye_nm", nm, "380 to 900 nm"),
            _ => Ok(()),
        }
    }
}

impl WavefrontError {
    /// Checks that fields which are turned about the axis can be.
    fn check_turned(&self, surface: usize) -> Result<(), OpticsError> {
        let key = "field_deg of a wavefront error that is turned about the axis";
        let wrong = |found, expected| Err(OpticsError::Surface { surface, key, found, expected });
        let (along, [x_deg, y_deg]) = (self.along(), self.axes_deg());
        if x_deg.len() > 1 && y_deg.len() > 1 {
            return wrong(y_deg[y_deg.len() - 1], "fields along x or along y alone");
        }
        let axis_deg = if along == 0 { x_deg } else { y_deg };
        if axis_deg[0] != 0.0 {
            return wrong(axis_deg[0], "fields from 0, on the axis, on to one side");
        }
        let on_axis = self.bands.iter().filter(|band| is_on_axis(&band.field_deg));
        if !on_axis.into_iter().all(|band| self.has_orders(band, |_, m| m == 0)) {
            return wrong(0.0, "on the axis only terms that are alike all around it");
        }
        match self.has_terms_mirrored_along(1 - along) {
            true => Ok(()),
            false => {
                wrong(axis_deg[axis_deg.len() - 1], "only terms that stay when the side across the field is mirrored")
            }
        }
    }
}

/// Returns the refractive error of the chromatic eye, dioptres: 0 at 589 nm, below 0 for shorter waves, of which the eye has too much power.
fn chromatic_eye_dioptres(wavelength_nm: f64) -> f64 {
    1.68524 - 633.46 / (wavelength_nm - 214.102)
}

/// A wavefront error at one wavelength, at all its fields.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WavefrontMaps {
    axes_deg: [Vec<f64>; 2],
    /// That of each field, those along x together.
    maps: Vec<WavefrontMap>,
    /// The axis that the fields lie along, x (0) or y (1), where they are turned about the axis of the surface.
    turned_along: Option<usize>,
    /// Where the object plane appears to the surface, from it; −∞ of a far one.
    object_z_mm: f64,
    /// Whether light is met that goes back towards the object, its z mirrored.
    pub(crate) is_met_from_behind: bool,
}

/// Where a ray meets a surface and which way it goes, its z above 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting {
    pub(crate) place_mm: DVec2,
    pub(crate) direction: DVec3,
}

impl WavefrontMaps {
    /// Whether it differs between fields.
    pub(crate) fn varies(&self) -> bool {
        self.maps.len() > 1
    }

    /// Returns it for an object plane that appears there to the surface, from it, mm.
    pub(crate) fn of_object_at(self, object_z_mm: f64) -> Self {
        Self { object_z_mm, ..self }
    }

    /// Returns it for light that meets it from the other side.
    pub(crate) fn turned_round(self) -> Self {
        Self { is_met_from_behind: !self.is_met_from_behind, ..self }
    }

    /// Returns how far ahead the wavefront is where a ray meets the surface, mm, and its slopes there; of light that is met from behind the
    /// direction is the one in which it goes on.
    pub(crate) fn at(&self, Meeting { place_mm, direction }: Meeting) -> (f64, DVec2) {
        if !self.varies() {
            return self.maps[0].at(place_mm);
        }
        // Towards the object, as x and y over z: where the line back to its plane ends, seen from the middle of the surface.
        let back = direction.truncate() / direction.z * if self.is_met_from_behind { 1.0 } else { -1.0 };
        let toward = back - place_mm / self.object_z_mm;
        let deg = |tangent: f64| tangent.atan().to_degrees();
        let Some(along) = self.turned_along else {
            return self.mixed([deg(toward.x), deg(toward.y)], place_mm);
        };
        let mut field_deg = [0.0; 2];
        field_deg[along] = deg(toward.length());
        // From the axis that the fields lie along to this one; where all around is alike, none.
        let azimuth = toward.normalize_or(DVec2::X);
        let turn = if along == 0 || toward == DVec2::ZERO { azimuth } else { -azimuth.perp() };
        let (ahead_mm, slope) = self.mixed(field_deg, DVec2::new(turn.x, -turn.y).rotate(place_mm));
        (ahead_mm, turn.rotate(slope))
    }

    /// Returns the same of a field, mixed of those around it.
    fn mixed(&self, field_deg: [f64; 2], place_mm: DVec2) -> (f64, DVec2) {
        let [across, up] = [0, 1].map(|axis| between(&self.axes_deg[axis], field_deg[axis]));
        let (mut value, mut slope) = (0.0, DVec2::ZERO);
        for (j, of_row) in up {
            for (i, of_column) in across {
                let share = of_row * of_column;
                if share != 0.0 {
                    let own = self.maps[j * self.axes_deg[0].len() + i].at(place_mm);
                    value += share * own.0;
                    slope += share * own.1;
                }
            }
        }
        (value, slope)
    }

    /// Whether it is the same all around the axis, as [`WavefrontError::is_rotational`].
    pub(crate) fn is_rotational(&self) -> bool {
        self.turned_along.is_some() || !self.varies() && self.maps[0].is_rotational()
    }

    /// That of the field on the axis: [`WavefrontMap::of_power`].
    pub(crate) fn of_power(&self, i: usize) -> f64 {
        let [across, up] = [0, 1].map(|axis| between(&self.axes_deg[axis], 0.0));
        let of = |j: usize, i: usize| &self.maps[j * self.axes_deg[0].len() + i];
        let rows = up.into_iter().map(|(row, share)| {
            across.into_iter().map(|(column, of_column)| of_column * of(row, column).of_power(i)).sum::<f64>() * share
        });
        rows.sum()
    }
}

/// Returns the two entries of an ascending axis that a value lies between, and their shares; beyond its ends the last one.
fn between(axis: &[f64], value: f64) -> [(usize, f64); 2] {
    let above = axis.partition_point(|entry| *entry < value).min(axis.len() - 1);
    let below = above.saturating_sub(1);
    let way = axis[above] - axis[below];
    let share = if way > 0.0 { ((value - axis[below]) / way).clamp(0.0, 1.0) } else { 0.0 };
    [(below, 1.0 - share), (above, share)]
}

/// A wavefront error at one wavelength, as polynomials in x and y over the radius: the sum over m of Aₘ(ρ²) Re (x + iy)ᵐ and
/// Bₘ(ρ²) Im (x + iy)ᵐ, mm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WavefrontMap {
    per_mm: f64,
    /// For each m the coefficients of A and B, of ρ⁰, ρ² and on.
    orders: Vec<[Vec<f64>; 2]>,
}

impl WavefrontMap {
    /// Adds so many times the polynomial Rₙᵐ cos mθ or, for m below 0, that with the sine.
    fn add(&mut self, n: u32, m: i32, factor_mm: f64) {
        let order = m.unsigned_abs();
        if factor_mm == 0.0 {
            return;
        }
        if self.orders.len() <= order as usize {
            self.orders.resize(order as usize + 1, [Vec::new(), Vec::new()]);
        }
        let sums = &mut self.orders[order as usize][usize::from(m < 0)];
        let radial = zernike::radial_coefficients(n, order);
        if sums.len() < radial.len() {
            sums.resize(radial.len(), 0.0);
        }
        sums.iter_mut().zip(radial).for_each(|(sum, coefficient)| *sum += factor_mm * coefficient);
    }

    /// Returns how far ahead the wavefront is at a place, mm, and its slopes there.
    pub(crate) fn at(&self, place_mm: DVec2) -> (f64, DVec2) {
        let p = place_mm * self.per_mm;
        let square = p.length_squared();
        let (mut value, mut slope) = (0.0, DVec2::ZERO);
        // (x + iy)ᵐ and (x + iy)ᵐ⁻¹.
        let (mut power, mut below) = (DVec2::X, DVec2::ZERO);
        for (m, parts) in self.orders.iter().enumerate() {
            let m = m as f64;
            for (is_sine, coefficients) in parts.iter().enumerate() {
                let (mut sum, mut derivative) = (0.0, 0.0);
                for coefficient in coefficients.iter().rev() {
                    derivative = derivative * square + sum;
                    sum = sum * square + coefficient;
                }
                let angular = power[is_sine];
                // The slopes of Re zᵐ and Im zᵐ are m times those parts of zᵐ⁻¹.
                let of_angular = if is_sine == 0 { DVec2::new(below.x, -below.y) } else { below.yx() };
                value += sum * angular;
                slope += 2.0 * derivative * angular * p + sum * m * of_angular;
            }
            below = power;
            power = p.rotate(power);
        }
        (value, slope * self.per_mm)
    }

    /// Whether it depends on the distance from the axis alone.
    pub(crate) fn is_rotational(&self) -> bool {
        self.orders
            .iter()
            .skip(1)
            .flatten()
            .all(|coefficients| coefficients.iter().all(|coefficient| *coefficient == 0.0))
    }

    /// Returns the coefficient of r² or r⁴ (`i` 1 or 2) of what depends on the distance from the axis alone, 1/mm or 1/mm³.
    pub(crate) fn of_power(&self, i: usize) -> f64 {
        let round = self.orders.first().and_then(|[cosine, _]| cosine.get(i));
        round.copied().unwrap_or(0.0) * self.per_mm.powi(2 * i as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(terms: ZernikeTerms, coefficients_um: Vec<f64>) -> WavefrontError {
        let bands = vec![WavefrontBand { wavelength_nm: 550.0, coefficients_um, ..WavefrontBand::default() }];
        WavefrontError { radius_mm: 2.0, terms, bands, turned_about_axis: false, chromatic_eye_nm: None }
    }

    #[test]
    fn polynomials_are_those_of_the_standards() {
        // ANSI Z80.28, table: number, polynomial; at ρ = 0.7, θ = 0.4.
        let (rho, theta) = (0.7_f64, 0.4_f64);
        let place_mm = 2.0 * rho * DVec2::from_angle(theta);
        let osa: [(usize, f64); 6] = [
            (1, 2.0 * rho * theta.sin()),
            (3, 6f64.sqrt() * rho.powi(2) * (2.0 * theta).sin()),
            (4, 3f64.sqrt() * (2.0 * rho.powi(2) - 1.0)),
            (8, 8f64.sqrt() * (3.0 * rho.powi(3) - 2.0 * rho) * theta.cos()),
            (12, 5f64.sqrt() * (6.0 * rho.powi(4) - 6.0 * rho.powi(2) + 1.0)),
            (14, 10f64.sqrt() * rho.powi(4) * (4.0 * theta).cos()),
        ];
        for (number, expected) in osa {
            let mut coefficients_um = vec![0.0; number + 1];
            coefficients_um[number] = 1.0;
            let (found, _) = error(ZernikeTerms::Osa, coefficients_um).map_at([0.0; 2], 550.0).at(place_mm);
            assert!((1e3 * found - expected).abs() < 1e-12, "{number}: {found}");
        }
        // Noll's 4th and the 9th of the Fringe set.
        let (noll, _) = error(ZernikeTerms::Noll, vec![0.0, 0.0, 0.0, 1.0]).map_at([0.0; 2], 550.0).at(place_mm);
        assert!((1e3 * noll - osa[2].1).abs() < 1e-12);
        let mut ninth = vec![0.0; 9];
        ninth[8] = 1.0;
        let (fringe, _) = error(ZernikeTerms::Fringe, ninth).map_at([0.0; 2], 550.0).at(place_mm);
        assert!((1e3 * fringe - osa[4].1 / 5f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_the_values() {
        let coefficients_um = (0..66).map(|i| f64::from(i % 7) - 3.0).collect();
        let map = error(ZernikeTerms::Osa, coefficients_um).map_at([0.0; 2], 550.0);
        let (place_mm, step_mm) = (DVec2::new(0.9, -1.3), 1e-5);
        let along = |u: DVec2| (map.at(place_mm + u * step_mm).0 - map.at(place_mm - u * step_mm).0) / (2.0 * step_mm);
        let found = map.at(place_mm).1;
        assert!((found - DVec2::new(along(DVec2::X), along(DVec2::Y))).length() < 1e-7 * found.length());
    }

    #[test]
    fn symmetry_is_that_of_the_terms() {
        let of = |number: usize| {
            let mut coefficients_um = vec![0.0; number + 1];
            coefficients_um[number] = 0.1;
            let error = error(ZernikeTerms::Osa, coefficients_um);
            (error.is_rotational(), error.is_mirrored_along(0), error.is_mirrored_along(1))
        };
        // Defocus, astigmatism at 45° and along the axes, coma along y and along x.
        assert_eq!(of(4), (true, true, true));
        assert_eq!(of(3), (false, false, false));
        assert_eq!(of(5), (false, true, true));
        assert_eq!(of(7), (false, true, false));
        assert_eq!(of(8), (false, false, true));
    }

    #[test]
    fn coefficients_lie_between_those_of_the_bands_and_the_eye_adds_its_color() {
        let band = |wavelength_nm: f64, um: f64| {
            let coefficients_um = vec![0.0, um];
            WavefrontBand { wavelength_nm, coefficients_um, ..WavefrontBand::default() }
        };
        let two =
            WavefrontError { bands: vec![band(500.0, 1.0), band(600.0, 3.0)], ..error(ZernikeTerms::Osa, vec![]) };
        for (nm, um) in [(400.0, 1.0), (500.0, 1.0), (525.0, 1.5), (600.0, 3.0), (700.0, 3.0)] {
            assert!((two.coefficients_um([0.0; 2], nm)[1] - um).abs() < 1e-12, "{nm}");
        }
        let eye = WavefrontError { chromatic_eye_nm: Some(550.0), ..error(ZernikeTerms::Osa, vec![]) };
        // The chromatic eye's table: −1.00 dioptre at 450 nm, −0.20 at 550: more power for blue, whose edge is ahead.
        let ahead_mm = |nm: f64| eye.at(nm).of_power(1);
        assert!((ahead_mm(450.0) - 0.5e-3 * 0.8).abs() < 0.5e-3 * 0.02, "{}", ahead_mm(450.0));
        assert_eq!(ahead_mm(550.0), 0.0);
        assert!(ahead_mm(650.0) < 0.0);
    }

    #[test]
    fn fields_are_mixed_and_turned_about_the_axis() {
        let band = |field_deg: [f64; 2], coma_um: f64| {
            let coefficients_um = [vec![0.0; 7], vec![coma_um]].concat();
            WavefrontBand { wavelength_nm: 550.0, field_deg, coefficients_um }
        };
        let place_mm = DVec2::new(0.8, -0.5);
        let met = |error: &WavefrontError, x_deg: f64, y_deg: f64, place_mm: DVec2| {
            let tangents = DVec2::new(-x_deg.to_radians().tan(), -y_deg.to_radians().tan());
            error.at(550.0).at(Meeting { place_mm, direction: tangents.extend(1.0).normalize() })
        };
        let alone = error(ZernikeTerms::Osa, band([0.0; 2], 0.1).coefficients_um).map_at([0.0; 2], 550.0);
        let same = |(value, slope): (f64, DVec2), share: f64, (other, of): (f64, DVec2)| {
            assert!((value - share * other).abs() < 1e-15 && (slope - share * of).length() < 1e-15, "{value} {other}");
        };
        // In step with the angle, and held beyond.
        let bands = vec![band([0.0, -10.0], 0.0), band([0.0, 10.0], 0.1)];
        let line = WavefrontError { bands, ..error(ZernikeTerms::Osa, vec![]) };
        for (x_deg, y_deg, share) in [(0.0, 0.0, 0.5), (-20.0, 5.0, 0.75), (3.0, 10.0, 1.0), (0.0, 30.0, 1.0)] {
            same(met(&line, x_deg, y_deg, place_mm), share, alone.at(place_mm));
        }
        // Half of it half-way at another azimuth, where it is that along y turned clockwise by 90°.
        let bands = vec![band([0.0, 0.0], 0.0), band([0.0, 10.0], 0.1)];
        let turned = WavefrontError { bands, turned_about_axis: true, ..error(ZernikeTerms::Osa, vec![]) };
        same(met(&turned, 0.0, 5.0, place_mm), 0.5, alone.at(place_mm));
        let (value, slope) = alone.at(place_mm);
        same(met(&turned, 5.0, 0.0, -place_mm.perp()), 0.5, (value, -slope.perp()));
        assert!(turned.is_rotational() && turned.is_mirrored_along(0) && turned.is_mirrored_along(1));
        assert!(!line.is_rotational() && line.is_mirrored_along(0) && !line.is_mirrored_along(1));
        // Light of a near point comes in other directions to other places, all of one field.
        let point = DVec3::new(-30.0, 0.0, -400.0);
        let maps = WavefrontMaps { object_z_mm: point.z, ..turned.at(550.0) };
        let at = |place_mm: DVec2| maps.at(Meeting { place_mm, direction: (place_mm.extend(0.0) - point).normalize() });
        let share = (30.0_f64 / 400.0).atan().to_degrees() / 10.0;
        same(at(place_mm.perp()), share, (value, slope.perp()));
    }

    #[test]
    fn nonsense_is_refused() {
        let good = || error(ZernikeTerms::Fringe, vec![0.0; 37]);
        assert!(good().check(0).is_ok());
        let band = |wavelength_nm: f64, field_deg: [f64; 2], j: usize| {
            let mut coefficients_um = vec![0.0; j + 1];
            coefficients_um[j] = 0.1;
            WavefrontBand { wavelength_nm, field_deg, coefficients_um }
        };
        let bands = |nm: [f64; 2]| nm.map(|nm| band(nm, [0.0; 2], 4)).to_vec();
        let fields = |turned_about_axis: bool, list: &[([f64; 2], usize)]| WavefrontError {
            bands: list.iter().map(|(field_deg, j)| band(550.0, *field_deg, *j)).collect(),
            turned_about_axis,
            ..error(ZernikeTerms::Osa, vec![])
        };
        // Defocus on the axis, and coma along x or along y at 10°.
        assert!(fields(true, &[([0.0, 0.0], 4), ([10.0, 0.0], 8)]).check(0).is_ok());
        assert!(fields(true, &[([0.0, 0.0], 4), ([0.0, 10.0], 7)]).check(0).is_ok());
        assert!(fields(false, &[([5.0, 0.0], 7), ([0.0, 0.0], 8)]).check(0).is_ok());
        for wrong in [
            WavefrontError { radius_mm: 0.0, ..good() },
            WavefrontError { bands: vec![], ..good() },
            WavefrontError { bands: bands([600.0, 500.0]), ..good() },
            error(ZernikeTerms::Fringe, vec![0.0; 38]),
            error(ZernikeTerms::Osa, vec![f64::NAN]),
            WavefrontError { chromatic_eye_nm: Some(200.0), ..good() },
            fields(false, &[([90.0, 0.0], 4)]),
            fields(false, &[([0.0, 0.0], 4), ([5.0, 5.0], 4)]),
            fields(true, &[([0.0, 0.0], 8), ([10.0, 0.0], 8)]),
            fields(true, &[([0.0, 0.0], 4), ([10.0, 0.0], 7)]),
            fields(true, &[([5.0, 0.0], 4), ([10.0, 0.0], 4)]),
            fields(true, &[([0.0, 0.0], 4), ([5.0, 0.0], 4), ([0.0, 5.0], 4), ([5.0, 5.0], 4)]),
        ] {
            assert!(wrong.check(0).is_err(), "{wrong:?}");
        }
    }
}
