//! What the candidates have in common, and the present network as one of them.

use super::grid_network::SHARPNESS;
use neat_tensor::kernels::Arch;
use neat_tensor::kernels::layers::LayerShape;
use neat_tensor::kernels::softplus_network::{
    SoftplusAdjoint, SoftplusNetwork, SoftplusShape, Tape,
};
use neat_tensor::random::standard_normal;
use rand::Rng;
use std::f64::consts::PI;

/// What a field says of `N` points.
pub struct Output {
    /// Distance.
    pub first: Vec<f32>,
    /// Its gradient with respect to the point.
    pub gradient: Vec<[f32; 3]>,
    /// Features `[N, outputs − 1]`.
    pub others: Vec<f32>,
}

/// Adjoints of an [`Output`].
pub struct Adjoint {
    /// Of the distances.
    pub first: Vec<f32>,
    /// Of the gradients.
    pub gradient: Vec<[f32; 3]>,
    /// Of the features.
    pub others: Vec<f32>,
}

/// A signed distance network over flat parameters.
pub trait Field {
    /// Number of parameters.
    fn parameters(&self) -> usize;

    /// Which of them are entries of a table of features.
    fn table(&self) -> std::ops::Range<usize>;

    /// The layers, whose parameters come first: of each the weight
    /// `[outputs, inputs]`, then the bias.
    fn layers(&self) -> &[LayerShape];

    /// Distances at `points` `[N, 3]` alone.
    fn distances(&mut self, parameters: &[f32], points: &[f32]) -> Vec<f32>;

    /// All outputs at `points` `[N, 3]`; what [`Self::backward`] needs stays.
    fn forward(&mut self, parameters: &[f32], points: &[f32]) -> Output;

    /// Gradient of `Σ output · adjoint` with respect to the parameters, right after
    /// [`Self::forward`]. `gradient` holds zeros at first.
    fn backward(
        &mut self,
        parameters: &[f32],
        points: &[f32],
        adjoint: &Adjoint,
        gradient: &mut [f32],
    );
}

/// The perceptron over the positional encoding: what neat has.
pub struct PresentNetwork {
    shape: SoftplusShape,
    tape: Option<Tape>,
}

impl PresentNetwork {
    /// `hidden` layers of `width` over `octaves` octaves.
    pub fn new(hidden: usize, width: usize, octaves: usize, outputs: usize) -> Self {
        let mut inputs = 3 * (1 + 2 * octaves);
        let mut layers = Vec::new();
        for outputs in std::iter::repeat_n(width, hidden).chain([outputs]) {
            layers.push(LayerShape { inputs, outputs });
            inputs = outputs;
        }
        Self {
            shape: SoftplusShape {
                layers,
                octaves,
                skip: None,
                sharpness: SHARPNESS,
            },
            tape: None,
        }
    }

    fn packed(&self, parameters: &[f32]) -> SoftplusNetwork {
        SoftplusNetwork::new(Arch::new(), &self.shape, parameters)
    }
}

impl Field for PresentNetwork {
    fn parameters(&self) -> usize {
        self.shape.layers.iter().map(LayerShape::parameters).sum()
    }

    fn table(&self) -> std::ops::Range<usize> {
        self.parameters()..self.parameters()
    }

    fn layers(&self) -> &[LayerShape] {
        &self.shape.layers
    }

    fn distances(&mut self, parameters: &[f32], points: &[f32]) -> Vec<f32> {
        self.packed(parameters).first(points)
    }

    fn forward(&mut self, parameters: &[f32], points: &[f32]) -> Output {
        let (output, tape) = self.packed(parameters).forward(points, None, true, true);
        self.tape = tape;
        Output {
            first: output.first,
            gradient: output.gradient.as_chunks().0.to_vec(),
            others: output.others,
        }
    }

    fn backward(
        &mut self,
        parameters: &[f32],
        points: &[f32],
        adjoint: &Adjoint,
        gradient: &mut [f32],
    ) {
        let adjoint = SoftplusAdjoint {
            first: &adjoint.first,
            gradient: adjoint.gradient.as_flattened(),
            others: &adjoint.others,
        };
        let network = self.packed(parameters);
        let (sum, _) = network.backward(points, None, adjoint, self.tape.take(), false);
        gradient.copy_from_slice(&sum);
    }
}

/// Initial parameters: about the distance from a sphere of radius 0.45, as in the
/// `fast` preset. The columns of an encoding's frequencies start at zero; those of a
/// table are random, the table being zero, or neither would ever have a gradient.
pub fn initial_parameters(field: &dyn Field, rng: &mut impl Rng) -> Vec<f32> {
    let mut parameters = Vec::with_capacity(field.parameters());
    let layers = field.layers();
    let has_table = !field.table().is_empty();
    for (l, &LayerShape { inputs, outputs }) in layers.iter().enumerate() {
        for row in 0..outputs {
            for column in 0..inputs {
                let normal = standard_normal(rng);
                let weight = if l + 1 == layers.len() && row == 0 {
                    (PI / inputs as f64).sqrt() + 1e-4 * normal
                } else if l + 1 == layers.len() {
                    normal / (inputs as f64).sqrt()
                } else if l == 0 && column >= 3 && !has_table {
                    0.0
                } else {
                    normal * (2.0 / outputs as f64).sqrt()
                };
                parameters.push(weight as f32);
            }
        }
        let radius = if l + 1 == layers.len() { 0.45 } else { 0.0 };
        parameters.extend((0..outputs).map(|row| if row == 0 { -radius } else { 0.0 }));
    }
    parameters.resize(field.parameters(), 0.0);
    parameters
}
