//! The cells into which the curves of a plane divide it: minimal cycles of their planar graph,
//! each with what lies within it as holes.

use super::curves::{Curve, Curves};
use super::face::{CurveIndex, Step};
use super::groups::groups;
use super::plane_fit::PlaneFrame;
use super::polygon::{contains, crosses_itself, signed_area};
use nalgebra::{Vector2, Vector3};
use std::collections::{BTreeMap, BTreeSet};

type Polygon = Vec<Vector2<f64>>;

/// A cell: its outer loop, counterclockwise, and those of its holes, clockwise.
pub(super) type Cell = Vec<Vec<Step>>;

/// A cycle of the graph as it lies in the plane.
struct Cycle {
    steps: Vec<Step>,
    polygon: Polygon,
    area: f64,
    component: usize,
}

/// The bounded cells between some curves of a plane.
pub(super) fn cells(curves: &Curves, members: Vec<&Curve>, frame: &PlaneFrame) -> Vec<Cell> {
    let direction = |from: &Vector3<f64>, to: &Vector3<f64>| {
        let along = frame.coordinates(to) - frame.coordinates(from);
        along.y.atan2(along.x)
    };
    let found = boundaries(curves, members, &direction).into_iter();
    let mut cycles: Vec<Cycle> = found
        .map(|(component, steps)| Cycle::new(curves, steps, component, frame))
        .collect();
    let sound = |cycle: &Cycle| cycle.polygon.len() > 2 && !crosses_itself(&cycle.polygon);
    cycles.retain(sound);
    nested(&cycles)
}

/// All closed chains of some curves of a surface that have a part of it on their left, each with
/// the number of the component of the graph that it bounds. `direction` is the angle in which one
/// goes on from a point to another one, counterclockwise.
pub(super) fn boundaries(
    curves: &Curves,
    members: Vec<&Curve>,
    direction: &dyn Fn(&Vector3<f64>, &Vector3<f64>) -> f64,
) -> Vec<(usize, Vec<Step>)> {
    let (closed, mut open): (Vec<&Curve>, Vec<&Curve>) =
        members.into_iter().partition(|curve| curve.ends.is_none());
    let mut found = Vec::new();
    for (component, circle) in closed.iter().enumerate() {
        for reversed in [false, true] {
            let step = Step {
                curve: circle.index,
                reversed,
            };
            found.push((component, vec![step]));
        }
    }
    // A curve with the same cycle on both sides divides nothing.
    let of_graph = loop {
        let found = half_edge_cycles(curves, &open, direction);
        let bridges: BTreeSet<CurveIndex> = found.iter().flat_map(|cycle| twice(cycle)).collect();
        if bridges.is_empty() {
            break found;
        }
        open.retain(|curve| !bridges.contains(&curve.index));
    };
    let component_of = components(&open);
    let of_graph = of_graph.into_iter();
    found.extend(of_graph.map(|steps| (closed.len() + component_of[&steps[0].curve], steps)));
    found
}

impl Cycle {
    fn new(curves: &Curves, steps: Vec<Step>, component: usize, frame: &PlaneFrame) -> Self {
        let polygon = polygon_of(curves, &steps, frame);
        Self {
            area: signed_area(&polygon),
            steps,
            polygon,
            component,
        }
    }
}

/// The points of a loop in the plane, each once.
pub(super) fn polygon_of(curves: &Curves, steps: &[Step], frame: &PlaneFrame) -> Polygon {
    let mut points = closed_points(curves, steps);
    points.pop();
    points
        .iter()
        .map(|point| frame.coordinates(point))
        .collect()
}

/// The points along a loop; the last one is the first.
pub(super) fn closed_points(curves: &Curves, steps: &[Step]) -> Vec<Vector3<f64>> {
    let mut points: Vec<Vector3<f64>> = Vec::new();
    for step in steps {
        points.pop();
        points.extend(curves.points_along(step));
    }
    if let [first, .., last] = &mut points[..] {
        *last = *first;
    }
    points
}

/// The curves that a cycle runs along both ways.
fn twice(steps: &[Step]) -> Vec<CurveIndex> {
    let mut curves: Vec<CurveIndex> = steps.iter().map(|step| step.curve).collect();
    curves.sort_unstable();
    let repeated = curves.windows(2).filter(|pair| pair[0] == pair[1]);
    repeated.map(|pair| pair[0]).collect()
}

/// The cycles that keep to the left: at every junction the next curve clockwise from the one
/// that led there. Bounded cells run counterclockwise, the outside of a component clockwise.
fn half_edge_cycles(
    curves: &Curves,
    open: &[&Curve],
    direction: &dyn Fn(&Vector3<f64>, &Vector3<f64>) -> f64,
) -> Vec<Vec<Step>> {
    // Steps that leave each junction, counterclockwise.
    let mut leaving: BTreeMap<usize, Vec<(f64, Step)>> = BTreeMap::new();
    for curve in open {
        let ends = curve.ends.iter();
        for (reversed, from) in ends.flat_map(|[start, end]| [(false, *start), (true, *end)]) {
            let step = Step {
                curve: curve.index,
                reversed,
            };
            let points = curve.points_along(&step);
            let angle = direction(&points[0], &points[1]);
            leaving.entry(from).or_default().push((angle, step));
        }
    }
    for steps in leaving.values_mut() {
        steps.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
    let next = |step: &Step| {
        let ends = curves.find(step.curve)?.ends?;
        let around = leaving.get(&ends[usize::from(!step.reversed)])?;
        let back = around.iter().position(|(_, s)| *s == step.turned())?;
        Some(around[(back + around.len() - 1) % around.len()].1)
    };
    let mut cycles = Vec::new();
    let mut visited: BTreeSet<Step> = BTreeSet::new();
    for start in leaving.values().flatten().map(|(_, step)| *step) {
        let mut cycle = Vec::new();
        let mut step = start;
        while visited.insert(step) {
            cycle.push(step);
            let Some(following) = next(&step) else { break };
            step = following;
        }
        if !cycle.is_empty() {
            cycles.push(cycle);
        }
    }
    cycles
}

/// A number for every curve, the same for those that junctions join.
fn components(open: &[&Curve]) -> BTreeMap<CurveIndex, usize> {
    let ends: Vec<Vec<usize>> = open
        .iter()
        .filter_map(|c| c.ends.map(|e| e.to_vec()))
        .collect();
    let mut component_of_junction = BTreeMap::new();
    for (number, group) in groups(&ends).iter().enumerate() {
        component_of_junction.extend(group.iter().map(|junction| (*junction, number)));
    }
    let of_curve = |curve: &&Curve| Some((curve.index, component_of_junction[&curve.ends?[0]]));
    open.iter().filter_map(of_curve).collect()
}

/// Every bounded cycle with the outsides of the components that lie in it and in no smaller one.
fn nested(cycles: &[Cycle]) -> Vec<Cell> {
    let mut bounded: Vec<&Cycle> = cycles.iter().filter(|cycle| cycle.area > 0.0).collect();
    bounded.sort_by(|a, b| a.area.total_cmp(&b.area));
    let mut cells: Vec<Cell> = bounded
        .iter()
        .map(|cycle| vec![cycle.steps.clone()])
        .collect();
    for inner in cycles.iter().filter(|cycle| cycle.area < 0.0) {
        let holds = |outer: &&Cycle| {
            outer.component != inner.component
                && outer.area > -inner.area
                && (inner.polygon.iter()).all(|point| contains(&outer.polygon, point))
        };
        if let Some(outer) = bounded.iter().position(holds) {
            cells[outer].push(inner.steps.clone());
        }
    }
    cells
}
