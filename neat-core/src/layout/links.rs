//! Links that lead out of the folder of a scene.

use super::SceneWarning;
use std::path::{Path, PathBuf};

/// A warning if some of the `files` of the scene in `dir` lie elsewhere, behind links.
///
/// Names in files never lead out of a scene, but its folder may hold links: people keep
/// photographs on another disk. A folder from a stranger may hold them too, so they
/// are read and told.
pub(super) fn outside(dir: &Path, files: &[PathBuf]) -> Option<SceneWarning> {
    let dir = dir.canonicalize().ok()?;
    let leads_out = |file: &&PathBuf| {
        let real = file.canonicalize();
        real.is_ok_and(|real| !real.starts_with(&dir))
    };
    let mut outside = files.iter().filter(leads_out);
    let first = outside.next()?.clone();
    let files = 1 + outside.count();
    Some(SceneWarning::LinksOutside { first, files })
}
