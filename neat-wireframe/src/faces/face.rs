//! Faces and shells: what a boundary representation is made of.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Faces that hang together by the curves that they share.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shell {
    /// Whether it bounds a solid: every curve has two faces, one on each side, normals point out
    /// of the solid, and nothing is seen within it. Otherwise it is a sheet.
    pub closed: bool,
    /// Its faces.
    pub faces: Vec<Face>,
}

/// A part of a surface, bounded by edges and arcs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// What it is a part of, with the side to which its normal points.
    #[serde(flatten)]
    pub surface: Surface,
    /// Closed chains of curves, the outer one of a plane first; the others are holes. Seen from the
    /// side to which the normal points, the face lies on the left of each.
    pub loops: Vec<Vec<Step>>,
}

/// The surfaces of faces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Surface {
    /// The points x with `normal · x = offset`.
    Plane {
        /// Of length 1.
        normal: Vector3<f64>,
        /// Distance from the origin along the normal.
        offset: f64,
    },
    /// The points at a distance from an axis.
    Cylinder {
        /// A point of the axis.
        point: Vector3<f64>,
        /// Its direction, of length 1.
        axis: Vector3<f64>,
        /// The distance.
        radius: f64,
        /// Whether the normal points away from the axis, as on a pin; in a hole it points to it.
        convex: bool,
    },
}

/// A curve of a loop, in the direction in which the loop runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Step {
    /// The curve.
    #[serde(flatten)]
    pub curve: CurveIndex,
    /// Whether the loop runs from its end to its start.
    #[serde(default)]
    pub reversed: bool,
}

/// An edge or an arc of the wireframe, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CurveIndex {
    /// A straight edge.
    Edge(usize),
    /// An arc, which may be a whole circle.
    Arc(usize),
}

impl Shell {
    /// The same shell where a similarity that does not turn has moved the wireframe.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            closed: self.closed,
            faces: self.faces.iter().map(|face| face.map(&f)).collect(),
        }
    }
}

impl Face {
    /// The steps of all loops.
    pub fn steps(&self) -> impl Iterator<Item = &Step> + Clone {
        self.loops.iter().flatten()
    }

    fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        let surface = match self.surface {
            Surface::Plane { normal, offset } => Surface::Plane {
                normal,
                offset: normal.dot(&f(&(normal * offset))),
            },
            Surface::Cylinder {
                point,
                axis,
                radius,
                convex,
            } => Surface::Cylinder {
                point: f(&point),
                axis,
                radius: (f(&(point + axis * radius)) - f(&point)).norm(),
                convex,
            },
        };
        Self {
            surface,
            loops: self.loops.clone(),
        }
    }

    /// The same face with its normal on the other side.
    pub(super) fn turned(&self) -> Self {
        let surface = match self.surface {
            Surface::Plane { normal, offset } => Surface::Plane {
                normal: -normal,
                offset: -offset,
            },
            Surface::Cylinder {
                point,
                axis,
                radius,
                convex,
            } => Surface::Cylinder {
                point,
                axis,
                radius,
                convex: !convex,
            },
        };
        let turned = |steps: &Vec<Step>| steps.iter().rev().map(Step::turned).collect();
        Self {
            surface,
            loops: self.loops.iter().map(turned).collect(),
        }
    }
}

impl Step {
    pub(super) fn turned(&self) -> Self {
        Self {
            curve: self.curve,
            reversed: !self.reversed,
        }
    }
}
