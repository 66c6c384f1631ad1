//! Steps of the samplers, for tensors of a GPU.

use super::{error_bound, grid};
use crate::sampling::{DrawNumbers, GridNumbers, RefineNumbers};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::prelude::{CubeCount, CubeDim};

/// Units of a group: each serves one ray, and the rays of a batch are many groups.
const UNITS: u32 = 32;

/// A launch of one unit per ray.
pub(super) fn launch_size(rays: usize) -> (CubeCount, CubeDim) {
    let groups = (rays as u32).div_ceil(UNITS);
    (CubeCount::Static(groups, 1, 1), CubeDim::new_1d(UNITS))
}

/// Steps of the samplers as operations of a backend; see the kernels for the
/// tensors, which are float32.
#[backend_extension(Cube)]
pub trait DeviceSampling: Backend {
    /// One iteration of Algorithm 1: all samples, the next positions, and the rays'
    /// state.
    fn refine(
        samples: FloatTensor<Self>,
        fresh: FloatTensor<Self>,
        betas: FloatTensor<Self>,
        control: FloatTensor<Self>,
        numbers: RefineNumbers,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);

    /// The final samples of Algorithm 1.
    fn draw(
        samples: FloatTensor<Self>,
        betas: FloatTensor<Self>,
        control: FloatTensor<Self>,
        u: FloatTensor<Self>,
        kept: FloatTensor<Self>,
        numbers: DrawNumbers,
    ) -> FloatTensor<Self>;

    /// Samples and their intervals by a grid of distances.
    fn sample_grid(
        ray_columns: FloatTensor<Self>,
        grid: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        noise: FloatTensor<Self>,
        numbers: GridNumbers,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

impl DeviceSampling for CubeBackend {
    fn refine(
        samples: FloatTensor<Self>,
        fresh: FloatTensor<Self>,
        betas: FloatTensor<Self>,
        control: FloatTensor<Self>,
        numbers: RefineNumbers,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        error_bound::refine([samples, fresh, betas, control], numbers)
    }

    fn draw(
        samples: FloatTensor<Self>,
        betas: FloatTensor<Self>,
        control: FloatTensor<Self>,
        u: FloatTensor<Self>,
        kept: FloatTensor<Self>,
        numbers: DrawNumbers,
    ) -> FloatTensor<Self> {
        error_bound::draw([samples, betas, control, u, kept], numbers)
    }

    fn sample_grid(
        ray_columns: FloatTensor<Self>,
        grid: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        noise: FloatTensor<Self>,
        numbers: GridNumbers,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        grid::sample([ray_columns, grid, beta, noise], numbers)
    }
}

/// [`DeviceSampling::refine`] for tensors of a GPU.
pub(crate) fn refine(
    samples: Tensor<2>,
    fresh: Tensor<2>,
    betas: Tensor<2>,
    control: Tensor<1>,
    numbers: RefineNumbers,
) -> (Tensor<2>, Tensor<2>, Tensor<2>) {
    let (merged, next_z, state) = <Dispatch as DeviceSampling>::refine(
        samples.into_dispatch(),
        fresh.into_dispatch(),
        betas.into_dispatch(),
        control.into_dispatch(),
        numbers,
    );
    (
        Tensor::from_dispatch(merged),
        Tensor::from_dispatch(next_z),
        Tensor::from_dispatch(state),
    )
}

/// [`DeviceSampling::draw`] for tensors of a GPU.
pub(crate) fn draw(
    samples: Tensor<2>,
    betas: Tensor<2>,
    control: Tensor<1>,
    u: Tensor<2>,
    kept: Tensor<2>,
    numbers: DrawNumbers,
) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as DeviceSampling>::draw(
        samples.into_dispatch(),
        betas.into_dispatch(),
        control.into_dispatch(),
        u.into_dispatch(),
        kept.into_dispatch(),
        numbers,
    ))
}

/// [`DeviceSampling::sample_grid`] for tensors of a GPU.
pub(crate) fn sample_grid(
    rays: Tensor<2>,
    grid: Tensor<1>,
    beta: Tensor<1>,
    noise: Tensor<2>,
    numbers: GridNumbers,
) -> (Tensor<2>, Tensor<2>) {
    let (z, deltas) = <Dispatch as DeviceSampling>::sample_grid(
        rays.into_dispatch(),
        grid.into_dispatch(),
        beta.into_dispatch(),
        noise.into_dispatch(),
        numbers,
    );
    (Tensor::from_dispatch(z), Tensor::from_dispatch(deltas))
}
