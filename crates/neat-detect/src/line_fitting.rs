//! Lines fitted to the gradient maxima along them, to a fraction of a pixel.

use crate::edge_profile::{EdgePoint, find_edge};
use crate::smoothed_image::SmoothedImage;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;

/// Half lengths of the profiles of the successive fits, in pixels.
const HALF_WIDTHS: [f64; 3] = [3.0, 2.0, 1.5];
/// An edge point so far from its line, in pixels, is not one of the line.
const MAX_OFFSET: f64 = 1.25;
/// Rounds of reweighting in one fit.
const REWEIGHTINGS: usize = 3;
/// The smallest spread of offsets that the robust weights assume, in pixels.
const MIN_SPREAD: f64 = 0.1;
/// A fit needs so many edge points.
const MIN_POINTS: usize = 3;
/// Along an edge the colour changes at most so much for its change across it.
const MAX_SLANT: f64 = 0.6;

/// A segment of an image edge.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FittedSegment {
    /// Where it is.
    pub segment: LineSegment2,
    /// The mean change of colour from its left to its right, per pixel, where
    /// right is +y for a segment along +x.
    pub change: Vector3<f64>,
    /// The share of its length along which there is an edge, in [0, 1].
    pub support: f64,
    /// Root mean square distance of its edge points, in pixels.
    pub residual: f64,
}

impl FittedSegment {
    /// Unit vector from start to end.
    pub(crate) fn direction(&self) -> Vector2<f64> {
        (self.segment.end - self.segment.start).normalize()
    }
}

/// Perpendicular to a unit vector: +y for +x.
pub(crate) fn normal_of(direction: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-direction.y, direction.x)
}

/// What a line is fitted with.
pub(crate) struct LineFitter<'a> {
    /// The image.
    pub image: &'a SmoothedImage,
    /// Changes of colour below this are noise, in grey levels per pixel.
    pub min_gradient: f64,
    /// Stretches without an edge up to this length are walked over, in pixels.
    pub max_gap: f64,
    /// Uncertainty of the segments that come in, in pixels.
    pub initial_error: f64,
}

/// A place along a segment and the edge there.
struct EdgeSample {
    /// Distance from the segment's middle along it, in pixels.
    position: f64,
    edge: EdgePoint,
}

impl LineFitter<'_> {
    /// Moves `segment` onto the image edge that it stands for, and lets its ends
    /// follow that edge. `None` where there is no straight edge.
    pub(crate) fn fit(&self, segment: &LineSegment2) -> Option<FittedSegment> {
        let mut segment = *segment;
        for half_width in HALF_WIDTHS {
            let half_width = if half_width == HALF_WIDTHS[0] {
                half_width.max(self.initial_error)
            } else {
                half_width
            };
            segment = self.refit(&segment, half_width)?;
        }
        let segment = self.follow(&segment)?;
        let segment = self.refit(&segment, HALF_WIDTHS[2])?;
        self.describe(&segment)
    }

    /// The edge points near a segment, one per pixel of its length.
    fn edge_samples(
        &self,
        segment: &LineSegment2,
        half_width: f64,
        contrast: Option<&Vector3<f64>>,
    ) -> Vec<EdgeSample> {
        let length = segment.length();
        let direction = (segment.end - segment.start) / length;
        let normal = normal_of(&direction);
        let steps = (length.round() as usize).max(4);
        (0..=steps)
            .filter_map(|step| {
                let t = step as f64 / steps as f64;
                let edge = find_edge(
                    self.image,
                    &segment.point_at(t),
                    &normal,
                    half_width,
                    contrast,
                )?;
                let position = (t - 0.5) * length;
                (edge.change.norm() >= self.min_gradient).then_some(EdgeSample { position, edge })
            })
            .collect()
    }

    /// One robust fit of a line to the edge points within `half_width`; the ends
    /// move only across the segment.
    fn refit(&self, segment: &LineSegment2, half_width: f64) -> Option<LineSegment2> {
        let length = segment.length();
        if !(length > 1.0) {
            return None;
        }
        let any = self.edge_samples(segment, half_width, None);
        let change: Vector3<f64> = any.iter().map(|sample| sample.edge.change).sum();
        let contrast = change.try_normalize(1e-9)?;
        let samples = self.edge_samples(segment, half_width, Some(&contrast));
        let [offset, slope] = robust_line(&samples)?;
        if slope.abs() > 1.0 {
            return None;
        }
        let direction = (segment.end - segment.start) / length;
        let normal = normal_of(&direction);
        let moved = |end: Vector2<f64>, position: f64| end + normal * (offset + slope * position);
        Some(LineSegment2::new(
            moved(segment.start, -0.5 * length),
            moved(segment.end, 0.5 * length),
        ))
    }

    /// The longest stretch around the middle of `segment`, on its line, along
    /// which there is an edge with gaps of at most `max_gap`.
    fn follow(&self, segment: &LineSegment2) -> Option<LineSegment2> {
        let length = segment.length();
        let direction = (segment.end - segment.start) / length;
        let normal = normal_of(&direction);
        let supported = |position: f64| {
            let point = segment.start + direction * position;
            self.has_edge(&point, &direction, &normal)
        };
        let seed = (0..=length as usize)
            .map(|step| step as f64)
            .filter(|&position| supported(position))
            .min_by(|a, b| {
                (a - 0.5 * length)
                    .abs()
                    .total_cmp(&(b - 0.5 * length).abs())
            })?;
        let walk = |sign: f64| {
            let mut last = seed;
            let mut position = seed;
            while (position - last).abs() <= self.max_gap {
                position += sign;
                let point = segment.start + direction * position;
                if !self.image.contains(&point) {
                    break;
                }
                if supported(position) {
                    last = position;
                }
            }
            last
        };
        let [start, end] = [walk(-1.0), walk(1.0)];
        Some(LineSegment2::new(
            segment.start + direction * start,
            segment.start + direction * end,
        ))
    }

    /// Whether an edge along `direction` passes through `point`.
    fn has_edge(
        &self,
        point: &Vector2<f64>,
        direction: &Vector2<f64>,
        normal: &Vector2<f64>,
    ) -> bool {
        let Some(edge) = find_edge(self.image, point, normal, MAX_OFFSET, None) else {
            return false;
        };
        let across = edge.change.norm();
        if across < self.min_gradient || edge.offset.abs() > MAX_OFFSET {
            return false;
        }
        let on_edge = point + normal * edge.offset;
        let [before, after] = [-0.5, 0.5].map(|step| on_edge + direction * step);
        if !self.image.contains(&before) || !self.image.contains(&after) {
            return false;
        }
        let along = (self.image.sample(&after) - self.image.sample(&before)).norm();
        f64::from(along) <= MAX_SLANT * across
    }

    /// Measures how well the image supports `segment`.
    fn describe(&self, segment: &LineSegment2) -> Option<FittedSegment> {
        let length = segment.length();
        if !(length > 1.0) {
            return None;
        }
        let direction = (segment.end - segment.start) / length;
        let normal = normal_of(&direction);
        let steps = (length.round() as usize).max(4);
        let supported = (0..=steps)
            .filter(|&step| {
                self.has_edge(
                    &segment.point_at(step as f64 / steps as f64),
                    &direction,
                    &normal,
                )
            })
            .count();
        let samples = self.edge_samples(segment, MAX_OFFSET, None);
        if samples.len() < MIN_POINTS {
            return None;
        }
        let count = samples.len() as f64;
        let change = samples.iter().map(|s| s.edge.change).sum::<Vector3<f64>>() / count;
        let squares: f64 = samples.iter().map(|s| s.edge.offset.powi(2)).sum();
        Some(FittedSegment {
            segment: *segment,
            change,
            support: supported as f64 / (steps + 1) as f64,
            residual: (squares / count).sqrt(),
        })
    }
}

/// Offset at position 0 and slope of the line through edge points, by least
/// squares reweighted with Tukey's biweight.
fn robust_line(samples: &[EdgeSample]) -> Option<[f64; 2]> {
    if samples.len() < MIN_POINTS {
        return None;
    }
    let mut line = [median(samples.iter().map(|s| s.edge.offset)), 0.0];
    for round in 0..=REWEIGHTINGS {
        let residual =
            |sample: &EdgeSample| sample.edge.offset - line[0] - line[1] * sample.position;
        let spread = 1.4826 * median(samples.iter().map(|s| residual(s).abs()));
        let cutoff = 4.685 * spread.max(MIN_SPREAD) * if round == 0 { 2.0 } else { 1.0 };
        let weights: Vec<f64> = samples
            .iter()
            .map(|s| (1.0 - (residual(s) / cutoff).powi(2)).max(0.0).powi(2))
            .collect();
        line = weighted_line(samples, &weights)?;
    }
    Some(line)
}

/// The weighted least-squares line; `None` where the weight lies on one place.
fn weighted_line(samples: &[EdgeSample], weights: &[f64]) -> Option<[f64; 2]> {
    let sum: f64 = weights.iter().sum();
    let mean = |value: fn(&EdgeSample) -> f64| {
        samples
            .iter()
            .zip(weights)
            .map(|(s, w)| w * value(s))
            .sum::<f64>()
            / sum
    };
    let [position, offset] = [mean(|s| s.position), mean(|s| s.edge.offset)];
    let (mut variance, mut covariance) = (0.0, 0.0);
    for (sample, weight) in samples.iter().zip(weights) {
        let centered = sample.position - position;
        variance += weight * centered * centered;
        covariance += weight * centered * (sample.edge.offset - offset);
    }
    let slope = covariance / variance;
    (slope.is_finite()).then_some([offset - slope * position, slope])
}

/// The upper median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
