//! Corners that an arc rounds.
//!
//! Views in the plane of a short arc see a line, and its pieces in the others may be too short to
//! tell of a bow. But two straight edges in one plane that stop equally far before they meet tell
//! of an arc that touches both.

use super::arc_joints::runs_into;
use super::corners::{MAX_GAP, beyond_end, nearest_points, pixel_sizes};
use super::edge_samples::Images;
use super::line_selection::{Chord, ChosenLine};
use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3};
use rayon::prelude::*;

/// Edges that stop nearer to where they would meet, in pixels, meet there, judged.
pub(super) const MIN_SHORT_IN_PIXELS: f64 = 4.0;
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
            })
        })
        .collect()
}

fn roundings(images: &Images, lines: &[ChosenLine]) -> Vec<Rounding> {
    let pixels = pixel_sizes(images, lines);
    let reach = |k: usize| 1.5 * lines[k].line.length();
    let middles: Vec<Vector3<f64>> = lines.iter().map(|line| line.line.point_at(0.5)).collect();
    let of_line = |i: usize| -> Vec<Rounding> {
        (i + 1..lines.len())
            .filter(|j| (middles[i] - middles[*j]).norm() <= reach(i) + reach(*j))
            .filter_map(|j| {
                let pixel = pixels[i].max(pixels[j]);
                let found = rounding(&lines[i].line, &lines[j].line, images.reach * pixel, pixel)?;
                let [a, b] = found.ends;
                Some(Rounding {
                    ends: [2 * i + a, 2 * j + b],
                    ..found
                })
            })
            .collect()
    };
    (0..lines.len()).into_par_iter().flat_map(of_line).collect()
}

/// The arc that touches two lines which stop before they meet, and these ends. Each line is followed
/// over the arc until that has left it by `reach`.
fn rounding(one: &LineSegment3, other: &LineSegment3, reach: f64, pixel: f64) -> Option<Rounding> {
    let (places, gap) = nearest_points(one, other)?;
    let lines = [one, other];
    let short = [0, 1].map(|k| beyond_end(places[k], lines[k].length()));
    let [a, b] = short.map(|(beyond, _)| beyond);
    let is_even = (a - b).abs() <= (UNEVEN_IN_PIXELS * pixel).max(UNEVEN * a.max(b));
    let is_short =
        |k: usize| (MIN_SHORT_IN_PIXELS * pixel..=lines[k].length()).contains(&short[k].0);
    if gap > MAX_GAP * reach || !(is_even && is_short(0) && is_short(1)) {
        return None;
    }
    let corner = 0.5 * (one.point_at(places[0]) + other.point_at(places[1]));
    let toward = [0, 1].map(|k| (lines[k].ends()[1 - short[k].1] - corner).normalize());
    let bisector = (toward[0] + toward[1]).try_normalize(1e-9)?;
    let cosine = bisector.dot(&toward[0]);
    let tangent = (1.0 - cosine * cosine).sqrt() / cosine;
    // From the corner to where it touches: t = d + √(2 r δ), with r = t tan(α / 2).
    let over = (2.0 * reach * tangent).sqrt();
    let touches = (0.5 * (over + (over * over + 2.0 * (a + b)).sqrt())).powi(2);
    let middle = touches * (1.0 / cosine - tangent) * bisector;
    let points = [touches * toward[0], middle, touches * toward[1]];
    Some(Rounding {
        ends: short.map(|(_, end)| end),
        short: a + b,
        arc: CircularArc::through(points.map(|point| corner + point))?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
