//! The line-track back end as a whole: on synthetic scenes with exact truth, on
//! the toy object with its real detections, and on hostile input.

mod facade;
mod hostile_input;
mod scores;
mod solids;
mod toy_object;
