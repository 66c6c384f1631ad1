//! What is evaluated: straight edges, and curves where a method finds them.

use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3, Spline, Wireframe3d};
use std::f64::consts::FRAC_PI_4;

/// Edges that some method found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeModel {
    /// The straight edges. A method without junctions has two for every segment.
    pub wireframe: Wireframe3d,
    /// The other edges.
    pub curves: Vec<CubicBezier>,
}

/// A cubic Bézier curve, as EMAP, NEF and their successors write curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubicBezier {
    /// Start, two points that pull the curve, and end.
    pub control_points: [Vector3<f64>; 4],
}

/// Panels of Simpson's rule for the length: as many as EMAP takes, since the
/// length decides the number of samples.
const LENGTH_PANELS: usize = 10_000;

impl CubicBezier {
    /// The curves that follow an arc, one for each eighth of a circle: off by less than 10⁻⁵ of
    /// the radius.
    pub fn of_arc(arc: &CircularArc) -> Vec<Self> {
        let count = (arc.sweep() / FRAC_PI_4 - 1e-9).ceil().max(1.0);
        let step = arc.sweep() / count;
        let pull = 4.0 / 3.0 * (0.25 * step).tan() * arc.radius;
        (0..count as usize)
            .map(|k| {
                let [low, high] = [k, k + 1].map(|k| arc.angles[0] + step * k as f64);
                let [start, end] = [low, high].map(|angle| arc.point_at(angle));
                let leaving = start + pull * arc.tangent_at(low);
                let arriving = end - pull * arc.tangent_at(high);
                Self {
                    control_points: [start, leaving, arriving, end],
                }
            })
            .collect()
    }

    /// The curves that a spline consists of.
    pub fn of_spline(spline: &Spline) -> Vec<Self> {
        let of_piece = |control_points| Self { control_points };
        spline.beziers().into_iter().map(of_piece).collect()
    }

    /// The point at parameter `t`: 0 is the start, 1 the end.
    pub fn point_at(&self, t: f64) -> Vector3<f64> {
        let [a, b, c, d] = self.control_points;
        let s = 1.0 - t;
        a * (s * s * s) + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * (t * t * t)
    }

    /// Length of the curve, by Simpson's rule.
    pub fn length(&self) -> f64 {
        let [a, b, c, d] = self.control_points;
        let speed = |t: f64| {
            let s = 1.0 - t;
            (3.0 * ((b - a) * (s * s) + (c - b) * (2.0 * s * t) + (d - c) * (t * t))).norm()
        };
        let width = 1.0 / LENGTH_PANELS as f64;
        let weighted: f64 = (0..=LENGTH_PANELS)
            .map(|i| {
                let weight = match i {
                    0 | LENGTH_PANELS => 1.0,
                    i if i % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * speed(i as f64 * width)
            })
            .sum();
        weighted * width / 3.0
    }
}

impl From<Wireframe3d> for EdgeModel {
    fn from(wireframe: Wireframe3d) -> Self {
        Self {
            wireframe,
            curves: Vec::new(),
        }
    }
}

/// A graph of segments without known junctions: ends that are exactly equal are
/// one junction.
///
/// Junctions are in the order in which they first occur.
pub fn wireframe_of_segments(segments: &[LineSegment3]) -> Wireframe3d {
    let mut index_of = std::collections::BTreeMap::new();
    let mut wireframe = Wireframe3d::default();
    for segment in segments {
        let ends = segment.ends().map(|end| {
            // Adding zero makes -0 and 0 the same point.
            let key = [end.x, end.y, end.z].map(|x| (x + 0.0).to_bits());
            *index_of.entry(key).or_insert_with(|| {
                wireframe.junctions.push(end);
                wireframe.junctions.len() - 1
            })
        });
        wireframe.edges.push(ends);
    }
    wireframe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_of_an_arc_follow_it() {
        for sweep in [0.3, 2.0, 6.2] {
            let arc = CircularArc {
                center: Vector3::new(0.3, 0.2, 0.1),
                axes: [Vector3::y(), Vector3::z()],
                radius: 2.0,
                angles: [0.4, 0.4 + sweep],
            };
            let curves = CubicBezier::of_arc(&arc);
            let length: f64 = curves.iter().map(CubicBezier::length).sum();
            assert!((length - arc.length()).abs() < 1e-4);
            for curve in &curves {
                for k in 0..=10 {
                    let point = curve.point_at(f64::from(k) / 10.0);
                    assert!(arc.distance_to_circle(&point) < 2e-5);
                    assert!(arc.contains(arc.angle_of(&point), 1e-9));
                }
            }
        }
    }

    #[test]
    fn curves_of_a_spline_are_its_pieces() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 3.0], [0.0, 1.0]];
        for closed in [false, true] {
            let spline = Spline {
                controls: corners.map(|[x, y]| Vector3::new(x, y, x * y)).to_vec(),
                closed,
            };
            let curves = CubicBezier::of_spline(&spline);
            assert_eq!(curves.len(), spline.pieces());
            for (piece, curve) in curves.iter().enumerate() {
                for share in [0.0, 0.3, 1.0] {
                    let point = spline.point_at(piece as f64 + share);
                    assert!((curve.point_at(share) - point).norm() < 1e-12);
                }
            }
            let length: f64 = curves.iter().map(CubicBezier::length).sum();
            assert!((length - spline.length()).abs() < 1e-3);
        }
    }

    #[test]
    fn a_straight_curve_is_a_segment_and_a_bent_one_longer() {
        let at = |x, y| Vector3::new(x, y, 0.0);
        let straight = CubicBezier {
            control_points: [at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0), at(3.0, 0.0)],
        };
        assert!((straight.length() - 3.0).abs() < 1e-12);
        assert!((straight.point_at(0.25) - at(0.75, 0.0)).norm() < 1e-15);
        // With the last three points equal the speed is 3 (1-t)², which
        // integrates to the distance of the ends.
        let eased = CubicBezier {
            control_points: [at(0.0, 0.0), at(1.0, 1.0), at(1.0, 1.0), at(1.0, 1.0)],
        };
        assert!((eased.length() - 2.0_f64.sqrt()).abs() < 1e-12);
        // The usual cubic imitation of a quarter of the unit circle.
        let k = 0.552_284_749_8;
        let arc = CubicBezier {
            control_points: [at(1.0, 0.0), at(1.0, k), at(k, 1.0), at(0.0, 1.0)],
        };
        assert!((arc.length() - std::f64::consts::FRAC_PI_2).abs() < 3e-4);
    }

    #[test]
    fn equal_ends_are_one_junction() {
        let at = |x| Vector3::new(x, 0.0, 0.0);
        let segments = [
            LineSegment3::new(at(0.0), at(1.0)),
            LineSegment3::new(at(1.0), at(2.0)),
            LineSegment3::new(at(-0.0), at(2.0)),
        ];
        let wireframe = wireframe_of_segments(&segments);
        assert_eq!(wireframe.junctions, [at(0.0), at(1.0), at(2.0)]);
        assert_eq!(wireframe.edges, [[0, 1], [1, 2], [0, 2]]);
    }
}
