//! `neat reconstruct`.

use super::train::RunArgs;
use crate::error::CliError;
use crate::{interrupt, output};
use clap::Args;
use neat_pipeline::config::Config;
use neat_pipeline::reconstruct::{Reconstruction, reconstruct};
use neat_wireframe::metrics::ImageEvidence;

/// Turn a scene into a 3D wireframe, and write all results
///
/// The images alone make the wireframe, in seconds; a field is trained on request.
///
/// RUN then holds report.html to open first (`neat view RUN`), the wireframe as .json, .obj and
/// .ply in the frame of the scene's files, a picture of it, overlays/ on some of the photographs,
/// and config.toml and manifest.json; after training also metrics.jsonl, junctions.jsonl and
/// checkpoints/.
///
/// Ctrl-C ends training after the current step and leaves a checkpoint (exit code 130). A wireframe
/// without edges ends with exit code 3 and says why it is empty.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat reconstruct SCENE --out RUN
  neat reconstruct SCENE --out RUN --set distill.assembler.min_evidence=6
  neat reconstruct SCENE --out RUN --train --time-budget 10m
  neat reconstruct SCENE --out RUN --preset paper-dtu --backend wgpu
  neat reconstruct SCENE --out RUN --resume            after an interrupt
  neat reconstruct SCENE --out AGAIN --config RUN/config.toml

The keys of --set are those of a run's config.toml; a wrong one lists the right ones.")]
pub struct ReconstructArgs {
    #[command(flatten)]
    run: RunArgs,
    /// Train a field too: to render it, for its mesh, or for the paper's back end
    #[arg(long)]
    train: bool,
}

impl ReconstructArgs {
    /// Finds mistakes in the configuration.
    pub fn check_configuration(&self) -> Result<(), CliError> {
        self.configured(self.run.configuration()?).map(|_| ())
    }

    fn configured(&self, config: Config) -> Result<Config, CliError> {
        match self.train {
            true => self.run.method.with_field(config),
            false => Ok(config),
        }
    }

    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let mut options = self.run.options()?;
        options.config = self.configured(options.config)?;
        let interrupted = interrupt::flag()?;
        let mut progress = self.run.progress(quiet);
        let reconstruction = reconstruct(&options, &interrupted, &mut |event| progress.show(event))
            .map_err(CliError::of_resumable)?;
        drop(progress);
        output::print(&summary(&reconstruction))?;
        not_empty(&reconstruction)
    }
}

/// Errs if there is nothing in the result: scripts have to know.
pub fn not_empty(reconstruction: &Reconstruction) -> Result<(), CliError> {
    if reconstruction.wireframe.edges.is_empty() {
        let report = reconstruction.run.report().display().to_string();
        return Err(CliError::NoEdges { report });
    }
    Ok(())
}

/// One line about the result.
pub fn summary(reconstruction: &Reconstruction) -> String {
    let wireframe = &reconstruction.wireframe;
    let mut text = format!(
        "wireframe: {} junctions, {} edges",
        wireframe.junctions.len(),
        wireframe.edges.len(),
    );
    if let Some(agreement) = &reconstruction.agreement {
        text += &in_words(agreement);
    }
    text + &format!(": {}", reconstruction.run.wireframe("json").display())
}

/// How well a wireframe agrees with the images, to follow its size; empty where there
/// are no 2D segments or none is explained.
pub fn in_words(agreement: &ImageEvidence) -> String {
    let share = agreement.explained_length_share;
    let figures = share.zip(agreement.mean_reprojection_error_in_pixels);
    figures.map_or_else(String::new, |(share, error)| {
        let percent = 100.0 * share;
        format!(", on {percent:.0} % of the length of all 2D segments, {error:.2} px off")
    })
}
