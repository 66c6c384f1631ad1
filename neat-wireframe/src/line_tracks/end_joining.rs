//! Ends of tracks that become one junction.

use super::clustering::Track;
use super::junction_graph;
use super::view_segments::TrackView;
use nalgebra::{Matrix3, Vector3};

/// The two ends of every track: end `2 t + s` is side s of track t.
pub(super) struct TrackEnds<'a> {
    tracks: &'a [Track],
    /// Where the ends are.
    pub positions: Vec<Vector3<f64>>,
    /// Unit directions of the lines.
    pub directions: Vec<Vector3<f64>>,
    /// Length of a pixel at the end, in the world.
    pub pixel_sizes: Vec<f64>,
}

impl<'a> TrackEnds<'a> {
    pub(super) fn new(views: &[TrackView], tracks: &'a [Track]) -> Self {
        let mut ends = Self {
            tracks,
            positions: Vec::new(),
            directions: Vec::new(),
            pixel_sizes: Vec::new(),
        };
        for track in tracks {
            let direction = (track.line.end - track.line.start).normalize();
            for position in track.line.ends() {
                let mut sizes: Vec<f64> = track
                    .members
                    .iter()
                    .map(|id| views[id.view].pixel_size_at(&position))
                    .collect();
                sizes.sort_by(f64::total_cmp);
                ends.positions.push(position);
                ends.directions.push(direction);
                ends.pixel_sizes.push(sizes[sizes.len() / 2]);
            }
        }
        ends
    }

    pub(super) fn length(&self, end: usize) -> f64 {
        self.tracks[end / 2].line.length()
    }
}

/// Clusters of ends that grow by joining.
pub(super) struct Joining<'a> {
    ends: &'a TrackEnds<'a>,
    cluster_of: Vec<usize>,
    /// Members of each cluster, ascending, and its position.
    clusters: Vec<(Vec<usize>, Vector3<f64>)>,
}

impl<'a> Joining<'a> {
    pub(super) fn new(ends: &'a TrackEnds<'a>) -> Self {
        Self {
            ends,
            cluster_of: (0..ends.positions.len()).collect(),
            clusters: ends
                .positions
                .iter()
                .enumerate()
                .map(|(end, position)| (vec![end], *position))
                .collect(),
        }
    }

    /// Joins the clusters of two ends, if one point fits all their lines without
    /// moving any end by more than `max_shift_in_pixels` or its share.
    pub(super) fn join(&mut self, a: usize, b: usize, max_shift_in_pixels: f64) {
        let [a, b] = [self.cluster_of[a], self.cluster_of[b]];
        if a == b {
            return;
        }
        let mut members = [self.clusters[a].0.as_slice(), &self.clusters[b].0].concat();
        members.sort_unstable();
        if members.windows(2).any(|pair| pair[0] / 2 == pair[1] / 2) {
            return;
        }
        let Some(position) = self.meeting_point(&members) else {
            return;
        };
        if !members
            .iter()
            .all(|end| self.fits(*end, &position, max_shift_in_pixels))
        {
            return;
        }
        for end in &members {
            self.cluster_of[*end] = a;
        }
        self.clusters[a] = (members, position);
        self.clusters[b].0.clear();
    }

    /// The point nearest to all lines; along lines that are all but parallel it
    /// stays near the ends.
    fn meeting_point(&self, members: &[usize]) -> Option<Vector3<f64>> {
        /// Weight of an end's own position along its line.
        const ALONG: f64 = 1e-2;
        let mut matrix = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for &end in members {
            let direction = self.ends.directions[end];
            let along = direction * direction.transpose();
            let weight = self.ends.pixel_sizes[end].powi(-2);
            let block = (Matrix3::identity() - along + ALONG * along) * weight;
            matrix += block;
            right += block * self.ends.positions[end];
        }
        matrix.cholesky().map(|factor| factor.solve(&right))
    }

    fn fits(&self, end: usize, position: &Vector3<f64>, max_shift_in_pixels: f64) -> bool {
        let offset = position - self.ends.positions[end];
        let along = offset.dot(&self.ends.directions[end]);
        let across = (offset - along * self.ends.directions[end]).norm();
        let pixel = self.ends.pixel_sizes[end];
        let attach = 2.0 * junction_graph::ATTACH_IN_PIXELS;
        let shift = (junction_graph::MAX_RELATIVE_SHIFT * self.ends.length(end))
            .min(attach.min(max_shift_in_pixels) * pixel);
        across <= junction_graph::MAX_LINE_DISTANCE_IN_PIXELS * pixel && along.abs() <= shift
    }

    /// The positions of all clusters and the cluster of every end.
    pub(super) fn junctions(self) -> (Vec<Vector3<f64>>, Vec<usize>) {
        let mut new_index = vec![0; self.clusters.len()];
        let mut junctions = Vec::new();
        for (cluster, (members, position)) in self.clusters.iter().enumerate() {
            if !members.is_empty() {
                new_index[cluster] = junctions.len();
                junctions.push(*position);
            }
        }
        let of_end = self.cluster_of.iter().map(|c| new_index[*c]).collect();
        (junctions, of_end)
    }
}
