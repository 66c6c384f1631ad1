//! Line tracks in LIMAP's text formats (Liu et al., *3D Line Mapping Revisited*,
//! CVPR 2023, `limap.util.io`): 3D segments with the 2D segments that show them.
//!
//! LIMAP writes `alltracks.txt` (all tracks in one file, without the 2D segments),
//! a folder of `track_0.txt`, `track_1.txt`, … (one each, with them) and
//! `image_list.txt` (the names of the images). All three are written and read
//! here; numbers are written so that they read back as they were.

use super::ExportError;
use nalgebra::{Vector2, Vector3};
use neat_core::{LineSegment2, LineSegment3, SceneError, file};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;
use std::str::{FromStr, SplitWhitespace};

/// A 3D segment and the 2D segments that show it.
#[derive(Clone, Debug, PartialEq)]
pub struct LineTrack {
    /// The segment in space.
    pub segment: LineSegment3,
    /// What shows it.
    pub supports: Vec<TrackSegment>,
}

/// A 2D segment of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackSegment {
    /// Number of the image.
    pub image: usize,
    /// Number of the segment among those of the image.
    pub line: usize,
    /// The segment in image coordinates; `alltracks.txt` does not hold it.
    pub segment: Option<LineSegment2>,
}

impl LineTrack {
    fn image_count(&self) -> usize {
        let images: BTreeSet<usize> = self.supports.iter().map(|s| s.image).collect();
        images.len()
    }
}

/// Writes `alltracks.txt`.
///
/// # Errors
/// If a number is not finite or the file cannot be written.
pub fn write_all_tracks(path: &Path, tracks: &[LineTrack]) -> Result<(), ExportError> {
    let mut text = format!("{}\n", tracks.len());
    for (index, track) in tracks.iter().enumerate() {
        check_finite(path, index, track)?;
        let counts = [index, track.supports.len(), track.image_count()];
        push_row(&mut text, counts.iter());
        for end in track.segment.ends() {
            push_row(&mut text, end.iter());
        }
        push_row(&mut text, track.supports.iter().map(|s| &s.image));
        push_row(&mut text, track.supports.iter().map(|s| &s.line));
    }
    Ok(file::write_atomically(path, text.as_bytes())?)
}

/// Reads an `alltracks.txt`.
///
/// # Errors
/// If the file is missing, ends too early, or holds something that is no number
/// where one must be.
pub fn read_all_tracks(path: &Path) -> Result<Vec<LineTrack>, ExportError> {
    let bytes = file::read(path, "write line tracks first, or give another path")?;
    parse_all_tracks(&bytes, path)
}

/// [`read_all_tracks`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_all_tracks`].
pub fn parse_all_tracks(bytes: &[u8], path: &Path) -> Result<Vec<LineTrack>, ExportError> {
    let mut fields = Fields::new(path, bytes)?;
    let count: usize = fields.parse("the number of tracks")?;
    let mut tracks = Vec::new();
    for _ in 0..count {
        let _track: usize = fields.parse("the number of a track")?;
        let supports: usize = fields.parse("the number of supporting segments")?;
        let _images: usize = fields.parse("the number of supporting images")?;
        let segment = LineSegment3::new(fields.point()?, fields.point()?);
        let ids = fields.ids(supports)?;
        let lines = fields.ids(supports)?;
        tracks.push(LineTrack {
            segment,
            supports: supports_of(ids, lines, None),
        });
    }
    Ok(tracks)
}

/// Writes a folder of one file per track. It must not exist or be empty, because
/// LIMAP takes every track file that lies there.
///
/// # Errors
/// If a number is not finite, a support has no 2D segment, the folder is not
/// empty, or cannot be written.
pub fn write_track_folder(dir: &Path, tracks: &[LineTrack]) -> Result<(), ExportError> {
    let texts: Vec<String> = (tracks.iter().enumerate())
        .map(|(index, track)| track_text(dir, index, track))
        .collect::<Result<_, _>>()?;
    file::write_dir_atomically(dir, |dir| {
        for (index, text) in texts.iter().enumerate() {
            file::write_atomically(&dir.join(track_name(index)), text.as_bytes())?;
        }
        Ok(())
    })?;
    Ok(())
}

fn track_name(index: usize) -> String {
    format!("track_{index}.txt")
}

fn track_text(path: &Path, index: usize, track: &LineTrack) -> Result<String, ExportError> {
    check_finite(path, index, track)?;
    let mut text = String::new();
    let [start, end] = track.segment.ends();
    push_row(&mut text, start.iter().chain(end.iter()));
    push_row(
        &mut text,
        [track.supports.len(), track.image_count()].iter(),
    );
    text.push_str("image_id_list ");
    push_row(&mut text, track.supports.iter().map(|s| &s.image));
    text.push_str("line_id_list ");
    push_row(&mut text, track.supports.iter().map(|s| &s.line));
    text.push_str("line2d_list\n");
    for support in &track.supports {
        let Some(segment) = &support.segment else {
            let reason = format!("track {index} lacks a 2D segment");
            return Err(malformed(path, reason));
        };
        push_row(&mut text, segment.start.iter().chain(segment.end.iter()));
    }
    text.push_str("END\n");
    Ok(text)
}

/// Reads a folder of one file per track. Whatever else lies there is ignored, and
/// so is what the files hold beyond the 2D segments.
///
/// # Errors
/// If the folder or a track between others is missing, or a file breaks the
/// format.
pub fn read_track_folder(dir: &Path) -> Result<Vec<LineTrack>, ExportError> {
    let read_error = |source| SceneError::Read {
        path: dir.into(),
        source,
    };
    let mut count = 0_usize;
    for entry in std::fs::read_dir(dir).map_err(read_error)? {
        let name = entry.map_err(read_error)?.file_name();
        let name = name.to_string_lossy();
        count += usize::from(name.starts_with("track") && name.ends_with(".txt"));
    }
    (0..count)
        .map(|index| read_track(&dir.join(track_name(index))))
        .collect()
}

fn read_track(path: &Path) -> Result<LineTrack, ExportError> {
    let bytes = file::read(path, "tracks are numbered from 0 without a gap")?;
    parse_track(&bytes, path)
}

/// One track of [`read_track_folder`] from the bytes of its file; `path` is for
/// messages.
///
/// # Errors
/// If the file breaks the format.
pub fn parse_track(bytes: &[u8], path: &Path) -> Result<LineTrack, ExportError> {
    let mut fields = Fields::new(path, bytes)?;
    let segment = LineSegment3::new(fields.point()?, fields.point()?);
    let supports: usize = fields.parse("the number of supporting segments")?;
    let _images: usize = fields.parse("the number of supporting images")?;
    fields.keyword("image_id_list")?;
    let images = fields.ids(supports)?;
    fields.keyword("line_id_list")?;
    let lines = fields.ids(supports)?;
    // Early versions of LIMAP end here.
    let segments = if fields.next() == Some("line2d_list") {
        let segment = |_| Ok(LineSegment2::new(fields.pixel()?, fields.pixel()?));
        Some(
            (0..supports)
                .map(segment)
                .collect::<Result<_, ExportError>>()?,
        )
    } else {
        None
    };
    Ok(LineTrack {
        segment,
        supports: supports_of(images, lines, segments),
    })
}

/// Writes `image_list.txt`: the names of the images by their numbers.
///
/// # Errors
/// If a name does not fit on a line or the file cannot be written.
pub fn write_image_list(path: &Path, names: &[String]) -> Result<(), ExportError> {
    let mut text = format!("number of images, {}\n", names.len());
    for (index, name) in names.iter().enumerate() {
        if name.contains(['\n', '\r']) || name.trim() != name || name.is_empty() {
            return Err(ExportError::File(SceneError::ViewName {
                path: path.into(),
                view: name.clone(),
                reason: "does not fit on a line of text: rename it",
            }));
        }
        let _ = writeln!(text, "{index}, {name}");
    }
    Ok(file::write_atomically(path, text.as_bytes())?)
}

/// Reads an `image_list.txt`: numbers and names of the images, in the order of the
/// file.
///
/// # Errors
/// If the file is missing or breaks the format.
pub fn read_image_list(path: &Path) -> Result<Vec<(usize, String)>, ExportError> {
    let bytes = file::read(path, "write the list of images first, or give another path")?;
    parse_image_list(&bytes, path)
}

/// [`read_image_list`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read_image_list`].
pub fn parse_image_list(bytes: &[u8], path: &Path) -> Result<Vec<(usize, String)>, ExportError> {
    let text = text_of(path, bytes)?;
    let mut lines = text.lines();
    let mut record = || {
        let (left, right) = lines.next()?.split_once(',')?;
        Some((left.trim(), right.trim()))
    };
    let broken = || malformed(path, "a line is no number, comma and name".into());
    let (_, count) = record().ok_or_else(broken)?;
    let count: usize = count.parse().map_err(|_| broken())?;
    let mut images = Vec::new();
    for _ in 0..count {
        let (id, name) = record().ok_or_else(broken)?;
        let id = id.parse().map_err(|_| broken())?;
        if name.is_empty() {
            return Err(broken());
        }
        images.push((id, name.to_owned()));
    }
    Ok(images)
}

/// Numbers between spaces, and a line break.
fn push_row<'a, T: std::fmt::Debug + 'a>(text: &mut String, numbers: impl Iterator<Item = &'a T>) {
    for number in numbers {
        // `{:?}` is the shortest text that reads back as the same number.
        let _ = write!(text, "{number:?} ");
    }
    text.push('\n');
}

fn check_finite(path: &Path, index: usize, track: &LineTrack) -> Result<(), ExportError> {
    let in_space = track.segment.ends();
    let in_images = track.supports.iter().filter_map(|s| s.segment);
    let finite = in_space.iter().flatten().all(|x| x.is_finite())
        && in_images
            .flat_map(|segment| segment.ends())
            .all(|end| end.iter().all(|x| x.is_finite()));
    if finite {
        return Ok(());
    }
    let reason = format!("track {index} holds a number that is not finite");
    Err(malformed(path, reason))
}

fn supports_of(
    images: Vec<usize>,
    lines: Vec<usize>,
    segments: Option<Vec<LineSegment2>>,
) -> Vec<TrackSegment> {
    (images.into_iter().zip(lines).enumerate())
        .map(|(index, (image, line))| TrackSegment {
            image,
            line,
            segment: segments.as_ref().map(|segments| segments[index]),
        })
        .collect()
}

fn malformed(path: &Path, reason: String) -> ExportError {
    ExportError::File(SceneError::Malformed {
        path: path.into(),
        reason,
    })
}

fn text_of<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a str, ExportError> {
    std::str::from_utf8(bytes)
        .map_err(|error| malformed(path, format!("it is not UTF-8 text: {error}")))
}

/// What is left of a file, as fields between white space.
struct Fields<'a> {
    path: &'a Path,
    rest: SplitWhitespace<'a>,
}

impl<'a> Fields<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ExportError> {
        let rest = text_of(path, bytes)?.split_whitespace();
        Ok(Self { path, rest })
    }

    fn next(&mut self) -> Option<&'a str> {
        self.rest.next()
    }

    fn parse<T: FromStr>(&mut self, what: &str) -> Result<T, ExportError> {
        let Some(field) = self.next() else {
            return Err(malformed(self.path, format!("it ends before {what}")));
        };
        field
            .parse()
            .map_err(|_| malformed(self.path, format!("`{field}` cannot be {what}")))
    }

    fn keyword(&mut self, expected: &str) -> Result<(), ExportError> {
        let field: String = self.parse(expected)?;
        if field == expected {
            return Ok(());
        }
        let reason = format!("`{field}` stands where `{expected}` must");
        Err(malformed(self.path, reason))
    }

    fn coordinate(&mut self) -> Result<f64, ExportError> {
        let number: f64 = self.parse("a coordinate")?;
        if number.is_finite() {
            return Ok(number);
        }
        let reason = format!("the coordinate {number} is not finite");
        Err(malformed(self.path, reason))
    }

    fn point(&mut self) -> Result<Vector3<f64>, ExportError> {
        Ok(Vector3::new(
            self.coordinate()?,
            self.coordinate()?,
            self.coordinate()?,
        ))
    }

    fn pixel(&mut self) -> Result<Vector2<f64>, ExportError> {
        Ok(Vector2::new(self.coordinate()?, self.coordinate()?))
    }

    /// That many whole numbers. Memory grows with what is there, not with `count`.
    fn ids(&mut self, count: usize) -> Result<Vec<usize>, ExportError> {
        let mut ids = Vec::new();
        for _ in 0..count {
            ids.push(self.parse("the number of an image or a segment")?);
        }
        Ok(ids)
    }
}
