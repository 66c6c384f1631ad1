//! Softplus and its slopes, one kernel each.
//!
//! Plain operations need nine for the value alone. The slope is the logistic
//! function `s = 1 / (1 + exp(−βz))`; its own slope is `β s (1 − s)`.

use super::{elementwise, empty_like};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, backend_extension};
use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;

/// Activations of a softplus network as operations of a backend; tensors are
/// float32, all of the same shape.
#[backend_extension(Cube, Autodiff)]
pub trait DeviceActivations: Backend {
    /// Softplus of `z`.
    fn device_softplus(z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self>;

    /// `g` times the slope of softplus at `z`.
    fn device_slope(
        g: FloatTensor<Self>,
        z: FloatTensor<Self>,
        sharpness: f32,
    ) -> FloatTensor<Self>;
}

/// What the derivative of [`DeviceActivations::device_slope`] needs besides.
pub trait DeviceCurvature: DeviceActivations {
    /// `a` times `g` times the slope of the slope at `z`.
    fn device_curvature(
        a: FloatTensor<Self>,
        g: FloatTensor<Self>,
        z: FloatTensor<Self>,
        sharpness: f32,
    ) -> FloatTensor<Self>;
}

#[cube]
fn logistic(z: f32, sharpness: f32) -> f32 {
    // Of the magnitude, so that the exponential stays finite.
    let tail = f32::exp(-f32::abs(z) * sharpness);
    let large = 1.0 / (1.0 + tail);
    if z < 0.0 { 1.0 - large } else { large }
}

#[cube(launch)]
fn softplus_kernel(z: &Tensor<f32>, out: &mut Tensor<f32>, sharpness: f32) {
    if ABSOLUTE_POS < out.len() {
        let z = z[ABSOLUTE_POS];
        let tail = f32::log1p(f32::exp(-f32::abs(z) * sharpness)) / sharpness;
        out[ABSOLUTE_POS] = f32::max(z, 0.0) + tail;
    }
}

#[cube(launch)]
fn slope_kernel(g: &Tensor<f32>, z: &Tensor<f32>, out: &mut Tensor<f32>, sharpness: f32) {
    if ABSOLUTE_POS < out.len() {
        out[ABSOLUTE_POS] = g[ABSOLUTE_POS] * logistic(z[ABSOLUTE_POS], sharpness);
    }
}

#[cube(launch)]
fn curvature_kernel(
    a: &Tensor<f32>,
    g: &Tensor<f32>,
    z: &Tensor<f32>,
    out: &mut Tensor<f32>,
    sharpness: f32,
) {
    if ABSOLUTE_POS < out.len() {
        let slope = logistic(z[ABSOLUTE_POS], sharpness);
        let curvature = sharpness * slope * (1.0 - slope);
        out[ABSOLUTE_POS] = a[ABSOLUTE_POS] * g[ABSOLUTE_POS] * curvature;
    }
}

impl DeviceActivations for CubeBackend {
    fn device_softplus(z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self> {
        let z = into_contiguous(z);
        let out = empty_like(&z);
        let (count, dim) = elementwise(&out);
        softplus_kernel::launch(
            &out.client,
            count,
            dim,
            z.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            sharpness,
        );
        out
    }

    fn device_slope(
        g: FloatTensor<Self>,
        z: FloatTensor<Self>,
        sharpness: f32,
    ) -> FloatTensor<Self> {
        let (g, z) = (into_contiguous(g), into_contiguous(z));
        let out = empty_like(&z);
        let (count, dim) = elementwise(&out);
        slope_kernel::launch(
            &out.client,
            count,
            dim,
            g.into_tensor_arg(),
            z.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            sharpness,
        );
        out
    }
}

impl DeviceCurvature for CubeBackend {
    fn device_curvature(
        a: FloatTensor<Self>,
        g: FloatTensor<Self>,
        z: FloatTensor<Self>,
        sharpness: f32,
    ) -> FloatTensor<Self> {
        let (a, g, z) = (into_contiguous(a), into_contiguous(g), into_contiguous(z));
        let out = empty_like(&z);
        let (count, dim) = elementwise(&out);
        curvature_kernel::launch(
            &out.client,
            count,
            dim,
            a.into_tensor_arg(),
            g.into_tensor_arg(),
            z.into_tensor_arg(),
            out.clone().into_tensor_arg(),
            sharpness,
        );
        out
    }
}

#[derive(Debug)]
struct SoftplusOp;

impl<B: DeviceActivations> Backward<B, 1> for SoftplusOp {
    type State = (FloatTensor<B>, f32);

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let adjoint = gradients.consume::<B>(&ops.node);
        let (z, sharpness) = ops.state;
        if let [Some(node)] = ops.parents {
            gradients.register::<B>(node.id, B::device_slope(adjoint, z, sharpness));
        }
    }
}

#[derive(Debug)]
struct SlopeOp;

impl<B: DeviceCurvature> Backward<B, 2> for SlopeOp {
    type State = (FloatTensor<B>, FloatTensor<B>, f32);

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let adjoint = gradients.consume::<B>(&ops.node);
        let (g, z, sharpness) = ops.state;
        let [of_g, of_z] = ops.parents;
        if let Some(node) = of_z {
            let to_z = B::device_curvature(adjoint.clone(), g, z.clone(), sharpness);
            gradients.register::<B>(node.id, to_z);
        }
        if let Some(node) = of_g {
            gradients.register::<B>(node.id, B::device_slope(adjoint, z, sharpness));
        }
    }
}

impl<B: DeviceCurvature, C: CheckpointStrategy> DeviceActivations for Autodiff<B, C> {
    fn device_softplus(z: FloatTensor<Self>, sharpness: f32) -> FloatTensor<Self> {
        let nodes = [z.node()];
        let z = z.into_primitive();
        match SoftplusOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let value = B::device_softplus(z.clone(), sharpness);
                prepared.finish((z, sharpness), value)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::device_softplus(z, sharpness)),
        }
    }

    fn device_slope(
        g: FloatTensor<Self>,
        z: FloatTensor<Self>,
        sharpness: f32,
    ) -> FloatTensor<Self> {
        let nodes = [g.node(), z.node()];
        let (g, z) = (g.into_primitive(), z.into_primitive());
        match SlopeOp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let value = B::device_slope(g.clone(), z.clone(), sharpness);
                prepared.finish((g, z, sharpness), value)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::device_slope(g, z, sharpness)),
        }
    }
}

/// [`DeviceActivations::device_softplus`] for tensors of a GPU.
pub(crate) fn softplus<const D: usize>(z: burn::Tensor<D>, sharpness: f64) -> burn::Tensor<D> {
    use burn::backend::Dispatch;
    burn::Tensor::from_dispatch(<Dispatch as DeviceActivations>::device_softplus(
        z.into_dispatch(),
        sharpness as f32,
    ))
}

/// [`DeviceActivations::device_slope`] for tensors of a GPU.
pub(crate) fn times_slope<const D: usize>(
    g: burn::Tensor<D>,
    z: burn::Tensor<D>,
    sharpness: f64,
) -> burn::Tensor<D> {
    use burn::backend::Dispatch;
    burn::Tensor::from_dispatch(<Dispatch as DeviceActivations>::device_slope(
        g.into_dispatch(),
        z.into_dispatch(),
        sharpness as f32,
    ))
}
