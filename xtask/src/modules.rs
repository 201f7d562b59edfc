//! Circles of modules: which sibling modules of a crate use each other, found by reading paths that begin with `crate`,
//! `super` or `self`.
//!
//! A module and those inside it count as one towards its siblings, so that what is left are the circles beyond parent and
//! child. The reader knows files, `use` trees and re-exports; macros and inline modules it does not.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use anyhow::{Context, bail};

/// Circles that are left, with why they are: the crate's folder, the modules, and the reason. They may shrink, not grow.
const ALLOWED: &[(&str, &[&str], &str)] = &[
    (
        "backward",
        &["camera", "lens_camera", "renderer"],
        "a camera is one of several kinds, of which the lens's takes what the renderer asks of any",
    ),
    (
        "pipeline",
        &["camera", "frame_files", "words"],
        "the camera holds the choice of outputs, which names its frames, and is changed by words, which know its usual exposure",
    ),
    ("psf", &["narrow_gaussian", "splat"], "splats are sorted into narrow Gaussians, which are made of a `Splat`"),
    ("scene", &["light", "scene"], "a scene has a light and is put under another"),
    (
        "cli",
        &["analyze", "lens", "lens_compare", "lens_ghosts"],
        "`lens` dispatches to `analyze`, `lens_compare` and `lens_ghosts`, which open and ask for lenses as `lens` and `analyze` do",
    ),
    ("python", &["camera", "shot"], "a camera takes shots, and a shot has the camera that took it"),
    ("sensor", &["exposure", "sensor"], "an exposure is resolved for a sensor, whose methods take an exposure"),
];

/// The modules of a crate by their path from its root (`""` for the root itself).
#[derive(Debug, Default)]
struct Modules {
    paths: BTreeSet<String>,
    /// What names stand for in a module, by `use`: a path that begins with `crate`, or one that is not known here.
    names: BTreeMap<(String, String), Vec<String>>,
    /// The paths that a module's text holds.
    used: Vec<(String, Vec<String>)>,
}

/// Checks all crates and names the first circle that is not allowed.
pub(crate) fn run() -> anyhow::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let mut found = Vec::new();
    for entry in fs::read_dir(root.join("crates")).context("crates/")? {
        let folder = entry.context("crates/")?.path();
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let circles = Modules::read(&folder.join("src"))?.circles();
        found.extend(circles.into_iter().map(|circle| (name.clone(), circle)));
    }
    found.sort();
    let is_allowed = |name: &str, circle: &[String]| {
        ALLOWED.iter().any(|(of, modules, _)| *of == name && is_within(circle, modules))
    };
    let new: Vec<String> = found
        .iter()
        .filter(|(name, circle)| !is_allowed(name, circle))
        .map(|(name, circle)| format!("modules of crates/{name} use each other in a circle: {}", circle.join(", ")))
        .collect();
    if !new.is_empty() {
        bail!("{}", new.join("\n"));
    }
    for (name, modules, _) in ALLOWED {
        if !found.iter().any(|(of, circle)| of == name && is_within(circle, modules)) {
            bail!("xtask/src/modules.rs allows a circle that is no more: crates/{name}, {}", modules.join(", "));
        }
    }
    Ok(())
}

fn is_within(circle: &[String], modules: &[&str]) -> bool {
    circle.iter().all(|module| modules.contains(&module.as_str()))
}

impl Modules {
    /// Reads the modules below a folder of sources.
    fn read(source: &Path) -> anyhow::Result<Self> {
        let mut files = Vec::new();
        collect(source, "", &mut files)?;
        Ok(Self::of(files))
    }

    /// Takes the path and the text of each module.
    fn of(mut files: Vec<(String, String)>) -> Self {
        let tests: Vec<String> = files.iter().flat_map(|(path, text)| test_modules(path, text)).collect();
        files.retain(|(path, _)| !tests.iter().any(|test| path == test || path.starts_with(&format!("{test}::"))));
        let mut modules = Self { paths: files.iter().map(|(path, _)| path.clone()).collect(), ..Self::default() };
        for (module, text) in files {
            let text = product_code(&text);
            for (public_name, path) in uses(&text) {
                let first = path.first().map_or("", String::as_str);
                let is_local = matches!(first, "crate" | "super" | "self") || modules.is_module(&join(&module, first));
                if is_local {
                    let path = if matches!(first, "crate" | "super" | "self") {
                        path
                    } else {
                        [vec!["self".to_owned()], path].concat()
                    };
                    modules.names.insert((module.clone(), public_name), path);
                }
            }
            modules.used.extend(rooted_paths(&text).into_iter().map(|path| (module.clone(), path)));
        }
        modules
    }

    fn is_module(&self, path: &str) -> bool {
        self.paths.contains(path)
    }

    /// Returns the module in which a path ends, following re-exports.
    fn resolve(&self, from: &str, path: &[String], depth: usize) -> String {
        let mut here = from.to_owned();
        for (i, segment) in path.iter().enumerate() {
            match segment.as_str() {
                "crate" => here = String::new(),
                "self" => {}
                "super" => here = parent(&here).to_owned(),
                name if self.is_module(&join(&here, name)) => here = join(&here, name),
                name => {
                    let Some(target) = self.names.get(&(here.clone(), name.to_owned())).filter(|_| depth < 8) else {
                        return here;
                    };
                    let rest = [target.as_slice(), &path[i + 1..]].concat();
                    return self.resolve(&here, &rest, depth + 1);
                }
            }
        }
        here
    }

    /// Returns the groups of sibling modules that reach each other, each in order of names.
    fn circles(&self) -> Vec<Vec<String>> {
        let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, path) in &self.used {
            let to = self.resolve(from, path, 0);
            if let Some((a, b)) = siblings(from, &to) {
                edges.entry(a).or_default().insert(b);
            }
        }
        let reach: BTreeMap<&String, BTreeSet<String>> =
            edges.keys().map(|start| (start, reachable(&edges, start))).collect();
        let mut circles = BTreeSet::new();
        for (start, found) in &reach {
            if found.contains(*start) {
                let back = |other: &&String| reach.get(*other).is_some_and(|of_other| of_other.contains(*start));
                circles.insert(found.iter().filter(back).cloned().collect::<Vec<_>>());
            }
        }
        circles.into_iter().collect()
    }
}

/// Adds the path and the text of each module in a folder.
fn collect(folder: &Path, module: &str, files: &mut Vec<(String, String)>) -> anyhow::Result<()> {
    let here = || folder.display().to_string();
    for entry in fs::read_dir(folder).with_context(here)? {
        let path = entry.with_context(here)?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            collect(&path, &join(module, &stem), files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let own =
                if matches!(stem.as_str(), "lib" | "main" | "mod") { module.to_owned() } else { join(module, &stem) };
            files.push((own, fs::read_to_string(&path).with_context(|| path.display().to_string())?));
        }
    }
    Ok(())
}

fn join(module: &str, name: &str) -> String {
    if module.is_empty() { name.to_owned() } else { format!("{module}::{name}") }
}

fn parent(module: &str) -> &str {
    module.rsplit_once("::").map_or("", |(parent, _)| parent)
}

/// Returns the two children of the last module that holds both, if neither holds the other.
fn siblings(from: &str, to: &str) -> Option<(String, String)> {
    let [a, b]: [Vec<&str>; 2] = [from, to].map(|path| path.split("::").filter(|part| !part.is_empty()).collect());
    let common = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    (common < a.len() && common < b.len()).then(|| (a[..=common].join("::"), b[..=common].join("::")))
}

fn reachable(edges: &BTreeMap<String, BTreeSet<String>>, start: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![start.to_owned()];
    while let Some(module) = open.pop() {
        for next in edges.get(&module).into_iter().flatten() {
            if found.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    found
}

/// Returns the text without comments, and without the tests at its foot.
fn product_code(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests").unwrap_or(text.len());
    let code = |line: &str| line.split("//").next().unwrap_or("").to_owned() + "\n";
    text[..end].lines().map(code).collect()
}

/// Returns the modules in files of their own that a module has for tests alone.
fn test_modules<'a>(module: &'a str, text: &'a str) -> impl Iterator<Item = String> {
    let declared = text.split("#[cfg(test)]\n").skip(1);
    declared.filter_map(move |rest| {
        let line = rest.lines().next()?;
        let name = line.rsplit_once("mod ")?.1.strip_suffix(';')?;
        Some(join(module, name))
    })
}

/// Returns the names that `use` brings into a module, and the path that each stands for.
fn uses(text: &str) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("use ") {
        let before = text[..at].trim_end_matches(' ');
        // A statement begins a line or stands behind `pub` or `pub(…)`.
        if before.ends_with('\n') || before.is_empty() || before.ends_with("pub") || before.ends_with(')') {
            let statement = text[at + 4..].split(';').next().unwrap_or("");
            expand(&mut Words::new(statement), &[], &mut found);
        }
    }
    found
}

/// Returns the paths of a text that begin with `crate`, `super` or `self`, those of `use` trees one by one.
fn rooted_paths(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for root in ["crate::", "super::", "self::"] {
        for (at, _) in text.match_indices(root) {
            let before = text[..at].chars().next_back();
            if before.is_none_or(|c| !(c.is_alphanumeric() || c == '_' || c == ':')) {
                expand(&mut Words::new(&text[at..]), &[], &mut found);
            }
        }
    }
    found.into_iter().map(|(_, path)| path).collect()
}

/// The words and signs of a path or `use` tree.
struct Words<'a> {
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn new(rest: &'a str) -> Self {
        Self { rest }
    }

    /// Returns the next sign if it is this one.
    fn take(&mut self, sign: &str) -> bool {
        let rest = self.rest.trim_start();
        let is_next = rest.starts_with(sign);
        if is_next {
            self.rest = &rest[sign.len()..];
        }
        is_next
    }

    fn name(&mut self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let (name, rest) = rest.split_at(end);
        (!name.is_empty()).then(|| {
            self.rest = rest;
            name
        })
    }
}

/// Adds the name and path of each leaf of a `use` tree that begins with `head`.
fn expand(words: &mut Words<'_>, head: &[String], found: &mut Vec<(String, Vec<String>)>) {
    let mut path = head.to_vec();
    loop {
        if words.take("{") {
            while !words.take("}") {
                let before = words.rest.len();
                expand(words, &path, found);
                words.take(",");
                if words.rest.len() == before {
                    return;
                }
            }
            return;
        }
        if words.take("*") {
            found.push(("*".to_owned(), path));
            return;
        }
        let Some(name) = words.name() else { return };
        path.push(name.to_owned());
        if !words.take("::") {
            break;
        }
    }
    if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let rest = words.rest.trim_start();
    let alias = rest.strip_prefix("as ").and_then(|rest| {
        let mut words = Words::new(rest);
        words.name().map(|name| (name.to_owned(), words.rest.len()))
    });
    let name = match alias {
        Some((name, left)) => {
            words.rest = &rest[rest.len() - left..];
            name
        }
        None => path.last().cloned().unwrap_or_default(),
    };
    found.push((name, path));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circles(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        Modules::of(files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()).circles()
    }

    #[test]
    fn crates_have_no_circles_of_modules() {
        run().unwrap();
    }

    #[test]
    fn modules_that_use_each_other_are_found() {
        let files = [
            ("", "mod a;\nmod b;\nmod c;\n"),
            ("a", "use crate::b::{self, B};\n"),
            ("b", "use super::a::A;\n"),
            ("c", "use crate::a::A;\n"),
        ];
        assert_eq!(circles(&files), [["a", "b"]]);
    }

    #[test]
    fn circles_through_re_exports_are_found() {
        let files = [
            ("", "pub use a::A;\npub use b::B as Bee;\n"),
            ("a", "use crate::{\n    Bee,\n};\n"),
            ("b", "fn f(a: crate::A) {}\n"),
        ];
        assert_eq!(circles(&files), [["a", "b"]]);
    }

    #[test]
    fn circles_through_children_are_found() {
        let files =
            [("", ""), ("a", "use crate::b::B;\n"), ("a::x", "pub struct X;\n"), ("b", "use crate::a::x::X;\n")];
        assert_eq!(circles(&files), [["a", "b"]]);
    }

    #[test]
    fn parent_and_child_are_no_circle() {
        let files = [("", "use a::A;\n"), ("a", "use self::x::X;\nuse crate::Root;\n"), ("a::x", "use super::A;\n")];
        assert_eq!(circles(&files), Vec::<Vec<String>>::new());
    }

    #[test]
    fn tests_and_comments_do_not_count() {
        let a = "// see crate::b::B\n#[cfg(test)]\nmod tests {\n    use crate::b::B;\n}\n";
        assert_eq!(circles(&[("", ""), ("a", a), ("b", "use crate::a::A;\n")]), Vec::<Vec<String>>::new());
        let in_file = [
            ("", ""),
            ("a", "#[cfg(test)]\npub(crate) mod tests;\n"),
            ("a::tests", "use crate::b::B;\n"),
            ("b", "use crate::a::A;\n"),
        ];
        assert_eq!(circles(&in_file), Vec::<Vec<String>>::new());
    }
}
