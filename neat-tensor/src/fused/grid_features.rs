//! Features of learned grids as one operation of burn's CPU backends, for the networks that
//! take them as inputs. The distance network has grids of its own inside.

#![allow(deprecated)] // ndarray is still one of the backends that neat promises

use super::{HostMemory, write};
use crate::kernels::cpu::grid::GridShape;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::CheckpointStrategy;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use pulp::Arch;

/// Learned grids as an operation of a backend. Tensors are float32.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Autodiff,
)]
pub trait FusedGrids: Backend {
    /// The features `[N, levels · features]` of `table` `[entries, features]` at `points`
    /// `[N, 3]`.
    fn grid_features(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self>;
}

fn features<B: HostMemory>(
    points: &FloatTensor<B>,
    table: &FloatTensor<B>,
    shape: &GridShape,
) -> FloatTensor<B> {
    let rows = points.shape()[0];
    let values = shape.features_at(Arch::new(), &B::values(points), &B::values(table));
    write::<B>(values, [rows, shape.width()], &points.device())
}

macro_rules! on_the_host {
    ($backend:ty) => {
        impl FusedGrids for $backend {
            fn grid_features(
                points: FloatTensor<Self>,
                table: FloatTensor<Self>,
                shape: GridShape,
            ) -> FloatTensor<Self> {
                features::<Self>(&points, &table, &shape)
            }
        }
    };
}

#[cfg(feature = "flex")]
on_the_host!(burn::backend::Flex);
#[cfg(feature = "ndarray")]
on_the_host!(burn::backend::NdArray);

/// Derivative of [`FusedGrids::grid_features`].
#[derive(Debug)]
struct FeaturesOp;

#[derive(Clone, Debug)]
struct FeaturesState<B: Backend> {
    points: FloatTensor<B>,
    table: FloatTensor<B>,
    shape: GridShape,
}

impl<B: HostMemory> Backward<B, 2> for FeaturesOp {
    type State = FeaturesState<B>;

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let FeaturesState {
            points,
            table,
            shape,
        } = ops.state;
        let (device, arch) = (points.device(), Arch::new());
        let adjoint = gradients.consume::<B>(&ops.node);
        let (at, adjoint) = (B::values(&points), B::values(&adjoint));
        let [of_points, of_table] = ops.parents;
        if let Some(node) = of_points {
            let gradient = shape.features_to_points(arch, &at, &B::values(&table), &adjoint);
            gradients.register::<B>(node.id, write::<B>(gradient, points.shape(), &device));
        }
        if let Some(node) = of_table {
            let gradient = shape.features_to_table(arch, &at, &adjoint);
            gradients.register::<B>(node.id, write::<B>(gradient, table.shape(), &device));
        }
    }
}

impl<B: HostMemory + FusedGrids, C: CheckpointStrategy> FusedGrids for Autodiff<B, C> {
    fn grid_features(
        points: FloatTensor<Self>,
        table: FloatTensor<Self>,
        shape: GridShape,
    ) -> FloatTensor<Self> {
        let prepared = FeaturesOp.prepare::<C>([points.node(), table.node()]);
        let (points, table) = (points.into_primitive(), table.into_primitive());
        let out = features::<B>(&points, &table, &shape);
        let state = FeaturesState {
            points,
            table,
            shape,
        };
        match prepared.compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish(state, out),
            OpsKind::UnTracked(prepared) => prepared.finish(out),
        }
    }
}

/// [`FusedGrids::grid_features`] for tensors of a fused device.
pub(crate) fn grid_features(points: Tensor<2>, table: Tensor<2>, shape: &GridShape) -> Tensor<2> {
    use burn::backend::Dispatch;
    let (points, table) = (points.into_dispatch(), table.into_dispatch());
    let features = <Dispatch as FusedGrids>::grid_features(points, table, shape.clone());
    Tensor::from_dispatch(features)
}
