//! Products of many rows with a matrix.
//!
//! Their gradients with respect to the matrix and the bias are sums over all rows: one short
//! matrix of products with a very long inner side, which keeps only a few of a GPU's
//! processors busy. The rows are taken in parts, all at once, and the parts are added.

use burn::backend::TensorMetadata;
use burn::backend::ops::FloatTensorOps;
use burn::tensor::{Shape, Slice};
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;

/// Rows of a part. With 256 columns on both sides, as the published networks have, the sums
/// of the parts are half as large as what they are made from, and so cheap to write.
const PART: usize = 256;

fn product(lhs: CubeTensor, rhs: CubeTensor) -> CubeTensor {
    CubeBackend::float_matmul(lhs, rhs)
}

fn transposed(matrix: CubeTensor) -> CubeTensor {
    let last = matrix.shape().num_dims() - 1;
    CubeBackend::float_swap_dims(matrix, last - 1, last)
}

fn rows(tensor: &CubeTensor, from: usize, to: usize) -> CubeTensor {
    let columns = tensor.shape()[1];
    let slices = [Slice::from(from..to), Slice::from(0..columns)];
    CubeBackend::float_slice(tensor.clone(), &slices)
}

fn reshaped(tensor: CubeTensor, shape: impl Into<Shape>) -> CubeTensor {
    CubeBackend::float_reshape(tensor, shape.into())
}

/// The sum over rows of `sum`, a function of matrices of as many rows, by parts: `stacked` does
/// the same for `[parts, PART, columns]` each and gives one matrix per part.
fn sum_over_rows<const K: usize>(
    of: [CubeTensor; K],
    sum: impl Fn([CubeTensor; K]) -> CubeTensor,
    stacked: impl Fn([CubeTensor; K]) -> CubeTensor,
) -> CubeTensor {
    let count = of[0].shape()[0];
    let parts = count / PART;
    if parts < 2 {
        return sum(of);
    }
    let whole = parts * PART;
    let stack = |tensor: &CubeTensor| {
        let columns = tensor.shape()[1];
        let of_parts = if whole < count {
            rows(tensor, 0, whole)
        } else {
            tensor.clone()
        };
        reshaped(of_parts, [parts, PART, columns])
    };
    let sums = stacked(of.each_ref().map(stack));
    let [_, height, width] = sums.shape().dims();
    let total = reshaped(CubeBackend::float_sum_dim(sums, 0), [height, width]);
    if whole == count {
        return total;
    }
    let rest = sum(of.each_ref().map(|tensor| rows(tensor, whole, count)));
    CubeBackend::float_add(total, rest)
}

/// `x w + b` of `x` `[N, k]`, `w` `[k, m]` and `b` `[1, m]`.
pub(super) fn affine([x, w, b]: [CubeTensor; 3]) -> CubeTensor {
    CubeBackend::float_add(product(x, w), b)
}

/// `x w` of `x` `[N, k]` and `w` `[k, m]`.
pub(super) fn linear([x, w]: [CubeTensor; 2]) -> CubeTensor {
    product(x, w)
}

/// The adjoint of `x` from that of `x w`.
pub(super) fn to_rows(a: CubeTensor, w: CubeTensor) -> CubeTensor {
    product(a, transposed(w))
}

/// The adjoint of `w` from that of `x w`: `xᵀ a`.
pub(super) fn to_matrix(a: CubeTensor, x: CubeTensor) -> CubeTensor {
    let of = |[x, a]: [CubeTensor; 2]| product(transposed(x), a);
    sum_over_rows([x, a], of, of)
}

/// The adjoint `[1, m]` of the bias: the sum of the rows of `a`.
pub(super) fn to_bias(a: CubeTensor) -> CubeTensor {
    let along = |dim: usize| move |[a]: [CubeTensor; 1]| CubeBackend::float_sum_dim(a, dim);
    sum_over_rows([a], along(0), along(1))
}
