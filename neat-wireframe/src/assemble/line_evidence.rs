//! How much likelier the images are with a 3D line than without it.
//!
//! A view shows a line, shows parts of it, or does not. How often it would do so by
//! chance, lines beside it tell, parallel and of the same length: much in leaves and
//! brickwork, little on a wall. What a view says is the logarithm of the ratio of both
//! probabilities, where a line that exists may still be hidden. Two views show a line
//! wherever they want, since any two planes meet in one: the two that say most do not
//! count. What is another line in each view is weighed in the same way.

use super::edge_samples::{Images, Sample, project_segment};
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;

/// Two views show a line wherever they want.
const FREE_VIEWS: usize = 2;
/// The ends of an edge are round and hidden: this share of it at each end is not asked.
const ENDS: f64 = 0.03;
/// A view shows a line along which edgels are at this share of the samples …
const SHOWN: f64 = 0.6;
/// … and parts of it from this share on.
const PARTLY_SHOWN: f64 = 0.3;
/// Lines beside a line that tell of chance, in pixels: farther than an edge is wide, and
/// near enough to lie on the same thing.
const DECOYS: [f64; 8] = [-11.0, -9.0, -7.0, -5.0, 5.0, 7.0, 9.0, 11.0];
/// How many decoys do what by chance where none does: two decoys' worth of a flat image.
const PRIOR_DECOYS: [f64; 3] = [0.1, 0.2, 1.7];
/// Probability that an unhidden line is shown, partly shown, not shown, for weak contrast and
/// noise: judged, not measured.
const OF_VISIBLE: [f64; 3] = [0.8, 0.13, 0.07];
/// Probability that a line is hidden in a view beside one that shows it, judged: of .3 and .5
/// neither is better on photographs with truth …
const HIDDEN_BESIDE: f64 = 0.5;
/// … and in any other: one sees it from its own side only.
const HIDDEN_ELSEWHERE: f64 = 0.97;
/// Views under at most this angle are beside each other, in degrees: 10, 15 and 20 differ by
/// less than a point of F1 there.
const BESIDE: f64 = 15.0;
/// Fewer views are not worth another thread, judged.
const MIN_VIEWS_OF_TASK: usize = 8;
/// Bounds of the probability that an edgel lies beside a sample by chance.
const CHANCE_OF_EDGEL: [f64; 2] = [0.02, 0.8];

/// A view that shows a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Showing {
    pub view: usize,
    /// Probability that an edgel lies beside a sample of it by chance.
    pub chance: f64,
}

/// What the images say about a line.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LineEvidence {
    /// In nats, without the two views that say most; negative if they say no.
    pub gain: f64,
    /// The views that show it, ascending.
    pub showing: Vec<Showing>,
    /// How many views show parts of it.
    pub partly: usize,
}

impl LineEvidence {
    pub(super) fn views(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.showing.iter().map(|showing| showing.view)
    }

    /// What is said for it against something else that lies along a part of it, in nats: of that as many
    /// views show all as show parts.
    pub(super) fn gain_of_whole(&self) -> f64 {
        let [shown, partly, _] = OF_VISIBLE;
        let gain = |of: f64| (2.0 * of / (shown + partly)).ln();
        self.showing.len() as f64 * gain(shown) + self.partly as f64 * gain(partly)
    }
}

/// What one view does with a line.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Shown,
    PartlyShown,
    NotShown,
}

impl State {
    fn of(share: f64) -> Self {
        match share {
            SHOWN.. => Self::Shown,
            PARTLY_SHOWN.. => Self::PartlyShown,
            _ => Self::NotShown,
        }
    }
}

/// What a view in this state says, by how often lines beside it are in which state.
fn gain_of_state(state: State, decoys: [f64; 3]) -> f64 {
    // A decoy that is shown whole would do for a part, too, but worse.
    let (visible, alike) = match state {
        State::Shown => (OF_VISIBLE[0], decoys[0]),
        _ => (OF_VISIBLE[1], decoys[1] + 0.5 * decoys[0]),
    };
    let by_chance = alike / decoys.iter().sum::<f64>();
    (HIDDEN_BESIDE + (1.0 - HIDDEN_BESIDE) * visible / by_chance).ln()
}

/// The most that a view in this state can say: no decoy is.
fn most_of_view(state: State) -> f64 {
    let [shown, partly, not] = PRIOR_DECOYS;
    gain_of_state(state, [shown, partly, not + DECOYS.len() as f64])
}

/// What one view does with a line, before decoys are asked.
struct ViewOfLine {
    view: usize,
    state: State,
    samples: Vec<Sample>,
    /// The most that it can say, and what it says if it does not show the line.
    most: f64,
}

/// The most that all views can say, where `free` of those that show a line do not count.
fn most_of_views(views: &[ViewOfLine], free: usize) -> f64 {
    let shown = views.iter().filter(|of| of.state == State::Shown).count();
    let of_free = shown.min(free) as f64 * most_of_view(State::Shown);
    views.iter().map(|of| of.most).sum::<f64>() - of_free
}

impl Images<'_> {
    /// What all views say about a line; edgels that are `taken` do not count for it. Where it
    /// cannot be more than `least`, it is as good as nothing.
    pub(super) fn evidence(
        &self,
        line: &LineSegment3,
        taken: Option<&[Vec<bool>]>,
        least: f64,
    ) -> LineEvidence {
        self.evidence_of(line, |_| Some(*line), taken, least, FREE_VIEWS)
    }

    /// [`Self::evidence`] of something near `line` that is the line `in_view` for each view, of
    /// which `free` views show one wherever they want.
    pub(super) fn evidence_of(
        &self,
        line: &LineSegment3,
        in_view: impl Fn(usize) -> Option<LineSegment3> + Sync,
        taken: Option<&[Vec<bool>]>,
        least: f64,
        free: usize,
    ) -> LineEvidence {
        let samples = |view| self.samples_asked(view, &in_view(view)?);
        self.evidence_of_samples(&line.point_at(0.5), samples, taken, least, free)
    }

    /// [`Self::evidence_of`] what is near `middle` and has the samples `in_view` in each view.
    pub(super) fn evidence_of_samples(
        &self,
        middle: &Vector3<f64>,
        in_view: impl Fn(usize) -> Option<Vec<Sample>> + Sync,
        taken: Option<&[Vec<bool>]>,
        least: f64,
        free: usize,
    ) -> LineEvidence {
        let views = self.views_of(middle, in_view, taken);
        let mut evidence = LineEvidence {
            gain: f64::NEG_INFINITY,
            ..LineEvidence::default()
        };
        // Most lines that are none end here.
        if most_of_views(&views, free) <= least {
            return evidence;
        }
        let mut gain = 0.0;
        let mut of_showing = Vec::new();
        for of_line in &views {
            if of_line.state == State::NotShown {
                gain += of_line.most;
                continue;
            }
            let (of_view, chance) = self.gain_of_view(of_line);
            gain += of_view;
            if of_line.state == State::Shown {
                evidence.showing.push(Showing {
                    view: of_line.view,
                    chance,
                });
                of_showing.push(of_view);
            } else {
                evidence.partly += 1;
            }
        }
        of_showing.sort_by(|a: &f64, b| b.total_cmp(a));
        evidence.gain = gain - of_showing.iter().take(free).sum::<f64>();
        evidence
    }

    /// What the evidence of a line cannot exceed, for a part of its price.
    pub(super) fn most_evidence(&self, line: &LineSegment3) -> f64 {
        let samples = |view| self.samples_asked(view, line);
        most_of_views(
            &self.views_of(&line.point_at(0.5), samples, None),
            FREE_VIEWS,
        )
    }

    /// The samples of a line, without its ends.
    fn samples_asked(&self, view: usize, line: &LineSegment3) -> Option<Vec<Sample>> {
        let length = project_segment(&self.views[view], line)?.length();
        let end = ENDS.max(self.rounding / length).min(0.5);
        self.samples(view, line, [end, 1.0 - end], None)
    }

    /// What each view does with what has the samples `in_view`.
    fn views_of(
        &self,
        middle: &Vector3<f64>,
        in_view: impl Fn(usize) -> Option<Vec<Sample>> + Sync,
        taken: Option<&[Vec<bool>]>,
    ) -> Vec<ViewOfLine> {
        let mut views: Vec<ViewOfLine> = (0..self.views.len())
            .into_par_iter()
            .with_min_len(MIN_VIEWS_OF_TASK)
            .filter(|view| !self.maps[*view].is_empty())
            .filter_map(|view| {
                let samples = in_view(view)?;
                let state = self.state(view, &samples, taken);
                Some(ViewOfLine {
                    view,
                    state,
                    samples,
                    most: most_of_view(state),
                })
            })
            .collect();
        let toward = |view: usize| -> Vector3<f64> {
            (self.views[view].camera.center_in_world - middle).normalize()
        };
        let shown: Vec<Vector3<f64>> = (views.iter())
            .filter(|of| of.state == State::Shown)
            .map(|of| toward(of.view))
            .collect();
        let min_cosine = BESIDE.to_radians().cos();
        for of_line in views.iter_mut().filter(|of| of.state == State::NotShown) {
            let here = toward(of_line.view);
            let beside = shown.iter().any(|there| there.dot(&here) > min_cosine);
            let hidden = if beside {
                HIDDEN_BESIDE
            } else {
                HIDDEN_ELSEWHERE
            };
            let [.., by_chance] = PRIOR_DECOYS;
            let by_chance = by_chance / PRIOR_DECOYS.iter().sum::<f64>();
            of_line.most = (hidden + (1.0 - hidden) * OF_VISIBLE[2] / by_chance).ln();
        }
        views
    }

    /// What a view does with a line; its samples are asked until that is sure.
    fn state(&self, view: usize, samples: &[Sample], taken: Option<&[Vec<bool>]>) -> State {
        let count = samples.len();
        let of = |hits: usize| State::of(hits as f64 / count as f64);
        let mut hits = 0;
        for (k, sample) in samples.iter().enumerate() {
            hits += usize::from(self.has_edgel(view, sample, taken));
            let left = count - k - 1;
            if of(hits) == of(hits + left) {
                break;
            }
        }
        of(hits)
    }

    /// What a view that shows at least parts says, and how likely an edgel lies beside a
    /// sample by chance.
    fn gain_of_view(&self, of_line: &ViewOfLine) -> (f64, f64) {
        let mut decoys = PRIOR_DECOYS;
        let mut edgels = 0.0;
        for share in self.shares(of_line.view, &of_line.samples, &DECOYS) {
            edgels += share;
            decoys[State::of(share) as usize] += 1.0;
        }
        let gain = gain_of_state(of_line.state, decoys);
        let chance = edgels / DECOYS.len() as f64;
        (gain, chance.clamp(CHANCE_OF_EDGEL[0], CHANCE_OF_EDGEL[1]))
    }
}

#[cfg(test)]
mod tests {
    use crate::assemble::edge_samples::Images;
    use crate::assemble::test_views::{TestViews, cube_edge};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;
    use neat_core::LineSegment3;

    #[test]
    fn views_speak_for_edges_and_against_what_is_none() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        for edge in 0..12 {
            let found = images.evidence(&cube_edge(edge), None, 0.0);
            assert!(found.gain > 20.0, "{}", found.gain);
            assert!(found.showing.len() >= 18);
        }
        // The diagonal; an edge at the wrong depth for all views but two.
        let diagonal = LineSegment3::new(cube_edge(0).start, -cube_edge(0).start);
        assert!(images.evidence(&diagonal, None, 0.0).gain < 0.0);
        let moved = cube_edge(0).map(|end| end + Vector3::new(0.05, -0.04, 0.03));
        assert!(images.evidence(&moved, None, 0.0).gain < 0.0);
    }

    #[test]
    fn edgels_of_other_lines_do_not_count() {
        let cube = TestViews::of_cube(12);
        let images = cube.images();
        let taken: Vec<Vec<bool>> = images
            .maps
            .iter()
            .map(|map| vec![true; map.len()])
            .collect();
        assert!(
            images
                .evidence(&cube_edge(3), Some(&taken), 0.0)
                .showing
                .is_empty()
        );
    }

    #[test]
    fn rounded_corners_are_not_asked() {
        let edge = LineSegment3::new(Vector3::zeros(), Vector3::new(0.02, 0.03, 0.01));
        let seen = [edge.point_at(0.25), edge.point_at(0.75)];
        let views = views_of_edges(&cameras_on_sphere(20), &seen, &[[0, 1]]);
        let views = (views.iter()).map(|view| PreparedView::new(view, 1.0, 1.0));
        let views = TestViews::of(views.collect());
        let showing = |rounding: f64| {
            let images = Images {
                rounding,
                ..views.images()
            };
            images.evidence(&edge, None, 0.0).showing.len()
        };
        assert!(showing(0.0) < 10, "{}", showing(0.0));
        assert!(showing(1.5) > 15, "{}", showing(1.5));
    }
}
