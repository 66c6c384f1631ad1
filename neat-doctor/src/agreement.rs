//! How much of what the images show is explained by given cameras.

use std::ops::AddAssign;

/// How many of how many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub explained: usize,
    pub total: usize,
}

impl Tally {
    pub fn one(explained: bool) -> Self {
        Self {
            explained: usize::from(explained),
            total: 1,
        }
    }

    /// In [0, 1]; 0 of nothing is 0.
    pub fn share(&self) -> f64 {
        self.explained as f64 / self.total.max(1) as f64
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.explained += other.explained;
        self.total += other.total;
    }
}

/// What cameras explain, in all and of each view.
#[derive(Clone, Debug)]
pub(crate) struct Agreement {
    pub all: Tally,
    /// Grows with how much is explained and how exactly: smooth enough for a
    /// search, of the same evidence.
    pub score: f64,
    /// For each view of the scene.
    pub per_view: Vec<Tally>,
}

impl Agreement {
    pub fn none(views: usize) -> Self {
        Self {
            all: Tally::default(),
            score: 0.0,
            per_view: vec![Tally::default(); views],
        }
    }

    pub fn share(&self) -> f64 {
        self.all.share()
    }
}

/// What each two views have in common.
pub(crate) struct PairTallies {
    views: usize,
    tallies: Vec<Tally>,
}

impl PairTallies {
    pub fn new(views: usize) -> Self {
        let tallies = vec![Tally::default(); views * views];
        Self { views, tallies }
    }

    pub fn add(&mut self, [a, b]: [usize; 2], tally: Tally) {
        self.tallies[a.min(b) * self.views + a.max(b)] += tally;
    }

    pub fn of(&self, [a, b]: [usize; 2]) -> Tally {
        self.tallies[a.min(b) * self.views + a.max(b)]
    }
}
