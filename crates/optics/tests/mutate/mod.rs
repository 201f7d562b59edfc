//! Files changed at random: what a reader must survive.

use std::path::Path;

use dioptric_optics::{GlassCatalogue, LensFile, ReadOptions};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The seeds: name and bytes. The name's extension tells the format.
pub(crate) const SEEDS: [(&str, &[u8]); 18] = [
    ("singlet.ron", include_bytes!("../corpus/singlet.ron")),
    ("doublet.dat", include_bytes!("../corpus/doublet.dat")),
    ("list.txt", include_bytes!("../corpus/list.txt")),
    ("omni.json", include_bytes!("../corpus/omni.json")),
    ("deeplens.json", include_bytes!("../corpus/deeplens.json")),
    ("singlet.zmx", include_bytes!("../corpus/singlet.zmx")),
    ("doublet.seq", include_bytes!("../corpus/doublet.seq")),
    ("telescope.ron", include_bytes!("../corpus/telescope.ron")),
    ("grating.json", include_bytes!("../corpus/grating.json")),
    ("phases.zmx", include_bytes!("../corpus/phases.zmx")),
    ("phases.seq", include_bytes!("../corpus/phases.seq")),
    ("cassegrain.seq", include_bytes!("../corpus/cassegrain.seq")),
    ("zoom.ron", include_bytes!("../corpus/zoom.ron")),
    ("zoom.zmx", include_bytes!("../corpus/zoom.zmx")),
    ("zoom.seq", include_bytes!("../corpus/zoom.seq")),
    ("triplet.len", include_bytes!("../corpus/triplet.len")),
    ("two.agf", include_bytes!("../corpus/two.agf")),
    ("formula.yml", include_bytes!("../corpus/formula.yml")),
];

/// Words that have broken readers of other programs.
const WORDS: [&str; 18] = [
    "0",
    "-1",
    "1e400",
    "-1e-400",
    "1e300",
    "NaN",
    "inf",
    "null",
    "true",
    "[]",
    "{}",
    "\"\"",
    "999999999999",
    "INFINITY",
    "é",
    "\n",
    "\r\n\t ",
    "0.5",
];

/// Checks that what is written of a lens, where a format can hold it, is read again.
fn check_writers(file: &LensFile) {
    for (name, text) in [("a.seq", file.to_seq()), ("a.zmx", file.to_zmx()), ("a.ron", Ok(file.to_ron()))] {
        let Ok(text) = text else { continue };
        let again = LensFile::from_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default());
        let again = again.unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!(again.lens.interfaces().len(), file.lens.interfaces().len(), "{text}");
        assert_eq!(again.configurations.len(), file.configurations.len(), "{text}");
    }
}

/// Reads one changed file; returns whether it was still a lens (or a glass) that has an index or first-order data.
///
/// A panic or a hang is the failure that this looks for.
pub(crate) fn read(name: &str, bytes: &[u8]) -> bool {
    let path = Path::new(name);
    if name.ends_with(".agf") || name.ends_with(".yml") {
        let Ok(catalogue) = GlassCatalogue::from_bytes(path, bytes) else { return false };
        return catalogue.glasses().iter().all(|glass| glass.glass.index_at(550.0).is_ok());
    }
    let Ok(file) = LensFile::from_bytes(path, bytes, &ReadOptions::default()) else { return false };
    check_writers(&file);
    file.lens.at(550.0).is_ok()
}

/// Returns the seed changed at random in one to eight places; the number tells which of all such files.
pub(crate) fn mutant(seed: &[u8], number: u64) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(number);
    let mut bytes = seed.to_vec();
    for _ in 0..random.random_range(1..=8) {
        change(&mut bytes, &mut random);
    }
    match random.random_range(0..40) {
        0 => utf16(&bytes, u16::to_le_bytes),
        1 => utf16(&bytes, u16::to_be_bytes),
        _ => bytes,
    }
}

fn change(bytes: &mut Vec<u8>, random: &mut impl Rng) {
    let at = random.random_range(0..=bytes.len());
    let end = (at + random.random_range(0..=24)).min(bytes.len());
    match random.random_range(0..8) {
        0 if at < bytes.len() => bytes[at] = random.random(),
        1 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
        2 => bytes.insert(at, random.random()),
        3 => drop(bytes.drain(at..end)),
        4 => {
            let copy = bytes[at..end].to_vec();
            let to = random.random_range(0..=bytes.len());
            bytes.splice(to..to, copy);
        }
        5 | 6 => replace_word(bytes, at, random),
        _ => bytes.truncate(if random.random_range(0..8) == 0 { at } else { bytes.len() }),
    }
}

/// Puts one of the words in the place of the number or word at a place.
fn replace_word(bytes: &mut Vec<u8>, at: usize, random: &mut impl Rng) {
    let is_of_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-._".contains(byte);
    let first = bytes[..at].iter().rposition(|byte| !is_of_word(byte)).map_or(0, |before| before + 1);
    let end = bytes[at..].iter().position(|byte| !is_of_word(byte)).map_or(bytes.len(), |after| at + after);
    let word = WORDS[random.random_range(0..WORDS.len())];
    bytes.splice(first..end, word.bytes());
}

fn utf16(bytes: &[u8], unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes);
    let marked = std::iter::once(0xFEFF).chain(text.encode_utf16());
    marked.flat_map(unit).collect()
}
