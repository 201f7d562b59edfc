//! Light fields of two planes, against the geometry of a thin lens.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{fmt::Write, fs, ops::Range, sync::OnceLock};

use dioptric_pipeline::{
    ArrayFrame, Camera, DepthSearch, FilmSpec, FrameFile, KeptCamera, LightField, LightFieldSpec, Movements, Silent,
    write_capture,
};
use dioptric_spectrum::Cancel;
use ndarray::Array2;

/// Depths of the planes, m: the near one fills the left half of the picture, the far one the right half.
const NEAR_M: f64 = 0.45;
const FAR_M: f64 = 0.9;
/// Focus, mm; image distances of an ideal lens of 50 mm.
const FOCUS_MM: f64 = 600.0;

fn image_mm(object_mm: f64) -> f64 {
    1.0 / (1.0 / 50.0 - 1.0 / object_mm)
}

/// A plane of glowing cells about 5 samples of a view wide, turned by 11° so that their edges lie anywhere between samples.
fn plane(text: &mut String, z_m: f64, x_m: Range<f64>, seed: u32) {
    let cell_m = 5.0 * 1e-4 * 1e3 * z_m / image_mm(FOCUS_MM);
    let mut hash = seed;
    let mut cells = [const { String::new() }; 3];
    let mut numbers = [const { String::new() }; 3];
    let mut n_cells = [0; 3];
    let (sin, cos) = 11_f64.to_radians().sin_cos();
    for (row, column) in (-30..30).flat_map(|row| (-40..40).map(move |column| (row, column))) {
        hash = hash.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let level = (hash >> 30) as usize;
        let corner = |right: i32, up: i32| {
            let (u, v) = (cell_m * f64::from(column + right), cell_m * f64::from(row + up));
            (u * cos - v * sin, u * sin + v * cos)
        };
        let corners = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
        if level == 3 || corners.iter().any(|(x, _)| !x_m.contains(x)) {
            continue;
        }
        for (x, y) in corners {
            write!(cells[level], "{x} {y} {z_m} ").unwrap();
        }
        let first = 4 * n_cells[level];
        write!(numbers[level], "{first} {} {} {first} {} {} ", first + 1, first + 2, first + 2, first + 3).unwrap();
        n_cells[level] += 1;
    }
    for level in 0..3 {
        // Their spectra alone would have no level: lights of pbrt files are scaled to equal luminance.
        let light = level + 2;
        writeln!(
            text,
            "AttributeBegin AreaLightSource \"diffuse\" \"spectrum L\" [ 300 1 900 1 ] \"float scale\" {light} \"bool twosided\" true \
             Shape \"trianglemesh\" \"integer indices\" [ {} ] \"point3 P\" [ {} ] AttributeEnd",
            numbers[level], cells[level]
        )
        .unwrap();
    }
    // What the cells leave free.
    let [left, right] = [x_m.start, x_m.end];
    let behind_m = z_m + 1e-4;
    writeln!(
        text,
        "AttributeBegin AreaLightSource \"diffuse\" \"spectrum L\" [ 300 1 900 1 ] \"bool twosided\" true \
         Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ {left} -1 {behind_m}  {left} 1 {behind_m}  \
         {right} 1 {behind_m}  {right} -1 {behind_m} ] AttributeEnd"
    )
    .unwrap();
}

fn kept(light_field: &str, lens_mm: f64, film: &str) -> (tempfile::TempDir, KeptCamera) {
    let mut world = "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 16\nLookAt 0 0 0  0 0 1  0 1 0\n\
                     Camera \"perspective\" \"float fov\" 5\nWorldBegin\n"
        .to_owned();
    plane(&mut world, NEAR_M, -1.0..0.0, 1);
    plane(&mut world, FAR_M, -1.0..1.0, 2);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("planes.pbrt"), world).unwrap();
    let text = format!(
        r#"(
        name: "planes",
        lens: Thin(focal_length_mm: 50.0, diameter_mm: {lens_mm}),
        focus: DistanceMm({FOCUS_MM}),
        film: {film},
        diffraction: None,
        light_field: {light_field},
        sensor: BuiltIn("nikon-d5100"),
        scene: (source: World((file: "planes.pbrt", effort: Samples(16), paths: Emission))),
        wavelengths: ListNm([550.0]),
    )"#
    );
    let camera = Camera::parse(&text, &folder.path().join("camera.ron")).unwrap();
    (folder, KeptCamera::new(camera))
}

/// Lenses of f/2 before 720 × 480 pixels of 10 µm: 71 × 47 elements, the image of the pupil 9.2 pixels wide.
fn plenoptic() -> (tempfile::TempDir, KeptCamera) {
    kept(
        "Array((elements: Lenses(focal_length_mm: 0.2), pitch_mm: 0.1, gap_mm: 0.2))",
        25.0,
        "Pixels(columns: 720, rows: 480, pitch_um: 10.0)",
    )
}

/// Its light field, taken once.
fn field() -> &'static LightField {
    static FIELD: OnceLock<LightField> = OnceLock::new();
    FIELD.get_or_init(|| plenoptic().1.light_field(None, &Silent, &Cancel::new()).unwrap())
}

/// Returns how far `to` shows what `from` shows to the left of it, pixels: where the sum of squared differences over a part of
/// the picture is least. Both are smoothed, so that values between samples are those of a line between them.
fn moved_left_px(from: &Array2<f32>, to: &Array2<f32>, part: &Part, range: Range<f64>) -> f64 {
    let smooth = |plane: &Array2<f32>| {
        let (rows, columns) = plane.dim();
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let weight = |d: i64| if d == 0 { 0.5 } else { 0.25 };
            let at = |down: i64, right: i64| {
                let row = (row as i64 + down).clamp(0, rows as i64 - 1) as usize;
                plane[(row, (column as i64 + right).clamp(0, columns as i64 - 1) as usize)]
            };
            (-1..=1)
                .flat_map(|d| (-1..=1).map(move |r| (d, r)))
                .map(|(d, r)| weight(d) * weight(r) * at(d, r))
                .sum::<f32>()
        })
    };
    let (from, to) = (smooth(from), smooth(to));
    let off = |by: f64| {
        let mut sum = 0.0;
        for (row, column) in part.0.clone().flat_map(|row| part.1.clone().map(move |column| (row, column))) {
            // Half of it each way, so that both pictures are smoothed alike.
            let at = |plane: &Array2<f32>, place: f64| {
                let low = place.floor();
                let share = (place - low) as f32;
                plane[(row, low as usize)] * (1.0 - share) + plane[(row, low as usize + 1)] * share
            };
            let difference = at(&from, column as f64 + 0.5 * by) - at(&to, column as f64 - 0.5 * by);
            sum += f64::from(difference * difference);
        }
        sum
    };
    let n = 200;
    let at = |i: usize| range.start + (range.end - range.start) * i as f64 / f64::from(n);
    let best = (0..=n as usize).min_by(|&a, &b| off(at(a)).total_cmp(&off(at(b)))).unwrap();
    let step = at(1) - at(0);
    let [before, here, after] = [-1.0, 0.0, 1.0].map(|d| off(at(best) + d * step));
    at(best) + 0.5 * step * (before - after) / (before - 2.0 * here + after)
}

/// Rows and columns of a part of a view.
type Part = (Range<usize>, Range<usize>);

/// Parts of the views that show one plane alone, also where it moves.
fn parts(field: &LightField) -> [(f64, Part); 2] {
    let (rows, columns) = field.size();
    let rows = 6..rows - 6;
    [(NEAR_M, (rows.clone(), 6..columns / 2 - 6)), (FAR_M, (rows, columns / 2 + 6..columns - 6))]
}

#[test]
fn views_move_as_similar_triangles_say() {
    let field = field();
    let ((n_rows, n_columns), (rows, columns)) = (field.n_views(), field.size());
    // 25 mm by 0.2 of 54.5 mm, in pixels of 10 µm; the pupil's images of 71 and 47 elements fit on the film.
    assert_eq!(((n_rows, n_columns), (rows, columns)), ((9, 9), (47, 71)));
    let still_mm = image_mm(FOCUS_MM);
    // Neighboring views see through places of the lens a pixel times v/g apart.
    let step_mm = 0.01 * still_mm / 0.2;
    for (depth_m, part) in parts(field) {
        let image_mm = image_mm(1e3 * depth_m);
        // Light of a pixel off the middle counts cos⁴, and so crosses its lens off the center: 4/12 p²/g² of a pixel.
        let crossing_px = 4.0 / 12.0 * 0.25 * 0.1;
        let expected = step_mm * (image_mm - still_mm) / image_mm / 0.1 + crossing_px;
        assert!((field.geometry().disparity_px(depth_m) / expected - 1.0).abs() < 1e-9);
        // Across, from the left to the right, and up, where turned by 90°: below is what is to the left.
        let view = |row: usize, column: usize| field.view(row, column).unwrap()[1].clone();
        assert!(field.is_whole(4, 1) && field.is_whole(4, 7) && !field.is_whole(0, 0));
        let range = |sign: f64| if sign > 0.0 { 2.0..8.0 } else { -8.0..-2.0 };
        let across = moved_left_px(&view(4, 1), &view(4, 7), &part, range(expected)) / 6.0;
        let turned = (part.1.clone(), part.0.clone());
        let [below, above] = [view(7, 4), view(1, 4)].map(|plane| plane.reversed_axes());
        // Up in the picture is to lower rows, so what moves down moves to the right of the turned picture.
        let up = -moved_left_px(&below, &above, &turned, range(-expected)) / 6.0;
        for found in [across, up] {
            assert!((found / expected - 1.0).abs() < 0.01, "{depth_m} m: {found} {expected}");
        }
    }
}

#[test]
fn refocusing_finds_each_plane() {
    let field = field();
    for (depth_m, part) in parts(field) {
        let contrast = |disparity_px: f64| {
            let picture = &field.refocused(disparity_px)[1];
            f64::from(picture.slice(ndarray::s![part.0.clone(), part.1.clone()]).var(0.0))
        };
        let middle = field.geometry().disparity_px(depth_m);
        let at = |i: i32| middle + 0.02 * f64::from(i);
        let found = (-15..=15).map(|i| (i, contrast(at(i)))).collect::<Vec<_>>();
        let &(best, _) = found.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(best.abs() < 14, "{best}");
        // A parabola over the top of the curve.
        let near = |k: i32| contrast(at(best + 4 * k));
        let [before, here, after] = [-1, 0, 1].map(near);
        let sharpest = at(best) + 0.08 * 0.5 * (before - after) / (before - 2.0 * here + after);
        let found_m = field.geometry().depth_m(sharpest);
        assert!((found_m / depth_m - 1.0).abs() < 0.01, "{depth_m}: {found_m}");
    }
}

#[test]
fn depth_is_that_of_the_planes() {
    let field = field();
    let search = DepthSearch { near_m: 0.4, far_m: 1.1, radius_px: 3 };
    let found = field.depth(&search, &Cancel::new()).unwrap();
    for (depth_m, part) in parts(field) {
        let mut depths: Vec<f32> =
            found.depth_m.slice(ndarray::s![part.0.clone(), part.1.clone()]).iter().copied().collect();
        depths.sort_by(f32::total_cmp);
        let at = |share: f64| f64::from(depths[(share * (depths.len() - 1) as f64) as usize]) / depth_m - 1.0;
        assert!(at(0.5).abs() < 0.01, "{depth_m}: {}", at(0.5));
        // Nine samples in ten by themselves.
        assert!(at(0.05) > -0.05 && at(0.95) < 0.05, "{depth_m}: {} {}", at(0.05), at(0.95));
    }
    let wrong = DepthSearch { near_m: 2.0, ..search };
    let message = field.depth(&wrong, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("the range of depths") && message.contains("2 to 1.1 m"), "{message}");
}

/// The truth of each sample is the plane that its line meets, in every view; estimates are held against it.
#[test]
fn true_depth_is_that_of_the_planes() {
    let field = field();
    let (rows, columns) = field.n_views();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let depth_m = field.true_depth_m(row, column).unwrap();
        assert_eq!(depth_m.dim(), field.size());
        for &found in depth_m {
            let is_plane = |z_m: f64| (f64::from(found) / z_m - 1.0).abs() < 3e-4;
            assert!(is_plane(NEAR_M) || is_plane(FAR_M), "{found}");
        }
        // The border between them is at x = 0: it moves by the disparity of the near plane, and is where a line through the pupil puts it.
        let right = column as f64 - 0.5 * (columns as f64 - 1.0);
        let border = 0.5 * (field.size().1 as f64 - 1.0) - field.geometry().disparity_px(NEAR_M) * right;
        let n_near = depth_m.row(field.size().0 / 2).iter().filter(|z| f64::from(**z) < 0.6).count();
        assert!((n_near as f64 - 0.5 - border).abs() <= 1.0, "{row} {column}: {n_near} {border}");
    }
}

/// An array of three focal lengths that is hexagonal and turned gives upright views of the same geometry.
#[test]
fn turned_multi_focus_array_has_upright_views() {
    let (_folder, kept) = kept(
        "Array((elements: MultiFocus(focal_lengths_mm: (0.19, 0.2, 0.21)), pitch_mm: 0.1, gap_mm: 0.2, layout: Hexagonal, turned_deg: 7.0))",
        25.0,
        "Pixels(columns: 720, rows: 480, pitch_um: 10.0)",
    );
    let field = kept.light_field(None, &Silent, &Cancel::new()).unwrap();
    assert_eq!(field.n_views(), (9, 9));
    for (depth_m, part) in parts(&field) {
        let expected = field.geometry().disparity_px(depth_m);
        let view = |column: usize| field.view(4, column).unwrap()[1].clone();
        let range = if expected > 0.0 { 2.0..8.0 } else { -8.0..-2.0 };
        let found = moved_left_px(&view(1), &view(7), &part, range) / 6.0;
        // Samples between elements are a mean of those about them, in each view of others.
        assert!((found / expected - 1.0).abs() < 0.02, "{depth_m} m: {found} {expected}");
        let truth = field.true_depth_m(4, 4).unwrap();
        let inner = truth.slice(ndarray::s![part.0.clone(), part.1.clone()]);
        assert!(inner.iter().all(|z| (f64::from(*z) / depth_m - 1.0).abs() < 3e-4), "{depth_m}");
    }
}

/// A frame of the sensor and a white one, behind an array that is not quite where the camera file says: it is found, and the light
/// field is that of the irradiance.
#[test]
fn array_is_found_in_a_white_frame() {
    let true_array = "Array((elements: Lenses(focal_length_mm: 0.2), pitch_mm: 0.1003, gap_mm: 0.2, layout: Hexagonal, \
                      offset_mm: (0.012, -0.021), turned_deg: 0.8))";
    let (folder, own) = kept(true_array, 25.0, "Pixels(columns: 480, rows: 320, pitch_um: 10.0)");
    let white = "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 16\nLookAt 0 0 0  0 0 1  0 1 0\n\
                 Camera \"perspective\" \"float fov\" 5\nWorldBegin\nAttributeBegin AreaLightSource \"diffuse\" \"spectrum L\" [ 300 1 900 1 ] \
                 \"bool twosided\" true Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \
                 \"point3 P\" [ -1 -1 0.6 -1 1 0.6 1 1 0.6 1 -1 0.6 ] AttributeEnd\n";
    fs::write(folder.path().join("white.pbrt"), white).unwrap();
    let path = |name: &str| folder.path().join(name);
    let irradiance = own.irradiance(&Silent, &Cancel::new()).unwrap();
    let save = |kept: &KeptCamera, name: &str| {
        let kept = kept.with(|camera| camera.outputs.also = vec![FrameFile::RawDng]);
        let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
        let own = path(name);
        fs::create_dir(&own).unwrap();
        write_capture(&capture, None, &own).unwrap();
        for (file, kind) in [("irradiance.exr", "exr"), ("raw.dng", "dng")] {
            fs::rename(own.join(file), path(&format!("{name}.{kind}"))).unwrap();
        }
    };
    save(&own, "frame");
    let text = own.camera().to_ron().replace("planes.pbrt", "white.pbrt");
    save(&KeptCamera::new(Camera::parse(&text, &path("camera.ron")).unwrap()), "white");
    let expected = own.decoded(&irradiance, None, &Silent, &Cancel::new()).unwrap();
    // As its maker states it.
    let nominal = own.with(|camera| {
        let Some(LightFieldSpec::Array(array)) = &mut camera.light_field else { panic!("an array") };
        (array.pitch_mm, array.turned_deg, array.offset_mm) = (0.1, 0.0, (0.0, 0.0));
    });
    for kind in ["exr", "dng"] {
        let [frame, white] = ["frame", "white"].map(|name| path(&format!("{name}.{kind}")));
        let frame = ArrayFrame::read(&frame, Some(&white)).unwrap();
        let (field, array) = nominal.decoded_frame(&frame, None, &Silent, &Cancel::new()).unwrap();
        assert!((array.pitch_mm / 0.1003 - 1.0).abs() < 2e-4, "{kind}: {}", array.pitch_mm);
        assert!((array.turned_deg - 0.8).abs() < 0.02, "{kind}: {}", array.turned_deg);
        let off_mm = (array.offset_mm.0 - 0.012).hypot(array.offset_mm.1 + 0.021);
        assert!(off_mm < 5e-4, "{kind}: {off_mm}");
        assert_eq!((field.n_views(), field.size()), (expected.n_views(), expected.size()));
        // The same picture but for its level and what the white frame evens out.
        let [found, wanted] = [&field, &expected].map(|field| field.view(4, 4).unwrap().last().unwrap().clone());
        let scale = wanted.sum() / found.sum();
        let off = (&found * scale - &wanted).mapv(|v| v * v).mean().unwrap().sqrt() / wanted.mean().unwrap();
        assert!(off < if kind == "exr" { 0.03 } else { 0.08 }, "{kind}: {off}");
    }
    let plain = ArrayFrame::read(&path("frame.exr"), Some(&path("frame.dng"))).unwrap_err().to_string();
    assert!(plain.contains("is of another kind than"), "{plain}");
    let wrong = nominal.with(|camera| {
        let Some(LightFieldSpec::Array(array)) = &mut camera.light_field else { panic!("an array") };
        array.turned_deg = 15.0;
    });
    let frame = ArrayFrame::read(&path("frame.exr"), Some(&path("white.exr"))).unwrap();
    let message = wrong.decoded_frame(&frame, None, &Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("the white picture: shows no array of a pitch of 100 µm, turned by 15°"), "{message}");
}

/// The axis of a moved lens crosses the film beside its middle, and the image of the pupil lies behind an element accordingly. About
/// a point mirrored in the middle views at opposite rims of the pupil would look past it.
#[test]
fn moved_lens_is_seen_through_the_whole_pupil() {
    let (_folder, kept) = plenoptic();
    let kept = kept.with(|camera| {
        camera.film = FilmSpec::Pixels { columns: 360, rows: 240, pitch_um: 10.0 };
        camera.movements = Movements { rise_mm: 5.0, shift_mm: 3.0, ..Movements::default() };
    });
    let field = kept.light_field(None, &Silent, &Cancel::new()).unwrap();
    let (rows, columns) = field.n_views();
    let light = |row: usize, column: usize| field.view(row, column).unwrap()[0].sum();
    let (middle_row, middle_column) = (rows / 2, columns / 2);
    let middle = light(middle_row, middle_column);
    for (row, column) in [(1, middle_column), (rows - 2, middle_column), (middle_row, 1), (middle_row, columns - 2)] {
        let share = light(row, column) / middle;
        assert!(share > 0.8, "view {row}, {column}: {share}");
    }
}

#[test]
fn parallel_cameras_see_nearer_things_move_more() {
    let (_folder, kept) =
        kept("Cameras(columns: 3, rows: 1, spacing_mm: 1.0)", 1.0, "Pixels(columns: 96, rows: 64, pitch_um: 50.0)");
    let field = kept.light_field(None, &Silent, &Cancel::new()).unwrap();
    assert_eq!((field.n_views(), field.size()), ((1, 3), (64, 96)));
    for (depth_m, (rows, columns)) in parts(&field) {
        // Similar triangles: film distance times spacing over depth.
        let expected = image_mm(FOCUS_MM) / (1e3 * depth_m) / 0.05;
        assert!((field.geometry().disparity_px(depth_m) / expected - 1.0).abs() < 1e-9);
        let view = |column: usize| &field.view(0, column).unwrap()[1];
        let found = moved_left_px(view(0), view(2), &(rows, columns), 0.0..8.0) / 2.0;
        assert!((found / expected - 1.0).abs() < 0.01, "{depth_m} m: {found} {expected}");
    }
    // The picture of the camera itself is that of the view in the middle.
    let own = kept.irradiance(&Silent, &Cancel::new()).unwrap();
    assert_eq!(own.summary.seen.planes[1], field.view(0, 1).unwrap()[1]);
}

#[test]
fn camera_of_the_metronome_is_matched() {
    let path = dioptric_golden::workspace_root().join("fixtures/worlds/metronome-lightfield.ron");
    let kept = KeptCamera::new(Camera::read(&path).unwrap());
    kept.check().unwrap();
    let Some(LightFieldSpec::Array(array)) = kept.camera().light_field else { panic!("an array") };
    // The image of the pupil, 10 mm by 4 of 137 mm, fits into an element.
    let image_mm = 10.0 * array.gap_mm / 137.0;
    assert!(image_mm < array.pitch_mm && image_mm > 0.9 * array.pitch_mm);
}

#[test]
fn array_needs_a_world_and_rays_from_the_film() {
    let (_folder, kept) = plenoptic();
    let of = |from: &str, to: &str| {
        let text = kept.camera().to_ron().replace(from, to);
        Camera::parse(&text, "camera.ron".as_ref()).map(KeptCamera::new)
    };
    let forward = of("method: Backward", "method: Forward").unwrap();
    let message = forward.irradiance(&Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("light_field") && message.contains("method: Backward"), "{message}");
    let message = of("pitch_mm: 0.1", "pitch_mm: 0.0").unwrap_err().to_string();
    assert!(message.contains("light_field") && message.contains("the pitch of the array in mm is 0"), "{message}");
    let none = kept.with(|camera| camera.light_field = None);
    let message = none.light_field(None, &Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("the camera has none"), "{message}");
    let coarse = kept.with(|camera| {
        camera.film = dioptric_pipeline::FilmSpec::Pixels { columns: 48, rows: 32, pitch_um: 100.0 };
    });
    let message = coarse.light_field(None, &Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("expected at least a pixel"), "{message}");
    let fine = kept.with(|camera| {
        let Some(LightFieldSpec::Array(array)) = &mut camera.light_field else { panic!("an array") };
        array.pitch_mm = 0.005;
    });
    let message = fine.light_field(None, &Silent, &Cancel::new()).unwrap_err().to_string();
    assert!(message.contains("elements lie 5 µm apart"), "{message}");
}
