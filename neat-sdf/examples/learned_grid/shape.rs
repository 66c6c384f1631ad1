//! Polyhedra with exact signed distances: prisms over polygons, turned at random.

use rand::Rng;
use std::f64::consts::TAU;

/// A point or vector in space.
pub type Vector = [f64; 3];

/// A right prism with sharp edges, inside the unit ball.
pub struct Prism {
    /// Corners of each contour of the base, in order; a contour inside another is
    /// the rim of a hole.
    contours: Vec<Vec<[f64; 2]>>,
    half_height: f64,
    /// Rows: the prism's axes in the world.
    axes: [Vector; 3],
}

/// Names of [`Prism::named`].
pub const NAMES: [&str; 4] = ["house", "bracket", "star", "frame"];

impl Prism {
    /// The shape `name` of [`NAMES`], turned by `rng`.
    ///
    /// # Panics
    /// If there is none.
    pub fn named(name: &str, rng: &mut impl Rng) -> Self {
        let square = |a: f64| vec![[-a, -a], [a, -a], [a, a], [-a, a]];
        let (contours, half_height) = match name {
            "house" => {
                let gable = [
                    [-0.4, -0.4],
                    [0.4, -0.4],
                    [0.4, 0.1],
                    [0.0, 0.45],
                    [-0.4, 0.1],
                ];
                (vec![gable.to_vec()], 0.5)
            }
            "bracket" => {
                let angle = [
                    [-0.5, -0.5],
                    [0.5, -0.5],
                    [0.5, -0.25],
                    [-0.2, -0.25],
                    [-0.2, 0.5],
                    [-0.5, 0.5],
                ];
                (vec![angle.to_vec()], 0.3)
            }
            "star" => {
                let corner = |i: usize| {
                    let radius = [0.6, 0.3][i % 2];
                    let (sine, cosine) = (TAU * i as f64 / 10.0).sin_cos();
                    [radius * cosine, radius * sine]
                };
                (vec![(0..10).map(corner).collect()], 0.25)
            }
            "frame" => (vec![square(0.5), square(0.3)], 0.12),
            _ => panic!("Prism::named: no shape {name}"),
        };
        Self {
            contours,
            half_height,
            axes: random_axes(rng),
        }
    }

    /// Signed distance from the surface, negative inside, and its gradient.
    pub fn distance(&self, point: Vector) -> (f64, Vector) {
        let [x, y, z] = self.axes.map(|axis| dot(axis, point));
        let (base, [bx, by]) = self.base_distance([x, y]);
        let (cap, side) = (z.abs() - self.half_height, z.signum());
        let (distance, local) = if base > 0.0 && cap > 0.0 {
            let length = base.hypot(cap);
            let (b, c) = (base / length, cap / length);
            (length, [b * bx, b * by, c * side])
        } else if base > cap {
            (base, [bx, by, 0.0])
        } else {
            (cap, [0.0, 0.0, side])
        };
        (distance, self.to_world(local))
    }

    /// Signed distance from the base's outline in its plane, and its gradient.
    fn base_distance(&self, q: [f64; 2]) -> (f64, [f64; 2]) {
        let (mut nearest, mut offset, mut inside) = (f64::INFINITY, [0.0; 2], false);
        for [a, b] in self.sides() {
            let along = [b[0] - a[0], b[1] - a[1]];
            let from_a = [q[0] - a[0], q[1] - a[1]];
            let t = (from_a[0] * along[0] + from_a[1] * along[1])
                / (along[0] * along[0] + along[1] * along[1]);
            let t = t.clamp(0.0, 1.0);
            let away = [from_a[0] - t * along[0], from_a[1] - t * along[1]];
            let distance = away[0].hypot(away[1]);
            if distance < nearest {
                (nearest, offset) = (distance, away);
            }
            // Even-odd rule: a ray towards +x crosses the side.
            if (a[1] > q[1]) != (b[1] > q[1]) {
                let crossing = a[0] + (q[1] - a[1]) / along[1] * along[0];
                inside ^= q[0] < crossing;
            }
        }
        let sign = if inside { -1.0 } else { 1.0 };
        let scale = sign / nearest.max(1e-12);
        (sign * nearest, [scale * offset[0], scale * offset[1]])
    }

    /// Sides of the base.
    fn sides(&self) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
        self.contours.iter().flat_map(|contour| {
            let next = contour.iter().cycle().skip(1);
            contour.iter().zip(next).map(|(a, b)| [*a, *b])
        })
    }

    /// The edges, as pairs of junctions.
    pub fn edges(&self) -> Vec<[Vector; 2]> {
        let h = self.half_height;
        let at = |q: [f64; 2], z: f64| self.to_world([q[0], q[1], z]);
        self.sides()
            .flat_map(|[a, b]| {
                [
                    [at(a, -h), at(b, -h)],
                    [at(a, h), at(b, h)],
                    [at(a, -h), at(a, h)],
                ]
            })
            .collect()
    }

    fn to_world(&self, local: Vector) -> Vector {
        let axes = &self.axes;
        std::array::from_fn(|i| (0..3).map(|k| axes[k][i] * local[k]).sum())
    }
}

/// A rotation from a random unit quaternion, as rows.
fn random_axes(rng: &mut impl Rng) -> [Vector; 3] {
    let q: [f64; 4] = std::array::from_fn(|_| neat_tensor::random::standard_normal(rng));
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|c| c / length);
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// The inner product.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_tensor::random::{Purpose, stream};
    use rand::RngExt;

    #[test]
    fn the_gradient_leads_to_the_surface() {
        let mut rng = stream(0, Purpose::Samples, 0);
        for name in NAMES {
            let prism = Prism::named(name, &mut rng);
            for _ in 0..200 {
                let point: Vector = std::array::from_fn(|_| rng.random_range(-0.9..0.9));
                let (distance, gradient) = prism.distance(point);
                assert!((dot(gradient, gradient) - 1.0).abs() < 1e-9);
                let foot = std::array::from_fn(|i| point[i] - distance * gradient[i]);
                assert!(prism.distance(foot).0.abs() < 1e-9, "{name} at {point:?}");
            }
        }
    }

    #[test]
    fn edges_lie_on_the_surface() {
        let prism = Prism::named("frame", &mut stream(1, Purpose::Samples, 0));
        let edges = prism.edges();
        assert_eq!(edges.len(), 24);
        for [a, b] in edges {
            let middle = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
            assert!(prism.distance(middle).0.abs() < 1e-12);
        }
    }
}
