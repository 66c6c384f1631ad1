//! `neat export`.

use crate::arguments::{BackendArg, positive};
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use nalgebra::Vector3;
use neat_export::marching_cubes::{Grid, Region, marching_cubes};
use neat_export::{
    EdgeFilter, ExportError, ExportOptions, Format, LengthUnit, ViewDirection, export,
};
use neat_pipeline::event::{Event, Stage};
use neat_pipeline::reconstruct::open_run;
use neat_wireframe::export::read_json;
use std::path::{Path, PathBuf};

/// A trained distance changes by somewhat more than 1 over a unit of length; blocks
/// of the grid that are farther from the surface than this allows are passed over.
const MAX_SLOPE: f64 = 2.0;

/// Write a wireframe for other programs
///
/// Everything is in the frame and unit of your files. The ending of --out chooses the format.
/// --min-probability and --min-views leave out uncertain edges and the junctions that only
/// they joined. With --mesh the learned surface is written instead, as triangles.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat export RUN --out house.dxf
  neat export RUN --out house.step --unit m --min-probability 0.9
  neat export RUN --out house.svg --view top
  neat export RUN --format colmap --out colmap
  neat export RUN/wireframe.json --format glb
  neat export RUN --mesh --out house.ply --resolution 512")]
pub struct ExportArgs {
    /// Folder of a run, or a wireframe.json
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// File to write (for colmap and limap a folder); RUN/wireframe.FORMAT by default
    #[arg(long, value_name = "FILE", required_unless_present_any = ["format", "mesh"])]
    out: Option<PathBuf>,
    /// Format; by default what the ending of --out says
    #[arg(long, value_name = "FORMAT", value_parser = format_parser(), conflicts_with = "mesh")]
    format: Option<Format>,
    /// Only edges that exist with at least this probability
    #[arg(long, value_name = "P", value_parser = positive)]
    min_probability: Option<f64>,
    /// Only edges that at least so many views support
    #[arg(long, value_name = "N")]
    min_views: Option<u32>,
    /// From where svg and png look; +z is up
    #[arg(long, value_enum, default_value_t, value_name = "FROM")]
    view: ViewArg,
    /// Width of svg and png in pixels
    #[arg(long, value_name = "N", default_value_t = ExportOptions::default().width)]
    width: u32,
    /// The unit of your files, which step has to name; numbers stay as they are
    #[arg(long, value_enum, default_value_t)]
    unit: UnitArg,
    /// Write the learned surface of a run as a triangle mesh (PLY) instead
    #[arg(long, conflicts_with_all = ["min_probability", "min_views"])]
    mesh: bool,
    /// Number of cubes of the mesh along the diameter of the scene sphere
    #[arg(long, value_name = "N", default_value_t = 256, requires = "mesh")]
    resolution: usize,
    /// Folder of the scene, if it is not where the run found it (for --mesh)
    #[arg(long, value_name = "SCENE", requires = "mesh")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendArg,
    #[command(flatten)]
    cache: CacheArgs,
}

/// From where a drawing looks.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum ViewArg {
    /// Along +y
    Front,
    /// Along -z
    Top,
    /// Along -x
    Side,
    /// From a corner
    #[default]
    Isometric,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum UnitArg {
    /// Millimetres
    #[default]
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
}

/// Takes the name of a format, with its explanation in the help.
fn format_parser() -> impl TypedValueParser<Value = Format> {
    let values = Format::ALL.map(|f| PossibleValue::new(f.name()).help(f.explanation()));
    PossibleValuesParser::new(values).try_map(|name| Format::from_name(&name))
}

impl ExportArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        if self.mesh {
            return self.write_mesh(quiet);
        }
        let json = if self.run.is_dir() {
            self.run.join("wireframe.json")
        } else {
            self.run.clone()
        };
        let document = read_json(&json).map_err(ExportError::from)?;
        let format = match (self.format, &self.out) {
            (Some(format), _) => format,
            (None, Some(out)) => Format::from_path(out)?,
            // clap asks for one of them.
            (None, None) => Format::Json,
        };
        let out = self.out.unwrap_or_else(|| default_path(&json, format));
        let options = ExportOptions {
            filter: EdgeFilter {
                min_probability: self.min_probability,
                min_views: self.min_views,
            },
            direction: match self.view {
                ViewArg::Front => ViewDirection::Front,
                ViewArg::Top => ViewDirection::Top,
                ViewArg::Side => ViewDirection::Side,
                ViewArg::Isometric => ViewDirection::Isometric,
            },
            width: self.width,
            unit: match self.unit {
                UnitArg::Mm => LengthUnit::Millimetre,
                UnitArg::Cm => LengthUnit::Centimetre,
                UnitArg::M => LengthUnit::Metre,
            },
        };
        let written = export(&document, &out, format, &options)?;
        for sentence in &written.left_out {
            output::note(&format!("warning: {sentence}"));
        }
        let (junctions, edges) = (written.junctions, written.edges);
        output::print(&format!(
            "{format}: {junctions} junctions, {edges} edges: {out}",
            format = format.name(),
            out = out.display()
        ))
    }

    fn write_mesh(self, quiet: bool) -> Result<(), CliError> {
        let mut progress = Progress::new(quiet);
        let opened = open_run(
            &self.run,
            self.scene.as_deref(),
            self.backend.backend,
            self.cache.open().as_ref(),
            Ok::<_, CliError>,
            &mut |event| progress.show(event),
        )?;
        let grid = Grid {
            region: Region::Ball {
                center: Vector3::zeros(),
                radius: opened.field.scene_radius,
            },
            resolution: self.resolution,
            closed: false,
            max_slope: Some(MAX_SLOPE),
        };
        progress.show(Event::StageStarted(Stage::Export));
        let mesh = marching_cubes(&opened.field, &grid, &mut |fraction| {
            progress.show(Event::StageProgress {
                stage: Stage::Export,
                fraction,
            });
        })?;
        let mesh = mesh.map(|point| opened.scene.original_from_world.apply(point));
        let out = self
            .out
            .unwrap_or_else(|| opened.dir.root().join("mesh.ply"));
        mesh.write_ply(&out)?;
        drop(progress);
        if mesh.triangles.is_empty() {
            output::note(
                "warning: the mesh is empty: the learned distance has no zero in the scene sphere",
            );
        }
        let (vertices, triangles) = (mesh.vertices.len(), mesh.triangles.len());
        output::print(&format!(
            "mesh: {vertices} vertices, {triangles} triangles: {}",
            out.display()
        ))
    }
}

/// Beside the JSON, with the first ending of the format, or as a folder of its name.
fn default_path(json: &Path, format: Format) -> PathBuf {
    match format.endings().first() {
        Some(ending) => json.with_extension(ending),
        None => json.with_file_name(format.name()),
    }
}
