//! How the fast back end scales: scenes of 100 to 2000 junctions in 50 and 100
//! views, as Markdown tables of time, memory and quality.
//!
//! ```text
//! cargo run --release -p neat-wireframe --example graph_scale -- \
//!     [JUNCTIONS VIEWS]... [--config FILE.json] [--yaw DEGREES] [--noise PIXELS] [--seed N]
//! ```
//!
//! Proposals are the truth with the noise of a trained field; see `field.rs`.
//! Every scene is also run without graph refinement: without re-triangulation
//! and bundle adjustment, and without bundle adjustment alone. Recall is against
//! what the 2D input supports: the edges that enough views show from end to end.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

mod field;
mod score;

use field::{BlockSurface, observations, proposals, supported_truth};
use neat_core::synthetic::{BlockScene, SyntheticError};
use neat_wireframe::evidence::required_views;
use neat_wireframe::fast::StepChange;
use neat_wireframe::fast::{FastBackEndConfig, run_observed};
use score::Score;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A found junction this near to a true one is right, in radii of the scene.
const TOLERANCE: f64 = 0.01;
/// Junctions of a box.
const PER_BLOCK: usize = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut config = FastBackEndConfig::default();
    let mut scene = BlockScene::default();
    let mut numbers: Vec<usize> = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or("the last option lacks its value");
        match argument.as_str() {
            "--config" => config = serde_json::from_str(&std::fs::read_to_string(value()?)?)?,
            "--yaw" => scene.max_yaw_in_degrees = value()?.parse()?,
            "--noise" => scene.noise_in_pixels = value()?.parse()?,
            "--seed" => scene.seed = value()?.parse()?,
            number => numbers.push(number.parse()?),
        }
    }
    let mut sizes: Vec<[usize; 2]> = numbers.as_chunks().0.to_vec();
    if sizes.is_empty() {
        sizes = [100, 500, 2000]
            .into_iter()
            .flat_map(|junctions| [[junctions, 50], [junctions, 100]])
            .collect();
    }
    let runs = sizes
        .into_iter()
        .map(|[junctions, views]| Runs::new(junctions, views, &scene, &config))
        .collect::<Result<Vec<_>, _>>()?;
    print_times(&runs);
    print_scores(&runs);
    print_steps(&runs);
    Ok(())
}

/// The runs on one scene.
struct Runs {
    junctions: usize,
    views: usize,
    segments: usize,
    /// Peak memory of the process after the first run, in MiB.
    peak_memory: Option<f64>,
    /// As configured by default, then with ever less refinement.
    variants: Vec<Variant>,
}

/// One run.
struct Variant {
    name: &'static str,
    steps: Vec<(StepChange, Duration)>,
    score: Score,
}

impl Runs {
    fn new(
        junctions: usize,
        views: usize,
        scene: &BlockScene,
        config: &FastBackEndConfig,
    ) -> Result<Self, SyntheticError> {
        let scene = BlockScene {
            blocks: junctions.div_ceil(PER_BLOCK),
            views,
            ..scene.clone()
        };
        let data = scene.generate()?;
        let observations = observations(&data);
        let proposals = proposals(&data, scene.seed);
        let truth = supported_truth(&data, required_views(views));
        let surface = BlockSurface(&data.blocks);
        let mut peak_memory = None;
        let variants = configurations(config)
            .into_iter()
            .map(|(name, config)| {
                let mut steps = Vec::new();
                let mut begin = cpu_time();
                let result = run_observed(
                    &observations,
                    &proposals,
                    &[],
                    &surface,
                    1.0,
                    &config,
                    &mut |step| {
                        let now = cpu_time();
                        steps.push((*step, now.saturating_sub(begin)));
                        begin = now;
                    },
                );
                peak_memory = peak_memory.or_else(peak_memory_in_mib);
                Variant {
                    name,
                    steps,
                    score: Score::new(&result.wireframe, &data.truth, &truth, TOLERANCE),
                }
            })
            .collect();
        Ok(Self {
            junctions: data.truth.junctions.len(),
            views,
            segments: observations.iter().map(|view| view.segments.len()).sum(),
            peak_memory,
            variants,
        })
    }
}

/// The configuration, and the same with ever less refinement.
fn configurations(config: &FastBackEndConfig) -> Vec<(&'static str, FastBackEndConfig)> {
    let without_adjustment = FastBackEndConfig {
        bundle_adjustment: false,
        ..config.clone()
    };
    let without_refinement = FastBackEndConfig {
        retriangulation: false,
        ..without_adjustment.clone()
    };
    vec![
        ("refined", config.clone()),
        ("without bundle adjustment", without_adjustment),
        ("without refinement", without_refinement),
    ]
}

fn print_times(runs: &[Runs]) {
    println!("Milliseconds of processor time per step:\n");
    let steps = runs.iter().find_map(|runs| runs.variants.first());
    print!("| junctions | views | 2D segments |");
    let mut rule = String::from("|--:|--:|--:|");
    for (report, _) in steps.into_iter().flat_map(|variant| &variant.steps) {
        print!(
            " {} |",
            serde_json::json!(report.step)
                .as_str()
                .unwrap_or_default()
                .replace('_', " ")
        );
        rule.push_str("--:|");
    }
    println!(" all | µs per junction and view | peak MiB |\n{rule}--:|--:|--:|");
    for run in runs {
        print!("| {} | {} | {} |", run.junctions, run.views, run.segments);
        let Some(refined) = run.variants.first() else {
            continue;
        };
        for (_, time) in &refined.steps {
            print!(" {:.0} |", 1e3 * time.as_secs_f64());
        }
        let all: f64 = refined
            .steps
            .iter()
            .map(|(_, time)| time.as_secs_f64())
            .sum();
        let memory = run
            .peak_memory
            .map_or("?".to_owned(), |mib| format!("{mib:.0}"));
        let per_item = 1e6 * all / (run.junctions * run.views) as f64;
        println!(" {:.0} | {per_item:.0} | {memory} |", 1e3 * all);
    }
}

fn print_scores(runs: &[Runs]) {
    println!("\nQuality, with junctions right within {TOLERANCE} radii:\n");
    println!(
        "| junctions | views | run | junction precision | recall | segment precision | recall \
         | median junction error |\n|--:|--:|---|--:|--:|--:|--:|--:|"
    );
    for run in runs {
        for Variant { name, score, .. } in &run.variants {
            println!(
                "| {} | {} | {name} | {:.3} | {:.3} | {:.3} | {:.3} | {:.6} |",
                run.junctions,
                run.views,
                score.junction_precision,
                score.junction_recall,
                score.edge_precision,
                score.edge_recall,
                score.median_junction_error
            );
        }
    }
}

fn print_steps(runs: &[Runs]) {
    println!("\nWhat each step added and removed:\n");
    println!(
        "| junctions | views | step | junctions | added | removed | edges | added | removed |\n\
         |--:|--:|---|--:|--:|--:|--:|--:|--:|"
    );
    for run in runs {
        for (report, _) in run.variants.first().into_iter().flat_map(|v| &v.steps) {
            println!(
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                run.junctions,
                run.views,
                serde_json::json!(report.step).as_str().unwrap_or_default(),
                report.junctions,
                report.added_junctions,
                report.removed_junctions,
                report.edges,
                report.added_edges,
                report.removed_edges
            );
        }
    }
}

/// Processor time of all threads so far, so that other programs on the machine
/// count little; in steps of 10 ms. Time since the start where that is unknown.
fn cpu_time() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    let start = START.get_or_init(Instant::now);
    ticks_on_linux().map_or_else(
        || start.elapsed(),
        |ticks| Duration::from_millis(10 * ticks),
    )
}

/// Hundredths of a second in user and in kernel mode; see proc_pid_stat(5).
fn ticks_on_linux() -> Option<u64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name of the program may hold spaces; it ends with the last bracket.
    let (_, fields) = stat.rsplit_once(')')?;
    let mut fields = fields.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<u64>().ok();
    Some(next()? + next()?)
}

/// Linux counts it; it never falls, so that only growing scenes tell something.
fn peak_memory_in_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}
