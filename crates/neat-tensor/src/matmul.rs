//! Matrix products in the shapes that GPU kernels like.

use burn::tensor::{Device, Tensor, TensorCreationOptions};

/// Width of a vector load on a GPU, in elements.
const VECTOR: usize = 4;

/// `a b`: `[m, k]` times `[k, n]` → `[m, n]`.
///
/// On a GPU every side is filled up with zeros to a multiple of four, and so are
/// the products of reverse mode. burn's kernels then load vectors; the scalar
/// kernels that they take otherwise (cubecl 0.11) give wrong numbers on
/// SwiftShader and crash the shader compiler of Mesa.
pub fn matmul(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    if !is_gpu(&a.device()) {
        return a.matmul(b);
    }
    let ([m, k], n) = (a.dims(), b.dims()[1]);
    let (rows, inner, columns) = (filled(m), filled(k), filled(n));
    let product = fill(a, [rows, inner]).matmul(fill(b, [inner, columns]));
    product.narrow(0, 0, m).narrow(1, 0, n)
}

#[cfg(feature = "wgpu")]
fn is_gpu(device: &Device) -> bool {
    // Only the backends with kernels of their own say who they are.
    device.identity().is_some()
}

#[cfg(not(feature = "wgpu"))]
fn is_gpu(_device: &Device) -> bool {
    false
}

fn filled(side: usize) -> usize {
    side.next_multiple_of(VECTOR)
}

/// The matrix with rows and columns of zeros behind it.
fn fill(matrix: Tensor<2>, shape: [usize; 2]) -> Tensor<2> {
    let options = TensorCreationOptions::new(matrix.device()).with_dtype(matrix.dtype());
    (0..2).fold(matrix, |matrix, side| {
        let mut missing = matrix.dims();
        missing[side] = shape[side] - missing[side];
        if missing[side] == 0 {
            return matrix;
        }
        Tensor::cat(vec![matrix, Tensor::zeros(missing, options.clone())], side)
    })
}
