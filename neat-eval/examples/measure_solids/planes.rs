//! The planes of walls and roofs beside those of the surface.

use crate::Result;
use nalgebra::Vector3;
use neat_eval::{FoundFace, PlaneOffset, SceneFaces, SceneTruth};
use neat_wireframe::faces::Surface;
use std::fmt::Write;

/// Faces are listed from this area on, in m² of a house.
const MIN_AREA: f64 = 1.0;
/// What a plane of a building should agree to, in m of a house and in degrees.
const GOAL: [f64; 2] = [0.02, 1.0];
/// Sine of the angle up to which a plane is upright, or level: 10°.
const STRAIGHT: f64 = 0.1736;

/// Rendered scenes have z upward.
fn kind(normal: &Vector3<f64>) -> &'static str {
    if normal.z.abs() <= STRAIGHT {
        "wall"
    } else if normal.xy().norm() <= STRAIGHT {
        "level"
    } else {
        "roof"
    }
}

/// A plane face with its corners moved onto its plane: they lie off it by the noise of junctions.
pub fn flattened(face: &FoundFace) -> FoundFace {
    let onto = |point: Vector3<f64>| match face.surface {
        Surface::Plane { normal, offset } => point - normal * (normal.dot(&point) - offset),
        _ => point,
    };
    FoundFace {
        triangles: (face.triangles.iter())
            .map(|triangle| triangle.map(onto))
            .collect(),
        ..face.clone()
    }
}

/// Scenes are in metres: a line for each large face, the largest first, and one for all of a kind.
pub fn table(faces: &[FoundFace], truth: &SceneTruth) -> Result<String> {
    let offsets = SceneFaces::default().plane_offsets(faces, truth)?;
    let [goal, angle] = [GOAL[0] * truth.scale, GOAL[1]];
    let reaches = |found: &PlaneOffset| found.offset <= goal && found.angle <= angle;
    let mut planes: Vec<(f64, &str, Option<PlaneOffset>)> = (faces.iter().zip(offsets))
        .filter(|(face, _)| face.area >= MIN_AREA * truth.scale.powi(2))
        .filter_map(|(face, offset)| {
            let Surface::Plane { normal, .. } = &face.surface else {
                return None;
            };
            let normal = offset.map_or(*normal, |offset| offset.normal);
            Some((face.area, kind(&normal), offset))
        })
        .collect();
    planes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut text = String::new();
    for (area, kind, offset) in &planes {
        write!(text, "\n  {kind:5} {area:8.3}: ")?;
        match offset {
            Some(found) => write!(text, "{:.3} cm, {:.3}°", 100.0 * found.offset, found.angle)?,
            None => write!(text, "along no planar part of the surface")?,
        }
    }
    for kind in ["wall", "roof", "level"] {
        let of_kind = || planes.iter().filter(|plane| plane.1 == kind);
        let right = || of_kind().filter(|plane| plane.2.as_ref().is_some_and(reaches));
        write!(
            text,
            "\n  {kind:5}: {} of {} faces and {:.2} of {:.2} of their area within {} cm and {angle}°",
            right().count(),
            of_kind().count(),
            right().fold(0.0, |sum, plane| sum + plane.0),
            of_kind().fold(0.0, |sum, plane| sum + plane.0),
            100.0 * goal
        )?;
    }
    Ok(text)
}
