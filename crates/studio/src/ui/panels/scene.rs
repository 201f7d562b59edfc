//! The scene and its light.

use std::path::{Path, PathBuf};

use dioptric_pipeline::{
    Camera, FileReading, FillDepth, FlatSize, SceneSource, SceneSpec, WorldSpec, light_word, parse_illuminant,
};
use dioptric_scene::Pattern;
use dioptric_spectrum::Illuminant;
use egui::{CollapsingHeader, Ui};

use super::{
    super::fields::{NumberField, choice, count, meaning, optional, text, tick},
    Desk, path,
    target::target,
    world,
};
use crate::engine::Field;

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
        SceneSource::File(path) => {
            path::show(ui, path, "Spectral EXR, ENVI header, folder of band pictures, or a picture", desk);
        }
        SceneSource::World(spec) => world::show(ui, spec, desk),
    }
    let view = NumberField::even(
        "field of view",
        "°",
        0.01..=179.9,
        1.0..=120.0,
        "Horizontal field of view of the scene from edge to edge",
    );
    optional(ui, view, &mut camera.scene.field_of_view_deg, 36.0);
    if kind_of(&camera.scene.source) != Kind::World {
        if kind_of(&camera.scene.source) != Kind::StillLife {
            let words = "One depth for a scene that has none, from the entrance pupil";
            let depth = NumberField::by_factors("depth", "m", 1e-4..=1e6, 0.1..=100.0, words);
            optional(ui, depth, &mut camera.scene.depth_m, 2.0);
        }
        light(ui, &mut camera.scene);
        CollapsingHeader::new("More of the scene").show(ui, |ui| more(ui, &mut camera.scene));
    }
    desk.tell(ui, Field::Scene, camera);
}

fn light(ui: &mut Ui, scene: &mut SceneSpec) {
    let words = "Light on the scene; of a picture that of its white";
    let lux = NumberField::by_factors("illuminance", "lx", 1e-6..=1e7, 0.1..=1e5, words);
    optional(ui, lux, &mut scene.illuminance_lux, 1000.0);
    let words = "Light to put the scene under: A, D50, D55, D65, D75, E, FL2, FL11, LED-B3, a temperature (3200K), a chromaticity \
                 (0.46,0.414) or a CSV file; 'its own' for that of the scene";
    illuminant(ui, "light", words, &mut scene.illuminant);
}

/// A light that may be left out.
fn illuminant(ui: &mut Ui, title: &str, words: &str, value: &mut Option<Illuminant>) {
    let now = match &value {
        None => "its own".to_owned(),
        Some(light) => light_word(light).unwrap_or_else(|| "measured".to_owned()),
    };
    let parse = |typed: &str| match typed {
        "" | "its own" => Ok(None),
        word => parse_illuminant(word).map(Some).map_err(|error| error.to_string()),
    };
    if let Some(light) = meaning(ui, title, words, &now, parse) {
        *value = light;
    }
}

/// What few scenes need.
fn more(ui: &mut Ui, scene: &mut SceneSpec) {
    let words = "Scales the radiance to this mean luminance";
    let luminance = NumberField::by_factors("mean luminance", "cd/m²", 1e-9..=1e9, 0.01..=1e4, words);
    optional(ui, luminance, &mut scene.mean_luminance_cd_m2, 100.0);
    let words = "Scales the light so that the film gets this illuminance on average";
    let lux = NumberField::by_factors("mean on the film", "lux", 1e-9..=1e9, 0.01..=1e4, words);
    optional(ui, lux, &mut scene.mean_lux, 10.0);
    let mut is_flat = scene.flat.is_some();
    let words = "A flat scene stated by its size, in place of field of view and depth: slides, documents, wafers";
    let has_own_depths = matches!(scene.source, SceneSource::StillLife { .. });
    if !has_own_depths && tick(ui, "flat, by its size", words, &mut is_flat) {
        scene.flat = is_flat.then_some(FlatSize { width_mm: 300.0, distance_mm: 1000.0 });
        if is_flat {
            (scene.field_of_view_deg, scene.depth_m) = (None, None);
        }
    }
    if let Some(flat) = &mut scene.flat {
        let words = "From edge to edge of the flat scene";
        NumberField::by_factors("flat width", "mm", 1e-6..=1e9, 1.0..=1e4, words).show(ui, &mut flat.width_mm);
        let words = "From the first vertex of the lens to the flat scene";
        NumberField::by_factors("flat distance", "mm", 1e-6..=1e12, 10.0..=1e5, words).show(ui, &mut flat.distance_mm);
    }
    if let SceneSource::File(_) = scene.source {
        of_file(ui, scene);
    }
}

/// What files leave open.
fn of_file(ui: &mut Ui, scene: &mut SceneSpec) {
    let words = "The light that is on a file of radiance that does not state it: what white balance goes by";
    illuminant(ui, "file's light", words, &mut scene.light);
    let words = "The number that a perfect white has in an ENVI file that does not state it";
    let white = NumberField::by_factors("white level", "", 1e-12..=1e12, 1.0..=65_535.0, words);
    optional(ui, white, &mut scene.white_level, 1.0);
    let fills = [
        (None, "not filled"),
        (Some(FillDepth::Beside), "that beside"),
        (Some(FillDepth::Far), "far away"),
        (Some(FillDepth::Metres(10.0)), "a depth"),
    ];
    let words = "The depth of samples where none was measured (code 0 of a depth picture)";
    let mut kind = fills.iter().position(|(fill, _)| same_fill(fill, &scene.fill_depth)).unwrap_or(0);
    let numbers: Vec<(usize, &str)> = fills.iter().enumerate().map(|(i, (_, name))| (i, *name)).collect();
    if choice(ui, "missing depth", words, &mut kind, &numbers) {
        scene.fill_depth = fills[kind].0;
    }
    if let Some(FillDepth::Metres(m)) = &mut scene.fill_depth {
        let words = "Depth of samples where none was measured";
        NumberField::by_factors("filled depth", "m", 1e-6..=1e9, 0.1..=1000.0, words).show(ui, m);
    }
    let now = scene.hidden.as_deref().unwrap_or(Path::new("")).display().to_string();
    let words = "A file of what lies behind the first surface: radiance and depth of the same samples; empty for none";
    if let Some(typed) = text(ui, "hidden file", words, &now) {
        scene.hidden = (!typed.is_empty()).then(|| PathBuf::from(typed));
    }
    let now = scene.points.as_deref().unwrap_or(Path::new("")).display().to_string();
    let words = "A table (.csv) of points that shine beside the samples, as stars and lamps: x_deg, y_deg, magnitude or candela, depth_m; empty for none";
    if let Some(typed) = text(ui, "points file", words, &now) {
        scene.points = (!typed.is_empty()).then(|| PathBuf::from(typed));
    }
}

fn same_fill(a: &Option<FillDepth>, b: &Option<FillDepth>) -> bool {
    a.map(|a| std::mem::discriminant(&a)) == b.map(|b| std::mem::discriminant(&b))
}

fn size(ui: &mut Ui, columns: &mut usize, rows: &mut usize) {
    let before = (*columns, *rows);
    if count(ui, "scene width", "Columns of samples of the scene; its height follows", 2..=8192, columns) {
        *rows = (before.1 * *columns).div_ceil(before.0.max(1)).max(1);
    }
    count(ui, "scene height", "Rows of samples of the scene", 1..=8192, rows);
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
    if kind != Kind::File {
        (scene.light, scene.white_level, scene.fill_depth, scene.hidden) = (None, None, None, None);
        scene.reading = FileReading::default();
    }
    scene.source = match kind {
        Kind::StillLife => {
            (scene.depth_m, scene.flat) = (None, None);
            SceneSource::StillLife { columns, rows }
        }
        Kind::Target => {
            scene.field_of_view_deg.get_or_insert(36.0);
            scene.depth_m.get_or_insert(2.0);
            SceneSource::Target { pattern: Pattern::SiemensStar { n_cycles: 36 }, columns, rows }
        }
        Kind::File => SceneSource::File(path),
        Kind::World => {
            (scene.depth_m, scene.illuminance_lux, scene.illuminant) = (None, None, None);
            (scene.mean_luminance_cd_m2, scene.flat) = (None, None);
            SceneSource::World(WorldSpec::of_file(path))
        }
    };
}
