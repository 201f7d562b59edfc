//! Test targets made from formulas: a flat pattern at one distance under one light.

mod leaves;
mod levels;
mod pattern;

use dioptric_spectrum::{
    Illuminant, Observer, Quantity, SpectralImage, Spectrum, WavelengthGrid, color_checker_reflectances,
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use self::leaves::Leaves;
use crate::{Scene, SceneError, SceneLight, formats::note_of_gaps};

/// The radii that leaves may have, samples: smaller ones take long to cover a target and show nothing.
const MIN_LEAF_PX: f64 = 0.1;
const MAX_LEAF_PX: f64 = 1e6;

/// What is drawn on a target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Pattern {
    /// White all over.
    Uniform,
    /// Squares of this many samples; the one at the top left is dark.
    Checkerboard {
        /// Side of a square, in samples.
        check_px: usize,
    },
    /// One straight edge through the center, light at the lower left.
    SlantedBar {
        /// Rows a column along the edge.
        slope: f64,
    },
    /// Lines a sample wide through the center, evenly turned.
    RadialLines {
        /// The number of whole lines; 8 give 16 rays.
        n_lines: usize,
    },
    /// Single light samples on a square lattice that has one at the center.
    PointArray {
        /// From point to point, in samples.
        spacing_px: usize,
    },
    /// Light and dark sectors.
    SiemensStar {
        /// Pairs of sectors once around.
        n_cycles: usize,
    },
    /// The 24 patches of the `ColorChecker`, four rows of six, on a black frame.
    ColorChart,
    /// Discs of many sizes and grays that hide one another ("dead leaves", IEEE Std 1858); their number falls as the cube of the radius.
    DeadLeaves {
        /// Radius of the smallest discs, in samples, 0.1 or more.
        min_radius_px: f64,
        /// Radius of the largest discs, in samples, above that of the smallest.
        max_radius_px: f64,
        /// What the darkest discs reflect, as a share of white; grays are evenly spread.
        min_reflectance: f64,
        /// What the lightest discs reflect.
        max_reflectance: f64,
        /// The seed of all discs: the same seed, the same discs.
        seed: u64,
    },
    /// The sum of waves about the middle gray, half of white; their contrasts add up to 1 at most.
    Harmonics {
        /// The waves.
        waves: Vec<Wave>,
    },
    /// A wave under a Gaussian window about the center, on the middle gray.
    Gabor {
        /// The wave.
        wave: Wave,
        /// The standard deviation of the window, as a share of the width.
        sigma: f64,
    },
    /// Straight light lines, one through the center.
    Lines {
        /// From line to line, in samples.
        spacing_px: f64,
        /// The width of a line, in samples, below the spacing.
        width_px: f64,
        /// Their direction, degrees from upright, turned clockwise.
        #[serde(default)]
        angle_deg: f64,
    },
    /// Light lines, upright and level, on a square lattice with a crossing at the center.
    Grid {
        /// From line to line, in samples.
        spacing_px: f64,
        /// The width of a line, in samples, below the spacing.
        width_px: f64,
    },
    /// A wave whose frequency grows from left to right, in equal steps of its logarithm.
    Sweep {
        /// Cycles over the width that it has at the left edge.
        first_cycles: f64,
        /// Cycles over the width that it has at the right edge.
        last_cycles: f64,
        /// (Most − least) / (most + least).
        #[serde(default = "full")]
        contrast: f64,
    },
    /// Rings about the center whose frequency grows in proportion to the radius.
    ZonePlate {
        /// Cycles over the width that it has at the left and right edges.
        edge_cycles: f64,
        /// (Most − least) / (most + least).
        #[serde(default = "full")]
        contrast: f64,
    },
    /// Gray that grows from black at the left to white at the right.
    Ramp {
        /// In so many steps; 0 for none.
        #[serde(default)]
        steps: usize,
        /// White over the darkest, of a ramp in equal ratios; left out, in equal differences from black.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ratio: Option<f64>,
    },
    /// Light words about the center, in `DejaVu` Sans.
    Letters {
        /// The words, a line.
        text: String,
        /// The height of a capital letter, in samples.
        height_px: f64,
    },
    /// Independent grays, evenly spread about the middle gray.
    Noise {
        /// The side of a square of one gray, in samples.
        #[serde(default = "one")]
        cell_px: usize,
        /// (Most − least) / (most + least).
        #[serde(default = "full")]
        contrast: f64,
        /// The same seed, the same grays.
        seed: u64,
    },
}

fn full() -> f64 {
    1.0
}

fn one() -> usize {
    1
}

impl Pattern {
    /// Whether its parts are so many samples large, whatever the size of the target.
    pub fn counts_samples(&self) -> bool {
        match self {
            Self::Checkerboard { .. }
            | Self::RadialLines { .. }
            | Self::PointArray { .. }
            | Self::DeadLeaves { .. }
            | Self::Lines { .. }
            | Self::Grid { .. }
            | Self::Letters { .. }
            | Self::Noise { .. } => true,
            Self::Uniform
            | Self::SlantedBar { .. }
            | Self::SiemensStar { .. }
            | Self::ColorChart
            | Self::Harmonics { .. }
            | Self::Gabor { .. }
            | Self::Sweep { .. }
            | Self::ZonePlate { .. }
            | Self::Ramp { .. } => false,
        }
    }
}

/// A wave over a target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Wave {
    /// Cycles over the width of the target.
    pub cycles: f64,
    /// (Most − least) / (most + least).
    #[serde(default = "full")]
    pub contrast: f64,
    /// Its phase at the center, degrees: 0 is light there.
    #[serde(default)]
    pub phase_deg: f64,
    /// The direction of its stripes, degrees from upright, turned clockwise.
    #[serde(default)]
    pub angle_deg: f64,
}

/// The shape of a target's spectrum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum TargetLight {
    /// The same power in every nanometre.
    EqualEnergy,
    /// The same number of photons in every nanometre.
    EqualPhotons,
    /// The spectrum of a light.
    Illuminant(Illuminant),
}

impl TargetLight {
    /// Returns the relative spectral power.
    fn spectrum(&self) -> Spectrum {
        match self {
            Self::EqualEnergy => Spectrum::constant(1.0),
            Self::EqualPhotons => {
                // The energy of a photon is as one over its wavelength.
                let wavelengths_nm: Vec<f64> = (200..=1200).map(f64::from).collect();
                let values = wavelengths_nm.iter().map(|nm| 550.0 / nm).collect();
                Spectrum::new(wavelengths_nm, values).expect("the wavelengths ascend")
            }
            Self::Illuminant(illuminant) => illuminant.spectrum(),
        }
    }

    /// Returns the relative spectral power in each band.
    fn on_bands(&self, grid: &WavelengthGrid) -> Vec<f64> {
        match self {
            Self::EqualEnergy | Self::EqualPhotons => self.spectrum().sample_held(grid),
            Self::Illuminant(illuminant) => illuminant.on_bands(grid),
        }
    }
}

/// A flat target that faces the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// What is drawn on it.
    pub pattern: Pattern,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// The shape of its spectrum.
    pub light: TargetLight,
    /// The luminance of its white, cd/m².
    pub luminance_cd_m2: f64,
    /// What its dark reflects, as a share of its white; patterns of grays do without.
    pub dark: f64,
    /// Points a sample and direction at which the pattern is looked up: 1 gives hard steps, as in the paper.
    pub supersampling: usize,
    /// Angle from its left edge to its right.
    pub horizontal_fov_deg: f64,
    /// Its distance along the axis, m.
    pub distance_m: f64,
}

impl Target {
    /// The checkerboard of Figure 3 of the paper: 4 × 4 squares of 16 samples, 3° wide, 8 m away.
    pub fn paper_checkerboard() -> Self {
        Self::paper(Pattern::Checkerboard { check_px: 16 }, 64, TargetLight::EqualPhotons)
    }

    /// The slanted bar of Figure 3 of the paper: 385 samples, slope 2.6, 3° wide, 8 m away.
    pub fn paper_slanted_bar() -> Self {
        Self::paper(Pattern::SlantedBar { slope: 2.6 }, 385, TargetLight::EqualEnergy)
    }

    /// The radial lines of Figure 3 of the paper: 256 samples, 8 lines, 3° wide, 8 m away.
    pub fn paper_radial_lines() -> Self {
        Self::paper(Pattern::RadialLines { n_lines: 8 }, 256, TargetLight::EqualPhotons)
    }

    fn paper(pattern: Pattern, size: usize, light: TargetLight) -> Self {
        Self {
            pattern,
            rows: size,
            columns: size,
            light,
            luminance_cd_m2: 100.0,
            dark: 1e-4,
            supersampling: 1,
            horizontal_fov_deg: 3.0,
            distance_m: 8.0,
        }
    }

    /// Returns the target as a scene on these bands, with its depth and view.
    ///
    /// # Errors
    /// When a size, the luminance, the contrast, the angle or the distance cannot be.
    pub fn scene(&self, grid: &WavelengthGrid) -> Result<Scene, SceneError> {
        self.check()?;
        let white = self.white_radiance(grid)?;
        let radiance = match &self.pattern {
            Pattern::ColorChart => self.chart(grid, &white)?,
            _ => {
                let reflected = self.reflectance();
                let planes = white.iter().map(|w| reflected.mapv(|r| (r * w) as f32)).collect();
                SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?
            }
        };
        let illuminant = match &self.light {
            TargetLight::EqualEnergy => Illuminant::E,
            TargetLight::EqualPhotons => Illuminant::Spectrum(self.light.spectrum()),
            TargetLight::Illuminant(light) => light.clone(),
        };
        // White is a perfect diffuser.
        let mut notes = self.beyond_measured(grid, &illuminant);
        notes.extend(levels::unresolved(self));
        notes.extend(note_of_gaps(self.name(), grid));
        let light = Some(SceneLight::new(illuminant, std::f64::consts::PI * self.luminance_cd_m2));
        Scene { light, notes, ..Scene::new(self.name(), radiance) }
            .or_flat_depth_m(self.distance_m)?
            .or_horizontal_fov_deg(self.horizontal_fov_deg)
    }

    /// Returns what is said of bands beyond those in which the chart, or a light that is a table, was measured.
    fn beyond_measured(&self, grid: &WavelengthGrid, light: &Illuminant) -> Vec<String> {
        let chart = match self.pattern {
            Pattern::ColorChart => color_checker_reflectances().first().map(|(_, patch)| patch.range_nm()),
            _ => None,
        };
        let (first, last) = grid.range_nm();
        let chart = chart.filter(|(from, to)| first < *from || last > *to).map(|(from, to)| {
            format!("the reflectances of the chart are known from {from} to {to} nm; beyond, their end values are held")
        });
        let is_told = matches!(self.light, TargetLight::Illuminant(_));
        chart.into_iter().chain(light.note_beyond_table(grid).filter(|_| is_told)).collect()
    }

    /// Returns what each sample of a gray pattern reflects, as a share of white.
    fn reflectance(&self) -> Array2<f64> {
        match self.pattern {
            Pattern::DeadLeaves { min_radius_px, max_radius_px, min_reflectance, max_reflectance, seed } => {
                let (size, radii_px) = ((self.rows, self.columns), [min_radius_px, max_radius_px]);
                let leaves = Leaves::new(size, radii_px, [min_reflectance, max_reflectance], seed);
                leaves::reflectance(leaves, size, self.supersampling)
            }
            Pattern::Lines { .. } | Pattern::Grid { .. } | Pattern::Letters { .. } => {
                levels::reflectance(self).mapv(|share| self.dark + (1.0 - self.dark) * share)
            }
            Pattern::Harmonics { .. }
            | Pattern::Gabor { .. }
            | Pattern::Sweep { .. }
            | Pattern::ZonePlate { .. }
            | Pattern::Ramp { .. }
            | Pattern::Noise { .. } => levels::reflectance(self),
            _ => pattern::light_share(self).mapv(|share| self.dark + (1.0 - self.dark) * share),
        }
    }

    /// The name of the pattern, in words.
    fn name(&self) -> &'static str {
        match self.pattern {
            Pattern::Uniform => "uniform target",
            Pattern::Checkerboard { .. } => "checkerboard",
            Pattern::SlantedBar { .. } => "slanted bar",
            Pattern::RadialLines { .. } => "radial lines",
            Pattern::PointArray { .. } => "point array",
            Pattern::SiemensStar { .. } => "Siemens star",
            Pattern::ColorChart => "color chart",
            Pattern::DeadLeaves { .. } => "dead leaves",
            Pattern::Harmonics { .. } => "harmonics",
            Pattern::Gabor { .. } => "Gabor patch",
            Pattern::Lines { .. } => "lines",
            Pattern::Grid { .. } => "grid",
            Pattern::Sweep { .. } => "frequency sweep",
            Pattern::ZonePlate { .. } => "zone plate",
            Pattern::Ramp { .. } => "ramp",
            Pattern::Letters { .. } => "letters",
            Pattern::Noise { .. } => "noise",
        }
    }

    fn check(&self) -> Result<(), SceneError> {
        let setting = |what, value: String, expected: &str| {
            Err(SceneError::Setting { what, value, expected: expected.to_owned() })
        };
        if self.rows == 0 || self.columns == 0 || self.rows.saturating_mul(self.columns) > 1 << 30 {
            let value = format!("{} × {} samples", self.rows, self.columns);
            return setting("the size of the target", value, "1 to 2³⁰ samples");
        }
        if !(self.luminance_cd_m2.is_finite() && self.luminance_cd_m2 > 0.0) {
            let value = format!("{} cd/m²", self.luminance_cd_m2);
            return setting("the luminance of the target", value, "a finite number above 0");
        }
        if !(0.0..=1.0).contains(&self.dark) {
            return setting("the dark of the target", self.dark.to_string(), "a share from 0 to 1");
        }
        if !(1..=64).contains(&self.supersampling) {
            return setting("the supersampling of the target", self.supersampling.to_string(), "1 to 64");
        }
        if let Pattern::DeadLeaves { min_radius_px, max_radius_px, min_reflectance, max_reflectance, .. } = self.pattern
        {
            if !(MIN_LEAF_PX <= min_radius_px && min_radius_px < max_radius_px && max_radius_px <= MAX_LEAF_PX) {
                let value = format!("{min_radius_px} to {max_radius_px} samples");
                return setting("the radius of the leaves", value, "a range within 0.1 to 1000000 samples");
            }
            if !(0.0 <= min_reflectance && min_reflectance <= max_reflectance && max_reflectance <= 1.0) {
                let value = format!("{min_reflectance} to {max_reflectance}");
                return setting("the reflectance of the leaves", value, "a range of shares within 0 to 1");
            }
        }
        let (counts, finite) = match self.pattern {
            Pattern::Checkerboard { check_px: n }
            | Pattern::RadialLines { n_lines: n }
            | Pattern::PointArray { spacing_px: n }
            | Pattern::SiemensStar { n_cycles: n } => (n > 0, true),
            Pattern::SlantedBar { slope } => (true, slope.is_finite()),
            _ => (true, true),
        };
        if !(counts && finite) {
            return setting(
                "the pattern of the target",
                format!("{:?}", self.pattern),
                "a count above 0, a finite slope",
            );
        }
        levels::check(&self.pattern)
    }

    /// Returns the radiance of the white in each band.
    fn white_radiance(&self, grid: &WavelengthGrid) -> Result<Vec<f64>, SceneError> {
        // The luminance comes from the full 1 nm table, not from the caller's grid.
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0)?;
        let luminance = Observer::Cie1931.xyz(&fine, &self.light.on_bands(&fine)).luminance_cd_m2();
        Ok(self.light.on_bands(grid).into_iter().map(|v| v * self.luminance_cd_m2 / luminance).collect())
    }

    fn chart(&self, grid: &WavelengthGrid, white: &[f64]) -> Result<SpectralImage, SceneError> {
        let patches: Vec<Vec<f64>> = color_checker_reflectances().iter().map(|(_, s)| s.sample_held(grid)).collect();
        let shares = pattern::patch_shares(self);
        let planes = (0..grid.len()).map(|band| {
            let reflected = |shares: &pattern::PatchShares| -> f64 {
                let patches = shares.iter().map(|&(patch, share)| share * patches[usize::from(patch)][band]);
                patches.sum::<f64>() * white[band]
            };
            Array2::from_shape_fn(shares.dim(), |at| reflected(&shares[at]) as f32)
        });
        Ok(SpectralImage::new(Quantity::Radiance, grid.clone(), planes.collect())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn grid() -> WavelengthGrid {
        WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap()
    }

    fn of(pattern: Pattern) -> Target {
        Target {
            rows: 61,
            columns: 81,
            supersampling: 4,
            light: TargetLight::Illuminant(Illuminant::D65),
            ..Target::paper(pattern, 1, TargetLight::EqualEnergy)
        }
    }

    #[test]
    fn the_papers_targets_have_the_papers_shapes() {
        let scene = Target::paper_checkerboard().scene(&grid()).unwrap();
        let plane = &scene.radiance.planes()[10];
        assert_eq!(plane.dim(), (64, 64));
        assert!(plane[(8, 8)] < 1e-3 * plane[(8, 24)] && plane[(24, 8)] == plane[(8, 24)]);
        // Equal photons: energy falls as one over the wavelength.
        let spectrum = scene.radiance.spectrum_at(8, 24);
        assert_relative_eq!(spectrum[0] * 400.0, spectrum[30] * 700.0, max_relative = 1e-6);

        let bar = Target::paper_slanted_bar().scene(&grid()).unwrap();
        let plane = &bar.radiance.planes()[0];
        assert_eq!(plane.dim(), (385, 385));
        assert!(plane[(384, 0)] > plane[(0, 384)]);
        let light_in_top_row = plane.row(0).iter().filter(|&&v| v > 0.5 * plane[(384, 0)]).count();
        // The edge y = 2.6 x meets the top row, 192 above the center, 73.8 left of it.
        assert_eq!(light_in_top_row, 192 - 73);

        let lines = Target::paper_radial_lines().scene(&grid()).unwrap();
        let plane = &lines.radiance.planes()[0];
        let bright = plane[(128, 128)];
        let on_circle = (0..3600).map(|i| f64::from(i).to_radians() / 10.0).map(|angle| {
            let (row, column) = (128.0 + 80.0 * angle.sin(), 128.0 + 80.0 * angle.cos());
            plane[(row.round() as usize, column.round() as usize)] == bright
        });
        let on_circle: Vec<bool> = on_circle.collect();
        let rays = (0..3600).filter(|&i| on_circle[i] && !on_circle[(i + 1) % 3600]).count();
        assert_eq!(rays, 16);
    }

    #[test]
    fn white_has_the_luminance_asked_for() {
        for pattern in [Pattern::Uniform, Pattern::SiemensStar { n_cycles: 16 }] {
            let target = Target { luminance_cd_m2: 250.0, ..of(pattern.clone()) };
            let scene = target.scene(&WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap()).unwrap();
            scene.validate().unwrap();
            let expected = if pattern == Pattern::Uniform { 250.0 } else { 125.0 };
            // A star is half light, to the share of its odd center sample; 5 nm bands are within 0.1 %.
            assert_relative_eq!(scene.mean_luminance_cd_m2(), expected, max_relative = 0.01);
        }
    }

    #[test]
    fn a_point_array_has_one_sample_a_point() {
        let scene = Target { dark: 0.0, ..of(Pattern::PointArray { spacing_px: 20 }) }.scene(&grid()).unwrap();
        let plane = &scene.radiance.planes()[0];
        assert_eq!(plane.iter().filter(|&&v| v > 0.0).count(), 4 * 4 + 5 * 3 - 16);
        assert!(plane[(30, 40)] > 0.0 && plane[(50, 20)] > 0.0);
    }

    /// Bands lie side by side, however far apart their centers are, and have what the light has over their width.
    #[test]
    fn white_keeps_its_color_on_any_bands() {
        use dioptric_spectrum::{Xyz, delta_e_2000};
        let wide = |step: f64| WavelengthGrid::uniform(380.0, 780.0, step).unwrap();
        let seven = vec![405.0, 440.0, 470.0, 525.0, 560.0, 610.0, 670.0];
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).unwrap();
        for light in [Illuminant::D65, Illuminant::D50, Illuminant::A, Illuminant::parse("5500K").unwrap()] {
            let light = TargetLight::Illuminant(light);
            let target = Target { light: light.clone(), luminance_cd_m2: 1.0, ..of(Pattern::Uniform) };
            let white = Observer::Cie1931.xyz(&fine, &target.white_radiance(&fine).unwrap());
            for (grid, most) in [
                (wide(5.0), 0.02),
                (wide(10.0), 0.02),
                (wide(20.0), 0.2),
                (WavelengthGrid::new(seven.clone()).unwrap(), 1.6),
            ] {
                let found = Observer::Cie1931.xyz(&grid, &target.white_radiance(&grid).unwrap());
                let off = delta_e_2000(found.to_lab(white), Xyz([1.0; 3]).to_lab(Xyz([1.0; 3])));
                assert!(off < most, "{light:?} on {} bands: {off}", grid.len());
            }
        }
    }

    #[test]
    fn the_chart_shows_its_patches() {
        let target = Target { rows: 120, columns: 180, ..of(Pattern::ColorChart) };
        let scene = target.scene(&grid()).unwrap();
        scene.validate().unwrap();
        let white = TargetLight::Illuminant(Illuminant::D65);
        let white = Target { light: white, ..target }.white_radiance(&grid()).unwrap();
        let chart = color_checker_reflectances();
        for (patch, (name, reflectance)) in chart.iter().enumerate() {
            let (row, column) = (15 + 30 * (patch / 6), 15 + 30 * (patch % 6));
            let found = scene.radiance.spectrum_at(row, column)[15] / white[15];
            assert_relative_eq!(found, reflectance.at_held(550.0), max_relative = 1e-6);
            assert!(!name.is_empty());
        }
    }

    fn leaves(radii_px: [f64; 2], reflectances: [f64; 2]) -> Pattern {
        Pattern::DeadLeaves {
            min_radius_px: radii_px[0],
            max_radius_px: radii_px[1],
            min_reflectance: reflectances[0],
            max_reflectance: reflectances[1],
            seed: 7,
        }
    }

    #[test]
    fn leaves_are_the_same_by_one_thread_and_two() {
        let target = of(leaves([1.0, 30.0], [0.25, 0.75]));
        let by = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| target.scene(&grid()).unwrap()).radiance
        };
        let one = by(1);
        assert!(one == by(2));
        let white = target.white_radiance(&grid()).unwrap()[15] as f32;
        assert!(one.planes()[15].iter().all(|v| (0.25 * 0.9999..=0.75 * 1.0001).contains(&(v / white))));
    }

    #[test]
    fn bands_beyond_the_measured_chart_are_named() {
        let chart = of(Pattern::ColorChart);
        let notes = |last_nm: f64| chart.scene(&WavelengthGrid::uniform(400.0, last_nm, 50.0).unwrap()).unwrap().notes;
        assert!(notes(700.0).is_empty());
        assert!(notes(900.0)[0].contains("380 to 730 nm"), "{:?}", notes(900.0));
    }

    #[test]
    fn targets_that_cannot_be_are_refused() {
        let good = of(Pattern::Uniform);
        for wrong in [
            Target { rows: 0, ..good.clone() },
            Target { luminance_cd_m2: f64::NAN, ..good.clone() },
            Target { dark: 1.5, ..good.clone() },
            Target { supersampling: 0, ..good.clone() },
            Target { horizontal_fov_deg: 0.0, ..good.clone() },
            Target { distance_m: -1.0, ..good },
            of(Pattern::Checkerboard { check_px: 0 }),
            of(Pattern::SlantedBar { slope: f64::INFINITY }),
            of(leaves([0.0, 30.0], [0.2, 0.8])),
            of(leaves([30.0, 30.0], [0.2, 0.8])),
            of(leaves([1.0, f64::NAN], [0.2, 0.8])),
            of(leaves([1.0, 30.0], [0.8, 0.2])),
            of(leaves([1.0, 30.0], [0.2, 1.1])),
        ] {
            assert!(wrong.scene(&grid()).is_err(), "{wrong:?}");
        }
    }
}
