//! Rounded edges from in front: light changes all over the round.
//!
//! Blurred as the scene's images are, an edge is a sharp step, and with another edge beside it
//! two. A view that looks at the middle of a fillet shows a ramp, which no two sharp steps
//! explain as well as a single soft one does.

use super::profile::{PLACES, Profile, REACH, SPACING, places};
use super::step_model::step_column;
use crate::statistics::upper_median;
use rayon::prelude::*;

/// Blurs of soft steps by that of the scene: a view that shows a fillet as an outline shows none
/// of three times, as `rounding` has it, and none is wider than what a profile holds.
const SOFT_BLURS: [f64; 4] = [3.0, 4.5, 6.0, 9.0];
/// Pixels between the places where steps are tried.
const TRIED: f64 = 0.25;
/// A step that is the line's own lies within so many pixels of it, judged.
const OWN: f64 = 2.0;
/// Two steps nearer to each other, in pixels, are a soft one, judged.
const APART: f64 = 1.0;
/// The share of the profiles that the noise is known by, the cleanest, as for the blur.
const CLEANEST: f64 = 0.1;
/// The least variance of noise: that of rounding to whole values.
const ROUNDING: f64 = 1.0 / 12.0;
/// A profile shows something if steps explain so many times the noise of it: with 30 and 100 a
/// photographed house has as many soft views, and a casting with fillets half and a sixth of them.
const LEAST_SHOWN: f64 = 4.0;
/// Of the views that show one of 530 true lines of nineteen parts .0005 are soft, .011 of those of
/// the lines of a photographed house, true and false …
const SOFT_OF_EDGES: f64 = 0.012;
/// … and .2 and .4 of those that show the fillets of two parts.
const SOFT_OF_FILLETS: f64 = 0.25;
/// The root of a count has a standard deviation of a half, whatever is counted: 95 % of the true
/// counts are no more than this below it.
const SURE_OF_COUNT: f64 = 0.82;

/// What is left of a profile without its level and slope, in units of squared values of all
/// channels: of all, by two sharp steps and by a soft one.
#[derive(Clone, Copy)]
struct Left {
    all: f64,
    sharp: f64,
    soft: f64,
}

/// Steps without what level and slope explain of them, of length one.
pub(super) struct Softness {
    level_and_slope: [[f64; PLACES]; 2],
    sharp: Vec<[f64; PLACES]>,
    /// Of sharp steps, one of which may be the line's own, and their product.
    pairs: Vec<(usize, usize, f64)>,
    soft: Vec<[f64; PLACES]>,
}

impl Softness {
    /// `blur` is that of the scene, in pixels.
    pub(super) fn new(blur: f64) -> Self {
        let level = [(PLACES as f64).sqrt().recip(); PLACES];
        let length = dot(&places(), &places()).sqrt();
        let level_and_slope = [level, places().map(|place| place / length)];
        let unit = |place: f64, blur: f64| {
            let column = without(&level_and_slope, step_column(place, blur));
            let length = dot(&column, &column).sqrt();
            column.map(|value| value / length)
        };
        let tried = |far: f64| {
            let count = (far / TRIED) as i32;
            (-count..=count).map(|k| f64::from(k) * TRIED)
        };
        let inside: Vec<f64> = tried(REACH - 2.0 * SPACING).collect();
        let sharp: Vec<[f64; PLACES]> = inside.iter().map(|place| unit(*place, blur)).collect();
        let mut pairs = Vec::new();
        for (i, a) in inside.iter().enumerate() {
            for (j, b) in inside.iter().enumerate().skip(i + 1) {
                if b - a >= APART && a.abs().min(b.abs()) <= OWN {
                    pairs.push((i, j, dot(&sharp[i], &sharp[j])));
                }
            }
        }
        let soft = SOFT_BLURS.iter();
        let soft = soft.flat_map(|by| tried(OWN).map(move |place| unit(place, *by * blur)));
        Self {
            level_and_slope,
            sharp,
            pairs,
            soft: soft.collect(),
        }
    }

    /// The nats by which the profiles of each line speak for a fillet, in the views that have
    /// `shown` it.
    pub(super) fn gains<const N: usize>(
        &self,
        profiles: &[Vec<Profile<N>>],
        shown: &[Vec<usize>],
    ) -> Vec<f64> {
        let of_line = |(profiles, shown): (&Vec<Profile<N>>, &Vec<usize>)| {
            let shown = profiles.iter().filter(|of| shown.contains(&of.view));
            shown.map(|of| (of.view, self.left(&of.values))).collect()
        };
        let left: Vec<Vec<(usize, Left)>> = profiles.par_iter().zip(shown).map(of_line).collect();
        let mut rests: Vec<f64> = left.iter().flatten().map(|(_, left)| left.sharp).collect();
        rests.sort_by(f64::total_cmp);
        let cleanest = rests.get((CLEANEST * rests.len() as f64) as usize);
        let values = 3.0 * PLACES as f64;
        let noise = cleanest.map_or(0.0, |rest| *rest).max(ROUNDING * values);
        left.iter().map(|of_line| gain(of_line, noise)).collect()
    }

    fn left(&self, values: &[[f32; 3]; PLACES]) -> Left {
        let channels: [[f64; PLACES]; 3] = std::array::from_fn(|c| {
            let channel = std::array::from_fn(|k| f64::from(values[k][c]));
            without(&self.level_and_slope, channel)
        });
        let all: f64 = channels.iter().map(|channel| dot(channel, channel)).sum();
        let shares = |step: &[f64; PLACES]| channels.map(|channel| dot(&channel, step));
        let sharp: Vec<[f64; 3]> = self.sharp.iter().map(shares).collect();
        let by_pair = |&(i, j, both): &(usize, usize, f64)| {
            let explained = (0..3).map(|c| {
                let (a, b) = (sharp[i][c], sharp[j][c]);
                a * a + b * b - 2.0 * both * a * b
            });
            explained.sum::<f64>() / (1.0 - both * both)
        };
        let by_soft = |step| shares(step).iter().map(|share| share * share).sum();
        let most = |gains: &mut dyn Iterator<Item = f64>| gains.fold(0.0, f64::max);
        Left {
            all,
            sharp: all - most(&mut self.pairs.iter().map(by_pair)),
            soft: all - most(&mut self.soft.iter().map(by_soft)),
        }
    }
}

/// The nats from which on the gain of a line makes it a fillet: those of the odds of one, but no
/// more than `most`. How many of the lines are fillets, those tell whose views alone say so by
/// `most`, as the least share that is likely to make so many.
pub(super) fn least_gain(gains: &[f64], most: f64) -> f64 {
    let count = gains.iter().filter(|gain| **gain > most).count() as f64;
    let share = (count.sqrt() - SURE_OF_COUNT).max(0.0).powi(2) / gains.len().max(1) as f64;
    ((1.0 - share) / share).ln().clamp(0.0, most)
}

/// What all views of a line say. One is soft if most of the parts that it shows are.
fn gain(left: &[(usize, Left)], noise: f64) -> f64 {
    let of_view = |of_view: &[(usize, Left)]| {
        let shows = |left: &Left| left.all - left.sharp.min(left.soft) > LEAST_SHOWN * noise;
        let shown = of_view
            .iter()
            .map(|(_, left)| left)
            .filter(|left| shows(left));
        let ratio = |left: &Left| ((left.sharp + noise) / (left.soft + noise)).ln();
        let mut ratios: Vec<f64> = shown.map(ratio).collect();
        let is_soft = (!ratios.is_empty()).then(|| upper_median(&mut ratios) > 0.0);
        is_soft.map_or(0.0, |soft| {
            if soft {
                (SOFT_OF_FILLETS / SOFT_OF_EDGES).ln()
            } else {
                ((1.0 - SOFT_OF_FILLETS) / (1.0 - SOFT_OF_EDGES)).ln()
            }
        })
    };
    left.chunk_by(|a, b| a.0 == b.0).map(of_view).sum()
}

fn without(parts: &[[f64; PLACES]; 2], mut values: [f64; PLACES]) -> [f64; PLACES] {
    for part in parts {
        let share = dot(part, &values);
        for (value, part) in values.iter_mut().zip(part) {
            *value -= share * part;
        }
    }
    values
}

fn dot(a: &[f64; PLACES], b: &[f64; PLACES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::light::Response;
    use crate::assemble::profiles::test_profiles::{PIXELS, Steps};
    use nalgebra::Vector4;

    const BLUR: f64 = 0.5;
    const VIEWS: usize = 20;

    /// Steps of so much light, so many pixels beside the line.
    fn seen(steps: &[(f64, f64)], blur: f64) -> Vec<Profile<4>> {
        let step = |&(place, height): &(f64, f64)| {
            (Vector4::new(place / PIXELS, 0.0, 0.0, 0.0), [height; 3])
        };
        let exponent = 1.0;
        let steps = Steps {
            steps: steps.iter().map(step).collect(),
            response: Response { exponent, blur },
            noise: 1.0,
        };
        steps.profiles(VIEWS)
    }

    fn gain_of(profiles: Vec<Profile<4>>) -> f64 {
        let clean = seen(&[(0.0, 90.0)], BLUR);
        let shown = [0, 1].map(|_| (0..VIEWS).collect());
        Softness::new(BLUR).gains(&[profiles, clean], &shown)[0]
    }

    #[test]
    fn a_ramp_is_soft_and_edges_side_by_side_are_not() {
        assert!(gain_of(seen(&[(0.5, 40.0)], 4.0 * BLUR)) > 40.0);
        assert!(gain_of(seen(&[(0.5, 40.0)], BLUR)) < -5.0);
        assert!(gain_of(seen(&[(0.0, 40.0), (2.5, 60.0)], BLUR)) < -5.0);
        // A plain face shows nothing.
        assert_eq!(gain_of(seen(&[], BLUR)), 0.0);
    }

    #[test]
    fn a_few_soft_views_make_no_fillet() {
        let mut profiles = seen(&[(0.0, 60.0)], BLUR);
        let soft = seen(&[(0.0, 60.0)], 4.0 * BLUR);
        for (profile, soft) in profiles.iter_mut().zip(soft) {
            if profile.view < 2 {
                *profile = soft;
            }
        }
        assert!(gain_of(profiles) < 3.0);
    }

    #[test]
    fn where_many_lines_are_fillets_less_is_asked_for() {
        let gains = |fillets: usize| -> Vec<f64> {
            let gain = |k| if k < fillets { 20.0 } else { -2.0 };
            (0..70).map(gain).collect()
        };
        assert_eq!(least_gain(&gains(0), 12.0), 12.0);
        assert!(least_gain(&gains(1), 12.0) > 7.0);
        assert!((0.5..1.5).contains(&least_gain(&gains(23), 12.0)));
        assert_eq!(least_gain(&gains(70), 12.0), 0.0);
        assert_eq!(least_gain(&[], 12.0), 12.0);
    }
}
