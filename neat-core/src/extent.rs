//! How far values reach, without strays: for pictures, which would be small for them.

/// Strays are among this share of the values at each end …
const STRAY: f64 = 0.01;
/// … and farther from the others than this share of their extent.
const BEYOND: f64 = 0.5;

/// The least and the greatest of the values but for strays; `None` of nothing.
pub fn extent_of_most(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let [first, last] = [*values.first()?, *values.last()?];
    let strays = (STRAY * values.len() as f64) as usize;
    let (low, high) = (values[strays], values[values.len() - 1 - strays]);
    let beyond = BEYOND * (high - low);
    Some([first.max(low - beyond), last.min(high + beyond)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strays_are_few_and_far() {
        let even = || (0..200).map(f64::from);
        assert_eq!(extent_of_most(even()), Some([0.0, 199.0]));
        let [low, high] = extent_of_most(even().chain([1e4])).unwrap();
        assert!(low == 0.0 && (199.0..400.0).contains(&high), "{high}");
        // Near the others, or as many as they.
        assert_eq!(extent_of_most(even().chain([220.0])), Some([0.0, 220.0]));
        let two = [0.0, 1.0, 1e4, 1e4 + 1.0];
        assert_eq!(extent_of_most(two), Some([0.0, 1e4 + 1.0]));
        assert_eq!(extent_of_most([3.0]), Some([3.0; 2]));
        assert_eq!(extent_of_most([]), None);
    }
}
