//! From what a back end has made to what is known of it: how sure each part is, what each edge is, and
//! which faces there are. What is hardly structure goes, and what solids prove comes.

use crate::assemble::{AssembleError, Draft};
use crate::distilled::{BackEndReport, Distilled};
use nalgebra::{Matrix3, Matrix4};
use neat_core::{CircularArc, Scene, Wireframe3d};
use neat_wireframe::confidence::{Confidence, ConfidenceConfig, assess};
use neat_wireframe::faces::{
    MeasuredGraph, Shell, SurfacePoint, closed_faces, completed, creases_of_solids, divided_arcs,
    find_shells, loose_lines_on_solids, surface_points,
};
use neat_wireframe::kinds::{EdgeKinds, WithoutPaint, edge_kinds, without_paint};
use neat_wireframe::{SignedDistance, ViewObservation};
use std::mem;

/// What is asked, and by whom.
struct Assessor<'a> {
    draft: &'a Draft,
    /// Those of the draft, at last divided where edges end on them.
    arcs: Vec<CircularArc>,
    arc_covariances: Vec<Option<Matrix4<f64>>>,
    scene: &'a Scene,
    views: Vec<ViewObservation>,
    points: Vec<SurfacePoint>,
    hiding: Option<&'a dyn SignedDistance>,
    scene_radius: f64,
    config: &'a ConfidenceConfig,
}

/// A wireframe with what is known of it.
struct Structure {
    wireframe: Wireframe3d,
    confidence: Confidence,
    kinds: Vec<EdgeKinds>,
    shells: Vec<Shell>,
    /// Whether an edge is known by its faces alone, of each.
    inferred: Vec<bool>,
}

impl Draft {
    /// Asks the images, and the surface that may hide things where one is given, how sure
    /// everything is and what each edge is; what is hardly structure goes.
    ///
    /// # Errors
    /// If an image lies in a file that cannot be read, or the wireframe is not valid.
    pub fn assess(
        mut self,
        scene: &Scene,
        min_segment_score: f64,
        hiding: Option<&dyn SignedDistance>,
        scene_radius: f64,
        config: &ConfidenceConfig,
    ) -> Result<Distilled, AssembleError> {
        let refined_scene =
            (self.refined_cameras.take()).map(|cameras| scene.clone().with_cameras(&cameras));
        // The images are asked from where they show the wireframe.
        let scene = refined_scene.as_ref().unwrap_or(scene);
        let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
        let mut assessor = Assessor {
            arcs: mem::take(&mut self.arcs),
            arc_covariances: mem::take(&mut self.arc_covariances),
            draft: &self,
            scene,
            views: ViewObservation::from_scene(scene, min_segment_score),
            points: surface_points(&cameras, &scene.sparse_points),
            hiding,
            scene_radius,
            config,
        };
        let mut report = self.report.clone();
        let found = assessor.structure(&mut report)?;
        let found = assessor.without_lines_on_solids(found, &mut report)?;
        let mut found = assessor.completed(found, &mut report)?;
        // The light on them says less than two faces that meet.
        for edge in creases_of_solids(&found.wireframe, &found.shells) {
            found.kinds[edge] = EdgeKinds::CREASE;
        }
        let (arcs, arc_covariances) = (assessor.arcs, assessor.arc_covariances);
        Ok(Distilled {
            wireframe: found.wireframe,
            arcs,
            shells: found.shells,
            arc_covariances,
            splines: self.splines,
            domes: self.domes,
            confidence: found.confidence,
            kinds: found.kinds,
            inferred: found.inferred,
            report,
            refined_scene,
        })
    }
}

impl Assessor<'_> {
    /// The wireframe without what is hardly structure, and the arcs divided by what is left.
    fn structure(&mut self, report: &mut BackEndReport) -> Result<Structure, AssembleError> {
        let whole = &self.draft.wireframe;
        let confidence = self.confidence(whole)?;
        let kinds = self.kinds(whole, &confidence)?;
        let left = self.without_paint(whole, &kinds);
        self.divide_arcs(&left.wireframe);
        if left.painted == 0 {
            return Ok(self.with_shells(left.wireframe, left.kinds, confidence));
        }
        report.leave_out(left.painted, &left.wireframe);
        let confidence = self.confidence(&left.wireframe)?;
        Ok(self.with_shells(left.wireframe, left.kinds, confidence))
    }

    fn divide_arcs(&mut self, wireframe: &Wireframe3d) {
        let pieces = divided_arcs(&self.graph(wireframe, &[]));
        self.arc_covariances = (pieces.iter())
            .map(|(arc, _)| self.arc_covariances[*arc])
            .collect();
        self.arcs = pieces.into_iter().map(|(_, piece)| piece).collect();
    }

    /// Lines on faces of solids that close without them are something painted, too.
    fn without_lines_on_solids(
        &self,
        found: Structure,
        report: &mut BackEndReport,
    ) -> Result<Structure, AssembleError> {
        let covariances = covariances(&found.confidence);
        let graph = self.graph(&found.wireframe, &covariances);
        let lines = loose_lines_on_solids(&graph, &found.shells, |graph| self.shells_of(graph));
        if lines.is_empty() {
            return Ok(found);
        }
        let mut kinds = found.kinds.clone();
        lines
            .iter()
            .for_each(|line| kinds[*line] = EdgeKinds::TEXTURE);
        let left = self.without_paint(&found.wireframe, &kinds);
        let confidence = self.confidence(&left.wireframe)?;
        let without = self.with_shells(left.wireframe, left.kinds, confidence);
        if closed_faces(&without.shells) <= closed_faces(&found.shells) {
            return Ok(found);
        }
        report.leave_out(left.painted, &without.wireframe);
        Ok(without)
    }

    /// The wireframe with the edges that its solids have beside those that images show.
    fn completed(
        &self,
        found: Structure,
        report: &mut BackEndReport,
    ) -> Result<Structure, AssembleError> {
        let covariances = covariances(&found.confidence);
        let graph = self.graph(&found.wireframe, &covariances);
        let Some(completed) = completed(&graph, &found.shells) else {
            return Ok(found);
        };
        let confidence = self.confidence(&completed.wireframe)?;
        let confidence = confidence.of_completed(&completed, &found.confidence);
        let kinds = self.kinds(&completed.wireframe, &confidence)?;
        let inferred: Vec<bool> = completed.inferred().collect();
        let whole = Structure {
            inferred,
            ..self.with_shells(completed.wireframe, kinds, confidence)
        };
        // What was added is true as long as the solids are there.
        if closed_faces(&whole.shells) < closed_faces(&found.shells) {
            return Ok(found);
        }
        report.complete(&whole.inferred, &whole.wireframe);
        Ok(whole)
    }

    fn confidence(&self, wireframe: &Wireframe3d) -> Result<Confidence, AssembleError> {
        let (views, radius) = (&self.views, self.scene_radius);
        Ok(assess(wireframe, views, self.hiding, radius, self.config)?)
    }

    fn kinds(
        &self,
        wireframe: &Wireframe3d,
        confidence: &Confidence,
    ) -> Result<Vec<EdgeKinds>, AssembleError> {
        let least = self.draft.min_structure;
        Ok(edge_kinds(wireframe, self.scene, &confidence.edges, least)?)
    }

    fn without_paint(&self, wireframe: &Wireframe3d, kinds: &[EdgeKinds]) -> WithoutPaint {
        let curves = (&self.arcs[..], &self.draft.splines[..]);
        without_paint(wireframe, curves, kinds, self.draft.min_structure)
    }

    fn with_shells(
        &self,
        wireframe: Wireframe3d,
        kinds: Vec<EdgeKinds>,
        confidence: Confidence,
    ) -> Structure {
        let shells = self.shells_of(&self.graph(&wireframe, &covariances(&confidence)));
        Structure {
            inferred: vec![false; wireframe.edges.len()],
            wireframe,
            confidence,
            kinds,
            shells,
        }
    }

    fn graph<'g>(
        &'g self,
        wireframe: &'g Wireframe3d,
        covariances: &'g [Option<Matrix3<f64>>],
    ) -> MeasuredGraph<'g> {
        MeasuredGraph {
            wireframe,
            arcs: &self.arcs,
            splines: &self.draft.splines,
            domes: &self.draft.domes,
            covariances,
        }
    }

    fn shells_of(&self, graph: &MeasuredGraph) -> Vec<Shell> {
        find_shells(graph, &self.views, &self.points)
    }
}

fn covariances(confidence: &Confidence) -> Vec<Option<Matrix3<f64>>> {
    let junctions = confidence.junctions.iter();
    junctions.map(|junction| junction.covariance).collect()
}
