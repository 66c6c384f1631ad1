//! `neat export`.

use crate::arguments::BackendArg;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use nalgebra::Vector3;
use neat_export::marching_cubes::{Grid, Region, marching_cubes};
use neat_export::{
    EdgeFilter, ExportError, ExportOptions, Format, LengthUnit, UpAxis, ViewDirection, export,
};
use neat_pipeline::event::{Event, Stage};
use neat_pipeline::reconstruct::open_run;
use neat_pipeline::resources::{Resources, default_limit};
use neat_pipeline::run_dir::RunDir;
use neat_wireframe::export::read_json;
use std::fs;
use std::path::{Path, PathBuf};

/// A trained distance changes by somewhat more than 1 over a unit of length; blocks
/// of the grid that are farther from the surface than this allows are passed over.
const MAX_SLOPE: f64 = 2.0;

/// Options that --mesh and all that belongs to it exclude. Both have to be said: clap does
/// not ask for a required option that another one excludes.
const OF_WIREFRAMES: [&str; 8] = [
    "format",
    "min_probability",
    "min_views",
    "only",
    "view",
    "width",
    "unit",
    "up",
];

/// Write a wireframe for other programs
///
/// Everything is in the frame and unit of your files. The ending of --out chooses the format.
/// --min-probability and --min-views leave out uncertain edges, --only structure paint and
/// shadows, and each the junctions that only those joined. With --mesh the learned surface is written instead, as triangles.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat export RUN --out house.dxf
  neat export RUN --out house.step --unit m --min-probability 0.7
  neat export RUN --out house.dxf --only structure
  neat export RUN --out house.svg --view top
  neat export RUN --out house.city.json --up=-y
  neat export RUN --format colmap --out colmap
  neat export RUN/wireframe.json --format glb
  neat export RUN --mesh --out house.ply --resolution 512",
    // Only a mesh is computed; of the shared arguments clap knows the names.
    mut_arg("backend", |arg| arg.requires("mesh").conflicts_with_all(OF_WIREFRAMES)),
    mut_arg("no_cache", |arg| arg.requires("mesh").conflicts_with_all(OF_WIREFRAMES))
)]
pub struct ExportArgs {
    /// Folder of a run, or a wireframe.json
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// File to write (for colmap and limap a folder); by default RUN/wireframe.FORMAT, or
    /// RUN/wireframe-filtered.FORMAT if edges are left out. What the run itself has written is not
    /// replaced unless named here, and the input never
    #[arg(long, value_name = "FILE", required_unless_present_any = ["format", "mesh"])]
    out: Option<PathBuf>,
    /// Format; by default what the ending of --out says
    #[arg(long, value_name = "FORMAT", value_parser = format_parser())]
    format: Option<Format>,
    /// Only edges that exist with at least this probability
    #[arg(long, value_name = "P", value_parser = probability)]
    min_probability: Option<f64>,
    /// Only edges that at least so many views support
    #[arg(long, value_name = "N")]
    min_views: Option<u32>,
    /// Only edges of one sort
    #[arg(long, value_enum, value_name = "SORT")]
    only: Option<Only>,
    /// From where svg and png look, isometric by default; +z is up
    #[arg(long, value_enum, value_name = "FROM")]
    view: Option<ViewArg>,
    /// Width of svg and png in pixels, 1600 by default
    #[arg(long, value_name = "N")]
    width: Option<u32>,
    /// The unit of your files, which step has to name, mm by default; numbers stay as they are
    #[arg(long, value_enum)]
    unit: Option<UnitArg>,
    /// The axis of your files that points upward, which cityjson turns to +z: x, y, z (the
    /// default), -x, -y or -z
    #[arg(long, value_name = "AXIS", value_parser = up_parser(), allow_hyphen_values = true)]
    up: Option<UpAxis>,
    /// Write the learned surface of a run as a triangle mesh (PLY) instead; RUN/mesh.ply by default
    #[arg(long, conflicts_with_all = OF_WIREFRAMES)]
    mesh: bool,
    /// Number of cubes of the mesh along the diameter of the scene sphere
    #[arg(long, value_name = "N", default_value_t = 256, requires = "mesh", conflicts_with_all = OF_WIREFRAMES)]
    resolution: usize,
    /// Folder of the scene, if it is not where the run found it (for --mesh)
    #[arg(long, value_name = "SCENE", requires = "mesh", conflicts_with_all = OF_WIREFRAMES)]
    scene: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendArg,
    #[command(flatten)]
    cache: CacheArgs,
}

/// A sort of edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Only {
    /// Creases and boundaries of surfaces; no paint, joints within faces, shadows or reflections
    Structure,
}

/// From where a drawing looks.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ViewArg {
    /// Along +y
    Front,
    /// Along -z
    Top,
    /// Along -x
    Side,
    /// From a corner
    Isometric,
}

impl From<ViewArg> for ViewDirection {
    fn from(view: ViewArg) -> Self {
        match view {
            ViewArg::Front => Self::Front,
            ViewArg::Top => Self::Top,
            ViewArg::Side => Self::Side,
            ViewArg::Isometric => Self::Isometric,
        }
    }
}

/// A unit of length.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum UnitArg {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
}

impl From<UnitArg> for LengthUnit {
    fn from(unit: UnitArg) -> Self {
        match unit {
            UnitArg::Mm => Self::Millimetre,
            UnitArg::Cm => Self::Centimetre,
            UnitArg::M => Self::Metre,
        }
    }
}

/// Takes a number from 0 to 1.
fn probability(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("must be a number from 0 to 1".to_owned()),
    }
}

/// Takes the name of a format, with its explanation in the help.
fn format_parser() -> impl TypedValueParser<Value = Format> {
    let values = Format::ALL.map(|f| PossibleValue::new(f.name()).help(f.explanation()));
    PossibleValuesParser::new(values).try_map(|name| Format::from_name(&name))
}

/// Takes the name of an axis.
fn up_parser() -> impl TypedValueParser<Value = UpAxis> {
    PossibleValuesParser::new(UpAxis::NAMED.map(|(name, _)| name))
        .try_map(|name| UpAxis::from_name(&name))
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
        let format = match (self.format, &self.out) {
            (Some(format), _) => format,
            (None, Some(out)) => Format::from_path(out)?,
            // clap asks for one of them.
            (None, None) => Format::Json,
        };
        self.check(format)?;
        let options = self.options();
        let out = match self.out {
            Some(out) => out,
            None => default_path(&json, format, options.filter)?,
        };
        if is_same_file(&out, &json) {
            return Err(CliError::Usage(format!(
                "{} is what is exported: give another path with --out",
                out.display()
            )));
        }
        let document = read_json(&json).map_err(ExportError::from)?;
        let written = export(&document, &out, format, &options)?;
        for sentence in &written.remarks {
            output::warning(sentence);
        }
        let (junctions, edges) = (written.junctions, written.edges);
        let counted = |count: usize, what: &str| match count {
            0 => String::new(),
            _ => format!(", {count} {what}"),
        };
        let arcs = counted(written.arcs, "arcs");
        let splines = counted(written.splines, "splines");
        output::print(&format!(
            "{format}: {junctions} junctions, {edges} edges{arcs}{splines}: {out}",
            format = format.name(),
            out = out.display()
        ))
    }

    /// Refuses options that the format does not look at.
    fn check(&self, format: Format) -> Result<(), CliError> {
        let is_drawing = matches!(format, Format::Svg | Format::Png);
        for (option, given, is_used) in [
            ("--view", self.view.is_some(), is_drawing),
            ("--width", self.width.is_some(), is_drawing),
            ("--unit", self.unit.is_some(), format == Format::Step),
            ("--up", self.up.is_some(), format == Format::CityJson),
        ] {
            if given && !is_used {
                let name = format.name();
                return Err(CliError::Usage(format!(
                    "{option} has no meaning for {name}"
                )));
            }
        }
        Ok(())
    }

    fn options(&self) -> ExportOptions {
        let default = ExportOptions::default();
        ExportOptions {
            filter: EdgeFilter {
                min_probability: self.min_probability,
                min_views: self.min_views,
                only_structure: self.only == Some(Only::Structure),
            },
            direction: self.view.map_or(default.direction, ViewDirection::from),
            width: self.width.unwrap_or(default.width),
            unit: self.unit.map_or(default.unit, LengthUnit::from),
            up: self.up.unwrap_or(default.up),
        }
    }

    fn write_mesh(self, quiet: bool) -> Result<(), CliError> {
        if let Some(out) = &self.out
            && !out
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("ply"))
        {
            return Err(CliError::Usage(format!(
                "{} cannot hold a mesh, which is written as PLY: end its name with .ply",
                out.display()
            )));
        }
        let mut progress = Progress::new(quiet);
        let opened = open_run(
            &self.run,
            self.scene.as_deref(),
            self.backend.backend,
            Resources {
                cache: self.cache.open().as_ref(),
                memory_limit: default_limit(),
                cancelled: None,
            },
            Ok::<_, CliError>,
            &mut |event| progress.show(event),
        )?;
        let field = opened.trained_field()?;
        let grid = Grid {
            region: Region::Ball {
                center: Vector3::zeros(),
                radius: field.scene_radius,
            },
            resolution: self.resolution,
            closed: false,
            max_slope: Some(MAX_SLOPE),
        };
        progress.show(Event::StageStarted(Stage::Export));
        let mesh = marching_cubes(field, &grid, &mut |fraction| {
            progress.show(Event::StageProgress {
                stage: Stage::Export,
                fraction,
            });
        })?;
        let original_from_world = &opened.scene.original_from_world;
        let mut mesh = mesh.map(|point| original_from_world.apply(point));
        if original_from_world.scale < 0.0 {
            // The outside of a mirrored triangle is its inside.
            mesh.triangles
                .iter_mut()
                .for_each(|corners| corners.swap(1, 2));
        }
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

/// Beside the JSON, with the first ending of the format, or as a folder of its name; a
/// part of the wireframe is not called like the whole.
///
/// # Errors
/// If a run has written that file itself, or it is the JSON.
fn default_path(json: &Path, format: Format, filter: EdgeFilter) -> Result<PathBuf, CliError> {
    let name = |stem: &str| match format.endings().first() {
        Some(ending) => format!("{stem}.{ending}"),
        None => stem.to_owned(),
    };
    let stem = match format.is_folder() {
        true => format.name().into(),
        false => json.file_stem().unwrap_or_default().to_string_lossy(),
    };
    if filter != EdgeFilter::default() {
        return Ok(json.with_file_name(name(&format!("{stem}-filtered"))));
    }
    let path = json.with_file_name(name(&stem));
    let run = json.parent().and_then(|folder| RunDir::open(folder).ok());
    let is_of_run = run.is_some_and(|run| {
        let mut results = ["json", "obj", "ply", "png"].iter();
        results.any(|extension| run.wireframe(extension) == path)
    });
    if is_of_run || path == json {
        return Err(CliError::Usage(format!(
            "without --out this would replace {}: name another file with --out",
            path.display()
        )));
    }
    Ok(path)
}

/// Whether two paths lead to one file that exists.
fn is_same_file(a: &Path, b: &Path) -> bool {
    match (fs::canonicalize(a), fs::canonicalize(b)) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: EdgeFilter = EdgeFilter {
        min_probability: None,
        min_views: None,
        only_structure: false,
    };
    const SOME: EdgeFilter = EdgeFilter {
        min_probability: Some(0.0),
        ..ALL
    };

    #[test]
    fn results_of_a_run_are_not_replaced_by_default() {
        let run = tempfile::tempdir().unwrap();
        let json = run.path().join("wireframe.json");
        for name in ["config.toml", "wireframe.json"] {
            fs::write(run.path().join(name), "").unwrap();
        }
        for format in [Format::Json, Format::Obj, Format::Ply, Format::Png] {
            let error = default_path(&json, format, ALL).unwrap_err().to_string();
            assert!(error.contains("--out"), "{error}");
        }
        let name = |format, filter| {
            let path = default_path(&json, format, filter).unwrap();
            path.strip_prefix(run.path()).unwrap().to_owned()
        };
        assert_eq!(name(Format::Dxf, ALL), Path::new("wireframe.dxf"));
        assert_eq!(
            name(Format::CityJson, ALL),
            Path::new("wireframe.city.json")
        );
        assert_eq!(name(Format::Limap, ALL), Path::new("limap"));
        assert_eq!(
            name(Format::Json, SOME),
            Path::new("wireframe-filtered.json")
        );
        assert_eq!(name(Format::Limap, SOME), Path::new("limap-filtered"));
        let filtered = run.path().join("wireframe-filtered.json");
        assert!(default_path(&filtered, Format::Obj, ALL).is_ok());

        // A file that no run has written may stand beside others.
        fs::remove_file(run.path().join("config.toml")).unwrap();
        assert_eq!(name(Format::Obj, ALL), Path::new("wireframe.obj"));
        assert!(default_path(&json, Format::Json, ALL).is_err());
    }

    #[test]
    fn probabilities_reach_from_0_to_1() {
        assert_eq!(probability("0"), Ok(0.0));
        assert_eq!(probability("1"), Ok(1.0));
        for text in ["-0.1", "1.5", "NaN", "much"] {
            assert!(probability(text).is_err(), "{text}");
        }
    }
}
