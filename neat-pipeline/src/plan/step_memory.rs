//! What one step of a training takes, by its configuration.

use crate::config::Config;
use neat_core::MemoryLimit;
use neat_sdf::RaySamplerConfig;
use neat_train::config::TrainConfig;
use neat_train::flops::StepRows;

/// Share of the samples whose weight matters, where others are left out.
const SAMPLES_THAT_MATTER: f64 = 0.16;
/// VolSDF's sampler asks for this many batches of distances per ray, usually.
const SAMPLER_BATCHES: usize = 2;
/// Bytes kept for the backward pass, per full sample and unit of width.
const BYTES_PER_UNIT: f64 = 96.0;

/// Bytes that are kept of each ray for the backward pass.
pub fn bytes_per_ray(config: &Config) -> f64 {
    let rows = rows_of_step(&config.train);
    let rows_per_ray = rows.full as f64 / config.train.rays as f64;
    rows_per_ray * config.model.implicit.width as f64 * BYTES_PER_UNIT
}

/// Rays per pass, and why, if what is kept of all rays of a step for the backward pass
/// would not fit into half of `limit`; `None` if it does.
pub(super) fn ray_chunk(config: &Config, limit: MemoryLimit) -> Option<(usize, String)> {
    let rays = config.train.rays;
    let each = bytes_per_ray(config);
    let chunk = limit.at_once(each as u64);
    (chunk < rays).then(|| {
        let gib = rays as f64 * each / 1024f64.powi(3);
        let reason = format!(
            "as all {rays} rays of a step at once would take {gib:.1} GiB, more than half of the memory limit"
        );
        (chunk, reason)
    })
}

/// Rows that one step sends through the networks, by the configuration.
pub fn rows_of_step(train: &TrainConfig) -> StepRows {
    let (per_ray, sampler) = match &train.sampler {
        RaySamplerConfig::ErrorBound(sampler) => (
            sampler.samples + sampler.extra_samples + 2,
            train.rays * SAMPLER_BATCHES * sampler.samples_per_iteration,
        ),
        RaySamplerConfig::GridCached(sampler) => {
            let nodes = sampler.resolution.pow(3) / sampler.refresh_stride.max(1);
            let per_step = nodes as f64 / sampler.refresh_interval.max(1) as f64;
            let per_ray = sampler.importance_samples + sampler.uniform_samples;
            let first = if sampler.redraw { per_ray } else { 0 };
            (per_ray, per_step as usize + train.rays * first)
        }
        RaySamplerConfig::Uniform(sampler) => (sampler.samples, 0),
    };
    let samples = train.rays * per_ray;
    let full = match train.min_sample_weight {
        None => samples,
        Some(_) => (SAMPLES_THAT_MATTER * samples as f64) as usize,
    };
    let own_points = train.eikonal.uniform_points.unwrap_or(train.rays);
    let on_rays = if train.eikonal.one_sample_per_ray {
        train.rays
    } else {
        0
    };
    StepRows {
        sampler,
        samples,
        full,
        segment: ((1.0 - train.background_share) * full as f64) as usize,
        eikonal: own_points + on_rays,
        // How many rays leave the scene is not known before.
        background: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;

    #[test]
    fn rows_are_those_that_the_benchmark_counts() {
        let paper = rows_of_step(&Preset::PaperAbc.config().train);
        assert_eq!(paper.sampler, 262_144);
        assert_eq!([paper.samples, paper.full, paper.segment], [100_352; 3]);
        assert_eq!(paper.eikonal, 2048);
        // Which samples matter depends on the scene.
        let fast = rows_of_step(&Preset::Fast.config().train);
        assert_eq!(
            [fast.samples, fast.sampler, fast.eikonal],
            [3072, 1728, 256]
        );
        assert!((400..600).contains(&fast.full), "{}", fast.full);
    }

    #[test]
    fn steps_that_do_not_fit_are_taken_in_passes() {
        let passes = |preset: Preset, limit| ray_chunk(&preset.config(), limit).map(|(n, _)| n);
        let gib = |count: u64| MemoryLimit::of_bytes(count << 30);
        assert_eq!(passes(Preset::PaperAbc, gib(16)), None);
        assert_eq!(passes(Preset::PaperAbc, MemoryLimit::NONE), None);
        assert_eq!(passes(Preset::Fast, gib(1)), None);
        // 2.3 GiB of 1024 rays: half of the limit holds somewhat less than half of them.
        let (chunk, reason) = ray_chunk(&Preset::PaperAbc.config(), gib(2)).unwrap();
        assert!((350..512).contains(&chunk), "{chunk}");
        assert!(reason.contains("2.3 GiB"), "{reason}");
        assert_eq!(passes(Preset::PaperAbc, MemoryLimit::of_bytes(1)), Some(1));
    }
}
