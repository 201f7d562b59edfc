//! The image of a lens through a part of its pupil.

use std::{f64::consts::TAU, sync::Arc};

use glam::DVec2;

use crate::{
    Diffraction, FieldSampling, FilmMap, Interpolation, Kernel, LensImage, LensImageModel, PartOfPoint, PsfError,
    PsfQuery, ShiftedMap,
    axis::{Axis, Stencil},
    mesh::Mesh,
    pupil_division::PupilDivision,
    ray_map::RayMap,
    render,
};

/// Directions of the field in which a part of the pupil of a lens with an axis is measured.
const N_DIRECTIONS: usize = 32;

/// The image that a lens forms through a part of its pupil: a view from that part, blurred by what is left of its width.
///
/// The images through all parts add up to that of the whole pupil. Blur radii are those of the whole, so that all parts
/// are imaged in the same layers of depth.
#[derive(Clone, Debug)]
pub(crate) struct PartImage {
    model: Arc<LensImageModel>,
    division: Arc<PupilDivision>,
    part: usize,
    moments: Moments,
}

/// What goes through a part of the pupil, of each sample of the model.
#[derive(Clone, Debug)]
struct Moments {
    /// Share of the light, and the sum of its places about the centroid of the whole (picture frame of a field along +x for a lens
    /// with an axis), each times its energy, mm. For each sample of the model the directions of the field, innermost: one for a
    /// lens without an axis.
    of_samples: Vec<(f64, DVec2)>,
    n_directions: usize,
}

impl PartImage {
    /// Returns the images through the parts of the pupil of a lens.
    ///
    /// # Errors
    /// For diffraction integrals, which parts of a pupil do not add up to; for blended pictures, and where fields are single points.
    pub(crate) fn all(model: &LensImageModel, division: PupilDivision) -> Result<Vec<Self>, PsfError> {
        let settings = model.settings();
        let refused = |reason| Err(PsfError::Undividable { reason });
        if settings.diffraction == Diffraction::Wave {
            return refused("its waves interfere: take HURB or no diffraction");
        }
        if settings.interpolation == Interpolation::Images {
            return refused("pictures are blended: take interpolated rays");
        }
        if matches!(settings.fields, FieldSampling::Points { .. }) {
            return refused("its fields are single points: take fields along a radius or over a grid");
        }
        let (model, division) = (Arc::new(model.clone()), Arc::new(division));
        let image = |part: usize| {
            let moments = Moments::of(&model, &division, part);
            Self { model: model.clone(), division: division.clone(), part, moments }
        };
        Ok((0..division.n_parts()).map(image).collect())
    }

    /// Returns what the part does to the points of a depth and wavelength.
    fn points(&self, dioptres: f64, wavelength_nm: f64) -> Points {
        let n_directions = self.moments.n_directions;
        let mixed = |columns: &[(usize, f64)], n_fields: usize, stand_in: &dyn Fn(usize) -> usize| {
            let n = n_fields * n_directions;
            let mut sums = vec![(0.0, DVec2::ZERO); n];
            for &(column, weight) in columns {
                for (field, sums) in sums.chunks_exact_mut(n_directions).enumerate() {
                    let sample = stand_in(column * n_fields + field);
                    let moments = &self.moments.of_samples[sample * n_directions..][..n_directions];
                    for (sum, (share, places_mm)) in sums.iter_mut().zip(moments) {
                        *sum = (sum.0 + weight * share, sum.1 + weight * *places_mm);
                    }
                }
            }
            sums
        };
        match self.model.form() {
            Ok(bank) => {
                let columns: Vec<(usize, f64)> = bank.columns(dioptres, wavelength_nm).collect();
                let fields = bank.field_axis().clone();
                let moments = mixed(&columns, fields.knots().len(), &|sample| sample);
                let axis_tan = self.model.decenter().axis_tan(dioptres);
                Points { fields: FieldAxes::Radial { fields, axis_tan }, moments }
            }
            Err(bank) => {
                let nearest = self.model.nearest_lit();
                let (x, y) = (bank.x.clone(), bank.y.clone());
                let n_fields = x.knots().len() * y.knots().len();
                let moments = mixed(&bank.planes(dioptres, wavelength_nm), n_fields, &|sample| {
                    nearest.map_or(sample, |nearest| nearest[sample])
                });
                Points { fields: FieldAxes::Grid { x, y }, moments }
            }
        }
    }
}

impl Moments {
    fn of(model: &LensImageModel, division: &PupilDivision, part: usize) -> Self {
        let n_directions = if model.form().is_ok() { N_DIRECTIONS } else { 1 };
        let turns: Vec<DVec2> =
            (0..n_directions).map(|i| DVec2::from_angle(TAU * i as f64 / n_directions as f64)).collect();
        let shares_of = |mesh: Mesh| -> Vec<Vec<f64>> {
            turns.iter().map(|turn| division.cell_shares(part, mesh, *turn)).collect()
        };
        // Mostly all have one mesh.
        let mut known: Vec<(Mesh, Vec<Vec<f64>>)> = vec![];
        let mut of_record = |record: &RayMap| -> Vec<(f64, DVec2)> {
            if !known.iter().any(|(mesh, _)| *mesh == record.mesh) {
                known.push((record.mesh, shares_of(record.mesh)));
            }
            let (_, shares) = known.iter().find(|(mesh, _)| *mesh == record.mesh).expect("it was added");
            shares.iter().map(|shares| record.part_moments(shares)).collect()
        };
        let of_samples = match model.form() {
            Ok(bank) => bank.records().iter().flat_map(&mut of_record).collect(),
            // Dark fields have others that stand for them.
            Err(bank) => bank
                .samples
                .iter()
                .flat_map(|sample| sample.as_ref().map_or_else(|| vec![(0.0, DVec2::ZERO)], |s| of_record(&s.record)))
                .collect(),
        };
        Self { of_samples, n_directions }
    }
}

/// What a part does to the points of one depth and wavelength.
struct Points {
    fields: FieldAxes,
    /// For each field, its directions innermost.
    moments: Vec<(f64, DVec2)>,
}

/// The fields that were sampled.
enum FieldAxes {
    /// Angles along a radius about a field, and directions.
    Radial { fields: Axis, axis_tan: DVec2 },
    /// Tangents.
    Grid { x: Axis, y: Axis },
}

impl Points {
    /// Returns what the part does to the point of a field of the scene, by cubics between the samples.
    fn at(&self, field_tan: DVec2) -> PartOfPoint {
        match &self.fields {
            FieldAxes::Radial { fields, axis_tan } => {
                let field_tan = field_tan - *axis_tan;
                let turn = field_tan.try_normalize().unwrap_or(DVec2::X);
                let directions = around(turn.to_angle());
                let radial = fields.cubic(field_tan.length().atan());
                let part = self.mixed(radial.iter().flat_map(|(field, weight)| {
                    directions.iter().map(move |(direction, w)| (field * N_DIRECTIONS + direction, weight * w))
                }));
                PartOfPoint { shift_mm: turn.rotate(part.shift_mm), ..part }
            }
            FieldAxes::Grid { x, y } => {
                let n_x = x.knots().len();
                let (across, up): (Stencil, Stencil) = (x.cubic(field_tan.x), y.cubic(field_tan.y));
                let columns: Vec<(usize, f64)> = across.iter().collect();
                self.mixed(up.iter().flat_map(|(row, wy)| {
                    columns.iter().map(move |(column, wx)| (row * n_x + column, wy * wx)).collect::<Vec<_>>()
                }))
            }
        }
    }

    /// Returns how far the centroid of a part lies from that of the whole at most, mm.
    fn most_aside_mm(&self) -> f64 {
        let lit = self.moments.iter().filter(|(share, _)| *share > 1e-6);
        lit.map(|(share, places_mm)| places_mm.length() / share).fold(0.0, f64::max)
    }

    fn mixed(&self, weighted: impl Iterator<Item = (usize, f64)>) -> PartOfPoint {
        let (mut share, mut places_mm) = (0.0, DVec2::ZERO);
        for (sample, weight) in weighted {
            share += weight * self.moments[sample].0;
            places_mm += weight * self.moments[sample].1;
        }
        // Cubics swing a little below 0 where a part has no light.
        let shift_mm = if share > 0.0 { places_mm / share } else { DVec2::ZERO };
        PartOfPoint { share: share.max(0.0), shift_mm }
    }
}

/// Returns Lagrange's cubic weights of the four directions about an angle.
fn around(angle: f64) -> [(usize, f64); 4] {
    let place = angle.rem_euclid(TAU) * N_DIRECTIONS as f64 / TAU;
    let (below, u) = (place.floor(), place.fract());
    let weights = [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ];
    std::array::from_fn(|i| ((below as usize + N_DIRECTIONS + i - 1) % N_DIRECTIONS, weights[i]))
}

impl LensImage for PartImage {
    fn is_symmetric(&self) -> bool {
        false
    }

    fn wavelengths_nm(&self) -> (f64, f64) {
        self.model.wavelengths_nm()
    }

    fn dioptres(&self) -> (f64, f64) {
        LensImage::dioptres(self.model.as_ref())
    }

    fn is_dark_beyond_extent(&self) -> bool {
        self.model.is_dark_beyond_extent()
    }

    fn is_dark_beyond_extent_on(&self, low_mm: DVec2, high_mm: DVec2) -> bool {
        self.model.is_dark_beyond_extent_on(low_mm, high_mm)
    }

    fn film_map(&self, dioptres: f64, wavelength_nm: f64, extent_mm: f64) -> FilmMap {
        let points = self.points(dioptres, wavelength_nm);
        let whole = self.model.film_map(dioptres, wavelength_nm, extent_mm + points.most_aside_mm());
        FilmMap::Shifted(ShiftedMap::tabulate(whole, extent_mm, |field_tan| points.at(field_tan)))
    }

    fn kernel(&self, query: PsfQuery) -> Kernel {
        let (record, turn) = self.model.record(query);
        let Some(record) = record.part(&self.division.cell_shares(self.part, record.mesh, turn)) else {
            return Kernel::identity(query.pitch_um);
        };
        let layout = self.model.ray_layout(&record, query);
        let lambda_n_px = layout.lambda_n_px();
        render::kernel(&layout.draw(), lambda_n_px, query.pitch_um)
    }

    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.model.blur_radius_mm(field_tan, dioptres, wavelength_nm)
    }

    fn spread_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.model.spread_mm(field_tan, dioptres, wavelength_nm)
    }
}
