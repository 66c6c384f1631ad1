//! What known arcs explain: chords of their own, and the outlines of the tubes between them and of the
//! domes around their axes. The
//! rims of a cylinder or a cone tell where it is, which few views of an outline do not.

use super::circle_fitting::FoundArc;
use super::corners::WINDOW_IN_PIXELS;
use super::domes::FoundDome;
use super::edge_samples::Images;
use super::known_tubes::GAP;
use super::line_fitting::directions_across;
use super::outlines::Tube;
use nalgebra::{Vector2, Vector3};
use neat_core::{CircularArc, LineSegment3};

/// Axes of two arcs are one within so many pixels, at both arcs, judged: as far as the axis of a
/// short arc is off.
pub(super) const GAP_IN_PIXELS: f64 = 2.0;
/// Arcs that are nearer to each other, in pixels, are one or lie in one plane, judged.
const MIN_LENGTH_IN_PIXELS: f64 = 4.0;
/// A line that is farther from an arc, in pixels, is no chord of it, judged: one that bends more is
/// told by its bow. Nor is it in its plane if an end is farther from that.
const NEAR_IN_PIXELS: f64 = 8.0;

/// Arcs, the tubes between them and the domes around their axes.
pub(super) struct KnownArcs {
    arcs: Vec<FoundArc>,
    tubes: Vec<Tube>,
    domes: Vec<FoundDome>,
}

impl KnownArcs {
    pub(super) fn new(arcs: &[FoundArc], domes: &[FoundDome]) -> Self {
        Self {
            arcs: arcs.to_vec(),
            domes: domes.to_vec(),
            tubes: tubes_between(arcs),
        }
    }

    /// Takes the edgels beside the outlines of the tubes, which no edge goes on along.
    pub(super) fn claim_outlines(&self, images: &Images, taken: &mut [Vec<bool>]) {
        for tube in &self.tubes {
            for outward in [tube.outward, -tube.outward] {
                images.claim_outlines(&Tube { outward, ..*tube }, taken);
            }
        }
    }

    /// Whether a line along arcs, tubes or domes is nothing else: as soon as these have their edgels,
    /// not more than `least` speaks for it.
    pub(super) fn explain(&self, images: &Images, line: &LineSegment3, least: f64) -> bool {
        (self.edgels_beside(images, line))
            .is_some_and(|taken| images.evidence(line, Some(&taken), least).gain <= least)
    }

    /// What of a line is something else; `None` if nothing is. An edge on a cylinder is shown beyond
    /// its end, too, by views whose outline is there.
    pub(super) fn left_of(
        &self,
        images: &Images,
        line: &LineSegment3,
        least: f64,
    ) -> Option<LineSegment3> {
        let Some(taken) = self.edgels_beside(images, line) else {
            return Some(*line);
        };
        let taken = Some(&taken[..]);
        let evidence = images.evidence(line, taken, least);
        if evidence.gain <= least {
            return None;
        }
        let shown = (images.extent(line, &evidence.showing, taken)).unwrap_or(*line);
        let ends = shown.ends().map(|end| line.line_parameter(&end));
        let part = |low: f64, high: f64| LineSegment3::new(line.point_at(low), line.point_at(high));
        let is_none = |low: f64, high: f64| {
            let rest = part(low, high);
            images.projected_length(&rest, evidence.views()) > WINDOW_IN_PIXELS
                && images.evidence(&rest, taken, least).gain <= least
        };
        Some(part(
            if is_none(0.0, ends[0]) { ends[0] } else { 0.0 },
            if is_none(ends[1], 1.0) { ends[1] } else { 1.0 },
        ))
    }

    /// Whether tubes that a line runs along explain it.
    pub(super) fn is_outline(&self, images: &Images, line: &LineSegment3, least: f64) -> bool {
        let touched = self.touched_by(images, line);
        if touched.is_empty() {
            return false;
        }
        let mut taken = images.nothing_taken();
        for tube in &touched {
            images.claim_outlines(tube, &mut taken);
        }
        images.evidence(line, Some(&taken), least).gain <= least
    }

    fn touched_by(&self, images: &Images, line: &LineSegment3) -> Vec<Tube> {
        let gap = GAP * images.reach * images.pixel_size(line, 0..images.views.len());
        let touched = (self.tubes.iter()).filter_map(|tube| tube.touched_by(line, gap));
        touched.collect()
    }

    /// The edgels of what a line runs along; `None` if that is nothing.
    fn edgels_beside(&self, images: &Images, line: &LineSegment3) -> Option<Vec<Vec<bool>>> {
        let touched = self.touched_by(images, line);
        let is_chord = |found: &FoundArc| {
            let near = NEAR_IN_PIXELS * found.pixel;
            let mut points = [0.1, 0.5, 0.9]
                .map(|place| line.point_at(place))
                .into_iter();
            points.all(|point| {
                let angle = found.arc.angle_of(&point);
                found.arc.distance_to_circle(&point) < near
                    && found.arc.contains(angle, near / found.arc.radius)
            })
        };
        // From the side an arc is straight, and so is all else in its plane.
        let is_in_plane = |found: &FoundArc| {
            let beside = |end: &Vector3<f64>| (end - found.arc.center).dot(&found.arc.normal());
            (line.ends().iter()).all(|end| beside(end).abs() < NEAR_IN_PIXELS * found.pixel)
        };
        let along: Vec<&FoundArc> = (self.arcs.iter())
            .filter(|found| is_chord(found) || is_in_plane(found))
            .collect();
        let domes: Vec<&FoundDome> = (self.domes.iter())
            .filter(|found| found.is_touched_by(line))
            .collect();
        if touched.is_empty() && along.is_empty() && domes.is_empty() {
            return None;
        }
        let mut taken = images.nothing_taken();
        for tube in &touched {
            images.claim_outlines(tube, &mut taken);
        }
        for found in domes {
            images.claim_dome(found, &mut taken);
        }
        let beside = images.beside_tubes();
        for found in along {
            beside.claim_arc(found, &mut taken);
        }
        Some(taken)
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
    // How far the axis of an arc passes the other's centre, and a plane across both the arc itself.
    let is_coaxial = |arc: &CircularArc| {
        let off_axis = between.cross(&arc.normal()).norm();
        off_axis * (arc.radius / length).max(1.0) <= GAP_IN_PIXELS * pixel
    };
    if length < MIN_LENGTH_IN_PIXELS * pixel || !(is_coaxial(one) && is_coaxial(other)) {
        return None;
    }
    let axis = LineSegment3::new(one.center, other.center);
    let radii = [one.radius, other.radius];
    Some(Tube::around(
        axis,
        directions_across(&axis)?,
        Vector2::x(),
        radii,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, found, views_of_arcs};
    use crate::assemble::outlines::tests::{generator, views_of_cone, views_of_cone_with};
    use crate::assemble::test_views::{TestViews, cube_edge, end_distance};
    use crate::test_scenes::cameras_on_sphere;
    use std::f64::consts::TAU;

    /// A rim around the z axis.
    fn rim(radius: f64, z: f64, angles: [f64; 2]) -> FoundArc {
        found(CircularArc {
            center: Vector3::new(0.0, 0.0, z),
            axes: [Vector3::x(), Vector3::y()],
            radius,
            angles,
        })
    }

    #[test]
    fn rims_of_one_axis_make_a_tube() {
        let quarter = [0.0, 1.5];
        let low = rim(0.1, -0.2, quarter).arc;
        let tube = |other: &CircularArc| tube_between(&low, other, 0.003);
        let cone = tube(&rim(0.3, 0.2, [2.0, 3.0]).arc).unwrap();
        assert!((cone.radius - 0.2).abs() < 1e-12 && (cone.taper - 0.1).abs() < 1e-12);
        let up = rim(0.1, 0.2, quarter).arc;
        // Another axis, a turned one, and none.
        let moved = up.map(|point| point + Vector3::new(0.01, 0.0, 0.0));
        let turned = CircularArc {
            axes: [Vector3::x(), Vector3::new(0.0, 0.8, 0.6)],
            ..up
        };
        assert!(tube(&up).is_some() && tube(&moved).is_none());
        assert!(tube(&turned).is_none() && tube(&low).is_none());
    }

    #[test]
    fn outlines_between_rims_are_explained_and_edges_are_not() {
        // The last one is a chamfer.
        for radii in [[0.15, 0.15], [0.1, 0.3], [0.02, 0.6]] {
            let views = views_of_cone(radii);
            let images = views.images();
            let line = generator(radii, [0.6, 0.8]);
            assert!(images.evidence(&line, None, 0.0).gain > 3.0);
            let [start, end] = [line.start.z, line.end.z];
            let rims = [
                rim(radii[0], start, [0.0, TAU]),
                rim(radii[1], end, [0.0, TAU]),
            ];
            assert!(KnownArcs::new(&rims, &[]).explain(&images, &line, 3.0));
            assert!(!KnownArcs::new(&rims[..1], &[]).explain(&images, &line, 3.0));
        }
        // The edges of a cube, on the cylinder around it or in the plane of its rims.
        let cube = TestViews::of_cube(60);
        let radius = 0.5_f64.sqrt();
        let known = KnownArcs::new(&[-0.5, 0.5].map(|z| rim(radius, z, [0.0, TAU])), &[]);
        for edge in (0..12).map(cube_edge) {
            assert!(!known.explain(&cube.images(), &edge, 3.0));
        }
    }

    #[test]
    fn an_edge_on_a_cylinder_ends_before_its_outlines_do() {
        let radii = [0.15, 0.15];
        let whole = generator(radii, [0.6, 0.8]);
        let edge = LineSegment3::new(whole.start, whole.point_at(0.75));
        let views = views_of_cone_with(radii, Some(edge));
        let images = views.images();
        let rims = [whole.start.z, whole.end.z].map(|z| rim(0.15, z, [0.0, TAU]));
        let left = |rims: &[FoundArc], line: &LineSegment3| {
            KnownArcs::new(rims, &[]).left_of(&images, line, 3.0)
        };
        let found = left(&rims, &whole).unwrap();
        assert!(end_distance(&found, &edge) < 0.02, "{found:?}");
        assert_eq!(left(&[], &whole), Some(whole));
        assert_eq!(left(&rims, &generator(radii, [-0.6, 0.8])), None);
    }

    #[test]
    fn what_lies_in_the_plane_of_an_arc_is_one_with_it_from_the_side() {
        let circle = rim(0.3, 0.0, [0.0, TAU]);
        let points = circle.arc.points(TAU / 120.0);
        let edges: Vec<[usize; 2]> = (1..points.len()).map(|k| [k - 1, k]).collect();
        let mut cameras = cameras_on_sphere(400);
        cameras.retain(|camera| camera.center_in_world.z.abs() < 0.1);
        let views = TestViews::of_edges(&cameras, &points, &edges);
        let images = views.images();
        // A tangent.
        let line = LineSegment3::new(Vector3::new(0.3, -0.3, 0.0), Vector3::new(0.3, 0.2, 0.0));
        assert!(images.evidence(&line, None, 0.0).gain > 3.0);
        assert!(KnownArcs::new(&[circle], &[]).explain(&images, &line, 3.0));
    }

    #[test]
    fn chords_of_an_arc_are_explained() {
        let views = views_of_arcs(20, |_| arc(1.5));
        let images = views.images();
        let known = KnownArcs::new(&[found(arc(1.5))], &[]);
        let chord = LineSegment3::new(arc(1.5).point_at(0.5), arc(1.5).point_at(0.62));
        assert!(images.evidence(&chord, None, 0.0).gain > 3.0);
        assert!(known.explain(&images, &chord, 3.0));
        assert!(!known.explain(&images, &cube_edge(0), 3.0));
    }
}
