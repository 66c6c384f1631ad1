//! How much of a line several stretches of it cover together.

/// The length of what `intervals` cover of the interval from `low` to `high`; what
/// several of them cover counts once.
pub(crate) fn covered_length(mut intervals: Vec<[f64; 2]>, [low, high]: [f64; 2]) -> f64 {
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut covered, mut reached) = (0.0, low);
    for [from, to] in intervals {
        let (from, to) = (f64::max(from, reached), f64::min(to, high));
        if to > from {
            covered += to - from;
            reached = to;
        }
    }
    covered
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlaps_count_once_and_what_lies_outside_not_at_all() {
        let intervals = vec![[6.0, 12.0], [-3.0, 1.0], [0.5, 2.0], [1.0, 1.5]];
        assert_eq!(covered_length(intervals, [0.0, 10.0]), 6.0);
        assert_eq!(covered_length(vec![[11.0, 12.0]], [0.0, 10.0]), 0.0);
        assert_eq!(covered_length(Vec::new(), [0.0, 10.0]), 0.0);
    }
}
