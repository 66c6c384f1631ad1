//! What the fuzz target and the tests of readers share.

#![forbid(unsafe_code)]

pub mod readers;
pub mod seeds;
