//! All of imaging that does not depend on the scene's light, made once.

use std::sync::Arc;

use dioptric_psf::LensImage;
use dioptric_spectrum::Cancel;
use ndarray::Array2;

use crate::{
    BandKernels, BandRadiance, ForwardError, ImagingSpec, SceneGeometry, SceneRadiance, Sink,
    imaging::Imaging,
    stopwatch::{Clock, ImagingTimes, Stopwatch},
    views::{Framed, Views},
    work::{Watch, Work},
};

/// The imaging of one scene geometry through one lens on one film: made once, then used for any light and any band.
///
/// It owns all that it needs and shares the lens, so it can be kept beside it and used from several threads. Kernels are computed
/// when a band first needs them and kept up to a number of bytes ([`with_kernel_budget`](Self::with_kernel_budget)).
/// Results are the same to the bit for any number of threads, kernels kept or not.
///
/// ```
/// use std::sync::Arc;
/// use dioptric_forward::{BandRadiance, DiscLens, Film, ImagingPlan, ImagingSpec, SceneGeometry, Settings};
/// use dioptric_scene::View;
/// use dioptric_spectrum::{Cancel, DepthMap, WavelengthGrid};
/// use ndarray::Array2;
///
/// let depth = DepthMap::flat(60, 80, 2.0)?;
/// let view = View { focal_px: 5000.0, center_x_px: 39.5, center_y_px: 29.5 };
/// let spec = ImagingSpec {
///     film: Film::centered(40, 40, 10.0),
///     grid: WavelengthGrid::uniform(500.0, 600.0, 50.0)?,
///     settings: Settings::default(),
/// };
/// let lens = Arc::new(DiscLens { focus_dioptres: 1.0, radius_um_per_dioptre: 100.0, focal_mm: 50.0, ..DiscLens::default() });
/// let cancel = Cancel::new();
/// let scene = SceneGeometry { depth: &depth, view, occluded_depth: None, points: &[] };
/// let plan = ImagingPlan::new(lens, &scene, spec, &|_| {}, &cancel)?;
/// for level in [0.1, 0.2] {
///     let radiance = Array2::from_elem((60, 80), level);
///     let irradiance = plan.image(1, BandRadiance { front: &radiance, occluded: None, points: &[] }, &cancel)?;
///     assert!((irradiance[(20, 20)] - level).abs() < 1e-5);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ImagingPlan {
    lens: Arc<dyn LensImage + Send>,
    pub(crate) views: Views,
}

impl std::fmt::Debug for ImagingPlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Imaging { spec, scene, .. } = self.views.first();
        f.debug_struct("ImagingPlan")
            .field("spec", spec)
            .field("dioptres", &scene.layers.dioptres())
            .finish_non_exhaustive()
    }
}

impl ImagingPlan {
    /// The share of the scene's samples on surfaces that are narrower than the pupil before what lies behind them, along rows or columns.
    ///
    /// Layers know how much of a pixel such a surface covers, not through which part of the pupil: where both it and what is behind it are out of
    /// focus, [`BlurMode::Views`](crate::BlurMode::Views) tells them apart.
    pub fn narrow_fraction(&self) -> f64 {
        self.views.first().scene.narrow_fraction
    }

    /// The part of the film from which some rays pass behind all surfaces that are known or guessed: the first one and what a second layer holds.
    ///
    /// What they would see there is not imaged: the light of such a pixel is that of its other rays.
    pub fn unknown_fraction(&self) -> f64 {
        let (sum, n) =
            self.views.imagings().iter().fold((0.0, 0.0), |(sum, n), part| (sum + part.unknown_fraction(), n + 1.0));
        sum / n
    }

    /// How many of the points beside the scene lie behind its first surface, and how many where no point of the film looks.
    pub fn points_unseen(&self) -> (usize, usize) {
        self.views.first().points_unseen()
    }

    /// Plans the imaging of a scene geometry: layers of depth, what their edges hide, and where PSFs are needed.
    ///
    /// `progress` receives the fraction that is done, from 0 to 1.
    ///
    /// # Errors
    /// When the parts of the scene do not fit each other, when the lens is not known for the wavelengths or depths or
    /// for the corner of the film, or when the work is cancelled.
    pub fn new(
        lens: Arc<dyn LensImage + Send>,
        scene: &SceneGeometry<'_>,
        spec: ImagingSpec,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        progress(0.0);
        let lens: Arc<dyn LensImage + Send> = match spec.film.is_centered() {
            true => lens,
            false => Arc::new(Framed { lens, center_mm: spec.film.center_mm }),
        };
        let views = Views::of(lens.as_ref(), scene, &spec, (progress, (0.0, 1.0)), cancel)?;
        progress(1.0);
        Ok(Self { lens, views })
    }

    /// Returns the plan that keeps at most this many bytes of kernels; others are computed anew for each band.
    #[must_use]
    pub fn with_kernel_budget(mut self, bytes: usize) -> Self {
        let imagings = self.views.imagings_mut();
        let budget_bytes = bytes / imagings.len();
        imagings.iter_mut().for_each(|imaging| imaging.keep_at_most(budget_bytes));
        self
    }

    /// Returns the plan whose bands in flight take at most this many bytes together; one band is always worked on.
    #[must_use]
    pub fn with_band_budget(mut self, bytes: usize) -> Self {
        self.views.imagings_mut().iter_mut().for_each(|imaging| imaging.in_flight_bytes = Some(bytes));
        self
    }

    /// Returns the bytes of memory that a band takes while it is imaged.
    pub fn band_bytes(&self) -> usize {
        self.views.first().band_bytes()
    }

    /// Returns the plan that adds up, by a clock, the time that its parts take; see [`times`](Self::times).
    #[must_use]
    pub fn with_clock(mut self, clock: Arc<Clock>) -> Self {
        let stopwatch = Stopwatch::of(clock);
        self.views.imagings_mut().iter_mut().for_each(|imaging| imaging.stopwatch = stopwatch.clone());
        self
    }

    /// Returns where the time of imaging went since the plan got a clock, summed over threads; nothing without one.
    pub fn times(&self) -> ImagingTimes {
        self.views.first().stopwatch.times()
    }

    /// What the plan was made for.
    pub fn spec(&self) -> &ImagingSpec {
        &self.views.first().spec
    }

    /// Returns the bytes of memory that the plan takes now, kept kernels included, the lens left out.
    pub fn size_bytes(&self) -> usize {
        self.views.size_bytes()
    }

    /// Returns the kernels of a band, computed where they are not kept: of each part of the pupil, or of the whole alone.
    ///
    /// # Errors
    /// When there is no such band, or the work is cancelled.
    pub fn kernels(&self, band: usize, cancel: &Cancel) -> Result<Vec<BandKernels>, ForwardError> {
        self.views.first().check_band(band)?;
        let of = |(lens, imaging): (&dyn LensImage, &Imaging)| imaging.kernels(lens, band, &Work::unobserved(cancel));
        Ok(self.views.iter(self.lens.as_ref()).map(of).collect::<Result<_, _>>()?)
    }

    /// Returns the irradiance on the film in one band, W m⁻² nm⁻¹, rows × columns.
    ///
    /// # Errors
    /// When there is no such band, when the radiance is not that of the planned samples, or when the work is cancelled.
    pub fn image(&self, band: usize, radiance: BandRadiance<'_>, cancel: &Cancel) -> Result<Array2<f32>, ForwardError> {
        let first = self.views.first();
        first.check_band(band)?;
        radiance.check(first.size(), first.scene.occluded.needs_radiance())?;
        Ok(self.views.image(self.lens.as_ref(), band, radiance, &Work::unobserved(cancel))?)
    }

    /// Images all bands: hands the irradiance on the film, W m⁻² nm⁻¹, to `sink` band by band.
    ///
    /// `progress` receives the fraction that is done, from 0 to 1. A few bands are worked on at once.
    ///
    /// # Errors
    /// When the radiance is not that of the planned samples and bands, when a band cannot be read or handed on, or when the
    /// work is cancelled.
    pub fn stream(
        &self,
        radiance: &SceneRadiance<'_>,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        self.stream_from(0, radiance, progress, cancel, sink)
    }

    /// Images the bands from `first` on as [`stream`](Self::stream) does, to the same bits: what is left of work that was
    /// interrupted.
    ///
    /// # Errors
    /// As [`stream`](Self::stream).
    pub fn stream_from(
        &self,
        first: usize,
        radiance: &SceneRadiance<'_>,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        let imaging = self.views.first();
        radiance.check(imaging.size(), &imaging.spec.grid)?;
        progress(0.0);
        let watch = Watch { progress, range: (0.0, 1.0), cancel };
        self.views.stream_from(first, self.lens.as_ref(), radiance, &watch, sink)
    }
}
