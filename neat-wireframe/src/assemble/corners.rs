//! Corners: where the ends of lines meet in space.
//!
//! Ends are joined where one point lies on all their lines, as well as these are known, and
//! near their ends, which edgels tell less well than the lines. The nearest go first.

use super::arc_joints::rounds;
use super::circle_fitting::FoundArc;
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use super::rounded_corners::MIN_SHORT_IN_PIXELS;
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Vector3};
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Lines meet where so many reaches lie between them at most. More bend lines to corners that
/// are not theirs; 1.25 lose corners of parts.
pub(super) const MAX_GAP: f64 = 2.0;
/// An end may be off along its line by so many pixels, since corners are round and hidden;
/// with 8 or 24 F1 of photographs with truth is the same …
pub(super) const WINDOW_IN_PIXELS: f64 = 16.0;
/// … or by this share of the line, whose ends grow uncertain with its depth …
const WINDOW_SHARE: f64 = 0.1;
/// … but never by so much of it that its other end would be meant.
pub(super) const MAX_WINDOW_SHARE: f64 = 0.4;
/// The edgels of edges nearer to each other are neither the one's nor the other's, in pixels: so far
/// do profiles tell edges apart that edgels do not.
const TOGETHER: f64 = 3.0;
/// Squared sine of the least angle under which lines meet in a point, about 4°: faces that bend
/// away from each other by 6° end in slivers like that.
const MIN_SQUARED_SINE: f64 = 0.005;
/// How much an end's own place counts along its line, where nothing else fixes it.
const ALONG: f64 = 1e-3;

/// Lines with the junctions that they run between.
pub(super) struct Corners {
    pub junctions: Vec<Vector3<f64>>,
    /// The junctions at start and end of each line.
    pub ends: Vec<[usize; 2]>,
    /// Which of the lines that were joined each is; none of those that were added.
    pub sources: Vec<Option<usize>>,
    /// Where lines come near each other.
    pub meetings: Vec<Meeting>,
    /// Per line, how far off its ends may be.
    pub windows: Vec<f64>,
    /// Per line, the size of a pixel.
    pub pixels: Vec<f64>,
}

impl Corners {
    /// A line, from corner to corner.
    pub(super) fn edge(&self, line: usize) -> LineSegment3 {
        let [start, end] = self.ends[line].map(|end| self.junctions[end]);
        LineSegment3::new(start, end)
    }

    /// The junctions of each line, ascending.
    pub(super) fn pairs(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.ends.iter().map(|[a, b]| [*a.min(b), *a.max(b)])
    }

    /// Median size of a pixel at the lines.
    pub(super) fn pixel(&self) -> f64 {
        upper_median(&mut self.pixels.clone())
    }

    /// For each junction the lines that end there.
    pub(super) fn lines_at(&self) -> BTreeMap<usize, Vec<usize>> {
        let mut lines_at: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (line, ends) in self.ends.iter().enumerate() {
            for end in ends {
                lines_at.entry(*end).or_default().push(line);
            }
        }
        lines_at
    }

    /// How many lines end at each junction.
    pub(super) fn degrees(&self) -> Vec<usize> {
        let mut degrees = vec![0; self.junctions.len()];
        for junction in self.ends.iter().flatten() {
            degrees[*junction] += 1;
        }
        degrees
    }

    /// Adds edges between junctions, with the sizes of a pixel. Their ends are corners already:
    /// they are not sought any more.
    pub(super) fn add(&mut self, edges: &[([usize; 2], f64)]) {
        self.ends.extend(edges.iter().map(|(pair, _)| *pair));
        self.sources.extend(edges.iter().map(|_| None));
        self.windows.extend(edges.iter().map(|_| 0.0));
        self.pixels.extend(edges.iter().map(|(_, pixel)| *pixel));
    }

    /// Takes away the other lines. Their junctions stay, though none may run there.
    pub(super) fn keep(&mut self, wanted: impl Fn(usize) -> bool) {
        let mut new_index = vec![None; self.ends.len()];
        let kept: Vec<usize> = (0..self.ends.len()).filter(|line| wanted(*line)).collect();
        for (new, old) in kept.iter().enumerate() {
            new_index[*old] = Some(new);
        }
        self.ends = kept.iter().map(|line| self.ends[*line]).collect();
        self.sources = kept.iter().map(|line| self.sources[*line]).collect();
        self.windows = kept.iter().map(|line| self.windows[*line]).collect();
        self.pixels = kept.iter().map(|line| self.pixels[*line]).collect();
        self.meetings.retain_mut(|meeting| {
            let [a, b] = meeting.lines.map(|line| new_index[line]);
            Option::zip(a, b)
                .inspect(|(a, b)| meeting.lines = [*a, *b])
                .is_some()
        });
    }
}

/// Two lines that come near each other within their lengths.
#[derive(Clone, Copy)]
pub(super) struct Meeting {
    pub lines: [usize; 2],
    /// Parameters of the nearest points.
    pub places: [f64; 2],
    /// Distance by the largest allowed one.
    gap: f64,
}

/// Parameters of the nearest points of two lines, and their distance; `None` for lines that
/// are all but parallel.
pub(super) fn nearest_points(a: &LineSegment3, b: &LineSegment3) -> Option<([f64; 2], f64)> {
    let (u, v) = (a.end - a.start, b.end - b.start);
    let offset = a.start - b.start;
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let determinant = uu * vv - uv * uv;
    if determinant.is_nan() || determinant <= MIN_SQUARED_SINE * uu * vv {
        return None;
    }
    let (along_u, along_v) = (u.dot(&offset), v.dot(&offset));
    let s = (uv * along_v - vv * along_u) / determinant;
    let t = (uu * along_v - uv * along_u) / determinant;
    Some(([s, t], (offset + s * u - t * v).norm()))
}

/// How far a place lies beyond the nearest end of a line (inside: negative), and that end.
pub(super) fn beyond_end(place: f64, length: f64) -> (f64, usize) {
    if place > 0.5 {
        ((place - 1.0) * length, 1)
    } else {
        (-place * length, 0)
    }
}

/// Where a line and another end in a sliver: the place on the line where they meet beyond its end,
/// and that end. Before it the edgels are those of both, so that ends are known even less well
/// than others.
pub(super) fn sliver_end(
    images: &Images,
    line: &LineSegment3,
    other: &LineSegment3,
    pixel: f64,
) -> Option<(f64, usize)> {
    let ([place, on_other], gap) = nearest_points(line, other)?;
    let [u, v] = [line, other].map(|line| (line.end - line.start).normalize());
    let window = TOGETHER * pixel / u.cross(&v).norm();
    let (beyond, end) = beyond_end(place, line.length());
    let (other_beyond, _) = beyond_end(on_other, other.length());
    let is_sliver = window > WINDOW_IN_PIXELS * pixel
        && window < MAX_WINDOW_SHARE * line.length().min(other.length());
    let meets = gap <= MAX_GAP * images.reach * pixel
        && (0.0..=window).contains(&beyond)
        && other_beyond.abs() <= window;
    (is_sliver && meets).then_some((place, end))
}

/// The size of a pixel at each line, over the views that show it.
pub(super) fn pixel_sizes(images: &Images, lines: &[ChosenLine]) -> Vec<f64> {
    let size = |found: &ChosenLine| images.pixel_size(&found.line, found.evidence.views());
    lines.iter().map(size).collect()
}

/// The pairs of lines whose middles are no farther apart than both reach, ascending.
pub(super) fn near_pairs(
    lines: &[ChosenLine],
    reach: impl Fn(usize) -> f64 + Sync,
) -> Vec<[usize; 2]> {
    let middles: Vec<Vector3<f64>> = lines.iter().map(|line| line.line.point_at(0.5)).collect();
    let of_line = |i: usize| -> Vec<[usize; 2]> {
        (i + 1..lines.len())
            .filter(|j| (middles[i] - middles[*j]).norm() <= reach(i) + reach(*j))
            .map(|j| [i, j])
            .collect()
    };
    (0..lines.len())
        .into_par_iter()
        .flat_map_iter(of_line)
        .collect()
}

/// Joins the ends of lines, but not of those that run into an arc which rounds their corner, nor
/// one that stops short of the corner as it has been `joined` to an arc (by line; the others have
/// not), nor two that do where the images speak against the way of either.
pub(super) fn find_corners(
    images: &Images,
    lines: &[ChosenLine],
    (arcs, joined): (&[FoundArc], &[[bool; 2]]),
) -> Corners {
    let pixels = pixel_sizes(images, lines);
    let windows: Vec<f64> = (lines.iter().zip(&pixels))
        .map(|(line, pixel)| {
            let length = line.line.length();
            (WINDOW_IN_PIXELS * pixel)
                .max(WINDOW_SHARE * length)
                .min(MAX_WINDOW_SHARE * length)
        })
        .collect();
    let max_gaps: Vec<f64> = pixels.iter().map(|p| MAX_GAP * images.reach * p).collect();
    let meetings = find_meetings(lines, &windows, &max_gaps);
    let mut joints: Vec<(f64, [usize; 2])> = (meetings.iter())
        .filter_map(|meeting| {
            let mut cost = meeting.gap;
            let mut ends = [0; 2];
            let mut short = true;
            for side in 0..2 {
                let line = meeting.lines[side];
                let (beyond, end) = beyond_end(meeting.places[side], lines[line].line.length());
                cost += beyond.abs() / windows[line];
                ends[side] = 2 * line + end;
                if beyond.abs() > windows[line] {
                    return None;
                }
                let stops_short = beyond > MIN_SHORT_IN_PIXELS * pixels[line];
                if stops_short && joined.get(line).is_some_and(|joined| joined[end]) {
                    return None;
                }
                short &= stops_short;
            }
            let is_denied = |side: usize| {
                let line = &lines[meeting.lines[side]].line;
                let [end, corner] = [
                    line.ends()[ends[side] % 2],
                    line.point_at(meeting.places[side]),
                ];
                let rest = LineSegment3::new(end, corner);
                images.evidence(&rest, None, f64::NEG_INFINITY).gain < 0.0
            };
            if short && (0..2).all(is_denied) {
                return None;
            }
            let pieces = meeting.lines.map(|line| &lines[line].line);
            let is_round =
                |found: &FoundArc| rounds(images, found, pieces, ends.map(|end| end % 2));
            (!arcs.iter().any(is_round)).then_some((cost, ends))
        })
        .collect();
    joints.sort_by(|(a, i), (b, j)| a.total_cmp(b).then(i.cmp(j)));
    let mut joining = Joining::new(lines, &pixels, &windows, &max_gaps);
    for (_, [a, b]) in joints {
        joining.join(a, b);
    }
    let (junctions, ends) = joining.junctions();
    Corners {
        junctions,
        sources: (0..ends.len()).map(Some).collect(),
        ends,
        meetings,
        windows,
        pixels,
    }
}

fn find_meetings(lines: &[ChosenLine], windows: &[f64], max_gaps: &[f64]) -> Vec<Meeting> {
    let reach = |k: usize| 0.5 * lines[k].line.length() + windows[k];
    let meeting = |[i, j]: [usize; 2]| {
        let (places, gap) = nearest_points(&lines[i].line, &lines[j].line)?;
        let max_gap = max_gaps[i].max(max_gaps[j]);
        let within =
            |k: usize, place: f64| beyond_end(place, lines[k].line.length()).0 <= windows[k];
        (gap <= max_gap && within(i, places[0]) && within(j, places[1])).then_some(Meeting {
            lines: [i, j],
            places,
            gap: gap / max_gap,
        })
    };
    near_pairs(lines, reach)
        .into_par_iter()
        .filter_map(meeting)
        .collect()
}

/// Clusters of ends that grow by joining. End `2 k + side` belongs to line `k`.
struct Joining<'a> {
    points: Vec<Vector3<f64>>,
    directions: Vec<Vector3<f64>>,
    pixels: &'a [f64],
    windows: &'a [f64],
    max_gaps: &'a [f64],
    cluster_of: Vec<usize>,
    /// Members of each cluster, ascending, and where it is.
    clusters: Vec<(Vec<usize>, Vector3<f64>)>,
}

impl<'a> Joining<'a> {
    fn new(
        lines: &[ChosenLine],
        pixels: &'a [f64],
        windows: &'a [f64],
        max_gaps: &'a [f64],
    ) -> Self {
        let points: Vec<Vector3<f64>> = lines.iter().flat_map(|line| line.line.ends()).collect();
        let direction = |line: &ChosenLine| (line.line.end - line.line.start).normalize();
        Self {
            directions: lines.iter().map(direction).collect(),
            pixels,
            windows,
            max_gaps,
            cluster_of: (0..points.len()).collect(),
            clusters: (points.iter().enumerate())
                .map(|(end, point)| (vec![end], *point))
                .collect(),
            points,
        }
    }

    /// Joins the clusters of two ends if one point fits all their lines.
    fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [self.cluster_of[a], self.cluster_of[b]];
        if a == b {
            return;
        }
        let mut members = [self.clusters[a].0.as_slice(), &self.clusters[b].0].concat();
        members.sort_unstable();
        let both_ends = members.windows(2).any(|pair| pair[0] / 2 == pair[1] / 2);
        if both_ends {
            return;
        }
        let Some(point) = self.meeting_point(&members) else {
            return;
        };
        if members.iter().all(|end| self.fits(*end, &point)) {
            for end in &members {
                self.cluster_of[*end] = a;
            }
            self.clusters[a] = (members, point);
            self.clusters[b].0.clear();
        }
    }

    /// The point nearest to all lines, in pixels.
    fn meeting_point(&self, members: &[usize]) -> Option<Vector3<f64>> {
        let mut matrix = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for end in members {
            let direction = self.directions[end / 2];
            let along = direction * direction.transpose();
            let block =
                (Matrix3::identity() - (1.0 - ALONG) * along) * self.pixels[end / 2].powi(-2);
            matrix += block;
            right += block * self.points[*end];
        }
        matrix.cholesky().map(|factor| factor.solve(&right))
    }

    fn fits(&self, end: usize, point: &Vector3<f64>) -> bool {
        let line = end / 2;
        let offset = point - self.points[end];
        let along = offset.dot(&self.directions[line]);
        let gap = (offset - along * self.directions[line]).norm();
        gap <= self.max_gaps[line] && along.abs() <= self.windows[line]
    }

    /// The junctions, and those at the ends of each line.
    fn junctions(self) -> (Vec<Vector3<f64>>, Vec<[usize; 2]>) {
        let mut new_index = vec![0; self.clusters.len()];
        let mut junctions = Vec::new();
        for (cluster, (members, point)) in self.clusters.iter().enumerate() {
            if !members.is_empty() {
                new_index[cluster] = junctions.len();
                junctions.push(*point);
            }
        }
        let ends = (self.cluster_of.chunks_exact(2))
            .map(|pair| [new_index[pair[0]], new_index[pair[1]]])
            .collect();
        (junctions, ends)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, chosen};
    use crate::test_scenes::cameras_on_sphere;

    #[test]
    fn ends_meet_in_a_corner_unless_images_speak_against_the_ways_there() {
        let line = |a: [f64; 3], b: [f64; 3]| LineSegment3::new(a.into(), b.into());
        let lines = |short: f64| {
            [
                line([-0.4, 0.0, 0.1], [-short, 0.0, 0.1]),
                line([0.0, 0.1, -0.3], [0.0, short / 4.0, 0.1 - short]),
            ]
        };
        let junctions = |shown: f64, joined: &[[bool; 2]]| {
            let ends = lines(shown).map(|line| line.ends()).concat();
            let views = TestViews::of_edges(&cameras_on_sphere(20), &ends, &[[0, 1], [2, 3]]);
            let images = views.images();
            let found = lines(0.05).map(|line| chosen(&images, &line));
            find_corners(&images, &found, (&[], joined)).junctions.len()
        };
        assert_eq!(junctions(0.0, &[]), 3);
        assert_eq!(junctions(0.05, &[]), 4);
        // An arc goes on from one of them.
        assert_eq!(junctions(0.0, &[[false, true], [false; 2]]), 4);
    }

    #[test]
    fn nearest_points_of_crossing_lines() {
        let line = |a: [f64; 3], b: [f64; 3]| LineSegment3::new(a.into(), b.into());
        let a = line([0.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
        let b = line([0.5, -1.0, 0.25], [0.5, 3.0, 0.25]);
        let ([s, t], gap) = nearest_points(&a, &b).unwrap();
        assert!((s - 0.25).abs() < 1e-12 && (t - 0.25).abs() < 1e-12);
        assert!((gap - 0.25).abs() < 1e-12);
        assert!(nearest_points(&a, &line([0.0, 1.0, 0.0], [2.0, 1.01, 0.0])).is_none());
        assert!(nearest_points(&a, &line([0.0; 3], [0.0; 3])).is_none());
        // A sliver of 6°.
        let sliver = line([2.0, 0.0, 0.0], [0.0, 0.2, 0.0]);
        let ([s, t], gap) = nearest_points(&a, &sliver).unwrap();
        assert!((s - 1.0).abs() < 1e-9 && t.abs() < 1e-9 && gap < 1e-9);
    }

    #[test]
    fn lines_that_run_into_each_other_end_in_a_sliver() {
        let cube = TestViews::of_cube(4);
        let images = cube.images();
        let line = |a: [f64; 3], b: [f64; 3]| LineSegment3::new(a.into(), b.into());
        // Under 6°, to half a unit before they meet at 10: there they are 0.05 apart.
        let long = line([0.0; 3], [9.5, 0.0, 0.0]);
        let other = line([10.0 - 9.5, 0.95, 0.0], [10.0 - 0.5, 0.05, 0.0]);
        let (place, end) = sliver_end(&images, &long, &other, 0.02).unwrap();
        assert!((place - 10.0 / 9.5).abs() < 1e-9 && end == 1);
        // Too far apart where it ends, in smaller pixels; another edge across is no sliver.
        assert!(sliver_end(&images, &long, &other, 0.01).is_none());
        let across = line([10.0, -5.0, 0.0], [10.0, 0.0, 0.0]);
        assert!(sliver_end(&images, &long, &across, 0.02).is_none());
    }
}
