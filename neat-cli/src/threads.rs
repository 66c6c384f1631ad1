//! The CPU threads of a command: as many as were asked for, within reason, and as many as the
//! system gives.

use crate::error::CliError;
use crate::output;
use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};
use std::env;
use std::sync::mpsc;
use std::thread::{self, Builder};

/// More threads for each core only wait for each other, and for memory.
const PER_CORE: usize = 4;

/// Starts the threads that all parallel work shares: `asked` of them, or as many as the
/// variable `RAYON_NUM_THREADS` says, or one per core. Says so where they become fewer.
///
/// # Errors
/// If the system takes back what it has just given.
pub fn start(asked: Option<u16>) -> Result<(), CliError> {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let of_variable = || env::var("RAYON_NUM_THREADS").ok()?.parse().ok();
    let wanted = (asked.map(usize::from).or_else(of_variable))
        .filter(|threads| *threads > 0)
        .unwrap_or(cores);
    let most = PER_CORE * cores;
    if wanted > most {
        output::warning(&format!(
            "{wanted} threads are more than {PER_CORE} for each of {cores} cores: {most} are used"
        ));
    }
    let wanted = wanted.min(most);
    let given = startable(wanted);
    if given < wanted {
        output::warning(&format!(
            "the system starts {given} of {wanted} threads (ulimit -u): it will take longer"
        ));
    }
    pool(given).map_err(CliError::Threads)
}

/// A pool of so many threads; of none, the one that calls.
fn pool(threads: usize) -> Result<(), ThreadPoolBuildError> {
    let builder = ThreadPoolBuilder::new().num_threads(threads.max(1));
    match threads {
        0 => builder.use_current_thread().build_global(),
        _ => builder.build_global(),
    }
}

/// How many of so many threads the system starts: a pool that lacks one cannot be had, and
/// is tried for only once.
fn startable(wanted: usize) -> usize {
    let mut started = Vec::with_capacity(wanted);
    // All at once, or they would make room for each other.
    for _ in 0..wanted {
        let (release, released) = mpsc::channel::<()>();
        match Builder::new().spawn(move || released.recv()) {
            Ok(thread) => started.push((release, thread)),
            Err(_) => break,
        }
    }
    let count = started.len();
    for (release, thread) in started {
        drop(release);
        // It has waited for an end, which is no error here.
        let _ = thread.join();
    }
    count
}
