//! A tree of boxes around things in space: which is nearest, and which a line of sight meets.
//!
//! The usual bounding volume hierarchy: split in the middle of the order along the widest
//! axis, so it is balanced whatever the things are, and building and asking never recurse
//! deeper than the logarithm of their number.

use nalgebra::Vector3;

/// A box along the axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aabb {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

/// So many things or fewer share a leaf.
const LEAF: usize = 4;
/// Of a line of sight, as a share of it: flat boxes are met in spite of rounding.
const SLACK: f64 = 1e-9;

/// Finite boxes, ready for questions.
pub(crate) struct BoxTree {
    /// Each before its two halves, the lower half right behind it.
    nodes: Vec<Node>,
    /// Indices of the things, so that each node has a range of them.
    order: Vec<usize>,
}

struct Node {
    bounds: Aabb,
    begin: usize,
    end: usize,
    /// The upper half; none in a leaf.
    upper: Option<usize>,
}

impl Aabb {
    /// The smallest box around finite points; there must be one.
    pub(crate) fn around(points: &[Vector3<f64>]) -> Self {
        let first = points[0];
        let (low, high) = points.iter().fold((first, first), |(low, high), point| {
            (low.inf(point), high.sup(point))
        });
        Self { low, high }
    }

    fn joined(&self, other: &Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    fn center(&self) -> Vector3<f64> {
        0.5 * (self.low + self.high)
    }

    fn squared_distance(&self, point: &Vector3<f64>) -> f64 {
        (point - point.sup(&self.low).inf(&self.high)).norm_squared()
    }

    /// Whether the way from `start` along `step` (whose inverse is `inverse`) meets the box
    /// before it has gone one step.
    fn is_met(&self, start: &Vector3<f64>, inverse: &Vector3<f64>) -> bool {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            if inverse[axis].is_infinite() {
                // The way stays where it starts; 0 · ∞ would say nothing.
                if !(self.low[axis]..=self.high[axis]).contains(&start[axis]) {
                    return false;
                }
                continue;
            }
            let to_low = (self.low[axis] - start[axis]) * inverse[axis];
            let to_high = (self.high[axis] - start[axis]) * inverse[axis];
            enter = enter.max(to_low.min(to_high));
            leave = leave.min(to_low.max(to_high));
        }
        enter <= leave + SLACK
    }
}

/// The nearest thing so far, by its squared distance.
struct Nearest<'a, F> {
    point: &'a Vector3<f64>,
    squared: f64,
    squared_distance: F,
    is_found: bool,
}

impl BoxTree {
    /// Of the things that these boxes are around.
    pub(crate) fn new(boxes: &[Aabb]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(boxes.len()),
            order: (0..boxes.len()).collect(),
        };
        if !boxes.is_empty() {
            tree.build(boxes, 0, boxes.len());
        }
        tree
    }

    /// Adds the node of a range of `order`, and all below it.
    fn build(&mut self, boxes: &[Aabb], begin: usize, end: usize) {
        let range = &mut self.order[begin..end];
        let first = boxes[range[0]];
        let bounds = (range.iter()).fold(first, |bounds, &i| bounds.joined(&boxes[i]));
        let node = self.nodes.len();
        self.nodes.push(Node {
            bounds,
            begin,
            end,
            upper: None,
        });
        if range.len() <= LEAF {
            return;
        }
        let centers: Vec<_> = range.iter().map(|&i| boxes[i].center()).collect();
        let spread = Aabb::around(&centers);
        let axis = (spread.high - spread.low).imax();
        let middle = range.len() / 2;
        range.select_nth_unstable_by(middle, |&a, &b| {
            let of = |i: usize| boxes[i].center()[axis];
            of(a).total_cmp(&of(b)).then(a.cmp(&b))
        });
        self.build(boxes, begin, begin + middle);
        self.nodes[node].upper = Some(self.nodes.len());
        self.build(boxes, begin + middle, end);
    }

    /// The distance of the nearest thing at most `limit` away, where a thing is as far from
    /// `point` as the root of `squared_distance` of its index says, and within its box.
    pub(crate) fn nearest(
        &self,
        point: &Vector3<f64>,
        limit: f64,
        squared_distance: impl FnMut(usize) -> f64,
    ) -> Option<f64> {
        let mut nearest = Nearest {
            point,
            squared: limit * limit * (1.0 + 1e-9),
            squared_distance,
            is_found: false,
        };
        if !self.nodes.is_empty() {
            self.nearest_below(0, &mut nearest);
        }
        let distance = nearest.squared.sqrt();
        (nearest.is_found && distance <= limit).then_some(distance)
    }

    fn nearest_below<F: FnMut(usize) -> f64>(&self, node: usize, nearest: &mut Nearest<'_, F>) {
        let Node {
            begin, end, upper, ..
        } = self.nodes[node];
        let Some(upper) = upper else {
            for &thing in &self.order[begin..end] {
                let squared = (nearest.squared_distance)(thing);
                if squared <= nearest.squared {
                    (nearest.squared, nearest.is_found) = (squared, true);
                }
            }
            return;
        };
        let halves = [node + 1, upper];
        let mut halves = halves.map(|half| {
            (
                self.nodes[half].bounds.squared_distance(nearest.point),
                half,
            )
        });
        if halves[1].0 < halves[0].0 {
            halves.swap(0, 1);
        }
        for (squared, half) in halves {
            if squared < nearest.squared || (squared <= nearest.squared && !nearest.is_found) {
                self.nearest_below(half, nearest);
            }
        }
    }

    /// Whether `meets` holds of the index of any thing whose box lies on the way from `start`
    /// to `end`.
    pub(crate) fn any_between(
        &self,
        start: &Vector3<f64>,
        end: &Vector3<f64>,
        mut meets: impl FnMut(usize) -> bool,
    ) -> bool {
        let inverse = (end - start).map(f64::recip);
        !self.nodes.is_empty() && self.any_below(0, start, &inverse, &mut meets)
    }

    fn any_below(
        &self,
        node: usize,
        start: &Vector3<f64>,
        inverse: &Vector3<f64>,
        meets: &mut impl FnMut(usize) -> bool,
    ) -> bool {
        let Node {
            bounds,
            begin,
            end,
            upper,
        } = &self.nodes[node];
        if !bounds.is_met(start, inverse) {
            return false;
        }
        match upper {
            None => self.order[*begin..*end].iter().any(|&thing| meets(thing)),
            Some(upper) => {
                self.any_below(node + 1, start, inverse, meets)
                    || self.any_below(*upper, start, inverse, meets)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(numbers: &[[f64; 3]]) -> Vec<Vector3<f64>> {
        numbers.iter().copied().map(Vector3::from).collect()
    }

    proptest! {
        #[test]
        fn the_nearest_point_is_that_of_a_scan(
            numbers in prop::collection::vec(prop::array::uniform3(-3_i8..3), 0..60),
            at in prop::array::uniform3(-4.0..4.0), limit in 0.0..5.0,
        ) {
            // Whole numbers: many points are equal or in line.
            let numbers: Vec<_> = numbers.iter().map(|p| p.map(f64::from)).collect();
            let (points, at) = (points(&numbers), Vector3::from(at));
            let boxes: Vec<_> = points.iter().map(|p| Aabb::around(&[*p])).collect();
            let found = BoxTree::new(&boxes).nearest(&at, limit, |i| (points[i] - at).norm_squared());
            let scanned = points.iter().map(|p| (p - at).norm()).fold(f64::INFINITY, f64::min);
            prop_assert_eq!(found, (scanned <= limit).then_some(scanned));
        }

        #[test]
        fn all_boxes_on_the_way_are_asked(
            numbers in prop::collection::vec(prop::array::uniform3(-3_i8..3), 0..40),
            start in prop::array::uniform3(-4_i8..4), end in prop::array::uniform3(-4_i8..4),
        ) {
            let corner = |p: &[i8; 3]| Vector3::from(p.map(f64::from));
            let boxes: Vec<_> = (numbers.chunks_exact(2))
                .map(|pair| Aabb::around(&[corner(&pair[0]), corner(&pair[1])]))
                .collect();
            let (start, end) = (corner(&start), corner(&end));
            let mut asked = vec![false; boxes.len()];
            BoxTree::new(&boxes).any_between(&start, &end, |i| { asked[i] = true; false });
            for (index, one) in boxes.iter().enumerate() {
                // A point of the way in the box, if the way is walked in small steps.
                let inside = (0..=240).any(|i| {
                    one.squared_distance(&start.lerp(&end, f64::from(i) / 240.0)) < 1e-20
                });
                prop_assert!(asked[index] || !inside);
            }
        }
    }

    #[test]
    fn nothing_has_no_nearest() {
        let tree = BoxTree::new(&[]);
        let origin = Vector3::zeros();
        assert_eq!(tree.nearest(&origin, f64::INFINITY, |_| 0.0), None);
        assert!(!tree.any_between(&origin, &origin, |_| true));
    }
}
