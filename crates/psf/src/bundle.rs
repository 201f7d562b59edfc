//! The bundle of rays that a point of the film sees, traced back through the lens into the scene.

use dioptric_optics::{FilmCone, MonoLens, RayBatch, RayLight, ReversedLens, Vignetting};
use glam::{DVec2, DVec3};

use crate::{
    FilmMap,
    mesh::{Mesh, polar},
    pupil::Outline,
    spots::{Node, Spots, cell_areas, clear_shares},
};

/// Step of a direction cosine at the stop for difference quotients: their truncation, of order its square, and their rounding, 1e-16 over it, are below
/// 1e-9 of the derivative.
const STOP_STEP: f64 = 1e-5;

/// A ray in front of the lens.
///
/// At u dioptres it is seen from the projection centre in the direction (across + u moment, ahead): linear in u.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SceneRay {
    /// Its direction into the scene: to the right and upwards, and ahead.
    across: DVec2,
    ahead: f64,
    /// Where it meets the plane of the projection centre, m, times `ahead`: finite where it runs along that plane.
    moment_m: DVec2,
}

impl SceneRay {
    /// Returns the ray through a point of the lens frame, for a projection centre at this z.
    fn new(point_mm: DVec3, direction: DVec3, center_z_mm: f64) -> Self {
        let (across, ahead) = (direction.truncate(), -direction.z);
        let moment_mm = point_mm.truncate() * ahead + across * (point_mm.z - center_z_mm);
        Self { across, ahead, moment_m: 1e-3 * moment_mm }
    }

    /// Returns the direction, of any length, in which the projection centre sees where the ray is at a depth.
    fn seen_at(&self, dioptres: f64) -> DVec3 {
        (self.across + dioptres * self.moment_m).extend(self.ahead)
    }

    /// Returns it mirrored in the plane of x and z, times a factor.
    fn mirrored(&self, factor: f64) -> Self {
        let mirror = DVec2::new(factor, -factor);
        Self { across: mirror * self.across, ahead: factor * self.ahead, moment_m: mirror * self.moment_m }
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            across: self.across - other.across,
            ahead: self.ahead - other.ahead,
            moment_m: self.moment_m - other.moment_m,
        }
    }
}

/// What diffraction at the stop does to a ray.
#[derive(Clone, Copy, Debug, Default)]
struct StopDerivatives {
    /// Place in the stop over its radius.
    in_stop: DVec2,
    /// Derivatives by the direction cosines along the stop's own x and y.
    by_l: SceneRay,
    by_m: SceneRay,
}

impl StopDerivatives {
    fn mirrored(&self) -> Self {
        let in_stop = DVec2::new(self.in_stop.x, -self.in_stop.y);
        Self { in_stop, by_l: self.by_l.mirrored(1.0), by_m: self.by_m.mirrored(-1.0) }
    }
}

/// The rays that a point of the film sees, of all depths.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    mesh: Mesh,
    /// The region of direction cosines at the film, at twice as many azimuths as the mesh has.
    pub(crate) outline: Outline,
    rays: Vec<SceneRay>,
    /// With diffraction.
    at_stop: Vec<StopDerivatives>,
    /// Of the cells; their sum is 1.
    pub(crate) energies: Vec<f64>,
    /// Irradiance over the radiance of a uniform scene: the projected solid angle of what is seen, in media that the index says.
    pub(crate) irradiance_sr: f64,
    /// 1, or −1 where the picture of the entrance pupil at the film is upside down.
    pub(crate) pupil_sign: f64,
}

/// A point of the film that looks into a lens.
#[derive(Clone, Copy)]
pub(crate) struct FilmPointJob<'a> {
    pub(crate) lens: &'a ReversedLens,
    /// The same without obscurations, where it has some.
    pub(crate) unobscured: Option<&'a ReversedLens>,
    pub(crate) film_distance_mm: f64,
    /// z of the projection centre in the lens frame.
    pub(crate) center_z_mm: f64,
    pub(crate) mesh: Mesh,
    /// The point, mm from the middle, picture frame.
    pub(crate) place_mm: DVec2,
}

impl FilmPointJob<'_> {
    /// Finds where light comes from, near to a known outline or from nothing, and traces the mesh; `None` in darkness.
    pub(crate) fn trace(&self, seed: Option<&Outline>, has_stop: bool) -> Option<Bundle> {
        // The picture is the film turned by 180°.
        let cone = FilmCone::new(self.lens, -self.place_mm, self.film_distance_mm)?;
        let outline = self.outline(&cone, seed)?;

        // Trace the nodes of the mesh, half of them where the others mirror them.
        let mesh = self.mesh;
        let cosines = outline.nodes(mesh);
        let own = |node: usize| if outline.is_mirrored { node.min(mesh.mirrored(node)) } else { node };
        let traced: Vec<usize> = (0..cosines.len()).filter(|&node| own(node) == node).collect();
        let mut rays = cone.rays(&traced.iter().map(|&node| cosines[node]).collect::<Vec<_>>());
        let stopped = if has_stop { self.at_stop(rays.clone()) } else { vec![] };
        let mut light = RayLight::unpolarized(rays.len());
        self.lens.trace_light(&mut rays, &mut light, Vignetting::Off);
        let traced_rays = self.scene_rays(&rays);
        let (mut seen, mut shares, mut at_stop) = (vec![], vec![], vec![]);
        for node in 0..cosines.len() {
            let (ray, is_mirrored) = (traced.partition_point(|&node_of| node_of < own(node)), own(node) != node);
            // A ray that fails at the very edge of the pupil takes the place of its neighbor inside.
            let inside = node.checked_sub(mesh.n_azimuths).filter(|inside| *inside > 0).unwrap_or(0);
            let (seen_here, share) = match (rays.fate[ray].is_in_flight() || node == 0, is_mirrored) {
                (false, _) => (seen[inside], shares[inside]),
                (true, false) => (traced_rays[ray], light.share(ray)),
                (true, true) => (traced_rays[ray].mirrored(1.0), light.share(ray)),
            };
            seen.push(seen_here);
            shares.push(share);
            if let Some(stop) = stopped.get(ray) {
                let is_known = stop.by_l.across.is_finite() || node == 0;
                at_stop.push(match (is_known, is_mirrored) {
                    (false, _) => at_stop[inside],
                    (true, false) => *stop,
                    (true, true) => stop.mirrored(),
                });
            }
        }

        // Weigh cells by their projected solid angle and by what surfaces, glass, obscurations and other diffraction orders leave of it.
        let mut energies = cell_areas(mesh, &outline);
        if !self.lens.forward().is_lossless() {
            let of_cell = |(ring, j)| 0.25 * mesh.corners(ring, j).map(|node| shares[node]).iter().sum::<f64>();
            energies.iter_mut().zip(mesh.cells()).for_each(|(e, cell)| *e *= of_cell(cell));
        }
        if self.unobscured.is_some() {
            let shares = clear_shares(mesh, &outline, &|cosines, with| self.passed(&cone, cosines, with));
            energies.iter_mut().zip(shares).for_each(|(e, share)| *e *= share);
        }
        let solid_angle: f64 = energies.iter().sum();
        if !(solid_angle > 0.0 && rays.fate[0].is_in_flight()) {
            return None;
        }
        energies.iter_mut().for_each(|e| *e /= solid_angle);
        let forward = self.lens.forward();
        let per_index = (forward.image_index() / forward.object_index()).powi(2);
        let irradiance_sr = solid_angle * per_index * forward.diffraction_efficiency();

        let mut bundle = Bundle { mesh, outline, rays: seen, at_stop, energies, irradiance_sr, pupil_sign: 1.0 };
        bundle.pupil_sign = bundle.found_pupil_sign();
        Some(bundle)
    }

    fn outline(&self, cone: &FilmCone<'_>, seed: Option<&Outline>) -> Option<Outline> {
        let clearances = |cosines: &[DVec2]| cone.clearances(cosines);
        // About a point on the x axis of a lens with an axis all mirrors itself.
        let is_mirrored = self.place_mm.y == 0.0 && self.lens.forward().is_rotational();
        let folded = |outline: &Outline| outline.mirrored(is_mirrored);
        let found = seed.and_then(|seed| folded(seed).settled(&clearances)).or_else(|| {
            let (center, rho) = cone.edge(2 * self.mesh.n_azimuths)?;
            let found = folded(&Outline::even(center, rho));
            Some(found.settled(&clearances).unwrap_or(found))
        })?;
        Some(if self.lens.forward().has_openings() { found.with_corners(&clearances) } else { found })
    }

    fn scene_rays(&self, rays: &RayBatch) -> Vec<SceneRay> {
        (0..rays.len()).map(|i| SceneRay::new(rays.point_mm(i), rays.direction(i), self.center_z_mm)).collect()
    }

    /// Traces rays to the stop, and turned there by little steps on into the scene; NaN for rays that fail.
    fn at_stop(&self, mut rays: RayBatch) -> Vec<StopDerivatives> {
        let forward = self.lens.forward();
        self.lens.trace_to_stop(&mut rays, Vignetting::Off);
        let turned = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|way| {
            let mut rays = self.turned(&rays, way * STOP_STEP);
            self.lens.trace_from_stop(&mut rays, Vignetting::Off);
            (self.scene_rays(&rays), rays.fate)
        });
        let radius_mm = forward.stop_semi_aperture_mm();
        let points = forward.stop_points(&rays);
        let derivative = |i: usize| {
            let slope = |k: usize| {
                let difference = turned[k].0[i].minus(&turned[k + 1].0[i]);
                let scale = 0.5 / STOP_STEP;
                SceneRay {
                    across: difference.across * scale,
                    ahead: difference.ahead * scale,
                    moment_m: difference.moment_m * scale,
                }
            };
            match turned.iter().all(|(_, fate)| fate[i].is_in_flight()) {
                true => StopDerivatives { in_stop: points[i].mm / radius_mm, by_l: slope(0), by_m: slope(2) },
                false => {
                    let none = SceneRay { across: DVec2::NAN, ..SceneRay::default() };
                    StopDerivatives { in_stop: DVec2::ZERO, by_l: none, by_m: none }
                }
            }
        };
        (0..rays.len()).map(derivative).collect()
    }

    /// Returns rays at the stop with their direction cosines along its own x and y changed.
    fn turned(&self, rays: &RayBatch, by: DVec2) -> RayBatch {
        let stop = self.lens.stop_placement();
        let mut rays = rays.clone();
        for ray in 0..rays.len() {
            let own = stop.direction_to_own(rays.direction(ray));
            let cosines = own.truncate() + by;
            let rest = (1.0 - cosines.length_squared()).max(0.0).sqrt();
            rays.set_direction(ray, stop.direction_to_lens(cosines.extend(rest.copysign(own.z))));
        }
        rays
    }

    /// Returns which rays get through the lens, or through it without its obscurations.
    fn passed(&self, cone: &FilmCone<'_>, cosines: &[DVec2], with_obscurations: bool) -> Vec<bool> {
        let lens = self.unobscured.filter(|_| !with_obscurations).unwrap_or(self.lens);
        let mut rays = cone.rays(cosines);
        lens.trace(&mut rays, Vignetting::On);
        rays.fate.iter().map(|fate| fate.is_in_flight()).collect()
    }
}

/// What a bundle says as a whole; lengths on the film in mm.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moments {
    /// Signed radius of the blur of defocus in focus, as the model counts that, and its growth per dioptre.
    pub(crate) blur_mm: f64,
    pub(crate) blur_mm_per_dioptre: f64,
    /// Radius of what is left in focus beside that blur.
    pub(crate) residue_mm: f64,
}

impl Bundle {
    pub(crate) fn size_bytes(&self) -> usize {
        size_of_val(self.rays.as_slice())
            + size_of_val(self.at_stop.as_slice())
            + size_of_val(self.energies.as_slice())
            + size_of_val(self.outline.rho.as_slice())
    }

    /// Returns it without its rays, where those are not asked for any more.
    #[must_use]
    pub(crate) fn without_rays(self) -> Self {
        Self { rays: Vec::new(), at_stop: Vec::new(), ..self }
    }

    /// Returns sums over the cells of a function of the mean of their corners, weighted by energy.
    fn mean<T: std::iter::Sum>(&self, of: impl Fn([usize; 4], f64) -> T) -> T {
        let corners = self.mesh.cells().map(|(ring, j)| self.mesh.corners(ring, j));
        corners.zip(&self.energies).map(|(corners, &energy)| of(corners, energy)).sum()
    }

    /// Returns the direction of the chief ray, of any length: the mean of where the rays are seen at a depth.
    ///
    /// At the depth in focus the rays meet, so that it changes smoothly even where a rim begins to cut the pupil.
    pub(crate) fn chief(&self, dioptres: f64) -> DVec3 {
        self.mean(|corners, energy| {
            corners.map(|node| self.rays[node].seen_at(dioptres)).into_iter().sum::<DVec3>() * (0.25 * energy)
        })
    }

    /// Returns places of the pupil's unit disc, at the nodes.
    fn disc(&self) -> Vec<DVec2> {
        self.mesh.nodes().map(|(share, azimuth)| polar(DVec2::ZERO, share, azimuth)).collect()
    }

    /// Whether light from the right of the entrance pupil comes to the film from the right.
    fn found_pupil_sign(&self) -> f64 {
        let disc = self.disc();
        let product: f64 = self.mean(|corners, energy| {
            let at = |node: usize| self.rays[node].moment_m.dot(disc[node]);
            corners.map(at).iter().sum::<f64>() * energy
        });
        if product < 0.0 { -1.0 } else { 1.0 }
    }

    /// Returns the places, mm, on the film whose chief rays see what the rays are at, at a depth.
    fn places_mm(&self, map: &FilmMap, frame: &Frame, dioptres: f64) -> Vec<DVec2> {
        let mut near_mm = None;
        let place = |ray: &SceneRay| {
            let seen = frame.seen(ray, dioptres);
            let found_mm = near_mm.map_or_else(|| map.place_of(seen), |near_mm| map.place_near(seen, near_mm));
            near_mm = Some(found_mm).filter(|place_mm| place_mm.is_finite());
            found_mm
        };
        self.rays.iter().map(place).collect()
    }

    /// Returns the spots of a point of the film at a depth: each node at the point less where the chief ray sees what the node does.
    pub(crate) fn spots(&self, map: &FilmMap, frame: &Frame, place_mm: DVec2, dioptres: f64) -> Spots {
        let at = self.places_mm(map, frame, dioptres);
        let mut nodes: Vec<Node> =
            at.iter().map(|at_mm| Node { at_mm: place_mm - *at_mm, ..Node::default() }).collect();
        for (((node, at_mm), stop), ray) in nodes.iter_mut().zip(&at).zip(&self.at_stop).zip(&self.rays) {
            let changes = [&stop.by_l, &stop.by_m].map(|by| frame.seen(by, dioptres));
            let [by_l_mm, by_m_mm] = map.moves_mm(*at_mm, frame.seen(ray, dioptres), changes);
            // A spot lies at the point of the film less where the chief ray sees what the ray does.
            (node.in_stop, node.along_l_mm, node.along_m_mm) = (stop.in_stop, -by_l_mm, -by_m_mm);
        }
        Spots { mesh: self.mesh, nodes, energies: self.energies.clone() }
    }

    /// Returns what the blur of defocus is like about a depth in focus.
    pub(crate) fn moments(&self, map: &FilmMap, frame: &Frame, focus_dioptres: f64) -> Moments {
        const STEP_DIOPTRES: f64 = 1e-3;
        let disc = self.disc();
        let [here, there] = [0.0, STEP_DIOPTRES].map(|step| self.places_mm(map, frame, focus_dioptres + step));
        let center_of = |places: &[DVec2]| -> DVec2 {
            self.mean(|corners, energy| corners.map(|node| places[node]).into_iter().sum::<DVec2>() * (0.25 * energy))
        };
        let disc_center = center_of(&disc);
        // The part of the places that is linear in the pupil.
        let middle = |places: &[DVec2], corners: [usize; 4]| -> DVec2 {
            corners.map(|node| places[node]).into_iter().sum::<DVec2>() / 4.0
        };
        let square: f64 = self.mean(|corners, energy| (middle(&disc, corners) - disc_center).length_squared() * energy);
        let linear = |places: &[DVec2]| -> f64 {
            let product: f64 = self.mean(|corners, energy| {
                (middle(&disc, corners) - disc_center).dot(frame.turn_back(middle(places, corners))) * energy
            });
            self.pupil_sign * product / square.sqrt()
        };
        let (at_focus, beside) = (linear(&here), linear(&there));
        let center = center_of(&here);
        let whole: f64 = self.mean(|corners, energy| (middle(&here, corners) - center).length_squared() * energy);
        // An erect picture moves the other way.
        let sign = (beside - at_focus).signum();
        Moments {
            blur_mm: sign * rim_over_rms() * at_focus,
            blur_mm_per_dioptre: sign * rim_over_rms() * (beside - at_focus) / STEP_DIOPTRES,
            residue_mm: rim_over_rms() * (whole - at_focus * at_focus).max(0.0).sqrt(),
        }
    }
}

/// How the frame in which a bundle was traced lies in that of scene and film.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// The direction in the picture of the bundle's +x.
    pub(crate) turn: DVec2,
    /// How far the lens was moved sideways, mm.
    pub(crate) aside_mm: DVec2,
}

impl Frame {
    /// That of a bundle which was traced where it is wanted.
    pub(crate) const OWN: Self = Self { turn: DVec2::X, aside_mm: DVec2::ZERO };

    fn seen(&self, ray: &SceneRay, dioptres: f64) -> DVec3 {
        let seen = ray.seen_at(dioptres);
        let moved = self.aside_mm * (1e-3 * dioptres * ray.ahead);
        (self.turn.rotate(seen.truncate()) + moved).extend(seen.z)
    }

    fn turn_back(&self, place_mm: DVec2) -> DVec2 {
        DVec2::new(self.turn.x, -self.turn.y).rotate(place_mm)
    }
}

/// Returns the radius that holds 95 % of an even disc over its rms radius: r² = 0.95 R², and the mean square is R²/2.
pub(crate) fn rim_over_rms() -> f64 {
    f64::sqrt(2.0 * 0.95)
}

/// Returns the lens without its obscurations; `None` if it has none.
pub(crate) fn unobscured(lens: &MonoLens) -> Option<ReversedLens> {
    (lens.n_obscurations() > 0).then(|| lens.with_obscurations_inverted(&[]).reversed())
}
