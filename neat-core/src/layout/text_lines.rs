//! Text files of lines with fields between white space.

use crate::SceneError;
use std::path::Path;
use std::str::FromStr;

/// What is left of a line.
pub(super) struct Line<'a> {
    path: &'a Path,
    number: usize,
    /// The view or camera that it is about, once that is known; for messages.
    pub owner: Option<String>,
    /// The fields that have not been taken.
    pub rest: &'a str,
}

impl<'a> Line<'a> {
    /// Whether it is neither empty nor a comment.
    pub fn is_record(&self) -> bool {
        let text = self.rest.trim_start();
        !text.is_empty() && !text.starts_with('#')
    }

    /// The next field; `what` names it in the message where there is none.
    pub fn field(&mut self, what: &str) -> Result<&'a str, SceneError> {
        next_field(&mut self.rest).ok_or_else(|| self.error(&format!("it ends before {what}")))
    }

    /// The next field as a number.
    pub fn parse<T: FromStr>(&mut self, what: &str) -> Result<T, SceneError> {
        let field = self.field(what)?;
        field
            .parse()
            .map_err(|_| self.error(&format!("`{field}` cannot be {what}")))
    }

    /// The next fields as numbers, each with a name of its own.
    pub fn named<const N: usize>(&mut self, names: [&str; N]) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        for (number, name) in numbers.iter_mut().zip(names) {
            *number = self.parse(name)?;
        }
        Ok(numbers)
    }

    /// The next fields as numbers.
    pub fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], SceneError> {
        self.named([what; N])
    }

    /// Whether all fields have been taken.
    pub fn is_at_end(&self) -> bool {
        self.rest.trim().is_empty()
    }

    pub fn error(&self, reason: &str) -> SceneError {
        let owner = self
            .owner
            .as_deref()
            .map_or(String::new(), |owner| format!(", {owner}"));
        SceneError::malformed(self.path, format!("line {}{owner}: {reason}", self.number))
    }
}

/// Takes what is before the next white space.
pub(super) fn next_field<'a>(rest: &mut &'a str) -> Option<&'a str> {
    let text = rest.trim_start();
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
    let (field, after) = text.split_at(end);
    *rest = after;
    (!field.is_empty()).then_some(field)
}

/// All lines of a file; `path` is for messages.
pub(super) fn lines<'a>(
    path: &'a Path,
    bytes: &'a [u8],
) -> Result<impl Iterator<Item = Line<'a>>, SceneError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| SceneError::malformed(path, format!("it is not UTF-8 text: {error}")))?;
    Ok((1..).zip(text.lines()).map(move |(number, rest)| Line {
        path,
        number,
        owner: None,
        rest,
    }))
}

/// Lines that are neither empty nor comments.
pub(super) fn records<'a>(
    path: &'a Path,
    bytes: &'a [u8],
) -> Result<impl Iterator<Item = Line<'a>>, SceneError> {
    Ok(lines(path, bytes)?.filter(Line::is_record))
}

/// A file of records, of which the next one must be there.
pub(super) struct Records<'a, I> {
    path: &'a Path,
    lines: I,
}

/// The records of a file, to be asked for one by one.
pub(super) fn expected_records<'a>(
    path: &'a Path,
    bytes: &'a [u8],
) -> Result<Records<'a, impl Iterator<Item = Line<'a>>>, SceneError> {
    let lines = records(path, bytes)?;
    Ok(Records { path, lines })
}

impl<'a, I: Iterator<Item = Line<'a>>> Records<'a, I> {
    /// The next record, if there is one.
    pub fn next(&mut self) -> Option<Line<'a>> {
        self.lines.next()
    }

    /// The next record, which is `what`.
    pub fn expect(&mut self, what: &str) -> Result<Line<'a>, SceneError> {
        self.next()
            .ok_or_else(|| SceneError::malformed(self.path, format!("it ends before {what}")))
    }
}
