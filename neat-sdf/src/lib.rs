//! Volume rendering of signed distance functions, as in VolSDF (Yariv et al.
//! 2021): the geometry and colour that NEAT's segments are rendered with.
//!
//! ```
//! use burn::tensor::Tensor;
//! use neat_sdf::ImplicitNetworkConfig;
//! use neat_tensor::Backend;
//! use neat_tensor::random::{Purpose, stream};
//!
//! let device = Backend::Auto.device()?;
//! let config = ImplicitNetworkConfig {
//!     hidden_layers: 2,
//!     width: 32,
//!     skip_layer: 0,
//!     ..ImplicitNetworkConfig::default()
//! };
//! let network = config.init(1.0, &mut stream(0, Purpose::Weights, 0), &device)?;
//! let output = network.evaluate(Tensor::ones([5, 3], &device));
//! assert_eq!(output.gradient.dims(), [5, 3]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod background;
pub mod density;
pub mod device_sampler;
pub mod implicit_network;
pub mod losses;
pub mod ray_sampler;
pub mod rendering_network;
pub mod volume_rendering;

pub use background::{BackgroundConfig, BackgroundNetwork};
pub use density::{DensityConfig, LaplaceDensity};
pub use implicit_network::{Distances, ImplicitNetwork, ImplicitNetworkConfig, ImplicitOutput};
pub use ray_sampler::{DeviceSamples, RayBundle, RaySampler, RaySamplerConfig, RaySamples};
pub use rendering_network::{RenderingNetwork, RenderingNetworkConfig};
