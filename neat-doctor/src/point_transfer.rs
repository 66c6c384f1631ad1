//! Points carried over to a view: the last word about a pose that few tracks tell of, as where
//! bricks and leaves look alike everywhere.
//!
//! Points that other views agree on are projected into the view. With the right pose more of
//! them meet a keypoint that looks like them than beside these places; with a wrong one no
//! place is better than another.

use crate::descriptor::distance;
use crate::tracks::{MAX_DISTANCE, Sighting, Track, ViewKeypoints};
use nalgebra::{Vector2, Vector3};
use neat_core::Camera;

/// Places beside a projection that tell of chance, in pixels of the working image: far enough
/// for no keypoint to lie at two of them.
const BESIDE: f64 = 24.0;
const DECOYS: [[f64; 2]; 8] = [
    [-1.0, -1.0],
    [-1.0, 0.0],
    [-1.0, 1.0],
    [0.0, -1.0],
    [0.0, 1.0],
    [1.0, -1.0],
    [1.0, 0.0],
    [1.0, 1.0],
];

/// A point that some views agree on.
pub(crate) struct KnownPoint<'a> {
    position: Vector3<f64>,
    sightings: &'a [Sighting; 3],
}

/// The points of the tracks that the cameras of trusted views explain.
pub(crate) fn known_points<'a>(
    tracks: &'a [Track],
    cameras: &[Camera],
    trusted: &[bool],
) -> Vec<KnownPoint<'a>> {
    (tracks.iter())
        .filter(|track| track.views().iter().all(|&view| trusted[view]))
        .filter(|track| track.residual(cameras) < 1.0)
        .filter_map(|track| {
            Some(KnownPoint {
                position: track.triangulated(cameras)?,
                sightings: track.sightings(),
            })
        })
        .collect()
}

/// How many more points meet a keypoint of theirs in a view than beside it, in standard
/// deviations of that difference by chance.
pub(crate) fn transfer_gain(
    view: &ViewKeypoints,
    camera: &Camera,
    points: &[KnownPoint<'_>],
) -> f64 {
    let places: Vec<Sighting> = (0..view.keypoints.len())
        .map(|index| view.sighting(index))
        .collect();
    let (mut met, mut beside) = (0, 0);
    for point in points {
        let projection = camera.project(&point.position);
        let inside = |place: &Vector2<f64>| {
            let size = [camera.width, camera.height].map(f64::from);
            (0.0..size[0]).contains(&place.x) && (0.0..size[1]).contains(&place.y)
        };
        if projection.depth <= 0.0 || !inside(&projection.pixel) {
            continue;
        }
        // What looks like the point at all, wherever it is.
        let alike: Vec<&Sighting> = (places.iter())
            .filter(|place| {
                let off = (place.pixel - projection.pixel).amax();
                off <= BESIDE * view.factor + place.tolerance
                    && (point.sightings.iter())
                        .any(|seen| distance(&seen.descriptor, &place.descriptor) <= MAX_DISTANCE)
            })
            .collect();
        let is_met = |offset: Vector2<f64>| {
            let place = projection.pixel + offset * (BESIDE * view.factor);
            (alike.iter()).any(|seen| (seen.pixel - place).norm() <= seen.tolerance)
        };
        met += usize::from(is_met(Vector2::zeros()));
        beside += (DECOYS.iter())
            .filter(|decoy| is_met((**decoy).into()))
            .count();
    }
    let decoys = DECOYS.len() as f64;
    let by_chance = beside as f64 / decoys;
    (met as f64 - by_chance) / (by_chance * (1.0 + 1.0 / decoys)).sqrt().max(1.0)
}
