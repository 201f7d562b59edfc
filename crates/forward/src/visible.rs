//! What of each layer is seen past the edges of nearer surfaces, by rays through the pupil.

use dioptric_spectrum::{Cancel, Cancelled};
use multiversion::multiversion;
use rayon::prelude::*;

use crate::{
    Film,
    coverage::Gathered,
    layers::{DEPTH_EDGE_PX, IN_FOCUS_PX, tent},
    node_kernels::{LayerKernels, NodeKernel},
    raster::BLOCK,
    ray::Rays,
    rectangle::Rectangle,
    sight::{Lanes, Met, NearEdges, RAYS, Sight, widest_px},
    tile::film_pixels,
    tiling::LayerTiles,
};

/// The parts of layers that pixels beside edges of depth see.
///
/// Nearer surfaces leave of what a pixel gathers of a layer what lies behind the open part of its pupil. That depends on the geometry alone, so it is
/// found once, where bundles pass edges, on points as far apart as the blur of the near sides allows.
pub(crate) struct Visible {
    sight: Sight,
    /// Of the blocks of pixels, as counted from the film's middle, the first row and column, and how many there are in a row.
    first: (i64, i64),
    n_columns: usize,
    /// Row by row; none where no bundle passes an edge.
    blocks: Vec<Option<BlockParts>>,
    /// The part of the film from which rays pass behind all surfaces that are known.
    pub(crate) unknown_fraction: f64,
}

/// The parts that are seen at points over a block.
struct BlockParts {
    /// Pixels from point to point.
    step: usize,
    /// Of layers of which more or less is seen than of all that lies behind what is before them: the ratio, row by row.
    by_layer: Vec<(u16, Vec<f32>)>,
    /// The part of the points from which rays come to no surface.
    unknown_fraction: f64,
}

/// Rays along the radius of a bundle.
const ALONG_RADIUS: usize = 5;
/// Points over the blur radius of a near side.
const POINTS_OF_RADIUS: f32 = 6.0;
/// Part of the rays that must meet a layer to tell what is seen of it, of less all rays tell; or nothing, to be worth telling.
const FEW_RAYS: f32 = 0.02;

impl Visible {
    /// Draws rays, by the kernels of the layers, from the pixels of a film.
    pub(crate) fn through(
        sight: Sight,
        (tiles, kernels): (&[LayerTiles], &[LayerKernels]),
        film: &Film,
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        let pixels = film_pixels(film);
        let block_of = |pixel: i64| pixel.div_euclid(BLOCK);
        let last = |first: i64, n: usize| first + n as i64 - 1;
        let rows = block_of(pixels.first_row)..=block_of(last(pixels.first_row, pixels.rows));
        let columns = block_of(pixels.first_column)..=block_of(last(pixels.first_column, pixels.columns));
        let (first, n_columns) = ((*rows.start(), *columns.start()), columns.clone().count());
        let blocks: Vec<(i64, i64)> = rows.flat_map(|row| columns.clone().map(move |column| (row, column))).collect();
        let side = BLOCK as usize;
        let parts = blocks.into_par_iter().map(|block| {
            cancel.check()?;
            let at = Rectangle { first_row: block.0 * BLOCK, first_column: block.1 * BLOCK, rows: side, columns: side };
            let Some(at) = at.intersection(&pixels) else { return Ok(None) };
            let bundle = |met: &[Met]| Bundle::of(met, &at, (tiles, kernels));
            Ok(BlockParts::of(&sight, &at, &bundle))
        });
        let blocks: Vec<Option<BlockParts>> = parts.collect::<Result<_, Cancelled>>()?;
        let unknown: f64 = blocks.iter().flatten().map(|block| block.unknown_fraction).sum();
        let unknown_fraction = unknown * (BLOCK * BLOCK) as f64 / pixels.len() as f64;
        Ok(Self { sight, first, n_columns, blocks, unknown_fraction: unknown_fraction.min(1.0) })
    }

    pub(crate) fn size_bytes(&self) -> usize {
        let ratios = self.blocks.iter().flatten().flat_map(|block| &block.by_layer).map(|(_, ratios)| ratios.len());
        self.sight.size_bytes() + size_of_val(self.blocks.as_slice()) + size_of::<f32>() * ratios.sum::<usize>()
    }

    /// Takes from what pixels gather of a layer what they do not see of it, `open` being the part of their pupils that layers well before it leave.
    pub(crate) fn weigh(&self, layer: usize, open: &dyn Fn(usize, usize) -> f32, gathered: &mut Gathered) {
        let Rectangle { first_row, first_column, rows, columns } = gathered.at;
        for row in 0..rows {
            let mut column = 0;
            while column < columns {
                let pixel = (first_row + row as i64, first_column + column as i64);
                let to_next = (BLOCK - pixel.1.rem_euclid(BLOCK)) as usize;
                let end = (column + to_next).min(columns);
                let (down, right) =
                    (pixel.0.div_euclid(BLOCK) - self.first.0, pixel.1.div_euclid(BLOCK) - self.first.1);
                let Some(block) = &self.blocks[down as usize * self.n_columns + right as usize] else {
                    column = end;
                    continue;
                };
                let ratios = block.of_layer(layer);
                let told_of_layer = told(self.sight.radius_px(layer, pixel));
                for column in column..end {
                    let (index, pixel) = (row * columns + column, (pixel.0, first_column + column as i64));
                    let most_px = self.sight.near_edges(pixel).most_px;
                    if gathered.alpha[index] <= 0.0 || most_px <= 0.0 {
                        continue;
                    }
                    // In focus, layer or edge, all of the pupil sees the same.
                    let told = told_of_layer.min(told(most_px)).clamp(0.0, 1.0);
                    let ratio = ratios.map_or(1.0, |ratios| block.ratio(ratios, pixel));
                    let part = (open(row, column) * (1.0 + told * (ratio - 1.0))).min(1.0);
                    gathered.light[index] *= part;
                    gathered.alpha[index] *= part;
                }
                column = end;
            }
        }
    }

    /// The depth picture as rays meet it.
    pub(crate) fn sight(&self) -> &Sight {
        &self.sight
    }
}

/// Points over a block along its side, so many pixels apart: one in each pixel, or those between which pixels lie.
fn points_of(step: usize) -> usize {
    BLOCK as usize / step + usize::from(step > 1)
}

/// How far rays through the pupil of a blur radius tell parts of it apart: as far as an edge of depth does wholly, and in focus, where all of it sees the same, not at all.
fn told(radius_px: f32) -> f32 {
    (radius_px.abs() - IN_FOCUS_PX) / (DEPTH_EDGE_PX - IN_FOCUS_PX)
}

/// Rays through a pupil: where each goes in a layer of a blur radius of 1 pixel, down and across, and its weight; of sum 1.
struct Bundle {
    rays: Vec<([(f32, f32); RAYS], Lanes)>,
}

impl Bundle {
    /// Returns that of the middle of a rectangle of pixels, by the kernel of the widest of the first surface's layers that it meets and that is gathered there.
    fn of(met: &[Met], at: &Rectangle, (tiles, kernels): (&[LayerTiles], &[LayerKernels])) -> Option<Self> {
        let mut firsts: Vec<&Met> = met.iter().filter(|met| met.is_of_first).collect();
        firsts.sort_by(|a, b| b.radius_px.abs().total_cmp(&a.radius_px.abs()));
        let middle = (at.first_row + at.rows as i64 / 2, at.first_column + at.columns as i64 / 2);
        // Where nothing of a layer is in reach it has no tile.
        let with_tile = |met: &&Met| tiles[met.layer].at(middle).map(|(tile, level)| (**met, tile, level));
        let (widest, tile, level) = firsts.iter().find_map(with_tile)?;
        let corners = tile.corners().map(|node| kernels[widest.layer].at((node, level)));
        let kernel = NodeKernel::sum_of(&corners.each_ref().map(|corner| (corner, 0.25)));
        let step_px = level.step_px() as f32;
        let side = ((widest.radius_px.abs() / step_px) as usize / ALONG_RADIUS).max(1);
        let Rectangle { first_row, first_column, rows, columns } = kernel.at;
        let n_across = columns.div_ceil(side);
        // Of each square of samples the light, and where it comes from.
        let mut squares = vec![[0.0_f32; 3]; rows.div_ceil(side) * n_across];
        for (index, &light) in kernel.samples.iter().enumerate() {
            let (row, column) = (index / columns, index % columns);
            let square = &mut squares[row / side * n_across + column / side];
            square[0] += light;
            square[1] += light * (first_row + row as i64) as f32;
            square[2] += light * (first_column + column as i64) as f32;
        }
        // A film point x gathers the sample at x − d.
        let scale = -step_px / widest.radius_px;
        let lit = squares.into_iter().enumerate().filter(|(_, [light, ..])| *light > 1e-5);
        let rays = lit.map(|(square, [light, down, across])| {
            // Not in rows and columns, which an edge along them would hide all at once (Roberts's R2 sequence).
            let beside =
                [0.754_877_7, 0.569_840_3].map(|step: f32| side as f32 * ((square as f32 * step).fract() - 0.5));
            let to = [down / light + beside[0], across / light + beside[1]].map(|to| scale * to);
            let beyond = to[0].hypot(to[1]).max(1.0);
            ((to[0] / beyond, to[1] / beyond), light)
        });
        let rays: Vec<((f32, f32), f32)> = rays.collect();
        let total: f32 = rays.iter().map(|(_, light)| light).sum();
        let some = |rays: &[((f32, f32), f32)]| {
            // The last few without weight.
            let of = |ray: usize| rays.get(ray).copied().unwrap_or_default();
            (std::array::from_fn(|ray| of(ray).0), std::array::from_fn(|ray| of(ray).1 / total))
        };
        Some(Self { rays: rays.chunks(RAYS).map(some).collect() })
    }
}

impl BlockParts {
    /// Returns the ratios of a layer, if they are not all 1.
    fn of_layer(&self, layer: usize) -> Option<&[f32]> {
        let found = self.by_layer.binary_search_by_key(&(layer as u16), |(layer, _)| *layer);
        found.ok().map(|found| self.by_layer[found].1.as_slice())
    }

    /// Returns the ratio at a pixel, between points.
    fn ratio(&self, ratios: &[f32], (row, column): (i64, i64)) -> f32 {
        let (step, points) = (self.step, points_of(self.step));
        if step == 1 {
            let [row, column] = [row, column].map(|pixel| pixel.rem_euclid(BLOCK) as usize);
            return ratios[row * points + column];
        }
        let split = |pixel: i64| {
            let within = pixel.rem_euclid(BLOCK) as usize;
            (within / step, (within % step) as f32 / step as f32)
        };
        let ((row, down), (column, across)) = (split(row), split(column));
        let at = |row: usize, column: usize| ratios[row * points + column];
        let along = |row: usize| at(row, column) + across * (at(row, column + 1) - at(row, column));
        along(row) + down * (along(row + 1) - along(row))
    }

    /// Draws the bundles of points over a block that pass edges out of focus; `None` where no bundle passes an edge.
    fn of(sight: &Sight, at: &Rectangle, bundle: &dyn Fn(&[Met]) -> Option<Bundle>) -> Option<Self> {
        let pixels = (0..at.rows as i64).flat_map(|row| (0..at.columns as i64).map(move |column| (row, column)));
        let edges = pixels.map(|(row, column)| sight.near_edges((at.first_row + row, at.first_column + column)));
        let edges = edges
            .filter(|edges| edges.most_px > 0.0)
            .reduce(|a, b| NearEdges { least_px: a.least_px.min(b.least_px), most_px: a.most_px.max(b.most_px) })?;
        let least_px = edges.least_px;
        let step = (1_usize << ((least_px / POINTS_OF_RADIUS).max(1.0).log2() as usize)).min(BLOCK as usize);
        let met = sight.met_by(at);
        // Of what is in focus, edge or layer, and of what nothing lies before, rays tell nothing.
        let first = met.first()?.layer;
        let is_told = |met: &Met| met.layer > first + 1 && told(met.radius_px) > 0.0;
        if told(edges.most_px) <= 0.0 || !met.iter().any(is_told) {
            return Some(Self { step: 1, by_layer: vec![], unknown_fraction: 0.0 });
        }
        let bundle = bundle(&met)?;
        let points = points_of(step);
        let mut by_layer: Vec<(u16, Vec<f32>)> =
            met.iter().map(|met| (met.layer as u16, Vec::with_capacity(points * points))).collect();
        let mut sums = vec![[0.0; 3]; met.len()];
        let mut n_unknown = 0;
        let corner = (at.first_row.div_euclid(BLOCK) * BLOCK, at.first_column.div_euclid(BLOCK) * BLOCK);
        for (row, column) in (0..points).flat_map(|row| (0..points).map(move |column| (row, column))) {
            let pixel = (corner.0 + (row * step) as i64, corner.1 + (column * step) as i64);
            if step == 1 && !(at.has(pixel) && sight.near_edges(pixel).most_px > 0.0) {
                // Where no bundle passes an edge there is nothing to tell.
                by_layer.iter_mut().for_each(|(_, ratios)| ratios.push(1.0));
                continue;
            }
            if bundle.seen_from(sight, sight.place_px(pixel), &met, &mut sums) > FEW_RAYS {
                n_unknown += 1;
            }
            for ((_, ratios), [seen, all, open]) in by_layer.iter_mut().zip(&sums) {
                // Of what is open the share that sees it, over that of all that would.
                let of_open = if *open > 0.0 { seen / open } else { 0.0 };
                ratios.push((of_open + FEW_RAYS) / (all + FEW_RAYS));
            }
        }
        by_layer.retain(|(_, ratios)| ratios.iter().any(|ratio| (ratio - 1.0).abs() > f32::EPSILON.sqrt()));
        Some(Self { step, by_layer, unknown_fraction: f64::from(n_unknown) / (points * points) as f64 })
    }
}

impl Bundle {
    /// Follows the rays from a place layer by layer: of each layer, the part of the rays that see it, of those that would without what lies before, and of all that are open. Returns
    /// the part that comes to no surface.
    fn seen_from(&self, sight: &Sight, place: (f32, f32), met: &[Met], sums: &mut [[f32; 3]]) -> f32 {
        sums.fill([0.0; 3]);
        let (widest_px, position) = (widest_px(met), sight.position_at(place));
        let per_px = |beside: (f32, f32)| sight.per_px(place, position, beside, widest_px);
        let unknown = |(beside, weights): &([(f32, f32); RAYS], Lanes)| {
            follow(sight, (position, beside.map(per_px)), weights, (met, &mut *sums))
        };
        self.rays.iter().map(unknown).sum()
    }
}

/// Adds up what some rays see.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2", "aarch64+neon"))]
fn follow(
    sight: &Sight,
    (position, per_px): ([f32; 2], [[f32; 2]; RAYS]),
    weights: &Lanes,
    (met, sums): (&[Met], &mut [[f32; 3]]),
) -> f32 {
    let per_px = [0, 1].map(|axis| per_px.map(|per_px| per_px[axis]));
    let mut rays = Rays::new(sight.surfaces(), position.map(|position| [position; RAYS]), per_px);
    for (met, sums) in met.iter().zip(sums) {
        let [first, second] = rays.pass(*met);
        let mut found = [[0.0; RAYS]; 3];
        for ray in 0..RAYS {
            let share = weights[ray] * (tent(first[ray], met.layer as f32) + tent(second[ray], met.layer as f32));
            let open = if rays.reaches(ray, met.layer) { 1.0 } else { 0.0 };
            (found[0][ray], found[1][ray], found[2][ray]) = (open * share, share, open * weights[ray]);
        }
        sums.iter_mut().zip(&found).for_each(|(sum, found)| *sum += found.iter().sum::<f32>());
    }
    let ended = rays.ended();
    (0..RAYS).filter(|ray| !ended[*ray]).map(|ray| weights[ray]).sum()
}
