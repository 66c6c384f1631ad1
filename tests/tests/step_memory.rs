//! What a step of training is estimated to keep in memory, against what it takes.
//!
//! The only test of its program: the peak is that of the whole process.

#[cfg(target_os = "linux")]
#[test]
fn the_estimate_is_of_the_right_order() {
    use neat_core::synthetic::{SyntheticScene, generate};
    use neat_lab::estimate::estimate;
    use neat_pipeline::config::Preset;
    use neat_tensor::{Backend, Kernels};
    use neat_train::Trainer;

    /// The largest resident memory of this process so far, in bytes.
    fn peak() -> f64 {
        let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells");
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.trim().strip_suffix(" kB"));
        let kib: f64 = kib.and_then(|kib| kib.parse().ok()).expect("in kB");
        1024.0 * kib
    }

    let scene = generate(&SyntheticScene {
        views: 4,
        image_size: 96,
        ..SyntheticScene::default()
    })
    .expect("a valid scene")
    .scene;
    let device = Backend::Flex.device().expect("the CPU");
    // Estimated and measured memory of a step with so many rays.
    let step = |rays: usize| {
        let mut config = Preset::PaperAbc.config();
        config.train.rays = rays;
        let mut trainer = Trainer::new(&scene, &config.training(Kernels::default()), 0, &device)
            .expect("it trains");
        trainer.step(0.1).expect("a step");
        (estimate(&config, &scene, 1.0).bytes, peak())
    };
    // The program, its networks and its buffers are in both.
    let (few, many) = (step(16), step(160));
    let (estimated, measured) = (many.0 - few.0, many.1 - few.1);
    let ratio = measured / estimated;
    assert!(
        (0.33..3.0).contains(&ratio),
        "{measured} bytes measured, {estimated} estimated"
    );
}
