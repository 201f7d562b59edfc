//! A list of what users may hand over by mistake: each ends in one sentence and a status of 1 (2 for the command line), leaves every file
//! as it was, and takes no more memory than a small run may. The tables hold what is wrong and words of the answer.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod camera;
#[path = "../common/mod.rs"]
mod common;
mod files;
mod flags;
mod lens;
mod payloads;
mod sensor;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use common::CAMERA;

/// Address space that a refused run may take, KiB: threads reserve some hundred MB, and a picture that is believed takes more than this.
const MOST_KIB: usize = 3 << 20;

/// Files by their names.
type Files<'a> = Vec<(&'a str, Vec<u8>)>;

/// Checks that a run in a folder of these files is refused in these words, and that it changes none of them.
#[track_caller]
fn check(files: &Files<'_>, line: &[&str], words: &str) {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    let before = content_of(folder.path());
    let done = limited(folder.path(), line);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(matches!(done.status.code(), Some(1 | 2)), "{line:?} {words:?}: {said}");
    assert!(said.starts_with("error: ") && said.lines().count() == 1, "{line:?}: {said}");
    assert!(said.contains(words), "{line:?}: {words:?} in {said}");
    assert!(content_of(folder.path()) == before, "{line:?} {words:?} left or changed something");
}

/// Runs the program with a bound on its memory, where the system has one.
fn limited(folder: &Path, line: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_dioptric");
    let mut command = if cfg!(target_os = "linux") {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -v {MOST_KIB}; exec \"$0\" \"$@\""), program]);
        shell
    } else {
        Command::new(program)
    };
    // Each thread reserves memory, and the number of cores is the machine's.
    command.env("RAYON_NUM_THREADS", "2").env("DIOPTRIC_CACHE", "");
    command.args(line).current_dir(folder).output().unwrap()
}

fn content_of(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| (path.clone(), fs::read(&path).ok())).collect()
}

/// Returns a text in which something takes the place of something else that is there.
#[track_caller]
fn changed(text: &str, from: &str, to: &str) -> Vec<u8> {
    assert!(text.contains(from), "{from}");
    text.replace(from, to).into_bytes()
}

const RUN: [&str; 5] = ["run", "camera.ron", "--out", "out", "--quiet"];

#[test]
fn camera_files() {
    for (from, to, words) in camera::CHANGED {
        check(&vec![("camera.ron", changed(CAMERA, from, to))], &RUN, words);
    }
    let sensor = "sensor: BuiltIn(\"nikon-d5100\"),";
    for (key, words) in camera::ADDED {
        check(&vec![("camera.ron", changed(CAMERA, sensor, &format!("{sensor} {key},")))], &RUN, words);
    }
    for (text, words) in [
        ("".to_owned(), "Expected opening `(` for struct `Camera`"),
        ("()".to_owned(), "missing field named `name` in `Camera`"),
        ("\0\u{1}\u{2}".to_owned(), "it is no text, expected a camera file"),
        ("(".repeat(100_000), "Expected identifier"),
        (CAMERA.to_owned() + "x", "Non-whitespace trailing characters"),
        ("\u{feff}(".to_owned(), "camera.ron:1:1: Unexpected end of RON"),
    ] {
        check(&vec![("camera.ron", text.into_bytes())], &RUN, words);
    }
}

#[test]
fn lens_files() {
    let lenses = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/lenses");
    for (ending, from, to, words) in lens::CHANGED {
        // Some have the ends of lines of another system.
        let own = || fs::read_to_string(lenses.join(format!("canon-50mm.{ending}"))).unwrap().replace("\r\n", "\n");
        let text = if *ending == "ron" { lens::RON.to_owned() } else { own() };
        let name = format!("lens.{}", ending.trim_start_matches("deeplens."));
        check(&vec![(name.as_str(), changed(&text, from, to))], &["lens", "info", &name], words);
    }
    for (ending, text, words) in lens::OTHER {
        let name = format!("lens.{ending}");
        check(&vec![(name.as_str(), text.as_bytes().to_vec())], &["lens", "info", &name], words);
    }
    for (ending, start) in [("ron", "("), ("ron", "["), ("json", "["), ("json", "{\"a\":")] {
        let name = format!("lens.{ending}");
        check(&vec![(name.as_str(), start.repeat(100_000).into_bytes())], &["lens", "info", &name], &name);
    }
}

#[test]
fn sensor_files() {
    let folder = tempfile::tempdir().unwrap();
    let text = common::output(folder.path(), &["sensor", "show", "imx363"]);
    let line = [&RUN[..], &["--sensor", "s.ron"]].concat();
    for (from, to, words) in sensor::CHANGED {
        assert!(text.contains(from), "{from}");
        let sensor = text.replacen(from, to, 1).into_bytes();
        check(&vec![("camera.ron", CAMERA.into()), ("s.ron", sensor)], &line, words);
    }
}

#[test]
fn worlds_plans_and_headers() {
    let line = ["render", "w.pbrt", "--lens", "dgauss-50mm", "--pixels", "8x8", "--samples", "8", "--out", "out"];
    for (more, words) in files::WORLDS {
        check(&vec![("w.pbrt", format!("{}{more}\n", payloads::WORLD).into_bytes())], &line, words);
    }
    for (plan, words) in files::PLANS {
        check(&vec![("plan.ron", plan.as_bytes().to_vec())], &["sweep", "plan.ron"], words);
    }
    let scene = [&RUN[..], &["--scene", "s.hdr", "--fov-deg", "10", "--depth-m", "2"]].concat();
    for (from, to, words) in files::HEADERS {
        let header = changed(files::ENVI, from, to);
        let files = vec![("camera.ron", CAMERA.into()), ("s.hdr", header), ("s.img", vec![0x3d; 128])];
        check(&files, &scene, words);
    }
}

#[test]
fn command_lines() {
    let files = payloads::around();
    for (line, words) in flags::LINES {
        let mut line: Vec<&str> = line.split(' ').collect();
        let has_folder = ["run", "render", "compare", "lightfield"].contains(&line[0]);
        if has_folder && !line.contains(&"--out") {
            line.extend(["--out", "out"]);
        }
        check(&files, &line, words);
    }
}

#[test]
fn pictures() {
    let line = [&RUN[..], &["--scene", "s.png", "--fov-deg", "10", "--depth-m", "2"]].concat();
    for (picture, words) in payloads::pictures() {
        check(&vec![("camera.ron", CAMERA.into()), ("s.png", picture)], &line, words);
    }
    let scene = [&RUN[..], &["--scene", "s.mat"]].concat();
    let mat = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes/iset_plain.mat");
    let mat = fs::read(mat).unwrap();
    for n in [0, 10, 128, 140, 200, 1000] {
        check(&vec![("camera.ron", CAMERA.into()), ("s.mat", mat[..n].to_vec())], &scene, "s.mat: cannot be read: ");
    }
}

#[test]
fn irradiances() {
    let line = ["sense", "light.exr", "--sensor", "imx363", "--out", "out", "--quiet"];
    for (exr, words) in payloads::irradiances() {
        check(&vec![("light.exr", exr)], &line, words);
    }
}

/// The list grows: what is found to be taken amiss is added to it.
#[test]
fn the_list_is_long() {
    let n_cases = camera::CHANGED.len()
        + camera::ADDED.len()
        + lens::CHANGED.len()
        + lens::OTHER.len()
        + sensor::CHANGED.len()
        + files::WORLDS.len()
        + files::PLANS.len()
        + files::HEADERS.len()
        + flags::LINES.len();
    assert!(n_cases >= 400, "{n_cases}");
}
