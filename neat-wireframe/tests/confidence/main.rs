//! Confidence and provenance: honest covariances, calibrated probabilities, and
//! the fields and files that hold them.

mod calibration;
mod covariances;
mod documents;
mod noise;
mod reliability;
mod robustness;
mod scenario;
mod toy_object;
