//! Further outlines of tubes that others have shown.
//!
//! A long cylinder has dozens of outlines, each of a few neighbouring views. Its last ones are
//! seen by too few to tell a tube by, and lie off its surface, where the tangent planes of these
//! views meet. But the tube is known by then, and need not be fitted.

use super::claimed_edgels::claim_edgels_of;
use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::directions_across;
use super::line_selection::ChosenLine;
use super::outlines::{ADVANTAGE, FREE_VIEWS, Tube, shows_as_well};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// A line touches a tube within so many reaches: as far as lines that meet may be apart …
pub(super) const GAP: f64 = 2.0;
/// … or lies outside by so much of the radius, where tangent planes meet that are 60° apart …
const MAX_BEYOND: f64 = 0.15;
/// … if it has this cosine to the ruling there, 30°, judged: what few views show is oblique.
const MIN_COSINE: f64 = 0.866;

/// An outline leaves at most this share of a line's evidence, judged: what a tube is fitted to
/// does not lie on it exactly.
const MOST_LEFT: f64 = 0.5;

impl Tube {
    /// The part of the tube beside a line, as a tube around its own axis; `None` unless they
    /// touch, within `gap`.
    pub(super) fn touched_by(&self, line: &LineSegment3, gap: f64) -> Option<Self> {
        let [start, end] = self.axis.map(|axis| self.across * axis);
        let axis = LineSegment3::new(self.line.start + start, self.line.end + end);
        let across = directions_across(&axis)?;
        // What is across its line is oblique to the axis of a cone.
        let [of_line, of_axis] = [self.line, axis].map(|line| line.end - line.start);
        let slant = of_line.normalize().dot(&of_axis.normalize());
        let places = line.ends().map(|point| axis.line_parameter(&point));
        let radii = places.map(|place| self.radius_at(place) / slant);
        let offsets = line
            .ends()
            .map(|point| across.tr_mul(&(point - axis.start)));
        let touches = |k: usize| {
            let radius = radii[k].abs();
            (-gap..=gap + MAX_BEYOND * radius).contains(&(offsets[k].norm() - radius))
        };
        let outward = (offsets[0] + offsets[1]).try_normalize(0.0)?;
        let [start, end] = places.map(|place| axis.point_at(place));
        let ruling = end - start + across * outward * (radii[1] - radii[0]);
        let cosine = (line.end - line.start).normalize().dot(&ruling.normalize());
        (touches(0) && touches(1) && cosine >= MIN_COSINE)
            .then(|| Self::around(LineSegment3::new(start, end), across, outward, radii))
    }
}

impl Images<'_> {
    /// The images with the reach within which an edgel is one of what is known.
    pub(super) fn beside_tubes(&self) -> Self {
        Self {
            reach: GAP * self.reach,
            ..*self
        }
    }

    /// Takes the edgels beside the outlines of a tube on one side of it, in all views.
    pub(super) fn claim_outlines(&self, tube: &Tube, taken: &mut [Vec<bool>]) {
        let outline = |view| Some(tube.outline(self, view)?.0);
        claim_edgels_of(&self.beside_tubes(), outline, taken);
    }

    /// Whether most of what speaks for a line, `of_line`, are outlines of a tube.
    pub(super) fn explains_away(&self, tube: &Tube, line: &LineSegment3, of_line: f64) -> bool {
        let most = MOST_LEFT * of_line.max(0.0);
        let mut taken = self.nothing_taken();
        self.claim_outlines(tube, &mut taken);
        self.evidence(line, Some(&taken), most).gain <= most
    }

    /// The lines that are no outlines of some tubes.
    pub(super) fn without_outlines(
        &self,
        lines: Vec<ChosenLine>,
        tubes: &[Tube],
    ) -> Vec<ChosenLine> {
        (lines.into_par_iter())
            .filter(|found| !self.is_outline_of(&found.line, &found.evidence, tubes))
            .collect()
    }

    /// Whether a line is an outline of one of some tubes.
    fn is_outline_of(&self, line: &LineSegment3, evidence: &LineEvidence, tubes: &[Tube]) -> bool {
        let gap = GAP * self.reach * self.pixel_size(line, evidence.views());
        let mut touched = tubes
            .iter()
            .filter_map(|tube| tube.touched_by(line, gap))
            .peekable();
        if touched.peek().is_none() {
            return false;
        }
        // As for tubes that are fitted.
        let of_line = self.evidence(line, None, f64::NEG_INFINITY).gain;
        touched.any(|tube| {
            let in_view = |view| Some(tube.outline(self, view)?.0);
            let found = self.evidence_of(line, in_view, None, of_line, FREE_VIEWS);
            found.gain > of_line + ADVANTAGE
                && shows_as_well(&found, evidence)
                && self.explains_away(&tube, line, of_line)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::outlines::tests::{generator, views_of_cone};
    use crate::assemble::test_views::{TestViews, cube_edge};
    use nalgebra::{Vector2, Vector3};

    /// A tube of the cone, by one of its lines.
    fn tube(radii: [f64; 2], direction: [f64; 2]) -> Tube {
        let line = generator(radii, direction);
        let across = directions_across(&line).unwrap();
        let along = (line.end - line.start).normalize();
        let axis = line.ends().map(|end| {
            let on_axis = Vector3::z() * end.dot(&along) / along.z;
            across.tr_mul(&(on_axis - end))
        });
        Tube {
            axis,
            radius: 0.5 * (radii[0] + radii[1]),
            taper: 0.5 * (radii[1] - radii[0]),
            ..Tube::touching(&line, across, -axis[0])
        }
    }

    #[test]
    fn lines_of_a_known_tube_touch_it_and_others_do_not() {
        let known = tube([0.15, 0.15], [1.0, 0.0]);
        let beside = |radius: f64| known.touched_by(&generator([radius; 2], [0.6, 0.8]), 0.005);
        let found = beside(0.15).unwrap();
        assert!((found.radius - 0.15).abs() < 1e-9 && found.taper.abs() < 1e-9);
        // Where tangent planes meet.
        assert!(beside(0.17).is_some());
        assert!(beside(0.14).is_none() && beside(0.19).is_none());
        let across = LineSegment3::new([0.15, 0.0, -0.1].into(), [0.15, 0.1, 0.0].into());
        assert!(known.touched_by(&across, 0.005).is_none());
        // The lines of a cone are oblique to its axis.
        let radii = [0.1, 0.3];
        let cone = tube(radii, [1.0, 0.0]);
        let found = cone.touched_by(&generator(radii, [0.6, 0.8]), 0.005);
        assert!((found.unwrap().taper - 0.1).abs() < 5e-3);
    }

    #[test]
    fn an_outline_in_few_views_is_told_by_a_known_tube() {
        let radii = [0.15, 0.15];
        let views = views_of_cone(radii);
        let images = views.images();
        let line = generator(radii, [0.0, 1.0]);
        let mut evidence = images.evidence(&line, None, 0.0);
        evidence.showing.truncate(3);
        assert_eq!(evidence.showing.len(), 3);
        let tubes = [tube(radii, [1.0, 0.0])];
        assert!(images.is_outline_of(&line, &evidence, &tubes));
        assert!(!images.is_outline_of(&line, &evidence, &[tube([0.1, 0.1], [1.0, 0.0])]));
        assert!(!images.is_outline_of(&line, &evidence, &[]));
        let of_line = images.evidence(&line, None, 0.0).gain;
        assert!(images.explains_away(&tubes[0], &line, of_line));

        // An edge that touches a tube stays one.
        let cube = TestViews::of_cube(60);
        let images = cube.images();
        let edge = cube_edge(0);
        let evidence = images.evidence(&edge, None, 0.0);
        let across = directions_across(&edge).unwrap();
        let tubes = [0.0_f64, 1.0, 2.0, 3.0]
            .map(|turn| Tube::touching(&edge, across, 0.1 * Vector2::new(turn.cos(), turn.sin())));
        assert!(!images.is_outline_of(&edge, &evidence, &tubes));
        assert!((tubes.iter()).all(|tube| !images.explains_away(tube, &edge, evidence.gain)));
    }
}
