//! `wireframe.json`: the graph with whatever is known about its parts.

use super::{ExportError, check};
use crate::Wireframe3d;
use nalgebra::Vector3;
use neat_core::file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The content of a `wireframe.json`.
///
/// ```json
/// {
///   "metadata": {"scene": "abc-00075213"},
///   "junctions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
///   "edges": [[0, 1]],
///   "junction_fields": {"votes": [7.0, 5.0]},
///   "edge_fields": {"visible_views": [12.0]}
/// }
/// ```
///
/// Everything but `junctions` may be missing, `edges` may also be called `lines`,
/// and other keys are ignored, so that ground-truth files read as well.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WireframeDocument {
    /// Anything about the whole: scene, seed, preset, version.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub metadata: BTreeMap<String, serde_json::Value>,
    /// Positions, in the frame of the user's files.
    pub junctions: Vec<Vector3<f64>>,
    /// Index pairs into `junctions`.
    #[serde(default, alias = "lines")]
    pub edges: Vec<[usize; 2]>,
    /// Named numbers, one per junction.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub junction_fields: BTreeMap<String, Vec<f64>>,
    /// Named numbers, one per edge.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub edge_fields: BTreeMap<String, Vec<f64>>,
}

impl WireframeDocument {
    /// The bare graph, without fields or metadata.
    pub fn wireframe(&self) -> Wireframe3d {
        Wireframe3d {
            junctions: self.junctions.clone(),
            edges: self.edges.clone(),
        }
    }

    fn check(&self, path: &Path) -> Result<(), ExportError> {
        check(path, &self.junctions, &self.edges)?;
        let per_junction = (&self.junction_fields, self.junctions.len(), "junction");
        let per_edge = (&self.edge_fields, self.edges.len(), "edge");
        for (fields, expected, of) in [per_junction, per_edge] {
            let bad = fields
                .iter()
                .find(|(_, x)| x.len() != expected || x.iter().any(|x| !x.is_finite()));
            if let Some((field, _)) = bad {
                return Err(ExportError::BadField {
                    path: path.into(),
                    field: field.clone(),
                    expected,
                    of,
                });
            }
        }
        Ok(())
    }
}

impl From<&Wireframe3d> for WireframeDocument {
    fn from(wireframe: &Wireframe3d) -> Self {
        Self {
            junctions: wireframe.junctions.clone(),
            edges: wireframe.edges.clone(),
            ..Self::default()
        }
    }
}

/// Writes a `wireframe.json`.
///
/// # Errors
/// If a number is not finite, an edge names no junction, a field has the wrong
/// length, or the file cannot be written.
pub fn write_json(path: &Path, document: &WireframeDocument) -> Result<(), ExportError> {
    document.check(path)?;
    let mut text = serde_json::to_vec(document).map_err(|source| ExportError::Json {
        path: path.into(),
        source,
    })?;
    text.push(b'\n');
    Ok(file::write_atomically(path, &text)?)
}

/// Reads a `wireframe.json`, or a ground-truth file with `junctions` and `lines`.
///
/// # Errors
/// If the file is missing, is not such JSON, or fails the checks of [`write_json`].
pub fn read_json(path: &Path) -> Result<WireframeDocument, ExportError> {
    let bytes = file::read(path, "reconstruct a wireframe first, or give another path")?;
    let document: WireframeDocument =
        serde_json::from_slice(&bytes).map_err(|source| ExportError::Json {
            path: path.into(),
            source,
        })?;
    document.check(path)?;
    Ok(document)
}
