//! Whole sweeps of small pictures: what is in their stores, and that nothing but the plan decides it.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use dioptric_analysis::{Run, RunReport};
use dioptric_pipeline::{Camera, KeptCamera, Progress, Silent, Stage, picture_png};
use dioptric_spectrum::Cancel;
use dioptric_sweep::{Index, IndexRow, Maker, Outcome, Plan, Shard, Status, Store, Sweep, SweepError, SweepProgress};

/// Two apertures, three exposures, and an f-number that the lens does not open to.
const PLAN: &str = r#"(
    base: Camera((
        name: "small", lens: BuiltIn("dgauss-50mm"), focus: DistanceMm(2000.0),
        film: Pixels(columns: 48, rows: 32, pitch_um: 200.0), sensor: BuiltIn("nikon-d5100"),
        scene: (source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0),
        wavelengths: ListNm([450.0, 550.0, 650.0]),
    )),
    vary: [Grid({"exposure.Manual.time_s": List([0.001, 0.01, 0.1]), "stop.FNumber": List([4, 8, 0.1])})],
    outputs: (raw: true),
)"#;

fn sweep(text: &str, folder: &Path) -> Sweep {
    let path = folder.join("plan.ron");
    Plan::parse(text, &path).and_then(|plan| Sweep::of(plan, &path)).expect("the plan is right")
}

fn make(sweep: &Sweep, store: &Store, shard: &str) {
    let shard = shard.parse().expect("a shard");
    let made = sweep.make(&store.begin().expect("a workplace"), shard, None, &Silent, &Cancel::new());
    assert_eq!(made.expect("the items can be made").n_left, 0);
}

fn rows(sweep: &Sweep, store: &Store) -> Vec<IndexRow> {
    Index::of(sweep, store).rows().collect::<Result<_, _>>().expect("the store can be read")
}

/// Returns every file below a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = fs::read(&path).expect("a file");
                all.insert(path.strip_prefix(folder).expect("it lies there").to_owned(), bytes);
            }
        }
    }
    all
}

/// Cancels at the n-th report of progress.
struct CancelAt {
    left: AtomicUsize,
    cancel: Cancel,
}

impl Progress for CancelAt {
    fn at(&self, _: Stage, _: f64) {
        if self.left.fetch_sub(1, Ordering::SeqCst) == 1 {
            self.cancel.cancel();
        }
    }
}

impl SweepProgress for CancelAt {}

/// The sweep of the plan in a folder of its own, and its store, made at one go.
struct Whole {
    folder: tempfile::TempDir,
    sweep: Sweep,
    store: Store,
}

impl Whole {
    fn made() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let sweep = sweep(PLAN, folder.path());
        let store = Store::new(&folder.path().join("whole"));
        let made = sweep
            .make(&store.begin().expect("a workplace"), Shard::ALL, None, &Silent, &Cancel::new())
            .expect("it is made");
        assert_eq!((made.n_done, made.n_refused, made.n_there), (6, 3, 0));
        Index::of(&sweep, &store).write().expect("the index");
        Self { folder, sweep, store }
    }

    fn store(&self, name: &str) -> Store {
        Store::new(&self.folder.path().join(name))
    }
}

#[test]
fn stores_depend_on_the_plan_alone() {
    let whole = Whole::made();
    let (sweep, expected) = (&whole.sweep, files(whole.store.folder()));
    assert_eq!((sweep.len(), sweep.n_irradiances(Shard::ALL)), (9, 3));

    // Again: nothing is made, and the index is the same.
    let again = sweep.make(&whole.store.begin().unwrap(), Shard::ALL, None, &Silent, &Cancel::new()).unwrap();
    assert_eq!((again.n_there, again.n_done + again.n_refused), (9, 0));
    Index::of(sweep, &whole.store).write().unwrap();
    assert!(files(whole.store.folder()) == expected);

    // In two shards, the second first and on one thread.
    let shards = whole.store("shards");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| make(sweep, &shards, "2/2"));
    assert_eq!(sweep.counts(&shards, Shard::ALL)[2], sweep.items("1/2".parse().unwrap()).count());
    make(sweep, &shards, "1/2");
    Index::of(sweep, &shards).write().unwrap();
    assert!(files(shards.folder()) == expected);
}

/// Cut off again and again, with what a killed maker leaves behind.
#[test]
fn a_store_that_was_cut_off_is_completed() {
    let whole = Whole::made();
    let (sweep, cut) = (&whole.sweep, whole.store("cut"));
    let mut n_cut = 0;
    for n in [1, 2, 3, 5, 8, 13, 21, 34] {
        let progress = CancelAt { left: AtomicUsize::new(n), cancel: Cancel::new() };
        let outcome = sweep.make(&cut.begin().unwrap(), Shard::ALL, None, &progress, &progress.cancel);
        n_cut += usize::from(matches!(outcome, Err(SweepError::Cancelled(_))));
        fs::create_dir_all(cut.folder().join(format!(".tmp-{n}/{}", sweep.id(0)))).unwrap();
        fs::write(cut.folder().join(format!(".tmp-{n}/{}/picture.png", sweep.id(0))), "half").unwrap();
    }
    assert!(n_cut >= 4, "{n_cut}");
    make(sweep, &cut, "1/1");
    Index::of(sweep, &cut).write().unwrap();
    assert!(files(cut.folder()) == files(whole.store.folder()));
}

/// What is in an item is what the camera gives by itself: this one shares its irradiance with another.
#[test]
fn an_item_is_what_its_camera_gives() {
    let whole = Whole::made();
    let item = whole.store.item(whole.sweep.id(3));
    let names: Vec<PathBuf> = files(&item).into_keys().collect();
    let all = ["camera.ron", "picture.png", "raw.png", "report.json", "thumbnail.png"];
    assert_eq!(names, all.map(PathBuf::from));
    let kept = KeptCamera::new(Camera::read(&item.join("camera.ron")).unwrap());
    let capture = kept.capture(&Silent, &Cancel::new()).unwrap();
    assert!(fs::read(item.join("picture.png")).unwrap() == picture_png(&capture.developed.picture).unwrap());
    let run = Run { capture: &capture, model: &kept.model(&Silent, &Cancel::new()).unwrap(), depth: None };
    let report = RunReport::new(&run, vec!["picture.png".to_owned(), "raw.png".to_owned()]).unwrap();
    assert_eq!(fs::read(item.join("report.json")).unwrap(), serde_json::to_vec_pretty(&report).unwrap());
}

#[test]
fn the_index_has_values_metrics_and_reasons() {
    let whole = Whole::made();
    // A camera that cannot be is there with the reason.
    let rows = rows(&whole.sweep, &whole.store);
    let refused = &rows[2];
    assert_eq!((refused.status, refused.values[1].as_f64()), (Status::Refused, Some(0.1)));
    let reason = refused.reason.as_ref().unwrap();
    assert!(reason.contains("opens to f/2.028") && !reason.contains('\n'), "{reason}");
    let names: Vec<PathBuf> = files(&whole.store.item(refused.id)).into_keys().collect();
    assert_eq!(names, ["camera.ron", "refused.json"].map(PathBuf::from));

    // Ten times the light makes ten times the electrons.
    let mean_e = |row: usize| rows[row].metrics.iter().find(|(name, _)| name.starts_with("mean_e")).unwrap().1;
    // A sum of rounded products of the same rates.
    assert!((mean_e(3) / mean_e(0) - 10.0).abs() < 1e-9);
    let index = |name: &str| fs::read_to_string(whole.store.folder().join(name)).unwrap();
    let lines: Vec<serde_json::Value> =
        index("index.jsonl").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((lines.len(), &lines[3]["values"]["stop.FNumber"]), (9, &serde_json::json!(4)));
    assert_eq!(lines[3]["metrics"]["exposure_time_s"], serde_json::json!(0.01));
    assert!(lines[2]["reason"].is_string() && lines[2]["metrics"].is_null());
    assert_eq!(index("index.csv").lines().count(), 10);
}

#[test]
fn packs_are_the_same_to_the_byte() {
    let whole = Whole::made();
    let pack = |name: &str| whole.sweep.pack(&whole.store, &whole.folder.path().join(name), Some(4)).unwrap();
    let (one, other) = (pack("one.tar"), pack("other.tar"));
    assert_eq!((one.len(), one[1].file_name().unwrap().to_str()), (2, Some("one-000001.tar")));
    let mut names = Vec::new();
    for (one, other) in one.iter().zip(&other) {
        assert!(fs::read(one).unwrap() == fs::read(other).unwrap());
        let mut archive = tar::Archive::new(fs::File::open(one).unwrap());
        for entry in archive.entries().unwrap() {
            let entry = entry.unwrap();
            assert_eq!((entry.header().mtime().unwrap(), entry.header().uid().unwrap()), (0, 0));
            names.push(entry.path().unwrap().to_string_lossy().into_owned());
        }
    }
    // Each item once.
    assert_eq!(names.len(), 6 * 5);
    assert!(names.is_sorted() && names[0].ends_with(".camera.ron") && names[4].ends_with(".values.json"), "{names:?}");
}

#[test]
fn wrong_lines_of_a_camera_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.ron");
    for (text, words) in [
        (PLAN.replace("focus: DistanceMm(2000.0)", "focus: DistanceMm(-2.0)"), "plan.ron:3: DistanceMm is -2"),
        (PLAN.replace("film:", "filmed:"), "plan.ron:4:"),
    ] {
        fs::write(&path, text).unwrap();
        let message = Sweep::read(&path).unwrap_err().to_string();
        assert!(message.contains(words) && !message.contains('\n'), "{message}");
    }
}

#[test]
fn growing_plans_keep_their_items() {
    let folder = tempfile::tempdir().unwrap();
    let random = |count: usize| {
        let way = format!(r#"Random(count: {count}, seed: 7, axes: {{"seed": Whole(least: 1, most: 1000)}})"#);
        sweep(&format!("(base: Demo, vary: [{way}])"), folder.path())
    };
    let (few, many) = (random(3), random(5));
    assert!((0..3).all(|item| few.id(item) == many.id(item)));
}

#[test]
fn a_limit_leaves_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = sweep(&PLAN.replace("List([4, 8, 0.1])", "List([0.1, 0.2])"), folder.path());
    let store = Store::new(&folder.path().join("store"));
    let limited = || sweep.make(&store.begin().unwrap(), Shard::ALL, Some(4), &Silent, &Cancel::new()).unwrap();
    let (first, second) = (limited(), limited());
    assert_eq!((first.n_refused, first.n_left), (4, 2));
    assert_eq!((second.n_there, second.n_refused, second.n_left), (4, 2, 0));
    assert_eq!(sweep.counts(&store, Shard::ALL), [0, 6, 0]);
}

#[test]
fn a_refused_item_has_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    // A color that DNG has no number for: raw.png is there by the time that is found.
    let sensor = dioptric_pipeline::SensorSpec::named("nikon-d5100").open().unwrap().to_ron();
    fs::write(folder.path().join("sensor.ron"), sensor.replace("\"G\"", "\"Q\"")).unwrap();
    let plan = PLAN
        .replace("BuiltIn(\"nikon-d5100\")", "File(\"sensor.ron\")")
        .replace("raw: true", "raw: true, also: [RawDng]");
    let sweep = sweep(&plan.replace("List([4, 8, 0.1])", "List([4])"), folder.path());
    let store = Store::new(&folder.path().join("store"));
    sweep.make(&store.begin().unwrap(), Shard::ALL, Some(1), &Silent, &Cancel::new()).unwrap();
    let row = rows(&sweep, &store).into_iter().find(|row| row.status != Status::Missing).unwrap();
    assert!(row.reason.unwrap().contains("DNG"));
    let names: Vec<PathBuf> = files(&store.item(row.id)).into_keys().collect();
    assert_eq!(names, ["camera.ron", "refused.json"].map(PathBuf::from));
}

#[test]
fn changed_files_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = dioptric_pipeline::SensorSpec::named("imx363").open().unwrap().to_ron();
    fs::write(folder.path().join("sensor.ron"), &sensor).unwrap();
    let vary = r#"vary: [Grid({"sensor.File": List(["sensor.ron"]), "#;
    let sweep = sweep(&PLAN.replace("vary: [Grid({", vary), folder.path());
    let store = Store::new(&folder.path().join("store"));
    fs::write(folder.path().join("sensor.ron"), sensor + " ").unwrap();
    let error = sweep.make(&store.begin().unwrap(), Shard::ALL, None, &Silent, &Cancel::new()).unwrap_err();
    assert!(error.to_string().contains("sensor.ron changed"), "{error}");
    assert_eq!(sweep.counts(&store, Shard::ALL), [0, 0, 9]);
}

#[test]
fn unreadable_files_fail_their_items_alone() {
    let folder = tempfile::tempdir().unwrap();
    // Named as a picture, and none: no camera is to blame.
    fs::write(folder.path().join("cut.exr"), [0x76, 0x2f, 0x31, 0x01]).unwrap();
    let source = r#"(source: File("cut.exr"), field_of_view_deg: 14.0, depth_m: 2.0)"#;
    let vary =
        "Grid({\"exposure.Manual.time_s\": List([0.001])}), List(keys: [\"stop.FNumber\", \"scene\"], points: [[4, ";
    let flat = "(source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0)";
    let plan = PLAN.split("vary:").next().unwrap().to_owned() + &format!("vary: [{vary}{source}], [8, {flat}]])])");
    let sweep = sweep(&plan, folder.path());
    let store = Store::new(&folder.path().join("store"));
    for n_there in [0, 1] {
        let made = sweep.make(&store.begin().unwrap(), Shard::ALL, None, &Silent, &Cancel::new()).unwrap();
        assert_eq!((made.n_there, made.n_done, made.n_failed), (n_there, 1 - n_there, 1));
        assert!(made.first_failure.unwrap().contains("cut.exr"));
    }
    assert_eq!((store.status(sweep.id(0)), store.status(sweep.id(1))), (Status::Missing, Status::Done));
    assert_eq!(files(store.folder()).len(), 4, "the item that is there, and nothing of the other");
}

#[test]
fn items_are_made_by_number_and_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.ron");
    let planned = sweep(PLAN, folder.path());
    let (whole, parts) = (Store::new(&folder.path().join("whole")), Store::new(&folder.path().join("parts")));
    make(&planned, &whole, "1/1");
    let groups = planned.groups(Shard::ALL);
    assert_eq!((groups.len(), groups.iter().map(Vec::len).sum::<usize>()), (3, 9));
    let mut maker = Maker::of(Plan::parse(PLAN, &path).unwrap(), &path, None).unwrap();
    let mut outcomes = Vec::new();
    for item in groups.into_iter().rev().flatten().chain([0]) {
        let place = parts.begin().unwrap();
        outcomes.extend(maker.make(&place, &[(item, planned.id(item))], &Silent, &Cancel::new()).unwrap());
    }
    let count = |outcome: Outcome| outcomes.iter().filter(|own| **own == outcome).count();
    assert_eq!([Outcome::Done, Outcome::Refused, Outcome::There].map(count), [6, 3, 1]);
    assert!(files(parts.folder()) == files(whole.folder()));
    // Under the name of another item nothing is made.
    let empty = Store::new(&folder.path().join("empty"));
    let place = empty.begin().unwrap();
    for (item, words) in [(0, "item 0 is called"), (9, "it has no item 9, but 9 items")] {
        let error = maker.make(&place, &[(item, planned.id(1))], &Silent, &Cancel::new()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}
