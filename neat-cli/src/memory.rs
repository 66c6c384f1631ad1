//! How much memory a command may use.

use bytesize::ByteSize;
use clap::Args;
use neat_core::MemoryLimit;
use neat_pipeline::resources::default_limit;

/// How much memory may be used.
#[derive(Clone, Copy, Debug, Args)]
pub struct MemoryArgs {
    /// Use at most so much memory (8GiB, 500MB) instead of three quarters of what there is: images
    /// that need more go to a temporary file in the folder of the cache, fewer are worked on at
    /// once, and steps of training that need more are taken in several passes
    #[arg(long, value_name = "SIZE", value_parser = parse)]
    memory_limit: Option<MemoryLimit>,
}

impl MemoryArgs {
    /// What was given, else what suits the machine.
    pub fn limit(self) -> MemoryLimit {
        self.memory_limit.unwrap_or_else(default_limit)
    }
}

/// Reads a size. Less than a megabyte is a number without its unit.
///
/// # Errors
/// If the text is no size, or a tiny one.
fn parse(text: &str) -> Result<MemoryLimit, String> {
    match text.parse::<ByteSize>() {
        Ok(size) if size >= ByteSize::mb(1) => Ok(MemoryLimit::of_bytes(size.as_u64())),
        _ => Err("write a size such as 8GiB or 500MB".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read() {
        for (text, bytes) in [
            ("8GiB", 8 << 30),
            ("500MB", 500_000_000),
            ("1.5 GiB", 3 << 29),
            ("1048576", 1 << 20),
        ] {
            assert_eq!(parse(text), Ok(MemoryLimit::of_bytes(bytes)), "{text}");
        }
        for text in ["", "8", "0", "-8GiB", "8 apples", "GiB", "ten GB"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
