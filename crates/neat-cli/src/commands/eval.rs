//! `neat eval`.

use crate::arguments::positive;
use crate::error::CliError;
use crate::output;
use clap::{Args, ValueEnum};
use neat_core::ground_truth::read_wireframe;
use neat_core::point_cloud::read_ply;
use neat_pipeline::demo::write_evaluation;
use neat_wireframe::metrics::{EvaluationConfig, Matching};
use std::path::PathBuf;

/// Measure a wireframe against the truth, or against a point cloud
///
/// Prints precision and recall of junctions and of segments (by the larger and by the mean
/// distance of their ends) at every threshold, and with --points the mean distance to the
/// cloud (ACC). Everything must be in one frame and unit.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat eval --pred RUN/wireframe.json --gt SCENE/gt_wireframe.json
  neat eval --pred RUN/wireframe.json --points scan.ply --json scores.json

Both files are JSON with `junctions` [[x, y, z], ...] and `edges` or `lines` [[i, j], ...].")]
pub struct EvalArgs {
    /// Wireframe to measure
    #[arg(long, value_name = "FILE")]
    pred: PathBuf,
    /// True wireframe
    #[arg(long, value_name = "FILE", required_unless_present = "points")]
    gt: Option<PathBuf>,
    /// Points on the true surface, as PLY
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Distances at which precision and recall are taken, in the unit of the files
    #[arg(long, value_name = "D,D,...", value_delimiter = ',', value_parser = positive, default_value = "0.01,0.02,0.05")]
    thresholds: Vec<f64>,
    /// How predictions are paired with the truth
    #[arg(long, value_enum, default_value_t)]
    matching: MatchingArg,
    /// Distances to the cloud that are this long or longer are ignored
    #[arg(long, value_name = "D", value_parser = positive, default_value_t = EvaluationConfig::default().max_surface_distance)]
    max_distance: f64,
    /// Write all numbers to this file too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How predictions are paired with the truth.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum MatchingArg {
    /// One pairing with the smallest sum of distances, as in the published evaluation
    #[default]
    MinimumSum,
    /// The largest pairing at each threshold
    PerThreshold,
}

impl From<MatchingArg> for Matching {
    fn from(matching: MatchingArg) -> Self {
        match matching {
            MatchingArg::MinimumSum => Self::MinimumSum,
            MatchingArg::PerThreshold => Self::PerThreshold,
        }
    }
}

impl EvalArgs {
    pub fn run(self) -> Result<(), CliError> {
        let predicted = read_wireframe(&self.pred)?;
        let truth = self.gt.as_deref().map(read_wireframe).transpose()?;
        let surface = self.points.as_deref().map(read_ply).transpose()?;
        let config = EvaluationConfig {
            thresholds: self.thresholds,
            matching: self.matching.into(),
            max_surface_distance: self.max_distance,
            ..EvaluationConfig::default()
        };
        let evaluation = config.evaluate(&predicted, truth.as_ref(), surface.as_deref())?;
        if let Some(path) = &self.json {
            write_evaluation(path, &evaluation)?;
        }
        output::print(&evaluation.to_markdown())
    }
}
