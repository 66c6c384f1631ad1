//! Whether sparse points look the same in the views that saw them, where the cameras put them: what
//! speaks for cameras where things look alike everywhere, and matches are mostly wrong.
//!
//! Bricks and boards match their neighbours. But a point of the files is asked for at two places
//! that nobody has to search for: with the right cameras both views look more alike there than
//! the one does to a place beside in the other. With wrong ones, or with images of something
//! else, it is as often the other way round.

use crate::corners::Corner;
use crate::descriptor::{Descriptor, describe, distance};
use crate::evidence::evenly;
use crate::working_copies::WorkingCopies;
use neat_core::{Scene, SceneError, SparsePoint};

/// Views that are looked at, and points in each of them, at most.
const VIEWS: usize = 24;
const POINTS: usize = 400;
/// Fewer pairs of looks do not tell.
const MIN_PAIRS: usize = 100;
/// How far beside is something else, in pixels of the working image: as wide as what is described.
const BESIDE: f32 = 24.0;
/// Standard deviations by which more than half of the pairs must look alike.
const SIGNIFICANT: f64 = 6.0;

/// What a view shows of a point.
struct Look {
    point: usize,
    here: Descriptor,
    /// Left or right of it, and above or below.
    beside: [Descriptor; 2],
}

/// What speaks for the cameras of a scene with sparse points, in words; `None` if nothing does.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(crate) fn points_look_alike(
    scene: &Scene,
    working: &WorkingCopies<'_>,
) -> Result<Option<String>, SceneError> {
    let views = evenly(scene.views.len(), VIEWS);
    let looks = working.look_at(&views, |view| looks(scene, working, view))?;
    let mut last = vec![None; scene.sparse_points.len()];
    let (mut alike, mut total) = ([0; 2], [0; 2]);
    for look in looks.iter().flatten() {
        let Some(before) = last[look.point].replace(look.here) else {
            continue;
        };
        let here = distance(&before, &look.here);
        for (axis, beside) in look.beside.iter().enumerate() {
            let beside = distance(&before, beside);
            total[axis] += usize::from(here != beside);
            alike[axis] += usize::from(here < beside);
        }
    }
    // Where images are exchanged, courses of bricks still go on in each other: both axes must tell.
    let is_significant = |axis: usize| {
        let chance = total[axis] as f64 / 2.0;
        alike[axis] as f64 - chance > SIGNIFICANT * (chance / 2.0).sqrt()
    };
    let enough = total[0].min(total[1]) >= MIN_PAIRS;
    Ok((enough && is_significant(0) && is_significant(1)).then(|| {
        let (alike, total) = (alike[0] + alike[1], total[0] + total[1]);
        format!(
            "sparse points look the same in two views where the cameras put them, and not beside \
             it, {alike} times of {total}"
        )
    }))
}

fn looks(scene: &Scene, working: &WorkingCopies<'_>, view: usize) -> Result<Vec<Look>, SceneError> {
    let (image, factor) = working.of(view)?;
    let gradients = image.blurred(1).gradients();
    let camera = &scene.views[view].camera;
    let is_seen = |point: &SparsePoint| point.observations.iter().any(|seen| seen.view == view);
    let seen: Vec<usize> = (0..scene.sparse_points.len())
        .filter(|index| is_seen(&scene.sparse_points[*index]))
        .collect();
    let look = |index: usize| {
        let point = seen[index];
        let projection = camera.project(&scene.sparse_points[point].position_in_world);
        let in_copy =
            |full: f64| ((full - scene.pixel_center + 0.5) / f64::from(factor) - 0.5) as f32;
        let at = |[x, y]: [f32; 2]| {
            let (x, y) = (
                in_copy(projection.pixel.x) + x,
                in_copy(projection.pixel.y) + y,
            );
            describe(
                &gradients,
                &Corner {
                    x,
                    y,
                    strength: 0.0,
                },
            )
        };
        let side = if point.is_multiple_of(2) {
            BESIDE
        } else {
            -BESIDE
        };
        Some(Look {
            point,
            here: (projection.depth > 0.0).then(|| at([0.0, 0.0]))??,
            beside: [at([side, 0.0])?, at([0.0, side])?],
        })
    };
    Ok((evenly(seen.len(), POINTS).into_iter())
        .filter_map(look)
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};
    use nalgebra::{Rotation3, Vector2, Vector3};
    use neat_core::synthetic::{SyntheticScene, generate};
    use neat_core::{MemoryLimit, Observation};

    /// A wall of bricks with stains, before all cameras, and points all over it. In the images it
    /// is moved by so much, by another amount in each.
    fn wall(moved: f64) -> Scene {
        let config = SyntheticScene {
            views: 8,
            image_size: 256,
            ..SyntheticScene::default()
        };
        let mut scene = generate(&config).unwrap().scene;
        let shade = |x: f64, y: f64| {
            let joint = (x * 12.0).rem_euclid(1.0) < 0.2 || (y * 24.0).rem_euclid(1.0) < 0.2;
            let stain = 60.0 * (5.1 * x + 1.0).sin() * (4.3 * y).sin();
            (if joint { 90.0 } else { 150.0 } + stain) as u8
        };
        for (index, view) in scene.views.iter_mut().enumerate() {
            let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 0.1 * (index as f64 - 3.5));
            view.camera.world_from_camera = turn.into_inner();
            view.camera.center_in_world = turn * Vector3::new(0.0, 0.0, -1.6);
            let camera = view.camera;
            let image = RgbImage::from_fn(camera.width, camera.height, |x, y| {
                let at = Vector2::new(f64::from(x), f64::from(y)).add_scalar(0.5);
                let ray = camera.ray_through(&at);
                let point = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
                let by = |rate: f64| moved * (rate * index as f64).sin();
                Rgb([shade(point.x + by(2.3), point.y + by(1.7)); 3])
            });
            view.image = image.into();
        }
        scene.pixel_center = 0.5;
        let observations: Vec<Observation> = (scene.views.iter().enumerate())
            .map(|(view, of)| Observation {
                view,
                pixel: of.camera.project(&Vector3::zeros()).pixel,
            })
            .collect();
        let place = |index: usize, prime: f64| (f64::from(index as u32) * prime).fract() - 0.5;
        scene.sparse_points = (0..400)
            .map(|index| SparsePoint {
                position_in_world: Vector3::new(
                    place(index, 0.754_877),
                    place(index, 0.569_840),
                    0.0,
                ),
                observations: observations.clone(),
            })
            .collect();
        scene
    }

    fn found(scene: &Scene) -> Option<String> {
        points_look_alike(scene, &WorkingCopies::new(scene, MemoryLimit::default())).unwrap()
    }

    #[test]
    fn points_on_a_wall_of_bricks_speak_for_right_cameras_alone() {
        let scene = wall(0.0);
        assert!(found(&scene).is_some());
        let mut turned = wall(0.0);
        for (index, view) in turned.views.iter_mut().enumerate() {
            let angle = |rate: f64| 0.3 * (rate * index as f64).sin();
            let off = Rotation3::from_euler_angles(angle(2.3), angle(1.7), angle(1.1));
            view.camera.world_from_camera *= off.into_inner();
        }
        assert_eq!(found(&turned), None);
        assert_eq!(found(&wall(0.3)), None);
    }

    #[test]
    fn few_points_tell_nothing() {
        let mut scene = wall(0.0);
        scene.sparse_points.truncate(10);
        assert_eq!(found(&scene), None);
        scene.sparse_points.clear();
        assert_eq!(found(&scene), None);
    }
}
