//! Named tensors on disk: safetensors with a checksum, complete or not there.

use burn::tensor::TensorData;
use neat_core::{SceneError, file};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Named tensors and named strings, as one file holds them.
#[derive(Clone, Debug, Default)]
pub struct Checkpoint {
    /// float32 tensors by name.
    pub tensors: BTreeMap<String, TensorData>,
    /// Everything that is not a tensor, as text.
    pub metadata: BTreeMap<String, String>,
}

/// Name of the header entry that holds a [`Header`] as JSON.
const METADATA_KEY: &str = "neat";

/// Why a checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The operating system said no.
    #[error(transparent)]
    File(#[from] SceneError),
    /// The file is not a checkpoint, or is damaged.
    #[error("{path} is not a readable checkpoint ({reason})")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// The header's entry: what is no tensor, and what shows that nothing has changed
/// since the file was written.
#[derive(Serialize, Deserialize)]
struct Header {
    metadata: BTreeMap<String, String>,
    /// SHA-256 of metadata and tensors, see [`checksum`].
    sha256: String,
}

impl Checkpoint {
    /// Writes the file completely or not at all: an earlier file of that name
    /// stays as it is until the new one is on disk.
    ///
    /// # Errors
    /// If the disk is full or the folder cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), CheckpointError> {
        let tensors: Vec<(&str, Vec<usize>, Vec<u8>)> = self
            .tensors
            .iter()
            .map(|(name, data)| {
                let data = data.clone().convert::<f32>();
                let shape = data.shape().to_vec();
                let values: Vec<f32> = data.try_to_vec_as().expect("just converted to f32");
                let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
                (name.as_str(), shape, bytes)
            })
            .collect();
        let views = tensors.iter().map(|(name, shape, bytes)| {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytes)
                .expect("Checkpoint::write: bytes agree with shape");
            (*name, view)
        });
        let content = tensors.iter().map(|(name, shape, bytes)| {
            let bytes: &[u8] = bytes;
            (*name, shape.as_slice(), bytes)
        });
        let header = Header {
            metadata: self.metadata.clone(),
            sha256: checksum(&self.metadata, content),
        };
        // One entry: the format takes a hash map, whose order would differ from run
        // to run, and equal states must give equal bytes.
        let text =
            serde_json::to_string(&header).expect("Checkpoint::write: maps of strings are JSON");
        let entry = HashMap::from([(METADATA_KEY.to_owned(), text)]);
        let file = safetensors::serialize(views, Some(entry))
            .expect("Checkpoint::write: names differ and bytes agree with shapes");
        Ok(file::write_atomically(path, &file)?)
    }

    /// Reads a file that [`Self::write`] wrote.
    ///
    /// # Errors
    /// If the file is missing, truncated, not a float32 safetensors file, or not as
    /// it was written.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let content = read_file(path)?;
        let damaged = |reason: String| damaged(path, reason);
        let header = header_of(path, &content)?;
        let parsed = SafeTensors::deserialize(&content).map_err(|e| damaged(e.to_string()))?;
        let views: BTreeMap<String, TensorView> = parsed.tensors().into_iter().collect();
        let content = (views.iter()).map(|(name, view)| (name.as_str(), view.shape(), view.data()));
        if checksum(&header.metadata, content) != header.sha256 {
            return Err(damaged("its checksum is wrong".to_owned()));
        }
        let mut tensors = BTreeMap::new();
        for (name, view) in views {
            if view.dtype() != Dtype::F32 {
                return Err(damaged(format!("tensor `{name}` is not float32")));
            }
            let values: Vec<f32> = view
                .data()
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            tensors.insert(name, TensorData::new(values, view.shape().to_vec()));
        }
        Ok(Self {
            tensors,
            metadata: header.metadata,
        })
    }

    /// Reads only [`Self::metadata`]: the tensors' values are not looked at.
    ///
    /// # Errors
    /// If the file is missing, truncated, or not a checkpoint.
    pub fn read_metadata(path: &Path) -> Result<BTreeMap<String, String>, CheckpointError> {
        Ok(header_of(path, &read_file(path)?)?.metadata)
    }
}

fn read_file(path: &Path) -> Result<Vec<u8>, CheckpointError> {
    match file::read(path, "resume from an earlier one") {
        Err(SceneError::Empty { .. }) => Err(damaged(path, "it is empty".to_owned())),
        content => Ok(content?),
    }
}

fn header_of(path: &Path, content: &[u8]) -> Result<Header, CheckpointError> {
    // Compares the length of the file to that of its tensors, too.
    let (_, header) =
        SafeTensors::read_metadata(content).map_err(|e| damaged(path, e.to_string()))?;
    let text = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
    text.and_then(|text| serde_json::from_str(text).ok())
        .ok_or_else(|| damaged(path, format!("its header has no `{METADATA_KEY}`")))
}

/// SHA-256 of metadata and tensors (name, shape, bytes) in the order of their names,
/// each part after its length, in hexadecimal.
fn checksum<'a>(
    metadata: &BTreeMap<String, String>,
    tensors: impl Iterator<Item = (&'a str, &'a [usize], &'a [u8])>,
) -> String {
    let mut hasher = Sha256::new();
    let mut part = |bytes: &[u8]| {
        hasher.update((bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    for (key, value) in metadata {
        part(key.as_bytes());
        part(value.as_bytes());
    }
    for (name, shape, bytes) in tensors {
        part(name.as_bytes());
        for size in shape {
            part(&(*size as u64).to_le_bytes());
        }
        part(bytes);
    }
    let digest = hasher.finalize();
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn damaged(path: &Path, reason: String) -> CheckpointError {
    CheckpointError::Damaged {
        path: path.to_owned(),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

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

        assert_eq!(
            Checkpoint::read_metadata(&path).unwrap(),
            checkpoint.metadata
        );

        let content = fs::read(&path).unwrap();
        // A digit of the metadata, and the last byte of the tensor.
        let digit = content.windows(2).position(|w| w == b"12").unwrap();
        for index in [digit, content.len() - 1] {
            let mut flipped = content.clone();
            flipped[index] ^= 1;
            fs::write(&path, flipped).unwrap();
            assert!(matches!(
                Checkpoint::read(&path),
                Err(CheckpointError::Damaged { .. })
            ));
        }
        for length in [0, 7, content.len() / 2, content.len() - 1] {
            fs::write(&path, &content[..length]).unwrap();
            assert!(matches!(
                Checkpoint::read(&path),
                Err(CheckpointError::Damaged { .. })
            ));
            assert!(matches!(
                Checkpoint::read_metadata(&path),
                Err(CheckpointError::Damaged { .. })
            ));
        }
        fs::remove_dir_all(&dir).unwrap();
    }
}
