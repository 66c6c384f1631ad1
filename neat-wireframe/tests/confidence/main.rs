//! Confidence and provenance: honest covariances, calibrated probabilities, and
//! the fields and files that hold them.

mod calibration;
mod covariances;
mod documents;
mod noise;
mod reliability;
mod robustness;
mod scenario;
#[path = "../toy_data/mod.rs"]
mod toy_data;
mod toy_object;
