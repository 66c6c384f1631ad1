//! Segments fitted to the gradient maxima along them, to a fraction of a pixel.

use crate::edge_profile::{EdgePoint, EdgeProfile, strength};
use crate::robust_line::{MIN_POINTS, RobustLine, sagitta};
use crate::smoothed_image::SmoothedImage;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;

/// Half lengths of the profiles of the second and third fit, in pixels.
const NARROW: [f64; 2] = [2.0, 1.5];
/// An edge point of a line lies within so many spreads of it, and
const OFFSET_SPREADS: f64 = 4.0;
/// within these bounds, in pixels.
const OFFSET_BOUNDS: [f64; 2] = [0.5, 1.25];
/// Rounds of following an edge beyond the ends of its segment.
const FOLLOWINGS: usize = 3;
/// Edges are round at corners: so much at each end, in pixels, tells nothing
/// about the curvature of a segment.
const CORNER: f64 = 2.0;
/// Along an edge the colour changes at most so much for its change across it.
const MAX_SLANT: f64 = 0.6;
/// So many points determine a line as well as the image can.
const MAX_POSITIONS: usize = 64;
/// A fit that turns a segment by a larger slope has found another edge.
const MAX_TURN: f64 = 0.5;

/// A segment of an image edge.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FittedSegment {
    /// Where it is.
    pub segment: LineSegment2,
    /// The mean change of colour from its left to its right, in grey levels per
    /// pixel; right is +y for a segment along +x.
    pub change: Vector3<f64>,
    /// The share of its length along which there is an edge, in [0, 1].
    pub support: f64,
    /// Robust standard deviation of its edge points from its line, in pixels.
    pub spread: f64,
    /// How far the edge bends from the straight line, in pixels.
    pub sagitta: f64,
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

/// Fits segments to the edges of an image.
pub(crate) struct LineFitter<'a> {
    /// The image.
    pub image: &'a SmoothedImage,
    /// Edges of a smaller [`strength`] are none, in grey levels per pixel.
    pub min_gradient: f64,
    /// Stretches without an edge up to this length are walked over, in pixels.
    pub max_gap: f64,
}

/// A segment with the axes that it is measured along.
struct Axes {
    middle: Vector2<f64>,
    direction: Vector2<f64>,
    normal: Vector2<f64>,
    length: f64,
}

impl Axes {
    /// `None` for a segment of less than a pixel.
    fn of(segment: &LineSegment2) -> Option<Self> {
        let length = segment.length();
        if !(length >= 1.0 && length.is_finite()) {
            return None;
        }
        let direction = (segment.end - segment.start) / length;
        Some(Self {
            middle: segment.point_at(0.5),
            normal: normal_of(&direction),
            direction,
            length,
        })
    }

    fn point(&self, position: f64, offset: f64) -> Vector2<f64> {
        self.middle + self.direction * position + self.normal * offset
    }

    /// Positions from one end to the other, about a pixel apart but not more than
    /// [`MAX_POSITIONS`].
    fn positions(&self) -> impl Iterator<Item = f64> + use<> {
        let (length, pixels) = (self.length, self.length.round() as usize);
        let steps = pixels.clamp(MIN_POINTS, MAX_POSITIONS - 1);
        (0..=steps).map(move |step| (step as f64 / steps as f64 - 0.5) * length)
    }
}

impl LineFitter<'_> {
    /// Moves `segment` onto the image edge within `search_width` pixels that it
    /// stands for, and lets its ends follow that edge. `None` where there is no
    /// straight edge.
    pub(crate) fn fit(&self, segment: &LineSegment2, search_width: f64) -> Option<FittedSegment> {
        let (mut segment, _) = self.refit(segment, search_width)?;
        let mut spread = 0.0;
        for half_width in NARROW {
            (segment, spread) = self.refit(&segment, half_width)?;
        }
        for _ in 0..FOLLOWINGS {
            let length = segment.length();
            segment = self.follow(&segment, max_offset(spread))?;
            (segment, spread) = self.refit(&segment, NARROW[1])?;
            if segment.length() <= length + 1.0 {
                break;
            }
        }
        self.describe(&segment, spread)
    }

    /// As [`Self::fit`], but the ends stay where they are along the segment.
    pub(crate) fn fit_between_ends(
        &self,
        segment: &LineSegment2,
        search_width: f64,
    ) -> Option<FittedSegment> {
        let (segment, _) = self.refit(segment, search_width)?;
        let (segment, spread) = self.refit(&segment, NARROW[1])?;
        self.describe(&segment, spread)
    }

    /// Whether there is an edge along the share `min_support` of `segment`, without
    /// `margin` at each end.
    pub(crate) fn supports(&self, segment: &LineSegment2, margin: f64, min_support: f64) -> bool {
        let Some(axes) = Axes::of(segment) else {
            return false;
        };
        let limit = 0.5 * axes.length - margin;
        let inner: Vec<f64> = axes.positions().filter(|at| at.abs() <= limit).collect();
        // Most segments that are asked for are none: the first misses tell.
        let mut allowed = ((1.0 - min_support) * inner.len() as f64) as usize;
        !inner.is_empty()
            && inner.iter().all(|&position| {
                let missed = !self.has_edge(&axes, position, OFFSET_BOUNDS[1]);
                let within = !missed || allowed > 0;
                allowed = allowed.saturating_sub(usize::from(missed));
                within
            })
    }

    /// Whether colours change all along `segment`, in whatever direction: near a
    /// stronger edge a weaker one cannot be told apart, but the image is not flat.
    pub(crate) fn is_nowhere_flat(&self, segment: &LineSegment2) -> bool {
        Axes::of(segment).is_none_or(|axes| {
            axes.positions().all(|position| {
                let point = axes.point(position, 0.0);
                EdgeProfile::sample(self.image, &point, &axes.normal, NARROW[0])
                    .is_some_and(|profile| profile.max_strength() >= self.min_gradient)
            })
        })
    }

    /// The fit of a segment whose line is already where it should be.
    pub(crate) fn describe(&self, segment: &LineSegment2, spread: f64) -> Option<FittedSegment> {
        let axes = Axes::of(segment)?;
        let limit = max_offset(spread);
        let edges: Vec<(f64, EdgePoint)> = (axes.positions())
            .filter_map(|position| Some((position, self.edge(&axes, position, limit)?)))
            .collect();
        if edges.len() < MIN_POINTS {
            return None;
        }
        let supported = (axes.positions())
            .filter(|&position| self.has_edge(&axes, position, OFFSET_BOUNDS[1]))
            .count();
        let change: Vector3<f64> = edges.iter().map(|(_, edge)| edge.change).sum();
        let straight = 0.5 * axes.length - CORNER;
        let inner: Vec<[f64; 2]> = (edges.iter())
            .filter(|(position, _)| position.abs() <= straight)
            .map(|(position, edge)| [*position, edge.offset])
            .collect();
        let bend = if inner.len() > 2 * MIN_POINTS {
            sagitta(&inner, axes.length)
        } else {
            0.0
        };
        Some(FittedSegment {
            segment: *segment,
            change: change / edges.len() as f64,
            support: supported as f64 / axes.positions().count() as f64,
            spread,
            sagitta: bend,
        })
    }

    /// The edge of either contrast across the line at `position`, if it is strong
    /// enough.
    fn edge(&self, axes: &Axes, position: f64, half_width: f64) -> Option<EdgePoint> {
        let point = axes.point(position, 0.0);
        EdgeProfile::sample(self.image, &point, &axes.normal, half_width)?
            .edge(None)
            .filter(|edge| strength(&edge.change) >= self.min_gradient)
    }

    /// One robust fit of a line to the edge points within `half_width`, and their
    /// spread. The ends move only across the segment.
    fn refit(&self, segment: &LineSegment2, half_width: f64) -> Option<(LineSegment2, f64)> {
        let axes = Axes::of(segment)?;
        let profiles: Vec<(f64, EdgeProfile)> = (axes.positions())
            .filter_map(|position| {
                let point = axes.point(position, 0.0);
                let profile = EdgeProfile::sample(self.image, &point, &axes.normal, half_width)?;
                Some((position, profile))
            })
            .collect();
        let edges = |contrast: Option<Vector3<f64>>| {
            (profiles.iter())
                .filter_map(move |(position, profile)| {
                    Some((*position, profile.edge(contrast.as_ref())?))
                })
                .filter(|(_, edge)| strength(&edge.change) >= self.min_gradient)
        };
        // Edges of either contrast say which contrast is meant.
        let change: Vector3<f64> = edges(None).map(|(_, edge)| edge.change).sum();
        let contrast = change.try_normalize(1e-9)?;
        let points: Vec<[f64; 2]> = edges(Some(contrast))
            .map(|(position, edge)| [position, edge.offset])
            .collect();
        let line = RobustLine::fit(&points)?;
        if line.slope.abs() > MAX_TURN {
            return None;
        }
        let [start, end] = [-0.5, 0.5].map(|side| {
            let position = side * axes.length;
            axes.point(position, line.offset + line.slope * position)
        });
        Some((LineSegment2::new(start, end), line.spread))
    }

    /// The stretch of `segment`'s line along which there is an edge within
    /// `max_offset` of it. A gap is passed if the edge beyond it is longer than the
    /// gap.
    fn follow(&self, segment: &LineSegment2, max_offset: f64) -> Option<LineSegment2> {
        let axes = Axes::of(segment)?;
        let supported = |position: &f64| self.has_edge(&axes, *position, max_offset);
        // From the middle outwards, so that the search ends early.
        let mut from_middle: Vec<f64> = axes.positions().collect();
        from_middle.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let inner = from_middle.into_iter().find(supported);
        let walk = |sign: f64| {
            // From the end, or where that hangs in the air, from the inside.
            let near_end = [0.0, 1.0, 2.0].map(|inwards| sign * (0.5 * axes.length - inwards));
            let first = near_end.into_iter().find(supported).or(inner)?;
            let (mut end, mut position) = (first, first);
            let (mut gap, mut run) = (0.0, 0.0);
            while gap <= self.max_gap {
                position += sign;
                if !self.image.contains(&axes.point(position, 0.0)) {
                    break;
                }
                if self.has_edge(&axes, position, max_offset) {
                    run += 1.0;
                    if run > gap {
                        (end, gap) = (position, 0.0);
                    }
                } else {
                    gap += 1.0 + run;
                    run = 0.0;
                }
            }
            Some(end)
        };
        let [start, end] = [walk(-1.0)?, walk(1.0)?].map(|at| axes.point(at, 0.0));
        Some(LineSegment2::new(start, end))
    }

    /// Whether an edge along the line passes it at `position`.
    fn has_edge(&self, axes: &Axes, position: f64, max_offset: f64) -> bool {
        let Some(edge) = self.edge(axes, position, max_offset) else {
            return false;
        };
        if edge.offset.abs() > max_offset {
            return false;
        }
        let [before, after] = [-0.5, 0.5].map(|step| axes.point(position + step, edge.offset));
        if !self.image.contains(&before) || !self.image.contains(&after) {
            return false;
        }
        let along = self.image.sample(&after) - self.image.sample(&before);
        f64::from(along.norm()) <= MAX_SLANT * edge.change.norm()
    }
}

/// How far an edge point of a line with this spread may lie from it, in pixels.
fn max_offset(spread: f64) -> f64 {
    (OFFSET_SPREADS * spread).clamp(OFFSET_BOUNDS[0], OFFSET_BOUNDS[1])
}
