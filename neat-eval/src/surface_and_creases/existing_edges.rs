//! Which edges of a wireframe exist: what a probability of existence is held to.

use super::line_samples::{LineCover, LineSamples};
use super::{SceneTruth, SurfaceAndCreases};
use crate::EvalError;
use neat_core::LineSegment3;

/// Samples within a tolerance along an edge: the share of it that follows a line is known to
/// a fourth of the tolerance.
const SAMPLES_PER_TOLERANCE: f64 = 4.0;

/// Whether each edge exists: `lines` lie along more than half of it, at most `tolerance` away
/// and turned by at most `max_angle` degrees. Edges without a length do not exist.
///
/// # Errors
/// If edges or lines are so long that something else must be meant.
pub fn existing_edges(
    edges: &[LineSegment3],
    lines: &[LineSegment3],
    tolerance: f64,
    max_angle: f64,
) -> Result<Vec<bool>, EvalError> {
    let samples = LineSamples::new(edges, tolerance / SAMPLES_PER_TOLERANCE, "result")?;
    let cover = LineCover::new(lines, tolerance, max_angle, "truth")?;
    let distances = samples.distances(&cover);
    // How much of each edge follows a line, less what does not.
    let mut balance = vec![0_i64; edges.len()];
    samples.length_of(|sample, edge| {
        let follows = distances[sample].is_some_and(|distance| distance <= tolerance);
        balance[edge] += if follows { 1 } else { -1 };
        follows
    });
    Ok(balance.into_iter().map(|balance| balance > 0).collect())
}

impl SurfaceAndCreases {
    /// [`existing_edges`] by the middle threshold. Painted lines exist like straight creases:
    /// the images show them where they are.
    ///
    /// # Errors
    /// If edges or truth are so long that something else must be meant.
    pub fn existing_edges(
        &self,
        edges: &[LineSegment3],
        truth: &SceneTruth,
    ) -> Result<Vec<bool>, EvalError> {
        let mut lines = truth.wireframe.segments();
        lines.extend(&truth.texture_lines);
        let middle = self.thresholds.get(self.thresholds.len() / 2).copied();
        let tolerance = middle.unwrap_or(0.0) * truth.scale;
        existing_edges(edges, &lines, tolerance, self.max_angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Wireframe3d;

    fn line(start: [f64; 3], end: [f64; 3]) -> LineSegment3 {
        LineSegment3::new(start.into(), end.into())
    }

    #[test]
    fn more_than_half_of_an_edge_follows_a_line() {
        let lines = [line([0.0; 3], [1.0, 0.0, 0.0])];
        let edges = [
            line([0.5, 0.009, 0.0], [1.4, 0.009, 0.0]),
            line([0.5, 0.009, 0.0], [1.6, 0.009, 0.0]),
            line([0.0, 0.011, 0.0], [1.0, 0.011, 0.0]),
            // Crosses it.
            line([0.5, -0.005, 0.0], [0.5, 0.005, 0.0]),
            line([0.5, 0.0, 0.0], [0.5, 0.0, 0.0]),
            line([0.3, 0.0, 0.0], [0.1, 0.0, 0.0]),
        ];
        let found = existing_edges(&edges, &lines, 0.01, 10.0).unwrap();
        assert_eq!(found, [true, false, false, false, false, true]);
    }

    #[test]
    fn painted_lines_exist_and_the_scale_is_that_of_the_scene() {
        let truth = SceneTruth {
            scale: 0.1,
            wireframe: Wireframe3d {
                junctions: vec![[0.0; 3].into(), [1.0, 0.0, 0.0].into()],
                edges: vec![[0, 1]],
            },
            texture_lines: vec![line([0.0, 1.0, 0.0], [1.0, 1.0, 0.0])],
            ..SceneTruth::default()
        };
        let at = |y: f64| line([0.0, y, 0.0], [1.0, y, 0.0]);
        let edges = [at(0.0015), at(0.0025), at(1.0015), at(1.0025), at(0.5)];
        let protocol = SurfaceAndCreases::default();
        let found = protocol.existing_edges(&edges, &truth).unwrap();
        assert_eq!(found, [true, false, true, false, false]);
    }
}
