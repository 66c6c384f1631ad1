//! A wireframe as plain arrays, the way C reads it.

use neat_core::CircularArc;
use neat_wireframe::export::{ExportError, WireframeDocument, read_json};
use std::path::Path;

/// The numbers of a wireframe. Lists that its file lacks are empty.
#[derive(Debug, Default, PartialEq)]
pub struct Numbers {
    /// x, y, z of every junction.
    pub junctions: Vec<f64>,
    /// xx, xy, xz, yy, yz, zz of every junction; NaN where it is not determined.
    pub covariances: Vec<f64>,
    /// Two indices of junctions per edge.
    pub edges: Vec<u32>,
    /// The probability that an edge exists.
    pub probabilities: Vec<f64>,
    /// Crease, boundary, texture, shadow: four probabilities per edge.
    pub kinds: Vec<f64>,
    /// 1 for an edge that is a piece of a curve, else 0.
    pub curved: Vec<u8>,
    /// Twelve numbers per arc: centre, two axes, radius, two angles.
    pub arcs: Vec<f64>,
    /// Ten numbers per arc; NaN where it is not determined.
    pub arc_covariances: Vec<f64>,
    /// x, y, z of the control points of one spline after the other.
    pub spline_controls: Vec<f64>,
    /// How many control points each spline has.
    pub spline_sizes: Vec<u32>,
    /// 1 for a spline that runs around, else 0.
    pub spline_closed: Vec<u8>,
}

impl Numbers {
    /// Those of a `wireframe.json`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Self, ExportError> {
        Ok(Self::of(&read_json(path)?))
    }

    fn of(document: &WireframeDocument) -> Self {
        let fields = &document.edge_fields;
        let kinds = [
            &fields.crease,
            &fields.boundary,
            &fields.texture,
            &fields.shadow,
        ];
        // All four, or it is not known.
        let kinds = match kinds.map(Option::as_deref) {
            [Some(crease), Some(boundary), Some(texture), Some(shadow)] => (0..crease.len())
                .flat_map(|i| [crease[i], boundary[i], texture[i], shadow[i]])
                .collect(),
            _ => Vec::new(),
        };
        let covariances = document.junction_covariances.iter();
        Self {
            junctions: (document.junctions.iter())
                .flat_map(|x| [x.x, x.y, x.z])
                .collect(),
            covariances: covariances
                .flat_map(|known| known.unwrap_or([f64::NAN; 6]))
                .collect(),
            // A file with so many junctions is refused long before.
            edges: (document.edges.iter().flatten())
                .map(|junction| *junction as u32)
                .collect(),
            probabilities: fields.probability.clone().unwrap_or_default(),
            kinds,
            curved: (fields.curved.iter().flatten())
                .map(|curved| u8::from(*curved))
                .collect(),
            arcs: document.arcs.iter().flat_map(of_arc).collect(),
            arc_covariances: (document.arc_covariances.iter())
                .flat_map(|known| known.unwrap_or([f64::NAN; 10]))
                .collect(),
            spline_controls: (document.splines.iter())
                .flat_map(|spline| &spline.controls)
                .flatten()
                .copied()
                .collect(),
            spline_sizes: (document.splines.iter())
                .map(|spline| spline.controls.len() as u32)
                .collect(),
            spline_closed: (document.splines.iter())
                .map(|spline| u8::from(spline.closed))
                .collect(),
        }
    }
}

fn of_arc(arc: &CircularArc) -> [f64; 12] {
    let [x, y] = arc.axes;
    let points = [arc.center, x, y];
    let mut numbers = points
        .iter()
        .flatten()
        .copied()
        .chain([arc.radius])
        .chain(arc.angles);
    std::array::from_fn(|_| numbers.next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_wireframe::export::parse_json;

    #[test]
    fn arrays_hold_what_the_file_says() {
        let text = br#"{
            "junctions": [[0, 0, 0], [1, 0, 0], [1, 2, 3]], "edges": [[0, 1], [1, 2]],
            "junction_covariances": [[1, 2, 3, 4, 5, 6], null, [6, 5, 4, 3, 2, 1]],
            "edge_fields": {
                "probability": [0.5, 1], "curved": [0, 1], "crease": [0.25, 1],
                "boundary": [0.25, 0], "texture": [0.5, 0], "shadow": [0, 0]
            },
            "arcs": [
                {"center": [1, 2, 3], "axes": [[1, 0, 0], [0, 1, 0]], "radius": 4, "angles": [0, 2]},
                {"center": [0, 0, 0], "axes": [[0, 1, 0], [0, 0, 1]], "radius": 1, "angles": [1, 3]}
            ],
            "arc_covariances": [[1, 2, 3, 4, 5, 6, 7, 8, 9, 10], null],
            "splines": [
                {"controls": [[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 3]], "closed": false},
                {"controls": [[4, 5, 6], [1, 0, 0], [1, 1, 0]], "closed": true}
            ]
        }"#;
        let numbers = Numbers::of(&parse_json(text, Path::new("a.json")).unwrap());
        assert_eq!(
            numbers.junctions,
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0]
        );
        assert_eq!(numbers.edges, [0, 1, 1, 2]);
        assert_eq!(numbers.covariances[..6], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert!(numbers.covariances[6..12].iter().all(|x| x.is_nan()));
        assert_eq!(numbers.covariances.len(), 18);
        assert_eq!(numbers.probabilities, [0.5, 1.0]);
        assert_eq!(numbers.curved, [0, 1]);
        let first = [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 4.0, 0.0, 2.0];
        assert_eq!((numbers.arcs.len(), &numbers.arcs[..12]), (24, &first[..]));
        assert_eq!(numbers.arc_covariances[9], 10.0);
        assert!(numbers.arc_covariances[10..].iter().all(|x| x.is_nan()));
        assert_eq!(
            numbers.spline_controls[9..15],
            [0.0, 2.0, 3.0, 4.0, 5.0, 6.0]
        );
        assert_eq!(numbers.spline_sizes, [4, 3]);
        assert_eq!(numbers.spline_closed, [0, 1]);
        assert_eq!(numbers.kinds, [0.25, 0.25, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn what_a_file_lacks_is_empty() {
        let text = br#"{"junctions": [[0, 0, 0], [1, 0, 0]], "edges": [[0, 1]]}"#;
        let numbers = Numbers::of(&parse_json(text, Path::new("a.json")).unwrap());
        assert_eq!(numbers.edges, [0, 1]);
        assert!(numbers.covariances.is_empty() && numbers.kinds.is_empty());
        assert!(numbers.probabilities.is_empty() && numbers.curved.is_empty());
    }
}
