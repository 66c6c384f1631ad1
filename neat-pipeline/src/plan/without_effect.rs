//! Settings that a person has changed and that do nothing.

use super::Plan;
use crate::config::{Assembler, Background, Config, Difference, Preset, differences};
use crate::event::{Warning, WarningKind};

/// What a person has changed: in what `asked` differs from the preset nearest to it.
pub(crate) fn changes_of_presets(asked: &Config) -> Vec<Difference> {
    let presets = Preset::ALL.map(|preset| differences(&preset.config(), asked));
    presets.into_iter().min_by_key(Vec::len).unwrap_or_default()
}

/// A warning for every change that does nothing under `plan`; `sparse_points` and
/// `detected` say whether the scene has sparse points, and whether its 2D wireframes
/// were detected.
pub(crate) fn settings_without_effect(
    changes: &[Difference],
    plan: &Plan,
    sparse_points: bool,
    detected: bool,
) -> Vec<Warning> {
    let idle = idle_settings(plan, sparse_points, detected);
    let reason = |key: &str| idle.iter().find(|(idle, _)| key.starts_with(idle));
    changes
        .iter()
        // What a photograph's plan has.
        .filter(|change| (change.key.as_str(), change.now.as_str()) != ("train.loss.mask", "0.0"))
        .filter_map(|change| {
            let (_, reason) = reason(&change.key)?;
            let (key, value) = (&change.key, &change.now);
            let message = format!("{key} = {value} has no effect: {reason}");
            Some(Warning::new(WarningKind::NoEffect, message))
        })
        .collect()
}

/// A warning for every change of a setting that only training looks at, for a run whose
/// field is trained.
pub(crate) fn settings_of_training(changes: &[Difference]) -> Vec<Warning> {
    changes
        .iter()
        .filter(|change| change.key.starts_with("train."))
        // Rays are sampled, and samples left out, in every rendering.
        .filter(|change| !change.key.starts_with("train.sampler."))
        .filter(|change| change.key != "train.min_sample_weight")
        .map(|change| {
            let (key, value) = (&change.key, &change.now);
            let message = format!("{key} = {value} has no effect: the field is trained");
            Warning::new(WarningKind::NoEffect, message)
        })
        .collect()
}

/// How the keys of settings begin that do nothing, and why.
fn idle_settings(
    plan: &Plan,
    sparse_points: bool,
    detected: bool,
) -> Vec<(&'static str, &'static str)> {
    let mut idle = match plan.assembler() {
        Assembler::Paper => vec![
            ("distill.fast.", PAPER_RUNS),
            ("distill.tracks.", PAPER_RUNS),
            ("distill.rays_per_segment", PAPER_RUNS),
        ],
        Assembler::Fast => vec![
            ("distill.paper.", FAST_RUNS),
            ("distill.tracks.", FAST_RUNS),
        ],
        Assembler::Tracks => vec![
            ("distill.paper.", TRACKS_RUN),
            ("distill.fast.", TRACKS_RUN),
        ],
    };
    if plan.background() == Some(Background::Photo) {
        idle.push(("train.loss.mask", "photographs show no silhouettes"));
    }
    if !sparse_points {
        let reason = "the scene has no sparse points";
        idle.extend([
            ("train.loss.points", reason),
            ("train.surface_points", reason),
        ]);
    }
    if !detected {
        idle.push(("detect.", "the scene has 2D wireframes"));
    }
    idle
}

const PAPER_RUNS: &str = "the wireframe is assembled by the paper's back end";
const FAST_RUNS: &str = "the wireframe is assembled by the fast back end";
const TRACKS_RUN: &str = "the wireframe is assembled by line tracks";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Choice, apply_overrides};

    #[test]
    fn values_are_never_dropped_without_a_word() {
        let told = |background: Background, sets: &[&str]| -> Vec<String> {
            let mut config = Preset::Fast.config();
            config.data.background = Some(Choice::Given(background));
            let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
            let asked = apply_overrides(&config, &sets).unwrap();
            let plan = Plan::new(asked.clone()).unwrap();
            let changes = changes_of_presets(&asked);
            let warnings = settings_without_effect(&changes, &plan, false, false);
            warnings
                .into_iter()
                .map(|warning| warning.message)
                .collect()
        };
        let (black, photo) = (Background::Black, Background::Photo);
        // What the preset itself says needs no word.
        assert!(told(black, &[]).is_empty());
        assert!(told(photo, &[]).is_empty());
        let sets = ["train.loss.mask=0.7", "distill.fast.cleanup=false"];
        assert!(told(black, &sets).is_empty());
        assert_eq!(
            told(photo, &sets),
            [
                format!("distill.fast.cleanup = false has no effect: {TRACKS_RUN}"),
                "train.loss.mask = 0.7 has no effect: photographs show no silhouettes".to_owned(),
            ]
        );
        let sets = [
            "train.steps=5".to_owned(),
            "train.sampler.lookups=32".to_owned(),
        ];
        let fast = Preset::Fast.config();
        let changes = differences(&fast, &apply_overrides(&fast, &sets).unwrap());
        let told_of_run = settings_of_training(&changes);
        assert_eq!(told_of_run.len(), 1);
        assert!(told_of_run[0].message.contains("train.steps = 5"));
        let points = told(black, &["train.surface_points=8"]);
        assert!(points[0].contains("no sparse points"), "{points:?}");
    }
}
