//! In what two configurations differ.

use super::Config;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// A value that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Difference {
    /// Its key, as `--set` takes it.
    pub key: String,
    /// The value in the first configuration, `none` where there is none.
    pub then: String,
    /// The value in the second one.
    pub now: String,
}

/// All values that differ, in the order of their keys.
pub(crate) fn differences(then: &Config, now: &Config) -> Vec<Difference> {
    let (then, now) = (leaves(then), leaves(now));
    let keys: BTreeSet<&String> = then.keys().chain(now.keys()).collect();
    let told = |value: Option<&Value>| match value {
        None | Some(Value::Null) => "none".to_owned(),
        Some(value) => value.to_string(),
    };
    keys.into_iter()
        .map(|key| Difference {
            key: key.clone(),
            then: told(then.get(key)),
            now: told(now.get(key)),
        })
        .filter(|difference| difference.then != difference.now)
        .collect()
}

fn leaves(config: &Config) -> BTreeMap<String, Value> {
    let mut leaves = BTreeMap::new();
    let tree = serde_json::to_value(config).expect("differences: a configuration is a tree");
    collect_leaves("", &tree, &mut leaves);
    leaves
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use std::collections::BTreeSet;

    /// Two hundred is what a person can still look through: a number that nobody has
    /// a reason to change is a constant beside its use.
    #[test]
    fn there_are_not_more_settings_than_a_person_can_look_through() {
        let keys: BTreeSet<String> = (Preset::ALL.iter())
            .flat_map(|preset| leaves(&preset.config()).into_keys())
            .collect();
        assert!((100..=200).contains(&keys.len()), "{} settings", keys.len());
    }

    #[test]
    fn every_value_that_differs_is_named() {
        let then = Preset::Fast.config();
        assert!(differences(&then, &then).is_empty());
        let mut now = then.clone();
        now.train.steps = 5;
        now.data.max_views = Some(7);
        let difference = |key: &str, then: &str, now: &str| Difference {
            key: key.to_owned(),
            then: then.to_owned(),
            now: now.to_owned(),
        };
        assert_eq!(
            differences(&then, &now),
            [
                difference("data.max_views", "none", "7"),
                difference("train.steps", &then.train.steps.to_string(), "5"),
            ]
        );
        // Another kind of sampler has other keys.
        let paper = differences(&then, &Preset::PaperAbc.config());
        let resolution = difference("train.sampler.resolution", "48", "none");
        assert!(paper.contains(&resolution), "{paper:?}");
    }
}
