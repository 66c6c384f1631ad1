//! `neat compare-backends`.

use crate::arguments::{MethodArgs, backend_parser};
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use clap::Args;
use neat_core::{MemoryLimit, file};
use neat_lab::compare_backends::compare_backends;
use neat_pipeline::event::Event;
use neat_pipeline::plan::{Machine, settle};
use neat_pipeline::reconstruct::software_warning;
use neat_pipeline::resources::{Resources, default_limit};
use neat_pipeline::run_dir::RunDir;
use neat_pipeline::scene::prepare_scene;
use neat_tensor::{Backend, Kernels};
use std::path::PathBuf;

/// Enough to see the speed; losses of different backends drift apart later anyway.
const DEFAULT_STEPS: u64 = 50;

/// Run the same steps with the same seed on every backend of this machine
///
/// Prints a table of how fast each one is and how far its losses are from the first one's.
/// OUT then holds comparison.md and comparison.json. Without --steps each backend takes the
/// first 50 steps of the configuration.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat compare-backends SCENE
  neat compare-backends SCENE --out OUT --backends flex,wgpu --steps 200")]
pub struct CompareBackendsArgs {
    /// Folder of the scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for the table; it must be new or empty
    #[arg(long, value_name = "OUT", default_value = "backend-comparison")]
    out: PathBuf,
    /// Replace an earlier table in that folder
    #[arg(long)]
    overwrite: bool,
    /// Backends to run instead of all that there are
    #[arg(long, value_name = "NAME,NAME,...", value_delimiter = ',', value_parser = backend_parser())]
    backends: Vec<Backend>,
    /// Run each backend once more in plain tensor operations, without kernels of its own
    #[arg(long)]
    plain: bool,
    #[command(flatten)]
    method: MethodArgs,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    cache: CacheArgs,
}

impl CompareBackendsArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let existing = super::train::existing(self.overwrite);
        RunDir::check(&self.out, existing)?;
        let asked = self.method.config()?;
        let backends = if self.backends.is_empty() {
            Backend::available()
        } else {
            self.backends
        };
        let mut progress = Progress::new(quiet);
        for backend in &backends {
            if let Some(warning) = software_warning(&backend.device()?) {
                progress.show(Event::Warning(warning));
            }
        }
        let cache = self.cache.open();
        let resources = Resources {
            cache: cache.as_ref(),
            memory_limit: default_limit(),
            ..Resources::default()
        };
        let on_event = &mut |event: Event<'_>| progress.show(event);
        let scene = prepare_scene(&self.scene, &asked, None, resources, on_event)?.scene;
        let machine = Machine {
            backend: Backend::Flex,
            // Every backend takes a step at once.
            memory_limit: MemoryLimit::NONE,
        };
        let (plan, decisions) = settle(&asked, &scene, machine, None)?;
        for decision in decisions {
            on_event(Event::Decided(decision));
        }
        file::create_dir(&self.out)?;
        let comparison = compare_backends(
            &scene,
            &plan.config().training(Kernels::default()),
            self.seed,
            self.method.steps.unwrap_or(DEFAULT_STEPS),
            &backends,
            self.plain,
            &mut |part, fraction| progress.show_part(part, fraction),
        )?;
        drop(progress);
        let table = comparison.to_markdown();
        let json = serde_json::to_vec_pretty(&comparison).map_err(std::io::Error::from)?;
        file::write_atomically(&self.out.join("comparison.json"), &json)?;
        file::write_atomically(&self.out.join("comparison.md"), table.as_bytes())?;
        output::print(&table)
    }
}
