//! Products, activations, encodings and choices of rows as operations that burn differentiates.
//!
//! burn reaches the tensors of a backend, and the graph of its derivatives, through an
//! extension trait. A derivative is one function per input, of the adjoint and the inputs.

use super::{activations, encoding, grid_features, products, rows};
use crate::kernels::cpu::grid::GridShape;
use crate::row_choice::RowChoice;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, backend_extension};
use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use std::fmt::Debug;

/// The operations; see [`products`], [`activations`], [`encoding`], [`grid_features`] and
/// [`rows`].
#[backend_extension(Cube, Autodiff)]
pub trait GpuOperations: Backend {
    /// Softplus of `z`.
    fn gpu_softplus(z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self>;

    /// `g` times the slope of softplus at `z`.
    fn gpu_slope(g: FloatTensor<Self>, z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self>;

    /// The encoding of `x`.
    fn gpu_encode(x: FloatTensor<Self>, octaves: usize) -> FloatTensor<Self>;

    /// `gradient`, with respect to the encoding of `x`, times its Jacobian.
    fn gpu_pull_back(
        x: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self>;

    /// `x w + b` of `x` `[N, k]`, `w` `[k, m]` and `b` `[1, m]`.
    fn gpu_affine(
        x: FloatTensor<Self>,
        w: FloatTensor<Self>,
        b: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// `x w` of `x` `[N, k]` and `w` `[k, m]`.
    fn gpu_linear(x: FloatTensor<Self>, w: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The features of the grids of `table` at `points`.
    fn gpu_grid(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self>;

    /// `gradient`, with respect to these features, pulled back to `points`.
    fn gpu_pull_back_grid(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self>;

    /// The rows of `values` that are chosen.
    fn gpu_pick_rows(values: FloatTensor<Self>, choice: RowChoice) -> FloatTensor<Self>;

    /// The sums of what belongs to the same row.
    fn gpu_add_up_rows(rows: FloatTensor<Self>, choice: RowChoice) -> FloatTensor<Self>;
}

impl GpuOperations for CubeBackend {
    fn gpu_softplus(z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self> {
        activations::softplus([z], sharpness)
    }

    fn gpu_slope(g: FloatTensor<Self>, z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self> {
        activations::slope([g, z], sharpness)
    }

    fn gpu_encode(x: FloatTensor<Self>, octaves: usize) -> FloatTensor<Self> {
        encoding::encode([x], octaves)
    }

    fn gpu_pull_back(
        x: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self> {
        encoding::pull_back([x, gradient], octaves)
    }

    fn gpu_affine(
        x: FloatTensor<Self>,
        w: FloatTensor<Self>,
        b: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        products::affine([x, w, b])
    }

    fn gpu_linear(x: FloatTensor<Self>, w: FloatTensor<Self>) -> FloatTensor<Self> {
        products::linear([x, w])
    }

    fn gpu_grid(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self> {
        grid_features::encode([points, table], &shape)
    }

    fn gpu_pull_back_grid(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self> {
        grid_features::pull_back([points, table, gradient], &shape)
    }

    fn gpu_pick_rows(values: FloatTensor<Self>, choice: RowChoice) -> FloatTensor<Self> {
        rows::pick([values], &choice)
    }

    fn gpu_add_up_rows(rows: FloatTensor<Self>, choice: RowChoice) -> FloatTensor<Self> {
        rows::add_up([rows], &choice)
    }
}

impl<C: CheckpointStrategy> GpuOperations for Autodiff<CubeBackend, C> {
    fn gpu_softplus(z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self> {
        let to_z: Derivative<f32, 1> = |a, [z], s| activations::slope([a, z], s);
        recorded::<C, _, 1>([z], sharpness, activations::softplus, [to_z])
    }

    fn gpu_slope(g: FloatTensor<Self>, z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self> {
        let to_g: Derivative<f32, 2> = |a, [_, z], s| activations::slope([a, z], s);
        let to_z: Derivative<f32, 2> = |a, [g, z], s| activations::curvature([a, g, z], s);
        recorded::<C, _, 2>([g, z], sharpness, activations::slope, [to_g, to_z])
    }

    fn gpu_encode(x: FloatTensor<Self>, octaves: usize) -> FloatTensor<Self> {
        let to_x: Derivative<usize, 1> = |a, [x], octaves| encoding::pull_back([x, a], octaves);
        recorded::<C, _, 1>([x], octaves, encoding::encode, [to_x])
    }

    fn gpu_pull_back(
        x: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self> {
        let to_x: Derivative<usize, 2> = |a, [x, g], o| encoding::pull_back_slope([x, a, g], o);
        let to_gradient: Derivative<usize, 2> = |a, [x, _], o| encoding::push_forward([x, a], o);
        let derivatives = [to_x, to_gradient];
        recorded::<C, _, 2>([x, gradient], octaves, encoding::pull_back, derivatives)
    }

    fn gpu_affine(
        x: FloatTensor<Self>,
        w: FloatTensor<Self>,
        b: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let to_x: Derivative<(), 3> = |a, [_, w, _], ()| products::to_rows(a, w);
        let to_w: Derivative<(), 3> = |a, [x, _, _], ()| products::to_matrix(a, x);
        let to_b: Derivative<(), 3> = |a, _, ()| products::to_bias(a);
        let value = |inputs, ()| products::affine(inputs);
        recorded::<C, _, 3>([x, w, b], (), value, [to_x, to_w, to_b])
    }

    fn gpu_linear(x: FloatTensor<Self>, w: FloatTensor<Self>) -> FloatTensor<Self> {
        let to_x: Derivative<(), 2> = |a, [_, w], ()| products::to_rows(a, w);
        let to_w: Derivative<(), 2> = |a, [x, _], ()| products::to_matrix(a, x);
        let value = |inputs, ()| products::linear(inputs);
        recorded::<C, _, 2>([x, w], (), value, [to_x, to_w])
    }

    fn gpu_grid(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self> {
        let to_points: Derivative<GridShape, 2> =
            |a, [points, table], shape| grid_features::pull_back([points, table, a], &shape);
        let to_table: Derivative<GridShape, 2> =
            |a, [points, _], shape| grid_features::scatter([points, a], &shape);
        let value = |inputs, shape| grid_features::encode(inputs, &shape);
        recorded::<C, _, 2>([points, table], shape, value, [to_points, to_table])
    }

    fn gpu_pull_back_grid(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self> {
        let to_points: Derivative<GridShape, 3> =
            |a, [x, table, g], shape| grid_features::curvature([x, a, table, g], &shape);
        let to_table: Derivative<GridShape, 3> =
            |a, [x, _, g], shape| grid_features::scatter_slope([x, a, g], &shape);
        let to_gradient: Derivative<GridShape, 3> =
            |a, [x, table, _], shape| grid_features::push_forward([x, a, table], &shape);
        let derivatives = [to_points, to_table, to_gradient];
        let value = |inputs, shape| grid_features::pull_back(inputs, &shape);
        recorded::<C, _, 3>([points, table, gradient], shape, value, derivatives)
    }

    fn gpu_pick_rows(values: FloatTensor<Self>, choice: RowChoice) -> FloatTensor<Self> {
        let to_values: Derivative<RowChoice, 1> = |a, _, choice| rows::add_up([a], &choice);
        let value = |inputs, choice| rows::pick(inputs, &choice);
        recorded::<C, _, 1>([values], choice, value, [to_values])
    }

    fn gpu_add_up_rows(rows: FloatTensor<Self>, choice: RowChoice) -> FloatTensor<Self> {
        let to_rows: Derivative<RowChoice, 1> = |a, _, choice| rows::pick([a], &choice);
        let value = |inputs, choice| rows::add_up(inputs, &choice);
        recorded::<C, _, 1>([rows], choice, value, [to_rows])
    }
}

/// The adjoint of one input, from that of the value, the inputs, and what else the operation
/// is given.
type Derivative<P, const N: usize> = fn(CubeTensor, [CubeTensor; N], P) -> CubeTensor;

/// What an operation leaves for its backward pass.
#[derive(Clone, Debug)]
struct State<P, const N: usize> {
    inputs: [CubeTensor; N],
    number: P,
    derivatives: [Derivative<P, N>; N],
}

#[derive(Debug)]
struct Operation<P>(std::marker::PhantomData<P>);

impl<P, const N: usize> Backward<CubeBackend, N> for Operation<P>
where
    P: Clone + Debug + Send + Sync + 'static,
{
    type State = State<P, N>;

    fn backward(
        self,
        ops: Ops<Self::State, N>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let adjoint = gradients.consume::<CubeBackend>(&ops.node);
        let state = ops.state;
        for (node, derivative) in ops.parents.into_iter().zip(state.derivatives) {
            if let Some(node) = node {
                let to_input =
                    derivative(adjoint.clone(), state.inputs.clone(), state.number.clone());
                gradients.register::<CubeBackend>(node.id, to_input);
            }
        }
    }
}

/// `value` of `inputs`, recorded for the backward pass if any of them is tracked.
fn recorded<C: CheckpointStrategy, P, const N: usize>(
    inputs: [FloatTensor<Autodiff<CubeBackend, C>>; N],
    number: P,
    value: fn([CubeTensor; N], P) -> CubeTensor,
    derivatives: [Derivative<P, N>; N],
) -> FloatTensor<Autodiff<CubeBackend, C>>
where
    P: Clone + Debug + Send + Sync + 'static,
{
    let nodes = inputs.each_ref().map(|input| input.node());
    let inputs = inputs.map(|input| input.into_primitive());
    let operation = Operation(std::marker::PhantomData::<P>);
    match operation.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let value = value(inputs.clone(), number.clone());
            let state = State {
                inputs,
                number,
                derivatives,
            };
            prepared.finish(state, value)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(value(inputs, number)),
    }
}
