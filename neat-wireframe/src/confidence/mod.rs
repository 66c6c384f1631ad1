//! Confidence and provenance: how sure the junctions and edges of a finished
//! wireframe are, and which 2D segments say so.
//!
//! Nothing here depends on what made the wireframe. [`assess`] asks the 2D
//! segments of all views, and the surface where there is one:
//!
//! - which segments lie on each projected edge ([`EdgeSupport`]);
//! - in which views the edge ought to be seen, and how often chance would support
//!   a random line: hence the probability that it is more than chance;
//! - where the detected ends put the junctions, and how precisely: hence their
//!   covariances, with the noise of the detector estimated from the scene itself;
//! - whether the views agree on an edge, and show edges whole: hence the probability
//!   that it exists.
//!
//! ```
//! use neat_core::synthetic::{SyntheticScene, generate};
//! use neat_wireframe::ViewObservation;
//! use neat_wireframe::confidence::{ConfidenceConfig, assess};
//!
//! let config = SyntheticScene { views: 12, image_size: 256, ..Default::default() };
//! let data = generate(&config)?;
//! let observations = ViewObservation::from_scene(&data.scene, 0.05);
//! let config = ConfidenceConfig::default();
//! let confidence = assess(&data.truth, &observations, None, 1.0, &config)?;
//! assert!(confidence.junctions.iter().all(|junction| junction.covariance.is_some()));
//! assert!(confidence.edges.iter().all(|edge| edge.probability > 0.5));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod calibration;
mod completed;
mod config;
mod covariance;
mod decoys;
mod detected_ends;
mod document;
mod existence;
mod expected_views;
mod noise;
mod occlusion;
mod provenance;
mod view_correlation;

pub use calibration::ExistenceWitnesses;
pub use config::ConfidenceConfig;
pub use document::{fill_arcs, transformed_covariance};
pub use noise::DetectionNoise;
pub use provenance::EdgeSupport;

use crate::validity::{WireframeFlaw, check_wireframe};
use crate::{SignedDistance, ViewObservation, Wireframe3d};
use calibration::calibrate;
use config::ProvenanceConfig;
use decoys::decoys;
use detected_ends::detected_ends;
use existence::{ExistenceModel, ViewCount};
use expected_views::expected_views;
use nalgebra::Matrix3;
use neat_core::LineSegment3;
use occlusion::Occluder;
use provenance::{EdgeProvenance, IndexedView, provenance};
use rayon::prelude::*;
use tracing::debug;

/// How sure a wireframe is.
#[derive(Clone, Debug, PartialEq)]
pub struct Confidence {
    /// One entry per junction.
    pub junctions: Vec<JunctionConfidence>,
    /// One entry per edge.
    pub edges: Vec<EdgeConfidence>,
    /// Noise of the detected ends, as estimated from this scene.
    pub noise: DetectionNoise,
    /// Radius of the scene ball in world units, which bounds what is not
    /// determined.
    pub scene_radius: f64,
    /// Segments farther from an edge than this do not support it.
    pub tolerance_in_pixels: f64,
}

/// How sure a junction is.
#[derive(Clone, Debug, PartialEq)]
pub struct JunctionConfidence {
    /// Expected squared error of the position, in squared world units; symmetric.
    /// `None` where the observations do not determine it, such as along a free
    /// end that is detected nowhere.
    pub covariance: Option<Matrix3<f64>>,
    /// Number of views with a 2D segment on one of its edges.
    pub views: usize,
}

/// How sure an edge is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeConfidence {
    /// The 2D segments that lie on the edge, by ascending view and segment.
    pub supports: Vec<EdgeSupport>,
    /// Number of views among them.
    pub views: usize,
    /// The views whose segments cover most of the edge, ascending.
    pub showing_views: Vec<usize>,
    /// Number of views that ought to show the edge, or do: most of it lies in the
    /// image, is long enough, and not hidden by the surface.
    pub expected_views: usize,
    /// Root mean square distance of the supports' ends from the projected edge, in
    /// pixels; `None` without any.
    pub residual_in_pixels: Option<f64>,
    /// Probability that the edge exists, in (0, 1).
    pub probability: f64,
    /// What that is made of; `None` where no view shows any edge.
    pub witnesses: Option<ExistenceWitnesses>,
}

/// Asks the images, and the surface if there is one, about a wireframe.
///
/// - `wireframe`: in the world of the cameras, with junctions and edges in any
///   order.
/// - `observations`: cameras and detected segments. Segments whose ends have the
///   same coordinates share a vertex. Views without a valid camera and segments
///   that are not finite say nothing.
/// - `surface`: tells where edges are hidden; without it, hidden views count as
///   views that ought to show an edge, in all edges alike.
/// - `scene_radius`: radius of the ball around the world's origin in which the
///   structure lies. With one that is not a positive number no junction is
///   determined and no surface asked.
///
/// Time and memory grow about linearly with views, edges and segments. The result
/// does not depend on the number of threads.
///
/// # Errors
/// If the wireframe is not valid.
pub fn assess(
    wireframe: &Wireframe3d,
    observations: &[ViewObservation],
    surface: Option<&dyn SignedDistance>,
    scene_radius: f64,
    config: &ConfidenceConfig,
) -> Result<Confidence, WireframeFlaw> {
    check_wireframe(&wireframe.junctions, &wireframe.edges)?;
    let _span = tracing::debug_span!("confidence").entered();
    let radius = Some(scene_radius).filter(|radius| radius.is_normal() && *radius > 0.0);
    let views: Vec<Option<IndexedView>> = observations.par_iter().map(IndexedView::new).collect();
    let segments = wireframe.segments();
    let (rules, existence, covariances) =
        (config.provenance(), config.existence(), config.covariance());
    let found = provenance(&views, &segments, &rules);

    let occluder = Option::zip(surface, radius).map(|(surface, scene_radius)| Occluder {
        surface,
        scene_radius,
    });
    let count = |edges: &[LineSegment3], found: &[EdgeProvenance]| -> Vec<ViewCount> {
        let count = |(edge, found)| view_count(observations, edge, found, &occluder, &rules);
        // The surface answers in batches of its own; one edge after the other.
        edges.iter().zip(found).map(count).collect()
    };
    let counts = count(&segments, &found);
    let decoys = decoys(&segments, existence.max_decoys);
    let mut with_decoys = segments.clone();
    with_decoys.extend(&decoys);
    // Decoys compete with the edges for segments, as false edges would.
    let found_decoys = provenance(&views, &with_decoys, &rules).split_off(segments.len());
    let decoy_counts = count(&decoys, &found_decoys);
    let usable_views = views.iter().flatten().count();
    let least = existence.least_expected_views(usable_views);
    let model = ExistenceModel::fit(&counts, &decoy_counts, least, &existence);

    let ends = detected_ends(
        observations,
        &wireframe.junctions,
        &wireframe.edges,
        &found,
        &covariances,
    );
    let estimate = covariance::estimate(
        observations,
        &wireframe.junctions,
        &ends,
        radius,
        &covariances,
    );
    let by_counts: Vec<f64> = (counts.iter())
        .map(|count| model.probability(*count))
        .collect();
    let probabilities = match radius {
        Some(radius) => {
            let (edges, covariances) = (&wireframe.edges, &estimate.covariances);
            calibrate(&by_counts, edges, &found, covariances, radius)
        }
        None => by_counts.into_iter().map(|p| (p, None)).collect(),
    };
    debug!(
        views = usable_views,
        edges = segments.len(),
        decoys = decoys.len(),
        detected_ends = ends.len(),
        noise = ?estimate.noise,
        "assessed"
    );
    let views_of_junctions = views_of_junctions(wireframe, &found);
    Ok(Confidence {
        junctions: (estimate.covariances.into_iter().zip(views_of_junctions))
            .map(|(covariance, views)| JunctionConfidence { covariance, views })
            .collect(),
        edges: (found.into_iter().zip(counts).zip(probabilities))
            .map(|((found, count), probability)| edge_confidence(found, count, probability))
            .collect(),
        noise: estimate.noise,
        scene_radius,
        tolerance_in_pixels: config.tolerance_in_pixels,
    })
}

fn view_count(
    observations: &[ViewObservation],
    edge: &LineSegment3,
    found: &EdgeProvenance,
    occluder: &Option<Occluder>,
    rules: &ProvenanceConfig,
) -> ViewCount {
    let expected = expected_views(observations, edge, occluder.as_ref(), rules);
    let unexpected = (found.showing_views.iter())
        .filter(|view| expected.binary_search(view).is_err())
        .count();
    ViewCount {
        showing: found.showing_views.len(),
        expected: expected.len() + unexpected,
    }
}

fn edge_confidence(
    found: EdgeProvenance,
    count: ViewCount,
    (probability, witnesses): (f64, Option<ExistenceWitnesses>),
) -> EdgeConfidence {
    let supports = found.supports;
    let squares: f64 = (supports.iter())
        .map(|support| support.residual_in_pixels.powi(2))
        .sum();
    EdgeConfidence {
        views: supports.chunk_by(|a, b| a.view == b.view).count(),
        showing_views: found.showing_views,
        expected_views: count.expected,
        residual_in_pixels: (!supports.is_empty())
            .then(|| (squares / supports.len() as f64).sqrt()),
        probability,
        witnesses,
        supports,
    }
}

/// The number of views with a segment on an edge of each junction.
fn views_of_junctions(wireframe: &Wireframe3d, found: &[EdgeProvenance]) -> Vec<usize> {
    let mut views: Vec<Vec<usize>> = vec![Vec::new(); wireframe.junctions.len()];
    for (edge, found) in wireframe.edges.iter().zip(found) {
        for junction in edge {
            views[*junction].extend(found.supports.iter().map(|support| support.view));
        }
    }
    let count = |mut views: Vec<usize>| {
        views.sort_unstable();
        views.dedup();
        views.len()
    };
    views.into_iter().map(count).collect()
}
