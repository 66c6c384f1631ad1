//! The attraction network: a 3D segment for every point (paper eq. 2).

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use neat_tensor::{
    GridEncoding, NetworkSizeError, PointEncoding, PositionalEncoding, ReluMlp, SampleInputs,
};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Size and inputs of the attraction network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AttractionNetworkConfig {
    /// Number of hidden layers.
    pub hidden_layers: usize,
    /// Width of the hidden layers.
    pub width: usize,
    /// Frequencies of the encoding of the point; 0 gives the raw point, as
    /// published.
    pub octaves: usize,
    /// What follows these sines in the encoding of the point.
    pub encoding: PointEncoding,
    /// Whether the raw viewing direction is an input (paper table 2).
    pub view_direction: bool,
    /// Whether the layers are weight-normalised.
    pub weight_norm: bool,
    /// Factor on the initial weights of the last layer.
    pub initial_scale: f64,
}

impl Default for AttractionNetworkConfig {
    /// As published: 4 × 256, raw point and raw viewing direction.
    fn default() -> Self {
        Self {
            hidden_layers: 4,
            width: 256,
            octaves: 0,
            encoding: PointEncoding::Sine,
            view_direction: true,
            weight_norm: true,
            initial_scale: 1.0,
        }
    }
}

/// Point, viewing direction, gradient and features → both ends of a segment.
#[derive(Module, Debug)]
pub struct AttractionNetwork {
    /// The perceptron; its outputs are offsets from the point.
    pub mlp: ReluMlp,
    /// Learned grids whose features follow those of the distance, if any.
    pub grid: Option<GridEncoding>,
    /// Frequencies of the encoding of the point.
    #[module(skip)]
    pub octaves: usize,
    /// Whether the viewing direction is an input.
    #[module(skip)]
    pub view_direction: bool,
}

impl AttractionNetworkConfig {
    /// A network for `features` wide features, in a scene of radius `scene_radius`.
    ///
    /// # Errors
    /// If there can be no such encoding.
    pub fn init(
        &self,
        features: usize,
        scene_radius: f64,
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<AttractionNetwork, NetworkSizeError> {
        let encoding = PositionalEncoding {
            octaves: self.octaves,
        };
        let view = if self.view_direction { 3 } else { 0 };
        let point = encoding.output_width(3) + self.encoding.width();
        let mut widths = vec![point + view + 3 + features];
        widths.extend(vec![self.width; self.hidden_layers]);
        widths.push(6);
        let mut mlp = ReluMlp::new(&widths, self.weight_norm, rng, device);
        if self.initial_scale != 1.0
            && let Some(last) = mlp.layers.pop()
        {
            mlp.layers.push(last.scaled(self.initial_scale));
        }
        Ok(AttractionNetwork {
            mlp,
            grid: self.encoding.init(scene_radius, rng, device)?,
            octaves: self.octaves,
            view_direction: self.view_direction,
        })
    }
}

impl AttractionNetwork {
    /// `rays` `[N, 6]` (point, unit viewing direction), `gradients` (raw, of the
    /// distance) `[N, 3]` and `features` `[N, F]` → absolute ends `[N, 6]`: both
    /// ends' coordinates one after the other.
    pub fn forward(&self, rays: Tensor<2>, gradients: Tensor<2>, features: Tensor<2>) -> Tensor<2> {
        let point = PositionalEncoding {
            octaves: self.octaves,
        };
        let mut ray_parts = vec![(0, 3, point)];
        if self.view_direction {
            ray_parts.push((3, 3, PositionalEncoding { octaves: 0 }));
        }
        let points = rays.clone().narrow(1, 0, 3);
        let features = match &self.grid {
            Some(grid) => grid.append(&self.mlp.kernels, features, points.clone()),
            None => features,
        };
        let offsets = self.mlp.forward_samples(SampleInputs {
            rays,
            ray_parts,
            gradients,
            features,
        });
        offsets + Tensor::cat(vec![points.clone(), points], 1)
    }
}
