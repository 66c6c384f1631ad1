//! COLMAP's binary files, which are little-endian.
//!
//! Every file starts with the number of its records. It is not trusted: records
//! are read until one is cut off.

use super::camera_model::CameraModel;
use super::{ColmapCamera, ColmapImage, malformed, unknown_model};
use crate::SceneError;
use std::path::Path;

/// x, y and the number of the 3D point.
const POINT_2D_BYTES: u64 = 24;
/// Numbers of an image and of a 2D point in it.
const TRACK_ELEMENT_BYTES: u64 = 8;

pub(super) fn cameras(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapCamera>, SceneError> {
    let mut reader = Reader { path, rest: bytes };
    reader.records("camera", |reader| {
        let id = u32::from_le_bytes(reader.take("a camera")?);
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
    let mut reader = Reader { path, rest: bytes };
    reader.records("image", |reader| {
        let id = u32::from_le_bytes(reader.take("an image")?);
        let what = format!("image {id}");
        let quaternion = reader.numbers(&what)?;
        let translation = reader.numbers(&what)?;
        let camera = u32::from_le_bytes(reader.take(&what)?);
        let name = reader.name(&what)?;
        let points = reader.u64(&what)?;
        reader.skip(
            points,
            POINT_2D_BYTES,
            &format!("the points of view `{name}`"),
        )?;
        Ok(ColmapImage {
            name,
            camera,
            quaternion,
            translation,
        })
    })
}

pub(super) fn points(path: &Path, bytes: &[u8]) -> Result<Vec<[f64; 3]>, SceneError> {
    let mut reader = Reader { path, rest: bytes };
    reader.records("point", |reader| {
        let what = "a point";
        let _id = reader.u64(what)?;
        let point = reader.numbers(what)?;
        let _colour: [u8; 3] = reader.take(what)?;
        let _error = reader.f64(what)?;
        let track = reader.u64(what)?;
        reader.skip(track, TRACK_ELEMENT_BYTES, "the track of a point")?;
        Ok(point)
    })
}

/// The bytes of a file that are still to be read.
struct Reader<'a> {
    path: &'a Path,
    rest: &'a [u8],
}

impl Reader<'_> {
    /// All records of a file, which are as many as its first number says.
    fn records<T>(
        &mut self,
        what: &str,
        mut read: impl FnMut(&mut Self) -> Result<T, SceneError>,
    ) -> Result<Vec<T>, SceneError> {
        let count = self.u64(&format!("the {what} count"))?;
        let mut records = Vec::new();
        for _ in 0..count {
            records.push(read(self)?);
        }
        match self.rest.len() {
            0 => Ok(records),
            bytes => Err(malformed(
                self.path,
                format!("{bytes} bytes follow the last {what} of {count}"),
            )),
        }
    }

    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], SceneError> {
        let Some((bytes, rest)) = self.rest.split_first_chunk() else {
            return Err(self.cut_off(what));
        };
        self.rest = rest;
        Ok(*bytes)
    }

    fn u64(&mut self, what: &str) -> Result<u64, SceneError> {
        self.take(what).map(u64::from_le_bytes)
    }

    fn f64(&mut self, what: &str) -> Result<f64, SceneError> {
        self.take(what).map(f64::from_le_bytes)
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64(what)?;
        }
        Ok(numbers)
    }

    /// Text up to a zero byte.
    fn name(&mut self, what: &str) -> Result<String, SceneError> {
        let Some(end) = self.rest.iter().position(|&byte| byte == 0) else {
            return Err(self.cut_off(what));
        };
        let name = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        match std::str::from_utf8(name) {
            Ok(name) => Ok(name.into()),
            Err(_) => Err(malformed(
                self.path,
                format!("the name of {what} is not UTF-8"),
            )),
        }
    }

    fn skip(&mut self, count: u64, bytes: u64, what: &str) -> Result<(), SceneError> {
        let rest = count
            .checked_mul(bytes)
            .and_then(|bytes| usize::try_from(bytes).ok())
            .and_then(|bytes| self.rest.get(bytes..));
        self.rest = rest.ok_or_else(|| self.cut_off(what))?;
        Ok(())
    }

    fn cut_off(&self, what: &str) -> SceneError {
        malformed(self.path, format!("it ends within {what}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        #[test]
        fn truncated_and_damaged_files_are_errors_not_panics(
            kind in 0..3usize, end: prop::sample::Index, at: prop::sample::Index, byte: u8,
            noise in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            let file = &files()[kind];
            prop_assert!(read(kind, &file[..end.index(file.len())]).is_err());
            let mut damaged = file.clone();
            damaged[at.index(file.len())] = byte;
            if let Ok(records) = read(kind, &damaged) {
                prop_assert_eq!(records, 1);
            }
            // Any outcome but a panic.
            let _ = read(kind, &noise);
        }
    }
}
