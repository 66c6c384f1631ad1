//! Configurations that contradict themselves.

use crate::config::{BatchViews, ModelConfig, TrainingConfig};
use crate::error::TrainError;
use neat_sdf::RaySamplerConfig;

/// Most samples of a step: their arrays on the host take some 50 bytes each, and
/// their indices are 32 bits wide.
const MAX_SAMPLES: usize = 1 << 26;
/// Widest layer and longest vector of features.
const MAX_WIDTH: usize = 1 << 14;
/// Most layers of a network.
const MAX_LAYERS: usize = 1 << 8;
/// Most junctions that the perceiver may have: their assignment is a matrix.
const MAX_JUNCTIONS: usize = 1 << 16;
/// Most numbers of a learned grid: a step goes through all of them several times.
const MAX_GRID_NUMBERS: usize = 1 << 26;
/// Most nodes of the sampler's grid along an axis.
const MAX_RESOLUTION: usize = 1 << 10;

impl TrainingConfig {
    /// Refuses configurations that would fail or silently ignore something.
    ///
    /// # Errors
    /// What contradicts itself, in a sentence with the names of the settings.
    pub fn validate(&self) -> Result<(), TrainError> {
        let refuse = |reason: &str| Err(TrainError::Config(reason.to_owned()));
        let (implicit, train) = (&self.model.implicit, &self.train);
        implicit.validate()?;
        self.model.rendering.encoding.validate()?;
        self.model.attraction.encoding.validate()?;
        self.model.background.encoding.validate()?;
        if implicit.octaves > 24 || self.model.attraction.octaves > 24 {
            return refuse("more than 24 octaves exceed what float32 resolves");
        }
        for (name, value, most) in sizes(self) {
            if value > most {
                return refuse(&format!(
                    "{name} is {value}; the most that neat takes is {most}"
                ));
            }
        }
        if train.rays == 0 || !(0.0..1.0).contains(&train.background_share) {
            return refuse("train.rays must be positive and train.background_share in [0, 1)");
        }
        if train.ray_chunk == Some(0) {
            return refuse("train.ray_chunk must be positive");
        }
        if train.steps == 0 {
            return refuse("train.steps must be positive");
        }
        if train.checkpoint_interval == 0 || train.kept_checkpoints == 0 {
            return refuse("train.checkpoint_interval and kept_checkpoints must be positive");
        }
        if train.checkpoint_seconds.is_nan() || train.checkpoint_seconds <= 0.0 {
            return refuse("train.checkpoint_seconds must be positive");
        }
        self.model.perceiver.validate()?;
        if self.model.background.shells == 1 {
            return refuse("model.background.shells must be 0, or 2 and more");
        }
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let density = &self.model.density;
        if !positive(density.initial_beta) || !positive(density.final_beta) {
            return refuse("model.density.initial_beta and final_beta must be positive");
        }
        if self.scene_radius.is_some_and(|r| !positive(r)) {
            return refuse("data.scene_radius must be positive");
        }
        let reach = train.surface_point_reach;
        if !(0.0..f64::INFINITY).contains(&reach) {
            return refuse("train.surface_point_reach must be 0 or more");
        }
        if train.dense_points && (train.surface_points == 0 || train.loss.points == 0.0) {
            return refuse(
                "train.dense_points needs train.surface_points and train.loss.points above 0",
            );
        }
        let rates = [
            train.learning_rate,
            train.grid_learning_rate,
            train.learning_rate_decay,
        ];
        if !rates.into_iter().all(positive) {
            return refuse(
                "train.learning_rate, grid_learning_rate and learning_rate_decay must be positive",
            );
        }
        if train.views == BatchViews::All
            && (train.loss.junction_2d > 0.0 || train.matching.weight_2d > 0.0)
        {
            return refuse(
                "train.loss.junction_2d and train.matching.weight_2d need train.views = \"one\": a junction from many views has no single image",
            );
        }
        Ok(())
    }
}

/// What memory follows from: name, value, and the most that is reasonable.
fn sizes(config: &TrainingConfig) -> Vec<(&'static str, usize, usize)> {
    let (model, train) = (&config.model, &config.train);
    let (samples, what) = match &train.sampler {
        RaySamplerConfig::ErrorBound(sampler) => {
            let refined = (sampler.samples_per_iteration).saturating_mul(sampler.max_iterations);
            let drawn = (sampler.samples).saturating_add(sampler.extra_samples);
            let samples = refined.max(drawn.saturating_add(2));
            (samples, "train.rays times the samples of train.sampler")
        }
        RaySamplerConfig::GridCached(sampler) => {
            let drawn = (sampler.importance_samples).saturating_add(sampler.uniform_samples);
            let samples = sampler.lookups.max(drawn);
            (samples, "train.rays times the samples of train.sampler")
        }
        RaySamplerConfig::Uniform(sampler) => {
            (sampler.samples, "train.rays times train.sampler.samples")
        }
    };
    let resolution = match &train.sampler {
        RaySamplerConfig::GridCached(sampler) => sampler.resolution,
        RaySamplerConfig::ErrorBound(_) | RaySamplerConfig::Uniform(_) => 0,
    };
    let uniform_points = train.eikonal.uniform_points.unwrap_or(0);
    let junctions = model.perceiver.junctions.fixed().unwrap_or(0);
    let (implicit, rendering, attraction) = (&model.implicit, &model.rendering, &model.attraction);
    let background = &model.background;
    let mut sizes = grid_sizes(model).to_vec();
    sizes.extend([
        (what, train.rays.saturating_mul(samples.max(1)), MAX_SAMPLES),
        (
            "train.rays times model.background.shells",
            train.rays.saturating_mul(background.shells),
            MAX_SAMPLES,
        ),
        ("train.sampler.resolution", resolution, MAX_RESOLUTION),
        ("train.eikonal.uniform_points", uniform_points, MAX_SAMPLES),
        ("train.surface_points", train.surface_points, MAX_SAMPLES),
        ("model.perceiver.junctions", junctions, MAX_JUNCTIONS),
        ("model.perceiver.width", model.perceiver.width, MAX_WIDTH),
        ("model.implicit.width", implicit.width, MAX_WIDTH),
        ("model.background.width", background.width, MAX_WIDTH),
        (
            "model.background.hidden_layers",
            background.hidden_layers,
            MAX_LAYERS,
        ),
        ("model.implicit.features", implicit.features, MAX_WIDTH),
        (
            "model.implicit.hidden_layers",
            implicit.hidden_layers,
            MAX_LAYERS,
        ),
        ("model.rendering.width", rendering.width, MAX_WIDTH),
        (
            "model.rendering.hidden_layers",
            rendering.hidden_layers,
            MAX_LAYERS,
        ),
        ("model.attraction.width", attraction.width, MAX_WIDTH),
        (
            "model.attraction.hidden_layers",
            attraction.hidden_layers,
            MAX_LAYERS,
        ),
    ]);
    sizes
}

/// Numbers that are learned in grids.
fn grid_sizes(model: &ModelConfig) -> [(&'static str, usize, usize); 4] {
    let encodings = [
        (
            "the size of the grids of model.implicit.encoding",
            &model.implicit.encoding,
        ),
        (
            "the size of the grids of model.rendering.encoding",
            &model.rendering.encoding,
        ),
        (
            "the size of the grids of model.attraction.encoding",
            &model.attraction.encoding,
        ),
        (
            "the size of the grids of model.background.encoding",
            &model.background.encoding,
        ),
    ];
    encodings.map(|(name, encoding)| (name, encoding.parameters(), MAX_GRID_NUMBERS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_gjp::JunctionCount;
    use neat_tensor::{GridConfig, PointEncoding};

    fn refusal(change: impl Fn(&mut TrainingConfig)) -> String {
        let mut config = TrainingConfig::default();
        change(&mut config);
        let result = config.validate();
        result.map_or_else(|error| error.to_string(), |()| String::new())
    }

    #[test]
    fn sizes_beyond_any_machine_are_refused_by_name() {
        let huge = 100_000_000_000;
        let rays = refusal(|config| config.train.rays = huge);
        assert!(rays.contains("train.rays times the samples"), "{rays}");
        let most = refusal(|config| config.train.rays = usize::MAX);
        assert!(most.contains("67108864"), "{most}");
        let width = refusal(|config| config.model.implicit.width = huge);
        assert!(
            width.contains("model.implicit.width is 100000000000"),
            "{width}"
        );
        let layers = refusal(|config| config.model.attraction.hidden_layers = huge);
        assert!(
            layers.contains("model.attraction.hidden_layers"),
            "{layers}"
        );
        let points = refusal(|config| config.train.eikonal.uniform_points = Some(huge));
        assert!(points.contains("train.eikonal.uniform_points"), "{points}");
        let junctions = refusal(|config| {
            config.model.perceiver.junctions = JunctionCount::Fixed(huge);
        });
        assert!(
            junctions.contains("model.perceiver.junctions"),
            "{junctions}"
        );
        let huge = PointEncoding::Grid(GridConfig {
            levels: 32,
            features: 8,
            log2_entries: 20,
            coarsest: 256,
            finest: 2048,
        });
        let grid = refusal(|config| {
            config.model.implicit.skip_layer = 0;
            config.model.implicit.encoding = huge.clone();
        });
        assert!(grid.contains("grids of model.implicit.encoding"), "{grid}");
        let grid = refusal(|config| config.model.rendering.encoding = huge.clone());
        assert!(grid.contains("grids of model.rendering.encoding"), "{grid}");
        let grid = refusal(|config| config.model.attraction.encoding = huge.clone());
        assert!(
            grid.contains("grids of model.attraction.encoding"),
            "{grid}"
        );
    }

    #[test]
    fn points_that_nobody_asks_are_refused() {
        for reach in [-0.1, f64::NAN, f64::INFINITY] {
            let refused = refusal(|config| config.train.surface_point_reach = reach);
            assert!(refused.contains("surface_point_reach"), "{refused}");
        }
        let dense = |count: usize, weight: f64| {
            refusal(|config| {
                config.train.dense_points = true;
                config.train.surface_points = count;
                config.train.loss.points = weight;
            })
        };
        assert!(dense(0, 1.0).contains("needs train.surface_points"));
        assert!(dense(8, 0.0).contains("needs train.surface_points"));
        assert_eq!(dense(8, 1.0), "");
    }

    #[test]
    fn grids_that_cannot_be_are_refused_in_every_network() {
        let odd = PointEncoding::Grid(GridConfig {
            features: 3,
            ..GridConfig::default()
        });
        let changes: [fn(&mut TrainingConfig, PointEncoding); 3] = [
            |config, odd| config.model.rendering.encoding = odd,
            |config, odd| config.model.attraction.encoding = odd,
            |config, odd| config.model.background.encoding = odd,
        ];
        for change in changes {
            let refused = refusal(|config| change(config, odd.clone()));
            assert!(refused.contains("1, 2, 4 or 8 features"), "{refused}");
        }
    }
}
