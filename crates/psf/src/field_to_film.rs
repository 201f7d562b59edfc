//! Between a grid of fields and the film, both ways: where each field lands, and which is seen at each place.

use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    FieldGeometry, Kernel, PsfError, PsfQuery,
    dark_fields::StandIn,
    field_geometry::{Area, Landed, Landing},
    gathering::BEFORE_DARK,
    general::GeneralBank,
    lit_fields::LitFields,
    ray_map::RayMap,
};

/// Where the fields of a [`GeneralBank`] land on the film, and which field is seen at each place.
///
/// Where light ends within the fields, pupils are known up to there, and images of fields just before it stand for those of dark ones: their centroids go on
/// straight outwards. Where such an image is not found the nearest lit field stands for a dark one.
#[derive(Clone, Debug)]
pub(crate) struct FieldToFilm {
    // Invariant: all lists are indexed as the bank's samples are: by (wavelength, depth, y, x), x innermost, or the first two.
    /// For each sample the one that stands for it: itself where it is lit.
    nearest_lit: Vec<usize>,
    centroids_mm: Vec<DVec2>,
    pupils_mm2: Vec<f64>,
    /// One a wavelength and depth.
    geometries: Vec<FieldGeometry>,
}

impl FieldToFilm {
    /// Tabulates the way back from the film. Images that stand for those of dark fields are added to the bank's samples, behind all others.
    ///
    /// # Errors
    /// When the bank has fewer than two lit fields each way at some depth and wavelength, or the work was cancelled.
    pub(crate) fn new(bank: &mut GeneralBank, cancel: &Cancel) -> Result<Self, PsfError> {
        let stand_ins = StandIn::of_dark(bank, cancel)?;
        let (n_x, n_y) = (bank.x.knots().len(), bank.y.knots().len());
        let n_plane = n_x * n_y;
        let (mut nearest_lit, mut centroids_mm, mut pupils_mm2) = (vec![], vec![], vec![]);
        for (plane, samples) in bank.samples.chunks_exact(n_plane).enumerate() {
            cancel.check()?;
            let lit: Vec<Option<DVec2>> =
                samples.iter().map(|sample| Some(sample.as_ref()?.summary.centroid_mm)).collect();
            let stand_in = |at: usize| stand_ins.get(plane * n_plane + at)?.as_ref();
            let known = lit.iter().enumerate().map(|(at, lit)| lit.or_else(|| Some(stand_in(at)?.centroid_mm)));
            let Some(whole) = straight_on(known.collect(), n_x) else {
                let dioptres = bank.settings().dioptres[plane % bank.settings().dioptres.len()];
                let nm = &bank.settings().wavelengths_nm;
                let wavelength_nm = nm[nm.len() - 1 - plane / bank.settings().dioptres.len()];
                return Err(PsfError::Dark { lens: bank.lens().name().to_owned(), dioptres, wavelength_nm });
            };
            centroids_mm.extend(whole);
            nearest_lit.extend((0..n_plane).map(|at| plane * n_plane + nearest(&lit, at, n_x)));
            pupils_mm2.extend(samples.iter().map(|s| s.as_ref().map_or(0.0, |s| s.summary.pupil_mm2)));
        }
        for (at, stand_in) in stand_ins.into_iter().enumerate() {
            let Some(stand_in) = stand_in else { continue };
            nearest_lit[at] = bank.samples.len();
            bank.samples.push(Some(stand_in.sample));
        }
        let bank = &*bank;
        let mut this = Self { nearest_lit, centroids_mm, pupils_mm2, geometries: vec![] };
        let area = Area::around(this.centroids_mm.iter().copied(), n_x.max(n_y)).expect("there are samples");
        let n_planes = this.centroids_mm.len() / n_plane;
        let inverse = |plane| this.landing(bank, [(plane, 1.0)].into_iter()).inverse(area, cancel);
        this.geometries = (0..n_planes).into_par_iter().map(inverse).collect::<Result<_, Cancelled>>()?;
        Ok(this)
    }

    /// For each sample of the bank the one that stands for it: itself where it is lit.
    pub(crate) fn nearest_lit(&self) -> &[usize] {
        &self.nearest_lit
    }

    /// Whether no light from beyond the fields of the bank lands on a part of the film, at any depth and wavelength: those at their rim are dark, or land off it.
    ///
    /// The part is given by its corners left below and right above, mm; `None` is a film without an end.
    pub(crate) fn is_dark_beyond(&self, bank: &GeneralBank, film_mm: Option<(DVec2, DVec2)>) -> bool {
        let (n_x, n_y) = (bank.x.knots().len(), bank.y.knots().len());
        let n_plane = n_x * n_y;
        let is_rim = |row: usize, column: usize| row == 0 || column == 0 || row == n_y - 1 || column == n_x - 1;
        let lands_on_film = |at_mm: DVec2| {
            film_mm.is_none_or(|(low_mm, high_mm)| at_mm.cmpge(low_mm).all() && at_mm.cmple(high_mm).all())
        };
        let is_dark = |at: usize| {
            let field_tan = DVec2::new(bank.x.knots()[at % n_x], bank.y.knots()[at / n_x % n_y]);
            // Light ends a little beyond the last pupil that is found.
            let is_ended = |lit: &Vec<LitFields>| {
                let lit = &lit[at / n_plane];
                lit.is_dark_at(lit.middle_tan().lerp(field_tan, 1.0 + BEFORE_DARK))
            };
            bank.lit_fields.as_ref().map_or(self.pupils_mm2[at] == 0.0, is_ended)
        };
        (0..self.pupils_mm2.len())
            .filter(|at| is_rim(at / n_x % n_y, at % n_x))
            .all(|at| is_dark(at) || !lands_on_film(self.centroids_mm[at]))
    }

    /// Returns which field is seen where on the film, and how bright, at one depth and wavelength.
    pub(crate) fn geometry(&self, bank: &GeneralBank, dioptres: f64, wavelength_nm: f64) -> FieldGeometry {
        let planes = bank.planes(dioptres, wavelength_nm);
        let all_light = FieldGeometry::mix(planes.iter().map(|&(plane, weight)| (&self.geometries[plane], weight)));
        all_light.expect("every stencil has a knot").with_share(bank.share_of_orders(wavelength_nm))
    }

    /// Returns where the centroid of a point lands, mm, picture frame.
    pub(crate) fn centroid_mm(&self, bank: &GeneralBank, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> DVec2 {
        self.landed(bank, field_tan, dioptres, wavelength_nm).at_mm
    }

    /// Returns irradiance on the film over radiance of a locally uniform scene, sr, as [`FieldGeometry::at`] does.
    pub(crate) fn irradiance_per_radiance(
        &self,
        bank: &GeneralBank,
        field_tan: DVec2,
        dioptres: f64,
        wavelength_nm: f64,
    ) -> f64 {
        self.landed(bank, field_tan, dioptres, wavelength_nm).irradiance_per_radiance()
    }

    fn landed(&self, bank: &GeneralBank, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Landed {
        let mut landed = self.landing(bank, bank.planes(dioptres, wavelength_nm).into_iter()).of(field_tan);
        landed.pupil_mm2 *= bank.share_of_orders(wavelength_nm);
        landed
    }

    /// Returns where the fields land in a weighted sum of depths and wavelengths.
    fn landing<'a>(&self, bank: &'a GeneralBank, planes: impl Iterator<Item = (usize, f64)>) -> Landing<'a> {
        let (x, y) = (&bank.x, &bank.y);
        let n = x.knots().len() * y.knots().len();
        let (mut centroids_mm, mut pupils_mm2) = (vec![DVec2::ZERO; n], vec![0.0; n]);
        let planes: Vec<(usize, f64)> = planes.collect();
        let lit_fields = bank.lit_fields.as_ref();
        let lit_fields =
            lit_fields.and_then(|lit| LitFields::mix(planes.iter().map(|&(plane, weight)| (&lit[plane], weight))));
        for (plane, weight) in planes {
            for at in 0..n {
                centroids_mm[at] += self.centroids_mm[plane * n + at] * weight;
                pupils_mm2[at] += self.pupils_mm2[plane * n + at] * weight;
            }
        }
        Landing { x, y, centroids_mm, pupils_mm2, lit_fields }
    }

    /// Returns the point spread function of a point about its centroid; of a dark one that of a lit field near by.
    pub(crate) fn kernel(&self, bank: &GeneralBank, query: PsfQuery) -> Kernel {
        let PsfQuery { field_tan, dioptres, wavelength_nm, .. } = query;
        bank.kernel_of(&self.record(bank, field_tan, dioptres, wavelength_nm), query).0
    }

    /// Returns the ray map of a point; of a dark one that of a lit field near by.
    pub(crate) fn record(&self, bank: &GeneralBank, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> RayMap {
        let samples = bank.lit_samples(Some(&self.nearest_lit), field_tan, dioptres, wavelength_nm);
        let record = RayMap::mix(samples.map(|(sample, weight)| (&sample.record, weight)));
        record.expect("every stencil has a knot")
    }
}

/// Returns the index of the lit sample nearest to one on a grid of this many columns.
fn nearest(lit: &[Option<DVec2>], at: usize, n_columns: usize) -> usize {
    let place = |i: usize| ((i / n_columns) as i64, (i % n_columns) as i64);
    let (row, column) = place(at);
    let square = |i: usize| (place(i).0 - row).pow(2) + (place(i).1 - column).pow(2);
    (0..lit.len()).filter(|&i| lit[i].is_some()).min_by_key(|&i| square(i)).unwrap_or(at)
}

/// Fills the gaps of a grid of places by going on straight from two neighbors in a line, or returns `None` where there are
/// no two.
fn straight_on(mut places: Vec<Option<DVec2>>, n_columns: usize) -> Option<Vec<DVec2>> {
    let n_rows = places.len() / n_columns;
    while places.iter().any(Option::is_none) {
        let at = |row: i64, column: i64| {
            let is_inside = (0..n_rows as i64).contains(&row) && (0..n_columns as i64).contains(&column);
            is_inside.then(|| places[row as usize * n_columns + column as usize]).flatten()
        };
        let filled: Vec<Option<DVec2>> = (0..places.len())
            .map(|i| {
                let (row, column) = ((i / n_columns) as i64, (i % n_columns) as i64);
                let ways = [(0, 1), (0, -1), (1, 0), (-1, 0)];
                let found: Vec<DVec2> = ways
                    .into_iter()
                    .filter_map(|(down, right)| {
                        let near = at(row + down, column + right)?;
                        Some(2.0 * near - at(row + 2 * down, column + 2 * right)?)
                    })
                    .collect();
                places[i].or_else(|| (!found.is_empty()).then(|| found.iter().sum::<DVec2>() / found.len() as f64))
            })
            .collect();
        if filled == places {
            return None;
        }
        places = filled;
    }
    places.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_filled_straight_on() {
        let place = |i: usize| DVec2::new((i % 4) as f64, 10.0 * (i / 4) as f64);
        let mut places: Vec<Option<DVec2>> = (0..12).map(|i| Some(place(i))).collect();
        for gap in [3, 7, 11, 2] {
            places[gap] = None;
        }
        let whole = straight_on(places.clone(), 4).unwrap();
        assert!(whole.iter().enumerate().all(|(i, at)| (*at - place(i)).length() < 1e-12), "{whole:?}");
        assert_eq!(nearest(&places, 3, 4), 6);
        assert_eq!(nearest(&places, 11, 4), 10);
        assert_eq!(straight_on(vec![None, Some(DVec2::ONE), None, None], 2), None);
    }
}
