//! Camera files of each program, and what is made of their numbers.

use super::*;
use crate::{View, formats::camera::CameraData};
use approx::assert_abs_diff_eq;

const GOOD: &str = r#"{"width": 741, "height": 500, "fx_px": 994.978, "fy_px": 994.978, "cx_px": 311.0,
    "cy_px": 254.0, "source": "a stereo pair"}"#;

const PICTURE: &str = "motor_370.radiance_depth.exr";

fn read_file(text: &str) -> Result<CameraFile, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("motor_camera.json"), text).unwrap();
    Ok(CameraFile::beside(&folder.path().join(PICTURE))?.unwrap())
}

fn read(text: &str, rows: usize, columns: usize) -> Result<CameraData, SceneError> {
    read_file(text)?.of_size(Path::new(PICTURE), rows, columns)
}

#[test]
fn camera_file_is_found_and_scaled() {
    let full = read(GOOD, 500, 741).unwrap();
    let view = View { focal_px: 994.978, center_x_px: 311.0, center_y_px: 254.0 };
    assert_eq!((full.view(), full.notes.len()), (view, 0));
    assert_eq!(read(GOOD, 250, 370).unwrap().view(), view.binned(2));
    assert_eq!(CameraFile::beside(Path::new("nowhere/a.exr")), Ok(None));
    assert_eq!(full.straightened(500, 741).unwrap(), None);
}

#[test]
fn unknown_keys_are_named() {
    let text = GOOD.replace("\"source\"", "\"shutter\": 3, \"Fx_px\": 5, \"units\": \"mm\", \"source\"");
    let notes = read(&text, 500, 741).unwrap().notes;
    assert_eq!(notes[0], "motor_camera.json: its keys 'Fx_px', 'shutter', 'units' are not used");
    let in_samples = GOOD.replace("\"source\"", "\"units\": \"pixels\", \"source\"");
    assert_eq!(read(&in_samples, 500, 741).unwrap().notes, [""; 0]);
}

#[test]
fn models_and_lists_are_known_however_they_are_called() {
    let of = |more: &str| {
        let text = format!(r#"{{"w":640,"h":480,"fx":525,"fy":526,"cx":320,"cy":240,{more}}}"#);
        let read = read(&text, 480, 640).unwrap();
        (read.distortion, read.notes)
    };
    let fisheye = of(r#""k1":0.1,"k2":0.2,"is_fisheye":true"#);
    for model in [r#""projection":"fisheye""#, r#""lensModel":"equidistant""#, r#""fisheye":true"#, r#""isFisheye":1"#]
    {
        assert_eq!(of(&format!(r#""k1":0.1,"k2":0.2,{model}"#)), fisheye, "{model}");
    }
    let polynomial = of(r#""k1":0.1,"k2":0.2,"p1":0.01,"p2":0.02,"k3":0.3"#);
    for name in ["disto", "kc", "distortion_params", "dist_coef"] {
        assert_eq!(of(&format!(r#""{name}":[0.1,0.2,0.01,0.02,0.3]"#)), polynomial, "{name}");
    }
    assert_eq!(of(r#""radial_coeffs":[0.1,0.2,0.3],"p1":0.01,"p2":0.02"#), polynomial);
}

/// What a tester's files had that was dropped or refused with the wrong words.
#[test]
fn keys_that_stand_twice_and_lists_of_items_are_seen() {
    let nested = r#"{"w":640,"h":480,"frames":[{"file_path":"motor_370.radiance_depth.exr","fl_x":525,"fl_x":526}]}"#;
    assert!(read(nested, 480, 640).unwrap_err().to_string().contains("'fl_x' stands twice"));
    // A key of another program moves no center.
    let both = GOOD.replace("\"source\"", "\"fl_x\": 7.0, \"source\"");
    assert_eq!(read(&both, 500, 741).unwrap().cx_px, 311.0);
    let ros = "header:\n  frame_id: c\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nd:\n- 0.1\n- 0.0\n- 0.0\n- 0.0\n- 0.0\n\
               k:\n- 525.0\n- 0.0\n- 319.5\n- 0.0\n- 526.0\n- 239.5\n- 0.0\n- 0.0\n- 1.0\n";
    let kalibr = "cam0:\n  T_cam_imu:\n  - [1.0, 0.0]\n  - [0.0, 1.0]\n  camera_model: pinhole\n  intrinsics: [525, 526, 319.5, 239.5]\n  \
                  resolution: [640, 480]\n";
    for text in [ros, kalibr, "525 0 319.5\n0 526 239.5\n0 0 1\n", "\u{feff}525,0,319.5\r\n0,526,239.5\r\n0,0,1\r\n"] {
        let data = read(text, 480, 640).unwrap();
        assert_eq!([data.fx_px, data.fy_px, data.cx_px, data.cy_px], [525.0, 526.0, 319.5, 239.5], "{text}");
    }
    for (text, word) in [
        ("{\"width\": NaN}", "line 1, column 11: found 'NaN', expected a number"),
        ("{\"width\": 3", "ends too early (truncated)"),
        ("", "it is empty"),
        ("PK\0\u{3}", "it is no text, expected JSON"),
    ] {
        assert!(read(text, 480, 640).unwrap_err().to_string().contains(word), "{text}");
    }
}

#[test]
fn frames_of_one_name_and_backslashes_are_told_apart() {
    let frames = |names: [&str; 2]| {
        let of = |(name, fl): (&str, f64)| format!(r#"{{"file_path":"{name}","fl_x":{fl}}}"#);
        let list = names.into_iter().zip([525.0, 526.0]).map(of).collect::<Vec<_>>().join(",");
        read(&format!(r#"{{"w":640,"h":480,"cx":320,"cy":240,"frames":[{list}]}}"#), 480, 640)
    };
    let two = frames(["a/motor_370.radiance_depth.exr", "b/motor_370.radiance_depth.exr"]);
    assert!(two.unwrap_err().to_string().contains("several of the file_path of its frames are"));
    assert_eq!(frames([r"images\\motor_370.radiance_depth.exr", "b.exr"]).unwrap().fx_px, 525.0);
}

#[test]
fn other_programs_are_read() {
    let same = |text: &str, unit: Option<f64>| {
        let (file, data) = (read_file(text).unwrap(), read(text, 480, 640).unwrap());
        assert!(data.notes.is_empty(), "{text}");
        let numbers = [data.fx_px, data.fy_px, data.cx_px, data.cy_px];
        assert_eq!((numbers, file.depth_unit_m), ([525.0, 526.0, 319.5, 239.5], unit), "{text}");
        data.distortion
    };
    let bent = |k: [f64; 8]| Distortion::Polynomial { k, r8: 0.0 };
    same(
        r#"{"width":640,"height":480,"intrinsic_matrix":[525.0,0,0,0,526.0,0,319.5,239.5,1],"depth_scale":1000}"#,
        Some(1e-3),
    );
    same(r#"{"K":[[525.0,0,319.5],[0,526.0,239.5],[0,0,1]]}"#, None);
    let k = same(
        r#"{"w":640,"h":480,"fl_x":525,"fl_y":526,"cx":320,"cy":240,"k1":0.1,"k2":-0.2,"p1":0.001,"p2":0.002,
            "camera_model":"OPENCV","frames":[{"file_path":"a.png"}]}"#,
        None,
    );
    assert_eq!(k, bent([0.1, -0.2, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]));
    same("# cameras\n1 PINHOLE 640 480 525 526 320 240\n", None);
    let k = same(
        "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   \
         dt: d\n   data: [ 525., 0., 319.5, 0.,\n       526., 239.5, 0., 0., 1. ]\ndistortion_coefficients: \
         !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ 0.1, -0.2, 0., 0., 0.3 ]\n",
        None,
    );
    assert_eq!(k, bent([0.1, -0.2, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0]));
    let matrix = |name: &str, data: &str| {
        format!(
            "<{name} type_id=\"opencv-matrix\">\n<rows>3</rows><cols>3</cols><dt>d</dt><data>\n{data}</data></{name}>\n"
        )
    };
    let xml = [
        "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width>\n<image_height>480</image_height>\n",
        &matrix("camera_matrix", "525. 0. 319.5 0.\n526. 239.5 0. 0. 1."),
        &matrix("distortion_coefficients", "0.1 -0.2 0. 0. 0.3"),
        "</opencv_storage>\n",
    ];
    assert_eq!(same(&xml.concat(), None), k);
    // The fourth coefficient of nerfstudio goes with r^8, that of OpenCV with r^2 below the line.
    let nerf = r#"{"w":640,"h":480,"fl_x":525,"fl_y":526,"cx":320,"cy":240,"k1":0.1,"k4":0.2}"#;
    assert_eq!(same(nerf, None), Distortion::Polynomial { k: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], r8: 0.2 });
    let ros = "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [525, 0, 319.5, 0, \
               526, 239.5, 0, 0, 1]\ndistortion_model: equidistant\ndistortion_coefficients:\n  rows: 1\n  cols: 4\n  \
               data: [0.1, 0, 0.2, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";
    // As PyYAML sorts and writes it.
    let dumped = "camera_matrix:\n  cols: 3\n  data:\n  - 525.0\n  - 0\n  - 319.5\n  - 0\n  - 526.0\n  - 239.5\n  - 0\n  - 0\n  - 1\n  \
                  rows: 3\nimage_height: 480\nimage_width: 640\n";
    same(dumped, None);
    let fisheye = Distortion::Fisheye([0.1, 0.0, 0.2, 0.0]);
    assert_eq!(same(ros, None), fisheye);
    assert_eq!(same("1 OPENCV_FISHEYE 640 480 525 526 320 240 0.1 0 0.2 0", None), fisheye);
    for flow in [
        "camera_matrix:\n- - 525.0\n  - 0.0\n  - 319.5\n- - 0.0\n  - 526.0\n  - 239.5\n- - 0.0\n  - 0.0\n  - 1.0\ndist_coeff:\n- - 0.0\n  - 0.0\n  - 0.0\n",
        "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, dt: d, data: [525, 0, 319.5, 0, 526, 239.5, 0, 0, 1]}\n",
        "{image_width: 640, image_height: 480, camera_matrix: {data: [525, 0, 319.5, 0, 526, 239.5, 0, 0, 1]}}",
        "{width: 640, height: 480, K: [[525, 0, 319.5], [0, 526, 239.5], [0, 0, 1]]}",
        "image_width: 640\nimage_height: 480\nK:\n- [525, 0, 319.5]\n- [0, 526, 239.5]\n- [0, 0, 1]\nD: !!opencv-matrix\n  {rows: 0, cols: 0, data: []}\n",
        "width: 640 # columns\n'height': 480\nfx: 525.\nfy: 5.26e2\ncx: 319.5\ncy: 239.5\ncamera_name: \"a: b\"\n",
        "header:\n  seq: 1\nheight: 480\nwidth: 640\ndistortion_model: ''\nD: []\nK: [525.0, 0.0, 319.5, 0.0, 526.0, 239.5, 0.0, 0.0, 1.0]\n---\n",
        "cam0: {intrinsics: [525, 526, 319.5, 239.5], resolution: [640, 480]}\n",
        r#"{"image_width": 640, "image_height": 480, "camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
            "data": [525, 0, 319.5, 0, 526, 239.5, 0, 0, 1]}}"#,
    ] {
        same(flow, None);
    }
    // What RealSense and a sample of OpenCV call the model of the lens; inverse polynomials bend nothing where all is 0.
    let with = |words: &str| format!(r#"{{"width":640,"height":480,"fx":525,"fy":526,"cx":319.5,"cy":239.5,{words}}}"#);
    let four = r#""coeffs":[0.1,0,0.2,0]"#;
    for words in [r#""model":"distortion.kannala_brandt4""#, r#""fisheye_model":1"#, r#""is_fisheye":true"#] {
        assert_eq!(same(&with(&format!("{words},{four}")), None), fisheye, "{words}");
    }
    same(&with(r#""model":"distortion.inverse_brown_conrady","coeffs":[0,0,0,0,0]"#), None);
    same(&with(r#""fisheye_model":0"#), None);
    for model in ["distortion.inverse_brown_conrady", "distortion.ftheta", "ftheta", "THIN_PRISM_FISHEYE"] {
        let message = read(&with(&format!(r#""model":"{model}",{four}"#)), 480, 640).unwrap_err().to_string();
        assert!(message.contains(&format!("its camera model is '{model}'")), "{message}");
    }
    assert!(read(&with(r#""model":"D455""#), 480, 640).unwrap().notes[0].contains("'model'"));
    // Words that are no numbers are named.
    for (words, named) in [
        (r#""resolution": "1080p""#, "'resolution'"),
        (r#""resolution": "72""#, "'resolution'"),
        (r#""resolution": {"dpi": 72}"#, "'resolution'"),
        (r#""intrinsics": "file.txt""#, "'intrinsics'"),
        (r#""dist": "none""#, ""),
    ] {
        let text =
            format!(r#"{{"width": 640, "height": 480, "fx": 525, "fy": 526, "cx": 319.5, "cy": 239.5, {words}}}"#);
        let notes = read(&text, 480, 640).unwrap().notes.join("\n");
        assert!(notes.contains(named) && notes.is_empty() == named.is_empty(), "{words}: {notes}");
    }
    let slam = "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 525.0\nCamera.fy: 526.0\nCamera.cx: 319.5\nCamera.cy: 239.5\nCamera.width: 640\n\
                Camera.height: 480\nDepthMapFactor: 5000.0\n";
    same(slam, Some(2e-4));
    same(
        r#"{"camera": {"width": 640, "height": 480, "fx": 525, "fy": 526, "ppx": 319.5, "ppy": 239.5,
        "model": "distortion.brown_conrady", "coeffs": [0, 0, 0, 0, 0]}}"#,
        None,
    );
    for (text, word) in [
        ("[LEFT_CAM_HD]\nfx=525\n", "it is an INI file"),
        ("width: [640\nheight: 480\n", "it is no YAML"),
        ("width: 640\nheight: 480\nfx: &a 525\nfy: *a\n", "alias"),
        ("width: 640\n---\nheight: 480\n", "several documents"),
        ("{width: 640, width: 641}", "the key 'width' stands twice"),
        ("width: 640\nheight: 480\nK: {rows: 2, cols: 3, data: [1, 2, 3]}\n", "3 numbers, but 2 rows and 3 columns"),
        ("width: 640\nheight: 480\nK: [525, 0, x, 0, 526, 239.5, 0, 0, 1]\n", "no list of numbers"),
        (&format!("width: {}1{}\n", "[".repeat(40), "]".repeat(40)), "within each other"),
    ] {
        let message = read(text, 480, 640).unwrap_err().to_string();
        assert!(message.contains(word) && !message.contains('\n'), "{text}: {message}");
    }
    let kalibr = "resolution: [640, 480]\nintrinsics: [525, 526, 319.5, 239.5] # fu, fv, cu, cv\ndistortion_model: \
                  radial-tangential\ndistortion_coefficients: [0.1, -0.2, 0.001, 0.002]\n";
    assert_eq!(same(kalibr, None), bent([0.1, -0.2, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]));
}

/// Of several cameras of COLMAP that of the picture counts.
#[test]
fn the_camera_of_the_picture_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    dioptric_pictures::save(&image::GrayImage::new(8, 6).into(), &at("a.png")).unwrap();
    let read = |cameras: &str, images: Option<&str>| {
        fs::write(at("cameras.txt"), cameras).unwrap();
        let _ = fs::remove_file(at("images.txt"));
        if let Some(text) = images {
            fs::write(at("images.txt"), text).unwrap();
        }
        CameraFile::read(&at("cameras.txt"), &at("a.png"))?.of_size(&at("a.png"), 6, 8).map(|data| data.fx_px)
    };
    let two = "# cameras\n1 PINHOLE 8 6 10 10 4 3\n2 PINHOLE 8 6 20 20 4 3\n";
    let images = "# images\n1 1 0 0 0 0 0 0 2 rgb/a.png\n1.5 2.5 -1\n2 1 0 0 0 0 0 0 1 b.png\n\n";
    assert_eq!(read(two, Some(images)).unwrap(), 20.0);
    assert!(read(two, None).unwrap_err().to_string().contains("2 cameras, and no images.txt"));
    assert_eq!(read(&two.replace("1 PINHOLE 8 6", "1 PINHOLE 16 12"), None).unwrap(), 20.0);
    assert_eq!(read(&two.replace("20 20", "10 10"), None).unwrap(), 10.0);
    assert!(read(two, Some("1 1 0 0 0 0 0 0 7 a.png\n")).unwrap_err().to_string().contains("its camera is 7"));
    // Of a rig by the folder that the picture is in.
    let own = folder.path().file_name().unwrap().to_string_lossy().into_owned();
    let rig = format!("1 1 0 0 0 0 0 0 1 left/a.png\n\n2 1 0 0 0 0 0 0 2 {own}/a.png\n\n");
    assert_eq!(read(two, Some(&rig)).unwrap(), 20.0);
    let unknown = read(two, Some(&rig.replace(&own, "right"))).unwrap_err().to_string();
    assert!(unknown.contains("several cameras called a.png"), "{unknown}");
}

#[test]
fn what_is_not_stated_is_told_and_what_is_stated_twice_must_agree() {
    // 640 samples at 525 px: 2 atan(320 / 525).
    let angle = 2.0 * (320.0_f64 / 525.0).atan();
    let nerf = read(&format!(r#"{{"camera_angle_x":{angle},"frames":[]}}"#), 480, 640).unwrap();
    assert!((nerf.fx_px - 525.0).abs() < 1e-9 && nerf.fy_px == nerf.fx_px && nerf.notes.is_empty());
    assert_eq!((nerf.cx_px, nerf.cy_px), (319.5, 239.5));
    let both = |fl_x: f64| {
        format!(r#"{{"w":640,"h":480,"camera_angle_x":{angle},"fl_x":{fl_x},"fl_y":{fl_x},"cx":320,"cy":240}}"#)
    };
    assert!(read(&both(525.0), 480, 640).unwrap().notes.is_empty());
    assert!(
        read(&both(600.0), 480, 640)
            .unwrap_err()
            .to_string()
            .contains("600 px, and an angle of view that makes it 525 px")
    );
    let bare = read(r#"{"width":640,"height":480,"fx_px":525,"cy_px":239.5}"#, 480, 640).unwrap();
    assert!(bare.notes[0].contains("cx_px, which is taken for the middle, nor fy_px"), "{:?}", bare.notes);
    let normalized = r#"{"width":640,"height":480,"fx_px":0.82,"fy_px":1.09,"cx_px":0.5,"cy_px":0.5}"#;
    assert!(read(normalized, 480, 640).unwrap_err().to_string().contains("in samples"));
    let shares = r#"{"K":[[1.25,0,0.44],[0,1.66,0.42],[0,0,1]]}"#;
    assert!(read(shares, 6, 8).unwrap_err().to_string().contains("look like shares of the picture"));
    let camera = |name: &str| format!("{name}:\n  intrinsics: [525, 526, 319.5, 239.5]\n  resolution: [640, 480]\n");
    assert!(read(&camera("cam0"), 480, 640).unwrap().notes.is_empty());
    let two = camera("cam0") + &camera("cam1").replace("525", "530");
    assert!(read(&two, 480, 640).unwrap_err().to_string().contains("it has cameras cam0, cam1"));
}

#[test]
fn stretched_and_bent_pictures_are_straightened() {
    let text = GOOD.replace("\"fy_px\": 994.978", "\"fy_px\": 497.489, \"k1\": -0.3");
    let data = read(&text, 500, 741).unwrap();
    let (straight, note) = data.straightened(500, 741).unwrap().unwrap();
    assert_eq!((straight.rows, straight.columns), (1000, 741));
    assert!(note.contains("2.0000 times") && note.contains("bends"), "{note}");
    // The axis stays where it was, and a direction is found where the lens pictured it.
    let (row, column) = straight.view.position_of(0.0, 0.0);
    assert_abs_diff_eq!(column, 311.0, epsilon = 1e-9);
    assert_abs_diff_eq!(row, (254.0 + 0.5) * 2.0 - 0.5, epsilon = 1e-9);
    let x = (700.0 - 311.0) / 994.978;
    let (_, at) = straight.source_of(row.round() as usize, 700);
    assert_abs_diff_eq!(at, 311.0 + 994.978 * x * (1.0 - 0.3 * x * x), epsilon = 1e-3);
}

#[test]
fn sizes_and_units_are_known_however_their_keys_are_written() {
    let matrix = r#""K": [[1050, 0, 639.5], [0, 1050, 479.5], [0, 0, 1]]"#;
    for size in [
        r#""imageWidth": 1280, "imageHeight": 960"#,
        r#""W": 1280, "H": 960"#,
        r#""cols": 1280, "rows": 960"#,
        r#""image_size": [1280, 960]"#,
        r#""imageResolution": {"width": 1280, "height": 960}"#,
        r#""imageResolution": [1280, 960]"#,
        r#""image_size": "1280x960""#,
    ] {
        // A picture half as wide has half the focal length.
        let data = read(&format!("{{{matrix}, {size}}}"), 480, 640).unwrap();
        assert_eq!((data.fx_px, data.cx_px, data.cy_px, data.notes.len()), (525.0, 319.5, 239.5, 0), "{size}");
    }
    let message = read(&format!("{{{matrix}}}"), 480, 640).unwrap_err().to_string();
    assert!(message.contains("(639.5, 479.5)") && message.contains("expected its width and height"), "{message}");
    for (unit, expected_m) in [
        (r#""png_depth_scale": 5000"#, Ok(2e-4)),
        (r#""depth_factor": 1000"#, Ok(1e-3)),
        (r#""depthScale": 4000"#, Ok(2.5e-4)),
        (r#""depth_scale_factor": 1000.0"#, Ok(1e-3)),
        (r#""depth_units": 0.0001"#, Ok(1e-4)),
        (r#""depth_unit": "cm""#, Ok(1e-2)),
        (r#""depth_unit": "5000/m""#, Ok(2e-4)),
        (r#""depth_units": 1000"#, Err("codes a metre as depth_scale")),
        (r#""depthScale": 0.001"#, Err("depthScale is 0.001")),
        (r#""depth_unit": "zorp""#, Err("'zorp'")),
    ] {
        let text = GOOD.replace("\"source\"", &format!("{unit}, \"source\""));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, text).unwrap();
        match (CameraFile::read(&path, Path::new("a.png")), expected_m) {
            (Ok(file), Ok(expected_m)) => {
                assert_eq!((file.depth_unit_m, file.notes.len()), (Some(expected_m), 0), "{unit}")
            }
            (Err(message), Err(word)) => assert!(message.to_string().contains(word), "{message}"),
            (file, _) => panic!("{unit}: {file:?}"),
        }
    }
}

#[test]
fn distortions_of_two_lists_are_those_of_one() {
    let of = |own: &str| {
        let text = format!("{{\"width\":640,\"height\":480,\"fx\":525,\"fy\":526,\"cx\":319.5,\"cy\":239.5,{own}}}");
        read(&text, 480, 640).map(|data| data.distortion)
    };
    let one = of(r#""distortion": [0.12, -0.05, 0.004, -0.006, 0.01]"#).unwrap();
    for two in [
        r#""k": [0.12, -0.05, 0.01], "p": [0.004, -0.006]"#,
        r#""radial": [0.12, -0.05, 0.01], "tangential": [0.004, -0.006]"#,
        r#""radial_distortion": [0.12, -0.05, 0.01], "tangentialDistortion": [0.004, -0.006]"#,
    ] {
        assert_eq!(of(two).unwrap(), one, "{two}");
    }
    assert!(of(r#""k": [0.12, -0.05], "k1": 0.12"#).unwrap_err().to_string().contains("twice"));
}

#[test]
fn camera_file_that_does_not_fit_is_refused_by_name() {
    for (text, rows, columns, word) in [
        (GOOD, 100, 100, "741 × 500"),
        (GOOD, 1, 800, "741 × 500"),
        (&GOOD.replace("994.978", "-1"), 500, 741, "focal"),
        (&GOOD.replace("994.978", "1e300"), 500, 741, "1e300 px would make"),
        (&GOOD.replace("fy_px\": 994.978", "fy_px\": 1e-9"), 500, 741, "times as wide as high"),
        (&GOOD.replace("width", "wide"), 500, 741, "width"),
        (&GOOD.replace("fx_px", "fx_pix"), 500, 741, "fx_px"),
        (&GOOD.replace("741", "\"wide\""), 500, 741, "width is"),
        (&GOOD.replace("\"source\"", "\"depth_scale\": 0.1, \"source\""), 500, 741, "depth_scale is 0.1"),
        (&GOOD.replace("\"source\"", "\"camera_model\": \"FOV\", \"source\""), 500, 741, "'FOV'"),
        (&GOOD.replace("\"source\"", "\"fx_px\": 80, \"source\""), 500, 741, "'fx_px' stands twice"),
        (
            &GOOD.replace("\"source\"", "\"depth_unit_m\": 1, \"depth_scale\": 1000, \"source\""),
            500,
            741,
            "depth_scale",
        ),
        (r#"{"width":741,"height":500,"intrinsic_matrix":[525.0,0,0,5,526.0,0,319.5,239.5,1]}"#, 500, 741, "skew"),
        (r#"{"K":[[525.0,0,319.5],[0,526.0,239.5],[0,0,0]]}"#, 500, 741, "skew"),
        ("{", 500, 741, "truncated"),
        ("[3]", 500, 741, "list of JSON"),
        ("1 FISHEYE 3 4 5", 500, 741, "FISHEYE"),
    ] {
        let read = read(text, rows, columns).and_then(|data| data.straightened(rows, columns));
        let message = read.unwrap_err().to_string();
        assert!(message.contains("motor_camera.json") && message.contains(word), "{message}");
    }
}
