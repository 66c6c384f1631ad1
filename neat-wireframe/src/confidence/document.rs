//! Confidence in `wireframe.json` and as line tracks.

use super::covariance::largest_eigenvalue;
use super::{Confidence, EdgeConfidence, EdgeSupport};
use crate::ViewObservation;
use crate::Wireframe3d;
use crate::export::{LineTrack, SupportingSegment, TrackSegment, WireframeDocument};
use nalgebra::{Matrix3, Matrix4};
use neat_core::{CircularArc, Similarity};

/// The covariance of a point after a similarity: scaled by the square of its
/// scale. Its axes stay, because a [`Similarity`] does not turn.
pub fn transformed_covariance(covariance: &Matrix3<f64>, transform: &Similarity) -> Matrix3<f64> {
    covariance * transform.scale.powi(2)
}

/// Writes arcs of the world of the cameras, and the covariances of their centres and radii, into a
/// document, in the frame of the user's files.
pub fn fill_arcs(
    document: &mut WireframeDocument,
    arcs: &[CircularArc],
    covariances: &[Option<Matrix4<f64>>],
    original_from_world: &Similarity,
) {
    let scale = original_from_world.scale.powi(2);
    document.arcs = (arcs.iter())
        .map(|arc| arc.map(|point| original_from_world.apply(point)))
        .collect();
    document.arc_covariances = (covariances.iter())
        .map(|covariance| {
            let in_original = (*covariance)? * scale;
            let of_row = |row| (row..4).map(move |column| (row, column));
            let mut upper = (0..4).flat_map(of_row).map(|index| in_original[index]);
            Some(std::array::from_fn(|_| upper.next().unwrap_or_default()))
        })
        .collect();
}

impl Confidence {
    /// Writes everything into a document of the same wireframe, whose junctions
    /// `original_from_world` has moved from the world of the cameras to the frame
    /// of the user's files. `view_names` are those of the observations.
    ///
    /// Fields hold a number for every junction and edge, so a junction that is not determined has the
    /// scene's radius as `sigma` (and `null` as covariance), and an edge without
    /// support the tolerance as `residual_in_pixels`.
    ///
    /// # Panics
    /// If the document is of another wireframe.
    pub fn fill(
        &self,
        document: &mut WireframeDocument,
        view_names: &[String],
        original_from_world: &Similarity,
    ) {
        assert_eq!(
            [document.junctions.len(), document.edges.len()],
            [self.junctions.len(), self.edges.len()],
            "Confidence::fill: the document is of another wireframe"
        );
        let in_original = |covariance| transformed_covariance(covariance, original_from_world);
        let covariances: Vec<Option<Matrix3<f64>>> = (self.junctions.iter())
            .map(|junction| junction.covariance.as_ref().map(in_original))
            .collect();
        let undetermined = self.scene_radius * original_from_world.length_factor();
        let sigma = |covariance: &Option<Matrix3<f64>>| {
            let sigma = |c: &Matrix3<f64>| largest_eigenvalue(c).max(0.0).sqrt();
            covariance.as_ref().map_or(undetermined, sigma)
        };
        let fields = &mut document.junction_fields;
        fields.sigma = Some(covariances.iter().map(sigma).collect());
        fields.supporting_views = Some(self.junctions.iter().map(|j| j.views).collect());
        let upper_triangle = |c: Matrix3<f64>| {
            [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|index| c[index])
        };
        document.junction_covariances = (covariances.into_iter())
            .map(|covariance| covariance.map(upper_triangle))
            .collect();

        let edges = || self.edges.iter();
        let residual =
            |edge: &EdgeConfidence| edge.residual_in_pixels.unwrap_or(self.tolerance_in_pixels);
        let fields = &mut document.edge_fields;
        fields.supporting_views = Some(edges().map(|edge| edge.views).collect());
        fields.expected_views = Some(edges().map(|edge| edge.expected_views).collect());
        fields.probability = Some(edges().map(|edge| edge.probability).collect());
        fields.residual_in_pixels = Some(edges().map(residual).collect());
        document.views = view_names.to_vec();
        document.edge_support = edges()
            .map(|edge| edge.supports.iter().map(supporting_segment).collect())
            .collect();
    }

    /// The edges that at least `min_views` views support, as line tracks.
    ///
    /// - `wireframe`: the same graph in any frame, such as that of the user's
    ///   files.
    /// - `observations`: those that were asked. Line ids are the segments' edges
    ///   in the 2D wireframes, image ids the indices of the views.
    ///
    /// # Panics
    /// If wireframe or observations are others than those that were assessed.
    pub fn line_tracks(
        &self,
        wireframe: &Wireframe3d,
        observations: &[ViewObservation],
        min_views: usize,
    ) -> Vec<LineTrack> {
        let tracks = self.edges.iter().enumerate();
        tracks
            .filter(|(_, edge)| edge.views >= min_views)
            .map(|(index, edge)| LineTrack {
                segment: wireframe.segment(index),
                supports: (edge.supports.iter())
                    .map(|support| {
                        let detection =
                            &observations[support.view].segments[support.segment_in_view];
                        TrackSegment {
                            image: support.view,
                            line: detection.edge,
                            segment: Some(support.segment),
                        }
                    })
                    .collect(),
            })
            .collect()
    }
}

fn supporting_segment(support: &EdgeSupport) -> SupportingSegment {
    let [start, end] = support.segment.ends();
    SupportingSegment {
        view: support.view,
        segment: [start.x, start.y, end.x, end.y],
        residual: support.residual_in_pixels,
    }
}
