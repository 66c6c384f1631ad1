//! An edgel belongs to one line or curve: what is chosen takes those beside it.

use super::edge_samples::{Images, Sample, project_segment};
use neat_core::{EdgelMap, LineSegment3};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// A line has the edgels beside it whose normals have this cosine to its own …
const CLAIM_COSINE: f64 = 0.8;
/// … at so many samples for each of its pixels.
pub(super) const CLAIM_DENSITY: f64 = 2.0;

/// Takes the edgels beside a line, in all views: where something hides the middle of an edge,
/// its ends are still its own.
pub(super) fn claim_edgels(images: &Images, line: &LineSegment3, taken: &mut [Vec<bool>]) {
    claim_edgels_of(images, |_| Some(*line), taken);
}

/// Likewise, of what is the line `in_view` in each view.
pub(super) fn claim_edgels_of(
    images: &Images,
    in_view: impl Fn(usize) -> Option<LineSegment3> + Sync,
    taken: &mut [Vec<bool>],
) {
    let views = images.views.par_iter().zip(images.maps).zip(taken);
    views
        .enumerate()
        .for_each(|(view, ((prepared, map), taken))| {
            let Some(line) = in_view(view) else {
                return;
            };
            let Some(projected) = project_segment(prepared, &line) else {
                return;
            };
            let count = (CLAIM_DENSITY * projected.length())
                .ceil()
                .clamp(8.0, 4000.0);
            let Some(samples) = images.samples(view, &line, [0.0, 1.0], Some(count as usize))
            else {
                return;
            };
            take_beside(map, &samples, images.reach, taken);
        });
}

/// Takes the edgels of a view beside samples of a line or a curve.
pub(super) fn take_beside(map: &EdgelMap, samples: &[Sample], reach: f64, taken: &mut [bool]) {
    for Sample { pixel, normal, .. } in samples {
        map.visit(pixel, normal, reach, CLAIM_COSINE, |_, edgel| {
            taken[edgel] = true;
            ControlFlow::Continue(())
        });
    }
}
