//! The independent observations behind the supports of all edges.
//!
//! A detected end is one 2D point with one noise, however many segments meet in
//! it: it is counted once, either as an observation of a junction, near whose
//! projection it lies, or of the lines of the edges that it lies on. Only the
//! first says something along an edge.

use super::config::CovarianceConfig;
use super::provenance::EdgeProvenance;
use crate::ViewObservation;
use crate::observation::end_key;
use crate::projection::project_in_front;
use nalgebra::{Vector2, Vector3};
use std::collections::BTreeMap;

/// A detected end.
#[derive(Clone, Debug)]
pub(super) struct DetectedEnd {
    /// Index of the view.
    pub view: usize,
    /// Where it is, in image coordinates.
    pub pixel: Vector2<f64>,
    /// What it shows.
    pub shows: Shown,
}

/// What a detected end shows.
#[derive(Clone, Debug)]
pub(super) enum Shown {
    /// A junction.
    Junction {
        /// Its index.
        junction: usize,
        /// Unit direction of the segment that ends there; `None` where several of
        /// the view do.
        direction: Option<Vector2<f64>>,
    },
    /// Some place on edges, given by their junctions.
    Lines(Vec<[usize; 2]>),
}

/// Gathers the ends of all supports, by view and position.
pub(super) fn detected_ends(
    observations: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
    provenance: &[EdgeProvenance],
    config: &CovarianceConfig,
) -> Vec<DetectedEnd> {
    let mut ends: BTreeMap<_, Gathered> = BTreeMap::new();
    for (edge, found) in edges.iter().zip(provenance) {
        if edge[0] == edge[1] {
            continue;
        }
        for support in &found.supports {
            let camera = &observations[support.view].camera;
            let along = support.segment.end - support.segment.start;
            let max_distance = (config.max_relative_end_distance * along.norm())
                .min(config.max_end_distance_in_pixels);
            for (junction, end) in edge.iter().zip(support.segment.ends()) {
                let gathered = ends
                    .entry(end_key(support.view, &end))
                    .or_insert_with(|| Gathered::new(end));
                gathered.edges.push(*edge);
                gathered.direction = along.normalize();
                let distance = project_in_front(camera, &junctions[*junction])
                    .map_or(f64::INFINITY, |pixel| (pixel - end).norm());
                if distance < gathered.distance.min(max_distance) {
                    gathered.distance = distance;
                    gathered.junction = Some(*junction);
                }
            }
        }
    }
    for (view, observation) in observations.iter().enumerate() {
        for end in observation.segments.iter().flat_map(|s| s.segment.ends()) {
            if let Some(gathered) = ends.get_mut(&end_key(view, &end)) {
                gathered.segments += 1;
            }
        }
    }
    ends.into_iter()
        .map(|((view, _), gathered)| DetectedEnd {
            view,
            pixel: gathered.pixel,
            shows: match gathered.junction {
                Some(junction) => Shown::Junction {
                    junction,
                    direction: (gathered.segments < 2).then_some(gathered.direction),
                },
                None => Shown::Lines(gathered.edges),
            },
        })
        .collect()
}

/// What is known about one end.
struct Gathered {
    pixel: Vector2<f64>,
    /// The edges that its segments support.
    edges: Vec<[usize; 2]>,
    /// Of one of its segments.
    direction: Vector2<f64>,
    /// All segments of the view that end there.
    segments: usize,
    /// The nearest junction of these edges, if one is near.
    junction: Option<usize>,
    /// Its distance.
    distance: f64,
}

impl Gathered {
    fn new(pixel: Vector2<f64>) -> Self {
        Self {
            pixel,
            edges: Vec::new(),
            direction: Vector2::x(),
            segments: 0,
            junction: None,
            distance: f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::confidence::config::ProvenanceConfig;
    use crate::confidence::provenance::{IndexedView, provenance};
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
    use neat_core::{LineSegment2, LineSegment3, ScoredSegment2};

    fn ends_of_cube(observations: &[ViewObservation]) -> Vec<DetectedEnd> {
        let (junctions, edges) = cube();
        let views: Vec<_> = observations.iter().map(IndexedView::new).collect();
        let segments: Vec<_> = edges
            .iter()
            .map(|[a, b]| LineSegment3::new(junctions[*a], junctions[*b]))
            .collect();
        let found = provenance(&views, &segments, &ProvenanceConfig::default());
        let config = CovarianceConfig::default();
        detected_ends(observations, &junctions, &edges, &found, &config)
    }

    #[test]
    fn a_vertex_counts_once_and_ends_of_one_segment_have_its_direction() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(2), &junctions, &edges);
        // In the second view the segment of the first edge is alone.
        observations[1].segments.truncate(1);
        let ends = ends_of_cube(&observations);
        assert_eq!(ends.len(), 8 + 2);
        for end in &ends {
            let Shown::Junction {
                junction,
                direction,
            } = end.shows
            else {
                panic!("every end shows a junction: {end:?}");
            };
            let camera = &observations[end.view].camera;
            assert!((camera.project(&junctions[junction]).pixel - end.pixel).norm() < 1e-9);
            let [start, stop] = observations[1].segments[0].segment.ends();
            match direction {
                None => assert_eq!(end.view, 0),
                Some(direction) => {
                    assert_eq!(end.view, 1);
                    assert!(direction.perp(&(stop - start)).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn ends_of_fragments_show_lines_only() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(1), &junctions, &edges);
        let whole = observations[0].segments[0];
        let piece = LineSegment2::new(whole.segment.start, whole.segment.point_at(0.5));
        observations[0].segments = vec![ScoredSegment2 {
            segment: piece,
            ..whole
        }];
        let ends = ends_of_cube(&observations);
        assert_eq!(ends.len(), 2);
        for end in ends {
            match end.shows {
                Shown::Junction { junction, .. } => {
                    assert_eq!((junction, end.pixel), (edges[0][0], piece.start));
                }
                Shown::Lines(lines) => {
                    assert_eq!((lines, end.pixel), (vec![edges[0]], piece.end));
                }
            }
        }
    }
}
