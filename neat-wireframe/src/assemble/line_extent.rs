//! From where to where along a 3D line the images show an edge.

use super::edge_samples::{Images, Sample, across, project_segment};
use super::line_evidence::Showing;
use crate::projection::project_in_front;
use neat_core::LineSegment3;

/// Probability that there is an edgel beside an edge that is not hidden.
const HIT: f64 = 0.9;
/// What a sample without an edgel says, in nats: the edge ends there, or something hides it
/// in this view. Of -0.3, -0.6 and -1.2 the best on photographs with truth.
const MISS: f64 = -1.2;
/// The least that an edgel says where they are everywhere.
const LEAST_HIT: f64 = 0.05;
/// The line is followed by this share of its length beyond each end.
const BEYOND: f64 = 0.5;
/// Samples along it: one for two pixels, within these bounds.
const PIXELS_PER_SAMPLE: f64 = 2.0;
const COUNTS: [usize; 2] = [12, 400];
/// A shorter stretch is noise, in samples.
const MIN_STRETCH: usize = 3;

impl Images<'_> {
    /// The stretch of a line that the views which show it speak for most; `None` if there
    /// is none. Edgels that are `taken` by others do not count.
    pub(super) fn extent(
        &self,
        line: &LineSegment3,
        showing: &[Showing],
        taken: Option<&[Vec<bool>]>,
    ) -> Option<LineSegment3> {
        let length = self.projected_length(line, showing.iter().map(|s| s.view));
        let whole = 1.0 + 2.0 * BEYOND;
        let count = ((whole * length / PIXELS_PER_SAMPLE) as usize).clamp(COUNTS[0], COUNTS[1]);
        let place = |k: f64| whole * k / count as f64 - BEYOND;
        let mut gains = vec![0.0; count];
        for Showing { view, chance } in showing {
            let prepared = &self.views[*view];
            let Some((_, normal)) = project_segment(prepared, line).as_ref().and_then(across)
            else {
                continue;
            };
            for (k, gain) in gains.iter_mut().enumerate() {
                let point = line.point_at(place(k as f64 + 0.5));
                let pixel = project_in_front(&prepared.camera, &point);
                if let Some(pixel) = pixel.filter(|pixel| self.is_inside(*view, pixel)) {
                    let sample = Sample {
                        place: 0.0,
                        pixel,
                        normal,
                    };
                    *gain += gain_of_sample(self.has_edgel(*view, &sample, taken), *chance);
                }
            }
        }
        let [start, end] = best_stretch(&gains);
        (end >= start + MIN_STRETCH).then(|| {
            LineSegment3::new(
                line.point_at(place(start as f64)),
                line.point_at(place(end as f64)),
            )
        })
    }
}

/// What a view says about a place by whether an edgel is there, which is so by `chance`, too.
pub(super) fn gain_of_sample(is_there: bool, chance: f64) -> f64 {
    if is_there {
        (HIT / chance).ln().max(LEAST_HIT)
    } else {
        MISS
    }
}

/// The stretch with the largest sum (Bentley, *Programming Pearls*, 1984).
pub(super) fn best_stretch(gains: &[f64]) -> [usize; 2] {
    let (mut best, mut best_range) = (0.0, [0, 0]);
    let (mut sum, mut start) = (0.0, 0);
    for (k, gain) in gains.iter().enumerate() {
        if sum <= 0.0 {
            (sum, start) = (0.0, k);
        }
        sum += gain;
        if sum > best {
            (best, best_range) = (sum, [start, k + 1]);
        }
    }
    best_range
}

#[cfg(test)]
mod tests {
    use super::best_stretch;
    use crate::assemble::test_views::{TestViews, cube_edge, end_distance};
    use neat_core::LineSegment3;

    #[test]
    fn the_best_stretch_bridges_what_costs_less_than_it_brings() {
        assert_eq!(
            best_stretch(&[-1.0, 2.0, 2.0, -1.0, 3.0, -4.0, 5.0]),
            [1, 7]
        );
        assert_eq!(best_stretch(&[-1.0, 2.0, -5.0, 3.0, -1.0]), [3, 4]);
        assert_eq!(best_stretch(&[-1.0, -2.0]), [0, 0]);
        assert_eq!(best_stretch(&[]), [0, 0]);
    }

    #[test]
    fn a_piece_of_an_edge_grows_to_all_of_it() {
        let cube = TestViews::of_cube(16);
        let images = cube.images();
        let truth = cube_edge(4);
        let part = LineSegment3::new(truth.point_at(0.3), truth.point_at(0.9));
        let showing = images.evidence(&part, None, 0.0).showing;
        let grown = images.extent(&part, &showing, None).unwrap();
        assert!(end_distance(&grown, &truth) < 0.02);
    }
}
