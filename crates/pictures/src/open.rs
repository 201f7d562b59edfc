//! Files of pictures as decoders see them: a TIFF file that begins with a thumbnail begins with its first page of full size, a Radiance
//! picture whose rows do not run from the top, each from the left, does.

use std::{
    fs::File,
    io::{BufReader, Read, Result, Seek, SeekFrom},
    path::Path,
};

use image::{ImageDecoder, ImageFormat, ImageReader, metadata::Orientation};

/// Pages that are looked at.
const MOST_PAGES: usize = 10_000;

/// A file of a picture. Decoders take the first page of a TIFF file, which may be a reduced one (`NewSubfileType` 1, TIFF 6.0, section 8).
pub struct PictureFile {
    file: File,
    at: u64,
    /// Where the place of the first page stands, and that of the first of full size; or the signs of sides that are others.
    start: Option<(u64, Vec<u8>)>,
}

impl PictureFile {
    /// Opens a file.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = File::open(path)?;
        // Whoever decodes a broken file says what is wrong with it.
        let start = start_of(&mut file).ok().flatten();
        file.rewind()?;
        Ok(Self { file, at: 0, start })
    }
}

/// Opens a picture, whose format is that of its first bytes, or of the extension of its name where they say nothing.
///
/// # Errors
/// When the file cannot be read.
pub fn open(path: &Path) -> Result<ImageReader<BufReader<PictureFile>>> {
    let mut reader = ImageReader::new(BufReader::new(PictureFile::open(path)?));
    if let Ok(format) = ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    reader.with_guessed_format()
}

/// The line of a Radiance picture that has its sides, as `-Y 2 +X 3`: that which its scan lines are counted by first ("Radiance file
/// formats", Ward 2004).
struct Sides {
    /// Where it stands.
    at: u64,
    line: String,
}

impl Sides {
    fn of(file: &mut File) -> Result<Option<Self>> {
        const LIMIT_BYTES: u64 = 1 << 20;
        let (mut bytes, mut at) = (vec![], 0);
        file.rewind()?;
        file.take(LIMIT_BYTES).read_to_end(&mut bytes)?;
        let mut lines = bytes.split(|byte| *byte == b'\n').map(|line| {
            at += line.len() as u64 + 1;
            (at - line.len() as u64 - 1, line)
        });
        // An empty line ends what stands before.
        let line = lines.find(|(_, line)| line.trim_ascii().is_empty()).and_then(|_| lines.next());
        Ok(line.and_then(|(at, line)| Some(Self { at, line: str::from_utf8(line).ok()?.to_owned() })))
    }

    /// Returns the line with the signs and letters of a picture that lies upright.
    fn upright(&self) -> Vec<u8> {
        let mut axes = ["-Y", "+X"].into_iter();
        let word = |word: &str| {
            if word.starts_with(['+', '-']) { axes.next().unwrap_or(word).to_owned() } else { word.to_owned() }
        };
        self.line.split(' ').map(word).collect::<Vec<_>>().join(" ").into_bytes()
    }

    /// Returns how a picture lies that is read as one that lies upright.
    fn orientation(&self) -> Option<Orientation> {
        let axes: Vec<&str> = self.line.split_whitespace().filter(|word| word.starts_with(['+', '-'])).collect();
        Some(match axes[..] {
            ["+Y", "+X"] => Orientation::FlipVertical,
            ["-Y", "-X"] => Orientation::FlipHorizontal,
            ["+Y", "-X"] => Orientation::Rotate180,
            ["+X", "-Y"] => Orientation::Rotate90FlipH,
            ["-X", "-Y"] => Orientation::Rotate90,
            ["+X", "+Y"] => Orientation::Rotate270,
            ["-X", "+Y"] => Orientation::Rotate270FlipH,
            _ => return None,
        })
    }
}

/// Returns how a picture lies in its file, as that states it; upright where it states nothing.
pub fn orientation_of(path: &Path) -> Orientation {
    let reader = open(path).ok();
    let stated = reader.and_then(|reader| match reader.format()? {
        ImageFormat::Hdr => Sides::of(&mut File::open(path).ok()?).ok()??.orientation(),
        _ => reader.into_decoder().ok()?.orientation().ok(),
    });
    stated.unwrap_or(Orientation::NoTransforms)
}

/// Returns what the header of a TIFF file says in place of its first page, where that is a reduced one and another is not.
fn start_of(file: &mut File) -> Result<Option<(u64, Vec<u8>)>> {
    let mut head = [0; 4];
    file.read_exact(&mut head)?;
    let (is_big_endian, is_big_file) = match &head {
        b"II*\0" => (false, false),
        b"MM\0*" => (true, false),
        b"II+\0" => (false, true),
        b"MM\0+" => (true, true),
        b"#?RA" => {
            let turned = Sides::of(file)?.filter(|sides| sides.orientation().is_some());
            return Ok(turned.map(|sides| (sides.at, sides.upright())));
        }
        _ => return Ok(None),
    };
    let mut number = |at: u64, n_bytes: usize| -> Result<u64> {
        let mut bytes = [0; 8];
        file.seek(SeekFrom::Start(at))?;
        file.read_exact(&mut bytes[..n_bytes])?;
        let put = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        let bytes = &bytes[..n_bytes];
        Ok(if is_big_endian { bytes.iter().fold(0, put) } else { bytes.iter().rev().fold(0, put) })
    };
    let (header, n_place, n_count, n_entry, value) = if is_big_file { (8, 8, 8, 20, 12) } else { (4, 4, 2, 12, 8) };
    let mut at = number(header, n_place)?;
    for index in 0..MOST_PAGES {
        if at == 0 {
            break;
        }
        let n_entries = number(at, n_count)?.min(u16::MAX.into());
        let entries = at.saturating_add(n_count as u64);
        let mut is_reduced = false;
        for entry in (0..n_entries).map(|index| entries.saturating_add(n_entry * index)) {
            match number(entry, 2)? {
                254 => {
                    // A number of four bytes, or of two.
                    let n_bytes = if number(entry + 2, 2)? == 3 { 2 } else { 4 };
                    is_reduced = number(entry + value, n_bytes)? & 1 != 0;
                    break;
                }
                // Tags ascend.
                255.. => break,
                _ => {}
            }
        }
        if !is_reduced {
            let place = at.to_be_bytes()[8 - n_place..].to_vec();
            let place = if is_big_endian { place } else { place.into_iter().rev().collect() };
            return Ok((index > 0).then_some((header, place)));
        }
        at = number(entries.saturating_add(n_entry * n_entries), n_place)?;
    }
    Ok(None)
}

impl Read for PictureFile {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let n = self.file.read(buffer)?;
        let (from, end) = (self.at, self.at + n as u64);
        if let Some((start, bytes)) = &self.start {
            for (place, byte) in (*start..).zip(bytes) {
                if (from..end).contains(&place) {
                    buffer[(place - from) as usize] = *byte;
                }
            }
        }
        self.at = end;
        Ok(n)
    }
}

impl Seek for PictureFile {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}
