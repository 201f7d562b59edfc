//! An index as files: lines of JSON, a table, and the contact sheet.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, BufWriter, Write},
    path::Path,
};

use dioptric_files::Staged;
use serde::{Serialize, Serializer, ser::SerializeMap};

use crate::{
    Index, IndexRow, Status, SweepError, Value,
    lines::Line,
    sheet::{self, Sheet},
};

/// The name of the index as lines of JSON.
const LINES: &str = "index.jsonl";

impl Index<'_> {
    /// Writes `index.jsonl`, `index.csv` and `index.html` into the store, each of them whole or not at all. Memory does not grow with
    /// the number of items; the page shows some of them where there are many.
    ///
    /// # Errors
    /// When a file of the store cannot be read, or one of the index cannot be written.
    pub fn write(&self) -> Result<(), SweepError> {
        let folder = self.store.folder();
        let (path, lines) = (folder.join(LINES), Staged::file(&folder.join(LINES))?);
        let mut seen = Seen::new(sheet::every(self.sweep.len()));
        write_to(&lines, &path, |out| {
            self.rows().try_for_each(|row| {
                let row = row?;
                write_line(out, &self.keys(), &row).map_err(SweepError::writing(&path))?;
                seen.add(row);
                Ok(())
            })
        })?;
        // From the lines, so that the table has what they have, whatever others put into the store meanwhile.
        let (path, table) = (folder.join("index.csv"), Staged::file(&folder.join("index.csv"))?);
        write_to(&table, &path, |out| self.write_csv(out, &path, lines.path(), &seen.metrics))?;
        let (path, page) = (folder.join("index.html"), Staged::file(&folder.join("index.html"))?);
        let Seen { metrics, counts, rows, .. } = &seen;
        let sheet = Sheet {
            name: &self.name(),
            keys: &self.keys(),
            metrics,
            counts: *counts,
            rows,
            keep: &self.sweep.plan().keep,
        };
        write_to(&page, &path, |out| sheet.write(out).map_err(SweepError::writing(&path)))?;
        [lines, table, page].into_iter().try_for_each(|file| Ok(file.commit()?))
    }

    fn write_csv(&self, out: &mut dyn Write, path: &Path, lines: &Path, metrics: &[String]) -> Result<(), SweepError> {
        let cannot = |error: csv::Error| SweepError::writing(path)(error.into());
        let mut table = csv::Writer::from_writer(out);
        let (keys, names) = (self.keys(), metrics.iter().map(String::as_str));
        table
            .write_record(["item", "id", "status"].into_iter().chain(keys).chain(names).chain(["reason"]))
            .map_err(cannot)?;
        let unreadable = SweepError::reading(lines);
        for text in BufReader::new(File::open(lines).map_err(&unreadable)?).lines() {
            let text = text.map_err(&unreadable)?;
            let line = Line::parse(&text).map_err(|error| unreadable(error.into()))?;
            let first = [line.item.to_string(), line.id.to_owned(), line.status.word().to_owned()];
            let of = |name: &String| line.metrics.get(name.as_str()).map(f64::to_string).unwrap_or_default();
            let values = self.sweep.values(line.item).into_iter().map(|value: Value| value.to_string());
            let reason = line.reason.unwrap_or_default().into_owned();
            table
                .write_record(first.into_iter().chain(values).chain(metrics.iter().map(of)).chain([reason]))
                .map_err(cannot)?;
        }
        table.flush().map_err(SweepError::writing(path))
    }
}

/// What is known of the rows that were written.
struct Seen {
    /// One in so many is shown.
    every: usize,
    rows: Vec<IndexRow>,
    /// Names of all metrics, in the order of a report.
    metrics: Vec<String>,
    /// Items done, refused and missing.
    counts: [usize; 3],
}

impl Seen {
    fn new(every: usize) -> Self {
        Self { every, rows: Vec::new(), metrics: Vec::new(), counts: [0; 3] }
    }

    fn add(&mut self, row: IndexRow) {
        self.counts[row.status as usize] += 1;
        let mut after = 0;
        for (name, _) in &row.metrics {
            match self.metrics.iter().position(|known| known == name) {
                Some(place) => after = place + 1,
                None => {
                    self.metrics.insert(after, name.clone());
                    after += 1;
                }
            }
        }
        if row.item.is_multiple_of(self.every) {
            self.rows.push(row);
        }
    }
}

/// Writes a file beside its place and brings it to the disk.
fn write_to(
    staged: &Staged,
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> Result<(), SweepError>,
) -> Result<(), SweepError> {
    let cannot = SweepError::writing(path);
    let mut out = BufWriter::new(File::create(staged.path()).map_err(&cannot)?);
    content(&mut out)?;
    out.flush().and_then(|()| out.get_ref().sync_all()).map_err(&cannot)
}

/// Entries of a JSON object in their order.
struct Object<I>(I);

impl<K: Serialize, V: Serialize, I: Iterator<Item = (K, V)> + Clone> Serialize for Object<I> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.clone())
    }
}

fn write_line(out: &mut dyn Write, keys: &[&str], row: &IndexRow) -> io::Result<()> {
    let mut serializer = serde_json::Serializer::new(&mut *out);
    let mut map = serializer.serialize_map(None)?;
    map.serialize_entry("item", &row.item)?;
    map.serialize_entry("id", &row.id)?;
    map.serialize_entry("status", &row.status)?;
    map.serialize_entry("values", &Object(keys.iter().zip(&row.values)))?;
    match row.status {
        Status::Done => {
            let pairs = row.metrics.iter().map(|(name, number)| (name, number));
            map.serialize_entry("metrics", &Object(pairs))?;
        }
        Status::Refused => map.serialize_entry("reason", &row.reason)?,
        Status::Missing => {}
    }
    map.end()?;
    out.write_all(b"\n")
}
