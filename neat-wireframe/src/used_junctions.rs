//! The junctions that edges name, and their indices once the others are gone.

/// Which junctions have edges.
pub(crate) struct UsedJunctions {
    is_used: Vec<bool>,
    new_index: Vec<usize>,
}

impl UsedJunctions {
    /// Of `count` junctions those that `edges` name.
    ///
    /// # Panics
    /// If an edge names a junction that does not exist.
    pub(crate) fn new<'a>(count: usize, edges: impl Iterator<Item = &'a [usize; 2]>) -> Self {
        let mut is_used = vec![false; count];
        edges.flatten().for_each(|end| is_used[*end] = true);
        let mut used = 0;
        let new_index = is_used
            .iter()
            .map(|is_used| {
                let index = used;
                used += usize::from(*is_used);
                index
            })
            .collect();
        Self { is_used, new_index }
    }

    /// Drops the items of junctions without edges; the order of the others stays.
    pub(crate) fn retain<T>(&self, items: &mut Vec<T>) {
        let mut marks = self.is_used.iter();
        items.retain(|_| marks.next().copied().unwrap_or(false));
    }

    /// An edge between the junctions that stay.
    pub(crate) fn renamed(&self, edge: [usize; 2]) -> [usize; 2] {
        edge.map(|junction| self.new_index[junction])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_keeps_its_order_and_edges_follow() {
        let edges = [[4, 1], [1, 2]];
        let used = UsedJunctions::new(5, edges.iter());
        let mut names = vec!['a', 'b', 'c', 'd', 'e'];
        used.retain(&mut names);
        assert_eq!(names, ['b', 'c', 'e']);
        assert_eq!(edges.map(|edge| used.renamed(edge)), [[2, 0], [0, 1]]);
    }
}
