//! What lies near: points in space and in images, and segments in an image.
//!
//! [`PointIndex`] is a k-d tree for queries of any radius. [`PointGrid`] serves the
//! mean shift, which asks millions of times with one radius and must allocate
//! nothing; its order of visits fixes the last bits of the sums. To
//! [`GrowingPointGrid`] points come between the queries, which the tree cannot do.

mod point_grid;
mod point_index;
mod segment_grid;

pub(crate) use point_grid::{GrowingPointGrid, PointGrid, one_per_cell};
pub(crate) use point_index::PointIndex;
pub(crate) use segment_grid::SegmentGrid;
