//! What preparing a scene may use, and until when.

use neat_core::MemoryLimit;
use neat_core::file_cache::FileCache;
use std::sync::atomic::{AtomicBool, Ordering};

/// What preparing a scene may use, and until when. None of it decides what comes out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Resources<'a> {
    /// Keeps what takes long for the next time.
    pub cache: Option<&'a FileCache>,
    /// Whether images stay in memory, and how many are worked on at once.
    pub memory_limit: MemoryLimit,
    /// Ends the work once it is set.
    pub cancelled: Option<&'a AtomicBool>,
}

impl Resources<'_> {
    /// Whether the work should end.
    pub fn is_cancelled(&self) -> bool {
        (self.cancelled).is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}
