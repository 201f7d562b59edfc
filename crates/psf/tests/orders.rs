//! The light of a diffraction order at wavelengths between those of a model.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use dioptric_optics::{Blaze, DiffractiveSurface, Lens, PhaseProfile, glam::DVec2};
use dioptric_psf::{BankSettings, Diffraction, FilmMap, LensImageModel};

/// A singlet with rings so weak that they bend nothing, of a high order: its share changes from 1 to 0 and back within 60 nm.
fn singlet(blaze: Option<Blaze>) -> Lens {
    let profile = PhaseProfile::Rings { radius_mm: 12.7, coefficients_rad: vec![-1e-7] };
    let lens = Lens::built_in("singlet-50mm").unwrap();
    lens.with_diffractive(vec![DiffractiveSurface { surface: 0, order: 8, profile, blaze }]).unwrap()
}

#[test]
fn share_of_an_order_is_exact_between_wavelengths_of_the_model() {
    let blaze = Blaze { design_nm: 550.0, order: None, levels: None };
    let (with, without) = (singlet(Some(blaze)), singlet(None));
    let radial = BankSettings::covering(50.0, 0.2, (0.0, 0.5), (420.0, 680.0), Diffraction::None);
    let ends = (DVec2::splat(-0.1), DVec2::splat(0.1));
    let grid = BankSettings::covering_grid(50.0, ends, (0.0, 0.5), (420.0, 680.0), Diffraction::None);
    for settings in [radial, grid] {
        let [with_blaze, all] = [&with, &without].map(|lens| LensImageModel::build(lens, &settings).unwrap());
        for wavelength_nm in [421.3, 489.0, 550.0, 571.0, 618.5, 680.0] {
            let gain = |model: &LensImageModel| {
                let map: FilmMap = model.film_map(0.25, wavelength_nm, 4.0);
                [DVec2::ZERO, DVec2::new(1.0, -2.0)].map(|at_mm| map.at(at_mm).unwrap().1)
            };
            let share = with.diffraction_efficiency_at(wavelength_nm).unwrap();
            for (found, whole) in gain(&with_blaze).into_iter().zip(gain(&all)) {
                // Of the largest share: some wavelengths are nearly dark.
                assert!((found / whole - share).abs() < 1e-12, "{wavelength_nm} nm: {} for {share}", found / whole);
            }
        }
    }
}
