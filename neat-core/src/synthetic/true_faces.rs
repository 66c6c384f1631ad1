//! What `gt_wireframe.json` says of a solid beyond its straight edges.

use super::{Frustum, RoundFace};
use crate::CircularArc;
use crate::ground_truth::{Curve, Face, FaceEdge, Surface};

/// Points along a curve are at most so far from one to the next, where the solid has about unit size.
const SPACING: f64 = 0.005;

impl Frustum {
    /// [`Self::arcs`] as ground truth lists them.
    pub fn curves(&self) -> Vec<Curve> {
        let curve = |arc: &CircularArc| Curve {
            kind: if arc.is_closed() { "circle" } else { "arc" }.to_owned(),
            points: arc.points(SPACING / arc.radius),
        };
        self.arcs().iter().map(curve).collect()
    }

    /// All faces, flat ones first, with the sharp edges around them.
    pub fn true_faces(&self) -> Vec<Face> {
        let rounds = self.round_faces().len();
        let straight_sides = self.faces().len() - 2;
        let flat = self.faces().iter().enumerate().map(|(index, face)| {
            // Bottom and top come last, and all arcs of one of them are around it.
            let of_end = |end: usize| (end * rounds..(end + 1) * rounds).map(FaceEdge::Curve);
            let curves = index.checked_sub(straight_sides).map(of_end);
            let lines = (self.wireframe().edges.iter().enumerate())
                .filter(|(_, edge)| match index.checked_sub(straight_sides) {
                    Some(end) => self.is_of_end(edge, end),
                    None => face.contains_edge(edge),
                })
                .map(|(edge, _)| FaceEdge::Line(edge));
            Face {
                surface: Surface::Plane {
                    normal: face.normal,
                    offset: -face.plane_distance(&nalgebra::Vector3::zeros()),
                },
                area: face.area(),
                edges: lines.chain(curves.into_iter().flatten()).collect(),
            }
        });
        let round = self.round_faces().iter().enumerate().map(|(index, face)| {
            let rims = [index, rounds + index].map(FaceEdge::Curve);
            let uprights = (self.wireframe().edges.iter().enumerate())
                .filter(|(_, edge)| self.is_upright_of(edge, face))
                .map(|(edge, _)| FaceEdge::Line(edge));
            Face {
                surface: surface_of(face),
                area: face.area(),
                edges: rims.into_iter().chain(uprights).collect(),
            }
        });
        flat.chain(round).collect()
    }

    /// Whether both ends of an edge are of the bottom, or of the top.
    fn is_of_end(&self, edge: &[usize; 2], end: usize) -> bool {
        let half = self.wireframe().junctions.len() / 2;
        edge.iter().all(|junction| junction / half == end)
    }

    /// Whether an edge joins ends of both rims of a round face.
    fn is_upright_of(&self, edge: &[usize; 2], face: &RoundFace) -> bool {
        let [lower, upper] = edge.map(|junction| self.wireframe().junctions[junction]);
        !face.rims[0].is_closed()
            && face.rims[0].angles.iter().any(|&angle| {
                let ruling = face.ruling(angle);
                (ruling.start - lower)
                    .norm()
                    .max((ruling.end - upper).norm())
                    < 1e-9
            })
    }
}

fn surface_of(face: &RoundFace) -> Surface {
    let (rim, slope) = (&face.rims[0], face.slope());
    if slope == 0.0 {
        return Surface::Cylinder {
            axis_point: rim.center,
            axis: face.axis(),
            radius: rim.radius,
        };
    }
    // Where the radius is 0; the axis points into the cone.
    Surface::Cone {
        apex: rim.center - face.axis() * (rim.radius / slope),
        axis: face.axis() * slope.signum(),
        half_angle: slope.abs().atan(),
    }
}
