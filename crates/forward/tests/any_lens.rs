//! Lenses without an axis of symmetry, the whole way from radiance to irradiance.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{Film, Settings, irradiance};
use dioptric_optics::{
    CoordinateBreak, Glass, Interface, Lens, ObjectPoint, PupilBoundary, Shape, Surface, Vignetting, rays_over_front,
    rays_towards,
};
use dioptric_psf::{Diffraction, ImageSettings, LensImage, LensImageModel, PsfError};
use dioptric_scene::{Scene, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

/// A lens with a film behind it.
struct Camera {
    lens: Lens,
    film: Film,
    film_distance_mm: f64,
    grid: WavelengthGrid,
}

impl Camera {
    fn model(&self) -> LensImageModel {
        let settings = ImageSettings::new(self.film_distance_mm, Diffraction::None);
        LensImageModel::new(&self.lens, self.grid.centers_nm(), &settings).unwrap()
    }

    fn image(&self, lens: &dyn LensImage, scene: &Scene) -> Vec<Array2<f32>> {
        let mut bands = vec![];
        irradiance(scene, lens, &self.film, &Settings::default(), &|_| {}, &mut |_, band| {
            bands.push(band);
            Ok(())
        })
        .unwrap();
        bands
    }
}

fn scene(planes: Vec<Array2<f32>>, grid: &WavelengthGrid, z_m: Array2<f32>, focal_px: f64) -> Scene {
    let (rows, columns) = planes[0].dim();
    let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), planes).unwrap();
    let (center_x_px, center_y_px) = (0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0));
    Scene {
        depth: Some(DepthMap::new(z_m).unwrap()),
        view: Some(View { focal_px, center_x_px, center_y_px }),
        ..Scene::new("test", radiance)
    }
}

fn double_gauss() -> Lens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap()
}

fn turned(surfaces: (usize, usize), pivot_mm: f64, tilt_deg: [f64; 3]) -> CoordinateBreak {
    CoordinateBreak { surfaces, pivot_mm, decenter_mm: [0.0; 3], tilt_deg, tilt_first: false }
}

/// A lens of two powers, 50 mm across and 40 mm up at 550 nm, its stop in front.
fn anamorphic() -> Lens {
    let surface = |radius_mm: f64, radius_x_mm: f64| Surface {
        shape: Shape::Biconic { conic: 0.0, curvature_x_per_mm: 1.0 / radius_x_mm, conic_x: 0.0 },
        ..Surface::sphere(radius_mm, 2.2)
    };
    let interface = |surface, index, thickness_after_mm| Interface {
        surface,
        medium_after: Glass::Constant { index },
        thickness_after_mm,
    };
    let interfaces = vec![interface(surface(40.0, 50.0), 1.5, 1.0), interface(surface(-40.0, -50.0), 1.0, 0.0)];
    Lens::new("anamorphic", "a test", interfaces, 0).unwrap()
}

#[test]
fn a_uniform_plane_gets_the_pupil_over_both_magnifications() {
    let lens = anamorphic();
    let mono = lens.at(550.0).unwrap();
    let film_distance_mm = 0.5 * (mono.first_order().bfl_mm + mono.first_order_x().bfl_mm);
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let film = Film::centered(64, 64, 20.0);
    let camera = Camera { lens, film, film_distance_mm, grid };
    let flat = |value| Array2::from_elem((400, 400), value);
    let picture = camera.image(&camera.model(), &scene(vec![flat(0.37)], &camera.grid, flat(1e4), 4000.0)).remove(0);
    // How far the light of a small field lands, and the pupil that it passes, traced here.
    let small = 1e-3;
    let center_mm = |field_tan: DVec2| {
        let point = ObjectPoint::from_field(&mono, field_tan, 0.0);
        let mut rays = rays_over_front(&mono, &point, 1000);
        mono.trace(&mut rays, Vignetting::On);
        mono.to_film(&mut rays, film_distance_mm);
        let through: Vec<usize> = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()).collect();
        through.iter().map(|&i| rays.point_mm(i).truncate()).sum::<DVec2>() / through.len() as f64
    };
    let [across_mm, up_mm] = [DVec2::X, DVec2::Y].map(|way| center_mm(way * small).length() / small);
    let pupil_mm2 =
        PupilBoundary::find(&mono, &ObjectPoint::from_field(&mono, DVec2::ZERO, 0.0), 96).unwrap().area_mm2();
    let ratio = f64::from(picture[(32, 32)]) / (0.37 * pupil_mm2 / (across_mm * up_mm));
    println!("{across_mm:.3} mm across, {up_mm:.3} mm up: ratio {ratio:.6}");
    // The bank's pupil is an outline of 48 corners.
    assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
}

#[test]
fn a_point_lands_where_the_rays_of_a_bent_lens_do() {
    let lens = double_gauss();
    let last = lens.interfaces().len() - 1;
    // The rear group turned both ways and moved aside.
    let group = CoordinateBreak { decenter_mm: [0.2, -0.3, 0.0], ..turned((last - 3, last), 3.0, [1.0, -0.7, 0.0]) };
    let lens = lens.with_moves(vec![group]).unwrap();
    let grid = WavelengthGrid::new(vec![420.0, 550.0, 680.0]).unwrap();
    let film = Film::centered(600, 900, 24.0);
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let (rows, columns, focal_px, z_m) = (640, 940, 2100.0, 1.6);
    let camera = Camera { lens, film, film_distance_mm, grid };
    let bank = camera.model();
    let reference = camera.lens.at(550.0).unwrap();
    for (row, column) in [(319_usize, 500_usize), (120, 800), (560, 100)] {
        let mut plane = Array2::zeros((rows, columns));
        plane[(row, column)] = 1.0;
        let scene = scene(vec![plane; 3], &camera.grid, Array2::from_elem((rows, columns), z_m as f32), focal_px);
        let (tan_x, tan_y) = scene.view.unwrap().tan_at(row as f64, column as f64);
        for (picture, &wavelength_nm) in camera.image(&bank, &scene).iter().zip(camera.grid.centers_nm()) {
            let lens = camera.lens.at(wavelength_nm).unwrap();
            let point = ObjectPoint::from_field(&reference, DVec2::new(tan_x, tan_y), 1.0 / z_m);
            let mut rays = rays_over_front(&lens, &point, 400);
            lens.trace(&mut rays, Vignetting::On);
            lens.to_film(&mut rays, film_distance_mm);
            let through: Vec<usize> = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()).collect();
            let mean = |of: &[f64]| through.iter().map(|&i| of[i]).sum::<f64>() / through.len() as f64;
            let expected = DVec2::new(449.5 - 1e3 * mean(&rays.x_mm) / 24.0, 299.5 + 1e3 * mean(&rays.y_mm) / 24.0);
            let sum: f64 = picture.iter().map(|&v| f64::from(v)).sum();
            let moments = picture.indexed_iter().map(|((r, c), &v)| DVec2::new(c as f64, r as f64) * f64::from(v));
            let found = moments.sum::<DVec2>() / sum;
            let off = found.distance(expected);
            println!("{wavelength_nm} nm at {row}, {column}: {off:.4} px off {expected:.2}");
            assert!(off < 0.1, "{wavelength_nm} nm: {found} is not {expected}");
        }
    }
}

#[test]
fn the_depth_in_focus_of_a_turned_lens_follows_the_hinge_rule() {
    // A lens turned by θ has its plane of focus through a line f / sin θ below its middle, so the dioptres in focus change by
    // sin θ / f with the tangent of the field: Merklinger, Focusing the View Camera (1996).
    let lens = double_gauss();
    let mono = lens.at(550.0).unwrap();
    let first = mono.first_order();
    let (theta_deg, last) = (2.0_f64, lens.interfaces().len() - 1);
    let film_distance_mm = mono.film_distance_mm_for(2000.0).unwrap();
    let tilted = lens.with_moves(vec![turned((0, last), first.front_principal_mm, [theta_deg, 0.0, 0.0])]).unwrap();
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let film = Film::centered(240, 240, 40.0);
    let camera = Camera { lens: tilted, film, film_distance_mm, grid };
    let bank = camera.model();
    let map = bank.film_map(550.0, film.half_diagonal_mm());
    let in_focus = |field_tan: DVec2| {
        let place_mm = map.place_mm(field_tan).unwrap();
        let blur = |dioptres: f64| bank.blur_radius_mm(place_mm, dioptres, 550.0);
        let (a, b) = (blur(0.3), blur(0.7));
        0.3 + 0.4 * a / (a - b)
    };
    let at = |tan_y: f64| in_focus(DVec2::Y * tan_y);
    let slope = (at(0.06) - at(-0.06)) / 0.12;
    let expected = theta_deg.to_radians().sin() / (1e-3 * first.efl_mm);
    println!("{slope:.4} dioptres for a unit tangent, {expected:.4} by the hinge rule");
    // Coma of the third order and the shift of the pupil with the lens take their part of the bar.
    assert!((slope.abs() / expected - 1.0).abs() < 0.03, "{slope} {expected}");
    assert!((in_focus(DVec2::X * 0.06) - in_focus(DVec2::X * -0.06)).abs() < 1e-3);
}

/// Pupils found here tell where the light of a turned lens ends: pictures of few fields and of many end there.
#[test]
fn light_through_a_turned_lens_ends_where_pupils_do() {
    let lens = double_gauss();
    let last = lens.interfaces().len() - 1;
    let lens = lens.with_moves(vec![turned((0, last), 0.0, [3.0, 1.0, 0.0])]).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let film = Film::centered(220, 240, 350.0);
    let camera = Camera { lens, film, film_distance_mm, grid };
    let flat = Array2::from_elem((300, 450), 1.0);
    let scene = scene(vec![flat.clone()], &camera.grid, 2.0 * flat, 130.0);
    let mono = camera.lens.at(550.0).unwrap();
    let pupil = |field_tan: DVec2| PupilBoundary::find(&mono, &ObjectPoint::from_field(&mono, field_tan, 0.5), 32);
    let lands_mm = |field_tan: DVec2| {
        let pupil = pupil(field_tan).unwrap();
        let point = ObjectPoint::from_field(&mono, field_tan, 0.5);
        let mut rays = rays_towards(&point, &[pupil.center_mm()], pupil.z_mm(), 0.0);
        mono.trace(&mut rays, Vignetting::On);
        mono.to_film(&mut rays, film_distance_mm);
        -DVec2::new(rays.x_mm[0], rays.y_mm[0])
    };
    {
        let model = camera.model();
        let picture = camera.image(&model, &scene).remove(0);
        let light = |at_mm: DVec2| {
            let (row, column) = (109.5 - at_mm.y / 0.35, 119.5 + at_mm.x / 0.35);
            f64::from(picture[(row.round() as usize, column.round() as usize)] / picture[(110, 120)])
        };
        for i in 0..24 {
            let way = DVec2::from_angle(0.1 + f64::from(i) * std::f64::consts::TAU / 24.0);
            let (mut lit, mut dark) = (0.2, 1.2);
            for _ in 0..12 {
                let middle = 0.5 * (lit + dark);
                if pupil(way * middle).is_some() { lit = middle } else { dark = middle }
            }
            let [inner_mm, outer_mm] = [0.9, 0.97].map(|share| lands_mm(share * lit * way));
            let [inside, rim, outside] = [inner_mm, outer_mm, outer_mm + (outer_mm - inner_mm)].map(light);
            println!("{i}: light ends at {lit:.4}; at .90 of that {inside:.4}, at .97 {rim:.4}, at 1.04 {outside:.5}");
            // The middle of the nearest pixel lies up to .25 mm farther out, at .979 of the end, where pupils leave .022 of the light; less the .005 that grids are off by.
            // The middle of the field where a point sees light last is blurred over millimeters, which is what is left beyond it.
            assert!(inside > 0.05 && rim > 0.015 && outside < 0.01, "{inside} {rim} {outside}");
        }
    }
}

/// A moved aside, or turned by nothing, a lens with an axis is traced point by point over the film and about its axis: both ways make one picture.
#[test]
fn picture_of_a_lens_without_an_axis_is_that_about_it() {
    let lens = double_gauss();
    let last = lens.interfaces().len() - 1;
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(1500.0).unwrap();
    let grid = WavelengthGrid::new(vec![450.0, 650.0]).unwrap();
    let film = Film::centered(120, 180, 160.0);
    let bars = Array2::from_shape_fn((240, 340), |(r, c)| if (r / 13 + c / 11) % 2 == 0 { 1.0 } else { 0.2 });
    let z_m = Array2::from_shape_fn((240, 340), |(_, c)| if c < 150 { 1.0 } else { 1.5 });
    // Turned by a millionth of a degree, it has no axis.
    let turned = lens.clone().with_moves(vec![turned((0, last), 0.0, [1e-6, 0.0, 0.0])]).unwrap();
    let pictures = [lens, turned].map(|lens| {
        let camera = Camera { lens, film, film_distance_mm, grid: grid.clone() };
        let scene = scene(vec![bars.clone(); 2], &camera.grid, z_m.clone(), 545.0);
        camera.image(&camera.model(), &scene)
    });
    for (a, b) in pictures[0].iter().zip(&pictures[1]) {
        let mean = b.mean().unwrap();
        let rms = (a - b).mapv(|d| (d / mean).powi(2)).mean().unwrap().sqrt();
        println!("rms difference {rms:.5} of the mean");
        // Tables of both are good to 1e-4; tiles of one are mirrored.
        assert!(rms < 2e-3, "{rms}");
    }
}

#[test]
fn a_lens_that_sends_no_light_to_the_film_is_told() {
    let lens = double_gauss();
    let last = lens.interfaces().len() - 1;
    let lens = lens.with_moves(vec![turned((0, last), 0.0, [60.0, 0.0, 0.0])]).unwrap();
    let error = LensImageModel::new(&lens, &[550.0], &ImageSettings::new(30.0, Diffraction::None)).unwrap_err();
    assert!(matches!(error, PsfError::Dark { .. }), "{error}");
}
