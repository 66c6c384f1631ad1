//! One more step at a time (matching pursuit): what each profile gains by a step at each place
//! beside the curve is projected back into the plane across the curve in space.

use super::curve::{Curve, Step};
use super::light::LightProfile;
use super::profile::{PLACES, REACH};
use super::step_fit::fit_steps;
use super::step_model::{NOISE_SQUARES, StepModel, loss, offset, step_column};
use nalgebra::Vector2;

/// Pixels between the places beside the curve where a step is tried: half the blur.
pub(super) const TRIED: f64 = 0.25;
const OFFSETS: usize = (2.0 * REACH / TRIED) as usize + 1;
/// Pixels between the places in space.
const CELL: f64 = 0.4;
/// Pixels around the curve where they lie: beyond, an edge is another line's matter.
const WINDOW: f64 = 4.5;
/// Steps nearer to each other cannot be told apart, in pixels.
const LEAST_DISTANCE: f64 = 0.5;
/// A column of which the others leave less is theirs.
const LEAST_COLUMN: f64 = 1e-6;

/// By place beside the line, by how much one more step there lowers the loss of a profile.
type Gains = [f64; OFFSETS];

/// Places where a step is tried, as columns.
pub(super) struct Columns(pub(super) [[f64; PLACES]; OFFSETS]);

impl Columns {
    pub(super) fn new(blur: f64) -> Self {
        Self(std::array::from_fn(|k| {
            step_column(k as f64 * TRIED - REACH, blur)
        }))
    }
}

/// What one more step explains of a profile.
pub(super) struct OneStep {
    model: StepModel,
    rests: [[f64; PLACES]; 3],
    squares: f64,
}

impl OneStep {
    pub(super) fn new<const N: usize>(
        profile: &LightProfile<N>,
        steps: &[Step<N>],
        blur: f64,
    ) -> Self {
        let model = StepModel::new(profile, steps, blur);
        let rests = profile.light.map(|light| model.rest(&light).0);
        Self {
            squares: rests.iter().map(|rest| model.product(rest, rest)).sum(),
            model,
            rests,
        }
    }

    /// By how much a step that is this column lowers the loss.
    pub(super) fn gain(&self, column: &[f64; PLACES]) -> f64 {
        let Self {
            model,
            rests,
            squares,
        } = self;
        let (new, _) = model.rest(column);
        let own = model.product(&new, &new);
        if own < LEAST_COLUMN {
            return 0.0;
        }
        let explained = rests.iter().map(|rest| model.product(&new, rest).powi(2));
        let left = (squares - explained.sum::<f64>() / own).max(0.0);
        loss(squares / NOISE_SQUARES) - loss(left / NOISE_SQUARES)
    }
}

fn gains<const N: usize>(
    profile: &LightProfile<N>,
    steps: &[Step<N>],
    columns: &Columns,
    blur: f64,
) -> Gains {
    let step = OneStep::new(profile, steps, blur);
    std::array::from_fn(|k| step.gain(&columns.0[k]))
}

/// How far a shift of the curve moves it in the images, in pixels: root mean square.
pub(super) fn pixels<const N: usize>(profiles: &[&LightProfile<N>], shift: &Vector2<f64>) -> f64 {
    let squares: f64 = profiles.iter().map(|p| p.by_shift.dot(shift).powi(2)).sum();
    (squares / profiles.len() as f64).sqrt()
}

/// The steps with one more, all fitted together, and the sum of losses; `pixel` is the size of one.
/// `None` if there is no room.
pub(super) fn one_more<const N: usize>(
    curve: &impl Curve<N>,
    profiles: &[&LightProfile<N>],
    steps: &[Step<N>],
    pixel: f64,
    columns: &Columns,
    blur: f64,
) -> Option<(Vec<Step<N>>, f64)> {
    let tables: Vec<Gains> = (profiles.iter())
        .map(|profile| gains(profile, steps, columns, blur))
        .collect();
    let by_step = curve.shift_by_step(curve.middle());
    let known: Vec<Vector2<f64>> = steps.iter().map(|step| by_step * step).collect();
    // It is slanted as the first one.
    let first = steps.first().copied().unwrap_or_else(Step::zeros);
    let slant = first - curve.step_of_shift(&(by_step * first));
    let cells = (WINDOW / CELL) as i32;
    let mut best: Option<(f64, Step<N>)> = None;
    for i in -cells..=cells {
        for j in -cells..=cells {
            let shift = Vector2::new(f64::from(i), f64::from(j)) * (CELL * pixel);
            let is_known =
                |other: &Vector2<f64>| pixels(profiles, &(shift - other)) < LEAST_DISTANCE;
            if known.iter().any(is_known) {
                continue;
            }
            let step = slant + curve.step_of_shift(&shift);
            let gain = |(profile, table): (&&LightProfile<N>, &Gains)| {
                let place = (offset(profile, &step) + REACH) / TRIED;
                let inside = (0.0..OFFSETS as f64 - 0.5).contains(&place);
                if inside {
                    table[place.round() as usize]
                } else {
                    0.0
                }
            };
            let gain: f64 = profiles.iter().zip(&tables).map(gain).sum();
            if best.is_none_or(|(most, _)| gain > most) {
                best = Some((gain, step));
            }
        }
    }
    let (_, step) = best?;
    Some(fit_steps(profiles, [steps, &[step]].concat(), blur))
}
