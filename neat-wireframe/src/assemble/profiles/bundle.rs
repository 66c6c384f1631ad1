//! A curve and the edges beside it, as its profiles tell.

use super::covariance::covariance;
use super::curve::{Curve, Step};
use super::light::LightProfile;
use super::pursuit::{Columns, one_more, pixels};
use super::step_fit::fit_steps;
use super::step_model::{MAX_STEPS, loss, misfit};
use crate::statistics::upper_median;
use nalgebra::SMatrix;

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

/// Where a curve is, and what runs beside it.
#[derive(Debug)]
pub(super) struct Bundle<'a, const N: usize> {
    /// By how much the curve moves; `None` where profiles do not tell.
    pub own: Option<Step<N>>,
    /// Edges beside it, and by how much they lower the loss of a profile.
    pub beside: Vec<(Step<N>, f64)>,
    profiles: Vec<&'a LightProfile<N>>,
    steps: Vec<Step<N>>,
    nearest: usize,
    blur: f64,
}

impl<'a, const N: usize> Bundle<'a, N> {
    /// `None` where too few profiles show anything.
    pub(super) fn new(
        curve: &impl Curve<N>,
        profiles: &'a [LightProfile<N>],
        blur: f64,
    ) -> Option<Self> {
        let shows = |profile: &&LightProfile<N>| {
            misfit(profile, &[], blur) - misfit(profile, &[Step::zeros()], blur) > LEAST_SHOWN
        };
        let profiles: Vec<&LightProfile<N>> = profiles.iter().filter(shows).collect();
        if profiles.len() < MIN_PROFILES {
            return None;
        }
        let steps = all_steps(curve, &profiles, blur);
        let halves = halves(&profiles);
        let apart = apart(curve, &profiles, &halves, &steps, blur);
        let far = |k: &usize| pixels_at_ends(curve, &profiles, &steps[*k]);
        let nearest = (0..steps.len()).min_by(|a, b| far(a).total_cmp(&far(b)))?;
        let edge = |k: usize| {
            let of_half = |half: &Vec<&LightProfile<N>>| gain(half, &steps, k, blur);
            let gain = halves.iter().map(of_half).fold(f64::INFINITY, f64::min);
            (gain > EDGE_GAIN).then(|| (steps[k], gain))
        };
        Some(Self {
            own: (far(&nearest) <= MAX_MOVE && apart[nearest] < MAX_APART).then(|| steps[nearest]),
            beside: (0..steps.len())
                .filter(|k| *k != nearest && apart[*k] < MAX_APART)
                .filter_map(edge)
                .collect(),
            profiles,
            steps,
            nearest,
            blur,
        })
    }

    /// The [`covariance`] of the step of the curve itself.
    pub(super) fn covariance(&self) -> Option<SMatrix<f64, N, N>> {
        covariance(&self.profiles, &self.steps, self.nearest, self.blur)
    }
}

/// The step of the curve, and as many more as explain much.
fn all_steps<const N: usize>(
    curve: &impl Curve<N>,
    profiles: &[&LightProfile<N>],
    blur: f64,
) -> Vec<Step<N>> {
    let mut sizes: Vec<f64> = profiles.iter().map(|p| p.by_shift.norm().recip()).collect();
    let pixel = upper_median(&mut sizes);
    let columns = Columns::new(blur);
    let (mut steps, mut cost) = fit_steps(profiles, vec![Step::zeros()], blur);
    while steps.len() < MAX_STEPS {
        match one_more(curve, profiles, &steps, pixel, &columns, blur) {
            Some((more, lower)) if cost - lower > LEAST_GAIN * profiles.len() as f64 => {
                (steps, cost) = (more, lower);
            }
            _ => break,
        }
    }
    steps
}

/// Every second view, and the others.
fn halves<'a, const N: usize>(profiles: &[&'a LightProfile<N>]) -> [Vec<&'a LightProfile<N>>; 2] {
    let mut views: Vec<usize> = profiles.iter().map(|p| p.view).collect();
    views.dedup();
    let half_of = |profile: &LightProfile<N>| views.partition_point(|v| *v < profile.view) % 2;
    [0, 1].map(|half| {
        let of_half = profiles.iter().filter(|profile| half_of(profile) == half);
        of_half.copied().collect()
    })
}

/// How far apart two halves of the views put each step, in pixels: at the farthest end.
fn apart<const N: usize>(
    curve: &impl Curve<N>,
    profiles: &[&LightProfile<N>],
    halves: &[Vec<&LightProfile<N>>; 2],
    steps: &[Step<N>],
    blur: f64,
) -> Vec<f64> {
    let [a, b] = [0, 1].map(|half| fit_steps(&halves[half], steps.to_vec(), blur).0);
    let apart = |(a, b): (&Step<N>, &Step<N>)| pixels_at_ends(curve, profiles, &(a - b));
    a.iter().zip(&b).map(apart).collect()
}

/// How far a step lies beside the curve in the images, in pixels: at the farthest end.
fn pixels_at_ends<const N: usize>(
    curve: &impl Curve<N>,
    profiles: &[&LightProfile<N>],
    step: &Step<N>,
) -> f64 {
    let at_end = |end: f64| pixels(profiles, &(curve.shift_by_step(end) * step));
    curve.ends().into_iter().map(at_end).fold(0.0, f64::max)
}

/// By how much a step lowers the loss of a profile, in the mean.
fn gain<const N: usize>(
    profiles: &[&LightProfile<N>],
    steps: &[Step<N>],
    step: usize,
    blur: f64,
) -> f64 {
    let mut without = steps.to_vec();
    without.remove(step);
    let gain =
        |p: &&LightProfile<N>| loss(misfit(p, &without, blur)) - loss(misfit(p, steps, blur));
    profiles.iter().map(gain).sum::<f64>() / profiles.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::light::Response;
    use crate::assemble::profiles::test_profiles::{PIXELS, Steps, line_along_z};
    use nalgebra::{Vector2, Vector4};

    const RESPONSE: Response = Response {
        exponent: 2.4,
        blur: 0.6,
    };

    /// The step of the line, and those of the edges beside it.
    fn bundle(steps: Vec<(Step<4>, [f64; 3])>) -> Option<(Option<Step<4>>, Vec<Step<4>>)> {
        let seen = Steps {
            steps,
            response: RESPONSE,
            noise: 3.0,
        };
        let light = seen.in_light(12);
        let found = Bundle::new(&line_along_z(), &light, RESPONSE.blur)?;
        let beside = found.beside.iter();
        Some((found.own, beside.map(|(step, _)| *step).collect()))
    }

    /// How far a line lies beside a place, in pixels.
    fn off(step: &Step<4>, [x, y]: [f64; 2]) -> f64 {
        let off = |end| line_along_z().shift_by_step(end) * step - Vector2::new(x, y);
        PIXELS * off(-0.5).norm().max(off(0.5).norm())
    }

    #[test]
    fn both_edges_of_a_narrow_bar_are_found() {
        let heights = [[150.0, 120.0, 60.0], [-140.0, -110.0, -70.0]];
        let places = [[0.005, 0.002], [0.025, 0.014]];
        let steps = places
            .map(|[x, y]| Vector4::new(x, y, 0.0, 0.0))
            .into_iter();
        let (own, beside) = bundle(steps.zip(heights).collect()).unwrap();
        assert!(off(&own.unwrap(), places[0]) < 0.1);
        assert_eq!(beside.len(), 1);
        assert!(off(&beside[0], places[1]) < 0.1);
    }

    #[test]
    fn an_edge_alone_has_nothing_beside_it() {
        let step = Vector4::new(-0.006, 0.004, 0.0, 0.0);
        let (own, beside) = bundle(vec![(step, [90.0, 100.0, 80.0])]).unwrap();
        assert!(off(&own.unwrap(), [-0.006, 0.004]) < 0.1);
        assert!(beside.is_empty());
    }

    #[test]
    fn noise_shows_no_line() {
        assert!(bundle(Vec::new()).is_none());
    }

    #[test]
    fn a_line_does_not_move_to_a_far_edge() {
        let step = Vector4::new(0.03, 0.0, 0.0, 0.0);
        let found = bundle(vec![(step, [90.0, 100.0, 80.0])]);
        assert!(found.is_none_or(|(own, _)| own.is_none()));
    }
}
