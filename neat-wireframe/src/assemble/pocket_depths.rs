//! Depths of pockets that edgels propose: one that nothing has would lie, if it were of the floor, on
//! the wall that stands on an edge of the rim, and along it. There its ray says how deep.

use super::curves::BESIDE_IN_PIXELS;
use super::edge_samples::Images;
use super::view_segments::PreparedView;
use crate::statistics::upper_median;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Edgels are proposals for so many depths of a plane at most: those for which most of them speak.
const MAX_DEPTHS: usize = 4;
/// Nothing is larger than the largest image, in pixels.
const MAX_SPAN: f64 = 1e5;
/// Whole projections of edges by which edgels of all views have to speak for a depth, beyond those
/// that do for any.
const MIN_VOTES: f64 = 1.5;
/// A view shows parts of an edge at a depth from this share on.
const MIN_SHARE: f64 = 0.4;
/// Edges have more edgels than this, in pixels: one alone says nothing.
const MIN_PIXELS: f64 = 6.0;
/// Edgels of a floor lie at most at this angle to it in the image (sine, about 15°): those of short
/// edges are less sure than those that a line takes.
const MAX_SINE: f64 = 0.25;

/// An edgel that nothing has.
pub(super) struct FreeEdgel {
    ray: Vector3<f64>,
    /// Unit normal of the plane that its tangent and the camera's centre span.
    plane_normal: Vector3<f64>,
}

/// Those of each view.
pub(super) fn free_edgels(images: &Images, taken: &[Vec<bool>]) -> Vec<Vec<FreeEdgel>> {
    let of_view = |view: usize| {
        let (camera, map) = (&images.views[view].camera, &images.maps[view]);
        let free = (0..map.len()).filter(|edgel| !taken[view][*edgel]);
        let with_rays = free.filter_map(|edgel| {
            let edgel = map.get(edgel);
            let pixel: Vector2<f64> = edgel.position.cast();
            let along = Vector2::new(-edgel.normal.y, edgel.normal.x).cast();
            let [ray, beside] = [pixel, pixel + along].map(|p| camera.ray_through(&p).direction);
            Some(FreeEdgel {
                ray,
                plane_normal: ray.cross(&beside).try_normalize(0.0)?,
            })
        });
        with_rays.collect()
    };
    (0..images.views.len())
        .into_par_iter()
        .map(of_view)
        .collect()
}

/// The edges of a plane, and how far from it a floor may be.
pub(super) struct Rim {
    pub edges: Vec<LineSegment3>,
    pub normal: Vector3<f64>,
    /// The least and the largest depth, along the normal, in pixels.
    pub span: [f64; 2],
    pub pixel: f64,
}

impl Rim {
    /// The depths for which most free edgels of all views speak.
    pub(super) fn depths(&self, images: &Images, free: &[Vec<FreeEdgel>]) -> Vec<f64> {
        let [low, high] = self.span;
        let bins = Bins {
            first: low.floor() - 2.0,
            count: (high - low).min(MAX_SPAN).ceil() as usize + 5,
        };
        let mut votes = vec![0.0; bins.count];
        let mut shares = vec![0.0; self.edges.len() * bins.count];
        for (view, free) in images.views.iter().zip(free) {
            let walls: Vec<Wall> = (self.edges.iter())
                .map(|edge| Wall::new(edge, &self.normal, view))
                .collect();
            shares.fill(0.0);
            // All walls look at an edgel while it is at hand.
            for edgel in free {
                for (wall, shares) in walls.iter().zip(shares.chunks_exact_mut(bins.count)) {
                    let Some(place) = wall.place_of(edgel) else {
                        continue;
                    };
                    if let Some(bin) = bins.of(wall.depth(&place) / self.pixel) {
                        shares[bin] += wall.pixels(&place).max(MIN_PIXELS).recip();
                    }
                }
            }
            for shares in shares.chunks_exact(bins.count) {
                for k in 1..bins.count - 1 {
                    let share: f64 = shares[k - 1..=k + 1].iter().sum();
                    if share > MIN_SHARE {
                        votes[k] += share.min(1.0);
                    }
                }
            }
        }
        let usual = upper_median(&mut votes.clone());
        let is_peak = |k: &usize| {
            votes[*k] - usual >= MIN_VOTES
                && votes[*k] >= votes[k - 1]
                && votes[*k] > votes[k + 1]
                && bins.depth(*k).abs() > BESIDE_IN_PIXELS
        };
        let mut peaks: Vec<usize> = (1..bins.count - 1).filter(is_peak).collect();
        peaks.sort_by(|a, b| votes[*b].total_cmp(&votes[*a]));
        peaks.truncate(MAX_DEPTHS);
        let in_world = |peak| bins.depth(peak) * self.pixel;
        peaks.into_iter().map(in_world).collect()
    }
}

/// The wall that stands on an edge, as a view sees it.
struct Wall<'a> {
    view: &'a PreparedView,
    edge: &'a LineSegment3,
    normal: Vector3<f64>,
    along: Vector3<f64>,
    length: f64,
    /// Unit normal of the wall, and how far the camera is from it.
    across: Vector3<f64>,
    distance: f64,
    /// Normals of the planes of the camera's centre and what stands on the two ends: rays between
    /// these are at different sides of both.
    sides: [Vector3<f64>; 2],
}

/// Where an edgel would lie on a wall.
struct OnWall {
    place: Vector3<f64>,
    /// Sine of the angle between the wall's edge and the ray.
    sine: f64,
}

impl<'a> Wall<'a> {
    fn new(edge: &'a LineSegment3, normal: &Vector3<f64>, view: &'a PreparedView) -> Self {
        let length = edge.length();
        let along = (edge.end - edge.start) / length;
        let across = normal.cross(&along);
        let center = view.camera.center_in_world;
        Self {
            view,
            edge,
            normal: *normal,
            along,
            length,
            across,
            distance: across.dot(&(edge.start - center)),
            sides: edge.ends().map(|end| normal.cross(&(end - center))),
        }
    }

    /// Where an edgel lies that runs along the edge.
    fn place_of(&self, edgel: &FreeEdgel) -> Option<OnWall> {
        let FreeEdgel { ray, plane_normal } = edgel;
        // Nearly all edgels end here.
        let [start, end] = &self.sides;
        if (start.dot(ray) > 0.0) == (end.dot(ray) > 0.0) {
            return None;
        }
        let off = plane_normal.dot(&self.along).abs();
        let sine = (self.along - self.along.dot(ray) * ray).norm();
        let distance = self.distance / self.across.dot(ray);
        (off <= MAX_SINE * sine && distance > 0.0).then(|| OnWall {
            place: self.view.camera.center_in_world + distance * ray,
            sine,
        })
    }

    fn depth(&self, at: &OnWall) -> f64 {
        self.normal.dot(&(at.place - self.edge.start))
    }

    /// The length of the edge as the view would see it there, in pixels.
    fn pixels(&self, at: &OnWall) -> f64 {
        self.length * at.sine / self.view.pixel_size_at(&at.place)
    }
}

/// Depths by pixels.
struct Bins {
    /// The depth where the first one begins.
    first: f64,
    count: usize,
}

impl Bins {
    fn of(&self, depth: f64) -> Option<usize> {
        let bin = depth - self.first;
        (0.0..self.count as f64)
            .contains(&bin)
            .then_some(bin as usize)
    }

    /// The middle of a bin.
    fn depth(&self, bin: usize) -> f64 {
        self.first + bin as f64 + 0.5
    }
}
