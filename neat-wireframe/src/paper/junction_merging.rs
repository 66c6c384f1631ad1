//! Whether two junctions are two corners or one. Not in the paper.
//!
//! A field puts several junctions beside a corner, and true corners lie near each other too. How
//! far apart they lie does not tell one from the other; the ends of the 2D segments do, which
//! both attract: two corners explain them better than one at the best place, or they do not.

use super::corner_evidence::explained;
use crate::ViewObservation;
use crate::projection::{project_in_front, project_with_jacobian};
use crate::solve::Cauchy;
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What a second corner has that one does not: three coordinates and its share of the ends.
const PARAMETERS: f64 = 4.0;
/// Around corners half of the detected ends lie nearer than this: pixels. That of the ends of
/// `house_1` and the toy is likeliest between 0.5 and 0.75, where a share of them is cuts.
pub(super) const END_SCALE: f64 = 0.5;
/// Steps in which a corner is fitted to ends; it has not far to go.
const STEPS: usize = 10;
/// Keeps the normal equations of a corner that a single view shows from being singular: next
/// to nothing beside a squared focal length.
const DAMPING: f64 = 1e-9;

/// A junction with what it attracts.
#[derive(Clone)]
pub(super) struct AttractingJunction {
    pub(super) place: Vector3<f64>,
    /// The detected ends by their [`end_key`](crate::observation::end_key), in pixels: one
    /// point counts once, however many segments of its view meet there.
    pub(super) ends: BTreeMap<EndKey, Vector2<f64>>,
    /// How many 2D segments end here.
    pub(super) segments: usize,
    /// Length of a pixel here, in world units: the median over the segments.
    pub(super) pixel: f64,
}

pub(super) type EndKey = (usize, [u64; 2]);

/// How ends scatter around corners.
#[derive(Clone, Copy)]
pub(super) struct EndScatter {
    /// Half of them lie nearer than this: pixels.
    pub(super) scale: f64,
    /// None counts that is farther than this: pixels.
    pub(super) gate: f64,
}

/// What the ends of two junctions say.
struct Verdict {
    /// What speaks for two corners, in nats.
    for_two: f64,
    /// Where one would be.
    place: Vector3<f64>,
}

/// One for all junctions that are one corner, those first that attract most.
pub(super) fn merged(
    mut junctions: Vec<AttractingJunction>,
    views: &[ViewObservation],
    scatter: EndScatter,
) -> Vec<(Vector3<f64>, usize)> {
    let judge = |junctions: &[AttractingJunction], [a, b]: [usize; 2]| {
        let [first, second] = [&junctions[a], &junctions[b]];
        let reach = scatter.gate * first.pixel.max(second.pixel);
        let is_near = (first.place - second.place).norm() <= reach;
        is_near.then(|| ([a, b], verdict([first, second], views, scatter)))
    };
    let mut left: Vec<usize> = (0..junctions.len())
        .filter(|junction| junctions[*junction].segments > 0)
        .collect();
    let mut verdicts: BTreeMap<[usize; 2], Verdict> = (left.par_iter())
        .flat_map_iter(|a| left.iter().filter(move |b| a < b).map(move |b| [*a, *b]))
        .filter_map(|pair| judge(&junctions, pair))
        .collect();
    loop {
        let least = (verdicts.iter()).min_by(|(_, a), (_, b)| a.for_two.total_cmp(&b.for_two));
        let Some((&[a, b], &Verdict { for_two, place })) = least else {
            break;
        };
        if for_two > 0.0 {
            break;
        }
        let more = junctions[a].segments >= junctions[b].segments;
        let (kept, gone) = if more { (a, b) } else { (b, a) };
        let AttractingJunction { ends, segments, .. } = junctions[gone].clone();
        junctions[kept].place = place;
        junctions[kept].ends.extend(ends);
        junctions[kept].segments += segments;
        left.retain(|junction| *junction != gone);
        verdicts.retain(|pair, _| !pair.contains(&a) && !pair.contains(&b));
        let pairs = (left.par_iter())
            .filter(|other| **other != kept)
            .map(|other| [kept.min(*other), kept.max(*other)]);
        verdicts.par_extend(pairs.filter_map(|pair| judge(&junctions, pair)));
    }
    let mut merged: Vec<_> = (left.into_iter())
        .map(|junction| (junctions[junction].place, junctions[junction].segments))
        .collect();
    merged.sort_by_key(|(_, segments)| std::cmp::Reverse(*segments));
    merged
}

fn verdict(
    pair: [&AttractingJunction; 2],
    views: &[ViewObservation],
    EndScatter { scale, gate }: EndScatter,
) -> Verdict {
    let mut ends = pair[0].ends.clone();
    ends.extend(&pair[1].ends);
    let distance = |place: &Vector3<f64>, (view, _): &EndKey, end: &Vector2<f64>| {
        let pixel = project_in_front(&views[*view].camera, place);
        pixel.map_or(f64::INFINITY, |pixel| (pixel - end).norm())
    };
    let explained_by_one = |place: Vector3<f64>| {
        let distances = ends.iter().map(|(key, end)| [distance(&place, key, end)]);
        let distances: Vec<[f64; 1]> = distances.collect();
        (explained(&distances, gate, scale), place)
    };
    let places = pair.map(|junction| junction.place);
    let mut one = explained_by_one(places[0]);
    let fitted = places.map(|place| fitted(place, &ends, views, scale));
    for place in [places[1], fitted[0], fitted[1]] {
        let other = explained_by_one(place);
        if other.0 > one.0 {
            one = other;
        }
    }
    let to_both = |(key, end)| places.map(|place| distance(&place, key, end));
    let two: Vec<[f64; 2]> = ends.iter().map(to_both).collect();
    let cost = 0.5 * PARAMETERS * (ends.len() as f64).ln();
    Verdict {
        for_two: explained(&two, gate, scale) - one.0 - cost,
        place: one.1,
    }
}

/// The place near `start` that ends show, with Cauchy's weights.
pub(super) fn fitted(
    start: Vector3<f64>,
    ends: &BTreeMap<EndKey, Vector2<f64>>,
    views: &[ViewObservation],
    scale: f64,
) -> Vector3<f64> {
    let loss = Cauchy { scale };
    let mut place = start;
    for _ in 0..STEPS {
        let mut normal = Matrix3::identity() * DAMPING;
        let mut gradient = Vector3::zeros();
        for ((view, _), end) in ends {
            let projected = project_with_jacobian(&views[*view].camera, &place);
            let Some((pixel, jacobian)) = projected else {
                continue;
            };
            let off = pixel - end;
            let weight = loss.weight(off.norm_squared());
            normal += jacobian.transpose() * jacobian * weight;
            gradient += jacobian.transpose() * off * weight;
        }
        match normal.cholesky() {
            Some(factor) => place -= factor.solve(&gradient),
            None => return start,
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::end_key;
    use crate::test_scenes::{Noise, cameras_on_sphere, views_of_edges};

    const SCATTER: EndScatter = EndScatter {
        scale: 1.0,
        gate: 10.0,
    };

    fn views() -> Vec<ViewObservation> {
        views_of_edges(&cameras_on_sphere(24), &[], &[])
    }

    /// A junction at `place` that attracts one end in each of some views, up to a third of a
    /// pixel beside where a corner at `seen` is.
    fn junction(
        place: Vector3<f64>,
        seen: Vector3<f64>,
        views: &[ViewObservation],
        which: impl Iterator<Item = usize>,
    ) -> AttractingJunction {
        let mut noise = Noise(7);
        let ends = which.map(|view| {
            let camera = &views[view].camera;
            let off = Vector2::new(noise.uniform(), noise.uniform()) / 3.0;
            let end = camera.project(&seen).pixel + off;
            (end_key(view, &end), end)
        });
        let ends: BTreeMap<_, _> = ends.collect();
        let camera = &views[0].camera;
        AttractingJunction {
            place,
            segments: ends.len(),
            ends,
            pixel: camera.project(&place).depth / camera.intrinsics.fx,
        }
    }

    #[test]
    fn two_corners_three_pixels_apart_stay_two_and_copies_of_one_become_one() {
        let views = views();
        let pixel = junction(Vector3::zeros(), Vector3::zeros(), &views, 0..1).pixel;
        let beside = Vector3::new(0.0, 3.0 * pixel, 0.0);
        let corner = junction(Vector3::zeros(), Vector3::zeros(), &views, 0..24);
        let other = junction(beside, beside, &views, 0..24);
        let copy = junction(beside, Vector3::zeros(), &views, 0..24);
        assert_eq!(
            merged(vec![corner.clone(), other], &views, SCATTER).len(),
            2
        );
        let one = merged(vec![corner, copy], &views, SCATTER);
        assert_eq!(one.len(), 1);
        assert!(one[0].0.norm() < 0.2 * pixel);
    }

    #[test]
    fn a_few_ends_beside_a_corner_are_no_second_one() {
        let views = views();
        let pixel = junction(Vector3::zeros(), Vector3::zeros(), &views, 0..1).pixel;
        let beside = Vector3::new(0.0, 4.0 * pixel, 0.0);
        let corner = junction(Vector3::zeros(), Vector3::zeros(), &views, 0..24);
        let stray = junction(beside, beside, &views, 0..3);
        let one = merged(vec![stray, corner], &views, SCATTER);
        assert_eq!(one.len(), 1);
        assert!(one[0].0.norm() < 0.2 * pixel);
        assert_eq!(one[0].1, 27);
    }

    #[test]
    fn far_junctions_stay_and_those_without_ends_go() {
        let views = views();
        let far = Vector3::new(0.0, 0.3, 0.0);
        let junctions = vec![
            junction(far, far, &views, 0..1),
            junction(Vector3::zeros(), Vector3::zeros(), &views, 0..2),
            junction(Vector3::zeros(), Vector3::zeros(), &views, 0..0),
        ];
        let merged = merged(junctions, &views, SCATTER);
        assert_eq!(merged, [(Vector3::zeros(), 2), (far, 1)]);
    }
}
