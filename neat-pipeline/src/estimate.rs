//! What a training will take on this machine, before it is begun: counted
//! arithmetic over the measured speed of a matrix product.

use crate::benchmark::matrix_product_rate;
use crate::config::Config;
use crate::event::{Event, OnEvent};
use burn::tensor::Device;
use neat_core::{MemoryLimit, Scene};
use neat_sdf::RaySamplerConfig;
use neat_train::flops::{StepFlops, StepRows};
use serde::Serialize;

/// Side of the matrices whose product tells the speed: a few hundredths of a
/// second.
const SIDE: usize = 1024;
/// Shares of that speed that training reaches on a CPU, with wide and with narrow
/// networks (`neat bench`, docs/performance.md).
const WIDE_SHARE: f64 = 0.87;
const NARROW_SHARE: f64 = 0.40;
/// Networks of this width are wide.
const WIDE: usize = 128;
/// Share of the samples whose weight matters, where others are left out.
const SAMPLES_THAT_MATTER: f64 = 0.16;
/// VolSDF's sampler asks for this many batches of distances per ray, usually.
const SAMPLER_BATCHES: usize = 2;
/// Bytes kept for the backward pass, per full sample and unit of width.
const BYTES_PER_UNIT: f64 = 96.0;
/// The program with its networks and their moments.
const BASE_BYTES: f64 = 60.0 * 1024.0 * 1024.0;

/// Time and memory of a training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Seconds of all steps.
    pub seconds: f64,
    /// Largest memory, in bytes.
    pub bytes: f64,
}

/// GFLOP/s of a matrix product on `device`, measured now.
pub fn speed(device: &Device) -> f64 {
    matrix_product_rate(SIDE, device)
}

/// What training `config` on `scene` takes where a matrix product runs at `speed`
/// GFLOP/s. Within a factor of two on an idle CPU.
pub fn estimate(config: &Config, scene: &Scene, speed: f64) -> Estimate {
    let rows = rows_of_step(config);
    let flops = StepFlops::count(&config.model, &rows).total();
    let width = config.model.implicit.width;
    let share = if width >= WIDE {
        WIDE_SHARE
    } else {
        NARROW_SHARE
    };
    // Training shares the images of the scene; some may lie in a file.
    let in_memory = (scene.views.iter()).filter(|view| !view.image.is_in_file());
    let image_bytes: u64 = in_memory.map(|view| view.image.byte_len()).sum();
    let rays = config.train.rays;
    let at_once = config.train.ray_chunk.map_or(rays, |chunk| chunk.min(rays));
    Estimate {
        seconds: config.train.steps as f64 * flops / (speed * 1e9 * share),
        bytes: BASE_BYTES + image_bytes as f64 + at_once as f64 * bytes_per_ray(config, &rows),
    }
}

/// Bytes kept for the backward pass, per ray.
fn bytes_per_ray(config: &Config, rows: &StepRows) -> f64 {
    let rows_per_ray = rows.full as f64 / config.train.rays as f64;
    rows_per_ray * config.model.implicit.width as f64 * BYTES_PER_UNIT
}

/// Takes the rays of a step in several passes if what is kept of all of them for the
/// backward pass would not fit into half of `limit`, unless `config` has decided
/// `train.ray_chunk` already. For backends whose numbers are in this memory.
pub(crate) fn fit_memory(config: &mut Config, limit: MemoryLimit, on_event: OnEvent<'_>) {
    let rays = config.train.rays;
    if config.train.ray_chunk.is_some() || rays == 0 {
        return;
    }
    let each = bytes_per_ray(config, &rows_of_step(config));
    let chunk = limit.at_once(each as u64);
    if chunk < rays {
        config.train.ray_chunk = Some(chunk);
        on_event(Event::Note(format!(
            "train.ray_chunk = {chunk}: all {rays} rays of a step at once would take {:.1} GiB, more than half of the memory limit",
            rays as f64 * each / 1024f64.powi(3)
        )));
    }
}

/// Rows that one step sends through the networks, by the configuration.
fn rows_of_step(config: &Config) -> StepRows {
    let train = &config.train;
    let (per_ray, sampler) = match &train.sampler {
        RaySamplerConfig::ErrorBound(sampler) => (
            sampler.samples + sampler.extra_samples + 2,
            train.rays * SAMPLER_BATCHES * sampler.samples_per_iteration,
        ),
        RaySamplerConfig::GridCached(sampler) => {
            let nodes = sampler.resolution.pow(3) / sampler.refresh_stride.max(1);
            let per_step = nodes as f64 / sampler.refresh_interval.max(1) as f64;
            (
                sampler.importance_samples + sampler.uniform_samples,
                per_step as usize,
            )
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use neat_core::synthetic::{SyntheticScene, generate};

    #[test]
    fn rows_are_those_that_the_benchmark_counts() {
        let paper = rows_of_step(&Preset::PaperAbc.config());
        assert_eq!(paper.sampler, 262_144);
        assert_eq!([paper.samples, paper.full, paper.segment], [100_352; 3]);
        assert_eq!(paper.eikonal, 2048);
        // Which samples matter depends on the scene.
        let fast = rows_of_step(&Preset::Fast.config());
        assert_eq!(
            [fast.samples, fast.sampler, fast.eikonal],
            [3072, 1728, 256]
        );
        assert!((400..600).contains(&fast.full), "{}", fast.full);
    }

    #[test]
    fn estimates_agree_with_what_was_measured() {
        let scene = generate(&SyntheticScene {
            views: 2,
            image_size: 64,
            ..SyntheticScene::default()
        });
        let scene = scene.unwrap().scene;
        let mut config = Preset::PaperAbc.config();
        config.train.steps = 1;
        // docs/performance.md: 7.0 to 7.4 s at 183 to 187 GFLOP/s, 2.46 GiB.
        let paper = estimate(&config, &scene, 185.0);
        assert!((6.0..9.0).contains(&paper.seconds), "{paper:?}");
        let gib = paper.bytes / 1024f64.powi(3);
        assert!((2.0..3.0).contains(&gib), "{paper:?}");
        // 6.0 to 7.1 s for a thousand steps.
        let fast = estimate(&Preset::Fast.config(), &scene, 185.0);
        assert!((4.0..10.0).contains(&fast.seconds), "{fast:?}");
        config.train.ray_chunk = Some(256);
        assert!(estimate(&config, &scene, 185.0).bytes < 0.5 * paper.bytes);
    }

    #[test]
    fn steps_that_do_not_fit_are_taken_in_passes_if_nobody_has_decided() {
        let fitted = |preset: Preset, limit: MemoryLimit, given: Option<usize>| {
            let mut config = preset.config();
            config.train.ray_chunk = given;
            let mut notes = 0;
            fit_memory(&mut config, limit, &mut |event| {
                notes += usize::from(matches!(event, Event::Note(_)));
            });
            (config.train.ray_chunk, notes)
        };
        let gib = |count: u64| MemoryLimit::of_bytes(count << 30);
        assert_eq!(fitted(Preset::PaperAbc, gib(16), None), (None, 0));
        assert_eq!(fitted(Preset::PaperAbc, MemoryLimit::NONE, None), (None, 0));
        assert_eq!(fitted(Preset::Fast, gib(1), None), (None, 0));
        assert_eq!(fitted(Preset::PaperAbc, gib(2), Some(999)), (Some(999), 0));
        // 2.3 GiB of 1024 rays: half of the limit holds somewhat less than half of them.
        let (Some(chunk), 1) = fitted(Preset::PaperAbc, gib(2), None) else {
            panic!("a chunk and a note");
        };
        assert!((350..512).contains(&chunk), "{chunk}");
        assert_eq!(
            fitted(Preset::PaperAbc, MemoryLimit::of_bytes(1), None),
            (Some(1), 1)
        );
    }
}
