//! Lens files written and read again.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    Field, Glass, Interface, Lens, LensFile, ObjectPoint, RayBatch, ReadOptions, Shape, Surface, Vignetting,
    glam::DVec2, rays_towards,
};

fn read(name: &str, text: &str) -> LensFile {
    LensFile::from_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Returns rays of a field of half a degree, behind the lens.
fn traced(lens: &Lens, wavelength_nm: f64) -> RayBatch {
    let mono = lens.at(wavelength_nm).unwrap();
    let first = mono.first_order();
    let at = |i: usize| 0.05 * first.entrance_pupil_diameter_mm * (i as f64 - 10.0);
    let targets: Vec<DVec2> = (0..441).map(|i| DVec2::new(at(i / 21), at(i % 21))).collect();
    let point = ObjectPoint::from_field(&mono, DVec2::new(0.0, 0.01), 0.0);
    let mut rays = rays_towards(&point, &targets, first.entrance_pupil_z_mm, 0.0);
    mono.trace(&mut rays, Vignetting::On);
    rays
}

/// Checks that two lenses send rays the same way, to rounding: a radius and its curvature are two roundings apart.
#[track_caller]
fn check_same(a: &Lens, b: &Lens, wavelength_nm: f64) {
    let (a, b) = (traced(a, wavelength_nm), traced(b, wavelength_nm));
    assert_eq!(a.fate, b.fate);
    assert!(a.fate.iter().filter(|fate| fate.is_in_flight()).count() > 50);
    for i in 0..a.len() {
        let moved = [a.x_mm[i] - b.x_mm[i], a.y_mm[i] - b.y_mm[i], a.l[i] - b.l[i], a.m[i] - b.m[i]];
        assert!(moved.iter().all(|difference| difference.abs() <= 1e-12), "ray {i}: {moved:?}");
    }
}

/// A cemented group with an inner stop, an asphere and glasses of the kinds that Zemax files hold.
fn design() -> LensFile {
    let surface = |radius_mm: f64, semi_aperture_mm| Surface::sphere(radius_mm, semi_aperture_mm);
    let interface = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    let asphere = Surface {
        shape: Shape::EvenAsphere { conic: -0.3, coefficients: vec![1.234_567_890_123e-6, -2.5e-9] },
        ..surface(41.3, 9.0)
    };
    let interfaces = vec![
        interface(asphere, Glass::Named("SCHOTT:N-BK7".to_owned()), 4.1),
        interface(surface(-38.7, 9.0), Glass::NdVd { nd: 1.62, vd: 36.3 }, 2.05),
        interface(surface(-120.9, 9.0), Glass::Air, 3.3),
        interface(Surface::plane(6.0), Glass::Air, 2.2),
        interface(
            Surface { shape: Shape::Conic { conic: 0.7 }, ..surface(77.7, 8.0) },
            Glass::Constant { index: 1.5 },
            3.0,
        ),
        interface(surface(-90.1, 8.0), Glass::Air, 0.0),
    ];
    let mut file = LensFile::from(Lens::new("a design", "made up", interfaces, 3).unwrap());
    file.film_distance_mm = Some(37.25);
    file.wavelengths_nm = vec![486.1327, 550.0, 656.2725];
    file.reference_wavelength_nm = Some(550.0);
    file.fields = [0.0, 3.0].map(|y_deg| Field::Angle { x_deg: 0.0, y_deg }).to_vec();
    file.wavelength_weights = vec![0.5, 1.0, 0.25];
    file.field_weights = vec![1.0, 2.0];
    file.surface_comments = ["front", "", "", "iris", "back", ""].map(str::to_owned).to_vec();
    file.comments = vec!["a second line".to_owned()];
    file
}

#[test]
fn zemax_file_reads_back_as_the_same_system() {
    let file = design();
    let again = read("a.zmx", &file.to_zmx().unwrap());
    assert_eq!(again, file);
}

#[test]
fn iset_file_traces_the_same_at_the_wavelengths_of_the_file() {
    let file = design();
    let again = read("a.json", &file.to_omni_json().unwrap());
    assert_eq!((again.lens.name(), again.lens.stop()), ("a design", 3));
    for &nm in &file.wavelengths_nm {
        check_same(&again.lens, &file.lens, nm);
    }
    let refracting_stop = Lens::new("s", "s", design().lens.interfaces().to_vec(), 4).unwrap();
    let text = LensFile::from(refracting_stop.clone()).to_omni_json().unwrap();
    check_same(&read("s.json", &text).lens, &refracting_stop, 550.0);
    assert!(text.contains("\"stop\": true") && text.contains("\"radius\": null"));
}

#[test]
fn dat_file_traces_the_same_at_its_one_wavelength() {
    for name in ["dgauss-50mm", "paper-2el"] {
        let mut file = LensFile::from(Lens::built_in(name).unwrap());
        file.reference_wavelength_nm = Some(550.0);
        let again = read("a.dat", &file.to_dat().unwrap());
        assert_eq!((again.lens.name(), again.lens.stop()), (name, file.lens.stop()));
        check_same(&again.lens, &file.lens, 550.0);
    }
}

#[test]
fn every_built_in_lens_reads_back_from_what_can_hold_it() {
    let folder = std::env::temp_dir().join(format!("dioptric-write-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut n_written = [0; 4];
    for name in Lens::built_in_names() {
        let mut file = LensFile::from(Lens::built_in(name).unwrap());
        file.wavelengths_nm = vec![550.0];
        file.reference_wavelength_nm = Some(550.0);
        for (n_written, extension) in n_written.iter_mut().zip(["ron", "dat", "json", "zmx"]) {
            let path = folder.join(format!("{name}.{extension}"));
            match file.write(&path) {
                Ok(()) => {
                    check_same(&Lens::read(&path).unwrap(), &file.lens, 550.0);
                    *n_written += 1;
                }
                Err(error) => {
                    assert_ne!(extension, "ron", "{error}");
                    assert!(error.to_string().contains("cannot hold this lens: "), "{error}");
                }
            }
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
    let n_lenses = Lens::built_in_names().count();
    assert_eq!((n_written[0], n_written[2]), (n_lenses, n_lenses), "our own format and ISET's hold them all");
    assert!(n_written[1] >= 3 && n_written[3] >= 3, "{n_written:?}");
}

#[test]
fn what_a_format_cannot_hold_is_named() {
    let message = design().to_dat().unwrap_err().to_string();
    assert_eq!(message, "a .dat file cannot hold this lens: surface 0 is not a sphere");
    let linear = LensFile::from(Lens::built_in("paper-2el").unwrap()).to_zmx().unwrap_err().to_string();
    assert!(linear.starts_with("a .zmx file cannot hold this lens: surface 0 has behind it the medium of"), "{linear}");
    let thin = LensFile::from(Lens::thin(50.0, 10.0).unwrap());
    assert!(thin.to_omni_json().unwrap_err().to_string().contains("surface 0 is neither a sphere"));
    assert!(
        thin.write(Path::new("a.step")).unwrap_err().to_string().contains("expected .ron, .dat, .json, .zmx or .seq")
    );
}

#[test]
fn glasses_of_the_lens_alone_go_into_a_catalogue_beside_the_zemax_file() {
    let mut file = design();
    let mut interfaces = file.lens.interfaces().to_vec();
    let own = Glass::Sellmeier { b: vec![1.2, 0.3], c_um2: vec![0.01, 90.0], range_nm: Some((400.0, 800.0)) };
    (interfaces[0].medium_after, interfaces[4].medium_after) = (own.clone(), own);
    interfaces[1].medium_after = Glass::Cauchy { a: 1.6, b_um2: 0.008 };
    file.lens = Lens::new("a design", "made up", interfaces, 3).unwrap();
    assert!(file.to_zmx().unwrap_err().to_string().contains("a Sellmeier glass of 2 terms"));
    let (zmx, agf) = file.to_zmx_and_agf("my lens").unwrap();
    assert!(zmx.contains("GCAT MY_LENS\r\n") && agf.as_ref().is_some_and(|agf| agf.matches("NM ").count() == 2));

    let folder = std::env::temp_dir().join(format!("dioptric-agf-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("my lens.zmx");
    std::fs::write(&path, zmx).unwrap();
    let alone = LensFile::read(&path, &ReadOptions::default()).unwrap_err().to_string();
    std::fs::write(path.with_extension("agf"), agf.unwrap()).unwrap();
    let again = LensFile::read(&path, &ReadOptions::default());
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(alone.contains("no glass is named 'PRIVATE1'"), "{alone}");
    check_same(&again.unwrap().lens, &file.lens, 550.0);
    assert_eq!(design().to_zmx_and_agf("x").unwrap(), (design().to_zmx().unwrap(), None));
    let paper = LensFile::from(Lens::built_in("paper-2el").unwrap());
    assert!(paper.to_zmx_and_agf("x").unwrap_err().to_string().contains("surface 0 has behind it the medium of"));
}

#[test]
fn indices_of_a_dat_file_may_be_given_the_papers_slope() {
    let file = read("a.dat", "67 1.5 1.65 25\n0 1.5 0 25\n-67 0 1 25\n");
    let paper = Lens::built_in("paper-2el").unwrap();
    let sloped = file.lens.with_linear_dispersion(-0.04 / 300.0, 550.0).unwrap();
    for nm in [400.0, 550.0, 700.0] {
        check_same(&sloped, &paper, nm);
    }
    assert!(file.lens.with_linear_dispersion(f64::NAN, 550.0).is_err());
}

#[test]
fn makers_are_listed_in_an_order_in_which_every_name_means_its_glass() {
    let lens_of = |glasses: [&str; 2]| {
        let interface = |glass: &str| Interface {
            surface: Surface::sphere(50.0, 5.0),
            medium_after: Glass::Named(glass.to_owned()),
            thickness_after_mm: 1.0,
        };
        let mut interfaces = glasses.map(interface).to_vec();
        interfaces.push(Interface { medium_after: Glass::Air, ..interface(glasses[0]) });
        LensFile::from(Lens::new("two makers", "test", interfaces, 0).unwrap())
    };
    // Both makers have an F2, one alone an SK16.
    for (glasses, makers) in [
        (["HIKARI:SK16", "SCHOTT:F2"], "GCAT SCHOTT HIKARI"),
        (["SCHOTT:F2", "HIKARI:SK16"], "GCAT SCHOTT HIKARI"),
        (["HIKARI:SK16", "HIKARI:F2"], "GCAT HIKARI"),
    ] {
        let file = lens_of(glasses);
        let text = file.to_zmx().unwrap();
        assert!(text.contains(&format!("{makers}\r\n")), "{text}");
        let again = read("a.zmx", &text).lens;
        let media = |lens: &Lens| lens.interfaces().iter().map(|at| at.medium_after.clone()).collect::<Vec<_>>();
        assert_eq!(media(&again), media(&file.lens));
    }
    let message = lens_of(["HIKARI:F2", "SCHOTT:F2"]).to_zmx().unwrap_err().to_string();
    assert!(message.contains("and a glass of another maker have one name"), "{message}");
}

/// A perfect lens of focal length infinity, which a file may state, was written with a focal length of 0 and could not be read again.
#[test]
fn perfect_lens_without_power_is_written_as_a_plane() {
    let plane = Interface {
        surface: Surface::plane(4.0),
        medium_after: Glass::Constant { index: 1.0 },
        thickness_after_mm: 5.0,
    };
    let mut perfect = plane.clone();
    perfect.surface.shape = Shape::ThinLens { power_per_mm: 0.0 };
    let lens = Lens::new("window", "a test", vec![plane, perfect], 0).unwrap();
    let again = read("a.zmx", &LensFile::from(lens).to_zmx().unwrap());
    assert_eq!(again.lens.interfaces()[1].surface.shape, Shape::Sphere);
}

#[test]
fn distances_that_round_stay_straight() {
    // The focus lies 1.5e12 mm behind: the sum of both distances less the first is not the second.
    let file = read("list.txt", "[ 999999999999 999999999999 1.65 25 0 0.5 0 1 ]\n");
    let zmx = file.to_zmx().unwrap();
    assert!(zmx.contains("DISZ 1.53") && !zmx.contains("COORDBRK"), "{zmx}");
    assert_eq!(read("again.zmx", &zmx).lens.vertices_z_mm(), file.lens.vertices_z_mm());
}

#[test]
fn main_wavelength_beside_the_list_is_said() {
    let file = |wavelengths_nm: &[f64], reference_wavelength_nm| {
        let mut file = LensFile { wavelengths_nm: wavelengths_nm.to_vec(), reference_wavelength_nm, ..design() };
        (file.wavelength_weights, file.film_distance_mm) = (Vec::new(), Some(30.0));
        file
    };
    let list = [486.0, 588.0, 656.0];
    let cases = [
        (&list[..], Some(588.0), 588.0, None),
        (&list, Some(700.0), 656.0, Some("it has 656 nm, not 700 nm")),
        (&list, None, 588.0, Some("it has 588 nm, not 550 nm")),
        (&[850.0, 1064.0], None, 850.0, None),
        (&[], Some(700.0), 700.0, Some("it has 700 nm alone")),
    ];
    for (wavelengths_nm, stated_nm, expected_nm, said) in cases {
        let file = file(wavelengths_nm, stated_nm);
        for (name, text) in [("a.zmx", file.to_zmx().unwrap()), ("a.seq", file.to_seq().unwrap())] {
            let again = read(name, &text);
            assert_eq!(again.main_wavelength_nm(), Some(expected_nm), "{name} {wavelengths_nm:?} {stated_nm:?}");
            let notes = file.left_out(&name[2..]);
            assert!(
                notes.iter().any(|note| said.is_some_and(|said| note.contains(said))) == said.is_some(),
                "{notes:?}"
            );
            assert!(said.is_some() || !notes.iter().any(|note| note.contains(" nm")), "{notes:?}");
        }
        assert!(said.is_none() || stated_nm.is_none() || file.left_out("dat")[0].contains("wavelengths"));
    }
    let neither = file(&[], None);
    assert_eq!(read("a.zmx", &neither.to_zmx().unwrap()).main_wavelength_nm(), None);
}
