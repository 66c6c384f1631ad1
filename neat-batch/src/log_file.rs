//! `log.txt`: what the program of a job said, in all attempts.

use neat_core::SceneError;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// So much of the end of a log is looked at.
const TAIL_BYTES: u64 = 1 << 14;
/// Errors are cut to so many characters.
const LONGEST_ERROR: usize = 500;

/// The log of a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogFile {
    path: PathBuf,
}

impl LogFile {
    pub fn new(path: PathBuf) -> Self {
        Self { path }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a line and returns the file for more, with its length.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn begin(&self, line: &str) -> Result<(File, u64), SceneError> {
        let append = || {
            let mut file = OpenOptions::new()
                .create(true)
                .append(true)
                .open(&self.path)?;
            writeln!(file, "{line}")?;
            let length = file.metadata()?.len();
            Ok((file, length))
        };
        append().map_err(|source| SceneError::Write {
            path: self.path.clone(),
            source,
        })
    }

    /// The last line from byte `start` on that is not empty.
    pub fn last_line(&self, start: u64) -> Option<String> {
        let text = self.tail(start).ok()?;
        let line = text.lines().rev().find(|line| !line.trim().is_empty())?;
        Some(line.trim().to_owned())
    }

    /// The last error that the program reported from byte `start` on, in one line:
    /// what follows `error: ` until a hint; without any, the last line.
    pub fn last_error(&self, start: u64) -> Option<String> {
        let text = self.tail(start).ok()?;
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        let found = lines.iter().rposition(|line| line.starts_with("error: "));
        let error = match found {
            Some(first) => {
                let rest = lines[first..].iter();
                let words = rest
                    .take_while(|line| !line.starts_with("hint: "))
                    .filter(|line| !line.is_empty());
                words.copied().collect::<Vec<_>>().join(" ")
            }
            None => self.last_line(start)?,
        };
        let error = error.strip_prefix("error: ").unwrap_or(&error);
        Some(error.chars().take(LONGEST_ERROR).collect())
    }

    /// The end of the log, not before byte `start`.
    fn tail(&self, start: u64) -> io::Result<String> {
        let mut file = File::open(&self.path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(
            start.max(length.saturating_sub(TAIL_BYTES)),
        ))?;
        let mut bytes = Vec::new();
        file.take(TAIL_BYTES).read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_of_this_attempt_with_all_their_lines() {
        let dir = tempfile::tempdir().unwrap();
        let log = LogFile::new(dir.path().join("log.txt"));
        assert_eq!(log.last_error(0), None);
        let (mut file, start) = log.begin("=== attempt 1").unwrap();
        assert_eq!(log.last_line(start), None);
        write!(
            file,
            "load 0 s\nerror: early\nerror: the poses\n are inverted\nhint: turn\n"
        )
        .unwrap();
        assert_eq!(log.last_error(start).unwrap(), "the poses are inverted");
        assert_eq!(log.last_line(start).unwrap(), "hint: turn");
        let (mut file, start) = log.begin("=== attempt 2").unwrap();
        assert_eq!(log.last_error(start), None);
        write!(file, "Segmentation fault\n\n").unwrap();
        assert_eq!(log.last_error(start).unwrap(), "Segmentation fault");
        write!(file, "error: {}", "long ".repeat(100_000)).unwrap();
        assert_eq!(log.last_error(0).unwrap().chars().count(), LONGEST_ERROR);
    }
}
