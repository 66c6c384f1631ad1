//! Time of a whole detection on one thread: a synthetic solid with noise at the
//! size of a DTU image, and at that of HAWP's.

use divan::Bencher;
use image::RgbImage;
use neat_core::synthetic::{SyntheticScene, generate};
use neat_detect::{DetectorConfig, detect};

fn main() {
    divan::main();
}

/// Six views side by side, cut to the size: about as many edges as a façade.
fn image(width: u32, height: u32) -> RgbImage {
    let side = height / 3;
    let data = generate(&SyntheticScene {
        views: 12,
        image_size: side,
        ..SyntheticScene::default()
    })
    .expect("the configuration is valid");
    RgbImage::from_fn(width, height, |x, y| {
        let view = (x / side + 4 * (y / side)) as usize % data.scene.views.len();
        let image = &data.scene.views[view].image;
        let mut pixel = (image.pixel(x % side, y % side)).expect("the image is in memory");
        // A fixed pattern in the place of noise.
        let grain = (x.wrapping_mul(7919) ^ y.wrapping_mul(104_729)) % 5;
        pixel.0 = pixel.0.map(|value| value.saturating_add(grain as u8));
        pixel
    })
}

#[divan::bench(args = [(512, 512), (1600, 1200)], sample_count = 10)]
fn detection(bencher: Bencher, (width, height): (u32, u32)) {
    let image = image(width, height);
    let config = DetectorConfig::default();
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool of one thread");
    bencher.bench_local(|| one_thread.install(|| detect(&image, &config)));
}
