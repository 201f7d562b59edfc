//! A scene imaged through the parts of a pupil, one after the other, or through all of it at once.

use std::sync::Arc;

use dioptric_psf::{FilmMap, FilmQuery, Kernel, LensImage, PsfError, PupilEdges};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BandRadiance, BlurMode, ForwardError, ImagingSpec, SceneGeometry, SceneRadiance, Sink,
    imaging::{Imaging, USUAL_BYTES},
    scene_layers::SceneLayers,
    work::{Progress, Watch, Work},
};

/// What is imaged through the parts of a pupil; through the whole there are no parts.
pub(crate) struct Views {
    parts: Vec<Arc<dyn LensImage + Send>>,
    /// One of each part, or of the whole.
    imagings: Vec<Imaging>,
}

impl Views {
    /// Plans a scene for the parts of a pupil that a mode of blur asks for.
    pub(crate) fn of(
        lens: &dyn LensImage,
        scene: &SceneGeometry<'_>,
        spec: &ImagingSpec,
        (progress, range): (&Progress<'_>, (f64, f64)),
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        let layers = SceneLayers::over(lens, scene, spec, cancel)?;
        let parts = match spec.settings.mode {
            // A scene of one depth looks the same from everywhere.
            BlurMode::Views(n) if layers.layers.len() > 1 => lens.through_parts(n)?,
            _ => vec![],
        };
        let work = Work::new(cancel, progress, range, (layers.layers.len() * parts.len().max(1)) as u64);
        let imaging = |lens: &dyn LensImage| Imaging::new(lens, scene, layers.clone(), spec.clone(), &work);
        if parts.is_empty() {
            return Ok(Self { imagings: vec![imaging(lens)?], parts });
        }
        let of_part = |part: &Arc<dyn LensImage + Send>| {
            let mut imaging = imaging(part.as_ref())?;
            // Together they keep no more than one would.
            imaging.keep_at_most(USUAL_BYTES / parts.len());
            Ok(imaging)
        };
        let imagings = parts.iter().map(of_part).collect::<Result<_, ForwardError>>()?;
        Ok(Self { imagings, parts })
    }

    /// The first: what it holds of scene, film and bands is that of all.
    pub(crate) fn first(&self) -> &Imaging {
        &self.imagings[0]
    }

    /// One of each part of the pupil, or of the whole.
    pub(crate) fn imagings(&self) -> &[Imaging] {
        &self.imagings
    }

    pub(crate) fn imagings_mut(&mut self) -> &mut [Imaging] {
        &mut self.imagings
    }

    /// All of them, each with the lens or part of its pupil.
    pub(crate) fn iter<'a>(
        &'a self,
        whole: &'a dyn LensImage,
    ) -> impl Iterator<Item = (&'a dyn LensImage, &'a Imaging)> {
        let lens = move |i: usize| -> &'a dyn LensImage { self.parts.get(i).map_or(whole, |part| part.as_ref()) };
        self.imagings.iter().enumerate().map(move |(i, imaging)| (lens(i), imaging))
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.first().scene.size_bytes() + self.imagings.iter().map(Imaging::size_bytes).sum::<usize>()
    }

    /// Returns the irradiance of a band: the sum of all views.
    pub(crate) fn image(
        &self,
        whole: &dyn LensImage,
        band: usize,
        radiance: BandRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, Cancelled> {
        let pictures = self.iter(whole).map(|(lens, imaging)| imaging.image(lens, band, radiance, work));
        let sum = pictures.reduce(|sum, picture| Ok(sum? + picture?));
        sum.expect("there is at least one view")
    }

    /// Images the bands from `first` on, some at once, and hands them on in their order.
    pub(crate) fn stream_from(
        &self,
        first: usize,
        whole: &dyn LensImage,
        radiance: &SceneRadiance<'_>,
        watch: &Watch<'_>,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        let n_units = self.imagings.iter().map(|imaging| imaging.stream_units(first)).sum();
        let work = Work::new(watch.cancel, watch.progress, watch.range, n_units);
        let bands: Vec<usize> = (first..self.first().spec.grid.len()).collect();
        for group in bands.chunks(self.first().bands_at_once()) {
            let mut sums: Vec<Option<Array2<f32>>> = vec![None; group.len()];
            for (lens, imaging) in self.iter(whole) {
                let image = |&band: &usize| imaging.image_of(lens, band, radiance, &work);
                let pictures: Vec<Array2<f32>> = group.par_iter().map(image).collect::<Result<_, ForwardError>>()?;
                for (sum, picture) in sums.iter_mut().zip(pictures) {
                    *sum = Some(match sum.take() {
                        Some(sum) => sum + picture,
                        None => picture,
                    });
                }
            }
            for (&band, sum) in group.iter().zip(sums) {
                work.check()?;
                let picture = sum.expect("there is at least one view");
                sink(band, picture).map_err(|reason| ForwardError::Sink { band, reason })?;
            }
        }
        (watch.progress)(watch.range.1);
        Ok(())
    }
}

/// A lens whose film points are counted from another point of the film than its middle.
pub(crate) struct Framed<L> {
    pub(crate) lens: L,
    /// That point, mm from where they were counted from.
    pub(crate) center_mm: DVec2,
}

impl<L> LensImage for Framed<L>
where
    L: std::ops::Deref<Target: LensImage> + Sync,
{
    /// About the middle of the film nothing is.
    fn is_symmetric(&self) -> bool {
        false
    }

    fn known_wavelengths_nm(&self) -> &[f64] {
        self.lens.known_wavelengths_nm()
    }

    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap> {
        let map = self.lens.film_map(wavelength_nm, reach_mm + self.center_mm.length());
        Arc::new(FilmMap::clone(&map).counted_from(self.center_mm))
    }

    fn kernel(&self, query: FilmQuery) -> Kernel {
        self.lens.kernel(FilmQuery { place_mm: query.place_mm + self.center_mm, ..query })
    }

    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.lens.blur_radius_mm(place_mm + self.center_mm, dioptres, wavelength_nm)
    }

    fn spread_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.lens.spread_mm(place_mm + self.center_mm, dioptres, wavelength_nm)
    }

    fn pupil_edges(&self) -> Option<PupilEdges> {
        self.lens.pupil_edges()
    }

    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        let framed = |lens| Arc::new(Framed { lens, center_mm: self.center_mm }) as Arc<dyn LensImage + Send>;
        Ok(self.lens.through_parts(n_parts)?.into_iter().map(framed).collect())
    }
}
