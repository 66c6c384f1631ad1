//! Segments that other detectors wrote: LSD, DeepLSD, ScaleLSD, LIMAP.
//!
//! - `.npy`: an array of shape (N, 4) or (N, 2, 2) with x1, y1, x2, y2 in pixels;
//!   columns after the fourth are ignored.
//! - `.npz`: such an array under one of [`ARRAY_NAMES`].
//! - `.txt`, `.csv`: one segment per line, see [`text`].
//!
//! Scores are not read: [`crate::wireframe_from_segments`] measures its own, so
//! that those of different detectors can be compared.

pub mod text;

use nalgebra::Vector2;
use neat_core::npz::{NpyArray, NpzReader, parse_npy};
use neat_core::{LineSegment2, SceneError, file};
use std::path::Path;

/// Names under which archives hold segments; the first that is there is read.
pub const ARRAY_NAMES: [&str; 6] = [
    "lines",
    "segs",
    "segments",
    "line_segments",
    "lines_pred",
    "arr_0",
];

const REMEDY: &str = "write the segments of each image to a file of its own, as .npz, .npy or .txt";

/// Reads the segments of one image; the ending of the file tells its format.
///
/// # Errors
/// If the file is missing, empty or not of its format, its array has another
/// shape, or a number is not finite.
pub fn read(path: &Path) -> Result<Vec<LineSegment2>, SceneError> {
    parse(file::read(path, REMEDY)?, path)
}

/// [`read`] from bytes; `path` tells the format and is for messages.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: Vec<u8>, path: &Path) -> Result<Vec<LineSegment2>, SceneError> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    match ending.as_str() {
        "npy" => segments_of("array", &parse_npy(&bytes, path)?, path),
        "npz" => {
            let mut archive = NpzReader::from_bytes(bytes, path)?;
            let name = (ARRAY_NAMES.into_iter())
                .find(|name| archive.contains(name))
                .ok_or_else(|| SceneError::Malformed {
                    path: path.into(),
                    reason: format!("it holds no array named {}", ARRAY_NAMES.join(", ")),
                })?;
            segments_of(name, &archive.array(name)?, path)
        }
        "txt" | "csv" => text::parse(&bytes, path),
        _ => Err(SceneError::Malformed {
            path: path.into(),
            reason: "segments are read from .npz, .npy, .txt and .csv".into(),
        }),
    }
}

fn segments_of(name: &str, array: &NpyArray, path: &Path) -> Result<Vec<LineSegment2>, SceneError> {
    let columns = match array.shape[..] {
        [_, columns] if columns >= 4 => columns,
        [_, 2, 2] => 4,
        // NumPy's array of no segments has whatever shape.
        _ if array.values.is_empty() => return Ok(Vec::new()),
        _ => {
            return Err(SceneError::WrongShape {
                path: path.into(),
                array: name.into(),
                found: array.shape.clone(),
                expected: "(N, 4) or (N, 2, 2)",
            });
        }
    };
    Ok(array
        .values
        .chunks_exact(columns)
        .map(|row| from_row([row[0], row[1], row[2], row[3]]))
        .collect())
}

/// From x1, y1, x2, y2.
fn from_row([x1, y1, x2, y2]: [f64; 4]) -> LineSegment2 {
    LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2))
}
