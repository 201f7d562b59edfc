//! Which way point spread functions point: coma, astigmatism and color against third-order theory and chief rays.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_diffraction::Covariance;
use dioptric_optics::{Lens, MonoLens, ObjectPoint, SeidelSettings, analysis::AstigmaticFoci, glam::DVec2};
use dioptric_psf::{Diffraction, ImageSettings, Picture, PointImage};

/// Returns the image of a far point.
fn image_of(lens: &Lens, film_distance_mm: f64, field_tan: DVec2, wavelength_nm: f64) -> Option<PointImage> {
    let settings =
        ImageSettings { n_rings: 24, n_azimuths: 96, ..ImageSettings::new(film_distance_mm, Diffraction::None) };
    PointImage::trace(lens, &settings, field_tan, 0.0, wavelength_nm).unwrap()
}

/// Returns where its centroid lies, mm to the right of the picture, of a field to the right.
fn centroid_mm(lens: &Lens, film_distance_mm: f64, field_tan: f64, wavelength_nm: f64) -> Option<f64> {
    Some(image_of(lens, film_distance_mm, DVec2::X * field_tan, wavelength_nm)?.centroid_mm().x)
}

/// Returns where the chief ray of a far point in a field to the right lands, mm to the right of the picture.
fn chief_mm(lens: &Lens, film_distance_mm: f64, field_tan: f64, wavelength_nm: f64) -> f64 {
    let reference = lens.at(550.0).unwrap();
    let point = ObjectPoint::from_field(&reference, DVec2::new(field_tan, 0.0), 0.0);
    // The picture is the film turned by 180°.
    -lens.at(wavelength_nm).unwrap().chief_film_point_mm(&point, film_distance_mm).unwrap().x
}

fn paraxial_film_mm(lens: &MonoLens) -> f64 {
    lens.film_distance_mm_for(f64::INFINITY).unwrap()
}

/// Returns the place of the brightest pixel, µm from the middle of the picture.
fn brightest_um(picture: &Picture) -> DVec2 {
    let energy = picture.energy();
    let ((row, column), _) = energy.indexed_iter().max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    let (rows, columns) = energy.dim();
    DVec2::new(column as f64 - (columns / 2) as f64, (rows / 2) as f64 - row as f64) * picture.pitch_um()
}

#[test]
fn coma_points_as_its_seidel_sum_says() {
    let mut signs = vec![];
    for name in
        ["singlet-50mm", "achromat-100mm", "paper-2el", "dgauss-50mm", "tessar-50mm", "cooke-50mm", "telephoto-250mm"]
    {
        let lens = Lens::built_in(name).unwrap().with_f_number(24.0, 550.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        let field_tan = 0.01;
        let settings = SeidelSettings {
            wavelength_nm: 550.0,
            colors_nm: [500.0, 600.0],
            object_distance_mm: f64::INFINITY,
            chief_slope: field_tan,
        };
        let first = mono.first_order();
        let slope = 0.5 * first.entrance_pupil_diameter_mm / first.efl_mm;
        // The wavefront S2/2 ρ³ cos φ moves rays by its slope over n'u' (W. T. Welford, Aberrations of Optical Systems,
        // 1986, ch. 8), where u' of a converging cone is below 0. The mean of 3 y² + x² over the pupil is 1, so the
        // centroid lies S2/(2 n'u') from the chief ray, in the direction of the image: a negative sum turns the tail
        // outwards.
        let s2 = lens.seidel(&settings).unwrap().total.s2;
        let expected_mm = -s2 / (2.0 * slope);
        let film_distance_mm = paraxial_film_mm(&mono);
        let centroid_mm = centroid_mm(&lens, film_distance_mm, field_tan, 550.0).unwrap();
        let found_mm = centroid_mm - chief_mm(&lens, film_distance_mm, field_tan, 550.0);
        println!("{name}: {:.5} µm of coma, {:.5} expected", 1e3 * found_mm, 1e3 * expected_mm);
        // What is of fifth order falls with the square of the f-number, to some hundredths at f/24.
        assert!((found_mm / expected_mm - 1.0).abs() < 0.07, "{name}: {found_mm} {expected_mm}");
        signs.push(expected_mm > 0.0);
    }
    assert!(signs.contains(&true) && signs.contains(&false), "both signs of coma are among them");
}

#[test]
fn the_head_of_a_comet_is_at_the_chief_ray() {
    // Lenses of which a narrow pupil has little but coma at this field.
    for (name, f_number, field_tan) in [("achromat-100mm", 4.0, 0.02), ("paper-2el", 5.0, 0.05)] {
        let lens = Lens::built_in(name).unwrap().with_f_number(f_number, 550.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        // Between the foci of the close rays astigmatism and curvature are least.
        let point = ObjectPoint::from_field(&mono, DVec2::new(field_tan, 0.0), 0.0);
        let foci = AstigmaticFoci::find(&mono, &point).unwrap();
        let film_distance_mm = 0.5 * (foci.tangential_mm + foci.sagittal_mm);
        let image = |field_tan: DVec2| image_of(&lens, film_distance_mm, field_tan, 550.0).unwrap();
        let beside = image(DVec2::X * field_tan);
        let chief_from_centroid_um =
            1e3 * (chief_mm(&lens, film_distance_mm, field_tan, 550.0) - beside.centroid_mm().x);
        let pitch_um = 0.2 * chief_from_centroid_um.abs();
        let (kernel, _) = beside.kernel(pitch_um);
        let head_um = brightest_um(&Picture::from(&kernel)).x;
        println!("{name}: head at {head_um:.2} µm, chief ray at {chief_from_centroid_um:.2} µm of the centroid");
        assert!(head_um * chief_from_centroid_um > 0.0, "{name}");
        // To two pixels of a fifth of the distance: the head is where rays crowd about the chief ray.
        assert!((head_um - chief_from_centroid_um).abs() < 0.45 * chief_from_centroid_um.abs(), "{name}");
        // The comet in a field above is the same comet, turned.
        let above = Picture::from(&image(DVec2::Y * field_tan).kernel(pitch_um).0);
        assert!((brightest_um(&above).y - head_um).abs() < 1.01 * pitch_um, "{name}");
    }
}

/// Returns the second moments of a far point in a field of this length and direction, on pixels of this size.
fn moments(lens: &Lens, film_distance_mm: f64, field_tan: DVec2, pitch_um: f64) -> Covariance {
    let image = image_of(lens, film_distance_mm, field_tan, 550.0).unwrap();
    Picture::from(&image.kernel(pitch_um).0).second_moments_um2()
}

#[test]
fn astigmatism_flips_through_focus() {
    for name in ["singlet-50mm", "achromat-100mm", "paper-2el", "tessar-50mm", "cooke-50mm", "canon-50mm"] {
        // So narrow that close rays are what there is.
        let lens = Lens::built_in(name).unwrap().with_f_number(30.0, 550.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        let field_tan = 0.12;
        let point = ObjectPoint::from_field(&mono, DVec2::new(field_tan, 0.0), 0.0);
        let foci = AstigmaticFoci::find(&mono, &point).unwrap();
        // An even disc's standard deviation is a quarter of its width.
        let line_um = 1e3 * (foci.sagittal_mm - foci.tangential_mm).abs() / 30.0 / 4.0;
        let at = |film_distance_mm, turn: DVec2| {
            moments(&lens, film_distance_mm, turn.normalize() * field_tan, 0.1 * line_um)
        };
        let (at_tangential, at_sagittal) = (at(foci.tangential_mm, DVec2::X), at(foci.sagittal_mm, DVec2::X));
        println!("{name}: line of {line_um:.3} µm, {at_tangential:?}, {at_sagittal:?}");
        // Rays in the plane of the axis come together in a line across it, and the others in one along it: a third as
        // wide as long at most, for at f/30 other aberrations are small beside it; a field's pupil is a little narrower.
        for (narrow, wide) in [(at_tangential.xx, at_tangential.yy), (at_sagittal.yy, at_sagittal.xx)] {
            assert!(narrow.sqrt() < 0.33 * wide.sqrt(), "{name}: {narrow} {wide}");
            assert!((wide.sqrt() / line_um - 1.0).abs() < 0.15, "{name}: {} {line_um}", wide.sqrt());
        }
        // Above the axis the lines are turned with the field; at 45° they are oblique. Pixels add a little.
        let (above, oblique) = (at(foci.tangential_mm, DVec2::Y), at(foci.tangential_mm, DVec2::ONE));
        assert!((above.yy - at_tangential.xx).abs() < 0.01 * at_tangential.yy, "{name}");
        let expected = 0.5 * (at_tangential.xx - at_tangential.yy);
        assert!((oblique.xy / expected - 1.0).abs() < 0.02, "{name}: {} {expected}", oblique.xy);
    }
}

#[test]
fn colors_are_ordered_as_their_chief_rays() {
    let nm = [450.0, 550.0, 650.0];
    let mut orders = vec![];
    for name in Lens::built_in_names() {
        let built_in = Lens::built_in(name).unwrap();
        let lens = built_in.with_f_number(32.0, 550.0).unwrap_or(built_in);
        let field_tan = 0.08;
        let film_distance_mm = paraxial_film_mm(&lens.at(550.0).unwrap());
        let centroids = nm.map(|nm| centroid_mm(&lens, film_distance_mm, field_tan, nm));
        let [Some(blue), Some(green), Some(red)] = centroids else { continue };
        let centroids = [blue, green, red].map(|mm| 1e3 * mm);
        let chiefs = nm.map(|nm| 1e3 * chief_mm(&lens, film_distance_mm, field_tan, nm));
        println!(
            "{name}: centroids {:.2} {:.2}, chief rays {:.2} {:.2} µm off green",
            centroids[0] - centroids[1],
            centroids[2] - centroids[1],
            chiefs[0] - chiefs[1],
            chiefs[2] - chiefs[1]
        );
        for i in [0, 2] {
            let (centroid, chief) = (centroids[i] - centroids[1], chiefs[i] - chiefs[1]);
            // Coma and the middle of the pupil differ from color to color; at f/32 by less than 0.2 µm.
            assert!((centroid - chief).abs() < 0.1 * chief.abs() + 0.2, "{name}: {centroid} {chief}");
        }
        if (chiefs[0] - chiefs[2]).abs() > 1.0 {
            assert_eq!(centroids[0] > centroids[2], chiefs[0] > chiefs[2], "{name}");
            orders.push(chiefs[0] > chiefs[2]);
        }
    }
    assert!(orders.len() > 4 && orders.contains(&true) && orders.contains(&false), "{orders:?}");
}
