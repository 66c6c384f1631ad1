//! The kernels' own tests, from the crate of tests.

extern crate self as neat_tests;

#[path = "../../../tests/src/comparison.rs"]
pub mod comparison;

/// In the place of the module of that name, whose random numbers come with burn.
pub mod finite_differences {
    /// Numbers between −2 and 2, the same for each seed: a linear congruential
    /// generator with the constants of Knuth's MMIX.
    pub fn normal(count: usize, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 4.0 - 2.0
        };
        (0..count).map(|_| next()).collect()
    }
}

#[path = "../../../tests/tests/fused_networks/kernels.rs"]
mod kernels;
