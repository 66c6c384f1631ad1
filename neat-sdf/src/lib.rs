//! Volume rendering of signed distance functions, as in VolSDF (Yariv et al.
//! 2021): the geometry and colour that NEAT's segments are rendered with.

#![forbid(unsafe_code)]

pub mod density;
#[cfg(feature = "wgpu")]
pub mod device_sampler;
pub mod implicit_network;
pub mod losses;
pub mod ray_sampler;
pub mod rendering_network;
pub mod volume_rendering;

pub use density::{DensityConfig, LaplaceDensity};
pub use implicit_network::{Distances, ImplicitNetwork, ImplicitNetworkConfig, ImplicitOutput};
pub use ray_sampler::{DeviceSamples, RayBundle, RaySampler, RaySamplerConfig, RaySamples};
pub use rendering_network::{RenderingNetwork, RenderingNetworkConfig};
