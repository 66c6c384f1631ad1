//! Tracks: the 2D segments of several views that show one 3D segment.
//!
//! Connected components of the mutual agreements alone would drift from line to
//! line, so tracks grow from their best member, and every further one must lie
//! on the track's own line.

use super::consensus::Consensus;
use super::line_refinement::{LineRefinementConfig, covered_parts, refine_line, shown_interval};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView, segment_of};
use neat_core::LineSegment3;
use std::collections::BTreeSet;

/// Both ends of a member lie within this distance of the projected line.
const TOLERANCE_IN_PIXELS: f64 = 2.0;
/// A member shows at least this share of the shorter of itself and the track.
const MIN_OVERLAP: f64 = 0.3;
/// Sine of the angle between a member and the projected line at most.
const MAX_SINE: f64 = 0.15;

/// A 3D segment and the 2D segments that show it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track {
    /// Where it is, in the world whose scene ball has radius 1.
    pub line: LineSegment3,
    /// Its members, ascending.
    pub members: Vec<SegmentId>,
}

impl Track {
    /// Number of different views among the members.
    pub(super) fn view_count(&self) -> usize {
        view_count(&self.members)
    }
}

/// Number of different views among ascending ids.
pub(super) fn view_count(members: &[SegmentId]) -> usize {
    members.chunk_by(|a, b| a.view == b.view).count()
}

/// Grows tracks of at least `min_views` views; every segment belongs to one at
/// most.
pub(super) fn grow_tracks(
    views: &[TrackView],
    consensus: &[Vec<Option<Consensus>>],
    min_views: usize,
    refinement: &LineRefinementConfig,
) -> Vec<Track> {
    let links = symmetric_links(views, consensus);
    let mut seeds: Vec<(f64, SegmentId)> = Vec::new();
    for (view, choices) in consensus.iter().enumerate() {
        for (segment, choice) in choices.iter().enumerate() {
            if let Some(choice) = choice {
                seeds.push((choice.score, SegmentId { view, segment }));
            }
        }
    }
    seeds.sort_by(|(a, i), (b, j)| b.total_cmp(a).then(i.cmp(j)));

    let mut free: Vec<Vec<bool>> = views.iter().map(|v| vec![true; v.segments.len()]).collect();
    let mut tracks = Vec::new();
    for (_, seed) in seeds {
        if !free[seed.view][seed.segment] {
            continue;
        }
        let Some(choice) = &consensus[seed.view][seed.segment] else {
            continue;
        };
        let mut line = views[seed.view].back_project(seed.segment, choice.hypothesis.depths);
        let mut members = vec![seed];
        // Once on the seed's line, once on the line of all.
        for _ in 0..2 {
            members = grow(views, &links, &free, seed, &line);
            if view_count(&members) < min_views {
                break;
            }
            line = refine_line(views, &members, &line, refinement);
        }
        for (line, members) in split_by_cover(views, &members, &line, min_views, refinement) {
            for id in &members {
                free[id.view][id.segment] = false;
            }
            tracks.push(Track { line, members });
        }
    }
    tracks
}

/// Every segment's partners and those that have it as a partner, ascending.
fn symmetric_links(
    views: &[TrackView],
    consensus: &[Vec<Option<Consensus>>],
) -> Vec<Vec<Vec<SegmentId>>> {
    let mut links: Vec<Vec<Vec<SegmentId>>> = views
        .iter()
        .map(|view| vec![Vec::new(); view.segments.len()])
        .collect();
    for (view, choices) in consensus.iter().enumerate() {
        for (segment, choice) in choices.iter().enumerate() {
            let id = SegmentId { view, segment };
            for partner in choice.iter().flat_map(|choice| &choice.partners) {
                links[view][segment].push(*partner);
                links[partner.view][partner.segment].push(id);
            }
        }
    }
    for list in links.iter_mut().flatten() {
        list.sort_unstable();
        list.dedup();
    }
    links
}

/// The free segments on `line` that links lead to from the seed, ascending.
fn grow(
    views: &[TrackView],
    links: &[Vec<Vec<SegmentId>>],
    free: &[Vec<bool>],
    seed: SegmentId,
    line: &LineSegment3,
) -> Vec<SegmentId> {
    let mut seen = BTreeSet::from([seed]);
    let mut members = vec![seed];
    let mut next = 0;
    while let Some(member) = members.get(next).copied() {
        next += 1;
        for &partner in &links[member.view][member.segment] {
            if free[partner.view][partner.segment]
                && !seen.contains(&partner)
                && lies_on(views, partner, line)
            {
                seen.insert(partner);
                members.push(partner);
            }
        }
    }
    seen.into_iter().collect()
}

/// Whether a 2D segment shows a part of a 3D segment.
pub(super) fn lies_on(views: &[TrackView], id: SegmentId, line: &LineSegment3) -> bool {
    let segment = &segment_of(views, id).segment;
    let Some(projected) = ProjectedLine::new(&views[id.view].camera, line) else {
        return false;
    };
    let [start, end] = segment.ends().map(|end| projected.distance(&end));
    let near = start.abs().max(end.abs()) <= TOLERANCE_IN_PIXELS
        && (start - end).abs() <= MAX_SINE * segment.length();
    near && shown_interval(views, id, line).is_some_and(|[low, high]| {
        let common = high.min(1.0) - low.max(0.0);
        common >= MIN_OVERLAP * (high - low).min(1.0)
    })
}

/// Cuts a track where too few views show it; parts of too few views disappear.
pub(super) fn split_by_cover(
    views: &[TrackView],
    members: &[SegmentId],
    line: &LineSegment3,
    min_views: usize,
    refinement: &LineRefinementConfig,
) -> Vec<(LineSegment3, Vec<SegmentId>)> {
    if view_count(members) < min_views {
        return Vec::new();
    }
    let mut free: Vec<SegmentId> = members.to_vec();
    let mut parts = Vec::new();
    for [low, high] in covered_parts(views, members, line, refinement) {
        let belongs = |id: &SegmentId| {
            shown_interval(views, *id, line).is_some_and(|[a, b]| {
                // More of it within this part than outside.
                b.min(high) - a.max(low) > 0.5 * (b - a).min(high - low)
            })
        };
        let (inside, outside): (Vec<_>, Vec<_>) = free.into_iter().partition(belongs);
        free = outside;
        if view_count(&inside) >= min_views {
            parts.push((
                LineSegment3::new(line.point_at(low), line.point_at(high)),
                inside,
            ));
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::consensus::find_consensus;
    use crate::line_tracks::hypothesis_scoring::{Scoring, score_hypotheses};
    use crate::line_tracks::neighbours::neighbours;
    use crate::line_tracks::test_tracks::{cube_edge, cube_views, end_distance};

    #[test]
    fn matching_consensus_and_growth_find_the_edges_of_a_cube() {
        let views = cube_views(20);
        let neighbours = neighbours(&views, 1.2, 10);
        let alternatives = score_hypotheses(&views, &neighbours, &[], 1.2, 3, &Scoring::default());
        let consensus = find_consensus(&views, &alternatives, 3);
        // The choice of nearly every segment is the true one.
        let mut right = 0;
        for (view, choices) in consensus.iter().enumerate() {
            for (segment, choice) in choices.iter().enumerate() {
                let Some(choice) = choice else {
                    continue;
                };
                let found = views[view].back_project(segment, choice.hypothesis.depths);
                right += usize::from(end_distance(&found, &cube_edge(segment)) < 1e-3);
                assert!(choice.partners.len() >= 2);
            }
        }
        assert!(right >= 220, "{right} of 240");
        let refinement = LineRefinementConfig::default();
        let tracks = grow_tracks(&views, &consensus, 3, &refinement);
        for edge in 0..12 {
            let found = tracks
                .iter()
                .find(|track| end_distance(&track.line, &cube_edge(edge)) < 1e-3)
                .unwrap_or_else(|| panic!("edge {edge} has no track"));
            assert!(found.view_count() >= 15);
            assert!(found.members.iter().all(|id| id.segment == edge));
        }
    }

    #[test]
    fn segments_beside_or_beyond_a_line_do_not_lie_on_it() {
        let views = cube_views(3);
        let id = SegmentId {
            view: 0,
            segment: 4,
        };
        let truth = cube_edge(4);
        assert!(lies_on(&views, id, &truth));
        let beside = truth.map(|end| end + nalgebra::Vector3::repeat(0.03));
        assert!(!lies_on(&views, id, &beside));
        let beyond = LineSegment3::new(truth.point_at(1.1), truth.point_at(2.0));
        assert!(!lies_on(&views, id, &beyond));
    }
}
