//! Ghosts of a point to be drawn: beams of light, each from a small square before the lens to a parallelogram on the film.

use std::ops::Range;

use glam::{DMat2, DVec2, DVec3};

use crate::{
    MirrorFilm, MonoLens, ObjectPoint, OpticsError, RayBatchF32, ghosts::PAIR, trace::GhostTree,
    transmission::GHOST_TERMS,
};

/// A lens at one wavelength, of which the light of points that two surfaces reflect is followed to a film.
#[derive(Clone, Debug)]
pub struct GhostBeams {
    lens: MonoLens,
    tree: GhostTree<f32>,
    is_rotational: bool,
}

/// The light of a point that falls on a small square before the lens, as one pair of surfaces sends it to the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GhostBeam {
    /// Its middle on the film, mm in the lens frame.
    pub middle_mm: DVec2,
    /// The sides of the parallelogram that it lights, mm; 0 where no ray beside it gets through.
    pub sides_mm: [DVec2; 2],
    /// Its light: of a far point over its irradiance on a surface across its light, mm²; of a near one over its intensity, sr.
    pub light: f64,
}

/// A square grid of rays over the front rim.
#[derive(Clone, Copy, Debug)]
struct Grid {
    /// Cells along each side, an even number.
    n_across: usize,
    radius_mm: f64,
    /// Whether there is only the half at x > 0, whose mirror image is the other one.
    is_half: bool,
}

/// Where a ray lands, mm, and the share of its light.
type Landing = [f32; 3];

impl MonoLens {
    /// Returns the lens for drawing ghosts on a film.
    ///
    /// # Errors
    /// When the lens is tilted or decentered or has mirrors or gratings, or the film is curved or at no finite distance.
    pub fn ghost_beams(&self, film: &MirrorFilm) -> Result<GhostBeams, OpticsError> {
        self.check_ghosts(film)?;
        // A film with ends is no body of revolution.
        let is_rotational = self.is_rotational() && film.reflectance == 0.0;
        Ok(GhostBeams { lens: self.clone(), tree: self.ghost_tree(film, false, GHOST_TERMS), is_rotational })
    }
}

impl GhostBeams {
    /// Follows one of `of` parts of about `n_rays` rays from a point, and hands each beam to `note`, with the pair of surfaces that reflect it,
    /// the later one first. All parts together have the light of all ghosts.
    ///
    /// Rays are spread over the circle of the first surface's rim. A beam is as wide as its neighbors are apart on the film; where one of them is lost
    /// at a rim, as the other is away.
    ///
    /// # Panics
    /// When there is no such part.
    pub fn follow(
        &self,
        point: &ObjectPoint,
        n_rays: usize,
        (part, of): (usize, usize),
        note: &mut impl FnMut([usize; 2], &GhostBeam),
    ) {
        assert!(part < of, "part {part} of {of}");
        // A lens of revolution is met in the plane of the point, half of it.
        let (point, turn) = if self.is_rotational { in_plane(point) } else { (*point, DMat2::IDENTITY) };
        let (radius_mm, rim_z_mm) = (self.lens.semi_aperture_mm(0), self.lens.front_rim_z_mm());
        let grid = Grid::new(radius_mm, n_rays, self.is_rotational);
        let rows = grid.n_across * part / of..grid.n_across * (part + 1) / of;
        let around = rows.start.saturating_sub(1)..(rows.end + 1).min(grid.n_across);
        let (cells, at) = grid.cells(around.clone());
        let targets_mm: Vec<DVec2> = cells.iter().map(|&cell| grid.middle_mm(cell)).collect();
        let mut rays = RayBatchF32::from(&self.lens.rays_towards(&point, &targets_mm, rim_z_mm, 0.0));
        // The film may be one of both.
        let n = self.lens.n_surfaces() + 1;
        let mut landings: Vec<Vec<Landing>> = vec![Vec::new(); n * n];
        let mut land = |way: &[u16], start: usize, [x, y, ..]: [&[f32]; 5], shares: &[f64]| {
            let &[first, second] = way else { return };
            let list = &mut landings[usize::from(first) * n + usize::from(second)];
            list.resize(cells.len(), [0.0; 3]);
            for (i, landing) in list.iter_mut().skip(start).take(shares.len()).enumerate() {
                *landing = [x[i], y[i], shares[i] as f32];
            }
        };
        self.tree.trace(&rays.slices(), PAIR, &mut land);
        let neighbor = |row: usize, column: usize| {
            let is_there = around.contains(&row) && column < grid.n_across;
            is_there.then(|| at[(row - around.start) * grid.n_across + column]).filter(|&i| i != NONE)
        };
        let area_mm2 = (2.0 * radius_mm / grid.n_across as f64).powi(2);
        for (pair, list) in landings.iter().enumerate().filter(|(_, list)| !list.is_empty()) {
            let landed = |i: Option<usize>| i.map(|i| list[i]).filter(|landing| landing[2] > 0.0).map(place_mm);
            for (i, &(row, column)) in
                cells.iter().enumerate().filter(|(i, (row, _))| rows.contains(row) && list[*i][2] > 0.0)
            {
                let middle_mm = place_mm(list[i]);
                let left = if grid.is_half && column == grid.n_across / 2 {
                    Some(DVec2::new(-middle_mm.x, middle_mm.y))
                } else {
                    landed(neighbor(row, column.wrapping_sub(1)))
                };
                let right = landed(neighbor(row, column + 1));
                let (below, above) = (landed(neighbor(row.wrapping_sub(1), column)), landed(neighbor(row + 1, column)));
                let sides_mm = [(left, right), (below, above)].map(|between| side_mm(middle_mm, between));
                let light = f64::from(list[i][2]) * area_mm2 * share_per_area(&point, targets_mm[i].extend(rim_z_mm));
                let beam = GhostBeam { middle_mm: turn * middle_mm, sides_mm: sides_mm.map(|side| turn * side), light };
                note([pair / n, pair % n], &beam);
                if grid.is_half {
                    let mirror = turn * DMat2::from_diagonal(DVec2::new(-1.0, 1.0));
                    let sides_mm = sides_mm.map(|side| mirror * side);
                    note([pair / n, pair % n], &GhostBeam { middle_mm: mirror * middle_mm, sides_mm, light });
                }
            }
        }
    }

    /// The lens.
    pub fn lens(&self) -> &MonoLens {
        &self.lens
    }
}

/// No ray of the grid.
const NONE: usize = usize::MAX;

impl Grid {
    fn new(radius_mm: f64, n_rays: usize, is_half: bool) -> Self {
        let n_across = (2.0 * (n_rays.max(1) as f64 / std::f64::consts::PI).sqrt()).ceil().max(2.0) as usize;
        Self { n_across: n_across.next_multiple_of(2), radius_mm, is_half }
    }

    fn middle_mm(&self, (row, column): (usize, usize)) -> DVec2 {
        let at = |i: usize| self.radius_mm * ((2 * i + 1) as f64 / self.n_across as f64 - 1.0);
        DVec2::new(at(column), at(row))
    }

    /// Returns the cells of some rows whose middles lie within the rim, and for all cells of those rows their number among these.
    fn cells(&self, rows: Range<usize>) -> (Vec<(usize, usize)>, Vec<usize>) {
        let mut at = vec![NONE; rows.len() * self.n_across];
        let mut cells = Vec::new();
        let first = if self.is_half { self.n_across / 2 } else { 0 };
        for row in rows.clone() {
            for column in
                (first..self.n_across).filter(|&column| self.middle_mm((row, column)).length() <= self.radius_mm)
            {
                at[(row - rows.start) * self.n_across + column] = cells.len();
                cells.push((row, column));
            }
        }
        (cells, at)
    }
}

fn place_mm([x, y, _]: Landing) -> DVec2 {
    DVec2::new(f64::from(x), f64::from(y))
}

/// Returns by how much a beam is wide between its neighbors.
fn side_mm(middle_mm: DVec2, between: (Option<DVec2>, Option<DVec2>)) -> DVec2 {
    match between {
        (Some(before), Some(behind)) => 0.5 * (behind - before),
        (Some(before), None) => middle_mm - before,
        (None, Some(behind)) => behind - middle_mm,
        (None, None) => DVec2::ZERO,
    }
}

/// Returns what of its irradiance or intensity a point sends through an area there, across the axis.
fn share_per_area(point: &ObjectPoint, target_mm: DVec3) -> f64 {
    match *point {
        ObjectPoint::Infinite(direction) => direction.z,
        ObjectPoint::Finite(place) => {
            let way = target_mm - place;
            way.z.abs() / way.length().powi(3)
        }
    }
}

/// Returns a point turned about the axis to where its light comes to the lens in the y–z plane, and the turn back.
fn in_plane(point: &ObjectPoint) -> (ObjectPoint, DMat2) {
    let of = |v: DVec3| {
        let radius = v.truncate().length();
        let up = if radius > 0.0 { v.truncate() / radius } else { DVec2::Y };
        (DVec3::new(0.0, radius, v.z), DMat2::from_cols(-up.perp(), up))
    };
    match *point {
        ObjectPoint::Finite(place) => {
            let (place, turn) = of(place);
            (ObjectPoint::Finite(place), turn)
        }
        ObjectPoint::Infinite(direction) => {
            let (direction, turn) = of(direction);
            (ObjectPoint::Infinite(direction), turn)
        }
    }
}
