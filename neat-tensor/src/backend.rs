//! Which machine computes: backends by name, and their devices.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A way to compute tensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// A GPU where one is found, else [`Backend::Flex`].
    Auto,
    /// The CPU, through burn's flex backend.
    Flex,
    /// The CPU, through the ndarray crate.
    Ndarray,
    /// A GPU through Vulkan, Metal or DX12.
    Wgpu,
}

/// Why a backend cannot be used.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum BackendError {
    /// The name is not one of ours.
    #[error("unknown backend `{0}`; use one of auto, flex, ndarray, wgpu")]
    Unknown(String),
    /// The program was built without it.
    #[error(
        "this build of neat has no {0} backend; rebuild with `--features {0}` or choose one of: {1}"
    )]
    NotBuilt(Backend, String),
    /// There is no device for wgpu.
    #[error(
        "no GPU driver found for the wgpu backend; install one (Vulkan, Metal or DX12), or use `--backend flex`"
    )]
    NoAdapter,
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
            Self::Wgpu => "wgpu",
        })
    }
}

impl FromStr for Backend {
    type Err = BackendError;

    fn from_str(name: &str) -> Result<Self, BackendError> {
        match name {
            "auto" => Ok(Self::Auto),
            "flex" => Ok(Self::Flex),
            "ndarray" => Ok(Self::Ndarray),
            "wgpu" => Ok(Self::Wgpu),
            _ => Err(BackendError::Unknown(name.to_owned())),
        }
    }
}

impl Backend {
    /// The backends this program was built with, without [`Backend::Auto`].
    pub fn built() -> Vec<Self> {
        let mut built = Vec::new();
        if cfg!(feature = "flex") {
            built.push(Self::Flex);
        }
        if cfg!(feature = "ndarray") {
            built.push(Self::Ndarray);
        }
        if cfg!(feature = "wgpu") {
            built.push(Self::Wgpu);
        }
        built
    }

    /// The built backends that have a device on this machine.
    pub fn available() -> Vec<Self> {
        Self::built()
            .into_iter()
            .filter(|backend| backend.device().is_ok())
            .collect()
    }

    /// The concrete backend that [`Backend::Auto`] stands for here; any other is
    /// itself.
    pub fn resolve(self) -> Self {
        match self {
            Self::Auto if has_gpu() => Self::Wgpu,
            other => other.resolve_on_host(),
        }
    }

    /// [`Self::resolve`] for what does not need a GPU: none is looked for, which takes a
    /// while and drivers and threads of theirs.
    pub fn resolve_on_host(self) -> Self {
        match self {
            Self::Auto => Self::built()
                .into_iter()
                .find(|backend| *backend != Self::Wgpu)
                .unwrap_or(Self::Wgpu),
            other => other,
        }
    }

    /// A device of this backend, without autodiff.
    ///
    /// # Errors
    /// If the backend was not built in, or has no device here.
    pub fn device(self) -> Result<Device, BackendError> {
        match self {
            Self::Auto => self.resolve().device(),
            #[cfg(feature = "flex")]
            Self::Flex => Ok(Device::flex()),
            #[cfg(feature = "ndarray")]
            #[allow(deprecated)] // still one of the backends that neat promises
            Self::Ndarray => Ok(Device::ndarray()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => wgpu_device(),
            #[allow(unreachable_patterns)] // when every backend is built in
            missing => Err(BackendError::NotBuilt(
                missing,
                Self::built()
                    .iter()
                    .map(ToString::to_string)
                    .collect::<Vec<_>>()
                    .join(", "),
            )),
        }
    }
}

/// Whether `device` is the CPU, whose memory is the host's.
#[allow(deprecated)] // ndarray is still one of the backends that neat promises
pub fn is_on_host(device: &Device) -> bool {
    use burn::backend::DispatchDevice;
    match device.clone().inner().as_dispatch() {
        #[cfg(feature = "flex")]
        DispatchDevice::Flex(_) => true,
        #[cfg(feature = "ndarray")]
        DispatchDevice::NdArray(_) => true,
        _ => false,
    }
}

/// The name of a GPU; a CPU has none here.
pub fn gpu_name(device: &Device) -> Option<String> {
    #[cfg(feature = "wgpu")]
    {
        device.identity().map(|identity| identity.name)
    }
    #[cfg(not(feature = "wgpu"))]
    {
        let _ = device;
        None
    }
}

/// The name of the software driver that `device` computes through, if it does:
/// right, but many times slower than the CPU backends. [`Backend::Auto`] never
/// picks one.
pub fn software_driver(device: &Device) -> Option<String> {
    #[cfg(feature = "wgpu")]
    {
        let identity = device.identity()?;
        identity.physical.is_none().then_some(identity.name)
    }
    #[cfg(not(feature = "wgpu"))]
    {
        let _ = device;
        None
    }
}

#[cfg(feature = "wgpu")]
fn wgpu_device() -> Result<Device, BackendError> {
    use burn::tensor::DeviceType;
    // Enumeration lists discrete GPUs first and software devices last.
    Device::enumerate(DeviceType::Wgpu)
        .into_vec()
        .into_iter()
        .next()
        .ok_or(BackendError::NoAdapter)
}

/// Whether a real GPU, not a software rasteriser, is here.
fn has_gpu() -> bool {
    #[cfg(feature = "wgpu")]
    {
        !Device::enumerate_physical().is_empty()
    }
    #[cfg(not(feature = "wgpu"))]
    {
        false
    }
}
