//! What the rim of a blown region tells of its color.
//!
//! A lamp that is blown shines over its rim: a glow of its own hue goes all about it, and its brightness falls from what pixels hold
//! without a step. A wall, a sky or a table top that is blown ends at things of other colors, or fades over a strip that is narrow against its own
//! size. What is measured of each connected region is therefore how much rim there is against its area, whether light goes on over its border, and
//! whether the hues along the border agree; a region whose rim does not tell its hue is white.

use ndarray::Array2;

/// A region whose rim has this share of its area tells nothing, and one of the second all.
const RIM_OF_AREA: [f32; 2] = [0.15, 0.4];
/// The rim reaches as far as this share of the radius of a disc of the region's area.
const REACH: f64 = 0.5;
/// Where the last channel but one falls below the first of these shares of saturation within two blocks of the border, another thing begins there;
/// light goes on from the second on.
const GOES_ON: [f32; 2] = [0.2, 0.4];
/// The share of the border over which light goes on that tells nothing, and that which tells all.
const BORDER: [f32; 2] = [0.4, 0.8];
/// How far hues along the border may be apart, as shares of the light: mean distances that tell all, and nothing.
const HUES: [f32; 2] = [0.04, 0.1];
/// Blocks of less light than this share of saturation show no hue.
const SHOWN: f32 = 0.3;

/// Blocks of two by two pixels.
pub(super) struct Blocks {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) n_channels: usize,
    /// For each block the channels, as shares of saturation.
    shares: Vec<f32>,
    /// For each block the same with white balanced.
    light: Vec<f32>,
    sure: f32,
}

impl Blocks {
    /// Takes the means of balanced channels; `levels` is the saturation of each, and from the share `sure` on a channel is blown.
    pub(super) fn new(channels: &[Array2<f32>], levels: &[f32], sure: f32) -> Self {
        let (all_rows, all_columns) = channels[0].dim();
        let (rows, columns) = (all_rows.div_ceil(2), all_columns.div_ceil(2));
        let n = channels.len();
        let mut light = vec![0.0; rows * columns * n];
        for (k, plane) in channels.iter().enumerate() {
            for (row, line) in light.chunks_exact_mut(columns * n).enumerate() {
                for (column, block) in line.chunks_exact_mut(n).enumerate() {
                    let (down, across) = ((2 * row + 1).min(all_rows - 1), (2 * column + 1).min(all_columns - 1));
                    let corners = [(2 * row, 2 * column), (2 * row, across), (down, 2 * column), (down, across)];
                    block[k] = 0.25 * corners.iter().map(|&at| plane[at].max(0.0)).sum::<f32>();
                }
            }
        }
        let shares =
            light.chunks_exact(n).flat_map(|block| block.iter().zip(levels).map(|(v, level)| v / level)).collect();
        Self { rows, columns, n_channels: n, shares, light, sure }
    }

    fn shares(&self, block: usize) -> &[f32] {
        &self.shares[block * self.n_channels..(block + 1) * self.n_channels]
    }

    /// Returns the last share but one, which tells whether two channels are left to show a hue; of one channel its own.
    fn last_but_one(&self, block: usize) -> f32 {
        let (mut least, mut next) = (f32::INFINITY, f32::INFINITY);
        for &share in self.shares(block) {
            if share < least {
                (least, next) = (share, least);
            } else {
                next = next.min(share);
            }
        }
        if next.is_finite() { next } else { least }
    }

    fn brightest(&self, block: usize) -> f32 {
        self.shares(block).iter().copied().fold(0.0, f32::max)
    }

    fn is_untold(&self, block: usize) -> bool {
        self.last_but_one(block) >= self.sure
    }

    fn beside(&self, block: usize) -> impl Iterator<Item = usize> + use<> {
        let (row, column, columns) = (block / self.columns, block % self.columns, self.columns);
        let sides = [
            (row > 0).then(|| block - columns),
            (row + 1 < self.rows).then(|| block + columns),
            (column > 0).then(|| block - 1),
            (column + 1 < self.columns).then(|| block + 1),
        ];
        sides.into_iter().flatten()
    }

    /// Returns how far the rim of its region tells the hue of each block, 0 not at all to 1; 1 where two channels or more are left.
    ///
    /// A block counts as bright from the share `glow` of saturation on.
    pub(super) fn told(&self, glow: f32) -> Vec<f32> {
        let n_blocks = self.rows * self.columns;
        let mut told = vec![1.0; n_blocks];
        let mut seen = vec![0_u32; n_blocks];
        let mut number = 0;
        for first in 0..n_blocks {
            if seen[first] != 0 || !self.is_untold(first) {
                continue;
            }
            number += 1;
            let region = self.region(first, number, &mut seen);
            let value = self.rim(&region, number, &mut seen).told(region.len(), glow);
            region.iter().for_each(|&block| told[block] = value);
        }
        told
    }

    /// Collects the untold blocks that hang together with one.
    fn region(&self, first: usize, number: u32, seen: &mut [u32]) -> Vec<usize> {
        let mut region = vec![first];
        seen[first] = number;
        let mut next = 0;
        while next < region.len() {
            for block in self.beside(region[next]) {
                if seen[block] == 0 && self.is_untold(block) {
                    seen[block] = number;
                    region.push(block);
                }
            }
            next += 1;
        }
        region
    }

    /// Looks at what lies about a region, block by block outwards. Rims of several regions may overlap: each marks its blocks anew.
    fn rim(&self, region: &[usize], number: u32, seen: &mut [u32]) -> Rim<'_> {
        let radius = (region.len() as f64 / std::f64::consts::PI).sqrt();
        let reach = ((REACH * radius).round() as usize).max(2);
        let mut rings: Vec<Vec<usize>> = Vec::with_capacity(reach);
        for _ in 0..reach {
            let mut ring = Vec::new();
            for &from in rings.last().map_or(region, Vec::as_slice) {
                for block in self.beside(from) {
                    if seen[block] != number && !self.is_untold(block) {
                        seen[block] = number;
                        ring.push(block);
                    }
                }
            }
            rings.push(ring);
        }
        Rim { blocks: self, rings }
    }
}

/// The blocks about a region, by their distance from it.
struct Rim<'a> {
    blocks: &'a Blocks,
    rings: Vec<Vec<usize>>,
}

impl Rim<'_> {
    /// Returns how far it tells the hue of a region of so many blocks.
    fn told(&self, n_region: usize, glow: f32) -> f32 {
        let is_bright = |block: &&usize| self.blocks.brightest(**block) >= glow;
        let n_rim = self.rings.iter().flatten().filter(is_bright).count();
        let by_area = part(n_rim as f32 / n_region as f32, RIM_OF_AREA);
        let beyond: Vec<&usize> = self.rings.get(1).into_iter().flatten().filter(is_bright).collect();
        let goes_on: f32 = beyond.iter().map(|&&block| part(self.blocks.last_but_one(block), GOES_ON)).sum();
        // A small lamp before the dark has no light two blocks from it.
        let by_border = if beyond.is_empty() { 1.0 } else { part(goes_on / beyond.len() as f32, BORDER) };
        by_area * by_border * (1.0 - part(self.spread_of_hues(), HUES))
    }

    /// Returns how far the hues beside the border are from their mean.
    fn spread_of_hues(&self) -> f32 {
        let n = self.blocks.n_channels;
        let hue = |block: usize| {
            let light = &self.blocks.light[block * n..(block + 1) * n];
            let sum: f32 = light.iter().sum();
            light.iter().map(move |v| v / sum)
        };
        let shown: Vec<usize> =
            self.rings[0].iter().copied().filter(|&block| self.blocks.brightest(block) >= SHOWN).collect();
        if shown.is_empty() {
            return 0.0;
        }
        let mut mean = vec![0.0; n];
        for &block in &shown {
            mean.iter_mut().zip(hue(block)).for_each(|(sum, v)| *sum += v / shown.len() as f32);
        }
        let distance = |block: usize| 0.5 * hue(block).zip(&mean).map(|(v, mean)| (v - mean).abs()).sum::<f32>();
        shown.iter().map(|&block| distance(block)).sum::<f32>() / shown.len() as f32
    }
}

/// Returns 0 up to the first value, 1 from the second on, and a smooth step between.
pub(super) fn part(value: f32, [from, to]: [f32; 2]) -> f32 {
    let share = ((value - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
