//! Numbers that `OpticStudio` printed.

use dioptric_optics::{D_LINE_NM, Glass, Interface, Lens, Surface};

/// The digits that `OpticStudio` printed of a singlet of LAC9 with its stop on the rear surface (Optiland's issue 710).
#[test]
fn first_order_is_that_of_opticstudio() {
    let side = |radius_mm: f64, semi_aperture_mm: f64, glass: Glass, thickness_after_mm: f64| Interface {
        surface: Surface::sphere(radius_mm, semi_aperture_mm),
        medium_after: glass,
        thickness_after_mm,
    };
    let lac9 = Glass::Named("HOYA:LAC9".to_owned());
    let sides = vec![side(63.73364157, 14.0, lac9, 10.0), side(653.2939232, 0.5 * 23.39711, Glass::Air, 0.0)];
    let lens = Lens::new("singlet", "test", sides, 1).unwrap().at(D_LINE_NM).unwrap();
    let first = lens.first_order_of_stop();
    let beside = [
        (first.efl_mm, 101.501826),
        (first.entrance_pupil_z_mm, 6.318809),
        (first.entrance_pupil_diameter_mm, 25.0),
        (first.exit_pupil_diameter_mm, 23.39711),
        (first.exit_pupil_z_mm - 92.7383463, -92.738346),
        (first.bfl_mm - 92.7383463, 2.255622),
    ];
    for (own, printed) in beside {
        // The last printed digit is 1e-6; the stop's diameter has five decimals.
        assert!((own - printed).abs() < if printed == 25.0 { 1e-5 } else { 1e-6 }, "{own} {printed}");
    }
}
