//! Frames of pixels with a stack: what the optics of pixels do to an even light.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use approx::assert_relative_eq;
use dioptric_sensor::{
    Cfa, ElectronRate, ExitPupil, Filter, Illumination, ImagePlace, Interfaces, Microlens, MicrolensOutline,
    MicrolensPower, MicrolensShift, PixelStack, QuantumEfficiencyOf, ReadLines, RollingShutter, Sensor, StackLayer,
};
use dioptric_spectrum::{Quantity, SpectralImage, Spectrum, WavelengthGrid};
use ndarray::Array2;

/// A sensor of 3 × 2.4 mm whose microlenses have their focus on the photodiodes, 2.6 µm deep.
fn sensor(shift: MicrolensShift) -> Sensor {
    let microlens = Microlens {
        power: MicrolensPower::FocusOnPhotodiode,
        outline: MicrolensOutline::Gapless,
        shift,
        center_mm: [0.0; 2],
    };
    let pixel_stack = PixelStack {
        photodiode_um: 1.2,
        layers: vec![StackLayer { thickness_um: 1.2, index: 1.6 }, StackLayer { thickness_um: 2.0, index: 1.46 }],
        microlens: Some(microlens),
        interfaces: Interfaces::Coated,
        quantum_efficiency: QuantumEfficiencyOf::Pixel,
    };
    let quantum_efficiency = Spectrum::new(vec![400.0, 700.0], vec![0.5, 0.5]).unwrap();
    let filter = Filter { name: "Y".to_owned(), quantum_efficiency, exposure_fraction: 1.0 };
    let plain = Sensor::built_in("machine-vision-mono").unwrap();
    let (cfa, filters) = (Cfa::Mosaic(vec![vec!["Y".to_owned()]]), vec![filter]);
    Sensor { pixel_pitch_um: 2.0, rows: 1200, columns: 1500, cfa, filters, pixel_stack: Some(pixel_stack), ..plain }
}

fn even((rows, columns): (usize, usize)) -> SpectralImage {
    let grid = WavelengthGrid::uniform(450.0, 650.0, 100.0).unwrap();
    let planes = vec![Array2::from_elem((rows, columns), 1e-3_f32); grid.len()];
    SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap()
}

fn pupil(distance_mm: f64, f_number: f64) -> ExitPupil {
    ExitPupil { f_number, ..ExitPupil::centered(distance_mm) }
}

fn rate(sensor: &Sensor, image: &SpectralImage, exit_pupil: Option<ExitPupil>) -> Array2<f32> {
    let light = Illumination { exit_pupil, ..Illumination::on_pixels(image) };
    sensor.electron_rate(&light).unwrap().planes_e_per_s.remove(0)
}

#[test]
fn the_frame_has_the_factor_of_each_place() {
    let image = even((1200, 1500));
    let sensor = sensor(MicrolensShift::ExitPupilMm(6.0));
    let plain = Sensor { pixel_stack: None, ..sensor.clone() };
    let whole = rate(&plain, &image, None);
    for pupil in [pupil(3.0, 1.4), pupil(-5.0, 2.0), pupil(f64::INFINITY, 1.8), pupil(4.0, f64::INFINITY)] {
        let frame = rate(&sensor, &image, Some(pupil));
        let response = sensor.angular_response(Some(pupil)).unwrap();
        for (row, column) in [(0, 0), (599, 749), (1199, 1499), (200, 900), (900, 77), (1150, 40)] {
            let place_mm = [2e-3 * (column as f64 - 749.5), 2e-3 * (row as f64 - 599.5)];
            let found = f64::from(frame[(row, column)] / whole[(row, column)]);
            // Tables of 33 (129) nodes.
            assert!((found - response.factor_at_mm(place_mm)).abs() < 2e-3, "{pupil:?} {row} {column}: {found}");
        }
    }
}

#[test]
fn slow_light_along_the_axis_makes_the_electrons_of_the_sheet() {
    let image = even((40, 50));
    let sensor = sensor(MicrolensShift::None);
    let plain = rate(&Sensor { pixel_stack: None, ..sensor.clone() }, &image, None);
    assert_eq!(rate(&sensor, &image, None), plain);
    for (found, expected) in rate(&sensor, &image, Some(pupil(f64::INFINITY, 16.0))).iter().zip(&plain) {
        assert_relative_eq!(found, expected, max_relative = 1e-6);
    }
    // A photodiode's own quantum efficiency counts what reaches it: bare, its share of the area.
    let mut bare = sensor;
    let stack = bare.pixel_stack.as_mut().unwrap();
    (stack.microlens, stack.quantum_efficiency) = (None, QuantumEfficiencyOf::Photodiode);
    let share = 0.36_f64;
    assert_relative_eq!(f64::from(rate(&bare, &image, None)[(3, 3)] / plain[(3, 3)]), share, max_relative = 1e-6);
    assert_relative_eq!(bare.quantum_efficiency(0, 550.0), 0.5 * share, max_relative = 1e-12);
}

#[test]
fn shifted_microlenses_keep_the_corners_bright() {
    let corner = |shift: MicrolensShift| {
        let sensor = sensor(shift);
        let response = sensor.angular_response(Some(pupil(3.0, 2.0))).unwrap();
        response.factor_at_mm([1.5, 1.2]) / response.factor_at_mm([0.0; 2])
    };
    let (none, half, right, optimal) = (
        corner(MicrolensShift::None),
        corner(MicrolensShift::ExitPupilMm(6.0)),
        corner(MicrolensShift::ExitPupilMm(3.0)),
        corner(MicrolensShift::Optimal),
    );
    assert!(none < 0.3 && none < half && half < 0.9 && right > 0.9, "{none} {half} {right}");
    assert_relative_eq!(right, optimal, max_relative = 1e-12);
}

/// What a preview or a part of a film shows is the whole array's.
#[test]
fn parts_and_previews_keep_their_places() {
    let sensor = sensor(MicrolensShift::Shrink(1.0e-3));
    let whole = sensor.angular_response(Some(pupil(3.0, 2.0))).unwrap().factor_at_mm([0.9, -0.4]);
    let in_part = |middle_mm: [f64; 2], binning: usize| {
        let stack = sensor.pixel_stack.as_ref().unwrap().seen_in_part(middle_mm, binning);
        let part = Sensor { pixel_stack: Some(stack), ..sensor.clone() };
        let scale = 1.0 / binning as f64;
        let axis_mm = middle_mm.map(|mm| -scale * mm);
        let pupil = ExitPupil { distance_mm: 3.0 * scale, axis_mm, f_number: 2.0 };
        let place_mm = [scale * (0.9 - middle_mm[0]), scale * (-0.4 - middle_mm[1])];
        part.angular_response(Some(pupil)).unwrap().factor_at_mm(place_mm)
    };
    for (middle_mm, binning) in [([0.5, -0.2], 1), ([0.0; 2], 4), ([0.3, 0.7], 2)] {
        assert_relative_eq!(in_part(middle_mm, binning), whole, max_relative = 1e-9);
    }
}

/// Pixels of another pitch are larger or smaller ones of the same shape, behind the same lens: a coarser film of the same size sees the same.
#[test]
fn coarser_pixels_take_the_same_at_the_same_place() {
    let table = vec![(0.0, 0.0), (0.5, 8.0), (1.5, 24.0)];
    for shift in [
        MicrolensShift::None,
        MicrolensShift::Optimal,
        MicrolensShift::ExitPupilMm(5.0),
        MicrolensShift::Shrink(1.0e-3),
        MicrolensShift::ChiefRayDeg(table),
    ] {
        let fine = sensor(shift);
        let factor =
            |sensor: &Sensor| sensor.angular_response(Some(pupil(3.0, 2.0))).unwrap().factor_at_mm([0.9, -0.4]);
        assert_relative_eq!(factor(&fine.with_pitch_um(9.0)), factor(&fine), max_relative = 1e-9);
    }
}

#[test]
fn frames_of_a_rolling_shutter_lose_the_same() {
    let image = even((60, 80));
    let sensor = Sensor { pixel_pitch_um: 2.0, ..sensor(MicrolensShift::None) }.with_size(60, 80);
    let exit_pupil = Some(pupil(0.2, 1.8));
    let still: ElectronRate = sensor.filter_rates(&Illumination::on_pixels(&image)).unwrap();
    let shutter = RollingShutter { start_s: 0.0, exposure_s: 0.01, row_time_s: 1e-5, rows: ReadLines::SINGLE };
    let at_rest = |_: f64| -> ImagePlace { [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
    let rolled = sensor.rolling_rate(&still, (60, 80), &shutter, &at_rest, exit_pupil).unwrap();
    let expected = rate(&sensor, &image, exit_pupil);
    assert!(expected[(0, 0)] < 0.6 * expected[(30, 40)]);
    for (found, expected) in rolled.planes_e_per_s[0].iter().zip(&expected) {
        assert_relative_eq!(found, expected, max_relative = 1e-5);
    }
}

#[test]
fn a_stack_beside_a_chief_ray_response_is_refused() {
    let both = Sensor { chief_ray_response: vec![(0.0, 1.0), (30.0, 0.5)], ..sensor(MicrolensShift::None) };
    let message = both.check().unwrap_err().to_string();
    assert!(message.contains("pixel_stack") && message.contains("chief_ray_response"), "{message}");
    let response = |pupil| sensor(MicrolensShift::None).angular_response(Some(pupil)).map(|_| ());
    assert!(response(pupil(3.0, 0.5)).unwrap_err().to_string().contains("f_number"));
    assert!(response(pupil(0.0, 2.0)).unwrap_err().to_string().contains("distance_mm"));
}
