//! Banks as files: a line of text that says what is in it, then the numbers as they are in memory.

use std::{fs, io::Write, path::Path};

use dioptric_diffraction::PupilFunctionFit;
use dioptric_optics::Lens;
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    BankSettings, MeasuredError, PsfBank, PsfError,
    bank::Parts,
    mesh::Mesh,
    ray_map::{Record, Summary},
};

const FORMAT: &str = "dioptric psf bank 3";

/// The first line of a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: String,
    lens: String,
    /// Hash of the lens's prescription, in hexadecimal.
    prescription: String,
    settings: BankSettings,
    n_fields: usize,
    /// Numbers of the waves of one sample; 0 where there are none.
    n_wave_numbers: usize,
    /// The error of its interpolation, where it was measured.
    error: Option<MeasuredError>,
}

impl PsfBank {
    /// Writes the bank to a file, from which [`load`](Self::load) brings it back to the bit. The file is written
    /// beside and then renamed, so that it is never half there.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), PsfError> {
        let header = Header {
            format: FORMAT.to_owned(),
            lens: self.lens().name().to_owned(),
            prescription: fingerprint(self.lens()),
            settings: self.settings().clone(),
            n_fields: self.n_fields(),
            n_wave_numbers: self.waves().first().map_or(0, |map| map.numbers().len()),
            error: self.error(),
        };
        let text = ron::to_string(&header).map_err(|error| store_error(path, error))?;
        let mut bytes = format!("{text}\n").into_bytes();
        for record in self.records() {
            bytes.extend(record.numbers.iter().flat_map(|number| number.to_le_bytes()));
        }
        for s in self.summaries() {
            let numbers = [s.centroid_mm.x, s.centroid_mm.y, s.pupil_mm2, s.signed_rms_mm];
            bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        }
        for map in self.waves() {
            bytes.extend(map.numbers().iter().flat_map(|number| number.to_le_bytes()));
        }
        let beside = path.with_extension("partial");
        let write = || {
            let mut file = fs::File::create(&beside)?;
            file.write_all(&bytes)?;
            file.sync_all()?;
            fs::rename(&beside, path)
        };
        write().map_err(|error| {
            // What is left of a failed attempt is of no use; that it cannot be removed either would add nothing.
            let _ = fs::remove_file(&beside);
            store_error(path, error)
        })
    }

    /// Reads a bank of this lens from a file.
    ///
    /// # Errors
    /// When the file cannot be read, is no bank, or is that of another lens.
    pub fn load(path: &Path, lens: &Lens) -> Result<Self, PsfError> {
        let bytes = fs::read(path).map_err(|error| store_error(path, error))?;
        let end = bytes.iter().position(|byte| *byte == b'\n').ok_or_else(|| not_a_bank(path))?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|_| not_a_bank(path))?;
        let header: Header = ron::from_str(text).map_err(|_| not_a_bank(path))?;
        if header.format != FORMAT {
            return Err(not_a_bank(path));
        }
        if header.prescription != fingerprint(lens) {
            let reason = format!("it is the bank of another lens, {}, expected {}", header.lens, lens.name());
            return Err(store_error(path, reason));
        }
        let settings = header.settings;
        settings.check()?;
        let is_a_size = |n: usize| n <= 1 << 16;
        let has_sizes = is_a_size(settings.n_rings) && is_a_size(settings.n_azimuths);
        if !has_sizes || header.n_fields == 0 || header.n_fields > settings.field_tans.len() {
            return Err(not_a_bank(path));
        }
        let mesh = Mesh { n_rings: settings.n_rings, n_azimuths: settings.n_azimuths };
        let has_stop = settings.diffraction != crate::Diffraction::None;
        let n_columns = settings.wavelengths_nm.len() * settings.dioptres.len();
        let length = Record::length(mesh, has_stop);
        let n_records = n_columns * header.n_fields;
        let (numbers, rest) = bytes[end + 1..].split_at_checked(4 * n_records * length).ok_or_else(|| cut(path))?;
        let numbers: Vec<f32> = numbers.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        let records = numbers.chunks(length.max(1)).map(|numbers| Record { mesh, has_stop, numbers: numbers.to_vec() });
        let n_summaries = n_columns * Self::n_geometry(header.n_fields);
        if header.n_wave_numbers > 1 << 16 {
            return Err(not_a_bank(path));
        }
        let n_wave_numbers = n_records * header.n_wave_numbers;
        if rest.len() != 32 * n_summaries + 8 * n_wave_numbers {
            return Err(cut(path));
        }
        let doubles: Vec<f64> = rest.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let (doubles, wave_numbers) = doubles.split_at(4 * n_summaries);
        let waves = match header.n_wave_numbers {
            0 => vec![],
            n => {
                let maps = wave_numbers.chunks(n).map(|numbers| PupilFunctionFit::from_numbers(numbers.to_vec()));
                maps.collect::<Option<_>>().ok_or_else(|| not_a_bank(path))?
            }
        };
        let summaries = doubles.as_chunks::<4>().0.iter().map(|&[x, y, pupil_mm2, signed_rms_mm]| Summary {
            centroid_mm: DVec2::new(x, y),
            pupil_mm2,
            signed_rms_mm,
        });
        let (records, summaries) = (records.collect(), summaries.collect());
        let bank = Self::assemble(lens, &settings, Parts { n_fields: header.n_fields, records, summaries, waves })?;
        Ok(match header.error {
            Some(error) => bank.with_error(error),
            None => bank,
        })
    }

    /// Returns the bank from a file in `folder` that is named by what the lens and the settings are, or builds it and
    /// leaves it there.
    ///
    /// # Errors
    /// When it cannot be built, or its file not written.
    pub fn cached(lens: &Lens, settings: &BankSettings, folder: &Path) -> Result<Self, PsfError> {
        let key = hash(&format!("{FORMAT}{lens:?}{settings:?}"));
        let path = folder.join(format!("{key}.psfbank"));
        if let Ok(bank) = Self::load(&path, lens) {
            return Ok(bank);
        }
        let bank = Self::build(lens, settings)?;
        bank.save(&path)?;
        Ok(bank)
    }
}

fn fingerprint(lens: &Lens) -> String {
    hash(&format!("{lens:?}"))
}

/// Returns the FNV-1a hash of a text, in hexadecimal: the same on every machine.
fn hash(text: &str) -> String {
    let hash = text
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    format!("{hash:016x}")
}

fn store_error(path: &Path, reason: impl ToString) -> PsfError {
    PsfError::File { path: path.to_owned(), reason: reason.to_string() }
}

fn not_a_bank(path: &Path) -> PsfError {
    store_error(path, format!("expected a first line of the form '(format:\"{FORMAT}\",…)'"))
}

fn cut(path: &Path) -> PsfError {
    store_error(path, "its length is not what its first line says: it was cut short or added to")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Diffraction;

    fn bank(diffraction: Diffraction) -> (Lens, PsfBank) {
        let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(5.0).unwrap();
        let mut settings = BankSettings::covering(52.0, 0.1, (0.0, 1.0), (450.0, 650.0), diffraction);
        (settings.n_rings, settings.n_azimuths) = (4, 16);
        let bank = PsfBank::build(&lens, &settings).unwrap();
        (lens, bank)
    }

    #[test]
    fn what_is_saved_loads_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        for diffraction in [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }, Diffraction::Wave] {
            let (lens, bank) = bank(diffraction);
            let bank = match diffraction {
                Diffraction::None => bank,
                _ => bank.with_error(MeasuredError {
                    median: 0.1,
                    p90: 0.3,
                    n_places: 7,
                    pitch_um: 5.0,
                    target_median: Some(0.05),
                }),
            };
            let path = folder.path().join("a.psfbank");
            bank.save(&path).unwrap();
            let loaded = PsfBank::load(&path, &lens).unwrap();
            assert_eq!(loaded.settings(), bank.settings());
            assert_eq!(loaded.error(), bank.error());
            for (x, y, dioptres, nm) in [(0.0, 0.0, 0.5, 550.0), (0.03, 0.05, 0.31, 477.0)] {
                let at = DVec2::new(x, y);
                assert_eq!(loaded.kernel(at, dioptres, nm, 5.0), bank.kernel(at, dioptres, nm, 5.0));
                assert_eq!(loaded.geometry(dioptres, nm), bank.geometry(dioptres, nm));
            }
        }
    }

    #[test]
    fn the_cache_is_filled_and_used() {
        let folder = tempfile::tempdir().unwrap();
        let (lens, bank) = bank(Diffraction::None);
        for n_files in [1, 1] {
            let cached = PsfBank::cached(&lens, bank.settings(), folder.path()).unwrap();
            assert_eq!(cached.geometry(0.3, 500.0), bank.geometry(0.3, 500.0));
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), n_files);
        }
    }

    #[test]
    fn a_file_that_is_not_this_bank_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.psfbank");
        let (lens, bank) = bank(Diffraction::None);
        let message = |lens: &Lens| PsfBank::load(&path, lens).unwrap_err().to_string();
        assert!(message(&lens).contains("a.psfbank"));
        bank.save(&path).unwrap();
        let other = lens.with_stop_diameter_mm(4.0).unwrap();
        assert!(message(&other).contains("another lens"));
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
        assert!(message(&lens).contains("cut short"));
        let text = String::from_utf8_lossy(&bytes[..bytes.iter().position(|b| *b == b'\n').unwrap()]).into_owned();
        fs::write(&path, text.replace("n_fields:9", "n_fields:99") + "\n").unwrap();
        assert!(message(&lens).contains("expected a first line"));
        fs::write(&path, b"nonsense\n").unwrap();
        assert!(message(&lens).contains("expected a first line") && !message(&lens).contains('\n'));
        assert!(bank.save(&folder.path().join("none/a.psfbank")).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
