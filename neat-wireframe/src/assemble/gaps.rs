//! Gaps in lines, where the views that show a line do not show it.
//!
//! Pieces of one line that end near each other are taken for one line that something hides in many
//! views. Where edges of others end on both sides of such a gap, the line is cut there, and the light
//! says whether anything lies between; of more than a few pixels edgels must not, either.

use super::collinear_pieces::MAX_GAP;
use super::edge_cutting::retain_edges;
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use super::profiles::{Asked, Photographs, Response, light_across};
use neat_core::{LineSegment3, Wireframe3d};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The pieces end at corners, before which edgels stop by so many pixels on either side.
const BEYOND_EDGELS: f64 = 2.0;

/// Takes away the pieces of a wireframe that lie between two others of the same line and that the
/// views which show the line speak against. `sources` are the lines of the edges, of `lines`.
pub(super) fn drop_gaps(
    images: &Images,
    (photographs, response): (Photographs<'_>, Response),
    lines: &[ChosenLine],
    wireframe: &mut Wireframe3d,
    sources: &mut Vec<Option<usize>>,
) {
    let asked = |edge: usize| {
        let [start, end] = wireframe.edges[edge].map(|end| wireframe.junctions[end]);
        let (piece, line) = (LineSegment3::new(start, end), &lines[sources[edge]?]);
        let pixel = images.pixel_size(&piece, line.evidence.views());
        let is_short = piece.length() <= (MAX_GAP + 2.0 * BEYOND_EDGELS) * pixel;
        let gain = || images.evidence(&piece, None, f64::NEG_INFINITY).gain;
        let views = line.evidence.views().collect();
        (is_short || gain() < 0.0).then_some((edge, Asked { piece, views }))
    };
    let between = pieces_between(wireframe, sources);
    let (edges, asked): (Vec<usize>, Vec<Asked>) =
        between.into_par_iter().filter_map(asked).unzip();
    let lights = light_across(images, photographs, response, &asked);
    let mut kept = vec![true; wireframe.edges.len()];
    for (edge, light) in edges.into_iter().zip(lights) {
        kept[edge] = light.for_rest_of_edge() >= 0.0;
    }
    retain_edges(&kept, &mut wireframe.edges, sources);
}

/// The edges at both of whose ends their line goes on.
fn pieces_between(wireframe: &Wireframe3d, sources: &[Option<usize>]) -> Vec<usize> {
    let mut pieces: BTreeMap<(Option<usize>, usize), usize> = BTreeMap::new();
    for (edge, source) in wireframe.edges.iter().zip(sources) {
        for end in edge.iter().filter(|_| source.is_some()) {
            *pieces.entry((*source, *end)).or_default() += 1;
        }
    }
    let goes_on = |edge: usize| {
        let [a, b] = wireframe.edges[edge];
        let goes_on_at = |end: usize| pieces.get(&(sources[edge], end)) > Some(&1);
        goes_on_at(a) && goes_on_at(b)
    };
    (0..wireframe.edges.len())
        .filter(|edge| goes_on(*edge))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::line_evidence::{LineEvidence, Showing};
    use crate::assemble::profiles::tests::{cameras, photograph};
    use crate::assemble::test_views::TestViews;
    use nalgebra::Vector3;
    use std::borrow::Cow;

    /// The edges that are left of a line at `x` along bars, cut by two others so far apart.
    fn left(x: f64, apart: f64) -> usize {
        let cameras = cameras();
        let junctions = [-0.2, 0.0, apart, 0.2].map(|y| Vector3::new(x, y, 0.0));
        let beside = [1, 2].map(|k| junctions[k] + Vector3::x());
        let junctions = [&junctions[..], &beside].concat();
        let edges = vec![[0, 1], [1, 2], [2, 3], [1, 4], [2, 5]];
        // No edgel lies between.
        let shown = [edges[0], edges[2], edges[3], edges[4]];
        let views = TestViews::of_edges(&cameras, &junctions, &shown);
        let photographs = Photographs {
            image_of: &|view| Some(Cow::Owned(photograph(&cameras[view]))),
            pixel_center: 0.5,
        };
        let response = Response {
            exponent: 2.4,
            blur: 0.4,
        };
        let line = |[a, b]: [usize; 2]| ChosenLine {
            line: LineSegment3::new(junctions[a], junctions[b]),
            evidence: LineEvidence {
                gain: 9.0,
                showing: (0..cameras.len())
                    .map(|view| Showing { view, chance: 0.1 })
                    .collect(),
                ..LineEvidence::default()
            },
            placed: true,
        };
        let lines = [[0, 3], [1, 4], [2, 5]].map(line);
        let mut sources = vec![Some(0), Some(0), Some(0), Some(1), Some(2)];
        assert_eq!(
            pieces_between(
                &Wireframe3d {
                    junctions: Vec::new(),
                    edges: edges.clone()
                },
                &sources
            ),
            [1]
        );
        let mut wireframe = Wireframe3d {
            junctions: junctions.clone(),
            edges,
        };
        let light = (photographs, response);
        drop_gaps(&views.images(), light, &lines, &mut wireframe, &mut sources);
        assert_eq!(sources.len(), wireframe.edges.len());
        wireframe.edges.len()
    }

    #[test]
    fn a_gap_goes_and_a_piece_of_an_edge_stays() {
        // Four pixels, and thirty.
        for apart in [0.015, 0.12] {
            assert_eq!(left(-0.3, apart), 5);
            assert_eq!(left(-0.25, apart), 4);
        }
    }
}
