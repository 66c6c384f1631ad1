//! Orthographic views: where a junction lies in a picture.

use nalgebra::{Vector2, Vector3};
use neat_core::extent_of_most;

/// From where an orthographic view looks, in the frame of the document, with its
/// +z axis up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewDirection {
    /// Along +y: x to the right, z up.
    Front,
    /// Along −z: x to the right, y up.
    Top,
    /// Along −x: y to the right, z up.
    Side,
    /// Along (−1, 1, −1), from the front right above: the three axes are equally
    /// foreshortened.
    Isometric,
}

impl ViewDirection {
    /// All directions.
    pub const ALL: [Self; 4] = [Self::Front, Self::Top, Self::Side, Self::Isometric];

    /// Its name, for command lines.
    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Top => "top",
            Self::Side => "side",
            Self::Isometric => "isometric",
        }
    }

    /// The unit vectors that point to the right and up in the picture.
    pub fn right_and_up(self) -> [Vector3<f64>; 2] {
        match self {
            Self::Front => [Vector3::x(), Vector3::z()],
            Self::Top => [Vector3::x(), Vector3::y()],
            Self::Side => [Vector3::y(), Vector3::z()],
            Self::Isometric => [
                Vector3::new(1.0, 1.0, 0.0).normalize(),
                Vector3::new(-1.0, 1.0, 2.0).normalize(),
            ],
        }
    }
}

/// Share of the width that stays free on each side.
const MARGIN: f64 = 0.04;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// All points.
    All,
    /// All but strays, for which it would be small.
    Most,
}

/// An orthographic view of points, fitted into a picture.
pub struct Drawing {
    /// From where it looks.
    pub direction: ViewDirection,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels, at most the width.
    pub height: u32,
    /// Pixels per unit of the document.
    pub scale: f64,
    /// What lies in the centre of the picture: right and up, in units of the
    /// document.
    pub center: Vector2<f64>,
}

impl Drawing {
    /// Fits finite points into a picture of this width; `None` if their extent is
    /// no finite number.
    pub fn new(
        junctions: &[Vector3<f64>],
        frame: Frame,
        direction: ViewDirection,
        width: u32,
    ) -> Option<Self> {
        let [right, up] = direction.right_and_up();
        let projected: Vec<_> = junctions
            .iter()
            .map(|p| Vector2::new(right.dot(p), up.dot(p)))
            .collect();
        let [low, high] = frame.corners(&projected);
        let extent = high - low;
        if !extent.iter().all(|x| x.is_finite()) {
            return None;
        }
        let margin = MARGIN * f64::from(width);
        let inner = f64::from(width) - 2.0 * margin;
        let fitting = inner / extent.max();
        // A single point, or points closer than numbers can tell.
        let scale = if fitting.is_finite() { fitting } else { 1.0 };
        let height = (extent.y * scale + 2.0 * margin).ceil().min(width.into());
        let center = low / 2.0 + high / 2.0;
        Some(Self {
            direction,
            width,
            height: height as u32,
            scale,
            center,
        })
    }

    /// Where a point lies in pixels: x to the right, y down, (0, 0) the corner at the top left.
    pub fn project(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let [right, up] = self.direction.right_and_up();
        let in_units = Vector2::new(right.dot(point), up.dot(point));
        let from_middle = (in_units - self.center) * self.scale;
        let middle = Vector2::new(f64::from(self.width), f64::from(self.height)) / 2.0;
        middle + Vector2::new(from_middle.x, -from_middle.y)
    }

    /// A line width for so many edges: with many, thick lines would hide each other.
    pub fn line_width(&self, edges: usize) -> f64 {
        let thinness = (100.0 / edges.max(1) as f64).sqrt().clamp(0.4, 1.0);
        (f64::from(self.width) / 400.0 * thinness).max(0.75)
    }
}

impl Frame {
    /// The corners of a picture of these points.
    fn corners(self, points: &[Vector2<f64>]) -> [Vector2<f64>; 2] {
        let first = points.first().copied().unwrap_or_default();
        match self {
            Self::All => [
                points.iter().fold(first, |low, p| low.inf(p)),
                points.iter().fold(first, |high, p| high.sup(p)),
            ],
            Self::Most => extent_of_most(points).unwrap_or([first; 2]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_point_where_the_names_say() {
        for direction in ViewDirection::ALL {
            let [right, up] = direction.right_and_up();
            assert!((right.norm() - 1.0).abs() < 1e-15 && (up.norm() - 1.0).abs() < 1e-15);
            assert!(right.dot(&up).abs() < 1e-15);
        }
        let [right, up] = ViewDirection::Isometric.right_and_up();
        let toward_viewer = right.cross(&up);
        assert!((toward_viewer - Vector3::new(1.0, -1.0, 1.0).normalize()).norm() < 1e-15);
        let lengths = [0, 1, 2].map(|axis| right[axis].hypot(up[axis]));
        assert!(lengths.iter().all(|l| (l - lengths[0]).abs() < 1e-15));
    }

    #[test]
    fn points_fill_the_picture_and_lead_back() {
        let points = [
            Vector3::new(500_000.0, 0.0, 1.0),
            Vector3::new(500_004.0, 7.0, 2.0),
        ];
        let drawing = Drawing::new(&points, Frame::All, ViewDirection::Front, 1000).unwrap();
        assert_eq!((drawing.width, drawing.height), (1000, 310));
        let expected = [[40.0, 270.0], [960.0, 40.0]].map(Vector2::from);
        for (point, expected) in points.iter().zip(expected) {
            let pixel = drawing.project(point);
            assert!((pixel - expected).norm() < 1e-9, "{pixel}");
        }
        // Taller than wide: the height is limited, the margin stays.
        let drawing = Drawing::new(&points, Frame::All, ViewDirection::Side, 1000).unwrap();
        for point in &points {
            let pixel = drawing.project(point);
            assert!(pixel.min() > 39.9 && pixel.max() < 960.1);
        }
    }

    #[test]
    fn a_stray_point_does_not_shrink_the_others() {
        let mut points: Vec<_> = (0..200)
            .map(|i| Vector3::new(f64::from(i), 0.0, f64::from(i % 20)))
            .collect();
        let all = Drawing::new(&points, Frame::Most, ViewDirection::Front, 1000).unwrap();
        points.push(Vector3::new(1e4, 0.0, 5.0));
        let drawing = Drawing::new(&points, Frame::Most, ViewDirection::Front, 1000).unwrap();
        assert!(drawing.scale > 0.6 * all.scale, "{}", drawing.scale);
        let inside = |p: &&Vector3<f64>| (0.0..1000.0).contains(&drawing.project(p).x);
        assert_eq!(points.iter().filter(inside).count(), 200);
    }

    #[test]
    fn few_and_far_points_are_no_problem() {
        for points in [vec![], vec![Vector3::new(3.0, 4.0, 5.0)]] {
            let drawing = Drawing::new(&points, Frame::All, ViewDirection::Top, 100).unwrap();
            assert!(points.iter().all(|p| drawing.project(p).x == 50.0));
        }
        let close = [Vector3::zeros(), Vector3::repeat(5e-324)];
        let drawing = Drawing::new(&close, Frame::All, ViewDirection::Isometric, 100).unwrap();
        for point in &close {
            assert!(drawing.project(point).iter().all(|x| x.is_finite()));
        }
        let far = [Vector3::repeat(f64::MAX), Vector3::repeat(-f64::MAX)];
        assert!(Drawing::new(&far, Frame::All, ViewDirection::Isometric, 100).is_none());
    }
}
