//! Ends that meet nothing, moved on by what edgels fall short of the ends of edges.
//!
//! Lens and detector smooth gradients, which turn at corners: edgels stop before their edge
//! does, by 0.8 and 1 pixel on two photographed buildings and by less on most rendered objects.
//! The ends that meet others tell: where lines meet does not depend on where their edgels stop.

use super::corners::Corners;
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use crate::statistics::upper_median;
use nalgebra::Vector3;

/// Fewer ends that meet others do not tell, judged.
const MIN_ENDS: usize = 20;

/// An end of an edge.
struct End {
    junction: usize,
    /// Along the edge, one pixel long in the median view that shows it.
    outward: Vector3<f64>,
    /// How far the junction lies beyond the last edgels, in pixels.
    gap: f64,
}

/// Moves free ends along their edges. `lines` end where their edgels do.
pub(super) fn move_free_ends(images: &Images, lines: &[ChosenLine], corners: &mut Corners) {
    let degrees = corners.degrees();
    let junctions = &corners.junctions;
    let ends = lines.iter().enumerate().flat_map(|(k, chosen)| {
        let edge = corners.edge(k);
        let pixels = images.projected_length(&edge, chosen.evidence.views());
        let along = (edge.end - edge.start) / pixels;
        let sides = chosen.line.ends().into_iter().zip([-along, along]);
        (sides.zip(corners.ends[k])).map(|((last, outward), junction)| End {
            junction,
            outward,
            gap: (junctions[junction] - last).dot(&outward) / outward.norm_squared(),
        })
    });
    // Of an edge without a length nothing is known.
    let (free, met): (Vec<End>, Vec<End>) =
        (ends.filter(|end| end.gap.is_finite())).partition(|end| degrees[end.junction] == 1);
    if met.len() < MIN_ENDS {
        return;
    }
    let short = upper_median(&mut met.iter().map(|end| end.gap).collect::<Vec<f64>>());
    for end in free {
        corners.junctions[end.junction] += short.max(0.0) * end.outward;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::corners::find_corners;
    use crate::assemble::test_views::{TestViews, chosen, cube_edge, end_distance};
    use neat_core::LineSegment3;

    #[test]
    fn free_ends_move_by_what_the_others_fall_short_of_their_corners() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        // Half of an edge meets a corner at one end only.
        let half = LineSegment3::new(cube_edge(0).start, cube_edge(0).point_at(0.5));
        let short_by = |share: f64| -> Vec<ChosenLine> {
            (0..12)
                .map(|edge| {
                    let mut line = chosen(&images, &cube_edge(edge));
                    let whole = if edge == 0 { half } else { line.line };
                    let share = share / whole.length();
                    line.line =
                        LineSegment3::new(whole.point_at(share), whole.point_at(1.0 - share));
                    line
                })
                .collect()
        };
        for share in [0.0, 0.02] {
            let lines = short_by(share);
            let mut corners = find_corners(&images, &lines, (&[], &[]));
            assert_eq!(corners.junctions.len(), 9);
            assert!((end_distance(&corners.edge(0), &half) - share).abs() < 1e-3);
            move_free_ends(&images, &lines, &mut corners);
            assert!(end_distance(&corners.edge(0), &half) < 0.1 * share + 1e-6);
        }
    }
}
