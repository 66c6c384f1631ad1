//! Poses and intrinsics that no camera has.

use crate::case::{Case, TRAIN, check};
use crate::support::TestScene;
use neat_core::npz::{NpyArray, NpzReader, write_npz};
use std::collections::BTreeMap;

/// Rewrites `cameras.npz` with changed intrinsics and poses.
pub fn change_cameras(scene: &TestScene, change: impl FnOnce(&mut NpyArray, &mut NpyArray)) {
    let path = scene.file("scene/cameras.npz");
    let mut npz = NpzReader::open(&path, "").unwrap();
    let mut intrinsics = npz.array("intrinsics").unwrap();
    let mut extrinsics = npz.array("extrinsics").unwrap();
    change(&mut intrinsics, &mut extrinsics);
    let arrays = BTreeMap::from([("intrinsics", intrinsics), ("extrinsics", extrinsics)]);
    write_npz(&path, &arrays).unwrap();
}

/// Sets a number of the pose of the first view, 4×4 row by row.
fn set_pose(scene: &TestScene, index: usize, value: f64) {
    change_cameras(scene, |_, extrinsics| extrinsics.values[index] = value);
}

#[test]
fn cameras() {
    check(
        "cameras",
        &[
            Case {
                kind: "intrinsics of a wrong shape",
                spoil: |scene| {
                    change_cameras(scene, |intrinsics, _| intrinsics.shape = vec![4, 9]);
                },
                command: TRAIN,
                names: &["cameras.npz", "`intrinsics`", "[4, 9]", "[N, 3, 3]"],
            },
            Case {
                kind: "fewer intrinsics than poses",
                spoil: |scene| {
                    change_cameras(scene, |intrinsics, _| {
                        intrinsics.shape[0] = 3;
                        intrinsics.values.truncate(27);
                    });
                },
                command: TRAIN,
                names: &["cameras.npz", "3", "4"],
            },
            Case {
                kind: "NaN in a pose",
                spoil: |scene| set_pose(scene, 3, f64::NAN),
                command: TRAIN,
                names: &["cameras.npz", "extrinsics", "NaN"],
            },
            Case {
                kind: "infinity in a pose",
                spoil: |scene| set_pose(scene, 3, f64::INFINITY),
                command: TRAIN,
                names: &["cameras.npz", "extrinsics", "inf"],
            },
            Case {
                kind: "a singular pose",
                spoil: |scene| {
                    change_cameras(scene, |_, extrinsics| {
                        // The first two columns of the rotation become equal.
                        for row in 0..3 {
                            extrinsics.values[4 * row + 1] = extrinsics.values[4 * row];
                        }
                    });
                },
                command: TRAIN,
                names: &["cameras.npz", "view `image_0000`", "singular"],
            },
            Case {
                kind: "a mirrored pose",
                spoil: |scene| {
                    change_cameras(scene, |_, extrinsics| {
                        for row in 0..3 {
                            extrinsics.values[4 * row] *= -1.0;
                        }
                    });
                },
                command: TRAIN,
                names: &[
                    "cameras.npz",
                    "view `image_0000`",
                    "mirrored",
                    "OpenCV axes",
                ],
            },
            Case {
                kind: "a negative focal length",
                spoil: |scene| {
                    change_cameras(scene, |intrinsics, _| intrinsics.values[0] = -70.0);
                },
                command: TRAIN,
                names: &["cameras.npz", "view `image_0000`", "focal length"],
            },
            Case {
                kind: "cameras that do not see the scene sphere",
                spoil: |_| (),
                command: "train scene --out run --backend flex --scene-sphere 100,100,100,0.1",
                names: &["4 of 4 cameras", "`image_0000`", "--scene-sphere"],
            },
            Case {
                kind: "a scene sphere for which there is no evidence",
                spoil: |_| (),
                command: "train scene --out run --backend flex --scene-sphere points",
                names: &["fewer than 20 sparse points", "--scene-sphere"],
            },
        ],
    );
}
