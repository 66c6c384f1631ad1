//! Reads the golden tensors. Lies beside the data; the tests of each crate
//! include it by path.

use safetensors::{Dtype, SafeTensors};

/// One golden file in memory.
pub struct Golden {
    bytes: Vec<u8>,
}

impl Golden {
    /// `case` is the file name without its ending.
    pub fn open(case: &str) -> Self {
        let root = env!("CARGO_MANIFEST_DIR");
        let path = format!("{root}/../../tests/data/golden/{case}.safetensors");
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        Self { bytes }
    }

    /// The elements of a tensor of any type, row-major, widened to `f64`.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let file = SafeTensors::deserialize(&self.bytes).expect("a safetensors file");
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

    /// A tensor as rows of `D` numbers.
    pub fn rows<const D: usize>(&self, name: &str) -> Vec<[f64; D]> {
        let numbers = self.numbers(name);
        let (rows, rest) = numbers.as_chunks::<D>();
        assert!(
            rest.is_empty(),
            "{name}: {} numbers in rows of {D}",
            numbers.len()
        );
        rows.to_vec()
    }
}

fn elements<const N: usize>(data: &[u8], read: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    data.as_chunks::<N>()
        .0
        .iter()
        .map(|&bytes| read(bytes))
        .collect()
}
