//! How sure edges are that solids have added to a wireframe.

use super::Confidence;
use crate::faces::Completed;

impl Confidence {
    /// Of a completed wireframe, of which this is what images say, with what was known `before`: an edge is
    /// as sure as the surest piece by which it was found, and one that no image shows as the least sure
    /// of those that it joins.
    ///
    /// # Panics
    /// If either is of another wireframe.
    pub fn of_completed(mut self, completed: &Completed, before: &Self) -> Self {
        let edges = || completed.wireframe.edges.iter().zip(completed.inferred());
        for (edge, sources) in self.edges.iter_mut().zip(&completed.sources) {
            let pieces = sources.iter().map(|piece| before.edges[*piece].probability);
            edge.probability = pieces.fold(edge.probability, f64::max);
        }
        let mut least = vec![f64::INFINITY; completed.wireframe.junctions.len()];
        let mut unknown = Vec::new();
        for (place, (ends, inferred)) in edges().enumerate() {
            match inferred {
                true => unknown.push(place),
                false => lower(&mut least, ends, self.edges[place].probability),
            }
        }
        // From those that images show on to those that join only others that are inferred.
        loop {
            let joined = |place: &usize| {
                let [a, b] = completed.wireframe.edges[*place].map(|end| least[end]);
                Some(a.min(b)).filter(|least| least.is_finite())
            };
            let known: Vec<(usize, f64)> = (unknown.iter())
                .filter_map(|place| Some((*place, joined(place)?)))
                .collect();
            if known.is_empty() {
                break;
            }
            unknown.retain(|place| known.iter().all(|(other, _)| other != place));
            for (place, probability) in known {
                self.edges[place].probability = probability;
                lower(&mut least, &completed.wireframe.edges[place], probability);
            }
        }
        self
    }
}

fn lower(least: &mut [f64], ends: &[usize; 2], to: f64) {
    for end in ends {
        least[*end] = least[*end].min(to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::confidence::DetectionNoise;
    use crate::confidence::EdgeConfidence;
    use nalgebra::Vector3;
    use neat_core::Wireframe3d;

    fn of_edges(probabilities: &[f64]) -> Confidence {
        let edge = |probability: &f64| EdgeConfidence {
            probability: *probability,
            ..EdgeConfidence::default()
        };
        Confidence {
            junctions: Vec::new(),
            edges: probabilities.iter().map(edge).collect(),
            noise: DetectionNoise {
                vertex: 1.0,
                across: 1.0,
                along: 1.0,
            },
            scene_radius: 1.0,
            tolerance_in_pixels: 1.0,
        }
    }

    #[test]
    fn inferred_edges_are_as_sure_as_those_that_they_join() {
        // A path of an edge, one of two pieces and two inferred ones, and two inferred ones alone.
        let completed = Completed {
            wireframe: Wireframe3d {
                junctions: vec![Vector3::zeros(); 8],
                edges: vec![[0, 1], [1, 2], [2, 3], [3, 4], [5, 6], [6, 7]],
            },
            sources: vec![vec![0], vec![1, 2], vec![], vec![], vec![], vec![]],
        };
        let before = of_edges(&[0.9, 0.6, 0.8]);
        let images = of_edges(&[0.95, 0.2, 0.01, 0.04, 0.02, 0.03]);
        let after = images.of_completed(&completed, &before);
        let found: Vec<f64> = after.edges.iter().map(|edge| edge.probability).collect();
        assert_eq!(found, [0.95, 0.8, 0.8, 0.8, 0.02, 0.03]);
    }
}
