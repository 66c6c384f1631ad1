//! Keeping a second thread awake while a step runs.

use std::sync::atomic::{AtomicBool, Ordering};

/// Runs `work` in rayon's pool with a second worker that looks for its parallel
/// parts without going to sleep between them.
///
/// A step of the `fast` preset is a few milliseconds with a dozen short parallel
/// parts; waking a sleeping thread for each takes as long as it saves (measured:
/// `docs/performance.md`). The price is a busy thread while `work` is serial.
pub(crate) fn with_awake_worker<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    /// Set when the work ends, even if it panics.
    struct Done<'a>(&'a AtomicBool);
    impl Drop for Done<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Release);
        }
    }

    let done = AtomicBool::new(false);
    let (result, ()) = rayon::join(
        || {
            let _done = Done(&done);
            work()
        },
        || {
            while !done.load(Ordering::Acquire) {
                if rayon::yield_now() != Some(rayon::Yield::Executed) {
                    // Others that want this processor go first.
                    std::thread::yield_now();
                }
            }
        },
    );
    result
}
