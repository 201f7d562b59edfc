//! An example or two at the foot of each command's help.

use clap::Command;

/// The words of a command and lines that a user types.
const EXAMPLES: &[(&str, &[&str])] = &[
    (
        "run",
        &[
            "dioptric run --scene photo.png --depth-m 2 --fov-deg 40 --f-number 2.8 --focus-mm 2000",
            "dioptric run camera.ron --quality preview --out look/",
            "dioptric run --from look --exposure-s 0.01 --out brighter/",
        ],
    ),
    ("video", &["dioptric video camera.ron --pan-deg-per-s 20 --row-time-us 30 --out frames/"]),
    ("lens list", &["dioptric lens list --json"]),
    ("lens info", &["dioptric lens info dgauss-50mm --f-number 4 --distance-mm 2000"]),
    ("lens analyze", &["dioptric lens analyze dgauss-50mm --f-number 4 --fields-deg 0,10,20 --out analysis/"]),
    ("lens draw", &["dioptric lens draw lens.zmx --fields-deg 0,10 -o lens.svg"]),
    ("lens ghosts", &["dioptric lens ghosts dgauss-50mm --fields-deg 0,5,10"]),
    ("lens compare", &["dioptric lens compare cooke-50mm tessar-50mm --f-number 5.6 --out both/"]),
    ("lens convert", &["dioptric lens convert lens.seq lens.zmx"]),
    ("camera init", &["dioptric camera init -o camera.ron"]),
    ("camera check", &["dioptric camera check camera.ron"]),
    ("camera schema", &["dioptric camera schema > camera.schema.json"]),
    ("sensor list", &["dioptric sensor list"]),
    ("sensor show", &["dioptric sensor show imx363"]),
    ("sensor init", &["dioptric sensor init imx363 -o sensor.ron"]),
    ("sensor optics", &["dioptric sensor optics sensor.ron"]),
    ("sensor schema", &["dioptric sensor schema > sensor.schema.json"]),
    ("filter list", &["dioptric filter list"]),
    ("filter show", &["dioptric filter show wratten-25"]),
    ("glass list", &["dioptric glass list"]),
    ("glass show", &["dioptric glass show N-BK7 --wavelengths-nm 400:700:50"]),
    ("trace", &["dioptric trace dgauss-50mm --rays rays.csv -o traced.csv"]),
    (
        "psf",
        &[
            "dioptric psf dgauss-50mm --focus-mm 2000 --fields-deg 0,10 --diffraction wave -o psf.png",
            "dioptric psf lens.zmx --focus-mm inf --distances-mm inf --mtf-per-mm 20,40 --csv -",
        ],
    ),
    (
        "render",
        &[
            "dioptric render world.pbrt --lens dgauss-50mm --f-number 4 --seconds 60 --out rendered/",
            "dioptric render world.glb --frame --sky day --pixels 640x480 --noise 0.02",
        ],
    ),
    ("scene info", &["dioptric scene info cube.mat --axes yxb"]),
    ("scene convert", &["dioptric scene convert photo.png scene.exr --depth depth.png --depth-unit mm"]),
    ("world info", &["dioptric world info world.glb"]),
    ("world convert", &["dioptric world convert world.pbrt world.glb"]),
    ("cache info", &["dioptric cache info"]),
    ("cache clear", &["dioptric cache clear"]),
    ("compare", &["dioptric compare camera.ron --samples 64 --out both/"]),
    ("lightfield", &["dioptric lightfield camera.ron --refocus-m 0.5,1 --out light/"]),
    ("sense", &["dioptric sense irradiance.exr --sensor imx363 --exposure-s 0.01 --out shot/"]),
    ("develop", &["dioptric develop IMG_0001.dng --white gray-world --out developed/"]),
    ("show", &["dioptric show picture.png --display srgb --distance-m 0.6 -o screen.exr"]),
    ("sweep", &["dioptric sweep --init -o plan.ron", "dioptric sweep plan.ron --shard 3/16"]),
    ("sweep index", &["dioptric sweep index plan.ron"]),
    ("sweep pack", &["dioptric sweep pack plan.ron --webdataset pictures.tar --items-per-tar 1000"]),
    (
        "sweep prune",
        &["dioptric sweep prune plan.ron --dry-run", "dioptric sweep prune plan.ron other.ron --store shared.store"],
    ),
    (
        "measure mtf",
        &["dioptric measure mtf edge.png --region 20,20,120,120 --out edge/", "dioptric measure mtf chart.png --all"],
    ),
    ("measure star", &["dioptric measure star star.png --cycles 72 --binary --modulation 0.8"]),
    ("measure grid", &["dioptric measure grid dots.png --out distortion/"]),
    ("measure shading", &["dioptric measure shading even.dng"]),
    ("measure steps", &["dioptric measure steps gray.png --steps gray.csv"]),
    ("measure spot", &["dioptric measure spot stars.png --pixel-um 3.45"]),
    (
        "measure region",
        &[
            "dioptric measure region shot/irradiance.exr --region 200,100,50,50",
            "dioptric measure region picture.png --region 20,20,40,40 --reference 80,20,40,40 --json",
        ],
    ),
    ("measure noise", &["dioptric measure noise --sensor imx363 --out bench/"]),
    ("measure color", &["dioptric measure color picture.png --against reference.png"]),
    ("measure texture", &["dioptric measure texture leaves.png --reference ideal.png"]),
    ("studio", &["dioptric studio camera.ron"]),
    ("completions", &["dioptric completions bash > dioptric.bash"]),
    ("man", &["dioptric man --out man/"]),
];

/// Returns a command with examples at the foot of its help and of those of its subcommands.
pub(crate) fn with_examples(command: Command) -> Command {
    EXAMPLES.iter().fold(command, |command, (words, lines)| {
        let words: Vec<&str> = words.split(' ').collect();
        let foot = format!("Examples:\n  {}", lines.join("\n  "));
        added(command, &words, &foot)
    })
}

fn added(command: Command, words: &[&str], foot: &str) -> Command {
    match words {
        [] => command.after_help(foot.to_owned()),
        [first, rest @ ..] => command.mut_subcommand(first, |command| added(command, rest, foot)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Cli;

    fn without_example(command: &Command, path: &str, found: &mut Vec<String>) {
        let mut has_subcommand = false;
        for command in command.get_subcommands().filter(|command| command.get_name() != "help") {
            has_subcommand = true;
            without_example(command, &format!("{path} {}", command.get_name()), found);
        }
        if command.get_after_help().is_none() && !has_subcommand {
            found.push(path.to_owned());
        }
    }

    #[test]
    fn every_command_has_an_example() {
        let mut found = Vec::new();
        without_example(&Cli::words(), "dioptric", &mut found);
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn examples_parse() {
        for line in EXAMPLES.iter().flat_map(|(_, lines)| *lines) {
            let typed = line.split(" > ").next().unwrap_or_default();
            let parsed = Cli::read(typed.split(' ')).map(|(_, in_range)| in_range);
            assert!(parsed.is_ok_and(|in_range| in_range.is_ok()), "{line}");
        }
    }
}
