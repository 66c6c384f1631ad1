//! Why training cannot start or go on.

use neat_core::SceneError;
use neat_core::assignment::AssignmentError;
use neat_tensor::NetworkSizeError;
use neat_tensor::parameters::ParameterError;

/// Why training cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The configuration contradicts itself.
    #[error("the configuration cannot be used: {0}")]
    Config(String),
    /// A network cannot have the size that the configuration asks for.
    #[error("the configuration cannot be used: {0}")]
    Network(#[from] NetworkSizeError),
    /// No pixel of the scene lies in an attraction region.
    #[error(
        "no pixel lies within {0} px of a 2D segment: look at the scene's 2D wireframes, or raise data.attraction_distance"
    )]
    NoRegionPixel(f64),
    /// The loss is no number any more.
    #[error("the loss became {value} in iteration {iteration}")]
    NonFiniteLoss {
        /// The iteration.
        iteration: u64,
        /// The loss.
        value: f64,
    },
    /// A gradient is no number any more, although the loss is.
    #[error("the gradient became infinite or no number in iteration {iteration}")]
    NonFiniteGradient {
        /// The iteration.
        iteration: u64,
    },
    /// Junctions could not be matched.
    #[error("junctions could not be matched in iteration {iteration}: {source}")]
    Assignment {
        /// The iteration.
        iteration: u64,
        /// What the assignment said.
        source: AssignmentError,
    },
    /// An image that lies in a file cannot be read.
    #[error(transparent)]
    Image(#[from] SceneError),
    /// The checkpoint belongs to another model.
    #[error("the checkpoint does not fit this configuration: {0}")]
    Parameters(#[from] ParameterError),
    /// The checkpoint lacks something.
    #[error("the checkpoint has no usable `{0}`")]
    Checkpoint(String),
}

impl TrainError {
    /// Whether a number became none: a lower learning rate may avoid it.
    pub fn is_numerical(&self) -> bool {
        // Costs that are no numbers cannot be assigned either.
        matches!(
            self,
            Self::NonFiniteLoss { .. }
                | Self::NonFiniteGradient { .. }
                | Self::Assignment {
                    source: AssignmentError::Cost { .. },
                    ..
                }
        )
    }
}
