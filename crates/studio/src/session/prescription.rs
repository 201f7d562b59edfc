//! The lens of a camera as numbers that can be changed one by one.

use dioptric_optics::{Lens, Shape, SurfaceChange};
use dioptric_pipeline::{LensReadOptions, LensSpec, PipelineError};

/// Places across two neighboring surfaces where they are held apart.
const PLACES: usize = 33;
/// The wavelength that a changed lens must have an index at, nm.
const WAVELENGTH_NM: f64 = dioptric_pipeline::REFERENCE_WAVELENGTH_NM;

/// The prescription of a camera's lens, before its stop is set and it is moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Prescription {
    choice: LensSpec,
    lens: Lens,
}

impl Prescription {
    /// Opens the lens of a camera.
    ///
    /// # Errors
    /// As [`LensSpec::open`].
    pub fn open(choice: &LensSpec, reading: &LensReadOptions) -> Result<Self, PipelineError> {
        Ok(Self { choice: choice.clone(), lens: choice.open(reading)?.lens })
    }

    /// The lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The number of surfaces.
    pub fn n_surfaces(&self) -> usize {
        self.lens.interfaces().len()
    }

    /// The curvature of a surface, 1/mm; none of an ideal lens.
    pub fn curvature_per_mm(&self, surface: usize) -> Option<f64> {
        let surface = &self.lens.interfaces().get(surface)?.surface;
        (!matches!(surface.shape, Shape::ThinLens { .. })).then_some(surface.curvature_per_mm)
    }

    /// The steepest curvature whose sphere still has the surface's rim, 1/mm.
    pub fn steepest_per_mm(&self, surface: usize) -> f64 {
        self.lens.interfaces().get(surface).map_or(1.0, |at| 0.999 / at.surface.semi_aperture_mm)
    }

    /// The distance behind a surface to the next, mm; none behind the last.
    pub fn spacing_mm(&self, surface: usize) -> Option<f64> {
        let interface = self.lens.interfaces().get(surface)?;
        (surface + 1 < self.n_surfaces()).then_some(interface.thickness_after_mm)
    }

    /// Returns the choice of a lens with another number; `None` where a rim would no longer fit on its surface, or two surfaces would cross
    /// that do not now.
    pub fn changed(&self, change: SurfaceChange) -> Option<LensSpec> {
        let lens = self.lens.with_surface_changes(&[change]).ok()?;
        lens.at(WAVELENGTH_NM).ok()?;
        let behind = [change.surface.checked_sub(1), Some(change.surface)].into_iter().flatten();
        // Distances between mirrors have either sign.
        let is_apart = |before: usize| {
            let (old, new) = (clearance_mm(&self.lens, before), clearance_mm(&lens, before));
            !self.lens.mirrors().is_empty() || new >= old.min(0.0)
        };
        let mut gaps = behind.filter(|before| before + 1 < self.n_surfaces());
        gaps.all(is_apart).then(|| self.choice.with_changes(merged(self.choice.changes(), change)))
    }
}

/// Returns the changes with another among them, in the order of their surfaces.
fn merged(changes: &[SurfaceChange], other: SurfaceChange) -> Vec<SurfaceChange> {
    let mut all = changes.to_vec();
    match all.iter_mut().find(|change| change.surface == other.surface) {
        Some(change) => {
            change.curvature_per_mm = other.curvature_per_mm.or(change.curvature_per_mm);
            change.thickness_mm = other.thickness_mm.or(change.thickness_mm);
        }
        None => all.push(other),
    }
    all.sort_by_key(|change| change.surface);
    all
}

/// Returns the least distance along the axis between a surface and the next, as far as both reach, mm.
fn clearance_mm(lens: &Lens, before: usize) -> f64 {
    let [front, back] = [before, before + 1].map(|i| &lens.interfaces()[i]);
    let half_mm = front.surface.semi_aperture_mm.min(back.surface.semi_aperture_mm);
    (0..PLACES)
        .map(|i| half_mm * i as f64 / (PLACES - 1) as f64)
        .map(|y_mm| front.thickness_after_mm + back.surface.sag_mm(y_mm) - front.surface.sag_mm(y_mm))
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn double_gauss() -> Prescription {
        Prescription::open(&LensSpec::BuiltIn("dgauss-50mm".to_owned()), &LensReadOptions::default()).unwrap()
    }

    #[test]
    fn a_changed_number_is_that_of_the_lens() {
        let before = double_gauss();
        let spacing_mm = before.spacing_mm(1).unwrap() + 0.25;
        let change = SurfaceChange { surface: 1, thickness_mm: Some(spacing_mm), ..SurfaceChange::default() };
        let first = before.changed(change).unwrap();
        let after = Prescription::open(&first, &LensReadOptions::default()).unwrap();
        assert_eq!(after.spacing_mm(1), Some(spacing_mm));
        // A second change of the same surface joins the first, one of another precedes it.
        let bent = SurfaceChange { surface: 1, curvature_per_mm: Some(0.01), thickness_mm: None };
        let other = SurfaceChange { surface: 0, curvature_per_mm: Some(0.015), thickness_mm: None };
        let twice = Prescription::open(&after.changed(bent).unwrap(), &LensReadOptions::default()).unwrap();
        let last = twice.changed(other).unwrap();
        let both = SurfaceChange { surface: 1, curvature_per_mm: Some(0.01), thickness_mm: Some(spacing_mm) };
        assert_eq!(last.changes(), [other, both]);
        assert_eq!(last.base(), &LensSpec::BuiltIn("dgauss-50mm".to_owned()));
    }

    #[test]
    fn surfaces_do_not_cross() {
        let lens = double_gauss();
        let gap_mm = clearance_mm(&lens.lens, 1);
        let at =
            |mm: f64| lens.changed(SurfaceChange { surface: 1, thickness_mm: Some(mm), ..SurfaceChange::default() });
        let spacing_mm = lens.spacing_mm(1).unwrap();
        assert!(gap_mm > 0.0 && at(spacing_mm - 0.99 * gap_mm).is_some() && at(spacing_mm - 1.01 * gap_mm).is_none());
        // Nor is a rim cut from a sphere that is too small.
        let steep = 1.01 / 0.999 * lens.steepest_per_mm(0);
        let change = SurfaceChange { surface: 0, curvature_per_mm: Some(steep), thickness_mm: None };
        assert_eq!(lens.changed(change), None);
        assert_eq!(lens.spacing_mm(lens.n_surfaces() - 1), None);
    }
}
