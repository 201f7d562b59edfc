//! The aberration at given places of the pupil, and the film where it is least.

use dioptric_optics::{MonoLens, ObjectPoint, analysis::PupilSampling};

use crate::{DiffractionError, PupilGrid, ReferenceSphere, Wavefront, WavefrontReference};

/// Returns the optical path of the chief ray less that of the rays through these places, waves, each up to the sphere
/// about the chief ray's film point (of the film as it is curved) through the paraxial exit pupil: positive where the wavefront is
/// ahead of the sphere, as `OpticStudio` and CODE V have it, and Welford, whose third-order sums have the same sign.
///
/// The chief ray is that through the middle of the pupil as the sampling has it: of the real stop, if it aims at that.
/// A ray that does not arrive has none; `None` altogether if not even the chief ray arrives.
pub fn opd_waves_at(
    lens: &MonoLens,
    point: &ObjectPoint,
    film_distance_mm: f64,
    sampling: &PupilSampling,
) -> Option<Vec<Option<f64>>> {
    let chief = sampling.chief().rays_on_film(lens, point, film_distance_mm);
    if !chief.fate[0].is_in_flight() {
        return None;
    }
    let sphere = ReferenceSphere::through_exit_pupil(lens, chief.point_mm(0));
    let chief_mm = sphere.paths_mm(lens, &chief)[0];
    let paths_mm = sphere.paths_mm(lens, &sampling.rays_on_film(lens, point, film_distance_mm));
    let waves = |path_mm: f64| (chief_mm - path_mm) / (lens.wavelength_nm() * 1e-6);
    Some(paths_mm.into_iter().map(|path_mm| path_mm.is_finite().then(|| waves(path_mm))).collect())
}

/// Returns the film's distance behind the last vertex at which the wavefront of a point is nearest to a sphere, and its
/// root mean square there, mm and waves.
///
/// The square of that is a parabola in the film's place, which three places fix; `film_distance_mm` is where to begin.
///
/// # Errors
/// As [`Wavefront::trace`].
pub fn best_wavefront_film_mm(
    lens: &MonoLens,
    point: &ObjectPoint,
    film_distance_mm: f64,
    grid: PupilGrid,
) -> Result<(f64, f64), DiffractionError> {
    let mean_square = |film_distance_mm: f64| {
        let wavefront = Wavefront::trace(lens, point, film_distance_mm, grid, WavefrontReference::Best)?;
        Ok::<f64, DiffractionError>(wavefront.rms_waves().powi(2))
    };
    let f_number = lens.first_order().f_number;
    let wave_mm = 8.0 * f_number * f_number * lens.wavelength_nm() * 1e-6;
    let mut best_mm = film_distance_mm;
    // Places ever closer together, by waves of defocus: the parabola bends by the step over the focal length.
    for step_mm in [1.0, 0.1, 0.01, 0.01].map(|waves| waves * wave_mm) {
        let [before, here, after] =
            [mean_square(best_mm - step_mm)?, mean_square(best_mm)?, mean_square(best_mm + step_mm)?];
        let bend = before - 2.0 * here + after;
        if bend > 0.0 {
            best_mm += 0.5 * step_mm * (before - after) / bend;
        }
    }
    Ok((best_mm, mean_square(best_mm)?.sqrt()))
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{
        Lens, Vignetting,
        analysis::{PupilCoordinates, pupil_line},
    };
    use glam::{DVec2, DVec3};

    use super::*;

    const FAR: ObjectPoint = ObjectPoint::Infinite(DVec3::Z);

    #[test]
    fn defocus_of_a_thin_lens_grows_with_the_square_of_the_pupil() {
        let lens = Lens::thin(50.0, 5.0).unwrap().at(550.0).unwrap();
        let sampling = PupilSampling {
            coordinates: PupilCoordinates::entrance(&lens),
            places: pupil_line(DVec2::Y, 5),
            rims: Vignetting::Off,
        };
        let waves = opd_waves_at(&lens, &FAR, 49.9, &sampling).unwrap();
        let sine2 = 0.05f64.powi(2) / (1.0 + 0.05f64.powi(2));
        let w20 = 0.1 * sine2 / 2.0 / 550e-6;
        for (found, place) in waves.iter().zip([-1.0f64, -0.5, 0.0, 0.5, 1.0]) {
            // Left out are the square of the defocus, 0.1 in 50, and the fourth power of the slope, 6e-4.
            // Of a film before the focus the wavefront lies behind the sphere.
            assert!((found.unwrap() + w20 * place * place).abs() < 3e-3 * w20, "{found:?} {w20}");
        }
    }

    #[test]
    fn the_same_rays_give_the_wavefronts_own_aberration() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(5.6, 550.0).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.05, 0.1), 0.5);
        let film_distance_mm = lens.film_distance_mm_for(2000.0).unwrap();
        let wavefront =
            Wavefront::trace(&lens, &point, film_distance_mm, PupilGrid::STANDARD, WavefrontReference::Chief).unwrap();
        let coordinates = PupilCoordinates::stop(&lens);
        let sampling = PupilSampling { coordinates, places: wavefront.pupil.clone(), rims: Vignetting::Off };
        let waves = opd_waves_at(&lens, &point, film_distance_mm, &sampling).unwrap();
        for (found, expected) in waves.iter().zip(&wavefront.opd_waves) {
            assert!((found.unwrap() - expected).abs() < 1e-8);
        }
    }

    #[test]
    fn spherical_aberration_is_balanced_half_way_to_the_marginal_focus() {
        let departure = |f_number: f64| {
            let lens = Lens::built_in("singlet-50mm").unwrap().with_f_number(f_number, 550.0).unwrap();
            let lens = lens.at(550.0).unwrap();
            let paraxial_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
            let edge = PupilSampling {
                coordinates: PupilCoordinates::entrance(&lens),
                places: vec![DVec2::Y],
                rims: Vignetting::Off,
            };
            let marginal = edge.rays_on_film(&lens, &FAR, paraxial_mm);
            let marginal_mm = paraxial_mm - marginal.y_mm[0] * marginal.n[0] / marginal.m[0];
            let grid = PupilGrid::STANDARD;
            let (best_mm, rms) = best_wavefront_film_mm(&lens, &FAR, paraxial_mm, grid).unwrap();
            for film_distance_mm in [best_mm - 0.02, best_mm + 0.02] {
                let there = Wavefront::trace(&lens, &FAR, film_distance_mm, grid, WavefrontReference::Best).unwrap();
                assert!(there.rms_waves() > rms);
            }
            (best_mm - paraxial_mm) / (marginal_mm - paraxial_mm) - 0.5
        };
        // The textbook's halfway (Born and Wolf 9.2), but for fifth order, which falls with the square of the aperture.
        let [wide, narrow] = [8.0, 16.0].map(departure);
        assert!(wide.abs() < 0.04 && (narrow / wide - 0.25).abs() < 0.05, "{wide} {narrow}");
    }
}
