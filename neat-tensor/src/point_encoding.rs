//! What a network gets of a point beyond its coordinates and their sines.

use crate::grid_encoding::{GridConfig, GridEncoding};
use crate::kernel_choice::Kernels;
use crate::linear::NetworkSizeError;
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// What the encoding of a point has beyond coordinates and sines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum PointEncoding {
    /// Nothing, as published.
    #[default]
    Sine,
    /// Features of learned grids over the cube around the scene ball.
    Grid(GridConfig),
}

impl PointEncoding {
    /// The grids, if any.
    pub fn grid(&self) -> Option<&GridConfig> {
        match self {
            Self::Sine => None,
            Self::Grid(grid) => Some(grid),
        }
    }

    /// Whether there can be such an encoding.
    ///
    /// # Errors
    /// As [`GridConfig::validate`].
    pub fn validate(&self) -> Result<(), NetworkSizeError> {
        self.grid().map_or(Ok(()), GridConfig::validate)
    }

    /// Features of a point.
    pub fn width(&self) -> usize {
        self.grid().map_or(0, GridConfig::width)
    }

    /// Numbers that are learned.
    pub fn parameters(&self) -> usize {
        self.grid().map_or(0, GridConfig::parameters)
    }

    /// The grids at their start, over a cube of half the side `half_side`.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(
        &self,
        half_side: f64,
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<Option<GridEncoding>, NetworkSizeError> {
        let grid = self.grid();
        grid.map(|grid| grid.init(half_side, rng, device))
            .transpose()
    }
}

impl GridEncoding {
    /// `features` `[N, F]`, followed by those of the grids at `points` `[N, 3]`.
    pub fn append(&self, kernels: &Kernels, features: Tensor<2>, points: Tensor<2>) -> Tensor<2> {
        let of_grid = kernels.of(&points).encode_grid(self, points);
        Tensor::cat(vec![features, of_grid], 1)
    }
}
