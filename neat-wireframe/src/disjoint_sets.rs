//! Things that turn out to be one.

/// Disjoint sets of the numbers below a count.
pub(crate) struct DisjointSets(Vec<usize>);

impl DisjointSets {
    /// Every number by itself.
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// The smallest member of the set that a number is in.
    pub(crate) fn first(&self, mut member: usize) -> usize {
        while self.0[member] != member {
            member = self.0[member];
        }
        member
    }

    /// Makes the sets of two numbers one.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [self.first(a), self.first(b)];
        self.0[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_stands_for_all_that_were_joined() {
        let mut sets = DisjointSets::new(5);
        sets.join(4, 3);
        sets.join(1, 4);
        sets.join(3, 1);
        let first: Vec<usize> = (0..5).map(|i| sets.first(i)).collect();
        assert_eq!(first, [0, 1, 2, 1, 1]);
    }
}
