//! `dioptric measure` on the built program: known pictures and frames in, their parameters out.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{fs, path::Path};

use common::{check_error, output};
use dioptric_pictures::save;
use image::{GrayImage, ImageBuffer, Luma, Rgb};
use serde_json::Value;

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&output(folder, arguments)).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The profile of an edge blurred by a Gaussian: Φ(d / σ) by its series of sines (the transform of the MTF), which is
/// exact to 1e-6 where d is less than 40 σ.
fn blurred_edge(distance: f64, sigma: f64) -> f64 {
    let step = 0.02 / sigma;
    let term = |i: u32| {
        let w = (f64::from(i) + 0.5) * step;
        (w * distance).sin() * (-0.5 * (w * sigma).powi(2)).exp() / w
    };
    0.5 + step / std::f64::consts::PI * (0..350).map(term).sum::<f64>()
}

const SIGMA_PX: f64 = 0.8;

/// A linear 16-bit gray picture with an edge slanted by 5°, from 10 to 70 % of full scale.
fn edge_picture(side: u32, gain: impl Fn(u32, u32) -> f64) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    let (sin, cos) = 5.0_f64.to_radians().sin_cos();
    ImageBuffer::from_fn(side, side, |x, y| {
        let half = 0.5 * f64::from(side);
        let distance = (f64::from(x) - half) * cos + (f64::from(y) - half) * sin;
        let light = 0.1 + 0.6 * blurred_edge(distance.clamp(-20.0, 20.0), SIGMA_PX);
        Luma([(light * gain(x, y) * 65535.0).round() as u16])
    })
}

/// Where the MTF of the blur is one half, cycles a pixel: exp(−2 (π σ f)²) = ½.
fn half_frequency() -> f64 {
    (0.5 * 2.0_f64.ln()).sqrt() / (std::f64::consts::PI * SIGMA_PX)
}

#[test]
fn an_edge_is_found_and_has_its_mtf50() {
    let folder = tempfile::tempdir().unwrap();
    save(&edge_picture(120, |_, _| 1.0).into(), &folder.path().join("edge.png")).unwrap();
    let arguments = ["measure", "mtf", "edge.png", "--pixel-um", "4", "--json", "-o", "out"];
    let measured = json(folder.path(), &arguments);
    let channel = &measured["channels"][0];
    // The bar of the e-SFR tests: MTF50 within 1 %.
    let mtf50 = number(&channel["mtf50_cycles_per_pixel"]);
    assert!((mtf50 / half_frequency() - 1.0).abs() < 0.01, "{mtf50}, not {}", half_frequency());
    assert!((number(&channel["mtf50_cycles_per_mm"]) / (mtf50 * 250.0) - 1.0).abs() < 1e-9);
    assert!((number(&measured["slant_deg"]) - 5.0).abs() < 0.1);
    for name in ["mtf.json", "mtf.svg", "report.html"] {
        assert!(fs::metadata(folder.path().join("out").join(name)).unwrap().len() > 1000, "{name}");
    }
    assert!(output(folder.path(), &["measure", "mtf", "edge.png"]).contains("MTF50P"));
}

#[test]
fn edges_of_several_pictures_are_rows_of_a_table() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("shots")).unwrap();
    save(&edge_picture(120, |_, _| 1.0).into(), &folder.path().join("shots/b.png")).unwrap();
    save(&edge_picture(140, |_, _| 1.0).into(), &folder.path().join("shots/a.png")).unwrap();
    fs::write(folder.path().join("broken.png"), "no picture").unwrap();
    let line = ["measure", "mtf", "shots", "broken.png", "shots/b.png", "--pixel-um", "4"];
    let measured = json(folder.path(), &[&line[..], &["--json", "-o", "out"]].concat());
    let names: Vec<&str> =
        measured["pictures"].as_array().unwrap().iter().map(|p| p["picture"].as_str().unwrap()).collect();
    assert_eq!(names, ["shots/a.png", "shots/b.png", "shots/b.png"]);
    assert_eq!(measured["not_measured"][0]["picture"], "broken.png");
    let alone = json(folder.path(), &["measure", "mtf", "shots/b.png", "--pixel-um", "4", "--json"]);
    assert_eq!((&measured["pictures"][1], &measured["pictures"][2]), (&alone, &alone));
    let csv = fs::read_to_string(folder.path().join("out/mtf.csv")).unwrap();
    assert_eq!(csv.lines().count(), 5, "{csv}");
    assert!(csv.lines().nth(1).unwrap().starts_with("\"shots/a.png\",\"Y\","), "{csv}");
    let table = output(folder.path(), &line);
    assert!(table.contains("3 of 4 pictures") && table.contains("broken.png"), "{table}");
    check_error(folder.path(), &["measure", "mtf", "shots", "--all"], &["--all", "one picture"]);
    fs::create_dir(folder.path().join("empty")).unwrap();
    check_error(folder.path(), &["measure", "mtf", "empty"], &["empty", "holds no picture"]);
    check_error(folder.path(), &["measure", "mtf", "broken.png", "broken.png"], &["broken.png", "none of the 2"]);
}

/// A linear 16-bit gray picture of discs in a fixed disorder, pixels of 1 or of the mean over so many neighbors along a row.
fn disc_picture(side: u32, box_px: u32) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    let mix = |i: u32| f64::from((i.wrapping_mul(2_654_435_761) >> 8) & 0xffff) / 65536.0;
    let mut plane = vec![0.5; (side * side) as usize];
    for i in 0..side * side / 2 {
        let radius = (1.5 / (1.0 - mix(4 * i)).sqrt()).min(20.0);
        let (x, y) = (mix(4 * i + 1) * f64::from(side), mix(4 * i + 2) * f64::from(side));
        let (n, reach) = (side as usize, |at: f64| ((at - radius).max(0.0) as usize, (at + radius) as usize + 1));
        for row in reach(y).0..reach(y).1.min(n) {
            for column in reach(x).0..reach(x).1.min(n) {
                if (column as f64 - x).hypot(row as f64 - y) <= radius {
                    plane[row * n + column] = 0.2 + 0.6 * mix(4 * i + 3);
                }
            }
        }
    }
    ImageBuffer::from_fn(side, side, |x, y| {
        let among = |i: u32| plane[(y * side + (x + i).min(side - 1)) as usize];
        Luma([((0..box_px).map(among).sum::<f64>() / f64::from(box_px) * 65535.0).round() as u16])
    })
}

#[test]
fn a_texture_is_measured_against_its_reference() {
    let folder = tempfile::tempdir().unwrap();
    let keep = |name: &str, box_px: u32| save(&disc_picture(160, box_px).into(), &folder.path().join(name)).unwrap();
    keep("sharp.png", 1);
    keep("soft.png", 2);
    let arguments = ["measure", "texture", "soft.png", "--reference", "sharp.png", "--json", "-o", "out"];
    let measured = json(folder.path(), &arguments);
    let channel = &measured["channels"][0];
    for method in ["direct", "full_reference"] {
        let acutance = number(&channel[method]["acutance"]);
        assert!((0.5..0.99).contains(&acutance), "{acutance}");
    }
    // A mean of a pixel and the next one is half a pixel to the left of the pixel.
    assert!((number(&channel["shift_columns_px"]) + 0.5).abs() < 0.02, "{channel}");
    assert!(number(&channel["shift_rows_px"]).abs() < 0.02 && number(&channel["coherence"]) > 0.99);
    assert!(folder.path().join("out/texture.json").exists() && folder.path().join("out/texture.svg").exists());
    let table = output(folder.path(), &["measure", "texture", "sharp.png", "--reference", "sharp.png"]);
    assert!(table.contains("full reference") && table.contains("1.0000"), "{table}");
}

#[test]
fn a_mosaic_is_measured_filter_by_filter() {
    let folder = tempfile::tempdir().unwrap();
    // Filters of different sensitivity would look like edges themselves.
    let gain = |x: u32, y: u32| [1.0, 0.6, 0.4][((x % 2) + (y % 2)) as usize];
    save(&edge_picture(200, gain).into(), &folder.path().join("raw.png")).unwrap();
    let measured = json(folder.path(), &["measure", "mtf", "raw.png", "--mosaic", "RGGB", "--json"]);
    let channels = measured["channels"].as_array().unwrap();
    let names: Vec<&str> = channels.iter().map(|c| c["channel"].as_str().unwrap()).collect();
    assert_eq!(names, ["R", "G", "B"]);
    for channel in channels {
        let mtf50 = number(&channel["mtf50_cycles_per_pixel"]);
        assert!((mtf50 / half_frequency() - 1.0).abs() < 0.01, "{}: {mtf50}", channel["channel"]);
    }
}

/// Points of Gaussian light in linear 16-bit gray: column, row and standard deviation, pixels.
fn points_picture(points: &[(f64, f64, f64)]) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    ImageBuffer::from_fn(160, 120, |x, y| {
        let light = points.iter().enumerate().map(|(i, &(column, row, sigma))| {
            let r2 = (f64::from(x) - column).powi(2) + (f64::from(y) - row).powi(2);
            (0.8 - 0.2 * i as f64) * (-0.5 * r2 / (sigma * sigma)).exp()
        });
        Luma([((0.05 + light.sum::<f64>()) * 65535.0).round() as u16])
    })
}

#[test]
fn points_have_their_places_and_moments() {
    let folder = tempfile::tempdir().unwrap();
    save(&points_picture(&[(100.3, 40.6, 3.0), (40.0, 80.25, 2.0)]).into(), &folder.path().join("points.png")).unwrap();
    let measured = json(folder.path(), &["measure", "spot", "points.png", "--pixel-um", "2", "--json", "-o", "out"]);
    let spots = measured["spots"].as_array().unwrap();
    assert_eq!(spots.len(), 2);
    for (spot, (column, row, sigma)) in spots.iter().zip([(100.3, 40.6, 3.0), (40.0, 80.25, 2.0)]) {
        // Sixteen bits and windows of five standard deviations and more.
        let close = |key: &str, expected: f64, within: f64| {
            assert!((number(&spot[key]) - expected).abs() < within, "{key}: {} not {expected}", spot[key]);
        };
        close("column", column, 0.01);
        close("row", row, 0.01);
        close("centroid_x_mm", 2e-3 * (column - 79.5), 2e-5);
        close("centroid_y_mm", 2e-3 * (59.5 - row), 2e-5);
        close("sigma_x_um", 2.0 * sigma, 0.02);
        close("rms_radius_um", 2.0 * sigma * 2.0_f64.sqrt(), 0.03);
        // Encircled energy takes pixels as even squares, which widens the spot by a twelfth of a pixel squared.
        let widened = (sigma * sigma + 1.0 / 12.0_f64).sqrt();
        close("ee50_radius_um", 2.0 * widened * 1.1774, 0.03);
        close("ee80_radius_um", 2.0 * widened * 1.7941, 0.03);
    }
    assert!(folder.path().join("out/spot.svg").exists() && folder.path().join("out/spot.json").exists());
}

#[test]
fn a_sensor_on_the_bench_and_its_frames_from_files_agree() {
    let folder = tempfile::tempdir().unwrap();
    let bench =
        ["measure", "noise", "--sensor", "machine-vision-mono", "--size", "128", "--levels", "20", "--stack", "16"];
    let kept = ["--keep-frames", "frames", "--json", "-o", "frames"];
    let simulated = json(folder.path(), &[&bench[..], &kept].concat());
    let sheet = &simulated["data_sheet"];
    // 128² pixels: the variance of each of 14 levels is known to 1.1 %, K to 0.6 %.
    for (key, within) in [("gain_dn_per_e", 0.02), ("quantum_efficiency", 0.02), ("dark_noise_e", 0.04)] {
        let ratio = number(&simulated[key]) / number(&sheet[key]);
        assert!((ratio - 1.0).abs() < within, "{key}: {ratio}");
    }
    let from_files = json(folder.path(), &["measure", "noise", "frames", "--json"]);
    for key in ["gain_dn_per_e", "dark_noise_e", "dsnu_e", "prnu_percent", "dynamic_range_db", "max_snr_db"] {
        let [a, b] = [&simulated, &from_files].map(|data| number(&data[key]));
        // The descriptor holds photons to six places.
        assert!((a / b - 1.0).abs() < 1e-6, "{key}: {a} and {b}");
    }
    for name in ["noise.json", "photon-transfer.svg", "snr.svg", "report.html"] {
        assert!(folder.path().join("frames").join(name).exists(), "{name}");
    }
    // Without a descriptor the photons are not known, but the gain is.
    fs::remove_file(folder.path().join("frames/descriptor.txt")).unwrap();
    for entry in fs::read_dir(folder.path().join("frames")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        // The dark frames of longer times do not belong to the flat frames.
        if name.starts_with("dark") && !name.starts_with("dark-000") {
            fs::remove_file(path).unwrap();
        }
    }
    let by_name = json(folder.path(), &["measure", "noise", "frames", "--json"]);
    assert!(by_name["quantum_efficiency"].is_null());
    assert!((number(&by_name["gain_dn_per_e"]) / number(&simulated["gain_dn_per_e"]) - 1.0).abs() < 0.02);
}

/// 24 patches of even gray-ish colors in sRGB; the real ones come from `dioptric` itself in other tests.
fn chart_picture(shift: u8) -> ImageBuffer<Rgb<u8>, Vec<u8>> {
    // sRGB of the 24 patches as they are commonly printed (BabelColor's averages), D65.
    const PATCHES: [[u8; 3]; 24] = [
        [115, 82, 68],
        [194, 150, 130],
        [98, 122, 157],
        [87, 108, 67],
        [133, 128, 177],
        [103, 189, 170],
        [214, 126, 44],
        [80, 91, 166],
        [193, 90, 99],
        [94, 60, 108],
        [157, 188, 64],
        [224, 163, 46],
        [56, 61, 150],
        [70, 148, 73],
        [175, 54, 60],
        [231, 199, 31],
        [187, 86, 149],
        [8, 133, 161],
        [243, 243, 242],
        [200, 200, 200],
        [160, 160, 160],
        [122, 122, 121],
        [85, 85, 85],
        [52, 52, 52],
    ];
    ImageBuffer::from_fn(280, 200, |x, y| {
        let (i, j) = ((x as i32 - 20).div_euclid(40), (y as i32 - 20).div_euclid(40));
        let inside = |v: u32| (v as i32 - 20).rem_euclid(40) >= 4;
        if (0..6).contains(&i) && (0..4).contains(&j) && inside(x) && inside(y) {
            let [r, g, b] = PATCHES[(6 * j + i) as usize];
            Rgb([r.saturating_add(shift), g, b])
        } else {
            Rgb([20, 20, 20])
        }
    })
}

#[test]
fn a_chart_is_found_and_two_pictures_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    save(&chart_picture(0).into(), &folder.path().join("chart.png")).unwrap();
    save(&chart_picture(6).into(), &folder.path().join("reddish.png")).unwrap();
    let found = json(folder.path(), &["measure", "color", "chart.png", "--json", "-o", "out"]);
    assert_eq!(found["patches"].as_array().unwrap().len(), 24);
    // Published sRGB values, 8 bits and the charts of different years: a few ΔE at most.
    assert!(number(&found["mean_delta_e"]) < 3.0, "{}", found["mean_delta_e"]);
    let given =
        json(folder.path(), &["measure", "color", "chart.png", "--json", "--corners", "22,22,258,22,258,178,22,178"]);
    assert!((number(&given["mean_delta_e"]) - number(&found["mean_delta_e"])).abs() < 0.05);
    let reddish = json(folder.path(), &["measure", "color", "reddish.png", "--json"]);
    assert!(number(&reddish["mean_delta_e"]) > number(&found["mean_delta_e"]) + 0.5);
    for name in ["color.json", "color-ab.svg", "color-delta-e.svg"] {
        assert!(folder.path().join("out").join(name).exists(), "{name}");
    }

    let compare = ["measure", "color", "chart.png", "--json", "--against"];
    let same = json(folder.path(), &[&compare[..], &["chart.png"]].concat());
    assert!(same["psnr_db"].is_null() && number(&same["scielab"]["max"]) < 1e-3);
    assert!((number(&same["ssim"]) - 1.0).abs() < 1e-4);
    let other = json(folder.path(), &[&compare[..], &["reddish.png", "--patch", "30,150,20,20", "-o", "cmp"]].concat());
    // Red differs by 6 codes of 255 in the patches: 10 log10(3 / (share of patches × (6/255)²)).
    let share = 36.0 * 36.0 * 24.0 / (280.0 * 200.0);
    let expected = 10.0 * (3.0 / (share * (6.0_f64 / 255.0).powi(2))).log10();
    assert!((number(&other["psnr_db"]) - expected).abs() < 0.05, "{} not {expected}", other["psnr_db"]);
    assert!(number(&other["scielab"]["mean"]) > 0.5 && folder.path().join("cmp/scielab.svg").exists());
}

#[test]
fn bad_input_ends_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    save(&GrayImage::from_pixel(64, 64, Luma([90])).into(), &path.join("even.png")).unwrap();
    save(&chart_picture(0).into(), &path.join("chart.png")).unwrap();
    let mut hidden = chart_picture(0);
    let before = (60..136).flat_map(|y| (60..136).map(move |x| (x, y)));
    before.for_each(|(x, y)| hidden.put_pixel(x, y, Rgb([240; 3])));
    save(&hidden.into(), &path.join("hidden.png")).unwrap();
    fs::write(path.join("text.png"), "no picture").unwrap();
    fs::write(path.join("list.txt"), "b 10 many\n").unwrap();
    fs::create_dir(path.join("empty")).unwrap();
    for (arguments, words) in [
        (&["mtf", "absent.png"][..], &["absent.png"][..]),
        (&["mtf", "text.png"], &["text.png"]),
        (&["mtf", "even.png"], &["even.png", "slanted edge"]),
        (&["mtf", "even.png", "--region", "1,2,3"], &["--region", "x,y,w,h"]),
        (&["mtf", "even.png", "--region", "40,0,64,64"], &["64 × 64", "40"]),
        (&["mtf", "even.png", "--mosaic", "RGB"], &["--mosaic", "RGGB"]),
        (&["mtf", "chart.png", "--mosaic", "RGGB"], &["--mosaic"]),
        (&["mtf", "even.png", "--pixel-um", "0"], &["--pixel-um"]),
        (&["mtf", "even.png", "-o", "even.png"], &["cannot write even.png"]),
        (&["texture", "even.png", "--reference", "absent.png"], &["absent.png"]),
        (&["texture", "even.png", "--reference", "even.png"], &["even.png", "the texture", "flat"]),
        (&["texture", "even.png", "--reference", "chart.png"], &["chart.png", "64 × 64"]),
        (&["texture", "even.png", "--reference", "even.png", "--region", "0,0,32,32"], &["at least 64 × 64"]),
        (&["texture", "chart.png", "--reference", "chart.png", "--flat", "0,0,8,8"], &["patch of at least 32 × 32"]),
        (&["texture", "chart.png", "--reference", "chart.png", "--second-frame", "even.png"], &["even.png", "280"]),
        (&["texture", "even.png", "--reference", "even.png", "--pixels-per-degree", "0"], &["--pixels-per-degree"]),
        (&["spot", "even.png"], &["even.png", "spot"]),
        (&["spot", "chart.png", "--window", "4"], &["--window", "odd"]),
        (&["noise", "absent"], &["absent"]),
        (&["noise", "empty"], &["empty", "dark"]),
        (&["noise", "list.txt"], &["list.txt:1", "many"]),
        (&["noise", "--sensor", "no-such"], &["no-such", "imx363"]),
        (&["noise", "--sensor", "imx363", "--filter", "X"], &["'X'", "R, G, B"]),
        (&["noise", "--sensor", "imx363", "--wavelength-nm", "2000"], &["2000 nm"]),
        (&["noise", "--sensor", "imx363", "--size", "2"], &["side", "2"]),
        (&["color", "even.png"], &["even.png", "chart", "corners"]),
        (&["color", "hidden.png"], &["4 (purplish blue, moderate red, green, red)", "not seen whole"]),
        (&["color", "chart.png", "--corners", "0,0,1"], &["--corners"]),
        (&["color", "chart.png", "--corners", "0,0,900,0,900,900,0,900"], &["within"]),
        (&["color", "chart.png", "--illuminant", "D66"], &["D66", "D65"]),
        (&["color", "chart.png", "--against", "even.png"], &["280", "64 × 64"]),
        (&["color", "chart.png", "--against", "chart.png", "--pixels-per-degree", "0"], &["--pixels-per-degree is 0"]),
    ] {
        check_error(path, &[&["measure"], arguments].concat(), words);
    }
}

#[test]
fn a_region_has_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    // Linear gray of 0.3, a brighter half, and a color beside them.
    let gray = ImageBuffer::from_fn(40, 20, |x, _| Luma([if x < 20 { 19_661_u16 } else { 39_322 }]));
    save(&gray.into(), &folder.path().join("gray.png")).unwrap();
    let measured =
        json(folder.path(), &["measure", "region", "gray.png", "--region", "0,0,20,20", "--json", "-o", "out"]);
    let channel = &measured["channels"][0];
    assert!((number(&channel["mean"]) - 0.3).abs() < 1e-4 && number(&channel["deviation"]) == 0.0, "{channel}");
    assert!(channel["signal_to_noise"].is_null() && number(&channel["uniformity"]) == 1.0);
    assert!(folder.path().join("out/region.json").exists() && folder.path().join("out/histogram.svg").exists());
    let color = ImageBuffer::from_fn(40, 20, |x, _| Rgb(if x < 20 { [188_u8, 188, 188] } else { [188, 170, 188] }));
    save(&color.into(), &folder.path().join("color.png")).unwrap();
    let arguments = ["measure", "region", "color.png", "--region", "20,0,20,20", "--reference", "0,0,20,20", "--json"];
    let measured = json(folder.path(), &arguments);
    assert_eq!(measured["channels"].as_array().unwrap().len(), 4);
    let difference = &measured["difference"];
    assert!(number(&difference["delta_e_2000"]) > 5.0 && number(&difference["delta_e_76"]) > 5.0, "{difference}");
    // Less green than gray is magenta.
    assert!(number(&measured["color"]["lab"][1]) > 5.0 && number(&measured["color"]["duv"]) < 0.0, "{measured}");
    common::check_error(folder.path(), &["measure", "region", "gray.png", "--region", "30,0,20,20"], &["40 × 20"]);
}

#[test]
fn a_raw_file_is_measured_by_its_frame_and_its_mosaic() {
    let folder = tempfile::tempdir().unwrap();
    let camera = common::CAMERA.replace("pattern: Uniform", "pattern: SlantedBar(slope: 6.0)");
    fs::write(folder.path().join("camera.ron"), camera.replace("columns: 48, rows: 32", "columns: 144, rows: 144"))
        .unwrap();
    let run = ["run", "camera.ron", "--noise", "none", "--also", "raw-dng", "--out", "shot", "--quiet"];
    output(folder.path(), &run);
    let measured = json(folder.path(), &["measure", "region", "shot/raw.dng", "--region", "4,4,20,20", "--json"]);
    let names: Vec<&str> =
        measured["channels"].as_array().unwrap().iter().map(|c| c["channel"].as_str().unwrap()).collect();
    assert_eq!(names, ["R", "G", "B"]);
    assert_eq!(number(&measured["channels"][1]["n_samples"]), 200.0);
    // The whole frame and not the preview in it.
    let whole = json(folder.path(), &["measure", "region", "shot/raw.dng", "--json"]);
    assert_eq!((number(&whole["region"]["columns"]), number(&whole["region"]["rows"])), (144.0, 144.0));
    common::check_error(
        folder.path(),
        &["measure", "color", "shot/raw.dng"],
        &["raw.dng", "mosaic", "dioptric develop"],
    );
}

/// A PNG file of one color of 8 bits, with what `state` says of its colors.
fn color_file(path: &Path, codes: [u8; 3], state: impl FnOnce(&mut png::Info<'_>)) {
    let mut info = png::Info::with_size(64, 48);
    (info.color_type, info.bit_depth) = (png::ColorType::Rgb, png::BitDepth::Eight);
    state(&mut info);
    let points = info.coding_independent_code_points;
    let encoder = png::Encoder::with_info(fs::File::create(path).unwrap(), info).unwrap();
    let mut writer = encoder.write_header().unwrap();
    // The encoder leaves this chunk to its user.
    if let Some(points) = points {
        let numbers = [points.color_primaries, points.transfer_function, 0, 1];
        writer.write_chunk(png::chunk::cICP, &numbers).unwrap();
    }
    writer.write_image_data(&codes.repeat(64 * 48)).unwrap();
}

/// The chromaticity of a picture's mean, and its luminance.
fn color_of(folder: &Path, file: &str) -> [f64; 3] {
    let color = &json(folder, &["measure", "region", file, "--json"])["color"];
    [number(&color["xy"][0]), number(&color["xy"][1]), number(&color["xyz"][1])]
}

#[test]
fn colors_are_those_that_a_file_states() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // Pure primaries have the chromaticities of their standards: Display P3's red, Adobe RGB's green by gAMA and cHRM, BT.2020's blue by cICP.
    let profile = dioptric_pictures::CodeSpace::DisplayP3.icc_profile();
    color_file(&at("p3.png"), [255, 0, 0], |info| info.icc_profile = Some(profile.into()));
    color_file(&at("adobe.png"), [0, 186, 0], |info| {
        info.source_gamma = Some(png::ScaledFloat::new(1.0 / 2.2));
        let primaries = ((0.3127, 0.329), (0.64, 0.33), (0.21, 0.71), (0.15, 0.06));
        info.source_chromaticities =
            Some(png::SourceChromaticities::new(primaries.0, primaries.1, primaries.2, primaries.3));
    });
    let points = |transfer_function: u8| png::CodingIndependentCodePoints {
        color_primaries: 9,
        transfer_function,
        matrix_coefficients: 0,
        is_video_full_range_image: true,
    };
    color_file(&at("2020.png"), [0, 0, 255], |info| info.coding_independent_code_points = Some(points(13)));
    color_file(&at("pq.png"), [0, 0, 255], |info| info.coding_independent_code_points = Some(points(16)));
    color_file(&at("plain.png"), [255, 0, 0], |_| ());
    for (file, xy) in [
        ("p3.png", [0.680, 0.320]),
        ("adobe.png", [0.21, 0.71]),
        ("2020.png", [0.131, 0.046]),
        ("plain.png", [0.64, 0.33]),
    ] {
        let [x, y, _] = color_of(folder.path(), file);
        assert!((x - xy[0]).abs() < 1e-3 && (y - xy[1]).abs() < 1e-3, "{file}: {x}, {y}");
    }
    // Half the light of the green: 186 / 255 to the power of 2.2.
    let [.., luminance] = color_of(folder.path(), "adobe.png");
    assert!((luminance / (0.6274 * (186.0_f64 / 255.0).powf(2.2)) - 1.0).abs() < 2e-3, "{luminance}");
    check_error(folder.path(), &["measure", "region", "pq.png"], &["pq.png", "cICP 9, 16", "PQ"]);
}

#[test]
fn photographs_become_scenes_of_their_own_colors() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let profile = dioptric_pictures::CodeSpace::DisplayP3.icc_profile();
    // A color within both gamuts, as codes of each: linear (0.5, 0.4, 0.3) of P3 is by the matrix from P3 to sRGB (0.5225, 0.3942, 0.2894).
    let code = |v: f64| (255.0 * (1.055 * v.powf(1.0 / 2.4) - 0.055)).round() as u8;
    color_file(&at("p3.png"), [0.5, 0.4, 0.3].map(code), |info| info.icc_profile = Some(profile.clone().into()));
    color_file(&at("srgb.png"), [0.5225, 0.3942, 0.2894].map(code), |_| ());
    color_file(&at("red.png"), [255, 0, 0], |info| info.icc_profile = Some(profile.clone().into()));
    let convert = |file: &str| {
        let words = ["scene", "convert", file, "out.exr", "--depth-m", "2", "--fov-deg", "20"];
        let said = output(folder.path(), &words);
        let measured = json(folder.path(), &["measure", "region", "out.exr", "--json"]);
        (said, [0, 1, 2].map(|i| number(&measured["color"]["xyz"][i])))
    };
    let ((_, p3), (_, srgb)) = (convert("p3.png"), convert("srgb.png"));
    for (a, b) in p3.iter().zip(srgb) {
        // A step of a code is 0.9 % of the light.
        assert!((a / b - 1.0).abs() < 0.012, "{p3:?} {srgb:?}");
    }
    assert!(convert("red.png").1[0] > 0.0);
}
