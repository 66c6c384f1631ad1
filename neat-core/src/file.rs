//! Whole files: bounded reading, and writing that leaves no half-written file.

use crate::SceneError;
use image::{ImageFormat, RgbImage};
use serde::de::DeserializeOwned;
use std::fs;
use std::io::{self, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// The largest text or array file that is read, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 30;

/// Opens a regular file of at most [`MAX_FILE_BYTES`], and says how long it is.
///
/// Links are followed: whoever owns a folder may keep its files elsewhere. Devices
/// and pipes are not opened, because some of them never end and others wait forever.
pub(crate) fn open(path: &Path, remedy: &str) -> Result<(fs::File, u64), SceneError> {
    let about = fs::metadata(path).map_err(|source| read_error(path, remedy, source))?;
    if !about.is_file() {
        let source = io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file");
        return Err(read_error(path, remedy, source));
    }
    if about.len() > MAX_FILE_BYTES {
        return Err(SceneError::TooLarge {
            path: path.into(),
            limit: MAX_FILE_BYTES,
        });
    }
    let file = fs::File::open(path).map_err(|source| read_error(path, remedy, source))?;
    Ok((file, about.len()))
}

/// Reads a whole file of at most [`MAX_FILE_BYTES`].
///
/// # Errors
/// If it does not exist (the message then gives `remedy`), is empty, is too
/// large, is a folder, a device or a pipe, or cannot be read.
pub fn read(path: &Path, remedy: &str) -> Result<Vec<u8>, SceneError> {
    let (file, _) = open(path, remedy)?;
    let mut bytes = Vec::new();
    // It may grow while it is read.
    file.take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| read_error(path, remedy, source))?;
    if bytes.is_empty() {
        return Err(SceneError::Empty { path: path.into() });
    }
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(SceneError::TooLarge {
            path: path.into(),
            limit: MAX_FILE_BYTES,
        });
    }
    Ok(bytes)
}

/// Reads the bytes of a JSON file of this format; `path` is for messages.
///
/// # Errors
/// If they are no JSON or lack a field.
pub fn parse_json<T: DeserializeOwned>(
    bytes: &[u8],
    path: &Path,
    format: &'static str,
) -> Result<T, SceneError> {
    serde_json::from_slice(bytes).map_err(|source| SceneError::Json {
        path: path.into(),
        format,
        source,
    })
}

/// [`SceneError::Missing`] where the system says "not found", else
/// [`SceneError::Read`].
pub(crate) fn read_error(path: &Path, remedy: &str, source: io::Error) -> SceneError {
    match source.kind() {
        io::ErrorKind::NotFound => SceneError::missing(path, remedy),
        _ => SceneError::Read {
            path: path.into(),
            source,
        },
    }
}

/// Writes a whole file under a temporary name in the same folder, brings it to the
/// disk, then renames it: readers see the old file or the new one, never a part, also
/// after the power went.
///
/// # Errors
/// If the folder does not exist, is read-only, or the disk is full; the
/// temporary file is then removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), SceneError> {
    let temporary = temporary_name(path);
    let written = fs::File::create(&temporary).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let result = written
        .and_then(|()| fs::rename(&temporary, path))
        .and_then(|()| sync_parent(path));
    result.map_err(|source| {
        // The first error is the one to report; a file that was never created
        // cannot be removed.
        let _ = fs::remove_file(&temporary);
        SceneError::write(path, source)
    })
}

/// Brings the name of a file that was renamed to the disk. Only Unix opens folders.
fn sync_parent(path: &Path) -> io::Result<()> {
    #[cfg(unix)]
    if let Some(parent) = path.parent() {
        let parent = if parent.as_os_str().is_empty() {
            Path::new(".")
        } else {
            parent
        };
        match fs::File::open(parent)?.sync_all() {
            // Some network file systems cannot, and need not.
            Err(error) if error.kind() == io::ErrorKind::InvalidInput => {}
            result => result?,
        }
    }
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}

/// Removes what writers that were killed left in a folder: their temporary files and
/// folders. Nobody may be writing into it.
///
/// # Errors
/// If the folder cannot be read, or one of them cannot be removed.
pub fn remove_temporaries(dir: &Path) -> Result<(), SceneError> {
    let entries = fs::read_dir(dir).map_err(|source| read_error(dir, "", source))?;
    for entry in entries {
        let path = entry.map_err(|source| read_error(dir, "", source))?.path();
        if !is_temporary(&path) {
            continue;
        }
        let removed = if path.is_dir() {
            fs::remove_dir_all(&path)
        } else {
            fs::remove_file(&path)
        };
        removed.map_err(|source| SceneError::write(&path, source))?;
    }
    Ok(())
}

/// Creates a folder and its parents.
///
/// # Errors
/// If the system refuses.
pub fn create_dir(path: &Path) -> Result<(), SceneError> {
    fs::create_dir_all(path).map_err(|source| SceneError::write(path, source))
}

/// Fills a new folder under a temporary name beside `dir`, then renames it to
/// `dir`: it appears complete or not at all.
///
/// # Errors
/// If `dir` is a file or a folder that is not empty, `fill` errs, or the system
/// refuses; the temporary folder is then removed.
pub fn write_dir_atomically(
    dir: &Path,
    fill: impl FnOnce(&Path) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    let write_error = |source| SceneError::write(dir, source);
    let exists = dir.symlink_metadata().is_ok();
    if exists && (!dir.is_dir() || fs::read_dir(dir).map_err(write_error)?.next().is_some()) {
        return Err(SceneError::NotEmpty { path: dir.into() });
    }
    let temporary = temporary_name(dir);
    let result = create_dir(&temporary)
        .and_then(|()| fill(&temporary))
        .and_then(|()| {
            // Not every system renames to a folder that exists.
            let removed = if exists { fs::remove_dir(dir) } else { Ok(()) };
            removed
                .and_then(|()| fs::rename(&temporary, dir))
                .map_err(write_error)
        });
    if result.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_dir_all(&temporary);
    }
    result
}

/// `.name.PID.N.tmp` beside `path`: hidden, so that no reader lists it, and
/// another one each time, so that two writers of one file do not meet.
fn temporary_name(path: &Path) -> PathBuf {
    static WRITTEN: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let count = WRITTEN.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!(".{name}.{}.{count}.tmp", process_id()))
}

/// WASI numbers no processes, and asking for a number ends the program: it is alone there.
fn process_id() -> u32 {
    if cfg!(target_os = "wasi") {
        0
    } else {
        std::process::id()
    }
}

/// Whether a file or folder has the name that [`write_atomically`] and
/// [`write_dir_atomically`] give to what is not complete yet.
pub fn is_temporary(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let Some(rest) = (name.strip_prefix('.')).and_then(|name| name.strip_suffix(".tmp")) else {
        return false;
    };
    let mut parts = rest.rsplitn(3, '.');
    let numbers = [parts.next(), parts.next()];
    let is_number = |part: &Option<&str>| {
        part.is_some_and(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()))
    };
    numbers.iter().all(is_number) && parts.next().is_some_and(|name| !name.is_empty())
}

/// Writes a PNG, completely or not at all.
///
/// # Errors
/// If the folder cannot be written or the disk is full.
pub fn write_png(path: &Path, image: &RgbImage) -> Result<(), SceneError> {
    let mut png = Cursor::new(Vec::new());
    image
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|source| SceneError::image(path, source))?;
    write_atomically(path, png.get_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn write_replaces_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        write_atomically(&path, b"old").unwrap();
        write_atomically(&path, b"new").unwrap();
        assert_eq!(read(&path, "").unwrap(), b"new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_killed_writers_left_goes_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let left = temporary_name(&dir.path().join("wireframe.json"));
        fs::write(&left, "half").unwrap();
        fs::create_dir(temporary_name(&dir.path().join("folder"))).unwrap();
        let kept = [
            ".a.tmp",
            ".a.1.tmp",
            "a.1.2.tmp",
            ".a.b.2.tmp",
            ".1.2.tmp",
            ".a.1.2",
        ];
        for name in kept {
            fs::write(dir.path().join(name), "mine").unwrap();
        }
        remove_temporaries(dir.path()).unwrap();
        let mut names: Vec<_> = fs::read_dir(dir.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        let mut expected = kept;
        expected.sort();
        assert_eq!(names, expected);
    }

    #[test]
    fn folders_appear_complete_or_not_at_all() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("a/b");
        let fill = |dir: &Path| write_atomically(&dir.join("file"), b"x");
        let names = |dir: &Path| fs::read_dir(dir).unwrap().count();
        let fails = |dir: &Path| {
            fill(dir)?;
            Err(SceneError::NoView { path: dir.into() })
        };
        assert!(write_dir_atomically(&dir, fails).is_err());
        assert_eq!(names(&parent.path().join("a")), 0);
        fs::create_dir(&dir).unwrap();
        write_dir_atomically(&dir, fill).unwrap();
        assert_eq!((names(&dir), names(&parent.path().join("a"))), (1, 1));
        for occupied in [dir.clone(), dir.join("file")] {
            let error = write_dir_atomically(&occupied, fill).unwrap_err();
            assert!(matches!(error, SceneError::NotEmpty { .. }), "{error}");
        }
        assert!(matches!(
            write_dir_atomically(&dir.join("file/below"), fill),
            Err(SceneError::Write { .. })
        ));
    }

    #[test]
    fn missing_and_empty_files_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let missing = read(&path, "run the detector").unwrap_err().to_string();
        assert!(missing.contains("a.json") && missing.contains("run the detector"));
        fs::write(&path, b"").unwrap();
        assert!(matches!(read(&path, ""), Err(SceneError::Empty { .. })));
        let nowhere = dir.path().join("no/such/folder/a.json");
        assert!(matches!(
            write_atomically(&nowhere, b"x"),
            Err(SceneError::Write { .. })
        ));
    }
}
