//! A `wireframe.json` in every format, for readers of other projects to open, and a
//! solid as a triangle mesh.
//!
//! ```text
//! cargo run --release -p neat-export --example export_all -- WIREFRAME.json OUT
//! ```
//!
//! `OUT` must be new or empty. `scripts/read_exports.py` checks what this writes.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nalgebra::Vector3;
use neat_core::file;
use neat_export::marching_cubes::{Grid, Region, marching_cubes};
use neat_export::{ExportOptions, Format, ViewDirection, export};
use neat_wireframe::SignedDistance;
use neat_wireframe::export::read_json;
use std::path::PathBuf;

/// A ball of radius 0.75 at the origin.
struct Ball;

impl SignedDistance for Ball {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points.iter().map(|p| p.norm() - 0.75).collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        let gradient = |p: &Vector3<f64>| p.try_normalize(0.0).unwrap_or_else(Vector3::x);
        points
            .iter()
            .map(|p| (p.norm() - 0.75, gradient(p)))
            .collect()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [input, out] = arguments.as_slice() else {
        return Err("usage: export_all WIREFRAME.json OUT".into());
    };
    let document = read_json(input)?;
    file::create_dir(out)?;
    let report = |name: &str, format, options: &ExportOptions| {
        let written = export(&document, &out.join(name), format, options)?;
        println!(
            "{name}: {} junctions, {} edges, {} arcs, {} splines",
            written.junctions, written.edges, written.arcs, written.splines
        );
        for sentence in written.remarks {
            println!("  {sentence}");
        }
        Ok::<_, Box<dyn std::error::Error>>(())
    };
    let options = ExportOptions::default();
    for format in Format::ALL {
        if format == Format::Limap && document.edge_support.is_empty() {
            println!("limap: the wireframe knows no 2D segments");
            continue;
        }
        match format.endings().first() {
            Some(ending) => report(&format!("wireframe.{ending}"), format, &options)?,
            None => report(format.name(), format, &options)?,
        }
    }
    for direction in ViewDirection::ALL {
        for format in [Format::Svg, Format::Png] {
            let options = ExportOptions {
                direction,
                ..ExportOptions::default()
            };
            let name = format!("wireframe-{}.{}", direction.name(), format.name());
            report(&name, format, &options)?;
        }
    }
    let grid = Grid {
        region: Region::Ball {
            center: Vector3::zeros(),
            radius: 1.0,
        },
        resolution: 64,
        closed: true,
        max_slope: Some(1.0),
    };
    let mesh = marching_cubes(&Ball, &grid, &mut |_| ())?;
    mesh.write_ply(&out.join("ball.ply"))?;
    println!(
        "ball.ply: {} vertices, {} triangles",
        mesh.vertices.len(),
        mesh.triangles.len()
    );
    Ok(())
}
