//! Folders of scenes as jobs.

use crate::error::BatchError;
use crate::job::{Job, folder_name};
use crate::json_file::absolute;
use neat_core::SceneError;
use std::path::{Path, PathBuf};

/// A job for every folder that is named or matched, sorted by path.
pub fn find(patterns: &[String]) -> Result<Vec<Job>, BatchError> {
    let mut folders = Vec::new();
    for pattern in patterns {
        // First, because a folder's own name may look like a pattern.
        if Path::new(pattern).is_dir() {
            folders.push(PathBuf::from(pattern));
        } else {
            folders.extend(matches(pattern)?);
        }
    }
    let absolute = folders.iter().map(|folder| absolute(folder));
    let mut folders = absolute.collect::<Result<Vec<_>, _>>()?;
    folders.sort();
    folders.dedup();
    let jobs = folders.into_iter().map(|scene| Job {
        name: folder_name(&scene).unwrap_or_default(),
        scene,
        arguments: Vec::new(),
        truth: None,
    });
    Ok(jobs.collect())
}

/// The folders that a pattern matches, one at least.
fn matches(pattern: &str) -> Result<Vec<PathBuf>, BatchError> {
    let paths = glob::glob(pattern).map_err(|error| BatchError::Pattern {
        pattern: pattern.to_owned(),
        reason: error.msg,
    })?;
    let mut folders = Vec::new();
    for path in paths {
        let path = path.map_err(|error| SceneError::Read {
            path: error.path().into(),
            source: error.into(),
        })?;
        if path.is_dir() {
            folders.push(path);
        }
    }
    if folders.is_empty() {
        return Err(BatchError::NoJob {
            source_name: format!("`{pattern}`"),
            remedy: "give a manifest that ends in .toml, a folder, or a pattern that matches folders",
        });
    }
    Ok(folders)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Batch;
    use std::fs;

    #[test]
    fn folders_are_found_once_and_in_order() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b", "a", "sub/a", "c[1]"] {
            fs::create_dir_all(dir.path().join(name)).unwrap();
        }
        fs::write(dir.path().join("file"), "").unwrap();
        let path = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
        let names = |patterns: &[&str]| {
            let patterns: Vec<_> = patterns.iter().map(|&name| path(name)).collect();
            let batch = Batch::from_folders(&patterns)?;
            let names = batch.jobs().iter().map(|job| job.name.clone());
            Ok::<Vec<_>, BatchError>(names.collect())
        };
        assert_eq!(names(&["*", "a", "b/"]).unwrap(), ["a", "b", "c[1]", "sub"]);
        assert_eq!(names(&["c[1]"]).unwrap(), ["c[1]"]);
        assert!(matches!(names(&["none-*"]), Err(BatchError::NoJob { .. })));
        assert!(matches!(names(&["fil*"]), Err(BatchError::NoJob { .. })));
        assert!(matches!(names(&["a***"]), Err(BatchError::Pattern { .. })));
        assert!(matches!(
            names(&["a", "sub/*"]),
            Err(BatchError::SameName { .. })
        ));
    }
}
