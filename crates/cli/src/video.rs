//! `dioptric video`: frames of a camera that turns.

use std::path::Path;

use anyhow::bail;
use dioptric_pipeline::{Progress, Stage, Staged, VideoFacts, write_json, write_video_frame};
use dioptric_spectrum::Cancel;

use crate::{
    args::{Common, VideoArgs},
    lens::tell,
    run::{Clock, OUT, camera_of},
    terminal::{print, print_json},
};

pub(crate) fn run(arguments: &VideoArgs, common: &Common) -> anyhow::Result<()> {
    if arguments.camera.from.is_some() || arguments.camera.resume {
        bail!("a video is taken as a whole, expected no --from and no --resume");
    }
    let kept = camera_of(&arguments.camera, common)?;
    let spec = arguments.turn.change(kept.camera().video.unwrap_or_default());
    let kept = kept.with(|camera| camera.video = Some(spec));
    kept.camera().validate()?;
    let out = arguments.camera.out.as_deref().unwrap_or(Path::new(OUT));
    let staged = Staged::folder(out)?;
    let (clock, cancel) = (Clock::new(common.quiet), Cancel::new());
    let video = kept.video(&clock, &cancel)?;
    let mut frames = Vec::new();
    for number in 0..spec.frames {
        clock.at(Stage::Picture, number as f64 / spec.frames as f64);
        let frame = video.frame(number)?;
        write_video_frame(&frame, number, &kept.camera().outputs, staged.path())?;
        frames.push(frame.facts);
    }
    let facts = VideoFacts::of(&video, frames);
    write_json(&staged.path().join("video.json"), &facts)?;
    staged.commit()?;
    let total_s = clock.total_s();
    drop(clock);
    tell(&facts.notes, common);
    match (common.json, common.quiet) {
        (true, _) => print_json(&facts),
        (false, true) => Ok(()),
        (false, false) => print(&format!(
            "{}: {} frames of {} × {} pixels, {} a second, {:.2} ms each, rows {} µs apart, {total_s:.1} s\n{}\n",
            kept.camera().name,
            facts.frames.len(),
            facts.columns,
            facts.rows,
            facts.frames_per_s,
            1e3 * facts.exposure_time_s,
            facts.row_time_us,
            out.join("frame-0001.png").display()
        )),
    }
}
