//! The header is what cbindgen makes of the sources.

use std::env;
use std::fs;
use std::path::Path;

/// `NEAT_WRITE_HEADER=1 cargo test -p neat-capi --test header` writes it.
#[test]
fn the_header_is_current() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    let mut made = Vec::new();
    cbindgen::Builder::new()
        .with_config(config)
        .with_src(root.join("src/types.rs"))
        .with_src(root.join("src/border.rs"))
        .generate()
        .unwrap()
        .write(&mut made);
    let made = String::from_utf8(made).unwrap();
    let path = root.join("include/neat.h");
    if env::var_os("NEAT_WRITE_HEADER").is_some() {
        fs::write(&path, &made).unwrap();
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == made,
        "include/neat.h is not what the sources make: run this test with NEAT_WRITE_HEADER=1"
    );
}
