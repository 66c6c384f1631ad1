//! `neat ablate`: what each part of the method is worth, on one scene.

mod folder;
pub mod table;
pub mod variants;

use crate::error::LabError;
use nalgebra::Vector3;
use neat_core::{Scene, Wireframe3d, file, with_causes};
use neat_eval::image_quality::psnr;
use neat_eval::{NeatAbc, NeatSurface, ScannedSurface, SceneTruth, SurfaceAndCreases};
use neat_field::region_pixels::RegionPixels;
use neat_pipeline::config::{Choice, Config, FieldUse, apply_overrides};
use neat_pipeline::distill::distill;
use neat_pipeline::error::PipelineError;
use neat_pipeline::event::{Event, OnEvent, Stage, Warning, WarningKind};
use neat_pipeline::reconstruct::{OpenedRun, RunOptions, backend_for, open_run, reconstruct};
use neat_pipeline::render::{every_nth_pixel, render_view};
use neat_pipeline::resources::Resources;
use neat_pipeline::run_dir::Existing;
use neat_pipeline::scene::spread_views;
use neat_train::TrainedField;
use neat_wireframe::export::write_json;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use table::{Note, Row};
use variants::{Variant, variants};

/// PSNR is the mean over so many views, at most …
const RENDERED_VIEWS: usize = 3;
/// … at about so many pixels along the longer side.
const RENDERED_SIZE: u32 = 160;

/// What the results are held against.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    /// The true wireframe, in the frame of the user's files.
    pub wireframe: Option<Wireframe3d>,
    /// Points of the true surface, in the same frame.
    pub surface: Option<Vec<Vector3<f64>>>,
    /// Exact surface and creases of a rendered scene, in the same frame.
    pub rendered: Option<SceneTruth>,
    /// Distance within which junctions and segments count as found, in the unit of
    /// the user's files; for a rendered scene in metres times its scale.
    pub threshold: f64,
}

impl Truth {
    /// A row with the scores of `wireframe`, and nothing else.
    fn scores(&self, wireframe: &Wireframe3d) -> Result<Row, LabError> {
        let mut row = Row::default();
        if let Some(rendered) = &self.rendered {
            let protocol = SurfaceAndCreases {
                thresholds: vec![self.threshold],
                ..SurfaceAndCreases::default()
            };
            let scores = protocol.evaluate(wireframe, rendered)?;
            let shares = scores.thresholds.first();
            row.junction_precision = shares.and_then(|shares| shares.junction_precision);
            row.junction_recall = shares.and_then(|shares| shares.junction_recall);
            row.segment_precision = shares.and_then(|shares| shares.length_on_crease);
            row.segment_recall = shares.and_then(|shares| shares.completeness);
            row.junction_accuracy = scores.junction_accuracy.map(|distance| distance.mean);
            row.segment_accuracy = scores.segment_accuracy.map(|distance| distance.mean);
        }
        if let Some(truth) = &self.wireframe {
            let protocol = NeatAbc {
                thresholds: vec![self.threshold],
                ..NeatAbc::default()
            };
            let scores = protocol.evaluate(wireframe, None, truth)?.wireframe;
            let junctions = scores.junctions.first();
            let segments = scores.segments_max.first();
            row.junction_precision = junctions.map(|scores| scores.precision);
            row.junction_recall = junctions.map(|scores| scores.recall);
            row.segment_precision = segments.map(|scores| scores.precision);
            row.segment_recall = segments.map(|scores| scores.recall);
        }
        if let Some(points) = &self.surface {
            let surface = ScannedSurface {
                points: points.clone(),
                mask: None,
                ground_plane: None,
            };
            let scores = NeatSurface::blended_mvs().evaluate(wireframe, &surface)?;
            row.junction_accuracy = scores.junction_accuracy;
            row.segment_accuracy = scores.segment_accuracy;
        }
        Ok(row)
    }
}

/// Runs every variant, each in a folder of its own in `options.out`, and returns
/// one row for each, in the order of [`variants()`].
///
/// The folder must be new or empty, or hold what this ablation has left before,
/// which then continues: finished variants are not trained again;
/// `options.existing` is not looked at. A variant that changes nothing in the
/// configuration takes over the numbers of the unchanged run, and one that fails
/// becomes a row with its reason. `ablation.md` and `ablation.csv` are written after
/// every row.
///
/// # Errors
/// If the folder holds something else, the unchanged run fails, see [`reconstruct`],
/// or a table cannot be written; [`LabError::AblationInterrupted`] once
/// `cancelled` is set.
pub fn ablate(
    options: &RunOptions,
    truth: &Truth,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<Vec<Row>, LabError> {
    let mut options = options.clone();
    // Once: looking for GPUs takes a while.
    options.backend = backend_for(options.backend, &options.config);
    // What training brings is asked too.
    if options.config.distill.field == Choice::Auto {
        options.config.distill.field = Choice::Given(FieldUse::Trained);
    }
    let options = &options;
    folder::claim(options)?;
    let all = variants(options.config.distill.back_end);
    let base = run_variant(&variants::BASE, options, cancelled, on_event)
        .map_err(|error| interrupted(error, 0, all.len()))?;
    let mut rows: Vec<Row> = Vec::with_capacity(all.len());
    for (index, variant) in all.iter().enumerate() {
        if cancelled.load(Ordering::Relaxed) {
            return Err(LabError::AblationInterrupted {
                done: index,
                all: all.len(),
            });
        }
        on_event(Event::Note(format!(
            "variant {} of {}: {}",
            index + 1,
            all.len(),
            variant.name
        )));
        let measured = match rows.first() {
            None => measure(variant, &base, options, truth),
            Some(row) if variant.is_base(&options.config)? => Ok(Row {
                note: row.note.clone().or(Some(Note::SameAsBase)),
                ..row.clone()
            }),
            Some(_) if variant.trains => run_variant(variant, options, cancelled, on_event)
                .and_then(|run| measure(variant, &run, options, truth)),
            Some(_) => measure(variant, &base, options, truth),
        };
        let row = match measured {
            Err(error @ LabError::Pipeline(PipelineError::Interrupted { .. })) => {
                return Err(interrupted(error, index, all.len()));
            }
            Err(error) => {
                let reason = with_causes(&error);
                let text = format!("{}: {reason}", variant.name);
                on_event(Event::Warning(Warning::new(WarningKind::Part, text)));
                Row {
                    note: Some(Note::Failed(reason)),
                    ..Row::default()
                }
            }
            Ok(row) => row,
        };
        rows.push(Row {
            table: variant.table.to_owned(),
            variant: variant.name.to_owned(),
            ..row
        });
        folder::write_tables(&options.out, &rows)?;
    }
    Ok(rows)
}

/// What an interrupted training means for the ablation that it is part of.
fn interrupted(error: LabError, done: usize, all: usize) -> LabError {
    match error {
        LabError::Pipeline(PipelineError::Interrupted { .. }) => {
            LabError::AblationInterrupted { done, all }
        }
        error => error,
    }
}

impl Variant {
    /// `config` with what the variant changes.
    fn apply(&self, config: &Config) -> Result<Config, LabError> {
        let overrides: Vec<String> = self.overrides.iter().map(ToString::to_string).collect();
        // They are part of the program, and a test applies them all.
        Ok(apply_overrides(config, &overrides)?)
    }

    /// Whether the variant leaves `config` as it is.
    fn is_base(&self, config: &Config) -> Result<bool, LabError> {
        Ok(self.apply(config)? == *config)
    }
}

/// Trains a variant, unless that has been done, and opens its run.
fn run_variant(
    variant: &Variant,
    options: &RunOptions,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<OpenedRun, LabError> {
    let out = options.out.join(variant.slug);
    if !folder::is_finished(&out) {
        let options = RunOptions {
            out: out.clone(),
            // The folder is a part of this ablation.
            existing: Existing::Overwrite,
            config: variant.apply(&options.config)?,
            ..options.clone()
        };
        reconstruct(&options, cancelled, on_event)?;
    }
    Ok(open_run(
        &out,
        Some(&options.scene),
        options.backend,
        Resources {
            cache: options.cache.as_ref(),
            memory_limit: options.memory_limit,
            cancelled: None,
        },
        Ok::<_, PipelineError>,
        &mut |event| {
            // What the scene is like has been told by the run.
            let told = matches!(
                event,
                Event::Note(_) | Event::Decided(_) | Event::Warning(_)
            );
            if !told {
                on_event(event);
            }
        },
    )?)
}

/// Distils a variant from the field of `run` and measures the result. If it has no
/// run of its own, its wireframe is written.
fn measure(
    variant: &Variant,
    run: &OpenedRun,
    options: &RunOptions,
    truth: &Truth,
) -> Result<Row, LabError> {
    let plan = run.replan(&variant.apply(&run.asked)?)?;
    let start = Instant::now();
    let distilled = distill(&run.scene, run.field.as_ref(), &plan, &mut |_| Ok(()));
    let distilled = distilled.map_err(PipelineError::from)?;
    let seconds = start.elapsed().as_secs_f64();
    let document = distilled.document(&run.scene);
    if !variant.trains {
        let folder = options.out.join(variant.slug);
        file::create_dir(&folder)?;
        write_json(&folder.join("wireframe.json"), &document)?;
    }
    row(
        variant,
        run,
        plan.config(),
        &document.wireframe(),
        truth,
        seconds,
    )
}

/// Everything but the names of the variant.
fn row(
    variant: &Variant,
    run: &OpenedRun,
    config: &Config,
    wireframe: &Wireframe3d,
    truth: &Truth,
    distillation_seconds: f64,
) -> Result<Row, LabError> {
    Ok(Row {
        training_seconds: (variant.trains)
            .then(|| run.manifest.seconds.get(&Stage::Train).copied())
            .flatten(),
        distillation_seconds: Some(distillation_seconds),
        junctions: Some(wireframe.junctions.len()),
        segments: Some(wireframe.edges.len()),
        psnr: (run.field.as_ref())
            .filter(|_| variant.trains)
            .and_then(|field| mean_psnr(&run.scene, field)),
        mask_ratio: (variant.trains)
            .then(|| masked_out(&run.scene, config))
            .flatten(),
        ..truth.scores(wireframe)?
    })
}

/// Mean PSNR of a few views that are spread over the scene.
fn mean_psnr(scene: &Scene, field: &TrainedField) -> Option<f64> {
    let views = spread_views(&scene.views, RENDERED_VIEWS);
    let values: Option<Vec<f64>> = views
        .into_iter()
        .map(|index| {
            let view = &scene.views[index];
            let longer = view.camera.width.max(view.camera.height);
            let step = (longer / RENDERED_SIZE).max(1);
            let rendered = render_view(field, &view.camera, scene.pixel_center, step, &mut |_| ());
            let photograph = view.image.read().ok()?;
            psnr(&rendered.color, &every_nth_pixel(&photograph, step), None)
        })
        .collect();
    let values = values.filter(|values| !values.is_empty())?;
    Some(values.iter().sum::<f64>() / values.len() as f64)
}

/// Share of the pixels of all views that no attraction region holds.
fn masked_out(scene: &Scene, config: &Config) -> Option<f64> {
    let data = &config.data;
    let regions = RegionPixels::of_scene(scene, data.min_segment_score, data.attraction_distance);
    let inside: usize = regions.iter().map(RegionPixels::len).sum();
    let sizes = scene.views.iter().map(|view| view.image.dimensions());
    let pixels: u64 = sizes.map(|(w, h)| u64::from(w) * u64::from(h)).sum();
    (pixels > 0).then(|| 1.0 - inside as f64 / pixels as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_eval::TriangleMesh;
    use neat_pipeline::config::{BackEnd, Preset};

    /// Of a square, one side, and one that hovers 0.3 above another.
    #[test]
    fn a_rendered_scene_is_scored_by_the_length_of_its_creases() {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let corners = corners.map(|[x, y]| Vector3::new(x, y, 0.0)).to_vec();
        let truth = Truth {
            rendered: Some(SceneTruth {
                wireframe: Wireframe3d {
                    junctions: corners.clone(),
                    edges: vec![[0, 1], [1, 2], [2, 3], [3, 0]],
                },
                surface: TriangleMesh {
                    vertices: corners.clone(),
                    triangles: vec![[0, 1, 2], [0, 2, 3]],
                },
                ..SceneTruth::default()
            }),
            threshold: 0.05,
            ..Truth::default()
        };
        let lifted = |corner: usize| corners[corner] + Vector3::new(0.0, 0.0, 0.3);
        let found = Wireframe3d {
            junctions: vec![corners[0], corners[1], lifted(2), lifted(3)],
            edges: vec![[0, 1], [2, 3]],
        };
        let row = truth.scores(&found).unwrap();
        let shares = [
            (row.junction_precision, 0.5),
            (row.junction_recall, 0.5),
            (row.segment_precision, 0.5),
            (row.segment_recall, 0.25),
            (row.junction_accuracy, 0.15),
            (row.segment_accuracy, 0.15),
        ];
        for (found, expected) in shares {
            // Lengths are sampled: a corner belongs to the sides on both its sides.
            assert!((found.unwrap() - expected).abs() < 0.02, "{row:?}");
        }
    }

    #[test]
    fn variants_that_change_nothing_are_known() {
        let same = |preset: Preset, back_end| {
            let mut config = preset.config();
            config.distill.back_end = back_end;
            let all = variants(back_end).into_iter();
            all.filter(|variant| variant.is_base(&config).unwrap())
                .map(|variant| variant.slug)
                .collect::<Vec<_>>()
        };
        assert_eq!(same(Preset::Fast, BackEnd::Assembler), ["base"]);
        assert_eq!(
            same(Preset::Fast, BackEnd::Paper),
            ["base", "direction-no-clustering", "attraction-10", "paper"]
        );
        assert_eq!(
            same(Preset::PaperAbc, BackEnd::Paper),
            ["base", "direction-clustering", "attraction-10", "paper"]
        );
        for preset in [Preset::PaperDtu, Preset::PaperBlendedmvs] {
            assert_eq!(
                same(preset, BackEnd::Paper),
                ["base", "direction-clustering", "attraction-5", "paper"]
            );
        }
    }

    #[test]
    fn an_interrupted_training_interrupts_the_ablation() {
        let training = PipelineError::Interrupted {
            step: 1,
            checkpoint: "base/checkpoints".into(),
        };
        let error = interrupted(training.into(), 2, 20);
        assert_eq!(error.to_string(), "interrupted: 2 of 20 variants are done");
    }
}
