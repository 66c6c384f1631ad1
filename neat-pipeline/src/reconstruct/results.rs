//! Distillation, and everything that a person gets to see of it.

use super::Reconstruction;
use super::session::Session;
use crate::config::{OverlayGround, Partners};
use crate::distill::{Cancelled, Distilled, agreement, distill};
use crate::error::PipelineError;
use crate::event::{Event, Stage, WarningKind};
use crate::manifest::Manifest;
use crate::scene::spread_views;
use neat_core::file::write_png;
use neat_core::{View, Wireframe3d, file};
use neat_images::distilled::{AGREEMENT_KEY, REPORT_KEY};
use neat_images::event::POSES;
use neat_images::overlay::{draw_overlay, draw_sketch, draw_wireframe};
use neat_report::ReportError;
use neat_train::TrainedField;
use neat_wireframe::export::{WireframeDocument, read_json, write_json, write_obj, write_ply};
use neat_wireframe::metrics::ImageEvidence;
use rayon::prelude::*;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// The wireframe is drawn on so many photographs.
const OVERLAYS: usize = 6;
/// Photographs that are in memory for that at once.
const OVERLAYS_AT_ONCE: usize = 2;

impl Session<'_> {
    /// Warnings and decisions about an earlier result, which a new one replaces.
    pub fn forget_distillation_warnings(&mut self) {
        let gone = [WarningKind::NoEdges, WarningKind::NoReport];
        let Manifest {
            warnings,
            decisions,
            ..
        } = &mut self.manifest;
        warnings.retain(|warning| !gone.contains(&warning.kind));
        decisions.retain(|decision| decision.setting != POSES);
    }

    /// The result that is on disk, where there is one that can be read.
    pub fn earlier_result(&self) -> Option<Reconstruction> {
        let document = read_json(&self.dir.wireframe("json")).ok()?;
        let of = |key: &str| document.metadata.get(key).cloned().unwrap_or_default();
        Some(Reconstruction {
            run: self.dir.clone(),
            wireframe: document.wireframe(),
            agreement: serde_json::from_value(of(AGREEMENT_KEY)).ok()?,
            report: serde_json::from_value(of(REPORT_KEY)).ok(),
        })
    }

    /// Takes the wireframe out of the field, or the images, and writes it, unless `cancelled` is set
    /// before.
    pub fn distill(
        &mut self,
        field: Option<&TrainedField>,
        cancelled: &AtomicBool,
    ) -> Result<Reconstruction, PipelineError> {
        let distilled = self.stage(Stage::Distill, |session| {
            let on_event = &mut *session.on_event;
            let mut progress = |fraction| {
                on_event(Event::StageProgress {
                    stage: Stage::Distill,
                    fraction,
                });
                if cancelled.load(Ordering::Relaxed) {
                    return Err(Cancelled);
                }
                Ok(())
            };
            let (scene, plan) = (&session.scene, &session.plan);
            Ok(distill(scene, field, plan, &mut progress)?)
        })?;
        if let Some(moved) = distilled.report.moved_poses() {
            self.tell(Event::Decided(moved));
        }
        if distilled.wireframe.edges.is_empty() {
            let asked_field = self.plan.config().distill.partners == Partners::Field;
            let why = distilled.report.why_empty(asked_field);
            self.warn(
                WarningKind::NoEdges,
                format!("the wireframe has no edges: {why}"),
            );
        }
        let scene = distilled.refined_scene.as_ref().unwrap_or(&self.scene);
        let min_score = self.plan.config().data.min_segment_score;
        let agreement = agreement(scene, min_score, &distilled.wireframe);
        let (wireframe, document) = self.stage(Stage::Export, |session| {
            session.export(&distilled, agreement)
        })?;
        // Last, so that it knows the times and warnings of all stages. Results
        // without a page are results nevertheless.
        match self.write_report(document, agreement) {
            Ok(report) => self.written(report),
            // Of a full disk, a later session can write it.
            Err(PipelineError::Report(ReportError::File(error))) => return Err(error.into()),
            Err(error) => {
                let text = format!("there is no report.html: {error}");
                self.warn(WarningKind::NoReport, text);
            }
        }
        Ok(Reconstruction {
            run: self.dir.clone(),
            wireframe,
            agreement,
            report: Some(distilled.report),
        })
    }

    /// Writes files and pictures; returns the wireframe in the frame of the
    /// user's files, bare and as it is written.
    fn export(
        &mut self,
        distilled: &Distilled,
        agreement: Option<ImageEvidence>,
    ) -> Result<(Wireframe3d, WireframeDocument), PipelineError> {
        let in_world = &distilled.wireframe;
        let curves = &distilled.drawn_curves()[..];
        let document = WireframeDocument {
            metadata: self.metadata(distilled, agreement),
            ..distilled.document(&self.scene)
        };
        let [json, obj, ply, png] =
            ["json", "obj", "ply", "png"].map(|extension| self.dir.wireframe(extension));
        write_json(&json, &document)?;
        let (drawn, triangles) = (document.drawn(), document.drawn_triangles());
        write_obj(&obj, &drawn, &triangles)?;
        write_ply(&ply, &drawn, &triangles)?;
        write_png(&png, &draw_wireframe(in_world, curves, &self.scene))?;
        let mut written = vec![json, obj, ply, png];

        let scene = distilled.refined_scene.as_ref().unwrap_or(&self.scene);
        let views = &scene.views;
        let overlays: Vec<_> = spread_views(views, OVERLAYS)
            .into_iter()
            .map(|index| (&views[index], self.dir.overlay(&views[index].name)))
            .collect();
        if let Some(folder) = overlays.first().and_then(|(_, path)| path.parent()) {
            file::create_dir(folder)?;
        }
        let draw = |(view, path): &(&View, PathBuf)| {
            let pixel_center = self.scene.pixel_center;
            let picture = match self.plan.config().distill.overlay {
                OverlayGround::Photo => draw_overlay(view, pixel_center, (in_world, curves))?,
                OverlayGround::Segments => {
                    let min_score = self.plan.config().data.min_segment_score;
                    draw_sketch(view, pixel_center, min_score, (in_world, curves))
                }
            };
            write_png(path, &picture)
        };
        for some in overlays.chunks(OVERLAYS_AT_ONCE) {
            some.par_iter().try_for_each(draw)?;
        }
        written.extend(overlays.into_iter().map(|(_, path)| path));

        for path in written {
            self.written(path);
        }
        Ok((document.wireframe(), document))
    }

    fn metadata(
        &self,
        distilled: &Distilled,
        agreement: Option<ImageEvidence>,
    ) -> BTreeMap<String, serde_json::Value> {
        let facts = [
            ("neat", json!(self.manifest.neat)),
            ("scene", json!(self.scene.name)),
            ("preset", json!(self.manifest.preset)),
            ("backend", json!(self.manifest.backend)),
            ("seed", json!(self.manifest.seed)),
            ("steps", json!(self.manifest.steps)),
            // `neat distill` may have chosen others than those of config.toml.
            ("distill", json!(self.plan.config().distill)),
        ];
        let mut metadata = distilled.metadata(agreement);
        metadata.extend(facts.map(|(key, value)| (key.to_owned(), value)));
        metadata
    }
}
