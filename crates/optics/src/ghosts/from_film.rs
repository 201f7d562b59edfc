//! Ghosts met from the film: where light comes from that two surfaces reflect on its way to a place of the film.

use glam::{DVec2, DVec3};

use crate::{
    MirrorFilm, MonoLens, OpticsError, RayBatchF32, ReversedLens,
    ghosts::{PAIR, on_disc},
    rays::RaySlices,
    trace::GhostTree,
    transmission::GHOST_TERMS,
};

/// A lens at one wavelength, for rays from the film that two of its surfaces reflect.
#[derive(Clone, Debug)]
pub struct FilmGhosts {
    tree: GhostTree<f32>,
}

/// One way of a ray out of the lens, drawn from all that it may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GhostRay {
    /// Where it leaves the plane of the first vertex, mm in the lens frame.
    pub point_mm: DVec3,
    /// Where it goes, towards −z.
    pub direction: DVec3,
    /// The sum of the shares of all ways: what radiance along this one counts, in the mean over the drawing.
    pub share: f64,
}

impl ReversedLens {
    /// Returns the ghosts of the lens as they are met from a film.
    ///
    /// # Errors
    /// When the lens is tilted or decentered or has mirrors or gratings, or the film reflects and is curved.
    pub fn ghosts(&self, film: &MirrorFilm) -> Result<FilmGhosts, OpticsError> {
        let lens = self.forward();
        // One that reflects nothing may be curved: rays come from any place.
        if lens.placements().is_some() || film.reflectance != 0.0 {
            lens.check_ghosts(film)?;
        }
        Ok(FilmGhosts { tree: lens.ghost_tree(film, true, GHOST_TERMS) })
    }
}

impl MonoLens {
    /// Returns the veiling glare of even light from all sides: what surfaces reflect twice to a place of the film, mm in the lens frame, over what
    /// the lens images there, as in the middle of a small black spot and beside it (ISO 9358). `None` where no light comes there, or the film
    /// reaches into the hollow of the last surface.
    ///
    /// # Errors
    /// As [`ghosts`](Self::ghosts).
    pub fn veiling_glare(&self, place_mm: DVec2, film: &MirrorFilm, n_rays: usize) -> Result<Option<f64>, OpticsError> {
        self.check_ghosts(film)?;
        let Some(radius_mm) = self.rear_circle_mm(film.distance_mm, place_mm.length()) else { return Ok(None) };
        let tree = self.ghost_tree::<f32>(film, true, GHOST_TERMS);
        // The frame is mirrored: light runs towards +z, from a film before the lens.
        let (mut rays, mut weights) = (RayBatchF32::default(), Vec::new());
        let is_half = self.is_rotational() && place_mm.x == 0.0 && film.center_mm.x == 0.0;
        for target_mm in on_disc(radius_mm, n_rays, is_half) {
            let way = (target_mm - place_mm).extend(film.distance_mm);
            rays.push(target_mm.extend(-self.last_vertex_z_mm()), way.normalize());
            weights.push((film.distance_mm / way.length_squared()).powi(2));
        }
        let mut sums = [0.0; 2];
        let mut sum = |way: &[u16], start: usize, _: [&[f32]; 5], shares: &[f64]| {
            let lit = shares.iter().enumerate().filter(|(_, share)| **share > 0.0);
            sums[usize::from(!way.is_empty())] += lit.map(|(i, share)| share * weights[start + i]).sum::<f64>();
        };
        tree.trace(&rays.slices(), PAIR, &mut sum);
        let [direct, ghosts] = sums;
        Ok((direct > 0.0).then(|| ghosts / direct))
    }

    /// Returns the radius of a circle in the last vertex plane that all rays cross which come to the last surface from film places up to
    /// `reach_mm` from the axis, so far behind the vertex; `None` where the film reaches into the hollow of that surface.
    pub fn rear_circle_mm(&self, film_distance_mm: f64, reach_mm: f64) -> Option<f64> {
        let rim_mm = self.semi_aperture_mm(self.n_surfaces() - 1);
        let mut most_mm = rim_mm;
        for i in 1..=REAR_STEPS {
            let radius_mm = rim_mm * f64::from(i) / f64::from(REAR_STEPS);
            // The surface lies so far before its vertex plane there.
            let before_mm = -self.last_sag_mm(DVec2::new(0.0, radius_mm));
            let way_mm = film_distance_mm + before_mm;
            if way_mm <= 0.0 || !way_mm.is_finite() {
                return None;
            }
            for place_mm in [-reach_mm, reach_mm] {
                most_mm = most_mm.max((radius_mm + (place_mm - radius_mm) * before_mm / way_mm).abs());
            }
        }
        Some(most_mm)
    }
}

/// Rings of the last surface that are looked at.
const REAR_STEPS: u32 = 64;

impl FilmGhosts {
    /// Follows rays from the film, which start near the last vertex, by all pairs of surfaces, and draws one way of each by a number of 0 to 1:
    /// a way is as likely as its share of the light. None of a ray that no pair lets out.
    pub fn trace(&self, rays: &mut RayBatchF32, drawn: &[f64]) -> Vec<Option<GhostRay>> {
        let mut slices = rays.slices();
        let flip = |slices: &mut RaySlices<'_, f32>| {
            slices.z.iter_mut().chain(slices.n.iter_mut()).for_each(|v| *v = -*v);
        };
        flip(&mut slices);
        let mut numbers = drawn.to_vec();
        let mut ways: Vec<Option<GhostRay>> = vec![None; numbers.len()];
        let mut draw = |way: &[u16], start: usize, [x, y, l, m, n]: [&[f32]; 5], shares: &[f64]| {
            if way.is_empty() {
                return;
            }
            let lit = shares.iter().enumerate().filter(|(_, share)| **share > 0.0);
            for (i, &share) in lit {
                let (way, number) = (&mut ways[start + i], &mut numbers[start + i]);
                let total = way.map_or(0.0, |way| way.share) + share;
                let chance = share / total;
                // What is left of the number is as evenly spread as it was.
                if *number < chance {
                    *number /= chance;
                    let point_mm = DVec2::new(x[i].into(), y[i].into()).extend(0.0);
                    let direction = DVec3::new(l[i].into(), m[i].into(), -f64::from(n[i]));
                    *way = Some(GhostRay { point_mm, direction, share: total });
                } else {
                    *number = (*number - chance) / (1.0 - chance);
                    if let Some(way) = way {
                        way.share = total;
                    }
                }
            }
        };
        self.tree.trace(&slices, PAIR, &mut draw);
        flip(&mut slices);
        ways
    }
}
