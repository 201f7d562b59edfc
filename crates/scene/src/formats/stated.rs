//! What a file states, and what becomes of it.
//!
//! Whatever a reader meets by name (keys of a header, attributes, channels, parts, variables, pages) it puts into a [`Stated`] and
//! takes out what it uses. What is left and is not known to be harmless is named in a note: nothing that a file states is dropped.

use std::path::Path;

/// How many names a note holds; of more it has the number.
const MOST_NAMES: usize = 6;
/// Characters of a name that a note shows.
const MOST_CHARACTERS: usize = 40;

/// Names of one kind in a file, each with what stands under it.
#[derive(Clone, Debug)]
pub(super) struct Stated<T> {
    /// What they are: "key", "channel".
    kind: &'static str,
    entries: Vec<(String, T)>,
}

impl<T> Stated<T> {
    pub(super) fn new(kind: &'static str, entries: Vec<(String, T)>) -> Self {
        Self { kind, entries }
    }

    /// Takes the first entry of a name.
    pub(super) fn take(&mut self, name: &str) -> Option<T> {
        self.take_where(|own| own == name).map(|(_, value)| value)
    }

    /// Takes the first entry of the first of these names that is there.
    pub(super) fn take_any(&mut self, names: &[&str]) -> Option<T> {
        names.iter().find_map(|name| self.take(name))
    }

    /// Takes the first entry whose name is wanted; the others keep their order.
    pub(super) fn take_where(&mut self, is_wanted: impl Fn(&str) -> bool) -> Option<(String, T)> {
        let index = self.entries.iter().position(|(name, _)| is_wanted(name))?;
        Some(self.entries.remove(index))
    }

    /// Takes all entries whose names are wanted, in their order.
    pub(super) fn take_all(&mut self, is_wanted: impl Fn(&str) -> bool) -> Vec<(String, T)> {
        let (taken, left) = std::mem::take(&mut self.entries).into_iter().partition(|(name, _)| is_wanted(name));
        self.entries = left;
        taken
    }

    /// Adds entries of names that it does not have.
    pub(super) fn merge(&mut self, other: Self) {
        let new = other.entries.into_iter().filter(|(name, _)| self.entries.iter().all(|(own, _)| own != name));
        self.entries.extend(new.collect::<Vec<_>>());
    }

    pub(super) fn get(&self, name: &str) -> Option<&T> {
        self.entries.iter().find(|(own, _)| own == name).map(|(_, value)| value)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|(name, _)| name.as_str())
    }

    /// Returns the note of what is left, but for what is known to change nothing.
    pub(super) fn note(self, file: &Path, is_harmless: impl Fn(&str) -> bool) -> Option<String> {
        let left: Vec<String> =
            self.entries.into_iter().map(|(name, _)| name).filter(|name| !is_harmless(name)).collect();
        note_of(file, self.kind, &left)
    }
}

/// Returns the sentence that names what of a file is not used.
pub(super) fn note_of(file: &Path, kind: &str, names: &[String]) -> Option<String> {
    if names.is_empty() {
        return None;
    }
    let shown: Vec<String> = names.iter().take(MOST_NAMES).map(|name| format!("'{}'", short(name))).collect();
    let more = match names.len().saturating_sub(MOST_NAMES) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let (plural, are) = if names.len() == 1 { ("", "is") } else { ("s", "are") };
    Some(format!("{}: its {kind}{plural} {}{more} {are} not used", name_of(file), shown.join(", ")))
}

/// Returns the name of a file, for a note.
pub(super) fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

/// Returns the start of a text of a file, for a message.
pub(super) fn short(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(MOST_CHARACTERS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_named() {
        let entries = ["a", "b", "b", "time"].map(|name| (name.to_owned(), ())).to_vec();
        let mut stated = Stated::new("key", entries);
        assert!(stated.take("b").is_some() && stated.take("c").is_none());
        let file = Path::new("folder/x.hdr");
        // A name that stands twice is used once.
        let note = stated.clone().note(file, |name| name == "time");
        assert_eq!(note.as_deref(), Some("x.hdr: its keys 'a', 'b' are not used"));
        stated.take_all(|name| name != "time");
        assert_eq!(stated.note(file, |name| name == "time"), None);
        let many = (0..9).map(|i| (format!("{i}\n{}", "x".repeat(99)), ())).collect();
        let note = Stated::new("channel", many).note(file, |_| false).unwrap();
        assert!(note.contains("and 3 more") && note.chars().count() < 400 && !note.contains('\n'), "{note}");
    }
}
