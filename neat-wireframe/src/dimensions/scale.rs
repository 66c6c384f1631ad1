//! What a distance truly is: `3-17=3.20m±0.01`.

use std::str::FromStr;

/// Units by name.
const UNITS: [&str; 5] = ["mm", "cm", "m", "in", "ft"];

/// The true distance of two junctions, which sets the unit of all lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The junctions.
    pub junctions: [usize; 2],
    /// Their distance, in the unit.
    pub length: f64,
    /// Standard deviation of that, in the unit: half of what follows `±`.
    pub sigma: f64,
    /// mm, cm, m, in or ft.
    pub unit: &'static str,
}

/// A scale that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no scale: give two junctions and their distance in mm, cm, m, in or ft, such as 3-17=3.20m or 3-17=3.20m±0.01 (or +-0.01)"
)]
pub struct ScaleError(String);

impl FromStr for Scale {
    type Err = ScaleError;

    /// `A-B=LENGTH UNIT`, perhaps with `±` or `+-` and what the length may be off, in the same
    /// unit, with a probability of 95 %.
    fn from_str(text: &str) -> Result<Self, ScaleError> {
        parse(text).ok_or_else(|| ScaleError(text.to_owned()))
    }
}

fn parse(text: &str) -> Option<Scale> {
    let text = text.replace("+-", "±");
    let (junctions, distance) = text.split_once('=')?;
    let (a, b) = junctions.split_once('-')?;
    let (distance, tolerance) = match distance.split_once('±') {
        Some((distance, tolerance)) => (distance, Some(tolerance)),
        None => (distance, None),
    };
    let distance = distance.trim();
    let digits = distance.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = UNITS
        .into_iter()
        .find(|unit| *unit == &distance[digits.len()..])?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    let length = number(digits).filter(|length| *length > 0.0)?;
    let tolerance = match tolerance {
        Some(text) => {
            let text = text.trim();
            number(text.strip_suffix(unit).unwrap_or(text)).filter(|x| *x >= 0.0)?
        }
        None => 0.0,
    };
    Some(Scale {
        junctions: [a.trim().parse().ok()?, b.trim().parse().ok()?],
        length,
        sigma: tolerance / super::INTERVAL,
        unit,
    })
}
