//! A disk of a given size that tests can fill and write-protect.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// What the system gives out at once, in bytes.
pub const PAGE: u64 = 4096;
/// More than any run in these tests needs.
const PLENTY: u64 = 1 << 28;

/// A file system in memory, mounted until it is dropped.
pub struct Disk {
    path: PathBuf,
}

impl Disk {
    /// Mounts a disk with plenty of space; `None`, with a message, where this user may
    /// not.
    #[expect(clippy::print_stderr, reason = "a skipped test must say so")]
    pub fn mount(path: PathBuf) -> Option<Self> {
        std::fs::create_dir(&path).unwrap();
        let options = format!("size={PLENTY}");
        let result = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &options, "neat-test"])
            .arg(&path)
            .output();
        match result {
            Ok(output) if output.status.success() => Some(Self { path }),
            result => {
                let said = result.map_or_else(|error| error.to_string(), |output| said(&output));
                eprintln!(
                    "skipped: no small disk can be mounted here ({})",
                    said.trim()
                );
                None
            }
        }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Limits the disk to so many bytes, a multiple of [`PAGE`] above 0.
    pub fn resize(&self, bytes: u64) {
        self.remount(&format!("size={bytes}"));
    }

    pub fn make_roomy(&self) {
        self.resize(PLENTY);
    }

    pub fn set_read_only(&self, read_only: bool) {
        self.remount(if read_only { "ro" } else { "rw" });
    }

    /// Bytes that are taken.
    pub fn used(&self) -> u64 {
        let output = Command::new("df").arg("-kP").arg(&self.path).output();
        let text = String::from_utf8(output.unwrap().stdout).unwrap();
        let mut fields = text.lines().nth(1).unwrap().split_whitespace();
        1024 * fields.nth(2).unwrap().parse::<u64>().unwrap()
    }

    fn remount(&self, option: &str) {
        let options = format!("remount,{option}");
        let mut command = Command::new("mount");
        let output = command.args(["-o", &options]).arg(&self.path).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", said(&output));
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // What is still open on a disk of a failed test must not keep it.
        let _ = Command::new("umount").arg("-l").arg(&self.path).status();
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
