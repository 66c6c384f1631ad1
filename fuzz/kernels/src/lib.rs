//! The kernels of `neat-tensor` alone: what they need besides is no learning
//! framework, so that instrumented builds take minutes.

#[path = "../../../neat-tensor/src/kernels/mod.rs"]
pub mod kernels;
