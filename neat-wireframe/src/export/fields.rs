//! What is known about single junctions and edges, by name.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Lists of numbers by name: how fields stand in JSON.
type NamedNumbers = BTreeMap<String, Vec<f64>>;

/// Facts about every junction; each list has one entry per junction.
///
/// In JSON all values are numbers. What has the name of a fact but not its type, such
/// as a count of 1.5, is kept in `other`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "NamedNumbers", into = "NamedNumbers")]
pub struct JunctionFields {
    /// What it is: 0 an end, 1 a tee, 2 a meeting of edges in one plane, 3 a corner. See
    /// `neat_wireframe::kinds::JunctionType`.
    pub junction_type: Option<Vec<usize>>,
    /// Largest standard deviation of the position, in the unit of the files.
    pub sigma: Option<Vec<f64>>,
    /// Views with a 2D segment on one of its edges.
    pub supporting_views: Option<Vec<usize>>,
    /// Whatever another program has written.
    pub other: NamedNumbers,
}

/// Facts about every edge; each list has one entry per edge. As [`JunctionFields`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "NamedNumbers", into = "NamedNumbers")]
pub struct EdgeFields {
    /// Probability that the surface ends there, before what lies behind it. This, `crease`,
    /// `shadow` and `texture` add up to 1.
    pub boundary: Option<Vec<f64>>,
    /// Probability that two faces meet there.
    pub crease: Option<Vec<f64>>,
    /// Whether it is a piece of a curve; 1 and 0 in JSON.
    pub curved: Option<Vec<bool>>,
    /// Views that ought to show it, or do.
    pub expected_views: Option<Vec<usize>>,
    /// Whether no image shows it, but two faces of a solid meet there; 1 and 0 in JSON.
    pub inferred: Option<Vec<bool>>,
    /// Probability that it exists.
    pub probability: Option<Vec<f64>>,
    /// Root mean square distance of the ends of its supporting segments from its
    /// projected line.
    pub residual_in_pixels: Option<Vec<f64>>,
    /// Probability that it is the border of a shadow or a reflection.
    pub shadow: Option<Vec<f64>>,
    /// Views with a 2D segment on it.
    pub supporting_views: Option<Vec<usize>>,
    /// Probability that it is paint, a joint or another change within a face.
    pub texture: Option<Vec<f64>>,
    /// Whatever another program has written.
    pub other: NamedNumbers,
}

impl JunctionFields {
    /// All facts as numbers, by name.
    pub fn named(&self) -> NamedNumbers {
        let mut named = self.other.clone();
        put(
            &mut named,
            "junction_type",
            self.junction_type.as_deref().map(from_counts),
        );
        put(&mut named, "sigma", self.sigma.clone());
        put(
            &mut named,
            "supporting_views",
            self.supporting_views.as_deref().map(from_counts),
        );
        named
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl EdgeFields {
    /// All facts as numbers, by name.
    pub fn named(&self) -> NamedNumbers {
        let mut named = self.other.clone();
        put(&mut named, "boundary", self.boundary.clone());
        put(&mut named, "crease", self.crease.clone());
        put(&mut named, "shadow", self.shadow.clone());
        put(&mut named, "texture", self.texture.clone());
        put(&mut named, "curved", self.curved.as_deref().map(from_marks));
        put(
            &mut named,
            "inferred",
            self.inferred.as_deref().map(from_marks),
        );
        put(
            &mut named,
            "expected_views",
            self.expected_views.as_deref().map(from_counts),
        );
        put(&mut named, "probability", self.probability.clone());
        put(
            &mut named,
            "residual_in_pixels",
            self.residual_in_pixels.clone(),
        );
        put(
            &mut named,
            "supporting_views",
            self.supporting_views.as_deref().map(from_counts),
        );
        named
    }

    /// Probability that each edge belongs to the shape of things, a crease or a boundary, where
    /// that is known.
    pub fn structure(&self) -> Option<Vec<f64>> {
        let (crease, boundary) = (self.crease.as_ref()?, self.boundary.as_ref()?);
        Some(crease.iter().zip(boundary).map(|(a, b)| a + b).collect())
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl From<NamedNumbers> for JunctionFields {
    fn from(mut named: NamedNumbers) -> Self {
        Self {
            junction_type: take_counts(&mut named, "junction_type"),
            sigma: named.remove("sigma"),
            supporting_views: take_counts(&mut named, "supporting_views"),
            other: named,
        }
    }
}

impl From<NamedNumbers> for EdgeFields {
    fn from(mut named: NamedNumbers) -> Self {
        Self {
            boundary: named.remove("boundary"),
            crease: named.remove("crease"),
            curved: take_marks(&mut named, "curved"),
            expected_views: take_counts(&mut named, "expected_views"),
            inferred: take_marks(&mut named, "inferred"),
            probability: named.remove("probability"),
            residual_in_pixels: named.remove("residual_in_pixels"),
            shadow: named.remove("shadow"),
            supporting_views: take_counts(&mut named, "supporting_views"),
            texture: named.remove("texture"),
            other: named,
        }
    }
}

impl From<JunctionFields> for NamedNumbers {
    fn from(fields: JunctionFields) -> Self {
        fields.named()
    }
}

impl From<EdgeFields> for NamedNumbers {
    fn from(fields: EdgeFields) -> Self {
        fields.named()
    }
}

fn put(named: &mut NamedNumbers, name: &str, values: Option<Vec<f64>>) {
    if let Some(values) = values {
        named.insert(name.into(), values);
    }
}

fn from_counts(counts: &[usize]) -> Vec<f64> {
    counts.iter().map(|count| *count as f64).collect()
}

fn from_marks(marks: &[bool]) -> Vec<f64> {
    marks.iter().map(|is| f64::from(u8::from(*is))).collect()
}

/// Takes the values of this name if all are counts.
fn take_counts(named: &mut NamedNumbers, name: &str) -> Option<Vec<usize>> {
    /// All whole numbers up to here are numbers of `f64`.
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    take_up_to(named, name, LARGEST)
}

/// Takes the values of this name if all are 0 or 1.
fn take_marks(named: &mut NamedNumbers, name: &str) -> Option<Vec<bool>> {
    let counts = take_up_to(named, name, 1.0)?;
    Some(counts.into_iter().map(|count| count > 0).collect())
}

fn take_up_to(named: &mut NamedNumbers, name: &str, largest: f64) -> Option<Vec<usize>> {
    let is_count = |x: &f64| x.is_sign_positive() && x.fract() == 0.0 && *x <= largest;
    named.get(name)?.iter().all(is_count).then_some(())?;
    let values = named.remove(name)?;
    Some(values.into_iter().map(|x| x as usize).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_have_types_and_the_rest_is_kept() {
        let text = r#"{"curved":[1.0,0.0],"inferred":[0.0,1.0],"probability":[0.5,0.25],"supporting_views":[3.0,0.0],"votes":[7.5,-1.0]}"#;
        let fields: EdgeFields = serde_json::from_str(text).unwrap();
        assert_eq!(fields.curved, Some(vec![true, false]));
        assert_eq!(fields.inferred, Some(vec![false, true]));
        assert_eq!(fields.supporting_views, Some(vec![3, 0]));
        assert_eq!(fields.expected_views, None);
        assert_eq!(fields.other.keys().collect::<Vec<_>>(), ["votes"]);
        assert_eq!(serde_json::to_string(&fields).unwrap(), text);
    }

    #[test]
    fn what_is_no_count_stays_a_number() {
        for text in [
            r#"{"curved":[2.0]}"#,
            r#"{"inferred":[2.0]}"#,
            r#"{"expected_views":[1.5]}"#,
            r#"{"supporting_views":[-1.0]}"#,
        ] {
            let fields: EdgeFields = serde_json::from_str(text).unwrap();
            assert_eq!(fields.other.len(), 1, "{text}");
            assert_eq!(serde_json::to_string(&fields).unwrap(), text);
        }
        let empty: JunctionFields = serde_json::from_str(r#"{"sigma":[]}"#).unwrap();
        assert_eq!(empty.sigma, Some(Vec::new()));
        assert!(!empty.is_empty() && JunctionFields::default().is_empty());
    }
}
