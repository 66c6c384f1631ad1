//! Segments become edges of a graph: ends that meet share a vertex.

use nalgebra::{Matrix2, Vector2};
use neat_core::LineSegment2;
use std::collections::BTreeMap;

/// Weight of the ends themselves against the lines, in the place of a junction:
/// decides only where lines are nearly parallel.
const END_WEIGHT: f64 = 1e-3;

/// A segment's end moves at most so far outwards to meet another: corners are round in
/// images, and segments stop before them. In reference pixels, as all lengths here.
const MAX_EXTENSION: f64 = 8.0;
/// So far inwards: an end that ran on along another edge.
const MAX_RETREAT: f64 = 5.0;
/// As [`MAX_EXTENSION`], towards a junction of other segments, where colours change all
/// the way, but at most half of the segment's length: a weak edge cannot be seen beside
/// a stronger one.
const MAX_ATTRACTION: f64 = 25.0;
/// A junction lies no farther from the line of each of its segments: more than lines
/// err, less than neighbouring edges are apart.
const MAX_DISTANCE: f64 = 1.2;
/// A free end this near to the inside of another segment is put on it.
const T_EXTENSION: f64 = 4.0;
/// Segments that meet under a smaller angle, in degrees, do not determine a junction.
const MIN_ANGLE: f64 = 2.5;

/// How far segments bend to meet, in pixels of the image.
struct JunctionLimits {
    extension: f64,
    retreat: f64,
    distance: f64,
    attraction: f64,
    t_extension: f64,
    /// Sine of the smallest angle under which two lines determine a junction.
    sin_angle: f64,
}

impl JunctionLimits {
    /// For an image of so many pixels per reference pixel.
    fn new(scale: f64) -> Self {
        Self {
            extension: MAX_EXTENSION * scale,
            retreat: MAX_RETREAT * scale,
            distance: MAX_DISTANCE * scale,
            attraction: MAX_ATTRACTION * scale,
            t_extension: T_EXTENSION * scale,
            sin_angle: MIN_ANGLE.to_radians().sin(),
        }
    }

    /// Whether an end may move outwards by `along`, which is negative for inwards.
    fn allow(&self, along: f64) -> bool {
        (-self.retreat..=self.extension).contains(&along)
    }
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

/// Builds the graph of `segments` in an image of `scale` pixels per reference pixel;
/// `may_bridge` says whether one may be extended by a stretch that is not supported by
/// an edge of its own.
pub(crate) fn build(
    segments: &[LineSegment2],
    scale: f64,
    may_bridge: impl Fn(&LineSegment2) -> bool,
) -> JunctionGraph {
    let mut meetings = Meetings::new(segments, JunctionLimits::new(scale));
    meetings.join_pairs();
    meetings.attract_free_ends(may_bridge);
    meetings.put_on_segments(segments);
    meetings.graph()
}

/// Which ends meet, while that is found out.
struct Meetings {
    limits: JunctionLimits,
    /// Start and end of every segment.
    ends: Vec<SegmentEnd>,
    /// The vertex of every end. Each begins as one of its own.
    vertex_of: Vec<usize>,
    /// The ends that meet in every vertex; none where it has become part of another.
    members: Vec<Vec<usize>>,
    positions: Vec<Vector2<f64>>,
    /// Whether the vertex lies on a segment that does not end there.
    on_segment: Vec<bool>,
}

impl Meetings {
    fn new(segments: &[LineSegment2], limits: JunctionLimits) -> Self {
        let ends: Vec<SegmentEnd> = (segments.iter())
            .flat_map(|segment| {
                let length = segment.length();
                let direction = (segment.end - segment.start) / length;
                let end = |position, outward| SegmentEnd {
                    position,
                    outward,
                    length,
                };
                [end(segment.start, -direction), end(segment.end, direction)]
            })
            .collect();
        Self {
            limits,
            vertex_of: (0..ends.len()).collect(),
            members: (0..ends.len()).map(|end| vec![end]).collect(),
            positions: ends.iter().map(|end| end.position).collect(),
            on_segment: vec![false; ends.len()],
            ends,
        }
    }

    /// Joins the vertices of ends that meet, the nearest first.
    fn join_pairs(&mut self) {
        for pair in meeting_pairs(&self.ends, &self.limits) {
            let [a, b] = pair.map(|end| self.vertex_of[end]);
            let [into, from] = [a.min(b), a.max(b)];
            if into == from {
                continue;
            }
            let together = [&self.members[into][..], &self.members[from]].concat();
            if let Some(position) = junction_of(&self.ends, &together, &self.limits) {
                for &end in &self.members[from] {
                    self.vertex_of[end] = into;
                }
                self.members[from].clear();
                self.members[into] = together;
                self.positions[into] = position;
            }
        }
    }

    fn is_free(&self, end: usize) -> bool {
        self.members[self.vertex_of[end]].len() == 1
    }

    /// Lets free ends go to the junctions that they point at.
    fn attract_free_ends(&mut self, may_bridge: impl Fn(&LineSegment2) -> bool) {
        for end in 0..self.ends.len() {
            if self.is_free(end)
                && let Some(vertex) = self.attracting_vertex(end, &may_bridge)
            {
                self.members[self.vertex_of[end]].clear();
                self.vertex_of[end] = vertex;
                self.members[vertex].push(end);
            }
        }
    }

    /// Puts free ends on the segments that they come near to.
    fn put_on_segments(&mut self, segments: &[LineSegment2]) {
        for end in 0..self.ends.len() {
            if self.is_free(end)
                && let Some(position) = t_junction(end, &self.ends[end], segments, &self.limits)
            {
                self.positions[self.vertex_of[end]] = position;
                self.on_segment[self.vertex_of[end]] = true;
            }
        }
    }

    /// The vertices in which ends meet, renumbered.
    fn graph(self) -> JunctionGraph {
        let mut graph = JunctionGraph {
            vertices: Vec::new(),
            meets_others: Vec::new(),
            edges: vec![[0; 2]; self.ends.len() / 2],
        };
        for (vertex, members) in self.members.iter().enumerate() {
            if members.is_empty() {
                continue;
            }
            for end in members {
                graph.edges[end / 2][end % 2] = graph.vertices.len();
            }
            graph.vertices.push(self.positions[vertex]);
            (graph.meets_others).push(members.len() > 1 || self.on_segment[vertex]);
        }
        graph
    }

    /// The nearest junction that a free end points at.
    fn attracting_vertex(
        &self,
        end: usize,
        may_bridge: impl Fn(&LineSegment2) -> bool,
    ) -> Option<usize> {
        let (free, limits) = (&self.ends[end], &self.limits);
        let reach = limits
            .attraction
            .min(0.5 * free.length)
            .max(limits.extension);
        (0..self.members.len())
            .filter(|&vertex| self.members[vertex].len() > 1 && vertex != self.vertex_of[end ^ 1])
            .filter_map(|vertex| {
                let [along, across] = free.offset_to(&self.positions[vertex]);
                let reached =
                    (-limits.retreat..=reach).contains(&along) && across.abs() <= limits.distance;
                reached.then_some((along, vertex))
            })
            .min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
            .filter(|&(along, vertex)| {
                along <= limits.extension
                    || may_bridge(&LineSegment2::new(free.position, self.positions[vertex]))
            })
            .map(|(_, vertex)| vertex)
    }
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
    let allowed = moves.iter().all(|&along| limits.allow(along));
    allowed.then(|| moves[0].abs() + moves[1].abs())
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
        across.abs() <= distance && limits.allow(along)
    });
    fits.then_some(position)
}

/// Where the free end of this number meets the inside of another segment, if it comes
/// near one.
fn t_junction(
    end: usize,
    free: &SegmentEnd,
    segments: &[LineSegment2],
    limits: &JunctionLimits,
) -> Option<Vector2<f64>> {
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
