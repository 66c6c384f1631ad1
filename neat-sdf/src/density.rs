//! From signed distance to density: the Laplace distribution's cumulative
//! function, scaled (VolSDF eq. 2 and 3).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

/// How β develops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BetaSchedule {
    /// A parameter of the optimisation, as published.
    Learned,
    /// Falls geometrically from the initial to the final value over the first
    /// part of the run, then stays.
    Annealed,
}

/// The scale β of the Laplace density.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DensityConfig {
    /// Learned or annealed.
    pub schedule: BetaSchedule,
    /// β at the start.
    pub initial_beta: f64,
    /// Added to |β| where β is learned.
    pub min_beta: f64,
    /// β at the end of the annealing.
    pub final_beta: f64,
    /// Share of the run over which β is annealed.
    pub annealing_share: f64,
}

impl Default for DensityConfig {
    fn default() -> Self {
        Self {
            schedule: BetaSchedule::Learned,
            initial_beta: 0.1,
            min_beta: 1e-4,
            final_beta: 0.004,
            annealing_share: 0.2,
        }
    }
}

impl DensityConfig {
    /// The density with its initial β.
    pub fn init(&self, device: &Device) -> LaplaceDensity {
        LaplaceDensity {
            beta: Param::from_data([self.initial_beta as f32], device),
            min_beta: self.min_beta,
        }
    }

    /// β of the annealing schedule after the share `progress` of the run.
    pub fn annealed_beta(&self, progress: f64) -> f64 {
        let t = (progress / self.annealing_share).clamp(0.0, 1.0);
        self.initial_beta * (self.final_beta / self.initial_beta).powf(t)
    }
}

/// The learned scale of the density.
#[derive(Module, Debug)]
pub struct LaplaceDensity {
    /// Parameter behind β, `[1]`; may become negative.
    pub beta: Param<Tensor<1>>,
    /// Added to its magnitude.
    #[module(skip)]
    pub min_beta: f64,
}

impl LaplaceDensity {
    /// β in use, `[1]`: `|beta| + min_beta`.
    pub fn beta(&self) -> Tensor<1> {
        self.beta.val().abs().add_scalar(self.min_beta)
    }
}

/// σ = Ψ_β(−sdf) / β with Ψ the cumulative Laplace distribution; `beta` is `[1]`.
pub fn laplace_density(sdf: Tensor<2>, beta: Tensor<1>) -> Tensor<2> {
    let beta = beta.unsqueeze::<2>();
    let sign = sdf.clone().sign();
    // 1 inside, ½ on the surface, 0 outside; then the exponential tail towards ½.
    // Algebraically ½ + ½ sign · expm1(−|s|/β), without its cancellation outside.
    let inside = sign.clone().neg().add_scalar(1.0).mul_scalar(0.5);
    let tail = (sdf.abs() / beta.clone()).neg().exp().mul_scalar(0.5);
    (inside + sign * tail) / beta
}

/// [`laplace_density`] of one number on the host.
pub fn laplace_density_scalar(sdf: f32, beta: f32) -> f32 {
    let tail = 0.5 * (-sdf.abs() / beta).exp();
    let psi = if sdf > 0.0 {
        tail
    } else if sdf < 0.0 {
        1.0 - tail
    } else {
        0.5
    };
    psi / beta
}
