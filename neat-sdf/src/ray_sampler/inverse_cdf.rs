//! Drawing positions from a piecewise constant distribution.

/// Turns the masses of intervals, which `cdf` holds from its second number on,
/// into the cumulative distribution at their edges.
///
/// Without any mass every interval is as likely (the published code answers NaN).
pub(super) fn cumulate(cdf: &mut [f32]) {
    let Some((first, masses)) = cdf.split_first_mut() else {
        return;
    };
    *first = 0.0;
    let total = masses.iter().copied().map(f64::from).sum::<f64>() as f32;
    let even = 1.0 / masses.len() as f32;
    let mut sum = 0.0f64;
    for mass in masses {
        let share = if total > 0.0 { *mass / total } else { even };
        sum += f64::from(share);
        *mass = sum as f32;
    }
}

/// The position at which the cumulative distribution `cdf` over `edges` reaches
/// `u`; it rises evenly between edges.
///
/// Cumulative steps below `flat` count as 1, so that positions in an interval
/// without mass stay at its lower edge (published: 1e-5).
pub(super) fn invert(edges: &[f32], cdf: &[f32], flat: f32, u: f32) -> f32 {
    let above = cdf.partition_point(|c| *c <= u);
    let below = above.saturating_sub(1);
    let above = above.min(cdf.len() - 1);
    let step = cdf[above] - cdf[below];
    let step = if step < flat { 1.0 } else { step };
    let t = (u - cdf[below]) / step;
    edges[below] + t * (edges[above] - edges[below])
}

/// The `i`-th of `n` evenly spaced numbers from 0 to 1, both included.
pub(crate) fn linspace(i: usize, n: usize) -> f32 {
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
        let mut cdf = [0.0, 1.0, 3.0];
        cumulate(&mut cdf);
        let position = |u| invert(&[0.0, 1.0, 2.0], &cdf, 1e-5, u);
        assert_eq!([0.125, 0.25, 0.625].map(position), [0.5, 1.0, 1.5]);
    }

    #[test]
    fn without_mass_all_intervals_are_alike() {
        let mut cdf = [0.0; 3];
        cumulate(&mut cdf);
        let position = |u| invert(&[0.0, 1.0, 4.0], &cdf, 1e-5, u);
        assert_eq!([0.25, 0.75].map(position), [0.5, 2.5]);
    }
}
