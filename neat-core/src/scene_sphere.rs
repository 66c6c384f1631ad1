//! The scene sphere: the ball of space that is modelled.
//!
//! Poses come in any frame and unit: a reconstruction has its origin at some
//! camera, a survey hundreds of kilometres away. [`crate::load_scene`] moves the
//! world so that its origin is the centre of this sphere, and
//! [`crate::Scene::original_from_world`] leads back.

use crate::{Camera, Ray, SparsePoint};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// What places the scene sphere. As text `auto`, `file`, `points`, `cameras`,
/// `masks`, or four numbers `x,y,z,radius` in the frame and unit of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum SphereChoice {
    /// The first that there is: what the file declares, masks, sparse points, the
    /// origin of the file if all cameras look at it, where the cameras look.
    #[default]
    Auto,
    /// Around the origin of the file: with the radius that it declares, or as
    /// large as all cameras see.
    File,
    /// Around the sparse points of the reconstruction.
    Points,
    /// Around the point that the cameras look at, as large as they see.
    Cameras,
    /// Around what lies within the masks of all views.
    Masks,
    /// As given.
    Given {
        /// Centre in the frame of the files.
        center: Vector3<f64>,
        /// Radius in the unit of the files.
        radius: f64,
    },
}

/// A text that is no [`SphereChoice`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` does not say where the scene sphere is: use auto, file, points, cameras, masks, or four numbers x,y,z,radius with a radius above 0"
)]
pub struct UnknownSphere(String);

impl FromStr for SphereChoice {
    type Err = UnknownSphere;

    fn from_str(text: &str) -> Result<Self, UnknownSphere> {
        match text {
            "auto" => return Ok(Self::Auto),
            "file" => return Ok(Self::File),
            "points" => return Ok(Self::Points),
            "cameras" => return Ok(Self::Cameras),
            "masks" => return Ok(Self::Masks),
            _ => {}
        }
        let numbers: Result<Vec<f64>, _> =
            text.split(',').map(|x| x.trim().parse::<f64>()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, z, radius])
                if [x, y, z, radius].iter().all(|x| x.is_finite()) && radius > 0.0 =>
            {
                Ok(Self::Given {
                    center: Vector3::new(x, y, z),
                    radius,
                })
            }
            _ => Err(UnknownSphere(text.to_owned())),
        }
    }
}

impl TryFrom<String> for SphereChoice {
    type Error = UnknownSphere;

    fn try_from(text: String) -> Result<Self, UnknownSphere> {
        text.parse()
    }
}

impl From<SphereChoice> for String {
    fn from(choice: SphereChoice) -> Self {
        choice.to_string()
    }
}

impl fmt::Display for SphereChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::File => f.write_str("file"),
            Self::Points => f.write_str("points"),
            Self::Cameras => f.write_str("cameras"),
            Self::Masks => f.write_str("masks"),
            Self::Given { center, radius } => {
                write!(f, "{},{},{},{radius}", center.x, center.y, center.z)
            }
        }
    }
}

/// What a scene sphere was placed by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SphereSource {
    /// The origin of the poses.
    File,
    /// The sparse points.
    Points,
    /// The cameras.
    Cameras,
    /// The masks.
    Masks,
    /// The user.
    Given,
    /// Nothing: it lies around the origin of the poses for want of evidence.
    Unknown,
}

impl fmt::Display for SphereSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::File => "the frame of the file",
            Self::Points => "the sparse points",
            Self::Cameras => "what the cameras look at",
            Self::Masks => "the masks",
            Self::Given => "the given numbers",
            Self::Unknown => "nothing but the origin of the poses",
        })
    }
}

/// The scene sphere, in the frame and unit of the user's files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneSphere {
    /// Its centre.
    pub center: Vector3<f64>,
    /// Its radius.
    pub radius: f64,
    /// What placed it.
    pub source: SphereSource,
}

impl fmt::Display for SceneSphere {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.center.into();
        write!(
            f,
            "centre ({x:.4}, {y:.4}, {z:.4}), radius {:.4}, from {}",
            self.radius, self.source
        )
    }
}

/// A centre and a radius.
pub(crate) type Ball = (Vector3<f64>, f64);

/// Every object of a scene should lie within this share of the space that all
/// cameras see: with exactly 1 its corners can fall on the border.
const BALL_MARGIN: f64 = 1.2;

/// Largest sine between a camera's axis and the direction of the middle of a
/// scene that it looks at.
const LOOKS_AT: f64 = 0.15;

/// Fewer points than this do not tell where a scene is.
const MIN_POINTS: usize = 20;
/// Points seen by fewer views are often wrong …
const MIN_OBSERVATIONS: usize = 3;
/// … and do not count, unless most are: then the others lie where some views happen to be near
/// each other.
const SEEN_OFTEN: f64 = 0.5;
/// Stray points: further from the middle than so many times the median distance.
const STRAY_DISTANCE: f64 = 4.0;
/// The share of the remaining points within the sphere, before the margin.
const POINTS_INSIDE: f64 = 0.98;
const POINTS_MARGIN: f64 = 1.05;

/// 1.2 times the largest ball around the origin that every camera sees whole,
/// which is |c| · sin(atan(min(W, H) / 2 / f)) for a camera at c that looks at the
/// origin. Infinite without cameras.
pub(crate) fn visible_radius<'a>(cameras: impl Iterator<Item = &'a Camera>) -> f64 {
    let seen = |camera: &Camera| camera.center_in_world.norm() * half_angle(camera).sin();
    BALL_MARGIN * cameras.map(seen).fold(f64::INFINITY, f64::min)
}

/// Half of the smaller angle of view.
fn half_angle(camera: &Camera) -> f64 {
    let half_width = f64::from(camera.width) / camera.intrinsics.fx;
    let half_height = f64::from(camera.height) / camera.intrinsics.fy;
    (half_width.min(half_height) / 2.0).atan()
}

/// Whether the origin of the poses is where a scene was centred: all cameras look
/// at it.
pub(crate) fn is_centered(cameras: &[Camera]) -> bool {
    !cameras.is_empty()
        && cameras.iter().all(|camera| {
            let to_origin = -camera.center_in_world;
            let distance = to_origin.norm();
            let forward = camera.forward();
            distance > 0.0
                && forward.dot(&to_origin) > 0.0
                && forward.cross(&to_origin).norm() <= LOOKS_AT * distance
        })
}

/// Around the middle of the points: the median of each coordinate, which stray
/// points hardly move. `None` where there are too few.
pub(crate) fn from_points(points: &[SparsePoint]) -> Option<Ball> {
    let seen_often = |point: &&SparsePoint| point.observations.len() >= MIN_OBSERVATIONS;
    let mut chosen: Vec<Vector3<f64>> = (points.iter().filter(seen_often))
        .map(|point| point.position_in_world)
        .collect();
    let enough = (SEEN_OFTEN * points.len() as f64).max(MIN_POINTS as f64);
    if (chosen.len() as f64) < enough {
        chosen = points.iter().map(|point| point.position_in_world).collect();
    }
    if chosen.len() < MIN_POINTS {
        return None;
    }
    let center =
        Vector3::from_fn(|axis, _| median(chosen.iter().map(|point| point[axis]).collect()));
    let mut distances: Vec<f64> = chosen.iter().map(|point| (point - center).norm()).collect();
    let reach = STRAY_DISTANCE * median(distances.clone());
    distances.retain(|&distance| distance <= reach);
    distances.sort_by(f64::total_cmp);
    let last = distances.len() - 1;
    let radius = POINTS_MARGIN * distances[(POINTS_INSIDE * last as f64).ceil() as usize];
    (radius.is_finite() && radius > 0.0).then_some((center, radius))
}

/// The upper median.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Around the point nearest to the optical axes, as large as the cameras that look
/// at it see. `None` where no point is looked at, as by parallel cameras.
pub(crate) fn from_cameras(cameras: &[Camera]) -> Option<Ball> {
    let axes: Vec<Ray> = (cameras.iter())
        .map(|camera| Ray {
            origin: camera.center_in_world,
            direction: camera.forward(),
        })
        .collect();
    let center = met_by_most(&axes)?;
    let mut radii: Vec<f64> = (cameras.iter())
        .filter_map(|camera| {
            let to_center = center - camera.center_in_world;
            let off_axis = camera.forward().angle(&to_center);
            let radius = to_center.norm() * (half_angle(camera) - off_axis).sin();
            (radius > 0.0).then_some(radius)
        })
        .collect();
    if 2 * radii.len() < cameras.len() {
        return None;
    }
    radii.sort_by(f64::total_cmp);
    // Close-ups do not shrink the scene.
    Some((center, BALL_MARGIN * radii[radii.len() / 4]))
}

/// The point that most of the rays pass near. `None` where they are parallel.
pub(crate) fn met_by_most(rays: &[Ray]) -> Option<Vector3<f64>> {
    let mut weights = vec![1.0; rays.len()];
    let mut center = Vector3::zeros();
    // Rays that lead elsewhere lose their say.
    for _ in 0..10 {
        center = nearest_to(rays, &weights)?;
        let distances: Vec<f64> = (rays.iter())
            .map(|ray| (center - ray.origin).cross(&ray.direction).norm())
            .collect();
        let scale = median(distances.clone());
        if scale <= 0.0 {
            break;
        }
        for (weight, distance) in weights.iter_mut().zip(distances) {
            *weight = 1.0 / (1.0 + (distance / scale).powi(2));
        }
    }
    Some(center)
}

/// Rays must differ in direction by more than this for their nearest point to
/// mean something: the smallest eigenvalue of Σ w (1 − d dᵀ) over Σ w.
const MIN_SPREAD: f64 = 1e-3;

/// The point with the least weighted sum of squared distances to the rays.
fn nearest_to(rays: &[Ray], weights: &[f64]) -> Option<Vector3<f64>> {
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (ray, &weight) in rays.iter().zip(weights) {
        let across = weight * (Matrix3::identity() - ray.direction * ray.direction.transpose());
        matrix += across;
        right += across * ray.origin;
    }
    let spread = matrix.symmetric_eigenvalues().min();
    if spread.is_nan() || spread <= MIN_SPREAD * weights.iter().sum::<f64>() {
        return None;
    }
    matrix.cholesky().map(|cholesky| cholesky.solve(&right))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{Intrinsics, Observation};
    use nalgebra::{Matrix4, Rotation3, Vector2};

    /// A camera at `position` that looks at `target`.
    pub fn camera(position: Vector3<f64>, target: Vector3<f64>) -> Camera {
        let forward = (target - position).normalize();
        let right = Vector3::z().cross(&forward).normalize();
        let rotation = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        let intrinsics = Intrinsics {
            fx: 100.0,
            fy: 100.0,
            cx: 75.0,
            cy: 100.0,
            skew: 0.0,
        };
        let mut pose = rotation.to_homogeneous();
        pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&position);
        Camera::from_matrices(intrinsics, &pose, 150, 200)
    }

    /// Cameras around `target` at distance 5: half of the smaller side over the
    /// focal length is 3/4, sine 3/5.
    pub fn ring(target: Vector3<f64>, count: usize) -> Vec<Camera> {
        (0..count)
            .map(|index| {
                let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), index as f64);
                camera(target + turn * Vector3::new(4.0, 0.0, 3.0), target)
            })
            .collect()
    }

    fn point(position_in_world: Vector3<f64>) -> SparsePoint {
        SparsePoint {
            position_in_world,
            observations: Vec::new(),
        }
    }

    #[test]
    fn text_and_choice_agree() {
        let given = SphereChoice::Given {
            center: Vector3::new(5.18, -22.83, -6.7),
            radius: 17.4,
        };
        for choice in [
            SphereChoice::Auto,
            SphereChoice::File,
            SphereChoice::Points,
            SphereChoice::Cameras,
            SphereChoice::Masks,
            given,
        ] {
            assert_eq!(choice.to_string().parse(), Ok(choice));
            let json = serde_json::to_string(&choice).unwrap();
            assert_eq!(serde_json::from_str::<SphereChoice>(&json).unwrap(), choice);
        }
        for bad in ["", "point", "1,2,3", "1,2,3,0", "1,2,3,nan", "1,2,3,4,5"] {
            assert!(bad.parse::<SphereChoice>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_visible_ball_is_the_largest_that_the_nearest_camera_sees() {
        let far = camera(Vector3::new(9.0, 0.0, 0.0), Vector3::zeros());
        let near = camera(Vector3::new(0.0, 5.0, 0.0), Vector3::zeros());
        let radius = visible_radius([far, near].iter());
        assert!((radius - 1.2 * 5.0 * 0.6).abs() < 1e-12);
        assert_eq!(visible_radius([].iter()), f64::INFINITY);
    }

    #[test]
    fn cameras_show_where_they_look() {
        let target = Vector3::new(1000.0, -20.0, 3.0);
        let mut cameras = ring(target, 12);
        let (center, radius) = from_cameras(&cameras).unwrap();
        assert!((center - target).norm() < 1e-6, "{center}");
        assert!((radius - 1.2 * 5.0 * 0.6).abs() < 1e-6, "{radius}");
        assert!(!is_centered(&cameras));
        assert!(is_centered(&ring(Vector3::zeros(), 12)));

        // One that looks away does not matter much.
        cameras[3] = camera(cameras[3].center_in_world, Vector3::new(980.0, 0.0, 0.0));
        let (center, _) = from_cameras(&cameras).unwrap();
        assert!((center - target).norm() < 0.1, "{center}");
    }

    #[test]
    fn parallel_cameras_show_no_middle() {
        let cameras: Vec<Camera> = (0..5)
            .map(|index| {
                let position = Vector3::new(0.0, f64::from(index), 0.0);
                camera(position, position + Vector3::x())
            })
            .collect();
        assert_eq!(from_cameras(&cameras), None);
        // Back to back they do not look at the point between them.
        let apart: Vec<Camera> = (0..8)
            .map(|index| {
                let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), f64::from(index));
                let position = turn * Vector3::new(4.0, 0.0, 1.0);
                camera(position, 2.0 * position)
            })
            .collect();
        assert_eq!(from_cameras(&apart), None);
    }

    #[test]
    fn stray_points_do_not_move_the_sphere() {
        let center = Vector3::new(5.0, -22.0, -6.0);
        let mut points: Vec<SparsePoint> = (0..400)
            .map(|index| {
                let turn = Rotation3::from_euler_angles(f64::from(index), 2.0, 0.3);
                let distance = 0.5 + f64::from(index % 20) / 20.0;
                point(center + turn * Vector3::new(0.0, 0.0, distance))
            })
            .collect();
        points.extend((0..5).map(|_| point(Vector3::new(1e6, 0.0, 0.0))));
        let (found, radius) = from_points(&points).unwrap();
        assert!((found - center).norm() < 0.2, "{found}");
        assert!((1.3..1.8).contains(&radius), "{radius}");
        assert_eq!(from_points(&points[..MIN_POINTS - 1]), None);
        // Points in one place have no extent.
        assert_eq!(from_points(&vec![point(center); 50]), None);
    }

    #[test]
    fn points_of_two_views_count_where_most_are() {
        let seen_by = |views: usize, x: f64| SparsePoint {
            position_in_world: Vector3::x() * x,
            observations: (0..views)
                .map(|view| Observation {
                    view,
                    pixel: Vector2::zeros(),
                })
                .collect(),
        };
        // Views that happen to be near each other see one end of a scene thrice.
        let at_end = |count: usize| (0..count).map(|i| seen_by(3, 9.0 + i as f64 / 100.0));
        let all_over = |count: usize| (0..count).map(|i| seen_by(2, 10.0 * i as f64 / 100.0));
        let few: Vec<_> = at_end(30).chain(all_over(100)).collect();
        assert!(from_points(&few).unwrap().0.x < 7.0);
        let many: Vec<_> = at_end(100).chain(all_over(30)).collect();
        assert!(from_points(&many).unwrap().0.x > 9.0);
    }

    #[test]
    fn a_camera_at_the_origin_does_not_look_at_it() {
        let there = Camera::from_matrices(
            ring(Vector3::zeros(), 1)[0].intrinsics,
            &Matrix4::identity(),
            150,
            200,
        );
        assert!(!is_centered(&[there]));
        assert!(!is_centered(&[]));
    }
}
