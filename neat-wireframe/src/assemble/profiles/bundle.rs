//! A line and the edges beside it, as its profiles tell.

use super::light::LightProfile;
use super::profile::Across;
use super::pursuit::{Columns, one_more, pixels};
use super::step_fit::fit_steps;
use super::step_model::{MAX_STEPS, Step, loss, misfit, shift_at};
use crate::statistics::upper_median;
use neat_core::LineSegment3;

/// Fewer profiles do not tell where steps are in space.
const MIN_PROFILES: usize = 8;
/// A profile shows something where the line is if a step there lowers its misfit by that of
/// noise.
const LEAST_SHOWN: f64 = 1.0;
/// One more step is sought as long as it lowers the loss of a profile by this, in the mean: it
/// keeps what it explains from drawing the others aside, whatever it is.
const LEAST_GAIN: f64 = 0.3;
/// It is an edge if it does so by this in each half of the views: what is left without it is e
/// times as large.
const EDGE_GAIN: f64 = 1.0;
/// Halves of the views put a step so near to each other if it is one and the same in space, in
/// pixels: about the blur.
const MAX_APART: f64 = 0.5;
/// A line farther off than this, in pixels, is another one.
const MAX_MOVE: f64 = 1.5;

/// Where a line is, and what runs beside it.
#[derive(Debug)]
pub(super) struct Bundle {
    /// The line, moved across itself; `None` where profiles do not tell.
    pub line: Option<LineSegment3>,
    /// Edges beside it, and by how much they lower the loss of a profile.
    pub beside: Vec<(LineSegment3, f64)>,
}

impl Bundle {
    /// `None` where too few profiles show anything.
    pub(super) fn new(
        line: &LineSegment3,
        across: &Across,
        profiles: &[LightProfile],
        blur: f64,
    ) -> Option<Self> {
        let shows = |profile: &&LightProfile| {
            misfit(profile, &[], blur) - misfit(profile, &[Step::zeros()], blur) > LEAST_SHOWN
        };
        let profiles: Vec<&LightProfile> = profiles.iter().filter(shows).collect();
        if profiles.len() < MIN_PROFILES {
            return None;
        }
        let steps = all_steps(&profiles, blur);
        let halves = halves(&profiles);
        let apart = apart(&profiles, &halves, &steps, blur);
        let far = |k: &usize| pixels_at_ends(&profiles, &steps[*k]);
        let own = (0..steps.len()).min_by(|a, b| far(a).total_cmp(&far(b)))?;
        let moved = |k: usize| moved(line, across, &steps[k]);
        let edge = |k: usize| {
            let of_half = |half: &Vec<&LightProfile>| gain(half, &steps, k, blur);
            let gain = halves.iter().map(of_half).fold(f64::INFINITY, f64::min);
            (gain > EDGE_GAIN).then(|| (moved(k), gain))
        };
        Some(Self {
            line: (far(&own) <= MAX_MOVE && apart[own] < MAX_APART).then(|| moved(own)),
            beside: (0..steps.len())
                .filter(|k| *k != own && apart[*k] < MAX_APART)
                .filter_map(edge)
                .collect(),
        })
    }
}

/// The step of the line, and as many more as explain much.
fn all_steps(profiles: &[&LightProfile], blur: f64) -> Vec<Step> {
    let mut sizes: Vec<f64> = profiles.iter().map(|p| p.by_shift.norm().recip()).collect();
    let pixel = upper_median(&mut sizes);
    let columns = Columns::new(blur);
    let (mut steps, mut cost) = fit_steps(profiles, vec![Step::zeros()], blur);
    while steps.len() < MAX_STEPS {
        match one_more(profiles, &steps, pixel, &columns, blur) {
            Some((more, lower)) if cost - lower > LEAST_GAIN * profiles.len() as f64 => {
                (steps, cost) = (more, lower);
            }
            _ => break,
        }
    }
    steps
}

/// The line where a step is.
fn moved(line: &LineSegment3, across: &Across, step: &Step) -> LineSegment3 {
    let shift = |along: f64| {
        let shift = shift_at(step, along);
        across[0] * shift.x + across[1] * shift.y
    };
    LineSegment3::new(line.start + shift(-0.5), line.end + shift(0.5))
}

/// Every second view, and the others.
fn halves<'a>(profiles: &[&'a LightProfile]) -> [Vec<&'a LightProfile>; 2] {
    let mut views: Vec<usize> = profiles.iter().map(|p| p.view).collect();
    views.dedup();
    let half_of = |profile: &LightProfile| views.partition_point(|v| *v < profile.view) % 2;
    [0, 1].map(|half| {
        let of_half = profiles.iter().filter(|profile| half_of(profile) == half);
        of_half.copied().collect()
    })
}

/// How far apart two halves of the views put each step, in pixels: at the farther end.
fn apart(
    profiles: &[&LightProfile],
    halves: &[Vec<&LightProfile>; 2],
    steps: &[Step],
    blur: f64,
) -> Vec<f64> {
    let [a, b] = [0, 1].map(|half| fit_steps(&halves[half], steps.to_vec(), blur).0);
    let apart = |(a, b): (&Step, &Step)| pixels_at_ends(profiles, &(a - b));
    a.iter().zip(&b).map(apart).collect()
}

/// How far a step lies beside the line in the images, in pixels: at the farther end.
fn pixels_at_ends(profiles: &[&LightProfile], step: &Step) -> f64 {
    let at_end = |along: f64| pixels(profiles, &shift_at(step, along));
    at_end(-0.5).max(at_end(0.5))
}

/// By how much a step lowers the loss of a profile, in the mean.
fn gain(profiles: &[&LightProfile], steps: &[Step], step: usize, blur: f64) -> f64 {
    let mut without = steps.to_vec();
    without.remove(step);
    let gain = |p: &&LightProfile| loss(misfit(p, &without, blur)) - loss(misfit(p, steps, blur));
    profiles.iter().map(gain).sum::<f64>() / profiles.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::light::Response;
    use crate::assemble::profiles::test_profiles::{PIXELS, Steps};
    use nalgebra::Vector3;

    const RESPONSE: Response = Response {
        exponent: 2.4,
        blur: 0.6,
    };

    /// A line along z, of which steps along x and y are seen.
    fn bundle(steps: Vec<(Step, [f64; 3])>) -> Option<Bundle> {
        let seen = Steps {
            steps,
            response: RESPONSE,
            noise: 3.0,
        };
        let line = LineSegment3::new(Vector3::zeros(), Vector3::z());
        let across = [Vector3::x(), Vector3::y()];
        Bundle::new(&line, &across, &seen.in_light(12), RESPONSE.blur)
    }

    /// How far a line lies beside a place, in pixels.
    fn off(line: &LineSegment3, [x, y]: [f64; 2]) -> f64 {
        let place = |z| Vector3::new(x, y, z);
        PIXELS
            * line
                .start
                .metric_distance(&place(0.0))
                .max(line.end.metric_distance(&place(1.0)))
    }

    #[test]
    fn both_edges_of_a_narrow_bar_are_found() {
        let heights = [[150.0, 120.0, 60.0], [-140.0, -110.0, -70.0]];
        let places = [[0.005, 0.002], [0.025, 0.014]];
        let steps = places.map(|[x, y]| Step::new(x, y, 0.0, 0.0)).into_iter();
        let found = bundle(steps.zip(heights).collect()).unwrap();
        assert!(off(&found.line.unwrap(), places[0]) < 0.1);
        assert_eq!(found.beside.len(), 1);
        assert!(off(&found.beside[0].0, places[1]) < 0.1);
    }

    #[test]
    fn an_edge_alone_has_nothing_beside_it() {
        let step = Step::new(-0.006, 0.004, 0.0, 0.0);
        let found = bundle(vec![(step, [90.0, 100.0, 80.0])]).unwrap();
        assert!(off(&found.line.unwrap(), [-0.006, 0.004]) < 0.1);
        assert!(found.beside.is_empty());
    }

    #[test]
    fn noise_shows_no_line() {
        assert!(bundle(Vec::new()).is_none());
    }

    #[test]
    fn a_line_does_not_move_to_a_far_edge() {
        let step = Step::new(0.03, 0.0, 0.0, 0.0);
        let found = bundle(vec![(step, [90.0, 100.0, 80.0])]);
        assert!(found.is_none_or(|found| found.line.is_none()));
    }
}
