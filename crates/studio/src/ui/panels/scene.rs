//! The scene and its light.

use std::path::PathBuf;

use dioptric_pipeline::{Camera, RenderEffort, RenderMethod, SceneSource, WorldSpec, parse_illuminant};
use dioptric_scene::Pattern;
use egui::Ui;

use super::{
    super::fields::{NumberField, choice, count, optional, text, wrong},
    Desk,
};
use crate::{engine::Field, session::light_word};

/// The kinds of a scene.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    StillLife,
    Target,
    File,
    World,
}

const KINDS: [(Kind, &str); 4] = [
    (Kind::StillLife, "still life"),
    (Kind::Target, "target"),
    (Kind::File, "file"),
    (Kind::World, "world in three dimensions"),
];

/// Samples of a scene that has none of its own.
const SIZE: (usize, usize) = (1080, 720);

pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let mut kind = kind_of(&camera.scene.source);
    if choice(ui, "scene", "What stands before the camera", &mut kind, &KINDS) {
        change_kind(camera, kind);
    }
    match &mut camera.scene.source {
        SceneSource::StillLife { columns, rows } => size(ui, columns, rows),
        SceneSource::Target { pattern, columns, rows } => {
            target(ui, pattern);
            size(ui, columns, rows);
        }
        SceneSource::File(path) => file(ui, path, "Spectral EXR, ENVI header, folder of band pictures, or a picture"),
        SceneSource::World(world) => {
            file(ui, &mut world.file, "pbrt, glTF, OBJ or PLY");
            let methods = [
                (RenderMethod::Backward, "backward: rays from the film"),
                (RenderMethod::Forward, "forward: the view, blurred"),
            ];
            choice(ui, "method", "How the light of the world comes to the film", &mut world.method, &methods);
            if let RenderEffort::Samples(n) = &mut world.effort {
                let mut samples = *n as usize;
                if count(ui, "samples", "Rays of a pixel", 1..=65_536, &mut samples) {
                    *n = samples as u32;
                }
            }
        }
    }
    let is_world = kind_of(&camera.scene.source) == Kind::World;
    let scene = &mut camera.scene;
    let view = NumberField {
        label: "field of view",
        unit: "°",
        range: 0.01..=179.9,
        slider: 1.0..=120.0,
        is_logarithmic: false,
        words: "Horizontal field of view of the scene from edge to edge",
    };
    optional(ui, view, &mut scene.field_of_view_deg, 36.0);
    if !is_world {
        let depth = NumberField {
            label: "depth",
            unit: "m",
            range: 1e-4..=1e6,
            slider: 0.1..=100.0,
            is_logarithmic: true,
            words: "One depth for a scene that has none, from the entrance pupil",
        };
        optional(ui, depth, &mut scene.depth_m, 2.0);
        let light = NumberField {
            label: "illuminance",
            unit: "lx",
            range: 1e-6..=1e7,
            slider: 0.1..=1e5,
            is_logarithmic: true,
            words: "Light on the scene; of a picture that of its white",
        };
        optional(ui, light, &mut scene.illuminance_lux, 1000.0);
        illuminant(ui, camera);
    }
    desk.tell(ui, Field::Scene, camera);
}

fn illuminant(ui: &mut Ui, camera: &mut Camera) {
    let now = match &camera.scene.illuminant {
        None => "its own".to_owned(),
        Some(light) => light_word(light).unwrap_or_else(|| "measured".to_owned()),
    };
    let id = ui.make_persistent_id("unknown light");
    let words = "Light to put the scene under: A, D50, D55, D65, D75, E, FL2, FL11, LED-B3, a temperature (3200K), a chromaticity \
                 (0.46,0.414) or a CSV file; 'its own' for that of the scene";
    if let Some(typed) = text(ui, "light", words, &now) {
        let parsed = match typed.as_str() {
            "" | "its own" => Ok(None),
            word => parse_illuminant(word).map(Some),
        };
        match parsed {
            Ok(light) => {
                camera.scene.illuminant = light;
                ui.data_mut(|data| data.remove_temp::<String>(id));
            }
            Err(error) => {
                ui.data_mut(|data| data.insert_temp(id, error.to_string()));
            }
        }
    }
    if let Some(words) = ui.data(|data| data.get_temp::<String>(id)) {
        wrong(ui, &words);
    }
}

fn size(ui: &mut Ui, columns: &mut usize, rows: &mut usize) {
    let before = (*columns, *rows);
    if count(ui, "scene width", "Columns of samples of the scene; its height follows", 2..=8192, columns) {
        *rows = (before.1 * *columns).div_ceil(before.0.max(1)).max(1);
    }
}

fn target(ui: &mut Ui, pattern: &mut Pattern) {
    let name = |pattern: &Pattern| match pattern {
        Pattern::Uniform => "uniform",
        Pattern::Checkerboard { .. } => "checkerboard",
        Pattern::SlantedBar { .. } => "slanted edge",
        Pattern::RadialLines { .. } => "radial lines",
        Pattern::PointArray { .. } => "points",
        Pattern::SiemensStar { .. } => "Siemens star",
        Pattern::ColorChart => "color chart",
    };
    let all = [
        Pattern::Uniform,
        Pattern::Checkerboard { check_px: 40 },
        Pattern::SlantedBar { slope: 0.0875 },
        Pattern::RadialLines { n_lines: 12 },
        Pattern::PointArray { spacing_px: 60 },
        Pattern::SiemensStar { n_cycles: 36 },
        Pattern::ColorChart,
    ];
    let names: Vec<(&str, &str)> = all.iter().map(|pattern| (name(pattern), name(pattern))).collect();
    let mut chosen = name(pattern);
    if choice(ui, "pattern", "What is drawn on the target", &mut chosen, &names)
        && let Some(other) = all.into_iter().find(|pattern| name(pattern) == chosen)
    {
        *pattern = other;
    }
}

fn file(ui: &mut Ui, path: &mut PathBuf, words: &str) {
    if let Some(typed) =
        text(ui, "path", &format!("{words}; files can be dropped on the window"), &path.display().to_string())
    {
        *path = PathBuf::from(typed);
    }
}

fn kind_of(source: &SceneSource) -> Kind {
    match source {
        SceneSource::StillLife { .. } => Kind::StillLife,
        SceneSource::Target { .. } => Kind::Target,
        SceneSource::File(_) => Kind::File,
        SceneSource::World(_) => Kind::World,
    }
}

/// Puts a scene of another kind before the camera, whole enough to be seen.
fn change_kind(camera: &mut Camera, kind: Kind) {
    let scene = &mut camera.scene;
    let (columns, rows) = match scene.source {
        SceneSource::StillLife { columns, rows } | SceneSource::Target { columns, rows, .. } => (columns, rows),
        SceneSource::File(_) | SceneSource::World(_) => SIZE,
    };
    let path = match &scene.source {
        SceneSource::File(path) => path.clone(),
        SceneSource::World(world) => world.file.clone(),
        _ => PathBuf::new(),
    };
    scene.source = match kind {
        Kind::StillLife => SceneSource::StillLife { columns, rows },
        Kind::Target => {
            scene.field_of_view_deg.get_or_insert(36.0);
            scene.depth_m.get_or_insert(2.0);
            SceneSource::Target { pattern: Pattern::SiemensStar { n_cycles: 36 }, columns, rows }
        }
        Kind::File => SceneSource::File(path),
        Kind::World => {
            (scene.depth_m, scene.illuminance_lux, scene.illuminant, scene.mean_luminance_cd_m2) =
                (None, None, None, None);
            SceneSource::World(WorldSpec::of_file(path))
        }
    };
}
