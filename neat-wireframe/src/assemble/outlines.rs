//! Outlines of round things are no edges: each view shows another line of the surface.
//!
//! An edge is a tube of radius zero. A tube that explains the images much better than the line
//! does is the outline of a cylinder or a cone, or of what is nearly one: near its tangent
//! plane the outline stays within the noise, and as the view turns, it moves aside by
//! r (1 − cos).

use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::{change_by_edgels, directions_across};
use super::projected_line::ProjectedLine;
use nalgebra::{Matrix2, Matrix3x2, SVector, Vector2};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Radii that are tried, in pixels, on both sides of a line; the fit finds those between.
pub(super) const RADII: [f64; 8] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0];
/// Thinner tubes are lines, in reaches of edgels; with 3 all objects and parts are as with 2.
pub(super) const MIN_REACHES: f64 = 2.0;
/// Reach of each round of the fit, and how far its views may have turned, in degrees: the
/// first guess is good for little.
pub(super) const ROUNDS: [(f64, f64); 3] = [(2.5, 20.0), (2.5, 45.0), (1.0, 60.0)];
/// Share of the samples that must have an edgel for a view to count in the fit.
pub(super) const FOUND: f64 = 0.6;
/// Fewer edgels determine no tube.
pub(super) const MIN_EDGELS: usize = 20;
/// Three views show a cylinder wherever they want, as two do with a line. Four do so with a
/// cone, which has a parameter more; but with four fewer outlines are told on the parts, and
/// with three no object loses an edge.
pub(super) const FREE_VIEWS: usize = 3;
/// A tube must explain the images so much better than the line, in nats, as it is the best of
/// many tries: with 8 photographs with truth lose edges, with 15 tubes remain.
pub(super) const ADVANTAGE: f64 = 12.0;
/// It must explain this share of the views that show the line: else it is another thing.
const COMMON: f64 = 0.75;
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-4;

/// A cylinder or a cone that touches a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    pub(super) line: LineSegment3,
    pub(super) across: Matrix3x2<f64>,
    /// Out of the surface, where the line touches it.
    pub(super) outward: Vector2<f64>,
    /// Where the axis lies, from the line's start and from its end.
    pub(super) axis: [Vector2<f64>; 2],
    /// At the line's middle …
    pub(super) radius: f64,
    /// … and so much more at its end.
    pub(super) taper: f64,
}

impl Tube {
    pub(super) fn touching(
        line: &LineSegment3,
        across: Matrix3x2<f64>,
        outward: Vector2<f64>,
    ) -> Self {
        Self {
            line: *line,
            across,
            outward: outward.normalize(),
            axis: [-outward; 2],
            radius: outward.norm(),
            taper: 0.0,
        }
    }

    /// One whose line is its axis, with these radii at the ends.
    pub(super) fn around(
        axis: LineSegment3,
        across: Matrix3x2<f64>,
        outward: Vector2<f64>,
        [start, end]: [f64; 2],
    ) -> Self {
        Self {
            line: axis,
            across,
            outward,
            axis: [Vector2::zeros(); 2],
            radius: 0.5 * (start + end),
            taper: 0.5 * (end - start),
        }
    }

    /// At a place along the line, which is 0 at its start and 1 at its end.
    pub(super) fn radius_at(&self, place: f64) -> f64 {
        self.radius + (2.0 * place - 1.0) * self.taper
    }

    /// The line of the surface that is its outline in a view, and the normal there.
    pub(super) fn outline(
        &self,
        images: &Images,
        view: usize,
    ) -> Option<(LineSegment3, Vector2<f64>)> {
        let [start, end] = self.axis;
        let camera = images.views[view].camera.center_in_world;
        // A tangent plane through the camera touches the circle beside it.
        let place = self.line.line_parameter(&camera);
        let center = start + place * (end - start);
        let toward = self.across.tr_mul(&(camera - self.line.start)) - center;
        let cosine = self.radius_at(place) / toward.norm();
        let sine = (1.0 - cosine * cosine).sqrt();
        // Inside there is no outline.
        if !sine.is_normal() {
            return None;
        }
        let toward = toward.normalize();
        let aside = sine * Vector2::new(-toward.y, toward.x);
        let side = aside.dot(&self.outward).signum();
        let normal = cosine * toward + side * aside;
        let at = |axis: Vector2<f64>, place| self.across * (axis + self.radius_at(place) * normal);
        let [start, end] = [at(start, 0.0), at(end, 1.0)];
        let outline = LineSegment3::new(self.line.start + start, self.line.end + end);
        Some((outline, normal))
    }
}

impl Images<'_> {
    /// The tube whose outline explains the images better than a line.
    pub(super) fn tube(&self, line: &LineSegment3, evidence: &LineEvidence) -> Option<Tube> {
        let (across, normal) = self.tangent_normal(line, evidence)?;
        // What others have taken counts for both.
        let of_line = self.evidence(line, None, f64::NEG_INFINITY).gain;
        let pixel = self.pixel_size(line, evidence.views());
        let outwards: Vec<Vector2<f64>> = (RADII.iter())
            .flat_map(|radius| [radius * pixel * normal, -radius * pixel * normal])
            .collect();
        let seen = |tube: &Tube| {
            let in_view = |view| Some(tube.outline(self, view)?.0);
            // The outline of a thinner one stays where a line has its edgels.
            (tube.radius.abs() + tube.taper.abs() >= MIN_REACHES * self.reach * pixel)
                .then(|| self.evidence_of(line, in_view, None, of_line, FREE_VIEWS))
                .filter(|found| found.gain > of_line)
        };
        let explains = |tube: &Tube, found: &LineEvidence| {
            if found.gain <= of_line + ADVANTAGE
                || !shows_as_well(found, evidence)
                || !self.explains_away(tube, line, of_line)
            {
                return false;
            }
            // It may stand for another line.
            let [start, end] = tube.axis.map(|axis| across * axis);
            let axis = LineSegment3::new(line.start + start, line.end + end);
            let axis = self.fit(&axis, found.views(), ROUNDS[0].0 * self.reach);
            found.gain > self.evidence(&axis, None, f64::NEG_INFINITY).gain + ADVANTAGE
        };
        outwards.par_iter().find_map_first(|outward| {
            let tube = Tube::touching(line, across, *outward);
            let cylinder = self.fit_tube(&tube, false, pixel)?;
            if seen(&cylinder).is_some_and(|found| explains(&cylinder, &found)) {
                return Some(cylinder);
            }
            let cone = self.fit_tube(&cylinder, true, pixel)?;
            seen(&cone)
                .is_some_and(|found| explains(&cone, &found))
                .then_some(cone)
        })
    }

    /// The normal of the plane through a line in which the views that show it lie most nearly.
    fn tangent_normal(
        &self,
        line: &LineSegment3,
        evidence: &LineEvidence,
    ) -> Option<(Matrix3x2<f64>, Vector2<f64>)> {
        let across = directions_across(line)?;
        let spread: Matrix2<f64> = (evidence.views())
            .map(|view| {
                let camera = &self.views[view].camera;
                let toward = across.tr_mul(&(camera.center_in_world - line.point_at(0.5)));
                toward * toward.transpose() / toward.norm_squared()
            })
            .sum();
        let eigen = spread.symmetric_eigen();
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        Some((across, normal.into()))
    }

    /// The cylinder through the edgels beside a tube, or the cone if it `tapers`.
    fn fit_tube(&self, tube: &Tube, tapers: bool, pixel: f64) -> Option<Tube> {
        let mut tube = *tube;
        for (reaches, degrees) in ROUNDS {
            let reach = reaches * self.reach;
            let min_cosine = degrees.to_radians().cos();
            let mut rows: Vec<(SVector<f64, 6>, f64)> = (0..self.views.len())
                .flat_map(|view| self.rows_of_tube(&tube, view, reach, min_cosine))
                .collect();
            if !tapers {
                rows.iter_mut().for_each(|(row, _)| row[5] = 0.0);
            }
            let change = change_by_edgels(&rows, MIN_EDGELS, reach, RIDGE, pixel)?.solution;
            tube.axis[0] += change.fixed_rows::<2>(0);
            tube.axis[1] += change.fixed_rows::<2>(2);
            tube.radius += change[4];
            tube.taper += change[5];
        }
        Some(tube)
    }

    /// How the distances of edgels from the outline in a view change with the axis, the radius
    /// and the taper, and what takes them away.
    fn rows_of_tube(
        &self,
        tube: &Tube,
        view: usize,
        reach: f64,
        min_cosine: f64,
    ) -> Vec<(SVector<f64, 6>, f64)> {
        let camera = &self.views[view].camera;
        let prepared = (tube.outline(self, view))
            .filter(|(_, normal)| normal.dot(&tube.outward) > min_cosine)
            .and_then(|(line, normal)| {
                let samples = self.samples(view, &line, [0.0, 1.0], None)?;
                Some((ProjectedLine::new(camera, &line)?, normal, samples))
            });
        let Some((projected, normal, samples)) = prepared else {
            return Vec::new();
        };
        let count = samples.len();
        let mut edgels = Vec::with_capacity(count);
        for (k, sample) in samples.iter().enumerate() {
            edgels.extend(self.edgel(view, sample, reach));
            // Most tubes are none: this is soon known.
            let most = edgels.len() + (count - k - 1);
            if (most as f64) < FOUND * count as f64 {
                return Vec::new();
            }
        }
        let row = |edgel: usize| {
            let position = self.maps[view].get(edgel).position.cast();
            let found = projected.distance_with_gradient(camera, &position);
            let [start, end] = found
                .by_points
                .map(|by_point| tube.across.tr_mul(&by_point));
            let by_radius = (start + end).dot(&normal);
            let by_taper = (end - start).dot(&normal);
            let row = [start.x, start.y, end.x, end.y, by_radius, by_taper];
            (SVector::from(row), -found.distance)
        };
        edgels.into_iter().map(row).collect()
    }
}

/// Whether most views that show a line show what has been `found` instead, too.
pub(super) fn shows_as_well(found: &LineEvidence, line: &LineEvidence) -> bool {
    let common = (line.views())
        .filter(|view| found.views().any(|other| other == *view))
        .count();
    common as f64 >= COMMON * line.showing.len() as f64
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, cube_edge};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;
    use neat_core::Camera;

    const HALF_LENGTH: f64 = 0.4;

    /// A line of the cone around the z axis with these radii at its ends.
    pub(crate) fn generator([start, end]: [f64; 2], [cos, sin]: [f64; 2]) -> LineSegment3 {
        LineSegment3::new(
            Vector3::new(start * cos, start * sin, -HALF_LENGTH),
            Vector3::new(end * cos, end * sin, HALF_LENGTH),
        )
    }

    /// Views of both outlines of that cone.
    pub(crate) fn views_of_cone(radii: [f64; 2]) -> TestViews {
        views_of_cone_with(radii, None)
    }

    /// Likewise, and of an edge on it.
    pub(crate) fn views_of_cone_with(
        [start, end]: [f64; 2],
        edge: Option<LineSegment3>,
    ) -> TestViews {
        let outlines = |camera: &Camera| {
            let center = camera.center_in_world;
            let beside = 0.5 * (1.0 + center.z / HALF_LENGTH);
            let turned = ((start + beside * (end - start)) / center.xy().norm()).acos();
            let toward = center.y.atan2(center.x);
            let outlines = [toward - turned, toward + turned]
                .map(|angle| generator([start, end], [angle.cos(), angle.sin()]));
            let lines = outlines.into_iter().chain(edge);
            let ends: Vec<Vector3<f64>> = lines.flat_map(|line| line.ends()).collect();
            let edges: Vec<[usize; 2]> = (0..ends.len() / 2).map(|k| [2 * k, 2 * k + 1]).collect();
            let seen = views_of_edges(&[*camera], &ends, &edges);
            PreparedView::new(&seen[0], 1.0, 1.0)
        };
        TestViews::of(cameras_on_sphere(60).iter().map(outlines).collect())
    }

    #[test]
    fn outlines_touch_the_surface_where_the_view_does() {
        let views = views_of_cone([0.15; 2]);
        let images = views.images();
        let line = generator([0.15; 2], [1.0, 0.0]);
        let across = Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        let tube = Tube::touching(&line, across, 0.15 * Vector2::x());
        for (view, prepared) in images.views.iter().enumerate() {
            let (line, normal) = tube.outline(&images, view).unwrap();
            let [x, y] = [line.start.x, line.start.y];
            assert!((x.hypot(y) - 0.15).abs() < 1e-12);
            let sight = (prepared.camera.center_in_world - line.start).xy();
            assert!(sight.dot(&normal).abs() < 1e-12);
        }
    }

    #[test]
    fn a_line_of_a_round_surface_is_an_outline_and_an_edge_is_none() {
        // No cylinder explains the cone by 12 nats.
        for radii in [[0.15, 0.15], [0.1, 0.3]] {
            let views = views_of_cone(radii);
            let images = views.images();
            let line = generator(radii, [1.0, 0.0]);
            let evidence = images.evidence(&line, None, 0.0);
            assert!(evidence.showing.len() >= 3, "{}", evidence.showing.len());
            assert!(images.tube(&line, &evidence).is_some(), "{radii:?}");
        }

        let cube = TestViews::of_cube(60);
        let images = cube.images();
        for edge in 0..12 {
            let evidence = images.evidence(&cube_edge(edge), None, 0.0);
            assert!(images.tube(&cube_edge(edge), &evidence).is_none());
        }
        // Nobody shows it: nothing to explain better.
        let nothing = LineEvidence::default();
        assert!(images.tube(&cube_edge(0), &nothing).is_none());
    }
}
