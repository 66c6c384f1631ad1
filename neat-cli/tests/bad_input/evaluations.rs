//! Results that cannot be measured or exported.

use crate::case::{Case, check};
use crate::support::TestScene;
use std::fs;

const EVAL: &str = "eval --pred bad.json --gt scene/gt_wireframe.json";

fn wireframe(scene: &TestScene, text: &str) {
    fs::write(scene.file("bad.json"), text).unwrap();
}

#[test]
fn evaluations() {
    check(
        "evaluations",
        &[
            Case {
                kind: "no such wireframe",
                spoil: |_| (),
                command: EVAL,
                names: &["bad.json does not exist"],
            },
            Case {
                kind: "an empty wireframe file",
                spoil: |scene| wireframe(scene, ""),
                command: EVAL,
                names: &["bad.json is empty"],
            },
            Case {
                kind: "a wireframe that ends early",
                spoil: |scene| wireframe(scene, "{\"junctions\": [[0, 0, 0]"),
                command: EVAL,
                names: &["bad.json", "line 1"],
            },
            Case {
                kind: "an edge to a junction that is not there",
                spoil: |scene| {
                    wireframe(scene, "{\"junctions\": [[0, 0, 0]], \"edges\": [[0, 1]]}");
                },
                command: EVAL,
                names: &["bad.json", "1"],
            },
            Case {
                kind: "a junction that is no point",
                spoil: |scene| wireframe(scene, "{\"junctions\": [[0, 0, null]], \"edges\": []}"),
                command: EVAL,
                names: &["bad.json"],
            },
            Case {
                kind: "JSON that is no wireframe",
                spoil: |scene| wireframe(scene, "[]"),
                command: EVAL,
                names: &["bad.json"],
            },
            Case {
                kind: "a point cloud that ends early",
                spoil: |scene| {
                    let header = "ply\nformat ascii 1.0\nelement vertex 2\n";
                    fs::write(scene.file("cloud.ply"), header).unwrap();
                },
                command: "eval --pred scene/gt_wireframe.json --points cloud.ply",
                names: &["cloud.ply"],
            },
            Case {
                kind: "nothing to compare with",
                spoil: |_| (),
                command: "eval --pred scene/gt_wireframe.json",
                names: &["--gt"],
            },
            Case {
                kind: "an unknown protocol",
                spoil: |_| (),
                command: "eval --pred scene/gt_wireframe.json --gt scene/gt_wireframe.json --protocol best",
                names: &["best", "neat-abc"],
            },
            Case {
                kind: "a protocol that needs points",
                spoil: |_| (),
                command: "eval --pred scene/gt_wireframe.json --gt scene/gt_wireframe.json --protocol limap-tnt",
                names: &["limap-tnt", "--points"],
            },
            Case {
                kind: "a protocol that needs a scene with truth",
                spoil: |_| (),
                command: "eval --pred scene/gt_wireframe.json --gt scene/gt_wireframe.json --protocol surface-and-creases",
                names: &["surface-and-creases", "--truth"],
            },
            Case {
                kind: "a true wireframe without faces",
                spoil: |scene| {
                    wireframe(
                        scene,
                        "{\"junctions\": [[0, 0, 0], [1, 0, 0]], \"lines\": [[0, 1]]}",
                    );
                },
                command: "eval --pred scene/gt_wireframe.json --gt bad.json --protocol cad-faces",
                names: &["cad-faces", "faces"],
            },
            Case {
                kind: "a scene without truth",
                spoil: |_| (),
                command: "eval --pred scene/gt_wireframe.json --truth scene",
                names: &["scene/truth/stats.json does not exist", "mesh.ply"],
            },
            Case {
                kind: "an option without meaning for the protocol",
                spoil: |_| (),
                command: "eval --pred scene/gt_wireframe.json --gt scene/gt_wireframe.json --plane Plane24.mat",
                names: &["--plane", "no meaning for neat-abc"],
            },
        ],
    );
}

#[test]
fn exports() {
    check(
        "exports",
        &[
            Case {
                kind: "a folder that holds no run",
                spoil: |_| (),
                command: "distill scene",
                names: &["scene is not the folder of a run", "config.toml"],
            },
            Case {
                kind: "an unknown format",
                spoil: |_| (),
                command: "export scene/gt_wireframe.json --format dwg",
                names: &["'dwg'", "dxf"],
            },
            Case {
                kind: "a name that says no format",
                spoil: |_| (),
                command: "export scene/gt_wireframe.json --out house.xyz",
                names: &["house.xyz names no format", ".dxf"],
            },
            Case {
                kind: "a scene over another",
                spoil: |_| (),
                command: "convert scene --to colmap --out scene",
                names: &["scene", "a new or an empty folder"],
            },
        ],
    );
}
