//! The fast back end as a whole: on prisms made here, and on the toy object with
//! its real detections.

mod graph;
mod noise;
mod prism;
mod prisms;
mod toy_object;
