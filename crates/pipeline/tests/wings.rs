//! What diffraction takes far from a lamp: its law on pixels of any width, and through parts of a pupil.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{f64::consts::PI, fs};

use dioptric_pipeline::{Camera, KeptCamera, Silent};
use dioptric_spectrum::{Bands, Cancel};
use ndarray::Array2;

/// A lamp in focus at 700 mm, near the axis of a lens of 50 mm, in a room that is all but dark and out of focus.
fn lamp(f_number: f64, pitch_um: f64, rest: &str) -> Array2<f32> {
    let folder = tempfile::tempdir().unwrap();
    let (x_mm, y_mm) = (0.0123 * pitch_um, 0.0071 * pitch_um);
    let points = format!("name,x_mm,y_mm,depth_m,candela,light\nlamp,{x_mm},{y_mm},0.7,150,3200K\n");
    fs::write(folder.path().join("lamp.csv"), points).unwrap();
    let text = format!(
        r#"(
            name: "lamp",
            lens: BuiltIn("dgauss-50mm"),
            stop: FNumber({f_number:?}),
            focus: DistanceMm(700.0),
            film: Pixels(columns: 120, rows: 80, pitch_um: {pitch_um:?}),
            sensor: BuiltIn("nikon-d5100"),
            scene: (
                source: StillLife(columns: 60, rows: 40),
                field_of_view_deg: 30.0,
                illuminance_lux: 1e-3,
                points: "lamp.csv",
            ),
            wavelengths: ListNm([550.0]),
            {rest}
        )"#
    );
    let camera = Camera::parse(&text, &folder.path().join("camera.ron")).unwrap();
    KeptCamera::new(camera).irradiance(&Silent, &Cancel::new()).unwrap().band(0).unwrap().into_owned()
}

/// The pixels of a picture with their distances from its brightest, and its light.
fn about_lamp(picture: &Array2<f32>) -> (Vec<(f64, f64)>, f64) {
    let brightest = picture.indexed_iter().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    let distance =
        |(row, column): (usize, usize)| f64::hypot(row as f64 - brightest.0 as f64, column as f64 - brightest.1 as f64);
    let pixels = picture.indexed_iter().map(|(at, light)| (distance(at), f64::from(*light))).collect();
    (pixels, picture.iter().map(|light| f64::from(*light)).sum())
}

/// A circle bends 2 λN / π² r of the light beyond a radius r: λN / π³ r³ lies on a pixel, N being that of the image, 1 + m times the lens's.
#[test]
fn wings_of_a_lamp_follow_the_law_of_round_edges_on_pixels_of_any_width() {
    for (f_number, pitch_um) in
        [(2.8, 3.0), (2.8, 20.0), (8.0, 6.0), (8.0, 10.0), (8.0, 60.0), (22.0, 20.0), (22.0, 50.0)]
    {
        let (pixels, all) = about_lamp(&lamp(f_number, pitch_um, "diffraction: Wave,"));
        let lambda_n_px = 0.55 * f_number * 1.077 / pitch_um;
        let first = (14.0 * lambda_n_px).max(10.0);
        for from in [first, 1.3 * first, 1.7 * first] {
            let ring = pixels.iter().filter(|(r, _)| (from..from + 1.5).contains(r));
            let (sum, n) = ring.fold((0.0, 0), |(sum, n), (r, light)| (sum + light * r.powi(3), n + 1));
            let ratio = sum / f64::from(n) / all / (lambda_n_px / PI.powi(3));
            // The law is that of radii large against λN; aberrations add some hundredths next to it.
            assert!((0.97..1.06).contains(&ratio), "f/{f_number}, {pitch_um} µm, {from:.1} pixels: {ratio:.3}");
        }
    }
}

/// Of a lens with blades parts of the pupil make the star of the whole.
#[test]
fn views_have_the_star_of_the_whole_pupil() {
    let of = |rest: &str| lamp(16.0, 10.0, &format!("diffraction: Hurb(gamma: 1.0), iris: Some((blades: 6)), {rest}"));
    let ((whole, all), (views, _)) = (about_lamp(&of("")), about_lamp(&of("blur: Views(4),")));
    let far = whole.iter().zip(&views).filter(|((r, _), _)| *r > 15.0);
    let (whole, views): (Vec<f64>, Vec<f64>) = far.map(|(whole, views)| (whole.1, views.1)).unzip();
    let off: f64 = whole.iter().zip(&views).map(|(whole, views)| (whole - views).abs()).sum();
    assert!(off < 0.05 * whole.iter().sum::<f64>(), "{off} of {all}");
    // Spikes: most of that light lies in few pixels.
    let mut sorted = whole.clone();
    sorted.sort_by(|a, b| b.total_cmp(a));
    assert!(sorted[..whole.len() / 10].iter().sum::<f64>() > 0.6 * whole.iter().sum::<f64>());
}
