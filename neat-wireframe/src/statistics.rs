//! What robust estimates of noise need.

/// The standard deviation of normal numbers whose median magnitude is 1.
pub(crate) const SIGMA_BY_MEDIAN: f64 = 1.4826;

/// The middle value, the upper one of an even number; 0 of nothing. Changes the order.
pub(crate) fn upper_median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
