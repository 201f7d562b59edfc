//! Files of pictures as decoders see them: a TIFF file that begins with a thumbnail begins with its first page of full size, a Radiance
//! picture lies upright, and has red, green and blue where it has X, Y and Z.

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
    /// What stands elsewhere than in the file, each with its place: the place of the first page, signs of sides, the name of the colors.
    others: Vec<(u64, Vec<u8>)>,
}

impl PictureFile {
    /// Opens a file.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = File::open(path)?;
        // Whoever decodes a broken file says what is wrong with it.
        let others = others_of(&mut file).unwrap_or_default();
        file.rewind()?;
        Ok(Self { file, at: 0, others })
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

/// The lines of a Radiance picture that say how it lies and what its colors are ("Radiance file formats", Ward 2004).
#[derive(Default)]
struct RadianceLines {
    /// Where `-Y 2 +X 3` stands: that which its scan lines are counted by first.
    at: u64,
    line: String,
    /// Where its colors are called X, Y and Z.
    xyze_at: Option<u64>,
}

impl RadianceLines {
    fn of(file: &mut File) -> Result<Self> {
        const LIMIT_BYTES: u64 = 1 << 20;
        let (mut bytes, mut at) = (vec![], 0);
        file.rewind()?;
        file.take(LIMIT_BYTES).read_to_end(&mut bytes)?;
        let mut this = Self::default();
        let mut is_head = true;
        for line in bytes.split(|byte| *byte == b'\n') {
            if !is_head {
                (this.at, this.line) = (at, String::from_utf8_lossy(line).into_owned());
                break;
            }
            // An empty line ends the head.
            is_head = !line.trim_ascii().is_empty();
            let place = line.windows(XYZE.len()).position(|word| word == XYZE);
            let place = place.filter(|_| line.starts_with(b"FORMAT"));
            this.xyze_at = this.xyze_at.or(place.map(|place| at + place as u64));
            at += line.len() as u64 + 1;
        }
        Ok(this)
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

/// What a Radiance picture of X, Y and Z calls its colors, and what one of red, green and blue does.
const XYZE: &[u8] = b"xyze";
const RGBE: &[u8] = b"rgbe";

/// Whether a file is a Radiance picture whose colors are X, Y and Z (CIE 1931).
pub fn is_xyze(path: &Path) -> bool {
    let lines = || {
        let mut file = File::open(path)?;
        let mut start = [0; 2];
        file.read_exact(&mut start)?;
        if start == *b"#?" { RadianceLines::of(&mut file) } else { Ok(RadianceLines::default()) }
    };
    lines().is_ok_and(|lines| lines.xyze_at.is_some())
}

/// Returns how a picture lies in its file, as that states it; upright where it states nothing.
pub fn orientation_of(path: &Path) -> Orientation {
    let reader = open(path).ok();
    let stated = reader.and_then(|reader| match reader.format()? {
        ImageFormat::Hdr => RadianceLines::of(&mut File::open(path).ok()?).ok()?.orientation(),
        _ => reader.into_decoder().ok()?.orientation().ok(),
    });
    stated.unwrap_or(Orientation::NoTransforms)
}

/// Returns what decoders see in place of what stands in a file: that the first page of a TIFF file is the first of full size, how a Radiance picture lies
/// and what its colors are.
fn others_of(file: &mut File) -> Result<Vec<(u64, Vec<u8>)>> {
    let mut head = [0; 4];
    file.read_exact(&mut head)?;
    let (is_big_endian, is_big_file) = match &head {
        b"II*\0" => (false, false),
        b"MM\0*" => (true, false),
        b"II+\0" => (false, true),
        b"MM\0+" => (true, true),
        b"#?RA" => {
            let lines = RadianceLines::of(file)?;
            let turned = lines.orientation().map(|_| (lines.at, lines.upright()));
            return Ok(turned.into_iter().chain(lines.xyze_at.map(|at| (at, RGBE.to_vec()))).collect());
        }
        _ => return Ok(vec![]),
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
            return Ok(if index > 0 { vec![(header, place)] } else { vec![] });
        }
        at = number(entries.saturating_add(n_entry * n_entries), n_place)?;
    }
    Ok(vec![])
}

impl Read for PictureFile {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let n = self.file.read(buffer)?;
        let (from, end) = (self.at, self.at + n as u64);
        for (start, bytes) in &self.others {
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
