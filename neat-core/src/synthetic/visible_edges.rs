//! Exact hidden-line removal.

use super::Frustum;
use super::round_face::real_roots;
use crate::{Camera, CircularArc, LineSegment2, LineSegment3, Ray};
use nalgebra::Vector3;

/// A stretch of an edge that a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePart {
    /// Which edge of the solid's wireframe.
    pub edge: usize,
    /// Parameters of both ends on that edge: 0 is its first junction, 1 its second.
    pub range: [f64; 2],
    /// The junction at each end; `None` where another part of the solid cuts
    /// the edge off (a T-junction of the image).
    pub junctions: [Option<usize>; 2],
    /// The part in the image, in image coordinates.
    pub segment: LineSegment2,
}

/// Nearer to a point by this share of its distance, a round face that holds the point does not hide it.
const AT_THE_POINT: f64 = 1e-9;
/// Pieces of an edge shorter than this share of it are rounding.
const MIN_PIECE: f64 = 1e-9;

/// The visible parts of all straight edges, by edge and then along the edge. The camera
/// must be outside the solid, with all of it in front.
///
/// Nothing is sampled: seen from the camera, an edge can appear or disappear
/// only where it meets the plane of a face, the plane through the camera and
/// another edge or a line in which a round face turns away, or the cone through the camera and
/// an arc. Between two such cuts one test decides.
pub fn visible_parts(solid: &Frustum, camera: &Camera) -> Vec<VisiblePart> {
    let wireframe = solid.wireframe();
    (0..wireframe.edges.len())
        .flat_map(|edge| {
            visible_ranges(solid, camera, edge)
                .into_iter()
                .map(move |range| visible_part(solid, camera, edge, range))
        })
        .collect()
}

/// The part of an edge within a visible parameter range.
fn visible_part(solid: &Frustum, camera: &Camera, edge: usize, range: [f64; 2]) -> VisiblePart {
    let wireframe = solid.wireframe();
    let [a, b] = wireframe.edges[edge];
    let junctions = [
        (range[0] == 0.0).then_some(a),
        (range[1] == 1.0).then_some(b),
    ];
    let [start, end] = [0, 1].map(|end| {
        // The junction itself: interpolation would round it differently for
        // each of its edges.
        let point_in_world = match junctions[end] {
            Some(junction) => wireframe.junctions[junction],
            None => wireframe.segment(edge).point_at(range[end]),
        };
        camera.project(&point_in_world).pixel
    });
    VisiblePart {
        edge,
        range,
        junctions,
        segment: LineSegment2::new(start, end),
    }
}

/// Maximal visible parameter ranges of one edge, in ascending order.
fn visible_ranges(solid: &Frustum, camera: &Camera, edge: usize) -> Vec<[f64; 2]> {
    let segment = solid.wireframe().segment(edge);
    let mut ranges: Vec<[f64; 2]> = Vec::new();
    for piece in cuts(solid, camera, edge).windows(2) {
        let middle = segment.point_at((piece[0] + piece[1]) / 2.0);
        if is_hidden(solid, camera, edge, &middle) {
            continue;
        }
        match ranges.last_mut() {
            Some(last) if last[1] == piece[0] => last[1] = piece[1],
            _ => ranges.push([piece[0], piece[1]]),
        }
    }
    ranges
}

/// 0, 1 and the parameters between at which visibility may change, ascending.
fn cuts(solid: &Frustum, camera: &Camera, edge: usize) -> Vec<f64> {
    let segment = solid.wireframe().segment(edge);
    let direction = segment.end - segment.start;
    let center = camera.center_in_world;
    let face_planes = solid
        .faces()
        .iter()
        .map(|face| (face.outline[0], face.normal));
    let shadow_planes = solid.wireframe().segments().into_iter().map(|other| {
        let normal = (other.start - center).cross(&(other.end - center));
        (center, normal)
    });
    let turning_planes = (solid.round_faces().iter())
        .flat_map(|face| face.tangent_planes(&center))
        .map(|normal| (center, normal));
    let shadow_cones = solid
        .arcs()
        .iter()
        .flat_map(|arc| cone_cuts(arc, &center, &segment));
    let mut cuts: Vec<f64> = face_planes
        .chain(shadow_planes)
        .chain(turning_planes)
        .map(|(point, normal)| (point - segment.start).dot(&normal) / direction.dot(&normal))
        .chain(shadow_cones)
        .filter(|t| (MIN_PIECE..1.0 - MIN_PIECE).contains(t))
        .chain([0.0, 1.0])
        .collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|later, earlier| *later - *earlier < MIN_PIECE);
    cuts
}

/// The parameters at which the line of a segment meets the cone through an eye and a circle.
fn cone_cuts(arc: &CircularArc, eye: &Vector3<f64>, segment: &LineSegment3) -> Vec<f64> {
    let (normal, to_center) = (arc.normal(), arc.center - eye);
    let rise = to_center.dot(&normal);
    // A direction d from the eye meets the plane of the circle at d · rise / (d · normal), which is as far
    // from its centre as its radius. Of start and direction of the segment, times d · normal:
    let [at, along] = [segment.start - eye, segment.end - segment.start].map(|d| {
        let height = d.dot(&normal);
        (d * rise - to_center * height, arc.radius * height)
    });
    real_roots(
        along.0.norm_squared() - along.1 * along.1,
        at.0.dot(&along.0) - at.1 * along.1,
        at.0.norm_squared() - at.1 * at.1,
    )
}

/// Whether a face that does not carry the edge, or a round one before it, stands between camera and point.
fn is_hidden(solid: &Frustum, camera: &Camera, edge: usize, point: &Vector3<f64>) -> bool {
    let offset = point - camera.center_in_world;
    let distance = offset.norm();
    let ray = Ray {
        origin: camera.center_in_world,
        direction: offset / distance,
    };
    let hides = |crossing: f64| crossing < distance * (1.0 - AT_THE_POINT);
    let flat = (solid.faces().iter())
        .filter(|face| !face.contains_edge(&solid.wireframe().edges[edge]))
        .any(|face| {
            face.intersect(&ray)
                .is_some_and(|crossing| crossing < distance)
        });
    flat || (solid.round_faces().iter()).any(|face| face.intersect(&ray).is_some_and(hides))
}
