//! How the surfaces of the still life are painted: which pigments share them, and their relief.

use glam::DVec3;

use super::{
    floor_plan::CLOTH_HALF,
    marks::{cover, line, print, star, stripes},
    noise::{cloudy, smooth, unit},
    pigment::{Pigment, PigmentIndex},
};
use crate::{Pattern, PatternPoint};

/// A mixture of pigments: which, and the share of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mix {
    parts: [(PigmentIndex, f32); 4],
    len: usize,
}

impl Mix {
    fn one(pigment: PigmentIndex) -> Self {
        Self { parts: [(pigment, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)], len: 1 }
    }

    /// Covers a share of the mixture, 0–1, with another pigment.
    #[must_use]
    fn under(mut self, pigment: PigmentIndex, share: f64) -> Self {
        let share = share.clamp(0.0, 1.0) as f32;
        if share > 0.0 && self.len < self.parts.len() {
            self.parts[..self.len].iter_mut().for_each(|part| part.1 *= 1.0 - share);
            self.parts[self.len] = (pigment, share);
            self.len += 1;
        }
        self
    }

    /// Darkens or lightens the whole.
    #[must_use]
    fn times(mut self, factor: f64) -> Self {
        self.parts[..self.len].iter_mut().for_each(|part| part.1 *= factor as f32);
        self
    }

    fn parts(&self) -> &[(PigmentIndex, f32)] {
        &self.parts[..self.len]
    }
}

/// What is painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Paint {
    Room,
    Planks,
    Cloth,
    Plain(PigmentIndex),
    Apple { seed: u8 },
    Pear,
    Lemon,
    Orange,
    Vase,
    Chart,
    Card,
    Spine { pigment: PigmentIndex, seed: u8 },
    Pages,
    Label,
    Die,
    Picture,
    Walnut,
    Pencil(PigmentIndex),
}

impl Paint {
    /// The pigments that it mixes.
    pub(super) fn pigments(self) -> Vec<PigmentIndex> {
        use Pigment as P;
        let all = |pigments: &[P]| pigments.iter().map(|pigment| pigment.index()).collect::<Vec<_>>();
        let and = |pigment: PigmentIndex, others: &[P]| [vec![pigment], all(others)].concat();
        match self {
            Self::Room => all(&[P::Plaster, P::WallGreen, P::OakDark]),
            Self::Planks => all(&[P::OakLight, P::OakDark, P::Ink]),
            Self::Cloth => all(&[P::Linen, P::LinenShade, P::Indigo]),
            Self::Plain(pigment) => vec![pigment],
            Self::Apple { .. } => all(&[P::AppleRed, P::AppleYellow, P::PearGreen, P::Linen]),
            Self::Pear => all(&[P::PearGreen, P::AppleYellow, P::PearBrown]),
            Self::Lemon => all(&[P::Lemon]),
            Self::Orange => all(&[P::Orange]),
            Self::Vase => all(&[P::Porcelain, P::Cobalt]),
            Self::Chart => (0..24).map(Pigment::patch).chain(all(&[P::Ink, P::Charcoal])).collect(),
            Self::Card => all(&[P::Paper, P::Ink]),
            Self::Spine { pigment, .. } => and(pigment, &[P::Ochre]),
            Self::Pages => all(&[P::Paper]),
            Self::Label => all(&[P::Linen, P::Crimson, P::Ink]),
            Self::Die => all(&[P::Porcelain, P::Ink]),
            Self::Picture => [all(&[P::Paper, P::Linen, P::Orange, P::Indigo]), vec![Pigment::patch(12)]].concat(),
            Self::Walnut => all(&[P::WalnutLight, P::WalnutDark]),
            Self::Pencil(pigment) => and(pigment, &[P::Charcoal, P::OakLight]),
        }
    }

    /// Whether it has relief.
    pub(super) fn has_relief(self) -> bool {
        matches!(self, Self::Planks | Self::Cloth | Self::Lemon | Self::Orange)
    }

    /// Returns the mixture at a point, y up; details finer than `footprint`, in metres, are blurred away.
    fn mix(self, point: DVec3, normal: DVec3, footprint: f64) -> Mix {
        match self {
            Self::Room => room(point, normal, footprint),
            Self::Planks => planks(point, footprint),
            Self::Cloth => cloth(point, footprint),
            Self::Plain(pigment) => Mix::one(pigment),
            Self::Apple { seed } => apple(point, seed, footprint),
            Self::Pear => pear(point, footprint),
            Self::Lemon => peel(point, Pigment::Lemon, LEMON_PORES_PER_M, footprint),
            Self::Orange => peel(point, Pigment::Orange, ORANGE_PORES_PER_M, footprint),
            Self::Vase => vase(point, footprint),
            Self::Chart => chart(point, normal),
            Self::Card => card(point, normal, footprint),
            Self::Spine { pigment, seed } => spine(point, normal, pigment, seed, footprint),
            Self::Pages => {
                Mix::one(Pigment::Paper.index()).times(0.8 + 0.2 * smooth(DVec3::new(9.0, 1500.0 * point.y, 3.0)))
            }
            Self::Label => label(point, footprint),
            Self::Die => die(point, normal, footprint),
            Self::Picture => picture(point, normal, footprint),
            Self::Walnut => grain(point, Pigment::WalnutLight, Pigment::WalnutDark, footprint),
            Self::Pencil(pigment) => pencil(point, pigment),
        }
    }

    /// Returns what is added to the normal.
    fn tilt(self, point: DVec3, normal: DVec3, footprint: f64) -> DVec3 {
        match self {
            Self::Planks => grain_tilt(point, footprint),
            Self::Cloth if normal.y > 0.5 => 0.35 * folds(point),
            Self::Lemon => pores_tilt(point, LEMON_PORES_PER_M, footprint),
            Self::Orange => pores_tilt(point, ORANGE_PORES_PER_M, footprint),
            _ => DVec3::ZERO,
        }
    }
}

/// A paint with the pigments that it mixes, in the order of its textures.
#[derive(Debug)]
pub(super) struct Painted {
    pub(super) paint: Paint,
    pub(super) pigments: Vec<PigmentIndex>,
}

impl Pattern for Painted {
    fn shares(&self, at: &PatternPoint, shares: &mut [f32]) {
        let mix = self.paint.mix(y_up(at.point_m), y_up(at.normal), at.footprint_m);
        for (pigment, part) in mix.parts() {
            if let Some(place) = self.pigments.iter().position(|own| own == pigment) {
                shares[place] += part;
            }
        }
    }

    fn tilt(&self, at: &PatternPoint) -> DVec3 {
        let tilt = self.paint.tilt(y_up(at.point_m), y_up(at.normal), at.footprint_m);
        DVec3::new(tilt.x, -tilt.z, tilt.y)
    }
}

/// Where the second of two materials lies over the first.
#[derive(Debug)]
pub(super) enum Where {
    /// The label of the bottle.
    Label,
}

impl Pattern for Where {
    fn shares(&self, at: &PatternPoint, shares: &mut [f32]) {
        shares[0] = match self {
            Self::Label => f32::from(u8::from(is_label(y_up(at.point_m), at.footprint_m))),
        };
    }
}

/// How the glow of a surface varies.
#[derive(Debug)]
pub(super) enum Glow {
    /// Of the sky in the window of this height, from its lower edge: brighter higher up.
    Window {
        /// Where the lower edge of the whole window lies, m.
        low_m: f64,
        /// The height of the whole window, m.
        height_m: f64,
    },
    /// Of pleated cloth, brightest half-way up where the bulb is.
    Shade,
}

impl Pattern for Glow {
    fn shares(&self, at: &PatternPoint, shares: &mut [f32]) {
        let point = y_up(at.point_m);
        shares[0] = match self {
            Self::Window { low_m, height_m } => 0.85 + 0.5 * (point.y - low_m) / height_m,
            Self::Shade => {
                let pleats = 0.85 + 0.15 * (60.0 * point.z.atan2(point.x)).cos();
                let bulb = (-((point.y - 0.10) / 0.09).powi(2)).exp();
                pleats * (0.30 + 0.70 * bulb)
            }
        } as f32;
    }
}

/// Returns a vector of a shape, whose axis is z, in the frame in which y is up.
fn y_up(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.z, -v.y)
}

const LEMON_PORES_PER_M: f64 = 900.0;
const ORANGE_PORES_PER_M: f64 = 700.0;

/// The walls: one green, a floor of oak, the rest plaster. The normal points out of the room.
fn room(point: DVec3, normal: DVec3, footprint: f64) -> Mix {
    if normal.z > 0.5 {
        Mix::one(Pigment::WallGreen.index()).times(0.92 + 0.16 * cloudy(6.0 * point, 6.0 * footprint))
    } else if normal.y < -0.5 {
        Mix::one(Pigment::OakDark.index())
    } else {
        Mix::one(Pigment::Plaster.index())
    }
}

/// Wood: long fibres along z, and rings.
fn grain(point: DVec3, light: Pigment, dark: Pigment, footprint: f64) -> Mix {
    let bend = cloudy(DVec3::new(5.0 * point.x, 5.0 * point.y, 1.1 * point.z), 5.0 * footprint);
    let rings = 0.5 + 0.5 * (120.0 * (point.x + 0.7 * point.y) + 26.0 * bend).sin();
    let fibres = cloudy(DVec3::new(420.0 * point.x, 420.0 * point.y, 9.0 * point.z), 420.0 * footprint);
    Mix::one(light.index()).under(dark.index(), 0.08 + 0.60 * rings.powi(3) + 0.55 * (fibres - 0.45))
}

const PLANK_M: f64 = 0.145;

fn of_board(point: DVec3) -> (f64, DVec3) {
    let board = (point.x / PLANK_M).floor();
    (board, DVec3::new(3.7 * board, 0.0, 5.3 * board))
}

fn planks(point: DVec3, footprint: f64) -> Mix {
    let (board, shift) = of_board(point);
    let tone = 0.86 + 0.22 * unit(board as i64, 1, 5);
    let gap = line((point.x / PLANK_M - board - 0.5).abs() * PLANK_M - 0.5 * PLANK_M, 0.0012, footprint);
    grain(point + shift, Pigment::OakLight, Pigment::OakDark, footprint)
        .times(tone)
        .under(Pigment::Ink.index(), 0.85 * gap)
}

/// The grain stands up a little, so that the varnish breaks what it mirrors.
fn grain_tilt(point: DVec3, footprint: f64) -> DVec3 {
    let (_, shift) = of_board(point);
    let fade = (1.0 - footprint / 0.004).clamp(0.0, 1.0);
    let wave = cloudy(DVec3::new(160.0 * point.x, 0.0, 5.0 * point.z) + shift, 160.0 * footprint) - 0.5;
    DVec3::new(0.05 * fade * wave, 0.0, 0.0)
}

/// Woven linen with a border of indigo checks.
fn cloth(point: DVec3, footprint: f64) -> Mix {
    const PITCH: f64 = 0.0038;
    let border = |at: f64, edge: f64| {
        let from_edge = edge - at.abs();
        let wide = cover(from_edge - 0.022, footprint) * cover(0.050 - from_edge, footprint);
        let narrow = cover(from_edge - 0.058, footprint) * cover(0.066 - from_edge, footprint);
        wide.max(narrow)
    };
    let (warp, weft) = (border(point.x, CLOTH_HALF.x), border(point.z, CLOTH_HALF.z));
    let fade = (1.6 - 1.6 * footprint / PITCH).clamp(0.0, 1.0);
    let (u, v) = (std::f64::consts::PI * point.x / PITCH, std::f64::consts::PI * point.z / PITCH);
    let over = u.sin() * v.sin();
    // Where the warp lies on top its color shows, else that of the weft; afar both mix.
    let warp_on_top = 0.5 + 0.5 * fade * (6.0 * over).tanh();
    let dyed = warp * warp_on_top + weft * (1.0 - warp_on_top);
    let slub = cloudy(DVec3::new(300.0 * point.x, 2.0, 12.0 * point.z), 300.0 * footprint)
        + cloudy(DVec3::new(12.0 * point.x, 5.0, 300.0 * point.z), 300.0 * footprint);
    let gap = (1.0 - over.abs()).powi(4) * fade;
    // Threads are round: the side to the window is the lighter one.
    Mix::one(Pigment::Linen.index())
        .under(Pigment::LinenShade.index(), 0.5 * (slub - 0.7) + 0.25)
        .under(Pigment::Indigo.index(), 0.92 * dyed)
        .times((1.0 - 0.35 * gap) * (1.0 - 0.16 * fade * u.cos() * v.sin()))
}

/// The slopes of its folds.
fn folds(point: DVec3) -> DVec3 {
    DVec3::new(
        smooth(DVec3::new(7.0 * point.x, 1.0, 4.0 * point.z)) - 0.5,
        0.0,
        smooth(DVec3::new(6.0 * point.x, 9.0, 5.0 * point.z)) - 0.5,
    )
}

fn apple(point: DVec3, seed: u8, footprint: f64) -> Mix {
    let shift = DVec3::splat(11.3 * f64::from(seed));
    let around = DVec3::new(point.x, 0.0, point.z).normalize_or_zero();
    let streaks = cloudy(13.0 * around + DVec3::new(0.0, 14.0 * point.y, 0.0) + shift, 300.0 * footprint);
    let blush = smooth(DVec3::new(1.3 * around.x, 12.0 * point.y, 1.3 * around.z) + shift);
    let yellow = ((0.55 * streaks + 0.9 * blush - 0.62) * 3.0).clamp(0.0, 0.85);
    // The crown about the stem stays greenish.
    let crown = (1.0 - point.x.hypot(point.z) / 0.016).clamp(0.0, 1.0) * cover(point.y - 0.04, 0.01);
    let dots = dots(420.0 * point + shift, footprint * 420.0);
    Mix::one(Pigment::AppleRed.index())
        .under(Pigment::AppleYellow.index(), yellow)
        .under(Pigment::PearGreen.index(), 0.7 * crown)
        .under(Pigment::Linen.index(), 0.5 * dots)
        .times(0.85 + 0.3 * streaks)
}

fn pear(point: DVec3, footprint: f64) -> Mix {
    let rust = cloudy(45.0 * point, 45.0 * footprint) + 0.5 * cloudy(200.0 * point, 200.0 * footprint) - 0.62;
    Mix::one(Pigment::PearGreen.index())
        .under(Pigment::AppleYellow.index(), (1.6 * smooth(18.0 * point) - 0.5).clamp(0.0, 0.6))
        .under(Pigment::PearBrown.index(), (2.0 * rust).clamp(0.0, 0.75))
        .under(Pigment::PearBrown.index(), 0.8 * dots(520.0 * point, footprint * 520.0))
}

/// Peel: the color, darker in its pores.
fn peel(point: DVec3, pigment: Pigment, pores_per_m: f64, footprint: f64) -> Mix {
    let pores = pores_fade(pores_per_m, footprint) * smooth(pores_per_m * point);
    Mix::one(pigment.index()).times(0.88 + 0.2 * cloudy(25.0 * point, 25.0 * footprint) - 0.08 * pores)
}

fn pores_fade(pores_per_m: f64, footprint: f64) -> f64 {
    (1.0 - footprint * pores_per_m * 0.5).clamp(0.0, 1.0)
}

/// Pores that break the light.
fn pores_tilt(point: DVec3, pores_per_m: f64, footprint: f64) -> DVec3 {
    const STEP: f64 = 0.05;
    let at = pores_per_m * point;
    let here = smooth(at);
    let slope = DVec3::AXES.map(|axis| smooth(at + STEP * axis) - here);
    -0.16 * pores_fade(pores_per_m, footprint) / STEP * DVec3::from_array(slope)
}

/// Small round specks on a lattice of cells.
fn dots(at: DVec3, footprint: f64) -> f64 {
    let cell = at.floor();
    let (x, y, z) = (cell.x as i64, cell.y as i64, cell.z as i64);
    let jitter = DVec3::new(unit(x, y, z), unit(y, z, x + 77), unit(z, x, y - 55));
    let from = (at - cell - DVec3::splat(0.3) - 0.4 * jitter).length();
    cover(0.16 * (0.4 + jitter.x) - from, footprint.max(0.05)) * f64::from(u8::from(jitter.z > 0.45))
}

/// White porcelain painted in cobalt: bands, a wave and a lattice of flowers.
fn vase(point: DVec3, footprint: f64) -> Mix {
    let (y, angle) = (point.y, point.z.atan2(point.x));
    let radius = point.x.hypot(point.z);
    let soft = footprint.max(3e-4);
    let band = |low: f64, high: f64| cover(y - low, soft) * cover(high - y, soft);
    let bands = [(0.010, 0.016), (0.021, 0.023), (0.062, 0.0645), (0.158, 0.1605), (0.205, 0.212), (0.217, 0.219)];
    let mut ink = bands.into_iter().map(|(low, high)| band(low, high)).fold(0.0, f64::max);
    let wave = 0.043 + 0.009 * (16.0 * angle).sin();
    ink = ink.max(line(y - wave, 0.0026, soft)).max(line(y - 0.086 + wave, 0.0012, soft));
    if (0.066..0.157).contains(&y) {
        // Flowers of six petals on a lattice, with a smaller one between.
        let rows = (y - 0.0665) / 0.0300;
        let turn = 8.0 * angle / std::f64::consts::TAU + 0.5 * (rows.floor() % 2.0);
        let x = (turn - turn.floor() - 0.5) * std::f64::consts::TAU * radius / 8.0;
        let h = (rows - rows.floor() - 0.5) * 0.0300;
        let (r, a) = (x.hypot(h), h.atan2(x));
        let petals = 0.0065 + 0.0040 * (6.0 * a).cos();
        let flower = cover(petals - r, soft) * (1.0 - cover(0.0022 - r, soft));
        let ring = line(r - 0.0128, 0.0009, soft);
        ink = ink.max(flower).max(ring);
    }
    let depth = 0.75 + 0.25 * cloudy(220.0 * point, 220.0 * footprint);
    Mix::one(Pigment::Porcelain.index()).under(Pigment::Cobalt.index(), ink * depth)
}

/// The 24 patches on a black board.
fn chart(point: DVec3, normal: DVec3) -> Mix {
    /// The part of a patch's field on each side that the black frame takes.
    const FRAME: f64 = 0.07;
    if normal.z > -0.5 {
        return Mix::one(Pigment::Charcoal.index());
    }
    let (u, v) = ((point.x + 0.099) / 0.198 * 6.0, (0.066 - point.y) / 0.132 * 4.0);
    let is_inside = |at: f64| (FRAME..=1.0 - FRAME).contains(&at.fract());
    let is_patch = (0.0..6.0).contains(&u) && (0.0..4.0).contains(&v) && is_inside(u) && is_inside(v);
    Mix::one(if is_patch { Pigment::patch(6 * v as u8 + u as u8) } else { Pigment::Ink.index() })
}

/// A printed card: a star over lines of print.
fn card(point: DVec3, normal: DVec3, footprint: f64) -> Mix {
    let paper = Mix::one(Pigment::Paper.index());
    if normal.z > -0.5 {
        return paper;
    }
    let (x, y) = (point.x, point.y);
    let ink = if y > -0.018 {
        star(x, y - 0.029, 0.040, 18.0, footprint)
    } else if y > -0.0298 {
        print(x + 0.046, -0.020 - y, [0.0042, 0.0098], 22, footprint)
    } else {
        print(x + 0.046, -0.037 - y, [0.0024, 0.0054], 38, footprint)
    };
    let frame = line((x.abs() - 0.052).max(y.abs() - 0.074), 0.0008, footprint);
    let inside = if x.abs() < 0.048 && y.abs() < 0.071 { ink } else { 0.0 };
    paper.under(Pigment::Ink.index(), inside.max(frame))
}

fn spine(point: DVec3, normal: DVec3, pigment: PigmentIndex, seed: u8, footprint: f64) -> Mix {
    let weave = 0.9 + 0.2 * cloudy(500.0 * point, 500.0 * footprint);
    let cover_mix = Mix::one(pigment).times(weave);
    if normal.z > -0.5 {
        return cover_mix;
    }
    let at = 0.05 + 0.04 * unit(i64::from(seed), 2, 3);
    let gilt = [at, at + 0.012, -at].map(|y| line(point.y - y, 0.003, footprint)).into_iter().fold(0.0, f64::max);
    let title = print(point.y + 0.03, point.x + 0.006, [0.005, 0.012], 12, footprint)
        * f64::from(u8::from(point.x.abs() < 0.006 && point.y.abs() < 0.03));
    cover_mix.under(Pigment::Ochre.index(), 0.85 * gilt.max(title))
}

/// The place on the label of the bottle: across and up.
fn on_label(point: DVec3) -> (f64, f64) {
    (0.037 * point.x.atan2(-point.z), point.y - 0.095)
}

fn is_label(point: DVec3, footprint: f64) -> bool {
    let (x, y) = on_label(point);
    cover(0.034 - x.abs(), footprint) * cover(0.042 - y.abs(), footprint) > 0.5
}

/// A paper label with a crest and print.
fn label(point: DVec3, footprint: f64) -> Mix {
    let (x, y) = on_label(point);
    let ink = print(x + 0.028, 0.004 - y, [0.0030, 0.0075], 18, footprint) * cover(-y, footprint);
    let crest = stripes(x.hypot(y - 0.022), 0.0035, footprint) * cover(0.013 - x.hypot(y - 0.022), footprint);
    let rule = line(y.abs() - 0.039, 0.0012, footprint);
    Mix::one(Pigment::Linen.index()).under(Pigment::Crimson.index(), crest.max(rule)).under(Pigment::Ink.index(), ink)
}

fn die(point: DVec3, normal: DVec3, footprint: f64) -> Mix {
    let (u, v, face) = if normal.x.abs() > 0.5 {
        (point.y, point.z, if normal.x > 0.0 { 3 } else { 4 })
    } else if normal.y.abs() > 0.5 {
        (point.x, point.z, if normal.y > 0.0 { 5 } else { 2 })
    } else {
        (point.x, point.y, if normal.z > 0.0 { 6 } else { 1 })
    };
    let s = 0.0046;
    let places: &[(f64, f64)] = match face {
        1 => &[(0.0, 0.0)],
        2 => &[(-1.0, -1.0), (1.0, 1.0)],
        3 => &[(-1.0, -1.0), (0.0, 0.0), (1.0, 1.0)],
        4 => &[(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)],
        5 => &[(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (0.0, 0.0)],
        _ => &[(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, 0.0), (1.0, 0.0)],
    };
    let pip = places.iter().map(|(x, y)| cover(0.0017 - (u - s * x).hypot(v - s * y), footprint));
    Mix::one(Pigment::Porcelain.index()).under(Pigment::Ink.index(), pip.fold(0.0, f64::max))
}

/// A painting of discs and fields within a broad mat.
fn picture(point: DVec3, normal: DVec3, footprint: f64) -> Mix {
    let mat = Mix::one(Pigment::Paper.index());
    let (x, y) = (point.x, point.y);
    if normal.z > -0.5 || x.abs() > 0.20 || y.abs() > 0.15 {
        return mat;
    }
    let inside = |cx: f64, cy: f64, r: f64| cover(r - (x - cx).hypot(y - cy), footprint);
    let hills = 0.03 * (14.0 * x + 0.6).sin() - 0.03 + 0.01 * smooth(DVec3::new(20.0 * x, 0.0, 0.0));
    let ground = Mix::one(Pigment::patch(12)).under(Pigment::Linen.index(), (0.5 + 3.0 * y).clamp(0.0, 1.0));
    ground
        .under(Pigment::Orange.index(), inside(0.07, 0.05, 0.055))
        .under(Pigment::Indigo.index(), cover(hills - y, footprint))
}

fn pencil(point: DVec3, pigment: PigmentIndex) -> Mix {
    // Lead, then wood, then lacquer, from the tip at the top.
    if point.y > 0.166 {
        Mix::one(Pigment::Charcoal.index())
    } else if point.y > 0.152 + 0.0012 * (6.0 * point.z.atan2(point.x)).cos() {
        Mix::one(Pigment::OakLight.index()).times(1.3)
    } else {
        Mix::one(pigment)
    }
}
