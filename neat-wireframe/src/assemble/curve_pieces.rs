//! Curves in an image: chains of edgels that go on bending, as short straight pieces.
//!
//! A detector of segments leaves curves out. Their pieces propose tangents in space as segments
//! propose lines.

use nalgebra::Vector2;
use neat_core::{EdgelMap, LineSegment2};

/// A step along a chain, in pixels: edgels are about one apart …
const STEP: f64 = 1.0;
/// … and where one is missing the next is sought.
const STEPS: [f64; 2] = [STEP, 2.0 * STEP];
/// The next edgel lies at most this far beside the way, in pixels …
const ASIDE: f64 = 0.75;
/// … and its normal has this cosine to the one before, about 25°: circles of 3 pixels still do.
const MIN_COSINE: f64 = 0.9;
/// A piece ends where its chain leaves it by so many pixels: as for detected segments, about
/// what rounding does.
const TOLERANCE: f64 = 0.5;
/// A piece turns against the one before by an angle between these, in degrees: less is straight,
/// more is a corner.
const TURNS: [f64; 2] = [2.0, 50.0];
/// So many pieces in a row that turn to the same side are a curve.
const MIN_PIECES: usize = 3;

/// The pieces of all curves, of edgels that are `free`.
pub(super) fn curve_pieces(map: &EdgelMap, free: impl Fn(usize) -> bool) -> Vec<LineSegment2> {
    let chains = chains(map, free).into_iter();
    chains
        .flat_map(|chain| bending_pieces(&straight_pieces(&chain)))
        .collect()
}

/// The chains of edgels that are `free`, each edgel in one.
pub(super) fn chains(map: &EdgelMap, free: impl Fn(usize) -> bool) -> Vec<Vec<Vector2<f64>>> {
    let mut left: Vec<bool> = (0..map.len()).map(free).collect();
    let mut chains = Vec::new();
    for seed in 0..map.len() {
        if left[seed] {
            left[seed] = false;
            chains.push(chain_through(map, seed, &mut left));
        }
    }
    chains
}

/// The edgels before and after one, in order.
fn chain_through(map: &EdgelMap, seed: usize, left: &mut [bool]) -> Vec<Vector2<f64>> {
    let normal: Vector2<f64> = map.get(seed).normal.cast();
    let along = Vector2::new(-normal.y, normal.x);
    let mut chain = walk(map, seed, -along, left);
    chain.reverse();
    chain.push(map.get(seed).position.cast());
    chain.extend(walk(map, seed, along, left));
    chain
}

/// The edgels that follow one in a direction; they are left no more.
fn walk(
    map: &EdgelMap,
    seed: usize,
    mut along: Vector2<f64>,
    left: &mut [bool],
) -> Vec<Vector2<f64>> {
    let mut position: Vector2<f64> = map.get(seed).position.cast();
    let mut chain = Vec::new();
    loop {
        let normal = Vector2::new(-along.y, along.x);
        let next = STEPS.iter().find_map(|step| {
            let ahead = position + *step * along;
            map.nearest(&ahead, &normal, ASIDE, MIN_COSINE, |edgel| left[edgel])
        });
        let Some((_, edgel)) = next else {
            return chain;
        };
        left[edgel] = false;
        position = map.get(edgel).position.cast();
        chain.push(position);
        let normal: Vector2<f64> = map.get(edgel).normal.cast();
        let next = Vector2::new(-normal.y, normal.x);
        along = if next.dot(&along) < 0.0 { -next } else { next };
    }
}

/// A chain as straight pieces, each as long as the chain stays near it.
fn straight_pieces(chain: &[Vector2<f64>]) -> Vec<LineSegment2> {
    let mut pieces = Vec::new();
    let mut start = 0;
    for end in 2..=chain.len() {
        let ended = end == chain.len() || {
            let piece = LineSegment2::new(chain[start], chain[end]);
            (chain[start + 1..end].iter()).any(|point| piece.distance_to_line(point) > TOLERANCE)
        };
        if ended && end - 1 > start {
            pieces.push(LineSegment2::new(chain[start], chain[end - 1]));
            start = end - 1;
        }
    }
    pieces
}

/// The pieces of runs that go on turning to one side.
fn bending_pieces(pieces: &[LineSegment2]) -> Vec<LineSegment2> {
    let turn = |pair: &[LineSegment2]| {
        let [a, b] = [&pair[0], &pair[1]].map(|piece| piece.end - piece.start);
        a.perp(&b).atan2(a.dot(&b)).to_degrees()
    };
    let turns: Vec<f64> = pieces.windows(2).map(turn).collect();
    let side = |turn: &f64| {
        let bends = (TURNS[0]..TURNS[1]).contains(&turn.abs());
        if bends { turn.signum() } else { 0.0 }
    };
    let mut found = Vec::new();
    let mut start = 0;
    for run in turns.chunk_by(|a, b| side(a) == side(b)) {
        // So many turns join one piece more.
        if side(&run[0]) != 0.0 && run.len() + 1 >= MIN_PIECES {
            found.extend_from_slice(&pieces[start..=start + run.len()]);
        }
        start += run.len();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::Edgel;
    use std::f64::consts::TAU;

    #[test]
    fn circles_are_pieces_and_lines_and_corners_are_none() {
        let circle = |center: [f64; 2], radius: f64| {
            let count = (TAU * radius) as usize;
            (0..count).map(move |k| {
                let (sine, cosine) = (TAU * k as f64 / count as f64).sin_cos();
                Edgel {
                    position: Vector2::new(
                        (center[0] + radius * cosine) as f32,
                        (center[1] + radius * sine) as f32,
                    ),
                    normal: Vector2::new(cosine as f32, sine as f32),
                }
            })
        };
        let line = |x: f32| {
            (20..120).map(move |y| Edgel {
                position: Vector2::new(x, y as f32 + 0.3),
                normal: Vector2::x(),
            })
        };
        let edgels: Vec<Edgel> = circle([100.0, 80.0], 50.0)
            .chain(circle([200.0, 80.0], 15.0))
            .chain(line(20.0))
            .collect();
        let map = EdgelMap::new(&edgels, 300, 200);
        let pieces = curve_pieces(&map, |_| true);
        for (center, radius) in [([100.0, 80.0], 50.0), ([200.0, 80.0], 15.0)] {
            let center = Vector2::from(center);
            let near = |piece: &&LineSegment2| (piece.start - center).norm() < radius + 1.0;
            let length: f64 = pieces.iter().filter(near).map(LineSegment2::length).sum();
            assert!(length > 0.85 * TAU * radius, "{length}");
        }
        assert!(pieces.iter().all(|piece| piece.start.x > 40.0));
        // What a line has is left to it.
        assert!(curve_pieces(&map, |_| false).is_empty());
    }
}
