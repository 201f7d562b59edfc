//! Compressed pictures whose checksums and tables are right and whose content need not be: each is read or refused, never a panic.
//!
//! `DIOPTRIC_FUZZ_CASES=1000000 cargo test --release --workspace --lib -- payloads` makes that many files instead of a few thousand.

use std::{fs, io::Write};

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    SmallVec, WritableImage,
};
use flate2::{Compression as Level, Crc, read::ZlibDecoder, write::ZlibEncoder};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{picture::decode, *};

/// Files of each kind where nothing else is said.
const USUAL_CASES: usize = 2000;

fn n_cases() -> usize {
    std::env::var("DIOPTRIC_FUZZ_CASES").map_or(USUAL_CASES, |text| text.parse().unwrap())
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Level::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Changes a few bytes, drops some or adds some; often nothing.
fn changed(rng: &mut ChaCha8Rng, mut bytes: Vec<u8>) -> Vec<u8> {
    match rng.random_range(0..8) {
        0 if !bytes.is_empty() => bytes.truncate(rng.random_range(0..bytes.len())),
        1 => bytes.extend((0..rng.random_range(1..40)).map(|_| rng.random::<u8>())),
        2..=5 if !bytes.is_empty() => {
            for _ in 0..rng.random_range(1..5) {
                let at = rng.random_range(0..bytes.len());
                bytes[at] = rng.random();
            }
        }
        _ => {}
    }
    bytes
}

/// Returns a PNG file whose chunks have right checksums: sizes, types, filters and lines by chance, the lines compressed rightly more often
/// than not.
fn png(rng: &mut ChaCha8Rng) -> Vec<u8> {
    let [width, height] =
        [0; 2].map(|_| if rng.random_range(0..400) == 0 { rng.random() } else { rng.random_range(1..20_u32) });
    let (depth, color_type, samples): (u8, u8, usize) = [
        (8, 2, 3),
        (16, 2, 6),
        (8, 0, 1),
        (16, 0, 2),
        (1, 0, 1),
        (4, 3, 1),
        (8, 3, 1),
        (8, 4, 2),
        (8, 6, 4),
        (16, 6, 8),
    ][rng.random_range(0..10)];
    let interlace = u8::from(rng.random_range(0..5) == 0);
    let line = samples * width.min(20) as usize;
    let mut lines = Vec::new();
    for _ in 0..height.min(20) {
        lines.push(if rng.random_range(0..60) == 0 { rng.random() } else { rng.random_range(0..5_u8) });
        lines.extend((0..line).map(|_| rng.random::<u8>()));
    }
    let lines = changed(rng, lines);
    let stream = deflated(&lines);
    let stream = if rng.random_range(0..3) == 0 { changed(rng, stream) } else { stream };
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[depth, color_type, 0, 0, interlace]].concat();
    chunk(&mut file, b"IHDR", &header);
    if color_type == 3 {
        let n_colors = rng.random_range(1..40);
        chunk(&mut file, b"PLTE", &(0..3 * n_colors).map(|_| rng.random()).collect::<Vec<u8>>());
    }
    if rng.random_range(0..4) == 0 {
        chunk(&mut file, b"tRNS", &(0..rng.random_range(0..8)).map(|_| rng.random()).collect::<Vec<u8>>());
    }
    let cut = rng.random_range(0..=stream.len());
    chunk(&mut file, b"IDAT", &stream[..cut]);
    chunk(&mut file, b"IDAT", &stream[cut..]);
    chunk(&mut file, b"IEND", &[]);
    file
}

fn chunk(file: &mut Vec<u8>, name: &[u8; 4], content: &[u8]) {
    let mut checksum = Crc::new();
    checksum.update(name);
    checksum.update(content);
    file.extend((content.len() as u32).to_be_bytes());
    file.extend(name);
    file.extend(content);
    file.extend(checksum.sum().to_be_bytes());
}

/// An EXR file of one part in lines, taken apart.
struct Exr {
    /// All before the table of offsets.
    head: Vec<u8>,
    /// The first line of each block, and its payload.
    blocks: Vec<(i32, Vec<u8>)>,
}

impl Exr {
    /// Makes three bands of 20 × 36 samples, so that each compression has several blocks.
    fn written(compression: Compression, n_blocks: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("made.exr");
        let band = |band: usize| FlatSamples::F32((0..20 * 36).map(|i| ((i * (band + 3)) % 17) as f32).collect());
        let names = ["S0.450nm", "S0.550nm", "S0.650nm"];
        let list: SmallVec<[_; 4]> = (0..3).map(|i| AnyChannel::new(names[i], band(i))).collect();
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let layer = Layer::new((20, 36), LayerAttributes::default(), encoding, AnyChannels::sort(list));
        Image::from_layer(layer).write().to_file(&path).unwrap();
        let bytes = fs::read(&path).unwrap();
        let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        // The first offset names the end of the table that it begins.
        let table = (0..bytes.len() - 8).find(|&at| number(at) == at + 8 * n_blocks).unwrap();
        let block = |i: usize| {
            let at = number(table + 8 * i);
            let word = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            (word(at), bytes[at + 8..at + 8 + word(at + 4) as usize].to_vec())
        };
        Self { head: bytes[..table].to_vec(), blocks: (0..n_blocks).map(block).collect() }
    }

    /// Returns the file with offsets and lengths that are right.
    fn bytes(&self) -> Vec<u8> {
        let mut file = self.head.clone();
        let mut at = self.head.len() + 8 * self.blocks.len();
        for (_, payload) in &self.blocks {
            file.extend((at as u64).to_le_bytes());
            at += 8 + payload.len();
        }
        for (line, payload) in &self.blocks {
            file.extend(line.to_le_bytes());
            file.extend((payload.len() as i32).to_le_bytes());
            file.extend(payload);
        }
        file
    }
}

/// Changes a payload; one of zlib often before it is compressed, so that its checksum is right.
fn changed_payload(rng: &mut ChaCha8Rng, payload: &[u8], is_zip: bool) -> Vec<u8> {
    let mut plain = Vec::new();
    if is_zip && rng.random_range(0..3) > 0 && std::io::copy(&mut ZlibDecoder::new(payload), &mut plain).is_ok() {
        return deflated(&changed(rng, plain));
    }
    changed(rng, payload.to_vec())
}

#[test]
fn payloads_of_png_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.png");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (n, mut n_read) = (n_cases(), 0);
    for _ in 0..n {
        fs::write(&path, png(&mut rng)).unwrap();
        match decode(&path, 0) {
            Ok(_) => n_read += 1,
            Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
        }
    }
    println!("{n_read} of {n} PNG files read, the others refused");
    assert!(n_read > n / 10 && n_read < n - n / 10, "{n_read} of {n}");
}

#[test]
fn payloads_of_exr_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.exr");
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let kinds = [(Compression::ZIP1, 36), (Compression::ZIP16, 3), (Compression::RLE, 36), (Compression::PIZ, 2)];
    let made = kinds.map(|(compression, n_blocks)| Exr::written(compression, n_blocks));
    let (n, mut n_read) = (n_cases(), 0);
    for case in 0..n {
        let kind = case % kinds.len();
        let Exr { head, blocks } = &made[kind];
        let mut file = Exr { head: head.clone(), blocks: blocks.clone() };
        let which = rng.random_range(0..blocks.len());
        file.blocks[which].1 = changed_payload(&mut rng, &blocks[which].1, kind < 2);
        fs::write(&path, file.bytes()).unwrap();
        match read_spectral_exr(&path) {
            Ok(_) => n_read += 1,
            Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
        }
    }
    println!("{n_read} of {n} EXR files read, the others refused");
    assert!(n_read > n / 10 && n_read < n - n / 10, "{n_read} of {n}");
}
