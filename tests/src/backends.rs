//! The backends that a test runs on.

use burn::tensor::Device;
use neat_tensor::Backend;

/// Environment variable with the backends to test, by name, between commas. A
/// backend named there must be usable; without the variable all that are built
/// in and have a device are tested. A software driver in place of a GPU counts
/// only by name: it is right, but slow.
const BACKENDS: &str = "NEAT_TEST_BACKENDS";

/// Runs `test` on a device with autodiff of every backend.
pub fn on_each_backend(test: impl Fn(Device)) {
    on_each_of(&Backend::built(), test);
}

/// Runs `test` on a device with autodiff of every backend that computes on the
/// CPU: for what runs on the host or is only slower elsewhere.
pub fn on_each_cpu_backend(test: impl Fn(Device)) {
    on_each_of(&[Backend::Flex, Backend::Ndarray], test);
}

/// Runs `test` on a device with autodiff of every backend of GPUs.
pub fn on_each_gpu_backend(test: impl Fn(Device)) {
    on_each_of(&[Backend::Wgpu], test);
}

/// The one device in float64 that gradients are checked on: flex, with autodiff.
pub fn flex() -> Device {
    Device::flex().autodiff()
}

fn on_each_of(candidates: &[Backend], test: impl Fn(Device)) {
    for backend in tested(candidates) {
        report(&format!("backend: {backend}"));
        let device = backend
            .device()
            .expect("`tested` keeps those with a device");
        test(device.autodiff());
    }
}

/// Those of `candidates` that are to be tested here.
pub fn tested(candidates: &[Backend]) -> Vec<Backend> {
    let named = named();
    let is_tested = |backend: &Backend| {
        if named.as_ref().is_some_and(|named| !named.contains(backend)) {
            report(&format!("skipped: {backend} is not in {BACKENDS}"));
            return false;
        }
        if named.is_none() && *backend == Backend::Wgpu && Backend::Auto.resolve() != *backend {
            report(&format!("skipped: {backend} has no GPU here"));
            return false;
        }
        match backend.device() {
            Ok(_) => true,
            Err(error) if named.is_some() => panic!("{BACKENDS} names {backend}: {error}"),
            Err(error) => {
                report(&format!("skipped: {backend}: {error}"));
                false
            }
        }
    };
    candidates.iter().copied().filter(is_tested).collect()
}

#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn report(line: &str) {
    eprintln!("{line}");
}

fn named() -> Option<Vec<Backend>> {
    let names = std::env::var(BACKENDS).ok()?;
    let parse = |name: &str| -> Backend {
        name.parse()
            .unwrap_or_else(|error| panic!("{BACKENDS}: {error}"))
    };
    Some(names.split(',').map(parse).collect())
}
