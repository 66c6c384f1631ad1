//! Ctrl-C: the first one asks the run to end, the second one ends it.

use crate::error::{CliError, INTERRUPTED};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A flag that every Ctrl-C, or request to terminate, sets, for a command that clears
/// it and decides itself what the second one means.
pub fn repeated_flag() -> Result<Arc<AtomicBool>, CliError> {
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(&interrupted)).map_err(CliError::Interrupt)?;
    }
    Ok(interrupted)
}

/// A flag that the first Ctrl-C, or a request to terminate, sets. Requests to terminate
/// may come twice, to a process and to its group: only a second Ctrl-C ends at once.
pub fn flag() -> Result<Arc<AtomicBool>, CliError> {
    let interrupted = Arc::new(AtomicBool::new(false));
    // Registered first, so that it acts on the second signal only.
    flag::register_conditional_shutdown(SIGINT, INTERRUPTED.into(), Arc::clone(&interrupted))
        .map_err(CliError::Interrupt)?;
    for signal in [SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(&interrupted)).map_err(CliError::Interrupt)?;
    }
    Ok(interrupted)
}
