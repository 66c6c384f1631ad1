//! Short edges across the ends of thin slabs: too short for a detector of segments, but where
//! two edges run side by side and end together, one is expected, and a few views are enough.

use super::arc_tubes::KnownArcs;
use super::corners::{Corners, WINDOW_IN_PIXELS};
use super::edge_completion::supported;
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use super::profiles::{Asked, Photographs, Response, light_across};
use nalgebra::Vector3;
use neat_core::LineSegment3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Smoothing moves the edgels of an edge among others by so many pixels: 0.3 to 0.8 on edges 5 to
/// 12 pixels long of rendered parts. With 0.75 to 1.25 the same edges are found but one.
const REACH: f64 = 1.0;
/// It rounds corners: so near to one, in pixels, an edgel has no neighbour's direction.
const ROUNDING: f64 = 1.5;
/// Of what lies across the end of a slab so much less evidence is asked, in nats: on photographs
/// with truth a third is an edge, and of other ends near each other one in thirty, which is 2.4
/// nats more. With 1.5 of them 57 % of what is found there are edges, with 2.5 nats 47 %, when the
/// two views that say most did not count.
const EXPECTED: f64 = 1.5;
/// Edges side by side have this cosine: about 10°.
const MIN_COSINE_ALONG: f64 = 0.985;
/// An edge across has at most this cosine to the edges at its ends: corners of edges of a few
/// pixels are off by 20°. Of what is more oblique one in a hundred is an edge there.
const MAX_COSINE_ACROSS: f64 = 0.35;
/// A slab is as wide at its other end, up to this factor, judged.
const MAX_TAPER: f64 = 1.5;
/// Light must speak for an edge across a wedge by so much, in nats, as for outlines: views beside
/// each other see much the same. Across a slab one is expected, and light need not speak against it.
const OF_WEDGE: f64 = 12.0;
/// Edges that are longer have edgels of their own, in pixels: as far as ends are uncertain.
const MAX_WIDTH: f64 = WINDOW_IN_PIXELS;
/// An edge across that turns by less than this into the next one, 35° (cosine), is a chord of the
/// rim of a round surface, judged: its slabs are rulings.
const MIN_COSINE_ON: f64 = 0.82;

/// Adds the edges across the ends of slabs that edgels which no line has speak for; returns how
/// many.
pub(super) fn close_slabs(
    images: &Images,
    corners: &mut Corners,
    taken: &mut [Vec<bool>],
    (min_evidence, arcs): (f64, &KnownArcs),
) -> usize {
    let images = Images {
        reach: images.reach.max(REACH),
        rounding: ROUNDING,
        ..*images
    };
    let mut ends = slab_ends(corners);
    ends.retain(|_, taper| *taper <= MAX_TAPER);
    let pairs = without_chords(&corners.junctions, ends.into_keys().collect());
    let found = supported(
        &images,
        corners,
        pairs.into_iter().collect(),
        taken,
        (min_evidence - EXPECTED, arcs),
    );
    corners.add(&found);
    found.len()
}

/// Adds the edges of a few pixels across the ends of slabs, and across what ends like one and is
/// none, as its sides do not end together at the other end, where light speaks for them; returns how
/// many.
pub(super) fn close_by_light(
    images: &Images,
    (photographs, response): (Photographs<'_>, Response),
    lines: &[ChosenLine],
    corners: &mut Corners,
) -> usize {
    let views_of = views_of_junctions(corners, lines);
    let asked = |[a, b]: &[usize; 2]| Asked {
        piece: LineSegment3::new(corners.junctions[*a], corners.junctions[*b]),
        views: (views_of[*a].intersection(&views_of[*b]).copied()).collect(),
    };
    let pixel = corners.pixel();
    let ends = slab_ends(corners);
    let mut pairs = without_chords(&corners.junctions, ends.keys().copied().collect());
    pairs.retain(|pair| asked(pair).piece.length() <= MAX_WIDTH * pixel);
    let pieces: Vec<Asked> = pairs.iter().map(asked).collect();
    let lights = light_across(images, photographs, response, &pieces);
    let least = |pair: &[usize; 2]| {
        if ends[pair] <= MAX_TAPER {
            0.0
        } else {
            OF_WEDGE
        }
    };
    let found = pairs.into_iter().zip(lights);
    let found: Vec<([usize; 2], f64)> = found
        .filter(|(pair, light)| light.for_edge() > least(pair))
        .map(|(pair, _)| (pair, pixel))
        .collect();
    corners.add(&found);
    found.len()
}

/// For each junction the views that show a line which ends there: others may not see it.
fn views_of_junctions(corners: &Corners, lines: &[ChosenLine]) -> Vec<BTreeSet<usize>> {
    let mut views = vec![BTreeSet::new(); corners.junctions.len()];
    for (ends, source) in corners.ends.iter().zip(&corners.sources) {
        let showing = source.iter().flat_map(|line| lines[*line].evidence.views());
        let showing: Vec<usize> = showing.collect();
        for end in ends {
            views[*end].extend(&showing);
        }
    }
    views
}

/// Pairs of junctions at which two edges that run side by side end together, each with how far these
/// are apart at their other ends, by what they are there.
fn slab_ends(corners: &Corners) -> BTreeMap<[usize; 2], f64> {
    let junctions = &corners.junctions;
    let others = others_at(junctions.len(), &corners.ends);
    let known: BTreeSet<[usize; 2]> = corners.pairs().collect();
    let from = |at: usize, to: usize| junctions[to] - junctions[at];
    // What runs across is shorter than the edges of its slab.
    let longest: Vec<f64> = (0..junctions.len())
        .map(|at| (others[at].iter()).fold(0.0, |most: f64, to| most.max(from(at, *to).norm())))
        .collect();
    let taper = |[a, b]: [usize; 2]| {
        let across = from(a, b);
        let width = across.norm();
        let is_across =
            |edge: Vector3<f64>| edge.dot(&across).abs() <= MAX_COSINE_ACROSS * width * edge.norm();
        let beside = |c: usize, d: usize| {
            let (u, v) = (from(a, c), from(b, d));
            width < u.norm().min(v.norm()) && u.dot(&v) > MIN_COSINE_ALONG * u.norm() * v.norm()
        };
        let all_across = (others[a].iter()).all(|c| is_across(from(a, *c)))
            && (others[b].iter()).all(|d| is_across(from(b, *d)));
        let sides = (others[a].iter())
            .flat_map(|c| others[b].iter().map(move |d| (*c, *d)))
            .filter(|(c, d)| all_across && beside(*c, *d));
        sides
            .map(|(c, d)| from(c, d).norm() / width)
            .min_by(f64::total_cmp)
    };
    let is_end = |pair: &[usize; 2]| {
        let [a, b] = *pair;
        from(a, b).norm() < longest[a].min(longest[b]) && !known.contains(pair)
    };
    (0..junctions.len())
        .into_par_iter()
        .flat_map_iter(|a| (a + 1..junctions.len()).map(move |b| [a, b]).filter(is_end))
        .filter_map(|pair| Some((pair, taper(pair)?)))
        .collect()
}

/// The pairs that no other one goes on from, nearly straight on, and between which there is no
/// third end: they are neighbours (in the relative neighbourhood graph, Toussaint 1980).
fn without_chords(junctions: &[Vector3<f64>], mut pairs: Vec<[usize; 2]>) -> Vec<[usize; 2]> {
    let others = others_at(junctions.len(), &pairs);
    let from = |a: usize, b: usize| junctions[b] - junctions[a];
    let goes_on = |[a, b]: [usize; 2]| {
        let before = from(a, b);
        others[b].iter().any(|c| {
            let after = from(b, *c);
            let nearer = from(a, *c).norm().max(after.norm()) < before.norm();
            nearer || before.dot(&after) > MIN_COSINE_ON * before.norm() * after.norm()
        })
    };
    pairs.retain(|[a, b]| !goes_on([*a, *b]) && !goes_on([*b, *a]));
    pairs
}

/// For each of `count` junctions, those that pairs join it to.
fn others_at(count: usize, pairs: &[[usize; 2]]) -> Vec<Vec<usize>> {
    let mut others = vec![Vec::new(); count];
    for [a, b] in pairs {
        others[*a].push(*b);
        others[*b].push(*a);
    }
    others
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::claimed_edgels::claim_edgels;
    use crate::assemble::corners::find_corners;
    use crate::assemble::line_evidence::LineEvidence;
    use crate::assemble::test_views::{TestViews, chosen};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use std::f64::consts::TAU;

    /// Half the length of a bar, and about a pixel, in the world.
    const HALF: f64 = 0.4;
    const PIXEL: f64 = 2.5 / 700.0;

    /// Bars that side by side make a prism: what runs along it, and across its ends.
    struct Prism {
        along: Vec<LineSegment3>,
        across: Vec<LineSegment3>,
    }

    /// With `sides` bars over an arc of `turn`, `width` pixels apart.
    fn prism(sides: usize, turn: f64, width: f64) -> Prism {
        let step = turn / sides as f64;
        let radius = 0.5 * width * PIXEL / (0.5 * step).sin();
        let at = |k: usize, z: f64| {
            let (sin, cos) = (step * k as f64 + 0.3).sin_cos();
            Vector3::new(radius * cos, radius * sin, z)
        };
        let bars = (turn / step - 0.5) as usize + usize::from(turn < TAU);
        let sides = |z: f64| (0..sides).map(move |k| LineSegment3::new(at(k, z), at(k + 1, z)));
        Prism {
            along: (0..=bars)
                .map(|k| LineSegment3::new(at(k, -HALF), at(k, HALF)))
                .collect(),
            across: sides(-HALF).chain(sides(HALF)).collect(),
        }
    }

    /// How many edges are added across the ends, where they are seen as `seen` from them.
    fn closed(prism: &Prism, seen: impl Fn(&LineSegment3) -> LineSegment3) -> usize {
        let lines = prism.along.iter().copied();
        let lines = lines.chain(prism.across.iter().map(seen));
        let ends: Vec<Vector3<f64>> = lines.flat_map(|line| line.ends()).collect();
        let edges: Vec<[usize; 2]> = (0..ends.len() / 2).map(|k| [2 * k, 2 * k + 1]).collect();
        let views = views_of_edges(&cameras_on_sphere(12), &ends, &edges);
        let views = TestViews::of(
            views
                .iter()
                .map(|v| PreparedView::new(v, 1.0, 1.0))
                .collect(),
        );
        let images = Images {
            reach: 0.25,
            ..views.images()
        };
        let mut taken = images.nothing_taken();
        let along: Vec<_> = prism
            .along
            .iter()
            .map(|line| chosen(&images, line))
            .collect();
        for line in &along {
            claim_edgels(&images, &line.line, &mut taken);
        }
        let mut corners = find_corners(&images, &along, (&[], &[]));
        let before = corners.ends.len();
        let count = close_slabs(
            &images,
            &mut corners,
            &mut taken,
            (3.0, &KnownArcs::new(&[], &[])),
        );
        assert_eq!(corners.ends.len(), before + count);
        for [a, b] in &corners.ends[before..] {
            let found = LineSegment3::new(corners.junctions[*a], corners.junctions[*b]);
            let is = |line: &LineSegment3| (line.point_at(0.5) - found.point_at(0.5)).norm();
            let nearest = prism.across.iter().map(is).fold(f64::INFINITY, f64::min);
            assert!(nearest < PIXEL);
        }
        count
    }

    #[test]
    fn ends_of_a_thin_bar_are_closed_by_its_sides_where_they_are_seen() {
        let bar = prism(4, TAU, 9.0);
        assert_eq!(bar.along.len(), 4);
        assert_eq!(closed(&bar, |side| *side), 8);
        // As smoothing has them: moved inward and along the bar.
        let smoothed = |side: &LineSegment3| {
            let middle = side.point_at(0.5);
            let inward = -Vector3::new(middle.x, middle.y, 0.0).normalize();
            let along = -Vector3::z() * middle.z.signum();
            side.map(|end| end + 0.6 * PIXEL * (inward + along))
        };
        assert_eq!(closed(&bar, smoothed), 8);
        let elsewhere = |side: &LineSegment3| side.map(|end| 0.5 * end);
        assert_eq!(closed(&bar, elsewhere), 0);
    }

    #[test]
    fn sides_of_a_wedge_end_together_at_one_end() {
        let along = [1.0, 0.5].map(|length| {
            let at = |y: f64| Vector3::new(0.0, y, 10.0 * PIXEL * length);
            LineSegment3::new(at(0.0), at(length))
        });
        let cube = TestViews::of(Vec::new());
        let lines = along.map(|line| ChosenLine {
            line,
            evidence: LineEvidence::default(),
            placed: true,
        });
        let corners = find_corners(&cube.images(), &lines, (&[], &[]));
        let ends = slab_ends(&corners);
        assert!(ends.values().all(|taper| *taper > MAX_TAPER));
        assert_eq!(ends.into_keys().collect::<Vec<_>>(), [[0, 2]]);
    }

    #[test]
    fn rims_of_round_surfaces_stay_open() {
        let slab = prism(1, 0.3, 9.0);
        assert_eq!([slab.along.len(), closed(&slab, |side| *side)], [2, 2]);
        let barrel = prism(8, 0.5 * TAU, 9.0);
        assert_eq!(barrel.along.len(), 9);
        assert_eq!(closed(&barrel, |side| *side), 0);
    }
}
