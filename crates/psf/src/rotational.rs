//! Ray maps of a rotationally symmetric lens, over field along one radius, depth and wavelength.

use dioptric_diffraction::{PupilFunctionFit, PupilOutline};
use dioptric_optics::{Lens, MonoLens};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    BankSettings, Diffraction, FieldSampling, Interpolation, PsfError, RadialGeometry,
    axis::{Axis, Stencil},
    dispersion::{Dispersion, share_of_orders},
    gathering::{BEFORE_DARK, BEYOND_LAST, is_gathered},
    mesh::Mesh,
    middle_rays::{MiddleRay, MiddleRays},
    pupil::Pupil,
    ray_map::{RIM_OVER_RMS, RayMap, RayMapJob, RayMapMoments, Traced},
    watch::Watch,
};

/// Azimuths at which the pupil's edge is found for the wave sum.
const WAVE_AZIMUTHS: usize = 96;
/// How many times finer than the bank's the table of image heights is, in the field.
const GEOMETRY_STEPS: usize = 3;
/// The angle that stands for the axis where a ratio of height to field is needed, as a share of the largest.
const NEAR_AXIS: f64 = 1e-3;

/// Ray maps of a rotationally symmetric lens over field, depth and wavelength. Image height and brightness are in a table
/// finer in the field.
#[derive(Clone, Debug)]
pub(crate) struct RotationalBank {
    // Invariant: `records`, `waves` and `summaries` are indexed by (wavelength, depth, field), the field innermost.
    settings: BankSettings,
    /// Tangents of the fields that see light.
    field_tans: Vec<f64>,
    /// Whether light of the fields beyond reaches the film, but is not gathered to an image.
    is_scattered_beyond: bool,
    /// Whether no light of the fields just beyond gets through, at some depth and wavelength.
    is_dark_beyond: bool,
    /// Their angles, in which rays change evenly up to 90°.
    fields: Axis,
    dioptres: Axis,
    /// Wavelengths in reverse, by the measure of the lens's dispersion.
    colors: Axis,
    dispersion: Dispersion,
    records: Vec<RayMap>,
    /// Those with others between them, and where light ends beyond the last of them, some up to there.
    geometry_fields: Vec<f64>,
    summaries: Vec<RayMapMoments>,
    /// As many as there are records, or none.
    waves: Vec<PupilFunctionFit>,
    lens: Lens,
    reference: MonoLens,
    /// Index around the stop at each of the colors.
    stop_indices: Vec<f64>,
}

impl RotationalBank {
    /// Traces the samples on all threads.
    ///
    /// Fields that see no light at some depth or wavelength, or whose light is not gathered there (`gathering.rs`), are left out, and those beyond them.
    pub(crate) fn build(
        lens: &Lens,
        settings: &BankSettings,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Self, PsfError> {
        settings.check()?;
        lens.check_rotational("a bank of point spread functions")?;
        let field_tans = radius(settings);
        let reference = lens.at(settings.reference_wavelength_nm)?;
        let lenses: Vec<MonoLens> =
            settings.wavelengths_nm.iter().rev().map(|&nm| lens.at(nm)).collect::<Result<_, _>>()?;
        let mesh = Mesh { n_rings: settings.n_rings, n_azimuths: settings.n_azimuths };
        let geometry_fields = geometry_fields(field_tans);
        let axial = RayMapJob {
            lens: &reference,
            reference: &reference,
            field_tan: DVec2::ZERO,
            dioptres: settings.dioptres[0],
            film_distance_mm: settings.film_distance_mm,
            mesh,
        };
        let seed = Pupil::find(&reference, &axial.point(), mesh.n_azimuths).ok_or_else(|| PsfError::Dark {
            lens: lens.name().to_owned(),
            dioptres: axial.dioptres,
            wavelength_nm: settings.reference_wavelength_nm,
        })?;
        let columns: Vec<(&MonoLens, f64)> =
            lenses.iter().flat_map(|lens| settings.dioptres.iter().map(move |&d| (lens, d))).collect();
        let watch = Watch::new(columns.len() * geometry_fields.len(), progress, cancel);
        let tracer =
            ColumnTracer { settings, reference: &reference, geometry_fields: &geometry_fields, mesh, seed, watch };
        let trace = |&(lens, dioptres): &(&MonoLens, f64)| tracer.column(lens, dioptres);
        let traced: Vec<Column> = columns.par_iter().map(trace).collect::<Result<_, Cancelled>>()?;

        let n_lit = traced.iter().map(|column| column.summaries.len()).min().unwrap_or(0);
        if n_lit == 0 {
            let dark = traced.iter().position(|column| column.summaries.is_empty()).unwrap_or(0);
            let (lens_there, dioptres) = columns[dark];
            let wavelength_nm = lens_there.wavelength_nm();
            return Err(PsfError::Dark { lens: lens.name().to_owned(), dioptres, wavelength_nm });
        }
        let is_scattered_beyond =
            traced.iter().any(|column| column.is_scattered_beyond && column.summaries.len() == n_lit);
        let is_dark_beyond = traced.iter().any(|column| column.is_dark_beyond);
        let n_fields = (n_lit - 1) / GEOMETRY_STEPS + 1;
        let n_geometry = Self::n_geometry(n_fields);
        let ends_before_dark = is_dark_beyond && n_lit == geometry_fields.len();
        let rim_fields = if ends_before_dark { rim_fields(geometry_fields[n_lit - 1]) } else { vec![] };
        let rim = |(&(lens, dioptres), column): (&(&MonoLens, f64), &Column)| {
            tracer.rim(&rim_fields, (lens, dioptres), column)
        };
        let rims: Vec<Vec<RayMapMoments>> = columns.par_iter().zip(&traced).map(rim).collect();
        let mut parts = Parts { n_fields, is_scattered_beyond, is_dark_beyond, rim_fields, ..Parts::default() };
        for (column, rim) in traced.into_iter().zip(rims) {
            parts.records.extend(column.records.into_iter().take(n_fields));
            parts.waves.extend(column.waves.into_iter().take(n_fields));
            parts.summaries.extend(column.summaries.into_iter().take(n_geometry).chain(rim));
        }
        // A point whose waves are not smooth over its pupil leaves all of them to be traced when they are needed.
        if parts.waves.len() < parts.records.len() {
            parts.waves.clear();
        }
        Self::assemble(lens, settings, parts)
    }

    /// Puts a bank together from what was traced.
    fn assemble(lens: &Lens, settings: &BankSettings, parts: Parts) -> Result<Self, PsfError> {
        let Parts { n_fields, is_scattered_beyond, is_dark_beyond, rim_fields, records, summaries, waves } = parts;
        let colors: Vec<f64> = settings.wavelengths_nm.iter().rev().copied().collect();
        let dispersion = Dispersion::of(lens, &settings.wavelengths_nm);
        let stop_index = |&nm: &f64| Ok(lens.at(nm)?.stop_medium_index());
        let axis = |knots: Vec<f64>| Axis::new(knots).expect("the settings were checked");
        let mut geometry_fields = geometry_fields(radius(settings));
        geometry_fields.truncate(Self::n_geometry(n_fields));
        geometry_fields.extend(rim_fields);
        let field_tans = radius(settings)[..n_fields].to_vec();
        Ok(Self {
            fields: axis(field_tans.iter().map(|tan| tan.atan()).collect()),
            field_tans,
            is_scattered_beyond,
            is_dark_beyond,
            dioptres: axis(settings.dioptres.clone()),
            colors: axis(colors.iter().map(|&nm| dispersion.coordinate(nm)).collect()),
            dispersion,
            records,
            geometry_fields,
            summaries,
            waves,
            lens: lens.clone(),
            stop_indices: colors.iter().map(stop_index).collect::<Result<_, PsfError>>()?,
            reference: lens.at(settings.reference_wavelength_nm)?,
            settings: settings.clone(),
        })
    }

    /// Returns the bank without diffraction: of rays alone.
    pub(crate) fn geometric(&self) -> Self {
        let settings = BankSettings { diffraction: Diffraction::None, ..self.settings.clone() };
        Self { settings, waves: vec![], ..self.clone() }
    }

    pub(crate) fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The fields that see light.
    pub(crate) fn field_tans(&self) -> &[f64] {
        &self.field_tans
    }

    pub(crate) fn n_fields(&self) -> usize {
        self.field_tans.len()
    }

    /// Whether light of the fields beyond reaches the film, but is not gathered to an image.
    pub(crate) fn is_scattered_beyond(&self) -> bool {
        self.is_scattered_beyond
    }

    /// Whether no light of the fields just beyond gets through, at some depth and wavelength.
    pub(crate) fn is_dark_beyond(&self) -> bool {
        self.is_dark_beyond
    }

    /// The angles of the fields that see light.
    pub(crate) fn field_axis(&self) -> &Axis {
        &self.fields
    }

    /// The ray maps, by wavelength, depth and field, the field innermost.
    pub(crate) fn records(&self) -> &[RayMap] {
        &self.records
    }

    /// Returns how many fields the table of image heights has, for so many of the bank.
    fn n_geometry(n_fields: usize) -> usize {
        n_fields.saturating_sub(1) * GEOMETRY_STEPS + 1
    }

    pub(crate) fn reference(&self) -> &MonoLens {
        &self.reference
    }

    /// The depths that the bank covers, from the least to the largest, in dioptres.
    pub(crate) fn dioptre_range(&self) -> (f64, f64) {
        let knots = self.dioptres.knots();
        (knots[0], knots[knots.len() - 1])
    }

    /// What the bank was asked to cover.
    pub(crate) fn settings(&self) -> &BankSettings {
        &self.settings
    }

    /// The largest field that sees light, as its tangent.
    pub(crate) fn last_field_tan(&self) -> f64 {
        self.field_tans[self.field_tans.len() - 1]
    }

    /// Returns where centroids land and how bright they are, at one depth and wavelength.
    pub(crate) fn geometry(&self, dioptres: f64, wavelength_nm: f64) -> RadialGeometry {
        self.geometry_of(None, dioptres, wavelength_nm)
    }

    /// Returns where middle rays land and how bright places are, at one depth and wavelength.
    pub(crate) fn middle_geometry(&self, dioptres: f64, wavelength_nm: f64) -> RadialGeometry {
        self.geometry_of(Some(&self.middle_rays(dioptres, wavelength_nm)), dioptres, wavelength_nm)
    }

    fn geometry_of(&self, middle: Option<&MiddleRays>, dioptres: f64, wavelength_nm: f64) -> RadialGeometry {
        let n = self.geometry_fields.len();
        let mut magnification_mm = vec![0.0; n];
        let mut pupil_mm2 = vec![0.0; n];
        // Known at every wavelength, and less smooth over them than pupils are.
        let share = share_of_orders(&self.lens, self.within_colors(wavelength_nm));
        for (column, weight) in self.columns(dioptres, wavelength_nm) {
            for (i, summary) in self.summaries[column * n..][..n].iter().enumerate() {
                magnification_mm[i] += weight * summary.centroid_mm.x;
                pupil_mm2[i] += share * (weight * summary.pupil_mm2);
            }
        }
        if let Some(middle) = middle {
            let outwards = self.geometry_fields.iter().map(|field_tan| middle.over_tan_mm(*field_tan));
            magnification_mm.iter_mut().zip(outwards).for_each(|(centroid, outwards)| *centroid += outwards);
        }
        RadialGeometry::new(self.geometry_fields.clone(), magnification_mm, &pupil_mm2)
    }

    /// Returns where the rays through the middles of pupils land beside the centroids, at one depth and wavelength. Blended pictures lie
    /// centroid on centroid: for them it is nowhere else.
    pub(crate) fn middle_rays(&self, dioptres: f64, wavelength_nm: f64) -> MiddleRays {
        let ray = |&field_tan: &f64| MiddleRay { field_tan, ..MiddleRay::default() };
        let mut rays: Vec<MiddleRay> = self.field_tans.iter().map(ray).collect();
        if self.settings.interpolation == Interpolation::Rays {
            let (n, n_geometry) = (self.field_tans.len(), self.geometry_fields.len());
            for (column, weight) in self.columns(dioptres, wavelength_nm) {
                let (records, summaries) = (&self.records[column * n..][..n], &self.summaries[column * n_geometry..]);
                for (ray, (record, summary)) in
                    rays.iter_mut().zip(records.iter().zip(summaries.iter().step_by(GEOMETRY_STEPS)))
                {
                    ray.outwards_mm += weight * record.node(0).at_mm.x;
                    ray.radius_mm += weight * summary.centroid_mm.x * ray.field_tan;
                    ray.rms_mm += weight * summary.rms_mm;
                }
            }
        }
        MiddleRays::new(&rays)
    }

    /// Returns the signed radius of the circle of confusion, mm: above 0 for objects nearer than the focus.
    ///
    /// It is that of the part of the ray map that is linear in the pupil, scaled so that an even disc of this size
    /// has 95 % of its energy within it. So it goes smoothly through 0, where aberrations keep a spot from vanishing.
    pub(crate) fn blur_radius_mm(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> f64 {
        let n = self.geometry_fields.len();
        let at = field_tan.clamp(0.0, self.geometry_fields[n - 1]);
        let above = self.geometry_fields.partition_point(|&f| f < at).clamp(1.min(n - 1), n - 1);
        let below = above.saturating_sub(1);
        let [start, end, here] = [self.geometry_fields[below], self.geometry_fields[above], at].map(f64::atan);
        let fraction = if end > start { (here - start) / (end - start) } else { 0.0 };
        let rms: f64 = self
            .columns(dioptres, wavelength_nm)
            .map(|(column, weight)| {
                let row = &self.summaries[column * n..][..n];
                let (a, b) = (row[below].signed_rms_mm, row[above].signed_rms_mm);
                weight * (a + (b - a) * fraction)
            })
            .sum();
        rms * RIM_OVER_RMS
    }

    /// Returns how far from the centroid the farthest ray of a point lands, mm.
    pub(crate) fn extent_mm(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> f64 {
        let record = self.record(field_tan, dioptres, wavelength_nm);
        (0..record.mesh.n_nodes()).map(|i| record.node(i).at_mm.length()).fold(0.0, f64::max)
    }

    /// Returns the columns of samples (one field innermost) that a depth and wavelength draw on, with weights.
    pub(crate) fn columns(&self, dioptres: f64, wavelength_nm: f64) -> impl Iterator<Item = (usize, f64)> {
        let n_depths = self.dioptres.knots().len();
        let depths = self.dioptres.stencil(dioptres);
        let colors = self.color_stencil(wavelength_nm);
        let pairs: Vec<(usize, f64)> = colors
            .iter()
            .flat_map(|(c, wc)| depths.iter().map(move |(d, wd)| (c * n_depths + d, wc * wd)).collect::<Vec<_>>())
            .collect();
        pairs.into_iter()
    }

    /// Returns the interpolated waves of a point in a field along +x, or `None` if the bank has none.
    pub(crate) fn wave_map(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> Option<PupilFunctionFit> {
        if self.waves.is_empty() {
            return None;
        }
        let (n_fields, n_depths) = (self.fields.knots().len(), self.dioptres.knots().len());
        let fields = self.fields.cubic(field_tan.atan());
        let depths = self.dioptres.cubic(dioptres);
        let colors = self.colors.cubic(self.dispersion.coordinate(self.within_colors(wavelength_nm)));
        let mut weighted = Vec::with_capacity(64);
        for (c, wc) in colors.iter() {
            for (d, wd) in depths.iter() {
                let column = (c * n_depths + d) * n_fields;
                weighted.extend(fields.iter().map(|(f, wf)| (&self.waves[column + f], wc * wd * wf)));
            }
        }
        PupilFunctionFit::mix(weighted.into_iter())
    }

    /// Returns the fields with one more in the middle, in angle, of any two between which areas of pupils, interpolated as rays are, are off by more than a
    /// share of the largest, at some depth and wavelength; `None` if none are.
    ///
    /// Where a rim begins to cut the pupil its outline changes at once, and blurs have that outline: a uniform plane is off by as much as the area where their
    /// rms radius is a quarter of the way from one field to the next or more, and by less where they are narrower.
    pub(crate) fn fields_for_pupils(&self, most_off: f64) -> Option<Vec<f64>> {
        const WIDE: f64 = 0.25;
        let is_off = |column: &[RayMapMoments], knot: usize| {
            let largest_mm2 = column.iter().map(|summary| summary.pupil_mm2).fold(0.0, f64::max);
            let [inner, outer] = [knot, knot + 1].map(|knot| knot * GEOMETRY_STEPS);
            let radius_mm = |place: usize| column[place].centroid_mm.x * self.geometry_fields[place];
            let wide_mm = WIDE * (radius_mm(outer) - radius_mm(inner)).abs();
            (inner + 1..outer).any(|place| {
                let here = &column[place];
                let stencil = self.fields.stencil(self.geometry_fields[place].atan());
                let known = |(knot, weight): (usize, f64)| weight * column[knot * GEOMETRY_STEPS].pupil_mm2;
                let between_mm2: f64 = stencil.iter().map(known).sum();
                // How much of it is seen.
                let share = if here.rms_mm < wide_mm { here.rms_mm / wide_mm } else { 1.0 };
                share * (between_mm2 - here.pupil_mm2).abs() > most_off * largest_mm2
            })
        };
        let columns = || self.summaries.chunks(self.geometry_fields.len());
        let off = (0..self.n_fields() - 1).filter(|&knot| columns().any(|column| is_off(column, knot)));
        let middle = |knot: usize| (0.5 * (self.fields.knots()[knot] + self.fields.knots()[knot + 1])).tan();
        let more: Vec<f64> = off.map(middle).collect();
        (!more.is_empty()).then(|| {
            let mut fields = [radius(&self.settings), &more].concat();
            fields.sort_by(f64::total_cmp);
            fields
        })
    }

    pub(crate) fn record(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> RayMap {
        let n = self.fields.knots().len();
        let fields = self.fields.stencil(field_tan.atan());
        let weighted = self.columns(dioptres, wavelength_nm).flat_map(|(column, weight)| {
            fields.iter().map(|(f, w)| (&self.records[column * n + f], w * weight)).collect::<Vec<_>>()
        });
        RayMap::mix(weighted).expect("every stencil has a knot")
    }

    pub(crate) fn within_colors(&self, wavelength_nm: f64) -> f64 {
        let nm = &self.settings.wavelengths_nm;
        wavelength_nm.clamp(nm[0], nm[nm.len() - 1])
    }

    fn color_stencil(&self, wavelength_nm: f64) -> Stencil {
        self.colors.stencil(self.dispersion.coordinate(self.within_colors(wavelength_nm)))
    }

    pub(crate) fn stop_index(&self, wavelength_nm: f64) -> f64 {
        self.color_stencil(wavelength_nm).iter().map(|(i, weight)| weight * self.stop_indices[i]).sum()
    }
}

/// What was traced, in the order of the bank.
#[derive(Default)]
struct Parts {
    n_fields: usize,
    is_scattered_beyond: bool,
    is_dark_beyond: bool,
    /// Fields beyond the last ones, over which the light ends.
    rim_fields: Vec<f64>,
    records: Vec<RayMap>,
    /// Of geometry and rim.
    summaries: Vec<RayMapMoments>,
    /// As many as there are records, or none.
    waves: Vec<PupilFunctionFit>,
}

/// All fields of one depth and wavelength.
#[derive(Default)]
struct Column {
    records: Vec<RayMap>,
    summaries: Vec<RayMapMoments>,
    /// Up to the first field whose waves are not smooth.
    waves: Vec<PupilFunctionFit>,
    /// Whether it ends at a field whose light is not gathered.
    is_scattered_beyond: bool,
    /// Whether all its fields see light, and the next would not.
    is_dark_beyond: bool,
    /// Of the last field that sees light.
    last_pupil: Option<Pupil>,
}

/// How columns are traced.
struct ColumnTracer<'a> {
    settings: &'a BankSettings,
    reference: &'a MonoLens,
    geometry_fields: &'a [f64],
    mesh: Mesh,
    seed: Pupil,
    watch: Watch<'a>,
}

impl ColumnTracer<'_> {
    fn task<'a>(&'a self, lens: &'a MonoLens, field_tan: f64, dioptres: f64) -> RayMapJob<'a> {
        RayMapJob {
            lens,
            reference: self.reference,
            field_tan: DVec2::new(field_tan, 0.0),
            dioptres,
            film_distance_mm: self.settings.film_distance_mm,
            mesh: self.mesh,
        }
    }

    /// Traces field by field, up to the first that sees no light or whose light is not gathered.
    fn column(&self, lens: &MonoLens, dioptres: f64) -> Result<Column, Cancelled> {
        let has_stop = self.settings.diffraction != Diffraction::None;
        let mut column = Column::default();
        let mut pupil = self.seed.clone();
        let mut has_waves = self.settings.diffraction == Diffraction::Wave;
        for (i, &field) in self.geometry_fields.iter().enumerate() {
            self.watch.check()?;
            let is_knot = i % GEOMETRY_STEPS == 0;
            let here = self.task(lens, field, dioptres);
            let Some(found) = pupil.near(lens, &here.point()) else { break };
            pupil = found;
            let Some(traced) = here.trace(&pupil, has_stop && is_knot) else { break };
            let mut summary = traced.summary;
            // Height over field has its limit on the axis.
            summary.centroid_mm /= field;
            if i == 0 {
                let last = radius(self.settings).last().copied();
                let near_axis = (NEAR_AXIS * last.filter(|f| *f > 0.0).unwrap_or(0.1).atan()).tan();
                let beside = self.task(lens, near_axis, dioptres);
                let Some(nearby) = pupil.near(lens, &beside.point()) else { break };
                let Some(beside) = beside.trace(&nearby, false) else { break };
                summary.centroid_mm = beside.summary.centroid_mm / near_axis;
            }
            let axial = column.summaries.first().unwrap_or(&traced.summary);
            if !is_gathered(traced.summary.rms_mm, axial.rms_mm, traced.summary.centroid_mm.length()) {
                column.is_scattered_beyond = true;
                break;
            }
            column.summaries.push(summary);
            self.watch.done(1);
            if !is_knot {
                continue;
            }
            column.records.push(traced.record(self.mesh, has_stop));
            if has_waves {
                let map = wave_map(&here, &pupil);
                has_waves = map.is_some();
                column.waves.extend(map);
            }
        }
        if let (Some(axial), true) = (column.summaries.first(), column.summaries.len() == self.geometry_fields.len()) {
            let last_tan = self.geometry_fields[self.geometry_fields.len() - 1];
            let traced = |share: f64| {
                let beyond = self.task(lens, last_tan * (1.0 + share), dioptres);
                pupil.near(lens, &beyond.point()).and_then(|pupil| beyond.trace(&pupil, false))
            };
            column.is_dark_beyond = last_tan > 0.0 && traced(2.0 * BEFORE_DARK).is_none();
            column.is_scattered_beyond = traced(BEYOND_LAST).is_some_and(|Traced { summary, .. }| {
                !is_gathered(summary.rms_mm, axial.rms_mm, summary.centroid_mm.length())
            });
        }
        self.watch.done(self.geometry_fields.len() - column.summaries.len());
        column.last_pupil = Some(pupil);
        Ok(column)
    }

    /// Traces fields beyond the last of a column, one after the other. Of those without light the image goes on straight, with a pupil of no area.
    fn rim(&self, fields: &[f64], (lens, dioptres): (&MonoLens, f64), column: &Column) -> Vec<RayMapMoments> {
        let mut pupil = column.last_pupil.clone();
        let mut known: Vec<(f64, RayMapMoments)> =
            self.geometry_fields.iter().copied().zip(column.summaries.iter().copied()).collect();
        let n_known = known.len();
        for &field in fields {
            let here = self.task(lens, field, dioptres);
            pupil = pupil.and_then(|pupil| pupil.near(lens, &here.point()));
            let traced = pupil.as_ref().and_then(|pupil| here.trace(pupil, false));
            let summary = traced
                .map(|Traced { summary, .. }| RayMapMoments { centroid_mm: summary.centroid_mm / field, ..summary });
            pupil = pupil.filter(|_| summary.is_some());
            known.push((field, summary.unwrap_or_else(|| dark_beyond(&known, field))));
        }
        known.split_off(n_known).into_iter().map(|(_, summary)| summary).collect()
    }
}

/// Returns what stands for a field beyond others, of which heights over fields are known: it lies where the image goes on straight, and has no light.
fn dark_beyond(known: &[(f64, RayMapMoments)], field: f64) -> RayMapMoments {
    let [.., (inner, before), (last, at)] = known else { return RayMapMoments::default() };
    let (height_before, height_mm) = (before.centroid_mm * *inner, at.centroid_mm * *last);
    let goes_on_mm = height_mm + (height_mm - height_before) * ((field - last) / (last - inner));
    RayMapMoments { centroid_mm: goes_on_mm / field, pupil_mm2: 0.0, ..*at }
}

/// Returns the waves of a point, if they are smooth over its pupil and that has no holes.
fn wave_map(task: &RayMapJob<'_>, pupil: &Pupil) -> Option<PupilFunctionFit> {
    if task.lens.n_obscurations() > 0 {
        return None;
    }
    let point = task.point();
    let pupil = pupil.resampled(WAVE_AZIMUTHS).near(task.lens, &point)?;
    let edge = PupilOutline { center_x_mm: pupil.center_mm.x, z_mm: pupil.z_mm, rho_mm: &pupil.rho_mm };
    PupilFunctionFit::trace(task.lens, &point, task.film_distance_mm, edge).ok()
}

/// Returns the fields of settings for a lens with an axis of symmetry.
fn radius(settings: &BankSettings) -> &[f64] {
    match &settings.fields {
        FieldSampling::Radial(tans) => tans,
        FieldSampling::Grid { .. } | FieldSampling::Points { .. } => unreachable!("another model samples these"),
    }
}

/// Returns fields beyond the last one of a model that ends just before the light does: up to where the dark is looked for.
fn rim_fields(last_tan: f64) -> Vec<f64> {
    const N: usize = 8;
    (1..=N).map(|i| last_tan * (1.0 + 2.0 * BEFORE_DARK * i as f64 / N as f64)).collect()
}

/// Returns the fields with others between them, evenly in angle.
fn geometry_fields(field_tans: &[f64]) -> Vec<f64> {
    let mut fields = vec![field_tans[0]];
    for pair in field_tans.windows(2) {
        let (start, end) = (pair[0].atan(), pair[1].atan());
        let step = (end - start) / GEOMETRY_STEPS as f64;
        fields.extend((1..GEOMETRY_STEPS).map(|i| (start + step * i as f64).tan()));
        fields.push(pair[1]);
    }
    fields
}
