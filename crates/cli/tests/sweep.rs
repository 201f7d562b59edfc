//! `dioptric sweep`: the words that users rely on, and a store that outlives its maker.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod common;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
    thread::sleep,
    time::{Duration, Instant},
};

use common::{CAMERA, check_error, dioptric, output};
use serde_json::{Value, json};

const PLAN: &str = r#"(base: File("camera.ron"), vary: [Grid({"exposure.Manual.time_s": List([0.01, 0.02])})])"#;

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&output(folder, arguments)).expect("the output is JSON")
}

#[test]
fn a_sweep_fills_its_store() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    fs::write(folder.path().join("plan.ron"), PLAN).unwrap();
    let counts = json(folder.path(), &["sweep", "plan.ron", "--dry-run", "--json"]);
    assert_eq!(counts, json!({"items": 2, "irradiances": 1, "done": 0, "refused": 0, "missing": 2}));
    assert!(!folder.path().join("plan.store").exists());

    let made = json(folder.path(), &["sweep", "plan.ron", "--limit", "1", "--json"]);
    assert_eq!((&made["done"], &made["left"]), (&json!(1), &json!(1)));
    assert!(output(folder.path(), &["sweep", "plan.ron"]).contains("1 items were there, 1 were made"));
    for name in ["index.jsonl", "index.csv", "index.html"] {
        assert!(folder.path().join("plan.store").join(name).is_file(), "{name}");
    }
    // The picture of an item is that of its camera file by itself.
    let lines = fs::read_to_string(folder.path().join("plan.store/index.jsonl")).unwrap();
    let first: Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    let id = first["id"].as_str().unwrap();
    let item = folder.path().join("plan.store/items").join(&id[..2]).join(id);
    output(folder.path(), &["run", item.join("camera.ron").to_str().unwrap(), "--out", "alone"]);
    for name in ["picture.png", "report.json"] {
        let alone = fs::read(folder.path().join("alone").join(name)).unwrap();
        assert!(fs::read(item.join(name)).unwrap() == alone, "{name}");
    }

    output(folder.path(), &["sweep", "index", "plan.ron", "--quiet"]);
    assert_eq!(fs::read_to_string(folder.path().join("plan.store/index.jsonl")).unwrap(), lines);
    assert_eq!(output(folder.path(), &["sweep", "pack", "plan.ron", "--webdataset", "out.tar"]), "out.tar\n");
    assert!(folder.path().join("out.tar").is_file());
}

/// A plan that was changed leaves the items it had before, says so, and has them removed.
#[test]
fn a_changed_plan_is_told_and_pruned() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    put("camera.ron", CAMERA);
    put("plan.ron", PLAN);
    let made = |plan: &str| json(folder.path(), &["sweep", plan, "--store", "s", "--json"]);
    assert_eq!((&made("plan.ron")["done"], &made("plan.ron")["others"]), (&json!(2), &json!(0)));
    put("other.ron", &PLAN.replace("0.01, 0.02", "0.02, 0.04, 0.08"));
    let changed = made("other.ron");
    assert_eq!((&changed["there"], &changed["done"], &changed["others"]), (&json!(1), &json!(2), &json!(1)));
    let told = output(folder.path(), &["sweep", "other.ron", "--store", "s"]);
    assert!(told.contains("1 more in the store") && told.contains("sweep prune other.ron"), "{told}");

    let prune = |arguments: &[&str]| json(folder.path(), &[&["sweep", "prune"], arguments, &["--json"]].concat());
    assert_eq!(prune(&["plan.ron", "other.ron", "--store", "s"]), json!({"others": 0, "removed": 0, "bytes": 0}));
    assert_eq!(prune(&["other.ron", "--store", "s", "--dry-run"]), json!({"others": 1, "removed": 0}));
    let pruned = prune(&["other.ron", "--store", "s"]);
    assert!(pruned["removed"] == json!(1) && pruned["bytes"].as_u64().unwrap() > 1000, "{pruned}");
    assert_eq!((&made("other.ron")["there"], &made("plan.ron")["done"]), (&json!(3), &json!(1)));
    check_error(folder.path(), &["sweep", "prune", "plan.ron"], &["plan.store", "no folder"]);
    assert!(
        fs::read_dir(folder.path().join("s")).unwrap().all(|e| !e
            .unwrap()
            .file_name()
            .to_string_lossy()
            .starts_with(".tmp"))
    );
}

/// A tiny item with its picture alone takes 2 kB; the index has the metrics all the same.
#[test]
fn what_is_kept_of_an_item_is_chosen() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    let lines = |keep: &str, store: &str| {
        let plan = PLAN.replacen("(base", &format!("({keep}base"), 1);
        fs::write(folder.path().join("plan.ron"), plan).unwrap();
        output(folder.path(), &["sweep", "plan.ron", "--store", store, "--quiet"]);
        let text = fs::read_to_string(folder.path().join(store).join("index.jsonl")).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<Value>>()
    };
    let all = lines("", "all");
    for (keep, files_of, page) in [
        ("keep: [Picture], ", &["metrics.json", "picture.png"][..], "\"small\":\"picture.png\""),
        ("keep: [Report, Thumbnail], ", &["report.json", "thumbnail.png"], "\"large\":\"thumbnail.png\""),
        ("keep: [], ", &["metrics.json"], "\"small\":null"),
    ] {
        let store = keep.replace([' ', ':', '[', ']', ','], "");
        let some = lines(keep, &store);
        for (all, some) in all.iter().zip(&some) {
            assert!(all["metrics"] == some["metrics"] && all["id"] != some["id"], "{keep}");
            let id = some["id"].as_str().unwrap();
            let kept = files(&folder.path().join(&store).join("items").join(&id[..2]).join(id));
            assert_eq!(kept.keys().collect::<Vec<_>>(), files_of.iter().map(Path::new).collect::<Vec<_>>());
            if !files_of.contains(&"report.json") {
                assert!(
                    kept["metrics.json".as_ref() as &Path].len() < 1050,
                    "{}",
                    kept["metrics.json".as_ref() as &Path].len()
                );
            }
        }
        assert!(fs::read_to_string(folder.path().join(&store).join("index.html")).unwrap().contains(page), "{keep}");
    }
}

#[test]
fn plans_to_begin_with_are_plans() {
    let folder = tempfile::tempdir().unwrap();
    output(folder.path(), &["sweep", "--init", "-o", "plan.ron"]);
    let counts = json(folder.path(), &["sweep", "plan.ron", "--dry-run", "--json", "--shard", "1/1"]);
    assert_eq!((&counts["items"], &counts["irradiances"]), (&json!(12), &json!(3)));
    assert!(json(folder.path(), &["sweep", "--schema"])["properties"]["vary"].is_object());
    check_error(folder.path(), &["sweep", "--init", "-o", "plan.ron"], &["plan.ron", "already"]);
}

#[test]
fn wrong_plans_end_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let put = |text: &str| fs::write(folder.path().join("plan.ron"), text).unwrap();
    let check = |words: &[&str]| check_error(folder.path(), &["sweep", "plan.ron"], words);
    check(&["cannot read plan.ron"]);
    put("not a plan");
    check(&["plan.ron:1:"]);
    put(PLAN);
    check(&["camera.ron"]);
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    put(&PLAN.replace("exposure.Manual", "exposures.Manual"));
    check(&["'exposures.Manual.time_s'", "unknown field `exposures`"]);
    put(&PLAN.replace("[0.01, 0.02]", "[]"));
    check(&["'exposure.Manual.time_s'", "no values"]);
    put(PLAN);
    check_error(folder.path(), &["sweep", "plan.ron", "--shard", "3/2"], &["'3/2'", "I/N"]);
    check_error(folder.path(), &["sweep", "plan.ron", "--seed", "3"], &["--seed"]);
    check_error(folder.path(), &["sweep"], &["expected a plan"]);
    check_error(folder.path(), &["sweep", "pack", "plan.ron", "--webdataset", "o.tar"], &["none of its items"]);
    check_error(folder.path(), &["sweep", "index", "plan.ron"], &["plan.store"]);
    assert!(!dioptric(folder.path(), &["sweep", "plan.ron", "index", "plan.ron"]).status.success());
}

#[test]
fn unreadable_files_end_in_an_error_and_are_no_results() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    fs::write(folder.path().join("cut.exr"), [0x76, 0x2f, 0x31, 0x01]).unwrap();
    let scene = r#"(source: File("cut.exr"), field_of_view_deg: 14.0, depth_m: 2.0)"#;
    let vary = format!(r#"Grid({{"scene": List([{scene}]), "seed": List([1, 2])}})"#);
    fs::write(folder.path().join("plan.ron"), format!(r#"(base: File("camera.ron"), vary: [{vary}])"#)).unwrap();
    for _ in 0..2 {
        let words = ["2 items were not made", "cut.exr", "tried again"];
        let done = dioptric(folder.path(), &["sweep", "plan.ron", "--json"]);
        let error = String::from_utf8(done.stderr).unwrap();
        assert!(!done.status.success() && words.iter().all(|word| error.contains(word)), "{error}");
        let counts: Value = serde_json::from_slice(&done.stdout).unwrap();
        assert_eq!((&counts["failed"], &counts["refused"]), (&json!(2), &json!(0)));
    }
}

/// Returns every file below a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// Killed without warning at ten moments of a sweep, each at another part of it, and ended: the store of one that was left alone.
#[test]
fn a_killed_sweep_goes_on_to_the_same_store() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), CAMERA).unwrap();
    let vary = r#"Grid({"stop.FNumber": List([2.8, 4, 0.1]), "seed": Linear(first: 1, last: 40, count: 40)})"#;
    fs::write(folder.path().join("plan.ron"), format!(r#"(base: File("camera.ron"), vary: [{vary}])"#)).unwrap();
    let start = Instant::now();
    let made = json(folder.path(), &["sweep", "plan.ron", "--store", "whole", "--json"]);
    assert_eq!((&made["done"], &made["refused"]), (&json!(80), &json!(40)));
    let whole = start.elapsed();
    let cut = folder.path().join("cut");
    let n_there = || {
        fs::read_dir(cut.join("items")).map_or(0, |folders| {
            folders.map(|above| fs::read_dir(above.unwrap().path()).unwrap().count()).sum::<usize>()
        })
    };
    let mut seen = vec![0];
    // Moments of a golden section, so that they are spread over what a part of a sweep does.
    for n in 1..=10 {
        let mut run = Command::new(env!("CARGO_BIN_EXE_dioptric"))
            .args(["sweep", "plan.ron", "--store", "cut", "--quiet"])
            .env("DIOPTRIC_CACHE", "")
            .current_dir(folder.path())
            .spawn()
            .unwrap();
        sleep(whole.mul_f64(0.1 + 0.5 * (f64::from(n) * 0.618_034).fract()).min(Duration::from_secs(3)));
        run.kill().unwrap();
        run.wait().unwrap();
        seen.push(n_there());
    }
    assert!(seen.is_sorted() && seen[10] > 0, "what is there stays there: {seen:?}");
    let made = json(folder.path(), &["sweep", "plan.ron", "--store", "cut", "--json"]);
    assert_eq!(made["there"], json!(seen[10]));
    assert!(files(&cut) == files(&folder.path().join("whole")), "the same store, and nothing of the killed");
}
