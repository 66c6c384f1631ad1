//! Which backend `auto` is for a run.

use crate::config::Config;
use crate::plan::rows_of_step;
use neat_tensor::Backend;
use neat_train::flops::StepFlops;

/// Operations below which a step is faster on a CPU. On an H100 a step takes 34 ms even of the
/// smallest networks, the time to launch its kernels; fused on two CPU threads 3·10⁹ operations
/// take as long, on sixteen 15·10⁹ (docs/benchmarks.md). Steps of the presets are below 10⁹ or
/// beyond 10¹².
const LEAST_FOR_A_GPU: f64 = 1e10;

/// Whether a CPU is faster than any GPU in a training by `config`.
pub(super) fn is_too_little_for_a_gpu(config: &Config) -> bool {
    let rows = rows_of_step(&config.train);
    StepFlops::count(&config.model, &rows).total() < LEAST_FOR_A_GPU
}

/// The backend for a training by `config`, and for its field: never [`Backend::Auto`].
pub fn backend_for(asked: Backend, config: &Config) -> Backend {
    if asked == Backend::Auto && is_too_little_for_a_gpu(config) {
        asked.resolve_on_host()
    } else {
        asked.resolve()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;

    #[test]
    fn only_published_sizes_are_for_a_gpu() {
        for preset in Preset::ALL {
            let is_published = preset.name().starts_with("paper");
            let is_little = is_too_little_for_a_gpu(&preset.config());
            assert_eq!(is_little, !is_published, "{preset}");
        }
    }
}
