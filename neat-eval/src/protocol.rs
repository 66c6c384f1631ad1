//! The protocols: a table of names and of the functions that measure by them.
//!
//! A new protocol is a file with its constants, scores and table, a variant of
//! [`Protocol`] and of [`Scores`] and a row of [`PROTOCOLS`] here, and a line in `lib.rs`.

use crate::EvalError;
use crate::abc_nef::{EdgePointScores, EdgePoints};
use crate::edge_model::EdgeModel;
use crate::edit_distance::{EditDistance, EditScores};
use crate::faces::{CadFaceScores, CadFaces, FoundFace, SceneFaceScores, SceneFaces, TrueFace};
use crate::limap_length::{LengthScores, LimapLength};
use crate::neat_abc::{NeatAbc, NeatAbcScores};
use crate::neat_dtu::{NeatSurface, ScannedSurface, SurfaceScores};
use crate::structure_score::{StructureScore, StructureScores};
use crate::surface_and_creases::{CreaseScores, SceneTruth, SurfaceAndCreases};
use crate::table::Table;
use neat_core::ground_truth::GroundTruth;
use neat_wireframe::metrics::Matching;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use tracing::{debug, debug_span};

/// A published way to measure edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// [`NeatAbc`](crate::NeatAbc).
    NeatAbc,
    /// [`NeatSurface::dtu`](crate::NeatSurface::dtu).
    NeatDtu,
    /// [`NeatSurface::blended_mvs`](crate::NeatSurface::blended_mvs).
    NeatBlendedMvs,
    /// [`EdgePoints::emap`](crate::EdgePoints::emap).
    Emap,
    /// [`EdgePoints::curve_gaussian`](crate::EdgePoints::curve_gaussian).
    CurveGaussian,
    /// [`EdgePoints::edge_gaussians`](crate::EdgePoints::edge_gaussians).
    EdgeGaussians,
    /// [`EdgePoints::nef`](crate::EdgePoints::nef).
    Nef,
    /// [`LimapLength::hypersim`](crate::LimapLength::hypersim).
    LimapHypersim,
    /// [`LimapLength::tanks_and_temples`](crate::LimapLength::tanks_and_temples).
    LimapTnt,
    /// [`StructureScore`](crate::StructureScore).
    Hss,
    /// [`EditDistance`](crate::EditDistance).
    Wed,
    /// [`SurfaceAndCreases`](crate::SurfaceAndCreases).
    SurfaceAndCreases,
    /// [`CadFaces`](crate::CadFaces).
    CadFaces,
    /// [`SceneFaces`](crate::SceneFaces).
    SceneFaces,
}

/// What a protocol compares a result with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TruthKind {
    /// True edges: [`EvaluationInput::truth`].
    Edges,
    /// Points on a surface: [`EvaluationInput::surface`].
    SurfacePoints,
    /// The exact truth of a rendered scene: [`EvaluationInput::scene`].
    Scene,
}

/// The numbers, by protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "protocol", content = "scores", rename_all = "kebab-case")]
pub enum Scores {
    /// NEAT on ABC.
    NeatAbc(NeatAbcScores),
    /// NEAT on DTU.
    NeatDtu(SurfaceScores),
    /// NEAT on BlendedMVS.
    NeatBlendedMvs(SurfaceScores),
    /// EMAP on ABC-NEF.
    Emap(EdgePointScores),
    /// CurveGaussian on ABC-NEF.
    CurveGaussian(EdgePointScores),
    /// EdgeGaussians on ABC-NEF.
    EdgeGaussians(EdgePointScores),
    /// NEF on ABC-NEF.
    Nef(EdgePointScores),
    /// LIMAP on Hypersim.
    LimapHypersim(LengthScores),
    /// LIMAP on Tanks and Temples.
    LimapTnt(LengthScores),
    /// Hybrid structure score.
    Hss(StructureScores),
    /// Wireframe edit distance.
    Wed(EditScores),
    /// Surfaces and creases of rendered scenes.
    SurfaceAndCreases(CreaseScores),
    /// Faces of CAD models.
    CadFaces(CadFaceScores),
    /// Faces of rendered scenes.
    SceneFaces(SceneFaceScores),
}

impl Scores {
    /// The protocol that they are of.
    pub fn protocol(&self) -> Protocol {
        match self {
            Self::NeatAbc(_) => Protocol::NeatAbc,
            Self::NeatDtu(_) => Protocol::NeatDtu,
            Self::NeatBlendedMvs(_) => Protocol::NeatBlendedMvs,
            Self::Emap(_) => Protocol::Emap,
            Self::CurveGaussian(_) => Protocol::CurveGaussian,
            Self::EdgeGaussians(_) => Protocol::EdgeGaussians,
            Self::Nef(_) => Protocol::Nef,
            Self::LimapHypersim(_) => Protocol::LimapHypersim,
            Self::LimapTnt(_) => Protocol::LimapTnt,
            Self::Hss(_) => Protocol::Hss,
            Self::Wed(_) => Protocol::Wed,
            Self::SurfaceAndCreases(_) => Protocol::SurfaceAndCreases,
            Self::CadFaces(_) => Protocol::CadFaces,
            Self::SceneFaces(_) => Protocol::SceneFaces,
        }
    }

    pub(crate) fn tables(&self) -> Vec<Table> {
        match self {
            Self::NeatAbc(scores) => scores.tables(),
            Self::NeatDtu(scores) | Self::NeatBlendedMvs(scores) => vec![scores.table()],
            Self::Emap(scores)
            | Self::CurveGaussian(scores)
            | Self::EdgeGaussians(scores)
            | Self::Nef(scores) => scores.tables(),
            Self::LimapHypersim(scores) | Self::LimapTnt(scores) => vec![scores.table()],
            Self::Hss(scores) => vec![scores.table()],
            Self::Wed(scores) => vec![scores.table()],
            Self::SurfaceAndCreases(scores) => scores.tables(),
            Self::CadFaces(scores) => vec![scores.table()],
            Self::SceneFaces(scores) => vec![scores.table()],
        }
    }
}

/// What is measured, and with what: as much of it as the protocol needs, all in one frame
/// and unit.
#[derive(Clone, Debug, Default)]
pub struct EvaluationInput {
    /// The result.
    pub predicted: EdgeModel,
    /// The result before its visibility check, for `neat-abc`.
    pub before: Option<EdgeModel>,
    /// The faces of the result, for `cad-faces` and `scene-faces`.
    pub faces: Vec<FoundFace>,
    /// True edges.
    pub truth: GroundTruth,
    /// True faces, for `cad-faces`.
    pub true_faces: Vec<TrueFace>,
    /// A scanned surface, for the protocols with [`TruthKind::SurfacePoints`].
    pub surface: ScannedSurface,
    /// The exact truth of a rendered scene, for those with [`TruthKind::Scene`].
    pub scene: SceneTruth,
}

/// What is asked otherwise than published; a protocol passes over what it does not know.
/// There may be more of it one day: write `..EvaluationOptions::default()`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EvaluationOptions {
    /// Distances at which shares are taken.
    pub thresholds: Option<Vec<f64>>,
    /// How predictions are paired with the truth.
    pub matching: Option<Matching>,
    /// Distances to the surface that are this long or longer are ignored.
    pub max_distance: Option<f64>,
    /// See [`EdgePoints::truth_spacing_scale`].
    pub truth_scale: Option<f64>,
    /// Seed of what is random, 0 without.
    pub seed: Option<u64>,
}

type Evaluate = fn(&Measurement) -> Result<Scores, EvalError>;

/// A protocol as one row of [`PROTOCOLS`].
struct Row {
    protocol: Protocol,
    name: &'static str,
    truth: TruthKind,
    evaluate: Evaluate,
    explanation: &'static str,
    source: &'static str,
}

const SURFACE: TruthKind = TruthKind::SurfacePoints;
const TRUE_EDGES: TruthKind = TruthKind::Edges;
const SCENE: TruthKind = TruthKind::Scene;

/// Every protocol, in the order of [`Protocol`]: what it needs, its constants with its
/// function, what it measures, and where it is published.
#[rustfmt::skip] // A table.
static PROTOCOLS: [Row; 14] = [
    row(Protocol::NeatAbc, "neat-abc", TRUE_EDGES, |m| m.neat_abc().map(Scores::NeatAbc),
        "precision and recall of junctions and segments at 0.01, 0.02 and 0.05, paired one to one",
        "NEAT, CVPR 2024, Table 6; evaluation/eval-abc.py of cherubicXN/neat"),
    row(Protocol::NeatDtu, "neat-dtu", SURFACE, |m| m.surface(NeatSurface::dtu(), &m.input.surface).map(Scores::NeatDtu),
        "distance to DTU's scan (ACC, completeness): thinned to 0.2 mm, observation mask, table plane, cut at 20 mm",
        "NEAT, CVPR 2024, Tables 1, 4 and 5; evaluation/eval-lsr-dtu.py of cherubicXN/neat, after jzhangbs/DTUeval-python"),
    row(Protocol::NeatBlendedMvs, "neat-blended-mvs", SURFACE, |m| m.surface(NeatSurface::blended_mvs(), &m.input.surface.only_points()).map(Scores::NeatBlendedMvs),
        "distance to surface points (ACC, completeness), all of them, cut at 20",
        "NEAT, CVPR 2024, Tables 1 and 4; evaluation/eval-lsr-bmvs.py of cherubicXN/neat"),
    row(Protocol::Emap, "emap", TRUE_EDGES, |m| m.edge_points(EdgePoints::emap()).map(Scores::Emap),
        "edge points on ABC-NEF, every 0.005, averaged in cells of 2/256; at 5, 10 and 20 mm",
        "EMAP, CVPR 2024; src/eval/eval_ABC.py of cvg/EMAP"),
    row(Protocol::CurveGaussian, "curve-gaussian", TRUE_EDGES, |m| m.edge_points(EdgePoints::curve_gaussian()).map(Scores::CurveGaussian),
        "edge points on ABC-NEF, every 0.005, averaged in cells of 1/256; at 5, 10 and 20 mm",
        "CurveGaussian, ICCV 2025; edge_extraction/eval_ABC.py of zhirui-gao/Curve-Gaussian"),
    row(Protocol::EdgeGaussians, "edge-gaussians", TRUE_EDGES, |m| m.edge_points(EdgePoints::edge_gaussians()).map(Scores::EdgeGaussians),
        "edge points on ABC-NEF, every 0.005, none left out; at 5, 10 and 20 mm",
        "EdgeGaussians, WACV 2025; eval.py of kunalchelani/EdgeGaussians"),
    row(Protocol::Nef, "nef", TRUE_EDGES, |m| m.edge_points(EdgePoints::nef()).map(Scores::Nef),
        "edge points on ABC-NEF, 500 per edge, averaged in cells of 1/64, truth as given; at 20 mm",
        "NEF, CVPR 2023; parametric_curve/visualize_and_eval_NEF.py of yunfan1202/NEF_code"),
    row(Protocol::LimapHypersim, "limap-hypersim", SURFACE, |m| m.lengths(LimapLength::hypersim()).map(Scores::LimapHypersim),
        "length recall and percentage of right lines at 1, 5 and 10 mm from surface points in metres",
        "LIMAP, CVPR 2023, Table 1; scripts/eval_hypersim.py of cvg/limap"),
    row(Protocol::LimapTnt, "limap-tnt", SURFACE, |m| m.lengths(LimapLength::tanks_and_temples()).map(Scores::LimapTnt),
        "length recall and percentage of right lines at 1 mm to 1 m from surface points in metres",
        "LIMAP, CVPR 2023; scripts/eval_tnt.py of cvg/limap"),
    row(Protocol::Hss, "hss", TRUE_EDGES, |m| m.structure().map(Scores::Hss),
        "hybrid structure score of buildings: F1 of vertices and IoU of edges at 0.5 m",
        "S23DR challenge 2025; hoho2025/metric_helper.py of s23dr/hoho2025"),
    row(Protocol::Wed, "wed", TRUE_EDGES, |m| m.edits().map(Scores::Wed),
        "wireframe edit distance of buildings, by the length of the truth",
        "S23DR challenge 2024; hoho/wed.py of s23dr/hoho2025"),
    row(Protocol::SurfaceAndCreases, "surface-and-creases", SCENE, |m| m.creases().map(Scores::SurfaceAndCreases),
        "distance to the exact surface (ACC), completeness and precision by length of exact creases, at 1, 2 and 5 cm times the scale",
        "neat, for rendered scenes with their truth; ACC as in NEAT, CVPR 2024, eq. 9"),
    row(Protocol::CadFaces, "cad-faces", TRUE_EDGES, |m| m.cad_faces().map(Scores::CadFaces),
        "true faces that are found, and found ones that are true, by area: same surface to 0.01, same area to 5 %",
        "neat, for CAD models whose longest side is 1"),
    row(Protocol::SceneFaces, "scene-faces", SCENE, |m| m.scene_faces().map(Scores::SceneFaces),
        "area of found faces on the exact surface, and of planar surface on found faces, at 1, 2 and 5 cm times the scale, normals to 10°",
        "neat, for rendered scenes with their truth"),
];

const fn row(
    protocol: Protocol,
    name: &'static str,
    truth: TruthKind,
    evaluate: Evaluate,
    explanation: &'static str,
    source: &'static str,
) -> Row {
    Row {
        protocol,
        name,
        truth,
        evaluate,
        explanation,
        source,
    }
}

/// A protocol on its way: the row gives its constants.
struct Measurement<'a> {
    input: &'a EvaluationInput,
    options: &'a EvaluationOptions,
}

impl Measurement<'_> {
    fn neat_abc(&self) -> Result<NeatAbcScores, EvalError> {
        let (input, mut protocol) = (self.input, NeatAbc::default());
        replace(&mut protocol.thresholds, &self.options.thresholds);
        replace(&mut protocol.matching, &self.options.matching);
        let before = input.before.as_ref().map(|model| &model.wireframe);
        protocol.evaluate(&input.predicted.wireframe, before, &input.truth.wireframe)
    }

    /// `scan` may lack what the input has for another protocol.
    fn surface(
        &self,
        mut protocol: NeatSurface,
        scan: &ScannedSurface,
    ) -> Result<SurfaceScores, EvalError> {
        replace(&mut protocol.max_distance, &self.options.max_distance);
        replace(&mut protocol.seed, &self.options.seed);
        protocol.evaluate(&self.input.predicted.wireframe, scan)
    }

    fn edge_points(&self, mut protocol: EdgePoints) -> Result<EdgePointScores, EvalError> {
        replace(&mut protocol.thresholds, &self.options.thresholds);
        replace(&mut protocol.truth_spacing_scale, &self.options.truth_scale);
        protocol.evaluate(&self.input.predicted, &self.input.truth)
    }

    fn lengths(&self, mut protocol: LimapLength) -> Result<LengthScores, EvalError> {
        replace(&mut protocol.thresholds, &self.options.thresholds);
        let lines = self.input.predicted.wireframe.segments();
        protocol.evaluate(&lines, &self.input.surface.points)
    }

    fn structure(&self) -> Result<StructureScores, EvalError> {
        let mut protocol = StructureScore::default();
        replace(&mut protocol.seed, &self.options.seed);
        protocol.evaluate(&self.input.predicted.wireframe, &self.input.truth.wireframe)
    }

    fn edits(&self) -> Result<EditScores, EvalError> {
        let (predicted, truth) = (&self.input.predicted, &self.input.truth);
        EditDistance::default().evaluate(&predicted.wireframe, &truth.wireframe)
    }

    fn cad_faces(&self) -> Result<CadFaceScores, EvalError> {
        CadFaces::default().evaluate(&self.input.faces, &self.input.true_faces)
    }

    fn scene_faces(&self) -> Result<SceneFaceScores, EvalError> {
        let mut protocol = SceneFaces::default();
        replace(&mut protocol.thresholds, &self.options.thresholds);
        protocol.evaluate(&self.input.faces, &self.input.scene)
    }

    fn creases(&self) -> Result<CreaseScores, EvalError> {
        let mut protocol = SurfaceAndCreases::default();
        replace(&mut protocol.thresholds, &self.options.thresholds);
        protocol.evaluate(&self.input.predicted.wireframe, &self.input.scene)
    }
}

/// Puts a value that was given in the place of a published one.
fn replace<T: Clone>(published: &mut T, given: &Option<T>) {
    if let Some(given) = given {
        published.clone_from(given);
    }
}

impl Protocol {
    /// All protocols.
    pub const ALL: [Self; PROTOCOLS.len()] = {
        let mut all = [Self::NeatAbc; PROTOCOLS.len()];
        let mut index = 0;
        while index < all.len() {
            all[index] = PROTOCOLS[index].protocol;
            index += 1;
        }
        all
    };

    fn row(self) -> &'static Row {
        &PROTOCOLS[self as usize]
    }

    /// The name, as in files and on command lines.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// What it measures, in one line.
    pub fn explanation(self) -> &'static str {
        self.row().explanation
    }

    /// Where it is published.
    pub fn source(self) -> &'static str {
        self.row().source
    }

    /// What it compares a result with.
    pub fn truth(self) -> TruthKind {
        self.row().truth
    }

    /// Measures a result, with the published constants but for what `options` say.
    ///
    /// # Errors
    /// If the result or what it is compared with is not valid, or the latter is empty.
    pub fn evaluate(
        self,
        input: &EvaluationInput,
        options: &EvaluationOptions,
    ) -> Result<Scores, EvalError> {
        let _span = debug_span!("evaluate", protocol = self.name()).entered();
        let scores = (self.row().evaluate)(&Measurement { input, options })?;
        debug!("measured");
        Ok(scores)
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no protocol has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no protocol is called `{name}`; there are {}", Protocol::ALL.map(Protocol::name).join(", "))]
pub struct UnknownProtocol {
    /// The name.
    pub name: String,
}

impl FromStr for Protocol {
    type Err = UnknownProtocol;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|p| p.name() == name);
        found.ok_or_else(|| UnknownProtocol { name: name.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back() {
        for protocol in Protocol::ALL {
            assert_eq!(protocol.row().protocol, protocol);
            assert_eq!(protocol.name().parse(), Ok(protocol));
            let json = serde_json::to_string(&protocol).unwrap();
            assert_eq!(json, format!("\"{}\"", protocol.name()));
        }
        let message = "neat".parse::<Protocol>().unwrap_err().to_string();
        assert!(message.contains("`neat`") && message.contains("neat-dtu, "));
    }
}
