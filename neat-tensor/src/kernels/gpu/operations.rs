//! Activations and encoding as operations that burn differentiates.
//!
//! burn reaches the tensors of a backend, and the graph of its derivatives, through an
//! extension trait. A derivative is one function per input, of the adjoint and the inputs.

use super::{activations, encoding};
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

/// The operations; see [`activations`] and [`encoding`].
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
}

/// The adjoint of one input, from that of the value, the inputs, and the number.
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
    P: Copy + Debug + Send + Sync + 'static,
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
                let to_input = derivative(adjoint.clone(), state.inputs.clone(), state.number);
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
    P: Copy + Debug + Send + Sync + 'static,
{
    let nodes = inputs.each_ref().map(|input| input.node());
    let inputs = inputs.map(|input| input.into_primitive());
    let operation = Operation(std::marker::PhantomData::<P>);
    match operation.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let value = value(inputs.clone(), number);
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
