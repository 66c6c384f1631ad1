//! Vertices as whole numbers, each position once.

use nalgebra::Vector3;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A step of the whole numbers is this power of ten of the extent's: coordinates have seven or
/// eight digits, which 32-bit numbers hold, and are off by half a ten-millionth of the extent.
const DIGITS: i32 = 7;

/// The vertices of a file, which grow with its rings.
pub(super) struct Vertices {
    lowest: Vector3<f64>,
    step: f64,
    index_of: BTreeMap<[i64; 3], usize>,
    positions: Vec<[i64; 3]>,
}

impl Vertices {
    /// For points between the lowest and the highest of these; `None` if their extent has no
    /// whole numbers.
    pub fn around<'a>(points: impl Iterator<Item = &'a Vector3<f64>>) -> Option<Self> {
        let bounds = points.fold(None, |bounds, point| match bounds {
            None => Some((*point, *point)),
            Some((low, high)) => Some((point.inf(&low), point.sup(&high))),
        });
        let (lowest, highest): (Vector3<f64>, Vector3<f64>) = bounds.unwrap_or_default();
        let extent = (highest - lowest).max();
        let power = match extent > 0.0 {
            true => extent.log10().floor(),
            false => 0.0,
        };
        // Parsed, a power of ten is the nearest number to it, and is written as one.
        let step: f64 = format!("1e{}", power as i32 - DIGITS).parse().ok()?;
        (extent.is_finite() && lowest.iter().all(|x| x.is_finite()) && step.is_normal()).then(
            || Self {
                lowest,
                step,
                index_of: BTreeMap::new(),
                positions: Vec::new(),
            },
        )
    }

    /// Rings as indices, without points that follow a vertex at the same place, and without
    /// rings of fewer than three; `None` if the outer one is such.
    pub fn rings(&mut self, rings: &[Vec<Vector3<f64>>]) -> Option<Vec<Vec<usize>>> {
        let whole = rings.iter().map(|ring| self.whole_ring(ring));
        let whole: Vec<Vec<[i64; 3]>> = whole.collect();
        if whole.first()?.len() < 3 {
            return None;
        }
        let kept = whole.into_iter().filter(|ring| ring.len() >= 3);
        Some(
            kept.map(|ring| ring.into_iter().map(|at| self.index(at)).collect())
                .collect(),
        )
    }

    fn whole_ring(&self, ring: &[Vector3<f64>]) -> Vec<[i64; 3]> {
        let whole = |point: &Vector3<f64>| -> [i64; 3] {
            ((point - self.lowest) / self.step)
                .map(|x| x.round() as i64)
                .into()
        };
        let mut positions: Vec<[i64; 3]> = ring.iter().map(whole).collect();
        positions.dedup();
        while positions.len() > 1 && positions.first() == positions.last() {
            positions.pop();
        }
        positions
    }

    fn index(&mut self, position: [i64; 3]) -> usize {
        *self.index_of.entry(position).or_insert_with(|| {
            self.positions.push(position);
            self.positions.len() - 1
        })
    }

    /// All vertices.
    pub fn whole_numbers(&self) -> &[[i64; 3]] {
        &self.positions
    }

    /// What leads from whole numbers to coordinates.
    pub fn transform(&self) -> Value {
        let scale = [self.step; 3];
        json!({"scale": scale, "translate": self.lowest.as_slice()})
    }

    /// The lowest and the highest coordinates of all vertices, if there are any.
    pub fn extent(&self) -> Option<[f64; 6]> {
        let coordinate = |axis: usize, whole: i64| self.lowest[axis] + whole as f64 * self.step;
        let mut extent = [0.0; 6];
        for axis in 0..3 {
            let along = self.positions.iter().map(|position| position[axis]);
            extent[axis] = coordinate(axis, along.clone().min()?);
            extent[axis + 3] = coordinate(axis, along.max()?);
        }
        Some(extent)
    }
}
