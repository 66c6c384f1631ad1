//! An imitation of a wireframe detector: exact visible parts in, a noisy and
//! incomplete 2D wireframe out.

use super::random::{Purpose, gaussian_pair, stream};
use super::{SyntheticScene, VisiblePart};
use crate::Wireframe2d;
use nalgebra::Vector2;
use rand::RngExt;

/// The lowest score: just above the 0.05 that the published code asks of a
/// segment, so that every false one does its harm.
const MIN_SCORE: f64 = 0.06;

/// The 2D wireframe of one view, and for each of its edges the index into
/// `visible` that it shows (`None` for a false segment).
///
/// As in HAWP's wireframes, edges that meet in a true junction share its
/// vertex; ends cut off by occlusion have vertices of their own. False segments
/// lie anywhere in the rectangle `bounds` around the object.
pub(super) fn detect(
    visible: &[VisiblePart],
    config: &SyntheticScene,
    view: usize,
    bounds: [Vector2<f64>; 2],
) -> (Wireframe2d, Vec<Option<usize>>) {
    let mut detection = stream(config.seed, view, Purpose::Detection);
    let mut noise = stream(config.seed, view, Purpose::Noise);
    let mut score = stream(config.seed, view, Purpose::Score);
    let mut clutter = stream(config.seed, view, Purpose::FalseSegment);

    let (width, height) = config.size();
    let size = Vector2::new(f64::from(width), f64::from(height));
    let mut wireframe = Wireframe2d::empty(width, height);
    let mut sources = Vec::new();
    let mut junction_vertices: Vec<(usize, usize)> = Vec::new();

    for (source, part) in visible.iter().enumerate() {
        if detection.random::<f64>() >= config.detection_rate {
            continue;
        }
        let mut add_vertex = |junction: Option<usize>, exact: Vector2<f64>| {
            let known = junction_vertices
                .iter()
                .find(|(known, _)| Some(*known) == junction);
            if let Some((_, vertex)) = known {
                return *vertex;
            }
            let noisy = exact + gaussian_pair(&mut noise) * config.noise_in_pixels;
            let inside = noisy.sup(&Vector2::zeros()).inf(&size);
            let vertex = wireframe.push_vertex(inside, high_score(score.random()));
            junction_vertices.extend(junction.map(|junction| (junction, vertex)));
            vertex
        };
        let [start, end] = part.junctions;
        let edge = [
            add_vertex(start, part.segment.start),
            add_vertex(end, part.segment.end),
        ];
        wireframe.push_edge(edge, high_score(score.random()));
        sources.push(Some(source));
    }

    for _ in 0..config.false_segments {
        let edge = [(); 2].map(|()| {
            let [lower, upper] = bounds;
            let position = lower + (upper - lower).map(|extent| extent * clutter.random::<f64>());
            wireframe.push_vertex(position, low_score(clutter.random()))
        });
        wireframe.push_edge(edge, low_score(clutter.random()));
        sources.push(None);
    }
    (wireframe, sources)
}

/// Adds a vertex and returns its index.
/// From u in [0, 1) to a score in (0.06, 1], 0.94 in the median.
fn high_score(u: f64) -> f64 {
    1.0 - (1.0 - MIN_SCORE) * u.powi(4)
}

/// From u in [0, 1) to a score in [0.06, 1], 0.12 in the median.
fn low_score(u: f64) -> f64 {
    MIN_SCORE + (1.0 - MIN_SCORE) * (1.0 - u).powi(4)
}
