//! How well a wireframe agrees with the 2D segments of its views: what can be
//! measured on photographs, where no true wireframe is known.

use super::{MetricsError, PointCloud};
use crate::interval_cover::covered_length;
use crate::validity::check_wireframe;
use crate::{ViewObservation, Wireframe3d};
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment2, LineSegment3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of [`image_evidence`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImageEvidenceConfig {
    /// Both ends of an explained segment lie this near to the edge's line …
    pub tolerance_in_pixels: f64,
    /// … under at most this angle to it …
    pub max_angle_in_degrees: f64,
    /// … and such edges together cover at least this share of the segment.
    pub min_overlap: f64,
}

impl Default for ImageEvidenceConfig {
    fn default() -> Self {
        Self {
            tolerance_in_pixels: 3.0,
            max_angle_in_degrees: 5.0,
            min_overlap: 0.5,
        }
    }
}

/// Agreement of a wireframe with the images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImageEvidence {
    /// 2D segments in all views.
    pub segments: usize,
    /// Those that edges explain.
    pub explained_segments: usize,
    /// Their share of the length of all 2D segments; `None` without segments.
    pub explained_length_share: Option<f64>,
    /// Mean distance of their ends from the best edge's line, in pixels.
    pub mean_reprojection_error_in_pixels: Option<f64>,
    /// Mean number of views in which an edge explains a segment.
    pub mean_views_per_edge: Option<f64>,
    /// Median distance of the junctions from the nearest of the given points, in
    /// world units.
    pub median_junction_to_point_distance: Option<f64>,
}

impl ImageEvidence {
    /// Share of the 2D segments that some edge explains.
    pub fn explained_share(&self) -> Option<f64> {
        (self.segments > 0).then(|| self.explained_segments as f64 / self.segments as f64)
    }
}

/// What one view says.
#[derive(Default)]
struct ViewEvidence {
    explained: usize,
    length: f64,
    explained_length: f64,
    error_sum: f64,
    /// Whether each edge explains a segment here.
    shows: Vec<bool>,
}

/// Measures a wireframe against the 2D segments of its views and against points
/// on the surfaces, such as structure from motion finds (none are fine).
///
/// # Errors
/// If the wireframe is not valid or a point is not finite.
pub fn image_evidence(
    wireframe: &Wireframe3d,
    observations: &[ViewObservation],
    points: &[Vector3<f64>],
    config: &ImageEvidenceConfig,
) -> Result<ImageEvidence, MetricsError> {
    check_wireframe(&wireframe.junctions, &wireframe.edges).map_err(MetricsError::Predicted)?;
    let edges = wireframe.segments();
    let views: Vec<ViewEvidence> = observations
        .par_iter()
        .map(|observation| view_evidence(&edges, observation, config))
        .collect();
    let segments = observations.iter().map(|o| o.segments.len()).sum();
    let sum = |of: fn(&ViewEvidence) -> f64| views.iter().map(of).sum::<f64>();
    let explained_segments = views.iter().map(|view| view.explained).sum();
    let share = |part: f64, whole: f64| (whole > 0.0).then(|| part / whole);
    let shown: usize = views
        .iter()
        .map(|view| view.shows.iter().filter(|shows| **shows).count())
        .sum();

    let cloud = PointCloud::new(points)?;
    let mut distances: Vec<f64> = wireframe
        .junctions
        .iter()
        .filter_map(|junction| cloud.distance(junction))
        .collect();
    distances.sort_by(f64::total_cmp);
    Ok(ImageEvidence {
        segments,
        explained_segments,
        explained_length_share: share(sum(|view| view.explained_length), sum(|view| view.length)),
        mean_reprojection_error_in_pixels: share(
            sum(|view| view.error_sum),
            explained_segments as f64,
        ),
        mean_views_per_edge: share(shown as f64, edges.len() as f64),
        median_junction_to_point_distance: distances.get(distances.len() / 2).copied(),
    })
}

fn view_evidence(
    edges: &[LineSegment3],
    observation: &ViewObservation,
    config: &ImageEvidenceConfig,
) -> ViewEvidence {
    let projected: Vec<Option<LineSegment2>> = edges
        .iter()
        .map(|edge| visible_projection(&observation.camera, edge))
        .collect();
    let mut evidence = ViewEvidence {
        shows: vec![false; edges.len()],
        ..Default::default()
    };
    let mut fits: Vec<(usize, Fit)> = Vec::new();
    for detection in &observation.segments {
        let length = detection.segment.length();
        if !length.is_finite() {
            continue;
        }
        evidence.length += length;
        fits.clear();
        fits.extend(
            projected
                .iter()
                .enumerate()
                .filter_map(|(edge, projected)| {
                    let fit = Fit::of(projected.as_ref()?, &detection.segment, config)?;
                    Some((edge, fit))
                }),
        );
        // Pieces of a line that was cut explain together what no piece does alone.
        let covered = fits.iter().map(|(_, fit)| fit.covered).collect();
        if !fits.is_empty() && covered_length(covered, [0.0, 1.0]) >= config.min_overlap {
            for (edge, _) in &fits {
                evidence.shows[*edge] = true;
            }
            let errors = fits.iter().map(|(_, fit)| fit.error);
            evidence.explained += 1;
            evidence.explained_length += length;
            evidence.error_sum += errors.fold(f64::INFINITY, f64::min);
        }
    }
    evidence
}

/// How a segment lies along a projected edge.
struct Fit {
    /// The part of the segment beside the edge, from 0 to 1 along it.
    covered: [f64; 2],
    /// Mean distance of the segment's ends from the edge's line, in pixels.
    error: f64,
}

impl Fit {
    /// `None` for a segment that does not lie along the edge.
    fn of(
        edge: &LineSegment2,
        segment: &LineSegment2,
        config: &ImageEvidenceConfig,
    ) -> Option<Self> {
        let direction = (edge.end - edge.start).try_normalize(1e-9)?;
        let across = segment
            .ends()
            .map(|end| (end - edge.start).perp(&direction));
        if across[0].abs().max(across[1].abs()) > config.tolerance_in_pixels {
            return None;
        }
        let length = segment.length();
        let sine = (across[0] - across[1]).abs() / length;
        let along = segment.ends().map(|end| (end - edge.start).dot(&direction));
        let low = along[0].min(along[1]);
        let extent = along[0].max(along[1]) - low;
        let covered = [0.0, edge.length()].map(|end| ((end - low) / extent).clamp(0.0, 1.0));
        let beside =
            covered[1] > covered[0] && sine <= config.max_angle_in_degrees.to_radians().sin();
        beside.then(|| Self {
            covered: if along[0] <= along[1] {
                covered
            } else {
                [1.0 - covered[1], 1.0 - covered[0]]
            },
            error: 0.5 * (across[0].abs() + across[1].abs()),
        })
    }
}

/// The projection of the part of an edge that lies in front of the camera.
pub(crate) fn visible_projection(camera: &Camera, edge: &LineSegment3) -> Option<LineSegment2> {
    /// Share of the farther end's depth at which the edge is cut.
    const NEAR: f64 = 1e-3;
    let [a, b] = edge.ends().map(|end| camera.to_camera(&end).z);
    let near = NEAR * a.max(b);
    if near.is_nan() || near <= 0.0 {
        return None;
    }
    let cut = |depth: f64, other: f64| {
        if depth < near {
            (near - depth) / (other - depth)
        } else {
            0.0
        }
    };
    let [start, end] = [cut(a, b), 1.0 - cut(b, a)].map(|t| edge.point_at(t));
    Some(LineSegment2::new(
        camera.project(&start).pixel,
        camera.project(&end).pixel,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};

    fn cube_wireframe() -> Wireframe3d {
        let (junctions, edges) = cube();
        Wireframe3d { junctions, edges }
    }

    #[test]
    fn the_truth_explains_everything_and_half_of_it_half() {
        let truth = cube_wireframe();
        let views = views_of_edges(&cameras_on_sphere(5), &truth.junctions, &truth.edges);
        let config = ImageEvidenceConfig::default();
        let measured = image_evidence(&truth, &views, &truth.junctions, &config).unwrap();
        assert_eq!(measured.explained_share(), Some(1.0));
        assert_eq!(measured.mean_views_per_edge, Some(5.0));
        assert_eq!(measured.median_junction_to_point_distance, Some(0.0));
        assert!(measured.mean_reprojection_error_in_pixels.unwrap() < 1e-9);

        let mut half = truth.clone();
        half.edges.truncate(6);
        let measured = image_evidence(&half, &views, &[], &config).unwrap();
        assert!((0.5..0.7).contains(&measured.explained_share().unwrap()));
        assert_eq!(measured.median_junction_to_point_distance, None);
    }

    #[test]
    fn pieces_of_a_cut_edge_explain_together_what_they_cover() {
        let whole = cube_wireframe();
        let views = views_of_edges(&cameras_on_sphere(5), &whole.junctions, &whole.edges);
        let config = ImageEvidenceConfig::default();
        // Every edge cut in four; then without the last of the pieces.
        let mut cut = Wireframe3d::default();
        for edge in whole.segments() {
            let first = cut.junctions.len();
            let places = [0.0, 0.25, 0.5, 0.75, 1.0];
            cut.junctions.extend(places.map(|t| edge.point_at(t)));
            cut.edges.extend((first..first + 4).map(|i| [i, i + 1]));
        }
        let measured = image_evidence(&cut, &views, &[], &config).unwrap();
        assert_eq!(measured.explained_share(), Some(1.0));
        let expected = image_evidence(&whole, &views, &[], &config).unwrap();
        assert_eq!(measured.mean_views_per_edge, expected.mean_views_per_edge);
        let keep = |pieces: usize| Wireframe3d {
            edges: (cut.edges.iter().enumerate())
                .filter(|(index, _)| index % 4 < pieces)
                .map(|(_, edge)| *edge)
                .collect(),
            junctions: cut.junctions.clone(),
        };
        let share = |pieces| {
            let measured = image_evidence(&keep(pieces), &views, &[], &config).unwrap();
            measured.explained_length_share.unwrap()
        };
        assert!(share(3) > 0.9);
        assert!(share(1) < 0.1);
    }

    #[test]
    fn nothing_explains_nothing_and_broken_graphs_are_errors() {
        let config = ImageEvidenceConfig::default();
        let nothing = image_evidence(&Wireframe3d::default(), &[], &[], &config).unwrap();
        assert_eq!(nothing, ImageEvidence::default());
        let mut broken = cube_wireframe();
        broken.edges[0] = [0, 99];
        assert!(image_evidence(&broken, &[], &[], &config).is_err());
    }

    #[test]
    fn edges_that_reach_behind_the_camera_are_cut() {
        let (junctions, edges) = cube();
        let camera = cameras_on_sphere(3)[1];
        let views = views_of_edges(&[camera], &junctions, &edges);
        let center = camera.center_in_world;
        let behind = LineSegment3::new(Vector3::zeros(), 3.0 * center);
        assert!(visible_projection(&camera, &behind).is_some_and(|s| s.length().is_finite()));
        let hidden = LineSegment3::new(1.5 * center, 3.0 * center);
        assert_eq!(visible_projection(&camera, &hidden), None);
        assert_eq!(views.len(), 1);
    }
}
