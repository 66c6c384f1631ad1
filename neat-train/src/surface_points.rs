//! Sparse points of a scene that the surface is drawn to.

use neat_core::Scene;
use neat_tensor::random::{Purpose, stream};
use rand::RngExt;

/// Points that structure from motion found on surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SurfacePoints {
    in_world: Vec<[f32; 3]>,
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
        }
    }

    /// `count` of them for iteration `iteration`, or none where there are none.
    pub(crate) fn draw(&self, count: usize, seed: u64, iteration: u64) -> Vec<[f32; 3]> {
        if self.in_world.is_empty() {
            return Vec::new();
        }
        let mut rng = stream(seed, Purpose::SurfacePoints, iteration);
        (0..count)
            .map(|_| self.in_world[rng.random_range(0..self.in_world.len())])
            .collect()
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
        assert!(SurfacePoints::of(&scene, 1.0).draw(5, 0, 0).is_empty());

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
        let drawn = points.draw(64, 7, 3);
        assert_eq!(drawn.len(), 64);
        assert_eq!(drawn, points.draw(64, 7, 3));
        assert_ne!(drawn, points.draw(64, 7, 4));
    }
}
