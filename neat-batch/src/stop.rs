//! A batch that a person or a cluster wants to end.

use std::sync::atomic::{AtomicU8, Ordering};

/// How a batch is to end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stop {
    /// After its last job.
    #[default]
    No,
    /// As soon as the jobs that run have saved their work: each is asked to
    /// terminate and ends after its step.
    AfterStep,
    /// Now: jobs that run are killed and lose what they have not saved.
    Now,
}

/// Tells a running batch to end; safe to use from another thread.
#[derive(Debug, Default)]
pub struct StopSwitch {
    requests: AtomicU8,
}

impl StopSwitch {
    /// Asks to stop: the first time after the step, the second time now.
    pub fn request(&self) -> Stop {
        // Never back to 0, however often somebody asks.
        let more = |requests: u8| Some(requests.saturating_add(1));
        let _ = self
            .requests
            .fetch_update(Ordering::SeqCst, Ordering::SeqCst, more);
        self.asked_for()
    }

    /// What was asked for.
    pub fn asked_for(&self) -> Stop {
        match self.requests.load(Ordering::SeqCst) {
            0 => Stop::No,
            1 => Stop::AfterStep,
            _ => Stop::Now,
        }
    }
}
