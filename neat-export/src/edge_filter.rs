//! Only the edges that are certain enough, or of the shape of things.

use crate::ExportError;
use neat_wireframe::export::WireframeDocument;
use serde_json::json;
use std::collections::BTreeMap;

/// The edge field with the probability that an edge exists.
pub const PROBABILITY: &str = "probability";
/// The edge field with the number of views that show an edge.
pub const SUPPORTING_VIEWS: &str = "supporting_views";

/// Which edges are exported.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EdgeFilter {
    /// Only edges whose field `probability` is at least this.
    pub min_probability: Option<f64>,
    /// Only edges whose field `supporting_views` is at least this.
    pub min_views: Option<u32>,
    /// Only edges that are more likely creases and boundaries of surfaces than texture and
    /// shadows.
    pub only_structure: bool,
}

impl EdgeFilter {
    /// Checks the numbers.
    ///
    /// # Errors
    /// If the probability is none.
    pub fn check(&self) -> Result<(), ExportError> {
        match self.min_probability {
            Some(minimum) if !(0.0..=1.0).contains(&minimum) => Err(ExportError::BadOption {
                option: "the minimum probability",
                value: minimum.to_string(),
                expected: "a number from 0 to 1",
            }),
            _ => Ok(()),
        }
    }

    /// The document with the edges that pass, in their order, and the junctions
    /// that they join. Fields, covariances and support follow; the metadata say
    /// what was asked for. Arcs and splines all stay: nothing is known of them that a filter asks.
    /// Faces go with their edges, and a shell that loses one is a sheet. Without any
    /// minimum, the document as it is, junctions without edges too.
    ///
    /// The document must be valid, see [`WireframeDocument::check`].
    ///
    /// # Errors
    /// If a minimum is out of range or the document lacks its field.
    pub fn apply(&self, document: &WireframeDocument) -> Result<WireframeDocument, ExportError> {
        self.check()?;
        if *self == Self::default() {
            return Ok(document.clone());
        }
        let minima = [
            (PROBABILITY, "the minimum probability", self.min_probability),
            (
                SUPPORTING_VIEWS,
                "the minimum number of views",
                self.min_views.map(f64::from),
            ),
        ];
        let fields = document.edge_fields.named();
        let mut passes = vec![true; document.edges.len()];
        if self.only_structure {
            let structure = document
                .edge_fields
                .structure()
                .ok_or(ExportError::NoField {
                    field: "crease",
                    option: "only structure",
                })?;
            for (passes, structure) in passes.iter_mut().zip(structure) {
                *passes = structure >= 0.5;
            }
        }
        for (field, option, minimum) in minima {
            let Some(minimum) = minimum else { continue };
            let values = fields
                .get(field)
                .ok_or(ExportError::NoField { field, option })?;
            for (passes, value) in passes.iter_mut().zip(values) {
                *passes &= *value >= minimum;
            }
        }
        let mut kept = with_edges(document, &passes);
        kept.metadata.insert(
            "edge_filter".into(),
            json!({
                "min_probability": self.min_probability,
                "min_views": self.min_views,
                "only_structure": self.only_structure,
            }),
        );
        Ok(kept)
    }
}

/// The document with the chosen edges and the junctions that they join.
fn with_edges(document: &WireframeDocument, passes: &[bool]) -> WireframeDocument {
    let mut joined = vec![false; document.junctions.len()];
    let passing = document.edges.iter().zip(passes).filter(|(_, p)| **p);
    for (ends, _) in passing.clone() {
        for end in ends {
            joined[*end] = true;
        }
    }
    let mut new_index = Vec::with_capacity(joined.len());
    let mut count = 0;
    for &joined in &joined {
        new_index.push(count);
        count += usize::from(joined);
    }
    let kept: Vec<usize> = (0..passes.len()).filter(|edge| passes[*edge]).collect();
    let new_edge = |edge: usize| kept.binary_search(&edge).ok();
    let new_junction = |junction: usize| joined[junction].then_some(new_index[junction]);
    WireframeDocument {
        arcs: document.arcs.clone(),
        splines: document.splines.clone(),
        domes: document.domes.clone(),
        shells: (document.shells.iter())
            .filter_map(|shell| shell.with_indices(new_edge, new_junction))
            .collect(),
        arc_covariances: document.arc_covariances.clone(),
        metadata: document.metadata.clone(),
        junctions: chosen(&document.junctions, &joined),
        edges: passing
            .map(|(ends, _)| ends.map(|end| new_index[end]))
            .collect(),
        junction_fields: chosen_fields(&document.junction_fields.named(), &joined).into(),
        edge_fields: chosen_fields(&document.edge_fields.named(), passes).into(),
        junction_covariances: chosen(&document.junction_covariances, &joined),
        views: document.views.clone(),
        edge_support: chosen(&document.edge_support, passes),
    }
}

fn chosen<T: Clone>(items: &[T], choice: &[bool]) -> Vec<T> {
    let chosen = items.iter().zip(choice).filter(|(_, chosen)| **chosen);
    chosen.map(|(item, _)| item.clone()).collect()
}

fn chosen_fields(
    fields: &BTreeMap<String, Vec<f64>>,
    choice: &[bool],
) -> BTreeMap<String, Vec<f64>> {
    fields
        .iter()
        .map(|(name, values)| (name.clone(), chosen(values, choice)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use neat_wireframe::export::{EdgeFields, SupportingSegment};
    use std::path::Path;

    /// A path 0–1–2–3 and the lonely junction 4; edge `i` has `i` views and the
    /// probability `i / 2`.
    fn document() -> WireframeDocument {
        let support = |view| SupportingSegment {
            view,
            segment: [0.0; 4],
            residual: 0.5,
        };
        WireframeDocument {
            junctions: (0..5).map(|i| Vector3::repeat(f64::from(i))).collect(),
            edges: vec![[0, 1], [2, 1], [2, 3]],
            junction_fields: BTreeMap::from([(
                "sigma".into(),
                (0..5).map(|i| 0.1 * f64::from(i)).collect(),
            )])
            .into(),
            edge_fields: BTreeMap::from([
                (PROBABILITY.into(), vec![0.0, 0.5, 1.0]),
                (SUPPORTING_VIEWS.into(), vec![0.0, 1.0, 2.0]),
            ])
            .into(),
            junction_covariances: (0..5)
                .map(|i| (i != 3).then_some([f64::from(i); 6]))
                .collect(),
            views: vec!["a".into(), "b".into(), "c".into()],
            edge_support: vec![Vec::new(), vec![support(1)], vec![support(0), support(2)]],
            ..WireframeDocument::default()
        }
    }

    #[test]
    fn without_minima_nothing_changes() {
        let kept = EdgeFilter::default().apply(&document()).unwrap();
        assert_eq!(kept, document());
    }

    #[test]
    fn what_belongs_to_edges_and_junctions_follows_them() {
        let filter = EdgeFilter {
            min_probability: Some(0.5),
            min_views: Some(2),
            ..EdgeFilter::default()
        };
        let kept = filter.apply(&document()).unwrap();
        kept.check(Path::new("w")).unwrap();
        assert_eq!(kept.junctions, document().junctions[2..4]);
        assert_eq!(kept.edges, [[0, 1]]);
        assert_eq!(kept.junction_fields.sigma, Some(vec![0.2, 0.1 * 3.0]));
        assert_eq!(kept.edge_fields.probability, Some(vec![1.0]));
        assert_eq!(kept.junction_covariances, [Some([2.0; 6]), None]);
        assert_eq!(kept.edge_support, document().edge_support[2..]);
        assert_eq!(kept.metadata["edge_filter"]["min_views"], 2);

        let only_views = EdgeFilter {
            min_views: Some(1),
            ..EdgeFilter::default()
        };
        let kept = only_views.apply(&document()).unwrap();
        assert_eq!(kept.edges, [[1, 0], [1, 2]]);
    }

    #[test]
    fn paint_and_shadows_are_left_out_on_request() {
        let mut document = document();
        document.edge_fields.crease = Some(vec![0.2, 0.3, 0.9]);
        document.edge_fields.boundary = Some(vec![0.2, 0.3, 0.0]);
        let filter = EdgeFilter {
            only_structure: true,
            ..EdgeFilter::default()
        };
        let kept = filter.apply(&document).unwrap();
        assert_eq!(kept.edges, [[1, 0], [1, 2]]);
        assert_eq!(kept.edge_fields.crease, Some(vec![0.3, 0.9]));
        assert_eq!(kept.metadata["edge_filter"]["only_structure"], true);
    }

    #[test]
    fn nothing_passes_an_impossible_minimum() {
        let filter = EdgeFilter {
            min_views: Some(u32::MAX),
            ..EdgeFilter::default()
        };
        let kept = filter.apply(&document()).unwrap();
        kept.check(Path::new("w")).unwrap();
        assert!(kept.junctions.is_empty() && kept.edges.is_empty());
    }

    #[test]
    fn a_missing_field_and_a_bad_minimum_are_errors() {
        let mut document = document();
        document.edge_fields = EdgeFields::default();
        let filter = |min_probability, min_views| EdgeFilter {
            min_probability,
            min_views,
            ..EdgeFilter::default()
        };
        let structure = EdgeFilter {
            only_structure: true,
            ..EdgeFilter::default()
        };
        for (filter, named) in [
            (filter(Some(0.5), None), "`probability`"),
            (filter(None, Some(3)), "`supporting_views`"),
            (structure, "`crease`"),
            (filter(Some(f64::NAN), None), "NaN"),
            (filter(Some(-0.1), None), "-0.1"),
            (filter(Some(50.0), None), "from 0 to 1"),
        ] {
            let error = filter.apply(&document).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
