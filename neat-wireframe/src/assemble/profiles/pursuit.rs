//! One more step at a time (matching pursuit): what each profile gains by a step at each place
//! beside the line is projected back into the plane across the line in space.

use super::light::LightProfile;
use super::profile::{PLACES, REACH};
use super::step_fit::fit_steps;
use super::step_model::{NOISE_SQUARES, Step, StepModel, loss, offset, step_column};
use nalgebra::Vector2;

/// Pixels between the places beside the line where a step is tried: half the blur.
const TRIED: f64 = 0.25;
const OFFSETS: usize = (2.0 * REACH / TRIED) as usize + 1;
/// Pixels between the places in space.
const CELL: f64 = 0.4;
/// Pixels around the line where they lie: beyond, an edge is another line's matter.
const WINDOW: f64 = 4.5;
/// Steps nearer to each other cannot be told apart, in pixels.
const LEAST_DISTANCE: f64 = 0.5;
/// A column of which the others leave less is theirs.
const LEAST_COLUMN: f64 = 1e-6;

/// By place beside the line, by how much one more step there lowers the loss of a profile.
type Gains = [f64; OFFSETS];

/// Places where a step is tried, as columns.
pub(super) struct Columns([[f64; PLACES]; OFFSETS]);

impl Columns {
    pub(super) fn new(blur: f64) -> Self {
        Self(std::array::from_fn(|k| {
            step_column(k as f64 * TRIED - REACH, blur)
        }))
    }
}

fn gains(profile: &LightProfile, steps: &[Step], columns: &Columns, blur: f64) -> Gains {
    let model = StepModel::new(profile, steps, blur);
    let rests = profile.light.map(|light| model.rest(&light).0);
    let squares: f64 = rests.iter().map(|rest| model.product(rest, rest)).sum();
    std::array::from_fn(|k| {
        let (new, _) = model.rest(&columns.0[k]);
        let own = model.product(&new, &new);
        if own < LEAST_COLUMN {
            return 0.0;
        }
        let explained = rests.iter().map(|rest| model.product(&new, rest).powi(2));
        let left = (squares - explained.sum::<f64>() / own).max(0.0);
        loss(squares / NOISE_SQUARES) - loss(left / NOISE_SQUARES)
    })
}

/// How far a shift of the line moves it in the images, in pixels: root mean square.
pub(super) fn pixels(profiles: &[&LightProfile], shift: &Vector2<f64>) -> f64 {
    let squares: f64 = profiles.iter().map(|p| p.by_shift.dot(shift).powi(2)).sum();
    (squares / profiles.len() as f64).sqrt()
}

/// The steps with one more, all fitted together, and the sum of losses; `pixel` is the size of one.
/// `None` if there is no room.
pub(super) fn one_more(
    profiles: &[&LightProfile],
    steps: &[Step],
    pixel: f64,
    columns: &Columns,
    blur: f64,
) -> Option<(Vec<Step>, f64)> {
    let tables: Vec<Gains> = (profiles.iter())
        .map(|profile| gains(profile, steps, columns, blur))
        .collect();
    let slant = steps.first().copied().unwrap_or_default();
    let cells = (WINDOW / CELL) as i32;
    let mut best: Option<(f64, Step)> = None;
    for i in -cells..=cells {
        for j in -cells..=cells {
            let shift = Vector2::new(f64::from(i), f64::from(j)) * (CELL * pixel);
            let is_known = |other: &Step| pixels(profiles, &(shift - other.xy())) < LEAST_DISTANCE;
            if steps.iter().any(is_known) {
                continue;
            }
            let step = Step::new(shift.x, shift.y, slant.z, slant.w);
            let gain = |(profile, table): (&&LightProfile, &Gains)| {
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
