//! Writes the seeds of every reader to `corpus/READER/`, and prints the names.

use neat_fuzz::readers::READERS;
use std::path::Path;
use std::{fs, io};

fn main() -> io::Result<()> {
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
