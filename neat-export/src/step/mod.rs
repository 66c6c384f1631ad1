//! STEP (ISO 10303-21) by AP214: solids and sheets of the faces, and an edge-based wireframe of
//! what bounds no face.
//!
//! A closed shell is a `MANIFOLD_SOLID_BREP`, another a `SHELL_BASED_SURFACE_MODEL`. Every junction
//! of the wireframe is one `VERTEX_POINT`, which its `EDGE_CURVE`s share. Arcs are `EDGE_CURVE`s of
//! `CIRCLE`s and splines those of `B_SPLINE_CURVE_WITH_KNOTS` between vertices of their own; what is
//! closed begins and ends at one. Open CASCADE joins the edges of a `CONNECTED_EDGE_SET` to one wire and moves vertices where
//! more than two edges meet; so every edge is a set of its own, and its reader keeps
//! positions and shared vertices.

mod entities;
mod shells;

use crate::ExportError;
use crate::target::Target;
use entities::{Entities, clamped_controls, string};
use nalgebra::Vector3;
use neat_core::{CircularArc, Spline};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{CurveIndex, Shell};
use std::collections::BTreeSet;

/// Writes a STEP file.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let document = to.document;
    let mut step = Entities::default();
    let context = step.add("APPLICATION_CONTEXT('automotive design')");
    step.add(&format!(
        "APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,{context})"
    ));
    let shape = step.product(&string(to.title()), &context);
    let geometry = step.geometric_context(to.options.unit);
    let placement = step.placement(&Vector3::zeros(), &Vector3::z(), &Vector3::x());

    let mut representations = shells::representations(&mut step, document, [&placement, &geometry]);
    let (sets, flaws) = edge_sets(&mut step, document);
    if !sets.is_empty() {
        let model = step.add(&format!(
            "EDGE_BASED_WIREFRAME_MODEL('',({}))",
            sets.join(",")
        ));
        representations.push(step.add(&format!(
            "EDGE_BASED_WIREFRAME_SHAPE_REPRESENTATION('',({placement},{model}),{geometry})"
        )));
    }
    // The shape of the product is a place, to which all that there is of it is related: so readers
    // expect what is of several kinds.
    let main = match &representations[..] {
        [only] => only.clone(),
        _ => step.add(&format!(
            "SHAPE_REPRESENTATION('',({placement}),{geometry})"
        )),
    };
    step.add(&format!("SHAPE_DEFINITION_REPRESENTATION({shape},{main})"));
    for part in representations.iter().filter(|part| **part != main) {
        step.add(&format!(
            "SHAPE_REPRESENTATION_RELATIONSHIP('','',{main},{part})"
        ));
    }
    for (count, what) in flaws {
        to.leave_out(count, &format!("a STEP wireframe has no {what}"));
    }
    to.write(step.file())
}

/// What is left out, and how often.
type Flaws = [(usize, &'static str); 3];

/// The edges, arcs and splines that bound no face, each a set of its own, and what they lack: a line
/// needs a direction, and a vertex an edge.
fn edge_sets(step: &mut Entities, document: &WireframeDocument) -> (Vec<String>, Flaws) {
    let bounding: BTreeSet<CurveIndex> = document.shells.iter().flat_map(Shell::curves).collect();
    let mut lonely = vec![true; document.junctions.len()];
    let mut loose = Vec::new();
    for (index, ends) in document.edges.iter().enumerate() {
        if bounding.contains(&CurveIndex::Edge(index)) {
            ends.iter().for_each(|end| lonely[*end] = false);
        } else {
            loose.push(*ends);
        }
    }
    // Those of faces are written with these.
    let joined: BTreeSet<usize> = loose.iter().flatten().copied().collect();
    let vertices: Vec<Option<String>> = (document.junctions.iter().enumerate())
        .map(|(index, junction)| {
            (joined.contains(&index) || lonely[index]).then(|| step.vertex(junction))
        })
        .collect();
    let mut sets = Vec::new();
    for [a, b] in &loose {
        let [Some(from), Some(to)] = [&vertices[*a], &vertices[*b]] else {
            continue;
        };
        let points = [&document.junctions[*a], &document.junctions[*b]];
        if let Some(edge) = step.straight_edge([from, to], points) {
            sets.push(step.add(&format!("CONNECTED_EDGE_SET('',({edge}))")));
            (lonely[*a], lonely[*b]) = (false, false);
        }
    }
    let lines = sets.len();
    let free = (document.arcs.iter().enumerate())
        .filter(|(index, _)| !bounding.contains(&CurveIndex::Arc(*index)));
    let free: Vec<&CircularArc> = free.map(|(_, arc)| arc).collect();
    sets.extend(free.iter().filter_map(|arc| arc_set(step, arc)));
    let flaws = [
        (loose.len() - lines, "edges without length"),
        (
            lonely.iter().filter(|lonely| **lonely).count(),
            "junctions without edges",
        ),
        (free.len() - (sets.len() - lines), "arcs without length"),
    ];
    let free = (document.splines.iter().enumerate())
        .filter(|(index, _)| !bounding.contains(&CurveIndex::Spline(*index)));
    sets.extend(free.map(|(_, spline)| spline_set(step, spline)));
    (sets, flaws)
}

/// An arc as a set of its own; `None` if its ends are the same numbers.
fn arc_set(step: &mut Entities, arc: &CircularArc) -> Option<String> {
    let [start, end] = arc.angles.map(|angle| arc.point_at(angle));
    if start == end && !arc.is_closed() {
        return None;
    }
    let from = step.vertex(&start);
    let to = if arc.is_closed() {
        from.clone()
    } else {
        step.vertex(&end)
    };
    let edge = step.arc_edge("", [&from, &to], arc);
    Some(step.add(&format!("CONNECTED_EDGE_SET('',({edge}))")))
}

/// A spline as a set of its own.
fn spline_set(step: &mut Entities, spline: &Spline) -> String {
    let controls = clamped_controls(spline);
    let (start, end) = (&controls[0], &controls[controls.len() - 1]);
    let from = step.vertex(start);
    let to = if start == end {
        from.clone()
    } else {
        step.vertex(end)
    };
    let edge = step.spline_edge([&from, &to], spline);
    step.add(&format!("CONNECTED_EDGE_SET('',({edge}))"))
}
