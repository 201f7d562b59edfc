//! An array of small lenses or holes before the film, which makes a light-field camera of a lens camera.
//!
//! A ray from a film place x that crosses the array at q, in the cell of the element centered at c, leaves it with the
//! slope (q − x)/g − (q − c)/f: g the gap between array and film, f the focal length, infinite for holes. It reaches the
//! plane of the exit pupil, Z before the array, at c + (c − x) Z/g + e (1 + Z/g − Z/f), with e = q − c. So it may come from
//! within the pupil, of center p and radius ρ, only if
//!
//! |c − c₀| ≤ (ρ + a |1 + Z/g − Z/f|) / (1 + Z/g),   c₀ = x + (p − x) g/(Z + g),                                  (1)
//!
//! a being the largest |e|. Elements are drawn evenly from those that satisfy (1), which leaves no light out, and q evenly
//! from the element.

use std::f64::consts::{PI, TAU};

use dioptric_optics::{
    ExitPupilBounds, Placement,
    glam::{DVec2, DVec3},
};
use serde::{Deserialize, Serialize};

use crate::{BackwardError, sampler::on_disc};

/// An array of small lenses or holes, parallel to the film and before it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MicroArray {
    /// What it is made of.
    pub elements: MicroElements,
    /// The distance between the centers of neighbors, mm.
    pub pitch_mm: f64,
    /// The distance from the array to the film, mm.
    pub gap_mm: f64,
    /// How the elements are laid out.
    #[serde(default)]
    pub layout: MicroLayout,
    /// How far the center of one of them lies from the axis, mm to the right and upwards in the picture.
    #[serde(default)]
    pub offset_mm: (f64, f64),
    /// How far the array is turned about that center, degrees counterclockwise in the picture.
    #[serde(default)]
    pub turned_deg: f64,
}

/// What an array is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum MicroElements {
    /// Ideal thin lenses, the same at every wavelength and without diffraction.
    Lenses {
        /// Focal length, mm.
        focal_length_mm: f64,
        /// The diameter of their round rims, mm; light between these is lost. Left out, each fills its cell.
        #[serde(default)]
        diameter_mm: Option<f64>,
    },
    /// Such lenses of three focal lengths in turn, so that neighbors of a hexagonal array differ: each kind has its own depth in
    /// focus (Perwass and Wietzke 2012).
    MultiFocus {
        /// Focal lengths, mm.
        focal_lengths_mm: [f64; N_KINDS],
        /// The diameter of their round rims, mm; light between these is lost. Left out, each fills its cell.
        #[serde(default)]
        diameter_mm: Option<f64>,
    },
    /// Round holes, without diffraction.
    Holes {
        /// Diameter, mm.
        diameter_mm: f64,
    },
}

/// The focal lengths of a multi-focus array.
const N_KINDS: usize = 3;

/// How the elements of an array are laid out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum MicroLayout {
    /// In rows and columns a pitch apart.
    #[default]
    Square,
    /// In rows √3/2 of a pitch apart, every other moved by half a pitch: each has six neighbors.
    Hexagonal,
}

impl MicroLayout {
    /// The distance between rows as a share of the pitch.
    pub fn row_step(self) -> f64 {
        match self {
            Self::Square => 1.0,
            Self::Hexagonal => 0.75_f64.sqrt(),
        }
    }
}

/// The most pitches that a film place may be seen across.
const MOST_PITCHES: f64 = 64.0;

impl MicroArray {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first that makes no sense.
    pub fn check(&self) -> Result<(), BackwardError> {
        let mut lengths = vec![("the pitch of the array in mm", self.pitch_mm), ("its gap in mm", self.gap_mm)];
        match self.elements {
            MicroElements::Lenses { focal_length_mm, diameter_mm } => {
                lengths.push(("the focal length of its lenses in mm", focal_length_mm));
                lengths.extend(diameter_mm.map(|d| ("the diameter of its lenses in mm", d)));
            }
            MicroElements::MultiFocus { focal_lengths_mm, diameter_mm } => {
                lengths.extend(focal_lengths_mm.map(|f| ("a focal length of its lenses in mm", f)));
                lengths.extend(diameter_mm.map(|d| ("the diameter of its lenses in mm", d)));
            }
            MicroElements::Holes { diameter_mm } => lengths.push(("the diameter of its holes in mm", diameter_mm)),
        }
        if let Some(&(what, found)) = lengths.iter().find(|(_, mm)| !(*mm > 0.0 && mm.is_finite())) {
            return Err(BackwardError::setting(what, found, "a finite length above 0"));
        }
        if self.diameter_mm().is_some_and(|d| d > self.pitch_mm * (1.0 + 1e-9)) {
            let found = self.diameter_mm().unwrap_or(0.0);
            return Err(BackwardError::setting("the diameter of its elements in mm", found, "at most their pitch"));
        }
        let (x, y) = self.offset_mm;
        if !(x.is_finite() && y.is_finite()) {
            return Err(BackwardError::setting("its offset in mm", format!("{x}, {y}"), "finite lengths"));
        }
        match self.turned_deg.is_finite() {
            true => Ok(()),
            false => Err(BackwardError::setting("its turn in degrees", self.turned_deg, "a finite angle")),
        }
    }

    /// Returns how far the light of a film place crosses its element off the center in the mean, as a share of how far the place lies off
    /// the center, and to the same side.
    ///
    /// Light that crosses at a slope s counts cos⁴ = (1 + s²)⁻²: in an element of the second moment m₂ along an axis the mean is 4 m₂/g² of
    /// the way, to first order in slopes.
    pub fn crossing_share(&self) -> f64 {
        let second_mm2 = match (self.diameter_mm(), self.layout) {
            (Some(diameter_mm), _) => diameter_mm * diameter_mm / 16.0,
            (None, MicroLayout::Square) => self.pitch_mm * self.pitch_mm / 12.0,
            (None, MicroLayout::Hexagonal) => 5.0 * self.pitch_mm * self.pitch_mm / 72.0,
        };
        4.0 * second_mm2 / (self.gap_mm * self.gap_mm)
    }

    /// The diameter of round elements, mm; none where they fill their cells.
    fn diameter_mm(&self) -> Option<f64> {
        match self.elements {
            MicroElements::Lenses { diameter_mm, .. } | MicroElements::MultiFocus { diameter_mm, .. } => diameter_mm,
            MicroElements::Holes { diameter_mm } => Some(diameter_mm),
        }
    }

    /// One over the focal length of each kind of element in turn, 1/mm; 0 for holes.
    fn powers_per_mm(&self) -> [f64; N_KINDS] {
        match self.elements {
            MicroElements::Lenses { focal_length_mm, .. } => [1.0 / focal_length_mm; N_KINDS],
            MicroElements::MultiFocus { focal_lengths_mm, .. } => focal_lengths_mm.map(f64::recip),
            MicroElements::Holes { .. } => [0.0; N_KINDS],
        }
    }

    /// Along a row of elements.
    fn along_rows(&self) -> DVec2 {
        DVec2::from_angle(self.turned_deg.to_radians())
    }

    /// Returns an element, its center along the film's own axes, mm. The lens turns the picture, so that these point to the
    /// left and down in it.
    fn element(&self, row: i64, column: i64) -> Element {
        let step = self.layout.row_step();
        let (shift, number) = match self.layout {
            MicroLayout::Square => (0.0, column + row),
            // Counted along the rows and along a line of neighbors across them, so that all six neighbors are of other kinds.
            MicroLayout::Hexagonal => (0.5 * row.rem_euclid(2) as f64, column - row.div_euclid(2) - row),
        };
        let on_lattice = DVec2::new(column as f64 + shift, row as f64 * step);
        let center_mm = self.pitch_mm * self.along_rows().rotate(on_lattice) - DVec2::from(self.offset_mm);
        Element { center_mm, kind: number.rem_euclid(N_KINDS as i64) as usize }
    }

    /// Calls `each` for every element whose center lies within a distance of a place, row by row.
    fn within(&self, place_mm: DVec2, radius_mm: f64, mut each: impl FnMut(Element)) {
        let turned_back = DVec2::from_angle(-self.turned_deg.to_radians());
        let on_lattice = turned_back.rotate(place_mm + DVec2::from(self.offset_mm)) / self.pitch_mm;
        let (radius, step) = (radius_mm / self.pitch_mm, self.layout.row_step());
        let first_row = ((on_lattice.y - radius) / step).ceil() as i64;
        let last_row = ((on_lattice.y + radius) / step).floor() as i64;
        for row in first_row..=last_row {
            let shift = if self.layout == MicroLayout::Hexagonal { 0.5 * row.rem_euclid(2) as f64 } else { 0.0 };
            let x = on_lattice.x - shift;
            let half = (radius * radius - (row as f64 * step - on_lattice.y).powi(2)).max(0.0).sqrt();
            for column in (x - half).ceil() as i64..=(x + half).floor() as i64 {
                each(self.element(row, column));
            }
        }
    }

    /// The farthest that a point of an element lies from its center, mm.
    fn reach_mm(&self) -> f64 {
        let of_cell = match self.layout {
            MicroLayout::Square => 0.5_f64.sqrt(),
            MicroLayout::Hexagonal => 1.0 / 3.0_f64.sqrt(),
        };
        self.diameter_mm().map_or(of_cell * self.pitch_mm, |d| 0.5 * d)
    }

    /// Returns the area of an element, mm².
    fn area_mm2(&self) -> f64 {
        let of_cell = self.pitch_mm * self.pitch_mm * self.layout.row_step();
        self.diameter_mm().map_or(of_cell, |d| 0.25 * PI * d * d)
    }

    /// Returns a point of an element from its center, mm, evenly spread.
    fn sample_mm(&self, u: f64, v: f64) -> DVec2 {
        if let Some(diameter_mm) = self.diameter_mm() {
            return 0.5 * diameter_mm * on_disc(u, v);
        }
        self.along_rows().rotate(match self.layout {
            MicroLayout::Square => self.pitch_mm * DVec2::new(u - 0.5, v - 0.5),
            MicroLayout::Hexagonal => {
                // Three rhombi about the center, each between two corners.
                let (rhombus, u) = ((3.0 * u).floor().min(2.0), (3.0 * u).fract());
                let corner = |k: f64| DVec2::from_angle(TAU * (k / 3.0 + 0.25)) * (self.pitch_mm / 3.0_f64.sqrt());
                u * corner(rhombus) + v * corner(rhombus + 1.0)
            }
        })
    }
}

/// A lens or hole of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Element {
    center_mm: DVec2,
    /// Which of the focal lengths it has.
    kind: usize,
}

/// An array before a film, and where the exit pupil is seen from its places.
#[derive(Clone, Debug)]
pub(crate) struct PlacedMicroArray {
    array: MicroArray,
    powers_per_mm: [f64; N_KINDS],
    /// The film's own frame; the array lies in its plane z = −gap.
    film: Placement,
    pupils: PupilTable,
}

/// A ray drawn from the film through the array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MicroRay {
    /// Where it crosses the array, in the lens frame, mm.
    pub(crate) point_mm: DVec3,
    /// Its direction from the film to the array.
    pub(crate) before: DVec3,
    /// Its direction behind the array, towards the lens.
    pub(crate) after: DVec3,
    /// The density of the crossing over the array is one over this area, mm².
    pub(crate) area_mm2: f64,
}

impl PlacedMicroArray {
    /// Places an array before a film of this half size; `bounds` are those of the exit pupil from places of the array.
    pub(crate) fn new(
        array: MicroArray,
        film: Placement,
        film_half_mm: DVec2,
        bounds: &ExitPupilBounds,
    ) -> Result<Self, BackwardError> {
        array.check()?;
        let pupils = PupilTable::new(bounds, &film, film_half_mm);
        let placed = Self { array, powers_per_mm: array.powers_per_mm(), film, pupils };
        let seen_across = |disc: &PupilDisc| placed.reach_mm(disc) / array.pitch_mm;
        let widest = placed.pupils.discs.iter().flatten().map(seen_across).fold(0.0, f64::max);
        match widest <= MOST_PITCHES {
            true => Ok(placed),
            false => Err(BackwardError::setting(
                "the array",
                format!("seen across {widest:.0} pitches from a place of the film"),
                "a gap and a pitch such that the exit pupil is seen through 64 of its elements at most",
            )),
        }
    }

    /// How far the elements that light may come through lie from the middle one, mm: the right side of (1).
    fn reach_mm(&self, disc: &PupilDisc) -> f64 {
        let z_per_gap = (-disc.center_mm.z - self.array.gap_mm) / self.array.gap_mm;
        let spread = |power: f64| (1.0 + z_per_gap - z_per_gap * self.array.gap_mm * power).abs();
        let widest = self.powers_per_mm.into_iter().map(spread).fold(0.0, f64::max);
        (disc.radius_mm + self.array.reach_mm() * widest) / (1.0 + z_per_gap)
    }

    /// The middle of the elements that a film place (own axes, mm) sees the exit pupil through, and how far they reach.
    fn seen_from(&self, on_film_mm: DVec2) -> Option<(DVec2, f64)> {
        let mut center_mm = on_film_mm;
        let mut reach_mm = 0.0;
        // The exit pupil moves little with the place that it is seen from.
        for _ in 0..2 {
            let disc = self.pupils.at(center_mm)?;
            let share = self.array.gap_mm / -disc.center_mm.z;
            center_mm = on_film_mm.lerp(disc.center_mm.truncate(), share);
            reach_mm = self.reach_mm(&disc);
        }
        Some((center_mm, reach_mm))
    }

    /// The direction across the array, in the lens frame.
    pub(crate) fn normal(&self) -> DVec3 {
        self.film.rotation.z_axis
    }

    /// Draws a ray from a film place by three numbers from 0 to 1; none where no element is seen.
    pub(crate) fn ray(&self, from_mm: DVec3, [choice, u, v]: [f64; 3]) -> Option<MicroRay> {
        let own_mm = self.film.surface_from_lens(from_mm);
        let (middle_mm, reach_mm) = self.seen_from(own_mm.truncate())?;
        let mut n_seen = 0_u32;
        self.array.within(middle_mm, reach_mm, |_| n_seen += 1);
        let mut left = (choice * f64::from(n_seen)) as u32;
        let mut chosen = None;
        self.array.within(middle_mm, reach_mm, |element| {
            if left == 0 && chosen.is_none() {
                chosen = Some(element);
            }
            left = left.saturating_sub(1);
        });
        let Element { center_mm, kind } = chosen?;
        let crossing_mm = center_mm + self.array.sample_mm(u, v);
        let to_array_mm = self.array.gap_mm + own_mm.z;
        let slope = (crossing_mm - own_mm.truncate()) / to_array_mm;
        let bent = slope - (crossing_mm - center_mm) * self.powers_per_mm[kind];
        let in_lens = |slope: DVec2| self.film.rotation * slope.extend(-1.0).normalize();
        Some(MicroRay {
            point_mm: self.film.lens_from_surface(crossing_mm.extend(-self.array.gap_mm)),
            before: in_lens(slope),
            after: in_lens(bent),
            area_mm2: f64::from(n_seen) * self.array.area_mm2(),
        })
    }

    /// Returns the center of the element that a film place sees the middle of the exit pupil through, or comes nearest to, in
    /// the lens frame.
    pub(crate) fn element_before(&self, from_mm: DVec3) -> Option<DVec3> {
        let own_mm = self.film.surface_from_lens(from_mm);
        let (middle_mm, _) = self.seen_from(own_mm.truncate())?;
        let mut nearest = (f64::INFINITY, None);
        self.array.within(middle_mm, self.array.pitch_mm, |Element { center_mm, .. }| {
            let distance = center_mm.distance_squared(middle_mm);
            if distance < nearest.0 {
                nearest = (distance, Some(center_mm));
            }
        });
        Some(self.film.lens_from_surface(nearest.1?.extend(-self.array.gap_mm)))
    }
}

/// A disc that holds the exit pupil as a place of the array sees it, in the film's frame.
#[derive(Clone, Copy, Debug)]
struct PupilDisc {
    center_mm: DVec3,
    radius_mm: f64,
}

/// Discs around the exit pupil for places of the array.
#[derive(Clone, Debug)]
struct PupilTable {
    half_mm: DVec2,
    /// Rows of places from −half to half each way; none where no light comes from.
    discs: Vec<Option<PupilDisc>>,
}

/// Places of the table along each side.
const N_PLACES: usize = 33;
/// How much larger the discs are than what was found, for what lies between the points that were looked at.
const MARGIN: f64 = 1.05;

impl PupilTable {
    fn new(bounds: &ExitPupilBounds, film: &Placement, half_mm: DVec2) -> Self {
        let place_mm = |i: usize| {
            let share = DVec2::new((i % N_PLACES) as f64, (i / N_PLACES) as f64) * (2.0 / (N_PLACES - 1) as f64);
            (share - DVec2::ONE) * half_mm
        };
        let discs = (0..N_PLACES * N_PLACES).map(|i| PupilDisc::around(bounds, film, place_mm(i))).collect();
        Self { half_mm, discs }
    }

    /// Returns a disc around the exit pupil as a place sees it.
    fn at(&self, place_mm: DVec2) -> Option<PupilDisc> {
        let last = (N_PLACES - 1) as f64;
        let on_table = ((place_mm / self.half_mm + DVec2::ONE) * (0.5 * last)).clamp(DVec2::ZERO, DVec2::splat(last));
        let low = on_table.floor().min(DVec2::splat(last - 1.0));
        let share = on_table - low;
        let corner = |right: usize, up: usize| self.discs[(low.y as usize + up) * N_PLACES + low.x as usize + right];
        let corners = [
            (corner(0, 0), (1.0 - share.x) * (1.0 - share.y)),
            (corner(1, 0), share.x * (1.0 - share.y)),
            (corner(0, 1), (1.0 - share.x) * share.y),
            (corner(1, 1), share.x * share.y),
        ];
        // Where a corner is dark the disc of another, wide enough for its distance, does.
        let lit = || corners.iter().filter_map(|(disc, weight)| Some(((*disc)?, *weight)));
        let total: f64 = lit().map(|(_, weight)| weight).sum();
        let first = lit().next()?.0;
        let mean_mm = lit().map(|(disc, weight)| disc.center_mm * weight).sum::<DVec3>() / total;
        let center_mm = if mean_mm.is_finite() { mean_mm } else { first.center_mm };
        let radius_mm = lit().map(|(disc, _)| disc.radius_mm + disc.center_mm.distance(center_mm)).fold(0.0, f64::max);
        Some(PupilDisc { center_mm, radius_mm })
    }
}

impl PupilDisc {
    fn around(bounds: &ExitPupilBounds, film: &Placement, place_mm: DVec2) -> Option<Self> {
        const ROWS: usize = 32;
        // The ends of rows of the bounds.
        let ends = (0..=2 * ROWS + 1).filter_map(|i| {
            let u = DVec2::new((i % 2) as f64, (i / 2) as f64 / ROWS as f64);
            Some(film.surface_from_lens(bounds.sample(place_mm, u)?.point_mm))
        });
        let ends: Vec<DVec3> = ends.collect();
        let [low_mm, high_mm] = ends
            .iter()
            .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], end| [low.min(*end), high.max(*end)]);
        let center_mm = 0.5 * (low_mm + high_mm);
        let radius_mm = ends.iter().map(|end| end.distance(center_mm)).fold(0.0, f64::max);
        (!ends.is_empty()).then_some(Self { center_mm, radius_mm: MARGIN * radius_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(layout: MicroLayout) -> MicroArray {
        let elements = MicroElements::Lenses { focal_length_mm: 0.4, diameter_mm: None };
        MicroArray { elements, pitch_mm: 0.1, gap_mm: 0.4, layout, offset_mm: (0.02, -0.03), turned_deg: 17.0 }
    }

    #[test]
    fn every_element_near_a_place_is_found() {
        for layout in [MicroLayout::Square, MicroLayout::Hexagonal] {
            let array = array(layout);
            let place_mm = DVec2::new(0.137, -0.271);
            let mut found = Vec::new();
            array.within(place_mm, 0.23, |element| found.push(element.center_mm));
            let all = (-20..20).flat_map(|row| (-20..20).map(move |column| (row, column)));
            let near = all.map(|(row, column)| array.element(row, column).center_mm);
            let near: Vec<DVec2> = near.filter(|center_mm| center_mm.distance(place_mm) <= 0.23).collect();
            assert_eq!(found, near);
            // As many as elements fit on the disc, give or take its border.
            let fit = PI * 0.23 * 0.23 / array.area_mm2();
            assert!((found.len() as f64 - fit).abs() < 4.0, "{} {fit}", found.len());
        }
    }

    /// Points are nearer to the center of their own element than to any other, and spread as evenly as the cell.
    #[test]
    fn points_fill_their_cell() {
        for layout in [MicroLayout::Square, MicroLayout::Hexagonal] {
            let array = array(layout);
            let (own_mm, n) = (array.element(1, 2).center_mm, 60);
            let mut second = DVec2::ZERO;
            for i in 0..n * n {
                let share = |i: usize| (i as f64 + 0.5) / n as f64;
                let from_center_mm = array.sample_mm(share(i % n), share(i / n));
                second += from_center_mm * from_center_mm / (n * n) as f64;
                assert!(from_center_mm.length() <= array.reach_mm() + 1e-12);
                array.within(own_mm, 0.15, |other| {
                    let from_other_mm = (own_mm + from_center_mm).distance(other.center_mm);
                    assert!(from_center_mm.length() <= from_other_mm + 1e-9);
                });
            }
            let expected = 0.25 * array.gap_mm * array.gap_mm * array.crossing_share();
            assert!((second / expected - DVec2::ONE).abs().max_element() < 2e-3, "{second} {expected}");
        }
    }

    /// The kinds of a hexagonal array differ between all neighbors, and are equally many.
    #[test]
    fn neighbors_have_other_focal_lengths() {
        let array = array(MicroLayout::Hexagonal);
        let mut n_of = [0; N_KINDS];
        for (row, column) in (-9..9).flat_map(|row| (-9..9).map(move |column| (row, column))) {
            let own = array.element(row, column);
            n_of[own.kind] += 1;
            let mut n_neighbors = 0;
            array.within(own.center_mm, 1.01 * array.pitch_mm, |other| {
                if other.center_mm.distance(own.center_mm) > 1e-9 {
                    n_neighbors += 1;
                    assert_ne!(other.kind, own.kind, "{row} {column}");
                }
            });
            assert_eq!(n_neighbors, 6);
        }
        assert_eq!(n_of, [108; N_KINDS]);
    }

    #[test]
    fn wrong_numbers_are_named() {
        let good = array(MicroLayout::Square);
        good.check().unwrap();
        let holes = MicroElements::Holes { diameter_mm: 0.2 };
        for (array, words) in [
            (MicroArray { pitch_mm: 0.0, ..good }, "the pitch of the array in mm is 0"),
            (MicroArray { gap_mm: f64::NAN, ..good }, "its gap in mm is NaN"),
            (MicroArray { elements: holes, ..good }, "expected at most their pitch"),
            (MicroArray { offset_mm: (f64::INFINITY, 0.0), ..good }, "its offset in mm"),
            (MicroArray { turned_deg: f64::NAN, ..good }, "its turn in degrees is NaN"),
        ] {
            let message = array.check().unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
