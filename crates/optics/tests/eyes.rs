//! Schematic eyes, beside what is published of them.

use dioptric_optics::{D_LINE_NM, Lens, LensFile, SchematicEye};

/// The wavelength that they are stated at, nm.
const EYE_NM: f64 = 589.3;

/// Returns the power at a wavelength, dioptres, and the accommodation at which the retina is in focus.
fn power_and_focus(name: &str, wavelength_nm: f64) -> (f64, f64) {
    let file = LensFile::built_in(name).expect("an eye");
    let lens = file.lens.at(wavelength_nm).expect("media that are known");
    let retina_mm = file.film_distance_mm.expect("a retina");
    // Light of a far object that comes together behind the retina: −n/s of the vitreous, seen through the eye.
    let first = lens.first_order();
    let focus = lens.object_distance_mm_for(retina_mm).map_or_else(
        |_| (first.bfl_mm - retina_mm) * -1e-3 * first.power_per_mm.powi(2) * 1e6 / first.image_index,
        |object_mm| 1e3 / object_mm,
    );
    (1e3 * first.power_per_mm, focus)
}

#[test]
fn le_grands_eyes_have_their_published_powers() {
    // 59.940 and 67.677 D, the second in focus at 7.053 D (Atchison and Smith 2000, Optics of the Human Eye, appendix 3).
    let (power, focus) = power_and_focus("eye:legrand", EYE_NM);
    assert!((power - 59.940).abs() < 1e-3 && focus.abs() < 1e-3, "{power} {focus}");
    let (power, focus) = power_and_focus("eye:legrand:7.05D", EYE_NM);
    assert!((power - 67.677).abs() < 1e-3 && (focus - 7.053).abs() < 1e-3, "{power} {focus}");
    // The entrance pupil lies 3.038 mm behind the cornea.
    let first = Lens::built_in("eye:legrand").unwrap().at(EYE_NM).unwrap().first_order();
    assert!((first.entrance_pupil_z_mm - 3.038).abs() < 1e-3, "{}", first.entrance_pupil_z_mm);
}

#[test]
fn navarros_eye_has_its_published_power_and_accommodates() {
    // 60.416 D; the table of its media is rounded to 1e-5, which is 0.02 D.
    let (power, focus) = power_and_focus("eye:navarro", EYE_NM);
    assert!((power - 60.416).abs() < 0.02 && focus.abs() < 0.02, "{power} {focus}");
    // Its formulas follow the accommodation to a third of a dioptre.
    for dioptres in [1.0, 2.0, 4.0, 6.0, 8.0, 10.0] {
        let (_, focus) = power_and_focus(&format!("eye:navarro:{dioptres}D"), EYE_NM);
        assert!((focus - dioptres).abs() < 0.35, "{dioptres}: {focus}");
    }
}

#[test]
fn the_arizona_eye_is_in_focus_where_it_is_accommodated_to() {
    for dioptres in [0.0, 1.0, 2.0, 4.0, 6.0, 8.0] {
        let (_, focus) = power_and_focus(&format!("eye:arizona:{dioptres}D"), D_LINE_NM);
        assert!((focus - dioptres).abs() < 0.07, "{dioptres}: {focus}");
    }
}

/// A blue that is out of focus by the chromatic eye's 1.7 D from 450 to 650 nm (Thibos and others 1992), to a fifth.
#[test]
fn colors_are_apart_as_in_the_chromatic_eye() {
    let chromatic = |nm: f64| 1.68524 - 633.46 / (nm - 214.102);
    let expected = chromatic(650.0) - chromatic(450.0);
    for name in ["eye:navarro", "eye:arizona", "eye:legrand"] {
        let [blue, red] = [450.0, 650.0].map(|nm| power_and_focus(name, nm).1);
        assert!(((blue - red) / expected - 1.0).abs() < 0.2, "{name}: {} {expected}", blue - red);
    }
}

#[test]
fn names_say_whose_eye_and_how_far_it_accommodates() {
    let eye = LensFile::built_in("eye:arizona:2.5D").unwrap();
    assert_eq!((eye.lens.name(), eye.object_distance_mm), ("eye:arizona:2.5D", Some(400.0)));
    assert_eq!(LensFile::built_in("eye:navarro").unwrap().object_distance_mm, None);
    for (wrong, expected) in [
        ("eye", "schematic eyes are named eye:navarro"),
        ("eye:gullstrand", "schematic eyes are named eye:navarro"),
        ("eye:navarro:4", "schematic eyes are named eye:navarro"),
        ("eye:navarro:12D", "accommodates by 0 to 10 D"),
        ("eye:navarro:-1D", "accommodates by 0 to 10 D"),
        ("eye:navarro:NaND", "accommodates by 0 to 10 D"),
        ("eye:legrand:3D", "known relaxed and at 7.05D"),
    ] {
        let message = Lens::built_in(wrong).unwrap_err().to_string();
        assert!(message.contains(expected), "{wrong}: {message}");
    }
    assert!(SchematicEye::named("eyepiece").is_none());
}
