//! Blurs through an iris of blades: its outline and its light.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_optics::{FilmCone, Iris, Lens, ObjectPoint, Vignetting, glam::DVec2, rays_towards};
use dioptric_psf::{Diffraction, FilmQuery, ImageSettings, Kernel, LensImage, LensImageModel, PointImage};

const PITCH_UM: f64 = 6.0;
/// Pixels wide enough for some hundred counted rays in each.
const COUNTED_UM: f64 = 10.0;

fn stopped(lens: &Lens, iris: Iris, f_number: f64) -> Lens {
    lens.clone().with_iris(Some(iris)).unwrap().with_f_number(f_number, 550.0).unwrap()
}

/// The sums of a kernel's pixels, over the greatest of them in its middle part.
fn largest_difference(kernel: &Kernel, expected: &dyn Fn(i32, i32) -> f64) -> f64 {
    let plateau = kernel.samples.iter().copied().fold(0.0, f32::max);
    let [x_first, y_first] = first_px(kernel);
    let off = |((row, column), sample): ((usize, usize), &f32)| {
        (f64::from(sample / plateau) - expected(column as i32 + x_first, row as i32 + y_first)).abs()
    };
    kernel.samples.indexed_iter().map(off).fold(0.0, f64::max)
}

/// The first column and row of a kernel, from the point that it is about.
fn first_px(kernel: &Kernel) -> [i32; 2] {
    let (rows, columns) = kernel.samples.dim();
    [kernel.middle_px.x - (columns / 2) as i32, kernel.middle_px.y - (rows / 2) as i32]
}

/// A hexagon and a pentagon behind a thin lens, in small turns: every pixel holds the share of it that the polygon covers. An outline
/// half a pixel off would change pixels by a half.
#[test]
fn the_blur_of_a_thin_lens_is_the_opening() {
    for (blades, curvature) in [(6, 0.0), (5, 0.0), (6, 0.5), (9, 1.0)] {
        for turn in 0..4 {
            let iris = Iris { blades, rotation_deg: 5.3 * f64::from(turn), curvature };
            let lens = stopped(&Lens::thin(50.0, 25.0).unwrap(), iris, 4.0);
            let opening = lens.iris_opening().unwrap();
            let settings = ImageSettings::new(52.0, Diffraction::None);
            let (image_mm, film_mm) = (50.0, 52.0);
            let image = PointImage::trace(&lens, &settings, DVec2::ZERO, 0.0, 550.0).unwrap().unwrap();
            let (kernel, _) = image.kernel(PITCH_UM);
            // Behind its focus light has crossed; the picture is turned back.
            let px_per_mm = (film_mm / image_mm - 1.0) / (PITCH_UM * 1e-3);
            let outline: Vec<DVec2> = opening.outline_mm(60).iter().map(|at| *at * px_per_mm).collect();
            let is_inside = |at: DVec2| {
                outline.iter().zip(outline.iter().cycle().skip(1)).all(|(a, b)| (*b - *a).perp_dot(at - *a) >= 0.0)
            };
            let share = |x: i32, y: i32| {
                const N: i32 = 8;
                let at = |k: i32| f64::from(2 * k + 1) / f64::from(2 * N) - 0.5;
                let covered = |k: &i32| is_inside(DVec2::new(f64::from(x) + at(k % N), -f64::from(y) - at(k / N)));
                (0..N * N).filter(covered).count() as f64 / f64::from(N * N)
            };
            let off = largest_difference(&kernel, &share);
            assert!(off < 0.25, "{iris:?}: {off}");
        }
    }
}

/// A real lens, on the axis and in the vignetted corner, nearer and farther than its focus: against rays counted on pixels.
#[test]
fn the_blur_of_a_real_lens_is_that_of_counted_rays() {
    let iris = Iris { blades: 6, rotation_deg: 12.0, curvature: 0.2 };
    let lens = stopped(&Lens::built_in("dgauss-50mm").unwrap(), iris, 2.8);
    let mono = lens.at(550.0).unwrap();
    let film_distance_mm = mono.film_distance_mm_for(1000.0).unwrap();
    let settings = ImageSettings::new(film_distance_mm, Diffraction::None);
    for (field_deg, dioptres) in [(0.0f64, 0.2), (16.0, 0.2), (16.0, 2.0)] {
        let field_tan = DVec2::from_angle(0.4) * field_deg.to_radians().tan();
        let image = PointImage::trace(&lens, &settings, field_tan, dioptres, 550.0).unwrap().unwrap();
        let (kernel, _) = image.kernel(COUNTED_UM);
        let point = ObjectPoint::from_field(&mono, field_tan, dioptres);
        let half_mm = 0.75 * mono.first_order().entrance_pupil_diameter_mm;
        const N: usize = 1500;
        let at = |i: usize| (2.0 * (i as f64 + 0.5) / N as f64 - 1.0) * half_mm;
        let targets: Vec<DVec2> = (0..N * N).map(|i| DVec2::new(at(i % N), at(i / N))).collect();
        let mut rays = rays_towards(&point, &targets, mono.first_order().entrance_pupil_z_mm, 0.0);
        mono.trace_to_film(&mut rays, Vignetting::On, film_distance_mm);
        let landed: Vec<DVec2> =
            mono.landed(&rays, film_distance_mm).map(|place| place.in_picture_mm() - image.centroid_mm()).collect();
        let (rows, columns) = kernel.samples.dim();
        let [x_first, y_first] = first_px(&kernel);
        let mut counts = vec![0.0; rows * columns];
        for place in &landed {
            let px = *place * 1e3 / COUNTED_UM;
            let (column, row) = (px.x.round() as i32 - x_first, -px.y.round() as i32 - y_first);
            if (0..columns as i32).contains(&column) && (0..rows as i32).contains(&row) {
                counts[row as usize * columns + column as usize] += 1.0 / landed.len() as f64;
            }
        }
        // Pixels about the outline: those with light and darkness within two pixels.
        let lit: Vec<f64> = counts.iter().copied().filter(|count| *count > 0.0).collect();
        let plateau = lit.iter().sum::<f64>() / lit.len() as f64;
        let is_lit = |row: i32, column: i32| {
            let is_within = (0..rows as i32).contains(&row) && (0..columns as i32).contains(&column);
            is_within && counts[row as usize * columns + column as usize] > 0.5 * plateau
        };
        let (mut difference, mut n_edge) = (0.0, 0.0);
        for (row, column) in (0..rows as i32).flat_map(|row| (0..columns as i32).map(move |column| (row, column))) {
            let about = (-2..=2).flat_map(|i| (-2..=2).map(move |j| (i, j)));
            let n_lit = about.filter(|(i, j)| is_lit(row + i, column + j)).count();
            if (1..25).contains(&n_lit) {
                let count = counts[row as usize * columns + column as usize];
                difference += (f64::from(kernel.samples[(row as usize, column as usize)]) - count).abs() / plateau;
                n_edge += 1.0;
            }
        }
        // The band is four pixels wide: over its length, by how much the outline is off.
        let off_px = difference / (0.25 * n_edge);
        println!("{field_deg} degrees, {dioptres} dioptres: {} px, outline off by {off_px:.3} px", lit.len());
        assert!(off_px < 0.5, "{field_deg} degrees: an outline {off_px} px off");
    }
}

/// The film gets the light of the circle of as much area, and kernels from the film have the outline of those from the scene.
#[test]
fn the_light_on_the_film_is_that_of_the_f_number() {
    let iris = Iris { blades: 6, rotation_deg: 0.0, curvature: 0.0 };
    let thin = Lens::thin(50.0, 25.0).unwrap();
    let settings = ImageSettings::new(52.0, Diffraction::None);
    let [round, hexagon] = [None, Some(iris)].map(|iris| {
        let lens = thin.clone().with_iris(iris).unwrap().with_f_number(4.0, 550.0).unwrap();
        LensImageModel::new(&lens, &[550.0], &settings).unwrap()
    });
    assert!(round.is_symmetric() && !hexagon.is_symmetric());
    for place_mm in [DVec2::ZERO, DVec2::new(3.0, -1.0), DVec2::new(0.0, 8.0)] {
        let [a, b] = [&round, &hexagon].map(|image| image.film_map(550.0, 10.0).irradiance_sr(place_mm));
        // The square of the aperture's angle times the spread of radii about the circle's.
        assert!((b / a - 1.0).abs() < 1e-3, "{place_mm}: {a} {b}");
        let query = FilmQuery { place_mm, dioptres: 0.0, wavelength_nm: 550.0, pitch_um: 20.0 };
        let kernel = hexagon.kernel(query);
        let mono = hexagon.lens().at(550.0).unwrap();
        // The area of an even blur, but for what pixels at its edge hold in part.
        let squares: f64 = kernel.samples.iter().map(|sample| f64::from(*sample).powi(2)).sum();
        let (area_mm2, blur_mm2) = (0.02 * 0.02 / squares, PI * mono.stop_semi_aperture_mm().powi(2) * 0.04f64.powi(2));
        assert!((area_mm2 / blur_mm2 - 1.0).abs() < 0.06, "{area_mm2} {blur_mm2}");
        assert!((kernel.sum() - 1.0).abs() < 1e-6);
    }
}

/// The light over the film of a lens that is round but for its blades, in one sector and beyond: against rays counted from the film.
#[test]
fn the_light_on_the_film_is_that_of_counted_rays() {
    const N: usize = 600;
    for (blades, curvature, f_number) in [(6, 0.2, 2.8), (5, 0.0, 2.4), (3, 0.0, 4.0), (16, 0.0, 2.2)] {
        let iris = Iris { blades, rotation_deg: 12.0, curvature };
        let lens = stopped(&Lens::built_in("dgauss-50mm").unwrap(), iris, f_number);
        let mono = lens.at(550.0).unwrap();
        let (reversed, film_mm) = (mono.reversed(), 37.5);
        let image = LensImageModel::new(&lens, &[550.0], &ImageSettings::new(film_mm, Diffraction::None)).unwrap();
        let map = image.film_map(550.0, 21.0);
        let middle_sr = map.irradiance_sr(DVec2::ZERO);
        for (radius_mm, angle_deg) in
            [(0.0, 0.0), (4.1, 200.0), (9.3, 31.0), (13.9, 97.0), (16.4, 355.0), (20.3, 143.0f64)]
        {
            let place_mm = DVec2::from_angle(angle_deg.to_radians()) * radius_mm;
            // The picture is the film turned by 180°.
            let cone = FilmCone::new(&reversed, -place_mm, film_mm).unwrap();
            // Towards the axis, as far as the exit pupil is.
            let aim = place_mm / (film_mm + 18.0).hypot(radius_mm);
            let (half, step) = (0.32, 0.64 / N as f64);
            let at = |i: usize| (i as f64 + 0.5) * step - half;
            let sr = |sign: f64| {
                let cosines: Vec<DVec2> = (0..N * N).map(|i| sign * aim + DVec2::new(at(i % N), at(i / N))).collect();
                let mut rays = cone.rays(&cosines);
                reversed.trace(&mut rays, Vignetting::On);
                rays.n_in_flight() as f64 * step * step
            };
            // Whichever way cosines count.
            let counted_sr = sr(1.0).max(sr(-1.0));
            let found_sr = map.irradiance_sr(place_mm);
            // Surveys hold 1e-3 of the middle; a grid of rays counts to a few of the cells along the edge.
            assert!(
                (found_sr - counted_sr).abs() < 2e-3 * middle_sr,
                "{blades} blades, {radius_mm} mm at {angle_deg}°: {} {}",
                found_sr / middle_sr,
                counted_sr / middle_sr
            );
        }
    }
}
