//! Outlines of round things are no edges: each view shows another line of the surface.
//!
//! An edge is a tube of radius zero. A tube that explains the images much better than the line
//! does is the outline of a cylinder, or of what is nearly one: near its tangent plane the
//! outline stays within the noise, and as the view turns, it moves aside by r (1 − cos).

use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::{change_by_edgels, directions_across};
use super::projected_line::ProjectedLine;
use nalgebra::{Matrix2, Matrix3x2, SVector, Vector2};
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Radii that are tried, in pixels, on both sides of a line; the fit finds those between.
const RADII: [f64; 8] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0];
/// Thinner tubes are lines, in reaches of edgels; with 3 all objects and parts are as with 2.
const MIN_REACHES: f64 = 2.0;
/// Reach of each round of the fit, and how far its views may have turned, in degrees: the
/// first guess is good for little.
const ROUNDS: [(f64, f64); 3] = [(2.5, 20.0), (2.5, 45.0), (1.0, 60.0)];
/// Share of the samples that must have an edgel for a view to count in the fit.
const FOUND: f64 = 0.6;
/// Fewer edgels determine no tube.
const MIN_EDGELS: usize = 20;
/// Three views show a tube wherever they want, as two do with a line.
const FREE_VIEWS: usize = 3;
/// A tube must explain the images so much better than the line, in nats, as it is the best of
/// many tries: with 8 photographs with truth lose edges, with 15 tubes remain.
const ADVANTAGE: f64 = 12.0;
/// It must explain this share of the views that show the line: else it is another thing.
const COMMON: f64 = 0.75;
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-4;

/// A cylinder that touches a line.
#[derive(Clone, Copy, Debug)]
struct Tube {
    line: LineSegment3,
    across: Matrix3x2<f64>,
    /// Out of the surface, where the line touches it.
    outward: Vector2<f64>,
    /// Where the axis lies, from the line's start and from its end.
    axis: [Vector2<f64>; 2],
    radius: f64,
}

impl Tube {
    fn touching(line: &LineSegment3, across: Matrix3x2<f64>, outward: Vector2<f64>) -> Self {
        Self {
            line: *line,
            across,
            outward: outward.normalize(),
            axis: [-outward; 2],
            radius: outward.norm(),
        }
    }

    /// The line of the surface that is its outline in a view, and the normal there.
    fn outline(&self, images: &Images, view: usize) -> Option<(LineSegment3, Vector2<f64>)> {
        let [start, end] = self.axis;
        let camera = images.views[view].camera.center_in_world - self.line.point_at(0.5);
        let toward = self.across.tr_mul(&camera) - 0.5 * (start + end);
        let cosine = self.radius / toward.norm();
        let sine = (1.0 - cosine * cosine).sqrt();
        // Inside there is no outline.
        if !sine.is_normal() {
            return None;
        }
        let toward = toward.normalize();
        let aside = sine * Vector2::new(-toward.y, toward.x);
        let side = aside.dot(&self.outward).signum();
        let normal = cosine * toward + side * aside;
        let at = |axis: Vector2<f64>| self.across * (axis + self.radius * normal);
        let outline = LineSegment3::new(self.line.start + at(start), self.line.end + at(end));
        Some((outline, normal))
    }
}

impl Images<'_> {
    /// Whether the outline of a tube explains the images better than a line.
    pub(super) fn is_outline(&self, line: &LineSegment3, evidence: &LineEvidence) -> bool {
        let Some((across, normal)) = self.tangent_normal(line, evidence) else {
            return false;
        };
        // What others have taken counts for both.
        let of_line = self.evidence(line, None, f64::NEG_INFINITY).gain;
        let pixel = self.pixel_size(line, evidence.views());
        let shown = evidence.showing.len() as f64;
        let outwards: Vec<Vector2<f64>> = (RADII.iter())
            .flat_map(|radius| [radius * pixel * normal, -radius * pixel * normal])
            .collect();
        outwards.par_iter().any(|outward| {
            let tube = Tube::touching(line, across, *outward);
            let Some(tube) = self.fit_tube(&tube, pixel) else {
                return false;
            };
            // The outline of a thinner one stays where a line has its edgels.
            if tube.radius.abs() < MIN_REACHES * self.reach * pixel {
                return false;
            }
            let least = of_line + ADVANTAGE;
            let in_view = |view| Some(tube.outline(self, view)?.0);
            let found = self.evidence_of(line, in_view, None, least, FREE_VIEWS);
            let common = (evidence.views())
                .filter(|view| found.views().any(|other| other == *view))
                .count();
            if found.gain <= least || (common as f64) < COMMON * shown {
                return false;
            }
            // It may stand for another line.
            let [start, end] = tube.axis.map(|axis| across * axis);
            let axis = LineSegment3::new(line.start + start, line.end + end);
            let axis = self.fit(&axis, found.views(), ROUNDS[0].0 * self.reach);
            found.gain > self.evidence(&axis, None, f64::NEG_INFINITY).gain + ADVANTAGE
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

    fn fit_tube(&self, tube: &Tube, pixel: f64) -> Option<Tube> {
        let mut tube = *tube;
        for (reaches, degrees) in ROUNDS {
            let reach = reaches * self.reach;
            let min_cosine = degrees.to_radians().cos();
            let rows: Vec<(SVector<f64, 5>, f64)> = (0..self.views.len())
                .flat_map(|view| self.rows_of_tube(&tube, view, reach, min_cosine))
                .collect();
            let change = change_by_edgels(&rows, MIN_EDGELS, reach, RIDGE, pixel)?.solution;
            tube.axis[0] += change.fixed_rows::<2>(0);
            tube.axis[1] += change.fixed_rows::<2>(2);
            tube.radius += change[4];
        }
        Some(tube)
    }

    /// How the distances of edgels from the outline in a view change with the axis and the
    /// radius, and what takes them away.
    fn rows_of_tube(
        &self,
        tube: &Tube,
        view: usize,
        reach: f64,
        min_cosine: f64,
    ) -> Vec<(SVector<f64, 5>, f64)> {
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
        let count = samples.points.len();
        let mut edgels = Vec::with_capacity(count);
        for (k, (_, pixel)) in samples.points.iter().enumerate() {
            edgels.extend(self.edgel(view, pixel, &samples.normal, reach));
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
            let row = [start.x, start.y, end.x, end.y, by_radius];
            (SVector::from(row), -found.distance)
        };
        edgels.into_iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, cube_edge};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;

    /// The cylinder around the z axis.
    fn cylinder(radius: f64) -> Tube {
        let line = LineSegment3::new(
            Vector3::new(radius, 0.0, -0.4),
            Vector3::new(radius, 0.0, 0.4),
        );
        let across = Matrix3x2::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        Tube::touching(&line, across, radius * Vector2::x())
    }

    /// Views of both outlines of a cylinder.
    fn views_of_cylinder(radius: f64) -> Vec<PreparedView> {
        let cameras = cameras_on_sphere(120);
        let blank: Vec<PreparedView> = views_of_edges(&cameras, &[], &[])
            .iter()
            .map(|observation| PreparedView::new(observation, 1.0, 1.0))
            .collect();
        let images = Images {
            views: &blank,
            maps: &[],
            reach: 0.5,
        };
        (cameras.iter().enumerate())
            .map(|(view, camera)| {
                let beside = Vector2::new(-camera.center_in_world.y, camera.center_in_world.x);
                let outlines = [beside, -beside].map(|outward| {
                    let tube = Tube {
                        outward,
                        ..cylinder(radius)
                    };
                    tube.outline(&images, view).unwrap().0
                });
                let ends: Vec<Vector3<f64>> = outlines.iter().flat_map(|o| o.ends()).collect();
                let seen = views_of_edges(&[*camera], &ends, &[[0, 1], [2, 3]]);
                PreparedView::new(&seen[0], 1.0, 1.0)
            })
            .collect()
    }

    #[test]
    fn outlines_touch_the_surface_where_the_view_does() {
        let views = views_of_cylinder(0.15);
        let images = Images {
            views: &views,
            maps: &[],
            reach: 0.5,
        };
        for (view, prepared) in views.iter().enumerate() {
            let (line, normal) = cylinder(0.15).outline(&images, view).unwrap();
            let [x, y] = [line.start.x, line.start.y];
            assert!((x.hypot(y) - 0.15).abs() < 1e-12);
            let sight = (prepared.camera.center_in_world - line.start).xy();
            assert!(sight.dot(&normal).abs() < 1e-12);
        }
    }

    #[test]
    fn a_line_of_a_round_surface_is_an_outline_and_an_edge_is_none() {
        let views = views_of_cylinder(0.15);
        let views = TestViews::of(views);
        let images = views.images();
        let line = cylinder(0.15).line;
        let evidence = images.evidence(&line, None, 0.0);
        assert!(evidence.showing.len() >= 3, "{}", evidence.showing.len());
        assert!(images.is_outline(&line, &evidence));

        let cube = TestViews::of_cube(60);
        let images = cube.images();
        for edge in 0..12 {
            let evidence = images.evidence(&cube_edge(edge), None, 0.0);
            assert!(!images.is_outline(&cube_edge(edge), &evidence));
        }
        // Nobody shows it: nothing to explain better.
        let nothing = LineEvidence::default();
        assert!(!images.is_outline(&cube_edge(0), &nothing));
    }
}
