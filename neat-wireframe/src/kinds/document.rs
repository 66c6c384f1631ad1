//! Kinds in `wireframe.json`.

use super::{EdgeKinds, JunctionType};
use crate::export::WireframeDocument;

/// Writes the kinds of edges and the types of junctions into a document of the same wireframe.
///
/// # Panics
/// If the document is of another wireframe.
pub fn fill_kinds(
    document: &mut WireframeDocument,
    edges: &[EdgeKinds],
    junctions: &[JunctionType],
) {
    assert_eq!(
        [document.junctions.len(), document.edges.len()],
        [junctions.len(), edges.len()],
        "fill_kinds: the document is of another wireframe"
    );
    let of = |kind: fn(&EdgeKinds) -> f64| Some(edges.iter().map(kind).collect());
    let fields = &mut document.edge_fields;
    fields.boundary = of(|kinds| kinds.boundary);
    fields.crease = of(|kinds| kinds.crease);
    fields.shadow = of(|kinds| kinds.shadow);
    fields.texture = of(|kinds| kinds.texture);
    let types = junctions.iter().map(|of| *of as usize).collect();
    document.junction_fields.junction_type = Some(types);
}
