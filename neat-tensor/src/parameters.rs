//! Parameters of a module by name: reading, writing, counting.

use crate::backend::is_on_host;
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{DType, Tensor, TensorCreationOptions, TensorData};
use std::collections::BTreeMap;

/// Follows a module's fields down to its parameters and names them
/// `field.field.parameter`.
#[derive(Default)]
pub(crate) struct PathStack(Vec<String>);

impl PathStack {
    pub(crate) fn enter(&mut self, name: &str) {
        self.0.push(name.to_owned());
    }

    pub(crate) fn exit(&mut self) {
        self.0.pop();
    }

    pub(crate) fn name(&self) -> String {
        self.0.join(".")
    }
}

struct Reader {
    path: PathStack,
    values: BTreeMap<String, TensorData>,
}

impl ModuleVisitor for Reader {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.enter(name);
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.exit();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        self.values
            .insert(self.path.name(), param.val().into_data());
    }
}

/// All parameters of a module with their names, on the host.
pub fn named_parameters<M: Module>(module: &M) -> BTreeMap<String, TensorData> {
    let mut reader = Reader {
        path: PathStack::default(),
        values: BTreeMap::new(),
    };
    module.visit(&mut reader);
    reader.values
}

struct GradientReader<'a> {
    path: PathStack,
    gradients: &'a mut GradientsParams,
    values: BTreeMap<String, TensorData>,
}

impl ModuleVisitor for GradientReader<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.enter(name);
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.exit();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.remove::<D>(param.id) {
            self.values.insert(self.path.name(), gradient.into_data());
        }
    }
}

/// The gradients of a module's parameters with the parameters' names, on the
/// host; parameters without a gradient are left out.
pub fn named_gradients<M: Module>(
    module: &M,
    gradients: &mut GradientsParams,
) -> BTreeMap<String, TensorData> {
    let mut reader = GradientReader {
        path: PathStack::default(),
        gradients,
        values: BTreeMap::new(),
    };
    module.visit(&mut reader);
    reader.values
}

struct FiniteGradients<'a> {
    gradients: &'a mut GradientsParams,
    finite: bool,
    /// Sums of gradients that lie on a device, which no NaN and no infinity leaves
    /// finite.
    sums: Vec<Tensor<1>>,
}

impl ModuleVisitor for FiniteGradients<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        // Taken out, a gradient is nobody else's, and looking at its values copies none.
        let Some(gradient) = self.gradients.remove::<D>(param.id) else {
            return;
        };
        let device = gradient.device();
        if !is_on_host(&device) {
            self.sums.push(gradient.clone().sum());
            self.gradients.register(param.id, gradient);
            return;
        }
        // On the host a look at every value costs less than one tensor operation.
        let data = gradient.into_data();
        self.finite &= match data.as_slice::<f32>() {
            Ok(values) => values.iter().fold(true, |finite, x| finite & x.is_finite()),
            Err(_) => data.iter::<f64>().all(f64::is_finite),
        };
        let options = TensorCreationOptions::new(device).with_dtype(data.dtype());
        (self.gradients).register(param.id, Tensor::<D>::from_data(data, options));
    }
}

/// Whether all gradients of a module's parameters are numbers.
#[derive(Clone, Debug)]
pub struct GradientCheck {
    /// Whether those on the host are.
    pub on_host: bool,
    /// A sum `[1]` that is finite only if those on a device are.
    pub on_device: Option<Tensor<1>>,
}

impl GradientCheck {
    /// Looks at the gradients of `module`, without waiting for a device.
    pub fn of<M: Module>(module: &M, gradients: &mut GradientsParams) -> Self {
        let mut visitor = FiniteGradients {
            gradients,
            finite: true,
            sums: Vec::new(),
        };
        module.visit(&mut visitor);
        let sums = visitor.sums;
        Self {
            on_host: visitor.finite,
            on_device: (!sums.is_empty()).then(|| Tensor::cat(sums, 0).sum()),
        }
    }

    /// The answer; it may have to be read from the device.
    pub fn all_finite(self) -> bool {
        let is_finite = |sum: Tensor<1>| sum.into_data().iter::<f64>().all(f64::is_finite);
        self.on_host && self.on_device.is_none_or(is_finite)
    }
}

/// Why parameters could not be put into a module.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ParameterError {
    /// The module has a parameter that was not given.
    #[error("parameter `{0}` is missing")]
    Missing(String),
    /// A parameter was given that the module does not have.
    #[error("parameter `{0}` does not belong to this model")]
    Unexpected(String),
    /// A parameter has another shape than the module's.
    #[error("parameter `{name}` has shape {found:?}; this model needs {expected:?}")]
    Shape {
        /// Name of the parameter.
        name: String,
        /// Shape in the module.
        expected: Vec<usize>,
        /// Shape that was given.
        found: Vec<usize>,
    },
}

struct Writer {
    path: PathStack,
    values: BTreeMap<String, TensorData>,
    dtype: Option<DType>,
    error: Option<ParameterError>,
}

impl ModuleMapper for Writer {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.enter(name);
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.exit();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.name();
        let Some(data) = self.values.remove(&name) else {
            self.error.get_or_insert(ParameterError::Missing(name));
            return param;
        };
        let expected = param.lazy_shape();
        if *data.shape() != expected {
            self.error.get_or_insert(ParameterError::Shape {
                name,
                expected: expected.to_vec(),
                found: data.shape().to_vec(),
            });
            return param;
        }
        let dtype = self.dtype;
        param.map(|old| {
            let dtype = dtype.unwrap_or(old.dtype());
            let options = TensorCreationOptions::new(old.device()).with_dtype(dtype);
            Tensor::from_data(data, options).set_require_grad(old.is_require_grad())
        })
    }
}

/// Replaces every parameter of `module` by the value of its name.
///
/// `dtype` converts all parameters to that type; without it they keep theirs.
///
/// # Errors
/// If a name is missing, unknown, or has another shape.
pub fn load_parameters<M: Module>(
    module: M,
    values: BTreeMap<String, TensorData>,
    dtype: Option<DType>,
) -> Result<M, ParameterError> {
    let mut writer = Writer {
        path: PathStack::default(),
        values,
        dtype,
        error: None,
    };
    let module = module.map(&mut writer);
    if let Some(error) = writer.error {
        return Err(error);
    }
    match writer.values.into_keys().next() {
        Some(name) => Err(ParameterError::Unexpected(name)),
        None => Ok(module),
    }
}
