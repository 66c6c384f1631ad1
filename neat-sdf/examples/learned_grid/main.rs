//! Does an encoding with learned grids beat the small perceptron of the `fast`
//! preset at equal time?
//!
//! ```text
//! cargo run --release -p neat-sdf --example learned_grid -- \
//!     [--steps N] [--seeds N] [--shape NAME]... [--field NAME]...
//!     [--evidence exact|observed] [--table-rate RATE]
//! ```
//!
//! Every field learns the distance from polyhedra with sharp edges, on one thread.
//! The present network takes `--steps` steps; the others as many as fit into the
//! same time, by their cost per step, measured in the same run in turns.
//! `docs/performance.md` has the result.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

mod candidates;
mod cost;
mod field;
mod fit;
mod grid;
mod grid_network;
mod score;
mod shape;
#[cfg(test)]
mod tests;

use candidates::Candidate;
use cost::Cost;
use fit::Evidence;
use neat_tensor::random::{Purpose, stream};
use score::Score;
use shape::Prism;

/// What the command line asks for.
struct Options {
    steps: usize,
    seeds: u64,
    shapes: Vec<String>,
    fields: Vec<String>,
    evidence: Vec<Evidence>,
    table_rate: Option<f32>,
}

impl Options {
    fn parse(
        mut arguments: impl Iterator<Item = String>,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let mut options = Self {
            steps: 1000,
            seeds: 3,
            shapes: Vec::new(),
            fields: Vec::new(),
            evidence: Vec::new(),
            table_rate: None,
        };
        while let Some(argument) = arguments.next() {
            let value = arguments
                .next()
                .ok_or(format!("{argument} lacks its value"))?;
            match argument.as_str() {
                "--steps" => options.steps = value.parse()?,
                "--seeds" => options.seeds = value.parse()?,
                "--shape" if shape::NAMES.contains(&value.as_str()) => options.shapes.push(value),
                "--field" => options.fields.push(value),
                "--evidence" if value == "exact" => options.evidence.push(Evidence::Exact),
                "--evidence" if value == "observed" => options.evidence.push(Evidence::Observed),
                "--table-rate" => options.table_rate = Some(value.parse()?),
                _ => return Err(format!("{argument} {value}: no such option").into()),
            }
        }
        if options.shapes.is_empty() {
            options.shapes = shape::NAMES.map(String::from).to_vec();
        }
        if options.evidence.is_empty() {
            options.evidence = vec![Evidence::Exact, Evidence::Observed];
        }
        Ok(options)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::parse(std::env::args().skip(1))?;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(one_thread.install(|| compare(&options))?)
}

fn compare(options: &Options) -> Result<(), String> {
    // The first is the present network, to which the others are compared.
    let mut candidates = candidates::all();
    let is_known = |name: &String| candidates.iter().any(|c| c.name == name);
    if let Some(name) = options.fields.iter().find(|name| !is_known(name)) {
        return Err(format!("--field {name}: no such field"));
    }
    candidates.retain(|c| {
        c.is_present || options.fields.is_empty() || options.fields.iter().any(|n| n == c.name)
    });
    for candidate in &mut candidates {
        candidate.rates.table = options.table_rate.unwrap_or(candidate.rates.table);
    }
    let costs = cost::measure(&mut candidates);
    print_costs(&candidates, &costs);
    for evidence in &options.evidence {
        print_scores(&mut candidates, &costs, *evidence, options);
    }
    Ok(())
}

fn print_costs(candidates: &[Candidate], costs: &[Cost]) {
    println!("Nanoseconds per sample on one thread, and how often the present network's speed:\n");
    println!("| field | parameters | distance | all outputs | backward | Adam | step |");
    println!("| --- | --: | --: | --: | --: | --: | --: |");
    for (candidate, cost) in candidates.iter().zip(costs) {
        let parameters = candidate.field.parameters();
        let cell =
            |of: fn(&Cost) -> f64| format!("{:.0} ({:.2}×)", of(cost), of(&costs[0]) / of(cost));
        println!(
            "| {} | {parameters} | {} | {} | {} | {:.0} | {} |",
            candidate.name,
            cell(|c| c.distance),
            cell(|c| c.forward),
            cell(|c| c.backward),
            cost.adam(),
            cell(|c| c.step),
        );
    }
}

fn print_scores(
    candidates: &mut [Candidate],
    costs: &[Cost],
    evidence: Evidence,
    options: &Options,
) {
    println!(
        "\n{evidence:?} distances, mean of {} seeds:\n",
        options.seeds
    );
    println!(
        "| shape | field | steps | edges | junctions | normals | eikonal | surface | wrong side |"
    );
    println!("| --- | --- | --: | --: | --: | --: | --: | --: | --: |");
    for shape in &options.shapes {
        for (candidate, cost) in candidates.iter_mut().zip(costs) {
            let steps = (options.steps as f64 * costs[0].step / cost.step).round() as usize;
            let scores: Vec<Score> = (0..options.seeds)
                .map(|seed| {
                    // The seed turns the shape, too.
                    let shape = Prism::named(shape, &mut stream(seed, Purpose::ViewOrder, 0));
                    let field = &mut *candidate.field;
                    let parameters =
                        fit::fit(field, &shape, evidence, candidate.rates, steps, seed);
                    Score::new(field, &parameters, &shape, seed)
                })
                .collect();
            let mean =
                |of: fn(&Score) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
            println!(
                "| {shape} | {} | {steps} | {:.4} | {:.4} | {:.1}° | {:.3} | {:.4} | {:.2} % |",
                candidate.name,
                mean(|s| s.edges),
                mean(|s| s.junctions),
                mean(|s| s.normals),
                mean(|s| s.eikonal),
                mean(|s| s.surface),
                100.0 * mean(|s| s.wrong_side),
            );
        }
    }
}
