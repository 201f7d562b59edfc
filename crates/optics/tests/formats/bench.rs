//! The Optical Bench's text and `.lens` files of photographic patents.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::{Path, PathBuf};

use dioptric_golden::needs_shared;
use dioptric_optics::{LensFile, ReadOptions, Shape};

/// The folder of the files; tests that need it are left out where it is not there.
fn folder() -> PathBuf {
    dioptric_golden::shared("data/lenses/bench").unwrap()
}

fn bench(name: &str) -> LensFile {
    LensFile::read(&folder().join(name), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// The effective and the back focal length, mm, of a file's first configuration by a paraxial ray from infinity through the rows as written. The
/// listings beside some files are of other versions of them, up to 3 % from this ray.
fn by_hand_mm(text: &str) -> [f64; 2] {
    let section = |name: &str| -> Vec<Vec<&str>> {
        let rows = text.lines().skip_while(|line| line.trim() != format!("[{name}]")).skip(1);
        rows.take_while(|line| !line.starts_with('[')).map(|line| line.split('\t').map(str::trim).collect()).collect()
    };
    let distance = |cell: &str| {
        let of_name =
            || section("variable distances").into_iter().find(|row| row[0] == cell).unwrap()[1].parse().unwrap();
        cell.parse().unwrap_or_else(|_| of_name())
    };
    let (mut height, mut slope, mut index, mut behind_mm): (f64, f64, f64, f64) = (1.0, 0.0, 1.0, 0.0);
    for row in section("lens data") {
        height += behind_mm * slope / index;
        let next = row.get(3).and_then(|cell| cell.parse().ok()).unwrap_or(1.0);
        if let Some(radius_mm) = row[1].parse().ok().filter(|radius| *radius != 0.0) {
            let radius_mm: f64 = radius_mm;
            slope -= height * (next - index) / radius_mm;
        }
        (index, behind_mm) = (next, distance(row[2]));
    }
    [-1.0 / slope, -height / slope]
}

#[needs_shared]
#[test]
fn bench_lenses_have_the_focal_length_of_their_rows() {
    let mut n_compared = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.ends_with(".txt") || name.ends_with("paraxial.txt") {
            continue;
        }
        let expected = by_hand_mm(&std::fs::read_to_string(folder().join(&name)).unwrap());
        let first = bench(&name).lens.at(587.5618).unwrap().first_order();
        for (found, expected) in [first.efl_mm, first.bfl_mm].into_iter().zip(expected) {
            // Glasses that a catalogue knows have its index, some units of the sixth digit from the file's.
            assert!((found - expected).abs() < 5e-5 * first.efl_mm, "{name}: {found} {expected}");
        }
        n_compared += 1;
    }
    assert!(n_compared >= 10, "{n_compared}");
}

/// The stop of this file stands 9.9 + 8.7 mm between surfaces of which it says itself that they are 17.6 mm apart; with that, it has the
/// focal length and the distance of the film that it states. The listing beside it has neither.
#[needs_shared]
#[test]
fn nikkor_has_the_focal_length_of_its_own_file() {
    let text = std::fs::read_to_string(folder().join("nikkor-50mm-f1.2AIS--US004621909_Example03.txt")).unwrap();
    let mended = text.replace("d6AS\t9.900", "d6AS\t8.900");
    let file = LensFile::from_bytes(Path::new("a.txt"), mended.as_bytes(), &ReadOptions::default()).unwrap();
    let first = file.lens.at(587.5618).unwrap().first_order();
    assert!((first.efl_mm - 51.6).abs() < 0.02 && (first.bfl_mm - 38.049).abs() < 0.01, "{first:?}");
    assert_eq!(file.film_distance_mm, Some(38.049));
}

/// The listings that are of the files beside them: to all digits where no glass is named, and to those of the catalogue's indices elsewhere.
#[needs_shared]
#[test]
fn focal_lengths_are_those_of_the_listings() {
    for (file, listing, within) in [
        ("nikkor-28mm-f1.4e--nikkor-28mmf1.4-afs.txt", "nikkor-28mm-f1.4e--paraxial.txt", 1e-14),
        ("version10--Noct-Nikkor-58mmf1.2.txt", "version10--paraxial.txt", 6e-6),
        ("leica-m-noctilux-50mm-f1.0--leica-noctilux-50mm-f1.txt", "leica-m-noctilux-50mm-f1.0--paraxial.txt", 3e-6),
    ] {
        let first = bench(file).lens.at(587.5618).unwrap().first_order();
        let text = std::fs::read_to_string(folder().join(listing)).unwrap();
        let listed = |key: &str| -> f64 {
            let words = text.lines().find_map(|line| line.strip_prefix(key)).unwrap();
            words.trim().parse().unwrap()
        };
        for (key, found) in [("effective_focal_length", first.efl_mm), ("back_focal_length", first.bfl_mm)] {
            assert!((found / listed(key) - 1.0).abs() < within, "{file}: {found} {}", listed(key));
        }
    }
}

/// Why the focal length is not that of a listing beside a file, or of its title, stands in its notes.
#[needs_shared]
#[test]
fn notes_say_why_a_focal_length_is_another() {
    for (file, words) in [
        ("nikkor-50mm-f1.2AIS--US004621909_Example03.txt", "d6 (17.6 mm) is the distance behind no row of [lens data]"),
        ("nikkor-50mm-f1.2AIS--US004621909_Example03.txt", "a focal length of 51.6 mm, its surfaces have 51.965 mm"),
        ("version2--Noct-Nikkor-58mmf1.2-v2-1.txt", "glass 'SF13' has n_d 1.74077"),
        ("version10--Noct-Nikkor-58mmf1.2.txt", "glasses that are named have the n_d of their catalogue, up to "),
        ("Nikkor_35mm_F2.8.lens", "the file states a focal length of 35 mm, its surfaces have 33.611 mm"),
    ] {
        let notes = bench(file).notes;
        assert!(notes.iter().any(|note| note.contains(words)), "{file}: {notes:?}");
    }
    assert!(
        bench("Konica_50mm_F2__Konica_Minolta_50mm_F2.0_MD_.lens")
            .notes
            .iter()
            .all(|note| !note.contains("states a focal"))
    );
}

#[needs_shared]
#[test]
fn columns_of_variable_distances_are_configurations() {
    let file = bench("sigma-50mm-f1.4-art--JP2015-114366_Example04.txt");
    let states = file.states();
    assert_eq!(states.len(), 2);
    assert_eq!((states[0].object_distance_mm, states[1].object_distance_mm), (None, Some(258.0)));
    // The second is in focus at its own distance: magnification −0.1736.
    let near = states[1].lens.at(587.5618).unwrap().conjugate(258.0);
    assert!((near.magnification + 0.1736).abs() < 5e-4, "{near:?}");
    assert!(
        (near.image_z_mm - states[1].film_distance_mm.unwrap()).abs() < 0.1,
        "{near:?} {:?}",
        states[1].film_distance_mm
    );
    let far = states[0].lens.at(587.5618).unwrap().first_order();
    assert!((far.efl_mm - 48.50).abs() < 0.05, "{}", far.efl_mm);
    assert_eq!(file.configuration_names()[1], "47.65 mm, object at 258 mm");
}

#[needs_shared]
#[test]
fn all_bench_files_are_read_or_are_no_lenses() {
    let mut n_read = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.ends_with("paraxial.txt") {
            assert!(LensFile::read(&path, &ReadOptions::default()).is_err());
            continue;
        }
        let file = LensFile::read(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let first = file.lens.at(587.5618).unwrap().first_order();
        assert!(first.efl_mm.is_finite() && first.f_number.is_finite(), "{name}");
        if name.ends_with(".lens") {
            let text = std::fs::read_to_string(&path).unwrap();
            let stated = text.lines().find_map(|line| line.strip_prefix("focal_length:")).unwrap();
            let stated: f64 = stated.trim().parse().unwrap();
            // Nominal focal lengths are rounded: the 35 mm Nikkor's surfaces make 33.61 mm by hand.
            assert!((first.efl_mm / stated - 1.0).abs() < 0.05, "{name}: {} {stated}", first.efl_mm);
            assert!(file.film_distance_mm.is_some());
        }
        n_read += 1;
    }
    assert_eq!(n_read, 20);
}

#[test]
fn what_a_bench_file_has_wrong_is_said_with_its_line() {
    let text = "[descriptive data]\ntitle\tA\n[variable distances]\nd0\tInfinity\nBf\t40\n[lens data]\n1\t50\t5\t1.5\t20\t60\n\
                2AS\tAS\t1\t\t15\n3\t-50\tBf\t\t20\n[aspherical data]\n3\t-50\t-0.5\t1e-6\n";
    let read = |text: &str| LensFile::from_bytes(Path::new("a.txt"), text.as_bytes(), &ReadOptions::default());
    let file = read(text).unwrap();
    assert_eq!((file.lens.stop(), file.film_distance_mm), (1, Some(40.0)));
    assert_eq!(file.lens.interfaces()[2].surface.shape, Shape::EvenAsphere { conic: -0.5, coefficients: vec![1e-6] });
    for (wrong, right, words) in [
        ("\tBf\t\t20", "\td9\t\t20", "a.txt:9: the distance behind a surface is 'd9'"),
        ("1\t50\t", "1\tx\t", "a.txt:7: the radius is 'x', expected a number"),
        ("\n3\t-50\t-0.5", "\n4\t-50\t-0.5", "a.txt:11: there is no surface '4' in [lens data]"),
    ] {
        let message = read(&text.replace(wrong, right)).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
    let of_lens = |text: &str| LensFile::from_bytes(Path::new("a.lens"), text.as_bytes(), &ReadOptions::default());
    let text = "name: A\nfocal_length: 50\nsurfaces:\n 50 5 1.5 60 20 1\n stop 1 1 0 15 0\n -50 45 1 0 20 0\n";
    let file = of_lens(text).unwrap();
    assert!(
        file.notes
            .iter()
            .any(|note| note
                .contains("1 surfaces state that they are coated, not with what: the usual coating is taken")),
        "{:?}",
        file.notes
    );
    assert_eq!(
        (file.lens.stop(), file.film_distance_mm, file.lens.interfaces()[0].surface.semi_aperture_mm),
        (1, Some(45.0), 10.0)
    );
    let message = of_lens(&text.replace("focal_length", "focal")).unwrap_err().to_string();
    assert!(message.contains("a.lens:2: 'focal: 50' is not known"), "{message}");
}

/// A focus at a near object states no angle of view: formats in which all configurations have fields give it those of the far one.
#[test]
fn configurations_without_fields_are_written_with_those_of_another() {
    let text = "[descriptive data]\ntitle\tA\n[variable distances]\nAngle of View\t40\tUndefined\nd0\tInfinity\t500\nBf\t40\t45\n\
                [lens data]\n1\t50\t5\t1.5\t20\t60\n2AS\tAS\t1\t\t15\n3\t-50\tBf\t\t20\n";
    let read = |name: &str, text: &str| {
        LensFile::from_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default()).unwrap()
    };
    let file = read("a.txt", text);
    let fields_of = |file: &LensFile| file.states().into_iter().map(|state| state.fields).collect::<Vec<_>>();
    let [far, near] = &fields_of(&file)[..] else { panic!("two configurations") };
    assert!(!far.is_empty() && near.is_empty());
    for (name, written) in [("a.zmx", file.to_zmx().unwrap()), ("a.seq", file.to_seq().unwrap())] {
        let again = read(name, &written);
        assert_eq!(fields_of(&again), [far.clone(), far.clone()], "{name}");
        assert_eq!(again.states()[1].object_distance_mm, Some(500.0), "{name}");
        let notes = file.left_out(&name[2..]);
        assert!(notes.iter().any(|note| note.contains("have the angles of number 1")), "{name}: {notes:?}");
    }
    assert!(!file.left_out("ron").iter().any(|note| note.contains("angles")));
}

#[test]
fn columns_and_sections_that_are_left_out_are_said() {
    let text = "[variable distances]\nd0\tInfinity\t500\nd1\t3.75\nBf\t40\t45\n[aspheric data]\n1\t50\t-1\n\
                [lens data]\n1\t50\td1\t1.5\t20\t60\n2AS\tAS\t1\t\t15\n3\t-50\tBf\t\t20\n";
    let read = |text: &str| LensFile::from_bytes(Path::new("a.txt"), text.as_bytes(), &ReadOptions::default());
    let notes = read(text).unwrap().notes;
    for expected in [
        "column 2 of [variable distances] is no configuration: the distance d1 is not known in this configuration",
        "sections that are not known are left out: [aspheric data]",
    ] {
        assert!(notes.iter().any(|note| note == expected), "{notes:?}");
    }
    let near = text.replace("d0\tInfinity\t500", "Magnification\t0\t-0.5").replace("3.75", "3.75\t4.25");
    let far = "a magnification of -0.5 is stated without the distance of the object (d0), which counts as far";
    let options = ReadOptions { configuration: Some(2), ..ReadOptions::default() };
    let second = LensFile::from_bytes(Path::new("a.txt"), near.as_bytes(), &options).unwrap();
    assert!(second.notes.iter().any(|note| note == far), "{:?}", second.notes);
    assert!(read(&text.replace("\t20\t60", "\t-20\t60")).unwrap_err().to_string().contains("the diameter is -20"));
}
