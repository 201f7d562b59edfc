//! A region of a pupil's plane by lines across it.

use glam::DVec2;

use super::{
    Front, Search,
    edge::{Edge, EdgeSearch},
};
use crate::quadrature::gauss_legendre_on;

/// Lines of a first look, and rays across each.
const N_LINES: usize = 33;
const N_ACROSS: usize = 48;
/// Rays across a span that the lines beside one lead to expect, and where such a span may end.
const N_EXPECTED: usize = 24;
const N_AT_ENDS: usize = 64;
/// How often the rays near a place where the light may begin or end are made finer, and how many are added each time.
const FINER_ROUNDS: usize = 4;
const N_FINER: usize = 7;
/// Rounds in which the rectangle that lines are laid over is fitted to the light, and the room that is left about it.
const FIT_ROUNDS: usize = 16;
const ROOM: f64 = 0.3;
/// Light that fills less than this share of the rectangle is looked at more closely.
const SMALL: f64 = 0.4;
/// Places known to be lit that get lines of their own.
const MOST_SEEDS: usize = 16;
/// Halvings of the distance between two lines that see different numbers of spans.
const HALVINGS: usize = 10;
/// The fewest lines between two such places.
const LEAST_LINES: usize = 16;
/// Places of Gauss's rule on a line whose light is summed.
const N_OF_AREA: usize = 12;
/// The most places along a line that lines beside it lead to expect light at: a search of few places where rounding makes light and darkness
/// alternate, which would be looked at ever more closely.
const MOST_WINDOWS: usize = 32;
/// Clearance at which a ray is held to graze its rim, mm.
const EDGE_MM: f64 = 1e-9;

/// A region as lines across it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Strips {
    lines: Vec<Line>,
    /// What the lines lie on, where that is not the plane.
    front: Option<Box<Front>>,
}

/// A line across a region: the strip of the region that it stands for.
#[derive(Clone, Debug, PartialEq)]
struct Line {
    foot_mm: DVec2,
    direction: DVec2,
    /// The width of the strip.
    width_mm: f64,
    /// Where the line is lit: from and to, along it from its foot.
    spans_mm: Vec<[f64; 2]>,
}

impl Strips {
    /// Finds the region of a pupil about places of it, by about so many lines; `None` if the lines see no light.
    pub(super) fn find(search: &Search<'_>, lit: &[(DVec2, f64)], n_lines: usize) -> Option<Self> {
        let seeds = spread(lit);
        let mut frame = Frame::about(&lit.iter().map(|(place, _)| (*place, 1.0)).collect::<Vec<_>>());
        let mut lines = Vec::new();
        for round in 0..FIT_ROUNDS {
            let places = frame.even_lines(&seeds);
            lines = frame.look(search, &places, (&[], 0));
            frame.follow(search, &mut lines);
            let fitted = frame.fitted(&lines, round < 2)?;
            if fitted == frame || round + 1 == FIT_ROUNDS {
                break;
            }
            frame = fitted;
        }
        let ranges = frame.ranges(search, &mut lines);
        let total: f64 = ranges.iter().map(|[low, high]| high - low).sum();
        let mut strips = Vec::new();
        for [low, high] in ranges {
            let n = ((n_lines as f64 * (high - low) / total).ceil() as usize).max(LEAST_LINES);
            let (places, widths): (Vec<f64>, Vec<f64>) = gauss_legendre_on(n, low, high).into_iter().unzip();
            let seen = frame.look(search, &places, (&lines, N_EXPECTED));
            let spans = frame.edges(search, &seen);
            strips.extend(seen.iter().zip(widths).zip(spans).map(|((line, width_mm), spans_mm)| Line {
                foot_mm: frame.place_mm(line.s, 0.0),
                direction: frame.along.perp(),
                width_mm,
                spans_mm,
            }));
        }
        let strips = Self { lines: strips, front: search.front.cloned().map(Box::new) };
        (strips.area_mm2() > 0.0).then_some(strips)
    }

    /// The area of the region, mm².
    pub(super) fn area_mm2(&self) -> f64 {
        self.nodes(N_OF_AREA).iter().map(|(_, area_mm2)| area_mm2).sum()
    }

    /// Returns the places of Gauss's rule on each line, and the area that each stands for, mm².
    pub(super) fn nodes(&self, n: usize) -> Vec<(DVec2, f64)> {
        let rule = gauss_legendre_on(n, 0.0, 1.0);
        let mut nodes = Vec::new();
        for line in &self.lines {
            for [from, to] in &line.spans_mm {
                let node = |(share, weight): &(f64, f64)| {
                    let along_mm = from + (to - from) * share;
                    self.in_plane(line.foot_mm + along_mm * line.direction, weight * (to - from) * line.width_mm)
                };
                nodes.extend(rule.iter().map(node));
            }
        }
        nodes
    }

    /// Returns a place and an area about it as they are in the pupil's plane.
    fn in_plane(&self, place_mm: DVec2, area_mm2: f64) -> (DVec2, f64) {
        match &self.front {
            None => (place_mm, area_mm2),
            Some(front) => (front.target_mm(place_mm), area_mm2 * front.stretch(place_mm)),
        }
    }
}

/// Returns some of the places: those of most clearance, and some of all.
fn spread(lit: &[(DVec2, f64)]) -> Vec<DVec2> {
    let mut lit = lit.to_vec();
    let every = lit.len().div_ceil(MOST_SEEDS / 2).max(1);
    let mut seeds: Vec<DVec2> = lit.iter().step_by(every).map(|(place, _)| *place).collect();
    lit.sort_by(|a, b| b.1.total_cmp(&a.1));
    seeds.extend(lit.iter().take(MOST_SEEDS / 2).map(|(place, _)| *place));
    seeds
}

/// Returns where a line should be lit, going by the two nearest of those that are known on each side of it: from where to where along
/// it.
fn expected(known: &[Seen], s: f64) -> Vec<[f64; 2]> {
    let (before, after) = known.split_at(known.partition_point(|line| line.s < s));
    let sides = [before.iter().rev().take(2).collect::<Vec<_>>(), after.iter().take(2).collect()];
    let mut windows = Vec::new();
    for side in sides {
        let [nearest, rest @ ..] = &side[..] else { continue };
        for [from, to] in nearest.windows() {
            let middle = 0.5 * (from + to);
            let beyond = rest.first().and_then(|line| {
                let middles = line.windows().into_iter().map(|[from, to]| 0.5 * (from + to));
                let next = middles.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()))?;
                (line.s != nearest.s).then(|| (next - middle) / (line.s - nearest.s) * (s - nearest.s))
            });
            let (center, half) =
                (middle + beyond.unwrap_or(0.0), 0.5 * (to - from) + 0.3 * beyond.unwrap_or(0.0).abs());
            windows.push([center - half, center + half]);
        }
    }
    if windows.len() > MOST_WINDOWS { widest(windows) } else { windows }
}

/// Returns the widest of these windows, after those that overlap are made one.
fn widest(mut windows: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    windows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut apart: Vec<[f64; 2]> = Vec::new();
    for [from, to] in windows {
        match apart.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => apart.push([from, to]),
        }
    }
    apart.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
    apart.truncate(MOST_WINDOWS);
    apart
}

/// A rectangle of the plane: lines run across it, and follow one another along its longer side.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Frame {
    origin_mm: DVec2,
    along: DVec2,
    /// From where to where lines lie along the rectangle, and from where to where they run.
    s: [f64; 2],
    t: [f64; 2],
}

/// A ray of a line: its place along it, and its clearance.
type Sample = (f64, f64);

/// The rays of a line across the rectangle, in their order.
#[derive(Clone, Debug)]
struct Seen {
    s: f64,
    samples: Vec<Sample>,
}

impl Seen {
    /// Returns the numbers of the first and the last of each run of lit rays.
    fn runs(&self) -> Vec<[usize; 2]> {
        let mut runs: Vec<[usize; 2]> = Vec::new();
        for i in (0..self.samples.len()).filter(|&i| self.samples[i].1 > 0.0) {
            match runs.last_mut() {
                Some(run) if run[1] + 1 == i => run[1] = i,
                _ => runs.push([i, i]),
            }
        }
        runs
    }

    fn is_lit(&self) -> bool {
        self.samples.iter().any(|sample| sample.1 > 0.0)
    }

    /// Returns from where to where each run of lit rays lasts at most: from the dark ray before it to the dark one after it.
    fn windows(&self) -> Vec<[f64; 2]> {
        let last = self.samples.len().saturating_sub(1);
        let window = |[from, to]: [usize; 2]| [from.saturating_sub(1), (to + 1).min(last)].map(|i| self.samples[i].0);
        self.runs().into_iter().map(window).collect()
    }

    /// Returns the pairs of places between which light may begin and end again, or end and begin again: around rays that are
    /// nearer to a rim than both their neighbors on the same side of it, by no more than their neighbors differ.
    fn doubtful(&self) -> Vec<[f64; 2]> {
        let n = self.samples.len();
        let is_lit = |i: usize| self.samples[i].1 > 0.0;
        let of = |i: usize| {
            let (before, after) = (i.checked_sub(1), (i + 1 < n).then_some(i + 1));
            let here = self.samples[i].1.abs();
            let sides = || [before, after].into_iter().flatten();
            if !here.is_finite() || sides().any(|j| is_lit(j) != is_lit(i) || self.samples[j].1.abs() < here) {
                return None;
            }
            let change = |j: usize| Some(self.samples[j].1.abs() - here).filter(|change| change.is_finite());
            let change = sides().filter_map(change).fold(0.0, f64::max);
            let ends = [before.unwrap_or(i), after.unwrap_or(i)].map(|j| self.samples[j].0);
            (here < 2.0 * change).then_some(ends)
        };
        (0..n).filter_map(of).collect()
    }
}

impl Frame {
    /// Returns the rectangle about weighted places, with its longer side along where they spread most.
    fn about(places: &[(DVec2, f64)]) -> Self {
        let total: f64 = places.iter().map(|(_, weight)| weight).sum();
        let origin_mm = places.iter().map(|(place, weight)| *place * *weight).sum::<DVec2>() / total;
        let spread = |f: fn(DVec2) -> f64| places.iter().map(|(at, weight)| weight * f(*at - origin_mm)).sum::<f64>();
        let (xx, xy, yy) = (spread(|p| p.x * p.x), spread(|p| p.x * p.y), spread(|p| p.y * p.y));
        let along = DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy));
        let extent = |axis: DVec2| {
            let at = places.iter().map(|(place, _)| axis.dot(*place - origin_mm));
            let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
            let room = ROOM * (high - low).max(1e-9);
            [low - room, high + room]
        };
        Self { origin_mm, along, s: extent(along), t: extent(along.perp()) }
    }

    fn place_mm(&self, s: f64, t: f64) -> DVec2 {
        self.origin_mm + s * self.along + t * self.along.perp()
    }

    /// Returns the places of lines at equal distances, and through these places.
    fn even_lines(&self, seeds: &[DVec2]) -> Vec<f64> {
        let [low, high] = self.s;
        let even = (0..N_LINES).map(|i| low + (high - low) * (i as f64 + 0.5) / N_LINES as f64);
        let of_seeds = seeds.iter().map(|seed| self.along.dot(*seed - self.origin_mm));
        let mut places: Vec<f64> = even.chain(of_seeds.filter(|s| low < *s && *s < high)).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        places
    }

    /// Traces rays along these lines, finer where light may begin or end unseen, and so many more across each span that lines beside
    /// them that are known, in their order, lead to expect.
    fn look(&self, search: &Search<'_>, places: &[f64], (known, n_expected): (&[Seen], usize)) -> Vec<Seen> {
        let evenly =
            |[low, high]: [f64; 2], n: usize| (0..n).map(move |k| low + (high - low) * (k as f64 + 0.5) / n as f64);
        let mut lines: Vec<Seen> = places.iter().map(|&s| Seen { s, samples: Vec::new() }).collect();
        let of_line = |(line, &s): (usize, &f64)| {
            let expected = expected(known, s).into_iter().flat_map(|window| evenly(window, n_expected));
            evenly(self.t, N_ACROSS).chain(expected).map(|t| (line, t)).collect::<Vec<_>>()
        };
        let all: Vec<(usize, f64)> = places.iter().enumerate().flat_map(of_line).collect();
        self.add(search, &mut lines, &all);
        for _ in 0..FINER_ROUNDS {
            let finer = |line: usize, [from, to]: [f64; 2]| {
                (1..=N_FINER).map(move |k| (line, from + (to - from) * k as f64 / (N_FINER + 1) as f64))
            };
            let doubtful =
                lines.iter().enumerate().flat_map(|(i, line)| line.doubtful().into_iter().map(move |d| (i, d)));
            let more: Vec<(usize, f64)> = doubtful.flat_map(|(line, ends)| finer(line, ends)).collect();
            if more.is_empty() {
                break;
            }
            self.add(search, &mut lines, &more);
        }
        lines
    }

    /// Looks more closely along lines that see no light beside lines that do, as at the horns of a crescent, and then along those beside
    /// them.
    fn follow(&self, search: &Search<'_>, lines: &mut [Seen]) {
        let mut is_followed = vec![false; lines.len()];
        loop {
            let is_lit: Vec<bool> = lines.iter().map(Seen::is_lit).collect();
            let is_beside = |i: usize| (i > 0 && is_lit[i - 1]) || is_lit.get(i + 1).is_some_and(|is_lit| *is_lit);
            let open: Vec<usize> =
                (0..lines.len()).filter(|&i| !is_lit[i] && !is_followed[i] && is_beside(i)).collect();
            if open.is_empty() {
                break;
            }
            let places: Vec<f64> = open.iter().map(|&i| lines[i].s).collect();
            for (i, seen) in open.into_iter().zip(self.look(search, &places, (lines, N_AT_ENDS))) {
                is_followed[i] = true;
                lines[i] = seen;
            }
        }
    }

    fn add(&self, search: &Search<'_>, lines: &mut [Seen], more: &[(usize, f64)]) {
        let targets: Vec<DVec2> = more.iter().map(|&(line, t)| self.place_mm(lines[line].s, t)).collect();
        for (&(line, t), clearance) in more.iter().zip(search.clearances(&targets)) {
            lines[line].samples.push((t, clearance));
        }
        for line in lines {
            line.samples.sort_by(|a, b| a.0.total_cmp(&b.0));
            line.samples.dedup_by(|a, b| a.0 == b.0);
        }
    }

    /// Returns the rectangle that fits what these lines see, the same if it fits already; `None` if they see no light.
    fn fitted(&self, lines: &[Seen], may_turn: bool) -> Option<Self> {
        let spans: Vec<(f64, [f64; 2])> = lines
            .iter()
            .flat_map(|line| line.runs().into_iter().map(|run| (line.s, run.map(|i| line.samples[i].0))))
            .collect();
        let extent = |values: &mut dyn Iterator<Item = f64>| {
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
        };
        let s = extent(&mut spans.iter().map(|(s, _)| *s));
        let t = extent(&mut spans.iter().flat_map(|(_, ends)| *ends));
        if !s[0].is_finite() {
            return None;
        }
        let ends = |s: f64, t: [f64; 2]| t.map(|t| self.place_mm(s, t));
        if may_turn {
            let places = spans
                .iter()
                .flat_map(|&(s, t)| ends(s, t).map(|place| (place, 0.01 * (self.t[1] - self.t[0]) + t[1] - t[0])));
            let turned = Self::about(&places.collect::<Vec<_>>());
            if turned.along.perp_dot(self.along).abs() > TURN {
                return Some(turned.widened());
            }
        }
        let side = |range: [f64; 2], lit: [f64; 2], n: usize| {
            let (width, step) = (range[1] - range[0], (range[1] - range[0]) / n as f64);
            let is_at_end = [lit[0] - range[0] < step, range[1] - lit[1] < step];
            if !is_at_end[0] && !is_at_end[1] && lit[1] - lit[0] + 2.0 * step > SMALL * width {
                return range;
            }
            // Once more as much room where light reaches the end; close to the light where it does not.
            let room = ROOM * (lit[1] - lit[0]) + 2.0 * step;
            let wide = |is_at_end: bool| if is_at_end { 0.5 * width } else { room };
            [lit[0] - wide(is_at_end[0]), lit[1] + wide(is_at_end[1])]
        };
        Some(Self { s: side(self.s, s, N_LINES), t: side(self.t, t, N_ACROSS), ..*self })
    }

    /// Returns the rectangle with as much room again.
    fn widened(self) -> Self {
        let wider = |[low, high]: [f64; 2]| [low - ROOM * (high - low), high + ROOM * (high - low)];
        Self { s: wider(self.s), t: wider(self.t), ..self }
    }

    /// Returns the ranges of lines that see light, cut where the number of their spans changes.
    ///
    /// Adds the lines that it looks along.
    fn ranges(&self, search: &Search<'_>, lines: &mut Vec<Seen>) -> Vec<[f64; 2]> {
        let counts: Vec<usize> = lines.iter().map(|line| line.runs().len()).collect();
        let ends = lines.first().zip(lines.last()).map(|(first, last)| [first.s, last.s]);
        let changes = (1..lines.len()).filter(|&i| counts[i] != counts[i - 1]);
        let mut open: Vec<Change> = changes
            .map(|i| Change { before: (lines[i - 1].s, counts[i - 1]), after: (lines[i].s, counts[i]) })
            .collect();
        for _ in 0..HALVINGS {
            let middles: Vec<f64> = open.iter().map(|change| 0.5 * (change.before.0 + change.after.0)).collect();
            let seen = self.look(search, &middles, (lines, N_AT_ENDS));
            for (change, seen) in open.iter_mut().zip(&seen) {
                let here = (seen.s, seen.runs().len());
                *(if here.1 == change.before.1 { &mut change.before } else { &mut change.after }) = here;
            }
            lines.extend(seen);
            lines.sort_by(|a, b| a.s.total_cmp(&b.s));
        }
        // A range begins and ends with lines that are lit.
        let Some([first, last]) = ends else { return Vec::new() };
        let mut ranges = Vec::new();
        let mut begin = counts.first().filter(|count| **count > 0).map(|_| first);
        for change in open {
            if let Some(low) = begin {
                ranges.push([low, change.before.0]);
            }
            begin = (change.after.1 > 0).then_some(change.after.0);
        }
        ranges.extend(begin.map(|low| [low, last]));
        ranges.retain(|[low, high]| high > low);
        ranges
    }

    /// Returns where each line is lit, its ends found to rounding.
    fn edges(&self, search: &Search<'_>, lines: &[Seen]) -> Vec<Vec<[f64; 2]>> {
        let across = self.along.perp();
        let mut edges: Vec<Edge> = Vec::new();
        let mut starts: Vec<(usize, [f64; 2])> = Vec::new();
        for (number, line) in lines.iter().enumerate() {
            for [first, last] in line.runs() {
                let mut edge = |inner: Sample, outer: Option<&Sample>, direction: DVec2| {
                    let outer = outer.map_or((0.0, 0.0), |outer| ((outer.0 - inner.0).abs(), outer.1));
                    let from = self.place_mm(line.s, inner.0);
                    edges.push(Edge { outer: Some(outer), ..Edge::new(from, direction, inner.1) });
                };
                let before = first.checked_sub(1).map(|i| &line.samples[i]);
                edge(line.samples[first], before, -across);
                edge(line.samples[last], line.samples.get(last + 1), across);
                starts.push((number, [line.samples[first].0, line.samples[last].0]));
            }
        }
        search.narrow(&mut edges, EDGE_MM);
        let mut spans = vec![Vec::new(); lines.len()];
        for ((line, [from, to]), ends) in starts.into_iter().zip(edges.chunks(2)) {
            spans[line].push([from - ends[0].inner.0, to + ends[1].inner.0]);
        }
        spans
    }
}

/// The least turn of a rectangle that is made, rad.
const TURN: f64 = 0.1;

/// Two lines that see different numbers of spans.
#[derive(Clone, Copy)]
struct Change {
    before: (f64, usize),
    after: (f64, usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays that alternate between light and darkness, as rounding makes them.
    fn noisy(s: f64, n: usize) -> Seen {
        let sample = |i: usize| (i as f64, if i.is_multiple_of(2) { 1e-9 } else { f64::NEG_INFINITY });
        Seen { s, samples: (0..n).map(sample).collect() }
    }

    #[test]
    fn noise_is_one_window() {
        let known: Vec<Seen> = (0..4).map(|i| noisy(f64::from(i), 1000)).collect();
        assert_eq!(known[0].windows().len(), 500);
        assert_eq!(expected(&known, 1.5), [[0.0, 999.0]]);
    }

    #[test]
    fn few_windows_stay_as_they_are_and_of_many_the_widest_stay() {
        let islands = |n: usize| {
            // Each a lit ray between dark ones, the later the wider.
            let ends = (0..n).flat_map(|i| {
                let (at, half) = (10.0 * i as f64, 1.0 + 1e-3 * i as f64);
                [(at - half, -1.0), (at, 1.0), (at + half, -1.0)]
            });
            vec![Seen { s: 0.0, samples: ends.collect() }]
        };
        assert_eq!(expected(&islands(5), 1.0), islands(5)[0].windows());
        let found = expected(&islands(100), 1.0);
        assert_eq!(found.len(), MOST_WINDOWS);
        assert!(found.iter().all(|[from, to]| to - from > 2.0 + 2e-3 * 67.5), "{found:?}");
    }
}
