//! What a distorted or large photograph costs before it is the image of a view, on
//! one thread. `cargo bench -p neat-core --bench undistortion`

use image::{Rgb, RgbImage};
use neat_core::{Distortion, Downscaling, Intrinsics, Undistortion};
use rayon::ThreadPoolBuilder;

fn main() {
    divan::main();
}

/// The size of the photographs of Strecha's benchmark, and 12 megapixels.
const SIZES: [(u32, u32); 2] = [(3072, 2048), (4000, 3000)];

fn lens(name: &str) -> Distortion {
    match name {
        "brown" => Distortion::Brown {
            radial: [-0.2, 0.08, -0.01, 0.0, 0.0, 0.0],
            tangential: [1e-3, -5e-4],
        },
        "fisheye" => Distortion::Fisheye {
            radial: [0.02, -0.01, 0.001, 0.0, 0.0, 0.0],
            tangential: [0.0; 2],
            thin_prism: [0.0; 4],
        },
        "fov" => Distortion::Fov { omega: 0.9 },
        _ => Distortion::ReverseRadial { k: -0.05 },
    }
}

fn intrinsics((width, height): (u32, u32)) -> Intrinsics {
    let focal = 0.9 * f64::from(width);
    Intrinsics {
        fx: focal,
        fy: focal,
        cx: f64::from(width) / 2.0,
        cy: f64::from(height) / 2.0,
        skew: 0.0,
    }
}

fn photograph((width, height): (u32, u32)) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, (x * y) as u8]))
}

#[divan::bench(args = ["brown", "fisheye", "fov", "division"], sample_count = 5, sample_size = 1)]
fn resample_3072x2048(bencher: divan::Bencher, name: &str) {
    resample(bencher, name, SIZES[0]);
}

#[divan::bench(args = ["brown", "fisheye"], sample_count = 5, sample_size = 1)]
fn resample_4000x3000(bencher: divan::Bencher, name: &str) {
    resample(bencher, name, SIZES[1]);
}

fn resample(bencher: divan::Bencher, name: &str, size: (u32, u32)) {
    let undistortion = Undistortion::new(&intrinsics(size), &lens(name), size, 0.5).unwrap();
    let photograph = photograph(size);
    let one_thread = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    bencher.bench(|| one_thread.install(|| undistortion.resample(&photograph)));
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn scale_3072x2048_to_1600(bencher: divan::Bencher) {
    let scaling = Downscaling::new(SIZES[0], 1600, 0.5).unwrap();
    let photograph = photograph(SIZES[0]);
    let one_thread = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    bencher.bench(|| one_thread.install(|| scaling.resample(&photograph)));
}

#[divan::bench(args = ["brown", "fisheye"])]
fn choose_the_pinhole(name: &str) -> Undistortion {
    Undistortion::new(&intrinsics(SIZES[0]), &lens(name), SIZES[0], 0.5).unwrap()
}
