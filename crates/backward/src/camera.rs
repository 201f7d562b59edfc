//! Cameras: a pinhole, a thin lens by formula, a panorama, a parallel projection, and any lens of `dioptric-optics`.

use dioptric_spectrum::Quantity;
use dioptric_world::{
    Ray, SkyMapping,
    glam::{DVec2, DVec3, Vec3},
};

use crate::{BackwardError, LensCamera, PixelGrid, Placement, Sampler, packets::PACKET, sampler::on_disc};

/// A camera in a world.
#[derive(Clone, Debug)]
pub enum Camera {
    /// A pinhole: its picture is of spectral radiance.
    Pinhole(Pinhole),
    /// A thin lens by formula: its picture is of the mean radiance over the lens.
    ThinLens(ThinLens),
    /// All directions from a point: its picture is of spectral radiance.
    Panorama(Panorama),
    /// A parallel projection: its picture is of spectral radiance.
    Parallel(Parallel),
    /// A lens: its picture is of spectral irradiance on the film.
    Lens(Box<LensCamera>),
}

/// All directions from the camera's origin, the poles above and below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Panorama {
    /// Where it stands.
    pub placement: Placement,
    /// The picture.
    pub pixels: PixelGrid,
    /// Which direction is where in the picture; the mapping's z is up, its y the axis.
    pub mapping: SkyMapping,
}

/// Rays along the axis through a window of the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parallel {
    /// Where it stands.
    pub placement: Placement,
    /// The picture.
    pub pixels: PixelGrid,
    /// The part of the plane that is seen, `[x min, x max, y min, y max]`, m.
    pub window_m: [f64; 4],
}

/// A pinhole at the camera's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Where it stands.
    pub placement: Placement,
    /// The picture.
    pub pixels: PixelGrid,
    /// The tangents of half the angles across the picture's width and height.
    pub half_tangents: DVec2,
    /// How many surfaces are looked through: 0 shows what is seen, 1 what the first hides, and so on. The back of a closed shape is none of
    /// them, as in [`layered_depth`](crate::layered_depth).
    pub layer: u32,
}

/// A thin lens in the plane z = 0 of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// What it sees through its middle.
    pub view: Pinhole,
    /// Its radius, m.
    pub radius_m: f64,
    /// The distance of the plane that is sharp, m.
    pub focus_distance_m: f64,
}

/// Rays of some pixels for the packet of one sample.
#[derive(Clone, Debug, Default)]
pub(crate) struct CameraRays {
    /// For each pixel one ray that all wavelengths share, or one a wavelength.
    pub(crate) rays: Vec<Ray>,
    /// What the radiance along each ray counts; 0 where the lens blocks it.
    pub(crate) weights: Vec<f32>,
    /// Whether all wavelengths share a ray.
    pub(crate) is_shared: bool,
}

/// A pixel that is sampled, and the numbers it draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSample {
    pub(crate) pixel: usize,
    pub(crate) random: Sampler,
}

impl Camera {
    /// The pixels of the picture.
    pub fn pixels(&self) -> PixelGrid {
        match self {
            Self::Pinhole(pinhole) => pinhole.pixels,
            Self::ThinLens(lens) => lens.view.pixels,
            Self::Panorama(panorama) => panorama.pixels,
            Self::Parallel(parallel) => parallel.pixels,
            Self::Lens(lens) => lens.pixels(),
        }
    }

    /// Returns the camera with other pixels over the same film or angle of view.
    #[must_use]
    pub fn with_pixels(self, pixels: PixelGrid) -> Self {
        match self {
            Self::Pinhole(view) => Self::Pinhole(Pinhole { pixels, ..view }),
            Self::ThinLens(lens) => Self::ThinLens(ThinLens { view: Pinhole { pixels, ..lens.view }, ..lens }),
            Self::Panorama(panorama) => Self::Panorama(Panorama { pixels, ..panorama }),
            Self::Parallel(parallel) => Self::Parallel(Parallel { pixels, ..parallel }),
            Self::Lens(lens) => Self::Lens(Box::new(lens.with_pixels(pixels))),
        }
    }

    /// What the samples of the picture are.
    pub fn quantity(&self) -> Quantity {
        match self {
            Self::Pinhole(_) | Self::ThinLens(_) | Self::Panorama(_) | Self::Parallel(_) => Quantity::Radiance,
            Self::Lens(_) => Quantity::Irradiance,
        }
    }

    /// The distance between pixels on the film, µm, where there is one.
    pub fn pitch_um(&self) -> Option<f64> {
        match self {
            Self::Pinhole(_) | Self::ThinLens(_) | Self::Panorama(_) | Self::Parallel(_) => None,
            Self::Lens(lens) => Some(lens.pitch_um()),
        }
    }

    /// How many surfaces are looked through.
    pub(crate) fn layer(&self) -> u32 {
        if let Self::Pinhole(pinhole) = self { pinhole.layer } else { 0 }
    }

    pub(crate) fn check(&self) -> Result<(), BackwardError> {
        self.pixels().check()?;
        let view = match self {
            Self::Pinhole(view) => view,
            Self::ThinLens(lens) => {
                for (what, found) in
                    [("the radius of a thin lens in m", lens.radius_m), ("its focus in m", lens.focus_distance_m)]
                {
                    if !(found > 0.0 && found.is_finite()) {
                        return Err(BackwardError::setting(what, found, "a finite length above 0"));
                    }
                }
                &lens.view
            }
            Self::Parallel(Parallel { window_m: [left, right, bottom, top], .. }) => {
                let is_sound = left < right && bottom < top && (right - left + top - bottom).is_finite();
                let found = || format!("{left} to {right}, {bottom} to {top} m");
                let expected = "a finite one, its smaller numbers first";
                return match is_sound {
                    true => Ok(()),
                    false => Err(BackwardError::setting("the window of a parallel projection", found(), expected)),
                };
            }
            Self::Panorama(_) | Self::Lens(_) => return Ok(()),
        };
        let tangents = view.half_tangents;
        match tangents.min_element() > 0.0 && tangents.is_finite() {
            true => Ok(()),
            false => Err(BackwardError::setting("half the angle of view", tangents, "tangents above 0")),
        }
    }

    /// Makes the rays of a sample of some pixels, for the wavelengths of these nodes.
    pub(crate) fn rays(&self, samples: &[PixelSample], nodes: &[usize; PACKET], out: &mut CameraRays) {
        out.rays.clear();
        out.weights.clear();
        match self {
            Self::Pinhole(pinhole) => {
                out.is_shared = true;
                for &PixelSample { pixel, random } in samples {
                    let [x, y, ..] = random.camera();
                    out.push(pinhole.ray(pixel, [x, y]), 1.0);
                }
            }
            Self::ThinLens(lens) => {
                out.is_shared = true;
                for &PixelSample { pixel, random } in samples {
                    out.push(lens.ray(pixel, random.camera()), 1.0);
                }
            }
            Self::Panorama(panorama) => {
                out.is_shared = true;
                for &PixelSample { pixel, random } in samples {
                    let [x, y, ..] = random.camera();
                    out.push(panorama.ray(pixel, [x, y]), 1.0);
                }
            }
            Self::Parallel(parallel) => {
                out.is_shared = true;
                for &PixelSample { pixel, random } in samples {
                    let [x, y, ..] = random.camera();
                    out.push(parallel.ray(pixel, [x, y]), 1.0);
                }
            }
            Self::Lens(lens) => lens.rays(samples, nodes, out),
        }
    }

    /// Makes rays of a sample of some pixels that surfaces of the lens reflect; returns whether there are any.
    pub(crate) fn ghost_rays(&self, samples: &[PixelSample], nodes: &[usize; PACKET], out: &mut CameraRays) -> bool {
        if let Self::Lens(lens) = self { lens.ghost_rays(samples, nodes, out) } else { false }
    }
}

impl CameraRays {
    pub(crate) fn push(&mut self, ray: Ray, weight: f32) {
        self.rays.push(ray);
        self.weights.push(weight);
    }
}

impl Pinhole {
    /// Returns the direction, in the camera's frame and of length 1 along z, to a place in a pixel.
    fn towards(&self, pixel: usize, in_pixel: [f64; 2]) -> DVec3 {
        let [s, t] = self.pixels.share(pixel, in_pixel);
        DVec3::new((2.0 * s - 1.0) * self.half_tangents.x, (1.0 - 2.0 * t) * self.half_tangents.y, 1.0)
    }

    /// Where the pinhole is, in the world.
    pub fn origin(&self) -> Vec3 {
        self.placement.world_from_camera.translation.as_vec3()
    }

    /// Returns the ray towards a place of the whole picture: 0 to 1 to the right, and down.
    pub fn ray_at(&self, [s, t]: [f64; 2]) -> Ray {
        let half = self.half_tangents;
        let direction = DVec3::new((2.0 * s - 1.0) * half.x, (1.0 - 2.0 * t) * half.y, 1.0);
        world_ray(&self.placement, DVec3::ZERO, direction)
    }

    /// Returns the ray of a place in a pixel.
    pub(crate) fn ray(&self, pixel: usize, in_pixel: [f64; 2]) -> Ray {
        world_ray(&self.placement, DVec3::ZERO, self.towards(pixel, in_pixel))
    }
}

impl Panorama {
    /// Returns the ray of a place in a pixel.
    pub(crate) fn ray(&self, pixel: usize, in_pixel: [f64; 2]) -> Ray {
        let d = self.mapping.direction_at(self.pixels.share(pixel, in_pixel)).as_dvec3();
        world_ray(&self.placement, DVec3::ZERO, DVec3::new(d.x, d.z, d.y))
    }
}

impl Parallel {
    /// Returns the ray of a place in a pixel.
    pub(crate) fn ray(&self, pixel: usize, in_pixel: [f64; 2]) -> Ray {
        let [s, t] = self.pixels.share(pixel, in_pixel);
        let [left, right, bottom, top] = self.window_m;
        world_ray(&self.placement, DVec3::new(left + s * (right - left), top + t * (bottom - top), 0.0), DVec3::Z)
    }
}

impl ThinLens {
    fn ray(&self, pixel: usize, [x, y, u, v]: [f64; 4]) -> Ray {
        let focus_m = self.view.towards(pixel, [x, y]) * self.focus_distance_m;
        let start_m = (on_disc(u, v) * self.radius_m).extend(0.0);
        world_ray(&self.view.placement, start_m, focus_m - start_m)
    }
}

/// Returns the ray from a point of the camera's frame, m.
pub(crate) fn world_ray(placement: &Placement, start_m: DVec3, direction: DVec3) -> Ray {
    let place = &placement.world_from_camera;
    let direction = place.transform_vector3(direction).normalize().as_vec3();
    Ray { origin: place.transform_point3(start_m).as_vec3(), direction: renormalized(direction) }
}

/// Makes up for the rounding of a direction to single precision.
pub(crate) fn renormalized(direction: Vec3) -> Vec3 {
    direction * (1.5 - 0.5 * direction.length_squared())
}
