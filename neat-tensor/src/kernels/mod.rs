//! Kernels of our own: what burn's operations would take many passes for.
//!
//! [`crate::NeatBackend`] says which operations there are, and has the same in plain
//! tensor operations.

#[allow(
    unsafe_code,
    reason = "register tiles over raw pointers, each with its bounds checked"
)]
pub mod cpu;
#[cfg(feature = "wgpu")]
pub(crate) mod gpu;
