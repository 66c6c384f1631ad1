//! Rounded edges: no line of a fillet is where it is seen in every view.
//!
//! A fillet is a part of a cylinder of a few pixels. The views that see it as an outline see a
//! line of it each, all of them near its middle: an edgel's reach does not tell them from an
//! edge. But the line that a view sees lies the cylinder's radius aside of its axis, to the side
//! that the surface turns to, and an edge is an axis of radius zero. So both are asked how well
//! they explain where the views have their step, to a tenth of a pixel.

use super::light::LightProfile;
use super::profile::REACH;
use super::pursuit::{Columns, OneStep, TRIED};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// A step is sought within so many pixels of the line …
const SOUGHT: f64 = 3.0;
/// … and is another thing's if it is farther off than this, as what an outline of a right
/// angle's fillet of four pixels may be.
const FAR: f64 = 1.6;
/// It must lower the loss of a profile by this, as for steps beside lines.
const LEAST_GAIN: f64 = 0.3;
/// A view that shows the fillet from in front shows a wide step, anywhere on it: it is wide if a
/// blur so many times the scene's explains it better, judged.
const WIDE: f64 = 3.0;
/// A view's step is off by so much, in pixels: .02 to .05 on renderings, .13 on photographs; with
/// .15 a quarter fewer fillets are told.
const SIGMA: f64 = 0.1;
/// Degrees of freedom of Student's distribution of its errors: poses and neighbours make tails.
const FREEDOM: f64 = 3.0;
/// Share of the views that have the step of something else there.
const OTHERS: f64 = 0.1;
/// Fewer views tell nothing: three tell any radius.
const MIN_VIEWS: usize = 5;
/// So many directions out of the surface are tried.
const DIRECTIONS: usize = 36;
/// A fillet of a right angle is an outline in views that its middle is turned from by up to 45° to
/// both sides; some more. With .5 and .7 as many are told.
const MIN_COSINE: f64 = 0.6;
/// It must explain the views so much better than an edge, in nats, as outlines must.
pub(super) const ADVANTAGE: f64 = 12.0;
/// It must have the step of this share of the views, and of more than an edge has: thin plates
/// and grooves look like tubes to some views, and have an edge in others. With .6 true edges of
/// parts are lost, with .75 a twentieth fewer fillets are told.
const COMMON: f64 = 0.7;
/// And of so many views from both sides of its middle: what has another edge beside it looks
/// round from one, as 15 edges of a façade did that nobody could walk around.
const MIN_FROM_SIDE: usize = 2;
/// To so many pixels.
const NEAR: f64 = 0.25;
/// Rounds of reweighting.
const ROUNDS: usize = 10;
/// What keeps a parameter where no view tells of it.
const RIDGE: f64 = 1e-9;

/// The columns of sharp steps and of wide ones.
pub(super) struct Widths {
    sharp: Columns,
    wide: Columns,
}

impl Widths {
    pub(super) fn new(blur: f64) -> Self {
        let [sharp, wide] = [blur, WIDE * blur].map(Columns::new);
        Self { sharp, wide }
    }
}

/// Where a view has a sharp step.
#[derive(Clone, Copy, Debug)]
struct Sighting {
    /// Pixels across the line by shifts of it, over those of the median view.
    by_shift: Vector2<f64>,
    /// In pixels from the line.
    offset: f64,
}

/// By how many nats a line is rather the middle of a rounded edge, of at least `least_radius`
/// pixels, than an edge; 0 where it may be an edge for other reasons.
pub(super) fn outline_gain(
    profiles: &[LightProfile<4>],
    widths: &Widths,
    blur: f64,
    least_radius: f64,
) -> f64 {
    let sightings = sightings(profiles, widths, blur);
    if sightings.len() < MIN_VIEWS {
        return 0.0;
    }
    gain_of_round(&sightings, least_radius)
}

fn sightings(profiles: &[LightProfile<4>], widths: &Widths, blur: f64) -> Vec<Sighting> {
    let mut sightings: Vec<Sighting> = (profiles.chunk_by(|a, b| a.view == b.view))
        .filter_map(|of_view| {
            let sharp = |profile: &LightProfile<4>| sharp_step(profile, widths, blur);
            let mut offsets: Vec<f64> = of_view.iter().filter_map(sharp).collect();
            let by_shift: Vector2<f64> = of_view.iter().map(|profile| profile.by_shift).sum();
            let offset = upper_median(&mut offsets);
            (!offsets.is_empty() && offset.abs() < FAR).then(|| Sighting {
                by_shift: by_shift / of_view.len() as f64,
                offset,
            })
        })
        .collect();
    let mut sizes: Vec<f64> = sightings.iter().map(|s| s.by_shift.norm()).collect();
    let size = upper_median(&mut sizes);
    sightings.iter_mut().for_each(|s| s.by_shift /= size);
    sightings
}

/// Where the step of a profile is, if it is sharp.
fn sharp_step(profile: &LightProfile<4>, widths: &Widths, blur: f64) -> Option<f64> {
    let step = OneStep::new(profile, &[], blur);
    let (place, gain) = step_of(&step, &widths.sharp);
    let shown = gain > LEAST_GAIN && place.abs() < SOUGHT - TRIED;
    (shown && gain > step_of(&step, &widths.wide).1).then_some(place)
}

/// The best place of a step, and what it gains.
fn step_of(step: &OneStep, columns: &Columns) -> (f64, f64) {
    let first = ((REACH - SOUGHT) / TRIED) as usize;
    let gains: Vec<f64> = (columns.0[first..=columns.0.len() - 1 - first].iter())
        .map(|column| step.gain(column))
        .collect();
    let best = (0..gains.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b]));
    let best = best.unwrap_or_default().clamp(1, gains.len() - 2);
    let [before, here, after] = [best - 1, best, best + 1].map(|k| gains[k]);
    let bend = before - 2.0 * here + after;
    let beyond = if bend < 0.0 {
        (0.5 * (before - after) / bend).clamp(-1.0, 1.0)
    } else {
        0.0
    };
    ((best as f64 + beyond) * TRIED - SOUGHT, here)
}

fn gain_of_round(sightings: &[Sighting], least_radius: f64) -> f64 {
    let of_edge: Vec<Row> = sightings.iter().map(|s| Row::new(s, 0.0)).collect();
    let edge = Fit::new(&of_edge);
    let by_direction = (0..DIRECTIONS).filter_map(|k| {
        let (sin, cos) = (TAU * k as f64 / DIRECTIONS as f64).sin_cos();
        let outward = Vector2::new(cos, sin);
        let (outlines, others): (Vec<&Sighting>, Vec<&Sighting>) =
            (sightings.iter()).partition(|s| s.turned_to(&outward).abs() > MIN_COSINE);
        let rows: Vec<Row> = (outlines.iter())
            .map(|s| Row::new(s, s.turned_to(&outward).signum()))
            .collect();
        let fit = (rows.len() >= MIN_VIEWS).then(|| Fit::new(&rows))?;
        let gain = fit.likelihood + others.len() as f64 * of_chance().ln() - edge.likelihood;
        (fit.parameters.z > least_radius).then_some((gain, fit.near))
    });
    let best = by_direction.max_by(|a, b| a.0.total_cmp(&b.0));
    let holds = |(_, near): &(f64, [usize; 2])| {
        let all: usize = near.iter().sum();
        all as f64 >= COMMON * sightings.len() as f64
            && all > edge.near.iter().sum::<usize>()
            && near.iter().all(|from_side| *from_side >= MIN_FROM_SIDE)
    };
    best.filter(holds).map_or(0.0, |(gain, _)| gain.max(0.0))
}

impl Sighting {
    /// The cosine between a direction and the outline's side of the sight.
    fn turned_to(&self, outward: &Vector2<f64>) -> f64 {
        self.by_shift.dot(outward) / self.by_shift.norm()
    }
}

/// How the offset in a view changes with both coordinates of the axis and with the radius.
struct Row {
    by_parameters: Vector3<f64>,
    offset: f64,
}

impl Row {
    /// `side` is where the axis has the outline: 0 is that of an edge.
    fn new(sighting: &Sighting, side: f64) -> Self {
        let by_radius = side * sighting.by_shift.norm();
        Self {
            by_parameters: sighting.by_shift.push(by_radius),
            offset: sighting.offset,
        }
    }

    fn rest(&self, parameters: &Vector3<f64>) -> f64 {
        self.offset - self.by_parameters.dot(parameters)
    }
}

/// Where an axis and a radius explain the offsets best.
struct Fit {
    parameters: Vector3<f64>,
    /// Logarithm of the density of the offsets.
    likelihood: f64,
    /// How many are explained, from both sides.
    near: [usize; 2],
}

impl Fit {
    /// From where the line is, and from where all views together have it.
    fn new(rows: &[Row]) -> Self {
        let here = Self::from_weights(rows, |row| weight(row.offset));
        let together = Self::from_weights(rows, |_| 1.0);
        if together.likelihood > here.likelihood {
            together
        } else {
            here
        }
    }

    fn from_weights(rows: &[Row], first: impl Fn(&Row) -> f64) -> Self {
        let mut parameters = solved(rows, first);
        for _ in 0..ROUNDS {
            parameters = solved(rows, |row| weight(row.rest(&parameters)));
        }
        let (mut likelihood, mut near) = (0.0, [0; 2]);
        for row in rows {
            let rest = row.rest(&parameters);
            likelihood += density(rest).ln();
            near[usize::from(row.by_parameters.z < 0.0)] += usize::from(rest.abs() < NEAR);
        }
        Self {
            parameters,
            likelihood,
            near,
        }
    }
}

fn solved(rows: &[Row], weight: impl Fn(&Row) -> f64) -> Vector3<f64> {
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for row in rows {
        let weighted = weight(row) * row.by_parameters;
        matrix += weighted * row.by_parameters.transpose();
        right += weighted * row.offset;
    }
    matrix += Matrix3::identity() * (RIDGE * rows.len() as f64);
    (matrix.cholesky()).map_or_else(Vector3::zeros, |cholesky| cholesky.solve(&right))
}

/// That of a step of something else, which may be anywhere.
fn of_chance() -> f64 {
    (2.0 * FAR).recip()
}

/// Of the step itself, by Student's distribution: with 3 degrees of freedom its constant is
/// 2 / (π √3).
fn of_step(rest: f64) -> f64 {
    let peak = 2.0 / (PI * FREEDOM.sqrt() * SIGMA);
    peak * (1.0 + (rest / SIGMA).powi(2) / FREEDOM).powf(-0.5 * (FREEDOM + 1.0))
}

fn density(rest: f64) -> f64 {
    (1.0 - OTHERS) * of_step(rest) + OTHERS * of_chance()
}

/// What an offset counts when it is this far off.
fn weight(rest: f64) -> f64 {
    let of_step = (1.0 - OTHERS) * of_step(rest);
    let own = of_step / (of_step + OTHERS * of_chance());
    own * (FREEDOM + 1.0) / (FREEDOM + (rest / SIGMA).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::light::Response;
    use crate::assemble::profiles::test_profiles::{PIXELS, Steps};
    use crate::test_scenes::Noise;
    use nalgebra::Vector4;

    const RESPONSE: Response = Response {
        exponent: 2.4,
        blur: 0.6,
    };
    /// In pixels.
    const LEAST_RADIUS: f64 = 1.5;

    /// From all around a line, where a view whose image normal is this has its step, if it has.
    fn seen_from_around(offset: impl Fn(&Vector2<f64>) -> Option<f64>) -> Vec<Sighting> {
        let mut noise = Noise(3);
        (0..24)
            .filter_map(|view| {
                let (sin, cos) = (TAU * (f64::from(view) + 0.3) / 24.0).sin_cos();
                let by_shift = Vector2::new(-sin, cos);
                let offset = offset(&by_shift)? + 0.05 * noise.uniform();
                Some(Sighting { by_shift, offset })
            })
            .collect()
    }

    /// What a fillet of a right angle along the x direction shows of itself as an outline.
    fn outline(by_shift: &Vector2<f64>, radius: f64) -> Option<f64> {
        let turned = by_shift.x;
        (turned.abs() > 0.7).then(|| radius * (turned.signum() - turned))
    }

    #[test]
    fn a_fillet_is_told_from_an_edge() {
        let fillet = |radius| seen_from_around(move |by_shift| outline(by_shift, radius));
        assert!(ADVANTAGE < gain_of_round(&fillet(4.0), LEAST_RADIUS));
        assert!(ADVANTAGE >= gain_of_round(&fillet(4.0), 6.0));
        // Less than what poses are off by.
        assert!(ADVANTAGE >= gain_of_round(&fillet(0.2), 0.0));
        // An edge a little aside, of which some views see another thing.
        let aside = Vector2::new(0.3, -0.2);
        let edge = |others: f64| {
            seen_from_around(move |by_shift| {
                let other = by_shift.y > others;
                Some(if other { 1.2 } else { by_shift.dot(&aside) })
            })
        };
        assert!(ADVANTAGE >= gain_of_round(&edge(1.0), LEAST_RADIUS));
        assert!(ADVANTAGE >= gain_of_round(&edge(0.5), LEAST_RADIUS));
    }

    #[test]
    fn an_edge_that_most_views_have_in_place_stays_one() {
        // What looks like a fillet from some sides is an edge from the others.
        let both = seen_from_around(|by_shift| Some(outline(by_shift, 4.0).unwrap_or_default()));
        assert!(ADVANTAGE >= gain_of_round(&both, LEAST_RADIUS));
    }

    #[test]
    fn profiles_of_an_outline_tell_of_its_radius() {
        let widths = Widths::new(RESPONSE.blur);
        let rounded = |radius: f64, blur: f64| {
            let profiles: Vec<LightProfile<4>> = (0..24)
                .flat_map(|view| {
                    let (sin, cos) = (1.2 * f64::from(view) / 24.0 - 0.6).sin_cos();
                    let shift = radius / PIXELS * Vector2::new(cos - 1.0, sin);
                    let seen = Steps {
                        steps: vec![(Vector4::new(shift.x, shift.y, 0.0, 0.0), [90.0; 3])],
                        response: Response { blur, ..RESPONSE },
                        noise: 1.0,
                    };
                    let of_view = move |profile: &LightProfile<4>| profile.view == view as usize;
                    let from_other_side = move |mut profile: LightProfile<4>| {
                        if view % 2 == 1 {
                            profile.by_shift = -profile.by_shift;
                            profile.light.iter_mut().for_each(|light| light.reverse());
                            profile.weights.reverse();
                        }
                        profile
                    };
                    (seen.in_light(24).into_iter().filter(of_view)).map(from_other_side)
                })
                .collect();
            outline_gain(&profiles, &widths, RESPONSE.blur, LEAST_RADIUS) > ADVANTAGE
        };
        assert!(rounded(9.0, RESPONSE.blur));
        assert!(!rounded(0.0, RESPONSE.blur));
        // No view has a sharp step.
        assert!(!rounded(9.0, 3.0 * RESPONSE.blur));
    }
}
