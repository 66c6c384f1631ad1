//! What the tests that cross crates share: golden numbers, backends, named
//! gradients and comparisons.

#![forbid(unsafe_code)]

pub mod backends;
pub mod comparison;
pub mod finite_differences;
#[path = "../data/golden/reader.rs"]
pub mod golden;
pub mod grids;
pub mod named_gradients;
pub mod published_names;
pub mod tensors;
