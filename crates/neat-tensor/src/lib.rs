//! neat-tensor
