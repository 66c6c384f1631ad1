//! Other rims of a cylinder: an arc once more at another depth along its axis.
//!
//! Few views see the floor of a hole or the end of a round corner, and too little of it to tell where
//! in space it lies. But one rim tells the cylinder, and there edgels that nothing explains say how
//! deep they are. What lies there is followed along the edgels as any arc is.

use super::arc_tubes::KnownArcs;
use super::circle_fitting::{FITTING_REACHES, FoundArc};
use super::curve_samples::SPACING;
use super::curves::{BESIDE_IN_PIXELS, runs_beside};
use super::depth_votes::{DepthVotes, FreeEdgel, free_edgels};
use super::edge_samples::Images;
use super::line_selection::MIN_SHOWING;
use super::view_segments::PreparedView;
use nalgebra::Vector3;
use neat_core::CircularArc;
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

/// What the images have to say for another rim, in nats: some hundreds of cylinders and depths are
/// asked.
const MIN_GAIN: f64 = 8.0;
/// A free circle is preferred to a copy from this advantage on, in nats: it has five numbers more, which
/// some hundreds of edgels tell.
const OF_FREE_CIRCLE: f64 = 14.0;
/// Arcs that rise less over their chord, in pixels, tell no axis, judged: those of lofts and fillets.
const MIN_RISE: f64 = 8.0;
/// Axes that differ by no more than this are one (cosine, about 1.8°).
const SAME_AXIS: f64 = 0.9995;
/// What a view sees of the rim at the end of a hole: half of that which is turned to it.
const VISIBLE: f64 = 0.5;
/// Edgels of a rim lie at most at this angle to it in the image (sine, about 15°): those of short
/// arcs are less sure than those that a line takes.
const MAX_SINE: f64 = 0.25;
/// Edgels so many pixels from the outline of a cylinder may be of that, which all rims touch.
const LIMB_IN_PIXELS: f64 = 2.0;
/// From where a depth is fitted, in pixels beside the one that edgels vote for, a reach apart.
const STARTS: [f64; 7] = [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5];

/// The other rims of the cylinders of `known` arcs, between the depths of `places`, for which edgels
/// speak that are not `taken`.
pub(super) fn coaxial_rims(
    images: &Images,
    known: &[FoundArc],
    places: &[Vector3<f64>],
    mut taken: Vec<Vec<bool>>,
) -> Vec<FoundArc> {
    let free = free_edgels(images, &taken);
    let mut rims: Vec<FoundArc> = Vec::new();
    for rim in cylinders(known) {
        let span = span_of(rim, places);
        let depths = depths(images, rim, span, &free);
        if depths.is_empty() {
            continue;
        }
        let mut of_any = taken.clone();
        claim_outlines(images, rim, span, &mut of_any);
        let mut found: Vec<FoundArc> = (depths.into_iter())
            .filter_map(|depth| copy_near(images, rim, depth, &of_any))
            .filter_map(|copy| followed(images, copy, &of_any))
            .collect();
        found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for rim in found {
            let near = BESIDE_IN_PIXELS * rim.pixel;
            let mut others = known.iter().chain(&rims);
            if !others.any(|other| runs_beside(other, &rim.arc, near)) {
                images.claim_arc(&rim, &mut taken);
                rims.push(rim);
            }
        }
    }
    tracing::debug!(rims = rims.len(), "other rims are found");
    rims
}

/// Of the arcs on one cylinder that which says most, the surest cylinders first.
fn cylinders(known: &[FoundArc]) -> Vec<&FoundArc> {
    let bends = |found: &&FoundArc| {
        let half = 0.5 * found.arc.sweep().min(TAU);
        found.arc.radius * (1.0 - half.cos()) > MIN_RISE * found.pixel
    };
    let mut bent: Vec<&FoundArc> = known.iter().filter(bends).collect();
    bent.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut first: Vec<&FoundArc> = Vec::new();
    for found in bent {
        if !first.iter().any(|other| is_on_cylinder(found, &other.arc)) {
            first.push(found);
        }
    }
    first
}

/// Whether an arc lies on the cylinder of another one, on the side of that.
fn is_on_cylinder(found: &FoundArc, other: &CircularArc) -> bool {
    let (arc, axis) = (&found.arc, other.normal());
    let apart = arc.center - other.center;
    let aside = (apart - apart.dot(&axis) * axis).norm();
    let near = BESIDE_IN_PIXELS * found.pixel;
    let middle = arc.point_at(0.5 * (arc.angles[0] + arc.angles[1]));
    axis.dot(&arc.normal()).abs() > SAME_AXIS
        && aside < near
        && (arc.radius - other.radius).abs() < near
        && other.contains(other.angle_of(&middle), 0.0)
}

/// The least and the largest depth of places along the axis of an arc, in pixels.
fn span_of(rim: &FoundArc, places: &[Vector3<f64>]) -> [f64; 2] {
    let axis = rim.arc.normal();
    let depth = |place: &Vector3<f64>| axis.dot(&(place - rim.arc.center)) / rim.pixel;
    let depths = places.iter().map(depth);
    depths.fold([0.0; 2], |[low, high], d| [low.min(d), high.max(d)])
}

/// The depths along the axis of an arc for which most free edgels of all views speak.
fn depths(images: &Images, rim: &FoundArc, span: [f64; 2], free: &[Vec<FreeEdgel>]) -> Vec<f64> {
    let mut votes = DepthVotes::new(span, 1);
    for (view, free) in images.views.iter().zip(free) {
        let cylinder = Cylinder::new(rim, view);
        for edgel in free {
            for (depth, pixels) in cylinder.places_of(edgel).into_iter().flatten() {
                votes.add(0, depth / rim.pixel, pixels);
            }
        }
        votes.end_view();
    }
    votes.peaks()
}

/// Takes the edgels beside the outlines of the cylinder of an arc.
fn claim_outlines(images: &Images, rim: &FoundArc, span: [f64; 2], taken: &mut [Vec<bool>]) {
    let ends = span.map(|depth| copy_at(rim, depth));
    KnownArcs::new(&ends, &[]).claim_outlines(images, taken);
}

/// An arc so many pixels farther along its axis.
fn copy_at(rim: &FoundArc, depth: f64) -> FoundArc {
    let mut copy = rim.clone();
    copy.arc.center += depth * rim.pixel * rim.arc.normal();
    copy
}

/// The copy of an arc near a depth for which the images say most, at the depth that edgels tell.
fn copy_near(images: &Images, rim: &FoundArc, depth: f64, taken: &[Vec<bool>]) -> Option<FoundArc> {
    let starts = STARTS.iter();
    let settled = starts.filter_map(|start| images.settle_arc(&copy_at(rim, depth + start), taken));
    let best = settled.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    images.settle_arc(&at_fitted_depth(images, best), taken)
}

/// An arc moved along its axis to where the edgels beside it lie.
fn at_fitted_depth(images: &Images, mut found: FoundArc) -> FoundArc {
    let axis = found.arc.normal();
    for reaches in FITTING_REACHES {
        let reach = reaches * images.reach;
        let (mut squares, mut products) = (0.0, 0.0);
        for sector in &found.sectors {
            for view in sector.evidence.views() {
                let samples = images.samples_of_sector(view, &found.arc, sector.angles, SPACING);
                let samples = samples.unwrap_or_default();
                for (row, away) in images.rows_of_samples(&found.arc, view, &samples, reach) {
                    let by_depth = row.fixed_rows::<3>(0).dot(&axis);
                    squares += by_depth * by_depth;
                    products += by_depth * away;
                }
            }
        }
        if squares > 0.0 {
            found.arc.center += products / squares * axis;
        }
    }
    found
}

/// The copy of an arc, or the free circle there if that explains much more; `None` if the images show
/// no arc that lies there.
fn followed(images: &Images, copy: FoundArc, taken: &[Vec<bool>]) -> Option<FoundArc> {
    let sectors = copy.sectors.iter();
    let views: BTreeSet<usize> = sectors.flat_map(|s| s.evidence.views()).collect();
    if copy.gain <= MIN_GAIN || views.len() < MIN_SHOWING {
        return None;
    }
    let views: Vec<usize> = views.into_iter().collect();
    let free = images.follow_arc(&copy.arc, &views)?;
    let free = images.settle_arc(&free, taken)?;
    let near = BESIDE_IN_PIXELS * copy.pixel;
    if free.gain <= MIN_GAIN || !runs_beside(&copy, &free.arc, near) {
        return None;
    }
    let is_better = free.gain > copy.gain + OF_FREE_CIRCLE;
    let found = if is_better { free } else { copy };
    (!images.is_outline(&found.arc, found.pixel)).then_some(found)
}

/// The cylinder of an arc, as a view sees it.
struct Cylinder<'a> {
    view: &'a PreparedView,
    arc: &'a CircularArc,
    axis: Vector3<f64>,
    /// The camera's centre from that of the arc, across the axis.
    across: Vector3<f64>,
    /// How much its square is beyond that of the radius …
    beyond: f64,
    /// … and beyond that of a cylinder within the outlines.
    beyond_inner: f64,
}

impl<'a> Cylinder<'a> {
    fn new(rim: &'a FoundArc, view: &'a PreparedView) -> Self {
        let arc = &rim.arc;
        let axis = arc.normal();
        let from = view.camera.center_in_world - arc.center;
        let across = from - from.dot(&axis) * axis;
        let inner = (arc.radius - LIMB_IN_PIXELS * rim.pixel).max(0.0);
        let beyond = |radius: f64| across.norm_squared() - radius * radius;
        Self {
            view,
            arc,
            axis,
            across,
            beyond: beyond(arc.radius),
            beyond_inner: beyond(inner),
        }
    }

    /// The depths at which an edgel would lie along a rim, on the near and on the far side, and how
    /// many pixels a view sees of that rim.
    fn places_of(&self, edgel: &FreeEdgel) -> [Option<(f64, f64)>; 2] {
        let ray = &edgel.ray;
        let direction = ray - ray.dot(&self.axis) * self.axis;
        let squared = direction.norm_squared();
        let half = self.across.dot(&direction);
        // Nearly all edgels end here.
        if half * half <= squared * self.beyond_inner {
            return [None; 2];
        }
        let root = (half * half - squared * self.beyond).sqrt();
        [-root, root].map(|root| self.place_at((root - half) / squared, edgel))
    }

    fn place_at(&self, distance: f64, edgel: &FreeEdgel) -> Option<(f64, f64)> {
        if !(distance > 0.0 && distance.is_finite()) {
            return None;
        }
        let ray = &edgel.ray;
        let place = self.view.camera.center_in_world + distance * ray;
        let angle = self.arc.angle_of(&place);
        if !self.arc.contains(angle, 0.0) {
            return None;
        }
        let along = self.arc.tangent_at(angle);
        let off = edgel.plane_normal.dot(&along).abs();
        let sine = (along - along.dot(ray) * ray).norm();
        (off <= MAX_SINE * sine).then(|| {
            let seen = VISIBLE * self.arc.radius * self.arc.sweep().min(PI);
            let pixels = seen * sine / self.view.pixel_size_at(&place);
            (self.axis.dot(&(place - self.arc.center)), pixels)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, found, views_of_arcs};

    /// The rims that are found beside a known one where each view shows half of a floor.
    fn rims_beside(floor: CircularArc) -> Vec<FoundArc> {
        let views = views_of_arcs(24, |camera| {
            let far = floor.angle_of(&camera.center_in_world) + PI;
            CircularArc {
                angles: [far - 0.5 * PI, far + 0.5 * PI],
                ..floor
            }
        });
        let (images, rim) = (views.images(), found(arc(TAU)));
        let deep = 0.4 * rim.arc.normal();
        let places = [rim.arc.center - deep, rim.arc.center + deep];
        coaxial_rims(&images, &[rim], &places, images.nothing_taken())
    }

    #[test]
    fn a_rim_tells_where_the_floor_of_its_hole_is() {
        let rim = arc(TAU);
        let floor = CircularArc {
            center: rim.center - 0.15 * rim.normal(),
            ..rim
        };
        let found = rims_beside(floor);
        assert_eq!(found.len(), 1);
        let arc = &found[0].arc;
        assert!((arc.center - floor.center).norm() < 1e-3, "{arc:?}");
        assert!((arc.radius - floor.radius).abs() < 1e-3 && arc.is_closed());
    }

    #[test]
    fn what_lies_beside_the_axis_is_no_rim_of_the_cylinder() {
        let rim = arc(TAU);
        let aside = CircularArc {
            center: rim.center - 0.15 * rim.normal() + 0.05 * rim.axes[0],
            ..rim
        };
        assert!(rims_beside(aside).is_empty());
    }

    #[test]
    fn arcs_that_hardly_bend_tell_no_cylinder_and_two_of_one_are_asked_once() {
        let flat = found(arc(0.3));
        let rim = found(arc(TAU));
        let mut other = found(arc(2.0));
        other.gain = 50.0;
        other.arc.center += 0.2 * rim.arc.normal();
        let mut wider = other.clone();
        wider.arc.radius += 0.1;
        let known = [other, flat, wider, rim.clone()];
        let asked: Vec<f64> = cylinders(&known).iter().map(|c| c.arc.radius).collect();
        assert_eq!(asked.len(), 2);
        assert!((asked[0] - rim.arc.radius).abs() < 1e-12 && asked[1] > 0.39);
    }
}
