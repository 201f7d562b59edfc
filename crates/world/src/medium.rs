//! What fills space and takes light there, scatters it or glows.
//!
//! A medium is even, or as dense from place to place as a grid of numbers or a formula says. What is computed for a ray
//! is a bound of its density piece by piece ([`Medium::pieces`]), by which an integrator draws where light may be
//! scattered, and what the medium does at a point ([`Medium::at`]).

use std::{
    f32::consts::{PI, TAU},
    sync::Arc,
};

use dioptric_spectrum::{SmoothReflectance, lanes, planck};
use glam::{DAffine3, DVec3, Vec3};

use crate::{MediumId, Ray, SpectralCurve, WorldError, procedural, sampling::Frame};

/// What fills space.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// What it absorbs of light, 1/m, where its density is 1.
    pub absorption: SpectralCurve,
    /// What it scatters of light, 1/m, where its density is 1.
    pub scattering: SpectralCurve,
    /// The mean cosine of the angle by which light is scattered, −1 to 1 (Henyey & Greenstein 1941); 0 for all directions alike.
    pub asymmetry: f32,
    /// How it glows: the radiance, W m⁻² sr⁻¹ nm⁻¹, of a body of it so deep that nothing is seen through, were it not to scatter.
    pub glow: Option<Glow>,
    /// How dense it is where.
    pub density: Density,
}

/// How a medium glows.
#[derive(Clone, Debug, PartialEq)]
pub enum Glow {
    /// By a spectrum, times a number of each place where there is a grid.
    Spectrum(SpectralCurve, Option<Field>),
    /// As a black body whose peak is 1, times a number of each place where there is a grid: of the temperature (T − `offset`) · `scale`, K.
    Hot {
        /// T.
        temperature: Field,
        /// What counts for nothing of it.
        offset: f32,
        /// Kelvin per unit.
        scale: f32,
        /// What the light is multiplied by.
        factor: (f32, Option<Field>),
    },
    /// By a color of each place.
    Colors(Field, f32),
}

/// How dense a medium is from place to place, 1 being what its spectra say.
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// 1 all over.
    Even,
    /// Within a box, by what is in it; nothing outside.
    Box(Arc<FilledBox>),
}

/// A box that holds a medium.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledBox {
    unit_from_world: DAffine3,
    filling: Filling,
    /// Bounds of the density in cells of the box.
    bounds: Bounds,
}

/// What is in a box, each over the unit cube.
#[derive(Clone, Debug, PartialEq)]
pub enum Filling {
    /// Numbers that the spectra are multiplied by.
    Numbers(Field),
    /// Colors that what is absorbed and what is scattered are multiplied by; 1 where there is none.
    Colors {
        /// Of what is absorbed.
        absorption: Option<Field>,
        /// Of what is scattered.
        scattering: Option<Field>,
    },
    /// The cloud of pbrt's fourth version: noise that is denser below.
    Cloud {
        /// Where the cube's corner is in the frame of the noise, and the lengths of its sides.
        corner: Vec3,
        /// Lengths of its sides.
        size: Vec3,
        /// How dense it is in the middle.
        density: f32,
        /// How much it is torn.
        wispiness: f32,
        /// How fine its noise is.
        frequency: f32,
    },
}

/// Numbers, or colors of three, in the middles of the cells of a grid over the unit cube, x first; between them all is linear, and
/// outside it is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    size: [usize; 3],
    n_channels: usize,
    values: Vec<f32>,
}

/// What a medium does at a point, at these wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients<const N: usize> {
    /// What is absorbed, 1/m.
    pub absorption: [f32; N],
    /// What is scattered, 1/m.
    pub scattering: [f32; N],
    /// The radiance of what glows, W m⁻² sr⁻¹ nm⁻¹: a length adds its absorption times it.
    pub glow: [f32; N],
}

/// A piece of a ray, within which no density is above its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Where it begins, m along the ray.
    pub from_m: f32,
    /// Where it ends.
    pub to_m: f32,
    /// What [`Medium::at_most`] is multiplied by.
    pub density: f32,
}

/// The greatest value of each cell of a coarser grid over the unit cube.
#[derive(Clone, Debug, PartialEq)]
struct Bounds {
    size: [usize; 3],
    greatest: Vec<f32>,
}

/// The media on both sides of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interface {
    /// What fills the shape, on the side that its normals point away from; none for clear space.
    pub inside: Option<MediumId>,
    /// What is on the other side.
    pub outside: Option<MediumId>,
}

impl Interface {
    /// The media on both sides, of which clear space is none.
    pub(crate) fn sides(self) -> impl Iterator<Item = MediumId> {
        [self.inside, self.outside].into_iter().flatten()
    }

    /// Returns the same of media by other numbers.
    pub(crate) fn renumbered(self, mut number: impl FnMut(MediumId) -> MediumId) -> Self {
        Self { inside: self.inside.map(&mut number), outside: self.outside.map(&mut number) }
    }

    /// Returns what is on the side that a direction from the surface points to.
    pub(crate) fn towards(&self, direction: Vec3, normal: Vec3) -> Option<MediumId> {
        if direction.dot(normal) > 0.0 { self.outside } else { self.inside }
    }
}

/// Values of a field: as many as 2048³ would have are too many.
const MOST_VALUES: usize = 1 << 30;
/// Cells of bounds along an axis.
const MOST_CELLS: usize = 64;
/// Values of a field along each side of a cell of its bounds.
const PER_CELL: usize = 4;
/// Scattering in one direction alone would not end.
const GREATEST_ASYMMETRY: f32 = 0.999;

impl Field {
    /// Returns a field of so many values along x, y and z, of one or three channels each.
    ///
    /// # Errors
    /// When there are not so many values, or one is below 0 or not finite.
    pub fn new(size: [usize; 3], n_channels: usize, values: Vec<f32>) -> Result<Self, WorldError> {
        let wrong = |value: String, expected| WorldError::Setting { what: "the grid of a medium", value, expected };
        let n =
            size.iter().try_fold(n_channels, |n, &side| n.checked_mul(side)).filter(|n| (1..=MOST_VALUES).contains(n));
        if n != Some(values.len()) {
            let found = format!("{} values for {size:?} of {n_channels}", values.len());
            return Err(wrong(found, "as many values as its sides say, up to 2^30"));
        }
        if let Some(value) = values.iter().find(|v| !(**v >= 0.0 && v.is_finite())) {
            return Err(wrong(value.to_string(), "finite numbers of 0 or more"));
        }
        Ok(Self { size, n_channels, values })
    }

    /// Returns the value at a point of the unit cube.
    fn at<const C: usize>(&self, p: Vec3) -> [f32; C] {
        let [nx, ny, nz] = self.size;
        let at = p * Vec3::new(nx as f32, ny as f32, nz as f32) - 0.5;
        let low = at.floor();
        let d = at - low;
        let mut sum = [0.0; C];
        for corner in 0..8 {
            let offset = [corner & 1, (corner >> 1) & 1, corner >> 2];
            let mut weight = 1.0;
            let mut index = 0;
            let mut is_within = true;
            for axis in [2, 1, 0] {
                let i = low[axis] as isize + offset[axis] as isize;
                is_within &= i >= 0 && (i as usize) < self.size[axis];
                weight *= if offset[axis] == 1 { d[axis] } else { 1.0 - d[axis] };
                index = index * self.size[axis] as isize + i;
            }
            if is_within {
                let first = index as usize * self.n_channels;
                for (channel, sum) in sum.iter_mut().enumerate() {
                    *sum += weight * self.values[first + channel.min(self.n_channels - 1)];
                }
            }
        }
        sum
    }

    /// Returns the greatest value of any channel in a box of the unit cube, from `low` to `high` of so many parts along an axis.
    fn greatest_in(&self, cell: [usize; 3], of: [usize; 3]) -> f32 {
        let range = |axis: usize| {
            let n = self.size[axis] as f64;
            let place = |i: usize| n * i as f64 / of[axis] as f64 - 0.5;
            let first = place(cell[axis]).floor().max(0.0) as usize;
            let last = (place(cell[axis] + 1).floor() as isize + 1).clamp(0, self.size[axis] as isize - 1) as usize;
            first.min(last)..=last
        };
        let mut greatest = 0.0_f32;
        for z in range(2) {
            for y in range(1) {
                let row = (z * self.size[1] + y) * self.size[0];
                let values = row + range(0).start()..row + range(0).end() + 1;
                let of_row = &self.values[values.start * self.n_channels..values.end * self.n_channels];
                greatest = of_row.iter().copied().fold(greatest, f32::max);
            }
        }
        greatest
    }
}

impl FilledBox {
    /// Returns what fills the unit cube where it is placed.
    pub fn new(world_from_unit: DAffine3, filling: Filling) -> Self {
        let bounds = Bounds::of(&filling);
        Self { unit_from_world: world_from_unit.inverse(), filling, bounds }
    }

    fn check(&self) -> bool {
        self.unit_from_world.is_finite()
    }
}

impl Bounds {
    fn of(filling: &Filling) -> Self {
        let cells = |size: [usize; 3]| size.map(|n| n.div_ceil(PER_CELL).clamp(1, MOST_CELLS));
        let (size, fields): ([usize; 3], Vec<&Field>) = match filling {
            Filling::Numbers(field) => (cells(field.size), vec![field]),
            Filling::Colors { absorption, scattering } => {
                let fields: Vec<&Field> = absorption.iter().chain(scattering).collect();
                (
                    fields.iter().fold([1; 3], |most, field| {
                        let own = cells(field.size);
                        std::array::from_fn(|axis| most[axis].max(own[axis]))
                    }),
                    fields,
                )
            }
            Filling::Cloud { .. } => ([1; 3], vec![]),
        };
        // A color that isn't given is 1.
        let besides = match filling {
            Filling::Numbers(_) => 0.0,
            Filling::Colors { .. } => 2.0 - fields.len() as f32,
            Filling::Cloud { .. } => 1.0,
        };
        let n: usize = size.iter().product();
        let of_cell = |index: usize| {
            let cell = [index % size[0], index / size[0] % size[1], index / (size[0] * size[1])];
            besides + fields.iter().map(|field| field.greatest_in(cell, size)).sum::<f32>()
        };
        Self { size, greatest: (0..n).map(of_cell).collect() }
    }
}

impl Medium {
    /// Returns a medium that is the same all over, and doesn't glow.
    pub fn even(absorption: SpectralCurve, scattering: SpectralCurve, asymmetry: f32) -> Self {
        Self { absorption, scattering, asymmetry, glow: None, density: Density::Even }
    }

    /// Returns the medium where a transform puts it: per metre it does what it did.
    pub(crate) fn moved(&self, by: &DAffine3) -> Self {
        let density = match &self.density {
            Density::Even => Density::Even,
            Density::Box(filled) => {
                let unit_from_world = filled.unit_from_world * by.inverse();
                Density::Box(Arc::new(FilledBox { unit_from_world, ..(**filled).clone() }))
            }
        };
        Self { density, ..self.clone() }
    }

    pub(crate) fn check(&self) -> Result<(), WorldError> {
        let wrong = |what, value: f32, expected| Err(WorldError::Setting { what, value: value.to_string(), expected });
        if !(-1.0..=1.0).contains(&self.asymmetry) {
            return wrong("the asymmetry of a medium", self.asymmetry, "-1 to 1");
        }
        if let Density::Box(filled) = &self.density
            && !filled.check()
        {
            return wrong("the place of a medium", f32::NAN, "a transform that doesn't flatten it");
        }
        for (what, curve) in [("what a medium absorbs", &self.absorption), ("what a medium scatters", &self.scattering)]
        {
            let values: [f32; 46] = curve.at(&std::array::from_fn(|i| 250.0 + 50.0 * i as f32));
            if let Some(value) = values.iter().find(|v| !(**v >= 0.0 && v.is_finite())) {
                return wrong(what, *value, "finite numbers of 0 or more, 1/m");
            }
        }
        Ok(())
    }

    /// Whether it is the same all over.
    pub fn is_even(&self) -> bool {
        self.density == Density::Even
    }

    /// Returns the density that the light of a ray may meet up to a length, piece by piece; none where it is 0 for sure.
    pub fn pieces(&self, ray: &Ray, length_m: f32) -> Pieces<'_> {
        match &self.density {
            Density::Even => Pieces::Even(Some(Piece { from_m: 0.0, to_m: length_m, density: 1.0 })),
            Density::Box(filled) => {
                let origin = filled.unit_from_world.transform_point3(ray.origin.as_dvec3());
                let direction = filled.unit_from_world.transform_vector3(ray.direction.as_dvec3());
                Pieces::Cells(Walk::new(&filled.bounds, origin, direction, length_m))
            }
        }
    }

    /// Returns what no coefficient of extinction, 1/m, is above where the bound of the density is 1.
    pub fn at_most<const N: usize>(&self, wavelengths_nm: &[f32; N]) -> [f32; N] {
        let (a, s) = (self.absorption.at(wavelengths_nm), self.scattering.at(wavelengths_nm));
        match &self.density {
            Density::Box(filled) if matches!(filled.filling, Filling::Colors { .. }) => lanes(|i| a[i].max(s[i])),
            _ => lanes(|i| a[i] + s[i]),
        }
    }

    /// Returns what the medium does at a point.
    pub fn at<const N: usize>(&self, point: Vec3, wavelengths_nm: &[f32; N]) -> Coefficients<N> {
        let (a, s) = (self.absorption.at(wavelengths_nm), self.scattering.at(wavelengths_nm));
        let Density::Box(filled) = &self.density else {
            return Coefficients { absorption: a, scattering: s, glow: self.glow_at(Vec3::ZERO, wavelengths_nm) };
        };
        let p = filled.unit_from_world.transform_point3(point.as_dvec3()).as_vec3();
        let glow = self.glow_at(p, wavelengths_nm);
        let density = match &filled.filling {
            Filling::Numbers(field) => field.at::<1>(p)[0],
            Filling::Cloud { corner, size, density, wispiness, frequency } => {
                let is_within = p.cmpge(Vec3::ZERO).all() && p.cmple(Vec3::ONE).all();
                if is_within { cloud(*corner + p * *size, [*density, *wispiness, *frequency]) } else { 0.0 }
            }
            Filling::Colors { absorption, scattering } => {
                let lifted =
                    |field: &Option<Field>| field.as_ref().map_or([1.0; N], |f| lifted(f.at(p), wavelengths_nm));
                let [of_a, of_s] = [absorption, scattering].map(lifted);
                return Coefficients {
                    absorption: lanes(|i| a[i] * of_a[i]),
                    scattering: lanes(|i| s[i] * of_s[i]),
                    glow,
                };
            }
        };
        Coefficients { absorption: lanes(|i| density * a[i]), scattering: lanes(|i| density * s[i]), glow }
    }

    /// Returns the radiance of what glows at a point of the unit cube.
    fn glow_at<const N: usize>(&self, p: Vec3, wavelengths_nm: &[f32; N]) -> [f32; N] {
        let times = |field: &Option<Field>| field.as_ref().map_or(1.0, |field| field.at::<1>(p)[0]);
        match &self.glow {
            None => [0.0; N],
            Some(Glow::Spectrum(curve, field)) => {
                let by = times(field);
                curve.at(wavelengths_nm).map(|radiance| by * radiance)
            }
            Some(Glow::Colors(field, by)) => SpectralCurve::light_at(field.at(p), wavelengths_nm).map(|l| by * l),
            Some(Glow::Hot { temperature, offset, scale, factor: (by, field) }) => {
                let kelvin = f64::from((temperature.at::<1>(p)[0] - offset) * scale);
                // Colder than this nothing of it is seen.
                if kelvin <= 100.0 {
                    return [0.0; N];
                }
                let by = f64::from(by * times(field)) / dioptric_spectrum::blackbody_peak(kelvin);
                wavelengths_nm.map(|nm| (by * planck(f64::from(nm), kelvin)) as f32)
            }
        }
    }

    /// Returns the density, 1/sr, with which light is scattered by an angle, and drawn there.
    pub fn phase(&self, cosine: f32) -> f32 {
        let g = self.asymmetry();
        // 1 + g² − 2 g cos without its cancellation where light goes on nearly straight.
        let root = (1.0 - g.abs()).powi(2) + 2.0 * g.abs() * (1.0 - g.signum() * cosine).max(0.0);
        (1.0 - g * g) / (2.0 * TAU * root * root.sqrt())
    }

    /// Draws the direction that scattered light comes from which goes on against `direction`, both of length 1; along a path from the
    /// camera the one that it goes on in.
    pub fn sample_phase(&self, direction: Vec3, u: [f32; 2]) -> Vec3 {
        let g = self.asymmetry();
        let cosine = if g.abs() < 1e-3 {
            2.0 * u[0] - 1.0
        } else {
            let root = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]);
            ((1.0 + g * g - root * root) / (2.0 * g)).clamp(-1.0, 1.0)
        };
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (y, x) = (2.0 * PI * u[1]).sin_cos();
        Frame::about(direction).to_world(Vec3::new(sine * x, sine * y, cosine)).normalize()
    }

    fn asymmetry(&self) -> f32 {
        self.asymmetry.clamp(-GREATEST_ASYMMETRY, GREATEST_ASYMMETRY)
    }
}

/// Returns the smooth spectrum of a color whose largest part may be beyond 1; it is never above that part.
fn lifted<const N: usize>(rgb: [f32; 3], wavelengths_nm: &[f32; N]) -> [f32; N] {
    let most = rgb.into_iter().fold(0.0, f32::max);
    if most <= 0.0 {
        return [0.0; N];
    }
    SmoothReflectance::of_rgb(rgb.map(|v| v / most)).at(wavelengths_nm).map(|share| most * share.clamp(0.0, 1.0))
}

/// The density of pbrt's cloud, 0 to 1.
fn cloud(p: Vec3, [density, wispiness, frequency]: [f32; 3]) -> f32 {
    let mut torn = frequency * p;
    if wispiness > 0.0 {
        let (mut by, mut size) = (0.05 * wispiness, 10.0);
        for _ in 0..2 {
            torn += by * procedural::noise_vector(size * torn);
            (by, size) = (0.5 * by, 1.99 * size);
        }
    }
    let (mut sum, mut by, mut size) = (0.0, 0.5, 1.0);
    for _ in 0..5 {
        sum += by * procedural::noise(size * torn);
        (by, size) = (0.5 * by, 1.99 * size);
    }
    let thick = ((1.0 - p.y) * 4.5 * density * sum).clamp(0.0, 1.0) + 2.0 * (0.5 - p.y).max(0.0);
    thick.clamp(0.0, 1.0)
}

/// The pieces of a ray.
#[derive(Clone, Debug)]
pub enum Pieces<'a> {
    /// Of an even medium.
    Even(Option<Piece>),
    /// Of a box.
    Cells(Walk<'a>),
}

impl Iterator for Pieces<'_> {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        match self {
            Self::Even(piece) => piece.take(),
            Self::Cells(walk) => walk.find(|piece| piece.density > 0.0),
        }
    }
}

/// A walk from cell to cell (Amanatides & Woo 1987).
#[derive(Clone, Debug)]
pub struct Walk<'a> {
    bounds: &'a Bounds,
    /// In cells, per meter.
    origin: DVec3,
    direction: DVec3,
    cell: [isize; 3],
    at_m: f64,
    end_m: f64,
}

impl<'a> Walk<'a> {
    fn new(bounds: &'a Bounds, origin: DVec3, direction: DVec3, length_m: f32) -> Self {
        let size = DVec3::from_array(bounds.size.map(|n| n as f64));
        let (origin, direction) = (origin * size, direction * size);
        let (mut from, mut to) = (0.0_f64, f64::from(length_m));
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if d != 0.0 {
                let (a, b) = (-o / d, (size[axis] - o) / d);
                (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
            } else if !(0.0..=size[axis]).contains(&o) {
                to = -1.0;
            }
        }
        let start = origin + from * direction;
        let cell = std::array::from_fn(|axis| (start[axis].floor() as isize).clamp(0, bounds.size[axis] as isize - 1));
        Self { bounds, origin, direction, cell, at_m: from, end_m: to }
    }

    /// Where the ray leaves the cell along an axis.
    fn leaves_m(&self, axis: usize) -> f64 {
        let d = self.direction[axis];
        let side = self.cell[axis] as f64 + if d > 0.0 { 1.0 } else { 0.0 };
        if d == 0.0 { f64::INFINITY } else { (side - self.origin[axis]) / d }
    }
}

impl Iterator for Walk<'_> {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        let size = self.bounds.size;
        let is_within = (0..3).all(|axis| (0..size[axis] as isize).contains(&self.cell[axis]));
        if !is_within || self.at_m >= self.end_m {
            return None;
        }
        let [x, y, z] = self.cell.map(|i| i as usize);
        let density = self.bounds.greatest[(z * size[1] + y) * size[0] + x];
        let leaves = [0, 1, 2].map(|axis| self.leaves_m(axis));
        let axis =
            if leaves[0] <= leaves[1] && leaves[0] <= leaves[2] { 0 } else { 1 + usize::from(leaves[2] < leaves[1]) };
        let to_m = leaves[axis].clamp(self.at_m, self.end_m);
        let piece = Piece { from_m: self.at_m as f32, to_m: to_m as f32, density };
        self.cell[axis] += if self.direction[axis] > 0.0 { 1 } else { -1 };
        self.at_m = to_m;
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(size: [usize; 3]) -> Field {
        let n = size.iter().product::<usize>() as u32;
        let values = (0..n).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 24) as f32 / 256.0).collect();
        Field::new(size, 1, values).unwrap()
    }

    fn boxed(filling: Filling) -> Medium {
        let place = DAffine3::from_translation(DVec3::new(-1.0, 0.5, 2.0))
            * DAffine3::from_rotation_y(0.7)
            * DAffine3::from_scale(DVec3::new(2.0, 1.0, 3.0));
        let [absorption, scattering] = [0.5, 1.5].map(SpectralCurve::constant);
        let density = Density::Box(Arc::new(FilledBox::new(place, filling)));
        Medium { absorption, scattering, asymmetry: 0.3, glow: None, density }
    }

    /// Pieces follow each other without gaps within the box, and no density is above their bound.
    #[test]
    fn bounds_hold_every_density() {
        let colors = Field::new([5, 3, 2], 3, (0..90).map(|i| (i * 37 % 90) as f32 / 45.0).collect()).unwrap();
        let cloud =
            Filling::Cloud { corner: Vec3::ZERO, size: Vec3::ONE, density: 1.0, wispiness: 1.0, frequency: 5.0 };
        let fillings = [
            Filling::Numbers(numbers([23, 17, 9])),
            Filling::Colors { absorption: None, scattering: Some(colors) },
            cloud,
        ];
        for medium in fillings.map(boxed) {
            let (mut n_pieces, mut n_dense) = (0, 0);
            for i in 0..300 {
                let turn = |by: f64| (by * f64::from(i)).sin();
                let direction = DVec3::new(turn(0.31), turn(0.77), 0.2 + turn(1.3)).normalize().as_vec3();
                let middle = DVec3::new(0.0, 1.0, 3.0).as_vec3();
                let ray =
                    Ray { origin: middle - 4.0 * direction + 0.3 * direction.any_orthonormal_vector(), direction };
                let mut at_m = None;
                for piece in medium.pieces(&ray, 9.0) {
                    assert!(at_m.is_none_or(|at_m: f32| piece.from_m >= at_m - 1e-5) && piece.to_m >= piece.from_m);
                    at_m = Some(piece.to_m);
                    n_pieces += 1;
                    for k in 0..8 {
                        let t = piece.from_m + (piece.to_m - piece.from_m) * (k as f32 + 0.5) / 8.0;
                        let local = medium.at(ray.origin + t * direction, &[450.0, 650.0]);
                        let most = medium.at_most(&[450.0, 650.0]);
                        for (lane, most) in most.into_iter().enumerate() {
                            let extinction = local.absorption[lane] + local.scattering[lane];
                            n_dense += u32::from(extinction > 0.0);
                            assert!(extinction <= piece.density * most * (1.0 + 1e-4), "{extinction} {piece:?}");
                        }
                    }
                }
                // Outside there is none.
                assert_eq!(medium.at(ray.origin, &[550.0]).scattering, [0.0]);
            }
            assert!(n_pieces >= 100 && n_dense > 100, "{n_pieces} {n_dense}");
        }
    }

    #[test]
    fn field_is_linear_between_its_values() {
        let field = Field::new([2, 1, 1], 1, vec![1.0, 3.0]).unwrap();
        let at = |x: f32| field.at::<1>(Vec3::new(x, 0.5, 0.5))[0];
        assert_eq!([0.25, 0.5, 0.75, 0.0].map(at), [1.0, 2.0, 3.0, 0.5]);
        assert!(Field::new([2, 2, 1], 1, vec![0.0; 3]).is_err() && Field::new([1; 3], 1, vec![-1.0]).is_err());
    }

    /// Directions are drawn by their density, whose integral is 1 and whose mean cosine is g.
    #[test]
    fn phase_has_its_mean_cosine() {
        for g in [-0.6_f32, 0.0, 0.3, 0.9] {
            let medium = Medium::even(SpectralCurve::constant(0.0), SpectralCurve::constant(1.0), g);
            let n = 40_000;
            let cosines = (0..n).map(|i| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
            let (mut integral, mut mean) = (0.0, 0.0);
            for cosine in cosines {
                let p = f64::from(medium.phase(cosine as f32)) * 2.0 * std::f64::consts::TAU / f64::from(n);
                integral += p;
                mean += p * cosine;
            }
            assert!((integral - 1.0).abs() < 1e-4 && (mean - f64::from(g)).abs() < 1e-4, "{g}: {integral} {mean}");
            let along = Vec3::new(0.6, -0.48, 0.64);
            let drawn: f64 = (0..n)
                .map(|i| {
                    let u = [(i as f32 + 0.5) / n as f32, (i as f32 * 0.618_034).fract()];
                    f64::from(medium.sample_phase(along, u).dot(along)) / f64::from(n)
                })
                .sum();
            assert!((drawn - f64::from(g)).abs() < 1e-3, "{g}: {drawn}");
        }
    }
}
