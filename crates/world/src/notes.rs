//! What of a file isn't understood, gathered into few sentences.

use std::collections::HashMap;

/// Sentences, each with how often it was said and of what.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    notes: Vec<Note>,
    by_sentence: HashMap<String, usize>,
}

#[derive(Clone, Debug)]
struct Note {
    sentence: String,
    /// The first few things that it is said of.
    of: Vec<String>,
    n: usize,
}

/// So many sentences are kept, and so many things named in each.
const MOST_NOTES: usize = 500;
const MOST_NAMED: usize = 4;

impl Notes {
    /// Adds a sentence; again, it is counted.
    pub(crate) fn add(&mut self, sentence: String) {
        if let Some(note) = self.get_or_insert(sentence) {
            note.n += 1;
        }
    }

    /// Adds a thing to those that a sentence is said of; again, it is left as it is.
    pub(crate) fn add_of(&mut self, sentence: &str, thing: &str) {
        let Some(note) = self.get_or_insert(sentence.to_owned()) else { return };
        if !note.of.iter().any(|known| known == thing) {
            note.n += 1;
            if note.of.len() < MOST_NAMED {
                note.of.push(thing.to_owned());
            }
        }
    }

    fn get_or_insert(&mut self, sentence: String) -> Option<&mut Note> {
        let next = self.notes.len();
        let index = match self.by_sentence.get(&sentence) {
            Some(&index) => index,
            None if next >= MOST_NOTES => return None,
            None => {
                self.by_sentence.insert(sentence.clone(), next);
                self.notes.push(Note { sentence, of: Vec::new(), n: 0 });
                next
            }
        };
        self.notes.get_mut(index)
    }

    /// Returns a sentence each, in the order in which they were first said.
    pub(crate) fn sentences(self) -> Vec<String> {
        let is_full = self.notes.len() >= MOST_NOTES;
        let more = is_full.then(|| "and more that isn't listed".to_owned());
        self.notes.into_iter().map(Note::sentence).chain(more).collect()
    }
}

impl Note {
    fn sentence(self) -> String {
        let Self { sentence, of, n } = self;
        match (of.len(), n) {
            (0, 0 | 1) => sentence,
            (0, n) => format!("{sentence} ({n} times)"),
            (named, n) if n > named => format!("{sentence}: {} and {} more", of.join(", "), n - named),
            _ => format!("{sentence}: {}", of.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_are_said_once_with_their_count() {
        let mut notes = Notes::default();
        notes.add("a word is left out".to_owned());
        for number in 0..7 {
            notes.add("another is too".to_owned());
            notes.add_of("pictures that aren't there", &format!("{number}.png"));
            notes.add_of("pictures that aren't there", "0.png");
        }
        let expected = [
            "a word is left out",
            "another is too (7 times)",
            "pictures that aren't there: 0.png, 1.png, 2.png, 3.png and 3 more",
        ];
        assert_eq!(notes.sentences(), expected);
    }

    #[test]
    fn sentences_without_end_are_cut_off() {
        let mut notes = Notes::default();
        (0..9999).for_each(|number| notes.add(number.to_string()));
        assert_eq!(notes.sentences().len(), MOST_NOTES + 1);
    }
}
