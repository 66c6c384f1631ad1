//! Values that may be left open.

use serde::de::value::{Error, StringDeserializer};
use serde::de::{Deserialize, Deserializer, Error as _, IntoDeserializer};
use serde::ser::{Serialize, Serializer};

/// The word for what a person leaves open.
const AUTO: &str = "auto";

/// A value, or `auto`: the scene decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice<T> {
    /// The scene decides.
    #[default]
    Auto,
    /// This one.
    Given(T),
}

impl<T: Serialize> Serialize for Choice<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str(AUTO),
            Self::Given(value) => value.serialize(serializer),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Choice<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        if word == AUTO {
            return Ok(Self::Auto);
        }
        let word: StringDeserializer<Error> = word.into_deserializer();
        let explained = |error: Error| D::Error::custom(format!("{error} or `{AUTO}`"));
        T::deserialize(word).map(Self::Given).map_err(explained)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Background;

    #[test]
    fn a_choice_is_a_word() {
        let read = |text: &str| serde_json::from_str::<Choice<Background>>(text);
        for (text, choice) in [
            ("\"auto\"", Choice::Auto),
            ("\"photo\"", Choice::Given(Background::Photo)),
        ] {
            assert_eq!(read(text).unwrap(), choice);
            assert_eq!(serde_json::to_string(&choice).unwrap(), text);
        }
        let error = read("\"phtoo\"").unwrap_err().to_string();
        assert!(error.contains("`photo` or `auto`"), "{error}");
        assert!(read("3").is_err());
    }
}
