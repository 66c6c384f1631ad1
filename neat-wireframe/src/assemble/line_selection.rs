//! Lines chosen one after the other, the best explained first, each by edgels that no line
//! before it has.

use super::candidate_queue::CandidateQueue;
use super::claimed_edgels::claim_edgels;
use super::config::AssembleConfig;
use super::edge_samples::{Images, project_segment};
use super::hypothesis_scoring::Alternatives;
use super::line_evidence::LineEvidence;
use super::line_kind::{Kind, curve_or_straight, kind};
use super::progress::OnProgress;
use super::projected_line::ProjectedLine;
use super::view_segments::SegmentId;
use crate::statistics::{SIGMA_BY_MEDIAN, upper_median};
use neat_core::{CircularArc, LineSegment2, LineSegment3};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// An edgel may be off by so many standard deviations of edgels: 99.7 % are not.
pub(super) const REACH_NOISES: f64 = 3.0;
/// Bounds of the reach in pixels: rounding and rendering, and edges side by side.
const REACH_BOUNDS: [f64; 2] = [0.25, 1.5];
/// So many lines tell of the noise and the poses; with 400 scores of photographs are the same.
const SURE_LINES: usize = 100;
/// Of so many 2D segments one proposes them.
const SEGMENTS_FOR_SURE_LINES: usize = 4;
/// Edgels within so many pixels of a line tell of the noise.
const NOISE_REACH: f64 = 2.0;
/// Fewer do not.
const MIN_EDGELS_FOR_NOISE: usize = 20;
/// Share of the time after which all lines are found, whose kinds are asked then.
const FOUND: f64 = 0.7;
/// So many lines are asked for their kind between two words about progress.
const LINES_AT_ONCE: usize = 64;
/// The noise where no line tells of it, in pixels.
const USUAL_NOISE: f64 = 0.3;
/// The least noise, in pixels: a bow of more tells of a curve, not of noise.
const LEAST_NOISE: f64 = 0.05;
/// Reaches of the rounds of fitting: the first line is a guess.
const FITTING_REACHES: [f64; 3] = [1.3, 1.0, 1.0];
/// So many views must show a line whole: two do wherever they want, and parts of other edges in
/// more of them make it no line.
pub(super) const MIN_SHOWING: usize = 3;
/// An evidence that others have lowered by more goes back into the queue, in nats.
const STALE: f64 = 0.5;
/// 2D segments whose ends lie within so many reaches of a line are its own: they propose
/// nothing else.
const SEGMENT_REACHES: f64 = 2.0;

/// A line with what speaks for it.
#[derive(Clone, Debug)]
pub(super) struct ChosenLine {
    pub line: LineSegment3,
    pub evidence: LineEvidence,
    /// Whether it lies where the light changes: edgels have nothing to add.
    pub placed: bool,
}

/// A line that stands for an arc.
#[derive(Clone, Debug)]
pub(super) struct Chord {
    /// As far as the line reaches.
    pub arc: CircularArc,
    /// The views that show the line.
    pub views: Vec<usize>,
    /// The line, where it is an edge unless it is this arc's chord.
    pub line: Option<LineSegment3>,
}

/// Lines, and how they came about.
pub(super) struct Selection<'a> {
    /// The images with the reach that their noise asks for.
    pub images: Images<'a>,
    pub noise: f64,
    pub lines: Vec<ChosenLine>,
    /// Lines that the images show and that stand for curves.
    pub curved: usize,
    /// Those of them that are arcs.
    pub chords: Vec<Chord>,
    /// Those that are outlines of round things.
    pub outlines: usize,
    /// For each edgel of each view, whether a line has it.
    pub taken: Vec<Vec<bool>>,
}

/// A 3D position of a 2D segment.
struct Candidate {
    segment: SegmentId,
    line: LineSegment3,
}

/// The lines of which the images are surest, of some 2D segments.
pub(super) fn sure_lines(
    images: Images,
    alternatives: &Alternatives,
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Vec<ChosenLine>> {
    let some = candidates(&images, alternatives, SEGMENTS_FOR_SURE_LINES);
    let wanted = Wanted {
        min_evidence: config.evidence_of_proposal(images.views.len()),
        most: SURE_LINES,
        noise: LEAST_NOISE,
        kind,
    };
    let sure = choose(images, &some, &wanted, images.nothing_taken(), progress)?;
    ControlFlow::Continue(sure.lines)
}

/// Chooses the lines that the images show, of all positions of all 2D segments, as near to
/// edgels as these are to the `sure` ones.
pub(super) fn select_lines<'a>(
    images: Images<'a>,
    alternatives: &Alternatives,
    sure: &[ChosenLine],
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Selection<'a>> {
    let noise = noise_of_edgels(&images, sure);
    let reach = (REACH_NOISES * noise).clamp(REACH_BOUNDS[0], REACH_BOUNDS[1]);
    let images = Images { reach, ..images };
    let all = candidates(&images, alternatives, 1);
    tracing::debug!(noise, candidates = all.len(), "lines are proposed");
    let wanted = Wanted {
        min_evidence: config.evidence_of_proposal(images.views.len()),
        most: usize::MAX,
        noise,
        kind,
    };
    choose(images, &all, &wanted, images.nothing_taken(), progress)
}

/// The chords among the lines that the images show, of all positions of pieces of curves, by the
/// edgels that no line of a selection has. The views of `images` hold the pieces.
pub(super) fn select_chords(
    images: Images,
    alternatives: &Alternatives,
    selection: &Selection,
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Vec<Chord>> {
    let all = candidates(&images, alternatives, 1);
    let wanted = Wanted {
        min_evidence: config.min_evidence,
        most: usize::MAX,
        noise: selection.noise,
        kind: curve_or_straight,
    };
    let mut found = choose(images, &all, &wanted, selection.taken.clone(), progress)?;
    for chord in &mut found.chords {
        chord.line = None;
    }
    ControlFlow::Continue(found.chords)
}

/// The candidates of one of `step` segments of each view.
fn candidates(images: &Images, alternatives: &Alternatives, step: usize) -> Vec<Candidate> {
    let mut candidates = Vec::new();
    for (view, lists) in alternatives.iter().enumerate() {
        for (segment, list) in lists.iter().enumerate().step_by(step) {
            candidates.extend(list.iter().map(|hypothesis| Candidate {
                segment: SegmentId { view, segment },
                line: images.views[view].back_project(segment, hypothesis.depths),
            }));
        }
    }
    candidates
}

/// The median over lines of the standard deviation of their edgels, in pixels; curves and
/// outlines, whose edgels lie farther off, are not among them.
fn noise_of_edgels(images: &Images, lines: &[ChosenLine]) -> f64 {
    let mut deviations: Vec<f64> = lines
        .par_iter()
        .filter_map(|chosen| {
            let mut distances = Vec::new();
            for view in chosen.evidence.views() {
                let camera = &images.views[view].camera;
                if let Some(projected) = ProjectedLine::new(camera, &chosen.line) {
                    let edgels = images.edgels_beside(view, &chosen.line, NOISE_REACH);
                    distances.extend(edgels.iter().map(|pixel| projected.distance(pixel).abs()));
                }
            }
            (distances.len() >= MIN_EDGELS_FOR_NOISE)
                .then(|| SIGMA_BY_MEDIAN * upper_median(&mut distances))
        })
        .collect();
    if deviations.is_empty() {
        USUAL_NOISE
    } else {
        upper_median(&mut deviations)
    }
}

/// Which lines are chosen.
struct Wanted {
    min_evidence: f64,
    /// So many at most.
    most: usize,
    /// The standard deviation of an edgel, in pixels.
    noise: f64,
    /// What tells what one stands for.
    kind: fn(&Images, &LineSegment3, &LineEvidence, f64) -> Kind,
}

fn choose<'a>(
    images: Images<'a>,
    candidates: &[Candidate],
    wanted: &Wanted,
    taken: Vec<Vec<bool>>,
    progress: OnProgress<'_>,
) -> ControlFlow<(), Selection<'a>> {
    let &Wanted {
        min_evidence,
        most,
        noise,
        kind,
    } = wanted;
    let bounds: Vec<f64> = (candidates.par_iter())
        .map(|candidate| images.most_evidence(&candidate.line))
        .collect();
    let mut chooser = Chooser {
        images,
        min_evidence,
        candidates,
        queue: CandidateQueue::new(&bounds, min_evidence),
        taken,
        explained: (images.views.iter())
            .map(|view| vec![false; view.segments.len()])
            .collect(),
    };
    let (mut lines, mut curved, mut chords, mut tubes) = (Vec::new(), 0, Vec::new(), Vec::new());
    loop {
        // A line takes its edgels whatever it stands for: that is asked of many at once.
        let room = most - lines.len();
        let mut found = Vec::new();
        while found.len() < room
            && let Some(line) = chooser.next()
        {
            progress(FOUND * (1.0 - chooser.queue.len() as f64 / bounds.len() as f64))?;
            found.push(line);
        }
        if found.is_empty() {
            break;
        }
        let mut kinds: Vec<Kind> = Vec::with_capacity(found.len());
        for some in found.chunks(LINES_AT_ONCE) {
            let kind = |found: &ChosenLine| kind(&images, &found.line, &found.evidence, noise);
            kinds.par_extend(some.par_iter().map(kind));
            progress(FOUND + (1.0 - FOUND) * kinds.len() as f64 / found.len() as f64)?;
        }
        for (line, kind) in found.into_iter().zip(kinds) {
            match kind {
                Kind::Straight => lines.push(line),
                Kind::Curve(arc) => {
                    curved += 1;
                    chords.extend(arc.map(|arc| Chord {
                        arc,
                        views: line.evidence.views().collect(),
                        line: Some(line.line),
                    }));
                }
                Kind::Outline(tube) => tubes.push(tube),
            }
        }
    }
    let count = lines.len();
    let lines = images.without_outlines(lines, &tubes);
    let outlines = tubes.len() + count - lines.len();
    ControlFlow::Continue(Selection {
        images,
        noise,
        lines,
        curved,
        chords,
        outlines,
        taken: chooser.taken,
    })
}

struct Chooser<'a> {
    images: Images<'a>,
    min_evidence: f64,
    candidates: &'a [Candidate],
    queue: CandidateQueue,
    /// For each edgel of each view, whether a line has it.
    taken: Vec<Vec<bool>>,
    /// For each 2D segment of each view, whether it lies on a line.
    explained: Vec<Vec<bool>>,
}

impl Chooser<'_> {
    /// The line that the images speak for most, of those that are left; it takes its edgels.
    fn next(&mut self) -> Option<ChosenLine> {
        loop {
            let is_open = |index: usize| {
                let SegmentId { view, segment } = self.candidates[index].segment;
                !self.explained[view][segment]
            };
            let weigh = |index: usize| {
                let line = &self.candidates[index].line;
                (self.images.evidence(line, None, self.min_evidence)).gain
            };
            let (gain, index) = self.queue.pop(is_open, weigh)?;
            let Candidate { segment, line } = &self.candidates[index];
            let evidence = (self.images).evidence(line, Some(&self.taken), self.min_evidence);
            if evidence.gain <= self.min_evidence {
                continue;
            }
            if evidence.gain < gain - STALE {
                self.queue.push(evidence.gain, index);
            } else if let Some(found) =
                self.images
                    .settle_line(line, evidence, &self.taken, self.min_evidence)
            {
                self.claim(&found, *segment);
                return Some(found);
            }
        }
    }

    /// Takes the edgels beside a line, and the 2D segments where it is shown.
    fn claim(&mut self, found: &ChosenLine, seed: SegmentId) {
        let images = self.images;
        self.explained[seed.view][seed.segment] = true;
        claim_edgels(&images, &found.line, &mut self.taken);
        for view in found.evidence.views() {
            let prepared = &images.views[view];
            let Some(projected) = project_segment(prepared, &found.line) else {
                continue;
            };
            for segment in prepared.index.near(&projected) {
                let detected = &prepared.segments[segment].segment;
                if lies_on(detected, &projected, SEGMENT_REACHES * images.reach) {
                    self.explained[view][segment] = true;
                }
            }
        }
    }
}

impl Images<'_> {
    /// The line through the edgels beside one, as far as they reach; `None` if too little speaks
    /// for it by those that are not `taken`.
    pub(super) fn settle_line(
        &self,
        line: &LineSegment3,
        mut evidence: LineEvidence,
        taken: &[Vec<bool>],
        least: f64,
    ) -> Option<ChosenLine> {
        let mut line = *line;
        for share in FITTING_REACHES {
            line = self.fit(&line, evidence.views(), share * self.reach);
            line = self.extent(&line, &evidence.showing, None)?;
            evidence = self.evidence(&line, Some(taken), least);
            if evidence.gain <= least || evidence.showing.len() < MIN_SHOWING {
                return None;
            }
        }
        Some(ChosenLine {
            line,
            evidence,
            placed: false,
        })
    }
}

/// Whether a 2D segment lies on another, for the most part of its length.
fn lies_on(segment: &LineSegment2, on: &LineSegment2, reach: f64) -> bool {
    let places = segment.ends().map(|end| on.line_parameter(&end));
    let near = (segment.ends().iter()).all(|end| on.distance_to_line(end) <= reach);
    let [low, high] = [places[0].min(places[1]), places[0].max(places[1])];
    near && high.min(1.0) - low.max(0.0) >= 0.5 * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, cube_edge};

    #[test]
    fn what_no_view_shows_with_edgels_of_its_own_is_no_line() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(3);
        let settled = |share_of_others: f64| {
            let mut taken = images.nothing_taken();
            let part = LineSegment3::new(edge.start, edge.point_at(share_of_others));
            claim_edgels(&images, &part, &mut taken);
            images.settle_line(&edge, images.evidence(&edge, None, 0.0), &taken, 0.0)
        };
        assert!(settled(0.1).unwrap().evidence.showing.len() >= 18);
        assert!(settled(0.6).is_none());
    }

    #[test]
    fn what_only_two_views_show_whole_is_no_line() {
        let cube = TestViews::of_cube(20);
        let images = cube.images();
        let edge = cube_edge(3);
        let settled = |whole_in: usize| {
            let mut taken = images.nothing_taken();
            let part = LineSegment3::new(edge.start, edge.point_at(0.5));
            claim_edgels(&images, &part, &mut taken);
            for map in &mut taken[..whole_in] {
                map.fill(false);
            }
            let evidence = images.evidence(&edge, Some(&taken), 0.0);
            assert!(evidence.gain > 0.0);
            images.settle_line(&edge, evidence, &taken, 0.0)
        };
        assert!(settled(2).is_none());
        assert!(settled(4).is_some());
    }
}
