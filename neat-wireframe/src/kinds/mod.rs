//! What an edge is: a crease of the surface, its boundary, paint on it, or light.
//!
//! Images show painted lines, joints of planks and shadows as clearly as they show creases,
//! and a wireframe holds them all. Four witnesses tell them apart: whether the two sides lie
//! in one plane that looks the same from all views (`coplanarity.rs`), whether the edge is a
//! dark line rather than a step and whether its sides differ at all (`side_colours.rs`),
//! and whether the edges around it leave its plane (`junctions.rs`). `model.rs` weighs them.
//! What is hardly structure can be left out (`paint.rs`).
//! Without any, an edge is most likely a crease: an image without texture cannot say that
//! two faces are one.
//!
//! How the structure is divided into creases and boundaries, and the rest into texture and
//! shadows, follows rules that no truth has calibrated.

mod coplanarity;
mod curved_rims;
mod document;
mod edge_frame;
mod edge_samples;
mod junctions;
mod model;
mod paint;
mod side_colours;

#[cfg(test)]
mod tests;

pub use curved_rims::curved_chains;
pub use document::fill_kinds;
pub use junctions::{JunctionType, junction_types};
pub use model::{EdgeKind, EdgeKinds};
pub use paint::{WithoutPaint, without_paint};

use coplanarity::coplanarity;
use edge_frame::EdgeFrame;
use edge_samples::{ViewSamples, edge_samples, sampled_bytes};
use junctions::leaves_plane;
use model::Witnesses;
use nalgebra::Vector3;
use neat_core::{Camera, Scene, SceneError, Wireframe3d};
use rayon::prelude::*;
use side_colours::SideColours;

/// Half the logarithm of the ratio of two sides that tells them apart: six percent. A tenth of
/// the true edges of photographs differ by less, half of the joints of boards by a quarter of it.
const CLEAR_CONTRAST: f64 = 0.03;
/// Samples of so many bytes are in memory at once; what takes more is taken in turns, for each of
/// which the images are read again.
const SAMPLED_AT_ONCE: usize = 256 << 20;

/// The probabilities of the kinds of every edge.
///
/// - `wireframe`: valid, in the world of the cameras, with edges cut where others meet them.
/// - `scene`: images and cameras; one image at a time is in memory.
/// - `shown`: for each edge the views that show it, as
///   [`showing_views`](crate::confidence::EdgeConfidence::showing_views) says.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// If an image cannot be read.
pub fn edge_kinds(
    wireframe: &Wireframe3d,
    scene: &Scene,
    shown: &[Vec<usize>],
) -> Result<Vec<EdgeKinds>, SceneError> {
    let _span = tracing::debug_span!("edge_kinds", edges = wireframe.edges.len()).entered();
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let segments = wireframe.segments();
    let frames: Vec<Option<EdgeFrame>> = (segments.par_iter().zip(shown))
        .map(|(segment, views)| EdgeFrame::new(*segment, views, &cameras))
        .collect();
    let directions: Vec<Option<Vector3<f64>>> = (segments.iter())
        .map(|segment| (segment.end - segment.start).try_normalize(0.0))
        .collect();
    let leaving = leaves_plane(wireframe, &directions);
    let mut kinds = Vec::with_capacity(frames.len());
    while kinds.len() < frames.len() {
        let (frames, leaving) = (&frames[kinds.len()..], &leaving[kinds.len()..]);
        let count = so_many_at_once(frames, SAMPLED_AT_ONCE);
        let samples = edge_samples(&frames[..count], scene)?;
        let of_edges = frames.par_iter().zip(leaving).zip(samples);
        kinds.par_extend(of_edges.map(|((frame, leaves_plane), samples)| {
            witnesses(frame.as_ref(), *leaves_plane, &samples).kinds()
        }));
    }
    Ok(kinds)
}

/// How many of the first edges have samples of `most` bytes together, but one at least.
fn so_many_at_once(frames: &[Option<EdgeFrame>], most: usize) -> usize {
    let sizes = frames.iter().map(|f| f.as_ref().map_or(0, sampled_bytes));
    let sums = sizes.scan(0, |sum: &mut usize, bytes| {
        *sum = sum.saturating_add(bytes);
        Some(*sum)
    });
    sums.take_while(|sum| *sum <= most).count().max(1)
}

fn witnesses(frame: Option<&EdgeFrame>, leaves_plane: f64, samples: &[ViewSamples]) -> Witnesses {
    let mut witnesses = Witnesses {
        leaves_plane,
        ..Witnesses::default()
    };
    let Some(frame) = frame else {
        return witnesses;
    };
    // An edge that is seen all around lies within no plane.
    let may_be_flat = frame.common_planes().next().is_some();
    if may_be_flat {
        witnesses.coplanarity = coplanarity(frame, samples);
    }
    if let Some(colours) = SideColours::new(samples) {
        witnesses.chroma = colours.chroma;
        witnesses.step = colours.step;
        witnesses.instability = colours.instability;
        witnesses.evenness = (-(colours.contrast / CLEAR_CONTRAST).powi(2)).exp();
        if may_be_flat {
            witnesses.darkness = colours.darkness;
        }
    }
    witnesses
}
