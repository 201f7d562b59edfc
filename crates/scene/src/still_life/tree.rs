//! A tree of boxes, so that a ray is tried on few objects.

use glam::DVec3;

use super::shape::Ray;

/// Objects in boxes within boxes.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// Objects in the order of the leaves.
    order: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The first of its objects in a leaf; else its second child, the first being the next node.
    first: usize,
    /// How many objects; 0 for a node with children.
    len: usize,
    /// The axis along which the children were parted.
    axis: usize,
}

type Bounds = (DVec3, DVec3);

impl Tree {
    /// Returns the tree over objects in these boxes, of which there is at least one.
    pub(super) fn over(boxes: &[Bounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: Vec::new() };
        let mut objects: Vec<usize> = (0..boxes.len()).collect();
        tree.add(boxes, &mut objects);
        tree
    }

    fn add(&mut self, boxes: &[Bounds], objects: &mut [usize]) -> usize {
        let index = self.nodes.len();
        let (low, high) = around(boxes, objects);
        self.nodes.push(Node { low, high, first: self.order.len(), len: objects.len(), axis: 0 });
        let Some((axis, at)) = best_split(boxes, objects) else {
            self.order.extend_from_slice(objects);
            return index;
        };
        objects.sort_by(|&a, &b| middle(boxes[a], axis).total_cmp(&middle(boxes[b], axis)).then(a.cmp(&b)));
        let (left, right) = objects.split_at_mut(at);
        self.add(boxes, left);
        let second = self.add(boxes, right);
        self.nodes[index] = Node { first: second, len: 0, axis, ..self.nodes[index] };
        index
    }

    /// Calls `visit(object, t_max)` for objects whose boxes the ray meets before `t_max`; it returns the new `t_max`.
    pub(super) fn walk(&self, ray: Ray, t_max: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        let inverse = ray.direction.recip();
        let mut t_max = t_max;
        let mut stack = [0; 48];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index];
            let (a, b) = ((node.low - ray.origin) * inverse, (node.high - ray.origin) * inverse);
            let (t_in, t_out) = (a.min(b).max_element(), a.max(b).min_element());
            if t_in > t_out || t_out < 0.0 || t_in > t_max {
                continue;
            }
            if node.len > 0 {
                for &object in &self.order[node.first..node.first + node.len] {
                    t_max = visit(object, t_max);
                }
            } else {
                // The nearer child last, so that it is looked at first.
                let children = [index + 1, node.first];
                let nearer = usize::from(ray.direction[node.axis] < 0.0);
                stack[height] = children[1 - nearer];
                stack[height + 1] = children[nearer];
                height += 2;
            }
        }
    }
}

fn around(boxes: &[Bounds], objects: &[usize]) -> Bounds {
    objects.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), &o| (low.min(boxes[o].0), high.max(boxes[o].1)))
}

fn middle((low, high): Bounds, axis: usize) -> f64 {
    low[axis] + high[axis]
}

/// Returns the axis and place at which to part objects, or `None` when they had better stay together.
///
/// The cost of a side is its area times its objects: a ray meets a box in proportion to the box's area.
fn best_split(boxes: &[Bounds], objects: &[usize]) -> Option<(usize, usize)> {
    let area = |(low, high): Bounds| {
        let d = high - low;
        d.x * d.y + d.y * d.z + d.z * d.x
    };
    let n = objects.len();
    let mut best = (n as f64 * area(around(boxes, objects)), None);
    let mut sorted = objects.to_vec();
    for axis in 0..3 {
        sorted.sort_by(|&a, &b| middle(boxes[a], axis).total_cmp(&middle(boxes[b], axis)).then(a.cmp(&b)));
        for at in 1..n {
            let side = |part: &[usize]| (part.len() as f64 + 0.5) * area(around(boxes, part));
            let cost = side(&sorted[..at]) + side(&sorted[at..]);
            if cost < best.0 {
                best = (cost, Some((axis, at)));
            }
        }
    }
    best.1
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
        let tree = Tree::over(&boxes);
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
