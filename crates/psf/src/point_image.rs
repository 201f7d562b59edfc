//! Points of a scene, traced forward through a lens.

use std::sync::Arc;

use dioptric_diffraction::{StopRay, trace_stop_rays};
use dioptric_optics::{FilmPoint, Lens, MonoLens, ObjectPoint, PupilBoundary, PupilPlane, Vignetting};
use glam::{DVec2, IVec2};
use ndarray::{Array2, s};

use crate::{
    ImageSettings, Kernel, ModelUse, PsfError,
    bundle::rim_over_rms,
    hurb_splatter::bending,
    pupil::Outline,
    render::{Layout, wave_energies},
    spots::{Node, Spots, cell_areas, clear_shares},
    stored::{StoredPoint, StoredPsfs},
};

/// The image of one point of a scene at one wavelength, traced where it is: its place, its size and its point spread function.
///
/// What a [`LensImageModel`](crate::LensImageModel) says of the film's points, said of the scene's.
#[derive(Clone, Debug)]
pub struct PointImage {
    centroid_mm: DVec2,
    blur_radius_mm: f64,
    spread_mm: f64,
    source: Source,
}

/// What a picture is drawn from.
#[derive(Clone, Debug)]
enum Source {
    Traced(Box<Traced>),
    Stored(Arc<StoredPsfs>, StoredPoint),
}

#[derive(Clone, Debug)]
struct Traced {
    lens: MonoLens,
    point: ObjectPoint,
    settings: ImageSettings,
    /// About the centroid.
    spots: Spots,
    centroid_mm: DVec2,
}

impl PointImage {
    /// Traces the point at these tangents of field angles (x to the right, y up, from the entrance pupil at the reference wavelength) and
    /// this depth, dioptres; `None` if none of its light reaches the film.
    ///
    /// # Errors
    /// When the settings make no sense or the lens has no index at a wavelength.
    pub fn trace(
        lens: &Lens,
        settings: &ImageSettings,
        field_tan: DVec2,
        dioptres: f64,
        wavelength_nm: f64,
    ) -> Result<Option<Self>, PsfError> {
        let reference = lens.at(settings.reference_wavelength_nm)?;
        let point = ObjectPoint::from_field(&reference, field_tan, dioptres);
        Self::of_point(lens, settings, point, wavelength_nm)
    }

    /// Traces a point wherever it is, beside a lens or behind it too; `None` if none of its light reaches the film.
    ///
    /// # Errors
    /// As [`trace`](Self::trace).
    pub fn of_point(
        lens: &Lens,
        settings: &ImageSettings,
        point: ObjectPoint,
        wavelength_nm: f64,
    ) -> Result<Option<Self>, PsfError> {
        settings.check()?;
        Ok(Self::of(lens.at(wavelength_nm)?, point, *settings))
    }

    fn of(lens: MonoLens, point: ObjectPoint, settings: ImageSettings) -> Option<Self> {
        // Find the pupil that the point sees, about its centroid.
        let mesh = settings.mesh();
        let n_azimuths = 2 * mesh.n_azimuths;
        let boundary = PupilBoundary::find(&lens, &point, n_azimuths)?;
        let plane = boundary.plane();
        let clearances = |targets: &[DVec2]| lens.clearances_mm(plane.rays(&lens, &point, targets));
        let found = Outline::even(boundary.center_mm(), boundary.rho_at_azimuths_mm().to_vec());
        let outline = found.settled(&clearances).unwrap_or(found);
        let outline = if lens.has_openings() { outline.with_corners(&clearances) } else { outline };

        // Trace the nodes of the mesh.
        let targets = outline.nodes(mesh);
        let nodes = landed(&lens, (&point, plane), &settings, &targets)?;

        // Weigh cells by the solid angle that they take up, seen from the point, and by what surfaces, glass and obscurations leave of it.
        let shares = lens.trace_shares(&mut plane.rays(&lens, &point, &targets), Vignetting::Off);
        let weights: Vec<f64> =
            targets.iter().zip(shares).map(|(target, share)| share * weight(&point, plane, *target)).collect();
        let cell = |((ring, j), area): ((usize, usize), f64)| {
            area * mesh.corners(ring, j).map(|node| weights[node]).iter().sum::<f64>() / 4.0
        };
        let mut energies: Vec<f64> = mesh.cells().zip(cell_areas(mesh, &outline)).map(cell).collect();
        if lens.n_obscurations() > 0 {
            let whole = lens.with_obscurations_inverted(&[]);
            let passed = |targets: &[DVec2], with_obscurations: bool| {
                let mut rays = plane.rays(&lens, &point, targets);
                if with_obscurations { &lens } else { &whole }.trace(&mut rays, Vignetting::On);
                rays.fate.iter().map(|fate| fate.is_in_flight()).collect()
            };
            let shares = clear_shares(mesh, &outline, &passed);
            energies.iter_mut().zip(shares).for_each(|(energy, share)| *energy *= share);
        }
        let total: f64 = energies.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        energies.iter_mut().for_each(|energy| *energy /= total);

        let spots = Spots { mesh, nodes, energies };
        let centroid_mm = spots.centroid_mm();
        let spots = spots.about(centroid_mm);
        let blur_radius_mm = rim_over_rms() * signed_rms_mm(&spots, &targets);
        let spread_mm = rim_over_rms() * spots.rms_mm();
        let source = Source::Traced(Box::new(Traced { lens, point, settings, spots, centroid_mm }));
        Some(Self { centroid_mm, blur_radius_mm, spread_mm, source })
    }

    /// Returns the image of a point whose function is stored, where its chief ray meets the film.
    pub(crate) fn stored(psfs: Arc<StoredPsfs>, point: StoredPoint, place_mm: DVec2) -> Self {
        let (blur_radius_mm, spread_mm) = (psfs.blur_radius_mm(&point), psfs.spread_mm(&point));
        Self { centroid_mm: place_mm, blur_radius_mm, spread_mm, source: Source::Stored(psfs, point) }
    }

    /// The centroid of the light, mm from the middle of the film, picture frame; of a function of an array, the place of its middle sample.
    pub fn centroid_mm(&self) -> DVec2 {
        self.centroid_mm
    }

    /// The signed radius of the circle of confusion, mm: above 0 for objects nearer than the focus.
    ///
    /// It is that of the part of the spots that is linear in the pupil, scaled so that an even disc of this size has 95 %
    /// of its energy within it. So it goes smoothly through 0, where aberrations keep a spot from vanishing.
    pub fn blur_radius_mm(&self) -> f64 {
        self.blur_radius_mm
    }

    /// The radius, mm, that holds 95 % of the light of an even disc of the rms radius of the rays: of the blur and of what aberrations leave
    /// in focus.
    pub fn spread_mm(&self) -> f64 {
        self.spread_mm
    }

    /// How far from the centroid the farthest ray lands, mm.
    pub fn extent_mm(&self) -> f64 {
        match &self.source {
            Source::Traced(traced) => traced.spots.extent_mm(),
            Source::Stored(psfs, point) => psfs.extent_mm(point),
        }
    }

    /// Returns the point spread function about the centroid, and the model that drew it.
    ///
    /// The window holds the whole geometric picture, and of diffraction's Gaussians all but their far tails; the sum says how much.
    pub fn kernel(&self, pitch_um: f64) -> (Kernel, ModelUse) {
        match &self.source {
            Source::Traced(traced) => {
                let layout = traced.layout(pitch_um);
                let (energies, model) = traced.drawn(&layout, pitch_um);
                (layout.kernel(&energies, pitch_um), model)
            }
            Source::Stored(psfs, point) => (psfs.kernel(point, pitch_um), AS_STORED),
        }
    }

    /// Returns the energy on each pixel of a window of `size` × `size` about the centroid, in the picture frame, and the model that drew
    /// it. The energy of the point is 1; what falls outside is lost.
    pub fn picture(&self, pitch_um: f64, size: usize) -> (Array2<f64>, ModelUse) {
        match &self.source {
            Source::Traced(traced) => traced.drawn(&traced.layout(pitch_um).with_side(size), pitch_um),
            Source::Stored(psfs, point) => {
                let window = psfs.window(point, pitch_um, size / 2);
                (window.slice_move(s![..size, ..size]), AS_STORED)
            }
        }
    }
}

/// How a stored function is drawn.
const AS_STORED: ModelUse = ModelUse { wave_fraction: 0.0, fallback: None };

impl Traced {
    fn layout(&self, pitch_um: f64) -> Layout<'_> {
        Layout::about(IVec2::ZERO, &self.spots, bending(&self.lens, self.settings.diffraction), pitch_um)
    }

    fn drawn(&self, layout: &Layout<'_>, pitch_um: f64) -> (Array2<f64>, ModelUse) {
        layout.drawn(self.settings.diffraction, |side, _| {
            wave_energies(&self.lens, &self.point, &self.settings, self.centroid_mm, (pitch_um, side))
        })
    }
}

/// Returns where rays aimed at the pupil land, in the picture frame; `None` if that through its middle does not. A ray that fails at the
/// pupil's very edge lands with its neighbor inside.
fn landed(
    lens: &MonoLens,
    (point, plane): (&ObjectPoint, &PupilPlane),
    settings: &ImageSettings,
    targets: &[DVec2],
) -> Option<Vec<Node>> {
    let film_distance_mm = settings.film_distance_mm;
    let mut rays = plane.rays(lens, point, targets);
    let found: Vec<Option<Node>> = if settings.diffraction.hurb().is_some() {
        let radius_mm = lens.stop_semi_aperture_mm();
        let node = |ray: StopRay| Node {
            at_mm: ray.film.in_picture_mm(),
            in_stop: ray.stop.mm / radius_mm,
            along_l_mm: -ray.along_l_mm,
            along_m_mm: -ray.along_m_mm,
        };
        trace_stop_rays(lens, rays, film_distance_mm).into_iter().map(|ray| ray.map(node)).collect()
    } else {
        lens.trace(&mut rays, Vignetting::Off);
        lens.to_film(&mut rays, film_distance_mm);
        let node = |at: FilmPoint| Node { at_mm: at.in_picture_mm(), ..Node::default() };
        let places = lens.film_points(&rays, film_distance_mm);
        places.into_iter().zip(&rays.fate).map(|(at, fate)| fate.is_in_flight().then(|| node(at))).collect()
    };
    let mut nodes = vec![found[0]?];
    for (i, node) in found.into_iter().enumerate().skip(1) {
        let inside = i.checked_sub(settings.n_azimuths).filter(|inside| *inside > 0).unwrap_or(0);
        nodes.push(node.unwrap_or(nodes[inside]));
    }
    Some(nodes)
}

/// Returns the weight of pupil area at a place of its plane, up to a factor of the point: the solid angle projected on a plane across
/// the axis, which is even for a far point.
fn weight(point: &ObjectPoint, plane: &PupilPlane, target: DVec2) -> f64 {
    match *point {
        ObjectPoint::Infinite(_) => 1.0,
        ObjectPoint::Finite(point) => {
            let way = plane.in_lens_mm(target) - point;
            (way.dot(plane.normal()) * way.z).abs() / way.length_squared().powi(2)
        }
    }
}

/// Returns the rms radius of the part of spots that is linear in the pupil, mm; negative for what was in focus before it reached the film.
fn signed_rms_mm(spots: &Spots, targets: &[DVec2]) -> f64 {
    let mean = |of: &dyn Fn(usize) -> DVec2, (ring, j): (usize, usize)| -> DVec2 {
        spots.mesh.corners(ring, j).map(of).into_iter().sum::<DVec2>() / 4.0
    };
    let cells: Vec<(DVec2, DVec2, f64)> = spots
        .mesh
        .cells()
        .zip(&spots.energies)
        .map(|(cell, energy)| (mean(&|n| targets[n], cell), mean(&|n| spots.nodes[n].at_mm, cell), *energy))
        .collect();
    let center: DVec2 = cells.iter().map(|(p, _, e)| *p * *e).sum();
    let product: f64 = cells.iter().map(|(p, at, e)| (*p - center).dot(*at) * e).sum();
    let square: f64 = cells.iter().map(|(p, _, e)| (*p - center).length_squared() * e).sum();
    // Before its focus a bundle is still on the pupil's side; the picture frame is turned by 180°.
    -product / square.sqrt()
}
