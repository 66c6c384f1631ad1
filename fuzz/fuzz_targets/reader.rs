//! One program for all readers, since each more would be linked in a minute: the
//! environment variable NEAT_READER says which. Without it the program writes the seeds
//! of every reader to `corpus/READER/`, prints the readers' names, and ends.

#![no_main]

use libfuzzer_sys::fuzz_target;
use neat_fuzz::readers::{READERS, Reader};
use std::path::Path;
use std::sync::OnceLock;
use std::{env, fs, io, process};

static READER: OnceLock<&Reader> = OnceLock::new();

fn choose_reader() {
    let Ok(name) = env::var("NEAT_READER") else {
        write_seeds().expect("a place for the seeds");
        process::exit(0);
    };
    let reader = READERS.iter().find(|reader| reader.name == name);
    READER.get_or_init(|| reader.expect("NEAT_READER: the name of a reader"));
}

fn write_seeds() -> io::Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for reader in READERS {
        let folder = corpus.join(reader.name);
        fs::create_dir_all(&folder)?;
        for (index, seed) in (reader.seeds)().into_iter().enumerate() {
            fs::write(folder.join(format!("seed-{index}")), seed)?;
        }
        println!("{}", reader.name);
    }
    Ok(())
}

fuzz_target!(init: choose_reader(), |bytes: &[u8]| {
    if let Some(reader) = READER.get() {
        (reader.read)(bytes);
    }
});
