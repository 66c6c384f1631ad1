//! What a training will take on this machine, before it is begun: counted
//! arithmetic over the measured speed of a matrix product.

use crate::benchmark::matrix_product_rate;
use burn::tensor::Device;
use neat_core::Scene;
use neat_pipeline::config::Config;
use neat_pipeline::plan::{bytes_per_ray, rows_of_step};
use neat_train::flops::StepFlops;
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
/// The program with its networks and their moments.
const BASE_BYTES: f64 = 60.0 * 1024.0 * 1024.0;
/// Bytes per number of a learned grid: itself, its gradient, two moments, and the copies
/// that the kernels and the optimiser make, each a float32.
const BYTES_PER_GRID_NUMBER: f64 = 4.0 * 8.0;

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
    let rows = rows_of_step(&config.train);
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
    let model = &config.model;
    let grids = [
        &model.implicit.encoding,
        &model.rendering.encoding,
        &model.attraction.encoding,
    ];
    let in_grids: usize = grids.map(|encoding| encoding.parameters()).iter().sum();
    let grid_bytes = in_grids as f64 * BYTES_PER_GRID_NUMBER;
    Estimate {
        seconds: config.train.steps as f64 * flops / (speed * 1e9 * share),
        bytes: BASE_BYTES
            + grid_bytes
            + image_bytes as f64
            + at_once as f64 * bytes_per_ray(config),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::synthetic::{SyntheticScene, generate};
    use neat_pipeline::config::Preset;

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
}
