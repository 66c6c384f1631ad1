//! Times as people write them: `90s`, `10m`, `1h30m`, or plain seconds.

use std::time::Duration;

/// Reads a time.
///
/// # Errors
/// If the text is not a positive time.
pub fn parse(text: &str) -> Result<Duration, String> {
    let mut seconds = 0.0;
    let mut rest = text.trim();
    while !rest.is_empty() {
        let digits = rest
            .find(|c: char| !c.is_ascii_digit() && c != '.')
            .unwrap_or(rest.len());
        let number: f64 = rest[..digits].parse().map_err(|_| explain())?;
        let unit_length = rest[digits..]
            .find(|c: char| c.is_ascii_digit())
            .unwrap_or(rest.len() - digits);
        let (unit, after) = rest[digits..].split_at(unit_length);
        seconds += number
            * match unit {
                "s" | "" => 1.0,
                "m" | "min" => 60.0,
                "h" => 3600.0,
                _ => return Err(explain()),
            };
        rest = after;
    }
    match Duration::try_from_secs_f64(seconds) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err(explain()),
    }
}

fn explain() -> String {
    "write a time such as 90s, 10m or 1h30m".to_owned()
}

/// A time for people: `45 s`, `3 min 05 s`, `2 h 10 min`.
pub fn display(seconds: f64) -> String {
    // Saturates; nobody waits for so long.
    let seconds = seconds.max(0.0).round() as u64;
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    match (hours, minutes) {
        (0, 0) => format!("{seconds} s"),
        (0, _) => format!("{minutes} min {:02} s", seconds % 60),
        _ => format!("{hours} h {minutes:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read() {
        for (text, seconds) in [
            ("90s", 90.0),
            ("10m", 600.0),
            ("1h30m", 5400.0),
            ("1.5h", 5400.0),
            ("45", 45.0),
            (" 2min30s ", 150.0),
        ] {
            assert_eq!(parse(text), Ok(Duration::from_secs_f64(seconds)), "{text}");
        }
        for text in ["", "0", "m", "10x", "-5s", "1e400h", "1h-3m", "..s", "ä"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn times_are_shown() {
        assert_eq!(display(44.6), "45 s");
        assert_eq!(display(185.0), "3 min 05 s");
        assert_eq!(display(7800.0), "2 h 10 min");
        assert_eq!(display(f64::NAN), "0 s");
    }
}
