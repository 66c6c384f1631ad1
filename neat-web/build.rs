//! The main thread of a WebAssembly program has a stack of 1 MiB unless it asks for more;
//! elsewhere it has eight, which is what everything was tested with.

use std::env;

const STACK_BYTES: u32 = 8 << 20;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "wasi") {
        println!("cargo::rustc-link-arg-bins=-zstack-size={STACK_BYTES}");
    }
}
