//! Photographs that say how they are to be turned (EXIF orientation), and whether their poses
//! mean them turned.

use super::SceneWarning;
use super::poses::PosedImage;
use image::metadata::Orientation;

/// What a photograph says about how it is to be turned, and what is done about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    said: Orientation,
    is_meant: bool,
}

impl Turn {
    /// Of a photograph with `stored` pixels that says `said`. Most programs pose the pixels as
    /// they are stored: that a camera means them turned only its size can tell.
    pub fn new(posed: &PosedImage, stored: (u32, u32), said: Orientation) -> Self {
        let is_meant = posed.size.is_some_and(|size| {
            size != stored && is_on_its_side(said) && size == (stored.1, stored.0)
        });
        Self { said, is_meant }
    }

    /// What is to be done to the stored pixels.
    pub fn to_apply(self) -> Orientation {
        if self.is_meant {
            self.said
        } else {
            Orientation::NoTransforms
        }
    }

    /// Width and height of the photograph, of those of the stored pixels.
    pub fn size(self, (width, height): (u32, u32)) -> (u32, u32) {
        if self.is_meant {
            (height, width)
        } else {
            (width, height)
        }
    }
}

/// Whether width and height change places.
fn is_on_its_side(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(
        orientation,
        Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH
    )
}

/// What was made of the orientations of all views, those that were applied first.
pub(super) fn warnings<'a>(
    views: &'a [PosedImage],
    turns: &'a [Turn],
) -> impl Iterator<Item = SceneWarning> + 'a {
    [true, false].into_iter().filter_map(move |is_meant| {
        let speaks = |turn: &Turn| turn.said != Orientation::NoTransforms;
        let mut of_kind = views
            .iter()
            .zip(turns)
            .filter(move |(_, turn)| speaks(turn) && turn.is_meant == is_meant);
        let (first, _) = of_kind.next()?;
        Some(SceneWarning::Turned {
            first: first.name.clone(),
            views: 1 + of_kind.count(),
            is_applied: is_meant,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::load::load_posed;
    use super::super::poses::Poses;
    use super::super::{Layout, LoadOptions, LoadedScene};
    use super::*;
    use crate::{Distortion, Intrinsics, SceneError, Similarity};
    use image::codecs::png::PngEncoder;
    use image::{DynamicImage, ImageEncoder, Rgb, RgbImage};
    use nalgebra::{Matrix4, Vector3};
    use std::path::Path;
    use tempfile::TempDir;

    /// The turned image.
    const SIZE: (u32, u32) = (24, 32);

    fn picture(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |x, y| {
            Rgb([(8 * x) as u8, (7 * y) as u8, 90])
        })
    }

    /// The smallest EXIF chunk that says how to turn an image.
    fn exif(orientation: Orientation) -> Vec<u8> {
        let mut chunk = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
        chunk.extend([orientation.to_exif(), 0, 0, 0, 0, 0, 0, 0]);
        chunk
    }

    fn write(path: &Path, stored: &RgbImage, orientation: Orientation) {
        let mut encoder = PngEncoder::new(std::fs::File::create(path).unwrap());
        encoder.set_exif_metadata(exif(orientation)).unwrap();
        let (width, height) = stored.dimensions();
        let kind = image::ExtendedColorType::Rgb8;
        encoder.write_image(stored, width, height, kind).unwrap();
    }

    /// Two views whose file of poses says this size.
    fn load(dir: &TempDir, size: Option<(u32, u32)>) -> Result<LoadedScene, SceneError> {
        let posed = |name: &str| PosedImage {
            name: name.into(),
            image: dir.path().join(format!("{name}.png")),
            intrinsics: Intrinsics::centered(30.0, SIZE),
            distortion: Distortion::None,
            world_from_camera: Matrix4::new_translation(&Vector3::new(0.0, 0.0, -5.0)),
            size,
        };
        let poses = Poses {
            path: dir.path().join("poses"),
            views: ["a", "b"].map(posed).into(),
            original_from_world: Similarity::identity(),
            file_axes: Default::default(),
            pixel_center: Some(0.5),
            points: Vec::new(),
            declared_radius: Some(1.0),
        };
        let options = LoadOptions {
            require_wireframes: false,
            ..LoadOptions::default()
        };
        load_posed(dir.path(), Layout::CamerasJson, poses, &options)
    }

    #[test]
    fn photographs_are_turned_where_their_cameras_have_the_size_of_the_turned_image() {
        let dir = tempfile::tempdir().unwrap();
        let turned = picture(SIZE.0, SIZE.1);
        // Turning by 90° undoes turning by 270°.
        let stored = image::imageops::rotate270(&turned);
        write(
            &dir.path().join("a.png"),
            &stored,
            Orientation::NoTransforms,
        );
        write(&dir.path().join("b.png"), &stored, Orientation::Rotate90);
        // The first does not say that it is on its side.
        let error = load(&dir, Some(SIZE)).unwrap_err().to_string();
        assert!(error.contains("`a`"), "{error}");

        write(&dir.path().join("a.png"), &stored, Orientation::Rotate90);
        let loaded = load(&dir, Some(SIZE)).unwrap();
        assert_eq!(*loaded.scene.views[0].image.read().unwrap(), turned);
        let warning = SceneWarning::Turned {
            first: "a".into(),
            views: 2,
            is_applied: true,
        };
        assert_eq!(loaded.warnings, [warning]);
    }

    #[test]
    fn orientations_are_told_and_left_alone_where_no_size_asks_for_them() {
        let dir = tempfile::tempdir().unwrap();
        let stored = picture(SIZE.0, SIZE.1);
        for (size, orientation) in [
            (Some(SIZE), Orientation::Rotate90),
            (Some(SIZE), Orientation::Rotate180),
            (None, Orientation::Rotate90),
        ] {
            write(&dir.path().join("a.png"), &stored, orientation);
            write(
                &dir.path().join("b.png"),
                &stored,
                Orientation::NoTransforms,
            );
            let loaded = load(&dir, size).unwrap();
            assert_eq!(*loaded.scene.views[0].image.read().unwrap(), stored);
            let warning = SceneWarning::Turned {
                first: "a".into(),
                views: 1,
                is_applied: false,
            };
            assert_eq!(loaded.warnings, [warning]);
        }
    }

    #[test]
    fn photographs_of_several_sizes_do_not_share_intrinsics() {
        let dir = tempfile::tempdir().unwrap();
        picture(SIZE.0, SIZE.1)
            .save(dir.path().join("a.png"))
            .unwrap();
        let large = DynamicImage::from(picture(60, 80));
        large.save(dir.path().join("b.png")).unwrap();
        let error = load(&dir, None).unwrap_err().to_string();
        assert!(error.contains("the camera is for"), "{error}");
    }
}
