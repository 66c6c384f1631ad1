//! Tubes between arcs of one axis: the rims of a cylinder or a cone tell where it is.

use super::circle_fitting::FoundArc;
use super::line_fitting::directions_across;
use super::outlines::Tube;
use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3};

/// Axes of two arcs are one within so many pixels, at both arcs: as far as lines that meet may be
/// apart, and arcs of a few pixels' bow more.
const GAP_IN_PIXELS: f64 = 2.0;
/// Arcs that are nearer to each other, in pixels, are one or lie in one plane.
const MIN_LENGTH_IN_PIXELS: f64 = 4.0;

/// The tubes of which two arcs are rims.
pub(super) fn tubes_between(arcs: &[FoundArc]) -> Vec<Tube> {
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
