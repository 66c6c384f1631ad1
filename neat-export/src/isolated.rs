//! Junctions that no edge joins.

use neat_wireframe::export::WireframeDocument;

/// Indices of the junctions that no edge joins, ascending.
pub fn isolated_junctions(document: &WireframeDocument) -> Vec<usize> {
    let mut joined = vec![false; document.junctions.len()];
    for end in document.edges.iter().flatten() {
        joined[*end] = true;
    }
    (0..joined.len()).filter(|i| !joined[*i]).collect()
}
