//! LIMAP's line tracks: every edge with the 2D segments that support it.
//!
//! The folder is what LIMAP leaves of a reconstruction: `alltracks.txt`,
//! `finaltracks/track_N.txt` and `image_list.txt`. Tracks know no shared vertices:
//! every edge brings its own two ends.

use crate::ExportError;
use crate::target::Target;
use neat_core::{LineSegment2, file};
use neat_wireframe::export::{
    LineTrack, SupportingSegment, TrackSegment, WireframeDocument, write_all_tracks,
    write_image_list, write_track_folder,
};

/// Fills a new or empty folder.
///
/// The document has no numbers of 2D segments: in every image the supporting ones
/// are counted in the order of the edges.
pub fn write(to: &mut Target) -> Result<(), ExportError> {
    let (dir, document) = (to.path, to.document);
    if document.edge_support.len() != document.edges.len() {
        return Err(ExportError::NoField {
            field: "edge_support",
            option: "the format limap",
        });
    }
    let tracks = line_tracks(document);
    let written = ["image_list.txt", "alltracks.txt", "finaltracks"].map(|name| dir.join(name));
    let [images, all, folder] = &written;
    // Refuses a folder with something in it.
    file::write_dir_atomically(dir, |_| Ok(()))?;
    write_image_list(images, &document.views)?;
    write_all_tracks(all, &tracks)?;
    write_track_folder(folder, &tracks)?;
    to.leave_out_curves("line tracks are straight");
    to.written.files = written.into();
    Ok(())
}

fn line_tracks(document: &WireframeDocument) -> Vec<LineTrack> {
    let mut lines_in_view = vec![0; document.views.len()];
    let mut track_segment = |support: &SupportingSegment| {
        let [x0, y0, x1, y1] = support.segment;
        let line = lines_in_view[support.view];
        lines_in_view[support.view] += 1;
        TrackSegment {
            image: support.view,
            line,
            segment: Some(LineSegment2::new([x0, y0].into(), [x1, y1].into())),
        }
    };
    document
        .wireframe()
        .segments()
        .into_iter()
        .zip(&document.edge_support)
        .map(|(segment, supports)| LineTrack {
            segment,
            supports: supports.iter().map(&mut track_segment).collect(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExportOptions, Format, Written, export};
    use nalgebra::Vector3;
    use neat_wireframe::export::{read_all_tracks, read_image_list, read_track_folder};
    use std::path::Path;

    fn write(dir: &Path, document: &WireframeDocument) -> Result<Written, ExportError> {
        export(document, dir, Format::Limap, &ExportOptions::default())
    }

    #[test]
    fn the_folder_reads_back_as_tracks() {
        let support = |view, x: f64| SupportingSegment {
            view,
            segment: [x, 1.0, 2.5, 1.0 / 3.0],
            residual: 0.25,
        };
        let document = WireframeDocument {
            junctions: vec![Vector3::zeros(), Vector3::x(), Vector3::new(0.1, 0.2, 0.3)],
            edges: vec![[0, 1], [1, 2]],
            views: vec!["a".into(), "b".into()],
            edge_support: vec![
                vec![support(0, 1.0), support(1, 2.0)],
                vec![support(1, 3.0)],
            ],
            ..WireframeDocument::default()
        };
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("limap");
        write(&out, &document).unwrap();
        let tracks = read_track_folder(&out.join("finaltracks")).unwrap();
        assert_eq!(tracks, line_tracks(&document));
        assert_eq!(tracks[1].supports[0].line, 1);
        assert_eq!(tracks[1].segment.start, Vector3::x());
        assert_eq!(
            read_all_tracks(&out.join("alltracks.txt")).unwrap().len(),
            2
        );
        let images = read_image_list(&out.join("image_list.txt")).unwrap();
        assert_eq!(images, [(0, "a".to_owned()), (1, "b".to_owned())]);
        // Not into a folder that holds something, and not without support.
        write(&out, &document).unwrap_err();
        let bare = WireframeDocument::from(&document.wireframe());
        assert!(matches!(
            write(&dir.path().join("bare"), &bare),
            Err(ExportError::NoField { .. })
        ));
    }
}
