//! `dioptric sweep`: many pictures of a varied camera, kept in a store.

use std::{
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use anyhow::{Context, bail};
use clap::{Args, Subcommand};
use dioptric_pipeline::{Progress, Stage};
use dioptric_spectrum::Cancel;
use dioptric_sweep::{Index, Made, PLAN_SCHEMA, PLAN_TEMPLATE, Shard, Store, Sweep, SweepProgress};
use serde_json::json;

use crate::{
    camera::write_new,
    common::Common,
    paintings::painting_folder,
    terminal::{Bar, print, print_json, remark},
};

/// A sweep to make or to look at.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct SweepArgs {
    #[command(subcommand)]
    command: Option<SweepCommand>,
    /// The plan file
    plan: Option<PathBuf>,
    /// Folder that keeps the results [default: that of the plan's name, ending in .store]
    #[arg(long, value_name = "DIR")]
    store: Option<PathBuf>,
    /// Makes the i-th of n parts, 1/n to n/n; items that share an irradiance are in one part
    #[arg(long, value_name = "I/N")]
    shard: Option<String>,
    /// Makes so many items at most
    #[arg(long, value_name = "N")]
    limit: Option<usize>,
    /// Counts the items and the irradiances that they share, and makes none
    #[arg(long)]
    dry_run: bool,
    /// Prints the JSON schema of plan files
    #[arg(long, conflicts_with_all = ["plan", "init"])]
    schema: bool,
    /// Writes a plan to begin with, its choices in comments
    #[arg(long, conflicts_with = "plan")]
    init: bool,
    /// File to write the plan to [default: standard output]
    #[arg(long, short, value_name = "F.ron", requires = "init")]
    output: Option<PathBuf>,
}

/// Something to do with a store.
#[derive(Debug, Subcommand)]
enum SweepCommand {
    /// Writes index.jsonl, index.csv and the contact sheet index.html anew from the store
    Index {
        /// The plan file
        plan: PathBuf,
        /// Folder that keeps the results [default: that of the plan's name, ending in .store]
        #[arg(long, value_name = "DIR")]
        store: Option<PathBuf>,
    },
    /// Removes the items that no plan given asks for: of plans as they were before
    Prune {
        /// The plan files that share the store
        #[arg(required = true)]
        plans: Vec<PathBuf>,
        /// Folder that keeps the results [default: that of the first plan's name, ending in .store]
        #[arg(long, value_name = "DIR")]
        store: Option<PathBuf>,
        /// Counts the items, and removes none
        #[arg(long)]
        dry_run: bool,
    },
    /// Packs the finished items into archives
    Pack {
        /// The plan file
        plan: PathBuf,
        /// Folder that keeps the results [default: that of the plan's name, ending in .store]
        #[arg(long, value_name = "DIR")]
        store: Option<PathBuf>,
        /// Archive to write, as `WebDataset` reads it
        #[arg(long, value_name = "OUT.tar")]
        webdataset: PathBuf,
        /// Writes archives OUT-000000.tar and so on of so many items each
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
        items_per_tar: Option<u32>,
    },
}

pub(crate) fn run(arguments: &SweepArgs, common: &Common) -> anyhow::Result<()> {
    if common.seed.is_some() {
        bail!("--seed has no use here: the camera of the plan states it, or an axis 'seed'");
    }
    match &arguments.command {
        Some(SweepCommand::Index { plan, store }) => index(plan, store.as_deref(), common),
        Some(SweepCommand::Prune { plans, store, dry_run }) => prune(plans, store.as_deref(), *dry_run, common),
        Some(SweepCommand::Pack { plan, store, webdataset, items_per_tar }) => {
            let (sweep, store) = open(plan, store.as_deref())?;
            let archives = sweep.pack(&store, webdataset, items_per_tar.map(|n| n as usize))?;
            if common.json {
                return print_json(&json!({ "archives": archives }));
            }
            archives.iter().try_for_each(|archive| print(&format!("{}\n", archive.display())))
        }
        None if arguments.schema => print(PLAN_SCHEMA),
        None if arguments.init => write_new(arguments.output.as_deref(), PLAN_TEMPLATE, common),
        None => {
            let plan = arguments.plan.as_deref();
            make(
                plan.context("expected a plan, as `dioptric sweep plan.ron`; --init writes one to begin with")?,
                arguments,
                common,
            )
        }
    }
}

fn open(plan: &Path, store: Option<&Path>) -> anyhow::Result<(Sweep, Store)> {
    let folder = store.map_or_else(|| plan.with_extension("store"), Path::to_owned);
    Ok((Sweep::read(plan)?.with_paintings(painting_folder()), Store::new(&folder)))
}

fn make(plan: &Path, arguments: &SweepArgs, common: &Common) -> anyhow::Result<()> {
    let shard = arguments.shard.as_deref().map_or(Ok(Shard::ALL), str::parse)?;
    let (sweep, store) = open(plan, arguments.store.as_deref())?;
    if arguments.dry_run {
        return count(&sweep, &store, shard, common);
    }
    let place = store.begin()?;
    let bar = ItemBar { bar: Bar::new(common.quiet), items: Mutex::new((0, sweep.len())) };
    let made = sweep.make(&place, shard, arguments.limit, &bar, &Cancel::new())?;
    drop((place, bar));
    // Other shards are not done yet, and each of them would read the whole store.
    let has_index = !shard.is_part();
    if has_index {
        Index::of(&sweep, &store).write()?;
    }
    let others = if shard.is_part() { Vec::new() } else { store.others([&sweep])? };
    if common.json {
        print_json(&json!({
            "there": made.n_there, "done": made.n_done, "refused": made.n_refused, "failed": made.n_failed,
            "left": made.n_left, "others": others.len(), "store": store.folder(),
        }))?;
    } else if !common.quiet {
        tell_made(&made, plan, &store, has_index)?;
        if !others.is_empty() {
            print(&format!(
                "{} more in the store are of no item of this plan as it is now; of no other plan either? \
                 dioptric sweep prune {}\n",
                others.len(),
                plan.display()
            ))?;
        }
    }
    match made.first_failure {
        Some(reason) => bail!(
            "{} items were not made, the first since {reason}; they are tried again when the sweep is started again",
            made.n_failed
        ),
        None => Ok(()),
    }
}

fn tell_made(made: &Made, plan: &Path, store: &Store, has_index: bool) -> anyhow::Result<()> {
    let last = match has_index {
        true => store.folder().join("index.html").display().to_string(),
        false => format!("when all shards are done: dioptric sweep index {}", plan.display()),
    };
    print(&format!(
        "{} items were there, {} were made, {} refused, {} are left\n{last}\n",
        made.n_there, made.n_done, made.n_refused, made.n_left
    ))
}

fn count(sweep: &Sweep, store: &Store, shard: Shard, common: &Common) -> anyhow::Result<()> {
    let (n_items, n_irradiances) = (sweep.items(shard).count(), sweep.n_irradiances(shard));
    let [done, refused, missing] = sweep.counts(store, shard);
    if common.json {
        return print_json(&json!({
            "items": n_items, "irradiances": n_irradiances, "done": done, "refused": refused, "missing": missing,
        }));
    }
    print(&format!(
        "{n_items} items of {n_irradiances} irradiances: {done} are done, {refused} refused, {missing} missing\n"
    ))
}

fn prune(plans: &[PathBuf], store: Option<&Path>, dry_run: bool, common: &Common) -> anyhow::Result<()> {
    let folder = store.map_or_else(|| plans[0].with_extension("store"), Path::to_owned);
    if !folder.is_dir() {
        bail!("{} is no folder, expected the store of {}", folder.display(), plans[0].display());
    }
    let store = Store::new(&folder);
    let sweeps = plans.iter().map(|plan| Sweep::read(plan)).collect::<Result<Vec<_>, _>>()?;
    let others = store.others(&sweeps)?;
    if dry_run {
        return match common.json {
            true => print_json(&json!({ "others": others.len(), "removed": 0 })),
            false => print(&format!("{} items are of none of the plans\n", others.len())),
        };
    }
    let pruned = store.prune(&others)?;
    if common.json {
        return print_json(&json!({ "others": others.len(), "removed": pruned.n_items, "bytes": pruned.bytes }));
    }
    print(&format!("removed {} items, {:.1} MB\n", pruned.n_items, pruned.bytes as f64 / 1e6))
}

fn index(plan: &Path, store: Option<&Path>, common: &Common) -> anyhow::Result<()> {
    let (sweep, store) = open(plan, store)?;
    if !store.folder().is_dir() {
        bail!("{} is no folder, expected the store of {}", store.folder().display(), plan.display());
    }
    // Of shards that were killed.
    store.remove_leftovers();
    Index::of(&sweep, &store).write()?;
    if common.json {
        return count(&sweep, &store, Shard::ALL, common);
    }
    remark(common.quiet, &format!("wrote index.jsonl, index.csv and index.html into {}", store.folder().display()));
    Ok(())
}

/// Shows which item is made, and which stage of it.
struct ItemBar {
    bar: Bar,
    /// How many items are there, of how many.
    items: Mutex<(usize, usize)>,
}

impl ItemBar {
    fn show(&self, what: &str) {
        let (n_made, n_all) = *self.items.lock().unwrap_or_else(PoisonError::into_inner);
        self.bar.show(format!("{}/{n_all} {what}", n_made + 1), n_made as f64 / n_all as f64);
    }
}

impl Progress for ItemBar {
    fn at(&self, stage: Stage, _: f64) {
        self.show(stage.title());
    }
}

impl SweepProgress for ItemBar {
    fn items(&self, n_made: usize, n_all: usize) {
        *self.items.lock().unwrap_or_else(PoisonError::into_inner) = (n_made, n_all);
        self.show("");
    }
}
