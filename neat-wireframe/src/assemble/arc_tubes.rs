//! What known arcs explain: chords of their own, and the outlines of the tubes between them. The
//! rims of a cylinder or a cone tell where it is, which few views of an outline do not.

use super::circle_fitting::FoundArc;
use super::edge_samples::Images;
use super::known_tubes::GAP;
use super::line_fitting::directions_across;
use super::outlines::Tube;
use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3};

/// Axes of two arcs are one within so many pixels, at both arcs: as far as lines that meet may be
/// apart, and arcs of a few pixels' bow more.
const GAP_IN_PIXELS: f64 = 2.0;
/// Arcs that are nearer to each other, in pixels, are one or lie in one plane.
const MIN_LENGTH_IN_PIXELS: f64 = 4.0;

/// A line that is farther from an arc, in pixels, is no chord of it: one that bends more is told by
/// its bow.
const NEAR_IN_PIXELS: f64 = 8.0;

/// Arcs, and the tubes between them.
pub(super) struct KnownArcs {
    arcs: Vec<FoundArc>,
    tubes: Vec<Tube>,
}

impl KnownArcs {
    pub(super) fn new(arcs: &[FoundArc]) -> Self {
        Self {
            arcs: arcs.to_vec(),
            tubes: tubes_between(arcs),
        }
    }

    /// Whether a line along arcs or tubes is nothing else: as soon as these have their edgels,
    /// not more than `least` speaks for it.
    pub(super) fn explain(&self, images: &Images, line: &LineSegment3, least: f64) -> bool {
        let gap = GAP * images.reach * images.pixel_size(line, 0..images.views.len());
        let touched = (self.tubes.iter()).filter_map(|tube| tube.touched_by(line, gap));
        let touched: Vec<Tube> = touched.collect();
        let is_chord = |found: &&FoundArc| {
            let near = NEAR_IN_PIXELS * found.pixel;
            let mut points = [0.1, 0.5, 0.9].map(|place| line.point_at(place)).into_iter();
            points.all(|point| {
                let angle = found.arc.angle_of(&point);
                found.arc.distance_to_circle(&point) < near
                    && found.arc.contains(angle, near / found.arc.radius)
            })
        };
        let along: Vec<&FoundArc> = self.arcs.iter().filter(is_chord).collect();
        if touched.is_empty() && along.is_empty() {
            return false;
        }
        let mut taken = images.nothing_taken();
        for tube in &touched {
            images.claim_outlines(tube, &mut taken);
        }
        let wide = Images {
            reach: GAP * images.reach,
            ..*images
        };
        for found in along {
            wide.claim_arc(found, &mut taken);
        }
        images.evidence(line, Some(&taken), least).gain <= least
    }
}

/// The tubes of which two arcs are rims.
fn tubes_between(arcs: &[FoundArc]) -> Vec<Tube> {
    let tube = |(one, other): (&FoundArc, &FoundArc)| {
        tube_between(&one.arc, &other.arc, one.pixel.max(other.pixel))
    };
    (arcs.iter().enumerate())
        .flat_map(|(k, one)| arcs[k + 1..].iter().map(move |other| (one, other)))
        .filter_map(tube)
        .collect()
}

fn tube_between(one: &CircularArc, other: &CircularArc, pixel: f64) -> Option<Tube> {
    let between = other.center - one.center;
    let length = between.norm();
    // How far the axis of an arc passes the other's centre, and turns the other's plane.
    let off_axis = |arc: &CircularArc| between.cross(&arc.normal()).norm();
    let turned = |arc: &CircularArc| arc.radius * arc.normal().cross(&between).norm() / length;
    let gap = GAP_IN_PIXELS * pixel;
    let is_coaxial = [one, other].iter().all(|arc| off_axis(arc).max(turned(arc)) <= gap);
    if length < MIN_LENGTH_IN_PIXELS * pixel || !is_coaxial {
        return None;
    }
    let outward: Vector3<f64> = one.axes[0];
    let [start, end] = [one, other].map(|arc| arc.center + arc.radius * outward);
    let line = LineSegment3::new(start, end);
    let across = directions_across(&line)?;
    let axis = [one, other].map(|arc| -arc.radius * across.tr_mul(&outward));
    Some(Tube {
        axis,
        radius: 0.5 * (one.radius + other.radius),
        taper: 0.5 * (other.radius - one.radius),
        ..Tube::touching(&line, across, -axis[0])
    })
}
