//! One child process.

use crate::job_record::Outcome;
use crate::log_file::LogFile;
use crate::stop::{Stop, StopSwitch};
use std::fs::File;
use std::io;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How often the child and the switch are looked at. Each look is one cheap call.
pub const POLL_INTERVAL: Duration = Duration::from_millis(25);
/// How often the log is looked at.
const LINE_INTERVAL: Duration = Duration::from_millis(500);

/// A program to run for a job.
pub struct Attempt<'a> {
    /// The program with its arguments.
    pub command: Command,
    /// Its standard input, which holds the lock of the job.
    pub input: Stdio,
    /// Where its output goes.
    pub output: File,
    /// The log that `output` appends to …
    pub log: &'a LogFile,
    /// … from this byte on.
    pub log_start: u64,
}

impl Attempt<'_> {
    /// Runs the program to its end, tells of its last line now and then, and passes
    /// requests to stop on to it.
    pub fn run(self, stop: &StopSwitch, on_line: &mut dyn FnMut(String)) -> Outcome {
        let (log, log_start) = (self.log, self.log_start);
        let mut child = match self.spawn() {
            Ok(child) => child,
            Err(error) => return Outcome::NotStarted(error.to_string()),
        };
        let mut passed_on = Stop::No;
        let mut line = None;
        let mut last_look = Instant::now();
        loop {
            match child.try_wait() {
                Ok(Some(status)) => return outcome(status),
                Ok(None) => {}
                Err(_) => return Outcome::Unknown,
            }
            let asked_for = stop.asked_for();
            if asked_for > passed_on {
                pass_on(asked_for, &mut child);
                passed_on = asked_for;
            }
            if last_look.elapsed() >= LINE_INTERVAL {
                last_look = Instant::now();
                let now = log.last_line(log_start);
                if now != line
                    && let Some(text) = &now
                {
                    on_line(text.clone());
                }
                line = now;
            }
            sleep(POLL_INTERVAL);
        }
    }

    fn spawn(mut self) -> io::Result<Child> {
        // Ctrl-C reaches the whole group of a terminal's process: in a group of
        // its own, the program hears of it once, and from us.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut self.command, 0);
        self.command
            .stdin(self.input)
            .stdout(self.output.try_clone()?)
            .stderr(self.output)
            .spawn()
    }
}

#[cfg(unix)]
fn pass_on(stop: Stop, child: &mut Child) {
    use rustix::process::{Pid, Signal, kill_process_group};
    let signal = match stop {
        Stop::No => return,
        Stop::AfterStep => Signal::TERM,
        Stop::Now => Signal::KILL,
    };
    // It may have ended by itself just now. Its number stays taken until we wait.
    let _ = kill_process_group(Pid::from_child(child), signal);
}

/// Without signals, a program ends after its job, or now.
#[cfg(not(unix))]
fn pass_on(stop: Stop, child: &mut Child) {
    if stop == Stop::Now {
        // It may have ended by itself just now.
        let _ = child.kill();
    }
}

fn outcome(status: ExitStatus) -> Outcome {
    if let Some(code) = status.code() {
        return Outcome::Exited(code);
    }
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return Outcome::Killed(signal);
    }
    Outcome::Unknown
}
