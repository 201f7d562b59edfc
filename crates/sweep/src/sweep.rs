//! A plan with all its items: their cameras, their names, and the order in which they are made.

use std::{
    collections::{HashMap, HashSet},
    path::Path,
    str::FromStr,
};

use dioptric_pipeline::{Camera, PaintingFolder};
use rayon::prelude::*;

use crate::{ItemId, Plan, SweepError, Value, cameras::Cameras, key::ItemKey};

/// A plan with all its items.
#[derive(Debug)]
pub struct Sweep {
    cameras: Cameras,
    keys: Vec<Key>,
    /// The items as they are made: those that share results follow one another.
    order: Vec<usize>,
    paintings: Option<PaintingFolder>,
}

/// What is kept of each item, for there may be millions: its name, and that of its irradiance.
#[derive(Clone, Copy, Debug)]
struct Key {
    id: ItemId,
    imaging: u64,
}

/// A share of the items: those of every n-th irradiance, by its hash.
///
/// It depends on nothing but the item, so shards of a plan never overlap and do not move when the plan grows; items that share
/// an irradiance are in the same shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    of: u64,
}

impl Shard {
    /// All items.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// Whether it is less than all items.
    pub fn is_part(self) -> bool {
        self.of > 1
    }

    fn has(self, key: &Key) -> bool {
        key.imaging % self.of == self.index
    }
}

impl FromStr for Shard {
    type Err = SweepError;

    /// Reads `I/N`, I from 1 to N.
    fn from_str(text: &str) -> Result<Self, SweepError> {
        let parts = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index: index - 1, of }),
            _ => Err(SweepError::Shard { found: text.to_owned() }),
        }
    }
}

impl Sweep {
    /// Reads a plan and draws up its items; files that cameras are made from are read once, and hashed.
    ///
    /// # Errors
    /// Names the line or the key of the plan that is wrong and what was expected, or the file that cannot be read. A camera
    /// whose numbers make no sense is none: that is the result of its item.
    pub fn read(path: &Path) -> Result<Self, SweepError> {
        Self::of(Plan::read(path)?, path)
    }

    /// Draws up the items of a plan; `path` names it in errors, and its paths are relative to that one's folder.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn of(plan: Plan, path: &Path) -> Result<Self, SweepError> {
        let cameras = Cameras::of(plan, path)?;
        // What is wrong with the first item is found before all others are drawn up.
        cameras.camera(0)?;
        let key = |item| cameras.key(&cameras.camera(item)?);
        let keys: Vec<ItemKey> = (0..cameras.plan().count()).into_par_iter().map(key).collect::<Result<_, _>>()?;
        let order = in_order(&keys);
        let keys = keys.into_iter().map(|ItemKey { id, imaging, .. }| Key { id, imaging }).collect();
        Ok(Self { order, cameras, keys, paintings: None })
    }

    /// Returns the sweep whose items take paintings of the still life from a folder, and keep them there.
    #[must_use]
    pub fn with_paintings(mut self, folder: Option<PaintingFolder>) -> Self {
        self.paintings = folder;
        self
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        self.cameras.plan()
    }

    /// The plan's file.
    pub fn path(&self) -> &Path {
        self.cameras.path()
    }

    /// The number of items.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there are no items, which no plan allows.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// The number of different irradiances: how often a scene is imaged.
    pub fn n_irradiances(&self, shard: Shard) -> usize {
        self.keys.iter().filter(|key| shard.has(key)).map(|key| key.imaging).collect::<HashSet<_>>().len()
    }

    /// The name of an item, counted from 0 in the order of the plan.
    ///
    /// # Panics
    /// When there is no such item.
    pub fn id(&self, item: usize) -> ItemId {
        self.keys[item].id
    }

    /// The items of a shard as they are made: those that share results follow one another.
    pub fn items(&self, shard: Shard) -> impl Iterator<Item = usize> {
        self.order.iter().copied().filter(move |item| shard.has(&self.keys[*item]))
    }

    /// The items of a shard that share an irradiance, as they are made: none shares one with those of another group.
    pub fn groups(&self, shard: Shard) -> Vec<Vec<usize>> {
        let mut places = HashMap::new();
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for item in self.items(shard) {
            let place = *places.entry(self.keys[item].imaging).or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
            }
            groups[place].push(item);
        }
        groups
    }

    /// Returns what an item sets, in the order of [`Plan::keys`].
    pub fn values(&self, item: usize) -> Vec<Value> {
        self.cameras.values(item)
    }

    /// Returns the camera of an item, its paths absolute and its outputs those of the plan.
    ///
    /// # Errors
    /// When a key is unknown, or its value is of the wrong kind.
    pub fn camera(&self, item: usize) -> Result<Camera, SweepError> {
        self.cameras.camera(item)
    }

    pub(crate) fn cameras(&self) -> &Cameras {
        &self.cameras
    }

    pub(crate) fn paintings(&self) -> Option<&PaintingFolder> {
        self.paintings.as_ref()
    }
}

/// Returns the items so that those that share the results of stages follow one another, and else in the order of the plan.
fn in_order(keys: &[ItemKey]) -> Vec<usize> {
    // Each setting of a stage counts by the item that has it first.
    let mut ranks = vec![[0_u32; 7]; keys.len()];
    for stage in 0..7 {
        let mut first = HashMap::new();
        for (item, (rank, key)) in ranks.iter_mut().zip(keys).enumerate() {
            rank[stage] = *first.entry(key.stages[stage]).or_insert(item as u32);
        }
    }
    let mut order: Vec<usize> = (0..keys.len()).collect();
    order.sort_unstable_by_key(|item| (ranks[*item], *item));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(vary: &str) -> Result<Sweep, SweepError> {
        let path = Path::new("p.ron");
        Sweep::of(Plan::parse(&format!("(base: Demo, vary: [{vary}])"), path)?, path)
    }

    #[test]
    fn items_are_the_cameras_of_the_plan() {
        let sweep = sweep(
            r#"Grid({"exposure.Manual.time_s": List([0.1, 0.2])}), List(keys: ["stop.FNumber", "seed"], points: [[4, 1], [8, 2], [4, 1]])"#,
        )
        .unwrap();
        assert_eq!((sweep.len(), sweep.n_irradiances(Shard::ALL)), (6, 2));
        assert_eq!(sweep.values(4), [Value::Number(0.2), Value::Whole(8), Value::Whole(2)]);
        let camera = sweep.camera(4).unwrap();
        assert!(camera.to_ron().contains("FNumber(8.0)") && camera.to_ron().contains("time_s: 0.2"));
        assert!(camera.seed == 2 && !camera.outputs.raw);
        // Point 1 and 3 of the list are the same.
        assert_eq!(sweep.id(0), sweep.id(2));
        // The four items of one stop come before the two of the other.
        assert_eq!(sweep.items(Shard::ALL).collect::<Vec<_>>(), [0, 2, 3, 5, 1, 4]);
        assert_eq!(sweep.groups(Shard::ALL), [vec![0, 2, 3, 5], vec![1, 4]]);
    }

    #[test]
    fn shards_part_the_items_by_irradiance() {
        let sweep =
            sweep(r#"Grid({"stop.FNumber": Linear(first: 4, last: 8, count: 9), "seed": List([1, 2])})"#).unwrap();
        let shards = ["1/3", "2/3", "3/3"].map(|text| text.parse::<Shard>().unwrap());
        let mut all: Vec<usize> = shards.iter().flat_map(|shard| sweep.items(*shard)).collect();
        all.sort_unstable();
        assert_eq!(all, (0..18).collect::<Vec<_>>());
        assert_eq!(shards.iter().map(|shard| sweep.n_irradiances(*shard)).sum::<usize>(), 9);
        for text in ["0/3", "4/3", "1", "a/b", "1/0"] {
            assert!(text.parse::<Shard>().unwrap_err().to_string().contains("expected I/N"), "{text}");
        }
    }

    #[test]
    fn keys_that_no_camera_has_are_named() {
        for (vary, words) in [
            (
                r#"Grid({"seed": List([1]), "fokus.DistanceMm": List([1])})"#,
                "p.ron: 'fokus.DistanceMm': unknown field `fokus`",
            ),
            (r#"Grid({"seed": List([1.5])})"#, "p.ron: 'seed': invalid type: floating point `1.5`"),
            (r#"Grid({"seed": List([1, "x"])})"#, "p.ron: 'seed': invalid type: string"),
            (r#"Grid({"exposure.time_s": List([1])})"#, "p.ron: 'exposure.time_s': exposure is Auto(…)"),
            (
                r#"Grid({"seed": List([1]), "exposure.Manual.analog_gain": List([2])})"#,
                "'exposure.Manual.analog_gain': missing field `time_s`",
            ),
            (r#"Grid({"lens.File": List(["none.zmx"])})"#, "none.zmx"),
        ] {
            let message = sweep(vary).unwrap_err().to_string();
            assert!(message.contains(words) && !message.contains('\n'), "{message}");
        }
    }
}
