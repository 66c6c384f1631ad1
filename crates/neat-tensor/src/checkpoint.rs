//! Named tensors on disk: safetensors, written to a temporary name and renamed.

use burn::tensor::{DType, TensorData};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Named tensors and named strings, as one file holds them.
#[derive(Clone, Debug, Default)]
pub struct Checkpoint {
    /// float32 tensors by name.
    pub tensors: BTreeMap<String, TensorData>,
    /// Everything that is not a tensor, as text.
    pub metadata: BTreeMap<String, String>,
}

/// Name of the header entry that holds [`Checkpoint::metadata`] as JSON.
const METADATA_KEY: &str = "neat";

/// Why a checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The operating system said no.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not a checkpoint, or is damaged.
    #[error("{path} is not a readable checkpoint ({reason}); delete it and use an earlier one")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

impl Checkpoint {
    /// Writes the file completely or not at all: an earlier file of that name
    /// stays as it is until the new one is on disk.
    ///
    /// # Errors
    /// If the disk is full or the folder cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), CheckpointError> {
        let io = |source| CheckpointError::Io {
            path: path.to_owned(),
            source,
        };
        let bytes: Vec<(&String, Vec<usize>, Vec<u8>)> = self
            .tensors
            .iter()
            .map(|(name, data)| {
                let data = data.clone().convert::<f32>();
                let shape = data.shape().to_vec();
                let values: Vec<f32> = data.try_to_vec_as().expect("just converted to f32");
                (
                    name,
                    shape,
                    values.iter().flat_map(|v| v.to_le_bytes()).collect(),
                )
            })
            .collect();
        let views = bytes.iter().map(|(name, shape, bytes)| {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytes)
                .expect("Checkpoint::write: bytes agree with shape");
            (name.as_str(), view)
        });
        // One entry: the format takes a hash map, whose order would differ from run
        // to run, and equal states must give equal bytes.
        let text = serde_json::to_string(&self.metadata)
            .expect("Checkpoint::write: a map of strings is JSON");
        let metadata = HashMap::from([(METADATA_KEY.to_owned(), text)]);
        let content = safetensors::serialize(views, Some(metadata))
            .map_err(|e| io(std::io::Error::other(e.to_string())))?;

        let temporary = path.with_extension("partial");
        let written = File::create(&temporary).and_then(|mut file| {
            file.write_all(&content)?;
            file.sync_all()
        });
        if let Err(source) = written.and_then(|()| fs::rename(&temporary, path)) {
            // The half-written file only wastes space now.
            let _ = fs::remove_file(&temporary);
            return Err(io(source));
        }
        Ok(())
    }

    /// Reads a file that [`Self::write`] wrote.
    ///
    /// # Errors
    /// If the file is missing, truncated, or not a float32 safetensors file.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let content = fs::read(path).map_err(|source| CheckpointError::Io {
            path: path.to_owned(),
            source,
        })?;
        let damaged = |reason: String| CheckpointError::Damaged {
            path: path.to_owned(),
            reason,
        };
        let (_, header) =
            SafeTensors::read_metadata(&content).map_err(|e| damaged(e.to_string()))?;
        let parsed = SafeTensors::deserialize(&content).map_err(|e| damaged(e.to_string()))?;
        let mut tensors = BTreeMap::new();
        for (name, view) in parsed.tensors() {
            if view.dtype() != Dtype::F32 {
                return Err(damaged(format!("tensor `{name}` is not float32")));
            }
            let values: Vec<f32> = view
                .data()
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            debug_assert_eq!(DType::F32.size(), 4);
            tensors.insert(name, TensorData::new(values, view.shape().to_vec()));
        }
        let text = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
        let metadata = text
            .and_then(|text| serde_json::from_str(text).ok())
            .ok_or_else(|| damaged(format!("its header has no `{METADATA_KEY}`")))?;
        Ok(Self { tensors, metadata })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_reads_back_as_written_and_damage_is_noticed() {
        let dir = std::env::temp_dir().join(format!("neat-checkpoint-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let path = dir.join("a.safetensors");
        let mut checkpoint = Checkpoint::default();
        checkpoint.tensors.insert(
            "layer.weight".into(),
            TensorData::new(vec![1.0f32, -2.5, 3.0, 1e-30, 0.0, 7.0], [2, 3]),
        );
        checkpoint.metadata.insert("iteration".into(), "12".into());
        checkpoint.write(&path).unwrap();
        let read = Checkpoint::read(&path).unwrap();
        assert_eq!(read.metadata, checkpoint.metadata);
        assert_eq!(
            read.tensors["layer.weight"].try_to_vec_as::<f32>().unwrap(),
            vec![1.0, -2.5, 3.0, 1e-30, 0.0, 7.0]
        );

        let content = fs::read(&path).unwrap();
        for length in [0, 7, content.len() / 2, content.len() - 1] {
            fs::write(&path, &content[..length]).unwrap();
            assert!(matches!(
                Checkpoint::read(&path),
                Err(CheckpointError::Damaged { .. })
            ));
        }
        fs::remove_dir_all(&dir).unwrap();
    }
}
