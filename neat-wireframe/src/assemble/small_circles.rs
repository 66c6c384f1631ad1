//! Circles as a whole, by the ellipses that images show.
//!
//! Pieces of a hole of ten pixels are too short to tell their directions in space. But its ellipses tell
//! more than edges do: where rays through their centres meet is the centre of the circle, their longer
//! axes tell its radius, and each says its normal but for a sign, on which the others agree. What lies
//! there is followed along the edgels as any arc is.

use super::arc_joints::OF_WHOLE;
use super::circle_fitting::FoundArc;
use super::curves::{BESIDE_IN_PIXELS, runs_beside};
use super::edge_samples::Images;
use super::ellipses::{Ellipse, ellipses};
use super::line_selection::MIN_SHOWING;
use crate::statistics::upper_median;
use nalgebra::Vector3;
use neat_core::{CircularArc, Ray};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::f64::consts::TAU;

/// The centre of a circle lies so far from that of its ellipse at most, in pixels, besides what
/// perspective moves it, judged.
const CENTER_IN_PIXELS: f64 = 1.5;
/// Radii by longer axes differ by this factor at most: a chain that goes over to the other rim of a
/// hole makes a smaller ellipse. Judged, on holes of ten pixels.
const SAME_RADIUS: f64 = 1.15;
/// Rays under a smaller angle than this (sine), about 5°, tell no depth.
const MIN_SINE: f64 = 0.09;
/// A circle's picture lies so far from its ellipses at most, in pixels, judged: the edgels, which are
/// followed from there, decide.
const MAX_APART: f64 = 4.0;
/// Radii that are tried, by the one that ellipses tell, for those that are too small.
const LARGER: [f64; 3] = [1.0, 1.08, 1.16];
/// Points around a circle that are compared.
const POINTS: usize = 12;
/// Following the edgels moves a circle by this share of its radius at most, or it is another one.
const MAX_MOVE: f64 = 0.3;
/// So many ellipses of a view are asked, the largest: a bound for sieves.
const MOST_OF_VIEW: usize = 200;

/// An ellipse in a view.
struct Seen {
    view: usize,
    ellipse: Ellipse,
    ray: Ray,
}

/// A circle, and ellipses that may be its pictures, at most one of each view.
struct Agreement {
    circle: CircularArc,
    members: Vec<usize>,
    /// How far the circle's pictures lie from them, in pixels: the median.
    apart: f64,
}

/// The circles that images show most of, found between `neighbours` of each view; the ones that speak
/// for themselves most come first.
pub(super) fn small_circles(
    images: &Images,
    neighbours: &[Vec<usize>],
    least: f64,
) -> Vec<FoundArc> {
    let all = Ellipses::of(images);
    let mut agreements: Vec<Agreement> = (0..all.seen.len())
        .into_par_iter()
        .filter_map(|first| all.agreement(first, neighbours))
        .collect();
    agreements.sort_by(|a, b| a.apart.total_cmp(&b.apart));
    let mut free = vec![true; all.seen.len()];
    let mut circles: Vec<FoundArc> = Vec::new();
    for mut agreement in agreements {
        agreement.members.retain(|member| free[*member]);
        if agreement.members.len() < MIN_SHOWING {
            continue;
        }
        let Some(found) = all.followed(&agreement, least) else {
            continue;
        };
        for member in agreement.members {
            free[member] = false;
        }
        let near = BESIDE_IN_PIXELS * found.pixel;
        let mut others = circles.iter();
        if !others.any(|other| runs_beside(other, &found.arc, near)) {
            circles.push(found);
        }
    }
    let ellipses = all.seen.len();
    tracing::debug!(ellipses, circles = circles.len(), "circles are found");
    circles.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    circles
}

/// The ellipses of all views.
struct Ellipses<'a> {
    images: &'a Images<'a>,
    /// View by view, by the first coordinate of their centres.
    seen: Vec<Seen>,
    /// Where those of each view begin, and where all end.
    starts: Vec<usize>,
}

impl<'a> Ellipses<'a> {
    fn of(images: &'a Images<'a>) -> Self {
        let of_view = |view: usize| -> Vec<Seen> {
            let camera = &images.views[view].camera;
            if camera.validate().is_err() {
                return Vec::new();
            }
            let mut found = ellipses(&images.maps[view]);
            found.sort_by(|a, b| b.axes[0].total_cmp(&a.axes[0]));
            found.truncate(MOST_OF_VIEW);
            found.sort_by(|a, b| a.center.x.total_cmp(&b.center.x));
            let seen = |ellipse: Ellipse| Seen {
                view,
                ellipse,
                ray: camera.ray_through(&ellipse.center),
            };
            found.into_iter().map(seen).collect()
        };
        let of_views: Vec<Vec<Seen>> = (0..images.views.len())
            .into_par_iter()
            .map(of_view)
            .collect();
        let mut starts = vec![0];
        for of_view in &of_views {
            starts.push(starts[starts.len() - 1] + of_view.len());
        }
        Self {
            images,
            seen: of_views.into_iter().flatten().collect(),
            starts,
        }
    }

    /// The circle that most others agree on with an ellipse and one of a neighbouring view.
    fn agreement(&self, first: usize, neighbours: &[Vec<usize>]) -> Option<Agreement> {
        let one = &self.seen[first];
        let beside = neighbours[one.view].iter();
        let others = beside.flat_map(|view| &self.seen[self.starts[*view]..self.starts[view + 1]]);
        let spheres = others.filter_map(|other| {
            let center = meeting(&one.ray, &other.ray)?;
            let [a, b] = [one, other].map(|of| self.radius_at(of, &center));
            let radius = (a * b).sqrt();
            let fits = |of: &Seen| self.may_show(of, &center, radius);
            (fits(one) && fits(other)).then(|| (center, radius, self.members(&center, radius)))
        });
        let by_count = |(.., members): &(_, _, Vec<usize>)| Reverse(members.len());
        let (center, radius, members) = spheres.min_by_key(by_count)?;
        if members.len() < MIN_SHOWING {
            return None;
        }
        let normals = members.iter().flat_map(|k| self.normals(&self.seen[*k]));
        let tried = normals.map(|normal| {
            let circle = CircularArc::around(center, &normal, radius);
            (self.apart(&members, &circle), circle)
        });
        let (apart, circle) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (apart <= MAX_APART).then_some(Agreement {
            circle,
            members,
            apart,
        })
    }

    /// The first ellipse of each view that may be the picture of a circle there.
    fn members(&self, center: &Vector3<f64>, radius: f64) -> Vec<usize> {
        let of_view = |view: usize| {
            let [start, end] = [self.starts[view], self.starts[view + 1]];
            let prepared = &self.images.views[view];
            let pixel = prepared.camera.project(center).pixel;
            let most = SAME_RADIUS * radius / prepared.pixel_size_at(center);
            let reach = self.center_reach(view, most);
            let of_view = &self.seen[start..end];
            let first = of_view.partition_point(|of| of.ellipse.center.x < pixel.x - reach);
            let near = (of_view[first..].iter().enumerate())
                .take_while(|(_, of)| of.ellipse.center.x <= pixel.x + reach);
            near.map(|(k, of)| (start + first + k, of))
                .find(|(_, of)| self.may_show(of, center, radius))
                .map(|(k, _)| k)
        };
        (0..self.images.views.len()).filter_map(of_view).collect()
    }

    /// Whether an ellipse may be the picture of a circle there.
    fn may_show(&self, of: &Seen, center: &Vector3<f64>, radius: f64) -> bool {
        let camera = &self.images.views[of.view].camera;
        let factor = self.radius_at(of, center) / radius;
        let at = camera.project(center);
        let reach = self.center_reach(of.view, of.ellipse.axes[0]);
        at.depth > 0.0
            && (at.pixel - of.ellipse.center).norm() <= reach
            && factor.max(factor.recip()) <= SAME_RADIUS
    }

    /// How far the picture of a circle's centre may lie from that of its ellipse, which is so long.
    fn center_reach(&self, view: usize, half_length: f64) -> f64 {
        CENTER_IN_PIXELS + half_length * half_length / self.images.views[view].focal_in_pixels
    }

    fn radius_at(&self, of: &Seen, center: &Vector3<f64>) -> f64 {
        of.ellipse.axes[0] * self.images.views[of.view].pixel_size_at(center)
    }

    /// The two normals of circles with this picture, as if it were seen from afar.
    fn normals(&self, of: &Seen) -> [Vector3<f64>; 2] {
        let ellipse = &of.ellipse;
        let toward = of.ray.direction;
        let camera = &self.images.views[of.view].camera;
        let beside = camera.ray_through(&(ellipse.center + ellipse.across));
        let across = (beside.direction - beside.direction.dot(&toward) * toward).normalize();
        let cosine = (ellipse.axes[1] / ellipse.axes[0]).min(1.0);
        let sine = (1.0 - cosine * cosine).sqrt();
        [-sine, sine].map(|sine| sine * across - cosine * toward)
    }

    /// How far the pictures of a circle lie from ellipses, in pixels: the median.
    fn apart(&self, members: &[usize], circle: &CircularArc) -> f64 {
        let of_view = |k: &usize| {
            let Seen { view, ellipse, .. } = &self.seen[*k];
            let camera = &self.images.views[*view].camera;
            let angles = (0..POINTS).map(|k| TAU * k as f64 / POINTS as f64);
            let distance = |angle| ellipse.distance(&camera.project(&circle.point_at(angle)).pixel);
            angles.map(distance).fold(0.0, f64::max)
        };
        upper_median(&mut members.iter().map(of_view).collect::<Vec<f64>>())
    }

    /// The circle of some ellipses, if the edgels show all of it: parts of one are left to their pieces.
    fn followed(&self, of: &Agreement, least: f64) -> Option<FoundArc> {
        let views: Vec<usize> = of.members.iter().map(|k| self.seen[*k].view).collect();
        let start = |factor: f64| CircularArc {
            radius: factor * of.circle.radius,
            ..of.circle
        };
        let followed: Vec<FoundArc> = (LARGER.into_par_iter())
            .filter_map(|factor| self.images.follow_arc(&start(factor), &views))
            .collect();
        let found = (followed.into_iter()).max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        let by_center = (found.arc.center - of.circle.center).norm();
        let moved = by_center.max((found.arc.radius - of.circle.radius).abs());
        let gains = found.sectors.iter().map(|sector| sector.evidence.gain);
        let weakest = OF_WHOLE * gains.clone().fold(0.0, f64::max);
        let is_whole = found.arc.is_closed() && gains.min_by(f64::total_cmp) >= Some(weakest);
        let is_it = is_whole && moved <= MAX_MOVE * of.circle.radius;
        let is_outline = || self.images.is_outline(&found.arc, found.pixel);
        (is_it && found.gain > least && !is_outline()).then_some(found)
    }
}

/// Where two rays meet that tell a depth.
fn meeting(one: &Ray, other: &Ray) -> Option<Vector3<f64>> {
    let sine = one.direction.cross(&other.direction).norm();
    (sine >= MIN_SINE).then(|| one.meeting(other))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::views_of_arcs;
    use neat_core::Camera;

    /// A circle of this radius around a point.
    fn circle(radius: f64, normal: Vector3<f64>) -> CircularArc {
        CircularArc::around(Vector3::new(0.1, -0.2, 0.15), &normal.normalize(), radius)
    }

    /// What is found of what views show.
    fn found(shown: impl Fn(&Camera) -> CircularArc) -> Vec<FoundArc> {
        let views = views_of_arcs(20, shown);
        let all: Vec<Vec<usize>> = (0..20)
            .map(|view| (0..20).filter(|other| *other != view).collect())
            .collect();
        small_circles(&views.images(), &all, 3.0)
    }

    #[test]
    fn a_small_hole_is_found_as_a_whole() {
        for radius in [0.03, 0.1] {
            let truth = circle(radius, Vector3::new(0.2, 0.3, 1.0));
            let circles = found(|_| truth);
            assert_eq!(circles.len(), 1);
            let arc = circles[0].arc;
            assert!((arc.center - truth.center).norm() < 0.01 * radius);
            assert!((arc.radius / radius - 1.0).abs() < 0.01);
            assert!(arc.normal().cross(&truth.normal()).norm() < 0.02);
            assert!(arc.sweep() > 0.9 * TAU);
        }
    }

    #[test]
    fn the_outline_of_a_ball_is_none() {
        let outline = |camera: &Camera| {
            let normal = camera.center_in_world - Vector3::new(0.1, -0.2, 0.15);
            circle(0.1, normal)
        };
        assert!(found(outline).is_empty());
    }

    #[test]
    fn rays_meet_in_front_of_both_cameras_alone() {
        let ray = |origin: [f64; 3], direction: [f64; 3]| Ray {
            origin: origin.into(),
            direction: Vector3::from(direction).normalize(),
        };
        let one = ray([0.0; 3], [1.0, 0.0, 0.0]);
        let met = meeting(&one, &ray([2.0, -1.0, 0.1], [0.0, 1.0, 0.0])).unwrap();
        assert!((met - Vector3::new(2.0, 0.0, 0.05)).norm() < 1e-12);
        assert!(meeting(&one, &ray([-2.0, -1.0, 0.1], [0.0, 1.0, 0.0])).is_none());
        assert!(meeting(&one, &ray([2.0, -1.0, 0.1], [1.0, 0.01, 0.0])).is_none());
    }
}
