//! A scene imaged through the parts of a pupil, one after the other, or through all of it at once.

use std::sync::Arc;

use dioptric_psf::LensImage;
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BandRadiance, BlurMode, ForwardError, ImagingSpec, SceneGeometry, SceneRadiance, Sink,
    layout::{KEPT_BUDGET_BYTES, Layout, SceneLayers},
    stream::HandOn,
    work::{Progress, Watch, Work},
};

/// The layouts of a scene, and the parts of the pupil that they are for; none for the whole pupil.
pub(crate) struct Views {
    parts: Vec<Arc<dyn LensImage + Send>>,
    /// One of each part, or of the whole.
    layouts: Vec<Layout>,
}

impl Views {
    /// Lays out a scene for the parts of a pupil that a mode of blur asks for.
    pub(crate) fn of(
        lens: &dyn LensImage,
        scene: &SceneGeometry<'_>,
        spec: &ImagingSpec,
        (progress, range): (&Progress<'_>, (f64, f64)),
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        let layers = Arc::new(SceneLayers::over(lens, scene, spec, cancel)?);
        let parts = match spec.settings.mode {
            // A scene of one depth looks the same from everywhere.
            BlurMode::Views(n) if layers.layers.len() > 1 => lens.through_parts(n)?,
            _ => vec![],
        };
        let layout = |lens: &dyn LensImage, range: (f64, f64)| {
            Layout::new(lens, scene.view, layers.clone(), spec.clone(), (progress, range), cancel)
        };
        if parts.is_empty() {
            return Ok(Self { layouts: vec![layout(lens, range)?], parts });
        }
        let step = (range.1 - range.0) / parts.len() as f64;
        let part_range = |i: usize| (range.0 + step * i as f64, range.0 + step * (i + 1) as f64);
        let of_part = |(i, part): (usize, &Arc<dyn LensImage + Send>)| {
            let mut layout = layout(part.as_ref(), part_range(i))?;
            // Together they keep no more than one would.
            layout.keep_at_most(KEPT_BUDGET_BYTES / parts.len());
            Ok(layout)
        };
        let layouts = parts.iter().enumerate().map(of_part).collect::<Result<_, ForwardError>>()?;
        Ok(Self { layouts, parts })
    }

    /// The first layout: what it holds of scene, film and bands is that of all.
    pub(crate) fn first(&self) -> &Layout {
        &self.layouts[0]
    }

    pub(crate) fn layouts_mut(&mut self) -> &mut [Layout] {
        &mut self.layouts
    }

    /// The layouts, each with the lens or part of its pupil.
    pub(crate) fn iter<'a>(
        &'a self,
        whole: &'a dyn LensImage,
    ) -> impl Iterator<Item = (&'a dyn LensImage, &'a Layout)> {
        let lens = move |i: usize| -> &'a dyn LensImage { self.parts.get(i).map_or(whole, |part| part.as_ref()) };
        self.layouts.iter().enumerate().map(move |(i, layout)| (lens(i), layout))
    }

    /// What the bases of two bands take, of one layout at a time.
    pub(crate) fn largest_bases_bytes(&self) -> usize {
        self.layouts.iter().map(Layout::bases_bytes).max().unwrap_or(0)
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.first().scene.size_bytes() + self.layouts.iter().map(Layout::size_bytes).sum::<usize>()
    }

    /// Returns the irradiance of a band: the sum of all views.
    pub(crate) fn image(
        &self,
        whole: &dyn LensImage,
        band: usize,
        radiance: BandRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, Cancelled> {
        let mut sum: Option<Array2<f32>> = None;
        for (lens, layout) in self.iter(whole) {
            let basis = layout.basis_between(lens, band, work)?;
            add(&mut sum, layout.image(lens, band, &basis, radiance, work)?);
        }
        Ok(sum.expect("there is at least one view"))
    }

    /// Images the bands from `first` on.
    pub(crate) fn stream_from(
        &self,
        first: usize,
        whole: &dyn LensImage,
        radiance: &SceneRadiance<'_>,
        watch: &Watch<'_>,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        let n_units = self.layouts.iter().map(|layout| layout.stream_units(first, self.layouts.len() > 1)).sum();
        let work = Work::new(watch.cancel, watch.progress, watch.range, n_units);
        let mut hand_on = |band, picture| sink(band, picture).map_err(|reason| ForwardError::Sink { band, reason });
        if self.parts.is_empty() {
            self.layouts[0].stream_from(first, whole, radiance, &work, &mut hand_on)?;
        } else {
            self.stream_sums(first, whole, radiance, &work, &mut hand_on)?;
        }
        (watch.progress)(watch.range.1);
        Ok(())
    }

    /// Images the bands between two bases through one part after the other, so that no more than one part's bases are held.
    fn stream_sums(
        &self,
        first: usize,
        whole: &dyn LensImage,
        radiance: &SceneRadiance<'_>,
        work: &Work<'_>,
        hand_on: &mut HandOn<'_>,
    ) -> Result<(), ForwardError> {
        for (pair, bands) in self.first().bands_between_bases(first) {
            let mut sums: Vec<Option<Array2<f32>>> = vec![None; bands.len()];
            for (lens, layout) in self.iter(whole) {
                let lower = layout.basis(lens, pair[0], work)?;
                let upper = if pair[1] == pair[0] { lower.clone() } else { layout.basis(lens, pair[1], work)? };
                let at_once = layout.bands_at_once([&lower, &upper]);
                for (group, sums) in bands.chunks(at_once).zip(sums.chunks_mut(at_once)) {
                    let pictures: Vec<Result<Array2<f32>, ForwardError>> = group
                        .par_iter()
                        .map(|&band| {
                            let basis = layout.between(lens, (band, pair), [&lower, &upper], work)?;
                            layout.image_of(lens, band, &basis, radiance, work)
                        })
                        .collect();
                    for (sum, picture) in sums.iter_mut().zip(pictures) {
                        add(sum, picture?);
                    }
                }
                layout.drop_maps();
            }
            for (band, sum) in bands.into_iter().zip(sums) {
                hand_on(band, sum.expect("there is at least one view"))?;
            }
        }
        Ok(())
    }
}

fn add(sum: &mut Option<Array2<f32>>, picture: Array2<f32>) {
    match sum {
        Some(sum) => *sum += &picture,
        None => *sum = Some(picture),
    }
}
