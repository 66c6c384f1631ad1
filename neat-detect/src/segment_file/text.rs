//! Segments as text: `x1 y1 x2 y2` and anything after it, one per line.
//!
//! Numbers are separated by blanks, tabs or commas. Empty lines and lines that
//! begin with `#` are skipped, and so is a single number on the first line:
//! LIMAP writes how many segments follow. LSD writes width, precision and -log10
//! NFA after the four coordinates.

use super::from_row;
use neat_core::{LineSegment2, SceneError};
use std::path::Path;

/// Parses the bytes of a file; `path` is for messages.
///
/// # Errors
/// If the file is no text, or a line does not begin with four finite numbers.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Vec<LineSegment2>, SceneError> {
    let malformed = |reason: String| SceneError::Malformed {
        path: path.into(),
        reason,
    };
    let text = str::from_utf8(bytes).map_err(|_| malformed("it is no text".into()))?;
    let mut segments = Vec::new();
    let mut is_first = true;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = (line.split(|c: char| c.is_whitespace() || c == ','))
            .filter(|word| !word.is_empty())
            .collect();
        let is_count = is_first && words.len() == 1 && words[0].parse::<u64>().is_ok();
        is_first = false;
        if is_count {
            continue;
        }
        let mut row = [f64::NAN; 4];
        for (value, word) in row.iter_mut().zip(&words) {
            *value = word.parse().unwrap_or(f64::NAN);
        }
        if !row.iter().all(|value| value.is_finite()) {
            let number = number + 1;
            return Err(malformed(format!(
                "line {number} does not begin with x1 y1 x2 y2"
            )));
        }
        segments.push(from_row(row));
    }
    Ok(segments)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<LineSegment2>, SceneError> {
        super::parse(text.as_bytes(), Path::new("a.txt"))
    }

    #[test]
    fn limap_lsd_and_csv_mean_the_same() {
        let plain = parse("1 2 3.5 4\n5 6 7 8\n").unwrap();
        assert_eq!(
            plain,
            [
                from_row([1.0, 2.0, 3.5, 4.0]),
                from_row([5.0, 6.0, 7.0, 8.0])
            ]
        );
        assert_eq!(parse("2\n1 2 3.5 4\n5 6 7 8").unwrap(), plain);
        assert_eq!(
            parse("1 2 3.5 4 1.9 0.125 17.2\n\n5\t6 7 8 2 0.125 30").unwrap(),
            plain
        );
        assert_eq!(
            parse("# x1,y1,x2,y2\r\n1, 2,3.5,4\r\n5,6,7,8\r\n").unwrap(),
            plain
        );
        assert_eq!(parse("0\n").unwrap(), []);
    }

    #[test]
    fn messages_name_the_line() {
        for text in [
            "1 2 3 4\n1 2 3",
            "1 2 3 4\n\n1 2 x 4",
            "1 2 3 4\n7",
            "a\n",
            "1 2 3 inf",
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(
                message.contains("a.txt") && message.contains("line"),
                "{message}"
            );
        }
        assert!(super::parse(&[0xff, 0xfe], Path::new("a.txt")).is_err());
    }
}
