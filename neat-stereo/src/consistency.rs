//! Which matches other views confirm.

use crate::SurfacePoint;
use crate::depth_map::DepthMap;
use crate::view::StereoView;
use nalgebra::Vector3;

/// Views that have to confirm a point.
const MIN_CONFIRMING: usize = 2;
/// How far a confirming surface may lie off, in pixels.
const MAX_OFFSET: f64 = 1.0;
/// Cosine of the largest angle of two normals of one surface.
const MIN_COSINE: f64 = 0.8;

pub(crate) fn confirmed_points(
    views: &[StereoView],
    maps: &[DepthMap],
    view: usize,
    neighbours: &[usize],
    ball_radius: f64,
) -> Vec<SurfacePoint> {
    let (here, map) = (&views[view], &maps[view]);
    let calibrated = here.calibrated_from_pixels(0);
    let mut points = Vec::new();
    for (index, found) in map.matches.iter().enumerate() {
        let Some(found) = found else { continue };
        let [x, y] = map.pixel(index, 0);
        let ray = calibrated * Vector3::new(x as f64, y as f64, 1.0);
        let plane: Vector3<f64> = found.plane.cast();
        let inverse_depth = plane.dot(&ray);
        let to_world = |v: Vector3<f64>| here.camera.world_from_camera * v;
        let position = here.camera.center_in_world + to_world(ray / inverse_depth);
        if position.norm() >= ball_radius {
            continue;
        }
        let normal = to_world(-plane.normalize());
        let mut confirmed_by = Vec::new();
        let mut offsets = vec![];
        for &other in neighbours {
            if let Some(offset) = offset_in(here, &views[other], &maps[other], &position, &normal) {
                confirmed_by.push(other);
                offsets.push(offset);
            }
        }
        if confirmed_by.len() < MIN_CONFIRMING {
            continue;
        }
        let mean = offsets.iter().sum::<f64>() / (offsets.len() + 1) as f64;
        let variance = offsets.iter().map(|o| (o - mean).powi(2)).sum::<f64>() + mean * mean;
        let sight = to_world(ray).normalize();
        points.push(SurfacePoint {
            position_in_world: position + sight * mean,
            normal_in_world: normal,
            view,
            confirmed_by,
            deviation: (variance / offsets.len() as f64).sqrt(),
            score: found.score,
            sharpness: found.deviation,
        });
    }
    points
}

/// How far behind `position`, along the ray from `here`, the surface of `other` lies, where
/// that is nearly the same surface.
fn offset_in(
    here: &StereoView,
    other: &StereoView,
    map: &DepthMap,
    position: &Vector3<f64>,
    normal: &Vector3<f64>,
) -> Option<f64> {
    let in_camera = other.camera.to_camera(position);
    if in_camera.z <= 0.0 {
        return None;
    }
    let pixel = other.pixels_from_calibrated(map.level) * in_camera / in_camera.z;
    let cell = |at: f64, count: usize| {
        let at = at.round();
        (0.0..count as f64).contains(&at).then_some(at as usize)
    };
    let (column, row) = (cell(pixel.x, map.columns)?, cell(pixel.y, map.rows)?);
    let found = map.matches[row * map.columns + column]?;
    let plane: Vector3<f64> = found.plane.cast();
    let normal_there = other.camera.world_from_camera * -plane.normalize();
    if normal_there.dot(normal) < MIN_COSINE {
        return None;
    }
    // The plane of `other` met by the ray from `here`.
    let from = other.camera.to_camera(&here.camera.center_in_world);
    let sight = (position - here.camera.center_in_world).normalize();
    let along = other.camera.world_from_camera.tr_mul(&sight);
    let distance = (1.0 - plane.dot(&from)) / plane.dot(&along);
    let offset = distance - (position - here.camera.center_in_world).norm();
    // In pixels of `other`.
    let moved = other.camera.to_camera(&(position + sight * offset));
    if !offset.is_finite() || moved.z <= 0.0 {
        return None;
    }
    let to_pixel = other.pixels_from_calibrated(0);
    let (a, b) = (
        to_pixel * in_camera / in_camera.z,
        to_pixel * moved / moved.z,
    );
    ((a - b).norm() <= MAX_OFFSET).then_some(offset)
}
