//! Two labels for things of which neighbours had rather have the same one.

use pathfinding::directed::edmonds_karp::edmonds_karp_sparse;
use std::collections::{BTreeMap, BTreeSet};

/// Capacities are whole numbers of this part of a nat, so that the result is exact.
const UNIT: f64 = 1e-6;

/// Those that are chosen: the sum of their `gains` less the `costs` of pairs of which one is
/// chosen is greatest (Greig, Porteous & Seheult 1989). Both in nats, costs not negative.
pub(super) fn chosen(
    gains: &BTreeMap<usize, f64>,
    costs: &BTreeMap<[usize; 2], f64>,
) -> BTreeSet<usize> {
    let capacity = |nats: f64| (nats.min(1e9) / UNIT).round() as i64;
    let (source, sink) = (usize::MAX, usize::MAX - 1);
    let mut nodes: Vec<usize> = gains.keys().copied().collect();
    nodes.extend([source, sink]);
    let to_ends = gains.iter().map(|(node, gain)| match *gain > 0.0 {
        true => ((source, *node), capacity(*gain)),
        false => ((*node, sink), capacity(-gain)),
    });
    let both_ways = (costs.iter())
        .flat_map(|([a, b], cost)| [((*a, *b), capacity(*cost)), ((*b, *a), capacity(*cost))]);
    let edges: Vec<_> = to_ends.chain(both_ways).filter(|(_, c)| *c > 0).collect();
    let (_, _, cut) = edmonds_karp_sparse(&nodes, &source, &sink, edges.iter().copied());
    let cut: BTreeSet<(usize, usize)> = cut.into_iter().map(|(ends, _)| ends).collect();
    let mut following: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (ends, _) in edges.iter().filter(|(ends, _)| !cut.contains(ends)) {
        following.entry(ends.0).or_default().push(ends.1);
    }
    let mut reached = BTreeSet::from([source]);
    let mut open = vec![source];
    while let Some(node) = open.pop() {
        for next in following.get(&node).into_iter().flatten() {
            if reached.insert(*next) {
                open.push(*next);
            }
        }
    }
    reached.remove(&source);
    reached
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_chosen_together_as_far_as_it_pays() {
        let gains = BTreeMap::from([(0, 5.0), (1, -1.0), (2, 4.0), (3, -9.0), (4, 2.0)]);
        let chain = (0..4).map(|k| ([k, k + 1], 3.0));
        let costs: BTreeMap<[usize; 2], f64> = chain.collect();
        let worth = |set: &BTreeSet<usize>| {
            let gain: f64 = set.iter().map(|k| gains[k]).sum();
            let cut = |[a, b]: &&[usize; 2]| set.contains(a) != set.contains(b);
            gain - 3.0 * costs.keys().filter(cut).count() as f64
        };
        let all = (0..32_usize).map(|bits| (0..5).filter(|k| bits >> k & 1 == 1).collect());
        let best = all.max_by(|a, b| worth(a).total_cmp(&worth(b))).unwrap();
        assert_eq!(chosen(&gains, &costs), best);
        assert_eq!(best, BTreeSet::from([0, 1, 2]));
        assert!(chosen(&BTreeMap::new(), &BTreeMap::new()).is_empty());
    }
}
