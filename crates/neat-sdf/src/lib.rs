//! neat-sdf
