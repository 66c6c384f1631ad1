//! Shells as boundary representations.

use super::entities::{Entities, real};
use nalgebra::Vector3;
use neat_core::Spline;
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{CurveIndex, Face, Shell, ShellGeometry, Step, Surface};
use std::collections::BTreeMap;

/// Writes all shells; returns the representation of the solids and that of the sheets, as far as
/// there are any.
pub(super) fn representations(
    step: &mut Entities,
    document: &WireframeDocument,
    [placement, context]: [&String; 2],
) -> Vec<String> {
    let wireframe = document.wireframe();
    let (mut solids, mut sheets) = (Vec::new(), Vec::new());
    for shell in &document.shells {
        let geometry = ShellGeometry::new(shell, &document.graph(&wireframe));
        let is_inferred = |curve: &CurveIndex| match curve {
            CurveIndex::Edge(edge) => (document.edge_fields.inferred.as_ref())
                .is_some_and(|inferred| inferred.get(*edge) == Some(&true)),
            other => other.is_inferred(),
        };
        let mut writer = ShellWriter::new(step, &geometry, is_inferred);
        let faces = writer.faces(shell).join(",");
        if shell.closed {
            let shell = step.add(&format!("CLOSED_SHELL('',({faces}))"));
            solids.push(step.add(&format!("MANIFOLD_SOLID_BREP('',{shell})")));
        } else {
            let shell = step.add(&format!("OPEN_SHELL('',({faces}))"));
            sheets.push(step.add(&format!("SHELL_BASED_SURFACE_MODEL('',({shell}))")));
        }
    }
    let kinds = [
        ("ADVANCED_BREP_SHAPE_REPRESENTATION", solids),
        ("MANIFOLD_SURFACE_SHAPE_REPRESENTATION", sheets),
    ];
    let written = kinds.into_iter().filter(|(_, items)| !items.is_empty());
    written
        .map(|(kind, items)| {
            let items = items.join(",");
            step.add(&format!("{kind}('',({placement},{items}),{context})"))
        })
        .collect()
}

/// Vertices and edges of one shell, which its faces share.
struct ShellWriter<'a> {
    step: &'a mut Entities,
    geometry: &'a ShellGeometry,
    /// The edge of each curve and its vertices at start and end.
    edges: BTreeMap<CurveIndex, (String, [Corner; 2])>,
}

/// A vertex and where it is.
#[derive(Clone)]
struct Corner {
    name: String,
    point: Vector3<f64>,
}

impl<'a> ShellWriter<'a> {
    fn new(
        step: &'a mut Entities,
        geometry: &'a ShellGeometry,
        is_inferred: impl Fn(&CurveIndex) -> bool,
    ) -> Self {
        let vertices: BTreeMap<usize, Corner> = (geometry.vertices.iter())
            .map(|(junction, point)| {
                let name = step.vertex(point);
                (
                    *junction,
                    Corner {
                        name,
                        point: *point,
                    },
                )
            })
            .collect();
        let mut edges = BTreeMap::new();
        for (index, curve) in &geometry.curves {
            let corners = match curve.ends {
                Some(ends) => ends.map(|end| vertices[&end].clone()),
                None => {
                    let of_circle = curve.arc.map(|circle| circle.point_at(circle.angles[0]));
                    let of_spline = || curve.spline.as_ref().map(|spline| spline.point_at(0.0));
                    let Some(point) = of_circle.or_else(of_spline) else {
                        continue;
                    };
                    let name = step.vertex(&point);
                    [
                        Corner {
                            name: name.clone(),
                            point,
                        },
                        Corner { name, point },
                    ]
                }
            };
            let names = [&corners[0].name, &corners[1].name];
            let name = if is_inferred(index) { "inferred" } else { "" };
            let edge = match (&curve.arc, &curve.spline) {
                (Some(arc), _) => Some(step.arc_edge(name, names, arc)),
                (None, Some(spline)) => Some(step.spline_edge(names, spline)),
                (None, None) => {
                    step.named_edge(name, names, [&corners[0].point, &corners[1].point])
                }
            };
            if let Some(edge) = edge {
                edges.insert(*index, (edge, corners));
            }
        }
        Self {
            step,
            geometry,
            edges,
        }
    }

    fn faces(&mut self, shell: &Shell) -> Vec<String> {
        shell.faces.iter().map(|face| self.face(face)).collect()
    }

    fn face(&mut self, face: &Face) -> String {
        let (surface, same_sense) = self.surface(face);
        // Rims that begin beside each other.
        let is_rim = |steps: &Vec<Step>| {
            let mut curves = steps.iter().map(|step| &self.geometry.curves[&step.curve]);
            let is_extruded = matches!(face.surface, Surface::Extruded { .. });
            curves.all(|curve| curve.ends.is_none() && (curve.arc.is_some() || is_extruded))
        };
        let is_plane = matches!(face.surface, Surface::Plane { .. });
        let loops: Vec<Vec<String>> = match &face.loops[..] {
            [first, second] if !is_plane && is_rim(first) && is_rim(second) => {
                vec![self.seamed(first, second)]
            }
            loops => loops.iter().map(|steps| self.oriented(steps)).collect(),
        };
        let mut bounds = Vec::new();
        for (place, edges) in loops.into_iter().enumerate() {
            let edges = self
                .step
                .add(&format!("EDGE_LOOP('',({}))", edges.join(",")));
            let kind = if place == 0 {
                "FACE_OUTER_BOUND"
            } else {
                "FACE_BOUND"
            };
            bounds.push(self.step.add(&format!("{kind}('',{edges},.T.)")));
        }
        let bounds = bounds.join(",");
        let sense = if same_sense { ".T." } else { ".F." };
        self.step
            .add(&format!("ADVANCED_FACE('',({bounds}),{surface},{sense})"))
    }

    /// The surface, and whether the face's normal is its own.
    fn surface(&mut self, face: &Face) -> (String, bool) {
        // Any point will do as origin, and any direction as x axis: seams begin there.
        let points = self.geometry.points(&face.loops[0][0], 0.5);
        match &face.surface {
            Surface::Plane { normal, offset } => {
                let origin = points[0] - normal * (normal.dot(&points[0]) - offset);
                let x = x_axis(normal, &(points[1] - points[0]));
                let placement = self.step.placement(&origin, normal, &x);
                (self.step.add(&format!("PLANE('',{placement})")), true)
            }
            Surface::Cylinder {
                point,
                axis,
                radius,
                convex,
            } => {
                let x = x_axis(axis, &(points[0] - point));
                let placement = self.step.placement(point, axis, &x);
                let radius = real(*radius);
                let surface = self
                    .step
                    .add(&format!("CYLINDRICAL_SURFACE('',{placement},{radius})"));
                (surface, *convex)
            }
            Surface::Cone {
                apex,
                axis,
                half_angle,
                convex,
            } => {
                let along = axis.dot(&(points[0] - apex));
                let x = x_axis(axis, &(points[0] - apex));
                let placement = self.step.placement(&(apex + axis * along), axis, &x);
                let [radius, angle] = [along.abs() * half_angle.tan(), *half_angle].map(real);
                let surface = self
                    .step
                    .add(&format!("CONICAL_SURFACE('',{placement},{radius},{angle})"));
                (surface, *convex)
            }
            Surface::Sphere {
                center,
                radius,
                convex,
            } => {
                // Around its rim: parameters of the surface end at the pole.
                let rim = self.geometry.curves[&face.loops[0][0].curve].arc;
                let axis = rim.map_or_else(Vector3::z, |rim| rim.normal());
                let x = x_axis(&axis, &(points[0] - center));
                let placement = self.step.placement(center, &axis, &x);
                let radius = real(*radius);
                let surface = self
                    .step
                    .add(&format!("SPHERICAL_SURFACE('',{placement},{radius})"));
                (surface, *convex)
            }
            Surface::Extruded { direction } => self.extruded(face, direction),
            Surface::Patch { .. } => {
                // Of one that has no numbers a point.
                let rows = self.geometry.controls_of_patch(face);
                let rows = rows.unwrap_or_else(|| vec![vec![points[0]; 4]; 4]);
                (self.step.spline_surface(&rows), true)
            }
        }
    }

    /// The surface through the first spline of a wall: its normal is on the left of the wall there.
    fn extruded(&mut self, face: &Face, direction: &Vector3<f64>) -> (String, bool) {
        let Some([one, other]) = face.rims() else {
            unreachable!("a wall is between two splines");
        };
        let spline = |step: &Step| self.geometry.curves[&step.curve].spline.as_ref();
        let height = |spline: &Spline| {
            let heights = spline.controls.iter().map(|control| direction.dot(control));
            heights.sum::<f64>() / spline.controls.len() as f64
        };
        let up = spline(&other).map(height) > spline(&one).map(height);
        let curve = spline(&one)
            .map(|spline| self.step.spline(spline))
            .unwrap_or_default();
        let along = if up { *direction } else { -direction };
        let along = self.step.vector(&along);
        let surface = format!("SURFACE_OF_LINEAR_EXTRUSION('',{curve},{along})");
        (self.step.add(&surface), !one.reversed)
    }

    fn oriented(&mut self, steps: &[Step]) -> Vec<String> {
        let mut written = Vec::with_capacity(steps.len());
        for step in steps {
            if let Some((edge, _)) = self.edges.get(&step.curve) {
                let forward = if step.reversed { ".F." } else { ".T." };
                written.push(
                    self.step
                        .add(&format!("ORIENTED_EDGE('',*,*,{edge},{forward})")),
                );
            }
        }
        written
    }

    /// A round face between two circles as one loop, cut open along a line between their vertices.
    fn seamed(&mut self, first: &[Step], second: &[Step]) -> Vec<String> {
        let corner = |steps: &[Step]| Some(self.edges.get(&steps.first()?.curve)?.1[0].clone());
        let corners = corner(first).zip(corner(second));
        let seam = corners.and_then(|(a, b)| {
            self.step
                .straight_edge([&a.name, &b.name], [&a.point, &b.point])
        });
        let mut edges = self.oriented(first);
        let along = |step: &mut Entities, forward: &str| {
            seam.as_ref()
                .map(|seam| step.add(&format!("ORIENTED_EDGE('',*,*,{seam},{forward})")))
        };
        edges.extend(along(self.step, ".T."));
        edges.extend(self.oriented(second));
        edges.extend(along(self.step, ".F."));
        edges
    }
}

/// Perpendicular to a z axis of length 1, in the direction of a point if there is one.
fn x_axis(z: &Vector3<f64>, toward: &Vector3<f64>) -> Vector3<f64> {
    let flat = toward - z * z.dot(toward);
    let apart = flat.norm() > 1e-6 * toward.norm();
    let any = Vector3::ith(z.iamin(), 1.0).cross(z);
    if apart {
        flat.normalize()
    } else {
        any.normalize()
    }
}
