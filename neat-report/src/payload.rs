//! The data of a report as the page reads it: JSON with short lists.

use crate::{Curve, JunctionSnapshot, Report, ReportView};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use neat_wireframe::export::{EdgeFields, JunctionFields, WireframeDocument};
use neat_wireframe::faces::{CurveIndex, Step};
use serde::Serialize;
use std::collections::BTreeMap;

/// The root of the JSON. `src/page/data.js` reads it.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Payload<'a> {
    title: &'a str,
    junctions: &'a [Vector3<f64>],
    edges: &'a [[usize; 2]],
    /// Points along each arc, and behind them along each spline.
    arcs: Vec<Vec<Vector3<f64>>>,
    /// Points along rims of domes and within faces, for their triangles.
    within: Vec<Vector3<f64>>,
    faces: Vec<FacePayload>,
    junction_fields: &'a JunctionFields,
    edge_fields: &'a EdgeFields,
    /// Largest standard deviation of each junction, where it is known.
    sigmas: Vec<Option<f64>>,
    /// (view, [x, y, x, y] from the image corner, residual) for every edge.
    support: Vec<Vec<(usize, [f64; 4], f64)>>,
    views: Vec<ViewPayload<'a>>,
    evolution: Vec<SnapshotPayload>,
    curves: Vec<CurvePayload<'a>>,
    configuration: &'a str,
    facts: Vec<(&'a str, &'a [(String, String)])>,
    warnings: &'a [String],
}

#[derive(Serialize)]
struct FacePayload {
    /// That bound it, with those of its holes.
    edges: Vec<usize>,
    /// Of the junctions, and behind them the points of the arcs and splines, the first of a closed one
    /// once, and those of `within`.
    triangles: Vec<[usize; 3]>,
}

#[derive(Serialize)]
struct ViewPayload<'a> {
    name: &'a str,
    size: [u32; 2],
    /// fx, fy, cx, cy, skew; the principal point counts from the image corner.
    intrinsics: [f64; 5],
    /// Of the camera in the user's frame, row by row.
    rotation: [[f64; 3]; 3],
    center: Vector3<f64>,
    /// JPEG in base64.
    photograph: Option<String>,
    /// [x, y, x, y] from the image corner.
    segments: Vec<[f64; 4]>,
}

#[derive(Serialize)]
struct SnapshotPayload {
    step: u64,
    /// Little-endian f32 in base64: half the size of decimals.
    junctions: String,
}

#[derive(Serialize)]
struct CurvePayload<'a> {
    name: &'a str,
    /// A value that is not finite becomes `null`.
    points: Vec<(u64, f64)>,
}

impl<'a> Payload<'a> {
    /// Of a report that was checked.
    pub fn new(report: &'a Report) -> Self {
        let document = &report.document;
        let index_of: BTreeMap<&str, usize> = (report.views.iter().enumerate())
            .map(|(index, view)| (view.name.as_str(), index))
            .collect();
        let to_corner = 0.5 - report.pixel_center;
        let from_corner = |[x, y, z, w]: [f64; 4]| [x, y, z, w].map(|c| rounded(c + to_corner));
        let support = (document.edge_support.iter())
            .map(|segments| {
                let known = segments.iter().filter_map(|support| {
                    let view = *index_of.get(document.views[support.view].as_str())?;
                    let residual = rounded(support.residual);
                    Some((view, from_corner(support.segment), residual))
                });
                known.collect()
            })
            .collect();
        Self {
            title: &report.title,
            junctions: &document.junctions,
            edges: &document.edges,
            arcs: document.drawn_curves().collect(),
            within: document.points_within_faces(),
            faces: faces(document),
            junction_fields: &document.junction_fields,
            edge_fields: &document.edge_fields,
            sigmas: sigmas(report),
            support,
            views: (report.views.iter())
                .map(|view| ViewPayload::new(view, to_corner))
                .collect(),
            evolution: evenly(&report.junction_evolution, Report::MAX_SNAPSHOTS)
                .map(SnapshotPayload::new)
                .collect(),
            curves: report.curves.iter().map(CurvePayload::new).collect(),
            configuration: &report.configuration,
            facts: (report.facts.iter())
                .map(|group| (group.heading.as_str(), group.facts.as_slice()))
                .collect(),
            warnings: &report.warnings,
        }
    }
}

impl<'a> ViewPayload<'a> {
    fn new(view: &'a ReportView, to_corner: f64) -> Self {
        let camera = &view.camera;
        let k = &camera.intrinsics;
        let row = |row: usize| [0, 1, 2].map(|column| camera.world_from_camera[(row, column)]);
        let segments = view.segments.iter().map(|segment| {
            let [a, b] = segment.ends();
            [a.x, a.y, b.x, b.y].map(|c| rounded(c + to_corner))
        });
        Self {
            name: &view.name,
            size: [camera.width, camera.height],
            intrinsics: [k.fx, k.fy, k.cx + to_corner, k.cy + to_corner, k.skew],
            rotation: [0, 1, 2].map(row),
            center: camera.center_in_world,
            photograph: (view.photograph.as_ref())
                .map(|photograph| BASE64_STANDARD.encode(&photograph.jpeg)),
            segments: segments.collect(),
        }
    }
}

impl SnapshotPayload {
    fn new(snapshot: &JunctionSnapshot) -> Self {
        let numbers = snapshot.junctions.iter().flatten();
        let bytes: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
        Self {
            step: snapshot.step,
            junctions: BASE64_STANDARD.encode(bytes),
        }
    }
}

impl<'a> CurvePayload<'a> {
    fn new(curve: &'a Curve) -> Self {
        Self {
            name: &curve.name,
            points: thinned(&curve.points, Report::MAX_CURVE_POINTS),
        }
    }
}

fn faces(document: &WireframeDocument) -> Vec<FacePayload> {
    let faces = document.shells.iter().flat_map(|shell| &shell.faces);
    let edge = |step: &Step| match step.curve {
        CurveIndex::Edge(edge) => Some(edge),
        CurveIndex::Arc(_) | CurveIndex::Spline(_) | CurveIndex::Smooth(_) | CurveIndex::Rim(_) => {
            None
        }
    };
    (faces.zip(document.triangles_of_faces()))
        .map(|(face, triangles)| FacePayload {
            edges: face.loops.iter().flatten().filter_map(edge).collect(),
            triangles,
        })
        .collect()
}

/// A hundredth of a pixel is finer than any detector.
fn rounded(pixels: f64) -> f64 {
    (pixels * 100.0).round() / 100.0
}

/// The field `sigma` of the junctions, or else the square root of the largest
/// eigenvalue of each covariance.
fn sigmas(report: &Report) -> Vec<Option<f64>> {
    let document = &report.document;
    if let Some(sigmas) = &document.junction_fields.sigma {
        return sigmas.iter().copied().map(Some).collect();
    }
    let largest = |&[xx, xy, xz, yy, yz, zz]: &[f64; 6]| {
        let covariance = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let eigenvalues = SymmetricEigen::new(covariance).eigenvalues;
        eigenvalues.max().max(0.0).sqrt()
    };
    (document.junction_covariances.iter())
        .map(|covariance| covariance.as_ref().map(largest))
        .collect()
}

/// At most `count` of the items, spread evenly, with the first and the last.
fn evenly<T>(items: &[T], count: usize) -> impl Iterator<Item = &T> {
    let kept = count.min(items.len());
    let last = items.len().saturating_sub(1);
    (0..kept).map(move |i| &items[i * last / kept.saturating_sub(1).max(1)])
}

/// At most `count` points of a curve: the lowest and the highest of every stretch,
/// so that no peak is lost.
fn thinned(points: &[(u64, f64)], count: usize) -> Vec<(u64, f64)> {
    if points.len() <= count {
        return points.to_vec();
    }
    let stretch = points.len().div_ceil((count / 2).max(1));
    let extremes = |points: &[(u64, f64)]| {
        let by_value = |a: &&(u64, f64), b: &&(u64, f64)| a.1.total_cmp(&b.1);
        let (low, high) = (
            points.iter().min_by(by_value),
            points.iter().max_by(by_value),
        );
        let mut kept: Vec<_> = low.into_iter().chain(high).copied().collect();
        kept.sort_by_key(|point| point.0);
        kept.dedup_by_key(|point| point.0);
        kept
    };
    points.chunks(stretch).flat_map(extremes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_thinned() {
        let items: Vec<usize> = (0..1000).collect();
        let kept: Vec<_> = evenly(&items, 60).copied().collect();
        assert_eq!((kept.len(), kept[0], kept[59]), (60, 0, 999));
        assert_eq!(evenly(&items[..3], 60).count(), 3);
        assert_eq!(evenly(&items[..0], 60).count(), 0);
        assert_eq!(evenly(&items, 1).copied().collect::<Vec<_>>(), [0]);

        let mut curve: Vec<(u64, f64)> = (0..10_000).map(|i| (i, 1.0)).collect();
        curve[1234].1 = 50.0;
        curve[4321].1 = -50.0;
        let kept = thinned(&curve, 600);
        assert!(kept.len() <= 600);
        assert!(kept.contains(&(1234, 50.0)) && kept.contains(&(4321, -50.0)));
        assert!(kept.is_sorted_by_key(|point| point.0));
        assert_eq!(thinned(&curve[..5], 600), curve[..5]);
    }

    #[test]
    fn sigma_is_the_longest_half_axis() {
        let mut report = Report::default();
        report.document.junctions = vec![Vector3::zeros(); 2];
        report.document.junction_covariances = vec![Some([1.0, 0.0, 0.0, 4.0, 0.0, 9.0]), None];
        let found = sigmas(&report);
        assert!((found[0].unwrap() - 3.0).abs() < 1e-12);
        assert_eq!(found[1], None);
        report.document.junction_fields.sigma = Some(vec![0.5, 0.25]);
        assert_eq!(sigmas(&report), [Some(0.5), Some(0.25)]);
    }
}
