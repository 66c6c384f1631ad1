//! Size and start of the signed distance network.

use super::ImplicitNetwork;
use burn::tensor::Device;
use neat_tensor::linear::{Linear, LinearInit};
use neat_tensor::{CoordinateMlp, Kernels, NetworkSizeError, PointEncoding, PositionalEncoding};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Sharpness of the softplus, as in VolSDF.
const SOFTPLUS_SHARPNESS: f64 = 100.0;

/// Size and initialisation of the signed distance network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImplicitNetworkConfig {
    /// Number of hidden layers.
    pub hidden_layers: usize,
    /// Width of the hidden layers.
    pub width: usize,
    /// Width of the feature vector that accompanies the distance.
    pub features: usize,
    /// Frequencies of the positional encoding of the point.
    pub octaves: usize,
    /// What follows these sines in the encoding of the point.
    pub encoding: PointEncoding,
    /// Layer whose input is `[h, encoding] / √2`; the layer before it is
    /// narrower by the width of the encoding. 0 skips nothing.
    pub skip_layer: usize,
    /// Whether the layers are weight-normalised.
    pub weight_norm: bool,
    /// Radius of the sphere that the initial network approximates, as a share of
    /// the scene radius.
    pub initial_sphere: f64,
    /// Starts all feature rows as copies of the distance row, as the published
    /// code does; otherwise they start random.
    pub features_start_as_distance: bool,
    /// Slope of the bounding sphere that caps the distance:
    /// `min(sdf, slope (R − |x|))`. 0 models no background.
    pub bounding_sphere_slope: f64,
}

impl Default for ImplicitNetworkConfig {
    /// As published: 8 × 256 with 6 octaves, skip into layer 4.
    fn default() -> Self {
        Self {
            hidden_layers: 8,
            width: 256,
            features: 256,
            octaves: 6,
            encoding: PointEncoding::Sine,
            skip_layer: 4,
            weight_norm: true,
            initial_sphere: 0.2,
            features_start_as_distance: true,
            bounding_sphere_slope: 20.0,
        }
    }
}

impl ImplicitNetworkConfig {
    /// Whether there can be such a network.
    ///
    /// # Errors
    /// If there is no hidden layer, or a skip layer comes too late or leaves the layer
    /// before it without outputs.
    pub fn validate(&self) -> Result<(), NetworkSizeError> {
        self.encoding.validate()?;
        Err(NetworkSizeError(
            if self.hidden_layers == 0 || self.width == 0 {
                "model.implicit needs at least one hidden layer and a width above 0"
            } else if self.skip_layer > 0 && self.skip_layer >= self.hidden_layers {
                "model.implicit.skip_layer must come before the last hidden layer"
            } else if self.skip_layer > 0 && self.width <= self.encoded() {
                "model.implicit.width must exceed the width of the encoding (3 + 6 octaves, and a grid's levels times features) where a skip layer is used"
            } else {
                return Ok(());
            },
        ))
    }

    /// Columns of the encoding of a point.
    pub fn encoded(&self) -> usize {
        let sines = PositionalEncoding {
            octaves: self.octaves,
        };
        sines.output_width(3) + self.encoding.width()
    }

    /// A network that approximates a sphere (geometric initialisation, SAL,
    /// Atzmon & Lipman 2020, in the published variant: see `docs/parity.md`).
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(
        &self,
        scene_radius: f64,
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<ImplicitNetwork, NetworkSizeError> {
        self.validate()?;
        let encoded = self.encoded();
        let last = self.hidden_layers;
        let radius = self.initial_sphere * scene_radius;
        let mut layers = Vec::with_capacity(last + 1);
        for l in 0..=last {
            let inputs = if l == 0 { encoded } else { self.width };
            let outputs = match l {
                _ if l == last => 1 + self.features,
                _ if self.skip_layer == l + 1 => self.width - encoded,
                _ => self.width,
            };
            let init = if l == last {
                self.last_layer(inputs, outputs, radius, rng)
            } else {
                let deviation = (2.0 / outputs as f64).sqrt();
                let mut init = LinearInit::normal(inputs, outputs, 0.0, deviation, 0.0, rng);
                // The encoded columns start at zero: only x, y, z speak.
                let silent = encoded - 3;
                if l == 0 || self.skip_layer == l {
                    for row in init.weight.chunks_mut(inputs) {
                        row[inputs - silent..].fill(0.0);
                    }
                }
                init
            };
            layers.push(Linear::new(
                &init,
                inputs,
                outputs,
                self.weight_norm,
                device,
            ));
        }
        Ok(ImplicitNetwork {
            mlp: CoordinateMlp {
                layers,
                octaves: self.octaves,
                grid: self.encoding.init(scene_radius, rng, device)?,
                skip: Some(self.skip_layer).filter(|l| *l > 0),
                sharpness: SOFTPLUS_SHARPNESS,
                kernels: Kernels::default(),
            },
            bounding_sphere_slope: Some(self.bounding_sphere_slope).filter(|s| *s > 0.0),
            scene_radius,
        })
    }

    fn last_layer(
        &self,
        inputs: usize,
        outputs: usize,
        radius: f64,
        rng: &mut impl Rng,
    ) -> LinearInit {
        let mean = (std::f64::consts::PI / inputs as f64).sqrt();
        let distance_rows = if self.features_start_as_distance {
            outputs
        } else {
            1
        };
        let mut init = LinearInit::normal(inputs, distance_rows, mean, 1e-4, -radius as f32, rng);
        let random = LinearInit::normal(
            inputs,
            outputs - distance_rows,
            0.0,
            (1.0 / inputs as f64).sqrt(),
            0.0,
            rng,
        );
        init.weight.extend(random.weight);
        init.bias.extend(random.bias);
        init
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Tensor;
    use neat_tensor::GridConfig;
    use neat_tensor::random::{Purpose, stream};

    fn with_grid() -> ImplicitNetworkConfig {
        ImplicitNetworkConfig {
            hidden_layers: 2,
            width: 64,
            features: 8,
            octaves: 0,
            encoding: PointEncoding::Grid(GridConfig::default()),
            skip_layer: 0,
            initial_sphere: 0.5,
            bounding_sphere_slope: 0.0,
            ..ImplicitNetworkConfig::default()
        }
    }

    #[test]
    fn a_network_with_a_grid_starts_as_a_sphere() {
        let mut rng = stream(0, Purpose::Weights, 0);
        let device = Device::default();
        let network = with_grid().init(2.0, &mut rng, &device).unwrap();
        let points = [[0.3, 0.1, -0.2], [1.5, 0.0, 0.0], [0.0, -1.2, 1.2]];
        let output = network.evaluate(Tensor::from_data(points, &device));
        let distances: Vec<f32> = output.sdf.into_data().try_into_vec().unwrap();
        assert!(distances[0] < 0.0, "{distances:?}");
        assert!(distances[1] > 0.0 && distances[2] > 0.0, "{distances:?}");
        let slope = output.gradient.square().sum_dim(1).sqrt();
        let slopes: Vec<f32> = slope.into_data().try_into_vec().unwrap();
        assert!(slopes.iter().all(|s| (0.5..1.5).contains(s)), "{slopes:?}");
    }

    #[test]
    fn grids_that_cannot_be_are_refused() {
        let changes: [fn(&mut GridConfig); 5] = [
            |grid| grid.levels = 0,
            |grid| grid.features = 3,
            |grid| grid.log2_entries = 21,
            |grid| grid.finest = 4096,
            |grid| grid.coarsest = 0,
        ];
        for change in changes {
            let mut grid = GridConfig::default();
            change(&mut grid);
            let config = ImplicitNetworkConfig {
                encoding: PointEncoding::Grid(grid),
                ..with_grid()
            };
            config.validate().unwrap_err();
        }
    }
}
