//! Which faces of a CAD model are found, by area.
//!
//! Source: ours. A found face is a true one if its corners lie on the same surface (those of a wall
//! between splines on the boundary of a true face that is none of plane, cylinder, cone and sphere),
//! both have the same area, and their middles are in one place: so it is found whole, and once. Other than
//! areas by points on surfaces, which count a face with a forgotten hole in it as nearly right,
//! this says which faces of a model are there.

use super::found_face::FoundFace;
use super::true_face::TrueFace;
use crate::error::EvalError;
use crate::table::Table;
use crate::total::total;
use nalgebra::Vector3;
use neat_wireframe::faces::Surface;
use serde::{Deserialize, Serialize};

/// The constants, for models whose longest side is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CadFaces {
    /// The corners of a found face lie so near to the true surface, and radii agree so well.
    pub max_distance: f64,
    /// Normals and axes are turned against each other by so many degrees at most.
    pub max_angle: f64,
    /// Areas agree to this share of the true one.
    pub max_area_error: f64,
    /// The middles of the boxes around both boundaries are so near to each other.
    pub max_shift: f64,
}

impl Default for CadFaces {
    fn default() -> Self {
        Self {
            max_distance: 0.01,
            max_angle: 10.0,
            max_area_error: 0.05,
            max_shift: 0.05,
        }
    }
}

/// How many faces are right, and how much of the area.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CadFaceScores {
    /// Found faces.
    pub found: FaceCounts,
    /// True faces, of any surface.
    pub truth: FaceCounts,
    /// Of the true faces, the planes that are found.
    pub planes: FaceShare,
    /// The cylinders.
    pub cylinders: FaceShare,
    /// The cones.
    #[serde(default)]
    pub cones: FaceShare,
    /// The spheres.
    #[serde(default)]
    pub spheres: FaceShare,
    /// All others. Only walls between splines and patches are ever found for them.
    pub others: FaceShare,
    /// Of the true area, what is found.
    pub recall: f64,
    /// Of the found area, what is true; `None` without any.
    pub precision: Option<f64>,
}

/// Faces and their area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaceCounts {
    /// How many.
    pub faces: usize,
    /// Their area.
    pub area: f64,
}

/// Those of one kind, and how many of them are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaceShare {
    /// All of them.
    pub all: FaceCounts,
    /// Those that are found.
    pub found: FaceCounts,
}

impl FaceCounts {
    fn add(&mut self, area: f64) {
        self.faces += 1;
        self.area += area;
    }

    fn of(areas: impl Iterator<Item = f64>) -> Self {
        let mut counts = Self::default();
        areas.for_each(|area| counts.add(area));
        counts
    }
}

impl CadFaces {
    /// Measures the faces of a result against those of the model, both in one frame.
    ///
    /// # Errors
    /// If the truth has no faces.
    pub fn evaluate(
        &self,
        found: &[FoundFace],
        truth: &[TrueFace],
    ) -> Result<CadFaceScores, EvalError> {
        if truth.is_empty() {
            return Err(EvalError::EmptyTruth {
                protocol: "cad-faces",
                missing: "faces",
            });
        }
        let mut scores = CadFaceScores {
            found: FaceCounts::of(found.iter().map(|face| face.area)),
            truth: FaceCounts::of(truth.iter().map(|face| face.area)),
            planes: FaceShare::default(),
            cylinders: FaceShare::default(),
            cones: FaceShare::default(),
            spheres: FaceShare::default(),
            others: FaceShare::default(),
            recall: 0.0,
            precision: None,
        };
        let partners = self.partners(found, truth);
        for (face, partner) in truth.iter().zip(&partners) {
            let share = match face.surface {
                Some(Surface::Plane { .. }) => &mut scores.planes,
                Some(Surface::Cylinder { .. }) => &mut scores.cylinders,
                Some(Surface::Cone { .. }) => &mut scores.cones,
                Some(Surface::Sphere { .. }) => &mut scores.spheres,
                Some(Surface::Extruded { .. } | Surface::Patch { .. }) | None => &mut scores.others,
            };
            share.all.add(face.area);
            if partner.is_some() {
                share.found.add(face.area);
            }
        }
        let kinds = [
            &scores.planes,
            &scores.cylinders,
            &scores.cones,
            &scores.spheres,
            &scores.others,
        ];
        let recalled = total(kinds.into_iter().map(|kind| kind.found.area));
        let right = total(partners.iter().flatten().map(|face| found[*face].area));
        scores.recall = recalled / scores.truth.area;
        scores.precision = (scores.found.area > 0.0).then(|| right / scores.found.area);
        Ok(scores)
    }

    /// For each true face the one that is found for it: one to one, those first whose middles are
    /// nearest.
    pub fn partners(&self, found: &[FoundFace], truth: &[TrueFace]) -> Vec<Option<usize>> {
        let mut near: Vec<(f64, usize, usize)> = Vec::new();
        for (true_face, of_truth) in truth.iter().enumerate() {
            near.extend((found.iter().enumerate()).filter_map(|(face, of_result)| {
                Some((self.shift(of_result, of_truth)?, true_face, face))
            }));
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut partners = vec![None; truth.len()];
        for (_, true_face, face) in near {
            if partners[true_face].is_none() && !partners.contains(&Some(face)) {
                partners[true_face] = Some(face);
            }
        }
        partners
    }

    /// How far the middles of two faces are apart that are the same; `None` of others.
    fn shift(&self, found: &FoundFace, truth: &TrueFace) -> Option<f64> {
        let alike = self.is_same_kind(&found.surface, truth.surface.as_ref())
            && (found.area / truth.area - 1.0).abs() <= self.max_area_error;
        if !alike {
            return None;
        }
        let boundary = found.boundary();
        let is_near = |corner: &Vector3<f64>| match &truth.surface {
            Some(surface) => surface.height_of(corner).0.abs() <= self.max_distance,
            None => {
                (truth.boundary.iter()).any(|point| (point - corner).norm() <= self.max_distance)
            }
        };
        if !boundary.iter().all(is_near) {
            return None;
        }
        let shift = match truth.boundary.is_empty() {
            true => 0.0,
            false => (middle(boundary.iter())? - middle(truth.boundary.iter())?).norm(),
        };
        (shift <= self.max_shift).then_some(shift)
    }

    fn is_same_kind(&self, found: &Surface, truth: Option<&Surface>) -> bool {
        match truth {
            Some(surface) => self.same_direction(found, surface),
            None => matches!(found, Surface::Extruded { .. } | Surface::Patch { .. }),
        }
    }

    fn same_direction(&self, one: &Surface, other: &Surface) -> bool {
        let cosine = self.max_angle.to_radians().cos();
        match (one, other) {
            (Surface::Plane { normal: a, .. }, Surface::Plane { normal: b, .. }) => {
                a.dot(b).abs() >= cosine
            }
            (
                Surface::Cylinder {
                    axis: a, radius: r, ..
                },
                Surface::Cylinder {
                    axis: b, radius: s, ..
                },
            ) => a.dot(b).abs() >= cosine && (r - s).abs() <= self.max_distance,
            (
                Surface::Cone {
                    axis: a,
                    half_angle: one,
                    ..
                },
                Surface::Cone {
                    axis: b,
                    half_angle: other,
                    ..
                },
            ) => {
                let opens_alike = (one - other).abs() <= self.max_angle.to_radians();
                a.dot(b) >= cosine && opens_alike
            }
            (
                Surface::Sphere {
                    center: a,
                    radius: r,
                    ..
                },
                Surface::Sphere {
                    center: b,
                    radius: s,
                    ..
                },
            ) => (a - b).norm() <= self.max_distance && (r - s).abs() <= self.max_distance,
            _ => false,
        }
    }
}

/// Of the box around some points; `None` without any.
fn middle<'a>(points: impl Iterator<Item = &'a Vector3<f64>>) -> Option<Vector3<f64>> {
    let boxed = points
        .map(|p| (*p, *p))
        .reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)));
    boxed.map(|(low, high)| 0.5 * (low + high))
}

impl CadFaceScores {
    pub(crate) fn table(&self) -> Table {
        let title = format!(
            "Found: {} faces of area {:.4}. Truth: {} faces of area {:.4}.",
            self.found.faces, self.found.area, self.truth.faces, self.truth.area
        );
        let mut table = Table::new(title, &["true faces", "all", "found", "share of area"]);
        let kinds = [
            ("planes", self.planes),
            ("cylinders", self.cylinders),
            ("cones", self.cones),
            ("spheres", self.spheres),
            ("others", self.others),
        ];
        for (name, share) in kinds.into_iter().filter(|(_, share)| share.all.faces > 0) {
            let counts = [share.all.faces, share.found.faces].map(|count| count.to_string());
            let [all, found] = counts;
            let part = share.found.area / share.all.area;
            table
                .rows
                .push(vec![name.into(), all, found, format!("{part:.3}")]);
        }
        let precision = self
            .precision
            .map_or_else(|| "-".into(), |p| format!("{p:.3}"));
        for (name, value) in [
            ("recall", format!("{:.3}", self.recall)),
            ("precision", precision),
        ] {
            table
                .rows
                .push(vec![name.into(), String::new(), String::new(), value]);
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of this side with a corner here, in the plane z = 0.
    fn square(x: f64, side: f64) -> FoundFace {
        let at = |u: f64, v: f64| Vector3::new(x + u * side, v * side, 0.0);
        FoundFace {
            surface: Surface::Plane {
                normal: -Vector3::z(),
                offset: 0.0,
            },
            area: side * side,
            triangles: vec![
                [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)],
                [at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
            ],
        }
    }

    fn true_square(x: f64, side: f64) -> TrueFace {
        TrueFace {
            surface: Some(Surface::Plane {
                normal: Vector3::z(),
                offset: 0.0,
            }),
            area: side * side,
            boundary: square(x, side).triangles.concat(),
        }
    }

    #[test]
    fn faces_are_found_whole_where_they_are_and_once() {
        let cone = TrueFace {
            surface: None,
            area: 0.25,
            boundary: Vec::new(),
        };
        let truth = [true_square(0.0, 0.5), true_square(2.0, 0.5), cone];
        // One is right, one lies on it, one is too small, and one lies where no face is.
        let found = [
            square(0.001, 0.5),
            square(0.002, 0.5),
            square(2.0, 0.45),
            square(1.0, 0.5),
        ];
        let scores = CadFaces::default().evaluate(&found, &truth).unwrap();
        assert_eq!((scores.planes.all.faces, scores.planes.found.faces), (2, 1));
        assert_eq!((scores.others.all.faces, scores.others.found.faces), (1, 0));
        assert!((scores.recall - 1.0 / 3.0).abs() < 1e-12);
        let area = 3.0 * 0.25 + 0.45 * 0.45;
        assert!((scores.precision.unwrap() - 0.25 / area).abs() < 1e-12);
    }

    #[test]
    fn a_face_beside_its_plane_or_across_it_is_another() {
        let truth = [true_square(0.0, 0.5)];
        let protocol = CadFaces::default();
        let precision = |moved: &dyn Fn(Vector3<f64>) -> Vector3<f64>, normal: Vector3<f64>| {
            let mut face = square(0.0, 0.5);
            face.surface = Surface::Plane {
                normal,
                offset: 0.0,
            };
            face.triangles = face.triangles.iter().map(|t| t.map(moved)).collect();
            protocol.evaluate(&[face], &truth).unwrap().precision
        };
        let up = |by: f64| move |p: Vector3<f64>| p + Vector3::z() * by;
        assert_eq!(precision(&up(0.009), Vector3::z()), Some(1.0));
        assert_eq!(precision(&up(0.011), Vector3::z()), Some(0.0));
        assert_eq!(precision(&up(0.0), Vector3::x()), Some(0.0));
        let nothing = protocol.evaluate(&[], &truth).unwrap();
        assert_eq!((nothing.recall, nothing.precision), (0.0, None));
        assert!(matches!(
            protocol.evaluate(&[], &[]),
            Err(EvalError::EmptyTruth { .. })
        ));
    }

    #[test]
    fn cylinders_agree_in_axis_and_radius() {
        let cylinder = |radius: f64, point: Vector3<f64>| Surface::Cylinder {
            point,
            axis: Vector3::z(),
            radius,
            convex: false,
        };
        let rim = |k: usize| {
            let (sine, cosine) = (k as f64 * std::f64::consts::FRAC_PI_2).sin_cos();
            Vector3::new(0.2 * cosine, 0.2 * sine, (k % 2) as f64)
        };
        let found = FoundFace {
            surface: cylinder(0.2, Vector3::zeros()),
            area: 1.2566,
            triangles: vec![[rim(0), rim(1), rim(2)], [rim(2), rim(3), rim(0)]],
        };
        let recall = |radius: f64, point: Vector3<f64>| {
            let truth = TrueFace {
                surface: Some(cylinder(radius, point)),
                area: 1.2566,
                boundary: (0..4).map(rim).collect(),
            };
            let found = std::slice::from_ref(&found);
            CadFaces::default()
                .evaluate(found, &[truth])
                .unwrap()
                .recall
        };
        assert_eq!(recall(0.205, Vector3::z() * 3.0), 1.0);
        assert_eq!(recall(0.215, Vector3::zeros()), 0.0);
        assert_eq!(recall(0.2, Vector3::x() * 0.02), 0.0);
    }
}
