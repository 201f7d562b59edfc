//! Pictures drawn from ray maps.

use dioptric_diffraction::CircularStop;
use glam::DVec2;
use ndarray::Array2;

use crate::{
    Kernel,
    hurb_splatter::{HurbSplatter, StopHurb},
    kernel::trim,
    raster::Raster,
    ray_map::{Node, RayMap},
};

/// Half the side of the largest window, pixels.
const MOST_PIXELS: f64 = 600.0;
/// Of what the window of a diffracted picture holds, the share that is kept when the window is trimmed.
const KEPT_OF_TAILS: f64 = 0.999;
/// How far diffraction's tails are followed beyond the geometric picture, in units of λN.
const TAILS: f64 = 12.0;

/// A ray map turned to its field and scaled to pixels, and the window that holds it.
pub(crate) struct Layout<'a> {
    record: &'a RayMap,
    nodes: Vec<Node>,
    bending: Option<StopHurb>,
    /// The geometric picture's reach from the centroid, pixels.
    reach: f64,
    /// λN, pixels; 0 without diffraction.
    unit: f64,
    side: usize,
    /// The side that holds the picture about its centroid.
    natural_side: usize,
}

impl<'a> Layout<'a> {
    /// Returns the layout of a ray map; `turn` is the direction of the field in the picture.
    pub(crate) fn new(record: &'a RayMap, turn: DVec2, bending: Option<StopHurb>, pitch_um: f64) -> Self {
        let scale = 1e3 / pitch_um;
        let mut nodes: Vec<Node> = (0..record.mesh.n_nodes()).map(|i| record.node(i)).collect();
        for node in &mut nodes {
            for v in [&mut node.at_mm, &mut node.along_l_mm, &mut node.along_m_mm] {
                // To pixels: columns to the right, rows down.
                *v = turn.rotate(*v) * DVec2::new(scale, -scale);
            }
        }
        let reach = reach(record, &nodes);
        let unit = bending.map_or(0.0, |bending| unit(record, &nodes, bending));
        let side = side_for(reach, unit);
        Self { record, nodes, bending, reach, unit, side, natural_side: side }
    }

    /// Returns the layout about a place beside the centroid, pixels to the right and down, in a window that holds the picture about it.
    pub(crate) fn about(mut self, place_px: DVec2) -> Self {
        self.nodes.iter_mut().for_each(|node| node.at_mm -= place_px);
        let side = side_for(reach(self.record, &self.nodes), self.unit);
        Self { side, ..self }
    }

    /// Returns the layout with a window of so many pixels along its side, if any are asked for.
    pub(crate) fn with_side(self, side: Option<usize>) -> Self {
        Self { side: side.unwrap_or(self.side), ..self }
    }

    /// The side of the window in pixels; an odd number unless another was asked for.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// λN, pixels; 0 without diffraction.
    pub(crate) fn lambda_n_px(&self) -> f64 {
        self.unit
    }

    /// The range of phases B that a wave sum would have to follow, radians: over the pupil's radius, for light from
    /// its outermost ray to the corner of the window that holds the picture.
    pub(crate) fn bandwidth(&self) -> f64 {
        let corner = std::f64::consts::FRAC_1_SQRT_2 * self.natural_side as f64;
        std::f64::consts::PI * (self.reach + corner) / self.unit
    }

    /// Draws the energy of each pixel of the window.
    pub(crate) fn draw(mut self) -> Array2<f64> {
        let middle = DVec2::splat(0.5 * self.side as f64);
        self.nodes.iter_mut().for_each(|node| node.at_mm += middle);
        let record = self.record;
        let mut raster = Raster::new(self.side(), self.side());
        let mut energies: Vec<f64> = record.energies().iter().map(|e| f64::from(*e)).collect();
        let at: Vec<DVec2> = self.nodes.iter().map(|node| node.at_mm).collect();
        if let Some(bending) = self.bending {
            let bent = HurbSplatter { mesh: record.mesh, nodes: &self.nodes, bending, size: raster.size() };
            bent.deposit(&mut energies, &mut raster);
        }
        raster.mesh(record.mesh, &at, &energies);
        raster.finish()
    }
}

/// Returns how far the picture reaches from the middle, pixels.
fn reach(record: &RayMap, nodes: &[Node]) -> f64 {
    lit_nodes(record).map(|i| nodes[i].at_mm.abs().max_element()).fold(0.0, f64::max)
}

/// Returns the side of a window that holds a picture of this reach and its tails, pixels: an odd number.
fn side_for(reach: f64, unit: f64) -> usize {
    2 * (reach + TAILS * unit - 0.5).ceil().clamp(0.0, MOST_PIXELS) as usize + 1
}

/// Returns the corners of the cells that have energy, some of them several times.
fn lit_nodes(record: &RayMap) -> impl Iterator<Item = usize> {
    let lit = record.mesh.cells().zip(record.energies()).filter(|(_, energy)| **energy != 0.0);
    lit.flat_map(|((ring, j), _)| record.mesh.corners(ring, j))
}

/// Returns drawn energies as a kernel, trimmed to what matters; `lambda_n_px` is 0 without diffraction.
pub(crate) fn kernel(energies: &Array2<f64>, lambda_n_px: f64, pitch_um: f64) -> Kernel {
    let kept = if lambda_n_px > 0.0 { KEPT_OF_TAILS } else { 1.0 - 1e-7 };
    Kernel::centered(trim(energies, kept), pitch_um).faded_out(lambda_n_px)
}

/// Returns λN in pixels: what the Gaussian of a ray through the middle of the stop would give.
fn unit(record: &RayMap, nodes: &[Node], bending: StopHurb) -> f64 {
    let center = nodes[record.mesh.node(0, 0)];
    let per_cosine = center.along_l_mm.length().max(center.along_m_mm.length());
    let CircularStop { radius_mm, wave_number_per_mm } = bending.edge;
    per_cosine * std::f64::consts::PI / (wave_number_per_mm * radius_mm)
}
