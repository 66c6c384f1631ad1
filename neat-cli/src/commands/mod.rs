//! The command line, and one file per subcommand.

mod ablate;
mod baseline;
mod batch;
mod bench;
mod compare_backends;
mod completions;
mod convert;
mod demo;
mod detect;
mod distill;
mod doctor;
mod eval;
mod export;
mod info;
mod man;
mod measure;
mod reconstruct;
mod render;
mod synth;
mod train;
mod view;

use crate::error::CliError;
use crate::{interrupt, output, threads, version};
use clap::{Parser, Subcommand};

/// Turns posed photographs and their 2D wireframes into one 3D wireframe.
#[derive(Debug, Parser)]
#[command(
    name = "neat",
    version,
    long_version = version::long(),
    arg_required_else_help = true,
    after_help = "\
Start here:
  neat demo --out demo                   make a scene, reconstruct it, and measure the result
  neat info SCENE                        what is in a folder of photographs
  neat reconstruct SCENE --out RUN       from the photographs to RUN/wireframe.json
  neat view RUN                          the result in your browser
  neat eval --pred RUN/wireframe.json --gt SCENE/gt_wireframe.json

Exit codes:
  0    done
  1    the run failed
  2    the arguments or the input cannot be used
  130  interrupted: Ctrl-C (or SIGTERM, or a terminal that is closed) ends a run after the
       current step and leaves a checkpoint; the same command with --resume goes on; a second
       Ctrl-C ends at once"
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Say nothing but results, warnings and errors
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Use so many CPU threads instead of all, four per core at most; results do not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl Cli {
    /// Does what was asked for.
    pub fn run(self) -> Result<(), CliError> {
        output::init_log();
        interrupt::survive_limits()?;
        threads::start(self.threads)?;
        self.command.run(self.quiet)
    }

    /// Finds mistakes in the configuration of a reconstruction.
    pub fn check_configuration(&self) -> Result<(), CliError> {
        match &self.command {
            Command::Reconstruct(args) => args.check_configuration(),
            _ => Ok(()),
        }
    }
}

/// What neat can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    Reconstruct(reconstruct::ReconstructArgs),
    Batch(batch::BatchArgs),
    Train(train::TrainArgs),
    Distill(distill::DistillArgs),
    View(view::ViewArgs),
    Export(export::ExportArgs),
    Measure(measure::MeasureArgs),
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
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
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
            Self::Measure(args) => args.run(),
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
            Self::Completions(args) => args.run(),
            Self::Man(args) => args.run(),
        }
    }
}
