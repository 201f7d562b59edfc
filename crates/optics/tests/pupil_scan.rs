//! Pupils and spots of built-in lenses against rays counted one by one: a small part of what the example `pupil_scan` compares.

mod counted;

use counted::{cross_section_mm2, spot_rms_mm};
use dioptric_optics::{
    Lens, MonoLens, ObjectPoint, PupilBoundary, PupilRegion,
    analysis::{Autofocus, PupilLight, PupilRule},
    glam::{DVec2, DVec3},
};
use rayon::prelude::*;

fn lenses() -> Vec<(&'static str, MonoLens)> {
    let open = |name| (name, Lens::built_in(name).expect("a built-in lens").at(550.0).expect("glasses that are known"));
    Lens::built_in_names().map(open).collect()
}

#[test]
fn fields_have_the_light_of_counted_rays() {
    // 300 rays across count a disc to 300 to the power −1.5, 2e-4, and a cat's eye or crescent to some times that; of the last light it
    // is what the standard error of the count explains.
    let check = |(name, fields_deg): &(&str, [f64; 5])| {
        let lens = Lens::built_in(name).expect("a built-in lens").at(550.0).expect("glasses that are known");
        for field_deg in fields_deg {
            let point = ObjectPoint::far(field_deg.to_radians(), DVec2::new(0.28, 0.96));
            let cosine = |region: &PupilRegion| point.direction_to(DVec3::ZERO).dot(region.plane().normal());
            let region = PupilRegion::find(&lens, &point, 128).expect("light");
            let (found, (counted, error)) =
                (region.area_mm2() * cosine(&region), cross_section_mm2(&lens, &point, 300));
            let differ = (found - counted).abs();
            assert!(differ < 2e-3 * counted + 4.0 * error, "{name} {field_deg}: {found} {counted} {error}");
            assert!(PupilBoundary::find(&lens, &point, 64).is_some(), "{name} {field_deg}");
        }
    };
    [
        // The last light: between what misses the front, what is totally reflected and what the rims stop.
        ("paper-2el", [77.0, 82.5, 86.5, 90.0, 90.5]),
        ("achromat-100mm", [82.0, 88.0, 90.5, 92.0, 92.5]),
        ("singlet-50mm", [88.0, 90.0, 91.5, 92.0, 92.5]),
        ("asphere-15mm", [62.0, 80.0, 86.5, 88.5, 89.0]),
        ("fisheye-12.5mm", [104.0, 106.5, 107.5, 109.0, 109.5]),
        ("dgauss-50mm", [0.0, 10.0, 18.0, 24.0, 26.0]),
        ("canon-50mm", [0.0, 9.0, 17.0, 24.0, 27.0]),
        ("wide-100deg", [0.0, 20.0, 40.0, 50.0, 52.0]),
        ("fisheye-12.5mm", [0.0, 40.0, 70.0, 90.0, 100.0]),
        ("singlet-50mm", [0.0, 30.0, 60.0, 75.0, 84.0]),
        ("asphere-15mm", [0.0, 30.0, 50.0, 65.0, 72.0]),
    ]
    .par_iter()
    .for_each(check);
}

#[test]
fn axial_spots_are_those_of_counted_rays() {
    let compare = |(name, lens): &(&str, MonoLens)| {
        let axis = ObjectPoint::Infinite(DVec3::Z);
        let rule = PupilRule::of_rings(12);
        let Ok(from_mm) = lens.film_distance_mm_for(f64::INFINITY) else { return };
        let points = [axis];
        let focus = Autofocus::alike(std::slice::from_ref(lens), &points, rule);
        let (best_mm, least_mm) = focus.best_film_mm(from_mm).expect("light on the axis");
        let rms_mm = |film_mm: f64| {
            let light = PupilLight::to_film(lens, &axis, film_mm, rule).expect("light on the axis");
            assert!((light.weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let (_, [xx, yy, _]) = light.moments(lens, film_mm);
            (xx + yy).sqrt()
        };
        assert!((rms_mm(best_mm) / least_mm - 1.0).abs() < 1e-6, "{name}: {} {least_mm}", rms_mm(best_mm));
        // Out of focus, where the rim, of which rays are hard to count, has no more than its share of the squares.
        let film_mm = best_mm + 8.0 * least_mm * lens.first_order().f_number;
        let (found, counted) = (rms_mm(film_mm), spot_rms_mm(lens, &axis, film_mm, 600).expect("light on the axis"));
        // 600 rays across count a disc to 600 to the power −1.5, 7e-5, and its rim has some times its share of the squares.
        assert!((found / counted - 1.0).abs() < 7e-4, "{name}: {found} {counted}");
    };
    lenses().par_iter().for_each(compare);
}

#[test]
fn light_beside_an_obscuration_has_the_moments_of_a_ring() {
    use dioptric_optics::{Aperture, Outline};
    let thin = Lens::thin(50.0, 10.0).unwrap();
    let hole =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm: 2.5 }, center_mm: [0.0; 2], is_obscuration: true };
    let lens = Lens::new_with_apertures("annulus", "test", thin.interfaces().to_vec(), 0, vec![hole]).unwrap();
    let lens = lens.at(550.0).unwrap();
    let light = PupilLight::to_film(&lens, &ObjectPoint::Infinite(DVec3::Z), 48.0, PupilRule::of_rings(4)).unwrap();
    // 2 mm before the focus the ring from 2.5 to 5 mm is from 0.1 to 0.2 mm: ⟨r²⟩ is the mean of both squares.
    let (centroid_mm, [xx, yy, xy]) = light.moments(&lens, 48.0);
    assert!(((xx + yy) / 0.025 - 1.0).abs() < 1e-9 && centroid_mm.length() < 1e-12 && xy.abs() < 1e-12, "{xx} {yy}");
}
