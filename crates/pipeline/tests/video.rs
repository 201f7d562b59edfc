//! Frames of a camera that turns.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use dioptric_pipeline::{
    Camera, CameraTurn, FilmSpec, KeptCamera, SceneSource, SceneSpec, Silent, Video, VideoSpec, WavelengthSpec,
};
use dioptric_sensor::{Binning, BinningKind, Exposure, NoiseSources};
use dioptric_spectrum::Cancel;
use ndarray::{Array2, s};

fn camera(motion: CameraTurn) -> KeptCamera {
    let mut camera = Camera::demo().unwrap();
    camera.film = FilmSpec::Pixels { columns: 150, rows: 100, pitch_um: 150.0 };
    camera.scene = SceneSpec { source: SceneSource::StillLife { columns: 360, rows: 240 }, ..camera.scene };
    camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
    camera.video = Some(VideoSpec { frames: 3, frames_per_s: 10.0, row_time_us: Some(0.0), motion });
    KeptCamera::new(camera)
}

fn video(camera: &KeptCamera) -> Video {
    camera.video(&Silent, &Cancel::new()).unwrap()
}

fn green(video: &Video, frame: usize) -> Array2<f64> {
    let raw = video.frame(frame).unwrap().raw;
    // The upper right pixel of each tile of RGGB, so that a way of whole tiles leaves filters where they were.
    raw.planes[0].samples().slice(s![..;2, 1..;2]).mapv(f64::from)
}

#[test]
fn a_camera_at_rest_takes_its_picture_again() {
    let kept = camera(CameraTurn::default());
    let (video, capture) = (video(&kept), kept.capture(&Silent, &Cancel::new()).unwrap());
    let first = video.frame(0).unwrap();
    assert_eq!(first.raw.planes, capture.frames.exposed.raw.planes);
    assert_eq!(first.developed.picture, capture.developed.picture);
    // The next has noise of its own.
    assert_ne!(video.frame(1).unwrap().raw.planes, first.raw.planes);
}

#[test]
fn a_panned_camera_sees_its_picture_moved() {
    let rest = camera(CameraTurn::default()).with(|camera| camera.noise = NoiseSources::NONE);
    let still = video(&rest);
    // Six pixels, three tiles, a tenth of a second.
    let pan_deg = (6.0 / still.samples_per_tan).atan().to_degrees();
    let motion = CameraTurn { pan_deg_per_s: 10.0 * pan_deg, ..CameraTurn::default() };
    let panned = video(&rest.with(|camera| camera.video.as_mut().unwrap().motion = motion));
    let states = |video: &Video| video.notes.iter().any(|note| note.contains("without distortion"));
    assert!(states(&panned) && !states(&still), "{:?}", panned.notes);
    assert_eq!(panned.size(), still.size());
    let (still, moved) = (green(&still, 0), green(&panned, 1));
    let (from, to) = (still.slice(s![5..45, 13..60]), moved.slice(s![5..45, 10..57]));
    let rms = |a: &Array2<f64>| (a.mapv(|v| v * v).mean().unwrap()).sqrt();
    let apart = |a: ndarray::ArrayView2<'_, f64>| rms(&(&a - &from)) / rms(&from.to_owned());
    // The exposure ends a quarter of a millisecond later, .02 of a pixel; at the rim perspective moves by a tenth of one.
    assert!(apart(to) < 0.05, "{}", apart(to));
    // Where it would be had the camera turned the other way.
    let other = moved.slice(s![5..45, 16..63]);
    assert!(apart(other) > 3.0 * apart(to), "{} {}", apart(other), apart(to));
}

#[test]
fn rows_that_are_read_as_one_take_half_the_time() {
    let ready = |binning: Option<Binning>, row_time_us: f64| {
        let read = |camera: &mut Camera| {
            camera.exposure = camera.exposure.with_shot(|shot| Exposure { binning, ..shot });
            camera.video.as_mut().unwrap().row_time_us = Some(row_time_us);
        };
        camera(CameraTurn::default()).with(read).video(&Silent, &Cancel::new())
    };
    let (rows, columns) = ready(None, 0.0).unwrap().size();
    // Three quarters of a frame for half the rows.
    let frame_us = 1e6 / ready(None, 0.0).unwrap().spec.frames_per_s;
    let row_time_us = 1.5 * frame_us / rows as f64;
    let kind = |kind| Some(Binning { kind, pixels: 2 });
    for too_long in [None, kind(BinningKind::Digital)] {
        assert!(ready(too_long, row_time_us).unwrap_err().to_string().contains("longer than a frame"), "{too_long:?}");
    }
    for binning in [BinningKind::Charge, BinningKind::Voltage] {
        let video = ready(kind(binning), row_time_us).unwrap();
        let frame = video.frame(0).unwrap();
        assert_eq!(video.size(), (rows / 4 * 2, columns / 4 * 2));
        assert_eq!((frame.raw.size(), frame.developed.picture.rows()), (video.size(), video.size().0));
    }
}

#[test]
fn videos_that_cannot_be_are_named() {
    let error = |change: &dyn Fn(&mut Camera)| {
        camera(CameraTurn::default()).with(change).video(&Silent, &Cancel::new()).unwrap_err().to_string()
    };
    for (word, message) in [
        ("frames is 0", error(&|camera| camera.video.as_mut().unwrap().frames = 0)),
        ("shake_deg", error(&|camera| camera.video.as_mut().unwrap().motion.shake_deg = -1.0)),
        ("longer than a frame", error(&|camera| camera.video.as_mut().unwrap().row_time_us = Some(2e3))),
        ("turns by more than 2 frames", error(&|camera| camera.video.as_mut().unwrap().motion.pan_deg_per_s = 500.0)),
        ("expected Single", error(&|camera| camera.frames = dioptric_pipeline::FramesSpec::Burst(4))),
        ("is not in the camera", error(&|camera| camera.video = None)),
    ] {
        assert!(message.contains(word) && !message.contains('\n'), "{word}: {message}");
    }
}

#[test]
fn film_beyond_the_scene_is_stated() {
    let states = |pan_deg_per_s: f64| {
        let motion = CameraTurn { pan_deg_per_s, ..CameraTurn::default() };
        video(&camera(motion)).notes.iter().any(|note| note.contains("gets no light"))
    };
    // At rest the frame lies within the scene, which the pan leaves.
    assert!(!states(0.0) && states(60.0));
}
