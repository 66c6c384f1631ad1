//! `neat bench`.

use crate::arguments::{BackendArg, positive, preset_parser};
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use clap::Args;
use neat_lab::benchmark::benchmark;
use neat_pipeline::config::Preset;
use neat_pipeline::event::Event;
use neat_pipeline::reconstruct::software_warning;

/// Time the parts of a training step against the machine's arithmetic
///
/// Trains each preset on a synthetic scene, made on the spot, and prints for every part of a
/// step its time, the floating-point operations that it cannot avoid, and how fast they were
/// done: in GFLOP/s and as a share of the yardstick, a large float32 matrix product on the same
/// backend in the same run. Results of different machines compare through that share.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat bench --preset fast
  neat bench --preset fast,paper-abc --backend wgpu --seconds 20
  neat bench --preset fast --plain        what fused operations gain
  neat bench --json > bench.json          to keep and to compare

The paper's presets take 10 seconds a step or more on two CPU threads, and 8 GB of memory with
--plain; each is measured for one step at least. Do nothing else on the machine meanwhile: the
report says if the yardstick changed.")]
pub struct BenchArgs {
    /// Presets to measure; may be repeated
    #[arg(
        long,
        value_name = "NAME,NAME,...",
        value_delimiter = ',',
        default_value = "fast,paper-abc,paper-dtu",
        value_parser = preset_parser()
    )]
    preset: Vec<Preset>,
    #[command(flatten)]
    backend: BackendArg,
    /// Measure each preset for so many seconds, one step at least
    #[arg(long, value_name = "S", value_parser = positive, default_value_t = 5.0)]
    seconds: f64,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
    /// Turn fused operations off: measure the same networks as plain tensor operations
    #[arg(long)]
    plain: bool,
}

impl BenchArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let backend = self.backend.backend.resolve();
        let device = backend.device()?;
        let mut progress = Progress::new(quiet);
        if let Some(warning) = software_warning(&device) {
            progress.show(Event::Warning(warning));
        }
        let measured = benchmark(
            backend,
            &device,
            &self.preset,
            self.seconds,
            self.plain,
            &mut |part, fraction| progress.show_part(part, fraction),
        )?;
        drop(progress);
        if self.json {
            let json = serde_json::to_string_pretty(&measured).map_err(std::io::Error::from)?;
            output::print(&json)
        } else {
            output::print(&measured.to_markdown())
        }
    }
}
