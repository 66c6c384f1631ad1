//! Measures beside their true values, and how many intervals hold these.

/// How far a measure is off.
pub struct Judged {
    pub error: f64,
    /// Half the interval; `None` where it is not determined.
    pub half_width: Option<f64>,
}

/// What tables say of some measures.
pub struct Summary {
    /// Those with an interval.
    pub determined: usize,
    not_determined: usize,
    held: f64,
    median_error: f64,
    median_half_width: f64,
}

impl Summary {
    /// The heads of [`Self::cells`], and the line below them.
    pub const HEADS: [&str; 2] = [
        "not determined | held | median error | median half interval |",
        "--: | --: | --: | --: |",
    ];

    pub fn of<'a>(judged: impl Iterator<Item = &'a Judged> + Clone) -> Self {
        let sure: Vec<(f64, f64)> = judged
            .clone()
            .filter_map(|j| Some((j.error, j.half_width?)))
            .collect();
        let held = sure.iter().filter(|(error, half)| error <= half).count();
        Self {
            determined: sure.len(),
            not_determined: judged.count() - sure.len(),
            held: held as f64 / sure.len() as f64,
            median_error: median(sure.iter().map(|(error, _)| *error)),
            median_half_width: median(sure.iter().map(|(_, half)| *half)),
        }
    }

    /// The last cells of a row in Markdown.
    pub fn cells(&self) -> String {
        format!(
            "{} | {:.3} | {:.6} | {:.6} |",
            self.not_determined, self.held, self.median_error, self.median_half_width
        )
    }
}

/// The upper one.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
}
