//! Synthetic solids with arcs come back exactly from images and poses: every edge, every face, the
//! volume.

use neat_core::CircularArc;
use neat_core::synthetic::{Frustum, Solid, SyntheticScene, generate};
use neat_detect::{DetectorConfig, detect_views};
use neat_images::assemble::assemble_images;
use neat_images::distilled::Distilled;
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::confidence::ConfidenceConfig;
use neat_wireframe::faces::{MeasuredGraph, ShellGeometry};

const MIN_SEGMENT_SCORE: f64 = 0.05;
/// As far as ends of edges and arcs may be off, as in the published protocol.
const NEAR: f64 = 0.01;

/// What is found of a solid in 60 images.
fn reconstructed(solid: Solid) -> Distilled {
    let config = SyntheticScene {
        solid,
        views: 60,
        ..SyntheticScene::default()
    };
    let mut scene = generate(&config).unwrap().scene;
    let detector = DetectorConfig::default();
    detect_views(&mut scene, &detector).unwrap();
    let views = ViewObservation::from_scene(&scene, MIN_SEGMENT_SCORE);
    let (radius, config) = (scene.sphere_radius, AssembleConfig::default());
    let go_on = &mut |_| Ok(());
    let draft = assemble_images(&scene, &views, None, radius, &detector, &config, go_on).unwrap();
    let assessing = ConfidenceConfig::default();
    (draft.assess(&scene, MIN_SEGMENT_SCORE, None, radius, &assessing)).unwrap()
}

/// Each true straight edge is found once, and nothing else.
fn assert_edges(name: &str, found: &Distilled, truth: &Frustum) {
    let (edges, true_edges) = (found.wireframe.segments(), truth.wireframe().segments());
    assert_eq!(edges.len(), true_edges.len(), "{name}: straight edges");
    for edge in &true_edges {
        let off = |other: &neat_core::LineSegment3| {
            let ends = |a: &neat_core::LineSegment3| {
                (a.start - edge.start).norm().max((a.end - edge.end).norm())
            };
            ends(other).min(ends(&other.reversed()))
        };
        let count = edges.iter().filter(|other| off(other) < NEAR).count();
        assert_eq!(count, 1, "{name}: {edge:?}");
    }
}

/// Each true arc is found once, and no other curve.
fn assert_arcs(name: &str, found: &Distilled, truth: &Frustum) {
    assert_eq!(found.arcs.len(), truth.arcs().len(), "{name}: arcs");
    assert!(found.splines.is_empty() && found.domes.is_empty(), "{name}");
    let middle = |arc: &CircularArc| arc.point_at(0.5 * (arc.angles[0] + arc.angles[1]));
    for arc in truth.arcs() {
        let is_it = |other: &&CircularArc| {
            (other.center - arc.center).norm() < NEAR
                && (other.radius / arc.radius - 1.0).abs() < 0.01
                && (other.sweep() - arc.sweep()).abs() * arc.radius < NEAR
                && (arc.is_closed() || (middle(other) - middle(arc)).norm() < NEAR)
        };
        let count = found.arcs.iter().filter(is_it).count();
        assert_eq!(count, 1, "{name}: {arc:?}");
    }
}

/// The faces are those of one solid.
fn assert_solid(name: &str, found: &Distilled, truth: &Frustum) {
    assert_eq!(found.shells.len(), 1, "{name}: shells");
    let shell = &found.shells[0];
    assert!(shell.closed, "{name}");
    assert_eq!(shell.faces.len(), truth.true_faces().len(), "{name}: faces");
    let graph = MeasuredGraph {
        arcs: &found.arcs,
        ..MeasuredGraph::of(&found.wireframe)
    };
    let volume = ShellGeometry::new(shell, &graph).volume(shell) / truth.volume();
    assert!((volume - 1.0).abs() < 0.01, "{name}: volume {volume}");
}

#[test]
fn solids_with_arcs_come_back_exactly() {
    for solid in Solid::ALL
        .into_iter()
        .filter(|solid| !Solid::POLYHEDRA.contains(solid))
    {
        let (name, truth) = (solid.name(), solid.frustum());
        let found = reconstructed(solid);
        assert_edges(name, &found, &truth);
        assert_arcs(name, &found, &truth);
        assert_solid(name, &found, &truth);
    }
}
