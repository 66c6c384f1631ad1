//! How the images of a scene hold light: as a power, and blurred.
//!
//! Photographs hold a root of light, renderings may have added up values. The places of edges
//! tell which: with the wrong one an edge lies aside in each view by what its sides look like
//! there, and views do not agree on where it is in space.

use super::light::{LightProfile, Response};
use super::profile::{PLACES, Profile, SPACING};
use super::step_fit::fit_steps;
use super::step_model::{Step, loss, misfit, offset};
use crate::statistics::upper_median;
use rayon::prelude::*;

/// Values as they are, and the steep part of sRGB (IEC 61966-2-1). Between them views agree
/// between, too.
const EXPONENTS: [f64; 2] = [1.0, 2.4];
/// Blurs that are tried, in pixels: from a point to a lens out of focus.
const BLURS: [f64; 8] = [0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0, 1.3];
/// Profiles tell whose sides differ by so many values …
const MIN_CONTRAST: f64 = 50.0;
/// … about so many of them …
const MAX_PROFILES: usize = 2000;
/// … and no fewer.
const MIN_PROFILES: usize = 30;
/// They hold one edge and nothing else if that explains them but for so many times the noise: in
/// bricks and leaves few do.
const CLEAN: f64 = 3.0;
/// Of a line so many.
const MIN_OF_LINE: usize = 8;
/// Share of them all that the blur is known by, the cleanest.
const CLEANEST: f64 = 0.1;
/// Sides of an edge, in pixels from it: beyond its blur.
const SIDE: [f64; 2] = [1.5, 4.0];
/// Where an edge is sought beside the line, in tenths of pixels.
const SOUGHT: i32 = 15;

/// The response under which views agree best on where the lines of a scene are, whose profiles
/// are given; `None` where too few of these are understood.
pub(super) fn response_of(profiles: &[Vec<Profile>]) -> Option<Response> {
    let tells = |profile: &&Profile| profile.contrast() > MIN_CONTRAST;
    let mut lines: Vec<Vec<&Profile>> = (profiles.iter())
        .map(|profiles| profiles.iter().filter(tells).collect())
        .collect();
    let count: usize = lines.iter().map(Vec::len).sum();
    let stride = count.div_ceil(MAX_PROFILES).max(1);
    lines = lines.into_iter().step_by(stride).collect();
    let candidates = EXPONENTS.map(|exponent| {
        let response = blurred(exponent, &lines)?;
        Some((disagreement(response, &lines)?, response))
    });
    tracing::debug!(?candidates, "what files hold");
    let best = candidates
        .into_iter()
        .flatten()
        .min_by(|a, b| a.0.total_cmp(&b.0));
    Some(best?.1)
}

/// With the blur that the cleanest profiles ask for.
fn blurred(exponent: f64, lines: &[Vec<&Profile>]) -> Option<Response> {
    let profiles: Vec<&Profile> = lines.iter().flatten().copied().collect();
    let mut misfits: Vec<[f64; BLURS.len()]> = (profiles.par_iter())
        .map(|profile| {
            let light = LightProfile::new(profile, exponent);
            BLURS.map(|blur| edge(&light, blur).0)
        })
        .collect();
    if misfits.len() < MIN_PROFILES {
        return None;
    }
    let least = |of: &[f64; BLURS.len()]| of.iter().copied().fold(f64::INFINITY, f64::min);
    misfits.sort_by(|a, b| least(a).total_cmp(&least(b)));
    misfits.truncate((CLEANEST * misfits.len() as f64).ceil() as usize);
    let total = |blur: &usize| misfits.iter().map(|of| loss(of[*blur])).sum::<f64>();
    let best = (0..BLURS.len()).min_by(|a, b| total(a).total_cmp(&total(b)))?;
    Some(Response {
        exponent,
        blur: BLURS[best],
    })
}

/// How far clean profiles lie from where those of the same line have it together, in pixels: the
/// median.
fn disagreement(response: Response, lines: &[Vec<&Profile>]) -> Option<f64> {
    let of_line = |profiles: &Vec<&Profile>| {
        let light: Vec<LightProfile> = (profiles.iter())
            .map(|profile| LightProfile::new(profile, response.exponent))
            .collect();
        let (clean, places): (Vec<&LightProfile>, Vec<f64>) = (light.iter())
            .filter_map(|profile| {
                let (misfit, place) = edge(profile, response.blur);
                (misfit < CLEAN).then_some((profile, place))
            })
            .unzip();
        if clean.len() < MIN_OF_LINE {
            return Vec::new();
        }
        let (together, _) = fit_steps(&clean, vec![Step::zeros()], response.blur);
        let apart =
            |(profile, place): (&&LightProfile, f64)| (place - offset(profile, &together[0])).abs();
        clean.iter().zip(places).map(apart).collect()
    };
    let mut apart: Vec<f64> = lines.par_iter().flat_map_iter(of_line).collect();
    (apart.len() >= MIN_PROFILES).then(|| upper_median(&mut apart))
}

/// The misfit of a single edge where it fits best, and that place beside the line in pixels.
fn edge(profile: &LightProfile, blur: f64) -> (f64, f64) {
    let shift_of_pixel = profile.by_shift / profile.by_shift.norm_squared();
    let at = |place: f64| {
        let shift = shift_of_pixel * place;
        misfit(profile, &[Step::new(shift.x, shift.y, 0.0, 0.0)], blur)
    };
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

impl Profile {
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

    fn lines(response: Response, noise: f64) -> Vec<Vec<Profile>> {
        let line = |k: u32| {
            let place = 0.002 * f64::from(k) - 0.006;
            let height = 60.0 + 20.0 * f64::from(k);
            let step = Step::new(place, -place, 0.0, 0.001);
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
                let found = response_of(&lines(truth, 3.0)).unwrap();
                assert_eq!(found.exponent, exponent, "{truth:?}");
                assert!((found.blur - blur).abs() < 0.16, "{found:?} {truth:?}");
            }
        }
    }

    #[test]
    fn what_is_no_edge_tells_nothing() {
        assert_eq!(
            response_of(&lines(
                Response {
                    exponent: 1.0,
                    blur: 0.5
                },
                200.0
            )),
            None
        );
        assert_eq!(response_of(&[]), None);
    }
}
