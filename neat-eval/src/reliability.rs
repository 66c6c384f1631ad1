//! Whether things with a probability are true as often as it says: reliability diagrams and
//! the expected calibration error (Naeini, Cooper and Hauskrecht 2015).

/// A probability, and whether what it is of is true.
pub type Judged = (f64, bool);

/// Bins of a reliability diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binning {
    /// Of equal width.
    Width,
    /// Of equal count.
    Count,
}

/// The things whose probability is in one bin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReliabilityBin {
    /// How many they are.
    pub count: usize,
    /// Their mean probability.
    pub said: f64,
    /// The share of them that is true.
    pub is: f64,
}

/// The bins that are not empty, by ascending probability.
pub fn reliability(judged: &[Judged], bins: usize, binning: Binning) -> Vec<ReliabilityBin> {
    let mut sorted = judged.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let bin_of = |(index, (p, _)): (usize, &Judged)| match binning {
        Binning::Width => ((p * bins as f64) as usize).min(bins.saturating_sub(1)),
        Binning::Count => index * bins / sorted.len(),
    };
    let in_bins: Vec<usize> = sorted.iter().enumerate().map(bin_of).collect();
    let mut first = 0;
    let mut found = Vec::new();
    for of_bin in in_bins.chunk_by(|a, b| a == b) {
        let judged = &sorted[first..first + of_bin.len()];
        first += of_bin.len();
        let count = judged.len();
        found.push(ReliabilityBin {
            count,
            said: judged.iter().map(|(p, _)| p).sum::<f64>() / count as f64,
            is: judged.iter().filter(|(_, is_true)| *is_true).count() as f64 / count as f64,
        });
    }
    found
}

/// The mean difference between what the bins say and what is; 0 of nothing.
pub fn expected_calibration_error(bins: &[ReliabilityBin]) -> f64 {
    let total: usize = bins.iter().map(|bin| bin.count).sum();
    let error = |bin: &ReliabilityBin| bin.count as f64 * (bin.said - bin.is).abs();
    bins.iter().map(error).sum::<f64>() / total.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_say_what_is_in_them() {
        let judged = [(0.95, true), (1.0, false), (0.12, false), (0.18, true)];
        let bins = reliability(&judged, 10, Binning::Width);
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].count, bins[0].is), (2, 0.5));
        assert!((bins[0].said - 0.15).abs() < 1e-12 && (bins[1].said - 0.975).abs() < 1e-12);
        let error = expected_calibration_error(&bins);
        assert!((error - 0.5 * (0.35 + 0.475)).abs() < 1e-12);

        let bins = reliability(&judged, 4, Binning::Count);
        assert_eq!(bins.iter().map(|bin| bin.count).collect::<Vec<_>>(), [1; 4]);
        assert_eq!(bins[3].said, 1.0);
        for binning in [Binning::Width, Binning::Count] {
            assert_eq!(
                expected_calibration_error(&reliability(&[], 10, binning)),
                0.0
            );
        }
    }
}
