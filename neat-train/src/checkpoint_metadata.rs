//! What a checkpoint tells beside its tensors.

use crate::error::TrainError;
use neat_tensor::checkpoint::Checkpoint;

/// Key of a checkpoint's metadata: the factor on all learning rates.
pub(crate) const LEARNING_RATE_SCALE: &str = "learning_rate_scale";

/// Key of a checkpoint's metadata: the loss, averaged over the last steps.
pub(crate) const AVERAGE_LOSS: &str = "average_loss";

pub(crate) fn metadata<T: std::str::FromStr>(
    checkpoint: &Checkpoint,
    key: &str,
) -> Result<T, TrainError> {
    checkpoint
        .metadata
        .get(key)
        .and_then(|value| value.parse().ok())
        .ok_or_else(|| TrainError::Checkpoint(key.to_owned()))
}
