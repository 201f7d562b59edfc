//! Where the nodes of the pupil mesh land on the film: the map from which a point spread function is drawn.

use dioptric_diffraction::{StopRay, trace_stop_rays};
use dioptric_optics::{FilmPoint, MonoLens, ObjectPoint, RayFate, Vignetting, rays_towards};
use glam::DVec2;
use multiversion::multiversion;

use crate::{
    mesh::{Mesh, polar},
    pupil::Pupil,
};

/// What is kept of one node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Node {
    /// Place on the film about the centroid, mm, picture frame.
    pub(crate) at_mm: DVec2,
    /// Place in the stop over the stop's radius.
    pub(crate) in_stop: DVec2,
    /// Movement on the film for a unit change of the direction cosine along x at the stop, mm, picture frame.
    pub(crate) along_l_mm: DVec2,
    /// The same along y.
    pub(crate) along_m_mm: DVec2,
}

/// The lists of numbers that a record holds for nodes: two of places, and six that diffraction needs.
const PLACE_LISTS: usize = 2;
const STOP_LISTS: usize = 6;

/// All that interpolation mixes, as one list of numbers: node coordinates list by list, then the cells' energies.
///
/// Records of the same mesh can be added with weights; any such sum with weights of sum 1 is again a record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RayMap {
    pub(crate) mesh: Mesh,
    pub(crate) has_stop: bool,
    pub(crate) numbers: Vec<f32>,
}

impl RayMap {
    pub(crate) fn length(mesh: Mesh, has_stop: bool) -> usize {
        (PLACE_LISTS + if has_stop { STOP_LISTS } else { 0 }) * mesh.n_nodes() + mesh.n_cells()
    }

    /// Returns the record that is the sum of these with these weights.
    pub(crate) fn mix<'a>(mut weighted: impl Iterator<Item = (&'a Self, f64)>) -> Option<Self> {
        let (first, weight) = weighted.next()?;
        let mut sum = first.clone();
        if weight != 1.0 {
            sum.numbers.iter_mut().for_each(|number| *number *= weight as f32);
        }
        for (record, weight) in weighted {
            add_scaled(&mut sum.numbers, &record.numbers, weight as f32);
        }
        Some(sum)
    }

    fn from_nodes(mesh: Mesh, has_stop: bool, nodes: &[Node], energies: &[f64]) -> Self {
        let mut numbers = Vec::with_capacity(Self::length(mesh, has_stop));
        let mut list = |of: &dyn Fn(&Node) -> f64| numbers.extend(nodes.iter().map(|node| of(node) as f32));
        list(&|n| n.at_mm.x);
        list(&|n| n.at_mm.y);
        if has_stop {
            list(&|n| n.in_stop.x);
            list(&|n| n.in_stop.y);
            list(&|n| n.along_l_mm.x);
            list(&|n| n.along_l_mm.y);
            list(&|n| n.along_m_mm.x);
            list(&|n| n.along_m_mm.y);
        }
        numbers.extend(energies.iter().map(|e| *e as f32));
        Self { mesh, has_stop, numbers }
    }

    fn pair(&self, list: usize, node: usize) -> DVec2 {
        let n = self.mesh.n_nodes();
        DVec2::new(self.numbers[list * n + node].into(), self.numbers[(list + 1) * n + node].into())
    }

    /// Returns a node; without diffraction data but its place.
    pub(crate) fn node(&self, node: usize) -> Node {
        let at_mm = self.pair(0, node);
        if !self.has_stop {
            return Node { at_mm, ..Node::default() };
        }
        let [in_stop, along_l_mm, along_m_mm] = [2, 4, 6].map(|list| self.pair(list, node));
        Node { at_mm, in_stop, along_l_mm, along_m_mm }
    }

    /// Returns the rms distance of the energy from the centroid, mm, cells taken at the means of their corners.
    pub(crate) fn rms_mm(&self) -> f64 {
        let square = |((ring, j), energy): ((usize, usize), &f32)| {
            let corners = self.mesh.corners(ring, j).map(|node| self.node(node).at_mm);
            (corners.into_iter().sum::<DVec2>() / 4.0).length_squared() * f64::from(*energy)
        };
        self.mesh.cells().zip(self.energies()).map(square).sum::<f64>().sqrt()
    }

    /// Returns the centroid of cells of these energies, as they are drawn: the sum of their places, each times its energy, mm.
    fn weighted_sum_mm(&self, energies: impl Iterator<Item = f64>) -> DVec2 {
        let at = |node: usize| self.pair(0, node);
        let place = |((ring, j), energy): ((usize, usize), f64)| {
            let outer = self.mesh.outer_share(ring);
            let [a, b, c, d] = self.mesh.corners(ring, j);
            (at(a) + at(c) + outer * at(b) + (1.0 - outer) * at(d)) * (energy / 3.0)
        };
        let lit = self.mesh.cells().zip(energies).filter(|(_, energy)| *energy != 0.0);
        lit.map(place).sum()
    }

    /// Returns the part of the energy that goes through a part of the pupil, and the sum of its places, each times its energy, mm.
    ///
    /// `shares` are the part's shares of the light of the cells.
    pub(crate) fn part_moments(&self, shares: &[f64]) -> (f64, DVec2) {
        (self.part_energies(shares).sum(), self.weighted_sum_mm(self.part_energies(shares)))
    }

    /// Returns the map of what goes through a part of the pupil, about its own centroid, of energy 1; `None` where nothing does.
    pub(crate) fn part(&self, shares: &[f64]) -> Option<Self> {
        let share: f64 = self.part_energies(shares).sum();
        if share <= 0.0 {
            return None;
        }
        let mut part = self.clone();
        let first = part.numbers.len() - self.mesh.n_cells();
        part.numbers[first..].iter_mut().zip(self.part_energies(shares)).for_each(|(own, e)| *own = (e / share) as f32);
        part.recenter();
        Some(part)
    }

    fn part_energies<'a>(&'a self, shares: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.energies().iter().zip(shares).map(|(&energy, share)| f64::from(energy) * share)
    }

    /// Moves the places so that they count from the centroid of what is drawn of them; returns where that was, mm.
    pub(crate) fn recenter(&mut self) -> DVec2 {
        let centroid_mm = self.weighted_sum_mm(self.energies().iter().map(|&e| f64::from(e)));
        let n = self.mesh.n_nodes();
        self.numbers[..n].iter_mut().for_each(|x| *x -= centroid_mm.x as f32);
        self.numbers[n..2 * n].iter_mut().for_each(|y| *y -= centroid_mm.y as f32);
        centroid_mm
    }

    /// Whether a list of nodes' numbers changes its sign in a mirror image with x or y or both of the other sign.
    pub(crate) fn is_reversed(list: usize, [x, y]: [bool; 2]) -> bool {
        match list {
            // Places along x and along y.
            0 | 2 => x,
            1 | 3 => y,
            // Movements over direction cosines: along the same axis both are reversed.
            4 | 7 => false,
            _ => x != y,
        }
    }

    /// The energies of the cells; their sum is 1.
    pub(crate) fn energies(&self) -> &[f32] {
        &self.numbers[self.numbers.len() - self.mesh.n_cells()..]
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn add_scaled(sums: &mut [f32], numbers: &[f32], weight: f32) {
    for (sum, number) in sums.iter_mut().zip(numbers) {
        *sum += weight * number;
    }
}

/// What a ray map says of its point as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RayMapMoments {
    /// Centroid on the film, mm, picture frame.
    pub(crate) centroid_mm: DVec2,
    /// Area of the pupil, mm², weighted with cos⁴ of the angle, or for near points with what stands for it.
    pub(crate) pupil_mm2: f64,
    /// Rms radius on the film of the part of the map that is linear in the pupil, mm; negative for what was in focus
    /// before it reached the film.
    pub(crate) signed_rms_mm: f64,
    /// Rms distance of the energy from the centroid, mm.
    pub(crate) rms_mm: f64,
}

/// The ray map of a point that is seen.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub(crate) record: RayMap,
    pub(crate) summary: RayMapMoments,
}

/// The radius that holds 95 % of an even disc over its rms radius: r² = 0.95 R², and the mean square is R²/2.
pub(crate) const RIM_OVER_RMS: f64 = 1.378_404_875_209_022;

/// A point and how to trace it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayMapJob<'a> {
    pub(crate) lens: &'a MonoLens,
    /// The lens at the wavelength whose entrance pupil fields and depths count from.
    pub(crate) reference: &'a MonoLens,
    pub(crate) field_tan: DVec2,
    pub(crate) dioptres: f64,
    pub(crate) film_distance_mm: f64,
    pub(crate) mesh: Mesh,
}

/// A traced mesh in full precision.
pub(crate) struct Traced {
    pub(crate) nodes: Vec<Node>,
    pub(crate) energies: Vec<f64>,
    pub(crate) summary: RayMapMoments,
}

impl RayMapJob<'_> {
    /// The point in the lens frame.
    pub(crate) fn point(self) -> ObjectPoint {
        ObjectPoint::from_field(self.reference, self.field_tan, self.dioptres)
    }

    /// Finds the pupil from nothing, about its own center.
    pub(crate) fn pupil(self) -> Option<Pupil> {
        let point = self.point();
        Pupil::find(self.lens, &point, self.mesh.n_azimuths)?.near(self.lens, &point)
    }

    /// Traces the mesh in a pupil, or returns `None` if its middle ray does not reach the film.
    pub(crate) fn trace(self, pupil: &Pupil, has_stop: bool) -> Option<Traced> {
        let point = &self.point();
        let targets: Vec<DVec2> = self
            .mesh
            .nodes()
            .enumerate()
            .map(|(i, (share, azimuth))| {
                let j = i.saturating_sub(1) % self.mesh.n_azimuths;
                polar(pupil.center_mm, share * pupil.rho_mm[j], azimuth)
            })
            .collect();
        let mut nodes = self.land(point, &targets, pupil.z_mm, has_stop)?;
        let weights = self.weights(point, &targets, pupil.z_mm);
        let mut energies = self.cell_areas(&weights, &pupil.rho_mm);
        if self.lens.n_obscurations() > 0 {
            energies.iter_mut().zip(self.clear_shares(point, pupil)).for_each(|(e, share)| *e *= share);
        }
        let pupil_mm2: f64 = energies.iter().sum();
        if pupil_mm2 <= 0.0 {
            return None;
        }
        energies.iter_mut().for_each(|e| *e /= pupil_mm2);

        let outer_shares: Vec<f64> = (0..self.mesh.n_rings).map(|ring| self.mesh.outer_share(ring)).collect();
        let centroid_mm: DVec2 = self
            .mesh
            .cells()
            .zip(&energies)
            .map(|((ring, j), e)| {
                let [a, b, c, d] = self.mesh.corners(ring, j).map(|node| nodes[node].at_mm);
                // That of the two triangles that will be drawn.
                let outer = outer_shares[ring];
                (a + c + outer * b + (1.0 - outer) * d) * (e / 3.0)
            })
            .sum();
        nodes.iter_mut().for_each(|node| node.at_mm -= centroid_mm);
        let [signed_rms_mm, rms_mm] = self.signed_and_whole_rms_mm(&nodes, &targets, &energies);
        Some(Traced { nodes, energies, summary: RayMapMoments { centroid_mm, pupil_mm2, signed_rms_mm, rms_mm } })
    }

    /// Returns where rays aimed at the pupil land, in the picture frame. A ray that fails at the pupil's very edge
    /// lands with its neighbor inside.
    fn land(self, point: &ObjectPoint, targets: &[DVec2], z_mm: f64, has_stop: bool) -> Option<Vec<Node>> {
        let mut rays = rays_towards(point, targets, z_mm, 0.0);
        let landed: Vec<Option<Node>> = if has_stop {
            let radius_mm = self.lens.stop_semi_aperture_mm();
            let node = |ray: StopRay| Node {
                at_mm: ray.film.in_picture_mm(),
                in_stop: ray.stop.mm / radius_mm,
                along_l_mm: -ray.along_l_mm,
                along_m_mm: -ray.along_m_mm,
            };
            trace_stop_rays(self.lens, rays, self.film_distance_mm).into_iter().map(|ray| ray.map(node)).collect()
        } else {
            self.lens.trace(&mut rays, Vignetting::Off);
            self.lens.to_film(&mut rays, self.film_distance_mm);
            let node = |at: FilmPoint| Node { at_mm: at.in_picture_mm(), ..Node::default() };
            let places = self.lens.film_points(&rays, self.film_distance_mm);
            places.into_iter().zip(&rays.fate).map(|(at, fate)| fate.is_in_flight().then(|| node(at))).collect()
        };
        let mut nodes = vec![landed[0]?];
        for (i, node) in landed.into_iter().enumerate().skip(1) {
            let inside = i.checked_sub(self.mesh.n_azimuths).filter(|inside| *inside > 0).unwrap_or(0);
            nodes.push(node.unwrap_or(nodes[inside]));
        }
        Some(nodes)
    }

    /// Returns the weight of pupil area at each target: cos⁴ of the angle, or for near points (Z/d)² cos²: projected
    /// solid angle times the square of the axial distance.
    fn weights(self, point: &ObjectPoint, targets: &[DVec2], z_mm: f64) -> Vec<f64> {
        match *point {
            ObjectPoint::Infinite(direction) => vec![direction.z.powi(4); targets.len()],
            ObjectPoint::Finite(point) => {
                let axial_mm = 1e3 / self.dioptres;
                let weight = |target: &DVec2| {
                    let way = target.extend(z_mm) - point;
                    let square = way.length_squared();
                    axial_mm * axial_mm / square * (way.z * way.z / square)
                };
                targets.iter().map(weight).collect()
            }
        }
    }

    /// Returns the weighted areas of the cells, mm².
    fn cell_areas(self, weights: &[f64], rho_mm: &[f64]) -> Vec<f64> {
        let mesh = self.mesh;
        let wedge = mesh.azimuth(1.0);
        let ring = |ring: usize| {
            let (inner, outer) = (mesh.share(ring as f64), mesh.share((ring + 1) as f64));
            let sector = 0.5 * wedge * (outer * outer - inner * inner);
            (0..mesh.n_azimuths).map(move |j| {
                // The mean of the squares at both sides: the trapezoid rule around the pupil.
                let square = 0.5 * (rho_mm[j].powi(2) + rho_mm[(j + 1) % mesh.n_azimuths].powi(2));
                let weight = mesh.corners(ring, j).map(|node| weights[node]).iter().sum::<f64>() / 4.0;
                sector * square * weight
            })
        };
        (0..mesh.n_rings).flat_map(ring).collect()
    }

    /// Returns how much of each cell obscurations leave clear: of 8 × 8 rays through it.
    fn clear_shares(self, point: &ObjectPoint, pupil: &Pupil) -> Vec<f64> {
        const N: usize = 8;
        let mesh = self.mesh;
        let place = |ring: usize, j: usize, k: usize| {
            let middle = |i: usize| (i as f64 + 0.5) / N as f64;
            let (out, around) = (middle(k / N), middle(k % N));
            let inner_outer = [mesh.share(ring as f64), mesh.share((ring + 1) as f64)].map(|share| share * share);
            // Even in area.
            let share = (inner_outer[0] + (inner_outer[1] - inner_outer[0]) * out).sqrt();
            let [rho, next] = [j, j + 1].map(|j| pupil.rho_mm[j % mesh.n_azimuths]);
            polar(pupil.center_mm, share * (rho + (next - rho) * around), mesh.azimuth(j as f64 + around))
        };
        let targets: Vec<DVec2> = mesh
            .cells()
            .flat_map(|(ring, j)| (0..N * N).map(move |k| (ring, j, k)))
            .map(|(r, j, k)| place(r, j, k))
            .collect();
        let passed = |lens: &MonoLens| {
            let mut rays = rays_towards(point, &targets, pupil.z_mm, 0.0);
            lens.trace(&mut rays, Vignetting::On);
            rays.fate
        };
        // Vignetting end some rays of the outermost cells, whose areas have that already.
        let (holed, whole) = (passed(self.lens), passed(&self.lens.with_obscurations_inverted(&[])));
        let n_passed = |fates: &[RayFate]| fates.iter().filter(|fate| fate.is_in_flight()).count();
        let share = |(holed, whole)| n_passed(holed) as f64 / n_passed(whole).max(1) as f64;
        holed.chunks(N * N).zip(whole.chunks(N * N)).map(share).collect()
    }

    fn signed_and_whole_rms_mm(self, nodes: &[Node], targets: &[DVec2], energies: &[f64]) -> [f64; 2] {
        let mean_of = |of: &dyn Fn(usize) -> DVec2, ring, j| -> DVec2 {
            self.mesh.corners(ring, j).map(of).into_iter().sum::<DVec2>() / 4.0
        };
        let cells: Vec<(DVec2, DVec2, f64)> = self
            .mesh
            .cells()
            .zip(energies)
            .map(|((ring, j), e)| (mean_of(&|n| targets[n], ring, j), mean_of(&|n| nodes[n].at_mm, ring, j), *e))
            .collect();
        let center: DVec2 = cells.iter().map(|(p, _, e)| *p * *e).sum();
        let product: f64 = cells.iter().map(|(p, at, e)| (*p - center).dot(*at) * e).sum();
        let square: f64 = cells.iter().map(|(p, _, e)| (*p - center).length_squared() * e).sum();
        // Before its focus a bundle is still on the pupil's side; the picture frame is turned by 180°.
        let whole: f64 = cells.iter().map(|(_, at, e)| at.length_squared() * e).sum();
        [-product / square.sqrt(), whole.sqrt()]
    }
}

impl Traced {
    pub(crate) fn record(&self, mesh: Mesh, has_stop: bool) -> RayMap {
        RayMap::from_nodes(mesh, has_stop, &self.nodes, &self.energies)
    }
}
