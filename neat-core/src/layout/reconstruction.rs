//! What structure from motion writes: posed images under the numbers of its
//! files, and points with the numbers of the images that saw them.

use super::poses::{PosedImage, Poses};
use crate::{Observation, SceneError, SparsePoint};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A reconstruction as its file has it.
pub(super) struct Reconstruction {
    /// The file, for messages.
    pub path: PathBuf,
    /// Posed images, each with the number by which the file calls it.
    pub views: Vec<(usize, PosedImage)>,
    /// Points; their observations name views by those numbers, also views that
    /// are not in [`Self::views`].
    pub points: Vec<SparsePoint>,
    /// The image coordinates of the centre of the first pixel.
    pub pixel_center: f64,
}

impl Reconstruction {
    /// Sorts the views by name and gives the observations the indices of the
    /// sorted views. Observations by images without a pose are left out.
    ///
    /// # Errors
    /// If a number is used twice, a name is not a file name of its own, or a lens
    /// or a point is not finite.
    pub fn into_poses(mut self) -> Result<Poses, SceneError> {
        let path = self.path;
        self.views.sort_by(|a, b| a.1.name.cmp(&b.1.name));
        let mut index_of = BTreeMap::new();
        let mut views = Vec::with_capacity(self.views.len());
        for (index, (number, mut view)) in self.views.into_iter().enumerate() {
            if index_of.insert(number, index).is_some() {
                return Err(SceneError::malformed(
                    &path,
                    format!("image {number} appears twice"),
                ));
            }
            let lens = view.intrinsics.validate();
            let lens = lens.and_then(|()| view.distortion.validate());
            lens.map_err(|problem| SceneError::view(&path, &view.name, problem))?;
            view.distortion = view.distortion.simplest();
            views.push(view);
        }
        let poses = Poses::new(&path, views)?;
        for point in &mut self.points {
            let seen = point.observations.iter();
            let mut numbers = point
                .position_in_world
                .iter()
                .chain(seen.flat_map(|seen| &seen.pixel));
            if numbers.any(|x| !x.is_finite()) {
                return Err(SceneError::malformed(&path, "a point is not finite"));
            }
            point.observations = (point.observations.iter())
                .filter_map(|&Observation { view, pixel }| {
                    let view = *index_of.get(&view)?;
                    Some(Observation { view, pixel })
                })
                .collect();
        }
        Ok(Poses {
            pixel_center: Some(self.pixel_center),
            points: self.points,
            ..poses
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Distortion, Intrinsics};
    use nalgebra::{Matrix4, Vector2, Vector3};

    fn view(name: &str) -> PosedImage {
        PosedImage {
            name: name.into(),
            image: name.into(),
            intrinsics: Intrinsics {
                fx: 1.0,
                fy: 1.0,
                cx: 0.0,
                cy: 0.0,
                skew: 0.0,
            },
            distortion: Distortion::ReverseRadial { k: 0.0 },
            world_from_camera: Matrix4::identity(),
            size: None,
        }
    }

    fn reconstruction() -> Reconstruction {
        let seen = |view| Observation {
            view,
            pixel: Vector2::new(view as f64, 0.5),
        };
        Reconstruction {
            path: "model".into(),
            views: vec![(7, view("b")), (3, view("a"))],
            points: vec![SparsePoint {
                position_in_world: Vector3::zeros(),
                observations: vec![seen(7), seen(5), seen(3)],
            }],
            pixel_center: 0.5,
        }
    }

    #[test]
    fn observations_follow_the_sorted_views() {
        let poses = reconstruction().into_poses().unwrap();
        let names: Vec<_> = poses.views.iter().map(|view| &view.name).collect();
        assert_eq!(names, ["a", "b"]);
        assert_eq!(poses.views[0].distortion, Distortion::None);
        let seen = &poses.points[0].observations;
        let seen: Vec<_> = seen.iter().map(|seen| (seen.view, seen.pixel.x)).collect();
        assert_eq!(seen, [(1, 7.0), (0, 3.0)], "image 5 has no pose");
    }

    #[test]
    fn what_is_not_a_number_is_refused() {
        let damages: [fn(&mut Reconstruction); 6] = [
            |model| model.views[0].0 = 3,
            |model| model.views[0].1.name = "a".into(),
            |model| model.views[0].1.intrinsics.fx = 0.0,
            |model| model.views[0].1.distortion = Distortion::Fov { omega: f64::NAN },
            |model| model.points[0].position_in_world.y = f64::INFINITY,
            |model| model.points[0].observations[1].pixel.x = f64::NAN,
        ];
        for damage in damages {
            let mut model = reconstruction();
            damage(&mut model);
            assert!(model.into_poses().is_err());
        }
    }
}
