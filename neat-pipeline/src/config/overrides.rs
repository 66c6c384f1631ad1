//! `--set key.path=value` on top of a [`Config`].
//!
//! The value is read as TOML; a word that is not TOML is a string, and `none`
//! takes an optional value away:
//!
//! ```text
//! --set train.steps=500
//! --set train.views=all
//! --set data.scene_radius=none
//! --set 'train.adam={ beta1 = 0.9, beta2 = 0.99 }'
//! ```

use super::Config;
use serde_json::Value;

/// Why an override cannot be applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OverrideError {
    /// There is no `=`.
    #[error("`--set {0}` has no `=`; write it as `--set key.path=value`")]
    NoEqualsSign(String),
    /// The configuration has no such key.
    #[error("there is no key `{key}` in the configuration{suggestion}: {valid}")]
    UnknownKey {
        /// The path up to and including the first unknown part.
        key: String,
        /// " (did you mean `…`?)" or nothing.
        suggestion: String,
        /// Which keys there are at that level.
        valid: String,
    },
    /// The value is of the wrong kind.
    #[error("`{key}` cannot be `{value}`: {reason}")]
    Value {
        /// The key.
        key: String,
        /// The value as it was written.
        value: String,
        /// What is expected.
        reason: String,
    },
}

/// Applies overrides of the form `key.path=value` from first to last.
///
/// # Errors
/// If one has no `=`, names a key that the configuration does not have, or gives
/// a value of the wrong kind. The message names the key, the valid keys at its
/// level and the most similar one.
pub fn apply_overrides(config: &Config, overrides: &[String]) -> Result<Config, OverrideError> {
    apply_to(config, overrides)
}

/// One of `overrides` that `config`, which was changed after them, contradicts: what still stands
/// changes nothing when it is applied again.
///
/// # Errors
/// As [`apply_overrides`].
pub fn contradicted<'a>(
    config: &Config,
    overrides: &'a [String],
) -> Result<Option<&'a str>, OverrideError> {
    if apply_overrides(config, overrides)? == *config {
        return Ok(None);
    }
    for text in overrides.iter().rev() {
        if apply_overrides(config, std::slice::from_ref(text))? != *config {
            return Ok(Some(text));
        }
    }
    Ok(None)
}

/// [`apply_overrides`] for any tree of structs.
fn apply_to<T>(config: &T, overrides: &[String]) -> Result<T, OverrideError>
where
    T: Clone + serde::Serialize + serde::de::DeserializeOwned,
{
    overrides.iter().try_fold(config.clone(), |config, text| {
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| OverrideError::NoEqualsSign(text.clone()))?;
        set(&config, key.trim(), value.trim())
    })
}

fn set<T>(config: &T, key: &str, text: &str) -> Result<T, OverrideError>
where
    T: serde::Serialize + serde::de::DeserializeOwned,
{
    let wrong_value = |reason: String| OverrideError::Value {
        key: key.to_owned(),
        value: text.to_owned(),
        reason,
    };
    let values = parse_value(text).map_err(wrong_value)?;
    // JSON, because it spells out the optional keys that have no value.
    let mut tree = serde_json::to_value(config).map_err(|e| wrong_value(e.to_string()))?;
    let mut reason = String::new();
    for value in values {
        *slot(&mut tree, key)? = value;
        forget_other_kinds(&mut tree, key, config)?;
        match T::deserialize(&tree) {
            Ok(config) => return Ok(config),
            Err(error) => reason = error.to_string(),
        }
    }
    Err(wrong_value(reason))
}

/// Where a new `kind` was chosen, the keys of the old one make way for defaults.
fn forget_other_kinds<T: serde::Serialize>(
    tree: &mut Value,
    key: &str,
    config: &T,
) -> Result<(), OverrideError> {
    let Some(table) = key.strip_suffix(".kind") else {
        return Ok(());
    };
    let mut before = serde_json::to_value(config).unwrap_or_default();
    let changed = slot(&mut before, key)? != slot(tree, key)?;
    if changed && let Value::Object(table) = slot(tree, table)? {
        table.retain(|key, _| key == "kind");
    }
    Ok(())
}

/// The place in the tree that `key` names.
fn slot<'a>(tree: &'a mut Value, key: &str) -> Result<&'a mut Value, OverrideError> {
    let mut node = tree;
    let mut level = String::new();
    for part in key.split('.') {
        let at = level.clone();
        if !level.is_empty() {
            level.push('.');
        }
        level.push_str(part);
        let keys: Vec<String> = match &*node {
            Value::Object(table) => table.keys().cloned().collect(),
            _ => Vec::new(),
        };
        node = node
            .get_mut(part)
            .ok_or_else(|| unknown_key(level.clone(), &at, part, &keys))?;
    }
    Ok(node)
}

fn unknown_key(key: String, level: &str, part: &str, keys: &[String]) -> OverrideError {
    let prefix = if level.is_empty() {
        String::new()
    } else {
        format!("{level}.")
    };
    let list = |keys: &[String]| {
        let names: Vec<_> = keys.iter().map(|k| format!("`{prefix}{k}`")).collect();
        names.join(", ")
    };
    OverrideError::UnknownKey {
        key,
        suggestion: most_similar(part, keys)
            .map(|name| format!(" (did you mean `{prefix}{name}`?)"))
            .unwrap_or_default(),
        valid: if keys.is_empty() {
            format!("`{level}` is a value and has no keys")
        } else {
            format!("the keys are {}", list(keys))
        },
    }
}

/// Reads a value as TOML; what is not TOML is a plain string. `none` may be no
/// value or a word: what it can mean, in the order in which to try.
fn parse_value(text: &str) -> Result<Vec<Value>, String> {
    let word = || Value::String(text.to_owned());
    if text == "none" {
        return Ok(vec![Value::Null, word()]);
    }
    match text.parse::<toml::Value>() {
        Ok(toml::Value::Float(x)) if !x.is_finite() => Err("it must be a finite number".into()),
        Ok(value) => serde_json::to_value(value)
            .map(|value| vec![value])
            .map_err(|e| e.to_string()),
        Err(_) => Ok(vec![word()]),
    }
}

/// The candidate nearest to `name`, if it is near enough to be a slip of the
/// finger.
fn most_similar<'a>(name: &str, candidates: &'a [String]) -> Option<&'a String> {
    candidates
        .iter()
        .map(|candidate| (strsim::levenshtein(name, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= candidate.chars().count().max(3) / 3)
        .min()
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::{Deserialize, Serialize};

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Tree {
        train: Train,
        views: Views,
    }

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Train {
        steps: u64,
        learning_rate: f64,
        radius: Option<f64>,
    }

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Views {
        One,
        All,
        None,
    }

    fn tree() -> Tree {
        Tree {
            train: Train {
                steps: 10,
                learning_rate: 0.5,
                radius: Some(1.0),
            },
            views: Views::One,
        }
    }

    #[test]
    fn a_new_kind_forgets_the_keys_of_the_old_one() {
        let config = crate::config::Preset::Fast.config();
        let text = "train.sampler.kind=uniform".to_owned();
        let uniform = apply_overrides(&config, &[text]).unwrap();
        assert_eq!(
            uniform.train.sampler,
            neat_sdf::RaySamplerConfig::Uniform(Default::default())
        );
        let same = "train.sampler.kind=grid_cached".to_owned();
        assert_eq!(apply_overrides(&config, &[same]).unwrap(), config);
    }

    #[test]
    fn an_encoding_is_chosen_and_sized() {
        let fast = crate::config::Preset::Fast.config();
        for network in ["implicit", "rendering", "attraction"] {
            let encoding = format!("model.{network}.encoding");
            let kind = format!("{encoding}.kind=grid");
            let levels = format!("{encoding}.levels=5");
            let config = apply_overrides(&fast, &[kind, levels.clone()]).unwrap();
            let model = &config.model;
            let chosen = [
                ("implicit", &model.implicit.encoding),
                ("rendering", &model.rendering.encoding),
                ("attraction", &model.attraction.encoding),
            ];
            for (name, encoding) in chosen {
                let levels = encoding.grid().map(|grid| grid.levels);
                assert_eq!(levels, (name == network).then_some(5), "{name}");
            }
            // As a run's folder keeps it.
            let text = toml::to_string(&config).unwrap();
            assert_eq!(toml::from_str::<Config>(&text).unwrap(), config);
            apply_overrides(&fast, &[levels]).unwrap_err();
        }
    }

    #[test]
    fn rays_can_stop_by_themselves() {
        use neat_sdf::ray_sampler::StopRule;
        let stop = |config: &Config| match &config.train.sampler {
            neat_sdf::RaySamplerConfig::ErrorBound(sampler) => Some(sampler.stop),
            _ => None,
        };
        let config = crate::config::Preset::PaperAbc.config();
        assert_eq!(stop(&config), Some(StopRule::Batch));
        let text = "train.sampler.stop=ray".to_owned();
        let config = apply_overrides(&config, &[text]).unwrap();
        assert_eq!(stop(&config), Some(StopRule::Ray));
    }

    fn applied(overrides: &[&str]) -> Result<Tree, OverrideError> {
        let overrides: Vec<String> = overrides.iter().map(ToString::to_string).collect();
        apply_to(&tree(), &overrides)
    }

    #[test]
    fn values_of_every_kind_are_set() {
        let set = applied(&[
            "train.steps = 7",
            "train.learning_rate=1",
            "train.radius=none",
            "views=all",
        ])
        .unwrap();
        let expected = Tree {
            train: Train {
                steps: 7,
                learning_rate: 1.0,
                radius: None,
            },
            views: Views::All,
        };
        assert_eq!(set, expected);
        // The last one wins, and what is none can get a value again.
        let again = applied(&["train.radius=none", "train.radius=2.5"]).unwrap();
        assert_eq!(again.train.radius, Some(2.5));
        // A variant may have that very name.
        assert_eq!(applied(&["views=none"]).unwrap().views, Views::None);
        let table = applied(&["train={ steps = 1, learning_rate = 2.0 }"]).unwrap();
        assert_eq!(table.train.steps, 1);
    }

    #[test]
    fn unknown_keys_list_the_valid_ones_and_the_nearest() {
        let message = applied(&["train.stepz=1"]).unwrap_err().to_string();
        assert!(message.contains("did you mean `train.steps`?"), "{message}");
        assert!(message.contains("`train.learning_rate`"), "{message}");
        let message = applied(&["training.steps=1"]).unwrap_err().to_string();
        assert!(message.contains("no key `training`"), "{message}");
        assert!(!message.contains("did you mean"), "{message}");
        assert!(message.contains("`views`"), "{message}");
        let message = applied(&["train.steps.x=1"]).unwrap_err().to_string();
        assert!(message.contains("`train.steps` is a value"), "{message}");
    }

    #[test]
    fn wrong_values_name_the_key() {
        for text in [
            "train.steps=many",
            "train.steps=-1",
            "train.steps=none",
            "train.learning_rate=nan",
            "train.learning_rate=inf",
            "views=some",
        ] {
            let message = applied(&[text]).unwrap_err().to_string();
            let (key, value) = text.split_once('=').unwrap();
            assert!(message.contains(&format!("`{key}`")), "{message}");
            assert!(message.contains(value), "{message}");
        }
        assert_eq!(
            applied(&["train.steps"]),
            Err(OverrideError::NoEqualsSign("train.steps".into()))
        );
    }
}
