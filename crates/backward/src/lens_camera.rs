//! A camera with a real lens: rays from the film through the lens into the world.
//!
//! For a place x on the film and a point p of the last vertex plane, drawn from an area A, the spectral irradiance is the
//! mean of `L (n_i/n_o)² cos θ cos θ_p A / |p − x|²`, with θ from the normal of the film and `θ_p` from that of the plane:
//! for parallel planes cos⁴θ A/z². L is the radiance along the ray that leaves the lens, 0 where the lens blocks it;
//! along a ray L/n² stays the same, less what surfaces and glass take.

mod ghosts;

use dioptric_diffraction::{AngularSpread, Hurb, StopEdge};
use dioptric_optics::{
    ExitPupilBounds, Lens, PupilReach, RayBatch, RayBatchF32, RayLightF32, ReversedLens, StopPoint, Vignetting,
    glam::{DVec2, DVec3, Vec3},
};
use dioptric_world::Ray;
use serde::{Deserialize, Serialize};

use crate::{
    BackwardError, Bands, MicroArray, PixelGrid, Placement, Sampler,
    camera::{CameraRays, PixelSample, world_ray},
    micro_array::PlacedMicroArray,
    packets::{PACKET, Packets},
};

/// Which point of a lens camera stands at the origin of its placement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LensOrigin {
    /// The middle of the film, as in pbrt.
    #[default]
    Film,
    /// The center of the entrance pupil, from which depth counts.
    EntrancePupil,
    /// The vertex of the first surface.
    FirstVertex,
}

/// What a lens camera is besides its lens.
#[derive(Clone, Debug, PartialEq)]
pub struct LensCameraSettings {
    /// From the last vertex to the film, mm.
    pub film_distance_mm: f64,
    /// Width and height of the whole picture on the film, mm.
    pub film_size_mm: DVec2,
    /// The picture.
    pub pixels: PixelGrid,
    /// Where it stands.
    pub placement: Placement,
    /// Which of its points stands there.
    pub origin: LensOrigin,
    /// Diffraction at the stop.
    pub diffraction: Option<Hurb>,
    /// Small lenses or holes before the film.
    pub micro_array: Option<MicroArray>,
}

/// A camera with a real lens.
#[derive(Clone, Debug)]
pub struct LensCamera {
    settings: LensCameraSettings,
    bands: Bands,
    /// The lens at each wavelength node; a single one where they are all alike.
    lenses: Vec<ReversedLens>,
    /// Of the film, or of the array before it.
    bounds: ExitPupilBounds,
    micro_array: Option<PlacedMicroArray>,
    origin_z_mm: f64,
    projection_center_z_mm: f64,
    /// What light takes that surfaces reflect twice, where it is followed.
    ghosts: Option<ghosts::Ghosts>,
}

impl LensCamera {
    /// Returns a camera for pictures of these bands, with the bounds of its exit pupil found.
    ///
    /// # Errors
    /// When the lens has no index at a wavelength, or the film or picture makes no sense.
    pub fn new(lens: &Lens, bands: &Bands, settings: LensCameraSettings) -> Result<Self, BackwardError> {
        settings.pixels.check()?;
        let size_mm = settings.film_size_mm;
        if !(size_mm.min_element() > 0.0 && size_mm.is_finite()) {
            return Err(BackwardError::setting("the size of the film in mm", size_mm, "finite lengths above 0"));
        }
        let nodes_nm = Packets::new(&bands.grid, bands.sampling).nodes_nm().to_vec();
        let nodes_nm = match settings.diffraction.is_none() && is_achromatic(lens, &nodes_nm)? {
            true => vec![nodes_nm[nodes_nm.len() / 2]],
            false => nodes_nm,
        };
        let reversed = |&nm: &f64| Ok(lens.at(nm)?.reversed());
        let lenses: Vec<ReversedLens> = nodes_nm.iter().map(reversed).collect::<Result<_, BackwardError>>()?;
        let mut apart = vec![0, lenses.len() / 2, lenses.len() - 1];
        apart.dedup();
        let colors: Vec<ReversedLens> = apart.into_iter().map(|i| lenses[i].clone()).collect();
        let reach = if settings.diffraction.is_some() { PupilReach::Stop } else { PupilReach::WholeLens };
        let middle = lenses[lenses.len() / 2].forward();
        // Rays aim at the pupil from the film, or from the array before it; that is seen up to a few elements beyond the film.
        let (aimed_from_mm, half_mm) = match &settings.micro_array {
            Some(array) => {
                array.check()?;
                (settings.film_distance_mm - array.gap_mm, 0.5 * size_mm + 2.0 * array.pitch_mm)
            }
            None => (settings.film_distance_mm, 0.5 * size_mm),
        };
        let bounds = ExitPupilBounds::find(&colors, aimed_from_mm, half_mm, reach)?;
        let film = middle.film_placement(settings.film_distance_mm);
        let place = |array| PlacedMicroArray::new(array, film, half_mm, &bounds);
        let micro_array = settings.micro_array.map(place).transpose()?;
        let projection_center_z_mm = middle.projection_center_z_mm();
        let origin_z_mm = match settings.origin {
            LensOrigin::Film => middle.film_placement(settings.film_distance_mm).vertex_mm.z,
            LensOrigin::EntrancePupil => projection_center_z_mm,
            LensOrigin::FirstVertex => 0.0,
        };
        let bands = bands.clone();
        Ok(Self { settings, bands, lenses, bounds, micro_array, origin_z_mm, projection_center_z_mm, ghosts: None })
    }

    /// Returns the camera with larger bounds of its exit pupil: the same picture, with more rays lost.
    #[must_use]
    pub fn with_inflated_bounds(&self, factor: f64) -> Self {
        Self { bounds: self.bounds.inflated(factor), ..self.clone() }
    }

    pub(crate) fn with_pixels(mut self, pixels: PixelGrid) -> Self {
        self.settings.pixels = pixels;
        self
    }

    /// The bands that the camera was made for.
    pub fn bands(&self) -> &Bands {
        &self.bands
    }

    pub(crate) fn pixels(&self) -> PixelGrid {
        self.settings.pixels
    }

    /// What the camera is besides its lens.
    pub fn settings(&self) -> &LensCameraSettings {
        &self.settings
    }

    pub(crate) fn pitch_um(&self) -> f64 {
        1e3 * self.settings.film_size_mm.x / self.settings.pixels.columns as f64
    }

    /// Returns the film place of a place in a pixel, mm, along the film's own axes: the lens turns the picture.
    pub(crate) fn on_film_mm(&self, pixel: usize, in_pixel: [f64; 2]) -> DVec2 {
        let [s, t] = self.settings.pixels.share(pixel, in_pixel);
        DVec2::new(0.5 - s, t - 0.5) * self.settings.film_size_mm
    }

    /// Returns a point of the lens frame, mm, in the frame of the camera, m.
    fn in_camera_m(&self, point_mm: DVec3) -> DVec3 {
        DVec3::new(point_mm.x, point_mm.y, self.origin_z_mm - point_mm.z) * 1e-3
    }

    /// Returns the ray of the world for one of the lens frame.
    fn in_world(&self, point_mm: DVec3, direction: DVec3) -> Ray {
        let along = DVec3::new(direction.x, direction.y, -direction.z);
        world_ray(&self.settings.placement, self.in_camera_m(point_mm), along)
    }

    /// Returns the center of the entrance pupil and the direction of the axis, in the world.
    pub(crate) fn projection_center(&self) -> (DVec3, DVec3) {
        let place = self.settings.placement.world_from_camera;
        let center_m = self.in_camera_m(DVec3::Z * self.projection_center_z_mm);
        (place.transform_point3(center_m), place.transform_vector3(DVec3::Z).normalize())
    }

    /// Makes the rays of a sample of some pixels through the lens.
    pub(crate) fn rays(&self, samples: &[PixelSample], nodes: &[usize; PACKET], out: &mut CameraRays) {
        // Aim at the pupil: points on the last vertex plane, in single precision from here on.
        let mut weights = Vec::with_capacity(samples.len());
        let mut start = RayBatchF32::default();
        for &PixelSample { pixel, random } in samples {
            let aimed = self.aim(pixel, &random);
            let Aimed { point_mm, direction, weight } = aimed.unwrap_or(Aimed::NOWHERE);
            weights.push(weight);
            start.push(point_mm, direction);
        }
        // What turns rays at the stop is the same for all wavelengths of a sample.
        let turns: Vec<DVec2> = match self.settings.diffraction {
            Some(_) => samples.iter().map(|sample| standard_normals(sample.random.pair(0))).collect(),
            None => Vec::new(),
        };
        // Trace each wavelength through the lens; once for all where they go the same way.
        out.is_shared = self.lenses.len() == 1;
        let lenses = nodes.iter().map(|&node| &self.lenses[node % self.lenses.len()]);
        for lens in lenses.take(if out.is_shared { 1 } else { PACKET }) {
            let mut rays = start.clone();
            let mut light = RayLightF32::unpolarized(rays.len());
            match self.settings.diffraction {
                None => lens.trace_light_f32(&mut rays, &mut light),
                Some(model) => {
                    lens.trace_light_to_stop_f32(&mut rays, &mut light);
                    diffract(lens, &mut rays, model, (samples, &turns));
                    lens.trace_light_from_stop_f32(&mut rays, &mut light);
                }
            }
            let indices = lens.forward().image_index() / lens.forward().object_index();
            let share = lens.forward().diffraction_efficiency();
            for (i, &weight) in weights.iter().enumerate() {
                let is_lit = rays.fate[i].is_in_flight();
                let weight = if is_lit { weight * indices * indices * share * light.share(i) } else { 0.0 };
                let point = Vec3::new(rays.x_mm[i], rays.y_mm[i], rays.z_mm[i]).as_dvec3();
                let direction = Vec3::new(rays.l[i], rays.m[i], rays.n[i]).as_dvec3();
                let direction = if weight > 0.0 { direction } else { -DVec3::Z };
                out.push(self.in_world(point, direction), weight as f32);
            }
        }
    }

    /// Draws a ray from a pixel to the last vertex plane; none where no light comes from.
    fn aim(&self, pixel: usize, random: &Sampler) -> Option<Aimed> {
        let film = self.lenses[self.lenses.len() / 2].forward();
        let [x, y, u, v] = random.camera();
        let on_film_mm = self.on_film_mm(pixel, [x, y]);
        let site = film.film_site(on_film_mm, self.settings.film_distance_mm)?;
        let plane = self.bounds.plane();
        if let Some(array) = &self.micro_array {
            let ray = array.ray(site.point_mm, [f64::from(random.pair(ELEMENT_PAIR)[0]), u, v])?;
            let square_mm2 = site.point_mm.distance_squared(ray.point_mm);
            let cosines = ray.before.dot(site.normal) * ray.before.dot(array.normal());
            let to_plane_mm = (plane.vertex_mm - ray.point_mm).dot(plane.rotation.z_axis);
            let along_mm = to_plane_mm / ray.after.dot(plane.rotation.z_axis);
            let weight = cosines.abs() * ray.area_mm2 / square_mm2;
            let point_mm = ray.point_mm + along_mm * ray.after;
            return (along_mm > 0.0).then_some(Aimed { point_mm, direction: ray.after, weight });
        }
        let pupil = self.bounds.sample(on_film_mm, DVec2::new(u, v))?;
        let between_mm = pupil.point_mm - site.point_mm;
        let square_mm2 = between_mm.length_squared();
        let direction = between_mm / square_mm2.sqrt();
        let cosines = direction.dot(site.normal) * direction.dot(plane.rotation.z_axis);
        let weight = cosines.abs() * pupil.area_mm2 / square_mm2;
        Some(Aimed { point_mm: pupil.point_mm, direction, weight })
    }

    /// Returns for each of some pixels the ray from its middle through the middle of the stop, or none. With an array before
    /// the film it starts from the middle of the element that is before the pixel.
    ///
    /// Newton's method on the last vertex plane, without rims; at the middle one of the wavelengths.
    pub(crate) fn chief_rays(&self, pixels: &[usize]) -> Vec<Option<Ray>> {
        let lens = &self.lenses[self.lenses.len() / 2];
        let (plane, film_distance_mm) = (self.bounds.plane(), self.settings.film_distance_mm);
        let site_mm = |&pixel: &usize| {
            let site = lens.forward().film_site(self.on_film_mm(pixel, [0.5; 2]), film_distance_mm)?;
            match &self.micro_array {
                Some(array) => array.element_before(site.point_mm),
                None => Some(site.point_mm),
            }
        };
        let sites_mm: Vec<Option<DVec3>> = pixels.iter().map(site_mm).collect();
        let mut aims_mm: Vec<DVec2> = vec![DVec2::ZERO; pixels.len()];
        let rays_to = |aims_mm: &[DVec2], moved_mm: DVec2| {
            let mut rays = RayBatch::with_capacity(aims_mm.len());
            for (aim_mm, site_mm) in aims_mm.iter().zip(&sites_mm) {
                let point_mm = plane.lens_from_surface((*aim_mm + moved_mm).extend(0.0));
                let from_mm = site_mm.unwrap_or(point_mm + plane.rotation.z_axis);
                rays.push(point_mm, (point_mm - from_mm).normalize(), 0.0);
            }
            rays
        };
        let stop_placement = lens.stop_placement();
        let at_stop = |aims_mm: &[DVec2], moved_mm: DVec2| {
            let mut rays = rays_to(aims_mm, moved_mm);
            lens.trace_to_stop(&mut rays, Vignetting::Off);
            let place = |i: usize| {
                rays.fate[i].is_in_flight().then(|| stop_placement.surface_from_lens(rays.point_mm(i)).truncate())
            };
            (0..rays.len()).map(place).collect::<Vec<Option<DVec2>>>()
        };
        for _ in 0..NEWTON_STEPS {
            let [here, right, up] = [DVec2::ZERO, DVec2::X, DVec2::Y].map(|by| at_stop(&aims_mm, by * DIFFERENCE_MM));
            for (i, aim_mm) in aims_mm.iter_mut().enumerate() {
                if let (Some(here), Some(right), Some(up)) = (here[i], right[i], up[i]) {
                    let (a, b) = ((right - here) / DIFFERENCE_MM, (up - here) / DIFFERENCE_MM);
                    let step_mm = DVec2::new(b.perp_dot(here), here.perp_dot(a)) / a.perp_dot(b);
                    *aim_mm += if step_mm.is_finite() { step_mm } else { DVec2::ZERO };
                }
            }
        }
        let mut rays = rays_to(&aims_mm, DVec2::ZERO);
        lens.trace(&mut rays, Vignetting::Off);
        let seen = |i: usize| {
            let is_seen = sites_mm[i].is_some() && rays.fate[i].is_in_flight();
            is_seen.then(|| self.in_world(rays.point_mm(i), rays.direction(i)))
        };
        (0..pixels.len()).map(seen).collect()
    }
}

impl LensCamera {
    /// Returns the ray into the world along each line from a place of the film through one of the array before it, mm to the
    /// right and upwards in the picture; none without an array, or where the lens lets none through. Rims cut nothing off.
    ///
    /// At the middle one of the wavelengths. An element bends no light that crosses its center, so that such a line is the middle
    /// of what a pixel sees through it.
    pub(crate) fn rays_along(&self, lines_mm: &[FilmLine]) -> Vec<Option<Ray>> {
        let Some(array) = &self.settings.micro_array else { return vec![None; lines_mm.len()] };
        let lens = &self.lenses[self.lenses.len() / 2];
        let (plane, film) = (self.bounds.plane(), lens.forward().film_placement(self.settings.film_distance_mm));
        let mut rays = RayBatch::with_capacity(lines_mm.len());
        for FilmLine { film_mm, array_mm } in lines_mm {
            // The lens turns the picture.
            let from_mm = film.lens_from_surface((-*film_mm).extend(0.0));
            let through_mm = film.lens_from_surface((-*array_mm).extend(-array.gap_mm));
            let direction = (through_mm - from_mm).normalize();
            let along_mm =
                (plane.vertex_mm - through_mm).dot(plane.rotation.z_axis) / direction.dot(plane.rotation.z_axis);
            rays.push(through_mm + along_mm * direction, direction, 0.0);
        }
        lens.trace(&mut rays, Vignetting::Off);
        let seen = |i: usize| rays.fate[i].is_in_flight().then(|| self.in_world(rays.point_mm(i), rays.direction(i)));
        (0..rays.len()).map(seen).collect()
    }
}

/// A line from a place of a film through one of the array before it, mm to the right of the axis and above it in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmLine {
    /// On the film.
    pub film_mm: DVec2,
    /// On the array.
    pub array_mm: DVec2,
}

/// A ray that has left the film, on the last vertex plane, and what its radiance counts.
struct Aimed {
    point_mm: DVec3,
    direction: DVec3,
    weight: f64,
}

impl Aimed {
    /// A ray that counts nothing.
    const NOWHERE: Self = Self { point_mm: DVec3::ZERO, direction: DVec3::NEG_Z, weight: 0.0 };
}

/// The pair of numbers that chooses elements of an array.
const ELEMENT_PAIR: u32 = u32::MAX - 1;
/// Steps of Newton's method: each squares an error that begins at a millimeter or so.
const NEWTON_STEPS: usize = 6;
/// The step of its difference quotients, mm.
const DIFFERENCE_MM: f64 = 1e-4;

/// Whether the lens has the same indices at all these wavelengths, loses no light and has no diffractive surface.
fn is_achromatic(lens: &Lens, wavelengths_nm: &[f64]) -> Result<bool, BackwardError> {
    if !lens.diffractive().is_empty() || !lens.at(wavelengths_nm[0])?.is_lossless() {
        return Ok(false);
    }
    let media = lens.interfaces().iter().map(|interface| &interface.medium_after);
    for medium in media.chain([lens.object_medium()]) {
        let first = lens.index_in(medium, wavelengths_nm[0])?;
        for &nm in wavelengths_nm {
            if lens.index_in(medium, nm)? != first {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Turns rays at the stop by HURB, as `dioptric_diffraction::bend` does those that come from the scene: its Gaussian of
/// direction cosines is even, so that both ways have the same kernel.
///
/// The first pair of normal numbers of a sample, which nearly all take, is given: it is the same for all its wavelengths.
fn diffract(lens: &ReversedLens, rays: &mut RayBatchF32, model: Hurb, (samples, turns): (&[PixelSample], &[DVec2])) {
    let edge = StopEdge::of(lens.forward());
    let placement = lens.stop_placement();
    let surface_from_lens = placement.rotation.transpose();
    for (i, sample) in samples.iter().enumerate() {
        if !rays.fate[i].is_in_flight() {
            continue;
        }
        let point_mm =
            placement.surface_from_lens(Vec3::new(rays.x_mm[i], rays.y_mm[i], rays.z_mm[i]).as_dvec3()).truncate();
        let before = surface_from_lens * Vec3::new(rays.l[i], rays.m[i], rays.n[i]).as_dvec3();
        let (axis, AngularSpread { radial, across }) = model.spread_at(StopPoint { mm: point_mm }, &edge);
        // Draw again where the ray would be turned back, which only those within a wavelength of the edge can be.
        let drawn = (0..REDRAWS).find_map(|pair| {
            let normal = if pair == 0 { turns[i] } else { standard_normals(sample.random.pair(pair)) };
            let cosines = before.truncate() + axis * (radial * normal.x) + axis.perp() * (across * normal.y);
            let rest = 1.0 - cosines.length_squared();
            (rest > 0.0).then(|| cosines.extend(-rest.sqrt()))
        });
        let after = (placement.rotation * drawn.unwrap_or(before)).as_vec3();
        (rays.l[i], rays.m[i], rays.n[i]) = after.into();
    }
}

/// Pairs of numbers that the stop may draw: those that are not the integrator's.
const REDRAWS: u32 = 8;

/// Returns two independent standard normal numbers (Box & Muller 1958).
fn standard_normals([a, b]: [f32; 2]) -> DVec2 {
    let radius = (-2.0 * (-f64::from(a)).ln_1p()).sqrt();
    radius * DVec2::from_angle(std::f64::consts::TAU * f64::from(b))
}
