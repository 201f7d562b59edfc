//! A tree over many lights, by which one is drawn by how much of its light may fall on a point.
//!
//! Every node bounds the lights below it: their power, the box that holds them, and a cone that holds the directions they face
//! (Conty Estevez & Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", Proc. ACM CGIT 1(2), 2018). From a point,
//! a node's importance is
//!
//! I = Φ · cos θ′ · cos i′ / d²
//!
//! with d the distance to the middle of the box, but at least its radius; θ′ the least angle between a light's direction and that to the
//! point, the angle from the cone's axis less the cone's and less that under which the box is seen; and i′ the least angle from the
//! normal at the point. It is 0 only where no light below it can fall on the point. A walk from the root goes to each child
//! with a probability in proportion to its importance; the product of these is that of the light.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use crate::Receiver;

/// What is known of a light, or of several together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LightBounds {
    /// The corners of a box that holds them, m.
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
    /// The direction about which they face, of length 1.
    pub(crate) axis: Vec3,
    /// Half the angle of the cone about the axis that holds the directions they face, rad.
    pub(crate) spread_rad: f32,
    /// How far from those directions they shine, rad; 90° at most.
    pub(crate) reach_rad: f32,
    /// Whether they shine to the opposite directions as well.
    pub(crate) is_two_sided: bool,
    /// Their power as if they shone all around as brightly as where they are brightest: 4π times that intensity, in any unit.
    pub(crate) power: f32,
}

impl LightBounds {
    /// Returns the bounds of what shines from a box in all directions.
    pub(crate) fn all_around(low: Vec3, high: Vec3, power: f32) -> Self {
        Self { low, high, axis: Vec3::Z, spread_rad: PI, reach_rad: FRAC_PI_2, is_two_sided: false, power }
    }

    fn middle(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }

    /// Returns the bounds of both.
    fn with(&self, other: &Self) -> Self {
        let (axis, spread_rad) = self.cone_with(other);
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis,
            spread_rad,
            reach_rad: self.reach_rad.max(other.reach_rad),
            is_two_sided: self.is_two_sided || other.is_two_sided,
            power: self.power + other.power,
        }
    }

    /// Returns axis and half angle of a cone around both cones.
    fn cone_with(&self, other: &Self) -> (Vec3, f32) {
        let (wide, narrow) = if self.spread_rad >= other.spread_rad { (self, other) } else { (other, self) };
        // An axis of what shines both ways has no sign.
        let is_flipped = wide.is_two_sided && narrow.is_two_sided && wide.axis.dot(narrow.axis) < 0.0;
        let towards = if is_flipped { -narrow.axis } else { narrow.axis };
        let apart_rad = wide.axis.dot(towards).clamp(-1.0, 1.0).acos();
        if apart_rad + narrow.spread_rad <= wide.spread_rad {
            return (wide.axis, wide.spread_rad);
        }
        // Rounded up, so that no direction is left out.
        let spread_rad = 0.5 * (wide.spread_rad + apart_rad + narrow.spread_rad) + ROUNDING_RAD;
        let aside = (towards - wide.axis * wide.axis.dot(towards)).normalize_or_zero();
        if spread_rad >= PI || aside == Vec3::ZERO {
            return (wide.axis, PI);
        }
        let (sin, cos) = (spread_rad - wide.spread_rad).sin_cos();
        ((cos * wide.axis + sin * aside).normalize(), spread_rad)
    }

    /// Returns what such a node costs: power times a measure of directions times one of places, on which the
    /// tree is divided (the surface area orientation heuristic; the square of the diagonal for the area, which lights in a row haven't).
    fn cost(&self) -> f32 {
        let (o, w) = (self.spread_rad, (self.spread_rad + self.reach_rad).min(PI));
        let rim = 2.0 * w * o.sin() - (o - 2.0 * w).cos() - 2.0 * o * o.sin() + o.cos();
        let directions = 2.0 * PI * (1.0 - o.cos()) + FRAC_PI_2 * rim;
        self.power * directions * (self.high - self.low).length_squared()
    }
}

/// Some rounding errors of an angle, rad.
const ROUNDING_RAD: f32 = 1e-5;

/// A node, ready to be asked.
#[derive(Clone, Copy, Debug)]
struct Node {
    middle: Vec3,
    radius_squared: f32,
    axis: Vec3,
    cos_spread: f32,
    sin_spread: f32,
    cos_reach: f32,
    power: f32,
    is_two_sided: bool,
    /// The second child of a node, the first being the next node; the number of a light in a leaf.
    link: u32,
    is_leaf: bool,
    parent: u32,
}

impl Node {
    fn new(bounds: &LightBounds, parent: u32, leaf: Option<u32>) -> Self {
        Self {
            middle: bounds.middle(),
            // Somewhat more than half the diagonal, for roundings.
            radius_squared: 0.2501 * (bounds.high - bounds.low).length_squared(),
            axis: bounds.axis,
            cos_spread: if bounds.spread_rad >= PI { -1.0 } else { bounds.spread_rad.cos() },
            sin_spread: if bounds.spread_rad >= PI { 0.0 } else { bounds.spread_rad.sin() },
            cos_reach: bounds.reach_rad.cos().max(0.0),
            power: bounds.power,
            is_two_sided: bounds.is_two_sided,
            link: leaf.unwrap_or(0),
            is_leaf: leaf.is_some(),
            parent,
        }
    }

    /// Returns how much light of this node may fall on a point.
    fn importance(&self, at: &Receiver) -> f32 {
        let from = at.point - self.middle;
        let squared = from.length_squared();
        if squared <= self.radius_squared {
            // Within the lights: they may face any way, from any side.
            return self.power / self.radius_squared.max(f32::MIN_POSITIVE);
        }
        let direction = from / squared.sqrt();
        let sin_squared = self.radius_squared / squared;
        let (sin_seen, cos_seen) = (sin_squared.sqrt(), (1.0 - sin_squared).max(0.0).sqrt());
        let cos = self.axis.dot(direction);
        let cos = if self.is_two_sided { cos.abs() } else { cos };
        let [sin, cos] = less(sine_and(cos), [self.sin_spread, self.cos_spread]);
        let [_, cos] = less([sin, cos], [sin_seen, cos_seen]);
        if cos <= self.cos_reach {
            return 0.0;
        }
        let facing = at.normal.map_or(1.0, |normal| {
            let [_, cos] = less(sine_and(-normal.dot(direction)), [sin_seen, cos_seen]);
            cos.max(0.0)
        });
        self.power * cos * facing / squared
    }
}

/// Returns sine and cosine of an angle from 0 to 180° with this cosine.
fn sine_and(cos: f32) -> [f32; 2] {
    let cos = cos.clamp(-1.0, 1.0);
    [(1.0 - cos * cos).sqrt(), cos]
}

/// Returns sine and cosine of an angle less another, 0 where that is larger; both from 0 to 180°.
fn less([sin_a, cos_a]: [f32; 2], [sin_b, cos_b]: [f32; 2]) -> [f32; 2] {
    if cos_a >= cos_b { [0.0, 1.0] } else { [sin_a * cos_b - cos_a * sin_b, cos_a * cos_b + sin_a * sin_b] }
}

/// Lights in a binary tree.
#[derive(Clone, Debug)]
pub(crate) struct LightTree {
    /// The root first, every node before its children.
    nodes: Vec<Node>,
    /// The leaf of each light.
    leaves: Vec<u32>,
}

/// The parent of the root, the leaf of a light without power.
const NONE: u32 = u32::MAX;
/// Parts that an axis is divided into to find the cheapest division.
const N_BUCKETS: usize = 16;
/// Deeper nodes are divided in the middle of their list, so that the depth stays below this and 32 more.
const DEEP: u32 = 48;

impl LightTree {
    /// Returns the tree of these lights; those without power are never drawn.
    pub(crate) fn new(lights: &[LightBounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), leaves: vec![NONE; lights.len()] };
        let mut shining: Vec<u32> = (0..lights.len() as u32).filter(|&i| lights[i as usize].power > 0.0).collect();
        if !shining.is_empty() {
            tree.nodes.reserve(2 * shining.len() - 1);
            tree.add(lights, &mut shining, (NONE, 0));
        }
        tree
    }

    /// Adds the node of some lights and all below it; returns its bounds.
    fn add(&mut self, lights: &[LightBounds], some: &mut [u32], (parent, depth): (u32, u32)) -> LightBounds {
        let number = self.nodes.len() as u32;
        if let [light] = *some {
            let bounds = lights[light as usize];
            self.nodes.push(Node::new(&bounds, parent, Some(light)));
            self.leaves[light as usize] = number;
            return bounds;
        }
        self.nodes.push(Node::new(&lights[some[0] as usize], parent, None));
        let at = divide(lights, some, depth);
        let (first, second) = some.split_at_mut(at);
        let left = self.add(lights, first, (number, depth + 1));
        let link = self.nodes.len() as u32;
        let bounds = left.with(&self.add(lights, second, (number, depth + 1)));
        self.nodes[number as usize] = Node { link, is_leaf: false, ..Node::new(&bounds, parent, None) };
        bounds
    }

    /// Draws a light for a point; returns it with its probability, and what is left of the number in [0, 1). `None` where none that
    /// the walk ends at can shine on the point: probabilities then sum to less than 1.
    pub(crate) fn pick(&self, at: &Receiver, mut u: f64) -> Option<(usize, f32, f64)> {
        let (mut number, mut probability) = (0, 1.0);
        let mut node = self.nodes.first()?;
        while !node.is_leaf {
            let [first, second] = [number + 1, node.link as usize];
            let share = self.first_share(at, [first, second])?;
            let is_first = u < f64::from(share);
            let (taken, from) = if is_first { (share, 0.0) } else { (1.0 - share, f64::from(share)) };
            u = ((u - from) / f64::from(taken)).clamp(0.0, BELOW_ONE);
            probability *= taken;
            number = if is_first { first } else { second };
            node = &self.nodes[number];
        }
        Some((node.link as usize, probability, u))
    }

    /// Returns the irradiance that all lights may give a point, roughly; W m⁻² where powers are 4π times the greatest intensity, W sr⁻¹. 0 only
    /// where none can shine on it.
    pub(crate) fn irradiance(&self, at: &Receiver) -> f32 {
        let Some(root) = self.nodes.first() else { return 0.0 };
        let importance = match root.is_leaf {
            true => root.importance(at),
            false => self.nodes[1].importance(at) + self.nodes[root.link as usize].importance(at),
        };
        importance / (4.0 * PI)
    }

    /// Returns the probability with which `pick` draws a light.
    pub(crate) fn probability(&self, at: &Receiver, light: usize) -> f32 {
        let mut number = self.leaves[light];
        if number == NONE {
            return 0.0;
        }
        let mut probability = 1.0;
        while self.nodes[number as usize].parent != NONE && probability > 0.0 {
            let parent = self.nodes[number as usize].parent;
            let is_first = number == parent + 1;
            let children = [parent as usize + 1, self.nodes[parent as usize].link as usize];
            let Some(share) = self.first_share(at, children) else { return 0.0 };
            probability *= if is_first { share } else { 1.0 - share };
            number = parent;
        }
        probability
    }

    /// Returns the probability of the first of two children; `None` where neither can matter.
    fn first_share(&self, at: &Receiver, children: [usize; 2]) -> Option<f32> {
        let [first, second] = children.map(|child| self.nodes[child].importance(at));
        let sum = first + second;
        // The importance of a point within its own light has no bound.
        if sum.is_finite() { (sum > 0.0).then(|| first / sum) } else { Some(0.5) }
    }
}

/// The largest number below 1.
pub(crate) const BELOW_ONE: f64 = 1.0 - 0.5 * f64::EPSILON;

/// Orders some lights so that they can be divided in two, and returns where.
fn divide(lights: &[LightBounds], some: &mut [u32], depth: u32) -> usize {
    let of = |light: u32| &lights[light as usize];
    let (low, high) = some
        .iter()
        .map(|&light| of(light).middle())
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), middle| (low.min(middle), high.max(middle)));
    let size = high - low;
    let bucket = |light: u32, axis: usize| {
        let place = (of(light).middle()[axis] - low[axis]) / size[axis];
        ((place * N_BUCKETS as f32) as usize).min(N_BUCKETS - 1)
    };
    let best = (0..3)
        .filter(|&axis| size[axis] > 0.0 && depth < DEEP)
        .filter_map(|axis| {
            let mut buckets = [None::<LightBounds>; N_BUCKETS];
            for &light in &*some {
                let of_bucket = &mut buckets[bucket(light, axis)];
                *of_bucket = Some(of_bucket.map_or(*of(light), |bounds| bounds.with(of(light))));
            }
            // Long boxes are to be cut across.
            let weight = size.max_element() / size[axis];
            cheapest(&buckets).map(|(cost, cut)| (weight * cost, axis, cut))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, axis, cut)) = best else { return some.len() / 2 };
    some.sort_by_key(|&light| bucket(light, axis) >= cut);
    some.partition_point(|&light| bucket(light, axis) < cut)
}

/// Returns the cost of the cheapest division of a row of buckets, and the first bucket behind it.
fn cheapest(buckets: &[Option<LightBounds>; N_BUCKETS]) -> Option<(f32, usize)> {
    let join = |a: Option<LightBounds>, b: &Option<LightBounds>| match (a, b) {
        (Some(a), Some(b)) => Some(a.with(b)),
        (a, b) => a.or(*b),
    };
    let mut behind = [None; N_BUCKETS + 1];
    for i in (0..N_BUCKETS).rev() {
        behind[i] = join(behind[i + 1], &buckets[i]);
    }
    let mut before = None;
    let mut best: Option<(f32, usize)> = None;
    for cut in 1..N_BUCKETS {
        before = join(before, &buckets[cut - 1]);
        if let (Some(a), Some(b)) = (&before, &behind[cut]) {
            let cost = a.cost() + b.cost();
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, cut));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn unit(rng: &mut ChaCha8Rng) -> Vec3 {
        loop {
            let v = Vec3::new(rng.random(), rng.random(), rng.random()) * 2.0 - 1.0;
            if v.length_squared() > 1e-3 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }

    fn lights(n: usize, rng: &mut ChaCha8Rng) -> Vec<LightBounds> {
        let one = |i: usize| {
            let (low, size) = (10.0 * unit(rng), rng.random::<f32>() * 0.1);
            let power = if i % 17 == 3 { 0.0 } else { rng.random::<f32>() + 0.01 };
            let all_around = LightBounds::all_around(low, low + size, power);
            match i % 3 {
                0 => all_around,
                kind => LightBounds { axis: unit(rng), spread_rad: 0.0, is_two_sided: kind == 2, ..all_around },
            }
        };
        (0..n).map(one).collect()
    }

    fn receiver(rng: &mut ChaCha8Rng) -> Receiver {
        let normal = rng.random::<bool>().then(|| unit(rng));
        Receiver { point: 12.0 * rng.random::<f32>() * unit(rng), normal }
    }

    /// Stepping evenly through the number draws each light in proportion to its probability, and what is left is even again.
    #[test]
    fn probabilities_are_those_of_picks() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for n_lights in [1, 2, 3, 40] {
            let lights = lights(n_lights, &mut rng);
            let tree = LightTree::new(&lights);
            for _ in 0..20 {
                let at = receiver(&mut rng);
                let n = 20_000;
                let (mut counts, mut rests) = (vec![0.0; n_lights], vec![0.0; n_lights]);
                for i in 0..n {
                    if let Some((light, probability, rest)) = tree.pick(&at, (f64::from(i) + 0.5) / f64::from(n)) {
                        let stated = tree.probability(&at, light);
                        assert!((probability - stated).abs() <= 1e-5 * probability, "{probability} {stated}");
                        counts[light] += 1.0 / f64::from(n);
                        rests[light] += rest / f64::from(n);
                    }
                }
                for light in 0..n_lights {
                    let probability = f64::from(tree.probability(&at, light));
                    assert!(
                        (counts[light] - probability).abs() < 2.0 / f64::from(n),
                        "{} {probability}",
                        counts[light]
                    );
                    assert!(
                        (rests[light] - 0.5 * probability).abs() < 2.0 / f64::from(n),
                        "{} {probability}",
                        rests[light]
                    );
                    assert!(lights[light].power > 0.0 || probability == 0.0);
                }
                let sum: f64 = counts.iter().sum();
                // A walk can end where bounds were too wide: nothing below shines on the point.
                assert!(sum < 1.0 + 1e-9, "{sum}");
            }
        }
    }

    /// No light that can shine on a point is left out of what stands for it.
    #[test]
    fn bounds_leave_no_light_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let (mut n_lit, mut n_dark) = (0, 0);
        for _ in 0..30 {
            let lights = lights(30, &mut rng);
            let tree = LightTree::new(&lights);
            for _ in 0..30 {
                let at = receiver(&mut rng);
                for (i, light) in lights.iter().enumerate().filter(|(_, light)| light.power > 0.0) {
                    // Its middle as a point, which faces along its axis.
                    let to_light = (light.middle() - at.point).normalize();
                    let facing = -light.axis.dot(to_light);
                    let facing = if light.is_two_sided { facing.abs() } else { facing };
                    let is_lit = light.spread_rad >= PI || facing > 1e-3;
                    let is_seen = at.normal.is_none_or(|normal| normal.dot(to_light) > 1e-3);
                    let probability = tree.probability(&at, i);
                    if is_lit && is_seen {
                        n_lit += 1;
                        assert!(probability > 0.0, "{light:?} {at:?}");
                    } else if probability == 0.0 {
                        n_dark += 1;
                    }
                }
            }
        }
        assert!(n_lit > 5_000 && n_dark > 5_000, "{n_lit} {n_dark}");
    }

    /// Lights of equal places cannot be divided by place.
    #[test]
    fn lights_in_one_place_are_divided() {
        let tree = LightTree::new(&vec![LightBounds::all_around(Vec3::ONE, Vec3::ONE, 1.0); 1000]);
        let at = Receiver::from(Vec3::ZERO);
        assert!((0..1000).all(|light| (tree.probability(&at, light) * 1000.0 - 1.0).abs() < 1e-4));
        assert!(LightTree::new(&[]).pick(&at, 0.5).is_none());
        let row: Vec<LightBounds> = (0..2000)
            .map(|i| LightBounds::all_around(Vec3::X * 1.5_f32.powi(i / 40), Vec3::X * 1.5_f32.powi(i / 40), 1.0))
            .collect();
        let tree = LightTree::new(&row);
        let sum: f32 = (0..2000).map(|light| tree.probability(&at, light)).sum();
        assert!((sum - 1.0).abs() < 1e-4, "{sum}");
    }
}
