//! Devices, coordinate networks with input gradients, and checkpoints, on burn.
//!
//! A backend is a run-time [`burn::tensor::Device`]; nothing here is generic
//! over backends. What the networks need beyond plain layers — the positional
//! encoding's Jacobian, softplus with its derivative, a multilayer perceptron
//! that also returns the gradient of its output with respect to its input — is
//! written in plain tensor operations, so that first-order reverse mode
//! differentiates the input gradient once more. Beside them stand hand-written
//! twins that compute the same: for the CPU whole networks as single operations
//! ([`fused`]) over [`kernels`], for GPUs `device_kernels`, one for what would
//! take many.

pub mod adam;
pub mod backend;
pub mod checkpoint;
pub mod coordinate_mlp;
#[cfg(feature = "wgpu")]
pub mod device_kernels;
pub mod encoding;
pub mod fused;
#[allow(
    unsafe_code,
    reason = "register tiles over raw pointers, each with its bounds checked"
)]
pub mod kernels;
pub mod linear;
pub mod parameters;
pub mod random;
pub mod sine;
pub mod softplus;

pub use backend::{Backend, BackendError};
pub use coordinate_mlp::{CoordinateMlp, Field, FieldQuery, Recorded};
pub use encoding::PositionalEncoding;
pub use linear::{Linear, ReluMlp, SampleInputs};
