//! Real and rendered scenes, which are not part of the repository.

use std::path::PathBuf;

/// All that are known.
#[allow(dead_code, reason = "not every test asks for all of them")]
pub const SCENES: [&str; 23] = [
    "abc-00075213",
    "abc-00001776",
    "abc-00003173",
    "cad-0406",
    "cad-three-concave",
    "abcnef-00000952",
    "abcnef-00004926",
    "dtu-scan24",
    "strecha-entry-P10",
    "sceaux-castle",
    "photoreal/house_1",
    "photoreal/facade_1",
    "photoreal/objects_1",
    "parts/part-001",
    "parts/part-002",
    "parts/part-003",
    "parts/part-004",
    "parts/part-005",
    "parts/part-006",
    "parts/part-007",
    "parts/part-008",
    "parts/part-009",
    "parts/part-010",
];

/// The folder of a real scene, or `None`, said aloud, where there is none.
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
pub fn real(scene: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let root = std::env::var_os("NEAT_DATA").map_or_else(|| default.into(), PathBuf::from);
    let dir = root.join(scene);
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("skipped: no real data at {}", dir.display());
    None
}
