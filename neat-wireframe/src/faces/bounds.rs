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

    pub fn contain(&self, point: &Vector3<f64>) -> bool {
        self.low <= *point && *point <= self.high
    }

    /// Whether a line through a point in a direction passes through the box.
    pub fn are_hit(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> bool {
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let (low, high) = (self.low[k] - origin[k], self.high[k] - origin[k]);
            if direction[k] != 0.0 {
                let ends = [low / direction[k], high / direction[k]];
                from = from.max(ends[0].min(ends[1]));
                to = to.min(ends[0].max(ends[1]));
            } else if low > 0.0 || high < 0.0 {
                return false;
            }
        }
        from <= to
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
        assert!(unit.contain(&Vector3::repeat(0.5)) && !unit.contain(&Vector3::new(0.5, 0.5, 2.0)));
        let from = Vector3::new(-1.0, 0.5, 0.5);
        assert!(
            unit.are_hit(&from, &Vector3::x()) && unit.are_hit(&from, &Vector3::new(3.0, 1.0, 0.0))
        );
        assert!(
            !unit.are_hit(&from, &Vector3::y())
                && !unit.are_hit(&from, &Vector3::new(1.0, 1.0, 0.0))
        );
    }
}
