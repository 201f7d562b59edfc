//! Ray maps of any lens, over a field of two dimensions.

use dioptric_diffraction::{CircularStop, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::{Lens, MonoLens, ObjectPoint};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BankSettings, Diffraction, Kernel, ModelUse, PsfError, PsfQuery,
    axis::Axis,
    dispersion::{Dispersion, share_of_orders},
    drawing::{Drawn, composed, wave_fraction_of},
    hurb_splatter::StopHurb,
    lit_fields::{self, LitFields, Planes},
    mesh::Mesh,
    mirror::MirroredFields,
    ray_map::{RIM_OVER_RMS, RayMap, RayMapJob, Sample},
    render::Layout,
    watch::Watch,
};

/// Ray maps of a lens over a grid of fields to the right and upwards, depths and wavelengths.
///
/// It asks nothing of the lens: surfaces may be tilted, biconic or toroidal. Of a rotationally symmetric one a
/// [`RotationalBank`](crate::rotational::RotationalBank) is the same with far fewer samples. Rays are interpolated,
/// quadratic along each axis; waves are traced where they are asked for.
#[derive(Clone, Debug)]
pub(crate) struct GeneralBank {
    // Invariant: `samples` are indexed by (wavelength, depth, y, x), x innermost.
    settings: BankSettings,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    dioptres: Axis,
    /// Wavelengths in reverse, by the measure of the lens's dispersion.
    colors: Axis,
    dispersion: Dispersion,
    pub(crate) samples: Vec<Option<Sample>>,
    /// Where light ends within the fields, for each wavelength and depth; `None` where it does not.
    pub(crate) lit_fields: Option<Vec<LitFields>>,
    lens: Lens,
    reference: MonoLens,
    /// Index around the stop at each of the colors.
    stop_indices: Vec<f64>,
}

impl GeneralBank {
    /// Traces the samples on all threads. Points that no light of reaches the film are dark.
    pub(crate) fn build(
        lens: &Lens,
        settings: &BankSettings,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Self, PsfError> {
        settings.check()?;
        let (tans_x, tans_y) = settings.fields.axes();
        let reference = lens.at(settings.reference_wavelength_nm)?;
        let nm: Vec<f64> = settings.wavelengths_nm.iter().rev().copied().collect();
        let lenses: Vec<MonoLens> = nm.iter().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
        let mesh = Mesh { n_rings: settings.n_rings, n_azimuths: settings.n_azimuths };
        let fields = MirroredFields::new(lens.mirror_symmetries(), mesh, tans_x, tans_y);
        let planes = planes_of(settings, &lenses, &reference);
        let dispersion = Dispersion::of(lens, &settings.wavelengths_nm);
        let axis = |knots: Vec<f64>| Axis::new(knots).expect("the settings were checked");
        let colors = axis(nm.iter().map(|&nm| dispersion.coordinate(nm)).collect());
        let dioptres = axis(settings.dioptres.clone());
        let followed = Planes { jobs: &planes, colors: &colors, dioptres: &dioptres };
        let lit_fields = lit_fields::within_grid(&followed, &settings.fields, cancel)?;
        let mut tasks = Vec::new();
        for (plane, job) in planes.iter().enumerate() {
            let lit = lit_fields.as_ref().map(|lit| &lit[plane]);
            tasks.extend(fields.traced().map(|field_tan| (RayMapJob { field_tan, ..*job }, lit)));
        }
        let has_stop = settings.diffraction != Diffraction::None;
        let sample = |(task, lit): &(RayMapJob<'_>, Option<&LitFields>)| {
            if lit.is_some_and(|lit| lit.is_dark_at(task.field_tan)) {
                return None;
            }
            let traced = task.trace(&task.pupil()?, has_stop)?;
            Some(Sample { record: traced.record(mesh, has_stop), summary: traced.summary })
        };
        let watch = Watch::new(tasks.len(), progress, cancel);
        let watched = |task: &(RayMapJob<'_>, Option<&LitFields>)| {
            watch.check()?;
            let sample = sample(task);
            watch.done(1);
            Ok(sample)
        };
        let traced: Vec<Option<Sample>> = tasks.par_iter().map(watched).collect::<Result<_, Cancelled>>()?;
        let samples = traced.chunks_exact(fields.traced().count()).flat_map(|plane| fields.spread(plane)).collect();
        Ok(Self {
            x: axis(tans_x.to_vec()),
            y: axis(tans_y.to_vec()),
            dioptres,
            colors,
            dispersion,
            samples,
            lit_fields,
            lens: lens.clone(),
            stop_indices: lenses.iter().map(MonoLens::stop_medium_index).collect(),
            reference,
            settings: settings.clone(),
        })
    }

    /// What the bank was asked to cover.
    pub(crate) fn settings(&self) -> &BankSettings {
        &self.settings
    }

    /// Returns the bank without diffraction: of rays alone.
    pub(crate) fn geometric(&self) -> Self {
        let settings = BankSettings { diffraction: Diffraction::None, ..self.settings.clone() };
        Self { settings, ..self.clone() }
    }

    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Returns how to trace the field along the axis at each wavelength and depth of the samples, in their order, and has `look` see them.
    ///
    /// # Errors
    /// None that building the bank has not met.
    pub(crate) fn with_planes<T>(&self, look: impl FnOnce(&[RayMapJob<'_>]) -> T) -> Result<T, PsfError> {
        let settings = &self.settings;
        let lenses: Vec<MonoLens> =
            settings.wavelengths_nm.iter().rev().map(|&nm| self.lens.at(nm)).collect::<Result<_, _>>()?;
        Ok(look(&planes_of(settings, &lenses, &self.reference)))
    }

    /// Returns where the centroid of a point lands, mm, picture frame; `None` where samples about it are dark.
    pub(crate) fn centroid_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<DVec2> {
        let weighted = self.stencil(field_tan, dioptres, wavelength_nm);
        weighted.into_iter().map(|(i, weight)| Some(self.samples[i].as_ref()?.summary.centroid_mm * weight)).sum()
    }

    /// Returns how far from the centroid the farthest ray of a point lands, mm; `None` where samples about it are dark.
    pub(crate) fn extent_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<f64> {
        let record = self.record(field_tan, dioptres, wavelength_nm)?;
        Some((0..record.mesh.n_nodes()).map(|i| record.node(i).at_mm.length()).fold(0.0, f64::max))
    }

    /// Returns the point spread function of a point about its centroid, with the model that drew it; `None` where samples
    /// about it are dark.
    pub(crate) fn kernel_and_model(&self, query: PsfQuery) -> Option<(Kernel, ModelUse)> {
        Some(self.kernel_of(&self.record(query.field_tan, query.dioptres, query.wavelength_nm)?, query))
    }

    /// Draws the kernel of a point's ray map.
    pub(crate) fn kernel_of(&self, record: &RayMap, query: PsfQuery) -> (Kernel, ModelUse) {
        self.draw(record, query, None).into_kernel(query.pitch_um)
    }

    /// Returns the energy on each pixel of a window of `size` × `size` about the centroid, with the model that drew it;
    /// `None` where samples about it are dark.
    pub(crate) fn picture(&self, query: PsfQuery, size: usize) -> Option<(Array2<f64>, ModelUse)> {
        let record = self.record(query.field_tan, query.dioptres, query.wavelength_nm)?;
        let Drawn { energies, model, .. } = self.draw(&record, query, Some(size));
        Some((energies, model))
    }

    /// Returns how much of a kernel is wave optics; 0 of dark points.
    pub(crate) fn wave_fraction(&self, query: PsfQuery) -> f64 {
        let record = self.record(query.field_tan, query.dioptres, query.wavelength_nm);
        record.map_or(0.0, |record| wave_fraction_of(&self.layout(&record, query, None), self.settings.diffraction))
    }

    pub(crate) fn layout<'a>(&self, record: &'a RayMap, query: PsfQuery, side: Option<usize>) -> Layout<'a> {
        let wavelength_nm = self.within_colors(query.wavelength_nm);
        let bending = self.settings.diffraction.hurb().map(|model| {
            let colors = self.colors.stencil(self.dispersion.coordinate(wavelength_nm));
            let index = colors.iter().map(|(i, weight)| weight * self.stop_indices[i]).sum();
            StopHurb { model, edge: CircularStop::new(self.reference.stop_semi_aperture_mm(), wavelength_nm, index) }
        });
        // Nothing is turned: every field has its own samples.
        Layout::new(record, DVec2::X, bending, query.pitch_um).with_side(side)
    }

    fn draw(&self, record: &RayMap, query: PsfQuery, side: Option<usize>) -> Drawn {
        let PsfQuery { field_tan, dioptres, pitch_um, .. } = query;
        let wavelength_nm = self.within_colors(query.wavelength_nm);
        let layout = self.layout(record, query, side);
        let waves = |side: usize| {
            let lens = self.lens.at(wavelength_nm)?;
            let within = |list: &[f64], at: f64| at.clamp(list[0], list[list.len() - 1]);
            let field_tan = DVec2::new(within(self.x.knots(), field_tan.x), within(self.y.knots(), field_tan.y));
            let dioptres = within(self.dioptres.knots(), dioptres);
            let point = ObjectPoint::from_field(&self.reference, field_tan, dioptres);
            let window = WaveWindow { pitch_um, rows: side, columns: side, center: WindowCenter::Centroid };
            Ok(wave_psf(&lens, &point, self.settings.film_distance_mm, &window, WaveQuality::default())?.samples)
        };
        composed(layout, self.settings.diffraction, waves)
    }

    fn record(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<RayMap> {
        let weighted = self.stencil(field_tan, dioptres, wavelength_nm);
        let records = weighted.into_iter().map(|(i, weight)| Some((&self.samples[i].as_ref()?.record, weight)));
        RayMap::mix(records.collect::<Option<Vec<_>>>()?.into_iter())
    }

    /// Returns the signed radius of the circle of confusion, mm.
    ///
    /// `nearest_lit` says for each sample which one stands for it if it is dark; without, dark ones count as nothing.
    pub(crate) fn blur_radius_mm(
        &self,
        nearest_lit: Option<&[usize]>,
        field_tan: DVec2,
        dioptres: f64,
        wavelength_nm: f64,
    ) -> f64 {
        let samples = self.lit_samples(nearest_lit, field_tan, dioptres, wavelength_nm);
        RIM_OVER_RMS * samples.map(|(sample, weight)| weight * sample.summary.signed_rms_mm).sum::<f64>()
    }

    /// Returns the radius of what astigmatism and other aberrations leave of a point even in focus, mm, with its blur: that
    /// of an even disc of the rms radius of the rays, to 95 % of its energy.
    pub(crate) fn spread_mm(
        &self,
        nearest_lit: Option<&[usize]>,
        field_tan: DVec2,
        dioptres: f64,
        wavelength_nm: f64,
    ) -> f64 {
        let samples = self.lit_samples(nearest_lit, field_tan, dioptres, wavelength_nm);
        let record = RayMap::mix(samples.map(|(sample, weight)| (&sample.record, weight)));
        RIM_OVER_RMS * record.map_or(0.0, |record| record.rms_mm())
    }

    /// Returns the samples that a point draws on, with their weights; dark ones replaced by those that stand for them.
    pub(crate) fn lit_samples<'a>(
        &'a self,
        nearest_lit: Option<&'a [usize]>,
        field_tan: DVec2,
        dioptres: f64,
        wavelength_nm: f64,
    ) -> impl Iterator<Item = (&'a Sample, f64)> {
        let weighted = self.stencil(field_tan, dioptres, wavelength_nm);
        let lit = move |i: usize| nearest_lit.map_or(i, |nearest| nearest[i]);
        weighted.into_iter().filter_map(move |(i, weight)| Some((self.samples[lit(i)].as_ref()?, weight)))
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

    /// Returns the share of light that diffraction orders have at a wavelength.
    pub(crate) fn share_of_orders(&self, wavelength_nm: f64) -> f64 {
        share_of_orders(&self.lens, self.within_colors(wavelength_nm))
    }

    fn within_colors(&self, wavelength_nm: f64) -> f64 {
        let nm = &self.settings.wavelengths_nm;
        wavelength_nm.clamp(nm[0], nm[nm.len() - 1])
    }
}

/// Returns how to trace the field along the axis at each wavelength and depth, in the order of samples.
fn planes_of<'a>(settings: &BankSettings, lenses: &'a [MonoLens], reference: &'a MonoLens) -> Vec<RayMapJob<'a>> {
    let mesh = Mesh { n_rings: settings.n_rings, n_azimuths: settings.n_azimuths };
    let (field_tan, film_distance_mm) = (DVec2::ZERO, settings.film_distance_mm);
    let job = |lens, dioptres| RayMapJob { lens, reference, field_tan, dioptres, film_distance_mm, mesh };
    lenses.iter().flat_map(|lens| settings.dioptres.iter().map(move |&dioptres| job(lens, dioptres))).collect()
}
