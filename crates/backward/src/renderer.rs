//! Rendering in passes: each an independent estimate of the whole picture, so that it refines and can stop at any.

use std::sync::atomic::{AtomicUsize, Ordering};

use dioptric_spectrum::{Cancel, SpectralImage, WavelengthGrid};
use dioptric_world::{Ray, World};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    BackwardError, BandSampling, Camera, LightPaths, Rendering, Sampler,
    camera::{CameraRays, PixelSample},
    film::Film,
    integrator::Integrator,
    packets::{PACKET, Packets},
    peeling::Surfaces,
    sampler::mix,
};

/// The bands of a picture, and what their values are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bands {
    /// The bands.
    pub grid: WavelengthGrid,
    /// Whether a value is the mean of the band or that at its center.
    #[serde(default)]
    pub sampling: BandSampling,
}

/// How a picture is rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderSettings {
    /// Its bands.
    pub bands: Bands,
    /// How much of the light is followed.
    #[serde(default)]
    pub paths: LightPaths,
    /// Samples a pixel of each pass; more are taken where all bands need them. Powers of two spread best.
    pub samples_per_pass: u32,
    /// All numbers are drawn from this seed.
    pub seed: u64,
    /// The most that light scattered twice or more may add to one sample, W m⁻² sr⁻¹ nm⁻¹: takes bright specks away, and
    /// light with them. None leaves the picture unbiased.
    #[serde(default)]
    pub clamp: Option<f32>,
}

/// A picture being rendered.
#[derive(Clone, Debug)]
pub struct Renderer<'a> {
    world: &'a World,
    camera: &'a Camera,
    settings: RenderSettings,
    packets: Packets,
    pub(crate) film: Film,
    /// How many passes each pixel is to have, where that has been decided.
    pub(crate) targets: Option<Vec<u32>>,
    pub(crate) n_passes: u32,
}

/// Pixels along each side of a tile, which one thread renders.
const TILE: usize = 16;

impl<'a> Renderer<'a> {
    /// Returns a renderer that has not begun.
    ///
    /// # Errors
    /// When a setting makes no sense, or the camera was made for other bands.
    pub fn new(world: &'a World, camera: &'a Camera, settings: RenderSettings) -> Result<Self, BackwardError> {
        camera.check()?;
        if !(1..=MOST_SAMPLES).contains(&settings.samples_per_pass) {
            let found = settings.samples_per_pass;
            return Err(BackwardError::setting("the samples of a pass", found, "1 to 65536"));
        }
        if let Some(clamp) = settings.clamp.filter(|clamp| clamp.is_nan() || *clamp <= 0.0) {
            return Err(BackwardError::setting("the clamp of scattered light", clamp, "a radiance above 0"));
        }
        if let Camera::Lens(lens) = camera
            && *lens.bands() != settings.bands
        {
            let found = format!("{} bands", settings.bands.grid.len());
            return Err(BackwardError::setting("the wavelengths", found, "the bands that the camera was made for"));
        }
        let packets = Packets::new(&settings.bands.grid, settings.bands.sampling);
        let settings = RenderSettings {
            samples_per_pass: settings.samples_per_pass.max(packets.n_for_all_bands() as u32),
            ..settings
        };
        let (rows, columns) = camera.pixels().size();
        let film = Film::new(rows, columns, settings.bands.grid.len());
        Ok(Self { world, camera, settings, packets, film, targets: None, n_passes: 0 })
    }

    /// The settings, with the samples of a pass as they are.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The camera.
    pub fn camera(&self) -> &'a Camera {
        self.camera
    }

    /// How many passes have been made.
    pub fn n_passes(&self) -> u32 {
        self.n_passes
    }

    /// Decides once, from the passes made so far, how many each pixel is to have in all: as many as give it this relative
    /// standard error, at most `most`. At least two passes must have been made.
    ///
    /// The number is decided by a pixel's neighbors alone, so that the picture stays without bias.
    ///
    /// # Errors
    /// When the noise is not above 0, or too few passes have been made to judge.
    pub fn aim_at_noise(&mut self, noise: f64, most: u32) -> Result<(), BackwardError> {
        if noise.is_nan() || noise <= 0.0 {
            return Err(BackwardError::setting("the noise to reach", noise, "a share of the picture above 0"));
        }
        if self.n_passes < 2 {
            let found = self.n_passes;
            return Err(BackwardError::setting("the passes before noise is judged", found, "2 at least"));
        }
        self.targets = Some(self.film.passes_needed(noise, most));
        Ok(())
    }

    /// How many passes are left for the pixel that needs most, where that has been decided.
    pub fn n_passes_left(&self) -> Option<u32> {
        let most = self.targets.as_ref()?.iter().max()?;
        Some(most.saturating_sub(self.n_passes))
    }

    /// Makes one more pass over the pixels that need it; `progress` is given the share of it that is done, from any
    /// thread. Returns whether there was a pixel that needed it.
    ///
    /// # Errors
    /// When it was cancelled: the picture is then as it was before the pass.
    pub fn pass(&mut self, cancel: &Cancel, progress: &(dyn Fn(f64) + Sync)) -> Result<bool, BackwardError> {
        let tiles = self.tiles();
        let n_done = AtomicUsize::new(0);
        let render = |tile: &Tile| {
            let means = self.render_tile(tile, cancel)?;
            progress((n_done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / tiles.len() as f64);
            Ok(means)
        };
        let means: Vec<Vec<f64>> = tiles.par_iter().map(render).collect::<Result<_, BackwardError>>()?;
        let n_bands = self.film.n_bands;
        for (tile, means) in tiles.iter().zip(&means) {
            for (&pixel, means) in tile.pixels.iter().zip(means.chunks_exact(n_bands)) {
                self.film.add(pixel, means);
            }
        }
        self.n_passes += u32::from(!tiles.is_empty());
        Ok(!tiles.is_empty())
    }

    /// Returns the picture so far, without its error.
    pub fn picture(&self) -> SpectralImage {
        self.with_pitch(self.film.picture(self.camera.quantity(), &self.settings.bands.grid))
    }

    fn with_pitch(&self, image: SpectralImage) -> SpectralImage {
        match self.camera.pitch_um() {
            Some(pitch_um) => image.with_pitch_um(pitch_um),
            None => image,
        }
    }

    /// Returns the picture so far with its error.
    pub fn rendering(&self) -> Rendering {
        let (picture, standard_error) = self.film.develop(self.camera.quantity(), &self.settings.bands.grid);
        let [picture, standard_error] = [picture, standard_error].map(|image| self.with_pitch(image));
        let n_samples = self.film.passes() * self.settings.samples_per_pass;
        Rendering { picture, standard_error, n_samples }
    }

    /// The pixels that are left for this pass, tile by tile; tiles lie where they do in the whole picture.
    fn tiles(&self) -> Vec<Tile> {
        let grid = self.camera.pixels();
        let [x, y, width, height] = grid.crop;
        let mut tiles = Vec::new();
        for tile_y in y / TILE..(y + height).div_ceil(TILE) {
            for tile_x in x / TILE..(x + width).div_ceil(TILE) {
                let rows = (tile_y * TILE).max(y)..((tile_y + 1) * TILE).min(y + height);
                let columns = (tile_x * TILE).max(x)..((tile_x + 1) * TILE).min(x + width);
                let all = rows.flat_map(|row| columns.clone().map(move |column| (row - y) * width + column - x));
                let needs = |pixel: &usize| self.targets.as_ref().is_none_or(|t| t[*pixel] > self.n_passes);
                let pixels: Vec<usize> = all.filter(needs).collect();
                let number = tile_y * grid.columns.div_ceil(TILE) + tile_x;
                if !pixels.is_empty() {
                    tiles.push(Tile { number: number as u32, pixels });
                }
            }
        }
        tiles
    }

    /// Returns the means of a pass for each pixel of a tile, bands together.
    fn render_tile(&self, tile: &Tile, cancel: &Cancel) -> Result<Vec<f64>, BackwardError> {
        let RenderSettings { samples_per_pass, seed, .. } = self.settings;
        let (n_bands, n_pixels, grid) = (self.film.n_bands, tile.pixels.len(), self.camera.pixels());
        let (mut sums, mut counts) = (vec![0.0; n_bands * n_pixels], vec![0_u32; n_bands]);
        let (mut rays, mut ghosts) = (CameraRays::default(), CameraRays::default());
        let rotation = mix(tile.number ^ mix(seed as u32)) as usize % n_bands;
        for sample in 0..samples_per_pass {
            // Make the rays of the whole tile for eight wavelengths.
            let of_pixel = |&pixel: &usize| PixelSample {
                pixel,
                random: Sampler::new(seed, grid.number(pixel), self.n_passes, sample),
            };
            let samples: Vec<PixelSample> = tile.pixels.iter().map(of_pixel).collect();
            let in_order = self.n_passes as usize % n_bands * samples_per_pass as usize + sample as usize;
            let nodes = self.packets.nodes_of(rotation + in_order);
            self.camera.rays(&samples, &nodes, &mut rays);
            let has_ghosts = self.camera.ghost_rays(&samples, &nodes, &mut ghosts);
            // Find the light along each, and add it to its band.
            for (i, PixelSample { random, .. }) in samples.iter().enumerate() {
                cancel.check()?;
                let share = f64::from(random.pair(WAVELENGTH_PAIR)[0]);
                let wavelengths_nm = nodes.map(|node| self.packets.wavelength_nm(node, share) as f32);
                let radiance = self.packet_radiance(&rays, (i, n_pixels), &wavelengths_nm, random);
                let mut add = |radiance: [f32; PACKET]| {
                    for (node, value) in nodes.iter().zip(radiance) {
                        sums[i * n_bands + Packets::band_of(*node)] += f64::from(value);
                    }
                };
                add(radiance);
                if has_ghosts {
                    add(self.packet_radiance(&ghosts, (i, n_pixels), &wavelengths_nm, random));
                }
            }
            nodes.iter().for_each(|&node| counts[Packets::band_of(node)] += 1);
        }
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum /= f64::from(counts[i % n_bands]);
        }
        Ok(sums)
    }

    /// Returns what the rays of one of so many pixels see, times what they count.
    fn packet_radiance(
        &self,
        rays: &CameraRays,
        (i, n_pixels): (usize, usize),
        wavelengths_nm: &[f32; PACKET],
        random: &Sampler,
    ) -> [f32; PACKET] {
        if rays.is_shared {
            let weight = rays.weights[i];
            let radiance = || self.radiance(rays.rays[i], wavelengths_nm, random).map(|value| value * weight);
            return if weight > 0.0 { radiance() } else { [0.0; PACKET] };
        }
        std::array::from_fn(|k| {
            let weight = rays.weights[k * n_pixels + i];
            let radiance = || self.radiance(rays.rays[k * n_pixels + i], &[wavelengths_nm[k]], random)[0];
            if weight > 0.0 { radiance() * weight } else { 0.0 }
        })
    }

    /// Returns an estimate of the radiance along a ray, behind the surfaces that are looked through.
    fn radiance<const N: usize>(&self, ray: Ray, wavelengths_nm: &[f32; N], random: &Sampler) -> [f32; N] {
        // There may not be so many surfaces.
        let ray = match self.camera.layer() {
            0 => Some(ray),
            n => Surfaces::along(self.world, ray).ray_behind(n),
        };
        let RenderSettings { paths, clamp, .. } = self.settings;
        let integrator = Integrator { world: self.world, paths, clamp };
        ray.map_or([0.0; N], |ray| integrator.radiance(ray, wavelengths_nm, random))
    }
}

/// The pair of numbers that chooses wavelengths; those below are the stop's and the integrator's.
const WAVELENGTH_PAIR: u32 = u32::MAX;
/// The most samples of a pass.
const MOST_SAMPLES: u32 = 65_536;

/// Pixels that are rendered together.
struct Tile {
    number: u32,
    pixels: Vec<usize>,
}
