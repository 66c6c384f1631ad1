//! The C interface of neat: the folder of a scene in, a wireframe out.
//!
//! `include/neat.h` is what a C program sees, made of [`types`] and [`border`] by cbindgen; a
//! test holds it to them. `examples/reconstruct.c` is such a program.
//!
//! What is unsafe lies in [`border`] alone, where pointers are looked at. What is asked for,
//! and what comes out of it, are plain values to the rest of the crate.
//!
//! A structure begins with its size as the caller's header had it, and only grows at its end:
//! programs that were built against an earlier header keep working, and the fields that they
//! do not know have their defaults.

pub mod border;
mod numbers;
mod run;
pub mod types;
