//! The words, keys and columns that users rely on.

mod common;

use std::{fs, path::Path, process::Command};

use common::{CAMERA, check_error, dioptric, output, read_picture};
use serde_json::Value;

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&output(folder, arguments)).expect("the output is JSON")
}

#[track_caller]
fn check_numbers(record: &Value, keys: &str) {
    for key in keys.split_whitespace() {
        assert!(record[key].is_number(), "{key} in {record}");
    }
}

#[test]
fn lens_info_has_its_keys_for_each_wavelength() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        ["lens", "info", "dgauss-50mm", "--wavelengths-nm", "400:700:100", "--distance-mm", "2000", "--json"];
    let records = json(folder.path(), &arguments);
    assert_eq!(records.as_array().unwrap().len(), 4);
    for record in records.as_array().unwrap() {
        check_numbers(
            record,
            "wavelength_nm efl_mm bfl_mm ffl_mm front_principal_mm rear_principal_mm entrance_pupil_z_mm \
             entrance_pupil_diameter_mm exit_pupil_z_mm exit_pupil_diameter_mm f_number image_distance_mm \
             magnification working_f_number",
        );
        check_numbers(&record["seidel"], "S1 S2 S3 S4 S5 C1 C2");
        assert_eq!(record["seidel_surfaces"].as_array().unwrap().len(), 11);
    }
}

#[test]
fn lens_without_an_axis_of_symmetry_has_both_its_planes_and_no_sums() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("toric.ron"), TORIC).unwrap();
    let records = json(folder.path(), &["lens", "info", "toric.ron", "--json"]);
    let record = &records[0];
    check_numbers(&record["x_plane"], "efl_mm bfl_mm f_number");
    assert!(record.get("seidel").is_none(), "{record}");
    // Into glass of index 1.5 the rear focus lies three radii behind a surface.
    assert!((record["bfl_mm"].as_f64().unwrap() - 120.0).abs() < 1e-9, "{record}");
    assert!((record["x_plane"]["bfl_mm"].as_f64().unwrap() - 60.0).abs() < 1e-9, "{record}");
    assert!(output(folder.path(), &["lens", "info", "toric.ron"]).contains("x_plane bfl_mm"));
    let glass = json(folder.path(), &["glass", "show", "N-BK7", "--wavelengths-nm", "300,550", "--json"]);
    let through = glass["transmittances_10_mm"].as_array().unwrap();
    assert!(through[0].is_null() && through[1].as_f64().unwrap() > 0.99, "{glass}");
}

/// A surface that bends twice as much along x, decentered, before a curved film.
const TORIC: &str = r#"(
    name: "toric",
    source: "test",
    surfaces: [
        (radius_mm: 40.0, shape: Biconic(conic: 0.0, curvature_x_per_mm: 0.05, conic_x: 0.0), stop: true,
         semi_aperture_mm: 4.0, medium: Constant(index: 1.5), thickness_mm: 0.0),
    ],
    moves: [(surfaces: (0, 0), decenter_mm: (0.5, 0.0, 0.0))],
    image_radius_mm: -30.0,
)"#;

#[test]
fn rays_of_a_table_end_on_a_curved_film() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("toric.ron"), TORIC).unwrap();
    fs::write(folder.path().join("rays.csv"), "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n1,1,-5,0,0,1,550\n").unwrap();
    let table = output(folder.path(), &["trace", "toric.ron", "--rays", "rays.csv", "--film-mm", "20"]);
    let image: Vec<f64> =
        table.lines().last().unwrap().split(',').skip(2).take(3).map(|cell| cell.parse().unwrap()).collect();
    let (x, y, z) = (image[0], image[1], image[2]);
    // The film's center of curvature lies 30 mm before its vertex, which the decenter of the surface leaves in place.
    assert!(((x * x + y * y + (z + 10.0).powi(2)).sqrt() - 30.0).abs() < 1e-12, "{table}");
}

#[test]
fn lens_analyze_has_its_keys_and_leaves_its_plots() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["lens", "analyze", "tessar-50mm", "--fields-deg", "0,12", "--wavelengths-nm", "500,600", "--quiet"];
    let stop = ["--f-number", "5.6", "--distance-mm", "3000", "--rings", "4"];
    let analysis = json(folder.path(), &[&common[..], &stop, &["--out", "plots", "--json"]].concat());
    check_numbers(
        &analysis,
        "distance_mm reference_nm efl_mm f_number working_f_number film_mm half_illumination_deg object_index image_index \
         object_na image_na",
    );
    assert_eq!(analysis["grid"].as_array().unwrap().len(), 121);
    assert!(analysis["notes"].as_array().unwrap().is_empty() && analysis["x_plane"].is_null());
    check_numbers(
        &analysis["focus"],
        "paraxial_film_mm axis_film_mm axis_rms_um fields_film_mm fields_rms_um wavefront_film_mm wavefront_rms_waves",
    );
    let of = |key: &str, n: usize| {
        assert_eq!(analysis[key].as_array().unwrap().len(), n, "{key}");
        analysis[key][n - 1].clone()
    };
    check_numbers(&of("axial_color", 2), "wavelength_nm paraxial_shift_mm rms_shift_mm");
    let spot = of("spots", 4);
    check_numbers(&spot, "field_deg wavelength_nm height_mm rms_um rms_about_chief_um radius_um sigma_x_um sigma_y_um");
    check_numbers(&spot["wavefront"], "rms_waves peak_to_valley_waves strehl");
    assert_eq!(spot["pupil"]["rho_max_mm"].as_array().unwrap().len(), 36);
    let fan = of("fans", 4);
    for key in ["places", "tangential_um", "sagittal_um", "tangential_waves", "sagittal_waves"] {
        assert_eq!(fan[key].as_array().unwrap().len(), 41, "{key}");
    }
    check_numbers(
        &of("fields", 2),
        "height_mm distortion_tangent_percent distortion_angle_percent tangential_focus_mm sagittal_focus_mm \
         relative_illumination",
    );
    let written: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("plots/analysis.json")).unwrap()).unwrap();
    assert_eq!(written, analysis);
    let page = fs::read_to_string(folder.path().join("plots/analysis.html")).unwrap();
    assert!(page.contains("Optical path differences") && page.contains("least spot on the axis"));
    assert!(page.contains("Prescription") && page.contains("Modulation over field") && page.contains("Glasses"));
    for name in
        ["analysis", "spots", "opd", "distortion", "mtf", "mtf_geometric", "mtf_over_field", "mtf_through_focus"]
    {
        let file = |extension: &str| fs::read(folder.path().join(format!("plots/{name}.{extension}"))).unwrap();
        assert!(file("svg").starts_with(b"<svg"), "{name}");
        if cfg!(feature = "png") {
            assert!(file("png").starts_with(b"\x89PNG"), "{name}");
        }
    }
    let text = output(folder.path(), &[&common[..], &["--focus-mm", "2000"]].concat());
    assert!(text.contains("least spot on the axis") && text.contains("f tan θ %"), "{text}");
    let fisheye = ["lens", "analyze", "fisheye-12.5mm", "--fields-deg", "30/40,89", "--rings", "2", "--quiet"];
    let text = output(folder.path(), &fisheye);
    assert!(text.contains("30.0°/40.0°") && text.contains("89.000°") && !text.contains("is cut"), "{text}");
    let near = ["lens", "analyze", "tessar-50mm", "--distance-mm", "200", "--fields-mm", "0,-3/4", "--json", "--quiet"];
    let spot = json(folder.path(), &near)["spots"][5].clone();
    assert_eq!(spot["object_mm"], serde_json::json!([-3.0, 4.0]));
}

#[test]
fn an_objective_in_water_is_told_and_analyzed() {
    let folder = tempfile::tempdir().unwrap();
    let water = "(name: \"dipping\", source: \"a test\", object_medium: Constant(index: 1.33), surfaces: [
        (semi_aperture_mm: 2.0, medium: Constant(index: 1.52), thickness_mm: 1.2),
        (stop: true, radius_mm: -1.25, semi_aperture_mm: 0.4, thickness_mm: 0.0)])";
    fs::write(folder.path().join("water.ron"), water).unwrap();
    assert!(
        output(folder.path(), &["lens", "info", "water.ron"]).contains("object in the medium of constant index 1.33")
    );
    let fields = ["--distance-mm", "4", "--fields-mm", "0,0.2", "--rings", "3", "--quiet"];
    let text = output(folder.path(), &[&["lens", "analyze", "water.ron"][..], &fields].concat());
    assert!(text.contains("at the object in n = 1.33000") && text.contains("0.2 mm"), "{text}");
    let draw = ["lens", "draw", "water.ron", "--distance-mm", "4", "--fields-deg", "0", "-o", "water.svg", "--quiet"];
    output(folder.path(), &draw);
    assert!(fs::read_to_string(folder.path().join("water.svg")).unwrap().contains("fill-opacity=\"0.6\""));
}

#[test]
fn psf_has_its_keys_in_both_modes() {
    let folder = tempfile::tempdir().unwrap();
    let common = [
        "psf",
        "paper-2el",
        "--fields-deg",
        "0,2",
        "--distances-mm",
        "8000",
        "--wavelengths-nm",
        "500:600:100",
        "--film-mm",
        "51.8145",
        "--stop-mm",
        "4",
        "--pixel-um",
        "4",
        "--size",
        "75",
        "--json",
    ];
    for mode in [&["--mode", "pupil"][..], &["--mode", "paper", "--rays", "51"], &["--diffraction", "hurb"]] {
        let records = json(folder.path(), &[&common[..], mode].concat());
        assert_eq!(records.as_array().unwrap().len(), 4);
        for record in records.as_array().unwrap() {
            check_numbers(
                record,
                "field_deg distance_mm wavelength_nm centroid_x_mm centroid_y_mm rms_radius_um sigma_x_um \
                 sigma_y_um lsf_fwhm_um ee50_radius_um energy second_moment_xy_um2 lsf_fwhm_y_um ee80_radius_um \
                 es50_half_width_um es80_half_width_um picture_share",
            );
        }
    }
}

#[test]
fn psf_adds_polychromatic_rows_and_writes_its_table_and_mosaic() {
    let folder = tempfile::tempdir().unwrap();
    let common =
        ["psf", "paper-2el", "--fields-deg", "0,2", "--film-mm", "51.8145", "--stop-mm", "4", "--pixel-um", "4"];
    // With losses the mean wavelength is that of the light that is left.
    let light = [
        "--wavelengths-nm",
        "500,600",
        "--polychromatic",
        "--mtf-per-mm",
        "10",
        "--csv",
        "t.csv",
        "-o",
        "m.png",
        "--coating",
        "ideal",
    ];
    let records = json(folder.path(), &[&common[..], &light, &["--json"]].concat());
    let is_whole = |record: &Value| record["is_polychromatic"] == true;
    assert_eq!(
        records.as_array().unwrap().iter().map(is_whole).collect::<Vec<_>>(),
        [false, false, true, false, false, true]
    );
    assert_eq!(records[2]["wavelength_nm"], 550.0);
    check_numbers(&records[2]["mtf"][0], "cycles_per_mm tangential sagittal radial");
    let csv = fs::read_to_string(folder.path().join("t.csv")).unwrap();
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    assert!(names.contains(&"mtf_tangential_10_per_mm"), "{names:?}");
    let rows: Vec<_> = lines.collect();
    assert!(rows.len() == 6 && rows.iter().all(|row| row.len() == names.len()), "{csv}");
    let column = names.iter().position(|name| *name == "ee80_radius_um").unwrap();
    assert_eq!(rows[4][column].parse::<f64>().unwrap(), records[4]["ee80_radius_um"].as_f64().unwrap());
    assert!(fs::read(folder.path().join("m.png")).unwrap().starts_with(b"\x89PNG"));
    let text = output(folder.path(), &[&common[..], &light, &["--spectral-weights", "3,1", "--quiet"]].concat());
    assert!(text.lines().filter(|line| line.contains(" all ")).count() == 2, "{text}");
}

#[test]
fn psf_out_of_focus_is_as_wide_as_the_f_number_says() {
    let folder = tempfile::tempdir().unwrap();
    let rms_um = |f_number: &str| {
        let lens = ["psf", "dgauss-50mm", "--f-number", f_number];
        let place = ["--focus-mm", "2000", "--distances-mm", "1000", "--pixel-um", "5", "--json"];
        json(folder.path(), &[&lens[..], &place].concat())[0]["rms_radius_um"].as_f64().unwrap()
    };
    // Aberrations are some hundredths of the blur at f/5.6.
    assert!((rms_um("5.6") / rms_um("11.2") - 2.0).abs() < 0.05, "{} {}", rms_um("5.6"), rms_um("11.2"));
    check_error(folder.path(), &["psf", "dgauss-50mm", "--f-number", "1", "--focus-mm", "2000"], &["f/2.028"]);
}

/// Of older command lines.
#[test]
fn psf_ignores_the_bank_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["psf", "dgauss-50mm", "--stop-mm", "8", "--focus-mm", "2000", "--distances-mm", "1500", "--json"];
    let traced = json(folder.path(), &common);
    assert_eq!(json(folder.path(), &[&common[..], &["--bank-error", "0.01"]].concat()), traced);
    assert_eq!(json(folder.path(), &[&common[..], &["--bank", "paper"]].concat()), traced);
}

#[test]
fn psf_of_a_lens_without_an_axis_of_symmetry() {
    let folder = tempfile::tempdir().unwrap();
    let lens = r#"(name: "two powers", source: "test", surfaces: [
        (radius_mm: 40.0, shape: Biconic(conic: 0.0, curvature_x_per_mm: 0.02, conic_x: 0.0), stop: true, semi_aperture_mm: 2.0, medium: Constant(index: 1.5), thickness_mm: 1.0),
        (radius_mm: -40.0, semi_aperture_mm: 3.0, thickness_mm: 0.0),
    ])"#;
    fs::write(folder.path().join("two.ron"), lens).unwrap();
    let common =
        ["psf", "two.ron", "--film-mm", "39.7", "--fields-deg=-2,0,2", "--field-y-deg", "1", "--pixel-um", "5"];
    let light = ["--distances-mm", "inf", "--plots", "plots", "-o", "m.png", "--json"];
    let records = json(folder.path(), &[&common[..], &light].concat());
    check_numbers(&records[0], "field_y_deg sigma_x_um second_moment_xy_um2 centroid_y_mm");
    let number = |i: usize, key: &str| records[i][key].as_f64().unwrap();
    // Mirrored in x, and longer across than up, where the focus is nearer.
    assert!((number(0, "sigma_x_um") / number(2, "sigma_x_um") - 1.0).abs() < 1e-3);
    assert!((number(0, "centroid_x_mm") + number(2, "centroid_x_mm")).abs() < 1e-6);
    assert!(number(1, "sigma_x_um") > 2.0 * number(1, "sigma_y_um"), "{records}");
    assert!(folder.path().join("plots/through_focus.csv").exists());
}

#[test]
fn run_takes_a_picture_through_a_tilted_lens() {
    let folder = tempfile::tempdir().unwrap();
    let lens = r#"(name: "askew", source: "test", surfaces: [
        (radius_mm: 50.0, semi_aperture_mm: 6.0, medium: Constant(index: 1.5), thickness_mm: 3.0),
        (stop: true, radius_mm: -50.0, semi_aperture_mm: 4.0, thickness_mm: 0.0),
    ])"#;
    fs::write(folder.path().join("lens.ron"), lens).unwrap();
    let camera = common::CAMERA
        .replace("BuiltIn(\"dgauss-50mm\")", "File(\"lens.ron\")")
        .replace("FNumber(4.0)", "FNumber(8.0)")
        .replace("Pixels(columns: 48, rows: 32, pitch_um: 200.0)", "Scene");
    fs::write(folder.path().join("camera.ron"), camera).unwrap();
    let moved = ["--tilt-deg", "5", "--swing-deg=-1", "--rise-mm", "0.5"];
    output(folder.path(), &[&["run", "camera.ron", "--out", "out"][..], &moved].concat());
    let report: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("out/report.json")).unwrap()).unwrap();
    let movements = serde_json::json!({"tilt_deg": 5.0, "swing_deg": -1.0, "rise_mm": 0.5, "shift_mm": 0.0});
    assert_eq!(report["camera"]["movements"], movements);
    // The scene fills the film to its rim: no corner is dark.
    let picture = read_picture(&folder.path().join("out/picture.png")).to_rgb8();
    let (columns, rows) = picture.dimensions();
    for (x, y) in [(0, 0), (columns - 1, 0), (0, rows - 1), (columns - 1, rows - 1), (columns / 2, rows / 2)] {
        assert!(picture.get_pixel(x, y).0[1] > 60, "{x} {y}: {:?}", picture.get_pixel(x, y));
    }
}

#[test]
fn a_picture_that_cannot_hold_its_light_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["psf", "singlet-50mm", "--focus-mm", "2000", "--pixel-um", "4", "--size", "31"];
    let text = output(folder.path(), &common);
    assert!(text.contains("% of the light"), "{text}");
}

#[test]
fn psf_writes_plots_and_says_which_model_drew() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["psf", "dgauss-50mm", "--focus-mm", "2000", "--stop-mm", "4.2", "--diffraction", "wave", "--json"];
    let plots = ["--wavelengths-nm", "500,600", "--plots", "plots", "--spectral-weights", "1,0.5"];
    let records = json(folder.path(), &[&common[..], &plots].concat());
    for record in records.as_array().unwrap() {
        assert_eq!(record["wave_fraction"], 1.0);
        check_numbers(record, "strehl ee80_radius_um");
        assert!((0.9..0.99).contains(&record["energy"].as_f64().unwrap()), "{record}");
    }
    let lossless = json(folder.path(), &[&common[..], &plots, &["--coating", "ideal"]].concat());
    assert!(lossless.as_array().unwrap().iter().all(|record| record["energy"] == 1.0));
    for name in ["lsf", "esf", "mtf", "encircled_energy", "ensquared_energy", "through_focus"] {
        assert!(fs::read_to_string(folder.path().join(format!("plots/{name}.svg"))).unwrap().contains("600 nm"));
        let png = fs::read(folder.path().join(format!("plots/{name}.png")));
        assert_eq!(png.is_ok_and(|bytes| bytes.starts_with(b"\x89PNG")), cfg!(feature = "png"), "{name}");
        assert!(fs::read_to_string(folder.path().join(format!("plots/{name}.csv"))).unwrap().starts_with("line,style"));
    }
    let text = output(folder.path(), &common[..8]);
    assert!(text.contains("waves 100 %, Strehl ratio") && !text.contains("-0.00000"), "{text}");
    let wrong = ["--wavelengths-nm", "500,600", "--plots", "others", "--spectral-weights", "1"];
    common::check_error(folder.path(), &[&common[..], &wrong].concat(), &["spectral_weights", "2 numbers"]);
}

#[test]
fn traced_rays_have_their_columns_and_seventeen_digits() {
    let folder = tempfile::tempdir().unwrap();
    let rays = "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n0,2,-10,0,0,1,550\n0,12.7,-10,0,0,1,550\n";
    fs::write(folder.path().join("rays.csv"), rays).unwrap();
    let common = ["trace", "dgauss-50mm", "--rays", "rays.csv", "--film-mm", "36"];
    let text = output(folder.path(), &common);
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("ray,surface,x_mm,y_mm,z_mm,l,m,n,opl_mm,fate"));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    // Eleven surfaces and the image for the first ray, one row for the second, which the front rim ends.
    assert_eq!(rows.len(), 13);
    assert_eq!((rows[11][1], rows[11][9], rows[12][0], rows[12][9]), ("image", "passed", "1", "vignetted"));
    assert!(rows[0][3].split(['.', 'e']).nth(1).is_some_and(|digits| digits.len() == 16), "{}", rows[0][3]);
    let unclipped = output(folder.path(), &[&common[..], &["--no-clip", "-o", "out.csv"]].concat());
    assert!(unclipped.is_empty());
    assert!(fs::read_to_string(folder.path().join("out.csv")).unwrap().lines().count() > 14);
}

/// Rays of an ultraviolet that a glass's table does not reach: refused, or continued and said.
#[test]
fn traced_rays_tell_of_a_glass_that_is_continued() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("rays.csv"),
        "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n0,2,-10,0,0,1,315\n0,2,-10,0,0,1,550\n",
    )
    .unwrap();
    let common = ["trace", "achromat-100mm", "--rays", "rays.csv"];
    common::check_error(folder.path(), &common, &["315 nm", "--glass-range extend"]);
    let traced = common::dioptric(folder.path(), &[&common[..], &["--glass-range", "extend"]].concat());
    let notes = String::from_utf8(traced.stderr).unwrap();
    assert!(
        traced.status.success() && notes.contains("at 315 nm its index") && notes.contains("may be off by"),
        "{notes}"
    );
}

/// A germanium lens of a design program's file: what it states of its use holds where the command has no such option.
#[test]
fn use_that_a_file_states_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let seq = "RDM\nTITLE 'ir'\nEPD 20\nWL 12000 10000 8000\nREF 2\nYOB 0 3 5\nSO 0 400\nS 100 5 GERMANIUM\n STO; ASP; K -0.5; A 1E-8\n\
               S 140 100\nSI 0\n";
    fs::write(folder.path().join("ir.seq"), seq).unwrap();
    let info = output(folder.path(), &["lens", "info", "ir.seq"]);
    assert!(info.contains("conic -0.5, 1e-8 r⁴") && info.contains("MISC:GERMANIUM"), "{info}");
    let analysis = json(folder.path(), &["lens", "analyze", "ir.seq", "--rings", "3", "--json"]);
    assert_eq!((analysis["reference_nm"].as_f64(), analysis["distance_mm"].as_f64()), (Some(10_000.0), Some(400.0)));
    assert_eq!(analysis["fields"][2]["object_mm"][1].as_f64(), Some(5.0));
    let maps = analysis["opd_maps"].as_array().unwrap();
    assert_eq!((maps.len(), maps[0]["waves"].as_array().unwrap().len()), (9, 51 * 51));
    // What is asked for goes before.
    let far =
        ["lens", "analyze", "ir.seq", "--rings", "3", "--distance-mm", "inf", "--wavelengths-nm", "9000", "--json"];
    let far = json(folder.path(), &far);
    assert!(far["distance_mm"].is_null() && far["reference_nm"] == 9000.0 && far["fields"][1]["object_mm"].is_null());
    output(folder.path(), &["lens", "draw", "ir.seq", "-o", "ir.svg"]);
    // 5 mm at 400 mm before the stop, and the f-number at the file's main wavelength.
    let drawing = fs::read_to_string(folder.path().join("ir.svg")).unwrap();
    assert!(drawing.contains("0.7°") && drawing.contains("f/5.33"), "{drawing}");
}

#[test]
fn lists_name_what_is_built_in() {
    let folder = tempfile::tempdir().unwrap();
    let lenses = json(folder.path(), &["lens", "list", "--json"]);
    assert!(lenses.as_array().unwrap().iter().any(|lens| lens["name"] == "paper-2el"));
    let glass = json(folder.path(), &["glass", "show", "SCHOTT:N-BK7", "--wavelengths-nm", "587.5618", "--json"]);
    assert!((glass["indices"][0].as_f64().unwrap() - 1.5168).abs() < 1e-5);
    assert!(output(folder.path(), &["glass", "list", "--filter", "bk7"]).contains("N-BK7"));
}

#[test]
fn a_lens_is_drawn_and_converted() {
    let folder = tempfile::tempdir().unwrap();
    output(folder.path(), &["lens", "draw", "dgauss-50mm", "-o", "lens.svg", "--quiet"]);
    assert!(fs::read_to_string(folder.path().join("lens.svg")).unwrap().contains("<svg"));
    output(
        folder.path(),
        &["lens", "draw", "fisheye-12.5mm", "--out", "f.svg", "--wavelengths-nm", "450,650", "--fields-deg", "0,80"],
    );
    assert!(fs::read(folder.path().join("f.svg")).unwrap().starts_with(b"<svg"));
    let original = json(folder.path(), &["lens", "info", "dgauss-50mm", "--json", "--wavelengths-nm", "587.5618"]);
    for file in ["copy.ron", "copy.dat", "copy.json", "copy.zmx"] {
        output(folder.path(), &["lens", "convert", "dgauss-50mm", file]);
        let copy = json(folder.path(), &["lens", "info", file, "--json", "--wavelengths-nm", "587.5618"]);
        let [original, copy] = [&original, &copy].map(|info| info[0]["efl_mm"].as_f64().unwrap());
        // Indices are those of the d line; files keep them to 1e-9 or better.
        assert!((copy / original - 1.0).abs() < 1e-6, "{file}: {copy}, not {original}");
    }
}

#[test]
fn what_a_lens_file_leaves_open_is_closed_by_options() {
    let folder = tempfile::tempdir().unwrap();
    let zmx = "MODE SEQ\nUNIT MM\nENPD 5\nWAVM 1 0.55 1\nSURF 0\n  DISZ INFINITY\nSURF 1\n  STOP\n  CURV 0.02\n  DISZ 2\n  \
        GLAS MINE 0 0 1.6 40\nSURF 2\n  DISZ 90\n  MAZH 0 0\nSURF 3\n  DISZ 0\n";
    fs::write(folder.path().join("lens.zmx"), zmx).unwrap();
    fs::write(folder.path().join("my.agf"), "NM MINE 2\nCD 1.25 0\nLD 0.3 1.0\n").unwrap();
    check_error(folder.path(), &["lens", "info", "lens.zmx"], &["lens.zmx:11", "no glass is named 'MINE'"]);
    let efl_mm = |options: &[&str]| {
        let arguments = [&["lens", "info", "lens.zmx", "--json", "--quiet"], options].concat();
        json(folder.path(), &arguments)[0]["efl_mm"].as_f64().unwrap()
    };
    // A plano-convex lens of radius 50 mm: f = R/(n − 1), and n = 1.5 in the catalogue at any wavelength.
    assert!((efl_mm(&["--glasses", "my.agf"]) - 100.0).abs() < 1e-9);
    let of_nd_vd_mm = efl_mm(&["--missing-glass", "nd-vd"]);
    assert!((of_nd_vd_mm - 50.0 / 0.602).abs() < 0.2, "{of_nd_vd_mm}");
    check_error(folder.path(), &["lens", "info", "lens.zmx", "--glasses", "none.agf"], &["none.agf"]);

    // A lens is read alike wherever one is named; a camera file says it too, and paths in it follow the file.
    check_error(folder.path(), &["psf", "lens.zmx", "--focus-mm", "inf"], &["no glass is named 'MINE'"]);
    let psf = ["psf", "lens.zmx", "--focus-mm", "inf", "--json", "--quiet", "--glasses", "my.agf"];
    assert_eq!(json(folder.path(), &psf).as_array().unwrap().len(), 1);
    fs::write(folder.path().join("rays.csv"), "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n1,0,-10,0,0,1,550\n").unwrap();
    let rays = ["trace", "lens.zmx", "--rays", "rays.csv", "--glasses", "my.agf", "--film-mm", "90"];
    // A header, two surfaces and the film.
    assert_eq!(output(folder.path(), &rays).lines().count(), 4);
    let camera = CAMERA.replace("BuiltIn(\"dgauss-50mm\")", "File(\"lens.zmx\")").replace("FNumber(4.0)", "AsGiven");
    fs::write(folder.path().join("shot.ron"), &camera).unwrap();
    check_error(folder.path(), &["run", "shot.ron", "--out", "out"], &["no glass is named 'MINE'"]);
    output(folder.path(), &["run", "shot.ron", "--out", "out", "--glasses", "my.agf"]);
    let report = fs::read_to_string(folder.path().join("out/report.json")).unwrap();
    assert!(report.contains("\"my.agf\""));
    let reading = "lens_reading: (glasses: [\"../my.agf\"]),\n    stop:";
    let camera = camera.replace("lens.zmx", "../lens.zmx").replace("stop:", reading);
    fs::create_dir(folder.path().join("shots")).unwrap();
    fs::write(folder.path().join("shots/shot.ron"), camera).unwrap();
    output(folder.path(), &["run", "shots/shot.ron", "--out", "out2"]);

    let dat = "50\n67\t1.5\t1.65\t25\n0\t1.5\t1.65\t25\n-67\t0\t1\t25\n";
    fs::write(folder.path().join("2el.dat"), dat).unwrap();
    let power = |wavelength_nm: &str, slope: &str| {
        let options = ["--wavelengths-nm", wavelength_nm, "--slope-per-nm", slope];
        let arguments = [&["lens", "info", "2el.dat", "--json"][..], &options].concat();
        json(folder.path(), &arguments)[0]["power_per_mm"].as_f64().unwrap()
    };
    assert_eq!(power("550", "-0.0001"), power("400", "0"));
    assert!(power("400", "-0.0001") > 1.02 * power("400", "0"));
    output(folder.path(), &["lens", "convert", "2el.dat", "2el.ron", "--slope-per-nm", "-0.0001"]);
    assert!(fs::read_to_string(folder.path().join("2el.ron")).unwrap().contains("slope_per_nm: -0.0001"));
}

#[test]
fn glasses_of_a_lens_alone_are_converted_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let lens = r#"(name: "own", source: "test", surfaces: [(radius_mm: 50.0, stop: true, semi_aperture_mm: 5.0,
        medium: Cauchy(a: 1.5, b_um2: 0.005), thickness_mm: 3.0), (radius_mm: -50.0, semi_aperture_mm: 5.0,
        thickness_mm: 0.0)])"#;
    fs::write(folder.path().join("own.ron"), lens).unwrap();
    output(folder.path(), &["lens", "convert", "own.ron", "copy.zmx"]);
    assert!(fs::read_to_string(folder.path().join("copy.agf")).unwrap().contains("NM PRIVATE1 1 "));
    let efl_mm = |file: &str| json(folder.path(), &["lens", "info", file, "--json"])[0]["efl_mm"].as_f64().unwrap();
    assert!((efl_mm("copy.zmx") / efl_mm("own.ron") - 1.0).abs() < 1e-12);
    // A catalogue that is another's is not written over.
    fs::write(folder.path().join("other.agf"), "NM MINE 1").unwrap();
    check_error(folder.path(), &["lens", "convert", "own.ron", "other.zmx"], &["other.agf", "choose another name"]);
    assert!(!folder.path().join("other.zmx").exists());
}

#[test]
fn what_reading_and_writing_lose_is_one_table_that_strict_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let lens = "RDM;LEN\nTITLE 'own'\nEPD 10\nWL 550\nYAN 0 5\nFOO 3\nSO 0 1E10\nS 50 5 NBK7_SCHOTT\n STO\nS -50 47\nSI 0\nGO\n";
    fs::write(folder.path().join("own.seq"), lens).unwrap();
    fs::write(folder.path().join("plain.seq"), lens.replace("FOO 3\n", "")).unwrap();
    let said = dioptric(folder.path(), &["lens", "convert", "own.seq", "own.json"]);
    let said = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(said.contains("  reading  not understood") && said.contains("FOO (line 6)"), "{said}");
    assert!(said.contains("  writing  a .json file has no place for"), "{said}");
    let strict = |from: &str, to: &str, words: &[&str]| {
        check_error(folder.path(), &["lens", "convert", from, to, "--strict"], words);
        assert!(!folder.path().join(to).exists());
    };
    strict("own.seq", "a.zmx", &["own.seq: not all that the file says is read", "FOO (line 6)"]);
    strict("plain.seq", "b.json", &["b.json: the format does not hold all of plain.seq", "fields"]);
    output(folder.path(), &["lens", "convert", "plain.seq", "c.zmx", "--strict"]);
}

#[test]
fn threads_change_no_bit_of_any_frame() {
    let folder = tempfile::tempdir().unwrap();
    let run = |threads: &str, out: &str| {
        let small = ["--pixels", "48x32", "--pixel-um", "660", "--wavelengths-nm", "450:650:100"];
        let arguments = [&["run", "--quiet", "--threads", threads, "--seed", "7", "--out", out][..], &small].concat();
        output(folder.path(), &arguments);
    };
    run("1", "one");
    run("2", "two");
    let both = |name: &str| ["one", "two"].map(|out| fs::read(folder.path().join(out).join(name)).unwrap());
    for name in ["irradiance.exr", "depth.exr", "volts.exr", "raw.png", "picture.png", "report.json"] {
        let [one, two] = both(name);
        assert!(one == two, "{name} differs");
    }
    let read = |name: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(folder.path().join("one").join(name)).unwrap()).unwrap()
    };
    let report = read("report.json");
    assert_eq!((report["film"]["columns"].as_u64(), report["camera"]["seed"].as_u64()), (Some(48), Some(7)));
    // Times are in a file of their own.
    let times = read("timings.json");
    let names = |times: &Value| -> Vec<String> {
        times.as_array().unwrap().iter().map(|time| time[0].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&times["stages_s"]).len(), 7);
    assert_eq!(names(&times["imaging_s"]), ["kernels", "sampling", "transforms", "direct", "compositing"]);
    assert!(times["imaging_s"].as_array().unwrap().iter().map(|part| part[1].as_f64().unwrap()).sum::<f64>() > 0.0);
}

#[test]
fn hurb_widens_by_the_gamma_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    // Of an ideal lens of long focus, nothing but HURB widens a star.
    let lens = r#"(name: "ideal", source: "test", surfaces: [(shape: ThinLens(power_per_mm: 0.005),
        semi_aperture_mm: 2.0, stop: true, thickness_mm: 0.0)])"#;
    fs::write(folder.path().join("ideal.ron"), lens).unwrap();
    let psf = ["psf", "ideal.ron", "--distances-mm", "inf", "--focus-mm", "inf", "--json"];
    let width_um = |options: &[&str]| {
        let row = json(folder.path(), &[&psf[..], options].concat())[0].clone();
        row["lsf_fwhm_um"].as_f64().unwrap()
    };
    let widths = [&["--gamma", "1"][..], &["--gamma", "2"], &[]]
        .map(|gamma| width_um(&[&["--diffraction", "hurb"], gamma].concat()));
    // The width goes with γ; λN is 27.5 µm, pixels of 1 µm widen it by some thousandths.
    assert!((widths[1] / widths[0] - 2.0).abs() < 0.01 && widths[0] == widths[2], "{widths:?}");
    assert!((width_um(&["--diffraction", "hurb-scene3d", "--gamma", "1"]) - widths[0]).abs() < 1e-12);
    for (options, words) in [
        (&["--diffraction", "hurb", "--gamma", "-1"][..], ["--gamma is -1", "expected"]),
        (&["--gamma", "1"], ["--gamma", "--diffraction hurb"]),
        (&["--diffraction", "wave", "--gamma", "1"], ["--gamma", "--diffraction hurb"]),
    ] {
        check_error(folder.path(), &[&psf[..], options].concat(), &words);
    }
}

#[test]
fn plane_mirror_asks_for_the_film() {
    let folder = tempfile::tempdir().unwrap();
    let mirror = "(name: \"fold\", source: \"test\", surfaces: [(stop: true, mirror: true, semi_aperture_mm: 10.0, \
                  thickness_mm: 0.0)])";
    fs::write(folder.path().join("fold.ron"), mirror).unwrap();
    for arguments in [
        &["lens", "draw", "fold.ron", "-o", "fold.svg"][..],
        &["psf", "fold.ron", "--focus-mm", "2000"],
        &["run", "--lens", "fold.ron", "--quality", "preview", "--out", "run"],
    ] {
        let found = dioptric(folder.path(), arguments);
        let message = String::from_utf8_lossy(&found.stderr).into_owned();
        assert!(!found.status.success() && message.contains("--film-mm"), "{arguments:?}: {message}");
    }
    output(folder.path(), &["lens", "draw", "fold.ron", "-o", "fold.svg", "--film-mm", "50"]);
    let psf = json(
        folder.path(),
        &["psf", "fold.ron", "--film-mm", "50", "--distances-mm", "2000", "--pixel-um", "200", "--json"],
    );
    // A disc of 10 mm about the axis, a little wider for the light of 2 m: √½ of its radius.
    let expected_um = 10_000.0 * (1.0 + 50.0 / 2000.0) * 0.5_f64.sqrt();
    assert!((psf[0]["rms_radius_um"].as_f64().unwrap() / expected_um - 1.0).abs() < 1e-3, "{psf}");
}

/// What edges beside the stop bend far from a point is spread as by a round pupil; at the stop they throw spikes.
#[test]
fn round_halos_of_other_pupils_are_stated() {
    let folder = tempfile::tempdir().unwrap();
    let lens = |apertures: &str| {
        format!(
            "(name: \"singlet\", source: \"test\", surfaces: [\
             (radius_mm: 50.0, stop: true, semi_aperture_mm: 6.0, medium: Named(\"SCHOTT:N-BK7\"), thickness_mm: 3.0), \
             (radius_mm: -50.0, semi_aperture_mm: 12.0, thickness_mm: 0.0)], apertures: [{apertures}])"
        )
    };
    fs::write(folder.path().join("open.ron"), lens("")).unwrap();
    for (name, surface) in [("at_stop.ron", 0), ("obscured.ron", 1)] {
        let obscured = lens(&format!("(surface: {surface}, outline: Circle(radius_mm: 2.0), is_obscuration: true)"));
        fs::write(folder.path().join(name), obscured).unwrap();
    }
    fs::write(folder.path().join("camera.ron"), common::CAMERA).unwrap();
    let is_noted = |file: &str, options: &[&str]| {
        let run = ["run", "camera.ron", "--lens", file, "--quality", "sketch", "--out", "run"];
        let found = dioptric(folder.path(), &[&run[..], options].concat());
        let notes = String::from_utf8_lossy(&found.stderr).into_owned();
        assert!(found.status.success(), "{notes}");
        notes.contains("is spread evenly around it: spikes end there")
    };
    assert!(is_noted("obscured.ron", &[]));
    assert!(
        !is_noted("open.ron", &[])
            && !is_noted("at_stop.ron", &[])
            && !is_noted("obscured.ron", &["--diffraction", "none"])
    );
}

#[test]
fn lens_info_has_the_light_that_gets_through() {
    let folder = tempfile::tempdir().unwrap();
    let of = |coating: &[&str]| {
        let records = json(folder.path(), &[&["lens", "info", "dgauss-50mm", "--json"], coating].concat());
        ["transmission", "t_number", "f_number"].map(|key| records[0][key].as_f64().unwrap())
    };
    let [share, t_number, f_number] = of(&[]);
    assert!((0.95..0.97).contains(&share) && (t_number / f_number - share.sqrt().recip()).abs() < 1e-12);
    assert_eq!(of(&["--coating", "mgf2"]), [share, t_number, f_number]);
    assert_eq!(of(&["--coating", "ideal"]), [1.0, f_number, f_number]);
    assert!(of(&["--coating", "bare"])[0] < 0.6 && of(&["--coating", "bbar"])[0] > 0.99);
    fs::write(
        folder.path().join("r.csv"),
        "wavelength_nm,angle_deg,r\n400,0,0.01\n400,60,0.01\n700,0,0.01\n700,60,0.01\n",
    )
    .unwrap();
    // Eight surfaces of 1 %, and two between glasses.
    assert!((0.915..0.99f64.powi(8)).contains(&of(&["--coating", "r.csv"])[0]));
    for (coating, words) in [("gold", "coatings are bare, mgf2"), ("none.csv", "cannot be read")] {
        let failed = dioptric(folder.path(), &["lens", "info", "dgauss-50mm", "--coating", coating]);
        assert!(!failed.status.success() && String::from_utf8_lossy(&failed.stderr).contains(words), "{coating}");
    }
}

#[test]
fn lens_ghosts_lists_what_pairs_of_surfaces_send() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["lens", "ghosts", "dgauss-50mm", "--fields-deg", "0,5", "--film-mm", "37.3768", "--n-rays", "2000"];
    let table = json(folder.path(), &[&common[..], &["--json"]].concat());
    let (fields, pairs) = (table["fields"].as_array().unwrap(), table["pairs"].as_array().unwrap());
    assert_eq!((fields.len(), pairs.len()), (2, 45));
    for field in fields {
        let ghosts = field["ghosts"].as_array().unwrap();
        let sum: f64 = ghosts.iter().map(|row| row["power_on_film"].as_f64().unwrap()).sum();
        let veil = field["veil"].as_f64().unwrap();
        assert!((sum / field["image"]["power_on_film"].as_f64().unwrap() / veil - 1.0).abs() < 1e-9);
        assert!((1e-5..1e-2).contains(&veil), "{veil}");
        let powers: Vec<f64> = ghosts.iter().map(|row| row["relative_power"].as_f64().unwrap()).collect();
        assert!(powers.is_sorted_by(|a, b| a >= b));
    }
    // The image of a source above the axis is above the middle of the picture.
    let y_mm = fields[1]["image"]["y_mm"].as_f64().unwrap();
    assert!((4.3..4.6).contains(&y_mm), "{y_mm}");
    let text = output(folder.path(), &common);
    assert!(text.contains("veil") && text.contains("45 pairs; the brightest"), "{text}");
    let none = json(folder.path(), &[&common[..], &["--coating", "ideal", "--json"]].concat());
    assert_eq!(none["pairs"], serde_json::json!([]));
}

#[test]
fn what_is_kept_from_run_to_run_is_told_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [("view-9x9-a.exr", 1000), ("view-9x9-b.exr", 24), ("mine.txt", 9)] {
        fs::write(folder.path().join(name), vec![0; bytes]).unwrap();
    }
    let told = |command: &str| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_dioptric"));
        let run = program.env("DIOPTRIC_CACHE", folder.path()).args(["cache", command, "--json"]).output().unwrap();
        let kept: Value = serde_json::from_slice(&run.stdout).unwrap();
        assert_eq!(kept["folder"], folder.path().to_str().unwrap());
        (kept["views"].as_u64().unwrap(), kept["bytes"].as_u64().unwrap())
    };
    assert_eq!(["info", "clear", "info"].map(told), [(2, 1024), (2, 1024), (0, 0)]);
    assert!(folder.path().join("mine.txt").exists());
    // Here no folder is kept at all.
    check_error(folder.path(), &["cache", "info"], &["DIOPTRIC_CACHE", "nothing is kept"]);
}
