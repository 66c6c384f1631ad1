//! Matching of junctions without any field: noisy ends of segments become local
//! junctions, and each is paired with one of the global junctions.
//!
//! ```text
//! cargo run --release -p neat-gjp --example match_junctions
//! ```

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use neat_core::assignment::assign;
use neat_gjp::candidates::{MatchingNorm, matching_cost};
use neat_gjp::clustering::dbscan_means;

/// What a perceiver would have learned so far: off, and one junction too many.
const GLOBAL: [[f32; 3]; 5] = [
    [0.02, 0.01, 0.0],
    [0.97, 0.0, 0.02],
    [1.0, 1.04, 0.0],
    [0.01, 0.98, -0.02],
    [0.5, 0.5, 0.5],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Three rendered ends near each corner of a square, and one stray.
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut ends: Vec<[f32; 3]> = corners
        .iter()
        .flat_map(|[x, y]| [-0.002, 0.0, 0.003].map(|off| [x + off, y - off, off]))
        .collect();
    ends.push([0.3, 0.7, 0.1]);

    // Clusters of at least two ends become local junctions; lone ends are dropped.
    let local = dbscan_means(&ends, 0.01, 2).means;
    println!("{} ends, {} local junctions", ends.len(), local.len());

    // The cheapest pairing of local with global junctions, one to one.
    let cost = matching_cost(&local, &[], &GLOBAL, &[], 0.0, MatchingNorm::L2);
    let assignment = assign(&cost, local.len(), GLOBAL.len())?;
    for (l, g) in assignment.pairs() {
        let distance = cost[l * GLOBAL.len() + g];
        println!("local {:?} with global {g}, {distance:.3} apart", local[l]);
    }
    Ok(())
}
