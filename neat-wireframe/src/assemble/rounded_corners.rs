//! Corners that an arc rounds.
//!
//! Views in the plane of a short arc see a line, and its pieces in the others may be too short to
//! tell of a bow. But two straight edges in one plane that stop equally far before they meet tell
//! of an arc that touches both.

use super::arc_joints::runs_into;
use super::corner_ways::Meet;
use super::corners::{MAX_GAP, near_pairs, pixel_sizes};
use super::edge_samples::Images;
use super::line_selection::{Chord, ChosenLine};
use neat_core::{CircularArc, LineSegment3};
use rayon::prelude::*;

/// Edges that stop nearer to where they would meet, in pixels, meet there, judged.
pub(super) const MIN_SHORT_IN_PIXELS: f64 = 4.0;
/// Lines are asked whose middles are at most so many of their lengths apart: each stops short by less than
/// its own.
pub(super) const NEAR: f64 = 1.5;
/// Edges stop where both do within so many pixels …
const UNEVEN_IN_PIXELS: f64 = 4.0;
/// … or this share of it: one may be hidden a little earlier. Judged.
const UNEVEN: f64 = 0.3;
/// The arc is off by so many pixels in its middle, where edges stop that uncertainly, judged.
const OFF_IN_PIXELS: f64 = 1.5;
/// Fewer views tell of no arc, as of no line.
const MIN_VIEWS: usize = 3;

/// Two ends of lines, each `2 * line + end`, and the arc between them.
struct Rounding {
    ends: [usize; 2],
    /// How far both stop before they would meet.
    short: f64,
    arc: CircularArc,
}

/// The arcs between lines that stop before they meet, where edgels that no line has `taken` speak for
/// them. An end runs into one arc, the nearest.
pub(super) fn rounded_corners(
    images: &Images,
    lines: &[ChosenLine],
    taken: &[Vec<bool>],
) -> Vec<Chord> {
    let all = roundings(images, lines);
    let mut nearest = vec![f64::INFINITY; 2 * lines.len()];
    for rounding in &all {
        for end in rounding.ends {
            nearest[end] = rounding.short.min(nearest[end]);
        }
    }
    let is_nearest =
        |Rounding { ends, short, .. }: &Rounding| ends.iter().all(|end| *short <= nearest[*end]);
    let wide = Images {
        reach: images.reach.max(OFF_IN_PIXELS),
        ..*images
    };
    (all.par_iter())
        .filter(|rounding| is_nearest(rounding))
        .filter_map(|Rounding { ends, arc, .. }| {
            let [one, other] = ends.map(|end| &lines[end / 2]);
            // Sides of a polygon have others between them.
            let third = arc.sweep() / 3.0;
            let angles = [arc.angles[0] + third, arc.angles[1] - third];
            let middle = wide.evidence_of_sector(arc, angles, Some(taken));
            // Those that show both edges, unless these face away from each other.
            let shown = |view: &usize| other.evidence.views().any(|other| other == *view);
            let mut views: Vec<usize> = one.evidence.views().filter(shown).collect();
            if views.len() < MIN_VIEWS {
                views = middle.views().collect();
            }
            let is_shown = middle.gain > 0.0 && views.len() >= MIN_VIEWS;
            let guess = is_shown.then(|| wide.follow_arc(arc, &views))??;
            let found = images.follow_arc(&guess.arc, &views)?;
            // Or it is something else.
            let touches = |line: &ChosenLine| runs_into(images, &line.line, &found).is_some();
            (touches(one) && touches(other)).then_some(Chord {
                arc: guess.arc,
                views,
                line: None,
            })
        })
        .collect()
}

fn roundings(images: &Images, lines: &[ChosenLine]) -> Vec<Rounding> {
    let pixels = pixel_sizes(images, lines);
    let of_pair = |[i, j]: [usize; 2]| {
        let pixel = pixels[i].max(pixels[j]);
        let found = rounding(&lines[i].line, &lines[j].line, images.reach * pixel, pixel)?;
        let [a, b] = found.ends;
        Some(Rounding {
            ends: [2 * i + a, 2 * j + b],
            ..found
        })
    };
    let pairs = near_pairs(lines, |k| NEAR * lines[k].line.length());
    pairs.into_par_iter().filter_map(of_pair).collect()
}

/// The arc that touches two lines which stop before they meet, and these ends. Each line is followed
/// over the arc until that has left it by `reach`.
fn rounding(one: &LineSegment3, other: &LineSegment3, reach: f64, pixel: f64) -> Option<Rounding> {
    let lines = [one, other];
    let meet = Meet::of(lines, MAX_GAP * reach)?;
    let [a, b] = meet.beyond.map(|(beyond, _)| beyond);
    let is_even = (a - b).abs() <= (UNEVEN_IN_PIXELS * pixel).max(UNEVEN * a.max(b));
    let is_short =
        |k: usize| (MIN_SHORT_IN_PIXELS * pixel..=lines[k].length()).contains(&meet.beyond[k].0);
    if !(is_even && is_short(0) && is_short(1)) {
        return None;
    }
    // From the corner to where it touches: t = d + √(2 r δ), with r = t tan(α / 2).
    let over = (2.0 * reach * meet.tangent).sqrt();
    let touches = (0.5 * (over + (over * over + 2.0 * (a + b)).sqrt())).powi(2);
    Some(Rounding {
        ends: meet.beyond.map(|(_, end)| end),
        short: a + b,
        arc: meet.arc(touches)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn an_arc_touches_both_lines() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.2);
        let line = |a: Vector3<f64>, b: Vector3<f64>| LineSegment3::new(a, b);
        let (pixel, reach) = (0.002, 1e-3_f64);
        // A quarter of a circle of radius 0.1 beside the corner at the origin: at 0.1 it touches,
        // and has left the line by the reach at 0.1 - √(2 · 0.1 · 0.001).
        let short = 0.1 - (0.2 * reach).sqrt();
        let along_x = line(at(0.5, 0.0), at(short, 0.0));
        let along_y = line(at(0.0, short), at(0.0, 0.6));
        let found = rounding(&along_x, &along_y, reach, pixel).unwrap();
        assert_eq!(found.ends, [1, 0]);
        let arc = found.arc;
        assert!((arc.radius - 0.1).abs() < 1e-9 && (arc.center - at(0.1, 0.1)).norm() < 1e-9);
        assert!((arc.sweep() - std::f64::consts::FRAC_PI_2).abs() < 1e-9);

        let none = |other: LineSegment3| rounding(&along_x, &other, reach, pixel).is_none();
        // A corner, one that stops elsewhere, one in another plane, and one beside it.
        assert!(none(line(at(0.0, 0.5), at(0.0, 0.001))));
        assert!(none(line(at(0.0, 0.5), at(0.0, 0.2))));
        assert!(none(along_y.map(|end| end + 0.01 * Vector3::z())));
        assert!(none(line(at(0.5, 0.1), at(0.1, 0.1))));
    }
}
