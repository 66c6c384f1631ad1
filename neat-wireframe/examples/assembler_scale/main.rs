//! How the assembler scales: boxes with 100 to 2000 junctions in 50 and 100 views, as a
//! Markdown table of time, memory and quality.
//!
//! ```text
//! cargo run --release -p neat-wireframe --example assembler_scale -- [JUNCTIONS VIEWS]...
//! ```
//!
//! There are no images: 2D segments with half a pixel of noise, gaps and false ones stand for
//! the edgels. Recall is against what the 2D input supports: the edges that enough views show
//! from end to end.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

mod block_scene;
mod block_visibility;
mod blocks;
mod score;

use block_scene::{BlockData, BlockScene};
use neat_core::Wireframe3d;
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{AssembleConfig, assemble};
use neat_wireframe::metrics::required_views;
use score::Score;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// A found junction this near to a true one is right, in radii of the scene.
const TOLERANCE: f64 = 0.01;
/// Junctions of a box.
const PER_BLOCK: usize = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<usize> = (std::env::args().skip(1))
        .map(|number| number.parse())
        .collect::<Result<_, _>>()?;
    let mut sizes = numbers.as_chunks().0.to_vec();
    if sizes.is_empty() {
        let of = |junctions| [[junctions, 50], [junctions, 100]];
        sizes = [100, 500, 2000].into_iter().flat_map(of).collect();
    }
    println!(
        "| junctions | views | 2D segments | seconds | µs per 2D segment | peak MiB | junctions P / R \
         | segments P / R | median junction error |\n|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    );
    for [junctions, views] in sizes {
        let scene = BlockScene {
            blocks: junctions.div_ceil(PER_BLOCK),
            views,
            ..BlockScene::default()
        };
        let data = scene.generate();
        let observations = observations(&data);
        let segments: usize = observations.iter().map(|view| view.segments.len()).sum();
        let start = Instant::now();
        let built = assemble(&observations, &[], 1.0, &AssembleConfig::default());
        let seconds = start.elapsed().as_secs_f64();
        let supported = supported_truth(&data, required_views(views));
        let score = Score::new(&built.wireframe, &data.truth, &supported, TOLERANCE);
        println!(
            "| {} | {views} | {segments} | {seconds:.1} | {:.0} | {:.0} | {:.3} / {:.3} | {:.3} / {:.3} | {:.6} |",
            data.truth.junctions.len(),
            1e6 * seconds / segments as f64,
            peak_memory_in_mib().unwrap_or(f64::NAN),
            score.junction_precision,
            score.junction_recall,
            score.edge_precision,
            score.edge_recall,
            score.median_junction_error
        );
    }
    Ok(())
}

fn observations(data: &BlockData) -> Vec<ViewObservation> {
    (data.views.iter())
        .map(|view| ViewObservation {
            camera: view.camera,
            segments: view.segments.clone(),
            junctions: Vec::new(),
        })
        .collect()
}

/// The true wireframe without the edges that fewer than `required_views` show
/// from end to end: what the 2D input supports.
fn supported_truth(data: &BlockData, required_views: usize) -> Wireframe3d {
    let mut views = vec![0; data.truth.edges.len()];
    let sources = data.views.iter().flat_map(|view| &view.sources).flatten();
    for source in sources {
        views[source.edge] += usize::from(source.is_whole);
    }
    let kept: Vec<usize> = (0..views.len())
        .filter(|edge| views[*edge] >= required_views)
        .collect();
    let ends: BTreeSet<usize> = (kept.iter())
        .flat_map(|edge| data.truth.edges[*edge])
        .collect();
    let new_index: BTreeMap<usize, usize> = ends.iter().copied().zip(0..).collect();
    let renamed = |edge: &usize| data.truth.edges[*edge].map(|end| new_index[&end]);
    Wireframe3d {
        junctions: ends.iter().map(|end| data.truth.junctions[*end]).collect(),
        edges: kept.iter().map(renamed).collect(),
    }
}

/// Linux counts it; it never falls, so that only growing scenes tell something.
fn peak_memory_in_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}
