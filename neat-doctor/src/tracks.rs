//! Points followed by what they look like through three views: the evidence in
//! photographs of textured things. Poses play no part in finding them.

use crate::agreement::{Agreement, PairTallies, Tally};
use crate::descriptor::{Descriptor, Keypoint, distance};
use crate::lens::straightened;
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Projection};
use rayon::prelude::*;

/// One point, seen by three views.
#[derive(Clone, Debug)]
pub(crate) struct Track([Sighting; 3]);

/// Where a view sees the point of a track.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sighting {
    /// Index of the view.
    pub view: usize,
    /// Image coordinates.
    pub pixel: Vector2<f64>,
    /// How far from its projection the point may be, in pixels.
    pub tolerance: f64,
    /// What it looks like there.
    pub descriptor: Descriptor,
}

/// The keypoints of one view.
#[derive(Clone, Debug)]
pub(crate) struct ViewKeypoints {
    /// Index of the view.
    pub view: usize,
    /// Pixels of the photograph along one pixel of the working image.
    pub factor: f64,
    /// Image coordinates of the first pixel's centre.
    pub pixel_center: f64,
    pub keypoints: Vec<Keypoint>,
}

/// Tolerance in pixels of the pyramid level where a corner was found.
const TOLERANCE: f64 = 2.0;
/// Residuals of good cameras are about as large, in tolerances.
const TYPICAL_RESIDUAL: f64 = 0.25;
/// More than this many of 256 bits differ by chance already.
pub(crate) const MAX_DISTANCE: u32 = 76;
/// The next best place differs by this many times as many bits, at least.
const MAX_RATIO: f64 = 0.85;
/// Keypoints of several levels nearer than this, in pixels, are the same place.
const SAME_PLACE: f32 = 8.0;
/// A track moves by at least this many working pixels between any two of its
/// views: what stands still says nothing.
const MIN_MOTION: f32 = 12.0;
/// Enough tracks for every decision.
const MAX_TRACKS: usize = 6000;
/// Marks a keypoint without a partner.
const NONE: u16 = u16::MAX;

impl ViewKeypoints {
    pub fn sighting(&self, index: usize) -> Sighting {
        let keypoint = &self.keypoints[index];
        // From the centres of working pixels to those of the photograph's.
        let full = |working: f32| (f64::from(working) + 0.5) * self.factor - 0.5;
        Sighting {
            view: self.view,
            pixel: Vector2::new(full(keypoint.x), full(keypoint.y)).add_scalar(self.pixel_center),
            tolerance: TOLERANCE * self.factor * f64::from(keypoint.scale),
            descriptor: keypoint.descriptor,
        }
    }
}

/// How many points each two views have in common, and the tracks through three.
pub(crate) struct Matching {
    /// For views i < j, in the order (0, 1), (0, 2), …, (1, 2), ….
    pub common: Vec<usize>,
    pub tracks: Vec<Track>,
}

/// Matches all views with all others. Three matches that close a circle make a
/// track: single matches that are wrong seldom do.
pub(crate) fn matching(views: &[ViewKeypoints]) -> Matching {
    let count = views.len();
    let pairs: Vec<[usize; 2]> = (0..count)
        .flat_map(|i| (i + 1..count).map(move |j| [i, j]))
        .collect();
    let partners: Vec<Vec<u16>> = pairs
        .par_iter()
        // With the processor's own instructions for counting bits.
        .map(|&[i, j]| {
            pulp::Arch::new().dispatch(|| partners(&views[i].keypoints, &views[j].keypoints))
        })
        .collect();
    let common = (partners.iter())
        .map(|partners| partners.iter().filter(|&&partner| partner != NONE).count())
        .collect();
    let pair_index = |i: usize, j: usize| i * (2 * count - i - 1) / 2 + j - i - 1;
    let found: Vec<Vec<[(usize, u16); 3]>> = pairs
        .par_iter()
        .map(|&[i, j]| {
            let mut found = Vec::new();
            for (a, &b) in partners[pair_index(i, j)].iter().enumerate() {
                if b == NONE {
                    continue;
                }
                for k in j + 1..count {
                    let c = partners[pair_index(i, k)][a];
                    if c == NONE || partners[pair_index(j, k)][usize::from(b)] != c {
                        continue;
                    }
                    let corners = [(i, a as u16), (j, b), (k, c)];
                    if motion(views, &corners) >= MIN_MOTION {
                        found.push(corners);
                    }
                }
            }
            found
        })
        .collect();
    let found: Vec<_> = found.concat();
    let step = found.len().div_ceil(MAX_TRACKS).max(1);
    let track = |corners: &[(usize, u16); 3]| {
        Track(corners.map(|(view, index)| views[view].sighting(index.into())))
    };
    Matching {
        common,
        tracks: found.iter().step_by(step).map(track).collect(),
    }
}

/// The smallest motion between two of three views, in working pixels.
fn motion(views: &[ViewKeypoints], corners: &[(usize, u16); 3]) -> f32 {
    let [a, b, c] = corners.map(|(view, index)| {
        let keypoint = &views[view].keypoints[usize::from(index)];
        Vector2::new(keypoint.x, keypoint.y)
    });
    (a - b).norm().min((b - c).norm()).min((a - c).norm())
}

/// For each keypoint of `a` the one of `b` that looks most like it, if that is
/// mutual and no other place of `b` looks nearly as alike.
#[inline(always)]
fn partners(a: &[Keypoint], b: &[Keypoint]) -> Vec<u16> {
    let mut of_a = vec![Nearest::NONE; a.len()];
    let mut of_b = vec![Nearest::NONE; b.len()];
    for (i, first) in a.iter().enumerate() {
        for (j, second) in b.iter().enumerate() {
            let distance = distance(&first.descriptor, &second.descriptor);
            of_a[i].offer(distance, j, b);
            of_b[j].offer(distance, i, a);
        }
    }
    let mutual = |(i, nearest): (usize, &Nearest)| {
        let other = of_b.get(usize::from(nearest.index));
        let good = nearest.is_clear() && other.is_some_and(|other| usize::from(other.index) == i);
        if good { nearest.index } else { NONE }
    };
    of_a.iter().enumerate().map(mutual).collect()
}

/// The two keypoints that look most like another, at different places.
#[derive(Clone, Copy)]
struct Nearest {
    index: u16,
    distance: u32,
    next_distance: u32,
}

impl Nearest {
    const NONE: Self = Self {
        index: NONE,
        distance: u32::MAX,
        next_distance: u32::MAX,
    };

    #[inline(always)]
    fn offer(&mut self, distance: u32, index: usize, keypoints: &[Keypoint]) {
        if distance >= self.next_distance {
            return;
        }
        let elsewhere = keypoints.get(usize::from(self.index)).is_none_or(|best| {
            let other = &keypoints[index];
            (best.x - other.x).hypot(best.y - other.y) > SAME_PLACE
        });
        if distance < self.distance {
            if elsewhere {
                self.next_distance = self.distance;
            }
            self.distance = distance;
            // At most 900 keypoints.
            self.index = index as u16;
        } else if elsewhere {
            self.next_distance = distance;
        }
    }

    fn is_clear(&self) -> bool {
        self.index != NONE
            && self.distance <= MAX_DISTANCE
            && f64::from(self.distance) <= MAX_RATIO * f64::from(self.next_distance)
    }
}

impl Track {
    #[cfg(test)]
    pub fn new(sightings: [Sighting; 3]) -> Self {
        Self(sightings)
    }

    /// The views that see the point.
    pub fn views(&self) -> [usize; 3] {
        self.0.map(|sighting| sighting.view)
    }

    /// The track as pinholes see it, in place of a lens of this strength.
    pub fn straightened(&self, cameras: &[Camera], strength: f64) -> Self {
        Self(self.0.map(|sighting| Sighting {
            pixel: straightened(&sighting.pixel, &cameras[sighting.view], strength),
            ..sighting
        }))
    }

    /// The largest distance to the projections of the point, in tolerances; infinite if it is
    /// behind a camera. The point is the triangulated one, or one as far away as can be: rays
    /// to a mountain are parallel, and where they meet is chance.
    pub fn residual(&self, cameras: &[Camera]) -> f64 {
        let near = (self.triangulated(cameras)).map_or(f64::INFINITY, |point| {
            self.largest(|sighting| cameras[sighting.view].project(&point))
        });
        let directions = self.0.map(|sighting| {
            let ray = cameras[sighting.view].ray_through(&sighting.pixel);
            ray.direction
        });
        let far: Vector3<f64> = directions.iter().sum();
        near.min(self.largest(|sighting| {
            let camera = &cameras[sighting.view];
            camera.project(&(camera.center_in_world + far))
        }))
    }

    fn largest(&self, projection: impl Fn(&Sighting) -> Projection) -> f64 {
        let residuals = self.0.iter().map(|sighting| {
            let projection = projection(sighting);
            if projection.depth > 0.0 {
                (projection.pixel - sighting.pixel).norm() / sighting.tolerance
            } else {
                f64::INFINITY
            }
        });
        residuals.fold(0.0, f64::max)
    }

    /// Where its views see it.
    pub fn sightings(&self) -> &[Sighting; 3] {
        &self.0
    }

    /// The point nearest to the three rays.
    pub fn triangulated(&self, cameras: &[Camera]) -> Option<Vector3<f64>> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for sighting in &self.0 {
            let ray = cameras[sighting.view].ray_through(&sighting.pixel);
            let across = Matrix3::identity() - ray.direction * ray.direction.transpose();
            normal += across;
            right += across * ray.origin;
        }
        Some(normal.try_inverse()? * right)
    }
}

/// How well the poses of `cameras` explain the tracks that pass only through
/// `trusted` views.
pub(crate) fn agreement(tracks: &[Track], cameras: &[Camera], trusted: &[bool]) -> Agreement {
    let mut agreement = Agreement::none(cameras.len());
    for track in tracks {
        if !track.views().iter().all(|&view| trusted[view]) {
            continue;
        }
        let residual = track.residual(cameras);
        let explained = residual < 1.0;
        agreement.all += Tally::one(explained);
        agreement.score += 1.0 / (1.0 + (residual / TYPICAL_RESIDUAL).powi(2));
        for view in track.views() {
            agreement.per_view[view] += Tally::one(explained);
        }
    }
    agreement
}

/// For each two views how many of the tracks through both the cameras explain.
pub(crate) fn in_common(tracks: &[Track], cameras: &[Camera]) -> PairTallies {
    let mut pairs = PairTallies::new(cameras.len());
    for track in tracks {
        let explained = Tally::one(track.residual(cameras) < 1.0);
        let [a, b, c] = track.views();
        for pair in [[a, b], [b, c], [a, c]] {
            pairs.add(pair, explained);
        }
    }
    pairs
}
