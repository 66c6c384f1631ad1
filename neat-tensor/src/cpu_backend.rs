//! The CPU's side of [`NeatBackend`].

use crate::fused::{self, ReluRequest, SoftplusRequest};
use crate::grid_encoding::GridEncoding;
use crate::kernels::cpu::KeptMemory;
use crate::kernels::cpu::relu_network::{PartShape, ReluShape};
use crate::kernels::cpu::softplus_network::SoftplusShape;
use crate::linear::{Linear, flat_parameters, layer_shapes};
use crate::neat_backend::{
    AdamNumbers, DistanceNetwork, Field, FieldQuery, NeatBackend, SampleInputs,
};
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

/// burn's CPU backends, in float32: whole networks as single operations, and one pass
/// over memory for the optimiser.
#[derive(Clone, Debug)]
pub struct Cpu {
    memory: KeptMemory,
}

impl Cpu {
    /// With `memory` for activations that wait for a later pass.
    pub fn new(memory: KeptMemory) -> Self {
        Self { memory }
    }

    /// That memory.
    pub fn memory(&self) -> &KeptMemory {
        &self.memory
    }
}

impl NeatBackend for Cpu {
    fn has_kernels(&self) -> bool {
        true
    }

    fn works_on_host(&self) -> bool {
        true
    }

    fn encode_grid(&self, grid: &GridEncoding, x: Tensor<2>) -> Tensor<2> {
        fused::grid_features(x, grid.table.val(), &grid.shape)
    }

    fn distance_network(
        &self,
        network: DistanceNetwork<'_>,
        points: Tensor<2>,
        query: FieldQuery,
    ) -> Option<Field> {
        let request = SoftplusRequest {
            shape: network.shape(),
            full_rows: points.dims()[0] - query.light_rows,
            others: query.others,
            known: query.known,
            memory: self.memory.clone(),
        };
        let parameters = flat_parameters(network.layers);
        let table = network.grid.map(|grid| grid.table.val());
        let (first, gradient, others) = fused::softplus_network(points, parameters, table, request);
        Some(Field {
            first,
            gradient,
            others,
        })
    }

    fn sample_network(&self, layers: &[Linear], inputs: SampleInputs) -> Option<Tensor<2>> {
        let sources = [&inputs.rays, &inputs.gradients, &inputs.features].map(|t| t.dims()[1]);
        let whole = |source: usize| PartShape {
            source,
            column: 0,
            width: sources[source],
            octaves: 0,
        };
        let of_rays = inputs
            .ray_parts
            .iter()
            .map(|(column, width, encoding)| PartShape {
                source: 0,
                column: *column,
                width: *width,
                octaves: encoding.octaves,
            });
        let request = ReluRequest {
            shape: ReluShape {
                layers: layer_shapes(layers),
                sources: sources.to_vec(),
                parts: of_rays.chain([whole(1), whole(2)]).collect(),
            },
            memory: self.memory.clone(),
        };
        Some(fused::relu_network(
            inputs.rays,
            inputs.gradients,
            inputs.features,
            flat_parameters(layers),
            request,
        ))
    }

    fn adam(
        &self,
        value: Tensor<1>,
        gradient: Tensor<1>,
        moments: Option<[Tensor<1>; 2]>,
        numbers: AdamNumbers,
    ) -> (Tensor<1>, [Tensor<1>; 2]) {
        let device = gradient.device();
        let moments = moments.unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
        let ([mut first, mut second], mut value) = (moments.map(host), host(value));
        let [beta1, beta2] = [numbers.beta1, numbers.beta2].map(|beta| beta as f32);
        let [rest1, rest2] = [numbers.beta1, numbers.beta2].map(|beta| (1.0 - beta) as f32);
        let (rate, epsilon) = (numbers.rate as f32, numbers.epsilon as f32);
        // Tables of grids have millions of numbers.
        let moments = (first.par_chunks_mut(ADAM_CHUNK)).zip(second.par_chunks_mut(ADAM_CHUNK));
        let gradient = host(gradient);
        (value
            .par_chunks_mut(ADAM_CHUNK)
            .zip(gradient.par_chunks(ADAM_CHUNK))
            .zip(moments))
        .for_each(|((value, gradient), (first, second))| {
            let moments = first.iter_mut().zip(second);
            for ((value, g), (m, v)) in value.iter_mut().zip(gradient).zip(moments) {
                *m = g * rest1 + *m * beta1;
                *v = g * g * rest2 + *v * beta2;
                *value -= *m / (v.sqrt() + epsilon) * rate;
            }
        });
        let tensor = |values| vector(values, &device);
        (tensor(value), [tensor(first), tensor(second)])
    }
}

impl DistanceNetwork<'_> {
    /// What kernels know of it.
    pub(crate) fn shape(&self) -> SoftplusShape {
        SoftplusShape {
            layers: layer_shapes(self.layers),
            octaves: self.octaves,
            grid: self.grid.map(|grid| grid.shape.clone()),
            skip: self.skip,
            sharpness: self.sharpness as f32,
        }
    }
}

/// Numbers that one task of Adam moves.
const ADAM_CHUNK: usize = 1 << 15;

fn vector(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let len = values.len();
    Tensor::from_data(TensorData::new(values, [len]), device)
}

/// The values of a float32 tensor of a CPU backend.
fn host(tensor: Tensor<1>) -> Vec<f32> {
    tensor
        .into_data()
        .try_into_vec()
        .expect("Adam: float32 was asked for")
}
