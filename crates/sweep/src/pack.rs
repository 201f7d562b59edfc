//! Items packed into archives as `WebDataset` reads them.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use dioptric_files::Staged;
use tar::{EntryType, Header};

use crate::{Status, Store, Sweep, SweepError, Value, item::THUMBNAIL};

impl Sweep {
    /// Packs the finished items of the plan into archives: of each the files of its folder but the small picture, named
    /// `<id>.<file>`, and `<id>.values.json` with what it sets. Returns the archives.
    ///
    /// With so many items an archive the archives are `NAME-000000.tar` and so on, else it is `target` alone. Items are in the
    /// order of their names, files in that of theirs, and nothing tells when or by whom they were packed: equal items make
    /// equal archives.
    ///
    /// # Errors
    /// When no item is finished, or a file cannot be read or written.
    pub fn pack(&self, store: &Store, target: &Path, per_archive: Option<usize>) -> Result<Vec<PathBuf>, SweepError> {
        let mut items: Vec<usize> =
            (0..self.len()).filter(|item| store.status(self.id(*item)) == Status::Done).collect();
        items.sort_by_key(|item| self.id(*item));
        items.dedup_by_key(|item| self.id(*item));
        if items.is_empty() {
            let reason = format!("none of its items is finished in {}", store.folder().display());
            return Err(SweepError::Plan { path: self.path().to_owned(), reason });
        }
        let size = per_archive.unwrap_or(items.len()).max(1);
        let name = |number: usize| match per_archive {
            None => target.to_owned(),
            Some(_) => {
                let stem = target.file_stem().unwrap_or_default().to_string_lossy();
                target.with_file_name(format!("{stem}-{number:06}.tar"))
            }
        };
        let archive = |(number, items): (usize, &[usize])| {
            self.write_archive(store, items, &name(number))?;
            Ok(name(number))
        };
        items.chunks(size).enumerate().map(archive).collect()
    }

    fn write_archive(&self, store: &Store, items: &[usize], target: &Path) -> Result<(), SweepError> {
        let staged = Staged::file(target)?;
        let cannot = SweepError::writing(target);
        let file = fs::File::create(staged.path()).map_err(&cannot)?;
        let mut archive = tar::Builder::new(std::io::BufWriter::new(file));
        for &item in items {
            let (id, folder) = (self.id(item), store.item(self.id(item)));
            let entries = fs::read_dir(&folder).map_err(SweepError::reading(&folder))?;
            let names: Result<Vec<String>, _> =
                entries.map(|e| Ok(e?.file_name().to_string_lossy().into_owned())).collect();
            let mut names: Vec<String> = names.map_err(SweepError::reading(&folder))?;
            names.retain(|name| name != THUMBNAIL);
            names.sort();
            for name in names {
                let path = folder.join(&name);
                let (mut file, length) = fs::File::open(&path)
                    .and_then(|file| Ok((fs::metadata(&path)?.len(), file)))
                    .map(|(length, file)| (file, length))
                    .map_err(SweepError::reading(&path))?;
                archive.append_data(&mut header(length), format!("{id}.{name}"), &mut file).map_err(&cannot)?;
            }
            let values = self.values_json(item);
            let mut entry = header(values.len() as u64);
            archive.append_data(&mut entry, format!("{id}.values.json"), values.as_slice()).map_err(&cannot)?;
        }
        let mut out = archive.into_inner().map_err(&cannot)?;
        out.flush().map_err(&cannot)?;
        drop(out);
        Ok(staged.commit()?)
    }

    /// Returns what an item sets as a JSON object.
    fn values_json(&self, item: usize) -> Vec<u8> {
        let keys = self.plan().keys();
        let values: std::collections::BTreeMap<&str, Value> = keys.into_iter().zip(self.values(item)).collect();
        serde_json::to_vec(&values).expect("values are JSON")
    }
}

/// Returns the header of a file of so many bytes, of no time and no owner.
fn header(length: u64) -> Header {
    let mut header = Header::new_ustar();
    header.set_entry_type(EntryType::Regular);
    header.set_size(length);
    header.set_mode(0o644);
    header.set_uid(0);
    header.set_gid(0);
    header.set_mtime(0);
    header
}
