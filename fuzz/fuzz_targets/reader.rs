//! One program for all readers, since each more would be linked in a minute: the
//! environment variable NEAT_READER says which.

#![no_main]

use libfuzzer_sys::fuzz_target;
use neat_fuzz::readers::{READERS, Reader};
use std::env;
use std::sync::LazyLock;

static READER: LazyLock<&Reader> = LazyLock::new(|| {
    let name = env::var("NEAT_READER").unwrap_or_default();
    let reader = READERS.iter().find(|reader| reader.name == name);
    reader.expect("NEAT_READER: the name of a reader")
});

fuzz_target!(|bytes: &[u8]| {
    (READER.read)(bytes);
});
