//! Every reader of files from outside, but those of checkpoints and configurations:
//! its seeds are read, damaged ones do not make it panic, and neither does anything
//! that fuzzing has found.

#[path = "../../neat-core/src/mutation.rs"]
mod mutation;
#[path = "../../fuzz/src/readers.rs"]
mod readers;
#[path = "../../fuzz/src/seeds.rs"]
mod seeds;

use mutation::{CASES, damaged};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use readers::READERS;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

#[test]
fn damaged_files_do_not_panic() {
    for reader in READERS {
        for seed in (reader.seeds)() {
            assert!((reader.read)(&seed), "a seed of {}", reader.name);
            let mut runner = TestRunner::new(ProptestConfig {
                cases: CASES / 50,
                failure_persistence: None,
                ..ProptestConfig::default()
            });
            let outcome = runner.run(&damaged(seed), |bytes| {
                (reader.read)(&bytes);
                Ok(())
            });
            assert_eq!(outcome, Ok(()), "reader `{}`", reader.name);
        }
    }
}

#[test]
fn files_spliced_of_two_do_not_panic() {
    let seeds: Vec<Vec<u8>> = READERS.iter().flat_map(|reader| (reader.seeds)()).collect();
    for reader in READERS {
        for own in (reader.seeds)() {
            for other in &seeds {
                let spliced = [&own[..own.len() / 2], &other[other.len() / 2..]].concat();
                (reader.read)(&spliced);
            }
        }
    }
}

#[test]
fn what_was_found_stays_fixed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/regressions");
    let mut folders: Vec<_> = fs::read_dir(folder).unwrap().flatten().collect();
    folders.sort_by_key(|entry| entry.file_name());
    let names: BTreeSet<&str> = READERS.iter().map(|reader| reader.name).collect();
    for folder in folders.iter().filter(|entry| entry.path().is_dir()) {
        let name = folder.file_name().into_string().unwrap();
        assert!(names.contains(name.as_str()), "no reader is called {name}");
        let reader = READERS.iter().find(|reader| reader.name == name).unwrap();
        for file in fs::read_dir(folder.path()).unwrap().flatten() {
            (reader.read)(&fs::read(file.path()).unwrap());
        }
    }
}
