//! Whole networks as single operations of burn's CPU backends, over plain slices.
//!
//! burn reaches the tensors of a backend through an extension trait; its derivatives are
//! in `fused/derivatives.rs`. The kernels know nothing of burn.

#![allow(deprecated)] // ndarray is still one of the backends that neat promises

mod derivatives;
mod grid_features;

pub(crate) use grid_features::grid_features;

use crate::kernels::cpu::relu_network::{self, ReluNetwork, ReluShape};
use crate::kernels::cpu::softplus_network::{
    self, Known, SoftplusNetwork, SoftplusOutput, SoftplusShape,
};
use crate::kernels::cpu::{KeptMemory, KnownRows};
use burn::backend::tensor::{Device as BackendDevice, FloatTensor};
use burn::backend::{Backend, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, TensorData};
use pulp::Arch;
use std::borrow::Cow;

/// What is asked of a signed distance network.
#[derive(Clone, Debug)]
pub struct SoftplusRequest {
    /// The network.
    pub shape: SoftplusShape,
    /// So many first rows are evaluated in full: distance, gradient and, where
    /// asked for, the other outputs. Of the rest only the distance matters.
    pub full_rows: usize,
    /// Whether outputs other than the first are wanted.
    pub others: bool,
    /// What is known of all rows.
    pub known: Option<KnownRows>,
    /// Where activations may wait for the backward pass.
    pub memory: KeptMemory,
}

/// What is asked of a ReLU perceptron.
#[derive(Clone, Debug)]
pub struct ReluRequest {
    /// The network.
    pub shape: ReluShape,
    /// Where activations may wait for the backward pass.
    pub memory: KeptMemory,
}

/// Networks as operations of a backend.
///
/// Tensors are float32. `parameters` `[P]` hold of each layer the weight
/// `[outputs, inputs]`, row-major, then the bias; `table` `[entries, features]` is that of
/// the network's grid, or, as burn wants all inputs, any tensor where there is none.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Autodiff,
)]
pub trait FusedNetworks: Backend {
    /// Evaluates a softplus network at `points` `[N, 3]`: the first output of all
    /// rows `[N, 1]`; of the `H` full rows the gradient `[H, 3]` and, if asked for,
    /// the other outputs `[H, outputs − 1]`.
    fn softplus_network(
        points: FloatTensor<Self>,
        parameters: FloatTensor<Self>,
        table: FloatTensor<Self>,
        request: SoftplusRequest,
    ) -> (
        FloatTensor<Self>,
        FloatTensor<Self>,
        Option<FloatTensor<Self>>,
    );

    /// Evaluates a ReLU perceptron at rows `[inputs, gradients, features]`
    /// `[N, ·]`; `inputs` may consist of several parts of the shape.
    fn relu_network(
        inputs: FloatTensor<Self>,
        gradients: FloatTensor<Self>,
        features: FloatTensor<Self>,
        parameters: FloatTensor<Self>,
        request: ReluRequest,
    ) -> FloatTensor<Self>;
}

/// A CPU backend, whose tensors lie in the host's memory.
pub trait HostMemory: Backend {
    /// The numbers of a float32 tensor in the order of its axes; a copy only where they do
    /// not lie in that order, or the backend does not show them.
    fn values(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        let data = read::<Self>(tensor.clone());
        let values = data.try_into_vec();
        Cow::Owned(values.expect("fused: tensors are float32 here"))
    }
}

#[cfg(feature = "flex")]
impl HostMemory for burn::backend::Flex {
    fn values(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        match tensor.as_slice() {
            Some(values) => Cow::Borrowed(values),
            None => {
                let values = tensor.clone().into_data().try_into_vec();
                Cow::Owned(values.expect("fused: tensors are float32 here"))
            }
        }
    }
}

#[cfg(feature = "ndarray")]
impl HostMemory for burn::backend::NdArray {}

/// The host's copy of a tensor of a CPU backend.
fn read<B: Backend>(tensor: FloatTensor<B>) -> TensorData {
    use std::task::{Context, Poll, Waker};
    let future = std::pin::pin!(B::float_into_data(tensor));
    match future.poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(data) => data.expect("fused: the memory of a CPU backend can be read"),
        Poll::Pending => unreachable!("fused: CPU backends compute before they return"),
    }
}

fn slice(data: &TensorData) -> &[f32] {
    data.as_slice().expect("fused: networks are float32 here")
}

fn write<B: Backend>(
    values: Vec<f32>,
    shape: impl Into<Vec<usize>>,
    device: &BackendDevice<B>,
) -> FloatTensor<B> {
    B::float_from_data(TensorData::new(values, shape.into()), device)
}

/// What a softplus network says, as tensors.
pub type SoftplusTensors<B> = (FloatTensor<B>, FloatTensor<B>, Option<FloatTensor<B>>);

/// The network of `[parameters, table]`.
fn network_of<'t, B: HostMemory>(
    shape: &SoftplusShape,
    [parameters, table]: &'t [FloatTensor<B>; 2],
) -> SoftplusNetwork<'t> {
    SoftplusNetwork::new(Arch::new(), shape, &B::values(parameters), B::values(table))
}

fn softplus_forward<B: HostMemory>(
    points: &FloatTensor<B>,
    learned: &[FloatTensor<B>; 2],
    request: &SoftplusRequest,
    keep: bool,
) -> (SoftplusTensors<B>, Option<softplus_network::Tape>) {
    let device = points.device();
    let points = B::values(points);
    let network = network_of::<B>(&request.shape, learned);
    let (full, light) = points.split_at(3 * request.full_rows);
    let known = request.known.as_ref().map(KnownRows::as_known);
    let (output, tape) = network.forward(full, known, request.others, keep);
    let SoftplusOutput {
        mut first,
        gradient,
        others,
    } = output;
    match known {
        Some(Known { pass, rows }) => {
            let light = &rows[request.full_rows..];
            first.extend(light.iter().map(|row| pass.first[*row as usize]));
        }
        None => first.extend(network.first(light)),
    }
    let rows = first.len();
    let full = request.full_rows;
    let tensors = (
        write::<B>(first, [rows, 1], &device),
        write::<B>(gradient, [full, 3], &device),
        request
            .others
            .then(|| write::<B>(others, [full, network.others()], &device)),
    );
    (tensors, tape)
}

fn relu_forward<B: HostMemory>(
    inputs: &[FloatTensor<B>; 3],
    parameters: &FloatTensor<B>,
    shape: &ReluShape,
    keep: bool,
) -> (FloatTensor<B>, Option<relu_network::Tape>) {
    let device = inputs[0].device();
    let rows = inputs[0].shape()[0];
    let network = ReluNetwork::new(Arch::new(), shape, &B::values(parameters));
    let inputs = inputs.each_ref().map(B::values);
    let inputs = inputs.each_ref().map(|values| &**values);
    let (out, tape) = network.forward(rows, &inputs, keep);
    (write::<B>(out, [rows, shape.outputs()], &device), tape)
}

macro_rules! on_the_host {
    ($backend:ty) => {
        impl FusedNetworks for $backend {
            fn softplus_network(
                points: FloatTensor<Self>,
                parameters: FloatTensor<Self>,
                table: FloatTensor<Self>,
                request: SoftplusRequest,
            ) -> SoftplusTensors<Self> {
                softplus_forward::<Self>(&points, &[parameters, table], &request, false).0
            }

            fn relu_network(
                inputs: FloatTensor<Self>,
                gradients: FloatTensor<Self>,
                features: FloatTensor<Self>,
                parameters: FloatTensor<Self>,
                request: ReluRequest,
            ) -> FloatTensor<Self> {
                let inputs = [inputs, gradients, features];
                relu_forward::<Self>(&inputs, &parameters, &request.shape, false).0
            }
        }
    };
}

#[cfg(feature = "flex")]
on_the_host!(burn::backend::Flex);
#[cfg(feature = "ndarray")]
on_the_host!(burn::backend::NdArray);

/// [`FusedNetworks::softplus_network`] for tensors of a fused device.
pub(crate) fn softplus_network(
    points: Tensor<2>,
    parameters: Tensor<1>,
    table: Option<Tensor<2>>,
    request: SoftplusRequest,
) -> (Tensor<2>, Tensor<2>, Option<Tensor<2>>) {
    use burn::backend::Dispatch;
    let table = table.unwrap_or_else(|| Tensor::zeros([1, 1], &points.device()));
    let (first, gradient, others) = <Dispatch as FusedNetworks>::softplus_network(
        points.into_dispatch(),
        parameters.into_dispatch(),
        table.into_dispatch(),
        request,
    );
    (
        Tensor::from_dispatch(first),
        Tensor::from_dispatch(gradient),
        others.map(Tensor::from_dispatch),
    )
}

/// [`FusedNetworks::relu_network`] for tensors of a fused device.
pub(crate) fn relu_network(
    inputs: Tensor<2>,
    gradients: Tensor<2>,
    features: Tensor<2>,
    parameters: Tensor<1>,
    request: ReluRequest,
) -> Tensor<2> {
    use burn::backend::Dispatch;
    Tensor::from_dispatch(<Dispatch as FusedNetworks>::relu_network(
        inputs.into_dispatch(),
        gradients.into_dispatch(),
        features.into_dispatch(),
        parameters.into_dispatch(),
        request,
    ))
}
