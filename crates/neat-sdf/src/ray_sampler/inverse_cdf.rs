//! Drawing positions from a piecewise constant distribution.

/// Draws a position for every `u` by inverting the cumulative distribution of
/// `masses` over the intervals between `edges` (one more edge than masses).
///
/// Cumulative steps below `flat` count as 1, so that positions in an interval
/// without mass stay at its lower edge (published: 1e-5). Without any mass every
/// interval is as likely (the published code answers NaN).
pub(super) fn inverse_cdf(
    edges: &[f32],
    masses: impl Iterator<Item = f32> + Clone,
    flat: f32,
    u: impl Iterator<Item = f32>,
    out: &mut Vec<f32>,
    cdf: &mut Vec<f32>,
) {
    let total = masses.clone().map(f64::from).sum::<f64>() as f32;
    cdf.clear();
    cdf.push(0.0);
    let intervals = (edges.len() - 1) as f32;
    let mut sum = 0.0f64;
    for mass in masses {
        let share = if total > 0.0 {
            mass / total
        } else {
            1.0 / intervals
        };
        sum += f64::from(share);
        cdf.push(sum as f32);
    }
    let last = cdf.len() - 1;
    for u in u {
        let above = cdf.partition_point(|c| *c <= u);
        let below = above.saturating_sub(1);
        let above = above.min(last);
        let step = cdf[above] - cdf[below];
        let step = if step < flat { 1.0 } else { step };
        let t = (u - cdf[below]) / step;
        out.push(edges[below] + t * (edges[above] - edges[below]));
    }
}

/// The `i`-th of `n` evenly spaced numbers from 0 to 1, both included.
pub(super) fn linspace(i: usize, n: usize) -> f32 {
    if n < 2 {
        return 0.0;
    }
    // Computed from the nearer end, as PyTorch does, so that the last is 1.
    let step = 1.0 / (n - 1) as f32;
    if i < n / 2 {
        i as f32 * step
    } else {
        1.0 - (n - 1 - i) as f32 * step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_follow_the_masses() {
        let (mut out, mut cdf) = (Vec::new(), Vec::new());
        let masses = [1.0, 3.0];
        inverse_cdf(
            &[0.0, 1.0, 2.0],
            masses.into_iter(),
            1e-5,
            [0.125, 0.25, 0.625].into_iter(),
            &mut out,
            &mut cdf,
        );
        assert_eq!(out, vec![0.5, 1.0, 1.5]);
    }

    #[test]
    fn without_mass_all_intervals_are_alike() {
        let (mut out, mut cdf) = (Vec::new(), Vec::new());
        inverse_cdf(
            &[0.0, 1.0, 4.0],
            [0.0, 0.0].into_iter(),
            1e-5,
            [0.25, 0.75].into_iter(),
            &mut out,
            &mut cdf,
        );
        assert_eq!(out, vec![0.5, 2.5]);
    }
}
