//! The cells into which curves divide cylinders and cones: bands around the axis and parts of
//! them, with holes.
//!
//! A surface is one that two arcs around one axis agree on, or the cylinder that an arc goes
//! around. All curves that lie on it divide it as they do a plane, only that a loop may run around
//! the axis: then two bound a cell, the one below it and the next one above.

use super::candidates::common_surface;
use super::cells::{Cell, boundaries, closed_points};
use super::curves::{Curve, Curves};
use super::face::{CurveIndex, Face, Step};
use super::polygon::crosses_itself;
use super::surface::Surface;
use super::unrolled::{self, Chain, Unrolled};
use nalgebra::{Vector2, Vector3};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// What lies farther from a round surface than this share of its radius lies beside it, judged: a
/// chord over 36° of it does.
const BESIDE: f64 = 0.05;
/// Sine of the angle between a straight curve on a round surface and the rulings: 10°.
const ASKEW: f64 = 0.174;

/// All cells of round surfaces, with normals away from the axis.
pub(super) fn round_cells(curves: &Curves) -> Vec<Face> {
    let mut known = BTreeSet::new();
    let mut faces = Vec::new();
    for surface in surfaces(curves) {
        let Some(unrolled) = Unrolled::new(&surface) else {
            continue;
        };
        let on_surface = |curve: &&Curve| lies_on(curves, curve, &unrolled);
        let members: Vec<&Curve> = curves.all.iter().filter(on_surface).collect();
        let indices: Vec<CurveIndex> = members.iter().map(|curve| curve.index).collect();
        if known.insert(indices) {
            let cells = cells(curves, members, &unrolled).into_iter();
            faces.extend(cells.map(|loops| Face { surface, loops }));
        }
    }
    faces
}

/// Those of two arcs first, which know more of it.
fn surfaces(curves: &Curves) -> Vec<Surface> {
    let arcs: Vec<&Curve> = (curves.all.iter())
        .filter(|curve| curve.arc.is_some())
        .collect();
    let pairs = (0..arcs.len()).flat_map(|i| (0..i).map(move |j| [j, i]));
    let of_two = pairs.filter_map(|pair| common_surface(curves, pair.map(|k| arcs[k])));
    let of_one = arcs.iter().filter_map(|curve| {
        let arc = curve.arc?;
        Some(Surface::Cylinder {
            point: arc.center,
            axis: arc.normal(),
            radius: arc.radius,
            convex: true,
        })
    });
    of_two.chain(of_one).collect()
}

/// Whether all of a curve is on a surface.
fn lies_on(curves: &Curves, curve: &Curve, surface: &Unrolled) -> bool {
    let is_near = |point: &Vector3<f64>| {
        let radius = surface.radius_at(surface.place(point).y);
        let most = curves.arc_sigma().min(BESIDE * radius);
        surface.distance(point) <= most
    };
    let is_along = || {
        let ends = [0, 1].map(|k| surface.direction(&curve.points[k], &curve.points[1 - k]));
        ends.iter().all(|angle| angle.cos().abs() <= ASKEW)
    };
    (curve.measured.iter()).all(|(point, _)| is_near(point)) && (!curve.is_straight() || is_along())
}

/// A loop of curves as it lies on the surface.
struct Loop {
    steps: Vec<Step>,
    component: usize,
    chain: Chain,
    /// How often it runs around the axis, to the right.
    turns: i32,
    /// Minus the integral of the height over the angle: the area of what it encloses, by the
    /// radius; of one around the axis, minus its mean height.
    below: f64,
}

fn cells(curves: &Curves, members: Vec<&Curve>, surface: &Unrolled) -> Vec<Cell> {
    let direction = |from: &Vector3<f64>, to: &Vector3<f64>| surface.direction(from, to);
    let found = boundaries(curves, members, &direction).into_iter();
    let loops = found.map(|(component, steps)| {
        let chain = surface.chain(&closed_points(curves, &steps));
        let below = |ends: &[Vector2<f64>]| 0.5 * (ends[0].y + ends[1].y) * (ends[0].x - ends[1].x);
        Loop {
            steps,
            component,
            turns: unrolled::turns(&chain),
            below: chain.windows(2).map(below).sum(),
            chain,
        }
    });
    let (around, beside): (Vec<Loop>, Vec<Loop>) = loops
        .filter(|one| one.chain.len() > 3)
        .filter(|one| one.turns != 0 || !crosses_itself(&one.chain[1..]))
        .partition(|one| one.turns != 0);
    let (patches, outsides): (Vec<Loop>, Vec<Loop>) =
        beside.into_iter().partition(|one| one.below > 0.0);
    let mut cells: Vec<(f64, Vec<&Loop>)> = (patches.iter())
        .map(|patch| (patch.below, vec![patch]))
        .collect();
    cells.extend(bands(&around));
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Holes are in the smallest cell around them.
    for hole in &outsides {
        let holds = |(area, cell): &&mut (f64, Vec<&Loop>)| {
            let outer: Vec<Chain> = (cell.iter())
                .filter(|one| one.turns != 0 || one.below > 0.0)
                .map(|one| one.chain.clone())
                .collect();
            *area > -hole.below
                && cell.iter().all(|one| one.component != hole.component)
                && (hole.chain.iter()).all(|place| unrolled::contains(&outer, place))
        };
        if let Some((_, cell)) = cells.iter_mut().find(holds) {
            cell.push(hole);
        }
    }
    let steps = |cell: Vec<&Loop>| cell.iter().map(|one| one.steps.clone()).collect();
    cells.into_iter().map(|(_, cell)| steps(cell)).collect()
}

/// The area between each loop that runs around the axis below it and the next one above, with both.
fn bands(around: &[Loop]) -> Vec<(f64, Vec<&Loop>)> {
    let height = |one: &Loop| -one.below / (TAU * f64::from(one.turns));
    let below = around.iter().filter(|one| one.turns == 1);
    let band = |low: &'_ Loop| {
        let above = around.iter().filter(|one| {
            one.turns == -1 && one.component != low.component && height(one) > height(low)
        });
        let high = above.min_by(|a, b| height(a).total_cmp(&height(b)))?;
        Some((low.below + high.below, high))
    };
    below
        .filter_map(|low| {
            let (area, high) = band(low)?;
            Some((area, vec![low, high]))
        })
        .collect()
}
