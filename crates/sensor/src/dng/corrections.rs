//! The corrections that a DNG file asks for: its lists of opcodes, read and applied (DNG 1.6, chapter 7).
//!
//! List 1 is for the stored codes, list 2 for mosaics or planes of linear light, list 3 for demosaiced planes; numbers are big-endian in every file.
//! Light is 1 at saturation, codes are shares of 65 535.

use ndarray::Array2;
use rayon::prelude::*;

use crate::{lens_tables::sample_at, plane_rows::plane_rows};

/// The opcodes by their numbers from 1 on.
const NAMES: [&str; 14] = [
    "WarpRectilinear",
    "WarpFisheye",
    "FixVignetteRadial",
    "FixBadPixelsConstant",
    "FixBadPixelsList",
    "TrimBounds",
    "MapTable",
    "MapPolynomial",
    "GainMap",
    "DeltaPerRow",
    "DeltaPerColumn",
    "ScalePerRow",
    "ScalePerColumn",
    "WarpRectilinear2",
];
/// The highest code.
const TOP: f32 = 65_535.0;
/// The highest degree of a polynomial of codes.
const HIGHEST_DEGREE: usize = 8;
/// Places so far beyond the frame, pixels, still take the samples at its border; what is farther out is black.
const BORDER_PX: f64 = 4.0;
/// How far away a sound neighbor of a bad pixel is looked for, pixels.
const FARTHEST_NEIGHBOR: isize = 8;

/// A list of corrections in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Corrections {
    steps: Vec<Correction>,
    /// The names of what is applied.
    pub(super) names: Vec<String>,
    /// The names of opcodes that are not known.
    pub(super) unknown: Vec<String>,
}

/// Where planes lie in the image for which opcodes count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Rows and columns of that image.
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Its row and column at which the planes begin.
    pub(super) top: usize,
    pub(super) left: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Correction {
    Warp { planes: Vec<Warp>, center: [f64; 2] },
    Vignette { factors: [f64; 5], center: [f64; 2] },
    BadConstant(u32),
    BadList { points: Vec<[u32; 2]>, rectangles: Vec<[u32; 4]> },
    Trim([i32; 4]),
    OfArea(Area, Map),
}

/// Where a plane of the corrected picture has its light from: radial and tangential factors by distances of which the farthest corner is 1.
#[derive(Clone, Debug, PartialEq)]
struct Warp {
    /// The factors of the powers of the distance, from 0 on; of the angle of fisheye lenses.
    radial: Vec<f64>,
    tangential: [f64; 2],
    /// The least and largest distance for which the factors hold.
    valid: [f64; 2],
    is_fisheye: bool,
    is_reciprocal: bool,
}

/// Rows, columns and planes that are changed.
#[derive(Clone, Debug, PartialEq)]
struct Area {
    top: usize,
    left: usize,
    bottom: usize,
    right: usize,
    plane: usize,
    planes: usize,
    row_pitch: usize,
    column_pitch: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Map {
    Table(Vec<u16>),
    Polynomial(Vec<f64>),
    Gain(GainMap),
    AddToRows(Vec<f32>),
    AddToColumns(Vec<f32>),
    ScaleRows(Vec<f32>),
    ScaleColumns(Vec<f32>),
}

/// Factors at points of the image, in shares of its height and width.
#[derive(Clone, Debug, PartialEq)]
struct GainMap {
    points: [usize; 2],
    spacing: [f64; 2],
    origin: [f64; 2],
    n_planes: usize,
    factors: Vec<f32>,
}

/// The parameters of an opcode, taken one by one.
struct Parameters<'a> {
    bytes: &'a [u8],
    name: &'a str,
}

impl<'a> Parameters<'a> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let cut = || format!("has an opcode {} whose parameters are cut short", self.name);
        let (head, rest) = self.bytes.split_first_chunk::<N>().ok_or_else(cut)?;
        self.bytes = rest;
        Ok(*head)
    }

    fn whole(&mut self) -> Result<u32, String> {
        Ok(u32::from_be_bytes(self.take()?))
    }

    fn number(&mut self) -> Result<f64, String> {
        let value = f64::from_be_bytes(self.take()?);
        if value.is_finite() { Ok(value) } else { Err(format!("has a {} with a number that is not finite", self.name)) }
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], String> {
        let mut numbers = [0.0; N];
        numbers.iter_mut().try_for_each(|number| self.number().map(|value| *number = value))?;
        Ok(numbers)
    }

    /// Returns a count of things of so many bytes, which must be there.
    fn count(&mut self, bytes_each: usize) -> Result<usize, String> {
        let n = self.whole()? as usize;
        if n.checked_mul(bytes_each).is_none_or(|all| all > self.bytes.len()) {
            return Err(format!("has an opcode {} with {n} entries, more than its bytes hold", self.name));
        }
        Ok(n)
    }

    fn singles(&mut self, n: usize) -> Result<Vec<f32>, String> {
        let singles = (0..n).map(|_| Ok(f32::from_be_bytes(self.take()?))).collect::<Result<Vec<f32>, String>>()?;
        match singles.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(format!("has a {} of {value}, expected finite numbers", self.name)),
            None => Ok(singles),
        }
    }

    fn area(&mut self) -> Result<Area, String> {
        let mut next = || self.whole().map(|value| value as usize);
        let [top, left, bottom, right] = [next()?, next()?, next()?, next()?];
        let area = Area {
            top,
            left,
            bottom,
            right,
            plane: next()?,
            planes: next()?,
            row_pitch: next()?,
            column_pitch: next()?,
        };
        if area.row_pitch == 0 || area.column_pitch == 0 || area.top >= area.bottom || area.left >= area.right {
            return Err(format!("has a {} of an area without pixels", self.name));
        }
        Ok(area)
    }

    /// Returns factors for each row or column of an area: one a step from the first to the last.
    fn lines(&mut self, length: usize, pitch: usize) -> Result<Vec<f32>, String> {
        let (n, expected) = (self.count(4)?, length.div_ceil(pitch));
        if n != expected {
            return Err(format!("has a {} of {n} numbers, expected {expected} for its area", self.name));
        }
        self.singles(n)
    }
}

impl Corrections {
    /// Reads a list.
    pub(super) fn read(list: &[u8]) -> Result<Self, String> {
        let mut read = Self::default();
        let mut list = Parameters { bytes: list, name: "list" };
        for _ in 0..list.whole()? {
            let number = list.whole()? as usize;
            let (_version, _flags) = (list.whole()?, list.whole()?);
            let name = number.checked_sub(1).and_then(|i| NAMES.get(i)).copied();
            let n = list.count(1)?;
            let (parameters, rest) = list.bytes.split_at(n);
            list.bytes = rest;
            match name {
                Some(name) => {
                    read.steps.push(Correction::read(number, Parameters { bytes: parameters, name })?);
                    read.names.push(name.to_owned());
                }
                None => read.unknown.push(format!("opcode {number}")),
            }
        }
        Ok(read)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Whether places of the picture change.
    pub(super) fn moves(&self) -> bool {
        self.steps.iter().any(|step| matches!(step, Correction::Warp { .. } | Correction::Trim(_)))
    }

    /// Applies the list to planes at a place; those of light are held to `top`. Each plane is `scales` times what opcodes count.
    ///
    /// `is_same` tells whether two pixels (row and column of the planes) have the same filter.
    pub(super) fn apply(
        &self,
        mut planes: Vec<Array2<f32>>,
        place: Place,
        (scales, top): (&[f32], f32),
        is_same: &(dyn Fn([usize; 2], [usize; 2]) -> bool + Sync),
    ) -> Vec<Array2<f32>> {
        for step in &self.steps {
            match step {
                Correction::Warp { planes: warps, center } => planes = warped(&planes, warps, *center, place),
                Correction::Vignette { factors, center } => even_out(&mut planes, factors, *center, place, top),
                Correction::BadConstant(code) => {
                    for plane in &mut planes {
                        let is_bad = plane.mapv(|v| (v * TOP).round() == *code as f32);
                        mend(plane, &is_bad, is_same);
                    }
                }
                Correction::BadList { points, rectangles } => {
                    for plane in &mut planes {
                        mend(plane, &bad_pixels(plane.dim(), points, rectangles, place), is_same);
                    }
                }
                Correction::Trim(_) => {}
                Correction::OfArea(area, map) => {
                    for (number, plane) in planes.iter_mut().enumerate() {
                        if number >= area.plane && number - area.plane < area.planes {
                            let scale = scales.get(number).copied().unwrap_or(1.0);
                            area.change(plane, place, map, (number, scale, top));
                        }
                    }
                }
            }
        }
        planes
    }

    /// Takes out what trims the image, which only the last list can: the names of what is left out are among those not known.
    pub(super) fn without_trimming(mut self) -> Self {
        let is_trim = |step: &Correction| matches!(step, Correction::Trim(_));
        if self.steps.iter().any(is_trim) {
            self.steps.retain(|step| !is_trim(step));
            self.names.retain(|name| name != "TrimBounds");
            self.unknown.push("TrimBounds".to_owned());
        }
        self
    }

    /// Returns the rows and columns of an image that are left when it is trimmed: top, left, bottom, right.
    pub(super) fn trimmed(&self, (rows, columns): (usize, usize)) -> [usize; 4] {
        let mut left = [0, 0, rows, columns];
        for step in &self.steps {
            if let Correction::Trim(bounds) = step {
                let whole = |value: i32, most: usize| usize::try_from(value).unwrap_or(0).min(most);
                let [top, first, bottom, last] = *bounds;
                left = [
                    left[0].max(whole(top, rows)),
                    left[1].max(whole(first, columns)),
                    left[2].min(whole(bottom, rows)),
                    left[3].min(whole(last, columns)),
                ];
            }
        }
        left
    }
}

impl Correction {
    fn read(number: usize, mut parameters: Parameters<'_>) -> Result<Self, String> {
        let p = &mut parameters;
        Ok(match number {
            1 | 2 | 14 => {
                let bytes_of_plane = match number {
                    1 => 48,
                    2 => 32,
                    _ => 152,
                };
                let n = p.count(bytes_of_plane)?;
                if n == 0 {
                    return Err(format!("has a {} of no plane", p.name));
                }
                let mut planes = (0..n).map(|_| Warp::read(number, p)).collect::<Result<Vec<_>, _>>()?;
                let center = p.numbers()?;
                if number == 14 {
                    let is_reciprocal = p.whole()? != 0;
                    planes.iter_mut().for_each(|warp| warp.is_reciprocal = is_reciprocal);
                }
                Self::Warp { planes, center }
            }
            3 => Self::Vignette { factors: p.numbers()?, center: p.numbers()? },
            4 => Self::BadConstant(p.whole()?),
            5 => {
                let (_phase, n_points, n_rectangles) = (p.whole()?, p.whole()? as usize, p.whole()? as usize);
                let needed =
                    n_points.checked_mul(8).zip(n_rectangles.checked_mul(16)).and_then(|(a, b)| a.checked_add(b));
                if needed.is_none_or(|needed| needed > p.bytes.len()) {
                    return Err(format!(
                        "has a {} of {n_points} pixels and {n_rectangles} rectangles, more than its bytes hold",
                        p.name
                    ));
                }
                let points = (0..n_points).map(|_| Ok([p.whole()?, p.whole()?])).collect::<Result<_, String>>()?;
                let rectangle = |_| Ok([p.whole()?, p.whole()?, p.whole()?, p.whole()?]);
                Self::BadList { points, rectangles: (0..n_rectangles).map(rectangle).collect::<Result<_, String>>()? }
            }
            6 => Self::Trim([p.whole()? as i32, p.whole()? as i32, p.whole()? as i32, p.whole()? as i32]),
            7 => {
                let area = p.area()?;
                let n = p.count(2)?;
                let table: Vec<u16> =
                    (0..n).map(|_| Ok(u16::from_be_bytes(p.take()?))).collect::<Result<_, String>>()?;
                if table.is_empty() {
                    return Err(format!("has a {} without entries", p.name));
                }
                Self::OfArea(area, Map::Table(table))
            }
            8 => {
                let area = p.area()?;
                let degree = p.whole()? as usize;
                if degree > HIGHEST_DEGREE {
                    return Err(format!("has a {} of degree {degree}, expected at most {HIGHEST_DEGREE}", p.name));
                }
                let factors = (0..=degree).map(|_| p.number()).collect::<Result<_, String>>()?;
                Self::OfArea(area, Map::Polynomial(factors))
            }
            9 => Self::OfArea(p.area()?, Map::Gain(GainMap::read(p)?)),
            _ => {
                let area = p.area()?;
                let is_of_rows = number.is_multiple_of(2);
                let lines = if is_of_rows {
                    p.lines(area.bottom - area.top, area.row_pitch)?
                } else {
                    p.lines(area.right - area.left, area.column_pitch)?
                };
                let map = match number {
                    10 => Map::AddToRows(lines),
                    11 => Map::AddToColumns(lines),
                    12 => Map::ScaleRows(lines),
                    _ => Map::ScaleColumns(lines),
                };
                Self::OfArea(area, map)
            }
        })
    }
}

impl Warp {
    fn read(number: usize, p: &mut Parameters<'_>) -> Result<Self, String> {
        let everywhere = [0.0, f64::INFINITY];
        Ok(match number {
            1 => {
                let [a, b, c, d]: [f64; 4] = p.numbers()?;
                // Factors of r⁰, r², r⁴ and r⁶.
                let radial = vec![a, 0.0, b, 0.0, c, 0.0, d];
                Self { radial, tangential: p.numbers()?, valid: everywhere, is_fisheye: false, is_reciprocal: false }
            }
            2 => {
                let [a, b, c, d]: [f64; 4] = p.numbers()?;
                // Factors of θ, θ³, θ⁵ and θ⁷.
                let radial = vec![0.0, a, 0.0, b, 0.0, c, 0.0, d];
                Self { radial, tangential: [0.0; 2], valid: everywhere, is_fisheye: true, is_reciprocal: false }
            }
            _ => {
                let radial = p.numbers::<15>()?.to_vec();
                let (tangential, valid) = (p.numbers()?, p.numbers()?);
                Self { radial, tangential, valid, is_fisheye: false, is_reciprocal: false }
            }
        })
    }

    /// Returns where the light of a place comes from; both from the center.
    fn source(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r = x.hypot(y);
        let held = r.clamp(self.valid[0].min(self.valid[1]), self.valid[1]);
        let at = if self.is_fisheye { held.atan() } else { held };
        let sum = self.radial.iter().rev().fold(0.0, |sum, factor| sum * at + factor);
        let factor = match (self.is_fisheye, self.is_reciprocal) {
            (true, _) if r > 0.0 => sum / r,
            (true, _) => self.radial[1],
            (false, true) => 1.0 / sum,
            (false, false) => sum,
        };
        let [k0, k1] = self.tangential;
        let r2 = r * r;
        [
            x * factor + 2.0 * k0 * x * y + k1 * (r2 + 2.0 * x * x),
            y * factor + 2.0 * k1 * x * y + k0 * (r2 + 2.0 * y * y),
        ]
    }
}

/// A center of a polynomial in pixels of planes, and the distance to the farthest corner of the image.
struct Polar {
    column: f64,
    row: f64,
    farthest: f64,
}

impl Polar {
    /// The image reaches from the middle of its first pixel to that of its last.
    fn new([right, down]: [f64; 2], place: Place) -> Self {
        let (width, height) = ((place.columns - 1) as f64, (place.rows - 1) as f64);
        let farthest = |share: f64, size: f64| (share * size).abs().max(((1.0 - share) * size).abs());
        Self {
            column: right * width - place.left as f64,
            row: down * height - place.top as f64,
            farthest: farthest(right, width).hypot(farthest(down, height)).max(1.0),
        }
    }

    fn off_center(&self, row: usize, column: usize) -> [f64; 2] {
        [(column as f64 - self.column) / self.farthest, (row as f64 - self.row) / self.farthest]
    }
}

/// Returns planes whose samples come from other places; one plane's warp counts for all that have none.
fn warped(planes: &[Array2<f32>], warps: &[Warp], center: [f64; 2], place: Place) -> Vec<Array2<f32>> {
    let (rows, columns) = planes[0].dim();
    let polar = Polar::new(center, place);
    let mut out: Vec<Array2<f32>> = planes.iter().map(|_| Array2::zeros((rows, columns))).collect();
    let is_on = |at: f64, n: usize| at >= -BORDER_PX && at <= (n - 1) as f64 + BORDER_PX;
    plane_rows(&mut out).into_par_iter().enumerate().for_each(|(row, mut lines)| {
        let mut sources = vec![[0.0; 2]; planes.len()];
        for column in 0..columns {
            let at = polar.off_center(row, column);
            for (number, source) in sources.iter_mut().enumerate() {
                let [x, y] = warps[number.min(warps.len() - 1)].source(at);
                *source = [polar.column + polar.farthest * x, polar.row + polar.farthest * y];
            }
            if sources.iter().all(|[x, y]| is_on(*x, columns) && is_on(*y, rows)) {
                for ((line, plane), [x, y]) in lines.iter_mut().zip(planes).zip(&sources) {
                    line[column] = sample_at(plane, *x, *y);
                }
            }
        }
    });
    out
}

fn even_out(planes: &mut [Array2<f32>], factors: &[f64; 5], center: [f64; 2], place: Place, top: f32) {
    let polar = Polar::new(center, place);
    for plane in planes {
        plane.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut line)| {
            for (column, value) in line.iter_mut().enumerate() {
                let [x, y] = polar.off_center(row, column);
                let r2 = x * x + y * y;
                let gain = 1.0 + r2 * factors.iter().rev().fold(0.0, |sum, factor| sum * r2 + factor);
                *value = (*value * gain as f32).min(top.max(*value));
            }
        });
    }
}

impl GainMap {
    fn read(p: &mut Parameters<'_>) -> Result<Self, String> {
        let points = [p.whole()? as usize, p.whole()? as usize];
        let (spacing, origin) = (p.numbers()?, p.numbers()?);
        let n_planes = p.whole()? as usize;
        let n = points[0].checked_mul(points[1]).and_then(|n| n.checked_mul(n_planes));
        match n {
            Some(n) if n > 0 && n <= p.bytes.len() / 4 => {
                Ok(Self { points, spacing, origin, n_planes, factors: p.singles(n)? })
            }
            _ => Err(format!(
                "has a {} of {points:?} points for {n_planes} planes, expected as many as its bytes hold",
                p.name
            )),
        }
    }

    /// Returns for each of so many lines, from the first of all of an axis, the point before it and how far it is to the next.
    fn along(&self, axis: usize, (first, n): (usize, usize), all: usize) -> Vec<(usize, f32)> {
        let last = self.points[axis] - 1;
        let at = |line: usize| {
            let share = ((first + line) as f64 + 0.5) / all as f64;
            let point = match self.spacing[axis] {
                spacing if spacing > 0.0 => ((share - self.origin[axis]) / spacing).clamp(0.0, last as f64),
                _ => 0.0,
            };
            let before = (point as usize).min(last.saturating_sub(1));
            (before, (point - before as f64) as f32)
        };
        (0..n).map(at).collect()
    }

    fn factor(&self, (down, part_down): (usize, f32), (right, part_right): (usize, f32), plane: usize) -> f32 {
        let of = |down: usize, right: usize| {
            let (down, right) = (down.min(self.points[0] - 1), right.min(self.points[1] - 1));
            self.factors[(down * self.points[1] + right) * self.n_planes + plane.min(self.n_planes - 1)]
        };
        let mix = |a: f32, b: f32, part: f32| a + part * (b - a);
        let above = mix(of(down, right), of(down, right + 1), part_right);
        mix(above, mix(of(down + 1, right), of(down + 1, right + 1), part_right), part_down)
    }
}

impl Area {
    /// Returns which of so many lines from the first on are changed, each with its number among those of the area.
    fn lines(from: usize, to: usize, pitch: usize, (first, n): (usize, usize)) -> Vec<Option<usize>> {
        let number = |line: usize| {
            let line = first + line;
            (line >= from && line < to && (line - from).is_multiple_of(pitch)).then(|| (line - from) / pitch)
        };
        (0..n).map(number).collect()
    }

    fn change(&self, plane: &mut Array2<f32>, place: Place, map: &Map, (number, scale, top): (usize, f32, f32)) {
        let (n_rows, n_columns) = plane.dim();
        let (down, across) = ((place.top, n_rows), (place.left, n_columns));
        let rows = Self::lines(self.top, self.bottom, self.row_pitch, down);
        let columns = Self::lines(self.left, self.right, self.column_pitch, across);
        let points = match map {
            Map::Gain(map) => (map.along(0, down, place.rows), map.along(1, across, place.columns)),
            _ => (Vec::new(), Vec::new()),
        };
        plane.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut line)| {
            let Some(own_row) = rows[row] else { return };
            for (column, value) in line.iter_mut().enumerate() {
                let Some(own_column) = columns[column] else { continue };
                let light = *value / scale;
                let of = |lines: &[f32], i: usize, absent: f32| lines.get(i).copied().unwrap_or(absent);
                let changed = match map {
                    Map::Table(table) => {
                        let code = (light.clamp(0.0, 1.0) * TOP).round() as usize;
                        f32::from(table[code.min(table.len() - 1)]) / TOP
                    }
                    Map::Polynomial(factors) => {
                        let x = f64::from(light.clamp(0.0, 1.0));
                        factors.iter().rev().fold(0.0, |sum, factor| sum * x + factor).clamp(0.0, 1.0) as f32
                    }
                    Map::Gain(map) => light * map.factor(points.0[row], points.1[column], number),
                    Map::AddToRows(lines) => light + of(lines, own_row, 0.0),
                    Map::AddToColumns(lines) => light + of(lines, own_column, 0.0),
                    Map::ScaleRows(lines) => light * of(lines, own_row, 1.0),
                    Map::ScaleColumns(lines) => light * of(lines, own_column, 1.0),
                };
                *value = changed.min(top.max(light)) * scale;
            }
        });
    }
}

fn bad_pixels(
    (rows, columns): (usize, usize),
    points: &[[u32; 2]],
    rectangles: &[[u32; 4]],
    place: Place,
) -> Array2<bool> {
    let mut is_bad = Array2::from_elem((rows, columns), false);
    let own = |value: u32, first: usize| (value as usize).checked_sub(first);
    for [row, column] in points {
        if let (Some(row), Some(column)) = (own(*row, place.top), own(*column, place.left))
            && let Some(bad) = is_bad.get_mut((row, column))
        {
            *bad = true;
        }
    }
    for [top, left, bottom, right] in rectangles {
        let within = |value: u32, first: usize, n: usize| (value as usize).saturating_sub(first).min(n);
        let down = within(*top, place.top, rows)..within(*bottom, place.top, rows);
        let across = within(*left, place.left, columns)..within(*right, place.left, columns);
        if !down.is_empty() && !across.is_empty() {
            is_bad.slice_mut(ndarray::s![down, across]).fill(true);
        }
    }
    is_bad
}

/// Replaces bad pixels by the mean of the nearest sound ones of the same filter, those at one distance; by the next ones too where one stands alone.
fn mend(plane: &mut Array2<f32>, is_bad: &Array2<bool>, is_same: &(dyn Fn([usize; 2], [usize; 2]) -> bool + Sync)) {
    let (rows, columns) = plane.dim();
    let mut around: Vec<(isize, isize)> = (-FARTHEST_NEIGHBOR..=FARTHEST_NEIGHBOR)
        .flat_map(|down| (-FARTHEST_NEIGHBOR..=FARTHEST_NEIGHBOR).map(move |right| (down, right)))
        .filter(|offset| *offset != (0, 0))
        .collect();
    let distance = |&(down, right): &(isize, isize)| down * down + right * right;
    around.sort_by_key(distance);
    let mut mended = Vec::new();
    for ((row, column), _) in is_bad.indexed_iter().filter(|(_, is_bad)| **is_bad) {
        let (mut sum, mut n, mut reached) = (0.0, 0.0, 0);
        for offset in &around {
            if n >= 2.0 && distance(offset) > reached {
                break;
            }
            let (Some(r), Some(c)) = (row.checked_add_signed(offset.0), column.checked_add_signed(offset.1)) else {
                continue;
            };
            if r < rows && c < columns && !is_bad[(r, c)] && is_same([row, column], [r, c]) {
                (sum, n, reached) = (sum + plane[(r, c)], n + 1.0, distance(offset));
            }
        }
        if n > 0.0 {
            mended.push(((row, column), sum / n));
        }
    }
    mended.into_iter().for_each(|(at, value)| plane[at] = value);
}
