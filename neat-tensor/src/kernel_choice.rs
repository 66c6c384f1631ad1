//! Which operations run: kernels where there are any, or plain tensor operations.

use crate::backend::is_on_host;
use crate::cpu_backend::Cpu;
#[cfg(feature = "wgpu")]
use crate::gpu_backend::Gpu;
use crate::kernels::cpu::KeptMemory;
use crate::neat_backend::{NeatBackend, Plain};
use burn::tensor::{DType, Device, Tensor};

/// Which operations a model and its optimiser run: hand-written kernels where there are
/// any, or plain tensor operations; and the memory that kernels may keep between passes.
#[derive(Clone, Debug)]
pub struct Kernels {
    cpu: Cpu,
    plain: bool,
}

/// Most bytes that activations take while they wait for a later pass.
const MAX_KEPT_BYTES: u64 = 2 << 30;

impl Default for Kernels {
    /// [`Kernels::within`] 2 GiB, of this value and its clones.
    fn default() -> Self {
        Self::within(None)
    }
}

impl Kernels {
    /// Kernels where there are any. Activations that wait for a later pass take a half of
    /// `memory_limit` (bytes) or 2 GiB, whichever is less; what has no room is computed
    /// again.
    pub fn within(memory_limit: Option<u64>) -> Self {
        let half = memory_limit.map_or(MAX_KEPT_BYTES, |bytes| bytes / 2);
        Self {
            cpu: Cpu::new(KeptMemory::of_bytes(half.min(MAX_KEPT_BYTES) as usize)),
            plain: false,
        }
    }

    /// Plain tensor operations everywhere, to measure kernels and to compare them with.
    pub fn plain() -> Self {
        Self {
            plain: true,
            ..Self::default()
        }
    }

    /// The operations for tensors of `device` and `dtype`.
    pub fn on(&self, device: &Device, dtype: DType) -> &dyn NeatBackend {
        if self.plain || dtype != DType::F32 {
            return &Plain;
        }
        #[cfg(feature = "wgpu")]
        if Gpu::is(device) {
            return &Gpu;
        }
        if is_on_host(device) {
            &self.cpu
        } else {
            &Plain
        }
    }

    /// The operations for `tensor`.
    pub fn of<const D: usize>(&self, tensor: &Tensor<D>) -> &dyn NeatBackend {
        self.on(&tensor.device(), tensor.dtype())
    }

    /// Where the CPU's kernels keep activations.
    pub fn memory(&self) -> &KeptMemory {
        self.cpu.memory()
    }
}
