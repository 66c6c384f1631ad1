//! Segments become edges of a graph: ends that meet share a vertex.

use nalgebra::{Matrix2, Vector2};
use neat_core::LineSegment2;
use std::collections::BTreeMap;

/// Weight of the ends themselves against the lines, in the place of a junction:
/// decides only where lines are nearly parallel.
const END_WEIGHT: f64 = 1e-3;

/// How far segments bend to meet; lengths in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JunctionLimits {
    /// An end moves at most so far outwards along its line,
    pub extension: f64,
    /// so far inwards,
    pub retreat: f64,
    /// and so far across it.
    pub distance: f64,
    /// Sine of the smallest angle under which two lines determine a junction.
    pub sin_angle: f64,
    /// As `extension`, to a junction of other segments where the image is not flat
    /// between; but at most half of the segment's length.
    pub attraction: f64,
    /// As `extension`, to the inside of another segment.
    pub t_extension: f64,
}

/// Where a junction must lie on the line for certain, it lies this near, in pixels.
const PRECISE: f64 = 1.0;
/// Ends under a smaller angle can be the two sides of one thin bar, which do not
/// meet: the cosine of that angle.
const TWIN_COS_ANGLE: f64 = 0.97;
/// The smallest sine of the angle at which a T-junction is made.
const T_SIN_ANGLE: f64 = 0.3;

/// The graph: vertices with the segments that meet in each, and for each
/// segment its two vertices.
pub(crate) struct JunctionGraph {
    pub vertices: Vec<Vector2<f64>>,
    /// Whether other segments end in each vertex, or it lies on one.
    pub meets_others: Vec<bool>,
    /// Start and end vertex of every segment, in the order given.
    pub edges: Vec<[usize; 2]>,
}

/// One of the two ends of a segment.
#[derive(Clone, Copy)]
struct SegmentEnd {
    position: Vector2<f64>,
    /// Unit vector along the segment, out of it.
    outward: Vector2<f64>,
    length: f64,
}

impl SegmentEnd {
    /// How far `point` lies outwards and how far across.
    fn offset_to(&self, point: &Vector2<f64>) -> [f64; 2] {
        let offset = point - self.position;
        [offset.dot(&self.outward), offset.perp(&self.outward)]
    }
}

/// Builds the graph of `segments`; `may_bridge` says whether one may be extended
/// by a stretch that is not supported by an edge of its own.
pub(crate) fn build(
    segments: &[LineSegment2],
    limits: &JunctionLimits,
    may_bridge: impl Fn(&LineSegment2) -> bool,
) -> JunctionGraph {
    let ends: Vec<SegmentEnd> = (segments.iter())
        .flat_map(|segment| {
            let length = segment.length();
            let direction = (segment.end - segment.start) / length;
            [
                SegmentEnd {
                    position: segment.start,
                    outward: -direction,
                    length,
                },
                SegmentEnd {
                    position: segment.end,
                    outward: direction,
                    length,
                },
            ]
        })
        .collect();

    // Every end begins as a vertex of its own; pairs join them, nearest first.
    let mut vertex_of: Vec<usize> = (0..ends.len()).collect();
    let mut members: Vec<Vec<usize>> = (0..ends.len()).map(|end| vec![end]).collect();
    let mut positions: Vec<Vector2<f64>> = ends.iter().map(|end| end.position).collect();
    for [a, b] in meeting_pairs(&ends, limits) {
        let [into, from] = [
            vertex_of[a].min(vertex_of[b]),
            vertex_of[a].max(vertex_of[b]),
        ];
        if into == from {
            continue;
        }
        let together: Vec<usize> = members[into]
            .iter()
            .chain(&members[from])
            .copied()
            .collect();
        if let Some(position) = junction_of(&ends, &together, limits) {
            for &end in &members[from] {
                vertex_of[end] = into;
            }
            members[from].clear();
            members[into] = together;
            positions[into] = position;
        }
    }
    for end in 0..ends.len() {
        if members[vertex_of[end]].len() == 1
            && let Some(vertex) = attracting_vertex(
                end,
                &ends,
                &vertex_of,
                &members,
                &positions,
                limits,
                &may_bridge,
            )
        {
            members[vertex_of[end]].clear();
            vertex_of[end] = vertex;
            members[vertex].push(end);
        }
    }
    let mut on_segment = vec![false; members.len()];
    for end in 0..ends.len() {
        if members[vertex_of[end]].len() == 1
            && let Some(position) = t_junction(end, &ends, segments, limits)
        {
            positions[vertex_of[end]] = position;
            on_segment[vertex_of[end]] = true;
        }
    }

    let mut graph = JunctionGraph {
        vertices: Vec::new(),
        meets_others: Vec::new(),
        edges: vec![[0; 2]; segments.len()],
    };
    for (vertex, members) in members
        .iter()
        .enumerate()
        .filter(|(_, members)| !members.is_empty())
    {
        for end in members {
            graph.edges[end / 2][end % 2] = graph.vertices.len();
        }
        graph.vertices.push(positions[vertex]);
        (graph.meets_others).push(members.len() > 1 || on_segment[vertex]);
    }
    graph
}

/// Pairs of ends whose lines meet where both ends may move, the shortest moves
/// first.
fn meeting_pairs(ends: &[SegmentEnd], limits: &JunctionLimits) -> Vec<[usize; 2]> {
    let cell = 2.0 * limits.extension.max(limits.retreat).max(1.0);
    let cell_of = |end: &SegmentEnd| [0, 1].map(|axis| (end.position[axis] / cell).floor() as i64);
    let mut cells: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for (index, end) in ends.iter().enumerate() {
        cells.entry(cell_of(end)).or_default().push(index);
    }
    let mut pairs = Vec::new();
    for (a, end) in ends.iter().enumerate() {
        let [x, y] = cell_of(end);
        for neighbor in (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| [x, y])) {
            for &b in cells.get(&neighbor).into_iter().flatten() {
                if b > a
                    && a / 2 != b / 2
                    && let Some(cost) = meeting_cost(end, &ends[b], limits)
                {
                    pairs.push((cost, [a, b]));
                }
            }
        }
    }
    pairs.sort_by(|(x, a), (y, b)| x.total_cmp(y).then(a.cmp(b)));
    pairs.into_iter().map(|(_, pair)| pair).collect()
}

/// How far two ends must move to meet; `None` if they may not.
fn meeting_cost(a: &SegmentEnd, b: &SegmentEnd, limits: &JunctionLimits) -> Option<f64> {
    let sine = a.outward.perp(&b.outward);
    if sine.abs() < limits.sin_angle {
        return None;
    }
    let between = b.position - a.position;
    let moves = [
        between.perp(&b.outward) / sine,
        between.perp(&a.outward) / sine,
    ];
    let allowed = |distance: &f64| (-limits.retreat..=limits.extension).contains(distance);
    moves
        .iter()
        .all(allowed)
        .then(|| moves[0].abs() + moves[1].abs())
}

/// The point nearest to the lines of some ends, if every one of them may move
/// there and they are of different segments.
fn junction_of(
    ends: &[SegmentEnd],
    members: &[usize],
    limits: &JunctionLimits,
) -> Option<Vector2<f64>> {
    for (i, a) in members.iter().enumerate() {
        if members[..i].iter().any(|b| a / 2 == b / 2) {
            return None;
        }
    }
    let (mut normal_matrix, mut right_side) = (Matrix2::zeros(), Vector2::zeros());
    for end in members.iter().map(|&end| &ends[end]) {
        let normal = Vector2::new(-end.outward.y, end.outward.x);
        let projector =
            (normal * normal.transpose() + Matrix2::identity() * END_WEIGHT) * end.length;
        normal_matrix += projector;
        right_side += projector * end.position;
    }
    let position = normal_matrix.try_inverse()? * right_side;
    let fits = members.iter().all(|&end| {
        let own = &ends[end];
        let [along, across] = own.offset_to(&position);
        let has_twin = members
            .iter()
            .any(|&other| other != end && ends[other].outward.dot(&own.outward) > TWIN_COS_ANGLE);
        let distance = if has_twin {
            limits.distance.min(PRECISE)
        } else {
            limits.distance
        };
        across.abs() <= distance && (-limits.retreat..=limits.extension).contains(&along)
    });
    fits.then_some(position)
}

/// The nearest junction that a free end points at.
fn attracting_vertex(
    end: usize,
    ends: &[SegmentEnd],
    vertex_of: &[usize],
    members: &[Vec<usize>],
    positions: &[Vector2<f64>],
    limits: &JunctionLimits,
    may_bridge: impl Fn(&LineSegment2) -> bool,
) -> Option<usize> {
    let free = &ends[end];
    let reach = limits
        .attraction
        .min(0.5 * free.length)
        .max(limits.extension);
    (0..members.len())
        .filter(|&vertex| members[vertex].len() > 1 && vertex != vertex_of[end ^ 1])
        .filter_map(|vertex| {
            let [along, across] = free.offset_to(&positions[vertex]);
            let reached =
                (-limits.retreat..=reach).contains(&along) && across.abs() <= limits.distance;
            reached.then_some((along, vertex))
        })
        .min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
        .filter(|&(along, vertex)| {
            along <= limits.extension
                || may_bridge(&LineSegment2::new(free.position, positions[vertex]))
        })
        .map(|(_, vertex)| vertex)
}

/// Where a free end meets the inside of another segment, if it comes near one.
fn t_junction(
    end: usize,
    ends: &[SegmentEnd],
    segments: &[LineSegment2],
    limits: &JunctionLimits,
) -> Option<Vector2<f64>> {
    let free = &ends[end];
    (segments.iter().enumerate())
        .filter(|(index, _)| *index != end / 2)
        .filter_map(|(_, segment)| {
            let length = segment.length();
            let direction = (segment.end - segment.start) / length;
            let sine = free.outward.perp(&direction);
            if sine.abs() < T_SIN_ANGLE {
                return None;
            }
            let between = segment.start - free.position;
            let along_free = between.perp(&direction) / sine;
            let along_segment = between.perp(&free.outward) / sine;
            let meets = (-limits.retreat..=limits.t_extension).contains(&along_free)
                && (0.0..=length).contains(&along_segment);
            meets.then_some(along_free)
        })
        .min_by(|a, b| a.abs().total_cmp(&b.abs()))
        .map(|along| free.position + free.outward * along)
}
