//! `neat distill`.

use super::reconstruct::{not_empty, summary};
use crate::arguments::BackendArg;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::memory::MemoryArgs;
use crate::output;
use crate::progress::Progress;
use clap::Args;
use neat_pipeline::config::apply_overrides;
use neat_pipeline::reconstruct::{distill_run, open_run};
use neat_pipeline::resources::Resources;
use std::path::PathBuf;

/// Take the wireframe out of a trained run, and write all results
///
/// The wireframe files, the pictures and the report in RUN are replaced.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat distill RUN
  neat distill RUN --set distill.back_end=paper
  neat distill RUN --scene MOVED")]
pub struct DistillArgs {
    /// Folder of the run
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Folder of the scene, if it is not where the run found it
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Change one value of the configuration, such as distill.back_end=paper; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    backend: BackendArg,
    #[command(flatten)]
    memory: MemoryArgs,
    #[command(flatten)]
    cache: CacheArgs,
}

impl DistillArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let mut progress = Progress::new(quiet);
        let opened = open_run(
            &self.run,
            self.scene.as_deref(),
            self.backend.backend,
            Resources {
                cache: self.cache.open().as_ref(),
                memory_limit: self.memory.limit(),
                cancelled: None,
            },
            |config| Ok::<_, CliError>(apply_overrides(&config, &self.set)?),
            &mut |event| progress.show(event),
        )?;
        let reconstruction = distill_run(opened, &mut |event| progress.show(event))?;
        drop(progress);
        output::print(&summary(&reconstruction))?;
        not_empty(&reconstruction)
    }
}
