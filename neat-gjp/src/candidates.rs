//! Local junctions: the end points of rendered segments that the images support.
//!
//! Global junction perceiving learns from them (paper §4.2). Which end points
//! count differs between the published code, the paper's text and the fast
//! recipe; [`CandidateConfig`] names all three.

use crate::clustering::dbscan_means;
use nalgebra::{Vector2, Vector3};
use neat_core::assignment::{AssignmentError, assign};
use neat_core::{Camera, LineSegment2};
use serde::{Deserialize, Serialize};

/// One rendered 3D segment and the 2D segment its ray was drawn for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderedSegment {
    /// Index of the ray's view.
    pub view: usize,
    /// Both rendered end points, in the world.
    pub ends_in_world: [[f32; 3]; 2],
    /// The detected segment, in image coordinates. The order of its ends is free.
    pub detected: LineSegment2,
}

/// What a view says about junctions.
#[derive(Clone, Copy, Debug)]
pub struct JunctionView<'a> {
    /// Intrinsics and pose.
    pub camera: &'a Camera,
    /// All junctions detected in the view, in image coordinates.
    pub junctions_in_image: &'a [Vector2<f64>],
}

/// How a detection supports an end point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Support {
    /// In each view, clustered end points and detected junctions are matched one
    /// to one at the least total distance: at most one local junction per
    /// detected one. Points behind the camera take part. (The published code.)
    OneToOne,
    /// The nearest junction detected in the view of the end point; supported end
    /// points are clustered. (The paper's text, §4.2.)
    AnyJunction,
    /// The end of the very 2D segment that the ray was drawn for, in the order of
    /// ends that fits better; supported end points are clustered. (The fast
    /// recipe: the correspondence is known.)
    OwnEnd,
}

/// How near a projected point must be to its support; strictly nearer is kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gate {
    /// This many pixels.
    Pixels(f64),
    /// The lower median of all distances tested together, whatever it is (the
    /// published toy configuration): fewer than half are kept.
    Median,
}

/// Whether end points are replaced by the means of their clusters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Clustering {
    /// Every end point stands for itself.
    None,
    /// Cluster means of [`dbscan_means`]; lone end points are dropped.
    Dbscan {
        /// Radius of a neighbourhood, in world units.
        eps: f64,
        /// Points in the neighbourhood of a core point, itself included.
        min_samples: usize,
    },
}

impl Clustering {
    /// The clustering of the published code and of the paper.
    pub const PUBLISHED: Self = Self::Dbscan {
        eps: 0.01,
        min_samples: 2,
    };

    fn candidates(&self, points: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
        match *self {
            Self::None => points,
            Self::Dbscan { eps, min_samples } => dbscan_means(&points, eps, min_samples).means,
        }
    }
}

/// How rendered end points become local junctions.
///
/// # Example
/// ```
/// use neat_gjp::candidates::{CandidateConfig, Gate};
///
/// let config = CandidateConfig { gate: Gate::Pixels(5.0), ..CandidateConfig::paper() };
/// assert_ne!(config, CandidateConfig::default());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CandidateConfig {
    /// Which detection an end point is held against.
    pub support: Support,
    /// How near it must be.
    pub gate: Gate,
    /// Clustering: before the support is sought where that is
    /// [`Support::OneToOne`], after it otherwise.
    pub clustering: Clustering,
}

impl Default for CandidateConfig {
    /// [`Self::published`].
    fn default() -> Self {
        Self::published()
    }
}

impl CandidateConfig {
    /// The published code on DTU, BlendedMVS and ABC (`dbscan_enabled`).
    pub const fn published() -> Self {
        Self {
            support: Support::OneToOne,
            gate: Gate::Pixels(10.0),
            clustering: Clustering::PUBLISHED,
        }
    }

    /// The published toy configuration, `abc-neat-a.conf` (`use_median`).
    pub const fn published_toy() -> Self {
        Self {
            gate: Gate::Median,
            clustering: Clustering::None,
            ..Self::published()
        }
    }

    /// The text of the paper, §4.2.
    pub const fn paper() -> Self {
        Self {
            support: Support::AnyJunction,
            ..Self::published()
        }
    }

    /// The fast recipe: no clustering, which would drop the lone end points of
    /// small batches over many views.
    pub const fn fast() -> Self {
        Self {
            support: Support::OwnEnd,
            clustering: Clustering::None,
            ..Self::published()
        }
    }

    /// The local junctions of a batch of rays.
    ///
    /// `views[segment.view]` is the view of a ray; batches of the published code
    /// have one view. Callers leave out rays they do not trust, such as those
    /// that hit nothing. Points that are not finite are dropped. Without any
    /// candidate or any detected junction the result is empty.
    ///
    /// Order: by view and detected junction for [`Support::OneToOne`], otherwise
    /// that of the end points (start before end) or of their clusters.
    ///
    /// # Errors
    /// If a camera is so broken that distances in its image exceed 1e150 pixels.
    ///
    /// # Panics
    /// If a segment names a view that does not exist.
    pub fn local_junctions(
        &self,
        segments: &[RenderedSegment],
        views: &[JunctionView<'_>],
    ) -> Result<Vec<LocalJunction>, AssignmentError> {
        match self.support {
            Support::OneToOne => self.matched_one_to_one(segments, views),
            Support::AnyJunction => Ok(self.supported(segments, |segment| {
                let view = &views[segment.view];
                segment.ends_in_world.map(|end| {
                    let distance = |junction| seen_distance(view.camera, end, junction);
                    let distances = view.junctions_in_image.iter().map(distance);
                    distances.fold(f64::INFINITY, f64::min)
                })
            })),
            Support::OwnEnd => Ok(self.supported(segments, |segment| {
                let camera = views[segment.view].camera;
                let [start, end] = segment.ends_in_world;
                let projected = LineSegment2::new(pixel(camera, start), pixel(camera, end));
                let own = projected.with_nearest_order(&segment.detected);
                [
                    seen_distance(camera, start, &own.start),
                    seen_distance(camera, end, &own.end),
                ]
            })),
        }
    }

    fn matched_one_to_one(
        &self,
        segments: &[RenderedSegment],
        views: &[JunctionView<'_>],
    ) -> Result<Vec<LocalJunction>, AssignmentError> {
        let mut ends_of_view = vec![Vec::new(); views.len()];
        for segment in segments {
            ends_of_view[segment.view].extend(segment.ends_in_world.into_iter().filter(is_finite));
        }
        let mut local = Vec::new();
        for (view, ends) in ends_of_view.into_iter().enumerate() {
            let candidates = self.clustering.candidates(ends);
            let matches = match_junctions(&candidates, &views[view])?;
            let limit = self
                .gate
                .limit(matches.iter().map(|m| m.distance).collect());
            local.extend(matches.into_iter().filter(|m| m.distance < limit).map(|m| {
                LocalJunction {
                    in_world: candidates[m.candidate],
                    support: Some(JunctionSupport {
                        view,
                        junction: m.junction,
                        distance_in_pixels: m.distance,
                    }),
                }
            }));
        }
        Ok(local)
    }

    /// The end points within the gate of their own support, then clustered.
    fn supported(
        &self,
        segments: &[RenderedSegment],
        end_distances: impl Fn(&RenderedSegment) -> [f64; 2],
    ) -> Vec<LocalJunction> {
        let (ends, distances): (Vec<_>, Vec<_>) = segments
            .iter()
            .flat_map(|segment| {
                segment
                    .ends_in_world
                    .into_iter()
                    .zip(end_distances(segment))
            })
            .filter(|(end, _)| is_finite(end))
            .unzip();
        let limit = self.gate.limit(distances.clone());
        let supported = ends
            .into_iter()
            .zip(distances)
            .filter(|(_, distance)| *distance < limit)
            .map(|(end, _)| end)
            .collect();
        self.clustering
            .candidates(supported)
            .into_iter()
            .map(|in_world| LocalJunction {
                in_world,
                support: None,
            })
            .collect()
    }
}

impl Gate {
    /// The distance that a kept one stays below.
    fn limit(&self, mut distances: Vec<f64>) -> f64 {
        match *self {
            Self::Pixels(limit) => limit,
            Self::Median => {
                distances.sort_unstable_by(f64::total_cmp);
                let middle = distances.len().saturating_sub(1) / 2;
                distances.get(middle).copied().unwrap_or(0.0)
            }
        }
    }
}

/// A junction that the field proposes in this batch and the images support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalJunction {
    /// Position in the world.
    pub in_world: [f32; 3],
    /// The detected junction matched to it; only [`Support::OneToOne`] has one.
    pub support: Option<JunctionSupport>,
}

/// The detected junction that supports a local one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JunctionSupport {
    /// Index of the view.
    pub view: usize,
    /// Index into [`JunctionView::junctions_in_image`].
    pub junction: usize,
    /// Distance of the projected local junction from it, in pixels.
    pub distance_in_pixels: f64,
}

struct JunctionMatch {
    junction: usize,
    candidate: usize,
    distance: f64,
}

/// Junctions and candidates of a view, one to one, junctions ascending.
fn match_junctions(
    candidates: &[[f32; 3]],
    view: &JunctionView<'_>,
) -> Result<Vec<JunctionMatch>, AssignmentError> {
    let projected: Vec<Vector2<f64>> = candidates
        .iter()
        .map(|&candidate| pixel(view.camera, candidate))
        .collect();
    let distances: Vec<f64> = view
        .junctions_in_image
        .iter()
        .flat_map(|junction| projected.iter().map(move |point| (point - junction).norm()))
        .collect(); // [junctions, candidates]
    let matching = assign(&distances, view.junctions_in_image.len(), projected.len())?;
    Ok(matching
        .pairs()
        .map(|(junction, candidate)| JunctionMatch {
            junction,
            candidate,
            distance: distances[junction * projected.len() + candidate],
        })
        .collect())
}

fn pixel(camera: &Camera, point_in_world: [f32; 3]) -> Vector2<f64> {
    camera
        .project(&Vector3::from(point_in_world.map(f64::from)))
        .pixel
}

/// Distance in the image from a projected point to `target`; infinite for a point
/// that the camera does not see because it lies behind it.
fn seen_distance(camera: &Camera, point_in_world: [f32; 3], target: &Vector2<f64>) -> f64 {
    let projection = camera.project(&Vector3::from(point_in_world.map(f64::from)));
    if projection.depth > 0.0 {
        (projection.pixel - target).norm()
    } else {
        f64::INFINITY
    }
}

fn is_finite(point: &[f32; 3]) -> bool {
    point.iter().all(|coordinate| coordinate.is_finite())
}

/// How far apart two junctions are, when local and global ones are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MatchingNorm {
    /// Sum of the absolute differences (the published code and the fast recipe).
    L1,
    /// Euclidean distance (the paper's text).
    L2,
}

impl MatchingNorm {
    fn distance<const D: usize>(self, a: &[f32; D], b: &[f32; D]) -> f64 {
        let differences = (0..D).map(|axis| f64::from(a[axis]) - f64::from(b[axis]));
        match self {
            Self::L1 => differences.map(f64::abs).sum(),
            Self::L2 => differences.map(|d| d * d).sum::<f64>().sqrt(),
        }
    }
}

/// How local junctions are matched with global ones: the settings of
/// [`matching_cost`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchingConfig {
    /// Distance in the world, and in the image where that counts.
    pub norm: MatchingNorm,
    /// Weight of the distance in calibrated coordinates; 0 leaves it out.
    pub weight_2d: f64,
}

impl Default for MatchingConfig {
    /// [`Self::published`].
    fn default() -> Self {
        Self::published()
    }
}

impl MatchingConfig {
    /// The published code.
    pub const fn published() -> Self {
        Self {
            norm: MatchingNorm::L1,
            weight_2d: 0.1,
        }
    }

    /// The text of the paper, §4.2.
    pub const fn paper() -> Self {
        Self {
            norm: MatchingNorm::L2,
            weight_2d: 0.0,
        }
    }

    /// The fast recipe.
    pub const fn fast() -> Self {
        Self {
            norm: MatchingNorm::L1,
            weight_2d: 0.0,
        }
    }
}

/// The cost of matching each local junction with each global one, row-major
/// [L, G]: their distance in the world plus `weight_2d` times their distance in
/// calibrated coordinates.
///
/// With weight 0 the calibrated points are not read and may be empty. See
/// [`MatchingConfig`] for the norms and weights in use.
///
/// # Panics
/// If the weight is not 0 and a calibrated list is shorter than its 3D list.
pub fn matching_cost(
    local_in_world: &[[f32; 3]],    // [L, 3]
    local_calibrated: &[[f32; 2]],  // [L, 2]
    global_in_world: &[[f32; 3]],   // [G, 3]
    global_calibrated: &[[f32; 2]], // [G, 2]
    weight_2d: f64,
    norm: MatchingNorm,
) -> Vec<f64> {
    let mut cost = Vec::with_capacity(local_in_world.len() * global_in_world.len());
    for (l, local) in local_in_world.iter().enumerate() {
        for (g, global) in global_in_world.iter().enumerate() {
            let in_image = if weight_2d == 0.0 {
                0.0
            } else {
                weight_2d * norm.distance(&local_calibrated[l], &global_calibrated[g])
            };
            cost.push(norm.distance(local, global) + in_image);
        }
    }
    cost
}
