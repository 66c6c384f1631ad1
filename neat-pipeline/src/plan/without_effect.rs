//! Settings that a person has changed and that do nothing.

use super::Plan;
use crate::config::{BackEnd, Background, Config, Difference, Partners, Preset, differences};
use crate::event::{Warning, WarningKind};

/// What a person has changed: in what `asked` differs from the preset nearest to it.
pub(crate) fn changes_of_presets(asked: &Config) -> Vec<Difference> {
    let presets = Preset::ALL.map(|preset| differences(&preset.config(), asked));
    presets.into_iter().min_by_key(Vec::len).unwrap_or_default()
}

/// What decides beside the plan whether a setting does anything.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Given {
    /// The scene has sparse points.
    pub sparse_points: bool,
    /// Its 2D wireframes were detected.
    pub detected: bool,
    /// The field is trained already.
    pub trained: bool,
}

/// A warning for every change that does nothing under `plan`.
pub(crate) fn settings_without_effect(
    changes: &[Difference],
    plan: &Plan,
    given: Given,
) -> Vec<Warning> {
    let idle = idle_settings(plan, given);
    let reason = |key: &str| {
        if given.trained && only_trains(key) {
            return Some("the field is trained");
        }
        let (_, reason) = idle.iter().find(|(idle, _)| key.starts_with(idle))?;
        Some(*reason)
    };
    changes
        .iter()
        // What a photograph's plan has.
        .filter(|change| (change.key.as_str(), change.now.as_str()) != ("train.loss.mask", "0.0"))
        .filter_map(|change| {
            let reason = reason(&change.key)?;
            let (key, value) = (&change.key, &change.now);
            let message = format!("{key} = {value} has no effect: {reason}");
            Some(Warning::new(WarningKind::NoEffect, message))
        })
        .collect()
}

/// Whether nothing but training looks at a setting: rays are sampled, and samples left
/// out, in every rendering.
fn only_trains(key: &str) -> bool {
    key.starts_with("train.")
        && !key.starts_with("train.sampler.")
        && key != "train.min_sample_weight"
}

/// How the keys of settings begin that do nothing, and why.
fn idle_settings(plan: &Plan, given: Given) -> Vec<(&'static str, &'static str)> {
    let mut idle = match plan.back_end() {
        BackEnd::Paper => {
            let mut idle = vec![
                ("distill.assembler.", PAPER_RUNS),
                ("distill.partners", PAPER_RUNS),
            ];
            match plan.config().distill.paper.image_refinement.enabled {
                true => idle.extend([
                    ("distill.paper.junction_voting.", IMAGES_ASKED),
                    ("distill.paper.attraction.", IMAGES_ASKED),
                    (
                        "distill.paper.neat_lines.max_support_distance",
                        IMAGES_ASKED,
                    ),
                ]),
                false => idle.push((
                    "distill.paper.image_refinement.max_end_distance",
                    "distill.paper.image_refinement.enabled is off",
                )),
            }
            idle
        }
        BackEnd::Assembler if plan.config().distill.partners == Partners::Field => {
            let keys = [
                "distill.paper.junction",
                "distill.paper.image_refinement.",
                "distill.paper.attraction.",
                "distill.paper.visibility.",
                "distill.paper.keep_isolated_junctions",
            ];
            keys.map(|key| (key, ASSEMBLER_RUNS)).to_vec()
        }
        BackEnd::Assembler => vec![("distill.paper.", ASSEMBLER_RUNS)],
    };
    if !plan.trains() && !given.trained {
        let keys = [
            "train.",
            "model.",
            "data.attraction_distance",
            "data.background",
        ];
        idle.extend(keys.map(|key| (key, NO_FIELD)));
    }
    if plan.background() == Some(Background::Photo) {
        idle.push(("train.loss.mask", "photographs show no silhouettes"));
    }
    let dense_points = plan.config().train.dense_points;
    if !given.sparse_points && !dense_points {
        let reason = "the scene has no sparse points";
        idle.extend([
            ("train.loss.points", reason),
            ("train.surface_points", reason),
        ]);
    }
    if !dense_points {
        idle.push(("train.surface_point_reach", "sparse points have no normals"));
    }
    if plan.background() == Some(Background::Black) {
        idle.push(("train.dense_points", "the background is black"));
    }
    if !given.detected {
        let reason = "the scene has 2D wireframes";
        if plan.back_end() == BackEnd::Assembler {
            // The others say what an edgel is.
            let of_segments = [
                "detect.min_length",
                "detect.min_score",
                "detect.max_search_side",
                "detect.detector",
            ];
            idle.extend(of_segments.map(|key| (key, reason)));
        } else {
            idle.push(("detect.", reason));
        }
    }
    idle
}

pub(crate) const NO_FIELD: &str = "no field is trained: --train trains one";
const PAPER_RUNS: &str = "the wireframe is assembled by the paper's back end";
const IMAGES_ASKED: &str =
    "distill.paper.image_refinement asks the images what junctions and edges are";
const ASSEMBLER_RUNS: &str = "the wireframe is made by the assembler";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::apply_overrides;

    #[test]
    fn values_are_never_dropped_without_a_word() {
        let told = |sets: &[&str]| -> Vec<String> {
            let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
            let asked = apply_overrides(&Preset::Fast.config(), &sets).unwrap();
            let plan = Plan::new(asked.clone()).unwrap();
            let changes = changes_of_presets(&asked);
            let warnings = settings_without_effect(&changes, &plan, Given::default());
            (warnings.into_iter())
                .map(|warning| warning.message)
                .collect()
        };
        // What the preset itself says needs no word.
        assert!(told(&[]).is_empty());
        let sets = [
            "train.loss.mask=0.7",
            "distill.paper.visibility.min_views=3",
        ];
        let no_paper =
            format!("distill.paper.visibility.min_views = 3 has no effect: {ASSEMBLER_RUNS}");
        let no_mask = format!("train.loss.mask = 0.7 has no effect: {NO_FIELD}");
        assert_eq!(told(&sets), [no_paper, no_mask]);
        let by_images = told(&[
            "distill.back_end=paper",
            "data.background=black",
            "distill.paper.image_refinement.enabled=true",
            "distill.paper.junction_voting.min_votes=3",
        ]);
        let no_votes =
            format!("distill.paper.junction_voting.min_votes = 3 has no effect: {IMAGES_ASKED}");
        assert_eq!(by_images, [no_votes]);
        let with = |background: &'static str, set: &'static str| {
            told(&["distill.field=trained", background, set])
        };
        let (black, photo) = ("data.background=black", "data.background=photo");
        assert!(with(black, "train.loss.mask=0.7").is_empty());
        let no_mask = "train.loss.mask = 0.7 has no effect: photographs show no silhouettes";
        assert_eq!(with(photo, "train.loss.mask=0.7"), [no_mask]);
        let no_background = format!("data.background = \"photo\" has no effect: {NO_FIELD}");
        assert_eq!(told(&[photo]), [no_background]);
        // With 2D wireframes, what an edgel is matters to the assembler only.
        let sets = ["detect.min_gradient=2.0", "detect.min_score=0.2"];
        let without_effect = told(&sets);
        assert_eq!(without_effect.len(), 1, "{without_effect:?}");
        assert!(without_effect[0].starts_with("detect.min_score"));
        let paper = [&sets[..], &["distill.back_end=paper", black]].concat();
        assert_eq!(told(&paper).len(), 2);
        // A field that seeks partners is asked for its NEAT lines, and for nothing else.
        let partners = [
            "distill.partners=field",
            black,
            "model.perceiver.junctions=64",
            "distill.paper.neat_lines.max_squared_reprojection=50.0",
        ];
        assert!(told(&partners).is_empty());
        let votes = [&partners[..], &["distill.paper.visibility.min_views=3"]].concat();
        assert!(told(&votes)[0].ends_with(ASSEMBLER_RUNS));
        let paper = ["distill.back_end=paper", black, "distill.partners=field"];
        assert!(told(&paper)[0].ends_with(PAPER_RUNS));
        let sets = [
            "train.steps=5".to_owned(),
            "train.sampler.lookups=32".to_owned(),
        ];
        let fast = Preset::Fast.config();
        let changes = differences(&fast, &apply_overrides(&fast, &sets).unwrap());
        let trained = Given {
            trained: true,
            ..Given::default()
        };
        let told_of_run = settings_without_effect(&changes, &Plan::new(fast).unwrap(), trained);
        assert_eq!(told_of_run.len(), 1);
        assert!(told_of_run[0].message.contains("train.steps = 5"));
        let points = with(black, "train.surface_points=8");
        assert!(points[0].contains("no sparse points"), "{points:?}");
        let reach = with(photo, "train.surface_point_reach=0.1");
        assert!(reach[0].contains("no normals"), "{reach:?}");
        let dense = [
            "distill.field=trained",
            photo,
            "train.dense_points=true",
            "train.surface_points=8",
            "train.surface_point_reach=0.1",
        ];
        assert!(told(&dense).is_empty());
    }
}
