//! Names of views: they become file names, on any system.

/// The longest name in bytes: with what is added to it, such as `.name-normal.png` and
/// the number of a temporary file, it stays a file name.
const MAX_BYTES: usize = 200;
/// What Windows takes for devices, with any ending and in either case; `1` to `9`
/// follow the last two.
const DEVICES: [&str; 4] = ["CON", "PRN", "AUX", "NUL"];
const NUMBERED_DEVICES: [&str; 2] = ["COM", "LPT"];

/// Why `name` cannot be the name of a file in a folder that is told, if it cannot.
pub(crate) fn problem(name: &str) -> Option<&'static str> {
    if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\']) {
        return Some("is not a plain file name: rename it");
    }
    if name.contains(char::is_control) {
        return Some("has a control character: rename it");
    }
    if name.len() > MAX_BYTES {
        return Some("has more than 200 bytes: rename it");
    }
    if is_device(name) {
        return Some("is a device on some systems: rename it");
    }
    None
}

fn is_device(name: &str) -> bool {
    let base = name.split('.').next().unwrap_or_default();
    let base = base.trim_end().to_ascii_uppercase();
    let numbered = |device: &&str| {
        (base.strip_prefix(*device))
            .is_some_and(|number| matches!(number.as_bytes(), [b'1'..=b'9']))
    };
    DEVICES.contains(&base.as_str()) || NUMBERED_DEVICES.iter().any(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_files_on_any_system() {
        let long = "a".repeat(MAX_BYTES);
        for good in [
            "a",
            "IMG 0001.final",
            "com",
            "com10",
            "console",
            "überall",
            &long,
        ] {
            assert_eq!(problem(good), None, "{good}");
        }
        let longer = "ü".repeat(MAX_BYTES / 2 + 1);
        for bad in [
            "",
            ".",
            "..",
            ".hidden",
            "a/b",
            "../a",
            "/etc/passwd",
            r"..\a",
            r"C:\a",
            "a\0b",
            "a\nb",
            "a\u{85}b",
            "\u{1b}[31m",
            "nul",
            "Con",
            "AUX.left",
            "com1",
            "LPT9 .x",
            &longer,
        ] {
            assert!(problem(bad).is_some(), "{bad:?}");
        }
    }
}
