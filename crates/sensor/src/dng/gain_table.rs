//! Gains that differ from place to place and with light: `ProfileGainTableMap` (DNG 1.6), by which phones lift dark parts of a picture.

use std::sync::Arc;

use serde::Serialize;

use super::{area::Area, tiff_reader::Fields};

/// The bytes before the gains.
const HEAD: usize = 64;
/// The most tables each way, and entries of one: far more than files have (8 × 6 × 257).
const MOST: u64 = 4096;

/// A map of tables of gains over a picture, each over the light of a color.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GainTableMap {
    /// Tables down and to the right.
    pub tables: [usize; 2],
    /// Entries of a table.
    pub entries: usize,
    /// From a table to the next, down and to the right, shares of the frame.
    spacing: [f64; 2],
    /// Where the first table lies.
    origin: [f64; 2],
    /// What of red, green, blue, the least and the largest of them makes the light that is looked up.
    weights: [f32; 5],
    /// By row, then column, then entry.
    #[serde(skip)]
    gains: Arc<[f32]>,
    /// Top, left, bottom and right of the picture, shares of the pixels that see light.
    #[serde(skip)]
    shown: [f64; 4],
}

impl GainTableMap {
    /// Reads the map of a field, if it is there.
    pub(super) fn read(fields: &Fields<'_>, tag: u16, area: &Area) -> Result<Option<Self>, String> {
        let Some(bytes) = fields.bytes(tag) else { return Ok(None) };
        let wrong = |reason: &str| Err(format!("has a local map of gains {reason}"));
        if bytes.len() < HEAD {
            return wrong("that is cut short");
        }
        let whole = |at: usize| fields.number_of(&bytes[at..at + 4]);
        let double = |at: usize| f64::from_bits(fields.number_of(&bytes[at..at + 8]));
        let single = |at: usize| f32::from_bits(fields.number_of(&bytes[at..at + 4]) as u32);
        let (down, right, entries) = (whole(0), whole(4), whole(40));
        if [down, right, entries].iter().any(|n| !(1..=MOST).contains(n)) {
            return wrong(&format!("of {down} × {right} tables of {entries} entries"));
        }
        let n = (down * right * entries) as usize;
        if bytes.len() != HEAD + 4 * n {
            return wrong(&format!("of {} bytes for {down} × {right} tables of {entries} entries", bytes.len()));
        }
        let (spacing, origin) = ([double(8), double(16)], [double(24), double(32)]);
        let is_spaced = |n: u64, spacing: f64| spacing.is_finite() && (spacing > 0.0 || n == 1);
        if !is_spaced(down, spacing[0]) || !is_spaced(right, spacing[1]) || origin.iter().any(|v| !v.is_finite()) {
            return wrong(&format!("spaced by {spacing:?} from {origin:?}"));
        }
        let weights = [0, 1, 2, 3, 4].map(|i| single(44 + 4 * i));
        let gains: Arc<[f32]> = (0..n).map(|i| single(HEAD + 4 * i)).collect();
        if weights.iter().any(|weight| !weight.is_finite())
            || gains.iter().any(|gain| !(*gain >= 0.0 && gain.is_finite()))
        {
            return wrong("with numbers that are none");
        }
        let (above, before) = area.places_before();
        let share = |place: usize, n: usize| place as f64 / n as f64;
        let shown = [
            share(above, area.active_rows),
            share(before, area.active_columns),
            share(above + area.rows, area.active_rows),
            share(before + area.columns, area.active_columns),
        ];
        let (tables, entries) = ([down as usize, right as usize], entries as usize);
        Ok(Some(Self { tables, entries, spacing, origin, weights, gains, shown }))
    }

    /// Returns the gains of a row of a picture of so many rows.
    pub(super) fn row(&self, row: usize, n_rows: usize) -> RowOfGains<'_> {
        RowOfGains { map: self, place: self.place(0, row, n_rows) }
    }

    /// Returns the table before a row or column of pixels, and the share of the next one.
    fn place(&self, axis: usize, pixel: usize, n_pixels: usize) -> (usize, f32) {
        let (from, to) = (self.shown[axis], self.shown[axis + 2]);
        let at = from + (to - from) * (pixel as f64 + 0.5) / n_pixels as f64;
        let last = self.tables[axis] - 1;
        let place =
            if last == 0 { 0.0 } else { ((at - self.origin[axis]) / self.spacing[axis]).clamp(0.0, last as f64) };
        let below = (place as usize).min(last);
        (below, (place - below as f64) as f32)
    }

    /// Returns the gain of a table, linear between its entries.
    fn of_table(&self, [down, right]: [usize; 2], light: f32) -> f32 {
        let first = (down * self.tables[1] + right) * self.entries;
        let table = &self.gains[first..first + self.entries];
        let place = light * self.entries as f32;
        let below = (place as usize).min(self.entries - 1);
        let above = (below + 1).min(self.entries - 1);
        table[below] + (place - below as f32).min(1.0) * (table[above] - table[below])
    }
}

/// The gains of a row of pixels.
pub(super) struct RowOfGains<'a> {
    map: &'a GainTableMap,
    place: (usize, f32),
}

impl RowOfGains<'_> {
    /// Returns the gain of a color, linear ROMM RGB, in one of so many columns.
    pub(super) fn gain(&self, column: usize, n_columns: usize, [r, g, b]: [f32; 3]) -> f32 {
        let map = self.map;
        let parts = [r, g, b, r.min(g).min(b), r.max(g).max(b)];
        let light = parts.iter().zip(map.weights).map(|(part, weight)| part * weight).sum::<f32>().clamp(0.0, 1.0);
        let ((down, of_lower), (right, of_right)) = (self.place, map.place(1, column, n_columns));
        let next = |i: usize, axis: usize| (i + 1).min(map.tables[axis] - 1);
        let between = |down: usize| {
            let (a, b) = (map.of_table([down, right], light), map.of_table([down, next(right, 1)], light));
            a + of_right * (b - a)
        };
        let (upper, lower) = (between(down), between(next(down, 0)));
        upper + of_lower * (lower - upper)
    }
}

#[cfg(test)]
pub(super) mod tests {
    /// Returns the bytes of a map, little-endian.
    pub(in crate::dng) fn bytes(
        [down, right, entries]: [u32; 3],
        numbers: [f64; 4],
        weights: [f32; 5],
        gain: impl Fn(u32, u32, u32) -> f32,
    ) -> Vec<u8> {
        let mut bytes: Vec<u8> = [down, right].into_iter().flat_map(u32::to_le_bytes).collect();
        bytes.extend(numbers.into_iter().flat_map(f64::to_le_bytes));
        bytes.extend(entries.to_le_bytes());
        bytes.extend(weights.into_iter().flat_map(f32::to_le_bytes));
        for row in 0..down {
            for column in 0..right {
                bytes.extend((0..entries).flat_map(|entry| gain(row, column, entry).to_le_bytes()));
            }
        }
        bytes
    }
}
