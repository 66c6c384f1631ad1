//! Reading a scene as the configuration of a run wants it.

pub use neat_images::scene::{
    PreparedScene, examine_quickly, load_options, scaled_for, spread_views,
};

use crate::config::Config;
use crate::error::PipelineError;
use crate::event::OnEvent;
use crate::resources::Resources;
use neat_core::SceneSphere;
use std::path::Path;

/// [`neat_images::scene::prepare_scene`] with the parts of `config` that it needs.
///
/// # Errors
/// As there.
pub fn prepare_scene(
    dir: &Path,
    config: &Config,
    placed: Option<&SceneSphere>,
    resources: Resources<'_>,
    on_event: OnEvent<'_>,
) -> Result<PreparedScene, PipelineError> {
    let (data, detector) = (&config.data, &config.detect);
    let prepared =
        neat_images::scene::prepare_scene(dir, data, detector, placed, resources, on_event)?;
    Ok(prepared)
}
