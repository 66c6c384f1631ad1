//! Ctrl-C: the first one asks the run to end, the second one ends it. Requests to terminate
//! and terminals that are closed ask, too.

use crate::error::{CliError, INTERRUPTED};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

#[cfg(unix)]
use signal_hook::consts::SIGHUP;
use signal_hook::consts::{SIGINT, SIGTERM};

/// A flag that every Ctrl-C, or request to terminate, sets, for a command that clears
/// it and decides itself what the second one means.
pub fn repeated_flag() -> Result<Arc<AtomicBool>, CliError> {
    let interrupted = Arc::new(AtomicBool::new(false));
    register(&interrupted)?;
    Ok(interrupted)
}

/// A flag that the first Ctrl-C, or a request to terminate, sets. Requests to terminate
/// may come twice, to a process and to its group: only a second Ctrl-C ends at once.
pub fn flag() -> Result<Arc<AtomicBool>, CliError> {
    let interrupted = Arc::new(AtomicBool::new(false));
    // Registered first, so that it acts on the second signal only.
    flag::register_conditional_shutdown(SIGINT, INTERRUPTED.into(), Arc::clone(&interrupted))
        .map_err(CliError::Interrupt)?;
    register(&interrupted)?;
    Ok(interrupted)
}

fn register(interrupted: &Arc<AtomicBool>) -> Result<(), CliError> {
    let mut signals = vec![SIGINT, SIGTERM];
    #[cfg(unix)]
    if !is_ignored(SIGHUP) {
        signals.push(SIGHUP);
    }
    for signal in signals {
        flag::register(signal, Arc::clone(interrupted)).map_err(CliError::Interrupt)?;
    }
    Ok(())
}

/// Lets a file that grows beyond a limit (`ulimit -f`) fail like one on a full disk, where the
/// system would end the process.
pub fn survive_limits() -> Result<(), CliError> {
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map_err(CliError::Interrupt)?;
    Ok(())
}

/// Whether whoever started the process asked it to ignore a signal, as `nohup` does. Where the
/// system does not say, that is believed of programs that no terminal listens to.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    use std::io::{IsTerminal, stderr};

    let mask = std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| {
            let mask = status
                .lines()
                .find_map(|line| line.strip_prefix("SigIgn:"))?;
            u64::from_str_radix(mask.trim(), 16).ok()
        });
    match mask {
        Some(mask) => mask >> (signal - 1) & 1 == 1,
        None => !stderr().is_terminal(),
    }
}
