//! Sums of costs and lengths.

/// The sum; 0 of nothing, where the standard library's is -0, which would show.
pub(crate) fn total(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |sum, number| sum + number)
}
