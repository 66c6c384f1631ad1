//! Settings as Python writes them: a dict, nested or with dotted keys, or the texts of
//! `--set`.

use crate::errors::Failure;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};

/// The overrides `key.path=value` of `settings`, in order.
pub fn overrides(settings: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<String>> {
    let Some(settings) = settings else {
        return Ok(Vec::new());
    };
    let mut overrides = Vec::new();
    match settings.cast::<PyDict>() {
        Ok(dict) => flatten(dict, "", &mut overrides)?,
        Err(_) if settings.is_instance_of::<PyString>() => {
            return Err(Failure::input(
                "settings is a text: give a dict, or a list of `key=value`",
            )
            .into());
        }
        Err(_) => overrides = settings.extract()?,
    }
    Ok(overrides)
}

fn flatten(dict: &Bound<'_, PyDict>, above: &str, overrides: &mut Vec<String>) -> PyResult<()> {
    for (key, value) in dict {
        let key = format!("{above}{}", key.extract::<String>()?);
        match value.cast::<PyDict>() {
            Ok(dict) => flatten(dict, &format!("{key}."), overrides)?,
            Err(_) => overrides.push(format!("{key}={}", as_toml(&value)?)),
        }
    }
    Ok(())
}

/// What `--set` reads: words as they are, lists of numbers and texts alike in JSON and TOML.
fn as_toml(value: &Bound<'_, PyAny>) -> PyResult<String> {
    if value.is_none() {
        return Ok("none".to_owned());
    }
    if let Ok(text) = value.cast::<PyString>() {
        return text.extract();
    }
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(truth.is_true().to_string());
    }
    // Of numpy's numbers and arrays, plain ones.
    let value = match value.hasattr("tolist")? {
        true => value.call_method0("tolist")?,
        false => value.clone(),
    };
    let json = value.py().import("json")?;
    json.call_method1("dumps", (value,))?.extract()
}
