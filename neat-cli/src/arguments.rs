//! Arguments that several commands share.

use crate::duration;
use crate::error::CliError;
use crate::memory::MemoryArgs;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use neat_pipeline::config::{
    Choice, Config, FieldUse, LineDetector, Preset, apply_overrides, contradicted,
};
use neat_pipeline::run_dir::parse_config;
use neat_tensor::Backend;
use std::path::PathBuf;
use std::time::Duration;

/// The method, its numbers and its seed.
#[derive(Debug, Args)]
pub struct MethodArgs {
    /// Configuration to start from [default: fast]
    #[arg(long, value_name = "NAME", value_parser = preset_parser())]
    preset: Option<Preset>,
    /// Configuration file to start from instead of a preset, such as a run's config.toml
    #[arg(long, value_name = "FILE", conflicts_with = "preset")]
    config: Option<PathBuf>,
    /// Change one value of the configuration, such as train.rays=512; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// What finds the 2D segments of scenes that come without, the same as --set
    /// detect.detector=NAME
    #[arg(long, value_name = "NAME")]
    detector: Option<Detector>,
    /// Number of training steps, the same as --set train.steps=N
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub steps: Option<u64>,
}

impl MethodArgs {
    /// Whether a configuration to start from was given.
    pub fn has_base(&self) -> bool {
        self.preset.is_some() || self.config.is_some()
    }

    /// The configuration: a preset or a file, with everything that was set.
    pub fn config(&self) -> Result<Config, CliError> {
        let base = match &self.config {
            Some(path) => parse_config(path)?,
            None => self.preset.unwrap_or_default().config(),
        };
        self.apply(&base)
    }

    /// `base` with everything that was set.
    pub fn apply(&self, base: &Config) -> Result<Config, CliError> {
        let mut config = apply_overrides(base, &self.set)?;
        if let Some(detector) = self.detector {
            config.detect.detector = detector.into();
            self.check(&config, &detector.option())?;
        }
        if let Some(steps) = self.steps {
            config.train.steps = steps;
            self.check(&config, &format!("--steps {steps}"))?;
        }
        Ok(config)
    }

    /// `config` with a field, as `--train` says.
    pub fn with_field(&self, mut config: Config) -> Result<Config, CliError> {
        config.distill.field = Choice::Given(FieldUse::Trained);
        self.check(&config, "--train")?;
        Ok(config)
    }

    /// Refuses a `--set` that `option`, which changed `config`, contradicts.
    pub fn check(&self, config: &Config, option: &str) -> Result<(), CliError> {
        check_overrides(config, &self.set, option)
    }

    /// What the configuration starts from, in words.
    pub fn name(&self) -> String {
        match &self.config {
            Some(path) => path.display().to_string(),
            None => self.preset.unwrap_or_default().to_string(),
        }
    }
}

/// Refuses one of `overrides` that `option`, which changed `config` after them, contradicts.
pub fn check_overrides(
    config: &Config,
    overrides: &[String],
    option: &str,
) -> Result<(), CliError> {
    contradicted(config, overrides)?.map_or(Ok(()), |set| {
        let text = format!("{option} and --set {set}: give one of them");
        Err(CliError::Usage(text))
    })
}

/// What computes, and for how long.
#[derive(Debug, Args)]
pub struct ComputeArgs {
    #[command(flatten)]
    pub backend: BackendArg,
    /// End training after this long (90s, 10m, 1h30m) if its steps are not done before; the
    /// learning rate follows
    #[arg(long, value_name = "TIME", value_parser = duration::parse)]
    pub time_budget: Option<Duration>,
    #[command(flatten)]
    pub memory: MemoryArgs,
}

/// What computes.
#[derive(Clone, Copy, Debug, Args)]
pub struct BackendArg {
    /// What computes: a GPU (wgpu), the CPU (flex, ndarray), or the best there is (auto)
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = backend_parser())]
    pub backend: Backend,
}

/// Takes the name of a preset.
pub fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    PossibleValuesParser::new(Preset::ALL.map(Preset::name)).try_map(|name| name.parse::<Preset>())
}

/// What finds 2D segments.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Detector {
    /// The built-in detector
    Own,
    /// The built-in detector, advised by M-LSD; in programs built with --features onnx, with the
    /// weights that scripts/fetch_mlsd.sh fetches
    Mlsd,
}

impl Detector {
    /// The option that asks for it.
    pub fn option(self) -> String {
        let value = self.to_possible_value();
        let name = value.as_ref().map_or("", PossibleValue::get_name);
        format!("--detector {name}")
    }
}

impl From<Detector> for LineDetector {
    fn from(detector: Detector) -> Self {
        match detector {
            Detector::Own => Self::Own,
            Detector::Mlsd => Self::Mlsd,
        }
    }
}

/// Takes the name of a backend.
pub fn backend_parser() -> impl TypedValueParser<Value = Backend> {
    PossibleValuesParser::new(["auto", "flex", "ndarray", "wgpu"])
        .try_map(|name| name.parse::<Backend>())
}

/// Takes a number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("must be a number above 0".to_owned()),
    }
}
