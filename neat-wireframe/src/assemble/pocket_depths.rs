//! Depths of pockets that edgels propose: one that nothing has would lie, if it were of the floor, on
//! the wall that stands on an edge of the rim, and along it. There its ray says how deep.

use super::depth_votes::{DepthVotes, FreeEdgel};
use super::edge_samples::Images;
use super::view_segments::PreparedView;
use nalgebra::Vector3;
use neat_core::LineSegment3;

/// Edgels of a floor lie at most at this angle to it in the image (sine, about 15°): those of short
/// edges are less sure than those that a line takes.
const MAX_SINE: f64 = 0.25;

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
        let mut votes = DepthVotes::new(self.span, self.edges.len());
        for (view, free) in images.views.iter().zip(free) {
            let walls: Vec<Wall> = (self.edges.iter())
                .map(|edge| Wall::new(edge, &self.normal, view))
                .collect();
            // All walls look at an edgel while it is at hand.
            for edgel in free {
                for (edge, wall) in walls.iter().enumerate() {
                    if let Some(place) = wall.place_of(edgel) {
                        votes.add(edge, wall.depth(&place) / self.pixel, wall.pixels(&place));
                    }
                }
            }
            votes.end_view();
        }
        let in_world = |depth| depth * self.pixel;
        votes.peaks().into_iter().map(in_world).collect()
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
