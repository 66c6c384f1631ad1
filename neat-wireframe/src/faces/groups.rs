//! What hangs together.

use pathfinding::undirected::connected_components::components;

/// The connected components of what each list joins, their members and themselves in ascending
/// order: the library's own order differs from run to run.
pub(super) fn groups(joined: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = (components(joined).into_iter())
        .map(|group| group.into_iter().collect())
        .collect();
    groups.iter_mut().for_each(|group| group.sort_unstable());
    groups.sort();
    groups
}
