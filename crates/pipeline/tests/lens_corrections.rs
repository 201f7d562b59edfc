//! Pictures freed of the aberrations of the lens that they were simulated with.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::glam::{DMat3, DVec2, DVec3};
use dioptric_pipeline::{
    Camera, Capture, Crop, Diffraction, FilmSpec, FlatSize, FocusSpec, KeptCamera, LensSpec, LightFieldSpec,
    MicroArray, MicroElements, MicroLayout, Movements, Quality, SceneSource, SceneSpec, SenseRequest, SensorSpec,
    Silent, StopSpec, WavelengthSpec,
};
use dioptric_scene::Pattern;
use dioptric_sensor::{
    AutoExposure, ColorCorrection, ExposureControl, Interfaces, LensCorrections, Metering, NoiseSources, PixelStack,
    Processing, QuantumEfficiencyOf, Sensor, StackLayer, ToneCurve, WhiteBalance,
};
use dioptric_spectrum::Cancel;

/// From point to point of the target, samples of 7.5 mm.
const SPACING_PX: usize = 40;
const ROWS: usize = 400;
const COLUMNS: usize = 600;

/// A point of the lattice by number, across and down from the middle, and where it is in each channel, columns and rows.
type FoundPoint = (DVec2, [DVec2; 3]);

/// A target 10.5 m wide and 3 m away through a wide-angle lens whose barrel distortion is 46 pixels in the corners, and whose lateral
/// color is .4; on a sensor of three stacked channels.
fn before(pattern: Pattern) -> Camera {
    let mut camera = Camera::demo().unwrap();
    camera.lens = LensSpec::BuiltIn("wide-100deg".to_owned());
    camera.stop = StopSpec::FNumber(11.0);
    camera.scene = SceneSpec {
        source: SceneSource::Target { pattern, columns: 1400, rows: 1000 },
        flat: Some(FlatSize { width_mm: 10500.0, distance_mm: 3000.0 }),
        ..camera.scene
    };
    camera.focus = FocusSpec::DistanceMm(3000.0);
    camera.film = FilmSpec::Pixels { columns: COLUMNS, rows: ROWS, pitch_um: 28.0 };
    camera.wavelengths = WavelengthSpec::Range { first_nm: 440.0, last_nm: 660.0, step_nm: 20.0 };
    camera.diffraction = Diffraction::None;
    camera.sensor = SensorSpec::BuiltIn("ideal".to_owned());
    camera.exposure = ExposureControl::Auto(AutoExposure::new(Metering::Peak, 0.9));
    camera.noise = NoiseSources::NONE;
    camera.processing = Processing {
        white: WhiteBalance::None,
        color: ColorCorrection::None,
        curve: ToneCurve::Linear,
        ..Processing::plain()
    };
    camera
}

fn with(camera: &Camera, lens_corrections: LensCorrections) -> Camera {
    let mut camera = camera.clone();
    camera.processing.lens_corrections = lens_corrections;
    camera
}

fn capture(camera: Camera) -> Capture {
    KeptCamera::new(camera).capture(&Silent, &Cancel::new()).unwrap()
}

/// Returns the centroid of what stands out of its surroundings in a window, columns and rows, in one channel.
fn centroid(shot: &Capture, about: DVec2, channel: usize) -> DVec2 {
    const HALF: i64 = 7;
    let codes = &shot.developed.picture.codes;
    let window = |dy: i64, dx: i64| (about.y.round() as i64 + dy, about.x.round() as i64 + dx);
    let value = |(row, column): (i64, i64)| f64::from(codes[(row as usize, column as usize, channel)]);
    let all = || (-HALF..=HALF).flat_map(move |dy| (-HALF..=HALF).map(move |dx| window(dy, dx)));
    let floor = all().map(value).fold(f64::MAX, f64::min);
    let (sum, weight) = all().fold((DVec2::ZERO, 0.0), |(sum, weight), at| {
        let light = value(at) - floor;
        (sum + light * DVec2::new(at.1 as f64, at.0 as f64), weight + light)
    });
    sum / weight
}

/// Returns where the points of the lattice lie, by number across and down from the middle, in each channel: sought at the affine
/// places first, then where they are.
fn found(shot: &Capture, place: impl Fn(DVec2) -> DVec2) -> Vec<FoundPoint> {
    let (rows, columns, _) = shot.developed.picture.codes.dim();
    let lattice =
        (-12..=12).flat_map(|down| (-16..=16).map(move |right| DVec2::new(f64::from(right), f64::from(down))));
    let inside = |at: DVec2| at.x > 9.0 && at.y > 9.0 && at.x < columns as f64 - 10.0 && at.y < rows as f64 - 10.0;
    lattice
        .map(|node| (node, place(node)))
        .filter(|(_, at)| inside(*at))
        .map(|(node, at)| (node, [0, 1, 2].map(|channel| centroid(shot, centroid(shot, at, 1), channel))))
        .collect()
}

/// Returns the brightest pixel within half the distance of neighboring points.
fn brightest_about(shot: &Capture, about: DVec2) -> DVec2 {
    let codes = &shot.developed.picture.codes;
    let half = (0.5 * step_px(shot)) as i64;
    let offsets =
        (-half..=half).flat_map(|dy| (-half..=half).map(move |dx| (about.y as i64 + dy, about.x as i64 + dx)));
    let light = |&(row, column): &(i64, i64)| codes[(row as usize, column as usize, 1)];
    let (row, column) = offsets.max_by(|a, b| light(a).total_cmp(&light(b))).unwrap();
    DVec2::new(column as f64, row as f64)
}

/// Returns the largest distance of the points from the best affine lattice, pixels, and the largest between channels.
fn errors_px(points: &[FoundPoint]) -> (f64, f64) {
    let (mut normal, mut across, mut down) = (DMat3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for (node, places) in points {
        let row = DVec3::new(node.x, node.y, 1.0);
        normal += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        (across, down) = (across + row * places[1].x, down + row * places[1].y);
    }
    let (across, down) = (normal.inverse() * across, normal.inverse() * down);
    let off = |(node, places): &FoundPoint| {
        let row = DVec3::new(node.x, node.y, 1.0);
        places[1].distance(DVec2::new(row.dot(across), row.dot(down)))
    };
    let apart = |(_, places): &FoundPoint| places[0].distance(places[2]).max(places[0].distance(places[1]));
    let most = |of: &dyn Fn(&FoundPoint) -> f64| points.iter().map(of).fold(0.0, f64::max);
    (most(&off), most(&apart))
}

/// Pixels of the picture from point to point near the axis: 7.5 mm a sample from 3 m and the entrance pupil's depth in the lens.
fn step_px(shot: &Capture) -> f64 {
    let lens = &shot.lens.reference;
    let tan = SPACING_PX as f64 * 7.5 / (3000.0 + lens.projection_center_z_mm());
    1e3 * lens.film_scale_mm(shot.place.film_distance_mm).abs() * tan / shot.place.pitch_um
}

#[test]
fn points_of_a_lattice_lie_on_a_lattice_in_every_channel() {
    let camera = before(Pattern::PointArray { spacing_px: SPACING_PX });
    let kept = KeptCamera::new(camera.clone());
    let shoot = |corrections| {
        kept.with(|own| own.processing.lens_corrections = corrections).capture(&Silent, &Cancel::new()).unwrap()
    };
    let shot = shoot(LensCorrections::ALL);
    let step_px = step_px(&shot);
    let middle = DVec2::new(0.5 * (COLUMNS - 1) as f64, 0.5 * (ROWS - 1) as f64);
    let straight = found(&shot, |node| middle + step_px * node);
    assert!(straight.len() > 60, "{}", straight.len());
    let (off_px, apart_px) = errors_px(&straight);
    // A point is one sample of the target, 1.3 pixels wide: where it lies is known to a tenth of a pixel.
    assert!(off_px < 0.15 && apart_px < 0.1, "{off_px} {apart_px}");
    // The middle keeps its scale: that of first order.
    let beside = |right: f64| straight.iter().find(|(node, _)| *node == DVec2::new(right, 0.0)).unwrap().1[1];
    let scale = (beside(3.0) - beside(-3.0)).x / (6.0 * step_px);
    assert!((scale - 1.0).abs() < 2e-3, "{scale}");

    // Without distortion lateral color is left, and the other way about.
    let shot = shoot(LensCorrections { lateral_color: false, ..LensCorrections::ALL });
    let (off_px, apart_px) = errors_px(&found(&shot, |node| middle + step_px * node));
    assert!(off_px < 0.15 && apart_px > 0.2, "{off_px} {apart_px}");
    let shot = shoot(LensCorrections { lateral_color: true, ..LensCorrections::default() });
    let barrel = |node: DVec2| {
        let straight = step_px * node;
        let radius_px = straight.length();
        // About where the lens has them; the windows are wide enough for the rest.
        let kept = if radius_px < 250.0 { 1.0 - 0.13 * (radius_px / 360.0).powi(2) } else { f64::INFINITY };
        middle + straight * kept
    };
    let curved = found(&shot, barrel);
    let (off_px, apart_px) = errors_px(&curved);
    assert!(off_px > 2.0 && apart_px < 0.1, "{off_px} {apart_px}");
}

#[test]
fn a_moved_lens_is_straightened_too() {
    let mut camera = before(Pattern::PointArray { spacing_px: SPACING_PX });
    camera.film = FilmSpec::Pixels { columns: 420, rows: 280, pitch_um: 28.0 };
    // A band or two a channel: a lens without an axis is traced over the whole film at each.
    camera.wavelengths = WavelengthSpec::Range { first_nm: 440.0, last_nm: 660.0, step_nm: 55.0 };
    for movements in [
        Movements { rise_mm: 1.5, shift_mm: -0.5, ..Movements::default() },
        Movements { tilt_deg: 1.0, rise_mm: 0.5, ..Movements::default() },
    ] {
        let camera = Camera { movements, ..camera.clone() };
        let shot = capture(with(&camera, LensCorrections::ALL));
        // A tilted lens moves its picture: the point nearest to the middle is as good a beginning as any.
        let middle = brightest_about(&shot, DVec2::new(209.5, 139.5));
        let step_px = step_px(&shot);
        let points = found(&shot, |node| middle + step_px * node);
        let (off_px, apart_px) = errors_px(&points);
        assert!(points.len() > 20 && off_px < 0.2 && apart_px < 0.1, "{movements:?}: {off_px} {apart_px}");
    }
}

#[test]
fn parts_and_previews_are_those_of_the_whole() {
    let camera = with(&before(Pattern::Checkerboard { check_px: 90 }), LensCorrections::ALL);
    let whole = capture(camera.clone());
    let crop = Crop { x: 10, y: 50, columns: 90, rows: 300 };
    let exposure = ExposureControl::Manual(whole.frames.exposure);
    let part = capture(Camera { crop: Some(crop), exposure, ..camera.clone() });
    let (of_part, of_whole) = (&part.developed.picture.codes, &whole.developed.picture.codes);
    let mut worst = 0.0_f32;
    let mut n_black = 0_u32;
    for ((row, column, channel), &code) in of_part.indexed_iter() {
        if code == 0.0 {
            n_black += 1;
            continue;
        }
        // The last columns before what is beyond are spread from the border.
        if column + 6 < 90 && of_part[(row, column + 6, channel)] > 0.0 {
            worst = worst.max((code - of_whole[(row + 50, column + 10, channel)]).abs());
        }
    }
    // Tables of the part and of the whole are interpolated between other nodes.
    assert!(worst < 0.03, "{worst}");
    let summary = part.aberrations.as_ref().unwrap().summary;
    assert_eq!(summary.scale, whole.aberrations.as_ref().unwrap().summary.scale);
    let black_fraction = f64::from(n_black) / of_part.len() as f64;
    assert!(summary.beyond_fraction > 0.0 && (summary.beyond_fraction - black_fraction).abs() < 0.03);

    let preview = KeptCamera::new(camera).with_quality(Quality::Preview).capture(&Silent, &Cancel::new()).unwrap();
    let (few, full) = (preview.aberrations.unwrap().summary, whole.aberrations.unwrap().summary);
    let binning = preview.place.binning as f64;
    assert!(binning > 1.0);
    assert!((few.largest_distortion_px * binning / full.largest_distortion_px - 1.0).abs() < 0.02, "{few:?} {full:?}");
}

#[test]
fn an_even_plane_is_even() {
    // A lens that vignettes, and pixels that see less from aside.
    let mut camera = before(Pattern::Uniform);
    camera.lens = LensSpec::BuiltIn("wide-6mm".to_owned());
    camera.film = FilmSpec::Pixels { columns: 300, rows: 200, pitch_um: 20.0 };
    let mut by_table = camera.sensor.open().unwrap();
    by_table.chief_ray_response = vec![(0.0, 1.0), (10.0, 0.95), (30.0, 0.6)];
    let by_stack = Sensor { chief_ray_response: Vec::new(), pixel_stack: Some(stack()), ..by_table.clone() };
    for sensor in [by_table, by_stack] {
        check_evenness(&camera, &sensor);
    }
}

/// A rise is followed; that a turned lens's axis meets the film elsewhere is not, and is stated where pixels depend on it.
#[test]
fn angles_that_are_left_out_are_stated() {
    let mut camera = before(Pattern::Uniform);
    camera.film = FilmSpec::Pixels { columns: 60, rows: 40, pitch_um: 100.0 };
    let plain = camera.sensor.open().unwrap();
    let by_stack = Sensor { pixel_stack: Some(stack()), ..plain.clone() };
    let notes = |movements: Movements, sensor: &Sensor| {
        let kept = KeptCamera::new(Camera { movements, ..camera.clone() }).with_quality(Quality::Sketch);
        let shot =
            kept.with_given_sensor(dioptric_pipeline::Given::new(sensor.clone())).capture(&Silent, &Cancel::new());
        shot.unwrap().lens_notes().iter().filter(|note| note.contains("tilts and decentered surfaces are")).count()
    };
    let tilted = Movements { tilt_deg: 2.0, ..Movements::default() };
    let raised = Movements { rise_mm: 1.0, ..Movements::default() };
    assert_eq!([tilted, raised, Movements::default()].map(|moved| notes(moved, &by_stack)), [1, 0, 0]);
    assert_eq!(notes(tilted, &plain), 0);
}

/// Pixels of 4 µm that lose oblique light: a bare photodiode below 4 µm of oxide.
fn stack() -> PixelStack {
    PixelStack {
        photodiode_um: 3.6,
        layers: vec![StackLayer { thickness_um: 4.0, index: 1.46 }],
        microlens: None,
        interfaces: Interfaces::Coated,
        quantum_efficiency: QuantumEfficiencyOf::Pixel,
    }
}

#[track_caller]
fn check_evenness(camera: &Camera, sensor: &Sensor) {
    let shoot = |corrections: LensCorrections| {
        let kept = KeptCamera::new(with(camera, corrections));
        kept.with_given_sensor(dioptric_pipeline::Given::new(sensor.clone())).capture(&Silent, &Cancel::new()).unwrap()
    };
    let evenness = |shot: &Capture| {
        let codes = &shot.developed.picture.codes;
        let channel = |k: usize| {
            let values = codes.slice(ndarray::s![.., .., k]);
            let (low, high) = values.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
            low / high
        };
        (0..3).map(channel).fold(1.0, f32::min)
    };
    let (plain, even) =
        (shoot(LensCorrections::default()), shoot(LensCorrections { vignetting: true, ..LensCorrections::default() }));
    assert!(evenness(&plain) < 0.6);
    assert!(evenness(&even) > 0.99, "{}", evenness(&even));
    let gain = even.aberrations.unwrap().summary.largest_gain;
    assert!((gain * f64::from(evenness(&plain)) - 1.0).abs() < 0.05, "{gain}");
}

#[test]
fn a_light_field_is_refused() {
    let mut camera = with(&before(Pattern::Uniform), LensCorrections::ALL);
    camera.light_field = Some(LightFieldSpec::Array(MicroArray {
        elements: MicroElements::Holes { diameter_mm: 0.02 },
        pitch_mm: 0.28,
        gap_mm: 0.5,
        layout: MicroLayout::default(),
        offset_mm: (0.0, 0.0),
        turned_deg: 0.0,
    }));
    let message = KeptCamera::new(camera).capture(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("lens_corrections"), "{message}");
}

#[test]
fn irradiance_without_its_lens_is_refused() {
    let camera = with(&before(Pattern::Uniform), LensCorrections::ALL);
    let request = SenseRequest {
        filters: Vec::new(),
        sensor: camera.sensor,
        pixel_um: None,
        exposure: camera.exposure,
        frames: camera.frames,
        processing: camera.processing,
        noise: camera.noise,
        illuminant: None,
        exit_pupil_mm: None,
        f_number: None,
        seed: 1,
        chip_seed: 0,
        outputs: camera.outputs,
    };
    let message = request.sense(std::path::Path::new("irradiance.exr")).unwrap_err().to_string();
    assert!(message.starts_with("lens_corrections") && message.contains("--from"), "{message}");
}
