//! Derivatives of the operations in `fused.rs`, by hand-written backward passes.

use super::{
    FusedNetworks, HostMemory, ReluRequest, SoftplusRequest, SoftplusTensors, network_of, read,
    relu_forward, slice, softplus_forward, write,
};
use crate::kernels::cpu::relu_network::{self, ReluNetwork, ReluShape};
use crate::kernels::cpu::softplus_network::{self, SoftplusAdjoint};
use crate::kernels::cpu::{KnownRows, Tape};
use burn::backend::tensor::{Device as BackendDevice, FloatTensor};
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::TensorData;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_autodiff::{Autodiff, NodeId};
use pulp::Arch;
use std::sync::{Arc, Mutex, PoisonError};

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
    /// Parameters and the grid's table.
    learned: [FloatTensor<B>; 2],
    request: SoftplusRequest,
    adjoints: Adjoints,
    tape: Tape<softplus_network::Tape>,
}

impl<B: HostMemory> Backward<B, 3> for SoftplusOp {
    type State = SoftplusState<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let SoftplusState {
            points,
            learned,
            request,
            adjoints,
            tape,
        } = ops.state;
        let device = points.device();
        gradients.consume::<B>(&ops.node);
        let points = B::values(&points);
        let rows = points.len() / 3;
        let network = network_of::<B>(&request.shape, &learned);
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
        let [of_points, of_parameters, of_table] = ops.parents.map(|node| Some(node?.id));
        let gradient = network.backward(
            &points,
            request.known.as_ref().map(KnownRows::as_known),
            adjoint,
            tape.take(),
            of_points.is_some(),
        );
        register_flat::<B>(gradients, of_parameters, gradient.parameters, &device);
        if let (Some(node), Some(to_points)) = (of_points, gradient.points) {
            gradients.register::<B>(node, write::<B>(to_points, [rows, 3], &device));
        }
        if let (Some(node), Some(to_table)) = (of_table, gradient.table) {
            let features = request.shape.grid.map_or(1, |grid| grid.features);
            let entries = to_table.len() / features;
            gradients.register::<B>(node, write::<B>(to_table, [entries, features], &device));
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

impl<B: HostMemory> Backward<B, 4> for ReluOp {
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
        let adjoint = gradients.consume::<B>(&ops.node);
        let inputs = inputs.each_ref().map(B::values);
        let network = ReluNetwork::new(Arch::new(), &shape, &B::values(&parameters));
        let [inputs_node, gradients_node, features_node, of_parameters] =
            ops.parents.map(|node| Some(node?.id));
        let nodes = [inputs_node, gradients_node, features_node];
        let (to_parameters, to_inputs) = network.backward(
            rows,
            &inputs.each_ref().map(|values| &**values),
            &B::values(&adjoint),
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

impl<B: HostMemory + FusedNetworks, C: CheckpointStrategy> FusedNetworks for Autodiff<B, C> {
    fn softplus_network(
        points: FloatTensor<Self>,
        parameters: FloatTensor<Self>,
        table: FloatTensor<Self>,
        request: SoftplusRequest,
    ) -> SoftplusTensors<Self> {
        let nodes = [points.node(), parameters.node(), table.node()];
        let points = points.into_primitive();
        let learned = [parameters.into_primitive(), table.into_primitive()];
        let device = points.device();
        let adjoints = Adjoints::default();
        let (operation, values) = match SoftplusOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let booking = (request.memory).book(request.shape.tape_bytes(request.full_rows));
                let (values, tape) =
                    softplus_forward::<B>(&points, &learned, &request, booking.is_some());
                let state = SoftplusState {
                    points,
                    learned,
                    request,
                    adjoints: Arc::clone(&adjoints),
                    tape: Tape::new(tape, booking),
                };
                (prepared.finish(state, placeholder::<B>(&device)), values)
            }
            OpsKind::UnTracked(prepared) => {
                let [parameters, table] = learned;
                let values = B::softplus_network(points, parameters, table, request);
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
        request: ReluRequest,
    ) -> FloatTensor<Self> {
        let ReluRequest { shape, memory } = request;
        let tensors = [inputs, gradients, features, parameters];
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let [inputs, gradients, features, parameters] =
            tensors.map(|tensor| tensor.into_primitive());
        match ReluOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let inputs = [inputs, gradients, features];
                let booking = memory.book(shape.tape_bytes(inputs[0].shape()[0]));
                let keep = booking.is_some();
                let (out, tape) = relu_forward::<B>(&inputs, &parameters, &shape, keep);
                let state = ReluState {
                    inputs,
                    parameters,
                    shape,
                    tape: Tape::new(tape, booking),
                };
                prepared.finish(state, out)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::relu_network(
                inputs,
                gradients,
                features,
                parameters,
                ReluRequest { shape, memory },
            )),
        }
    }
}
