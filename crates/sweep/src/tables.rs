//! An index as files: lines of JSON, a table, and the contact sheet.

use std::{fs, io::Write, path::Path};

use dioptric_pipeline::Staged;
use serde::{Serialize, Serializer, ser::SerializeMap};

use crate::{Index, IndexRow, Status, Store, SweepError, Value, sheet};

impl Index {
    /// Writes `index.jsonl`, `index.csv` and `index.html` into the store, each of them whole or not at all.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, store: &Store) -> Result<(), SweepError> {
        let lines = |out: &mut dyn Write| {
            self.rows.iter().try_for_each(|row| {
                serde_json::to_writer(&mut *out, &Line { keys: &self.keys, row })?;
                out.write_all(b"\n")
            })
        };
        write(&store.folder().join("index.jsonl"), &lines)?;
        write(&store.folder().join("index.csv"), &|out| self.write_csv(out).map_err(std::io::Error::other))?;
        write(&store.folder().join("index.html"), &|out| out.write_all(sheet::page(self).as_bytes()))
    }

    fn write_csv(&self, out: &mut dyn Write) -> Result<(), csv::Error> {
        let mut table = csv::Writer::from_writer(out);
        let metrics = self.metrics();
        let keys = self.keys.iter().map(String::as_str);
        table.write_record(
            ["item", "id", "status"].into_iter().chain(keys).chain(metrics.iter().copied()).chain(["reason"]),
        )?;
        for row in &self.rows {
            let of = |name: &&str| row.metrics.iter().find(|(own, _)| own == name).map(|(_, value)| value.to_string());
            let first = [row.item.to_string(), row.id.to_string(), row.status.word().to_owned()];
            table.write_record(
                first
                    .into_iter()
                    .chain(row.values.iter().map(Value::to_string))
                    .chain(metrics.iter().map(|name| of(name).unwrap_or_default()))
                    .chain([row.reason.clone().unwrap_or_default()]),
            )?;
        }
        Ok(table.flush()?)
    }
}

/// Writes a file beside its place and moves it there.
fn write(path: &Path, content: &dyn Fn(&mut dyn Write) -> std::io::Result<()>) -> Result<(), SweepError> {
    let staged = Staged::file(path)?;
    let cannot = SweepError::writing(path);
    let mut out = std::io::BufWriter::new(fs::File::create(staged.path()).map_err(&cannot)?);
    content(&mut out).and_then(|()| out.flush()).map_err(&cannot)?;
    out.get_ref().sync_all().map_err(&cannot)?;
    drop(out);
    Ok(staged.commit()?)
}

/// Entries of a JSON object in their order.
struct Object<I>(I);

impl<K: Serialize, V: Serialize, I: Iterator<Item = (K, V)> + Clone> Serialize for Object<I> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.clone())
    }
}

/// A line of `index.jsonl`.
struct Line<'a> {
    keys: &'a [String],
    row: &'a IndexRow,
}

impl Serialize for Line<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let row = self.row;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("item", &row.item)?;
        map.serialize_entry("id", &row.id)?;
        map.serialize_entry("status", &row.status)?;
        map.serialize_entry("values", &Object(self.keys.iter().zip(&row.values)))?;
        match row.status {
            Status::Done => {
                let pairs = row.metrics.iter().map(|(name, number)| (name, number));
                map.serialize_entry("metrics", &Object(pairs))?;
            }
            Status::Refused => map.serialize_entry("reason", &row.reason)?,
            Status::Missing => {}
        }
        map.end()
    }
}
