//! What the views say about an edge: which of them show it, and from which the
//! surface hides it.

pub(crate) mod edge_support;
pub(crate) mod occlusion;

pub use edge_support::{confirms, required_views};
pub use occlusion::OcclusionConfig;
