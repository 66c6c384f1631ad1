//! Sparse points of a scene that the surface is drawn to.

use neat_core::Scene;
use neat_tensor::random::{Purpose, stream};
use rand::RngExt;

/// A point and its signed distance from the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownDistance {
    /// In the world.
    pub point: [f32; 3],
    /// In the world, positive outside.
    pub distance: f32,
}

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedPoint {
    /// In the world.
    pub position: [f32; 3],
    /// Of length 1, to the outside.
    pub normal: [f32; 3],
}

/// Points on surfaces, some with normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SurfacePoints {
    in_world: Vec<[f32; 3]>,
    /// Of the last points: those of structure from motion have none.
    normals: Vec<[f32; 3]>,
}

impl SurfacePoints {
    /// The sparse points of `scene` inside the modelled ball. Where the scene says
    /// how many views observe each, points of fewer than three are left out: two
    /// views agree on many a wrong point.
    pub(crate) fn of(scene: &Scene, scene_radius: f64) -> Self {
        const MIN_VIEWS: usize = 3;
        let known = |observations: usize| observations == 0 || observations >= MIN_VIEWS;
        Self {
            in_world: (scene.sparse_points.iter())
                .filter(|point| known(point.observations.len()))
                .map(|point| point.position_in_world)
                .filter(|position| position.norm() < scene_radius)
                .map(|position| position.map(|c| c as f32).into())
                .collect(),
            normals: Vec::new(),
        }
    }

    /// Adds those of `points` inside the modelled ball.
    pub(crate) fn extend(&mut self, points: &[OrientedPoint], scene_radius: f64) {
        let norm = |p: &[f32; 3]| p.iter().map(|x| x * x).sum::<f32>().sqrt();
        let inside = points
            .iter()
            .filter(|p| f64::from(norm(&p.position)) < scene_radius);
        for point in inside {
            self.in_world.push(point.position);
            self.normals.push(point.normal);
        }
    }

    /// `count` of them for iteration `iteration`, or none where there are none. Those with
    /// normals are moved along them by up to `reach`.
    pub(crate) fn draw(
        &self,
        count: usize,
        reach: f64,
        seed: u64,
        iteration: u64,
    ) -> Vec<KnownDistance> {
        if self.in_world.is_empty() {
            return Vec::new();
        }
        let mut rng = stream(seed, Purpose::SurfacePoints, iteration);
        let without_normal = self.in_world.len() - self.normals.len();
        let mut draw = || {
            let index = rng.random_range(0..self.in_world.len());
            let point = self.in_world[index];
            let Some(normal) = index.checked_sub(without_normal).map(|i| self.normals[i]) else {
                return KnownDistance {
                    point,
                    distance: 0.0,
                };
            };
            let distance = (reach * (rng.random::<f64>() * 2.0 - 1.0)) as f32;
            let moved = |axis: usize| point[axis] + distance * normal[axis];
            KnownDistance {
                point: [0, 1, 2].map(moved),
                distance,
            }
        };
        (0..count).map(|_| draw()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector2, Vector3};
    use neat_core::synthetic::{SyntheticScene, generate};
    use neat_core::{Observation, SparsePoint};

    #[test]
    fn points_that_are_certain_and_inside_are_drawn_anew_in_every_iteration() {
        let small = SyntheticScene {
            views: 4,
            image_size: 48,
            min_visible_length: 2.0,
            ..SyntheticScene::default()
        };
        let mut scene = generate(&small).unwrap().scene;
        assert!(SurfacePoints::of(&scene, 1.0).draw(5, 0.0, 0, 0).is_empty());

        let seen = |views: usize| {
            let observation = |view| Observation {
                view,
                pixel: Vector2::zeros(),
            };
            (0..views).map(observation).collect()
        };
        let point = |x: f64, views| SparsePoint {
            position_in_world: Vector3::new(x, 0.0, 0.0),
            observations: seen(views),
        };
        scene.sparse_points = vec![point(0.1, 0), point(0.2, 2), point(0.3, 3), point(1.5, 4)];
        let points = SurfacePoints::of(&scene, 1.0);
        assert_eq!(points.in_world, [[0.1, 0.0, 0.0], [0.3, 0.0, 0.0]]);
        let drawn = points.draw(64, 0.0, 7, 3);
        assert_eq!(drawn.len(), 64);
        assert_eq!(drawn, points.draw(64, 0.0, 7, 3));
        assert_ne!(drawn, points.draw(64, 0.0, 7, 4));
    }

    #[test]
    fn points_with_normals_are_drawn_beside_the_surface() {
        let mut points = SurfacePoints {
            in_world: vec![[0.0; 3]],
            ..SurfacePoints::default()
        };
        let oriented = |x: f32| OrientedPoint {
            position: [x, 0.0, 0.0],
            normal: [0.0, 0.0, 1.0],
        };
        points.extend(&[oriented(0.5), oriented(1.5)], 1.0);
        let drawn = points.draw(200, 0.1, 3, 4);
        let (sparse, dense): (Vec<KnownDistance>, Vec<KnownDistance>) =
            drawn.into_iter().partition(|known| known.point[0] == 0.0);
        assert!(sparse.len() > 50 && dense.len() > 50);
        // Without a normal a point speaks for itself alone.
        assert!(
            sparse
                .iter()
                .all(|known| known.distance == 0.0 && known.point == [0.0; 3])
        );
        assert!(
            dense
                .iter()
                .all(|known| known.point == [0.5, 0.0, known.distance])
        );
        let most = |side: f32| dense.iter().map(|d| side * d.distance).fold(0.0, f32::max);
        let near_the_reach = 0.08..=0.1;
        assert!(near_the_reach.contains(&most(1.0)) && near_the_reach.contains(&most(-1.0)));
        assert!(
            points
                .draw(9, 0.0, 3, 4)
                .iter()
                .all(|known| known.distance == 0.0)
        );
    }
}
