//! Clusters of a weighted graph (Felzenszwalb and Huttenlocher, *Efficient
//! graph-based image segmentation*, 2004).

/// A link between two nodes; the smaller the weight, the more alike they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Link {
    /// Two different nodes.
    pub nodes: [usize; 2],
    /// Difference of the two, finite.
    pub weight: f64,
}

/// The cluster of every node, named by its smallest member.
///
/// Clusters join where the link between them is no weaker than the weakest within
/// each, plus `scale` divided by its number of nodes.
pub(super) fn segment_graph(nodes: usize, mut links: Vec<Link>, scale: f64) -> Vec<usize> {
    links.sort_by(|a, b| a.weight.total_cmp(&b.weight).then(a.nodes.cmp(&b.nodes)));
    let mut clusters = Clusters {
        parent: (0..nodes).collect(),
        size: vec![1; nodes],
        weakest: vec![0.0; nodes],
    };
    for Link { nodes, weight } in links {
        let [a, b] = nodes.map(|node| clusters.root(node));
        let limit = |c: usize| clusters.weakest[c] + scale / clusters.size[c] as f64;
        if a != b && weight <= limit(a).min(limit(b)) {
            let (root, other) = (a.min(b), a.max(b));
            clusters.parent[other] = root;
            clusters.size[root] += clusters.size[other];
            // Links come in ascending order.
            clusters.weakest[root] = weight;
        }
    }
    (0..nodes).map(|node| clusters.root(node)).collect()
}

struct Clusters {
    parent: Vec<usize>,
    size: Vec<usize>,
    /// Largest weight of the links that made each cluster.
    weakest: Vec<f64>,
}

impl Clusters {
    fn root(&mut self, mut node: usize) -> usize {
        while self.parent[node] != node {
            self.parent[node] = self.parent[self.parent[node]];
            node = self.parent[node];
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strong_links_join_and_weak_ones_between_large_clusters_do_not() {
        let link = |a, b, weight| Link {
            nodes: [a, b],
            weight,
        };
        // Two chains of four, tied weakly, and one node alone.
        let links = vec![
            link(3, 4, 0.7),
            link(0, 1, 0.1),
            link(1, 2, 0.1),
            link(2, 3, 0.1),
            link(4, 5, 0.2),
            link(5, 6, 0.2),
            link(6, 7, 0.2),
        ];
        let found = segment_graph(9, links.clone(), 1.0);
        assert_eq!(found, [0, 0, 0, 0, 4, 4, 4, 4, 8]);
        let coarse = segment_graph(9, links, 10.0);
        assert_eq!(coarse, [0, 0, 0, 0, 0, 0, 0, 0, 8]);
        assert!(segment_graph(0, Vec::new(), 1.0).is_empty());
    }
}
