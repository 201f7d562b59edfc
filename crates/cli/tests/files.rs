//! Where results go: through links and into what is no regular file, whole or not at all.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    fs,
    os::unix::fs::{FileTypeExt, symlink},
    path::Path,
    process::{Command, Stdio},
    thread,
};

use common::{CAMERA, check_error, dioptric, output};

const DRAW: [&str; 5] = ["lens", "draw", "dgauss-50mm", "--quiet", "-o"];

fn draw_to(folder: &Path, target: &str) -> String {
    output(folder, &[&DRAW[..], &[target]].concat())
}

/// Runs a line of a shell in a folder, `D` being the program.
fn shell(folder: &Path, line: &str) -> String {
    let mut run = Command::new("bash");
    run.arg("-c").arg(line).env("D", env!("CARGO_BIN_EXE_dioptric")).current_dir(folder);
    let run = run.output().unwrap();
    assert!(run.status.success(), "{line}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).unwrap()
}

#[test]
fn links_are_written_through() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("real.svg"), "old").unwrap();
    symlink("real.svg", at("link.svg")).unwrap();
    fs::create_dir(at("out")).unwrap();
    symlink(at("elsewhere.ron"), at("out/new.ron")).unwrap();
    draw_to(folder.path(), "link.svg");
    output(folder.path(), &["camera", "init", "-o", "out/new.ron"]);
    assert!(fs::read_to_string(at("real.svg")).unwrap().contains("<svg"));
    assert!(at("elsewhere.ron").is_file());
    assert!(["link.svg", "out/new.ron"].iter().all(|name| fs::symlink_metadata(at(name)).unwrap().is_symlink()));
}

#[test]
fn nodes_and_standard_output_take_the_bytes() {
    let folder = tempfile::tempdir().unwrap();
    draw_to(folder.path(), "file.svg");
    let whole = fs::read_to_string(folder.path().join("file.svg")).unwrap();
    for target in ["-", "/dev/stdout", "/dev/fd/1"] {
        assert_eq!(draw_to(folder.path(), target), whole, "{target}");
    }
    let line = format!("\"$D\" {} >(wc -c); sleep 0.2", DRAW.join(" "));
    assert_eq!(shell(folder.path(), &line).trim(), whole.len().to_string());
    // Standard output that is a file keeps what is there.
    shell(folder.path(), &format!("(echo first; \"$D\" {} /dev/stdout) > both.txt", DRAW.join(" ")));
    assert_eq!(fs::read_to_string(folder.path().join("both.txt")).unwrap(), format!("first\n{whole}"));
    // A reader that has seen enough is no fault.
    shell(folder.path(), &format!("\"$D\" {} - | head -c 10", DRAW.join(" ")));

    let fifo = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let reader = thread::spawn({
        let fifo = fifo.clone();
        move || fs::read_to_string(fifo).unwrap()
    });
    draw_to(folder.path(), "pipe");
    assert_eq!(reader.join().unwrap(), whole);
    draw_to(folder.path(), "/dev/null");
    assert!(fs::metadata(&fifo).unwrap().file_type().is_fifo());
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}

/// Rays, tables and lens files go the same way.
#[test]
fn every_kind_of_file_goes_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rays.csv"), "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n0,1,-10,0,0,1,550\n").unwrap();
    let run = |arguments: &[&str]| output(folder.path(), arguments);
    assert!(run(&["trace", "dgauss-50mm", "--rays", "rays.csv", "-o", "-"]).starts_with("ray,surface"));
    assert!(run(&["lens", "convert", "dgauss-50mm", "-"]).starts_with('('));
    let psf = ["psf", "dgauss-50mm", "--focus-mm", "2000", "--size", "16", "--quiet"];
    assert!(run(&[&psf[..], &["--csv", "-"]].concat()).starts_with("field_deg"));
    let exr = dioptric(folder.path(), &[&psf[..], &["-o", "-"]].concat());
    assert!(exr.stdout.starts_with(&[0x76, 0x2f, 0x31, 0x01]), "{:?}", exr.stderr);
}

#[test]
fn a_full_disk_and_a_folder_in_the_way_are_said_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let full = dioptric(folder.path(), &[&DRAW[..], &["/dev/full"]].concat());
    let said = String::from_utf8_lossy(&full.stderr).into_owned();
    assert!(!full.status.success() && said.contains("cannot write /dev/full"), "{said}");
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    fs::create_dir_all(folder.path().join("out/picture.png")).unwrap();
    check_error(folder.path(), &["run", "camera.ron", "--out", "out", "--quiet"], &["picture.png", "is a folder"]);
    assert_eq!(fs::read_dir(folder.path().join("out")).unwrap().count(), 1);
    // Before any work, too.
    fs::write(folder.path().join("held.svg"), "").unwrap();
    check_error(folder.path(), &[&DRAW[..], &["held.svg/a.svg"]].concat(), &["held.svg"]);
}

#[test]
fn threads_are_no_more_than_are_of_use() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"));
    run.args(["lens", "analyze", "dgauss-50mm", "--threads", "10000"]).stdout(Stdio::null()).current_dir(folder.path());
    let said = String::from_utf8(run.output().unwrap().stderr).unwrap();
    assert!(said.contains("threads in place of 10000: 4 per core"), "{said}");
}
