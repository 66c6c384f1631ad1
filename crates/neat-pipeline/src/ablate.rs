//! `neat ablate`: what each part of the method is worth, on one scene.

pub mod variants;

use crate::config::Config;
use crate::distill::{Distilled, distill};
use crate::error::PipelineError;
use crate::event::{Event, OnEvent, Stage};
use crate::field::TrainedField;
use crate::image_io::every_nth_pixel;
use crate::manifest::Status;
use crate::overlay::spread_views;
use crate::overrides::apply_overrides;
use crate::reconstruct::{OpenedRun, RunOptions, open_run, reconstruct};
use crate::render::render_view;
use crate::run_dir::{Existing, RunDir};
use nalgebra::Vector3;
use neat_core::{Scene, Wireframe3d, file};
use neat_eval::image_quality::psnr;
use neat_eval::{GraphScores, NeatAbc, NeatSurface, ScannedSurface};
use neat_field::attraction_region::AttractionRegions;
use neat_wireframe::export::{WireframeDocument, write_json};
use neat_wireframe::metrics::PrecisionRecall;
use serde::Serialize;
use std::fmt::Write;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
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
    /// Distance within which junctions and segments count as found, in the unit of
    /// the user's files.
    pub threshold: f64,
}

/// One row of the table. Scores are `None` where there is no truth for them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The table of the paper, or the group, that the variant belongs to.
    pub table: String,
    /// What is different.
    pub variant: String,
    /// Seconds of training; `None` if the field is that of the unchanged run.
    pub training_seconds: Option<f64>,
    /// Seconds of distillation.
    pub distillation_seconds: f64,
    /// Number of junctions.
    pub junctions: usize,
    /// Number of segments.
    pub segments: usize,
    /// Precision of the junctions.
    pub junction_precision: Option<f64>,
    /// Recall of the junctions.
    pub junction_recall: Option<f64>,
    /// Precision of the segments, by the larger end distance.
    pub segment_precision: Option<f64>,
    /// Recall of the segments.
    pub segment_recall: Option<f64>,
    /// Mean distance of the junctions from the surface, ACC-J.
    pub junction_accuracy: Option<f64>,
    /// Mean distance of the segments from the surface, ACC-L.
    pub segment_accuracy: Option<f64>,
    /// PSNR of rendered views, in decibels.
    pub psnr: Option<f64>,
    /// Share of the pixels outside of all attraction regions, "MR".
    pub mask_ratio: Option<f64>,
}

/// Runs every variant, each in a folder of its own in `options.out`, and returns
/// one row for each, in the order of [`variants`].
///
/// Variants that are finished already are not run again: an ablation that was
/// interrupted continues.
///
/// # Errors
/// If a run fails, see [`reconstruct`].
pub fn ablate(
    options: &RunOptions,
    truth: &Truth,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<Vec<Row>, PipelineError> {
    file::create_dir(&options.out)?;
    let base = run_variant(&variants::BASE, options, cancelled, on_event)?;
    let all = variants(base.config.distill.back_end);
    let mut rows = Vec::with_capacity(all.len());
    for (index, variant) in all.iter().enumerate() {
        on_event(Event::Note(format!(
            "variant {} of {}: {}",
            index + 1,
            all.len(),
            variant.name
        )));
        let trained = match (variant.trains, *variant == variants::BASE) {
            (true, false) => Some(run_variant(variant, options, cancelled, on_event)?),
            _ => None,
        };
        let run = trained.as_ref().unwrap_or(&base);
        let config = changed(&run.config, variant)?;
        let start = Instant::now();
        let distilled = distill(&run.scene, &run.field, &config, &mut |_| ())?;
        let seconds = start.elapsed().as_secs_f64();
        let wireframe = write_wireframe(options, variant, &run.scene, &distilled)?;
        rows.push(row(variant, run, &config, &wireframe, truth, seconds)?);
    }
    Ok(rows)
}

/// The configuration with what the variant changes.
fn changed(config: &Config, variant: &Variant) -> Result<Config, PipelineError> {
    let overrides: Vec<String> = variant.overrides.iter().map(ToString::to_string).collect();
    // They are part of the program, and a test applies them all.
    apply_overrides(config, &overrides).map_err(PipelineError::Override)
}

/// Trains a variant, unless that has been done, and opens its run.
fn run_variant(
    variant: &Variant,
    options: &RunOptions,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<OpenedRun, PipelineError> {
    let out = options.out.join(variant.slug);
    let config = changed(&options.config, variant)?;
    let finished = RunDir::open(&out)
        .and_then(|dir| dir.manifest())
        .is_ok_and(|manifest| manifest.status == Status::Finished && manifest.seed == options.seed);
    if !finished {
        let options = RunOptions {
            out: out.clone(),
            existing: Existing::Overwrite,
            config,
            ..options.clone()
        };
        reconstruct(&options, cancelled, on_event)?;
    }
    open_run(
        &out,
        Some(&options.scene),
        options.backend,
        options.cache.as_ref(),
        Ok,
        &mut |event| {
            // What the scene is like has been told by the run.
            if !matches!(event, Event::Note(_) | Event::Warning(_)) {
                on_event(event);
            }
        },
    )
}

/// Writes the variant's `wireframe.json`; returns the wireframe in the frame of the
/// user's files.
fn write_wireframe(
    options: &RunOptions,
    variant: &Variant,
    scene: &Scene,
    distilled: &Distilled,
) -> Result<Wireframe3d, PipelineError> {
    let original_from_world = &scene.original_from_world;
    let wireframe = (distilled.wireframe).map(|point| original_from_world.apply(point));
    let mut document = WireframeDocument::from(&wireframe);
    let names: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
    (distilled.confidence).fill(&mut document, &names, original_from_world);
    let folder = options.out.join(variant.slug);
    file::create_dir(&folder)?;
    write_json(&folder.join("wireframe.json"), &document)?;
    Ok(wireframe)
}

fn row(
    variant: &Variant,
    run: &OpenedRun,
    config: &Config,
    wireframe: &Wireframe3d,
    truth: &Truth,
    distillation_seconds: f64,
) -> Result<Row, PipelineError> {
    let protocol = NeatAbc {
        thresholds: vec![truth.threshold],
        ..NeatAbc::default()
    };
    let scores = (truth.wireframe.as_ref())
        .map(|truth| protocol.evaluate(wireframe, None, truth))
        .transpose()?;
    let first = |of: fn(&GraphScores) -> &Vec<PrecisionRecall>| {
        let scores = scores.as_ref()?;
        of(&scores.wireframe).first().copied()
    };
    let junctions = first(|graph| &graph.junctions);
    let segments = first(|graph| &graph.segments_max);
    let surface = (truth.surface.as_ref())
        .map(|points| {
            let surface = ScannedSurface {
                points: points.clone(),
                mask: None,
                ground_plane: None,
            };
            NeatSurface::blended_mvs().evaluate(wireframe, &surface)
        })
        .transpose()?;
    Ok(Row {
        table: variant.table.to_owned(),
        variant: variant.name.to_owned(),
        training_seconds: (variant.trains)
            .then(|| run.manifest.seconds.get(&Stage::Train).copied())
            .flatten(),
        distillation_seconds,
        junctions: wireframe.junctions.len(),
        segments: wireframe.edges.len(),
        junction_precision: junctions.map(|scores| scores.precision),
        junction_recall: junctions.map(|scores| scores.recall),
        segment_precision: segments.map(|scores| scores.precision),
        segment_recall: segments.map(|scores| scores.recall),
        junction_accuracy: surface.and_then(|scores| scores.junction_accuracy),
        segment_accuracy: surface.and_then(|scores| scores.segment_accuracy),
        psnr: variant
            .trains
            .then(|| mean_psnr(&run.scene, &run.field))
            .flatten(),
        mask_ratio: (variant.trains)
            .then(|| masked_out(&run.scene, config))
            .flatten(),
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
            psnr(&rendered.color, &every_nth_pixel(&view.image, step), None)
        })
        .collect();
    let values = values.filter(|values| !values.is_empty())?;
    Some(values.iter().sum::<f64>() / values.len() as f64)
}

/// Share of the pixels of all views that no attraction region holds.
fn masked_out(scene: &Scene, config: &Config) -> Option<f64> {
    let data = &config.data;
    let regions =
        AttractionRegions::of_scene(scene, data.min_segment_score, data.attraction_distance);
    let inside: usize = regions.iter().map(AttractionRegions::len).sum();
    let sizes = scene.views.iter().map(|view| view.image.dimensions());
    let pixels: u64 = sizes.map(|(w, h)| u64::from(w) * u64::from(h)).sum();
    (pixels > 0).then(|| 1.0 - inside as f64 / pixels as f64)
}

/// The table for people. Columns that no row has are left out.
pub fn to_markdown(rows: &[Row]) -> String {
    let columns = shown_columns(rows);
    let mut text = String::new();
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    text.push_str(&line(columns.iter().map(|c| c.name.to_owned()).collect()));
    let rule = columns.iter().map(|c| if c.number { "--:" } else { "---" });
    text.push_str(&line(rule.map(str::to_owned).collect()));
    for row in rows {
        let cells = columns.iter().map(|column| (column.cell)(row));
        let cells = cells.map(|cell| cell.unwrap_or_else(|| "-".to_owned()));
        text.push_str(&line(cells.collect()));
    }
    text
}

/// The table for programs: comma-separated, texts in quotes.
pub fn to_csv(rows: &[Row]) -> String {
    let mut text = String::new();
    let names: Vec<&str> = COLUMNS.iter().map(|column| column.name).collect();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}", names.join(","));
    for row in rows {
        let cells: Vec<String> = COLUMNS
            .iter()
            .map(|column| {
                let cell = (column.cell)(row).unwrap_or_default();
                if column.number {
                    cell
                } else {
                    format!("\"{}\"", cell.replace('"', "\"\""))
                }
            })
            .collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

/// A column of the table.
struct Column {
    name: &'static str,
    number: bool,
    cell: fn(&Row) -> Option<String>,
}

const fn number(name: &'static str, cell: fn(&Row) -> Option<String>) -> Column {
    Column {
        name,
        number: true,
        cell,
    }
}

const fn words(name: &'static str, cell: fn(&Row) -> Option<String>) -> Column {
    Column {
        name,
        number: false,
        cell,
    }
}

const COLUMNS: [Column; 14] = [
    words("table", |row| Some(row.table.clone())),
    words("variant", |row| Some(row.variant.clone())),
    number("train s", |row| fixed(row.training_seconds, 1)),
    number("distil s", |row| fixed(Some(row.distillation_seconds), 2)),
    number("junctions", |row| Some(row.junctions.to_string())),
    number("segments", |row| Some(row.segments.to_string())),
    number("J precision", |row| fixed(row.junction_precision, 3)),
    number("J recall", |row| fixed(row.junction_recall, 3)),
    number("S precision", |row| fixed(row.segment_precision, 3)),
    number("S recall", |row| fixed(row.segment_recall, 3)),
    number("ACC-J", |row| fixed(row.junction_accuracy, 5)),
    number("ACC-L", |row| fixed(row.segment_accuracy, 5)),
    number("PSNR dB", |row| fixed(row.psnr, 2)),
    number("mask ratio", |row| fixed(row.mask_ratio, 3)),
];

fn fixed(value: Option<f64>, digits: usize) -> Option<String> {
    value.map(|value| format!("{value:.digits$}"))
}

fn shown_columns(rows: &[Row]) -> Vec<&'static Column> {
    let has_cells = |column: &&Column| rows.iter().any(|row| (column.cell)(row).is_some());
    COLUMNS.iter().filter(has_cells).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            table: "paper, table 2".into(),
            variant: "a \"b\"".into(),
            training_seconds: None,
            distillation_seconds: 0.5,
            junctions: 12,
            segments: 18,
            junction_precision: Some(1.0),
            junction_recall: None,
            segment_precision: None,
            segment_recall: None,
            junction_accuracy: None,
            segment_accuracy: None,
            psnr: None,
            mask_ratio: Some(0.9),
        }
    }

    #[test]
    fn columns_without_numbers_are_left_out_of_the_table_for_people() {
        let text = to_markdown(&[row()]);
        assert_eq!(
            text.lines().next(),
            Some(
                "| table | variant | distil s | junctions | segments | J precision | mask ratio |"
            )
        );
        assert!(
            text.ends_with("| 0.50 | 12 | 18 | 1.000 | 0.900 |\n"),
            "{text}"
        );
    }

    #[test]
    fn the_table_for_programs_has_all_columns_and_quotes_texts() {
        let text = to_csv(&[row()]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0].split(',').count(), COLUMNS.len());
        assert_eq!(
            lines[1],
            "\"paper, table 2\",\"a \"\"b\"\"\",,0.50,12,18,1.000,,,,,,,0.900"
        );
    }
}
