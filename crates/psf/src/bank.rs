//! The bank: ray maps over field, depth and wavelength, from which any point spread function is drawn.

use dioptric_diffraction::{Edge, Hurb, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::{Lens, MonoLens, ObjectPoint};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    Kernel, PsfError, RadialGeometry,
    axis::{Axis, Stencil},
    dispersion::Dispersion,
    mesh::Mesh,
    pupil::Pupil,
    ray_map::{Record, Summary, Task},
    render::{self, Bending, Layout},
};

/// How diffraction is taken into account.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Diffraction {
    /// Not at all: geometric optics.
    None,
    /// Uncertainty bending at the stop with a factor γ: 1 as in the paper, √2 as in later versions of its code.
    Hurb {
        /// The factor.
        gamma: f64,
    },
    /// Uncertainty bending with constants calibrated to Airy's pattern: better in focus, not in defocus.
    HurbCalibrated,
    /// Wave optics while the blur is small enough for it, uncertainty bending (γ = 1) beyond, blended over an octave:
    /// see [`PsfBank::wave_share`].
    Wave,
}

impl Diffraction {
    fn model(self) -> Option<Hurb> {
        match self {
            Self::None => None,
            Self::Hurb { gamma } => Some(Hurb::with_gamma(gamma)),
            Self::Wave => Some(Hurb::PAPER),
            Self::HurbCalibrated => Some(Hurb::CALIBRATED),
        }
    }
}

/// What a bank covers, and how finely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BankSettings {
    /// Distance of the film behind the last vertex, mm.
    pub film_mm: f64,
    /// The wavelength whose paraxial entrance pupil fields and depths count from, nm.
    pub reference_wavelength_nm: f64,
    /// Tangents of field angles, ascending from 0.
    pub field_tans: Vec<f64>,
    /// Depths in dioptres (1/Z, Z in metres from the entrance pupil, 0 is infinitely far), ascending.
    pub dioptres: Vec<f64>,
    /// Wavelengths, nm, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// Rings of the mesh in the pupil: 12 give the outlines of blurs to about 1 %.
    pub n_rings: usize,
    /// Nodes on a ring, at least 8: 48 go with 12 rings.
    pub n_azimuths: usize,
    /// How diffraction is taken into account.
    pub diffraction: Diffraction,
}

impl BankSettings {
    /// Returns settings that cover these ranges at 9 fields, 9 depths and 4 wavelengths, evenly spaced in the tangent,
    /// in dioptres and in 1/λ², with 12 × 48 rays each: the error of an interpolated blur is about 1 %.
    ///
    /// A range of no length becomes a single sample.
    pub fn covering(
        film_mm: f64,
        last_field_tan: f64,
        dioptres: (f64, f64),
        wavelengths_nm: (f64, f64),
        diffraction: Diffraction,
    ) -> Self {
        let by_frequency = spaced((inverse_square(wavelengths_nm.1), inverse_square(wavelengths_nm.0)), 4);
        let mut wavelengths: Vec<f64> = by_frequency.into_iter().rev().map(|q| 1.0 / q.sqrt()).collect();
        // The ends are the ones asked for, to the bit.
        let last = wavelengths.len() - 1;
        wavelengths[0] = wavelengths_nm.0;
        wavelengths[last] = wavelengths_nm.1;
        Self {
            film_mm,
            reference_wavelength_nm: 550.0,
            field_tans: spaced((0.0, last_field_tan), 9),
            dioptres: spaced(dioptres, 9),
            wavelengths_nm: wavelengths,
            n_rings: 12,
            n_azimuths: 48,
            diffraction,
        }
    }

    pub(crate) fn check(&self) -> Result<(), PsfError> {
        let axis = |axis, found: &[f64], expected, is_good: &dyn Fn(f64) -> bool| match Axis::new(found.to_vec())
            .is_some()
            && found.iter().all(|&v| is_good(v))
        {
            true => Ok(()),
            false => Err(PsfError::Axis { axis, expected, found: found.to_vec() }),
        };
        axis("field_tans", &self.field_tans, "tangents of which the first is 0", &|v| v >= 0.0)?;
        if self.field_tans[0] != 0.0 {
            let expected = "tangents of which the first is 0";
            return Err(PsfError::Axis { axis: "field_tans", expected, found: self.field_tans.clone() });
        }
        axis("dioptres", &self.dioptres, "numbers of 0 or more", &|v| v >= 0.0)?;
        axis("wavelengths_nm", &self.wavelengths_nm, "numbers above 0", &|v| v > 0.0)?;
        let setting = |key, found: f64, expected, is_good: bool| match is_good {
            true => Ok(()),
            false => Err(PsfError::Setting { key, found, expected }),
        };
        setting("film_mm", self.film_mm, "a finite number", self.film_mm.is_finite())?;
        setting("n_rings", self.n_rings as f64, "2 or more", self.n_rings >= 2)?;
        setting("n_azimuths", self.n_azimuths as f64, "8 or more", self.n_azimuths >= 8)?;
        if let Diffraction::Hurb { gamma } = self.diffraction {
            setting("gamma", gamma, "a finite number above 0", gamma.is_finite() && gamma > 0.0)?;
        }
        Ok(())
    }
}

/// Returns `n` evenly spaced numbers from one end of a range to the other, or its one number.
fn spaced((first, last): (f64, f64), n: usize) -> Vec<f64> {
    if last <= first {
        return vec![first];
    }
    (0..n).map(|i| first + (last - first) * i as f64 / (n - 1) as f64).collect()
}

fn inverse_square(wavelength_nm: f64) -> f64 {
    1.0 / (wavelength_nm * wavelength_nm)
}

/// The largest range of phases, radians, at which a kernel is wave optics alone; at twice that there is none.
const ALL_WAVE: f64 = 200.0;
/// How many times finer than the bank's the table of image heights is, in the field.
const GEOMETRY_STEPS: usize = 3;
/// The field that stands for the axis where a ratio of height to field is needed, as a share of the largest.
const NEAR_AXIS: f64 = 1e-3;

/// Ray maps of a rotationally symmetric lens over field, depth and wavelength.
///
/// It interpolates rays, not pictures: 50 to 300 samples are better than thousands of blended ones. Image height
/// and brightness are kept apart from blur, in a finer table.
#[derive(Clone, Debug)]
pub struct PsfBank {
    // Invariant: `records` and `summaries` are indexed by (wavelength, depth, field), the field innermost.
    settings: BankSettings,
    fields: Axis,
    dioptres: Axis,
    /// Wavelengths in reverse, by the measure of the lens's dispersion.
    colors: Axis,
    dispersion: Dispersion,
    records: Vec<Record>,
    geometry_fields: Vec<f64>,
    summaries: Vec<Summary>,
    lens: Lens,
    reference: MonoLens,
    /// Index around the stop at each of the colours.
    stop_indices: Vec<f64>,
}

impl PsfBank {
    /// Traces a bank on all threads.
    ///
    /// Fields that see no light at some depth or wavelength are left out, and those beyond them.
    ///
    /// # Errors
    /// When the settings make no sense, the lens has no index at a wavelength or is not rotationally symmetric, or not
    /// even the axis sees light.
    pub fn build(lens: &Lens, settings: &BankSettings) -> Result<Self, PsfError> {
        settings.check()?;
        lens.check_rotational("a bank of point spread functions")?;
        let reference = lens.at(settings.reference_wavelength_nm)?;
        let lenses: Vec<MonoLens> =
            settings.wavelengths_nm.iter().rev().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
        let mesh = Mesh { n_rings: settings.n_rings, n_azimuths: settings.n_azimuths };
        let has_stop = settings.diffraction != Diffraction::None;
        let geometry_fields = geometry_fields(&settings.field_tans);
        let task = |lens, field_tan, dioptres| Task {
            lens,
            reference: &reference,
            field_tan: DVec2::new(field_tan, 0.0),
            dioptres,
            film_mm: settings.film_mm,
            mesh,
        };
        let axial = task(&reference, 0.0, settings.dioptres[0]);
        let seed = Pupil::find(&reference, &axial.point(), mesh.n_azimuths).ok_or_else(|| PsfError::Dark {
            lens: lens.name().to_owned(),
            dioptres: axial.dioptres,
            wavelength_nm: settings.reference_wavelength_nm,
        })?;
        let columns: Vec<(&MonoLens, f64)> =
            lenses.iter().flat_map(|lens| settings.dioptres.iter().map(move |&d| (lens, d))).collect();
        let traced: Vec<Vec<(Option<Record>, Summary)>> = columns
            .par_iter()
            .map(|&(lens, dioptres)| {
                let near_axis = NEAR_AXIS * settings.field_tans.last().copied().filter(|f| *f > 0.0).unwrap_or(0.1);
                let mut column = vec![];
                let mut pupil = seed.clone();
                for (i, &field) in geometry_fields.iter().enumerate() {
                    let is_knot = i % GEOMETRY_STEPS == 0;
                    let here = task(lens, field, dioptres);
                    let Some(found) = pupil.near(lens, &here.point()) else { break };
                    pupil = found;
                    let Some(traced) = here.trace(&pupil, has_stop && is_knot) else { break };
                    let mut summary = traced.summary;
                    // Height over field has its limit on the axis.
                    summary.centroid_mm /= field;
                    if i == 0 {
                        let beside = task(lens, near_axis, dioptres);
                        let Some(nearby) = pupil.near(lens, &beside.point()) else { break };
                        let Some(beside) = beside.trace(&nearby, false) else { break };
                        summary.centroid_mm = beside.summary.centroid_mm / near_axis;
                    }
                    column.push((is_knot.then(|| traced.record(mesh, has_stop)), summary));
                }
                column
            })
            .collect();

        let n_lit = traced.iter().map(Vec::len).min().unwrap_or(0);
        if n_lit == 0 {
            let dark = traced.iter().position(Vec::is_empty).unwrap_or(0);
            let (lens_there, dioptres) = columns[dark];
            let wavelength_nm = lens_there.wavelength_nm();
            return Err(PsfError::Dark { lens: lens.name().to_owned(), dioptres, wavelength_nm });
        }
        let n_fields = (n_lit - 1) / GEOMETRY_STEPS + 1;
        let n_geometry = Self::n_geometry(n_fields);
        let mut records = vec![];
        let mut summaries = vec![];
        for column in traced {
            for (record, summary) in column.into_iter().take(n_geometry) {
                records.extend(record);
                summaries.push(summary);
            }
        }
        Self::assemble(lens, settings, n_fields, records, summaries)
    }

    /// Puts a bank together from what was traced.
    pub(crate) fn assemble(
        lens: &Lens,
        settings: &BankSettings,
        n_fields: usize,
        records: Vec<Record>,
        summaries: Vec<Summary>,
    ) -> Result<Self, PsfError> {
        settings.check()?;
        let colors: Vec<f64> = settings.wavelengths_nm.iter().rev().copied().collect();
        let dispersion = Dispersion::of(lens, &settings.wavelengths_nm);
        let stop_index = |&nm: &f64| Ok(lens.at(nm)?.stop_medium_index());
        let axis = |knots: Vec<f64>| Axis::new(knots).expect("the settings were checked");
        let mut geometry_fields = geometry_fields(&settings.field_tans);
        geometry_fields.truncate(Self::n_geometry(n_fields));
        Ok(Self {
            fields: axis(settings.field_tans[..n_fields].to_vec()),
            dioptres: axis(settings.dioptres.clone()),
            colors: axis(colors.iter().map(|&nm| dispersion.coordinate(nm)).collect()),
            dispersion,
            records,
            geometry_fields,
            summaries,
            lens: lens.clone(),
            stop_indices: colors.iter().map(stop_index).collect::<Result<_, PsfError>>()?,
            reference: lens.at(settings.reference_wavelength_nm)?,
            settings: settings.clone(),
        })
    }

    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    pub(crate) fn n_fields(&self) -> usize {
        self.fields.knots().len()
    }

    /// Returns how many fields the table of image heights has, for so many of the bank.
    pub(crate) fn n_geometry(n_fields: usize) -> usize {
        n_fields.saturating_sub(1) * GEOMETRY_STEPS + 1
    }

    pub(crate) fn records(&self) -> &[Record] {
        &self.records
    }

    pub(crate) fn summaries(&self) -> &[Summary] {
        &self.summaries
    }

    /// What the bank was asked to cover.
    pub fn settings(&self) -> &BankSettings {
        &self.settings
    }

    /// The largest field that sees light, as its tangent.
    pub fn last_field_tan(&self) -> f64 {
        let knots = self.fields.knots();
        knots[knots.len() - 1]
    }

    /// Returns where centroids land and how bright they are, at one depth and wavelength.
    pub fn geometry(&self, dioptres: f64, wavelength_nm: f64) -> RadialGeometry {
        let n = self.geometry_fields.len();
        let mut magnification_mm = vec![0.0; n];
        let mut pupil_mm2 = vec![0.0; n];
        for (column, weight) in self.columns(dioptres, wavelength_nm) {
            for (i, summary) in self.summaries[column * n..][..n].iter().enumerate() {
                magnification_mm[i] += weight * summary.centroid_mm.x;
                pupil_mm2[i] += weight * summary.pupil_mm2;
            }
        }
        RadialGeometry::new(self.geometry_fields.clone(), magnification_mm, &pupil_mm2)
    }

    /// Returns the point spread function of a point, on pixels of a pitch, about its centroid.
    ///
    /// Fields, depths and wavelengths outside the bank are moved to its ends. The window holds the whole geometric
    /// picture, and of diffraction's Gaussians all but their far tails; the sum says how much.
    pub fn kernel(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Kernel {
        let record = self.record(field_tan.length(), dioptres, wavelength_nm);
        let layout = self.layout(&record, field_tan, wavelength_nm, pitch_um);
        let is_diffracted = self.settings.diffraction != Diffraction::None;
        let (side, share) = (layout.side(), self.share_of(&layout));
        let waves = (share > 0.0).then(|| self.waves(field_tan, dioptres, wavelength_nm, pitch_um, side)).flatten();
        let energies = match waves {
            None => layout.draw(),
            Some(waves) if share == 1.0 => waves,
            Some(waves) => waves * share + layout.draw() * (1.0 - share),
        };
        render::kernel(&energies, is_diffracted, pitch_um)
    }

    /// Returns how much of a kernel is wave optics, and not uncertainty bending: 1 or 0, or between them where they are
    /// blended. It is 0 unless the bank has [`Diffraction::Wave`].
    ///
    /// It falls with the range of phases B over the pupil that the sum has to follow, on a scale of its logarithm: from
    /// 1 at B = 200 to 0 at B = 400, a blur of about ten waves of defocus.
    pub fn wave_share(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> f64 {
        let record = self.record(field_tan, dioptres, wavelength_nm);
        self.share_of(&self.layout(&record, DVec2::X, wavelength_nm, pitch_um))
    }

    fn share_of(&self, layout: &Layout<'_>) -> f64 {
        match self.settings.diffraction {
            Diffraction::Wave => (2.0 - (layout.bandwidth() / ALL_WAVE).log2()).clamp(1.0, 2.0) - 1.0,
            _ => 0.0,
        }
    }

    fn layout<'a>(&self, record: &'a Record, field_tan: DVec2, wavelength_nm: f64, pitch_um: f64) -> Layout<'a> {
        let turn = field_tan.try_normalize().unwrap_or(DVec2::X);
        let bending = self.settings.diffraction.model().map(|model| {
            let index = self.stop_index(wavelength_nm);
            Bending { model, edge: Edge::new(self.reference.stop_semi_aperture_mm(), wavelength_nm, index) }
        });
        Layout::new(record, turn, bending, pitch_um)
    }

    /// Returns the wave-optical energies about the centroid, or `None` where the rays have no angular spectrum.
    fn waves(&self, tan: DVec2, dioptres: f64, nm: f64, pitch_um: f64, side: usize) -> Option<Array2<f64>> {
        let lens = self.lens.at(self.within_colors(nm)).ok()?;
        let (knots, last) = (self.dioptres.knots(), self.last_field_tan());
        let dioptres = dioptres.clamp(knots[0], knots[knots.len() - 1]);
        let point = ObjectPoint::from_field(&self.reference, tan.clamp_length_max(last), dioptres);
        let window = WaveWindow { pitch_um, rows: side, columns: side, center: WindowCenter::Centroid };
        let psf = wave_psf(&lens, &point, self.settings.film_mm, &window, WaveQuality::default()).ok()?;
        Some(psf.samples)
    }

    fn within_colors(&self, wavelength_nm: f64) -> f64 {
        let nm = &self.settings.wavelengths_nm;
        wavelength_nm.clamp(nm[0], nm[nm.len() - 1])
    }

    /// Returns the signed radius of the circle of confusion, mm: above 0 for objects nearer than the focus.
    ///
    /// It is that of the part of the ray map that is linear in the pupil, scaled so that an even disc of this size
    /// has 95 % of its energy within it. So it goes smoothly through 0, where aberrations keep a spot from vanishing.
    pub fn blur_radius_mm(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> f64 {
        let n = self.geometry_fields.len();
        let at = field_tan.clamp(0.0, self.geometry_fields[n - 1]);
        let above = self.geometry_fields.partition_point(|&f| f < at).clamp(1.min(n - 1), n - 1);
        let below = above.saturating_sub(1);
        let width = self.geometry_fields[above] - self.geometry_fields[below];
        let fraction = if width > 0.0 { (at - self.geometry_fields[below]) / width } else { 0.0 };
        let rms: f64 = self
            .columns(dioptres, wavelength_nm)
            .map(|(column, weight)| {
                let row = &self.summaries[column * n..][..n];
                let (a, b) = (row[below].signed_rms_mm, row[above].signed_rms_mm);
                weight * (a + (b - a) * fraction)
            })
            .sum();
        // r² = 0.95 R² and the mean square is R²/2.
        rms * 1.9f64.sqrt()
    }

    /// Returns the columns of samples (one field innermost) that a depth and wavelength draw on, with weights.
    fn columns(&self, dioptres: f64, wavelength_nm: f64) -> impl Iterator<Item = (usize, f64)> {
        let n_depths = self.dioptres.knots().len();
        let depths = self.dioptres.stencil(dioptres);
        let colors = self.color_stencil(wavelength_nm);
        let pairs: Vec<(usize, f64)> = colors
            .iter()
            .flat_map(|(c, wc)| depths.iter().map(move |(d, wd)| (c * n_depths + d, wc * wd)).collect::<Vec<_>>())
            .collect();
        pairs.into_iter()
    }

    fn record(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> Record {
        let n = self.fields.knots().len();
        let fields = self.fields.stencil(field_tan);
        let weighted = self.columns(dioptres, wavelength_nm).flat_map(|(column, weight)| {
            fields.iter().map(|(f, w)| (&self.records[column * n + f], w * weight)).collect::<Vec<_>>()
        });
        Record::mix(weighted).expect("every stencil has a knot")
    }

    fn color_stencil(&self, wavelength_nm: f64) -> Stencil {
        self.colors.stencil(self.dispersion.coordinate(self.within_colors(wavelength_nm)))
    }

    fn stop_index(&self, wavelength_nm: f64) -> f64 {
        self.color_stencil(wavelength_nm).iter().map(|(i, weight)| weight * self.stop_indices[i]).sum()
    }
}

/// Returns the fields with others evenly between them.
fn geometry_fields(field_tans: &[f64]) -> Vec<f64> {
    let mut fields = vec![field_tans[0]];
    for pair in field_tans.windows(2) {
        let step = (pair[1] - pair[0]) / GEOMETRY_STEPS as f64;
        fields.extend((1..GEOMETRY_STEPS).map(|i| pair[0] + step * i as f64));
        fields.push(pair[1]);
    }
    fields
}
