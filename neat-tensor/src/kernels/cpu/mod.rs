//! Fused coordinate networks on the CPU, over plain slices.
//!
//! Rows of the input are taken in blocks of [`BLOCK_ROWS`] that stay in the
//! second-level cache while they pass through all layers, forwards and
//! backwards; blocks are independent and run in parallel. Within a block a matrix
//! is row-major, sample after sample, its rows padded to a multiple of
//! [`PADDING`]: forward products, products with transposed weights and weight
//! gradients then all read their operands as they lie, and no width is special.
//!
//! Instruction sets (AVX-512, AVX2, NEON, or none) are chosen at run time.

pub mod arena;
pub mod block;
pub mod density;
pub mod gemm;
pub mod grid;
mod kept;
pub mod layers;
pub mod relu_network;
pub mod simd_math;
pub mod softplus_network;
pub mod weight_gradient;

pub(crate) use kept::Tape;
pub use kept::{KeptMemory, KnownPass, KnownRows};
pub use pulp::Arch;

/// Rows of a block.
pub const BLOCK_ROWS: usize = 48;

/// Columns of matrices are padded to a multiple of this: the widest vector.
pub const PADDING: usize = 16;

/// `width` rounded up to a multiple of [`PADDING`].
pub const fn padded(width: usize) -> usize {
    width.div_ceil(PADDING) * PADDING
}

/// The instruction sets of this machine that kernels are compiled for, plain
/// code first.
pub fn instruction_sets() -> Vec<Arch> {
    let mut sets = vec![Arch::Scalar];
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        sets.extend(pulp::x86::V3::try_new().map(Arch::V3));
        sets.extend(pulp::x86::V4::try_new().map(Arch::V4));
    }
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    sets.push(Arch::new());
    sets
}
