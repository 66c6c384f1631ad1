//! Which 3D position of a 2D segment the other views agree on.
//!
//! Every partner of a segment proposes depths of its two ends; a hypothesis is
//! worth the sum, over the other views, of its best agreement with a partner
//! there (Hofer et al. 2017, Sec. 3.3). Depth differences divided by what one
//! pixel of the partner's noise makes are distances in that partner's image, so
//! agreement is a reprojection test.

use super::epipolar_matching::{LineMatch, ViewPair};
use super::field_partners::FieldLines;
use super::view_segments::{PreparedView, SegmentId};
use rayon::prelude::*;
use std::ops::Range;

/// Settings of the scores of hypotheses, which the two users of them choose.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scoring {
    /// Partners that project farther than this from a hypothesis do not agree.
    pub tolerance_in_pixels: f64,
    /// Hypotheses kept per segment, for the choice by mutual agreement.
    pub alternatives: usize,
}

impl Default for Scoring {
    fn default() -> Self {
        Self {
            tolerance_in_pixels: 3.0,
            alternatives: 2,
        }
    }
}

/// A partner that agrees with a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Support {
    /// The partner.
    pub id: SegmentId,
    /// Agreement in (0, 1].
    pub weight: f64,
}

/// A 3D position of a 2D segment.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hypothesis {
    /// Distances along the rays of its ends.
    pub depths: [f64; 2],
    /// How far one pixel of noise in all its supports moves them.
    pub depth_noise: [f64; 2],
    /// Sum of the agreements, one per view at most.
    pub score: f64,
    /// The best partner of each view that agrees, by ascending id.
    pub supports: Vec<Support>,
}

/// The best hypotheses of every segment of every view, best first.
pub(super) type Alternatives = Vec<Vec<Vec<Hypothesis>>>;

/// Matches and scores all segments: partners are those that the field knows, or else all
/// that the epipolar geometry allows.
pub(super) fn score_hypotheses(
    views: &[PreparedView],
    neighbours: &[Vec<usize>],
    field: Option<&FieldLines>,
    ball_radius: f64,
    min_views: usize,
    scoring: &Scoring,
) -> Alternatives {
    views
        .par_iter()
        .enumerate()
        .map(|(i, view)| {
            let pairs: Vec<ViewPair> = neighbours[i]
                .iter()
                .enumerate()
                .filter_map(|(slot, j)| ViewPair::new(view, &views[*j], slot))
                .collect();
            (0..view.segments.len())
                .into_par_iter()
                .map(|segment| {
                    let mut matches = Vec::new();
                    for pair in &pairs {
                        let Some(field) = field else {
                            pair.append_matches(segment, ball_radius, &mut matches);
                            continue;
                        };
                        let of = SegmentId { view: i, segment };
                        let partners = field.partners(of, neighbours[i][pair.slot()]);
                        pair.append_partners(segment, &partners, ball_radius, &mut matches);
                    }
                    Scorer::new(matches, &neighbours[i], scoring).best(min_views)
                })
                .collect()
        })
        .collect()
}

/// The partners of one segment.
struct Scorer<'a> {
    /// By neighbour, then by ascending depth of the first end.
    matches: Vec<LineMatch>,
    /// The part of `matches` of each neighbour.
    slots: Vec<Slot>,
    neighbours: &'a [usize],
    config: &'a Scoring,
}

/// The partners in one neighbour.
struct Slot {
    range: Range<usize>,
    /// No partner farther than this in the first depth can agree. Neighbours with
    /// a wide baseline have small ones.
    window: f64,
}

/// Best agreement in each neighbour: (weight, index of the match).
type BestPerSlot = Vec<Option<(f64, usize)>>;

impl<'a> Scorer<'a> {
    fn new(mut matches: Vec<LineMatch>, neighbours: &'a [usize], config: &'a Scoring) -> Self {
        matches.sort_by(|a, b| {
            (a.slot.cmp(&b.slot))
                .then(a.depths[0].total_cmp(&b.depths[0]))
                .then(a.segment.cmp(&b.segment))
        });
        let slots = (0..neighbours.len())
            .map(|slot| {
                let start = matches.partition_point(|m| m.slot < slot);
                let end = matches.partition_point(|m| m.slot <= slot);
                let widest = matches[start..end]
                    .iter()
                    .map(|m| m.depth_per_pixel[0])
                    .fold(0.0, f64::max);
                Slot {
                    range: start..end,
                    window: config.tolerance_in_pixels * widest,
                }
            })
            .collect();
        Self {
            matches,
            slots,
            neighbours,
            config,
        }
    }

    /// The alternatives with support in enough views.
    fn best(&self, min_views: usize) -> Vec<Hypothesis> {
        let mut nearest = vec![(f64::INFINITY, 0); self.neighbours.len()];
        let mut ranked: Vec<([f64; 2], f64)> = (self.matches.iter())
            .map(|partner| {
                let depths = partner.depths;
                nearest.fill((f64::INFINITY, 0));
                self.find_nearest(&depths, &mut nearest);
                let weights = nearest.iter().filter_map(|(d, _)| self.weight(*d));
                (depths, weights.sum())
            })
            .filter(|(_, score)| *score > 1.0)
            .collect();
        ranked.sort_by(|(_, a), (_, b)| b.total_cmp(a));

        let mut chosen: Vec<Hypothesis> = Vec::new();
        // Near copies of the best hypotheses come first in the ranking: look
        // at a bounded number only.
        for (depths, _) in ranked
            .iter()
            .take(self.config.alternatives.saturating_mul(32))
        {
            if chosen.len() >= self.config.alternatives {
                break;
            }
            let is_copy = |other: &Hypothesis| {
                (0..2).all(|side| {
                    let tolerance = self.config.tolerance_in_pixels * other.depth_noise[side];
                    (other.depths[side] - depths[side]).abs() < 2.0 * tolerance
                })
            };
            if chosen.iter().any(is_copy) {
                continue;
            }
            let Some(refined) = self.refine(depths) else {
                continue;
            };
            let again = chosen.iter().any(|other| {
                (0..2).all(|side| {
                    let tolerance = self.config.tolerance_in_pixels * other.depth_noise[side];
                    (other.depths[side] - refined.depths[side]).abs() < tolerance
                })
            });
            if !again && refined.supports.len() + 1 >= min_views {
                chosen.push(refined);
            }
        }
        chosen.sort_by(|a, b| b.score.total_cmp(&a.score));
        chosen
    }

    /// The best agreement with `depths` in every neighbour.
    fn agreements(&self, depths: &[f64; 2]) -> BestPerSlot {
        let mut nearest = vec![(f64::INFINITY, 0); self.neighbours.len()];
        self.find_nearest(depths, &mut nearest);
        nearest
            .into_iter()
            .map(|(distance, index)| Some((self.weight(distance)?, index)))
            .collect()
    }

    /// For every neighbour the distance in pixels of its nearest partner, and the
    /// partner.
    fn find_nearest(&self, depths: &[f64; 2], nearest: &mut [(f64, usize)]) {
        for (slot, nearest) in self.slots.iter().zip(nearest) {
            let matches = &self.matches[slot.range.clone()];
            let lowest = depths[0] - slot.window;
            let first = matches.partition_point(|m| m.depths[0] < lowest);
            for (offset, m) in matches[first..]
                .iter()
                .take_while(|m| m.depths[0] <= depths[0] + slot.window)
                .enumerate()
            {
                let in_pixels =
                    |side: usize| (m.depths[side] - depths[side]).abs() / m.depth_per_pixel[side];
                let distance = in_pixels(0).max(in_pixels(1));
                if distance < nearest.0 {
                    *nearest = (distance, slot.range.start + first + offset);
                }
            }
        }
    }

    /// Agreement at a distance in pixels; `None` beyond the tolerance.
    fn weight(&self, distance: f64) -> Option<f64> {
        let relative = 2.0 * distance / self.config.tolerance_in_pixels;
        (relative <= 2.0).then(|| (-0.5 * relative * relative).exp())
    }

    /// The mean of the partners that agree, by their certainty.
    fn refine(&self, depths: &[f64; 2]) -> Option<Hypothesis> {
        let mut depths = *depths;
        let mut depth_noise = [0.0; 2];
        for _ in 0..2 {
            let agreements = self.agreements(&depths);
            for side in 0..2 {
                let (mut sum, mut total) = (0.0, 0.0);
                for (weight, index) in agreements.iter().flatten() {
                    let partner = &self.matches[*index];
                    let certainty = weight / partner.depth_per_pixel[side].powi(2);
                    sum += certainty * partner.depths[side];
                    total += certainty;
                }
                if total <= 0.0 {
                    return None;
                }
                depths[side] = sum / total;
                depth_noise[side] = total.sqrt().recip();
            }
        }
        let agreements = self.agreements(&depths);
        let score = agreements.iter().flatten().map(|(weight, _)| weight).sum();
        let mut supports: Vec<Support> = agreements
            .into_iter()
            .flatten()
            .map(|(weight, index)| {
                let partner = &self.matches[index];
                Support {
                    id: SegmentId {
                        view: self.neighbours[partner.slot],
                        segment: partner.segment,
                    },
                    weight,
                }
            })
            .collect();
        supports.sort_by_key(|support| support.id);
        Some(Hypothesis {
            depths,
            depth_noise,
            score,
            supports,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn partner(slot: usize, segment: usize, depth: f64) -> LineMatch {
        LineMatch {
            slot,
            segment,
            depths: [depth, depth + 1.0],
            depth_per_pixel: [0.01, 0.02],
        }
    }

    #[test]
    fn the_depth_that_most_views_agree_on_comes_first() {
        let matches = vec![
            partner(0, 3, 5.0),
            partner(1, 4, 5.01),
            partner(2, 5, 4.995),
            partner(0, 6, 7.0),
            partner(1, 7, 7.01),
            partner(1, 8, 9.0),
        ];
        let neighbours = [4, 2, 9];
        let config = Scoring::default();
        let best = Scorer::new(matches.clone(), &neighbours, &config).best(3);
        assert_eq!(best.len(), 2);
        assert!((best[0].depths[0] - 5.0).abs() < 0.005);
        let ids: Vec<_> = best[0]
            .supports
            .iter()
            .map(|s| (s.id.view, s.id.segment))
            .collect();
        assert_eq!(ids, [(2, 4), (4, 3), (9, 5)]);
        assert!((best[1].depths[0] - 7.005).abs() < 1e-3);
        assert!(
            Scorer::new(matches, &neighbours, &config)
                .best(5)
                .is_empty()
        );
    }

    #[test]
    fn nothing_in_nothing_out() {
        let config = Scoring::default();
        assert!(Scorer::new(Vec::new(), &[], &config).best(3).is_empty());
    }
}
