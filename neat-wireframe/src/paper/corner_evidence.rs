//! Whether 2D segments end at a junction because a corner is there. Not in the paper.
//!
//! A detector cuts a curve into segments, or a long line, somewhere else in each view, and the
//! field puts junctions where it may. They attract whatever ends nearby. Around a corner ends
//! lie as near as the detector puts them; of cuts the nearest junction tells nothing. So the
//! distances of the ends that a junction attracts are explained in two ways:
//!
//! - by cuts: any distance up to the gate is as likely as any other;
//! - by a corner, around which some share of the ends has Cauchy's distribution, and cuts.

/// What has been fitted to the ends of a corner.
const COORDINATES: f64 = 3.0;
/// Halvings of the interval in which the likeliest share of a corner's ends lies.
const HALVINGS: usize = 30;

/// What speaks for a corner that attracts ends at these `distances` in pixels, none of them
/// larger than `gate`, in nats. Around corners half of the ends lie nearer than `scale`.
///
/// Its coordinates have been fitted to these ends, which costs half the logarithm of their
/// number for each (Schwarz's criterion). Of no ends nothing speaks.
pub(super) fn corner_evidence(distances: &[f64], gate: f64, scale: f64) -> f64 {
    // By how much a corner's end is likelier than a cut so far away, less one.
    let gains: Vec<f64> = (distances.iter())
        .map(|distance| corner_by_cut(*distance, gate, scale) - 1.0)
        .collect();
    let slope = |share: f64| -> f64 { gains.iter().map(|gain| gain / (1.0 + share * gain)).sum() };
    // The likelihood is concave in the share.
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let explained: f64 = gains.iter().map(|gain| (low * gain).ln_1p()).sum();
    explained - 0.5 * COORDINATES * (distances.len().max(1) as f64).ln()
}

/// How much likelier an end is so far from a corner than from a cut.
fn corner_by_cut(distance: f64, gate: f64, scale: f64) -> f64 {
    let ratio = distance / scale;
    gate / (scale * (gate / scale).atan() * (1.0 + ratio * ratio))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    const GATE: f64 = 10.0;

    #[test]
    fn both_explanations_are_distributions() {
        let cells = 100_000;
        let at = |cell: u32| GATE * (f64::from(cell) + 0.5) / f64::from(cells);
        for scale in [0.05, 0.5, 5.0] {
            let sum: f64 = (0..cells)
                .map(|cell| corner_by_cut(at(cell), GATE, scale))
                .sum();
            assert!((sum / f64::from(cells) - 1.0).abs() < 1e-3, "{sum}");
        }
    }

    fn ends(noise: &mut Noise, count: usize, farthest: f64) -> Vec<f64> {
        let end = |_| farthest * noise.uniform().abs();
        (0..count).map(end).collect()
    }

    #[test]
    fn corners_are_told_from_cuts() {
        let mut noise = Noise(1);
        let evidence = |ends: &[f64]| corner_evidence(ends, GATE, 1.0);
        for _ in 0..100 {
            let corner = ends(&mut noise, 20, 1.0);
            let cuts = ends(&mut noise, 20, GATE);
            assert!(evidence(&corner) > 20.0);
            assert!(evidence(&cuts) < 0.0);
            // Ends that belong elsewhere do not hide a corner.
            assert!(evidence(&[corner, cuts].concat()) > 0.0);
        }
    }

    #[test]
    fn one_end_is_a_corner_and_none_or_far_ones_are_not() {
        assert!(corner_evidence(&[0.1], GATE, 1.0) > 0.0);
        assert!(corner_evidence(&[], GATE, 1.0) <= 0.0);
        assert!(corner_evidence(&[5.0; 10], GATE, 1.0) < 0.0);
    }
}
