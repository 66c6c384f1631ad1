//! `neat eval`.

use crate::arguments::positive;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use neat_core::ply::read_points;
use neat_core::{LoadOptions, SceneError, Similarity, View, Wireframe3d, file, load_scene};
use neat_eval::{
    EvalError, EvaluationInput, EvaluationOptions, EvaluationReport, FoundFace, GroundPlane,
    NeatAbc, ObservationMask, Protocol, ScannedSurface, SceneTruth, Scores, TrueFace, TruthKind,
    foreign,
};
use neat_pipeline::config::Preset;
use neat_pipeline::resources::{Resources, default_limit};
use neat_pipeline::scene::{load_options, prepare_scene};
use neat_wireframe::ViewObservation;
use neat_wireframe::metrics::Matching;
use neat_wireframe::metrics::{
    SupportedTruthConfig, ideal_baseline, required_views, supported_truth, without_curves,
};
use std::path::{Path, PathBuf};

/// Measure a wireframe against the truth or a scanned surface, by a published protocol
///
/// Without --protocol, a true wireframe asks for neat-abc, points for neat-blended-mvs, and the
/// truth of a rendered scene for surface-and-creases.
/// Everything must be in one frame and unit: that of the protocol, where it names one.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat eval --pred RUN/wireframe.json --gt SCENE/gt_wireframe.json
  neat eval --pred RUN/wireframe.json --gt SCENE/gt_wireframe.json --scene SCENE
  neat eval --pred RUN/wireframe.json --points scan.ply --json scores.json
  neat eval --pred parametric_edges.json --gt gt_wireframe.json --protocol emap,edge-gaussians
  neat eval --pred RUN/wireframe.json --points stl024_total.ply --protocol neat-dtu \\
      --obs-mask ObsMask24_10.mat --plane Plane24.mat
  neat eval --pred RUN/wireframe.json --truth SCENE
  neat eval --pred RUN/wireframe.json --gt SCENE/gt_wireframe.json --protocol cad-faces

Results and truths are wireframe.json, parametric_edges.json (EMAP), .obj, .ply with edges, the
.npz of the published NEAT, LIMAP's .npy, and Line3D++'s .txt. Faces are those of a wireframe.json.")]
pub struct EvalArgs {
    /// Result to measure
    #[arg(long, value_name = "FILE")]
    pred: PathBuf,
    /// The same result before its visibility check (neat-abc)
    #[arg(long, value_name = "FILE")]
    before: Option<PathBuf>,
    /// True wireframe
    #[arg(long, value_name = "FILE", required_unless_present_any = ["points", "truth"])]
    gt: Option<PathBuf>,
    /// Points on the true surface, as PLY
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Rendered scene with its exact truth in the folder `truth`: stats.json, wireframe.json,
    /// curved.json, mesh.ply, and perhaps texture_lines.json (surface-and-creases, scene-faces)
    #[arg(long, value_name = "SCENE")]
    truth: Option<PathBuf>,
    /// How to measure; several with commas
    #[arg(long = "protocol", value_name = "NAME,...", value_delimiter = ',', value_parser = protocol_parser())]
    protocols: Vec<Protocol>,
    /// Measure neat-abc once more against what the 2D wireframes of this scene support of the
    /// truth, with the pieces of curved rims counted apart
    #[arg(long, value_name = "SCENE", requires = "gt")]
    scene: Option<PathBuf>,
    /// Cells that DTU's scanner saw, ObsMaskN_10.mat (neat-dtu)
    #[arg(long, value_name = "FILE")]
    obs_mask: Option<PathBuf>,
    /// Plane of DTU's table, PlaneN.mat (neat-dtu)
    #[arg(long, value_name = "FILE")]
    plane: Option<PathBuf>,
    /// Distances at which shares are taken instead of the protocol's; of surface-and-creases
    /// and scene-faces they are multiplied by the scale of the scene
    #[arg(long, value_name = "D,D,...", value_delimiter = ',', value_parser = positive)]
    thresholds: Option<Vec<f64>>,
    /// How predictions are paired with the truth (neat-abc)
    #[arg(long, value_enum)]
    matching: Option<MatchingArg>,
    /// Distances to the surface that are this long or longer are ignored (neat-dtu, neat-blended-mvs)
    #[arg(long, value_name = "D", value_parser = positive)]
    max_distance: Option<f64>,
    /// Size of the normalised object by that of its CAD model, whose unit the published sampling
    /// of the truth has (emap, curve-gaussian, edge-gaussians)
    #[arg(long, value_name = "S", value_parser = positive)]
    truth_scale: Option<f64>,
    /// Seed of what is random, 0 by default: the thinning of neat-dtu and the volumes of hss
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    cache: CacheArgs,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Write all numbers to this file too: a list with one report per protocol
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How predictions are paired with the truth.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MatchingArg {
    /// One pairing with the smallest sum of distances, as in the published evaluation
    MinimumSum,
    /// The largest pairing at each threshold
    PerThreshold,
}

impl From<MatchingArg> for Matching {
    fn from(matching: MatchingArg) -> Self {
        match matching {
            MatchingArg::MinimumSum => Self::MinimumSum,
            MatchingArg::PerThreshold => Self::PerThreshold,
        }
    }
}

/// How reports are printed.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Format {
    /// Aligned columns
    #[default]
    Text,
    /// Tables for documents
    Markdown,
    /// What --json writes
    Json,
}

fn protocol_parser() -> impl TypedValueParser<Value = Protocol> {
    let values = Protocol::ALL
        .map(|protocol| PossibleValue::new(protocol.name()).help(protocol.explanation()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<Protocol>())
}

/// What the 2D wireframes of a scene say.
struct SceneViews<'a> {
    path: &'a Path,
    /// In the frame of the prepared scene.
    observed: Vec<ViewObservation>,
    original_from_world: Similarity,
}

impl SceneViews<'_> {
    /// A truth in the frame of the views.
    fn truth_in_world(&self, truth: &Wireframe3d) -> Wireframe3d {
        let world_from_original = self.original_from_world.inverse();
        truth.map(|point| world_from_original.apply(point))
    }
}

impl EvalArgs {
    pub fn run(self) -> Result<(), CliError> {
        let protocols = self.protocols();
        self.check(&protocols)?;
        let (inputs, options) = (self.read(&protocols)?, self.options());
        let mut reports = protocols
            .iter()
            .map(|protocol| Ok(EvaluationReport::new(protocol.evaluate(&inputs, &options)?)))
            .collect::<Result<Vec<_>, EvalError>>()?;
        if let Some(scene) = &self.scene {
            let views = self.read_views(scene)?;
            let truth = views.truth_in_world(&inputs.truth.wireframe);
            for report in &mut reports {
                if let Scores::NeatAbc(scores) = &mut report.scores {
                    scores.ideal_baseline = Some(ideal_baseline(&truth, &views.observed));
                }
            }
            reports.push(self.supported_report(&views, &truth, &inputs)?);
        }
        let json = || {
            let texts: Vec<String> = reports.iter().map(EvaluationReport::to_json).collect();
            format!("[\n{}\n]\n", texts.join(",\n"))
        };
        if let Some(path) = &self.json {
            file::write_atomically(path, json().as_bytes())?;
        }
        let join = |print: fn(&EvaluationReport) -> String| {
            let texts: Vec<String> = reports.iter().map(print).collect();
            texts.join("\n")
        };
        output::print(&match self.format {
            Format::Text => join(EvaluationReport::to_text),
            Format::Markdown => join(EvaluationReport::to_markdown),
            Format::Json => json(),
        })
    }

    /// Those asked for, or those that the truth suggests.
    fn protocols(&self) -> Vec<Protocol> {
        if !self.protocols.is_empty() {
            return self.protocols.clone();
        }
        let for_wireframe = self.gt.is_some().then_some(Protocol::NeatAbc);
        let for_points = self.points.is_some().then_some(Protocol::NeatBlendedMvs);
        let for_scene = self.truth.is_some().then_some(Protocol::SurfaceAndCreases);
        let suggested = [for_wireframe, for_points, for_scene];
        suggested.into_iter().flatten().collect()
    }

    /// Refuses what is missing, and options that no protocol would look at.
    fn check(&self, protocols: &[Protocol]) -> Result<(), CliError> {
        let usage = |message: String| Err(CliError::Usage(message));
        for protocol in protocols {
            let (what, remedy, is_given) = match protocol.truth() {
                TruthKind::SurfacePoints => ("a surface", "--points", self.points.is_some()),
                TruthKind::Edges => ("a wireframe", "--gt", self.gt.is_some()),
                TruthKind::Scene => ("a scene with truth", "--truth", self.truth.is_some()),
            };
            if !is_given {
                return usage(format!("{protocol} measures against {what}: give {remedy}"));
            }
        }
        let compares = |truth: TruthKind| protocols.iter().any(|p| p.truth() == truth);
        let any = |wanted: &[Protocol]| protocols.iter().any(|p| wanted.contains(p));
        if any(&[Protocol::NeatDtu]) && (self.obs_mask.is_none() || self.plane.is_none()) {
            return usage(
                "neat-dtu needs --obs-mask and --plane; neat-blended-mvs does without".into(),
            );
        }
        let sampled = [
            Protocol::Emap,
            Protocol::CurveGaussian,
            Protocol::EdgeGaussians,
        ];
        let surfaces = [Protocol::NeatDtu, Protocol::NeatBlendedMvs];
        let without_thresholds = |p: &Protocol| {
            surfaces.contains(p) || matches!(p, Protocol::Hss | Protocol::Wed | Protocol::CadFaces)
        };
        for (option, given, is_used) in [
            ("--gt", self.gt.is_some(), compares(TruthKind::Edges)),
            (
                "--points",
                self.points.is_some(),
                compares(TruthKind::SurfacePoints),
            ),
            ("--truth", self.truth.is_some(), compares(TruthKind::Scene)),
            (
                "--seed",
                self.seed.is_some(),
                any(&[Protocol::NeatDtu, Protocol::Hss]),
            ),
            ("--before", self.before.is_some(), any(&[Protocol::NeatAbc])),
            ("--scene", self.scene.is_some(), any(&[Protocol::NeatAbc])),
            (
                "--matching",
                self.matching.is_some(),
                any(&[Protocol::NeatAbc]),
            ),
            (
                "--obs-mask",
                self.obs_mask.is_some(),
                any(&[Protocol::NeatDtu]),
            ),
            ("--plane", self.plane.is_some(), any(&[Protocol::NeatDtu])),
            (
                "--max-distance",
                self.max_distance.is_some(),
                any(&surfaces),
            ),
            ("--truth-scale", self.truth_scale.is_some(), any(&sampled)),
            (
                "--thresholds",
                self.thresholds.is_some(),
                !protocols.iter().all(without_thresholds),
            ),
        ] {
            if given && !is_used {
                let names: Vec<&str> = protocols.iter().map(|p| p.name()).collect();
                return usage(format!("{option} has no meaning for {}", names.join(", ")));
            }
        }
        Ok(())
    }

    fn read(&self, protocols: &[Protocol]) -> Result<EvaluationInput, EvalError> {
        let mut surface = ScannedSurface::default();
        if let Some(points) = &self.points {
            surface.points = read_points(points)?;
        }
        if let Some(mask) = &self.obs_mask {
            surface.mask = Some(ObservationMask::read(mask)?);
        }
        if let Some(plane) = &self.plane {
            surface.ground_plane = Some(GroundPlane::read(plane)?);
        }
        let truth = self.gt.as_deref().map(foreign::read_truth).transpose()?;
        let any = |wanted: &[Protocol]| protocols.iter().any(|p| wanted.contains(p));
        let needs_cameras = any(&[Protocol::SceneFaces]);
        let scene = (self.truth.as_deref()).map(|dir| self.read_scene(dir, needs_cameras));
        let true_faces = match &self.gt {
            Some(path) if any(&[Protocol::CadFaces]) => TrueFace::read(path)?,
            _ => Vec::new(),
        };
        let faces = match any(&[Protocol::CadFaces, Protocol::SceneFaces]) {
            true => FoundFace::read(&self.pred)?,
            false => Vec::new(),
        };
        Ok(EvaluationInput {
            predicted: foreign::read(&self.pred)?,
            faces,
            before: self.before.as_deref().map(foreign::read).transpose()?,
            truth: truth.unwrap_or_default(),
            true_faces,
            surface,
            scene: scene.transpose()?.unwrap_or_default(),
        })
    }

    /// The truth of a rendered scene. If it does not say which views see an edge, the cameras of
    /// the scene do, where there are any; what they see of the surface they alone know.
    fn read_scene(&self, dir: &Path, needs_cameras: bool) -> Result<SceneTruth, EvalError> {
        let mut truth = SceneTruth::read(dir)?;
        if truth.edge_views.is_some() && !needs_cameras {
            return Ok(truth);
        }
        let cache = self.cache.open();
        let data = Preset::default().config().data;
        let options = LoadOptions {
            require_wireframes: false,
            ..load_options(&data, cache.as_ref(), default_limit())
        };
        let scene = match load_scene(dir, &options) {
            Ok(loaded) => loaded.scene,
            // A truth without photographs: nobody knows what they show.
            Err(SceneError::UnknownLayout { .. }) => return Ok(truth),
            Err(error) => return Err(error.into()),
        };
        let in_files = |view: &View| scene.original_from_world.apply_to_camera(&view.camera);
        truth.cameras = scene.views.iter().map(in_files).collect();
        Ok(truth)
    }

    fn options(&self) -> EvaluationOptions {
        EvaluationOptions {
            thresholds: self.thresholds.clone(),
            matching: self.matching.map(Matching::from),
            max_distance: self.max_distance,
            truth_scale: self.truth_scale,
            seed: self.seed,
        }
    }

    /// The 2D wireframes of a scene, as `--scene` asks for them.
    fn read_views<'a>(&self, path: &'a Path) -> Result<SceneViews<'a>, CliError> {
        let config = Preset::default().config();
        let cache = self.cache.open();
        let resources = Resources {
            cache: cache.as_ref(),
            memory_limit: default_limit(),
            ..Resources::default()
        };
        let prepared = prepare_scene(path, &config, None, resources, &mut |_| ())?;
        Ok(SceneViews {
            path,
            observed: ViewObservation::from_scene(&prepared.scene, config.data.min_segment_score),
            original_from_world: prepared.scene.original_from_world,
        })
    }

    /// neat-abc against the part of the truth, here in the frame of the views, that these
    /// support.
    fn supported_report(
        &self,
        views: &SceneViews<'_>,
        truth_in_world: &Wireframe3d,
        inputs: &EvaluationInput,
    ) -> Result<EvaluationReport, CliError> {
        let required = required_views(views.observed.len());
        let config = SupportedTruthConfig::default();
        let supported = supported_truth(truth_in_world, &views.observed, required, &config)
            .map(|point| views.original_from_world.apply(point));
        let truth = &inputs.truth.wireframe;
        let published = NeatAbc::default();
        let neat = NeatAbc {
            thresholds: self.thresholds.clone().unwrap_or(published.thresholds),
            matching: self.matching.map_or(published.matching, Matching::from),
        };
        let smallest = neat
            .thresholds
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let curves = &inputs.truth.curves;
        let straight = without_curves(&inputs.predicted.wireframe, truth, curves, smallest);
        let scores = neat.evaluate(&straight.wireframe, None, &supported)?;
        Ok(EvaluationReport {
            source: format!(
                "against what at least {required} views of {} support; left out as pieces of curved rims: {} junctions, {} segments",
                views.path.display(),
                straight.junctions_on_curves,
                straight.edges_on_curves
            ),
            scores: Scores::NeatAbc(scores),
        })
    }
}
