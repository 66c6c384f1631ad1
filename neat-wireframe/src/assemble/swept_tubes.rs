//! Outlines of round things that bend are no curves: each view shows another line of the surface.
//!
//! An arc is a tube of radius zero around a circle. A torus that explains the images much better
//! than the arc does is the surface of which the arc is an outline, or nearly that surface. A
//! sphere is one whose circle has no radius.

use super::circle_fitting::{Sector, by_circle, changed};
use super::curve_samples::{SPACING, distance_of_curve};
use super::edge_samples::{Images, Sample};
use super::line_fitting::change_by_edgels;
use super::outlines::{ADVANTAGE, FOUND, MIN_EDGELS, MIN_REACHES, RADII, ROUNDS, shows_as_well};
use nalgebra::{Matrix2, SVector, Vector2, Vector3};
use neat_core::CircularArc;
use rayon::prelude::*;

/// So many parts of an arc are asked, judged: all of it say the same.
const PARTS: usize = 6;
/// Length of a part in pixels, at most.
const PART_IN_PIXELS: f64 = 18.0;
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-4;

/// A torus, or a part of one.
#[derive(Clone, Copy, Debug)]
struct SweptTube {
    /// Its circle, whose radius may be anything.
    circle: CircularArc,
    /// Its own radius.
    radius: f64,
    /// Out of the surface where the arc touches it: away from the circle's centre, and along its
    /// axis.
    outward: Vector2<f64>,
}

impl SweptTube {
    fn touching(arc: &CircularArc, outward: Vector2<f64>) -> Self {
        Self {
            circle: CircularArc {
                center: arc.center - outward.y * arc.normal(),
                radius: arc.radius - outward.x,
                ..*arc
            },
            radius: outward.norm(),
            outward: outward.normalize(),
        }
    }

    fn outward_at(&self, angle: f64) -> Vector3<f64> {
        self.outward.x * self.circle.toward(angle) + self.outward.y * self.circle.normal()
    }

    /// Where a view from `eye` sees the outline at an angle of the circle, and the normal there.
    fn outline(&self, angle: f64, eye: &Vector3<f64>) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let center = self.circle.point_at(angle);
        let tangent = self.circle.tangent_at(angle);
        let toward = eye - center;
        let toward = toward - tangent.dot(&toward) * tangent;
        let cosine = self.radius / toward.norm();
        let sine = (1.0 - cosine * cosine).sqrt();
        // Inside there is no outline.
        if !sine.is_normal() {
            return None;
        }
        let toward = toward.normalize();
        let aside = sine * tangent.cross(&toward);
        let side = aside.dot(&self.outward_at(angle)).signum();
        let normal = cosine * toward + side * aside;
        Some((center + self.radius * normal, normal))
    }
}

impl Images<'_> {
    /// Whether an arc is the outline of something round.
    pub(super) fn is_outline(&self, arc: &CircularArc, pixel: f64) -> bool {
        let parts: Vec<Sector> = (parts_of(arc, pixel).into_par_iter())
            .map(|angles| Sector {
                angles,
                evidence: self.evidence_of_sector(arc, angles, None),
            })
            .collect();
        let of_arc: f64 = parts.iter().map(|part| part.evidence.gain).sum();
        let Some(normal) = self.tangent_normal_of_arc(arc, &parts) else {
            return false;
        };
        let outwards: Vec<Vector2<f64>> = (RADII.iter())
            .flat_map(|radius| [radius * pixel * normal, -radius * pixel * normal])
            .collect();
        outwards.par_iter().any(|outward| {
            let start = SweptTube::touching(arc, *outward);
            self.fit_swept_tube(&start, arc.radius, &parts, pixel)
                .filter(|tube| tube.radius >= MIN_REACHES * self.reach * pixel)
                .is_some_and(|tube| self.explains_better(&tube, arc, &parts, of_arc))
        })
    }

    fn explains_better(
        &self,
        tube: &SweptTube,
        arc: &CircularArc,
        parts: &[Sector],
        of_arc: f64,
    ) -> bool {
        let (mut gain, mut as_well) = (0.0, 0);
        for part in parts {
            let outline = |view: usize, angle| {
                let eye = &self.views[view].camera.center_in_world;
                Some(tube.outline(angle, eye)?.0)
            };
            let found = self.evidence_of_curve(arc, part.angles, outline, None);
            gain += found.gain;
            as_well += usize::from(shows_as_well(&found, &part.evidence));
        }
        gain > of_arc + ADVANTAGE * parts.len() as f64 && 2 * as_well > parts.len()
    }

    /// The direction, away from the circle's centre and along its axis, to which the sight of
    /// the views that show an arc is most nearly perpendicular.
    fn tangent_normal_of_arc(&self, arc: &CircularArc, parts: &[Sector]) -> Option<Vector2<f64>> {
        let mut spread = Matrix2::zeros();
        for part in parts {
            let angle = 0.5 * (part.angles[0] + part.angles[1]);
            for view in part.evidence.views() {
                let sight = self.views[view].camera.center_in_world - arc.point_at(angle);
                let sight = Vector2::new(sight.dot(&arc.toward(angle)), sight.dot(&arc.normal()));
                let sight = sight.try_normalize(0.0)?;
                spread += sight * sight.transpose();
            }
        }
        let eigen = spread.symmetric_eigen();
        Some(eigen.eigenvectors.column(eigen.eigenvalues.imin()).into())
    }

    /// The torus through the edgels beside the outlines of another one. `scale` is the arc's
    /// radius.
    fn fit_swept_tube(
        &self,
        start: &SweptTube,
        scale: f64,
        parts: &[Sector],
        pixel: f64,
    ) -> Option<SweptTube> {
        let mut tube = *start;
        for (reaches, degrees) in ROUNDS {
            let reach = reaches * self.reach;
            let min_cosine = degrees.to_radians().cos();
            let rows: Vec<(SVector<f64, 7>, f64)> = (parts.iter())
                .flat_map(|part| (0..self.views.len()).map(move |view| (part, view)))
                .flat_map(|(part, view)| {
                    self.rows_of_swept_tube(&tube, view, part.angles, (reach, min_cosine), scale)
                })
                .collect();
            let change = change_by_edgels(&rows, MIN_EDGELS, reach, RIDGE, pixel)?.solution;
            tube.circle = changed(&tube.circle, &change.as_slice()[..6], scale);
            tube.radius += change[6];
        }
        Some(tube)
    }

    /// How the distances of edgels from the outline in a view change with the circle's centre and
    /// radius, its turns around both axes (times `scale`) and the tube's radius, and what takes
    /// them away.
    fn rows_of_swept_tube(
        &self,
        tube: &SweptTube,
        view: usize,
        angles: [f64; 2],
        (reach, min_cosine): (f64, f64),
        scale: f64,
    ) -> Vec<(SVector<f64, 7>, f64)> {
        let camera = &self.views[view].camera;
        let outline = |angle: f64| tube.outline(angle, &camera.center_in_world);
        let middle = 0.5 * (angles[0] + angles[1]);
        let in_sight = outline(middle)
            .is_some_and(|(_, normal)| normal.dot(&tube.outward_at(middle)) >= min_cosine);
        if !in_sight {
            return Vec::new();
        }
        let at = |angle: f64| Some(outline(angle)?.0);
        let Some(samples) = self.samples_of_curve(view, angles, SPACING, at) else {
            return Vec::new();
        };
        let row = |sample: &Sample| {
            let edgel = self.edgel(view, sample, reach)?;
            let position = self.maps[view].get(edgel).position.cast();
            let angle = sample.place;
            let (point, normal) = outline(angle)?;
            let tangent = scale * tube.circle.tangent_at(angle);
            let (distance, by_point) = distance_of_curve(camera, &point, &tangent, &position)?;
            let arm = (point - tube.circle.center) / scale;
            let row = by_circle(&tube.circle, angle, &arm, &by_point);
            Some((row.push(by_point.dot(&normal)), -distance))
        };
        let rows: Vec<_> = samples.iter().filter_map(row).collect();
        if (rows.len() as f64) < FOUND * samples.len() as f64 {
            return Vec::new();
        }
        rows
    }
}

/// Parts that stand for an arc.
fn parts_of(arc: &CircularArc, pixel: f64) -> Vec<[f64; 2]> {
    let width = (PART_IN_PIXELS * pixel / arc.radius).min(arc.sweep() / PARTS as f64);
    (0..PARTS)
        .map(|part| {
            let middle = arc.angles[0] + arc.sweep() * (part as f64 + 0.5) / PARTS as f64;
            [middle - 0.5 * width, middle + 0.5 * width]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, views_of_arcs};
    use neat_core::Camera;
    use std::f64::consts::TAU;

    const RADIUS: f64 = 0.3;

    /// What a view sees of a sphere around the origin.
    fn outline_of_sphere(camera: &Camera) -> CircularArc {
        let eye = camera.center_in_world;
        let toward = eye.normalize();
        let sine = RADIUS / eye.norm();
        let radius = RADIUS * (1.0 - sine * sine).sqrt();
        CircularArc::around(RADIUS * sine * toward, &toward, radius)
    }

    #[test]
    fn a_line_of_a_sphere_is_an_outline_and_a_rim_is_none() {
        let sphere = views_of_arcs(60, outline_of_sphere);
        let images = sphere.images();
        let pixel = images.views[0].pixel_size_at(&Vector3::zeros());
        let seen = outline_of_sphere(&images.views[0].camera);
        let part = CircularArc {
            angles: [0.0, 1.5],
            ..seen
        };
        assert!(images.is_outline(&part, pixel));
        let rim = views_of_arcs(60, |_| arc(TAU));
        assert!(!rim.images().is_outline(&arc(1.5), pixel));
    }
}
