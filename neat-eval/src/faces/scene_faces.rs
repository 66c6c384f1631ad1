//! How much of the found faces is surface, and how much of the planar surface is found.
//!
//! Source: ours, for rendered scenes with their exact mesh. Points are spread evenly over the found
//! faces, and over the planar parts of the mesh that at least three views see, as far as the true
//! creases reach: the ground goes on for ever. A point is right
//! if a triangle of the other side is at most a threshold away whose normal agrees to 10°: what
//! passes through a wall at right angles is none of its faces.

use super::area_samples::{AreaSample, area_samples};
use super::found_face::{FoundFace, triangles_of};
use super::planar_patches::{PlanarPatch, planar_patches};
use crate::error::EvalError;
use crate::surface_and_creases::SceneTruth;
use crate::table::Table;
use crate::total::total;
use crate::triangle::{Triangle, area, normal};
use crate::triangle_mesh::Surface;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// More points than these are those of another scene or scale.
const MOST_SAMPLES: f64 = 2e7;

/// The constants. Lengths are in metres of a house: times the scale of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFaces {
    /// Distances at which shares are taken.
    pub thresholds: Vec<f64>,
    /// How far normals may be turned against each other, in degrees.
    pub max_angle: f64,
    /// Each point on either side stands for a square of this side.
    pub spacing: f64,
    /// Planar parts of the mesh count from this area on: none of leaves, most of a wall.
    pub min_patch: f64,
    /// The triangles of a planar part lie so near to the plane of the largest.
    pub thickness: f64,
    /// Points of the mesh count that so many views see; all where there are no cameras.
    pub min_views: usize,
}

impl Default for SceneFaces {
    fn default() -> Self {
        Self {
            thresholds: vec![0.01, 0.02, 0.05],
            max_angle: 10.0,
            spacing: 0.1,
            min_patch: 0.1,
            thickness: 0.001,
            min_views: 3,
        }
    }
}

/// Areas in squared units of the truth, and shares of them from 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneFaceScores {
    /// What thresholds were multiplied by.
    pub scale: f64,
    /// Found faces.
    pub faces: usize,
    /// Their area.
    pub found_area: f64,
    /// The area of planar parts of the mesh that is seen.
    pub planar_area: f64,
    /// One entry per threshold.
    pub thresholds: Vec<FaceShares>,
}

/// Shares at one threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaceShares {
    /// Distances count that are as long or shorter.
    pub threshold: f64,
    /// Of the found area, what lies along the mesh; `None` without any.
    pub precision: Option<f64>,
    /// Of the planar area that is seen, what lies along a found face; `None` without any.
    pub recall: Option<f64>,
}

impl SceneFaces {
    /// Measures the faces of a result, which are in the frame of the truth.
    ///
    /// # Errors
    /// If the mesh has no triangles or one that names no vertex, or either side is not finite or
    /// too large to be of this scene.
    pub fn evaluate(
        &self,
        found: &[FoundFace],
        truth: &SceneTruth,
    ) -> Result<SceneFaceScores, EvalError> {
        let found_triangles = triangles_of(found);
        self.check(&found_triangles, truth)?;
        let scale = truth.scale;
        let mesh = truth.surface.corners();
        let surface = Surface::of_triangles(mesh.clone());
        let patches = self.patches(&mesh, scale).into_iter();
        let planar: Vec<Triangle> = patches.flat_map(|patch| patch.triangles).collect();
        let thresholds: Vec<f64> = self.thresholds.iter().map(|t| t * scale).collect();
        let margin = thresholds.iter().copied().fold(f64::INFINITY, f64::min);
        let is_seen = |point: &Vector3<f64>| {
            let cameras = truth.cameras.iter();
            let views = cameras.filter(|camera| surface.shows(camera, point, margin));
            truth.cameras.is_empty() || views.take(self.min_views).count() == self.min_views
        };
        let around = box_around(&truth.wireframe.junctions, &thresholds);
        let counts = |point: &Vector3<f64>| {
            let inside = |[low, high]: [Vector3<f64>; 2]| *point >= low && *point <= high;
            around.is_none_or(inside) && is_seen(point)
        };
        let of_found = self.distances(&found_triangles, &surface, scale, |_| true);
        let faces = Surface::of_triangles(found_triangles);
        let of_truth = self.distances(&planar, &faces, scale, counts);
        let shares = |threshold: &f64| FaceShares {
            threshold: *threshold,
            precision: share(&of_found, *threshold),
            recall: share(&of_truth, *threshold),
        };
        Ok(SceneFaceScores {
            scale,
            faces: found.len(),
            found_area: total(found.iter().map(|face| face.area)),
            planar_area: of_truth.len() as f64 * (self.spacing * scale).powi(2),
            thresholds: thresholds.iter().map(shares).collect(),
        })
    }

    /// The planar parts of the mesh that count.
    pub(super) fn patches(&self, mesh: &[Triangle], scale: f64) -> Vec<PlanarPatch> {
        let min_area = self.min_patch * scale.powi(2);
        planar_patches(mesh, min_area, self.thickness * scale)
    }

    /// Of points on `triangles` that count: how far the nearest triangle of like direction is.
    fn distances(
        &self,
        triangles: &[Triangle],
        other: &Surface,
        scale: f64,
        counts: impl Fn(&Vector3<f64>) -> bool + Sync,
    ) -> Vec<Option<f64>> {
        let reach = scale * self.thresholds.iter().copied().fold(0.0, f64::max);
        let cosine = self.max_angle.to_radians().cos();
        let samples = area_samples(triangles, self.spacing * scale);
        let counted = samples.par_iter().filter(|sample| counts(&sample.point));
        let distance = |sample: &AreaSample| {
            let along = normal(&triangles[sample.triangle])?;
            other.distance_along(&sample.point, &along, cosine, reach)
        };
        counted.map(distance).collect()
    }

    pub(super) fn check(&self, found: &[Triangle], truth: &SceneTruth) -> Result<(), EvalError> {
        if truth.surface.triangles.is_empty() {
            return Err(EvalError::EmptyTruth {
                protocol: "scene-faces",
                missing: "triangles",
            });
        }
        if let Some(triangle) = truth.surface.broken_triangle() {
            return Err(EvalError::BrokenSurface { triangle });
        }
        let spacing = self.spacing * truth.scale;
        // No comparison holds of NaN.
        let is_fine = |triangles: &[Triangle]| {
            let samples = total(triangles.iter().map(area)) / spacing.powi(2);
            samples <= MOST_SAMPLES && triangles.iter().flatten().all(|p| p.norm().is_finite())
        };
        for (what, is_fine) in [
            ("result", is_fine(found)),
            ("truth", is_fine(&truth.surface.corners())),
        ] {
            if !is_fine {
                return Err(EvalError::OutOfScale { what, spacing });
            }
        }
        Ok(())
    }
}

/// The least and greatest coordinates of some points, and as much more as is near; `None` without
/// any.
fn box_around(points: &[Vector3<f64>], near: &[f64]) -> Option<[Vector3<f64>; 2]> {
    let margin = near.iter().copied().fold(0.0, f64::max);
    let boxes = points
        .iter()
        .map(|p| [p.add_scalar(-margin), p.add_scalar(margin)]);
    boxes.reduce(|[low, high], [from, to]| [low.inf(&from), high.sup(&to)])
}

fn share(distances: &[Option<f64>], threshold: f64) -> Option<f64> {
    let near = distances
        .iter()
        .filter(|d| d.is_some_and(|d| d <= threshold));
    (!distances.is_empty()).then(|| near.count() as f64 / distances.len() as f64)
}

/// A row of the table.
type Row = (&'static str, fn(&FaceShares) -> Option<f64>);

impl SceneFaceScores {
    pub(crate) fn table(&self) -> Table {
        let title = format!(
            "Found: {} faces of area {:.4}. Truth: {:.4} of planar surface that is seen. Shares of area in percent.",
            self.faces, self.found_area, self.planar_area
        );
        let mut table = Table::new(title, &["within"]);
        // Without the noise of the last digits.
        let number = |value: f64| {
            let text = format!("{value:.6}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        };
        let thresholds = self.thresholds.iter();
        table.header.extend(thresholds.map(|s| number(s.threshold)));
        let rows: [Row; 2] = [
            ("precision", |shares| shares.precision),
            ("recall", |shares| shares.recall),
        ];
        for (name, value) in rows {
            let cells = self.thresholds.iter().map(|shares| {
                value(shares).map_or_else(|| "-".into(), |share| format!("{:.1}", 100.0 * share))
            });
            table
                .rows
                .push(std::iter::once(name.into()).chain(cells).collect());
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle_mesh::tests::cube;
    use nalgebra::Matrix3;
    use neat_core::{Camera, Intrinsics};
    use neat_wireframe::faces::Surface as FaceSurface;

    /// A square from 0 to `side` at a height over the plane z = 0, turned about the x axis.
    fn square(side: f64, height: f64, turned: f64) -> FoundFace {
        let (sine, cosine) = turned.to_radians().sin_cos();
        let at =
            |u: f64, v: f64| Vector3::new(u * side, v * side * cosine, height + v * side * sine);
        FoundFace {
            surface: FaceSurface::Plane {
                normal: Vector3::new(0.0, -sine, cosine),
                offset: height * cosine,
            },
            area: side * side,
            triangles: vec![
                [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)],
                [at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
            ],
        }
    }

    /// Fine enough for a cube.
    fn protocol() -> SceneFaces {
        SceneFaces {
            spacing: 0.005,
            ..SceneFaces::default()
        }
    }

    fn scene() -> SceneTruth {
        SceneTruth {
            surface: cube(),
            ..SceneTruth::default()
        }
    }

    fn shares(found: &[FoundFace], truth: &SceneTruth) -> Vec<[f64; 2]> {
        let scores = protocol().evaluate(found, truth).unwrap();
        let of = |s: &FaceShares| [s.precision.unwrap(), s.recall.unwrap()];
        scores.thresholds.iter().map(of).collect()
    }

    #[test]
    fn one_side_of_a_cube_is_a_sixth_of_it() {
        let near = |a: f64, b: f64| (a - b).abs() < 2e-3;
        for ([precision, recall], within) in shares(&[square(1.0, 1.015, 0.0)], &scene())
            .into_iter()
            .zip([false, true, true])
        {
            let expected = if within { [1.0, 1.0 / 6.0] } else { [0.0, 0.0] };
            // Rims of the sides next to it are as near, but turned away.
            assert!(near(precision, expected[0]) && near(recall, expected[1]));
        }
        // Twice as wide and deep as the cube.
        let [precision, recall] = shares(&[square(2.0, 1.0, 0.0)], &scene())[0];
        assert!(
            near(recall, 1.0 / 6.0) && (precision - 0.25).abs() < 0.01,
            "{precision}"
        );
        // Through it.
        assert_eq!(shares(&[square(1.0, 0.5, 0.0)], &scene())[2], [0.0, 0.0]);
        assert_eq!(shares(&[square(0.1, 1.0, 15.0)], &scene())[2], [0.0, 0.0]);
    }

    #[test]
    fn the_scale_is_that_of_the_scene() {
        let truth = SceneTruth {
            scale: 0.1,
            ..scene()
        };
        let scores = SceneFaces::default().evaluate(&[square(1.0, 1.0015, 0.0)], &truth);
        let scores = scores.unwrap();
        let precisions: Vec<_> = scores.thresholds.iter().map(|s| s.precision).collect();
        assert_eq!(precisions, [Some(0.0), Some(1.0), Some(1.0)]);
    }

    #[test]
    fn what_lies_beyond_the_creases_cannot_be_missing() {
        let mut truth = scene();
        truth.wireframe.junctions = vec![Vector3::new(0.0, 0.0, 0.9), Vector3::repeat(1.0)];
        let scores = protocol().evaluate(&[square(1.0, 1.0, 0.0)], &truth);
        // The top, and 0.15 of the four sides.
        let scores = scores.unwrap();
        assert!(
            (scores.planar_area - 1.6).abs() < 0.05,
            "{}",
            scores.planar_area
        );
    }

    #[test]
    fn only_what_views_see_can_be_missing() {
        let from_above = Camera {
            intrinsics: Intrinsics::centered(100.0, (100, 100)),
            world_from_camera: Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
            center_in_world: Vector3::new(0.5, 0.5, 5.0),
            width: 100,
            height: 100,
        };
        let mut truth = scene();
        truth.cameras = vec![from_above; 3];
        let scores = protocol().evaluate(&[square(1.0, 1.0, 0.0)], &truth);
        let scores = scores.unwrap();
        // Of the sides only what is nearer to the top than what hides it may be before it.
        assert!(
            (scores.planar_area - 1.0).abs() < 0.1,
            "{}",
            scores.planar_area
        );
        assert!(scores.thresholds[0].recall.unwrap() > 0.9);
        truth.cameras.pop();
        let unseen = protocol().evaluate(&[], &truth).unwrap();
        assert_eq!(
            (unseen.planar_area, unseen.thresholds[0].recall),
            (0.0, None)
        );
        assert_eq!(unseen.thresholds[0].precision, None);
    }

    #[test]
    fn what_cannot_be_measured_is_refused() {
        let protocol = protocol();
        let nothing = protocol.evaluate(&[], &SceneTruth::default());
        assert!(matches!(nothing, Err(EvalError::EmptyTruth { .. })));
        let mut broken = scene();
        broken.surface.triangles[3] = [0, 1, 99];
        let broken = protocol.evaluate(&[], &broken);
        assert!(matches!(
            broken,
            Err(EvalError::BrokenSurface { triangle: 3 })
        ));
        let far = protocol.evaluate(&[square(1e200, 1.0, 0.0)], &scene());
        assert!(matches!(
            far,
            Err(EvalError::OutOfScale { what: "result", .. })
        ));
    }
}
