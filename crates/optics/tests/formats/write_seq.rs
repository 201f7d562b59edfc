//! CODE V files written and read again.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    Aperture, CoordinateBreak, DiffractiveSurface, Field, Glass, GlassCatalogue, ImageSurface, Interface, Lens,
    LensFile, MissingGlass, OpticsError, Outline, PhaseProfile, ReadOptions, Shape, Surface, glam::DVec3,
};

fn read(text: &str) -> LensFile {
    LensFile::from_bytes(Path::new("a.seq"), text.as_bytes(), &ReadOptions::default())
        .unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Checks that a file reads back as itself, but for the notes of its readers.
#[track_caller]
fn check_round_trip(file: &LensFile) {
    let again = read(&file.to_seq().unwrap());
    assert_eq!(again.lens.apertures(), file.lens.apertures());
    assert_eq!(again.lens.moves(), file.lens.moves());
    assert_eq!(LensFile { notes: Vec::new(), ..again }, LensFile { notes: Vec::new(), ..file.clone() });
}

/// Checks that surfaces stand where they stood, to rounding.
#[track_caller]
fn assert_same_places(again: &Lens, lens: &Lens) {
    for (a, b) in again.placements().iter().zip(lens.placements()) {
        assert!(a.vertex_mm.distance(b.vertex_mm) < 1e-12 * (100.0 + b.vertex_mm.length()), "{a:?} {b:?}");
        let turned = (a.rotation - b.rotation).to_cols_array();
        assert!(turned.iter().all(|v| v.abs() < 1e-14), "{a:?} {b:?}");
    }
}

fn interface(radius_mm: f64, semi_aperture_mm: f64, medium_after: Glass, thickness_after_mm: f64) -> Interface {
    let surface = match radius_mm == 0.0 {
        true => Surface::plane(semi_aperture_mm),
        false => Surface::sphere(radius_mm, semi_aperture_mm),
    };
    Interface { surface, medium_after, thickness_after_mm }
}

fn shaped(shape: Shape, interface: Interface) -> Interface {
    Interface { surface: Surface { shape, ..interface.surface }, ..interface }
}

/// A group with every shape and glass that the format holds, near an object in water.
fn design() -> LensFile {
    let bk7 = || Glass::Named("SCHOTT:N-BK7".to_owned());
    let table = Glass::Tabulated { wavelengths_nm: vec![400.0, 550.0, 700.0], indices: vec![1.53, 1.52, 1.515] };
    let asphere = Shape::EvenAsphere { conic: -0.3, coefficients: vec![1.234_567_890_123e-6, -2.5e-9] };
    let toroid = Shape::Toroid { curvature_x_per_mm: 0.013, conic: 0.2, coefficients: vec![0.0, 3e-7] };
    let biconic = Shape::Biconic { conic: 0.1, curvature_x_per_mm: -0.002, conic_x: -0.4 };
    let interfaces = vec![
        shaped(asphere, interface(41.3, 9.0, bk7(), 4.1)),
        interface(-38.7, 9.0, Glass::NdVd { nd: 1.62, vd: 36.3 }, 2.05),
        interface(-120.9, 9.0, Glass::Air, 3.3),
        interface(0.0, 6.0, Glass::Air, 2.2),
        shaped(Shape::Conic { conic: 0.7 }, interface(77.7, 8.0, Glass::Constant { index: 1.5 }, 3.0)),
        shaped(toroid, interface(-90.1, 8.0, Glass::Air, 1.0)),
        shaped(biconic, interface(300.0, 8.0, table.clone(), 1.7)),
        interface(-250.3, 8.0, Glass::Air, 0.0),
    ];
    let lens = Lens::new("a 'design'", "made up", interfaces, 3).unwrap();
    let lens = lens.with_object_medium(Glass::Named("MISC:WATER".to_owned())).unwrap_or_else(|error| panic!("{error}"));
    let lens = lens.with_image_surface(ImageSurface { curvature_per_mm: -1.0 / 80.0, conic: 0.5 }).unwrap();
    let mut file = LensFile::from(lens);
    file.film_distance_mm = Some(37.25);
    file.object_distance_mm = Some(812.7);
    file.wavelengths_nm = vec![486.1327, 550.0, 656.2725];
    file.reference_wavelength_nm = Some(550.0);
    file.fields = [0.0, 3.0].map(|y_mm| Field::ObjectHeight { x_mm: -1.5, y_mm }).to_vec();
    file.wavelength_weights = vec![0.5, 1.0, 0.25];
    file.field_weights = vec![1.0, 2.0];
    file.surface_comments = ["front", "", "", "S2 iris", "back", "", "", ""].map(str::to_owned).to_vec();
    file.comments = vec!["a second line, with ; and & in it".to_owned()];
    file
}

#[test]
fn file_reads_back_as_the_same_system() {
    let mut file = design();
    check_round_trip(&file);
    for field in [
        Field::Angle { x_deg: 1.0, y_deg: -2.0 },
        Field::ImageHeight { x_mm: 0.0, y_mm: 4.0 },
        Field::RealImageHeight { x_mm: 0.5, y_mm: 4.0 },
    ] {
        file.fields = vec![field];
        file.field_weights.clear();
        check_round_trip(&file);
    }
}

#[test]
fn tilts_and_openings_read_back() {
    let still = CoordinateBreak {
        surfaces: (0, 0),
        pivot_mm: 0.0,
        decenter_mm: [0.0; 3],
        tilt_deg: [0.0; 3],
        tilt_first: false,
    };
    let moves = vec![
        CoordinateBreak { surfaces: (1, 1), decenter_mm: [0.1, 0.0, -0.2], tilt_deg: [1.0, -2.0, 3.0], ..still },
        CoordinateBreak { surfaces: (4, 8), decenter_mm: [0.0, 0.3, 0.0], tilt_deg: [0.5, 0.0, 0.0], ..still },
        // The film turns about its own middle.
        CoordinateBreak { surfaces: (8, 8), pivot_mm: 37.25, tilt_deg: [0.0, 4.0, 0.0], ..still },
    ];
    let aperture =
        |surface, outline, center_mm, is_obscuration| Aperture { surface, outline, center_mm, is_obscuration };
    let file = design();
    let apertures = vec![
        aperture(0, Outline::Rectangle { half_x_mm: 8.0, half_y_mm: 7.0 }, [0.0; 2], false),
        aperture(2, Outline::Ellipse { half_x_mm: 2.0, half_y_mm: 1.0 }, [0.5, -0.25], true),
        aperture(4, Outline::Circle { radius_mm: 1.5 }, [0.0; 2], true),
    ];
    let lens = Lens::new_with_apertures("tilted", "made up", file.lens.interfaces().to_vec(), 3, apertures).unwrap();
    let file = LensFile { lens: lens.clone().with_moves(moves).unwrap(), ..file };
    check_round_trip(&file);
    // What is more than the format's tilts is written by where surfaces stand.
    let pivoted = CoordinateBreak { surfaces: (1, 3), pivot_mm: 2.0, tilt_deg: [3.0, 1.0, 0.0], ..still };
    let film = CoordinateBreak { surfaces: (8, 8), tilt_deg: [2.0, 0.0, 0.0], ..still };
    for step in [pivoted, film] {
        let file = LensFile { lens: lens.clone().with_moves(vec![step]).unwrap(), ..file.clone() };
        let again = read(&file.to_seq().unwrap());
        assert_same_places(&again.lens, &file.lens);
        let film =
            |lens: &Lens| lens.at(550.0).unwrap().film_placement(37.25).lens_from_surface(DVec3::new(1.0, 2.0, 0.0));
        assert!(film(&again.lens).distance(film(&file.lens)) < 1e-12);
    }
}

#[test]
fn mirrors_and_gratings_read_back() {
    let hole =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm: 8.0 }, center_mm: [0.0; 2], is_obscuration: true };
    let interfaces = vec![
        shaped(Shape::Conic { conic: -1.06 }, interface(-200.0, 25.0, Glass::Air, -70.0)),
        shaped(Shape::Conic { conic: -3.1 }, interface(-90.0, 8.0, Glass::Air, 0.0)),
    ];
    let lens = Lens::new_with_apertures("telescope", "made up", interfaces, 0, vec![hole]).unwrap();
    let mut file = LensFile::from(lens.with_mirrors([0, 1]).unwrap());
    file.film_distance_mm = Some(90.5);
    check_round_trip(&file);

    let interfaces =
        vec![interface(0.0, 5.0, Glass::Constant { index: 1.5 }, 3.0), interface(0.0, 5.0, Glass::Air, 0.0)];
    let lens = Lens::new("grating", "made up", interfaces, 0).unwrap();
    let profile = PhaseProfile::Grating { lines_per_mm: [0.0, -300.0] };
    let grating = DiffractiveSurface { surface: 1, order: -2, profile, blaze: None };
    let rings = |radius_mm, coefficients_rad| PhaseProfile::Rings { radius_mm, coefficients_rad };
    let ring = DiffractiveSurface { surface: 0, order: 1, profile: rings(4.0, vec![-900.0, 2.5]), blaze: None };
    let mut file = LensFile::from(lens.clone().with_diffractive(vec![grating]).unwrap());
    file.film_distance_mm = Some(20.0);
    check_round_trip(&file);
    file.lens = lens.with_diffractive(vec![ring]).unwrap();
    let again = read(&file.to_seq().unwrap()).lens;
    let DiffractiveSurface { order, profile: PhaseProfile::Rings { radius_mm, coefficients_rad }, .. } =
        &again.diffractive()[0]
    else {
        panic!("{again:?}")
    };
    assert_eq!((*order, *radius_mm), (1, 1.0));
    for (found, expected) in coefficients_rad.iter().zip([-900.0 / 16.0, 2.5 / 256.0]) {
        assert!((found / expected - 1.0).abs() < 1e-15, "{found} {expected}");
    }
}

#[test]
fn every_glass_of_the_catalogue_reads_back() {
    let mut n_glasses = 0;
    for glass in GlassCatalogue::built_in().glasses() {
        let medium = Glass::Named(glass.full_name());
        let interfaces = vec![interface(50.0, 5.0, medium, 2.0), interface(0.0, 5.0, Glass::Air, 0.0)];
        let mut file = LensFile::from(Lens::new("a glass", "made up", interfaces, 0).unwrap());
        file.film_distance_mm = Some(1.0);
        // At a wavelength at which all glasses are known.
        file.wavelengths_nm = vec![glass.glass.range_nm().map_or(550.0, |(low, high)| 550.0_f64.clamp(low, high))];
        file.reference_wavelength_nm = Some(file.wavelengths_nm[0]);
        check_round_trip(&file);
        n_glasses += 1;
    }
    assert!(n_glasses > 500, "{n_glasses}");
}

#[test]
fn what_the_format_cannot_hold_is_named() {
    let message = |change: &dyn Fn(&mut LensFile)| {
        let mut file = design();
        change(&mut file);
        file.to_seq().unwrap_err().to_string()
    };
    let with = |file: &mut LensFile, interface: Interface| {
        let mut interfaces = file.lens.interfaces().to_vec();
        interfaces[0] = interface;
        file.lens = Lens::new("x", "x", interfaces, 3).unwrap();
    };
    let cauchy = Glass::Cauchy { a: 1.6, b_um2: 0.008 };
    let found = message(&|file| with(file, interface(41.3, 9.0, cauchy.clone(), 4.1)));
    assert!(found.starts_with("a .seq file cannot hold this lens: surface 0 has behind it "), "{found}");
    let odd = Shape::OddAsphere { conic: 0.0, coefficients: vec![0.0, 0.0, 1e-6] };
    let found =
        message(&|file| with(file, shaped(odd.clone(), interface(41.3, 9.0, Glass::Constant { index: 1.5 }, 4.1))));
    assert_eq!(
        found,
        "a .seq file cannot hold this lens: surface 0 has an aspheric term of r², or of an odd power of r"
    );
    let found = message(&|file| file.fields.push(Field::Angle { x_deg: 0.0, y_deg: 1.0 }));
    assert!(found.contains("its fields are of several kinds"), "{found}");
    let thin = LensFile::from(Lens::thin(50.0, 10.0).unwrap()).to_seq().unwrap_err().to_string();
    assert!(thin.contains("surface 0 is an ideal lens"), "{thin}");
}

#[test]
fn film_that_is_not_stated_is_at_the_paraxial_focus() {
    let mut file = LensFile::from(Lens::built_in("tessar-50mm").unwrap());
    file.wavelengths_nm = vec![550.0];
    file.reference_wavelength_nm = Some(550.0);
    let focus_mm = file.lens.at(550.0).unwrap().film_distance_mm_for(f64::INFINITY).unwrap();
    for again in [read(&file.to_seq().unwrap()), {
        let text = file.to_zmx().unwrap();
        LensFile::from_bytes(Path::new("a.zmx"), text.as_bytes(), &ReadOptions::default()).unwrap()
    }] {
        assert_eq!(again.film_distance_mm, Some(focus_mm));
    }
    assert!(file.left_out("seq")[0].contains("the file has the paraxial focus"), "{:?}", file.left_out("seq"));
    assert_eq!(design().left_out("seq"), Vec::<String>::new());
    let left_out = design().left_out("dat");
    assert_eq!(left_out.len(), 2);
    assert!(left_out[1].contains("indices of glasses at"), "{left_out:?}");
    assert!(left_out[0].ends_with(
        "has no place for the place of the film, the curvature of the film, the distance of the object, wavelengths, fields, \
         names of surfaces, comments: left out"
    ));
}

#[dioptric_golden::needs_shared]
#[test]
fn shared_files_read_back_from_what_was_written() {
    let Some(folder) = dioptric_golden::shared("data/lenses") else { return };
    let more = folder.join("more");
    let entries = [folder, more].into_iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let options = ReadOptions { missing_glass: MissingGlass::FromNdVd, ..ReadOptions::default() };
    let (mut n_written, mut refused) = (0, Vec::new());
    for path in entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()) {
        let Ok(file) = LensFile::read(&path, &options) else { continue };
        match file.to_seq() {
            Ok(text) => {
                let again = read(&text);
                let film_distance_mm = file.film_distance_mm.or(again.film_distance_mm);
                let again = LensFile { notes: Vec::new(), ..again };
                let file = LensFile { notes: Vec::new(), microlens: None, film_distance_mm, ..file };
                assert_same_places(&again.lens, &file.lens);
                assert_eq!(again.lens.interfaces(), file.lens.interfaces(), "{}", path.display());
                assert_eq!((&again.fields, &again.wavelengths_nm), (&file.fields, &file.wavelengths_nm));
                n_written += 1;
            }
            Err(OpticsError::CannotWrite { reason, .. }) => refused.push(format!("{}: {reason}", path.display())),
            Err(error) => panic!("{}: {error}", path.display()),
        }
    }
    assert!(n_written >= 25 && refused.len() <= 6, "{n_written} {refused:?}");
}
