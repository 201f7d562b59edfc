//! From the rate of photo-electrons to the electrons of one exposure.

use ndarray::Array2;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::{
    ElectronRate, Electrons, Exposure, Noise, NoiseSource, Sensor, SensorError, Tile, noise::Kind, poisson::poisson,
};

impl Sensor {
    /// Returns the electrons in each pixel at the end of an exposure, clipped at the full well.
    ///
    /// The pixels' sensitivities multiply the mean before the Poisson draw. With photon noise and dark-current noise
    /// off the means stay as they are, not rounded. Pixels that no light reaches ([`Sensor::optical_black`]) lie above and to the left.
    ///
    /// # Errors
    /// When the exposure makes no sense.
    pub fn electrons(&self, rate: &ElectronRate, exposure: &Exposure, noise: &Noise) -> Result<Electrons, SensorError> {
        self.electrons_by_row(rate, &[*exposure], &|_| 0, noise)
    }

    /// Returns the electrons of a frame of which each row has one of several exposures.
    pub(crate) fn electrons_by_row(
        &self,
        rate: &ElectronRate,
        exposures: &[Exposure],
        exposure_of: &(dyn Fn(usize) -> usize + Sync),
        noise: &Noise,
    ) -> Result<Electrons, SensorError> {
        exposures.iter().try_for_each(Exposure::check)?;
        let tile = self.tile()?;
        let shutters: Vec<Shutter<'_>> =
            exposures.iter().map(|exposure| Shutter::new(self, tile.as_ref(), exposure, noise)).collect();
        let plane = |(number, rate): (usize, &Array2<f32>)| {
            let mut electrons = self.with_masked(rate);
            let n_columns = electrons.ncols();
            let rows = electrons.as_slice_mut().expect("a standard layout is contiguous").par_chunks_mut(n_columns);
            rows.enumerate().for_each_init(
                || vec![RowPixel::default(); n_columns],
                |pixels, (row, values)| shutters[exposure_of(row)].expose_row(number, row, values, pixels),
            );
            shutters[0].spill(&mut electrons);
            electrons
        };
        Ok(Electrons { planes_e: rate.planes_e_per_s.iter().enumerate().map(plane).collect() })
    }
}

/// What sets a pixel apart from its neighbors.
#[derive(Clone, Copy)]
struct RowPixel {
    sensitivity: f64,
    dark_e: f64,
}

impl Default for RowPixel {
    fn default() -> Self {
        Self { sensitivity: 1.0, dark_e: 0.0 }
    }
}

/// One exposure of one sensor.
struct Shutter<'a> {
    sensor: &'a Sensor,
    tile: Option<&'a Tile>,
    noise: &'a Noise,
    time_s: f64,
    full_well_e: f64,
    dark_e: f64,
    hot_e: f64,
}

impl<'a> Shutter<'a> {
    fn new(sensor: &'a Sensor, tile: Option<&'a Tile>, exposure: &Exposure, noise: &'a Noise) -> Self {
        let dark_e = sensor.dark_current.at(exposure.temperature_c) * exposure.time_s;
        let growth = ((exposure.temperature_c - sensor.dark_current.at_c) / sensor.dark_current.doubling_k).exp2();
        Self {
            sensor,
            tile,
            noise,
            time_s: exposure.time_s,
            full_well_e: sensor.full_well_e(exposure.gain_mode),
            dark_e,
            hot_e: sensor.defects.hot_e_per_s * growth * exposure.time_s,
        }
    }

    /// Turns a row of rates into a row of electrons.
    fn expose_row(&self, plane: usize, row: usize, values: &mut [f32], pixels: &mut [RowPixel]) {
        self.fixed_pattern(plane, row, pixels);
        let mut rng = self.noise.rng(Kind::Photon, plane, row);
        let [with_photon_noise, with_dark_noise] =
            [NoiseSource::Photon, NoiseSource::DarkCurrent].map(|source| self.noise.has(source));
        let top_e = if self.sensor.blooming_fraction > 0.0 { f64::INFINITY } else { self.full_well_e };
        for (value, pixel) in values.iter_mut().zip(pixels) {
            let light_e = f64::from(*value) * self.time_s * pixel.sensitivity;
            let electrons = match (with_photon_noise, with_dark_noise) {
                (true, true) => poisson(light_e + pixel.dark_e, &mut rng),
                (true, false) => poisson(light_e, &mut rng) + pixel.dark_e,
                (false, true) => light_e + poisson(pixel.dark_e, &mut rng),
                (false, false) => light_e + pixel.dark_e,
            };
            *value = electrons.min(top_e) as f32;
        }
    }

    /// Sets what each pixel of a row is like.
    fn fixed_pattern(&self, plane: usize, row: usize, pixels: &mut [RowPixel]) {
        pixels.fill(RowPixel { sensitivity: 1.0, dark_e: self.dark_e });
        if self.noise.has(NoiseSource::Prnu) && self.sensor.prnu_fraction > 0.0 {
            let mut rng = self.noise.rng(Kind::Prnu, plane, row);
            for pixel in pixels.iter_mut() {
                let g: f64 = StandardNormal.sample(&mut rng);
                pixel.sensitivity = (1.0 + self.sensor.prnu_fraction * g).max(0.0);
            }
        }
        let defects = self.sensor.defects;
        if self.noise.has(NoiseSource::Defects) && defects.hot_fraction + defects.dead_fraction > 0.0 {
            let mut rng = self.noise.rng(Kind::Defects, plane, row);
            for pixel in pixels.iter_mut() {
                let lot: f64 = rng.random();
                if lot < defects.dead_fraction {
                    pixel.sensitivity = 0.0;
                } else if lot < defects.dead_fraction + defects.hot_fraction {
                    pixel.dark_e += self.hot_e;
                }
            }
        }
        self.shorten_dark(plane, row, pixels);
    }

    /// Leaves of the dark current what filters gather that are exposed for a share of the time; light has that share in its rate.
    fn shorten_dark(&self, plane: usize, row: usize, pixels: &mut [RowPixel]) {
        let filters = self.tile.map_or(std::slice::from_ref(&plane), |tile| tile.row(row));
        let share = |&filter: &usize| self.sensor.filters[filter].exposure_fraction;
        if filters.iter().any(|filter| share(filter) < 1.0) {
            pixels.iter_mut().zip(filters.iter().cycle()).for_each(|(pixel, filter)| pixel.dark_e *= share(filter));
        }
    }

    /// Lets the electrons above the full well spill up and down the columns, then clips.
    ///
    /// Of what a pixel cannot hold, half of the spilling share goes each way; what a full neighbor gets it hands on in
    /// the same direction. The rest is drained.
    fn spill(&self, electrons: &mut Array2<f32>) {
        let share = 0.5 * self.sensor.blooming_fraction;
        if share == 0.0 {
            return;
        }
        let (well, columns) = (self.full_well_e, electrons.axis_iter_mut(ndarray::Axis(1)));
        columns.into_par_iter().for_each(|mut column| {
            let excess: Vec<f64> = column.iter().map(|&e| (f64::from(e) - well).max(0.0)).collect();
            column.mapv_inplace(|e| f64::from(e).min(well) as f32);
            let mut receive = |row: usize, carried: &mut f64| {
                let total = f64::from(column[row]) + *carried;
                column[row] = total.min(well) as f32;
                *carried = (total - well).max(0.0) + share * excess[row];
            };
            let mut carried = 0.0;
            (0..excess.len()).for_each(|row| receive(row, &mut carried));
            carried = 0.0;
            (0..excess.len()).rev().for_each(|row| receive(row, &mut carried));
        });
    }
}
