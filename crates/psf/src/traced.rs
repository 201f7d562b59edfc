//! A lens as its image is traced: at each wavelength the survey of its film and the bundles of its points.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Arc, Mutex, PoisonError},
};

use dioptric_optics::{FilmCone, Lens, MonoLens, ObjectPoint, ReversedLens};
use glam::{DVec2, DVec3, IVec2};
use ndarray::Array2;

use crate::{
    FilmMap, FilmQuery, ImageSettings, Kernel, PsfError, PupilDivision,
    bundle::{Bundle, FilmPointJob, Frame, Moments, unobscured},
    decenter::Decenter,
    hurb_splatter::bending,
    lattice::{Lattice, N_AZIMUTHS},
    pupil::Outline,
    render::{Layout, PARTS, of_parts, wave_energies},
    station::SurveyedLens,
    survey::Survey,
    symmetry::Symmetry,
};

/// Bytes of bundles that are kept for each wavelength.
const MOST_KEPT_BYTES: usize = 2 << 20;
/// How far beyond the film that was surveyed kernels go by its survey, as a multiple of its reach.
const FAR_BEYOND: f64 = 1.5;
/// Radii, over the film's distance, at which light is looked for before anything else is done.
const PROBED_RADII: [f64; 6] = [0.0, 0.05, 0.12, 0.25, 0.5, 1.0];

#[derive(Debug)]
pub(crate) struct Shared {
    lens: Lens,
    /// The lens as it is traced: on its axis where it has one.
    centered: Lens,
    symmetry: Symmetry,
    decenter: Decenter,
    settings: ImageSettings,
    wavelengths_nm: Vec<f64>,
    reference: MonoLens,
    /// The height of the picture of what is seen at a tangent of 1, mm: the focal length, about.
    scale_mm: f64,
    /// The depth in focus at the reference wavelength.
    focus_dioptres: f64,
    colors: Mutex<HashMap<u64, Arc<Color>>>,
    /// The farthest points of the film that were asked for, mm.
    reach_mm: Mutex<f64>,
}

/// The lens at one wavelength.
#[derive(Debug)]
pub(crate) struct Color {
    pub(crate) lens: MonoLens,
    reversed: ReversedLens,
    unobscured: Option<ReversedLens>,
    /// With a circle of as much area in place of the opening of blades: the lens, and it without obscurations.
    round: Option<(ReversedLens, Option<ReversedLens>)>,
    surveys: Mutex<Vec<Arc<Survey>>>,
    bundles: Mutex<KeptBundles>,
}

/// Bundles by the points of the film that see them, the oldest dropped first.
#[derive(Debug, Default)]
struct KeptBundles {
    by_place: HashMap<[u64; 2], Option<Arc<Bundle>>>,
    in_order: VecDeque<[u64; 2]>,
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Traces a lens at these wavelengths, nm.
    ///
    /// # Errors
    /// As of [`LensImageModel::new`](crate::LensImageModel::new).
    pub(crate) fn new(lens: &Lens, wavelengths_nm: &[f64], settings: &ImageSettings) -> Result<Self, PsfError> {
        settings.check()?;
        let reference = lens.at(settings.reference_wavelength_nm)?;
        let (centered, decenter) = Decenter::of(lens, settings.reference_wavelength_nm);
        let centered = centered.into_owned();
        let center_z_mm = reference.projection_center_z_mm();
        let focus_mm = reference.object_distance_mm_for(settings.film_distance_mm);
        let focus_dioptres = focus_mm.map_or(0.0, |distance_mm| 1e3 / (distance_mm + center_z_mm));
        let scale_mm = reference.film_scale_mm(settings.film_distance_mm).abs();
        let shared = Self {
            // Of an afocal lens, or film in a pupil, what else there is.
            scale_mm: if scale_mm.is_normal() { scale_mm } else { settings.film_distance_mm },
            lens: lens.clone(),
            symmetry: Symmetry::of(&centered),
            centered,
            decenter,
            settings: *settings,
            wavelengths_nm: wavelengths_nm.to_vec(),
            reference,
            focus_dioptres: if focus_dioptres.is_finite() { focus_dioptres } else { 0.0 },
            colors: Mutex::default(),
            reach_mm: Mutex::default(),
        };
        for &wavelength_nm in wavelengths_nm {
            let color = shared.new_color(wavelength_nm)?;
            shared.check_light(&color)?;
            locked(&shared.colors).insert(wavelength_nm.to_bits(), Arc::new(color));
        }
        Ok(shared)
    }

    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    pub(crate) fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    pub(crate) fn settings(&self) -> &ImageSettings {
        &self.settings
    }

    /// Whether the lens as it is traced has an axis of symmetry.
    pub(crate) fn is_rotational(&self) -> bool {
        self.symmetry == Symmetry::Axis
    }

    pub(crate) fn decenter(&self) -> Decenter {
        self.decenter
    }

    pub(crate) fn focus_dioptres(&self) -> f64 {
        self.focus_dioptres
    }

    pub(crate) fn projection_center_z_mm(&self) -> f64 {
        self.reference.projection_center_z_mm()
    }

    /// Returns the direction that a point of the film sees, of any length.
    pub(crate) fn direction(&self, place_mm: DVec2, wavelength_nm: f64) -> DVec3 {
        self.survey_about(&self.color(wavelength_nm), place_mm).map.direction(place_mm)
    }

    fn new_color(&self, wavelength_nm: f64) -> Result<Color, PsfError> {
        let lens = self.centered.at(wavelength_nm)?;
        let round = lens.with_round_iris().map(|lens| (lens.reversed(), unobscured(&lens)));
        Ok(Color {
            round,
            reversed: lens.reversed(),
            unobscured: unobscured(&lens),
            lens,
            surveys: Mutex::default(),
            bundles: Mutex::default(),
        })
    }

    /// Returns the lens at a wavelength, or at the nearest one that it was made for where it is not known.
    pub(crate) fn color(&self, wavelength_nm: f64) -> Arc<Color> {
        if let Some(color) = locked(&self.colors).get(&wavelength_nm.to_bits()) {
            return color.clone();
        }
        let color = self.new_color(wavelength_nm).map(Arc::new).unwrap_or_else(|_| {
            let off = |nm: &&f64| (**nm - wavelength_nm).abs();
            let nearest = self.wavelengths_nm.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            let nearest_nm = nearest.copied().unwrap_or(self.settings.reference_wavelength_nm);
            locked(&self.colors)[&nearest_nm.to_bits()].clone()
        });
        locked(&self.colors).entry(wavelength_nm.to_bits()).or_insert(color).clone()
    }

    /// Fails if no light reaches the film about its middle.
    fn check_light(&self, color: &Color) -> Result<(), PsfError> {
        let n_directions = if self.symmetry == Symmetry::Axis { 1 } else { N_AZIMUTHS };
        let directions =
            (0..n_directions).map(|i| DVec2::from_angle(std::f64::consts::TAU * i as f64 / n_directions as f64));
        let mut probes = directions
            .flat_map(|direction| PROBED_RADII.map(|radius| direction * (radius * self.settings.film_distance_mm)));
        let is_lit = |place_mm: DVec2| {
            let cone = FilmCone::new(&color.reversed, -place_mm, self.settings.film_distance_mm);
            cone.is_some_and(|cone| cone.is_lit())
        };
        match probes.any(is_lit) {
            true => Ok(()),
            false => Err(PsfError::Dark {
                lens: self.lens.name().to_owned(),
                film_distance_mm: self.settings.film_distance_mm,
                wavelength_nm: color.lens.wavelength_nm(),
            }),
        }
    }

    fn surveyed<'a>(&self, color: &'a Color) -> SurveyedLens<'a> {
        let job = self.job(color, DVec2::ZERO);
        let round_job = color.round.as_ref().map(|(lens, unobscured)| FilmPointJob {
            lens,
            unobscured: unobscured.as_ref(),
            ..job
        });
        SurveyedLens {
            job,
            round_job,
            symmetry: self.symmetry,
            decenter: self.decenter,
            focus_dioptres: self.focus_dioptres,
        }
    }

    /// Returns what traces the bundle of a point of the film of the centered lens.
    fn job<'a>(&self, color: &'a Color, place_mm: DVec2) -> FilmPointJob<'a> {
        FilmPointJob {
            lens: &color.reversed,
            unobscured: color.unobscured.as_ref(),
            film_distance_mm: self.settings.film_distance_mm,
            center_z_mm: self.reference.projection_center_z_mm(),
            mesh: self.settings.mesh(),
            place_mm,
        }
    }

    /// Returns the survey of the film up to `reach_mm` from its middle, or farther; kernels of all wavelengths use one as wide from now on.
    pub(crate) fn survey_of_film(&self, color: &Color, reach_mm: f64) -> Arc<Survey> {
        let mut known_mm = locked(&self.reach_mm);
        *known_mm = known_mm.max(reach_mm);
        let reach_mm = *known_mm;
        drop(known_mm);
        self.survey(color, reach_mm)
    }

    /// Returns the survey that the kernel of a point goes by: that of the film, whose directions go on beyond it.
    fn survey_about(&self, color: &Color, place_mm: DVec2) -> Arc<Survey> {
        let known_mm = *locked(&self.reach_mm);
        self.survey(color, known_mm.max(place_mm.length() / FAR_BEYOND))
    }

    fn survey(&self, color: &Color, reach_mm: f64) -> Arc<Survey> {
        // Of a lens moved sideways, as far from its axis.
        let lattice = Lattice::over(reach_mm + self.decenter.mm().length(), self.scale_mm);
        let known = |surveys: &[Arc<Survey>]| surveys.iter().find(|survey| survey.lattice == lattice).cloned();
        if let Some(survey) = known(&locked(&color.surveys)) {
            return survey;
        }
        // Threads that ask at once get the same, whoever is first.
        let last = locked(&color.surveys).last().cloned();
        let survey = Arc::new(Survey::new(&self.surveyed(color), lattice, last.as_deref()));
        let mut surveys = locked(&color.surveys);
        known(&surveys).unwrap_or_else(|| {
            surveys.push(survey.clone());
            survey
        })
    }

    /// Returns the bundle of a point of the film, the map that goes with it and the frame that it was traced in; `None` in darkness.
    pub(crate) fn bundle(&self, color: &Color, place_mm: DVec2) -> Option<(Arc<Bundle>, Arc<FilmMap>, Frame)> {
        let survey = self.survey_of_film(color, 0.0);
        let from_axis_mm = place_mm - self.decenter.axis_mm();
        // Of a lens with an axis bundles are traced along +x, of one with blades in one sector, and turned.
        let (traced_mm, turn) = self.symmetry.traced(from_axis_mm);
        let frame = Frame { turn, aside_mm: self.decenter.mm() };
        let key = traced_mm.to_array().map(f64::to_bits);
        let known = locked(&color.bundles).by_place.get(&key).cloned();
        let bundle = known.unwrap_or_else(|| {
            let has_stop = self.settings.diffraction.hurb().is_some();
            let seed: Option<&Outline> = survey.seed(traced_mm);
            let bundle = self.job(color, traced_mm).trace(seed, has_stop).map(Arc::new);
            locked(&color.bundles).keep(key, bundle.clone());
            bundle
        });
        // In darkness far from the film nothing more is needed.
        let bundle = bundle?;
        Some((bundle, self.survey_about(color, place_mm).map.clone(), frame))
    }

    /// Returns how much of the kernel of a point of the film is wave optics.
    pub(crate) fn wave_fraction(&self, query: FilmQuery) -> f64 {
        let color = self.color(query.wavelength_nm);
        let Some((bundle, map, frame)) = self.bundle(&color, query.place_mm) else { return 0.0 };
        let spots = bundle.spots(&map, &frame, query.place_mm, query.dioptres);
        Layout::new(&spots, bending(&color.lens, self.settings.diffraction), query.pitch_um)
            .wave_fraction(self.settings.diffraction)
    }

    /// Returns the kernel of a point of the film, of the whole pupil or of a part of it, given by its part in a division.
    pub(crate) fn kernel(&self, query: FilmQuery, part: Option<(&PupilDivision, usize)>) -> Kernel {
        let FilmQuery { place_mm, dioptres, wavelength_nm, pitch_um } = query;
        let color = self.color(wavelength_nm);
        let Some((bundle, map, frame)) = self.bundle(&color, place_mm) else { return Kernel::identity(pitch_um) };
        let mut spots = bundle.spots(&map, &frame, place_mm, dioptres);
        if let Some((division, number)) = part {
            let shares = division.cell_shares(number, spots.mesh, frame.turn * bundle.pupil_sign);
            spots.energies.iter_mut().zip(shares).for_each(|(energy, share)| *energy *= share);
            let share: f64 = spots.energies.iter().sum();
            if share <= 0.0 {
                return Kernel::identity(pitch_um);
            }
            spots.energies.iter_mut().for_each(|energy| *energy /= share);
        }
        let layout = Layout::new(&spots, bending(&color.lens, self.settings.diffraction), pitch_um);
        let drawn = |layout: &Layout<'_>, pitch_um: f64| {
            let query = FilmQuery { pitch_um, ..query };
            let waves = |side, middle_px| self.waves(&color, &map, &query, side, middle_px);
            layout.drawn(self.settings.diffraction, waves).0
        };
        let (energies, excess_px2) = match layout.on_parts() {
            Some(parts) => of_parts(&drawn(&parts, pitch_um / PARTS as f64)),
            None => (drawn(&layout, pitch_um), [1.0 / 12.0; 2]),
        };
        Kernel { excess_px2, ..layout.kernel(&energies, pitch_um).normalized() }
    }

    /// Returns the wave-optical energies, in a window about a pixel, of the object point that the chief ray of a point of the film sees.
    fn waves(
        &self,
        color: &Color,
        map: &FilmMap,
        query: &FilmQuery,
        side: usize,
        middle_px: IVec2,
    ) -> Result<Array2<f64>, PsfError> {
        // As the centered lens sees the point.
        let moved = self.decenter.mm() * (1e-3 * query.dioptres);
        let direction = map.direction(query.place_mm);
        let field_tan = direction.truncate() / direction.z - moved;
        let point = ObjectPoint::from_field(&self.reference, field_tan, query.dioptres);
        let middle_mm = middle_px.as_dvec2() * DVec2::new(1e-3, -1e-3) * query.pitch_um;
        let center_mm = query.place_mm - self.decenter.axis_mm() + middle_mm;
        wave_energies(&color.lens, &point, &self.settings, center_mm, (query.pitch_um, side))
    }

    fn moments(&self, place_mm: DVec2, wavelength_nm: f64) -> Moments {
        let color = self.color(wavelength_nm);
        let survey = self.survey_of_film(&color, 0.0);
        survey.moments(place_mm - self.decenter.axis_mm())
    }

    pub(crate) fn blur_radius_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        let moments = self.moments(place_mm, wavelength_nm);
        moments.blur_mm + moments.blur_mm_per_dioptre * (dioptres - self.focus_dioptres)
    }

    pub(crate) fn spread_mm(&self, place_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        let moments = self.moments(place_mm, wavelength_nm);
        let blur_mm = moments.blur_mm + moments.blur_mm_per_dioptre * (dioptres - self.focus_dioptres);
        blur_mm.hypot(moments.residue_mm)
    }
}

impl KeptBundles {
    fn keep(&mut self, key: [u64; 2], bundle: Option<Arc<Bundle>>) {
        let most = bundle.as_ref().map_or(usize::MAX, |bundle| MOST_KEPT_BYTES / bundle.size_bytes().max(1));
        while self.in_order.len() > most.max(1) {
            let Some(oldest) = self.in_order.pop_front() else { break };
            self.by_place.remove(&oldest);
        }
        if self.by_place.insert(key, bundle).is_none() {
            self.in_order.push_back(key);
        }
    }
}
