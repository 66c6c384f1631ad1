//! Some rows of a matrix, and the sums of what belongs to the same row.
//!
//! These are plain tensor operations: the readable twin of the kernels of GPUs, which
//! [`crate::NeatBackend::pick_rows`] and [`crate::NeatBackend::add_up_rows`] lead to.

use crate::host::index_tensor;
use burn::tensor::{Device, IndexingUpdateOp, Int, Tensor, TensorCreationOptions};
use std::sync::Arc;

/// Which row of a matrix of `total` rows each of `M` others belongs to: samples to their rays,
/// say. A row may have any number of them, also none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowChoice {
    indices: Arc<[u32]>,
    total: usize,
}

impl RowChoice {
    /// The rows `indices` of `total`.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn new(indices: impl IntoIterator<Item = u32>, total: usize) -> Self {
        let indices: Arc<[u32]> = indices.into_iter().collect();
        let known = indices.iter().all(|i| (*i as usize) < total);
        assert!(known, "a row of {total} was asked for that there is not");
        Self { indices, total }
    }

    /// `M` numbers below [`Self::total`].
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Rows of the matrix.
    pub fn total(&self) -> usize {
        self.total
    }

    /// These rows `[M, C]` of `values` `[total, C]`.
    pub fn pick(&self, values: Tensor<2>) -> Tensor<2> {
        let indices = self.on(&values.device());
        values.select(0, indices)
    }

    /// For each row of the matrix the sum of those of `rows` `[M, C]` that belong to it:
    /// `[total, C]`.
    pub fn add_up(&self, rows: Tensor<2>) -> Tensor<2> {
        let (device, columns) = (rows.device(), rows.dims()[1]);
        let indices = self.on(&device);
        let options = TensorCreationOptions::new(device).with_dtype(rows.dtype());
        let nothing = Tensor::zeros([self.total, columns], options);
        nothing.select_assign(0, indices, rows, IndexingUpdateOp::Add)
    }

    fn on(&self, device: &Device) -> Tensor<1, Int> {
        index_tensor(self.indices.iter().map(|i| *i as usize), device)
    }
}
