//! Candidate partners of a 2D segment in another view, by the epipolar geometry.
//!
//! Everything that both cameras see lies in one half-plane of the pencil around
//! their baseline; its angle orders the segments of both images alike. A segment
//! covers an arc of angles, and two images of one 3D segment cover overlapping
//! arcs. Each partner's plane cuts the rays through the segment's ends: that is a
//! 3D hypothesis (Hofer et al., *Efficient 3D scene abstraction using line
//! segments*, 2017, Sec. 3.2).

use super::view_segments::PreparedView;
use nalgebra::Vector3;
use neat_core::Ray;
use std::f64::consts::{PI, TAU};

/// The common arc must be at least this share of the longer of the two arcs.
const MIN_OVERLAP: f64 = 0.25;
/// A pixel of noise may move a hypothesis by at most this share of its depth:
/// what lies nearly along its epipolar line is left out.
const MAX_RELATIVE_DEPTH_NOISE: f64 = 0.03;
/// Hypotheses nearer than this to the viewing direction are left out.
const MIN_VIEW_ANGLE_IN_DEGREES: f64 = 5.0;

/// Arcs longer than this belong to segments that run past the epipole.
const MAX_ARC: f64 = 2.0;
/// Rays nearer than this to the baseline (sine of the angle) have no angle.
const MIN_SINE_TO_BASELINE: f64 = 0.01;
/// No overlap below this is asked for, so that the search stays local.
const LEAST_OVERLAP: f64 = 0.05;

/// A partner of a segment, as depths of the segment's ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LineMatch {
    /// Which of the view's neighbours.
    pub slot: usize,
    /// The partner, in that neighbour.
    pub segment: usize,
    /// Distances along the rays of the segment's ends.
    pub depths: [f64; 2],
    /// How far one pixel of the partner's noise moves them.
    pub depth_per_pixel: [f64; 2],
}

/// The range of angles around the baseline that a segment covers.
#[derive(Clone, Copy, Debug)]
struct Arc {
    low: f64,
    length: f64,
    /// Angles of the segment's start and end, `low` being one of them.
    ends: [f64; 2],
}

impl Arc {
    fn turned(self, angle: f64) -> Self {
        Self {
            low: self.low + angle,
            ends: self.ends.map(|end| end + angle),
            ..self
        }
    }
}

/// A segment whose partners are sought.
struct Seed<'a> {
    rays: &'a [Vector3<f64>; 2],
    arc: Arc,
    /// Where its ends may lie along their rays.
    depth_ranges: [[f64; 2]; 2],
}

/// The pencil of planes around a baseline.
struct Pencil {
    axes: [Vector3<f64>; 2],
}

impl Pencil {
    fn new(baseline: &Vector3<f64>) -> Option<Self> {
        let direction = baseline.try_normalize(1e-9)?;
        let side = Vector3::ith(direction.iamin(), 1.0);
        let first = direction.cross(&side).normalize();
        Some(Self {
            axes: [first, direction.cross(&first)],
        })
    }

    fn angle(&self, ray: &Vector3<f64>) -> Option<f64> {
        let [x, y] = self.axes.map(|axis| axis.dot(ray));
        (x.hypot(y) > MIN_SINE_TO_BASELINE).then(|| y.atan2(x))
    }

    fn arc(&self, rays: &[Vector3<f64>; 2]) -> Option<Arc> {
        let start = self.angle(&rays[0])?;
        let turn = wrapped(self.angle(&rays[1])? - start);
        let low = start.min(start + turn);
        (turn.abs() < MAX_ARC && turn != 0.0).then_some(Arc {
            low,
            length: turn.abs(),
            ends: [start, start + turn],
        })
    }
}

/// The same angle in [-π, π].
fn wrapped(angle: f64) -> f64 {
    if angle > PI {
        angle - TAU
    } else if angle < -PI {
        angle + TAU
    } else {
        angle
    }
}

/// Two views, with the second one's segments sorted by their arcs.
pub(super) struct ViewPair<'a> {
    view: &'a PreparedView,
    other: &'a PreparedView,
    slot: usize,
    pencil: Pencil,
    /// Arcs of the other view's segments, ascending, each also one turn lower
    /// and higher.
    arcs: Vec<(Arc, usize)>,
}

impl<'a> ViewPair<'a> {
    /// `slot` is passed on to the matches. `None` for cameras at one place.
    pub(super) fn new(
        view: &'a PreparedView,
        other: &'a PreparedView,
        slot: usize,
    ) -> Option<Self> {
        let baseline = other.camera.center_in_world - view.camera.center_in_world;
        let pencil = Pencil::new(&baseline)?;
        let mut arcs = Vec::with_capacity(3 * other.segments.len());
        for (segment, prepared) in other.segments.iter().enumerate() {
            let Some(arc) = pencil.arc(&prepared.rays) else {
                continue;
            };
            arcs.extend([-TAU, 0.0, TAU].map(|turn| (arc.turned(turn), segment)));
        }
        arcs.sort_by(|(a, i), (b, j)| a.low.total_cmp(&b.low).then(i.cmp(j)));
        Some(Self {
            view,
            other,
            slot,
            pencil,
            arcs,
        })
    }

    /// Which of the view's neighbours the second view is.
    pub(super) fn slot(&self) -> usize {
        self.slot
    }

    /// Appends the partners of a segment of the first view whose hypotheses lie
    /// within the ball of radius `ball_radius` around the origin.
    pub(super) fn append_matches(
        &self,
        segment: usize,
        ball_radius: f64,
        matches: &mut Vec<LineMatch>,
    ) {
        let Some(seed) = self.seed(segment, ball_radius) else {
            return;
        };
        let arc = &seed.arc;
        let min_overlap = MIN_OVERLAP.clamp(LEAST_OVERLAP, 1.0);
        // A longer arc could not overlap by its share.
        let lowest = arc.low - arc.length * (1.0 / min_overlap - 1.0);
        let highest = arc.low + arc.length;
        let first = self.arcs.partition_point(|(other, _)| other.low < lowest);
        for (other, partner) in self.arcs[first..]
            .iter()
            .take_while(|(other, _)| other.low <= highest)
        {
            let common =
                (arc.low + arc.length).min(other.low + other.length) - arc.low.max(other.low);
            if common < min_overlap * arc.length.max(other.length) {
                continue;
            }
            matches.extend(self.triangulate(&seed, *partner, other));
        }
    }

    /// Appends `partners`, which something else than the epipolar geometry has found.
    pub(super) fn append_partners(
        &self,
        segment: usize,
        partners: &[usize],
        ball_radius: f64,
        matches: &mut Vec<LineMatch>,
    ) {
        let Some(seed) = self.seed(segment, ball_radius) else {
            return;
        };
        for partner in partners {
            let Some(arc) = self.pencil.arc(&self.other.segments[*partner].rays) else {
                continue;
            };
            let turned = arc.turned(wrapped(arc.low - seed.arc.low) - (arc.low - seed.arc.low));
            matches.extend(self.triangulate(&seed, *partner, &turned));
        }
    }

    fn seed(&self, segment: usize, ball_radius: f64) -> Option<Seed<'_>> {
        let rays = &self.view.segments[segment].rays;
        let origin = self.view.camera.center_in_world;
        let [start, end] =
            rays.map(|direction| Ray { origin, direction }.interval_in_ball(ball_radius));
        Some(Seed {
            rays,
            arc: self.pencil.arc(rays)?,
            depth_ranges: [start?, end?],
        })
    }

    /// Cuts the rays of the segment's ends with the partner's plane.
    fn triangulate(&self, seed: &Seed<'_>, partner: usize, partner_arc: &Arc) -> Option<LineMatch> {
        let Seed {
            rays,
            arc,
            depth_ranges,
        } = seed;
        let prepared = &self.other.segments[partner];
        let normal = &prepared.plane_normal;
        let center = &self.view.camera.center_in_world;
        let other_center = &self.other.camera.center_in_world;
        let height = normal.dot(&(other_center - center));
        let forward = prepared.rays[0] + prepared.rays[1];
        let half_arc = 0.5 * partner_arc.length;
        let mut depths = [0.0; 2];
        let mut depth_per_pixel = [0.0; 2];
        for side in 0..2 {
            let sine = normal.dot(&rays[side]);
            let depth = height / sine;
            let [near, far] = depth_ranges[side];
            // Not a number where the ray lies in the plane.
            if !(depth > near && depth < far) {
                return None;
            }
            let from_other = center + depth * rays[side] - other_center;
            if from_other.dot(&forward) <= 0.0 {
                return None;
            }
            // Noise of both ends, extrapolated to where the ray crosses.
            let place = (arc.ends[side] - partner_arc.low - half_arc) / half_arc;
            let leverage = (0.5 * (1.0 + place * place)).sqrt();
            let noise = from_other.norm() / self.other.focal_in_pixels / sine.abs() * leverage;
            if noise > MAX_RELATIVE_DEPTH_NOISE * depth {
                return None;
            }
            depths[side] = depth;
            depth_per_pixel[side] = noise;
        }
        let direction = depths[1] * rays[1] - depths[0] * rays[0];
        let sine_to_view = direction.cross(&rays[0]).norm() / direction.norm();
        (sine_to_view > MIN_VIEW_ANGLE_IN_DEGREES.to_radians().sin()).then_some(LineMatch {
            slot: self.slot,
            segment: partner,
            depths,
            depth_per_pixel,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{camera_looking_at_origin, cube, views_of_edges};

    #[test]
    fn true_partners_triangulate_to_the_edge() {
        let (junctions, edges) = cube();
        let cameras = [
            camera_looking_at_origin(&Vector3::new(1.6, 1.4, 1.3)),
            camera_looking_at_origin(&Vector3::new(1.9, 0.8, 1.5)),
        ];
        let views: Vec<_> = views_of_edges(&cameras, &junctions, &edges)
            .iter()
            .map(|observation| PreparedView::new(observation, 1.0, 1.0))
            .collect();
        let pair = ViewPair::new(&views[0], &views[1], 7).unwrap();
        let mut found = 0;
        for (edge, [a, b]) in edges.iter().enumerate() {
            let mut matches = Vec::new();
            pair.append_matches(edge, 1.2, &mut matches);
            for partner in matches.iter().filter(|m| m.segment == edge) {
                found += 1;
                assert_eq!(partner.slot, 7);
                let segment = views[0].back_project(edge, partner.depths);
                assert!((segment.start - junctions[*a]).norm() < 1e-9);
                assert!((segment.end - junctions[*b]).norm() < 1e-9);
            }
        }
        assert!(found >= 8, "{found} of 12 edges");
    }

    #[test]
    fn cameras_at_one_place_are_no_pair() {
        let (junctions, edges) = cube();
        let camera = camera_looking_at_origin(&Vector3::new(1.6, 1.4, 1.3));
        let view = PreparedView::new(&views_of_edges(&[camera], &junctions, &edges)[0], 1.0, 1.0);
        assert!(ViewPair::new(&view, &view, 0).is_none());
    }
}
