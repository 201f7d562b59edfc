//! The parts of pictures' files besides their pixels: what of them would change the scene and is not used.

use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use dioptric_pictures::{Exif, StatedColors, orientation_of, size_of, xmp_properties};
use flate2::read::ZlibDecoder;
use image::{
    codecs::pnm::{PnmSubtype, SampleEncoding},
    metadata::Orientation,
};

use super::{
    stated::{name_of, note_of, short, tells},
    tiff_directory::is_tiff,
    unusable::unreadable,
};
use crate::SceneError;

/// Chunks of PNG that are used, or say how the pixels lie in the file, when they were made or what is printed.
const USED_CHUNKS: [&[u8; 4]; 16] = [
    b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS", b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"cICP", b"sBIT", b"bKGD",
    b"hIST", b"tIME", b"eXIf", b"sPLT",
];
/// Those of them that say what the codes are, and what cameras write: the first counts, before the pixels.
const FIRST_CHUNKS: [&[u8; 4]; 6] = [b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"cICP", b"eXIf"];
/// Words of text chunks that change nothing (PNG, third edition, 11.3.3.1), and those of common programs.
const USUAL_WORDS: [&str; 14] = [
    "Title",
    "Author",
    "Description",
    "Copyright",
    "Creation Time",
    "Software",
    "Disclaimer",
    "Warning",
    "Source",
    "Comment",
    "XML:com.adobe.xmp",
    "date:create",
    "date:modify",
    "date:timestamp",
];
/// Parts that are looked at: files of more are animations.
const MOST_PARTS: usize = 10_000;
/// Bytes of a part that are looked at.
const MOST_BYTES: u64 = 65_536;

/// Returns what of the parts of a picture's file, and of its Exif data, is not used, a sentence each.
///
/// # Errors
/// When the file cannot be opened, or is a JPEG file without an end, whose missing pixels decoders make up.
pub(super) fn notes_on_parts(path: &Path) -> Result<Vec<String>, SceneError> {
    // What pages of a TIFF file state is said of them.
    let exif = (!is_tiff(path)).then(|| note_on_exif(path, true)).flatten();
    Ok(note_of(path, "part", &unknown_parts(path)?).into_iter().chain(exif).collect())
}

/// Returns what is said of colors that the Exif data state to be others than those that the codes are taken for.
pub(super) fn note_on_exif_colors(path: &Path, taken: Option<&StatedColors>) -> Option<String> {
    let space = Exif::of(path).other_colors.filter(|_| taken.is_none() && !StatedColors::are_in_chunks(path))?;
    let what = match space {
        2 => "Adobe RGB",
        65_535 => "uncalibrated colors",
        _ => "colors that nobody here knows",
    };
    Some(format!(
        "{}: its Exif data state {what} (ColorSpace {space}), and no profile is there: its codes are taken for those of sRGB",
        name_of(path)
    ))
}

/// Returns what is said of the orientation of a picture whose pixels lie as stored.
pub(super) fn note_of_orientation(path: &Path) -> Option<String> {
    let own = orientation_of(path);
    let words = || format!("{}: its orientation, {} (Exif), is not used", name_of(path), own.to_exif());
    (own != Orientation::NoTransforms).then(words)
}

/// Returns what the Exif data state of light, and of geometry where that counts, that is not used.
pub(super) fn note_on_exif(path: &Path, of_scene: bool) -> Option<String> {
    let exif = Exif::of(path);
    if exif.is_damaged {
        return Some(format!("{}: its Exif data are damaged: not all that they state is used", name_of(path)));
    }
    // A cube has no size of a picture.
    let fov_deg = size_of(path).ok().and_then(|(columns, rows)| {
        let is_turned = orientation_of(path).to_exif() > 4;
        let (columns, rows) = if is_turned { (rows, columns) } else { (columns, rows) };
        exif.horizontal_fov_deg(columns, rows)
    });
    let wide = fov_deg.map_or_else(String::new, |deg| format!(", with which it would be {deg:.1}° wide (--fov-deg)"));
    let on_film = exif.focal_on_film_mm.map(|mm| format!("{mm} mm on 35 mm film{wide}"));
    let stated: Vec<String> = [
        exif.focal_mm.filter(|_| of_scene).map(|mm| format!("a focal length of {mm} mm")),
        on_film.filter(|_| of_scene).map(|words| format!("a focal length of {words}")),
        exif.subject_distance_m.filter(|_| of_scene).map(|m| format!("a distance of {m} m (--depth-m)")),
        exif.gamma.map(|gamma| format!("a gamma of {gamma}")),
    ]
    .into_iter()
    .flatten()
    .collect();
    (!stated.is_empty()).then(|| format!("{}: its Exif data state {}: not used", name_of(path), stated.join(", ")))
}

/// Returns the names of the parts of a PNG, JPEG, WebP, BMP or PNM file that are not known; none of other files.
pub(super) fn unknown_parts(path: &Path) -> Result<Vec<String>, SceneError> {
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    let mut file = BufReader::new(file);
    let mut start = vec![];
    // What is shorter or broken is refused by whoever decodes it.
    if file.by_ref().take(MOST_BYTES).read_to_end(&mut start).is_err() {
        return Ok(vec![]);
    }
    let names = match start[..] {
        [0x89, b'P', b'N', b'G', ..] => file.seek(SeekFrom::Start(8)).and_then(|_| of_png(&mut file)),
        [0xff, 0xd8, ..] => {
            let names = file.seek(SeekFrom::Start(2)).and_then(|_| of_jpeg(&mut file));
            if names.as_ref().is_ok_and(Option::is_none) {
                return Err(unreadable(path, "the file ends too early (truncated)"));
            }
            names.map(Option::unwrap_or_default)
        }
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => {
            file.seek(SeekFrom::Start(12)).and_then(|_| of_webp(&mut file))
        }
        [b'B', b'M', ..] => Ok(of_bmp(&start)),
        [b'P', b'1'..=b'7', ..] => Ok(of_pnm(&start).into_iter().chain(behind_pnm(path)).collect()),
        _ => Ok(vec![]),
    };
    Ok(each_once(path, names.unwrap_or_default()))
}

/// Returns names of parts in their order, each once, without the name of a profile that is within.
fn each_once(path: &Path, mut names: Vec<String>) -> Vec<String> {
    names.retain(|name| !name.starts_with("photoshop:ICCProfile") || !matches!(StatedColors::of(path), Ok(Some(_))));
    names.sort();
    names.dedup();
    names
}

/// Returns what is said of the Exif and XMP data of a page of a TIFF file.
pub(super) fn notes_on_page(path: &Path, xmp: &[String], of_scene: bool) -> Vec<String> {
    let names = xmp.iter().flat_map(|text| of_xmp(text.as_bytes())).collect();
    note_of(path, "part", &each_once(path, names)).into_iter().chain(note_on_exif(path, of_scene)).collect()
}

/// What the names of parts call pixels that are not square.
const NOT_SQUARE: &str = "pixels that are not square";

/// Returns the name of a comment that says something of the numbers, and not who made them when.
pub(super) fn comment(text: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(text).trim().to_owned();
    tells(&text).then(|| format!("comment '{}'", short(&text)))
}

/// Prefixes of XMP data that say who made a picture when, with what and for whom, and how it was developed.
const HARMLESS_XMP: [&str; 40] = [
    "dc",
    "xmp",
    "xap",
    "xmpMM",
    "xapMM",
    "xmpRights",
    "xapRights",
    "xmpBJ",
    "xmpTPg",
    "xmpDM",
    "xmpG",
    "xmpNote",
    "stEvt",
    "stRef",
    "stFnt",
    "stDim",
    "stArea",
    "photoshop",
    "pdf",
    "pdfx",
    "illustrator",
    "Iptc4xmpCore",
    "Iptc4xmpExt",
    "plus",
    "lr",
    "aux",
    "exif",
    "exifEX",
    "tiff",
    "crs",
    "crd",
    "crss",
    "MicrosoftPhoto",
    "mwg-rs",
    "mwg-kw",
    "digiKam",
    "acdsee",
    "cc",
    "Container",
    "GCamera",
];

/// Returns the names of what phones, cameras and renderers put into XMP data.
fn of_xmp(content: &[u8]) -> Vec<String> {
    let of_property = |(name, value): (String, String)| {
        let value = value.as_str();
        // Exif's words for the view and the colors are used with Exif's own.
        let (prefix, own) = name.split_once(':')?;
        let what = match (prefix, own) {
            ("GDepth", _) | ("Device", "Camera") => "depth".to_owned(),
            ("GCamera", own) if own.starts_with("Depth") => "depth".to_owned(),
            ("hdrgm", _) => return Some("gain map (hdrgm)".to_owned()),
            ("HDRGainMap", _) => "gain map".to_owned(),
            ("GPano", _) => "panorama".to_owned(),
            // Containers of pictures say what each is for.
            ("Item", "Semantic") => match value {
                "Primary" | "MotionPhoto" => return None,
                "GainMap" => "gain map".to_owned(),
                own => own.to_lowercase(),
            },
            ("Item", _) => return None,
            // Programs turn a picture by Exif; 1 is upright.
            ("tiff", "Orientation") if value != "1" => format!("orientation {}", short(value)),
            ("photoshop", "ICCProfile") if !value.contains("sRGB") => format!("{name} '{}'", short(value)),
            (_, "ApproximateFocusDistance") => short(&name),
            ("crs", "AlreadyApplied") if !value.eq_ignore_ascii_case("true") => {
                "development that is not applied (crs)".to_owned()
            }
            (prefix, _) if HARMLESS_XMP.contains(&prefix) => return None,
            _ => short(&name),
        };
        Some(format!("{what} (XMP)"))
    };
    xmp_properties(content).into_iter().filter_map(of_property).collect()
}

/// Names what the header of a BMP file says of the shape of its pixels.
fn of_bmp(start: &[u8]) -> Vec<String> {
    let number = |at: usize| start.get(at..at + 4).map(|four| i32::from_le_bytes([four[0], four[1], four[2], four[3]]));
    match (number(38), number(42)) {
        (Some(across), Some(down)) if across > 0 && down > 0 && differ(across.into(), down.into()) => {
            vec![NOT_SQUARE.to_owned()]
        }
        _ => vec![],
    }
}

/// Whether two resolutions are not one.
pub(super) fn differ(across: f64, down: f64) -> bool {
    (across / down - 1.0).abs() > 0.01
}

/// Names the comments in the header of a PNM file, of which two or three numbers stand before its samples.
fn of_pnm(start: &[u8]) -> Vec<String> {
    let (mut names, mut n_numbers, mut rest) = (vec![], 0, &start[2..]);
    let n_wanted = if matches!(start[1], b'1' | b'4') { 2 } else { 3 };
    while n_numbers < n_wanted && !rest.is_empty() {
        let end = match rest[0] {
            b'#' => {
                let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
                names.extend(comment(&rest[1..end]));
                end
            }
            byte if byte.is_ascii_whitespace() => 1,
            _ => {
                n_numbers += 1;
                rest.iter().position(|byte| byte.is_ascii_whitespace() || *byte == b'#').unwrap_or(rest.len())
            }
        };
        rest = &rest[end..];
    }
    names
}

/// Names what follows the samples of a binary PNM picture: other pictures, as that format lets be put behind each other.
fn behind_pnm(path: &Path) -> Option<String> {
    let file = BufReader::new(File::open(path).ok()?);
    let (mut file, header) = image::codecs::pnm::PnmDecoder::new(file).ok()?.into_inner();
    let (columns, rows) = (u64::from(header.width()), u64::from(header.height()));
    let n_bytes = match header.subtype() {
        PnmSubtype::Bitmap(SampleEncoding::Binary) => columns.div_ceil(8).checked_mul(rows)?,
        subtype => {
            let n_samples = match subtype {
                PnmSubtype::Graymap(SampleEncoding::Binary) => 1,
                PnmSubtype::Pixmap(SampleEncoding::Binary) => 3,
                PnmSubtype::ArbitraryMap => header.as_arbitrary()?.depth.into(),
                _ => return None,
            };
            let n_bytes: u64 = if header.maximal_sample() > 255 { 2 } else { 1 };
            columns.checked_mul(rows)?.checked_mul(n_samples)?.checked_mul(n_bytes)?
        }
    };
    file.seek_relative(n_bytes.try_into().ok()?).ok()?;
    let mut rest = vec![];
    file.take(MOST_BYTES).read_to_end(&mut rest).ok()?;
    let rest = rest.trim_ascii_start();
    match rest {
        [] => None,
        [b'P', b'1'..=b'7', ..] => Some("further pictures".to_owned()),
        rest => rest.iter().any(|byte| *byte != 0).then(|| "bytes behind its samples".to_owned()),
    }
}

/// Names the further frames of a WebP file, and what its XMP data state.
fn of_webp(file: &mut (impl Read + Seek)) -> std::io::Result<Vec<String>> {
    let mut names = vec![];
    for _ in 0..MOST_PARTS {
        let mut head = [0; 8];
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let [kind @ .., a, b, c, d] = head;
        let n_bytes = u64::from(u32::from_le_bytes([a, b, c, d]));
        let content = part(file, n_bytes + n_bytes % 2)?;
        match &kind {
            b"ANIM" | b"ANMF" => names.push("further frames (ANIM)".to_owned()),
            b"XMP " => names.extend(of_xmp(&content)),
            b"VP8 " | b"VP8L" | b"VP8X" | b"ALPH" | b"ICCP" | b"EXIF" => {}
            kind => names.push(kind.iter().map(|byte| char::from(*byte)).collect()),
        }
    }
    Ok(names)
}

fn of_png(file: &mut (impl Read + Seek)) -> std::io::Result<Vec<String>> {
    let (mut names, mut n_bits, mut n_opaque, mut known) = (vec![], 0, 0, vec![]);
    for _ in 0..MOST_PARTS {
        let mut head = [0; 8];
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let [a, b, c, d, kind @ ..] = head;
        let n_bytes = u64::from(u32::from_be_bytes([a, b, c, d]));
        let mut content = part(file, n_bytes + 4)?;
        // What reads the picture leaves out what its checksum does not fit; colors are refused then.
        let sum = content.get(n_bytes as usize..).and_then(|sum| sum.try_into().ok()).map(u32::from_be_bytes);
        content.truncate(n_bytes.min(MOST_BYTES) as usize);
        let mut own = flate2::Crc::new();
        own.update(&kind);
        own.update(&content);
        let is_short = kind == *b"tRNS" && content.len() < n_opaque;
        if [*b"tRNS", *b"eXIf"].contains(&kind) && (is_short || sum.is_some_and(|sum| sum != own.sum())) {
            names.push(format!("{} (damaged)", String::from_utf8_lossy(&kind)));
        }
        match &kind {
            b"tEXt" | b"zTXt" | b"iTXt" => {
                let (word, text) = text_of(kind, &content);
                match word.as_str() {
                    "XML:com.adobe.xmp" => names.extend(of_xmp(&text)),
                    usual if USUAL_WORDS.contains(&usual) => names.extend(comment(&text)),
                    _ => names.push(format!("text '{word}'")),
                }
            }
            b"IHDR" => {
                n_bits = content.get(8).copied().unwrap_or_default();
                // Bytes of the color that is no part of the picture: of gray, of red, green and blue, of a palette.
                n_opaque = [2, 1, 6, 1][usize::from(content.get(9).copied().unwrap_or_default() % 4)];
            }
            // Samples of fewer bits that were shifted up to those of the file.
            b"sBIT" if content.iter().any(|own| *own < n_bits) => names.push("sBIT (bits that tell)".to_owned()),
            b"pHYs" if content.get(..4) != content.get(4..8) => names.push(format!("pHYs ({NOT_SQUARE})")),
            b"pHYs" => {}
            b"IEND" => break,
            kind if FIRST_CHUNKS.contains(&kind) && known.contains(kind) => {
                names.push(format!("{} (twice, or behind the pixels)", String::from_utf8_lossy(kind)));
            }
            kind if USED_CHUNKS.contains(&kind) => {}
            kind => names.push(kind.iter().map(|byte| char::from(*byte)).collect()),
        }
        if kind == *b"IDAT" {
            known.extend(FIRST_CHUNKS.map(|own| *own));
        }
        known.push(kind);
    }
    Ok(names)
}

/// Returns the word of a chunk of text and its text, inflated where it is compressed (PNG, third edition, 11.3.3).
fn text_of(kind: [u8; 4], content: &[u8]) -> (String, Vec<u8>) {
    let parted = |bytes: &[u8]| {
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
        (bytes[..end].to_vec(), bytes.get(end + 1..).unwrap_or_default().to_vec())
    };
    let (word, mut rest) = parted(content);
    let mut is_compressed = kind == *b"zTXt";
    if kind == *b"iTXt" && rest.len() >= 2 {
        is_compressed = rest[0] == 1;
        // Behind the flag and the method stand the language and the word in that.
        rest = parted(&parted(&rest[2..]).1).1;
    } else if is_compressed && !rest.is_empty() {
        rest.remove(0);
    }
    if is_compressed {
        let mut text = vec![];
        // Of a broken one, or one that is looked at in part, what there is.
        let _ = ZlibDecoder::new(&rest[..]).take(MOST_BYTES).read_to_end(&mut text);
        rest = text;
    }
    (word.into_iter().map(char::from).collect(), rest)
}

/// Names what phones put beside the picture: depths, gains for bright displays, further pictures; `None` of a file without an end.
fn of_jpeg(file: &mut (impl Read + Seek)) -> std::io::Result<Option<Vec<String>>> {
    let mut names = vec![];
    for _ in 0..MOST_PARTS {
        let mut head = [0; 4];
        file.read_exact(&mut head)?;
        let [0xff, kind, high, low] = head else { break };
        // Pixels follow the start of a scan.
        if kind == 0xda {
            let Some(behind) = behind_end(file)? else { return Ok(None) };
            let has_picture = behind.windows(3).any(|three| three == [0xff, 0xd8, 0xff]);
            names.extend(
                match behind.iter().any(|byte| *byte != 0) {
                    true if has_picture => Some("further pictures (behind its end)"),
                    true => Some("bytes behind its end"),
                    false => None,
                }
                .map(str::to_owned),
            );
            return Ok(Some(names));
        }
        let n_bytes = u64::from(u16::from_be_bytes([high, low])).saturating_sub(2);
        let content = part(file, n_bytes)?;
        match (kind, &content[..]) {
            (0xe0, &[b'J', b'F', b'I', b'F', 0, _, _, _, a, b, c, d, ..]) => {
                let [across, down] = [[a, b], [c, d]].map(|two| f64::from(u16::from_be_bytes(two)));
                if across > 0.0 && down > 0.0 && differ(across, down) {
                    names.push(format!("JFIF ({NOT_SQUARE})"));
                }
            }
            (0xe0..=0xef, content) => names.extend(of_segment(kind - 0xe0, content)),
            (0xfe, content) => names.extend(comment(content)),
            _ => {}
        }
    }
    Ok(Some(names))
}

/// Names a segment of an application in a JPEG file, by the word at its start.
fn of_segment(number: u8, content: &[u8]) -> Vec<String> {
    // Thumbnails, Exif data and profiles, which are used elsewhere, and what editors write for themselves.
    const KNOWN: [(u8, &[u8]); 9] = [
        (0, b"JFIF\0"),
        (0, b"JFXX\0"),
        (1, b"Exif\0"),
        (2, b"ICC_PROFILE\0"),
        (12, b"Ducky"),
        (12, b"Picture Info"),
        (13, b"Photoshop "),
        (13, b"Adobe_"),
        (14, b"Adobe"),
    ];
    let starts = |start: &[u8]| content.starts_with(start);
    // What reads the file takes shorter ones for none.
    const LEAST_EXIF_BYTES: usize = 7;
    if number == 1 && starts(b"Exif") && content.len() < LEAST_EXIF_BYTES {
        return vec!["Exif (damaged)".to_owned()];
    }
    if KNOWN.iter().any(|(own, start)| *own == number && starts(start)) {
        return vec![];
    }
    if number == 1 && starts(b"http://ns.adobe.com/") {
        return of_xmp(content);
    }
    vec![match number {
        2 if starts(b"MPF\0") => "further pictures (MPF)".to_owned(),
        2 if starts(b"urn:iso:std:iso:ts:21496:-1") => "gain map (ISO 21496-1)".to_owned(),
        _ => {
            let word = content.iter().take_while(|byte| byte.is_ascii_graphic() || **byte == b' ');
            format!("APP{number} '{}'", short(&word.map(|byte| char::from(*byte)).collect::<String>()))
        }
    }]
}

/// Returns what stands behind the mark of the picture's end, which cannot stand within its pixels; none where there is no mark.
fn behind_end(file: &mut impl Read) -> std::io::Result<Option<Vec<u8>>> {
    let (mut block, mut last) = (vec![0; MOST_BYTES as usize], 0);
    loop {
        let n = file.read(&mut block)?;
        if n == 0 {
            return Ok(None);
        }
        let within = || block[..n].windows(2).position(|two| two == [0xff, 0xd9]).map(|at| at + 2);
        let end = if last == 0xff && block[0] == 0xd9 { Some(1) } else { within() };
        if let Some(end) = end {
            let mut behind = block[end..n].to_vec();
            file.take(MOST_BYTES).read_to_end(&mut behind)?;
            return Ok(Some(behind));
        }
        last = block[n - 1];
    }
}

/// Reads the first bytes of a part and goes on to its end.
fn part(file: &mut (impl Read + Seek), n_bytes: u64) -> std::io::Result<Vec<u8>> {
    let mut content = vec![];
    file.by_ref().take(n_bytes.min(MOST_BYTES)).read_to_end(&mut content)?;
    file.seek_relative(n_bytes.saturating_sub(content.len() as u64) as i64)?;
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(bytes: &[u8]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, bytes).unwrap();
        unknown_parts(&path).unwrap()
    }

    #[test]
    fn pictures_behind_a_picture_are_named() {
        for (head, n_bytes) in
            [("P6 4 2 255\n", 24), ("P5\n# a\n4 2 65535\n", 16), ("P4 9 2\n", 4), ("P6 4 2 255\n", 24)]
        {
            let one = [head.as_bytes(), &vec![0; n_bytes]].concat();
            assert_eq!(named(&one), Vec::<String>::new(), "{head}");
            assert_eq!(named(&[&one[..], b"\n"].concat()), Vec::<String>::new(), "{head}");
            assert_eq!(named(&[&one[..], &one].concat()), ["further pictures"], "{head}");
            assert_eq!(named(&[&one[..], b"\x07\x08"].concat()), ["bytes behind its samples"], "{head}");
        }
        assert_eq!(named(b"P2 2 1 9\n1 2\n"), Vec::<String>::new());
    }

    #[test]
    fn what_cameras_of_bands_state_is_named() {
        let xmp = b"<x Camera:CentralWavelength=\"560\" GCamera:Other='1'><Camera:BandName>a</Camera:BandName>";
        assert_eq!(of_xmp(xmp), ["Camera:CentralWavelength (XMP)", "Camera:BandName (XMP)"]);
        assert!(of_xmp(b"<x Device:Camera: Camera: a>").iter().all(|name| !name.starts_with("Camera:")));
    }

    #[test]
    fn parts_that_nobody_knows_are_named() {
        let chunk =
            |kind: &[u8], content: &[u8]| [&(content.len() as u32).to_be_bytes(), kind, content, &[0; 4]].concat();
        let png = [
            b"\x89PNG\r\n\x1a\n".to_vec(),
            chunk(b"IHDR", &[0; 13]),
            chunk(b"tEXt", b"Comment\0hello"),
            chunk(b"tEXt", b"exposure\0 2 s"),
            chunk(b"pHYs", &[0, 0, 0, 9, 0, 0, 0, 9, 1]),
            chunk(b"zoRp", b"xx"),
            chunk(b"sRGB", b"\0"),
            chunk(b"IDAT", b""),
            chunk(b"gAMA", &[0, 0, 0, 1]),
            chunk(b"acTL", &[0; 8]),
            chunk(b"IEND", b""),
        ];
        assert_eq!(named(&png.concat()), ["acTL", "gAMA (twice, or behind the pixels)", "text 'exposure'", "zoRp"]);
        let telling = [
            b"\x89PNG\r\n\x1a\n".to_vec(),
            chunk(b"tEXt", b"Comment\0depth in mm, 1000 a metre"),
            chunk(b"pHYs", &[0, 0, 0, 9, 0, 0, 0, 18, 1]),
            chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0<x GPano:ProjectionType='equirectangular'>"),
        ];
        assert_eq!(
            named(&telling.concat()),
            ["comment 'depth in mm, 1000 a metre'", "pHYs (pixels that are not square)", "panorama (XMP)"]
        );
        assert_eq!(named(b"P5\n# made 2021\n# depth_scale 5000\n6 4\n65535\n# 3 mm"), ["comment 'depth_scale 5000'"]);
        let segment =
            |kind: u8, content: &[u8]| [&[0xff, kind], &(content.len() as u16 + 2).to_be_bytes()[..], content].concat();
        let jpeg = [
            vec![0xff, 0xd8],
            segment(0xe0, b"JFIF\0\x01\x02\x01\0\x48\0\x90\0\0"),
            segment(0xfe, b"focal 50, made by hand"),
            segment(0xe1, b"http://ns.adobe.com/xap/1.0/\0 <x GDepth:Near='1'>"),
            segment(0xe1, b"http://ns.adobe.com/xap/1.0/\0 <x Item:Semantic='GainMap' tiff:Orientation='6'>"),
            segment(0xe1, b"Exif\0\0II*\0"),
            segment(0xe2, b"MPF\0 more"),
            segment(0xe2, b"urn:iso:std:iso:ts:21496:-1\0\0"),
            segment(0xe4, b"QQQ \x07"),
            segment(0xda, b""),
            vec![1, 2, 0xff, 0xd9, 0, 7],
        ];
        assert_eq!(
            named(&jpeg.concat()),
            [
                "APP4 'QQQ '",
                "JFIF (pixels that are not square)",
                "bytes behind its end",
                "comment 'focal 50, made by hand'",
                "depth (XMP)",
                "further pictures (MPF)",
                "gain map (ISO 21496-1)",
                "gain map (XMP)",
                "orientation 6 (XMP)"
            ]
        );
        let webp = |kind: &[u8], content: &[u8]| {
            let length = (content.len() as u32).to_le_bytes();
            [b"RIFF\x20\0\0\0WEBP", kind, &length, content, b"EXIF\0\0\0\0"].concat()
        };
        assert_eq!(named(&webp(b"ANMF", b"1234")), ["further frames (ANIM)"]);
        assert_eq!(named(&webp(b"XMP ", b"<hdrgm:x/>")), ["gain map (hdrgm)"]);
        assert_eq!(named(b"BM and more than twenty bytes"), Vec::<String>::new());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.jpg");
        std::fs::write(&path, jpeg[..jpeg.len() - 1].concat()).unwrap();
        assert!(unknown_parts(&path).unwrap_err().to_string().contains("truncated"));
    }
}
