//! Little-endian binary files, read without trusting a number in them.

use crate::SceneError;
use std::path::Path;

/// The bytes of a file that are still to be read. In every method `what` names
/// what is being read, for the message where the file ends too early.
pub(super) struct BinaryReader<'a> {
    path: &'a Path,
    rest: &'a [u8],
}

impl<'a> BinaryReader<'a> {
    /// The whole file; `path` is for messages.
    pub fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self { path, rest: bytes }
    }

    /// How many bytes are left.
    pub fn remaining(&self) -> usize {
        self.rest.len()
    }

    pub fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], SceneError> {
        let Some((bytes, rest)) = self.rest.split_first_chunk() else {
            return Err(self.cut_off(what));
        };
        self.rest = rest;
        Ok(*bytes)
    }

    pub fn u32(&mut self, what: &str) -> Result<u32, SceneError> {
        self.take(what).map(u32::from_le_bytes)
    }

    pub fn u64(&mut self, what: &str) -> Result<u64, SceneError> {
        self.take(what).map(u64::from_le_bytes)
    }

    pub fn f32(&mut self, what: &str) -> Result<f32, SceneError> {
        self.take(what).map(f32::from_le_bytes)
    }

    pub fn f64(&mut self, what: &str) -> Result<f64, SceneError> {
        self.take(what).map(f64::from_le_bytes)
    }

    pub fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64(what)?;
        }
        Ok(numbers)
    }

    /// The bytes of `count` records of `size` bytes each.
    pub fn records(&mut self, count: u64, size: u64, what: &str) -> Result<&'a [u8], SceneError> {
        let split = count
            .checked_mul(size)
            .and_then(|bytes| usize::try_from(bytes).ok())
            .and_then(|bytes| self.rest.split_at_checked(bytes));
        let Some((records, rest)) = split else {
            return Err(self.cut_off(what));
        };
        self.rest = rest;
        Ok(records)
    }

    /// Text up to a zero byte.
    pub fn zero_ended_text(&mut self, what: &str) -> Result<String, SceneError> {
        let Some(end) = self.rest.iter().position(|&byte| byte == 0) else {
            return Err(self.cut_off(what));
        };
        let text = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        self.utf8(text, what)
    }

    /// Text after its length as 64 bits.
    pub fn counted_text(&mut self, what: &str) -> Result<String, SceneError> {
        let length = self.u64(what)?;
        let text = self.records(length, 1, what)?;
        self.utf8(text, what)
    }

    fn utf8(&self, text: &[u8], what: &str) -> Result<String, SceneError> {
        match std::str::from_utf8(text) {
            Ok(text) => Ok(text.into()),
            Err(_) => Err(SceneError::malformed(
                self.path,
                format!("the name of {what} is not UTF-8"),
            )),
        }
    }

    fn cut_off(&self, what: &str) -> SceneError {
        SceneError::malformed(self.path, format!("it ends within {what}"))
    }
}
