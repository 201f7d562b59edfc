//! Internal absorption of glass: extinction coefficients of the built-in catalogue, and the light that media let through.

use std::{collections::HashMap, sync::LazyLock};

use glam::DVec3;

use crate::{Glass, GlassCatalogue, Lens, MonoLens, OpticsError, RayBatch, Vignetting, glass::interpolate};

const BUILT_IN: &str = include_str!("../data/glass/extinction.csv");

/// The extinction coefficients of the built-in catalogue.
struct Table {
    grids_nm: Vec<Vec<f64>>,
    /// By full name: the grid, and k at its wavelengths in 1e-9.
    rows: HashMap<String, (usize, Vec<f64>)>,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let mut table = Table { grids_nm: Vec::new(), rows: HashMap::new() };
    for line in BUILT_IN.lines().filter(|line| !line.starts_with('#')) {
        let cells: Vec<&str> = line.split(',').collect();
        let numbers = |text: &str| {
            text.split(' ').map(|word| word.parse().expect("a test reads every row")).collect::<Vec<f64>>()
        };
        match cells[..] {
            [_, grid] => table.grids_nm.push(numbers(grid)),
            [maker, name, grid, values] => {
                let grid = grid.parse().expect("a test reads every row");
                table.rows.insert(format!("{maker}:{name}"), (grid, numbers(values)));
            }
            _ => {}
        }
    }
    table
});

impl Glass {
    /// Returns the extinction coefficient k at a wavelength, where it is known: for 1,625 of the named glasses, from
    /// about 360 to 1060 nm, and for those whose file states it, with straight lines between the points of the
    /// measurement. Air has none.
    ///
    /// The numbers are the makers' measurements of internal transmission, as refractiveindex.info has them; below about
    /// 1e-8 they scatter by a fifth.
    pub fn extinction_at(&self, wavelength_nm: f64) -> Option<f64> {
        match self {
            Self::Air | Self::AirAt(_) => Some(0.0),
            Self::Named(name) => {
                let glass = GlassCatalogue::built_in().find(name).ok()?;
                let (grid, values) = TABLE.rows.get(&glass.full_name())?;
                let grid_nm = &TABLE.grids_nm[*grid];
                within(grid_nm, wavelength_nm).then(|| 1e-9 * interpolate(grid_nm, values, wavelength_nm))
            }
            Self::Absorbing { wavelengths_nm, extinctions, .. } => {
                within(wavelengths_nm, wavelength_nm).then(|| interpolate(wavelengths_nm, extinctions, wavelength_nm))
            }
            _ => None,
        }
    }

    /// Returns the share of light of a (vacuum) wavelength that is left behind a path through the glass,
    /// `exp(−4π k d / λ)`, where k is known. Reflection at surfaces is not in it.
    pub fn internal_transmittance(&self, wavelength_nm: f64, path_mm: f64) -> Option<f64> {
        self.extinction_at(wavelength_nm).map(|k| (-absorption_per_mm(k, wavelength_nm) * path_mm).exp())
    }
}

impl Glass {
    /// Returns the glass with extinction coefficients k at wavelengths (nm), in any order; the glass itself where there
    /// are none. Of several at one wavelength the first stands.
    pub(crate) fn with_extinction(self, mut rows: Vec<(f64, f64)>) -> Self {
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.dedup_by_key(|row| row.0);
        if rows.is_empty() {
            return self;
        }
        let (wavelengths_nm, extinctions) = rows.into_iter().unzip();
        Self::Absorbing { law: Box::new(self), wavelengths_nm, extinctions }
    }
}

/// Returns the extinction coefficient of a medium that lets this share of light of a (vacuum) wavelength through, k of
/// Beer and Lambert's law `exp(−4π k d / λ)`.
pub(crate) fn extinction_of_share(share: f64, wavelength_nm: f64, path_mm: f64) -> f64 {
    // A share of one is a k of 0, not of −0.
    (1e-6 * wavelength_nm / (4.0 * std::f64::consts::PI) * -share.ln() / path_mm).max(0.0)
}

/// Whether a wavelength is within an ascending table.
fn within(grid_nm: &[f64], wavelength_nm: f64) -> bool {
    matches!((grid_nm.first(), grid_nm.last()), (Some(first), Some(last)) if (*first..=*last).contains(&wavelength_nm))
}

/// Returns the absorption coefficient of a medium of this extinction coefficient, 1/mm.
fn absorption_per_mm(k: f64, wavelength_nm: f64) -> f64 {
    4.0 * std::f64::consts::PI * k / (1e-6 * wavelength_nm)
}

/// Internal absorption of the media of a lens at one wavelength.
///
/// It stands beside the lens, so that a trace that does not ask for it pays nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Absorption {
    /// Before the first surface.
    object_per_mm: f64,
    /// Behind each surface.
    per_mm: Vec<f64>,
    unknown: Vec<usize>,
    is_object_unknown: bool,
}

impl Lens {
    /// Returns the internal absorption of the media of the lens at a wavelength.
    ///
    /// A medium whose extinction is not known counts as clear; [`unknown_behind`](Absorption::unknown_behind) names it.
    ///
    /// # Errors
    /// When the wavelength is not a positive number.
    pub fn absorption_at(&self, wavelength_nm: f64) -> Result<Absorption, OpticsError> {
        if !(wavelength_nm > 0.0 && wavelength_nm.is_finite()) {
            return Err(OpticsError::Wavelength { wavelength_nm });
        }
        let (mut per_mm, mut unknown) = (Vec::new(), Vec::new());
        for (surface, interface) in self.interfaces().iter().enumerate() {
            let k = interface.medium_after.extinction_at(wavelength_nm);
            if k.is_none() {
                unknown.push(surface);
            }
            per_mm.push(k.map_or(0.0, |k| absorption_per_mm(k, wavelength_nm)));
        }
        let object = self.object_medium().extinction_at(wavelength_nm);
        let object_per_mm = object.map_or(0.0, |k| absorption_per_mm(k, wavelength_nm));
        Ok(Absorption { object_per_mm, per_mm, unknown, is_object_unknown: object.is_none() })
    }
}

impl Absorption {
    /// Of the medium behind each surface, 1/mm.
    pub(crate) fn per_mm(&self) -> &[f64] {
        &self.per_mm
    }

    /// The surfaces behind which lies a medium whose extinction is not known at the wavelength.
    pub fn unknown_behind(&self) -> &[usize] {
        &self.unknown
    }

    /// Whether the extinction of the medium that the object is in is not known at the wavelength.
    pub fn is_unknown_before(&self) -> bool {
        self.is_object_unknown
    }

    /// Traces rays through all surfaces of the lens, as [`MonoLens::trace`] does, and returns for each the share of its
    /// light that the media on its way let through, from where it starts to the last surface or to where it ended.
    ///
    /// The lens must be the one that the absorption was made of. The way from the last surface to the film is not
    /// counted. Rays pass the lens frame between surfaces, which moves them by some 1e-13 mm.
    pub fn trace(&self, lens: &MonoLens, rays: &mut RayBatch, rims: Vignetting) -> Vec<f64> {
        assert_eq!(self.per_mm.len(), lens.n_surfaces(), "the absorption of this lens");
        let mut depth = vec![0.0; rays.len()];
        for surface in 0..lens.n_surfaces() {
            let per_mm = surface.checked_sub(1).map_or(self.object_per_mm, |before| self.per_mm[before]);
            let before: Vec<(DVec3, DVec3)> = match per_mm == 0.0 {
                true => Vec::new(),
                false => (0..rays.len()).map(|i| (rays.point_mm(i), rays.direction(i))).collect(),
            };
            let is_in_flight: Vec<bool> = rays.fate.iter().map(|fate| fate.is_in_flight()).collect();
            lens.trace_surfaces(surface..surface + 1, rays, rims);
            for (i, (point, direction)) in before.into_iter().enumerate().filter(|(i, _)| is_in_flight[*i]) {
                depth[i] += per_mm * (rays.point_mm(i) - point).dot(direction);
            }
        }
        depth.into_iter().map(|depth| (-depth).exp()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Interface, Surface};

    #[test]
    fn every_row_is_read_and_is_of_a_glass_of_the_catalogue() {
        assert_eq!(TABLE.rows.len(), 1625);
        for (name, (grid, values)) in &TABLE.rows {
            let grid_nm = &TABLE.grids_nm[*grid];
            assert_eq!(GlassCatalogue::built_in().find(name).unwrap().full_name(), *name);
            assert_eq!(grid_nm.len(), values.len(), "{name}");
            assert!(grid_nm.windows(2).all(|two| two[0] < two[1]) && values.iter().all(|k| (0.0..1e6).contains(k)));
        }
    }

    #[test]
    fn crown_is_clear_and_flint_yellow_as_their_data_sheets_say() {
        let share = |name: &str, nm: f64, mm: f64| Glass::Named(name.to_owned()).internal_transmittance(nm, mm);
        // The maker's data sheets state three decimals.
        for (name, nm, mm, expected) in
            [("N-BK7", 400.0, 10.0, 0.997), ("N-BK7", 400.0, 25.0, 0.992), ("N-BK7", 365.0, 10.0, 0.988)]
        {
            let found = share(name, nm, mm).unwrap();
            assert!((found - expected).abs() <= 6e-4, "{name} {nm} nm: {found}, expected {expected}");
        }
        assert!(share("N-SF11", 400.0, 10.0).unwrap() < 0.9 && share("N-SF11", 600.0, 10.0).unwrap() > 0.99);
        assert_eq!(share("N-BK7", 300.0, 10.0), None);
        assert_eq!(Glass::Constant { index: 1.5 }.internal_transmittance(550.0, 10.0), None);
        assert_eq!(Glass::Air.internal_transmittance(550.0, 1e6), Some(1.0));
    }

    #[test]
    fn light_is_lost_over_the_path_that_each_ray_takes() {
        let glass = Glass::Named("SCHOTT:N-SF11".to_owned());
        let plane = |medium_after, thickness_after_mm| Interface {
            surface: Surface::plane(20.0),
            medium_after,
            thickness_after_mm,
        };
        let interfaces =
            vec![plane(glass.clone(), 8.0), plane(Glass::Constant { index: 1.4 }, 3.0), plane(Glass::Air, 0.0)];
        let lens = Lens::new("plates", "test", interfaces, 0).unwrap();
        let absorption = lens.absorption_at(420.0).unwrap();
        assert_eq!(absorption.unknown_behind(), [1]);
        let (sine, lens) = (0.5_f64, lens.at(420.0).unwrap());
        let tilted = DVec3::new(0.0, sine, (1.0 - sine * sine).sqrt());
        let mut rays = RayBatch::from_points(&[DVec3::ZERO; 3], &[DVec3::Z, tilted, tilted]);
        rays.y_mm[2] = 30.0;
        let shares = absorption.trace(&lens, &mut rays, Vignetting::On);
        let index = glass.index_at(420.0).unwrap();
        let path_mm = 8.0 / (1.0 - (sine / index).powi(2)).sqrt();
        for (share, path_mm) in shares.iter().zip([8.0, path_mm, 0.0]) {
            let expected = glass.internal_transmittance(420.0, path_mm).unwrap();
            assert!((share - expected).abs() < 1e-15, "{share} {expected}");
        }
        assert!(shares[0] < 0.95);
        // The rays themselves are those of a trace in one go.
        let mut same = RayBatch::from_points(&[DVec3::ZERO; 2], &[DVec3::Z, tilted]);
        lens.trace(&mut same, Vignetting::On);
        assert!((same.point_mm(1) - rays.point_mm(1)).length() < 1e-13 && same.fate[..] == rays.fate[..2]);
    }
}
