//! Activations that wait in memory for a later pass.

use super::softplus_network::{FirstPass, Known, SoftplusNetwork};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Memory for activations that wait for a later pass; beyond it they are computed
/// again. Clones share it.
#[derive(Clone, Debug)]
pub struct KeptMemory(Arc<Account>);

#[derive(Debug)]
struct Account {
    used: AtomicUsize,
    most: usize,
}

impl KeptMemory {
    /// Memory of `bytes`.
    pub fn of_bytes(bytes: usize) -> Self {
        Self(Arc::new(Account {
            used: AtomicUsize::new(0),
            most: bytes,
        }))
    }

    /// `bytes` more, if they fit.
    pub(crate) fn book(&self, bytes: usize) -> Option<Booking> {
        let most = self.0.most;
        let fits = |used: usize| used.checked_add(bytes).filter(|sum| *sum <= most);
        let booked = (self.0.used).fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits);
        booked.is_ok().then(|| Booking {
            memory: self.clone(),
            bytes,
        })
    }
}

/// A share of the memory, given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Booking {
    memory: KeptMemory,
    bytes: usize,
}

impl Drop for Booking {
    fn drop(&mut self) {
        self.memory.0.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// The activations of a forward pass, taken by its backward pass.
#[derive(Debug)]
pub(crate) struct Tape<T>(Arc<Mutex<Option<(T, Booking)>>>);

impl<T> Clone for Tape<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Tape<T> {
    pub(crate) fn new(tape: Option<T>, booking: Option<Booking>) -> Self {
        Self(Arc::new(Mutex::new(tape.zip(booking))))
    }

    pub(crate) fn take(&self) -> Option<T> {
        let mut tape = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        tape.take().map(|(tape, _)| tape)
    }
}

/// A pass of a softplus network that stays in memory for later ones.
#[derive(Debug)]
pub struct KnownPass {
    /// First outputs and activations.
    pub pass: FirstPass,
    _booking: Booking,
}

impl KnownPass {
    /// Runs the pass over `points` `[N · 3]`, unless there is no room to keep it.
    pub fn run(network: &SoftplusNetwork<'_>, points: &[f32], memory: &KeptMemory) -> Option<Self> {
        let bytes = network.shape().first_pass_bytes(points.len() / 3);
        let booking = memory.book(bytes)?;
        Some(Self {
            pass: network.first_pass(points),
            _booking: booking,
        })
    }
}

/// Rows that an earlier pass with the same parameters has seen.
#[derive(Clone, Debug)]
pub struct KnownRows {
    /// That pass.
    pub pass: Arc<KnownPass>,
    /// Of each row at hand its number there.
    pub rows: Arc<[u32]>,
}

impl KnownRows {
    pub(crate) fn as_known(&self) -> Known<'_> {
        Known {
            pass: &self.pass.pass,
            rows: &self.rows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_booked_up_to_its_end_and_given_back() {
        let memory = KeptMemory::of_bytes(10);
        let first = memory.book(6).unwrap();
        assert!(memory.clone().book(5).is_none());
        drop(first);
        assert!(memory.book(10).is_some());
    }
}
