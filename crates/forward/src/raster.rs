//! Rasters of samples over the film.

use crate::Film;

/// Pixels along a side of a block, over which places in the scene are interpolated.
pub(crate) const BLOCK: i64 = 8;

/// The width of a raster's samples: pixels of the film times a power of two.
///
/// −1 is half a pixel, 0 a pixel, 1 two pixels. Blur that is wide is imaged on wide samples, detail below a pixel on narrow ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Level(pub(crate) i8);

impl Level {
    /// The film's own pixels.
    pub(crate) const PIXEL: Self = Self(0);
    /// Halves of them, and eighths: the finest.
    pub(crate) const HALF: Self = Self(-1);
    pub(crate) const EIGHTH: Self = Self(-3);

    /// The finest parts of pixels of which each is as wide as a sample of a scene, or wider, where so many lie along a pixel.
    pub(crate) fn of_density(density: usize) -> Self {
        Self(-(density.ilog2() as i8))
    }

    /// Pixels of the film from one sample to the next.
    pub(crate) fn step_px(self) -> f64 {
        f64::from(self.0).exp2()
    }

    /// The number of samples along a side of a pixel.
    pub(crate) fn per_pixel(self) -> usize {
        1 << (-self.0).max(0)
    }

    /// The number of pixels along a side of a sample.
    pub(crate) fn pixels(self) -> usize {
        1 << self.0.max(0)
    }
}

/// Samples over the plane of the film, counted from its middle: columns to the right, rows down.
///
/// The film's pixels are the samples of level 0. Those of other levels lie so that a mirror image of the raster about the film's middle is the raster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Raster {
    pub(crate) level: Level,
    /// Distance of the sample of number 0 from the film's middle, in samples, down and across: ½, or 0 where one lies in the middle.
    offset: [f64; 2],
    /// From one sample to the next, mm.
    pitch_mm: f64,
}

impl Raster {
    pub(crate) fn new(film: &Film, level: Level) -> Self {
        let offset = |n: usize| if level.0 < 0 || n.is_multiple_of(2) { 0.5 } else { 0.0 };
        let offset = [offset(film.rows), offset(film.columns)];
        Self { level, offset, pitch_mm: 1e-3 * film.pitch_um * level.step_px() }
    }

    /// The distance from one sample to the next, µm.
    pub(crate) fn pitch_um(&self) -> f64 {
        1e3 * self.pitch_mm
    }

    /// Returns how far to the right of the middle a column lies, mm.
    pub(crate) fn x_mm(&self, column: f64) -> f64 {
        (column + self.offset[1]) * self.pitch_mm
    }

    /// Returns how far above the middle a row lies, mm.
    pub(crate) fn y_mm(&self, row: f64) -> f64 {
        -(row + self.offset[0]) * self.pitch_mm
    }

    /// Returns how far below the middle a row lies, pixels of the film.
    pub(crate) fn down_px(&self, row: i64) -> f64 {
        (row as f64 + self.offset[0]) * self.level.step_px()
    }

    /// Returns how far to the right of the middle a column lies, pixels of the film.
    pub(crate) fn across_px(&self, column: i64) -> f64 {
        (column as f64 + self.offset[1]) * self.level.step_px()
    }

    /// Returns the number of the block of [`BLOCK`] pixels, along rows (0) or columns (1), in which a sample lies, and that of the first sample behind it.
    pub(crate) fn block(&self, axis: usize, at: i64) -> (i64, i64) {
        let pixels = self.level.pixels() as i64;
        if pixels > BLOCK {
            let middle = 2 * at + i64::from(self.offset[axis] > 0.0);
            return (middle * (pixels / BLOCK / 2), at + 1);
        }
        // As many in each, a power of two, and no block ends in the midst of a sample's half.
        let doublings = (BLOCK * self.level.per_pixel() as i64 / pixels).ilog2();
        let block = at >> doublings;
        (block, (block + 1) << doublings)
    }

    /// Returns the number of the last row that lies no farther down than so many pixels.
    pub(crate) fn row_before(&self, down_px: f64) -> i64 {
        (down_px / self.level.step_px() - self.offset[0]).floor() as i64
    }

    /// Returns the number of the last column that lies no farther to the right than so many pixels.
    pub(crate) fn column_before(&self, across_px: f64) -> i64 {
        (across_px / self.level.step_px() - self.offset[1]).floor() as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_all_levels_lie_symmetrically() {
        for (rows, columns) in [(4, 6), (5, 7)] {
            let film = Film::centered(rows, columns, 2.0);
            for level in [Level::EIGHTH, Level::HALF, Level::PIXEL, Level(1), Level(3)] {
                let raster = Raster::new(&film, level);
                // The mirror image of a column is one too.
                let mirrored = raster.column_before(-raster.across_px(2));
                assert_eq!(raster.across_px(mirrored), -raster.across_px(2));
                assert_eq!(raster.row_before(raster.down_px(-3)), -3);
                assert!((raster.x_mm(1.0) - 2e-3 * raster.across_px(1)).abs() < 1e-15);
            }
            for level in [Level::EIGHTH, Level::HALF, Level::PIXEL, Level(2), Level(3), Level(4), Level(6)] {
                let raster = Raster::new(&film, level);
                for at in -100..100 {
                    let block_of = |px: f64| (px / BLOCK as f64).floor() as i64;
                    let (block, next) = raster.block(1, at);
                    assert_eq!(
                        (block, raster.block(0, at).0),
                        (block_of(raster.across_px(at)), block_of(raster.down_px(at)))
                    );
                    assert!(next == at + 1 || block_of(raster.across_px(next - 1)) == block);
                    assert!(block_of(raster.across_px(next)) > block);
                }
            }
            // The first pixel of the film.
            let pixels = Raster::new(&film, Level::PIXEL);
            assert_eq!(pixels.across_px(-(columns as i64 / 2)), -0.5 * (columns as f64 - 1.0));
        }
    }
}
