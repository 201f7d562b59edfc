//! Kernels drawn from spots.

use dioptric_diffraction::{CircularStop, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::{MonoLens, ObjectPoint};
use glam::{DVec2, IVec2};
use ndarray::{Array1, Array2, Axis};
use serde::Serialize;

use crate::{
    Diffraction, ImageSettings, Kernel, PsfError,
    hurb_splatter::{HurbSplatter, StopHurb},
    kernel::trim,
    mesh::Mesh,
    raster::Raster,
    spots::{Node, Spots},
};

/// Half the side of the largest window, pixels.
const MOST_PIXELS: f64 = 600.0;
/// How far diffraction's tails are followed beyond the geometric picture, in units of λN.
const TAILS: f64 = 11.0;
/// Parts of a pixel, each way, on which light is drawn that hardly reaches beyond it: an odd number, so that one lies in the middle.
pub(crate) const PARTS: usize = 3;
/// How far from the middle light and λN together may reach to be drawn so, pixels.
pub(crate) const NARROW: f64 = 3.0;
/// The largest range of phases, radians, at which a kernel is wave optics alone; at twice that there is none.
const ALL_WAVE: f64 = 200.0;

/// Which model a point spread function was drawn with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelUse {
    /// How much of it is the diffraction integral; the rest is geometric rays or HURB, as the setting says.
    pub wave_fraction: f64,
    /// Why waves that were wanted were not summed, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fallback: Option<String>,
}

/// Spots on pixels, and the window that holds them.
pub(crate) struct Layout<'a> {
    spots: &'a Spots,
    /// In pixels about the middle of the window's middle pixel, columns to the right and rows down.
    nodes: Vec<Node>,
    bending: Option<StopHurb>,
    /// The middle pixel of the window, to the right of the one about which spots count, and below it.
    middle_px: IVec2,
    /// The geometric picture's reach from the middle, pixels: along rows and columns, and any way.
    reach: f64,
    radius: f64,
    /// λN, pixels; 0 without diffraction.
    lambda_n_px: f64,
    side: usize,
    /// The side that holds the picture.
    natural_side: usize,
}

impl<'a> Layout<'a> {
    /// Lays out spots on pixels of which one has its middle where places count from, in a window about the middle of the light.
    pub(crate) fn new(spots: &'a Spots, bending: Option<StopHurb>, pitch_um: f64) -> Self {
        let (low, high) = spots.bounds_mm();
        let is_held = ((high - low) * per_mm(pitch_um)).abs().max_element() <= 2.0 * MOST_PIXELS;
        // Of rays that go anywhere, where most of the light is.
        let middle_mm = if is_held { 0.5 * (low + high) } else { spots.median_mm() };
        let middle = (middle_mm * per_mm(pitch_um)).round();
        Self::about(if middle.is_finite() { middle.as_ivec2() } else { IVec2::ZERO }, spots, bending, pitch_um)
    }

    /// Lays out spots in a window about a pixel.
    pub(crate) fn about(middle_px: IVec2, spots: &'a Spots, bending: Option<StopHurb>, pitch_um: f64) -> Self {
        let per_mm = per_mm(pitch_um);
        let mut nodes = spots.nodes.clone();
        for node in &mut nodes {
            for v in [&mut node.at_mm, &mut node.along_l_mm, &mut node.along_m_mm] {
                *v *= per_mm;
            }
        }
        let middle = middle_px.as_dvec2();
        nodes.iter_mut().for_each(|node| node.at_mm -= middle);
        let (low, high) = spots.bounds_mm();
        let reach = [low, high].map(|corner| (corner * per_mm - middle).abs().max_element());
        let reach = reach[0].max(reach[1]).max(0.0);
        let radius = nodes.iter().map(|node| node.at_mm.length()).fold(0.0, f64::max);
        let lambda_n_px = bending.as_ref().map_or(0.0, |bending| lambda_n(&nodes[0], bending));
        let side = 2 * (reach + TAILS * lambda_n_px - 0.5).ceil().clamp(0.0, MOST_PIXELS) as usize + 1;
        Self { spots, nodes, bending, middle_px, reach, radius, lambda_n_px, side, natural_side: side }
    }

    /// Returns the layout with a window of so many pixels along its side: about the middle of a pixel if the number is odd, else about the corner of four.
    pub(crate) fn with_side(self, side: usize) -> Self {
        Self { side, ..self }
    }

    /// Returns the layout on parts of its pixels, if the light is so narrow that whole ones do not tell its width.
    pub(crate) fn on_parts(&self) -> Option<Self> {
        let n = PARTS as f64;
        let finer = |node: &Node| Node {
            at_mm: n * node.at_mm,
            along_l_mm: n * node.along_l_mm,
            along_m_mm: n * node.along_m_mm,
            ..*node
        };
        (self.reach + self.lambda_n_px <= NARROW).then(|| Self {
            spots: self.spots,
            nodes: self.nodes.iter().map(finer).collect(),
            bending: self.bending.clone(),
            middle_px: self.middle_px * PARTS as i32,
            reach: n * self.reach,
            radius: n * self.radius,
            lambda_n_px: n * self.lambda_n_px,
            side: PARTS * self.side,
            natural_side: PARTS * self.natural_side,
        })
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
    fn draw(&self) -> Array2<f64> {
        // Count from the corner of the window.
        let middle = DVec2::splat(0.5 * self.side as f64);
        let mut nodes = self.nodes.clone();
        nodes.iter_mut().for_each(|node| node.at_mm += middle);
        let mut raster = Raster::new(self.side, self.side);
        let (mesh, mut energies) = (self.spots.mesh, self.spots.energies.clone());
        // Deposit what diffraction spreads as Gaussians, the rest as polygons.
        if let Some(bending) = &self.bending {
            let bent = HurbSplatter { mesh, nodes: &nodes, bending, size: raster.size() };
            bent.deposit(&mut energies, &mut raster);
        }
        let at: Vec<DVec2> = nodes.iter().map(|node| node.at_mm).collect();
        raster.mesh(mesh, &at, &energies);
        let pixels = raster.finish();
        // Tails that the window cuts have a center of their own.
        if self.bending.is_some() { pixels } else { moved_to(centroid(mesh, &at, &energies), pixels) }
    }

    /// Draws the energy of each pixel of the window, with waves in so far as the setting and the blur want them: `waves` sums them in a
    /// window of a side about a middle, pixels.
    pub(crate) fn drawn(
        &self,
        diffraction: Diffraction,
        waves: impl FnOnce(usize, IVec2) -> Result<Array2<f64>, PsfError>,
    ) -> (Array2<f64>, ModelUse) {
        let wave_fraction = self.wave_fraction(diffraction);
        if wave_fraction == 0.0 {
            return (self.draw(), ModelUse { wave_fraction, fallback: None });
        }
        match waves(self.side, self.middle_px) {
            Ok(waves) if wave_fraction == 1.0 => (waves, ModelUse { wave_fraction, fallback: None }),
            Ok(waves) => {
                let energies = waves * wave_fraction + self.draw() * (1.0 - wave_fraction);
                (energies, ModelUse { wave_fraction, fallback: None })
            }
            Err(error) => (self.draw(), ModelUse { wave_fraction: 0.0, fallback: Some(error.to_string()) }),
        }
    }

    /// Returns drawn energies of the window as a kernel: as far as tails are followed, or without those trimmed to what matters.
    pub(crate) fn kernel(&self, energies: &Array2<f64>, pitch_um: f64) -> Kernel {
        let kernel = if self.lambda_n_px > 0.0 {
            let edge_px = self.radius + TAILS * self.lambda_n_px;
            Kernel::centered(energies.mapv(|e| e as f32), pitch_um).faded_out(self.lambda_n_px, edge_px)
        } else {
            Kernel::centered(trim(energies, 1.0 - Kernel::NEGLIGIBLE), pitch_um)
        };
        Kernel { middle_px: self.middle_px, ..kernel }
    }
}

/// Returns the pixels of energies on parts of them, and what they add to the variance of the light, down and across, pixels².
pub(crate) fn of_parts(energies: &Array2<f64>) -> (Array2<f64>, [f64; 2]) {
    let side = energies.nrows() / PARTS;
    let mut pixels = Array2::zeros((side, side));
    for ((row, column), energy) in energies.indexed_iter() {
        pixels[(row / PARTS, column / PARTS)] += energy;
    }
    let pixels = moved_to(Some((middle(energies) + 0.5) / PARTS as f64), pixels);
    let excess = [Axis(1), Axis(0)].map(|across| {
        // Parts add their own width, 1/12 of a part.
        let light = (variance(&energies.sum_axis(across)) - 1.0 / 12.0).max(0.0) / (PARTS * PARTS) as f64;
        variance(&pixels.sum_axis(across)) - light
    });
    (pixels, excess)
}

/// Returns the variance of light along a line, samples².
fn variance(line: &Array1<f64>) -> f64 {
    let moment = |power: i32, from: f64| -> f64 {
        line.iter().enumerate().map(|(i, energy)| energy * (i as f64 - from).powi(power)).sum::<f64>() / line.sum()
    };
    moment(2, moment(1, 0.0))
}

/// Returns the centroid of energies that lie evenly on the cells of a mesh whose nodes are at these places; `None` without energy.
fn centroid(mesh: Mesh, at: &[DVec2], energies: &[f64]) -> Option<DVec2> {
    let of_cell = |(ring, j): (usize, usize)| {
        let [a, b, c, d] = mesh.corners(ring, j).map(|node| at[node]);
        let outer = mesh.outer_share(ring);
        ((a + b + c) * outer + (a + c + d) * (1.0 - outer)) / 3.0
    };
    let sum: DVec2 = mesh.cells().map(of_cell).zip(energies).map(|(middle, energy)| middle * *energy).sum();
    let middle = sum / energies.iter().sum::<f64>();
    middle.is_finite().then_some(middle)
}

/// Returns the mean column and row of the light on pixels.
fn middle(pixels: &Array2<f64>) -> DVec2 {
    let of_pixel = |((row, column), energy): ((usize, usize), &f64)| DVec2::new(column as f64, row as f64) * *energy;
    pixels.indexed_iter().map(of_pixel).sum::<DVec2>() / pixels.sum()
}

/// Returns pixels whose centroid is that of the light on them: within a pixel light counts as at its middle, which moves that of an outline
/// that a pixel's middle cuts, as of half a disc, by 0.16 pixels over the radius. A share of each pixel moves to the next.
fn moved_to(centroid: Option<DVec2>, mut pixels: Array2<f64>) -> Array2<f64> {
    let Some(by) = centroid.map(|centroid| centroid - (middle(&pixels) + 0.5)) else { return pixels };
    // Beyond half a pixel the window has cut the light.
    for (axis, by) in [(Axis(1), by.x), (Axis(0), by.y)].into_iter().filter(|(_, by)| by.abs() < 0.5) {
        for mut lane in pixels.lanes_mut(axis) {
            let n = lane.len();
            let mut carried = 0.0;
            for i in 0..n {
                let i = if by > 0.0 { i } else { n - 1 - i };
                let moves = if (by > 0.0 && i + 1 == n) || (by < 0.0 && i == 0) { 0.0 } else { by.abs() * lane[i] };
                lane[i] += carried - moves;
                carried = moves;
            }
        }
    }
    pixels
}

/// Returns the wave-optical energies of a point on pixels of a side in µm, so many along a window, about a point of the film, mm, picture frame.
pub(crate) fn wave_energies(
    lens: &MonoLens,
    point: &ObjectPoint,
    settings: &ImageSettings,
    center_mm: DVec2,
    (pitch_um, side): (f64, usize),
) -> Result<Array2<f64>, PsfError> {
    // The picture is the film turned by 180°.
    let window = WaveWindow { pitch_um, rows: side, columns: side, center: WindowCenter::At(-center_mm) };
    Ok(wave_psf(lens, point, settings.film_distance_mm, &window, WaveQuality::default())?.samples)
}

/// Returns pixels per mm: columns to the right, rows down.
fn per_mm(pitch_um: f64) -> DVec2 {
    DVec2::new(1e3, -1e3) / pitch_um
}

/// Returns λN in pixels: what the Gaussian of a ray through the middle of the pupil would give.
fn lambda_n(center: &Node, bending: &StopHurb) -> f64 {
    let per_cosine = center.along_l_mm.length().max(center.along_m_mm.length());
    let CircularStop { radius_mm, wave_number_per_mm } = bending.edge.circle();
    per_cosine * std::f64::consts::PI / (wave_number_per_mm * radius_mm)
}
