//! A scene: posed images, each with its 2D wireframe.

use crate::{Camera, SceneError, ViewError, ViewImage, Wireframe2d, scene_sphere, view_name};
use nalgebra::{Matrix4, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A transform `x ↦ scale · x + translation` with one scale for all axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Similarity {
    /// Common scale of the three axes. Negative where the frame it leads to is the mirror image.
    pub scale: f64,
    /// Added after scaling.
    pub translation: Vector3<f64>,
}

impl Similarity {
    /// The transform that changes nothing.
    pub fn identity() -> Self {
        Self {
            scale: 1.0,
            translation: Vector3::zeros(),
        }
    }

    /// Maps a point.
    pub fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        point * self.scale + self.translation
    }

    /// The transform back.
    pub fn inverse(&self) -> Self {
        Self {
            scale: 1.0 / self.scale,
            translation: -self.translation / self.scale,
        }
    }

    /// What a length becomes, as a factor.
    pub fn length_factor(&self) -> f64 {
        self.scale.abs()
    }

    /// Maps a camera. In a frame that is mirrored its axes are left-handed: it projects as
    /// before, and is what the files hold.
    pub fn apply_to_camera(&self, camera: &Camera) -> Camera {
        Camera {
            world_from_camera: camera.world_from_camera * self.scale.signum(),
            center_in_world: self.apply(&camera.center_in_world),
            ..*camera
        }
    }

    /// The same to a right-handed frame: that of the files, or its image through their origin.
    pub fn without_mirroring(&self) -> Self {
        Self {
            scale: self.scale.abs(),
            translation: self.translation * self.scale.signum(),
        }
    }

    /// As a 4×4 matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        Matrix4::new_scaling(self.scale).append_translation(&self.translation)
    }
}

/// One posed image and what was detected in it.
#[derive(Clone, Debug)]
pub struct View {
    /// The image's file name without folder and ending.
    pub name: String,
    /// Intrinsics and pose, in the scene's world frame.
    pub camera: Camera,
    /// Junctions and segments, in image coordinates.
    pub wireframe: Wireframe2d,
    /// The photograph.
    pub image: ViewImage,
}

/// A point of a sparse reconstruction, such as structure from motion finds.
#[derive(Clone, Debug, PartialEq)]
pub struct SparsePoint {
    /// Where it is, in the world of the cameras.
    pub position_in_world: Vector3<f64>,
    /// Where it was seen; empty where the files do not say.
    pub observations: Vec<Observation>,
}

impl SparsePoint {
    /// A point of which nobody says which views saw it.
    pub fn unseen(position_in_world: Vector3<f64>) -> Self {
        Self {
            position_in_world,
            observations: Vec::new(),
        }
    }
}

/// Where a view saw a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Index of the view.
    pub view: usize,
    /// Image coordinates.
    pub pixel: Vector2<f64>,
}

/// Posed images with their 2D wireframes, in one world frame.
#[derive(Clone, Debug)]
pub struct Scene {
    /// A short name, usually the folder's.
    pub name: String,
    /// The views, sorted by name.
    pub views: Vec<View>,
    /// Leads from the world frame of the cameras to the frame of the user's files.
    pub original_from_world: Similarity,
    /// Image coordinates of the centre of pixel (0, 0), on both axes: 0.5 where
    /// the intrinsics' origin is the image corner, 0 where it is that centre.
    pub pixel_center: f64,
    /// Radius of the scene sphere: the ball around the world origin that is
    /// modelled.
    pub sphere_radius: f64,
    /// Points of the reconstruction that the poses come from, where the files
    /// hold them.
    pub sparse_points: Vec<SparsePoint>,
}

impl View {
    /// Checks the camera, the wireframe, and that both are made for this image.
    ///
    /// # Errors
    /// If one of them cannot be used.
    pub fn validate(&self) -> Result<(), ViewError> {
        self.camera.validate()?;
        self.wireframe.validate()?;
        let sizes = [
            ("camera", self.camera.width, self.camera.height),
            ("wireframe", self.wireframe.width, self.wireframe.height),
        ];
        for (what, width, height) in sizes {
            check_image_size(what, (width, height), self.image.dimensions())?;
        }
        Ok(())
    }
}

/// Errs if `what` is for an image of another size.
pub(crate) fn check_image_size(
    what: &'static str,
    expected: (u32, u32),
    found: (u32, u32),
) -> Result<(), ViewError> {
    if expected == found {
        return Ok(());
    }
    Err(ViewError::ImageSize {
        what,
        expected_width: expected.0,
        expected_height: expected.1,
        width: found.0,
        height: found.1,
    })
}

impl Scene {
    /// Checks that there are views, that each can be used, and that their names
    /// are file names in ascending order. Readers have checked what they return.
    ///
    /// # Errors
    /// At the first view that does not pass; the message has the scene's name in
    /// the place of a file.
    pub fn validate(&self) -> Result<(), SceneError> {
        let path = PathBuf::from(&self.name);
        if self.views.is_empty() {
            return Err(SceneError::NoView { path });
        }
        for view in &self.views {
            view.validate()
                .map_err(|problem| SceneError::view(&path, &view.name, problem))?;
        }
        check_names(self.views.iter().map(|view| view.name.as_str()), &path)
    }

    /// Whether something was detected in any view.
    pub fn has_wireframes(&self) -> bool {
        let mut views = self.views.iter();
        views.any(|view| !view.wireframe.vertices.is_empty())
    }

    /// Keeps the views for which `keep` is true; sparse points lose what the others
    /// observed.
    pub fn retain_views(&mut self, mut keep: impl FnMut(&View) -> bool) {
        let kept: Vec<bool> = self.views.iter().map(&mut keep).collect();
        keep_observations(&mut self.sparse_points, &kept);
        let mut kept = kept.into_iter();
        self.views.retain(|_| kept.next() == Some(true));
    }

    /// The same scene in a world whose lengths are `factor` times as large;
    /// [`Self::original_from_world`] still leads to the frame of the files.
    pub fn scaled(mut self, factor: f64) -> Self {
        for view in &mut self.views {
            view.camera.center_in_world *= factor;
        }
        for point in &mut self.sparse_points {
            point.position_in_world *= factor;
        }
        self.sphere_radius *= factor;
        self.original_from_world.scale /= factor;
        self
    }

    /// The same scene in a world whose origin is at `center` of this one.
    pub fn centered_at(mut self, center: &Vector3<f64>) -> Self {
        for view in &mut self.views {
            view.camera.center_in_world -= center;
        }
        for point in &mut self.sparse_points {
            point.position_in_world -= center;
        }
        self.original_from_world.translation += center * self.original_from_world.scale;
        self
    }

    /// The same scene, seen by these cameras, one per view.
    pub fn with_cameras(mut self, cameras: &[Camera]) -> Self {
        for (view, camera) in self.views.iter_mut().zip(cameras) {
            view.camera = *camera;
        }
        self
    }

    /// Radius of the ball around the world origin that all cameras see: 1.2 times
    /// the largest that each of them sees whole. Infinite for a scene without
    /// views.
    pub fn visible_radius(&self) -> f64 {
        scene_sphere::visible_radius(self.views.iter().map(|view| &view.camera))
    }
}

/// Takes the observations of views that are not `kept` out of `points`, and gives the
/// others the indices that are left.
pub(crate) fn keep_observations(points: &mut [SparsePoint], kept: &[bool]) {
    let mut next = 0..;
    let new_index: Vec<Option<usize>> = (kept.iter())
        .map(|&kept| kept.then(|| next.next()).flatten())
        .collect();
    for point in points {
        point.observations = (point.observations.iter())
            .filter_map(|&Observation { view, pixel }| {
                let view = (*new_index.get(view)?)?;
                Some(Observation { view, pixel })
            })
            .collect();
    }
}

/// Errs at a name that cannot be a file name or is not above the one before it.
pub(crate) fn check_names<'a>(
    names: impl Iterator<Item = &'a str>,
    path: &Path,
) -> Result<(), SceneError> {
    let mut previous = None;
    for name in names {
        let reason = if let Some(problem) = view_name::problem(name) {
            problem
        } else if previous == Some(name) {
            "appears twice: give every image a name of its own"
        } else if previous > Some(name) {
            "is out of order: sort the views by name"
        } else {
            previous = Some(name);
            continue;
        };
        return Err(SceneError::ViewName {
            path: path.into(),
            // A name with ends of lines would look like several messages.
            view: name.replace('\n', r"\n"),
            reason,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Intrinsics;
    use image::RgbImage;

    /// A view from `distance` along −z toward the origin.
    fn view(name: &str, distance: f64, width: u32, height: u32) -> View {
        let intrinsics = Intrinsics {
            fx: 100.0,
            fy: 100.0,
            cx: 0.0,
            cy: 0.0,
            skew: 0.0,
        };
        let pose = Matrix4::new_translation(&Vector3::new(0.0, 0.0, -distance));
        View {
            name: name.into(),
            camera: Camera::from_matrices(intrinsics, &pose, width, height),
            wireframe: Wireframe2d::empty(width, height),
            image: RgbImage::new(width, height).into(),
        }
    }

    fn scene(views: Vec<View>) -> Scene {
        Scene {
            name: "box".into(),
            views,
            original_from_world: Similarity::identity(),
            pixel_center: 0.5,
            sphere_radius: 1.5,
            sparse_points: Vec::new(),
        }
    }

    #[test]
    fn a_scaled_scene_shows_the_same_and_leads_back() {
        let before = scene(vec![view("a", 9.0, 150, 200)]);
        let after = before.clone().scaled(0.25);
        let point = Vector3::new(0.3, -0.2, 0.1);
        let seen = before.views[0].camera.project(&point).pixel;
        let scaled = after.views[0].camera.project(&(point * 0.25)).pixel;
        assert!((seen - scaled).norm() < 1e-9);
        let back = after.original_from_world.apply(&(point * 0.25));
        assert!((back - before.original_from_world.apply(&point)).norm() < 1e-12);
        let (large, small) = (before.visible_radius(), after.visible_radius());
        assert!((small - 0.25 * large).abs() < 1e-12);
        assert_eq!(after.sphere_radius, 0.25 * before.sphere_radius);

        let center = Vector3::new(0.1, 0.2, -0.3);
        let moved = after.clone().centered_at(&center);
        let shown = moved.views[0]
            .camera
            .project(&(point * 0.25 - center))
            .pixel;
        assert!((seen - shown).norm() < 1e-9);
        let back = moved.original_from_world.apply(&(point * 0.25 - center));
        assert!((back - point).norm() < 1e-12);
    }

    #[test]
    fn points_follow_the_views_that_are_kept() {
        let names = ["a", "b", "c", "d"];
        let mut scene = scene(names.map(|name| view(name, 5.0, 4, 3)).to_vec());
        let seen = |view| Observation {
            view,
            pixel: Vector2::new(view as f64, 0.0),
        };
        scene.sparse_points = vec![SparsePoint {
            position_in_world: Vector3::zeros(),
            observations: (0..4).map(seen).collect(),
        }];
        scene.retain_views(|view| view.name != "b" && view.name != "c");
        let left: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
        assert_eq!(left, ["a", "d"]);
        let observations: Vec<_> = (scene.sparse_points[0].observations.iter())
            .map(|seen| (seen.view, seen.pixel.x))
            .collect();
        assert_eq!(observations, [(0, 0.0), (1, 3.0)]);
    }

    #[test]
    fn validation_names_the_view() {
        let good = || vec![view("a", 1.0, 4, 3), view("b", 1.0, 4, 3)];
        scene(good()).validate().unwrap();
        assert!(matches!(
            scene(vec![]).validate(),
            Err(SceneError::NoView { .. })
        ));

        let damages: [fn(&mut Vec<View>); 6] = [
            |views| views[1].camera.intrinsics.fx = 0.0,
            |views| views[1].camera.world_from_camera *= -1.0,
            |views| views[1].camera.center_in_world.x = f64::NAN,
            |views| views[1].wireframe.edges.push([0, 0]),
            |views| views[1].image = RgbImage::new(3, 3).into(),
            |views| views[0].name = "b".into(),
        ];
        for damage in damages {
            let mut views = good();
            damage(&mut views);
            let message = scene(views).validate().unwrap_err().to_string();
            assert!(message.contains("`b`"), "{message}");
        }
    }

    #[test]
    fn a_similarity_and_its_inverse_cancel() {
        let similarity = Similarity {
            scale: 15.0,
            translation: Vector3::new(5.0, 7.5, 3.0),
        };
        let point = Vector3::new(0.1, -0.2, 0.3);
        let there = similarity.apply(&point);
        assert!((similarity.inverse().apply(&there) - point).amax() < 1e-15);
        let by_matrix = similarity.matrix() * point.push(1.0);
        assert!((by_matrix.xyz() - there).amax() < 1e-15);
    }

    #[test]
    fn a_camera_projects_alike_in_a_mirrored_frame() {
        let mirrored = Similarity {
            scale: -2.0,
            translation: Vector3::new(5.0, 7.5, 3.0),
        };
        let camera = view("a", 4.0, 20, 10).camera;
        let point = camera.center_in_world + camera.forward() * 3.0 + Vector3::new(0.1, 0.2, 0.0);
        let there = mirrored.apply_to_camera(&camera);
        let [before, after] = [
            camera.project(&point),
            there.project(&mirrored.apply(&point)),
        ];
        assert!((before.pixel - after.pixel).amax() < 1e-9);
        assert!((2.0 * before.depth - after.depth).abs() < 1e-9);
        let upright = mirrored.without_mirroring();
        assert_eq!(upright.apply(&point), -mirrored.apply(&point));
        assert_eq!(upright.length_factor(), mirrored.length_factor());
    }
}
