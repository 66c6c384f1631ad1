//! NEAT lines: one 3D line per 2D segment and view, averaged over the rays of
//! the thin attraction region (paper §4.3; `initial_recon` of the published code).

use crate::ViewObservation;
use crate::validity::is_finite;
use nalgebra::Vector3;
use neat_core::{LineSegment2, LineSegment3};
use serde::{Deserialize, Serialize};

/// What a field renders along one ray of an attraction region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportedSegment {
    /// The rendered segment (paper eq. 4), in world units; the order of its ends
    /// carries no meaning.
    pub segment: LineSegment3,
    /// Where the ray through the foot point on the 2D segment meets the surface.
    pub support_point: Vector3<f64>,
}

impl SupportedSegment {
    /// Whether all nine coordinates are finite.
    pub fn is_finite(&self) -> bool {
        [self.segment.start, self.segment.end, self.support_point]
            .iter()
            .all(is_finite)
    }

    fn reversed(self) -> Self {
        Self {
            segment: self.segment.reversed(),
            ..self
        }
    }
}

/// How rendered segments are gathered into NEAT lines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NeatLineConfig {
    /// Only 2D segments with a score strictly above this gather rays.
    pub min_segment_score: f64,
    /// A ray counts when its projected segment lies nearer than this to the 2D
    /// segment: squared pixels, summed over both ends, strict.
    pub max_squared_reprojection: f64,
    /// A line counts when its support points lie nearer than this to it on
    /// average: world units, strict.
    pub max_support_distance: f64,
    /// Repeat a slip of the published code: the cross product of a line with
    /// exactly three rays runs over the rays instead of over x, y and z, so that
    /// its support distance is wrong. For parity only.
    pub published_cross_product: bool,
}

impl Default for NeatLineConfig {
    fn default() -> Self {
        Self {
            min_segment_score: 0.01,
            max_squared_reprojection: 10.0,
            max_support_distance: 0.01,
            published_cross_product: false,
        }
    }
}

/// The mean 3D line of one 2D segment in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeatLine {
    /// Index into [`ViewObservation::segments`].
    pub segment_in_view: usize,
    /// Mean of the gathered segments; start belongs to the 2D segment's start.
    pub segment: LineSegment3,
    /// How many rays were averaged.
    pub rays: usize,
    /// Mean distance of the rays' support points from the infinite line, in
    /// world units: the line's score, lower is better.
    pub support_distance: f64,
}

impl NeatLine {
    /// Whether the support points lie close enough to the line.
    pub fn is_supported(&self, config: &NeatLineConfig) -> bool {
        self.support_distance < config.max_support_distance
    }
}

/// The NEAT lines of one view, by ascending index of their 2D segment.
///
/// Each rendered segment is tried in both orders of its ends and joins the
/// nearest 2D segment, not necessarily the one whose attraction region its ray
/// came from. Lines that fail [`NeatLine::is_supported`] are returned too:
/// junction voting uses them. Rays that are not finite join no segment.
pub fn neat_lines(
    view: &ViewObservation,
    rays: &[SupportedSegment],
    config: &NeatLineConfig,
) -> Vec<NeatLine> {
    let mut gathered = vec![Vec::new(); view.segments.len()];
    let finite = || rays.iter().copied().filter(SupportedSegment::is_finite);
    for ray in finite().chain(finite().map(|ray| ray.reversed())) {
        let in_image = ray.segment.map(|p| view.camera.project(p).pixel);
        if let Some(segment_in_view) = nearest_segment(view, &in_image, config) {
            gathered[segment_in_view].push(ray);
        }
    }
    gathered
        .iter()
        .enumerate()
        .filter(|(_, rays)| !rays.is_empty())
        .map(|(segment_in_view, rays)| {
            let segment = mean_segment(rays);
            NeatLine {
                segment_in_view,
                segment,
                rays: rays.len(),
                support_distance: mean_support_distance(&segment, rays, config),
            }
        })
        .collect()
}

/// The 2D segment nearest to `segment` in the given order of ends, if near enough.
fn nearest_segment(
    view: &ViewObservation,
    segment: &LineSegment2,
    config: &NeatLineConfig,
) -> Option<usize> {
    view.segments
        .iter()
        .enumerate()
        .filter(|(_, detected)| detected.score > config.min_segment_score)
        .map(|(index, detected)| (index, detected.segment.squared_end_distance(segment)))
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
        .filter(|(_, distance)| *distance < config.max_squared_reprojection)
        .map(|(index, _)| index)
}

fn mean_segment(rays: &[SupportedSegment]) -> LineSegment3 {
    let count = rays.len() as f64;
    LineSegment3::new(
        rays.iter()
            .map(|ray| ray.segment.start)
            .sum::<Vector3<f64>>()
            / count,
        rays.iter().map(|ray| ray.segment.end).sum::<Vector3<f64>>() / count,
    )
}

/// Lines shorter than this are given this length before dividing by it.
const MIN_LENGTH: f64 = 1e-6;

fn mean_support_distance(
    line: &LineSegment3,
    rays: &[SupportedSegment],
    config: &NeatLineConfig,
) -> f64 {
    let arms: Vec<[Vector3<f64>; 2]> = rays
        .iter()
        .map(|ray| [ray.support_point - line.start, ray.support_point - line.end])
        .collect();
    let doubled_areas: f64 = match arms.as_slice() {
        [a, b, c] if config.published_cross_product => cross_over_rays([a, b, c]),
        arms => arms
            .iter()
            .map(|[to_start, to_end]| to_start.cross(to_end).norm())
            .sum(),
    };
    doubled_areas / arms.len() as f64 / line.length().max(MIN_LENGTH)
}

/// Sum of the row norms of `torch.cross(u, v)` on two 3×3 matrices with one ray
/// per row: without `dim` it takes the product of the columns.
fn cross_over_rays(arms: [&[Vector3<f64>; 2]; 3]) -> f64 {
    let column = |end: usize, axis: usize| Vector3::from_fn(|ray, _| arms[ray][end][axis]);
    let crossed: [Vector3<f64>; 3] =
        std::array::from_fn(|axis| column(0, axis).cross(&column(1, axis)));
    (0..3)
        .map(|ray| Vector3::from_fn(|axis, _| crossed[axis][ray]).norm())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{camera_at_origin, observation};
    use nalgebra::Vector2;

    /// A segment at depth 2 whose ends project onto the pixels `a` and `b`.
    fn rendered(a: [f64; 2], b: [f64; 2], support: Vector3<f64>) -> SupportedSegment {
        let lift = |pixel: [f64; 2]| {
            let calibrated = camera_at_origin()
                .intrinsics
                .calibrate(&Vector2::from(pixel));
            Vector3::new(calibrated.x, calibrated.y, 1.0) * 2.0
        };
        SupportedSegment {
            segment: LineSegment3::new(lift(a), lift(b)),
            support_point: support,
        }
    }

    #[test]
    fn both_orders_are_averaged_into_the_order_of_the_2d_segment() {
        let view = observation(&[([10.0, 50.0], [90.0, 50.0], 0.9)]);
        let on_line = rendered([50.0, 50.0], [50.0, 50.0], Vector3::zeros())
            .segment
            .start;
        let rays = [
            rendered([11.0, 50.0], [90.0, 50.0], on_line),
            rendered([90.0, 50.0], [9.0, 50.0], on_line),
        ];
        let lines = neat_lines(&view, &rays, &NeatLineConfig::default());
        assert_eq!(lines.len(), 1);
        assert_eq!((lines[0].segment_in_view, lines[0].rays), (0, 2));
        let exact = rendered([10.0, 50.0], [90.0, 50.0], on_line).segment;
        assert!(lines[0].segment.squared_end_distance(&exact) < 1e-24);
        assert!(lines[0].support_distance < 1e-12);
        assert!(lines[0].is_supported(&NeatLineConfig::default()));
    }

    #[test]
    fn far_rays_weak_segments_and_nan_gather_nothing() {
        let config = NeatLineConfig::default();
        let view = observation(&[([10.0, 50.0], [90.0, 50.0], 0.9)]);
        let support = Vector3::new(0.0, 0.0, 2.0);
        // 2.5² + 2² = 10.25 squared pixels.
        let far = rendered([12.5, 50.0], [92.0, 50.0], support);
        let mut broken = rendered([10.0, 50.0], [90.0, 50.0], support);
        broken.segment.start.x = f64::NAN;
        assert!(!broken.is_finite() && far.is_finite());
        assert_eq!(neat_lines(&view, &[far, broken], &config), []);

        let near = rendered([10.0, 50.0], [90.0, 50.0], support);
        let weak = observation(&[([10.0, 50.0], [90.0, 50.0], 0.01)]);
        assert_eq!(neat_lines(&weak, &[near], &config), []);
        assert_eq!(neat_lines(&observation(&[]), &[near], &config), []);
        assert_eq!(neat_lines(&view, &[], &config), []);
    }

    #[test]
    fn support_distance_is_to_the_infinite_line() {
        let line = LineSegment3::new(Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0));
        let ray = |support_point| SupportedSegment {
            segment: line,
            support_point,
        };
        let rays = [
            ray(Vector3::new(5.0, 0.3, 0.0)),
            ray(Vector3::new(1.0, 0.0, 0.1)),
        ];
        let distance = mean_support_distance(&line, &rays, &NeatLineConfig::default());
        assert!((distance - 0.2).abs() < 1e-15);
    }

    #[test]
    fn published_cross_product_differs_only_for_three_rays() {
        let line = LineSegment3::new(Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0));
        let published = NeatLineConfig {
            published_cross_product: true,
            ..Default::default()
        };
        let rays: Vec<_> = (0..4)
            .map(|i| SupportedSegment {
                segment: line,
                support_point: Vector3::new(0.3 * f64::from(i), 0.1, 0.2 * f64::from(i)),
            })
            .collect();
        for count in 1..=4 {
            let ours = mean_support_distance(&line, &rays[..count], &NeatLineConfig::default());
            let theirs = mean_support_distance(&line, &rays[..count], &published);
            assert_eq!(ours == theirs, count != 3, "{count} rays");
        }
    }
}
