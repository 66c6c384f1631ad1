//! Confidence in `wireframe.json` and as LIMAP's line tracks.

use crate::scenario::{Detector, Scene, adjusted, scene};
use nalgebra::{Vector2, Vector3};
use neat_core::synthetic::Solid;
use neat_core::{LineSegment2, LineSegment3, Similarity, Wireframe3d};
use neat_wireframe::confidence::{Confidence, ConfidenceConfig, assess};
use neat_wireframe::export::{
    LineTrack, TrackSegment, WireframeDocument, read_all_tracks, read_image_list, read_json,
    read_track_folder, write_all_tracks, write_image_list, write_json, write_track_folder,
};
use proptest::prelude::*;
use std::fs;

fn assessed() -> (Scene, Wireframe3d, Confidence) {
    let scene = scene(Solid::LPrism, Detector::Vertices, 0.5, 15, 3);
    let mut wireframe = adjusted(&scene.observations, &scene.truth, 0);
    // A junction that nothing shows.
    wireframe.junctions.push(Vector3::new(0.0, 0.0, 0.9));
    let config = ConfidenceConfig::default();
    let confidence = assess(&wireframe, &scene.observations, None, 1.0, &config).unwrap();
    (scene, wireframe, confidence)
}

#[test]
fn documents_hold_everything_in_the_frame_of_the_user() {
    let (scene, wireframe, confidence) = assessed();
    let original_from_world = Similarity {
        scale: 15.0,
        translation: Vector3::new(5.0, 7.5, 3.0),
    };
    let names: Vec<String> = (0..15).map(|i| format!("image_{i:04}")).collect();
    let original = wireframe.map(|x| original_from_world.apply(x));
    let mut document = WireframeDocument::from(&original);
    confidence.fill(&mut document, &names, &original_from_world);

    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("wireframe.json");
    write_json(&path, &document).unwrap();
    assert_eq!(read_json(&path).unwrap(), document);

    let [xx, xy, _, yy, _, zz] = document.junction_covariances[2].unwrap();
    let expected = confidence.junctions[2].covariance.unwrap() * 225.0;
    assert_eq!(
        [xx, xy, yy, zz],
        [
            expected[(0, 0)],
            expected[(0, 1)],
            expected[(1, 1)],
            expected[(2, 2)]
        ]
    );
    let sigmas = document.junction_fields.sigma.as_ref().unwrap();
    let sigma = sigmas[2];
    assert!(sigma * sigma <= xx + yy + zz && 3.0 * sigma * sigma >= xx + yy + zz);
    assert_eq!(document.junction_covariances.last(), Some(&None));
    assert_eq!(sigmas.last(), Some(&15.0));
    let views = document.junction_fields.supporting_views.as_ref().unwrap();
    assert_eq!(views.last(), Some(&0));
    let fields = document.edge_fields.named();

    for (edge, support) in document.edge_support.iter().enumerate() {
        assert!(fields["probability"][edge] > 0.5);
        assert!(fields["residual_in_pixels"][edge] < 1.5);
        assert!(fields["supporting_views"][edge] <= 15.0);
        let segment = wireframe.segment(edge);
        for support in support {
            let [x0, y0, x1, y1] = support.segment;
            let camera = &scene.observations[support.view].camera;
            let projected = segment.map(|end| camera.project(end).pixel);
            let detected = LineSegment2::new(Vector2::new(x0, y0), Vector2::new(x1, y1));
            // In the order of the junctions, and on the edge.
            let along = projected.end - projected.start;
            assert!(along.dot(&(detected.end - detected.start)) > 0.0);
            assert!(support.residual <= 4.0);
        }
    }
}

#[test]
#[should_panic(expected = "another wireframe")]
fn the_document_of_another_wireframe_is_refused() {
    let (_, _, confidence) = assessed();
    let identity = Similarity::identity();
    confidence.fill(&mut WireframeDocument::default(), &[], &identity);
}

#[test]
fn line_tracks_read_back_as_they_were() {
    let (scene, wireframe, confidence) = assessed();
    let tracks = confidence.line_tracks(&wireframe, &scene.observations, 2);
    assert_eq!(tracks.len(), wireframe.edges.len());
    assert!(tracks.iter().all(|track| track.supports.len() >= 2));
    let dir = tempfile::tempdir().unwrap();

    let folder = dir.path().join("finaltracks");
    write_track_folder(&folder, &tracks).unwrap();
    assert_eq!(read_track_folder(&folder).unwrap(), tracks);
    // LIMAP takes every track that lies there: none of before may stay.
    write_track_folder(&folder, &tracks[..2]).unwrap_err();

    let path = dir.path().join("alltracks.txt");
    write_all_tracks(&path, &tracks).unwrap();
    let mut without_segments = tracks.clone();
    for support in without_segments
        .iter_mut()
        .flat_map(|track| &mut track.supports)
    {
        support.segment = None;
    }
    assert_eq!(read_all_tracks(&path).unwrap(), without_segments);
    let error = write_track_folder(&dir.path().join("other"), &without_segments).unwrap_err();
    assert!(
        error.to_string().contains("cannot be understood"),
        "{error}"
    );

    let path = dir.path().join("image_list.txt");
    let names = ["0000".to_owned(), "a, b".to_owned()];
    write_image_list(&path, &names).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text, "number of images, 2\n0, 0000\n1, a, b\n");
    let expected: Vec<(usize, String)> = names.into_iter().enumerate().collect();
    assert_eq!(read_image_list(&path).unwrap(), expected);
    for name in ["", "a\nb", " a"] {
        write_image_list(&path, &[name.to_owned()]).unwrap_err();
    }
}

/// As LIMAP writes it: ten decimals and auxiliary rows.
#[test]
fn files_of_limap_read() {
    let dir = tempfile::tempdir().unwrap();
    let text = "0.5000000000 -1.0000000000 2.0000000000 0.0 0.0 3.2500000000 \n2 1\n\
        image_id_list 4 4 \nline_id_list 17 3 \nline2d_list\n\
        1.0 2.0 3.0 4.0 \n5.0 6.0 7.0 8.0 \nnode_id_list 0 0 \nscore_list 1.0 1.0 \nEND\n";
    fs::write(dir.path().join("track_0.txt"), text).unwrap();
    fs::write(dir.path().join("config.npy"), "anything").unwrap();
    let tracks = read_track_folder(dir.path()).unwrap();
    assert_eq!(tracks.len(), 1);
    assert_eq!(tracks[0].segment.end, Vector3::new(0.0, 0.0, 3.25));
    let second = TrackSegment {
        image: 4,
        line: 3,
        segment: Some(LineSegment2::new(
            Vector2::new(5.0, 6.0),
            Vector2::new(7.0, 8.0),
        )),
    };
    assert_eq!(tracks[0].supports[1], second);

    // Versions without 2D segments.
    let early = text.split("line2d_list").next().unwrap();
    fs::write(dir.path().join("track_0.txt"), early).unwrap();
    let tracks = read_track_folder(dir.path()).unwrap();
    assert_eq!(tracks[0].supports[1].segment, None);

    fs::write(dir.path().join("track_7.txt"), text).unwrap();
    let error = read_track_folder(dir.path()).unwrap_err().to_string();
    assert!(error.contains("track_1.txt"), "{error}");
}

fn two_tracks() -> Vec<LineTrack> {
    let support = |image, line| TrackSegment {
        image,
        line,
        segment: Some(LineSegment2::new(
            Vector2::new(1.5, 2.0),
            Vector2::new(30.25, 4.0),
        )),
    };
    let track = |x: f64| LineTrack {
        segment: LineSegment3::new(Vector3::x() * x, Vector3::y()),
        supports: vec![support(0, 1), support(2, 11), support(2, 12)],
    };
    vec![track(0.1), track(1e-17)]
}

/// What often breaks parsers.
const AWKWARD: [&str; 8] = [
    "NaN",
    "-inf",
    "1e400",
    "-1",
    "18446744073709551615",
    "999999999999",
    "",
    "line2d_list",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn damaged_files_are_errors_or_finite_tracks(
        at in any::<prop::sample::Index>(),
        awkward in prop::sample::select(AWKWARD.to_vec()),
        truncated in any::<bool>(),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("tracks");
        write_track_folder(&folder, &two_tracks()).unwrap();
        let all = dir.path().join("alltracks.txt");
        write_all_tracks(&all, &two_tracks()).unwrap();
        let list = dir.path().join("image_list.txt");
        write_image_list(&list, &["a".to_owned(), "b".to_owned()]).unwrap();
        let damage = |path: &std::path::Path| {
            let text = fs::read_to_string(path).unwrap();
            let damaged = if truncated {
                text[..at.index(text.len())].to_owned()
            } else {
                let mut fields: Vec<&str> = text.split(' ').collect();
                let index = at.index(fields.len());
                fields[index] = awkward;
                fields.join(" ")
            };
            fs::write(path, damaged).unwrap();
        };
        damage(&folder.join("track_1.txt"));
        damage(&all);
        damage(&list);
        let read = [read_track_folder(&folder), read_all_tracks(&all)];
        for track in read.into_iter().flatten().flatten() {
            prop_assert!(track.segment.ends().iter().flatten().all(|x| x.is_finite()));
        }
        if let Ok(images) = read_image_list(&list) {
            prop_assert!(images.iter().all(|(_, name)| !name.is_empty()));
        }
    }
}
