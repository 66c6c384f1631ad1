//! Work on threads of its own, while Python's thread listens for Ctrl-C.
//!
//! The work never holds the interpreter's lock, so that other threads of Python go on. Every
//! call has a pool of its own: the pool that all of a process share would be without its
//! threads in a child that Python has forked.

use crate::errors::Failure;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

/// So often it is looked whether there was a Ctrl-C.
const TICK: Duration = Duration::from_millis(50);
/// That of a program's first thread, on which the command line runs the same work.
const STACK_BYTES: usize = 8 << 20;

/// Does `work` on so many threads; `None` takes one per core, or what the variable
/// `RAYON_NUM_THREADS` says. Ctrl-C leaves it behind.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    run_watched(py, threads, |_, ()| Ok(()), |_, _| work())
}

/// Does `work`, which sends messages and looks at a flag. Messages are handed to `on_message`
/// on the calling thread. Ctrl-C, and an exception of `on_message`, set the flag, and the
/// work is waited for; a second Ctrl-C leaves it behind.
pub fn run_watched<T: Send + 'static, M: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    mut on_message: impl FnMut(Python<'_>, M) -> PyResult<()>,
    work: impl FnOnce(&AtomicBool, Sender<M>) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    if threads == Some(0) {
        return Err(Failure::input("threads is 0: give at least 1, or None for all").into());
    }
    let cancelled = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&cancelled);
    let (sender, mut messages) = mpsc::channel();
    let no_threads = |error: &dyn std::fmt::Display| {
        PyRuntimeError::new_err(format!(
            "the system starts no threads: raise its limit (ulimit -u), or use fewer with threads ({error})"
        ))
    };
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .stack_size(STACK_BYTES)
        .build()
        .map_err(|error| no_threads(&error))?;
    let worker = thread::Builder::new()
        .spawn(move || pool.install(|| work(&flag, sender)))
        .map_err(|error| no_threads(&error))?;
    // What Python wants to raise once the work has ended.
    let mut raised: Option<PyErr> = None;
    loop {
        let received;
        (messages, received) = py.detach(move || {
            let received = messages.recv_timeout(TICK);
            (messages, received)
        });
        let told = match received {
            Ok(message) if raised.is_none() => on_message(py, message),
            Ok(_) | Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        if let Err(error) = told.and_then(|()| py.check_signals()) {
            if raised.is_some() {
                return Err(error);
            }
            cancelled.store(true, Ordering::Relaxed);
            raised = Some(error);
        }
    }
    let result = py.detach(|| worker.join()).map_err(|panic| {
        PyRuntimeError::new_err(format!("neat has a bug: {}", in_words(panic.as_ref())))
    })?;
    match (raised, result) {
        (None, result) => Ok(result?),
        (Some(error), Err(failure))
            if failure.is_interrupt() && error.is_instance_of::<PyKeyboardInterrupt>(py) =>
        {
            Err(failure.into())
        }
        (Some(error), _) => Err(error),
    }
}

fn in_words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    (text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))).unwrap_or("a panic")
}
