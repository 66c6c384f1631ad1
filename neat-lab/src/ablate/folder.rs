//! The folder of an ablation: one request, which its `ablation.json` states.

use super::table::{Row, to_csv, to_markdown};
use crate::error::LabError;
use neat_core::{SceneError, file};
use neat_pipeline::config::Config;
use neat_pipeline::manifest::Status;
use neat_pipeline::reconstruct::RunOptions;
use neat_pipeline::run_dir::{RunDir, RunDirError};
use serde::Serialize;
use serde_json::Value;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const REQUEST: &str = "ablation.json";
const TABLE: &str = "ablation.md";
const TABLE_FOR_PROGRAMS: &str = "ablation.csv";

/// Everything that the results of an ablation depend on.
#[derive(Serialize)]
struct Request<'a> {
    neat: &'static str,
    /// From the root of the file system.
    scene: PathBuf,
    seed: u64,
    /// What computes, never "auto".
    backend: String,
    time_budget_in_seconds: Option<f64>,
    /// As it was asked for: `auto` is decided by every run.
    config: &'a Config,
}

/// What lies where an ablation shall be.
#[derive(Debug, PartialEq)]
enum Found {
    /// Nothing that could be lost, a request without runs at the most.
    Nothing,
    /// Files without a request.
    Foreign,
    /// The content of `ablation.json`; `None` if that is not JSON.
    Ablation(Option<Value>),
}

/// Makes `options.out` the folder of this ablation, or finds that it is.
///
/// # Errors
/// If the folder holds another ablation or anything else, or cannot be read or
/// written.
pub(super) fn claim(options: &RunOptions) -> Result<(), LabError> {
    let out = &options.out;
    let scene = std::path::absolute(&options.scene);
    let request = Request {
        neat: env!("CARGO_PKG_VERSION"),
        scene: scene.map_err(|source| read_error(&options.scene, source))?,
        seed: options.seed,
        backend: options.backend.resolve().to_string(),
        time_budget_in_seconds: options.time_budget.map(|budget| budget.as_secs_f64()),
        config: &options.config,
    };
    let path = out.join(REQUEST);
    let mut text = serde_json::to_vec_pretty(&request).map_err(|error| malformed(&path, &error))?;
    text.push(b'\n');
    // Both by way of a text: reading may round the last digit of a number.
    let asked: Value = serde_json::from_slice(&text).map_err(|error| malformed(&path, &error))?;
    if let Some(what) = obstacle(&find(out)?, &asked) {
        return Err(LabError::OtherAblation {
            out: out.clone(),
            what,
        });
    }
    file::create_dir(out)?;
    Ok(file::write_atomically(&path, &text)?)
}

fn malformed(path: &Path, error: &serde_json::Error) -> RunDirError {
    RunDirError::Malformed {
        path: path.into(),
        reason: error.to_string(),
    }
}

fn read_error(path: &Path, source: io::Error) -> SceneError {
    SceneError::Read {
        path: path.into(),
        source,
    }
}

fn find(out: &Path) -> Result<Found, LabError> {
    let entries = match fs::read_dir(out) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
        Err(error) => return Err(read_error(out, error).into()),
    };
    let (mut has_request, mut has_more) = (false, false);
    for entry in entries {
        let name = entry.map_err(|error| read_error(out, error))?.file_name();
        if name == REQUEST {
            has_request = true;
        } else {
            has_more = true;
        }
    }
    Ok(match (has_request, has_more) {
        (_, false) => Found::Nothing,
        (false, true) => Found::Foreign,
        (true, true) => {
            let bytes = file::read(&out.join(REQUEST), "choose another folder")?;
            Found::Ablation(serde_json::from_slice(&bytes).ok())
        }
    })
}

/// What stands against using a folder; `None` if it may be used.
fn obstacle(found: &Found, asked: &Value) -> Option<String> {
    match found {
        Found::Nothing => None,
        Found::Foreign => Some("files of something else".to_owned()),
        Found::Ablation(Some(stored)) if stored == asked => None,
        Found::Ablation(stored) => {
            let stored = stored.as_ref().and_then(Value::as_object);
            let asked = asked.as_object().into_iter().flatten();
            let mut differing: Vec<&str> = asked
                .filter(|(key, value)| stored.and_then(|stored| stored.get(*key)) != Some(value))
                .map(|(key, _)| key.as_str())
                .collect();
            differing.sort_unstable();
            Some(match (stored, differing.is_empty()) {
                (Some(_), false) => format!(
                    "another ablation, with a different {} in {REQUEST}",
                    differing.join(", ")
                ),
                _ => format!("another ablation, by its {REQUEST}"),
            })
        }
    }
}

/// Whether the run in this folder, which is part of the ablation, has been finished.
pub(super) fn is_finished(run: &Path) -> bool {
    let manifest = RunDir::open(run).and_then(|dir| dir.manifest());
    manifest.is_ok_and(|manifest| manifest.status == Status::Finished)
}

/// Writes the table of all rows so far.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write_tables(out: &Path, rows: &[Row]) -> Result<(), LabError> {
    file::write_atomically(&out.join(TABLE), to_markdown(rows).as_bytes())?;
    file::write_atomically(&out.join(TABLE_FOR_PROGRAMS), to_csv(rows).as_bytes())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::MemoryLimit;
    use neat_pipeline::config::Preset;
    use neat_pipeline::run_dir::Existing;
    use neat_tensor::Backend;
    use serde_json::json;
    use std::time::Duration;

    #[test]
    fn a_folder_is_used_for_one_request_only() {
        let asked = json!({"seed": 1, "config": {"x": 0.1}, "time_budget_in_seconds": null});
        let ablation = |stored: Value| Found::Ablation(Some(stored));
        assert_eq!(obstacle(&Found::Nothing, &asked), None);
        assert_eq!(obstacle(&ablation(asked.clone()), &asked), None);

        let refused = |found: &Found| obstacle(found, &asked).unwrap();
        assert!(refused(&Found::Foreign).contains("something else"));
        let other = json!({"seed": 2, "config": {"x": 0.2}, "time_budget_in_seconds": null});
        assert!(refused(&ablation(other)).contains("different config, seed"));
        // Of a version that knew less, or more, or of none at all.
        assert!(refused(&ablation(json!({"seed": 1}))).contains("config"));
        let mut more = asked.clone();
        more["detector"] = json!("lsd");
        for stored in [ablation(more), ablation(json!(3)), Found::Ablation(None)] {
            assert!(refused(&stored).starts_with("another ablation"));
        }
    }

    #[test]
    fn a_run_of_somebody_is_never_taken_for_a_variant() {
        let dir = tempfile::tempdir().unwrap();
        let options = RunOptions {
            scene: "scene".into(),
            out: dir.path().join("out"),
            existing: Existing::Refuse,
            config: Preset::Fast.config(),
            preset: "fast".into(),
            backend: Backend::Flex,
            seed: 0,
            time_budget: None,
            examine: false,
            cache: None,
            memory_limit: MemoryLimit::NONE,
            command_line: Vec::new(),
        };
        let base = options.out.join("base");
        fs::create_dir_all(&base).unwrap();
        let refused = |options: &RunOptions| {
            let error = claim(options).unwrap_err();
            assert!(error.is_bad_input());
            error.to_string()
        };
        assert!(refused(&options).contains("choose another folder, or remove it"));
        assert!(!options.out.join(REQUEST).exists());

        fs::remove_dir(&base).unwrap();
        claim(&options).unwrap();
        // Nothing has been run: nothing is lost.
        let other_seed = RunOptions {
            seed: 1,
            ..options.clone()
        };
        claim(&other_seed).unwrap();
        fs::create_dir(&base).unwrap();
        claim(&other_seed).unwrap();
        assert!(refused(&options).contains("different seed"));
        let hurried = RunOptions {
            time_budget: Some(Duration::from_secs(60)),
            ..other_seed.clone()
        };
        assert!(refused(&hurried).contains("time_budget"));
        let mut changed = other_seed.clone();
        changed.config.train.loss.segment *= 2.0;
        assert!(refused(&changed).contains("config"));
        let elsewhere = RunOptions {
            scene: "another".into(),
            ..other_seed
        };
        assert!(refused(&elsewhere).contains("scene"));
    }
}
