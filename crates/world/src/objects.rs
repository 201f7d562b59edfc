//! What the things in a world are called, and which is part of which.

use std::collections::HashMap;

use crate::{InstanceId, ShapeId};

/// The objects of a world that is being made: names that differ, each perhaps a part of another.
#[derive(Clone, Debug, Default)]
pub(crate) struct Objects {
    known: Vec<Object>,
    by_name: HashMap<String, u32>,
    /// How often a name was asked for.
    asked: HashMap<String, u32>,
    /// Those that have begun and not ended.
    open: Vec<u32>,
    next: Option<String>,
}

#[derive(Clone, Debug)]
struct Object {
    name: String,
    parent: Option<u32>,
    is_gone: bool,
}

impl Objects {
    /// Adds an object and returns its number; a name that is taken gets a number behind it.
    pub(crate) fn add(&mut self, name: &str, parent: Option<u32>) -> u32 {
        let name = if name.is_empty() { "object" } else { name };
        let mut free = name.to_owned();
        while self.by_name.contains_key(&free) {
            let n = self.asked.entry(name.to_owned()).or_insert(1);
            *n += 1;
            free = format!("{name}.{n}");
        }
        let number = self.known.len() as u32;
        self.by_name.insert(free.clone(), number);
        self.known.push(Object { name: free, parent, is_gone: false });
        number
    }

    pub(crate) fn name_next(&mut self, name: &str) {
        self.next = Some(name.to_owned());
    }

    pub(crate) fn begin(&mut self, name: &str) -> u32 {
        let object = self.add(name, self.open.last().copied());
        self.open.push(object);
        object
    }

    pub(crate) fn end(&mut self) {
        self.open.pop();
    }

    /// Returns the object that something is part of which is added now: the open one, else one of its own.
    pub(crate) fn of_next(&mut self, word: &str) -> u32 {
        let next = self.next.take();
        match self.open.last() {
            Some(open) => *open,
            None => self.add(next.as_deref().unwrap_or(word), None),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.known.len()
    }

    pub(crate) fn name(&self, object: u32) -> &str {
        &self.known[object as usize].name
    }

    pub(crate) fn parent(&self, object: u32) -> Option<u32> {
        self.known[object as usize].parent
    }

    /// The numbers of those that are there.
    pub(crate) fn there(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.known.len() as u32).filter(|&object| !self.known[object as usize].is_gone)
    }

    /// Returns which objects a name means: those that match it, where `*` stands for any letters and `?` for one, and all their parts.
    pub(crate) fn matching(&self, pattern: &str) -> Vec<bool> {
        let mut picked = vec![false; self.known.len()];
        match self.by_name.get(pattern) {
            Some(&object) => picked[object as usize] = true,
            None => self.there().for_each(|object| picked[object as usize] = is_like(pattern, self.name(object))),
        }
        self.with_parts(picked)
    }

    /// Parents come before their parts.
    fn with_parts(&self, mut picked: Vec<bool>) -> Vec<bool> {
        for object in 0..self.known.len() {
            picked[object] |= self.known[object].parent.is_some_and(|parent| picked[parent as usize]);
            picked[object] &= !self.known[object].is_gone;
        }
        picked
    }

    pub(crate) fn remove(&mut self, picked: &[bool]) {
        for (object, _) in self.known.iter_mut().zip(picked).filter(|(_, is_picked)| **is_picked) {
            object.is_gone = true;
            self.by_name.remove(&object.name);
        }
    }

    /// Takes those of another world in, parts of `parent`; numbers of theirs grow by what is returned.
    pub(crate) fn take_in(&mut self, other: &Self, parent: Option<u32>) -> u32 {
        let first = self.known.len() as u32;
        for object in &other.known {
            let number = self.add(&object.name, object.parent.map(|p| p + first).or(parent));
            if object.is_gone {
                self.known[number as usize].is_gone = true;
                self.by_name.remove(&self.known[number as usize].name);
            }
        }
        first
    }

    /// Returns a few words of names that are like one that isn't there.
    pub(crate) fn near(&self, pattern: &str) -> String {
        const MOST: usize = 6;
        let wanted = pattern.trim_matches(['*', '?']).to_lowercase();
        let rank = |name: &str| {
            let name = name.to_lowercase();
            if !wanted.is_empty() && (name.contains(&wanted) || wanted.contains(&name)) {
                return 0;
            }
            distance(&wanted, &name)
        };
        let names: Vec<&str> = self.there().map(|object| self.name(object)).collect();
        let mut near: Vec<(usize, &str)> = names.iter().map(|name| (rank(name), *name)).collect();
        near.retain(|(rank, _)| *rank <= 1 + wanted.chars().count() / 3);
        near.sort_by_key(|(rank, _)| *rank);
        let quoted = |names: &mut dyn Iterator<Item = &str>| {
            names.take(MOST).map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", ")
        };
        match names.len() {
            0 => ": the world has none".to_owned(),
            _ if !near.is_empty() => format!(": near it are {}", quoted(&mut near.into_iter().map(|(_, name)| name))),
            n if n > MOST => format!(": there are {} and {} more", quoted(&mut names.into_iter()), n - MOST),
            _ => format!(": there are {}", quoted(&mut names.into_iter())),
        }
    }
}

/// Whether a name is what a pattern stands for: `*` any letters, `?` one.
fn is_like(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n) = (0, 0);
    let mut last_star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                last_star = Some((p, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => (p, n) = (p + 1, n + 1),
            // One letter more for the star before.
            _ => match last_star {
                Some((star, from)) => {
                    last_star = Some((star, from + 1));
                    (p, n) = (star + 1, from + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

/// Returns how many letters are put in, left out or changed from one word to another (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let changed = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// Which object each shape and each instance of a world is part of.
#[derive(Debug, Default)]
pub(crate) struct ObjectTable {
    names: Vec<String>,
    of_shapes: Vec<u32>,
    of_instances: Vec<u32>,
}

impl ObjectTable {
    /// Shapes within groups are of none.
    pub(crate) fn new(
        objects: Objects,
        of_shapes: impl Iterator<Item = Option<u32>>,
        of_instances: impl Iterator<Item = u32>,
    ) -> Self {
        let mut numbers = vec![0; objects.len()];
        let mut names = Vec::new();
        for (number, object) in objects.known.into_iter().enumerate().filter(|(_, object)| !object.is_gone) {
            numbers[number] = names.len() as u32;
            names.push(object.name);
        }
        let renumbered = |object: u32| numbers.get(object as usize).copied().unwrap_or(0);
        Self {
            names,
            of_shapes: of_shapes.map(|object| object.map_or(0, renumbered)).collect(),
            of_instances: of_instances.map(renumbered).collect(),
        }
    }

    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    pub(crate) fn of(&self, shape: ShapeId, instance: Option<InstanceId>) -> usize {
        instance.map_or(self.of_shapes[shape.0 as usize], |instance| self.of_instances[instance.0 as usize]) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stand_for_names() {
        for (pattern, name, expected) in [
            ("king*", "king.2", true),
            ("*", "", true),
            ("k?ng", "king", true),
            ("k?ng", "kng", false),
            ("*_w*1", "pawn_white_11", true),
            ("*_w*2", "pawn_white_11", false),
            ("king", "kings", false),
        ] {
            assert_eq!(is_like(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn names_differ_and_near_ones_are_told() {
        let mut objects = Objects::default();
        objects.begin("board");
        for name in ["king", "king", "bishop"] {
            objects.begin(name);
            objects.end();
        }
        objects.end();
        assert_eq!(objects.of_next("sphere"), 4);
        assert_eq!(objects.name(2), "king.2");
        assert_eq!(objects.matching("board"), [true, true, true, true, false]);
        assert_eq!(objects.near("bishp"), ": near it are 'bishop'");
        assert_eq!(objects.near("KING"), ": near it are 'king', 'king.2'");
        assert!(objects.near("zzzzzzz").starts_with(": there are 'board', 'king'"));
        objects.remove(&objects.matching("king"));
        assert_eq!(objects.matching("king*"), [false, false, true, false, false]);
        assert_eq!(objects.add("king", None), 5);
        assert_eq!(Objects::default().near("a"), ": the world has none");
    }
}
