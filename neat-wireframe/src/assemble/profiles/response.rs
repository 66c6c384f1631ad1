//! How the images of a scene hold light: as a power, and blurred.
//!
//! Photographs hold a root of light, renderings may have added up values. The places of edges
//! tell which: with the wrong one an edge lies aside in each view by what its sides look like
//! there, and views do not agree on where it is in space.

use super::curve::Step;
use super::light::{LightProfile, Response};
use super::profile::{PLACES, Profile, SPACING};
use super::step_fit::fit_steps;
use super::step_model::{loss, misfit_at, offset};
use crate::statistics::upper_median;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BTreeSet;

/// Values as they are, and the steep part of sRGB (IEC 61966-2-1). Between them views agree
/// between, too.
const EXPONENTS: [f64; 2] = [1.0, 2.4];
/// Blurs that are tried, in pixels: from a point to a lens out of focus.
const BLURS: [f64; 8] = [0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0, 1.3];
/// Profiles tell whose sides differ by so many values …
const MIN_CONTRAST: f64 = 50.0;
/// … and no fewer of them.
const MIN_PROFILES: usize = 30;
/// About so many are asked for the blur, of curves of all kinds.
const FOR_BLUR: usize = 2000;
/// So many are asked for the exponent, of the curves that most views show. Of ten tenths of the
/// lines of a façade two told the wrong one, with 300 clean profiles each; with 320 lines in this
/// order it is the farthest ahead.
const FOR_EXPONENT: usize = 4000;
/// They hold one edge and nothing else if that explains them but for so many times the noise: in
/// bricks and leaves few do.
const CLEAN: f64 = 3.0;
/// Of a curve so many.
const MIN_OF_CURVE: usize = 8;
/// Share of them all that the blur is known by, the cleanest.
const CLEANEST: f64 = 0.1;
/// Sides of an edge, in pixels from it: beyond its blur.
const SIDE: [f64; 2] = [1.5, 4.0];
/// Where an edge is sought beside the line, in tenths of pixels.
const SOUGHT: i32 = 15;

/// The profiles of curves that tell, and which of these are asked.
struct Telling<'a, const N: usize>(Vec<Vec<&'a Profile<N>>>);

/// The response under which views agree best on where the lines and arcs of a scene are, whose
/// profiles are given; `None` where too few of these are understood.
pub(super) fn response_of(lines: &[Vec<Profile<4>>], arcs: &[Vec<Profile<6>>]) -> Option<Response> {
    let (lines, arcs) = (Telling::new(lines), Telling::new(arcs));
    let count = lines.count() + arcs.count();
    let stride = count.div_ceil(FOR_BLUR).max(1);
    let of_all_kinds = (lines.one_of(stride), arcs.one_of(stride));
    let share = FOR_EXPONENT as f64 / count.max(1) as f64;
    let most_seen = (lines.most_seen(share), arcs.most_seen(share));
    let candidates = EXPONENTS.map(|exponent| {
        let (lines, arcs) = &of_all_kinds;
        let misfits = [lines.misfits(exponent), arcs.misfits(exponent)].concat();
        let response = blurred(exponent, misfits)?;
        let (lines, arcs) = &most_seen;
        let mut apart = lines.disagreements(response);
        apart.extend(arcs.disagreements(response));
        let disagreement = (apart.len() >= MIN_PROFILES).then(|| upper_median(&mut apart));
        Some((disagreement?, response))
    });
    tracing::debug!(?candidates, "what files hold");
    let best = candidates
        .into_iter()
        .flatten()
        .min_by(|a, b| a.0.total_cmp(&b.0));
    Some(best?.1)
}

/// The misfits of an edge alone with each blur.
type Misfits = [f64; BLURS.len()];

/// With the blur that the cleanest profiles ask for.
fn blurred(exponent: f64, mut misfits: Vec<Misfits>) -> Option<Response> {
    if misfits.len() < MIN_PROFILES {
        return None;
    }
    let least = |of: &Misfits| of.iter().copied().fold(f64::INFINITY, f64::min);
    misfits.sort_by(|a, b| least(a).total_cmp(&least(b)));
    misfits.truncate((CLEANEST * misfits.len() as f64).ceil() as usize);
    let total = |blur: &usize| misfits.iter().map(|of| loss(of[*blur])).sum::<f64>();
    let best = (0..BLURS.len()).min_by(|a, b| total(a).total_cmp(&total(b)))?;
    Some(Response {
        exponent,
        blur: BLURS[best],
    })
}

impl<'a, const N: usize> Telling<'a, N> {
    fn new(profiles: &'a [Vec<Profile<N>>]) -> Self {
        let tells = |profile: &&Profile<N>| profile.contrast() > MIN_CONTRAST;
        let of_curve = |profiles: &'a Vec<Profile<N>>| profiles.iter().filter(tells).collect();
        Self(profiles.iter().map(of_curve).collect())
    }

    fn count(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    /// One of so many curves.
    fn one_of(&self, stride: usize) -> Self {
        Self(self.0.iter().step_by(stride).cloned().collect())
    }

    /// The curves that most views show, with this share of all profiles.
    fn most_seen(&self, share: f64) -> Self {
        let views = |profiles: &Vec<&Profile<N>>| {
            let views: BTreeSet<usize> = profiles.iter().map(|profile| profile.view).collect();
            views.len()
        };
        let mut curves = self.0.clone();
        curves.sort_by_cached_key(|profiles| Reverse(views(profiles)));
        let mut left = (share * self.count() as f64).ceil() as usize;
        curves.retain(|profiles| {
            let wanted = left > 0;
            left = left.saturating_sub(profiles.len());
            wanted
        });
        Self(curves)
    }

    fn misfits(&self, exponent: f64) -> Vec<Misfits> {
        let profiles: Vec<&Profile<N>> = self.0.iter().flatten().copied().collect();
        let of_profile = |profile: &&Profile<N>| {
            let light = LightProfile::new(profile, exponent);
            BLURS.map(|blur| edge(&light, blur).0)
        };
        profiles.par_iter().map(of_profile).collect()
    }

    /// How far clean profiles lie from where those of the same curve have it together, in pixels.
    fn disagreements(&self, response: Response) -> Vec<f64> {
        let of_curve = |profiles: &Vec<&Profile<N>>| {
            let light: Vec<LightProfile<N>> = (profiles.iter())
                .map(|profile| LightProfile::new(profile, response.exponent))
                .collect();
            let (clean, places): (Vec<&LightProfile<N>>, Vec<f64>) = (light.iter())
                .filter_map(|profile| {
                    let (misfit, place) = edge(profile, response.blur);
                    (misfit < CLEAN).then_some((profile, place))
                })
                .unzip();
            if clean.len() < MIN_OF_CURVE {
                return Vec::new();
            }
            let (together, _) = fit_steps(&clean, vec![Step::zeros()], response.blur);
            let apart = |(profile, place): (&&LightProfile<N>, f64)| {
                (place - offset(profile, &together[0])).abs()
            };
            clean.iter().zip(places).map(apart).collect()
        };
        self.0.par_iter().flat_map_iter(of_curve).collect()
    }
}

/// The misfit of a single edge where it fits best, and that place beside the line in pixels.
fn edge<const N: usize>(profile: &LightProfile<N>, blur: f64) -> (f64, f64) {
    let at = |place: f64| misfit_at(profile, place, blur);
    let tried: Vec<f64> = (-SOUGHT..=SOUGHT)
        .map(|tenths| at(0.1 * f64::from(tenths)))
        .collect();
    let best = (0..tried.len()).fold(0, |best, k| if tried[k] < tried[best] { k } else { best });
    let mut place = 0.1 * (best as f64 - f64::from(SOUGHT));
    if let [Some(before), Some(after)] =
        [best.checked_sub(1), Some(best + 1)].map(|k| tried.get(k?))
    {
        // The parabola through three places.
        let bend = before - 2.0 * tried[best] + after;
        if bend > 0.0 {
            place += 0.05 * (before - after) / bend;
        }
    }
    (tried[best], place)
}

impl<const N: usize> Profile<N> {
    /// How much the two sides of the line differ, in values.
    fn contrast(&self) -> f64 {
        let middle = PLACES / 2;
        let [near, far] = SIDE.map(|pixels| (pixels / SPACING) as usize);
        let mean = |places: std::ops::RangeInclusive<usize>, c: usize| {
            let count = (far - near + 1) as f64;
            places.map(|k| f64::from(self.values[k][c])).sum::<f64>() / count
        };
        let of_channel = |c: usize| {
            let before = mean(middle - far..=middle - near, c);
            (before - mean(middle + near..=middle + far, c)).abs()
        };
        (0..3).map(of_channel).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::test_profiles::Steps;
    use nalgebra::Vector4;

    fn lines(response: Response, noise: f64) -> Vec<Vec<Profile<4>>> {
        let line = |k: u32| {
            let place = 0.002 * f64::from(k) - 0.006;
            let height = 60.0 + 20.0 * f64::from(k);
            let step = Vector4::new(place, -place, 0.0, 0.001);
            let steps = vec![(step, [height, 0.9 * height, 0.6 * height])];
            let seen = Steps {
                steps,
                response,
                noise,
            };
            seen.profiles(12)
        };
        (0..6).map(line).collect()
    }

    #[test]
    fn views_tell_light_from_values_and_how_blurred_they_are() {
        for exponent in EXPONENTS {
            for blur in [0.4, 0.7, 1.0] {
                let truth = Response { exponent, blur };
                let found = response_of(&lines(truth, 3.0), &[]).unwrap();
                assert_eq!(found.exponent, exponent, "{truth:?}");
                assert!((found.blur - blur).abs() < 0.16, "{found:?} {truth:?}");
            }
        }
    }

    #[test]
    fn the_curves_of_most_views_are_asked_until_there_are_enough() {
        let seen = Steps {
            steps: vec![(Vector4::zeros(), [200.0; 3])],
            response: Response {
                exponent: 1.0,
                blur: 0.5,
            },
            noise: 0.0,
        };
        let lines = [3, 12, 6, 12].map(|views| seen.profiles(views));
        let telling = Telling::new(&lines);
        let asked = |share: f64| -> Vec<usize> {
            let views = |profiles: &Vec<&Profile<4>>| profiles.last().unwrap().view + 1;
            telling.most_seen(share).0.iter().map(views).collect()
        };
        assert_eq!(asked(0.3), [12]);
        assert_eq!(asked(0.7), [12, 12]);
        assert_eq!(asked(2.0), [12, 12, 6, 3]);
    }

    #[test]
    fn what_is_no_edge_tells_nothing() {
        assert_eq!(
            response_of(
                &lines(
                    Response {
                        exponent: 1.0,
                        blur: 0.5
                    },
                    200.0
                ),
                &[]
            ),
            None
        );
        assert_eq!(response_of(&[], &[]), None);
    }
}
