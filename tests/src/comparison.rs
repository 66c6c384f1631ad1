//! Comparisons with the truth, in the measures of the golden data's README.

/// Largest absolute difference.
pub fn max_difference(actual: &[f64], truth: &[f64]) -> f64 {
    assert_eq!(actual.len(), truth.len(), "different numbers of elements");
    actual
        .iter()
        .zip(truth)
        .map(|(a, t)| (a - t).abs())
        // `f64::max` would swallow a NaN.
        .fold(
            0.0,
            |max: f64, d| {
                if max.is_nan() || d <= max { max } else { d }
            },
        )
}

/// Largest absolute difference over the largest magnitude of the truth; where the
/// truth is zero everywhere, the difference itself.
pub fn max_relative_difference(actual: &[f64], truth: &[f64]) -> f64 {
    let magnitude = truth.iter().fold(0.0, |max: f64, t| max.max(t.abs()));
    let difference = max_difference(actual, truth);
    if magnitude == 0.0 {
        difference
    } else {
        difference / magnitude
    }
}

/// Euclidean norm of the difference over that of the truth.
pub fn relative_l2_difference(actual: &[f64], truth: &[f64]) -> f64 {
    assert_eq!(actual.len(), truth.len(), "different numbers of elements");
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let of_difference = squares(&mut actual.iter().zip(truth).map(|(a, t)| a - t));
    (of_difference / squares(&mut truth.iter().copied())).sqrt()
}

/// How many elements differ by more than `tolerance`, or are not numbers.
pub fn count_beyond(actual: &[f64], truth: &[f64], tolerance: f64) -> usize {
    assert_eq!(actual.len(), truth.len(), "different numbers of elements");
    let close = |(a, t): &(&f64, &f64)| (*a - *t).abs() <= tolerance;
    actual.len() - actual.iter().zip(truth).filter(close).count()
}

/// Fails unless [`max_difference`] is within `tolerance`.
#[track_caller]
pub fn assert_close(what: &str, actual: &[f64], truth: &[f64], tolerance: f64) {
    check(what, max_difference(actual, truth), tolerance);
}

/// Fails unless [`max_relative_difference`] is within `tolerance`.
#[track_caller]
pub fn assert_relatively_close(what: &str, actual: &[f64], truth: &[f64], tolerance: f64) {
    check(what, max_relative_difference(actual, truth), tolerance);
}

/// Fails unless [`relative_l2_difference`] is within `tolerance`.
#[track_caller]
pub fn assert_close_in_l2(what: &str, actual: &[f64], truth: &[f64], tolerance: f64) {
    check(what, relative_l2_difference(actual, truth), tolerance);
}

/// Says how near each comparison came, for tests that run with `--nocapture`.
#[track_caller]
#[expect(clippy::print_stderr, reason = "measured errors belong into the log")]
fn check(what: &str, error: f64, tolerance: f64) {
    eprintln!("{what}: {error:.1e} (tolerance {tolerance:.0e})");
    assert!(
        error <= tolerance,
        "{what}: off by {error:.3e}, tolerance {tolerance:.0e}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_is_never_close() {
        assert!(max_difference(&[f64::NAN, 1.0], &[0.0, 1.0]).is_nan());
        assert!(max_difference(&[f64::NAN, 1.0], &[0.0, 5.0]).is_nan());
        assert_eq!(count_beyond(&[f64::NAN, 1.0], &[0.0, 1.0], 0.5), 1);
    }
}
