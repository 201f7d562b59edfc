//! Lenses described from the film, held to rays that are traced the other way and counted.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::time::Instant;

use dioptric_optics::{
    Lens, MonoLens, ObjectPoint,
    analysis::projected_solid_angle,
    glam::DVec2,
};
use dioptric_psf::{Diffraction, FilmQuery, ImageSettings, LensImage, LensImageModel};

/// A built-in lens and the distance of a film on which it is in focus, mm.
fn in_focus(name: &str) -> (Lens, f64) {
    let lens = Lens::built_in(name).unwrap();
    let mono = lens.at(550.0).unwrap();
    let film_mm = [f64::INFINITY, 2000.0, 200.0].into_iter().find_map(|mm| mono.film_distance_mm_for(mm).ok());
    let film_mm = film_mm.unwrap_or(100.0);
    (lens, film_mm)
}

#[test]
fn every_built_in_lens_has_an_image() {
    for name in Lens::built_in_names() {
        let (lens, film_distance_mm) = in_focus(name);
        let t = Instant::now();
        let settings = ImageSettings::new(film_distance_mm, Diffraction::Hurb { gamma: 1.0 });
        let model = LensImageModel::new(&lens, &[550.0], &settings).unwrap();
        let reach = 0.3 * lens.at(550.0).unwrap().first_order().efl_mm.abs().min(100.0);
        let t1 = t.elapsed();
        let map = model.film_map(550.0, reach);
        let t2 = t.elapsed();
        let q = |x: f64| FilmQuery { place_mm: DVec2::new(0.6 * x, 0.8 * x), dioptres: model.focus_dioptres(), wavelength_nm: 550.0, pitch_um: 4.0 };
        let k = [0.0, 0.3, 0.7, 1.0].map(|s| model.kernel(q(s * reach)));
        let t3 = t.elapsed();
        let line: Vec<String> = [0.0, 0.3, 0.7, 1.0].iter().zip(&k).map(|(s, k)| format!("I {:.2e} tan {:?} k {}+{}", map.irradiance_sr(q(s * reach).place_mm), map.field_tan(q(s * reach).place_mm).map(|t| t.length()), k.samples.nrows(), k.middle_px)).collect();
        println!("{name} new {t1:?} map {t2:?} 4 kernels {:?}: {}", t3 - t2, line.join("; "));
        for s in [0.01, 0.3, 0.5, 0.7, 0.9] {
            let at = q(s * reach).place_mm;
            let tan = map.field_tan(at).unwrap();
            let back = map.place_mm(tan).unwrap();
            assert!((back - at).length() < 1e-6 * reach, "{name} {s}");
        }
    }
}

#[test]
fn irradiance_is_that_of_sharp_points() {
    for name in ["dgauss-50mm", "tessar-50mm", "fisheye-12.5mm", "singlet-50mm"] {
        for f_number in [None, Some(4.0), Some(11.0)] {
        let (lens, film_distance_mm) = in_focus(name);
        let lens = match f_number { Some(f) => match lens.with_f_number(f, 550.0) { Ok(l) => l, Err(_) => continue }, None => lens };
        let mono: MonoLens = lens.at(550.0).unwrap();
        let settings = ImageSettings::new(film_distance_mm, Diffraction::None);
        let model = LensImageModel::new(&lens, &[550.0], &settings).unwrap();
        let map = model.film_map(550.0, 20.0);
        for r in [0.0, 2.0, 5.0, 8.0, 10.0, 12.0, 15.0, 18.0, 20.0] {
            let at = DVec2::X * r;
            let Some(tan) = map.field_tan(at) else { continue };
            let expected = projected_solid_angle(&mono, &ObjectPoint::from_field(&mono, tan, model.focus_dioptres()), 96);
            println!("{name} {f_number:?} {r}: {:.5} {:.3e}", map.irradiance_sr(at) / expected, expected);
        }
        }
    }
}
