//! The junctions in a plane as corners of triangles, with the edges between them as sides.

use super::curves::Curves;
use super::face::{CurveIndex, Step};
use super::plane_fit::{FittedPlane, PlaneFrame};
use super::polygon::signed_area;
use nalgebra::{Vector2, Vector3};
use spade::handles::{DirectedEdgeHandle, FixedVertexHandle};
use spade::{
    ConstrainedDelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation,
};
use std::collections::{BTreeMap, BTreeSet};

/// A junction where it lies in the plane.
struct Corner {
    position: Point2<f64>,
    point: Vector3<f64>,
    junction: usize,
}

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// A constrained Delaunay triangulation; triangles are told by their numbers.
pub(super) struct PlaneMesh {
    pub frame: PlaneFrame,
    mesh: ConstrainedDelaunayTriangulation<Corner>,
    /// The edges of the wireframe by their junctions, the lower first; with each the junctions at
    /// its start and end.
    edges: BTreeMap<[usize; 2], (usize, [usize; 2])>,
}

impl PlaneMesh {
    /// Of all junctions that may lie in the plane, and all edges between them but those that
    /// cross one before them. `None` if the corners have no coordinates.
    pub fn new(curves: &Curves, plane: &FittedPlane) -> Option<Self> {
        let (normal, offset) = plane.plane();
        let frame = PlaneFrame::new(normal, offset);
        let mut mesh = ConstrainedDelaunayTriangulation::new();
        let mut corners: BTreeMap<usize, FixedVertexHandle> = BTreeMap::new();
        let mut edges = BTreeMap::new();
        for curve in curves.observed() {
            let (CurveIndex::Edge(edge), Some(ends)) = (curve.index, curve.ends) else {
                continue;
            };
            for (junction, (point, covariance)) in ends.iter().zip(&curve.measured) {
                if plane.holds(point, covariance) && !corners.contains_key(junction) {
                    let flat = frame.coordinates(point);
                    let corner = Corner {
                        position: Point2::new(flat.x, flat.y),
                        point: *point,
                        junction: *junction,
                    };
                    corners.insert(*junction, mesh.insert(corner).ok()?);
                }
            }
            if ends.iter().all(|end| corners.contains_key(end)) {
                edges.insert([ends[0].min(ends[1]), ends[0].max(ends[1])], (edge, ends));
            }
        }
        for ends in edges.keys() {
            let [a, b] = ends.map(|end| corners[&end]);
            if a != b && mesh.can_add_constraint(a, b) {
                mesh.add_constraint(a, b);
            }
        }
        Some(Self { frame, mesh, edges })
    }

    /// The numbers of all triangles, with their areas and centroids.
    pub fn triangles(&self) -> impl Iterator<Item = (usize, f64, Vector3<f64>)> + '_ {
        self.mesh.inner_faces().map(|face| {
            let corners = face.vertices().map(|corner| corner.data().point);
            let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
            (face.fix().index(), face.area(), centroid)
        })
    }

    /// The triangle in which a point of the plane lies.
    pub fn triangle_at(&self, point: &Vector3<f64>) -> Option<usize> {
        let flat = self.frame.coordinates(point);
        match self.mesh.locate(Point2::new(flat.x, flat.y)) {
            PositionInTriangulation::OnFace(face) => Some(face.index()),
            _ => None,
        }
    }

    /// Pairs of triangles beside each other, the lower first, or a triangle at the rim alone; each
    /// with whether an edge of the wireframe is between them.
    pub fn sides(&self) -> Vec<([usize; 2], bool)> {
        let of_edge = |side: DirectedEdgeHandle<'_, Corner, _, _, _>| {
            let [a, b] = [side, side.rev()].map(|side| side.face().fix().index());
            let ends = [side.from(), side.to()].map(|corner| corner.data().junction);
            let is_edge = matches!(self.step(ends).curve, CurveIndex::Edge(_));
            ([a.min(b), a.max(b)], is_edge)
        };
        (self.mesh.undirected_edges())
            .map(|side| of_edge(side.as_directed()))
            .collect()
    }

    /// Along the edge between two junctions, or the line that is inferred where there is none.
    fn step(&self, ends: [usize; 2]) -> Step {
        let sorted = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let (curve, along) = match self.edges.get(&sorted) {
            Some((edge, along)) => (CurveIndex::Edge(*edge), *along),
            None => (CurveIndex::Smooth(sorted), sorted),
        };
        Step {
            curve,
            reversed: along != ends,
        }
    }

    /// The loops around triangles that hang together, which lie on the left of each: the outer one
    /// counterclockwise. With each the corners from which its steps start.
    pub fn loops(&self, triangles: &BTreeSet<usize>) -> Vec<(Vec<Step>, Vec<Vector2<f64>>)> {
        let within = |side: &DirectedEdgeHandle<'_, Corner, _, _, _>| {
            triangles.contains(&side.face().fix().index())
        };
        let mut loops = Vec::new();
        let mut walked = BTreeSet::new();
        for start in self.mesh.directed_edges() {
            let mut side = start;
            let (mut steps, mut polygon) = (Vec::new(), Vec::new());
            while within(&side) && !within(&side.rev()) && walked.insert(side.fix().index()) {
                let ends = [side.from(), side.to()].map(|corner| corner.data().junction);
                steps.push(self.step(ends));
                polygon.push(self.frame.coordinates(&side.from().data().point));
                // Around what is outside, so that no loop comes to a corner twice.
                side = side.rev().prev().rev();
                while !within(&side) {
                    side = side.prev().rev();
                }
            }
            if !steps.is_empty() {
                loops.push((steps, polygon));
            }
        }
        loops.sort_by(|a, b| signed_area(&b.1).total_cmp(&signed_area(&a.1)));
        loops
    }
}

#[cfg(test)]
mod tests {
    use super::super::curves::MeasuredGraph;
    use super::super::plane_fit::PlaneFit;
    use super::*;
    use neat_core::Wireframe3d;

    #[test]
    fn a_hole_that_touches_the_rim_is_a_loop_of_its_own() {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let wireframe = Wireframe3d {
            junctions: (corners.into_iter().chain([[0.2, 0.6], [0.6, 0.2]]))
                .map(|[x, y]| Vector3::new(x, y, 0.5))
                .collect(),
            edges: vec![[0, 1], [1, 2], [2, 3], [3, 0], [2, 4], [4, 5], [5, 2]],
        };
        let curves = Curves::new(&MeasuredGraph::of(&wireframe));
        let points = curves.all.iter().flat_map(|curve| &curve.measured);
        let fit = PlaneFit::through(points, curves.extent).unwrap();
        let mesh = PlaneMesh::new(&curves, &fit.solved().unwrap()).unwrap();
        let hole = mesh.triangle_at(&Vector3::new(0.6, 0.6, 0.5)).unwrap();
        let of_hole = mesh.triangles().find(|(triangle, ..)| *triangle == hole);
        assert!((of_hole.unwrap().1 - 0.24).abs() < 1e-9);
        let others = mesh.triangles().map(|(triangle, ..)| triangle);
        let loops = mesh.loops(&others.filter(|triangle| *triangle != hole).collect());
        let areas: Vec<f64> = loops.iter().map(|(_, p)| signed_area(p)).collect();
        assert!((areas[0] - 4.0).abs() < 1e-9 && (areas[1] + 0.24).abs() < 1e-9);
        let counts: Vec<usize> = loops.iter().map(|(steps, _)| steps.len()).collect();
        assert_eq!(counts, [4, 3]);
        let is_edge = |step: &Step| matches!(step.curve, CurveIndex::Edge(_));
        assert!(loops.iter().flat_map(|(steps, _)| steps).all(is_edge));
    }
}
