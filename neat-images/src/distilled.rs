//! A wireframe with all that is known about it.

use crate::event::{Decision, POSES};
use nalgebra::{Matrix4, Vector3};
use neat_core::{Camera, CircularArc, Dome, Scene, Spline, Wireframe3d};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::AssembleReport;
use neat_wireframe::confidence::{Confidence, fill_arcs};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::Shell;
use neat_wireframe::kinds::{EdgeKinds, curved_chains, fill_kinds, junction_types};
use neat_wireframe::metrics::{ImageEvidence, ImageEvidenceConfig, image_evidence};
use neat_wireframe::paper::PaperBackEndCounts;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Key of [`Distilled::report`] in the metadata of `wireframe.json`.
pub const REPORT_KEY: &str = "report";
/// Key of the [`agreement`] with the images.
pub const AGREEMENT_KEY: &str = "agreement";
/// Key of the poses of [`Distilled::refined_scene`].
const REFINED_POSES_KEY: &str = "refined_poses";

/// A wireframe and how it came about.
#[derive(Clone, Debug)]
pub struct Distilled {
    /// In the world frame of the scene's cameras.
    pub wireframe: Wireframe3d,
    /// Arcs of circles beside its edges, likewise.
    pub arcs: Vec<CircularArc>,
    /// Smooth curves that are no circles, likewise.
    pub splines: Vec<Spline>,
    /// Parts of spheres that outlines show, likewise.
    pub domes: Vec<Dome>,
    /// Faces between edges, arcs and splines, likewise.
    pub shells: Vec<Shell>,
    /// How sure the centres and radii of arcs are, see
    /// [`Assembled::arc_covariances`](neat_wireframe::assemble::Assembled::arc_covariances).
    pub arc_covariances: Vec<Option<Matrix4<f64>>>,
    /// How sure every junction and edge is, and by which 2D segments.
    pub confidence: Confidence,
    /// What each edge is: of the shape of things, or on it.
    pub kinds: Vec<EdgeKinds>,
    /// Whether no image shows an edge, but solids ask for it, see
    /// [`completed`](neat_wireframe::faces::completed).
    pub inferred: Vec<bool>,
    /// What each step kept and removed.
    pub report: BackEndReport,
    /// The scene with its poses where the images show the wireframe, if they were moved.
    pub refined_scene: Option<Scene>,
}

/// What each step of a back end kept and removed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "back_end", rename_all = "snake_case")]
pub enum BackEndReport {
    /// Of the paper's.
    Paper {
        /// How many things entered and left its steps.
        steps: PaperBackEndCounts,
    },
    /// Of the assembler.
    Assembler {
        /// What its steps found.
        steps: AssembleReport,
    },
}

impl BackEndReport {
    /// Counts what went once the kinds of edges were known, and what is left.
    pub(crate) fn leave_out(&mut self, painted: usize, left: &Wireframe3d) {
        if let Self::Assembler { steps } = self {
            steps.painted += painted;
            (steps.junctions, steps.edges) = (left.junctions.len(), left.edges.len());
        }
    }

    /// Counts what solids have added.
    pub(crate) fn complete(&mut self, inferred: &[bool], whole: &Wireframe3d) {
        if let Self::Assembler { steps } = self {
            steps.inferred_edges = inferred.iter().filter(|inferred| **inferred).count();
            (steps.junctions, steps.edges) = (whole.junctions.len(), whole.edges.len());
        }
    }

    /// How far the poses were moved, if they were.
    pub fn moved_poses(&self) -> Option<Decision> {
        let Self::Assembler { steps } = self else {
            return None;
        };
        (steps.poses_moved_in_pixels > 0.0).then(|| Decision {
            setting: POSES.to_owned(),
            value: format!("moved by {:.2} pixels", steps.poses_moved_in_pixels),
            reason: format!(
                "as {:.0} % of what lines in space ask for is found by each half of them",
                100.0 * steps.pose_reliability
            ),
        })
    }

    /// Why there is no edge, by what the steps found. `asked_field`: whether a field was asked
    /// which 2D segments belong together.
    pub fn why_empty(&self, asked_field: bool) -> String {
        let found = match self {
            Self::Paper { .. } => {
                return "the field shows none: train longer, or give --preset balanced".to_owned();
            }
            Self::Assembler { steps } => steps,
        };
        let segments = format!(
            "of {} 2D segments in {} views",
            found.usable_segments, found.usable_views
        );
        const LOOK: &str = "look at `neat doctor SCENE` and at the pictures in overlays/";
        if found.usable_segments == 0 {
            format!(
                "there is no 2D segment in {} views: {LOOK}",
                found.usable_views
            )
        } else if found.segments_with_hypotheses == 0 && asked_field {
            format!("{segments} the field puts none near one of another view: train longer")
        } else if found.segments_with_hypotheses == 0 {
            format!(
                "{segments} none has a partner in another view within the scene sphere: the \
                 sphere, the poses or the 2D wireframes are wrong; {LOOK}"
            )
        } else if found.lines + found.curved_lines + found.outlines == 0 {
            format!(
                "{segments} {} have positions in space, none of which enough images show: the \
                 poses, or 2D wireframes of other images; {LOOK}",
                found.segments_with_hypotheses
            )
        } else if found.painted > 0 {
            format!(
                "the {} edges that the images show are paint, joints or shadows: \
                 --set distill.assembler.min_structure=0 keeps them",
                found.painted
            )
        } else {
            format!(
                "the {} lines that the images show bend, or are outlines of round things",
                found.curved_lines + found.outlines
            )
        }
    }
}

impl Distilled {
    /// Points along the arcs and the splines, in the world frame.
    pub fn drawn_curves(&self) -> Vec<Vec<Vector3<f64>>> {
        WireframeDocument::points_along(&self.arcs, &self.splines).collect()
    }

    /// The wireframe in the frame of the user's files, with what is known about its
    /// parts; `scene` is the one that it is of.
    pub fn document(&self, scene: &Scene) -> WireframeDocument {
        let original_from_world = &scene.original_from_world;
        let original = (self.wireframe).map(|point| original_from_world.apply(point));
        let mut document = WireframeDocument::from(&original);
        let names: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
        document.shells = (self.shells.iter())
            .map(|shell| shell.map(|point| original_from_world.apply(point)))
            .collect();
        let (arcs, covariances) = (&self.arcs, &self.arc_covariances);
        fill_arcs(&mut document, arcs, covariances, original_from_world);
        document.splines = (self.splines.iter())
            .map(|spline| spline.map(|point| original_from_world.apply(point)))
            .collect();
        document.domes = (self.domes.iter())
            .map(|dome| dome.map(|point| original_from_world.apply(point)))
            .collect();
        self.confidence
            .fill(&mut document, &names, original_from_world);
        fill_kinds(&mut document, &self.kinds, &junction_types(&self.wireframe));
        let curved = curved_chains(&self.wireframe);
        if curved.contains(&true) {
            document.edge_fields.curved = Some(curved);
        }
        if self.inferred.contains(&true) {
            document.edge_fields.inferred = Some(self.inferred.clone());
        }
        document
    }

    /// What `wireframe.json` says about the whole: the steps, the agreement with the images,
    /// and the poses if they were moved.
    pub fn metadata(&self, agreement: Option<ImageEvidence>) -> BTreeMap<String, Value> {
        let refined = self.refined_scene.as_ref().map(poses_in_original);
        let refined = refined.map(|poses| (REFINED_POSES_KEY, json!(poses)));
        let always = [
            (REPORT_KEY, json!(self.report)),
            (AGREEMENT_KEY, json!(agreement)),
        ];
        (always.into_iter().chain(refined))
            .map(|(key, value)| (key.to_owned(), value))
            .collect()
    }
}

/// How well a wireframe in the scene's world agrees with the 2D segments and the
/// sparse points, with lengths in the unit of the user's files; `None` for a
/// wireframe that is not valid.
pub fn agreement(
    scene: &Scene,
    min_segment_score: f64,
    wireframe: &Wireframe3d,
) -> Option<ImageEvidence> {
    let views = ViewObservation::from_scene(scene, min_segment_score);
    let points: Vec<_> = (scene.sparse_points.iter())
        .map(|point| point.position_in_world)
        .collect();
    let config = ImageEvidenceConfig::default();
    let mut evidence = image_evidence(wireframe, &views, &points, &config).ok()?;
    if let Some(distance) = &mut evidence.median_junction_to_point_distance {
        *distance *= scene.original_from_world.length_factor();
    }
    Some(evidence)
}

/// For each view the rows of its camera-to-world matrix, in the frame of the user's files.
fn poses_in_original(scene: &Scene) -> BTreeMap<&str, [[f64; 4]; 3]> {
    let pose = |camera: &Camera| {
        let camera = scene.original_from_world.apply_to_camera(camera);
        let (center, turn) = (camera.center_in_world, camera.world_from_camera);
        [0, 1, 2].map(|row| [turn[(row, 0)], turn[(row, 1)], turn[(row, 2)], center[row]])
    };
    let views = scene.views.iter();
    views
        .map(|view| (view.name.as_str(), pose(&view.camera)))
        .collect()
}

/// What a person wants to know first of a result: (label, value).
pub fn result_facts(
    document: &WireframeDocument,
    agreement: Option<ImageEvidence>,
) -> Vec<(&'static str, String)> {
    let mut result = vec![
        ("Junctions", document.junctions.len().to_string()),
        ("Edges", document.edges.len().to_string()),
    ];
    if let Some(curved) = &document.edge_fields.curved {
        let pieces = curved.iter().filter(|is_piece| **is_piece).count();
        result.push(("Of them pieces of curves", pieces.to_string()));
    }
    if let Some(agreement) = agreement {
        let explained = agreement.explained_length_share.map(|share| {
            let percent = format!("{:.0} % of their length", 100.0 * share);
            ("2D segments explained", percent)
        });
        let off = agreement.mean_reprojection_error_in_pixels;
        let off = off.map(|pixels| ("Mean distance from them", format!("{pixels:.2} px")));
        result.extend(explained.into_iter().chain(off));
    }
    result
}
