//! Lenses described from the film, held to rays traced back from it one by one.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{
    CoordinateBreak, Lens, MonoLens, RayBatch, Vignetting,
    glam::{DVec2, DVec3},
};
use dioptric_psf::{Diffraction, FilmMap, FilmQuery, ImageSettings, Kernel, LensImage, LensImageModel};

const NM: f64 = 550.0;

/// A built-in lens and the distance of a film on which it is in focus, mm.
fn in_focus(name: &str) -> (Lens, f64) {
    let lens = Lens::built_in(name).unwrap();
    let mono = lens.at(NM).unwrap();
    let film_mm = [f64::INFINITY, 2000.0, 200.0].into_iter().find_map(|mm| mono.film_distance_mm_for(mm).ok());
    (lens, film_mm.unwrap())
}

fn model(lens: &Lens, film_distance_mm: f64, diffraction: Diffraction) -> LensImageModel {
    LensImageModel::new(lens, &[NM], &ImageSettings::new(film_distance_mm, diffraction)).unwrap()
}

fn query(place_mm: DVec2, dioptres: f64, pitch_um: f64) -> FilmQuery {
    FilmQuery { place_mm, dioptres, wavelength_nm: NM, pitch_um }
}

/// Rays traced back from a point of the film, of equal projected solid angle: the point and direction of those that get through, and the
/// irradiance over the radiance that all of them make up.
struct Counted {
    rays: Vec<(DVec3, DVec3)>,
    irradiance_sr: f64,
}

impl Counted {
    fn at(lens: &MonoLens, film_distance_mm: f64, place_mm: DVec2, n_across: usize) -> Self {
        let site = lens.film_site(-place_mm, film_distance_mm).unwrap();
        let reversed = lens.reversed();
        let plane = lens.surface_placement(lens.n_surfaces() - 1);
        let trace = |low: DVec2, high: DVec2, n: usize| {
            let step = (high - low) / n as f64;
            let mut rays = RayBatch::with_capacity(n * n);
            let mut cosines = vec![];
            for i in 0..n * n {
                let at = low + step * (DVec2::new((i % n) as f64, (i / n) as f64) + 0.5);
                if at.length_squared() >= 0.998 {
                    continue;
                }
                let axes = lens.film_placement(film_distance_mm).rotation;
                let direction = axes * at.extend(-(1.0 - at.length_squared()).sqrt());
                let to_plane = (plane.vertex_mm - site.point_mm).dot(plane.rotation.z_axis);
                let along = to_plane / direction.dot(plane.rotation.z_axis);
                rays.push(site.point_mm + direction * along, direction, 0.0);
                cosines.push(at);
            }
            reversed.trace(&mut rays, Vignetting::On);
            let lit: Vec<usize> = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()).collect();
            let bounds = lit.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &i| {
                (low.min(cosines[i]), high.max(cosines[i]))
            });
            (lit.iter().map(|&i| (rays.point_mm(i), rays.direction(i))).collect::<Vec<_>>(), bounds, step)
        };
        let (_, (low, high), step) = trace(DVec2::NEG_ONE, DVec2::ONE, 160);
        if !low.is_finite() {
            return Self { rays: vec![], irradiance_sr: 0.0 };
        }
        let (rays, _, step) = trace(low - step, high + step, n_across);
        let per_index = (lens.image_index() / lens.object_index()).powi(2);
        let irradiance_sr = rays.len() as f64 * step.x * step.y * per_index;
        Self { rays, irradiance_sr }
    }

    /// Returns the rays of a depth on pixels, as a kernel about a point of the film has them.
    fn on_pixels(&self, map: &FilmMap, center_z_mm: f64, query: &FilmQuery, like: &Kernel) -> Vec<f64> {
        let (rows, columns) = like.samples.dim();
        let mut pixels = vec![0.0; rows * columns];
        for (point_mm, direction) in &self.rays {
            let slope = direction.truncate() / -direction.z;
            let in_plane_mm = point_mm.truncate() + slope * (point_mm.z - center_z_mm);
            let tan = slope + in_plane_mm * (1e-3 * query.dioptres);
            let off = (query.place_mm - map.place_mm(tan).unwrap()) * DVec2::new(1e3, -1e3) / query.pitch_um;
            let at = off - like.middle_px.as_dvec2() + 0.5 * DVec2::new(columns as f64, rows as f64);
            if at.x >= 0.0 && at.y >= 0.0 && at.x < columns as f64 && at.y < rows as f64 {
                pixels[at.y as usize * columns + at.x as usize] += 1.0 / self.rays.len() as f64;
            }
        }
        pixels
    }
}

/// Of every built-in lens, points and directions are each other's inverse, and the irradiance is that of counted rays, out to the corner or
/// where light ends.
#[test]
fn irradiance_is_that_of_counted_rays() {
    for name in Lens::built_in_names() {
        let (lens, film_distance_mm) = in_focus(name);
        for f_number in [None, Some(11.0)] {
            let Ok(lens) = f_number.map_or(Ok(lens.clone()), |n| lens.with_f_number(n, NM)) else { continue };
            let mono = lens.at(NM).unwrap();
            let model = model(&lens, film_distance_mm, Diffraction::None);
            let reach_mm = 0.45 * mono.first_order().efl_mm.abs().min(48.0);
            let map = model.film_map(NM, reach_mm);
            let brightest =
                (0..40).map(|i| map.irradiance_sr(DVec2::X * reach_mm * f64::from(i) / 39.0)).fold(0.0, f64::max);
            for share in [0.0, 0.55, 0.9] {
                let place_mm = share * reach_mm * DVec2::new(0.8, -0.6);
                let counted = Counted::at(&mono, film_distance_mm, place_mm, 280).irradiance_sr;
                let off = (map.irradiance_sr(place_mm) - counted) / brightest;
                // Counting on a grid is off by some 4e-4; the table by 1e-4.
                assert!(off.abs() < 1e-3, "{name} {f_number:?} at {place_mm}: {off}");
                let Some(tan) = map.field_tan(place_mm) else { continue };
                let back_mm = map.place_mm(tan).unwrap();
                assert!((back_mm - place_mm).length() < 1e-6 * reach_mm, "{name}: {back_mm} {place_mm}");
            }
        }
    }
}

/// In focus and out of it, on the axis and where rims cut the pupil.
#[test]
fn kernels_are_those_of_counted_rays() {
    for (name, f_number, share, dioptres, pitch_um) in [
        ("dgauss-50mm", 2.0, 0.0, 1.0, 10.0),
        ("dgauss-50mm", 2.0, 0.7, 1.0, 10.0),
        ("dgauss-50mm", 4.0, 0.9, 0.6, 5.0),
        ("tessar-50mm", 4.0, 0.9, 1.0, 10.0),
        ("fisheye-12.5mm", 4.0, 1.0, 6.0, 4.0),
        ("asphere-15mm", 1.5, 0.3, 4.0, 10.0),
        ("singlet-50mm", 8.0, 0.6, 0.5, 10.0),
    ] {
        let (lens, film_distance_mm) = in_focus(name);
        let lens = lens.with_f_number(f_number, NM).unwrap();
        let mono = lens.at(NM).unwrap();
        let model = model(&lens, film_distance_mm, Diffraction::None);
        let reach_mm = 0.4 * mono.first_order().efl_mm;
        let map = model.film_map(NM, reach_mm);
        let query = query(share * reach_mm * DVec2::new(0.8, 0.6), dioptres, pitch_um);
        let kernel = model.kernel(query);
        assert!((kernel.sum() - 1.0).abs() < 1e-5, "{name}: {}", kernel.sum());
        let counted = Counted::at(&mono, film_distance_mm, query.place_mm, 700);
        let pixels = counted.on_pixels(&map, mono.projection_center_z_mm(), &query, &kernel);
        let held: f64 = pixels.iter().sum();
        assert!(held > 0.999, "{name}: the window holds {held}");
        let l1: f64 = kernel.samples.iter().zip(&pixels).map(|(a, b)| (f64::from(*a) - b).abs()).sum();
        let n_lit = pixels.iter().filter(|energy| **energy > 0.0).count() as f64;
        // Rays on a grid are less uneven than drawn ones; outlines of 48 corners are off by about 1 %.
        let noise = (n_lit / counted.rays.len() as f64).sqrt();
        println!("{name} f/{f_number} {share}: L1 {l1:.4}, noise {noise:.4}, {} px", kernel.samples.nrows());
        assert!(l1 < 0.015f64.hypot(noise), "{name} at {share}: {l1}");
    }
}

/// The window of a lens whose axis is dark: its light is where counted rays find it (finding O3).
#[dioptric_golden::needs_shared]
#[test]
fn window_off_the_axis_is_lit() {
    let path = dioptric_golden::shared("inputs/optics/offaxis_window.ron").unwrap();
    let lens = Lens::read(&path).unwrap();
    let film_distance_mm = 90.0;
    let mono = lens.at(NM).unwrap();
    let model = model(&lens, film_distance_mm, Diffraction::None);
    let map = model.film_map(NM, 40.0);
    let (mut n_lit, mut light) = (0, DVec2::ZERO);
    let brightest = (-40..40).map(|y| map.irradiance_sr(DVec2::Y * f64::from(y))).fold(0.0, f64::max);
    for y in -40..40 {
        let place_mm = DVec2::new(2.3, f64::from(y));
        let counted = Counted::at(&mono, film_distance_mm, place_mm, 280).irradiance_sr;
        let off = (map.irradiance_sr(place_mm) - counted) / brightest;
        // Points of the grid lie 2 mm apart, over which the light of the window comes and goes.
        assert!(off.abs() < 0.2, "{place_mm}: {} {counted}", map.irradiance_sr(place_mm));
        light += DVec2::new(map.irradiance_sr(place_mm), counted);
        n_lit += usize::from(counted > 0.0);
    }
    assert!(n_lit > 3 && (light.x / light.y - 1.0).abs() < 0.02, "{n_lit} {light}");
}

/// Beyond 90° there are no tangents, but light and kernels.
#[test]
fn fisheye_sees_more_than_half_of_space() {
    let (lens, film_distance_mm) = in_focus("fisheye-12.5mm");
    let model = model(&lens, film_distance_mm, Diffraction::Hurb { gamma: 1.0 });
    let map = model.film_map(NM, 30.0);
    for radius in 0..60 {
        let place_mm = DVec2::new(0.5 * f64::from(radius), 0.1);
        assert!(map.irradiance_sr(place_mm) >= 0.0);
        assert!(map.field_tan(place_mm).is_none_or(|tan| tan.is_finite()), "{place_mm}");
        let kernel = model.kernel(query(place_mm, 0.5, 10.0));
        assert!((kernel.sum() - 1.0).abs() < 1e-5, "{place_mm}: {}", kernel.sum());
    }
}

/// A lens moved sideways as a whole sees what it sees where it stands, and one that is tilted is met by a grid.
#[test]
fn moved_and_tilted_lenses_are_those_of_counted_rays() {
    let (lens, film_distance_mm) = in_focus("dgauss-50mm");
    let lens = lens.with_f_number(2.8, NM).unwrap();
    let last = lens.interfaces().len() - 1;
    let step = |surfaces, decenter_mm, tilt_x_deg| CoordinateBreak {
        surfaces,
        pivot_mm: 0.0,
        decenter_mm,
        tilt_deg: [tilt_x_deg, 0.0, 0.0],
        tilt_first: false,
    };
    let lenses = [
        ("moved", step((0, last), [2.0, -3.0, 0.0], 0.0)),
        ("tilted group", step((last - 1, last), [0.0; 3], 0.5)),
        ("tilted film", step((last + 1, last + 1), [0.0; 3], 4.0)),
    ];
    for (name, step) in lenses {
        let lens = lens.clone().with_moves(vec![step]).unwrap();
        let mono = lens.at(NM).unwrap();
        let model = model(&lens, film_distance_mm, Diffraction::None);
        let map = model.film_map(NM, 16.0);
        let center_z_mm = mono.projection_center_z_mm();
        for place_mm in [DVec2::new(0.3, 0.2), DVec2::new(7.0, -9.0), DVec2::new(-3.0, 12.0)] {
            let counted = Counted::at(&mono, film_distance_mm, place_mm, 500);
            let off = map.irradiance_sr(place_mm) / counted.irradiance_sr - 1.0;
            println!("{name} {place_mm}: irradiance {off:.2e}");
            assert!(off.abs() < 2e-3, "{name} at {place_mm}: {off}");
            let query = query(place_mm, 1.2, 40.0);
            let kernel = model.kernel(query);
            let pixels = counted.on_pixels(&map, center_z_mm, &query, &kernel);
            let l1: f64 = kernel.samples.iter().zip(&pixels).map(|(a, b)| (f64::from(*a) - b).abs()).sum();
            println!("{name} {place_mm}: L1 {l1:.4}");
            assert!(l1 < 0.04, "{name} at {place_mm}: {l1}");
        }
    }
}

/// Whoever asks first, and however many at once.
#[test]
fn threads_do_not_change_kernels() {
    let (lens, film_distance_mm) = in_focus("tessar-50mm");
    let kernels = |n_threads: usize| -> Vec<Kernel> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            use rayon::prelude::*;
            let model = model(&lens, film_distance_mm, Diffraction::Hurb { gamma: 1.0 });
            model.film_map(NM, 20.0);
            let at = |i: u32| query(DVec2::new(f64::from(i), 3.0), 0.3, 8.0);
            (0..16).into_par_iter().map(|i| model.kernel(at(i))).collect()
        })
    };
    assert_eq!(kernels(1), kernels(4));
}

/// Lenses of the examples, among them a phone's, whose film lies closer to its last surface than that is deep.
#[test]
fn lenses_of_files_are_lit_to_the_corner() {
    for (name, film_distance_mm, nm, reach_mm) in [("phone", 0.63, 460.0, 3.0), ("phone", 0.63, 620.0, 3.0)] {
        let path: std::path::PathBuf =
            [env!("CARGO_MANIFEST_DIR"), "../../examples/lenses", &format!("{name}.ron")].iter().collect();
        let lens = Lens::read(&path).unwrap();
        let settings = ImageSettings::new(film_distance_mm, Diffraction::None);
        let model = LensImageModel::new(&lens, &[nm], &settings).unwrap();
        let map = model.film_map(nm, reach_mm);
        let mono = lens.at(nm).unwrap();
        let brightest = map.irradiance_sr(DVec2::ZERO);
        for share in [0.0, 0.4, 0.8, 1.0] {
            let place_mm = share * reach_mm * DVec2::new(0.8, 0.6);
            let counted = Counted::at(&mono, film_distance_mm, place_mm, 280).irradiance_sr;
            let off = (map.irradiance_sr(place_mm) - counted) / brightest;
            println!("{name} {place_mm}: {counted:.4} sr, off by {off:.1e}");
            assert!(off.abs() < 1.5e-3 && counted > 0.0, "{name} at {place_mm}: {off}");
        }
    }
}
