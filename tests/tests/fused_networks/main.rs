//! Fused networks against their twins in tensor operations, which
//! `finite_differences` checks: values and all gradients.

mod grid_features;
mod kernels;
mod segment_loss;
mod twins;
