//! GeoJSON (RFC 7946): a `LineString` with z per edge and one of many points per arc and per
//! spline, a `Point` per junction without edges.
//!
//! The RFC means WGS 84 longitude and latitude. Coordinates are written as they are
//! in the document instead, which programs accept when told the reference system;
//! the member `coordinate_frame` says so.

use crate::isolated::isolated_junctions;
use crate::target::Target;
use crate::{Confidence, ExportError};
use neat_wireframe::export::WireframeDocument;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Writes a GeoJSON file.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let document = to.document;
    let position = |junction: usize| document.junctions[junction].as_slice();
    let classes = Confidence::of_edges(document);
    let junction_fields = document.junction_fields.named();
    let edge_fields = document.edge_fields.named();
    let edges = document.edges.iter().enumerate().map(|(edge, [a, b])| {
        let mut properties = fields(&edge_fields, edge);
        properties.insert("edge".into(), edge.into());
        properties.insert("junctions".into(), json!([a, b]));
        properties.insert("confidence".into(), classes[edge].name().into());
        let line = json!({"type": "LineString", "coordinates": [position(*a), position(*b)]});
        feature(line, properties)
    });
    let arcs = document.arcs.iter().enumerate().map(|(index, arc)| {
        let points = arc.points(WireframeDocument::TURN_OF_DRAWN_ARCS);
        let line = json!({"type": "LineString", "coordinates": points});
        let properties = json!({
            "arc": index,
            "center": arc.center,
            "normal": arc.normal(),
            "radius": arc.radius,
        });
        json!({"type": "Feature", "geometry": line, "properties": properties})
    });
    let splines = document.splines.iter().enumerate().map(|(index, spline)| {
        let points = spline.points(WireframeDocument::TURN_OF_DRAWN_ARCS);
        let line = json!({"type": "LineString", "coordinates": points});
        let properties = json!({
            "spline": index,
            "controls": spline.controls,
            "closed": spline.closed,
        });
        json!({"type": "Feature", "geometry": line, "properties": properties})
    });
    let isolated = isolated_junctions(document).into_iter().map(|junction| {
        let mut properties = fields(&junction_fields, junction);
        properties.insert("junction".into(), junction.into());
        let point = json!({"type": "Point", "coordinates": position(junction)});
        feature(point, properties)
    });
    let collection = json!({
        "type": "FeatureCollection",
        "coordinate_frame": "the frame of the reconstructed scene, not WGS 84",
        "features": edges.chain(arcs).chain(splines).chain(isolated).collect::<Vec<_>>(),
    });
    to.write(format!("{collection}\n"))
}

fn fields(fields: &BTreeMap<String, Vec<f64>>, index: usize) -> Map<String, Value> {
    fields
        .iter()
        .map(|(name, values)| (name.clone(), values[index].into()))
        .collect()
}

fn feature(geometry: Value, properties: Map<String, Value>) -> Value {
    json!({"type": "Feature", "geometry": geometry, "properties": properties})
}
