//! Reads the golden tensors. Lies beside the data; the tests of each crate
//! include it by path.

#![allow(dead_code, reason = "every test uses its own part of the reader")]

use safetensors::{Dtype, SafeTensors};
use std::path::Path;

/// One golden file in memory.
#[derive(Debug)]
pub struct Golden {
    bytes: Vec<u8>,
}

impl Golden {
    /// `case` is the file name without its ending.
    ///
    /// # Panics
    /// If there is no such file, as all of this reader does: a test cannot go on.
    pub fn open(case: &str) -> Self {
        let file = Path::new("tests/data/golden").join(format!("{case}.safetensors"));
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .ancestors()
            .map(|folder| folder.join(&file))
            .find(|path| path.is_file())
            .unwrap_or_else(|| panic!("{}: not in this repository", file.display()));
        let bytes =
            std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Self { bytes }
    }

    fn file(&self) -> SafeTensors<'_> {
        SafeTensors::deserialize(&self.bytes).expect("a safetensors file")
    }

    /// The names of all tensors, sorted.
    pub fn names(&self) -> Vec<String> {
        let file = self.file();
        let mut names: Vec<String> = file.names().into_iter().map(String::from).collect();
        names.sort();
        names
    }

    /// The shape of a tensor.
    pub fn shape(&self, name: &str) -> Vec<usize> {
        let file = self.file();
        let tensor = file
            .tensor(name)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        tensor.shape().to_vec()
    }

    /// The elements of a tensor of any type, row-major, widened to `f64`.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let file = self.file();
        let tensor = file
            .tensor(name)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let data = tensor.data();
        match tensor.dtype() {
            Dtype::U8 => data.iter().map(|&byte| f64::from(byte)).collect(),
            Dtype::I32 => elements(data, |b| f64::from(i32::from_le_bytes(b))),
            Dtype::I64 => elements(data, |b| i64::from_le_bytes(b) as f64),
            Dtype::F32 => elements(data, |b| f64::from(f32::from_le_bytes(b))),
            Dtype::F64 => elements(data, f64::from_le_bytes),
            other => panic!("{name}: unexpected type {other:?}"),
        }
    }

    /// The only element of a tensor.
    pub fn number(&self, name: &str) -> f64 {
        match self.numbers(name)[..] {
            [number] => number,
            ref numbers => panic!("{name}: {} numbers instead of one", numbers.len()),
        }
    }

    /// The elements of a tensor in the precision of the published code.
    pub fn floats(&self, name: &str) -> Vec<f32> {
        self.numbers(name).iter().map(|&x| x as f32).collect()
    }

    /// The elements of a tensor as indices.
    pub fn indices(&self, name: &str) -> Vec<usize> {
        self.numbers(name).iter().map(|&x| x as usize).collect()
    }

    /// A tensor as rows of `D` numbers.
    pub fn rows<const D: usize>(&self, name: &str) -> Vec<[f64; D]> {
        in_rows(&self.numbers(name), name)
    }

    /// [`Self::rows`] in the precision of the published code.
    pub fn float_rows<const D: usize>(&self, name: &str) -> Vec<[f32; D]> {
        in_rows(&self.floats(name), name)
    }

    /// [`Self::rows`] as indices.
    pub fn index_rows<const D: usize>(&self, name: &str) -> Vec<[usize; D]> {
        in_rows(&self.indices(name), name)
    }
}

fn in_rows<T: Copy, const D: usize>(elements: &[T], name: &str) -> Vec<[T; D]> {
    let (rows, rest) = elements.as_chunks::<D>();
    assert!(
        rest.is_empty(),
        "{name}: {} elements in rows of {D}",
        elements.len()
    );
    rows.to_vec()
}

fn elements<const N: usize>(data: &[u8], read: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    data.as_chunks::<N>()
        .0
        .iter()
        .map(|&bytes| read(bytes))
        .collect()
}
