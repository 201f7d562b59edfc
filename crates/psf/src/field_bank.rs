//! Ray maps of any lens, over a field of two dimensions.

use dioptric_diffraction::{Edge, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::{Lens, MonoLens, ObjectPoint};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BankSettings, Diffraction, Interpolation, Kernel, ModelUse, PsfError, PsfQuery,
    axis::Axis,
    bend::Bending,
    dispersion::Dispersion,
    drawing::composed,
    mesh::Mesh,
    pupil::Pupil,
    ray_map::{Record, Summary, Task},
    render::{self, Layout},
};

/// What a bank over a field of two dimensions covers, and how finely.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldBankSettings {
    /// Distance of the film behind the last vertex, mm.
    pub film_mm: f64,
    /// The wavelength whose paraxial entrance pupil fields and depths count from, nm.
    pub reference_wavelength_nm: f64,
    /// Tangents of fields to the right of the picture, ascending, of either sign.
    pub tans_x: Vec<f64>,
    /// Tangents of fields upwards, ascending, of either sign.
    pub tans_y: Vec<f64>,
    /// Depths in dioptres (1/Z, Z in metres from the entrance pupil, 0 is infinitely far), ascending.
    pub dioptres: Vec<f64>,
    /// Wavelengths, nm, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// Rings of the mesh in the pupil.
    pub n_rings: usize,
    /// Nodes on a ring, at least 8.
    pub n_azimuths: usize,
    /// How diffraction is taken into account.
    pub diffraction: Diffraction,
}

/// Ray maps of a lens over a grid of fields to the right and upwards, depths and wavelengths.
///
/// It asks nothing of the lens: surfaces may be tilted, biconic or toroidal. Of a rotationally symmetric one a
/// [`PsfBank`](crate::PsfBank) is the same with far fewer samples. Rays are interpolated, quadratic along each axis;
/// waves are traced where they are asked for.
#[derive(Clone, Debug)]
pub struct FieldBank {
    // Invariant: `samples` are indexed by (wavelength, depth, y, x), x innermost.
    settings: FieldBankSettings,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    dioptres: Axis,
    /// Wavelengths in reverse, by the measure of the lens's dispersion.
    colors: Axis,
    dispersion: Dispersion,
    pub(crate) samples: Vec<Option<Sample>>,
    lens: Lens,
    reference: MonoLens,
    /// Index around the stop at each of the colours.
    stop_indices: Vec<f64>,
}

/// The ray map of a point that is seen.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub(crate) record: Record,
    pub(crate) summary: Summary,
}

impl FieldBankSettings {
    /// Fields across and up in a bank that covers a rectangle of them: cubics through the centroids of this many leave
    /// errors of some tenths of a micrometre.
    const N_FIELDS: usize = 11;

    /// Returns the settings that cover fields from one pair of tangents to another, even in angle, and all else as
    /// [`BankSettings::covering`] does.
    pub fn covering(
        film_mm: f64,
        (first_tan, last_tan): (DVec2, DVec2),
        dioptres: (f64, f64),
        wavelengths_nm: (f64, f64),
        diffraction: Diffraction,
    ) -> Self {
        let turned = BankSettings::covering(film_mm, 0.0, dioptres, wavelengths_nm, diffraction);
        let tans = |first: f64, last: f64| -> Vec<f64> {
            let (low, high, n) = (first.atan(), last.atan(), Self::N_FIELDS);
            let mut tans: Vec<f64> = (0..n).map(|i| (low + (high - low) * i as f64 / (n - 1) as f64).tan()).collect();
            // The ends to the bit.
            (tans[0], tans[n - 1]) = (first, last);
            tans
        };
        Self {
            film_mm,
            reference_wavelength_nm: turned.reference_wavelength_nm,
            tans_x: tans(first_tan.x, last_tan.x),
            tans_y: tans(first_tan.y, last_tan.y),
            dioptres: turned.dioptres,
            wavelengths_nm: turned.wavelengths_nm,
            n_rings: turned.n_rings,
            n_azimuths: turned.n_azimuths,
            diffraction,
        }
    }

    fn check(&self) -> Result<(), PsfError> {
        for (axis, found) in [("tans_x", &self.tans_x), ("tans_y", &self.tans_y)] {
            if Axis::new(found.clone()).is_none() {
                let expected = "finite tangents";
                return Err(PsfError::Axis { axis, expected, found: found.clone() });
            }
        }
        // The rest is that of any bank.
        BankSettings {
            film_mm: self.film_mm,
            reference_wavelength_nm: self.reference_wavelength_nm,
            field_tans: vec![0.0],
            dioptres: self.dioptres.clone(),
            wavelengths_nm: self.wavelengths_nm.clone(),
            n_rings: self.n_rings,
            n_azimuths: self.n_azimuths,
            diffraction: self.diffraction,
            interpolation: Interpolation::Rays,
        }
        .check()
    }
}

impl FieldBank {
    /// Traces a bank on all threads. Points that no light of reaches the film are dark.
    ///
    /// # Errors
    /// When the settings make no sense, or the lens has no index at a wavelength.
    pub fn build(lens: &Lens, settings: &FieldBankSettings) -> Result<Self, PsfError> {
        settings.check()?;
        let reference = lens.at(settings.reference_wavelength_nm)?;
        let nm: Vec<f64> = settings.wavelengths_nm.iter().rev().copied().collect();
        let lenses: Vec<MonoLens> = nm.iter().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
        let mesh = Mesh { n_rings: settings.n_rings, n_azimuths: settings.n_azimuths };
        let mut tasks = Vec::new();
        for lens in &lenses {
            for &dioptres in &settings.dioptres {
                for &tan_y in &settings.tans_y {
                    tasks.extend(settings.tans_x.iter().map(|&tan_x| Task {
                        lens,
                        reference: &reference,
                        field_tan: DVec2::new(tan_x, tan_y),
                        dioptres,
                        film_mm: settings.film_mm,
                        mesh,
                    }));
                }
            }
        }
        let has_stop = settings.diffraction != Diffraction::None;
        let sample = |task: &Task<'_>| {
            let pupil = Pupil::find(task.lens, &task.point(), mesh.n_azimuths)?;
            let pupil = pupil.near(task.lens, &task.point())?;
            let traced = task.trace(&pupil, has_stop)?;
            Some(Sample { record: traced.record(mesh, has_stop), summary: traced.summary })
        };
        let samples = tasks.par_iter().map(sample).collect();
        let dispersion = Dispersion::of(lens, &settings.wavelengths_nm);
        let axis = |knots: Vec<f64>| Axis::new(knots).expect("the settings were checked");
        Ok(Self {
            x: axis(settings.tans_x.clone()),
            y: axis(settings.tans_y.clone()),
            dioptres: axis(settings.dioptres.clone()),
            colors: axis(nm.iter().map(|&nm| dispersion.coordinate(nm)).collect()),
            dispersion,
            samples,
            lens: lens.clone(),
            stop_indices: lenses.iter().map(MonoLens::stop_medium_index).collect(),
            reference,
            settings: settings.clone(),
        })
    }

    /// What the bank was asked to cover.
    pub fn settings(&self) -> &FieldBankSettings {
        &self.settings
    }

    /// Returns the bank without diffraction: of rays alone.
    pub(crate) fn geometric(&self) -> Self {
        let settings = FieldBankSettings { diffraction: Diffraction::None, ..self.settings.clone() };
        Self { settings, ..self.clone() }
    }

    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Returns where the centroid of a point lands, mm, picture frame; `None` where samples about it are dark.
    pub fn centroid_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<DVec2> {
        let weighted = self.stencil(field_tan, dioptres, wavelength_nm);
        weighted.into_iter().map(|(i, weight)| Some(self.samples[i].as_ref()?.summary.centroid_mm * weight)).sum()
    }

    /// Returns how far from the centroid the farthest ray of a point lands, mm; `None` where samples about it are dark.
    pub fn reach_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<f64> {
        let record = self.record(field_tan, dioptres, wavelength_nm)?;
        Some((0..record.mesh.n_nodes()).map(|i| record.node(i).at_mm.length()).fold(0.0, f64::max))
    }

    /// Returns the point spread function of a point about its centroid, with the model that drew it, as
    /// [`PsfBank::kernel_and_model`](crate::PsfBank::kernel_and_model); `None` where samples about it are dark.
    pub fn kernel_and_model(&self, query: PsfQuery) -> Option<(Kernel, ModelUse)> {
        Some(self.kernel_of(&self.record(query.field_tan, query.dioptres, query.wavelength_nm)?, query))
    }

    /// Draws the kernel of a point's ray map.
    pub(crate) fn kernel_of(&self, record: &Record, query: PsfQuery) -> (Kernel, ModelUse) {
        let (energies, model) = self.draw(record, query, None);
        (render::kernel(&energies, self.settings.diffraction != Diffraction::None, query.pitch_um), model)
    }

    /// Returns the energy on each pixel of a window of `size` × `size` about the centroid, with the model that drew it,
    /// as [`PsfBank::picture`](crate::PsfBank::picture); `None` where samples about it are dark.
    pub fn picture(&self, query: PsfQuery, size: usize) -> Option<(Array2<f64>, ModelUse)> {
        Some(self.draw(&self.record(query.field_tan, query.dioptres, query.wavelength_nm)?, query, Some(size)))
    }

    fn draw(&self, record: &Record, query: PsfQuery, side: Option<usize>) -> (Array2<f64>, ModelUse) {
        let PsfQuery { field_tan, dioptres, pitch_um, .. } = query;
        let wavelength_nm = self.within_colors(query.wavelength_nm);
        let bending = self.settings.diffraction.model().map(|model| {
            let colors = self.colors.stencil(self.dispersion.coordinate(wavelength_nm));
            let index = colors.iter().map(|(i, weight)| weight * self.stop_indices[i]).sum();
            Bending { model, edge: Edge::new(self.reference.stop_semi_aperture_mm(), wavelength_nm, index) }
        });
        // Nothing is turned: every field has its own samples.
        let layout = Layout::new(record, DVec2::X, bending, pitch_um).with_side(side);
        let waves = |side: usize| {
            let lens = self.lens.at(wavelength_nm)?;
            let within = |list: &[f64], at: f64| at.clamp(list[0], list[list.len() - 1]);
            let field_tan = DVec2::new(within(self.x.knots(), field_tan.x), within(self.y.knots(), field_tan.y));
            let dioptres = within(self.dioptres.knots(), dioptres);
            let point = ObjectPoint::from_field(&self.reference, field_tan, dioptres);
            let window = WaveWindow { pitch_um, rows: side, columns: side, center: WindowCenter::Centroid };
            Ok(wave_psf(&lens, &point, self.settings.film_mm, &window, WaveQuality::default())?.samples)
        };
        composed(layout, self.settings.diffraction, waves)
    }

    fn record(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<Record> {
        let weighted = self.stencil(field_tan, dioptres, wavelength_nm);
        let records = weighted.into_iter().map(|(i, weight)| Some((&self.samples[i].as_ref()?.record, weight)));
        Record::mix(records.collect::<Option<Vec<_>>>()?.into_iter())
    }

    /// Returns the samples that a point draws on, with their weights.
    pub(crate) fn stencil(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Vec<(usize, f64)> {
        let (n_x, n_y) = (self.x.knots().len(), self.y.knots().len());
        let (x, y) = (self.x.stencil(field_tan.x), self.y.stencil(field_tan.y));
        let mut weighted = Vec::with_capacity(81);
        for (plane, weight) in self.planes(dioptres, wavelength_nm) {
            for (j, wy) in y.iter() {
                let row = (plane * n_y + j) * n_x;
                weighted.extend(x.iter().map(|(i, wx)| (row + i, weight * wy * wx)));
            }
        }
        weighted
    }

    /// Returns the planes of fields, one a wavelength and depth, that these draw on, with their weights.
    pub(crate) fn planes(&self, dioptres: f64, wavelength_nm: f64) -> Vec<(usize, f64)> {
        let n_depths = self.dioptres.knots().len();
        let depths = self.dioptres.stencil(dioptres);
        let colors = self.colors.stencil(self.dispersion.coordinate(self.within_colors(wavelength_nm)));
        let planes = |(c, wc): (usize, f64)| depths.iter().map(move |(d, wd)| (c * n_depths + d, wc * wd));
        colors.iter().flat_map(|color| planes(color).collect::<Vec<_>>()).collect()
    }

    fn within_colors(&self, wavelength_nm: f64) -> f64 {
        let nm = &self.settings.wavelengths_nm;
        wavelength_nm.clamp(nm[0], nm[nm.len() - 1])
    }
}
