//! What a line that the images show stands for: an edge, a curve, or the outline of something
//! round.

use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::outlines::Tube;
use neat_core::{CircularArc, LineSegment3};

/// What a line stands for.
pub(super) enum Kind {
    Straight,
    /// The arc through it, if it is one.
    Curve(Option<CircularArc>),
    Outline(Tube),
}

/// What a line stands for by the edgels beside it, whose standard deviation is `noise` pixels.
pub(super) fn kind(
    images: &Images,
    line: &LineSegment3,
    evidence: &LineEvidence,
    noise: f64,
) -> Kind {
    match curve_or_straight(images, line, evidence, noise) {
        Kind::Straight => images
            .tube(line, evidence)
            .map_or(Kind::Straight, Kind::Outline),
        curve => curve,
    }
}

/// Likewise, where nobody wants to know of outlines.
pub(super) fn curve_or_straight(
    images: &Images,
    line: &LineSegment3,
    evidence: &LineEvidence,
    noise: f64,
) -> Kind {
    let bend = images.bend(line, evidence);
    let bow = bend.bow.as_ref();
    if images.is_curved(line, &bend, noise) {
        Kind::Curve(bow.and_then(|bow| images.arc_of_bow(line, evidence, bow)))
    } else if let Some(arc) = images.arc_of_chord(line, evidence, bow, noise) {
        Kind::Curve(Some(arc))
    } else {
        Kind::Straight
    }
}
