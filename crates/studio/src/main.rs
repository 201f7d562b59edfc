//! The program `dioptric-studio [CAMERA.ron]`: a window of the system around [`dioptric_studio::ui`].

mod arguments;

use std::{env, error::Error, path::PathBuf, process::ExitCode};

use dioptric_pipeline::PaintingFolder;
use dioptric_studio::{
    engine::EngineSettings,
    session::Autosave,
    ui::{Studio, StudioSettings},
};
use eframe::{Frame, NativeOptions, egui};

use crate::arguments::{Asked, why_no_window};

/// The window's contents as eframe wants them.
struct Shell(Studio);

impl eframe::App for Shell {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut Frame) {
        self.0.ui(ui);
    }
}

#[expect(
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "what a program could not do, and what it was asked to say"
)]
fn main() -> ExitCode {
    let camera = match Asked::of(env::args_os().skip(1)) {
        Ok(Asked::Window(camera)) => camera,
        Ok(Asked::Words(words)) => {
            println!("{words}");
            return ExitCode::SUCCESS;
        }
        Err(words) => {
            eprintln!("error: {words}");
            return ExitCode::from(2);
        }
    };
    match run(camera) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", why_no_window(&error.to_string(), has_display()));
            ExitCode::FAILURE
        }
    }
}

/// Whether the system names a display to show windows on; systems other than those with X and Wayland need not name one.
fn has_display() -> bool {
    let is_named = |name| env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(all(unix, not(target_os = "macos")))
        || is_named("DISPLAY")
        || is_named("WAYLAND_DISPLAY")
        || is_named("WAYLAND_SOCKET")
}

fn run(camera: Option<PathBuf>) -> Result<(), Box<dyn Error>> {
    let settings = StudioSettings {
        engine: EngineSettings {
            paintings: env::current_exe().ok().and_then(|program| PaintingFolder::of_user(&program)),
        },
        autosave: Autosave::of_user(),
        camera,
    };
    let viewport = egui::ViewportBuilder::default().with_inner_size([1400.0, 900.0]).with_title("dioptric studio");
    let options = NativeOptions { viewport, ..NativeOptions::default() };
    eframe::run_native(
        "dioptric-studio",
        options,
        Box::new(|context| Ok(Box::new(Shell(Studio::new(&context.egui_ctx, settings)?)))),
    )?;
    Ok(())
}
