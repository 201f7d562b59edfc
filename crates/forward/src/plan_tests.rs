//! A plan that is used again, held to one that is made for a single use.

use std::{
    borrow::Cow,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use dioptric_psf::{FilmMap, FilmQuery, Kernel, LensImage, PupilEdges};
use dioptric_scene::View;
use dioptric_spectrum::{Bands, Cancel, DepthMap, Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

use crate::{
    BandRadiance, DiscLens, Film, ForwardError, ImagingPlan, ImagingSpec, ImagingTimes, SceneGeometry, SceneRadiance,
    Settings, Source, render,
};

const ROWS: usize = 60;
const COLUMNS: usize = 90;

/// A near disc over a slanted plane, under a lens of 1 mm and pixels of 1 µm, in bands that blur differently.
struct Scene {
    radiance: SpectralImage,
    depth: DepthMap,
    lens: Arc<DiscLens>,
}

impl Scene {
    fn new() -> Self {
        let wavelengths_nm: Vec<f64> = (0..7).map(|i| 500.0 + 20.0 * f64::from(i)).collect();
        let plane = |band: usize| {
            Array2::from_shape_fn((ROWS, COLUMNS), move |(r, c)| ((r / 7 + c / 5 + band) % 3) as f32 + 0.2)
        };
        let grid = WavelengthGrid::new(wavelengths_nm).unwrap();
        let is_near = |r: usize, c: usize| r.abs_diff(30).pow(2) + c.abs_diff(45).pow(2) < 200;
        let dioptres = |(r, c)| if is_near(r, c) { 27.0 } else { 18.0 + 0.03 * c as f32 };
        Self {
            radiance: SpectralImage::new(Quantity::Radiance, grid, (0..7).map(plane).collect()).unwrap(),
            depth: DepthMap::new(Array2::from_shape_fn((ROWS, COLUMNS), |at| 1.0 / dioptres(at))).unwrap(),
            lens: Arc::new(DiscLens { focus_dioptres: 20.0, axial_per_nm: 0.006, growth: 2.0, ..DiscLens::default() }),
        }
    }

    fn view(&self) -> View {
        View { focal_px: 1000.0, center_x_px: 44.5, center_y_px: 29.5 }
    }

    fn geometry(&self) -> SceneGeometry<'_> {
        SceneGeometry { depth: &self.depth, view: self.view(), occluded_depth: None, points: &[] }
    }

    fn spec(&self) -> ImagingSpec {
        ImagingSpec {
            film: Film::centered(ROWS, COLUMNS, 1.0),
            grid: WavelengthGrid::new((0..7).map(|i| 500.0 + 20.0 * f64::from(i)).collect()).unwrap(),
            settings: Settings::default(),
        }
    }

    fn plan(&self) -> ImagingPlan {
        ImagingPlan::new(self.lens.clone(), &self.geometry(), self.spec(), &|_| {}, &Cancel::new()).unwrap()
    }

    fn band(&self, plan: &ImagingPlan, band: usize) -> Array2<f32> {
        let front = &self.radiance.planes()[band];
        plan.image(band, BandRadiance { front, occluded: None, points: &[] }, &Cancel::new()).unwrap()
    }

    fn rendered(&self) -> Vec<Array2<f32>> {
        let source =
            Source { radiance: &self.radiance, depth: &self.depth, view: self.view(), occluded: None, points: &[] };
        let ImagingSpec { film, settings, .. } = self.spec();
        let mut bands = vec![];
        render(&source, self.lens.as_ref(), &film, &settings, &|_| {}, &mut |_, band| {
            bands.push(band);
            Ok(())
        })
        .unwrap();
        bands
    }
}

/// Any band, in any order, any number of times, whether kernels are kept or not, is what `render` makes of it.
#[test]
fn planned_bands_equal_rendered_ones() {
    let scene = Scene::new();
    let rendered = scene.rendered();
    for plan in [scene.plan(), scene.plan().with_kernel_budget(0)] {
        for band in [5, 0, 6, 5, 3] {
            assert_eq!(scene.band(&plan, band), rendered[band], "band {band}");
        }
        let mut streamed = vec![];
        let source =
            Source { radiance: &scene.radiance, depth: &scene.depth, view: scene.view(), occluded: None, points: &[] };
        plan.stream(&source.light(), &|_| {}, &Cancel::new(), &mut |band, picture| {
            assert_eq!(band, streamed.len());
            streamed.push(picture);
            Ok(())
        })
        .unwrap();
        assert_eq!(streamed, rendered);
    }
}

#[test]
fn light_changes_without_another_plan() {
    let scene = Scene::new();
    let plan = scene.plan();
    let first = scene.band(&plan, 2);
    let brighter = scene.radiance.planes()[2].mapv(|v| 4.0 * v);
    let second = plan.image(2, BandRadiance { front: &brighter, occluded: None, points: &[] }, &Cancel::new()).unwrap();
    // A factor of 4 changes no mantissa.
    assert_eq!(second, first.mapv(|v| 4.0 * v));
}

#[test]
fn size_counts_kept_kernels() {
    let scene = Scene::new();
    let keeps_none = scene.plan().with_kernel_budget(0);
    let empty = keeps_none.size_bytes();
    // Depth layers of all samples and the second samples behind edges, at least.
    assert!(empty >= 2 * 4 * ROWS * COLUMNS, "{empty}");
    // Kernels of the middle band tell how much memory they take.
    let plan = scene.plan();
    let of_middle = plan.kernels(3, &Cancel::new()).unwrap()[0].size_bytes();
    let planned = scene.plan().size_bytes();
    assert_eq!(planned, empty + of_middle);
    let kernels = plan.kernels(0, &Cancel::new()).unwrap().remove(0);
    assert!(kernels.n_kernels() > 0);
    assert_eq!(plan.size_bytes() - planned, kernels.size_bytes());
    plan.kernels(0, &Cancel::new()).unwrap();
    assert_eq!(plan.size_bytes() - planned, kernels.size_bytes());
    keeps_none.kernels(0, &Cancel::new()).unwrap();
    assert_eq!(keeps_none.size_bytes(), empty);
}

/// A lens that cancels the work when it has been asked for a number of kernels, and counts them all.
struct Cancelling {
    lens: DiscLens,
    at: usize,
    asked: AtomicUsize,
    cancel: Cancel,
}

impl LensImage for Cancelling {
    fn is_symmetric(&self) -> bool {
        self.lens.is_symmetric()
    }
    fn film_map(&self, wavelength_nm: f64, reach_mm: f64) -> Arc<FilmMap> {
        self.lens.film_map(wavelength_nm, reach_mm)
    }
    fn kernel(&self, query: FilmQuery) -> Kernel {
        if self.asked.fetch_add(1, Ordering::Relaxed) + 1 == self.at {
            self.cancel.cancel();
        }
        self.lens.kernel(query)
    }
    fn pupil_edges(&self) -> Option<PupilEdges> {
        None
    }

    fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.lens.blur_radius_mm(place_mm, dioptres, wavelength_nm)
    }
}

/// Cancelled while it plans or while it computes kernels, the work ends with the kernels then begun, one a thread.
#[test]
fn cancelled_work_ends_at_once() {
    let scene = Scene::new();
    let attempt = |at: usize| {
        let cancel = Cancel::new();
        let lens = DiscLens::clone(&scene.lens);
        let lens = Arc::new(Cancelling { lens, at, asked: AtomicUsize::new(0), cancel: cancel.clone() });
        let plan = ImagingPlan::new(lens.clone(), &scene.geometry(), scene.spec(), &|_| {}, &cancel);
        let n_planned = lens.asked.load(Ordering::Relaxed);
        let ended = plan.and_then(|plan| {
            // Kernels in the first band are those that seams were looked for with.
            let front = &scene.radiance.planes()[1];
            plan.image(1, BandRadiance { front, occluded: None, points: &[] }, &cancel)
        });
        (n_planned, lens.asked.load(Ordering::Relaxed), ended)
    };
    let (n_planned, n_all, done) = attempt(usize::MAX);
    assert!(done.is_ok() && n_planned > 10 && n_all > n_planned + 10, "{n_planned} of {n_all}");
    for at in [3, n_planned + 3] {
        let (_, asked, ended) = attempt(at);
        assert!(matches!(ended, Err(ForwardError::Cancelled(_))), "{ended:?}");
        assert!(asked <= at + rayon::current_num_threads(), "{asked} kernels, cancelled at {at}");
    }
}

/// Cancelled while bands are imaged, no further band is handed on.
#[test]
fn cancelled_stream_hands_on_no_more() {
    let scene = Scene::new();
    let plan = scene.plan();
    let cancel = Cancel::new();
    let source =
        Source { radiance: &scene.radiance, depth: &scene.depth, view: scene.view(), occluded: None, points: &[] };
    let seen = Mutex::new(0.0);
    let progress = |fraction: f64| {
        *seen.lock().unwrap() = fraction;
        if fraction > 0.5 {
            cancel.cancel();
        }
    };
    let mut n_bands = 0;
    let ended = plan.stream(&source.light(), &progress, &cancel, &mut |_, _| {
        n_bands += 1;
        Ok(())
    });
    assert!(matches!(ended, Err(ForwardError::Cancelled(_))));
    assert!(n_bands < 7 && *seen.lock().unwrap() < 0.9, "{n_bands} bands, progress {}", seen.lock().unwrap());
}

/// Work that was interrupted goes on with the bands that are left, of which there may be none.
#[test]
fn streams_begin_anywhere() {
    let scene = Scene::new();
    let rendered = scene.rendered();
    let source =
        Source { radiance: &scene.radiance, depth: &scene.depth, view: scene.view(), occluded: None, points: &[] };
    for plan in [scene.plan(), scene.plan().with_band_budget(1)] {
        for first in 0..=7 {
            let mut left = vec![];
            let mut sink = |band: usize, picture: Array2<f32>| {
                assert_eq!(band, first + left.len());
                left.push(picture);
                Ok(())
            };
            plan.stream_from(first, &source.light(), &|_| {}, &Cancel::new(), &mut sink).unwrap();
            assert_eq!(left, rendered[first..]);
        }
    }
}

/// The thread that hands bands on may be the only one that images them.
#[test]
fn threads_of_a_pool_stream_bands() {
    let scene = Scene::new();
    let rendered = scene.rendered();
    for n_threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        assert_eq!(pool.install(|| scene.rendered()), rendered, "{n_threads} threads");
    }
}

/// Bands whose samples cannot be had: reading one panics, or is an error.
struct Unreadable<'a> {
    image: &'a SpectralImage,
    panics: bool,
}

impl Bands for Unreadable<'_> {
    fn quantity(&self) -> Quantity {
        Quantity::Radiance
    }
    fn grid(&self) -> &WavelengthGrid {
        self.image.grid()
    }
    fn size(&self) -> (usize, usize) {
        self.image.size()
    }
    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError> {
        assert!(!(self.panics && band == 4), "the fourth band panics");
        if band == 4 { Err(SpectrumError::Depth { row: 0, column: 0, value: 0.0 }) } else { self.image.band(band) }
    }
}

/// A stream that cannot go on ends, with the error or the panic, and hands on no band behind it.
#[test]
fn streams_end_where_a_band_fails() {
    let scene = Scene::new();
    let plan = scene.plan();
    let handed_on = Mutex::new(vec![]);
    let stream = |panics: bool, refused: usize| {
        handed_on.lock().unwrap().clear();
        let front = Unreadable { image: &scene.radiance, panics };
        let light = SceneRadiance { front: &front, occluded: None, points: &[] };
        let mut sink = |band: usize, _: Array2<f32>| {
            handed_on.lock().unwrap().push(band);
            if band == refused { Err("the disk is full".into()) } else { Ok(()) }
        };
        catch_unwind(AssertUnwindSafe(|| plan.stream(&light, &|_| {}, &Cancel::new(), &mut sink)))
    };
    assert!(matches!(stream(false, 7), Ok(Err(ForwardError::Spectrum(_)))));
    assert!(handed_on.lock().unwrap().iter().all(|&band| band < 4));
    assert!(stream(true, 7).is_err());
    assert!(handed_on.lock().unwrap().iter().all(|&band| band < 4));
    assert!(matches!(stream(false, 2), Ok(Err(ForwardError::Sink { band: 2, .. } | ForwardError::Spectrum(_)))));
    assert!(handed_on.lock().unwrap().iter().all(|&band| band <= 2));
}

#[test]
fn radiance_of_another_scene_is_refused() {
    let scene = Scene::new();
    let plan = scene.plan();
    let message = |band: usize, front: &Array2<f32>| {
        plan.image(band, BandRadiance { front, occluded: None, points: &[] }, &Cancel::new()).unwrap_err().to_string()
    };
    assert!(message(0, &Array2::zeros((ROWS, 7))).contains("60 x 7"));
    assert!(message(7, &Array2::zeros((ROWS, COLUMNS))).contains("no band 7"));
    let grid = WavelengthGrid::new((0..7).map(|i| 500.0 + 21.0 * f64::from(i)).collect()).unwrap();
    let other = SpectralImage::zeros(Quantity::Radiance, grid, ROWS, COLUMNS);
    let source = Source { radiance: &other, depth: &scene.depth, view: scene.view(), occluded: None, points: &[] };
    let error = plan.stream(&source.light(), &|_| {}, &Cancel::new(), &mut |_, _| Ok(())).unwrap_err();
    assert!(error.to_string().contains("521 nm"), "{error}");
}

#[test]
fn times_are_those_of_the_clock() {
    let scene = Scene::new();
    let ticks = Arc::new(AtomicUsize::new(0));
    let clock = {
        let ticks = ticks.clone();
        move || Duration::from_millis(ticks.fetch_add(1, Ordering::Relaxed) as u64)
    };
    let plan = scene.plan().with_clock(Arc::new(clock));
    assert_eq!(plan.times(), ImagingTimes::default());
    scene.band(&plan, 1);
    let ImagingTimes { kernels, sampling, transforms, direct, compositing } = plan.times();
    let spread = transforms + direct;
    // Each part takes at least the tick between its two looks at the clock.
    for (part, time) in [("kernels", kernels), ("sampling", sampling), ("spreading", spread), ("layers", compositing)] {
        assert!(time >= Duration::from_millis(1), "{part}");
    }
    let timeless = scene.plan();
    scene.band(&timeless, 1);
    assert_eq!(timeless.times(), ImagingTimes::default());
}
