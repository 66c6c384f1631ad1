//! Kernels of GPUs against what they stand for.

mod networks;
mod samplers;
