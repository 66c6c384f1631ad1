//! The files that a scene was read from, and links among them that lead out of its
//! folder.

use super::masks::MaskFiles;
use super::poses::PosedImage;
use super::{HAWP_DIR, SceneWarning};
use std::path::{Path, PathBuf};

/// What is read beside the file of poses, or in the folder of the scene.
const BESIDE_POSES: [&str; 8] = [
    "cameras.txt",
    "cameras.bin",
    "points3D.txt",
    "points3D.bin",
    "list.txt",
    "sparse_points.ply",
    "sparse_pc.ply",
    "points3D.ply",
];

/// The files that a scene was read from, sorted.
pub(super) fn list(
    dir: &Path,
    poses: &Path,
    images: &[PosedImage],
    masks: Option<MaskFiles>,
) -> Vec<PathBuf> {
    let hawp_dir = dir.join(HAWP_DIR);
    let mut files: Vec<PathBuf> = images.iter().map(|view| view.image.clone()).collect();
    files.extend(
        images
            .iter()
            .map(|view| hawp_dir.join(format!("{}.json", view.name))),
    );
    if poses.is_dir() {
        let entries = poses.read_dir().into_iter().flatten().flatten();
        files.extend(entries.map(|entry| entry.path()));
    } else {
        files.push(poses.into());
        files.extend(BESIDE_POSES.map(|name| poses.with_file_name(name)));
    }
    files.extend(BESIDE_POSES.map(|name| dir.join(name)));
    files.extend(masks.into_iter().flat_map(|masks| masks.files));
    files.retain(|file| file.is_file());
    files.sort();
    files.dedup();
    files
}

/// A warning if some of the `files` of the scene in `dir` lie elsewhere, behind links.
///
/// Names in files never lead out of a scene, but its folder may hold links: people keep
/// photographs on another disk. A folder from a stranger may hold them too, so they
/// are read and told.
pub(super) fn links_outside(dir: &Path, files: &[PathBuf]) -> Option<SceneWarning> {
    let dir = dir.canonicalize().ok()?;
    let leads_out = |file: &&PathBuf| {
        let real = file.canonicalize();
        real.is_ok_and(|real| !real.starts_with(&dir))
    };
    let mut outside = files.iter().filter(leads_out);
    let first = outside.next()?.clone();
    let files = 1 + outside.count();
    Some(SceneWarning::LinksOutside { first, files })
}
