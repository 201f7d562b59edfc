//! A tree of boxes with eight places a node, so that a ray is tried on few of many things.
//!
//! obvhs joins boxes in pairs, nearest first, and improves the pairs by moving branches; what is done here is to collapse its
//! binary tree into one of eight places a node and four things a leaf, so that it costs least by the area of its boxes
//! (Ylitie, Karras & Laine 2017, section 3.1).

use glam::Vec4;
use obvhs::{
    Boundable, BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, node::Bvh2Node, reinsertion::ReinsertionOptimizer},
    ploc::PlocBuilder,
};

/// Places of a node.
const WIDTH: usize = 8;

/// Things of a leaf, by their numbers; `NONE` where there are fewer.
pub(crate) type Leaf = [u32; 4];

/// No thing.
pub(crate) const NONE: u32 = u32::MAX;

/// How many things a tree can hold: a bit of their numbers distinguishes leaves from nodes.
pub(crate) const MOST_THINGS: usize = (1 << 31) - 1;

/// The tree; what its leaves hold is kept by whom it was made for.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// None of an empty tree.
    root: Option<Place>,
    /// The most places that are still to be looked at while one is.
    max_pending: usize,
}

/// A node: boxes on a grid of its own, so that it fits in two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(128))]
struct Node {
    /// The grid's origin, and of each axis its spacing, a power of two, by its biased exponent.
    origin: [f32; 3],
    exponents: [u8; 3],
    /// How many places hold nodes; these are the first.
    n_nodes: u8,
    /// What the first place of nodes holds, and the first of leaves; the others follow.
    first_node: u32,
    first_leaf: u32,
    /// A bit each place that holds something.
    filled: u32,
    /// Of each axis, the low sides of all boxes, then the high ones, in spacings of the grid.
    sides: [[[u16; WIDTH]; 2]; 3],
}

/// The number of a node or of a leaf.
#[derive(Clone, Copy, Debug)]
struct Place(u32);

/// What a place holds.
enum Content {
    Node(usize),
    Leaf(usize),
}

impl Place {
    const LEAF: u32 = 1 << 31;

    fn content(self) -> Content {
        match self.0 & Self::LEAF {
            0 => Content::Node(self.0 as usize),
            _ => Content::Leaf((self.0 & !Self::LEAF) as usize),
        }
    }
}

/// What the test of boxes needs to know of a ray, computed once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxRay {
    origin: [f32; 3],
    inverse_direction: [f32; 3],
    is_negative: [bool; 3],
}

/// The boxes of a node that a ray enters: a bit each, and where it enters them.
struct Entered {
    places: u32,
    near: [f32; WIDTH],
}

impl BoxRay {
    pub(crate) fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        // A component of 0 is as good as one so small that the ray doesn't move along it.
        let inverse_direction = direction.map(|d| if d.abs() >= 1e-18 { 1.0 / d } else { 1e18_f32.copysign(d) });
        Self { origin, inverse_direction, is_negative: inverse_direction.map(|d| d < 0.0) }
    }
}

impl Node {
    const EMPTY: Self = Self {
        origin: [0.0; 3],
        exponents: [0; 3],
        n_nodes: 0,
        first_node: 0,
        first_leaf: 0,
        filled: 0,
        sides: [[[0; WIDTH]; 2]; 3],
    };

    /// Returns a node around one to eight boxes, without what its places hold. The boxes on its grid hold those given.
    fn around(boxes: &[Aabb]) -> Self {
        let mut node = Self { filled: (1 << boxes.len()) - 1, ..Self::EMPTY };
        for axis in 0..3 {
            let origin = boxes.iter().map(|aabb| aabb.min[axis]).fold(f32::INFINITY, f32::min);
            let end = boxes.iter().map(|aabb| aabb.max[axis]).fold(f32::NEG_INFINITY, f32::max);
            let mut exponent = ((end - origin) / f32::from(u16::MAX)).to_bits() >> 23;
            while side(origin, exponent, u16::MAX) < end {
                exponent += 1;
            }
            let nearest = |at: f32| ((at - origin) / spacing(exponent)) as u16;
            let [lows, highs] = &mut node.sides[axis];
            for ((low, high), aabb) in lows.iter_mut().zip(highs).zip(boxes) {
                *low = nearest(aabb.min[axis]);
                while side(origin, exponent, *low) > aabb.min[axis] {
                    *low -= 1;
                }
                *high = nearest(aabb.max[axis]);
                while side(origin, exponent, *high) < aabb.max[axis] {
                    *high += 1;
                }
            }
            (node.origin[axis], node.exponents[axis]) = (origin, exponent as u8);
        }
        node
    }

    fn place(&self, place: usize) -> Place {
        let place = place as u32;
        let n_nodes = u32::from(self.n_nodes);
        Place(if place < n_nodes { self.first_node + place } else { Place::LEAF | (self.first_leaf + place - n_nodes) })
    }

    /// Returns the places whose boxes a ray enters before `t_max`.
    ///
    /// Distances are those to sides moved by up to 2 ε of the coordinates of origin and side: boxes have to be that much
    /// larger than what is in them.
    #[inline(always)]
    fn entered_by(&self, ray: &BoxRay, t_max: f32) -> Entered {
        // Rounding of the products (Ize 2013).
        const GROW: f32 = 1.0 + 4.0 * f32::EPSILON;
        let mut near = [0.0_f32; WIDTH];
        let mut far = [t_max; WIDTH];
        for axis in 0..3 {
            let start = (self.origin[axis] - ray.origin[axis]) * ray.inverse_direction[axis];
            let step = spacing(self.exponents[axis].into()) * ray.inverse_direction[axis];
            let is_negative = ray.is_negative[axis];
            let nears = &self.sides[axis][usize::from(is_negative)];
            let fars = &self.sides[axis][usize::from(!is_negative)];
            for place in 0..WIDTH {
                let along = start + step * f32::from(nears[place]);
                near[place] = if along > near[place] { along } else { near[place] };
            }
            for place in 0..WIDTH {
                let along = start + step * f32::from(fars[place]);
                far[place] = if along < far[place] { along } else { far[place] };
            }
        }
        let mut places = 0;
        for half in [0, WIDTH / 2] {
            let of_half = |all: &[f32; WIDTH]| Vec4::from_slice(&all[half..]);
            places |= of_half(&near).cmple(of_half(&far) * GROW).bitmask() << half;
        }
        Entered { places: places & self.filled, near }
    }
}

/// The spacing of a grid by its biased exponent; no finer than the least normal number.
fn spacing(exponent: u32) -> f32 {
    f32::from_bits(exponent.max(1) << 23)
}

/// A place on a grid.
fn side(origin: f32, exponent: u32, n: u16) -> f32 {
    origin + spacing(exponent) * f32::from(n)
}

/// As many pending places as trees of millions of things have.
const USUAL_PENDING: usize = 96;

impl Tree {
    /// Looks into leaves whose boxes a ray enters before `t_max`, which `meets` shortens when it finds something there,
    /// near ones first.
    #[inline(always)]
    pub(crate) fn nearest(&self, ray: &BoxRay, t_max: f32, meets: impl FnMut(usize, &mut f32)) {
        match self.max_pending <= USUAL_PENDING {
            true => self.nearest_by(&mut [0; USUAL_PENDING], ray, t_max, meets),
            false => self.nearest_by(&mut vec![0; self.max_pending], ray, t_max, meets),
        }
    }

    /// Of pending places the distance at which the ray enters their boxes stands above their number, so that farther ones
    /// are larger: distances are not negative.
    #[inline(always)]
    fn nearest_by(&self, pending: &mut [u64], ray: &BoxRay, mut t_max: f32, mut meets: impl FnMut(usize, &mut f32)) {
        let Some(root) = self.root else { return };
        let mut next = u64::from(root.0);
        let mut n_pending = 0;
        loop {
            match Place(next as u32).content() {
                Content::Leaf(leaf) => meets(leaf, &mut t_max),
                Content::Node(node) => {
                    let node = &self.nodes[node];
                    let Entered { mut places, near } = node.entered_by(ray, t_max);
                    let first = n_pending;
                    while places != 0 {
                        let place = places.trailing_zeros() as usize % WIDTH;
                        places &= places - 1;
                        let entered = u64::from(near[place].to_bits()) << 32 | u64::from(node.place(place).0);
                        // The nearest of this node last.
                        let mut at = n_pending;
                        while at > first && pending[at - 1] < entered {
                            pending[at] = pending[at - 1];
                            at -= 1;
                        }
                        pending[at] = entered;
                        n_pending += 1;
                    }
                }
            }
            loop {
                if n_pending == 0 {
                    return;
                }
                n_pending -= 1;
                next = pending[n_pending];
                if f32::from_bits((next >> 32) as u32) <= t_max {
                    break;
                }
            }
        }
    }

    /// Looks into leaves whose boxes a ray enters before `t_max`, until `meets` finds something; tells whether it did.
    #[inline(always)]
    pub(crate) fn any(&self, ray: &BoxRay, t_max: f32, meets: impl FnMut(usize) -> bool) -> bool {
        match self.max_pending <= USUAL_PENDING {
            true => self.any_by(&mut [Place(0); USUAL_PENDING], ray, t_max, meets),
            false => self.any_by(&mut vec![Place(0); self.max_pending], ray, t_max, meets),
        }
    }

    #[inline(always)]
    fn any_by(&self, pending: &mut [Place], ray: &BoxRay, t_max: f32, mut meets: impl FnMut(usize) -> bool) -> bool {
        let Some(mut next) = self.root else { return false };
        let mut n_pending = 0;
        loop {
            match next.content() {
                Content::Leaf(leaf) if meets(leaf) => return true,
                Content::Leaf(_) => {}
                Content::Node(node) => {
                    let node = &self.nodes[node];
                    let mut places = node.entered_by(ray, t_max).places;
                    while places != 0 {
                        pending[n_pending] = node.place(places.trailing_zeros() as usize % WIDTH);
                        n_pending += 1;
                        places &= places - 1;
                    }
                }
            }
            if n_pending == 0 {
                return false;
            }
            n_pending -= 1;
            next = pending[n_pending];
        }
    }
}

/// A box, as the builder of the binary tree wants it.
pub(crate) struct Bounded(pub(crate) Aabb);

impl Boundable for Bounded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tree {
    /// Builds a tree over boxes, of which there can be none, and tells which of them its leaves hold.
    ///
    /// Boxes for which `has_company` doesn't hold are alone in their leaf.
    pub(crate) fn build(boxes: Vec<Bounded>, has_company: impl Fn(u32) -> bool) -> (Self, Vec<Leaf>) {
        if boxes.is_empty() {
            return (Self { nodes: Vec::new(), root: None, max_pending: 0 }, Vec::new());
        }
        let settings = BvhBuildParams::medium_build();
        let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
            settings.ploc_search_distance,
            &boxes,
            (0..boxes.len() as u32).collect(),
            settings.sort_precision,
            settings.search_depth_threshold,
        );
        drop(boxes);
        ReinsertionOptimizer::default().run(&mut binary, settings.reinsertion_batch_ratio, None);
        Collapse::of(&binary, has_company).tree()
    }
}

/// How a binary tree is collapsed.
struct Collapse<'a> {
    binary: &'a Bvh2,
    branches: Vec<Branch>,
}

/// What a branch of the binary tree costs.
#[derive(Clone, Copy)]
struct Branch {
    /// As 1, 2, … 7 places of the node above it.
    costs: [f32; WIDTH - 1],
    /// Things in it; more than a leaf holds where they can't be together in one.
    n_things: u8,
}

/// What it costs to try a ray on the boxes of a node, and on the things of a leaf.
const NODE_COST: f32 = 1.0;
const LEAF_COST: f32 = 0.5;

impl<'a> Collapse<'a> {
    fn of(binary: &'a Bvh2, has_company: impl Fn(u32) -> bool) -> Self {
        let nothing = Branch { costs: [0.0; WIDTH - 1], n_things: 0 };
        let mut collapse = Self { binary, branches: vec![nothing; binary.nodes.len()] };
        for index in parents_first(binary).into_iter().rev() {
            let node = &binary.nodes[index as usize];
            collapse.branches[index as usize] = if node.is_leaf() {
                let is_alone = !has_company(binary.primitive_indices[node.first_index as usize]);
                let n_things = if is_alone { u8::MAX } else { 1 };
                Branch { costs: [LEAF_COST * node.aabb().half_area(); WIDTH - 1], n_things }
            } else {
                collapse.branch(node)
            };
        }
        collapse
    }

    fn branch(&self, node: &Bvh2Node) -> Branch {
        let [left, right] = [0, 1].map(|side| self.branches[node.first_index as usize + side].n_things);
        let n_things = left.saturating_add(right);
        let area = node.aabb().half_area();
        let mut costs = [0.0; WIDTH - 1];
        let as_node = NODE_COST * area + self.shared_out(node, WIDTH).1;
        costs[0] = if is_leaf(n_things) { as_node.min(LEAF_COST * area) } else { as_node };
        for places in 2..WIDTH {
            costs[places - 1] = costs[places - 2].min(self.shared_out(node, places).1);
        }
        Branch { costs, n_things }
    }

    /// Returns how many of these places the left branch is to have, and what both cost then.
    fn shared_out(&self, node: &Bvh2Node, places: usize) -> (usize, f32) {
        let [left, right] = [0, 1].map(|side| &self.branches[node.first_index as usize + side].costs);
        let cost = |of_left: usize| left[of_left - 1] + right[places - of_left - 1];
        let mut best = (1, cost(1));
        for of_left in 2..places {
            if cost(of_left) < best.1 {
                best = (of_left, cost(of_left));
            }
        }
        best
    }

    /// Returns the tree, and what its leaves hold.
    fn tree(&self) -> (Tree, Vec<Leaf>) {
        if self.is_leaf(0) {
            return (Tree { nodes: Vec::new(), root: Some(Place(Place::LEAF)), max_pending: 0 }, vec![self.things(0)]);
        }
        let (mut nodes, mut leaves) = (vec![Node::EMPTY], Vec::new());
        let mut max_pending = 0;
        // Branches that are nodes, where they are to stand, and how many places are pending there.
        let mut to_do: Vec<(u32, usize, usize)> = vec![(0, 0, 0)];
        let mut children = Vec::with_capacity(WIDTH);
        while let Some((index, at, n_pending)) = to_do.pop() {
            children.clear();
            self.divide(&self.binary.nodes[index as usize], WIDTH, &mut children);
            children.sort_by_key(|&child| self.is_leaf(child));
            let (of_nodes, of_leaves) = children.split_at(children.partition_point(|&child| !self.is_leaf(child)));
            let boxes: Vec<Aabb> = children.iter().map(|&child| *self.binary.nodes[child as usize].aabb()).collect();
            let first_node = nodes.len();
            nodes[at] = Node {
                n_nodes: of_nodes.len() as u8,
                first_node: first_node as u32,
                first_leaf: leaves.len() as u32,
                ..Node::around(&boxes)
            };
            leaves.extend(of_leaves.iter().map(|&child| self.things(child)));
            nodes.resize(first_node + of_nodes.len(), nodes[at]);
            let n_pending = n_pending + children.len();
            max_pending = max_pending.max(n_pending);
            to_do.extend(of_nodes.iter().enumerate().rev().map(|(i, &child)| (child, first_node + i, n_pending - 1)));
        }
        (Tree { nodes, root: Some(Place(0)), max_pending }, leaves)
    }

    /// Tells whether a branch with one place is a leaf there.
    fn is_leaf(&self, index: u32) -> bool {
        let node = &self.binary.nodes[index as usize];
        let branch = &self.branches[index as usize];
        node.is_leaf() || is_leaf(branch.n_things) && branch.costs[0] == LEAF_COST * node.aabb().half_area()
    }

    /// Lists what stands in the places of a branch that is to have so many.
    fn divide(&self, node: &Bvh2Node, places: usize, into: &mut Vec<u32>) {
        let (of_left, _) = self.shared_out(node, places);
        for (side, mut places) in [(0, of_left), (1, places - of_left)] {
            let index = node.first_index + side;
            let costs = &self.branches[index as usize].costs;
            while places > 1 && costs[places - 1] == costs[places - 2] {
                places -= 1;
            }
            match places {
                1 => into.push(index),
                _ => self.divide(&self.binary.nodes[index as usize], places, into),
            }
        }
    }

    /// Returns the things of a branch that is a leaf.
    fn things(&self, index: u32) -> Leaf {
        let mut things = [NONE; 4];
        self.add_things(index, &mut things.iter_mut());
        things
    }
}

impl Collapse<'_> {
    fn add_things(&self, index: u32, places: &mut std::slice::IterMut<'_, u32>) {
        let node = &self.binary.nodes[index as usize];
        if !node.is_leaf() {
            self.add_things(node.first_index, places);
            self.add_things(node.first_index + 1, places);
        } else if let Some(place) = places.next() {
            *place = self.binary.primitive_indices[node.first_index as usize];
        }
    }
}

fn is_leaf(n_things: u8) -> bool {
    usize::from(n_things) <= Leaf::default().len()
}

/// Returns the nodes of a binary tree, each after the one above it.
fn parents_first(binary: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut to_do = vec![0];
    while let Some(index) = to_do.pop() {
        order.push(index);
        let node = &binary.nodes[index as usize];
        if !node.is_leaf() {
            to_do.extend([node.first_index + 1, node.first_index]);
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;

    /// Numbers in [0, 1) that fill it.
    fn fraction(index: usize, of: f32) -> f32 {
        (index as f32 * of).fract()
    }

    fn boxes(n: usize) -> Vec<Aabb> {
        let at = |i| Vec3A::new(fraction(i, 0.754_878), fraction(i, 0.569_84), fraction(i, 0.618_034));
        let around = |i| Aabb::new(at(i), at(i) + 0.02 * at(i + 7));
        (0..n).map(around).collect()
    }

    fn bounded(boxes: &[Aabb]) -> Vec<Bounded> {
        boxes.iter().copied().map(Bounded).collect()
    }

    /// Whether a ray from the origin enters a box, in f64.
    fn enters(aabb: &Aabb, direction: [f32; 3], t_max: f64) -> bool {
        let (mut near, mut far) = (0.0_f64, t_max);
        for (axis, along) in direction.into_iter().enumerate() {
            let [a, b] = [aabb.min[axis], aabb.max[axis]].map(|side| f64::from(side) / f64::from(along));
            (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
        }
        near <= far
    }

    #[test]
    fn boxes_on_the_grid_hold_those_given() {
        for scale in [1e-30, 1.0, 1e12] {
            for n in 1..=WIDTH {
                let scaled = boxes(n).iter().map(|b| Aabb::new(scale * b.min, scale * b.max)).collect::<Vec<_>>();
                let node = Node::around(&scaled);
                for (place, aabb) in scaled.iter().enumerate() {
                    for axis in 0..3 {
                        let [low, high] = [0, 1].map(|end| {
                            side(node.origin[axis], node.exponents[axis].into(), node.sides[axis][end][place])
                        });
                        assert!(low <= aabb.min[axis] && high >= aabb.max[axis], "{scale} {n} {place}");
                        // Two spacings of 2⁻¹⁵ of the node's extent, which is at most `scale`; or those of numbers near it.
                        let slack = scale * 1.1e-4 + f32::MIN_POSITIVE;
                        assert!(aabb.min[axis] - low < slack && high - aabb.max[axis] < slack, "{scale} {n} {place}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_box_that_a_ray_enters_is_looked_into() {
        let boxes = boxes(5000);
        let (tree, leaves) = Tree::build(bounded(&boxes), |thing| thing % 5 != 0);
        let mut held: Vec<u32> = leaves.iter().flatten().copied().filter(|&thing| thing != NONE).collect();
        held.sort_unstable();
        assert_eq!(held, (0..5000).collect::<Vec<_>>());
        let is_alone = |leaf: &Leaf| leaf[1] == NONE;
        assert!(leaves.iter().all(|leaf| is_alone(leaf) || leaf.iter().all(|&thing| thing == NONE || thing % 5 != 0)));
        assert!(!leaves.iter().all(is_alone));
        for i in 0..500 {
            let direction = [0.569_84, 0.754_878, 0.381_966].map(|of| 2.0 * fraction(i, of) - 0.9);
            let ray = BoxRay::new([0.0; 3], direction);
            let mut seen = vec![false; boxes.len()];
            tree.nearest(&ray, 1.0, |leaf, _| {
                leaves[leaf].iter().filter(|&&thing| thing != NONE).for_each(|&thing| seen[thing as usize] = true);
            });
            let mut n_seen_by_any = 0;
            let is_found = tree.any(&ray, 1.0, |leaf| {
                n_seen_by_any += leaves[leaf].iter().filter(|&&thing| thing != NONE).count();
                false
            });
            assert!(!is_found && n_seen_by_any == seen.iter().filter(|&&is| is).count());
            for (aabb, seen) in boxes.iter().zip(seen) {
                assert!(seen || !enters(aabb, direction, 1.0), "{aabb:?} {direction:?}");
            }
        }
    }

    /// Boxes each twice as large as the last make a tree deeper than usual.
    #[test]
    fn deep_trees_are_looked_through() {
        let nested: Vec<Aabb> = (0..200)
            .map(|i| 1.0 + 0.3 * i as f32)
            .map(f32::exp2)
            .map(|far| Aabb::new(Vec3A::splat(-far), Vec3A::splat(far)))
            .collect();
        let (tree, leaves) = Tree::build(bounded(&nested), |_| false);
        let mut n_seen = 0;
        tree.nearest(&BoxRay::new([0.0; 3], [0.0, 0.6, 0.8]), f32::INFINITY, |_, _| n_seen += 1);
        assert_eq!((n_seen, leaves.len()), (200, 200));
        assert!(tree.max_pending > USUAL_PENDING, "{}", tree.max_pending);
        assert!(!tree.any(&BoxRay::new([0.0; 3], [0.0, 0.6, -0.8]), 1.0, |_| false));
    }

    #[test]
    fn empty_tree_holds_nothing() {
        let (tree, leaves) = Tree::build(Vec::new(), |_| true);
        tree.nearest(&BoxRay::new([0.0; 3], [0.0, 0.0, 1.0]), 1.0, |_, _| panic!("nothing to look into"));
        assert!(leaves.is_empty() && !tree.any(&BoxRay::new([0.0; 3], [0.0, 0.0, 1.0]), 1.0, |_| true));
    }
}
