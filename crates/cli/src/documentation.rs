//! What the pages of the repository say is held to the program: links lead somewhere, and every command line parses.

mod reference;

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::error::ErrorKind;

use crate::args::Cli;

/// A page, its lines outside of fenced code, and those inside.
struct Page {
    path: PathBuf,
    /// Numbered from 1.
    prose: Vec<(usize, String)>,
    code: Vec<(usize, String)>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every page in this folder, and in those below it.
fn pages_in(folder: &Path, depth: usize, pages: &mut Vec<Page>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        // Notes are dated, and keep the words of their time.
        if entry.ends_with("docs/notes") {
            continue;
        }
        if entry.is_dir() && depth > 0 {
            pages_in(&entry, depth - 1, pages);
        } else if entry.extension().is_some_and(|extension| extension == "md") {
            pages.push(Page::read(&entry));
        }
    }
}

fn pages() -> Vec<Page> {
    let mut pages = Vec::new();
    for (folder, depth) in [("", 0), ("docs", 9), ("examples", 9), ("crates", 1)] {
        pages_in(&root().join(folder), depth, &mut pages);
    }
    assert!(pages.len() > 30, "{} pages", pages.len());
    pages
}

impl Page {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap();
        let (mut prose, mut code, mut is_code) = (Vec::new(), Vec::new(), false);
        for (number, line) in (1..).zip(text.lines()) {
            if line.trim_start().starts_with("```") {
                is_code = !is_code;
                continue;
            }
            if is_code { &mut code } else { &mut prose }.push((number, line.to_owned()));
        }
        assert!(!is_code, "{}: a code block does not end", path.display());
        Self { path: path.to_owned(), prose, code }
    }

    /// The names of its headings, as links have them.
    fn anchors(&self) -> Vec<String> {
        let of_heading = |line: &str| {
            let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
            line.trim_start_matches('#')
                .trim()
                .to_lowercase()
                .chars()
                .filter(kept)
                .collect::<String>()
                .replace(' ', "-")
        };
        self.prose.iter().filter(|(_, line)| line.starts_with('#')).map(|(_, line)| of_heading(line)).collect()
    }

    /// The targets of its links and pictures.
    fn links(&self) -> Vec<(usize, String)> {
        let mut links = Vec::new();
        for (number, line) in &self.prose {
            // Code within a line has no links.
            let words: String = line.split('`').step_by(2).collect::<Vec<_>>().join("`");
            for rest in words.split("](").skip(1) {
                let target = rest.split([')', ' ']).next().unwrap_or_default();
                links.push((*number, target.to_owned()));
            }
        }
        links
    }

    /// The command lines in its code blocks.
    fn commands(&self) -> Vec<(usize, Vec<String>)> {
        let mut commands = Vec::new();
        let mut lines = self.code.iter();
        while let Some((number, line)) = lines.next() {
            let mut whole = line.trim().trim_start_matches("$ ").to_owned();
            while let Some(start) = whole.strip_suffix('\\') {
                whole = start.to_owned() + lines.next().map_or("", |(_, more)| more.trim());
            }
            commands.extend(arguments_of(&whole).map(|arguments| (*number, arguments)));
        }
        commands
    }

    /// The command lines within its sentences, which may stand for many: `dioptric run --pixels WxH`.
    fn patterns(&self) -> Vec<(usize, Vec<String>)> {
        let spans = |line: &str| line.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
        let of = |(number, line): &(usize, String)| {
            spans(line).iter().filter_map(|span| Some((*number, arguments_of(span)?))).collect::<Vec<_>>()
        };
        self.prose.iter().flat_map(of).collect()
    }
}

/// Returns the words of a command line of this program, or `None` of any other.
fn arguments_of(line: &str) -> Option<Vec<String>> {
    let is_ours = ["dioptric ", "cargo run --release -- ", "target/release/dioptric "];
    let rest = is_ours.iter().find_map(|start| line.strip_prefix(start))?;
    let (mut words, mut word, mut quote) = (vec!["dioptric".to_owned()], String::new(), None);
    for letter in rest.chars().chain([' ']) {
        match (letter, quote) {
            (c, Some(q)) if c == q => quote = None,
            ('\'' | '"', None) => quote = Some(letter),
            // A comment, or what a shell does with the output.
            ('#' | '|' | '>' | '&', None) if word.is_empty() => break,
            (' ', None) if word.is_empty() => {}
            (' ', None) => words.push(std::mem::take(&mut word)),
            _ => word.push(letter),
        }
    }
    Some(words)
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let (mut wrong, mut n_links) = (Vec::new(), 0);
    for page in pages() {
        for (number, target) in page.links() {
            if ["http://", "https://", "mailto:"].iter().any(|scheme| target.starts_with(scheme)) {
                continue;
            }
            n_links += 1;
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let path = if file.is_empty() { page.path.clone() } else { page.path.with_file_name("").join(file) };
            let has_anchor = |path: &Path| path.is_file() && Page::read(path).anchors().iter().any(|a| a == anchor);
            if !path.exists() || !(anchor.is_empty() || has_anchor(&path)) {
                wrong.push(format!("{}:{number}: {target}", page.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_links > 50, "{n_links} links");
}

#[test]
fn every_command_line_of_the_pages_parses() {
    let (mut wrong, mut n_commands) = (Vec::new(), 0);
    // What changed has the words of its time.
    for page in pages().into_iter().filter(|page| !page.path.ends_with("CHANGELOG.md")) {
        let mut check = |(number, arguments): &(usize, Vec<String>), is_pattern: bool| {
            n_commands += 1;
            let Err(error) = Cli::words().try_get_matches_from(arguments) else { return };
            // What a shell puts in is not known here.
            let is_pattern = is_pattern || arguments.iter().any(|word| word.contains('$'));
            let is_help = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            // What stands for a value is none, and what a sentence is not about may be left out.
            let is_open = matches!(
                error.kind(),
                ErrorKind::ValueValidation
                    | ErrorKind::InvalidValue
                    | ErrorKind::MissingRequiredArgument
                    | ErrorKind::MissingSubcommand
                    | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
            );
            if !(is_help || is_pattern && is_open) {
                let first = error.to_string().lines().next().unwrap_or_default().to_owned();
                wrong.push(format!("{}:{number}: {}: {first}", page.path.display(), arguments.join(" ")));
            }
        };
        page.commands().iter().for_each(|command| check(command, false));
        page.patterns().iter().for_each(|command| check(command, true));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_commands > 50, "{n_commands} command lines");
}

#[test]
fn command_lines_are_parted_as_a_shell_does() {
    let words = |line: &str| arguments_of(line).map(|words| words[1..].join("|"));
    assert_eq!(words("dioptric run 'a b.ron' -o out/   # a picture"), Some("run|a b.ron|-o|out/".to_owned()));
    assert_eq!(words("dioptric lens list | head"), Some("lens|list".to_owned()));
    assert_eq!(words("cargo run --release -- run"), Some("run".to_owned()));
    assert_eq!(words("cargo test --workspace"), None);
}

#[test]
fn options_take_negative_numbers() {
    for line in [
        "dioptric lens info tessar-50mm --distance-mm -5",
        "dioptric psf tessar-50mm --focus-mm -1e3 --distances-mm -5,10",
        "dioptric run --fov-deg -.5 --exposure-s -1 --f-number -inf",
        "dioptric render room.pbrt --noise -0.5 --seconds -1",
        "dioptric measure noise --sensor imx363 --temperature-c -10 --analog-gain -1",
    ] {
        let parsed = Cli::words().try_get_matches_from(arguments_of(line).unwrap());
        assert!(parsed.is_ok(), "{line}: {parsed:?}");
    }
}

#[test]
fn words_are_consistent() {
    Cli::words().debug_assert();
}
