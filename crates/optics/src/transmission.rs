//! The share of light that surfaces and glass let through, along rays.

use glam::DVec3;

use crate::{
    Coating, DiffractiveSurface, Film, Lens, OpticsError,
    coating::{TableRow, absorbing_index, share_between},
    trace::{Argument, LightPass, Lights, Real},
};

/// What light loses at one surface, as light meets it forward.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SurfaceLoss {
    /// Nothing.
    None,
    /// What the film does not transmit.
    Film(Film),
    /// The same whatever the angle, that of light that falls straight on it: at gratings, which turn light by no law of Snell's.
    Straight(Film),
    /// What a table at one wavelength does not transmit, between media of these indices.
    Table(Vec<TableRow>, [f64; 2]),
    /// What the film of a mirror does not reflect.
    MirrorFilm(Film),
    /// What a table of a mirror does not reflect.
    MirrorTable(Vec<TableRow>),
}

/// Points at which a surface is looked at to begin with, and how often they are doubled at most where series of as many terms have not
/// died away: those of stacks of many layers.
const N_NODES: usize = 32;
const MOST_DOUBLINGS: usize = 4;
/// Terms below these are left out of the four series: in double precision, in single, and in single for ghosts, whose light is less.
///
/// What turns the polarization (the last two) counts for the power by the square of what polarizes, and the very last once more by its own.
pub(crate) const EXACT_TERMS: [f64; 4] = [1e-10, 1e-10, 1e-8, 1e-8];
const SINGLE_TERMS: [f64; 4] = [1e-6, 1e-6, 1e-4, 1e-2];
pub(crate) const GHOST_TERMS: [f64; 4] = [1e-8, 1e-8, 1e-7, 1e-6];

/// What light loses in a lens at one wavelength: the passes through its surfaces, in double and single precision, in the order in which
/// light meets them forward and backward.
#[derive(Clone, Debug)]
pub(crate) struct Transmission {
    pub(crate) forward: Vec<LightPass<f64>>,
    pub(crate) backward: Vec<LightPass<f64>>,
    pub(crate) backward_f32: Vec<LightPass<f32>>,
    /// Backward on to the stop, which does nothing yet.
    pub(crate) to_stop: Vec<LightPass<f64>>,
    pub(crate) to_stop_f32: Vec<LightPass<f32>>,
}

impl SurfaceLoss {
    /// Returns what a surface of a lens loses, between media of these indices.
    ///
    /// # Errors
    /// When a coating is not known at the wavelength, or it is that of a mirror where there is none, or the other way round.
    pub(crate) fn of(lens: &Lens, surface: usize, wavelength_nm: f64, indices: [f64; 2]) -> Result<Self, OpticsError> {
        let coating = lens.coating_of(surface, indices);
        let of_surface =
            |error: OpticsError| OpticsError::Coating { reason: format!("the coating of surface {surface}: {error}") };
        let wrong = |expected: &str| {
            let reason = format!("the coating of surface {surface} is not one that {expected}");
            Err(OpticsError::Coating { reason })
        };
        let [before, after] = indices;
        let is_thin_lens = matches!(lens.interfaces()[surface].surface.shape, crate::Shape::ThinLens { .. });
        if *coating == Coating::Ideal || is_thin_lens {
            return Ok(Self::None);
        }
        if lens.is_mirror(surface) {
            return match coating {
                Coating::Table(table) => Ok(Self::MirrorTable(table.at(wavelength_nm).map_err(of_surface)?)),
                Coating::Metal { metal, .. } => {
                    let layers = coating.layers_at(wavelength_nm, &|_| None).map_err(of_surface)?;
                    let metal = absorbing_index(metal, wavelength_nm).map_err(of_surface)?;
                    Ok(Self::MirrorFilm(Film::new(before, &layers, metal, wavelength_nm)))
                }
                _ => wrong("mirrors have: Ideal, Metal or Table"),
            };
        }
        if let Coating::Table(table) = coating {
            return Ok(Self::Table(table.at(wavelength_nm).map_err(of_surface)?, indices));
        }
        if matches!(coating, Coating::Metal { .. }) {
            return wrong("lets light through, as this surface must, which is no mirror");
        }
        let medium_before = surface.checked_sub(1).map_or(lens.object_medium(), |i| &lens.interfaces()[i].medium_after);
        let dense = if before > after { medium_before } else { &lens.interfaces()[surface].medium_after };
        let dense_at = |nm: f64| lens.index_in(dense, nm).ok().or(Some(before.max(after)));
        let mut layers = coating.layers_at(wavelength_nm, &dense_at).map_err(of_surface)?;
        if layers.is_empty() && before == after {
            return Ok(Self::None);
        }
        if before > after {
            layers.reverse();
        }
        let film = Film::new(before, &layers, after.into(), wavelength_nm);
        let turns_otherwise = |phase: &DiffractiveSurface| phase.surface == surface;
        let is_diffractive = lens.diffractive().iter().any(turns_otherwise);
        // Without a step of the index the angle of incidence leaves no trace in the directions.
        let is_straight = is_diffractive || (before / after - 1.0).abs() < 1e-9;
        Ok(if is_straight { Self::Straight(film) } else { Self::Film(film) })
    }

    /// The least product of the directions before and behind, and the greatest; of a mirror those of the cosine of incidence.
    fn ends(&self) -> [f64; 2] {
        let of_indices = |[a, b]: [f64; 2]| [a.min(b) / a.max(b), 1.0];
        match self {
            Self::None | Self::Straight(_) => [0.0, 1.0],
            Self::Film(film) => of_indices(film.indices()),
            Self::Table(_, indices) => of_indices(*indices),
            Self::MirrorFilm(_) | Self::MirrorTable(_) => [0.0, 1.0],
        }
    }

    /// Returns half the sum and half the difference of the shares of s and p that go on, and `t_s t_p*` of amplitudes whose squares are these
    /// shares, for rays whose directions before and behind have this product; of a mirror, for this cosine of incidence.
    fn at(&self, product: f64) -> [f64; 4] {
        // Refraction: n d of the denser medium less that of the other is along the normal.
        let cosines = |[before, after]: [f64; 2]| {
            let normal = (before * before + after * after - 2.0 * before * after * product).sqrt();
            let (low, high) = (before.min(after), before.max(after));
            let [of_low, of_high] = [(high * product - low) / normal, (high - low * product) / normal];
            if before < after { [of_low, of_high] } else { [of_high, of_low] }
        };
        let transmitted = |film: &Film, cos: f64| {
            let found = film.amplitudes(cos);
            let [of_s, of_p] = film.power_of_squares(cos);
            terms(found.t_s * of_s.sqrt(), found.t_p * of_p.sqrt())
        };
        let left = |[_, _, t_s, t_p]: [f64; 4]| terms(t_s.sqrt().into(), t_p.sqrt().into());
        match self {
            Self::None => [1.0, 0.0, 1.0, 0.0],
            Self::Straight(film) => transmitted(film, 1.0),
            Self::Film(film) => transmitted(film, cosines(film.indices())[0]),
            Self::Table(table, indices) => {
                let [before, after] = cosines(*indices);
                left(share_between(table, if indices[0] < indices[1] { before } else { after }))
            }
            Self::MirrorFilm(film) => {
                let found = film.amplitudes(product);
                terms(found.r_s, -found.r_p)
            }
            Self::MirrorTable(table) => {
                let [r_s, r_p, ..] = share_between(table, product);
                terms(r_s.sqrt().into(), r_p.sqrt().into())
            }
        }
    }

    /// Returns the pass of light through the surface.
    pub(crate) fn pass<T: Real>(&self, per_mm: f64, least_terms: [f64; 4]) -> LightPass<T> {
        let per_mm = T::of(per_mm);
        if *self == Self::None {
            return LightPass { per_mm, ..LightPass::NOTHING };
        }
        let is_constant = matches!(self, Self::Straight(_));
        let series = Series::of(self.ends(), is_constant, least_terms, |at| self.at(at));
        let is_mirror = matches!(self, Self::MirrorFilm(_) | Self::MirrorTable(_));
        series.pass(if is_mirror { Argument::LowCosine { ratio2: T::ONE } } else { Argument::Product }, per_mm)
    }

    /// Returns the pass of light that the surface sends back where it comes from before or, with `is_from_behind`, from behind it; `None`
    /// where none does, as at gratings and between equal indices, whose reflections are not followed.
    pub(crate) fn back<T: Real>(&self, is_from_behind: bool, least_terms: [f64; 4]) -> Option<LightPass<T>> {
        let (indices, of_cosine): ([f64; 2], OfCosine<'_>) = match self {
            Self::None | Self::Straight(_) | Self::MirrorFilm(_) | Self::MirrorTable(_) => return None,
            Self::Film(film) => {
                let film = if is_from_behind { film.reversed() } else { film.clone() };
                let indices = film.indices();
                let of_low = move |low: f64| {
                    let [here, there] = indices;
                    // n sin θ is the same on both sides.
                    let cos =
                        if here < there { low } else { (1.0 - (1.0 - low * low) * (there / here).powi(2)).sqrt() };
                    let found = film.amplitudes(cos);
                    terms(found.r_s, -found.r_p)
                };
                (indices, Box::new(of_low))
            }
            Self::Table(table, [before, after]) => {
                let indices = if is_from_behind { [*after, *before] } else { [*before, *after] };
                let of_low = |low: f64| {
                    let [r_s, r_p, ..] = share_between(table, low);
                    terms(r_s.sqrt().into(), r_p.sqrt().into())
                };
                (indices, Box::new(of_low))
            }
        };
        let [here, there] = indices;
        let ratio2 = T::of((here / here.min(there)).powi(2));
        Some(Series::of([0.0, 1.0], false, least_terms, of_cosine).pass(Argument::LowCosine { ratio2 }, T::ZERO))
    }
}

/// What a surface does to light, by a cosine.
type OfCosine<'a> = Box<dyn Fn(f64) -> [f64; 4] + 'a>;

/// Chebyshev series of what a surface does to light, between two ends.
struct Series {
    ends: [f64; 2],
    coefficients: [Vec<f64>; 4],
}

impl Series {
    /// Fits the series of a function of one argument, without terms below the least.
    fn of(ends: [f64; 2], is_constant: bool, least_terms: [f64; 4], values_at: impl Fn(f64) -> [f64; 4]) -> Self {
        let of_nodes = |n: usize| Self { ends, coefficients: Self::coefficients(ends, n, &values_at) };
        let mut series = of_nodes(N_NODES);
        for doubling in 1..=MOST_DOUBLINGS {
            let has_died_away = |(list, least): (&Vec<f64>, &f64)| {
                // What the last eighth of the terms still add is about what aliases into the others.
                list[list.len() - list.len() / 8..].iter().all(|term| term.abs() < *least)
            };
            if is_constant || series.coefficients.iter().zip(&least_terms).all(has_died_away) {
                break;
            }
            series = of_nodes(N_NODES << doubling);
        }
        for (list, least) in series.coefficients.iter_mut().zip(least_terms) {
            list.truncate(if is_constant { 1 } else { list.len() });
            while list.last().is_some_and(|last| last.abs() < least) {
                list.pop();
            }
        }
        series
    }

    /// Returns the first so many coefficients of the series, by the values at as many nodes.
    fn coefficients([from, to]: [f64; 2], n: usize, values_at: &impl Fn(f64) -> [f64; 4]) -> [Vec<f64>; 4] {
        // Of multiples of half the angle between nodes: all that the series need.
        let cosines: Vec<f64> = (0..4 * n).map(|k| (std::f64::consts::PI * k as f64 / (2 * n) as f64).cos()).collect();
        let cos = |i: usize, j: usize| cosines[i * (2 * j + 1) % (4 * n)];
        let values: Vec<[f64; 4]> =
            (0..n).map(|j| values_at(0.5 * (from + to) + 0.5 * (to - from) * cos(1, j))).collect();
        std::array::from_fn(|k| {
            let coefficient = |i: usize| {
                let sum: f64 = (0..n).map(|j| values[j][k] * cos(i, j)).sum();
                sum * if i == 0 { 1.0 } else { 2.0 } / n as f64
            };
            (0..n).map(coefficient).collect()
        })
    }

    fn pass<T: Real>(self, argument: Argument<T>, per_mm: T) -> LightPass<T> {
        let [from, to] = self.ends;
        let (scale, offset) = (2.0 / (to - from), -(to + from) / (to - from));
        let series = self.coefficients.map(|list| list.into_iter().map(T::of).collect());
        LightPass { argument, scale: T::of(scale), offset: T::of(offset), series: Some(series), per_mm }
    }
}

fn terms(s: num_complex::Complex64, p: num_complex::Complex64) -> [f64; 4] {
    let (of_s, of_p, both) = (s.norm_sqr(), p.norm_sqr(), s * p.conj());
    [0.5 * (of_s + of_p), 0.5 * (of_s - of_p), both.re, both.im]
}

/// Returns the first so many passes, the last of which leaves light as it is.
fn to_stop_of<T: Real>(passes: &[LightPass<T>], n: usize) -> Vec<LightPass<T>> {
    let mut own = passes[..n].to_vec();
    own[n - 1].series = None;
    own
}

impl Transmission {
    /// Returns that of these surfaces; `per_mm` is the absorption behind each. That before the first and behind the last is left out.
    pub(crate) fn of(losses: &[SurfaceLoss], per_mm: &[f64], stop: usize) -> Self {
        let n = losses.len();
        let before = |i: usize| if i == 0 { 0.0 } else { per_mm[i - 1] };
        let behind = |i: usize| if i + 1 == n { 0.0 } else { per_mm[i] };
        let forward: Vec<LightPass<f64>> = (0..n).map(|i| losses[i].pass(before(i), EXACT_TERMS)).collect();
        let backward: Vec<LightPass<f64>> =
            (0..n).rev().map(|i| LightPass { per_mm: behind(i), ..forward[i].clone() }).collect();
        let backward_f32: Vec<LightPass<f32>> = (0..n).rev().map(|i| losses[i].pass(behind(i), SINGLE_TERMS)).collect();
        let (to_stop, to_stop_f32) = (to_stop_of(&backward, n - stop), to_stop_of(&backward_f32, n - stop));
        Self { forward, backward, backward_f32, to_stop, to_stop_f32 }
    }
}

/// The light along the rays of a batch: what is left of unpolarized light, and how it has become polarized.
#[derive(Clone, Debug)]
pub struct RayLight(pub(crate) Lights<f64>);

/// The same in single precision.
#[derive(Clone, Debug)]
pub struct RayLightF32(pub(crate) Lights<f32>);

impl RayLight {
    /// Returns unpolarized light along so many rays.
    pub fn unpolarized(n_rays: usize) -> Self {
        Self(Lights::unpolarized(n_rays))
    }

    /// Returns the share of a ray's light that is left; of one that has ended, that on its way there.
    pub fn share(&self, ray: usize) -> f64 {
        self.0.share(ray)
    }
}

impl RayLightF32 {
    /// Returns unpolarized light along so many rays.
    pub fn unpolarized(n_rays: usize) -> Self {
        Self(Lights::unpolarized(n_rays))
    }

    /// Returns the share of a ray's light that is left.
    pub fn share(&self, ray: usize) -> f64 {
        self.0.share(ray)
    }
}

/// Takes light through one surface along rays that have been traced to it and on: with the points and directions before.
pub(crate) fn pass_one_by_one(
    lights: &mut Lights<f64>,
    pass: &LightPass<f64>,
    before: &[(DVec3, DVec3)],
    after: impl Fn(usize) -> Option<(DVec3, DVec3)>,
) {
    for (i, (from, direction)) in before.iter().enumerate() {
        if let Some((to, turned)) = after(i) {
            lights.pass_one(i, pass, (to - *from).dot(*direction), direction.to_array(), turned.to_array());
        }
    }
}
