//! Depths that edgels of all views vote for: each view for those at which it shows enough of an edge.

use super::curves::BESIDE_IN_PIXELS;
use super::edge_samples::Images;
use crate::statistics::upper_median;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

/// Edgels are proposals for so many depths at most: those for which most of them speak.
const MAX_DEPTHS: usize = 4;
/// Nothing is larger than the largest image, in pixels.
const MAX_SPAN: f64 = 1e5;
/// Whole projections of edges by which edgels of all views have to speak for a depth, beyond those
/// that do for any.
const MIN_VOTES: f64 = 1.5;
/// A view shows parts of an edge at a depth from this share on.
const MIN_SHARE: f64 = 0.4;
/// Edges have more edgels than this, in pixels: one alone says nothing.
const MIN_PIXELS: f64 = 6.0;

/// An edgel that nothing has.
pub(super) struct FreeEdgel {
    pub ray: Vector3<f64>,
    /// Unit normal of the plane that its tangent and the camera's centre span.
    pub plane_normal: Vector3<f64>,
}

/// Those of each view.
pub(super) fn free_edgels(images: &Images, taken: &[Vec<bool>]) -> Vec<Vec<FreeEdgel>> {
    let of_view = |view: usize| {
        let (camera, map) = (&images.views[view].camera, &images.maps[view]);
        let free = (0..map.len()).filter(|edgel| !taken[view][*edgel]);
        let with_rays = free.filter_map(|edgel| {
            let edgel = map.get(edgel);
            let pixel: Vector2<f64> = edgel.position.cast();
            let along = Vector2::new(-edgel.normal.y, edgel.normal.x).cast();
            let [ray, beside] = [pixel, pixel + along].map(|p| camera.ray_through(&p).direction);
            Some(FreeEdgel {
                ray,
                plane_normal: ray.cross(&beside).try_normalize(0.0)?,
            })
        });
        with_rays.collect()
    };
    (0..images.views.len())
        .into_par_iter()
        .map(of_view)
        .collect()
}

/// Votes by depth, in pixels, for edges that move together.
pub(super) struct DepthVotes {
    /// The depth where the first bin begins.
    first: f64,
    votes: Vec<f64>,
    /// What one view shows of each edge at each depth.
    shares: Vec<f64>,
}

impl DepthVotes {
    /// For so many edges, between two depths.
    pub(super) fn new([low, high]: [f64; 2], edges: usize) -> Self {
        let count = (high - low).min(MAX_SPAN).ceil() as usize + 5;
        Self {
            first: low.floor() - 2.0,
            votes: vec![0.0; count],
            shares: vec![0.0; edges * count],
        }
    }

    /// An edgel of the view at hand is one of an edge that has so many pixels, at a depth.
    pub(super) fn add(&mut self, edge: usize, depth: f64, pixels: f64) {
        let (bin, count) = (depth - self.first, self.votes.len());
        if (0.0..count as f64).contains(&bin) {
            self.shares[edge * count + bin as usize] += pixels.max(MIN_PIXELS).recip();
        }
    }

    /// That were all edgels of a view.
    pub(super) fn end_view(&mut self) {
        let count = self.votes.len();
        for shares in self.shares.chunks_exact(count) {
            for k in 1..count - 1 {
                let share: f64 = shares[k - 1..=k + 1].iter().sum();
                if share > MIN_SHARE {
                    self.votes[k] += share.min(1.0);
                }
            }
        }
        self.shares.fill(0.0);
    }

    /// The depths for which most edgels speak.
    pub(super) fn peaks(&self) -> Vec<f64> {
        let votes = &self.votes;
        let usual = upper_median(&mut votes.clone());
        let depth = |bin: usize| self.first + bin as f64 + 0.5;
        let is_peak = |k: &usize| {
            votes[*k] - usual >= MIN_VOTES
                && votes[*k] >= votes[k - 1]
                && votes[*k] > votes[k + 1]
                && depth(*k).abs() > BESIDE_IN_PIXELS
        };
        let mut peaks: Vec<usize> = (1..votes.len() - 1).filter(is_peak).collect();
        peaks.sort_by(|a, b| votes[*b].total_cmp(&votes[*a]));
        peaks.truncate(MAX_DEPTHS);
        peaks.into_iter().map(depth).collect()
    }
}
