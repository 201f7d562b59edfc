//! The depth picture as rays through the pupil meet it.

use std::sync::Arc;

use dioptric_psf::{FilmMap, LensImage};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    Border, Film,
    layers::DEPTH_EDGE_PX,
    places::{SceneRaster, folded},
    raster::{BLOCK, Level, Raster},
    rectangle::Rectangle,
    scene_layers::SceneLayers,
    surface::LayerCoordinates,
    tile::film_pixels,
};

/// The surfaces of the scene as the chief rays of a film and of what lies around it meet them.
///
/// The ray from a film point x to a sample s of layer j passes layer i at q = x + (s − x) `ρ_i / ρ_j`, with ρ the blur radii (docs/forward.md 3).
pub(crate) struct Sight {
    /// The pixels of the film and those around it.
    at: Rectangle,
    scene: Arc<SceneLayers>,
    raster: SceneRaster,
    looks: Looks,
    /// Of each pixel.
    near_edges: Vec<NearEdges>,
    /// Of each block the layers that the first surface and what lies behind it have a part of: a bit each.
    met: Vec<[u64; 2]>,
    /// Words of these bits in a block.
    words: usize,
    blur: BlurOverFilm,
    /// How far below and to the right of the film's middle the middle of the pixel of number 0 lies, pixels.
    middle: (f32, f32),
}

/// Where the corners of blocks of pixels look in the scene; between them positions are bilinear.
struct Looks {
    /// The number of the first block, down and across, and how many there are.
    first: (i64, i64),
    blocks: (usize, usize),
    /// Row and column among the samples, one more than there are blocks each way.
    corners: Vec<[f32; 2]>,
}

/// Blur radii of the near sides of the edges of depth in the bundle of a pixel, pixels: the smallest and the largest; 0 where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct NearEdges {
    pub(crate) least_px: f32,
    pub(crate) most_px: f32,
}

/// Rays that are followed at once.
pub(crate) const RAYS: usize = 16;

/// A number of each of some rays.
pub(crate) type Lanes = [f32; RAYS];

/// A layer that rays meet, and its blur radius at a place, pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    pub(crate) layer: usize,
    pub(crate) radius_px: f32,
    /// Whether the first surface has a part of it.
    pub(crate) is_of_first: bool,
}

/// Returns the blur radius of the widest of some layers, with its sign, pixels.
pub(crate) fn widest_px(met: &[Met]) -> f32 {
    met.iter().map(|met| met.radius_px).fold(0.0, |widest, px| if px.abs() > f32::abs(widest) { px } else { widest })
}

/// A surface before a point: its depth, and its layer coordinate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Before {
    pub(crate) dioptres: f64,
    pub(crate) coordinate: f32,
}

/// How far apart the two sides of a soft edge may lie, pixels.
const SOFT_EDGE: [usize; 2] = [1, 3];

impl Sight {
    /// Looks at the scene from a film by the map of a band; `None` where no layer hides another.
    pub(crate) fn of(
        (lens, film, wavelength_nm): (&dyn LensImage, &Film, f64),
        map: &FilmMap,
        raster: &SceneRaster,
        scene: &Arc<SceneLayers>,
        cancel: &Cancel,
    ) -> Result<Option<Self>, Cancelled> {
        if !scene.hides {
            return Ok(None);
        }
        let blur = BlurOverFilm::of((lens, film, wavelength_nm));
        let widest_px = blur.widest_px(scene.layers.dioptres());
        let margin = (widest_px.ceil() as usize).min(film.rows.max(film.columns)) + SOFT_EDGE[1];
        let pixels = Raster::new(film, Level::PIXEL);
        let at = film_pixels(film).grown(margin);
        let mut this = Self {
            at,
            scene: scene.clone(),
            raster: *raster,
            looks: Looks::over(&at, (&pixels, map, raster)),
            near_edges: vec![],
            met: vec![],
            words: scene.layers.len().div_ceil(64),
            blur,
            middle: (pixels.down_px(0) as f32, pixels.across_px(0) as f32),
        };
        let surfaces = this.surfaces();
        let of_row = |row: usize| {
            cancel.check()?;
            let place = |column: usize| this.place_px((at.first_row + row as i64, at.first_column + column as i64));
            Ok((0..at.columns).map(|column| surfaces.at(this.position_at(place(column)))).collect())
        };
        let seen = (0..at.rows).into_par_iter().map(of_row).collect::<Result<Vec<Vec<[f32; 2]>>, Cancelled>>()?;
        this.met = this.find_met(&seen);
        this.near_edges = this.find_near_edges(&seen);
        Ok(Some(this))
    }

    pub(crate) fn size_bytes(&self) -> usize {
        size_of_val(self.looks.corners.as_slice())
            + size_of_val(self.near_edges.as_slice())
            + size_of_val(self.met.as_slice())
            + size_of_val(self.blur.by_block.as_slice())
    }

    /// Returns the blur radius at a pixel of a layer with its sign, pixels.
    pub(crate) fn radius_px(&self, layer: usize, pixel: (i64, i64)) -> f32 {
        self.radius_px_of(self.scene.layers.dioptres()[layer], pixel)
    }

    /// Returns the blur radius at a pixel of a depth with its sign, pixels.
    pub(crate) fn radius_px_of(&self, dioptres: f64, pixel: (i64, i64)) -> f32 {
        self.blur.at(pixel).of(dioptres)
    }

    /// Returns where the middle of a pixel lies, pixels below and to the right of the film's middle.
    pub(crate) fn place_px(&self, (row, column): (i64, i64)) -> (f32, f32) {
        (self.middle.0 + row as f32, self.middle.1 + column as f32)
    }

    /// Returns the pixel that a place lies in, pixels below and to the right of the film's middle.
    pub(crate) fn pixel_at(&self, (down, across): (f32, f32)) -> (i64, i64) {
        ((down - self.middle.0).round() as i64, (across - self.middle.1).round() as i64)
    }

    /// Returns the edges of depth in the bundle of a pixel.
    pub(crate) fn near_edges(&self, (row, column): (i64, i64)) -> NearEdges {
        let (row, column) = (row - self.at.first_row, column - self.at.first_column);
        self.near_edges[row as usize * self.at.columns + column as usize]
    }

    /// Returns the row and column among the samples of the scene that a place looks at, pixels from the film's middle; NaN where nothing is seen.
    #[inline]
    pub(crate) fn position_at(&self, (down, across): (f32, f32)) -> [f32; 2] {
        self.looks.at((down - self.middle.0, across - self.middle.1))
    }

    /// Returns how far among the samples a ray from a place goes in a pixel of blur radius, that passes so many pixels beside the place in the layer of a blur
    /// radius of 1 pixel. Between the place and the widest of the layers that it may meet the map of the film is taken for linear.
    #[inline]
    pub(crate) fn per_px(&self, from: (f32, f32), position: [f32; 2], beside: (f32, f32), widest_px: f32) -> [f32; 2] {
        let end = self.position_at((from.0 + widest_px * beside.0, from.1 + widest_px * beside.1));
        [0, 1].map(|axis| if widest_px == 0.0 { 0.0 } else { (end[axis] - position[axis]) / widest_px })
    }

    /// Returns the surfaces of the scene.
    pub(crate) fn surfaces(&self) -> Surfaces<'_> {
        let SceneRaster { rows, columns, border, .. } = self.raster;
        let second = self.scene.occluded.layer_coordinates().map(LayerCoordinates::samples);
        Surfaces { first: self.scene.coordinates.samples(), second, rows, columns, border }
    }

    /// Returns the layers that the rays of some pixels may meet, nearest first, with the blur radii in their middle.
    pub(crate) fn met_by(&self, pixels: &Rectangle) -> Vec<Met> {
        let dioptres = self.scene.layers.dioptres();
        let blur =
            self.blur.at((pixels.first_row + pixels.rows as i64 / 2, pixels.first_column + pixels.columns as i64 / 2));
        let mut bits = vec![[0_u64; 2]; self.words];
        let around = pixels.grown(blur.widest_px(dioptres).ceil() as usize + 1);
        if let Some(around) = around.intersection(&self.at) {
            for block in self.looks.blocks_of(&around) {
                for (bits, [first, second]) in bits.iter_mut().zip(&self.met[block * self.words..]) {
                    *bits = [bits[0] | first, bits[1] | second];
                }
            }
        }
        let is_met = |layer: usize, of: usize| bits[layer / 64][of] >> (layer % 64) & 1 == 1;
        let met = (0..dioptres.len()).map(|layer| {
            // One sample in each pixel was looked at: between two layers of a slant there may be one more.
            let is_between =
                |of| layer > 0 && layer + 1 < dioptres.len() && is_met(layer - 1, of) && is_met(layer + 1, of);
            [0, 1].map(|of| is_met(layer, of) || is_between(of))
        });
        let met = met.enumerate().filter(|(_, is_met)| is_met[0] || is_met[1]);
        met.map(|(layer, [is_of_first, _])| Met { layer, radius_px: blur.of(dioptres[layer]), is_of_first }).collect()
    }

    /// Returns the layers that each block has a part of.
    fn find_met(&self, seen: &[Vec<[f32; 2]>]) -> Vec<[u64; 2]> {
        let mut met = vec![[0; 2]; self.looks.blocks.0 * self.looks.blocks.1 * self.words];
        for (row, line) in (self.at.first_row..).zip(seen) {
            for (column, surfaces) in (self.at.first_column..).zip(line) {
                let block = self.looks.block_of((row, column));
                for (of, coordinate) in surfaces.iter().enumerate().filter(|(_, coordinate)| !coordinate.is_nan()) {
                    for layer in [coordinate.floor() as usize, coordinate.ceil() as usize] {
                        met[block * self.words + layer / 64][of] |= 1 << (layer % 64);
                    }
                }
            }
        }
        met
    }

    /// Returns the edges of depth in the bundle of each pixel: those no farther from it than the blur radius of their near sides.
    fn find_near_edges(&self, seen: &[Vec<[f32; 2]>]) -> Vec<NearEdges> {
        let Rectangle { rows, columns, .. } = self.at;
        let mut reach = vec![Reach::default(); rows * columns];
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let [mine, _] = seen[row][column];
            let blur = self.blur.at((self.at.first_row + row as i64, self.at.first_column + column as i64));
            let radius_at = |coordinate: f32| blur.of(self.scene.layers.layer_and_dioptres_at(coordinate).1);
            for by in SOFT_EDGE {
                for (other_row, other_column) in [(row, column + by), (row + by, column)] {
                    let Some(&[other, _]) = seen.get(other_row).and_then(|line| line.get(other_column)) else {
                        continue;
                    };
                    if mine == other {
                        continue;
                    }
                    let (near, far) = (radius_at(mine.min(other)), radius_at(mine.max(other)));
                    if (near - far).abs() > DEPTH_EDGE_PX {
                        // In focus too it has a part of a pixel.
                        let px = near.abs().max(0.1);
                        let edge =
                            Reach { left_px: px + 1.0 + by as f32, edges: NearEdges { least_px: px, most_px: px } };
                        for index in [row * columns + column, other_row * columns + other_column] {
                            reach[index] = reach[index].with(edge);
                        }
                    }
                }
            }
        }
        spread(&mut reach, columns);
        reach.reverse();
        spread(&mut reach, columns);
        reach.reverse();
        reach.into_iter().map(|reach| reach.edges).collect()
    }
}

/// The first surface of a scene and what lies behind it: layer coordinates, sample by sample.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    first: &'a [f32],
    second: Option<&'a [f32]>,
    rows: usize,
    columns: usize,
    border: Border,
}

impl Surfaces<'_> {
    /// Returns the layer coordinates of both surfaces at rows and columns of the scene; NaN for nothing.
    #[inline(always)]
    pub(crate) fn at_all(&self, rows: &Lanes, columns: &Lanes) -> [Lanes; 2] {
        if self.border == Border::Mirror {
            let seen: [[f32; 2]; RAYS] = std::array::from_fn(|ray| self.at([rows[ray], columns[ray]]));
            return [0, 1].map(|of| seen.map(|surfaces| surfaces[of]));
        }
        let nearest = |position: f32, n: usize| (position + 0.5).clamp(0.0, (n - 1) as f32) as u32;
        let mut samples = [0; RAYS];
        for ray in 0..RAYS {
            samples[ray] = nearest(rows[ray], self.rows) * self.columns as u32 + nearest(columns[ray], self.columns);
        }
        let is_seen = |ray: usize| (rows[ray] + columns[ray]).is_finite();
        let of = |surface: &[f32]| -> Lanes {
            std::array::from_fn(|ray| if is_seen(ray) { surface[samples[ray] as usize] } else { f32::NAN })
        };
        [of(self.first), self.second.map_or([f32::NAN; RAYS], of)]
    }

    /// Returns the layer coordinates of the first surface at a row and column of the scene, and of what lies behind it; NaN for nothing.
    #[inline]
    pub(crate) fn at(&self, [row, column]: [f32; 2]) -> [f32; 2] {
        if !(row.is_finite() && column.is_finite()) {
            return [f32::NAN; 2];
        }
        let nearest = |position: f32, n: usize| match self.border {
            Border::Mirror => (folded(f64::from(position), n, self.border) + 0.5) as usize,
            _ => ((position + 0.5).max(0.0) as usize).min(n - 1),
        };
        let sample = nearest(row, self.rows) * self.columns + nearest(column, self.columns);
        [self.first[sample], self.second.map_or(f32::NAN, |second| second[sample])]
    }
}

impl Looks {
    fn over(at: &Rectangle, (pixels, map, raster): (&Raster, &FilmMap, &SceneRaster)) -> Self {
        let blocks = |first: i64, n: usize| (first.div_euclid(BLOCK), (first + n as i64 - 1).div_euclid(BLOCK));
        let (rows, columns) = (blocks(at.first_row, at.rows), blocks(at.first_column, at.columns));
        let corner = |row: i64, column: i64| {
            let place_mm = DVec2::new(pixels.x_mm((BLOCK * column) as f64), pixels.y_mm((BLOCK * row) as f64));
            let looks_at = map.field_tan(place_mm).map(|tan| raster.position_of(tan.x, tan.y));
            looks_at.map_or([f32::NAN; 2], |position| position.map(|position| position as f32))
        };
        let corners = (rows.0..=rows.1 + 1).flat_map(|row| (columns.0..=columns.1 + 1).map(move |c| (row, c)));
        Self {
            first: (rows.0, columns.0),
            blocks: ((rows.1 - rows.0 + 1) as usize, (columns.1 - columns.0 + 1) as usize),
            corners: corners.map(|(row, column)| corner(row, column)).collect(),
        }
    }

    /// Returns the position among the samples that a place looks at, pixels from that of number 0; beyond the blocks as in the last of them.
    #[inline]
    fn at(&self, (row, column): (f32, f32)) -> [f32; 2] {
        let split = |px: f32, first: i64, n: usize| {
            let place = px * (1.0 / BLOCK as f32) - first as f32;
            let below = (place.max(0.0) as usize).min(n - 1);
            (below, place - below as f32)
        };
        let (above, down) = split(row, self.first.0, self.blocks.0);
        let (left, across) = split(column, self.first.1, self.blocks.1);
        let line = self.blocks.1 + 1;
        let upper = &self.corners[above * line + left..][..2];
        let lower = &self.corners[(above + 1) * line + left..][..2];
        std::array::from_fn(|axis| {
            let along = |corners: &[[f32; 2]]| corners[0][axis] + across * (corners[1][axis] - corners[0][axis]);
            along(upper) + down * (along(lower) - along(upper))
        })
    }

    /// The number of the block that a pixel lies in.
    fn block_of(&self, (row, column): (i64, i64)) -> usize {
        let from = |pixel: i64, first: i64| (pixel.div_euclid(BLOCK) - first) as usize;
        from(row, self.first.0) * self.blocks.1 + from(column, self.first.1)
    }

    /// The numbers of the blocks that some of the pixels lie in.
    fn blocks_of(&self, pixels: &Rectangle) -> impl Iterator<Item = usize> {
        let Rectangle { first_row, first_column, rows, columns } = *pixels;
        let first = self.block_of((first_row, first_column));
        let last = self.block_of((first_row + rows as i64 - 1, first_column + columns as i64 - 1));
        let across = last % self.blocks.1 - first % self.blocks.1;
        (first..=last - across).step_by(self.blocks.1).flat_map(move |first| first..=first + across)
    }
}

/// The blur radius over depth at a place, with its sign, pixels: it is linear in dioptres.
#[derive(Clone, Copy, Debug)]
struct Blur {
    at_infinity_px: f64,
    px_per_dioptre: f64,
}

impl Blur {
    #[inline]
    fn of(self, dioptres: f64) -> f32 {
        (self.at_infinity_px + self.px_per_dioptre * dioptres) as f32
    }

    /// Returns the largest of the blur radii of layers.
    fn widest_px(self, dioptres: &[f64]) -> f32 {
        [dioptres.first(), dioptres.last()].into_iter().flatten().map(|d| self.of(*d).abs()).fold(0.0, f32::max)
    }
}

/// The blur over depth at each block of pixels of a film.
#[derive(Debug)]
struct BlurOverFilm {
    /// The rows and columns of blocks that the film has a part of, first and last.
    rows: (i64, i64),
    columns: (i64, i64),
    by_block: Vec<Blur>,
}

impl BlurOverFilm {
    fn of((lens, film, wavelength_nm): (&dyn LensImage, &Film, f64)) -> Self {
        let (pixels, pitch_mm) = (film_pixels(film), 1e-3 * film.pitch_um);
        let blocks = |first: i64, n: usize| (first.div_euclid(BLOCK), (first + n as i64 - 1).div_euclid(BLOCK));
        let (rows, columns) = (blocks(pixels.first_row, pixels.rows), blocks(pixels.first_column, pixels.columns));
        let places = (rows.0..=rows.1).flat_map(|row| (columns.0..=columns.1).map(move |column| (row, column)));
        let blur = |(row, column): (i64, i64)| {
            let middle = DVec2::new(column as f64 + 0.5, -(row as f64 + 0.5)) * (BLOCK as f64 * pitch_mm);
            let half_mm = film.half_size_mm();
            let radius_px = |dioptres: f64| {
                lens.blur_radius_mm(middle.clamp(-half_mm, half_mm), dioptres, wavelength_nm) / pitch_mm
            };
            let at_infinity_px = radius_px(0.0);
            Blur { at_infinity_px, px_per_dioptre: radius_px(1.0) - at_infinity_px }
        };
        Self { rows, columns, by_block: places.map(blur).collect() }
    }

    /// Returns that of a pixel; beside the film, of the nearest of its blocks.
    fn at(&self, (row, column): (i64, i64)) -> Blur {
        let row = row.div_euclid(BLOCK).clamp(self.rows.0, self.rows.1) - self.rows.0;
        let column = column.div_euclid(BLOCK).clamp(self.columns.0, self.columns.1) - self.columns.0;
        self.by_block[(row * (self.columns.1 - self.columns.0 + 1) + column) as usize]
    }

    fn widest_px(&self, dioptres: &[f64]) -> f32 {
        self.by_block.iter().map(|blur| blur.widest_px(dioptres)).fold(0.0, f32::max)
    }
}

/// How much farther edges reach from a pixel, and which these are.
#[derive(Clone, Copy, Default)]
struct Reach {
    left_px: f32,
    edges: NearEdges,
}

impl Reach {
    /// Takes in what reaches it from elsewhere.
    fn with(self, other: Self) -> Self {
        if other.left_px <= 0.0 {
            return self;
        }
        if self.left_px <= 0.0 {
            return other;
        }
        let (mine, others) = (self.edges, other.edges);
        let edges =
            NearEdges { least_px: mine.least_px.min(others.least_px), most_px: mine.most_px.max(others.most_px) };
        Self { left_px: self.left_px.max(other.left_px), edges }
    }
}

/// Spreads reaches from above and the left, a pixel a step.
fn spread(reach: &mut [Reach], columns: usize) {
    for index in 0..reach.len() {
        let column = index % columns;
        let above = index.checked_sub(columns);
        let (left, right) = (column > 0, column + 1 < columns);
        let beside = [
            (above, 1.0),
            (left.then(|| index - 1), 1.0),
            (above.filter(|_| left).map(|above| above - 1), std::f32::consts::SQRT_2),
            (above.filter(|_| right).map(|above| above + 1), std::f32::consts::SQRT_2),
        ];
        for (other, step) in beside {
            let Some(other) = other else { continue };
            let from = Reach { left_px: reach[other].left_px - step, ..reach[other] };
            reach[index] = reach[index].with(from);
        }
    }
}
