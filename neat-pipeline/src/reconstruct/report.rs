//! `report.html`: the wireframe, its evidence, and how it came about, as a page.

use super::session::Session;
use crate::config::OverlayGround;
use crate::error::PipelineError;
use neat_images::distilled::result_facts;
use neat_report::{Curve, FactGroup, JunctionSnapshot, PhotographConfig, Report};
use neat_train::LOSS_TERMS;
use neat_train::step_log::{JunctionsLine, read_log};
use neat_train::trainer::StepReport;
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::metrics::ImageEvidence;
use std::path::{MAIN_SEPARATOR, PathBuf};

impl Session<'_> {
    /// Writes the page; returns its path.
    pub fn write_report(
        &self,
        document: WireframeDocument,
        agreement: Option<ImageEvidence>,
    ) -> Result<PathBuf, PipelineError> {
        let path = self.dir.report();
        // A page of an earlier result must not stand beside this one.
        self.dir.remove_report()?;
        let config = self.plan.config();
        let min_score = config.data.min_segment_score;
        let photographs = match config.distill.overlay {
            OverlayGround::Photo => PhotographConfig::default(),
            // Photographs that may not be passed on have no place in a page either.
            OverlayGround::Segments => PhotographConfig {
                max_photographs: 0,
                ..PhotographConfig::default()
            },
        };
        let mut report = Report::of_scene(&self.scene, document, min_score, &photographs)?;
        let metrics: Vec<StepReport> = read_log(&self.dir.metrics())?;
        report.curves = curves(&metrics);
        report.junction_evolution = read_log::<JunctionsLine>(&self.dir.junctions())?
            .into_iter()
            .map(|line| JunctionSnapshot {
                step: line.iteration,
                junctions: line.junctions,
            })
            .collect();
        // The configuration was written as TOML when the run began.
        report.configuration = toml::to_string_pretty(config).unwrap_or_default();
        report.facts = self.facts(&report.document, agreement);
        // The page may be passed on: where the scene lies is nobody's business.
        let folder = format!("{}{MAIN_SEPARATOR}", self.manifest.scene.display());
        let warnings = self.manifest.warnings.iter();
        report.warnings = warnings
            .map(|warning| warning.message.replace(&folder, ""))
            .collect();
        report.write(&path)?;
        Ok(path)
    }

    fn facts(
        &self,
        document: &WireframeDocument,
        agreement: Option<ImageEvidence>,
    ) -> Vec<FactGroup> {
        let manifest = &self.manifest;
        let result = result_facts(document, agreement);
        let run = vec![
            ("Scene", self.scene.name.clone()),
            ("Preset", manifest.preset.clone()),
            ("Seed", manifest.seed.to_string()),
            ("Steps", manifest.steps.to_string()),
            ("Backend", manifest.backend.clone()),
            ("Device", manifest.device.clone()),
            ("Threads", manifest.threads.to_string()),
            ("Began", manifest.started.clone()),
            ("neat", manifest.neat.clone()),
        ];
        let seconds = (manifest.seconds.iter())
            .map(|(stage, seconds)| (stage.to_string(), format!("{seconds:.1}")))
            .collect();
        let group = |heading: &str, facts: Vec<(&str, String)>| FactGroup {
            heading: heading.to_owned(),
            facts: (facts.into_iter())
                .map(|(label, value)| (label.to_owned(), value))
                .collect(),
        };
        let decisions = (manifest.decisions.iter())
            .map(|decided| {
                let told = format!("{}, {}", decided.value, decided.reason);
                (decided.setting.clone(), told)
            })
            .collect();
        let named = |heading: &str, facts| FactGroup {
            heading: heading.to_owned(),
            facts,
        };
        let mut groups = vec![
            group("Result", result),
            group("Run", run),
            named("Decided by scene and machine", decisions),
            named("Seconds", seconds),
        ];
        // Earlier versions kept no decisions.
        groups.retain(|group| !group.facts.is_empty());
        groups
    }
}

/// The loss terms and figures that say how the training went; terms that are
/// always 0 are left out.
fn curves(metrics: &[StepReport]) -> Vec<Curve> {
    let curve = |name: &str, figure: &dyn Fn(&StepReport) -> f64| Curve {
        name: name.to_owned(),
        points: (metrics.iter())
            .map(|step| (step.iteration, figure(step)))
            .collect(),
    };
    let terms = LOSS_TERMS.iter().map(|term| {
        curve(&format!("{} loss", term.label), &|step| {
            term.of(&step.losses)
        })
    });
    std::iter::once(curve("Loss", &|step| step.losses.total))
        .chain(terms)
        .chain([
            curve("Segment error in pixels", &|step| {
                step.segment_error_in_pixels
            }),
            curve("Matched junctions", &|step| step.targets as f64),
            curve("Density scale", &|step| step.beta),
        ])
        .filter(|curve| curve.points.iter().any(|(_, value)| *value != 0.0))
        .collect()
}
