//! What an ablation leaves out or changes, one thing at a time.

use neat_pipeline::config::BackEnd;

/// One row of an ablation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// The table that it belongs to.
    pub table: &'static str,
    /// What is different, in words.
    pub name: &'static str,
    /// Folder name.
    pub slug: &'static str,
    /// Changes to the configuration, as `--set` takes them.
    pub overrides: &'static [&'static str],
    /// Whether the field must be trained anew; otherwise it is distilled from the
    /// field of the unchanged run.
    pub trains: bool,
}

/// The unchanged run, which the others are held against.
pub const BASE: Variant = Variant {
    table: "",
    name: "as configured",
    slug: "base",
    overrides: &[],
    trains: true,
};

const fn training(
    table: &'static str,
    name: &'static str,
    slug: &'static str,
    overrides: &'static [&'static str],
) -> Variant {
    Variant {
        table,
        name,
        slug,
        overrides,
        trains: true,
    }
}

const fn step_off(
    name: &'static str,
    slug: &'static str,
    overrides: &'static [&'static str],
) -> Variant {
    Variant {
        table: "back end",
        name,
        slug,
        overrides,
        trains: false,
    }
}

const TABLE_2: &str = "paper, table 2";
const TABLE_3: &str = "paper, table 3";
const TABLE_4: &str = "paper, table 4";
const SUPERVISION: &str = "supervision";

/// The published clustering, as a value of `train.candidates.clustering`.
const DBSCAN: &str = "train.candidates.clustering={ dbscan = { eps = 0.01, min_samples = 2 } }";

/// Changes that need a training of their own.
const TRAINING: [Variant; 9] = [
    training(
        TABLE_2,
        "no viewing direction, no clustering",
        "no-direction-no-clustering",
        &[
            "model.attraction.view_direction=false",
            "train.candidates.clustering=none",
        ],
    ),
    training(
        TABLE_2,
        "viewing direction, no clustering",
        "direction-no-clustering",
        &[
            "model.attraction.view_direction=true",
            "train.candidates.clustering=none",
        ],
    ),
    training(
        TABLE_2,
        "viewing direction and clustering",
        "direction-clustering",
        &["model.attraction.view_direction=true", DBSCAN],
    ),
    training(
        TABLE_3,
        "attraction distance 1",
        "attraction-1",
        &["data.attraction_distance=1.0"],
    ),
    training(
        TABLE_3,
        "attraction distance 5",
        "attraction-5",
        &["data.attraction_distance=5.0"],
    ),
    training(
        TABLE_3,
        "attraction distance 10",
        "attraction-10",
        &["data.attraction_distance=10.0"],
    ),
    training(
        TABLE_3,
        "attraction distance 20",
        "attraction-20",
        &["data.attraction_distance=20.0"],
    ),
    training(
        SUPERVISION,
        "no segment loss",
        "no-segment-loss",
        &["train.loss.segment=0.0"],
    ),
    training(
        SUPERVISION,
        "no junction loss",
        "no-junction-loss",
        &["train.loss.junction_3d=0.0", "train.loss.junction_2d=0.0"],
    ),
];

/// Table 4 of the paper, and its visibility check.
const PAPER_STEPS: [Variant; 3] = [
    Variant {
        table: TABLE_4,
        name: "paper's back end",
        slug: "paper",
        overrides: &["distill.back_end=paper"],
        trains: false,
    },
    Variant {
        table: TABLE_4,
        name: "paper's back end, junctions not refined by the surface",
        slug: "paper-no-refinement",
        overrides: &[
            "distill.back_end=paper",
            "distill.paper.junction_refinement.enabled=false",
        ],
        trains: false,
    },
    Variant {
        table: TABLE_4,
        name: "paper's back end, without visibility check",
        slug: "paper-no-visibility",
        overrides: &[
            "distill.back_end=paper",
            "distill.paper.visibility.min_views=0",
        ],
        trains: false,
    },
];

/// The assembler with more and less of what a line needs.
const ASSEMBLER_STEPS: [Variant; 5] = [
    step_off(
        "poses as they are given",
        "assembler-given-poses",
        &["distill.assembler.refine_poses=false"],
    ),
    step_off(
        "half the evidence of a line",
        "assembler-half-evidence",
        &["distill.assembler.min_evidence=1.5"],
    ),
    step_off(
        "twice the evidence of a line",
        "assembler-twice-evidence",
        &["distill.assembler.min_evidence=6.0"],
    ),
    step_off(
        "lines proposed by long segments only",
        "assembler-long-segments",
        &["distill.assembler.min_segment_length_in_pixels=16.0"],
    ),
    step_off(
        "half as many neighbours of each view",
        "assembler-few-neighbours",
        &["distill.assembler.neighbours=5"],
    ),
];

/// All variants that make sense for a run with this back end, the base first.
pub fn variants(back_end: BackEnd) -> Vec<Variant> {
    let others: &[Variant] = match back_end {
        BackEnd::Assembler => &ASSEMBLER_STEPS,
        // Only this one asks the field.
        BackEnd::Paper => &TRAINING,
    };
    [&[BASE], others, &PAPER_STEPS].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_pipeline::config::Preset;
    use neat_pipeline::config::apply_overrides;
    use std::collections::BTreeSet;

    #[test]
    fn every_variant_applies_to_every_preset_and_most_change_something() {
        let all = [BackEnd::Assembler, BackEnd::Paper];
        for preset in Preset::ALL {
            let config = preset.config();
            for variant in all.into_iter().flat_map(variants) {
                let overrides = variant.overrides.map_to_strings();
                let changed = apply_overrides(&config, &overrides)
                    .unwrap_or_else(|error| panic!("{preset}, {}: {error}", variant.slug));
                let trains_alike = changed.model == config.model
                    && changed.train == config.train
                    && changed.data == config.data;
                assert!(variant.trains || trains_alike, "{}", variant.slug);
            }
        }
    }

    #[test]
    fn folders_are_not_shared() {
        for back_end in [BackEnd::Assembler, BackEnd::Paper] {
            let variants = variants(back_end);
            let slugs: BTreeSet<_> = variants.iter().map(|v| v.slug).collect();
            assert_eq!(slugs.len(), variants.len());
        }
    }

    trait Strings {
        fn map_to_strings(&self) -> Vec<String>;
    }

    impl Strings for &[&str] {
        fn map_to_strings(&self) -> Vec<String> {
            self.iter().map(|text| (*text).to_owned()).collect()
        }
    }
}
