//! Devices, coordinate networks with input gradients, an optimiser and checkpoints, on
//! burn.
//!
//! A backend is a run-time [`burn::tensor::Device`]; nothing here is generic over
//! backends. What the networks need beyond plain layers (the positional encoding's
//! Jacobian, softplus with its derivative, a perceptron that also returns the gradient of
//! its output with respect to its input) is written in plain tensor operations, so that
//! first-order reverse mode differentiates the input gradient once more. [`NeatBackend`]
//! is the one trait of these operations: plain by default, and overridden by the kernels
//! of the CPU and of GPUs in [`kernels`]; [`Kernels`] chooses.
//!
//! ```
//! use burn::tensor::Tensor;
//! use neat_tensor::random::{Purpose, stream};
//! use neat_tensor::{Backend, ReluMlp};
//!
//! let device = Backend::Auto.device()?;
//! let mlp = ReluMlp::new(&[3, 16, 1], false, &mut stream(0, Purpose::Weights, 0), &device);
//! let outputs = mlp.forward(Tensor::zeros([5, 3], &device));
//! assert_eq!(outputs.dims(), [5, 1]);
//! # Ok::<(), neat_tensor::BackendError>(())
//! ```

pub mod adam;
pub mod backend;
pub mod cameras;
pub mod checkpoint;
mod coordinate_mlp;
mod cpu_backend;
mod encoding;
mod fused;
#[cfg(feature = "wgpu")]
mod gpu_backend;
mod grid_encoding;
pub mod host;
mod kernel_choice;
pub mod kernels;
pub mod linear;
mod neat_backend;
pub mod parameters;
mod point_encoding;
pub mod random;
mod relu_mlp;
mod row_choice;
pub mod sampling;
mod sine;
pub mod softplus;

pub use backend::{Backend, BackendError};
pub use coordinate_mlp::{CoordinateMlp, Recorded};
pub use encoding::PositionalEncoding;
pub use grid_encoding::{GridConfig, GridEncoding};
pub use kernel_choice::Kernels;
pub use kernels::cpu::{KnownPass, KnownRows};
pub use linear::{Linear, NetworkSizeError};
pub use neat_backend::{
    AdamNumbers, DistanceNetwork, Field, FieldQuery, NeatBackend, Plain, SampleInputs,
};
pub use point_encoding::PointEncoding;
pub use relu_mlp::ReluMlp;
pub use row_choice::RowChoice;
