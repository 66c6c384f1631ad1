//! Splines fitted to the edgels of all views, and what images say for them.

use super::circle_fitting::{SECTOR_IN_PIXELS, equal_parts, sectors_along};
use super::curve_samples::{SPACING, distance_of_curve};
use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::loss_of_reach;
use nalgebra::{DMatrix, DVector, Vector3};
use neat_core::Spline;
use rayon::prelude::*;

/// What a number costs in nats: half the logarithm of the hundreds of places that tell of it.
pub(super) const COST: f64 = 3.0;
/// An arc has six numbers and two ends, a control point three.
pub(super) const NUMBERS_OF_ARC: f64 = 8.0;
pub(super) const NUMBERS_OF_CONTROL: f64 = 3.0;
/// What keeps control points along the curve, where edgels say nothing: as a share of what they
/// say across it.
const RIDGE: f64 = 1e-4;
/// As much more keeps ends at junctions.
const AT_JUNCTION: f64 = 1e8;
/// Fewer edgels for each control point do not place it.
const MIN_EDGELS: usize = 8;

/// Points along a curve, with the place of each: from 0 to 1 by affine arc length, the integral of
/// the third root of the curvature, by which cubic pieces of an ellipse are all alike.
pub(super) struct Points {
    pub points: Vec<Vector3<f64>>,
    pub places: Vec<f64>,
}

/// What the sectors of a curve say, by length: they are as long as whole ones can be.
pub(super) fn gain_by_length(gain: f64, length: f64, pixel: f64) -> f64 {
    gain * length / (SECTOR_IN_PIXELS * pixel * sectors_along(length, pixel))
}

/// From where to where the parts of a spline run that are as long as sectors of arcs.
pub(super) fn parts_of(spline: &Spline, pixel: f64) -> Vec<[f64; 2]> {
    equal_parts([0.0, spline.pieces() as f64], spline.length(), pixel)
}

impl Images<'_> {
    /// What the images say about a spline, by edgels that are not `taken`.
    pub(super) fn gain_of_spline(
        &self,
        spline: &Spline,
        pixel: f64,
        taken: Option<&[Vec<bool>]>,
    ) -> f64 {
        let parts = self.evidence_along(spline, pixel, taken);
        let gain = parts.iter().map(|(_, evidence)| evidence.gain).sum();
        gain_by_length(gain, spline.length(), pixel)
    }

    /// What the images say about each part of a spline, about as long as a sector of an arc.
    pub(super) fn evidence_along(
        &self,
        spline: &Spline,
        pixel: f64,
        taken: Option<&[Vec<bool>]>,
    ) -> Vec<([f64; 2], LineEvidence)> {
        let evidence = |places: [f64; 2]| {
            let middle = spline.point_at(0.5 * (places[0] + places[1]));
            let at = |place: f64| Some(spline.point_at(place));
            let in_view = |view| self.samples_of_curve(view, places, SPACING, at);
            let least = f64::NEG_INFINITY;
            (
                places,
                self.evidence_of_samples(&middle, in_view, taken, least, 1),
            )
        };
        parts_of(spline, pixel)
            .into_par_iter()
            .map(evidence)
            .collect()
    }

    /// A spline moved to the edgels of the views that show it.
    pub(super) fn fitted(
        &self,
        mut spline: Spline,
        ends: [Option<Vector3<f64>>; 2],
        pixel: f64,
        reaches: &[f64],
    ) -> Option<Spline> {
        for reaches in reaches {
            let reach = reaches * self.reach;
            let rows: Vec<Row> = (self.evidence_along(&spline, pixel, None).into_par_iter())
                .flat_map_iter(|(places, evidence)| {
                    let views: Vec<usize> = evidence.views().collect();
                    let of_view = |view| self.rows_of_spline(&spline, places, view, reach);
                    views.into_iter().flat_map(of_view).collect::<Vec<Row>>()
                })
                .collect();
            if rows.len() < MIN_EDGELS * spline.controls.len() {
                return None;
            }
            let loss = loss_of_reach(reach);
            let mut equations = Equations::new(&spline, ends);
            for row in &rows {
                let weight = loss.weight(row.distance * row.distance);
                equations.add(row, weight);
            }
            spline = equations.solved(&spline)?;
        }
        let last = spline.controls.len() - 1;
        for (control, end) in [0, last].into_iter().zip(ends) {
            spline.controls[control] = end.unwrap_or(spline.controls[control]);
        }
        Some(spline)
    }

    /// What the edgels beside a part of a spline in a view say.
    fn rows_of_spline(
        &self,
        spline: &Spline,
        places: [f64; 2],
        view: usize,
        reach: f64,
    ) -> Vec<Row> {
        let at = |place: f64| Some(spline.point_at(place));
        let samples = self.samples_of_curve(view, places, SPACING, at);
        let half = 0.5 * (places[1] - places[0]);
        let row = |place: f64, edgel: usize| {
            let position = self.maps[view].get(edgel).position.cast();
            let last = spline.pieces() as f64;
            let [before, after] = [place - half, place + half].map(|end| end.clamp(0.0, last));
            let tangent = spline.point_at(after) - spline.point_at(before);
            let camera = &self.views[view].camera;
            let point = spline.point_at(place);
            let (distance, by_point) = distance_of_curve(camera, &point, &tangent, &position)?;
            Some(Row {
                weights: spline.weights_at(place),
                by_point,
                distance,
            })
        };
        let rows = samples
            .iter()
            .flatten()
            .filter_map(|sample| row(sample.place, self.edgel(view, sample, reach)?));
        rows.collect()
    }
}

/// How the distance of an edgel from a spline changes with the point beside it, and so with four
/// control points.
struct Row {
    weights: [(usize, f64); 4],
    by_point: Vector3<f64>,
    distance: f64,
}

/// Normal equations for changes of the control points.
struct Equations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    fixed: Vec<usize>,
}

impl Equations {
    /// Control points at the `ends` stay.
    fn new(spline: &Spline, ends: [Option<Vector3<f64>>; 2]) -> Self {
        let count = spline.controls.len();
        let of_end = [0, count - 1].into_iter().zip(ends);
        Self {
            matrix: DMatrix::zeros(3 * count, 3 * count),
            right: DVector::zeros(3 * count),
            fixed: of_end
                .filter_map(|(control, end)| end.map(|_| control))
                .collect(),
        }
    }

    fn add(&mut self, row: &Row, weight: f64) {
        let by = |k: usize| row.by_point[k % 3] * row.weights[k / 3].1;
        let place = |k: usize| 3 * row.weights[k / 3].0 + k % 3;
        for a in 0..12 {
            self.right[place(a)] -= weight * by(a) * row.distance;
            for b in 0..12 {
                self.matrix[(place(a), place(b))] += weight * by(a) * by(b);
            }
        }
    }

    fn solved(mut self, spline: &Spline) -> Option<Spline> {
        let count = spline.controls.len();
        let ridge = RIDGE * self.matrix.trace() / (3 * count) as f64;
        for control in 0..count {
            let held = if self.fixed.contains(&control) {
                AT_JUNCTION
            } else {
                1.0
            };
            for k in 3 * control..3 * control + 3 {
                self.matrix[(k, k)] += held * ridge;
            }
        }
        let change = self.matrix.cholesky()?.solve(&self.right);
        let mut moved = spline.clone();
        for (control, point) in moved.controls.iter_mut().enumerate() {
            *point += change.fixed_rows::<3>(3 * control);
        }
        moved.is_valid().then_some(moved)
    }
}

/// The spline with so many control points nearest to points at their places.
pub(super) fn through_points(
    points: &Points,
    controls: usize,
    closed: bool,
    ends: [Option<Vector3<f64>>; 2],
) -> Option<Spline> {
    let mut spline = Spline {
        controls: vec![Vector3::zeros(); controls],
        closed,
    };
    let pieces = spline.pieces() as f64;
    let mut matrix = DMatrix::zeros(controls, controls);
    let mut right = DMatrix::zeros(controls, 3);
    let mut add = |weights: [(usize, f64); 4], point: &Vector3<f64>, held: f64| {
        for (a, by_a) in weights {
            for (b, by_b) in weights {
                matrix[(a, b)] += held * by_a * by_b;
            }
            for k in 0..3 {
                right[(a, k)] += held * by_a * point[k];
            }
        }
    };
    for (point, place) in points.points.iter().zip(&points.places) {
        add(spline.weights_at(place * pieces), point, 1.0);
    }
    for (end, place) in ends.iter().zip([0.0, pieces]) {
        if let Some(end) = end {
            add(spline.weights_at(place), end, AT_JUNCTION);
        }
    }
    let ridge = 1e-9 * points.points.len() as f64;
    for k in 0..controls {
        matrix[(k, k)] += ridge;
    }
    let solved = matrix.cholesky()?.solve(&right);
    for (control, point) in spline.controls.iter_mut().enumerate() {
        *point = Vector3::from_fn(|k, _| solved[(control, k)]);
    }
    spline.is_valid().then_some(spline)
}
