//! Latents and the decoder that turns them into junctions (paper eq. 3).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use neat_tensor::ReluMlp;
use neat_tensor::random::standard_normal;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Number and width of the latents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PerceiverConfig {
    /// Number of global junctions `N`.
    pub junctions: usize,
    /// Width of each latent and of the decoder's two hidden layers.
    pub width: usize,
}

impl Default for PerceiverConfig {
    /// As published for ABC: 64 junctions, 256 wide.
    fn default() -> Self {
        Self {
            junctions: 64,
            width: 256,
        }
    }
}

/// `N` learned latents and a perceptron with two hidden layers.
#[derive(Module, Debug)]
pub struct JunctionPerceiver {
    /// `[N, C]`, standard normal at the start.
    pub latents: Param<Tensor<2>>,
    /// `C → C → C → 3`.
    pub decoder: ReluMlp,
}

impl PerceiverConfig {
    /// Random latents and decoder.
    pub fn init(&self, rng: &mut impl Rng, device: &Device) -> JunctionPerceiver {
        let latents: Vec<f32> = (0..self.junctions * self.width)
            .map(|_| standard_normal(rng) as f32)
            .collect();
        let widths = [self.width, self.width, self.width, 3];
        JunctionPerceiver {
            latents: Param::from_data(
                TensorData::new(latents, [self.junctions, self.width]),
                device,
            ),
            decoder: ReluMlp::new(&widths, false, rng, device),
        }
    }
}

impl JunctionPerceiver {
    /// The global junctions `[N, 3]` in the world.
    pub fn junctions(&self) -> Tensor<2> {
        self.decoder.forward(self.latents.val())
    }
}
