//! How many global junctions a scene asks for.

use neat_core::Wireframe2d;

/// A view with more junctions than this share of the views stands for the scene:
/// most views see only a part of it, and a few are full of false segments.
const QUANTILE: f64 = 0.9;
/// Latents per junction of that view. It sees about half of the junctions, and
/// rendered ends scatter around each: those that find no latent teach nothing. With 4, which
/// gives about the published 64 for ABC and 1024 for DTU, junctions alone find .941 of the
/// corners of seven objects in the preset `neat`, with 12 they find .961.
const LATENTS_PER_JUNCTION: usize = 12;
/// Numbers are rounded up to a multiple of this.
const STEP: usize = 8;
/// The assignment of 50 ends to 1024 junctions takes 0.2 ms, a fiftieth of a step.
const LIMITS: [usize; 2] = [16, 1024];

/// The number of latents for 2D wireframes, of which edges with a score above
/// `min_score` count.
pub(super) fn latents_for<'a>(
    wireframes: impl Iterator<Item = &'a Wireframe2d>,
    min_score: f64,
) -> usize {
    let mut counts: Vec<usize> = wireframes
        .map(|wireframe| joined_vertices(wireframe, min_score))
        .collect();
    counts.sort_unstable();
    let rank = (QUANTILE * counts.len().saturating_sub(1) as f64).round() as usize;
    let junctions = counts.get(rank).copied().unwrap_or(0);
    (LATENTS_PER_JUNCTION * junctions)
        .next_multiple_of(STEP)
        .clamp(LIMITS[0], LIMITS[1])
}

/// Vertices where at least two edges end; a lone end is rarely a junction, but
/// where a segment broke off.
fn joined_vertices(wireframe: &Wireframe2d, min_score: f64) -> usize {
    let mut edges_at = vec![0; wireframe.vertices.len()];
    for (edge, score) in wireframe.edges.iter().zip(&wireframe.edge_scores) {
        if *score > min_score {
            for vertex in edge {
                edges_at[*vertex] += 1;
            }
        }
    }
    edges_at.into_iter().filter(|edges| *edges >= 2).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// A closed ring of `junctions` vertices, an edge that meets nothing, and one
    /// that no one believes.
    fn ring(junctions: usize) -> Wireframe2d {
        let vertices = junctions + 2;
        let mut edges: Vec<[usize; 2]> = (0..junctions).map(|i| [i, (i + 1) % junctions]).collect();
        edges.extend([[junctions, junctions + 1]; 2]);
        let mut edge_scores = vec![0.9; edges.len()];
        edge_scores[junctions] = 0.01;
        Wireframe2d {
            vertices: vec![Vector2::zeros(); vertices],
            vertex_scores: vec![1.0; vertices],
            edges,
            edge_scores,
            width: 8,
            height: 8,
        }
    }

    #[test]
    fn a_well_filled_view_tells_the_number() {
        // One view in ten is full of false segments.
        let mut views = vec![ring(11); 10];
        views[3] = ring(500);
        assert_eq!(latents_for(views.iter(), 0.05), 136);
        // And most see little.
        let mut views = vec![ring(3); 10];
        views[4] = ring(20);
        views[7] = ring(20);
        assert_eq!(latents_for(views.iter(), 0.05), 240);
        assert_eq!(latents_for([ring(1)].iter(), 0.05), LIMITS[0]);
        assert_eq!(latents_for([ring(3000)].iter(), 0.05), LIMITS[1]);
        assert_eq!(latents_for([].into_iter(), 0.05), LIMITS[0]);
    }
}
