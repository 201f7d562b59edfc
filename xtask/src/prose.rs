//! How long sentences and paragraphs of the pages are, so that a stranger reads each of them in one go.
//!
//! Prose is what is left without code, tables, headings, links' targets and pictures. A list item is a paragraph.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};

/// The most words of nineteen sentences in twenty.
const SENTENCE_P95: usize = 32;
/// The most words of nineteen paragraphs in twenty.
const PARAGRAPH_P95: usize = 90;
/// The most characters of a line outside of code and tables.
const LINE: usize = 120;
/// The most words of docs/ARCHITECTURE.md.
const ARCHITECTURE: usize = 2000;

/// Pages that are still to be shortened, by their paths from the root. The list may shrink, not grow.
const TO_DO: &[&str] = &[
    "docs/PERFORMANCE.md",
    "docs/backward.md",
    "docs/diffraction.md",
    "docs/lightfield.md",
    "docs/mirrors.md",
    "docs/pupils.md",
    "docs/sensor.md",
];

/// Pages that are made from schemas.
const MADE: &[&str] = &["docs/book/src/reference/camera-file.md", "docs/book/src/reference/sensor-file.md"];

/// What a page was found to have.
#[derive(Debug, Default, PartialEq, Eq)]
struct Lengths {
    words: usize,
    sentences: Vec<usize>,
    paragraphs: Vec<usize>,
    /// Numbers of lines that are too long.
    long_lines: Vec<usize>,
}

/// Checks README, the pages of `docs` and the book, and names those that are too long.
pub(crate) fn run() -> anyhow::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let mut pages = vec![root.join("README.md"), root.join("CHANGELOG.md")];
    pages_in(&root.join("docs"), &mut pages)?;
    pages.sort();
    let mut wrong = Vec::new();
    for page in pages {
        let name = page.strip_prefix(root).unwrap_or(&page).to_string_lossy().replace('\\', "/");
        if TO_DO.iter().chain(MADE).any(|page| *page == name) {
            continue;
        }
        let text = fs::read_to_string(&page).with_context(|| name.clone())?;
        wrong.extend(faults(&name, &Lengths::of(&text)));
    }
    if wrong.is_empty() { Ok(()) } else { bail!("{}", wrong.join("\n")) }
}

/// Returns what is too long about a page, a line each.
fn faults(name: &str, lengths: &Lengths) -> Vec<String> {
    let Lengths { words, sentences, paragraphs, long_lines } = lengths;
    let mut faults = Vec::new();
    for (what, found, most) in
        [("sentences", p95(sentences), SENTENCE_P95), ("paragraphs", p95(paragraphs), PARAGRAPH_P95)]
    {
        if found > most {
            faults.push(format!("{name}: one in twenty {what} has more than {found} words, expected {most} at most"));
        }
    }
    if let Some(line) = long_lines.first() {
        faults.push(format!("{name}:{line}: more than {LINE} characters"));
    }
    if name == "docs/ARCHITECTURE.md" && *words > ARCHITECTURE {
        faults.push(format!("{name}: {words} words, expected {ARCHITECTURE} at most"));
    }
    faults
}

/// Adds the pages of a folder and of those in it, but for the notes, which are dated and stay as they were.
fn pages_in(folder: &Path, pages: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry.context("docs")?.path();
        if path.is_dir() {
            if !path.ends_with("docs/notes") {
                pages_in(&path, pages)?;
            }
        } else if path.extension().is_some_and(|extension| extension == "md") {
            pages.push(path);
        }
    }
    Ok(())
}

/// Returns what nineteen in twenty do not exceed; 0 of none.
fn p95(lengths: &[usize]) -> usize {
    let mut sorted = lengths.to_vec();
    sorted.sort_unstable();
    sorted.get((sorted.len() * 19).div_ceil(20).saturating_sub(1)).copied().unwrap_or(0)
}

impl Lengths {
    fn of(text: &str) -> Self {
        let mut found = Self::default();
        let (mut paragraph, mut is_code) = (String::new(), false);
        for (number, line) in (1..).zip(text.lines()) {
            let trimmed = line.trim_start();
            if trimmed.starts_with("```") {
                is_code = !is_code;
                found.end(&mut paragraph);
                continue;
            }
            let is_table = trimmed.starts_with('|');
            let is_comment = trimmed.starts_with("<!--");
            // Four blanks begin code, but continue a list.
            let is_indented = line.starts_with("    ") && paragraph.is_empty();
            if is_code || is_table || is_comment || is_indented {
                found.end(&mut paragraph);
                continue;
            }
            if visible(line).chars().count() > LINE {
                found.long_lines.push(number);
            }
            let is_item = ["- ", "* ", "> "].iter().any(|mark| trimmed.starts_with(mark))
                || trimmed
                    .split_once(". ")
                    .is_some_and(|(n, _)| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
            if trimmed.is_empty() || trimmed.starts_with('#') || trimmed.starts_with("![") || is_item {
                found.end(&mut paragraph);
            }
            if !trimmed.is_empty() && !trimmed.starts_with('#') && !trimmed.starts_with("![") {
                paragraph.push_str(trimmed);
                paragraph.push(' ');
            }
        }
        found.end(&mut paragraph);
        found
    }

    /// Counts a paragraph and clears it.
    fn end(&mut self, paragraph: &mut String) {
        let text = visible(&std::mem::take(paragraph));
        let words = words_of(&text);
        if words == 0 {
            return;
        }
        self.words += words;
        self.paragraphs.push(words);
        let mut sentence = 0;
        for word in text.split_whitespace() {
            sentence += words_of(word);
            let ends = word.trim_end_matches([')', '"', '*', '_', '”']).ends_with(['.', '!', '?', ':', ';']);
            if ends && !["e.g.", "i.e.", "vs.", "al.", "Fig."].contains(&word) {
                self.sentences.extend(Some(sentence).filter(|n| *n > 0));
                sentence = 0;
            }
        }
        self.sentences.extend(Some(sentence).filter(|n| *n > 0));
    }
}

/// Returns how many words have a letter or a digit.
fn words_of(text: &str) -> usize {
    text.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count()
}

/// Returns a line without the targets of its links, and each piece of code within it as one word.
fn visible(line: &str) -> String {
    let spans: Vec<&str> = line.split('`').collect();
    let whole = spans.len() % 2 == 1;
    let text: String =
        spans.iter().enumerate().map(|(i, span)| if whole && i % 2 == 1 { "code" } else { span }).collect();
    let mut shown = String::new();
    let mut rest = text.as_str();
    while let Some((before, after)) = rest.split_once("](") {
        shown.push_str(before);
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    shown + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_short() {
        run().unwrap();
    }

    #[test]
    fn prose_is_told_from_the_rest() {
        let text = "# A heading of words\n\nOne two three. Four [five](six/seven.md) `eight nine`.\n\n| a | b |\n\n\
                    - ten: eleven\n- twelve\n\n```sh\nnot counted\n```\n";
        let found = Lengths::of(text);
        assert_eq!((found.words, &found.sentences[..]), (9, &[3, 3, 1, 1, 1][..]));
        assert_eq!(found.paragraphs, [6, 2, 1]);
        assert_eq!(Lengths::of(&"x".repeat(121)).long_lines, [1]);
        assert_eq!(p95(&(1..=100).collect::<Vec<_>>()), 95);
    }

    #[test]
    fn what_is_too_long_is_named() {
        let long = Lengths { words: 2001, sentences: vec![33], paragraphs: vec![91], long_lines: vec![7] };
        let found = faults("docs/ARCHITECTURE.md", &long);
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(faults("docs/other.md", &Lengths { words: 2001, ..Lengths::default() }).is_empty());
    }
}
