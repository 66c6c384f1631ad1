//! CityJSON 2.0 (OGC 20-072r5): buildings of planar surfaces, which say what they are.
//!
//! Each closed shell is a `Building` whose geometry is a `Solid`; the faces of all others are the
//! `MultiSurface` of one more. Junctions lie on all planes of their faces, as in STEP; what is
//! round has chains of straight pieces, and round faces are triangles. A shell has no cavities
//! here, so no solid has an inner shell.
//!
//! The format means metres and z upward, in a reference system that the file names. No scene
//! knows its own: numbers stay as they are but for turning [`ExportOptions::up`] to +z, and the
//! file names no system.
//!
//! [`ExportOptions::up`]: crate::ExportOptions::up

mod polygon;
mod surface_type;
mod vertices;

use crate::ExportError;
use crate::target::Target;
use nalgebra::Matrix3;
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{CurveIndex, Shell};
use polygon::{Polygon, polygons};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use surface_type::surface_types;
use vertices::Vertices;

/// Level of detail: roofs have their shape, and walls are planes.
const LOD: &str = "2";

/// Writes a CityJSON file.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let (document, turn) = (to.document, to.options.up.to_z());
    let buildings = buildings(document, &turn);
    let points = (buildings.iter()).flat_map(|building| &building.polygons);
    let points = points.flat_map(|polygon| polygon.rings.iter().flatten());
    let mut vertices = Vertices::around(points).ok_or_else(|| to.out_of_range())?;
    let mut objects = Map::new();
    let bottom = bottom(buildings.iter().flat_map(|building| &building.polygons));
    for (number, building) in buildings.iter().enumerate() {
        // Sheets stand on nothing of their own.
        let bottom = match building.closed {
            true => self::bottom(&building.polygons),
            false => bottom,
        };
        let geometry = geometry(building, bottom, &mut vertices);
        let object = json!({"type": "Building", "geometry": [geometry]});
        objects.insert(format!("building-{}", number + 1), object);
    }
    let mut metadata = json!({"title": to.title()});
    if let Some(extent) = vertices.extent() {
        metadata["geographicalExtent"] = json!(extent);
    }
    let file = json!({
        "type": "CityJSON",
        "version": "2.0",
        "metadata": metadata,
        "transform": vertices.transform(),
        "CityObjects": objects,
        "vertices": vertices.whole_numbers(),
    });
    to.write(format!("{file}\n"))?;
    let [edges, arcs, splines] = bounding_nothing(document);
    to.leave_out(edges, "CityJSON has no edges without faces");
    to.leave_out(arcs, "CityJSON has no arcs without faces");
    to.written.arcs -= arcs;
    to.leave_out(splines, "CityJSON has no splines without faces");
    to.written.splines -= splines;
    Ok(())
}

/// What becomes one `Building`.
struct Building {
    /// Whether it is one closed shell.
    closed: bool,
    polygons: Vec<Polygon>,
}

fn buildings(document: &WireframeDocument, turn: &Matrix3<f64>) -> Vec<Building> {
    let mut buildings = Vec::new();
    let mut sheets = Vec::new();
    let mut first_face = 0;
    for shell in &document.shells {
        let polygons = polygons(shell, document, first_face, turn);
        first_face += shell.faces.len();
        if shell.closed {
            buildings.push(Building {
                closed: true,
                polygons,
            });
        } else {
            sheets.extend(polygons);
        }
    }
    if !sheets.is_empty() {
        buildings.push(Building {
            closed: false,
            polygons: sheets,
        });
    }
    buildings
}

/// The lowest height of all.
fn bottom<'a>(polygons: impl IntoIterator<Item = &'a Polygon>) -> f64 {
    let rings = polygons.into_iter().flat_map(|polygon| &polygon.rings);
    rings
        .flatten()
        .map(|point| point.z)
        .fold(f64::MAX, f64::min)
}

/// The geometry of a building, and what each of its surfaces is.
fn geometry(building: &Building, bottom: f64, vertices: &mut Vertices) -> Value {
    let types = surface_types(&building.polygons, bottom);
    let mut surfaces: Vec<Value> = Vec::new();
    let (mut boundaries, mut values) = (Vec::new(), Vec::new());
    for (polygon, surface_type) in building.polygons.iter().zip(types) {
        let Some(rings) = vertices.rings(&polygon.rings) else {
            continue;
        };
        // The triangles of a round face that are alike are one surface.
        let surface = json!({"type": surface_type.name(), "face": polygon.face});
        if surfaces.last() != Some(&surface) {
            surfaces.push(surface);
        }
        boundaries.push(rings);
        values.push(surfaces.len() - 1);
    }
    let (kind, boundaries, values) = match building.closed {
        true => ("Solid", json!([boundaries]), json!([values])),
        false => ("MultiSurface", json!(boundaries), json!(values)),
    };
    json!({
        "type": kind,
        "lod": LOD,
        "boundaries": boundaries,
        "semantics": {"surfaces": surfaces, "values": values},
    })
}

/// How many edges, arcs and splines bound no face.
fn bounding_nothing(document: &WireframeDocument) -> [usize; 3] {
    let bounding: BTreeSet<CurveIndex> = document.shells.iter().flat_map(Shell::curves).collect();
    let is_free = |curve: &CurveIndex| !bounding.contains(curve);
    [
        (0..document.edges.len())
            .map(CurveIndex::Edge)
            .filter(is_free)
            .count(),
        (0..document.arcs.len())
            .map(CurveIndex::Arc)
            .filter(is_free)
            .count(),
        (0..document.splines.len())
            .map(CurveIndex::Spline)
            .filter(is_free)
            .count(),
    ]
}
