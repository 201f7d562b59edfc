//! The program `dioptric-studio [CAMERA.ron]`: a window of the system around [`dioptric_studio::ui`].

use std::{env, error::Error, path::PathBuf, process::ExitCode};

use dioptric_pipeline::PaintingFolder;
use dioptric_studio::{
    engine::EngineSettings,
    session::Autosave,
    ui::{Studio, StudioSettings},
};
use eframe::{Frame, NativeOptions, egui};

/// The window's contents as eframe wants them.
struct Shell(Studio);

impl eframe::App for Shell {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut Frame) {
        self.0.ui(ui);
    }
}

#[expect(clippy::print_stderr, reason = "what a program could not do")]
fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let camera = env::args_os().nth(1).map(PathBuf::from);
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
