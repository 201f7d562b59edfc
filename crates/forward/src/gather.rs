//! What the pixels of a tile gather of a layer, by kernels that change over the tile.

use dioptric_fft::Complex;
use dioptric_spectrum::{Cancel, Cancelled};
use multiversion::multiversion;
use rayon::prelude::*;

use crate::{
    Film,
    convolve::{LANES, add_scaled, fast_size, multiply_by_real, with_fft},
    coverage::{Composite, Gathered},
    node_kernels::{LayerKernels, NodeKernel, edge_spread_peak},
    raster::{Level, Raster},
    rectangle::Rectangle,
    sampler::{IdealLayer, Sampler},
    stopwatch::{Part, Stopwatch},
    symmetry::Mirror,
    tile::{Tile, TileGroup, film_pixels},
    visible::Visible,
};

/// A layer in one band.
pub(crate) struct GatherTask<'a> {
    pub(crate) film: &'a Film,
    pub(crate) kernels: &'a LayerKernels,
    pub(crate) sampler: &'a Sampler<'a>,
    pub(crate) layer: usize,
    pub(crate) stopwatch: &'a Stopwatch,
    pub(crate) cancel: &'a Cancel,
}

/// A change of kernels over a tile that changes no edge by more than this is left out. It shows as steps between tiles where the scene has edges.
const NEGLIGIBLE_EDGE: f64 = 1e-4;

/// The kernels of a tile: a sum of terms over one window, each times ½ or less as the place goes from one side of the tile to the other.
///
/// With u and v the place across and down from the tile's middle, −½ to ½, h = A + u B + v C + u v D interpolates bilinearly between the corners. A sums to 1,
/// the others to 0.
struct TileKernels {
    at: Rectangle,
    terms: Vec<Term>,
}

struct Term {
    /// Whether it is times v, and times u.
    down: bool,
    across: bool,
    samples: Vec<f32>,
}

impl Term {
    fn factor(&self, v: f32, u: f32) -> f32 {
        (if self.down { v } else { 1.0 }) * (if self.across { u } else { 1.0 })
    }
}

impl TileKernels {
    /// Takes those of the corners: upper left, upper right, lower left, lower right.
    fn between(corners: &[NodeKernel; 4]) -> Self {
        let at = Rectangle::around(corners.iter().map(|kernel| kernel.at)).unwrap_or(Rectangle::PIXEL);
        let quarter = 0.25;
        let terms = [
            (false, false, [quarter; 4]),
            (false, true, [-0.5, 0.5, -0.5, 0.5]),
            (true, false, [-0.5, -0.5, 0.5, 0.5]),
            (true, true, [1.0, -1.0, -1.0, 1.0]),
        ];
        let term = |(down, across, factors): (bool, bool, [f32; 4])| {
            let mut samples = vec![0.0; at.len()];
            corners.iter().zip(factors).for_each(|(kernel, factor)| kernel.add_to(&mut samples, &at, factor));
            let largest = if down && across { 0.25 } else { 0.5 };
            let is_mean = !(down || across);
            let is_needed = is_mean || largest * edge_spread_peak(&samples, at.columns) > NEGLIGIBLE_EDGE;
            is_needed.then_some(Term { down, across, samples })
        };
        Self { at, terms: terms.into_iter().filter_map(term).collect() }
    }

    /// Returns them summed over squares of `n` samples from each on, over their number: what a pixel of so many samples gathers, about its first.
    fn over_pixels(self, n: usize) -> Self {
        let Self { at, terms } = self;
        let (first_row, first_column) = (at.first_row - (n as i64 - 1), at.first_column - (n as i64 - 1));
        let wide = Rectangle { first_row, first_column, rows: at.rows + n - 1, columns: at.columns + n - 1 };
        let share = 1.0 / (n * n) as f32;
        let sum = |term: Term| {
            let mut samples = vec![0.0; wide.len()];
            for (row, line) in term.samples.chunks_exact(at.columns).enumerate() {
                for (down, across) in (0..n).flat_map(|down| (0..n).map(move |across| (down, across))) {
                    let sums = &mut samples[(row + down) * wide.columns + across..][..at.columns];
                    sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += share * value);
                }
            }
            Term { samples, ..term }
        };
        Self { at: wide, terms: terms.into_iter().map(sum).collect() }
    }

    /// Whether any of the terms changes across.
    fn changes_across(&self) -> bool {
        self.terms.iter().any(|term| term.across)
    }
}

/// Samples that a tile gathers from, turned to the canonical tile, and where its own lie.
struct Source {
    /// Rows and columns of samples.
    size: (usize, usize),
    samples: Vec<f32>,
}

impl Source {
    /// A power of two about as large as the largest sample: in its units what is transformed together has rounding errors of one size.
    fn scale(&self) -> f32 {
        let largest = self.samples.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        // The exponent alone.
        f32::from_bits(largest.to_bits() & 0x7f80_0000)
    }
}

/// A tile to be gathered.
struct Member {
    mirror: Mirror,
    /// Its pixels, and the samples on the raster that stand for them: from pixel to pixel `stride` of them.
    pixels: Rectangle,
    out: Rectangle,
    /// Rows and columns of what is gathered, turned to the canonical tile.
    out_size: (usize, usize),
    /// v and u of these rows and columns.
    down: Vec<f32>,
    across: Vec<f32>,
    light: Source,
    alpha: Alpha,
    /// Where pixels lie between wide samples, rows and columns: the first of two, and how far towards the second.
    between: Option<[Vec<(usize, f32)>; 2]>,
}

/// What a layer covers of what a tile gathers from.
enum Alpha {
    NotWanted,
    /// All of it, so that the tile is covered.
    Whole,
    Partly(Source),
}

/// What lies before a layer.
pub(crate) struct Past<'a> {
    pub(crate) visible: &'a Visible,
    pub(crate) picture: &'a Composite,
}

/// Gathers a layer on the pixels of all groups of tiles of one level. Tiles without anything are left out.
pub(crate) fn gather(
    task: &GatherTask<'_>,
    groups: &[&TileGroup],
    (ideal, past): (Option<&IdealLayer>, Option<&Past<'_>>),
) -> Result<Vec<Gathered>, Cancelled> {
    let gathered = groups.par_iter().map(|group| task.group(group, (ideal, past)));
    Ok(gathered.collect::<Result<Vec<_>, Cancelled>>()?.into_iter().flatten().collect())
}

impl GatherTask<'_> {
    fn group(
        &self,
        group: &TileGroup,
        (ideal, past): (Option<&IdealLayer>, Option<&Past<'_>>),
    ) -> Result<Vec<Gathered>, Cancelled> {
        self.cancel.check()?;
        let TileGroup { level, canonical, members } = group;
        let corners = canonical.corners().map(|node| self.kernels.at((node, *level)));
        let stride = level.per_pixel();
        let kernels = TileKernels::between(&corners);
        let kernels = if stride > 1 { kernels.over_pixels(stride) } else { kernels };
        let raster = Raster::new(self.film, *level);
        let found: Vec<Option<Member>> = members
            .iter()
            .map(|(tile, mirror)| self.member((tile, *mirror), canonical, (&raster, &kernels.at), ideal))
            .collect::<Result<_, Cancelled>>()?;
        let members: Vec<Member> = found.into_iter().flatten().collect();
        let sources = members.iter().enumerate().flat_map(|(number, member)| {
            let alpha = if let Alpha::Partly(source) = &member.alpha { Some((number, source)) } else { None };
            std::iter::once((number, &member.light)).chain(alpha)
        });
        let sources: Vec<(usize, &Source)> = sources.collect();
        let convolved = convolve(&kernels, &members, &sources, stride, (self.stopwatch, self.cancel))?;
        let mut planes = convolved.iter();
        let mut next = |member: &Member| planes.next().map_or_else(Vec::new, |plane| member.on_pixels(plane));
        let gathered = members.iter().map(|member| {
            let light = next(member);
            let alpha = match member.alpha {
                Alpha::NotWanted => vec![],
                Alpha::Whole => vec![1.0; light.len()],
                Alpha::Partly(_) => next(member),
            };
            let mut gathered = Gathered { at: member.pixels, light, alpha };
            if let Some(past) = past {
                self.stopwatch.time(Part::Compositing, || self.weigh(past, &mut gathered));
            }
            gathered
        });
        Ok(gathered.collect())
    }

    /// Takes away what nearer surfaces hide of what a tile gathers.
    fn weigh(&self, past: &Past<'_>, gathered: &mut Gathered) {
        let film = film_pixels(self.film);
        let (at, layer) = (gathered.at, self.layer);
        let (down, across) = ((at.first_row - film.first_row) as usize, (at.first_column - film.first_column) as usize);
        let open = |row: usize, column: usize| past.picture.open_well_before(layer, (row + down, column + across));
        past.visible.weigh(layer, &open, gathered);
    }

    /// Returns a tile with what it gathers from; `None` if there is nothing.
    fn member(
        &self,
        (tile, mirror): (&Tile, Mirror),
        canonical: &Tile,
        (raster, kernel): (&Raster, &Rectangle),
        ideal: Option<&IdealLayer>,
    ) -> Result<Option<Member>, Cancelled> {
        let Some(pixels) = tile.pixels(self.film) else { return Ok(None) };
        let film_pixels = Raster::new(self.film, Level::PIXEL);
        let stride = raster.level.per_pixel();
        let out = out_samples(&pixels, &film_pixels, raster);
        // Samples from the first to the last one that is gathered at, and all that the kernel reaches from there.
        let window = mirror.window_at_node(kernel);
        let reach = Rectangle { rows: stride * (out.rows - 1) + 1, columns: stride * (out.columns - 1) + 1, ..out };
        let from = reach.seen_through(&window);
        let is_there = ideal.is_none_or(|ideal| ideal.has_any(&from));
        if !is_there {
            return Ok(None);
        }
        let own;
        let ideal = match ideal {
            Some(ideal) => ideal,
            None => {
                let sample = || self.sampler.sample(raster, from, self.layer, self.cancel);
                own = self.stopwatch.time(Part::Sampling, sample)?;
                if own.lit.iter().all(|(start, end)| start >= end) {
                    return Ok(None);
                }
                &own
            }
        };
        let size = mirror.size((from.rows, from.columns));
        let source = |samples: &[f32]| {
            let block = cut(&ideal.at, samples, &from);
            let mut turned = vec![];
            mirror.applied(&block, (from.rows, from.columns), &mut turned);
            Source { size, samples: turned }
        };
        let alpha = if !self.sampler.with_alpha {
            Alpha::NotWanted
        } else {
            let source = source(&ideal.alpha);
            let is_whole = source.samples.iter().all(|alpha| (*alpha - 1.0).abs() < 1e-6);
            if is_whole { Alpha::Whole } else { Alpha::Partly(source) }
        };
        let between = (raster.level.pixels() > 1).then(|| {
            let split = |place: f64, n: usize| {
                let below = (place.max(0.0) as usize).min(n - 2);
                (below, (place - below as f64) as f32)
            };
            let step_px = raster.level.step_px();
            let row = |row: usize| {
                (film_pixels.down_px(pixels.first_row + row as i64) - raster.down_px(out.first_row)) / step_px
            };
            let column = |column: usize| {
                (film_pixels.across_px(pixels.first_column + column as i64) - raster.across_px(out.first_column))
                    / step_px
            };
            [
                (0..pixels.rows).map(|i| split(row(i), out.rows)).collect(),
                (0..pixels.columns).map(|i| split(column(i), out.columns)).collect(),
            ]
        });
        // Positions of what is gathered from the middle of the canonical tile.
        let step = stride as i64;
        let down_px = (0..out.rows as i64).map(|row| raster.down_px(out.first_row + step * row) + film_shift(raster));
        let across_px = (0..out.columns as i64)
            .map(|column| raster.across_px(out.first_column + step * column) + film_shift(raster));
        let (down_px, across_px) = mirror.positions(down_px.collect(), across_px.collect());
        let side = f64::from(canonical.size);
        let from_middle = |positions: Vec<f64>, start: i32| -> Vec<f32> {
            positions.iter().map(|px| ((px - f64::from(start)) / side - 0.5) as f32).collect()
        };
        Ok(Some(Member {
            mirror,
            pixels,
            out,
            out_size: mirror.size((out.rows, out.columns)),
            down: from_middle(down_px, canonical.down),
            across: from_middle(across_px, canonical.right),
            light: source(&ideal.light),
            alpha,
            between,
        }))
    }
}

/// The distance from the first sample of a pixel to the pixel's middle, pixels.
fn film_shift(raster: &Raster) -> f64 {
    0.5 * (1.0 - raster.level.step_px().min(1.0))
}

/// Returns the samples of a raster at which pixels are gathered: theirs, the first of each, or those of several pixels around them all.
pub(crate) fn out_samples(pixels: &Rectangle, film: &Raster, raster: &Raster) -> Rectangle {
    let last = |first: i64, n: usize| first + n as i64 - 1;
    let (down, across) = (film.down_px(pixels.first_row), film.across_px(pixels.first_column));
    let (bottom, right) =
        (film.down_px(last(pixels.first_row, pixels.rows)), film.across_px(last(pixels.first_column, pixels.columns)));
    if raster.level.pixels() == 1 {
        let shift = film_shift(raster) - 1e-6;
        let (first_row, first_column) = (raster.row_before(down - shift), raster.column_before(across - shift));
        return Rectangle { first_row, first_column, ..*pixels };
    }
    let (first_row, first_column) = (raster.row_before(down), raster.column_before(across));
    Rectangle {
        first_row,
        first_column,
        rows: (raster.row_before(bottom) + 2 - first_row) as usize,
        columns: (raster.column_before(right) + 2 - first_column) as usize,
    }
}

/// Returns a rectangle of samples that lie in another one; what lies beyond is 0.
fn cut(at: &Rectangle, samples: &[f32], wanted: &Rectangle) -> Vec<f32> {
    let mut block = vec![0.0; wanted.len()];
    if let Some(common) = wanted.intersection(at) {
        let lines = samples[common.offset_in(at)..].chunks(at.columns).take(common.rows);
        let to = block[common.offset_in(wanted)..].chunks_mut(wanted.columns);
        to.zip(lines).for_each(|(to, from)| to[..common.columns].copy_from_slice(&from[..common.columns]));
    }
    block
}

impl Member {
    /// Returns what was gathered, turned to the canonical tile, on the tile's pixels.
    fn on_pixels(&self, gathered: &[f32]) -> Vec<f32> {
        let Self { mirror, out, .. } = self;
        let values = mirror.restored(gathered, (out.rows, out.columns));
        let Some([rows, columns]) = &self.between else { return values };
        // Between the middles of wide samples.
        let mut fine = Vec::with_capacity(rows.len() * columns.len());
        for &(above, down) in rows {
            let lines = [above, above + 1].map(|line| &values[line * out.columns..][..out.columns]);
            fine.extend(columns.iter().map(|&(left, across)| {
                let along = |line: &[f32]| line[left] + across * (line[left + 1] - line[left]);
                let (upper, lower) = (along(lines[0]), along(lines[1]));
                upper + down * (lower - upper)
            }));
        }
        fine
    }
}

/// Convolves the sources of tiles, each given with the number of its tile, by the kernels of their canonical tile: of each what the tile gathers.
fn convolve(
    kernels: &TileKernels,
    members: &[Member],
    sources: &[(usize, &Source)],
    stride: usize,
    (stopwatch, cancel): (&Stopwatch, &Cancel),
) -> Result<Vec<Vec<f32>>, Cancelled> {
    let largest = |of: fn(&Source) -> usize| sources.iter().map(|(_, source)| of(source)).max().unwrap_or(1);
    let size = (fast_size(largest(|source| source.size.0)), fast_size(largest(|source| source.size.1)));
    let n_out: usize =
        sources.iter().map(|(number, _)| members[*number].out_size.0 * members[*number].out_size.1).sum();
    if is_better_direct(kernels, n_out, sources.len(), size) {
        let sum = |(number, source): &(usize, &Source)| {
            cancel.check()?;
            Ok(stopwatch.time(Part::Direct, || by_sums(kernels, &members[*number], source, stride)))
        };
        return sources.iter().map(sum).collect();
    }
    stopwatch.time(Part::Transforms, || by_transforms(kernels, (members, sources), (size, stride), cancel))
}

/// Whether sums take less time than transforms of rectangles of this size for so many sources.
fn is_better_direct(kernels: &TileKernels, n_out: usize, n_sources: usize, (rows, columns): (usize, usize)) -> bool {
    // Products in a sum that take as long, measured on one core, as a value of a transform, beside what is in proportion to its logarithm.
    const OF_VALUE: [f64; 2] = [28.0, 5.0];
    let n = (rows * columns) as f64;
    let transform = n * (OF_VALUE[0] + OF_VALUE[1] * n.log2());
    let n_terms = kernels.terms.len() as f64;
    let pairs = n_sources.div_ceil(2) as f64;
    let transforms = transform * (0.5 * n_terms + pairs * (1.0 + n_terms));
    let n_sums = if kernels.changes_across() { 2.0 } else { 1.0 };
    n_sums * ((kernels.at.len() * n_out) as f64) < transforms
}

/// Gathers by sums over the kernel of each row.
fn by_sums(kernels: &TileKernels, member: &Member, source: &Source, stride: usize) -> Vec<f32> {
    let Rectangle { rows: height, columns: width, .. } = kernels.at;
    let (rows, columns) = member.out_size;
    // Every `stride`-th sample of each row, beginning with each of the first ones, so that what neighboring pixels gather lies side by side.
    let phase_len = columns.next_multiple_of(LANES) + width.div_ceil(stride);
    let mut phases = vec![0.0; source.size.0 * stride * phase_len];
    for (line, phases) in source.samples.chunks_exact(source.size.1).zip(phases.chunks_exact_mut(stride * phase_len)) {
        for (k, phase) in phases.chunks_exact_mut(phase_len).enumerate() {
            phase.iter_mut().zip(line.iter().skip(k).step_by(stride)).for_each(|(to, from)| *to = *from);
        }
    }
    let lines = Lines { phases: &phases, phase_len, stride, size: (height, width) };
    let mut out = vec![0.0; rows * columns];
    let (mut even, mut sloped) = (vec![0.0; height * width], vec![0.0; height * width]);
    let mut sums = vec![0.0; 2 * columns.next_multiple_of(LANES)];
    // Turned about: what a kernel's first sample takes lies last.
    let turned = kernels.terms.iter().map(|term| (term, term.samples.iter().rev().copied().collect()));
    let turned: Vec<(&Term, Vec<f32>)> = turned.collect();
    for (row, out) in out.chunks_exact_mut(columns).enumerate() {
        even.fill(0.0);
        sloped.fill(0.0);
        for (term, samples) in &turned {
            let into = if term.across { &mut sloped } else { &mut even };
            add_scaled(into, term.factor(member.down[row], 1.0), samples);
        }
        let (of_even, of_sloped) = sums.split_at_mut(columns.next_multiple_of(LANES));
        gather_row(&lines, stride * row, &even, of_even);
        if kernels.changes_across() {
            gather_row(&lines, stride * row, &sloped, of_sloped);
            let sums = of_even.iter().zip(&*of_sloped).zip(&member.across);
            out.iter_mut().zip(sums).for_each(|(out, ((even, sloped), u))| *out = even + u * sloped);
        } else {
            out.copy_from_slice(&of_even[..columns]);
        }
    }
    out
}

/// The rows of a source, each as `stride` phases of its samples.
struct Lines<'a> {
    phases: &'a [f32],
    phase_len: usize,
    stride: usize,
    /// Rows and columns of kernels.
    size: (usize, usize),
}

/// Puts what a row of pixels gathers into `out`, from a row of the source on and by a kernel that is turned about.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2", "aarch64+neon"))]
fn gather_row(lines: &Lines<'_>, first_row: usize, kernel: &[f32], out: &mut [f32]) {
    // As many sums at once as hide how long one takes.
    let (pairs, last) = out.as_chunks_mut::<{ 2 * LANES }>();
    let n = pairs.len();
    pairs.iter_mut().enumerate().for_each(|(i, out)| *out = gathered(lines, first_row, kernel, 2 * LANES * i));
    last.as_chunks_mut::<LANES>().0.iter_mut().for_each(|out| *out = gathered(lines, first_row, kernel, 2 * LANES * n));
}

/// Returns what some pixels of a row gather, from one on.
#[inline(always)]
fn gathered<const N: usize>(lines: &Lines<'_>, first_row: usize, kernel: &[f32], first: usize) -> [f32; N] {
    let Lines { phases, phase_len, stride, size: (_, width) } = *lines;
    let line_len = stride * phase_len;
    let mut sums = [0.0_f32; N];
    for (line, kernel) in phases[first_row * line_len..].chunks_exact(line_len).zip(kernel.chunks_exact(width)) {
        for phase in 0..stride.min(width) {
            let line = &line[phase * phase_len + first..];
            for (j, &weight) in kernel[phase..].iter().step_by(stride).enumerate() {
                let samples: &[f32; N] = line[j..j + N].try_into().expect("as many");
                for i in 0..N {
                    sums[i] += weight * samples[i];
                }
            }
        }
    }
    sums
}

/// Gathers by transforms: two sources at a time, one as the real and one as the imaginary part of a block, which a real kernel leaves apart.
fn by_transforms(
    kernels: &TileKernels,
    (members, sources): (&[Member], &[(usize, &Source)]),
    (size, stride): ((usize, usize), usize),
    cancel: &Cancel,
) -> Result<Vec<Vec<f32>>, Cancelled> {
    with_fft(size, |fft| {
        let of_kernel = |term: &Term| {
            let mut spectrum = vec![];
            fft.forward(&term.samples, kernels.at.columns, &mut spectrum);
            spectrum
        };
        let kernel_spectra: Vec<Vec<Complex<f32>>> = kernels.terms.iter().map(of_kernel).collect();
        let (columns, scale) = (fft.columns(), 1.0 / fft.len() as f32);
        let zero = Complex::new(0.0, 0.0);
        let mut lines = vec![zero; fft.len()];
        let (mut spectrum, mut product) = (vec![zero; fft.len()], vec![zero; fft.len()]);
        let mut gathered = Vec::with_capacity(sources.len());
        for pair in sources.chunks(2) {
            cancel.check()?;
            let n_rows = pair.iter().map(|(_, source)| source.size.0).max().unwrap_or(1);
            let lines = &mut lines[..n_rows * columns];
            lines.fill(zero);
            for (part, (_, source)) in pair.iter().enumerate() {
                let unit = 1.0 / source.scale();
                for (line, samples) in lines.chunks_exact_mut(columns).zip(source.samples.chunks_exact(source.size.1)) {
                    match part {
                        0 => line.iter_mut().zip(samples).for_each(|(value, sample)| value.re = unit * sample),
                        _ => line.iter_mut().zip(samples).for_each(|(value, sample)| value.im = unit * sample),
                    }
                }
            }
            fft.forward_pair(lines, &mut spectrum);
            let sizes = pair.iter().map(|(number, _)| members[*number].out_size);
            let mut sums: Vec<Vec<f32>> = sizes.map(|(rows, columns)| vec![0.0; rows * columns]).collect();
            for (term, kernel) in kernels.terms.iter().zip(&kernel_spectra) {
                product.copy_from_slice(&spectrum);
                multiply_by_real(&mut product, kernel, fft.rows());
                fft.inverse_pair(&mut product, lines);
                // Where a kernel reaches beyond the source transforms are of something else: the rest is what is gathered.
                let (top, left) = (kernels.at.rows - 1, kernels.at.columns - 1);
                for (part, ((number, source), sums)) in pair.iter().zip(&mut sums).enumerate() {
                    let Member { out_size, down, across, .. } = &members[*number];
                    let scale = scale * source.scale();
                    for (row, (sums, v)) in sums.chunks_exact_mut(out_size.1).zip(down).enumerate() {
                        let line = lines[(top + stride * row) * columns + left..].iter().step_by(stride);
                        for ((sum, value), u) in sums.iter_mut().zip(line).zip(across) {
                            let value = if part == 0 { value.re } else { value.im };
                            *sum += scale * term.factor(*v, *u) * value;
                        }
                    }
                }
            }
            gathered.extend(sums);
        }
        Ok(gathered)
    })
}
