//! `wireframe.json`: the graph with whatever is known about its parts.

use super::{EdgeFields, ExportError, JunctionFields, check};
use crate::Wireframe3d;
use crate::faces::{
    CurveIndex, Face, MeasuredGraph, Shell, Surface, ends_of_arc, ends_of_spline,
    nearest_junctions, points_within, triangles,
};
use nalgebra::Vector3;
use neat_core::{CircularArc, Dome, Spline, file};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The content of a `wireframe.json`.
///
/// ```json
/// {
///   "metadata": {"scene": "abc-00075213"},
///   "junctions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
///   "edges": [[0, 1]],
///   "junction_fields": {"votes": [7.0, 5.0]},
///   "edge_fields": {"visible_views": [12.0]},
///   "junction_covariances": [[1e-6, 0.0, 0.0, 1e-6, 0.0, 4e-6], null],
///   "views": ["0000", "0001"],
///   "edge_support": [[{"view": 1, "segment": [10.0, 20.5, 80.25, 21.0], "residual": 0.3}]]
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
    /// Arcs of circles beside the edges, in the frame of the user's files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arcs: Vec<CircularArc>,
    /// Smooth curves that are no arcs, likewise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub splines: Vec<Spline>,
    /// Parts of spheres that images show by their outlines, likewise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub domes: Vec<Dome>,
    /// Faces between edges, arcs and splines, closed shells first, in the frame of the user's
    /// files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shells: Vec<Shell>,
    /// The upper triangle of the covariance of every arc's centre x, y, z and radius, row by row,
    /// in squared units of the user's frame; `None` where the views do not tell. Empty, or one
    /// per arc.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arc_covariances: Vec<Option<[f64; 10]>>,
    /// Facts about every junction.
    #[serde(default, skip_serializing_if = "JunctionFields::is_empty")]
    pub junction_fields: JunctionFields,
    /// Facts about every edge.
    #[serde(default, skip_serializing_if = "EdgeFields::is_empty")]
    pub edge_fields: EdgeFields,
    /// The upper triangle `[xx, xy, xz, yy, yz, zz]` of every junction's
    /// covariance in squared units of the user's frame; `None` where the
    /// observations do not determine the position. Empty, or one per junction.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub junction_covariances: Vec<Option<[f64; 6]>>,
    /// Names of the views that `edge_support` counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<String>,
    /// The 2D segments that support every edge. Empty, or one list per edge.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edge_support: Vec<Vec<SupportingSegment>>,
}

/// A 2D segment of one view that supports an edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SupportingSegment {
    /// Index into [`WireframeDocument::views`].
    pub view: usize,
    /// Its ends `[x, y, x, y]` in pixels of the undistorted image, in the order
    /// of the edge's junctions.
    pub segment: [f64; 4],
    /// Root mean square distance of its two ends from the projected edge's line,
    /// in pixels.
    pub residual: f64,
}

impl WireframeDocument {
    /// What draws arcs as chains of straight pieces turns by so much at most, in radians: they
    /// leave the arc by less than a thousandth of its radius.
    pub const TURN_OF_DRAWN_ARCS: f64 = 0.089;

    /// The bare graph, without fields or metadata.
    pub fn wireframe(&self) -> Wireframe3d {
        Wireframe3d {
            junctions: self.junctions.clone(),
            edges: self.edges.clone(),
        }
    }

    /// The graph with arcs and splines as chains of straight pieces, for what knows none: behind
    /// the junctions the points of one arc after the other and then of the splines, behind the
    /// edges their pieces. They share no points; the ends of a closed one are one. Last come points of
    /// faces, for [`Self::drawn_triangles`].
    pub fn drawn(&self) -> Wireframe3d {
        let mut drawn = self.with_curves();
        drawn.junctions.extend(self.points_within_faces());
        drawn
    }

    /// The points along the rims of domes and within patches and domes, which stand at the end of the
    /// junctions of [`Self::drawn`].
    pub fn points_within_faces(&self) -> Vec<Vector3<f64>> {
        if !self.has_inner_points() {
            return Vec::new();
        }
        let mut within: Vec<Vector3<f64>> = self.drawn_rims().flat_map(without_last).collect();
        let mut points = self.with_curves().junctions;
        points.extend(&within);
        let chains = self.chains_between_junctions();
        within.extend(points_within(
            &self.shells,
            &self.edges,
            self.of_kinds(&chains),
            &points,
        ));
        within
    }

    fn has_inner_points(&self) -> bool {
        let mut faces = self.shells.iter().flat_map(|shell| &shell.faces);
        let ends_at_rim =
            |face: &Face| (face.steps()).any(|step| matches!(step.curve, CurveIndex::Rim(_)));
        faces.any(|face| {
            matches!(face.surface, Surface::Patch { .. } | Surface::Sphere { .. })
                || ends_at_rim(face)
        })
    }

    /// What faces are bounded by; `wireframe` is [`Self::wireframe`].
    pub fn graph<'a>(&'a self, wireframe: &'a Wireframe3d) -> MeasuredGraph<'a> {
        MeasuredGraph {
            arcs: &self.arcs,
            splines: &self.splines,
            domes: &self.domes,
            ..MeasuredGraph::of(wireframe)
        }
    }

    /// [`Self::drawn`] without points within faces.
    fn with_curves(&self) -> Wireframe3d {
        let mut drawn = self.wireframe();
        for (mut points, chain) in self.drawn_curves().zip(self.chains()) {
            if points.first() == points.last() {
                points.pop();
            }
            drawn.junctions.extend(points);
            let pieces = chain.windows(2).map(|ends| [ends[0], ends[1]]);
            drawn.edges.extend(pieces);
        }
        drawn
    }

    /// Points along each arc, and then along each spline; the first and the last of a closed one
    /// are the same.
    pub fn drawn_curves(&self) -> impl Iterator<Item = Vec<Vector3<f64>>> {
        Self::points_along(&self.arcs, &self.splines)
    }

    /// Likewise, of arcs and splines in any frame.
    pub fn points_along(
        arcs: &[CircularArc],
        splines: &[Spline],
    ) -> impl Iterator<Item = Vec<Vector3<f64>>> {
        let turn = Self::TURN_OF_DRAWN_ARCS;
        let of_arcs = arcs.iter().map(move |arc| arc.points(turn));
        of_arcs.chain(splines.iter().map(move |spline| spline.points(turn)))
    }

    /// The faces as triangles of the junctions of [`Self::drawn`], counterclockwise as seen from
    /// outside. Those of a closed shell are watertight.
    pub fn drawn_triangles(&self) -> Vec<[usize; 3]> {
        self.triangles_of_faces().concat()
    }

    /// Likewise, those of each face of each shell.
    pub fn triangles_of_faces(&self) -> Vec<Vec<[usize; 3]>> {
        if self.shells.is_empty() {
            return Vec::new();
        }
        let points = self.drawn().junctions;
        let chains = self.chains_between_junctions();
        triangles(&self.shells, &self.edges, self.of_kinds(&chains), &points)
    }

    /// Points along the rim of each dome, the first and the last the same; none of one that bounds no face.
    fn drawn_rims(&self) -> impl Iterator<Item = Vec<Vector3<f64>>> {
        let curves: BTreeSet<CurveIndex> = self.shells.iter().flat_map(Shell::curves).collect();
        let rim = move |(index, dome): (usize, &Dome)| {
            let bounds_a_face = curves.contains(&CurveIndex::Rim(index));
            let points = bounds_a_face.then(|| dome.rim().points(Self::TURN_OF_DRAWN_ARCS));
            points.unwrap_or_default()
        };
        self.domes.iter().enumerate().map(rim)
    }

    /// Chains of arcs, of splines and of the rims of domes.
    fn of_kinds<'a>(&self, chains: &'a [Vec<usize>]) -> [&'a [Vec<usize>]; 3] {
        let (arcs, others) = chains.split_at(self.arcs.len());
        let (splines, rims) = others.split_at(self.splines.len());
        [arcs, splines, rims]
    }

    /// For each arc, each spline and then the rim of each dome, the junctions of [`Self::drawn`] along
    /// it.
    fn chains(&self) -> Vec<Vec<usize>> {
        let mut first = self.junctions.len();
        let chain = |points: Vec<Vector3<f64>>| {
            let Some(pieces) = points.len().checked_sub(1) else {
                return Vec::new();
            };
            let count = pieces + usize::from(points[0] != points[pieces]);
            let chain = (0..=pieces).map(|k| first + k % count).collect();
            first += count;
            chain
        };
        (self.drawn_curves().chain(self.drawn_rims()))
            .map(chain)
            .collect()
    }

    /// Likewise, from the junctions nearest to the ends of open ones: those at which they end, if
    /// they bound a face.
    fn chains_between_junctions(&self) -> Vec<Vec<usize>> {
        let of_arcs = (self.arcs.iter()).map(|arc| (arc.is_closed(), ends_of_arc(arc)));
        let of_splines = self.splines.iter();
        let of_splines = of_splines.map(|spline| (spline.closed, ends_of_spline(spline)));
        let mut chains = self.chains();
        for (chain, (closed, ends)) in chains.iter_mut().zip(of_arcs.chain(of_splines)) {
            let last = chain.len() - 1;
            if let (false, Some([start, end])) = (closed, nearest_junctions(ends, &self.junctions))
            {
                (chain[0], chain[last]) = (start, end);
            }
        }
        chains
    }

    /// Checks everything that [`write_json`] and every other export rely on; `path`
    /// is for messages.
    ///
    /// # Errors
    /// If a number is not finite, an edge names no junction, or a field has the
    /// wrong length.
    pub fn check(&self, path: &Path) -> Result<(), ExportError> {
        check(path, &self.junctions, &self.edges)?;
        if let Some(arc) = self.arcs.iter().position(|arc| !arc.is_valid()) {
            return Err(ExportError::BadArc {
                path: path.into(),
                arc,
            });
        }
        if let Some(spline) = self.splines.iter().position(|spline| !spline.is_valid()) {
            return Err(ExportError::BadSpline {
                path: path.into(),
                spline,
            });
        }
        if let Some(dome) = self.domes.iter().position(|dome| !dome.is_valid()) {
            return Err(ExportError::BadDome {
                path: path.into(),
                dome,
            });
        }
        let wireframe = self.wireframe();
        let graph = self.graph(&wireframe);
        let is_valid = |face: &Face| face.is_valid(&graph);
        if let Some(shell) = (self.shells.iter()).position(|s| !s.faces.iter().all(is_valid)) {
            return Err(ExportError::BadShell {
                path: path.into(),
                shell,
            });
        }
        let per_junction = (
            self.junction_fields.named(),
            self.junctions.len(),
            "junction",
        );
        let per_edge = (self.edge_fields.named(), self.edges.len(), "edge");
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
        let covariances = [
            covariances_fit(&self.junction_covariances, self.junctions.len(), "junction"),
            covariances_fit(&self.arc_covariances, self.arcs.len(), "arc"),
        ];
        if let Some((expected, of)) = covariances.into_iter().find_map(Result::err) {
            return Err(ExportError::BadField {
                path: path.into(),
                field: format!("{of}_covariances"),
                expected,
                of,
            });
        }
        let finite = |support: &SupportingSegment| {
            support.view < self.views.len()
                && support.residual.is_finite()
                && support.segment.iter().all(|x| x.is_finite())
        };
        let support_fits =
            self.edge_support.is_empty() || self.edge_support.len() == self.edges.len();
        if !support_fits || !self.edge_support.iter().flatten().all(finite) {
            return Err(ExportError::BadField {
                path: path.into(),
                field: "edge_support".into(),
                expected: self.edges.len(),
                of: "edge",
            });
        }
        Ok(())
    }
}

/// The points of a closed chain, each once.
fn without_last(mut points: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
    points.pop();
    points
}

/// Whether there are none or one for each of so many things, and all numbers are finite; else what
/// there should be.
fn covariances_fit<const N: usize>(
    covariances: &[Option<[f64; N]>],
    expected: usize,
    of: &'static str,
) -> Result<(), (usize, &'static str)> {
    let mut numbers = covariances.iter().flatten().flatten();
    let fit = covariances.is_empty() || covariances.len() == expected;
    if fit && numbers.all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err((expected, of))
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
    parse_json(&bytes, path)
}

/// [`read_json`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_json`].
pub fn parse_json(bytes: &[u8], path: &Path) -> Result<WireframeDocument, ExportError> {
    let document: WireframeDocument =
        serde_json::from_slice(bytes).map_err(|source| ExportError::Json {
            path: path.into(),
            source,
        })?;
    document.check(path)?;
    Ok(document)
}
