//! Detections against truth, one to one.

use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Junctions, and both ends of segments, may be off by so much, in pixels.
const TOLERANCE: f64 = 3.0;
/// Truth nearer than this, in pixels, is one junction.
const SAME_JUNCTION: f64 = 1e-6;

/// What is truly to be seen in one view; pixel centres are integers.
pub struct ViewTruth {
    segments: Vec<LineSegment2>,
    /// Junctions of the object.
    junctions: Vec<Vector2<f64>>,
    /// Ends where one part of the object hides another: to detect one there is
    /// neither right nor wrong.
    hidden_ends: Vec<Vector2<f64>>,
}

impl ViewTruth {
    /// From visible parts of edges, with whether each end is a junction, in image
    /// coordinates whose pixel centres are at `pixel_center`.
    pub fn new(parts: impl Iterator<Item = (LineSegment2, [bool; 2])>, pixel_center: f64) -> Self {
        let mut truth = Self {
            segments: Vec::new(),
            junctions: Vec::new(),
            hidden_ends: Vec::new(),
        };
        for (segment, is_junction) in parts {
            let segment = segment.map(|end| end.add_scalar(-pixel_center));
            truth.segments.push(segment);
            for (end, is_junction) in segment.ends().into_iter().zip(is_junction) {
                let list = if is_junction {
                    &mut truth.junctions
                } else {
                    &mut truth.hidden_ends
                };
                if !list
                    .iter()
                    .any(|known| (known - end).norm() < SAME_JUNCTION)
                {
                    list.push(end);
                }
            }
        }
        truth
    }
}

/// Counts over views.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// True, predicted and matched.
    junctions: [usize; 3],
    segments: [usize; 3],
    views: usize,
    /// Distances of matched junctions, in pixels.
    junction_errors: Vec<f64>,
    /// Distances of the ends of matched segments from the true lines, in pixels.
    line_errors: Vec<f64>,
}

impl Tally {
    /// Heading of the table of [`Self::row`].
    pub const HEADER: &str = "\
| images | junctions P | R | segments P | R | median error: junctions | lines |
| --- | --- | --- | --- | --- | --- | --- |";

    /// Adds a view.
    pub fn add(&mut self, truth: &ViewTruth, detected: &[LineSegment2]) {
        self.views += 1;
        let mut vertices: Vec<Vector2<f64>> = Vec::new();
        for end in detected.iter().flat_map(LineSegment2::ends) {
            if !vertices.contains(&end) {
                vertices.push(end);
            }
        }
        let distance = |t: &Vector2<f64>, d: &Vector2<f64>| (t - d).norm();
        let pairs = matches(&truth.junctions, &vertices, distance);
        self.junction_errors.extend(pairs.iter().map(|pair| pair.0));
        let matched: Vec<usize> = pairs.iter().map(|pair| pair.2).collect();
        let neutral = (vertices.iter().enumerate())
            .filter(|(index, _)| !matched.contains(index))
            .filter(|(_, vertex)| {
                truth
                    .hidden_ends
                    .iter()
                    .any(|end| (end - *vertex).norm() <= TOLERANCE)
            })
            .count();
        add(
            &mut self.junctions,
            [truth.junctions.len(), vertices.len() - neutral, pairs.len()],
        );

        let distance = |t: &LineSegment2, d: &LineSegment2| {
            let ordered = t.with_nearest_order(d);
            let [start, end] = t.end_distances(&ordered);
            start.max(end)
        };
        let pairs = matches(&truth.segments, detected, distance);
        add(
            &mut self.segments,
            [truth.segments.len(), detected.len(), pairs.len()],
        );
        for (_, true_one, found) in pairs {
            let line = &truth.segments[true_one];
            let foot = |point: &Vector2<f64>| line.point_at(line.line_parameter(point));
            self.line_errors
                .extend(detected[found].ends().map(|end| (foot(&end) - end).norm()));
        }
    }

    /// The sum of several.
    pub fn sum(tallies: &[Self]) -> Self {
        let mut sum = Self::default();
        for tally in tallies {
            sum.views += tally.views;
            add(&mut sum.junctions, tally.junctions);
            add(&mut sum.segments, tally.segments);
            sum.junction_errors.extend(&tally.junction_errors);
            sum.line_errors.extend(&tally.line_errors);
        }
        sum
    }

    /// Whether anything was detected.
    pub fn has_predictions(&self) -> bool {
        self.segments[1] > 0
    }

    /// A line of the table.
    pub fn row(&self, name: &str) -> String {
        let share = |matched: usize, of: usize| matched as f64 / of.max(1) as f64;
        let [j, s] = [self.junctions, self.segments];
        format!(
            "| {name} ({} views) | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} px | {:.3} px |",
            self.views,
            share(j[2], j[1]),
            share(j[2], j[0]),
            share(s[2], s[1]),
            share(s[2], s[0]),
            median(&self.junction_errors),
            median(&self.line_errors),
        )
    }
}

fn add(to: &mut [usize; 3], counts: [usize; 3]) {
    for (sum, count) in to.iter_mut().zip(counts) {
        *sum += count;
    }
}

/// Pairs of true and detected things within the tolerance, nearest first, each
/// in at most one: (distance, true one, detected one).
fn matches<T>(
    truth: &[T],
    detected: &[T],
    distance: impl Fn(&T, &T) -> f64,
) -> Vec<(f64, usize, usize)> {
    let mut pairs = Vec::new();
    for (t, true_one) in truth.iter().enumerate() {
        for (d, found) in detected.iter().enumerate() {
            pairs.push((distance(true_one, found), t, d));
        }
    }
    pairs.retain(|pair| pair.0 <= TOLERANCE);
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut free_truth, mut free_detected) = (vec![true; truth.len()], vec![true; detected.len()]);
    pairs.retain(|&(_, t, d)| {
        let free = free_truth[t] && free_detected[d];
        if free {
            (free_truth[t], free_detected[d]) = (false, false);
        }
        free
    });
    pairs
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
