//! Kernels drawn from spots.

use dioptric_diffraction::CircularStop;
use glam::{DVec2, IVec2};
use ndarray::Array2;

use crate::{
    Diffraction, Kernel,
    hurb_splatter::{HurbSplatter, StopHurb},
    kernel::trim,
    raster::Raster,
    spots::{Node, Spots},
};

/// Half the side of the largest window, pixels.
const MOST_PIXELS: f64 = 600.0;
/// Of what the window of a diffracted picture holds, the share that is kept when the window is trimmed.
const KEPT_OF_TAILS: f64 = 0.999;
/// The same of a picture without tails: all but rounding.
const KEPT_OF_RAYS: f64 = 1.0 - 1e-7;
/// How far diffraction's tails are followed beyond the geometric picture, in units of λN.
const TAILS: f64 = 12.0;
/// The largest range of phases, radians, at which a kernel is wave optics alone; at twice that there is none.
const ALL_WAVE: f64 = 200.0;

/// Spots on pixels, and the window that holds them.
pub(crate) struct Layout<'a> {
    spots: &'a Spots,
    /// In pixels about the middle of the window's middle pixel, columns to the right and rows down.
    nodes: Vec<Node>,
    bending: Option<StopHurb>,
    /// The middle pixel of the window, to the right of the one about which spots count, and below it.
    middle_px: IVec2,
    /// The geometric picture's reach from the middle, pixels.
    reach: f64,
    /// λN, pixels; 0 without diffraction.
    lambda_n_px: f64,
    side: usize,
    /// The side that holds the picture.
    natural_side: usize,
}

impl<'a> Layout<'a> {
    /// Lays out spots on pixels of which one has its middle where places count from, in a window about the middle of the light.
    pub(crate) fn new(spots: &'a Spots, bending: Option<StopHurb>, pitch_um: f64) -> Self {
        let per_mm = DVec2::new(1e3, -1e3) / pitch_um;
        let mut nodes = spots.nodes.clone();
        for node in &mut nodes {
            for v in [&mut node.at_mm, &mut node.along_l_mm, &mut node.along_m_mm] {
                *v *= per_mm;
            }
        }
        let (low, high) = bounds(spots, &nodes);
        let middle = (0.5 * (low + high)).round();
        let middle_px = if middle.is_finite() { middle.as_ivec2() } else { IVec2::ZERO };
        nodes.iter_mut().for_each(|node| node.at_mm -= middle_px.as_dvec2());
        let reach = (high - middle).max(middle - low).max_element().max(0.0);
        let lambda_n_px = bending.map_or(0.0, |bending| lambda_n(&nodes[0], bending));
        let side = 2 * (reach + TAILS * lambda_n_px - 0.5).ceil().clamp(0.0, MOST_PIXELS) as usize + 1;
        Self { spots, nodes, bending, middle_px, reach, lambda_n_px, side, natural_side: side }
    }

    /// Returns the layout in a window of so many pixels along its side about where places count from: about the middle of a pixel if the
    /// number is odd, else about the corner of four.
    pub(crate) fn with_side(mut self, side: usize) -> Self {
        let middle_px = std::mem::take(&mut self.middle_px).as_dvec2();
        self.nodes.iter_mut().for_each(|node| node.at_mm += middle_px);
        Self { side, ..self }
    }

    /// The side of the window, pixels.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// The middle of the window, pixels to the right of where places count from, and below it.
    pub(crate) fn middle_px(&self) -> IVec2 {
        self.middle_px
    }

    /// The range of phases B that a wave sum would have to follow, radians: over the pupil's radius, for light from
    /// its outermost ray to the corner of the window that holds the picture.
    fn bandwidth(&self) -> f64 {
        let corner = std::f64::consts::FRAC_1_SQRT_2 * self.natural_side as f64;
        std::f64::consts::PI * (self.reach + corner) / self.lambda_n_px
    }

    /// Returns how much of the picture is wave optics: 1 up to a range of phases of 200, falling with its logarithm to 0 at 400.
    pub(crate) fn wave_fraction(&self, diffraction: Diffraction) -> f64 {
        match diffraction {
            Diffraction::Wave => (2.0 - (self.bandwidth() / ALL_WAVE).log2()).clamp(1.0, 2.0) - 1.0,
            _ => 0.0,
        }
    }

    /// Draws the energy of each pixel of the window.
    pub(crate) fn draw(&self) -> Array2<f64> {
        // Count from the corner of the window.
        let middle = DVec2::splat(0.5 * self.side as f64);
        let mut nodes = self.nodes.clone();
        nodes.iter_mut().for_each(|node| node.at_mm += middle);
        let mut raster = Raster::new(self.side, self.side);
        let (mesh, mut energies) = (self.spots.mesh, self.spots.energies.clone());
        // Deposit what diffraction spreads as Gaussians, the rest as polygons.
        if let Some(bending) = self.bending {
            let bent = HurbSplatter { mesh, nodes: &nodes, bending, size: raster.size() };
            bent.deposit(&mut energies, &mut raster);
        }
        let at: Vec<DVec2> = nodes.iter().map(|node| node.at_mm).collect();
        raster.mesh(mesh, &at, &energies);
        raster.finish()
    }

    /// Returns drawn energies of the window as a kernel of sum 1, trimmed to what matters.
    pub(crate) fn kernel(&self, energies: &Array2<f64>, pitch_um: f64) -> Kernel {
        let kept = if self.lambda_n_px > 0.0 { KEPT_OF_TAILS } else { KEPT_OF_RAYS };
        let kernel = Kernel::centered(trim(energies, kept), pitch_um).faded_out(self.lambda_n_px);
        Kernel { middle_px: self.middle_px, ..kernel }.normalized()
    }
}

/// Returns the corners of the box that holds the cells which have energy, pixels.
fn bounds(spots: &Spots, nodes: &[Node]) -> (DVec2, DVec2) {
    let lit = spots.mesh.cells().zip(&spots.energies).filter(|(_, energy)| **energy != 0.0);
    let corners = lit.flat_map(|((ring, j), _)| spots.mesh.corners(ring, j)).map(|node| nodes[node].at_mm);
    corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
}

/// Returns λN in pixels: what the Gaussian of a ray through the middle of the pupil would give.
fn lambda_n(center: &Node, bending: StopHurb) -> f64 {
    let per_cosine = center.along_l_mm.length().max(center.along_m_mm.length());
    let CircularStop { radius_mm, wave_number_per_mm } = bending.edge;
    per_cosine * std::f64::consts::PI / (wave_number_per_mm * radius_mm)
}
