//! The networks, samplers, losses and the optimiser against numbers of the
//! published code, on every backend. `tests/data/golden/README.md` says what the
//! tensors are and gives the tolerances.

mod adam;
mod error_bound_sampler;
mod geometric_initialisation;
mod implicit_network;
mod junction_perceiver;
mod ray_networks;
mod segment_projection;
mod thin_regions;
mod training_step;
mod volume_rendering;
