//! The signed distance network (VolSDF; paper Appendix C.1).

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor};
use neat_tensor::linear::{Linear, LinearInit};
use neat_tensor::{CoordinateMlp, PositionalEncoding, Recorded};
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
            skip_layer: 4,
            weight_norm: true,
            initial_sphere: 0.2,
            features_start_as_distance: true,
            bounding_sphere_slope: 20.0,
        }
    }
}

/// What the network says of `N` points.
#[derive(Clone, Debug)]
pub struct ImplicitOutput {
    /// Signed distance `[N, 1]`.
    pub sdf: Tensor<2>,
    /// Features `[N, F]`, never capped.
    pub features: Tensor<2>,
    /// Raw gradient of the distance `[N, 3]`.
    pub gradient: Tensor<2>,
}

/// Points → signed distance and features.
#[derive(Module, Debug)]
pub struct ImplicitNetwork {
    /// The perceptron; output 0 is the distance.
    pub mlp: CoordinateMlp,
    /// Slope of the bounding sphere, if any.
    #[module(skip)]
    pub bounding_sphere_slope: Option<f64>,
    /// Radius of the scene and of the bounding sphere.
    #[module(skip)]
    pub scene_radius: f64,
}

impl ImplicitNetworkConfig {
    /// A network that approximates a sphere (geometric initialisation, SAL,
    /// Atzmon & Lipman 2020, in the published variant: see `docs/parity.md`).
    ///
    /// # Panics
    /// If a skip layer leaves the layer before it without outputs; configurations
    /// are validated before.
    pub fn init(&self, scene_radius: f64, rng: &mut impl Rng, device: &Device) -> ImplicitNetwork {
        let encoding = PositionalEncoding {
            octaves: self.octaves,
        };
        let encoded = encoding.output_width(3);
        let last = self.hidden_layers;
        let radius = self.initial_sphere * scene_radius;
        let mut layers = Vec::with_capacity(last + 1);
        for l in 0..=last {
            let inputs = if l == 0 { encoded } else { self.width };
            let outputs = match l {
                _ if l == last => 1 + self.features,
                _ if self.skip_layer == l + 1 => self
                    .width
                    .checked_sub(encoded)
                    .filter(|w| *w > 0)
                    .expect("ImplicitNetworkConfig::init: width exceeds the encoding's"),
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
        ImplicitNetwork {
            mlp: CoordinateMlp {
                layers,
                octaves: self.octaves,
                skip: Some(self.skip_layer).filter(|l| *l > 0),
                sharpness: SOFTPLUS_SHARPNESS,
            },
            bounding_sphere_slope: Some(self.bounding_sphere_slope).filter(|s| *s > 0.0),
            scene_radius,
        }
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

/// A forward pass, to be asked for gradients at some of its rows.
#[derive(Clone, Debug)]
pub struct RecordedDistances {
    pass: Recorded,
    /// Capped distance `[N, 1]`.
    sdf: Tensor<2>,
}

impl RecordedDistances {
    /// Capped distance `[N, 1]`.
    pub fn sdf(&self) -> Tensor<2> {
        self.sdf.clone()
    }

    /// Distance, features and gradient at `rows` `[M]`; `network` made the pass.
    pub fn at_rows(&self, network: &ImplicitNetwork, rows: Tensor<1, Int>) -> ImplicitOutput {
        network.with_gradient(self.pass.select(rows))
    }
}

impl ImplicitNetwork {
    /// Distance capped by the bounding sphere, features, and the gradient of the
    /// capped distance, at every point. This is what is rendered.
    pub fn evaluate(&self, points: Tensor<2>) -> ImplicitOutput {
        self.with_gradient(self.mlp.record(points))
    }

    /// The same forward pass, leaving open at which rows the gradient is wanted.
    pub fn record(&self, points: Tensor<2>) -> RecordedDistances {
        let pass = self.mlp.record(points);
        let raw = pass.outputs.clone().narrow(1, 0, 1);
        let sdf = match self.cap(&pass.points) {
            None => raw,
            Some(Cap { value, .. }) => {
                let capped = raw.clone().greater(value.clone());
                raw.mask_where(capped, value)
            }
        };
        RecordedDistances { pass, sdf }
    }

    /// Distance, features and gradient without the bounding sphere: what the
    /// eikonal term looks at.
    pub fn evaluate_uncapped(&self, points: Tensor<2>) -> ImplicitOutput {
        let pass = self.mlp.record(points);
        ImplicitOutput {
            gradient: pass.gradient(&self.mlp),
            sdf: pass.outputs.clone().narrow(1, 0, 1),
            features: features(pass.outputs),
        }
    }

    /// The capped distance alone, `[N, 1]`.
    pub fn sdf(&self, points: Tensor<2>) -> Tensor<2> {
        self.record(points).sdf
    }

    fn with_gradient(&self, pass: Recorded) -> ImplicitOutput {
        let gradient = pass.gradient(&self.mlp);
        let raw = pass.outputs.clone().narrow(1, 0, 1);
        let features = features(pass.outputs);
        let Some(cap) = self.cap(&pass.points) else {
            return ImplicitOutput {
                sdf: raw,
                features,
                gradient,
            };
        };
        let capped = raw.clone().greater(cap.value.clone());
        let shape = gradient.dims();
        ImplicitOutput {
            sdf: raw.mask_where(capped.clone(), cap.value),
            features,
            gradient: gradient.mask_where(capped.expand(shape), cap.gradient),
        }
    }

    fn cap(&self, points: &Tensor<2>) -> Option<Cap> {
        let slope = self.bounding_sphere_slope?;
        let distance = points.clone().square().sum_dim(1).sqrt();
        Some(Cap {
            value: distance
                .clone()
                .neg()
                .add_scalar(self.scene_radius)
                .mul_scalar(slope),
            gradient: points.clone().div(distance).mul_scalar(-slope),
        })
    }
}

/// The bounding sphere's distance `[N, 1]` and its gradient `[N, 3]`.
struct Cap {
    value: Tensor<2>,
    gradient: Tensor<2>,
}

/// Everything but the distance.
fn features(outputs: Tensor<2>) -> Tensor<2> {
    let width = outputs.dims()[1] - 1;
    outputs.narrow(1, 1, width)
}
