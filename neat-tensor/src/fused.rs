//! Coordinate networks as single operations: burn's extension trait, its
//! derivatives, and what decides where it is used.
//!
//! On the CPU backends a whole network, with the gradient of its first output, is
//! one operation over [`crate::kernels`]. Elsewhere, and in float64, the plain
//! tensor operations of [`crate::coordinate_mlp`] and [`crate::linear`] do the
//! same; they are also the oracle of the tests.

#![allow(deprecated)] // ndarray is still one of the backends that neat promises

use crate::kernels::relu_network::{self, ReluNetwork, ReluShape};
use crate::kernels::softplus_network::{
    self, FirstPass, Known, SoftplusAdjoint, SoftplusNetwork, SoftplusOutput, SoftplusShape,
};
use burn::backend::tensor::{Device as BackendDevice, FloatTensor};
use burn::backend::{Backend, TensorMetadata, backend_extension};
use burn::tensor::{DType, Device, Tensor, TensorData};
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_autodiff::{Autodiff, NodeId};
use pulp::Arch;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// See [`set_enabled`].
static ENABLED: AtomicBool = AtomicBool::new(true);

/// Turns fused operations and kernels of GPUs off, or on again, in the whole process: for
/// measurements and tests that want the plain tensor operations. Set it before
/// the first network is evaluated; a pass under way may mix both.
pub fn set_enabled(enabled: bool) {
    ENABLED.store(enabled, Ordering::Relaxed);
}

/// See [`set_enabled`].
#[cfg(feature = "wgpu")]
pub(crate) fn enabled() -> bool {
    ENABLED.load(Ordering::Relaxed)
}

/// Whether networks on `device` run as fused operations (in float32).
pub fn is_fused(device: &Device) -> bool {
    ENABLED.load(Ordering::Relaxed) && is_on_host(device)
}

/// Whether tensors on `device` (in float32) go through hand-written twins of tensor
/// operations: fused networks, or kernels of a GPU.
pub fn has_own_kernels(device: &Device) -> bool {
    #[cfg(feature = "wgpu")]
    if crate::device_kernels::has_kernels(device) {
        return true;
    }
    is_fused(device)
}

/// Whether `device` is the CPU, whose memory is the host's.
pub(crate) fn is_on_host(device: &Device) -> bool {
    use burn::backend::DispatchDevice;
    match device.clone().inner().as_dispatch() {
        #[cfg(feature = "flex")]
        DispatchDevice::Flex(_) => true,
        #[cfg(feature = "ndarray")]
        DispatchDevice::NdArray(_) => true,
        _ => false,
    }
}

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
}

/// Rows that an earlier pass with the same parameters has seen.
#[derive(Clone, Debug)]
pub struct KnownRows {
    /// That pass.
    pub pass: Arc<KnownPass>,
    /// Of each row at hand its number there.
    pub rows: Arc<[u32]>,
}

/// A pass that stays in memory for later ones.
#[derive(Debug)]
pub struct KnownPass {
    /// First outputs and activations.
    pub pass: FirstPass,
    _booking: Booking,
}

impl KnownPass {
    /// Runs the pass, unless there is no room to keep it.
    pub fn run(network: &SoftplusNetwork, points: &[f32]) -> Option<Self> {
        let bytes = network.shape().first_pass_bytes(points.len() / 3);
        let booking = Booking::of(bytes)?;
        Some(Self {
            pass: network.first_pass(points),
            _booking: booking,
        })
    }
}

impl KnownRows {
    /// A pass over `points` `[N, 3]`, and which of its rows the rows at hand are;
    /// nothing where there is no room to keep it.
    pub fn new(network: &SoftplusNetwork, points: &[f32], rows: Arc<[u32]>) -> Option<Self> {
        let pass = Arc::new(KnownPass::run(network, points)?);
        Some(Self { pass, rows })
    }

    fn as_known(&self) -> Known<'_> {
        Known {
            pass: &self.pass.pass,
            rows: &self.rows,
        }
    }
}

/// Networks as operations of a backend.
///
/// Tensors are float32. `parameters` `[P]` hold of each layer the weight
/// `[outputs, inputs]`, row-major, then the bias.
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
        shape: ReluShape,
    ) -> FloatTensor<Self>;
}

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

/// Bytes of all activations that wait for a later pass.
static KEPT_BYTES: AtomicUsize = AtomicUsize::new(0);
/// Most of them: beyond, activations are computed again.
const MAX_KEPT_BYTES: usize = 2 << 30;

/// A share of the memory for activations, given back when it is dropped.
#[derive(Debug)]
struct Booking(usize);

impl Booking {
    /// `bytes` more, if they fit.
    fn of(bytes: usize) -> Option<Self> {
        let fits = |used: usize| used.checked_add(bytes).filter(|sum| *sum <= MAX_KEPT_BYTES);
        KEPT_BYTES
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits)
            .ok()
            .map(|_| Self(bytes))
    }
}

impl Drop for Booking {
    fn drop(&mut self) {
        KEPT_BYTES.fetch_sub(self.0, Ordering::Relaxed);
    }
}

/// The activations of a forward pass, taken by its backward pass.
#[derive(Debug)]
struct Tape<T>(Arc<Mutex<Option<(T, Booking)>>>);

impl<T> Clone for Tape<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Tape<T> {
    fn new(tape: Option<T>, booking: Option<Booking>) -> Self {
        Self(Arc::new(Mutex::new(tape.zip(booking))))
    }

    fn take(&self) -> Option<T> {
        lock(&self.0).take().map(|(tape, _)| tape)
    }
}

/// What a softplus network says, as tensors.
type SoftplusTensors<B> = (FloatTensor<B>, FloatTensor<B>, Option<FloatTensor<B>>);

fn softplus_forward<B: Backend>(
    points: FloatTensor<B>,
    parameters: FloatTensor<B>,
    request: &SoftplusRequest,
    keep: bool,
) -> (SoftplusTensors<B>, Option<softplus_network::Tape>) {
    let device = points.device();
    let (points, parameters) = (read::<B>(points), read::<B>(parameters));
    let network = SoftplusNetwork::new(Arch::new(), &request.shape, slice(&parameters));
    let (full, light) = slice(&points).split_at(3 * request.full_rows);
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

fn relu_forward<B: Backend>(
    inputs: [FloatTensor<B>; 3],
    parameters: FloatTensor<B>,
    shape: &ReluShape,
    keep: bool,
) -> (FloatTensor<B>, Option<relu_network::Tape>) {
    let device = inputs[0].device();
    let rows = inputs[0].shape()[0];
    let inputs = inputs.map(read::<B>);
    let parameters = read::<B>(parameters);
    let network = ReluNetwork::new(Arch::new(), shape, slice(&parameters));
    let inputs = inputs.each_ref().map(slice);
    let (out, tape) = network.forward(rows, &inputs, keep);
    (write::<B>(out, [rows, shape.outputs()], &device), tape)
}

macro_rules! on_the_host {
    ($backend:ty) => {
        impl FusedNetworks for $backend {
            fn softplus_network(
                points: FloatTensor<Self>,
                parameters: FloatTensor<Self>,
                request: SoftplusRequest,
            ) -> SoftplusTensors<Self> {
                softplus_forward::<Self>(points, parameters, &request, false).0
            }

            fn relu_network(
                inputs: FloatTensor<Self>,
                gradients: FloatTensor<Self>,
                features: FloatTensor<Self>,
                parameters: FloatTensor<Self>,
                shape: ReluShape,
            ) -> FloatTensor<Self> {
                let inputs = [inputs, gradients, features];
                relu_forward::<Self>(inputs, parameters, &shape, false).0
            }
        }
    };
}

#[cfg(feature = "flex")]
on_the_host!(burn::backend::Flex);
#[cfg(feature = "ndarray")]
on_the_host!(burn::backend::NdArray);

/// Derivative of [`FusedNetworks::softplus_network`].
///
/// An operation of burn has one output and this network three. The operation
/// itself therefore gives a placeholder, of which the three outputs are
/// [`OutputOp`]s: each leaves its adjoint with the operation, and passes a
/// placeholder on so that the operation's own turn comes after theirs.
#[derive(Debug)]
struct SoftplusOp;

/// Adjoints that the outputs have left: first, gradient, others.
type Adjoints = Arc<Mutex<[Option<TensorData>; 3]>>;

#[derive(Clone, Debug)]
struct SoftplusState<B: Backend> {
    points: FloatTensor<B>,
    parameters: FloatTensor<B>,
    request: SoftplusRequest,
    adjoints: Adjoints,
    tape: Tape<softplus_network::Tape>,
}

impl<B: Backend> Backward<B, 2> for SoftplusOp {
    type State = SoftplusState<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let SoftplusState {
            points,
            parameters,
            request,
            adjoints,
            tape,
        } = ops.state;
        let device = points.device();
        gradients.consume::<B>(&ops.node);
        let (points, parameters) = (read::<B>(points), read::<B>(parameters));
        let points = slice(&points);
        let rows = points.len() / 3;
        let network = SoftplusNetwork::new(Arch::new(), &request.shape, slice(&parameters));
        let adjoints = std::mem::take(&mut *lock(&adjoints));
        // An output that nothing depends on has left none.
        let [first, gradient] = [(0, rows), (1, 3 * request.full_rows)].map(|(i, len)| {
            let zeros = adjoints[i].is_none().then(|| vec![0.0f32; len]);
            zeros.unwrap_or_default()
        });
        let adjoint_or = |i: usize, zeros| adjoints[i].as_ref().map_or(zeros, slice);
        let adjoint = SoftplusAdjoint {
            first: adjoint_or(0, &first),
            gradient: adjoint_or(1, &gradient),
            others: adjoint_or(2, &[]),
        };
        let [of_points, of_parameters] = ops.parents.map(|node| Some(node?.id));
        let (to_parameters, to_points) = network.backward(
            points,
            request.known.as_ref().map(KnownRows::as_known),
            adjoint,
            tape.take(),
            of_points.is_some(),
        );
        register_flat::<B>(gradients, of_parameters, to_parameters, &device);
        if let (Some(node), Some(to_points)) = (of_points, to_points) {
            gradients.register::<B>(node, write::<B>(to_points, [rows, 3], &device));
        }
    }
}

/// Hands the gradient of flat parameters to their node, if they have one.
fn register_flat<B: Backend>(
    gradients: &mut Gradients,
    node: Option<NodeId>,
    values: Vec<f32>,
    device: &BackendDevice<B>,
) {
    if let Some(node) = node {
        let len = values.len();
        gradients.register::<B>(node, write::<B>(values, [len], device));
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One of several outputs of an operation; see [`SoftplusOp`].
#[derive(Debug)]
struct OutputOp;

impl<B: Backend> Backward<B, 1> for OutputOp {
    type State = (Adjoints, usize);

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let (adjoints, output) = ops.state;
        let adjoint = gradients.consume::<B>(&ops.node);
        let device = adjoint.device();
        lock(&adjoints)[output] = Some(read::<B>(adjoint));
        let [operation] = ops.parents;
        if let Some(node) = operation {
            gradients.register::<B>(node.id, placeholder::<B>(&device));
        }
    }
}

fn placeholder<B: Backend>(device: &BackendDevice<B>) -> FloatTensor<B> {
    write::<B>(vec![0.0], [1], device)
}

/// Output `output` of the operation that `operation` stands for.
fn output_of<B: Backend, C: CheckpointStrategy>(
    operation: &FloatTensor<Autodiff<B, C>>,
    adjoints: &Adjoints,
    output: usize,
    value: FloatTensor<B>,
) -> FloatTensor<Autodiff<B, C>> {
    let prepared = OutputOp.prepare::<C>([operation.node()]);
    match prepared.compute_bound().stateful() {
        OpsKind::Tracked(prepared) => prepared.finish((Arc::clone(adjoints), output), value),
        OpsKind::UnTracked(prepared) => prepared.finish(value),
    }
}

/// Derivative of [`FusedNetworks::relu_network`].
#[derive(Debug)]
struct ReluOp;

#[derive(Clone, Debug)]
struct ReluState<B: Backend> {
    /// Inputs, gradients and features.
    inputs: [FloatTensor<B>; 3],
    parameters: FloatTensor<B>,
    shape: ReluShape,
    tape: Tape<relu_network::Tape>,
}

impl<B: Backend> Backward<B, 4> for ReluOp {
    type State = ReluState<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 4>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let ReluState {
            inputs,
            parameters,
            shape,
            tape,
        } = ops.state;
        let device = inputs[0].device();
        let rows = inputs[0].shape()[0];
        let adjoint = read::<B>(gradients.consume::<B>(&ops.node));
        let (inputs, parameters) = (inputs.map(read::<B>), read::<B>(parameters));
        let network = ReluNetwork::new(Arch::new(), &shape, slice(&parameters));
        let [inputs_node, gradients_node, features_node, of_parameters] =
            ops.parents.map(|node| Some(node?.id));
        let nodes = [inputs_node, gradients_node, features_node];
        let (to_parameters, to_inputs) = network.backward(
            rows,
            &inputs.each_ref().map(slice),
            slice(&adjoint),
            tape.take(),
            &nodes.each_ref().map(Option::is_some),
        );
        register_flat::<B>(gradients, of_parameters, to_parameters, &device);
        for (node, to_input) in nodes.into_iter().zip(to_inputs) {
            if let (Some(node), Some(to_input)) = (node, to_input) {
                let width = to_input.len().checked_div(rows).unwrap_or(0);
                gradients.register::<B>(node, write::<B>(to_input, [rows, width], &device));
            }
        }
    }
}

impl<B: Backend + FusedNetworks, C: CheckpointStrategy> FusedNetworks for Autodiff<B, C> {
    fn softplus_network(
        points: FloatTensor<Self>,
        parameters: FloatTensor<Self>,
        request: SoftplusRequest,
    ) -> SoftplusTensors<Self> {
        let nodes = [points.node(), parameters.node()];
        let (points, parameters) = (points.into_primitive(), parameters.into_primitive());
        let device = points.device();
        let adjoints = Adjoints::default();
        let (operation, values) = match SoftplusOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let booking = Booking::of(request.shape.tape_bytes(request.full_rows));
                let (values, tape) = softplus_forward::<B>(
                    points.clone(),
                    parameters.clone(),
                    &request,
                    booking.is_some(),
                );
                let state = SoftplusState {
                    points,
                    parameters,
                    request,
                    adjoints: Arc::clone(&adjoints),
                    tape: Tape::new(tape, booking),
                };
                (prepared.finish(state, placeholder::<B>(&device)), values)
            }
            OpsKind::UnTracked(prepared) => {
                let values = B::softplus_network(points, parameters, request);
                (prepared.finish(placeholder::<B>(&device)), values)
            }
        };
        let output = |i: usize, value| output_of::<B, C>(&operation, &adjoints, i, value);
        let (first, gradient, others) = values;
        (
            output(0, first),
            output(1, gradient),
            others.map(|others| output(2, others)),
        )
    }

    fn relu_network(
        inputs: FloatTensor<Self>,
        gradients: FloatTensor<Self>,
        features: FloatTensor<Self>,
        parameters: FloatTensor<Self>,
        shape: ReluShape,
    ) -> FloatTensor<Self> {
        let tensors = [inputs, gradients, features, parameters];
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let [inputs, gradients, features, parameters] =
            tensors.map(|tensor| tensor.into_primitive());
        match ReluOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let inputs = [inputs, gradients, features];
                let booking = Booking::of(shape.tape_bytes(inputs[0].shape()[0]));
                let keep = booking.is_some();
                let (out, tape) =
                    relu_forward::<B>(inputs.clone(), parameters.clone(), &shape, keep);
                let state = ReluState {
                    inputs,
                    parameters,
                    shape,
                    tape: Tape::new(tape, booking),
                };
                prepared.finish(state, out)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::relu_network(
                inputs, gradients, features, parameters, shape,
            )),
        }
    }
}

/// [`FusedNetworks::softplus_network`] for tensors of a fused device.
pub(crate) fn softplus_network(
    points: Tensor<2>,
    parameters: Tensor<1>,
    request: SoftplusRequest,
) -> (Tensor<2>, Tensor<2>, Option<Tensor<2>>) {
    use burn::backend::Dispatch;
    let (first, gradient, others) = <Dispatch as FusedNetworks>::softplus_network(
        points.into_dispatch(),
        parameters.into_dispatch(),
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
    shape: ReluShape,
) -> Tensor<2> {
    use burn::backend::Dispatch;
    Tensor::from_dispatch(<Dispatch as FusedNetworks>::relu_network(
        inputs.into_dispatch(),
        gradients.into_dispatch(),
        features.into_dispatch(),
        parameters.into_dispatch(),
        shape,
    ))
}

/// Whether `tensor` can go through a fused operation.
pub(crate) fn takes_fused(tensor: &Tensor<2>) -> bool {
    tensor.dtype() == DType::F32 && is_fused(&tensor.device())
}
