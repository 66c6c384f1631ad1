//! Configurations by name.

use super::Config;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use toml::{Table, Value};

/// A named configuration to start from.
///
/// ```
/// use neat_pipeline::config::Preset;
///
/// let preset: Preset = "fast".parse()?;
/// assert!(preset.config().train.steps > 0);
/// # Ok::<(), neat_pipeline::config::UnknownPreset>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The published code on ABC objects.
    PaperAbc,
    /// The published code on DTU scans.
    PaperDtu,
    /// The published code on BlendedMVS scenes.
    PaperBlendedmvs,
    /// Small networks, rays of all views and a back end of our own: minutes on a
    /// CPU.
    #[default]
    Fast,
    /// The method whole: a field with learned grids says which 2D segments show one edge.
    Neat,
    /// Larger networks and more rays on top of `fast`: a surface and renderings of
    /// large scenes that can be used, in minutes on a CPU.
    Balanced,
}

/// A name that is no preset's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown preset `{0}`; use one of paper-abc, paper-dtu, paper-blendedmvs, fast, neat, balanced"
)]
pub struct UnknownPreset(String);

impl Preset {
    /// Every preset.
    pub const ALL: [Self; 6] = [
        Self::PaperAbc,
        Self::PaperDtu,
        Self::PaperBlendedmvs,
        Self::Fast,
        Self::Neat,
        Self::Balanced,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::PaperAbc => "paper-abc",
            Self::PaperDtu => "paper-dtu",
            Self::PaperBlendedmvs => "paper-blendedmvs",
            Self::Fast => "fast",
            Self::Neat => "neat",
            Self::Balanced => "balanced",
        }
    }

    /// Its configuration files, with comments that say where the values are from;
    /// later ones lie on top of earlier ones.
    fn layers(self) -> &'static [&'static str] {
        const PAPER: &str = include_str!("../../presets/paper.toml");
        const FAST: &str = include_str!("../../presets/fast.toml");
        match self {
            Self::PaperAbc => &[PAPER, include_str!("../../presets/paper-abc.toml")],
            Self::PaperDtu => &[PAPER, include_str!("../../presets/paper-dtu.toml")],
            Self::PaperBlendedmvs => &[PAPER, include_str!("../../presets/paper-blendedmvs.toml")],
            Self::Fast => &[FAST],
            Self::Neat => &[FAST, include_str!("../../presets/neat.toml")],
            Self::Balanced => &[FAST, include_str!("../../presets/balanced.toml")],
        }
    }

    /// Its configuration.
    pub fn config(self) -> Config {
        // The files are part of the program, and a test reads them all.
        let broken = |error: toml::de::Error| -> ! {
            panic!("Preset::config: {self} does not parse: {error}")
        };
        let mut tree = Table::new();
        for layer in self.layers() {
            let table = layer.parse().unwrap_or_else(|error| broken(error));
            lay_over(&mut tree, table);
        }
        tree.try_into().unwrap_or_else(|error| broken(error))
    }
}

/// Puts the values of `layer` into `tree`, table by table.
fn lay_over(tree: &mut Table, layer: Table) {
    for (key, value) in layer {
        match (tree.get_mut(&key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => lay_over(below, above),
            (_, value) => {
                tree.insert(key, value);
            }
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Self, UnknownPreset> {
        Self::ALL
            .into_iter()
            .find(|preset| preset.name() == name)
            .ok_or_else(|| UnknownPreset(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Choice, DataConfig, FieldUse, Partners, apply_overrides};
    use crate::plan::settle_field_use;
    use neat_detect::DetectorConfig;
    use neat_gjp::JunctionCount;
    use neat_tensor::Kernels;
    use neat_train::config::TrainingConfig;
    use neat_wireframe::assemble::AssembleConfig;
    use neat_wireframe::confidence::ConfidenceConfig;

    /// Who makes wireframes without presets, as a page in a browser, has these.
    #[test]
    fn defaults_of_the_parts_are_those_of_the_default_preset() {
        let config = Preset::default().config();
        assert_eq!(config.data, DataConfig::default());
        assert_eq!(config.detect, DetectorConfig::default());
        assert_eq!(config.distill.assembler, AssembleConfig::default());
        assert_eq!(config.distill.confidence, ConfidenceConfig::default());
    }

    #[test]
    fn every_preset_survives_the_way_to_disk_and_back() {
        for preset in Preset::ALL {
            let config = preset.config();
            let text = toml::to_string_pretty(&config).unwrap();
            assert_eq!(toml::from_str::<Config>(&text).unwrap(), config, "{preset}");
            // Setting what is already set changes nothing, optional values included.
            let steps = format!("train.steps={}", config.train.steps);
            assert_eq!(
                apply_overrides(&config, &[steps]).unwrap(),
                config,
                "{preset}"
            );
            assert_eq!(preset.name().parse(), Ok(preset));
        }
        let message = "fats".parse::<Preset>().unwrap_err().to_string();
        assert!(message.contains("`fats`") && message.contains("paper-dtu"));
    }

    #[test]
    fn the_default_of_training_is_the_published_one() {
        let (preset, default) = (
            Preset::PaperAbc.config().training(Kernels::default()),
            TrainingConfig::default(),
        );
        assert_eq!((preset.model, preset.train), (default.model, default.train));
        assert_eq!(preset.attraction_distance, default.attraction_distance);
        assert_eq!(preset.scene_radius, default.scene_radius);
    }

    #[test]
    fn presets_are_accepted() {
        for preset in Preset::ALL {
            let mut config = preset.config().training(Kernels::default());
            // "auto" is decided by the scene.
            config.model.perceiver.junctions = JunctionCount::Fixed(1024);
            config.validate().unwrap();
        }
    }

    #[test]
    fn published_presets_follow_the_published_code() {
        for preset in [Preset::PaperAbc, Preset::PaperDtu, Preset::PaperBlendedmvs] {
            let train = preset.config().train;
            assert_eq!(train.rays, 1024, "{preset}");
            assert_eq!(train.min_sample_weight, None, "{preset}");
            let loss = train.loss;
            let weights = [
                loss.rgb,
                loss.eikonal,
                loss.mask,
                loss.segment,
                loss.junction_3d,
                loss.junction_2d,
            ];
            assert_eq!(weights, [1.0, 0.1, 0.0, 0.01, 0.1, 0.01], "{preset}");
        }
    }

    #[test]
    fn the_balanced_preset_is_the_fast_one_in_a_larger_size() {
        let (fast, balanced) = (Preset::Fast.config(), Preset::Balanced.config());
        assert!(balanced.model.implicit.width > fast.model.implicit.width);
        assert!(balanced.train.steps > fast.train.steps);
        assert_eq!(balanced.model.perceiver.junctions, JunctionCount::AUTO);
        // What its file does not name is as it was.
        assert_eq!(balanced.data, fast.data);
        assert_eq!(balanced.distill.back_end, fast.distill.back_end);
        assert_eq!(balanced.distill.field, Choice::Given(FieldUse::Trained));
        assert_eq!(balanced.train.loss, fast.train.loss);
        assert_eq!(balanced.train.adam, fast.train.adam);
    }

    #[test]
    fn the_neat_preset_asks_its_field_for_partners() {
        let config = Preset::Neat.config();
        assert_eq!(config.distill.partners, Partners::Field);
        assert_eq!(config.distill.field, Choice::Auto);
        assert_eq!(
            settle_field_use(&config.distill).unwrap(),
            FieldUse::Trained
        );
        assert!(config.model.attraction.encoding.grid().is_some());
        assert!(config.model.background.encoding.grid().is_some());
        // And its own back end, if it is asked for that, fits junctions to the images.
        assert!(config.distill.paper.image_refinement.enabled);
        let published = Preset::PaperAbc.config().distill.paper;
        assert!(!published.image_refinement.enabled);
    }

    #[test]
    fn the_fast_preset_leaves_out_what_the_published_code_has() {
        let config = Preset::Fast.config();
        assert_eq!(config.data.scene_radius, None);
        assert_eq!(config.model.implicit.skip_layer, 0);
        assert_eq!(config.model.implicit.bounding_sphere_slope, 0.0);
    }
}
