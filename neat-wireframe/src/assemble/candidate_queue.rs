//! Candidates by what speaks for them, where a bound costs less than the exact evidence: those
//! that others explain before their turn comes are never weighed.

use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// So many candidates are weighed at once, judged: enough for the threads of a machine, few
/// beside all that there are.
const BATCH: usize = 64;
/// Sums in another order differ by less, relative to one nat or to the sum.
const ROUNDING: f64 = 1e-9;

/// A candidate by its evidence; the first of equals is the larger.
struct Ranked(f64, usize);

impl PartialEq for Ranked {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Ranked {}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ranked {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.0.total_cmp(&other.0)).then(other.1.cmp(&self.1))
    }
}

/// Gives out candidates in the order of their evidence.
pub(super) struct CandidateQueue {
    min_evidence: f64,
    /// Those that have not been weighed, by their bounds, ascending.
    bounded: Vec<Ranked>,
    weighed: BinaryHeap<Ranked>,
}

impl CandidateQueue {
    /// Of candidates with these upper bounds of their evidence; those that cannot have more
    /// than `min_evidence` are left out.
    pub(super) fn new(bounds: &[f64], min_evidence: f64) -> Self {
        let mut bounded: Vec<Ranked> = (bounds.iter().enumerate())
            .map(|(index, bound)| Ranked(bound + ROUNDING * bound.abs().max(1.0), index))
            .filter(|candidate| candidate.0 > min_evidence)
            .collect();
        bounded.sort();
        Self {
            min_evidence,
            bounded,
            weighed: BinaryHeap::new(),
        }
    }

    /// The evidence and the index of the candidate that has most, as far as it is known. Those
    /// that are not `is_open` any more are dropped, and `weigh` tells the evidence of one.
    pub(super) fn pop(
        &mut self,
        is_open: impl Fn(usize) -> bool,
        weigh: impl Fn(usize) -> f64 + Sync,
    ) -> Option<(f64, usize)> {
        loop {
            while self.bounded.last() > self.weighed.peek() {
                let mut batch = Vec::with_capacity(BATCH);
                while batch.len() < BATCH
                    && let Some(Ranked(_, index)) = self.bounded.pop()
                {
                    if is_open(index) {
                        batch.push(index);
                    }
                }
                let gains: Vec<f64> = batch.par_iter().map(|index| weigh(*index)).collect();
                for (gain, index) in gains.into_iter().zip(batch) {
                    self.push(gain, index);
                }
            }
            let Ranked(gain, index) = self.weighed.pop()?;
            if is_open(index) {
                return Some((gain, index));
            }
        }
    }

    /// Those that are left.
    pub(super) fn len(&self) -> usize {
        self.bounded.len() + self.weighed.len()
    }

    /// Puts a candidate back; one with too little evidence is dropped.
    pub(super) fn push(&mut self, gain: f64, index: usize) {
        if gain > self.min_evidence {
            self.weighed.push(Ranked(gain, index));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::sync::Mutex;

    #[test]
    fn candidates_come_in_the_order_of_their_evidence_and_few_are_weighed() {
        // Evidence between half of the bound and all of it, with equals.
        let bounds: Vec<f64> = (0..1000_u32).map(|k| f64::from(k * 37 % 500)).collect();
        let gains: Vec<f64> = (bounds.iter().enumerate())
            .map(|(k, bound)| if k % 3 == 0 { *bound } else { 0.5 * bound })
            .collect();
        let mut expected: Vec<usize> = (0..1000).filter(|k| gains[*k] > 3.0).collect();
        expected.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));

        let mut queue = CandidateQueue::new(&bounds, 3.0);
        let found: Vec<usize> =
            std::iter::from_fn(|| Some(queue.pop(|_| true, |k| gains[k])?.1)).collect();
        assert_eq!(found, expected);

        // The first one explains all others.
        let mut queue = CandidateQueue::new(&bounds, 3.0);
        let weighed = Mutex::new(0);
        let given = RefCell::new(Vec::new());
        let weigh = |k: usize| {
            *weighed.lock().unwrap() += 1;
            gains[k]
        };
        while let Some((_, index)) = queue.pop(|_| given.borrow().is_empty(), weigh) {
            given.borrow_mut().push(index);
        }
        assert_eq!(given.into_inner(), expected[..1]);
        assert!(*weighed.lock().unwrap() <= BATCH);
    }

    #[test]
    fn what_is_put_back_comes_by_its_new_evidence() {
        let mut queue = CandidateQueue::new(&[9.0, 8.0, 7.0], 3.0);
        let weigh = |k: usize| [9.0, 8.0, 7.0][k];
        assert_eq!(queue.pop(|_| true, weigh), Some((9.0, 0)));
        queue.push(7.5, 0);
        queue.push(3.0, 1);
        assert_eq!(queue.pop(|_| true, weigh), Some((8.0, 1)));
        assert_eq!(queue.pop(|_| true, weigh), Some((7.5, 0)));
        assert_eq!(queue.pop(|_| true, weigh), Some((7.0, 2)));
        assert_eq!(queue.pop(|_| true, weigh), None);
    }
}
