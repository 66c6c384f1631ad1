//! The assembler as a whole: on synthetic scenes with exact truth, on the toy object
//! with its real detections and images, and on hostile input.

mod facade;
mod hostile_input;
mod scores;
mod solids;
#[path = "../toy_data/mod.rs"]
mod toy_data;
mod toy_object;
