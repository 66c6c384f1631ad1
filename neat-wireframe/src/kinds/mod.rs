//! What an edge is: a crease of the surface, its boundary, paint on it, or light.
//!
//! Images show painted lines, joints of planks and shadows as clearly as they show creases,
//! and a wireframe holds them all, and lines that are none. Five witnesses tell them apart: whether
//! the two sides lie in one plane that looks the same from all views (`coplanarity.rs`), whether
//! the edge is a dark line rather than a step and whether its sides differ at all
//! (`side_colours.rs`), whether the edges around it leave its plane (`junctions.rs`), and whether
//! as many views show it as ought to. `model.rs` weighs them.
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

use crate::confidence::EdgeConfidence;
use coplanarity::coplanarity;
use edge_frame::EdgeFrame;
use edge_samples::{ViewSamples, edge_samples, sampled_bytes};
use junctions::{free_ends, leaves_plane};
use model::Witnesses;
use nalgebra::Vector3;
use neat_core::{Camera, Scene, SceneError, Wireframe3d};
use rayon::prelude::*;
use side_colours::SideColours;

/// Half the logarithm of the ratio of two sides that tells them apart: six percent. A tenth of
/// the true edges of photographs differ by less, half of the joints of boards by a quarter of it.
const CLEAR_CONTRAST: f64 = 0.03;
/// Views that show an edge at which this is no longer rare; 3 do nearly as well.
const CLEAR_VIEWS: f64 = 4.0;
/// Where so many views ought to show an edge, some do by chance; 20 and 40 are a little worse.
const MANY_VIEWS: f64 = 30.0;
/// Samples of so many bytes are in memory at once; what takes more is taken in turns, for each of
/// which the images are read again.
const SAMPLED_AT_ONCE: usize = 256 << 20;

/// The probabilities of the kinds of every edge.
///
/// - `wireframe`: valid, in the world of the cameras, with edges cut where others meet them.
/// - `scene`: images and cameras; one image at a time is in memory.
/// - `edges`: what [`assess`](crate::confidence::assess) says of each, in the same order.
/// - `min_structure`: what is structure with less than this probability is no edge that others meet.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// If an image cannot be read.
pub fn edge_kinds(
    wireframe: &Wireframe3d,
    scene: &Scene,
    edges: &[EdgeConfidence],
    min_structure: f64,
) -> Result<Vec<EdgeKinds>, SceneError> {
    let _span = tracing::debug_span!("edge_kinds", edges = wireframe.edges.len()).entered();
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let segments = wireframe.segments();
    let frames: Vec<Option<EdgeFrame>> = (segments.par_iter().zip(edges))
        .map(|(segment, edge)| EdgeFrame::new(*segment, &edge.showing_views, &cameras))
        .collect();
    let directions: Vec<Option<Vector3<f64>>> = (segments.iter())
        .map(|segment| (segment.end - segment.start).try_normalize(0.0))
        .collect();
    let leaving = leaves_plane(wireframe, &directions);
    let mut witnesses = Vec::with_capacity(frames.len());
    while witnesses.len() < frames.len() {
        let first = witnesses.len();
        let (frames, leaving) = (&frames[first..], &leaving[first..]);
        let count = so_many_at_once(frames, SAMPLED_AT_ONCE);
        let samples = edge_samples(&frames[..count], scene)?;
        let of_edges = frames.par_iter().zip(leaving).zip(samples);
        witnesses.par_extend(
            of_edges
                .map(|((frame, leaving), samples)| of_images(frame.as_ref(), *leaving, &samples)),
        );
    }
    let mut kinds = with_rarity(wireframe, edges, &witnesses, min_structure);
    take_after_neighbours(wireframe, edges, &mut kinds);
    Ok(kinds)
}

/// What edges are by all witnesses. Others end where an edge does only if they are structure
/// themselves, so those that are not are left out, until nothing changes.
fn with_rarity(
    wireframe: &Wireframe3d,
    edges: &[EdgeConfidence],
    witnesses: &[Witnesses],
    min_structure: f64,
) -> Vec<EdgeKinds> {
    let mut is_there = vec![true; witnesses.len()];
    loop {
        let free = free_ends(wireframe, &is_there);
        let kinds: Vec<EdgeKinds> = (witnesses.iter().zip(edges).zip(free))
            .map(|((known, edge), free)| {
                let rarity = rarity(edge, free);
                Witnesses { rarity, ..*known }.kinds()
            })
            .collect();
        let stays = |(kinds, is_there): (&EdgeKinds, &bool)| {
            *is_there && kinds.structure() >= min_structure
        };
        let staying: Vec<bool> = kinds.iter().zip(&is_there).map(stays).collect();
        if staying == is_there {
            return kinds;
        }
        is_there = staying;
    }
}

/// An edge that no view shows was asked for by those that it joins, as the end of a slab: it is no
/// more structure than they are, at each end the one that most likely is.
fn take_after_neighbours(
    wireframe: &Wireframe3d,
    edges: &[EdgeConfidence],
    kinds: &mut [EdgeKinds],
) {
    let is_shown = |edge: usize| !edges[edge].showing_views.is_empty();
    let mut best: Vec<Option<EdgeKinds>> = vec![None; wireframe.junctions.len()];
    for (edge, ends) in wireframe.edges.iter().enumerate() {
        for end in ends.iter().filter(|_| is_shown(edge)) {
            let is_better = |of: EdgeKinds| kinds[edge].structure() > of.structure();
            if best[*end].is_none_or(is_better) {
                best[*end] = Some(kinds[edge]);
            }
        }
    }
    for (edge, ends) in wireframe.edges.iter().enumerate() {
        for of_end in ends.iter().filter_map(|end| best[*end]) {
            if !is_shown(edge) && of_end.structure() < kinds[edge].structure() {
                kinds[edge] = of_end;
            }
        }
    }
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

/// From 0 to 1: few show the edge of many views that ought to. Lines that are none are found
/// where two views agree by chance, and pairs of views are as the square of their number. Edges
/// deep in pockets are rare, too, but others meet them: of what any view shows the share of its
/// ends that are `free` counts.
fn rarity(edge: &EdgeConfidence, free: f64) -> f64 {
    let shown = edge.showing_views.len() as f64;
    let many = (edge.expected_views as f64 / MANY_VIEWS).min(1.0);
    let rare = (-shown / CLEAR_VIEWS).exp() * many * many;
    if shown > 0.0 { free * rare } else { rare }
}

/// What the images say, and whether the neighbours are `leaving` the plane of the edge.
fn of_images(frame: Option<&EdgeFrame>, leaving: f64, samples: &[ViewSamples]) -> Witnesses {
    let mut witnesses = Witnesses {
        leaves_plane: leaving,
        ..Witnesses::default()
    };
    let Some(frame) = frame else {
        return witnesses;
    };
    witnesses.coplanarity = coplanarity(frame, samples);
    if let Some(colours) = SideColours::new(samples) {
        witnesses.chroma = colours.chroma;
        witnesses.step = colours.step;
        witnesses.instability = colours.instability;
        witnesses.evenness = (-(colours.contrast / CLEAR_CONTRAST).powi(2)).exp();
        witnesses.darkness = colours.darkness;
    }
    witnesses
}
