//! The positional encoding and its Jacobian, one kernel each.
//!
//! Of a row `x` with `W` numbers the encoding has the columns `x`, `sin x`,
//! `cos x`, `sin 2x`, `cos 2x`, …, `W` numbers each.

use super::{elementwise, empty_of};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata, backend_extension};
use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;

/// The encoding as operations of a backend; tensors are float32 matrices of the
/// same number of rows.
#[backend_extension(Cube, Autodiff)]
pub trait DeviceEncoding: Backend {
    /// The encoding `[N, W (1 + 2 octaves)]` of `x` `[N, W]`.
    fn device_encode(x: FloatTensor<Self>, octaves: usize) -> FloatTensor<Self>;

    /// `gradient`, with respect to the encoding of `x`, times its Jacobian.
    fn device_pull_back(
        x: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self>;
}

/// What the derivatives of [`DeviceEncoding::device_pull_back`] need besides.
pub trait DeviceEncodingSlopes: DeviceEncoding {
    /// The Jacobian of the encoding at `x` times `a` `[N, W]`.
    fn device_push_forward(
        x: FloatTensor<Self>,
        a: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self>;

    /// `a` times the derivative of the pulled back `gradient` with respect to `x`.
    fn device_bend(
        x: FloatTensor<Self>,
        a: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self>;
}

/// `sin(x + half_turns · π)`, by the series of [`crate::sine`]: what drivers offer
/// may be off by 10⁻⁴.
#[cube]
fn sine(x: f32, half_turns: f32) -> f32 {
    let k = f32::round(x * 0.318_309_87 + half_turns);
    let turns = k - half_turns;
    let r = x - turns * 3.140_625;
    let r = r - turns * 9.675_026e-4;
    let r = r - turns * 1.509_958e-7;
    let odd = k - f32::floor(k * 0.5) * 2.0;
    let square = r * r;
    let series = square * 1.605_904_4e-10 - 2.505_210_8e-8;
    let series = series * square + 2.755_731_9e-6;
    let series = series * square - 1.984_127e-4;
    let series = series * square + 8.333_333e-3;
    let series = series * square - 1.666_666_7e-1;
    (1.0 - 2.0 * odd) * r * (series * square + 1.0)
}

/// `2^octave`.
#[cube]
fn frequency(octave: usize) -> f32 {
    let mut frequency = 1.0f32;
    for _ in 0..octave {
        frequency *= 2.0;
    }
    frequency
}

#[cube(launch)]
fn encode_kernel(x: &Tensor<f32>, out: &mut Tensor<f32>, width: usize, columns: usize) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / columns;
        let column = ABSOLUTE_POS % columns;
        let x = x[row * width + column % width];
        let block = column / width;
        let mut value = x;
        if block > 0 {
            let wave = (block - 1) % 2;
            let angle = x * frequency((block - 1) / 2);
            value = sine(angle, if wave == 0 { 0.0f32 } else { 0.5f32 });
        }
        out[ABSOLUTE_POS] = value;
    }
}

#[cube(launch)]
fn pull_back_kernel(
    x: &Tensor<f32>,
    gradient: &Tensor<f32>,
    out: &mut Tensor<f32>,
    width: usize,
    octaves: usize,
) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / width;
        let first = row * width * (1 + 2 * octaves) + ABSOLUTE_POS % width;
        let x = x[ABSOLUTE_POS];
        let mut sum = gradient[first];
        let mut frequency = 1.0f32;
        for octave in 0..octaves {
            let of_sin = gradient[first + width * (1 + 2 * octave)];
            let of_cos = gradient[first + width * (2 + 2 * octave)];
            let angle = x * frequency;
            sum += (of_sin * sine(angle, 0.5) - of_cos * sine(angle, 0.0)) * frequency;
            frequency *= 2.0;
        }
        out[ABSOLUTE_POS] = sum;
    }
}

#[cube(launch)]
fn push_forward_kernel(
    x: &Tensor<f32>,
    a: &Tensor<f32>,
    out: &mut Tensor<f32>,
    width: usize,
    columns: usize,
) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / columns;
        let column = ABSOLUTE_POS % columns;
        let source = row * width + column % width;
        let block = column / width;
        let mut value = a[source];
        if block > 0 {
            let wave = (block - 1) % 2;
            let frequency = frequency((block - 1) / 2);
            let angle = x[source] * frequency;
            // cos, or −sin: a quarter turn ahead of the wave.
            let slope = if wave == 0 {
                sine(angle, 0.5)
            } else {
                -sine(angle, 0.0)
            };
            value *= slope * frequency;
        }
        out[ABSOLUTE_POS] = value;
    }
}

#[cube(launch)]
fn bend_kernel(
    x: &Tensor<f32>,
    a: &Tensor<f32>,
    gradient: &Tensor<f32>,
    out: &mut Tensor<f32>,
    width: usize,
    octaves: usize,
) {
    if ABSOLUTE_POS < out.len() {
        let row = ABSOLUTE_POS / width;
        let first = row * width * (1 + 2 * octaves) + ABSOLUTE_POS % width;
        let x = x[ABSOLUTE_POS];
        let mut sum = 0.0f32;
        let mut frequency = 1.0f32;
        for octave in 0..octaves {
            let of_sin = gradient[first + width * (1 + 2 * octave)];
            let of_cos = gradient[first + width * (2 + 2 * octave)];
            let angle = x * frequency;
            let wave = of_sin * sine(angle, 0.0) + of_cos * sine(angle, 0.5);
            sum -= wave * frequency * frequency;
            frequency *= 2.0;
        }
        out[ABSOLUTE_POS] = a[ABSOLUTE_POS] * sum;
    }
}

impl DeviceEncoding for CubeBackend {
    fn device_encode(x: FloatTensor<Self>, octaves: usize) -> FloatTensor<Self> {
        let x = into_contiguous(x);
        let [rows, width] = x.shape().dims();
        let columns = width * (1 + 2 * octaves);
        let out = empty_of(&x, [rows, columns]);
        let (count, dim) = elementwise(&out);
        encode_kernel::launch(
            &out.client,
            count,
            dim,
            x.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            width,
            columns,
        );
        out
    }

    fn device_pull_back(
        x: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self> {
        let (x, gradient) = (into_contiguous(x), into_contiguous(gradient));
        let [rows, width] = x.shape().dims();
        let out = empty_of(&x, [rows, width]);
        let (count, dim) = elementwise(&out);
        pull_back_kernel::launch(
            &out.client,
            count,
            dim,
            x.into_tensor_arg(),
            gradient.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            width,
            octaves,
        );
        out
    }
}

impl DeviceEncodingSlopes for CubeBackend {
    fn device_push_forward(
        x: FloatTensor<Self>,
        a: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self> {
        let (x, a) = (into_contiguous(x), into_contiguous(a));
        let [rows, width] = x.shape().dims();
        let columns = width * (1 + 2 * octaves);
        let out = empty_of(&x, [rows, columns]);
        let (count, dim) = elementwise(&out);
        push_forward_kernel::launch(
            &out.client,
            count,
            dim,
            x.into_tensor_arg(),
            a.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            width,
            columns,
        );
        out
    }

    fn device_bend(
        x: FloatTensor<Self>,
        a: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self> {
        let (x, a) = (into_contiguous(x), into_contiguous(a));
        let gradient = into_contiguous(gradient);
        let [rows, width] = x.shape().dims();
        let out = empty_of(&x, [rows, width]);
        let (count, dim) = elementwise(&out);
        bend_kernel::launch(
            &out.client,
            count,
            dim,
            x.into_tensor_arg(),
            a.into_tensor_arg(),
            gradient.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            width,
            octaves,
        );
        out
    }
}

#[derive(Debug)]
struct EncodeOp;

impl<B: DeviceEncoding> Backward<B, 1> for EncodeOp {
    type State = (FloatTensor<B>, usize);

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let adjoint = gradients.consume::<B>(&ops.node);
        let (x, octaves) = ops.state;
        if let [Some(node)] = ops.parents {
            gradients.register::<B>(node.id, B::device_pull_back(x, adjoint, octaves));
        }
    }
}

#[derive(Debug)]
struct PullBackOp;

impl<B: DeviceEncodingSlopes> Backward<B, 2> for PullBackOp {
    type State = (FloatTensor<B>, FloatTensor<B>, usize);

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let adjoint = gradients.consume::<B>(&ops.node);
        let (x, gradient, octaves) = ops.state;
        let [of_x, of_gradient] = ops.parents;
        if let Some(node) = of_x {
            let to_x = B::device_bend(x.clone(), adjoint.clone(), gradient, octaves);
            gradients.register::<B>(node.id, to_x);
        }
        if let Some(node) = of_gradient {
            gradients.register::<B>(node.id, B::device_push_forward(x, adjoint, octaves));
        }
    }
}

impl<B: DeviceEncodingSlopes, C: CheckpointStrategy> DeviceEncoding for Autodiff<B, C> {
    fn device_encode(x: FloatTensor<Self>, octaves: usize) -> FloatTensor<Self> {
        let nodes = [x.node()];
        let x = x.into_primitive();
        match EncodeOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let value = B::device_encode(x.clone(), octaves);
                prepared.finish((x, octaves), value)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::device_encode(x, octaves)),
        }
    }

    fn device_pull_back(
        x: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        octaves: usize,
    ) -> FloatTensor<Self> {
        let nodes = [x.node(), gradient.node()];
        let (x, gradient) = (x.into_primitive(), gradient.into_primitive());
        match PullBackOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let value = B::device_pull_back(x.clone(), gradient.clone(), octaves);
                prepared.finish((x, gradient, octaves), value)
            }
            OpsKind::UnTracked(prepared) => {
                prepared.finish(B::device_pull_back(x, gradient, octaves))
            }
        }
    }
}

/// [`DeviceEncoding::device_encode`] for tensors of a GPU.
pub(crate) fn encode(x: burn::Tensor<2>, octaves: usize) -> burn::Tensor<2> {
    use burn::backend::Dispatch;
    let x = x.into_dispatch();
    burn::Tensor::from_dispatch(<Dispatch as DeviceEncoding>::device_encode(x, octaves))
}

/// [`DeviceEncoding::device_pull_back`] for tensors of a GPU.
pub(crate) fn pull_back(
    x: burn::Tensor<2>,
    gradient: burn::Tensor<2>,
    octaves: usize,
) -> burn::Tensor<2> {
    use burn::backend::Dispatch;
    let (x, gradient) = (x.into_dispatch(), gradient.into_dispatch());
    burn::Tensor::from_dispatch(<Dispatch as DeviceEncoding>::device_pull_back(
        x, gradient, octaves,
    ))
}
