//! The half-planes that are hinged at an edge, and the views that see them.

use crate::statistics::upper_median;
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment3};
use std::f64::consts::PI;

/// Half-planes on each side of an edge.
pub(super) const HALF_PLANES: usize = 17;
/// Angle between neighbours: a strip of eight pixels that is turned by it moves by half a
/// pixel between views that are 20° apart.
const STEP: f64 = PI / (HALF_PLANES + 1) as f64;
/// A half-plane that is seen under a flatter angle than 4° is too foreshortened to compare.
const GRAZING: f64 = PI / 45.0;
/// What is foreshortened is followed farther, but not by more than this; 5 down to 8° and 3 down to
/// 15° do a little worse.
const MAX_STRETCH: f64 = 10.0;
/// Share of the views that must be in front of a plane. The others may be given a segment of
/// something else. With a half the kinds are as good.
const MIN_IN_FRONT: f64 = 0.75;
/// More views add time, but little that these do not say.
const MAX_VIEWS: usize = 16;
/// Shortest length that has a direction, relative to the distance of the camera.
const MIN_LENGTH: f64 = 1e-9;

/// An edge, the views that show it, and the frame of the half-planes hinged at it.
///
/// A half-plane has an *azimuth*: 0 points to where the cameras are in the mean. The i-th
/// half-plane of a side has the azimuth ±(i + 1)·10°, so that the i-th of one side continues
/// the one at `HALF_PLANES − 1 − i` of the other.
#[derive(Clone, Debug)]
pub(super) struct EdgeFrame {
    pub segment: LineSegment3,
    toward: Vector3<f64>,
    left: Vector3<f64>,
    /// The views on the side from which most show it, and the azimuths of their cameras, in
    /// radians; by azimuth.
    views: Vec<(usize, f64)>,
    /// Length of a pixel at the edge, in the unit of the world: the median of its views.
    pub pixel: f64,
}

/// The direction that the others are turned off least, of some of them; one that is shown a
/// segment of something else may stand anywhere. `None` without any.
fn middle_of(rays: impl ExactSizeIterator<Item = Vector3<f64>> + Clone) -> Option<Vector3<f64>> {
    let step = rays.len().div_ceil(MAX_VIEWS).max(1);
    let turned = |ray: &Vector3<f64>| rays.clone().map(|other| ray.angle(&other)).sum::<f64>();
    let some = rays.clone().step_by(step).map(|ray| (turned(&ray), ray));
    let middle = some.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(middle.1)
}

/// The two sides of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
}

impl EdgeFrame {
    /// `None` for an edge without length or with no view that could see a side of it.
    pub(super) fn new(segment: LineSegment3, views: &[usize], cameras: &[Camera]) -> Option<Self> {
        let direction = (segment.end - segment.start).try_normalize(0.0)?;
        let middle = segment.point_at(0.5);
        let across = |v: Vector3<f64>| v - direction * direction.dot(&v);
        let mut rays = Vec::new();
        for &view in views {
            let camera = cameras.get(view)?;
            let offset = camera.center_in_world - middle;
            let depth = camera.to_camera(&middle).z;
            if let Some(ray) = across(offset).try_normalize(MIN_LENGTH * offset.norm())
                && depth > 0.0
            {
                rays.push((view, ray, depth / camera.intrinsics.fx));
            }
        }
        let front = middle_of(rays.iter().map(|(_, ray, _)| *ray))?;
        rays.retain(|(_, ray, _)| ray.dot(&front) > 0.0);
        let sum: Vector3<f64> = rays.iter().map(|(_, ray, _)| ray).sum();
        let toward = across(sum).try_normalize(MIN_LENGTH)?;
        let left = toward.cross(&direction);
        let azimuth = |ray: &Vector3<f64>| ray.dot(&left).atan2(ray.dot(&toward));
        let mut views: Vec<(usize, f64)> = rays
            .iter()
            .map(|(view, ray, _)| (*view, azimuth(ray)))
            .collect();
        views.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut pixels: Vec<f64> = rays.iter().map(|(.., pixel)| *pixel).collect();
        Some(Self {
            segment,
            toward,
            left,
            views,
            pixel: upper_median(&mut pixels),
        })
    }

    /// The views that are asked, evenly by azimuth, with their azimuths.
    pub(super) fn asked_views(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (all, asked) = (self.views.len(), self.views.len().min(MAX_VIEWS));
        (0..asked).map(move |i| match asked {
            1 => self.views[0],
            _ => self.views[i * (all - 1) / (asked - 1)],
        })
    }

    /// Length in pixels of its median view.
    pub(super) fn length_in_pixels(&self) -> f64 {
        self.segment.length() / self.pixel
    }

    /// From the edge into a half-plane, to what the median view that sees it shows a pixel
    /// beside the edge.
    pub(super) fn pixel_into(&self, side: Side, index: usize) -> Vector3<f64> {
        let azimuth = azimuth(side, index);
        let seen = (self.views.iter()).filter(|(_, camera)| is_seen(side, index, *camera));
        let mut sines: Vec<f64> = seen
            .map(|(_, camera)| (azimuth - camera).sin().abs())
            .collect();
        let stretch = upper_median(&mut sines).recip().min(MAX_STRETCH);
        (self.toward * azimuth.cos() + self.left * azimuth.sin()) * (self.pixel * stretch)
    }

    /// The planes through the edge, by the index of their left half, that most of its
    /// views are in front of.
    pub(super) fn common_planes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..HALF_PLANES).filter(|&index| {
            let left = azimuth(Side::Left, index);
            let in_front = |view: &&(usize, f64)| (left - view.1).sin() > 0.0;
            let count = self.views.iter().filter(in_front).count();
            count as f64 >= MIN_IN_FRONT * self.views.len() as f64
        })
    }
}

/// Whether a camera at an azimuth sees a half-plane on its side of the edge and not too flat.
pub(super) fn is_seen(side: Side, index: usize, camera_azimuth: f64) -> bool {
    let apart = (azimuth(side, index) - camera_azimuth) * side.sign();
    (GRAZING..=PI - GRAZING).contains(&apart.rem_euclid(2.0 * PI))
}

fn azimuth(side: Side, index: usize) -> f64 {
    side.sign() * STEP * (index + 1) as f64
}

impl Side {
    pub(super) const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Of azimuths on this side.
    fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}
