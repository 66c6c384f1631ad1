//! Boxes along the axes, to leave out what cannot matter.

use nalgebra::Vector3;

/// The least and the greatest coordinates of some points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>) -> Self {
        let none = Self {
            low: Vector3::repeat(f64::INFINITY),
            high: Vector3::repeat(f64::NEG_INFINITY),
        };
        points.into_iter().fold(none, |bounds, point| Self {
            low: bounds.low.inf(point),
            high: bounds.high.sup(point),
        })
    }

    /// The greatest side.
    pub fn extent(&self) -> f64 {
        (self.high - self.low).max()
    }

    pub fn widened(&self, by: f64) -> Self {
        Self {
            low: self.low.add_scalar(-by),
            high: self.high.add_scalar(by),
        }
    }

    pub fn lies_in(&self, other: &Self) -> bool {
        self.low >= other.low && self.high <= other.high
    }

    pub fn meets(&self, other: &Self) -> bool {
        self.low <= other.high && self.high >= other.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_meet_and_lie_in_each_other() {
        let unit = Bounds::of(&[Vector3::zeros(), Vector3::repeat(1.0)]);
        let beside = Bounds::of(&[Vector3::new(1.5, 0.2, 0.2), Vector3::new(2.0, 0.4, 0.4)]);
        let line = Bounds::of(&[Vector3::new(-1.0, 0.5, 0.5), Vector3::new(3.0, 0.5, 0.5)]);
        assert!(!unit.meets(&beside) && unit.widened(0.6).meets(&beside));
        assert!(line.meets(&unit) && unit.meets(&line) && !line.lies_in(&unit));
        assert!(unit.lies_in(&unit) && unit.lies_in(&unit.widened(0.1)));
        assert!((line.extent() - 4.0).abs() < 1e-12);
    }
}
