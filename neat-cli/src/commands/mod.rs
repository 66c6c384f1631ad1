//! One file per subcommand.

mod ablate;
mod baseline;
mod batch;
mod bench;
mod compare_backends;
mod convert;
mod demo;
mod detect;
mod distill;
mod doctor;
mod eval;
mod export;
mod info;
mod reconstruct;
mod render;
mod synth;
mod train;
mod view;

use crate::error::CliError;
use clap::Subcommand;

/// What neat can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    Reconstruct(reconstruct::ReconstructArgs),
    Batch(batch::BatchArgs),
    Train(train::TrainArgs),
    Distill(distill::DistillArgs),
    View(view::ViewArgs),
    Export(export::ExportArgs),
    Eval(eval::EvalArgs),
    Render(render::RenderArgs),
    Synth(synth::SynthArgs),
    Info(info::InfoArgs),
    Doctor(doctor::DoctorArgs),
    Detect(detect::DetectArgs),
    Convert(convert::ConvertArgs),
    Demo(demo::DemoArgs),
    CompareBackends(compare_backends::CompareBackendsArgs),
    Bench(bench::BenchArgs),
    Ablate(ablate::AblateArgs),
    Baseline(baseline::BaselineArgs),
}

impl Command {
    /// Does what was asked for.
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        match self {
            Self::Reconstruct(args) => args.run(quiet),
            Self::Batch(args) => args.run(quiet),
            Self::Train(args) => args.run(quiet),
            Self::Distill(args) => args.run(quiet),
            Self::View(args) => args.run(),
            Self::Export(args) => args.run(quiet),
            Self::Eval(args) => args.run(),
            Self::Render(args) => args.run(quiet),
            Self::Synth(args) => args.run(),
            Self::Info(args) => args.run(),
            Self::Doctor(args) => args.run(),
            Self::Detect(args) => args.run(quiet),
            Self::Convert(args) => args.run(),
            Self::Demo(args) => args.run(quiet),
            Self::CompareBackends(args) => args.run(quiet),
            Self::Bench(args) => args.run(quiet),
            Self::Ablate(args) => args.run(quiet),
            Self::Baseline(args) => args.run(quiet),
        }
    }
}
