//! The lines of an index, read back.

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    fs::File,
    io::{BufRead, BufReader},
    path::Path,
};

use serde::{Deserialize, Deserializer, de::Error as _};

use crate::{ItemId, Status, SweepError};

/// A line of `index.jsonl`, but for what its item sets.
#[derive(Deserialize)]
pub(crate) struct Line<'a> {
    pub(crate) item: usize,
    #[serde(borrow)]
    pub(crate) id: &'a str,
    pub(crate) status: Status,
    #[serde(borrow, default)]
    pub(crate) reason: Option<Cow<'a, str>>,
    #[serde(borrow, default)]
    pub(crate) metrics: HashMap<Cow<'a, str>, f64>,
}

impl<'a> Line<'a> {
    pub(crate) fn parse(text: &'a str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }
}

/// The part of a line that tells which item it is of, and whether it is there.
#[derive(Deserialize)]
struct Head {
    #[serde(deserialize_with = "name")]
    id: ItemId,
    status: Status,
}

fn name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ItemId, D::Error> {
    <&str>::deserialize(deserializer)?.parse().map_err(D::Error::custom)
}

/// Where the lines of an `index.jsonl` are, so that items can be read one by one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IndexLines {
    /// Where each line begins, bytes from the beginning of the file; and where the file ends.
    pub starts: Vec<u64>,
    /// The lines, from 0, of items that are done, each item once.
    pub done: Vec<usize>,
}

impl IndexLines {
    /// Looks through an index; one line is held at a time.
    ///
    /// # Errors
    /// When the file cannot be read, or a line of it is none of an index.
    pub fn read(path: &Path) -> Result<Self, SweepError> {
        let cannot = SweepError::reading(path);
        let mut file = BufReader::with_capacity(1 << 18, File::open(path).map_err(&cannot)?);
        let (mut starts, mut done, mut known) = (vec![0], Vec::new(), HashSet::new());
        let (mut end, mut line) = (0, Vec::new());
        loop {
            line.clear();
            let n_bytes = file.read_until(b'\n', &mut line).map_err(&cannot)?;
            if n_bytes == 0 {
                return Ok(Self { starts, done });
            }
            let head: Head = serde_json::from_slice(&line).map_err(|error| {
                let reason = format!("line {}: {error}; `dioptric sweep index PLAN` writes it anew", starts.len());
                SweepError::Read { path: path.to_owned(), reason }
            })?;
            if head.status == Status::Done && known.insert(head.id) {
                done.push(starts.len() - 1);
            }
            end += n_bytes as u64;
            starts.push(end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(n: usize, status: &str) -> String {
        format!("{{\"item\":{n},\"id\":\"{:064x}\",\"status\":\"{status}\",\"values\":{{\"a\":1.5}}}}\n", n % 3)
    }

    #[test]
    fn lines_are_found_and_items_counted_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.jsonl");
        // The fourth is the first once more.
        let texts = [line(0, "done"), line(1, "refused"), line(2, "done"), line(3, "done"), line(4, "missing")];
        std::fs::write(&path, texts.concat()).unwrap();
        let lines = IndexLines::read(&path).unwrap();
        let lengths: Vec<u64> = lines.starts.windows(2).map(|ends| ends[1] - ends[0]).collect();
        assert_eq!(lengths, texts.each_ref().map(|text| text.len() as u64));
        assert_eq!(lines.done, [0, 2]);
        std::fs::write(&path, "").unwrap();
        assert_eq!(IndexLines::read(&path).unwrap(), IndexLines { starts: vec![0], done: vec![] });
    }

    #[test]
    fn lines_of_other_files_are_refused_by_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.jsonl");
        let cut = &line(1, "done")[..60];
        for wrong in [cut, "{}\n", "[1]\n", "\u{fe}\n", &line(1, "lost"), &line(1, "done").replace("001\"", "01\"")] {
            std::fs::write(&path, line(0, "done") + wrong).unwrap();
            let message = IndexLines::read(&path).unwrap_err().to_string();
            assert!(message.contains("index.jsonl: line 2: ") && !message.contains('\n'), "{message}");
        }
    }
}
