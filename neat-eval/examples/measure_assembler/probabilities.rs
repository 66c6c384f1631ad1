//! Whether edges exist as often as their probabilities say, and what weights these would have.

use crate::Result;
use crate::calibration_weights::{WeighedEdge, weights};
use crate::prepared::MIN_SEGMENT_SCORE;
use neat_core::{LineSegment3, Scene};
use neat_eval::{Binning, Judged, NeatAbc, SceneTruth, SurfaceAndCreases};
use neat_eval::{existing_edges, expected_calibration_error, foreign, reliability};
use neat_wireframe::confidence::{ConfidenceConfig, assess};
use neat_wireframe::{ViewObservation, Wireframe3d};
use std::collections::BTreeMap;
use std::path::Path;

const BINS: usize = 10;

/// The edges of all scenes, by the folder that the scenes lie in: scenes of a class.
#[derive(Default)]
pub struct Probabilities {
    by_class: BTreeMap<String, Vec<Judged>>,
    weighed: BTreeMap<String, Vec<WeighedEdge>>,
}

impl Probabilities {
    /// Adds the edges of a scene, if there is a truth; returns what they say and what is.
    pub fn add(&mut self, dir: &Path, scene: &Scene, in_world: &Wireframe3d) -> Result<String> {
        let original = in_world.map(|p| scene.original_from_world.apply(p));
        let Some(exists) = existing(dir, &original.segments())? else {
            return Ok(String::new());
        };
        // As a run does it with what the assembler made.
        let views = ViewObservation::from_scene(scene, MIN_SEGMENT_SCORE);
        let config = ConfidenceConfig::default();
        let confidence = assess(in_world, &views, None, 1.0, &config)?;
        let folder = dir.parent().and_then(Path::file_name).unwrap_or_default();
        let class = folder.to_string_lossy().into_owned();
        let edges = confidence.edges.iter().zip(&exists);
        let of_scene = (edges.len() as f64).sqrt().recip();
        let weighed = edges.filter_map(|(edge, exists)| {
            Some(WeighedEdge {
                witnesses: edge.witnesses?,
                exists: *exists,
                weight: of_scene,
            })
        });
        self.weighed
            .entry(class.clone())
            .or_default()
            .extend(weighed);
        let said = confidence.edges.iter().map(|edge| edge.probability);
        let judged: Vec<Judged> = said.zip(exists).collect();
        let count = judged.len().max(1) as f64;
        let text = format!(
            " p {:.2} is {:.2}",
            judged.iter().map(|(p, _)| p).sum::<f64>() / count,
            judged.iter().filter(|(_, exists)| *exists).count() as f64 / count
        );
        self.by_class.entry(class).or_default().extend(judged);
        Ok(text)
    }

    /// The reliability of all, and the expected calibration errors.
    pub fn table(&self) -> String {
        let all: Vec<Judged> = self.by_class.values().flatten().copied().collect();
        let mut text = String::from("edges    said     is\n");
        for bin in reliability(&all, BINS, Binning::Width) {
            text += &format!("{:5} {:7.3} {:6.3}\n", bin.count, bin.said, bin.is);
        }
        let all = ("all", &all);
        let classes = (self.by_class.iter()).map(|(class, judged)| (class.as_str(), judged));
        for (class, judged) in classes.chain([all]) {
            let error = |binning| {
                let bins = reliability(judged, BINS, binning);
                expected_calibration_error(&bins)
            };
            text += &format!(
                "{class}: {} edges, calibration error {:.3} (bins of equal count {:.3})\n",
                judged.len(),
                error(Binning::Width),
                error(Binning::Count)
            );
        }
        text += &self.weights();
        text
    }

    /// The weights that these edges ask for, all of them and without each class, which is then
    /// held to them.
    fn weights(&self) -> String {
        let without = |left_out: Option<&String>| {
            let used = (self.weighed.iter()).filter(|(class, _)| Some(*class) != left_out);
            let edges: Vec<WeighedEdge> = used.flat_map(|(_, edges)| edges).copied().collect();
            let weights = weights(&edges)?;
            let asked = left_out.map_or(&edges, |class| &self.weighed[class]);
            let judged: Vec<Judged> = (asked.iter())
                .map(|edge| (edge.probability(weights), edge.exists))
                .collect();
            let error = expected_calibration_error(&reliability(&judged, BINS, Binning::Width));
            let named = left_out.map_or("all".to_owned(), |class| format!("all but {class}"));
            let [base, precision, whole] = weights;
            Some(format!(
                "weights of {named}: {base:.2}, precision {precision:.2}, whole {whole:.2}, \
                 {} calibration error {error:.3}\n",
                left_out.map_or("their", |class| class)
            ))
        };
        let classes = self.weighed.keys().filter(|_| self.weighed.len() > 1);
        (std::iter::once(None).chain(classes.map(Some)))
            .filter_map(without)
            .collect()
    }
}

/// Whether each edge, in the frame of the files, exists; `None` without a truth.
fn existing(dir: &Path, edges: &[LineSegment3]) -> Result<Option<Vec<bool>>> {
    let protocol = SurfaceAndCreases::default();
    if dir.join("truth").exists() {
        let truth = SceneTruth::read(dir)?;
        return Ok(Some(protocol.existing_edges(edges, &truth)?));
    }
    let truth = dir.join("gt_wireframe.json");
    if !truth.exists() {
        return Ok(None);
    }
    let lines = foreign::read_truth(&truth)?.wireframe.segments();
    let tolerance = NeatAbc::default().thresholds[0];
    let exists = existing_edges(edges, &lines, tolerance, protocol.max_angle)?;
    Ok(Some(exists))
}
