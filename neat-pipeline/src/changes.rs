//! What has changed since a run began: only the same inputs and the same
//! configuration continue to the same result.

use crate::config::Config;
use crate::error::PipelineError;
use crate::manifest::Manifest;
use crate::run_dir::RunDirError;
use serde_json::Value;
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
        differences.extend(changed_values(&self.config, &now.config));
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

/// `key: VALUE then, VALUE now` for every value of the configuration that differs.
fn changed_values(then: &Config, now: &Config) -> Vec<String> {
    let leaves = |config: &Config| {
        let mut leaves = BTreeMap::new();
        let tree = serde_json::to_value(config).expect("changes: a configuration is a tree");
        collect_leaves("", &tree, &mut leaves);
        leaves
    };
    let (then, now) = (leaves(then), leaves(now));
    let keys: BTreeSet<&String> = then.keys().chain(now.keys()).collect();
    let told = |value: Option<&Value>| match value {
        None | Some(Value::Null) => "none".to_owned(),
        Some(value) => value.to_string(),
    };
    keys.into_iter()
        .map(|key| (key, told(then.get(key)), told(now.get(key))))
        .filter(|(_, then, now)| then != now)
        .map(|(key, then, now)| format!("{key}: {then} then, {now} now"))
        .collect()
}

fn collect_leaves(key: &str, value: &Value, leaves: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(table) => {
            for (name, value) in table {
                let key = match key {
                    "" => name.clone(),
                    above => format!("{above}.{name}"),
                };
                collect_leaves(&key, value, leaves);
            }
        }
        value => {
            leaves.insert(key.to_owned(), value.clone());
        }
    }
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
    use crate::preset::Preset;

    fn files(list: &[(&str, &str)]) -> BTreeMap<String, String> {
        let owned = |(name, hash): &(&str, &str)| ((*name).to_owned(), (*hash).to_owned());
        list.iter().map(owned).collect()
    }

    #[test]
    fn every_kind_of_difference_is_told() {
        let then = Preset::Fast.config();
        assert!(changed_values(&then, &then).is_empty());
        let mut now = then.clone();
        now.train.steps = 5;
        now.data.max_views = Some(7);
        assert_eq!(
            changed_values(&then, &now),
            [
                "data.max_views: none then, 7 now".to_owned(),
                format!("train.steps: {} then, 5 now", then.train.steps),
            ]
        );
        // Another kind of sampler has other keys.
        let paper = changed_values(&then, &Preset::PaperAbc.config()).join("\n");
        assert!(paper.contains("train.sampler.kind: \"grid_cached\" then"));
        assert!(paper.contains("train.sampler.resolution: 48 then, none now"));

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
