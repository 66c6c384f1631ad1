//! The authors' toy object, which is not part of the repository: set `NEAT_DATA`, or keep
//! it in `../shared/data`.

use std::path::PathBuf;

/// The folder of the toy object, or `None`, said aloud, where there is none.
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
pub fn toy_dir() -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let data = std::env::var_os("NEAT_DATA").map_or_else(|| default.into(), PathBuf::from);
    let dir = data.join("abc-00075213");
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("skipped: {} is not there, set NEAT_DATA", dir.display());
    None
}
