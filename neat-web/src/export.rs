//! A wireframe for other programs.

use crate::tell::tell;
use neat_core::file;
use neat_export::{ExportOptions, Format, export};
use neat_wireframe::export::read_json;
use serde_json::json;
use std::error::Error;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Writes the wireframe in the file `json` to `out`: a file, also where the format is a
/// folder, which is then in a ZIP archive. Tells what the format could not hold.
///
/// # Errors
/// If there is no such format, or the file cannot be read or written.
pub fn export_document(json: &Path, format: &str, out: &Path) -> Result<(), Box<dyn Error>> {
    let format = Format::from_name(format)?;
    let document = read_json(json)?;
    let folder = out.with_extension("folder");
    let target = match format.is_folder() {
        true => &folder,
        false => out,
    };
    let written = export(&document, target, format, &ExportOptions::default())?;
    if format.is_folder() {
        file::write_atomically(out, &zipped(&folder)?)?;
        fs::remove_dir_all(&folder)?;
    }
    tell(&json!({ "event": "exported", "remarks": written.remarks }));
    Ok(())
}

/// Tells all formats. The ending of a folder is that of its archive.
pub fn tell_formats() {
    let formats: Vec<_> = (Format::ALL.iter())
        .map(|format| {
            let ending = match format.is_folder() {
                true => "zip",
                false => format.endings().first().copied().unwrap_or_default(),
            };
            json!({
                "name": format.name(),
                "ending": ending,
                "explanation": format.explanation(),
            })
        })
        .collect();
    tell(&json!({ "event": "formats", "formats": formats }));
}

/// A ZIP archive of what is in a folder.
fn zipped(folder: &Path) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    add(&mut archive, folder, "")?;
    Ok(archive.finish()?.into_inner())
}

/// Adds all files in and below a folder, sorted, under names that begin with `prefix`.
fn add(
    archive: &mut ZipWriter<Cursor<Vec<u8>>>,
    folder: &Path,
    prefix: &str,
) -> Result<(), Box<dyn Error>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        names.push(entry?.file_name());
    }
    names.sort();
    for name in names {
        let path = folder.join(&name);
        let name = format!("{prefix}{}", name.to_string_lossy());
        if path.is_dir() {
            add(archive, &path, &format!("{name}/"))?;
        } else {
            archive.start_file(name, SimpleFileOptions::default())?;
            archive.write_all(&fs::read(&path)?)?;
        }
    }
    Ok(())
}
