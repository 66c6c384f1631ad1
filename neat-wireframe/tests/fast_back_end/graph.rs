//! Comparison of a result with the truth.

use neat_wireframe::Wireframe3d;
use neat_wireframe::fast::FastBackEndResult;

/// Asserts that the result is the true graph: the junctions one to one,
/// each within `tolerance`, and the same edges.
pub fn assert_is_the_graph(truth: &Wireframe3d, result: &FastBackEndResult, tolerance: f64) {
    let found = &result.wireframe;
    assert_eq!(found.junctions.len(), truth.junctions.len(), "{result:?}");
    let name: Vec<usize> = found
        .junctions
        .iter()
        .map(|junction| {
            let nearest = truth
                .junctions
                .iter()
                .position(|true_junction| (true_junction - junction).norm() < tolerance);
            nearest.unwrap_or_else(|| panic!("{junction} is near no true junction: {result:?}"))
        })
        .collect();
    let sorted = |edges: &[[usize; 2]]| {
        let mut edges: Vec<_> = edges.iter().map(|[a, b]| [*a.min(b), *a.max(b)]).collect();
        edges.sort_unstable();
        edges
    };
    let named: Vec<_> = found
        .edges
        .iter()
        .map(|e| e.map(|junction| name[junction]))
        .collect();
    assert_eq!(sorted(&named), sorted(&truth.edges), "{:?}", result.report);
    assert_eq!(found.edges, sorted(&found.edges));
    assert_eq!(result.edges.len(), found.edges.len());
}
