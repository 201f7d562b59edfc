//! The parts of PNG, JPEG and WebP files besides their pixels: what of them would change the scene and is not used.

use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use super::unusable::unreadable;
use crate::SceneError;

/// Chunks of PNG that are used, or say how the pixels lie in the file, when they were made or what is printed.
const USED_CHUNKS: [&[u8; 4]; 16] = [
    b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS", b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"cICP", b"sBIT", b"bKGD",
    b"hIST", b"tIME", b"eXIf", b"sPLT",
];
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

/// Returns the names of the parts of a PNG, JPEG or WebP file that are not known; none of other files.
///
/// # Errors
/// When the file cannot be opened, or is a JPEG file without an end, whose missing pixels decoders make up.
pub(super) fn unknown_parts(path: &Path) -> Result<Vec<String>, SceneError> {
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    let mut file = BufReader::new(file);
    let mut start = [0; 21];
    // What is shorter or broken is refused by whoever decodes it.
    if file.read_exact(&mut start).is_err() {
        return Ok(vec![]);
    }
    let names = match start {
        [0x89, b'P', b'N', b'G', ..] => file.seek(SeekFrom::Start(8)).and_then(|_| of_png(&mut file)),
        [0xff, 0xd8, ..] => {
            let names = file.seek(SeekFrom::Start(2)).and_then(|_| of_jpeg(&mut file));
            if names.as_ref().is_ok_and(Option::is_none) {
                return Err(unreadable(path, "the file ends too early (truncated)"));
            }
            names.map(Option::unwrap_or_default)
        }
        // The header of extended files has a flag for those with frames.
        [b'R', b'I', b'F', b'F', .., b'V', b'P', b'8', b'X', _, _, _, _, flags] if flags & 2 != 0 => {
            Ok(vec!["further frames (ANIM)".to_owned()])
        }
        _ => Ok(vec![]),
    };
    let mut names = names.unwrap_or_default();
    names.sort();
    names.dedup();
    Ok(names)
}

fn of_png(file: &mut (impl Read + Seek)) -> std::io::Result<Vec<String>> {
    let mut names = vec![];
    for _ in 0..MOST_PARTS {
        let mut head = [0; 8];
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let [a, b, c, d, kind @ ..] = head;
        let n_bytes = u64::from(u32::from_be_bytes([a, b, c, d]));
        let content = part(file, n_bytes + 4)?;
        match &kind {
            b"tEXt" | b"zTXt" | b"iTXt" => {
                let word = content.split(|byte| *byte == 0).next().unwrap_or_default();
                let word: String = word.iter().map(|byte| char::from(*byte)).collect();
                if !USUAL_WORDS.contains(&word.as_str()) {
                    names.push(format!("text '{word}'"));
                }
            }
            // Pixels that are not square.
            b"pHYs" if content.get(..4) != content.get(4..8) => names.push("pHYs".to_owned()),
            b"pHYs" => {}
            b"IEND" => break,
            kind if USED_CHUNKS.contains(&kind) => {}
            kind => names.push(kind.iter().map(|byte| char::from(*byte)).collect()),
        }
    }
    Ok(names)
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
            return Ok(has_end(file)?.then_some(names));
        }
        let n_bytes = u64::from(u16::from_be_bytes([high, low])).saturating_sub(2);
        let content = part(file, n_bytes)?;
        let has = |word: &[u8]| content.windows(word.len()).any(|own| own == word);
        if kind == 0xe2 && content.starts_with(b"MPF\0") {
            names.push("further pictures (MPF)".to_owned());
        }
        if kind == 0xe1 && (has(b"GDepth:") || has(b"GCamera:Depth") || has(b"Device:Camera")) {
            names.push("depth (XMP)".to_owned());
        }
        if kind == 0xe1 && has(b"hdrgm:") {
            names.push("gain map (hdrgm)".to_owned());
        }
    }
    Ok(Some(names))
}

/// Whether the end of the picture is marked behind its pixels, within which the mark cannot stand.
fn has_end(file: &mut impl Read) -> std::io::Result<bool> {
    let (mut block, mut last) = (vec![0; MOST_BYTES as usize], 0);
    loop {
        let n = file.read(&mut block)?;
        if n == 0 {
            return Ok(false);
        }
        if last == 0xff && block[0] == 0xd9 || block[..n].windows(2).any(|two| two == [0xff, 0xd9]) {
            return Ok(true);
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
            chunk(b"acTL", &[0; 8]),
            chunk(b"IEND", b""),
        ];
        assert_eq!(named(&png.concat()), ["acTL", "text 'exposure'", "zoRp"]);
        let segment =
            |kind: u8, content: &[u8]| [&[0xff, kind], &(content.len() as u16 + 2).to_be_bytes()[..], content].concat();
        let jpeg = [
            vec![0xff, 0xd8],
            segment(0xe0, b"JFIF\0"),
            segment(0xe1, b"http://ns.adobe.com/xap/1.0/\0 <x GDepth:Near='1'>"),
            segment(0xe2, b"MPF\0 more"),
            segment(0xda, b""),
            vec![1, 2, 0xff, 0xd9],
        ];
        assert_eq!(named(&jpeg.concat()), ["depth (XMP)", "further pictures (MPF)"]);
        assert_eq!(named(b"RIFF\x20\0\0\0WEBPVP8X\x0a\0\0\0\x02 more"), ["further frames (ANIM)"]);
        assert_eq!(named(b"BM and more than twenty bytes"), Vec::<String>::new());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.jpg");
        std::fs::write(&path, jpeg[..jpeg.len() - 1].concat()).unwrap();
        assert!(unknown_parts(&path).unwrap_err().to_string().contains("truncated"));
    }
}
