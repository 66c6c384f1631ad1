//! Why a wireframe or a mesh could not be exported.

use neat_core::SceneError;
use std::path::PathBuf;

/// Why a wireframe or a mesh could not be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A file name whose ending belongs to no format.
    #[error("the ending of {path} names no format: use one of {known}, or name the format")]
    UnknownEnding {
        /// The file.
        path: PathBuf,
        /// All endings.
        known: String,
    },
    /// A name that no format has.
    #[error("there is no format `{name}`: use one of {known}")]
    UnknownFormat {
        /// What was asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// An option outside its range.
    #[error("{option} cannot be {value}: give {expected}")]
    BadOption {
        /// The option.
        option: &'static str,
        /// What was asked for.
        value: String,
        /// What it can be.
        expected: &'static str,
    },
    /// A filter on a field that the wireframe does not have.
    #[error(
        "the wireframe has no edge field `{field}`: leave out {option}, or reconstruct it with a version of neat that writes the field"
    )]
    NoField {
        /// The field.
        field: &'static str,
        /// The option that needs it.
        option: &'static str,
    },
    /// An extent that the numbers of a format cannot hold.
    #[error(
        "{path}: the extent of the wireframe is beyond the numbers of {format}: use a format of text, such as obj"
    )]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
    },
    /// The distance of a mesh's surface is no number somewhere.
    #[error("the signed distance at {point:?} is {value}: the field is not usable there")]
    BadDistance {
        /// Where.
        point: [f64; 3],
        /// What it is instead of a number.
        value: f64,
    },
    /// The document is not valid, or one of the formats of `neat-wireframe` could
    /// not be written.
    #[error(transparent)]
    Wireframe(#[from] neat_wireframe::export::ExportError),
    /// The file could not be written.
    #[error(transparent)]
    File(#[from] SceneError),
}

impl ExportError {
    /// Whether the cause lies in what was asked for or in the input, and trying
    /// again without a change is pointless; otherwise the export itself failed.
    pub fn is_bad_input(&self) -> bool {
        use neat_wireframe::export::ExportError as WireframeError;
        match self {
            Self::UnknownEnding { .. }
            | Self::UnknownFormat { .. }
            | Self::BadOption { .. }
            | Self::NoField { .. }
            | Self::OutOfRange { .. } => true,
            Self::BadDistance { .. } => false,
            Self::Wireframe(WireframeError::File(error)) | Self::File(error) => {
                !matches!(error, SceneError::Write { .. })
            }
            Self::Wireframe(_) => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_wireframe::export::ExportError as WireframeError;
    use std::io;

    fn full_disk() -> SceneError {
        SceneError::Write {
            path: "house.dxf".into(),
            source: io::ErrorKind::StorageFull.into(),
        }
    }

    #[test]
    fn a_full_disk_and_a_bad_field_are_failures_and_no_bad_input() {
        let bad_distance = ExportError::BadDistance {
            point: [0.0; 3],
            value: f64::NAN,
        };
        for error in [
            bad_distance,
            full_disk().into(),
            WireframeError::File(full_disk()).into(),
        ] {
            assert!(!error.is_bad_input(), "{error}");
        }
    }

    #[test]
    fn what_a_person_can_change_is_bad_input() {
        let missing = || SceneError::Missing {
            path: "wireframe.json".into(),
            remedy: "give the folder of a run".into(),
        };
        let no_json = serde_json::from_str::<u8>("{").unwrap_err();
        for error in [
            ExportError::UnknownFormat {
                name: "dwg".into(),
                known: "dxf".into(),
            },
            ExportError::NoField {
                field: "probability",
                option: "--min-probability",
            },
            missing().into(),
            WireframeError::File(missing()).into(),
            WireframeError::Json {
                path: "wireframe.json".into(),
                source: no_json,
            }
            .into(),
        ] {
            assert!(error.is_bad_input(), "{error}");
        }
    }
}
