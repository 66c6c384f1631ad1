//! The radiance network (VolSDF's, in the "idr" mode of IDR).

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation};
use neat_tensor::{
    GridEncoding, NetworkSizeError, PointEncoding, PositionalEncoding, ReluMlp, SampleInputs,
};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Size of the radiance network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderingNetworkConfig {
    /// Number of hidden layers.
    pub hidden_layers: usize,
    /// Width of the hidden layers.
    pub width: usize,
    /// Frequencies of the encoding of the viewing direction.
    pub view_octaves: usize,
    /// What the point has beside its coordinates.
    pub encoding: PointEncoding,
    /// Whether the layers are weight-normalised.
    pub weight_norm: bool,
}

impl Default for RenderingNetworkConfig {
    /// As published: 4 × 256, 4 octaves.
    fn default() -> Self {
        Self {
            hidden_layers: 4,
            width: 256,
            view_octaves: 4,
            encoding: PointEncoding::Sine,
            weight_norm: true,
        }
    }
}

/// Point, viewing direction, normal and features → colour in (0, 1).
#[derive(Module, Debug)]
pub struct RenderingNetwork {
    /// The perceptron.
    pub mlp: ReluMlp,
    /// Learned grids whose features follow those of the distance, if any.
    pub grid: Option<GridEncoding>,
    /// Frequencies of the encoding of the viewing direction.
    #[module(skip)]
    pub view_octaves: usize,
}

impl RenderingNetworkConfig {
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
    ) -> Result<RenderingNetwork, NetworkSizeError> {
        let view = PositionalEncoding {
            octaves: self.view_octaves,
        };
        let mut widths = vec![3 + view.output_width(3) + 3 + features + self.encoding.width()];
        widths.extend(vec![self.width; self.hidden_layers]);
        widths.push(3);
        Ok(RenderingNetwork {
            mlp: ReluMlp::new(&widths, self.weight_norm, rng, device),
            grid: self.encoding.init(scene_radius, rng, device)?,
            view_octaves: self.view_octaves,
        })
    }
}

impl RenderingNetwork {
    /// `rays` `[N, 6]` (point, unit viewing direction), `gradients` (raw, of the
    /// distance) `[N, 3]` and `features` `[N, F]` → colours `[N, 3]`.
    pub fn forward(&self, rays: Tensor<2>, gradients: Tensor<2>, features: Tensor<2>) -> Tensor<2> {
        let view = PositionalEncoding {
            octaves: self.view_octaves,
        };
        let features = match &self.grid {
            Some(grid) => {
                let points = rays.clone().narrow(1, 0, 3);
                grid.append(&self.mlp.kernels, features, points)
            }
            None => features,
        };
        activation::sigmoid(self.mlp.forward_samples(SampleInputs {
            rays,
            ray_parts: vec![(0, 3, PositionalEncoding { octaves: 0 }), (3, 3, view)],
            gradients,
            features,
        }))
    }
}
