//! Plans, their items, and the stores that keep them.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use dioptric_sweep::{
    Index, IndexLines, ItemId, Made, Outcome, Plan as SweepPlan, Shard, Store, Sweep as PlannedItems, SweepError,
};
use ndarray::Array1;
use pyo3::{
    exceptions::PyIndexError,
    prelude::*,
    types::{PyDict, PyType},
};

use crate::{
    camera::Camera,
    errors::{guarded, sweep_exception, wrong},
    paintings::painting_folder,
    serial::to_python,
    view::view,
    worker::{Follower, run_sweep},
};

/// A plan of many pictures: a camera, what is varied of it, and what is written of each picture, as a plan file states it.
#[pyclass(frozen, module = "dioptric.sweep")]
pub(crate) struct Plan {
    plan: SweepPlan,
    text: String,
    path: PathBuf,
}

impl Plan {
    fn of(text: String, path: PathBuf) -> PyResult<Self> {
        guarded(|| {
            let plan = SweepPlan::parse(&text, &path).map_err(sweep_exception)?;
            Ok(Self { plan, text, path })
        })
    }
}

#[pymethods]
impl Plan {
    /// Reads a plan file; paths in it are relative to its folder.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        let unreadable = |error: std::io::Error| SweepError::Read { path: path.clone(), reason: error.to_string() };
        let text = dioptric_files::text::read(&path).map_err(unreadable).map_err(sweep_exception)?;
        Self::of(text, path)
    }

    /// Returns the plan of a text.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     The content of a plan file.
    /// path : str or os.PathLike
    ///     What to call it in errors; paths in it are relative to the folder of this.
    #[staticmethod]
    #[pyo3(signature = (text, path=None))]
    fn from_ron(text: String, path: Option<PathBuf>) -> PyResult<Self> {
        Self::of(text, path.unwrap_or_else(|| "plan.ron".into()))
    }

    /// The file that it was read from, or what it is called in errors.
    #[getter]
    fn path(&self) -> &Path {
        &self.path
    }

    /// Where `Sweep.run` and ``dioptric sweep`` keep its results unless told otherwise: its path, ending in ``.store``.
    #[getter]
    fn store(&self) -> PathBuf {
        self.path.with_extension("store")
    }

    /// The keys that are varied, in the order of the plan.
    #[getter]
    fn keys(&self) -> Vec<&str> {
        self.plan.keys()
    }

    /// Returns the text of the plan.
    fn to_ron(&self) -> &str {
        &self.text
    }

    /// The number of items.
    fn __len__(&self) -> usize {
        self.plan.count()
    }

    fn __repr__(&self) -> String {
        format!("<Plan {}: {} items>", self.path.display(), self.plan.count())
    }

    /// Copies by its text and an absolute path, so that plans can be sent to other processes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String, PathBuf))> {
        let path = std::path::absolute(&self.path)?;
        Ok((PyType::new::<Self>(py).getattr("from_ron")?, (self.text.clone(), path)))
    }
}

/// A plan with all its items: their cameras, their names, and the order in which they share the most work. Items count from 0 in
/// the order of the plan.
///
/// Parameters
/// ----------
/// plan : Plan
///     Files that its cameras are made from are read once, and hashed.
#[pyclass(frozen, module = "dioptric.sweep")]
pub(crate) struct Sweep {
    plan: Py<Plan>,
    items: PlannedItems,
}

impl Sweep {
    fn check(&self, item: usize) -> PyResult<usize> {
        match item < self.items.len() {
            true => Ok(item),
            false => {
                Err(PyIndexError::new_err(format!("item is {item}, expected one of the {} from 0", self.items.len())))
            }
        }
    }

    fn store(&self, py: Python<'_>, store: Option<PathBuf>) -> Store {
        Store::new(&store.unwrap_or_else(|| self.plan.bind(py).get().store()))
    }
}

fn shard_of(shard: Option<&str>) -> PyResult<Shard> {
    shard.map_or(Ok(Shard::ALL), str::parse).map_err(sweep_exception)
}

#[pymethods]
impl Sweep {
    #[new]
    fn new(py: Python<'_>, plan: Py<Plan>) -> PyResult<Self> {
        let own = plan.bind(py).get();
        let items = run_sweep(py, &Follower::nobody(), |_, _| PlannedItems::of(own.plan.clone(), &own.path))?;
        Ok(Self { items: items.with_paintings(painting_folder(py)), plan })
    }

    /// The plan.
    #[getter]
    fn plan(&self, py: Python<'_>) -> Py<Plan> {
        self.plan.clone_ref(py)
    }

    /// How often a scene is imaged: the number of different irradiances.
    #[getter]
    fn n_irradiances(&self) -> usize {
        self.items.n_irradiances(Shard::ALL)
    }

    /// The number of items.
    fn __len__(&self) -> usize {
        self.items.len()
    }

    /// Returns the name of an item: a hash of all that its results depend on.
    fn id(&self, item: usize) -> PyResult<String> {
        Ok(self.items.id(self.check(item)?).to_string())
    }

    /// Returns what an item sets, by the keys of the plan.
    fn values<'py>(&self, py: Python<'py>, item: usize) -> PyResult<Bound<'py, PyDict>> {
        let values = self.items.values(self.check(item)?);
        let dict = PyDict::new(py);
        for (key, value) in self.items.plan().keys().into_iter().zip(values) {
            dict.set_item(key, to_python(py, &value)?)?;
        }
        Ok(dict)
    }

    /// Returns the camera of an item, its paths absolute and its outputs those of the plan.
    fn camera(&self, py: Python<'_>, item: usize) -> PyResult<Camera> {
        let item = self.check(item)?;
        guarded(|| Ok(Camera::of_file(py, self.items.camera(item).map_err(sweep_exception)?)))
    }

    /// Returns the items in groups that share an irradiance, as they are made.
    ///
    /// Parameters
    /// ----------
    /// store : str or os.PathLike, optional
    ///     Leaves out what is there, and of items with one name all but the first.
    /// shard : str, optional
    ///     As of `run`.
    ///
    /// Returns
    /// -------
    /// list of list of int
    #[pyo3(signature = (store=None, *, shard=None))]
    fn groups(&self, py: Python<'_>, store: Option<PathBuf>, shard: Option<&str>) -> PyResult<Vec<Vec<usize>>> {
        let (shard, items) = (shard_of(shard)?, &self.items);
        run_sweep(py, &Follower::nobody(), move |_, _| {
            let mut groups = items.groups(shard);
            if let Some(store) = store.map(|folder| Store::new(&folder)) {
                let mut known = std::collections::HashSet::new();
                for group in &mut groups {
                    group.retain(|item| known.insert(items.id(*item)) && !store.has(items.id(*item)));
                }
                groups.retain(|group| !group.is_empty());
            }
            Ok(groups)
        })
    }

    /// Makes the items that are not there, as ``dioptric sweep`` does. Other Python threads run meanwhile; Ctrl-C ends it, and what is
    /// finished stays.
    ///
    /// Parameters
    /// ----------
    /// store : str or os.PathLike, optional
    ///     Folder that keeps the results. Default: ``plan.store``.
    /// shard : str, optional
    ///     ``"I/N"``: the I-th of N parts; items that share an irradiance are in one part. A part writes no index.
    /// limit : int, optional
    ///     Makes so many items at most.
    /// progress : bool or callable
    ///     As of `Camera.render`, of all items.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Numbers of items: ``there``, ``done``, ``refused``, ``failed``, ``left``; and ``first_failure``, why the first of those
    ///     that failed could not be made (a file that cannot be read), or None. They are tried again by the next run.
    #[pyo3(signature = (store=None, *, shard=None, limit=None, progress=None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        store: Option<PathBuf>,
        shard: Option<&str>,
        limit: Option<usize>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (store, shard, items) = (self.store(py, store), shard_of(shard)?, &self.items);
        let made = run_sweep(py, &Follower::of(progress)?, |latest, cancel| {
            let made = items.make(&store.begin()?, shard, limit, latest, cancel)?;
            if !shard.is_part() {
                Index::of(items, &store).write()?;
            }
            Ok(made)
        })?;
        counts_of(py, &made)
    }

    /// Writes ``index.jsonl``, ``index.csv`` and the contact sheet ``index.html`` anew from what the store holds, and removes what killed
    /// processes left in it.
    #[pyo3(signature = (store=None))]
    fn write_index(&self, py: Python<'_>, store: Option<PathBuf>) -> PyResult<()> {
        let (store, items) = (self.store(py, store), &self.items);
        if !store.folder().is_dir() {
            let reason = "it is no folder, expected the store of the plan".to_owned();
            return Err(sweep_exception(SweepError::Read { path: store.folder().to_owned(), reason }));
        }
        run_sweep(py, &Follower::nobody(), |_, _| {
            store.remove_leftovers();
            Index::of(items, &store).write()
        })
    }

    /// Counts the items by what came of them: ``done``, ``refused``, ``missing``.
    #[pyo3(signature = (store=None, *, shard=None))]
    fn counts<'py>(
        &self,
        py: Python<'py>,
        store: Option<PathBuf>,
        shard: Option<&str>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (store, shard, items) = (self.store(py, store), shard_of(shard)?, &self.items);
        let counts = run_sweep(py, &Follower::nobody(), |_, _| Ok(items.counts(&store, shard)))?;
        let dict = PyDict::new(py);
        for (key, count) in ["done", "refused", "missing"].into_iter().zip(counts) {
            dict.set_item(key, count)?;
        }
        Ok(dict)
    }

    /// Packs the finished items into tar archives as WebDataset reads them; returns their paths.
    ///
    /// Parameters
    /// ----------
    /// target : str or os.PathLike
    ///     The archive, or what those of ``items_per_tar`` are named after.
    /// store : str or os.PathLike, optional
    /// items_per_tar : int, optional
    ///     So many items an archive, the last one fewer; the archives are then ``NAME-000000.tar`` and so on. Default: all in one.
    #[pyo3(signature = (target, *, store=None, items_per_tar=None))]
    fn pack(
        &self,
        py: Python<'_>,
        target: PathBuf,
        store: Option<PathBuf>,
        items_per_tar: Option<usize>,
    ) -> PyResult<Vec<PathBuf>> {
        if items_per_tar == Some(0) {
            return Err(wrong("items_per_tar", 0, "1 or more"));
        }
        let (store, items) = (self.store(py, store), &self.items);
        run_sweep(py, &Follower::nobody(), |_, _| items.pack(&store, &target, items_per_tar))
    }

    fn __repr__(&self) -> String {
        let (path, n, n_irradiances) = (self.items.path().display(), self.items.len(), self.n_irradiances());
        format!("<Sweep {path}: {n} items of {n_irradiances} irradiances>")
    }
}

fn counts_of<'py>(py: Python<'py>, made: &Made) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (key, count) in [
        ("there", made.n_there),
        ("done", made.n_done),
        ("refused", made.n_refused),
        ("failed", made.n_failed),
        ("left", made.n_left),
    ] {
        dict.set_item(key, count)?;
    }
    dict.set_item("first_failure", &made.first_failure)?;
    Ok(dict)
}

/// Makes items of a plan that another process drew up: what a worker of a cluster does.
///
/// Items are known by number and name; one that has another name here, since its files or the version of dioptric differ, is a
/// ``ValueError``. Items that follow one another share the results of stages, from one call to the next as well.
///
/// Parameters
/// ----------
/// plan : Plan
/// store : str or os.PathLike
///     Folder that keeps the results.
#[pyclass(frozen, module = "dioptric.sweep")]
pub(crate) struct Maker {
    maker: Mutex<dioptric_sweep::Maker>,
    store: Store,
    has_begun: AtomicBool,
}

#[pymethods]
impl Maker {
    #[new]
    fn new(py: Python<'_>, plan: &Bound<'_, Plan>, store: PathBuf) -> PyResult<Self> {
        let (own, paintings) = (plan.get(), painting_folder(py));
        let maker = run_sweep(py, &Follower::nobody(), |_, _| {
            dioptric_sweep::Maker::of(own.plan.clone(), &own.path, paintings)
        })?;
        Ok(Self { maker: Mutex::new(maker), store: Store::new(&store), has_begun: AtomicBool::new(false) })
    }

    /// Makes those of some items that are not there, one after the other.
    ///
    /// Parameters
    /// ----------
    /// items : list of (int, str)
    ///     Number and name of each.
    ///
    /// Returns
    /// -------
    /// list of (str, str or None)
    ///     Of each ``"there"``, ``"done"``, ``"refused"``, or ``"failed"`` with the reason: a file that cannot be read.
    fn make(&self, py: Python<'_>, items: Vec<(usize, String)>) -> PyResult<Vec<(&'static str, Option<String>)>> {
        let named = |(item, id): (usize, String)| Ok((item, id.parse::<ItemId>()?));
        let items: Vec<_> = items.into_iter().map(named).collect::<Result<_, _>>().map_err(sweep_exception)?;
        run_sweep(py, &Follower::nobody(), |latest, cancel| {
            let mut maker = self.maker.lock().unwrap_or_else(PoisonError::into_inner);
            let has_begun = self.has_begun.swap(true, Ordering::Relaxed);
            let place = if has_begun { self.store.workplace() } else { self.store.begin() }?;
            Ok(maker.make(&place, &items, latest, cancel)?.into_iter().map(words).collect())
        })
    }
}

/// Looks through the ``index.jsonl`` of a store, so that its lines can be read one by one.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///
/// Returns
/// -------
/// starts : (lines + 1,) uint64 array
///     Where each line begins, bytes from the beginning of the file; and where the file ends.
/// done : (items,) uint64 array
///     The lines, from 0, of items that are done, each item once.
#[pyfunction]
pub(crate) fn read_index(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyAny>, Bound<'_, PyAny>)> {
    let IndexLines { starts, done } = run_sweep(py, &Follower::nobody(), |_, _| IndexLines::read(&path))?;
    let done: Array1<u64> = done.into_iter().map(|line| line as u64).collect();
    let of = |numbers| view(py, &Arc::new(numbers), |numbers: &Array1<u64>| numbers.view());
    Ok((of(starts.into())?, of(done)?))
}

fn words(outcome: Outcome) -> (&'static str, Option<String>) {
    match outcome {
        Outcome::There => ("there", None),
        Outcome::Done => ("done", None),
        Outcome::Refused => ("refused", None),
        Outcome::Failed(reason) => ("failed", Some(reason)),
    }
}
