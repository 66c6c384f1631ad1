//! The *ideal baseline*: how much of a true wireframe a perfect reconstruction from
//! these 2D wireframes could have.
//!
//! Source: NEAT (CVPR 2024), supplement E, Table 6. The published script takes 20
//! pixels and counts every segment; this is the text, 5 pixels for both.

use crate::projection::project_in_front;
use crate::{ViewObservation, Wireframe3d};
use nalgebra::Vector2;
use neat_core::LineSegment2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How near a detection has to lie to a projected true one, in pixels.
const MAX_DISTANCE_IN_PIXELS: f64 = 5.0;

/// How many true junctions and segments some view has a detection of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct IdealBaseline {
    /// Junctions with a detected one nearby in any view.
    pub junctions: usize,
    /// Segments both ends of which lie near those of one detected segment in any view.
    pub segments: usize,
}

/// Counts the junctions and segments of `truth` that `views` have a detection of.
///
/// Visibility is not asked for, as published: what is hidden counts where detections
/// happen to lie on its projection.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn ideal_baseline(truth: &Wireframe3d, views: &[ViewObservation]) -> IdealBaseline {
    let in_view = |view: &ViewObservation, junction: usize| {
        project_in_front(&view.camera, &truth.junctions[junction])
    };
    let is_junction_detected = |junction: usize| {
        views.iter().any(|view| {
            in_view(view, junction)
                .is_some_and(|place| view.junctions.iter().any(|other| is_near(other, &place)))
        })
    };
    let is_segment_detected = |&[a, b]: &[usize; 2]| {
        views.iter().any(|view| {
            Option::zip(in_view(view, a), in_view(view, b)).is_some_and(|places| {
                let mut detections = view.segments.iter();
                detections.any(|detection| has_ends(&detection.segment, places))
            })
        })
    };
    let junctions = (0..truth.junctions.len()).into_par_iter();
    IdealBaseline {
        junctions: junctions.filter(|&j| is_junction_detected(j)).count(),
        segments: (truth.edges.par_iter())
            .filter(|edge| is_segment_detected(edge))
            .count(),
    }
}

fn is_near(a: &Vector2<f64>, b: &Vector2<f64>) -> bool {
    (a - b).norm_squared() < MAX_DISTANCE_IN_PIXELS * MAX_DISTANCE_IN_PIXELS
}

/// Whether the ends of a segment lie near two places, in either order.
fn has_ends(segment: &LineSegment2, (p, q): (Vector2<f64>, Vector2<f64>)) -> bool {
    let [a, b] = segment.ends();
    (is_near(&a, &p) && is_near(&b, &q)) || (is_near(&a, &q) && is_near(&b, &p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::observation;
    use nalgebra::Vector3;

    /// The point at depth 2 that the camera at the origin shows at a pixel.
    fn at([x, y]: [f64; 2]) -> Vector3<f64> {
        Vector3::new((x - 50.0) / 50.0, (y - 50.0) / 50.0, 2.0)
    }

    #[test]
    fn ends_of_one_segment_within_five_pixels_are_asked_for_in_any_order() {
        let truth = Wireframe3d {
            junctions: [[10.0, 10.0], [40.0, 10.0], [40.0, 40.0]].map(at).to_vec(),
            edges: vec![[0, 1], [1, 2]],
        };
        // The first edge, reversed and four pixels aside; of the second only one end.
        let mut view = observation(&[
            ([40.0, 14.0], [10.0, 6.0], 1.0),
            ([40.0, 14.0], [40.0, 34.0], 1.0),
        ]);
        view.junctions = vec![Vector2::new(44.0, 10.0), Vector2::new(40.0, 34.5)];
        let expected = IdealBaseline {
            junctions: 1,
            segments: 1,
        };
        assert_eq!(
            ideal_baseline(&truth, std::slice::from_ref(&view)),
            expected
        );
        // Another view may show what is left.
        let mut other = observation(&[([40.0, 10.0], [40.0, 36.0], 1.0)]);
        other.junctions = vec![Vector2::new(40.0, 44.0), Vector2::new(14.0, 10.0)];
        let both = ideal_baseline(&truth, &[view, other]);
        assert_eq!(
            both,
            IdealBaseline {
                junctions: 3,
                segments: 2
            }
        );
        assert_eq!(
            ideal_baseline(&truth, &[]),
            IdealBaseline {
                junctions: 0,
                segments: 0
            }
        );
    }
}
