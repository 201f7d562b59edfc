//! Numbers that `OpticStudio` printed, and the page that states them beside our own.

use std::fmt::Write;

use dioptric_optics::{D_LINE_NM, Glass, Interface, Lens, Surface};

/// The page with the table.
const PAGE: &str = include_str!("../../../../docs/opticstudio.md");

/// A quantity of a lens: its name, our number, and what `OpticStudio` printed.
type Row = (&'static str, f64, &'static str);

/// Radius, distance to the next vertex and glass behind each surface.
fn lens(name: &str, stop: usize, stop_mm: f64, sides: &[(f64, f64, &str)]) -> Lens {
    let interface = |(i, &(radius_mm, thickness_after_mm, glass)): (usize, &(f64, f64, &str))| Interface {
        surface: Surface::sphere(radius_mm, if i == stop { stop_mm } else { 0.45 * radius_mm.abs().min(70.0) }),
        medium_after: if glass.is_empty() { Glass::Air } else { Glass::Named(glass.to_owned()) },
        thickness_after_mm,
    };
    Lens::new(name, "test", sides.iter().enumerate().map(interface).collect(), stop).unwrap()
}

/// The singlet of LAC9 whose stop is its rear surface.
fn singlet() -> Vec<Row> {
    let sides = [(63.73364157, 10.0, "HOYA:LAC9"), (653.2939232, 0.0, "")];
    let image_mm = 92.7383463;
    let first = lens("singlet", 1, 0.5 * 23.39711, &sides).at(D_LINE_NM).unwrap().first_order_of_stop();
    vec![
        ("focal length", first.efl_mm, "101.501826"),
        ("entrance pupil, from the first vertex", first.entrance_pupil_z_mm, "6.318809"),
        ("exit pupil, from the image", first.exit_pupil_z_mm - image_mm, "-92.738346"),
        ("f-number", first.efl_mm / 25.0, "4.060073"),
        ("back focal point, from the image", first.bfl_mm - image_mm, "2.255622"),
        ("exit pupil diameter", 25.0 * first.exit_pupil_diameter_mm / first.entrance_pupil_diameter_mm, "23.39711"),
    ]
}

/// The sample "Cooke 40 degree field", at 550 nm.
fn cooke() -> Vec<Row> {
    let (sk16, f2) = ("HIKARI:SK16", "SCHOTT:F2");
    let sides = [
        (22.01359, 3.25896, sk16),
        (-435.76044, 6.00755, ""),
        (-22.21328, 0.99997, f2),
        (20.29192, 4.75041, ""),
        (79.6836, 2.95208, sk16),
        (-18.39533, 0.0, ""),
    ];
    let image_mm = 42.20778;
    let first = lens("Cooke", 3, 4.0, &sides).at(550.0).unwrap().first_order_of_stop();
    vec![
        ("focal length", first.efl_mm, "49.999783"),
        ("exit pupil, from the image", first.exit_pupil_z_mm - image_mm, "-50.961348"),
        ("back focal point, from the image", first.bfl_mm - image_mm, "0.207078"),
    ]
}

/// The sample "Double Gauss 28 degree field" at f/5 and the d line.
fn double_gauss() -> Vec<Row> {
    let (ssk2, sk2, f5, sk16) = ("SCHOTT:N-SSK2", "SCHOTT:N-SK2", "SCHOTT:F5", "SCHOTT:N-SK16");
    let plane = f64::INFINITY;
    let sides = [
        (56.20238, 8.75, ssk2),
        (152.2858, 0.5, ""),
        (37.68262, 12.5, sk2),
        (plane, 3.8, f5),
        (24.2313, 16.369445, ""),
        (plane, 13.747957, ""),
        (-28.37731, 3.8, f5),
        (plane, 11.0, sk16),
        (-37.92546, 0.5, ""),
        (177.41176, 7.0, sk16),
        (-79.41143, 0.0, ""),
    ];
    let image_mm = 61.487536;
    let first = lens("double Gauss", 5, 6.0, &sides).at(587.6).unwrap().first_order_of_stop();
    let pupil_mm = first.efl_mm / 5.0;
    vec![
        ("focal length", first.efl_mm, "100.003748"),
        ("entrance pupil diameter", pupil_mm, "20.00075"),
        ("exit pupil diameter", pupil_mm * first.pupil_magnification(), "22.92889"),
        ("exit pupil, from the image", first.exit_pupil_z_mm - image_mm, "-114.64442"),
    ]
}

fn table() -> String {
    let mut text = String::new();
    for (lens, rows) in [("singlet of LAC9", singlet()), ("Cooke 40°", cooke()), ("double Gauss 28°", double_gauss())]
    {
        for (quantity, own, printed) in rows {
            let decimals = printed.split_once('.').map_or(0, |(_, digits)| digits.len());
            writeln!(text, "| {lens} | {quantity} | {printed} | {own:.decimals$} |").unwrap();
        }
    }
    text
}

#[test]
fn numbers_are_those_of_opticstudio_in_all_digits() {
    for (quantity, own, printed) in [singlet(), cooke(), double_gauss()].into_iter().flatten() {
        let decimals = printed.split_once('.').map_or(0, |(_, digits)| digits.len() as i32);
        let theirs: f64 = printed.parse().unwrap();
        // A unit of the last digit, which both round.
        assert!((own - theirs).abs() <= 10f64.powi(-decimals), "{quantity}: {own} beside {printed}");
    }
}

#[test]
fn the_page_beside_opticstudio_has_these_numbers() {
    let table = table();
    assert!(PAGE.contains(&table), "docs/opticstudio.md should have\n{table}");
}
