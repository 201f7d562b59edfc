//! What the surfaces of the still life are made of.

use glam::DVec3;

use super::{
    floor_plan::{CLOTH_HALF, WINDOW_CD_M2, WINDOW_HIGH, WINDOW_LOW},
    noise::{cloudy, smooth, unit},
    pattern::{cover, line, print, star, stripes},
    pigment::{Pigment, PigmentIndex},
};
use crate::targets::patch_at;

/// A mixture of pigments: which, and the share of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mix {
    parts: [(PigmentIndex, f32); 4],
    len: usize,
}

impl Mix {
    pub(super) fn one(pigment: PigmentIndex) -> Self {
        Self { parts: [(pigment, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)], len: 1 }
    }

    /// Covers a share of the mixture, 0–1, with another pigment.
    #[must_use]
    pub(super) fn under(mut self, pigment: PigmentIndex, share: f64) -> Self {
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
    pub(super) fn times(mut self, factor: f64) -> Self {
        self.parts[..self.len].iter_mut().for_each(|part| part.1 *= factor as f32);
        self
    }

    pub(super) fn parts(&self) -> &[(PigmentIndex, f32)] {
        &self.parts[..self.len]
    }
}

/// What lies over a pigment: clear varnish, or bare metal in its stead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coat {
    /// Reflectance straight on; 0 for none.
    pub(super) f0: f64,
    /// Spread of what it mirrors, as the tangent of an angle.
    pub(super) roughness: f64,
    /// The pigment that colors what a metal mirrors.
    pub(super) metal: Option<PigmentIndex>,
}

impl Coat {
    const NONE: Self = Self { f0: 0.0, roughness: 0.0, metal: None };

    const fn clear(f0: f64, roughness: f64) -> Self {
        Self { f0, roughness, metal: None }
    }
}

/// Which light a glowing thing is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    /// Through the window.
    Day,
    /// From lamps.
    Warm,
}

/// A point of a surface, in the frame of its shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    pub(super) mix: Mix,
    pub(super) normal: DVec3,
    pub(super) coat: Coat,
    /// Its own luminance, cd/m².
    pub(super) glow: Option<(Light, f64)>,
}

/// What a thing is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Material {
    Room,
    Planks,
    Cloth,
    Matte(PigmentIndex),
    Glossy(PigmentIndex),
    Metal { pigment: PigmentIndex, roughness: f64 },
    Apple { seed: u8 },
    Pear,
    Lemon,
    Orange,
    Vase,
    Chart,
    Card,
    Spine { pigment: PigmentIndex, seed: u8 },
    Pages,
    Bottle,
    Die,
    Picture,
    Walnut,
    Candle,
    Pencil(PigmentIndex),
    Glow { light: Light, luminance: f64 },
    Shade { luminance: f64 },
}

impl Material {
    /// Returns the surface at a point; details finer than `footprint`, in metres, are blurred away.
    pub(super) fn surface(self, point: DVec3, normal: DVec3, footprint: f64) -> Surface {
        let plain = |mix| Surface { mix, normal, coat: Coat::NONE, glow: None };
        let coated = |mix, f0, roughness| Surface { mix, normal, coat: Coat::clear(f0, roughness), glow: None };
        match self {
            Self::Room => room(point, normal, footprint),
            Self::Planks => planks(point, normal, footprint),
            Self::Cloth => cloth(point, normal, footprint),
            Self::Matte(pigment) => plain(Mix::one(pigment)),
            Self::Glossy(pigment) => coated(Mix::one(pigment), 0.045, 0.0),
            Self::Metal { pigment, roughness } => Surface {
                mix: Mix::one(pigment),
                normal,
                coat: Coat { f0: 1.0, roughness, metal: Some(pigment) },
                glow: None,
            },
            Self::Apple { seed } => apple(point, normal, seed, footprint),
            Self::Pear => pear(point, normal, footprint),
            Self::Lemon => dimpled(point, normal, Pigment::Lemon, 900.0, footprint),
            Self::Orange => dimpled(point, normal, Pigment::Orange, 700.0, footprint),
            Self::Vase => coated(vase(point, footprint), 0.05, 0.0),
            Self::Chart => plain(chart(point, normal)),
            Self::Card => plain(card(point, normal, footprint)),
            Self::Spine { pigment, seed } => coated(spine(point, normal, pigment, seed, footprint), 0.03, 0.2),
            Self::Pages => plain(
                Mix::one(Pigment::Paper.index()).times(0.8 + 0.2 * smooth(DVec3::new(9.0, 1500.0 * point.y, 3.0))),
            ),
            Self::Bottle => bottle(point, normal, footprint),
            Self::Die => coated(die(point, normal, footprint), 0.045, 0.0),
            Self::Picture => plain(picture(point, normal, footprint)),
            Self::Walnut => coated(grain(point, Pigment::WalnutLight, Pigment::WalnutDark, footprint), 0.04, 0.12),
            Self::Candle => coated(Mix::one(Pigment::Wax.index()), 0.03, 0.15),
            Self::Pencil(pigment) => coated(pencil(point, pigment), 0.045, 0.0),
            Self::Glow { light, luminance } => {
                Surface { glow: Some((light, luminance)), ..plain(Mix::one(Pigment::Ink.index())) }
            }
            Self::Shade { luminance } => {
                // Pleated cloth, brightest half-way up where the bulb is.
                let pleats = 0.85 + 0.15 * (60.0 * point.z.atan2(point.x)).cos();
                let bulb = (-((point.y - 0.10) / 0.09).powi(2)).exp();
                let luminance = luminance * pleats * (0.30 + 0.70 * bulb);
                Surface { glow: Some((Light::Warm, luminance)), ..plain(Mix::one(Pigment::Linen.index())) }
            }
        }
    }
}

/// The walls, with the window in the left one.
fn room(point: DVec3, normal: DVec3, footprint: f64) -> Surface {
    let mut surface =
        Surface { mix: Mix::one(Pigment::Plaster.index()), normal: -normal, coat: Coat::NONE, glow: None };
    if normal.z > 0.5 {
        let blotches = 0.92 + 0.16 * cloudy(6.0 * point, 6.0 * footprint);
        surface.mix = Mix::one(Pigment::WallGreen.index()).times(blotches);
    } else if normal.y < -0.5 {
        surface.mix = Mix::one(Pigment::OakDark.index());
    } else if normal.x < -0.5 {
        let (y, z) = (point.y, point.z);
        if (WINDOW_LOW.y..WINDOW_HIGH.y).contains(&y) && (WINDOW_LOW.z..WINDOW_HIGH.z).contains(&z) {
            // Two by three panes; the sky is brighter higher up.
            let pane = |at: f64, low: f64, high: f64, n: f64| (n * (at - low) / (high - low)).fract();
            let is_bar = |f: f64, width: f64| f < width || f > 1.0 - width;
            let bar = is_bar(pane(z, WINDOW_LOW.z, WINDOW_HIGH.z, 2.0), 0.035)
                || is_bar(pane(y, WINDOW_LOW.y, WINDOW_HIGH.y, 3.0), 0.05);
            if !bar {
                let height = (y - WINDOW_LOW.y) / (WINDOW_HIGH.y - WINDOW_LOW.y);
                surface.glow = Some((Light::Day, WINDOW_CD_M2 * (0.85 + 0.5 * height)));
            }
        }
    }
    surface
}

/// Wood: long fibres along z, and rings.
fn grain(point: DVec3, light: Pigment, dark: Pigment, footprint: f64) -> Mix {
    let bend = cloudy(DVec3::new(5.0 * point.x, 5.0 * point.y, 1.1 * point.z), 5.0 * footprint);
    let rings = 0.5 + 0.5 * (120.0 * (point.x + 0.7 * point.y) + 26.0 * bend).sin();
    let fibres = cloudy(DVec3::new(420.0 * point.x, 420.0 * point.y, 9.0 * point.z), 420.0 * footprint);
    Mix::one(light.index()).under(dark.index(), 0.08 + 0.60 * rings.powi(3) + 0.55 * (fibres - 0.45))
}

fn planks(point: DVec3, normal: DVec3, footprint: f64) -> Surface {
    const WIDTH: f64 = 0.145;
    let board = (point.x / WIDTH).floor();
    let shift = DVec3::new(3.7 * board, 0.0, 5.3 * board);
    let tone = 0.86 + 0.22 * unit(board as i64, 1, 5);
    let gap = line((point.x / WIDTH - board - 0.5).abs() * WIDTH - 0.5 * WIDTH, 0.0012, footprint);
    let mix = grain(point + shift, Pigment::OakLight, Pigment::OakDark, footprint)
        .times(tone)
        .under(Pigment::Ink.index(), 0.85 * gap);
    // The grain stands up a little, so that the varnish breaks what it mirrors.
    let fade = (1.0 - footprint / 0.004).clamp(0.0, 1.0);
    let wave = cloudy(DVec3::new(160.0 * point.x, 0.0, 5.0 * point.z) + shift, 160.0 * footprint) - 0.5;
    let normal = (normal + DVec3::new(0.05 * fade * wave, 0.0, 0.0)).normalize();
    Surface { mix, normal, coat: Coat::clear(0.035, 0.09), glow: None }
}

/// Woven linen with a border of indigo checks.
fn cloth(point: DVec3, normal: DVec3, footprint: f64) -> Surface {
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
    let mix = Mix::one(Pigment::Linen.index())
        .under(Pigment::LinenShade.index(), 0.5 * (slub - 0.7) + 0.25)
        .under(Pigment::Indigo.index(), 0.92 * dyed)
        .times((1.0 - 0.35 * gap) * (1.0 - 0.16 * fade * u.cos() * v.sin()));
    let folds = DVec3::new(
        smooth(DVec3::new(7.0 * point.x, 1.0, 4.0 * point.z)) - 0.5,
        0.0,
        smooth(DVec3::new(6.0 * point.x, 9.0, 5.0 * point.z)) - 0.5,
    );
    let normal = if normal.y > 0.5 { (normal + 0.35 * folds).normalize() } else { normal };
    Surface { mix, normal, coat: Coat::NONE, glow: None }
}

fn apple(point: DVec3, normal: DVec3, seed: u8, footprint: f64) -> Surface {
    let shift = DVec3::splat(11.3 * f64::from(seed));
    let around = DVec3::new(point.x, 0.0, point.z).normalize_or_zero();
    let streaks = cloudy(13.0 * around + DVec3::new(0.0, 14.0 * point.y, 0.0) + shift, 300.0 * footprint);
    let blush = smooth(DVec3::new(1.3 * around.x, 12.0 * point.y, 1.3 * around.z) + shift);
    let yellow = ((0.55 * streaks + 0.9 * blush - 0.62) * 3.0).clamp(0.0, 0.85);
    // The crown about the stem stays greenish.
    let crown = (1.0 - point.x.hypot(point.z) / 0.016).clamp(0.0, 1.0) * cover(point.y - 0.04, 0.01);
    let dots = dots(420.0 * point + shift, footprint * 420.0);
    let mix = Mix::one(Pigment::AppleRed.index())
        .under(Pigment::AppleYellow.index(), yellow)
        .under(Pigment::PearGreen.index(), 0.7 * crown)
        .under(Pigment::Linen.index(), 0.5 * dots)
        .times(0.85 + 0.3 * streaks);
    Surface { mix, normal, coat: Coat::clear(0.040, 0.0), glow: None }
}

fn pear(point: DVec3, normal: DVec3, footprint: f64) -> Surface {
    let rust = cloudy(45.0 * point, 45.0 * footprint) + 0.5 * cloudy(200.0 * point, 200.0 * footprint) - 0.62;
    let mix = Mix::one(Pigment::PearGreen.index())
        .under(Pigment::AppleYellow.index(), (1.6 * smooth(18.0 * point) - 0.5).clamp(0.0, 0.6))
        .under(Pigment::PearBrown.index(), (2.0 * rust).clamp(0.0, 0.75))
        .under(Pigment::PearBrown.index(), 0.8 * dots(520.0 * point, footprint * 520.0));
    Surface { mix, normal, coat: Coat::clear(0.035, 0.12), glow: None }
}

/// Peel: the color, and pores that break the light.
fn dimpled(point: DVec3, normal: DVec3, pigment: Pigment, pores_per_m: f64, footprint: f64) -> Surface {
    let at = pores_per_m * point;
    let height = |p: DVec3| smooth(p);
    let step = 0.05;
    let slope = DVec3::new(
        height(at + DVec3::new(step, 0.0, 0.0)),
        height(at + DVec3::new(0.0, step, 0.0)),
        height(at + DVec3::new(0.0, 0.0, step)),
    ) - DVec3::splat(height(at));
    let fade = (1.0 - footprint * pores_per_m * 0.5).clamp(0.0, 1.0);
    let normal = (normal - 0.16 * fade * slope / step).normalize();
    let mix =
        Mix::one(pigment.index()).times(0.88 + 0.2 * cloudy(25.0 * point, 25.0 * footprint) - 0.08 * fade * height(at));
    Surface { mix, normal, coat: Coat::clear(0.045, 0.05), glow: None }
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
    if normal.z > -0.5 {
        return Mix::one(Pigment::Charcoal.index());
    }
    let (u, v) = ((point.x + 0.099) / 0.198 * 6.0, (0.066 - point.y) / 0.132 * 4.0);
    match patch_at(u, v) {
        Some(patch) => Mix::one(Pigment::patch(patch)),
        None => Mix::one(Pigment::Ink.index()),
    }
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

/// A dark bottle with a paper label.
fn bottle(point: DVec3, normal: DVec3, footprint: f64) -> Surface {
    let (x, y) = (0.037 * point.x.atan2(-point.z), point.y - 0.095);
    let is_label = cover(0.034 - x.abs(), footprint) * cover(0.042 - y.abs(), footprint);
    if is_label > 0.5 {
        let ink = print(x + 0.028, 0.004 - y, [0.0030, 0.0075], 18, footprint) * cover(-y, footprint);
        let crest = stripes(x.hypot(y - 0.022), 0.0035, footprint) * cover(0.013 - x.hypot(y - 0.022), footprint);
        let rule = line(y.abs() - 0.039, 0.0012, footprint);
        let mix = Mix::one(Pigment::Linen.index())
            .under(Pigment::Crimson.index(), crest.max(rule))
            .under(Pigment::Ink.index(), ink);
        return Surface { mix, normal, coat: Coat::NONE, glow: None };
    }
    Surface { mix: Mix::one(Pigment::BottleGreen.index()), normal, coat: Coat::clear(0.045, 0.0), glow: None }
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
