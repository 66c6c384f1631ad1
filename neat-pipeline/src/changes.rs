//! What has changed since a run began: only the same inputs and the same
//! configuration continue to the same result.

use crate::config::{Config, Difference, differences as differing};
use crate::error::PipelineError;
use crate::manifest::Manifest;
use crate::run_dir::RunDirError;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// So many differences are told; the others are counted.
const TOLD: usize = 12;

/// Keys of a checkpoint's metadata.
const CONFIG: &str = "config";
const INPUTS: &str = "inputs";
const SEED: &str = "seed";

/// What a state of a training belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct Belonging {
    /// Every choice of method, as complete as in `config.toml`.
    pub config: Config,
    /// Seed of all randomness.
    pub seed: u64,
    /// SHA-256 of the input files by path; `None` where only their digest is known.
    pub inputs: Option<BTreeMap<String, String>>,
    /// SHA-256 of all of them.
    pub inputs_digest: String,
}

impl Belonging {
    /// What a run with this configuration and manifest belongs to.
    ///
    /// # Errors
    /// If the configuration has no TOML form.
    pub fn new(config: &Config, manifest: &Manifest) -> Result<Self, RunDirError> {
        // As it comes back from config.toml.
        let config = toml::from_str(&toml::to_string(config)?).unwrap_or_else(|_| config.clone());
        Ok(Self {
            config,
            seed: manifest.seed,
            inputs: Some(manifest.inputs.clone()),
            inputs_digest: digest(&manifest.inputs),
        })
    }

    /// Puts it into the metadata of a checkpoint.
    pub fn write_into(&self, metadata: &mut BTreeMap<String, String>) {
        let config = toml::to_string(&self.config).expect("changes: a configuration is TOML");
        metadata.insert(CONFIG.to_owned(), config);
        metadata.insert(INPUTS.to_owned(), self.inputs_digest.clone());
        metadata.insert(SEED.to_owned(), self.seed.to_string());
    }

    /// Reads it from the metadata of a checkpoint; `None` if something is missing.
    pub fn read_from(metadata: &BTreeMap<String, String>) -> Option<Self> {
        Some(Self {
            config: toml::from_str(metadata.get(CONFIG)?).ok()?,
            seed: metadata.get(SEED)?.parse().ok()?,
            inputs: None,
            inputs_digest: metadata.get(INPUTS)?.clone(),
        })
    }

    /// Refuses to continue as `now` what began as `self` in the folder `dir`.
    ///
    /// # Errors
    /// [`PipelineError::Changed`] with the differences.
    pub fn refuse_changes(&self, now: &Self, dir: &Path) -> Result<(), PipelineError> {
        let mut differences = Vec::new();
        if self.seed != now.seed {
            let (then, now) = (self.seed, now.seed);
            differences.push(format!("seed: {then} then, {now} now"));
        }
        let changed = differing(&self.config, &now.config).into_iter();
        differences.extend(
            changed.map(|Difference { key, then, now }| format!("{key}: {then} then, {now} now")),
        );
        match (&self.inputs, &now.inputs) {
            (Some(then), Some(now)) => differences.extend(changed_files(then, now)),
            _ if self.inputs_digest != now.inputs_digest => {
                differences.push("the files of the scene: others".to_owned());
            }
            _ => {}
        }
        if differences.is_empty() {
            return Ok(());
        }
        let more = differences.len().saturating_sub(TOLD);
        differences.truncate(TOLD);
        if more > 0 {
            differences.push(format!("and {more} more"));
        }
        Err(PipelineError::Changed {
            dir: dir.into(),
            differences: differences.join("\n  "),
        })
    }
}

/// SHA-256 of all files' names and hashes, in hexadecimal.
fn digest(inputs: &BTreeMap<String, String>) -> String {
    let mut hasher = Sha256::new();
    for (name, hash) in inputs {
        // No name and no hash has a line break.
        hasher.update(format!("{hash}  {name}\n"));
    }
    let digest = hasher.finalize();
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn changed_files(then: &BTreeMap<String, String>, now: &BTreeMap<String, String>) -> Vec<String> {
    let names: BTreeSet<&String> = then.keys().chain(now.keys()).collect();
    names
        .into_iter()
        .filter_map(|name| {
            let what = match (then.get(name), now.get(name)) {
                (Some(then), Some(now)) if then == now => return None,
                (Some(_), Some(_)) => "has changed",
                (Some(_), None) => "is not there any more",
                (None, _) => "was not there",
            };
            Some(format!("{name}: {what}"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(list: &[(&str, &str)]) -> BTreeMap<String, String> {
        let owned = |(name, hash): &(&str, &str)| ((*name).to_owned(), (*hash).to_owned());
        list.iter().map(owned).collect()
    }

    #[test]
    fn every_kind_of_changed_file_is_told() {
        let before = files(&[("a.png", "1"), ("b.png", "2"), ("c.png", "3")]);
        let after = files(&[("a.png", "1"), ("b.png", "9"), ("d.png", "4")]);
        assert!(changed_files(&before, &before).is_empty());
        assert_eq!(
            changed_files(&before, &after),
            [
                "b.png: has changed",
                "c.png: is not there any more",
                "d.png: was not there"
            ]
        );
    }
}
