//! The detector that a configuration asks for, with its weights where it has any.

use image::RgbImage;
use neat_core::{SceneError, Wireframe2d};
use neat_detect::{DetectorConfig, detect};
#[cfg(feature = "onnx")]
use {
    neat_core::file_cache::dir_of_user,
    neat_detect::{LineDetector, detect_with_hints, mlsd::Mlsd},
    sha2::{Digest, Sha256},
    std::{env, path::PathBuf},
};

/// From an image to its 2D wireframe as a configuration says.
pub(super) struct ConfiguredDetector<'a> {
    pub(super) config: &'a DetectorConfig,
    #[cfg(feature = "onnx")]
    mlsd: Option<Weights>,
}

/// M-LSD, and what tells its weights from others.
#[cfg(feature = "onnx")]
struct Weights {
    mlsd: Mlsd,
    sha256: [u8; 32],
}

impl<'a> ConfiguredDetector<'a> {
    /// The detector of a configuration that is valid.
    ///
    /// # Errors
    /// If it has weights and they cannot be read.
    pub(super) fn open(config: &'a DetectorConfig) -> Result<Self, SceneError> {
        Ok(Self {
            config,
            #[cfg(feature = "onnx")]
            mlsd: match config.detector {
                LineDetector::Own => None,
                LineDetector::Mlsd => Some(Weights::read()?),
            },
        })
    }

    /// The 2D wireframe of an image, with pixel centres at integers.
    ///
    /// # Errors
    /// If a model cannot be run.
    pub(super) fn wireframe(&self, image: &RgbImage) -> Result<Wireframe2d, SceneError> {
        #[cfg(feature = "onnx")]
        if let Some(Weights { mlsd, .. }) = &self.mlsd {
            let hints = mlsd.lines(image)?;
            return Ok(detect_with_hints(image, &hints, self.config));
        }
        Ok(detect(image, self.config))
    }

    /// What a model takes for an image, in bytes: for M-LSD a process was measured.
    pub(super) fn model_bytes(&self) -> u64 {
        #[cfg(feature = "onnx")]
        if self.mlsd.is_some() {
            return 200 << 20;
        }
        0
    }

    /// What the result depends on beside image and configuration.
    pub(super) fn identity(&self) -> &[u8] {
        #[cfg(feature = "onnx")]
        if let Some(Weights { sha256, .. }) = &self.mlsd {
            return sha256;
        }
        &[]
    }
}

#[cfg(feature = "onnx")]
impl Weights {
    fn read() -> Result<Self, SceneError> {
        let path = path();
        let bytes = neat_core::file::read(
            &path,
            "scripts/fetch_mlsd.sh fetches the weights of M-LSD; NEAT_MLSD=FILE names others",
        )?;
        Ok(Self {
            sha256: Sha256::digest(&bytes).into(),
            mlsd: Mlsd::from_bytes(bytes, &path)?,
        })
    }
}

/// Where the weights are: `$NEAT_MLSD`, else where `scripts/fetch_mlsd.sh` puts them.
#[cfg(feature = "onnx")]
fn path() -> PathBuf {
    let given = env::var_os("NEAT_MLSD").filter(|path| !path.is_empty());
    given.map_or_else(
        || dir_of_user().unwrap_or_default().join(Mlsd::FILE_NAME),
        PathBuf::from,
    )
}
