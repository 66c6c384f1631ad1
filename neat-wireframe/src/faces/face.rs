//! Faces and shells: what a boundary representation is made of.

use super::curves::{MeasuredGraph, ends_of_arc, ends_of_spline, nearest_junctions};
use super::surface::Surface;
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

/// A part of a surface, bounded by edges, arcs and splines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// What it is a part of, with the side to which its normal points.
    #[serde(flatten)]
    pub surface: Surface,
    /// Closed chains of curves, the outer one of a plane or a patch first; the others are holes. On what
    /// is round one may be the outer one, or two run around the axis, and these come first; on a sphere
    /// there is one circle. Seen from the side to which the normal points, the face lies on the left of
    /// each.
    pub loops: Vec<Vec<Step>>,
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

/// What bounds a face: an edge, an arc or a spline of the wireframe, by its index, an inferred line, or
/// the rim of a dome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CurveIndex {
    /// A straight edge.
    Edge(usize),
    /// An arc, which may be a whole circle.
    Arc(usize),
    /// A spline, which may run around.
    Spline(usize),
    /// No edge, but a straight line between two junctions, the lower first, where two faces meet,
    /// without a crease or with one that no image shows from end to end: inferred.
    Smooth([usize; 2]),
    /// No edge, but the circle in which a dome touches what is beside it without a crease: inferred.
    Rim(usize),
}

impl CurveIndex {
    /// Whether no image shows it.
    pub fn is_inferred(&self) -> bool {
        matches!(self, Self::Smooth(_) | Self::Rim(_))
    }
}

impl Shell {
    /// The curves that bound its faces: those between two faces once for each.
    pub fn curves(&self) -> impl Iterator<Item = CurveIndex> {
        self.faces
            .iter()
            .flat_map(Face::steps)
            .map(|step| step.curve)
    }

    /// The same shell where a similarity has moved the wireframe: one that does not turn it, but
    /// may mirror it at a point.
    pub fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            closed: self.closed,
            faces: self.faces.iter().map(|face| face.map(&f)).collect(),
        }
    }
}

impl Shell {
    /// The same shell where edges and junctions have new indices in the same order, or none;
    /// `None` if no face is left. Without one of its faces it is a sheet.
    pub fn with_indices(
        &self,
        new_edge: impl Fn(usize) -> Option<usize>,
        new_junction: impl Fn(usize) -> Option<usize>,
    ) -> Option<Self> {
        let step = |step: &Step| {
            let curve = match step.curve {
                CurveIndex::Edge(edge) => CurveIndex::Edge(new_edge(edge)?),
                curve @ (CurveIndex::Arc(_) | CurveIndex::Spline(_) | CurveIndex::Rim(_)) => curve,
                CurveIndex::Smooth([a, b]) => {
                    CurveIndex::Smooth([new_junction(a)?, new_junction(b)?])
                }
            };
            Some(Step { curve, ..*step })
        };
        let face = |face: &Face| {
            let steps = |steps: &Vec<Step>| steps.iter().map(step).collect::<Option<_>>();
            Some(Face {
                surface: face.surface,
                loops: face.loops.iter().map(steps).collect::<Option<_>>()?,
            })
        };
        let faces: Vec<Face> = self.faces.iter().filter_map(face).collect();
        (!faces.is_empty()).then_some(Self {
            closed: self.closed && faces.len() == self.faces.len(),
            faces,
        })
    }
}

impl Face {
    /// Whether its surface is one, and its loops are closed chains of curves that exist; of an
    /// extruded one two splines, as loops of their own or joined by two edges or inferred lines, of a
    /// sphere one circle.
    pub(crate) fn is_valid(&self, graph: &MeasuredGraph) -> bool {
        let exists = |step: &Step| match step.curve {
            CurveIndex::Edge(edge) => edge < graph.wireframe.edges.len(),
            CurveIndex::Arc(arc) => arc < graph.arcs.len(),
            CurveIndex::Spline(spline) => spline < graph.splines.len(),
            CurveIndex::Smooth([a, b]) => a < b && b < graph.wireframe.junctions.len(),
            CurveIndex::Rim(dome) => dome < graph.domes.len(),
        };
        let is_circle = |step: &Step| matches!(step.curve, CurveIndex::Arc(_) | CurveIndex::Rim(_));
        let has_shape = match self.surface {
            Surface::Extruded { .. } => self.rims().is_some(),
            Surface::Patch { .. } => self.sides().is_some(),
            Surface::Sphere { .. } => {
                self.loops.len() == 1 && self.loops[0].len() == 1 && self.steps().all(is_circle)
            }
            Surface::Plane { .. } | Surface::Cylinder { .. } | Surface::Cone { .. } => {
                !self.loops.is_empty()
            }
        };
        self.surface.is_valid()
            && has_shape
            && self.steps().all(exists)
            && (self.loops.iter()).all(|steps| is_closed(steps, graph))
    }

    /// The four sides of a patch, of which some have no step; `None` of what has no such sides.
    pub(crate) fn sides(&self) -> Option<[&[Step]; 4]> {
        let (Surface::Patch { sides }, Some(steps)) = (self.surface, self.loops.first()) else {
            return None;
        };
        let mut left = &steps[..];
        let mut of_sides = [&steps[..0]; 4];
        for (count, side) in sides.into_iter().zip(&mut of_sides) {
            (*side, left) = left.split_at_checked(count)?;
        }
        left.is_empty().then_some(of_sides)
    }

    /// The steps of all loops.
    pub fn steps(&self) -> impl Iterator<Item = &Step> + Clone {
        self.loops.iter().flatten()
    }

    /// The curves of all loops, ascending: no two candidates have the same, but for a cap and a lid.
    pub(super) fn boundary(&self) -> Vec<CurveIndex> {
        let mut boundary: Vec<CurveIndex> = self.steps().map(|step| step.curve).collect();
        boundary.sort_unstable();
        boundary
    }

    /// The two splines of a wall: the one along which it is to the left, and the one back. `None` if
    /// it is bounded otherwise.
    pub fn rims(&self) -> Option<[Step; 2]> {
        self.rims_among(|step| matches!(step.curve, CurveIndex::Spline(_)))
    }

    /// The two curves of this kind between which it is, as loops of their own or joined by two
    /// straight ones; `None` if it is bounded otherwise.
    pub(crate) fn rims_among(&self, is_rim: impl Fn(&Step) -> bool) -> Option<[Step; 2]> {
        let is_straight =
            |step: &Step| matches!(step.curve, CurveIndex::Edge(_) | CurveIndex::Smooth(_));
        let rims: Vec<Step> = self.steps().filter(|step| is_rim(step)).copied().collect();
        let in_turn = match &self.loops[..] {
            [one, other] => one.len() == 1 && other.len() == 1,
            [steps] => {
                let rulings = steps.iter().filter(|step| is_straight(step)).count();
                steps.len() == 4 && rulings == 2 && is_rim(&steps[0]) == is_rim(&steps[2])
            }
            _ => false,
        };
        rims.try_into().ok().filter(|_| in_turn)
    }

    fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        let origin = f(&Vector3::zeros());
        let scale = (f(&Vector3::x()) - origin).x;
        let mut loops = self.loops.clone();
        if scale < 0.0 {
            // In the mirror, left is right; but rims of domes run around these.
            loops = self.turned().loops;
            for step in loops.iter_mut().flatten() {
                step.reversed ^= matches!(step.curve, CurveIndex::Rim(_));
            }
        }
        Self {
            surface: self.surface.map(f),
            loops,
        }
    }

    /// The same face with its normal on the other side.
    pub(super) fn turned(&self) -> Self {
        let turned = |steps: &Vec<Step>| steps.iter().rev().map(Step::turned).collect();
        Self {
            surface: self.surface.turned(),
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

/// Whether each step begins where the one before it ends. A step alone is a circle or a spline that
/// runs around.
fn is_closed(steps: &[Step], graph: &MeasuredGraph) -> bool {
    let junctions = &graph.wireframe.junctions;
    let ends = |step: &Step| {
        let [start, end] = match step.curve {
            CurveIndex::Edge(edge) => graph.wireframe.edges[edge],
            CurveIndex::Arc(arc) => nearest_junctions(ends_of_arc(&graph.arcs[arc]), junctions)?,
            CurveIndex::Spline(spline) => {
                nearest_junctions(ends_of_spline(&graph.splines[spline]), junctions)?
            }
            CurveIndex::Smooth(ends) => ends,
            CurveIndex::Rim(_) => return None,
        };
        Some(if step.reversed {
            [end, start]
        } else {
            [start, end]
        })
    };
    match steps {
        [] => false,
        [step] => match step.curve {
            CurveIndex::Edge(_) | CurveIndex::Smooth(_) => false,
            CurveIndex::Arc(arc) => graph.arcs[arc].is_closed(),
            CurveIndex::Spline(spline) => graph.splines[spline].closed,
            CurveIndex::Rim(_) => true,
        },
        [.., last] => {
            let before = std::iter::once(last).chain(steps);
            let mut pairs = before
                .zip(steps)
                .map(|(before, step)| (ends(before), ends(step)));
            pairs.all(|(before, step)| before.zip(step).is_some_and(|(b, s)| b[1] == s[0]))
        }
    }
}
