//! Whether sparse points look the same in the views that saw them, where the cameras put them: what
//! speaks for cameras where things look alike everywhere, and matches are mostly wrong.
//!
//! Bricks and boards match their neighbours. But a point of the files is asked for at two places
//! that nobody has to search for: with the right cameras both views look more alike there than
//! the one does to a place beside in the other. With images of something else it is as often the
//! other way round, and with wrong cameras points are not projected to where they were seen.

use crate::corners::Corner;
use crate::descriptor::{Descriptor, describe, distance};
use crate::evidence::evenly;
use crate::working_copies::{WorkingCopies, in_copy};
use nalgebra::Vector2;
use neat_core::{Scene, SceneError, SparsePoint};

/// Views that are looked at, and points in each of them, at most.
const VIEWS: usize = 24;
const POINTS: usize = 400;
/// Fewer pairs of looks do not tell.
const MIN_PAIRS: usize = 100;
/// How far beside is something else, in pixels of the working image: as wide as what is described.
const BESIDE: f32 = 24.0;
/// Standard deviations by which more than half of the pairs must look alike, of all views and of
/// one: views that are asked about are few.
const SIGNIFICANT: [f64; 2] = [6.0, 3.5];
/// A point that is projected farther from where it was seen, as a share of the larger side of the
/// image, does not look like itself: four pixels of a thousand.
const OFF: f64 = 0.004;

/// What a view shows of a point.
struct Look {
    point: usize,
    /// Whether it is projected to where it was seen.
    in_place: bool,
    here: Descriptor,
    /// Left or right of it, and above or below.
    beside: [Descriptor; 2],
}

/// How often points look more alike where they should be, for either way of being beside it.
#[derive(Clone, Copy, Default)]
struct Looks {
    alike: [usize; 2],
    total: [usize; 2],
}

impl Looks {
    fn add(&mut self, axis: usize, [here, beside]: [u32; 2]) {
        self.total[axis] += usize::from(here != beside);
        self.alike[axis] += usize::from(here < beside);
    }

    /// Where images are exchanged, courses of bricks still go on in each other: both axes must
    /// tell.
    fn tell(&self, significant: f64) -> bool {
        let tells = |axis: usize| {
            let chance = self.total[axis] as f64 / 2.0;
            let gain = self.alike[axis] as f64 - chance;
            self.total[axis] >= MIN_PAIRS && gain > significant * (chance / 2.0).sqrt()
        };
        tells(0) && tells(1)
    }
}

/// What the sparse points of a scene say about its cameras.
pub(crate) struct PointLooks {
    all: Looks,
    per_view: Vec<Looks>,
}

impl PointLooks {
    /// Looks at some views, `these` among them.
    ///
    /// # Errors
    /// If an image lies in a file that cannot be read.
    pub fn new(
        scene: &Scene,
        working: &WorkingCopies<'_>,
        these: &[usize],
    ) -> Result<Self, SceneError> {
        let mut views = evenly(scene.views.len(), VIEWS);
        views.extend(these);
        views.sort_unstable();
        views.dedup();
        let found = working.look_at(&views, |view| looks(scene, working, view))?;
        let mut this = Self {
            all: Looks::default(),
            per_view: vec![Looks::default(); scene.views.len()],
        };
        let mut last = vec![None; scene.sparse_points.len()];
        for (&view, looks) in views.iter().zip(&found) {
            for look in looks {
                let Some((other, before)) = last[look.point].replace((view, look.here)) else {
                    continue;
                };
                let here = if look.in_place {
                    distance(&before, &look.here)
                } else {
                    u32::MAX
                };
                for (axis, beside) in look.beside.iter().enumerate() {
                    let distances = [here, distance(&before, beside)];
                    this.all.add(axis, distances);
                    this.per_view[view].add(axis, distances);
                    this.per_view[other].add(axis, distances);
                }
            }
        }
        Ok(this)
    }

    /// What speaks for all cameras, in words; `None` if nothing does.
    pub fn for_all(&self) -> Option<String> {
        let Looks { alike, total } = self.all;
        self.all.tell(SIGNIFICANT[0]).then(|| {
            format!(
                "sparse points look the same in two views where the cameras put them, and not \
                 beside it, {} times of {}",
                alike[0] + alike[1],
                total[0] + total[1]
            )
        })
    }

    /// Whether points speak for the camera of a view.
    pub fn for_view(&self, view: usize) -> bool {
        self.per_view[view].tell(SIGNIFICANT[1])
    }
}

fn looks(scene: &Scene, working: &WorkingCopies<'_>, view: usize) -> Result<Vec<Look>, SceneError> {
    let (image, factor) = working.of(view)?;
    let gradients = image.blurred(1).gradients();
    let camera = &scene.views[view].camera;
    let seen_at = |point: &SparsePoint| {
        let seen = point.observations.iter().find(|seen| seen.view == view);
        seen.map(|seen| seen.pixel)
    };
    let seen: Vec<(usize, Vector2<f64>)> = (scene.sparse_points.iter().enumerate())
        .filter_map(|(index, point)| Some((index, seen_at(point)?)))
        .collect();
    let off = OFF * f64::from(camera.width.max(camera.height));
    let look = |index: usize| {
        let (point, pixel) = seen[index];
        let projection = camera.project(&scene.sparse_points[point].position_in_world);
        let middle = in_copy(&projection.pixel, scene.pixel_center, factor);
        let at = |x: f32, y: f32| {
            let corner = Corner {
                x: middle.x as f32 + x,
                y: middle.y as f32 + y,
                strength: 0.0,
            };
            describe(&gradients, &corner)
        };
        let side = if point.is_multiple_of(2) {
            BESIDE
        } else {
            -BESIDE
        };
        Some(Look {
            point,
            in_place: (projection.pixel - pixel).norm() <= off,
            here: (projection.depth > 0.0).then(|| at(0.0, 0.0))??,
            beside: [at(side, 0.0)?, at(0.0, side)?],
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
    use nalgebra::{Rotation3, Vector3};
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
        let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
        let place = |index: usize, prime: f64| (f64::from(index as u32) * prime).fract() - 0.5;
        let point = |index: usize| {
            let position_in_world =
                Vector3::new(place(index, 0.754_877), place(index, 0.569_840), 0.0);
            let seen = |(view, camera): (usize, &neat_core::Camera)| Observation {
                view,
                pixel: camera.project(&position_in_world).pixel,
            };
            SparsePoint {
                position_in_world,
                observations: cameras.iter().enumerate().map(seen).collect(),
            }
        };
        scene.sparse_points = (0..400).map(point).collect();
        scene
    }

    fn looks(scene: &Scene) -> PointLooks {
        let working = WorkingCopies::new(scene, MemoryLimit::default());
        PointLooks::new(scene, &working, &[]).unwrap()
    }

    fn found(scene: &Scene) -> Option<String> {
        looks(scene).for_all()
    }

    #[test]
    fn points_speak_against_the_one_view_that_is_wrong() {
        let mut scene = wall(0.0);
        let off = Rotation3::from_euler_angles(0.2, 0.13, 0.1);
        scene.views[5].camera.world_from_camera *= off.into_inner();
        let looks = looks(&scene);
        let spoken_for: Vec<usize> = (0..8).filter(|view| looks.for_view(*view)).collect();
        assert!(!looks.for_view(5));
        assert!(spoken_for.len() >= 5, "{spoken_for:?}");
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
