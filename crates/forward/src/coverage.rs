//! The sampling of point spread functions that a scene and a film need.

use std::cell::OnceCell;

use dioptric_optics::{FilmPoint, Lens, MonoLens, ObjectPoint, OpticsError, PupilBoundary, Vignetting, rays_towards};
use dioptric_psf::{BankSettings, Diffraction, GatheredFields, LitFields, WIDEST_FIELD_TAN, lens_on_axis};
use dioptric_spectrum::{DepthMap, WavelengthGrid};
use glam::{DMat2, DVec2};
use rayon::prelude::*;

use crate::{Film, ForwardError};

/// What the model of a lens's image must cover, and through which lens.
#[derive(Clone, Copy, Debug)]
pub struct PsfDomain<'a> {
    /// The lens, its stop set.
    pub lens: &'a Lens,
    /// The film.
    pub film: &'a Film,
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// Nearest and farthest depth of the scene, m; the farthest may be infinite.
    pub depth_range_m: (f64, f64),
    /// The bands.
    pub grid: &'a WavelengthGrid,
    /// How diffraction is taken into account.
    pub diffraction: Diffraction,
}

/// How far beyond the film fields are sampled, over the radius of the blur at the axis and at the film's corners: the border of the film is
/// blurred by light from beyond it, and kernels there are between those at knots farther out.
const BORDER_OF_BLUR: f64 = 1.5;

/// The tangent of the widest fields of a grid, of 78.7°: farther out the tangents of a fisheye's fields follow no cubic. Its images, tilted, between samples are
/// 2 % off with this limit, 6 % with 8, 21 % with 12, and nothing is left of the picture at 89°.
const WIDEST_OF_GRID_TAN: f64 = 5.0;

/// How far a grid reaches beyond the last lit fields, over half of what they span: two squares of the coarsest table, of 64 each way, over the lit fields.
const BEYOND_LIT: f64 = 2.0 * 2.0 / 64.0;

impl PsfDomain<'_> {
    /// Returns the farthest and nearest depth, dioptres.
    fn dioptres(&self) -> Result<(f64, f64), ForwardError> {
        let (near_m, far_m) = self.depth_range_m;
        if near_m > 0.0 && near_m <= far_m {
            return Ok((1.0 / far_m, 1.0 / near_m));
        }
        let (what, value) = ("the nearest depth", near_m);
        Err(ForwardError::Setting { what, value, expected: "above 0 and no larger than the farthest, m" })
    }

    /// Returns what is found of the lens at the ends of the wavelengths, looking at the ends of the depths.
    fn at_ends<T: Send>(
        &self,
        look: impl Fn(&Aim<'_>) -> Result<T, ForwardError> + Sync,
    ) -> Result<Vec<T>, ForwardError> {
        let (far, near) = self.dioptres()?;
        let (first_nm, last_nm) = self.grid.range_nm();
        let BankSettings { reference_wavelength_nm, .. } =
            BankSettings::covering(self.film_distance_mm, 0.0, (far, near), (first_nm, last_nm), self.diffraction);
        let reference = self.lens.at(reference_wavelength_nm)?;
        let lenses = [self.lens.at(first_nm)?, self.lens.at(last_nm)?];
        let ends: Vec<(&MonoLens, f64)> = lenses.iter().flat_map(|lens| [(lens, far), (lens, near)]).collect();
        let looked: Vec<Result<T, ForwardError>> = ends
            .par_iter()
            .map(|&(lens, dioptres)| {
                let (film_distance_mm, film_center_mm) = (self.film_distance_mm, DVec2::ZERO);
                look(&Aim { lens, reference: &reference, dioptres, film_distance_mm, film_center_mm })
            })
            .collect();
        // The first of several errors, whoever found it first.
        looked.into_iter().collect()
    }

    /// Returns the settings of a model that serves a scene on a film, whatever the symmetry of the lens: standard numbers of
    /// samples, of which [`BankSettings::with_counts`] makes others.
    ///
    /// # Errors
    /// When the film has no area, the lens has no index at a wavelength of the grid, or no light reaches the middle of the film.
    pub fn settings(&self) -> Result<BankSettings, ForwardError> {
        check_depth(self.lens, self.grid, self.depth_range_m.0, None)?;
        let has_axis = lens_on_axis(self.lens, self.middle_nm()).is_some();
        if has_axis { self.radial_settings() } else { self.grid_settings() }
    }

    fn middle_nm(&self) -> f64 {
        let (first_nm, last_nm) = self.grid.range_nm();
        0.5 * (first_nm + last_nm)
    }

    /// Returns such settings for a lens with an axis of symmetry, on the axis or moved sideways: fields along a radius to beyond
    /// the film's farthest corner, depths from end to end in dioptres, wavelengths evenly in 1/λ².
    ///
    /// # Errors
    /// When the film has no area, or the lens has no index at a wavelength of the grid or is not rotationally symmetric.
    pub fn radial_settings(&self) -> Result<BankSettings, ForwardError> {
        self.film.check()?;
        let has_none = || OpticsError::NotRotational {
            lens: self.lens.name().to_owned(),
            task: "a bank of point spread functions over field angle alone",
        };
        let (centered, aside_mm) = lens_on_axis(self.lens, self.middle_nm()).ok_or_else(has_none)?;
        // A lens moved aside has its axis on the other side of the picture.
        let corner_mm = self.film.half_diagonal_mm() + (self.film.center_mm + aside_mm).length();
        let domain = PsfDomain { lens: &centered, ..*self };
        let fields_tan = domain.at_ends(|aim| {
            let corner_blur_mm = aim.blur_mm(DVec2::X * aim.field_tan_at(corner_mm));
            let sampled_mm = 1.02 * corner_mm + BORDER_OF_BLUR * aim.axial_blur_mm();
            Ok(aim.field_tan_at(sampled_mm.max(corner_mm + BORDER_OF_BLUR * corner_blur_mm)))
        })?;
        let wanted_tan = fields_tan.into_iter().fold(0.0, f64::max);
        // Up to the last that sees light: of fields that end beyond it a whole step would be dark.
        let shares = domain.at_ends(|aim| {
            let gathered = aim.gathered_about(DVec2::ZERO);
            Ok(gathered.map_or(1.0, |gathered| gathered.largest_lit_share(DVec2::X * wanted_tan)))
        })?;
        let last_field_tan = shares.into_iter().fold(wanted_tan, |least, share| least.min(share * wanted_tan));
        let (dioptres, wavelengths_nm) = (self.dioptres()?, self.grid.range_nm());
        Ok(BankSettings::covering(self.film_distance_mm, last_field_tan, dioptres, wavelengths_nm, self.diffraction))
    }

    /// Returns such settings for any lens: a grid of fields to beyond the film's sides, the rest as
    /// [`radial_settings`](Self::radial_settings) does.
    ///
    /// # Errors
    /// When the film has no area, the lens has no index at a wavelength of the grid, or no light reaches the middle of the film.
    pub fn grid_settings(&self) -> Result<BankSettings, ForwardError> {
        self.film.check()?;
        let half_mm = self.film.half_size_mm();
        // Where lens and film are their own mirror images, so are the fields.
        let center_mm = self.film.center_mm;
        let symmetries = self.lens.mirror_symmetries();
        let is_mirrored = [0, 1].map(|axis| symmetries[axis] && center_mm[axis] == 0.0);
        let kept = DVec2::from(is_mirrored.map(|is_mirrored| if is_mirrored { 0.0 } else { 1.0 }));
        let ends = self.at_ends(|aim| {
            let aim = Aim { film_center_mm: center_mm, ..*aim };
            let wavelength_nm = aim.lens.wavelength_nm();
            let dark = || ForwardError::DarkFilm { lens: self.lens.name().to_owned(), wavelength_nm };
            let center = kept * aim.field_at_middle().ok_or_else(dark)?;
            let beyond_mm = 1.02 * half_mm + BORDER_OF_BLUR * aim.blur_mm(center);
            let (low, high) = aim.fields_over(center, half_mm, is_mirrored);
            let corner_blur_mm =
                corners_of((low, high)).map(|field_tan| aim.blur_mm(field_tan)).into_iter().fold(0.0, f64::max);
            let beyond_mm = beyond_mm.max(half_mm + BORDER_OF_BLUR * corner_blur_mm);
            Ok([(low, high), aim.fields_over(center, beyond_mm, is_mirrored)])
        })?;
        // All that the film sees and a little more, and of what lies beyond it as much as is gathered to an image.
        const MORE: f64 = 0.02;
        let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let around = |i: usize| {
            ends.iter().fold(nothing, |(first, last), corners| (first.min(corners[i].0), last.max(corners[i].1)))
        };
        let (film, far) = (around(0), around(1));
        let more = 0.5 * MORE * (film.1 - film.0);
        let within = |share: f64| ((film.0 - more).lerp(far.0, share), (film.1 + more).lerp(far.1, share));
        let shares = self.at_ends(|aim| {
            let gathered = aim.gathered_about(0.5 * (film.0 + film.1));
            Ok(gathered.map_or(1.0, |gathered| gathered.largest_share(|share| corners_of(within(share)))))
        })?;
        let (first, last) = within(shares.into_iter().fold(1.0, f64::min));
        // No more of the dark than there must be: fields of a grid that lie there say nothing.
        let middle = 0.5 * (first + last);
        let bounds = self.at_ends(|aim| {
            let corners = corners_of((first, last));
            let is_dark = |field_tan: &DVec2| aim.lands_mm(*field_tan).is_none();
            let everywhere = (DVec2::NEG_INFINITY, DVec2::INFINITY);
            if !corners.iter().any(is_dark) {
                return Ok(everywhere);
            }
            let reach_tan = last.distance(middle);
            let lit = aim.gathered_about(middle).and_then(|gathered| gathered.lit_fields(reach_tan));
            Ok(lit.map_or(everywhere, |lit| lit.bounds_tan()))
        })?;
        let lit = bounds.into_iter().fold((middle, middle), |(low, high), lit| (low.min(lit.0), high.max(lit.1)));
        let mirrored = |side: DVec2, other: DVec2| {
            DVec2::from([0, 1].map(|axis| if is_mirrored[axis] { side[axis].max(-other[axis]) } else { side[axis] }))
        };
        let lit = (-mirrored(-lit.0, -lit.1), mirrored(lit.1, lit.0));
        // A little of it: what is seen where is tabulated over the film, and no square of that table that the last lit fields lie in may reach beyond the grid.
        let beyond = BEYOND_LIT * 0.5 * (lit.1 - lit.0);
        let (first, last) = (first.max(lit.0 - beyond), last.min(lit.1 + beyond));
        let (dioptres, wavelengths_nm) = (self.dioptres()?, self.grid.range_nm());
        Ok(BankSettings::covering_grid(
            self.film_distance_mm,
            (first, last),
            dioptres,
            wavelengths_nm,
            self.diffraction,
        ))
    }
}

/// Returns the four corners of a rectangle, of which two across from each other are given.
fn corners_of((low, high): (DVec2, DVec2)) -> [DVec2; 4] {
    [low, high, DVec2::new(low.x, high.y), DVec2::new(high.x, low.y)]
}

/// Checks that no part of a scene lies inside a lens.
///
/// # Errors
/// Names the nearest sample, where it is no farther from the entrance pupil than the first surface of the lens is, or when the lens
/// has no index at the middle wavelength of the grid.
pub fn check_depth_map(lens: &Lens, grid: &WavelengthGrid, depth: &DepthMap) -> Result<(), ForwardError> {
    let nearest = depth.z_m().indexed_iter().min_by(|a, b| a.1.total_cmp(b.1));
    nearest.map_or(Ok(()), |(place, &z_m)| check_depth(lens, grid, f64::from(z_m), Some(place)))
}

fn check_depth(
    lens: &Lens,
    grid: &WavelengthGrid,
    depth_m: f64,
    place: Option<(usize, usize)>,
) -> Result<(), ForwardError> {
    let centers_nm = grid.centers_nm();
    let least_m = 1e-3 * lens.at(centers_nm[centers_nm.len() / 2])?.projection_center_z_mm();
    // Depths of a map are in single precision.
    if depth_m > 0.0 && depth_m <= least_m * (1.0 + 1e-6) {
        return Err(ForwardError::DepthInsideLens { depth_m, place, lens: lens.name().to_owned(), least_m });
    }
    Ok(())
}

/// A lens looking at one depth.
struct Aim<'a> {
    lens: &'a MonoLens,
    reference: &'a MonoLens,
    dioptres: f64,
    film_distance_mm: f64,
    /// From where places on the film are counted, mm from the axis.
    film_center_mm: DVec2,
}

impl Aim<'_> {
    /// Returns where the middle of the light of a field lands, mm, picture frame; `None` where no light gets through.
    fn lands_mm(&self, field_tan: DVec2) -> Option<DVec2> {
        Some(self.pupil_lands_mm(field_tan, &[])?[0])
    }

    /// Returns where rays of a field land, mm, picture frame: that through the middle of the pupil, and those at these
    /// azimuths of its edge. `None` where the first does not get through; others that fail are left out.
    fn pupil_lands_mm(&self, field_tan: DVec2, azimuths: &[f64]) -> Option<Vec<DVec2>> {
        let point = ObjectPoint::from_field(self.reference, field_tan, self.dioptres);
        let pupil = PupilBoundary::find(self.lens, &point, 16)?;
        let edge =
            azimuths.iter().map(|&azimuth| pupil.center_mm() + DVec2::from_angle(azimuth) * pupil.rho_max_mm(azimuth));
        let targets: Vec<DVec2> = std::iter::once(pupil.center_mm()).chain(edge).collect();
        let mut rays = rays_towards(&point, &targets, pupil.z_mm(), 0.0);
        self.lens.trace(&mut rays, Vignetting::Off);
        self.lens.to_film(&mut rays, self.film_distance_mm);
        if !rays.fate[0].is_in_flight() {
            return None;
        }
        let landed = self.lens.landed(&rays, self.film_distance_mm).map(FilmPoint::in_picture_mm);
        Some(landed.map(|at_mm| at_mm - self.film_center_mm).collect())
    }

    /// Returns which fields about one are gathered to an image; `None` where that sees no light.
    fn gathered_about(&self, middle_tan: DVec2) -> Option<GatheredFields<'_>> {
        GatheredFields::about(middle_tan, (self.lens, self.reference), self.dioptres, self.film_distance_mm)
    }

    /// Returns the radius of the blur on the axis, mm, from first-order optics.
    fn axial_blur_mm(&self) -> f64 {
        let from_vertex_mm = 1e3 / self.dioptres - self.lens.projection_center_z_mm();
        let Ok(image_mm) = self.lens.film_distance_mm_for(from_vertex_mm) else { return 0.0 };
        let cone = 0.5 / (self.lens.image_index() * self.lens.working_f_number(from_vertex_mm));
        (cone * (self.film_distance_mm - image_mm)).abs()
    }

    /// Returns how far from the middle of a field's light its farthest ray lands, mm.
    fn blur_mm(&self, field_tan: DVec2) -> f64 {
        let azimuths: Vec<f64> = (0..16).map(|i| f64::from(i) / 16.0 * std::f64::consts::TAU).collect();
        let landed = self.pupil_lands_mm(field_tan, &azimuths).unwrap_or_default();
        landed.iter().map(|at| at.distance(landed[0])).fold(0.0, f64::max)
    }

    /// Returns the field that lands this far off axis, or the last that gets through.
    fn field_tan_at(&self, extent_mm: f64) -> f64 {
        let is_within = |tan: f64| self.lands_mm(DVec2::X * tan).map(|at| at.x.abs() < extent_mm);
        let (mut low, mut high) = (0.0, 0.01);
        // Widen until the light lands beyond, or there is none.
        while high < WIDEST_FIELD_TAN && is_within(high) == Some(true) {
            (low, high) = (high, 1.3 * high);
        }
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if is_within(middle) == Some(true) {
                low = middle;
            } else {
                high = middle;
            }
        }
        // Just beyond, so that the reach itself is covered — or, where light ends, seen to be dark.
        high * (1.0 + 1e-3)
    }

    /// Returns the field whose light lands in the film's middle: by Newton's method from that along the axis.
    fn field_at_middle(&self) -> Option<DVec2> {
        let mut field_tan = DVec2::ZERO;
        for _ in 0..12 {
            const BY: f64 = 1e-4;
            let at = self.lands_mm(field_tan)?;
            let slope = DMat2::from_cols(
                (self.lands_mm(field_tan + DVec2::X * BY)? - at) / BY,
                (self.lands_mm(field_tan + DVec2::Y * BY)? - at) / BY,
            );
            let step = slope.inverse() * at;
            if !step.is_finite() {
                return None;
            }
            field_tan -= step;
            // A hundredth of a degree is near enough to begin from.
            if step.length() < 2e-4 {
                return Some(field_tan);
            }
        }
        None
    }

    /// Returns the corners of the rectangle of fields that holds all that land within `half_mm` of the film's middle, across and up.
    ///
    /// `is_mirrored` says that what lands to the left, or below, is the mirror image of what lands on the other side.
    fn fields_over(&self, center: DVec2, half_mm: DVec2, is_mirrored: [bool; 2]) -> (DVec2, DVec2) {
        const ALONG: i32 = 8;
        /// A side begins at this part of what first-order optics has, which magnification and distortion leave within the film.
        const FIRST: f64 = 0.25;
        const NARROWEST_TAN: f64 = 1e-3;
        // That a field is dark takes long to see: after the first, the end of the light says it.
        let lit: OnceCell<Option<LitFields>> = OnceCell::new();
        let lit_fields = |dark_tan: DVec2| {
            self.gathered_about(center).and_then(|gathered| gathered.lit_fields(2.0 * dark_tan.distance(center)))
        };
        let is_known_dark = |field_tan: DVec2| {
            const WITHIN: f64 = 0.985;
            lit.get().and_then(Option::as_ref).is_some_and(|lit| lit.is_dark_at(center.lerp(field_tan, WITHIN)))
        };
        let is_within = |field_tan: DVec2| {
            if is_known_dark(field_tan) {
                return false;
            }
            let lands_mm = self.lands_mm(field_tan);
            if lands_mm.is_none() {
                lit.get_or_init(|| lit_fields(field_tan));
            }
            lands_mm.is_some_and(|at| at.abs().cmplt(half_mm).all())
        };
        // Sides: left, bottom, right, top, as distances from the center.
        let mut sides = [NARROWEST_TAN; 4];
        let corners =
            |sides: &[f64; 4]| (center - DVec2::new(sides[0], sides[1]), center + DVec2::new(sides[2], sides[3]));
        let sees_film = |sides: &[f64; 4], side: usize| {
            let (low, high) = corners(sides);
            (0..=ALONG).any(|i| {
                let part = low + (high - low) * (f64::from(i) / f64::from(ALONG));
                is_within(match side {
                    0 => DVec2::new(low.x, part.y),
                    1 => DVec2::new(part.x, low.y),
                    2 => DVec2::new(high.x, part.y),
                    _ => DVec2::new(part.x, high.y),
                })
            })
        };
        let first = FIRST * half_mm / self.lens.first_order().efl_mm.abs();
        let wide = [first.x, first.y, first.x, first.y].map(|tan| tan.clamp(NARROWEST_TAN, WIDEST_OF_GRID_TAN));
        if first.is_finite() && (0..4).all(|side| sees_film(&wide, side)) {
            sides = wide;
        }
        // A side goes out until nothing along it lands on the film; others may then have to follow.
        loop {
            let mut has_grown = false;
            for side in (0..4).filter(|side| *side >= 2 || !is_mirrored[*side]) {
                while sides[side] < WIDEST_OF_GRID_TAN && sees_film(&sides, side) {
                    sides[side] = (1.15 * sides[side]).min(WIDEST_OF_GRID_TAN);
                    if is_mirrored[side % 2] {
                        sides[side - 2] = sides[side];
                    }
                    has_grown = true;
                }
            }
            if !has_grown {
                break;
            }
        }
        corners(&sides)
    }
}
