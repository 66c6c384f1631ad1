//! Every kind of bad input through the real binary: one clear sentence that names
//! the file, the view and the remedy, exit code 2, and every file as it was.
//!
//! A case is an entry of a table. The tables of `docs/reliability.md` have a row for
//! each, with what neat says; the tests hold them to the truth, and write them with
//! `NEAT_UPDATE_DOCS=1`.

mod cameras;
mod case;
mod evaluations;
mod files;
mod formats;
mod options;
mod runs;
#[path = "../support/mod.rs"]
mod support;
mod views;
