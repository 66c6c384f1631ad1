//! What the assembler returns.

use crate::Wireframe3d;
use nalgebra::Matrix4;
use neat_core::{Camera, CircularArc, Dome, Spline};
use serde::{Deserialize, Serialize};

/// A wireframe, and how it came about.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assembled {
    /// Junctions in lexicographic order of their coordinates; edges `[a, b]`, a < b, sorted.
    pub wireframe: Wireframe3d,
    /// Arcs of circles that the images show.
    pub arcs: Vec<CircularArc>,
    /// The covariance of each arc's centre and radius, in squared units of the world; `None` where
    /// the views do not tell.
    pub arc_covariances: Vec<Option<Matrix4<f64>>>,
    /// Smooth curves that are no circles.
    pub splines: Vec<Spline>,
    /// Parts of spheres that outlines show.
    pub domes: Vec<Dome>,
    /// What each step found.
    pub report: AssembleReport,
    /// The cameras of all views, from where the images show the wireframe; `None` where they
    /// stand as given.
    pub refined_cameras: Option<Vec<Camera>>,
}

/// What each step of [`super::assemble`] found, in the order of the steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AssembleReport {
    /// Views with a camera that can be used.
    pub usable_views: usize,
    /// 2D segments that propose lines.
    pub usable_segments: usize,
    /// Points of edges in all images.
    pub edgels: usize,
    /// 2D segments with a position in space.
    pub segments_with_hypotheses: usize,
    /// How far refined poses move lines in the images, in pixels, if poses were refined …
    pub poses_moved_in_pixels: f64,
    /// … and the share of that which two halves of the lines agree on.
    pub pose_reliability: f64,
    /// Standard deviation of edgels from the lines, in pixels.
    pub noise_in_pixels: f64,
    /// Straight lines that the images show …
    pub lines: usize,
    /// … those that stand for curves, and are left out …
    pub curved_lines: usize,
    /// … of which so many arcs came …
    pub arcs: usize,
    /// … and splines of chains of arcs, which are none of these …
    #[serde(default)]
    pub splines: usize,
    /// … and outlines of round things, which are left out, too.
    pub outlines: usize,
    /// Parts of spheres, by their outlines.
    #[serde(default)]
    pub domes: usize,
    /// Lines that were pieces of others.
    pub merged_pieces: usize,
    /// Directions that several lines have, and were turned to.
    pub common_directions: usize,
    /// Places where lines end, alone or together.
    pub ends: usize,
    /// Edges between corners that no pair of views could place.
    pub completed_edges: usize,
    /// Edges that are hardly structure, and were left out once their kinds were known.
    #[serde(default)]
    pub painted: usize,
    /// Edges that no image shows, but solids ask for.
    #[serde(default)]
    pub inferred_edges: usize,
    /// Junctions of the wireframe.
    pub junctions: usize,
    /// Edges of the wireframe.
    pub edges: usize,
}
