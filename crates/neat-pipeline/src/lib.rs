//! neat-pipeline
