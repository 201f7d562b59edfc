//! Pixels of a large and a small photodiode, exposed together: the small one saturates last.

use crate::{DarkCurrent, Defects, ElectronRate, MergedFrame, Noise, Raw, Sensor, SensorError};

impl Sensor {
    /// Returns the data sheet of the small photodiodes of split pixels, or `None` where pixels are whole.
    pub fn small_photodiode(&self) -> Option<Self> {
        let split = self.split_pixel?;
        let dark_current = DarkCurrent { e_per_s: self.dark_current.e_per_s / split.area_ratio, ..self.dark_current };
        let defects = Defects { hot_e_per_s: self.defects.hot_e_per_s / split.area_ratio, ..self.defects };
        Some(Self {
            name: format!("{}, small photodiode", self.name),
            fill_factor: self.fill_factor / split.area_ratio,
            conversion_gain_v_per_e: split.conversion_gain_v_per_e,
            full_well_e: split.full_well_e,
            read_noise_v: 0.0,
            read_noise_e: Some(split.read_noise_e),
            high_gain: None,
            split_pixel: None,
            dark_current,
            defects,
            ..self.clone()
        })
    }

    /// Returns the rate of electrons in the small photodiodes, that in the large ones being known; `None` where pixels are whole.
    pub fn small_rate(&self, rate: &ElectronRate) -> Option<ElectronRate> {
        let share = self.split_pixel?.area_ratio.recip() as f32;
        Some(ElectronRate { planes_e_per_s: rate.planes_e_per_s.iter().map(|plane| plane * share).collect() })
    }

    /// Merges frames of the large photodiodes with those of the small ones into one of the range of both.
    ///
    /// As [`merge`](Self::merge): an electron of a small photodiode stands for as many as its area is smaller, with its own noise. The
    /// samples are in electrons of the large photodiode.
    ///
    /// # Errors
    /// When pixels are whole, or the frames do not fit each other.
    pub fn merge_split(&self, large: &[Raw], small: &[Raw]) -> Result<Raw, SensorError> {
        let Some(split) = self.split_pixel else {
            let reason = format!("needs split_pixel, which {} does not state", self.name);
            return Err(SensorError::Unsuitable { what: "a merge of two photodiodes", reason });
        };
        let frames: Vec<Raw> = large.iter().chain(small).cloned().collect();
        self.check_merge(&frames)?;
        let sheet = self.as_read(&frames[0].exposure)?;
        let small_sheet = sheet.small_photodiode().expect("a sheet as read has the pixels of its sensor");
        let source = |(shot, frame): (usize, &Raw)| {
            if shot < large.len() {
                return sheet.source_of(frame, shot);
            }
            let source = small_sheet.source_of(frame, shot);
            MergedFrame { time_s: source.time_s / split.area_ratio, ..source }
        };
        let sources = frames.iter().enumerate().map(source).collect();
        Ok(sheet.merge_as(&frames, sources))
    }
}

impl Noise {
    /// Returns the noises of the small photodiodes of the same frame: other draws, and a fixed pattern of their own.
    #[must_use]
    pub fn of_small_photodiode(self) -> Self {
        // Odd constants, far from those that tell frames apart.
        let (seed, fixed) = (self.seed ^ 0x5bd1_e995_7b93_4d21, self.fixed_pattern_seed ^ 0x27d4_eb2f_1656_67c5);
        Self { seed, fixed_pattern_seed: fixed, ..self }
    }
}
