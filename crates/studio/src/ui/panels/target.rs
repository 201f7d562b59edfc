//! What is drawn on a target.

use dioptric_scene::{Pattern, Wave};
use egui::Ui;

use super::super::fields::{NumberField, count, optional, text, variant};

pub(super) fn target(ui: &mut Ui, pattern: &mut Pattern) {
    let all = [
        (Pattern::Uniform, "uniform"),
        (Pattern::Checkerboard { check_px: 40 }, "checkerboard"),
        (Pattern::SlantedBar { slope: 0.0875 }, "slanted edge"),
        (Pattern::RadialLines { n_lines: 12 }, "radial lines"),
        (Pattern::PointArray { spacing_px: 60 }, "points"),
        (Pattern::SiemensStar { n_cycles: 36 }, "Siemens star"),
        (Pattern::ColorChart, "color chart"),
        (
            Pattern::DeadLeaves {
                min_radius_px: 1.0,
                max_radius_px: 100.0,
                min_reflectance: 0.25,
                max_reflectance: 0.75,
                seed: 1,
            },
            "dead leaves",
        ),
        (Pattern::Harmonics { waves: vec![wave(8.0)] }, "harmonics"),
        (Pattern::Gabor { wave: wave(16.0), sigma: 0.1 }, "Gabor patch"),
        (Pattern::Lines { spacing_px: 40.0, width_px: 4.0, angle_deg: 0.0 }, "lines"),
        (Pattern::Grid { spacing_px: 40.0, width_px: 4.0 }, "grid"),
        (Pattern::Sweep { first_cycles: 4.0, last_cycles: 120.0, contrast: 1.0 }, "sweep"),
        (Pattern::ZonePlate { edge_cycles: 160.0, contrast: 1.0 }, "zone plate"),
        (Pattern::Ramp { steps: 0, ratio: None }, "ramp"),
        (Pattern::Letters { text: "E F P T O Z".to_owned(), height_px: 80.0 }, "letters"),
        (Pattern::Noise { cell_px: 1, contrast: 1.0, seed: 1 }, "noise"),
    ];
    variant(ui, "pattern", "What is drawn on the target", pattern, &all);
    let whole = |ui: &mut Ui, title: &str, words: &str, value: &mut usize| {
        count(ui, title, words, 1..=4096, value);
    };
    match pattern {
        Pattern::Uniform | Pattern::ColorChart => {}
        Pattern::Checkerboard { check_px } => whole(ui, "check", "Side of a square, samples", check_px),
        Pattern::SlantedBar { slope } => {
            let words = "Rows a column along the edge: 0.0875 is 5° from upright";
            NumberField::even("slope", "", -1.0..=1.0, -0.3..=0.3, words).show(ui, slope);
        }
        Pattern::RadialLines { n_lines } => whole(ui, "lines", "Whole lines; 8 give 16 rays", n_lines),
        Pattern::PointArray { spacing_px } => whole(ui, "points apart", "From point to point, samples", spacing_px),
        Pattern::SiemensStar { n_cycles } => whole(ui, "cycles", "Pairs of sectors once around", n_cycles),
        Pattern::DeadLeaves { min_radius_px, max_radius_px, min_reflectance, max_reflectance, seed } => {
            // A field that is set beyond the other end of its range takes that along.
            let words = "Radius of the smallest discs, samples";
            if NumberField::by_factors("smallest leaf", "", 0.1..=5e5, 0.3..=30.0, words).show(ui, min_radius_px)
                && *min_radius_px >= *max_radius_px
            {
                *max_radius_px = 2.0 * *min_radius_px;
            }
            let words = "Radius of the largest discs, samples";
            if NumberField::by_factors("largest leaf", "", 0.2..=1e6, 10.0..=1000.0, words).show(ui, max_radius_px)
                && *min_radius_px >= *max_radius_px
            {
                *min_radius_px = 0.5 * *max_radius_px;
            }
            let words = "What the darkest discs reflect, as a share of white";
            if NumberField::even("darkest leaf", "", 0.0..=1.0, 0.0..=1.0, words).show(ui, min_reflectance) {
                *max_reflectance = max_reflectance.max(*min_reflectance);
            }
            let words = "What the lightest discs reflect, as a share of white";
            if NumberField::even("lightest leaf", "", 0.0..=1.0, 0.0..=1.0, words).show(ui, max_reflectance) {
                *min_reflectance = min_reflectance.min(*max_reflectance);
            }
            seed_field(ui, "leaf seed", seed);
        }
        Pattern::Harmonics { waves } => {
            count_of_waves(ui, waves);
            // Each gets an equal part of what contrasts may add up to.
            let most = 1.0 / waves.len().max(1) as f64;
            for (index, wave) in waves.iter_mut().enumerate() {
                ui.push_id(index, |ui| wave_fields(ui, wave));
                wave.contrast = wave.contrast.min(most);
            }
        }
        Pattern::Gabor { wave, sigma } => {
            wave_fields(ui, wave);
            let words = "Standard deviation of the window, as a share of the width";
            NumberField::by_factors("window", "", 1e-3..=10.0, 0.02..=0.5, words).show(ui, sigma);
        }
        Pattern::Lines { spacing_px, width_px, angle_deg } => {
            lines(ui, spacing_px, width_px);
            NumberField::even("turned", "°", -180.0..=180.0, -90.0..=90.0, "From upright, clockwise")
                .show(ui, angle_deg);
        }
        Pattern::Grid { spacing_px, width_px } => lines(ui, spacing_px, width_px),
        Pattern::Sweep { first_cycles, last_cycles, contrast } => {
            NumberField::by_factors("first cycles", "", 0.01..=1e4, 1.0..=100.0, "At the left edge, over the width")
                .show(ui, first_cycles);
            NumberField::by_factors("last cycles", "", 0.01..=1e4, 10.0..=1000.0, "At the right edge, over the width")
                .show(ui, last_cycles);
            contrast_field(ui, contrast);
        }
        Pattern::ZonePlate { edge_cycles, contrast } => {
            NumberField::by_factors(
                "edge cycles",
                "",
                0.01..=1e4,
                10.0..=1000.0,
                "At the left and right edges, over the width",
            )
            .show(ui, edge_cycles);
            contrast_field(ui, contrast);
        }
        Pattern::Ramp { steps, ratio } => {
            count(ui, "steps", "So many grays; 0 for an even ramp", 0..=256, steps);
            let words = "White over the darkest, of a ramp in equal ratios";
            optional(ui, NumberField::by_factors("ratio", "", 1.001..=1e9, 2.0..=1e5, words), ratio, 1000.0);
        }
        Pattern::Letters { text: words, height_px } => {
            if let Some(typed) =
                text(ui, "words", "A line of words about the center", words).filter(|typed| !typed.is_empty())
            {
                *words = typed;
            }
            NumberField::by_factors(
                "capitals",
                "px",
                1.0..=4096.0,
                10.0..=500.0,
                "Height of a capital letter, samples",
            )
            .show(ui, height_px);
        }
        Pattern::Noise { cell_px, contrast, seed } => {
            whole(ui, "cell", "Side of a square of one gray, samples", cell_px);
            contrast_field(ui, contrast);
            seed_field(ui, "noise seed", seed);
        }
    }
}

/// An upright wave of full contrast.
fn wave(cycles: f64) -> Wave {
    Wave { cycles, contrast: 1.0, phase_deg: 0.0, angle_deg: 0.0 }
}

fn count_of_waves(ui: &mut Ui, waves: &mut Vec<Wave>) {
    let mut n = waves.len();
    if count(ui, "waves", "How many waves are added", 1..=16, &mut n) {
        waves.resize(n, wave(16.0));
    }
}

fn wave_fields(ui: &mut Ui, wave: &mut Wave) {
    NumberField::by_factors("wave cycles", "", 0.01..=1e4, 1.0..=500.0, "Cycles over the width")
        .show(ui, &mut wave.cycles);
    contrast_field(ui, &mut wave.contrast);
    NumberField::even("phase", "°", -360.0..=360.0, -180.0..=180.0, "At the center: 0 is light there")
        .show(ui, &mut wave.phase_deg);
    NumberField::even("wave turned", "°", -180.0..=180.0, -90.0..=90.0, "From upright, clockwise")
        .show(ui, &mut wave.angle_deg);
}

fn contrast_field(ui: &mut Ui, contrast: &mut f64) {
    NumberField::even("pattern contrast", "", 0.0..=1.0, 0.0..=1.0, "(Most − least) / (most + least)")
        .show(ui, contrast);
}

fn lines(ui: &mut Ui, spacing_px: &mut f64, width_px: &mut f64) {
    NumberField::by_factors("lines apart", "px", 0.1..=1e4, 4.0..=200.0, "From line to line, samples")
        .show(ui, spacing_px);
    NumberField::by_factors("line width", "px", 0.01..=1e4, 1.0..=50.0, "Width of a line, samples").show(ui, width_px);
    // A width that reaches the next line takes half of the way.
    if *width_px >= *spacing_px {
        *width_px = 0.5 * *spacing_px;
    }
}

fn seed_field(ui: &mut Ui, title: &str, seed: &mut u64) {
    let mut number = *seed as usize;
    if count(ui, title, "The same seed, the same pattern", 0..=1_000_000, &mut number) {
        *seed = number as u64;
    }
}
