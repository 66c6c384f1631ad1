//! Damaged files, for the tests of every reader.

use proptest::prelude::*;
use proptest::sample::Index;

/// How many damaged files each reader is tested with; Miri takes a thousand times as
/// long.
pub(crate) const CASES: u32 = if cfg!(miri) { 10 } else { 10_000 };

/// What often breaks parsers: numbers that are none, too large or negative, and
/// brackets without a partner.
const AWKWARD: [&[u8]; 12] = [
    b"NaN",
    b"-inf",
    b"1e400",
    b"-1",
    b"0",
    b"18446744073709551616",
    b"4294967295",
    b"null",
    b"[{",
    b"\"",
    b"\xff\xff\xff\xff\xff\xff\xff\xff",
    b"\0\0\0\0",
];

/// One damage, at a place that is chosen apart.
#[derive(Clone, Debug)]
enum Change {
    Overwrite(u8),
    Insert(Vec<u8>),
    Replace(usize, &'static [u8]),
    Remove(usize),
    Repeat(usize),
    Truncate,
}

fn change() -> impl Strategy<Value = Change> {
    let awkward = prop::sample::select(AWKWARD.to_vec());
    prop_oneof![
        4 => any::<u8>().prop_map(Change::Overwrite),
        1 => prop::collection::vec(any::<u8>(), 1..9).prop_map(Change::Insert),
        4 => (0..9usize, awkward).prop_map(|(length, text)| Change::Replace(length, text)),
        1 => (1..40usize).prop_map(Change::Remove),
        1 => (1..40usize).prop_map(Change::Repeat),
        2 => Just(Change::Truncate),
    ]
}

impl Change {
    fn apply(self, at: &Index, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let at = at.index(bytes.len());
        let end = |length: usize| bytes.len().min(at + length);
        match self {
            Self::Overwrite(byte) => bytes[at] = byte,
            Self::Insert(new) => drop(bytes.splice(at..at, new)),
            Self::Replace(length, new) => {
                let end = end(length);
                drop(bytes.splice(at..end, new.iter().copied()));
            }
            Self::Remove(length) => {
                let end = end(length);
                drop(bytes.drain(at..end));
            }
            Self::Repeat(length) => {
                let repeated = bytes[at..end(length)].to_vec();
                drop(bytes.splice(at..at, repeated));
            }
            Self::Truncate => bytes.truncate(at),
        }
    }
}

/// `file` with one to three damages.
pub(crate) fn damaged(file: impl Into<Vec<u8>>) -> impl Strategy<Value = Vec<u8>> {
    let file = file.into();
    prop::collection::vec((any::<Index>(), change()), 1..4).prop_map(move |changes| {
        let mut bytes = file.clone();
        for (at, change) in changes {
            change.apply(&at, &mut bytes);
        }
        bytes
    })
}
