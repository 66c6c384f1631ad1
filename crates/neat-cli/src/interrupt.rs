//! Ctrl-C: the first one asks the run to end, the second one ends it.

use crate::error::{CliError, INTERRUPTED};
use crate::output;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that the first Ctrl-C, or a request to terminate, sets.
pub fn flag() -> Result<Arc<AtomicBool>, CliError> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if set.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
        output::note("ending after this step; press Ctrl-C again to end at once");
    })?;
    Ok(flag)
}
