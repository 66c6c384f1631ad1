//! Regions of the plane that are bounded by lines and arcs of circles.

use crate::LineSegment2;
use nalgebra::Vector2;
use std::f64::consts::{PI, TAU};

/// A region within closed curves that do not meet: one around it, and those of its holes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Profile {
    /// Of each curve its sides, one after the other; the region is to their left.
    pub loops: Vec<Vec<Side>>,
}

/// A straight side, or an arc of a circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    pub start: Vector2<f64>,
    /// The same as the start for a whole circle.
    pub end: Vector2<f64>,
    pub arc: Option<Arc>,
}

/// The circle that a side follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    pub center: Vector2<f64>,
    pub radius: f64,
    /// Where it starts, in radians.
    pub angle: f64,
    /// By how much it turns, in radians; counter-clockwise above 0.
    pub sweep: f64,
}

impl Profile {
    /// The polygon through `vertices`, in order; the last one joins the first.
    pub fn polygon(vertices: &[Vector2<f64>]) -> Self {
        let ends = vertices.iter().cycle().skip(1);
        let sides = vertices.iter().zip(ends).map(|(start, end)| Side {
            start: *start,
            end: *end,
            arc: None,
        });
        Self {
            loops: vec![sides.collect()],
        }
    }

    /// Whatever curve joins the vertices: to each the bulge of the side that follows it, a quarter of
    /// the tangent of the angle by which it turns. 0 is a line, 1 a half circle counter-clockwise.
    pub fn chain(vertices: &[[f64; 3]]) -> Self {
        let ends = vertices.iter().cycle().skip(1);
        let side = |([x, y, bulge], [end_x, end_y, _]): (&[f64; 3], &[f64; 3])| {
            Side::bulged(Vector2::new(*x, *y), Vector2::new(*end_x, *end_y), *bulge)
        };
        Self {
            loops: vec![vertices.iter().zip(ends).map(side).collect()],
        }
    }

    /// A disc.
    pub fn disc(center: [f64; 2], radius: f64) -> Self {
        Self {
            loops: vec![vec![Side::circle(center.into(), radius, TAU)]],
        }
    }

    /// With a round hole.
    pub fn without_disc(mut self, center: [f64; 2], radius: f64) -> Self {
        self.loops
            .push(vec![Side::circle(center.into(), radius, -TAU)]);
        self
    }

    pub fn sides(&self) -> impl Iterator<Item = &Side> {
        self.loops.iter().flatten()
    }

    /// Scaled about the origin.
    pub fn scaled(&self, scale: f64) -> Self {
        self.map(|side| side.scaled(scale))
    }

    /// With x and y exchanged, so that the region is to the right of its sides.
    pub fn mirrored(&self) -> Self {
        self.map(Side::mirrored)
    }

    fn map(&self, f: impl Fn(&Side) -> Side) -> Self {
        Self {
            loops: (self.loops.iter())
                .map(|sides| sides.iter().map(&f).collect())
                .collect(),
        }
    }

    /// Whether `point` lies inside, by the parity of the sides to its right: of chords, and once more
    /// between chord and arc.
    pub fn contains(&self, point: &Vector2<f64>) -> bool {
        self.sides()
            .filter(|side| side.chord_is_right_of(point) != side.bulge_contains(point))
            .count()
            % 2
            == 1
    }

    /// The point of the outline nearest to `point`.
    pub fn closest_point_on_outline(&self, point: &Vector2<f64>) -> Vector2<f64> {
        self.sides()
            .map(|side| side.closest_point(point))
            .min_by(|a, b| {
                (a - point)
                    .norm_squared()
                    .total_cmp(&(b - point).norm_squared())
            })
            .unwrap_or(*point)
    }

    /// With chords in place of arcs, which turn by at most `most` radians from one to the next.
    #[cfg(test)]
    pub fn with_chords(&self, most: f64) -> Self {
        let chords = |side: &Side| {
            let (count, arc) = match side.arc {
                None => (1, None),
                Some(arc) => ((arc.sweep.abs() / most).ceil() as usize, Some(arc)),
            };
            let corner = move |k: usize, side: &Side| match arc {
                Some(arc) if k > 0 => {
                    let (sine, cosine) =
                        (arc.angle + arc.sweep * k as f64 / count as f64).sin_cos();
                    arc.center + Vector2::new(cosine, sine) * arc.radius
                }
                _ => side.start,
            };
            (0..count).map(|k| corner(k, side)).collect::<Vec<_>>()
        };
        let loops = self.loops.iter().flat_map(|sides| {
            let corners: Vec<_> = sides.iter().flat_map(chords).collect();
            Self::polygon(&corners).loops
        });
        Self {
            loops: loops.collect(),
        }
    }

    /// Its area, by Green's theorem.
    pub fn area(&self) -> f64 {
        self.sides().map(Side::area_beside).sum()
    }
}

impl Side {
    fn bulged(start: Vector2<f64>, end: Vector2<f64>, bulge: f64) -> Self {
        let chord = end - start;
        let arc = (bulge != 0.0).then(|| {
            let to_left = Vector2::new(-chord.y, chord.x);
            let center = (start + end) / 2.0 + to_left * ((1.0 - bulge * bulge) / (4.0 * bulge));
            let from_center = start - center;
            Arc {
                center,
                radius: from_center.norm(),
                angle: from_center.y.atan2(from_center.x),
                sweep: 4.0 * bulge.atan(),
            }
        });
        Self { start, end, arc }
    }

    fn circle(center: Vector2<f64>, radius: f64, sweep: f64) -> Self {
        let start = center + Vector2::new(radius, 0.0);
        let angle = 0.0;
        Self {
            start,
            end: start,
            arc: Some(Arc {
                center,
                radius,
                angle,
                sweep,
            }),
        }
    }

    /// The unit direction along it where it starts and where it ends.
    pub fn directions(&self) -> [Vector2<f64>; 2] {
        match self.arc {
            None => [(self.end - self.start).normalize(); 2],
            Some(arc) => [arc.angle, arc.angle + arc.sweep].map(|angle| {
                let (sine, cosine) = angle.sin_cos();
                Vector2::new(-sine, cosine) * arc.sweep.signum()
            }),
        }
    }

    fn scaled(&self, scale: f64) -> Self {
        Self {
            start: self.start * scale,
            end: self.end * scale,
            arc: self.arc.map(|arc| Arc {
                center: arc.center * scale,
                radius: arc.radius * scale,
                ..arc
            }),
        }
    }

    fn mirrored(&self) -> Self {
        Self {
            start: self.start.yx(),
            end: self.end.yx(),
            arc: self.arc.map(|arc| Arc {
                center: arc.center.yx(),
                angle: 0.5 * PI - arc.angle,
                sweep: -arc.sweep,
                ..arc
            }),
        }
    }

    fn chord_is_right_of(&self, point: &Vector2<f64>) -> bool {
        let Self { start, end, .. } = self;
        (start.y > point.y) != (end.y > point.y)
            && point.x < start.x + (point.y - start.y) / (end.y - start.y) * (end.x - start.x)
    }

    /// Whether a point lies between the chord and the arc.
    fn bulge_contains(&self, point: &Vector2<f64>) -> bool {
        self.arc.is_some_and(|arc| {
            let chord = self.end - self.start;
            let to_left = chord.perp(&(point - self.start)) * arc.sweep;
            (point - arc.center).norm_squared() < arc.radius * arc.radius
                && (chord == Vector2::zeros() || to_left < 0.0)
        })
    }

    fn closest_point(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let Some(arc) = self.arc else {
            let chord = LineSegment2::new(self.start, self.end);
            return chord.point_at(chord.line_parameter(point).clamp(0.0, 1.0));
        };
        let from_center = point - arc.center;
        let angle = from_center.y.atan2(from_center.x);
        let along = ((angle - arc.angle) * arc.sweep.signum()).rem_euclid(TAU);
        if along <= arc.sweep.abs() {
            let (sine, cosine) = angle.sin_cos();
            arc.center + Vector2::new(cosine, sine) * arc.radius
        } else if (point - self.start).norm_squared() < (point - self.end).norm_squared() {
            self.start
        } else {
            self.end
        }
    }

    /// Half the integral of x dy − y dx along it.
    fn area_beside(&self) -> f64 {
        let of_triangle = |a: &Vector2<f64>, b: &Vector2<f64>| a.perp(b) / 2.0;
        match self.arc {
            None => of_triangle(&self.start, &self.end),
            Some(arc) => {
                let sector = arc.sweep * arc.radius * arc.radius / 2.0;
                sector + of_triangle(&arc.center, &(self.end - self.start))
            }
        }
    }

    /// Corners of a polygon around it.
    pub fn hull(&self) -> Vec<Vector2<f64>> {
        let around = |arc: Arc| {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            corners.map(|(x, y)| arc.center + Vector2::new(x, y) * arc.radius)
        };
        match self.arc {
            None => vec![self.start, self.end],
            Some(arc) => around(arc).to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn l_shape() -> Profile {
        let corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)];
        Profile::polygon(&corners.map(|(x, y)| Vector2::new(f64::from(x), f64::from(y))))
    }

    #[test]
    fn the_notch_is_outside() {
        let polygon = l_shape();
        assert!(polygon.contains(&Vector2::new(0.5, 1.5)));
        assert!(polygon.contains(&Vector2::new(1.5, 0.5)));
        assert!(!polygon.contains(&Vector2::new(1.5, 1.5)));
        assert!(!polygon.contains(&Vector2::new(-0.1, 1.0)));
        assert_eq!(polygon.area(), 3.0);
    }

    #[test]
    fn the_outline_is_nearest_at_a_side_or_at_a_corner() {
        let polygon = l_shape();
        let on_side = polygon.closest_point_on_outline(&Vector2::new(1.4, 1.9));
        assert_eq!(on_side, Vector2::new(1.0, 1.9));
        let at_corner = polygon.closest_point_on_outline(&Vector2::new(3.0, -1.0));
        assert_eq!(at_corner, Vector2::new(2.0, 0.0));
    }

    /// A square of side 2 around the origin: a half disc to its right, one less at its left, and a hole.
    fn curved() -> Profile {
        let corners = [
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 1.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, -1.0],
        ];
        Profile::chain(&corners).without_disc([1.0, 0.0], 0.5)
    }

    #[test]
    fn arcs_add_and_take_discs() {
        for profile in [curved(), curved().mirrored().mirrored()] {
            for (x, y, inside) in [
                (1.9, 0.1, true),
                (1.9, 0.9, false),
                (-0.2, 0.1, false),
                (-0.5, 0.95, true),
                (0.1, 0.1, true),
                (1.1, 0.1, false),
                (2.1, 0.0, false),
                (-1.1, 0.1, false),
            ] {
                let point = Vector2::new(x, y);
                assert_eq!(profile.contains(&point), inside, "{point}");
                assert_eq!(profile.mirrored().contains(&point.yx()), inside);
                assert_eq!(profile.scaled(2.0).contains(&(2.0 * point)), inside);
            }
            assert!((profile.area() - (4.0 - 0.25 * PI)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_nearest_point_of_an_arc_is_across_from_its_centre_or_an_end() {
        let profile = curved();
        for (from, to) in [
            ((3.0, 0.0), (2.0, 0.0)),
            (
                (1.5, 1.5),
                (1.0 + 0.5 / 0.5_f64.hypot(1.5), 1.5 / 0.5_f64.hypot(1.5)),
            ),
            ((-0.4, 0.0), (0.0, 0.0)),
            ((-2.0, 3.0), (-1.0, 1.0)),
            ((1.0, 0.2), (1.0, 0.5)),
        ] {
            let nearest = profile.closest_point_on_outline(&Vector2::new(from.0, from.1));
            assert!(
                (nearest - Vector2::new(to.0, to.1)).norm() < 1e-12,
                "{from:?}"
            );
        }
    }
}
