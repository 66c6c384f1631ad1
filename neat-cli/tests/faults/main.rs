//! Faults on purpose: full disks, folders that are read-only or vanish, damaged
//! checkpoints. Each ends in one clear error or in the bytes of an undisturbed run.
#![cfg(unix)]

mod damaged_checkpoint;
mod disk;
mod full_disk;
mod lost_folder;
mod read_only;
#[path = "../support/mod.rs"]
mod support;
