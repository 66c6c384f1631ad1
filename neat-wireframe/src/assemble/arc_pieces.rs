//! Each arc once, and whole.
//!
//! Growth stops where an arc drifts to another rim, and the rest of its circle is found by another
//! chord: arcs that one circle explains become one. And what runs along one rim here and along
//! another one there is none: lines and surer arcs have its edgels.

use super::circle_fitting::FoundArc;
use super::claimed_edgels::claim_edgels;
use super::corners::WINDOW_IN_PIXELS;
use super::curves::BESIDE_IN_PIXELS;
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use nalgebra::Vector3;
use neat_core::CircularArc;
use std::f64::consts::TAU;

/// Points of each of two arcs that a circle through both is tried by.
const SAMPLES: usize = 7;
/// An arc of whose evidence no more than this share is its own is explained by what has the rest.
/// Of `part-004` arcs that run along one rim here and along another one there keep 0 to .16, true
/// ones, with other rims three pixels beside them, .43 and more.
pub(super) const OWN_SHARE: f64 = 0.2;

impl Images<'_> {
    /// Whether images speak for an arc by edgels that are not `taken` by others, too.
    pub(super) fn has_own(&self, found: &FoundArc, taken: &[Vec<bool>]) -> bool {
        let gain = |taken| self.gain_along(&found.arc, found.arc.angles, found.pixel, taken);
        gain(Some(taken)) > OWN_SHARE * gain(None)
    }

    /// Leaves out arcs that lines and surer arcs explain.
    pub(super) fn retain_own(&self, lines: &[ChosenLine], arcs: &mut Vec<FoundArc>) {
        let mut taken = self.nothing_taken();
        for line in lines {
            claim_edgels(self, &line.line, &mut taken);
        }
        arcs.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        arcs.retain(|found| {
            let is_own = self.has_own(found, &taken);
            if is_own {
                self.claim_arc(found, &mut taken);
            }
            is_own
        });
    }

    /// Merges arcs that are pieces of one, those that images speak for most first.
    pub(super) fn merge_arcs(&self, mut arcs: Vec<FoundArc>) -> Vec<FoundArc> {
        arcs.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut first = 0;
        while first < arcs.len() {
            let whole = (first + 1..arcs.len()).find_map(|second| {
                let whole = self.whole_of([&arcs[first], &arcs[second]])?;
                Some((second, whole))
            });
            match whole {
                Some((second, whole)) => {
                    arcs.remove(second);
                    arcs[first] = whole;
                }
                None => first += 1,
            }
        }
        arcs
    }

    /// The arc of which two others are pieces.
    fn whole_of(&self, pieces: [&FoundArc; 2]) -> Option<FoundArc> {
        let pixel = pieces[0].pixel.min(pieces[1].pixel);
        let points: Vec<Vector3<f64>> = pieces.iter().flat_map(|piece| points_of(piece)).collect();
        let circle = widest_circle(&points)?;
        let is_near =
            |point: &Vector3<f64>| circle.distance_to_circle(point) <= BESIDE_IN_PIXELS * pixel;
        if !points.iter().all(is_near) {
            return None;
        }
        let start = CircularArc {
            angles: union(&circle, pieces, WINDOW_IN_PIXELS * pixel)?,
            ..circle
        };
        let mut views: Vec<usize> = (pieces.iter())
            .flat_map(|piece| &piece.sectors)
            .flat_map(|sector| sector.evidence.views())
            .collect();
        views.sort_unstable();
        views.dedup();
        let whole = self.follow_arc(&start, &views)?;
        let mut taken = self.nothing_taken();
        self.claim_arc(&whole, &mut taken);
        (pieces.iter())
            .all(|piece| !self.has_own(piece, &taken))
            .then_some(whole)
    }
}

fn points_of(piece: &FoundArc) -> [Vector3<f64>; SAMPLES] {
    let arc = &piece.arc;
    let share = |k: usize| k as f64 / (SAMPLES - 1) as f64;
    std::array::from_fn(|k| arc.point_at(arc.angles[0] + share(k) * arc.sweep()))
}

/// The whole circle through the three points that span the largest triangle.
fn widest_circle(points: &[Vector3<f64>]) -> Option<CircularArc> {
    let mut widest = (0.0, None);
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points.iter().enumerate().skip(i + 1) {
            for c in &points[j + 1..] {
                let area = (b - a).cross(&(c - a)).norm_squared();
                if area > widest.0 {
                    widest = (area, Some([*a, *b, *c]));
                }
            }
        }
    }
    CircularArc::through(widest.1?).map(|arc| CircularArc {
        angles: [0.0, TAU],
        ..arc
    })
}

/// From where to where an arc runs along a circle that it lies on.
fn span_on(circle: &CircularArc, arc: &CircularArc) -> [f64; 2] {
    let middle = circle.angle_of(&arc.point_at(0.5 * (arc.angles[0] + arc.angles[1])));
    let half = (0.5 * arc.length() / circle.radius).min(0.5 * TAU);
    [middle - half, middle + half]
}

/// The part of a circle that two arcs along it cover, at most `gap` apart.
fn union(circle: &CircularArc, pieces: [&FoundArc; 2], gap: f64) -> Option<[f64; 2]> {
    let [a, b] = pieces.map(|piece| span_on(circle, &piece.arc));
    let turn = TAU * (0.5 * ((a[0] + a[1]) - (b[0] + b[1])) / TAU).round();
    let b = b.map(|angle| angle + turn);
    let apart = (a[0] - b[1]).max(b[0] - a[1]) * circle.radius;
    let whole = [a[0].min(b[0]), a[1].max(b[1])];
    (apart <= gap).then(|| [whole[0], whole[1].min(whole[0] + TAU)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, views_of_arcs};
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};

    /// Views of two circles, one over the other by so many pixels.
    fn views_of_rims(apart: f64) -> TestViews {
        let (mut points, mut edges) = (Vec::new(), Vec::new());
        for side in [-0.5, 0.5] {
            let mut rim = arc(2.0);
            rim.center += side * apart * 0.003 * rim.normal();
            let first = points.len();
            points.extend(rim.points(0.05));
            edges.extend((first + 1..points.len()).map(|k| [k - 1, k]));
        }
        let seen = views_of_edges(&cameras_on_sphere(20), &points, &edges);
        let views = (seen.iter()).map(|view| PreparedView::new(view, 1.0, 0.0));
        TestViews::of(views.collect())
    }

    /// A part of an arc as images show it.
    fn settled(images: &Images, part: CircularArc) -> FoundArc {
        let found = FoundArc {
            arc: part,
            gain: 0.0,
            pixel: 0.003,
            sectors: Vec::new(),
            covariance: None,
        };
        images.settle_arc(&found, &images.nothing_taken()).unwrap()
    }

    #[test]
    fn pieces_of_one_circle_become_one_arc() {
        let views = views_of_arcs(20, |_| arc(2.0));
        let images = views.images();
        let piece = |angles: [f64; 2]| settled(&images, CircularArc { angles, ..arc(2.0) });
        let merged = images.merge_arcs(vec![piece([0.0, 0.8]), piece([0.9, 2.0])]);
        assert_eq!(merged.len(), 1);
        assert!((merged[0].arc.sweep() - 2.0).abs() < 0.1);
        assert!((merged[0].arc.radius - arc(2.0).radius).abs() < 1e-3);
    }

    #[test]
    fn rims_beside_each_other_stay_two_and_a_third_between_them_goes() {
        let views = views_of_rims(4.0);
        let images = views.images();
        let rim = |side: f64| {
            let mut rim = arc(2.0);
            rim.center += side * 4.0 * 0.003 * rim.normal();
            settled(&images, rim)
        };
        let mut arcs = images.merge_arcs(vec![rim(-0.5), rim(0.5)]);
        assert_eq!(arcs.len(), 2);
        // Along one of them at its start and along the other one at its end.
        let mut between = arcs[0].clone();
        between.gain = 1.0;
        let axes = between.arc.axes;
        between.arc.axes[1] = (axes[1] + 0.02 * axes[0].cross(&axes[1])).normalize();
        arcs.push(between);
        images.retain_own(&[], &mut arcs);
        assert_eq!(arcs.len(), 2);
    }
}
