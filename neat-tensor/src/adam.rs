//! Adam (Kingma & Ba 2015), with its state by parameter name.
//!
//! burn's own optimiser keys its records by a random parameter id and restores
//! them on the default device. A checkpoint that must resume to the same bytes
//! on any device wants names and plain tensors.

use crate::kernel_choice::Kernels;
use crate::neat_backend::AdamNumbers;
use crate::parameters::PathStack;
use burn::module::{Module, ModuleMapper, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Tensor, TensorData};
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

/// First and second moment of one parameter, flat, and the parameter's shape.
struct Moments {
    both: [Tensor<1>; 2],
    shape: Vec<usize>,
}

/// The optimiser.
pub struct Adam {
    config: AdamConfig,
    kernels: Kernels,
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
            kernels: Kernels::default(),
            step: 0,
            moments: BTreeMap::new(),
            restored: BTreeMap::new(),
        }
    }

    /// The same with these operations.
    pub fn with_kernels(mut self, kernels: Kernels) -> Self {
        self.kernels = kernels;
        self
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
        let with_shape = |tensor: Tensor<1>, shape: &[usize]| {
            let (bytes, _, dtype) = tensor.into_data().into_parts();
            TensorData::from_bytes(bytes, shape.to_vec(), dtype)
        };
        let mut state = self.restored.clone();
        for (name, moments) in &self.moments {
            let both = moments.both.clone();
            let both = both.map(|tensor| with_shape(tensor, &moments.shape));
            state.insert(name.clone(), both);
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
            kernels: Kernels::default(),
            step,
            moments: BTreeMap::new(),
            restored: state,
        }
    }
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
        let shape = gradient.dims();
        let flat = |tensor: Tensor<D>| tensor.reshape([shape.iter().product::<usize>()]);
        let previous = match self.adam.moments.remove(&name) {
            Some(moments) => Some(moments.both),
            None => self.adam.restored.remove(&name).map(|pair| {
                let options = burn::tensor::TensorCreationOptions::new(gradient.device())
                    .with_dtype(gradient.dtype());
                pair.map(|data| flat(Tensor::from_data(data, options.clone())))
            }),
        };
        let AdamConfig {
            beta1,
            beta2,
            epsilon,
        } = self.adam.config;
        let t = self.adam.step as f64;
        let root_correction = (1.0 - beta2.powf(t)).sqrt();
        let numbers = AdamNumbers {
            beta1,
            beta2,
            rate: (self.learning_rate)(&name) * root_correction / (1.0 - beta1.powf(t)),
            epsilon: epsilon * root_correction,
        };
        param.map(|value| {
            let tracked = value.is_require_grad();
            let backend = self.adam.kernels.of(&gradient);
            let (value, both) =
                backend.adam(flat(value.inner()), flat(gradient), previous, numbers);
            let moments = Moments {
                both,
                shape: shape.to_vec(),
            };
            self.adam.moments.insert(name, moments);
            Tensor::from_inner(value.reshape(shape)).set_require_grad(tracked)
        })
    }
}
