//! A tree of boxes, so that a ray is tried on few objects.

use glam::{DVec3, Vec3, Vec4};

use super::shape::Ray;

/// Boxes of a node, which a ray is tried on together.
const WIDTH: usize = 4;

/// The most levels of nodes.
const DEPTH: usize = 8;

/// Objects in boxes within boxes, four to a node.
///
/// Boxes are of single precision, and widened by more than a ray of single precision errs: no object is missed.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
}

/// The boxes of up to four objects or nodes; no ray meets those of the places left.
#[derive(Clone, Debug)]
struct Node {
    /// The lower and the upper planes, by axis.
    planes: [[Vec4; 3]; 2],
    children: [Child; WIDTH],
}

impl Node {
    const EMPTY: Self = Self { planes: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]], children: [Child(0); WIDTH] };
}

/// The number of a node, or that of an object after all those of nodes.
#[derive(Clone, Copy, Debug)]
struct Child(u32);

impl Child {
    const FIRST_OBJECT: u32 = 1 << 31;

    fn object(object: usize) -> Self {
        Self(Self::FIRST_OBJECT + object as u32)
    }

    /// Returns the node's number, or else the object's.
    fn number(self) -> Result<usize, usize> {
        match self.0.checked_sub(Self::FIRST_OBJECT) {
            None => Ok(self.0 as usize),
            Some(object) => Err(object as usize),
        }
    }
}

type Bounds = (DVec3, DVec3);

impl Tree {
    /// Returns the tree over these of the objects in boxes.
    pub(super) fn over(boxes: &[Bounds], objects: impl IntoIterator<Item = usize>) -> Self {
        let mut tree = Self { nodes: Vec::new() };
        let mut objects: Vec<usize> = objects.into_iter().collect();
        tree.add(boxes, &mut objects, 0);
        tree
    }

    /// Adds the node of some objects below so many others, and returns its number.
    fn add(&mut self, boxes: &[Bounds], objects: &mut [usize], depth: usize) -> u32 {
        assert!(depth < DEPTH, "a few hundred objects make {DEPTH} levels of four at most");
        let number = self.nodes.len();
        let groups = groups(boxes, objects);
        self.nodes.push(Node::EMPTY);
        for (place, group) in groups.into_iter().enumerate() {
            let (low, high) = around(boxes, group);
            for axis in 0..3 {
                self.nodes[number].planes[0][axis][place] = low[axis] as f32;
                self.nodes[number].planes[1][axis][place] = high[axis] as f32;
            }
            self.nodes[number].children[place] = match group {
                [object] => Child::object(*object),
                _ => Child(self.add(boxes, group, depth + 1)),
            };
        }
        number as u32
    }

    /// Calls `visit(object, t_max)` for objects whose boxes the ray meets before `t_max`; it returns the new `t_max`.
    pub(super) fn walk(&self, ray: Ray, t_max: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        /// Above all roundings of a difference, a product and a quotient of single precision.
        const ROUNDING: f32 = 1e-6;
        /// A level of the tree leaves three of its nodes' boxes to be looked at.
        const STACK: usize = (WIDTH - 1) * DEPTH + 1;
        let origin = ray.origin.as_vec3();
        // Where it is 0 the planes are met far away, on the right side of them.
        let inverse = ray.direction.as_vec3().to_array().map(|d| 1.0 / d.abs().max(1e-9).copysign(d));
        let slack = ROUNDING * (Vec3::splat(4.0) + origin.abs());
        // The origin moved against the lower planes and against the upper ones.
        let moved = [(origin + slack).to_array(), (origin - slack).to_array()];
        // By axis: the planes by which the ray comes in, and for these and those by which it goes out the origin.
        let sides: [(usize, Vec4, Vec4, Vec4); 3] = std::array::from_fn(|axis| {
            let comes_in = usize::from(inverse[axis] < 0.0);
            let [from_in, from_out] = [comes_in, 1 - comes_in].map(|side| Vec4::splat(moved[side][axis]));
            (comes_in, from_in, from_out, Vec4::splat(inverse[axis]))
        });
        let mut t_max = t_max;
        let (mut entries, mut children) = ([0.0_f32; STACK], [Child(0); STACK]);
        let mut height = 1;
        while height > 0 {
            height -= 1;
            if f64::from(entries[height]) > t_max {
                continue;
            }
            let node = match children[height].number() {
                Ok(number) => &self.nodes[number],
                Err(object) => {
                    t_max = visit(object, t_max);
                    continue;
                }
            };
            let (mut t_in, mut t_out) = (Vec4::ZERO, Vec4::splat(t_max as f32));
            for (axis, (comes_in, from_in, from_out, inverse)) in sides.into_iter().enumerate() {
                t_in = t_in.max((node.planes[comes_in][axis] - from_in) * inverse);
                t_out = t_out.min((node.planes[1 - comes_in][axis] - from_out) * inverse);
            }
            t_in *= 1.0 - ROUNDING;
            let mut met = t_in.cmple(t_out * (1.0 + ROUNDING)).bitmask();
            let t_in = t_in.to_array();
            let first = height;
            while met != 0 {
                let place = met.trailing_zeros() as usize;
                met &= met - 1;
                // The nearest last, so that it is looked at first.
                let mut at = height;
                while at > first && entries[at - 1] < t_in[place] {
                    (entries[at], children[at]) = (entries[at - 1], children[at - 1]);
                    at -= 1;
                }
                (entries[at], children[at]) = (t_in[place], node.children[place]);
                height += 1;
            }
        }
    }
}

/// Parts objects into up to four groups, those that take up most first.
fn groups<'a>(boxes: &[Bounds], objects: &'a mut [usize]) -> Vec<&'a mut [usize]> {
    let mut groups = vec![objects];
    while groups.len() < WIDTH {
        let cost = |group: &&mut [usize]| group.len() as f64 * area(around(boxes, group));
        let divisible = (0..groups.len()).filter(|&i| groups[i].len() > 1);
        let Some(most) = divisible.max_by(|&a, &b| cost(&groups[a]).total_cmp(&cost(&groups[b]))) else { break };
        let group = groups.swap_remove(most);
        let at = split(boxes, group);
        let (left, right) = group.split_at_mut(at);
        groups.extend([left, right]);
    }
    groups
}

fn around(boxes: &[Bounds], objects: &[usize]) -> Bounds {
    objects.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), &o| (low.min(boxes[o].0), high.max(boxes[o].1)))
}

fn area((low, high): Bounds) -> f64 {
    let d = high - low;
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Sorts two objects or more along the axis that parts them best, and returns the place at which to part them.
///
/// The cost of a side is its area times its objects: a ray meets a box in proportion to the box's area.
fn split(boxes: &[Bounds], objects: &mut [usize]) -> usize {
    let sort = |objects: &mut [usize], axis: usize| {
        let middle = |object: usize| boxes[object].0[axis] + boxes[object].1[axis];
        objects.sort_by(|&a, &b| middle(a).total_cmp(&middle(b)).then(a.cmp(&b)));
    };
    let mut best = (f64::INFINITY, 0, 1);
    for axis in 0..3 {
        sort(objects, axis);
        for at in 1..objects.len() {
            let side = |part: &[usize]| (part.len() as f64 + 0.5) * area(around(boxes, part));
            let cost = side(&objects[..at]) + side(&objects[at..]);
            if cost < best.0 {
                best = (cost, axis, at);
            }
        }
    }
    sort(objects, best.1);
    best.2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_box_on_the_way_is_visited() {
        let boxes: Vec<Bounds> = (0..60)
            .map(|i| {
                let corner = DVec3::new(f64::from(i % 5), f64::from(i / 5 % 4), f64::from(i / 20));
                (corner, corner + DVec3::splat(0.5))
            })
            .collect();
        let tree = Tree::over(&boxes, 0..boxes.len());
        for i in 0..200 {
            let turn = 0.1 * f64::from(i);
            let direction = DVec3::new(turn.cos(), (0.7 * turn).sin(), turn.sin()).normalize();
            let ray = Ray { origin: DVec3::new(2.1, 1.7, 1.2), direction };
            let mut visited = vec![false; boxes.len()];
            tree.walk(ray, f64::INFINITY, |object, t_max| {
                visited[object] = true;
                t_max
            });
            for (object, (low, high)) in boxes.iter().enumerate() {
                let (a, b) = ((*low - ray.origin) / direction, (*high - ray.origin) / direction);
                let (t_in, t_out) = (a.min(b).max_element(), a.max(b).min_element());
                assert!(visited[object] || t_in > t_out || t_out < 0.0, "ray {i}, box {object}");
            }
        }
    }
}
