//! Whether both sides of an edge lie in one plane: a strip of the surface looks the same
//! from all views, and a strip of any other half-plane slides over what is really there.

use super::edge_frame::{EdgeFrame, HALF_PLANES, Side};
use super::edge_samples::{ViewSamples, pieces, strip_index};
use crate::statistics::upper_median;

/// Two views agree on something by chance more easily than three.
const MIN_VIEWS: usize = 3;
/// Noise of photographs in grey levels: patches with less contrast say nothing.
const NOISE: f64 = 3.0;
/// Correlation by which the common plane must stand out among all for full evidence; 0.15
/// and 0.4 do as well on the rendered photographs.
const CLEAR_PEAK: f64 = 0.25;
/// Correlation that two planes of their own may win over a common one: the scatter of the
/// maximum over half-planes. Twice as much does as well.
const SLACK: f64 = 0.03;

/// From 0, nothing says so, to 1: both sides look the same from all views as parts of one
/// plane, as no other plane does, and no better as parts of two planes.
pub(super) fn coplanarity(frame: &EdgeFrame, samples: &[ViewSamples]) -> f64 {
    let pieces = pieces(frame).len();
    let [left, mut right] = Side::BOTH.map(|side| {
        let of = |half_plane| correlation(samples, side, half_plane, pieces);
        (0..HALF_PLANES).map(of).collect::<Vec<Option<f64>>>()
    });
    // Now both halves of a plane have the same index.
    right.reverse();
    let both = |plane: usize| Some(left[plane]?.min(right[plane]?));
    let best = |side: &[Option<f64>]| side.iter().flatten().copied().reduce(f64::max);
    let common = (frame.common_planes())
        .filter_map(|plane| Some((plane, both(plane)?)))
        .reduce(|a, b| if b.1 > a.1 { b } else { a });
    let Some(((plane, agreement), best_left, best_right)) = common
        .filter(|(_, agreement)| *agreement > 0.0)
        .and_then(|common| Some((common, best(&left)?, best(&right)?)))
    else {
        return 0.0;
    };
    let mut all: Vec<f64> = (0..HALF_PLANES).filter_map(both).collect();
    let usual = upper_median(&mut all).max(0.0);
    let of_plane = left[plane].unwrap_or(0.0) + right[plane].unwrap_or(0.0);
    let lost = 0.5 * (best_left + best_right - of_plane);
    ((agreement - usual) / CLEAR_PEAK).clamp(0.0, 1.0) * (-lost / SLACK).exp()
}

/// Mean normalised cross-correlation of the strips of a half-plane over all pairs of views;
/// `None` if too few views see any piece.
fn correlation(
    samples: &[ViewSamples],
    side: Side,
    half_plane: usize,
    pieces: usize,
) -> Option<f64> {
    let (mut sum, mut pairs) = (0.0, 0.0);
    for piece in 0..pieces {
        let index = strip_index(side, half_plane, piece, pieces);
        let strips: Vec<&[u8]> = (samples.iter())
            .filter_map(|view| view.strips.get(index).map(Vec::as_slice))
            .filter(|strip| !strip.is_empty())
            .collect();
        if strips.len() >= MIN_VIEWS {
            let of_piece = (strips.len() * (strips.len() - 1)) as f64;
            sum += pair_sum(&strips);
            pairs += of_piece;
        }
    }
    (pairs > 0.0).then(|| sum / pairs)
}

/// Sum of the correlations of all ordered pairs: |Σp|² − Σ|p|² of patches p of mean 0 and
/// length 1, or less where noise is a part of their contrast.
fn pair_sum(strips: &[&[u8]]) -> f64 {
    let count = strips[0].len() as f64;
    let mut sum = vec![0.0; strips[0].len()];
    let mut own = 0.0;
    for strip in strips {
        let mean = strip.iter().map(|x| f64::from(*x)).sum::<f64>() / count;
        let variance = strip
            .iter()
            .map(|x| (f64::from(*x) - mean).powi(2))
            .sum::<f64>()
            / count;
        let scale = (count * (variance + NOISE * NOISE)).sqrt().recip();
        for (sum, value) in sum.iter_mut().zip(*strip) {
            let value = (f64::from(*value) - mean) * scale;
            *sum += value;
            own += value * value;
        }
    }
    sum.iter().map(|value| value * value).sum::<f64>() - own
}
