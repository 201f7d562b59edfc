//! The depth picture as rays through the pupil meet it.

use dioptric_psf::{FilmMap, LensImage};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    Film,
    blocks::BLOCK,
    layers::DEPTH_EDGE_PX,
    places::{Places, SceneRaster, UNSEEN},
    raster::{Level, Raster},
    rectangle::Rectangle,
    scene_layers::SceneLayers,
    surface::LayerCoordinates,
    tile::film_pixels,
};

/// The surfaces of the scene as the chief rays of a film and of what lies around it meet them.
///
/// The ray from a film point x to a sample s of layer j passes layer i at q = x + (s − x) `ρ_i / ρ_j`, with ρ the blur radii (docs/forward.md 3).
#[derive(Debug)]
pub(crate) struct Sight {
    /// The pixels of the film and those around it.
    at: Rectangle,
    /// Samples along a pixel, as fine as the scene.
    per_pixel: usize,
    /// The layer coordinate of each sample of the first surface, and of what lies behind it until that is [forgotten](Self::forget_second), in parts of a layer, row by row.
    first: Vec<u16>,
    second: Vec<u16>,
    /// Of each pixel.
    near_edges: Vec<NearEdges>,
    /// Of each layer.
    dioptres: Vec<f32>,
    blur: BlurOverFilm,
    /// How far below and to the right of the film's middle the middle of the pixel of number 0 lies, pixels.
    middle: (f32, f32),
}

/// Blur radii of the near sides of the edges of depth in the bundle of a pixel, pixels: the smallest and the largest; 0 where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct NearEdges {
    pub(crate) least_px: f32,
    pub(crate) most_px: f32,
}

/// A layer that rays meet, and its blur radius over that of the layer to which the rays are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    pub(crate) layer: usize,
    pub(crate) ratio: f32,
    /// Whether the first surface has a part of it.
    pub(crate) is_of_first: bool,
}

/// Parts of a layer that coordinates are told apart by; the last number is nothing seen.
const PARTS_OF_LAYER: f32 = 64.0;
const NOTHING: u16 = u16::MAX;
/// The most samples of coordinates along a pixel.
const MOST_PER_PIXEL: f64 = 4.0;
/// How far apart the two sides of a soft edge may lie, pixels.
const SOFT_EDGE: [usize; 2] = [1, 3];

impl Sight {
    /// Looks at the scene from a film by the map of a band; `None` where no layer hides another.
    pub(crate) fn of(
        (lens, film, wavelength_nm): (&dyn LensImage, &Film, f64),
        map: &FilmMap,
        raster: &SceneRaster,
        scene: &SceneLayers,
        cancel: &Cancel,
    ) -> Result<Option<Self>, Cancelled> {
        if !scene.hides {
            return Ok(None);
        }
        let blur = BlurOverFilm::of((lens, film, wavelength_nm));
        let dioptres: Vec<f32> = scene.layers.dioptres().iter().map(|dioptres| *dioptres as f32).collect();
        let widest_px = blur.widest_px(&dioptres);
        let margin = (widest_px.ceil() as usize).min(film.rows.max(film.columns)) + SOFT_EDGE[1];
        let pixels = Raster::new(film, Level::PIXEL);
        let mut this = Self {
            at: film_pixels(film).grown(margin),
            per_pixel: scene.samples_per_pixel.round().clamp(1.0, MOST_PER_PIXEL) as usize,
            first: vec![],
            second: vec![],
            near_edges: vec![],
            dioptres,
            blur,
            middle: (pixels.down_px(0) as f32, pixels.across_px(0) as f32),
        };
        this.first = this.looked_at((&pixels, map, raster), &scene.coordinates, cancel)?;
        this.near_edges = this.find_near_edges();
        if this.near_edges.iter().all(|edges| edges.most_px <= 0.0) {
            return Ok(None);
        }
        if let Some(coordinates) = scene.occluded.layer_coordinates() {
            this.second = this.looked_at((&pixels, map, raster), coordinates, cancel)?;
        }
        Ok(Some(this))
    }

    /// Returns the coordinates of a surface as chief rays meet it.
    fn looked_at(
        &self,
        (pixels, map, raster): (&Raster, &FilmMap, &SceneRaster),
        surface: &LayerCoordinates,
        cancel: &Cancel,
    ) -> Result<Vec<u16>, Cancelled> {
        let Rectangle { first_row, first_column, rows, columns } = self.at;
        let (columns, step) = (columns * self.per_pixel, 1.0 / self.per_pixel as f64);
        let place = |first: i64, sample: usize| first as f64 - 0.5 + (sample as f64 + 0.5) * step;
        let step_mm = step * (pixels.x_mm(1.0) - pixels.x_mm(0.0));
        let (beside, below) = raster.steps();
        let of_row = |places: &mut Places, row: usize| {
            cancel.check()?;
            let y_mm = pixels.y_mm(place(first_row, row));
            places.find(raster, map, columns, (pixels.x_mm(place(first_column, 0)), step_mm, y_mm));
            let nearest = |k: usize| {
                if places.first[k] == UNSEEN {
                    return NOTHING;
                }
                let right = if places.across[k] >= 0.5 { beside } else { 0 };
                let down = if places.down[k] >= 0.5 { below } else { 0 };
                let coordinate = surface.samples()[places.first[k] as usize + right + down];
                if coordinate.is_nan() { NOTHING } else { (coordinate * PARTS_OF_LAYER).round() as u16 }
            };
            Ok((0..columns).map(nearest).collect())
        };
        let all = (0..rows * self.per_pixel).into_par_iter().map_init(Places::default, of_row);
        Ok(all.collect::<Result<Vec<Vec<u16>>, Cancelled>>()?.concat())
    }

    pub(crate) fn size_bytes(&self) -> usize {
        size_of_val(self.first.as_slice())
            + size_of_val(self.second.as_slice())
            + size_of_val(self.near_edges.as_slice())
            + size_of_val(self.blur.by_block.as_slice())
    }

    /// Drops what lies behind the first surface: only plans ask for it.
    pub(crate) fn forget_second(&mut self) {
        self.second = vec![];
    }

    /// Returns the blur radius at a pixel of a layer with its sign, pixels.
    pub(crate) fn radius_px(&self, layer: usize, pixel: (i64, i64)) -> f32 {
        self.blur.at(pixel).of(self.dioptres[layer])
    }

    /// Returns the blur radius at a pixel of a depth with its sign, pixels.
    pub(crate) fn radius_px_of(&self, dioptres: f64, pixel: (i64, i64)) -> f32 {
        self.blur.at(pixel).of(dioptres as f32)
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

    /// Returns the layer coordinates of the first surface at a place, pixels from the film's middle, and of what lies behind it, NaN for nothing; beyond what is known, those at the
    /// border.
    #[inline]
    pub(crate) fn coordinates_at(&self, place_px: (f32, f32)) -> (f32, f32) {
        let sample = self.sample_at(place_px);
        (coordinate(self.first[sample]), self.second.get(sample).map_or(f32::NAN, |second| coordinate(*second)))
    }

    #[inline]
    fn sample_at(&self, (down, across): (f32, f32)) -> usize {
        let n = self.per_pixel as f32;
        let sample = |px: f32, middle: f32, first: i64, pixels: usize| {
            let sample = ((px - middle + 0.5 - first as f32) * n).max(0.0) as usize;
            sample.min(pixels * self.per_pixel - 1)
        };
        let row = sample(down, self.middle.0, self.at.first_row, self.at.rows);
        let column = sample(across, self.middle.1, self.at.first_column, self.at.columns);
        row * self.at.columns * self.per_pixel + column
    }

    /// Whether the ray from a film point through a point so many pixels beside it, in the layer to which ratios refer, reaches a layer.
    #[inline]
    pub(crate) fn reaches(&self, layer: usize, met: &[Met], from: (f32, f32), beside: (f32, f32)) -> bool {
        let mut ray = Ray::default();
        for &Met { layer: before, ratio, .. } in met.iter().take_while(|met| met.layer <= layer) {
            let sample = self.sample_at((from.0 + ratio * beside.0, from.1 + ratio * beside.1));
            ray.pass(before, coordinate(self.first[sample]));
        }
        ray.arrive(layer);
        ray.reaches(layer)
    }

    /// Returns the layers that the rays of some pixels may meet, nearest first, all with the ratio to a blur radius of 1 pixel.
    pub(crate) fn met_by(&self, pixels: &Rectangle) -> Vec<Met> {
        let mut is_met = vec![[false; 2]; self.dioptres.len()];
        let blur =
            self.blur.at((pixels.first_row + pixels.rows as i64 / 2, pixels.first_column + pixels.columns as i64 / 2));
        let widest = blur.widest_px(&self.dioptres);
        let around = pixels.grown(widest.ceil() as usize + 1);
        if let Some(around) = around.intersection(&self.at) {
            let n = self.per_pixel;
            let (row, column) = (around.first_row - self.at.first_row, around.first_column - self.at.first_column);
            let columns = column as usize * n..(column as usize + around.columns) * n;
            for line in (row as usize * n..(row as usize + around.rows) * n).step_by(n) {
                let first = line * self.at.columns * n;
                for (number, surface) in [&self.first, &self.second].into_iter().enumerate() {
                    let line = surface.get(first + columns.start..first + columns.end).unwrap_or_default();
                    for &coordinate in line.iter().step_by(n).filter(|coordinate| **coordinate != NOTHING) {
                        let coordinate = f32::from(coordinate) / PARTS_OF_LAYER;
                        for layer in [coordinate.floor() as usize, coordinate.ceil() as usize] {
                            is_met.get_mut(layer).into_iter().for_each(|is_met| is_met[number] = true);
                        }
                    }
                }
            }
        }
        // One sample in each pixel was looked at: between two layers of a slant there may be one more.
        for layer in 1..is_met.len().saturating_sub(1) {
            let around = [is_met[layer - 1], is_met[layer + 1]];
            (0..2).for_each(|of| is_met[layer][of] |= around[0][of] && around[1][of]);
        }
        let met = is_met.iter().enumerate().filter(|(_, is_met)| is_met[0] || is_met[1]);
        met.map(|(layer, is_met)| Met { layer, ratio: blur.of(self.dioptres[layer]), is_of_first: is_met[0] }).collect()
    }

    /// The dioptres at a layer coordinate; those of the last layer where nothing is seen.
    fn dioptres_at(&self, coordinate: u16) -> f32 {
        let last = self.dioptres.len() - 1;
        let coordinate = f32::from(coordinate) / PARTS_OF_LAYER;
        let below = (coordinate as usize).min(last);
        let above = (below + 1).min(last);
        self.dioptres[below] + coordinate.fract() * (self.dioptres[above] - self.dioptres[below])
    }

    /// Returns the edges of depth in the bundle of each pixel: those no farther from it than the blur radius of their near sides.
    fn find_near_edges(&self) -> Vec<NearEdges> {
        let Rectangle { rows, columns, .. } = self.at;
        let mut reach = vec![Reach::default(); rows * columns];
        let coordinate = |row: usize, column: usize| {
            let [row, column] = [row, column].map(|pixel| pixel * self.per_pixel + self.per_pixel / 2);
            self.first[row * columns * self.per_pixel + column]
        };
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let mine = coordinate(row, column);
            let blur = self.blur.at((self.at.first_row + row as i64, self.at.first_column + column as i64));
            let radius_at = |coordinate: u16| blur.of(self.dioptres_at(coordinate));
            for by in SOFT_EDGE {
                for (other_row, other_column) in [(row, column + by), (row + by, column)] {
                    if other_row >= rows || other_column >= columns {
                        continue;
                    }
                    let other = coordinate(other_row, other_column);
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

/// The blur radius over depth at a place, with its sign, pixels: it is linear in dioptres.
#[derive(Clone, Copy, Debug)]
struct Blur {
    at_infinity_px: f32,
    px_per_dioptre: f32,
}

impl Blur {
    #[inline]
    fn of(self, dioptres: f32) -> f32 {
        self.at_infinity_px + self.px_per_dioptre * dioptres
    }

    /// Returns the largest of the blur radii of layers.
    fn widest_px(self, dioptres: &[f32]) -> f32 {
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
            Blur { at_infinity_px: at_infinity_px as f32, px_per_dioptre: (radius_px(1.0) - at_infinity_px) as f32 }
        };
        Self { rows, columns, by_block: places.map(blur).collect() }
    }

    /// Returns that of a pixel; beside the film, of the nearest of its blocks.
    fn at(&self, (row, column): (i64, i64)) -> Blur {
        let row = row.div_euclid(BLOCK).clamp(self.rows.0, self.rows.1) - self.rows.0;
        let column = column.div_euclid(BLOCK).clamp(self.columns.0, self.columns.1) - self.columns.0;
        self.by_block[(row * (self.columns.1 - self.columns.0 + 1) + column) as usize]
    }

    fn widest_px(&self, dioptres: &[f32]) -> f32 {
        self.by_block.iter().map(|blur| blur.widest_px(dioptres)).fold(0.0, f32::max)
    }
}

/// Returns a layer coordinate; NaN where there is nothing.
#[inline]
fn coordinate(parts: u16) -> f32 {
    if parts == NOTHING { f32::NAN } else { f32::from(parts) * (1.0 / PARTS_OF_LAYER) }
}

/// A ray on its way from the nearest layer to the farthest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// The layer passed last, and the coordinate of the surface there.
    last: (usize, f32),
    /// The first of the layers that it does not reach.
    ends: usize,
}

/// The most layers that a surface goes nearer or farther from one layer to the next, as a ray passes them: of more, it is not one surface.
const MOST_OF_SURFACE: f32 = 2.0;

impl Default for Ray {
    fn default() -> Self {
        Self { last: (0, f32::NAN), ends: usize::MAX }
    }
}

impl Ray {
    /// Passes a layer, in which the first surface lies at a coordinate where the ray is. It ends in a surface that lies behind it in one layer and before it in the next;
    /// one that only comes to lie before it has an edge there, and the ray passes behind that.
    #[inline]
    pub(crate) fn pass(&mut self, layer: usize, surface: f32) {
        let (last, last_surface) = self.last;
        let next = (last + 1) as f32;
        // Where no surface lies in the next layer, one can only lie in the last.
        let crosses = match last + 1 == layer {
            true => surface < next && (surface - last_surface).abs() <= MOST_OF_SURFACE,
            false => last_surface < next,
        };
        if crosses && last_surface >= last as f32 {
            // Both layers have a part of that surface.
            self.ends = self.ends.min(last + 2);
        }
        self.last = (layer, surface);
    }

    /// Passes what lies before a layer in which its surface may be too small to have been met.
    #[inline]
    fn arrive(&mut self, layer: usize) {
        if self.last.0 < layer {
            self.pass(layer, f32::NAN);
        }
    }

    /// Whether it reaches a layer.
    #[inline]
    pub(crate) fn reaches(&self, layer: usize) -> bool {
        layer < self.ends
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the first layer that a ray does not reach past the coordinates of a surface in layers one after the other.
    fn ends(first: usize, surface: &[f32]) -> usize {
        let mut ray = Ray::default();
        surface.iter().enumerate().for_each(|(i, surface)| ray.pass(first + i, *surface));
        ray.ends
    }

    #[test]
    fn rays_end_where_they_cross_a_surface() {
        // A plane between layers 2 and 3, and in layer 2.
        assert_eq!(ends(0, &[2.4; 6]), 4);
        assert_eq!(ends(0, &[2.0; 6]), 4);
        // A slant that goes away from the ray, and one that comes towards it.
        assert_eq!(ends(0, &[2.0, 2.5, 3.0, 3.5, 4.0, 4.5]), 6);
        assert_eq!(ends(0, &[6.0, 5.0, 4.0, 3.0, 2.0, 1.0]), 5);
        // Behind the edge of something near, and on to what lies far.
        assert_eq!(ends(0, &[9.0, 9.0, 9.0, 0.0, 0.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]), 11);
        assert_eq!(ends(0, &[f32::NAN; 5]), usize::MAX);
    }

    #[test]
    fn surfaces_lie_in_the_last_layer_before_a_gap() {
        let mut ray = Ray::default();
        ray.pass(1, 1.0);
        ray.pass(7, 9.0);
        assert!(ray.reaches(2) && !ray.reaches(3));
        let mut ray = Ray::default();
        ray.pass(1, 7.0);
        ray.pass(7, 7.0);
        ray.arrive(9);
        assert!(ray.reaches(8) && !ray.reaches(9));
    }
}
