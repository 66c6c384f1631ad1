//! What a person should know about how a scene was read.

use std::fmt;
use std::path::PathBuf;

/// Something that does not stop a scene from being read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SceneWarning {
    /// The principal point does not tell where pixel centres are.
    PixelCenterAssumed {
        /// The value taken.
        pixel_center: f64,
    },
    /// Views were left out because their images are not there.
    ImagesMissing {
        /// The first of the images.
        first: PathBuf,
        /// Whether that is a link, to what is not there or to itself.
        first_is_link: bool,
        /// How many views.
        views: usize,
    },
    /// Images beside those of the views have no pose.
    ImagesWithoutPose {
        /// The first of them.
        first: PathBuf,
        /// How many.
        images: usize,
    },
    /// Files of the scene are links to files outside of its folder.
    LinksOutside {
        /// The first of them.
        first: PathBuf,
        /// How many.
        files: usize,
    },
    /// Photographs were undistorted: the scene's cameras are the pinholes that
    /// took their place.
    Undistorted {
        /// Models of the lenses, sorted.
        lenses: Vec<&'static str>,
        /// How many views.
        views: usize,
    },
    /// Photographs say that they are to be turned (EXIF orientation).
    Turned {
        /// Name of the first view.
        first: String,
        /// How many.
        views: usize,
        /// Whether they were: the sizes of their cameras ask for it.
        is_applied: bool,
    },
    /// Photographs were scaled down.
    ScaledDown {
        /// The longest side asked for, in pixels.
        max_image_size: u32,
        /// How many views.
        views: usize,
    },
    /// Undistorted images could not be kept for the next time.
    NotCached {
        /// The folder of the cache.
        dir: PathBuf,
        /// What the system said first.
        reason: String,
    },
    /// Nothing tells where the scene is: its sphere lies around the origin of the
    /// poses.
    SphereUnknown,
    /// A view was dropped because nothing was detected in it.
    ViewWithoutSegments {
        /// Name of the view.
        view: String,
        /// No segment's score is above this.
        min_segment_score: f64,
    },
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PixelCenterAssumed { pixel_center } => write!(
                f,
                "the intrinsics do not tell where pixel centres are: {pixel_center} is assumed"
            ),
            Self::ImagesMissing {
                first,
                first_is_link,
                views,
            } => write!(
                f,
                "{views} views are left out because their images are not there, such as {}{}",
                first.display(),
                if *first_is_link {
                    ", a link that leads to no file"
                } else {
                    ""
                }
            ),
            Self::ImagesWithoutPose { first, images } => write!(
                f,
                "{images} images have no pose and are not used, such as {}",
                first.display()
            ),
            Self::LinksOutside { first, files } => write!(
                f,
                "{files} {} out of the folder of the scene by links, such as {}",
                if *files == 1 { "file leads" } else { "files lead" },
                first.display()
            ),
            Self::Undistorted { lenses, views } => write!(
                f,
                "{views} views were undistorted to pinhole images (lens model: {})",
                lenses.join(", ")
            ),
            Self::Turned {
                first,
                views,
                is_applied,
            } => {
                write!(f, "{views} photographs, such as `{first}`, ")?;
                f.write_str(if *is_applied {
                    "were turned by their EXIF orientation, because their cameras have the size of the turned image"
                } else {
                    "have an EXIF orientation, which is left alone: poses are taken for those of the pixels as they are stored"
                })
            }
            Self::ScaledDown {
                max_image_size,
                views,
            } => write!(
                f,
                "{views} views were scaled down to {max_image_size} pixels on their longer side"
            ),
            Self::NotCached { dir, reason } => write!(
                f,
                "undistorted images cannot be kept in {}: {reason}; the next run makes them again",
                dir.display()
            ),
            Self::SphereUnknown => f.write_str(
                "neither sparse points nor the cameras tell where the scene is: its sphere is put around the origin of the poses; give --scene-sphere x,y,z,radius if that is not the object",
            ),
            Self::ViewWithoutSegments {
                view,
                min_segment_score,
            } => write!(
                f,
                "view `{view}` is left out: no segment has a score above {min_segment_score}"
            ),
        }
    }
}
