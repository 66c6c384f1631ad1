//! Chords of arcs are no edges: what they stand for goes on beyond their ends, and goes on
//! bending.
//!
//! A short chord lies within the noise of its arc, and so few edgels say little of a bow. The
//! arc through them explains the edgels beyond its ends, too, which it does not at a corner.
//! Sides of a polygon have neighbours like that, but are straight: the arc must explain the
//! edgels beside the line itself better, too.

use super::edge_samples::{Images, Sample, across, project_segment};
use super::line_evidence::LineEvidence;
use super::line_fitting::{change_by_edgels, directions_across};
use super::projected_line::ProjectedLine;
use super::straightness::Bow;
use crate::projection::project_in_front;
use nalgebra::{Matrix3x2, SVector, Vector2, Vector3};
use neat_core::{CircularArc, LineSegment3};
use rayon::prelude::*;

/// From where to where an arc is followed, where its chord reaches from -1 to 1: on both sides,
/// or on one, as an arc may end where its chord does.
const RANGES: [[f64; 2]; 3] = [[-1.6, 1.6], [-1.0, 2.0], [-2.0, 1.0]];
/// Heights over the chord from which the fit starts, by that of the bow which edgels beside the
/// chord show: those that lie farther off are not among them.
const HEIGHTS: [f64; 2] = [1.0, 2.0];
/// Reaches of the rounds of the fit: the first guess is good for little.
const ROUNDS: [f64; 3] = [2.5, 1.5, 1.0];
/// Distance between samples in pixels, and how many there are: as for lines, but short chords
/// need some.
const SPACING: f64 = 3.0;
const COUNTS: [usize; 2] = [8, 80];
/// An arc is followed to this share of its radius beside its middle: from one on it turns back.
const MAX_TURN: f64 = 0.9;
/// Half the length of a tangent, by half the length of the chord.
const TANGENT: f64 = 0.05;
/// Fewer edgels determine no arc.
const MIN_EDGELS: usize = 20;
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-6;
/// An arc must explain the edgels beside the line so much better, in nats: twice what a tube
/// must, as these lie in few views and side by side …
const INNER_ADVANTAGE: f64 = 24.0;
/// … and those beyond its ends so much, where the line has nothing to say: with 48 photographs
/// with truth lose edges that others go on beside.
const OUTER_ADVANTAGE: f64 = 120.0;
/// Of an arc that goes on at least this share is seen: beside the sides of a polygon with 35 it
/// is a quarter, beside chords half of it and more.
const SEEN: f64 = 0.4;

/// A part of a circle along a line. Places along it are -1 at the line's start and 1 at its end.
#[derive(Clone, Copy, Debug)]
struct Arc {
    line: LineSegment3,
    across: Matrix3x2<f64>,
    /// From the line's middle …
    shift: Vector2<f64>,
    /// … and so much more at its end.
    tilt: Vector2<f64>,
    /// Toward the centre, half the line's length by the radius.
    bend: Vector2<f64>,
}

impl Arc {
    fn straight(line: &LineSegment3, across: Matrix3x2<f64>) -> Self {
        Self {
            line: *line,
            across,
            shift: Vector2::zeros(),
            tilt: Vector2::zeros(),
            bend: Vector2::zeros(),
        }
    }

    /// The arc that rises so high over its line, and meets its ends.
    fn bent(&self, height: Vector2<f64>) -> Self {
        Self {
            shift: height,
            bend: -4.0 * height / self.line.length(),
            ..*self
        }
    }

    /// How far the circle has risen, for each bend, by half the line's length.
    fn rise(&self, place: f64) -> f64 {
        let turned = self.bend.norm_squared() * place * place;
        place * place / (1.0 + (1.0 - turned).max(0.0).sqrt())
    }

    fn at(&self, place: f64) -> Vector3<f64> {
        let rise = self.rise(place) * 0.5 * self.line.length();
        let offset = self.shift + self.tilt * place + self.bend * rise;
        self.line.point_at(0.5 * (place + 1.0)) + self.across * offset
    }

    fn circular(&self) -> Option<CircularArc> {
        CircularArc::through([-1.0, 0.0, 1.0].map(|place| self.at(place)))
    }

    fn tangent(&self, place: f64) -> LineSegment3 {
        LineSegment3::new(self.at(place - TANGENT), self.at(place + TANGENT))
    }
}

/// What edgels say against an arc, in nats, and which of its samples have one.
#[derive(Clone, Copy, Debug, Default)]
struct Cost {
    nats: f64,
    samples: usize,
    seen: usize,
}

/// What an arc explains better than the line, in nats: beside the line, and beyond its ends.
#[derive(Clone, Copy, Debug, Default)]
struct Gain {
    inner: f64,
    outer: f64,
}

impl Images<'_> {
    /// The arc of which a line is a chord, as far as the chord reaches, where it goes on beyond
    /// the chord's ends. `bow` is what edgels beside the line show, `noise` the standard
    /// deviation of an edgel, in pixels.
    pub(super) fn arc_of_chord(
        &self,
        line: &LineSegment3,
        evidence: &LineEvidence,
        bow: Option<&Bow>,
        noise: f64,
    ) -> Option<CircularArc> {
        let bow = bow?;
        // Most lines end here.
        if bow.height.norm() < bow.error {
            return None;
        }
        let straight = Arc::straight(line, directions_across(line)?);
        let pixel = self.pixel_size(line, evidence.views());
        let starts: Vec<(Arc, [f64; 2])> = (HEIGHTS.iter())
            .flat_map(|factor| {
                let start = straight.bent(factor * pixel * bow.height);
                RANGES.map(|range| (start, range))
            })
            .collect();
        let found = starts.par_iter().find_map_first(|(start, range)| {
            self.fit_arc(start, evidence, *range, pixel)
                .filter(|arc| self.goes_on(arc, &straight, evidence, *range, noise))
                .filter(|arc| {
                    // A line that lies a little off is left by edgels, too, but not for an arc.
                    let refitted = self.fit_arc(&straight, evidence, *range, pixel);
                    refitted.is_none_or(|line| self.bends(arc, &line, evidence, *range, noise))
                })
        });
        found?.circular()
    }

    /// The arc over a line whose `bow` is that of a curve.
    pub(super) fn arc_of_bow(
        &self,
        line: &LineSegment3,
        evidence: &LineEvidence,
        bow: &Bow,
    ) -> Option<CircularArc> {
        let pixel = self.pixel_size(line, evidence.views());
        let straight = Arc::straight(line, directions_across(line)?);
        straight.bent(pixel * bow.height).circular()
    }

    /// Whether an arc explains edgels better than the line, beside it and beyond it.
    fn goes_on(
        &self,
        arc: &Arc,
        straight: &Arc,
        evidence: &LineEvidence,
        [low, high]: [f64; 2],
        noise: f64,
    ) -> bool {
        let mut halves = [Gain::default(); 2];
        let (mut samples, mut seen) = (0, 0);
        for (index, view) in evidence.views().enumerate() {
            let gain = &mut halves[index % 2];
            let costs = |range| [straight, arc].map(|arc| self.cost(arc, view, range, noise));
            let [of_line, of_arc] = costs([-1.0, 1.0]);
            gain.inner += of_line.nats - of_arc.nats;
            for range in [[low, -1.0], [1.0, high]] {
                if range[0] < range[1] {
                    let [of_line, of_arc] = costs(range);
                    gain.outer += of_line.nats - of_arc.nats;
                    samples += of_arc.samples;
                    seen += of_arc.seen;
                }
            }
        }
        let [one, other] = halves;
        one.inner + other.inner > INNER_ADVANTAGE
            && one.outer + other.outer > OUTER_ADVANTAGE
            && one.outer.min(other.outer) > 0.0
            && seen as f64 > SEEN * samples as f64
    }

    /// Whether an arc explains edgels better than the line that explains them best.
    fn bends(
        &self,
        arc: &Arc,
        line: &Arc,
        evidence: &LineEvidence,
        range: [f64; 2],
        noise: f64,
    ) -> bool {
        let nats = |arc: &Arc| -> f64 {
            (evidence.views())
                .map(|view| self.cost(arc, view, range, noise).nats)
                .sum()
        };
        nats(line) - nats(arc) > INNER_ADVANTAGE
    }

    /// The arc through the edgels beside another one, in the views that show the line.
    fn fit_arc(
        &self,
        start: &Arc,
        evidence: &LineEvidence,
        range: [f64; 2],
        pixel: f64,
    ) -> Option<Arc> {
        let mut arc = *start;
        for reaches in ROUNDS {
            let reach = reaches * self.reach;
            let rows: Vec<(SVector<f64, 6>, f64)> = (evidence.views())
                .flat_map(|view| self.rows_of_arc(&arc, view, range, reach))
                .collect();
            let change = change_by_edgels(&rows, MIN_EDGELS, reach, RIDGE, pixel)?.solution;
            arc.shift += change.fixed_rows::<2>(0);
            arc.tilt += change.fixed_rows::<2>(2);
            arc.bend += change.fixed_rows::<2>(4) * (2.0 / arc.line.length());
            if arc.bend.norm() * range[1].max(-range[0]) > MAX_TURN {
                return None;
            }
        }
        Some(arc)
    }

    fn samples_of_arc(&self, arc: &Arc, view: usize, [low, high]: [f64; 2]) -> Vec<Sample> {
        let camera = &self.views[view].camera;
        let [start, end] = [low, high].map(|place| arc.line.point_at(0.5 * (place + 1.0)));
        let along = LineSegment3::new(start, end);
        let projected = project_segment(&self.views[view], &along);
        let Some((length, _)) = projected.as_ref().and_then(across) else {
            return Vec::new();
        };
        let count = ((length / SPACING) as usize).clamp(COUNTS[0], COUNTS[1]);
        (0..count)
            .filter_map(|k| {
                let place = low + (high - low) * (k as f64 + 0.5) / count as f64;
                let pixel = project_in_front(camera, &arc.at(place))?;
                let tangent = project_segment(&self.views[view], &arc.tangent(place))?;
                let direction = (tangent.end - tangent.start).try_normalize(1e-9)?;
                self.is_inside(view, &pixel).then_some(Sample {
                    place,
                    pixel,
                    normal: Vector2::new(-direction.y, direction.x),
                })
            })
            .collect()
    }

    /// How the distances of edgels from an arc in a view change with its parameters, and what
    /// takes them away.
    fn rows_of_arc(
        &self,
        arc: &Arc,
        view: usize,
        range: [f64; 2],
        reach: f64,
    ) -> Vec<(SVector<f64, 6>, f64)> {
        let camera = &self.views[view].camera;
        let row = |sample: &Sample| {
            let edgel = self.edgel(view, sample, reach)?;
            let position = self.maps[view].get(edgel).position.cast();
            let tangent = ProjectedLine::new(camera, &arc.tangent(sample.place))?;
            let found = tangent.distance_with_gradient(camera, &position);
            let [start, end] = found.by_points;
            let [u, v] = arc.across.tr_mul(&(start + end)).into();
            let (place, rise) = (sample.place, arc.rise(sample.place));
            // What is straight stays so.
            let rise = if arc.bend == Vector2::zeros() {
                0.0
            } else {
                rise
            };
            let row = [u, v, u * place, v * place, u * rise, v * rise];
            Some((SVector::from(row), -found.distance))
        };
        let samples = self.samples_of_arc(arc, view, range);
        samples.iter().filter_map(row).collect()
    }

    /// Half the squared distances of the nearest edgels in standard deviations; one without any
    /// counts as one at the reach.
    fn cost(&self, arc: &Arc, view: usize, range: [f64; 2], noise: f64) -> Cost {
        let mut cost = Cost::default();
        for sample in self.samples_of_arc(arc, view, range) {
            let edgel = self.edgel(view, &sample, self.reach);
            let distance = edgel.map_or(self.reach, |edgel| {
                let position: Vector2<f64> = self.maps[view].get(edgel).position.cast();
                sample
                    .normal
                    .dot(&(position - sample.pixel))
                    .abs()
                    .min(self.reach)
            });
            cost.nats += 0.5 * (distance / noise).powi(2);
            cost.samples += 1;
            cost.seen += usize::from(edgel.is_some());
        }
        cost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, cube_edge};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use std::f64::consts::PI;

    const NOISE: f64 = 0.15;

    /// A regular polygon around the z axis: its points, and views of it.
    fn polygon(sides: usize, radius: f64) -> (Vec<Vector3<f64>>, TestViews) {
        let points: Vec<Vector3<f64>> = (0..sides)
            .map(|k| {
                let (sine, cosine) = (2.0 * PI * k as f64 / sides as f64).sin_cos();
                Vector3::new(radius * cosine, radius * sine, 0.1)
            })
            .collect();
        let edges: Vec<[usize; 2]> = (0..sides).map(|k| [k, (k + 1) % sides]).collect();
        let views: Vec<PreparedView> = views_of_edges(&cameras_on_sphere(20), &points, &edges)
            .iter()
            .map(|observation| PreparedView::new(observation, 1.0, 0.0))
            .collect();
        (points, TestViews::of(views))
    }

    fn is_chord(views: &TestViews, line: &LineSegment3) -> bool {
        let images = views.images();
        let evidence = images.evidence(line, None, 0.0);
        assert!(evidence.showing.len() > 10, "{}", evidence.showing.len());
        let bow = images.bend(line, &evidence).bow;
        images
            .arc_of_chord(line, &evidence, bow.as_ref(), NOISE)
            .is_some()
    }

    #[test]
    fn a_piece_of_a_circle_is_a_chord_and_edges_are_none() {
        let (points, views) = polygon(120, 0.3);
        let chord = LineSegment3::new(points[0], points[6]);
        // As it is fitted: the arc lies on both sides of it.
        let outward: Vector3<f64> = 0.5 * (points[3] - chord.point_at(0.5));
        assert!(is_chord(&views, &chord.map(|end| end + outward)));
        let cube = TestViews::of_cube(20);
        for edge in 0..12 {
            assert!(!is_chord(&cube, &cube_edge(edge)));
        }
    }

    #[test]
    fn sides_of_a_polygon_are_no_chords() {
        let (points, views) = polygon(24, 0.4);
        assert!(!is_chord(&views, &LineSegment3::new(points[0], points[1])));
    }

    #[test]
    fn an_arc_must_beat_the_line_that_is_fitted_to_its_edgels() {
        let (points, circle) = polygon(120, 0.3);
        let chord = LineSegment3::new(points[0], points[6]);
        let chord = chord.map(|end| end + 0.5 * (points[3] - chord.point_at(0.5)));
        let cube = TestViews::of_cube(20);
        // Turned by what edgels may lie beside a line.
        let edge = cube_edge(3);
        let turned = LineSegment3::new(edge.start, edge.end + Vector3::new(0.0, 0.002, 0.002));
        for (views, line, is_arc) in [(circle, chord, true), (cube, turned, false)] {
            let images = views.images();
            let evidence = images.evidence(&line, None, 0.0);
            let pixel = images.pixel_size(&line, evidence.views());
            let straight = Arc::straight(&line, directions_across(&line).unwrap());
            let fitted = |start: &Arc| images.fit_arc(start, &evidence, RANGES[0], pixel).unwrap();
            let height = images.bend(&line, &evidence).bow.unwrap().height;
            let arc = fitted(&straight.bent(pixel * height));
            assert!(
                images
                    .fit_arc(&straight, &evidence, RANGES[0], pixel)
                    .unwrap()
                    .bend
                    .norm()
                    == 0.0
            );
            let bends = images.bends(&arc, &fitted(&straight), &evidence, RANGES[0], NOISE);
            assert_eq!(bends, is_arc);
        }
    }

    #[test]
    fn arcs_run_along_circles() {
        let line = LineSegment3::new(-Vector3::x(), Vector3::x());
        let across = directions_across(&line).unwrap();
        let arc = Arc {
            bend: Vector2::new(0.0, 0.25),
            ..Arc::straight(&line, across)
        };
        let centre = across * Vector2::new(0.0, 4.0);
        for place in [-2.0, -0.5, 0.0, 1.0, 3.0] {
            assert!(((arc.at(place) - centre).norm() - 4.0).abs() < 1e-12);
        }
    }
}
