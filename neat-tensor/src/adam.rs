//! Adam (Kingma & Ba 2015), with its state by parameter name.
//!
//! burn's own optimiser keys its records by a random parameter id and restores
//! them on the default device. A checkpoint that must resume to the same bytes
//! on any device wants names and plain tensors.

#[cfg(feature = "wgpu")]
use crate::device_kernels::{self, adam::StepNumbers};
use crate::fused;
use crate::parameters::PathStack;
use burn::module::{Module, ModuleMapper, Param};
use burn::optim::GradientsParams;
use burn::tensor::{DType, Tensor, TensorData};
use std::any::Any;
use std::collections::BTreeMap;

/// Decay rates and the guard against division by zero.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamConfig {
    /// Decay of the mean of the gradient.
    pub beta1: f64,
    /// Decay of the mean of its square.
    pub beta2: f64,
    /// Added to the root of the second moment.
    pub epsilon: f64,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self {
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
        }
    }
}

/// First and second moment of one parameter: `Tensor<D>` behind `Any`, because
/// parameters have different ranks.
type Moments = Box<dyn Any + Send>;

/// The optimiser.
pub struct Adam {
    config: AdamConfig,
    step: u64,
    moments: BTreeMap<String, Moments>,
    /// Moments read from a checkpoint, turned into tensors when their parameter
    /// is met, because only then rank and device are known.
    restored: BTreeMap<String, [TensorData; 2]>,
}

impl Adam {
    /// An optimiser that has seen no gradient.
    pub fn new(config: AdamConfig) -> Self {
        Self {
            config,
            step: 0,
            moments: BTreeMap::new(),
            restored: BTreeMap::new(),
        }
    }

    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Moves every parameter that has a gradient by one step.
    ///
    /// `learning_rate` gives the rate of a parameter by its name.
    pub fn step<M: Module>(
        &mut self,
        module: M,
        gradients: &mut GradientsParams,
        learning_rate: impl Fn(&str) -> f64,
    ) -> M {
        self.step += 1;
        module.map(&mut AdamStep {
            path: PathStack::default(),
            adam: self,
            gradients,
            learning_rate,
        })
    }

    /// The moments by parameter name, `[first, second]`, for a checkpoint.
    pub fn state(&self) -> BTreeMap<String, [TensorData; 2]> {
        fn data<const D: usize>(moments: &Moments) -> Option<[TensorData; 2]> {
            let pair = moments.downcast_ref::<[Tensor<D>; 2]>()?;
            Some(pair.clone().map(Tensor::into_data))
        }
        let mut state = self.restored.clone();
        for (name, moments) in &self.moments {
            let pair = data::<1>(moments)
                .or_else(|| data::<2>(moments))
                .expect("Adam::state: parameters are vectors or matrices");
            state.insert(name.clone(), pair);
        }
        state
    }

    /// An optimiser that goes on from a checkpoint.
    pub fn restore(
        config: AdamConfig,
        step: u64,
        state: BTreeMap<String, [TensorData; 2]>,
    ) -> Self {
        Self {
            config,
            step,
            moments: BTreeMap::new(),
            restored: state,
        }
    }
}

/// One parameter's step on the host: one pass instead of a dozen operations.
struct HostStep {
    value: Vec<f32>,
    first: Vec<f32>,
    second: Vec<f32>,
    gradient: Vec<f32>,
}

impl HostStep {
    fn advance(&mut self, config: AdamConfig, rate: f64, epsilon: f64) {
        let (beta1, beta2) = (config.beta1 as f32, config.beta2 as f32);
        let (rest1, rest2) = ((1.0 - config.beta1) as f32, (1.0 - config.beta2) as f32);
        let (rate, epsilon) = (rate as f32, epsilon as f32);
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((value, g), (m, v)) in self.value.iter_mut().zip(&self.gradient).zip(moments) {
            *m = g * rest1 + *m * beta1;
            *v = g * g * rest2 + *v * beta2;
            *value -= *m / (v.sqrt() + epsilon) * rate;
        }
    }
}

/// The values of a float32 tensor of a CPU backend.
fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .into_data()
        .try_into_vec()
        .expect("Adam: float32 was asked for")
}

struct AdamStep<'a, F> {
    path: PathStack,
    adam: &'a mut Adam,
    gradients: &'a mut GradientsParams,
    learning_rate: F,
}

impl<F: Fn(&str) -> f64> ModuleMapper for AdamStep<'_, F> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.enter(name);
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.exit();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some(gradient) = self.gradients.remove::<D>(param.id) else {
            return param;
        };
        let name = self.path.name();
        let AdamConfig {
            beta1,
            beta2,
            epsilon,
        } = self.adam.config;
        let previous = match self.adam.moments.remove(&name) {
            Some(moments) => Some(
                *moments
                    .downcast::<[Tensor<D>; 2]>()
                    .expect("Adam::step: a parameter keeps its rank"),
            ),
            None => self.adam.restored.remove(&name).map(|pair| {
                let options = burn::tensor::TensorCreationOptions::new(gradient.device())
                    .with_dtype(gradient.dtype());
                pair.map(|data| Tensor::from_data(data, options.clone()))
            }),
        };
        let t = self.adam.step as f64;
        let root_correction = (1.0 - beta2.powf(t)).sqrt();
        let rate = (self.learning_rate)(&name) * root_correction / (1.0 - beta1.powf(t));
        if gradient.dtype() == DType::F32 && fused::is_fused(&gradient.device()) {
            let [first, second] =
                previous.unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
            return param.map(|value| {
                let tracked = value.is_require_grad();
                let mut row = HostStep {
                    value: host(value.inner()),
                    first: host(first),
                    second: host(second),
                    gradient: host(gradient.clone()),
                };
                row.advance(self.adam.config, rate, epsilon * root_correction);
                let shape = gradient.dims();
                let device = gradient.device();
                let tensor = |values| Tensor::from_data(TensorData::new(values, shape), &device);
                let moments: [Tensor<D>; 2] = [tensor(row.first), tensor(row.second)];
                self.adam.moments.insert(name, Box::new(moments));
                Tensor::from_inner(tensor(row.value)).set_require_grad(tracked)
            });
        }
        #[cfg(feature = "wgpu")]
        if device_kernels::takes_kernels(&gradient.device(), gradient.dtype()) {
            let moments =
                previous.unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
            let numbers = StepNumbers {
                beta1: beta1 as f32,
                beta2: beta2 as f32,
                rest1: (1.0 - beta1) as f32,
                rest2: (1.0 - beta2) as f32,
                rate: rate as f32,
                epsilon: (epsilon * root_correction) as f32,
            };
            return param.map(|value| {
                let tracked = value.is_require_grad();
                let (value, moments) =
                    device_kernels::adam::step(value.inner(), gradient, moments, numbers);
                self.adam.moments.insert(name, Box::new(moments));
                Tensor::from_inner(value).set_require_grad(tracked)
            });
        }
        let first = gradient.clone().mul_scalar(1.0 - beta1);
        let second = gradient.square().mul_scalar(1.0 - beta2);
        let (first, second) = match previous {
            Some([m, v]) => (first + m.mul_scalar(beta1), second + v.mul_scalar(beta2)),
            None => (first, second),
        };
        let change = first
            .clone()
            .div(second.clone().sqrt().add_scalar(epsilon * root_correction))
            .mul_scalar(rate);
        self.adam.moments.insert(name, Box::new([first, second]));
        param.map(|value| {
            let tracked = value.is_require_grad();
            Tensor::from_inner(value.inner() - change).set_require_grad(tracked)
        })
    }
}
