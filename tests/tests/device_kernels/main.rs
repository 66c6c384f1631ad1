//! Kernels of GPUs against what they stand for.

#[cfg(feature = "wgpu")]
mod networks;
#[cfg(feature = "wgpu")]
mod samplers;
