//! Where a straight edge runs into an arc without a corner, it ends.
//!
//! Edgels of the arc stay within the noise for long. But noise averages out over all views,
//! station by station along the line: a parabola that leaves the line at its end is asked for.

use super::corners::sliver_end;
use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::directions_across;
use super::line_selection::ChosenLine;
use super::projected_line::ProjectedLine;
use super::straightness::{BOW_AGREEMENT, CORRELATION};
use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Stations along a line: one for two pixels, within these bounds.
const PIXELS_PER_STATION: f64 = 2.0;
const COUNTS: [usize; 2] = [20, 400];
/// An arc is at most this share of the line at each end, judged: what bends for more of it is a
/// curve, which has been sought before.
const MOST: f64 = 0.4;
/// Fewer stations tell nothing of an arc.
const MIN_STATIONS: usize = 3;
/// The parabola must explain the edgels so much better, in nats, as for outlines: it is the best
/// of many tries.
const ADVANTAGE: f64 = 12.0;

/// What edgels say about the offset from the line at one station.
#[derive(Clone, Copy, Default)]
struct Station {
    matrix: Matrix2<f64>,
    right: Vector2<f64>,
}

/// Takes the arcs at their ends away from lines. `noise` is the standard deviation of an edgel,
/// in pixels.
pub(super) fn cut_tangent_ends(images: &Images, lines: &mut [ChosenLine], noise: f64) {
    let before: Vec<LineSegment3> = lines.iter().map(|chosen| chosen.line).collect();
    lines
        .par_iter_mut()
        .enumerate()
        .for_each(|(index, chosen)| {
            let mut line = images.without_tangent_ends(&chosen.line, &chosen.evidence, noise);
            if line == chosen.line {
                return;
            }
            // Edgels of another edge that it ends with in a sliver are no arc.
            let pixel = images.pixel_size(&line, chosen.evidence.views());
            let others = (0..before.len()).filter(|other| *other != index);
            for (_, end) in
                others.filter_map(|k| sliver_end(images, &chosen.line, &before[k], pixel))
            {
                match end {
                    0 => line.start = chosen.line.start,
                    _ => line.end = chosen.line.end,
                }
            }
            if line != chosen.line {
                chosen.line = images.fit(&line, chosen.evidence.views(), images.reach);
            }
        });
}

impl Images<'_> {
    fn without_tangent_ends(
        &self,
        line: &LineSegment3,
        evidence: &LineEvidence,
        noise: f64,
    ) -> LineSegment3 {
        let mut halves = self.stations(line, evidence);
        let count = halves[0].len() as f64;
        let variance = CORRELATION * noise * noise;
        let last = straight_until(&halves, variance);
        halves.iter_mut().for_each(|stations| stations.reverse());
        let first = straight_until(&halves, variance);
        let place = |station: usize| station as f64 / count;
        LineSegment3::new(
            line.point_at(1.0 - place(first)),
            line.point_at(place(last)),
        )
    }

    /// The stations of a line, by each half of the views that show it.
    fn stations(&self, line: &LineSegment3, evidence: &LineEvidence) -> [Vec<Station>; 2] {
        let length = self.projected_length(line, evidence.views());
        let count = ((length / PIXELS_PER_STATION) as usize).clamp(COUNTS[0], COUNTS[1]);
        let mut halves = [(); 2].map(|()| vec![Station::default(); count]);
        let Some(across) = directions_across(line) else {
            return halves;
        };
        for (index, view) in evidence.views().enumerate() {
            let camera = &self.views[view].camera;
            let prepared = (ProjectedLine::new(camera, line)).zip(self.samples(
                view,
                line,
                [0.0, 1.0],
                Some(count),
            ));
            let Some((projected, samples)) = prepared else {
                continue;
            };
            for sample in &samples {
                let Some(edgel) = self.edgel(view, sample, self.reach) else {
                    continue;
                };
                let position = self.maps[view].get(edgel).position.cast();
                let found = projected.distance_with_gradient(camera, &position);
                let [start, end] = found.by_points;
                let row = across.tr_mul(&(start + end));
                let station =
                    &mut halves[index % 2][((sample.place * count as f64) as usize).min(count - 1)];
                station.matrix += row * row.transpose();
                station.right -= found.distance * row;
            }
        }
        halves
    }
}

/// A parabola that leaves a line, and what it gains.
struct Parabola {
    bend: Vector2<f64>,
    /// In nats times the variance of an edgel.
    gain: f64,
}

/// The parabola that leaves the line at station `start`. It gains what it does beside this line,
/// or beside the best one through all stations if that is less: a line that lies a little off
/// is left by its edgels, too, but not for an arc.
fn parabola(stations: &[Station], start: usize) -> Option<Parabola> {
    let mut matrix = Matrix6::zeros();
    let mut right = Vector6::zeros();
    let count = stations.len() as f64;
    for (k, station) in stations.iter().enumerate() {
        let beyond = (k + 1).saturating_sub(start) as f64 - 0.5;
        let basis = [1.0, k as f64 / count, beyond.max(0.0).powi(2) / count];
        for (row, a) in basis.iter().enumerate() {
            let mut part = right.fixed_rows_mut::<2>(2 * row);
            part += station.right * *a;
            for (column, b) in basis.iter().enumerate() {
                let mut block = matrix.fixed_view_mut::<2, 2>(2 * row, 2 * column);
                block += station.matrix * (a * b);
            }
        }
    }
    // A direction that no view tells of stays where it is.
    matrix += Matrix6::identity() * (1e-9 * matrix.trace());
    let (line, bent) = (
        matrix.fixed_view::<4, 4>(0, 0),
        matrix.fixed_view::<2, 2>(4, 4),
    );
    let (of_line, of_bend) = (right.fixed_rows::<4>(0), right.fixed_rows::<2>(4));
    let best_line = line.into_owned().cholesky()?.solve(&of_line);
    let best_bend = bent.into_owned().cholesky()?.solve(&of_bend);
    let best_of_both = matrix.cholesky()?.solve(&right);
    let beside_best_line = right.dot(&best_of_both) - of_line.dot(&best_line);
    Some(Parabola {
        bend: best_bend,
        gain: 0.5 * of_bend.dot(&best_bend).min(beside_best_line),
    })
}

/// The station after which a parabola leaves the line, or all of them.
fn straight_until(halves: &[Vec<Station>; 2], variance: f64) -> usize {
    let count = halves[0].len();
    let first = count - (MOST * count as f64) as usize;
    let whole: Vec<Station> = (halves[0].iter().zip(&halves[1]))
        .map(|(one, other)| Station {
            matrix: one.matrix + other.matrix,
            right: one.right + other.right,
        })
        .collect();
    let gain = |start: usize| {
        let found = parabola(&whole, start).filter(|found| found.gain > ADVANTAGE * variance)?;
        let one = parabola(&halves[0], start)?.bend;
        let other = parabola(&halves[1], start)?.bend;
        let agree = one.dot(&other) > BOW_AGREEMENT * one.norm() * other.norm();
        agree.then_some((found.gain, start))
    };
    let best = (first..=count.saturating_sub(MIN_STATIONS))
        .filter_map(gain)
        .max_by(|(a, i), (b, j)| a.total_cmp(b).then(j.cmp(i)));
    best.map_or(count, |(_, start)| start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, cube_edge, end_distance};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;

    #[test]
    fn a_line_ends_where_an_arc_begins() {
        const RADIUS: f64 = 0.2;
        let mut points = vec![Vector3::new(-0.4, 0.0, 0.1), Vector3::new(0.2, 0.0, 0.1)];
        let corner = points[1];
        points.extend((1..40).map(|k| {
            let (sine, cosine) = (0.02 * f64::from(k)).sin_cos();
            corner + RADIUS * Vector3::new(sine, 1.0 - cosine, 0.0)
        }));
        let edges: Vec<[usize; 2]> = (1..points.len()).map(|k| [k - 1, k]).collect();
        let cameras = cameras_on_sphere(20);
        let views: Vec<PreparedView> = views_of_edges(&cameras, &points, &edges)
            .iter()
            .map(|observation| PreparedView::new(observation, 1.0, 0.0))
            .collect();
        let views = TestViews::of(views);
        let images = views.images();
        let truth = LineSegment3::new(points[0], points[1]);
        let late = LineSegment3::new(points[0], points[1] + Vector3::new(0.03, 0.0, 0.0));
        let evidence = images.evidence(&late, None, 0.0);
        assert!(evidence.showing.len() > 10);
        let cut = images.without_tangent_ends(&late, &evidence, 0.05);
        assert!(end_distance(&cut, &truth) < 0.01, "{cut:?}");
        assert_eq!(cut.start, late.start);

        // Nor does an edge beside its line begin an arc.
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(3);
        let evidence = images.evidence(&edge, None, 0.0);
        let aside = LineSegment3::new(edge.start, edge.end + Vector3::new(0.002, 0.002, 0.002));
        assert_eq!(images.without_tangent_ends(&aside, &evidence, 0.02), aside);

        // A corner is none.
        for edge in 0..12 {
            let evidence = images.evidence(&cube_edge(edge), None, 0.0);
            let cut = images.without_tangent_ends(&cube_edge(edge), &evidence, 0.05);
            assert!(end_distance(&cut, &cube_edge(edge)) < 1e-9);
        }
    }
}
