//! Reads the tensors of the published code (`tests/data/golden` of the repository).

use nalgebra::Vector3;
use neat_core::LineSegment3;
use safetensors::{Dtype, SafeTensors};
use std::path::{Path, PathBuf};

/// The root of the repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// One file of golden tensors.
pub struct Golden {
    bytes: Vec<u8>,
}

impl Golden {
    pub fn read(name: &str) -> Self {
        let path = repository().join("tests/data/golden").join(name);
        Self {
            bytes: std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())),
        }
    }

    /// All numbers of a tensor, row-major.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let tensors = SafeTensors::deserialize(&self.bytes).unwrap();
        let tensor = tensors
            .tensor(name)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let data = tensor.data();
        fn words<const N: usize>(data: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
            data.chunks_exact(N).map(|word| word.try_into().unwrap())
        }
        match tensor.dtype() {
            Dtype::F64 => words(data).map(f64::from_le_bytes).collect(),
            Dtype::F32 => words(data)
                .map(|w| f64::from(f32::from_le_bytes(w)))
                .collect(),
            Dtype::I64 => words(data).map(|w| i64::from_le_bytes(w) as f64).collect(),
            Dtype::I32 => words(data)
                .map(|w| f64::from(i32::from_le_bytes(w)))
                .collect(),
            Dtype::U8 => data.iter().map(|byte| f64::from(*byte)).collect(),
            other => panic!("{name} has type {other:?}"),
        }
    }

    pub fn indices(&self, name: &str) -> Vec<usize> {
        self.numbers(name).iter().map(|x| *x as usize).collect()
    }

    pub fn index_pairs(&self, name: &str) -> Vec<[usize; 2]> {
        let flat = self.indices(name);
        flat.chunks_exact(2)
            .map(|pair| [pair[0], pair[1]])
            .collect()
    }

    pub fn points(&self, name: &str) -> Vec<Vector3<f64>> {
        let flat = self.numbers(name);
        flat.chunks_exact(3)
            .map(Vector3::from_column_slice)
            .collect()
    }

    pub fn segments(&self, name: &str) -> Vec<LineSegment3> {
        let points = self.points(name);
        points
            .chunks_exact(2)
            .map(|ends| LineSegment3::new(ends[0], ends[1]))
            .collect()
    }
}
