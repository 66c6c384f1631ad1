//! Which evidence in a scene's folder places its sphere.

use super::masks::{self, MaskFiles};
use crate::scene_sphere::{
    Ball, SceneSphere, SphereChoice, SphereSource, from_cameras, from_points, is_centered,
    visible_radius,
};
use crate::visual_hull::from_masks;
use crate::{Camera, SceneError, Similarity, SparsePoint};
use nalgebra::Vector3;
use std::path::Path;

/// What there is to place a sphere by, in the world of the poses as read.
pub(super) struct Evidence<'a> {
    /// Folder of the scene, for messages.
    pub dir: &'a Path,
    /// The masks of all views, if there are any.
    pub masks: Option<&'a MaskFiles>,
    /// The cameras of the views.
    pub cameras: &'a [Camera],
    /// Sparse points; empty where there are none.
    pub points: &'a [SparsePoint],
    /// Radius around the origin that the file declares.
    pub declared_radius: Option<f64>,
}

impl Evidence<'_> {
    /// The sphere that `choice` asks for, in the world of the poses. A given one is
    /// in the frame of the files, to which `original_from_world` leads.
    pub fn sphere(
        &self,
        choice: SphereChoice,
        original_from_world: &Similarity,
    ) -> Result<SceneSphere, SceneError> {
        use SphereSource::{Cameras, File, Given, Masks, Points};
        let (source, ball) = match choice {
            SphereChoice::Auto => self.first_that_there_is()?,
            SphereChoice::File => (File, self.by_file()),
            SphereChoice::Points => (Points, from_points(self.points)),
            SphereChoice::Cameras => (Cameras, from_cameras(self.cameras)),
            SphereChoice::Masks => (Masks, self.by_masks()?),
            SphereChoice::Given { center, radius } => {
                let world_from_original = original_from_world.inverse();
                let center = world_from_original.apply(&center);
                (
                    Given,
                    Some((center, radius * world_from_original.length_factor())),
                )
            }
        };
        let Some((center, radius)) = ball else {
            return Err(SceneError::NoSphere {
                path: self.dir.into(),
                evidence: match choice {
                    SphereChoice::Masks => {
                        "no mask for every view in mask/ or masks/ and no images with transparency, or no part of space that all masks show"
                    }
                    SphereChoice::Points => "fewer than 20 sparse points, or points without extent",
                    SphereChoice::Cameras => "no point that most of the cameras look at",
                    _ => "a camera at the origin of its poses, and nothing else to go by",
                },
            });
        };
        Ok(SceneSphere {
            center,
            radius,
            source,
        })
    }

    fn first_that_there_is(&self) -> Result<(SphereSource, Option<Ball>), SceneError> {
        if self.declared_radius.is_some() {
            return Ok((SphereSource::File, self.by_file()));
        }
        if let Some(ball) = self.by_masks()? {
            return Ok((SphereSource::Masks, Some(ball)));
        }
        if let Some(ball) = from_points(self.points) {
            return Ok((SphereSource::Points, Some(ball)));
        }
        if is_centered(self.cameras)
            && let Some(ball) = self.by_file()
        {
            return Ok((SphereSource::File, Some(ball)));
        }
        if let Some(ball) = from_cameras(self.cameras) {
            return Ok((SphereSource::Cameras, Some(ball)));
        }
        Ok((SphereSource::Unknown, self.by_file()))
    }

    fn by_file(&self) -> Option<Ball> {
        let radius = self
            .declared_radius
            .unwrap_or_else(|| visible_radius(self.cameras.iter()));
        (radius.is_finite() && radius > 0.0).then(|| (Vector3::zeros(), radius))
    }

    fn by_masks(&self) -> Result<Option<Ball>, SceneError> {
        let Some(files) = self.masks else {
            return Ok(None);
        };
        let masks = masks::read(files)?;
        Ok(masks.and_then(|masks| from_masks(self.cameras, &masks)))
    }
}
