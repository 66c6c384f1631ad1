//! Gathers what the images show, without looking at the poses.

use crate::agreement::{Agreement, PairTallies};
use crate::corner_consensus::{CornerEvidence, MAX_CORNERS, ViewCorners};
use crate::corners::{corners, refined};
use crate::descriptor::keypoints;
use crate::examination::median;
use crate::gray_image::GrayImage;
use crate::image_checks::has_plain_border;
use crate::silhouettes::Silhouette;
use crate::tracks::{self, Matching, Track, ViewKeypoints, matching};
use crate::working_copies::WorkingCopies;
use nalgebra::Vector2;
use neat_core::{Camera, Scene, SceneError, View};

/// Images with more corners than this show texture, which tells points apart.
const TEXTURE: usize = 120;

/// Corners that are refined; some are dropped then.
const CANDIDATES: usize = 2 * MAX_CORNERS;

/// What the images show that cameras have to explain.
pub(crate) enum Evidence {
    /// Points of textured things, matched by their looks.
    Tracks {
        /// Through three views each.
        tracks: Vec<Track>,
        /// What they were found among, of each view that was looked at.
        keypoints: Vec<ViewKeypoints>,
    },
    /// Corners of things without texture, which all look alike.
    Corners(CornerEvidence),
}

impl Evidence {
    /// How well `cameras`, one for each view of the scene, explain what the
    /// `trusted` views show together.
    pub fn agreement(&self, cameras: &[Camera], trusted: &[bool]) -> Agreement {
        match self {
            Self::Tracks { tracks, .. } => tracks::agreement(tracks, cameras, trusted),
            Self::Corners(corners) => corners.agreement(cameras, trusted),
        }
    }

    /// What each two views show in common, and how much of it `cameras` explain.
    pub fn in_common(&self, cameras: &[Camera], trusted: &[bool]) -> PairTallies {
        match self {
            Self::Tracks { tracks, .. } => tracks::in_common(tracks, cameras),
            Self::Corners(corners) => corners.in_common(cameras, trusted),
        }
    }

    /// What pinholes would show in place of a lens of this [strength](crate::lens).
    pub fn straightened(&self, cameras: &[Camera], strength: f64) -> Self {
        match self {
            Self::Tracks { tracks, .. } => Self::Tracks {
                tracks: (tracks.iter())
                    .map(|track| track.straightened(cameras, strength))
                    .collect(),
                keypoints: Vec::new(),
            },
            Self::Corners(corners) => Self::Corners(corners.straightened(cameras, strength)),
        }
    }

    /// What is counted, in words.
    pub fn noun(&self) -> &'static str {
        match self {
            Self::Tracks { .. } => "points matched through three views",
            Self::Corners(_) => "corners",
        }
    }
}

/// What the images of some views show.
pub(crate) struct Gathered {
    /// Indices of those views.
    pub views: Vec<usize>,
    pub evidence: Evidence,
    /// How alike the views i < j look, in the order (0, 1), (0, 2), …, (1, 2), ….
    pub likeness: Vec<f64>,
    /// Of things before a plain background.
    pub silhouettes: Vec<Silhouette>,
}

/// At most `limit` of `count` views, evenly spread.
pub(crate) fn evenly(count: usize, limit: usize) -> Vec<usize> {
    let step = count.div_ceil(limit).max(1);
    (0..count).step_by(step).collect()
}

/// Whether most of the given views show texture.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(crate) fn is_textured(
    working: &WorkingCopies<'_>,
    views: &[usize],
) -> Result<bool, SceneError> {
    // A few views tell; the first and the last are often the worst.
    let few: Vec<usize> = views.iter().copied().skip(1).step_by(6).collect();
    let counts = working.look_at(&few, |view| {
        let (image, _) = working.of(view)?;
        Ok(corners(&image, TEXTURE + 1).len() as f64)
    })?;
    Ok(median(counts.into_iter()) > TEXTURE as f64)
}

/// Looks at the given views for points of texture or for corners.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(crate) fn gather(
    scene: &Scene,
    working: &WorkingCopies<'_>,
    views: Vec<usize>,
    textured: bool,
) -> Result<Gathered, SceneError> {
    if textured {
        let looked = working.look_at(&views, |view| {
            let (image, factor) = working.of(view)?;
            let keypoints = ViewKeypoints {
                view,
                factor: f64::from(factor),
                pixel_center: scene.pixel_center,
                keypoints: keypoints(&image),
            };
            Ok((keypoints, silhouette(view, &image)))
        })?;
        let (keypoints, silhouettes): (Vec<_>, Vec<_>) = looked.into_iter().unzip();
        let Matching { common, tracks } = matching(&keypoints);
        return Ok(Gathered {
            views,
            evidence: Evidence::Tracks { tracks, keypoints },
            likeness: common.iter().map(|&n| (1.0 + n as f64).ln()).collect(),
            silhouettes: silhouettes.into_iter().flatten().collect(),
        });
    }
    let looked = working.look_at(&views, |view| {
        let (image, factor) = working.of(view)?;
        let gradients = image.blurred(1).gradients();
        let full = |working: f32| {
            (f64::from(working) + 0.5) * f64::from(factor) - 0.5 + scene.pixel_center
        };
        let corners = corners(&image, CANDIDATES)
            .iter()
            .filter_map(|corner| refined(&gradients, corner))
            .take(MAX_CORNERS)
            .map(|corner| Vector2::new(full(corner.x), full(corner.y)))
            .collect();
        let corners = ViewCorners::new(view, corners, larger_side(&scene.views[view]));
        Ok((corners, (Thumbnail::new(&image), silhouette(view, &image))))
    })?;
    let (corners, others): (Vec<_>, Vec<_>) = looked.into_iter().unzip();
    let (thumbnails, silhouettes): (Vec<_>, Vec<_>) = others.into_iter().unzip();
    let likeness = (0..views.len())
        .flat_map(|i| (i + 1..views.len()).map(move |j| [i, j]))
        .map(|[i, j]| thumbnails[i].likeness(&thumbnails[j]))
        .collect();
    Ok(Gathered {
        views,
        evidence: Evidence::Corners(CornerEvidence::new(corners)),
        likeness,
        silhouettes: silhouettes.into_iter().flatten().collect(),
    })
}

/// What stands before a plain background, if there is one.
fn silhouette(view: usize, image: &GrayImage) -> Option<Silhouette> {
    has_plain_border(image).then(|| Silhouette::new(view, image))
}

fn larger_side(view: &View) -> f64 {
    f64::from(view.camera.width.max(view.camera.height))
}

/// An image at 24 × 24, its mean taken off.
pub(crate) struct Thumbnail(Vec<f32>);

impl Thumbnail {
    const SIDE: usize = 24;

    pub fn new(image: &GrayImage) -> Self {
        let mut values = Vec::with_capacity(Self::SIDE * Self::SIDE);
        for row in 0..Self::SIDE {
            for column in 0..Self::SIDE {
                let range = |index: usize, extent: usize| {
                    let start = index * extent / Self::SIDE;
                    start
                        ..((index + 1) * extent / Self::SIDE)
                            .max(start + 1)
                            .min(extent)
                };
                let (rows, columns) = (range(row, image.height), range(column, image.width));
                let count = (rows.len() * columns.len()).max(1);
                let sum: f32 = rows
                    .flat_map(|y| columns.clone().map(move |x| (x, y)))
                    .map(|(x, y)| image.at(x, y))
                    .sum();
                values.push(sum / count as f32);
            }
        }
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        values.iter_mut().for_each(|value| *value -= mean);
        Self(values)
    }

    /// The correlation of two thumbnails, in [−1, 1].
    pub fn likeness(&self, other: &Self) -> f64 {
        let dot =
            |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum() };
        let norm = (dot(&self.0, &self.0) * dot(&other.0, &other.0)).sqrt();
        if norm > 0.0 {
            dot(&self.0, &other.0) / norm
        } else {
            0.0
        }
    }
}
