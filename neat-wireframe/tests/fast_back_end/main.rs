//! The fast back end as a whole: on prisms made here, on scenes of blocks, and on
//! the toy object with its real detections.

#[path = "../../examples/graph_scale/field.rs"]
mod field;
mod graph;
mod noise;
mod prism;
mod prisms;
mod refinement;
#[path = "../../examples/graph_scale/score.rs"]
mod score;
#[path = "../toy_data/mod.rs"]
mod toy_data;
mod toy_object;
