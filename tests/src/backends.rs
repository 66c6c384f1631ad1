//! The backends that a test runs on.

use burn::tensor::Device;
use neat_tensor::Backend;

/// Environment variable with the backends to test, by name, between commas. A
/// backend named there must be usable; without the variable all that are built
/// in and have a device are tested. Vulkan in software counts only by name: the
/// matrix kernels that burn's autotuning picks give wrong numbers on SwiftShader
/// and crash Mesa's lavapipe.
const BACKENDS: &str = "NEAT_TEST_BACKENDS";

/// See [`slack`].
const GPU_SLACK: f64 = 1000.0;

/// Runs `test` on a device with autodiff of every backend.
pub fn on_each_backend(test: impl Fn(Device)) {
    on_each_of(&Backend::built(), test);
}

/// Runs `test` on a device with autodiff of every backend that computes on the
/// CPU: for what runs on the host or is only slower elsewhere.
pub fn on_each_cpu_backend(test: impl Fn(Device)) {
    on_each_of(&[Backend::Flex, Backend::Ndarray], test);
}

/// The one device in float64 that gradients are checked on: flex, with autodiff.
pub fn flex() -> Device {
    Device::flex().autodiff()
}

/// How much wider tolerances are on `device`. A GPU rounds like a CPU, but Vulkan
/// grants the sine of the encoding an error of 2⁻¹¹ where PyTorch's is below 2⁻²³.
pub fn slack(device: &Device) -> f64 {
    if device.identity().is_some() {
        GPU_SLACK
    } else {
        1.0
    }
}

#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn on_each_of(candidates: &[Backend], test: impl Fn(Device)) {
    let named = named();
    for backend in candidates {
        if named.as_ref().is_some_and(|named| !named.contains(backend)) {
            eprintln!("skipped: {backend} is not in {BACKENDS}");
            continue;
        }
        if named.is_none() && *backend == Backend::Wgpu && Backend::Auto.resolve() != *backend {
            eprintln!("skipped: {backend} has no GPU here");
            continue;
        }
        match backend.device() {
            Ok(device) => {
                eprintln!("backend: {backend}");
                test(device.autodiff());
            }
            Err(error) if named.is_some() => panic!("{BACKENDS} names {backend}: {error}"),
            Err(error) => eprintln!("skipped: {backend}: {error}"),
        }
    }
}

fn named() -> Option<Vec<Backend>> {
    let names = std::env::var(BACKENDS).ok()?;
    let parse = |name: &str| -> Backend {
        name.parse()
            .unwrap_or_else(|error| panic!("{BACKENDS}: {error}"))
    };
    Some(names.split(',').map(parse).collect())
}
