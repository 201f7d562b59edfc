//! Flat and dark frames of a laboratory, from a descriptor file or by their names.
//!
//! The descriptor is that of the EMVA 1288 working group's own software: a line `b NANOSECONDS PHOTONS` or
//! `d NANOSECONDS` opens a series of bright or dark frames, and each line `i FILE` after it adds one; `n BITS WIDTH
//! HEIGHT`, `v VERSION` and lines that start with `#` may stand anywhere.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use dioptric_scene::{Noted, read_picture_samples};
use ndarray::Array2;

use super::open::read_dng;
use dioptric_pipeline::PipelineError;

/// The name of the descriptor in a folder.
pub(crate) const DESCRIPTOR_FILE: &str = "descriptor.txt";

/// Files of frames under equal light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FileSeries {
    /// The exposure time, s, where it is known.
    pub(crate) time_s: Option<f64>,
    /// The photons that fell on a pixel: 0 for dark frames, `None` where they were not counted.
    pub(crate) photons: Option<f64>,
    pub(crate) files: Vec<PathBuf>,
}

/// Returns the series of a descriptor file, or of a folder: of its `descriptor.txt`, or else of files whose names start
/// with `dark` or `flat`, those of one series differing after their last `-` or `_` only.
pub(crate) fn find_series(path: &Path) -> Result<Vec<FileSeries>, PipelineError> {
    let descriptor = if path.is_dir() { path.join(DESCRIPTOR_FILE) } else { path.to_owned() };
    if path.is_dir() && !descriptor.exists() {
        return series_by_name(path);
    }
    let text = dioptric_files::text::read(&descriptor)
        .map_err(|e| PipelineError::Read { path: descriptor.clone(), reason: e.to_string() })?;
    parse(&text, &descriptor)
}

fn parse(text: &str, path: &Path) -> Result<Vec<FileSeries>, PipelineError> {
    let mut found: Vec<FileSeries> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let wrong = |reason: String| PipelineError::Table { path: path.to_owned(), line: index as u64 + 1, reason };
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |word: &str| {
            let value: Option<f64> = word.parse().ok().filter(|v: &f64| v.is_finite() && *v >= 0.0);
            value.ok_or_else(|| wrong(format!("'{word}' is no number of 0 or more")))
        };
        match words.as_slice() {
            [] | ["v" | "n", ..] => {}
            [first, ..] if first.starts_with('#') => {}
            ["b", time_ns, photons] => {
                let (time_s, photons) = (Some(1e-9 * number(time_ns)?), Some(number(photons)?));
                found.push(FileSeries { time_s, photons, files: Vec::new() });
            }
            ["d", time_ns] => {
                found.push(FileSeries { time_s: Some(1e-9 * number(time_ns)?), photons: Some(0.0), files: Vec::new() });
            }
            ["i", ..] => {
                let name = line.trim().trim_start_matches('i').trim().replace('\\', "/");
                let series =
                    found.last_mut().ok_or_else(|| wrong("a frame stands before any 'b' or 'd' line".to_owned()))?;
                series.files.push(path.parent().unwrap_or(Path::new("")).join(name));
            }
            _ => {
                let expected = "expected 'b NANOSECONDS PHOTONS', 'd NANOSECONDS' or 'i FILE'";
                return Err(wrong(format!("'{}' cannot be read, {expected}", line.trim())));
            }
        }
    }
    Ok(found)
}

fn series_by_name(folder: &Path) -> Result<Vec<FileSeries>, PipelineError> {
    let unreadable = |e: std::io::Error| PipelineError::Read { path: folder.to_owned(), reason: e.to_string() };
    let mut groups: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let is_picture = path
            .extension()
            .is_some_and(|e| ["png", "tif", "tiff", "dng"].contains(&e.to_string_lossy().to_lowercase().as_str()));
        if is_picture && (stem.starts_with("dark") || stem.starts_with("flat")) {
            let group = stem.rsplit_once(['-', '_']).map_or(stem.as_str(), |(group, _)| group);
            groups.entry(group.to_owned()).or_default().push(path);
        }
    }
    if groups.is_empty() {
        let reason = format!("it holds neither {DESCRIPTOR_FILE} nor PNG, TIFF or DNG frames named dark… and flat…");
        return Err(PipelineError::Read { path: folder.to_owned(), reason });
    }
    Ok(groups
        .into_iter()
        .map(|(name, mut files)| {
            files.sort();
            let photons = name.starts_with("dark").then_some(0.0);
            FileSeries { time_s: None, photons, files }
        })
        .collect())
}

/// Reads a frame of digital numbers.
pub(crate) fn read_frame(path: &Path) -> Result<Noted<Array2<f32>>, PipelineError> {
    if let Some(file) = read_dng(path)? {
        let wrong = |reason: &str| PipelineError::Read { path: path.to_owned(), reason: reason.to_owned() };
        return match file.raw.dn() {
            Some(dn) => Ok(Noted::new(dn.mapv(f32::from), [])),
            None => Err(wrong("its raw frame is no single plane of digital numbers, expected a mosaic or one filter")),
        };
    }
    let wrong = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    read_picture_samples(path)?.try_map(|samples| match (samples.top, samples.planes.len()) {
        (None, _) => Err(wrong("its samples are not whole numbers, expected a gray PNG or TIFF".to_owned())),
        (Some(_), 1) => Ok(samples.planes.into_iter().next().expect("there is one plane").1),
        (Some(_), n) => Err(wrong(format!("it has {n} channels, expected a gray PNG or TIFF"))),
    })
}

/// Writes a descriptor: for each series its exposure time, s, photons and files.
pub(crate) fn descriptor(bits: u32, side: usize, series: &[FileSeries]) -> String {
    let mut text = format!("v 3.1\nn {bits} {side} {side}\n");
    for FileSeries { time_s, photons, files } in series {
        let time_ns = 1e9 * time_s.unwrap_or(0.0);
        let opened = match photons {
            Some(photons) if *photons > 0.0 => writeln!(text, "b {time_ns:.0} {photons:.6}"),
            _ => writeln!(text, "d {time_ns:.0}"),
        };
        let listed = files.iter().try_for_each(|file| writeln!(text, "i {}", file.display()));
        opened.and(listed).expect("text can be added to text");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_descriptor_reads_back() {
        let series = |photons, names: [&str; 2]| FileSeries {
            time_s: Some(0.01),
            photons: Some(photons),
            files: names.map(PathBuf::from).to_vec(),
        };
        let written = [series(0.0, ["dark-0.png", "dark-1.png"]), series(1234.5, ["flat-1-0.png", "flat-1-1.png"])];
        let text = descriptor(12, 512, &written);
        assert_eq!(parse(&text, Path::new("descriptor.txt")).unwrap(), written);
    }

    #[test]
    fn a_wrong_line_is_named() {
        let message = |text: &str| parse(text, Path::new("d.txt")).unwrap_err().to_string();
        assert!(message("v 3.1\nb 10 many\n").contains("d.txt:2: 'many'"));
        assert!(message("i frame.png\n").contains("before any"));
        assert!(message("# words\nflat 7\n").contains("d.txt:2: 'flat 7'"));
    }

    #[test]
    fn names_make_series() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["dark_0.png", "dark_1.png", "flat_03_0.png", "flat_03_1.png", "flat_12_0.tif", "notes.txt"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let series = find_series(folder.path()).unwrap();
        let sizes: Vec<_> = series.iter().map(|s| (s.photons, s.files.len())).collect();
        assert_eq!(sizes, [(Some(0.0), 2), (None, 2), (None, 1)]);
        let empty = tempfile::tempdir().unwrap();
        assert!(find_series(empty.path()).unwrap_err().to_string().contains("dark"));
    }
}
