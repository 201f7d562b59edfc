//! A folder with one gray picture a band, as in the CAVE database.

use std::{
    fs,
    path::{Path, PathBuf},
};

use dioptric_files::text;
use rayon::prelude::*;

use super::{
    contents::Cube,
    gray_picture::{GrayPicture, read_gray},
    read_options::ReadOptions,
    reading::FileQuantity,
    stated::{merged, name_of, note_of, short},
    tiff_file::TiffAs,
    unusable::unreadable,
    wavelength_unit::{PLAUSIBLE_NM, listed_nm, unit_in},
};
use crate::SceneError;

/// Names of a text file with the wavelengths of numbered pictures, nm.
const LISTS: [&str; 2] = ["wavelengths.txt", "wavelengths.csv"];

/// Endings of pictures that are no bands.
const OTHERS: [&str; 10] = ["bmp", "jpg", "jpeg", "webp", "ppm", "pgm", "pnm", "exr", "hdr", "pfm"];

/// Words before the numbers of pictures that are no bands, among pictures of another name.
const NO_BANDS: [&str; 14] = [
    "ref",
    "reference",
    "white",
    "dark",
    "flat",
    "mask",
    "depth",
    "thumb",
    "thumbnail",
    "preview",
    "rgb",
    "img",
    "photo",
    "dsc",
];

/// Files that systems leave in folders.
const OF_SYSTEMS: [&str; 2] = ["thumbs.db", "desktop.ini"];

/// Reads a folder of gray PNG or TIFF pictures, one a band, whose codes are linear, or floats.
///
/// Names end in the wavelength in nm (`toys_400.png`, `toys-400.5nm.png`) or in a number (`toys_ms_01.png`). Numbered
/// pictures take their wavelengths, in the order of their numbers, from those told, from a file `wavelengths.txt` in
/// the folder (nm, separated by anything), or, when there are 31 named `…_ms_NN`, from CAVE's 400–700 nm every 10 nm.
///
/// # Errors
/// When there is no such picture, wavelengths are missing, or the pictures differ in size.
pub(super) fn band_folder(folder: &Path, options: &ReadOptions) -> Result<Cube, SceneError> {
    let reading = &options.reading;
    let told_nm = reading.wavelengths_nm.as_deref();
    // What one code stands for holds of those of any bits.
    let is_code_told = options.white_level.is_some()
        || reading.scale.is_some()
        || reading.unit.is_some()
        || reading.quantity.is_some_and(|quantity| quantity != FileQuantity::Reflectance);
    let Listing { pictures, unused, files } = listing(folder, told_nm.map(<[f64]>::len))?;
    if pictures.is_empty() {
        return Err(SceneError::NoBands {
            file: folder.to_owned(),
            expected: "PNG or TIFF pictures whose names end in a wavelength in nm or in a number",
        });
    }
    let notes = [note_of(folder, "picture", &unused), note_of(folder, "file", &files)];
    let mut notes: Vec<String> = notes.into_iter().flatten().collect();
    notes.extend(note_of_names(folder, &pictures));
    let wavelengths_nm = match (told_nm, wavelengths_of(folder, &pictures)) {
        (None, own) => {
            let own = own?;
            let named: Vec<f64> = pictures.iter().map(|(number, _)| *number).collect();
            let is_other = are_wavelengths(&named) && named != own;
            notes.extend(is_other.then(|| {
                format!(
                    "{}: the wavelengths in the names of its pictures are not used: its list has others",
                    name_of(folder)
                )
            }));
            own
        }
        (Some(told), own) => {
            let is_other = own.is_ok_and(|own| own != told);
            notes.extend(is_other.then(|| {
                format!(
                    "{}: other wavelengths were told than its names or its list have, which are not used",
                    name_of(folder)
                )
            }));
            told.to_vec()
        }
    };
    if wavelengths_nm.len() != pictures.len() {
        let reason = format!("{} pictures of bands, but {} wavelengths", pictures.len(), wavelengths_nm.len());
        return Err(unreadable(folder, reason));
    }
    let pictures: Vec<Numbered> =
        wavelengths_nm.iter().copied().zip(pictures.into_iter().map(|(_, path)| path)).collect();
    check_bands(folder, &pictures)?;
    let (mut grays, top) = grays_of(&pictures, &mut notes)?;
    let tops: Vec<f64> = grays.iter().filter_map(|gray| gray.top).collect();
    if let Some(other) = tops.iter().find(|own| Some(**own) != top) {
        let (name, top) = (name_of(folder), top.unwrap_or_default());
        let how = if is_code_told { "all are taken as they stand" } else { "each is counted of its own" };
        notes.push(format!("{name}: the largest codes of its pictures are {other} and {top}: {how}"));
    }
    if !is_code_told {
        grays.iter_mut().for_each(|gray| gray.stretch(top));
    }
    let planes = grays.into_iter().map(|gray| gray.values).collect();
    Ok(Cube {
        planes,
        top,
        wavelengths_nm: Some(wavelengths_nm),
        quantity: None,
        unit: None,
        called: None,
        packed: None,
        notes,
    })
}

/// Refuses two pictures of one wavelength, and one of none.
fn check_bands(folder: &Path, pictures: &[Numbered]) -> Result<(), SceneError> {
    for (index, (nm, path)) in pictures.iter().enumerate() {
        if let Some((_, other)) = pictures[..index].iter().find(|(own, _)| own == nm) {
            let reason =
                format!("{} and {} are both of {nm} nm: expected a picture a band", name_of(other), name_of(path));
            return Err(unreadable(folder, reason));
        }
        if !PLAUSIBLE_NM.contains(nm) {
            return Err(unreadable(path, format!("its band would lie at {nm} nm: expected a wavelength of light")));
        }
    }
    Ok(())
}

/// Returns all pictures, and the largest code that there can be in any of them.
fn grays_of(pictures: &[Numbered], notes: &mut Vec<String>) -> Result<(Vec<GrayPicture>, Option<f64>), SceneError> {
    let read: Result<Vec<_>, _> =
        pictures.par_iter().map(|(_, path)| read_gray(path, TiffAs::Planes(None), None)).collect();
    let mut told = vec![];
    let mut grays = vec![];
    for (noted, (own_nm, path)) in read?.into_iter().zip(pictures) {
        let mut own = vec![];
        let mut gray = noted.told_in(&mut own);
        gray.page.count_from_black(&mut gray.values, gray.top);
        let stated_nm = gray.wavelength_nm.filter(|nm| (nm - own_nm).abs() > 0.5);
        own.extend(stated_nm.map(|nm| format!("{}: its wavelength, {nm} nm, is not used", name_of(path))));
        told.push((path.clone(), own));
        grays.push(gray);
    }
    notes.extend(merged(told.into_iter()));
    // Where some are packed all are quantities, be their factor 1.
    if grays.iter().any(|gray| gray.page.packed.is_some()) {
        grays.iter_mut().for_each(|gray| gray.top = None);
    }
    let (rows, columns) = grays[0].values.dim();
    let other = grays.iter().zip(pictures).find(|(gray, _)| gray.values.dim() != (rows, columns));
    if let Some((gray, (_, path))) = other {
        let (own_rows, own_columns) = gray.values.dim();
        let reason = format!(
            "it is {own_columns} × {own_rows} samples, but {} {columns} × {rows}: expected bands of one size",
            name_of(&pictures[0].1)
        );
        return Err(unreadable(path, reason));
    }
    let top = grays
        .iter()
        .filter_map(|gray| gray.top)
        .fold(None, |top: Option<f64>, own| Some(top.map_or(own, |top| top.max(own))));
    if let Some(index) = grays.iter().position(|gray| gray.top.is_some() != top.is_some()) {
        let reason = "it holds floats, but others of the folder whole numbers: expected one kind";
        return Err(unreadable(&pictures[index].1, reason));
    }
    Ok((grays, top))
}

impl GrayPicture {
    /// Makes codes of fewer bits so many times as large.
    fn stretch(&mut self, top: Option<f64>) {
        if let (Some(own), Some(top)) = (self.top, top)
            && own < top
        {
            self.values.mapv_inplace(|code| (f64::from(code) * top / own) as f32);
            self.top = Some(top);
        }
    }
}

/// A picture with the number that its name ends in.
type Numbered = (f64, PathBuf);

/// What is in a folder.
#[derive(Default)]
struct Listing {
    /// The pictures whose names end in a number, in its order.
    pictures: Vec<Numbered>,
    /// The names of other pictures.
    unused: Vec<String>,
    /// The names of what else there is.
    files: Vec<String>,
}

/// Lists a folder, for which so many wavelengths may be told.
fn listing(folder: &Path, n_told: Option<usize>) -> Result<Listing, SceneError> {
    let entries = fs::read_dir(folder).map_err(|error| unreadable(folder, error))?;
    let Listing { mut pictures, mut unused, mut files } = Listing::default();
    for entry in entries {
        let path = entry.map_err(|error| unreadable(folder, error))?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let name = name_of(&path).to_lowercase();
        let is_known = [&LISTS[..], &OF_SYSTEMS].iter().any(|known| known.contains(&name.as_str()))
            || ["readme", "license"].iter().any(|start| name.starts_with(start));
        if name.starts_with('.') || is_known {
            continue;
        }
        if path.is_dir() || !matches!(extension.as_str(), "png" | "tif" | "tiff") {
            let is_picture = OTHERS.contains(&extension.as_str());
            (if is_picture { &mut unused } else { &mut files }).push(name_of(&path));
            continue;
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        match number_at_end(&stem) {
            Some(number) => pictures.push((number, path)),
            None => unused.push(name_of(&path)),
        }
    }
    if !LISTS.iter().any(|name| folder.join(name).is_file()) {
        let odd = without_wavelengths(&mut pictures, n_told);
        unused.extend(odd.iter().map(|(_, path)| name_of(path)));
    }
    // Bands are called alike before their numbers: one of another name with the number of a year is none of them, nor are those whose name says so.
    let starts: Vec<String> = pictures.iter().map(|(_, path)| start(path)).collect();
    let n_called = |own: &String| starts.iter().filter(|start| *start == own).count();
    if starts.iter().map(n_called).max().is_some_and(|most| most > 2 && 2 * most > starts.len()) {
        let is_odd = |(nm, path): &Numbered| {
            let own = start(path);
            let last = own.rsplit(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_lowercase();
            let is_named = NO_BANDS.contains(&last.as_str()) && 2 * n_called(&own) < starts.len();
            // What is of a wavelength that one of the usual name has is a copy or a part of it.
            let is_twin = pictures.iter().any(|(other, path)| other == nm && n_called(&start(path)) > n_called(&own));
            is_named || is_twin || n_called(&own) == 1 && (1990.0..2100.0).contains(nm)
        };
        let (odd, bands): (Vec<Numbered>, _) = pictures.iter().cloned().partition(is_odd);
        unused.extend(odd.iter().map(|(_, path)| name_of(path)));
        pictures = bands;
    }
    pictures.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    unused.sort();
    files.sort();
    Ok(Listing { pictures, unused, files })
}

/// Returns what a picture is called before its number, or its range.
fn start(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let is_number = |c: char| c.is_ascii_digit() || "._- ".contains(c);
    let mut own = stem.trim_end_matches(is_number);
    // Units, and words of ranges, stand behind numbers.
    while let Some(rest) = own.strip_suffix("nm").or_else(|| own.strip_suffix("to")) {
        if !rest.trim_end_matches(['_', '-', ' ']).ends_with(|c: char| c.is_ascii_digit()) {
            break;
        }
        own = rest.trim_end_matches(is_number);
    }
    own.to_owned()
}

/// Takes out the few pictures whose numbers are no wavelengths, as copies (`b_450_1`) and dates have them, where those of most are and lie closer to
/// each other than to them, so that they are no numbers of frames; and are as many as are told.
fn without_wavelengths(pictures: &mut Vec<Numbered>, n_told: Option<usize>) -> Vec<Numbered> {
    let is_odd = |(number, _): &Numbered| !are_wavelengths(&[*number]);
    let mut bands: Vec<f64> = pictures.iter().filter(|own| !is_odd(own)).map(|(number, _)| *number).collect();
    bands.sort_by(f64::total_cmp);
    let (Some(&first), Some(&last)) = (bands.first(), bands.last()) else { return vec![] };
    let widest = bands.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    let is_apart = |(number, _): &Numbered| (first - number).max(number - last) > widest;
    let are_few = bands.len() > 1 && 2 * bands.len() > pictures.len() && n_told.is_none_or(|n| n == bands.len());
    if !are_few || !pictures.iter().filter(|own| is_odd(own)).all(is_apart) {
        return vec![];
    }
    pictures.extract_if(.., |own| is_odd(own)).collect()
}

/// Returns what is said of bands of several names, of which some may be no bands.
fn note_of_names(folder: &Path, pictures: &[Numbered]) -> Option<String> {
    let mut named: Vec<(String, usize)> = vec![];
    for (_, path) in pictures {
        let own = start(path);
        match named.iter_mut().find(|(name, _)| *name == own) {
            Some((_, n)) => *n += 1,
            None => named.push((own, 1)),
        }
    }
    // Where each has a name of its own these are the names of bands.
    if named.len() < 2 || named.iter().all(|(_, n)| *n == 1) {
        return None;
    }
    let shown: Vec<String> =
        named.iter().take(MOST_STARTS).map(|(name, n)| format!("{n} '{}…'", short(name))).collect();
    let more = if named.len() > MOST_STARTS { " and others" } else { "" };
    Some(format!("{}: its pictures are called {}{more}: all are taken for bands", name_of(folder), shown.join(", ")))
}

/// Names before numbers that a note holds.
const MOST_STARTS: usize = 6;

/// Returns the middle of the range of wavelengths that a stem ends in, as `b_445-455`, `b_445nm_455` or `b_445to455`: none wider than a filter's.
fn middle_of_range(stem: &str) -> Option<f64> {
    let range = |sign: &&str| {
        let (before, last) = stem.rsplit_once(*sign)?;
        let first = before.rsplit(|c: char| !c.is_ascii_digit() && c != '.').next()?;
        let (first, last) = (first.parse::<f64>().ok()?, last.parse::<f64>().ok()?);
        (are_wavelengths(&[first, last]) && last > first && last - first <= MOST_NM).then_some(0.5 * (first + last))
    };
    ["-", "to", "_to_", "nm_", "nm-", "nmto", "nm_to_"].iter().find_map(range)
}

/// Returns the middles of ranges that the names of all pictures end in, as `b_445_455`, where they are of one width: two numbers may also count a picture
/// and be its wavelength.
fn middles_of_ranges(pictures: &[(f64, PathBuf)]) -> Option<Vec<f64>> {
    let range = |(last, path): &(f64, PathBuf)| {
        let stem = path.file_stem()?.to_str()?;
        let (before, _) = stem.strip_suffix("nm").unwrap_or(stem).rsplit_once('_')?;
        let first: f64 = before.rsplit('_').next()?.parse().ok()?;
        (are_wavelengths(&[first, *last]) && *last > first).then_some([first, *last])
    };
    let ranges: Vec<[f64; 2]> = pictures.iter().map(range).collect::<Option<_>>()?;
    let width = ranges.first().map(|[first, last]| last - first)?;
    let are_alike = ranges.iter().all(|[first, last]| (last - first - width).abs() <= 1.0);
    (ranges.len() > 1 && are_alike && width <= MOST_NM)
        .then(|| ranges.iter().map(|[first, last]| 0.5 * (first + last)).collect())
}

/// The widest range of a filter.
const MOST_NM: f64 = 100.0;

/// Returns the number that a stem ends in, before an optional `nm`.
fn number_at_end(stem: &str) -> Option<f64> {
    let stem = stem.strip_suffix("nm").map_or(stem, |own| own.trim_end_matches(['_', '-', ' ']));
    if let Some(middle) = middle_of_range(stem) {
        return Some(middle);
    }
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.').len();
    stem[stem.len() - digits..].trim_start_matches('.').parse().ok()
}

/// Whether the numbers that names end in are wavelengths, nm.
fn are_wavelengths(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| (150.0..=20_000.0).contains(number))
}

/// Returns the wavelengths of a list, nm, in the order of pictures: of lines that name pictures each is that of its own; `None` where they count bands.
fn listed(text: &str, pictures: &[Numbered]) -> Result<Option<Vec<f64>>, String> {
    let is_separator = |c: char| c.is_whitespace() || c == ',' || c == ';';
    let mut unit =
        text.split(|c| "()[]#:=;,".contains(c) || char::is_whitespace(c)).find_map(unit_in).map(str::to_owned);
    let (mut named, mut numbers, mut has_letter) = (vec![], vec![], false);
    // Comments may tell the unit, their numbers are others.
    for line in text.lines().map(|line| line.split('#').next().unwrap_or_default()) {
        let found = named_in(line, pictures);
        let rest = found.as_ref().map_or(line.to_owned(), |(_, name)| line.replacen(name, " ", 1));
        let n_before = numbers.len();
        for word in rest.split(is_separator) {
            // A unit may stand behind a number without a gap.
            let (number, behind) = word.split_at(word.trim_end_matches(char::is_alphabetic).len());
            let own = unit_in(behind).filter(|_| !number.is_empty());
            numbers.extend(own.map_or(word, |_| number).parse::<f64>().ok());
            unit = unit.or(own.map(str::to_owned));
            has_letter |= word == "A";
        }
        match (found, numbers.len() - n_before) {
            (Some((index, _)), 1) => named.push(index),
            (Some((_, name)), n) => return Err(format!("its line of '{name}' has {n} numbers, expected a wavelength")),
            (None, _) => {}
        }
    }
    // A single letter, behind every number, of which none is another's.
    let is_letter = has_letter && numbers.iter().all(|own| *own >= 1500.0);
    let own = listed_nm("wavelengths", unit.as_deref().or(is_letter.then_some("A")), &numbers)?;
    let Some(own) = own else { return Ok(None) };
    if named.is_empty() {
        return Ok(Some(own));
    }
    let in_turn = |index: usize| Some(own[named.iter().position(|of| *of == index)?]);
    let in_turn: Option<Vec<f64>> = (0..pictures.len()).map(in_turn).collect();
    let is_whole = named.len() == own.len() && own.len() == pictures.len();
    in_turn.filter(|_| is_whole).map(Some).ok_or_else(|| {
        format!("it names pictures in {} lines, expected the {} of bands, each once", named.len(), pictures.len())
    })
}

/// Returns the picture that a line names, whatever its ending, and the name; a number alone is no name.
fn named_in(line: &str, pictures: &[Numbered]) -> Option<(usize, String)> {
    let is_of_name = |c: char| c.is_alphanumeric() || "_-".contains(c);
    let stands = |name: &str| {
        let is_apart = |(at, _): (usize, &str)| {
            !line[..at].ends_with(is_of_name) && !line[at + name.len()..].starts_with(is_of_name)
        };
        line.match_indices(name).any(is_apart)
    };
    let names = pictures.iter().enumerate().flat_map(|(index, (_, path))| {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let stem = stem.filter(|stem| stem.parse::<f64>().is_err() && unit_in(stem).is_none());
        stem.into_iter().chain([name_of(path)]).map(move |name| (index, name))
    });
    names.filter(|(_, name)| stands(name)).max_by_key(|(_, name)| name.len())
}

fn wavelengths_of(folder: &Path, pictures: &[(f64, PathBuf)]) -> Result<Vec<f64>, SceneError> {
    if let Some(list) = LISTS.iter().map(|name| folder.join(name)).find(|path| path.is_file()) {
        let text = text::read(&list).map_err(|error| unreadable(&list, error))?;
        let own = listed(&text::with_commas(&text), pictures).map_err(|reason| unreadable(&list, reason))?;
        return own.ok_or_else(|| unreadable(&list, "its numbers count bands: expected wavelengths in nm"));
    }
    if let Some(middles) = middles_of_ranges(pictures) {
        return Ok(middles);
    }
    let numbers: Vec<f64> = pictures.iter().map(|(number, _)| *number).collect();
    if are_wavelengths(&numbers) {
        return Ok(numbers);
    }
    let is_cave = |path: &PathBuf| path.file_stem().is_some_and(|stem| stem.to_string_lossy().contains("_ms_"));
    if pictures.len() == 31 && pictures.iter().all(|(_, path)| is_cave(path)) {
        return Ok((0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect());
    }
    Err(SceneError::NoBands {
        file: folder.to_owned(),
        expected: "a file wavelengths.txt with the wavelength in nm of each numbered picture",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FileReading, formats::contents::Image};
    use dioptric_pictures::save;
    use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
    use image::{ImageBuffer, Luma};

    fn read_band_folder(folder: &Path, told_nm: Option<&[f64]>) -> Result<SpectralImage, SceneError> {
        let wavelengths_nm = told_nm.map(<[f64]>::to_vec);
        let options =
            ReadOptions { reading: FileReading { wavelengths_nm, ..FileReading::default() }, ..ReadOptions::default() };
        match band_folder(folder, &options)?.into_contents(folder, &options)?.image {
            Image::Spectral(image) => Ok(image),
            _ => panic!("a picture"),
        }
    }

    fn folder_of(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (i, name) in names.iter().enumerate() {
            let picture = ImageBuffer::from_pixel(3, 2, Luma([100 * (i as u16 + 1)]));
            save(&picture.into(), &folder.path().join(name)).unwrap();
        }
        fs::write(folder.path().join("readme.md"), "not a picture").unwrap();
        folder
    }

    #[test]
    fn lists_go_by_the_names_of_pictures() {
        let folder = folder_of(&["b1.png", "b2.png", "b10.png"]);
        let read = |text: &str| {
            fs::write(folder.path().join("wavelengths.txt"), text).unwrap();
            read_band_folder(folder.path(), None).map(|image| image.grid().centers_nm().to_vec())
        };
        // Codes of 100, 200 and 300.
        for text in [
            "# exposure 10 ms\nb1.png 450\nb10.png 560\nb2.png 500\n",
            "b10 560 nm\nb2 500 nm\nb1 450 nm\n",
            "file,wavelength_nm\n./b1.png,450\n./b2.png,500\n./b10.png,560\n",
            "450nm\n500nm\n560nm\n",
            "0.45um b1.png\n0.56um b10.png\n0.5um b2.png\n",
            "# filter 3 of 10, in nm\n450 500 560 # 10 wide\n",
        ] {
            assert_eq!(read(text).unwrap(), [450.0, 500.0, 560.0], "{text}");
            let image = read_band_folder(folder.path(), None).unwrap();
            assert_eq!(
                image.spectrum_at(1, 2),
                [100.0, 200.0, 300.0].map(|code: f32| f64::from(code / 65535.0)),
                "{text}"
            );
        }
        for (text, word) in [
            ("b1.png 450\nb2.png 500\n", "names pictures in 2 lines"),
            ("b1.png 450\nb2.png 500\nb2.png 560\n", "each once"),
            ("b1.png 450 10\nb2.png 500 10\nb10.png 560 10\n", "has 2 numbers"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
    }

    #[test]
    fn wavelengths_come_from_the_names() {
        let folder = folder_of(&["toys_1000_nm.png", "toys_400.5nm.png", "toys-550.png", "preview.png"]);
        let image = read_band_folder(folder.path(), None).unwrap();
        assert_eq!(image.grid().centers_nm(), [400.5, 550.0, 1000.0]);
        assert_eq!(image.quantity(), Quantity::Reflectance);
        let expected = [200.0, 300.0, 100.0].map(|code: f32| f64::from(code / 65535.0));
        assert_eq!(image.spectrum_at(1, 2), expected);
    }

    #[test]
    fn names_of_ranges_are_those_of_their_middles() {
        for (names, expected) in [
            (["b_445_455.png", "b_495_505.png"], [450.0, 500.0]),
            (["b_445_455nm.png", "b_495_505nm.png"], [450.0, 500.0]),
            // Photographs 450 and 451, and a scene called 400.
            (["p_450_500.png", "p_451_510.png"], [500.0, 510.0]),
            (["a_400_450.png", "a_400_500.png"], [450.0, 500.0]),
        ] {
            let image = read_band_folder(folder_of(&names).path(), None).unwrap();
            assert_eq!(image.grid().centers_nm(), expected, "{names:?}");
        }
    }

    #[test]
    fn files_beside_the_bands_are_named() {
        let folder = folder_of(&["a_450.png", "a_550.png", "depth.png"]);
        for name in ["exposure.json", "README.txt", "wavelengths.csv"] {
            fs::write(folder.path().join(name), "450, 550").unwrap();
        }
        let notes = band_folder(folder.path(), &ReadOptions::default()).unwrap().notes.join(" ");
        let named = ["'depth.png'", "'exposure.json'", "readme.md", "README.txt", "wavelengths.csv"];
        assert_eq!(named.map(|name| notes.contains(name)), [true, true, false, false, false], "{notes}");
    }

    #[test]
    fn a_picture_of_another_name_is_no_band() {
        for (names, n_bands) in [
            (&["b_450.png", "b_500.png", "b_560.png", "photo_2024.png"][..], 3),
            (&["blue_450.png", "green_550.png", "red_650.png"], 3),
            (&["b_450.png", "b_500.png", "b_560.png", "ref_700.png", "ref_800.png"], 3),
            (&["b_450.png", "b_500.png", "b_560.png", "Copy of b_450.png", "ref_700.png"], 3),
            (&["ref_450.png", "ref_500.png", "ref_560.png", "b_700.png"], 4),
            (&["vis_450.png", "vis_500.png", "vis_560.png", "nir_850.png"], 4),
            (&["vis_450.png", "vis_550.png", "vis_650.png", "nir_850.png", "nir_900.png"], 5),
        ] {
            let folder = folder_of(names);
            let cube = band_folder(folder.path(), &ReadOptions::default()).unwrap();
            let notes = cube.notes.join(" ");
            assert_eq!(cube.planes.len(), n_bands, "{names:?}");
            let is_named = ["photo_2024", "ref_700"].iter().any(|own| notes.contains(&format!("'{own}.png'")));
            assert_eq!(is_named, n_bands < names.len(), "{names:?}");
            // What may be a stranger is named.
            assert_eq!(notes.contains("'nir…'"), names.contains(&"nir_850.png"), "{notes}");
        }
    }

    #[test]
    fn a_number_that_is_no_wavelength_is_left_out() {
        let bands = ["b_450.png", "b_500.png", "b_560.png"];
        for odd in ["b_450_1.png", "b_450-2.png", "b_1.png", "b_0.png", "2024-05-01.png", "b_20240501.png"] {
            let folder = folder_of(&[&bands[..], &[odd]].concat());
            let cube = band_folder(folder.path(), &ReadOptions::default()).unwrap();
            assert_eq!(cube.wavelengths_nm.as_deref(), Some(&[450.0, 500.0, 560.0][..]), "{odd}");
            assert!(cube.notes.iter().any(|note| note.contains(odd)), "{:?}", cube.notes);
        }
        // Numbers of frames, of which most could be wavelengths.
        let frames: Vec<String> = (1..=9).map(|i| format!("b_{}.png", 100 * i)).collect();
        let folder = folder_of(&frames.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(read_band_folder(folder.path(), None).unwrap_err().to_string().contains("wavelengths.txt"));
    }

    #[test]
    fn a_level_is_one_of_codes_of_any_bits() {
        let folder = folder_of(&["a_450.png"]);
        save(&ImageBuffer::from_pixel(3, 2, Luma([10_u8])).into(), &folder.path().join("a_550.png")).unwrap();
        let of = |white_level: Option<f64>| {
            let options = ReadOptions { white_level, ..ReadOptions::default() };
            let contents =
                band_folder(folder.path(), &options).unwrap().into_contents(folder.path(), &options).unwrap();
            let Image::Spectral(image) = contents.image else { panic!("a picture") };
            (image.spectrum_at(0, 0), contents.notes.join(" "))
        };
        let (told, own) = (of(Some(1000.0)), of(None));
        assert_eq!(told.0.iter().map(|v| *v as f32).collect::<Vec<_>>(), [0.1, 0.01]);
        assert_eq!(own.0.iter().map(|v| *v as f32).collect::<Vec<_>>(), [100.0 / 65535.0, 10.0 / 255.0]);
        assert!(told.1.contains("255 and 65535: all are") && own.1.contains("each is counted"), "{} {}", told.1, own.1);
    }

    #[test]
    fn what_is_counted_from_white_is_the_light_of_a_stack() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("bands")).unwrap();
        let write = |path: &Path, n: usize| {
            let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
            for _ in 0..n {
                let mut page = encoder.new_image::<tiff::encoder::colortype::Gray16>(2, 1).unwrap();
                page.encoder().write_tag(tiff::tags::Tag::PhotometricInterpretation, 0_u16).unwrap();
                page.encoder().write_tag(tiff::tags::Tag::GdalNodata, "9999").unwrap();
                page.write_data(&[1000, 9999]).unwrap();
            }
        };
        write(&path("bands/b_450.tif"), 1);
        write(&path("bands/b_550.tif"), 1);
        write(&path("stack.tif"), 2);
        let no_data = Some(crate::NoData::Black);
        let wavelengths_nm = Some(vec![450.0, 550.0]);
        let quantity = Some(FileQuantity::Reflectance);
        let reading = FileReading { no_data, wavelengths_nm, quantity, ..FileReading::default() };
        let options = ReadOptions { reading, ..ReadOptions::default() };
        for name in ["bands", "stack.tif"] {
            let contents = crate::formats::read_contents::contents_of(&path(name), &options).unwrap();
            let Image::Spectral(image) = contents.image else { panic!("{name}: a picture") };
            for (column, expected) in [(0, 64_535.0_f32 / 65_535.0), (1, 0.0)] {
                assert_eq!(image.spectrum_at(0, column), [f64::from(expected); 2], "{name}, {column}");
            }
        }
    }

    #[test]
    fn numbered_pictures_need_a_list() {
        let folder = folder_of(&["b_1.png", "b_2.png", "b_10.png"]);
        assert!(read_band_folder(folder.path(), None).unwrap_err().to_string().contains("wavelengths.txt"));
        let image = read_band_folder(folder.path(), Some(&[500.0, 600.0, 700.0])).unwrap();
        assert!(image.spectrum_at(0, 0)[2] > image.spectrum_at(0, 0)[1]);
        fs::write(folder.path().join("wavelengths.txt"), "wavelength_nm\n450\n550\n650\n").unwrap();
        assert_eq!(read_band_folder(folder.path(), None).unwrap().grid().centers_nm(), [450.0, 550.0, 650.0]);
        fs::write(folder.path().join("wavelengths.txt"), "450, 550").unwrap();
        assert!(read_band_folder(folder.path(), None).unwrap_err().to_string().contains("3 pictures"));
    }

    #[test]
    fn ranges_and_units_of_wavelengths_are_obeyed() {
        for names in [
            ["b_445-455nm.png", "b_555-565nm.png"],
            ["b_445nm_455nm.png", "b_555nm_565nm.png"],
            ["photo_445to455nm.png", "photo_555to565nm.png"],
        ] {
            let folder = folder_of(&names);
            assert_eq!(read_band_folder(folder.path(), None).unwrap().grid().centers_nm(), [450.0, 560.0], "{names:?}");
        }
        let folder = folder_of(&["b_1.png", "b_2.png"]);
        for text in ["Angstrom\n4500\n5600\n", "4500 A\n5600 A\n", "# um\n0,45;0,56", "wavelength (nm)\n450\n560\n"] {
            fs::write(folder.path().join("wavelengths.txt"), text).unwrap();
            let image = read_band_folder(folder.path(), None).unwrap();
            assert_eq!(image.grid().centers_nm(), [450.0, 560.0], "{text}");
        }
    }

    #[test]
    fn cave_is_known_by_its_names() {
        let names: Vec<String> = (1..=31).map(|i| format!("toys_ms_{i:02}.png")).collect();
        let folder = folder_of(&names.iter().map(String::as_str).collect::<Vec<_>>());
        let image = read_band_folder(folder.path(), None).unwrap();
        assert_eq!(image.grid(), &WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap());
    }

    #[test]
    fn a_folder_without_bands_or_of_two_sizes_is_refused() {
        let folder = folder_of(&[]);
        assert!(read_band_folder(folder.path(), None).unwrap_err().to_string().contains("no spectral band"));
        let folder = folder_of(&["a_400.png"]);
        save(&ImageBuffer::from_pixel(9, 9, Luma([1_u8])).into(), &folder.path().join("a_500.png")).unwrap();
        assert!(read_band_folder(folder.path(), None).unwrap_err().to_string().contains("expected bands of one size"));
        let folder = folder_of(&["a_400.png"]);
        let colored = ImageBuffer::from_pixel(4, 3, image::Rgb([200_u8, 20, 100]));
        save(&colored.into(), &folder.path().join("a_500.png")).unwrap();
        assert!(read_band_folder(folder.path(), None).unwrap_err().to_string().contains("it has colors"));
    }
}
