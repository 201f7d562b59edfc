//! Writing a spectral EXR, with depth, whose bands need not be in memory together.

use std::{
    io::{BufWriter, Seek, Write},
    ops::Range,
    path::Path,
};

use dioptric_files::Staged;
use dioptric_spectrum::{DepthMap, Quantity, WavelengthGrid, sort_exr_attributes};
use exr::{
    block::{
        BlockIndex, UncompressedBlock,
        chunk::Chunk,
        write as write_chunks,
        writer::{ChunkWriter, ChunksWriter},
    },
    meta::{BlockDescription, Headers, MetaData, attribute::AttributeValue, header::Header},
    prelude::{ChannelDescription, LayerAttributes, LineOrder, SmallVec, Text, Vec2},
};
use ndarray::s;
use rayon::prelude::*;

use super::{
    band_name, exr_attributes,
    exr_samples::{ExrSamples, Stored, check_size},
    unusable::{open_new, unreadable, unwritable},
};
use crate::{SceneError, SceneLight, View};

/// What is known of a spectral image before its samples.
#[derive(Clone, Copy, Debug)]
pub struct SpectralHead<'a> {
    /// What the samples are.
    pub quantity: Quantity,
    /// Its bands.
    pub grid: &'a WavelengthGrid,
    /// Rows and columns.
    pub size: (usize, usize),
    /// Distance between samples on the film, µm.
    pub pitch_um: Option<f64>,
    /// Axial depth, written as channel `Z` of single floats.
    pub depth: Option<&'a DepthMap>,
    /// Pinhole geometry, written as attributes.
    pub view: Option<View>,
    /// The light on the scene, written as an attribute.
    pub light: Option<&'a SceneLight>,
    /// Attributes of text, by name, in words of whoever reads them.
    pub texts: &'a [(&'a str, &'a str)],
    /// The largest sample of all bands, which half floats are fitted to.
    pub largest: f32,
    /// How samples are stored.
    pub samples: ExrSamples,
    /// Bytes of samples that are in memory at a time, besides those of whoever has the bands; a few rows of all bands are at least.
    pub at_once_bytes: usize,
}

impl SpectralHead<'_> {
    /// Writes a spectral EXR of one layer, a few rows of all bands at a time; `rows_of` returns the samples of rows of a band, row by row, and is called
    /// in the order of rows and from one thread.
    ///
    /// # Errors
    /// When the picture is empty or the depth of another size, `rows_of` fails or returns another number of samples, or the file cannot be written; it is then not there.
    pub fn write_exr(
        &self,
        path: &Path,
        rows_of: &mut dyn FnMut(usize, Range<usize>) -> Result<Vec<f32>, String>,
    ) -> Result<(), SceneError> {
        let (rows, columns) = self.size;
        if rows == 0 || columns == 0 {
            return Err(unwritable(path, format!("a picture of {rows} × {columns} samples")));
        }
        if let Some(depth) = self.depth {
            check_size(path, DEPTH, depth.z_m(), self.size)?;
        }
        let stored = self.samples.layout(self.quantity, self.largest);
        let channels = Channels::of(self);
        let staged = Staged::file(path)?;
        let mut file = open_new(&staged, path)?;
        let mut failed = None;
        let writer = BufWriter::with_capacity(1 << 20, &mut file);
        let written = write_chunks(writer, channels.headers(self, &stored), true, |meta, chunks| {
            let mut lines = Lines { head: self, channels: &channels, stored: &stored, rows_of, failed: &mut failed };
            lines.write(&meta.headers, chunks)
        });
        if let Some(reason) = failed {
            return Err(unwritable(path, reason));
        }
        written.map_err(|error| unwritable(path, error))?;
        sort_exr_attributes(&mut file).map_err(|error| unwritable(path, error))?;
        drop(file);
        Ok(staged.commit()?)
    }
}

/// Returns an attribute of text that the header of an EXR file states, as of [`SpectralHead::texts`].
///
/// # Errors
/// When the file cannot be read.
pub fn read_exr_text(path: &Path, name: &str) -> Result<Option<String>, SceneError> {
    let meta = MetaData::read_from_file(path, false).map_err(|error| unreadable(path, error.to_string()))?;
    let stated = meta.headers.iter().find_map(|header| header.own_attributes.other.get(&Text::from(name)));
    Ok(match stated {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    })
}

/// Whether an EXR file states that its light is irradiance; not where it cannot be read.
pub fn is_irradiance_exr(path: &Path) -> bool {
    let Ok(meta) = MetaData::read_from_file(path, false) else { return false };
    let unit = |header: &Header| exr_attributes::from_layer(&header.own_attributes).unit;
    meta.headers.iter().any(|header| matches!(unit(header), Ok(Some(unit)) if unit.quantity == Quantity::Irradiance))
}

/// The name of the channel of depth.
const DEPTH: &str = "Z";

/// What a channel holds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Content {
    Band(usize),
    Depth,
}

/// The channels of a file.
struct Channels {
    /// Ascending by name.
    by_name: Vec<(String, Content)>,
}

impl Channels {
    fn of(head: &SpectralHead<'_>) -> Self {
        let names = head.grid.centers_nm().iter().map(|&nm| band_name::of(head.quantity, nm));
        let bands = names.zip((0..).map(Content::Band));
        let depth = head.depth.map(|_| (DEPTH.to_owned(), Content::Depth));
        let mut by_name: Vec<(String, Content)> = bands.chain(depth).collect();
        by_name.sort();
        Self { by_name }
    }

    fn headers(&self, head: &SpectralHead<'_>, stored: &Stored) -> Headers {
        let kind_of = |content| match content {
            Content::Band(_) => stored.sample_type(),
            Content::Depth => Stored::single().sample_type(),
        };
        let channel = |(name, content): &(String, Content)| ChannelDescription::named(name.as_str(), kind_of(*content));
        let channels = self.by_name.iter().map(channel).collect();
        let mut attributes = LayerAttributes::default();
        exr_attributes::add_to(&mut attributes, stored.unit.text.as_deref(), head.pitch_um, head.view, head.light);
        for (name, text) in head.texts {
            attributes.other.insert(Text::from(*name), AttributeValue::Text(Text::from(*text)));
        }
        let (rows, columns) = head.size;
        let header = Header::new(Text::from("bands"), Vec2(columns, rows), channels)
            .with_attributes(attributes)
            .with_encoding(head.samples.compression(), BlockDescription::ScanLines, LineOrder::Increasing);
        SmallVec::from_vec(vec![header])
    }
}

/// The rows of all bands, as the blocks of a file.
struct Lines<'a> {
    head: &'a SpectralHead<'a>,
    channels: &'a Channels,
    stored: &'a Stored,
    rows_of: &'a mut dyn FnMut(usize, Range<usize>) -> Result<Vec<f32>, String>,
    /// Why the rows could not be had.
    failed: &'a mut Option<String>,
}

impl Lines<'_> {
    fn write<W: Write + Seek>(&mut self, headers: &[Header], chunks: &mut ChunkWriter<W>) -> exr::error::UnitResult {
        let (rows, columns) = self.head.size;
        let rows_per_block = self.head.samples.compression().scan_lines_per_block();
        let block_bytes = 4 * columns * self.channels.by_name.len() * rows_per_block;
        let n_blocks = rows.div_ceil(rows_per_block);
        // Blocks are fetched one by one and packed by all threads.
        let n_at_once = (self.head.at_once_bytes / block_bytes).clamp(1, 4 * rayon::current_num_threads());
        for first in (0..n_blocks).step_by(n_at_once) {
            let range = first..(first + n_at_once).min(n_blocks);
            let blocks =
                range.clone().map(|block| self.block(block * rows_per_block..rows.min((block + 1) * rows_per_block)));
            let blocks = blocks.collect::<exr::error::Result<Vec<UncompressedBlock>>>()?;
            let packed: Vec<exr::error::Result<Chunk>> =
                blocks.into_par_iter().map(|block| block.compress_to_chunk(headers)).collect();
            for (block, chunk) in range.zip(packed) {
                chunks.write_chunk(block, chunk?)?;
            }
        }
        Ok(())
    }

    fn block(&mut self, rows: Range<usize>) -> exr::error::Result<UncompressedBlock> {
        let columns = self.head.size.1;
        let channels = self.channels.by_name.iter().map(|&(_, content)| match content {
            Content::Band(band) => Ok((self.stored.clone(), (self.rows_of)(band, rows.clone())?)),
            Content::Depth => {
                let of_row = |depth: &DepthMap| depth.z_m().slice(s![rows.clone(), ..]).iter().copied().collect();
                Ok((Stored::single(), self.head.depth.map_or(vec![], of_row)))
            }
        });
        let channels = channels.collect::<Result<Vec<(Stored, Vec<f32>)>, String>>().and_then(|channels| {
            let is_whole = channels.iter().all(|(_, samples)| samples.len() == rows.len() * columns);
            if is_whole { Ok(channels) } else { Err(format!("bands of other sizes in rows {rows:?}")) }
        });
        let channels = match channels {
            Ok(channels) => channels,
            Err(reason) => {
                *self.failed = Some(reason);
                return Err(exr::error::Error::Aborted);
            }
        };
        let mut data = Vec::with_capacity(4 * columns * rows.len() * channels.len());
        for row in 0..rows.len() {
            channels
                .iter()
                .for_each(|(stored, samples)| stored.append(&samples[row * columns..][..columns], &mut data));
        }
        let index = BlockIndex {
            layer: 0,
            pixel_position: Vec2(0, rows.start),
            pixel_size: Vec2(columns, rows.len()),
            level: Vec2(0, 0),
        };
        Ok(UncompressedBlock { index, data })
    }
}
