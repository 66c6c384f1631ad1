//! How often, and after how long, a failed job is tried again.

use std::time::Duration;

/// How often, and after how long, a failed job is tried again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retry {
    /// Attempts after the first one, per call of [`run`](crate::run).
    pub count: u32,
    /// The pause before the first of them; every further one is twice as long …
    pub first_pause: Duration,
    /// … up to this.
    pub longest_pause: Duration,
}

impl Default for Retry {
    /// Twice, after 5 and 10 seconds: enough for a device that was lost or memory
    /// that somebody else took.
    fn default() -> Self {
        Self {
            count: 2,
            first_pause: Duration::from_secs(5),
            longest_pause: Duration::from_secs(300),
        }
    }
}

impl Retry {
    /// The pause after so many failures; `None` if there is no further attempt.
    pub fn pause(&self, failures: u32) -> Option<Duration> {
        let doublings = failures.checked_sub(1)?;
        let pause = self
            .first_pause
            .saturating_mul(2_u32.saturating_pow(doublings));
        (failures <= self.count).then(|| pause.min(self.longest_pause))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest() {
        let retry = Retry {
            count: 40,
            first_pause: Duration::from_secs(1),
            longest_pause: Duration::from_secs(6),
        };
        let seconds = |failures| retry.pause(failures).map(|pause| pause.as_secs());
        assert_eq!([1, 2, 3, 4, 40].map(seconds), [1, 2, 4, 6, 6].map(Some));
        assert_eq!(seconds(41), None);
        let never = Retry { count: 0, ..retry };
        assert_eq!(never.pause(1), None);
    }
}
