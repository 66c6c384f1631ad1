//! COLMAP's binary files, which are little-endian.
//!
//! Every file starts with the number of its records. It is not trusted: records
//! are read until one is cut off.

use super::camera_model::CameraModel;
use super::{ColmapCamera, ColmapImage, ColmapPoint, unknown_model};
use crate::SceneError;
use crate::layout::binary_reader::BinaryReader;
use std::path::Path;

/// x, y and the number of the 3D point.
const POINT_2D_BYTES: u64 = 24;
/// Numbers of an image and of a 2D point in it.
const TRACK_ELEMENT_BYTES: u64 = 8;

pub(super) fn cameras(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapCamera>, SceneError> {
    records(path, bytes, "camera", |reader| {
        let id = reader.u32("a camera")?;
        let what = format!("camera {id}");
        let model_id = i32::from_le_bytes(reader.take(&what)?);
        let (width, height) = (reader.u64(&what)?, reader.u64(&what)?);
        let Some(model) = CameraModel::by_id(model_id) else {
            return Err(unknown_model(path, id, format!("number {model_id}")));
        };
        let parameters = (0..model.parameters)
            .map(|_| reader.f64(&what))
            .collect::<Result<_, _>>()?;
        Ok(ColmapCamera {
            id,
            model,
            width,
            height,
            parameters,
        })
    })
}

pub(super) fn images(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapImage>, SceneError> {
    records(path, bytes, "image", |reader| {
        let id = reader.u32("an image")?;
        let what = format!("image {id}");
        let quaternion = reader.numbers(&what)?;
        let translation = reader.numbers(&what)?;
        let camera = reader.u32(&what)?;
        let name = reader.zero_ended_text(&what)?;
        let points = reader.u64(&what)?;
        let what = format!("the points of view `{name}`");
        let points = reader.records(points, POINT_2D_BYTES, &what)?;
        let (points, _) = points.as_chunks::<{ POINT_2D_BYTES as usize }>();
        Ok(ColmapImage {
            id,
            name,
            camera,
            quaternion,
            translation,
            points: points.iter().map(pixel_of).collect(),
        })
    })
}

/// x and y, which are before the number of the 3D point.
fn pixel_of(point: &[u8; POINT_2D_BYTES as usize]) -> [f64; 2] {
    let (numbers, _) = point.as_chunks();
    [0, 1].map(|axis| f64::from_le_bytes(numbers[axis]))
}

pub(super) fn points(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapPoint>, SceneError> {
    records(path, bytes, "point", |reader| {
        let what = "a point";
        let _id = reader.u64(what)?;
        let position = reader.numbers(what)?;
        let _colour: [u8; 3] = reader.take(what)?;
        let _error = reader.f64(what)?;
        let track = reader.u64(what)?;
        let track = reader.records(track, TRACK_ELEMENT_BYTES, "the track of a point")?;
        let (numbers, _) = track.as_chunks();
        let (track, _) = numbers.as_chunks();
        Ok(ColmapPoint {
            position,
            track: track
                .iter()
                .map(|element: &[[u8; 4]; 2]| element.map(u32::from_le_bytes))
                .collect(),
        })
    })
}

/// All records of a file, which are as many as its first number says.
fn records<'a, T>(
    path: &'a Path,
    bytes: &'a [u8],
    what: &str,
    mut read: impl FnMut(&mut BinaryReader<'a>) -> Result<T, SceneError>,
) -> Result<Vec<T>, SceneError> {
    let mut reader = BinaryReader::new(path, bytes);
    let count = reader.u64(&format!("the {what} count"))?;
    let mut records = Vec::new();
    for _ in 0..count {
        records.push(read(&mut reader)?);
    }
    match reader.remaining() {
        0 => Ok(records),
        bytes => Err(SceneError::malformed(
            path,
            format!("{bytes} bytes follow the last {what} of {count}"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use proptest::prelude::*;

    /// One record after the count, as the three readers want it.
    fn files() -> [Vec<u8>; 3] {
        let start = |id: &[u8]| [&1u64.to_le_bytes(), id].concat();
        let mut cameras = start(&7u32.to_le_bytes());
        cameras.extend(0i32.to_le_bytes());
        cameras.extend([4u64, 3].map(u64::to_le_bytes).concat());
        cameras.extend([5.0, 2.0, 1.5].map(f64::to_le_bytes).concat());

        let mut images = start(&1u32.to_le_bytes());
        images.extend(
            [1.0, 0.0, 0.0, 0.0, 7.0, 8.0, 9.0]
                .map(f64::to_le_bytes)
                .concat(),
        );
        images.extend(7u32.to_le_bytes());
        images.extend(b"left/a.png\0");
        images.extend(1u64.to_le_bytes());
        images.extend([0xff; 24]);

        let mut points = start(&1u64.to_le_bytes());
        points.extend([1.0, 2.0, 3.0].map(f64::to_le_bytes).concat());
        points.extend([255; 3]);
        points.extend(0.5f64.to_le_bytes());
        points.extend(2u64.to_le_bytes());
        points.extend([0; 16]);
        [cameras, images, points]
    }

    /// Reads the file as the kind of the same index; how many records it has.
    fn read(kind: usize, bytes: &[u8]) -> Result<usize, SceneError> {
        let path = Path::new("model.bin");
        match kind {
            0 => cameras(path, bytes).map(|records| records.len()),
            1 => images(path, bytes).map(|records| records.len()),
            _ => points(path, bytes).map(|records| records.len()),
        }
    }

    #[test]
    fn counts_are_not_trusted() {
        for (kind, file) in files().into_iter().enumerate() {
            assert_eq!(read(kind, &file).unwrap(), 1);
            for count in [0, 2, u64::MAX] {
                let mut file = file.clone();
                file[..8].copy_from_slice(&u64::to_le_bytes(count));
                assert!(matches!(
                    read(kind, &file),
                    Err(SceneError::Malformed { .. })
                ));
            }
        }
        // 24 times this number of points is 2⁶⁴ + 8: it must not wrap.
        let [_, mut images, _] = files();
        let at = images.len() - 32;
        images[at..at + 8].copy_from_slice(&(u64::MAX / 24 + 1).to_le_bytes());
        let message = read(1, &images).unwrap_err().to_string();
        assert!(message.contains("points of view `left/a.png`"), "{message}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn truncated_and_damaged_files_are_errors_not_panics(
            kind in 0..3usize, end: prop::sample::Index,
            damaged in files().map(damaged),
            noise in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            let file = &files()[kind];
            prop_assert!(read(kind, &file[..end.index(file.len())]).is_err());
            // Any outcome but a panic.
            for (kind, file) in damaged.iter().enumerate() {
                let _ = read(kind, file);
            }
            let _ = read(kind, &noise);
        }
    }
}
