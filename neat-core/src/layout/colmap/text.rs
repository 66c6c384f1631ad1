//! COLMAP's text files: one record per line, two lines per image; lines that
//! start with `#` are comments.

use super::camera_model::CameraModel;
use super::{ColmapCamera, ColmapImage, ColmapPoint, unknown_model};
use crate::SceneError;
use crate::layout::text_lines::{Line, lines, next_field, records};
use std::path::Path;

pub(super) fn cameras(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapCamera>, SceneError> {
    let mut cameras = Vec::new();
    for mut line in records(path, bytes)? {
        let id: u32 = line.parse("CAMERA_ID")?;
        line.owner = Some(format!("camera {id}"));
        let name = line.field("MODEL")?;
        let Some(model) = CameraModel::by_name(name) else {
            return Err(unknown_model(path, id, name.into()));
        };
        let (width, height) = (line.parse("WIDTH")?, line.parse("HEIGHT")?);
        let mut parameters = Vec::with_capacity(model.parameters);
        for _ in 0..model.parameters {
            parameters.push(line.parse("PARAMS")?);
        }
        if !line.is_at_end() {
            let reason = format!("{name} has only {} parameters", model.parameters);
            return Err(line.error(&reason));
        }
        cameras.push(ColmapCamera {
            id,
            model,
            width,
            height,
            parameters,
        });
    }
    Ok(cameras)
}

pub(super) fn images(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapImage>, SceneError> {
    let mut lines = lines(path, bytes)?;
    let mut images = Vec::new();
    while let Some(line) = lines.next() {
        if line.is_record() {
            let mut image = image(line)?;
            // The next line holds the points even where it is empty. Only the
            // last one may be missing: editors strip empty lines.
            if let Some(points) = lines.next() {
                image.points = image_points(points, &image.name)?;
            }
            images.push(image);
        }
    }
    Ok(images)
}

fn image(mut line: Line) -> Result<ColmapImage, SceneError> {
    // The name first, for messages about the other fields.
    let mut name = line.rest;
    for _ in 0..9 {
        next_field(&mut name);
    }
    let name = name.trim();
    if name.is_empty() {
        return Err(line.error("expected IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID and NAME"));
    }
    line.owner = Some(format!("view `{name}`"));
    let id = line.parse("IMAGE_ID")?;
    let quaternion = line.named(["QW", "QX", "QY", "QZ"])?;
    let translation = line.named(["TX", "TY", "TZ"])?;
    Ok(ColmapImage {
        id,
        name: name.into(),
        camera: line.parse("CAMERA_ID")?,
        quaternion,
        translation,
        points: Vec::new(),
    })
}

/// The pixels of a line of x, y, number of the 3D point. A line that is none is an
/// error: a file without these lines would otherwise lose every other image in
/// silence.
fn image_points(mut line: Line, view: &str) -> Result<Vec<[f64; 2]>, SceneError> {
    let mut fields = line.rest.split_whitespace();
    let mut points = Vec::new();
    while let Some(x) = fields.next() {
        let point = (
            x.parse(),
            fields.next().map(str::parse),
            fields.next().map(str::parse::<i64>),
        );
        let (Ok(x), Some(Ok(y)), Some(Ok(_point))) = point else {
            line.owner = Some(format!("view `{view}`"));
            let reason = "expected the image's points as X, Y, POINT3D_ID, or an empty line";
            return Err(line.error(reason));
        };
        points.push([x, y]);
    }
    Ok(points)
}

pub(super) fn points(path: &Path, bytes: &[u8]) -> Result<Vec<ColmapPoint>, SceneError> {
    let mut points = Vec::new();
    for mut line in records(path, bytes)? {
        let _id: u64 = line.parse("POINT3D_ID")?;
        let position = line.named(["X", "Y", "Z"])?;
        for what in ["R", "G", "B"] {
            let _colour: u8 = line.parse(what)?;
        }
        let _error: f64 = line.parse("ERROR")?;
        let mut track = Vec::new();
        while !line.is_at_end() {
            track.push([line.parse("IMAGE_ID")?, line.parse("POINT2D_IDX")?]);
        }
        points.push(ColmapPoint { position, track });
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FILES: [&str; 3] = [
        "# Camera list\n7 SIMPLE_PINHOLE 4 3 5 2 1.5\n",
        "# Image list\n1 1 0 0 0 7 8 9 7 left/a b.png\n\n2 1 0 0 0 7 8 -9e0 7 c.png\n1.5 2.5 -1\n",
        "1 1.0 2.0 3.0 255 0 128 0.5 1 0 2 1\n",
    ];

    /// Reads the file as the kind of the same index; how many records it has.
    fn read(kind: usize, bytes: &[u8]) -> Result<usize, SceneError> {
        let path = Path::new("model.txt");
        match kind {
            0 => cameras(path, bytes).map(|records| records.len()),
            1 => images(path, bytes).map(|records| records.len()),
            _ => points(path, bytes).map(|records| records.len()),
        }
    }

    #[test]
    fn names_may_hold_spaces_and_points_may_be_missing() {
        for (file, count) in FILES.iter().zip([1, 2, 1]) {
            let kind = FILES.iter().position(|other| other == file).unwrap();
            assert_eq!(read(kind, file.as_bytes()).unwrap(), count);
            let dos = file.replace('\n', "\r\n");
            assert_eq!(read(kind, dos.as_bytes()).unwrap(), count);
        }
        let images = images(Path::new("images.txt"), FILES[1].as_bytes()).unwrap();
        assert_eq!(images[0].name, "left/a b.png");
        assert_eq!(images[1].translation, [7.0, 8.0, -9.0]);
        assert_eq!(read(1, b"1 1 0 0 0 7 8 9 7 a.png").unwrap(), 1);
    }

    #[test]
    fn messages_name_line_and_field() {
        for (kind, text, expected) in [
            (
                0,
                "\n7 PINHOLE 4 3 5 2 1.5",
                "line 2, camera 7: it ends before PARAMS",
            ),
            (
                0,
                "7 SIMPLE_PINHOLE 4 3 5 2 1.5 0",
                "SIMPLE_PINHOLE has only 3 parameters",
            ),
            (0, "7 SIMPLE_PINHOLE -4 3 5 2 1.5", "`-4` cannot be WIDTH"),
            (0, "7 SPHERE 4 3 5", "camera 7 has the model SPHERE"),
            (1, "1 1 0 0 0 7 8 9 7", "line 1: expected IMAGE_ID"),
            (
                1,
                "1 1 0 0 x 7 8 9 7 a.png",
                "line 1, view `a.png`: `x` cannot be QZ",
            ),
            (
                1,
                "1 1 0 0 0 7 8 9 7 a.png\n2 1 0 0 0 7 8 9 7 b.png",
                "line 2, view `a.png`: expected the image's points",
            ),
            (2, "1 1.0 2.0", "line 1: it ends before Z"),
        ] {
            let message = read(kind, text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("model.txt"), "{message}");
            assert!(message.contains(expected), "{message}");
        }
        assert!(read(0, b"\xff").unwrap_err().to_string().contains("UTF-8"));
    }

    proptest! {
        #[test]
        fn truncated_and_damaged_files_never_panic(
            kind in 0..3usize, end: prop::sample::Index, at: prop::sample::Index, byte: u8,
            noise in prop::collection::vec(any::<u8>(), 0..200), text in "[0-9a-z #.\n-]{0,200}",
        ) {
            let file = FILES[kind].as_bytes();
            // A cut between records cannot be seen.
            if let Ok(records) = read(kind, &file[..end.index(file.len())]) {
                prop_assert!(records <= 2);
            }
            let mut damaged = file.to_vec();
            damaged[at.index(file.len())] = byte;
            if let Ok(records) = read(kind, &damaged) {
                prop_assert!(records <= 2);
            }
            // Any outcome but a panic.
            let _ = read(kind, &noise);
            let _ = read(kind, text.as_bytes());
        }
    }
}
