//! Files changed at random: what a reader must survive.

use std::path::Path;

use dioptric_optics::{GlassCatalogue, LensFile, ReadOptions};

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
