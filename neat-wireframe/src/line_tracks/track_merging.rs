//! Merges tracks that show the same 3D segment, and gathers the 2D segments
//! that no track has claimed yet.
//!
//! Close parallel edges, such as those of a window frame, are told apart by the
//! images: views that show both next to each other forbid the merge.

use super::clustering::{Track, lies_on, split_by_cover};
use super::line_refinement::{LineRefinementConfig, refine_line, shown_interval};
use super::projected_line::ProjectedLine;
use super::view_segments::{SegmentId, TrackView, segment_of};
use crate::projection::project_in_front;
use neat_core::{LineSegment2, LineSegment3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Tracks are one if the members of each lie this near, in the mean, to the
/// projected line of the other.
const MAX_DISTANCE_IN_PIXELS: f64 = 1.5;
/// The same for tracks that no view shows next to each other.
const MAX_EXCLUSIVE_DISTANCE_IN_PIXELS: f64 = 3.0;
/// Views that show both next to each other forbid the merge if they are at
/// least this share of the views of the track that fewer show …
const MIN_SEPARATE_SHARE: f64 = 0.34;
/// … and the two lie this far apart there.
const SEPARATE_IN_PIXELS: f64 = 1.2;

/// Tracks of the same 3D segment are parallel within about 18 degrees: short ones
/// have no better direction.
const MIN_PARALLEL_COSINE: f64 = 0.95;

/// For each segment of each view the track it belongs to.
pub(super) type TrackOfSegment = Vec<Vec<Option<usize>>>;

/// The inverse of the tracks' member lists.
pub(super) fn tracks_of_segments(views: &[TrackView], tracks: &[Track]) -> TrackOfSegment {
    let mut track_of: TrackOfSegment = views
        .iter()
        .map(|view| vec![None; view.segments.len()])
        .collect();
    for (track, members) in tracks.iter().enumerate() {
        for id in &members.members {
            track_of[id.view][id.segment] = Some(track);
        }
    }
    track_of
}

/// The projection of a 3D segment, `None` unless it lies in front of the camera.
pub(super) fn project_segment(view: &TrackView, line: &LineSegment3) -> Option<LineSegment2> {
    Some(LineSegment2::new(
        project_in_front(&view.camera, &line.start)?,
        project_in_front(&view.camera, &line.end)?,
    ))
}

/// Adds to every track the unclaimed 2D segments that lie on it, in any view,
/// and refines it. Tracks of more views choose first.
pub(super) fn gather_unclaimed(
    views: &[TrackView],
    tracks: Vec<Track>,
    min_views: usize,
    refinement: &LineRefinementConfig,
) -> Vec<Track> {
    let track_of = tracks_of_segments(views, &tracks);
    let wanted: Vec<Vec<SegmentId>> = tracks
        .par_iter()
        .map(|track| {
            let mut wanted = Vec::new();
            for (view, prepared) in views.iter().enumerate() {
                let Some(projected) = project_segment(prepared, &track.line) else {
                    continue;
                };
                wanted.extend(
                    prepared
                        .index
                        .near(&projected)
                        .into_iter()
                        .map(|segment| SegmentId { view, segment })
                        .filter(|id| track_of[id.view][id.segment].is_none())
                        .filter(|id| lies_on(views, *id, &track.line)),
                );
            }
            wanted
        })
        .collect();
    let mut order: Vec<usize> = (0..tracks.len()).collect();
    order.sort_by_key(|track| std::cmp::Reverse(tracks[*track].view_count()));
    let mut claimed = track_of;
    let mut members: Vec<Vec<SegmentId>> = tracks.iter().map(|t| t.members.clone()).collect();
    for track in order {
        for id in &wanted[track] {
            let owner = &mut claimed[id.view][id.segment];
            if owner.is_none() {
                *owner = Some(track);
                members[track].push(*id);
            }
        }
        members[track].sort_unstable();
    }
    let grown: Vec<Track> = tracks
        .into_iter()
        .zip(members)
        .map(|(track, members)| Track {
            line: track.line,
            members,
        })
        .collect();
    refine_all(views, grown, min_views, refinement)
}

/// Merges duplicates until none is left.
pub(super) fn merge_duplicates(
    views: &[TrackView],
    mut tracks: Vec<Track>,
    min_views: usize,
    refinement: &LineRefinementConfig,
) -> Vec<Track> {
    // Every round merges disjoint pairs; chains need a few.
    for _ in 0..8 {
        let mut pairs = duplicate_pairs(views, &tracks);
        if pairs.is_empty() {
            break;
        }
        pairs.sort_by(|(d, a), (e, b)| d.total_cmp(e).then(a.cmp(b)));
        let mut taken = vec![false; tracks.len()];
        let mut merged = Vec::new();
        for (_, [a, b]) in pairs {
            if taken[a] || taken[b] {
                continue;
            }
            taken[a] = true;
            taken[b] = true;
            let mut members = tracks[a].members.clone();
            members.extend(&tracks[b].members);
            members.sort_unstable();
            merged.push(Track {
                line: longer(&tracks[a].line, &tracks[b].line),
                members,
            });
        }
        let rest = tracks
            .into_iter()
            .zip(&taken)
            .filter(|(_, taken)| !**taken)
            .map(|(track, _)| track);
        let merged = refine_all(views, merged, min_views, refinement);
        tracks = rest.chain(merged).collect();
    }
    tracks
}

fn longer(a: &LineSegment3, b: &LineSegment3) -> LineSegment3 {
    if b.length() > a.length() { *b } else { *a }
}

/// Refines the lines and cuts them by their cover.
fn refine_all(
    views: &[TrackView],
    tracks: Vec<Track>,
    min_views: usize,
    refinement: &LineRefinementConfig,
) -> Vec<Track> {
    let parts: Vec<Vec<Track>> = tracks
        .into_par_iter()
        .map(|track| {
            let line = refine_line(views, &track.members, &track.line, refinement);
            split_by_cover(views, &track.members, &line, min_views, refinement)
                .into_iter()
                .map(|(line, members)| Track { line, members })
                .collect()
        })
        .collect();
    parts.into_iter().flatten().collect()
}

/// Pairs of tracks that show the same, with their mean distance in pixels.
fn duplicate_pairs(views: &[TrackView], tracks: &[Track]) -> Vec<(f64, [usize; 2])> {
    let track_of = tracks_of_segments(views, tracks);
    let found: Vec<Vec<(f64, [usize; 2])>> = tracks
        .par_iter()
        .enumerate()
        .map(|(a, track)| {
            near_tracks(views, track, &track_of)
                .into_iter()
                .filter(|b| a < *b)
                .filter_map(|b| {
                    let distance = mutual_distance(views, track, &tracks[b])?;
                    let separate = separate_views(views, track, &tracks[b]);
                    let fewer = track.view_count().min(tracks[b].view_count());
                    let same = if separate == 0 {
                        distance <= MAX_EXCLUSIVE_DISTANCE_IN_PIXELS
                    } else {
                        distance <= MAX_DISTANCE_IN_PIXELS
                            && (separate as f64) < MIN_SEPARATE_SHARE * fewer as f64
                    };
                    same.then_some((distance, [a, b]))
                })
                .collect()
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// The tracks that have a member near the track's projection in any view,
/// ascending: two halves of one track may have no view in common.
fn near_tracks(views: &[TrackView], track: &Track, track_of: &TrackOfSegment) -> Vec<usize> {
    let mut near = Vec::new();
    for (view, track_of) in views.iter().zip(track_of) {
        if let Some(projected) = project_segment(view, &track.line) {
            let segments = view.index.near(&projected);
            near.extend(segments.into_iter().filter_map(|segment| track_of[segment]));
        }
    }
    near.sort_unstable();
    near.dedup();
    near
}

/// Mean distance of each track's ends from the other's line, in the images of
/// all members' views, if both means are small and the tracks touch.
fn mutual_distance(views: &[TrackView], a: &Track, b: &Track) -> Option<f64> {
    let [first, second] = [a, b].map(|track| (track.line.end - track.line.start).normalize());
    let parallel = first.dot(&second).abs() > MIN_PARALLEL_COSINE;
    if !parallel {
        return None;
    }
    let farthest = MAX_DISTANCE_IN_PIXELS.max(MAX_EXCLUSIVE_DISTANCE_IN_PIXELS);
    let mut worst = 0.0_f64;
    for (fixed, other) in [(a, b), (b, a)] {
        // Only the part of the other that lies along this one.
        let part = overlapping_part(&fixed.line, &other.line)?;
        let (mut sum, mut count) = (0.0, 0.0);
        for id in other.members.iter().chain(&fixed.members) {
            let view = &views[id.view];
            let line = ProjectedLine::new(&view.camera, &fixed.line);
            if let (Some(line), Some(part)) = (line, project_segment(view, &part)) {
                let distance = line.segment_distance(&part);
                // So far off that the mean cannot be small: most pairs end here.
                if count == 0.0 && distance > 4.0 * farthest {
                    return None;
                }
                sum += distance;
                count += 1.0;
            }
        }
        if count == 0.0 {
            return None;
        }
        worst = worst.max(sum / count);
    }
    (worst <= farthest).then_some(worst)
}

/// The part of `other` that lies along `line`; `None` if there is none.
fn overlapping_part(line: &LineSegment3, other: &LineSegment3) -> Option<LineSegment3> {
    let [s, e] = [
        other.line_parameter(&line.start),
        other.line_parameter(&line.end),
    ];
    let (low, high) = (s.min(e).max(0.0), s.max(e).min(1.0));
    (low < high).then(|| LineSegment3::new(other.point_at(low), other.point_at(high)))
}

/// The number of views that show members of both tracks side by side.
fn separate_views(views: &[TrackView], a: &Track, b: &Track) -> usize {
    let mut by_view: BTreeMap<usize, [Vec<SegmentId>; 2]> = BTreeMap::new();
    for (side, track) in [a, b].into_iter().enumerate() {
        for id in &track.members {
            by_view.entry(id.view).or_default()[side].push(*id);
        }
    }
    by_view
        .values()
        .filter(|[of_a, of_b]| {
            of_a.iter()
                .any(|p| of_b.iter().any(|q| side_by_side(views, *p, *q, &a.line)))
        })
        .count()
}

/// Whether two segments of one view run along the same part of a line, apart.
fn side_by_side(views: &[TrackView], p: SegmentId, q: SegmentId, line: &LineSegment3) -> bool {
    let intervals = Option::zip(
        shown_interval(views, p, line),
        shown_interval(views, q, line),
    );
    let Some(([a, b], [c, d])) = intervals else {
        return false;
    };
    if b.min(d) - a.max(c) < 0.5 * (b - a).min(d - c) {
        return false;
    }
    let [p, q] = [p, q].map(|id| segment_of(views, id).segment);
    // Of the shorter's middle from the longer's line.
    let (short, long) = if p.length() < q.length() {
        (p, q)
    } else {
        (q, p)
    };
    let middle = short.point_at(0.5);
    let foot = long.point_at(long.line_parameter(&middle));
    (middle - foot).norm() > SEPARATE_IN_PIXELS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_tracks::test_tracks::{cube_edge, cube_tracks, cube_views, end_distance};

    #[test]
    fn halves_of_a_track_become_one_and_different_edges_stay() {
        let views = cube_views(12);
        let mut tracks = cube_tracks(&views);
        let members = tracks[5].members.split_off(6);
        let line = tracks[5]
            .line
            .map(|end| end + nalgebra::Vector3::repeat(5e-4));
        tracks.push(Track { line, members });
        let merged = merge_duplicates(&views, tracks, 3, &LineRefinementConfig::default());
        assert_eq!(merged.len(), 12);
        for edge in 0..12 {
            let of_edge: Vec<_> = merged
                .iter()
                .filter(|track| end_distance(&track.line, &cube_edge(edge)) < 1e-3)
                .collect();
            assert_eq!(of_edge.len(), 1);
            assert_eq!(of_edge[0].view_count(), 12);
        }
    }

    #[test]
    fn close_parallel_edges_that_views_show_side_by_side_stay_apart() {
        use crate::ViewObservation;
        use crate::test_scenes::{cameras_on_sphere, views_of_edges};
        use nalgebra::Vector3;
        // 0.012 apart: 3 to 4 pixels.
        let junctions = [-0.006, 0.006].map(|z| [-0.4, 0.4].map(|x| Vector3::new(x, 0.0, z)));
        let junctions: Vec<_> = junctions.into_iter().flatten().collect();
        let observations: Vec<ViewObservation> =
            views_of_edges(&cameras_on_sphere(12), &junctions, &[[0, 1], [2, 3]]);
        let views: Vec<_> = observations
            .iter()
            .map(|observation| TrackView::new(observation, 1.0, 1.0))
            .collect();
        let tracks: Vec<Track> = (0..2)
            .map(|segment| Track {
                line: LineSegment3::new(junctions[2 * segment], junctions[2 * segment + 1]),
                members: (0..12).map(|view| SegmentId { view, segment }).collect(),
            })
            .collect();
        let merged = merge_duplicates(&views, tracks, 3, &LineRefinementConfig::default());
        assert_eq!(merged.len(), 2);
    }

    #[test]
    fn unclaimed_segments_join_the_track_that_they_lie_on() {
        let views = cube_views(12);
        let mut tracks = cube_tracks(&views);
        for track in &mut tracks {
            track.members.truncate(5);
        }
        let gathered = gather_unclaimed(&views, tracks, 3, &LineRefinementConfig::default());
        assert!(gathered.iter().all(|track| track.view_count() >= 11));
    }
}
