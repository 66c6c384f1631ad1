//! What the samplers of the host (`neat_sdf::ray_sampler`) and their kernels share.

/// Largest value of the exponential inside the bound of Algorithm 1, as published.
pub const MAX_ERROR_FACTOR: f32 = 1e6;
/// Error integrals from here on reach [`MAX_ERROR_FACTOR`]: e¹⁴ = 1.2 · 10⁶.
pub const SATURATED: f32 = 14.0;
/// Added to every interval's mass before the last draw, as published.
pub const FINAL_MASS_FLOOR: f32 = 1e-5;
/// Cumulative steps of Algorithm 1 below this are flat, as published.
pub const FLAT_STEP: f32 = 1e-5;
/// Cumulative steps of a cached grid below this are flat.
pub const GRID_FLAT_STEP: f32 = 1e-8;
/// Rays that miss the ball are treated as if they grazed it.
pub const MIN_HALF_CHORD_SQUARED: f32 = 1e-4;
/// Sampling of the ball starts at least this far from the camera.
pub const MIN_NEAR: f32 = 0.01;

/// Numbers of an iteration of Algorithm 1.
#[derive(Clone, Copy, Debug)]
pub struct RefineNumbers {
    /// Samples per ray so far.
    pub len: usize,
    /// New ones.
    pub step: usize,
    /// Rays.
    pub rays: usize,
    /// Bisections of β.
    pub bisections: usize,
    /// Tolerated error of the opacity.
    pub epsilon: f32,
    /// Beyond this integral of the density the bound holds whatever the error is.
    pub opaque: f32,
}

/// Numbers of the final draw of Algorithm 1.
#[derive(Clone, Copy, Debug)]
pub struct DrawNumbers {
    /// Samples per ray.
    pub len: usize,
    /// Of one iteration.
    pub step: usize,
    /// Rays.
    pub rays: usize,
    /// Samples that are drawn.
    pub drawn: usize,
    /// Samples that are kept.
    pub extras: usize,
    /// Where the rays begin.
    pub near: f32,
    /// Where they end.
    pub far: f32,
}

/// Numbers of sampling with a grid.
#[derive(Clone, Copy, Debug)]
pub struct GridNumbers {
    /// Rays.
    pub rays: usize,
    /// Nodes of the grid along each axis.
    pub nodes: usize,
    /// Look-ups per ray.
    pub lookups: usize,
    /// Samples drawn from the weights.
    pub drawn: usize,
    /// Samples spread evenly.
    pub even: usize,
    /// Radius of the ball that the grid encloses.
    pub radius: f32,
    /// Least scale of the density that the grid resolves.
    pub min_beta: f32,
    /// Added to every look-up's weight.
    pub weight_floor: f32,
}
